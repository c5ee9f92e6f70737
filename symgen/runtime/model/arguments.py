"""Arguments of analyses, one record for each kind: see :class:`~symgen.runtime.model.model.Model`."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from numpy.typing import ArrayLike

from symgen.errors import ModelError, OptionsError
from symgen.precision import Precision
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.checkpoint import CheckpointOptions, keeping
from symgen.runtime.integrate.options import Options, end_of_scene, options, sample_count
from symgen.runtime.integrate.pace import Progress
from symgen.runtime.kernels.arguments import reals

if TYPE_CHECKING:
    from symgen.runtime.model.instants import Instants
    from symgen.runtime.result.state import State

F = TypeVar("F", bound=Callable[..., Any])
Path = str | os.PathLike[str]
#: Time [s] within which the first step of a motion without an end is sought.
_HORIZON = 1.0


def takes(record: type) -> Callable[[F], F]:
    """Declare that a method ``_NAME`` of a model receives the arguments of its analysis as one record."""

    def declared(method: F) -> F:
        vars(method)["record"] = record
        return method

    return declared


@dataclass(frozen=True, kw_only=True, eq=False)
class Checkpointed:
    """Checkpoints, wall time and progress of a run."""

    max_wall: float | None = None
    checkpoint: Path | None = None
    checkpoint_every: float = 10.0
    resume: Path | None = None
    progress: Progress | None = None

    def keeping(self) -> CheckpointOptions | None:
        """Return the checked options of checkpoints; None if none are requested."""
        return keeping(self.checkpoint, self.checkpoint_every, self.resume)


@dataclass(frozen=True, kw_only=True, eq=False)
class Controlled:
    """A controller of a run, and the time between two of its calls."""

    controller: Callable[..., Any] | None = None
    sample: float | None = None

    @property
    def controlled(self) -> bool:
        """Whether a controller sets inputs; raise OptionsError for its sampling interval alone."""
        if self.controller is None and self.sample is not None:
            raise OptionsError("{sample} is the sampling interval of a controller: give {controller}, too")
        return self.controller is not None


@dataclass(frozen=True, kw_only=True, eq=False)
class RunArguments(Controlled, Checkpointed):
    """A run of a loop."""

    t_end: float | None = None
    method: str | None = None
    rtol: float | None = None
    atol: float | None = None
    step: float | None = None
    samples: int | None = None
    t_eval: ArrayLike | None = None
    max_steps: int = 1_000_000_000
    stabilisation: str = "projection"
    max_drift: float | None = None
    max_step: float | None = None
    state: State | None = None

    def options(
        self, end: float, precision: Precision, rate: float | None = None, series: float = 0.0
    ) -> Options:
        """Return the checked options of a run until a time [s].

        Power series are the default up to the rtol ``series``, without a controller, whose calls end steps.
        """
        return options(
            end_of_scene(end) if self.t_end is None else self.t_end,
            self.method,
            self.rtol,
            self.atol,
            self.step,
            sample_count(self.samples, self.t_eval, 201),
            self.max_steps,
            self.stabilisation,
            rate,
            self.max_drift,
            precision,
            max_step=self.max_step,
            series=0.0 if self.controller else series,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkageRun(RunArguments):
    """A run of a linkage of points and links."""

    stabilisation_rate: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Stepping:
    """A motion that advances by calls."""

    method: str | None = None
    rtol: float | None = None
    atol: float | None = None
    step: float | None = None
    max_step: float | None = None
    state: State | None = None

    def options(self) -> Options:
        """Return the checked options of its run."""
        numbers = (self.method, self.rtol, self.atol, self.step)
        return options(_HORIZON, *numbers, 2, 1_000_000_000, max_step=self.max_step)


@dataclass(frozen=True, kw_only=True, eq=False)
class Range:
    """Values or a range of the input or the time."""

    start: float | None = None
    stop: float | None = None
    at: ArrayLike | None = None
    over: str | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PosesArguments(Range):
    """Poses of a loop."""

    samples: int | None = None
    through: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkageRange(Range):
    """Poses of a linkage from a state.

    Runs with a ``common`` axis record those samples of the whole range that they reach. Otherwise samples are
    spread over the part of it that is reached.
    """

    samples: int = 361
    state: State | None = None
    common: bool = field(default=False, metadata={"declared": False})

    def instants(self, end: float) -> Instants:
        """Return the times or inputs at which a linkage is evaluated; its scene ends at a time [s]."""
        from symgen.runtime.model.instants import instants

        found = instants(self.start, self.stop, self.at, self.over, self.samples, end)
        return replace(found, spread=found.at is None and not self.common)


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkageMotion(LinkageRange):
    """Motion of a linkage."""

    samples: int = 181
    of: Sequence[str] | None = None
    through: bool = False

    def instants(self, end: float) -> Instants:
        """Return them; past dead centres they belong to the whole range."""
        found = super().instants(end)
        return replace(found, spread=found.spread and not self.through)


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkageForces(LinkageRange):
    """Forces in a linkage."""

    elements: int = 1
    sections: Sequence[float] = (0.5,)


@dataclass(frozen=True, kw_only=True, eq=False)
class Derivatives:
    """Derivatives of outputs by parameters, at a pose or along a run."""

    outputs: Sequence[str]
    parameters: Sequence[str] | None = None
    at: Any = None
    t_end: float | None = None
    t_eval: ArrayLike | None = None
    method: str | None = None
    rtol: float | None = None
    atol: float | None = None
    step: float | None = None
    max_steps: int | None = None
    max_step: float | None = None

    @property
    def along(self) -> bool:
        """Whether they are along a run."""
        return self.t_end is not None or self.t_eval is not None

    @property
    def of_run(self) -> list[str]:
        """Names of the options of a run that are given."""
        names = ("method", "rtol", "atol", "step", "max_steps", "max_step")
        return [name for name in names if getattr(self, name) is not None]

    def run(self) -> tuple[Array, Options]:
        """Return the times [s] of derivatives along a run, and its checked options."""
        from symgen.runtime.linearisation.runs import MOST_STEPS

        times = reals(self.t_end, "t_end") if self.t_eval is None else reals(self.t_eval, "t_eval")
        if not len(times):
            raise ModelError("expected increasing times for t_eval, at least one, got none")
        last = float(times[-1]) if self.t_end is None else self.t_end
        most = MOST_STEPS if self.max_steps is None else self.max_steps
        arguments = (last, self.method, self.rtol, self.atol, self.step, 2, most)
        return times, options(*arguments, max_step=self.max_step)


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkageDerivatives(Derivatives):
    """Derivatives of outputs of a linkage."""

    coordinates: Sequence[str] = ()
    integrals: Sequence[str] = ()
