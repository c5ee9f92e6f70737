"""Jumps of the prescribed motions of a linkage over a range of time."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.failures import PRESCRIBED
from symgen.runtime.integrate.prescribed import check_prescribed
from symgen.runtime.rods.constraints import Constraints

#: Poses at which constraints are compared: at some of them a row may not depend on the value that jumps.
_POSES = 3


def check_rigid_motion(rigid: Any, start: float, stop: float) -> None:
    """Check the model of the linkage under elastic links as :func:`check_drives`."""
    if any(map(PRESCRIBED.search, rigid.description.switches)):
        check_drives(rigid.constraints(), rigid.initial_state().q, start, stop)


def check_drives(constraints: Constraints, q: Array, start: float, stop: float) -> None:
    """Raise SimulationError if a prescribed motion, or its rate, jumps between two times [s].

    ``q`` is a pose of the linkage.
    """
    if not any(map(PRESCRIBED.search, constraints.description.switches)):
        return
    random, size = np.random.default_rng(0), constraints.length(q)

    def prescribed(t: float, pose: Array) -> tuple[Array, Array]:
        return constraints.residual(pose, t) / size, constraints.drift(pose, t) / size

    poses = [q + size * random.uniform(-1.0, 1.0, len(q)) for _ in range(_POSES)]
    motions = [partial(prescribed, pose=pose) for pose in poses]
    check_prescribed(constraints.description.switches, partial(_sides, constraints), motions, start, stop)


def _sides(constraints: Constraints, k: int, times: Array) -> Array:
    """Return the side of a switching point, of tables the piece, at many times."""
    evaluator, d = constraints.evaluator, constraints.description
    parameters = evaluator.parameter_values.copy()
    if is_table := k >= len(d.switches) - d.tables:
        parameters[d.of_held.stop - len(d.switches) + k] = _core.WHICH_PIECE
    of = type(evaluator)(d, evaluator.library, parameters)
    still = np.zeros((len(times), d.coordinates))
    values = of.many_blocks("events", times, still, still)["switches"].reshape(len(times), -1)[:, k]
    return values if is_table else np.where(values < 0.0, -1.0, 1.0)
