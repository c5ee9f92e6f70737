"""Sweeps, optimisations and Pareto fronts as studies for readers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.report.page.page import Fact, TableView
from symgen.report.page.plots import also_recorded
from symgen.report.page.study import Study
from symgen.report.page.sweep_plots import (
    DRAWN,
    by_default,
    histories_of,
    label_of,
    outputs_of,
    parameters_of,
    plot,
    plot_course,
    plot_front,
    unit_of,
    values_of,
    written,
)
from symgen.runtime.many.dataset import EARLY, PARAMETER, RECORDED
from symgen.runtime.many.poses import NOTES
from symgen.runtime.many.reductions import REDUCTIONS
from symgen.runtime.result.elastic import beyond_linear_theory
from symgen.runtime.result.records import WRITTEN_UNIT, converters, display_units, key_of, with_unit
from symgen.runtime.sweeps.problem import ReducedOutput
from symgen.runtime.sweeps.stores import DONE

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from symgen.runtime.sweeps.optimisation import Optimum

#: Runs that are read at a time.
_READ = 2**20


def show_in(runs: xarray.Dataset, units: Mapping[str, tuple[str, float]]) -> None:
    """Show parameters in the units in which they are written: name and size in SI, by parameter."""
    for name in parameters_of(runs):
        unit = units.get(name.removesuffix(PARAMETER))
        if unit:
            runs[name].attrs[WRITTEN_UNIT] = unit


def summary(runs: xarray.Dataset) -> dict[str, Any]:
    """Return numbers of runs, failures and early ends; of outputs the extremes and runs without a value."""
    count, failed, first, beyond, missing = runs.sizes["run"], 0, "", 0, 0
    samples, early, first_early = 0.0, 0, ""
    for part in _parts(runs):
        if RECORDED in runs:
            samples = float(np.nanmax(part[RECORDED].values, initial=samples))
        places: Any = np.flatnonzero(part[EARLY].values) if EARLY in runs else []
        early += len(places)
        if len(places) and not first_early:
            place = in_units(runs, {p: float(part[p].values[places[0]]) for p in parameters_of(runs)})
            first_early = f"{place}: {part[EARLY].values[places[0]]}"
        missing += int(np.sum(part[DONE].values == 0)) if DONE in runs else 0
        errors = [e for e in part["error"].values if e]
        failed += len(errors)
        first = first or (str(errors[0]) if errors else "")
        if NOTES in runs:
            beyond += sum(beyond_linear_theory(str(text).splitlines()) for text in part[NOTES].values)
    content: dict[str, Any] = {"runs": count, "failed": failed, "first_error": first, "outputs": {}}
    content["samples"], content["ended_early"], content["first_early"] = int(samples), early, first_early
    content["beyond_linear_theory"], content["missing"] = beyond, missing
    content["starts"] = runs.attrs.get("notes", "")
    for name in outputs_of(runs):
        variable = runs[name]
        labels = [str(a) for a in runs["axis"].values] if "axis" in variable.dims else [""]
        for i, label in enumerate(labels):
            content["outputs"][f"{name}.{label}" if label else name] = {
                "unit": variable.attrs.get("units", ""),
                **_extremes(runs, name, i if label else None),
            }
    return content


def _parts(runs: xarray.Dataset) -> Iterator[xarray.Dataset]:
    for first in range(0, runs.sizes["run"], _READ):
        yield runs.isel(run=slice(first, first + _READ))


def _extremes(runs: xarray.Dataset, name: str, component: int | None) -> dict[str, Any]:
    """Return the least and greatest value of an output with their parameters, None where no run has one.

    ``without`` is the number of runs that succeed and have no value, such as no natural frequency.
    """
    extremes: dict[str, Any] = {"least": None, "greatest": None, "without": 0}
    for part in _parts(runs):
        values = np.asarray(part[name].values, dtype=float)
        values = values if component is None else values[:, component]
        succeeded = (part["error"].values == "") & (part[DONE].values != 0 if DONE in runs else True)
        extremes["without"] += int(np.sum(np.isnan(values) & succeeded))
        if np.all(np.isnan(values)):
            continue
        for key, sign, at in (("least", 1.0, np.nanargmin(values)), ("greatest", -1.0, np.nanargmax(values))):
            if extremes[key] is None or sign * values[at] < sign * extremes[key]["value"]:
                place = {p: float(part[p].values[at]) for p in parameters_of(runs)}
                extremes[key] = {"value": float(values[at]), "parameters": place}
    return extremes


def _rows(runs: xarray.Dataset, about: dict[str, Any]) -> Iterator[tuple[Any, ...]]:
    """Yield the extremes of all outputs and where they occur, of a :func:`summary`, in the scene's units."""
    shown = display_units(runs.attrs)
    for name, extremes in about["outputs"].items():
        for key in ("least", "greatest"):
            if extremes[key]:
                place = in_units(runs, extremes[key]["parameters"])
                unit, size = shown.get(extremes["unit"], (extremes["unit"], 1.0))
                yield name if key == "least" else "", key, extremes[key]["value"] / size, unit, place


