"""Quantities with units, read by Pint over symgen's own list of units, exact as fractions, in SI."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from symgen.errors import SceneError, nearest
from symgen.scene.faults import at


class Dimension(NamedTuple):
    """Exponents of length, mass and time."""

    length: Fraction = Fraction(0)
    mass: Fraction = Fraction(0)
    time: Fraction = Fraction(0)

    def times(self, other: Dimension) -> Dimension:
        """Dimension of a product."""
        return Dimension(*(a + b for a, b in zip(self, other, strict=True)))

    def power(self, exponent: Fraction) -> Dimension:
        """Dimension of a power."""
        return Dimension(*(a * exponent for a in self))

    @property
    def unit(self) -> str:
        """The SI unit of this dimension, such as ``kg*m/s^2``; ``1`` when there is none."""
        known = _NAMED.get(self)
        if known:
            return known
        up = [_factor(u, e) for u, e in zip(("m", "kg", "s"), self, strict=True) if e > 0]
        down = [_factor(u, -e) for u, e in zip(("m", "kg", "s"), self, strict=True) if e < 0]
        return ("*".join(up) or "1") + "".join(f"/{d}" for d in down)


def _factor(unit: str, exponent: Fraction) -> str:
    if exponent == 1:
        return unit
    return f"{unit}^{exponent}" if exponent.denominator == 1 else f"{unit}^({exponent})"


def dimension(length: int = 0, mass: int = 0, time: int = 0) -> Dimension:
    """Return the dimension with these integer exponents."""
    return Dimension(Fraction(length), Fraction(mass), Fraction(time))


#: Units for results, by the keys of the table ``units``: name and size in SI.
Shown = dict[str, tuple[str, float]]
NUMBER = dimension()
LENGTH = dimension(1)
MASS = dimension(0, 1)
TIME = dimension(0, 0, 1)
VELOCITY = dimension(1, 0, -1)
ACCELERATION = dimension(1, 0, -2)
ANGULAR_RATE = dimension(0, 0, -1)
MASS_PER_LENGTH = dimension(-1, 1)
DENSITY = dimension(-3, 1)
AREA = dimension(2)
SECOND_MOMENT = dimension(4)
INERTIA = dimension(2, 1)
FORCE = dimension(1, 1, -2)
PRESSURE = dimension(-1, 1, -2)
TORQUE = dimension(2, 1, -2)
POWER = dimension(2, 1, -3)
STIFFNESS = dimension(0, 1, -2)
DAMPING = dimension(0, 1, -1)
ANGULAR_DAMPING = dimension(2, 1, -1)

_NAMED = {
    FORCE: "N",
    TORQUE: "N*m",
    POWER: "W",
    dimension(1, 1, -3): "N/s",
    STIFFNESS: "N/m",
    DAMPING: "N*s/m",
    ANGULAR_DAMPING: "N*m*s",
    PRESSURE: "Pa",
}

#: Units in which results show values that are written in units of angles, by the unit of their dimension.
OF_ANGLES = {"1": "rad", "1/s": "rad/s", "1/s^2": "rad/s^2"}
_ANGLE = re.compile(r"\b(?:rad|radians?|deg|degrees?|rev|revolutions?|turns?|rpm)\b")

#: Name of each kind of value in messages, and an example.
KINDS: dict[Dimension, tuple[str, str]] = {
    NUMBER: ("a plain number or an angle", '"30 deg" or 0.5'),
    LENGTH: ("a length", '"2 cm"'),
    MASS: ("a mass", '"1.5 kg"'),
    TIME: ("a time", '"2 s"'),
    VELOCITY: ("a velocity", '"0.1 m/s"'),
    ACCELERATION: ("an acceleration", '"9.81 m/s^2"'),
    ANGULAR_RATE: ("an angular velocity", '"2 rad/s" or "300 rpm"'),
    MASS_PER_LENGTH: ("a mass per length", '"1 kg/m"'),
    INERTIA: ("a moment of inertia", '"0.02 kg*m^2"'),
    FORCE: ("a force", '"10 N"'),
    DENSITY: ("a density", '"7850 kg/m^3"'),
    AREA: ("an area", '"2 cm^2"'),
    SECOND_MOMENT: ("a second moment of area", '"120 mm^4"'),
    PRESSURE: ("a stress or a modulus", '"210 GPa"'),
    TORQUE: ("a torque or an energy", '"3 N*m"'),
    POWER: ("a power or a rate of torque", '"50 W" or "50 N*m/s"'),
    STIFFNESS: ("a stiffness or a force per length", '"200 N/m"'),
    DAMPING: ("a damping", '"5 N*s/m"'),
    ANGULAR_DAMPING: ("a damping of rotation", '"0.1 N*m*s"'),
}

#: Units whose answers are kept in ``units.json``.
COMMON = (
    "m", "cm", "mm", "in", "ft", "kg", "g", "lb", "slug", "s", "ms", "min", "rad", "deg", "Hz", "rpm",
    "rad/s", "deg/s", "m/s", "cm/s", "mm/s", "in/s", "ft/s", "m/s^2", "cm/s^2", "mm/s^2", "in/s^2", "ft/s^2",
    "kg/m", "g/cm", "kg*m^2", "g*cm^2", "kg*cm^2", "N", "kN", "lbf", "N*m", "N*mm", "lbf*in", "lbf*ft",
    "N/m", "N/mm", "lbf/in", "N*s/m", "lbf*s/in", "J", "W", "Pa", "kPa", "MPa", "GPa", "psi", "kg/m^3",
    "slug/ft^3", "lb/in^3", "m^2", "mm^2", "in^2", "m^4", "mm^4", "in^4",
)  # fmt: skip

#: Pint's answers for the units of ``COMMON``.
UNITS = Path(__file__).with_name("units.json")
_NUMBER = r"[-+]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d++)?+"  # possessive: 1e-3*a is no 1 of a unit e-3*a
_QUANTITY = re.compile(
    rf"\s*(?P<number>{_NUMBER})(?:\s*/\s*(?P<over>\d++)(?![.eE][-+]?\d))?\s*"
    r"(?P<unit>(?:1\s*/\s*)?[A-Za-zµ](?:(?:\^|\*\*)\s*\(?\s*[-+]?\d\.\d|[A-Za-z0-9_µ*/^() +-])*)?\s*",
    re.ASCII,
)
_NOT_FINITE = re.compile(r"\s*[-+]?(nan|inf|infinity)\b", re.IGNORECASE)
#: Whole powers, halves, thirds and quarters; of these only .5 without brackets.
_POWER = r"[-+]?[0-9](?:\.5)?|\(\s*[-+]?[0-9](?:\.5|\s*/\s*[234])?\s*\)"
_FACTOR = rf"[A-Za-zµ_]+(?:\s*(?:\^|\*\*)\s*(?:{_POWER}))?"
_POWERS = re.compile(rf"([A-Za-zµ_]+)(?:\s*(?:\^|\*\*)\s*({_POWER}))?")
_PART = rf"(?:{_FACTOR}|\(\s*{_FACTOR}(?:\s*[*/]\s*{_FACTOR})*\s*\))"
#: What Pint is asked at all: products and quotients of powers up to the ninth, so that no text makes it
#: compute m^9**9**9 or anything inexact.
_UNIT = re.compile(rf"(?:1\s*/\s*)?{_PART}(?:\s*[*/]\s*{_PART})*")
_LONGEST = 200


#: Remedy for units in an expression.
UNITLESS = (
    'Name each quantity under [parameters], as in stroke = "20 mm" and w = "3 rad/s", and write the '
    'expression over these names: "rest - stroke*sin(w*t)".'
)
#: What is behind the number of an expression that has units in it.
_EXPRESSION = re.compile(r"[+,]|\s-\s|\w\s*\(|\d\s*[A-Za-zµ]")


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(str(Path(__file__).with_name("units.txt")), non_int_type=Fraction)


def is_quantity(text: str) -> bool:
    """Return whether ``text`` is a number, with or without a unit."""
    return bool(_QUANTITY.fullmatch(text) or _NOT_FINITE.match(text))


def unit_in(text: str) -> str:
    """Return the unit that a quantity is written in; empty without one, and for other texts."""
    match = _QUANTITY.fullmatch(text)
    return (match["unit"] or "").strip() if match else ""


@lru_cache(maxsize=512)
def parse_quantity(text: str) -> tuple[Fraction, Dimension]:
    """Return the exact SI value and the dimension of a text such as ``"2.5 cm"``.

    Raises
    ------
    SceneError
        When the number is not finite, or the unit is not in ``units.txt``.
    """
    if _NOT_FINITE.match(text):
        raise SceneError(f"expected a finite number, got {text!r}")
    match = _QUANTITY.fullmatch(text)
    if not match or len(text) > _LONGEST:
        raise SceneError(f'expected a quantity such as "2 cm", got {text[:_LONGEST]!r}')
    number, unit = match["number"], match["unit"]
    if unit and _EXPRESSION.search(unit.strip()) and not _UNIT.fullmatch(unit.strip()):
        raise SceneError(f"expressions contain no units, got {text!r}", hint=UNITLESS)
    too_large = SceneError(f"expected a number that fits in double precision, got {text!r}")
    if abs(int((re.search(r"[eE]([-+]?\d+)", number) or ["", "0"])[1])) > 400:
        raise too_large
    scale, dim = _unit(unit.strip()) if unit else (Fraction(1), NUMBER)
    over = int(match["over"] or 1)
    if not over:
        raise SceneError(f"{text!r} divides by zero")
    value = Fraction(number) / over * scale
    if not fits(value):
        raise too_large
    return value, dim


def shown_unit(text: str) -> str:
    """Return the SI unit of a quantity, with radians where it is written in units of angles."""
    unit = parse_quantity(text)[1].unit
    return OF_ANGLES.get(unit, unit) if in_angles(text) else unit


def in_angles(text: str) -> bool:
    """Return whether a unit of angles is written in a text."""
    return bool(_ANGLE.search(text))


def fits(value: Fraction) -> bool:
    """Return whether a number is zero, or neither too large nor too small for double precision.

    Below the least normal number digits are lost, and the inverse overflows.
    """
    return value == 0 or sys.float_info.min <= abs(value) <= sys.float_info.max


def farthest(data: Any, where: str = "") -> tuple[float, str, str]:
    """Return the quantity in tables of a scene that is farthest from one: decades, its key, and its text."""
    if isinstance(data, Mapping | list | tuple):
        entries = data.items() if isinstance(data, Mapping) else enumerate(data)
        return max((farthest(v, f"{where}.{k}".lstrip(".")) for k, v in entries), default=(0.0, "", ""))
    text = str(data)
    with suppress(SceneError):
        value, _ = parse_quantity(text)
        return (abs(math.log10(abs(value))) if value else 0.0, where, text)
    return (0.0, where, text)


@lru_cache(maxsize=256)
def _unit(text: str) -> tuple[Fraction, Dimension]:
    known = _known_units().get(text)
    if known:
        numerator, denominator, *exponents = map(int, known.split())
        return Fraction(numerator, denominator), dimension(*exponents)
    return read_unit(text)


@lru_cache(maxsize=1)
def _known_units() -> dict[str, str]:
    """Return Pint's answers for the units of ``COMMON``, which spare most scenes the loading of Pint."""
    return json.loads(UNITS.read_text(encoding="utf-8"))


