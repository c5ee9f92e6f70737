"""Units and expressions: exact, checked for dimensions, never run as code."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.expressions import FUNCTIONS, parse_any, parse_value
from symgen.scene.units import COMMON, NUMBER, UNITS, answers, dimension, parse_quantity, read_unit

A, B = sp.symbols("a b", real=True)
NAMES = {"a": (A, units.LENGTH), "b": (B, units.LENGTH), "n": (sp.Rational(3), NUMBER)}


@pytest.mark.parametrize(
    "text, value, unit",
    [
        ("2 cm", Fraction(1, 50), "m"),
        ("9.81 m/s^2", Fraction(981, 100), "m/s^2"),
        ("1e-3 kg*m**2", Fraction(1, 1000), "m^2*kg"),
        ("-4 in", Fraction(-4 * 254, 10000), "m"),
        ("1 lbf", Fraction(45359237, 10**8) * Fraction(980665, 10**5), "N"),
        ("12", Fraction(12), "1"),
        ("350 microstrain", Fraction(35, 100000), "1"),
        ("-4/3 ms", Fraction(-4, 3000), "s"),
        ("2/3 1/s", Fraction(2, 3), "1/s"),
        ("3 N*s/m", Fraction(3), "N*s/m"),
        ("5.292 slug/ft^3", None, "kg/m^3"),
        ("3 m^3/(s*Pa^0.5)", Fraction(3), "m^(7/2)/kg^(1/2)"),
        ("1 kPa^(2 / 3)", Fraction(100), "kg^(2/3)/m^(2/3)/s^(4/3)"),
        ("6 l/min", Fraction(1, 10**4), "m^3/s"),
        ("25 mL", Fraction(25, 10**6), "m^3"),
    ],
)
def test_quantities_are_exact(text, value, unit):
    number, dim = parse_quantity(text)
    assert value is None or number == value
    assert dim.unit in (unit, {"kg/m^3": "kg/m^3"}.get(unit, unit))


def test_irrational_roots_of_units_have_sixty_digits():
    """The flow coefficient of a valve: its square is exactly that of 5 l/min over 1 bar, but for round-off."""
    number, dim = parse_quantity("5 l/(min*bar^(1/2))")
    assert abs(number**2 / (Fraction(5, 60000) ** 2 / 10**5) - 1) < Fraction(1, 10**50)
    assert dim == parse_quantity(f"1 {dim.unit}")[1]


def test_rpm_is_a_thirtieth_of_pi():
    number, dim = parse_quantity("30 rpm")
    assert dim == units.ANGULAR_RATE
    assert abs(sp.Rational(number.numerator, number.denominator) - sp.pi).evalf(60) < sp.Float("1e-50")


def test_kept_answers_are_pints():
    assert UNITS.read_text() == answers()
    for unit in COMMON:
        assert parse_quantity(f"1 {unit}") == read_unit(unit)


@pytest.mark.parametrize(
    "text",
    [
        "2 parsec",
        "2 m/",
        "2 m^99",
        "nan m",
        "inf",
        "1e999 m",
        "2 __import__",
        "2 m m m^x",
        "4/0 s",
        "4/3e2 s",
        "4/2.5 s",
        "4/-3 s",
        "x" * 999,
    ],
)
def test_bad_quantities(text):
    with pytest.raises(SceneError):
        parse_quantity(text)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("2*a + b", 2 * A + B),
        ("-a/2", -A / 2),
        ("sqrt(a**2 + b**2)", sp.sqrt(A**2 + B**2)),
        ("a*cos(pi/3)", A / 2),
        ("abs(-a)", sp.Abs(A)),
        ("atan2(a, b)*b", sp.atan2(A, B) * B),
        ("n*a", 3 * A),
    ],
)
def test_expressions(text, expected):
    assert parse_any(text, NAMES)[0] == expected


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "atan", "tanh", "log", "sqrt"])
def test_functions_of_large_constants(name):
    found = float(parse_any(f"{name}(95000)", {})[0])
    assert math.isclose(found, getattr(math, name)(95000), rel_tol=1e-14)


def test_a_vanishing_exponential():
    assert float(parse_any("exp(-800)", {})[0]) == 0.0
    assert math.isclose(float(parse_any("exp(-600)", {})[0]), math.exp(-600), rel_tol=1e-14)


def test_every_function_is_readable():
    for name, (function, count) in FUNCTIONS.items():
        text = f"{name}({', '.join(['0.5'] * count)})"
        assert parse_any(text, {})[0] == function(*[sp.Rational(1, 2)] * count)


@pytest.mark.parametrize(
    "text, message",
    [
        ("open('x')", "calls 'open'"),
        ("__import__('os')", "calls '__import__'"),
        ("a.b", "may not use a.b"),
        ("a[0]", "Subscript"),
        ("lambda: 1", "Lambda"),
        ("[x for x in (1,)]", "ListComp"),
        ("'text'", "Constant"),
        ("True", "Constant"),
        ("a if n else b", "IfExp"),
        ("a + n", "adds a length and a plain number"),
        ("sin(a)", 'gives sin a length .*\n.*Divide it by a quantity with the same unit.* w = "2 cm"'),
        ("atan2(n, a)", "gives atan2 a length"),
        ("c", "unknown name 'c'"),
        ("1/0", "divides by zero"),
        ("0**-1", "divides by zero"),
        ("9**9**9", "at most"),
        ("((9**64)**64)**64", "too large"),
        ("exp(1e9)", "above 700"),
        ("cosh(-701)", "above 700"),
        ("sqrt(-1)", "finite real"),
        ("log(0)", "finite real"),
        ("asin(2)", "finite real"),
        ("2**a", "plain rational"),
        ("sin(1, 2)", "2 arguments instead of 1"),
        ("(" * 300 + "1" + ")" * 300, "cannot read"),
        ("-" * 200 + "1", "nested too deeply"),
        ("2 cm + a", "expressions contain no units, got '2 cm"),
        ("", "cannot read"),
        ("a + 2 cm", "expressions contain no units, got 'a .*\n.*over these names"),
        ("1" * 3000, "fits in double|at most|quantity such as"),
    ],
)
def test_refused_expressions(text, message):
    with pytest.raises(SceneError, match=message):
        parse_any(text, NAMES)


def test_a_unit_is_described_as_an_engineer_says_it():
    assert units.describe_unit("1/s") == 'an angular velocity such as "2 rad/s" or "300 rpm"'
    assert units.describe_unit("m/s^5") == "a quantity in m/s^5"


def test_dimension_is_checked_and_zero_needs_none():
    assert parse_value("0", {}, units.LENGTH) == 0
    for text in ("max(0, a)", "max(a, 0)"):
        assert parse_value(text, NAMES, units.LENGTH).subs(A, 3) == 3
        assert parse_value(text, NAMES, units.LENGTH).subs(A, -3) == 0
    assert parse_value("min(0, 1/a)", NAMES, units.LENGTH.power(Fraction(-1))).subs(A, -4) == Fraction(-1, 4)
    with pytest.raises(SceneError, match="expected a length such as .*, got '3 s', a time"):
        parse_value("3 s", {}, units.LENGTH)


def test_units_of_dimensions():
    assert dimension(1, 1, -2).unit == "N"
    assert dimension(2, 0, 0).unit == "m^2"
    assert dimension(0, 0, -1).unit == "1/s"


@settings(max_examples=300, deadline=2000)
@given(st.one_of(st.text(max_size=40), st.text("ab0123456789.+-*/() ,sincotaqrlgexp_[]{}'", max_size=60)))
def test_any_text_gives_a_value_or_a_scene_error(text):
    try:
        expression, dim = parse_any(text, NAMES)
    except SceneError:
        return
    assert isinstance(expression, sp.Expr)
    assert dim.unit
