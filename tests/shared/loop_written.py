"""Random single loops with masses and loads, and the same loops written differently.

A loop has no drawing: it is turned and mirrored by reflections of the axes of all frames, and traversed in the other
sense, which also gives every link another frame.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation
from shared.drawn_loops import ENTRIES, VARIES, levenberg
from shared.drawn_loops import Loop as Rows
from shared.transformed import UNITS

#: Letters of variables of a joint, as entries of its row.
NAMES = {"t": "theta", "s": "S", "e": "eta", "a": "alpha"}
TURNS = ("theta", "eta", "alpha")
#: Half of the range of the input: over this the loop is near the pose in which it was drawn.
REACH = 0.02
#: Least singular value of the closure's derivative by the dependent variables, over the largest.
WELL = 0.03
TWIST = Rotation.from_euler("x", 90, degrees=True).as_matrix()
HALF = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Link:
    """Mass properties in the frame of the link, and a load on it."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    at: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    in_ground: bool


@dataclass(frozen=True)
class Loop:
    """Joints and constant entries of rows, values of variables where it closes, and what acts on it.

    ``pose`` are values by (row, entry), ``lead`` is the driven or free one. A row is a dictionary of entries.
    """

    joints: tuple[str, ...]
    rows: tuple[Mapping[str, float], ...]
    pose: Mapping[tuple[int, str], float]
    lead: tuple[int, str]
    rate: float
    links: Mapping[str, Link]
    names: tuple[str, ...]
    gravity: np.ndarray
    drive: tuple[float, float]
    free: bool = False
    scales: tuple[float, float, float] = (1.0, 1.0, 1.0)
    orders: int = 0
    parameters: Mapping[str, str] = field(default_factory=lambda: {"first": "first", "pace": "pace"})

    def variable(self, place: tuple[int, str]) -> str:
        return f"{place[1]}{place[0] + 1}"

    @property
    def variables(self) -> list[str]:
        return [self.variable(p) for p in self.pose]

    def tables(self) -> dict:
        """Return the tables of the scene."""

        def text(value: float, unit: str) -> str:
            scale = math.prod(s**e for s, e in zip(self.scales, UNITS[unit], strict=True))
            return f"{float(value) * scale!r} {unit}"

        def vector(values, unit: str) -> list[str]:
            return [text(x, unit) for x in values]

        def entry(name: str, value: float) -> str:
            return text(value, "rad" if name in TURNS else "m")

        rows = []
        for r, joint in enumerate(self.joints):
            row = {"joint": joint, "link": self.names[r]}
            for name, value in self.rows[r].items():
                row[name] = entry(name if name != "pitch" else "S", value)
            for place in self.pose:
                if place[0] == r:
                    row[place[1]] = self.variable(place) if place == self.lead else "?"
            rows.append(row)
        lead, turns = self.variable(self.lead), self.lead[1] in TURNS
        first, pace = self.parameters["first"], self.parameters["pace"]
        begin = self.pose[self.lead]
        parameters = {
            first: entry(self.lead[1], begin),
            pace: {"value": text(self.rate, "rad/s" if turns else "m/s"), "tunable": True},
        }
        loop: dict = {"rows": rows}
        loop["start"] = {
            self.variable(p): entry(p[1], round(x, 3)) for p, x in self.pose.items() if p != self.lead
        }
        if self.free:
            loop["free"] = {lead: {"at": first, "rate": text(self.rate, "rad/s" if turns else "m/s")}}
            constant, stiffness = self.drive
            units = ("N*m", "N*m") if turns else ("N", "N/m")
            parameters["push"] = text(constant, units[0])
            parameters["k"] = text(stiffness, units[1])
            loop["drives"] = {lead: f"push - k*({lead} - {first})"}
            del parameters[pace]
        else:
            loop["inputs"] = {lead: f"{first} + {pace}*t"}
            loop["range"] = [entry(self.lead[1], x) for x in (begin - REACH, begin + REACH)]
        loop["links"], loop["loads"] = {}, []
        for name, link in self.links.items():
            i = link.inertia
            loop["links"][name] = {
                "mass": text(link.mass, "kg"),
                "centre": vector(link.centre, "m"),
                "inertia": vector([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]], "kg*m^2"),
            }
            load = {"link": name, "at": vector(link.at, "m"), "force": vector(link.force, "N")}
            if np.any(link.torque):
                load["torque"] = vector(link.torque, "N*m")
            loop["loads"].append(load | {"frame": "ground" if link.in_ground else "link"})
        outputs = [f"{v}{word}" for v in self.variables for word in ("", ".rate", ".acceleration")]
        outputs += [f"{lead}.drive"] * (not self.free) + ["kinetic_energy"]
        for k, (before, after) in enumerate(zip(("ground", *self.names), self.names, strict=False)):
            for link in {before, after}:
                outputs.append(f"{link}.joint{k + 1}.force_in_ground")
        for name in self.names[:-1]:
            outputs += [f"{name}.{w}" for w in ("centre", "angular_velocity", "angular_acceleration")]
        made = {
            "parameters": parameters,
            "gravity": {"acceleration": vector(self.gravity, "m/s^2")},
            "loop": loop,
            "analysis": {"outputs": outputs},
        }
        if self.orders:
            rng = np.random.default_rng(self.orders)
            made = _shuffled(made, rng)
        return made