def in_units(runs: xarray.Dataset, at: Mapping[str, float]) -> str:
    """Return parameters of a run by the scene's keys and in its units."""
    places = ((p, *unit_of(runs, p)) for p in parameters_of(runs))
    return ", ".join(f"{written(runs, p)} = {with_unit(at[p] / size, unit)}" for p, unit, size in places)


def _notes(about: dict[str, Any]) -> Iterator[str]:
    """Yield notes on samples, and on runs that are missing, failed, ended early or beyond linear theory."""
    reduced = any(not {*name.split(".")[-2:]}.isdisjoint(REDUCTIONS) for name in about["outputs"])
    if about["samples"] > 1 and reduced:
        yield f"reductions of {about['samples']} samples per run: extremes between samples may be larger"
    if about["missing"]:
        yield f"{about['missing']} of {about['runs']} runs are missing: they belong to other parts"
    names: dict[int, list[str]] = {}
    for name, extremes in about["outputs"].items():
        names.setdefault(extremes["without"], []).append(name)
    for count, without in names.items():
        if count:
            yield f"{count} of {about['runs']} runs have no {', '.join(without)}: nan in the results"
    if about["failed"]:
        yield f"{about['failed']} of {about['runs']} runs failed, the first: {about['first_error']}"
    if about["ended_early"]:
        yield (
            f"{about['ended_early']} of {about['runs']} runs ended early, and their values are of the part "
            f"before; the first, {about['first_early']}"
        )
    yield from about["starts"].splitlines()
    beyond = about["beyond_linear_theory"]
    if beyond:
        yield f"linear theory does not hold in {beyond} of {about['runs']} runs: reasons in {NOTES}"


def sweep_study(runs: xarray.Dataset, about: dict[str, Any]) -> Study:
    """Return a sweep with its :func:`summary`: plots, extremes and where they occur, failures."""
    varied = parameters_of(runs)
    ranges = [
        f"{values_of(runs, p).min():.6g} to {with_unit(values_of(runs, p).max(), unit_of(runs, p)[0])}"
        for p in varied
    ]
    rows = [(n, key, f"{x + 0.0:.6g}", unit, place) for n, key, x, unit, place in _rows(runs, about)]
    return Study(
        title=str(runs.attrs["title"]),
        table=TableView(("output", "", "value", "unit", "at"), tuple(rows)),
        notes=tuple(_notes(about)),
        facts=(
            Fact("runs", str(about["runs"])),
            Fact("failed", str(about["failed"])),
            *(Fact(written(runs, p), r) for p, r in zip(varied, ranges, strict=True)),
        ),
        texts=(0, 1, 3, 4),
        figures=tuple(_figures(runs, varied)),
    )


