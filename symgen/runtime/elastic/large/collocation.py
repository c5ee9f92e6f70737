"""Systems with constraints and their motion by collocation at Gauss points: see ``core/collocation.c``.

Without constraints the method conserves quadratic invariants, and dissipates nothing.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import raise_failure
from symgen.errors import SimulationError
from symgen.runtime import _core
from symgen.runtime._constrained import Constrained, Part, SystemMotion
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.methods import BeamMethod
from symgen.runtime.integrate.checkpoint import Checkpoints
from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import OUT_OF_TIME, OutOfTime, Progress
from symgen.runtime.integrate.simulate import drive, effects_of, stepper_of
from symgen.runtime.kernels.evaluate import Evaluator

#: Error that corrections leave in the places over their sizes, and in the rates over the largest of a step.
CLOSE = 1e-12
#: Steps whose prescribed numbers are evaluated together.
_TOGETHER = 1024
#: Part of a step over which the rates of the constraints are differentiated in time.
PART = 1e-3


@dataclass(frozen=True, slots=True)
class MotionState:
    """Places, rates, second rates (unknowns,) and multipliers at a time [s].

    ``work`` is that of moving constraints and of loads without potential less what damping dissipates, from
    the start on [J].
    """

    t: float
    q: Array
    v: Array
    a: Array
    multipliers: Array
    work: float = 0.0


def stacked(moments: Sequence[MotionState]) -> tuple[Array, ...]:
    """Return times, places, rates, second rates and multipliers of a motion, each (times, numbers)."""
    names = "t", "q", "v", "a", "multipliers"
    return tuple(np.array([getattr(moment, name) for moment in moments]) for name in names)


@dataclass(frozen=True, slots=True)
class SystemSlopes:
    """Slopes by second rates, rates and places, and of the constraints, over the slots of a pattern."""

    mass: Array
    damping: Array
    stiffness: Array
    jacobian: Array


class EnvelopePattern:
    """The slots of the matrix [W, J^T; J, 0] of a system, in the envelope of its entries.

    They are those of the rows below the diagonal, of the columns above it, and of the diagonal, in an order
    of least band width in which each constraint follows the last of its unknowns.

    Parameters
    ----------
    pairs
        Rows and columns of the entries of W, (2, entries).
    bound
        Rows and columns of the entries of J, (2, slopes).
    unknowns, multipliers
        Sizes of W and of J.

    Attributes
    ----------
    position
        Place of each unknown and multiplier in that order.
    first, starts
        Column of the first entry of each row, and its slot; one more start is the number of slots below.
    size
        Number of slots.
    """

    def __init__(self, pairs: Indices, bound: Indices, unknowns: int, multipliers: int) -> None:
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        count = unknowns + multipliers
        lower = bound + np.array([[unknowns], [0]])
        row, column = np.hstack([pairs, lower, lower[::-1]])
        graph = csr_array((np.ones(len(row)), (row, column)), shape=(count, count))
        position = np.zeros(count)
        position[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(count)
        position[unknowns:] = 0.0
        np.maximum.at(position, lower[0], position[bound[1]] + 0.5)
        order = np.argsort(position, kind="stable")
        self.position = np.argsort(order)
        row, column = self.position[row], self.position[column]
        self.first = np.arange(count)
        np.minimum.at(self.first, np.maximum(row, column), np.minimum(row, column))
        self.starts = np.append(0, np.cumsum(np.arange(count) - self.first))
        self.size = int(2 * self.starts[-1] + count)

    def slots(self, row: Indices, column: Indices) -> Indices:
        """Return the slots of entries, within the envelope."""
        i, j = (np.take(self.position, x, mode="clip") for x in (row, column))
        low, high = np.minimum(i, j), np.maximum(i, j)
        below = self.starts[high] + low - self.first[high]
        count = self.starts[-1]
        return np.where(i > j, below, np.where(i < j, below + count, i + 2 * count))

    @cached_property
    def places(self) -> tuple[Indices, Indices]:
        """Row and column of every slot."""
        count = len(self.position)
        rows = np.repeat(np.arange(count), np.diff(self.starts))
        other = np.arange(self.starts[-1]) - self.starts[rows] + self.first[rows]
        of, diagonal = np.argsort(self.position), np.arange(count)
        return of[np.concatenate([rows, other, diagonal])], of[np.concatenate([other, rows, diagonal])]

    def matrix(self, entries: Array) -> Any:
        """Return the matrix, compressed by columns, by its numbers at the slots."""
        from scipy.sparse import csc_array

        (row, column), count, nonzero = self.places, len(self.position), np.flatnonzero(entries)
        return csc_array((entries[nonzero], (row[nonzero], column[nonzero])), shape=(count, count))

    def factorised(self, entries: Array) -> Callable[[Array], Array]:
        """Return the solution by its right-hand side; nan where the matrix is singular."""
        from scipy.sparse.linalg import splu

        try:
            solve: Callable[[Array], Array] = splu(self.matrix(entries)).solve
        except RuntimeError:
            return lambda right: np.full_like(right, math.nan)
        return solve


class ConstrainedSystem:
    """A mechanical system of parts with constraints Phi(t, q) = 0, at one or more times in each call.

    Parameters
    ----------
    name
        That of the linkage.
    parts
        Elements, constraints, rigid components and loads.
    scale
        Sizes of the unknowns, (unknowns,): lengths, and one radian.
    multipliers, known
        Numbers of constraints, and of prescribed numbers.
    """

    def __init__(self, name: str, parts: Sequence[Part], scale: Array, multipliers: int, known: int) -> None:
        self.name, self.scale, self.unknowns, self.multipliers = name, scale, len(scale), multipliers
        pairs, bound = (np.concatenate([getattr(p, of) for p in parts], axis=1) for of in ("pairs", "bound"))
        bound = bound[:, bound[1] < self.unknowns]
        self.pattern = EnvelopePattern(pairs, bound, self.unknowns, multipliers)
        self.core = Constrained(self.unknowns, multipliers, known, self.pattern, parts)

    #: Values of the tunable parameters in use; None for those of the model.
    taken: Array | None = None

    def start(self) -> MotionState:
        """Return the motion at the start."""
        raise NotImplementedError

    def take_parameters(self, values: Array) -> None:
        """Take values of the tunable parameters, of which loads alone depend on those that change."""
        self.taken = values

    @property
    def follows(self) -> bool:
        """Whether it takes note of the motion before each step."""
        return False

    def follow(self, t: float, q: Array, v: Array) -> None:
        """Record the motion before a step."""

    def recall(self, t: float) -> None:
        """Use the records up to a time [s] of the run."""

    def memory(self) -> dict[str, Array]:
        """Return these records."""
        return {}

    def restore(self, memory: Mapping[str, Array]) -> None:
        """Restore these notes; without any, forget the motion of other runs."""

    def prescribed(self, t: Array) -> tuple[Array, Array]:
        """Return the prescribed numbers and their rates, (times, numbers) each."""
        raise NotImplementedError

    def energies(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return kinetic, strain and potential energy [J] and the power of damping [W], (4, times)."""
        raise NotImplementedError

    @property
    def accounted(self) -> bool:
        """Whether the work of motions is that of all forces without potential."""
        return True

    def residual(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array:
        """Return M a + internal forces - f + J^T lambda, (times, unknowns), of states (times, unknowns)."""
        return self.core.forces(t, q, v, a, multipliers, *self.prescribed(t))

    def rates(self, t: Array, q: Array, v: Array) -> Array:
        """Return the rates of the constraints, J v + Phi_t, (times, multipliers)."""
        return self.core.rows(t, q, v, *self.prescribed(t))[1]

    def errors(self, t: float, q: Array) -> Array:
        """Return the errors of the constraints Phi, (multipliers,)."""
        time = np.array([t])
        return self.core.rows(time, q[None], np.zeros((1, self.unknowns)), *self.prescribed(time))[0][0]

    def slopes(self, t: float, q: Array, v: Array, a: Array, multipliers: Array) -> SystemSlopes:
        """Return the slopes at a state."""
        time = np.array([t])
        state = q[None], v[None], a[None], multipliers[None]
        return SystemSlopes(*self.core.slopes(time, *state, *self.prescribed(time)))


def settled(system: ConstrainedSystem, at: MotionState, span: float, first: bool = False) -> MotionState:
    """Return a motion with the second rates and multipliers at its time.

    They are those of the equation of motion and of the second rate of the constraints, which is the
    difference of first rates, to the fourth order, over a part of ``span`` [s]: on both sides, or after the
    ``first`` moment.
    """
    t, q, v, n = np.array([at.t]), at.q, at.v, system.unknowns
    still, none = np.zeros((1, n)), np.zeros((1, system.multipliers))
    state = (t, q[None], v[None], still, none, *system.prescribed(t))
    weights = np.array([-25.0, 48.0, -36.0, 16.0, -3.0] if first else [1.0, -8.0, 0.0, 8.0, -1.0])
    offsets = PART * span * (np.arange(5.0) - (0 if first else 2))
    near = system.rates(at.t + offsets, q + np.outer(offsets, v), np.broadcast_to(v, (5, n)))
    changes = weights @ near / (12 * PART * span)
    solution = system.core.accelerated(-np.append(system.core.forces(*state)[0], changes), *state)
    return MotionState(at.t, q, v, solution[:n], solution[n:], at.work)


@cache
def integrator_of_systems(method: BeamMethod) -> Integrator:
    """Return a method with an even number of stages for the step loop."""
    values, vectors = np.linalg.eig(method.a)
    # The second factor of each pair is the complex conjugate.
    pairs, stages = np.flatnonzero(values.imag > 0.0), len(method.c)
    of_pairs = values[pairs], vectors[:, pairs], np.linalg.inv(vectors)[pairs]
    coefficients: dict[str, ArrayLike] = {
        "stages": stages,
        "powers": np.linalg.inv(np.vander(method.c, increasing=True)),
        **method.arrays,
        **{
            n: np.ravel(x).view(float)
            for n, x in zip(("eigenvalues", "vectors", "inverse"), of_pairs, strict=True)
        },
    }
    return Integrator(method.name, "collocation", "collocation", method.order, stages, 0, coefficients)


class SystemRun:
    """A run of a system by collocation, with equal steps between equally spaced times.

    Parameters
    ----------
    times
        From the start to the end [s].
    initial
        Motion at the start, by default that of the system.
    close
        Error that corrections leave, as :data:`CLOSE`.
    rigid
        The linkage with rigid links, whose coordinates are the first unknowns and whose events are located.
    """

    def __init__(
        self,
        system: ConstrainedSystem,
        method: BeamMethod,
        times: Array,
        steps: int,
        initial: MotionState | None = None,
        close: float = CLOSE,
        rigid: Evaluator | None = None,
    ) -> None:
        t0, end = float(times[0]), float(times[-1])
        self.system, self.steps, self._start = system, steps, t0
        self._count, self._h = steps * (len(times) - 1), (end - t0) / (len(times) - 1) / steps
        self._within = np.concatenate([[0.5], method.c, [1.0]])
        start = initial or system.start()
        system.restore({})
        self._first = settled(system, start, self._h, first=True)
        events = rigid.description.events if rigid else ()
        self.equations = SystemMotion(
            system.core,
            system.scale,
            len(method.c),
            self._prescribed,
            system.follow if system.follows else None,
            np.tile(self._first.a, len(method.c)),
            np.tile(self._first.multipliers, len(method.c)),
            rigid if events else None,
        )
        self._options = Options(
            integrator_of_systems(method),
            end,
            close,
            0.0,
            self._h,
            len(times),
            sys.maxsize,
            stabilisation="raw",
        )
        self.stepper = stepper_of(
            self.equations,
            self._options,
            t0,
            np.concatenate([start.q, start.v, [start.work]]),
            np.ascontiguousarray(times),
            directions=[e.direction for e in events],
            terminal=effects_of(events),
        )

    def _prescribed(self, step: int, *_: float) -> tuple[int, Array, Array]:
        """Return the first of some steps and their prescribed numbers, the same after a run was resumed."""
        first = step - step % _TOGETHER
        steps = np.arange(first, min(first + _TOGETHER, self._count))[:, None]
        z, rates = self.system.prescribed((self._start + self._h * (steps + self._within)).ravel())
        shape = len(steps), len(self._within), z.shape[1]
        return first, z.reshape(shape), rates.reshape(shape)

    def run(self, progress: Progress | None = None, checkpoints: Checkpoints | None = None) -> SystemRun:
        """Step to the end, or to an event that ends the run.

        Raises
        ------
        SimulationError
            Where Newton's method does not converge.
        OutOfTime
            When the wall time is spent.
        """
        self._check(drive(self.stepper, self._start, self._options, progress, checkpoints)[0])
        return self

    @property
    def is_whole(self) -> bool:
        """Whether it has come to its end, or to an event that ended it."""
        return self.stepper.t >= self.stepper.t_end or self.stepper.ended_by >= 0

    def each_step(self) -> Iterator[tuple[MotionState, Array, Array, MotionState]]:
        """Yield the motion before each step, second rates and multipliers of its stages, and its end."""
        status, before, n = self.stepper.begin(), self._first, self.system.unknowns
        while status == _core.MORE and (status := self.stepper.advance(1)) == _core.MORE:
            (a, multipliers), y = self.equations.of_stages, self.stepper.state
            after = MotionState(self.stepper.t, y[:n], y[n:-1], a[-1], multipliers[-1], y[-1])
            yield before, a, multipliers, after
            before = after
        self._check(status)

    def _check(self, status: int) -> None:
        raise_failure()
        if status == OUT_OF_TIME:
            raise OutOfTime(self.stepper.t, self.stepper.result, np.arange(self.stepper.recorded))
        if status not in (_core.DONE, _core.ENDED):
            raise SimulationError(
                f"{self.system.name}: Newton's method does not converge in a step of {self._h:.3g} s",
                time=self.stepper.t,
            )

    def moments(self) -> list[MotionState]:
        """Return the motion at the times that the run has come to."""
        n, found = self.system.unknowns, [self._first]
        for t, y in zip(self.stepper.sampled[1:].tolist(), self.stepper.result[1:], strict=True):
            self.system.recall(t)
            found.append(
                settled(self.system, replace(self._first, t=t, q=y[:n], v=y[n:-1], work=y[-1]), self._h)
            )
        return found
