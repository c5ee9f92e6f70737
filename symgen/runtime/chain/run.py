"""Runs of a chain, or of many, by the step loop of all runs, which calls the kernels of the recursion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import raise_failure
from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.chain.elimination import Elimination
from symgen.runtime.chain.inputs import apart, repeated, side_by_side
from symgen.runtime.integrate.checkpoint import CheckpointOptions, RunCheckpoints, mark_of
from symgen.runtime.integrate.failures import unfinished
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import OUT_OF_TIME, Progress, out_of_time
from symgen.runtime.integrate.simulate import drive, sample_times, stepper_of
from symgen.runtime.kernels.evaluate import Kernels
from symgen.runtime.kernels.library import Library, address_of, callback
from symgen.runtime.kernels.system_description import SystemDescription
from symgen.runtime.result.recording import counts_of

Forces = ArrayLike | Callable[[float, Array, Array], ArrayLike]


@dataclass(frozen=True, slots=True)
class ChainRun:
    """Samples of a run: ``times`` [s], ``positions`` [m] and ``velocities`` [m/s] of the points over time.

    ``energy`` [J] is that of motion and gravity, of each chain; ``length_drift`` [m] the largest error of a
    length after a step; ``statistics`` counts steps and evaluations.
    """

    times: Array
    positions: Array
    velocities: Array
    energy: Array
    length_drift: float
    statistics: Mapping[str, float]


class _System:
    """A chain, or many side by side in lanes, as equations of the step loop.

    Coordinates are the position of the base and the vectors of the rods.
    """

    def __init__(self, chain: Elimination, batch: tuple[int, ...], forces: Forces | None) -> None:
        n, kernels = chain.rods, chain._kernels
        self.chain, self.batch = chain, batch
        self._lanes = kernels.LANES if batch else 1
        self._groups = -(-int(np.prod(batch)) // self._lanes)
        self.constraints = self._groups * self._lanes * n
        self.size = self._groups * self._lanes * (n + 1) * chain.dimension
        of_rods = (repeated(x, self._lanes) for x in (chain._coupling, chain._mass, chain.lengths))
        given = None if callable(forces) else forces
        load = self.laid_out(chain._force(given, batch))
        head = (n, self._groups, self._lanes, chain.pinned)
        self._parameters = np.concatenate([head, chain.parents, *of_rods, load])
        addresses, owner = dict(kernels.RUN_ADDRESSES), None
        work = kernels.run_work_size(n, self._groups, self._lanes)
        if callable(forces):
            own = addresses["accelerations"]
            sizes = (1, self.size, self.size, len(self._parameters), work, self.size + self.constraints)
            owner = callback(partial(self._forced, forces, own, sizes), sizes, np.dtype(float))
            addresses["accelerations"] = address_of(owner)
        self.library = Library("shipped", addresses, owner)
        self.equations = _core.KernelEquations(
            self.library, self.size, self.constraints, 0, self._parameters, work, 0, 0.0, 0, np.inf
        )

    def _forced(self, forces: Callable[..., ArrayLike], kernel: int, sizes: Any, *arrays: Array) -> None:
        """Evaluate accelerations under the forces at a state, which replace those in the parameters."""
        t, q, u, p, *_ = arrays
        applied = forces(float(t[0]), *self.points(q, u))
        if applied is None:
            raise ModelError("forces returned None, expected the forces on all points [N]")
        p[-self.size :] = self.laid_out(self.chain._force(applied, self.batch))
        _core.call(kernel, sizes, *arrays)

    def laid_out(self, points: Array) -> Array:
        """Return numbers of points or rods of all chains in the order of the kernels."""
        return side_by_side(points, 2, self._lanes).ravel() if self.batch else points.ravel()

    def coordinates(self, points: Array) -> Array:
        """Return coordinates, or their rates, at positions or velocities (..., points, axes)."""
        along = points[..., 1:, :] - points[..., self.chain.parents, :]
        return self.laid_out(np.concatenate([points[..., :1, :], along], axis=-2))

    def points(self, *coordinates: Array) -> list[Array]:
        """Return positions and velocities (..., points, axes) at coordinates and rates."""
        shape = (self.chain.rods + 1, self.chain.dimension)
        found = []
        for numbers in coordinates:
            sums = numbers.reshape(self._groups, -1, self._lanes)
            sums = apart(sums, self.batch, shape) if self.batch else sums.reshape(shape).copy()
            if self.chain._parents is None:
                sums = np.cumsum(sums, axis=-2)
            else:
                for k, inner in enumerate(self.chain.parents):
                    sums[..., k + 1, :] += sums[..., inner, :]
            found.append(sums)
        return found

    def mark(self, chosen: Options, y: Array, times: Array) -> str:
        """Return the hash of a run for its checkpoints; of a function for forces, only that there is one."""
        kernels = self.chain._kernels
        described = SystemDescription("chain", "", "", {}, kernels.EQUATIONS, (), (), (), (), {})
        of = Kernels(described, self.library, self._parameters)
        is_function = self.library.owner is not None
        return mark_of(of, self.library, self.equations, chosen, 0.0, y, times.tolist(), is_function)


def run(
    chain: Elimination,
    positions: ArrayLike,
    velocities: ArrayLike | None,
    forces: Forces | None,
    chosen: Options,
    t_eval: ArrayLike | None,
    keeping: CheckpointOptions | None,
    progress: Progress | None,
) -> ChainRun:
    """Step a chain; checked arguments of :meth:`symgen.runtime.chain.chain.Chain.simulate`."""
    p = chain._points("positions", positions)
    v = np.zeros_like(p) if velocities is None else chain._points("velocities", velocities)
    if not p.size:
        raise ModelError(f"expected one chain or more, got positions of the shape {p.shape}")
    if chain.pinned and np.any(v[..., 0, :]):
        raise ModelError(f"velocities: the base is pinned, expected zero there, got {v[..., 0, :]!r:.80}")
    system = _System(chain, p.shape[:-2], forces)
    y, times = (
        np.concatenate([system.coordinates(p), system.coordinates(v)]),
        sample_times(0.0, chosen, t_eval),
    )
    stepper = stepper_of(system.equations, chosen, 0.0, y, times)
    checkpoints = None
    if keeping is not None:
        checkpoints = RunCheckpoints(stepper, system.mark(chosen, y, times), keeping)
    status, wall = drive(stepper, 0.0, chosen, progress, checkpoints)
    raise_failure()
    result = _result(system, stepper, wall)
    if status != _core.DONE:
        raise SimulationError(_problem(status, stepper, chosen), time=stepper.t, partial=result)
    return result


def _result(system: _System, stepper: _core.Run, wall: float) -> ChainRun:
    states = (system.points(*np.split(y, 2)) for y in stepper.result)
    shape = (-1, 2, *system.batch, system.chain.rods + 1, system.chain.dimension)
    positions, velocities = np.moveaxis(np.array([*states]).reshape(shape), 1, 0)
    energy = system.chain._kinetic(velocities) + system.chain._potential(positions)
    statistics = {**counts_of(stepper, system.equations), "wall_s": wall}
    return ChainRun(stepper.sampled.copy(), positions, velocities, energy, stepper.position_drift, statistics)


def _problem(status: int, stepper: _core.Run, chosen: Options) -> str:
    """Return the message for a run that ended with this status."""
    at = f"at t = {stepper.t:.9g} s after {stepper.steps} steps"
    if status == OUT_OF_TIME:
        return out_of_time(stepper.t, chosen.t_end)
    if status == _core.MORE:
        return unfinished(stepper, chosen, at)
    remedy = "take a smaller step" if chosen.step else "forces or masses may be too large for their scales"
    return f"the motion cannot be continued {at}: {remedy}"
