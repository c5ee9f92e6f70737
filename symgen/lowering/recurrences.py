"""The kernels of power series in time of a motion.

The kernel ``sides`` is called for the orders k = 0, 1, 2, ... of one step in turn. It returns coefficient k
of the right-hand side of [M J^T; J 0] [a; lambda] = [f; gamma], with those of a and lambda of order k still
zero. The matrix at the beginning of the step is that of all orders: ``solve`` gives coefficient k of a and
lambda, and by it coefficient k + 2 of q. Then ``along`` completes operands that contain a and lambda, and
returns coefficient k of further quantities: the power, and what a run watches.

Each order has a row of coefficients: those of q, those of lambda, and the operands of products and functions.
Coefficient k of a product is a_0 b_k + a_k b_0 and the sum of a_i b_(k - i) for 0 < i < k; so it is for
functions. All these sums are of orders before: one loop computes them together, with operands side by side,
before the statements for order k.

A length constraint is a polynomial of second degree in q: the second rate of its coefficient k + 2 takes half
the products of gamma - J a, and leaves no error of lower order in the constraint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    Rate,
    Terms,
    Times,
    U,
    Value,
    is_late,
    total,
    unit,
)

#: Statements from which on compilation takes more time than a run by power series saves.
MOST = 1000
#: Rows of coefficients in a kernel: of the present order k, also after the solution; of the next two; of k or
#: k + 1.
AT, AFTER, NEXT, FAR, ROW = "at", "after", "next", "far", "row"
#: The first row; the same, but zero at order 0; sums of products of the orders between.
ROWS, ORIGIN_ROW, SUM = "rows", "origin_row", "sum"
#: Numbers in a kernel: the time's coefficient; 1 at order 0 and else 0, of the present order and of the row;
#: k; k + 1; (k + 1) (k + 2).
TIME_NOW, FIRST, ORIGIN, ORDER, RATE, AHEAD = map(
    Reference, ("time", "first", "origin", "order", "rate", "ahead")
)
#: Loops over the orders, of squares and of products two orders ahead.
SQUARE_AHEAD, PRODUCT_AHEAD = "square_ahead", "product_ahead"
LOOPS = (SQUARE_AHEAD, PRODUCT_AHEAD)


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
        Entries of f, and behind them of gamma, with other terms of M a, J^T lambda and J a subtracted.
    constraints
        Entries of Phi.
    power
        The power of loads without potential, if it is integrated.
    watched, events
        Further quantities whose series are wanted, and the number of the first that may be without one.
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
    events: int
    parameters: int


def lower_series(e: EquationsOfMotion) -> list[SeriesKernel]:
    """Return the kernel ``sides``, and ``along`` if there are further quantities.

    An event has no series if one of its functions has no recurrence; for another watched quantity, none has.

    Raises
    ------
    DerivationError
        For a function without a recurrence, and more than ``MOST`` statements.
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
    powers = [] if e.power is None else [terms.of(e.power)]
    known, count = terms.known(e.watched), len(e.watched)
    numbers = range(count if known.keys() >= {*range(e.events, count)} else 0)
    watched = [known.get(i, Linear()) for i in numbers]
    lacking = tuple(i for i in numbers if i not in known)
    totals = [total(x) for x in sums.values()]
    writer = _Writer(terms, e, [*totals, *powers, *watched])
    found = writer.two_ahead({n + i: x for i, x in squares.items()})
    found |= dict(zip(sums, writer.write(totals), strict=True))
    before = writer.solved()
    writer.complete_operands()
    along = writer.write([*powers, *watched])
    rows, counts = len(writer.placed) + len(along), (len(watched), lacking, len(writer.pairs))
    if rows > 256:  # at odd multiples of eight they lie in different sets of a cache
        rows += (8 - rows) % 16
    about = "coefficient of the right-hand side of the equations of motion"
    out = [found[i] for i in range(n + e.m)]
    kernels = [_kernel("sides", about, writer.complete(before), out, rows, e, *counts)]
    if writer.statements or along:
        about = "coefficient of the power of loads without potential" if powers else "coefficient"
        about += (" and" if powers else "") + " of what a run watches" if watched else ""
        kernels.append(_kernel("along", about, writer.statements, along, rows, e, *counts))
    if e.mass and sum(len(kernel.assignments) for kernel in kernels) > MOST:  # loops have few links
        raise DerivationError("the motion has too many terms for power series")
    return kernels


