"""The rigid motion of a linkage that a motor turns: integrated with its torque, and its steady revolution."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.failures import problem
from symgen.runtime.integrate.options import options
from symgen.runtime.integrate.pace import check_wall
from symgen.runtime.integrate.simulate import drive
from symgen.runtime.result.recording import wound
from symgen.runtime.rods.model.rods import RodModel

#: Reason why scenes with first-order states have no linear theory.
PRESCRIBED = (
    "linear theory prescribes the rigid motion, to which [states] feed back\n"
    "  Compute the motion in large rotation: model.large_rotation(t_end=...), model.equilibrium(), "
    "model.modes(). On the command line: symgen large-rotation, equilibrium, modes."
)
#: Angle of the crank between rows of a path [rad].
_SPACING = 0.01
#: Tolerance of the integration.
_RTOL = 1e-11
#: Revolutions at the speed of the scene within which a crank must come round.
_LONGEST = 64.0
#: Largest steady speed that is searched, over the speed of the scene.
_FASTEST = 100.0
#: Most rounds of the search for the steady speed.
_ROUNDS = 60
#: Change of the squared speed over a revolution, over its value.
_REPEATS = 1e-10
#: Part of the largest acceleration and force by which these may differ one revolution later.
_PERIODIC = 1e-6


@dataclass(frozen=True)
class RigidMotionTable:
    """States of a rigid motion at equal spacing from time zero on.

    Attributes
    ----------
    rows
        q, q' and q'', (times, 3 coordinates).
    references
        References of the angles in loads [rad], (times, angles).
    spacing
        Time between them [s].
    absent
        Number of the crank's drive among the constraints of the driven linkage.
    angles, rates
        Directions of the crank [rad], counted on over revolutions, and their rates [rad/s].
    repeats
        Whether it is one revolution of a steady state.
    """

    rows: Array
    references: Array
    spacing: float
    absent: int
    angles: Array
    rates: Array
    repeats: bool = False

    @property
    def end(self) -> float:
        """The last time [s]."""
        return self.spacing * (len(self.rows) - 1)

    def with_drive(self, solutions: Array, coordinates: int) -> Array:
        """Return accelerations and multipliers (times, ...) with that of the crank's drive, which is zero."""
        return np.insert(solutions, coordinates + self.absent, 0.0, axis=1)

    def angle_at(self, times: Array) -> Array:
        """Return directions of the crank [rad] at times [s]."""
        from scipy.interpolate import CubicHermiteSpline

        nodes = self.spacing * np.arange(len(self.rows))
        return CubicHermiteSpline(nodes, self.angles, self.rates)(times)

    def time_at(self, angle: float) -> float | None:
        """Return the first time [s] at which the crank has turned to a direction [rad], or None."""
        from scipy.optimize import brentq

        forward = 1.0 if angle >= self.angles[0] else -1.0
        past = np.flatnonzero(forward * (self.angles - angle) >= 0.0)
        if not len(past):
            return None
        k = int(past[0])
        if k == 0:
            return 0.0
        low, high = self.spacing * (k - 1), self.spacing * k
        return float(
            brentq(lambda t: float(self.angle_at(np.array(t))) - angle, low, high, xtol=1e-15 * high)
        )

    def time_of(self, direction: float, revolutions: int = 0) -> float:
        """Return the first time [s] at which the crank has a direction [rad] after a number of revolutions.

        Raises
        ------
        ModelError
            When it does not come there.
        """
        ahead = math.fmod(direction - self.angles[0], 2 * math.pi)
        if ahead * self.rates[0] < 0.0:
            ahead += math.copysign(2 * math.pi, self.rates[0])
        around = math.copysign(2 * math.pi * revolutions, self.rates[0])
        time = self.time_at(self.angles[0] + ahead + around)
        if time is None:
            raise ModelError(
                f"the motor does not turn the crank to {math.degrees(direction):g} degrees within "
                f"{self.end:g} s"
            )
        return time


