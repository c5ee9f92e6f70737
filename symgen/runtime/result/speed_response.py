"""Steady states over the crank speed, and dangerous speeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from symgen.calls import checked
from symgen.runtime.arrays import Array
from symgen.runtime.result.elastic import is_stable
from symgen.runtime.result.result import Result


@checked
class SpeedResponse(Result):
    """Steady states over crank speeds [rad/s]; ``response["coupler.stress"]`` has the peaks of a revolution.

    The output ``floquet`` is the largest Floquet multiplier.
    """

    KIND = "speed_response"

    def __repr__(self) -> str:
        return f"<SpeedResponse {self.name!r}: {self.count} speeds, {len(self.resonances)} resonances>"

    @property
    def speeds(self) -> Array:
        """The crank speeds [rad/s]."""
        return self.coordinate.values

    @property
    def first_critical(self) -> float:
        """Crank speed [rad/s] equal to the lowest frequency of the structure at rest in any pose."""
        return float(self.statistics["first_critical"])

    @property
    def resonances(self) -> tuple[float, ...]:
        """Speeds [rad/s] at which the largest stress is larger than at both neighbours."""
        stress = np.max([v.values for v in self.variables if v.name.endswith(".stress")], axis=0)
        inside = (stress[1:-1] > stress[:-2]) & (stress[1:-1] > stress[2:])
        return tuple(self.speeds[1:-1][inside].tolist())

    @property
    def verdicts(self) -> tuple[bool | None, ...]:
        """Whether the steady state at each speed is stable; None if its multipliers are too inaccurate."""
        largest = self.variable("floquet").values.tolist()
        return tuple(map(is_stable, largest, self.statistics["floquet_errors"]))

    @property
    def unstable(self) -> tuple[float, ...]:
        """Speeds [rad/s] with an unstable steady state."""
        return tuple(
            s for s, stable in zip(self.speeds.tolist(), self.verdicts, strict=True) if stable is False
        )

    def completed(self) -> dict[str, Any]:
        """Return the statistics with resonances, unstable speeds and the stability at each speed; notes."""
        statistics = {"resonances": self.resonances, "unstable": self.unstable, "stable": self.verdicts}
        more = {name: list(values) for name, values in statistics.items()}
        return {"statistics": {**self.statistics, **more}, "notes": self.notes}

    @property
    def headline(self) -> str:
        """Title line of plots: the estimated error."""
        return f"steady states, estimated error {self.statistics['error']:.1e} of the peak stress at most"