def _shuffled(tables, rng):
    if isinstance(tables, dict):
        keys = list(tables)
        rng.shuffle(keys)
        return {k: tables[k] if k == "rows" else _shuffled(tables[k], rng) for k in keys}
    if isinstance(tables, list) and tables and isinstance(tables[0], dict):
        return [tables[i] for i in rng.permutation(len(tables))]
    return tables


def drawn(rng: np.random.Generator, free: bool = False) -> Loop:
    """Return a loop of any joints with one degree of freedom, closed at a random pose, that no geometry makes special."""
    while True:
        joints = ["RRRPCHSU"[int(i)] for i in rng.integers(8, size=int(rng.integers(4, 8)))]
        between = [a == b == "S" for a, b in itertools.pairwise(joints)]
        places = [(r, NAMES[v]) for r, joint in enumerate(joints) for v in VARIES[joint]]
        if len(places) - sum(between) != 7 or sum(between) > 1 or joints[-1] == joints[0] == "S":
            continue
        places = [p for p in places if not (p[1] == "alpha" and between[p[0] :][:1] == [True])]
        leads = [p for p in places if joints[p[0]] in "RPC"]
        if leads and joints.count("P") < 3:
            break
    table = np.zeros((len(joints), 5))
    column = {name: k for k, name in enumerate(ENTRIES)}
    for r, joint in enumerate(joints):
        if joint not in "SU":
            table[r, 1] = rng.uniform(-0.3, 0.3)
        table[r, 3:] = rng.uniform(-1.5, 1.5), rng.uniform(0.1, 0.5)
        if joint == "P":
            table[r, 0] = rng.uniform(-1.5, 1.5)
    for r, name in places:
        table[r, column[name]] = 0.0
    pitch = np.array([rng.uniform(0.01, 0.1) if j == "H" else 0.0 for j in joints])
    lead = leads[int(rng.integers(len(leads)))]
    target = {p: float(rng.uniform(-1, 1)) * (0.3 if p[1] == "S" else 2.0) for p in places}
    closed = _closed(rng, joints, table, pitch, target, lead)
    if closed is None:
        return drawn(rng, free)
    rows = []
    for r, joint in enumerate(joints):
        row = {n: float(x) for n, x in zip(ENTRIES, closed[r], strict=True) if x}
        rows.append(row | ({"pitch": float(pitch[r])} if joint == "H" else {}))
    names = (*(f"link{r + 1}" for r in range(len(joints) - 1)), "ground")
    links = {}
    for r, name in enumerate(names[:-1]):
        root = rng.uniform(-0.1, 0.1, (3, 3))
        spread = root @ root.T + 1e-3 * np.eye(3)
        inertia, centre = np.trace(spread) * np.eye(3) - spread, rng.uniform(-0.2, 0.2, 3)
        at, force, torque = rng.uniform(-0.2, 0.2, 3), rng.uniform(-5, 5, 3), rng.uniform(-1, 1, 3)
        in_ground = bool(rng.random() < 0.5)
        if between[r : r + 1] == [True]:  # a link between two balls is round
            length = closed[r, 4]
            centre, at = (np.array([-x * length, 0, 0]) for x in rng.uniform(0.2, 0.8, 2))
            inertia, torque, in_ground = np.diag([1e-4, 0.01, 0.01]), np.zeros(3), True
        links[name] = Link(float(rng.uniform(0.2, 2)), centre, inertia, at, force, torque, in_ground)
    rate = float(rng.choice([-1, 1]) * rng.uniform(0.3, 1))
    drive = float(rng.uniform(-3, 3)), float(rng.uniform(1, 10))
    gravity = rng.uniform(-10, 10, 3)
    return Loop(tuple(joints), tuple(rows), target, lead, rate, links, names, gravity, drive, free)


