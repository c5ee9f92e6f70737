"""Prescribed motions by tables and profiles: whether accelerations are finite at their knots."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import sympy as sp

from symgen.errors import SceneError
from symgen.symbolic.calculus import partial
from symgen.symbolic.switch import PiecewisePolynomial, Sign, written

#: Jump of a value, or of a rate over the largest found, that counts.
_JUMP = 1e-9
_NEEDS = "a prescribed motion needs an acceleration at every time"


def check_rate(
    motion: sp.Expr, t: sp.Symbol, values: Mapping[sp.Symbol, sp.Expr], unit: str, end: float
) -> None:
    """Check that a function of the time has a continuous rate: at its jumps, and at the knots of its tables.

    Knots behind the end of the run are left to analyses, which end with an error where they pass a jump.
    Where the variable of a table is no multiple of the time, plus a constant, its own smoothness counts.

    Parameters
    ----------
    motion, t
        The function, and its variable [s].
    values
        The tunable parameters in the scene. At jumps the rate has to be continuous for all of their values.
    unit
        Unit of the function.
    end
        End of the run that the scene gives [s], or infinity.

    Raises
    ------
    SceneError
        For one whose value or rate jumps.
    """
    for jump in sorted(motion.atoms(sp.Abs, Sign), key=sp.default_sort_key):
        if jump.has(t) and not _is_smooth(motion, jump.args[0], t, values):
            raise SceneError(
                f"{_NEEDS}: its value or rate jumps where the argument of {written(jump)} passes zero",
                hint="Write profile.poly345((t - t1)/T) for a rise from t1 on in a time T. abs, sign, min "
                "and max fit where value and rate are continuous, as in max(t - t1, 0*t1)**2, and in loads.",
            )
    functions = (f for f in motion.atoms(PiecewisePolynomial) if f.has(t))
    for function in sorted(functions, key=sp.default_sort_key):
        x = function.args[0]
        if x.has(PiecewisePolynomial) or partial(x, t).has(t):
            if function.pieces.smooth < 1:
                raise _jumping(function)
            continue
        for word, of, expression in (
            ("it jumps", unit, motion),
            ("its rate jumps", f"{unit}/s", partial(motion, t)),
        ):
            for time, piece in _knots(function, t, values):
                if time >= end:
                    continue
                at = {**values, t: time}
                before, behind = (
                    float(expression.xreplace(_held(expression, function, p)).xreplace(at).n(30))
                    for p in (piece, piece + 2)
                )
                if abs(before - behind) > _JUMP * max(1.0, abs(before), abs(behind)):
                    change = f"{word} from {before:.6g} to {behind:.6g} {of} at t = {float(time):.6g} s,"
                    raise _jumping(function, change, piece)


def _is_smooth(motion: sp.Expr, gap: sp.Expr, t: sp.Symbol, values: Mapping[sp.Symbol, sp.Expr]) -> bool:
    """Return whether a function is known to have a continuous rate where the argument of a jump passes zero.

    The difference of both sides, written by the argument z in place of a term of it, has no part in 1 and z.
    """
    z = sp.Dummy()
    sides = [motion.xreplace({sp.Abs(gap): side * gap, Sign(gap): sp.Integer(side)}) for side in (1, -1)]
    between = sides[0] - sides[1]
    # Any values show whether it vanishes for all; the second set is close to that of the scene.
    near = {
        s: x * (1 + sp.Rational(k, 97)) + sp.Rational(k, 9973) for k, (s, x) in enumerate(values.items(), 1)
    }
    for term in sp.Add.make_args(gap):
        factor, variable = term.as_independent(t, as_Add=False)
        if (rest := gap - term).has(variable) or not variable.has(t):
            continue
        by_gap = between.xreplace({variable: (z - rest) / factor})
        parts = [e.xreplace({z: sp.S.Zero}) for e in (by_gap, partial(by_gap, z))]
        samples = [
            {**of, t: time} for of in (values, near) for time in (sp.Rational(3, 7), sp.Rational(11, 5))
        ]
        # A table may vanish at these times: each of its pieces counts.
        on_pieces = [
            {},
            *(held for e in parts for f in e.atoms(PiecewisePolynomial) for held in _on_pieces(e, f)),
        ]
        if all(
            abs(_number(e.xreplace(held).xreplace(at))) <= _JUMP
            for e in parts
            for held in on_pieces
            for at in samples
        ):
            return True
    return False


def _on_pieces(expression: sp.Expr, function: PiecewisePolynomial) -> Iterator[dict[sp.Expr, sp.Expr]]:
    """Yield all functions of the same knots and argument on each of their pieces."""
    for piece in range(-1, 2 * len(function.pieces.knots), 2):
        yield _held(expression, function, piece)


def _number(x: sp.Expr) -> float:
    """Return a value, NaN if it is none."""
    try:
        return float(x.n(30))
    except TypeError:
        return math.nan


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


def _jumping(function: PiecewisePolynomial, change: str = "", piece: int = 0) -> SceneError:
    """Return the error for a motion that jumps with a table, or its rate, behind a piece if one is known."""
    pieces, where = function.pieces, f"with {function.pieces.of(written(function.args[0]))}"
    hint = "Let the parts of mod end as they begin."
    if not pieces.form:
        hint = f'Write kind = "cubic" or "pchip" for the table {pieces.name}.'
        end = {-1: "first", 2 * len(pieces.knots) - 3: "last"}.get(piece)
        if not pieces.period and (end or not piece):
            hint = (
                "Give it a period, or a rate of zero at its ends, whose values it keeps beyond: two equal "
                'values there with kind = "pchip".'
            )
        if end and not pieces.period:
            where = f"the {end} point of the table {pieces.name}"
            hint += " Or end the motion before, by analysis.t_end; of runs also by --t-end, and in Python by "
            hint += """build(..., set={"analysis.t_end": "2 s"})."""
        through = pieces.of(written(function.args[0]))
        hint += f' A force may have corners, such as that of a tyre on a road, "k*({through} - P.y)".'
    return SceneError(f"{_NEEDS}: {change or 'its rate jumps'} {where}", hint=hint)
