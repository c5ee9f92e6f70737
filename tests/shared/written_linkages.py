"""Random linkages written with sines, roots and fractions, and errors of their starts.

The sketches are those of ``random_mechanisms``. Every length and place is an expression, and its value is known
from plain arithmetic on the way. Many lengths are given, some of them the drawn ones in other words.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations

import numpy as np
import sympy as sp
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from shared.random_mechanisms import Draft, sketch

import symgen
from symgen.errors import SceneError
from symgen.pipeline.build import text_of
from symgen.scene.loading import check_scene
from symgen.scene.resolve import resolve_linkage
from symgen.scene.rods.linkage import TIME, Linkage

KINDS = ("chain", "tree", "loop", "bodies")
AXES = "xyz"
#: Misses over the size of a linkage below which it closes, and the moment [s] after which drives have moved.
CLOSED, MOMENT = 1e-9, 0.01


@dataclass
class Written:
    """Tables of a scene being written, and the value of every parameter in it."""

    rng: np.random.Generator
    draft: Draft
    tables: dict = field(default_factory=lambda: {"parameters": {"m": "1 m", "w": "1 rad/s"}})
    value: dict[str, float] = field(default_factory=lambda: {"m": 1.0})

    def name(self, name: str, text: str, value: float) -> str:
        """Name an expression."""
        self.tables["parameters"][name] = text
        self.value[name] = value
        return name

    def length(self, name: str, wanted: float) -> str:
        """Name a length near the wanted one: a fraction, a root, a product of sines, a sum that cancels, a decimal."""
        style = int(self.rng.integers(5))
        near = Fraction(wanted).limit_denominator(60)
        if style == 0:
            return self.name(name, f"{near.numerator}/{near.denominator}*m", float(near))
        if style == 1:
            squared = Fraction(wanted**2).limit_denominator(90)
            return self.name(name, f"sqrt({squared.numerator}/{squared.denominator})*m", math.sqrt(squared))
        if style == 2:
            angle = round(float(self.rng.uniform(0.2, 1.2)), 2)
            size = round(wanted / math.sin(angle), 3)
            return self.name(name, f"{size!r}*m*sin({angle!r})", size * math.sin(angle))
        if style == 3:
            text = f"({near.numerator}/{near.denominator} + sin(0.4)**2 + cos(0.4)**2 - 1)*m"
            return self.name(name, text, float(near))
        return self.name(name, f"{round(wanted, 3)!r} m", round(wanted, 3))

    def place(self, point: str, near: str | None) -> None:
        """Name the coordinates of a point: polar, or spherical, about one that has a place."""
        at = self.draft.at[point] - (0 if near is None else self.draft.at[near])
        level = math.hypot(at[0], at[1])
        reach = self.length(f"r_{point}", max(float(np.linalg.norm(at)), 0.05))
        turn = round(math.atan2(at[1], at[0]), 3)
        parts = [(f"{reach}*cos({turn!r})", math.cos(turn)), (f"{reach}*sin({turn!r})", math.sin(turn))]
        if self.draft.dimension == 3:
            rise = round(math.atan2(at[2], level), 3)
            parts = [(f"{text}*cos({rise!r})", c * math.cos(rise)) for text, c in parts]
            parts.append((f"{reach}*sin({rise!r})", math.sin(rise)))
        for axis, (text, share) in zip(AXES, parts, strict=False):
            start = "" if near is None else f"{axis}_{near} + "
            before = 0.0 if near is None else self.value[f"{axis}_{near}"]
            self.name(f"{axis}_{point}", start + text, before + share * self.value[reach])

    def place_on(self, point: str) -> None:
        """Name the coordinates of a point that is placed on a link."""
        link, share = self.draft.on[point]
        start, end = self.draft.links[link][:2]
        for x in AXES[: self.draft.dimension]:
            a, b = self.value[f"{x}_{start}"], self.value[f"{x}_{end}"]
            text = f"{x}_{start} + {share!r}*({x}_{end} - {x}_{start})"
            self.name(f"{x}_{point}", text, a + share * (b - a))

    def at(self, point: str) -> np.ndarray:
        """Return where a point is drawn, by its coordinates' values."""
        return np.array([self.value[f"{axis}_{point}"] for axis in AXES[: self.draft.dimension]])


