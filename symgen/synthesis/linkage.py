"""What all synthesised linkages have: a scene with the crank as its drive, a compiled model, runs."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from symgen.calls import checked
from symgen.errors import ModelError, SimulationError
from symgen.mechanics.synthesis.limits import cosine_opposite

if TYPE_CHECKING:
    from collections.abc import Callable

    from symgen.runtime.result.result import Result
    from symgen.runtime.rods.model.kinematic import KinematicModel
    from symgen.scene.schema import Scene
    from symgen.scene.units import Shown

Array = NDArray[np.float64]

#: Angle beyond its limit [rad] at which a crank does not count as stopped: rounding.
_STOP = 1e-9
#: Difference of the sums of lengths that counts as none, relative to them, or of arcs [rad]: a change-point.
_CHANGE_POINT = 1e-9
#: Class of a Grashof linkage by its shortest link.
BY_SHORTEST = ("crank-rocker", "double-rocker", "rocker-crank", "double-crank")
#: Coordinate that is rounding, over the size of the linkage.
_ROUNDING = 1e-14


class DesignedLinkage(ABC):
    """A linkage with a crank, in one of its poses; ``error`` is that of its conditions."""

    __slots__ = ()

    #: Names of its joints.
    JOINTS: ClassVar[str]
    error: float

    @property
    def places(self) -> Array:
        """Coordinates that distinguish the linkage from others."""
        return np.concatenate([getattr(self, name) for name in self.JOINTS])

    @property
    @abstractmethod
    def lengths(self) -> dict[str, float]:
        """Lengths [m], or arcs [rad] on a sphere."""

    @property
    @abstractmethod
    def grashof(self) -> str:
        """Class by the links that turn."""

    @property
    @abstractmethod
    def turns(self) -> bool:
        """Whether the crank turns through whole revolutions."""

    @property
    @abstractmethod
    def parameters(self) -> dict[str, float]:
        """Values of the tunable parameters of :attr:`model`, with ``start``, the crank's angle [rad]."""

    @property
    @abstractmethod
    def ranges(self) -> list[tuple[float, float]]:
        """Ranges of directions of the crank [rad], in which the linkage closes; none where it turns."""

    @property
    @abstractmethod
    def extremes(self) -> tuple[list[float], str, float]:
        """Directions of the crank [rad] at which extremes are, and the name of the output's range.

        The last value is the rotation of the crank [rad] from one limit position to the other, over half a
        revolution. Extremes of the transmission angle are on the fixed link, or normal to the guide; in those
        of the output coupler and crank are in line.
        """

    @abstractmethod
    def output(self, run: Result) -> Array:
        """Return angles of the rocker [rad], or positions of the slider along its guide [m]."""

    @abstractmethod
    def transmission(self, run: Result) -> Array:
        """Return angles between coupler and rocker, or coupler and normal of the guide [rad]."""

    @abstractmethod
    def tables(self) -> dict[str, Any]:
        """Return the tables of :attr:`scene`."""

    @property
    def scene(self) -> Scene:
        """The linkage as a scene of kinematics, with its crank as the drive, and its lengths tunable."""
        from symgen.scene.schema import Scene

        return Scene(**self.tables())

    def toml(self, title: str = "", units: Shown | None = None) -> str:
        """Return the scene as the text of a TOML file, under the title and with the units of a task."""
        tables = self.tables()
        if units:
            tables["units"] = {of: name for of, (name, _) in units.items()}
        if title:
            default_title = tables["title"]
            tables["title"] = f"{title}: {default_title[0].lower()}{default_title[1:]}"
        return _text(tables)

    @property
    @abstractmethod
    def model(self) -> KinematicModel:
        """The compiled linkage."""

    @property
    def swing(self) -> tuple[float, float]:
        """Directions of the crank [rad] at which it stops on this branch, infinite where it turns.

        Coupler and rocker are in line there: stretched or folded.
        """
        start, angles = self.parameters["start"], []
        for low, high in self.ranges:
            shift = 2 * math.pi * round((start - (low + high) / 2) / (2 * math.pi))
            angles.append((max(low + shift - start, start - high - shift, 0.0), low + shift, high + shift))
        _, low, high = min(angles, default=(0.0, -math.inf, math.inf))
        return low, high

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
        return self._run(directions)

    def _run(self, directions: Array) -> Result:
        return self.model.kinematics(at=directions - self.parameters["start"], over="time")

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


