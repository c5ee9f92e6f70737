"""Optimisation of tunable parameters by SciPy, with exact gradients of driven linkages."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from symgen.display import display
from symgen.errors import ModelError, RangeError, SimulationError, check_known, check_tunable, shown
from symgen.runtime.arrays import Array
from symgen.runtime.sweeps.problem import OptimisationArguments, Problem, ReducedOutput

#: Most iterations.
_MOST = 10**6
#: Part of a variable's range by which a point is next to a bound: a length may tend to zero.
_BESIDE = 1e-6
METHODS = ("SLSQP", "trust-constr", "differential-evolution")
#: Reductions of which an upper bound is one bound per sample: smooth, where the largest sample changes.
_LARGEST = ("peak", "greatest")
#: Signs of the samples whose upper bounds are further variables, of objectives that are their sum.
_BOUNDS = {"peak": (1.0,), "greatest": (1.0,), "range": (1.0, -1.0)}
#: Objective where a run fails, over that at the start.
_FAILED = 1e6
#: Points that are tried where the run of the default start fails, a power of two.
_TRIED = 64
#: Members per variable of a generation of differential evolution.
_MEMBERS = 15
#: Status of trust-constr that its callback has stopped.
_STOPPED = 3


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
    start
        Variables, objective and constrained quantities at the start; empty for differential evolution.
    history
        The objective after each iteration or generation; before constraints are met, it may be better.
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
    start: dict[str, float] = field(default_factory=dict)
    history: tuple[float, ...] = ()

    def __repr__(self) -> str:
        state = "converged" if self.converged else "not converged"
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.parameters.items())
        return f"<Optimum {self.objective:.6g} at {values}: {state}, {self.runs} runs>"

    def _repr_html_(self) -> str:
        return display("optimum_html", self)

    def summary(self) -> dict[str, Any]:
        """Return all but the model as plain data."""
        return {name: getattr(self, name) for name in self.__slots__ if name != "model"}


def optimum_of(search: OptimisationArguments, objective: str, measured: Sequence[str] = ()) -> Optimum:
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
        check_tunable(name, model.parameters, model.name)
    for name in start.keys() - bounds.keys():
        raise ModelError(f"the start has {name}, which is not among the variables {', '.join(bounds)}")
    if search.tolerance <= 0.0 or not 1 <= search.iterations <= _MOST:
        text = f"{search.tolerance:g}, {search.iterations}"
        raise ModelError(f"expected a tolerance above 0 and 1 to {_MOST} iterations, got {text}")
    goal = ReducedOutput.named(objective, bounds)
    quantities = {name: ReducedOutput.named(name, bounds) for name in (*limits, *measured)}
    problem = Problem(bounds, [goal, *quantities.values()], search)
    begin = np.array([start.get(name, model.parameters[name]) for name in bounds])
    x = np.clip((begin - problem.low) / (problem.high - problem.low), 0.0, 1.0)
    _check_bounds(problem, x)
    if not start and method != "differential-evolution":
        x = _working(problem, goal, x)
    pairs, named = [(quantities[name], *limits[name]) for name in limits], {objective: goal, **quantities}
    begun, history = dict[str, float](), list[float]()
    if method == "differential-evolution":
        optimum = _evolved(problem, goal, pairs, history)
    else:
        begun = dict(zip(bounds, problem.parameters(x).tolist(), strict=True))
        begun |= {name: problem.value(quantity, x) for name, quantity in named.items()}
        optimum = _descended(problem, goal, pairs, x, history)
    x = np.clip(optimum.x[: len(bounds)], 0.0, 1.0)
    values = dict(zip(bounds, problem.parameters(x).tolist(), strict=True))
    return Optimum(
        values,
        problem.value(goal, x),
        {name: problem.value(quantity, x) for name, quantity in quantities.items()},
        {name: problem.unit(quantity) for name, quantity in named.items()},
        bool(optimum.success),
        str(optimum.message),
        "none" if method == "differential-evolution" else problem.gradients,
        problem.runs,
        model.with_parameters(**values),
        begun,
        tuple(history),
    )


def _check_bounds(problem: Problem, x: Array) -> None:
    """Refuse bounds next to which a value of the scene has the wrong sign; other variables at the start."""
    for i, name in enumerate(problem.names):
        for bound, inside in ((problem.low[i], _BESIDE), (problem.high[i], 1.0 - _BESIDE)):
            at = problem.parameters(np.where(np.arange(len(x)) == i, inside, x))
            try:
                problem.model.with_parameters(**dict(zip(problem.names, at.tolist(), strict=True)))
            except RangeError as error:
                raise ModelError(f"the bound {bound:g} of {name} is not permitted: {error}") from None


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


_Limits = Sequence[tuple[ReducedOutput, float, float]]


def _working(problem: Problem, goal: ReducedOutput, x: Array) -> Array:
    """Return the point if its run succeeds, or the nearest of some others with one; else raise why."""
    from scipy.stats.qmc import Sobol

    if problem.works(x):
        return x
    others = Sobol(len(x), scramble=False).random(_TRIED)[1:]
    with suppress(SimulationError):
        runs = np.isfinite(problem.many(goal, others))
        if np.any(runs):
            return np.asarray(others[runs][np.argmin(np.linalg.norm(others[runs] - x, axis=1))])
    problem.at(x)  # raises why
    return x


def _descended(problem: Problem, goal: ReducedOutput, limits: _Limits, x: Array, history: list[float]) -> Any:
    """Minimise by gradients, with further variables for the bounds of samples; add to the history.

    A step that ends where a run fails is shortened, since the objective is large there.
    """
    from scipy.optimize import minimize

    problem.choose_gradients(x)
    count, signs, search = len(x), _BOUNDS.get(goal.reduction, ()), problem.search
    first = problem.of(goal, problem.at(x)[goal.output]) if signs else np.array([problem.value(goal, x)])
    size = float(np.max(np.abs(first))) or 1.0
    begin = np.append(x, [np.max(sign * first) / size for sign in signs])
    linear, last = np.append(np.zeros(count), np.ones(len(signs))), [x]

    def there(y: Array) -> Array:
        """Return the point if its run succeeds, or the last one whose did."""
        if problem.works(y[:count]):
            last[0] = y[:count].copy()
        return last[0]

    def value(y: Array) -> float:
        if not problem.works(y[:count]):
            return _FAILED
        return float(linear @ y) if signs else problem.value(goal, y) / size

    def slope(y: Array) -> Array:
        return linear if signs else problem.slope(goal, there(y)) / size

    rules = [
        _below_variable(problem, goal, sign, (count, count + k, len(begin)), size, there)
        for k, sign in enumerate(signs)
    ]
    for quantity, low, high in limits:
        rules.append(_between(problem, quantity, (low, high), x, len(begin), there))
    options: dict[str, float] = {"maxiter": search.iterations}
    if search.method == "SLSQP":
        options["ftol"] = search.tolerance
    else:  # its own criterion leaves out the barrier parameter, which bounds the error of active constraints
        options |= {"gtol": 0.0, "xtol": search.tolerance, "barrier_tol": search.tolerance}

    def met(y: Array, state: Any = None) -> bool:
        history.append(problem.value(goal, there(y)))
        if state is None:  # of SLSQP
            return False
        rest = (state.optimality, state.constr_violation, state.barrier_parameter)
        return max(rest) < search.tolerance

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "delta_grad == 0.0")  # of samples that are linear
        optimum = minimize(
            value,
            begin,
            jac=slope,
            method=search.method,
            bounds=[(0.0, 1.0)] * count + [(None, None)] * len(signs),
            constraints=[rule.constraint(search.method, len(begin)) for rule in rules],
            options=options,
            callback=met,
            **({} if search.method == "SLSQP" else _hessian(bool(signs), len(begin))),
        )
    if search.method != "SLSQP" and optimum.status == _STOPPED:
        optimum.success, optimum.message = True, "Optimality, constraints and barrier meet the tolerance"
    return optimum


def _hessian(linear: bool, width: int) -> dict[str, Any]:
    """Return the option of a function that is linear, or whose second derivatives are approximated.

    The default, BFGS, keeps the approximation positive definite: wrong for constraints, and not even updated
    where they are linear.
    """
    from scipy.optimize import SR1

    return {"hess": (lambda *_: np.zeros((width, width))) if linear else SR1()}


@dataclass(frozen=True, slots=True)
class _Rule:
    """Bounds of a vector of functions, with its derivatives."""

    values: Callable[[Array], Array]
    slopes: Callable[[Array], Array]
    low: float
    high: float
    linear: bool = False

    def constraint(self, method: str, width: int) -> Any:
        """Return the constraint for a method of SciPy."""
        from scipy.optimize import NonlinearConstraint

        hessian = {} if method == "SLSQP" else _hessian(self.linear, width)
        return NonlinearConstraint(self.values, self.low, self.high, jac=self.slopes, **hessian)


def _below_variable(
    problem: Problem,
    goal: ReducedOutput,
    sign: float,
    places: tuple[int, int, int],
    size: float,
    there: Callable[[Array], Array],
) -> _Rule:
    """Return the constraint that no sample, times a sign, exceeds a further variable.

    ``places`` are the number of variables, the place of the further one, and the number of all.
    """
    count, place, width = places

    def rows(y: Array) -> Array:
        return y[place] - sign * problem.of(goal, problem.at(there(y))[goal.output]) / size

    def slopes(y: Array) -> Array:
        each = sign * problem.quantity(goal, there(y))[1].T / size
        whole = np.hstack([-each, np.zeros((len(each), width - count))])
        whole[:, place] = 1.0
        return whole

    return _Rule(rows, slopes, 0.0, np.inf)


def _between(
    problem: Problem,
    quantity: ReducedOutput,
    bounds: tuple[float, float],
    start: Array,
    width: int,
    there: Callable[[Array], Array],
) -> _Rule:
    """Return the constraint on a quantity: on each sample, where it bounds the largest or the least."""
    (low, high), count = bounds, len(start)
    at_start = problem.of(quantity, problem.at(start)[quantity.output]) if quantity.reduction else np.zeros(1)
    size = max(float(np.max(np.abs(at_start))), *(abs(b) for b in bounds if math.isfinite(b))) or 1.0
    each = quantity.reduction in _LARGEST and not math.isfinite(low)
    each |= quantity.reduction == "least" and not math.isfinite(high)

    def value(y: Array) -> Array:
        if not quantity.reduction:
            return np.array([problem.value(quantity, y[:count]) / size])
        x = there(y)
        if each:
            return problem.of(quantity, problem.at(x)[quantity.output]) / size
        return np.array([problem.value(quantity, x) / size])

    def slope(y: Array) -> Array:
        x = there(y)
        rows = problem.quantity(quantity, x)[1].T if each else problem.slope(quantity, x)[None]
        return np.hstack([rows / size, np.zeros((len(rows), width - count))])

    return _Rule(value, slope, low / size, high / size, not quantity.reduction)


def _evolved(problem: Problem, goal: ReducedOutput, limits: _Limits, history: list[float]) -> Any:
    """Minimise by differential evolution: all points of a generation are runs of one call."""
    from scipy.optimize import NonlinearConstraint, differential_evolution
    from scipy.stats.qmc import LatinHypercube

    random = np.random.default_rng(problem.search.seed)
    count = len(problem.names)
    population = LatinHypercube(count, seed=random).random(_MEMBERS * count)
    if np.all(np.isnan(problem.many(goal, population))):
        problem.at(population[0])  # raises why

    def value(points: Array) -> Array:
        values = problem.many(goal, np.atleast_2d(points.T))
        return np.where(np.isnan(values), np.inf, values)

    def bounded(quantity: ReducedOutput, low: float) -> Callable[[Array], Array]:
        outside = -1e300 if math.isfinite(low) else 1e300  # of runs that fail

        def with_bounds(points: Array) -> Array:
            values = problem.many(quantity, np.atleast_2d(points.T))
            values = np.where(np.isnan(values), outside, values)
            return values if points.ndim == 1 else values[None]

        return with_bounds

    def kept(intermediate_result: Any) -> None:
        history.append(float(intermediate_result.fun))

    constraints = tuple(NonlinearConstraint(bounded(q, low), low, high) for q, low, high in limits)
    return differential_evolution(
        value,
        [(0.0, 1.0)] * count,
        init=population,
        constraints=constraints,
        seed=random,
        tol=problem.search.tolerance,
        maxiter=problem.search.iterations,
        vectorized=True,
        updating="deferred",
        polish=False,
        callback=kept,
    )
