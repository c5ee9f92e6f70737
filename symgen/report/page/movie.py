"""A film as GIF or MP4: the picture of the page, drawn by Matplotlib frame by frame."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from subprocess import CalledProcessError
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from symgen.atomic import replacing, writable, write_text
from symgen.errors import ModelError, OutputError
from symgen.report.page.animation import Film, animation, curves_of, forces_of, nodes_of, traces_of
from symgen.report.page.drawing import Paper, PaperLine, Sketch
from symgen.report.page.page import LIGHT

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

#: Adds an artist in pixels on paper to the frame that is drawn.
Add = Callable[["Artist"], None]

#: Endings of files of frames, and of all animations.
_FRAMES = (".gif", ".mp4")
FILMED_AS = (".html", *_FRAMES)
#: Most pictures per second.
_RATE = 25.0
#: Shortest film [s].
_SHORTEST = 2.0
#: Longest film [s].
_LONGEST = 20.0
#: Duration of a film of poses without times [s].
_TIMELESS = 5.0
#: Pixels of a film per pixel on paper.
_ENLARGED = 1.5
#: Points of print per pixel.
_PRINT = 0.72
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


def save(film: Film, file: Path, progress: Callable[[str], None] | None = None) -> None:
    """Write a film as HTML page, GIF or MP4, by the ending of the file; raise as :func:`movie`."""
    if file.suffix.lower() in _FRAMES:
        movie(film, file, progress)
    else:
        write_text(file, animation(film))


def movie(film: Film, file: Path, progress: Callable[[str], None] | None = None) -> None:
    """Write a film as GIF or MP4: the mechanism, paths of points, forces and the value of the coordinate.

    A run is played in its own time, or in as many seconds as leave between 2 and 20, like on the page.
    ``progress`` is called with the progress before every frame.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    count = film.result.count
    duration = float(np.sum(np.abs(np.diff(film.result.time))))
    seconds = float(np.clip(duration or _TIMELESS, _SHORTEST, _LONGEST))
    shown = np.unique(np.linspace(0, count - 1, min(count, round(_RATE * seconds) + 1)).round().astype(int))
    shown = shown[: max(1, len(shown) - 1)]  # the last is the first of the next round
    write = _write_gif if file.suffix.lower() == ".gif" else _write_mp4
    with replacing(file, "film") as temporary:
        try:
            write(temporary, _drawn(film, shown, progress), len(shown) / seconds)
        except CalledProcessError as error:
            last = error.stderr.strip().rpartition("\n")[2]
            raise OutputError(
                f"cannot write the film to {file}: ffmpeg ended with exit code {error.returncode}"
                + (f"\n  {last}" if last else "")
            ) from None


