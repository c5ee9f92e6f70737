"""Safe expressions: Python's own parser, a short whitelist, and SymPy objects built by hand.

A scene file is data. Nothing in it is ever evaluated as code: the text is parsed to a syntax tree, and
only the node types listed here are turned into SymPy expressions, with dimensions checked on the way.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, NamedTuple, cast

import sympy as sp

from symgen.errors import SceneError, nearest
from symgen.scene.tables.points import Tabulated
from symgen.scene.tables.profiles import PROFILES
from symgen.scene.units import (
    ANGULAR_RATE,
    NUMBER,
    UNITLESS,
    Dimension,
    describe,
    example,
    fits,
    is_quantity,
    parse_quantity,
)
from symgen.symbolic.constants import rounded, vanishes
from symgen.symbolic.switch import Sign, greatest, least, modulo

Value = tuple[sp.Expr, Dimension]


class OfTime(NamedTuple):
    """A named expression of the time, for all expressions that may use the time; None until it is read."""

    value: sp.Expr | None
    dimension: Dimension
    text: str


#: Named values, and tables under their names with brackets, as ``gas()``.
Names = Mapping[str, "Value | Tabulated | OfTime"]

_LONGEST, _DEEPEST = 2000, 60
_LARGEST_POWER, _LARGEST_SYMBOLIC_POWER = 64, 16  # SymPy may expand what holds symbols
_SIMPLE, _DIGITS = 8, 60  # operations that a number keeps, and its digits where it has more
_LARGEST_NUMBER = 1024  # bits: the range of a double
_LARGEST_EXPONENT, _EXPONENTIALS = 700, ("exp", "sinh", "cosh")  # exp(709.8) overflows a double
_HERTZ = re.compile(r"Hz\b|hertz\b")
_TONNES = re.compile(r".*[A-Za-z0-9)]\s*\*\s*t\s*", re.ASCII | re.DOTALL)
_SHOWN = 80  # characters of an expression in a message

#: Functions a scene may call: their SymPy form and number of arguments. All act on plain
#: numbers (angles in radians) and give plain numbers, but for sqrt, abs, sign, min, max, mod and atan2, which
#: see dimensions.
FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    "sin": (sp.sin, 1), "cos": (sp.cos, 1), "tan": (sp.tan, 1),
    "asin": (sp.asin, 1), "acos": (sp.acos, 1), "atan": (sp.atan, 1), "atan2": (sp.atan2, 2),
    "sinh": (sp.sinh, 1), "cosh": (sp.cosh, 1), "tanh": (sp.tanh, 1),
    "exp": (sp.exp, 1), "log": (sp.log, 1), "sqrt": (sp.sqrt, 1), "abs": (sp.Abs, 1),
    "sign": (Sign, 1), "min": (least, 2), "max": (greatest, 2), "mod": (modulo, 2),
}  # fmt: skip


def rational(value: Fraction) -> sp.Rational:
    """Return the exact SymPy number."""
    return sp.Rational(value.numerator, value.denominator)


def parse_value(value: str | int | float, names: Names, expected: Dimension | None = None) -> sp.Expr:
    """Return the exact SI expression of a scene value.

    Parameters
    ----------
    value
        A quantity (``"2 cm"``), an expression over ``names`` (``"2*a + b"``), or a plain number.
    names
        Named values with their dimensions.
    expected
        The dimension it must have; None to accept any.

    Raises
    ------
    SceneError
        When it is not finite, of another dimension, or uses anything outside the whitelist.
    """
    expression, dim = parse_any(value, names)
    if expected == ANGULAR_RATE and is_frequency(value):
        raise SceneError(
            f"expected an angular velocity, got the frequency {value!r}",
            hint='Write revolutions or radians: "2 rev/s", "120 rpm" or "12.6 rad/s".',
        )
    if expected is not None and dim != expected and not (expression == 0 and dim == NUMBER):
        actual = describe(dim)
        raise SceneError(
            f"expected {describe(expected)} such as {example(expected)}, got {value!r}, {actual}",
            hint=tonne_hint(value),
        )
    return expression


def is_frequency(value: str | int | float) -> bool:
    """Return whether a value is a quantity in Hz."""
    return isinstance(value, str) and is_quantity(value) and bool(_HERTZ.search(value))


def tonne_hint(value: str | int | float) -> str:
    """Return the remedy for a wrong dimension where t was probably meant as the time."""
    if isinstance(value, str) and is_quantity(value) and _TONNES.fullmatch(value):
        return (
            't behind a number with a unit is the tonne: name the speed as a parameter and write "speed*t".'
        )
    return ""


def parse_any(value: str | int | float, names: Names) -> Value:
    """Return expression and dimension of a scene value of any dimension; see :func:`parse_value`."""
    if isinstance(value, str):
        if is_quantity(value):
            number, dim = parse_quantity(value)
            return rational(number), dim
        return _Reader(value, names).read()
    if isinstance(value, float) and not math.isfinite(value):
        raise SceneError(f"expected a finite number, got {value!r}")
    exact = Fraction(repr(value)) if isinstance(value, float) else Fraction(value)
    if not fits(exact):
        raise SceneError("expected a number that fits in double precision")
    return rational(exact), NUMBER


def _approximate(expression: sp.Expr) -> sp.Expr | None:
    """Return a number to 15 digits; None if it is not numeric."""
    if expression.free_symbols:
        return None
    return rounded(expression, 15)


def _is_finite(expression: sp.Expr) -> bool:
    """Return whether an expression, if numeric, is real and within the range of a double."""
    if expression.has(sp.nan, sp.zoo, sp.oo, -sp.oo):
        return False
    number = _approximate(expression)
    if number is None:
        return True
    if number.is_Rational:
        return fits(Fraction(int(number.p), int(number.q)))
    return bool(number.is_Float) and math.isfinite(float(number))


def _vanishes(expression: sp.Expr) -> bool:
    """Return whether an expression, if numeric, is zero."""
    return not expression.free_symbols and vanishes(expression)


#: A number with a unit in an expression.
_WITH_UNIT = re.compile(r"(?<![\w.])[0-9.]+\s+[A-Za-zµ]")
#: Names of outputs that follow from the loads, among those of the state.
_FOLLOWING = re.compile(
    r".+\.(force|reaction|tension|torque|couple|acceleration|angular_acceleration)(\.[xyz])?"
)
#: Names of outputs of a load, which have its number, and others that no expression may use.
_OF_LOAD = re.compile(r"\b[A-Za-z_]\w*\.\d+\.[A-Za-z_]\w*")
_OUTPUT = re.compile(r"(?!this\.).+\.(length(_rate)?|power|relative_angle|speed_ratio|\w+_(energy|moment))")
_MOTION = (".x", ".vx", ".angle", ".rate")
#: Parts of names of outputs, and those of the variables of loads in their place.
_MEASURED = {".position.": ".", ".velocity.": ".v", ".angular_velocity": ".rate"}


def _dotted(node: ast.expr) -> str:
    """Return a name with dots, such as ``crank.angle``; empty for an attribute of anything else."""
    words = []
    while isinstance(node, ast.Attribute):
        words.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(words)]) if isinstance(node, ast.Name) else ""


class _Reader:
    def __init__(self, text: str, names: Names) -> None:
        self.text, self.names = text, names
        self.shown = repr(text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}...")

    def read(self) -> Value:
        if len(self.text) > _LONGEST:
            raise SceneError(f"expected an expression of at most {_LONGEST} characters, got {len(self.text)}")
        try:
            tree = ast.parse(self.text.strip(), mode="eval")
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            if of_load := _OF_LOAD.search(self.text):
                raise self.output(of_load[0]) from None
            if _WITH_UNIT.search(self.text):
                raise SceneError(f"expressions contain no units, got {self.shown}", hint=UNITLESS) from None
            raise SceneError(
                f"cannot read {self.shown}",
                hint='Write a quantity with a unit ("2 cm") or an expression over parameters ("2*a + b"); '
                "a quantity in an expression is a parameter of its own.",
            ) from None
        if "^" in self.text:  # here, since Python binds it less than + and -
            raise self.refuse("uses ^, which is for units only", "Write ** for a power.")
        expression, dim = self.node(tree.body, 0)
        return self.finite(expression), dim

    def finite(self, expression: sp.Expr) -> sp.Expr:
        """Refuse infinite and complex numbers, and round intricate ones to 60 digits; zero is zero.

        SymPy may take minutes to derive properties of them that are not needed.
        """
        if not _is_finite(expression):
            raise SceneError(f"expected a finite real value, got {self.shown}")
        if expression.free_symbols or expression.is_Rational:
            return expression
        number = rounded(expression, _DIGITS)
        if number == 0:
            return sp.Integer(0)
        if expression.count_ops() <= _SIMPLE:
            return expression
        if not number.is_Float:
            raise SceneError(f"expected a finite real value, got {self.shown}")
        return sp.Rational(str(number))

    def node(self, node: ast.expr, depth: int) -> Value:
        """Read a node; a long sum or product, which Python nests to the left, is read in a loop."""
        if depth > _DEEPEST:
            raise self.refuse("is nested too deeply")
        chain = []
        while isinstance(node, ast.BinOp):
            chain.append(node)
            node = node.left
        value = self.term(node, depth + 1)
        for step in reversed(chain):
            value = self.operation(value, step.op, self.node(step.right, depth + 1))
        return value

    def term(self, node: ast.expr, depth: int) -> Value:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return parse_any(number, {})
            case ast.Name(id=name):
                return self.named(name)
            case ast.Attribute() if any("." in n for n in self.names) and (name := _dotted(node)):
                return self.named(name)
            case ast.Attribute() if name := _dotted(node):
                raise self.refuse(f"may not use {name}, a quantity of the motion")
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                inner, dim = self.node(operand, depth)
                return -inner, dim
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.node(operand, depth)
            case ast.Call(ast.Attribute(ast.Name("profile"), name), args, []):
                return self.profile(name, [self.node(a, depth) for a in args])
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                known = name in FUNCTIONS or f"{name}()" in self.names
                return self.call(name, [self.node(a, depth) for a in args] if known else [])
        raise self.refuse(f"uses {type(node).__name__}, which is not allowed in a scene")

    def operation(self, left: Value, op: ast.operator, right: Value) -> Value:
        (a, da), (b, db) = left, right
        match op:
            case ast.Add() | ast.Sub():
                if da != db:
                    raise self.refuse(f"adds {describe(da)} and {describe(db)}")
                return (a + b if isinstance(op, ast.Add) else a - b), da
            case ast.Mult():
                return a * b, da.times(db)
            case ast.Div():
                if _vanishes(b):
                    raise self.refuse("divides by zero")
                return a / b, da.times(db.power(Fraction(-1)))
            case ast.Pow():
                return self.power(left, right)
        raise self.refuse(f"uses {type(op).__name__}, which is not allowed in a scene")

    def named(self, name: str) -> Value:
        if name == "pi":
            return sp.pi, NUMBER
        if name not in self.names:
            words = [
                known
                for known, value in self.names.items()
                if not (known.endswith("()") or (isinstance(value, OfTime) and value.value is None))
            ]  # without the law that is being read
            alike = [known for known in words if ("." in known) == ("." in name)]
            if alike and _FOLLOWING.fullmatch(name):
                raise SceneError(
                    f"{self.shown} uses {name!r}, a force or an acceleration: it may use positions and "
                    "velocities alone",
                    hint="Take a typical force as a parameter, as in a couple mu*radius*load of friction "
                    "in a joint, or compute the load in a function around model.rhs.",
                )
            if alike and _OUTPUT.fullmatch(name):
                raise self.output(name)
            measured = name
            for output, variable in _MEASURED.items():
                measured = measured.replace(output, variable)
            hint = nearest(measured if measured in alike else name, alike)
            raise SceneError(f"{self.shown} uses the unknown name {name!r}", hint=hint)
        value = self.names[name]
        if isinstance(value, OfTime) and (value.value is None or "t" not in self.names):
            raise self.refuse(f"uses {name}, an expression of the time t, where a constant is expected")
        return cast("Value", value[:2])

    def output(self, name: str) -> SceneError:
        """Return the error of an expression with the name of an output; its remedy: names of the motion."""
        motion = [n for end in _MOTION for n in [m for m in self.names if m.endswith(end)][:1]]
        if not motion:
            return self.refuse(f"may not use {name}, an output")
        return SceneError(
            f"{self.shown} uses {name!r}, an output, which no expression may use",
            hint=f"Of the motion it may use names such as {', '.join(motion)}; a length is "
            "sqrt((A.x - B.x)**2 + (A.y - B.y)**2) of two points A and B.",
        )

    def power(self, base: Value, exponent: Value) -> Value:
        (a, da), (b, db) = base, exponent
        if db != NUMBER or not b.is_Rational or abs(b) > _LARGEST_POWER:
            raise self.refuse(f"may only raise to a plain rational number of at most {_LARGEST_POWER}")
        a = self.finite(a)
        power = abs(a.exp * b) if a.is_Pow and a.exp.is_Rational else abs(b)
        if a.free_symbols and power > _LARGEST_SYMBOLIC_POWER:
            raise self.refuse(f"raises a parameter to more than the power {_LARGEST_SYMBOLIC_POWER}")
        if b < 0 and _vanishes(a):
            raise self.refuse("divides by zero")
        if a.is_Rational and max(int(a.p).bit_length(), int(a.q).bit_length()) * abs(b) > _LARGEST_NUMBER:
            raise self.refuse("gives a number too large for double precision")
        return self.finite(a**b), da.power(Fraction(int(b.p), int(b.q)))

    def call(self, name: str, arguments: list[Value]) -> Value:
        if isinstance(table := self.names.get(f"{name}()"), Tabulated):
            return self.look_up(name, table, arguments)
        if name not in FUNCTIONS:
            tables = (n.removesuffix("()") for n in self.names if n.endswith("()"))
            hint = nearest(name, (*FUNCTIONS, *tables))
            raise self.refuse(f"calls {name!r}, which is not a function here", hint)
        function, count = FUNCTIONS[name]
        if len(arguments) != count:
            raise self.refuse(f"gives {name} {len(arguments)} arguments instead of {count}")
        dims = [dim for _, dim in arguments]
        if name in ("min", "max"):  # zero needs no unit
            others = reversed(dims)
            dims = [b if x == 0 and a == NUMBER else a for (x, a), b in zip(arguments, others, strict=True)]
        if name in ("min", "max", "mod") and dims[0] != dims[1]:
            raise self.refuse(f"gives {name} {describe(dims[0])} and {describe(dims[1])}")
        if name == "mod":
            period = _approximate(arguments[1][0])
            if period is None or not period > 0:
                hint = (
                    "The period is a constant: no tunable parameter, nothing that varies in time. For a "
                    "tunable period T write mod(t/T, 1)*T in place of mod(t, T)."
                )
                raise self.refuse("divides in mod by what is not a number above zero", hint)
        if name in ("abs", "min", "max", "mod"):
            result = dims[0]
        elif name == "sign":
            result = NUMBER
        elif name == "sqrt":
            result = dims[0].power(Fraction(1, 2))
        else:  # every argument a plain number, or atan2 of two alike
            same = name == "atan2" and dims[0] == dims[1]
            wrong = None if same else next((dim for dim in dims if dim != NUMBER), None)
            if wrong:
                raise self.refuse(
                    f"gives {name} {describe(wrong)} instead of a plain number or an angle",
                    "Divide it by a quantity with the same unit, such as a parameter "
                    f"w = {example(wrong).split(' or ')[0]}.",
                )
            result = NUMBER
        values = [self.finite(argument) for argument, _ in arguments]
        for argument in values:
            number = _approximate(argument) if name in _EXPONENTIALS else None
            if number is not None and (number if name == "exp" else abs(number)) > _LARGEST_EXPONENT:
                raise self.refuse(f"gives {name} a number above {_LARGEST_EXPONENT}")
        return self.finite(function(*values)), result

    def profile(self, name: str, arguments: list[Value]) -> Value:
        if name not in PROFILES:
            hint = nearest(name, PROFILES)
            raise self.refuse(f"calls {f'profile.{name}'!r}, which is not a profile of motion", hint)
        if len(arguments) != 1 or arguments[0][1] != NUMBER:
            raise self.refuse(
                f"expects one plain number in profile.{name}",
                "Its variable rises from 0 to 1: divide the time by a duration, as in (t - begin)/lasts.",
            )
        return self.finite(PROFILES[name](self.finite(arguments[0][0]))), NUMBER

    def look_up(self, name: str, table: Tabulated, arguments: list[Value]) -> Value:
        if len(arguments) != 1:
            raise self.refuse(f"gives {name} {len(arguments)} arguments instead of 1")
        ((x, dimension),) = arguments
        if dimension != table.of:
            raise self.refuse(f"gives the table {name} {describe(dimension)} instead of {describe(table.of)}")
        return self.finite(table.pieces.at(self.finite(x))), table.gives

    def refuse(self, reason: str, hint: str = "") -> SceneError:
        return SceneError(f"the expression {self.shown} {reason}", hint=hint)
