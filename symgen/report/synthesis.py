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

_NOUNS = {"spherical": "spherical four-bar"}


def _heads(found: Any) -> tuple[str, ...]:
    lengths = found.designs[0].linkage.lengths
    names = (name.removesuffix("_link") for name in lengths)
    return ("", "class", *names, "mu min", "mu max", "error")


def _units(found: Any) -> str:
    what = "arcs in deg" if found.linkage == "spherical" else "lengths in m"
    from_ = " from the guide's normal" if found.linkage == "slider-crank" else ""
    return (
        f"{what}; mu: transmission angle in deg{from_} over a revolution of the crank, - where it makes none"
    )


def _rows(found: Any) -> Iterator[tuple[str, ...]]:
    """Yield number, class, lengths or arcs, transmission angles and error of every linkage."""
    for i, design in enumerate(found.designs, start=1):
        angles = (design.quantities.get(f"transmission_{end}", math.nan) for end in ("minimum", "maximum"))
        unit = math.degrees(1.0) if found.linkage == "spherical" else 1.0
        yield (
            str(i),
            design.linkage.grashof,
            *(f"{unit * length:.6g}" for length in design.linkage.lengths.values()),
            *("-" if math.isnan(angle) else f"{math.degrees(angle):.2f}" for angle in angles),
            f"{design.linkage.error:.1e}",
        )


def _title(found: Any) -> str:
    count = len(found.designs)
    good = sum(not design.faults for design in found.designs)
    noun = _NOUNS.get(found.linkage, found.linkage)
    return f"{found.title or 'Synthesis'}: {count} {noun}{'s' * (count != 1)}, {good} without a fault"


def _faults(found: Any) -> Iterator[str]:
    for i, design in enumerate(found.designs, start=1):
        yield from (f"{i}: {fault}" for fault in design.faults)


def print_synthesis(found: Any, console: Console) -> None:
    """Print class, lengths and transmission angles of every linkage, and the faults of their motion."""
    console.print(table(_title(found), _heads(found), _rows(found), texts=(1,), keys=2))
    console.print(_units(found))
    for fault in _faults(found):
        console.print(fault)


def synthesis_page(found: Any, name: str) -> StudyPage:
    """Return the page of a synthesis: the table, and a drawing of every linkage."""
    return StudyPage(
        name=name,
        title=_title(found),
        facts=(),
        tables=(TableView(_heads(found), tuple(_rows(found))),),
        drawings=tuple(_drawn(i, d.linkage).svg() for i, d in enumerate(found.designs, start=1)),
        notes=(_units(found)[0].upper() + _units(found)[1:], *_faults(found)),
    )


def _drawn(number: int, linkage: Any) -> Sheet:
    """Return the drawing of a linkage at its first pose, that of axes seen from their mean."""
    at = {name: getattr(linkage, name) for name in "OABCP" if hasattr(linkage, name)}
    ends = [("crank", "O", "A"), ("coupler", "A", "B"), ("rocker", "C", "B"), ("", "A", "P"), ("", "B", "P")]
    kinds = {"O": "ground", "C": "ground", "P": "end"}
    if "P" not in at:
        lines, at = _on_sphere(at, [*ends[:3], ("fixed link", "O", "C")])
    else:
        lines = [Line("rod", n, np.array([at[a], at[b]])) for n, a, b in ends if a in at and b in at]
        if "C" not in at:  # the guide, as long as the crank to either side of the slider
            along = linkage.lengths["crank"] * linkage.along
            lines.append(Line("rail", "guide", np.array([at["B"] - along, at["B"] + along])))
    nodes = tuple(Node(name, place, kinds.get(name, "joint")) for name, place in at.items())
    unit = "m" if "P" in at else "1"
    return Sheet(f"linkage {number}", [Sketch(nodes, tuple(lines), np.zeros(2), unit)], {}, (unit, 1.0))


def _on_sphere(axes: dict[str, Any], ends: list[tuple[str, str, str]]) -> tuple[list[Line], dict[str, Any]]:
    """Return arcs and ends of unit vectors in the projection onto the plane normal to their mean."""
    _, _, basis = np.linalg.svd(np.array([*axes.values()]))
    view = basis[1:].T
    share = np.linspace(0.0, 1.0, 25)[:, None]
    lines = []
    for name, a, b in ends:
        angle = math.acos(float(np.clip(axes[a] @ axes[b], -1.0, 1.0)))
        arc = (np.sin((1 - share) * angle) * axes[a] + np.sin(share * angle) * axes[b]) / math.sin(angle)
        lines += [Line("rod", name if i == 12 else "", arc[i : i + 2] @ view) for i in range(24)]
    return lines, {name: axis @ view for name, axis in axes.items()}
