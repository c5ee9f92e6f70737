"""Cases of a study and their results."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.runtime.result.turn import Turn
from symgen.study.limits import Limit
from symgen.study.plan import Plan, Setting


@dataclass(frozen=True, slots=True)
class Case:
    """One combination of values: the loop over its range, or the reason why it cannot be traversed."""

    settings: tuple[Setting, ...]
    turn: Turn | None
    problem: str
    limits: tuple[Limit, ...]

    @property
    def label(self) -> str:
        """The values as a label for legends."""
        return ", ".join(map(str, self.settings)) or "the scene's own values"


@dataclass(frozen=True, slots=True)
class StudyResult:
    """A study with its cases."""

    plan: Plan
    cases: tuple[Case, ...]
