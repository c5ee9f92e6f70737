"""The equations of motion of a linkage as dy/dt = f(t, y) for external solvers, and their results."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.errors import ModelError, shown
from symgen.runtime._rhs import Rhs
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.integrate.redundancy import slack
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.result.recording import grouped, motion, outputs_by_group, references_of
from symgen.runtime.result.records import Drift, Variable, of_model, over_time
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State

_VECTOR = ctypes.POINTER(ctypes.c_double)
_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_double, _VECTOR, _VECTOR, ctypes.c_void_p)


def right_hand_side(begin: State, evaluator: Evaluator, redundant: int, work_of_loads: bool = False) -> Rhs:
    """Return ``f`` with dy/dt = f(t, y, u) of y = (q, u): coordinates [m] and velocities [m/s] in order.

    Behind them are the angles of torsion springs, and in other loads [rad], from their free angle or zero on:
    with them a state has revolutions. ``f.at(state)`` returns y of a ``State``.

    It takes any array of these numbers and returns a new one, in one compiled call:
    ``solve_ivp(model.rhs, (0, 1), model.rhs.start)``. ``f(t, y, u)`` takes values u of the scene's inputs,
    in SI units and in the order of ``inputs``; without u they are those of ``model.parameters``.

    ``start`` is the initial state of the scene. ``project(t, y)`` returns the state projected onto the
    constraints with the least change. ``energy(t, y)`` is kinetic plus potential energy [J]. The
    accelerations satisfy only the second derivatives of the constraints, so integration errors make a state
    drift off the constraints: project it from time to time.

    ``low_level`` is the same as a ``scipy.LowLevelCallable``, for solvers that call from C: see
    :func:`low_level`. Its inputs are those of the last call from Python. If accelerations are not finite,
    both return numbers that are not finite.

    Each ``model.rhs`` has its own scratch memory. Threads of Python may share one, since a call holds the
    GIL; threads that call the compiled function without the GIL need one each.

    With ``work_of_loads`` the work of loads without potential [J] is behind u, if there are any.

    Raises
    ------
    InitialStateError
        When the start cannot be assembled.
    """
    equations = evaluator.equations(redundant, slack(evaluator, begin.q), work_of_loads=work_of_loads)
    d = evaluator.description

    def at(state: State) -> Array:
        return np.concatenate(
            [state.q, state.u, np.zeros(equations.extra), angles_in_loads(evaluator, state)]
        )

    return Rhs(equations, begin, at, d.inputs, len(d.tunable) - len(d.inputs), evaluator.library.addresses)


def angles_in_loads(evaluator: Evaluator, state: State) -> Array:
    """Return the angles of torsion springs and in other loads [rad], with the revolutions of a state."""
    if not evaluator.description.windings:
        return np.zeros(0)
    of = evaluator if state.references is None else evaluator.holding(state.references)
    return of.blocks("events", state.t, state.q, state.u)["windings"].ravel()


def low_level(function: int, equations: int, owner: Rhs) -> Any:
    """Return a compiled right-hand side as a ``scipy.LowLevelCallable``.

    Its signature is ``void (double, double *, double *, void *)``: the time [s], y, dy/dt (output), and
    ``user_data``, which holds parameters and scratch memory. It takes no lock and allocates nothing.
    """
    from scipy import LowLevelCallable

    compiled = _SIGNATURE(function)
    compiled.owner = owner  # type: ignore[attr-defined]  # keeps the memory behind user_data alive
    return LowLevelCallable(compiled, ctypes.c_void_p(equations))


def rows(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return finite numbers of a shape; raise ModelError. With an empty shape they rise."""
    try:
        array = np.ascontiguousarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"expected numbers for {name}, got {values!r}") from None
    words = f"shape {shape} (times, numbers)" if shape else "one axis"
    if array.shape != (shape or (array.size,)) or not array.size:
        turned = (
            "\n  Give them with a row per time: motion.y.T of solve_ivp." if array.T.shape == shape else ""
        )
        raise ModelError(f"expected {name} of {words}, got shape {array.shape}{turned}")
    if not np.isfinite(array).all():
        raise ModelError(f"expected finite numbers for {name}, got {array[~np.isfinite(array)][0]}")
    if not shape and not np.all(np.diff(array) > 0):
        raise ModelError(f"expected increasing {name}, got {shown(array.tolist())}")
    return array


def recorded(
    evaluator: Evaluator, redundant: int, times: Array, states: Array, inputs: Array | None, **options: Any
) -> Result:
    """Return the result of states (times, numbers) from an external solver.

    The states are those of :func:`right_hand_side`. ``inputs`` are those of the scene at each time, by
    default those of the model; ``options`` is the provenance.
    """
    d = evaluator.description
    first = len(d.tunable) - len(d.inputs)
    if inputs is None:
        inputs = np.tile(evaluator.parameter_values[first : len(d.tunable)], (len(times), 1))
    states, angles = np.split(states, [states.shape[1] - d.windings], axis=1)
    groups = [*grouped(evaluator.parameter_values, first, np.hstack([inputs, references_of(angles)]))]
    equations = evaluator.equations(redundant)
    variables = outputs_by_group(evaluator, equations, groups, times, states, redundant)
    end = float(times[-1])
    return Result(
        **of_model(d, evaluator.parameter_values[: len(d.tunable)].tolist(), step=0.0, t_end=end, **options),
        axes=d.shown_axes,
        coordinate=over_time(times),
        variables=tuple(_unwound(v, d.turns) for v in variables),
        drift=_drift(evaluator, groups, times, states),
        final=motion(evaluator, end, states[-1]),
        statistics={"t": end},
        notes=("drift is that of the recorded times",),
    )


def _unwound(variable: Variable, links: tuple[str, ...]) -> Variable:
    """Return the angle of a link without jumps from sample to sample; another output as it is."""
    turns = variable.name.removesuffix(".angle") in links
    return replace(variable, values=np.unwrap(variable.values)) if turns else variable


def _drift(
    evaluator: Evaluator, groups: Iterable[tuple[Array, Indices]], times: Array, states: Array
) -> Drift:
    """Return the drift of the recorded states from the constraints and the energy balance."""
    n = evaluator.description.coordinates
    accounted = states.shape[1] > 2 * n or not evaluator.description.work_of_loads
    q, u, work = np.split(states, [n, 2 * n], axis=1)
    kinetic, potential = np.empty((2, len(times)))
    for parameters, rows in groups:
        energies = evaluator.at(parameters).many("energy", times[rows], q[rows], u[rows])
        kinetic[rows], potential[rows] = energies[:, :2].T
    total = kinetic + potential - np.sum(work, axis=1)
    errors, rates = np.zeros(1), np.zeros(1)
    if evaluator.has("constraints"):
        blocks = evaluator.many_blocks("constraints", times, q, u)
        errors = blocks["constraints"] / blocks["constraint_scale"]
        rates = evaluator.many("velocity_constraints", times, q, u) / blocks["constraint_scale"]
    return Drift(
        constraint=float(np.max(np.abs(errors))),
        velocity=float(np.max(np.abs(rates))),
        energy=float(np.max(np.abs(total - total[0]))) if accounted else np.nan,
        energy_exchanged=float(max(np.ptp(kinetic), np.ptp(potential))),
    )
