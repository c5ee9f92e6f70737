"""Tangents of the linear equations of elastic links by parameters along a run, between Chebyshev points.

There are so many points that the highest polynomials vanish.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from symgen.errors import ModelError
from symgen.runtime._beams import IN_MOTION, MOTION, BeamEquations
from symgen.runtime.arrays import Array, Dual
from symgen.runtime.elastic.derivatives.matrices import assembled
from symgen.runtime.elastic.derivatives.poses import Pose
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.kernels.evaluate import UNIT

#: Intervals between Chebyshev points to begin with, and the most.
_FIRST, _MOST = 16, 4096
#: Parts of the largest polynomial below which the highest vanish: of the rigid motion, and of all tangents.
_RIGID, _TANGENTS = 1e-13, 1e-11
#: Part of the terms that are the highest, and of the largest quantity that each counts as at least.
_HIGHEST, _LEAST = 0.1, 1e-3


class Course:
    """Tangents of the matrices of the elastic motion, from time zero to an end [s]."""

    def __init__(self, motion: ElasticMotion, parameters: tuple[str, ...], end: float) -> None:
        self.motion, self.parameters, self.end = motion, parameters, end
        self.equations = motion.equations()
        first = Pose(motion, parameters, 0.0, self.equations)
        #: Links with tangents along each parameter.
        self.links = [first.linkage(j) for j in range(len(parameters))]
        n, joints = motion.layout.unknowns, motion.layout.unknowns - motion.layout.inner
        self._sizes = np.cumsum([3 * n * n, n + 3 * motion.layout.constraints * joints])
        count = _FIRST
        while self._last_terms(motion.rigid_motion(self.equations, self._times(count))[1]) > _RIGID:
            count = self._more(count)
        known: dict[float, Dual] = {}
        while True:
            times = self._times(count)
            for t in times.tolist():
                if t not in known:
                    known[t] = self._assembled(t)
            rows = np.array([known[t] for t in times.tolist()])
            natural = [max(abs(motion.rigid.parameters[name]), 1e-300) for name in parameters]
            slopes = rows.imag / UNIT * np.array(natural)[:, None]
            size = np.max(np.abs(rows.real), axis=(0, 1))
            if max(self._last_terms(rows.real[:, 0]), self._last_terms(slopes, _LEAST * size)) <= _TANGENTS:
                break
            count = self._more(count)
        self.times, self._rows = times, rows
        weights = np.where(np.arange(count + 1) % 2, -1.0, 1.0)
        weights[[0, -1]] /= 2
        self._weights = weights

    def carried(self) -> BeamEquations:
        """Return equations whose batches carry the tangents by the parameters."""
        tangents = np.moveaxis(self._rows.imag / UNIT, 0, 1)
        matrices, others, _ = np.split(tangents, self._sizes, axis=2)
        n = self.motion.layout.unknowns
        matrices = matrices.reshape(*matrices.shape[:2], 3, n, n)
        rows, columns = np.nonzero(np.any(matrices, axis=(0, 1, 2)))
        entries = matrices[..., rows, columns].reshape(*matrices.shape[:2], -1)
        equations = self.motion.equations()
        equations.carry(self.times, self._weights, rows, columns, np.concatenate([entries, others], axis=2))
        return equations

    def _times(self, count: int) -> Array:
        return self.end * (0.5 - 0.5 * np.cos(np.pi * np.arange(count + 1) / count))

    def _more(self, count: int) -> int:
        if count >= _MOST:
            raise ModelError(
                f"{self.motion.rigid.name}: the rigid motion is not smooth, or the run is too long: {_MOST} "
                "poses do not determine its derivatives\n  Take a shorter run."
            )
        return 2 * count

    def _assembled(self, t: float) -> Dual:
        """Return M, C, K, Q, J, J', J'' and weights of links with tangents by each, (parameters, numbers)."""
        pose, layout = Pose(self.motion, self.parameters, t, self.equations), self.motion.layout
        matrices = []
        for j, links in enumerate(self.links):
            weights, loads, joined = pose.of_motion(j)
            at = assembled(links, weights, loads, joined, IN_MOTION).narrowed()
            parts = [at.mass, at.damping, at.stiffness, at.load]
            for name in ("jacobian", "jacobian_rate", "jacobian_second_rate") if layout.constraints else ():
                bound = np.zeros((layout.constraints, layout.unknowns), complex)
                bound[:, layout.joint_places[:-1]] = joined[name].reshape(layout.constraints, -1)
                parts.append(bound[:, layout.inner :])
            matrices.append(np.concatenate([x.ravel() for x in (*parts, weights)]))
        return np.array(matrices)

    @staticmethod
    def _last_terms(values: Array, least: Any = 0.0) -> float:
        """Return :func:`highest` of the Chebyshev polynomials of values (points, ...)."""
        both, count = np.concatenate([values, values[-2:0:-1]]), len(values)
        return highest(np.abs(np.fft.rfft(both, axis=0))[:count] / count, least)

    def between(self, times: Array) -> Array:
        """Return the matrix of values at times by those at the points, (times, points)."""
        apart = times[:, None] - self.times
        met = apart == 0.0
        terms = self._weights / np.where(met, 1.0, apart)
        terms = np.where(np.any(met, axis=1)[:, None], met, terms)  # all at the start
        return terms / np.sum(terms, axis=1, keepdims=True)

    def rows(self, j: int, times: Array) -> Dual:
        """Return the weights of links at times with tangents along parameter j, (times, links, columns)."""
        rows: Dual = self.between(times) @ self._rows[:, j, self._sizes[-1] :]
        return rows.reshape(len(times), -1, len(MOTION))


def highest(terms: Array, least: Any = 0.0) -> float:
    """Return the largest of the highest of terms (terms, ...) over the largest term of each quantity.

    Quantities count as no smaller than ``least``.
    """
    last = np.max(terms[-math.ceil(_HIGHEST * len(terms)) :], axis=0)
    size = np.maximum(np.max(terms, axis=0), _LEAST * np.max(terms))
    return float(np.max(last / np.maximum(np.maximum(size, least), 1e-300)))
