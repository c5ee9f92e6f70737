"""Sums with the largest loss of digits among those that affect inaccurate outputs, in readable form."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from symgen.codegen.printers import Printer
from symgen.lowering.expressions import Node, insert, references, rename
from symgen.lowering.kernel import Kernel
from symgen.study.accuracy.cancellation import lost_digits
from symgen.study.accuracy.kernel_errors import EntryAtState
from symgen.study.accuracy.kernels import ComparedKernels

#: Generated names of shared terms.
_TEMPORARY = re.compile(r"c\d+")
#: Longest expression that is inserted for such a name.
_LONGEST = 100


@dataclass(frozen=True, slots=True)
class Cancelling:
    """A cancelling sum.

    Attributes
    ----------
    kernel, name
        The kernel, and the assignment or output that contains the sum.
    expression
        The sum in terms of the arguments.
    digits
        Decimal digits lost in the sum: log10 of the magnitude of its terms over its own.
    output, entry, state
        The output, entry and state with the largest effect.
    in_output
        Digits that this entry loses by rounding of the terms.
    needless
        Digits among these that the condition of the entry does not explain.
    """

    kernel: str
    name: str
    expression: str
    digits: float
    output: str
    entry: int
    state: str
    in_output: float
    needless: float

    @property
    def rank(self) -> tuple[float, float, float]:
        """Sorting key: digits lost avoidably, then in the output, then in the sum."""
        return round(max(0.0, self.needless), 1), round(self.in_output, 1), round(self.digits, 1)


def cancelling(part: ComparedKernels, places: Iterable[EntryAtState]) -> list[Cancelling]:
    """Return the cancelling sums that affect the given entries, each where its effect is largest."""
    by_node: dict[tuple[str, str, Node], Cancelling] = {}
    words = _Words(part)
    for place in places:
        tape = part.tapes[place.kernel]
        for lost in lost_digits(tape, tape.values(place.at.arrays), place.entry):
            entry = Cancelling(
                part.prefix + lost.kernel,
                words.name(lost.kernel, lost.name),
                words.text(lost.kernel, lost.node),
                lost.here,
                place.output,
                place.entry,
                place.at.label,
                lost.in_result,
                lost.in_result - math.log10(max(1.0, place.condition)),
            )
            key = lost.kernel, lost.name, lost.node
            if key not in by_node or entry.rank > by_node[key].rank:
                by_node[key] = entry
    return sorted(by_node.values(), key=lambda c: c.rank, reverse=True)


class _Words:
    """Formats expressions of a program in terms of its argument names."""

    def __init__(self, part: ComparedKernels) -> None:
        self._kernels: dict[str, Kernel] = {k.name: k for k in part.program.kernels}
        self._arguments = {
            f"{g.name}[{i}]": x.name for g in part.system.groups for i, x in enumerate(g.quantities)
        }
        setup = part.program.setup
        for array, inputs in setup.inputs if setup else ():
            behind = range(setup.out_size if setup else 0)
            self._arguments |= {f"{array}[{inputs + i}]": f"setup[{i}]" for i in behind}
        self._print = Printer({})
        #: Entries of ``work``, which 'factor' writes and 'solve' reads, have no names.
        self._named = {k: v for k, v in self._arguments.items() if not k.startswith("work")}

    def name(self, kernel: str, name: str) -> str:
        """Return an assignment's name, or the name of the output that contains an entry of ``out``."""
        if not name.startswith("out["):
            return name
        index = int(name[4:-1])
        blocks = self._kernels[kernel].blocks
        block = next((b for b in reversed(blocks) if b.offset <= index), None)
        return f"{block.name}[{index - block.offset}]" if block else name

    def text(self, kernel: str, node: Node) -> str:
        """Return the text of an expression, with shared terms inserted while it is short."""
        values = {a.target: a.value for a in self._kernels[kernel].assignments}
        while intermediate := [r for r in references([node]) if _TEMPORARY.fullmatch(r) and r in values]:
            longer = insert(node, {r: values[r] for r in intermediate})
            if len(self._print(longer)) > _LONGEST:
                break
            node = longer
        return self._print(rename(node, self._named if kernel == "solve" else self._arguments))
