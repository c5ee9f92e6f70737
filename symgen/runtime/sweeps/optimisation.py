"""Optimisation of tunable parameters by SciPy, with exact gradients of driven linkages."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symgen.errors import ModelError, check_known, shown
from symgen.runtime.arrays import Array
from symgen.runtime.sweeps.problem import Problem, Quantity, Search

#: Most iterations.
_MOST = 10**6
METHODS = ("SLSQP", "trust-constr", "differential-evolution")
#: Reductions of which an upper bound is one bound per sample: smooth, where the largest sample changes.
_LARGEST = ("peak", "greatest")


@dataclass(frozen=True, slots=True)
class Optimum:
    """Result of an optimisation.

    Attributes
    ----------
    parameters
        Values of the variables in SI units.
    objective, constraints
        Values of the objective and of the constrained quantities there, in SI units.
    units
        These units, by the name of the quantity.
    converged, message
        Whether the method met its tolerance, and its own message.
    gradients
        ``exact``, ``differences`` and why, or ``none``.
    runs
        Number of runs.
    model
        The model with these parameters.
    """

    parameters: dict[str, float]
    objective: float
    constraints: dict[str, float]
    units: dict[str, str]
    converged: bool
    message: str
    gradients: str
    runs: int
    model: Any

    def __repr__(self) -> str:
        state = "converged" if self.converged else "not converged"
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.parameters.items())
        return f"<Optimum {self.objective:.6g} at {values}: {state}, {self.runs} runs>"

    def summary(self) -> dict[str, Any]:
        """Return all but the model as plain data."""
        return {name: getattr(self, name) for name in self.__slots__ if name != "model"}


def optimum_of(search: Search, objective: str, measured: Sequence[str] = ()) -> Optimum:
    """Return the parameters of least objective; see :meth:`symgen.Model.optimise`.

    ``measured`` are quantities without bounds, whose values are among those of the constraints.
    """
    model, start, method = search.model, search.start, search.method
    check_known(method, METHODS, "there is no method")
    bounds = {name: _pair(name, pair, open_ended=False) for name, pair in search.variables.items()}
    if not bounds:
        raise ModelError("expected variables with their bounds, got none")
    limits = {name: _pair(name, pair, open_ended=True) for name, pair in search.constraints.items()}
    for name in (*bounds, *start):
        check_known(name, model.parameters, f"{model.name} has no tunable parameter")
    for name in start.keys() - bounds.keys():
        raise ModelError(f"the start has {name}, which is not among the variables {', '.join(bounds)}")
    if search.tolerance <= 0.0 or not 1 <= search.iterations <= _MOST:
        text = f"{search.tolerance:g}, {search.iterations}"
        raise ModelError(f"expected a tolerance above 0 and 1 to {_MOST} iterations, got {text}")
    goal = Quantity.named(objective, bounds)
    quantities = {name: Quantity.named(name, bounds) for name in (*limits, *measured)}
    problem = Problem(bounds, [goal, *quantities.values()], search)
    begin = np.array([start.get(name, model.parameters[name]) for name in bounds])
    x = np.clip((begin - problem.low) / (problem.high - problem.low), 0.0, 1.0)
    pairs = [(quantities[name], *limits[name]) for name in limits]
    if method == "differential-evolution":
        optimum = _evolved(problem, goal, pairs)
    else:
        optimum = _descended(problem, goal, pairs, x)
    x = np.clip(optimum.x[: len(bounds)], 0.0, 1.0)
    values = dict(zip(bounds, problem.parameters(x).tolist(), strict=True))
    return Optimum(
        values,
        problem.value(goal, x),
        {name: problem.value(quantity, x) for name, quantity in quantities.items()},
        {name: problem.unit(quantity) for name, quantity in {objective: goal, **quantities}.items()},
        bool(optimum.success),
        str(optimum.message),
        "none" if method == "differential-evolution" else problem.gradients,
        problem.runs,
        model.with_parameters(**values),
    )


def _pair(name: str, pair: Any, *, open_ended: bool) -> tuple[float, float]:
    """Return a lower and an upper bound; where they may be open, None stands for none."""
    try:
        low, high = pair
        ends = (-math.inf if low is None else float(low), math.inf if high is None else float(high))
    except (TypeError, ValueError):
        ends = (math.nan, math.nan)
    finite = all(map(math.isfinite, ends)) if not open_ended else any(map(math.isfinite, ends))
    if not finite or not (ends[0] < ends[1] or (open_ended and ends[0] == ends[1])):
        none = ", None for one without a bound" if open_ended else ""
        given = pair.tolist() if isinstance(pair, np.ndarray) else pair
        raise ModelError(
            f"expected a lower and an upper bound of {name}, in this order{none}, got {shown(given)}"
        )
    return ends


_Limits = Sequence[tuple[Quantity, float, float]]


def _descended(problem: Problem, goal: Quantity, limits: _Limits, x: Array) -> Any:
    """Minimise by gradients. The largest sample becomes a further variable, an upper bound of all samples."""
    from scipy.optimize import NonlinearConstraint, minimize

    problem.choose_gradients(x)
    count = len(x)
    first = problem.value(goal, x)
    size = abs(first) or 1.0
    bounded = goal.reduction in _LARGEST
    begin = np.append(x, first / size) if bounded else x

    def value(y: Array) -> float:
        return float(y[count]) if bounded else problem.value(goal, y) / size

    def slope(y: Array) -> Array:
        if bounded:
            return np.append(np.zeros(count), 1.0)
        return problem.slope(goal, y[:count]) / size

    rules = []
    if bounded:
        rules.append(_below_variable(problem, goal, count, size))
    for quantity, low, high in limits:
        rules.append(_between(problem, quantity, low, high, count, len(begin)))
    constraints = [NonlinearConstraint(f, a, b, jac=j) for f, j, a, b in rules]
    search = problem.search
    options = dict.fromkeys(("ftol",) if search.method == "SLSQP" else ("gtol", "xtol"), search.tolerance)
    return minimize(
        value,
        begin,
        jac=slope,
        method=search.method,
        bounds=[(0.0, 1.0)] * count + [(None, None)] * bounded,
        constraints=constraints,
        options={"maxiter": search.iterations, **options},
    )


_Rule = tuple[Callable[[Array], Array], Callable[[Array], Array], Any, Any]


def _below_variable(problem: Problem, goal: Quantity, count: int, size: float) -> _Rule:
    """Return the constraint that no sample exceeds the last variable."""

    def rows(y: Array) -> Array:
        return y[count] - problem.of(goal, problem.at(y[:count])[goal.output]) / size

    def slopes(y: Array) -> Array:
        each = problem.quantity(goal, y[:count])[1].T / size
        return np.hstack([-each, np.ones((len(each), 1))])

    return rows, slopes, 0.0, np.inf


def _between(problem: Problem, quantity: Quantity, low: float, high: float, count: int, width: int) -> _Rule:
    """Return the constraint on a quantity: of each sample, where it bounds the largest from above."""
    size = max(abs(b) for b in (low, high) if math.isfinite(b)) or 1.0
    each = quantity.reduction in _LARGEST and not math.isfinite(low)

    def value(y: Array) -> Array:
        x = y[:count]
        if each:
            return problem.of(quantity, problem.at(x)[quantity.output]) / size
        return np.array([problem.value(quantity, x) / size])

    def slope(y: Array) -> Array:
        x = y[:count]
        rows = problem.quantity(quantity, x)[1].T if each else problem.slope(quantity, x)[None]
        return np.hstack([rows / size, np.zeros((len(rows), width - count))])

    return value, slope, low / size, high / size


def _evolved(problem: Problem, goal: Quantity, limits: _Limits) -> Any:
    """Minimise by differential evolution: all points of a generation are runs of one call."""
    from scipy.optimize import NonlinearConstraint, differential_evolution

    def value(points: Array) -> Array:
        values = problem.many(goal, np.atleast_2d(points.T))
        return np.where(np.isnan(values), np.inf, values)

    def bounded(quantity: Quantity, low: float) -> Callable[[Array], Array]:
        outside = -1e300 if math.isfinite(low) else 1e300  # of runs that fail

        def with_bounds(points: Array) -> Array:
            values = problem.many(quantity, np.atleast_2d(points.T))
            values = np.where(np.isnan(values), outside, values)
            return values if points.ndim == 1 else values[None]

        return with_bounds

    constraints = tuple(NonlinearConstraint(bounded(q, low), low, high) for q, low, high in limits)
    return differential_evolution(
        value,
        [(0.0, 1.0)] * len(problem.names),
        constraints=constraints,
        seed=np.random.default_rng(problem.search.seed),
        tol=problem.search.tolerance,
        maxiter=problem.search.iterations,
        vectorized=True,
        updating="deferred",
        polish=False,
    )
