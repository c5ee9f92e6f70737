"""Steps of mechanical systems with constraints by collocation at Gauss points.

The equation of motion M(q) a + ... + J^T lambda = 0 and the rates of the constraints, J v + Phi_t = 0, hold
at every Gauss point. At the end of a step, places and rates are projected on the constraints in the metric of
the mass matrix, which keeps the order of both at twice the number of stages: U. M. Ascher, L. R. Petzold,
Projected implicit Runge-Kutta methods for differential-algebraic equations, SIAM Journal on Numerical
Analysis 28 (1991). Without constraints the method conserves quadratic invariants, and dissipates nothing.

In the eigenvectors of the matrix of coefficients the stages of Newton's correction separate: with an
eigenvalue g one of them solves [M + h g C + (h g)^2 K, J^T; J, 0], with the slopes C and K of the equation by
rates and places in the middle of the step. One of each complex pair is solved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SimulationError
from symgen.runtime.beams.methods import BeamMethod
from symgen.runtime.integrate.pace import OutOfTime, Pace

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Error that corrections leave in the places, over their sizes.
_CLOSE = 1e-10
#: Corrections in a step at most; a correction over the one before from which on they do not converge.
_MOST, _DIVERGING = 20, 2.0
#: Part of a step over which the rates of the constraints are differentiated in time.
_PART = 1e-3


@dataclass(frozen=True, slots=True)
class Moment:
    """Places, rates, second rates (unknowns,) and multipliers at a time [s].

    ``work`` is that of the moving constraints less what damping dissipates, from the start on [J].
    """

    t: float
    q: Array
    v: Array
    a: Array
    multipliers: Array
    work: float = 0.0


def stacked(found: Sequence[Moment]) -> tuple[Array, ...]:
    """Return times, places, rates, second rates and multipliers of a motion, each (times, numbers)."""
    names = "t", "q", "v", "a", "multipliers"
    return tuple(np.array([getattr(moment, name) for moment in found]) for name in names)


@dataclass(frozen=True, slots=True)
class Slopes:
    """Slopes of the equation by second rates, rates and places, (entries,), and of the constraints."""

    mass: Array
    damping: Array
    stiffness: Array
    jacobian: Array


class Pattern:
    """The sparse matrix [W, J^T; J, 0] of a system, banded by the reverse Cuthill-McKee order.

    Parameters
    ----------
    pairs
        Rows and columns of the entries of slopes, (2, entries); entries of the same place are summed.
    bound
        Rows and columns of the entries of the constraint Jacobian, (2, slopes).
    sizes
        Numbers of unknowns and of constraints.
    """

    def __init__(self, pairs: Indices, bound: Indices, sizes: tuple[int, int]) -> None:
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        lower = bound + np.array([[sizes[0]], [0]])
        self._places = row, column = np.hstack([pairs, lower, lower[::-1]])
        self._size = sum(sizes)
        graph = csr_array((np.ones(len(row)), (row, column)), shape=(self._size, self._size))
        #: Unknowns and multipliers in the order of the banded matrix, in which links are chains of nodes.
        self._order = reverse_cuthill_mckee(graph, symmetric_mode=True)
        ranks = np.argsort(self._order)
        self._band = int(np.max(np.abs(ranks[row] - ranks[column]), initial=0))
        # Columns of LAPACK's banded matrices have a diagonal and three bands, of which one is for pivoting.
        self._height = 3 * self._band + 1
        self._slots = self._height * ranks[column] + 2 * self._band + ranks[row] - ranks[column]

    def matrix(self, entries: Array, jacobian: Array) -> Any:
        """Return the matrix, compressed by columns, with entries of W and slopes of constraints."""
        from scipy.sparse import csc_array

        data = np.concatenate([entries, jacobian, jacobian])
        return csc_array((data, self._places), shape=(self._size, self._size))

    def factorised(self, entries: Array, jacobian: Array) -> Callable[[Array], Array]:
        """Return the solution by its right-hand side, with entries of W; nan where the matrix is singular."""
        from scipy.linalg.lapack import dgbtrf, dgbtrs, zgbtrf, zgbtrs

        data, count = np.concatenate([entries, jacobian, jacobian]), self._size * self._height
        summed = np.bincount(self._slots, data.real, count)
        factorise, solve = dgbtrf, dgbtrs
        if np.iscomplexobj(data):
            summed = summed + 1j * np.bincount(self._slots, data.imag, count)
            factorise, solve = zgbtrf, zgbtrs
        band, order = self._band, self._order
        factors, pivots, failed = factorise(summed.reshape(self._size, -1).T, band, band, overwrite_ab=True)

        def solution(right: Array) -> Array:
            found = np.full_like(right, math.nan)
            if not failed:
                found[order] = solve(factors, band, band, right[order], pivots)[0]
            return found

        return solution


def pairs_of(unknowns: Indices) -> Indices:
    """Return rows and columns of the matrices of elements, (2, entries), by their unknowns (elements, n)."""
    return np.stack(np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])).reshape(2, -1)


class System(Protocol):
    """A mechanical system with constraints Phi(t, q) = 0, at one or more times in each call."""

    name: str
    unknowns: int
    multipliers: int
    #: Sizes of the places: lengths, and one radian.
    scale: Array

    @property
    def pattern(self) -> Pattern:
        """The places of the entries of slopes."""

    def residual(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array:
        """Return M a + ... + J^T lambda, (times, unknowns), of states (times, unknowns)."""

    def rates(self, t: Array, q: Array, v: Array) -> Array:
        """Return J v + Phi_t, (times, multipliers)."""

    def errors(self, t: float, q: Array) -> Array:
        """Return Phi, (multipliers,)."""

    def slopes(self, t: float, q: Array, v: Array, a: Array, multipliers: Array) -> Slopes:
        """Return the slopes at a state."""

    def dissipated(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return the power that damping takes [W], (times,)."""

    def start(self) -> Moment:
        """Return the motion at the start."""


