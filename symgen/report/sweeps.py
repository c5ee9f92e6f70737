"""Tables, plots and pages of sweeps, optimisations and Pareto fronts."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.errors import ResultError, nearest
from symgen.report.page.figures import plain_figure
from symgen.report.page.page import Fact, TableView
from symgen.report.page.plots import save
from symgen.report.page.study import StudyPage
from symgen.report.tables import table
from symgen.runtime.many.dataset import RECORDED

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure
    from rich.console import Console

    from symgen.runtime.sweeps.optimisation import Optimum

#: Runs that are read at a time.
_READ = 2**20
#: Most different values of a parameter for which a map is drawn cell by cell.
_CELLS = 512


def parameters_of(runs: xarray.Dataset) -> list[str]:
    """Return the names of the varied parameters."""
    return [str(name) for name, values in runs.coords.items() if values.dims == ("run",) and name != "run"]


def outputs_of(runs: xarray.Dataset) -> list[str]:
    """Return the names of all values that runs have one of, or one for each axis."""
    inner = {name: set(v.dims) - {"run", "axis"} for name, v in runs.data_vars.items() if v.dtype.kind == "f"}
    return sorted(str(name) for name, dims in inner.items() if not dims and name not in ("done", RECORDED))


def summary(runs: xarray.Dataset) -> dict[str, Any]:
    """Return the numbers of runs and failures, and the extremes of all outputs with their parameters."""
    count, failed, first = runs.sizes["run"], 0, ""
    recorded: list[Any] = []
    for part in _parts(runs):
        if RECORDED in runs:
            recorded.append(np.unique(part[RECORDED].values, return_counts=True))
        errors = [e for e in part["error"].values if e]
        failed += len(errors)
        first = first or (str(errors[0]) if errors else "")
    found: dict[str, Any] = {"runs": count, "failed": failed, "first_error": first, "outputs": {}}
    longest = max((np.nanmax(sizes) for sizes, _ in recorded if not np.all(np.isnan(sizes))), default=0.0)
    found["ended_early"] = int(sum(np.sum(counts[sizes < longest]) for sizes, counts in recorded))
    for name in outputs_of(runs):
        variable = runs[name]
        labels = [str(a) for a in runs["axis"].values] if "axis" in variable.dims else [""]
        for i, label in enumerate(labels):
            found["outputs"][f"{name}.{label}" if label else name] = {
                "unit": variable.attrs.get("units", ""),
                **_extremes(runs, name, i if label else None),
            }
    return found


def _parts(runs: xarray.Dataset) -> Iterator[xarray.Dataset]:
    for first in range(0, runs.sizes["run"], _READ):
        yield runs.isel(run=slice(first, first + _READ))


def _extremes(runs: xarray.Dataset, name: str, component: int | None) -> dict[str, Any]:
    """Return the least and greatest value of an output, each with its parameters; None where all failed."""
    found: dict[str, Any] = {"least": None, "greatest": None}
    for part in _parts(runs):
        values = np.asarray(part[name].values, dtype=float)
        values = values if component is None else values[:, component]
        if np.all(np.isnan(values)):
            continue
        for key, sign, at in (("least", 1.0, np.nanargmin(values)), ("greatest", -1.0, np.nanargmax(values))):
            if found[key] is None or sign * values[at] < sign * found[key]["value"]:
                place = {p: float(part[p].values[at]) for p in parameters_of(runs)}
                found[key] = {"value": float(values[at]), "parameters": place}
    return found


#: Head of the table of extremes.
_EXTREMES = ("output", "", "value", "unit", "at (SI)")


def _rows(about: dict[str, Any]) -> Iterator[tuple[Any, ...]]:
    """Yield the extremes of all outputs and where they occur, of a :func:`summary`."""
    for name, extremes in about["outputs"].items():
        for key in ("least", "greatest"):
            if extremes[key]:
                place = ", ".join(f"{p} = {v:.6g}" for p, v in extremes[key]["parameters"].items())
                yield name if key == "least" else "", key, extremes[key]["value"], extremes["unit"], place


def _notes(about: dict[str, Any]) -> Iterator[str]:
    """Yield the numbers of runs that failed or ended early."""
    if about["failed"]:
        yield f"{about['failed']} of {about['runs']} runs failed, the first: {about['first_error']}"
    if about["ended_early"]:
        yield (
            f"{about['ended_early']} of {about['runs']} runs ended early, at dead centres or events: their "
            "values are of the part before"
        )


def print_sweep(runs: xarray.Dataset, console: Console) -> None:
    """Print the extremes of all outputs, where they occur, and the number of failed runs."""
    about = summary(runs)
    console.print(table(str(runs.attrs["title"]), _EXTREMES, _rows(about), (0, 1, 3, 4)))
    for note in _notes(about):
        console.print(note)


def sweep_page(runs: xarray.Dataset, name: str) -> StudyPage:
    """Return the page of a sweep of a scene: plots, extremes and where they occur, failures."""
    about = summary(runs)
    varied = parameters_of(runs)
    ranges = [
        f"{float(runs[p].min()):.6g} to {float(runs[p].max()):.6g} {runs[p].attrs.get('units', '')}".strip()
        for p in varied
    ]
    rows = [(n, key, f"{x:.6g}", unit, place) for n, key, x, unit, place in _rows(about)]
    return StudyPage(
        name=name,
        title=str(runs.attrs["title"]),
        facts=(
            Fact("runs", str(about["runs"])),
            Fact("failed", str(about["failed"])),
            *(Fact(p, r) for p, r in zip(varied, ranges, strict=True)),
        ),
        tables=(TableView(_EXTREMES, tuple(rows)),),
        figures=(plain_figure(lambda: plot(runs), f"Outputs over {' and '.join(varied)}"),),
        notes=tuple(_notes(about)),
    )


def print_optimum(found: Optimum, objective: str, console: Console) -> None:
    """Print the variables, the objective and the constrained quantities."""
    title = f"{found.model.description.title}: least {objective}"
    console.print(table(title, ("", "value", "unit"), _quantities(found, objective), (0, 2)))
    console.print(f"{found.message} ({found.runs} runs, gradients: {found.gradients})")
    if not found.converged:
        console.print("The method did not meet its tolerance.")


def _quantities(found: Optimum, objective: str) -> Iterator[tuple[str, float, str]]:
    """Yield name, value and unit of the variables, of the objective and of the constrained quantities."""
    units = {p.name: p.unit for p in found.model.description.tunable} | found.units
    quantities = {**found.parameters, objective: found.objective, **found.constraints}
    return ((name, value, units[name]) for name, value in quantities.items())


def optimum_page(found: Optimum, objective: str, name: str) -> StudyPage:
    """Return the page of an optimisation of a scene."""
    rows = tuple((key, f"{x:.6g}", unit) for key, x, unit in _quantities(found, objective))
    unmet = () if found.converged else ("The method did not meet its tolerance",)
    return StudyPage(
        name=name,
        title=f"{found.model.description.title}: least {objective}",
        facts=(Fact("runs", str(found.runs)), Fact("gradients", found.gradients)),
        tables=(TableView(("", "value", "unit"), rows),),
        notes=(found.message.rstrip("."), *unmet),
    )


def _of_front(front: xarray.Dataset) -> list[str]:
    """Return the names of the objectives and of the variables."""
    return [str(name) for name in (*front.data_vars, *front.coords) if name != "converged"]


def _front_rows(front: xarray.Dataset) -> Iterator[list[float]]:
    return zip(*(front[name].values.tolist() for name in _of_front(front)), strict=True)  # type: ignore[return-value]


def _unmet(front: xarray.Dataset) -> list[str]:
    missed = int((~front["converged"]).sum())
    return [f"{missed} of {front.sizes['point']} points did not meet the tolerance"] if missed else []


def print_front(front: xarray.Dataset, console: Console) -> None:
    """Print objectives and variables of all points."""
    console.print(
        table(str(front.attrs["title"]), [_label(front, n) for n in _of_front(front)], _front_rows(front))
    )
    for note in (f"{front.attrs['runs']} runs, gradients: {front.attrs['gradients']}", *_unmet(front)):
        console.print(note)


def front_page(front: xarray.Dataset, name: str) -> StudyPage:
    """Return the page of a Pareto front."""
    rows = tuple(tuple(f"{x:.6g}" for x in row) for row in _front_rows(front))
    return StudyPage(
        name=name,
        title=str(front.attrs["title"]),
        facts=(Fact("runs", str(front.attrs["runs"])), Fact("gradients", str(front.attrs["gradients"]))),
        tables=(TableView(tuple(_label(front, n) for n in _of_front(front)), rows),),
        figures=(plain_figure(lambda: plot_front(front), "Pareto front"),),
        notes=tuple(_unmet(front)),
    )


def plot_front(front: xarray.Dataset, file: str | os.PathLike[str] | None = None) -> Figure:
    """Plot the second objective over the first; the extension of the file selects the format."""
    from matplotlib.figure import Figure

    first, second = _of_front(front)[:2]
    figure = Figure(figsize=(8, 4), layout="constrained")
    panel: Any = figure.subplots()
    panel.plot(front[first].values, front[second].values, marker="o")
    panel.set(xlabel=_label(front, first), ylabel=_label(front, second))
    panel.grid(alpha=0.3)
    if file is not None:
        save(figure, file)
    return figure


def plot(runs: xarray.Dataset, *names: str, file: str | os.PathLike[str] | None = None) -> Figure:
    """Plot outputs of a sweep over its first parameter, or as maps over its first two.

    A grid of two parameters is drawn cell by cell, samples of distributions as points.

    Parameters
    ----------
    runs
        The result of :meth:`symgen.Model.sweep`.
    names
        Outputs, such as ``theta1.drive.peak``; all but drifts when absent.
    file
        Output file; its extension selects the format.

    Raises
    ------
    ResultError
        If there is no such output, or the file cannot be written.
    """
    from matplotlib.figure import Figure

    known = outputs_of(runs)
    for name in names:
        if name not in known:
            raise ResultError(f"the sweep has no output {name!r}. {nearest(name, known)}")
    chosen = list(names) or [name for name in known if not name.endswith("_drift")]
    varied = [p for p in parameters_of(runs) if len(np.unique(runs[p].values)) > 1] or parameters_of(runs)
    x = varied[0]
    figure = Figure(figsize=(8, 1.0 + 3.0 * len(chosen)), layout="constrained")
    for panel, name in zip(figure.subplots(len(chosen), 1, squeeze=False)[:, 0], chosen, strict=True):
        values = np.asarray(runs[name].values, dtype=float)
        label = _label(runs, name)
        panel.set_xlabel(_label(runs, x))
        if len(varied) == 1:
            order = np.argsort(runs[x].values, kind="stable")
            panel.plot(runs[x].values[order], values[order], marker=".")
            panel.set_ylabel(label)
            panel.grid(alpha=0.3)
            continue
        size = values if values.ndim == 1 else np.sqrt(np.sum(values**2, axis=1))
        drawn = _map(panel, runs[x].values, runs[varied[1]].values, size, len(varied) == 2)
        panel.set_ylabel(_label(runs, varied[1]))
        figure.colorbar(drawn, ax=panel, label=label)
    figure.suptitle(str(runs.attrs["title"]), fontsize="medium")
    if file is not None:
        save(figure, file)
    return figure


def _label(runs: xarray.Dataset, name: str) -> str:
    unit = runs[name].attrs.get("units", "")
    return f"{name} [{unit}]" if unit not in ("", "1") else name


def _map(panel: Any, x: Any, y: Any, values: Any, alone: bool) -> Any:
    """Draw values over two parameters: cells of a grid, else points."""
    (columns, i), (rows, k) = (np.unique(along, return_inverse=True) for along in (x, y))
    whole = alone and columns.size * rows.size == values.size and max(columns.size, rows.size) <= _CELLS
    if not whole or min(columns.size, rows.size) < 2:
        return panel.scatter(x, y, c=values, s=12)
    cells = np.full((rows.size, columns.size), np.nan)
    cells[k, i] = values
    return panel.pcolormesh(columns, rows, cells, shading="nearest")
