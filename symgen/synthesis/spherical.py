"""A spherical four-bar in one pose: the arcs of its links, its loop of joints as a scene, and its model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.calls import checked
from symgen.synthesis.linkage import DesignedLinkage, angle, grashof_class, longer_than_zero, tunable, turn
from symgen.synthesis.search import ONE_LINK

if TYPE_CHECKING:
    from symgen.runtime.result.result import Result
    from symgen.runtime.rods.model.kinematic import KinematicModel

Array = NDArray[np.float64]

#: The angle [rad] between two arcs of a spherical triangle; nan if they do not close.
corner = partial(angle, on_sphere=True)
_LINKS = ("crank", "coupler", "rocker", "fixed_link")


@checked
@dataclass(frozen=True, slots=True)
class SphericalFourBar(DesignedLinkage):
    """A spherical four-bar in one of its poses: four joints whose axes meet in a point.

    Attributes
    ----------
    O, A, B, C
        Unit vectors of the joint axes: ground and crank, crank and coupler, coupler and rocker, rocker and
        ground.
    error
        Root of the mean square by which the conditions are missed [rad, or no unit].

    Raises
    ------
    ModelError
        When axes of a link coincide.
    """

    JOINTS: ClassVar[str] = "OABC"

    O: Array
    A: Array
    B: Array
    C: Array
    error: float = 0.0

    def __post_init__(self) -> None:
        for name in self.JOINTS:
            axis = np.asarray(getattr(self, name), dtype=float)
            object.__setattr__(self, name, axis / np.linalg.norm(axis))
        longer_than_zero(self.lengths, "rad")

    def rotated(self, rotation: ArrayLike) -> SphericalFourBar:
        """Return the linkage with all axes rotated by a matrix (3, 3)."""
        axes = np.asarray(rotation) @ np.column_stack([self.O, self.A, self.B, self.C])
        o, a, b, c = axes.T
        return SphericalFourBar(o, a, b, c, self.error)

    @property
    def lengths(self) -> dict[str, float]:
        """Arcs [rad] of crank, coupler, rocker and fixed link."""
        ends = (self.O, self.A), (self.A, self.B), (self.B, self.C), (self.C, self.O)
        arcs = (math.atan2(float(np.linalg.norm(np.cross(x, y))), float(x @ y)) for x, y in ends)
        return dict(zip(_LINKS, arcs, strict=True))

    @property
    def least_arcs(self) -> Array:
        """Arcs [rad] of crank, coupler, rocker and fixed link, of least sum among the same linkage's.

        An axis and its opposite are one: replaced by it, two neighbouring arcs become their supplements.
        """
        arcs = np.array([*self.lengths.values()])
        flips = np.array([[(f >> i & 1) ^ (f >> (i + 1) % 4 & 1) for i in range(4)] for f in range(8)])
        every = np.where(flips, math.pi - arcs, arcs)
        return np.asarray(every[int(np.argmin(every.sum(axis=1)))])

    @property
    def grashof(self) -> str:
        """Grashof class by the link that turns against its neighbours, triple-rocker or change-point.

        It is that of :attr:`least_arcs`.
        """
        return grashof_class(self.least_arcs)

    @property
    def turns(self) -> bool:
        """Whether the crank turns through whole revolutions."""
        return self.grashof in ("crank-rocker", "double-crank")

    @property
    def axes(self) -> Array:
        """Axes (3, 3) in columns: towards C, across, and O."""
        across = np.cross(self.O, self.C)
        across = across / np.linalg.norm(across)
        return np.column_stack([np.cross(across, self.O), across, self.O])

    @property
    def parameters(self) -> dict[str, float]:
        """Arcs, the crank's angle from the fixed link, and the start angles of the loop [rad]."""
        arcs = self.lengths
        crank, rocker = self.angle_of(self.A), self.rocker_angle_of(self.B)
        a1, a2, a3, a4 = arcs.values()
        x, y, _ = _row(crank + math.pi, a1).T @ self._in_loop(self.B)
        theta2 = math.atan2(x, -y)
        turned = _row(-rocker, a4) @ _row(crank + math.pi, a1) @ _row(theta2, a2)
        rest = (_row(0.0, a3) @ turned).T  # the rows close: their product is one
        theta3 = math.atan2(rest[1, 0], rest[0, 0])
        return {
            "start": crank,
            **arcs,
            "theta2_start": theta2,
            "theta3_start": theta3,
            "theta4_start": -rocker,
        }

    def _in_loop(self, axis: Array) -> Array:
        """Return an axis in the frame of the loop's first row, in which C has the direction of y."""
        towards, across, up = self.axes.T @ np.asarray(axis, dtype=float)
        return np.array([-across, towards, up])

    def angle_of(self, axis: ArrayLike) -> float:
        """Return the rotation of the crank about O [rad], from C, at which it has an axis."""
        towards, across, _ = self.axes.T @ np.asarray(axis, dtype=float)
        return math.atan2(across, towards)

    def rocker_angle_of(self, axis: ArrayLike) -> float:
        """Return the rotation of the rocker about C [rad], from OC continued, at which it has an axis."""
        _, across, _ = self.axes.T @ np.asarray(axis, dtype=float)
        on = np.cross(self.axes[:, 1], self.C)
        return math.atan2(across, float(on @ np.asarray(axis, dtype=float)))

    def _run(self, directions: Array) -> Result:
        return self.model.kinematics(at=directions + np.pi, over="input")

    @property
    def ranges(self) -> list[tuple[float, float]]:
        """Ranges of the crank's angle [rad] from C: between those with coupler and rocker in line."""
        a, b, c, d = self.lengths.values()
        stretched, folded = corner(b + c, a, d), corner(b - c, a, d)
        stops, starts = stretched < math.pi, folded > 0  # false for triangles that do not close
        if not starts:
            return [(-stretched, stretched)] if stops else []
        return [(folded, stretched), (-stretched, -folded)] if stops else [(folded, 2 * math.pi - folded)]

    @property
    def extremes(self) -> tuple[list[float], str, float]:
        """Directions of the crank at extremes; the rocker's are on a side of the fixed link, by branch."""
        if self.grashof != "crank-rocker":
            return [0.0, math.pi], "", 0.0
        a, b, c, d = self.lengths.values()
        sides = a + b, b - a  # of more than half a circle, or below zero: the triangle is on the other side
        extended, folded = (math.copysign(corner(c, side, d), math.sin(side)) for side in sides)
        inline = extended, math.pi + folded
        return [0.0, math.pi, *inline, *(-x for x in inline)], "swing", folded - extended

    def output(self, run: Result) -> Array:
        """Return angles of the rocker [rad]."""
        return np.asarray(-run["theta4"].values)

    def transmission(self, run: Result) -> Array:
        """Return angles between coupler and rocker [rad]."""
        return np.asarray(np.pi - np.abs(turn(run["theta3"].values)))

    def tables(self) -> dict[str, Any]:
        """Return the tables of :attr:`scene`: a loop of four joints."""
        values = self.parameters
        arcs = {n: (values[n], "rad", f"arc of the {n.replace('_', ' ')}") for n in _LINKS}
        return {
            "symgen": 1,
            "title": f"Spherical four-bar linkage, {self.grashof}",
            "parameters": tunable(arcs),
            "loop": {
                "inputs": {"theta1": "speed*t"},
                "rows": [
                    {
                        "joint": "R",
                        "link": "ground" if i == 3 else link,
                        "theta": "?" if i else "theta1",
                        "alpha": link,
                    }
                    for i, link in enumerate(_LINKS)
                ],
                "range": [f"{values['start'] + turn * math.pi!r} rad" for turn in (1, 3)],
                "start": {f"theta{i}": f"{values[f'theta{i}_start']!r} rad" for i in (2, 3, 4)},
            },
        }

    @property
    def model(self) -> KinematicModel:
        """The compiled linkage: its assembly mode is part of its scene."""
        from symgen.pipeline.build import build

        return cast("KinematicModel", build(self.scene))


def without_opposites(linkages: list[SphericalFourBar]) -> list[SphericalFourBar]:
    """Return linkages of which no two differ by opposite axes alone: those of least arcs."""
    kept: list[SphericalFourBar] = []
    for linkage in sorted(linkages, key=lambda x: sum(x.lengths.values())):
        if all(np.abs(linkage.least_arcs - other.least_arcs).max() > ONE_LINK for other in kept):
            kept.append(linkage)
    return kept


def _row(theta: float, alpha: float) -> Array:
    """Return the rotation (3, 3) of a row of the loop: theta about z, then alpha about x."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("ZX", [theta, alpha]).as_matrix())
