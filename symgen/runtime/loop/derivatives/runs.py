"""Exact derivatives along a run of a loop: the tangent of its steps, or their transpose.

The states between steps are kept. Compiled code evaluates their stages again, with the gradients of the
accelerations of closure and of the balance of efforts: see ``loop_variations.c``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from symgen.errors import ModelError
from symgen.runtime._variations import LoopVariations
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.integrate.options import Options
from symgen.runtime.kernels.batch import lanes_of
from symgen.runtime.kernels.library import Library
from symgen.runtime.kernels.loop_description import LoopDescription
from symgen.runtime.linearisation.runs import followed
from symgen.runtime.linearisation.steps import StoredTrajectory, of_tangents
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.result.state import State


def follow(loop: LoopKernels, rank: int, start: State, chosen: Options, times: Array) -> StoredTrajectory:
    """Carry out a run that steps exactly to the times requested, and keep its states.

    Raises
    ------
    ModelError
        As :func:`symgen.runtime.linearisation.runs.followed`; for implicit methods, and loads that jump;
        where the run takes other angles of ball joints.
    SimulationError
        As for :meth:`Model.simulate`.
    """
    from symgen.runtime.loop.motion import problem

    d = loop.description
    if d.switches:
        what = "inputs in pieces" if " in the motion of " in d.switches[0] else "loads that jump"
        raise ModelError(f"derivatives of runs are not available for {what}: {d.switches[0]}")
    if chosen.method.kind not in ("explicit", "taylor"):
        raise ModelError(
            f"derivatives of runs of loops are not available for {chosen.method.name}\n"
            "  Choose dop853, taylor, dopri5 or rk4."
        )
    equations = loop.equations(d.dynamic, rank, work_of_loads=False)
    turns = slice(len(d.tunable), len(d.tunable) + len(d.balls))
    path = followed(equations, turns, (), start, chosen, times, lambda *at: problem(loop, *at))
    if path.references.any():
        step = int(np.argmax(path.references.any(axis=1)))
        raise ModelError(
            f"derivatives of the run are not available from t = {path.t[step]:.9g} s on: the angles of a "
            "ball joint come near to a pole\n  Turn the axes of the rows next to the ball (theta, alpha) so "
            "that it lies elsewhere."
        )
    return path


class LoopSteps:
    """The tangents of steps of a loop.

    Parameters
    ----------
    loop
        Its kernels.
    kernels
        Those of the analysis ``loop_variation``, which take vectors where they are compiled.
    rank
        Of the screws of dependent variables.
    method
        The integrator of the run.
    """

    def __init__(
        self, loop: LoopKernels, kernels: tuple[LoopDescription, Library], rank: int, method: Integrator
    ) -> None:
        d = loop.description
        self.integrands: Mapping[str, str] = {}
        self.states = 0
        self._equations = loop.equations(d.dynamic, rank, work_of_loads=False)
        self._method, self._kernels = of_tangents(method), kernels
        self._names = [p.name for p in d.parameters]

    def along(self, by: Sequence[str]) -> LoopVariations:
        """Return the tangents of steps by parameters, and by other names on which the start alone depends."""
        description, library = self._kernels
        width = lanes_of(library, description.name)[0] if library.backend == "c" else 1
        directions = [self._names.index(name) if name in self._names else -1 for name in by]
        return LoopVariations(self._equations, self._method, description, library, width, directions)
