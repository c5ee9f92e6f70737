"""Integration of compiled kernels with external solvers: SciPy, SUNDIALS, or a user's function."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.errors import ModelError, SimulationError, check_known
from symgen.runtime.kernels.arguments import count, real
from symgen.runtime.model.rhs import recorded, right_hand_side
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State
from symgen.runtime.rods.model.rods import RodModel

Array = NDArray[np.float64]
#: Solver: from dy/dt, times, initial state, rtol and atol to the states at all times, one per row.
Solver = Callable[[Callable[[float, Array], Array], Array, Array, float, float], Array]

#: Maximum number of SUNDIALS steps between two recorded times.
_STEPS = 10_000_000


def _scipy(
    method: str, f: Callable[[float, Array], Array], times: Array, y0: Array, rtol: float, atol: float
) -> Array:
    from scipy.integrate import solve_ivp

    solution = solve_ivp(f, (times[0], times[-1]), y0, method=method, t_eval=times, rtol=rtol, atol=atol)
    if not solution.success:
        raise SimulationError(f"SciPy's {method} failed: {solution.message}", time=float(solution.t[-1]))
    return solution.y.T


def _cvode(
    method: str, f: Callable[[float, Array], Array], times: Array, y0: Array, rtol: float, atol: float
) -> Array:
    try:
        from sksundae.cvode import CVODE
    except ImportError:
        raise ModelError(
            f"the solver 'cvode-{method}' needs SUNDIALS\n  Install it: pip install 'symgen[sundials]'"
        ) from None

    def slope(t: float, y: Array, yp: Array) -> None:
        yp[:] = f(t, y)

    solution = CVODE(slope, method=method, rtol=rtol, atol=atol, max_num_steps=_STEPS).solve(times, y0)
    if not solution.success:
        raise SimulationError(f"CVODE's {method} failed: {solution.message}", time=float(solution.t[-1]))
    return solution.y


#: Solvers by name; those of SUNDIALS come with the extra ``sundials``.
SOLVERS: Mapping[str, Solver] = MappingProxyType(
    {f"scipy-{m}": partial(_scipy, m) for m in ("DOP853", "RK45", "Radau", "BDF", "LSODA")}
    | {f"cvode-{m}": partial(_cvode, m) for m in ("Adams", "BDF")}
)


@checked
def reference(
    model: RodModel,
    solver: str | Callable[..., Array] = "scipy-DOP853",
    *,
    t_end: float | None = None,
    rtol: float = 1e-10,
    atol: float | None = None,
    samples: int = 201,
    state: State | None = None,
) -> Result:
    """Integrate a linkage with an external solver and return a result as from ``model.simulate``.

    Only the initial state is projected onto the constraints: the solver integrates an ordinary differential
    equation, and ``drift`` shows the resulting drift at the recorded times.

    Parameters
    ----------
    model
        A linkage of points and links.
    solver
        A name from :data:`SOLVERS`, or a function of dy/dt = f(t, y), the times [s], the initial state, rtol
        and atol, that returns the states at all times, one per row.
    t_end
        End of the run [s]; default: the scene's.
    rtol, atol
        Tolerances of the solver; the default of ``atol`` is rtol/1000.
    samples
        Number of equally spaced times at which the outputs are recorded.
    state
        Initial state; default: the scene's.

    Raises
    ------
    ModelError
        If an option is out of range, the solver is unknown or not installed, or it returns an invalid
        result.
    SimulationError
        If the solver fails.
    """
    name, solve = _named(solver)
    begin = model.initial_state() if state is None else state
    end = model.description.t_end if t_end is None else real(t_end, "t_end")
    count(samples, "samples")
    atol = 1e-3 * rtol if atol is None else atol
    for argument, value in (
        ("rtol", rtol),
        ("atol", atol),
        ("t_end after the start", end - begin.t),
        ("samples", samples - 1),
    ):
        if not real(value, argument) > 0:
            raise ModelError(f"expected {argument} above zero, got {value!r}")
    f = right_hand_side(model.initial_state(), model.evaluator, len(model.redundant), work_of_loads=True)
    times = np.linspace(begin.t, end, samples)
    start = f.project(begin.t, f.at(begin))
    calls = [0]

    def counted(t: float, y: Array) -> Array:
        calls[0] += 1
        return f(t, y)

    begun = time.perf_counter()
    states = np.ascontiguousarray(solve(counted, times, start, rtol, atol), dtype=float)
    wall = time.perf_counter() - begun
    if states.shape != (samples, len(start)):
        raise ModelError(
            f"{name} returned states of shape {states.shape}, expected {(samples, len(start))} (times, state)"
        )
    lost = ~np.isfinite(states).all(axis=1)
    if lost.any():
        raise SimulationError(f"{name} returned states that are not finite", time=float(times[lost.argmax()]))
    options = {"method": name, "rtol": rtol, "atol": atol, "backend": model.backend}
    result = recorded(model.evaluator, len(model.redundant), times, states, None, **options)
    return replace(result, statistics={**result.statistics, "evaluations": calls[0], "wall_s": wall})


def _named(solver: str | Solver) -> tuple[str, Solver]:
    if not isinstance(solver, str):
        return getattr(solver, "__name__", "solver"), solver
    check_known(solver, SOLVERS, "there is no solver")
    return solver, SOLVERS[solver]
