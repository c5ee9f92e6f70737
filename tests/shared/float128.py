"""Errors of float64 runs by runs in float128, for a scene of any kind.

Linkages run for a tenth of a second, and driven loops through their range; elastic links take the same steps
in both types. A gap is the difference of positions relative to the size, or the largest difference of an
output relative to its maximum. The claimed error of float64 is its tolerance times the amplification by the
motion, or a limit of rounding if nothing is integrated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import symgen
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.result.result import Result

#: Tolerance of the runs. For a linkage of decimetres a thousand kilometres away, or masses and lengths in
#: ratios of a million and more, float64 can claim no smaller error than the second value.
TOLERANCE, HARD = 1e-11, {"far_origin": 1e-7, "length_ratios": 1e-9, "mass_ratios": 1e-9}
#: Error amplification of such short motions: local errors add up to a few tolerances.
GROWTH = 100.0
#: Limits of rounding errors for outputs of closed loops, some near a dead centre; and for vibrations.
OF_LOOPS, OF_VIBRATIONS = 1e-9, 1e-8
#: Values below this are round-off and are not compared.
NOTHING = 1e-9
#: Limit of constraint errors in float128, relative to the size: far below the rounding of float64.
CLOSED = 1e-28


def confirmed(name: str) -> Sequence[dict[str, Any]]:
    """Return one row per run of a scene; for elastic links also one of the rigid motion.

    Elastic links with a motor have that alone: their runs are in float64 only.
    """
    wide, plain = (symgen.build(name, precision=p) for p in ("float128", "float64"))
    if isinstance(wide, LoopModel):
        return [_of_loop(wide, plain)]
    if isinstance(wide, ElasticModel):
        rigid = _of_linkage(name, wide.rigid, plain.rigid)
        return [rigid] if plain.description.elastic.mode == "motor" else [rigid, _of_beams(wide, plain)]
    return [_of_linkage(name, wide, plain)]


def holds(rows: Sequence[dict[str, Any]]) -> bool:
    """Return whether gaps are within the claimed errors, and float128 constraints within their limit."""
    return all(row["gap"] <= row["claimed"] and (row["closed"] or 0.0) <= CLOSED for row in rows)


def _of_linkage(name: str, wide: Any, plain: Any) -> dict[str, Any]:
    rtol, method = HARD.get(name, TOLERANCE), "dop853" if name in HARD else None  # power series leave no gap
    exact = wide.simulate(0.1, rtol=TOLERANCE, samples=3, max_steps=10_000)
    found = plain.simulate(0.1, method=method, rtol=rtol, samples=3, max_steps=10_000)
    places, truth = (np.array([x["position"] for x in run.final.values()]) for run in (found, exact))
    size = float(np.max(np.abs(truth)))
    gap = float(np.max(np.abs(places - truth))) / size
    return _row(gap, GROWTH * rtol, exact.drift.constraint / size)


def _of_loop(wide: LoopModel, plain: LoopModel) -> dict[str, Any]:
    size = wide.description.size
    if plain.is_driven:
        exact, found = wide.inverse_dynamics(samples=5), plain.inverse_dynamics(samples=5)
        return _row(largest_gap(found, exact), OF_LOOPS, exact.drift.constraint / size)
    runs = (m.simulate(0.05, rtol=TOLERANCE, samples=3) for m in (wide, plain))
    exact, found = runs
    return _row(largest_gap(found, exact), GROWTH * TOLERANCE, exact.drift.constraint / size)


def _of_beams(wide: ElasticModel, plain: ElasticModel) -> dict[str, Any]:
    exact, found = (m.simulate(method="newmark", steps=200, samples=3) for m in (wide, plain))
    return _row(largest_gap(found, exact), OF_VIBRATIONS, None)


def _row(gap: float, claimed: float, closed: float | None) -> dict[str, Any]:
    return {"gap": gap, "claimed": claimed, "closed": closed}


def largest_gap(found: Result, exact: Result) -> float:
    """Return the largest difference of an output relative to its maximum, except for round-off."""
    gaps = [0.0]
    for a, b in zip(found.variables, exact.variables, strict=True):
        largest = float(np.nanmax(np.abs(b.values)))
        if largest > NOTHING:
            gaps.append(float(np.nanmax(np.abs(a.values - b.values))) / largest)
    return max(gaps)
