"""A film as GIF or MP4: the picture of the page, drawn by Matplotlib frame by frame."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.atomic import replacing, writable, write_text
from symgen.errors import ModelError, ResultError
from symgen.report.page.animation import Film, animation, curves_of, forces_of, nodes_of, traces_of
from symgen.report.page.drawing import Paper, Shape, Sketch
from symgen.report.page.page import LIGHT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

#: Writers of Matplotlib by the ending of the file.
_WRITERS = {".gif": "pillow", ".mp4": "ffmpeg"}
#: Endings of files of animations.
FILMED_AS = (".html", *_WRITERS)
#: Pictures per second at most, and bounds of the duration of a film [s].
_RATE, _SHORTEST, _LONGEST = 25.0, 2.0, 20.0
#: Points of a film without times [s]; pixels of a film per pixel on paper; points of print per pixel.
_TIMELESS, _ENLARGED, _PRINT = 5.0, 1.5, 0.72
_INK, _SOFT, _FILL, _PAPER, _BLUE, _WARM, _FORCE = LIGHT.values()
#: Length of the longest arrow of a force over the height of the picture.
_REACH = 0.2
#: Colour, width [px], dashes and fill of lines by kind.
_STYLES: dict[str, tuple[str, float, str, str]] = {
    "rod": (_INK, 4.0, "-", "none"),
    "elastic": (_BLUE, 4.0, "-", "none"),
    "body": (_INK, 2.0, "-", _FILL),
    "rail": (_SOFT, 1.5, "-", "none"),
    "axis": (_WARM, 1.2, "--", "none"),
    "spring": (_BLUE, 1.6, "-", "none"),
    "actuator": (_BLUE, 1.6, ":", "none"),
    "slider": (_INK, 1.6, "-", _PAPER),
    "path": (_WARM, 1.0, "-", "none"),
}


def film_file(file: str | os.PathLike[str]) -> Path:
    """Return the path of an animation, checked before the picture is made.

    Raises
    ------
    ResultError
        For another ending, and where no file can be written.
    ModelError
        For MP4 without ffmpeg.
    """
    path = writable(file, FILMED_AS, "animation")
    if path.suffix.lower() != ".mp4":
        return path
    from matplotlib.animation import FFMpegWriter

    if not FFMpegWriter.isAvailable():
        raise ModelError(
            "MP4 is written by ffmpeg, which is not found\n"
            "  Install it (apt install ffmpeg, brew install ffmpeg), or write a file ending in .gif."
        )
    return path


def save(film: Film, file: Path, told: Callable[[str], None] | None = None) -> None:
    """Write a film as HTML page, GIF or MP4, by the ending of the file; raise as :func:`movie`."""
    if file.suffix.lower() in _WRITERS:
        movie(film, file, told)
    else:
        write_text(file, animation(film))


def movie(film: Film, file: Path, told: Callable[[str], None] | None = None) -> None:
    """Write a film as GIF or MP4: the mechanism, paths of points, forces and the value of the coordinate.

    A run is played in its own time, or in as many seconds as leave between 2 and 20, like on the page.
    ``told`` is called with the progress before every frame.

    Raises
    ------
    ResultError
        When the file cannot be written.
    """
    from matplotlib.animation import writers
    from matplotlib.figure import Figure

    paper = Paper.of(film.sketches)
    count, along = film.result.count, film.result.over
    own = float(np.sum(np.abs(np.diff(film.result.time))))
    seconds = float(np.clip(own or _TIMELESS, _SHORTEST, _LONGEST))
    shown = np.unique(np.linspace(0, count - 1, min(count, round(_RATE * seconds) + 1)).round().astype(int))
    shown = shown[: max(1, len(shown) - 1)]  # the last is the first of the next round
    traces = [paper(places) for places in traces_of(film.sketches).values()]
    forces = _Forces.of(film, paper)
    figure = Figure(figsize=(paper.width / 100, paper.height / 100), facecolor=_PAPER)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    rate: Any = len(shown) / seconds
    writer = writers[_WRITERS[file.suffix.lower()]](fps=rate)
    try:
        with replacing(file) as temporary, writer.saving(figure, str(temporary), 100 * _ENLARGED):
            for i, k in enumerate(shown, start=1):
                if told:
                    told(f"writing frame {i} of {len(shown)}")
                axes.clear()
                axes.set(xlim=(0, paper.width), ylim=(paper.height, 0))
                axes.set_axis_off()
                for trace in traces:
                    _draw(axes, Shape("path", trace))
                _draw_pose(axes, paper, film.sketches[k])
                forces.draw(axes, k)
                _write(axes, (12, 20), film.result.title, _INK, paper.width - 24)
                _write(axes, (12, paper.height - 12), f"{along[1]}: {along[0][k]:.4g}", _SOFT)
                writer.grab_frame()
    except OSError as error:
        raise ResultError(f"cannot write the film to {file}: {error.strerror or error}") from None


@dataclass(frozen=True, slots=True)
class _Forces:
    """Arrows on paper: beginnings and vectors, (forces, frames, 2) [px]; length and label of a round one."""

    at: Array
    along: Array
    scale: float
    label: str

    @classmethod
    def of(cls, film: Film, paper: Paper) -> _Forces:
        forces = forces_of(curves_of(film.result.shown), nodes_of(film.sketches[0]))
        values = np.array(
            [np.transpose([part["values"] for part in f["parts"]]) for f in forces], dtype=float
        )
        largest = float(np.nanmax(np.linalg.norm(values, axis=-1), initial=0.0))
        if not largest > 0.0:
            return cls(np.zeros((0, 0, 2)), np.zeros((0, 0, 2)), 0.0, "")
        per = _REACH * paper.height / largest
        at = np.array([[paper(s.nodes[f["node"]].at) for s in film.sketches] for f in forces])
        power = 10.0 ** math.floor(math.log10(largest))
        shown = next((x for x in (5, 2) if x * power <= largest), 1) * power
        unit = forces[0]["parts"][0]["unit"]
        return cls(at, (values @ paper.view) * per * (1.0, -1.0), shown * per, f"{shown:g} {unit}")

    def draw(self, axes: Axes, frame: int) -> None:
        """Draw the arrows of a frame, and one of a round force."""
        if not self.scale:
            return
        bottom = axes.get_ylim()[0] - 34
        arrows = [(a[frame], v[frame]) for a, v in zip(self.at, self.along, strict=True)]
        for at, along in [*arrows, (np.array([12.0, bottom]), np.array([self.scale, 0.0]))]:
            if np.linalg.norm(along) > 1.0:
                style = {"arrowstyle": "-|>", "color": _FORCE, "lw": 1.8 * _PRINT, "shrinkA": 0, "shrinkB": 0}
                axes.annotate("", at + along, at, arrowprops=style)
        _write(axes, (12, bottom - 8), self.label, _FORCE)


def _draw(axes: Axes, shape: Shape) -> None:
    from matplotlib.patches import Polygon

    colour, width, dashes, fill = _STYLES[shape.kind]
    alpha = 0.55 if shape.kind == "path" else 1.0
    drawn: Any = Polygon(
        shape.at,
        closed=shape.closed,
        fill=shape.closed,
        facecolor=fill,
        edgecolor=colour,
        linewidth=width * _PRINT,
        linestyle=dashes,
        alpha=alpha,
        capstyle="round",
        joinstyle="round",
    )
    axes.add_patch(drawn)


def _draw_pose(axes: Axes, paper: Paper, sketch: Sketch) -> None:
    """Draw lines, points and names of one frame."""
    for shape in paper.shapes(sketch):
        _draw(axes, shape)
    names = []
    for node in sketch.nodes:
        if node.kind == "hidden":
            continue
        x, y = paper(node.at)
        if node.kind == "ground":
            _draw(axes, Shape("rail", np.array([[x, y], [x - 8, y + 13], [x + 8, y + 13]]), closed=True))
            for i in range(-10, 11, 5):
                _draw(axes, Shape("rail", np.array([[x + i, y + 13], [x + i - 4, y + 18]])))
        fill, size = (_INK, 6.4) if node.kind == "end" else (_PAPER, 8.0)
        axes.plot(x, y, "o", ms=size * _PRINT, mfc=fill, mec=_INK, mew=1.6 * _PRINT)
        names.append((x + 9, y - 9, node.name, _INK))
    for line in sketch.lines:
        at = paper(line.at)
        along = at[1] - at[0]
        length = float(np.linalg.norm(along))
        if line.name and length > 1.0:
            across = np.array([-along[1], along[0]]) / length
            side = -1.0 if across[0] < 0 else 1.0
            x, y = at.mean(axis=0) + 9 * side * across
            names.append((x, y + 4, line.name, _SOFT))
    taken: list[tuple[float, float, float]] = []
    for x, y, name, colour in names:
        box = (x, x + 8.0 * len(name), y)
        if not any(box[0] < b[1] and b[0] < box[1] and abs(y - b[2]) < 14 for b in taken):
            taken.append(box)
            _write(axes, (x, y), name, colour)


def _write(axes: Axes, at: tuple[float, float], text: str, colour: str, room: float = math.inf) -> None:
    """Write a text, in smaller letters if it is wider than the room [px], legible on lines."""
    from matplotlib.patheffects import withStroke

    size = min(13.0, room / (0.6 * max(1, len(text)))) * _PRINT
    around = [withStroke(linewidth=3.0 * _PRINT, foreground=_PAPER)]
    axes.text(*at, text, color=colour, fontsize=size, path_effects=around)
