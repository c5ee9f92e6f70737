"""Systems with constraints and their motion by collocation at Gauss points: see ``core/collocation.h``.

Without constraints the method conserves quadratic invariants, and dissipates nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from symgen.errors import SimulationError
from symgen.runtime._constrained import Constrained, Part, Steps
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.methods import BeamMethod
from symgen.runtime.integrate.pace import OutOfTime, Pace, Progress

#: Error that corrections leave in the places over their sizes, and in the rates over the largest of a step.
CLOSE = 1e-12
#: Steps whose prescribed numbers are found together.
_TOGETHER = 1024
#: Steps between two looks at the wall time and at Ctrl-C.
_AT_ONCE = 16
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


@dataclass(frozen=True, slots=True)
class ResumePoint:
    """A run at a sample: its motion at samples so far, and the end of its last step.

    ``guess`` are second rates and multipliers of the stages of this step, ``corrections`` those of all steps.
    """

    moments: list[MotionState]
    now: MotionState
    guess: tuple[Array, Array]
    corrections: int = 0


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

    def start(self) -> MotionState:
        """Return the motion at the start."""
        raise NotImplementedError

    @property
    def follows(self) -> bool:
        """Whether it takes note of the motion at the end of each step."""
        return False

    def follow(self, at: MotionState) -> None:
        """Take note of the motion at the end of a step, or at the start."""

    def memory(self) -> dict[str, Array]:
        """Return the notes of :meth:`follow`."""
        return {}

    def restore(self, memory: Mapping[str, Array]) -> None:
        """Restore its memory."""

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


def moved(
    system: ConstrainedSystem,
    method: BeamMethod,
    times: Array,
    steps: int,
    pace: Pace,
    progress: Progress | None = None,
    at_step: Callable[[MotionState, Array, Array, MotionState], bool | None] | None = None,
    at_sample: Callable[[ResumePoint, Steps], None] | None = None,
    resumed: ResumePoint | None = None,
    initial: MotionState | None = None,
    close: float = CLOSE,
) -> tuple[list[MotionState], Steps]:
    """Return the motion at times, by so many equal steps between two of them, and what counted them.

    ``at_step`` receives the motion before each step, second rates and multipliers of its stages, and the end;
    where it returns True, the run ends, and times after this step have no motion.
    ``at_sample`` receives the run after each sample; ``resumed`` is one to be continued, by a system with its
    memory. ``initial`` is the motion at the start, by default that of the system. ``close`` is the error that
    corrections leave, as :data:`CLOSE`.

    Raises
    ------
    SimulationError
        Where Newton's method does not converge.
    OutOfTime
        When the wall time is spent.
    """
    h = float(times[-1] - times[0]) / (len(times) - 1) / steps
    stepper, shape = Steps(system.core, method, h, system.scale, close), len(method.c)
    if resumed is None:
        now = initial or system.start()
        system.follow(now)
        moments = [settled(system, now, h, first=True)]
        guess = np.tile(now.a, (shape, 1)), np.tile(now.multipliers, (shape, 1))
    else:
        moments, now, guess = resumed.moments, resumed.now, resumed.guess
    stepper.start(now.t, now.q, now.v, now.a, now.multipliers, guess, now.work)
    each = 1 if at_step is not None or system.follows else _AT_ONCE
    within = h * np.concatenate([[0.5], method.c, [1.0]])
    for start, end in pairwise(times[len(moments) - 1 :].tolist()):
        for first in range(0, steps, _TOGETHER):
            begun = start + h * np.arange(first, min(first + _TOGETHER, steps))[:, None]
            places, rates = (
                x.reshape(len(begun), len(within), -1) for x in system.prescribed((begun + within).ravel())
            )
            for at in range(0, len(begun), each):
                if pace.spent(now.t):
                    raise OutOfTime(now.t, moments, np.arange(len(moments)))
                some, before = slice(at, at + each), now
                done = stepper.advance(places[some], rates[some])
                now = MotionState(*stepper.motion)
                if done < len(places[some]):
                    raise SimulationError(
                        f"{system.name}: Newton's method does not converge in a step of {h:.3g} s", time=now.t
                    )
                system.follow(now)
                if at_step is not None and at_step(before, *stepper.guess, now):
                    return moments, stepper
        moments.append(settled(system, now, h))
        if at_sample is not None:
            at_sample(ResumePoint(moments, now, stepper.guess), stepper)
        if progress is not None:
            progress(end / float(times[-1]))
    return moments, stepper