@checked
class PlanarLinkage(DesignedLinkage):
    """A linkage whose model has the places of its points as tunable parameters: of its joints, and of P."""

    __slots__ = ()

    def __post_init__(self) -> None:
        for name in (*self.JOINTS, "P"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=float))
        longer_than_zero({n: length for n, length in self.lengths.items() if n != "offset"})

    def scaled(self, factor: float) -> Self:
        """Return the linkage with all places, and its error, multiplied by a factor."""
        places = {name: factor * getattr(self, name) for name in (*self.JOINTS, "P")}
        return replace(cast("Any", self), **places, error=factor * self.error)

    @staticmethod
    @abstractmethod
    def template() -> dict[str, Any]:
        """Return the tables of a scene whose kernels all linkages of the kind share."""

    @property
    def model(self) -> KinematicModel:
        """The compiled linkage; all of its kind share its kernels."""
        return _model(type(self)).with_parameters(**self.parameters)


def of_places(
    title: str, drawn: PlanarLinkage, ground: str, links: dict[str, list[str]], motion: dict[str, Any]
) -> dict[str, Any]:
    """Return the tables of a linkage whose places of points are tunable, with those of a drawn one."""
    values = drawn.parameters
    points = [name[:-1] for name in values if name.endswith("x")]
    return {
        "symgen": 1,
        "title": title,
        "parameters": tunable({n: (x, "rad" if n == "start" else "m", n) for n, x in values.items()}),
        "points": {n: {"at": [f"{n}x", f"{n}y"], "ground": n in ground} for n in points},
        "links": {n: {"points": [*ends, "P"] if n == "coupler" else ends} for n, ends in links.items()},
        **motion,
    }


@cache
def _model(kind: type[PlanarLinkage]) -> KinematicModel:
    from symgen.pipeline.build import build
    from symgen.scene.schema import Scene

    return cast("KinematicModel", build(Scene(**kind.template())))


@cache
def _cosine(on_sphere: bool) -> Callable[[float, float, float], float]:
    far, one, other = sp.symbols("far one other", positive=True)
    return sp.lambdify((far, one, other), cosine_opposite(far, one, other, on_sphere), "math")


def angle(far: float, one: float, other: float, on_sphere: bool = False) -> float:
    """Return the angle [rad] between two sides of a triangle; nan if the sides do not close."""
    cosine = _cosine(on_sphere)(far, one, other)
    return math.acos(cosine) if abs(cosine) <= 1 else math.nan


def grashof_class(lengths: Array, size: float = 1.0) -> str:
    """Return the class of four lengths or arcs by the shortest, triple-rocker, or change-point.

    ``size`` is what differences of their sums are compared with.
    """
    s, p, q, longest = np.sort(lengths)
    if abs(s + longest - p - q) <= _CHANGE_POINT * size:
        return "change-point"
    return BY_SHORTEST[int(np.argmin(lengths))] if s + longest < p + q else "triple-rocker"


def turn(x: Array) -> Array:
    """Return angles less whole revolutions."""
    return np.asarray(x - 2 * np.pi * np.round(x / (2 * np.pi)))


def longer_than_zero(lengths: dict[str, float], unit: str = "m") -> None:
    """Raise ModelError where a length is zero."""
    for name, length in lengths.items():
        if not length > 0:
            raise ModelError(f"expected a {name.replace('_', ' ')} longer than zero, got {length:g} {unit}")


def shown(value: float, size: float = 1.0) -> str:
    """Return a value as text; zero if it is below the rounding of values of a size."""
    return repr(0.0 if abs(value) <= _ROUNDING * size else float(value))


def tunable(values: dict[str, tuple[float, str, str]], size: float = 1.0) -> dict[str, Any]:
    """Return the table of parameters: name to value, unit and meaning; and the speed of the drive.

    Lengths that are the rounding of a size [m] are zero.
    """
    return {
        "speed": "1 rad/s",
        **{
            name: {
                "value": f"{shown(value, size if unit == 'm' else 1.0)} {unit}".strip(),
                "tunable": True,
                "about": about,
            }
            for name, (value, unit, about) in values.items()
        },
    }


def fixed_place(place: Array, ground: bool, size: float) -> dict[str, Any]:
    """Return a point of a scene, whose linkage has a size [m]."""
    return {"at": [f"{shown(x, size)} m" for x in place], **({"ground": True} if ground else {})}


def place_on_coupler(a: Array, b: Array, p: Array) -> dict[str, tuple[float, str, str]]:
    """Return the parameters of the coupler's point."""
    along, to_point = b - a, p - a
    length = float(np.hypot(*along))
    across = float(along[0] * to_point[1] - along[1] * to_point[0]) / length
    return {
        "P_along": (float(along @ to_point) / length**2, "", "place of P along A B, over its length"),
        "P_across": (across, "m", "distance of P from A B, to the left"),
    }


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
