"""Expression nodes of a straight-line program: plain data, printed identically by every backend.

Printing and counting use the same tree, so operation counts are exact.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from decimal import Context, Decimal

import sympy as sp

from symgen.errors import DerivationError
from symgen.symbolic.constants import rounded
from symgen.symbolic.switch import PieceFunction, PieceNumbers, PiecewisePolynomial, Sign

#: Default number of digits of constants, and the number of extra digits beyond those set by :func:`keeping`.
DIGITS = 40
#: Trailing digits in which rounded constants that should cancel may differ.
_CANCELLED = 3
_digits: ContextVar[int] = ContextVar("digits", default=DIGITS)


@contextmanager
def keeping(count: int) -> Iterator[None]:
    """Keep at least ``count`` digits of every constant lowered inside the block."""
    before = _digits.set(max(DIGITS, count))
    try:
        yield
    finally:
        _digits.reset(before)


def digits() -> int:
    """Return the current number of digits of constants."""
    return _digits.get()


def _exact() -> Context:
    return Context(prec=digits() + 5)


@dataclass(frozen=True, slots=True)
class Constant:
    """A number as decimal text of at most 40 significant digits; each precision rounds it once."""

    text: str


@dataclass(frozen=True, slots=True)
class Reference:
    """An argument or an earlier assignment, by name."""

    name: str


@dataclass(frozen=True, slots=True)
class Sum:
    """A sum of two or more terms, from left to right; a :class:`Negative` after the first is subtracted."""

    terms: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Product:
    """A product of two or more factors, from left to right."""

    factors: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Quotient:
    """A quotient."""

    numerator: Node
    denominator: Node


@dataclass(frozen=True, slots=True)
class Negative:
    """A change of sign."""

    value: Node


@dataclass(frozen=True, slots=True)
class Call:
    """A mathematical function, by its C name for double precision."""

    function: str
    arguments: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Lookup(Call):
    """A function of the pieces of a table: of (argument, branch) the piece, or of a piece its number."""

    column: PieceNumbers


Node = Constant | Reference | Sum | Product | Quotient | Negative | Call

#: Threshold of the sign function: smaller numbers have sign zero, larger ones exactly 1 or -1 in every type.
LEAST_SIGNED = "1e-30"
#: Supported SymPy functions, and their C names.
FUNCTIONS: dict[type, str] = {
    sp.sin: "sin", sp.cos: "cos", sp.tan: "tan", sp.asin: "asin", sp.acos: "acos", sp.atan: "atan",
    sp.atan2: "atan2", sp.sinh: "sinh", sp.cosh: "cosh", sp.tanh: "tanh", sp.exp: "exp", sp.log: "log",
    sp.Abs: "fabs",
}  # fmt: skip


def constant(value: sp.Expr) -> Constant:
    """Return a number with 40 significant digits; exactly zero and integer one are recognised."""
    if value.is_Integer and abs(value) < 10**15:
        return Constant(str(int(value)))
    number = sp.Float(value, digits()) if value.is_Rational else rounded(value, digits())
    if number == 0:
        return ZERO
    if not number.is_Float:
        raise DerivationError(f"expected a finite real constant, got {value}")
    return Constant(sp.printing.StrPrinter({"full_prec": False}).doprint(number))


def lower(expression: sp.Expr) -> Node:
    """Convert a SymPy expression to a node."""
    if expression.is_Symbol:
        return Reference(expression.name)
    if not expression.args or expression.is_number:
        return constant(expression)
    if expression.is_Add:
        return _sum(expression)
    if expression.is_Mul:
        return _product(expression)
    if expression.is_Pow:
        return _product(expression)
    if expression.func in (Sign, sp.sign):
        value = lower(expression.args[0])
        return Quotient(value, Call("fmax", (Call("fabs", (value,)), Constant(LEAST_SIGNED))))
    if isinstance(expression, PiecewisePolynomial):
        return lower(expression.in_terms)
    if isinstance(expression, PieceFunction):
        name = f"table_{expression.func.__name__}_{expression.column.digest}"  # names may be equal
        return Lookup(name, tuple(map(lower, expression.args)), expression.column)
    function = FUNCTIONS.get(expression.func)
    if function is None:
        raise DerivationError(f"no kernel function for {expression.func.__name__}")
    return Call(function, tuple(lower(a) for a in expression.args))


def _below_zero(number: sp.Expr) -> bool:
    # SymPy answers is_negative from its assumptions, in twenty times the time of a comparison.
    return bool(number.p < 0 if number.is_Rational else number.is_Float and number < 0)


def _sum(expression: sp.Expr) -> Node:
    plus: list[Node] = []
    minus: list[Node] = []
    for term in expression.args:
        coefficient, _ = term.as_coeff_Mul()
        if _below_zero(coefficient):
            minus.append(lower(-term))
        else:
            plus.append(lower(term))
    if not plus:
        return Negative(Sum(tuple(minus)) if len(minus) > 1 else minus[0])
    return Sum((*plus, *map(Negative, minus)))


def _product(expression: sp.Expr) -> Node:
    coefficient, rest = expression.as_coeff_Mul()
    if _below_zero(coefficient):
        inner = lower(-expression)
        return Constant(f"-{inner.text}") if isinstance(inner, Constant) else Negative(inner)
    above: list[Node] = []
    below: list[Node] = []
    if coefficient != 1:
        above.append(constant(coefficient))
    for factor in sp.Mul.make_args(rest):
        base, exponent = factor.as_base_exp() if factor.is_Pow else (factor, sp.Integer(1))
        inverse = exponent.is_Rational and exponent.p < 0
        (below if inverse else above).extend(_power(base, -exponent if inverse else exponent))
    numerator = _join(above)
    return Quotient(numerator, _join(below)) if below else numerator


def _power(base: sp.Expr, exponent: sp.Expr) -> list[Node]:
    if not exponent.is_Rational or exponent.q not in (1, 2):
        return [Call("pow", (lower(base), lower(exponent)))]
    node = lower(base)
    factors: list[Node] = [node] * int(exponent.p // exponent.q)
    if exponent.q == 2:
        factors.append(Call("sqrt", (node,)))
    return factors


def _join(factors: list[Node]) -> Node:
    if not factors:
        return Constant("1")
    return factors[0] if len(factors) == 1 else Product(tuple(factors))


ZERO, ONE = Constant("0"), Constant("1")


def add(plus: Iterable[Node], minus: Iterable[Node] = ()) -> Node:
    """Return ``plus`` minus ``minus``, with constants folded and signs absorbed."""
    known, largest = Decimal(0), Decimal(0)
    above: list[Node] = []
    below: list[Node] = []
    for terms, sign, same, other in ((plus, 1, above, below), (minus, -1, below, above)):
        for term in terms:
            if isinstance(term, Constant):
                value = Decimal(term.text)
                known = _exact().add(known, value if sign > 0 else value.copy_negate())
                largest = max(largest, abs(value))
            elif isinstance(term, Negative):
                other.append(term.value)
            else:
                same.append(term)
    if abs(known) > largest.scaleb(_CANCELLED - digits()):  # a smaller sum is rounding error of a zero
        (above if known > 0 or not above else below).insert(
            0, _decimal(known if known > 0 or not above else known.copy_negate())
        )
    if not above:
        return negative(add(below)) if below else ZERO
    return above[0] if len(above) == 1 and not below else Sum((*above, *map(Negative, below)))


def less(start: Node, terms: Iterable[Node]) -> Node:
    """Return ``start`` minus all terms, in order; terms that become available last should come last."""
    signed = [negative(term) for term in terms]
    if start != ZERO:
        signed.insert(0, start)
    first, *others = signed or [ZERO]
    if not others:
        return first
    if isinstance(first, Negative):
        return Negative(Sum((first.value, *map(negative, others))))
    return Sum((first, *others))


def multiply(a: Node, b: Node) -> Node:
    """Return the product of two nodes, with constants folded and signs factored out."""
    if isinstance(a, Negative) or isinstance(b, Negative):
        bare = multiply(*(x.value if isinstance(x, Negative) else x for x in (a, b)))
        return bare if isinstance(a, Negative) and isinstance(b, Negative) else negative(bare)
    if isinstance(a, Constant) and isinstance(b, Constant):
        return _decimal(_exact().multiply(Decimal(a.text), Decimal(b.text)))
    for x, y in ((a, b), (b, a)):
        if x == ZERO:
            return ZERO
        if x == ONE:
            return y
        if isinstance(x, Constant) and x.text.startswith("-"):
            return negative(multiply(negative(x), y))
    return Product((a, b))


def reciprocal(a: Node) -> Node:
    """Return the reciprocal of a node."""
    if isinstance(a, Constant):
        return _decimal(_exact().divide(Decimal(1), Decimal(a.text)))
    return negative(reciprocal(a.value)) if isinstance(a, Negative) else Quotient(ONE, a)


#: The function defined by the templates in addition to the mathematical library.
GUARDED_INVERSE = "guarded_inverse"


def guarded_reciprocal(pivot: Node, sound: Node, tolerance: Node) -> Node:
    """Return the reciprocal of a pivot, or zero if it is at most ``tolerance`` times its sound part."""
    return Call(GUARDED_INVERSE, (pivot, sound, tolerance))


def negative(a: Node) -> Node:
    """Return a node with its sign changed."""
    if isinstance(a, Constant):
        return _decimal(Decimal(a.text).copy_negate())  # '-' would round to the default context's 28 digits
    return a.value if isinstance(a, Negative) else Negative(a)


def _decimal(value: Decimal) -> Constant:
    rounded = Context(prec=digits()).plus(value)
    return Constant(
        str(int(rounded))
        if rounded == rounded.to_integral_value() and abs(rounded) < 10**15
        else str(rounded)
    )


def signs(node: Sum) -> tuple[int, ...]:
    """Return the sign of each term of a sum: -1 if it is subtracted."""
    return (1, *(-1 if isinstance(term, Negative) else 1 for term in node.terms[1:]))


KINDS = ("add", "mul", "div", "neg", "call")


@dataclass(frozen=True, slots=True)
class OperationCount:
    """Operations of a program by kind; additions include subtractions."""

    add: int = 0
    mul: int = 0
    div: int = 0
    neg: int = 0
    call: int = 0

    @property
    def flops(self) -> int:
        """Floating-point operations: all kinds except changes of sign, which cost a bit flip."""
        return self.add + self.mul + self.div + self.call

    def __add__(self, other: OperationCount) -> OperationCount:
        return OperationCount(*(getattr(self, k) + getattr(other, k) for k in KINDS))

    def __str__(self) -> str:
        parts = (f"{getattr(self, k)} {k}" for k in KINDS if getattr(self, k))
        return f"{self.flops} operations ({', '.join(parts)})" if self.flops or self.neg else "0 operations"


def children(node: Node) -> tuple[Node, ...]:
    """Return the operands of a node in printing order."""
    # Patterns of `match` take three times as long, and programs have hundreds of thousands of nodes.
    if isinstance(node, Product):
        return node.factors
    if isinstance(node, Sum):
        first, *others = node.terms
        return (first, *[term.value if isinstance(term, Negative) else term for term in others])
    if isinstance(node, Negative):
        return (node.value,)
    if isinstance(node, Quotient):
        return node.numerator, node.denominator
    return node.arguments if isinstance(node, Call) else ()


def rename(node: Node, names: Mapping[str, str]) -> Node:
    """Return a node with some referenced names replaced."""
    return _mapped(node, lambda name: Reference(names.get(name, name)))


def insert(node: Node, values: Mapping[str, Node]) -> Node:
    """Return a node with some referenced names replaced by expressions."""
    return _mapped(node, lambda name: values[name] if name in values else Reference(name))


def _mapped(node: Node, read: Callable[[str], Node]) -> Node:
    def all_of(nodes: tuple[Node, ...]) -> tuple[Node, ...]:
        return tuple(_mapped(n, read) for n in nodes)

    match node:
        case Reference(name):
            return read(name)
        case Sum(terms):
            return Sum(all_of(terms))
        case Product(factors):
            return Product(all_of(factors))
        case Quotient(numerator, denominator):
            return Quotient(_mapped(numerator, read), _mapped(denominator, read))
        case Negative(value):
            return Negative(_mapped(value, read))
        case Call(arguments=arguments):
            return replace(node, arguments=all_of(arguments))
    return node


def count(nodes: Iterable[Node]) -> OperationCount:
    """Count the operations of expressions."""
    terms: Counter[type] = Counter()
    operands: Counter[type] = Counter()
    waiting = list(nodes)
    while waiting:
        node = waiting.pop()
        if isinstance(node, Reference | Constant):
            continue
        parts = children(node)
        waiting.extend(parts)
        terms[type(node)] += 1
        operands[type(node)] += len(parts)
    add, mul = (operands[kind] - terms[kind] for kind in (Sum, Product))
    return OperationCount(add, mul, terms[Quotient], terms[Negative], terms[Call] + terms[Lookup])


def references(nodes: Iterable[Node]) -> list[str]:
    """Return the names read by expressions, without repetition, in order of first use."""
    names: dict[str, None] = {}
    waiting = list(nodes)[::-1]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Reference):
            names[node.name] = None
        elif not isinstance(node, Constant):
            waiting.extend(children(node)[::-1])
    return list(names)