def read_unit(text: str) -> tuple[Fraction, Dimension]:
    """Return scale and dimension of a product of units, read by Pint; raise SceneError for unknown ones.

    Units in fractional powers are roots of those in whole powers: exact, or to 60 digits where the root of
    the scale is irrational, as of bar^(1/2).
    """
    problem, hint = _not_a_unit(text)
    if not _UNIT.fullmatch(text):
        raise SceneError(problem, hint=hint)
    import pint

    powers = [(name, Fraction(re.sub(r"[() ]", "", power) or 1)) for name, power in _POWERS.findall(text)]
    root = math.lcm(*(power.denominator for _, power in powers))
    each = iter(powers)
    whole = _POWERS.sub(lambda _: "{}**({})".format(*((x := next(each))[0], x[1] * root)), text)
    try:
        quantity = _registry().Quantity(Fraction(1), whole).to_root_units()
    except pint.UndefinedUnitError as error:
        unknown = [name for name in error.unit_names if name != text]
        raise SceneError(f"{problem}: {', '.join(unknown)}" if unknown else problem, hint=hint) from None
    except Exception as error:  # Pint's parser raises whatever Python's tokenizer does
        raise SceneError(problem, hint=hint) from error
    dims = quantity.dimensionality
    dim = Dimension(*(Fraction(dims.get(d, 0)) / root for d in ("[length]", "[mass]", "[time]")))
    return _root(Fraction(quantity.magnitude), root), dim


