"""Dual numbers a + eps b with eps^2 = 0, dual vectors and dual 3x3 matrices, over SymPy.

A dual angle theta + eps S is a rotation about a line and a translation along it. A dual vector is a screw, or
a force with its moment: the real part belongs to the line, the dual part is taken about the origin. An
orthogonal dual matrix R + eps D moves a frame: R rotates it, D R^T is the cross-product matrix of its
translation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import sympy as sp

from symgen.symbolic.vectors import cross, dot

Triple = tuple[sp.Expr, sp.Expr, sp.Expr]

_ZERO, _ONE = sp.Integer(0), sp.Integer(1)


def skew(a: Sequence[sp.Expr]) -> sp.ImmutableMatrix:
    """Return the matrix of the cross product with a: skew(a) b = a x b."""
    x, y, z = a
    return sp.ImmutableMatrix([[_ZERO, -z, y], [z, _ZERO, -x], [-y, x, _ZERO]])


def vee(matrix: sp.MatrixBase) -> Triple:
    """Return the vector of the skew part of a 3x3 matrix: vee(skew(a)) = a."""
    half = sp.Rational(1, 2)
    return tuple(half * (matrix[i, j] - matrix[j, i]) for i, j in ((2, 1), (0, 2), (1, 0)))


def rows_of(matrix: sp.ImmutableMatrix) -> tuple[Triple, Triple, Triple]:
    """Return the rows of a 3x3 matrix."""
    entries = matrix.args[2].args
    return entries[:3], entries[3:6], entries[6:]


def beside(columns: Sequence[Triple]) -> sp.ImmutableMatrix:
    """Return the 3x3 matrix of columns."""
    return sp.ImmutableMatrix(3, 3, [x for row in zip(*columns, strict=True) for x in row])


def product(matrix: sp.ImmutableMatrix, vector: Sequence[sp.Expr]) -> Triple:
    """Return the product of a 3x3 matrix with a vector: SymPy's own takes forty times as long."""
    x, y, z = (dot(row, vector) for row in rows_of(matrix))
    return x, y, z


@dataclass(frozen=True, slots=True)
class Dual:
    """A dual number real + eps dual."""

    real: sp.Expr
    dual: sp.Expr = _ZERO

    def __add__(self, other: Dual | sp.Expr) -> Dual:
        other = _number(other)
        return Dual(self.real + other.real, self.dual + other.dual)

    def __neg__(self) -> Dual:
        return Dual(-self.real, -self.dual)

    def __sub__(self, other: Dual | sp.Expr) -> Dual:
        return self + -_number(other)

    def __mul__(self, other: Dual | sp.Expr) -> Dual:
        other = _number(other)
        return Dual(self.real * other.real, self.real * other.dual + self.dual * other.real)

    __radd__, __rmul__ = __add__, __mul__

    def map(self, function: Callable[[sp.Expr], sp.Expr]) -> Dual:
        """Return f(a + eps b) = f(a) + eps b f'(a) for a real function f."""
        argument = sp.Dummy(real=True)
        slope = sp.diff(function(argument), argument)
        return Dual(function(self.real), self.dual * slope.xreplace({argument: self.real}))


def _number(value: Dual | sp.Expr | int) -> Dual:
    return value if isinstance(value, Dual) else Dual(sp.sympify(value))


