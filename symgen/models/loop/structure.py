"""Topology of a loop in words: its rows, omitted components, and savings by known numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import sympy as sp

from symgen.joints import JOINTS
from symgen.models.loop.derivation import entries
from symgen.scene.loop.loop import ENTRIES, Loop, Row
from symgen.scene.rods.run_parameters import Parameter
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import System

_ROLES = {"input": "prescribed", "free": "free", "dependent": "to be found", "state": "first-order states"}


def loop_structure(loop: Loop, system: System) -> Iterator[str]:
    """Yield the structure of a loop line by line."""
    yield f"rows, from the ground around to it; lengths in {loop.unit_of_length[0]}, angles in deg:"
    links = [row.link for row in loop.rows]
    for i, row in enumerate(loop.rows):
        joint = f"{row.joint}, {JOINTS[row.joint].name}, from {links[i - 1]} to {row.link}"
        yield f"  {i + 1} {joint}: {_entries(loop, row)}"
    for role, meaning in _ROLES.items():
        names = [v.name for v in loop.having(role)]
        if names:
            yield f"{meaning}: {', '.join(names)}"
    for text in system.left_out:
        yield f"omitted: {text}"


def general(loop: Loop) -> Loop:
    """Return the same table with every number a tunable parameter, except zeros required by joints."""
    rows, added = [], []
    for i, row in enumerate(loop.rows, 1):
        values = {}
        for entry, value in zip(ENTRIES, entries(row), strict=True):
            if value.free_symbols or entry in JOINTS[row.joint].zero:
                values[entry] = value
                continue
            unit = "m" if entry in ("S", "a") else "rad"
            offset = quantity(f"row{i}_{entry}", unit, f"{entry} of row {i}")
            values[entry] = offset.symbol
            added.append(Parameter(offset, value))
        rows.append(replace(row, **values))
    return replace(loop, rows=tuple(rows), parameters=(*loop.parameters, *added))


def _entries(loop: Loop, row: Row) -> str:
    """Return the entries of a row that are not zero."""
    values = zip(ENTRIES, entries(row), strict=True)
    return ", ".join(f"{entry} = {_text(loop, entry, value)}" for entry, value in values if value != 0)


def _text(loop: Loop, entry: str, value: sp.Expr) -> str:
    if value.free_symbols:
        return str(value)
    return (
        f"{loop.number(value) / (loop.unit_of_length[1] if entry in ('S', 'a') else float(sp.pi / 180)):.6g}"
    )
