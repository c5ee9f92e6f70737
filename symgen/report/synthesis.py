"""Terminal output and page of a synthesis."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from symgen.report.page.drawing import Line, Node, Sketch
from symgen.report.page.figures import plain_figure
from symgen.report.page.page import TableView
from symgen.report.page.plots import save
from symgen.report.page.sheet import Sheet
from symgen.report.page.study import StudyPage
from symgen.report.tables import table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Most linkages of which a page has drawings.
_DRAWN = 60
_CHART_UNITS = "lengths in m; mu: transmission angle in deg over a revolution of the crank"
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
        drawings=tuple(_drawn(i, d.linkage).svg() for i, d in enumerate(found.designs[:_DRAWN], start=1)),
        notes=(_units(found)[0].upper() + _units(found)[1:], *_faults(found)),
    )


def _chart_rows(chart: Any) -> Iterator[tuple[str, ...]]:
    """Yield value, lengths and transmission angles of every linkage of a chart."""
    unit = math.degrees(1.0) if chart.unit == "rad" else 1.0
    for x, designs in zip(chart.values, chart.designs, strict=True):
        for design in designs:
            angles = (design.quantities[f"transmission_{end}"] for end in ("minimum", "maximum"))
            lengths = design.linkage.lengths.values()
            yield (
                f"{unit * x:.6g}",
                *(f"{length:.6g}" for length in lengths),
                *(f"{math.degrees(angle):.2f}" for angle in angles),
            )


def _chart_gaps(chart: Any) -> Iterator[str]:
    unit = math.degrees(1.0) if chart.unit == "rad" else 1.0
    for x, reason in zip(chart.values, chart.reasons, strict=True):
        if reason:
            yield f"{unit * x:.6g}: {reason}"


def _chart_heads(chart: Any) -> tuple[str, ...]:
    design = next(d for designs in chart.designs for d in designs)
    names = (name.removesuffix("_link") for name in design.linkage.lengths)
    unit = {"rad": " [deg]", "m": " [m]"}.get(chart.unit, "")
    return (chart.name + unit, *names, "mu min", "mu max")


def print_chart(chart: Any, console: Console) -> None:
    """Print lengths and transmission angles of all linkages of a design chart."""
    console.print(table(chart.title or "Design chart", _chart_heads(chart), _chart_rows(chart), keys=1))
    console.print(_CHART_UNITS)
    for gap in _chart_gaps(chart):
        console.print(gap)


def chart_page(chart: Any, name: str) -> StudyPage:
    """Return the page of a design chart: the plot and the table."""
    return StudyPage(
        name=name,
        title=chart.title or "Design chart",
        facts=(),
        tables=(TableView(_chart_heads(chart), tuple(_chart_rows(chart))),),
        notes=(_CHART_UNITS[0].upper() + _CHART_UNITS[1:], *_chart_gaps(chart)),
        figures=(plain_figure(lambda: plot_chart(chart), f"Lengths and angles over {chart.name}"),),
    )


def plot_chart(chart: Any, file: str | os.PathLike[str] | None = None) -> Figure:
    """Plot lengths [m] and angles [deg] of the linkages of a design chart over the varied quantity.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 7), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    unit = math.degrees(1.0) if chart.unit == "rad" else 1.0
    rows = [(unit * x, d) for x, designs in zip(chart.values, chart.designs, strict=True) for d in designs]
    several = any(len(designs) > 1 for designs in chart.designs)
    line = {"marker": ".", "linestyle": "none" if several else "-"}
    lengths = rows[0][1].linkage.lengths
    for name in lengths:
        panels[0].plot([x for x, _ in rows], [d.linkage.lengths[name] for _, d in rows], label=name, **line)
    angles = [n for n in rows[0][1].quantities if n not in lengths and n != chart.name and _is_angle(n)]
    for name in angles:
        ys = [math.degrees(d.quantities[name]) for _, d in rows]
        panels[1].plot([x for x, _ in rows], ys, label=name, **line)
    panels[0].set_ylabel("lengths [m]")
    panels[1].set_ylabel("angles [deg]")
    panels[1].set_xlabel(_chart_heads(chart)[0])
    for panel in panels:
        panel.grid(alpha=0.3)
        panel.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.suptitle(chart.title or "Design chart", fontsize="medium")
    if file is not None:
        save(figure, file)
    return figure


def _is_angle(name: str) -> bool:
    """Return whether a quantity of a chart is an angle that has no other name there."""
    shown = "swing", "crank_", "rocker_e", "rocker_f", "transmission_e", "transmission_g", "transmission_l"
    return name.startswith(shown)


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
    if "P" in at and linkage.turns:
        turned = linkage.parameters["start"] + np.linspace(0.0, 2 * np.pi, 121)
        lines.append(Line("path", "", linkage.angles(turned)["P.position"].values))
    nodes = tuple(Node(name, place, kinds.get(name, "joint")) for name, place in at.items())
    unit = "m" if "P" in at else "radii"
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