def _figures(runs: xarray.Dataset, varied: Sequence[str]) -> Iterator[tuple[Callable[[], Figure], str, str]]:
    """Yield functions that draw the figures of a page, with alternative text and caption."""
    reduced, omitted = by_default(runs)
    if reduced:
        yield lambda: plot(runs, *reduced), f"Outputs over {' and '.join(varied)}", also_recorded(omitted)
    if histories_of(runs):
        few = f"Curves are those of the first {DRAWN} runs." if runs.sizes["run"] > DRAWN else ""
        yield lambda: plot(runs, *histories_of(runs)), "Curves of the runs", few


def optimum_study(
    optimum: Optimum, objective: str, written_units: Mapping[str, tuple[str, float]] | None = None
) -> Study:
    """Return an optimisation: variables, objective and constrained quantities, also at its start.

    ``written_units`` are name and size in SI of the units in which variables are written, by variable.
    """
    tunable = optimum.model.description.tunable
    units = {p.name: p.unit for p in tunable} | optimum.units
    quantities = {**optimum.parameters, objective: optimum.objective, **optimum.constraints}
    shown = converters(optimum.model.description.units)
    keys = {p.name: key_of(p.name, p.about) for p in tunable}
    rows = []
    for name, value in quantities.items():
        unit, size = (written_units or {}).get(name) or shown.get(units[name], (units[name], 1.0))
        both = [optimum.start[name], value] if optimum.start else [value]
        rows.append((keys.get(name, name), *(f"{x / size + 0.0:.6g}" for x in both), unit))
    unmet = () if optimum.converged else ("The method did not meet its tolerance",)
    heads = ("start", "optimum") if optimum.start else ("optimum",)
    return Study(
        title=f"{optimum.model.description.title}: least {objective}",
        table=TableView(("", *heads, "unit"), tuple(rows)),
        notes=(optimum.message.rstrip("."), *unmet),
        facts=(Fact("runs", str(optimum.runs)), Fact("gradients", optimum.gradients)),
        texts=(0, len(heads) + 1),
    )


def optimum_figures(
    model: Any, optimum: Optimum, search: Mapping[str, Any], units: Mapping[str, tuple[str, float]]
) -> tuple[tuple[Callable[[], Figure], str, str], ...]:
    """Return what draws the course of an optimisation, and the outputs of its start and its optimum.

    ``search`` are the arguments of the optimisation. Outputs of a pose, which have no samples, are not drawn.
    """
    names = [search["objective"], *search["constraints"]]
    quantities = [ReducedOutput.named(name, optimum.parameters) for name in names]
    outputs = list(dict.fromkeys(q.output for q in quantities if q.reduction))
    options = {key: search[key] for key in ("analysis", "samples", "t_end") if key in search}
    values = {
        name: [optimum.start.get(name, model.parameters[name]), value]
        for name, value in optimum.parameters.items()
    }
    runs = model.sweep(values, sampling="list", outputs=outputs, reduce="history", **options)
    runs.attrs["title"] = f"{model.description.title}: start and optimum"
    show_in(runs, units)
    unit = optimum.units[names[0]]
    shown = converters(model.description.units).get(unit, (unit, 1.0))
    course = (lambda: plot_course(optimum.history, names[0], shown)), "The objective after each iteration", ""
    if not histories_of(runs):
        return (course,)
    return course, ((lambda: plot(runs, *histories_of(runs))), "Outputs of the start and of the optimum", "")


def front_study(front: xarray.Dataset) -> Study:
    """Return a Pareto front: objectives and variables of all points."""
    names = [str(name) for name in (*front.data_vars, *front.coords) if name != "converged"]
    rows = zip(*(values_of(front, name).tolist() for name in names), strict=True)
    missed = int((~front["converged"]).sum())
    unmet = f"{missed} of {front.sizes['point']} points did not meet the tolerance"
    return Study(
        title=str(front.attrs["title"]),
        table=TableView(
            tuple(label_of(front, name) for name in names),
            tuple(tuple(f"{x + 0.0:.6g}" for x in row) for row in rows),
        ),
        notes=(unmet,) if missed else (),
        facts=(Fact("runs", str(front.attrs["runs"])), Fact("gradients", str(front.attrs["gradients"]))),
        figures=((lambda: plot_front(front), "Pareto front", ""),),
    )
