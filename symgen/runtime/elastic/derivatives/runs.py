"""Exact derivatives of runs of elastic links by parameters: the tangents of their steps.

The elastic motion obeys linear equations, whose coefficients and their tangents follow from the rigid motion
at each time: :mod:`.course`. The step loop of all runs carries the state and its tangents as columns of a
batch. A step solves one linear system for all of them; the loads of the tangents are those of the tangents of
the equations in the motion of the state: see ``core/beam_tangents.c``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import BEAM_METHODS
from symgen.runtime.elastic.derivatives.course import Course
from symgen.runtime.elastic.derivatives.poses import check_smooth, derived
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import Counts
from symgen.runtime.elastic.outputs import outputs as outputs_of
from symgen.runtime.elastic.steps import stepped
from symgen.runtime.kernels.evaluate import UNIT
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of


def sensitivity(
    motion: ElasticMotion,
    outputs: Sequence[str],
    parameters: Sequence[str],
    method: str,
    times: Array,
    counts: Counts,
) -> Sensitivity:
    """Return derivatives of outputs at times [s] of a run from the undeformed state.

    Parameters
    ----------
    method
        Name of a method of implicit steps.
    counts
        Number of steps to each time, in rising order, from the one before it.

    Raises
    ------
    ModelError
        For an unknown output; for a crank with a motor, loads that jump, damping ratios of modes of the
        structure, redundant constraints, and links reduced to modes; where the rigid motion is not smooth.
    SimulationError
        Where the linkage cannot be assembled; when a derivative is not finite.
    """
    check_smooth(motion, "runs", "a motor moves its crank" if motion.has_motor else "")
    course = Course(motion, tuple(parameters), float(np.max(times)))
    still = np.zeros((motion.layout.unknowns, 1 + len(parameters)))
    states, _ = stepped(motion, course.carried(), BEAM_METHODS[method], times, counts, (still, still))
    moved = states[..., :1] + 1j * UNIT * states[..., 1:]
    along = (outputs_of(links, course.rows(j, times), moved[..., j]) for j, links in enumerate(course.links))
    units, values, slopes = derived(outputs, along, "of a run of elastic links")
    return sensitivity_of(motion.rigid.description, units, parameters, values, slopes, times)
