"""Exact derivatives of outputs by parameters, at a held pose or at an equilibrium that moves with them.

Parameters change the constraints, J dq + Phi_p dp = 0, and the equations of motion. A held pose keeps its
drives and its independent coordinates with their rates; an equilibrium keeps its forces in balance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
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
#: Time within which two switching points are one [s], and the relative difference of equal slopes of it.
_AT_ONCE, _SAME = 1e-9, 1e-6
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
        For a neutral equilibrium; for a parameter that breaks redundant constraints; as :func:`spectrum`; and
        for the spectra of a scene with first-order states.
    """
    n, states = tangents.n, slice(tangents.n - len(tangents.description.integrals), tangents.n)
    if spectra and tangents.description.integrals:
        raise ModelError(
            f"{spectra[0]} of {tangents.description.name} have no derivatives, since its scene has [states]\n"
            "  linearise(equilibrium).poles are the eigenvalues."
        )
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


@dataclass(frozen=True, slots=True)
class Jump:
    """The change of derivatives where a load takes its other branch: the saltation matrix.

    dy += (f_before - f_after) dt_s: the rates f of the state jump, at a time t_s that changes with state and
    parameters as g(t_s, y, p) = 0 demands (Leine and Nijmeijer, *Dynamics and Bifurcations of Non-Smooth
    Mechanical Systems*, section 7.3). ``change`` is the jump; ``by_state`` and ``direct`` give dt_s.
    """

    step: int
    change: Array
    by_state: Array
    direct: Array


def jumps_between(
    t: Array, references: Array, switches: int, tangents: Callable[[int, Array], Tangents], by: Sequence[str]
) -> list[Jump]:
    """Return the jumps of derivatives at switching points, in the order of the steps that end there.

    Parameters
    ----------
    t, references
        Times [s] of the steps from the start on, and references after each, a row each.
    switches
        Number of the last columns of these that are branches of loads.
    tangents
        Returns the linearised motion at the state after a step, with the references of a row.
    by
        Names of the directions.
    """
    places, crossings = np.arange(references.shape[1] - switches, references.shape[1]), list[Jump]()
    branches = references[:, places]
    changed = (np.flatnonzero(np.any(np.diff(branches, axis=0), axis=1)) + 1).tolist()
    while changed:
        first = last = changed.pop(0)
        held = branches[first] == branches[first - 1]
        # Switching points at one time end several steps, in the order of rounding.
        while changed and t[changed[0]] <= t[first] + _AT_ONCE:
            now = branches[changed[0]] == branches[last]
            if not np.all(held | now):
                break
            held &= now
            last = changed.pop(0)

        before = tangents(first, references[first - 1])

        def lost(gaps: Sequence[int]) -> Array:
            """Return what the rates of the state lose where some gaps pass zero."""
            row = references[first - 1].copy()  # noqa: B023  # called in this pass of the loop
            row[places[gaps]] = references[last, places[gaps]]  # noqa: B023
            return np.asarray(before.moving - tangents(first, row).moving)  # noqa: B023

        crossings += _at_once(last, before, lost, np.flatnonzero(~held).tolist(), by)
    return crossings


def _at_once(
    step: int,
    at: Tangents,
    lost: Callable[[Sequence[int]], Array],
    gaps: list[int],
    by: Sequence[str],
) -> Iterator[Jump]:
    """Yield the jumps of derivatives where gaps pass zero at one time.

    A gap that is not zero there changes sign with another one, such as that of a profile of the remainder
    ``mod`` with the remainder. Gaps whose times change alike pass together. Those whose times change
    differently pass in either order, and derivatives exist if the order makes no difference.

    Raises
    ------
    ModelError
        Where it does: motions beside are not linear.
    """
    names = [f"switch.{k}" for k in gaps]
    rates = np.array([_rate(at, gap) for gap in names])
    values = np.array([at.slopes.values[gap] for gap in names])
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.where(rates != 0.0, np.abs(values / rates), np.inf)
    there = [k for k, far in zip(gaps, away, strict=True) if far <= np.min(away) + _AT_ONCE]
    groups = list[tuple[list[int], tuple[Array, Array]]]()
    for k in there:
        time = passing(at, f"switch.{k}", by)
        like = next((g for g, other in groups if _alike(time, other)), None)
        if like is None:
            groups.append(([k], time))
        else:
            like.append(k)
    if len(groups) == 1:
        groups = [(gaps, groups[0][1])]
    else:
        _check_order(at, lost, [g for g, _ in groups], len(there) < len(gaps))
    for group, time in groups:
        change = lost(group)
        if np.any(change):
            yield Jump(step, change, *time)


