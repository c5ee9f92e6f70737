"""Efforts that keep prescribed motions."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.runtime.result.records import Variable
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.poses import Poses


def efforts(constraints: Constraints, poses: Poses) -> Iterator[Variable]:
    """Yield the efforts at poses with the unknowns of their equations."""
    names, unknowns = constraints.evaluator.efforts, poses.unknowns
    if not names or unknowns is None:
        return
    for name, values in zip(names, unknowns.T[-len(names) :], strict=True):
        unit = "N" if name.endswith(".force") else "N*m"
        yield Variable(name, unit, f"effort of {name.rpartition('.')[0]}", (), values)
