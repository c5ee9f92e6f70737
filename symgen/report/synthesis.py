"""Syntheses and design charts as studies for readers."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.report.page.drawing import DrawnLine, Node, Sketch
from symgen.report.page.page import TableView
from symgen.report.page.plots import WIDTH, legend_above, save
from symgen.report.page.sheet import Sheet
from symgen.report.page.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Most linkages of which a page has drawings.
_DRAWN = 60
_NOUNS = {"spherical": "spherical four-bar"}
#: Name of the output's range by linkage.
_RANGES = {"four-bar": "swing", "slider-crank": "stroke", "spherical": "swing"}
#: Error of a fit; smaller ones are rounding [rad, size].
_FITTED = 1e-9


def _shown_in(synthesis: Any) -> tuple[tuple[str, float], tuple[str, float]]:
    """Return name and size in SI of the units of lengths and angles."""
    return synthesis.units.get("length", ("m", 1.0)), synthesis.units.get("angle", ("deg", math.radians(1.0)))


def _of_links(synthesis: Any) -> tuple[str, float]:
    """Return the unit of the links: of lengths, or of arcs on a sphere."""
    return _shown_in(synthesis)[synthesis.linkage == "spherical"]


def _unit_of(synthesis: Any, si: str) -> tuple[str, float]:
    length, angle = _shown_in(synthesis)
    return {"m": length, "rad": angle}.get(si, ("", 1.0))


def _heads(synthesis: Any, design: Any) -> tuple[str, ...]:
    """Return the heads of the columns that tables of designs and charts share."""
    names = (name.removesuffix("_link") for name in design.linkage.lengths)
    return (*names, _RANGES[synthesis.linkage], "time ratio", "mu min", "mu max")


def _cells(synthesis: Any, design: Any) -> Iterator[str]:
    """Yield lengths or arcs, range of the output, time ratio and transmission angles of a linkage."""
    length, angle = _shown_in(synthesis)
    for value in design.linkage.lengths.values():
        yield f"{value / _of_links(synthesis)[1]:.5g}"
    moves = _RANGES[synthesis.linkage]
    size = (length if moves == "stroke" else angle)[1]
    yield _or_dash(design.quantities.get(moves, math.nan) / size, ".5g")
    yield _or_dash(design.quantities.get("time_ratio", math.nan), ".4g")
    for end in ("minimum", "maximum"):
        value = design.quantities.get(f"transmission_{end}", math.nan) / angle[1]
        yield _or_dash(value, ".2f" if angle[0] == "deg" else ".5g")


def _or_dash(value: float, form: str) -> str:
    return "-" if math.isnan(value) else f"{value:{form}}"


def _units(synthesis: Any) -> str:
    (length, _), (angle, _) = _shown_in(synthesis)
    dimensions = (
        f"arcs in {angle}" if synthesis.linkage == "spherical" else f"lengths in {length}, angles in {angle}"
    )
    from_ = " from the guide's normal" if synthesis.linkage == "slider-crank" else ""
    return (
        f"{dimensions}; mu: transmission angle{from_} over a revolution of the crank, - where it makes none"
    )


def _table(synthesis: Any) -> TableView:
    """Return the table of designs; errors of rounding have no column."""
    fitted = any(design.linkage.error > _FITTED for design in synthesis.designs)
    rows = (
        (str(i), d.linkage.grashof, *_cells(synthesis, d), *([f"{d.linkage.error:.1e}"] if fitted else []))
        for i, d in enumerate(synthesis.designs, start=1)
    )
    heads = ("", "class", *_heads(synthesis, synthesis.designs[0]), *(["error"] if fitted else []))
    return TableView(heads, tuple(rows))


def _title(synthesis: Any) -> str:
    count = len(synthesis.designs)
    good = sum(not design.faults for design in synthesis.designs)
    noun = _NOUNS.get(synthesis.linkage, synthesis.linkage)
    return f"{synthesis.title or 'Synthesis'}: {count} {noun}{'s' * (count != 1)}, {good} without a fault"


def _faults(synthesis: Any) -> Iterator[str]:
    for i, design in enumerate(synthesis.designs, start=1):
        yield from (f"{i}: {fault}" for fault in design.faults)


def synthesis_study(synthesis: Any) -> Study:
    """Return a synthesis: class, lengths, transmission angles and faults of every linkage, and drawings."""
    return Study(
        title=_title(synthesis),
        table=_table(synthesis),
        notes=(
            _units(synthesis),
            *filter(None, [synthesis.search.incomplete]),
            *(f"{count} omitted by the constraint {name}" for name, count in synthesis.omitted.items()),
            *_faults(synthesis),
        ),
        texts=(1,),
        keys=2,
        drawings=lambda: (
            _drawn(i, d.linkage, _shown_in(synthesis)[0])
            for i, d in enumerate(synthesis.designs[:_DRAWN], start=1)
        ),
    )


def _chart_table(chart: Any) -> TableView:
    """Return the table of a design chart: the value, and the columns of each linkage."""
    _, size = _unit_of(chart, chart.unit)
    rows = (
        (f"{x / size:.6g}", *_cells(chart, design))
        for x, designs in zip(chart.values, chart.designs, strict=True)
        for design in designs
    )
    design = next(d for designs in chart.designs for d in designs)
    return TableView((_over(chart), *_heads(chart, design)), tuple(rows))


def _over(chart: Any) -> str:
    """Return the varied quantity with its unit."""
    unit, _ = _unit_of(chart, chart.unit)
    return f"{chart.name} [{unit}]" if unit else chart.name


def _chart_gaps(chart: Any) -> Iterator[str]:
    _, size = _unit_of(chart, chart.unit)
    for x, reason in zip(chart.values, chart.reasons, strict=True):
        if reason:
            yield f"{x / size:.6g}: {reason}"


def chart_study(chart: Any) -> Study:
    """Return a design chart: the plot, and lengths and transmission angles of all linkages."""
    return Study(
        title=chart.title or "Design chart",
        table=_chart_table(chart),
        notes=(_units(chart), *_chart_gaps(chart)),
        figures=((lambda: plot_chart(chart), f"Lengths and angles over {chart.name}", ""),),
    )


def plot_chart(chart: Any, file: str | os.PathLike[str] | None = None) -> Figure:
    """Plot lengths and angles of the linkages of a design chart over the varied quantity.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    from symgen.report.picture import Picture

    figure = Picture(figsize=(WIDTH, 6), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    (length, per_length), (angle, per_angle) = _of_links(chart), _shown_in(chart)[1]
    _, size = _unit_of(chart, chart.unit)
    rows = [(x / size, d) for x, designs in zip(chart.values, chart.designs, strict=True) for d in designs]
    several = any(len(designs) > 1 for designs in chart.designs)
    line = {"marker": ".", "linestyle": "none" if several else "-"}
    lengths = rows[0][1].linkage.lengths
    for name in lengths:
        ys = [d.linkage.lengths[name] / per_length for _, d in rows]
        panels[0].plot([x for x, _ in rows], ys, label=name, **line)
    angles = [n for n in rows[0][1].quantities if n not in lengths and n != chart.name and _is_angle(n)]
    for name in angles:
        ys = [d.quantities[name] / per_angle for _, d in rows]
        panels[1].plot([x for x, _ in rows], ys, label=name, **line)
    panels[0].set_ylabel(f"{'arcs' if chart.linkage == 'spherical' else 'lengths'} [{length}]")
    panels[1].set_ylabel(f"angles [{angle}]")
    panels[1].set_xlabel(_over(chart))
    for panel in panels:
        panel.grid(alpha=0.3)
        legend_above(panel)
    figure.suptitle(chart.title or "Design chart", fontsize="medium")
    if file is not None:
        save(figure, file)
    return figure


def _is_angle(name: str) -> bool:
    """Return whether a quantity of a chart is an angle that has no other name there."""
    shown = "swing", "crank_", "rocker_e", "rocker_f", "transmission_e", "transmission_g", "transmission_l"
    return name.startswith(shown)


def _drawn(number: int, linkage: Any, length: tuple[str, float]) -> Sheet:
    """Return the drawing of a linkage at its first pose, that of axes seen from their mean."""
    at = {name: getattr(linkage, name) for name in "OABCP" if hasattr(linkage, name)}
    ends = [("crank", "O", "A"), ("coupler", "A", "B"), ("rocker", "C", "B"), ("", "A", "P"), ("", "B", "P")]
    kinds = {"O": "ground", "C": "ground", "P": "end"}
    if "P" not in at:
        lines, at = _on_sphere(at, [*ends[:3], ("fixed link", "O", "C")])
    else:
        lines = [DrawnLine("rod", n, np.array([at[a], at[b]])) for n, a, b in ends if a in at and b in at]
        if "C" not in at:  # the guide, as long as the crank to either side of the slider
            along = linkage.lengths["crank"] * linkage.along
            lines.append(DrawnLine("rail", "guide", np.array([at["B"] - along, at["B"] + along])))
    if "P" in at and linkage.turns:
        turned = linkage.parameters["start"] + np.linspace(0.0, 2 * np.pi, 121)
        lines.append(DrawnLine("path", "", linkage.angles(turned)["P.position"].values))
    nodes = tuple(Node(name, place, kinds.get(name, "joint")) for name, place in at.items())
    unit, scale = ("m", length) if "P" in at else ("radii", ("radii", 1.0))
    return Sheet(f"linkage {number}", [Sketch(nodes, tuple(lines), np.zeros(2), unit)], {}, scale)


def _on_sphere(
    axes: dict[str, Any], ends: list[tuple[str, str, str]]
) -> tuple[list[DrawnLine], dict[str, Any]]:
    """Return arcs and ends of unit vectors in the projection onto the plane normal to their mean."""
    _, _, basis = np.linalg.svd(np.array([*axes.values()]))
    view = basis[1:].T
    share = np.linspace(0.0, 1.0, 25)[:, None]
    lines = []
    for name, a, b in ends:
        angle = math.acos(float(np.clip(axes[a] @ axes[b], -1.0, 1.0)))
        arc = (np.sin((1 - share) * angle) * axes[a] + np.sin(share * angle) * axes[b]) / math.sin(angle)
        lines += [DrawnLine("rod", name if i == 12 else "", arc[i : i + 2] @ view) for i in range(24)]
    return lines, {name: axis @ view for name, axis in axes.items()}
