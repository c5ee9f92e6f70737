"""Minimum and maximum of recorded outputs, and where they occur; their means over time, and work."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ResultError
from symgen.runtime.model.averages import Average, averages
from symgen.runtime.result.records import Variable, columns, plain, shown_in
from symgen.runtime.result.result import Result

if TYPE_CHECKING:  # output as JSON does without rich
    from rich.console import Console, Group

Array = NDArray[np.float64]

#: Maximum number of poses of a linkage for which every value is printed; otherwise the extremes.
FEW = 12
#: Steps of a run that is not repeated for means.
_LONG = 4_000
#: Values below this fraction of the largest value of their unit are round-off.
_ROUND_OFF = 1e-12
#: Angles are compared with one radian, even if all angles in a table are small.
_LEAST_SCALE = {"rad": 1.0}


class Components:
    """Outputs by component: name, unit and values over the coordinate, with round-off replaced by 0.

    Parameters
    ----------
    variables
        Outputs; vectors are split into rows ``NAME.x`` and so on.
    count
        Number of values along the coordinate.
    missing
        Text for NaN.
    """

    def __init__(self, variables: Sequence[Variable], count: int, missing: str = "-") -> None:
        self.missing = missing
        parts = columns(variables)
        rows = [(v.name, v.unit, np.asarray(v.values, dtype=float).reshape(count)) for v in parts]
        largest = dict(_LEAST_SCALE)
        for _, unit, values in rows:
            size = np.abs(values[np.isfinite(values)])
            largest[unit] = max(largest.get(unit, 0.0), float(size.max(initial=0.0)))
        self._least = {unit: _ROUND_OFF * size for unit, size in largest.items()}
        self.rows = [
            (name, unit, np.where(np.abs(values) <= self._least[unit], 0.0, values))
            for name, unit, values in rows
        ]

    def text(self, value: float) -> str:
        """Return a number with six significant digits."""
        return self.missing if np.isnan(value) else f"{value + 0.0:.6g}"  # no -0

    def extremes(
        self,
        title: str,
        along: Array,
        unit: str,
        *,
        end: bool = False,
        means: Mapping[str, tuple[float, float]] | None = None,
        exact: Mapping[str, tuple[float, float, float, float]] | None = None,
        mark: Callable[[str, int], str] = lambda name, index: "",
    ) -> Group:
        """Return a table with the minimum and maximum of each component and where they occur.

        Parameters
        ----------
        title
            Title, which names the coordinate.
        along
            Values of the coordinate.
        unit
            Unit of the coordinate.
        end
            Whether to add a column with the last value.
        means
            Mean and root mean square of each component, which become columns.
        exact
            Least and greatest value by component, each with its place, instead of those of samples.
        mark
            Function that returns the suffix of a component's value at an index.
        """
        from symgen.report.tables import table

        head = (
            "output",
            "unit",
            *(["at the end"] if end else []),
            *("least", f"at [{unit}]", "greatest", f"at [{unit}]"),
            *(["mean", "RMS"] if means else []),
        )
        rows = []
        for name, of, values in self.rows:
            if np.all(np.isnan(values)):
                continue
            low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
            small = self._least[of]
            ends = [
                cell
                for k in (low, high)
                for cell in (self.text(values[k]) + mark(name, k), f"{along[k]:.6g}")
            ]
            if exact and name in exact:
                least, at_least, greatest, at_greatest = exact[name]
                pairs = (least, at_least), (greatest, at_greatest)
                ends = [x for y, t in pairs for x in (self.text(0.0 if abs(y) <= small else y), f"{t:.6g}")]
            averaged = [self.text(0.0 if abs(x) <= small else x) for x in means[name]] if means else []
            rows.append((name, of, *([self.text(values[-1])] if end else []), *ends, *averaged))
        return table(title, head, rows, keys=2, apart=2 if means else 0)

    def values(
        self,
        title: str,
        heads: Sequence[str],
        mark: Callable[[str, int], str] = lambda name, index: "",
        first: Sequence[tuple[str, ...]] = (),
    ) -> Group:
        """Return a table with one column per value; ``first`` are rows before the outputs."""
        from symgen.report.tables import table

        rows = [
            (n, u, *(self.text(x) + mark(n, k) for k, x in enumerate(values))) for n, u, values in self.rows
        ]
        return table(title, ("output", "unit", *heads), [*first, *rows], keys=2)


def averages_of(result: Result, *, magnitudes: bool = False) -> dict[str, Average]:
    """Return the averages over time by component, or of the magnitudes of vectors; empty without any."""
    if result.statistics.get("steps", 0) > _LONG:
        return {}
    try:
        return averages(result, magnitudes=magnitudes)
    except ResultError:
        return {}


def means(result: Result, of: Mapping[str, Average]) -> dict[str, tuple[float, float]]:
    """Return mean and root mean square by component, in the units of tables."""
    names = {name: v for v in result.variables for name in (v.name, *v.names)}
    sizes = {name: shown_in(names[name].name, names[name].unit, result.units)[1] for name in of}
    return {
        name: (0.0 if abs(x.mean) <= x.error else x.mean / sizes[name], x.rms / sizes[name])
        for name, x in of.items()
    }


def extremes_of(result: Result, of: Mapping[str, Average]) -> dict[str, tuple[float, float, float, float]]:
    """Return the extremes of a run by component, and their times, in the units of tables.

    Other results have those of their poses.
    """
    if result.KIND != "run":
        return {}
    names = {name: v for v in result.variables for name in (v.name, *v.names)}
    sizes = {name: shown_in(names[name].name, names[name].unit, result.units)[1] for name in of}
    return {
        name: (x.minimum / sizes[name], x.minimum_at, x.maximum / sizes[name], x.maximum_at)
        for name, x in of.items()
        if np.isfinite(x.maximum)
    }


def print_work(result: Result, of: Mapping[str, Average], console: Console) -> None:
    """Print the work of powers, if there are any."""
    from symgen.report.tables import table

    unit, size = result.units.get("J", ("J", 1.0))
    works = [(n, x.work, x.positive_work, x.negative_work) for n, x in of.items() if x.work is not None]
    if works:
        rows = [(name, *(x / size for x in each if x is not None)) for name, *each in works]
        head = ("power", f"work [{unit}]", f"positive [{unit}]", f"negative [{unit}]")
        console.print(table("Work", head, rows))


def with_averages(result: Any) -> dict[str, Any]:
    """Return the summary of a result; that of outputs has means over time, and work, if there are any."""
    summary: dict[str, Any] = result.summary()
    for name, of in averages_of(result).items() if isinstance(result, Result) else ():
        works = {"work": of.work, "positive_work": of.positive_work, "negative_work": of.negative_work}
        known = {word: x for word, x in works.items() if x is not None}
        if result.KIND == "run" and np.isfinite(of.maximum):
            ends = ("minimum", "minimum_at", "maximum", "maximum_at")
            known |= {word: getattr(of, word) for word in ends}
        summary["outputs"][name] |= plain({"mean": of.mean, "mean_error": of.error, "rms": of.rms, **known})
    return summary


def times(result: Result) -> list[tuple[str, ...]]:
    """Return the row of the times of poses over an input, which a drive may pass more than once."""
    known = result.times is not None and result.coordinate.name != "time"
    return [("time", "s", *(f"{t:.6g}" for t in result.time))] if known else []


def texts(unit: str, values: np.ndarray) -> list[list[str]]:
    """Return the rows of an array as text, with round-off as 0."""
    if not values.size:
        return [[] for _ in values]
    flat = Components([Variable("", unit, "", tuple(map(str, range(values.size))), values.reshape(1, -1))], 1)
    words = [flat.text(float(x[0])) for _, _, x in flat.rows]
    width = values.shape[1]
    return [words[i * width : (i + 1) * width] for i in range(len(values))]
