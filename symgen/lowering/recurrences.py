"""The kernels of power series in time of a motion.

The kernel ``sides`` is called for the orders k = 0, 1, 2, ... of one step in turn. It returns coefficient k
of the right-hand side of [M J^T; J 0] [a; lambda] = [f; gamma], with those of a and lambda of order k still
zero. The matrix at the beginning of the step is that of all orders: ``solve`` gives coefficient k of a and
lambda, and by it coefficient k + 2 of q. Then ``along`` returns coefficient k of further quantities: the
power, and what a run watches.

Each order has a row of coefficients: those of q, those of lambda, and the operands of products and functions.
Operands of products are side by side: one loop over the orders computes all products that do not depend on
each other, several in one instruction.

A length constraint is a polynomial of second degree in q: the second rate of its coefficient k + 2 takes half
the products of gamma - J a, and leaves no error of lower order in the constraint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from symgen.errors import DerivationError
from symgen.lowering.expressions import (
    ZERO,
    Call,
    Constant,
    Node,
    Reference,
    add,
    multiply,
    negative,
    references,
)
from symgen.lowering.kernel import Assignment, Block, SeriesKernel, Store
from symgen.lowering.series import (
    ACCELERATION,
    MULTIPLIER,
    TIME,
    Argument,
    Atom,
    Function,
    Linear,
    Q,
    Terms,
    Times,
    U,
    Value,
    is_late,
    total,
    unit,
)

#: Rows of coefficients in a kernel: of the present order k, the next two, the one before; and of k or k + 1.
AT, NEXT, FAR, BACK, ROW = "at", "next", "far", "back", "row"
#: Numbers in a kernel: the time's coefficient; 1 at order 0 and else 0, of the present order and of the row;
#: k + 1; (k + 1) (k + 2); k (k + 1).
TIME_NOW, FIRST, ORIGIN, RATE, AHEAD, BEHIND = map(
    Reference, ("time", "first", "origin", "rate", "ahead", "behind")
)
#: Loops over the orders: of products with an unknown coefficient of the present order; of products; of
#: squares; of squares and of products two orders ahead.
LATE, NOW, SQUARE, SQUARE_AHEAD, PRODUCT_AHEAD = "late", "now", "square", "square_ahead", "product_ahead"
LOOPS = (LATE, NOW, SQUARE, SQUARE_AHEAD, PRODUCT_AHEAD)


def _place(array: str, index: int) -> Reference:
    return Reference(f"{array}[{index}]")


def _number(index: int) -> Reference:
    return Reference(str(index))


@dataclass(frozen=True, slots=True)
class EquationsOfMotion:
    """Equations of motion [M J^T; J 0] [a; lambda] = [f; gamma] with constraints Phi.

    Parameters
    ----------
    values
        Named terms.
    n, m
        Numbers of coordinates and of constraints.
    mass, jacobian
        Entries of M and J that are not zero.
    sides
        Entries of f, and behind them of gamma.
    constraints
        Entries of Phi.
    power
        The power of loads without potential, if it is integrated.
    watched
        Further quantities whose series are wanted.
    parameters
        Number of parameters.
    """

    values: Mapping[str, Node]
    n: int
    m: int
    mass: Mapping[tuple[int, int], Node]
    jacobian: Mapping[tuple[int, int], Node]
    sides: Mapping[int, Node]
    constraints: Mapping[int, Node]
    power: Node | None
    watched: Sequence[Node]
    parameters: int


def lower_series(e: EquationsOfMotion) -> list[SeriesKernel]:
    """Return the kernel ``sides``, and ``along`` if there are further quantities.

    What is watched has no series if one of its functions has no recurrence.

    Raises
    ------
    DerivationError
        For a function without a recurrence.
    """
    n, terms = e.n, Terms(e.values, e.n)
    squares = {i: x for i, phi in e.constraints.items() if terms.quadratic(x := terms.of(phi))}
    sums = {i: [terms.of(e.sides.get(i, ZERO))] for i in range(n + e.m) if i - n not in squares}

    def subtract(row: int, factor: Node, array: str, i: int) -> None:
        if row in sums:
            product = terms.times(terms.of(factor), unit(Argument(array, i)))
            sums[row].append(product.scaled(Constant("-1")))

    for (i, j), factor in e.mass.items():
        subtract(i, factor, ACCELERATION, j)
    for (i, j), factor in e.jacobian.items():
        subtract(j, factor, MULTIPLIER, i)
        subtract(n + i, factor, ACCELERATION, j)
    writer = _Writer(terms, e)
    found = writer.two_ahead({n + i: x for i, x in squares.items()})
    found |= dict(zip(sums, writer.write([total(x) for x in sums.values()]), strict=True))
    behind = _Writer(terms, e, writer)
    powers, watched = [] if e.power is None else [terms.of(e.power)], list[Linear]()
    with suppress(DerivationError):
        watched = [terms.of(x) for x in e.watched]
    along = behind.write([*powers, *watched])
    rows = len(behind.placed) + len(along)
    about = "coefficient of the right-hand side of the equations of motion"
    out = [found[i] for i in range(n + e.m)]
    kernels = [_kernel("sides", about, writer.complete(), out, rows, e, len(watched))]
    if along:
        about = "coefficient of the power of loads without potential" if powers else "coefficient"
        about += (" and" if powers else "") + " of what a run watches" if watched else ""
        kernels.append(_kernel("along", about, behind.statements, along, rows, e, len(watched)))
    return kernels


def _kernel(
    name: str,
    about: str,
    statements: Sequence[Assignment],
    out: Sequence[Node],
    rows: int,
    e: EquationsOfMotion,
    watched: int,
) -> SeriesKernel:
    read = references([*(a.value for a in statements), *out])
    inputs = [("t", 2)] + ([("p", e.parameters)] if any(x.startswith("p[") for x in read) else [])
    stores = tuple(Store("out", i, x) for i, x in enumerate(out))
    block = Block(name, 0, (len(out), 1), "1", about)
    return SeriesKernel(
        name,
        about,
        tuple(inputs),
        tuple(statements),
        stores,
        (block,),
        rows=rows,
        coordinates=e.n,
        watched=watched,
    )


class _Writer:
    """Writes statements for the coefficients of the present order.

    Those of a and lambda are unknown to the first writer, and known to one that has another ``before`` it,
    whose rows it reads.
    """

    def __init__(self, terms: Terms, e: EquationsOfMotion, before: _Writer | None = None) -> None:
        self.terms, self.before = terms, before
        self.statements: list[Assignment] = []
        self.rows: dict[Atom, list[int]] = {}
        self.results: dict[tuple[str, Atom], Node] = {}
        self._done: set[Atom] = set()
        first = [*(Argument(Q, i) for i in range(e.n)), *(Argument(MULTIPLIER, i) for i in range(e.m))]
        self.placed: list[Atom | None] = list(first)
        if before:
            # Copies of a and lambda are those up to the order before.
            copies = before.placed[len(first) :]
            self.placed += [None if a is None or is_late(a) else a for a in copies]
        for row, atom in enumerate(self.placed):
            if atom is not None:
                self.rows.setdefault(atom, []).append(row)

    def _is_unknown(self, atom: Atom) -> bool:
        return self.before is None and is_late(atom)

    def _is_stored(self, atom: Atom) -> bool:
        """Return whether the writer before has stored the coefficient of the present order."""
        return self.before is not None and atom in self.before.rows and not is_late(atom)

    # -- rows --------------------------------------------------------------------------------------------

    def _block(self, atoms: Sequence[Atom]) -> int:
        """Return the first of rows side by side with these atoms."""
        many = len(atoms)
        for first in self.rows.get(atoms[0], ()):
            if self.placed[first : first + many] == list(atoms):
                return first
        first = len(self.placed)
        for row, atom in enumerate(atoms, first):
            self.rows.setdefault(atom, []).append(row)
            self.placed.append(atom)
        return first

    def _row(self, atom: Atom) -> Reference:
        return _number(self._block([atom]))

    # -- coefficients ------------------------------------------------------------------------------------

    def _value(self, atom: Atom) -> Node:
        """Return the coefficient of the present order of an atom; zero while it is unknown."""
        match atom:
            case _ if self._is_unknown(atom):
                return ZERO
            case Argument(array, i) if array == U:
                return multiply(RATE, _place(NEXT, i))
            case Argument(array, i) if array == ACCELERATION:
                return multiply(AHEAD, _place(FAR, i))
            case Argument(array) if array == TIME:
                return TIME_NOW
            case Times() if not self._is_stored(atom):
                return self.results[self._loop_of(atom), atom]
            case Value(name) if not (self._is_stored(atom) or self._is_ahead(atom)):
                return Reference(name)
        return _place(AT, self.rows[atom][0])

    def _is_ahead(self, atom: Atom) -> bool:
        """Return whether the coefficient of the present order was stored at the order before."""
        return self.before is None and atom in self.rows and self.terms.is_early(atom)

    def _at_order(self, x: Linear) -> Node:
        values = [multiply(x.constant, FIRST), *(multiply(c, self._value(a)) for a, c in x.terms)]
        return add([v for v in values if v != ZERO])

    def _in_row(self, atom: Atom, *, stored: bool = True) -> Node:
        """Return the coefficient in any row of a sum of coordinates."""
        if stored and atom in self.rows:
            return _place(ROW, self.rows[atom][0])
        x = self.terms.named[atom]
        values = [multiply(x.constant, ORIGIN), *(multiply(c, self._in_row(a)) for a, c in x.terms)]
        return add([v for v in values if v != ZERO])

    # -- statements --------------------------------------------------------------------------------------

    def _assign(self, target: Reference, value: Node) -> None:
        if value != target:
            self.statements.append(Assignment(target.name, value))

    def _store(self, atom: Atom) -> None:
        """Store the present coefficient in the rows of an atom that this writer has."""
        written = len(self.before.placed) if self.before else 0
        value = self._value(atom)
        for row in self.rows.get(atom, ()):
            if row >= written:
                self._assign(_place(AT, row), value)

    def _ensure(self, atom: Atom) -> None:
        """Compute the coefficient of a named sum; store that of any operand from before its level."""
        written_here = isinstance(atom, Times | Function) and not self._is_stored(atom)
        if atom in self._done or written_here:
            return
        self._done.add(atom)
        if self._is_unknown(atom) or self._is_ahead(atom):
            return
        if isinstance(atom, Value) and not self._is_stored(atom):
            for a in self.terms.operands(atom):
                self._ensure(a)
            self._assign(Reference(atom.name), self._at_order(self.terms.named[atom]))
        self._store(atom)

    def _loop_of(self, atom: Times) -> str:
        if self._is_unknown(atom.first):
            return LATE
        return SQUARE if atom.first == atom.second else NOW

    def _loop(self, kind: str, name: str, products: Sequence[Times]) -> list[Assignment]:
        """Return one loop over the orders for products, none for none."""
        if not products:
            return []
        first, second = (
            self._block([operands[i] for operands in map(self.terms.operands, products)]) for i in (0, 1)
        )
        self.results |= {(kind, p): _place(name, i) for i, p in enumerate(products)}
        return [Assignment(name, Call(kind, tuple(map(_number, (first, second, len(products))))))]

    def two_ahead(self, squares: Mapping[int, Linear]) -> dict[int, Node]:
        """Return what is known of minus the second rates of polynomials of second degree in q."""
        products = list(
            dict.fromkeys(a for x in squares.values() for a, _ in x.terms if isinstance(a, Times))
        )
        same = [a for a in products if a.first == a.second]
        mixed = [a for a in products if a.first != a.second]
        self.statements += self._loop(SQUARE_AHEAD, SQUARE_AHEAD, same)
        self.statements += self._loop(PRODUCT_AHEAD, PRODUCT_AHEAD, mixed)

        def value(x: Linear) -> Node:
            kinds = (SQUARE_AHEAD, PRODUCT_AHEAD)
            values = [
                multiply(c, self.results[k, a]) for a, c in x.terms for k in kinds if (k, a) in self.results
            ]
            return negative(multiply(AHEAD, add(values))) if values else ZERO

        return {i: value(x) for i, x in squares.items()}

    def write(self, sums: Sequence[Linear]) -> list[Node]:
        """Write what sums need, level by level; return their coefficients."""
        levels: dict[int, list[Times | Function]] = {}
        for atom in self.terms.needed(sums):
            if isinstance(atom, Times | Function) and not self._is_stored(atom):
                levels.setdefault(self.terms.level(atom), []).append(atom)
        # Rows first: every operand is stored in all of its rows as soon as it is known.
        loops = {level: self._plan(level, atoms) for level, atoms in levels.items()}
        for level, atoms in levels.items():
            for atom in atoms:
                for operand in self.terms.operands(atom):
                    self._ensure(operand)
            self.statements += loops[level]
            for atom in atoms:
                if isinstance(atom, Function):
                    self._assign(_place(AT, self.rows[atom][0]), self._recurrence(atom))
                self._store(atom)
        for x in sums:
            for a, _ in x.terms:
                self._ensure(a)
        return [self._at_order(x) for x in sums]

    def _plan(self, level: int, atoms: Sequence[Times | Function]) -> list[Assignment]:
        """Return the loops of a level, with rows for all that its products and functions read."""
        products = sorted(
            (a for a in atoms if isinstance(a, Times)), key=lambda a: self.terms.number(a.second)
        )
        loops = [
            loop
            for kind in (LATE, NOW, SQUARE)
            for loop in self._loop(kind, f"{kind}{level}", [a for a in products if self._loop_of(a) == kind])
        ]
        for atom in atoms:
            if isinstance(atom, Function):
                for x in (atom, *atom.read):
                    self._row(x)
        return loops

    def _recurrence(self, atom: Function) -> Node:
        """Return the call of the function that computes the present coefficient."""
        arguments: list[Node] = [self._at_order(x) for x in atom.of]
        arguments += [self._row(x) for x in atom.read]
        if atom.power != ZERO:
            arguments.append(atom.power)
        arguments += [self._row(x) for x in (atom, atom.pair) if x]
        return Call(f"series_{atom.name}", (Reference("rows"), Reference("k"), *arguments))

    def complete(self) -> list[Assignment]:
        """Return all statements: first the rows of sums of coordinates, of a and of lambda."""
        ahead, back = [], []
        for atom in self.terms.in_turn(self.rows):
            rows = self.rows[atom]
            if self.terms.is_early(atom):
                of_first = self._in_row(atom, stored=isinstance(atom, Argument))
                ahead += [
                    (_place(ROW, r), _place(ROW, rows[0]) if i else of_first) for i, r in enumerate(rows)
                ]
            elif isinstance(atom, Argument) and is_late(atom):
                known: Node = _place(BACK, rows[0])
                if atom.array == ACCELERATION:
                    known = multiply(BEHIND, _place(NEXT, atom.index))
                back += [(_place(BACK, r), _place(BACK, rows[0]) if i else known) for i, r in enumerate(rows)]
        found = [Assignment(place.name, value) for place, value in (*ahead, *back) if place != value]
        return [*found, *self.statements]
