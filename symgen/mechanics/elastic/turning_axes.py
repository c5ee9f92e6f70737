"""Equation of an elastic link in fixed axes: exact form and constant-transformation form.

Displacements of the ends in fixed axes are S, those in link axes s = T^T S, where T(theta) rotates the
(u, w) of each end. As the link rotates, T has rates, and s' and s'' have more terms than T^T S' and T^T S''.
The thesis takes T as constant (its Appendices E and F) and has no geometric stiffness; that form is kept for
comparison only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from symgen.elements.element import Element
from symgen.mechanics.elastic.beam_matrices import BeamMatrices
from symgen.mechanics.elastic.weights import CONSTANTS, substituted, weights
from symgen.symbolic.quantity import quantity

COSINE = quantity("c", "1", "cosine of the link's direction")
SINE = quantity("s", "1", "sine of the link's direction")


@dataclass(frozen=True, slots=True)
class Equation:
    """Equation mass S'' + damping S' + stiffness S = load of one link at an instant."""

    mass: sp.ImmutableMatrix
    damping: sp.ImmutableMatrix
    stiffness: sp.ImmutableMatrix
    load: sp.ImmutableMatrix


def local_equation(matrices: BeamMatrices, geometric: bool = True) -> Equation:
    """Return the equation in link axes: the constant matrices times their weights.

    Without ``geometric`` stiffness it is that of the thesis, Eqs. (7.24)-(7.27) and (F.5).
    """
    parts = {"mass": [], "damping": [], "stiffness": [], "load": []}  # type: dict[str, list[sp.MatrixBase]]
    for w in weights():
        if w.constant in matrices.constants and (geometric or CONSTANTS[w.constant].part != "geometric"):
            parts[w.into].append(w.value * matrices.constants[w.constant])
    return Equation(*(sp.ImmutableMatrix(sp.Add(*terms).doit()) for terms in parts.values()))


def global_equation(element: Element, local: Equation) -> Equation:
    """Return the equation in fixed axes, with the rates of T: s = T^T S substituted and differentiated."""
    turn, of_ends = _turn(element), _of_ends(element)
    parts = {"damping": local.damping, "stiffness": local.stiffness}
    for of, into, crossed, factor in substituted():
        parts[into] += factor * getattr(local, of) * of_ends[crossed]
    return Equation(
        turn * local.mass * turn.T,
        turn * parts["damping"] * turn.T,
        turn * parts["stiffness"] * turn.T,
        turn * local.load,
    )


def thesis_equation(element: Element, local: Equation) -> Equation:
    """Return the constant-transformation form, in which a uniform translation has inertia forces."""
    turn = _turn(element)
    return Equation(
        turn * local.mass * turn.T,
        turn * local.damping * turn.T,
        turn * local.stiffness * turn.T,
        turn * local.load,
    )


@lru_cache(maxsize=8)
def _turn(element: Element) -> sp.ImmutableMatrix:
    """Return T, which transforms the displacements of both ends from link axes to fixed axes."""
    whole = sp.eye(len(element.dofs))
    c, s = COSINE.symbol, SINE.symbol
    for i, j in _pairs(element.dofs):
        whole[i, i], whole[i, j], whole[j, i], whole[j, j] = c, -s, s, c
    return sp.ImmutableMatrix(whole)


@lru_cache(maxsize=8)
def _of_ends(element: Element) -> dict[str, sp.ImmutableMatrix]:
    """Return the selectors of the end displacements: unchanged, and rotated back by a right angle."""
    ends, quarter = (sp.zeros(len(element.dofs)) for _ in range(2))
    for i, j in _pairs(element.dofs):
        ends[i, i] = ends[j, j] = quarter[i, j] = 1
        quarter[j, i] = -1
    return {"ends": sp.ImmutableMatrix(ends), "quarter": sp.ImmutableMatrix(quarter)}


def _pairs(dofs: Sequence[str]) -> tuple[tuple[int, int], ...]:
    return tuple((dofs.index(f"u{node}"), dofs.index(f"w{node}")) for node in "12")