class Stepper:
    """Steps of a system by collocation.

    Parameters
    ----------
    system
        The system.
    method
        A collocated method with an even number of stages.
    h
        Length of the steps [s].
    """

    def __init__(self, system: System, method: BeamMethod, h: float) -> None:
        self._system, self._method, self._h = system, method, h
        values, vectors = np.linalg.eig(method.a)
        pairs = np.flatnonzero(values.imag > 0.0)
        # The other one of each pair is its complex conjugate, with the conjugate correction.
        self._values, self._vectors = values[pairs], -2.0 * vectors[:, pairs]
        self._rows = np.linalg.inv(vectors)[pairs]
        self._rows_of_rates = self._rows / (h * self._values[:, None])
        self._square = h * h * method.a @ method.a
        self._factors: list[Callable[[Array], Array]] = []
        #: Counts of steps and of corrections.
        self.steps = self.corrections = 0

    def _refresh(self, at: Moment) -> None:
        system = self._system
        half = self._h / 2
        slopes = system.slopes(at.t + half, at.q + half * at.v, at.v, at.a, at.multipliers)
        self._factors = []
        for g in (self._values * self._h).tolist():
            entries = slopes.mass + g * slopes.damping + g * g * slopes.stiffness
            self._factors.append(system.pattern.factorised(entries, slopes.jacobian))
        self._metric = system.pattern.factorised(slopes.mass, slopes.jacobian)

    def _correction(self, residual: Array, rates: Array) -> tuple[Array, Array]:
        """Return corrections of second rates (stages, unknowns) and multipliers (stages, multipliers)."""
        n = self._system.unknowns
        right = np.hstack([self._rows @ residual, self._rows_of_rates @ rates])
        solved = [solve(own) for solve, own in zip(self._factors, right, strict=True)]
        change = (self._vectors @ np.array(solved)).real
        return change[:, :n], change[:, n:]

    def step(self, at: Moment, guess: tuple[Array, Array]) -> tuple[Moment, tuple[Array, Array]]:
        """Return the motion one step on, without second rates, and its stages: second rates, multipliers.

        Raises
        ------
        SimulationError
            Where corrections do not converge.
        """
        self._refresh(at)
        stages = self._stages(at, guess)
        if stages is None:
            raise SimulationError(
                f"{self._system.name}: Newton's method does not converge in a step of {self._h:.3g} s",
                time=at.t,
            )
        self.steps += 1
        return self._ended(at, *stages), stages

    def _moved(self, at: Moment, a: Array) -> tuple[Array, Array]:
        """Return places and rates of the stages."""
        h, method = self._h, self._method
        v = at.v + h * method.a @ a
        return at.q + h * method.c[:, None] * at.v + self._square @ a, v

    def _stages(self, at: Moment, guess: tuple[Array, Array]) -> tuple[Array, Array] | None:
        """Return second rates and multipliers of the stages; None where corrections do not converge."""
        system, h, method = self._system, self._h, self._method
        times, (a, multipliers) = at.t + h * method.c, guess
        before, rate = math.inf, 1.0
        for k in range(_MOST):
            q, v = self._moved(at, a)
            da, dm = self._correction(system.residual(times, q, v, a, multipliers), system.rates(times, q, v))
            size = float(np.max(np.abs(self._square @ da) / system.scale))
            if not math.isfinite(size):
                return None
            a, multipliers = a + da, multipliers + dm
            self.corrections += 1
            if k:
                rate = size / before if before else 0.0
                if rate > _DIVERGING and k > 3:
                    return None
            if size <= _CLOSE * max(1.0, 1.0 / rate - 1.0) or size == 0.0:
                return a, multipliers
            before = size
        return None

    def _ended(self, at: Moment, a: Array, multipliers: Array) -> Moment:
        """Return the end of a step, on the constraints."""
        system, h, method = self._system, self._h, self._method
        t, n = at.t + h, system.unknowns
        q, v = self._moved(at, a)
        times = at.t + h * method.c
        power = -system.dissipated(times, q, v, a)
        if system.multipliers:
            power += np.sum(multipliers * system.rates(times, q, np.zeros_like(v)), axis=1)
        ended = at.q + h * at.v + h * h * (method.b @ method.a) @ a
        rate = at.v + h * method.b @ a
        if system.multipliers:
            for _ in range(_MOST):
                right = np.concatenate([np.zeros(n), system.errors(t, ended)])
                change = self._metric(right)[:n]
                ended = ended - change
                if not np.max(np.abs(change) / system.scale) > _CLOSE:
                    break
            over = system.rates(np.array([t]), ended[None], rate[None])[0]
            rate = rate - self._metric(np.concatenate([np.zeros(n), over]))[:n]
        return Moment(t, ended, rate, a[-1], multipliers[-1], at.work + h * float(method.b @ power))


