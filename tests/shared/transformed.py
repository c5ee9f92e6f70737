"""The same mechanism written differently: turned, mirrored, moved, in other scales, orders and names.

Transformations map the tables of a scene (a dictionary with texts such as ``"0.3 m"``, or expressions of parameters) and its
results. Expressions have no literal numbers with a unit, so that scales change parameters only.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

Tables = dict
#: Exponents of metre, kilogram and second.
UNITS = {
    "1": (0, 0, 0),
    "rad": (0, 0, 0),
    "m": (1, 0, 0),
    "kg": (0, 1, 0),
    "s": (0, 0, 1),
    "m/s": (1, 0, -1),
    "m/s^2": (1, 0, -2),
    "rad/s": (0, 0, -1),
    "1/s": (0, 0, -1),
    "1/s^2": (0, 0, -2),
    "N": (1, 1, -2),
    "N/m": (0, 1, -2),
    "N*s/m": (0, 1, -1),
    "N*m": (2, 1, -2),
    "N*m*s": (2, 1, -1),
    "kg*m^2": (2, 1, 0),
    "J": (2, 1, -2),
    "kg/m^3": (-3, 1, 0),
    "Pa": (-1, 1, -2),
    "W": (2, 1, -3),
}
#: Of outputs, by their last word: unit, and how they follow a rotation; odd ones change sign with the side of a link.
WORDS = {
    "position": ("m", "place"),
    "velocity": ("m/s", "vector"),
    "acceleration": ("m/s^2", "vector"),
    "reaction": ("N", "vector"),
    "force": ("N", "vector"),
    "tension": ("N", "scalar"),
    "torque": ("N*m", "turning"),
    "angle": ("rad", "direction"),
    "angular_velocity": ("rad/s", "turning"),
    "kinetic_energy": ("J", "scalar"),
    "frequencies": ("1/s", "scalar"),
    "squares": ("1/s^2", "scalar"),
    "displacement": ("m", "vector"),
    "deflection": ("m", "odd"),
    "length_change": ("m", "scalar"),
    "bending_strain": ("1", "scalar"),
    "axial_strain": ("1", "scalar"),
    "stress": ("Pa", "scalar"),
    "greatest_stress": ("Pa", "scalar"),
    "couple": ("N*m", "turning"),
    "strain_energy": ("J", "scalar"),
    "potential_energy": ("J", "scalar"),
    "dissipated_power": ("W", "scalar"),
    "shaft_power": ("W", "scalar"),
    "omitted_power": ("W", "scalar"),
    "multipliers": ("1", "number"),
    "bending_strain_y": ("1", "scalar"),
    "bending_strain_z": ("1", "scalar"),
    "moment": ("N*m", "scalar"),
    "moment_y": ("N*m", "scalar"),
    "moment_z": ("N*m", "scalar"),
    "power": ("W", "scalar"),
    "input_power": ("W", "scalar"),
    "over_rate": ("N*m", "scalar"),
}


def in_unit(value: float, unit: str) -> str:
    return f"{float(value)!r} {unit}"


def texts(values, unit: str) -> list[str]:
    return [in_unit(x, unit) for x in np.asarray(values, dtype=float).tolist()]


def number_of(text: str) -> tuple[float, str] | None:
    """Return number and unit of a quantity, None for an expression."""
    found = re.fullmatch(r"([-+0-9.e]+) (\S+)", text)
    return (float(found[1]), found[2]) if found else None


@dataclass(frozen=True)
class Transformed:
    """A transformation x -> turn x + shift of places, with scales, the names of points and links, and turned directions.

    ``order`` are the points in the order of the scene before; ``directions`` are rotations of the directions of links whose points were exchanged, in the plane before ``turn``; ``flipped`` are owners of odd outputs on such links.
    """

    turn: np.ndarray
    shift: np.ndarray
    scales: tuple[float, float, float] = (1.0, 1.0, 1.0)
    names: Mapping[str, str] = field(default_factory=dict)
    order: tuple[str, ...] = ()
    directions: Mapping[str, float] = field(default_factory=dict)
    flipped: frozenset[str] = frozenset()

    @property
    def sign(self) -> float:
        return float(np.sign(np.linalg.det(self.turn)))

    @property
    def rotation(self) -> float:
        """Direction of the turned x axis."""
        return math.atan2(self.turn[1, 0], self.turn[0, 0])

    def scale(self, unit: str) -> float:
        return math.prod(s**e for s, e in zip(self.scales, UNITS[unit], strict=True))

    def name(self, output: str) -> str:
        return ".".join(self.names.get(part, part) for part in output.split("."))

    def output(self, name: str, values: np.ndarray) -> np.ndarray:
        """Return the values of an output, with components last, as the transformed scene has them."""
        unit, kind = WORDS[name.rpartition(".")[2]]
        values = np.asarray(values)
        if kind in ("place", "vector"):
            values = values @ self.turn.T + (self.shift if kind == "place" else 0.0)
        elif kind == "turning":
            values = self.sign * (values @ self.turn.T if len(self.turn) == 3 else values)
        elif kind == "odd":
            values = self.sign * values * (-1.0 if name.partition(".")[0] in self.flipped else 1.0)
        elif kind == "direction" and len(self.turn) == 2:
            link = name.partition(".")[0]
            values = self.sign * (values + self.directions.get(link, 0.0)) + self.rotation
        return values * self.scale(unit)


def placed(tables: Tables, turn: np.ndarray, shift: np.ndarray) -> tuple[Tables, Transformed]:
    """Return the scene with all places moved x -> turn x + shift, turn orthogonal."""
    made, by = copy.deepcopy(tables), Transformed(turn, shift)
    plane = len(turn) == 2

    def vector(components: list[str]) -> list[str]:
        read = [number_of(c) for c in components]
        if None not in read:
            return texts(turn @ [x for x, _ in read], read[0][1])
        return [
            " + ".join(f"({float(t)!r})*({c})" for t, c in zip(row, components, strict=True)) for row in turn
        ]

    def place(components: list[str]) -> list[str]:
        return texts(turn @ [number_of(c)[0] for c in components] + shift, "m")

    def turning(value):
        if plane:
            return affine(value, by.sign, 0.0)
        return texts(by.sign * turn @ [number_of(c)[0] for c in value], number_of(value[0])[1])

    for point in made["points"].values():
        if "at" in point:
            point["at"] = place(point["at"])
        if "motion" in point:
            point["motion"] = vector(point["motion"])
        if "offset" in point:
            point["offset"] = affine(point["offset"], by.sign, 0.0)
    for link in made["links"].values():
        if isinstance(link.get("centre"), list):
            link["centre"] = place(link["centre"])
        if isinstance(link.get("inertia"), list):
            xx, yy, zz, xy, xz, yz = (number_of(x)[0] for x in link["inertia"])
            full = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
            entries = [*np.diag(full), full[0, 1], full[0, 2], full[1, 2]]
            link["inertia"] = texts(entries, "kg*m^2")
        section = link.get("section", {})
        if "width_along" in section:
            section["width_along"] = (turn @ section["width_along"]).tolist()
    if "gravity" in made:
        made["gravity"]["acceleration"] = vector(made["gravity"]["acceleration"])
    for force in made.get("forces", ()):
        if "link" not in force:
            force["force"] = vector(force["force"])
        else:
            force["force"][1] = affine(force["force"][1], by.sign, 0.0)
    for torque in made.get("torques", ()):
        torque["torque"] = turning(torque["torque"])
    start = made.get("start", {})
    for name, velocity in start.get("velocities", {}).items():
        start["velocities"][name] = vector(velocity)
    for name, rate in start.get("rates", {}).items():
        start["rates"][name] = turning(rate)
    if plane:
        for table in _angles(made):
            table.put(affine(table.value, by.sign, by.rotation if table.absolute else 0.0))
    return made, by


@dataclass
class _Angle:
    """An angle of a scene: of a link, in the plane, absolute or against another link."""

    link: str
    against: str | None
    value: str
    put: Callable[[str], None]

    @property
    def absolute(self) -> bool:
        return self.against is None


def _angles(made: Tables):
    for key in ("drivers", "torsion_springs"):
        for entry in made.get(key, ()):
            text = entry.get("angle", "0.0 rad")
            yield _Angle(
                entry["link"], entry.get("against"), text, lambda x, entry=entry: entry.update(angle=x)
            )
    angles = made.get("start", {}).get("angles", {})
    for link, text in list(angles.items()):
        yield _Angle(link, None, text, lambda x, link=link: angles.update({link: x}))


def affine(text: str, factor: float, shift: float) -> str:
    read = number_of(text)
    if read:
        return in_unit(factor * read[0] + shift, read[1])
    return f"{factor!r}*({text}) + ({shift!r})" if shift else f"{factor!r}*({text})"


def turned(tables: Tables, rng: np.random.Generator) -> tuple[Tables, Transformed]:
    n = _dimension(tables)
    return placed(tables, orthogonal(rng, n, 1.0), np.zeros(n))


def mirrored(tables: Tables, rng: np.random.Generator) -> tuple[Tables, Transformed]:
    n = _dimension(tables)
    return placed(tables, orthogonal(rng, n, -1.0), np.zeros(n))


def moved(tables: Tables, rng: np.random.Generator) -> tuple[Tables, Transformed]:
    n = _dimension(tables)
    return placed(tables, np.eye(n), rng.uniform(-3, 3, n))


def orthogonal(rng: np.random.Generator, dimension: int, sign: float) -> np.ndarray:
    turn = np.diag([1.0] * (dimension - 1) + [sign])
    if dimension == 3:
        return Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix() @ turn
    angle = rng.uniform(-3, 3)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ turn


def scaled(tables: Tables, rng: np.random.Generator) -> tuple[Tables, Transformed]:
    """Return the scene in other scales of length, mass and time: powers of two, which round nothing."""
    n = _dimension(tables)
    scales = tuple(float(2.0 ** rng.integers(-9, 10)) for _ in range(3))
    by = Transformed(np.eye(n), np.zeros(n), scales)

    def scale(value):
        if isinstance(value, dict):
            return {k: scale(v) for k, v in value.items()}
        if isinstance(value, list):
            return [scale(v) for v in value]
        read = number_of(value) if isinstance(value, str) else None
        return in_unit(read[0] * by.scale(read[1]), read[1]) if read else value

    return scale(tables), by


def _drawn(tables: Tables, point: str) -> np.ndarray:
    """Return where a point is drawn, by its place or that on a link."""
    table = tables["points"][point]
    if "at" in table:
        return np.array([number_of(c)[0] for c in table["at"]])
    start, end = (_drawn(tables, p) for p in tables["links"][table["on"]]["points"][:2])
    return start + table["fraction"] * (end - start)


def reordered(tables: Tables, rng: np.random.Generator) -> tuple[Tables, Transformed]:
    """Return the scene with points, links, tables and the points of links in another order."""
    made, n = copy.deepcopy(tables), _dimension(tables)

    def shuffled(table):
        keys = list(table)
        rng.shuffle(keys)
        return {k: table[k] for k in keys}

    made["points"], made["links"] = shuffled(made["points"]), shuffled(made["links"])
    for key, value in made.items():
        if isinstance(value, list) and value and isinstance(value[0], dict) and key != "drivers":
            rng.shuffle(value)
    for spring in made.get("springs", ()):
        rng.shuffle(spring["between"])
    at = {p: _drawn(tables, p) for p in tables["points"]}
    carrying = {t["on"] for t in made["points"].values() if "on" in t}
    directions = {}
    for name, link in made["links"].items():
        before = list(link["points"])
        if len(before) == 2 or name in carrying:
            if rng.random() < 0.5 or name == made.get("crank", {}).get("link"):
                continue
            link["points"][:2] = before[1::-1]
            if not isinstance(link.get("centre", []), list):
                link["centre"] = 1 - link["centre"]
            for point in made["points"].values():
                if point.get("on") == name:
                    point["fraction"] = 1 - point["fraction"]
                    if "offset" in point:
                        point["offset"] = affine(point["offset"], -1.0, 0.0)
            for force in made.get("forces", ()):
                if force.get("link") == name:
                    force["force"] = [affine(c, -1.0, 0.0) for c in force["force"]]
            directions[name] = math.pi
        else:
            rng.shuffle(link["points"])
            if n == 2:
                was, now = (np.subtract(at[p[1]], at[p[0]]) for p in (before, link["points"]))
                directions[name] = math.atan2(*now[::-1]) - math.atan2(*was[::-1])
    if n == 2:
        for angle in _angles(made):
            change = directions.get(angle.link, 0.0) - directions.get(angle.against, 0.0)
            angle.put(affine(angle.value, 1.0, change))
    return shuffled(made), Transformed(np.eye(n), np.zeros(n), directions=directions)


def renamed(tables: Tables, rng: np.random.Generator) -> tuple[Tables, Transformed]:
    """Return the scene with other names of points, links and parameters, which sort otherwise."""
    old = [*tables["points"], *tables["links"], *tables.get("parameters", {})]
    fresh = [f"{chr(97 + int(rng.integers(26)))}{k}_{len(old) - k}" for k in range(len(old))]
    rng.shuffle(fresh)
    names = dict(zip(old, fresh, strict=True))
    pattern = re.compile(r"\b(" + "|".join(map(re.escape, old)) + r")\b")

    def rename(value):
        if isinstance(value, dict):
            return {names.get(k, k): rename(v) for k, v in value.items()}
        if isinstance(value, list):
            return [rename(v) for v in value]
        if not isinstance(value, str) or number_of(value):
            return value
        return pattern.sub(lambda m: names[m[1]], value)

    n = _dimension(tables)
    return rename(tables), Transformed(np.eye(n), np.zeros(n), names=names)


def _dimension(tables: Tables) -> int:
    return next(len(t["at"]) for t in tables["points"].values() if "at" in t)


TRANSFORMATIONS = {
    "turned": turned,
    "mirrored": mirrored,
    "moved": moved,
    "scaled": scaled,
    "reordered": reordered,
    "renamed": renamed,
}