def _kernel(
    name: str,
    about: str,
    statements: Sequence[Assignment],
    out: Sequence[Node],
    rows: int,
    e: EquationsOfMotion,
    watched: int,
    lacking: tuple[int, ...],
    products: int,
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
        products=products,
        watched=watched,
        lacking=lacking,
    )


class _Writer:
    """Writes statements for the coefficients of the present order.

    Those of a and lambda are unknown until the solution.

    Parameters
    ----------
    terms
        Converts nodes to sums of atoms.
    e
        The equations of motion.
    sums
        All sums that it is to write.
    """

    def __init__(self, terms: Terms, e: EquationsOfMotion, sums: Sequence[Linear]) -> None:
        self.terms, self.n = terms, e.n
        self.statements: list[Assignment] = []
        self.placed: list[Atom] = [
            *(Argument(Q, i) for i in range(e.n)),
            *(Argument(MULTIPLIER, i) for i in range(e.m)),
        ]
        self.rows: dict[Atom, list[int]] = {atom: [row] for row, atom in enumerate(self.placed)}
        self._solved = False
        self._done: set[Atom] = set()
        self._results: dict[Atom, Node] = {}
        self._named = 0
        pairs = dict.fromkeys(pair for atom in terms.needed(sums) for pair in terms.pairs(atom))
        self.pairs = sorted(pairs, key=lambda pair: terms.number(pair[1]))
        for i in (0, 1):
            self._append([pair[i] for pair in self.pairs])
        self._sums = {pair: _place(SUM, i) for i, pair in enumerate(self.pairs)}

    def _append(self, atoms: Sequence[Atom]) -> int:
        """Return the first of new rows side by side for these atoms."""
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
        return self._append(atoms)

    def _first(self, array: str, atom: Atom) -> Reference:
        return _place(array, self.rows[atom][0])

    def _value(self, atom: Atom) -> Node:
        """Return the coefficient of the present order of an atom; zero while it is unknown."""
        match atom:
            case Argument(array, i) if is_late(atom):
                if not self._solved:
                    return ZERO
                late = array == MULTIPLIER
                return _place(AT, self.n + i) if late else multiply(AHEAD, _place(FAR, i))
            case Argument(array, i) if array == U:
                return multiply(RATE, _place(NEXT, i))
            case Argument(array) if array == TIME:
                return TIME_NOW
            case Argument() | Value() if self._is_ahead(atom):
                return self._first(AT, atom)
        return self._results[atom]

    def _is_ahead(self, atom: Atom) -> bool:
        """Return whether the coefficient of the present order was stored at the order before."""
        return atom in self.rows and self.terms.is_early(atom)

    def _at_order(self, x: Linear) -> Node:
        values = [multiply(x.constant, FIRST), *(multiply(c, self._value(a)) for a, c in x.terms)]
        return add([v for v in values if v != ZERO])

    def _in_row(self, atom: Atom) -> Node:
        """Return the coefficient in any row of a sum of coordinates."""
        if isinstance(atom, Argument):
            return _place(ROW, atom.index)
        x = self.terms.named[atom]
        values = [multiply(x.constant, ORIGIN), *(multiply(c, self._in_row(a)) for a, c in x.terms)]
        return add([v for v in values if v != ZERO])

    def _new(self, atom: Atom, value: Node) -> None:
        """Name the present coefficient of an atom."""
        if value == ZERO:  # of accelerations and multipliers alone, which are unknown
            self._results[atom] = ZERO
            return
        if isinstance(atom, Value) and atom not in self._results:
            name = atom.name
        else:
            name, self._named = f"term{self._named}", self._named + 1
        self.statements.append(Assignment(name, value))
        self._results[atom] = Reference(name)

    def _store(self, atom: Atom) -> None:
        """Store the present coefficient in all rows of an atom and of its rate."""
        value = self._value(atom)
        if value == ZERO:
            return
        rows = [] if self._is_ahead(atom) else self.rows.get(atom, ())
        self.statements += [Assignment(_place(AT, row).name, value) for row in rows]
        rate = multiply(ORDER, value)
        self.statements += [Assignment(_place(AT, row).name, rate) for row in self.rows.get(Rate(atom), ())]

    def _ensure(self, atom: Atom) -> None:
        """Compute and store the present coefficient of an atom that is known."""
        if atom in self._done or is_late(atom):
            return
        self._done.add(atom)
        if not self._is_ahead(atom):
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

    def _product(self, atom: Times) -> Node:
        """Return the coefficient of a product, without the part of an unknown coefficient."""
        a, b = atom.first, atom.second
        late = is_late(a)
        of_first = multiply(self._first(ORIGIN_ROW if late else ROWS, a), self._value(b))
        of_last = multiply(self._value(a), self._first(ROWS if late else ORIGIN_ROW, b))
        return add([self._sums[a, b], of_first, *([] if of_last == ZERO else [of_last])])

    def _recurrence(self, atom: Function) -> Node:
        """Return the call of the function that computes the present coefficient."""
        arguments: list[Node] = [Reference("k"), Reference("per")]
        arguments += [self._at_order(x) for x in atom.of]
        arguments += [self._value(x) for x in atom.read]
        arguments += [self._first(ROWS, x) for x in atom.first]
        arguments += [atom.power] if atom.power != ZERO else []
        return Call(f"series_{atom.name}", (*arguments, *(self._sums[pair] for pair in atom.pairs)))

    def two_ahead(self, squares: Mapping[int, Linear]) -> dict[int, Node]:
        """Return what is known of minus the second rates of polynomials of second degree in q."""
        products = list(
            dict.fromkeys(a for x in squares.values() for a, _ in x.terms if isinstance(a, Times))
        )
        results: dict[Times, Node] = {}
        for kind, same in ((SQUARE_AHEAD, True), (PRODUCT_AHEAD, False)):
            chosen = [a for a in products if (a.first == a.second) == same]
            if chosen:
                places = (self._block([a.first for a in chosen]), self._block([a.second for a in chosen]))
                call = Call(kind, tuple(map(_number, (*places, len(chosen)))))
                self.statements.append(Assignment(kind, call))
                results |= {a: _place(kind, i) for i, a in enumerate(chosen)}

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

    def complete(self, before: Sequence[Assignment]) -> list[Assignment]:
        """Return all statements of ``sides``: with the rows of sums of coordinates, of a and of lambda."""
        early: list[Assignment] = []
        late: list[Assignment] = []
        for atom, rows in self.rows.items():
            if self.terms.is_early(atom):
                value, row, found = self._in_row(atom), ROW, early
            elif isinstance(atom, Argument) and is_late(atom):
                value, row, found = self._value(atom), AFTER, late
            else:
                continue
            first = _place(row, rows[0])
            values = [value, *(first for _ in rows[1:])]
            found += [Assignment(_place(row, r).name, x) for r, x in zip(rows, values, strict=True)]
        kept = (a for a in (*early, *late) if not _is_itself(a))
        return [*kept, *before]


def _is_itself(a: Assignment) -> bool:
    """Return whether a row is stored in its own place."""
    own = a.target.replace(f"{AFTER}[", f"{AT}[")
    return isinstance(a.value, Reference) and a.value.name in (a.target, own)
