"""Assignments of shared subexpressions, in order, restricted to those that a result needs."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence

import sympy as sp
from sympy.simplify.cse_main import tree_cse

from symgen.lowering.expressions import (
    ZERO,
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
from symgen.lowering.kernel import Assignment, Block, Kernel, Store
from symgen.symbolic.constants import Substitution, rounded
from symgen.symbolic.system import System


def fold(expression: sp.Expr, known: dict[sp.Expr, sp.Expr] | None = None) -> sp.Expr:
    """Round every irrational constant in an expression to at least 40 digits; rationals stay exact.

    Constants that are added or multiplied are rounded together, so exact cancellation gives zero.
    Exponentials below the range of doubles are zero, as in a kernel that evaluates them. ``known`` are
    results for other expressions, to which this one and its parts are added.
    """
    if expression.is_Symbol or expression.is_Rational:
        return expression
    known = {} if known is None else known
    result = known.get(expression)
    if result is None:
        result = known[expression] = _folded(expression, known)
    return result


def _folded(expression: sp.Expr, known: dict[sp.Expr, sp.Expr]) -> sp.Expr:
    if expression.is_number:
        value = rounded(expression, digits())
        lost = value.is_Float and expression.has(sp.exp) and abs(value) < sys.float_info.min
        return sp.Integer(0) if lost else value
    old = expression.args
    numbers = [a for a in old if a.is_number]
    if all(a.is_Rational for a in numbers) and all(fold(a, known) is a for a in old):
        return expression
    old = _collected(old) if expression.is_Add else old
    if expression.is_Add or expression.is_Mul:
        numbers = [a for a in old if a.is_number]
        if len(numbers) > 1:
            old = (expression.func(*numbers), *(a for a in old if not a.is_number))
    new = [fold(a, known) for a in old]
    same = len(new) == len(expression.args) and all(a is b for a, b in zip(expression.args, new, strict=True))
    return expression if same else expression.func(*new)


def _collected(terms: Sequence[sp.Expr]) -> Sequence[sp.Expr]:
    """Return the terms of a sum, with irrational multiples of the same factors combined."""
    numbers = [[f for f in sp.Mul.make_args(term) if f.is_number] for term in terms]
    if all(f.is_Rational for factors in numbers for f in factors):
        return terms
    alike: dict[sp.Expr, list[int]] = {}
    for i, (term, factors) in enumerate(zip(terms, numbers, strict=True)):
        bare = sp.Mul(*(f for f in sp.Mul.make_args(term) if not f.is_number)) if factors else term
        alike.setdefault(bare, []).append(i)
    return [
        terms[same[0]] if len(same) == 1 else sp.Add(*(sp.Mul(*numbers[i]) for i in same)) * bare
        for bare, same in alike.items()
    ]


def _is_simple(expression: sp.Expr) -> bool:
    """Return whether an expression is a symbol or the negative of one."""
    sign, bare = expression.as_coeff_Mul()
    return bool(bare.is_Symbol and abs(sign) == 1)


#: Size of ``out`` above which zeros are no stores.
ALL_ZEROS = 20_000


class Shared:
    """All matrices of a system over one set of named subexpressions, its constants replaced by their values.

    ``values`` are the named subexpressions, ``rates`` what those are rates of that the derivation states as
    such, ``entries[name]`` the nonzero entries of a matrix by their place in row-major order.
    """

    def __init__(self, system: System, names: Sequence[str]) -> None:
        held = (x.symbol for g in system.groups if g.per_run for x in g.quantities)
        in_numbers = Substitution({c.quantity.symbol: c.expression for c in system.constants}, held)
        known: dict[sp.Expr, sp.Expr] = {}
        definitions: dict[sp.Symbol, sp.Expr] = {}
        for definition in system.definitions:
            exact = in_numbers(definition.expression)
            value = fold(exact, known)
            # Substitute the exact number: after rounding, it would not cancel against others.
            if value.is_number:
                in_numbers.values[definition.quantity.symbol] = value if value.is_Rational else exact
            elif exact is not definition.expression and _is_simple(exact):
                in_numbers.values[definition.quantity.symbol] = exact
            else:
                definitions[definition.quantity.symbol] = value
        expressions: dict[str, dict[int, sp.Expr]] = {}
        for name in names:
            matrix = system[name].matrix
            folded = (
                (i * matrix.cols + j, fold(in_numbers(e), known))
                for (i, j), e in sorted(matrix.todok().items())
            )
            expressions[name] = {place: e for place, e in folded if e != 0}
        # Whole subtrees only: searching for common parts of sums and products takes longer than the rest
        # of the lowering, and finds almost nothing if the derivation already names shared terms.
        replacements, shared = tree_cse(
            [*definitions.values()] + [e for entries in expressions.values() for e in entries.values()],
            sp.numbered_symbols("c", real=True),
            order="none",
        )
        # A shared subexpression that equals a definition keeps the definition's name.
        symbols: dict[sp.Symbol, str] = {}
        temporaries = {s for s, _ in replacements}
        for symbol, value in zip(definitions, shared, strict=False):
            if value in temporaries and value not in symbols:
                symbols[value] = symbol.name
        titles = {s.name: name for s, name in symbols.items()}
        # Arguments are named by their array index, which cannot coincide with any other name.
        for group in system.groups:
            titles.update((x.name, f"{group.name}[{i}]") for i, x in enumerate(group.quantities))
        nodes = (rename(lower(e), titles) for e in shared)
        self.values: dict[str, Node] = {}
        for s, e in replacements:
            self.values[titles.get(s.name, s.name)] = rename(lower(e), titles)
        for symbol in definitions:
            value = next(nodes)
            if value != Reference(symbol.name):
                self.values[symbol.name] = value
        of = ((d.quantity.name, fold(in_numbers(d.rate_of), known)) for d in system.definitions if d.rate_of)
        self.rates = {name: rename(lower(e), titles) for name, e in of if name in self.values}
        self.entries = {name: {place: next(nodes) for place in e} for name, e in expressions.items()}


class StraightLine:
    """Collects assignments on top of shared ones; equal expressions share one name."""

    def __init__(self, shared: Mapping[str, Node] | None = None) -> None:
        self._values: dict[str, Node] = dict(shared or {})
        self._names: dict[Node, Reference] = {}

    def name(self, node: Node, name: str) -> Node:
        """Return the atom of a node, or its negative: the value itself, or an existing or new assignment."""
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
        """Return the definition of a name that stands for another name or its multiple; else the node."""
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
        """Return the assignments that the results need, in order of dependency."""
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

    def kernel(
        self,
        name: str,
        description: str,
        results: Mapping[int, Node],
        blocks: tuple[Block, ...],
        sizes: Mapping[str, int],
        work: Mapping[int, Node] | None = None,
    ) -> Kernel:
        """Return the kernel that stores results in ``out``, and others in ``work``, by their places.

        ``sizes`` are those of the argument arrays. Entries of ``blocks`` that are no results are zero.
        """
        behind = work or {}
        assignments = self.assignments([*results.values(), *behind.values()])
        stores = [Store("work", i, e) for i, e in behind.items()]
        size = sum(rows * columns for rows, columns in (b.shape for b in blocks))
        stored = range(size) if 0 < size <= ALL_ZEROS else results
        stores += [Store("out", i, results.get(i, ZERO)) for i in stored]
        read = {
            r.partition("[")[0]
            for r in references([a.value for a in assignments] + [s.value for s in stores])
            if "[" in r
        }
        inputs = tuple((array, size) for array, size in sizes.items() if array in read)
        return Kernel(name, description, inputs, assignments, tuple(stores), blocks)
