"""Pareto fronts of two objectives: optimisations of the first under bounds on the second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.result.records import attributes_of
from symgen.runtime.sweeps.optimisation import Optimum, optimum_of
from symgen.runtime.sweeps.problem import Search

if TYPE_CHECKING:
    import xarray

#: Part of the range of the second objective by which the bounds at the ends of a front are relaxed.
_SLACK = 1e-6


def front_of(search: Search, objectives: Sequence[str], points: int) -> xarray.Dataset:
    """Return designs none of which is better in both objectives; see :meth:`symgen.Model.pareto`."""
    if len(objectives) != 2 or len({*objectives}) != 2:
        raise ModelError(f"expected two objectives, got {', '.join(objectives) or 'none'}")
    if points < 2:
        raise ModelError(f"expected two points of a Pareto front or more, got {points}")
    first, second = objectives
    of_second, of_first = optimum_of(search, second, [first]), optimum_of(search, first, [second])
    least, greatest = search.constraints.get(second, (None, None))  # which the optimisations have accepted
    ends = of_second.objective, of_first.constraints[second]
    found, start = list[Optimum](), of_second.parameters
    for bound in np.linspace(*ends, points) + _SLACK * abs(ends[1] - ends[0]):
        highest = bound if greatest is None else min(bound, greatest)
        bounds = {**search.constraints, second: (least, float(highest))}
        found.append(optimum_of(replace(search, constraints=bounds, start=start), first))
        start = found[-1].parameters
    return _dataset(search.model, found, first, second)


def _dataset(model: Any, found: Sequence[Optimum], first: str, second: str) -> xarray.Dataset:
    """Return the designs that no other one dominates, over ``point``; of equal ones the first.

    A design that did not meet the tolerance may break constraints: it does not dominate those that did.
    """
    import xarray

    values = np.array([[one.objective, one.constraints[second]] for one in found])
    converged = np.array([one.converged for one in found])
    kept = []
    for i, (one, own) in enumerate(zip(found, values, strict=True)):
        better = np.all(values <= own, axis=1) & np.any(values < own, axis=1) & (converged | ~converged[i])
        equal = np.all(values[:i] == own, axis=1) & (converged[:i] == converged[i])
        if not better.any() and not equal.any():
            kept.append(one)
    columns = {first: [o.objective for o in kept], second: [o.constraints[second] for o in kept]}
    data: dict[str, Any] = {
        name: ("point", np.array(column), {"units": kept[0].units[name]}) for name, column in columns.items()
    }
    data["converged"] = ("point", np.array([o.converged for o in kept]))
    units = {p.name: p.unit for p in model.description.tunable}
    parameters = {
        name if name not in data else f"{name} (parameter)": (
            "point",
            np.array([o.parameters[name] for o in kept]),
            {"units": units[name]},
        )
        for name in kept[0].parameters
    }
    runs = sum(o.runs for o in found)
    attributes = attributes_of(model.description, f"Pareto front of {first} and {second}")
    return xarray.Dataset(data, parameters, {**attributes, "runs": runs, "gradients": kept[0].gradients})