def _closed(rng, joints, table, pitch, target, lead):
    """Return the table with constants of the last rows such that the loop closes at a pose, far from dead centres, or None."""
    count = len(joints)
    pose = [(r, ENTRIES.index(name)) for r, name in target]
    free = [
        (r, c)
        for r in (count - 3, count - 2, count - 1)
        for c in (1, 3, 4)
        if (r, c) not in pose and not (c == 1 and joints[r] in "SU")
    ]
    given = Rows(list(joints), table.copy(), pitch, free)
    variables = Rows(list(joints), table.copy(), pitch, pose)
    for place, x in zip(pose, target.values(), strict=True):
        given.table[place] = x

    found = levenberg(given.closure, rng.uniform(-1, 1, (40, len(free))) * np.where(given.lengths, 0.5, 3.0))
    best = min(found, key=lambda x: np.max(np.abs(given.closure(x[None])[0] - np.eye(4))))
    if np.max(np.abs(given.closure(best[None])[0] - np.eye(4))) > 1e-13:
        return None
    made = table.copy()
    for place, x in zip(free, best, strict=True):
        made[place] += x
        variables.table[place] += x
    others = [k for k, place in enumerate(target) if place != lead]
    columns = variables.dependent_jacobian(np.array(list(target.values())))[:, others]
    sizes = np.linalg.svd(columns, compute_uv=False)
    return made if sizes[-1] > WELL * sizes[0] else None


# -- written differently ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Change:
    """How results follow: frame {1} has turn and shift, variables other names and signs (old: new, sign)."""

    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    variables: Mapping[str, tuple[str, float]] | None = None
    joints: Mapping[int, int] | None = None
    names: Mapping[str, str] = field(default_factory=dict)
    scales: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def expected(self, name: str, values: np.ndarray) -> tuple[str, np.ndarray, str] | None:
        """Return name, values and kind of an output of the loop written differently; None if it has none."""
        first, *rest = name.split(".")
        sign = float(np.sign(np.linalg.det(self.turn)))
        scale = {}
        for unit, exponents in UNITS.items():
            scale[unit] = math.prod(s**e for s, e in zip(self.scales, exponents, strict=True))
        if first == "kinetic_energy":
            return name, values * scale["J"], "energy"
        if first.rstrip("0123456789") in ENTRIES:
            there = (
                (self.variables or {}).get(first, (first, 1.0))
                if self.variables is not None
                else (first, 1.0)
            )
            if there is None:
                return None
            word = rest[0] if rest else ""
            unit = {"": "", "rate": "/s", "acceleration": "/s^2"}.get(word)
            turns = not first.startswith("S")
            if word == "drive":
                size, kind = scale["N*m" if turns else "N"], "torque" if turns else "force"
            else:
                size = scale[("rad" if turns else "m") if not unit else ("rad/s" if turns else "m/s")]
                size = size / (self.scales[2] if word == "acceleration" else 1.0)
                kind = f"{'turn' if turns else 'way'}{unit}"
            return ".".join([there[0], *rest]), there[1] * values * size, kind
        link, word = self.names.get(first, first), rest[-1]
        if rest[0].startswith("joint"):
            k = int(rest[0][5:])
            k = self.joints[k] if self.joints else k
            return f"{link}.joint{k}.{word}", values @ self.turn.T * scale["N"], "force"
        if word == "centre":
            return f"{link}.{word}", (values @ self.turn.T + self.shift) * scale["m"], "place"
        unit = scale["rad/s"] / (self.scales[2] if word == "angular_acceleration" else 1.0)
        return f"{link}.{word}", sign * values @ self.turn.T * unit, word


