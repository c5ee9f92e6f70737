"""Equation of an elastic link in fixed axes: exact form and constant-transformation form.

Displacements of the ends in fixed axes are S, those in link axes s = T^T S, where T(theta) rotates the
(u, w) of each end. As the link rotates, T has rates, and s' and s'' have more terms than T^T S' and T^T S''.
The thesis takes T as constant (its Appendices E and F) and has no geometric stiffness; that form is kept for
comparison only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from symgen.elements.element import Element
from symgen.mechanics.elastic.beam_matrices import BeamMatrices
from symgen.mechanics.elastic.weights import CONSTANTS, Weight, substituted, turning_ends, weights
from symgen.symbolic.quantity import quantity

COSINE = quantity("c", "1", "cosine of the link's direction")
SINE = quantity("s", "1", "sine of the link's direction")
Pairs = tuple[tuple[int, int], ...]


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
    at = len(element.dofs), _pairs(element.dofs)
    turned, of_ends = turn(*at), ends_among(*at)
    parts = {"damping": local.damping, "stiffness": local.stiffness}
    for of, into, crossed, factor in substituted():
        parts[into] += factor * getattr(local, of) * of_ends[crossed]
    return Equation(
        turned * local.mass * turned.T,
        turned * parts["damping"] * turned.T,
        turned * parts["stiffness"] * turned.T,
        turned * local.load,
    )


def thesis_equation(element: Element, local: Equation) -> Equation:
    """Return the constant-transformation form, in which a uniform translation has inertia forces."""
    turned = transformation(element)
    return Equation(
        turned * local.mass * turned.T,
        turned * local.damping * turned.T,
        turned * local.stiffness * turned.T,
        turned * local.load,
    )


#: Parts of the equation of a link: S'' by mass, S' by damping and gyroscopic, S by the three others.
PARTS = ("mass", "damping", "gyroscopic", "stiffness", "geometric", "motion", "load")
#: Part of each term of the stiffness by the energy of its origin.
_OF_STIFFNESS = {
    "elastic": "stiffness",
    "geometric": "geometric",
    "follower": "geometric",
    "inertia": "motion",
}


def parts_of_equation(
    constants: Mapping[str, sp.MatrixBase], value: Callable[[Weight], sp.Expr], pairs: Pairs
) -> dict[str, sp.ImmutableMatrix]:
    """Return the equation for displacements S in fixed axes by ``PARTS``, its components still in link axes.

    Parameters
    ----------
    constants
        Matrices and load vectors of ``CONSTANTS``, and ``damping``, over the same n unknowns.
    value
        Value of a weight.
    pairs
        Places of the (u, w) among the unknowns that are displacements in fixed axes.
    """
    of_ends = ends_among(len(constants["mass"].row(0)), pairs)
    sums: dict[str, list[sp.MatrixBase]] = {name: [] for name in PARTS}
    sums["damping"].append(constants["damping"])
    for w in (*weights(), *turning_ends()):
        if w.constant in constants:
            matrix = constants[w.constant] * of_ends[w.crossed] if w.crossed else constants[w.constant]
            sums[_part(w)].append(value(w) * matrix)
    return {name: sp.ImmutableMatrix(sp.Add(*terms).doit()) for name, terms in sums.items() if terms}


def _part(w: Weight) -> str:
    if w.into == "damping":
        return "gyroscopic"
    return (
        w.into
        if w.into != "stiffness"
        else "motion"
        if w.crossed
        else _OF_STIFFNESS[CONSTANTS[w.constant].part]
    )


@lru_cache(maxsize=32)
def turn(size: int, pairs: Pairs) -> sp.ImmutableMatrix:
    """Return T, which turns displacements (u, w) among ``size`` unknowns from link axes to fixed axes."""
    whole = sp.eye(size)
    c, s = COSINE.symbol, SINE.symbol
    for i, j in pairs:
        whole[i, i], whole[i, j], whole[j, i], whole[j, j] = c, -s, s, c
    return sp.ImmutableMatrix(whole)


def transformation(element: Element) -> sp.ImmutableMatrix:
    """Return T of the displacements of an element, (E.4) of the thesis."""
    return turn(len(element.dofs), _pairs(element.dofs))


@lru_cache(maxsize=32)
def ends_among(size: int, pairs: Pairs) -> dict[str, sp.ImmutableMatrix]:
    """Return the selectors of these displacements: unchanged, and rotated back by a right angle."""
    ends, quarter = (sp.zeros(size) for _ in range(2))
    for i, j in pairs:
        ends[i, i] = ends[j, j] = quarter[i, j] = 1
        quarter[j, i] = -1
    return {"ends": sp.ImmutableMatrix(ends), "quarter": sp.ImmutableMatrix(quarter)}


def _pairs(dofs: Sequence[str]) -> Pairs:
    return tuple((dofs.index(f"u{node}"), dofs.index(f"w{node}")) for node in "12")
