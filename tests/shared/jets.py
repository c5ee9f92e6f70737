"""Values with their first and second time derivative, carried by Taylor arithmetic in extended doubles.

Shared by the independent models of loops. Arrays of any shape; vectors and matrices lie in the last axes.
"""

from __future__ import annotations

import numpy as np

Real = np.longdouble


class Jet:
    """A value, its rate and its second rate: three arrays of one shape."""

    __array_ufunc__ = None  # numpy leaves the operators to this class
    __slots__ = ("rate", "second", "value")

    def __init__(self, value, rate=0, second=0):
        parts = [np.asarray(x, dtype=Real) for x in (value, rate, second)]
        if not parts[0].shape == parts[1].shape == parts[2].shape:
            parts = np.broadcast_arrays(*parts)
        self.value, self.rate, self.second = parts

    @property
    def parts(self):
        return self.value, self.rate, self.second

    def __add__(self, other):
        other = jet(other)
        return Jet(*(a + b for a, b in zip(self.parts, other.parts, strict=True)))

    def __neg__(self):
        return Jet(*(-a for a in self.parts))

    def __sub__(self, other):
        return self + -jet(other)

    def __rsub__(self, other):
        return jet(other) + -self

    def _product(self, other, times):
        other = jet(other)
        (a, a1, a2), (b, b1, b2) = self.parts, other.parts
        return Jet(times(a, b), times(a1, b) + times(a, b1), times(a2, b) + 2 * times(a1, b1) + times(a, b2))

    def __mul__(self, other):
        return self._product(other, np.multiply)

    def __matmul__(self, other):
        return self._product(other, np.matmul)

    def dot(self, other):
        return self._product(other, dot)

    def cross(self, other):
        return self._product(other, cross)

    def __truediv__(self, other):
        return self * jet(other).apply(lambda x: (1 / x, -1 / x**2, 2 / x**3))

    def __rtruediv__(self, other):
        return jet(other) / self

    __radd__, __rmul__ = __add__, __mul__

    def apply(self, function):
        """Apply a function that gives its value, slope and curvature."""
        f, slope, curvature = function(self.value)
        return Jet(f, slope * self.rate, slope * self.second + curvature * self.rate**2)

    @property
    def transposed(self):
        return Jet(*(np.swapaxes(x, -1, -2) for x in self.parts))

    def __getitem__(self, where):
        return Jet(*(x[where] for x in self.parts))


def jet(x):
    return x if isinstance(x, Jet) else Jet(x)


def dot(a, b):
    return np.sum(a * b, axis=-1)


def cross(a, b):
    ax, ay, az, bx, by, bz = (x[..., i] for x in (a, b) for i in range(3))
    return stacked([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def sin(x):
    return jet(x).apply(lambda v: (np.sin(v), np.cos(v), -np.sin(v)))


def cos(x):
    return jet(x).apply(lambda v: (np.cos(v), -np.sin(v), -np.cos(v)))


def sqrt(x):
    return jet(x).apply(lambda v: (np.sqrt(v), 1 / (2 * np.sqrt(v)), -1 / (4 * v * np.sqrt(v))))


def atan2(y, x):
    """Angle of (x, y); its rate is (x y' - y x') / (x^2 + y^2)."""
    y, x = jet(y), jet(x)
    r2 = x.value**2 + y.value**2
    turn = x.value * y.rate - y.value * x.rate
    turn_rate = x.value * y.second - y.value * x.second
    r2_rate = 2 * (x.value * x.rate + y.value * y.rate)
    return Jet(np.arctan2(y.value, x.value), turn / r2, turn_rate / r2 - turn * r2_rate / r2**2)


def stacked(parts):
    """Stack arrays along a new last axis."""
    made = np.empty((*np.broadcast(*parts).shape, len(parts)), dtype=Real)
    for i, p in enumerate(parts):
        made[..., i] = p
    return made


def vector(x, y, z):
    parts = [jet(c).parts for c in (x, y, z)]
    return Jet(*(stacked(p) for p in zip(*parts, strict=True)))


def matrix(*columns):
    """Three vectors as the columns of a matrix."""
    parts = [c.parts for c in columns]
    return Jet(*(stacked(p) for p in zip(*parts, strict=True)))


def about_z(angle):
    c, s, zero = cos(angle), sin(angle), Jet(np.zeros_like(jet(angle).value))
    return matrix(vector(c, s, zero), vector(-s, c, zero), vector(zero, zero, zero + 1))


def about_y(angle):
    c, s, zero = cos(angle), sin(angle), Jet(np.zeros_like(jet(angle).value))
    return matrix(vector(c, zero, -s), vector(zero, zero + 1, zero), vector(s, zero, c))


def about_x(angle):
    c, s, zero = cos(angle), sin(angle), Jet(np.zeros_like(jet(angle).value))
    return matrix(vector(zero + 1, zero, zero), vector(zero, c, s), vector(zero, -s, c))


def angular_velocity(turn):
    """Angular velocity and acceleration of a rotation matrix, from R' R^T, in the frame it turns in."""
    r, r1, r2 = turn.parts
    back = np.swapaxes(r, -1, -2)
    return _axial(r1 @ back), _axial(r2 @ back)


def _axial(m):
    """Half of the skew part: the symmetric part of R'' R^T is not an acceleration."""
    return stacked(
        [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]]
    ) / Real(2)
