"""Statements of kernels as loops: where their values are stored, and their text and tables of indices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from symgen.codegen.printers import Printer
from symgen.lowering.nodes import Call, Constant, Negative, Node, Product, Quotient, Reference, Sum

#: Constants that are printed in the loops; all others are in a table.
_PRINTED = frozenset({"0", "1", "2"})
#: Array of intermediate values, and of constants.
_VALUES, _CONSTANTS = "v", "c"


@dataclass(frozen=True, slots=True)
class Case:
    """Statements of one row: indices are terms in ``row``, or entries of a table with ``width`` columns."""

    statements: tuple[str, ...]
    width: int


#: Array and index, or the name of an intermediate value and None.
Place = tuple[str, int | None]


@dataclass(slots=True)
class Statement:
    """``waits`` has the statements before it that it depends on."""

    case: int
    target: Place
    operands: list[Place]
    waits: set[int]


@dataclass(frozen=True, slots=True)
class Block:
    """A sequence of ``length`` statements that occurs ``repeats`` times from position ``first`` on."""

    first: int
    length: int
    repeats: int


class Cases:
    """The distinct statements, numbered by first appearance."""

    def __init__(self, printer: Printer) -> None:
        self._printer = printer
        self._numbers: dict[tuple[str, str], int] = {}
        self._known: dict[str, Place] = {}
        self._values: list[Node] = []
        self.constants: dict[str, int] = {}

    def place(self, name: str) -> Place:
        """Return the array and the index of a reference; an intermediate value has no index yet."""
        known = self._known.get(name)
        if known is None:
            array, bracket, index = name.partition("[")
            known = self._known[name] = (array, int(index[:-1])) if bracket else (name, None)
        return known

    def number(self, target: Place, value: Node) -> tuple[int, list[Place]]:
        """Return the case of a statement, and its operands in the order of its table."""
        operands: list[Place] = []
        key = target[0] if target[1] is not None else _VALUES, self._shape(value, operands)
        case = self._numbers.get(key)
        if case is None:
            case = self._numbers[key] = len(self._values)
            self._values.append(value)
        return case, operands

    def text(self, case: int, places: Sequence[str]) -> str:
        """Return a statement that writes the first place and reads the others, in the order of its table."""
        read = iter(places[1:])
        value = self._printer(_placed(self._values[case], read))
        return f"{places[0]} = {value};"

    def local(self, name: str) -> str:
        """Return the declaration of an intermediate value of one row."""
        return f"const {self._printer.precision.c_type} {name}"

    def _shape(self, node: Node, operands: list[Place]) -> str:
        match node:
            case Reference(name):
                place = self.place(name)
                operands.append(place)
                return _VALUES if place[1] is None else place[0]
            case Constant(text):
                if text in _PRINTED:
                    return text
                operands.append((_CONSTANTS, self.constants.setdefault(text, len(self.constants))))
                return _CONSTANTS
            case Sum(terms):
                return f"({'+'.join([self._shape(n, operands) for n in terms])})"
            case Product(factors):
                return f"({'*'.join([self._shape(n, operands) for n in factors])})"
            case Quotient(numerator, denominator):
                return f"({self._shape(numerator, operands)}/{self._shape(denominator, operands)})"
            case Negative(value):
                return f"(-{self._shape(value, operands)})"
            case Call(function, arguments):
                return f"{function}({','.join([self._shape(n, operands) for n in arguments])})"
        raise TypeError(f"not a node: {node!r}")


def _placed(node: Node, places: Iterator[str]) -> Node:
    """Return a node whose operands are these places, from left to right."""

    def all_of(nodes: tuple[Node, ...]) -> tuple[Node, ...]:
        return tuple([_placed(n, places) for n in nodes])

    match node:
        case Reference():
            return Reference(next(places))
        case Constant(text):
            return node if text in _PRINTED else Reference(next(places))
        case Sum(terms):
            return Sum(all_of(terms))
        case Product(factors):
            return Product(all_of(factors))
        case Quotient(numerator, denominator):
            return Quotient(*all_of((numerator, denominator)))
        case Negative(value):
            return Negative(*all_of((value,)))
        case Call(function, arguments):
            return Call(function, all_of(arguments))
    raise TypeError(f"not a node: {node!r}")


def _array(place: Place) -> str:
    """Return the array of a place in the text of a case."""
    return _VALUES if place[1] is None else place[0]


class Tables:
    """Places of all values, and the text and table of all statements, which are in order.

    Intermediate values that only their own repeat of a block reads are local to it; all others have a place
    in ``v``. Those of a block have consecutive places over its repeats; places of other statements are used
    again after the last use.
    """

    def __init__(self, cases: Cases, statements: Sequence[Statement], blocks: Sequence[Block]) -> None:
        self._of, self._statements = cases, statements
        self._last = {
            name: at for at, s in enumerate(statements) for name, index in s.operands if index is None
        }
        self._free: list[int] = []
        self._places: dict[str, int] = {}
        self._numbers: dict[int, int] = {}
        self.values = 0
        self.numbers: list[int] = []
        self.runs: list[list[int]] = []
        self.cases: list[Case] = []
        at = 0
        for block in (*map(self._aligned, blocks), Block(len(statements), 0, 0)):
            for i in range(at, block.first):
                self._single(i)
            at = block.first + block.length * block.repeats
            if block.repeats:
                self._block(block)
            for i in range(block.first, at):
                self._release(i)

    def _aligned(self, block: Block) -> Block:
        """Return a block that starts where the fewest values pass from one repeat to the next."""
        middle = block.first + block.repeats // 2 * block.length
        passing = [0] * block.length
        for at in range(middle, middle + block.length):
            name, index = self._statements[at].target
            for boundary in range(at + 1, min(self._last.get(name, at), at + block.length) + 1):
                passing[(boundary - middle) % block.length] += index is None
        turned = passing.index(min(passing))
        return Block(block.first + turned, block.length, block.repeats - (turned > 0))

    def _index(self, place: Place) -> int:
        name, index = place
        return self._places[name] if index is None else index

    def _release(self, at: int) -> None:
        """Free the places of the values that a statement is the last to read."""
        for name in dict.fromkeys(name for name, index in self._statements[at].operands if index is None):
            if self._last[name] == at and name in self._places:
                self._free.append(self._places.pop(name))

    def _single(self, at: int) -> None:
        """Add a row to the table of its statement."""
        s = self._statements[at]
        row = [self._index(place) for place in s.operands]
        self._release(at)
        name, index = s.target
        if index is None:
            if not self._free:
                self._free.append(self.values)
                self.values += 1
            index = self._places[name] = self._free.pop()
        case = self._numbers.get(s.case)
        if case is None:
            case = self._numbers[s.case] = len(self.cases)
            places = [f"{_array(place)}[x[{i}]]" for i, place in enumerate((s.target, *s.operands))]
            self.cases.append(Case((self._of.text(s.case, places),), len(places)))
        self.numbers += [index, *row]
        if self.runs and self.runs[-1][0] == case:
            self.runs[-1][1] += 1
        else:
            self.runs.append([case, 1])

    def _block(self, block: Block) -> None:
        """Add the repeats of a block as a loop of its own."""
        ends = range(block.first, block.first + (block.repeats + 1) * block.length, block.length)[1:]
        rows = [self._statements[end - block.length : end] for end in ends]
        local = self._local(rows, ends)
        for of_one in zip(*rows, strict=True):
            if of_one[0].target[1] is None and of_one[0].target[0] not in local:
                for s in of_one:
                    self._places[s.target[0]] = self.values
                    self.values += 1
        columns: list[list[int]] = []
        texts = []
        for of_one in zip(*rows, strict=True):
            name = local.get(of_one[0].target[0])
            places = [self._of.local(name) if name else self._text([s.target for s in of_one], columns)]
            for operands in zip(*(s.operands for s in of_one), strict=True):
                places.append(local.get(operands[0][0]) or self._text(operands, columns))
            texts.append(self._of.text(of_one[0].case, places))
        self.runs.append([len(self.cases), len(rows)])
        self.cases.append(Case(tuple(texts), len(columns)))
        self.numbers += [index for row in zip(*columns, strict=True) for index in row]

    def _local(self, rows: Sequence[Sequence[Statement]], ends: Sequence[int]) -> dict[str, str]:
        """Return the names in C of the values that nothing behind their own repeat reads."""
        made: dict[str, int] = {}
        shared: set[int | None] = {None}
        for end, row in zip(ends, rows, strict=True):
            for j, s in enumerate(row):
                name, index = s.target
                if index is None:
                    made[name] = j
                    if self._last.get(name, -1) >= end:
                        shared.add(j)
        for of_one in zip(*rows, strict=True):
            for operands in zip(*(s.operands for s in of_one), strict=True):
                makers = {made.get(name) for name, index in operands if index is None}
                if len(makers) > 1:
                    shared |= makers
        return {name: f"w{j}" for name, j in made.items() if j not in shared}

    def _text(self, places: Sequence[Place], columns: list[list[int]]) -> str:
        """Return the places of an operand in all rows, as a term in ``row`` or a column of the table."""
        indices = [self._index(place) for place in places]
        base, step = indices[0], indices[1] - indices[0]
        if indices == [base + step * i for i in range(len(indices))]:
            text = f"{base}{f' + {step}*row' if step > 0 else f' - {-step}*row' if step else ''}"
        else:
            text = f"x[{len(columns)}]"
            columns.append(indices)
        return f"{_array(places[0])}[{text}]"
