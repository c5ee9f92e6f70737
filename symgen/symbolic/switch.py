"""Functions with switching points, known to derivation and lowering: signs, and functions in pieces.

The piece i from knot i on is counted by the odd number 2 i + 1, so that zero means that none is chosen; with
a single knot these are 1 and -1, the branches of a sign. Derivatives are zero, also at switching points.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from hashlib import sha256
from typing import Any, ClassVar

import mpmath
import sympy as sp

#: A branch that asks a switching point for the piece at the state.
WHICH_PIECE = 2


class Sign(sp.Function):
    """1 above zero, -1 below, 0 at zero; its derivative is zero, also at the jump."""

    nargs = 1
    is_real = True
    is_commutative = True

    @classmethod
    def eval(cls, x: sp.Expr) -> sp.Expr | None:
        """Return the sign of a number, and extract a minus sign from the argument."""
        if x.is_number:
            return sp.sign(x)
        coefficient, rest = x.as_coeff_Mul()
        if coefficient.is_negative:
            return -cls(-x)
        return cls(rest) if coefficient != 1 and coefficient.is_positive else None

    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative away from the jump."""
        return sp.Integer(0)


def greatest(a: sp.Expr, b: sp.Expr) -> sp.Expr:
    """Return the greater of two expressions; its factors are exactly 0 and 1."""
    above = Sign(a - b)
    return a * (1 + above) / 2 + b * (1 - above) / 2


def least(a: sp.Expr, b: sp.Expr) -> sp.Expr:
    """Return the lesser of two expressions."""
    return -greatest(-a, -b)


def written(expression: sp.Expr, variable: str = "") -> str:
    """Return a jump nearly as it is written in a scene, with numbers to six digits.

    ``variable`` is the owner of the state that the scene calls ``this``.
    """
    for f in sorted(expression.atoms(PiecewisePolynomial), key=sp.default_sort_key):
        expression = expression.xreplace({f: sp.Symbol(f.pieces.of(written(f.args[0], variable)))})
    rounded = {x: sp.Float(x, 6) for x in expression.atoms(sp.Rational) if not x.is_Integer}
    text: str = sp.sstr(expression.xreplace(rounded))
    if variable:
        text = re.sub(rf"(?<![\w.]){re.escape(variable)}\.", "this.", text)
    return text.replace("Abs(", "abs(").replace("Sign(", "sign(")


