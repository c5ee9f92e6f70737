"""Control loops: a motion that advances by calls, between which inputs may change."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite
from typing import Any, NoReturn, Self

import numpy as np

from symgen.calls import checked
from symgen.errors import ModelError, SimulationError, nearest
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.simulate import stepper_of
from symgen.runtime.kernels.arguments import out_of_range, real
from symgen.runtime.kernels.description import BlockInfo
from symgen.runtime.result.records import LocatedEvent
from symgen.runtime.result.state import State


class Stepper(ABC):
    """A motion in time that advances by calls: :meth:`symgen.Model.stepper` returns one.

    ``stepper.set(F=2.0)`` sets an input, ``stepper.step(1e-3)`` advances the motion while it is constant, and
    ``stepper["pole.angle"]`` is an output of the scene at the present time. Threads need one each.
    """

    _run: _core.Run
    _equations: Any
    _row: Array | None
    _given: State | None

    def __init__(
        self,
        model: Any,
        chosen: Options,
        state: State | None,
        sampled: Callable[[float], Array] | None = None,
        law: Any = None,
    ) -> None:
        """Begin a motion; ``sampled`` returns the times [s] that a run from a start records.

        ``law`` is its controller without a sampling interval.
        """
        model._refuse_types("steppers are" if sampled is None else "runs with a controller are")
        self._model, self._chosen, self._first, self._sampled = model, chosen, state, sampled
        self._law = law
        d = model.description
        self._places = {p.name: i for i, p in enumerate(d.tunable)}
        #: Parameters that neither constraints nor limits of values depend on.
        self._signals = {name: self._places[name] for name in self._independent()}
        info = d.kernel("outputs")
        self._take_outputs(info.blocks if info else ())
        self.reset()

    def _take_outputs(self, blocks: Sequence[BlockInfo]) -> None:
        """Take the parts of :meth:`_evaluated`."""
        self._blocks = tuple(blocks)
        self._outputs = dict(place for block in blocks for place in _places(block))

    def __repr__(self) -> str:
        return f"<Stepper of {self._model.name!r} at t = {self.t:g} s>"

    def step(self, h: float, /) -> None:
        """Advance the motion by a time h [s] with the present values of the parameters.

        An event that ends runs ends the motion before: see :attr:`ended`.

        Raises
        ------
        ModelError
            When h is not a number above zero, or too small to change the time.
        SimulationError
            When the motion cannot continue, with its time and cause; or an event has ended it before.
        """
        run = self._run
        if not (isinstance(h, float) and run.t < run.t + h < inf):
            h = self._length(h)
        self._row = None
        status = run.step(h)
        if status != _core.DONE:
            self._stopped(status)

    def set(self, /, **values: float) -> None:
        """Set inputs and other tunable parameters by name, in SI units, from the present time on.

        Inputs change at little cost. Others are checked as in :meth:`~symgen.Model.with_parameters`, and the
        state is projected onto the constraints, which may depend on them.

        Raises
        ------
        ModelError
            For an unknown name and a value that is not finite; RangeError for a wrong sign. Nothing changes.
        SimulationError
            When the motion cannot continue with these values. Nothing changes.
        """
        signals = self._signals
        for name, value in values.items():
            if not (isinstance(value, float) and name in signals and isfinite(value)):
                checked = self._model.with_parameters(**{**self.parameters, **values}).parameters
                moves = bool(values.keys() - signals.keys())
                self._change({name: checked[name] for name in values}, moves)
                return
        self._change(values, False)

    def _change(self, values: Mapping[str, float], moves: bool) -> None:
        """Set checked values, and restart the motion if any differs; ``moves``: constraints may move."""
        places, put, run = self._places, self._equations.put, self._run
        saved = run.save() if moves else None
        before = {name: put(places[name], value) for name, value in values.items()}
        if before == values:
            return
        self._row = None
        status = run.restart(moves)
        if status != _core.MORE:
            cause = self._cause(status)
            if saved is not None:
                run.restore(*saved)
            else:
                for name, value in before.items():
                    put(places[name], value)
                run.restart(False)
            raise SimulationError(cause, time=run.t)

    @checked
    def reset(self, state: State | None = None) -> None:
        """Return to a state, by default that at which the stepper began, and to the parameters of the model.

        Raises
        ------
        InitialStateError, ModelError
            When the start cannot be assembled, or the state is of another model.
        SimulationError
            When there is no motion from there.
        """
        before = self.__dict__.copy()
        try:
            self._given = self._first if state is None else state
            self._make(self._given)
            status = self._run.begin()
            if status != _core.MORE:
                raise SimulationError(self._cause(status), time=self._run.t)
        except BaseException:
            self.__dict__ = before
            raise

    def copy(self) -> Self:
        """Return a stepper that continues from the same state with the same parameters."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._make(None)
        other._over = self._over
        other._run.continue_as(self._run)
        return other

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self.copy()

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a stepper cannot be pickled: its motion is in compiled code\n"
            "  Pickle stepper.state, and go on from there by model.stepper(state=...) and set(...)."
        )

    @property
    def t(self) -> float:
        """The present time [s]."""
        return self._run.t

    @property
    def y(self) -> Array:
        """The present coordinates and their rates (q, u), as of :attr:`state`, in SI units."""
        return self._run.state[: 2 * self._equations.n]

    @property
    @abstractmethod
    def state(self) -> State:
        """The present state, for :meth:`reset` and for analyses of the model."""

    @property
    def parameters(self) -> dict[str, float]:
        """Present values of the tunable parameters, in SI units: :meth:`set` changes them."""
        return dict(zip(self._places, self._equations.parameters.tolist(), strict=False))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs of the scene."""
        return tuple(block.name for block in self._blocks)

    def __getitem__(self, name: str) -> Any:
        """Return an output of the scene at the present state, or a component such as ``C.position.x``.

        A number, or an array for an output with components.
        """
        row = self._row
        if row is None:
            row = self._row = self._evaluated()
        return self._entry(name, row)

    def _entry(self, name: str, row: Array) -> Any:
        """Return an output by name from those of a state."""
        place = self._outputs.get(name) if isinstance(name, str) else None
        if place is None:
            raise ModelError(
                f"{self._model.name} has no output {str(name)!r}. {nearest(str(name), self._outputs)}\n"
                "  Another quantity of the scene is computed if outputs under [analysis] lists it."
            )
        where, shape = place
        return float(row[where]) if shape is None else row[where].reshape(shape).copy()

    @property
    @abstractmethod
    def events(self) -> tuple[LocatedEvent, ...]:
        """Events of the scene during the last call of :meth:`step`, in the order of time."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the state at which the motion began, as of a run: whether it violates the constraints."""
        return ()

    @property
    def ended(self) -> str | None:
        """The event that ended the motion before the end of the last step, by name; None without one."""
        number = self._run.ended_by
        return None if number < 0 else str(self._model.description.events[number].name)

    @abstractmethod
    def _independent(self) -> tuple[str, ...]:
        """Return names of parameters that neither constraints nor limits of values depend on."""

    @abstractmethod
    def _new(self, state: State | None) -> tuple[Any, Any, float, Array, dict[str, Any]]:
        """Return equations, others for outputs, time and state of a start, and options of the run."""

    @abstractmethod
    def _evaluated(self) -> Array:
        """Return the output of the kernel 'outputs' at the present state."""

    def _in_table(self, y: Array, parameters: Array, near: Array) -> Array:
        """Return a state (q, u) within a step in the angles of the scene, and change ``parameters`` with it.

        ``near`` are continuous angles in a state nearby.
        """
        return y

    @abstractmethod
    def _cause(self, status: int) -> str:
        """Return the message for a motion that ended with this status."""

    def _make(self, state: State | None) -> None:
        chosen, self._row, self._over = self._chosen, None, False
        self._equations, self._view, t, y, more = self._new(state)
        if len(y) != self._equations.dim:
            n = self._equations.n
            raise ModelError(f"expected a state of {n} coordinates of {self._model.name}, got {len(y) // 2}")
        times, over = np.array([t]), replace(chosen, t_end=t + chosen.t_end)
        if self._sampled is not None:
            times, over = self._sampled(t), chosen
        self._run = stepper_of(self._equations, over, t, y, times, continues=True, **more)

    def _length(self, h: Any) -> float:
        """Return the time of a step [s]; raise ModelError for one that does not advance."""
        length, t = real(h, "the time of a step"), self._run.t
        if not length > 0.0:
            raise out_of_range("the time of a step", h)
        if not t < t + length < inf:
            raise ModelError(f"a step of {length:g} s does not advance the time {t:g} s")
        return length

    def _stopped(self, status: int) -> None:
        if status != _core.ENDED:
            raise SimulationError(self._cause(status), time=self.t)
        if self._over:
            raise SimulationError(
                f"the event {self.ended!r} has ended the motion at t = {self.t:.9g} s\n"
                "  stepper.reset() begins another.",
                time=self.t,
            )
        self._over = True


def _places(block: BlockInfo) -> list[tuple[str, tuple[int | slice, tuple[int, ...] | None]]]:
    """Return the places of an output and of its components, by name: numbers, or parts with their shapes."""
    rows, columns = block.shape
    count, first = rows * columns, block.offset
    if count == 1:
        return [(block.name, (first, None))]
    whole = slice(first, first + count)
    if columns > 1:
        return [(block.name, (whole, block.shape))]
    return [
        (block.name, (whole, (count,))),
        *((f"{block.name}.{c}", (first + i, None)) for i, c in enumerate(block.rows)),
    ]
