"""Numerical constants of expressions: substituted, enclosed by intervals, rounded once, zero if they vanish.

SymPy evaluates a vanishing sum to noise of one significant bit, and arithmetic with such a number reduces
other numbers to one bit too. Here every part of a number is enclosed by an interval, with as many bits as
its result needs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from functools import lru_cache
from typing import Any, TypeVar

import mpmath
import sympy as sp
from mpmath.ctx_iv import MPIntervalContext

#: Bits beyond the requested ones for the comparison of a number with zero (300 digits), and for rounding.
_DECIDED, _GUARD = 1000, 30
_BITS_PER_DIGIT = 3.33

#: Pi as the units of scenes have it, which every angle in degrees and every speed in rpm holds as a factor.
PI = Fraction(str(sp.pi.n(63)))
#: Largest denominator of a multiple of pi: far more than anybody writes, far less than the digits of pi give.
_FINEST = 10**20

Expression = TypeVar("Expression", sp.Expr, sp.MatrixBase, sp.Basic)

_intervals: Any = MPIntervalContext()


class _NoEnclosureError(Exception):
    """A function without enclosure here."""


class _NotFiniteError(ArithmeticError):
    """A number that is not real or not finite."""


def with_pi(expression: Expression) -> Expression:
    """Return an expression with the numbers that were written in degrees or turns as multiples of pi.

    The cosine of a right angle is zero then, and its factors are omitted.
    """
    multiples = {}
    for number in expression.atoms(sp.Rational):
        share = Fraction(int(number.p), int(number.q)) / PI
        if share and share.denominator < _FINEST:
            multiples[number] = sp.Rational(share.numerator, share.denominator) * sp.pi
    return expression.xreplace(multiples)


def rounded(expression: sp.Expr, digits: int) -> sp.Expr:
    """Return a number: unchanged if rational, otherwise rounded to the given number of digits.

    It is the integer zero if its enclosure to 300 further digits contains zero, and nan if it is not real
    or not finite. Functions beyond those of scenes and kernels are evaluated by SymPy, without a bound.
    """
    if expression.is_Rational:
        return expression
    try:
        value = _narrow(expression, int(_BITS_PER_DIGIT * digits) + _GUARD)
    except (ArithmeticError, mpmath.libmp.ComplexResult):
        return sp.nan
    except _NoEnclosureError:
        return expression.evalf(digits)
    return sp.Integer(0) if value is None else sp.Float(value, digits)


def vanishes(expression: sp.Expr) -> bool:
    """Return whether a number is zero, to 300 digits of its largest term."""
    return bool(rounded(expression, 1) == 0)


def _narrow(expression: sp.Expr, bits: int) -> mpmath.mpf | None:
    """Return the midpoint of an enclosure of this relative width; None if the number vanishes."""
    more = bits
    while True:
        interval = _enclosure(expression, more)
        low, high = (mpmath.make_mpf(end) for end in interval._mpi_)
        if low > 0 or high < 0:
            with mpmath.workprec(more + _GUARD):
                if high - low <= mpmath.ldexp(min(abs(low), abs(high)), -bits):
                    return (low + high) / 2
        elif low == high == 0 or (more >= bits + _DECIDED and mpmath.isfinite(high - low)):
            return None
        if more > 8 * (bits + _DECIDED):
            raise _NotFiniteError
        more *= 2


@contextmanager
def _precision(bits: int) -> Iterator[None]:
    before = _intervals.prec
    _intervals.prec = bits
    try:
        yield
    finally:
        _intervals.prec = before


@lru_cache(maxsize=1 << 14)
def _enclosure(expression: sp.Expr, bits: int) -> Any:
    """Return an interval that contains the number, computed with the given number of bits."""
    if expression.is_Mul and sp.I in expression.args:
        return _enclosure(_real(expression), bits)
    if expression.is_Add or expression.is_Mul:
        parts = [_enclosure(part, bits) for part in expression.args]
        with _precision(bits):
            total = parts[0]
            for part in parts[1:]:
                total = total + part if expression.is_Add else total * part
            return total
    of_kind = _FUNCTIONS.get(expression.func)
    if of_kind is not None:
        return of_kind(bits, *expression.args)
    with _precision(bits):
        if expression.is_Rational:
            return _intervals.mpf(int(expression.p)) / int(expression.q)
        if expression.is_Float and expression.is_finite:
            return _intervals.make_mpf((expression._mpf_, expression._mpf_))
        if expression.is_NumberSymbol:
            near = mpmath.make_mpf(expression._as_mpf_val(bits + _GUARD))
            return _intervals.mpf(near) * (1 + _intervals.mpf([-1, 1]) * _intervals.ldexp(1, -bits))
    if expression.is_number and not expression.args and expression is not sp.I:
        raise _NotFiniteError
    raise _NoEnclosureError


class _Direction(sp.Function):
    """The angle atan2(y, x), which SymPy does not rewrite."""

    is_number = True


def _real(product: sp.Expr) -> sp.Expr:
    """Return c I log(x + I y) as -c atan2(y, x): SymPy's form of atan2 of two numbers, |x + I y| = 1."""
    logarithms = [f for f in product.args if isinstance(f, sp.log)]
    others = [f for f in product.args if f is not sp.I and not isinstance(f, sp.log)]
    if len(logarithms) != 1 or any(f.has(sp.I) for f in others):
        raise _NoEnclosureError
    point = [f for f in sp.Mul.make_args(logarithms[0].args[0]) if f.has(sp.I)]
    if len(point) != 1:
        raise _NoEnclosureError
    terms = sp.Add.make_args(point[0])
    along = sp.Add(*(term for term in terms if not term.has(sp.I)))
    across = sp.Add(*(term / sp.I for term in terms if term.has(sp.I)))
    if across.has(sp.I):
        raise _NoEnclosureError
    return sp.Mul(-1, *others, _Direction(across, along))