def settled(system: System, at: Moment, span: float) -> Moment:
    """Return a motion with the second rates and multipliers at its time.

    They are those of the equation of motion and of the second rate of the constraints, which is the
    difference of first rates, to the fourth order, over a part of ``span`` [s].
    """
    t, q, v, n = at.t, at.q, at.v, system.unknowns
    still, none = np.zeros(n), np.zeros(system.multipliers)
    residual = system.residual(np.array([t]), q[None], v[None], still[None], none[None])[0]
    offsets = _PART * span * np.array([-2.0, -1.0, 1.0, 2.0])
    near = system.rates(t + offsets, q + np.outer(offsets, v), np.broadcast_to(v, (4, n)))
    changes = np.array([1.0, -8.0, 8.0, -1.0]) @ near / (12 * _PART * span)
    slopes = system.slopes(t, q, v, still, none)
    found = system.pattern.factorised(slopes.mass, slopes.jacobian)(-np.concatenate([residual, changes]))
    return Moment(t, q, v, found[:n], found[n:], at.work)


def moved(
    system: System,
    method: BeamMethod,
    times: Array,
    steps: int,
    pace: Pace,
    progress: Callable[[float], None] | None = None,
) -> tuple[list[Moment], Stepper]:
    """Return the motion at times, by so many equal steps between two of them, and what counted them.

    Raises
    ------
    SimulationError
        Where Newton's method does not converge.
    OutOfTime
        When the wall time is spent.
    """
    span = float(times[-1] - times[0]) / (len(times) - 1)
    stepper, now = Stepper(system, method, span / steps), system.start()
    found: list[Moment] = [now]
    count = len(method.c)
    guess = (
        np.broadcast_to(now.a, (count, system.unknowns)),
        np.broadcast_to(now.multipliers, (count, system.multipliers)),
    )
    for start, end in pairwise(times.tolist()):
        if pace.spent(start):
            raise OutOfTime(start, found, np.arange(len(found)))
        for _ in range(steps):
            now, guess = stepper.step(now, guess)
        found.append(settled(system, now, stepper._h))
        if progress is not None:
            progress(end / float(times[-1]))
    return found, stepper
