"""Where a kernel loses digits: sums whose terms are much larger than what is left of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mpmath

from symgen.lowering.nodes import DIGITS, Node, Sum
from symgen.lowering.tape import Tape

#: Digits that a sum must lose to be worth a line.
LEAST = 0.5


@dataclass(frozen=True, slots=True)
class LostDigits:
    """A sum that cancels, at one state.

    Attributes
    ----------
    kernel, name
        The kernel that holds it, and the assignment or ``array[index]`` that it belongs to.
    node
        The sum.
    here
        Decimal digits it loses: terms over result, both by size.
    in_result
        Digits that an entry of the results loses by the rounding of these terms: they times the derivative
        of the entry, over the entry. Below zero where the terms do not matter to it.
    """

    kernel: str
    name: str
    node: Node
    here: float
    in_result: float


def lost_digits(tape: Tape, values: list[Any], entry: int) -> Iterator[LostDigits]:
    """Yield the sums that cancel on the way to one entry of ``out``, which must not be zero.

    Parameters
    ----------
    values
        What :meth:`Tape.values` gave.
    entry
        Place in ``out``.
    """
    influence = tape.influence(values, entry)
    result = abs(float(values[tape.out[entry]]))
    for place, operation in enumerate(tape.operations):
        if isinstance(operation.node, Sum) and influence[place]:
            terms = mpmath.fsum((values[i] for i in operation.operands), absolute=True)
            here = _digits(terms, abs(values[place]))
            if here >= LEAST:
                lost = float(terms) * abs(influence[place]) / result
                yield LostDigits(operation.kernel, operation.name, operation.node, here, math.log10(lost))


def _digits(terms: Any, left: Any) -> float:
    return float(mpmath.log10(terms / left)) if left else float(DIGITS if terms else 0)
