"""Plots of runs for a page: SVG from Matplotlib, embedded as data URIs."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from symgen.report.page.page import LIGHT, FigureView
from symgen.report.page.plots import WIDTH, also_recorded, draw_errors, figure_of, legend_above, panels_of
from symgen.runtime.result.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours of text, axes and curves on white, and those that replace them on dark paper; maps keep theirs.
_SCHEMES = {
    LIGHT["ink"]: "#e4e6e9",
    "#1f5c99": "#7fb2e6",
    "#c2571a": "#f0975e",
    "#2e7d4f": "#6fc795",
    "#8a3f8f": "#d796dc",
    "#a08a1c": "#d8c455",
    "#5b6770": "#a9b4bd",
    "#b03052": "#f0869f",
    "#0f8b8d": "#5fd0d2",
}
_INK, *_CURVES = _SCHEMES
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
    "axes.prop_cycle": f"cycler(color={_CURVES})",
    **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), _INK),
    "grid.color": _INK,
}


def run_figure(result: Result, *, schemes: bool = True) -> FigureView:
    """Plot the outputs of a run, one panel per quantity; the caption names the omitted ones.

    Without ``schemes`` the figure is drawn on white paper, for notebooks.
    """
    drawn, omitted = panels_of(result)
    with _styled():
        uri = _uri(figure_of(result, drawn, samples=_TIMES), schemes)
    label = result.over[1]
    caption = f"Recorded outputs over {label}. {also_recorded(omitted)}".rstrip()
    return FigureView(uri, f"Curves over {label}: {', '.join(drawn)}", caption)


def plain_figure(
    draw: Callable[[], Figure], alt: str, caption: str = "", *, schemes: bool = True
) -> FigureView:
    """Return a figure that a function draws, in the style of pages; without ``schemes`` on white paper."""
    with _styled():
        return FigureView(_uri(draw(), schemes), alt, caption)


def error_figure(curves: Sequence[tuple[str, Sequence[tuple[float, float]]]], measured: str) -> FigureView:
    """Plot time against error, with one curve (error, time [s]) per method; errors decrease to the right."""
    with _styled() as styled:
        figure = styled(figsize=(WIDTH, 3.1), layout="constrained")
        axes: Axes = figure.subplots()
        draw_errors(axes, curves, measured)
        legend_above(axes)
        uri = _uri(figure)
    return FigureView(uri, "Wall time of a run against its error, one curve per method", "")


@contextmanager
def _styled() -> Iterator[type[Figure]]:
    """Give figures the style of the page, until they are written."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        yield Figure


def _uri(figure: Any, schemes: bool = True) -> str:
    """Return a figure as a URI; its ink follows the colour scheme of the page, if it has ``schemes``."""
    stream = io.BytesIO()
    metadata = {"Date": None, "Creator": None}
    figure.savefig(stream, format="svg", transparent=schemes, metadata=metadata)
    svg = stream.getvalue().decode()
    if schemes:
        light, dark = (
            "".join(f"--c{i}:{pair[k]};" for i, pair in enumerate(_SCHEMES.items())) for k in (0, 1)
        )
        for i, colour in enumerate(_SCHEMES):
            svg = svg.replace(colour, f"var(--c{i})")
        style = f"<style>svg{{{light}}}@media(prefers-color-scheme:dark){{svg{{{dark}}}}}</style>"
        svg = svg.replace("<defs>", f"{style}<defs>", 1)
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()
