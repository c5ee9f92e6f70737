"""Angles in loads that are counted over revolutions, along a run in large rotation."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.evaluate import Evaluator, part

#: Change [rad] of an angle after which its reference moves: far below the half revolution that it may change
#: before the nearer way round is another one.
_FAR = math.pi / 4
#: Number of kernels with references that are kept.
_STORED = 100


class Counted:
    """Kernels whose angles in loads are continuous along one motion of the linkage with rigid links.

    Angles are the nearest to their references, parameters that follow the motion at the end of steps.

    Parameters
    ----------
    rigid
        The linkage with rigid links, which has the angles.
    """

    def __init__(self, rigid: Evaluator) -> None:
        self._rigid, self._count = rigid, rigid.description.windings
        self._since: list[float] = []
        self._references: list[Array] = []
        self.restart()

    def restart(self) -> None:
        """Count from the start of a run, at which angles are from -pi to pi."""
        self._since, self._references = [-math.inf], [np.zeros(self._count)]
        self._evaluators: dict[tuple[Evaluator, int], Evaluator] = {}

    def follow(self, t: float, q: Array, v: Array) -> bool:
        """Move references to the angles at a time [s], (1, coordinates); return whether any moved."""
        if not self._count:
            return False
        angles = self.blocks(self._rigid, "events", np.array([t]), q, v)["windings"].ravel()
        if np.max(np.abs(angles - self._references[-1])) <= _FAR:
            return False
        self._since.append(t)
        self._references.append(angles)
        return True

    @property
    def references(self) -> Array:
        """Times from which references hold [s], and these, (references, 1 + angles)."""
        return np.column_stack([self._since, self._references])

    @references.setter
    def references(self, rows: Array) -> None:
        if rows.ndim != 2 or rows.shape[1] != 1 + self._count or not len(rows):
            raise ValueError(f"expected references of {self._count} angles, got shape {rows.shape}")
        self._since, self._references = rows[:, 0].tolist(), list(rows[:, 1:])

    def at(self, t: float, evaluator: Evaluator) -> Evaluator:
        """Return kernels with the references at a time [s] of the run."""
        if not self._count:
            return evaluator
        return self._with(evaluator, int(np.searchsorted(self._since, t, side="right")) - 1)

    def many(
        self, evaluator: Evaluator, kernel: str, t: Array, q: Array, v: Array, work: Array | None = None
    ) -> Array:
        """Return the results of a kernel at times of the run, (times, entries), given ``work`` of each."""
        if not self._count:
            return evaluator.many(kernel, t, q, v, work)
        values = np.empty((len(t), evaluator.info(kernel).out_size))
        for of, rows in self._groups(evaluator, t):
            memory = None if work is None else work[rows]
            values[rows] = of.many(kernel, t[rows], q[rows], v[rows], memory)
        return values

    def blocks(self, evaluator: Evaluator, kernel: str, t: Array, q: Array, v: Array) -> dict[str, Array]:
        """Return the results of a kernel at times of the run by name, (times, *shape)."""
        out = self.many(evaluator, kernel, t, q, v)
        return {b.name: part(out, b) for b in evaluator.info(kernel).blocks}

    def _groups(self, evaluator: Evaluator, t: Array) -> Iterator[tuple[Evaluator, Indices]]:
        which = np.searchsorted(self._since, t, side="right") - 1
        for k in np.unique(which).tolist():
            yield self._with(evaluator, k), np.flatnonzero(which == k)

    def _with(self, evaluator: Evaluator, k: int) -> Evaluator:
        """Return kernels with the references number k."""
        key = evaluator, k
        if key not in self._evaluators:
            if len(self._evaluators) > _STORED:  # of parameters that have changed
                self._evaluators.clear()
            values = evaluator.parameter_values.copy()
            first = self._rigid.description.of_held.start
            values[first : first + self._count] = self._references[k]
            self._evaluators[key] = type(evaluator)(evaluator.description, evaluator.library, values)
        return self._evaluators[key]
