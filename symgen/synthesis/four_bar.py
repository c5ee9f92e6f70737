"""A planar four-bar in one pose: its lengths, Grashof class, scene and compiled model."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.calls import checked
from symgen.errors import ModelError, SimulationError
from symgen.synthesis.triangle import angle

if TYPE_CHECKING:
    from symgen.runtime.model.kinematic import KinematicModel
    from symgen.runtime.result.result import Result
    from symgen.scene.schema import Scene

Array = NDArray[np.float64]

#: Difference of the sums of lengths that counts as none, relative to them: a change-point linkage.
_CHANGE_POINT = 1e-9
#: Angle beyond its limit [rad] at which a crank does not count as stopped: rounding.
_STOP = 1e-9
#: Class of a Grashof linkage by its shortest link.
_CLASSES = ("crank-rocker", "double-rocker", "rocker-crank", "double-crank")

_LINKS = {"crank": ["O", "A"], "coupler": ["A", "B"], "rocker": ["C", "B"]}
_MOTION: dict[str, Any] = {
    "drivers": [{"link": "crank", "angle": "start + speed*t"}],
    "analysis": {
        "kind": "kinematics",
        "t_end": "6.283185307179586 s",
        "outputs": ["P.position", "crank.angle", "coupler.angle", "rocker.angle", "A.B.C.angle"],
    },
}


@checked
@dataclass(frozen=True, slots=True)
class FourBar:
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

    O: Array
    A: Array
    B: Array
    C: Array
    P: Array
    error: float = 0.0

    def __post_init__(self) -> None:
        for name in "OABCP":
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=float))
        for name, length in self.lengths.items():
            if not length > 0:
                raise ModelError(f"expected a {name.replace('_', ' ')} longer than zero, got {length:g} m")

    def scaled(self, factor: float) -> FourBar:
        """Return the four-bar with all places, and its error, multiplied by a factor."""
        places = {name: factor * getattr(self, name) for name in "OABCP"}
        return replace(self, **places, error=factor * self.error)

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
        s, p, q, longest = np.sort(lengths)
        if abs(s + longest - p - q) <= _CHANGE_POINT * lengths.sum():
            return "change-point"
        return _CLASSES[int(np.argmin(lengths))] if s + longest < p + q else "triple-rocker"

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
    def scene(self) -> Scene:
        """The four-bar as a scene of kinematics, with its crank as the drive, and its lengths tunable."""
        from symgen.scene.schema import Scene

        return Scene(**_tables(self))

    def toml(self) -> str:
        """Return the scene as the text of a TOML file."""
        return _text(_tables(self))

    @property
    def model(self) -> KinematicModel:
        """The compiled linkage; all four-bars share its kernels."""
        return _model().with_parameters(**self.parameters)

    @property
    def swing(self) -> tuple[float, float]:
        """Directions of the crank [rad] at which it stops on this branch, infinite where it turns.

        Coupler and rocker are in line there: stretched or folded.
        """
        a, b, c, d = self.lengths.values()
        own, towards = self.parameters["start"], float(np.arctan2(*(self.C - self.O)[::-1]))
        from_link = math.remainder(own - towards, 2 * math.pi)
        stretched = angle(b + c, a, d) if d + a > b + c else math.inf
        low, high = -stretched, stretched
        if abs(d - a) < abs(b - c):
            folded = angle(abs(b - c), a, d)
            # A crank that passes the direction away from the link is on neither side of it.
            low, high = (folded, min(stretched, 2 * math.pi - folded))
            if from_link < 0 and math.isfinite(stretched):
                low, high = -high, -low
            elif from_link < 0:
                from_link += 2 * math.pi
        return own + low - from_link, own + high - from_link

    def angles(self, at: ArrayLike) -> Result:
        """Return the poses at directions of the crank [rad], followed from this pose on its branch.

        The crank turns either way: a direction below that of this pose is in the past of the drive.

        Raises
        ------
        SimulationError
            When the crank stops before it has passed all directions.
        """
        directions, start = np.asarray(at, dtype=float), self.parameters["start"]
        stops = np.array(self.swing)
        passed = [
            np.min(directions, initial=np.inf) < stops[0] - _STOP,
            np.max(directions, initial=-np.inf) > stops[1] + _STOP,
        ]
        if self.grashof != "change-point" and any(passed):
            stop = float(stops[passed][0])
            raise SimulationError(f"the crank stops at {np.degrees(stop) % 360.0:.6g} deg", time=stop - start)
        return self.model.kinematics(at=directions - start, over="time")

    def within_reach(self, directions: ArrayLike) -> Array:
        """Return directions of the crank [rad] moved by revolutions into the range in which it swings."""
        directions = np.atleast_1d(np.asarray(directions, dtype=float))
        if not directions.size:
            return directions
        low, high = self.swing
        if math.isinf(low):
            directions = np.unwrap(directions)
            return directions + 2 * np.pi * np.round((self.parameters["start"] - directions[0]) / (2 * np.pi))
        return directions - 2 * np.pi * np.round((directions - (low + high) / 2) / (2 * np.pi))


def _tables(linkage: FourBar) -> dict[str, Any]:
    lengths = linkage.lengths
    along, to_point = linkage.B - linkage.A, linkage.P - linkage.A
    reach = float(along @ to_point) / lengths["coupler"]
    across = float(along[0] * to_point[1] - along[1] * to_point[0]) / lengths["coupler"]
    values = {
        "start": (linkage.parameters["start"], "rad", "direction of the crank at the start"),
        **{f"{name}_length": (lengths[name], "m", f"length of the {name}") for name in _LINKS},
        "P_along": (reach / lengths["coupler"], "", "place of P along A B, over its length"),
        "P_across": (across, "m", "distance of P from A B, to the left"),
    }
    points: dict[str, Any] = {
        n: {"at": [f"{float(c)!r} m" for c in getattr(linkage, n)], **({"ground": True} if n in "OC" else {})}
        for n in "OABC"
    }
    points["P"] = {"on": "coupler", "fraction": "P_along", "offset": "P_across"}
    return {
        "symgen": 1,
        "title": f"Four-bar linkage, {linkage.grashof}",
        "parameters": {
            "speed": "1 rad/s",
            **{
                name: {"value": f"{value!r} {unit}".strip(), "tunable": True, "about": about}
                for name, (value, unit, about) in values.items()
            },
        },
        "points": points,
        "links": {name: {"points": ends, "length": f"{name}_length"} for name, ends in _LINKS.items()},
        **_MOTION,
    }


@cache
def _model() -> KinematicModel:
    """Return the linkage of all designs, which share its kernels: the places of its points are tunable."""
    from symgen.pipeline.build import build
    from symgen.scene.schema import Scene

    drawn = FourBar(*np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 2.0], [3.0, 0.0], [1.0, 2.0]]))
    tables = {
        "symgen": 1,
        "title": "Planar four-bar",
        "parameters": {
            "speed": "1 rad/s",
            **{
                name: {"value": f"{value!r} {'rad' if name == 'start' else 'm'}", "tunable": True}
                for name, value in drawn.parameters.items()
            },
        },
        "points": {n: {"at": [f"{n}x", f"{n}y"], "ground": n in "OC"} for n in "OABCP"},
        "links": {n: {"points": [*ends, "P"] if n == "coupler" else ends} for n, ends in _LINKS.items()},
    }
    return cast("KinematicModel", build(Scene(**tables, **_MOTION)))


def _text(tables: dict[str, Any]) -> str:
    """Return tables of a scene as TOML: keys of the document, then one line for each entry of a table."""
    lines = [
        f"{key} = {_value(value)}" for key, value in tables.items() if not isinstance(value, dict | list)
    ]
    for key, value in tables.items():
        if isinstance(value, list):
            lines += ["", *(line for entry in value for line in (f"[[{key}]]", *_entries(entry)))]
        elif isinstance(value, dict):
            lines += ["", f"[{key}]", *_entries(value)]
    return "\n".join(lines) + "\n"


def _entries(table: dict[str, Any]) -> list[str]:
    return [f"{key} = {_value(value)}" for key, value in table.items()]


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{ " + ", ".join(_entries(value)) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return (
        '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"' if isinstance(value, str) else repr(value)
    )