@dataclass(frozen=True, slots=True)
class PieceNumbers:
    """Numbers of all pieces: the knots, of which a piece is found, or one number of each piece.

    With a ``period`` the pieces repeat, the number greater by ``step`` each time; without, the first piece
    lies before all knots. There are no pieces beyond the first and the last, for which kernels return the
    numbers of these, or of a ``bounded`` column what is not a number.
    """

    numbers: tuple[Fraction, ...]
    period: Fraction
    finds: bool = False
    step: Fraction = Fraction(0)
    bounded: bool = False

    def __call__(self, x: Fraction, branch: Fraction = Fraction(0)) -> Fraction:
        """Return the piece of an argument, or the branch if it is one; or the number of a piece."""
        if not self.finds:
            return self._entry(int(x))
        return branch if int(branch) % 2 else Fraction(self._piece(x))

    @property
    def digest(self) -> str:
        """A word for these numbers."""
        return sha256(repr(self).encode()).hexdigest()[:12]

    def _piece(self, x: Fraction) -> int:
        if not self.period:
            return 2 * bisect_right(self.numbers, x) - 1
        turns = math.floor((x - self.numbers[0]) / self.period)
        place = bisect_right(self.numbers, x - turns * self.period) - 1
        return 2 * (turns * len(self.numbers) + min(max(place, 0), len(self.numbers) - 1)) + 1

    def _entry(self, piece: int) -> Fraction:
        turns, place = divmod((piece - 1) // 2, len(self.numbers))
        if self.period:
            return self.numbers[place] + turns * self.step
        return self.numbers[min(max((piece + 1) // 2, 0), len(self.numbers) - 1)]


class PieceFunction(sp.Function):
    """A function that is constant on every piece; one class for each name and ``column``."""

    column: ClassVar[PieceNumbers]
    is_real = True
    is_commutative = True

    @classmethod
    def eval(cls, *arguments: sp.Expr) -> sp.Expr | None:
        """Return the value at numbers."""
        if not all(x.is_number for x in arguments):
            return None
        return sp.Rational(cls.column(*(Fraction(int(x.p), int(x.q)) for x in map(_exact, arguments))))

    def _eval_derivative(self, s: sp.Symbol) -> sp.Expr:
        return sp.S.Zero

    def __reduce_ex__(self, protocol: object) -> tuple[Any, ...]:
        return _piece_function_of, (type(self).__name__, self.column, self.args)


class PiecewisePolynomial(sp.Function):
    """A derivative of :class:`Pieces` at an argument, on the piece of a branch unless this is zero."""

    pieces: ClassVar[Pieces]
    order: ClassVar[int]
    nargs = 2
    is_real = True
    is_commutative = True

    @classmethod
    def eval(cls, x: sp.Expr, branch: sp.Expr) -> sp.Expr | None:
        """Return the value at numbers."""
        return (
            cls.pieces.on_piece(x, cls.pieces.piece(x, branch), cls.order)
            if x.is_number and branch.is_number
            else None
        )

    @property
    def in_terms(self) -> sp.Expr:
        """The polynomial, with the coefficients of its piece."""
        x, branch = self.args
        return self.pieces.on_piece(x, self.pieces.piece(x, branch), self.order)

    def _eval_derivative(self, s: sp.Symbol) -> sp.Expr:
        x, branch = self.args
        return self.pieces.derivative(self.order + 1, x, branch) * x.diff(s)

    def __reduce_ex__(self, protocol: object) -> tuple[Any, ...]:
        return _derivative_of, (self.pieces, self.order, *self.args)


def as_fraction(x: mpmath.mpf) -> Fraction:
    """Return a number of mpmath exactly."""
    sign, mantissa, exponent, _ = x._mpf_
    return (-1) ** sign * int(mantissa) * Fraction(2) ** exponent


def _exact(x: sp.Expr) -> sp.Rational:
    return x if x.is_Rational else sp.Rational(str(x.n(40)))


@cache
def _piece_function(name: str, column: PieceNumbers) -> type[PieceFunction]:
    by_numbers = staticmethod(lambda *x: float(column(*map(Fraction, x))))  # for sympy.lambdify
    content = {"column": column, "nargs": 2 if column.finds else 1, "_imp_": by_numbers}
    return type(name, (PieceFunction,), content)


def _piece_function_of(name: str, column: PieceNumbers, arguments: tuple[sp.Expr, ...]) -> sp.Expr:
    return _piece_function(name, column)(*arguments)


@cache
def _polynomial(of: Pieces, order: int) -> type[PiecewisePolynomial]:
    by_numbers = staticmethod(lambda x, b: float(of.derivative(order, *map(sp.Rational, (x, b)))))
    content = {"pieces": of, "order": order, "_imp_": by_numbers}
    return type(of.name + "_rate" * order, (PiecewisePolynomial,), content)


def _derivative_of(of: Pieces, order: int, x: sp.Expr, branch: sp.Expr) -> sp.Expr:
    return of.derivative(order, x, branch)


@dataclass(frozen=True, slots=True)
class Pieces:
    """A function whose pieces are polynomials: between knots, before the first and behind the last.

    Parameters
    ----------
    name
        Its name.
    knots
        Where pieces begin, in rising order.
    coefficients
        Of each piece those of 1, s, s^2, ..., with s the distance from the knot where the piece begins, on
        the first piece without period from the first knot.
    period
        Period; 0 for a function that does not repeat.
    smooth
        Number of derivatives that are continuous at the knots; -1 if the value jumps.
    form
        How a scene writes it, with {} for the argument; by default by its name.
    """

    name: str
    knots: tuple[Fraction, ...]
    coefficients: tuple[tuple[Fraction, ...], ...]
    period: Fraction = Fraction(0)
    smooth: int = 0
    form: str = ""

    def of(self, x: str) -> str:
        """Return the function of an argument as a scene writes it."""
        return (self.form or f"{self.name}({{}})").format(x)

    def at(self, x: sp.Expr) -> sp.Expr:
        """Return the function at an argument, on the piece of the argument."""
        return self.derivative(0, x, sp.S.Zero)

    def derivative(self, order: int, x: sp.Expr, branch: sp.Expr) -> sp.Expr:
        """Return a derivative by the argument, on the piece ``branch`` unless this is zero."""
        last = {row[order:] for row in self.coefficients}
        if len(last) == 1 and len(*last) < 2:  # equal on all pieces
            return sp.Rational(sum(*last) * math.factorial(order))
        return _polynomial(self, order)(x, branch)

    def piece(self, x: sp.Expr, branch: sp.Expr) -> sp.Expr:
        """Return the piece of an argument, or ``branch`` if this is one."""
        numbers = PieceNumbers(self.knots, self.period, finds=True)
        return _piece_function("piece", numbers)(x, branch)

    def on_piece(self, x: sp.Expr, piece: sp.Expr, order: int = 0) -> sp.Expr:
        """Return a derivative by the argument as a polynomial with the coefficients of a piece."""
        columns = list(zip(*self.coefficients, strict=True))[order:]
        powers = [
            self._entry(f"{k + order}", piece, column) * math.perm(k + order, order)
            for k, column in enumerate(columns)
        ]
        return _horner(powers, self._along(x, piece))

    def gap(self, x: sp.Expr, branch: sp.Expr) -> sp.Expr:
        """Return a switching expression: it changes its sign at every knot, with slope 1 or -1 by x.

        On the piece ``branch`` it is a polynomial of second degree with zeros at both ends. If the branch is
        ``WHICH_PIECE``, it is the number of the piece.
        """
        piece = self.piece(x, branch)
        first, second = zip(*self._distances(), strict=True)
        slope = PieceNumbers(tuple(first), self.period, bounded=not self.period)
        slope_of = _piece_function(f"{self.name}_slope", slope)
        gap = _horner([sp.S.Zero, slope_of(piece), self._entry("bend", piece, second)], self._along(x, piece))
        held = Sign(branch - WHICH_PIECE) ** 2
        return held * gap + (1 - held) * piece  # exactly one of these: a rounded piece is another one

    def _along(self, x: sp.Expr, piece: sp.Expr) -> sp.Expr:
        knots = self.knots if self.period else (self.knots[0], *self.knots)
        return x - self._entry("knot", piece, knots, self.period)

    def _entry(
        self, name: str, piece: sp.Expr, numbers: Sequence[Fraction], step: Fraction = Fraction(0)
    ) -> sp.Expr:
        if not step and len(set(numbers)) == 1:
            return sp.Rational(numbers[0])
        return _piece_function(f"{self.name}_{name}", PieceNumbers(tuple(numbers), self.period, step=step))(
            piece
        )

    def _distances(self) -> list[tuple[Fraction, Fraction]]:
        """Return for every piece the coefficients of s and s^2, with alternating signs."""
        ends = [*self.knots[1:], *([self.knots[0] + self.period] if self.period else [])]
        inner = [(Fraction(1), 1 / (a - b)) for a, b in zip(self.knots, ends, strict=False)]
        outer = Fraction(-1), Fraction(0)
        rows = inner if self.period else [outer, *inner, (Fraction(1), Fraction(0))]
        odd = 0 if self.period else 1
        return [(a, b) if (i + odd) % 2 == 0 else (-a, -b) for i, (a, b) in enumerate(rows)]


def _horner(coefficients: Sequence[sp.Expr], s: sp.Expr) -> sp.Expr:
    value = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        value = c + s * value
    return value


def modulo(x: sp.Expr, period: sp.Expr) -> sp.Expr:
    """Return what is left of x less whole periods, from 0 to below the period, which is a number."""
    length = Fraction(int(_exact(period).p), int(_exact(period).q))
    one = Fraction(0), Fraction(1)
    form = f"mod({{}}, {float(length):.6g})"
    return Pieces("mod", (Fraction(0), length), (one, one), 2 * length, -1, form).at(x)
