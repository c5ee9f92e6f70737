"""Why a state has no finite accelerations: springs at zero length, locked bearings, dead points of drives."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator

#: A spring shorter than this share of the coordinates is at zero length.
NEAR = 1e-12


#: Ways ahead of the last state at which friction and efforts are tried, over that within reach.
_AHEAD = (0.0, 1.0, 1e3, 1e6)


def cause(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float = 0.0) -> str:
    """Name what has no finite force at a state, or within ``reach`` [m] of it; '' for none."""
    return (
        without_direction(evaluator, t, q, u, reach)
        or locked(evaluator, t, q, u, reach)
        or _idle(evaluator, t, q, u, reach)
    )


def _idle(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float) -> str:
    """Tell whether the drives of unknown effort cannot move what is prescribed, or come to where they cannot.

    Efforts rise towards a dead point, and have the other sign behind it.
    """
    efforts = evaluator.efforts
    if not efforts:
        return ""
    tried = [out[-len(efforts) :] for out in _ahead(evaluator, t, q, u, reach)]
    known = [x for x in tried if np.isfinite(x).all()]
    missing = len(known) < len(tried)
    poles = any(
        np.any((a * b < 0) & (missing | (np.abs(a) > np.abs(known[0])))) for a, b in itertools.pairwise(known)
    )
    if np.isfinite(tried[0]).all() and not poles:
        return ""
    drives, d = ", ".join(name.rpartition(".")[0] for name in efforts), evaluator.description
    moved = [x.removeprefix("the motion of ") for x in d.labels if x.startswith("the motion of ")]
    return f"{drives} cannot move {', '.join(moved)} there: it is at a dead point, or moves another part"


def _ahead(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float) -> Iterator[Array]:
    """Yield the accelerations, and the unknowns behind them, at a state and ahead of it."""
    way = u * (reach / max(float(np.max(np.abs(u), initial=0.0)), 1e-300))
    return (evaluator("accelerations", t, q + part * way, u) for part in _AHEAD)


def locked(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float = 0.0) -> str:
    """Tell whether friction of bearings is lost as its coefficients rise from zero."""
    if not evaluator.couples or evaluator.efforts:
        return ""
    tried = _ahead(evaluator, t, q, u, reach)
    if not any(np.isnan(out[0]) and np.isfinite(out[1:]).all() for out in tried):
        return ""
    return (
        "the linkage locks: as friction of its bearings rises from none to its coefficients, the forces in "
        "them come to have no solution"
    )


def without_direction(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float = 0.0) -> str:
    """Name the shortest spring or actuator if its length is zero, or within ``reach`` [m]."""
    if not evaluator.has("line_lengths"):
        return ""
    lengths = evaluator("line_lengths", t, q, u)
    least = int(np.argmin(lengths))  # that of a length that is not a number, if there is one
    if lengths[least] > max(reach, NEAR * float(np.max(np.abs(q), initial=0.0))):
        return ""
    name = evaluator.info("line_lengths").blocks[0].rows[least]
    if np.isnan(lengths[least]):
        return f"{name} has no length: the place of one of its points is not a number"
    return f"{name} is {lengths[least]:.3g} m long: where its points meet, its force has no direction"
