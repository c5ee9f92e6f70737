"""Control loops with linkages and user-defined systems."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.controlled import controlled
from symgen.runtime.integrate.failures import problem
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.simulate import effects_of, equations_of
from symgen.runtime.integrate.stepper import Stepper
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.model.arguments import LinkageRun
from symgen.runtime.result.recording import Recording, located, nearest_turn, notes_on_start, output_rows
from symgen.runtime.result.records import LocatedEvent
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State, finite

#: Kernels that may depend on inputs and are called at any state of a step.
_FORCED = ("accelerations", "events")


class LinkageStepper(Stepper):
    """A motion of a linkage or of a user-defined system that advances by calls."""

    @cached_property
    def _redundant(self) -> tuple[int, ...]:
        redundant: tuple[int, ...] = self._model._assembled().redundant
        return redundant

    @cached_property
    def _call(self) -> tuple[int, _core.Sizes]:
        """Address and sizes of the kernel of outputs."""
        evaluator = self._model.evaluator
        call: tuple[int, _core.Sizes] = (0, (0, 0, 0, 0, 0, 0))
        return evaluator.call("outputs") if evaluator.find("outputs") else call

    @cached_property
    def _turning(self) -> tuple[tuple[int, int], ...]:
        """Places of the outputs that count revolutions, and the numbers of their links."""
        angles = {f"{link}.angle": i for i, link in enumerate(self._model.description.turns)}
        return tuple((b.offset, angles[b.name]) for b in self._blocks if b.name in angles)

    def _independent(self) -> tuple[str, ...]:
        d = self._model.description
        return d.inputs if d.constraints or d.kernel("limits") else tuple(p.name for p in d.tunable)

    def _new(self, state: State | None) -> tuple[Any, Any, float, Array, dict[str, Any]]:
        model = self._model
        state = None if state is None else self._own(state)
        t, y = (0.0, model._stored_start().y) if state is None else finite(state)
        evaluator = model.counting(state).evaluator
        view = evaluator.equations(len(self._redundant))
        if self._law is not None:
            steered = self._law.steered(self, evaluator.library, evaluator.parameter_values, _FORCED)
            evaluator = Evaluator(evaluator.description, steered, evaluator.parameter_values)
        tangent = model.analysis("tangent") if self._chosen.method.needs_tangent else None
        equations, y0 = equations_of(evaluator, y, self._redundant, self._chosen, tangent=tangent)
        events = evaluator.description.events
        options = {"directions": [e.direction for e in events], "terminal": effects_of(events)}
        return equations, view, t, y0, options

    def _own(self, state: State) -> State:
        """Return a state in the coordinates of the model: in space, of a linkage in a plane there."""
        model = self._model
        if len(state.q) == model.description.coordinates:
            return state
        own: State = model.state(state.positions, state.velocities, state.t, model._states_of(state))
        return own

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the state at which the motion began: revolutions, and violated constraints."""
        if self._given is None:
            return ()
        state = self._own(self._given)
        end = state.t + self._chosen.t_end
        return tuple(notes_on_start(self._model.evaluator, state, end, self._redundant))

    @property
    def state(self) -> State:
        """The present state, for :meth:`reset` and for analyses of the model."""
        (y, held, _), n = self._run.present(), self._equations.n
        references = held if self._model.description.windings else None
        return self._model._state(self.t, y[:n], y[n : 2 * n], references)

    @property
    def events(self) -> tuple[LocatedEvent, ...]:
        """Events of the scene during the last call of :meth:`step`, in the order of time."""
        return located(self._evaluator, self._run)

    @property
    def _evaluator(self) -> Evaluator:
        """The kernels with the present parameters."""
        return Evaluator(self._model.description, self._model.library, self._equations.parameters)

    def _evaluated(self) -> Array:
        address, sizes = self._call
        if not (self._redundant and sizes[4]):
            return self._run.outputs(self._view, address, sizes, self._turning)
        y, _, turns = self._run.present()
        return self._outputs_at(self.t, y, self._equations.parameters, turns)

    def _outputs_at(self, t: float, y: Array, parameters: Array, turns: Array) -> Array:
        """Return the output of the kernel 'outputs' at a state (q, u, ...), angles nearest to ``turns``."""
        evaluator = self._model.evaluator.at(parameters)
        self._view.set_parameters(parameters)
        row = output_rows(evaluator, self._view, np.array([t]), y[None], len(self._redundant))[0]
        for place, turn in self._turning if len(turns) else ():
            row[place] = nearest_turn(row[place], turns[turn])
        return row

    def _state_at(self, t: float, y: Array, parameters: Array) -> State:
        """Return a state by time [s] and (q, u), with the references of angles among the parameters."""
        d, n = self._model.description, len(y) // 2
        references = parameters[d.of_held][: d.windings] if d.windings else None
        state: State = self._model._state(t, y[:n], y[n:], references)
        return state

    def _cause(self, status: int) -> str:
        return problem(status, self._run, self._equations, self._evaluator, self._chosen)


def controlled_run(model: Any, request: LinkageRun, chosen: Options) -> Result:
    """Integrate with a controller and return the result: see :meth:`symgen.Model.simulate`."""
    stepper, control = controlled(model, LinkageStepper, request, chosen)
    status, wall = control.run(request.progress)
    of = model.counting(request.state).evaluator, stepper._equations, stepper._run
    result = Result._later(
        Recording(*of, chosen, wall, model.library, stepper._redundant, request.state, control)
    )
    return control.finished(result, status)
