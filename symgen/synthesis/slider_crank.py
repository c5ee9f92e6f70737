"""A planar slider-crank in one pose: its lengths, scene and compiled model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.synthesis.linkage import (
    PlanarLinkage,
    fixed_place,
    of_places,
    place_on_coupler,
    shown,
    tunable,
)

if TYPE_CHECKING:
    from symgen.runtime.result.result import Result

Array = NDArray[np.float64]

#: Difference of lengths that counts as none, relative to them: a change-point linkage.
_CHANGE_POINT = 1e-9

_LINKS = {"crank": ["O", "A"], "coupler": ["A", "B"], "rail": ["E", "F"]}
_MOTION: dict[str, Any] = {
    "guides": [{"points": ["B"], "along": "rail"}],
    "drivers": [{"link": "crank", "angle": "start + speed*t"}],
    "analysis": {
        "kind": "kinematics",
        "t_end": "2*pi/abs(speed)",
        "outputs": ["P.position", "B.position", "crank.angle", "coupler.angle"],
    },
}


@checked
@dataclass(frozen=True, slots=True)
class SliderCrank(PlanarLinkage):
    """A planar slider-crank in one of its poses.

    Attributes
    ----------
    O, A, B, P
        Places [m] of the crank's ground point, its joint with the coupler, the slider and the coupler's P.
    guide
        Direction of the guide [rad]; the slider is on a line of this direction through B.
    error
        Root of the mean square by which the conditions are missed [m]; rounding where they are not fitted.

    Raises
    ------
    ModelError
        When joints of a link coincide.
    """

    JOINTS: ClassVar[str] = "OAB"
    CLASSES: ClassVar[tuple[str, ...]] = ("slider-crank", "turning coupler", "rocking crank", "change-point")

    O: Array
    A: Array
    B: Array
    P: Array
    guide: float
    error: float = 0.0

    @property
    def along(self) -> Array:
        """Unit vector of the guide."""
        return np.array([math.cos(self.guide), math.sin(self.guide)])

    @property
    def height(self) -> float:
        """Distance of the guide from O [m], positive to the left of its direction."""
        x, y = self.B - self.O
        return float(self.along[0] * y - self.along[1] * x)

    @property
    def lengths(self) -> dict[str, float]:
        """Lengths [m] of crank and coupler, and the offset of the guide."""
        crank, coupler = (float(np.hypot(*x)) for x in (self.A - self.O, self.B - self.A))
        return {"crank": crank, "coupler": coupler, "offset": abs(self.height)}

    @property
    def grashof(self) -> str:
        """Class by the links that turn: crank, coupler or none; or change-point."""
        r, l, e = self.lengths.values()
        if abs(abs(l - r) - e) <= _CHANGE_POINT * (r + l + e):
            return "change-point"
        if abs(l - r) < e:
            return "rocking crank"
        return "slider-crank" if r < l else "turning coupler"

    @property
    def turns(self) -> bool:
        """Whether the crank turns through whole revolutions."""
        return self.grashof == "slider-crank"

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the tunable parameters of :attr:`model`: places [m], and the crank's angle [rad]."""
        places = {n: getattr(self, n) for n in "OABP"} | {"E": self.B - self.along, "F": self.B + self.along}
        crank = self.A - self.O
        return {
            "start": float(np.arctan2(crank[1], crank[0])),
            **{f"{n}{axis}": float(v) for n, at in places.items() for axis, v in zip("xy", at, strict=True)},
        }

    @property
    def ranges(self) -> list[tuple[float, float]]:
        """Ranges of directions of the crank [rad]: between those with the coupler normal to the guide."""
        r, l, _ = self.lengths.values()
        low, high = (self.height - l) / r, (self.height + l) / r
        if low < -1 and high > 1:
            return []
        start, end = math.asin(max(low, -1.0)), math.asin(min(high, 1.0))
        if low < -1:  # the crank passes the direction away from the guide
            ranges = [(math.pi - end, 2 * math.pi + end)]
        elif high > 1:
            ranges = [(start, math.pi - start)]
        else:
            ranges = [(start, end), (math.pi - end, math.pi - start)]
        return [(self.guide + x, self.guide + y) for x, y in ranges]

    @property
    def extremes(self) -> tuple[list[float], str, float]:
        """Directions of the crank at extremes of the coupler's angle and of the slider."""
        r, l, _ = self.lengths.values()
        inline = [math.asin(self.height / (l + r)), math.pi + math.asin(self.height / (l - r))]
        more = inline[1] - math.pi - inline[0]
        if (self.B - self.A) @ self.along < 0:
            inline = [math.pi - x for x in inline]
        return [self.guide + x for x in (math.pi / 2, -math.pi / 2, *inline)], "stroke", more

    def output(self, run: Result) -> Array:
        """Return positions of the slider along its guide [m]."""
        return np.asarray((run["B.position"].values - self.O) @ self.along)

    def transmission(self, run: Result) -> Array:
        """Return angles between coupler and the normal of the guide [rad]."""
        side = -1.0 if self.height < 0 else 1.0
        return np.pi / 2 - side * np.arcsin(np.sin(run["coupler.angle"].values - self.guide))

    def tables(self) -> dict[str, Any]:
        """Return the tables of :attr:`scene`."""
        lengths = self.lengths
        values = {
            "start": (self.parameters["start"], "rad", "direction of the crank at the start"),
            **{f"{n}_length": (lengths[n], "m", f"length of the {n}") for n in ("crank", "coupler")},
            "guide": (self.guide, "rad", "direction of the guide"),
            "offset": (self.height, "m", "distance of the guide from O, to the left"),
            **place_on_coupler(self.A, self.B, self.P),
        }
        size = lengths["crank"] + lengths["coupler"]
        ground = {f"O{axis}": f"{shown(v, size)} m" for axis, v in zip("xy", self.O, strict=True)}
        foot = "Ox - offset*sin(guide)", "Oy + offset*cos(guide)"
        ends = {"E": list(foot), "F": [f"{foot[0]} + rail*cos(guide)", f"{foot[1]} + rail*sin(guide)"]}
        return {
            "symgen": 1,
            "title": f"Slider-crank linkage, {self.grashof}",
            "parameters": {**tunable(values, size), **ground, "rail": f"{size!r} m"},
            "points": {
                **{n: fixed_place(getattr(self, n), ground=n == "O", size=size) for n in "OAB"},
                **{n: {"at": at, "ground": True} for n, at in ends.items()},
                "P": {"on": "coupler", "fraction": "P_along", "offset": "P_across"},
            },
            "links": {
                n: {"points": ends, **({} if n == "rail" else {"length": f"{n}_length"})}
                for n, ends in _LINKS.items()
            },
            **_MOTION,
        }

    @staticmethod
    def template() -> dict[str, Any]:
        """Return the tables of a slider-crank whose places of points are tunable."""
        o, a, b, p = np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 0.5], [1.0, 1.5]])
        drawn = SliderCrank(o, a, b, p, guide=0.0)
        return of_places("Planar slider-crank", drawn, "OEF", _LINKS, _MOTION)
