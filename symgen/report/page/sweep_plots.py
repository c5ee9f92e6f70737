"""Plots of sweeps and Pareto fronts: curves, maps, atlases of paths."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ResultError, nearest
from symgen.report.page.plots import PANELS, also_recorded, save, set_title
from symgen.report.page.plots import WIDTH as _WIDTH
from symgen.runtime.many.dataset import EARLY, RECORDED
from symgen.runtime.many.poses import FLOQUET
from symgen.runtime.result.records import WRITTEN_UNIT, display_units, key_of, shown_in

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

#: Most different values of a parameter for which a map is drawn cell by cell.
_CELLS = 512
#: Most cells or points of a map that are shapes in vector formats; more are a picture.
_SHAPES = 10_000
#: Most runs whose histories are drawn.
DRAWN = 60
#: Most paths side by side.
_ACROSS = 5
#: Part of the colours of curves that is readable on white and on black.
_READABLE = (0.3, 0.85)
#: Most curves with a legend.
_LEGEND = 10
#: Quantiles to whose range panels over an input are scaled.
_QUANTILES = (0.06, 0.94)
#: Range of all values, over that of the quantiles, from which they are.
_POLES = 25.0
#: Least range of the colours of Floquet multipliers about one, as a logarithm.
_NEAR_ONE = 0.01


def parameters_of(runs: xarray.Dataset) -> list[str]:
    """Return the names of the varied parameters."""
    return [str(name) for name, values in runs.coords.items() if values.dims == ("run",) and name != "run"]


def outputs_of(runs: xarray.Dataset) -> list[str]:
    """Return the names of all values that runs have one of, or one for each axis; drifts are last."""
    inner = {name: set(v.dims) - {"run", "axis"} for name, v in runs.data_vars.items() if v.dtype.kind == "f"}
    names = [str(name) for name, dims in inner.items() if not dims and name not in ("done", RECORDED)]
    return sorted(names, key=lambda name: (name.endswith("_drift"), name))


def histories_of(runs: xarray.Dataset) -> list[str]:
    """Return the names of outputs of which all samples are kept."""
    inner = {str(n): [d for d in v.dims if d not in ("run", "axis")] for n, v in runs.data_vars.items()}
    return [name for name, dims in inner.items() if dims]


def plot(runs: xarray.Dataset, *names: str, file: str | os.PathLike[str] | None = None) -> Figure:
    """Plot outputs of a sweep over its first parameter, or as maps over its first two; histories as curves.

    A grid of two parameters is drawn cell by cell, samples of distributions as points. Curves of all runs are
    overlaid; paths of points in the plane, such as coupler curves, are drawn as an atlas.

    Parameters
    ----------
    runs
        The result of :meth:`symgen.Model.sweep`.
    names
        Outputs, such as ``theta1.drive.peak``; the first six, drifts excepted, when absent.
    file
        Output file; its extension selects the format.

    Raises
    ------
    ResultError
        If there is no such output, or the file cannot be written.
    """
    from matplotlib import rcParams

    from symgen.report.picture import Picture

    known = outputs_of(runs)
    histories = [name for name in histories_of(runs) if name in names or not names]
    if histories and not [name for name in names if name not in histories]:
        return _curves(runs, histories, file)
    for name in names:
        if name not in (*known, *histories):
            raise ResultError(
                f"the sweep has no output {name!r}. {nearest(name, [*known, *histories_of(runs)])}"
            )
    if names and histories:
        raise ResultError(f"histories are plotted alone: omit {' and '.join(histories)}, or the others")
    chosen, omitted = list(names), list[str]()
    if not names:
        chosen, omitted = by_default(runs)
    varied = [p for p in parameters_of(runs) if len(np.unique(runs[p].values)) > 1] or parameters_of(runs)
    x = varied[0]
    figure = Picture(figsize=(_WIDTH, 1.0 + 2.6 * len(chosen)), layout="constrained")
    for panel, name in zip(figure.subplots(len(chosen), 1, squeeze=False)[:, 0], chosen, strict=True):
        values = values_of(runs, name)
        label = label_of(runs, name)
        panel.set_xlabel(label_of(runs, x))
        if len(varied) == 1:
            order = np.argsort(runs[x].values, kind="stable")
            panel.plot(values_of(runs, x)[order], values[order], marker=".")
            early = order[_ended_early(runs)[order]]
            if len(early):
                rings = panel.plot(
                    values_of(runs, x)[early], values[early], "o", mfc="none", c=rcParams["text.color"]
                )
                panel.legend(rings[:1], ["ended early"])
            panel.set_ylabel(label)
            panel.grid(alpha=0.3)
            continue
        size = values if values.ndim == 1 else np.sqrt(np.sum(values**2, axis=1))
        stability = _around_one(size) if name == FLOQUET else {}
        panel.grid(visible=False)
        drawn = _map(panel, values_of(runs, x), values_of(runs, varied[1]), size, len(varied) == 2, stability)
        if stability:
            label = "largest Floquet multiplier"
        panel.set_ylabel(label_of(runs, varied[1]))
        figure.colorbar(drawn, ax=panel, label=label)
    set_title(figure, str(runs.attrs["title"]), also_recorded(omitted))
    if file is not None:
        save(figure, file)
    return figure


def by_default(runs: xarray.Dataset) -> tuple[list[str], list[str]]:
    """Return the outputs that a plot of a sweep draws without selection, and those that it omits."""
    names = [name for name in outputs_of(runs) if not name.endswith("_drift")]
    return names[:PANELS], names[PANELS:]


def _ended_early(runs: xarray.Dataset) -> NDArray[np.bool_]:
    """Return which runs ended before their range; their reductions are of the part before."""
    reasons = runs[EARLY].values if EARLY in runs else np.full(runs.sizes["run"], "")
    return np.array([bool(reason) for reason in reasons])


def plot_front(front: xarray.Dataset) -> Figure:
    """Plot the second objective over the first."""
    from symgen.report.picture import Picture

    first, second = (str(name) for name in [*front.data_vars][:2])
    figure = Picture(figsize=(_WIDTH, 3.2), layout="constrained")
    panel: Any = figure.subplots()
    panel.plot(values_of(front, first), values_of(front, second), marker="o")
    panel.set(xlabel=label_of(front, first), ylabel=label_of(front, second))
    panel.grid(alpha=0.3)
    return figure


def plot_course(history: Sequence[float], name: str, shown: tuple[str, float]) -> Figure:
    """Plot an objective over the iterations, in a unit given by name and size in SI."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3), layout="constrained")
    panel: Any = figure.subplots()
    panel.xaxis.get_major_locator().set_params(integer=True)
    panel.plot(range(1, len(history) + 1), np.array(history) / shown[1], marker=".")
    panel.set(xlabel="iteration", ylabel=f"{name} [{shown[0]}]" if shown[0] not in ("", "1") else name)
    panel.grid(alpha=0.3)
    return figure


