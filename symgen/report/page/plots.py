"""Plots of results."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.errors import ResultError
from symgen.runtime.result.records import Variable, columns, converted
from symgen.runtime.result.result import Result

#: Supported file name extensions of plots.
DRAWN_AS = (".png", ".svg", ".pdf")
#: Most curves of a panel, without selected outputs.
_CURVES = 8
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
        outputs. If none is given, all that vary, efforts first; a panel of many curves shows magnitudes of
        vectors, and the largest of these, without equal ones.
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
    from matplotlib.figure import Figure

    if xy:
        return _path(result, xy, file, compare or {})
    chosen = _chosen(result, names)
    labels = list(chosen)
    figure = Figure(figsize=(9, 1.2 + 2.4 * len(labels)), layout="constrained")
    panels = dict(zip(labels, figure.subplots(len(labels), 1, sharex=True, squeeze=False)[:, 0], strict=True))
    colours: dict[str, Any] = {}
    for label, source, style in _curves(result, compare or {}):
        along, words = _along(source, over)
        for panel, variables in chosen.items():
            for part in columns([_in_units_of(result, source, v) for v in variables]):
                (line,) = panels[panel].plot(
                    along, part.values, style, label=part.name + label, color=colours.get(part.name)
                )
                colours.setdefault(part.name, line.get_color())
        panels[labels[-1]].set_xlabel(words)
    for panel_label, panel in panels.items():
        panel.set_ylabel(panel_label)
        panel.grid(alpha=0.3)
        _flatten(panel, min(result.drift.scale(v.unit, _range(v)) for v in chosen[panel_label]))
        if len(panel.lines) > 1:
            panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small", frameon=False)
        else:
            panel.set_title(panel.lines[0].get_label(), loc="left", fontsize="small")
    return _titled(figure, result, file)


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


def _titled(figure: Figure, result: Result, file: str | os.PathLike[str] | None) -> Figure:
    figure.suptitle(f"{result.title}\n{result.headline}", fontsize="medium")
    if file is not None:
        save(figure, file)
    return figure


def _path(
    result: Result, name: str, file: str | os.PathLike[str] | None, compare: Mapping[str, Result]
) -> Figure:
    """Plot the y of an output over its x, such as the path of a point; a dot marks the start."""
    from matplotlib.figure import Figure

    known = [v.name for v in result.variables]
    variable = _shown(result, f"{name}.position" if f"{name}.position" in known else name)
    if len(variable.components) < 2:
        raise ResultError(f"expected a point or an output with components x and y for xy, got {name!r}")
    figure = Figure(figsize=(7, 7), layout="constrained")
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


def _chosen(result: Result, names: tuple[str, ...]) -> dict[str, list[Variable]]:
    """Return the outputs of each panel by its label."""
    if not names:
        return _by_default(result)
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
    by_quantity = {}
    for label, variables in _panels(result, result.shown).items():
        size = max(map(_size, variables))
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
