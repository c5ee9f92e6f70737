"""What a hard case is, and how it is gone through by one method after the other."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from symgen.errors import SimulationError
from symgen.runtime.integrators import INTEGRATORS


@dataclass(frozen=True, slots=True)
class Trial:
    """One way through a case.

    ``bound`` is what the error must not pass, and then the case must be survived; where it is None nothing
    must hold, and what comes is shown as it is.
    """

    method: str
    options: Mapping[str, Any] = field(default_factory=dict)
    bound: float | None = None

    @property
    def label(self) -> str:
        """The method with its tolerance or step."""
        words = [
            f"{name} {value:g}" for name, value in self.options.items() if isinstance(value, float | int)
        ]
        named = [value for name, value in self.options.items() if isinstance(value, str) and name != "method"]
        return ", ".join([self.method, *named, *words])


@dataclass(frozen=True, slots=True)
class Found:
    """What a trial came to: error and drift as the case measures them, steps or poses, wall time [s]."""

    error: float
    drift: float
    steps: int
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Case(ABC):
    """A hard case: a shipped scene, what is hard in it, and what is known of it independently.

    ``measure`` says what the error is of, ``drift_of`` what the drift is of, and ``most_drift`` what it must
    not pass where something must hold.
    """

    name: str
    hard: str
    measure: str
    family: str
    drift_of: str
    most_drift: float

    @property
    @abstractmethod
    def trials(self) -> tuple[Trial, ...]:
        """The ways through it."""

    @abstractmethod
    def go(self, trial: Trial) -> Found:
        """Go through it; raise SimulationError where that cannot be done."""


#: Implicit methods are made for stiff motions: no tighter tolerance makes sense for these.
_IMPLICIT = 1e-8


def integrations(rtol: float, step: float, bounds: Mapping[str, float]) -> list[Trial]:
    """Return a trial for every integrator: by a tolerance where it adapts its step, else by the step [s].

    ``bounds`` are those of single integrators by name, and under ``others`` that of all others, if any.
    """
    found = []
    for name, method in INTEGRATORS.items():
        tolerance = max(rtol, _IMPLICIT) if getattr(method, "needs_tangent", False) else rtol
        size = {"rtol": tolerance} if method.adaptive else {"step": step}
        found.append(Trial(name, size, bounds.get(name, bounds.get("others"))))
    return found


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one trial of a case ended; ``said`` is what symgen said where it was not survived."""

    case: Case
    trial: Trial
    found: Found | None
    said: str

    @property
    def survived(self) -> bool:
        """Whether it came to its end, with numbers."""
        return self.found is not None and bool(np.isfinite(self.found.error))

    @property
    def required(self) -> bool:
        """Whether something must hold."""
        return self.trial.bound is not None

    @property
    def holds(self) -> bool:
        """Whether what must hold does."""
        if self.trial.bound is None:
            return True
        if self.found is None or not self.survived:
            return False
        return self.found.error <= self.trial.bound and self.found.drift <= self.case.most_drift

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, for JSON."""
        found = self.found if self.survived else None
        return {
            "case": self.case.name,
            "family": self.case.family,
            "method": self.trial.label,
            "survived": self.survived,
            "error": found.error if found else None,
            "drift": found.drift if found else None,
            "steps": found.steps if found else None,
            "seconds": found.seconds if found else None,
            "bound": self.trial.bound,
            "holds": self.holds,
            "said": self.said,
        }


def go_through(case: Case, trial: Trial) -> Outcome:
    """Run one trial and return how it ended."""
    found, said = None, ""
    try:
        found = case.go(trial)
        if not np.isfinite(found.error):
            said = "numbers that are not finite"
    except SimulationError as error:
        said = str(error).partition("\n")[0]
    return Outcome(case, trial, found, said)


#: Takes the part that is done.
Progress = Callable[[float], None]


def run_suite(cases: tuple[Case, ...], progress: Progress | None = None) -> tuple[Outcome, ...]:
    """Run every trial of every case, in their order."""
    todo = [(case, trial) for case in cases for trial in case.trials]
    outcomes = []
    for i, (case, trial) in enumerate(todo):
        outcomes.append(go_through(case, trial))
        if progress:
            progress((i + 1) / len(todo))
    return tuple(outcomes)
