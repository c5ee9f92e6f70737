"""Exact derivatives along a run of a loop: the tangent of its steps.

The states between steps are kept. Of many steps at once, stage by stage, kernels give the tangents of the
accelerations of closure and of the efforts: along places, rates, accelerations and parameters. With the
screws S of the variables that are not prescribed, and motions N of the loop, S N^T = 0, those of
accelerations are

    da = -S^+ r - N^T (N M N^T)^-1 N (e - M S^+ r),

where r and e are the tangents of closure and efforts at held accelerations and M those of efforts by these: N
takes out the closing wrench. At the end of a step closure and its rate project the tangents, as the run
projects its state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.integrate.options import Options
from symgen.runtime.linearisation.free_loops import FreePose
from symgen.runtime.linearisation.record import Sensitivity
from symgen.runtime.linearisation.runs import Path, followed, state_of
from symgen.runtime.linearisation.sensitivity import finite
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.result.state import State

Array = NDArray[np.float64]

#: Steps whose tangents are found at once.
_CHUNK = 64


def follow(loop: LoopKernels, rank: int, start: State, chosen: Options, times: Array) -> Path:
    """Carry out a run that steps exactly to the times requested, and keep its states.

    Raises
    ------
    ModelError
        As :func:`symgen.runtime.linearisation.runs.followed`; for loads that jump; where the run takes other
        angles of ball joints.
    SimulationError
        As for :meth:`Model.simulate`.
    """
    from symgen.runtime.loop.motion import problem

    d = loop.description
    if d.switches:
        raise ModelError(f"derivatives of runs are not available for loads that jump: {d.switches[0]}")
    equations = loop.equations(d.having("dependent", "free"), rank, work_of_loads=False)
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


def at_run(
    path: Path,
    pose: Callable[[State], FreePose],
    loop: LoopKernels,
    rank: int,
    by: Sequence[str],
    chosen: Options | None = None,
) -> Sensitivity:
    """Return the derivatives of outputs at the ends of the path.

    Parameters
    ----------
    path
        The run; one without steps is its state alone, and needs no options ``chosen``.
    pose
        Returns the tangents of the loop at a state.
    rank
        Of the screws of dependent variables.
    by
        Tunable parameters, and free variables and their rates, whose values at the start are meant.

    Raises
    ------
    ModelError
        As :class:`FreePose`; for a parameter that opens redundant closure equations.
    SimulationError
        When a derivative is not finite.
    """
    d = loop.description
    own = [p.name for p in d.parameters]
    begin = pose(state_of(path, 0))
    initial = {d.variables[i].name + mark: (k, i) for k, mark in enumerate(("", "'")) for i in begin.free}
    moved = np.array([begin.started(initial[x]) if x in initial else begin.by_parameter(x) for x in by]).T
    parameters = list(dict.fromkeys(name for name in by if name not in initial))
    steps = _Steps(loop, begin.tangents, rank, [own.index(name) for name in parameters])
    seeds = np.array([[float(name == x) for x in by] for name in parameters]).reshape(
        len(parameters), len(by)
    )
    moved = moved[: 2 * d.coordinates]
    found, values, done = [], [], 0
    for end in path.ends:
        if chosen is not None:
            moved = steps.carried(path, done, end, chosen, moved, seeds)
        here = pose(state_of(path, end))
        found.append(here.by_state(moved, parameters, seeds))
        values.append(here.values)
        done = end
    names = {p.name: p.unit for p in d.tunable}
    names |= {name: d.variables[i].unit + ("/s" if k else "") for name, (k, i) in initial.items()}
    along = len(path.t) > 1
    return finite(
        Sensitivity(
            derivatives=np.array(found) if along else found[0],
            outputs=tuple(begin.outputs),
            parameters=tuple(by),
            values=np.array(values) if along else values[0],
            units=begin.outputs | {name: names[name] for name in by},
            t=path.t[[*path.ends]] if along else float(path.t[0]),
        )
    )


@dataclass(frozen=True, slots=True)
class _Poses:
    """Poses in motion: times, variables and rates with a number behind them, accelerations and wrench."""

    t: Array
    rows: Array
    solved: Array


class _Steps:
    """Tangents of the explicit steps of a run by the state before them and by parameters."""

    def __init__(
        self, loop: LoopKernels, tangents: LoopKernels, rank: int, parameters: Sequence[int]
    ) -> None:
        d, n = loop.description, loop.description.coordinates
        self.loop, self.tangents, self.n, self.rank = loop, tangents, n, rank
        self.parameters = parameters
        self.inputs = loop.inputs
        self.moving = [i for i in range(n) if i not in self.inputs]
        self.lengths = np.array([1.0, 1.0, 1.0, d.size, d.size, d.size])
        self.columns = np.array([d.size if v.is_length else 1.0 for v in d.variables])
        self.equations = loop.equations(d.having("dependent", "free"), rank, work_of_loads=False)
        #: Places of state and parameters among the tangents.
        self.size = 3 * n + 6 + len(loop.given)
        self.by = [*self.moving, *(n + i for i in self.moving), *(3 * n + 6 + k for k in parameters)]

    def carried(
        self, path: Path, first: int, last: int, chosen: Options, moved: Array, seeds: Array
    ) -> Array:
        """Return the tangents (2n, columns) of the state after the steps from ``first`` to ``last``."""
        states = 2 * self.n
        for begin in range(first, last, _CHUNK):
            end = min(last, begin + _CHUNK)
            for step in self._maps(path.t[begin : end + 1], path.y[begin : end + 1], chosen):
                moved = step[:, :states] @ moved + step[:, states:] @ seeds
        return moved

    def _maps(self, t: Array, y: Array, chosen: Options) -> Array:
        """Return tangents of ends of steps by states before and parameters, (steps, 2n, columns)."""
        a, b, c = (np.asarray(chosen.method.coefficients[x]) for x in "abc")
        n, width = self.n, 2 * self.n + len(self.parameters)
        h = np.diff(t)
        first = np.zeros((len(h), 2 * n, width))
        first[:, range(2 * n), range(2 * n)] = 1.0
        rates: list[Array] = []
        turned: list[Array] = []
        for s in range(len(b)):
            state, moved = y[:-1].copy(), first.copy()
            for j in np.flatnonzero(a[s, :s]).tolist():
                state += (h * a[s, j])[:, None] * rates[j]
                moved += (h * a[s, j])[:, None, None] * turned[j]
            poses = self._poses(t[:-1] + c[s] * h, state)
            rates.append(np.hstack([state[:, n:], poses.solved[:, :n]]))
            by_state = self._accelerations(poses)
            own = by_state[:, :, : 2 * n] @ moved
            own[:, :, 2 * n :] += by_state[:, :, 2 * n :]
            turned.append(np.concatenate([moved[:, n:], own], axis=1))
        for s in np.flatnonzero(b).tolist():
            first += (h * b[s])[:, None, None] * turned[s]
        return self._closed(self._poses(t[1:], y[1:]), first)

    def _poses(self, t: Array, state: Array) -> _Poses:
        """Return poses with their accelerations and closing wrenches, inputs as prescribed."""
        n = self.n
        solved = self.equations.solutions(t, state)[:, : n + 6]
        rows = np.column_stack([state, np.zeros(len(t))])
        if self.inputs:
            work = np.zeros((len(t), self.loop.work_size + 1))
            prescribed = self.loop.many("inputs", t, rows, work)["inputs"]
            for k, i in enumerate(self.inputs):
                rows[:, i], rows[:, n + i] = prescribed[:, 3 * k], prescribed[:, 3 * k + 1]
        return _Poses(t, rows, solved)

    def _along(self, kernel: str, poses: _Poses, seeds: Array) -> Array:
        """Return the tangents that a kernel gives along directions, one for all poses or one each."""
        work = np.zeros((len(poses.t), self.tangents.work_size + 1))
        work[:, : self.n + 6] = poses.solved
        work[:, self.n + 6 : self.n + 6 + self.size] = seeds
        found = self.tangents.many(kernel, poses.t, poses.rows, work)
        return found[f"{kernel}_tangent"]

    def _seeds(self, poses: _Poses, place: int) -> Array:
        """Return the direction of one number; with a parameter prescribed motions change."""
        n = self.n
        seeds = np.zeros((len(poses.t), self.size))
        seeds[:, place] = 1.0
        if self.inputs and place >= 3 * n + 6:
            prescribed = self._along("prescribed", poses, seeds)
            for k, i in enumerate(self.inputs):
                seeds[:, [i, n + i, 2 * n + i]] = prescribed[:, 3 * k : 3 * k + 3]
        return seeds

    def _screws(self, poses: _Poses) -> tuple[Array, Array]:
        """Return S^+ for scaled closure, (poses, moving, 6), and the motions N, (poses, freedoms, moving)."""
        work = np.zeros((len(poses.t), self.loop.work_size + 1))
        screws = self.loop.many("motion", poses.t, poses.rows, work)["screws"].reshape(-1, 6, self.n)
        scaled = (screws / self.lengths[:, None] * self.columns)[:, :, self.moving]
        left, values, right = np.linalg.svd(scaled)
        r = self.rank
        inverse = (right[:, :r].transpose(0, 2, 1) / values[:, None, :r]) @ left[:, :, :r].transpose(0, 2, 1)
        return inverse, right[:, r:]

    def _accelerations(self, poses: _Poses) -> Array:
        """Return the tangents of accelerations by state and parameters, (poses, n, 2n + parameters)."""
        n, moving, columns = self.n, self.moving, self.columns[self.moving]
        inverse, free = self._screws(poses)
        pushed = [self._along("efforts", poses, self._seeds(poses, 2 * n + i))[:, moving] for i in moving]
        mass = np.stack(pushed, axis=2) * columns[:, None] * columns
        seeds = [self._seeds(poses, place) for place in self.by]
        closure = np.stack([self._along("motion", poses, x)[:, 6:] / self.lengths for x in seeds], axis=2)
        efforts = np.stack([self._along("efforts", poses, x)[:, moving] * columns for x in seeds], axis=2)
        bound = -inverse @ closure
        back = free.transpose(0, 2, 1)
        moved = np.linalg.solve(free @ mass @ back, -free @ (efforts + mass @ bound))
        found = np.zeros((len(poses.t), n, 2 * n + len(self.parameters)))
        places = [x if x < 2 * n else 2 * n + k - 2 * len(moving) for k, x in enumerate(self.by)]
        found[np.ix_(range(len(poses.t)), moving, places)] = columns[:, None] * (bound + back @ moved)
        for k in range(len(self.parameters)):
            for i in self.inputs:
                found[:, i, 2 * n + k] = seeds[2 * len(moving) + k][:, 2 * n + i]
        return found

    def _closed(self, poses: _Poses, maps: Array) -> Array:
        """Return the tangents of ends of steps projected onto closure and its rate."""
        n, moving, columns = self.n, self.moving, self.columns[self.moving, None]
        inverse, _ = self._screws(poses)
        seeds = [self._seeds(poses, x) for x in (*range(2 * n), *self.by[2 * len(moving) :])]
        for i in self.inputs:
            maps[:, [i, n + i]] = 0.0
            for k, of in enumerate(seeds[2 * n :]):
                maps[:, i, 2 * n + k], maps[:, n + i, 2 * n + k] = of[:, i], of[:, n + i]
        held = [x if k < 2 * n else self._without_inputs(x) for k, x in enumerate(seeds)]
        for first, kernel in ((0, "closure"), (n, "motion")):
            by = np.stack([self._along(kernel, poses, x)[:, :6] / self.lengths for x in held], axis=2)
            opened = by[:, :, : 2 * n] @ maps
            opened[:, :, 2 * n :] += by[:, :, 2 * n :]
            maps[:, [first + i for i in moving]] -= columns * (inverse @ opened)
        return maps

    def _without_inputs(self, seeds: Array) -> Array:
        """Return a direction of a parameter without that of prescribed motions."""
        found = seeds.copy()
        found[:, : 3 * self.n] = 0.0
        return found
