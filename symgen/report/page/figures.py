"""Plots of runs for a page: SVG from Matplotlib, embedded as data URIs."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from symgen.report.page.drawing import not_drawn
from symgen.report.page.plots import draw_errors
from symgen.runtime.result.records import Variable, columns
from symgen.runtime.result.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Width of a figure [in].
_WIDTH = 7.4
#: Height of a panel [in].
_PANEL = 1.75
#: Most curves of a panel.
_CURVES = 6
#: Most panels of a page.
_PANELS = 6
#: Maximum number of samples per curve; longer curves are thinned.
_TIMES = 400
_STYLE: Any = {
    "svg.fonttype": "path",
    "svg.hashsalt": "symgen",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.2,
    "axes.prop_cycle": "cycler(color=['#1f5c99', '#c2571a', '#2e7d4f', '#8a3f8f', '#a08a1c', '#5b6770'])",
}


@dataclass(frozen=True, slots=True)
class FigureView:
    """A figure: its data as a URI, alternative text and caption."""

    uri: str
    alt: str
    caption: str


def run_figure(result: Result) -> FigureView:
    """Plot the outputs of a run, one panel per kind; the caption gives the number of omitted curves."""
    panels: dict[str, list[tuple[str, Any]]] = {}
    for variable in result.shown:
        panels.setdefault(result.panel(variable), []).extend(_curves(variable))
    along, label = result.over
    every = max(1, len(along) // _TIMES)
    drawn = dict(list(panels.items())[:_PANELS])
    left = sum(max(0, len(c) - _CURVES) for c in drawn.values())
    left += sum(len(c) for name, c in panels.items() if name not in drawn)
    with _styled() as styled:
        figure = styled(figsize=(_WIDTH, 0.55 + _PANEL * len(drawn)), layout="constrained")
        axes = figure.subplots(len(drawn), 1, sharex=True, squeeze=False)[:, 0]
        for panel, (name, curves) in zip(axes, drawn.items(), strict=True):
            for text, values in curves[:_CURVES]:
                panel.plot(along[::every], values[::every], label=text)
            panel.set_ylabel(name)
            panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.03))
        axes[-1].set_xlabel(label)
        uri = _uri(figure)
    names = ", ".join(drawn)
    return FigureView(
        uri, f"Curves over {label}: {names}", f"Recorded outputs over {label}.{not_drawn(left)}"
    )


def plain_figure(draw: Callable[[], Figure], alt: str, caption: str = "") -> FigureView:
    """Return a figure that a function draws, in the style of pages."""
    with _styled():
        return FigureView(_uri(draw()), alt, caption)


def error_figure(curves: Sequence[tuple[str, Sequence[tuple[float, float]]]], measured: str) -> FigureView:
    """Plot time against error, with one curve (error, time [s]) per method; errors decrease to the right."""
    with _styled() as styled:
        figure = styled(figsize=(_WIDTH, 3.1), layout="constrained")
        axes: Axes = figure.subplots()
        draw_errors(axes, curves, measured)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.02))
        uri = _uri(figure)
    return FigureView(uri, "Wall time of a run against its error, one curve per method", "")


def _curves(variable: Variable) -> Iterator[tuple[str, Any]]:
    for part in columns([variable]):
        yield part.name, part.values


@contextmanager
def _styled() -> Iterator[type[Figure]]:
    """Give figures the style of the page, until they are written."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        yield Figure


def _uri(figure: Any) -> str:
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode()
