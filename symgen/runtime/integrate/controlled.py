"""Runs with a sampled controller: a function that sets inputs, which are constant between its calls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from symgen.errors import ModelError, SimulationError, SymgenError, shown
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import Progress
from symgen.runtime.integrate.simulate import check_end, drive, sample_times
from symgen.runtime.integrate.stepper import Stepper
from symgen.runtime.kernels.arguments import is_real, out_of_range

if TYPE_CHECKING:
    from symgen.runtime.model.arguments import RunArguments
    from symgen.runtime.result.result import Result
    from symgen.runtime.result.state import State

AnyStepper = TypeVar("AnyStepper", bound=Stepper)

#: Part of a sampling interval within which times are equal.
_SAME = 1e-9


class MotionView:
    """The present state of a run, for its controller; ``view["pole.angle"]`` is an output of the scene.

    Outputs that depend on inputs are those of the inputs held so far. It is valid during the call alone:
    later it shows later states.
    """

    __slots__ = ("_of",)

    def __init__(self, of: Stepper) -> None:
        self._of = of

    def __repr__(self) -> str:
        return f"<MotionView at t = {self.t:g} s>"

    def __getitem__(self, name: str) -> Any:
        """Return an output of the scene, or a component such as ``C.position.x``, as a stepper does."""
        return self._of[name]

    @property
    def t(self) -> float:
        """The present time [s]."""
        return self._of.t

    @property
    def y(self) -> Array:
        """The present coordinates and their rates (q, u), in SI units."""
        return self._of.y

    @property
    def state(self) -> State:
        """The present state, for ``model.stepper(state=...)`` and analyses of the model."""
        return self._of.state

    @property
    def parameters(self) -> dict[str, float]:
        """Present values of the tunable parameters, inputs among them, in SI units."""
        return self._of.parameters

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs of the scene."""
        return self._of.outputs


def _scalar(value: Any) -> Any:
    """Return an array without axes as its number, and anything else as it is."""
    return value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value


class SampledController:
    """The calls of a controller in a run, and the parameters that it has set.

    Parameters
    ----------
    function
        ``function(t, view)`` returns inputs by name, in SI units; those that it omits keep their values.
    sample
        Time between two calls [s], the first at the start.
    """

    def __init__(
        self, function: Callable[..., Any], sample: float, stepper: Stepper, chosen: Options
    ) -> None:
        self._function, self._sample, self._stepper, self._chosen = function, sample, stepper, chosen
        self._view, self._begin = MotionView(stepper), stepper.t
        #: The error of the controller, and its message with the time; None as long as there is none.
        self.error: Exception | None = None
        self.problem = ""
        self._times: list[float] = []
        self._rows: list[list[float]] = []

    @property
    def note(self) -> str:
        """The controller, in words."""
        return f"a controller set {', '.join(self._stepper._signals)} every {self._sample:g} s"

    def run(self, progress: Progress | None) -> tuple[int, float]:
        """Carry out the run; return its last status and the wall time [s]."""
        run = self._stepper._run
        return drive(run, self._begin, self._chosen, progress, control=partial(self._hold, run))

    def _hold(self, run: _core.Run) -> int:
        """Set the inputs at the present time, a sampling time or the end, and return the status."""
        t_end, t = self._chosen.t_end, run.t
        self._stepper._row = None
        if t >= t_end:
            return _core.DONE
        try:
            values = self._asked(t)
        except Exception as error:
            said = str(error) if isinstance(error, SymgenError) else f"{type(error).__name__}: {error}"
            self.error, self.problem = error, f"the controller failed at t = {t:.9g} s: {said}"
            return _core.ENDED
        try:
            self._stepper.set(**values)
        except SimulationError as error:  # of the motion with these inputs
            self.error, self.problem = error, str(error)
            return _core.ENDED
        row = self._rows[-1].copy() if self._rows else [*self._stepper.parameters.values()]
        for name, value in values.items():
            row[self._stepper._signals[name]] = value
        self._times.append(t)
        self._rows.append(row)
        until = self._begin + len(self._times) * self._sample
        run.extend(until if until < t_end - _SAME * self._sample else t_end)
        return _core.MORE

    def _asked(self, t: float) -> dict[str, float]:
        """Return the inputs that the controller asks for, checked."""
        values = self._function(t, self._view)
        known = self._stepper._signals
        if not isinstance(values, Mapping):
            example = next(iter(known), "F")
            raise ModelError(f"expected a dict of inputs, such as {{{example!r}: 2.0}}, got {shown(values)}")
        checked = {}
        for name, given in values.items():
            value = _scalar(given)
            if name not in known:
                raise ModelError(
                    f"{shown(name)} is no input. Known: {', '.join(known) or 'none'}.\n"
                    "  A controller sets names under [inputs] of the scene."
                )
            if not is_real(value):
                raise ModelError(f"expected a finite number for {name}, got {shown(value)}")
            checked[name] = float(value)
        return checked

    def finished(self, result: Result, status: int) -> Result:
        """Return the result of a run that ended with this status; raise SimulationError for a failure."""
        run = self._stepper._run
        problem = self.problem
        if not problem and status not in (_core.DONE, _core.ENDED):
            problem = self._stepper._cause(status)
        if problem:
            partial = result if run.recorded else None
            raise SimulationError(problem, time=run.t, partial=partial) from self.error
        return result

    def repeated(self, t: float, view: Any) -> dict[str, float]:
        """Return the inputs of the call at a sampling time [s], without another call."""
        known = self._stepper._signals
        row = self.held(np.array([t]))[0].tolist()
        return {name: row[place] for name, place in known.items()}

    def held(self, times: Array) -> Array:
        """Return the tunable parameters at times [s] of the run, (times, parameters)."""
        at = np.searchsorted(self._times, times + _SAME * self._sample, side="right") - 1
        return np.array(self._rows)[np.maximum(at, 0)]


def controlled(
    model: Any, stepper: Callable[..., AnyStepper], request: RunArguments, chosen: Options
) -> tuple[AnyStepper, SampledController]:
    """Return the motion of a run with a controller at its start, and the calls of the controller.

    Raises
    ------
    ModelError
        For a sampling interval out of range, a checkpoint, and a model without inputs.
    """
    function, sample = request.controller, request.sample
    if function is None or sample is None:
        raise ModelError(
            "expected sample, the time between two calls of the controller [s], got none\n"
            "  A continuous law is part of the scene: expressions in its loads, and [states]."
        )
    if not (is_real(sample) and sample > 0.0):
        raise out_of_range("sample", sample)
    if request.keeping() is not None:
        raise ModelError(
            "a checkpoint does not contain the variables of a controller: runs with one have no checkpoints"
        )

    def sampled(t0: float) -> Array:
        check_end(t0, chosen)
        if not chosen.t_end + sample > chosen.t_end:
            raise ModelError(f"sample={sample:g} s is too short to advance t_end={chosen.t_end:g} s")
        return sample_times(t0, chosen, request.t_eval)

    motion = stepper(model, chosen, request.state, sampled)
    if not motion._signals:
        raise ModelError(f"{model.name} has no inputs for a controller\n  Declare them under [inputs].")
    return motion, SampledController(function, float(sample), motion, chosen)
