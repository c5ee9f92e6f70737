"""Checkpoints of runs in large rotation, at the samples of runs with twice the steps each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.runtime._constrained import Steps
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import ConstrainedSystem, MotionState, ResumePoint
from symgen.runtime.integrate.checkpoint import Checkpoints, Keeping


class SampleCheckpoints(Checkpoints):
    """Checkpoints of runs of one system, which resume from the last sample.

    Attributes
    ----------
    before
        Motion of the run before at all samples, with its steps and corrections, if it is finished.
    steps
        Steps between two samples of the run to resume; 0 without.
    """

    def __init__(self, system: ConstrainedSystem, mark: str, keeping: Keeping) -> None:
        super().__init__(mark, keeping)
        self._system, self._corrections = system, 0
        self.before: tuple[list[MotionState], int, int] | None = None
        with self.reading():
            self.steps = int(self.left["steps"]) if self.left else 0
            if self.left and self.steps < 1:
                raise ValueError(f"expected one step or more between samples, got {self.steps}")
            if "before" in self.left:
                steps, corrections = (int(k) for k in self.left["counts_before"])
                system.restore(_part(self.left, "before_"))
                self.before = self._unpacked(self.left["before"]), steps, corrections
        self._latest: tuple[int, ResumePoint, int] | None = None

    def resumed(self) -> ResumePoint | None:
        """Return the motion of the run to resume, once, with the memory of the system; else None."""
        content, self.steps = self.left, 0
        if "moments" not in content:
            return None
        with self.reading():
            self._system.restore(_part(content, "now_"))
            (now,) = self._unpacked(content["now"])
            moments, guess = self._unpacked(content["moments"]), (content["guess"], content["guess_forces"])
            sizes = self._system.unknowns, self._system.multipliers
            for numbers, size in zip(guess, sizes, strict=True):
                if numbers.shape != (len(GAUSS8.c), size):
                    raise ValueError(f"expected {size} numbers at each stage, got shape {numbers.shape}")
            self.left = {k: v for k, v in content.items() if k.startswith("before") or k == "counts_before"}
            self._corrections = int(content["corrections"])
        return ResumePoint(moments, now, guess, self._corrections)

    def finished(self, moments: Sequence[MotionState], steps: int, corrections: int) -> None:
        """Record a finished run."""
        memory = {f"before_{name}": values for name, values in self._system.memory().items()}
        counts, self._corrections, self._latest = np.array([steps, corrections]), 0, None
        self.left = {"before": _packed(moments), "counts_before": counts, **memory}

    def look(self, steps: int, pause: ResumePoint, stepper: Steps) -> None:
        """Write a checkpoint at a sample if it is time."""
        self._latest = steps, pause, self._corrections + stepper.corrections
        if self.due():
            self.save()

    def save(self) -> None:
        """Write a checkpoint at the last sample, if there is one."""
        if self._latest is None:
            return
        steps, pause, corrections = self._latest
        arrays = self.left | {
            "steps": np.array(steps),
            "corrections": np.array(corrections),
            "moments": _packed(pause.moments),
            "now": _packed([pause.now]),
            "guess": pause.guess[0],
            "guess_forces": pause.guess[1],
            **{f"now_{name}": values for name, values in self._system.memory().items()},
        }
        self.write(pause.now.t, arrays)

    def _unpacked(self, rows: Array) -> list[MotionState]:
        n, width = self._system.unknowns, 2 + 3 * self._system.unknowns + self._system.multipliers
        if rows.ndim != 2 or rows.shape[1] != width:
            raise ValueError(f"expected rows of {width} numbers, got shape {rows.shape}")
        ends = [n, 2 * n, 3 * n]
        parts = ((x, np.split(x[2:], ends)) for x in rows)
        return [MotionState(float(x[0]), q, v, a, m, float(x[1])) for x, (q, v, a, m) in parts]


def _packed(moments: Sequence[MotionState]) -> Array:
    return np.array([[x.t, x.work, *x.q, *x.v, *x.a, *x.multipliers] for x in moments])


def _part(content: dict[str, Array], prefix: str) -> dict[str, Array]:
    return {k.removeprefix(prefix): v for k, v in content.items() if k.startswith(prefix)}
