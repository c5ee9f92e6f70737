"""Statements of kernels as loops: where their values are stored, and their text and tables of indices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from symgen.codegen.printers import Printer
from symgen.lowering.expressions import Call, Constant, Negative, Node, Product, Quotient, Reference, Sum

#: Constants that are printed in the loops; all others are in a table.
_PRINTED = frozenset({"0", "1", "2"})
#: Statements outside blocks, up to which each is printed by itself, which saves its table and its branch.
STRAIGHT = 1_000
#: Array of intermediate values, and of constants.
_VALUES, _CONSTANTS = "v", "c"


@dataclass(frozen=True, slots=True)
class Case:
    """Statements of one row: indices are terms in ``row``, or entries of a table with ``width`` columns.

    ``before`` and ``after`` are the statements around the loop over the rows.
    """

    statements: tuple[str, ...]
    width: int
    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()


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
class Repetition:
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

    @property
    def type(self) -> str:
        """The type of the values in C."""
        return self._printer.precision.c_type

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
        case Call(arguments=arguments):
            return replace(node, arguments=all_of(arguments))
    raise TypeError(f"not a node: {node!r}")


def _array(place: Place) -> str:
    """Return the array of a place in the text of a case."""
    return _VALUES if place[1] is None else place[0]


#: A statement of a block in all repeats, and each of its operands in all repeats.
_Column = tuple[Sequence[Statement], Sequence[Sequence[Place]]]
#: The statement of a block that makes an operand, and whether that of the repeat before does.
_Maker = tuple[int, bool]


def _columns(rows: Sequence[Sequence[Statement]]) -> list[_Column]:
    return [
        (of_one, list(zip(*(s.operands for s in of_one), strict=True))) for of_one in zip(*rows, strict=True)
    ]


def _maker(operand: Sequence[Place], cell: Mapping[str, tuple[int, int]]) -> _Maker | None:
    """Return the statement that makes an operand in every repeat, or in the one before; else None.

    In the first repeat, an operand of the one before is a value from before the block.
    """
    if operand[0][1] is not None:
        return None
    first, *others = [cell.get(name) for name, _ in operand]
    last = others[-1] if others else None
    if last is None:
        return None
    if first == (0, last[1]) and all(at == (r, last[1]) for r, at in enumerate(others, 1)):
        return last[1], False
    if first is None and all(at == (r, last[1]) for r, at in enumerate(others)):
        return last[1], True
    return None


class Tables:
    """Places of all values, and the text and table of all statements, which are in order.

    Intermediate values that only their own repeat of a block and the next one read are variables of its
    loop; all others have a place in ``v``. Those of a block have consecutive places over its repeats; places
    of other statements are used again after the last use.
    """

    def __init__(self, cases: Cases, statements: Sequence[Statement], blocks: Sequence[Repetition]) -> None:
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
        aligned = [*map(self._aligned, blocks), Repetition(len(statements), 0, 0)]
        straight = len(statements) - sum(b.length * b.repeats for b in aligned) <= STRAIGHT
        for block in aligned:
            texts = []
            for i in range(at, block.first):
                row = self._row(i)
                if straight:
                    texts.append(self._of.text(statements[i].case, [f"{a}[{index}]" for a, index in row]))
                else:
                    self._single(statements[i].case, row)
            if texts:
                self.runs.append([len(self.cases), 1])
                self.cases.append(Case((), 0, tuple(texts)))
            at = block.first + block.length * block.repeats
            if block.repeats:
                self._block(block)
            for i in range(block.first, at):
                self._release(i)

    def _aligned(self, block: Repetition) -> Repetition:
        """Return a block that starts where the fewest values pass from one repeat to the next."""
        middle = block.first + block.repeats // 2 * block.length
        passing = [0] * block.length
        for at in range(middle, middle + block.length):
            name, index = self._statements[at].target
            for boundary in range(at + 1, min(self._last.get(name, at), at + block.length) + 1):
                passing[(boundary - middle) % block.length] += index is None
        turned = passing.index(min(passing))
        return Repetition(block.first + turned, block.length, block.repeats - (turned > 0))

    def _index(self, place: Place) -> int:
        name, index = place
        return self._places[name] if index is None else index

    def _release(self, at: int) -> None:
        """Free the places of the values that a statement is the last to read."""
        for name in dict.fromkeys(name for name, index in self._statements[at].operands if index is None):
            if self._last[name] == at and name in self._places:
                self._free.append(self._places.pop(name))

    def _row(self, at: int) -> list[tuple[str, int]]:
        """Return the arrays and indices of a statement: those that it writes and reads."""
        s = self._statements[at]
        row = [(_array(place), self._index(place)) for place in s.operands]
        self._release(at)
        name, index = s.target
        if index is None:
            if not self._free:
                self._free.append(self.values)
                self.values += 1
            index = self._places[name] = self._free.pop()
        return [(_array(s.target), index), *row]

    def _single(self, of: int, row: Sequence[tuple[str, int]]) -> None:
        """Add a row to the table of its statement."""
        case = self._numbers.get(of)
        if case is None:
            case = self._numbers[of] = len(self.cases)
            places = [f"{array}[x[{i}]]" for i, (array, _) in enumerate(row)]
            self.cases.append(Case((self._of.text(of, places),), len(places)))
        self.numbers += [index for _, index in row]
        if self.runs and self.runs[-1][0] == case:
            self.runs[-1][1] += 1
        else:
            self.runs.append([case, 1])

    def _block(self, block: Repetition) -> None:
        """Add the repeats of a block as a loop of its own.

        In row r the variable ``w`` of a statement has its value of row r, and ``k`` that of row r - 1.
        """
        end = block.first + block.length * block.repeats
        starts = range(block.first, end, block.length)
        columns = _columns([self._statements[i : i + block.length] for i in starts])
        cell = {s.target[0]: (r, j) for j, (of_one, _) in enumerate(columns) for r, s in enumerate(of_one)}
        readers = [[_maker(operand, cell) for operand in operands] for _, operands in columns]
        stored = self._stored(columns, readers, cell, end)
        for j in sorted(stored):
            for s in columns[j][0]:
                self._places[s.target[0]] = self.values
                self.values += 1
        carried: dict[tuple[int, str], str] = {}
        table: list[list[int]] = []
        texts = []
        for j, (of_one, operands) in enumerate(columns):
            is_local = of_one[0].target[1] is None and j not in stored
            places = [
                f"const {self._of.type} w{j}" if is_local else self._text([s.target for s in of_one], table)
            ]
            for operand, maker in zip(operands, readers[j], strict=True):
                if maker is None:
                    places.append(self._text(operand, table))
                elif maker[1]:
                    key = maker[0], operand[0][0]
                    places.append(carried.setdefault(key, f"k{len(carried)}"))
                else:
                    places.append(self._text(operand, table) if maker[0] in stored else f"w{maker[0]}")
            texts.append(self._of.text(of_one[0].case, places))
        before = [
            f"{self._of.type} {k} = {_VALUES}[{self._places[name]}];" for (_, name), k in carried.items()
        ]
        after = []
        for j, (of_one, _) in enumerate(columns):
            name, index = of_one[-1].target
            if index is None and j not in stored and self._last.get(name, -1) >= end:
                before.append(f"{self._of.type} last{j} = 0;")
                texts.append(f"last{j} = w{j};")
                after.append(f"{_VALUES}[{self.values}] = last{j};")
                self._places[name] = self.values
                self.values += 1
        for (j, _), k in carried.items():
            source = self._text([s.target for s in columns[j][0]], table) if j in stored else f"w{j}"
            texts.append(f"{k} = {source};")
        self.runs.append([len(self.cases), block.repeats])
        self.cases.append(Case(tuple(texts), len(table), tuple(before), tuple(after)))
        self.numbers += [index for row in zip(*table, strict=True) for index in row]

    def _stored(
        self,
        columns: Sequence[_Column],
        readers: Sequence[Sequence[_Maker | None]],
        cell: Mapping[str, tuple[int, int]],
        end: int,
    ) -> set[int]:
        """Return the statements of a block whose values of all repeats have places.

        Others read them behind the block, apart from the last one, or at uneven distances in it.
        """
        stored = {
            j
            for j, (of_one, _) in enumerate(columns)
            for s in of_one[:-1]
            if s.target[1] is None and self._last.get(s.target[0], -1) >= end
        }
        for (_, operands), makers in zip(columns, readers, strict=True):
            for operand, maker in zip(operands, makers, strict=True):
                if maker is None:
                    stored.update(cell[name][1] for name, index in operand if index is None and name in cell)
        return stored

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