def _alike(time: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    """Return whether the times of two switching points change alike."""
    a, b = np.concatenate(time), np.concatenate(other)
    return bool(np.allclose(a, b, rtol=_SAME, atol=_SAME * np.max(np.abs(b))))


def _check_order(
    at: Tangents,
    lost: Callable[[Sequence[int]], Array],
    groups: Sequence[Sequence[int]],
    others: bool,
) -> None:
    """Raise ModelError if rates, or times, depend on the order in which groups of gaps pass zero.

    ``others`` are gaps that change sign with some of these.
    """
    alone = [lost(group) for group in groups]
    size = _SAME * float(np.max(np.abs(alone))) + _EQUAL * float(np.max(np.abs(at.moving)))
    differs = others or any(
        np.max(np.abs(lost([k for i in some for k in groups[i]]) - sum(alone[i] for i in some))) > size
        for count in range(2, len(groups) + 1)
        for some in combinations(range(len(groups)), count)
    )
    for i, group in enumerate(groups):
        row = at.slopes.outputs[f"switch.{group[0]}"][: 2 * at.n]
        differs |= any(
            abs(row @ change) > _SAME * abs(_rate(at, f"switch.{group[0]}"))
            for j, change in enumerate(alone)
            if j != i
        )
    if differs:
        raise ModelError(
            f"loads switch at once, at {at.state.t:.6g} s, parameters move their times apart, and the motion "
            "depends on which is first: there are no derivatives\n"
            "  Change a parameter a little, or end before this time."
        )


def _rate(at: Tangents, gap: str) -> float:
    """Return the rate of a gap along the motion."""
    row = at.slopes.outputs[gap]
    return float(row[: 2 * at.n] @ at.moving + row[-1])


def passing(at: Tangents, gap: str, by: Sequence[str]) -> tuple[Array, Array]:
    """Return the derivatives of the time [s] at which a gap passes zero, by the state and by directions."""
    row, rate = at.slopes.outputs[gap], _rate(at, gap)
    return row[: 2 * at.n] / -rate, at.direct(row[None], by)[0] / -rate


def total_slopes(
    end: Tangents, outputs: Sequence[str], by: Sequence[str], event: str | None = None
) -> tuple[Array, Array]:
    """Return the slopes of outputs by the state (outputs, 2n), and by the directions at a held state.

    With the name of a gap, those at the time at which it passes zero, followed by the slopes of this time.
    """
    rows, residual = end.slopes.rows(outputs), end.slopes.residual
    by_multipliers = rows[:, end.by_solution]

    def total(columns: Callable[[Array], Array]) -> Array:
        return columns(rows) + by_multipliers @ end.solved(columns(residual))

    by_state, direct = total(lambda x: x[:, : 2 * end.n]), total(lambda x: end.direct(x, by))
    if event is None:
        return by_state, direct
    rate = by_state @ end.moving + total(lambda x: x[:, -1:])[:, 0]
    time = passing(end, event, by)
    return tuple(  # type: ignore[return-value]
        np.vstack([by + np.outer(rate, of_time), of_time])
        for by, of_time in zip((by_state, direct), time, strict=True)
    )