def random_scene(rng: np.random.Generator, dimension: int, kind: str, count: int, free: bool) -> Written:
    """Return a random linkage: as drawn, with lengths that it has, and with lengths, guides and angles to be met."""
    draft = sketch(rng, dimension, count, kind, free)
    made = Written(rng, draft)
    axes, tables = AXES[:dimension], made.tables
    order = list(draft.at)
    near: dict[str, str | None] = {}
    for point in order:
        together = [set(points) for points in draft.links.values() if point in points]
        earlier = [p for p in order[: order.index(point)] if any(p in points for points in together)]
        near[point] = earlier[0] if earlier else None
        if point in draft.on:
            made.place_on(point)
        else:
            made.place(point, near[point])
    tables["points"] = {
        p: {"at": [f"{a}_{p}" for a in axes], "ground": p in draft.ground} for p in order if p not in draft.on
    }
    tables["points"] |= {p: {"on": link, "fraction": z} for p, (link, z) in draft.on.items()}
    tables["links"] = {name: _link(made, name, near) for name in draft.links}
    tables["gravity"] = {"acceleration": ["0 m/s^2"] * (dimension - 1) + ["-9.81 m/s^2"]}
    if rng.random() < 0.4:
        _slider(made)
    if dimension == 2 and rng.random() < 0.4:
        _angle(made)
    if rng.random() < 0.3:
        tables["parameters"]["m"] = {"value": "1 m", "tunable": True}
    return made


def _link(made: Written, name: str, near: Mapping[str, str | None]) -> dict:
    points, rng = made.draft.links[name], made.rng
    table = {"points": points, "mass": "1 kg"}
    if len(points) > 2:
        first, second = points[:2]
        axes = AXES[: made.draft.dimension]
        centre = [f"({axis}_{first} + {axis}_{second})/2" for axis in axes]
        return {**table, "centre": centre, "inertia": "0.3 kg*m^2"}
    a, b = points
    if {a, b} & set(made.draft.on) or {a, b} <= set(made.draft.ground):
        return table
    drawn = float(np.linalg.norm(made.at(a) - made.at(b)))
    chosen = rng.random()
    if chosen < 0.3:
        return table
    if chosen < 0.8:
        child = b if near[b] == a else a if near[a] == b else None
        if child:
            table["length"] = f"r_{child}"
        else:
            squares = (f"({x}_{a} - {x}_{b})**2" for x in AXES[: made.draft.dimension])
            table["length"] = made.name(f"l_{name}", f"sqrt({' + '.join(squares)})", drawn)
    else:
        table["length"] = made.length(f"l_{name}", drawn * float(rng.uniform(0.98, 1.02)))
    return table


def _slider(made: Written) -> None:
    """Add a point mass on the line of a link, drawn on it or off it."""
    rods = {k: v for k, v in made.draft.links.items() if not set(v[:2]) & set(made.draft.on)}
    if not rods:
        return
    link = made.draft.pick(list(rods))
    a, b = rods[link][:2]
    beside = made.draft.pick([0.0, 0.02])
    at = [
        f"{x}_{a} + (sqrt(2)/4 + 0.2)*({x}_{b} - {x}_{a}) + {beside}*m" for x in AXES[: made.draft.dimension]
    ]
    made.tables["points"]["S"] = {"at": at}
    made.tables["masses"] = [{"point": "S", "mass": "0.5 kg"}]
    made.tables["guides"] = [{"points": ["S"], "along": link}]


def _angle(made: Written) -> None:
    """Drive a link, or give its direction at the start: the drawn one, or another one near it."""
    ground, on = set(made.draft.ground), set(made.draft.on)
    rods = {k: v for k, v in made.draft.links.items() if not set(v[:2]) & on and not set(v[:2]) <= ground}
    if not rods:
        return
    link = made.draft.pick(list(rods))
    a, b = rods[link][:2]
    angle = f"atan2(y_{b} - y_{a}, x_{b} - x_{a}) + {made.draft.pick([0.0, 0.05])}"
    if made.rng.random() < 0.5:
        made.tables["start"] = {"angles": {link: angle}}
    else:
        made.tables["drivers"] = [{"link": link, "angle": f"{angle} + w*t"}]