class MotorDrivenLinkage:
    """The rigid linkage of an elastic motion with its motor: integrated from its start.

    Parameters
    ----------
    rigid
        The linkage with its crank driven.
    crank, angle, speed
        Name, direction [rad] and speed [rad/s] of the crank at the start.
    model
        The linkage with its motor in place of the drive.
    """

    def __init__(self, rigid: RodModel, crank: str, angle: float, speed: float, model: RodModel) -> None:
        self._name, self._crank, self._angle, self._speed = rigid.name, crank, angle, speed
        self._model, self._period = model, 2 * math.pi / abs(speed) if speed else math.inf
        driven = rigid.description
        self._absent = driven.constraints.index(f"{crank}_drive")
        self._equations = self.equations()
        start = rigid.initial_state()
        self._q, self._u = start.q, start.u
        first, last = driven.links[crank][:2]
        self._pivot = np.asarray(start.positions[first], dtype=float)
        self._tip = 2 * driven.free.index(last)

    def equations(self) -> _core.KernelEquations:
        """Return equations of the linkage with its motor."""
        return self._model.evaluator.equations(len(self._model.description.redundant))

    def _turned(self, rows: Array) -> tuple[Array, Array]:
        """Return angles and rates of the crank from rows of q and q'."""
        n = len(self._q)
        arm = rows[:, self._tip : self._tip + 2] - self._pivot
        v = rows[:, n + self._tip : n + self._tip + 2]
        angles = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
        angles += self._angle - angles[0]
        return angles, (arm[:, 0] * v[:, 1] - arm[:, 1] * v[:, 0]) / np.sum(arm**2, axis=1)

    def path(self, end: float, ratio: float = 1.0) -> RigidMotionTable:
        """Return the motion to a time [s], from the start with its velocities times a ratio.

        Raises
        ------
        SimulationError
            When the linkage cannot be followed.
        """
        n, speed = len(self._q), abs(self._speed) * max(1.0, abs(ratio))
        count = max(16, math.ceil(end * speed / _SPACING)) + 1
        times = np.linspace(0.0, end, count)
        states, references = self._followed(times, ratio)
        accelerations = self._solutions(times, states, references)[:, :n]
        rows = np.ascontiguousarray(np.hstack([states, accelerations]))
        return RigidMotionTable(rows, references, end / (count - 1), self._absent, *self._turned(states))

    def coordinates(self, times: Array) -> Array:
        """Return the coordinates at equally spaced times from zero on [s], (times, coordinates)."""
        if not times[-1]:
            return self._q[None]
        return self._followed(times)[0][:, : len(self._q)]

    def _followed(self, times: Array, ratio: float = 1.0) -> tuple[Array, Array]:
        """Return states (times, 2 coordinates) from the start on, and references of angles in loads."""
        evaluator, n, equations = self._model.evaluator, len(self._q), self._equations
        end, count = float(times[-1]), len(times)
        chosen = options(end, "dop853", _RTOL, None, None, count, 1_000_000)
        y0 = np.concatenate([self._q, ratio * self._u, np.zeros(equations.dim - 2 * n)])
        stepper = _core.Run(
            equations, chosen.method, 0.0, y0, end, chosen.rtol, chosen.atol, chosen.step, times
        )
        status, _ = drive(stepper, 0.0, chosen, None)
        check_wall("following the rigid linkage with its motor")
        if status != _core.DONE:
            message = problem(status, stepper, equations, evaluator, chosen)
            raise SimulationError(f"{message}\n  This is the rigid linkage with its motor.", time=stepper.t)
        return np.ascontiguousarray(stepper.result[:, : 2 * n]), stepper.references

    def _solutions(self, times: Array, states: Array, references: Array) -> Array:
        """Return accelerations and multipliers at times, a row each."""
        equations, evaluator = self._equations, self._model.evaluator
        whole = np.zeros((len(times), equations.dim))
        whole[:, : states.shape[1]] = states
        solutions = np.zeros((len(times), equations.solutions(times[:1], whole[:1]).shape[1]))
        for parameters, rows in wound(evaluator, references):
            equations.set_parameters(parameters)
            solutions[rows] = equations.solutions(times[rows], whole[rows])
        equations.set_parameters(evaluator.parameter_values)
        return solutions

    def revolutions(self, count: int) -> RigidMotionTable:
        """Return the motion from the start to the end of a number of revolutions of the crank.

        Raises
        ------
        SimulationError
            When it does not come round.
        """
        path = self.path(self._period * count)
        while path.time_at(self._angle + math.copysign(2 * math.pi * count, self._speed)) is None:
            if path.end > _LONGEST * count * self._period:
                raise self._stalled()
            path = self.path(1.5 * path.end)
        return path

    def _stalled(self) -> SimulationError:
        return SimulationError(
            f"{self._name}: the motor does not turn the crank, {self._crank}, round: it "
            "has no steady speed\n  Give the motor more torque, or the crank a flywheel."
        )

    def revolution(self, ratio: float) -> tuple[float, float]:
        """Return the time of one revolution [s], and the speed of the crank after it over that of the scene.

        Raises
        ------
        SimulationError
            When the crank does not come round.
        """
        goal = self._angle + math.copysign(2 * math.pi, self._speed)
        span = 1.25
        while span < _LONGEST:
            path = self.path(span * self._period, ratio)
            t = path.time_at(goal)
            if t is not None:
                last = self.path(t, ratio)
                # A jump by the error of interpolated angles, once per revolution, would move light links.
                t -= float((last.angles[-1] - goal) / last.rates[-1])
                return t, float(last.rates[-1]) / self._speed
            span *= 2
        raise self._stalled()

    @cached_property
    def steady(self) -> RigidMotionTable:
        """One revolution of the crank at the end of which its speed is that at the begin.

        Raises
        ------
        SimulationError
            When the crank does not come round, or its speed does not settle.
        ModelError
            When torque or loads depend on the time or count revolutions, so that no revolution repeats.
        """
        # Kinetic energy falls in nearly linearly with that of the revolution before: secants in its place.
        x, before = 1.0, None
        for _ in range(_ROUNDS):
            period, ratio = self.revolution(math.sqrt(x))
            change = math.copysign(ratio**2, ratio) - x
            if abs(change) <= _REPEATS * x:
                path = replace(self.path(period, math.sqrt(x)), repeats=True)
                self._check_repeats(path)
                return path
            step = change
            if before is not None and change != before[1]:
                secant = -change * (x - before[0]) / (change - before[1])
                if secant * change > 0.0:  # towards where it settles
                    step = secant
            before = x, change
            x = min(max(x + step, x / 4), 4 * x)
            if x > _FASTEST**2:
                break
        raise SimulationError(
            f"{self._name}: the speed of the crank, {self._crank}, does not settle: "
            "the torque of the motor does not balance the loads over a revolution at any speed near "
            f"{abs(self._speed) * 30 / math.pi:g} rpm\n"
            "  Let the torque fall with the speed: this.rate."
        )

    def _check_repeats(self, path: RigidMotionTable) -> None:
        n = len(self._q)
        # Not at the start itself, where loads may jump.
        times = np.linspace(0.0, path.end, len(path.rows))[1:-1]
        states, references = np.ascontiguousarray(path.rows[1:-1, : 2 * n]), path.references[1:-1]
        revolutions_of_references = (
            2 * math.pi * np.round((path.references[-1] - path.references[0]) / (2 * math.pi))
        )
        now = self._solutions(times, states, references)[:, :-1]
        later = self._solutions(path.end + times, states, references + revolutions_of_references)[:, :-1]
        size = np.max(np.abs(now), axis=0)
        for part in (slice(0, n), slice(n, None)):
            if np.any(np.abs(later - now)[:, part] > _PERIODIC * np.max(size[part], initial=0.0)):
                raise ModelError(
                    f"{self._name}: torque or loads depend on the time t, or on the number of "
                    "revolutions, so that no revolution repeats\n  Run it from the start: method gauss."
                )
