"""Residual and slopes of a linkage in large rotation at a time, with names of rows and columns.

They are those of M a + r(q, v) + J^T lambda = 0 at the state that a run from the start reaches.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.large.collocation import MotionState, settled
from symgen.runtime.elastic.large.linkage import LargeLinkage
from symgen.runtime.elastic.large.passes import refined_run
from symgen.runtime.elastic.large.run import counted, large_motion, least_steps, outputs
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.model.elastic_arguments import LargeRotation
from symgen.runtime.result.modes import AssembledMatrices, LabelledMatrix
from symgen.runtime.result.records import Variable

#: Unit and meaning of the matrices by name.
LARGE = {
    "large_residual": ("N; *m per angle", "r(q, v): forces of strain, damping, rates and weight, loads"),
    "large_mass": ("kg; *m per angle", "mass matrix M(q)"),
    "large_damping": ("N*s/m; *m per angle", "slope of the equation of motion by the rates"),
    "large_stiffness": ("N/m; *m per angle", "slope of the equation of motion by positions and rotations"),
    "large_jacobian": ("1; m per angle", "J of the constraints"),
    "large_multipliers": ("N; *m per angle", "multipliers lambda of M a + r + J^T lambda = 0"),
    "large_state": ("SI", "positions and rotations q, rates v, accelerations a"),
}  # fmt: skip
_STATE = ("q", "v", "a")
#: Samples of the run whose stresses its steps resolve.
_SAMPLES = 33
#: Part of a stride in which rates change little.
_SPAN = 0.1


def large_matrices(motion: ElasticMotion, elements: int, t: float) -> AssembledMatrices:
    """Return the matrices at a time [s] of the run, with a number of elements of each elastic link.

    Raises
    ------
    ModelError
        For a time before the start, and as for runs.
    SimulationError
        When the run does not come to this time.
    """
    if t < 0.0:
        raise ModelError(f"expected a time of zero or more for matrices in large rotation, got {t:g} s")
    linkage, at = reached_at(motion, elements, t) if t else _started(motion, elements)
    n, names, rows = linkage.unknowns, linkage.names, linkage.constraints
    slopes = linkage.slopes(at.t, at.q, at.v, at.a, at.multipliers)
    none = np.zeros((1, linkage.multipliers))
    residual = linkage.residual(np.array([at.t]), at.q[None], at.v[None], np.zeros((1, n)), none)[0]
    found: dict[str, tuple[Array, Sequence[str], Sequence[str]]] = {
        "large_residual": (residual, names, ()),
        "large_jacobian": (linkage.pattern.matrix(slopes.jacobian).toarray()[n:, :n], rows, names),
        "large_multipliers": (at.multipliers, rows, ()),
        "large_state": (np.stack([at.q, at.v, at.a], axis=1), names, _STATE),
    }
    for name in ("mass", "damping", "stiffness"):
        matrix = linkage.pattern.matrix(getattr(slopes, name)).toarray()[:n, :n]
        found[f"large_{name}"] = matrix, names, names
    return AssembledMatrices(
        (name, LabelledMatrix(name, values, tuple(of_rows), tuple(of_columns), *LARGE[name]))
        for name, (values, of_rows, of_columns) in ((name, found[name]) for name in LARGE)
    )


def _started(motion: ElasticMotion, elements: int) -> tuple[LargeLinkage, MotionState]:
    """Return the linkage at the start, of straight links."""
    linkage = LargeLinkage(motion, counted(elements))
    start = linkage.start()
    linkage.restore({})
    span = motion.stride if math.isfinite(motion.stride) else motion.rigid.description.t_end
    return linkage, settled(linkage, start, _SPAN * span, first=True)


def reached_at(motion: ElasticMotion, elements: int, t: float) -> tuple[LargeLinkage, MotionState]:
    """Return the linkage at the end of a run, of the one with the most steps."""
    ends: list[tuple[LargeLinkage, MotionState]] = []

    def recorded(
        motion: ElasticMotion, linkage: LargeLinkage, moments: Sequence[MotionState]
    ) -> list[Variable]:
        ends.append((linkage, moments[-1]))
        return outputs(motion, linkage, moments)

    large = large_motion(motion, elements, recorded)
    refined_run(large, LargeRotation(t_end=t, samples=_SAMPLES), t, least_steps(motion, t))
    return ends[-1]