def _drawn(film: Film, shown: NDArray[np.int_], progress: Callable[[str], None] | None) -> Iterator[Figure]:
    """Yield a figure with each of the frames to show, one after the other."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.transforms import Affine2D

    paper, along = Paper.of(film.sketches), film.result.over
    traces = [paper(places) for places in traces_of(film.sketches).values()]
    forces = ForceArrows.of(film, paper)
    figure = Figure((paper.width / 100, paper.height / 100), dpi=100 * _ENLARGED, facecolor=_PAPER)
    FigureCanvasAgg(figure)
    to_figure = Affine2D().scale(1 / paper.width, -1 / paper.height).translate(0, 1) + figure.transFigure

    # Artists of the figure itself: axes would update their limits for every line.
    def add(artist: Artist) -> None:
        artist.set_transform(to_figure)
        figure.add_artist(artist)

    for i, k in enumerate(shown, start=1):
        if progress:
            progress(f"writing frame {i} of {len(shown)}")
        figure.clear()
        for trace in traces:
            _draw(add, PaperLine("path", trace))
        _draw_pose(add, paper, film.sketches[k])
        forces.draw(add, k, paper.height)
        _write(add, (12, 20), film.result.title, _INK, paper.width - 24)
        _write(add, (12, paper.height - 12), f"{along[1]}: {along[0][k]:.4g}", _SOFT)
        yield figure


def _write_gif(file: Path, figures: Iterator[Figure], rate: float) -> None:
    """Write frames with 256 colours each, by the fastest quantiser: median cut takes as long as drawing."""
    from PIL import Image

    frames: list[Image.Image] = []
    for figure in figures:
        canvas: Any = figure.canvas
        canvas.draw()
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())
        frames.append(picture.quantize(method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE))
    frames[0].save(file, "GIF", save_all=True, append_images=frames[1:], duration=round(1000 / rate), loop=0)


def _write_mp4(file: Path, figures: Iterator[Figure], rate: float) -> None:
    from matplotlib.animation import FFMpegWriter

    writer, first = FFMpegWriter(fps=cast("int", rate)), next(figures)
    with writer.saving(first, str(file), first.dpi):
        writer.grab_frame()
        for _ in figures:
            writer.grab_frame()


@dataclass(frozen=True, slots=True)
class ForceArrows:
    """Arrows on paper: beginnings and vectors, (forces, frames, 2) [px]; length and label of a round one."""

    at: Array
    along: Array
    scale: float
    label: str

    @classmethod
    def of(cls, film: Film, paper: Paper) -> ForceArrows:
        """Return the arrows of a film, scaled to the paper."""
        forces = forces_of(curves_of(film.result.shown), nodes_of(film.sketches[0]))
        values = np.array(
            [np.transpose([part["values"] for part in f["parts"]]) for f in forces], dtype=float
        )
        largest = float(np.nanmax(np.linalg.norm(values, axis=-1), initial=0.0))
        if not largest > 0.0:
            return cls(np.zeros((0, 0, 2)), np.zeros((0, 0, 2)), 0.0, "")
        at = np.array([[paper(s.nodes[f["node"]].at) for s in film.sketches] for f in forces])
        along = (values @ paper.view) * (1.0, -1.0)
        room = np.where(along > 0, (paper.width, paper.height) - at - 6.0, 6.0 - at)
        with np.errstate(divide="ignore", invalid="ignore"):
            per = min(
                _REACH * paper.height / largest, float(np.nanmin(np.where(along, room / along, np.inf)))
            )
        power = 10.0 ** math.floor(math.log10(largest))
        shown = next((x for x in (5, 2) if x * power <= largest), 1) * power
        unit = forces[0]["parts"][0]["unit"]
        return cls(at, along * per, shown * per, f"{shown:g} {unit}")

    def draw(self, add: Add, frame: int, height: float) -> None:
        """Draw the arrows of a frame, and one of a round force, on paper of a height [px]."""
        from matplotlib.patches import FancyArrowPatch

        if not self.scale:
            return
        bottom = height - 34
        arrows = [(a[frame], v[frame]) for a, v in zip(self.at, self.along, strict=True)]
        for at, along in [*arrows, (np.array([12.0, bottom]), np.array([self.scale, 0.0]))]:
            if np.linalg.norm(along) > 1.0:
                add(
                    FancyArrowPatch(
                        at, at + along, arrowstyle="-|>", mutation_scale=10, shrinkA=0, shrinkB=0,
                        color=_FORCE, linewidth=1.8 * _PRINT, zorder=3,
                    )
                )  # fmt: skip
        _write(add, (12, bottom - 8), self.label, _FORCE)


def _draw(add: Add, shape: PaperLine) -> None:
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
    add(drawn)


def _draw_pose(add: Add, paper: Paper, sketch: Sketch) -> None:
    """Draw lines, points and names of one frame."""
    from matplotlib.lines import Line2D

    for shape in paper.shapes(sketch):
        _draw(add, shape)
    names, lines = [], [paper(line.at) for line in sketch.lines if line.kind != "slider"]
    for node in sketch.nodes:
        if node.kind == "hidden":
            continue
        x, y = paper(node.at)
        if node.kind == "ground":
            _draw(add, PaperLine("rail", np.array([[x, y], [x - 8, y + 13], [x + 8, y + 13]]), closed=True))
            for i in range(-10, 11, 5):
                _draw(add, PaperLine("rail", np.array([[x + i, y + 13], [x + i - 4, y + 18]])))
        fill, size = (_INK, 6.4) if node.kind == "end" else (_PAPER, 8.0)
        mark = Line2D([x], [y], marker="o", markersize=size * _PRINT, markerfacecolor=fill)
        mark.set(markeredgecolor=_INK, markeredgewidth=1.6 * _PRINT)
        add(mark)
        dx, dy = _away(np.array([x, y]), lines, node.kind == "ground")
        names.append((x + 12 * dx + 4 * (dx - 1) * len(node.name), y + 14 * dy + 4, node.name, _INK))
    for line in sketch.lines:
        at = paper(line.at)
        along = at[1] - at[0]
        length = float(np.linalg.norm(along))
        if line.name and length > 1.0:
            across = np.array([-along[1], along[0]]) / length
            side = -1.0 if across[0] < 0 else 1.0
            x, y = at.mean(axis=0) + 9 * side * across
            names.append((x, y + 4, line.name, _SOFT))
    occupied: list[tuple[float, float, float]] = []
    for x, y, name, colour in names:
        box = (x, x + 8.0 * len(name), y)
        if not any(box[0] < b[1] and b[0] < box[1] and abs(y - b[2]) < 14 for b in occupied):
            occupied.append(box)
            _write(add, (x, y), name, colour)


def _away(joint: Array, lines: Sequence[Array], ground: bool) -> Array:
    """Return the direction from a joint away from its lines; not down into the support of a ground point."""
    ways = [q - p for at in lines for p, q in (*pairwise(at), *pairwise(at[::-1])) if _near(p, joint)]
    units = [way / (np.linalg.norm(way) or 1.0) for way in ways]
    direction: Array = -np.sum(units, axis=0) if units else np.array([1.0, -1.0])
    if np.linalg.norm(direction) < 0.3:
        direction = np.array([-units[0][1], units[0][0]])
    if ground and direction[1] > -0.3 * np.linalg.norm(direction):
        direction = np.array([-1.0 if direction[0] < 0 else 1.0, -0.6])
    return direction / (np.linalg.norm(direction) or 1.0)


def _near(a: Array, b: Array) -> bool:
    return float(np.linalg.norm(a - b)) < 1.5


def _write(add: Add, at: tuple[float, float], text: str, colour: str, room: float = math.inf) -> None:
    """Write a text, in smaller letters if it is wider than the room [px], legible on lines."""
    from matplotlib.patheffects import withStroke
    from matplotlib.text import Text

    size = min(13.0, room / (0.6 * max(1, len(text)))) * _PRINT
    around = [withStroke(linewidth=3.0 * _PRINT, foreground=_PAPER)]
    add(Text(*at, text, color=colour, fontsize=size, path_effects=around))
