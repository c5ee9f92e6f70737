"""Equilibrium of a linkage with elastic links in space with its input held."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.large.collocation import MotionState
from symgen.runtime.elastic.space.linkage import LinkageInSpace

#: Corrections of an equilibrium at most, and the last one over the sizes of the unknowns.
_MOST, _CLOSE = 40, 1e-11
#: First correction at most of a part of the loads, over the sizes of the unknowns; the smallest part.
_LARGEST, _LEAST = 0.3, 2.0**-12
#: Largest correction over the sizes of the unknowns, beyond which Newton's method has diverged.
_AWAY = 1e9
#: Largest part of loads with a push, so that corrections do not leave its path for an unstable shape.
_PUSHED = 1 / 16
#: Times by which the input is moved to that of a pose.
_POSES = 64
#: Times the mass matrix, with largest entries as those of the stiffness: keeps links from spinning on balls.
_SHIFT = 1e-9


def equilibrium(linkage: LinkageInSpace, t: float, push: Array | None = None) -> MotionState:
    """Return places and multipliers at rest, in equilibrium with the loads at a time [s].

    ``push`` (unknowns,) is a force that acts on the way there, and not in the end.

    Raises
    ------
    ModelError
        Where corrections do not converge, as for a linkage that its loads move.
    """
    moment = linkage.start()
    still = np.zeros(linkage.unknowns)
    end = linkage.rigid.description.t_end
    for time in np.linspace(0.0, t, 2 + int(_POSES * abs(t / end))):
        moment = at_rest(linkage, replace(moment, t=float(time), v=still, a=still), push)
    return moment if push is None else at_rest(linkage, moment)


def at_rest(linkage: LinkageInSpace, moment: MotionState, push: Array | None = None) -> MotionState:
    """Return a motion with the places and multipliers of equilibrium with its rates and second rates.

    The forces that are unbalanced at ``moment`` are applied in parts, as small as the displacements require,
    so that the equilibrium is the one to which the loads bend this shape.

    Raises
    ------
    ModelError
        As :func:`equilibrium`.
    """
    left, reached, most = unbalanced(linkage, moment), 0.0, 1.0 if push is None else _PUSHED
    now, part = moment, most
    pushed = np.zeros_like(left)
    if push is not None:
        pushed[: linkage.unknowns] = push
    while reached < 1.0 and part >= _LEAST:
        then = min(1.0, reached + part)
        found = _corrected(linkage, now, (1.0 - then) * left + then * pushed, _LARGEST)
        if found is None:
            part /= 2
        else:
            now, part, reached = found, min(2 * part, most), then
    if reached < 1.0:
        # A linkage that its loads move may find its pose at once.
        found = _corrected(linkage, moment, pushed, _AWAY)
        if found is None:
            raise ModelError(
                f"{linkage.name}: no equilibrium with the input held at t = {moment.t:g} s, or none to which "
                f"loads bend the drawing: they were increased to {reached:.3g} of their size\n"
                "  Loads must not move a linkage whose input is held."
            )
        now = found
    return now


def unbalanced(linkage: LinkageInSpace, at: MotionState) -> Array:
    """Return the unbalanced forces and the errors of the constraints, (unknowns + multipliers,)."""
    state = (x[None] for x in (at.q, at.v, at.a, at.multipliers))
    return np.concatenate([linkage.residual(np.array([at.t]), *state)[0], linkage.errors(at.t, at.q)])


def _corrected(linkage: LinkageInSpace, at: MotionState, left: Array, largest: float) -> MotionState | None:
    """Return a motion with these unbalanced forces and errors by Newton's method, or None if it fails."""
    n = linkage.unknowns
    for count in range(_MOST):
        change = held(linkage, at)(unbalanced(linkage, at) - left)
        size = float(np.max(np.abs(change[:n]) / linkage.scale))
        if not size <= (_AWAY if count else largest):
            return None
        at = replace(at, q=at.q - change[:n], multipliers=at.multipliers - change[n:])
        if size <= _CLOSE:
            return at
    return None


def held(linkage: LinkageInSpace, at: MotionState) -> Callable[[Array], Array]:
    """Return the change of places and multipliers at rest by a change of forces and errors of constraints."""
    slopes = linkage.slopes(at.t, at.q, at.v, at.a, at.multipliers)
    shift = _SHIFT * np.max(np.abs(slopes.stiffness)) / np.max(np.abs(slopes.mass))
    return linkage.pattern.factorised(slopes.stiffness + shift * slopes.mass + slopes.jacobian)