def _root(value: Fraction, degree: int) -> Fraction:
    """Return the root of a number above zero, exact where it is rational, else to 60 digits."""
    if degree == 1:
        return value
    from sympy import integer_nthroot  # here, since most scenes have no such unit

    n, d, digits = value.numerator, value.denominator, 10**60
    return Fraction(int(integer_nthroot(n * d ** (degree - 1) * digits**degree, degree)[0]), d * digits)


def units() -> list[tuple[str, Fraction, Dimension]]:
    """Return the names of every unit, its exact SI value and its dimension, by dimension and size."""
    names: dict[str, list[str]] = {}
    registry = _registry()
    for name in registry:
        names.setdefault(registry.get_name(name), []).append(name)
    del names["pi"]
    rows = [(", ".join(sorted(of, key=len)), *read_unit(of[0])) for of in names.values()]
    return sorted(rows, key=lambda unit: (*unit[2], unit[1]))


def _not_a_unit(text: str) -> tuple[str, str]:
    return (
        f"{text!r} is not a unit that symgen knows",
        'Write a product of known units, such as "kg*m^2" or "l/(min*bar^(1/2))": "symgen units" lists them.',
    )


def answers() -> str:
    """Return the content of ``units.json``: exact scale and exponents of length, mass and time, by Pint."""
    table = {}
    for unit in COMMON:
        scale, dim = read_unit(unit)
        table[unit] = " ".join(map(str, (scale.numerator, scale.denominator, *dim)))
    return json.dumps(table, indent=1) + "\n"