def _curves(runs: xarray.Dataset, names: Sequence[str], file: str | os.PathLike[str] | None) -> Figure:
    """Draw histories: over their coordinate, or of points in the plane as an atlas of their paths."""
    from matplotlib import colormaps

    from symgen.report.picture import Picture

    count = min(runs.sizes["run"], DRAWN)
    colours = colormaps["viridis"](np.linspace(*_READABLE, count))
    paths = [
        name
        for name in names
        if "axis" in runs[name].dims and runs.sizes["axis"] == 2 and runs[name].attrs.get("units") == "m"
    ]
    titles = _titles(runs)
    panels = len(names) - len(paths)
    across = min(_ACROSS, count)
    figure = Picture(
        figsize=(_WIDTH, 0.6 + 2.6 * panels + 1.4 * len(paths) * -(-count // across)), layout="constrained"
    )
    heights = [1.4 * -(-count // across) if name in paths else 2.6 for name in names]
    parts: Any = figure.subfigures(len(names), 1, squeeze=False, height_ratios=heights)
    for part, name in zip(parts[:, 0], names, strict=True):
        values = values_of(runs, name)[:count]
        of_paths = f" by {', '.join(parameters_of(runs))}" if name in paths else ""
        part.suptitle(label_of(runs, name) + of_paths, fontsize="medium")
        if name in paths:
            panes = part.subplots(
                -(-count // across), across, squeeze=False, sharex=True, sharey=True
            ).ravel()
            for pane, path, title in zip(panes, values, titles, strict=False):
                pane.plot(*path.T, color="#1f5c99")
                pane.set_aspect("equal", adjustable="box")
                pane.set_title(title, fontsize="x-small")
            for pane in panes[count:]:
                pane.set_axis_off()
            continue
        size = values if values.ndim == 2 else np.sqrt(np.sum(values**2, axis=2))
        over = _coordinate(runs, name)
        along = values_of(runs, over)
        panel = part.subplots()
        for i, row in enumerate(size):
            panel.plot(along[i] if along.ndim == 2 else along, row, color=colours[i], label=titles[i])
        panel.grid(alpha=0.3)
        panel.set_xlabel(label_of(runs, over))
        if over != "time":
            _scale(panel, size[np.isfinite(size)])
        if count <= _LEGEND:
            parameters = ", ".join(label_of(runs, p) for p in parameters_of(runs))
            panel.legend(title=parameters, fontsize="x-small", title_fontsize="x-small")
    set_title(figure, str(runs.attrs["title"]))
    if file is not None:
        save(figure, file)
    return figure


def _titles(runs: xarray.Dataset) -> list[str]:
    """Return the values of the parameters of the drawn runs."""
    part = runs.isel(run=slice(0, DRAWN))
    columns = [[f"{x:.4g}" for x in values_of(part, p)] for p in parameters_of(part)]
    return [", ".join(row) for row in zip(*columns, strict=True)]


def _coordinate(runs: xarray.Dataset, name: str) -> str:
    """Return the name of the coordinate of a history, whose values are (samples,) or (runs, samples)."""
    inner = next(d for d in runs[name].dims if d not in ("run", "axis"))
    return str(min((c for c in runs.coords if inner in runs[c].dims), key=lambda c: c == "time"))


def _scale(panel: Any, values: NDArray[np.float64]) -> None:
    """Scale a panel to most values if few are far larger, such as efforts near a dead centre."""
    if not values.size:
        return
    low, high = np.quantile(values, _QUANTILES)
    if np.ptp(values) > _POLES * (high - low) > 0.0:
        margin = (high - low) / 5
        panel.set_ylim(low - margin, high + margin)


def unit_of(runs: xarray.Dataset, name: str) -> tuple[str, float]:
    """Return name and size in SI of the unit in which a variable is shown."""
    attributes = runs[name].attrs
    if WRITTEN_UNIT in attributes:
        return tuple(attributes[WRITTEN_UNIT])
    return shown_in(name, attributes.get("units", ""), display_units(runs.attrs))


def values_of(runs: xarray.Dataset, name: str) -> Any:
    """Return the values of a variable in the unit in which it is shown."""
    return np.asarray(runs[name].values, dtype=float) / unit_of(runs, name)[1]


def label_of(runs: xarray.Dataset, name: str) -> str:
    """Return the name of a variable, or the key of a parameter, with the unit in which it is shown."""
    unit, _ = unit_of(runs, name)
    name = written(runs, name)
    return f"{name} [{unit}]" if unit not in ("", "1") else name


def written(runs: xarray.Dataset, name: str) -> str:
    """Return the name of a variable, or the key of the scene that a parameter stands for."""
    return key_of(name, str(runs[name].attrs.get("long_name", "")))


def _around_one(values: Any) -> dict[str, Any]:
    """Return colours of Floquet multipliers: logarithmic and diverging, blue below one, red above it."""
    from matplotlib.colors import LogNorm

    positive = values[np.isfinite(values) & (values > 0.0)]
    far = max(float(np.max(np.abs(np.log(positive)), initial=0.0)), _NEAR_ONE)
    return {"cmap": "RdBu_r", "norm": LogNorm(np.exp(-far), np.exp(far))}


def _edges(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of cells around increasing places, midway; the outer ones do not cross zero."""
    between = (places[1:] + places[:-1]) / 2
    first, last = 2 * places[0] - between[0], 2 * places[-1] - between[-1]
    first = max(first, 0.0) if places[0] >= 0.0 else first
    last = min(last, 0.0) if places[-1] <= 0.0 else last
    return np.array([first, *between, last])


def _map(panel: Any, x: Any, y: Any, values: Any, alone: bool, colours: Mapping[str, Any]) -> Any:
    """Draw values over two parameters: cells of a grid, else points; with colours around one, its contour."""
    (columns, i), (rows, k) = (np.unique(along, return_inverse=True) for along in (x, y))
    whole = alone and columns.size * rows.size == values.size and max(columns.size, rows.size) <= _CELLS
    if not whole or min(columns.size, rows.size) < 2:
        return panel.scatter(x, y, c=values, s=12, rasterized=values.size > _SHAPES, **colours)
    cells = np.full((rows.size, columns.size), np.nan)
    cells[k, i] = values
    drawn = panel.pcolormesh(_edges(columns), _edges(rows), cells, rasterized=cells.size > _SHAPES, **colours)
    if colours and np.any(cells < 1.0) and np.any(cells > 1.0):
        panel.contour(columns, rows, cells, levels=[1.0], colors="black")
    return drawn
