"""Steppers of elastic links in large rotation, in the plane and in space."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Self

import numpy as np

from symgen.calls import raise_failure
from symgen.errors import ModelError, OptionsError, SimulationError
from symgen.runtime import _core
from symgen.runtime._constrained import SystemMotion
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import (
    CLOSE,
    ConstrainedSystem,
    MotionState,
    integrator_of_systems,
    settled,
)
from symgen.runtime.elastic.large.passes import LargeMotion, constraint_drift, events_of
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import OUT_OF_TIME, out_of_time
from symgen.runtime.integrate.simulate import effects_of
from symgen.runtime.integrate.stepper import Stepper
from symgen.runtime.kernels.arguments import is_real, out_of_range
from symgen.runtime.kernels.description import BlockInfo
from symgen.runtime.model.elastic_arguments import SystemStepping
from symgen.runtime.result.records import LocatedEvent, Variable
from symgen.runtime.result.state import State, finite

#: Error of places over their sizes in an advance, if none is given.
RTOL = 1e-6
#: Time [s] before the first step over which constraints are differentiated.
_SPAN = 1e-3
#: Part of the tolerance that the number of steps of the next advance is to meet.
_AIM = 0.1
#: Part of the number of steps that is rounding.
_ROUNDING = 1e-9
#: Error of constraints of a given state over the largest size of a place.
_APART = 1e-8
#: Steps of an advance that are not doubled again.
_MOST = 2**14


class DividedRun:
    """A run by collocation that divides each advance into equal steps.

    There are as many as a ``longest`` one [s] needs. With a tolerance their number is doubled until places at
    the end change by at most a part ``rtol`` of their sizes; the motion is that in the greater number.
    """

    def __init__(self, run: _core.Run, system: ConstrainedSystem, rtol: float | None, longest: float) -> None:
        self._run, self._system, self._rtol, self._longest = run, system, rtol, longest
        self._count, self._end, self._last = 1, run.t, run.t_end
        self._left = 0.0  # rounding of the time after calls
        #: Length of the last steps [s].
        self.length = _SPAN

    def __getattr__(self, name: str) -> Any:
        return getattr(self._run, name)

    def extend(self, t_end: float) -> None:
        """Set the time to advance to [s]."""
        self._end = t_end

    def step(self, h: float) -> int:
        """Advance by a time h [s]; return DONE or another status. Events are those of this call."""
        del self._run.events[:]
        begin, whole = self._run.t, h + self._left
        self.extend(begin + whole)
        self._left = whole - (self._end - begin)
        return self.advance(1)

    def advance(self, most: int) -> int:
        """Advance to the end of the run, in any number of steps; return DONE or another status."""
        run, end = self._run, self._end
        count = max(1, math.ceil((end - run.t) / self._longest * (1.0 - _ROUNDING)))
        if self._rtol is None:
            return self._in(count, end)
        count, saved, places = max(count, self._count), self._saved(), self._system.unknowns
        status, before = self._in(count, end), run.state
        while True:
            failed, count = status not in (_core.DONE, _core.ENDED), 2 * count
            self._restore(*saved)
            status, after = self._in(count, end), run.state
            error = float(np.max(np.abs(after - before)[:places] / self._system.scale))
            if not failed and status in (_core.DONE, _core.ENDED) and error <= self._rtol:
                aim = (error / (_AIM * self._rtol)) ** (1 / GAUSS8.order)
                self._count = max(1, math.ceil(count / 2 * aim))
                return status
            before = after
            if count >= _MOST:
                return _core.STEP_TOO_SMALL if status in (_core.DONE, _core.ENDED) else status

    def _in(self, count: int, end: float) -> int:
        """Advance to a time [s] in a number of steps; return the status."""
        run, begin, status = self._run, self._run.t, _core.DONE
        for k in range(1, count + 1):
            to = end if k == count else begin + (end - begin) * (k / count)
            self.length = to - run.t
            run.extend(to)
            while (status := run.advance(2)) == _core.MORE:
                pass
            raise_failure()
            if status != _core.DONE:
                break
        return status

    def _saved(self) -> tuple[tuple[bytes, bytes], int, Mapping[str, Array]]:
        # The times of samples must be within the run.
        self._run.extend(max(self._end, self._last))
        return self._run.save(), len(self._run.events), self._system.memory()

    def _restore(self, run: tuple[bytes, bytes], events: int, memory: Mapping[str, Array]) -> None:
        self._run.extend(max(self._end, self._last))
        self._run.restore(*run)
        del self._run.events[events:]
        if memory:
            self._system.restore(memory)

    def continue_as(self, other: DividedRun) -> None:
        """Take over the present state of a run of the same equations."""
        self._run.continue_as(other._run)
        self._count, self._left, self.length = other._count, other._left, other.length
        if memory := other._system.memory():
            self._system.restore(memory)


class SystemStepper(Stepper):
    """A motion of elastic links in large rotation that advances by calls.

    ``motion`` returns new equations.
    """

    _run: Any

    def __init__(
        self,
        model: Any,
        chosen: Options,
        state: State | None,
        sampled: Callable[[float], Array] | None = None,
        law: Any = None,
        *,
        motion: Callable[[], LargeMotion],
        rtol: float | None,
        longest: float,
    ) -> None:
        self._motion, self._rtol, self._longest = motion, rtol, longest
        super().__init__(model, chosen, state, sampled, law)
        first = 0
        blocks = list[BlockInfo]()
        for v in self._variables():
            shape = np.size(v.values), 1
            blocks.append(BlockInfo(v.name, first, shape, v.unit, v.about, v.components, ()))
            first += shape[0]
        self._take_outputs(blocks)

    def _make(self, state: State | None) -> None:
        super()._make(state)
        self._run = DividedRun(self._run, self.of.system, self._rtol, self._longest)

    def _new(self, state: State | None) -> tuple[Any, Any, float, Array, dict[str, Any]]:
        self.of = of = self._motion()
        system, start = of.system, of.start(of.system)
        if state is not None:
            start = self._from(state, start)
        self._values = np.array([*self._model.parameters.values()])
        system.restore({})
        first, stages = settled(system, start, _SPAN, first=True), len(GAUSS8.c)
        evaluator = of.rigid.evaluator
        events = evaluator.description.events
        equations = SystemMotion(
            system.core,
            system.scale,
            stages,
            partial(_prescribed, system),
            system.follow if system.follows else None,
            np.tile(first.a, stages),
            np.tile(first.multipliers, stages),
            evaluator if events else None,
        )
        options = {"directions": [e.direction for e in events], "terminal": effects_of(events)}
        return equations, None, start.t, np.concatenate([start.q, start.v, [start.work]]), options

    def _from(self, state: State, start: MotionState) -> MotionState:
        """Return the start at a state of a stepper; raise ModelError for another."""
        name, size = self._model.name, len(start.q)
        if len(state.q) != size or len(state.u) != size:
            raise ModelError(
                f"expected a state of {size} unknowns of {name}, as steppers with these elements have, "
                f"got {len(state.q)}"
            )
        if self.of.system.follows:
            raise ModelError(
                f"loads of {name} count the revolutions of angles, which states of elastic links lack\n"
                "  Use stepper.copy() to continue from a state, and reset() to return to the start."
            )
        t, _ = finite(state)
        there = replace(start, t=t, q=state.q, v=state.u)
        apart = constraint_drift(self.of.system, [there]).constraint
        if apart > _APART * float(np.max(self.of.system.scale)):
            raise ModelError(
                f"expected a state of a stepper of {name}, got one that violates constraints by {apart:.2g} m"
            )
        return there

    def _independent(self) -> tuple[str, ...]:
        inputs: tuple[str, ...] = self._model.description.inputs
        return inputs

    def _change(self, values: Mapping[str, float], moves: bool) -> None:
        if moves:
            others = ", ".join(values.keys() - self._signals.keys())
            raise ModelError(
                f"steppers of elastic links set inputs, not {others}\n"
                "  Give parameters their values before: model.with_parameters(...).stepper()."
            )
        after = self._values.copy()
        for name, value in values.items():
            after[self._signals[name]] = value
        before = self._values
        if np.array_equal(after, before):
            return
        self._take(after)
        if not self._has_finite_forces():
            cause = self._cause(_core.NOT_FINITE)
            self._take(before)
            raise SimulationError(cause, time=self.t)
        self._run.restart(False)

    def _has_finite_forces(self) -> bool:
        """Return whether all forces are numbers at the present state."""
        system, n, y = self.of.system, self._equations.n, self._run.state
        t, still, none = np.array([self.t]), np.zeros((1, n)), np.zeros((1, system.multipliers))
        at = (t, y[None, :n], y[None, n : 2 * n], still, none, *system.prescribed(t))
        return bool(np.isfinite(system.core.forces(*at)).all())

    def _take(self, values: Array) -> None:
        """Take values of the tunable parameters, of which inputs alone may differ."""
        self._values, self._row = values, None
        self.of.system.take_parameters(values)
        if len(self._equations.parameters):
            for place in self._signals.values():
                self._equations.put(place, values[place])

    def copy(self) -> Self:
        """Return a stepper that continues from the same state with the same parameters."""
        other = super().copy()
        other._take(self._values)
        return other

    @property
    def parameters(self) -> dict[str, float]:
        """Present values of the tunable parameters, in SI units: :meth:`set` changes inputs."""
        return dict(zip(self._places, self._values.tolist(), strict=True))

    @property
    def state(self) -> State:
        """The present state, for :meth:`reset`: all unknowns and rates, with positions of free points."""
        q, u = np.split(self.y, 2)
        free = self.of.rigid.description.free
        size = len(self.of.rigid.description.axes)
        places, rates = ({p: x[k * size : k * size + size] for k, p in enumerate(free)} for x in (q, u))
        return State(self.t, q, u, places, rates)

    @property
    def events(self) -> tuple[LocatedEvent, ...]:
        """Events of the scene during the last call of :meth:`step`, in the order of time."""
        return tuple(events_of(self.of.rigid, self._equations.n, self._run.events))

    def _evaluated(self) -> Array:
        return np.concatenate([np.ravel(v.values) for v in self._variables()])

    def _variables(self) -> tuple[Variable, ...]:
        """Return the outputs at the present state, one sample each."""
        moment = self.moment(self.t, self._run.state, first=self._run.steps == 0)
        return self.of.selected(self.of.outputs(self.of.system, [moment]))

    def moment(self, t: float, y: Array, first: bool) -> MotionState:
        """Return the motion at a state y at a time [s], with second rates and multipliers."""
        n, none = self._equations.n, np.zeros(self.of.system.multipliers)
        at = MotionState(t, y[:n], y[n : 2 * n], np.zeros(n), none, y[-1])
        return settled(self.of.system, at, self._run.length, first)

    def _cause(self, status: int) -> str:
        if status == OUT_OF_TIME:
            return out_of_time(self.t, self._chosen.t_end)
        length = self._run.length
        if status == _core.STEP_TOO_SMALL:
            return (
                f"{self._model.name}: the error of places does not reach rtol = {self._rtol:g} in steps of "
                f"{length:.3g} s at t = {self.t:.9g} s\n  Give a larger rtol, or fixed steps."
            )
        if not self._has_finite_forces():
            return f"{self._model.name}: a load or a rate is not a finite number at t = {self.t:.9g} s"
        remedy = "Give shorter steps, or rtol without a step."
        if self._rtol is not None:
            remedy = "Shorter steps do not help: a load or a rate may jump there, or be no number behind it."
        return (
            f"{self._model.name}: Newton's method does not converge in a step of {length:.3g} s "
            f"at t = {self.t:.9g} s\n  {remedy}"
        )


def _prescribed(system: ConstrainedSystem, number: int, t: float, h: float) -> tuple[int, Array, Array]:
    """Return the number of a step of length h at t [s], and its prescribed numbers with their rates."""
    z, rates = system.prescribed(t + h * np.concatenate([[0.5], GAUSS8.c, [1.0]]))
    return number, z[None], rates[None]


def stepper_options(t_end: float, samples: int = 2) -> Options:
    """Return the options of the step loop to a time [s]: each advance is a step."""
    method = integrator_of_systems(GAUSS8)
    return Options(method, t_end, CLOSE, 0.0, sys.float_info.max, samples, sys.maxsize, stabilisation="raw")


def stepper(model: Any, request: SystemStepping, motion: Callable[[], LargeMotion]) -> SystemStepper:
    """Return a motion that advances by calls; raise ModelError for options out of range."""
    if request.rtol is not None and request.step is not None:
        raise OptionsError("fixed steps have no tolerance: give {step}, or {rtol}, not both")
    rtol, longest = limits_of(request.rtol, "step", request.step)
    options, checked = stepper_options(1.0), rtol if request.step is None else None
    return SystemStepper(model, options, request.state, motion=motion, rtol=checked, longest=longest)


def limits_of(rtol: float | None, name: str, longest: float | None) -> tuple[float, float]:
    """Return the tolerance and the longest step [s], of this ``name``; raise ModelError out of range."""
    for what, value in (("rtol", rtol), (name, longest)):
        if value is not None and not (is_real(value) and value > 0.0):
            raise out_of_range(what, value)
    return RTOL if rtol is None else float(rtol), math.inf if longest is None else float(longest)
