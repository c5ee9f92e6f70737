"""Runs with a controller: a function that sets inputs, at a sampling interval or in every evaluation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.continuous import ContinuousController
from symgen.runtime.integrate.controller import Controller, MotionView
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import Progress
from symgen.runtime.integrate.simulate import check_end, drive, sample_times
from symgen.runtime.integrate.stepper import Stepper
from symgen.runtime.kernels.arguments import is_real, out_of_range

if TYPE_CHECKING:
    from symgen.runtime.model.arguments import RunArguments

AnyStepper = TypeVar("AnyStepper", bound=Stepper)

#: Part of a sampling interval within which times are equal.
_SAME = 1e-9


class SampledController(Controller):
    """A controller at a sampling interval, and the parameters that it has set.

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
        super().__init__(function, chosen)
        self._sample, self._stepper = sample, stepper
        self._view, self._begin = MotionView(stepper), stepper.t
        self._times: list[float] = []
        self._rows: list[list[float]] = []

    @property
    def note(self) -> str:
        """The controller, in words."""
        return f"a controller set {self._names} every {self._sample:g} s"

    def run(self, progress: Progress | None) -> tuple[int, float]:
        """Carry out the run; return its last status and the wall time [s]."""
        run = self._stepper._run
        return drive(run, self._begin, self._chosen, progress, control=self._hold)

    def _hold(self) -> int:
        """Set the inputs at the present time, a sampling time or the end, and return the status."""
        run = self._stepper._run
        t_end, t = self._chosen.t_end, run.t
        self._stepper._row = None
        if t >= t_end:
            return _core.DONE
        try:
            values = self._asked(t, self._view)
        except Exception as error:
            self._failed(t, error)
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

    @property
    def repeated(self) -> Callable[..., Any]:
        """The inputs at sampling times."""
        return self._set

    def _set(self, t: float, view: Any) -> dict[str, float]:
        known = self._stepper._signals
        row = self._at(np.array([t]))[0].tolist()
        return {name: row[place] for name, place in known.items()}

    def held(self, run: _core.Run) -> Array:
        """Return the tunable parameters at the samples of a run, (samples, parameters)."""
        return self._at(run.sampled)

    def _at(self, times: Array) -> Array:
        at = np.searchsorted(self._times, times + _SAME * self._sample, side="right") - 1
        rows = self._rows or [[*self._stepper.parameters.values()]]  # of a controller that failed at once
        return np.array(rows)[np.maximum(at, 0)]


def controlled(
    model: Any, stepper: Callable[..., AnyStepper], request: RunArguments, chosen: Options
) -> tuple[AnyStepper, SampledController | ContinuousController]:
    """Return the motion of a run with a controller at its start, and the calls of the controller.

    Raises
    ------
    ModelError
        For a sampling interval out of range, a checkpoint, and a model without inputs; without an interval,
        for a method whose steps need more than accelerations.
    """
    function: Any = request.controller
    sample = request.sample
    if not (sample is None or (is_real(sample) and sample > 0.0)):
        raise out_of_range("sample", sample)
    if request.keeping() is not None:
        raise ModelError(
            "a checkpoint does not contain the variables of a controller: runs with one have no checkpoints"
        )
    if sample is None and chosen.method.kind != "explicit":
        raise ModelError(
            f"{chosen.method.name} needs more of a controller than its values in each evaluation\n"
            "  Choose dop853, dopri5 or rk4, or give the time between two calls, sample."
        )

    def sampled(t0: float) -> Array:
        check_end(t0, chosen)
        if sample is not None and not chosen.t_end + sample > chosen.t_end:
            raise ModelError(f"sample={sample:g} s is too short to advance t_end={chosen.t_end:g} s")
        return sample_times(t0, chosen, request.t_eval)

    law: Any = ContinuousController(function, chosen) if sample is None else None
    try:
        motion = stepper(model, chosen, request.state, sampled, law)
    except SimulationError as error:
        if law and law.error:
            raise SimulationError(law.problem, time=error.time) from law.error
        raise
    if not motion._signals:
        raise ModelError(f"{model.name} has no inputs for a controller\n  Declare them under [inputs].")
    return motion, law if sample is None else SampledController(function, sample, motion, chosen)
