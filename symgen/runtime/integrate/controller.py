"""Functions that set the inputs of a run, and what they see of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.errors import ModelError, SimulationError, SymgenError, shown
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.options import Options
from symgen.runtime.kernels.arguments import is_real

if TYPE_CHECKING:
    from symgen.runtime.result.result import Result
    from symgen.runtime.result.state import State


class MotionView:
    """The present state of a run, for its controller; ``view["pole.angle"]`` is an output of the scene.

    Outputs that depend on inputs are those of the inputs held so far; a controller without a sampling
    interval cannot use them. It is valid during the call alone: later it shows later states.
    """

    __slots__ = ("_of",)

    def __init__(self, of: Any) -> None:
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
        """Present values of the tunable parameters, in SI units, inputs among them.

        Without a sampling interval inputs have the values of the model.
        """
        return self._of.parameters

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs of the scene."""
        return self._of.outputs


def _scalar(value: Any) -> Any:
    """Return an array without axes as its number, and anything else as it is."""
    return value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value


class Controller(ABC):
    """The calls of a controller in a run.

    Parameters
    ----------
    function
        ``function(t, view)`` returns inputs by name, in SI units.
    """

    _stepper: Any

    def __init__(self, function: Callable[..., Any], chosen: Options) -> None:
        self._function, self._chosen = function, chosen
        #: The error of the controller, and its message with the time; None as long as there is none.
        self.error: Exception | None = None
        self.problem = ""

    @property
    @abstractmethod
    def note(self) -> str:
        """The controller, in words."""

    @property
    @abstractmethod
    def repeated(self) -> Callable[..., Any]:
        """The controller of a repeated run: one with a memory is not called again."""

    @abstractmethod
    def held(self, run: _core.Run) -> Array:
        """Return the tunable parameters at the samples of a run, (samples, parameters)."""

    @property
    def _names(self) -> str:
        return ", ".join(self._stepper._signals)

    def _failed(self, t: float, error: Exception) -> None:
        said = str(error) if isinstance(error, SymgenError) else f"{type(error).__name__}: {error}"
        self.error, self.problem = error, f"the controller failed at t = {t:.9g} s: {said}"

    def _asked(self, t: float, view: MotionView) -> dict[str, float]:
        """Return the inputs that the controller asks for, checked."""
        values = self._function(t, view)
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
