"""Controllers without a sampling interval: inputs follow from the state in every evaluation."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.calls import FAILURES
from symgen.errors import ModelError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.controller import Controller, MotionView
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import Progress
from symgen.runtime.integrate.simulate import drive
from symgen.runtime.kernels.library import KERNEL, Library, address_of

if TYPE_CHECKING:
    from symgen.runtime.result.state import State


class Stage:
    """A state within a step, as a stepper shows the one after it; inputs have the values of the model.

    Parameters
    ----------
    t, y
        Time [s], and (q, u) in SI units.
    values
        Parameters of the model, with the references of angles and branches of loads in the step.
    turns
        Continuous angles of links [rad] in a state nearby; none at the start.
    """

    def __init__(self, stepper: Any, t: float, y: Array, values: Array, turns: Array) -> None:
        self._stepper, self.t, self.y, self._values, self._turns = stepper, t, y, values, turns
        self._row: Array | None = None
        self.read: set[str] = set()

    def __getitem__(self, name: str) -> Any:
        """Return an output of the scene, or a component, as :class:`MotionView` does."""
        if self._row is None:
            self._row = self._stepper._outputs_at(self.t, self.y, self._values, self._turns)
        found = self._stepper._entry(name, self._row)
        self.read.add(name)
        return found

    def check(self, inputs: Iterable[str]) -> None:
        """Raise ModelError for an output that was read and depends on inputs, which are to follow from it."""
        values = self._values.copy()
        values[[self._stepper._signals[name] for name in inputs]] = np.nan
        without = Stage(self._stepper, self.t, self.y, values, self._turns)
        wrong = [name for name in sorted(self.read) if np.isnan(without[name]).any()]
        if wrong:
            raise ModelError(
                f"{wrong[0]} depends on {', '.join(inputs)}, so this cannot follow from it at the same time\n"
                "  With the time between two calls, sample, it is that of the inputs held so far."
            )

    @property
    def state(self) -> State:
        """The state, for analyses of the model."""
        return self._stepper._state_at(self.t, self.y, self._values)

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the tunable parameters."""
        return {name: float(self._values[place]) for name, place in self._stepper._places.items()}

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs of the scene."""
        return self._stepper.outputs


class ContinuousController(Controller):
    """A controller without a sampling interval, which is part of the equations.

    Parameters
    ----------
    function
        ``function(t, view)`` returns inputs by name, in SI units, and has no memory; those that it omits have
        the values of the model.
    """

    def __init__(self, function: Callable[..., Any], chosen: Options) -> None:
        super().__init__(function, chosen)
        self._running, self._turns = True, np.zeros(0)
        self._checked = set[tuple[frozenset[str], ...]]()

    @property
    def note(self) -> str:
        """The controller, in words."""
        return f"a controller set {self._names} in every evaluation"

    @property
    def repeated(self) -> Callable[..., Any]:
        """The controller itself."""
        return self._function

    def steered(self, stepper: Any, library: Library, parameters: Array, names: Iterable[str]) -> Library:
        """Return kernels of which those of the ``names`` set the inputs of a state before they are called."""
        self._stepper, self._given = stepper, parameters
        made = {name: self._before(name, library) for name in names if name in library.addresses}
        addresses = {**library.addresses, **{name: address_of(kernel) for name, kernel in made.items()}}
        return replace(library, addresses=addresses, owner=(library.owner, made))

    def _before(self, name: str, library: Library) -> Any:
        following, setup = KERNEL(library.addresses[name]), library.addresses.get("setup")
        derive = KERNEL(setup) if setup and library.derived else None
        sizes, width = self._stepper._model.description.sizes, ctypes.sizeof(ctypes.c_double)

        def kernel(*pointers: int | None) -> None:
            if self._running:
                t, q, u, p = (
                    np.frombuffer((ctypes.c_double * size).from_address(at)) if at and size else np.zeros(0)
                    for at, size in zip(pointers, sizes, strict=False)
                )
                self._put(float(t[0]), np.concatenate([q, u]), p[: len(self._given)])
                if derive is not None:
                    behind = (pointers[3] or 0) + width * len(self._given)
                    derive(None, None, None, pointers[3], None, behind)
            following(*pointers)

        return KERNEL(kernel)

    def _put(self, t: float, y: Array, p: Array) -> None:
        """Set the inputs among the parameters of the kernels; NaN ends a run."""
        values = dict.fromkeys(self._stepper._signals, np.nan)
        if not (self.error or FAILURES.errors):
            try:
                values = self._at(t, y, p[len(self._stepper._places) :], self._turns)
            except Exception as error:
                self._failed(t, error)
            except BaseException as stop:  # Ctrl-C; ctypes would print and ignore it
                FAILURES.errors.append(stop)
        for name, place in self._stepper._signals.items():
            p[place] = values[name]

    def _at(self, t: float, y: Array, held: Array, turns: Array) -> dict[str, float]:
        """Return all tunable parameters in a state; those ``held`` in the step are behind them."""
        values, first = self._given.copy(), len(self._stepper._places)
        values[first : first + len(held)] = held
        y = self._stepper._in_table(y, values, turns)
        stage = Stage(self._stepper, t, y, values, turns)
        inputs = self._asked(t, MotionView(stage))
        used = frozenset(stage.read), frozenset(inputs)
        if used not in self._checked:
            stage.check(sorted(inputs))
            self._checked.add(used)
        return {**stage.parameters, **inputs}

    def run(self, progress: Progress | None) -> tuple[int, float]:
        """Carry out the run; return its last status and the wall time [s]."""
        run = self._stepper._run
        try:
            return drive(run, run.t, self._chosen, progress, control=self._follow, by_step=True)
        finally:
            self._running = False

    def _follow(self) -> int:
        """Note the angles of links after a step, and return the status."""
        run = self._stepper._run
        self._turns = run.present()[2]
        return _core.ENDED if self.error else _core.MORE if run.t < self._chosen.t_end else _core.DONE

    def held(self, run: _core.Run) -> Array:
        """Return the tunable parameters at the samples of a run, (samples, parameters)."""
        n, count = self._stepper._equations.n, len(run.sampled)
        states = zip(run.sampled.tolist(), run.result[:, : 2 * n], run.references, run.turns, strict=True)
        return np.array([[*self._at(*state).values()] for state in states]).reshape(count, -1)
