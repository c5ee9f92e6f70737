"""Prescribed motions by tables and profiles: whether accelerations are finite at their knots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import sympy as sp

from symgen.errors import SceneError
from symgen.symbolic.calculus import partial
from symgen.symbolic.switch import PiecewisePolynomial

#: Jump of a value, or of a rate over the largest found, that counts.
_JUMP = 1e-9


def check_knots(motion: sp.Expr, t: sp.Symbol, values: Mapping[sp.Symbol, sp.Expr]) -> None:
    """Check that a function of the time has a continuous rate at the knots of its tables.

    Where the variable of a table is no multiple of the time, plus a constant, its own smoothness counts.

    Raises
    ------
    SceneError
        For one whose value or rate jumps.
    """
    functions = (f for f in motion.atoms(PiecewisePolynomial) if f.has(t))
    for function in sorted(functions, key=sp.default_sort_key):
        x = function.args[0]
        if x.has(PiecewisePolynomial) or partial(x, t).has(t):
            if function.pieces.smooth < 1:
                raise _jumping(function)
            continue
        for expression in (motion, partial(motion, t)):
            for time, piece in _knots(function, t, values):
                at = {**values, t: time}
                before, behind = (
                    float(expression.xreplace(_held(expression, function, p)).xreplace(at).n(30))
                    for p in (piece, piece + 2)
                )
                if abs(before - behind) > _JUMP * max(1.0, abs(before), abs(behind)):
                    raise _jumping(function, float(time))


def _held(expression: sp.Expr, function: PiecewisePolynomial, piece: int) -> dict[sp.Expr, sp.Expr]:
    """Return all functions of the same knots and argument on a piece."""
    x, pieces = function.args[0], function.pieces
    return {
        f: f.func(x, sp.Integer(piece))
        for f in expression.atoms(PiecewisePolynomial)
        if (f.args[0], f.pieces.knots, f.pieces.period) == (x, pieces.knots, pieces.period)
    }


def _knots(
    function: PiecewisePolynomial, t: sp.Symbol, values: Mapping[sp.Symbol, sp.Expr]
) -> Iterator[tuple[sp.Expr, int]]:
    """Yield the time of each knot that is passed, once in a period, and the piece below it."""
    x, pieces = function.args[0].xreplace(dict(values)), function.pieces
    begin, rate, period = x.xreplace({t: sp.Integer(0)}), partial(x, t), sp.Rational(pieces.period)
    for knot in map(sp.Rational, pieces.knots):
        time = (knot - begin) / rate
        if period:
            time += sp.ceiling(-time * abs(rate) / period) * period / abs(rate)
        elif time <= 0:
            continue
        turns = sp.floor((x.xreplace({t: time}) - knot) / period + sp.Rational(1, 2)) if period else 0
        yield time, int(pieces.piece(knot, sp.S.Zero) + 2 * len(pieces.knots) * turns) - 2


def _jumping(function: PiecewisePolynomial, time: float | None = None) -> SceneError:
    when = "" if time is None else f" at t = {time:.6g} s"
    return SceneError(
        f"a prescribed motion needs an acceleration at every time: its rate jumps{when} with "
        f"{function.pieces.of(str(function.args[0]))}",
        hint='Give tables kind = "cubic" or "pchip", with a period or a rate of zero at their first and last '
        "points, and let the parts of mod end as they begin.",
    )
