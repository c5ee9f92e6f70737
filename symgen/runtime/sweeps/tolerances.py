"""Tolerances: worst case, Monte Carlo statistics and Sobol indices of outputs by their parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError, check_known, shown
from symgen.runtime.many.dataset import EARLY, RECORDED
from symgen.runtime.result.records import in_words
from symgen.runtime.sweeps.designs import Distribution, Grid, Listed, design_of
from symgen.runtime.sweeps.stores import needed
from symgen.runtime.sweeps.sweep import carry_out, sweep_of

if TYPE_CHECKING:
    import xarray

Array = NDArray[Any]
METHODS = ("worst-case", "monte-carlo", "sobol")
#: Most parameters of a worst case: it has a run for every combination of their bounds.
_CORNERS = 16
#: Shares of the quantiles: the median, and that of three standard deviations of a normal distribution.
QUANTILES = (0.00135, 0.5, 0.99865)


def tolerances_of(
    model: Any,
    of: Mapping[str, Any],
    analysis: str | None,
    method: str,
    count: int,
    seed: int,
    outputs: Sequence[str] | None,
    reduce: str | Sequence[str],
    threads: int | None,
    progress: Callable[[float], None] | None,
    arguments: Mapping[str, Any],
) -> xarray.Dataset:
    """Return the effect of tolerances on outputs; see :meth:`symgen.Model.tolerances`."""
    check_known(method, METHODS, "there are no tolerances by")
    wrong = next((name for name, x in of.items() if not isinstance(x, Distribution)), None)
    if wrong is not None or not of:
        text = shown(of[wrong]) if wrong else "no parameter"
        raise ModelError(
            f"expected a distribution of {wrong or 'a parameter'}, such as Uniform(low, high), got {text}"
        )
    if outputs is not None and not outputs:
        raise ModelError("expected an output to measure, got none")
    if "history" in ((reduce,) if isinstance(reduce, str) else reduce):
        raise ModelError("tolerances are of reductions such as 'peak', got 'history'")
    if method == "worst-case":
        if len(of) > _CORNERS:
            raise ModelError(f"expected at most {_CORNERS} parameters of a worst case, got {len(of)}")
        design: Any = Grid(tuple(of), tuple(np.array(d.bounds) for d in of.values()))
    elif method == "monte-carlo":
        design = design_of(of, "random", count, seed)
    else:
        design = _saltelli(of, count, seed)
    sweep = sweep_of(model, analysis, design, outputs, reduce, arguments, threads)
    runs = carry_out(sweep, None, None, (1, 1), progress)
    failed = next((str(error) for error in runs["error"].values if error), "")
    if failed:
        count = sum(map(bool, runs["error"].values))
        raise SimulationError(f"{count} of {design.count} runs failed, the first: {failed}", time=0.0)
    early: Array = np.flatnonzero(runs[EARLY].values) if EARLY in runs else np.zeros(0)
    if sweep.analysis != "simulate" and len(early):
        place = in_words(model.description, {name: float(runs[name].values[early[0]]) for name in of})
        raise SimulationError(
            f"{len(early)} of {design.count} runs ended early, the first at {place}: "
            f"{runs[EARLY].values[early[0]]}\n  Give a shorter range, stop, or narrower tolerances.",
            time=0.0,
        )
    values, units = _columns(runs)
    result = {"worst-case": _worst_case, "monte-carlo": _monte_carlo, "sobol": _sobol}[method](
        design, np.stack([*values.values()], axis=1), of, seed
    )
    return _dataset(
        result,
        [*values],
        units,
        [*of],
        f"{model.description.title}: tolerances by {method}, {design.count} runs",
    )


def _saltelli(of: Mapping[str, Distribution], count: int, seed: int) -> Listed:
    """Return the samples of Saltelli: two matrices, and one for each parameter that mixes them."""
    needed("method='sobol'", "SALib", extra="tolerances")
    from SALib.sample.sobol import sample

    if count < 2 or count & (count - 1):
        raise ModelError(f"expected a power of two as the count of Sobol indices, got {count}")
    shares = sample(_problem(of), count, calc_second_order=False, scramble=True, seed=seed)
    rows = np.stack([d.quantiles(shares[:, i]) for i, d in enumerate(of.values())], axis=1)
    return Listed(tuple(of), rows)


def _problem(of: Mapping[str, Distribution]) -> dict[str, Any]:
    return {"num_vars": len(of), "names": [*of], "bounds": [[0.0, 1.0]] * len(of)}


def _columns(runs: xarray.Dataset) -> tuple[dict[str, Array], list[str]]:
    """Return the values (runs,) of every reduced output by name, components apart, and their units."""
    columns, units = {}, []
    for name, variable in runs.data_vars.items():
        if variable.dtype.kind != "f" or str(name).endswith("_drift") or name == RECORDED:
            continue
        values = variable.values.reshape(runs.sizes["run"], -1)
        labels = [f"{name}.{a}" for a in runs["axis"].values] if "axis" in variable.dims else [str(name)]
        for i, label in enumerate(labels):
            columns[label] = values[:, i]
            units.append(str(variable.attrs.get("units", "")))
    return columns, units


_Columns = dict[str, tuple[tuple[str, ...], Array, str]]


def _worst_case(design: Grid, values: Array, of: Mapping[str, Distribution], _: int) -> _Columns:
    rows = design.values(0, design.count)
    least, greatest = np.argmin(values, axis=0), np.argmax(values, axis=0)
    return {
        "least": (("output",), np.min(values, axis=0), "least value at a corner"),
        "greatest": (("output",), np.max(values, axis=0), "greatest value at a corner"),
        "least_at": (("output", "parameter"), rows[least], "corner of the least value"),
        "greatest_at": (("output", "parameter"), rows[greatest], "corner of the greatest value"),
    }


def _monte_carlo(_: Any, values: Array, of: Mapping[str, Distribution], __: int) -> _Columns:
    deviation = values.std(axis=0, ddof=1) if len(values) > 1 else np.full(values.shape[1], np.nan)
    return {
        "mean": (("output",), values.mean(axis=0), "mean"),
        "deviation": (("output",), deviation, "standard deviation"),
        "error": (("output",), deviation / np.sqrt(len(values)), "standard error of the mean"),
        "least": (("output",), values.min(axis=0), "least value"),
        "greatest": (("output",), values.max(axis=0), "greatest value"),
        "quantile": (("output", "share"), np.quantile(values, QUANTILES, axis=0).T, "quantile"),
    }


def _sobol(_: Any, values: Array, of: Mapping[str, Distribution], seed: int) -> _Columns:
    from SALib.analyze.sobol import analyze

    shape = (values.shape[1], len(of))
    indices = {name: np.full(shape, np.nan) for name in ("S1", "S1_conf", "ST", "ST_conf")}
    for i, column in enumerate(values.T):
        if np.ptp(column) > 1e-12 * np.max(np.abs(column), initial=0.0):  # a constant has no indices
            of_one = analyze(_problem(of), column, calc_second_order=False, seed=seed)
            for name, entries in indices.items():
                entries[i] = of_one[name]
    abouts = {
        "first": ("S1", "first-order Sobol index"),
        "first_error": ("S1_conf", "half of its confidence interval of 95 %"),
        "total": ("ST", "total Sobol index"),
        "total_error": ("ST_conf", "half of its confidence interval of 95 %"),
    }
    return {name: (("output", "parameter"), indices[key], about) for name, (key, about) in abouts.items()}


def _dataset(
    result: _Columns, outputs: list[str], units: list[str], parameters: list[str], title: str
) -> xarray.Dataset:
    import xarray

    data = {name: (dims, values, {"long_name": about}) for name, (dims, values, about) in result.items()}
    coordinates: dict[str, Any] = {"output": outputs, "parameter": parameters, "unit": ("output", units)}
    if any("share" in dims for dims, *_ in result.values()):
        coordinates["share"] = list(QUANTILES)
    return xarray.Dataset(data, coordinates, {"title": title})
