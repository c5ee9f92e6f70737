"""A planar four-bar in one pose: its lengths, Grashof class, scene and compiled model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.synthesis.linkage import (
    BY_SHORTEST,
    PlanarLinkage,
    angle,
    fixed_place,
    grashof_class,
    of_places,
    place_on_coupler,
    tunable,
)

if TYPE_CHECKING:
    from symgen.runtime.result.result import Result

Array = NDArray[np.float64]

_LINKS = {"crank": ["O", "A"], "coupler": ["A", "B"], "rocker": ["C", "B"]}
_MOTION: dict[str, Any] = {
    "drivers": [{"link": "crank", "angle": "start + speed*t"}],
    "analysis": {
        "kind": "kinematics",
        "t_end": "2*pi/abs(speed)",
        "outputs": ["P.position", "crank.angle", "coupler.angle", "rocker.angle", "A.B.C.angle"],
    },
}


@checked
@dataclass(frozen=True, slots=True)
class FourBar(PlanarLinkage):
    """A planar four-bar in one of its poses.

    Attributes
    ----------
    O, A, B, C, P
        Places [m] of the crank's ground point, its joint with the coupler, the joint of coupler and rocker,
        the rocker's ground point, and the coupler's point.
    error
        Root of the mean square by which the conditions are missed: distances from precision points [m],
        or Freudenstein's equation (no unit); rounding where they are not fitted.

    Raises
    ------
    ModelError
        When joints of a link coincide.
    """

    JOINTS: ClassVar[str] = "OABC"
    CLASSES: ClassVar[tuple[str, ...]] = (*BY_SHORTEST, "triple-rocker", "change-point")

    O: Array
    A: Array
    B: Array
    C: Array
    P: Array
    error: float = 0.0

    @property
    def lengths(self) -> dict[str, float]:
        """Lengths [m] of crank, coupler, rocker and fixed link."""
        links = {"crank": self.A - self.O, "coupler": self.B - self.A, "rocker": self.B - self.C}
        links["fixed_link"] = self.C - self.O
        return {name: float(np.hypot(*along)) for name, along in links.items()}

    @property
    def grashof(self) -> str:
        """Grashof class by the shortest link, triple-rocker if no link turns, or change-point."""
        lengths = np.array([*self.lengths.values()])
        return grashof_class(lengths, lengths.sum())

    @property
    def turns(self) -> bool:
        """Whether the crank turns through whole revolutions."""
        return self.grashof in ("crank-rocker", "double-crank")

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the tunable parameters of :attr:`model`: places [m] and the crank's angle [rad]."""
        crank = self.A - self.O
        places = {
            f"{name}{axis}": float(v)
            for name in "OABCP"
            for axis, v in zip("xy", getattr(self, name), strict=True)
        }
        return {"start": float(np.arctan2(crank[1], crank[0])), **places}

    @property
    def ranges(self) -> list[tuple[float, float]]:
        """Ranges of directions of the crank [rad]: between those with coupler and rocker in line."""
        a, b, c, d = self.lengths.values()
        towards = float(np.arctan2(*(self.C - self.O)[::-1]))
        stretched = angle(b + c, a, d) if d + a > b + c else math.inf
        if abs(d - a) < abs(b - c):
            folded = angle(abs(b - c), a, d)
            if math.isinf(stretched):
                return [(towards + folded, towards + 2 * math.pi - folded)]
            return [(towards + folded, towards + stretched), (towards - stretched, towards - folded)]
        return [] if math.isinf(stretched) else [(towards - stretched, towards + stretched)]

    @property
    def extremes(self) -> tuple[list[float], str, float]:
        """Directions of the crank at extremes; the rocker's are above or below the fixed link, by branch."""
        moves = "swing" if self.grashof == "crank-rocker" else ""
        a, b, c, d = self.lengths.values()
        towards = float(np.arctan2(*(self.C - self.O)[::-1]))
        inline = [angle(c, d, b + a), math.pi + angle(c, d, b - a)] if moves else []
        more = inline[1] - math.pi - inline[0] if moves else 0.0
        return [towards + x for x in (0.0, math.pi, *inline, *(-x for x in inline))], moves, more

    def output(self, run: Result) -> Array:
        """Return angles of the rocker [rad]."""
        return np.asarray(run["rocker.angle"].values)

    def transmission(self, run: Result) -> Array:
        """Return angles between coupler and rocker [rad]."""
        return np.asarray(np.abs(run["A.B.C.angle"].values))

    def tables(self) -> dict[str, Any]:
        """Return the tables of :attr:`scene`."""
        lengths = self.lengths
        size = max(lengths.values())
        values = {
            "start": (self.parameters["start"], "rad", "direction of the crank at the start"),
            **{f"{name}_length": (lengths[name], "m", f"length of the {name}") for name in _LINKS},
            **place_on_coupler(self.A, self.B, self.P),
        }
        points = {n: fixed_place(getattr(self, n), ground=n in "OC", size=size) for n in "OABC"}
        return {
            "symgen": 1,
            "title": f"Four-bar linkage, {self.grashof}",
            "parameters": tunable(values, size),
            "points": {**points, "P": {"on": "coupler", "fraction": "P_along", "offset": "P_across"}},
            "links": {name: {"points": ends, "length": f"{name}_length"} for name, ends in _LINKS.items()},
            **_MOTION,
        }

    @staticmethod
    def template() -> dict[str, Any]:
        """Return the tables of a four-bar whose places of points are tunable."""
        drawn = FourBar(*np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 2.0], [3.0, 0.0], [1.0, 2.0]]))
        return of_places("Planar four-bar", drawn, "OC", _LINKS, _MOTION)
