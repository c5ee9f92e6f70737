"""Steady states of an elastic linkage over crank speeds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime.integrate.pace import is_spent
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.records import Coordinate, Drift, Variable
from symgen.runtime.result.sweep import Sweep

Progress = Callable[[float], None]


class Swept(Protocol):
    """The part of an :class:`~symgen.runtime.elastic.model.ElasticModel` that sweeps need."""

    description: Any

    @property
    def name(self) -> str:
        """Name of the scene."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values of the tunable parameters, in SI units."""

    @property
    def crank_speed(self) -> float:
        """Angular velocity of the crank [rad/s]."""

    @property
    def lowest_frequency(self) -> float:
        """The lowest frequency of the structure at rest [Hz]."""

    def with_parameters(self, /, **values: float) -> Swept:
        """Return the model with other values of its parameters."""

    def periodic(self, *, rtol: float, samples: int) -> ElasticResult:
        """Return the steady state."""


def sweep(
    model: Swept, speeds: Sequence[float], rtol: float, samples: int, progress: Progress | None
) -> Sweep:
    """Return the steady states at crank speeds [rad/s]; see :meth:`symgen.Model.sweep`."""
    if len(speeds) < 1 or not all(math.isfinite(s) and s != 0.0 for s in speeds):
        raise ModelError(f"expected crank speeds, finite and not zero, got {list(speeds)!r}")
    begun = time.perf_counter()
    name, per_speed = _parameter(model)
    runs: list[ElasticResult] = []
    for k, speed in enumerate(speeds):
        changed = model.with_parameters(**{name: per_speed * speed})
        try:
            runs.append(changed.periodic(rtol=rtol, samples=samples))
        except SimulationError as error:
            if not is_spent():
                raise
            found = _result(model, speeds[:k], runs, time.perf_counter() - begun) if runs else None
            problem = f"{error}\n  {k} of {len(speeds)} speeds were found."
            raise SimulationError(problem, time=error.time, partial=found) from None
        if progress:
            progress((k + 1) / len(speeds))
    return _result(model, speeds, runs, time.perf_counter() - begun)


def _parameter(model: Swept) -> tuple[str, float]:
    """Return the tunable parameter that the speed of the crank is proportional to, and its value per speed.

    Raises
    ------
    ModelError
        When there is none.
    """
    speed = model.crank_speed
    for name, value in model.parameters.items():
        doubled = model.with_parameters(**{name: 2 * value}).crank_speed
        if speed and value and math.isclose(doubled, 2 * speed, rel_tol=1e-12):
            return name, value / speed
    raise ModelError(
        f"{model.name} has no tunable parameter that the speed of the crank is proportional to\n"
        '  Name one in the scene: speed = { value = "95 rpm", tunable = true } under [parameters], and '
        'speed = "speed" under [crank].'
    )


def _result(model: Swept, speeds: Sequence[float], runs: Sequence[ElasticResult], wall: float) -> Sweep:
    first = runs[0]
    peaks = [
        Variable(
            v.name, v.unit, f"largest {v.about} in a turn", (), np.array([r.peaks[v.name] for r in runs])
        )
        for v in first.variables
        if v.values.ndim == 1
    ]
    largest = np.array([abs(r.floquet[0]) for r in runs])
    peaks.append(Variable("floquet", "1", "largest Floquet multiplier of a turn", (), largest))
    return Sweep(
        name=model.name,
        title=model.description.title,
        axes=first.axes,
        coordinate=Coordinate("speed", "rad/s", "crank speed", np.array(speeds, dtype=float)),
        variables=tuple(peaks),
        drift=Drift(),
        final={},
        statistics={
            "first_critical": 2 * math.pi * model.lowest_frequency,
            "floquet_errors": [r.statistics["floquet_error"] for r in runs],
            "error": max(r.statistics["error"] for r in runs),
            "wall_s": wall,
        },
        provenance={**first.provenance, "method": "sweep", "parameters": dict(model.parameters)},
        notes=_notes(runs),
    )


def _notes(runs: Sequence[ElasticResult]) -> tuple[str, ...]:
    """Say at how many speeds linear theory does not hold."""
    beyond = sum(any("linear theory" in note for note in r.notes) for r in runs)
    if not beyond:
        return ()
    return (
        f"linear theory does not hold at {beyond} of {len(runs)} speeds: 'symgen periodic' there states why",
    )