def _decided(expression: sp.Expr, bits: int) -> tuple[Any, int]:
    """Return an enclosure that contains zero only if the number vanishes, and the sign of the number."""
    more = bits
    while True:
        interval = _enclosure(expression, more)
        if interval.a > 0:
            return interval, 1
        if interval.b < 0:
            return interval, -1
        if more >= bits + _DECIDED or interval.a == interval.b == 0:
            return _intervals.mpf(0), 0
        more += _DECIDED // 2


def _power(bits: int, base: sp.Expr, exponent: sp.Expr) -> Any:
    value, sign = _decided(base, bits)
    if sign == 0:
        if exponent.is_positive:
            return value
        raise _NotFiniteError
    with _precision(bits):
        if exponent.is_Integer:
            return value ** int(exponent)
        if sign < 0:
            raise _NotFiniteError
        if exponent.is_Rational and exponent.q == 2:
            return _intervals.sqrt(value) ** int(exponent.p)
    by = _enclosure(exponent, bits)
    with _precision(bits):
        return _intervals.exp(by * _intervals.log(value))


def _log(bits: int, argument: sp.Expr) -> Any:
    value, sign = _decided(argument, bits)
    if sign <= 0:
        raise _NotFiniteError
    with _precision(bits):
        return _intervals.log(value)


def _direction(bits: int, across: sp.Expr, along: sp.Expr) -> Any:
    """Return atan2, with the signs of its arguments decided, which select the side of the branch cut."""
    (y, y_sign), (x, x_sign) = _decided(across, bits), _decided(along, bits)
    if x_sign == y_sign == 0:
        raise _NotFiniteError
    with _precision(bits):
        return _intervals.atan2(y, x)


def _third_side(bits: int, argument: sp.Expr) -> Any:
    """Return sqrt(1 - x^2)."""
    squared, sign = _decided(1 - argument**2, bits)
    if sign < 0:
        raise _NotFiniteError
    with _precision(bits):
        return _intervals.sqrt(squared)


