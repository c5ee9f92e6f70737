"""Differentiation through shared subexpressions by the chain rule, without expansion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import sympy as sp
from sympy.core.cache import cacheit

from symgen.errors import DerivationError
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Definition

ZERO, ONE = sp.Integer(0), sp.Integer(1)


class Calculus:
    """Coordinates q with rates u, time t, and named subexpressions of them.

    Derivatives follow the chain rule through the names, so the size of a result is proportional to the size
    of the written expression, not of its expansion.

    Parameters
    ----------
    coordinates, rates
        Pairs q_i, u_i with dq_i/dt = u_i. Rates are constant under :meth:`rate`: applied twice, it gives
        the part of the second time derivative that holds no acceleration.
    time
        The symbol of time.
    """

    def __init__(self, coordinates: Sequence[Quantity], rates: Sequence[Quantity], time: sp.Symbol) -> None:
        self.coordinates = tuple(c.symbol for c in coordinates)
        self._rate: dict[sp.Symbol, sp.Expr] = {time: ONE}
        self._rate.update((q.symbol, u.symbol) for q, u in zip(coordinates, rates, strict=True))
        self._gradient: dict[sp.Symbol, dict[sp.Symbol, sp.Expr]] = {q: {q: ONE} for q in self.coordinates}
        self._definitions: dict[sp.Symbol, Definition] = {}
        # Points and their components are differentiated again for each quantity of them.
        self._rates: dict[sp.Expr, sp.Expr] = {}
        self._gradients: dict[sp.Expr, dict[sp.Symbol, sp.Expr]] = {}

    @property
    def definitions(self) -> tuple[Definition, ...]:
        """All named subexpressions, each after those it uses."""
        return tuple(self._definitions.values())

    def define(self, name: str, expression: sp.Expr, unit: str, description: str) -> sp.Expr:
        """Name a subexpression and its rate; numbers and bare symbols are returned unchanged."""
        expression = sp.sympify(expression)
        if expression.is_Atom:
            return expression
        rate = self.rate(expression)
        if not rate.is_Atom:
            rate = self._add(
                f"{name}_rate", rate, per_second(unit), f"rate of change: {description}", self.rate(rate)
            )
        return self._add(name, expression, unit, description, rate)

    def _add(self, name: str, expression: sp.Expr, unit: str, description: str, rate: sp.Expr) -> sp.Symbol:
        new = quantity(name, unit, description)
        if new.symbol in self._definitions:
            raise DerivationError(f"the name {name!r} is used twice: rename one of its quantities")
        self._definitions[new.symbol] = Definition(new, expression)
        self._gradient[new.symbol] = self.gradient(expression)
        self._rate[new.symbol] = rate
        return new.symbol

    def rate(self, expression: sp.Expr) -> sp.Expr:
        """Return the time derivative with all rates u held constant."""
        known = self._rates.get(expression)
        if known is None:
            partials = self._partials(expression, self._rate)
            rates = ((slope, self._rate[s]) for s, slope in partials)
            known = self._rates[expression] = sp.Add(*(b if a is ONE else sp.Mul(a, b) for a, b in rates))
        return known

    def gradient(self, expression: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        """Return the nonzero partial derivatives with respect to the coordinates."""
        known = self._gradients.get(expression)
        if known is None:
            partials = self._partials(expression, self._gradient)
            known = self._gradients[expression] = chained((slope, self._gradient[s]) for s, slope in partials)
        return known

    @staticmethod
    def _partials(
        expression: sp.Expr, known: Mapping[sp.Symbol, object]
    ) -> Iterator[tuple[sp.Symbol, sp.Expr]]:
        """Yield (symbol, partial derivative) term by term, at a cost linear in the terms."""
        for term in sp.Add.make_args(expression):
            coefficient, rest = term.as_coeff_Mul()
            if rest.is_Symbol:
                if known.get(rest):
                    yield rest, coefficient
                continue
            factors = sp.Mul.make_args(rest)
            powers = dict(factor.as_base_exp() for factor in factors)
            monomial = all(base.is_Symbol and exponent.is_Integer for base, exponent in powers.items())
            varying = [s for s in (powers if monomial else _symbols(term)) if known.get(s)]
            for s in sorted(varying, key=lambda s: str(s.name)):
                if monomial:
                    others = (f for f, base in zip(factors, powers, strict=True) if base != s)
                    power = powers[s]
                    lower = () if power is ONE else (power, s ** (power - 1))
                    yield s, sp.Mul(coefficient, *lower, *others)
                else:
                    yield s, partial(term, s)

    def jacobian(self, expressions: Sequence[sp.Expr]) -> sp.ImmutableMatrix:
        """Return the matrix d(expressions)/d(coordinates)."""
        rows = [self.gradient(e) for e in expressions]
        entries = [[row.get(q, ZERO) for q in self.coordinates] for row in rows]
        return sp.ImmutableMatrix(len(rows), len(self.coordinates), [e for row in entries for e in row])


def chained(parts: Iterable[tuple[sp.Expr, Mapping[sp.Symbol, sp.Expr]]]) -> dict[sp.Symbol, sp.Expr]:
    """Return the sum of slope times gradient over (slope, gradient) pairs, without zeros (chain rule)."""
    terms: dict[sp.Symbol, list[sp.Expr]] = {}
    for slope, gradient in parts:
        for q, inner in gradient.items():
            terms.setdefault(q, []).append(slope if inner is ONE else sp.Mul(slope, inner))
    summed = {q: sp.Add(*each) for q, each in terms.items()}
    return {q: value for q, value in summed.items() if value != 0}


@cacheit
def partial(expression: sp.Expr, s: sp.Symbol) -> sp.Expr:
    """Return the partial derivative, as ``sp.diff`` does, but without its search for unevaluated derivatives.

    That search and questions to SymPy's assumptions are most of the time of ``sp.diff``.
    """
    if s not in _symbols(expression):
        return ZERO
    parts = expression.args
    if expression.is_Add:
        return sp.Add(*(partial(term, s) for term in parts))
    if expression.is_Mul:
        slopes = [(i, partial(factor, s)) for i, factor in enumerate(parts)]
        return sp.Add(*(sp.Mul(*parts[:i], slope, *parts[i + 1 :]) for i, slope in slopes if slope != 0))
    if expression.is_Pow and parts[1].is_Rational:
        return expression * (partial(parts[0], s) * parts[1] / parts[0])
    if expression.func in (sp.sin, sp.cos):
        return expression.fdiff() * partial(parts[0], s)
    return sp.diff(expression, s)


@cacheit
def _symbols(expression: sp.Expr) -> frozenset[sp.Basic]:
    """Return the free symbols: SymPy collects those of every part again each time."""
    if type(expression).free_symbols is not sp.Basic.free_symbols:
        return frozenset(expression.free_symbols)
    return frozenset[sp.Basic]().union(*map(_symbols, expression.args))


def per_second(unit: str) -> str:
    """Return the unit of a rate of change of something measured in ``unit``."""
    return {"m": "m/s", "m/s": "m/s^2", "rad": "rad/s", "m^2": "m^2/s", "m^2/s": "m^2/s^2", "1": "1/s"}.get(
        unit, f"({unit})/s"
    )