def reflected(loop: Loop, signs) -> tuple[Loop, Change]:
    """Return the loop with the axes of all frames reflected: an even number of minus signs turns it."""
    x, y, z = signs
    m = np.diag(np.asarray(signs, dtype=float))
    of = {"theta": x * y, "S": z, "eta": x * z, "alpha": y * z, "a": x, "pitch": x * y * z}
    det = x * y * z
    rows = tuple({k: of[k] * v for k, v in row.items()} for row in loop.rows)
    links = {
        name: Link(
            k.mass, m @ k.centre, m @ k.inertia @ m, m @ k.at, m @ k.force, det * m @ k.torque, k.in_ground
        )
        for name, k in loop.links.items()
    }
    lead = of[loop.lead[1]]
    made = replace(
        loop,
        rows=rows,
        links=links,
        pose={p: of[p[1]] * v for p, v in loop.pose.items()},
        rate=lead * loop.rate,
        gravity=m @ loop.gravity,
        drive=(lead * loop.drive[0], loop.drive[1]),
    )
    variables = {loop.variable(p): (loop.variable(p), of[p[1]]) for p in loop.pose}
    return made, Change(turn=m, variables=variables)


def turned(loop: Loop, rng: np.random.Generator) -> tuple[Loop, Change]:
    return reflected(loop, [(1, -1, -1), (-1, 1, -1), (-1, -1, 1)][int(rng.integers(3))])


def mirrored(loop: Loop, rng: np.random.Generator) -> tuple[Loop, Change]:
    return reflected(loop, [(1, 1, -1), (1, -1, 1), (-1, 1, 1), (-1, -1, -1)][int(rng.integers(4))])


def scaled(loop: Loop, rng: np.random.Generator) -> tuple[Loop, Change]:
    scales = tuple(float(2.0 ** rng.integers(-9, 10)) for _ in range(3))
    return replace(loop, scales=scales), Change(scales=scales)


def reordered(loop: Loop, rng: np.random.Generator) -> tuple[Loop, Change]:
    return replace(loop, orders=int(rng.integers(1, 1 << 30))), Change()


def renamed(loop: Loop, rng: np.random.Generator) -> tuple[Loop, Change]:
    letters = [f"{chr(97 + int(rng.integers(26)))}{k}" for k in range(len(loop.names) + 1)]
    rng.shuffle(letters)
    names = {**dict(zip(loop.names[:-1], letters, strict=False)), "ground": "ground"}
    links = {names[k]: v for k, v in loop.links.items()}
    parameters = {"first": letters[-1], "pace": letters[-2]}
    made = replace(loop, names=tuple(names[k] for k in loop.names), links=links, parameters=parameters)
    return made, Change(names=names)


