"""Exact derivatives of outputs by parameters, at a held pose or at an equilibrium that moves with them.

Parameters change the constraints, J dq + Phi_p dp = 0, and the equations of motion. A held pose keeps its
drives and its independent coordinates with their rates; an equilibrium keeps its forces in balance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of, with_outputs
from symgen.runtime.linearisation.switching import notes_of
from symgen.runtime.linearisation.tangents import Tangents
from symgen.runtime.linearisation.vibration import spectrum

#: Largest difference of slopes of constraints that agree, over their size.
_EQUAL = 1e-9
#: Relative change of a parameter that shows whether a start depends on it.
_MOVED = 1e-3
#: Stiffness of a neutral freedom, over the largest.
_NEUTRAL = 1e-12
#: Fraction of the largest displacement above which a coordinate represents a motion.
_MOST = 0.999
#: Number of solutions of the equations of a moved pose, each for the residual of the previous one.
_REFINED = 3


def at_pose(
    tangents: Tangents, outputs: Sequence[str], by: Sequence[str], coordinates: Sequence[str]
) -> Sensitivity:
    """Return the derivatives of outputs by parameters, or by coordinates and their rates.

    Drives, and the coordinates and rates that do not vary, are held.

    Raises
    ------
    ModelError
        As :meth:`Tangents.directions`; for a state that violates the constraints; for a parameter that
        breaks redundant constraints.
    SimulationError
        When a derivative is not finite.
    """
    tangents.check_closed()
    return _of_outputs(tangents, outputs, by, *moved_motion(tangents, by, coordinates))


def moved_pose(tangents: Tangents, by: Sequence[str], coordinates: Sequence[str]) -> tuple[Array, Array]:
    """Return dq and du, each (n, directions), by parameters, or by coordinates and their rates.

    The coordinates and rates that do not vary are held.

    Raises
    ------
    ModelError
        As :meth:`Tangents.directions`; for a parameter that breaks redundant constraints.
    """
    dq, du = _moved(tangents, by, coordinates)
    return dq.astype(float), du.astype(float)


def moved_motion(
    tangents: Tangents, by: Sequence[str], coordinates: Sequence[str]
) -> tuple[Array, Array, Array]:
    """Return dq, du and the differentials of accelerations and multipliers; as :func:`moved_pose`."""
    dq, du = _moved(tangents, by, coordinates)
    residual = tangents.slopes.residual
    end = len(residual) - tangents.couples
    tangents.check_kept(by, residual[end - tangents.m : end], dq.astype(float), du.astype(float))
    left = residual[:, tangents.by_q] @ dq + residual[:, tangents.by_u] @ du
    dw = tangents.solved(left + tangents.direct(residual, by))
    return dq.astype(float), du.astype(float), dw


def _moved(
    tangents: Tangents, by: Sequence[str], coordinates: Sequence[str]
) -> tuple[NDArray[np.longdouble], NDArray[np.longdouble]]:
    """Return the same in long double."""
    slopes, direct = tangents.slopes, tangents.direct
    unit = tangents.free @ np.linalg.inv(tangents.directions(coordinates))
    places, rates = slopes.rows(coordinates), slopes.rows([f"{name}'" for name in coordinates])

    def varied(mark: str) -> Array:
        """Return the changes of coordinates, or of their rates, along the directions."""
        each = [[float(x == name + mark) for x in by] for name in coordinates]
        return np.reshape(each, (len(coordinates), len(by)))

    # Directions of short links follow from small differences of displacements of long ones.
    dq = np.zeros((tangents.n, len(by)), np.longdouble)
    if set(by).intersection(tangents.parameters):
        dq += closing_motion(tangents, by)
    du = np.zeros_like(dq)
    for again in range(_REFINED):
        if again:
            opened = slopes.constraints[:, tangents.by_q] @ dq + direct(slopes.constraints, by)
            dq = dq - tangents.bound @ (opened / tangents.scale[:, None])
        dq = dq - unit @ (places[:, tangents.by_q] @ dq + direct(places, by) - varied(""))
    tangents.check_kept(by, slopes.rates, dq.astype(float))
    for _ in range(_REFINED):
        moved = slopes.rates[:, tangents.by_q] @ dq + direct(slopes.rates, by) + tangents.jacobian @ du
        du = du - tangents.bound @ (moved / tangents.scale[:, None])
        left = rates[:, tangents.by_q] @ dq + rates[:, tangents.by_u] @ du
        du = du - unit @ (left + direct(rates, by) - varied("'"))
    return dq, du


def check_starts(model: Any, by: Sequence[str]) -> None:
    """Raise ModelError for a parameter on which the start of a first-order state depends: it is held."""
    if not (model.description.states and by):
        return
    first = model.description.of_points
    starts = model.initial_state().u[first:]
    for name in by:
        if (value := model.parameters.get(name)) is None:
            continue
        moved = model.with_parameters(**{name: value * (1 + _MOVED) or _MOVED})
        if not np.array_equal(moved.initial_state().u[first:], starts):
            raise ModelError(
                f"{model.name}: derivatives hold the starts of states, and {name} sets one of them\n"
                "  Take differences of runs."
            )


def at_equilibrium(
    tangents: Tangents,
    outputs: Sequence[str],
    parameters: Sequence[str],
    spectra: Sequence[str],
    vibration: Callable[[], Evaluator],
) -> Sensitivity:
    """Return the derivatives of outputs at an equilibrium that moves with the parameters.

    Those of the ``spectra``, of frequencies or poles, follow, by the kernels of the analysis ``vibration``.

    Raises
    ------
    ModelError
        As :func:`moved_rest` and :func:`spectrum`; for the spectra of a scene with first-order states.
    """
    n = tangents.n
    if spectra and tangents.description.integrals:
        raise ModelError(
            f"{spectra[0]} of {tangents.description.name} have no derivatives, since its scene has [states]\n"
            "  linearise(equilibrium).poles are the eigenvalues."
        )
    dq, rates, multipliers = moved_rest(tangents, parameters)
    solution = np.zeros((len(tangents.solution), dq.shape[1]))  # couples by forces stay zero, too
    solution[n : n + tangents.m] = multipliers
    result = _of_outputs(tangents, outputs, parameters, dq, rates, solution)
    result = replace(result, at_equilibrium=True)
    for name in spectra:
        moved = np.vstack([dq, multipliers])
        names, values, slopes = spectrum(tangents, vibration(), moved, parameters, name)
        units = {"real": "1/s", "imag": "rad/s"}
        result = with_outputs(result, {x: units.get(x[-4:], "Hz") for x in names}, values, slopes)
    return result


def moved_rest(tangents: Tangents, parameters: Sequence[str]) -> tuple[Array, Array, Array]:
    """Return dq, du and the differentials of the multipliers of an equilibrium, (n or m, parameters) each.

    Rates are zero but those of integrals, which are first-order states.

    Raises
    ------
    ModelError
        For a neutral equilibrium; for a parameter that breaks redundant constraints.
    """
    n, states = tangents.n, slice(tangents.n - len(tangents.description.integrals), tangents.n)
    force = tangents.slopes.residual[:n]
    by_q, direct = force[:, tangents.by_q].copy(), tangents.direct(force, parameters)
    by_q[:, states] = force[:, tangents.by_u][:, states]  # of these in place of their integrals
    dq = closing_motion(tangents, parameters)
    stiffness = tangents.free.T @ by_q @ tangents.free
    _, sizes, right = np.linalg.svd(stiffness)
    if len(sizes) and sizes[-1] <= _NEUTRAL * max(sizes[0], float(np.max(np.abs(by_q)))):
        d, motion = tangents.description, tangents.free @ right[-1]
        name = d.coordinate_outputs[int(np.argmax(np.abs(motion) > _MOST * np.max(np.abs(motion))))]
        raise ModelError(
            f"the equilibrium of {d.name} is neutral: no force determines {name}, so parameters do not "
            "determine how it moves\n"
            "  Add a spring or a drive; or hold independent coordinates: give equilibrium.state for at, with "
            "coordinates."
        )
    dq = dq - tangents.free @ np.linalg.solve(stiffness, tangents.free.T @ (by_q @ dq + direct))
    multipliers = (tangents.bound.T @ (by_q @ dq + direct)) / tangents.scale[:, None]
    rates = np.zeros_like(dq)
    rates[states], dq[states] = dq[states], 0.0
    return dq, rates, multipliers


def closing_motion(tangents: Tangents, by: Sequence[str]) -> Array:
    """Return the minimum-norm change of the pose that keeps the constraints, (n, directions).

    Raises
    ------
    ModelError
        For a parameter that opens redundant constraints in this pose, or as the mechanism moves from it.
    """
    slopes, d = tangents.slopes, tangents.description
    scaled = slopes.constraints / tangents.scale[:, None]
    size = np.max(np.abs(scaled[:, tangents.by_q]), axis=1, initial=1.0)
    other = np.abs(slopes.constraints[:, tangents.by_q] - tangents.jacobian) / tangents.scale[:, None]
    for row in map(int, np.flatnonzero(np.max(other, axis=1, initial=0.0) > _EQUAL * size)):
        raise ModelError(f"derivatives by parameters are not available with {d.labels[row]}")
    tangents.check_kept(by, slopes.constraints)
    dq = -tangents.bound @ tangents.direct(scaled, by)
    # Beside the motion of the state, which may be that of the ground: the constraints' rates vanish for both.
    for motion in tangents.motions.T if tangents.redundant else ():
        tangents.check_kept(by, tangents.rates_along(tangents.state.u + motion), dq)
    return np.asarray(dq)


def _of_outputs(
    tangents: Tangents, outputs: Sequence[str], by: Sequence[str], dq: Array, du: Array, dw: Array
) -> Sensitivity:
    slopes = tangents.slopes
    shown = [x for name in outputs for x in slopes.scalars(name)]
    tangents.check_unique(shown)
    rows = slopes.rows(shown)
    derivatives = (
        rows[:, tangents.by_q] @ dq
        + rows[:, tangents.by_u] @ du
        + rows[:, tangents.by_solution] @ dw
        + tangents.direct(rows, by)
    )
    units = {name: slopes.units[name] for name in shown}
    values = np.array([slopes.values[name] for name in shown])
    d, t = tangents.description, tangents.state.t
    found = sensitivity_of(d, units, by, values, derivatives, t, slopes.units)
    return replace(found, notes=notes_of(tangents))