def describe(dim: Dimension) -> str:
    """Return the name of a dimension for a message, such as ``a length (in m)``."""
    kind = KINDS.get(dim)
    return kind[0] if kind else f"a quantity in {dim.unit}"


def without_angles(unit: str) -> str:
    """Return an SI unit as that of its dimension, without radians."""
    return next((plain for plain, angular in OF_ANGLES.items() if angular == unit), unit)


def describe_unit(unit: str) -> str:
    """Return the name and an example of a quantity in an SI unit for a message."""
    unit = without_angles(unit)
    known = (f"{name} such as {written}" for dim, (name, written) in KINDS.items() if dim.unit == unit)
    return next(known, f"a quantity in {unit}")


def example(dim: Dimension) -> str:
    """Return how a value of this dimension is written."""
    kind = KINDS.get(dim)
    return kind[1] if kind else f'"1 {dim.unit}"'


#: Units in which a scene may show angles.
_ANGLES = ("rad", "deg", "rev")
#: Dimension of each quantity whose unit a scene names.
_DIMENSIONS = {
    "length": LENGTH,
    "force": FORCE,
    "torque": TORQUE,
    "energy": TORQUE,
    "power": POWER,
    "angle": NUMBER,
    "stress": PRESSURE,
}
#: Example of a unit of each quantity, for messages.
_SUCH_AS = {"length": "mm", "force": "kN", "torque": "N*m", "energy": "kJ", "power": "kW", "stress": "MPa"}


def shown_units(table: Any) -> Shown:
    """Return the units that the table ``units`` of a scene names.

    Raises
    ------
    SceneError
        For a text that is no unit, or one of another quantity.
    """
    named = {of: getattr(table, of) for of in _DIMENSIONS}
    return {
        of: _shown_unit(of, text.strip(), _DIMENSIONS[of]) for of, text in named.items() if text is not None
    }


def _shown_unit(of: str, name: str, dim: Dimension) -> tuple[str, float]:
    where = f"units.{of}"
    if of == "angle":
        if name not in _ANGLES:
            raise SceneError(
                f"expected rad, deg or rev, got {name!r}", where=where, hint=nearest(name, _ANGLES)
            )
    elif not name or not is_quantity(f"1 {name}"):
        raise SceneError(f"expected a unit such as {_SUCH_AS[of]!r}, got {name!r}", where=where)
    with at(where):
        size, dimension = parse_quantity(f"1 {name}")
    if dimension != dim:
        raise SceneError(
            f"expected the unit of {describe(dim)}, got {name!r}, {describe(dimension)}",
            where=where,
        )
    return name, float(size)
