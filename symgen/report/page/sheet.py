"""A mechanism in poses with paths of its points, drawn as SVG and as DXF."""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.atomic import writable, write_text
from symgen.report.page.drawing import Drawing, DrawnLine, Node, Sketch, drawing, hull, slider_block
from symgen.report.page.page import environment
from symgen.runtime.sweeps.stores import needed

Array = NDArray[np.float64]

#: Endings of files of drawings.
DRAWN_AS = (".svg", ".dxf")
#: Units of length that DXF knows ($INSUNITS): their size [m] and code; others are written as 0, unitless.
_UNITS = {0.0254: 1, 0.3048: 2, 1e-3: 4, 1e-2: 5, 1.0: 6, 1e3: 7, 0.9144: 10, 1e-6: 13, 0.1: 14}
#: Layers of a DXF file with their colours, by AutoCAD's numbers.
_LAYERS = {"LINKS": 7, "JOINTS": 5, "GROUND": 8, "PATHS": 1, "LOADS": 3, "AXES": 30, "NAMES": 9}
#: The layers of lines by kind; a slider is a joint.
_LAYER_OF = {
    "rail": "GROUND",
    "slider": "JOINTS",
    "spring": "LOADS",
    "actuator": "LOADS",
    "axis": "AXES",
    "path": "PATHS",
}
#: Radius of a joint, over the size of the drawing.
_JOINT = 0.008
#: Height of a letter, over the size of the drawing.
_LETTER = 0.02
#: Half sides of a slider, over the size of the drawing.
_SLIDER = (0.024, 0.015)
#: A path whose ends are no farther apart is closed, over its size.
_CLOSED = 1e-6


@dataclass(frozen=True, slots=True)
class Sheet:
    """A drawing of a mechanism; in notebooks it is shown as SVG.

    Attributes
    ----------
    title
        Title of the scene.
    poses
        The mechanism in one or more poses; the first carries the names.
    paths
        Paths by the name of the point, one place per row [m].
    unit
        Unit of length of DXF and of the scale bar: its name and its size [m].
    """

    title: str
    poses: Sequence[Sketch]
    paths: Mapping[str, Array]
    unit: tuple[str, float]

    def __repr__(self) -> str:
        first = self.poses[0]
        return f"<Sheet {self.title!r}: {len(first.nodes)} joints and points, {len(first.lines)} lines>"

    def _whole(self) -> Sketch:
        """Return all poses and paths in one sketch, in the unit of length."""
        first, *others = self.poses
        size = self.unit[1]
        lines = [DrawnLine("path", name, path / size) for name, path in self.paths.items()]
        nodes = [replace(node, at=node.at / size) for node in first.nodes]
        lines += [replace(line, at=line.at / size) for line in first.lines]
        for pose in others:
            moving = (node for node in pose.nodes if node.kind != "ground")
            nodes += [Node("", node.at / size, node.kind) for node in moving]
            lines += [DrawnLine(k.kind, "", k.at / size) for k in pose.lines if k.kind != "rail"]
        return Sketch(tuple(nodes), tuple(lines), first.gravity, self.unit[0])

    def drawn(self) -> Drawing:
        """Return the drawing for a page: front view in the plane, oblique view in space, with a scale bar."""
        return drawing(self._whole())

    def svg(self) -> str:
        """Return the drawing as SVG on white paper."""
        template = environment().get_template("sheet.svg.j2")
        return template.render(title=self.title, drawing=self.drawn())

    def dxf(self) -> str:
        """Return the drawing as DXF (2010) in the unit of length, with the layers of ``_LAYERS``.

        In the plane a joint is a circle about its centre, in space a point.

        Raises
        ------
        ModelError
            Where ezdxf is not installed.
        """
        needed("a drawing in DXF", "ezdxf", extra="dxf")
        import ezdxf

        fixed, ezdxf.options.write_fixed_meta_data_for_testing = (
            ezdxf.options.write_fixed_meta_data_for_testing,
            True,  # no dates and no random names: equal drawings have equal bytes
        )
        try:
            document = ezdxf.new("R2010", units=_UNITS.get(self.unit[1], 0))
            for name, colour in _LAYERS.items():
                document.layers.add(name, color=colour)
            _write(document.modelspace(), self._whole())
            stream = io.StringIO()
            document.write(stream)
        finally:
            ezdxf.options.write_fixed_meta_data_for_testing = fixed
        return stream.getvalue()

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Write the drawing to ``.svg`` or ``.dxf``.

        Raises
        ------
        ResultError
            When the ending is another one, or the file cannot be written.
        """
        path = writable(file, DRAWN_AS, "drawing")
        write_text(path, self.dxf() if path.suffix.lower() == ".dxf" else self.svg())
        return path

    def _repr_svg_(self) -> str:
        return self.svg()


def _write(space: Any, sketch: Sketch) -> None:
    """Write the lines, joints and names of a sketch into the model space of a DXF document."""
    lines = [line for line in sketch.lines if np.ptp(line.at, axis=0).any()]
    every = np.vstack([*(line.at for line in lines), *(node.at[None] for node in sketch.nodes)])
    size, plane = float(np.max(np.ptp(every, axis=0))) or 1.0, every.shape[1] == 2
    for line in lines:
        layer = {"layer": _LAYER_OF.get(line.kind, "LINKS")}
        round_trip = line.kind == "path" and _meets_itself(line.at)
        at = line.at[:-1] if round_trip else line.at
        if not plane and line.kind != "slider":
            closed = round_trip or (line.kind == "body" and len(line.at) > 2)
            space.add_polyline3d(at.tolist(), close=closed, dxfattribs=layer)
        elif plane:
            outlines = {
                "slider": lambda at: slider_block(at, *(half * size for half in _SLIDER)),
                "body": hull,
            }
            corners = outlines.get(line.kind, np.asarray)(at)
            closed = round_trip or (line.kind in outlines and len(corners) > 2)
            space.add_lwpolyline(corners.tolist(), close=closed, dxfattribs=layer)
    for node in sketch.nodes:
        layer = {"layer": "GROUND" if node.kind == "ground" else "JOINTS"}
        if node.kind != "hidden" and plane:
            space.add_circle(node.at.tolist(), _JOINT * size, dxfattribs=layer)
        elif node.kind != "hidden":
            space.add_point(node.at.tolist(), dxfattribs=layer)
        if node.kind == "ground" and plane:
            support = node.at + _JOINT * size * np.array([[0.0, -1.0], [-2.0, -4.0], [2.0, -4.0]])
            space.add_lwpolyline(support.tolist(), close=True, dxfattribs=layer)
    letter, lines_at = _LETTER * size, Counter[tuple[float, ...]]()
    for name, at in _names(sketch):
        place = tuple(np.round(at / (3 * letter)))
        text = space.add_text(name, height=letter, dxfattribs={"layer": "NAMES"})
        text.set_placement((at[0] + letter, at[1] + letter * (1.0 - 1.5 * lines_at[place]), *at[2:]))
        lines_at[place] += 1


def _meets_itself(path: Array) -> bool:
    """Return whether a path ends where it began, but for errors of the run."""
    gap = float(np.linalg.norm(path[-1] - path[0]))
    return len(path) > 3 and gap <= _CLOSED * float(np.max(np.ptp(path, axis=0)))


def _names(sketch: Sketch) -> Iterator[tuple[str, Array]]:
    """Yield the names of points and links with their places."""
    yield from ((node.name, node.at) for node in sketch.nodes if node.name and node.kind != "hidden")
    for line in sketch.lines:
        if line.name and line.kind != "path":
            yield line.name, line.at.mean(axis=0)
