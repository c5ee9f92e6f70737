"""Why a state has no finite accelerations: springs at zero length, locked bearings, dead points of drives."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.integrate.redundancy import motions_of
from symgen.runtime.kernels.evaluate import Evaluator

#: Remedy where drives do not determine the motion.
MORE_DRIVES = (
    'Add [[drivers]] with link = "..." and angle = "speed*t", give a massless link a length by t, a ground '
    "point a motion, or prescribe a place or an angle under [[motions]]."
)
#: A spring shorter than this share of the coordinates is at zero length.
NEAR = 1e-12


#: Ways ahead of the last state at which friction and efforts are tried, over that within reach.
_AHEAD = (0.0, 1.0, 1e3, 1e6)


class Cause(NamedTuple):
    """What has no finite force at a state, and the remedy."""

    text: str
    remedy: str


def cause(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float = 0.0) -> Cause | None:
    """Return what has no finite force at a state, or within ``reach`` [m] of it; None for nothing known."""
    return (
        without_direction(evaluator, t, q, u, reach)
        or locked(evaluator, t, q, u, reach)
        or _idle(evaluator, t, q, u, reach)
    )


def _idle(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float) -> Cause | None:
    """Tell whether the drives of unknown effort cannot move what is prescribed, or come to where they cannot.

    Efforts rise towards a dead point, and have the other sign behind it.
    """
    efforts = evaluator.efforts
    if not efforts:
        return None
    tried = [out[-len(efforts) :] for out in _ahead(evaluator, t, q, u, reach)]
    known = [x for x in tried if np.isfinite(x).all()]
    missing = len(known) < len(tried)
    poles = any(
        np.any((a * b < 0) & (missing | (np.abs(a) > np.abs(known[0])))) for a, b in itertools.pairwise(known)
    )
    if np.isfinite(tried[0]).all() and not poles:
        return None
    d, drives = evaluator.description, drives_of(evaluator)
    moved = ", ".join(d.labels[i].removeprefix("the motion of ") for i in motions_of(d))
    return Cause(
        f"{drives} cannot move {moved} there: it is at a dead point, or moves another part",
        "Choose drives that move it there, other motions, or an end of the run before.",
    )


def drives_of(evaluator: Evaluator) -> str:
    """Return the names of the drives of unknown effort."""
    return ", ".join(name.rpartition(".")[0] for name in evaluator.efforts)


def _ahead(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float) -> Iterator[Array]:
    """Yield the accelerations, and the unknowns behind them, at a state and ahead of it."""
    way = u * (reach / max(float(np.max(np.abs(u), initial=0.0)), 1e-300))
    return (evaluator("accelerations", t, q + part * way, u) for part in _AHEAD)


def locked(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float = 0.0) -> Cause | None:
    """Tell whether friction of bearings is lost as its coefficients rise from zero."""
    if not evaluator.couples or evaluator.efforts:
        return None
    tried = _ahead(evaluator, t, q, u, reach)
    if not any(np.isnan(out[0]) and np.isfinite(out[1:]).all() for out in tried):
        return None
    return Cause(
        "the linkage locks: as friction of its bearings rises from none to its coefficients, the forces in "
        "them come to have no solution",
        "Give smaller coefficients or radii, or end the run before.",
    )


def without_direction(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float = 0.0) -> Cause | None:
    """Return the shortest spring or actuator as a cause if its length is zero, or within ``reach`` [m]."""
    if not evaluator.has("line_lengths"):
        return None
    lengths = evaluator("line_lengths", t, q, u)
    least = int(np.argmin(lengths))  # that of a length that is not a number, if there is one
    if lengths[least] > max(reach, NEAR * float(np.max(np.abs(q), initial=0.0))):
        return None
    name = evaluator.info("line_lengths").blocks[0].rows[least]
    remedy = 'Keep its points apart. A spring of length = "0 m" without damping has a force there, zero.'
    if np.isnan(lengths[least]):
        return Cause(f"{name} has no length: the place of one of its points is not a number", remedy)
    return Cause(
        f"{name} is {lengths[least]:.3g} m long: where its points meet, its force has no direction", remedy
    )