@dataclass(frozen=True, slots=True)
class DualVector:
    """A dual vector: real part, and dual part about the origin."""

    real: Triple
    dual: Triple

    def __add__(self, other: DualVector) -> DualVector:
        return DualVector(_plus(self.real, other.real), _plus(self.dual, other.dual))

    def __neg__(self) -> DualVector:
        return self * sp.Integer(-1)

    def __sub__(self, other: DualVector) -> DualVector:
        return self + -other

    def __mul__(self, factor: Dual | sp.Expr) -> DualVector:
        """Return the product with a real or dual number."""
        if isinstance(factor, Dual):
            shifted = tuple(factor.dual * x for x in self.real)
            plain = tuple(factor.real * x for x in self.dual)
            return DualVector(tuple(factor.real * x for x in self.real), _plus(plain, shifted))
        return DualVector(tuple(factor * x for x in self.real), tuple(factor * x for x in self.dual))

    def cross(self, other: DualVector) -> DualVector:
        """Return the dual cross product: of two screws their bracket (w x w'; w x v' + v x w')."""
        return DualVector(
            cross(self.real, other.real), _plus(cross(self.real, other.dual), cross(self.dual, other.real))
        )

    def dot(self, other: DualVector) -> Dual:
        """Return the dual scalar product. Its dual part is the reciprocal product, force.v + moment.w."""
        return Dual(dot(self.real, other.real), dot(self.real, other.dual) + dot(self.dual, other.real))

    @property
    def column(self) -> sp.ImmutableMatrix:
        """The six components, real part first."""
        return sp.ImmutableMatrix(6, 1, [*self.real, *self.dual])


def _plus(a: Triple, b: Triple) -> Triple:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@dataclass(frozen=True)
class DualMatrix:
    """A 3x3 matrix real + eps dual."""

    real: sp.ImmutableMatrix
    dual: sp.ImmutableMatrix

    def __add__(self, other: DualMatrix) -> DualMatrix:
        return DualMatrix(self.real + other.real, self.dual + other.dual)

    def __matmul__(self, other: DualMatrix) -> DualMatrix:
        parts = zip(rows_of(other.T.real), rows_of(other.T.dual), strict=True)
        columns = [self.times(DualVector(real, dual)) for real, dual in parts]
        return DualMatrix(beside([c.real for c in columns]), beside([c.dual for c in columns]))

    def times(self, vector: DualVector) -> DualVector:
        """Return the product with a dual vector."""
        rows = zip(rows_of(self.real), rows_of(self.dual), strict=True)
        x, y, z = (dot((*turn, *shift), (*vector.dual, *vector.real)) for turn, shift in rows)
        return DualVector(product(self.real, vector.real), (x, y, z))

    @cached_property
    def T(self) -> DualMatrix:
        """Transpose: the inverse of an orthogonal matrix."""
        return DualMatrix(beside(rows_of(self.real)), beside(rows_of(self.dual)))

    @property
    def shift(self) -> Triple:
        """Translation of the origin by an orthogonal matrix."""
        return vee(self.dual * self.real.T)

    @property
    def beside(self) -> sp.ImmutableMatrix:
        """Both parts next to each other: 3x6."""
        return sp.ImmutableMatrix(self.real.row_join(self.dual))


def identity() -> DualMatrix:
    """Return the dual identity."""
    return DualMatrix(sp.ImmutableMatrix(sp.eye(3)), sp.ImmutableMatrix(sp.zeros(3)))


def operator(vector: DualVector) -> DualMatrix:
    """Return the matrix of the dual cross product with a vector."""
    return DualMatrix(skew(vector.real), skew(vector.dual))


@lru_cache(maxsize=512)
def rotation(axis: int, angle: Dual) -> DualMatrix:
    """Return the rotation about a coordinate axis (0, 1 or 2) by a dual angle, and the translation along it.

    The matrices X, Y and Z of section 1 of the method, in right-handed sense.
    """
    c, s = angle.map(sp.cos), angle.map(sp.sin)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    real, dual = sp.zeros(3), sp.zeros(3)
    real[axis, axis] = _ONE
    for row, column, entry in ((j, j, c), (j, k, -s), (k, j, s), (k, k, c)):
        real[row, column], dual[row, column] = entry.real, entry.dual
    return DualMatrix(sp.ImmutableMatrix(real), sp.ImmutableMatrix(dual))


def X(angle: Dual) -> DualMatrix:
    """Return the rotation about i by a dual angle."""
    return rotation(0, angle)


def Y(angle: Dual) -> DualMatrix:
    """Return the rotation about j by a dual angle."""
    return rotation(1, angle)


def Z(angle: Dual) -> DualMatrix:
    """Return the rotation about k by a dual angle."""
    return rotation(2, angle)
