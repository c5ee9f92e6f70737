"""Plots of results."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from symgen.errors import ResultError
from symgen.runtime.result.records import Variable, columns
from symgen.runtime.result.result import Result

#: Supported file name extensions of plots.
DRAWN_AS = (".png", ".svg", ".pdf")

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot(result: Result, *names: str, file: str | os.PathLike[str] | None = None, xy: str = "") -> Figure:
    """Plot outputs over time or input, in the panels of the result; save the figure if ``file`` is given.

    Parameters
    ----------
    result
        The result.
    names
        Outputs, such as ``C.position`` or ``C.position.x``, or points or links for all their recorded
        outputs. All outputs if none is given.
    file
        Output file; its extension selects the format.
    xy
        A point, or an output with components: its path, y over x with equal axes, is drawn instead.

    Raises
    ------
    ResultError
        If no output of a name was recorded, or the file cannot be written.
    """
    from matplotlib.figure import Figure

    if xy:
        return _path(result, xy, file)
    chosen = _chosen(result, names)
    along, label = result.over
    labels = list(dict.fromkeys(result.panel(v) for v in chosen))
    figure = Figure(figsize=(9, 1.2 + 2.4 * len(labels)), layout="constrained")
    panels = figure.subplots(len(labels), 1, sharex=True, squeeze=False)[:, 0]
    for panel, panel_label in zip(panels, labels, strict=True):
        for variable in (v for v in chosen if result.panel(v) == panel_label):
            for part in columns([variable]):
                panel.plot(along, part.values, label=part.name)
        panel.set_ylabel(panel_label)
        panel.grid(alpha=0.3)
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small", frameon=False)
    panels[-1].set_xlabel(label)
    figure.suptitle(f"{result.title}\n{result.headline}", fontsize="medium")
    if file is not None:
        save(figure, file)
    return figure


def _path(result: Result, name: str, file: str | os.PathLike[str] | None) -> Figure:
    """Plot the y of an output over its x, such as the path of a point; a dot marks the start."""
    from matplotlib.figure import Figure

    known = [v.name for v in result.variables]
    variable = _shown(result, f"{name}.position" if f"{name}.position" in known else name)
    if len(variable.components) < 2:
        raise ResultError(f"expected a point or an output with components x and y for xy, got {name!r}")
    figure = Figure(figsize=(7, 7), layout="constrained")
    axes = figure.subplots()
    x, y = variable.values[:, 0], variable.values[:, 1]
    (line,) = axes.plot(x, y)
    axes.plot(x[:1], y[:1], "o", color=line.get_color())
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{variable.name}.{variable.components[0]} [{variable.unit}]")
    axes.set_ylabel(f"{variable.name}.{variable.components[1]} [{variable.unit}]")
    axes.grid(alpha=0.3)
    figure.suptitle(f"{result.title}\n{result.headline}", fontsize="medium")
    if file is not None:
        save(figure, file)
    return figure


def save(figure: Any, file: str | os.PathLike[str]) -> None:
    """Save a figure; raise ResultError where it cannot be."""
    from symgen.atomic import replacing, writable

    path = writable(file, DRAWN_AS, "plot")
    try:
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=150)
    except (OSError, ValueError) as error:
        raise ResultError(f"cannot write the plot to {path}: {error}") from None


def _shown(result: Result, name: str) -> Variable:
    """Return an output in the unit of plots; raise ResultError if it was not recorded."""
    result.variable(name)
    return next(v for v in (*result.shown, *columns(result.shown)) if v.name == name)


def _chosen(result: Result, names: tuple[str, ...]) -> list[Variable]:
    if not names:
        return list(result.shown)
    chosen: dict[str, Variable] = {}
    for name in names:
        of_owner = [v for v in result.shown if v.name.partition(".")[0] == name and "." in v.name]
        chosen.update((v.name, v) for v in of_owner or [_shown(result, name)])
    return list(chosen.values())