def _inverse_sine(bits: int, argument: sp.Expr, *, cosine: bool = False) -> Any:
    parts = [_decided(argument, bits)[0], _third_side(bits, argument)]
    with _precision(bits):
        return _intervals.atan2(*(parts[::-1] if cosine else parts))


def _sign(bits: int, argument: sp.Expr) -> Any:
    return _intervals.mpf(_decided(argument, bits)[1])


def _of(function: Callable[[Any], Any]) -> Callable[[int, sp.Expr], Any]:
    def enclosed(bits: int, argument: sp.Expr) -> Any:
        value = _enclosure(argument, bits)
        with _precision(bits):
            return function(value)

    return enclosed


def _hyperbolic(sign: int) -> Callable[[Any], Any]:
    return lambda x: (_intervals.exp(x) + sign * _intervals.exp(-x)) / 2


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    sp.Pow: _power,
    sp.log: _log,
    sp.atan2: _direction,
    _Direction: _direction,
    sp.atan: lambda bits, x: _direction(bits, x, sp.Integer(1)),
    sp.asin: _inverse_sine,
    sp.acos: lambda bits, x: _inverse_sine(bits, x, cosine=True),
    sp.sign: _sign,
    sp.sin: _of(_intervals.sin),
    sp.cos: _of(_intervals.cos),
    sp.exp: _of(_intervals.exp),
    sp.Abs: _of(abs),
    sp.tan: lambda bits, x: _enclosure(sp.sin(x) / sp.cos(x), bits),
    sp.sinh: _of(_hyperbolic(-1)),
    sp.cosh: _of(_hyperbolic(1)),
    sp.tanh: lambda bits, x: _enclosure(1 - 2 / (sp.exp(2 * x) + 1), bits),
}


class Replacement:
    """Replaces symbols by values, as ``xreplace`` does; every subexpression is treated once."""

    def __init__(self, values: Mapping[sp.Symbol, sp.Expr]) -> None:
        #: Replaced expressions, to which callers may add.
        self.values: dict[sp.Basic, sp.Expr] = dict(values)

    def __call__(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression with the values."""
        if not self.values:
            return expression
        known = self.values.get(expression)
        if known is not None:
            return known
        old = expression.args
        if not old:
            return expression
        new = [self(part) for part in old]
        same = all(a is b for a, b in zip(old, new, strict=True))
        made = self.values[expression] = expression if same else self._made(expression, new)
        return made

    def _made(self, expression: sp.Expr, parts: Sequence[sp.Expr]) -> sp.Expr:
        if (
            expression.is_Mul
            and sp.S.Zero in parts
            and not any(p.is_number and not p.is_finite for p in parts)
        ):
            return sp.S.Zero  # SymPy asks first whether the other factors are finite
        made: sp.Expr = expression.func(*parts)
        return made


class Substitution(Replacement):
    """Replaces symbols by values, and shares what becomes of products.

    A number in a product is multiplied into a sum x + number, as SymPy does where both meet alone. Later
    products with this sum share what became of it. A sum over ``held`` symbols alone stays as it is.
    """

    def __init__(self, values: Mapping[sp.Symbol, sp.Expr], held: Iterable[sp.Symbol] = ()) -> None:
        super().__init__(values)
        self._held = frozenset(held)
        self._scales: dict[sp.Expr, sp.Expr] = {}

    def _made(self, expression: sp.Expr, parts: Sequence[sp.Expr]) -> sp.Expr:
        made = super()._made(expression, parts)
        if not made.is_Mul:
            return made
        number, *others = made.args
        if len(others) < 2 or not number.is_Rational or abs(number) == 1:
            return made
        sums = [f for f in others if f.is_Add and len(f.args) == 2 and f.args[0].is_number]
        if len(sums) != 1 or sums[0].free_symbols <= self._held:
            return made
        scale = self._scales.setdefault(sums[0], abs(number))
        scaled = sp.Add(*(scale * term for term in sums[0].args))
        return sp.Mul(number / scale, *(scaled if f is sums[0] else f for f in others))
