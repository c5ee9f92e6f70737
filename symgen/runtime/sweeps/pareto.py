"""Pareto fronts of two objectives: optimisations of the first under bounds on the second."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.many.dataset import PARAMETER
from symgen.runtime.result.records import attributes_of
from symgen.runtime.sweeps.optimisation import Optimum, optimum_of
from symgen.runtime.sweeps.problem import OptimisationArguments

if TYPE_CHECKING:
    import xarray

#: Part of the range of the second objective by which the bounds at the ends of a front are relaxed.
_SLACK = 1e-6


def front_of(search: OptimisationArguments, objectives: Sequence[str], points: int) -> xarray.Dataset:
    """Return designs none of which is better in both objectives; see :meth:`symgen.Model.pareto`."""
    if len(objectives) != 2 or len({*objectives}) != 2:
        raise ModelError(f"expected two objectives, got {', '.join(objectives) or 'none'}")
    if points < 2:
        raise ModelError(f"expected two points of a Pareto front or more, got {points}")
    first, second = objectives
    of_second, of_first = optimum_of(search, second, [first]), optimum_of(search, first, [second])
    least, greatest = search.constraints.get(second, (None, None))  # which the optimisations have accepted
    ends = of_second.objective, of_first.constraints[second]
    optima, start = list[Optimum](), of_second.parameters
    for bound in np.linspace(*ends, points) + _SLACK * abs(ends[1] - ends[0]):
        highest = bound if greatest is None else min(bound, greatest)
        bounds = {**search.constraints, second: (least, float(highest))}
        optima.append(optimum_of(replace(search, constraints=bounds, start=start), first))
        start = optima[-1].parameters
    return undominated(search.model, optima, first, second)


def undominated(model: Any, optima: Sequence[Optimum], first: str, second: str) -> xarray.Dataset:
    """Return the designs that no other one dominates, over ``point``; of equal ones the first.

    A design that did not meet the tolerance may break constraints: it does not dominate those that did.
    """
    import xarray

    values = np.array([[one.objective, one.constraints[second]] for one in optima])
    converged = np.array([one.converged for one in optima])
    efficient = []
    for i, (one, row) in enumerate(zip(optima, values, strict=True)):
        better = np.all(values <= row, axis=1) & np.any(values < row, axis=1) & (converged | ~converged[i])
        equal = np.all(values[:i] == row, axis=1) & (converged[:i] == converged[i])
        if not better.any() and not equal.any():
            efficient.append(one)
    columns = {first: [o.objective for o in efficient], second: [o.constraints[second] for o in efficient]}
    data: dict[str, Any] = {
        name: ("point", np.array(column), {"units": efficient[0].units[name]})
        for name, column in columns.items()
    }
    data["converged"] = ("point", np.array([o.converged for o in efficient]))
    units = {p.name: p.unit for p in model.description.tunable}
    parameters = {
        name if name not in data else f"{name}{PARAMETER}": (
            "point",
            np.array([o.parameters[name] for o in efficient]),
            {"units": units[name]},
        )
        for name in efficient[0].parameters
    }
    runs = sum(o.runs for o in optima)
    attributes = attributes_of(model.description, f"Pareto front of {first} and {second}")
    about = {"runs": runs, "gradients": efficient[0].gradients, "units": json.dumps(efficient[0].units)}
    return xarray.Dataset(data, parameters, attributes | about)
