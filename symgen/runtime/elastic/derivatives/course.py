"""Linear equations of elastic links along a run with their tangents by parameters, between Chebyshev points.

There are so many points that the highest polynomials vanish. Equations are reduced to independent unknowns p
of S = R p, where J R = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symgen.errors import ModelError
from symgen.runtime._beams import IN_MOTION, MOTION
from symgen.runtime.arrays import Array, Dual, Indices
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
    """Matrices of the elastic motion along a run, and their tangents: polynomials through some points."""

    def __init__(self, motion: ElasticMotion, parameters: tuple[str, ...], end: float) -> None:
        self.motion, self.parameters, self.end = motion, parameters, end
        self.equations = motion.equations()
        first = Pose(motion, parameters, 0.0, self.equations)
        #: Links with tangents along each parameter.
        self.links = [first.linkage(j) for j in range(len(parameters))]
        n, m = motion.layout.unknowns, motion.layout.constraints
        #: Shapes of mass, damping, stiffness, load, J, J' and J'' in a row of numbers.
        self.shapes = [(n, n), (n, n), (n, n), (n,), *[(m, n)] * (3 if m else 0)]
        self._size = sum(int(np.prod(shape)) for shape in self.shapes)
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
        self.times = times
        #: Of all points, values (points, numbers) and tangents (parameters, points, numbers).
        self.values = np.ascontiguousarray(rows[:, 0, : self._size].real)
        self.tangents = np.ascontiguousarray(np.moveaxis(rows[..., : self._size].imag / UNIT, 0, 1))
        self._weights_of_links = rows[..., self._size :]
        weights = (-1.0) ** np.arange(count + 1)
        weights[[0, -1]] /= 2
        self._weights = weights

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
        """Return matrices and weights of links with tangents along each parameter, (parameters, numbers)."""
        pose, layout = Pose(self.motion, self.parameters, t, self.equations), self.motion.layout
        matrices = []
        for j in range(len(self.parameters)):
            _, weights, at = pose.assembled(j, IN_MOTION)
            parts = [at.mass, at.damping, at.stiffness, at.load]
            if layout.constraints:
                joined = pose.of_motion(j)[2]
                for name in ("jacobian", "jacobian_rate", "jacobian_second_rate"):
                    bound = np.zeros((layout.constraints, layout.unknowns + 1), complex)
                    bound[:, layout.joint_places[:-1]] = joined[name].reshape(layout.constraints, -1)
                    parts.append(bound[:, :-1])
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
        rows: Dual = self.between(times) @ self._weights_of_links[:, j]
        return rows.reshape(len(times), -1, len(MOTION))

    def independent(self, times: Array) -> Indices:
        """Return the unknowns that steps of runs select as independent at rising times, (times, unknowns)."""
        status, chosen = self.equations.independent(times)
        self.motion.check(self.equations, status, self.equations.motion.t)
        return chosen

    def parted(self, rows: Array) -> list[Array]:
        """Return the matrices in rows of numbers (..., numbers)."""
        parts, begin = [], 0
        for shape in self.shapes:
            size = int(np.prod(shape))
            parts.append(rows[..., begin : begin + size].reshape(*rows.shape[:-1], *shape))
            begin += size
        return parts


def highest(terms: Array, least: Any = 0.0) -> float:
    """Return the largest of the highest of terms (terms, ...) over the largest term of each quantity.

    Quantities count as no smaller than ``least``.
    """
    last = np.max(terms[-math.ceil(_HIGHEST * len(terms)) :], axis=0)
    size = np.maximum(np.max(terms, axis=0), _LEAST * np.max(terms))
    return float(np.max(last / np.maximum(np.maximum(size, least), 1e-300)))


@dataclass(slots=True)
class Reduced:
    """Equations of independent unknowns p at some times: values and tangents of each matrix.

    ``basis`` has R, R' and R''; without constraints it is None.
    """

    mass: Array
    damping: Array
    stiffness: Array
    load: Array
    basis: list[Array] | None


def bases(bound: Sequence[Array], independent: Indices) -> list[Array]:
    """Return R, R' and R'' of S = R p by J, J' and J''; numbers may have tangents."""
    n = bound[0].shape[-1]
    others = np.setdiff1d(np.arange(n), independent)
    of, rate, second = bound
    solve = of[..., others]
    shape = (*of.shape[:-2], n, len(independent))
    basis = [np.zeros(shape, of.dtype) for _ in range(3)]
    basis[0][..., independent, np.arange(len(independent))] = 1.0
    basis[0][..., others, :] = -np.linalg.solve(solve, of[..., independent])
    basis[1][..., others, :] = -np.linalg.solve(solve, rate @ basis[0])
    basis[2][..., others, :] = -np.linalg.solve(solve, second @ basis[0] + 2 * rate @ basis[1])
    return basis


def reduced(parts: list[Array], independent: Indices) -> Reduced:
    """Return the equations of independent unknowns from M, C, K, Q and any J, J' and J''."""
    mass, damping, stiffness, load, *bound = parts
    if not bound:
        return Reduced(mass, damping, stiffness, load, None)
    basis = bases(bound, independent)
    value, rate, second = basis
    back = np.swapaxes(value, -1, -2)
    return Reduced(
        back @ mass @ value,
        back @ (damping @ value + 2 * mass @ rate),
        back @ (stiffness @ value + damping @ rate + mass @ second),
        (back @ load[..., None])[..., 0],
        basis,
    )
