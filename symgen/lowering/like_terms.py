"""Collection of like terms in sums, where it reduces the number of operations."""

from __future__ import annotations

from collections.abc import Iterable

from symgen.lowering.expressions import (
    ONE,
    ZERO,
    Constant,
    Negative,
    Node,
    Product,
    add,
    count,
    multiply,
    negative,
)
from symgen.lowering.straight_line import StraightLine

#: Non-numeric factors of a term, sorted by name: like terms share them.
_Key = tuple[Node, ...]


def fewest(line: StraightLine, plus: Iterable[Node], minus: Iterable[Node] = ()) -> Node:
    """Return ``plus`` minus ``minus``, as given or collected, whichever takes fewer operations.

    Names that stand for multiples of others are resolved: 3 x y - 2 x y is one product.
    """
    terms = [*plus, *map(negative, minus)]
    plain, collected = add(terms), _collected(line, terms)
    # If both take equally many, choose the one that does not depend on later assignments.
    return collected if count([collected]).flops <= count([plain]).flops else plain


def _collected(line: StraightLine, terms: Iterable[Node]) -> Node:
    coefficients: dict[_Key, Node] = {}
    for term in terms:
        coefficient, key = _split(line, term)
        coefficients[key] = add([coefficients[key], coefficient]) if key in coefficients else coefficient
    coefficients = {key: c for key, c in coefficients.items() if c != ZERO}
    products = {key: _product(key) for key in coefficients}
    common = {negative(c) if _is_negative(c) else c for c in coefficients.values()}
    if len(common) == 1 and len(products) > 1:
        inner = (
            negative(products[key]) if _is_negative(c) else products[key] for key, c in coefficients.items()
        )
        return multiply(common.pop(), add(inner))
    return add(_multiple(c, key) for key, c in coefficients.items())


def _multiple(coefficient: Node, key: _Key) -> Node:
    if not key:
        return coefficient
    if _is_negative(coefficient):
        return negative(_multiple(negative(coefficient), key))
    factors = key if coefficient == ONE else (coefficient, *key)
    return factors[0] if len(factors) == 1 else Product(factors)


def _product(factors: Iterable[Node]) -> Node:
    product: Node = ONE
    for factor in factors:
        product = multiply(product, factor)
    return product


def _is_negative(coefficient: Node) -> bool:
    return isinstance(coefficient, Constant) and coefficient.text.startswith("-")


def _split(line: StraightLine, term: Node) -> tuple[Node, _Key]:
    """Return the numeric coefficient of a term and its other factors."""
    bare = line.looked_through(term)
    match bare:
        case Constant():
            return bare, ()
        case Negative(value):
            coefficient, key = _split(line, value)
            return negative(coefficient), key
        case Product(factors):
            parts = [_split(line, factor) for factor in factors]
            coefficient = _product(number for number, _ in parts)
            return coefficient, tuple(sorted((name for _, key in parts for name in key), key=str))
    return ONE, (bare,)
