"""Result of a run of elastic links: strains, displacements and lengths over the crank angle."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.calls import checked
from symgen.display import seconds
from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.result.result import Result

if TYPE_CHECKING:
    import xarray as xr


#: Beginning of the note that the limits of linear theory are checked at selected samples only.
SELECTED = "peaks, and limits of linear theory, are those at the"
#: Largest difference between first and last value of a steady state, over its range, that counts as zero.
_REPEATED = 1e-6
#: Error by elements, over the peak stress, above which a note advises more elements.
_COARSE = 0.05
#: Relative error of the largest Floquet multiplier from which on the stability is unknown.
FLOQUET_SETTLED = 1e-3
#: Margin by which a multiplier must exceed one for the steady state to count as unstable.
_ROUND_OFF = 1e-6


@checked
class ElasticResult(Result):
    """A run of a linkage with elastic links; ``result["coupler.bending_strain"]`` is a labelled array.

    Its coordinate is the direction of the crank ``angle`` [rad], continuous over revolutions, with the times
    as a second coordinate; the time where the crank is at rest.
    """

    KIND = "elastic"
    NOTED_IN_MANY = True

    @property
    def floquet(self) -> tuple[complex, ...]:
        """Floquet multipliers of one revolution, the largest first; empty if they were not requested."""
        return tuple(complex(re, im) for re, im in self.statistics["floquet"])

    @property
    def stable(self) -> bool | None:
        """Whether the steady state is stable; None if its multipliers are too inaccurate or absent."""
        return is_stable(abs(self.floquet[0]), self.statistics["floquet_error"]) if self.floquet else None

    @property
    def counts(self) -> Indices | None:
        """Numbers of steps between successive recorded times; None for stored runs and other motions."""
        source = self.__dict__.get("_source")
        return None if source is None else source.states.counts

    def _estimate_later(self, estimate: Callable[[], float | str]) -> None:
        """Set the function that computes :attr:`mesh_error` at the first request, or the reason for None."""
        self._cache["estimate"] = estimate

    @property
    def mesh_error(self) -> float | None:
        """Estimated error of stresses by elements, over their peak; None if unknown.

        It is 4/3 of the largest change of stresses when every element is halved. The first request, also by
        printing or saving, repeats the run with halved elements.
        """
        if "mesh_error" not in self._cache:
            estimate = self._cache.pop("estimate", None)
            error = estimate() if estimate else self.statistics.get("mesh_error")
            if isinstance(error, str):
                self._cache["mesh_note"] = f"the error by elements is not known: {error}"
                error = None
            self._cache["mesh_error"] = error
        return self._cache["mesh_error"]

    def _all_notes(self) -> tuple[str, ...]:
        """Return the notes, with one on :attr:`mesh_error` if it is large or unknown."""
        error, note = self.mesh_error, self._cache.get("mesh_note")
        if error is not None and error > _COARSE:
            note = (
                f"the error by elements is {100 * error:.0f} % of the peak stress: take more elements "
                "(elements of a link in the scene, in large rotation also elements of the run) or let abrupt "
                "loads grow gradually"
            )
        return self.notes if note is None or note in self.notes else (*self.notes, note)

    def completed(self) -> dict[str, Any]:
        """Return ``statistics`` and ``notes``, including those that are computed at the first request."""
        statistics = {**self.statistics, "mesh_error": self.mesh_error, "stable": self.stable}
        return {"statistics": statistics, "notes": self._all_notes()}

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), **self.completed()}

    def fatigue_cycles(self, output: str) -> xr.Dataset:
        """Return the cycles of an output over the run, such as ``rod.stress``, by rainflow counting.

        The recorded values are counted as by ``rainflow``. Those of a steady state repeat: the count
        begins at the largest of them, so that all cycles close.

        Returns
        -------
        xr.Dataset
            ``range`` and ``mean`` in the unit of the output, and ``count``, by ``cycle``: ranges fall, equal
            cycles are added.

        Raises
        ------
        ModelError
            When the output is not one number over increasing times.
        """
        import xarray as xr

        stress = self[output]
        values = np.asarray(stress.values, dtype=float)
        increasing = self.times is None or np.all(np.diff(self.times) > 0.0)
        if values.ndim != 1 or not increasing:
            raise ModelError(
                f"expected one number over increasing times for the count of cycles, got {output}\n"
                "  Name an output such as rod.stress, of a run without at."
            )
        if self.provenance["method"] == "periodic":
            if abs(values[-1] - values[0]) <= _REPEATED * np.ptp(values):  # a whole revolution
                values = values[:-1]
            values = np.roll(values, -int(np.argmax(values)))
            values = np.append(values, values[0])
        counts: dict[tuple[float, float], float] = {}
        for size, mean, count in rainflow(values):
            counts[size, mean] = counts.get((size, mean), 0.0) + count
        rows = np.array([(*key, counts[key]) for key in sorted(counts, reverse=True)]).reshape(-1, 3)
        unit = {"units": stress.attrs["units"]}
        return xr.Dataset(
            {
                "range": ("cycle", rows[:, 0], unit),
                "mean": ("cycle", rows[:, 1], unit),
                "count": ("cycle", rows[:, 2], {"units": "1"}),
            }
        )

    @property
    def headline(self) -> str:
        """Title line of plots: method and errors."""
        known = [
            f"{error:.1e} by {noun}"
            for noun, error in (
                ("time steps", self.statistics["error"]),
                ("elements", self.mesh_error),
            )
            if error is not None
        ]
        errors = f", estimated errors of the peak stress: {', '.join(known)}" if known else ""
        return f"{self.provenance['method']}, {self.statistics['steps']} steps{errors}"

    @property
    def facts(self) -> tuple[tuple[str, str], ...]:
        """Names and values of facts about the run; the error measure comes last."""
        error = self.statistics["error"]
        return (
            ("method", str(self.provenance["method"])),
            ("steps", str(self.statistics["steps"])),
            ("time", seconds(float(self.statistics["wall_s"]))),
            ("error by time steps", "not estimated" if error is None else f"{error:.1e} of the peak stress"),
        )


def rainflow(history: Array) -> Iterator[tuple[float, float, float]]:
    """Yield range, mean and count, 1 or 1/2, of the cycles of a history.

    Source: ASTM E1049, Standard Practices for Cycle Counting in Fatigue Analysis, 5.4.4.
    """
    steps = np.diff(history)
    moved = np.append(history[:1], history[1:][steps != 0.0])
    turns = np.flatnonzero(np.diff(np.sign(np.diff(moved)))) + 1
    open_points: list[float] = []
    for value in moved[np.concatenate([[0], turns, [len(moved) - 1]])].tolist() if len(moved) > 1 else ():
        open_points.append(value)
        while len(open_points) > 2:
            first, second, third = open_points[-3:]
            if abs(third - second) < abs(second - first):
                break
            if len(open_points) == 3:  # it has the start of the history
                yield _cycle(first, second, 0.5)
                del open_points[0]
            else:
                yield _cycle(first, second, 1.0)
                del open_points[-3:-1]
    for first, second in pairwise(open_points):
        yield _cycle(first, second, 0.5)


def _cycle(first: float, second: float, count: float) -> tuple[float, float, float]:
    return abs(second - first), (first + second) / 2, count


def beyond_linear_theory(notes: Iterable[str]) -> bool:
    """Return whether notes of a run report that linear theory does not hold."""
    return any("linear theory" in note and not note.startswith(SELECTED) for note in notes)


def is_stable(largest: float, error: float | None) -> bool | None:
    """Return whether a steady state is stable, from its largest Floquet multiplier and the error of this.

    None if the error is too large.
    """
    if error is None or not error <= FLOQUET_SETTLED * largest:
        return None
    return largest <= 1.0 + _ROUND_OFF + error
