"""Terms of a motion as power series in time: sums of atoms whose coefficients follow from recurrences.

Source of the recurrences: A. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99-117, section 2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

from symgen.errors import DerivationError
from symgen.lowering.expressions import (
    ONE,
    ZERO,
    Call,
    Constant,
    Negative,
    Node,
    Product,
    Quotient,
    Reference,
    Sum,
    add,
    children,
    multiply,
    reciprocal,
    signs,
)

_MINUS_ONE = Constant("-1")
_HALF_PI = Constant("1.570796326794896619231321691639751442099")

#: Arrays of arguments that vary in time; accelerations and multipliers are both in ``work``. Of one freedom,
#: ``work`` has the motion of unit inertia, of which velocities are multiples by the speed.
Q, U, TIME, ACCELERATION, MULTIPLIER, SPEED = "q", "u", "t", "a", "lambda", "speed"
#: Functions of which each is the rate of the other, but for the sign, if that of their argument is one.
PAIRS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}
#: The function that is the rate of the other, in its terms: 1 - tanh^2 is finite where sinh and cosh are not.
RATES = {"tanh": "tanh_rate"}


@dataclass(frozen=True, slots=True)
class Argument:
    """An entry of an array of arguments."""

    array: str
    index: int


@dataclass(frozen=True, slots=True)
class Value:
    """A named sum."""

    name: str


@dataclass(frozen=True, slots=True)
class Times:
    """A product of two atoms."""

    first: Atom
    second: Atom


@dataclass(frozen=True, slots=True)
class Function:
    """A function by its C name.

    Its coefficient follows from those of the sums ``of`` and of the atoms ``read`` of the same order, from
    the first coefficients of the atoms ``first``, and from sums of products of all others, those of
    ``pairs``; ``power`` is the exponent of 'pow'.
    """

    name: str
    of: tuple[Linear, ...] = ()
    read: tuple[Atom, ...] = ()
    power: Node = ZERO

    @property
    def pair(self) -> Function | None:
        """The function that is its rate, which needs it in turn; None for a function of no such pair."""
        if self.name in RATES:
            return Function(RATES[self.name], (), (self,))
        return Function(PAIRS[self.name], self.of, self.read) if self.name in PAIRS else None

    @property
    def pairs(self) -> list[tuple[Atom, Atom]]:
        """The pairs of atoms of which products are summed."""
        match self.name, self.read:
            case "sqrt", _:
                return [(self, self)]
            case "quotient", (below,):
                return [(self, below)]
            case "tanh_rate", (x,):
                return [(x, x)]
            case "log" | "atan" | "asin", (below,):
                return [(Rate(self), below)]
            case "atan2", (y, x, below):
                return [(Rate(y), x), (Rate(x), y), (Rate(self), below)]
            case "pow", (x,):
                return [(Rate(x), self), (x, Rate(self))]
        return [(Rate(self.read[0]), self.pair or self)]

    @property
    def first(self) -> list[Atom]:
        """The atoms whose first coefficients appear."""
        if self.name in ("quotient", "pow"):
            return [*self.read, self]
        if self.name in ("log", "atan", "asin", "atan2", "tanh_rate"):
            return list(self.read)
        return [self.pair or self]


@dataclass(frozen=True, slots=True)
class Rate:
    """The coefficients of an atom, each times its order."""

    of: Atom


@dataclass(frozen=True, slots=True)
class Derivative:
    """The rate of an atom: its coefficient of the next order, times this order."""

    of: Atom


Atom = Argument | Value | Times | Function | Rate | Derivative


@dataclass(frozen=True, slots=True)
class Linear:
    """A sum of atoms with coefficients that are constant in time, and a constant."""

    constant: Node = ZERO
    terms: tuple[tuple[Atom, Node], ...] = ()

    @property
    def is_constant(self) -> bool:
        """Whether no term varies in time."""
        return not self.terms

    def scaled(self, factor: Node) -> Linear:
        """Return a multiple by a factor that is constant in time."""
        return Linear(_times(self.constant, factor), tuple((a, _times(c, factor)) for a, c in self.terms))


def _times(c: Node, factor: Node) -> Node:
    """Return a product with the number first, as in other kernels, so that equal ones are one."""
    return multiply(factor, c) if isinstance(factor, Constant) else multiply(c, factor)


def unit(atom: Atom) -> Linear:
    """Return an atom as a sum."""
    return Linear(ZERO, ((atom, ONE),))


def total(parts: Iterable[Linear]) -> Linear:
    """Return a sum of sums."""
    constants: list[Node] = []
    found: dict[Atom, Node] = {}
    for part in parts:
        if part.constant != ZERO:
            constants.append(part.constant)
        for atom, c in part.terms:
            found[atom] = add([found[atom], c]) if atom in found else c
    terms = tuple((a, c) for a, c in found.items() if c != ZERO)
    return Linear(add(constants) if constants else ZERO, terms)


def is_late(atom: Atom) -> bool:
    """Return whether an atom is an acceleration or a multiplier, which the equations of motion determine."""
    return isinstance(atom, Argument) and atom.array in (ACCELERATION, MULTIPLIER)


class Terms:
    """Converts nodes to sums of atoms.

    Parameters
    ----------
    values, rates
        Named terms of the nodes, and what those are rates of that the derivation states as such.
    n
        Number of coordinates: ``work`` has their accelerations, then the multipliers.
    """

    def __init__(self, values: Mapping[str, Node], rates: Mapping[str, Node], n: int) -> None:
        self.values, self.rates, self.n = values, rates, n
        self.named: dict[Atom, Linear] = {}
        self._names: dict[Linear, Atom] = {}
        self._known: dict[str, Linear] = {}
        self._early: dict[Atom, bool] = {}
        self._of_late: dict[Atom, bool] = {}
        self._of_rates: dict[Atom, bool] = {}
        self._levels: dict[Atom, int] = {}
        self._numbers: dict[Atom, int] = {}

    def of(self, node: Node) -> Linear:
        """Return a node as a sum of atoms.

        Raises
        ------
        DerivationError
            For a function without a recurrence.
        """
        match node:
            case Constant():
                return Linear(node)
            case Reference(name):
                if name not in self._known:
                    self._known[name] = self._of_name(name)
                return self._known[name]
            case Negative(value):
                return self.of(value).scaled(_MINUS_ONE)
            case Sum():
                terms = zip(signs(node), map(self.of, children(node)), strict=True)
                return total(x if sign > 0 else x.scaled(_MINUS_ONE) for sign, x in terms)
            case Product((first, *others)):
                result = self.of(first)
                for factor in others:
                    result = self.times(result, self.of(factor))
                return result
            case Quotient(numerator, denominator):
                return self.over(self.of(numerator), self.of(denominator))
            case Call(function, arguments):
                parts = [self.of(x) for x in arguments]
                if all(x.is_constant for x in parts):
                    return Linear(replace(node, arguments=tuple(x.constant for x in parts)))
                return self._call(function, parts)
        raise TypeError(f"not a node: {node!r}")

    def known(self, nodes: Iterable[Node]) -> dict[int, Linear]:
        """Return the nodes of which all functions have recurrences as sums of atoms, by number."""
        found = {}
        for i, node in enumerate(nodes):
            with suppress(DerivationError):
                found[i] = self.of(node)
        return found

    def _of_name(self, name: str) -> Linear:
        array, bracket, place = name.partition("[")
        if not bracket:
            if name in self.rates and (rate := self._rate(self.of(self.rates[name]))):
                return rate
            found = self.of(self.values[name])
            if len(found.terms) < 2:
                return found
            return unit(self._names.setdefault(found, self._name(found, name)))
        if array == "p":
            return Linear(Reference(name))
        i = int(place[:-1])
        if array == "work":
            array, i = (ACCELERATION, i) if i < self.n else (MULTIPLIER, i - self.n)
        return unit(Argument(array, i))

    def _rate(self, x: Linear) -> Linear | None:
        """Return the rate of a sum of velocities; None for one with accelerations or the time."""
        if any(self.is_of_late(a) or a == Argument(TIME, 0) for a, _ in x.terms):
            return None
        rates = {Q: U, U: ACCELERATION}
        new = (
            Argument(rates[a.array], a.index) if isinstance(a, Argument) else Derivative(a)
            for a, _ in x.terms
        )
        return Linear(ZERO, tuple(zip(new, (c for _, c in x.terms), strict=True)))

    def _name(self, x: Linear, name: str) -> Atom:
        atom = Value(name)
        self.named[atom] = x
        return atom

    def atom(self, x: Linear) -> Atom:
        """Return the atom that a sum is; a sum of several terms is named."""
        if len(x.terms) == 1 and x.constant == ZERO and x.terms[0][1] == ONE:
            return x.terms[0][0]
        if x not in self._names:
            self._names[x] = self._name(x, f"v{len(self.named)}")
        return self._names[x]

    def times(self, x: Linear, y: Linear) -> Linear:
        """Return a product; factors that are constant in time come before it."""
        if x.is_constant or y.is_constant:
            return y.scaled(x.constant) if x.is_constant else x.scaled(y.constant)
        (c, a), (d, b) = self._bare(x), self._bare(y)
        first, second = sorted((a, b), key=lambda atom: (not is_late(atom), self.number(atom)))
        return unit(Times(first, second)).scaled(multiply(c, d))

    def _bare(self, x: Linear) -> tuple[Node, Atom]:
        if len(x.terms) == 1 and x.constant == ZERO:
            atom, coefficient = x.terms[0]
            return coefficient, atom
        return ONE, self.atom(x)

    def over(self, x: Linear, y: Linear) -> Linear:
        """Return a quotient."""
        if y.is_constant:
            return x.scaled(reciprocal(y.constant))
        if x.is_constant:
            return unit(Function("quotient", (Linear(ONE),), (self.atom(y),))).scaled(x.constant)
        return unit(Function("quotient", (x,), (self.atom(y),)))

    def _call(self, name: str, parts: list[Linear]) -> Linear:
        x, of_it = parts[0], self.atom(parts[0])
        match name:
            case "sqrt":
                return unit(Function(name, (x,)))
            case "exp" | "sin" | "cos" | "sinh" | "cosh" | "tanh":
                return unit(Function(name, (), (of_it,)))
            case "log":
                return unit(Function(name, (x,), (of_it,)))
            case "tan":
                return self.over(*(unit(Function(f, (), (of_it,))) for f in ("sin", "cos")))
            case "atan":
                below_it = total([Linear(ONE), self.times(x, x)])
                return unit(Function(name, (x,), (self.atom(below_it),)))
            case "asin" | "acos":
                square = total([Linear(ONE), self.times(x, x).scaled(_MINUS_ONE)])
                sine = unit(Function("asin", (x,), (Function("sqrt", (square,)),)))
                return sine if name == "asin" else total([Linear(_HALF_PI), sine.scaled(_MINUS_ONE)])
            case "atan2":
                y, x = parts
                square = total([self.times(x, x), self.times(y, y)])
                return unit(Function(name, (), (self.atom(y), self.atom(x), self.atom(square))))
            case "pow" if parts[1].is_constant:
                return unit(Function(name, (), (of_it,), parts[1].constant))
        raise DerivationError(f"there is no power series of the function {name}")

    # -- properties of atoms -----------------------------------------------------------------------------

    def number(self, atom: Atom) -> int:
        """Return a number that orders atoms as they were found."""
        return self._numbers.setdefault(atom, len(self._numbers))

    def operands(self, atom: Atom) -> list[Atom]:
        """Return the atoms of which coefficients are read."""
        match atom:
            case Value():
                return [a for a, _ in self.named[atom].terms]
            case Times(first, second):
                return [first, second]
            case Function(of=of, read=read):
                return [*read, *(a for x in of for a, _ in x.terms)]
            case Derivative(of):
                return [of]
        return []

    def pairs(self, atom: Times | Function) -> list[tuple[Atom, Atom]]:
        """Return the pairs of atoms of which a coefficient takes a sum of products."""
        return [(atom.first, atom.second)] if isinstance(atom, Times) else atom.pairs

    def is_early(self, atom: Atom) -> bool:
        """Return whether an atom is a sum of coordinates, the coefficient of whose next order is known."""
        if atom not in self._early:
            self._early[atom] = (isinstance(atom, Argument) and atom.array == Q) or (
                isinstance(atom, Value) and all(map(self.is_early, self.operands(atom)))
            )
        return self._early[atom]

    def is_of_late(self, atom: Atom) -> bool:
        """Return whether a coefficient depends on those of accelerations or multipliers of its order."""
        if atom not in self._of_late:
            of_it = self.is_of_rates if isinstance(atom, Derivative) else self.is_of_late
            self._of_late[atom] = is_late(atom) or any(map(of_it, self.operands(atom)))
        return self._of_late[atom]

    def is_of_rates(self, atom: Atom) -> bool:
        """Return whether a coefficient depends on those of velocities of its order."""
        if atom not in self._of_rates:
            is_rate = isinstance(atom, Argument) and atom.array == U
            self._of_rates[atom] = is_rate or any(map(self.is_of_rates, self.operands(atom)))
        return self._of_rates[atom]

    def level(self, atom: Atom) -> int:
        """Return how many products and functions lead to an atom, one after the other."""
        if atom not in self._levels:
            below = max(map(self.level, self.operands(atom)), default=0)
            self._levels[atom] = below + isinstance(atom, Times | Function)
        return self._levels[atom]

    def needed(self, sums: Iterable[Linear]) -> list[Times | Function]:
        """Return the products and functions that sums need, in the order of their levels."""
        done: dict[Atom, None] = {}  # whose order is that of the sums
        waiting = [a for x in sums for a, _ in x.terms]
        while waiting:
            atom = waiting.pop()
            if atom in done:
                continue
            done[atom] = None
            waiting += self.operands(atom)
            if isinstance(atom, Function) and atom.pair:
                waiting.append(atom.pair)
        found = (a for a in done if isinstance(a, Times | Function))
        return sorted(found, key=self.level)
