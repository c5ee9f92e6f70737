"""Values in command-line text: of the input of a driven mechanism, of time, of crank angle and speed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from symgen.errors import ModelError, SceneError
from symgen.scene.units import LENGTH, NUMBER, TIME, parse_quantity

#: Numbers in SI units [s, rad, m], and their variable: ``time`` or ``input``.
Values = tuple[list[float], str]
_DEGREES = math.radians(1.0), "input"


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
    return _read(texts, bare, {size: "input", TIME: "time"}, expected)


def of_drive(_: Any, texts: Sequence[str], option: str) -> Values:
    """Return directions of the driven link of a linkage, or times.

    Bare numbers are degrees; as the ends of a range they are seconds.

    Raises
    ------
    ModelError
        For text that is neither, or for both in one list.
    """
    expected = f'angles after {option}, such as "45" (degrees) or "0.5 rad", or times such as "0.3 s"'
    bare = _DEGREES if option == "--at" else (1.0, "time")
    return _read(texts, bare, {NUMBER: "input", TIME: "time"}, expected)


def of_crank(_: Any, texts: Sequence[str], option: str) -> Values:
    """Return directions of the crank; bare numbers are degrees.

    Raises
    ------
    ModelError
        For other text.
    """
    expected = f'angles after {option}, such as "45" (degrees) or "0.5 rad"'
    return _read(texts, _DEGREES, {NUMBER: "input"}, expected)


def of_time(text: str, option: str, others: str) -> float:
    """Return a time [s]; raise ModelError for other text. ``others`` names other accepted values."""
    expected = f'{others} or a time after {option}, such as "0.3 s"'
    found, _ = _read([text], (1.0, "time"), {TIME: "time"}, expected)
    if len(found) > 1:
        raise ModelError(f"expected {expected}, got {text!r}")
    return found[0]


def _read(texts: Sequence[str], bare: tuple[float, str], units: Mapping[Any, str], expected: str) -> Values:
    found, over = [], set()
    for text in (part.strip() for group in texts for part in group.split(",")):
        try:
            value, variable = float(text) * bare[0], bare[1]
        except ValueError:
            try:
                number, dimension = parse_quantity(text)
                value, variable = float(number), units.get(dimension, "")
            except SceneError:
                variable = ""
        if not variable or not math.isfinite(value):
            raise ModelError(f"expected {expected}, got {text!r}")
        found.append(value)
        over.add(variable)
    if len(over) > 1:
        raise ModelError(f"give times or values of the input, not both: {', '.join(texts)}")
    return found, over.pop()


def crank_speeds(text: str) -> list[float]:
    """Return crank speeds [rad/s] from text in rpm: ``FROM:TO:COUNT`` or comma-separated values.

    Raises
    ------
    ModelError
        If they cannot be read.
    """
    try:
        if ":" in text:
            first, last, count = text.split(":")
            if int(count) < 2:
                raise ValueError
            low, step = float(first), (float(last) - float(first)) / (int(count) - 1)
            found = [low + step * k for k in range(int(count))]
        else:
            found = [float(part) for part in text.split(",")]
        if not all(math.isfinite(x) and x != 0.0 for x in found):
            raise ValueError
    except ValueError:
        raise ModelError(
            'expected crank speeds in rpm after --speeds, such as "20:400:39" (from, to, count) or '
            f'"60,95", none of them zero, got {text!r}'
        ) from None
    return [x * math.pi / 30 for x in found]
