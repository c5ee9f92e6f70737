"""Statements for the coefficients of one order of power series: see :mod:`symgen.lowering.recurrences`.

Coefficient k of a product is a_0 b_k + a_k b_0 and the sum of a_i b_(k - i) for 0 < i < k; so it is for
functions. All these sums are of orders before: one loop computes them together, with operands side by side,
before the statements for order k.

The rate of a velocity is its next coefficient: accelerations take no products of their own. Velocities, and
what they are made of, are one order ahead: before the solution without the coefficients of a, behind it
complete.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from symgen.lowering.expressions import ZERO, Call, Node, Reference, add, multiply, negative
from symgen.lowering.kernel import Assignment
from symgen.lowering.series import (
    MULTIPLIER,
    SPEED,
    TIME,
    Argument,
    Atom,
    Derivative,
    Function,
    Linear,
    Q,
    Rate,
    Terms,
    Times,
    U,
    Value,
    is_late,
)

#: Rows of coefficients in a kernel: of the present order k; of the next two; of k + 1 or, first, also 0.
AT, NEXT, FAR, ROW = "at", "next", "far", "row"
#: The first row; numbers in a kernel: k + 1; (k + 1) (k + 2); k + 2.
ROWS = "rows"
RATE, AHEAD, NEXT_RATE = map(Reference, ("rate", "ahead", "next_rate"))
#: Loops over the orders, of squares and of products two orders ahead.
SQUARE_AHEAD, PRODUCT_AHEAD = "square_ahead", "product_ahead"
LOOPS = (SQUARE_AHEAD, PRODUCT_AHEAD)


#: Operands side by side begin at a multiple of this, so that vectors of four are within a line of a cache.
ALIGNED = 4


@dataclass(frozen=True, slots=True)
class _Order:
    """The order of statements, by names in the kernel.

    Its row, the sums of products, and the first row, which is zero at order 0; the order as an index, its
    inverse, and the order as a number; 1 at order 0 and else 0; the coefficient of the time.
    """

    row: str
    sums: str
    origin_row: str
    index: Reference
    per: Reference
    number: Reference
    first: Node
    time: Reference


def _order(row: str, sums: str, origin_row: str, *names: str, first: Node) -> _Order:
    index, per, number, time = map(Reference, names)
    return _Order(row, sums, origin_row, index, per, number, first, time)


#: The present order; that ahead, before the solution and behind it.
_PRESENT = _order(AT, "sum", "origin_row", "k", "per", "order", "time", first=Reference("first"))
_BEFORE = _order(
    ROW, "sum_ahead", "row_before", "ahead_k", "row_per", "row_order", "row_time", first=Reference("origin")
)
_BEHIND = _order(NEXT, "sum_ahead", ROWS, "k + 1", "next_per", "rate", "first", first=ZERO)


def place(array: str, index: int) -> Reference:
    """Return an entry of an array."""
    return Reference(f"{array}[{index}]")


def _number(index: int) -> Reference:
    return Reference(str(index))


def _ahead(terms: Terms, sums: Sequence[Linear]) -> list[Atom]:
    """Return the atoms of which the next coefficient is needed, those of derivatives, by their levels."""
    found: dict[Atom, None] = {}
    done: set[Atom] = set()
    waiting = [(a, False) for x in sums for a, _ in x.terms]
    while waiting:
        atom, is_ahead = waiting.pop()
        if atom in found or (atom in done and not is_ahead):
            continue
        done.add(atom)
        if is_ahead:
            found[atom] = None
        pair = [atom.pair] if isinstance(atom, Function) and atom.pair else []
        waiting += ((a, is_ahead or isinstance(atom, Derivative)) for a in (*terms.operands(atom), *pair))
    return sorted(found, key=terms.level)


class CoefficientWriter:
    """Writes statements for the coefficients of the present order.

    Those of a and lambda are unknown until the solution.

    Parameters
    ----------
    terms
        Converts nodes to sums of atoms.
    n, m
        Numbers of coordinates and of multipliers.
    sums
        All sums that it is to write.
    """

    def __init__(self, terms: Terms, n: int, m: int, sums: Sequence[Linear]) -> None:
        self.terms, self.n = terms, n
        self.statements: list[Assignment] = []
        self.placed: list[Atom] = [
            *(Argument(Q, i) for i in range(n)),
            *(Argument(MULTIPLIER, i) for i in range(m)),
        ]
        self.rows: dict[Atom, list[int]] = {atom: [row] for row, atom in enumerate(self.placed)}
        self._order, self._solved = _PRESENT, False
        self._done: set[Atom] = set()
        self._results: dict[Atom, Node] = {}
        self._names: set[str] = set()
        self._ahead = _ahead(terms, sums)
        needed = terms.needed(sums)
        of_present, of_ahead = (
            dict.fromkeys(
                pair for atom in needed if (atom in self._ahead) == is_ahead for pair in terms.pairs(atom)
            )
            for is_ahead in (False, True)
        )
        #: Pairs of rows of which sums of products are taken, of the present order and of that ahead.
        self.pairs, self.pairs_ahead = (
            sorted(pairs, key=lambda pair: terms.number(pair[1])) for pairs in (of_present, of_ahead)
        )
        self._sums: dict[str, dict[tuple[Atom, Atom], int]] = {}
        for order, chosen in ((_PRESENT, self.pairs), (_BEFORE, self.pairs_ahead)):
            for i in (0, 1):
                self._append([pair[i] for pair in chosen], ALIGNED)
            self._sums[order.sums] = {pair: i for i, pair in enumerate(chosen)}

    # -- rows ----------------------------------------------------------------------------------------------

    def _append(self, atoms: Sequence[Atom], aligned: int = 1) -> int:
        """Return the first of new rows side by side for these atoms, at a multiple of ``aligned``."""
        self.placed += [Value("")] * (-len(self.placed) % aligned)
        first = len(self.placed)
        for row, atom in enumerate(atoms, first):
            self.rows.setdefault(atom, []).append(row)
            self.placed.append(atom)
        return first

    def _block(self, atoms: Sequence[Atom]) -> int:
        """Return the first of rows side by side with these atoms."""
        many = len(atoms)
        for first in self.rows.get(atoms[0], ()):
            if self.placed[first : first + many] == list(atoms):
                return first
        return self._append(atoms, ALIGNED)

    def _first(self, array: str, atom: Atom) -> Reference:
        if atom in self._ahead and atom not in self.rows:  # read by statements elsewhere
            self._append([atom])
        return place(array, self.rows[atom][0])

    # -- coefficients --------------------------------------------------------------------------------------

    def _value(self, atom: Atom) -> Node:
        """Return the coefficient of an atom; zero while it is unknown."""
        order = self._order
        match atom:
            case Argument(array, i) if is_late(atom):
                if not self._solved:
                    return ZERO
                late = array == MULTIPLIER
                return place(AT, self.n + i) if late else multiply(AHEAD, place(FAR, i))
            case Argument(array, i) if array == U and order is _PRESENT:
                return multiply(RATE, place(NEXT, i))
            case Argument(array, i) if array == U:
                return (
                    multiply(NEXT_RATE, place(FAR, i))
                    if order is _BEHIND
                    else multiply(order.first, place(NEXT, i))
                )
            case Argument(array) if array == TIME:
                return order.time
            case Argument(array) if array == SPEED:
                return Reference(SPEED)
            case Derivative(of):
                return multiply(RATE, self._first(NEXT, of))
        if self._is_stored(atom):
            return self._first(order.row, atom)
        return self._results[atom]

    def _is_stored(self, atom: Atom) -> bool:
        """Return whether the coefficient is in the row already."""
        if self.terms.is_early(atom):
            return atom in self.rows
        is_before = self._order is _PRESENT or (self._order is _BEHIND and not self.terms.is_of_rates(atom))
        return is_before and atom in self._ahead

    def _at_order(self, x: Linear) -> Node:
        values = [multiply(x.constant, self._order.first), *(multiply(c, self._value(a)) for a, c in x.terms)]
        return add([v for v in values if v != ZERO])

    def _in_row(self, atom: Atom) -> Node:
        """Return the coefficient in any row of a sum of coordinates."""
        if isinstance(atom, Argument):
            return place(ROW, atom.index)
        x = self.terms.named[atom]
        values = [multiply(x.constant, _BEFORE.first), *(multiply(c, self._in_row(a)) for a, c in x.terms)]
        return add([v for v in values if v != ZERO])

    def _new(self, atom: Atom, value: Node) -> None:
        """Name the present coefficient of an atom."""
        if value == ZERO:  # of accelerations and multipliers alone, which are unknown
            self._results[atom] = ZERO
            return
        name = atom.name if isinstance(atom, Value) else ""
        if not name or name in self._names:
            name = f"term{len(self._names)}"
        self._names.add(name)
        self.statements.append(Assignment(name, value))
        self._results[atom] = Reference(name)

    def _store(self, atom: Atom) -> None:
        """Store the present coefficient in all rows of an atom and of its rate.

        Without the part from the solution, the first row is enough: at order 0 products read it.
        """
        value, row = self._value(atom), self._order.row
        if value == ZERO:
            return
        rows = [] if self.terms.is_early(atom) else self.rows.get(atom, [])
        of_rate = self.rows.get(Rate(atom), [])
        if self._is_partial(atom):
            rows, of_rate = rows[:1], []
        self.statements += [Assignment(place(row, i).name, value) for i in rows]
        rate = multiply(self._order.number, value)
        self.statements += [Assignment(place(row, i).name, rate) for i in of_rate]

    def _is_partial(self, atom: Atom) -> bool:
        """Return whether the solution adds to the coefficient, which is then stored again."""
        if self._order is _BEFORE:
            return self.terms.is_of_rates(atom)
        return not self._solved and self.terms.is_of_late(atom)

    def _ensure(self, atom: Atom) -> None:
        """Compute and store the present coefficient of an atom that is known."""
        if atom in self._done or is_late(atom):
            return
        self._done.add(atom)
        is_ahead = atom in self._ahead and self._order is not _BEFORE
        if self._is_stored(atom) and (is_ahead or not self.terms.is_early(atom)):
            return
        if not self._is_stored(atom):
            for a in self.terms.operands(atom):
                self._ensure(a)
            match atom:
                case Value():
                    self._new(atom, self._at_order(self.terms.named[atom]))
                case Times():
                    self._new(atom, self._product(atom))
                case Function():
                    self._new(atom, self._recurrence(atom))
        self._store(atom)

    def _sum(self, pair: tuple[Atom, Atom]) -> Reference:
        return place(self._order.sums, self._sums[self._order.sums][pair])

    def _product(self, atom: Times) -> Node:
        """Return the coefficient of a product, without the part of an unknown coefficient."""
        a, b = atom.first, atom.second
        late, origin = is_late(a), self._order.origin_row
        of_first = multiply(self._first(origin if late else ROWS, a), self._value(b))
        of_last = multiply(self._value(a), self._first(ROWS if late else origin, b))
        return add([self._sum((a, b)), of_first, *([] if of_last == ZERO else [of_last])])

    def _recurrence(self, atom: Function) -> Node:
        """Return the call of the function that computes the present coefficient."""
        arguments: list[Node] = [self._order.index, self._order.per]
        arguments += [self._at_order(x) for x in atom.of]
        arguments += [self._value(x) for x in atom.read]
        arguments += [self._first(ROWS, x) for x in atom.first]
        arguments += [atom.power] if atom.power != ZERO else []
        return Call(f"series_{atom.name}", (*arguments, *(self._sum(pair) for pair in atom.pairs)))

    # -- statements in turn --------------------------------------------------------------------------------

    def two_ahead(self, squares: Mapping[int, Linear]) -> dict[int, Node]:
        """Return what is known of minus the second rates of polynomials of second degree in q."""
        products = list(
            dict.fromkeys(a for x in squares.values() for a, _ in x.terms if isinstance(a, Times))
        )
        results: dict[Times, Node] = {}
        for kind, same in ((SQUARE_AHEAD, True), (PRODUCT_AHEAD, False)):
            chosen = [a for a in products if (a.first == a.second) == same]
            if chosen:
                places = (
                    self._block([a.first for a in chosen]),
                    self._block([a.second for a in chosen]),
                )
                call = Call(kind, tuple(map(_number, (*places, len(chosen)))))
                self.statements.append(Assignment(kind, call))
                results |= {a: place(kind, i) for i, a in enumerate(chosen)}

        def value(x: Linear) -> Node:
            values = [multiply(c, results[a]) for a, c in x.terms if isinstance(a, Times)]
            return negative(multiply(AHEAD, add(values))) if values else ZERO

        return {i: value(x) for i, x in squares.items()}

    def write(self, sums: Sequence[Linear]) -> list[Node]:
        """Write what sums need, level by level; return their coefficients."""
        for atom in self.terms.needed(sums):
            self._ensure(atom)
        for x in sums:
            for a, _ in x.terms:
                self._ensure(a)
        return [self._at_order(x) for x in sums]

    def solved(self) -> list[Assignment]:
        """Return the statements so far: from now on, the coefficients of a and lambda are known."""
        before, self.statements, self._solved = self.statements, [], True
        self._done = {atom for atom in self._done if not self.terms.is_of_late(atom)}
        return before

    def complete_operands(self) -> None:
        """Write the coefficients of operands that depend on those of a and lambda."""
        for atom in [atom.of if isinstance(atom, Rate) else atom for atom in self.rows]:
            if self.terms.is_of_late(atom):
                self._ensure(atom)

    def ahead(self) -> list[Assignment]:
        """Return the statements for sums of coordinates, and for all that is one order ahead."""
        early = [a for a in self.rows if self.terms.is_early(a)]
        rows = self._in_rows(ROW, {a: self._in_row(a) for a in early})
        return rows + self._elsewhere(_BEFORE, self._ahead)

    def behind(self) -> list[Assignment]:
        """Return the statements for a and lambda in rows, and for all that is ahead and depends on them."""
        late = [a for a in self.rows if isinstance(a, Argument) and is_late(a)]
        rows = self._in_rows(AT, {a: self._value(a) for a in late})
        return rows + self._elsewhere(_BEHIND, [a for a in self._ahead if self.terms.is_of_rates(a)])

    def _in_rows(self, row: str, values: Mapping[Atom, Node]) -> list[Assignment]:
        found = []
        for atom, value in values.items():
            first, *others = (place(row, i) for i in self.rows[atom])
            found += [
                Assignment(r.name, x) for r, x in [(first, value), *((r, first) for r in others)] if r != x
            ]
        return found

    def _elsewhere(self, order: _Order, atoms: Sequence[Atom]) -> list[Assignment]:
        """Return the statements for atoms at another order."""
        kept = self.statements, self._done, self._results, self._order
        self.statements, self._done, self._results, self._order = [], set(), {}, order
        for atom in atoms:
            self._ensure(atom)
        written = self.statements
        self.statements, self._done, self._results, self._order = kept
        return written
