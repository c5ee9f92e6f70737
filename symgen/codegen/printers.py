"""Nodes to text: one class, and one table a language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from symgen.codegen.target import PRECISIONS, Precision
from symgen.lowering.nodes import (
    GUARDED_INVERSE,
    Call,
    Constant,
    Negative,
    Node,
    Product,
    Quotient,
    Reference,
    Sum,
)

# How tightly each node binds: a looser one stands in parentheses inside a tighter one.
_SUM, _SIGN, _PRODUCT, _ATOM = range(4)


@dataclass(frozen=True, slots=True)
class Printer:
    """Prints nodes with infix operators.

    Parameters
    ----------
    functions
        Text for each function that is not called by its C name.
    precision
        Rounds and marks the constants.
    """

    functions: Mapping[str, str]
    precision: Precision = PRECISIONS["float64"]

    def __call__(self, node: Node) -> str:
        """Return the text of an expression."""
        return self._print(node, _SUM)

    def _print(self, node: Node, tightness: int) -> str:
        text, own = self._text(node)
        return f"({text})" if own < tightness else text

    def _text(self, node: Node) -> tuple[str, int]:
        match node:
            case Constant(text):
                return self._constant(text), _SIGN if text.startswith("-") else _ATOM
            case Reference(name):
                return name, _ATOM
            case Sum(plus, minus):
                text = " + ".join(self._print(term, _SIGN) for term in plus)
                return text + "".join(f" - {self._print(term, _PRODUCT)}" for term in minus), _SUM
            case Product(factors):
                return "*".join(self._print(factor, _ATOM) for factor in factors), _PRODUCT
            case Quotient(numerator, denominator):
                return f"{self._print(numerator, _PRODUCT)}/{self._print(denominator, _ATOM)}", _PRODUCT
            case Negative(value):
                return f"-{self._print(value, _PRODUCT)}", _SIGN
            case Call(function, arguments):
                name = self.functions.get(function, function + self.precision.function_suffix)
                return f"{name}({', '.join(self(a) for a in arguments)})", _ATOM
        raise TypeError(f"not a node: {node!r}")

    def _constant(self, text: str) -> str:
        return repr(float(text)) + self.precision.literal_suffix


#: What the templates define goes by one name in every language and precision.
C_FUNCTIONS = {GUARDED_INVERSE: GUARDED_INVERSE}
#: Python spells some functions of the C library differently; all others are called by the same name.
PYTHON_FUNCTIONS = C_FUNCTIONS | {
    name: f"_np.{other}"
    for name, other in (
        ("sin", "sin"), ("cos", "cos"), ("tan", "tan"), ("asin", "arcsin"), ("acos", "arccos"),
        ("atan", "arctan"), ("atan2", "arctan2"), ("sinh", "sinh"), ("cosh", "cosh"), ("tanh", "tanh"),
        ("exp", "exp"), ("log", "log"), ("sqrt", "sqrt"), ("fabs", "abs"), ("pow", "power"),
    )
}  # fmt: skip
