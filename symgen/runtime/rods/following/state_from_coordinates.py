"""The state of a linkage at given independent coordinates and rates."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.redundancy import extent
from symgen.runtime.linearisation.tangents import LinkageTangents
from symgen.runtime.newton import corrected
from symgen.runtime.result.recording import references_of
from symgen.runtime.result.state import State
from symgen.runtime.rods.poses import Poses, counted

#: Largest change of a coordinate or drive in a step [rad], of lengths relative to the linkage's size.
_STEP = 0.2
#: Shortest step for Newton's method, over the whole way.
_LEAST = 1e-4
#: Shortest step for the drives, over the whole way.
_SHORTEST = 1e-7
#: Most iterations of Newton's method in a step.
_ITERATIONS = 12
#: Last change of an iteration, over the size of the linkage.
_CLOSED = 1e-13
#: Part of a step after which drives are compared too: at its end a whole revolution would not show.
_WITHIN = 0.382


def placed(
    at: Callable[[float, Array, Array], LinkageTangents],
    begin: State,
    values: Mapping[str, float],
    rates: Mapping[str, float],
    t: float,
    drives: Callable[[float], Mapping[str, float]],
    angular: Collection[str],
) -> tuple[Array, Array, Array]:
    """Return coordinates [m], velocities [m/s] and references of angles in loads at given coordinates.

    The linkage is led from a closed state in steps of the coordinates and of the drives, so that it stays on
    its assembly branch. Angles are reached by less than half a revolution; where loads count revolutions,
    others are refused.

    Parameters
    ----------
    at
        Returns the linearised motion at a time [s], coordinates and velocities.
    begin
        The closed state.
    values, rates
        Coordinates [rad, m] and their rates [rad/s, m/s], zero where absent.
    t
        The time of the state [s].
    drives, angular
        Values of drives at a time [rad, m], and the names of those that are angles.

    Raises
    ------
    ModelError
        For coordinates that do not determine the motion, and when the linkage cannot be led there.
    """
    names = tuple(values)
    rest = np.zeros_like(begin.q)
    tangents = at(begin.t, begin.q, rest)
    tangents.directions(names)
    target = np.array([values[name] for name in names])
    first = np.array([tangents.slopes.values[name] for name in names])
    size = extent(tangents.model, begin.q)
    scale = np.array([1.0 if name.endswith(".angle") else size for name in names])
    way = _difference(names, target, first)
    if tangents.model.description.windings:
        _check_turns(tangents.description.name, names, target, first, way)
    part, step, q = 0.0, _STEP / max(_STEP, float(np.max(np.abs(way / scale), initial=0.0))), begin.q
    before, least, path = drives(begin.t), _LEAST, [(begin.t, q)]
    while part < 1.0:
        to = min(1.0, part + step)
        when = begin.t + to * (t - begin.t)
        after = drives(when)
        # Beyond a quarter of a revolution of a drive, Newton's method may find the opposite direction.
        within = begin.t + (part + _WITHIN * (to - part)) * (t - begin.t)
        driven = max((_turned(before, x, angular, size) for x in (drives(within), after)), default=0.0)
        if driven > _STEP and step > _SHORTEST:
            step *= max(0.1, 0.9 * _STEP / driven)
            least = min(least, _LEAST * step)
            continue
        moved = _moved(at, when, q, names, first + to * way, size)
        if moved is None:
            step /= 4
            if step >= least:
                continue
            stopped = ", ".join(f"{n} = {x:.6g}" for n, x in zip(names, first + part * way, strict=True))
            requested = ", ".join(f"{n} = {x:.6g}" for n, x in values.items())
            raise ModelError(
                f"{tangents.description.name} cannot be led from its start to {requested} (SI units, rad): "
                "it "
                f"stops near {stopped}, at a dead centre or at the limit of assembly\n"
                "  Choose coordinates within its range, or others."
            )
        part, q, before = to, moved, after
        path.append((when, q))
    tangents = at(t, q, rest)
    rows = tangents.slopes.rows(names)[:, tangents.by_q]
    unit = tangents.free @ np.linalg.inv(tangents.directions(names))
    drift = tangents.model.blocks("velocity_constraints", t, q, rest)["velocity_constraints"]
    u = -tangents.bound @ (drift / tangents.scale)
    # A moving ground changes coordinates, such as the angle of a link on it, while the points rest.
    moving = np.array([tangents.slopes.values[f"{name}'"] for name in names])
    poses = Poses(np.array([t for t, _ in path]), np.array([(q, rest, rest) for _, q in path]))
    references = references_of(counted(tangents.model, poses, 0, begin.references)[:, -1])
    return q, u + unit @ (np.array([rates.get(name, 0.0) for name in names]) - moving - rows @ u), references


def _check_turns(name: str, names: tuple[str, ...], target: Array, first: Array, way: Array) -> None:
    """Refuse angles beyond half a revolution, which loads that count revolutions would not see as given.

    Those within half a revolution, such as ``model.coordinates`` returns, are known up to a revolution.
    """
    for coordinate, given, begin, change in zip(names, target, first, way, strict=True):
        if abs(given) > np.pi and abs(given - begin - change) > 1.0:
            raise ModelError(
                f"{name}: expected {coordinate} within half a revolution of its {begin:.6g} rad at the "
                f"start, got {given:.6g} rad: loads by angles and torsion springs count revolutions\n"
                f"  {begin + change:.6g} rad is that pose without a revolution; model.reached(t) returns "
                "states with those of a run, and dataclasses.replace(state, references=...) sets others."
            )


def _turned(
    before: Mapping[str, float], after: Mapping[str, float], angular: Collection[str], size: float
) -> float:
    """Return the largest change of drives: of angles within half a revolution [rad], of lengths over size."""
    changes = [
        abs(math.remainder(x - before[d], math.tau)) if d in angular else abs(x - before[d]) / size
        for d, x in after.items()
    ]
    return max(changes, default=0.0)


def _moved(
    at: Callable[[float, Array, Array], LinkageTangents],
    t: float,
    q: Array,
    names: tuple[str, ...],
    target: Array,
    size: float,
) -> Array | None:
    """Return the closed coordinates near q at which the named ones have these values; None without."""
    rest = np.zeros_like(q)

    def change(q: Array, _: Array) -> Array | None:
        try:
            tangents = at(t, q, rest)
            unit = tangents.free @ np.linalg.inv(tangents.directions(names))
        except ModelError:  # dead centre
            return None
        model, slopes = tangents.model, tangents.slopes
        missed = model.blocks("constraints", t, q, rest)["constraints"] / tangents.scale
        closing = -tangents.bound @ missed
        left = _difference(names, target, np.array([slopes.values[name] for name in names]))
        return np.asarray(closing + unit @ (left - slopes.rows(names)[:, tangents.by_q] @ closing))

    return corrected(q, change, lambda _: size, _ITERATIONS, close=_CLOSED, far=1.0)


def _difference(names: tuple[str, ...], target: Array, values: Array) -> Array:
    """Return target - values, of angles within half a revolution."""
    angles = np.array([name.endswith(".angle") for name in names], dtype=bool)
    away = target - values
    return np.where(angles, np.remainder(away + np.pi, 2 * np.pi) - np.pi, away)
