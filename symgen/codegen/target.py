"""Targets of code generation: language, precision, and scalar or batched evaluation."""

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
        The number type; ``mpmath`` has an arbitrary number of digits instead.
    lanes
        In C: whether every number is a vector with one lane per state.
    """

    language: str = "c"
    precision: Precision = FLOAT64
    lanes: bool = False
