"""Minimum and maximum of recorded outputs, and where they occur."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Group

from symgen.report.tables import table
from symgen.runtime.result.records import Variable, columns
from symgen.runtime.result.result import Result

Array = NDArray[np.float64]

#: Maximum number of poses of a linkage for which every value is printed; otherwise the extremes.
FEW = 12
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
        self.rows = [
            (name, unit, np.where(np.abs(values) <= _ROUND_OFF * largest[unit], 0.0, values))
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
        mark
            Function that returns the suffix of a component's value at an index.
        """
        head = (
            "output",
            "unit",
            *(["at the end"] if end else []),
            *("least", f"at [{unit}]", "greatest", f"at [{unit}]"),
        )
        rows = []
        for name, of, values in self.rows:
            if np.all(np.isnan(values)):
                continue
            low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
            ends = [
                cell
                for k in (low, high)
                for cell in (self.text(values[k]) + mark(name, k), f"{along[k]:.6g}")
            ]
            rows.append((name, of, *([self.text(values[-1])] if end else []), *ends))
        return table(title, head, rows, keys=2)

    def values(
        self,
        title: str,
        heads: Sequence[str],
        mark: Callable[[str, int], str] = lambda name, index: "",
        first: Sequence[tuple[str, ...]] = (),
    ) -> Group:
        """Return a table with one column per value; ``first`` are rows before the outputs."""
        rows = [
            (n, u, *(self.text(x) + mark(n, k) for k, x in enumerate(values))) for n, u, values in self.rows
        ]
        return table(title, ("output", "unit", *heads), [*first, *rows], keys=2)


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
