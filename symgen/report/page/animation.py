"""The page on which a mechanism moves: frames of a run as numbers, drawn by a script in the page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.report.page.drawing import Sketch, not_drawn, places_of, view_of_paper
from symgen.report.page.page import environment
from symgen.runtime.result.records import Drift, Variable
from symgen.runtime.result.result import Result

Array = NDArray[np.float64]

#: Digits of a place over the size of the mechanism, and of a plotted value over its range.
_DIGITS = 5
#: A smaller part of the largest value of a unit is round-off.
_ROUNDING = 1e-9
#: Maximum number of curves next to the mechanism.
CURVES = 12
#: Caption of arrows.
ARROWS = " Arrows are the recorded forces on links at their joints, and of the ground on the linkage."


@dataclass(frozen=True, slots=True)
class Film:
    """A mechanism at equal steps of a result, one sketch for each; the lines of all sketches correspond.

    ``forces`` are drawn as arrows and not plotted.
    """

    result: Result
    sketches: Sequence[Sketch]
    caption: str
    forces: Sequence[Variable] = ()

    def __repr__(self) -> str:
        return f"<Film {self.result.name!r}: {len(self.sketches)} pictures>"

    def _repr_html_(self) -> str:
        return self.framed(plots=True)

    def framed(self, *, plots: bool) -> str:
        """Return the page in a frame of its own, whose styles and scripts stay apart from those around it."""
        height = 40 if plots else 32
        return (
            f'<iframe srcdoc="{escape(animation(self, plots=plots, framed=True))}" '
            f'title="{escape(self.result.title)}, moving" '
            f'sandbox="allow-scripts" style="width: 100%; height: {height}rem; border: 0"></iframe>'
        )


def animation(film: Film, *, plots: bool = True, framed: bool = False) -> str:
    """Return a self-contained HTML page that plays a film and plots the outputs of its result.

    A framed page has no heading, and fills its frame if it has no plots.
    """
    first = film.sketches[0]
    every = np.array([places_of(s) for s in film.sketches])  # (frames, points, axes)
    low, high = np.nanmin(every, axis=(0, 1)), np.nanmax(every, axis=(0, 1))
    size = float(np.max(high - low)) or 1.0
    along, label = film.result.over
    still = {f"{node.name}.position" for node in first.nodes if node.kind == "ground"}
    shown = [v for v in film.result.shown if v.name not in still]
    curves = curves_of(shown, film.result.drift)
    nodes = nodes_of(first)
    data = {
        "title": film.result.title,
        "along": {
            "label": label,
            "values": _rounded(along, float(np.ptp(along)) or 1.0),
        },
        "duration": float(np.sum(np.abs(np.diff(film.result.time)))),
        "view": np.round(view_of_paper(first), 6).tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "lines": [
            line if long else {**line, "name": ""}
            for line, long in zip(lines_of(first), _long(film.sketches, size), strict=True)
        ],
        "nodes": nodes,
        "forces": forces_of([*curves, *curves_of(film.forces)], nodes),
        "frames": [_rounded(places.ravel(), size) for places in every],
        "curves": curves[:CURVES] if plots else [],
    }
    left = max(0, len(curves) - CURVES) if plots else 0
    caption = film.caption + (ARROWS if data["forces"] else "") + not_drawn(left)
    template = environment().get_template("animation.html.j2")
    return template.render(
        title=film.result.title,
        caption=caption,
        framed=framed,
        filling=framed and not plots,
        data=as_script(data),
    )


def traces_of(sketches: Sequence[Sketch]) -> dict[str, Array]:
    """Return the places of points that move, (samples, axes) by name."""
    nodes = zip(*(sketch.nodes for sketch in sketches), strict=True)
    return {
        same[0].name: np.array([node.at for node in same])
        for same in nodes
        if same[0].kind not in ("ground", "hidden")
    }


def lines_of(sketch: Sketch) -> list[dict[str, Any]]:
    """Return the lines of a sketch without their places."""
    return [{"kind": line.kind, "name": line.name, "count": len(line.at)} for line in sketch.lines]


def nodes_of(sketch: Sketch) -> list[dict[str, Any]]:
    """Return the nodes of a sketch without their places."""
    return [{"kind": node.kind, "name": node.name} for node in sketch.nodes]


def forces_of(curves: Sequence[dict[str, Any]], nodes: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the forces in the axes of the picture among curves of components.

    These are ``POINT.reaction`` and ``LINK.POINT.force`` of linkages, ``LINK.jointK.force_in_ground`` of
    loops, whose nodes are their joints. Each has the number of its node and its curves.
    """
    points = {node["name"]: i for i, node in enumerate(nodes)}
    joints = {f"joint{i}": i - 1 for i in range(1, len(nodes) + 1)}
    nodes_by_word = {"reaction": points, "force": points, "force_in_ground": joints}
    forces: dict[str, dict[str, Any]] = {}
    for curve in curves:
        name, _, component = curve["name"].rpartition(".")
        owner, _, word = name.rpartition(".")
        place, numbers = owner.rpartition(".")[2], nodes_by_word.get(word, {})
        if component in ("x", "y", "z") and place in numbers:
            force = forces.setdefault(name, {"name": name, "node": numbers[place], "parts": []})
            force["parts"].append(curve)
    return list(forces.values())


def _long(sketches: Sequence[Sketch], size: float) -> list[bool]:
    """Return for each line whether it has a length in some sketch."""
    lines = zip(*(s.lines for s in sketches), strict=True)
    return [any(np.ptp(line.at, axis=0).max() > 1e-9 * size for line in same) for same in lines]


def _rounded(values: Array, size: float) -> list[float | None]:
    digits = min(_DIGITS - int(np.floor(np.log10(size))), 300)
    return [float(x) if np.isfinite(x) else None for x in np.round(np.asarray(values, dtype=float), digits)]


def curves_of(variables: Sequence[Variable], drift: Drift | None = None) -> list[dict[str, Any]]:
    """Return each component with its values.

    Those that are round-off of others of its unit are zero, energies whose change is drift are constant.
    """
    largest: dict[str, float] = {}
    for v in variables:
        largest[v.unit] = max(largest.get(v.unit, 0.0), float(np.nanmax(np.abs(v.values), initial=0.0)))
    curves = []
    for v in variables:
        columns = [(v.name, v.values)] if v.values.ndim == 1 else []
        if v.values.ndim == 2:
            columns = [(f"{v.name}.{c}", v.values[:, i]) for i, c in enumerate(v.components)]
        for name, values in columns:
            finite = values[np.isfinite(values)]
            range_ = float(np.ptp(finite)) if finite.size else 0.0
            flat = drift and finite.size and drift.scale(v.unit, range_)
            size = max(0.0 if flat else range_, _ROUNDING * largest[v.unit])
            shown = np.where(np.isfinite(values), finite[0], np.nan) if flat else values
            curves.append({"name": name, "unit": v.unit, "values": _rounded(shown, size or 1.0)})
    return curves


def as_script(data: dict[str, Any]) -> str:
    """Return data as JSON that no text in it can end: see the HTML standard on script elements."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
