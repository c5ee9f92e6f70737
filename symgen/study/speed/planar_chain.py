"""A planar open chain of rods as plain numbers, for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.model.rods import RodModel
from symgen.scene.rods.linkage import Linkage, RigidLink

Array = NDArray[np.float64]

#: Unsupported parts of a scene, by field of the linkage.
_NOT = {
    "bodies": "bodies in space",
    "masses": "point masses",
    "guides": "guides",
    "drivers": "drives",
    "elastic": "elastic links",
}


@dataclass(frozen=True)
class PlanarChain:
    """Rods from the ground outward, and their initial motion.

    Attributes
    ----------
    rods
        Length [m], mass [kg], distance of the centre of mass from the inner end [m], and moment of inertia
        about the centre of mass [kg m^2] of each rod.
    names
        The outer ends of the rods.
    angles, rates
        Angle and rate of each rod relative to the previous one, the first relative to x [rad, rad/s].
    origin, gravity
        Position of the ground point [m], and gravitational acceleration [m/s^2].
    t_end, samples
        End time [s], and number of equally spaced samples.
    """

    rods: tuple[tuple[float, float, float, float], ...]
    names: tuple[str, ...]
    angles: Array
    rates: Array
    origin: tuple[float, float]
    gravity: tuple[float, float]
    t_end: float
    samples: int

    def __len__(self) -> int:
        return len(self.rods)

    @cached_property
    def times(self) -> Array:
        """The recorded times [s]."""
        return np.linspace(0.0, self.t_end, self.samples)

    def places(self, angles: Array) -> Array:
        """Return positions of the outer ends (times, rods, 2) [m] for joint angles (times, rods) [rad]."""
        total = np.cumsum(angles, axis=-1)
        lengths = np.array([length for length, *_ in self.rods])
        steps = np.stack([lengths * np.cos(total), lengths * np.sin(total)], axis=-1)
        found: Array = np.cumsum(steps, axis=-2) + np.array(self.origin)
        return found


def planar_chain(linkage: Linkage, model: RodModel, t_end: float, samples: int) -> PlanarChain:
    """Return a scene as a chain.

    Raises
    ------
    ModelError
        If the scene is anything other than a chain of rods from one ground point, under gravity alone.
    """
    rods = _in_a_row(linkage)
    numbers = {p.quantity.symbol: p.default for p in linkage.parameters}

    def number(x: sp.Expr) -> float:
        return float(x.subs(numbers))

    start = model.initial_state()
    at, moving = start.positions, start.velocities
    values, angles, rates, names = [], [0.0], [0.0], []
    for link, inner, outer in rods:
        length, centre = number(link.length), number(link.centre)
        from_inner = centre if inner == link.start else length - centre
        values.append((length, number(link.mass), from_inner, number(link.inertia)))
        (x, y), (vx, vy) = at[outer] - at[inner], moving[outer] - moving[inner]
        angles.append(float(np.arctan2(y, x)))
        rates.append(float(x * vy - y * vx) / length**2)
        names.append(outer)
    x0, y0 = at[rods[0][1]].tolist()
    gx, gy = (number(g) for g in (*linkage.gravity, sp.Integer(0), sp.Integer(0))[:2])
    return PlanarChain(
        tuple(values), tuple(names), np.diff(angles), np.diff(rates), (x0, y0), (gx, gy), t_end, samples
    )


def _in_a_row(linkage: Linkage) -> list[tuple[RigidLink, str, str]]:
    """Return the links from the ground outward, each with its inner and outer end."""
    has = [what for field, what in _NOT.items() if getattr(linkage, field)]
    has += dict.fromkeys(load.plural for load in linkage.loads)
    if linkage.as_written.dimension != 2:
        has.append("a third axis")
    if any(link.carried or link.offset != 0 or link.mass == 0 for link in linkage.links):
        has.append("links that are no plain rods with mass")
    ground = [p for p in linkage.points if p.ground]
    if any(p.motion != p.at for p in ground):
        has.append("ground that moves")
    used = [p.name for p in ground if any(p.name in link.base for link in linkage.links)]
    row: list[tuple[RigidLink, str, str]] = []
    left, end = list(linkage.links), used[0] if len(used) == 1 else ""
    while end:
        near = [link for link in left if end in link.base]
        if len(near) != 1:
            break
        (link,) = near
        left.remove(link)
        outer = next(p for p in link.base if p != end)
        row.append((link, end, outer))
        end = outer
    if any(event.ends_run for event in linkage.events):
        has.append("an event that ends the run")
    if left or not row:
        has.append("links that are not in a row from one ground point")
    if has:
        raise ModelError(
            "other programs are given open chains of rods in the plane, under gravity alone, and "
            f"{linkage.name} has {', '.join(has)}\n"
            "  Leave --peers out, or take a scene such as triple_pendulum."
        )
    return row
