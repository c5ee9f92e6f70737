"""The equation of an elastic link in axes that do not turn: exact, and as the thesis has it.

Displacements of the ends in fixed axes are S, those in the link's axes s = T^T S with T(theta) the turn of
each end's (u, w). As the link turns, T has rates, and s' and s'' have more terms than T^T S' and T^T S''. The
thesis takes T for constant (its Appendices E and F); that form is here for comparison only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from symgen.elements.element import Element
from symgen.mechanics.beam_matrices import BeamMatrices
from symgen.mechanics.hamilton import AX, AY, N0, OMEGA, OMEGA_RATE
from symgen.symbolic.quantity import quantity

COSINE = quantity("c", "1", "cosine of the link's direction")
SINE = quantity("s", "1", "sine of the link's direction")


@dataclass(frozen=True, slots=True)
class Equation:
    """The equation mass S'' + damping S' + stiffness S = load of one link at an instant."""

    mass: sp.ImmutableMatrix
    damping: sp.ImmutableMatrix
    stiffness: sp.ImmutableMatrix
    load: sp.ImmutableMatrix


def local_equation(found: BeamMatrices) -> Equation:
    """Return the equation in the link's own axes, Eqs. (7.24)-(7.28) with geometric stiffness."""
    omega, rate, ax, ay, force = (q.symbol for q in (OMEGA, OMEGA_RATE, AX, AY, N0))
    tension, pushed, outward = found.geometric
    return Equation(
        found.mass,
        -2 * omega * found.gyroscopic,
        found.stiffness
        - omega**2 * found.centrifugal
        - rate * found.gyroscopic
        + force * tension
        + ax * pushed
        - omega**2 * outward,
        -ax * found.load_x - ay * found.load_y + omega**2 * found.load_out - rate * found.load_turn,
    )


def global_equation(element: Element, local: Equation) -> Equation:
    """Return the equation in fixed axes, with the rates of T: s = T^T S put in and differentiated."""
    turn, first, second = _turns(element)
    omega, rate = OMEGA.symbol, OMEGA_RATE.symbol
    by_rate = (omega * first).T
    by_second_rate = (rate * first + omega**2 * second).T
    return Equation(
        turn * local.mass * turn.T,
        turn * (local.damping * turn.T + 2 * local.mass * by_rate),
        turn * (local.stiffness * turn.T + local.damping * by_rate + local.mass * by_second_rate),
        turn * local.load,
    )


def thesis_equation(element: Element, local: Equation) -> Equation:
    """Return the thesis' form, T constant: it has inertia forces where a link is shifted uniformly."""
    turn, _, _ = _turns(element)
    return Equation(
        turn * local.mass * turn.T,
        turn * local.damping * turn.T,
        turn * local.stiffness * turn.T,
        turn * local.load,
    )


@lru_cache(maxsize=8)
def _turns(element: Element) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix, sp.ImmutableMatrix]:
    """Return T, and its first and second derivative by the link's direction."""
    theta = sp.Symbol("theta", real=True)
    whole = sp.eye(len(element.dofs))
    for i, j in _pairs(element.dofs):
        turn = sp.Matrix([[sp.cos(theta), -sp.sin(theta)], [sp.sin(theta), sp.cos(theta)]])
        whole[i, i], whole[i, j], whole[j, i], whole[j, j] = turn
    known = {sp.cos(theta): COSINE.symbol, sp.sin(theta): SINE.symbol}
    first, second, third = (sp.ImmutableMatrix(whole.diff(theta, k) if k else whole) for k in range(3))
    return first.xreplace(known), second.xreplace(known), third.xreplace(known)


def _pairs(dofs: Sequence[str]) -> tuple[tuple[int, int], ...]:
    return tuple((dofs.index(f"u{node}"), dofs.index(f"w{node}")) for node in "12")