class Demands:
    """Conditions of a scene on its points at a time [s], by plain geometry."""

    def __init__(self, linkage: Linkage, t: float = 0.0) -> None:
        def number(expression: sp.Expr) -> float:
            values = {TIME.symbol: sp.Float(t), **linkage.defaults}
            return float(sp.lambdify((), expression.xreplace(values), "math")())

        points = linkage.points
        self.linkage = linkage
        self.drawn = {p.name: np.array([number(c) for c in p.at]) for p in points}
        self.ground = {p.name: np.array([number(c) for c in p.motion]) for p in points if p.ground}
        moving = [k for k in linkage.links if not {k.start, k.end} <= set(self.ground)]
        self.lengths = {k.name: number(k.length) for k in moving}
        self.carried = [
            (k, p.name, number(p.along), number(p.across)) for k in linkage.links for p in k.carried
        ]
        angles = (*linkage.start.angles, *((d.link, d.angle) for d in linkage.drivers))
        self.angles = {name: number(angle) for name, angle in angles}
        self.axes = {k.link: np.array([number(c) for c in k.axis]) for k in linkage.hinges}

    def misses(self, places: Mapping[str, np.ndarray]) -> Iterator[tuple[str, np.ndarray]]:
        """Yield the error vectors [m] of the conditions on points."""

        def along(name: str) -> np.ndarray:
            link = self.linkage.link(name)
            return places[link.end] - places[link.start]

        for name, there in self.ground.items():
            yield name, places[name] - there
        for name, length in self.lengths.items():
            yield name, np.atleast_1d(np.linalg.norm(along(name)) - length)
        for link, name, part, across in self.carried:
            d = along(link.name)
            left = np.array([-d[1], d[0]]) if len(d) == 2 else np.zeros(3)
            yield f"{link.name}.{name}", places[name] - (places[link.start] + part * d + across * left)
        for body in self.linkage.bodies:
            names = [p for p in (*body.base, *(c.name for c in body.carried)) if p in places]
            for a, b in combinations(names, 2):
                apart = np.linalg.norm(places[a] - places[b])
                yield (
                    f"{body.name} {a} {b}",
                    np.atleast_1d(apart - np.linalg.norm(self.drawn[a] - self.drawn[b])),
                )
        for guide in self.linkage.guides:
            d = along(guide.along)
            e = d / np.linalg.norm(d)
            for point in guide.points:
                arm = places[point] - places[self.linkage.link(guide.along).start]
                yield f"{point} along {guide.along}", arm - (arm @ e) * e
        for name, axis in self.axes.items():
            d, link, unit = along(name), self.linkage.link(name), axis / np.linalg.norm(axis)
            drawn = self.drawn[link.end] - self.drawn[link.start]
            yield f"{name} about its axis", np.atleast_1d(unit @ (d - drawn))
            if name in self.angles:
                yield f"{name} angle", d - Rotation.from_rotvec(self.angles[name] * unit).apply(drawn)
        for name, angle in self.angles.items():
            if name in self.axes:
                continue
            d = along(name)
            yield f"{name} angle", d - np.linalg.norm(d) * np.array([math.cos(angle), math.sin(angle)])


def closes(linkage: Linkage, t: float = 0.0, starts: int = 40) -> bool:
    """Return whether least squares from many starts find a pose that meets a scene's conditions at a time [s]."""
    demands, random = Demands(linkage, t), np.random.default_rng(0)
    free = [name for name in demands.drawn if name not in demands.ground]
    drawn = np.array([demands.drawn[name] for name in free])
    size = float(np.max(np.ptp(np.array(list(demands.drawn.values())), axis=0)))

    def residual(x: np.ndarray) -> np.ndarray:
        places = {**demands.ground, **dict(zip(free, x.reshape(drawn.shape), strict=True))}
        return np.concatenate([miss for _, miss in demands.misses(places)]) / size

    for k in range(starts):
        away = size * random.choice([0.05, 0.3, 1.0]) * random.normal(size=drawn.shape) if k else 0.0
        found = least_squares(
            residual, (drawn + away).ravel(), xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=300
        )
        if np.max(np.abs(found.fun)) < CLOSED:
            return True
    return False


def worst_miss(scene: object, model: object) -> float:
    """Return the largest error of a model's start over the size of the linkage."""
    linkage = resolve_linkage(check_scene(text_of(scene)))
    places = getattr(model, "rigid", model).initial_state().positions  # of elastic links the rigid motion
    if linkage.plane:
        places = {p: np.array(linkage.plane.within(tuple(at))) for p, at in places.items()}
    size = max(1e-300, float(np.max(np.abs(np.array(list(places.values()))))))
    return max(float(np.max(np.abs(miss))) for _, miss in Demands(linkage).misses(places)) / size


def judge(seed: int, backend: str = "numpy") -> tuple[str, float]:
    """Build one random scene; return the outcome, and the error of its start."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % 4]
    made = random_scene(rng, 2 + seed // 4 % 2, kind, int(rng.integers(3, 8)), bool(rng.random() < 0.3))
    scene = symgen.Scene(**made.tables)
    try:
        model = symgen.build(scene, backend=backend)
    except SceneError as error:
        linkage = resolve_linkage(check_scene(text_of(scene)))
        # A linkage that closes only at the first instant has a drive that cannot rotate.
        wrongly = "WRONGLY " if closes(linkage) and closes(linkage, MOMENT) else ""
        return f"{wrongly}refused: {error.problem.split(':')[0].split(' by ')[0][:60]}", 0.0
    worst = worst_miss(scene, model)
    for table in made.tables["links"].values():
        if table.get("length") in made.value:
            a, b = (model.initial_state().positions[p] for p in table["points"])
            worst = max(worst, abs(np.linalg.norm(a - b) - made.value[table["length"]]))
    return "started", worst


def judged(seeds: range) -> tuple[Counter[str], dict[int, float]]:
    """Return the outcomes of these scenes, and the errors of those that start."""
    outcomes, errors = Counter(), {}
    for seed in seeds:
        outcome, error = judge(seed)
        outcomes[outcome] += 1
        if outcome == "started":
            errors[seed] = error
    return outcomes, errors
