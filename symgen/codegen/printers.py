"""Conversion of expression nodes to text: one class, with one table per language."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Context, Decimal

from symgen.codegen.target import Target
from symgen.errors import DerivationError
from symgen.lowering.expressions import (
    FUNCTIONS,
    GUARDED_INVERSE,
    Call,
    Constant,
    Lookup,
    Negative,
    Node,
    Product,
    Quotient,
    Reference,
    Sum,
    references,
)
from symgen.precision import FLOAT64, Precision

# Precedence of the nodes: a node of lower precedence inside one of higher precedence needs parentheses.
_SUM, _SIGN, _PRODUCT, _ATOM = range(4)
#: Broadcasts a number to a vector, in batched code.
_IN_ALL_LANES = "in_all_lanes"


class ConstantError(DerivationError):
    """A constant of the equations that the number type does not have. Take other units or quantities."""


def rounded(text: str, precision: Precision) -> str:
    """Return a constant rounded to a precision; in double precision with the fewest digits that suffice.

    Raises
    ------
    ConstantError
        For one that overflows, or is lost.
    """
    number, greatest = Decimal(text), Decimal(precision.greatest)
    if number and not 1 / greatest <= abs(number) <= greatest:
        raise ConstantError(
            f"the equations have the constant {number:.3g}, which is beyond the range of {precision.name}"
        )
    if precision.digits <= FLOAT64.digits:
        return repr(float(text))
    digits = str(Context(prec=precision.digits).plus(number))
    return digits if set(digits) & set(".E") else f"{digits}.0"


def _in_c(text: str, precision: Precision) -> str:
    return rounded(text, precision) + precision.literal_suffix


def _in_numpy(text: str, precision: Precision) -> str:
    digits = rounded(text, precision)
    return digits if precision == FLOAT64 else f'_number("{digits}")'


def _in_mpmath(text: str, precision: Precision) -> str:
    return f'_number("{text}")'


@dataclass(frozen=True, slots=True)
class Printer:
    """Converts nodes to text with infix operators.

    Parameters
    ----------
    functions
        Names of functions that differ from their C names.
    precision
        Number type, which determines rounding and suffixes of constants.
    literal
        Function that prints a constant.
    lanes
        Whether values are vectors: a term without references must then be broadcast if it stands alone.
    """

    functions: Mapping[str, str]
    precision: Precision = FLOAT64
    literal: Callable[[str, Precision], str] = _in_c
    lanes: bool = False

    def __call__(self, node: Node) -> str:
        """Return the text of an expression."""
        text = self._print(node, _SUM)
        return f"{_IN_ALL_LANES}({text})" if self.lanes and not references([node]) else text

    def name(self, function: str) -> str:
        """Return the name of a function in the target language."""
        return self.functions.get(function, function + self.precision.function_suffix)

    def _print(self, node: Node, tightness: int) -> str:
        text, binding = self._text(node)
        return f"({text})" if binding < tightness else text

    def _added(self, term: Node) -> str:
        if isinstance(term, Negative):
            return f" - {self._print(term.value, _PRODUCT)}"
        return f" + {self._print(term, _SIGN)}"

    def _text(self, node: Node) -> tuple[str, int]:
        match node:
            case Constant(text):
                return self.literal(text, self.precision), _SIGN if text.startswith("-") else _ATOM
            case Reference(name):
                return name, _ATOM
            case Sum((first, *others)):
                return self._print(first, _SIGN) + "".join(map(self._added, others)), _SUM
            case Product(factors):
                return "*".join(self._print(factor, _ATOM) for factor in factors), _PRODUCT
            case Quotient(numerator, denominator):
                return f"{self._print(numerator, _PRODUCT)}/{self._print(denominator, _ATOM)}", _PRODUCT
            case Negative(value):
                return f"-{self._print(value, _PRODUCT)}", _SIGN
            case Lookup(function, arguments):
                name = f"{function}_lanes" if self.lanes else function
                return f"{name}({', '.join(self(a) for a in arguments)})", _ATOM
            case Call(function, arguments):
                return f"{self.name(function)}({', '.join(self(a) for a in arguments)})", _ATOM
        raise TypeError(f"not a node: {node!r}")


#: Functions defined by the templates, with one name in every language and precision.
C_FUNCTIONS = {GUARDED_INVERSE: GUARDED_INVERSE}
#: Functions of vectors, which the templates define lane by lane.
LANE_FUNCTIONS = {f: f"{f}_lanes" for f in (*FUNCTIONS.values(), "sqrt", "pow", "fmax", GUARDED_INVERSE)}
#: Functions whose names in Python differ from the C library.
PYTHON_FUNCTIONS = C_FUNCTIONS | {
    name: f"_np.{other}"
    for name, other in (
        ("sin", "sin"), ("cos", "cos"), ("tan", "tan"), ("asin", "arcsin"), ("acos", "arccos"),
        ("atan", "arctan"), ("atan2", "arctan2"), ("sinh", "sinh"), ("cosh", "cosh"), ("tanh", "tanh"),
        ("exp", "exp"), ("log", "log"), ("sqrt", "sqrt"), ("fabs", "abs"), ("pow", "power"),
        ("fmax", "maximum"),
    )
}  # fmt: skip
#: Functions whose names in mpmath differ from the C library.
MPMATH_FUNCTIONS = C_FUNCTIONS | {f: f"_mp.{f}" for f in (*FUNCTIONS.values(), "sqrt")} | {"pow": "_mp.power"}
MPMATH_FUNCTIONS |= {"fmax": "max"}


def printer(target: Target) -> Printer:
    """Return the printer of a target."""
    match target.language:
        case "numpy":
            return Printer(PYTHON_FUNCTIONS, target.precision, _in_numpy)
        case "mpmath":
            return Printer(MPMATH_FUNCTIONS, target.precision, _in_mpmath)
    return Printer(LANE_FUNCTIONS if target.lanes else C_FUNCTIONS, target.precision, lanes=target.lanes)
