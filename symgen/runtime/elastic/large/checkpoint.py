"""Checkpoints of runs in large rotation with twice the steps each."""

from __future__ import annotations

from typing import Any

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.large.collocation import SystemRun
from symgen.runtime.integrate.checkpoint import CheckpointOptions, Checkpoints, memory_of, restore

#: Name of the array of numbers of steps.
_STEPS = "steps"
#: Beginnings of the names of arrays: of the last whole run, and of the present one.
_RUNS = ("before_", "now_")


class RefinementCheckpoints(Checkpoints):
    """Checkpoints of one run after another.

    Attributes
    ----------
    steps
        Steps between two samples of the last whole run and of the one to resume; 0 without.
    """

    def __init__(self, mark: str, keeping: CheckpointOptions) -> None:
        super().__init__(mark, keeping)
        self._whole, self._present = dict[str, Array](), 0
        with self.reading():
            before, now = (int(k) for k in self.left[_STEPS]) if self.left else (0, 0)
            if before < 0 or now < bool(self.left):
                raise ValueError(f"expected one step or more between samples, got {now}")
        self.steps = before, now

    def begin(self, run: SystemRun) -> SystemRun:
        """Follow a run; bring it to where the checkpoint left it, if it is one of those."""
        self._now = run
        if run.steps in self.steps:
            prefix = _RUNS[self.steps.index(run.steps)]
            content = {k.removeprefix(prefix): v for k, v in self.left.items() if k.startswith(prefix)}
            with self.reading():
                run.system.restore({name: content[name] for name in run.system.memory()})
                restore(run.stepper, content)
        return run

    def finished(self, run: SystemRun) -> SystemRun:
        """Keep a whole run."""
        self._whole, self._present = _content(run, _RUNS[0]), run.steps
        return run

    def content(self, run: _core.Run) -> dict[str, Any]:
        """Return the arrays of the run that is followed, and of the last whole one."""
        steps = np.array([self._present, self._now.steps])
        return {_STEPS: steps, **self._whole, **_content(self._now, _RUNS[1])}


def _content(run: SystemRun, prefix: str) -> dict[str, Array]:
    content = memory_of(run.stepper) | run.system.memory()
    return {prefix + name: values for name, values in content.items()}
