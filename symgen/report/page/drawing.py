"""Drawing of a mechanism: from lines and points in space to shapes for the SVG template."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Width of a drawing [px].
_WIDTH = 540.0
#: Least and largest height of a drawing [px].
_HEIGHTS = (220.0, 430.0)
#: Margin around the mechanism [px].
_MARGIN = 52.0
#: Height of a strip below the mechanism for arrows and scale bar, where they would meet it [px].
_STRIP = 54.0
#: Height of a label's characters [px].
_LETTER = 14.0
#: Width of a label's characters [px].
_LETTER_WIDTH = 8.6
#: Distance of a label from its point [px].
_OFF = 13.0
#: Windings of a spring.
_WINDINGS = 7
#: Half width of a spring [px].
_SPRING = 6.0
#: Points are in line, and their body a rod, if their deviations from it have a smaller norm [px].
_FLAT = 0.5
#: Maximum number of vertices of a drawn path.
_CORNERS = 400


@dataclass(frozen=True, slots=True)
class DrawnLine:
    """A line, or a body given by its corners; ``kind`` is the style, ``at`` holds one point per row [m]."""

    kind: str
    name: str
    at: Array


@dataclass(frozen=True, slots=True)
class Node:
    """A point [m] and its kind: ``ground``, ``joint``, ``end`` or ``hidden``."""

    name: str
    at: Array
    kind: str


@dataclass(frozen=True, slots=True)
class Sketch:
    """A mechanism in the plane or in space [m], with gravity [m/s^2]."""

    nodes: tuple[Node, ...]
    lines: tuple[DrawnLine, ...]
    gravity: Array
    unit: str


@dataclass(frozen=True, slots=True)
class PaperLine:
    """A line on paper: its kind and its vertices [px]."""

    kind: str
    at: Array
    closed: bool = False

    @property
    def points(self) -> str:
        """The vertices in SVG syntax."""
        return " ".join(f"{x:.2f},{y:.2f}" for x, y in self.at)


@dataclass(frozen=True, slots=True)
class Mark:
    """A point on paper."""

    kind: str
    x: float
    y: float
    name: str


@dataclass(frozen=True, slots=True)
class Label:
    """A label on paper; ``kind`` is ``point`` or ``link``."""

    kind: str
    x: float
    y: float
    text: str


@dataclass(frozen=True, slots=True)
class Arrow:
    """An arrow in the corner of the drawing: an axis or gravity."""

    kind: str
    x: float
    y: float
    text: str


@dataclass(frozen=True, slots=True)
class Drawing:
    """Data of the SVG template. ``bar`` is the length of the scale bar [px], ``scale`` its label."""

    width: float
    height: float
    shapes: tuple[PaperLine, ...]
    marks: tuple[Mark, ...]
    labels: tuple[Label, ...]
    arrows: tuple[Arrow, ...]
    bar: float
    scale: str
    unnamed: int


@dataclass(frozen=True, slots=True)
class Paper:
    """A sheet of paper with places of a mechanism on it.

    Attributes
    ----------
    view
        The two directions of the paper, as columns.
    middle
        The place in the middle of the paper, in these directions.
    scale
        Length on paper [px] of a unit of length.
    width, height
        Size of the paper [px].
    """

    view: Array
    middle: Array
    scale: float
    width: float
    height: float

    @classmethod
    def of(cls, sketches: Sequence[Sketch]) -> Paper:
        """Return the paper that holds all sketches: front view in the plane, oblique view in space."""
        view = view_of_paper(sketches[0])
        every = np.vstack([places_of(sketch) for sketch in sketches]) @ view
        low, high = np.nanmin(every, axis=0), np.nanmax(every, axis=0)
        extent = np.maximum(high - low, 1e-12 * max(1.0, float(np.nanmax(np.abs(every)))))
        scale = min((_WIDTH - 2 * _MARGIN) / extent[0], (_HEIGHTS[1] - 2 * _MARGIN) / extent[1])
        height = float(np.clip(extent[1] * scale + 2 * _MARGIN, *_HEIGHTS))
        return cls(view, (low + high) / 2, float(scale), _WIDTH, height)

    def __call__(self, at: Array) -> Array:
        """Return places on paper [px], y downwards."""
        moved = (at @ self.view - self.middle) * self.scale * (1.0, -1.0) + (self.width / 2, self.height / 2)
        return np.asarray(moved)

    def shapes(self, sketch: Sketch) -> list[PaperLine]:
        """Return the lines of a sketch in the order in which they are drawn."""
        shapes = [shape for line in sketch.lines for shape in _shapes(line, self(line.at))]
        return sorted(shapes, key=lambda shape: _ORDER.index(shape.kind))


def places_of(sketch: Sketch) -> Array:
    """Return the vertices of all lines, then the nodes, one per row."""
    return np.vstack([*(line.at for line in sketch.lines), *(node.at[None] for node in sketch.nodes)])


def drawing(sketch: Sketch) -> Drawing:
    """Return the drawing of a mechanism: front view in the plane, oblique view in space."""
    sketch = replace(sketch, lines=tuple(line for line in sketch.lines if np.ptp(line.at, axis=0).any()))
    paper = Paper.of([sketch])
    height = paper.height
    shapes = paper.shapes(sketch)
    marks = [Mark(n.kind, *_rounded(paper(n.at)), n.name) for n in sketch.nodes if n.kind != "hidden"]
    bar, scale = _scale(paper.scale, sketch.unit)
    arrows = tuple(_arrows(sketch, paper.view))
    lines = {id(k): paper(k.at) for k in sketch.lines}
    corners = _corners(arrows, bar, height)
    if any(_meet(dot, box) for dot in _dots(sketch, marks, lines) for box in corners) or any(
        _crosses(box, a, b) for at in lines.values() for a, b in pairwise(at) for box in corners
    ):
        height += _STRIP
        corners = _corners(arrows, bar, height)
    labels, unnamed = _labels(sketch, marks, lines, corners, height)
    return Drawing(_WIDTH, height, tuple(shapes), tuple(marks), labels, arrows, bar, scale, unnamed)


_ORDER = ("axis", "rail", "body", "spring", "actuator", "rod", "elastic", "slider", "path")


def not_drawn(count: int) -> str:
    """Return the sentence of a caption on curves that are omitted."""
    return f" {count} more curves are recorded and not drawn." if count else ""


def view_of_paper(sketch: Sketch) -> Array:
    """Return the two directions of the paper, as columns."""
    gravity = sketch.gravity
    if len(gravity) == 2:
        return np.eye(2)
    up = -gravity / np.linalg.norm(gravity) if np.any(gravity) else np.array([0.0, 0.0, 1.0])
    forth = np.eye(3)[int(np.argmin(np.abs(up)))]
    forth = forth - (forth @ up) * up
    forth /= np.linalg.norm(forth)
    eye = 0.62 * forth + np.cross(up, forth) * 1.0 + 0.55 * up
    eye /= np.linalg.norm(eye)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(eye, right)])


def _rounded(at: Array) -> tuple[float, float]:
    return round(float(at[0]), 2), round(float(at[1]), 2)


def _shapes(line: DrawnLine, at: Array) -> Iterator[PaperLine]:
    if line.kind == "path":
        whole = at[:: max(1, math.ceil(len(at) / _CORNERS))]
        yield PaperLine("path", whole)
    elif line.kind == "spring":
        yield PaperLine("spring", _wound(at))
    elif line.kind == "slider":
        yield PaperLine("slider", slider_block(at, 13.0, 8.0), closed=True)
    elif line.kind == "body" and len(at) > 2:
        middle = at.mean(axis=0)
        _, sizes, axes = np.linalg.svd(at - middle)
        if flat := sizes[1] < _FLAT:
            along = (at - middle) @ axes[0]
            at = at[[np.argmin(along), np.argmax(along)]]
        yield PaperLine("rod" if flat else "body", at if flat else hull(at), closed=not flat)
    else:
        yield PaperLine("rod" if line.kind == "body" else line.kind, at)


def _wound(at: Array) -> Array:
    along = at[1] - at[0]
    length = max(float(np.linalg.norm(along)), 1e-9)
    across = np.array([-along[1], along[0]]) / length * _SPRING
    parts = np.linspace(0.2, 0.8, 2 * _WINDINGS)
    inner = [at[0] + p * along + (-1) ** i * across for i, p in enumerate(parts)]
    return np.array([at[0], at[0] + 0.18 * along, *inner, at[0] + 0.82 * along, at[1]])


def slider_block(at: Array, along: float, across: float) -> Array:
    """Return the corners of a slider on a line, with half its length along and across the line."""
    axis = at[1] - at[0]
    axis = axis / max(float(np.linalg.norm(axis)), 1e-9)
    sides = np.array([(-along, -across), (along, -across), (along, across), (-along, across)])
    return at[0] + sides @ np.array([axis, (-axis[1], axis[0])])


def hull(at: Array) -> Array:
    """Return the vertices of the convex hull, by Andrew's monotone chain."""
    points = sorted({(float(x), float(y)) for x, y in at})

    def half(ordered: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        chain: list[tuple[float, float]] = []
        for p in ordered:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 0:
                chain.pop()
            chain.append(p)
        return chain[:-1]

    return np.array([*half(points), *half(points[::-1])] or points)


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


Box = tuple[float, float, float, float]


def _corners(arrows: Sequence[Arrow], bar: float, height: float) -> list[Box]:
    """Return the boxes of the arrows and of the scale bar in the corners of the drawing."""
    boxes = [(_WIDTH - 28.0 - bar, height - 38.0, _WIDTH - 20.0, height - 8.0)]
    for arrow in arrows:
        x, y = (110.0, height - 54.0) if arrow.kind == "gravity" else (46.0, height - 40.0)
        a, b = sorted((x, x + 1.42 * arrow.x)), sorted((y, y + 1.42 * arrow.y))
        boxes.append((a[0] - 7, b[0] - 9, a[1] + 7, b[1] + 9))
    return boxes


def _dots(sketch: Sketch, marks: Sequence[Mark], lines: dict[int, Array]) -> list[Box]:
    """Return the boxes of points, supports and sliders."""
    dots = [(m.x - 6, m.y - 6, m.x + 6, m.y + 6) for m in marks]
    dots += [(m.x - 14, m.y + 4, m.x + 14, m.y + 22) for m in marks if m.kind == "ground"]
    sliders = [lines[id(line)][0] for line in sketch.lines if line.kind == "slider"]
    return dots + [(x - 14, y - 12, x + 14, y + 12) for x, y in sliders]


def _labels(
    sketch: Sketch, marks: Sequence[Mark], lines: dict[int, Array], corners: Sequence[Box], height: float
) -> tuple[tuple[Label, ...], int]:
    """Place labels without overlap; labels for which there is no room are omitted and counted."""
    occupied, dots = list(corners), _dots(sketch, marks, lines)
    strokes = [
        (a, b)
        for line in sketch.lines
        if line.kind not in ("path", "slider")
        for a, b in pairwise(lines[id(line)])
    ]
    placed, unnamed = [], 0
    labels = [("point", m.x, m.y, m.name) for m in marks if m.name]
    for line in sketch.lines:
        if line.name and line.kind != "path":
            x, y = lines[id(line)].mean(axis=0)
            labels.append(("link", float(x), float(y), line.name))
    for kind, x, y, name in labels:
        place = _place(kind, x, y, name, [*occupied, *dots], strokes, height)
        if place is None:
            unnamed += 1
            continue
        label, box = place
        occupied.append(box)
        placed.append(label)
    return tuple(placed), unnamed


def _place(
    kind: str,
    x: float,
    y: float,
    name: str,
    occupied: Sequence[Box],
    strokes: Sequence[tuple[Array, Array]],
    height: float,
) -> tuple[Label, Box] | None:
    """Return a position around a point where a label overlaps no label or point, if possible also no line."""
    half = len(name) * _LETTER_WIDTH / 2
    best: tuple[int, Label, Box] | None = None
    for reach in (1.0, 1.7, 2.3):
        for i in range(8):
            angle = -math.pi / 4 + i * math.pi / 4
            cx = x + math.cos(angle) * (_OFF * reach + half * abs(math.cos(angle)))
            cy = y - math.sin(angle) * _OFF * reach
            box = (cx - half, cy - _LETTER / 2, cx + half, cy + _LETTER / 2)
            inside = box[0] > 2 and box[2] < _WIDTH - 2 and box[1] > 2 and box[3] < height - 2
            if not inside or any(_meet(box, other) for other in occupied):
                continue
            crossed = sum(_crosses(box, a, b) for a, b in strokes)
            if best is None or crossed < best[0]:
                best = (crossed, Label(kind, round(cx, 2), round(cy + _LETTER * 0.33, 2), name), box)
        if best is not None and best[0] == 0:
            break
    if best is None or best[0] > 1:
        return None
    return best[1], best[2]


def _meet(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _crosses(box: Box, a: Array, b: Array) -> bool:
    """Return whether a line intersects a box, by Liang-Barsky clipping."""
    first, last = 0.0, 1.0
    d = b - a
    for direction, room in (
        (-d[0], a[0] - box[0]),
        (d[0], box[2] - a[0]),
        (-d[1], a[1] - box[1]),
        (d[1], box[3] - a[1]),
    ):
        if direction == 0:
            if room < 0:
                return False
        elif direction < 0:
            first = max(first, room / direction)
        else:
            last = min(last, room / direction)
    return bool(first <= last)


def _arrows(sketch: Sketch, view: Array) -> Iterator[Arrow]:
    for axis, name in zip(np.eye(len(view)) @ view, "xyz", strict=False):
        yield Arrow("direction", round(float(26 * axis[0]), 2), round(float(-26 * axis[1]), 2), name)
    size = float(np.linalg.norm(sketch.gravity))
    if size:
        down = sketch.gravity @ view / size
        yield Arrow("gravity", round(float(26 * down[0]), 2), round(float(-26 * down[1]), 2), "g")


def _scale(per_metre: float, unit: str) -> tuple[float, str]:
    """Return the length of a scale bar near 100 px and its label: 1, 2 or 5 times a power of ten."""
    exact = 100.0 / per_metre
    power = 10.0 ** math.floor(math.log10(exact))
    nice = max(m * power for m in (1.0, 2.0, 5.0) if m * power <= exact * 1.0000001)
    for size, name in ((1e3, "km"), (1.0, "m"), (1e-2, "cm"), (1e-3, "mm"), (1e-6, "µm")):
        if nice >= size * 0.9999 and unit == "m":
            return round(nice * per_metre, 2), f"{nice / size:g} {name}"
    return round(nice * per_metre, 2), f"{nice:g} {unit}"
