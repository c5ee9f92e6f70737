"""Loss of digits in a kernel: sums that are much smaller than their terms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mpmath

from symgen.lowering.expressions import DIGITS, Node, Sum
from symgen.lowering.tape import Tape

#: Minimum number of digits lost by a reported sum.
LEAST = 0.5


@dataclass(frozen=True, slots=True)
class LostDigits:
    """A cancelling sum at one state.

    Attributes
    ----------
    kernel, name
        The kernel and the assignment or ``array[index]`` that contain the sum.
    node
        The sum.
    here
        Decimal digits lost in the sum: magnitude of the terms over that of the result.
    in_result
        Digits lost in a result by rounding of the terms: their magnitude times the derivative of the result,
        over the result. Negative if the terms do not matter.
    """

    kernel: str
    name: str
    node: Node
    here: float
    in_result: float


def lost_digits(tape: Tape, values: list[Any], entry: int) -> Iterator[LostDigits]:
    """Yield the cancelling sums that contribute to a nonzero entry of ``out``.

    Parameters
    ----------
    values
        Result of :meth:`Tape.values`.
    entry
        Index in ``out``.
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
