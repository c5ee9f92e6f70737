"""Limit positions of a kind of linkage: its quantities and conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from symgen.synthesis.contradictions import contradiction


@dataclass(frozen=True, slots=True)
class LimitKind:
    """Limit positions of one kind of linkage.

    Attributes
    ----------
    block
        The compiled conditions.
    family
        Name of the linkage.
    quantities
        Rows of name, unit and meaning.
    conditions
        Number of conditions.
    necessary
        Linear relations of the quantities, as SymPy.
    random, derived, accepts, drawn, measured
        Functions: lengths of a random linkage; all quantities by lengths; whether a root is a linkage; the
        linkage of a root; quantities measured in a run.
    """

    block: str
    family: str
    quantities: tuple[tuple[str, str, str], ...]
    conditions: int
    necessary: Callable[[dict[str, Any]], list[Any]]
    random: Callable[[np.random.Generator], list[float]]
    derived: Callable[[list[float]], dict[str, float]]
    accepts: Callable[[dict[str, float]], bool]
    drawn: Callable[[dict[str, float]], Any]
    measured: Callable[[Any], Iterator[tuple[str, float]]]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the quantities."""
        return tuple(name for name, _, _ in self.quantities)

    @property
    def lengths(self) -> frozenset[str]:
        """Names of the quantities that are lengths."""
        return frozenset(name for name, unit, _ in self.quantities if unit == "m")

    @property
    def required(self) -> int:
        """Number of quantities that determine the others."""
        return len(self.quantities) - self.conditions

    def why_not(self, prescribed: dict[str, float], ranges: dict[str, tuple[float, float]]) -> str:
        """Return conditions of every linkage that exclude these values; empty if none is known."""
        low, scale = in_sizes(prescribed | {name: ends[0] for name, ends in ranges.items()}, self.lengths)
        high = {n: ends[1] / scale if n in self.lengths else ends[1] for n, ends in ranges.items()}
        bounds = {name: (value, high.get(name, value)) for name, value in low.items()}
        return contradiction(self.quantities, self.necessary, bounds)


def in_sizes(prescribed: dict[str, float], lengths: frozenset[str]) -> tuple[dict[str, float], float]:
    """Return quantities with lengths over the first of them, which is not zero; and that length [m]."""
    scale = next((value for name, value in prescribed.items() if name in lengths and value), 1.0)
    return {name: value / scale if name in lengths else value for name, value in prescribed.items()}, scale


def time_ratio(more: float) -> float:
    """Return the ratio of the rotations of a crank, of which one is ``more`` [rad] than half a revolution."""
    return float((np.pi + more) / (np.pi - more))
