"""Rates and forces of a driven loop near a change point, where the equations lose them to rounding.

At a distance s from a change point, with s the least singular value of the screws, a pose is known to eps/s,
rates to eps/s^2, accelerations and forces to eps/s^3. Along its branch they are smooth through the change
point: near it they follow from poses on both sides that are well conditioned, by a polynomial.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.closure.start import Closed
from symgen.runtime.loop.ball_poles import ball_pole
from symgen.runtime.loop.following import COARSE, FINE, FollowedSamples, around
from symgen.runtime.loop.frames import standing
from symgen.runtime.loop.kernels import LoopKernels

#: Least singular value, of the largest, below which accelerations have lost digits that matter.
WEAK = 3e-3
#: Distance of the poses on either side from one another [rad, or sizes of the loop], of the input.
_APART = 0.02
#: Error of the finer interpolation over its difference from the coarser one, at most.
_NEXT = 0.1
#: Factor by which they must be better conditioned than the pose between them.
_BETTER = 3.0
#: Factor by which a difference may exceed the estimated error.
_MARGIN = 1e3
#: Largest error of interpolated poses.
_POSE = 1e-8
#: Defect of closure that rounding leaves.
CLOSED = 18 * float(np.finfo(float).eps)
#: Relative error from which it is reported.
REPORTED = 1e-6
#: Largest error of interpolated places of links at a pole of angles.
_LINKS = 1e-5
#: Largest error of outputs that are smooth there, over their size.
_SMOOTH = 1e-4
#: Outputs below this part of the largest are zero but for rounding.
_NOISE = 1e-9
#: Spacing of numbers at one.
_EPS = float(np.finfo(float).eps)
#: Largest part of a force that its rounding near a pole of angles explains.
_PART = 1e-2
_SHOWN = 6


def refine(
    kernels: LoopKernels, equations: _loop.LoopEquations, begin: Closed, samples: FollowedSamples
) -> Iterator[str]:
    """Replace outputs near change points by their limits along the branch, and report the error of the rest.

    Outputs are replaced in place, and only where they differ by at most their own estimated error.
    """
    if kernels.typed is not None or not len(samples.times):
        return
    sound = samples.diagnosis[:, _loop.SOUNDNESS]
    is_done = samples.diagnosis[:, _loop.STATUS] == _core.DONE
    good = np.flatnonzero(is_done & (sound > _BETTER * WEAK))
    poor = []
    for i in np.flatnonzero(is_done & (sound < WEAK)):
        start = _nearest(samples, begin, good, int(i))
        q = samples.states[i, : len(begin.q)]
        if _refined(kernels, equations, start, samples, int(i)):
            continue
        if not ball_pole(kernels, float(samples.times[i]), q):
            poor.append(i)
        else:
            _continued(kernels, equations, start, samples, int(i))
    for i in np.flatnonzero(samples.diagnosis[:, _loop.STATUS] == _loop.RATES_UNDETERMINED):
        t, q = float(samples.times[i]), samples.states[i, : len(begin.q)]
        names = ball_pole(kernels, t, q)
        start = _nearest(samples, begin, good, int(i))
        left = _continued(kernels, equations, start, samples, int(i)) if names else None
        if left is not None:
            yield (
                f"at {kernels.value_at(t)} the angles of a ball joint have a pole, which is no singularity "
                f"of the loop: {', '.join(names)} are split there as along the branch, and rates, "
                "accelerations and forces are limits from both sides"
                f"{'; left open, since they change too fast there: ' if left else ''}{', '.join(left)}"
            )
    errors = CLOSED / sound[poor] ** 3
    if poor and np.max(errors) > REPORTED:
        reported = [i for i, error in zip(poor, errors, strict=True) if error > REPORTED]
        values = ", ".join(kernels.value_at(float(samples.times[i])) for i in reported[:_SHOWN])
        yield (
            f"near a loss of rank of the screws ({values}{', ...' if len(reported) > _SHOWN else ''}) "
            "rounding "
            f"limits accelerations and forces: relative error up to {min(1.0, np.max(errors)):.0e}"
        )


def _nearest(samples: FollowedSamples, begin: Closed, good: Indices, i: int) -> tuple[float, Array]:
    """Return time and pose of the nearest sample that is well conditioned, else of the start."""
    if not len(good):
        return begin.t, begin.q
    j = int(good[np.argmin(np.abs(good - i))])
    return float(samples.times[j]), samples.states[j, : len(begin.q)]


def _continued(
    kernels: LoopKernels,
    equations: _loop.LoopEquations,
    start: tuple[float, Array],
    samples: FollowedSamples,
    i: int,
) -> list[str] | None:
    """Give a sample at a pole of angles the limits of its outputs; return those that have none.

    Near a pole, where the angles are known and so are their rates, forces alone are replaced, where they
    differ by what rounding explains. None where the branch is not smooth.
    """
    d, t = kernels.description, float(samples.times[i])
    n, info = d.coordinates, d.kernel("outputs")
    beside = around(kernels, equations, start, t, _APART)
    if beside is None or info is None:
        return None
    links = standing(kernels, beside.times, beside.states[:, :n])
    here = standing(kernels, samples.times[i : i + 1], samples.states[i : i + 1, :n])
    if not np.max(np.abs(FINE @ links - here)) < _LINKS:
        return None
    limit, coarse = FINE @ beside.out, COARSE @ beside.out
    size = np.max(np.abs(beside.out), axis=0)
    size = np.maximum(size, _NOISE * np.max(size))  # of outputs that are zero but for rounding
    rough = np.abs(limit - coarse) > _SMOOTH * size
    at_pole = samples.diagnosis[i, _loop.STATUS] == _loop.RATES_UNDETERMINED
    change = np.abs(limit - samples.out[i])
    explained = _MARGIN * _EPS / np.maximum(samples.diagnosis[i, _loop.SOUNDNESS], _EPS) ** 2
    better = ~rough & (_NEXT * np.abs(limit - coarse) < change) & (change < min(explained, _PART) * size)
    names, left = {v.name for v in d.variables}, []
    for b in info.blocks:
        entries = slice(b.offset, b.offset + b.shape[0] * b.shape[1])
        name, _, word = b.name.partition(".")
        if at_pole and b.name not in names:  # values of variables are those of the pose
            samples.out[i, entries] = np.where(rough[entries], np.nan, limit[entries])
            left += [b.name] if np.any(rough[entries]) else []
        elif not at_pole and (name not in names or word == "drive"):
            samples.out[i, entries] = np.where(better[entries], limit[entries], samples.out[i, entries])
    samples.diagnosis[i, _loop.STATUS] = _core.DONE
    return left


def _refined(
    kernels: LoopKernels,
    equations: _loop.LoopEquations,
    start: tuple[float, Array],
    samples: FollowedSamples,
    i: int,
) -> bool:
    """Replace the outputs of a sample by interpolation; return True if its branch is smooth there."""
    t, n = float(samples.times[i]), kernels.description.coordinates
    beside = around(kernels, equations, start, t, _APART)
    if beside is None:
        return False
    sound = float(samples.diagnosis[i, _loop.SOUNDNESS])
    if not np.min(beside.diagnosis[:, _loop.SOUNDNESS]) > _BETTER * sound:
        return False
    pose = np.abs(FINE @ beside.states[:, :n] - samples.states[i, :n]) / kernels.scale
    if not np.max(pose) < _POSE + _MARGIN * CLOSED / sound:
        return False
    limit, coarse = FINE @ beside.out, COARSE @ beside.out
    size = np.maximum(np.max(np.abs(beside.out), axis=0), 1e-300)
    change = np.abs(limit - samples.out[i])
    better = (_NEXT * np.abs(limit - coarse) < change) & (change < _MARGIN * size * CLOSED / sound**3)
    samples.out[i, better] = limit[better]
    return True


def of_blind(kernels: LoopKernels, times: Array) -> Iterator[str]:
    """Return the note on samples at which the screws lose rank."""
    if len(times):
        values = ", ".join(kernels.value_at(float(t)).partition(" = ")[2] for t in times[:_SHOWN])
        more = ", ..." if len(times) > _SHOWN else ""
        yield (
            f"at {kernels.lead.name} = {values}{more} the screws of the joints lose rank: rates and forces "
            "are not determined there and left open, and the loop could branch"
        )
