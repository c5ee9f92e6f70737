"""Terminal output and page of a synthesis."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from rich.console import Console

from symgen.report.page.drawing import Line, Node, Sketch
from symgen.report.page.page import TableView
from symgen.report.page.sheet import Sheet
from symgen.report.page.study import StudyPage
from symgen.report.tables import table

_HEADS = ("", "class", "crank", "coupler", "rocker", "fixed", "mu min", "mu max", "error")
_UNITS = "lengths in m; mu: transmission angle in deg over a revolution of the crank, - where it makes none"


def _rows(found: Any) -> Iterator[tuple[str, ...]]:
    """Yield number, class, lengths, transmission angles and error of every four-bar."""
    for i, design in enumerate(found.designs, start=1):
        angles = (design.quantities.get(f"transmission_{end}", math.nan) for end in ("minimum", "maximum"))
        yield (
            str(i),
            design.linkage.grashof,
            *(f"{length:.6g}" for length in design.linkage.lengths.values()),
            *("-" if math.isnan(angle) else f"{math.degrees(angle):.2f}" for angle in angles),
            f"{design.linkage.error:.1e}",
        )


def _title(found: Any) -> str:
    count = len(found.designs)
    good = sum(not design.faults for design in found.designs)
    return f"{found.title or 'Synthesis'}: {count} four-bar{'s' * (count != 1)}, {good} without a fault"


def _faults(found: Any) -> Iterator[str]:
    for i, design in enumerate(found.designs, start=1):
        yield from (f"{i}: {fault}" for fault in design.faults)


def print_synthesis(found: Any, console: Console) -> None:
    """Print class, lengths and transmission angles of every four-bar, and the faults of their motion."""
    console.print(table(_title(found), _HEADS, _rows(found), texts=(1,), keys=2))
    console.print(_UNITS)
    for fault in _faults(found):
        console.print(fault)


def synthesis_page(found: Any, name: str) -> StudyPage:
    """Return the page of a synthesis: the table, and a drawing of every four-bar."""
    return StudyPage(
        name=name,
        title=_title(found),
        facts=(),
        tables=(TableView(_HEADS, tuple(_rows(found))),),
        drawings=tuple(_drawn(i, d.linkage).svg() for i, d in enumerate(found.designs, start=1)),
        notes=(_UNITS[0].upper() + _UNITS[1:], *_faults(found)),
    )


def _drawn(number: int, linkage: Any) -> Sheet:
    """Return the drawing of a four-bar at its first pose."""
    at = {name: getattr(linkage, name) for name in "OABCP"}
    ends = ("crank", "O", "A"), ("coupler", "A", "B"), ("rocker", "C", "B"), ("", "A", "P"), ("", "B", "P")
    lines = tuple(Line("rod", name, np.array([at[a], at[b]])) for name, a, b in ends)
    kinds = {"O": "ground", "C": "ground", "P": "end"}
    nodes = tuple(Node(name, place, kinds.get(name, "joint")) for name, place in at.items())
    return Sheet(f"four-bar {number}", [Sketch(nodes, lines, np.zeros(2), "m")], {}, ("m", 1.0))
