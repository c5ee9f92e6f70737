"""Functions given by tables of points: polynomials between knots, as SciPy determines them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import sympy as sp
from pydantic import ConfigDict, Field

from symgen.errors import SceneError
from symgen.scene.table import Table, Value, absent
from symgen.scene.units import Dimension, describe
from symgen.symbolic.switch import Pieces

Kind = Literal["linear", "pchip", "cubic"]
#: Number of derivatives that are continuous at knots.
SMOOTH: dict[Kind, int] = {"linear": 0, "pchip": 1, "cubic": 2}


def _for_editors(schema: dict[str, Any]) -> None:
    """Declare for editors that points may come from a file, with the titles of its columns."""
    for key in ("x", "y"):
        points = schema["properties"][key]
        either = {"anyOf": [{k: v for k, v in points.items() if k != "description"}, {"type": "string"}]}
        schema["properties"][key] = {"description": points["description"], **either}
    about = 'A file of columns; x and y are then titles, as "angle [deg]".'
    schema["properties"]["file"] = {"type": "string", "description": about}


class PointsTable(Table):
    """A function of one variable by its values at points, ``NAME(x)`` in expressions.

    Without a period it keeps its first and its last value beyond the points.
    """

    model_config = ConfigDict(json_schema_extra=_for_editors)

    x: list[Value] = Field(min_length=2, description="The variable at the points, in rising order.")
    y: list[Value] = Field(min_length=2, description="The values there.")
    kind: Kind = Field(
        "linear",
        description="Between points: straight lines; pchip: cubics without overshoot; cubic: a spline.",
    )
    period: Value | None = absent("The variable after which the values repeat.")


class Tabulated(NamedTuple):
    """A table in expressions, with the dimensions of its variable and of its values."""

    pieces: Pieces
    of: Dimension
    gives: Dimension


def tabulated(
    name: str, table: PointsTable, read: Callable[[str, str | int | float], tuple[sp.Expr, Dimension]]
) -> Tabulated:
    """Return the function of a table.

    Parameters
    ----------
    name
        Its name.
    table
        The points.
    read
        Returns a number and its dimension from the key and the text of a value.

    Raises
    ------
    SceneError
        For points that are not in order, values of several dimensions, and a period that does not fit.
    """
    x, of = _numbers("x", table.x, read)
    y, gives = _numbers("y", table.y, read)
    if len(x) != len(y):
        raise SceneError(f"expected as many values as points, got {len(y)} for {len(x)}", where="y")
    for i, (a, b) in enumerate(pairwise(x), 1):
        if not float(b) > float(a):
            raise SceneError(
                f"expected points in rising order, got {table.x[i]!r} behind {table.x[i - 1]!r}",
                where=f"x.{i}",
                hint="For a jump, put two points closely together, or use sign.",
            )
    period = Fraction(0)
    if table.period is not None:
        (period,), dimension = _numbers("period", [table.period], read)
        if dimension != of:
            raise SceneError(f"expected {describe(of)} as x, got {describe(dimension)}", where="period")
        x, y = _closed(table, x, y, period)
    return Tabulated(_pieces(name, table.kind, x, y, period), of, gives)


def _numbers(
    key: str,
    texts: Sequence[str | int | float],
    read: Callable[[str, str | int | float], tuple[sp.Expr, Dimension]],
) -> tuple[list[Fraction], Dimension]:
    values = [read(key if len(texts) == 1 else f"{key}.{i}", text) for i, text in enumerate(texts)]
    dimension = values[0][1]
    for i, (_, other) in enumerate(values):
        if other != dimension:
            raise SceneError(
                f"expected {describe(dimension)} as the first, got {texts[i]!r}, {describe(other)}",
                where=f"{key}.{i}",
            )
    return [Fraction(str(value.n(40))) for value, _ in values], dimension


def _closed(
    table: PointsTable, x: list[Fraction], y: list[Fraction], period: Fraction
) -> tuple[list[Fraction], list[Fraction]]:
    """Return the points of one period, the first also at its end."""
    left = period - (x[-1] - x[0])
    if abs(left) <= period * Fraction(1, 10**12):
        if y[0] != y[-1]:
            raise SceneError(
                f"expected the same value at both ends of the period, got {table.y[0]!r} and {table.y[-1]!r}",
                where=f"y.{len(y) - 1}",
                hint="Omit the last point: the values repeat after the period.",
            )
        return x, y
    if left < 0:
        raise SceneError(
            f"expected a period that covers the points, got {table.period!r} for points from {table.x[0]!r} "
            f"to {table.x[-1]!r}",
            where="period",
        )
    return [*x, x[0] + period], [*y, y[0]]


def _pieces(name: str, kind: Kind, x: list[Fraction], y: list[Fraction], period: Fraction) -> Pieces:
    inner = _between(kind, x, y, period)
    if not period:
        constant = [Fraction(0)] * (len(inner[0]) - 1)
        ends = (y[0], *constant), (y[-1], *constant)
        return Pieces(name, tuple(x), (ends[0], *inner, ends[1]), smooth=0)
    knots = x[:-1]
    if len(knots) % 2:  # pieces alternate between two sides, in the next period too
        knots, inner, period = [*knots, *(k + period for k in knots)], [*inner, *inner], 2 * period
    return Pieces(name, tuple(knots), tuple(inner), period, SMOOTH[kind])


def _between(
    kind: Kind, x: list[Fraction], y: list[Fraction], period: Fraction
) -> list[tuple[Fraction, ...]]:
    """Return the coefficients between each point and the next."""
    if kind == "linear":
        steps = zip(pairwise(x), pairwise(y), strict=True)
        return [(c, (d - c) / (b - a)) for (a, b), (c, d) in steps]
    from scipy import interpolate

    at, values = [float(k) for k in x], [float(k) for k in y]
    if kind == "cubic":
        ends = "periodic" if period else "not-a-knot" if len(x) > 2 else "natural"
        spline = interpolate.CubicSpline(at, values, bc_type=ends)
    elif period:  # slopes at the ends are those of points repeated on both sides
        before, behind = [k - float(period) for k in at[:-1]], [k + float(period) for k in at[1:]]
        wide = interpolate.PchipInterpolator([*before, *at, *behind], [*values[:-1], *values, *values[1:]])
        first = len(before)
        return _rows(wide.c[:, first : first + len(at) - 1])
    else:
        spline = interpolate.PchipInterpolator(at, values)
    return _rows(spline.c)


def _rows(c: object) -> list[tuple[Fraction, ...]]:
    return [tuple(Fraction(float(k)) for k in column[::-1]) for column in c.T]  # type: ignore[attr-defined]
