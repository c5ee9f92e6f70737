"""Result of a run of elastic links: strains, displacements and lengths over the crank angle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.display import seconds
from symgen.runtime.result.records import Variable
from symgen.runtime.result.result import Result

Array = NDArray[np.float64]

#: The error of the largest Floquet multiplier, as a part of it, from which on it says nothing of stability.
FLOQUET_SETTLED = 1e-3
#: By how much a multiplier may pass one before a steady state counts as unstable.
_ROUND_OFF = 1e-6


@checked
class ElasticResult(Result):
    """A run of a linkage with elastic links; ``result["coupler.bending_strain"]`` is a labelled array.

    Its coordinate is the direction of the crank ``angle`` [rad], continuous over revolutions, with the times
    as a second coordinate; the time where the crank is at rest.
    """

    KIND = "elastic"

    def panel(self, variable: Variable) -> str:
        """Return the panel of a plot that an output is drawn in: positions dwarf displacements."""
        return panel_by_kind(variable)

    @property
    def floquet(self) -> tuple[complex, ...]:
        """Floquet multipliers of one revolution, the largest first; empty if they were not requested."""
        return tuple(complex(re, im) for re, im in self.statistics["floquet"])

    @property
    def stable(self) -> bool | None:
        """Whether the steady state is stable; None where its multipliers do not tell, or there are none."""
        return is_stable(abs(self.floquet[0]), self.statistics["floquet_error"]) if self.floquet else None

    def _estimate_later(self, estimate: Callable[[], float | None]) -> None:
        """Set how :attr:`mesh_error` is computed when it is requested."""
        self._cache["estimate"] = estimate

    @property
    def mesh_error(self) -> float | None:
        """Largest change of stresses over their peak when every element is halved; None where unknown.

        The first request, which printing and saving make, repeats the run with halved elements.
        """
        if "mesh_error" not in self._cache:
            estimate = self._cache.pop("estimate", None)
            self._cache["mesh_error"] = estimate() if estimate else self.statistics.get("mesh_error")
        return self._cache["mesh_error"]

    def all_statistics(self) -> dict[str, Any]:
        """Return the statistics with those that are computed when they are requested."""
        return {**self.statistics, "mesh_error": self.mesh_error, "stable": self.stable}

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "statistics": self.all_statistics()}

    @property
    def headline(self) -> str:
        """Title line of plots: method and errors."""
        known = [
            f"{error:.1e} by {what}"
            for what, error in (
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
            ("estimated error", "not estimated" if error is None else f"{error:.1e} of the peak stress"),
        )


def panel_by_kind(variable: Variable) -> str:
    """Return a panel for outputs of the same kind: the last word of their name, with its unit."""
    kind = variable.name.rpartition(".")[2].replace("_", " ")
    return kind if variable.unit == "1" else f"{kind} [{variable.unit}]"


def is_stable(largest: float, error: float | None) -> bool | None:
    """Tell from the largest Floquet multiplier and how far off it is whether a steady state is stable.

    None where it is not known well enough to tell.
    """
    if error is None or not error <= FLOQUET_SETTLED * largest:
        return None
    return largest <= 1.0 + _ROUND_OFF + error
