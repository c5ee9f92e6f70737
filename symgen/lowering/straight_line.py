"""Shared subexpressions become assignments, in order, only those that a result needs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import sympy as sp
from sympy.simplify.cse_main import tree_cse

from symgen.lowering.kernel import Assignment
from symgen.lowering.nodes import (
    Constant,
    Negative,
    Node,
    Product,
    Reference,
    digits,
    lower,
    negative,
    references,
    rename,
)
from symgen.symbolic.system import System


def fold(expression: sp.Expr) -> sp.Expr:
    """Evaluate every irrational constant inside an expression to 40 digits or more; rationals stay exact."""
    if expression.is_Symbol or expression.is_Rational:
        return expression
    if expression.is_Atom:
        return expression.evalf(digits())
    if not expression.free_symbols:
        return expression if expression.is_Rational else expression.evalf(digits())
    old = expression.args
    new = [fold(a) for a in old]
    return expression if all(a is b for a, b in zip(old, new, strict=True)) else expression.func(*new)


def _definitions(system: System) -> tuple[dict[sp.Symbol, sp.Expr], dict[sp.Symbol, sp.Expr]]:
    """Return what definitions stand for: those that the arguments decide, and those that are numbers."""
    found: dict[sp.Symbol, sp.Expr] = {}
    numbers: dict[sp.Symbol, sp.Expr] = {}
    for definition in system.definitions:
        value = fold(definition.expression.xreplace(numbers))
        (numbers if value.is_number else found)[definition.quantity.symbol] = value
    return found, numbers


class Shared:
    """All matrices of a system over one set of named subexpressions.

    ``values`` holds the named subexpressions, ``entries[name]`` the entries of a matrix, row by row.
    """

    def __init__(self, system: System, names: Sequence[str]) -> None:
        definitions, numbers = _definitions(system)
        expressions = {name: [fold(e.xreplace(numbers)) for e in system[name].matrix] for name in names}
        # Whole subtrees only: the search for common parts of sums and products takes longer than the rest
        # of the lowering, and finds next to nothing where the derivation already names what it shares.
        found, shared = tree_cse(
            [*definitions.values()] + [e for entries in expressions.values() for e in entries],
            sp.numbered_symbols("c", real=True),
            order="none",
        )
        # A shared subexpression that is a definition as a whole goes by the definition's name.
        own: dict[sp.Symbol, str] = {}
        temporaries = {s for s, _ in found}
        for symbol, value in zip(definitions, shared, strict=False):
            if value in temporaries and value not in own:
                own[value] = symbol.name
        titles = {s.name: name for s, name in own.items()}
        # Arguments go by their place in the arrays, which no name that is made here or there can equal.
        for group in system.groups:
            titles.update((x.name, f"{group.name}[{i}]") for i, x in enumerate(group.quantities))
        nodes = (rename(lower(e), titles) for e in shared)
        self.values: dict[str, Node] = {}
        for s, e in found:
            self.values[titles.get(s.name, s.name)] = rename(lower(e), titles)
        for symbol in definitions:
            value = next(nodes)
            if value != Reference(symbol.name):
                self.values[symbol.name] = value
        self.entries = {name: [next(nodes) for _ in entries] for name, entries in expressions.items()}


class StraightLine:
    """Collects assignments on top of shared ones; equal expressions get one name."""

    def __init__(self, shared: Mapping[str, Node] | None = None) -> None:
        self._values: dict[str, Node] = dict(shared or {})
        self._names: dict[Node, Reference] = {}

    def name(self, node: Node, name: str) -> Node:
        """Return an atom, or its negative: the value itself, an earlier assignment of it, or a new one."""
        if isinstance(node, Constant | Reference):
            return node
        if isinstance(node, Negative):
            return negative(self.name(node.value, name))
        known = self._names.get(node)
        if known is None:
            known = self._names[node] = Reference(name)
            self._values[name] = node
        return known

    def looked_through(self, node: Node) -> Node:
        """Return what a name stands for where that is another name or a multiple of one; else the node."""
        while isinstance(node, Reference) and node.name in self._values:
            value = self._values[node.name]
            bare = value.value if isinstance(value, Negative) else value
            if isinstance(bare, Product) and not all(
                isinstance(f, Constant | Reference) for f in bare.factors
            ):
                break
            if not isinstance(bare, Reference | Product):
                break
            node = value
        return node

    def assignments(self, results: Iterable[Node]) -> tuple[Assignment, ...]:
        """Return the assignments that the results need, each after those it reads."""
        done: dict[str, None] = {}
        waiting = [(name, False) for name in reversed(references(results)) if name in self._values]
        while waiting:
            name, ready = waiting.pop()
            if name in done:
                continue
            if ready:
                done[name] = None
                continue
            waiting.append((name, True))
            reads = references([self._values[name]])
            waiting.extend((r, False) for r in reversed(reads) if r in self._values and r not in done)
        return tuple(Assignment(name, self._values[name]) for name in done)
