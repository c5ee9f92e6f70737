"""Test cases and their execution with every method."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from symgen.errors import SimulationError
from symgen.pipeline.build import build
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.result.result import Result


@dataclass(frozen=True, slots=True)
class Trial:
    """One method applied to a case.

    ``bound`` is the largest permitted error; the run must then also be completed. If it is None, the result
    is shown without a criterion.
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
    """Result of a trial: error and drift as defined by the case, steps or poses, wall time [s]."""

    error: float
    drift: float
    steps: int
    seconds: float

    @classmethod
    def of(cls, result: Result, error: float, drift: float = 0.0) -> Found:
        """Return a run with its error and drift."""
        return cls(error, drift, result.statistics["steps"], result.statistics["wall_s"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Case(ABC):
    """A test case: a shipped scene with its difficulty and an independent solution.

    ``measure`` describes the error, ``drift_of`` the drift, and ``most_drift`` is the largest permitted drift
    in trials with a bound.
    """

    name: str
    hard: str
    measure: str
    family: str
    drift_of: str = ""
    most_drift: float = math.inf

    @property
    @abstractmethod
    def trials(self) -> tuple[Trial, ...]:
        """The trials of the case."""

    @abstractmethod
    def go(self, trial: Trial) -> Found:
        """Run a trial; raise SimulationError if it cannot be completed."""


@cache
def model_of(scene: str) -> Any:
    """Return the model of a shipped scene, built once."""
    return build(scene)


def largest(values: Any) -> float:
    """Return the largest magnitude."""
    return float(np.max(np.abs(values)))


#: Implicit methods are intended for stiff motions and are not run at tighter tolerances than this.
_IMPLICIT = 1e-8


def integrations(rtol: float, step: float, bounds: Mapping[str, float]) -> list[Trial]:
    """Return one trial per integrator: with a tolerance if it is adaptive, else with the step [s].

    ``bounds`` holds the bounds of integrators by name, and that of all others under ``others``, if any.
    Power series pass no losses of rank, which most of these motions do: tests/runtime/integrate/test_taylor.py.
    """
    found = []
    for name, method in INTEGRATORS.items():
        if method.kind == "taylor":
            continue
        tolerance = max(rtol, _IMPLICIT) if method.needs_tangent else rtol
        size = {"rtol": tolerance} if method.adaptive else {"step": step}
        found.append(Trial(name, size, bounds.get(name, bounds.get("others"))))
    return found


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of one trial of a case; ``message`` is the error message if it was not completed."""

    case: Case
    trial: Trial
    measured: Found | None
    message: str

    @property
    def survived(self) -> bool:
        """Whether the run was completed with finite numbers."""
        return self.measured is not None and bool(np.isfinite(self.measured.error))

    @property
    def required(self) -> bool:
        """Whether the trial has an acceptance criterion."""
        return self.trial.bound is not None

    @property
    def holds(self) -> bool:
        """Whether the acceptance criterion is met."""
        if self.trial.bound is None:
            return True
        if self.measured is None or not self.survived:
            return False
        return self.measured.error <= self.trial.bound and self.measured.drift <= self.case.most_drift


def go_through(case: Case, trial: Trial) -> Outcome:
    """Run one trial and return its outcome."""
    found, said = None, ""
    try:
        found = case.go(trial)
        if not np.isfinite(found.error):
            said = "numbers that are not finite"
    except SimulationError as error:
        said = str(error).partition("\n")[0]
    return Outcome(case, trial, found, said)