def backward(loop: Loop, rng: np.random.Generator | None = None) -> tuple[Loop, Change]:
    """Return the loop traversed in the other sense: each row has the inverse joint and the link before it.

    With frames turned by half a revolution about i, hinges, slides and screws keep their variables. A Hooke joint
    exchanges its angles, and a ball gets others. Frames lie at the other end of each link.
    """
    count = len(loop.joints)
    angles = {r: dict.fromkeys(ENTRIES, 0.0) | dict(loop.rows[r]) for r in range(count)}
    for (r, name), x in loop.pose.items():
        angles[r][name] = x
    # Constant turn and translation along i of each link, apart from the turn of a ball.
    twist = [0.0 if j == "S" else angles[r]["alpha"] for r, j in enumerate(loop.joints)]
    lengths = [angles[r]["a"] for r in range(count)]
    extra = [90.0 if j == "U" else 0.0 for j in loop.joints]
    rows, pose, variables, spun = [], {}, {}, 0.0
    for new, k in enumerate(reversed(range(count))):
        joint, before = loop.joints[k], k - 1
        alpha = math.radians(extra[k] - extra[before]) - twist[before]
        row = {"a": -lengths[before]}
        own = {n: angles[k][n] for n in ENTRIES}
        if joint in "RPCH":
            kept = [n for n in ("theta", "S") if (k, n) in loop.pose]
            for n in ("theta", "S"):
                if n in kept:
                    pose[new, n] = own[n]
                    variables[f"{n}{k + 1}"] = (f"{n}{new + 1}", 1.0)
                elif own[n]:
                    row[n] = own[n]
            if joint == "H":
                row["pitch"] = loop.rows[k]["pitch"]
        elif joint == "U":
            pose[new, "theta"], pose[new, "eta"] = own["eta"], -own["theta"]
            variables[f"theta{k + 1}"] = (f"eta{new + 1}", -1.0)
            variables[f"eta{k + 1}"] = (f"theta{new + 1}", 1.0)
        else:
            ball = Rotation.from_euler("ZYX", [own["theta"], own["eta"], own["alpha"]]).as_matrix()
            turned = Rotation.from_euler("x", spun).as_matrix() @ HALF @ ball.T @ HALF
            spun = 0.0
            theta, eta, about = Rotation.from_matrix(turned).as_euler("ZYX")
            pose[new, "theta"], pose[new, "eta"] = theta, eta
            for n in ("theta", "eta", "alpha"):
                variables[f"{n}{k + 1}"] = None
            if before >= 0 and loop.joints[before] == "S":  # the spin is in the other ball
                spun = about
            else:
                pose[new, "alpha"] = about
        if alpha:
            if joint == "S" and (new, "alpha") in pose:
                # A ball has the turn of its link as well, which varies with it.
                pose[new, "alpha"] += alpha
            else:
                row["alpha"] = alpha
        rows.append(row)
    frames = {name: _moved(loop.joints[r], twist[r], lengths[r]) for r, name in enumerate(loop.names)}
    ground, shift = frames["ground"]
    made = replace(
        loop,
        joints=loop.joints[::-1],
        rows=tuple(rows),
        pose=pose,
        lead=(count - 1 - loop.lead[0], loop.lead[1]),
        links={name: _in_frame(link, *frames[name], ground) for name, link in loop.links.items()},
        names=(*loop.names[-2::-1], "ground"),
        gravity=ground @ loop.gravity,
    )
    by = {k: count + 1 - k for k in range(1, count + 1)}
    return made, Change(turn=ground, shift=shift, variables=variables, joints=by)


def _moved(joint: str, twist: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return turn and shift of places in the frame at the far end of a link to that at its near end."""
    turn = (TWIST if joint == "U" else np.eye(3)) @ HALF
    return turn @ Rotation.from_euler("x", twist).as_matrix(), turn @ [length, 0, 0]


def _in_frame(link: Link, turn: np.ndarray, shift: np.ndarray, ground: np.ndarray) -> Link:
    into = ground if link.in_ground else turn
    return Link(
        link.mass,
        turn @ link.centre + shift,
        turn @ link.inertia @ turn.T,
        turn @ link.at + shift,
        into @ link.force,
        into @ link.torque,
        link.in_ground,
    )


TRANSFORMATIONS = {
    "turned": turned,
    "mirrored": mirrored,
    "scaled": scaled,
    "reordered": reordered,
    "renamed": renamed,
    "backward": backward,
}
