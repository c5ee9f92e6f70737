"""Plots of results."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.errors import ResultError
from symgen.runtime.result.records import Variable, columns, converted
from symgen.runtime.result.result import Result

#: Supported file name extensions of plots.
DRAWN_AS = (".png", ".svg", ".pdf")
#: Width of a figure and height of a panel [in]; text stays readable at half the width of a phone.
WIDTH, _PANEL = 5.6, 1.75
#: Width of a letter of a legend, and of the rest of an entry [in]; letters in a line of a title.
_LETTER, _KEY, _LINE = 0.06, 0.4, 95
#: Most panels, and curves of each, without selected outputs.
PANELS, _CURVES = 6, 8
#: Least range of such a curve, over its largest value.
_VARIES = 1e-9
#: Errors from here on are those of another motion.
_LARGEST = 10.0
#: SI units of the first panels of an inverse dynamics: those of efforts.
_EFFORTS = ("N*m", "N")

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot(
    result: Result,
    *names: str,
    file: str | os.PathLike[str] | None = None,
    xy: str = "",
    over: str = "",
    compare: Mapping[str, Result] | None = None,
) -> Figure:
    """Plot outputs in the panels of the result; save the figure if ``file`` is given.

    Parameters
    ----------
    result
        The result.
    names
        Outputs, such as ``C.position`` or ``C.position.x``, or points or links for all their recorded
        outputs. If none is given, the first six quantities that vary, efforts first; a panel of many curves
        shows magnitudes of vectors, and the largest of these, without equal ones.
    file
        Output file; its extension selects the format.
    xy
        A point, or an output with components: its path, y over x with equal axes, is drawn instead.
    over
        Output or component on the horizontal axis; by default the coordinate of the result.
    compare
        Further results by the labels of their curves, which are dashed or dotted; they need the same outputs.

    Raises
    ------
    ResultError
        If no output of a name was recorded, a result to compare with is none, or the file cannot be written.
    """
    if xy:
        return _path(result, xy, file, compare or {})
    chosen, omitted = panels_of(result, names)
    return _titled(figure_of(result, chosen, over, compare), result, file, also_recorded(omitted))


def panels_of(
    result: Result, names: Sequence[str] = ()
) -> tuple[dict[str, list[Variable]], dict[str, list[Variable]]]:
    """Return the outputs of each panel by its label: those drawn, and those omitted without selected ones."""
    panels = _selected(result, names) if names else _by_default(result)
    drawn = [*panels] if names else [*panels][:PANELS]
    return {n: panels[n] for n in drawn}, {n: v for n, v in panels.items() if n not in drawn}


def also_recorded(omitted: Iterable[str]) -> str:
    """Return a sentence on panels that a plot omits; empty if there are none."""
    return f"Also recorded: {', '.join(omitted)}." if omitted else ""


def figure_of(
    result: Result,
    chosen: Mapping[str, Sequence[Variable]],
    over: str = "",
    compare: Mapping[str, Result] | None = None,
    samples: int | None = None,
) -> Figure:
    """Draw panels of outputs by their labels, each with a legend; with about ``samples`` points per curve."""
    from symgen.report.picture import Picture

    labels = list(chosen)
    figure = Picture(figsize=(WIDTH, 0.9 + _PANEL * len(labels)), layout="constrained")
    panels = dict(zip(labels, figure.subplots(len(labels), 1, sharex=True, squeeze=False)[:, 0], strict=True))
    for ending, source, style in _curves(result, compare or {}):
        along, words = _along(source, over)
        every = slice(None, None, max(1, len(along) // samples) if samples else 1)
        for panel, variables in chosen.items():
            for part in columns([_in_units_of(result, source, v) for v in variables]):
                panels[panel].plot(along[every], part.values[every], style, label=part.name + ending)
        panels[labels[-1]].set_xlabel(words)
    for panel_label, panel in panels.items():
        panel.set_ylabel(panel_label.replace(" [", "\n["))
        panel.ticklabel_format(axis="y", useOffset=False)
        panel.yaxis.get_offset_text().set(x=-0.01, ha="right")  # a power of ten, beside the legend
        panel.grid(alpha=0.3)
        _flatten(panel, min(result.drift.scale(v.unit, _range(v)) for v in chosen[panel_label]))
        legend_above(panel)
    return figure


def legend_above(panel: Any) -> None:
    """Give a panel its legend above the axes, in columns as wide as the longest label."""
    longest = max(len(str(line.get_label())) for line in panel.lines)
    columns = max(1, int((WIDTH - 0.8) / (_KEY + _LETTER * longest)))
    panel.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        fontsize=8.0,
        frameon=False,
        borderaxespad=0.1,
        handlelength=1.4,
        columnspacing=1.2,
    )


def _flatten(panel: Any, scale: float) -> None:
    """Widen a panel in which only round-off varies; all is flat on a scale above zero."""
    values = np.concatenate([line.get_ydata() for line in panel.lines])
    values = values[np.isfinite(values)]
    size = np.max(np.abs(values), initial=scale)
    if size > 0 and values.size and (np.ptp(values) <= _VARIES * size or scale > 0):
        panel.set_ylim(values.mean() - size, values.mean() + size)


def _curves(result: Result, compare: Mapping[str, Result]) -> list[tuple[str, Result, str]]:
    """Return the results of a plot with the endings of their labels and their line styles."""
    for of, other in compare.items():
        if not isinstance(other, Result):
            raise ResultError(f"expected results to compare with, got {other!r} for {of!r}")
    styles = cycle(("--", ":", "-."))
    return [("", result, "-"), *((f", {of}", other, next(styles)) for of, other in compare.items())]


def _along(result: Result, name: str) -> tuple[Any, str]:
    """Return values and label of the horizontal axis."""
    if name in ("", result.coordinate.name):
        return result.over
    variable = _shown(result, name)
    if variable.components:
        parts = ", ".join(f"{name}.{c}" for c in variable.components)
        raise ResultError(f"expected one output for the horizontal axis, got {name!r}: choose of {parts}")
    return variable.values, f"{variable.name} [{variable.unit}]"


def _in_units_of(result: Result, source: Result, variable: Variable) -> Variable:
    """Return an output of another result in the units of the first one."""
    (variable_in_units,) = converted([source.variable(variable.name.strip("|"))], result.units)
    return _magnitude(variable_in_units) if variable.name.startswith("|") else variable_in_units


def _titled(figure: Figure, result: Result, file: str | os.PathLike[str] | None, note: str = "") -> Figure:
    set_title(figure, result.title, result.headline, note)
    if file is not None:
        save(figure, file)
    return figure


def set_title(figure: Figure, *texts: str) -> None:
    """Set the title of a figure: each text begins a line, and fills as many as it needs."""
    lines = [line for text in texts for line in wrap(text, _LINE)]
    figure.suptitle("\n".join(lines), fontsize="small")


def _path(
    result: Result, name: str, file: str | os.PathLike[str] | None, compare: Mapping[str, Result]
) -> Figure:
    """Plot the y of an output over its x, such as the path of a point; a dot marks the start."""
    from symgen.report.picture import Picture

    known = [v.name for v in result.variables]
    variable = _shown(result, f"{name}.position" if f"{name}.position" in known else name)
    if len(variable.components) < 2:
        raise ResultError(f"expected a point or an output with components x and y for xy, got {name!r}")
    figure = Picture(figsize=(7, 7), layout="constrained")
    axes = figure.subplots()
    for label, source, style in _curves(result, compare):
        x, y = _in_units_of(result, source, variable).values.T[:2]
        (line,) = axes.plot(x, y, style, label=f"{variable.name}{label}")
        axes.plot(x[:1], y[:1], "o", color=line.get_color())
    if compare:
        axes.legend(fontsize="small", frameon=False)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{variable.name}.{variable.components[0]} [{variable.unit}]")
    axes.set_ylabel(f"{variable.name}.{variable.components[1]} [{variable.unit}]")
    axes.grid(alpha=0.3)
    return _titled(figure, result, file)


def save(figure: Any, file: str | os.PathLike[str], **options: Any) -> None:
    """Save a figure with options of Matplotlib; raise ResultError where it cannot be."""
    from symgen.atomic import replacing, writable

    path = writable(file, DRAWN_AS, "plot")
    try:
        with replacing(path, "plot") as temporary:
            figure.savefig(temporary, **{"dpi": 150, **options})
    except ValueError as error:
        raise ResultError(f"cannot write the plot to {path}: {error}") from None


def _shown(result: Result, name: str) -> Variable:
    """Return an output in the unit of plots; raise ResultError if it was not recorded."""
    return converted([result.variable(name)], result.units)[0]


def _selected(result: Result, names: Sequence[str]) -> dict[str, list[Variable]]:
    """Return the named outputs of each panel by its label."""
    chosen: dict[str, Variable] = {}
    for name in names:
        of_owner = [v for v in result.shown if v.name.partition(".")[0] == name and "." in v.name]
        chosen.update((v.name, v) for v in of_owner or [_shown(result, name)])
    return _panels(result, chosen.values())


def _panels(result: Result, variables: Iterable[Variable]) -> dict[str, list[Variable]]:
    panels: dict[str, list[Variable]] = {}
    for variable in variables:
        panels.setdefault(result.panel(variable), []).append(variable)
    return panels


def _by_default(result: Result) -> dict[str, list[Variable]]:
    """Return the panels of a figure without selected outputs: few curves, none of them constant."""
    by_quantity, sizes = {}, dict[str, float]()
    for v in result.shown:
        sizes[v.unit] = max(sizes.get(v.unit, 0.0), _size(v))
    for label, variables in _panels(result, result.shown).items():
        size = sizes[variables[0].unit]
        varying = [v for v in columns(variables) if _range(v) > _VARIES * size]
        if len(varying) > _CURVES:
            varying = _largest(variables, size)
        if varying:
            by_quantity[label] = varying
    if result.KIND in ("forces", "loop"):
        units = {label: result.variable(of[0].name.strip("|")).unit for label, of in by_quantity.items()}
        by_quantity = dict(
            sorted(by_quantity.items(), key=lambda pair: (*_EFFORTS, units[pair[0]]).index(units[pair[0]]))
        )
    return by_quantity or _panels(result, result.shown)


def _largest(variables: list[Variable], size: float) -> list[Variable]:
    """Return the largest outputs of a panel, vectors by their magnitude, without equal ones."""
    distinct: list[Variable] = []
    for variable in map(_magnitude, variables):
        equal = (np.allclose(variable.values, v.values, 0.0, _VARIES * size, True) for v in distinct)
        if _range(variable) > _VARIES * size and not any(equal):
            distinct.append(variable)
    largest = sorted(distinct, key=_size, reverse=True)[:_CURVES]
    return [v for v in distinct if any(v is k for k in largest)]


def _magnitude(variable: Variable) -> Variable:
    """Return the magnitude of a vector, ``|NAME|``; of another output itself."""
    if not variable.components:
        return variable
    size = np.linalg.norm(variable.values, axis=-1)
    return Variable(f"|{variable.name}|", variable.unit, variable.about, (), size)


def _size(variable: Variable) -> float:
    return float(np.max(np.abs(variable.values), initial=0.0, where=np.isfinite(variable.values)))


def _range(variable: Variable) -> float:
    values = variable.values[np.isfinite(variable.values)]
    return float(np.ptp(values)) if values.size else 0.0


def draw_errors(
    axes: Axes, curves: Iterable[tuple[str, Iterable[tuple[float, float]]]], measured: str
) -> None:
    """Plot wall time over error, one curve of (error, time [s]) per program; errors decrease to the right."""
    for marker, (name, points) in zip(cycle("osD^vP*Xd<>p"), curves, strict=False):
        shown = sorted((error, 1e3 * time) for error, time in points if 0.0 < error < _LARGEST)
        if shown:
            axes.loglog(*zip(*shown, strict=True), marker=marker, markersize=3.5, label=name)
    axes.set(xlabel=measured, ylabel="time of the whole call [ms]")
    axes.invert_xaxis()
    axes.grid(alpha=0.3, which="both")
