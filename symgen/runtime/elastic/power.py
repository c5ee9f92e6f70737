"""Mean power of the shaft of a crank, and of damping, over a steady revolution."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.beams.forces import Motion, own_motion
from symgen.runtime.beams.frames import frames
from symgen.runtime.elastic.motion import ElasticMotion

Array = NDArray[np.float64]

#: Part of the larger by which both may differ without a note, and part of the largest power that is none.
_BALANCED, _NOTHING = 0.05, 1e-9


def mean_powers(motion: ElasticMotion, found: Motion, torque: Array | None) -> tuple[float, float] | None:
    """Return the mean power of the shaft and of damping [W] in a steady state from its torque [N m].

    None where they need not be equal, since something else does work, or where nothing is damped.
    """
    if torque is None or found.rates is None or found.thesis:
        return None
    if motion.info.mode != "held" or not motion.info.shaft_alone:
        return None
    lost, still = np.zeros(len(found.times)), np.zeros_like(found.displacements)
    for k, beam in enumerate(motion.beams):
        _, rates, _ = own_motion(motion, found, still, k, frames(found.links[:, k]))
        for piece in beam.pieces:
            own = rates[:, list(piece.at)]
            lost += np.sum(own * (own @ piece.damping.T), axis=1)
    power = torque * motion.speed
    shaft, damping = float(np.mean(power[:-1])), float(np.mean(lost[:-1]))
    return (shaft, damping) if damping > _NOTHING * float(np.max(np.abs(power))) else None


def of_powers(powers: tuple[float, float] | None) -> Iterator[str]:
    """Say that the two are not equal, as they are in a steady state."""
    if powers is None:
        return
    shaft, damping = powers
    if abs(shaft - damping) > _BALANCED * max(abs(shaft), damping):
        yield (
            f"mean power of the shaft, {shaft:.4g} W, and of damping, {damping:.4g} W, differ: torque and "
            "joint forces are of first order in the deflections, mean power is of second order; compare with "
            "method exact"
        )
