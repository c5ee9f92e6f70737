"""Positions, velocities and accelerations of a model's points, by name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import as_doubles, checked
from symgen.errors import ModelError, check_known, shown
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.arguments import reals
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator

Pose = TypeVar("Pose")

#: Relative out-of-plane component of a vector that counts as rounding of an analysis in space.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class State:
    """A state of a model: time [s], coordinates [m] and velocities [m/s] of the moving points in order.

    ``positions`` and ``velocities`` hold every point, ground included, each an array of its components.
    ``references`` count the revolutions of a motion: angles of loads and torsion springs are those nearest to
    them [rad]. None where the revolutions are unknown; the angles are then within 180 degrees.
    """

    t: float
    q: Array
    u: Array
    positions: dict[str, Array]
    velocities: dict[str, Array]
    references: Array | None = None

    def __post_init__(self) -> None:
        for name in ("q", "u"):
            values = as_doubles(getattr(self, name))
            if values is None:
                raise ModelError(
                    f"expected real numbers for {name} of a state, got {shown(getattr(self, name))}"
                )
            object.__setattr__(self, name, values)

    def __repr__(self) -> str:
        return f"<State at t = {self.t:g} s: positions and velocities of {', '.join(self.positions)}>"


def state_at(evaluator: Evaluator, t: float, q: Array, u: Array, references: Array | None = None) -> State:
    """Return the state of a linkage by its coordinates and their rates, and references of angles in loads."""
    parts, points = evaluator.blocks("points", t, q, u), evaluator.description.points
    positions, velocities = (dict(zip(points, parts[k], strict=True)) for k in ("positions", "velocities"))
    return State(t, q.copy(), u.copy(), positions, velocities, references)


def parts_of(y: State | ArrayLike, t: ArrayLike, n: int, more: int = 0) -> tuple[Array, Array, Array]:
    """Return coordinates and rates of a state (n,), or of rows of states (rows, n), and a time per row [s].

    Behind them there may be ``more`` numbers, angles in loads.

    Raises
    ------
    ModelError
        For other shapes, and entries that are not real numbers.
    """
    given, at = (np.concatenate([y.q, y.u]), y.t) if isinstance(y, State) else (y, t)
    rows, times = as_doubles(given), reals(at, "the time of a state")
    if rows is None or rows.ndim not in (1, 2) or rows.shape[-1] not in (2 * n, 2 * n + more):
        got = shown(given) if rows is None else f"shape {rows.shape}"
        raise ModelError(f"expected a state y = (q, u) of {2 * n} numbers, or rows of them, got {got}")
    count = 1 if rows.ndim == 1 else len(rows)
    if len(times) not in (1, count):
        raise ModelError(f"expected one time [s], or one per state, got {shown(t)}")
    return rows[..., :n], rows[..., n : 2 * n], np.ascontiguousarray(np.broadcast_to(times, (count,)))


def in_order(names: Sequence[str], y: State | ArrayLike, t: ArrayLike) -> dict[str, Any]:
    """Return coordinates and rates of :func:`parts_of` by their names in order."""
    q, u, _ = parts_of(y, t, len(names))
    values, rates = (dict(zip(names, np.atleast_2d(x).T, strict=True)) for x in (q, u))
    return _named(values, rates, q.ndim == 1)


def _named(values: Mapping[str, Array], rates: Mapping[str, Array], single: bool) -> dict[str, Any]:
    """Return coordinates, and their rates with a mark, by name; of a single state as numbers."""
    found = {**values, **{f"{name}'": rate for name, rate in rates.items()}}
    return {name: float(x.ravel()[0]) for name, x in found.items()} if single else found


def by_name(
    d: Description, positions: Array, velocities: Array, states: Array, single: bool
) -> dict[str, Any]:
    """Return coordinates of moving points and angles of links in the plane, by name, with their rates.

    ``positions`` and ``velocities`` are those of all points, (rows, points, axes), ``states`` first-order
    states (rows, states), which are behind them.
    """
    at = {point: i for i, point in enumerate(d.points)}
    moving = [(p, i, k, x) for p, i in at.items() if p not in d.ground for k, x in enumerate(d.shown_axes)]
    values, rates = (
        {f"{p}.position.{x}": rows[:, i, k] for p, i, k, x in moving} for rows in (positions, velocities)
    )
    for link, points in d.links.items() if len(d.shown_axes) == 2 else ():
        start, end = at[points[0]], at[points[1]]
        (x, y), (v, w) = ((rows[:, end] - rows[:, start]).T for rows in (positions, velocities))
        values[f"{link}.angle"] = np.arctan2(y, x)
        rates[f"{link}.angle"] = (x * w - y * v) / (x * x + y * y)
    found = _named(values, rates, single)
    found |= _named(dict(zip(d.states, states.T, strict=True)), {}, single)
    return found


def reactions_at(evaluator: Evaluator, t: float, q: Array, u: Array, work: Array) -> dict[str, Array]:
    """Return the force of the ground on a linkage [N] at every ground point.

    ``work`` starts with accelerations and multipliers.
    """
    if not evaluator.has("reactions"):
        return {}
    reactions = evaluator.blocks("reactions", t, q, u, work)["reactions"]
    return dict(zip(evaluator.info("reactions").blocks[0].rows, reactions, strict=True))


class AssemblyModes(tuple[Pose, ...]):
    """The poses in which a mechanism can be assembled, the scene's own first.

    Attributes
    ----------
    incomplete
        Reason why there may be others; empty if the list is complete.
    """

    incomplete: str

    def __new__(cls, poses: Iterable[Pose], incomplete: str = "") -> Self:
        """Return a tuple of the poses."""
        modes = super().__new__(cls, poses)
        modes.incomplete = incomplete
        return modes

    @property
    def complete(self) -> bool:
        """Whether the list is complete."""
        return not self.incomplete

    def __repr__(self) -> str:
        return f"<AssemblyModes: {len(self)}, {self.incomplete or 'complete'}>"


def finite(state: State) -> tuple[float, Array]:
    """Return a time and (q, u) to start from; raise ModelError when a number is not finite."""
    y = np.concatenate((state.q, state.u))
    if not (math.isfinite(state.t) and np.isfinite(y).all()):
        raise ModelError(
            f"expected finite times [s] and coordinates [m, m/s] of a start, got {state.t:g} s, {y.tolist()}"
        )
    return state.t, y


@checked
@dataclass(frozen=True, slots=True)
class Accelerations:
    """The solution of the equations of motion at a state.

    Attributes
    ----------
    points
        Acceleration of every point [m/s^2].
    multipliers
        Lagrange multiplier of every constraint by its link [N/m]; multiplied by the length, the tension.
    reactions
        Force of the ground on the linkage at every ground point [N].
    not_unique
        Constraints whose multipliers are not unique, since constraints are redundant. The multipliers are
        those of minimum norm, and so are the reactions.
    """

    points: dict[str, Array]
    multipliers: dict[str, float]
    reactions: dict[str, Array]
    not_unique: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Accelerations of {', '.join(self.points)}; multipliers, reactions>"

    def __getitem__(self, point: str) -> Array:
        """Return the acceleration of a point [m/s^2]."""
        check_known(point, self.points, "there is no point")
        return self.points[point]

    def as_dict(self) -> dict[str, Any]:
        """Return plain lists and numbers, for JSON."""
        return {
            "points": {k: v.tolist() for k, v in self.points.items()},
            "multipliers": dict(self.multipliers),
            "reactions": {k: v.tolist() for k, v in self.reactions.items()},
            "not_unique": list(self.not_unique),
        }


def coordinates(
    d: Description, values: Mapping[str, ArrayLike], noun: str, unit: str, default: float | None = None
) -> Array:
    """Return the coordinates, or rates, of the moving points given by name.

    Errors name ``noun`` they are, and their unit.

    Raises
    ------
    ModelError
        When a point is not known, is missing without a default, or has no such numbers.
    """
    for name in values:
        check_known(name, d.points, f"{noun}: there is no point")
    parts = []
    for point in d.free:
        if point not in values and default is None:
            raise ModelError(f"{noun}: the point {point} is missing")
        size = len(d.shown_axes)
        component = np.asarray(values.get(point, np.full(size, default)), dtype=float)
        if component.shape != (size,) or not np.all(np.isfinite(component)):
            raise ModelError(
                f"{noun}: expected {size} finite numbers [{unit}] for {point}, got {values[point]!r}"
            )
        if d.plane:
            level = d.plane.level if default is None else default
            component = _in_plane(d, d.plane.across, level, component, f"{noun} [{unit}]: {point}")
        parts.append(component)
    return np.concatenate(parts)


def _in_plane(d: Description, across: int, level: float, vector: Array, noun: str) -> Array:
    """Return the components of a vector in the plane of a linkage; raise ModelError outside of it."""
    if abs(vector[across] - level) > _ROUNDING * max(float(np.max(np.abs(vector))), abs(level)):
        axis = d.shown_axes[across]
        raise ModelError(
            f"{noun}: expected {level:g} along {axis}, got {vector[across]:g}: "
            f"the equations of {d.name} are those of its motion in that plane\n"
            '  Write motion = "space" under [analysis] of the scene to let it leave.'
        )
    return np.array([vector[d.shown_axes.index(axis)] for axis in d.axes])
