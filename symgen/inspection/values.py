"""Values in command-line text: of a driven mechanism's input, time, crank angle and speed, and of symbols."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from symgen.errors import ModelError, SceneError
from symgen.scene.expressions import parse_any
from symgen.scene.units import ANGULAR_RATE, LENGTH, NUMBER, TIME, in_angles, parse_quantity
from symgen.symbolic.constants import with_pi
from symgen.symbolic.quantity import Quantity

#: Numbers in SI units [s, rad, m], and their variable: ``time`` or ``input``.
Values = tuple[list[float], str]
_DEGREES = math.radians(1.0), "input"
#: Digits that a count of values has fewer of.
_DIGITS = 8


def of_input(model: Any, texts: Sequence[str], option: str) -> Values:
    """Return values of the first input of a loop, or times.

    Bare numbers are degrees, or lengths in the scene's unit.

    Raises
    ------
    ModelError
        For text that is neither, or for both in one list.
    """
    d = model.description
    first = d.variables[d.having("input")[0]] if d.having("input") else None
    if first is not None and first.is_length:
        size, bare = LENGTH, (d.units.get("length", ("m", 1.0))[1], "input")
    else:
        size, bare = NUMBER, _DEGREES
    example = "3 in" if size == LENGTH else "45 deg"
    expected = f'values of {first.name if first else "the input"} after {option}, such as "{example}"'
    expected += _ranges(option)
    return _read(texts, bare, {size: "input", TIME: "time"}, expected)


def of_drive(model: Any, texts: Sequence[str], option: str) -> Values:
    """Return directions of the driven link of a linkage, or times; lengths if drives are lengths alone.

    Bare numbers are degrees, and of lengths refused; as the ends of a range they are seconds.

    Raises
    ------
    ModelError
        For text that is neither, or for both in one list.
    """
    by_length = model is not None and not model.description.drives
    kind, value, time, bare = "angles", '"45" (degrees) or "0.5 rad"', '"0.3 s"', _DEGREES
    if option != "--at":
        value, time, bare = '"45 deg"', '"0.3" (seconds)', (1.0, "time")
    if by_length:
        kind, value, bare = "lengths", '"20 mm"', (math.nan, "") if option == "--at" else bare
    expected = f"{kind} after {option}, such as {value}, or times such as {time}{_ranges(option)}"
    return _read(texts, bare, {LENGTH if by_length else NUMBER: "input", TIME: "time"}, expected)


def of_crank(_: Any, texts: Sequence[str], option: str) -> Values:
    """Return directions of the crank; bare numbers are degrees.

    Raises
    ------
    ModelError
        For other text.
    """
    expected = f'angles after {option}, such as "45" (degrees) or "0.5 rad"{_ranges(option)}'
    return _read(texts, _DEGREES, {NUMBER: "input"}, expected)


def of_symbols(options: Sequence[str], symbols: Iterable[Quantity]) -> dict[str, sp.Expr]:
    """Return exact values of symbols [SI] given as ``NAME=VALUE``: ``0.7``, ``2 cm``, ``90 deg`` or ``pi/2``.

    Raises
    ------
    ModelError
        For other text, and for a unit that is not one of the symbol.
    """
    known = {x.name: x.unit for x in symbols}
    values = {}
    for option in options:
        name, _, text = (part.strip() for part in option.partition("="))
        try:
            value, dimension = parse_any(text, {})
        except SceneError:
            raise ModelError(
                'expected --with NAME=VALUE, a finite number in SI units, or such as "90 deg" or "pi/2", '
                f"got {option!r}"
            ) from None
        unit = known.get(name, "1")
        own = parse_quantity("1" if unit == "1" else f"1 {unit}")[1]
        bare = dimension == NUMBER and not in_angles(text)
        if dimension != own and not bare:
            raise ModelError(f"expected a value of {name} [{unit}] after --with, got {option!r}")
        values[name] = with_pi(value)
    return values


def crank_or_time(text: str) -> tuple[float, str, str]:
    """Return an angle of the crank [rad] (degrees if bare) or a time [s], its variable and its label.

    Raises
    ------
    ModelError
        For other text, and for more than one value.
    """
    (value, *others), over = of_drive(None, [text], "--at")
    if others:
        raise ModelError(f"expected one angle of the crank or one time after --at, got {text!r}")
    return value, over, f"at t = {value:g} s" if over == "time" else f"at {math.degrees(value):g} deg"


def of_pose(_: Any, texts: Sequence[str], option: str) -> Values:
    """Return the times of poses [s]; raise ModelError for other text and bare numbers, elsewhere degrees."""
    expected = f'times after {option}, such as "0.3 s"{_ranges(option)}'
    return _read(texts, (math.nan, ""), {TIME: "time"}, expected)


def of_times(texts: Sequence[str], option: str, one: str = "") -> list[float]:
    """Return times [s]; raise ModelError for other text, and after --at for bare numbers other than 0.

    ``one`` is the name of accepted values where a single one is expected.
    """
    expected = f'{one or "times"} after {option}, such as "0.3 s"{"" if one else _ranges(option)}'
    return _read(texts, (math.nan if option == "--at" else 1.0, "time"), {TIME: "time"}, expected)[0]


def _ranges(option: str) -> str:
    """Return the end of a list of accepted values, with ranges for options of many."""
    return ", or FROM:TO:COUNT" if option in ("--at", "--t-eval") else ""


def crank_speeds(text: str) -> list[float]:
    """Return crank speeds [rad/s]; bare numbers are rpm.

    Raises
    ------
    ModelError
        For other text, and for a speed of zero.
    """
    expected = (
        'crank speeds after --speeds, such as "20:400:39" (rpm from, to, count) or "60,95", not in Hz, '
        "none of them zero"
    )
    speeds, _ = _read([text], (math.pi / 30, "speed"), {ANGULAR_RATE: "speed"}, expected)
    if 0.0 in speeds or "Hz" in text:  # turns or radians per second?
        raise ModelError(f"expected {expected}, got {text!r}")
    return speeds


def _read(texts: Sequence[str], bare: tuple[float, str], units: Mapping[Any, str], expected: str) -> Values:
    """Return the values of comma-separated texts, each a value or ``FROM:TO:COUNT``, and their variable."""
    values_in_si: list[float] = []
    over = set()
    for text in (part.strip() for group in texts for part in group.split(",")):
        *ends, count = text.split(":") if text.count(":") == 2 else (text, "1")
        values, variables = zip(*(_value(end, bare, units) for end in ends), strict=True)
        many = int(count) if count.strip().isdecimal() and len(count) < _DIGITS else 0
        if not (all(variables) and all(map(math.isfinite, values)) and many >= len(ends)):
            bare_time = math.isnan(bare[0]) and _value(text, (1.0, "time"), {})[1]
            remedy = f'\n  A time needs a unit: "{text} s".' if bare_time else ""
            raise ModelError(f"expected {expected}, got {text[:60]!r}{remedy}")
        values_in_si += np.linspace(values[0], values[-1], many).tolist()
        over |= set(variables)
    if len(over) > 1:
        raise ModelError(f"give times or values of the input, not both: {', '.join(texts)}")
    return values_in_si, over.pop()


def _value(text: str, bare: tuple[float, str], units: Mapping[Any, str]) -> tuple[float, str]:
    """Return a value in SI units and its variable; that of other text is empty.

    ``bare`` is the unit and the variable of numbers without a unit; if the unit is nan, only 0 needs none.
    """
    try:
        return float(text) and float(text) * bare[0], bare[1]
    except ValueError:
        pass
    try:
        number, dimension = parse_quantity(text.strip())
    except SceneError:
        return math.nan, ""
    return float(number), units.get(dimension, "")
