"""What code is generated for: a language, a precision, and one state a call or many side by side."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.precision import FLOAT64, Precision


@dataclass(frozen=True, slots=True)
class Target:
    """Language and precision of the generated code.

    Parameters
    ----------
    language
        ``c``, ``cython``, ``numpy`` or ``mpmath``.
    precision
        The type of all numbers; ``mpmath`` has any number of digits instead.
    lanes
        In C: whether every number is a vector, one lane of it for each of several states.
    """

    language: str = "c"
    precision: Precision = FLOAT64
    lanes: bool = False
