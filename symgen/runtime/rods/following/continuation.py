"""The solution curve of Phi(q, t) = 0 by pseudo-arc-length continuation, with its singular points.

A *limit point*, a turning point of the curve in t, is a dead centre: dPhi/dq loses rank and
[dPhi/dq dPhi/dt] keeps it. Where [dPhi/dq dPhi/dt] loses rank too, branches cross: a *bifurcation*.

Source: E. L. Allgower and K. Georg, *Introduction to Numerical Continuation Methods*, chapters 2 and 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.newton import corrected


class ImplicitCurve(Protocol):
    """Phi(q, t) = 0 in metres, with its derivatives by q and by t."""

    def residual(self, q: Array, t: float) -> Array:
        """Return Phi [m], shape (m,)."""

    def jacobian(self, q: Array, t: float) -> Array:
        """Return dPhi/dq [1], shape (m, n)."""

    def drift(self, q: Array, t: float) -> Array:
        """Return dPhi/dt at fixed q [m/s], shape (m,)."""


Held = TypeVar("Held", bound=ImplicitCurve)

_EPS = float(np.finfo(float).eps)
#: Rank tolerance of singular values.
_RANK = 1e-7
#: Most iterations of Newton's method.
_ITERATIONS = 11
#: Most halvings of an interval in search of a time.
_HALVINGS = 40
#: Largest angle between the tangents at both ends of a step [rad].
_TURN = 0.15
#: Longest step, over the size of the linkage.
LONGEST = 0.25
#: First step, over the size of the linkage.
_FIRST_STEP = 0.02
#: Largest factor by which the determinant of the slope changes in a step.
_CHANGE = 4.0
#: Soundness below which branches count as crossing.
_CROSSED = 10 * _RANK
#: Least step there, from one side to the other, over the size of the linkage.
_ACROSS = 1e-4


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """A point of the curve: x = (q/length, t/duration), unit tangent, and the least singular value there."""

    x: Array
    tangent: Array
    soundness: float

    @property
    def speed(self) -> float:
        """Component of the tangent along t."""
        return float(self.tangent[-1])


class Curve(Generic[Held]):
    """Phi(q, t) = 0 over the dimensionless x = (q/length, t/duration)."""

    def __init__(self, constraints: Held, length: float, duration: float) -> None:
        self.constraints, self.length, self.duration = constraints, length, duration

    def split(self, x: Array) -> tuple[Array, float]:
        """Return q [m] and t [s]."""
        return x[:-1] * self.length, float(x[-1] * self.duration)

    def join(self, q: Array, t: float) -> Array:
        """Return x."""
        return np.append(q / self.length, t / self.duration)

    def residual(self, x: Array) -> Array:
        """Return Phi over scale and length."""
        return self.constraints.residual(*self.split(x)) / self.length

    def slope(self, x: Array) -> Array:
        """Return its derivative by x, shape (m, n + 1)."""
        q, t = self.split(x)
        by_time = self.constraints.drift(q, t) * (self.duration / self.length)
        return np.column_stack([self.constraints.jacobian(q, t), by_time])

    def point(self, x: Array, like: Array | None = None) -> CurvePoint:
        """Return the point at x with its tangent: on the side of ``like``, or towards growing t."""
        n = len(x) - 1
        values, right = np.linalg.svd(self.slope(x))[1:]
        rank = int(np.count_nonzero(values[:n] > _RANK * values[0]))
        like = np.append(np.zeros(n), 1.0) if like is None else like
        kernel = right[rank:]
        if rank < n:  # branches cross here: keep the direction as far as possible
            kernel = (kernel @ like)[None, :] @ kernel
        tangent = kernel[0] / np.linalg.norm(kernel[0])
        return CurvePoint(x, tangent if tangent @ like >= 0 else -tangent, float(values[n - 1] / values[0]))

    def corrected(self, x: Array, normal: Array) -> Array | None:
        """Return the point of the curve in the plane through x with this normal; None where Newton fails."""
        start = x

        def change(x: Array, left: Array) -> Array:
            matrix, rhs = np.vstack([self.slope(x), normal]), np.append(-left, -normal @ (x - start))
            return np.asarray(np.linalg.lstsq(matrix, rhs, rcond=1e-13)[0])

        return corrected(x, change, _size, _ITERATIONS, residual=self.residual, falls=0.5)

    def at(self, x: Array) -> Array | None:
        """Return the point of the curve near x at its very time; None where Newton's method fails."""
        corrected = self.corrected(x, np.append(np.zeros(len(x) - 1), 1.0))
        if corrected is not None:
            corrected[-1] = x[-1]  # a step of least squares moves the time by its rounding
        return corrected

    def between(self, a: CurvePoint, b: CurvePoint, part: float) -> CurvePoint | None:
        """Return the point of the curve at a fraction between a and b, predicted by Hermite's cubic."""
        x, along = hermite(a, b, part)
        corrected = self.corrected(x, along / np.linalg.norm(along))
        return None if corrected is None else self.point(corrected, along)

    def at_time(self, a: CurvePoint, b: CurvePoint, t: float) -> CurvePoint | None:
        """Return the point at the time t between a and b, along which t is monotone."""
        from scipy.optimize import brentq

        target = t / self.duration
        for _ in range(_HALVINGS):
            gap = float(np.linalg.norm(b.x - a.x))
            ends = a.x[-1] - target, b.x[-1] - target
            if ends[0] == 0.0 or ends[1] == 0.0 or gap <= 4 * _EPS:
                return a if abs(ends[0]) <= abs(ends[1]) else b
            slopes = float(gap * a.tangent[-1]), float(gap * b.tangent[-1])
            part = brentq(_cubic, 0.0, 1.0, (float(ends[0]), float(ends[1]), *slopes), xtol=1e-15)
            x, along = hermite(a, b, part)
            x[-1] = target
            point = self.at(x)
            if point is not None and np.linalg.norm(point - x) <= 0.01 * gap:
                return self.point(point, along)
            middle = self.between(a, b, 0.5)
            if middle is None:
                return None
            a, b = (middle, b) if (middle.x[-1] - target) * ends[0] > 0 else (a, middle)
        return None

    def walk(
        self, start: CurvePoint, ends: tuple[float, float], through: bool, most: int
    ) -> list[CurvePoint]:
        """Follow the curve until t leaves ``ends``; unless ``through``, no farther than a dead centre.

        Dead centres are points of the list. It ends two points beyond ``ends``, so that singular points there
        are bracketed. It ends early where no further point was found, or, with ``through``,
        where the curve is back at its start.
        """
        points, step, outside = [start], _FIRST_STEP, 0
        low, high = (e / self.duration for e in ends)
        longest = max(high - low, 1e-12) / 64
        while len(points) < most:
            last = points[-1]
            step = min(step, LONGEST, longest / max(abs(last.speed), 1e-3))
            if last.soundness < _CROSSED:
                step = max(step, _ACROSS)
            new = self._step(last, step)
            if new is None:
                step /= 2
                if step < 1e-9:
                    return points
                continue
            if last.speed * new.speed < 0:
                points.append(self.fold(last, new))
                if not through:
                    return points
            points.append(new)
            outside = outside + 1 if not low <= new.x[-1] <= high else 0
            if outside > 2:
                return points
            if (
                len(points) > 8
                and np.linalg.norm(new.x - start.x) < 2 * step
                and new.tangent @ start.tangent > 0.9
            ):
                points.append(start)
                return points
            step *= 1.5 if new.tangent @ last.tangent > np.cos(_TURN / 2) else 1.0
        return points

    def _step(self, last: CurvePoint, step: float) -> CurvePoint | None:
        corrected = self.corrected(last.x + step * last.tangent, last.tangent)
        if corrected is None:
            return None
        new = self.point(corrected, last.tangent)
        if new.tangent @ last.tangent < np.cos(_TURN):
            return None
        return new if last.soundness < _CROSSED or self._same_branch(last.x, new.x) else None

    def _same_branch(self, x: Array, to: Array) -> bool:
        """Return whether the slope stays regular from one point to another, across the tangent of the first.

        Its determinant changes little up to the second point, and halfway. Between two branches the slope is
        singular halfway, exactly so where Phi is quadratic.
        """
        n = len(x) - 1
        left, values, right = np.linalg.svd(self.slope(x))
        change = left[:, :n].T @ self.slope(to) @ (right[:n].T / values[:n])
        end, middle = np.linalg.det(change), np.linalg.det((np.eye(n) + change) / 2)
        return bool(1 / _CHANGE <= end <= _CHANGE and middle >= min(1.0, end) / 2)

    def fold(self, a: CurvePoint, b: CurvePoint) -> CurvePoint:
        """Return the limit point between a and b, where the tangent's t-component changes its sign."""
        for k in range(100):
            part = a.speed / (a.speed - b.speed) if k % 3 < 2 else 0.5
            middle = self.between(a, b, min(max(part, 1e-3), 1 - 1e-3) if k else 0.5)
            if middle is None or np.linalg.norm(b.x - a.x) <= 8 * _EPS:
                break
            if middle.speed == 0.0:
                return middle
            a, b = (middle, b) if middle.speed * a.speed > 0 else (a, middle)
        return a if abs(a.speed) < abs(b.speed) else b

    def crossings(self, points: list[CurvePoint]) -> list[CurvePoint]:
        """Return the bifurcations along the curve: where the least singular value of its slope vanishes."""
        crossings_of_path: list[CurvePoint] = []
        for a, b, c in zip(points, points[1:], points[2:], strict=False):
            if b.soundness <= a.soundness and b.soundness < c.soundness:
                lowest = self._lowest(a, b, c)
                near = any(np.linalg.norm(lowest.x - p.x) < 1e-5 for p in crossings_of_path)
                if lowest.soundness < 10 * _RANK and not near:
                    crossings_of_path.append(lowest)
        return [p for p in crossings_of_path if p.soundness < 10 * _RANK]

    def _lowest(self, a: CurvePoint, b: CurvePoint, c: CurvePoint) -> CurvePoint:
        def gap(p: CurvePoint, q: CurvePoint) -> float:
            return max(float(np.linalg.norm(p.x - q.x)), _EPS)

        steepest = 3 * max(
            abs(a.soundness - b.soundness) / gap(a, b), abs(c.soundness - b.soundness) / gap(b, c)
        )
        for _ in range(120):
            width = gap(a, c)
            if b.soundness < _RANK / 10 or b.soundness > steepest * width or width < 1e-9:
                break
            left = gap(a, b) > gap(b, c)
            new = self.between(a, b, 0.618) if left else self.between(b, c, 0.382)
            if new is None:
                break
            if new.soundness < b.soundness:
                a, b, c = (a, new, b) if left else (b, new, c)
            else:
                a, b, c = (new, b, c) if left else (a, b, new)
        return b


def _size(x: Array) -> float:
    """Return the size of coordinates of the curve, at least that of the linkage."""
    return max(1.0, float(np.max(np.abs(x))))


def _cubic(w: float, start: float, end: float, first: float, last: float) -> float:
    """Return Hermite's cubic through two values with two slopes."""
    v = 1 - w
    return v * v * ((1 + 2 * w) * start + w * first) + w * w * ((3 - 2 * w) * end - v * last)


def hermite(a: CurvePoint, b: CurvePoint, part: float) -> tuple[Array, Array]:
    """Return place and direction at a part of Hermite's cubic between two points."""
    w, chord = part, float(np.linalg.norm(b.x - a.x))
    x = (
        (1 + 2 * w) * (1 - w) ** 2 * a.x
        + w**2 * (3 - 2 * w) * b.x
        + chord * (w * (1 - w) ** 2 * a.tangent - w**2 * (1 - w) * b.tangent)
    )
    along = 6 * w * (1 - w) * (b.x - a.x) + chord * (
        (1 - w) * (1 - 3 * w) * a.tangent + w * (3 * w - 2) * b.tangent
    )
    return x, along
