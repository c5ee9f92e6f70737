"""Rigid motion of linkages with elastic links, and their constraints, from positions alone, at 50 digits.

Positions are those of vector loops: circles that meet. All rates are differences of positions a tiny time apart.
Forces are those of Newton and Euler for every link by itself: force and moment balance of bars and balance of
every joint. Nothing of symgen is used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import mpmath
import numpy as np
from mpmath import mp, mpf

DIGITS = 50
STEP = mpf(10) ** -12

IN, FT, LBF = 0.0254, 0.3048, 4.4482216152605
SLUG = LBF / FT
RPM = 2 * np.pi / 60


@dataclass(frozen=True)
class Bar:
    """A uniform bar from a to b.

    ``lumps`` are (fraction, mass), ``forces`` (fraction, (fx, fy)) along it, ``joints`` (fraction, point).
    """

    name: str
    a: str
    b: str
    mass: float
    inertia: float
    elastic: bool = False
    axial: bool = True
    lumps: tuple = ()
    forces: tuple = ()
    joints: tuple = ()
    disc: float = 0.0  # moment of inertia of a disc fixed to it

    @property
    def points(self) -> tuple[tuple[float, str], ...]:
        return (0.0, self.a), *self.joints, (1.0, self.b)


@dataclass(frozen=True)
class Spring:
    a: str
    b: str
    stiffness: float
    length: float
    damping: float


@dataclass(frozen=True)
class Torsion:
    """A torsion spring at ``point`` on bar a, against bar b or the ground (empty)."""

    a: str
    b: str
    point: str
    stiffness: float
    damping: float
    angle: float

    def rotations(self) -> tuple[tuple[str, float], ...]:
        return tuple((k, sign) for k, sign in ((self.a, 1.0), (self.b, -1.0)) if k)


@dataclass(frozen=True)
class Linkage:
    """``places`` gives all points by the time; ``guided`` the normal of the line that a point stays on."""

    places: Callable[[mpf], dict[str, tuple[mpf, mpf]]]
    ground: tuple[str, ...]
    bars: tuple[Bar, ...]
    crank: str
    particles: dict[str, float] = field(default_factory=dict)
    guided: dict[str, tuple[float, float]] = field(default_factory=dict)
    springs: tuple[Spring, ...] = ()
    torsions: tuple[Torsion, ...] = ()
    gravity: tuple[float, float] = (0.0, 0.0)

    def bar(self, name: str) -> Bar:
        return next(b for b in self.bars if b.name == name)

    def at(self, t: float) -> Instant:
        return Instant(self, t)


def circles(a, b, first, second, side):
    """Return where a circle about a meets one about b, to the left (side 1) of the way from a to b."""
    gap = (b[0] - a[0], b[1] - a[1])
    squared = gap[0] ** 2 + gap[1] ** 2
    along = (mpf(first) ** 2 - mpf(second) ** 2 + squared) / (2 * squared)
    across = side * mp.sqrt(mpf(first) ** 2 / squared - along**2)
    return a[0] + along * gap[0] - across * gap[1], a[1] + along * gap[1] + across * gap[0]


class Instant:
    """A linkage at one time: places, rates, forces, as floats from calculations with 50 digits."""

    def __init__(self, linkage: Linkage, t: float) -> None:
        self.linkage, self.t = linkage, t
        with mpmath.workdps(DIGITS):
            before, now, after = (linkage.places(mpf(t) + k * STEP) for k in (-1, 0, 1))
            self.now = now
            self.rate = {
                p: tuple((c - a) / (2 * STEP) for a, c in zip(before[p], after[p], strict=True)) for p in now
            }
            self.second = {
                p: tuple((a - 2 * b + c) / STEP**2 for a, b, c in zip(before[p], x, after[p], strict=True))
                for p, x in now.items()
            }
        self.points = [p for p in now if p not in linkage.ground]

    def of(self, table, p: str):
        return np.array([float(x) for x in table[p]])

    def felt(self, p: str):
        """Acceleration of a point less gravity."""
        return self.of(self.second, p) - np.array(self.linkage.gravity)

    def axes(self, bar: Bar):
        """Direction of a bar with two rates, and its length."""
        d, v, a = (self.of(t, bar.b) - self.of(t, bar.a) for t in (self.now, self.rate, self.second))
        squared = d @ d
        rate = (d[0] * v[1] - d[1] * v[0]) / squared
        second = (d[0] * a[1] - d[1] * a[0]) / squared - 2 * rate * (d @ v) / squared
        return d / np.sqrt(squared), rate, second, float(np.sqrt(squared))

    @cached_property
    def forces(self) -> dict[tuple[str, str], np.ndarray]:
        """Forces of the joints on the bars, by bar and point; weights and loads along a bar act on that bar."""
        bars = self.linkage.bars
        at = {(b.name, p): 2 * i for i, (b, p) in enumerate((b, p) for b in bars for _, p in b.points)}
        couple = 2 * len(at)
        normal = {p: couple + 1 + i for i, p in enumerate(self.linkage.guided)}
        rows, right = [], []

        def balance(terms, value):
            row = np.zeros(couple + 1 + len(normal))
            for k, factor in terms:
                row[k] += factor
            rows.append(row)
            right.append(value)

        for b in bars:
            e, _, second, length = self.axes(b)
            turned = np.array([-e[1], e[0]])
            force, moment = np.zeros(2), (b.inertia + b.disc) * second - self.couple(b.name)
            for s, mass in ((0.5, b.mass), *b.lumps):
                inertia = mass * ((1 - s) * self.felt(b.a) + s * self.felt(b.b))
                force, moment = force + inertia, moment + (s - 0.5) * length * turned @ inertia
            for s, load in b.forces:
                force = force - np.array(load)
                moment -= (s - 0.5) * length * turned @ np.array(load)
            joined = [(s - 0.5, at[b.name, p]) for s, p in b.points]
            for k in range(2):
                balance([(i + k, 1) for _, i in joined], force[k])
            lever = length * turned
            terms = [(i + k, s * lever[k]) for s, i in joined for k in range(2)]
            balance([*terms, *([(couple, 1)] if b.name == self.linkage.crank else [])], moment)
        for p in self.points:
            own = self.linkage.particles.get(p, 0.0) * self.felt(p) - self.spring_force(p)
            for k in range(2):
                terms = [(i + k, -1) for (_, q), i in at.items() if q == p]
                if p in normal:
                    terms.append((normal[p], self.linkage.guided[p][k]))
                balance(terms, own[k])
        found = np.linalg.solve(np.array(rows), np.array(right))
        return {key: found[i : i + 2] for key, i in at.items()}

    def torque(self, spring: Torsion) -> float:
        """Torque of a torsion spring on its first bar."""
        angle, rate = -spring.angle, 0.0
        for name, sign in spring.rotations():
            e, omega, *_ = self.axes(self.linkage.bar(name))
            angle, rate = angle + sign * np.arctan2(e[1], e[0]), rate + sign * omega
        return -spring.stiffness * ((angle + np.pi) % (2 * np.pi) - np.pi) - spring.damping * rate

    def couple(self, bar: str) -> float:
        return sum(
            sign * self.torque(s) for s in self.linkage.torsions for k, sign in s.rotations() if k == bar
        )

    def spring_force(self, p: str):
        total = np.zeros(2)
        for s in self.linkage.springs:
            if p in (s.a, s.b):
                other = s.b if p == s.a else s.a
                d = self.of(self.now, other) - self.of(self.now, p)
                v = self.of(self.rate, other) - self.of(self.rate, p)
                length = np.sqrt(d @ d)
                pull = s.stiffness * (length - s.length) + s.damping * (d @ v) / length
                total += pull * d / length
        return total

    def links_row(self, name: str):
        """Rigid-body motion inputs of an elastic link, in the order of the kernel ``links``."""
        b = self.linkage.bar(name)
        ends = [self.of(t, b.b) - self.of(t, b.a) for t in (self.now, self.rate, self.second)]
        return np.concatenate([*ends, self.felt(b.a), self.forces[name, b.a]])


def polar(length, angle, origin=(0.0, 0.0)):
    return origin[0] + mpf(length) * mp.cos(angle), origin[1] + mpf(length) * mp.sin(angle)


def ground(**places: Sequence[float]):
    return {p: (mpf(x), mpf(y)) for p, (x, y) in places.items()}


def four_bar(speed: float) -> Linkage:
    """The rig of the thesis: 7, 10, 12 on 11 in."""
    per_length, bearing = 5.292 * SLUG / FT**3 * IN * 0.125 * IN, 0.0040803133 * SLUG

    def places(t):
        A, Q = polar(7 * IN, speed * t), (mpf(11 * IN), mpf(0))
        return ground(M=(0, 0), Q=Q) | {"A": A, "B": circles(A, Q, 10 * IN, 12 * IN, 1)}

    def bar(name, a, b, length):
        return Bar(name, a, b, per_length * length, per_length * length**3 / 12, elastic=True)

    bars = bar("crank", "M", "A", 7 * IN), bar("coupler", "A", "B", 10 * IN), bar("output", "B", "Q", 12 * IN)
    return Linkage(places, ("M", "Q"), bars, "crank", {"A": bearing, "B": bearing})


def slider_crank() -> Linkage:
    steel = 7850.0

    def places(t):
        A = polar(0.05, 1500 * RPM * t)
        return ground(O=(0, 0)) | {"A": A, "P": (A[0] + mp.sqrt(mpf(0.2) ** 2 - A[1] ** 2), mpf(0))}

    crank, rod = steel * 0.02 * 0.02 * 0.05, steel * 0.012 * 0.004 * 0.2
    bars = (
        Bar("crank", "O", "A", crank, crank * 0.05**2 / 12),
        Bar("rod", "A", "P", rod, rod * 0.2**2 / 12, elastic=True),
    )
    return Linkage(places, ("O",), bars, "crank", {"P": 0.3}, {"P": (0.0, 1.0)})


def cantilever() -> Linkage:
    mass = 7850 * 0.05 * 0.005 * 1.0
    bar = Bar("strip", "O", "tip", mass, mass / 12, elastic=True)

    def places(t):
        return ground(O=(0, 0)) | {"tip": polar(1.0, 120 * RPM * t)}

    return Linkage(places, ("O",), (bar,), "strip")


#: Lengths [m] of crank, coupler, first rocker, connecting link and second rocker of ``six_bar``, and the
#: fractions of the coupler and of the second rocker at which the links between them are joined.
SIX_BAR = {
    "r": 0.1, "coupler_length": 0.5, "rocker_length": 0.35, "link_length": 0.4, "lever_length": 0.45,
    "joint": 0.6, "middle": 0.5,
}  # fmt: skip


#: Torsion springs at sections of ``six_bar``, and the disc [kg m^2] on its coupler.
TORSIONS = Torsion("coupler", "rocker", "C", 8.0, 0.05, -1.0), Torsion("lever", "", "R", 5.0, 0.02, 2.0)
DISC = 2e-3


def six_bar(
    sizes: dict[str, float], elastic: Sequence[str], swing: float = 0.0, *, turned: bool = False
) -> Linkage:
    """A coupler that extends beyond its joint C to T, and a lever that is driven at its middle E.

    ``swing`` is the amplitude [rad] of 40 rad/s by which the angle of the crank departs from constant speed.
    ``turned``: with ``TORSIONS`` and ``DISC``.
    """
    r, coupler, rocker, link, lever, joint, middle = sizes.values()

    def places(t):
        A, Q, R = (
            polar(r, 1 + SPEED * t + swing * mp.sin(40 * t)),
            (mpf("0.4"), mpf(0)),
            (mpf("0.7"), mpf("0.25")),
        )
        C = circles(A, Q, joint * mpf(coupler), rocker, 1)
        T = tuple(a + (c - a) / joint for a, c in zip(A, C, strict=True))
        E = circles(T, R, link, middle * mpf(lever), 1)
        S = tuple(a + (c - a) / middle for a, c in zip(R, E, strict=True))
        return ground(O=(0, 0), Q=Q, R=R) | {"A": A, "T": T, "S": S, "C": C, "E": E}

    def bar(name, a, b, length, **options):
        mass = 2700 * 0.02 * 0.004 * length
        return Bar(name, a, b, mass, mass * length**2 / 12, elastic=name in elastic, **options)

    bars = (
        Bar("crank", "O", "A", 0.5, 0.5 * r**2 / 12),
        bar("coupler", "A", "T", coupler, joints=((joint, "C"),), lumps=((0.3, 0.05),), disc=DISC * turned),
        bar("rocker", "Q", "C", rocker),
        bar("link", "T", "E", link),
        bar("lever", "R", "S", lever, joints=((middle, "E"),)),
    )
    spring = Spring("C", "S", 200.0, 0.3, 4.0)
    masses = {"S": 0.1, "C": 0.04}
    torsions = TORSIONS if turned else ()
    return Linkage(places, ("O", "Q", "R"), bars, "crank", masses, {}, (spring,), torsions, (0.0, -9.81))


def six_bar_scene(elastic: Sequence[str], swing: float = 0.0, *, turned: bool = False) -> dict:
    """The linkage of ``six_bar`` as a scene, with its sizes as tunable parameters."""
    with mpmath.workdps(DIGITS):
        drawn = six_bar(SIX_BAR, elastic).places(mpf(0))
    points = {
        p: {"at": [f"{float(x)!r} m" for x in xy], **({"ground": True} if p in "OQR" else {})}
        for p, xy in drawn.items()
        if p not in "CE"
    }
    points["C"] = {"on": "coupler", "fraction": "joint"}
    points["E"] = {"on": "lever", "fraction": "middle"}
    points["P"] = {"on": "coupler", "fraction": 0.3}

    def link(name, a, b, **options):
        bent = {"elastic": {"E": "70 GPa", "elements": 2, **options}} if name in elastic else {}
        section = {"width": "20 mm", "thickness": "4 mm"}
        made = {"points": [a, b], "length": f"{name}_length", "density": "2700 kg/m^3", "section": section}
        return made | bent

    links = {
        "crank": {"points": ["O", "A"], "length": "r", "mass": "0.5 kg"},
        "coupler": link("coupler", "A", "T", elements=3, damping={"mass": "2 1/s", "stiffness": "1e-5 s"}),
        "rocker": link("rocker", "Q", "C", element="cubic"),
        "link": link("link", "T", "E"),
        "lever": link("lever", "R", "S", damping={"ratio": 0.03}),
    }
    units = {name: "" if name in ("joint", "middle") else " m" for name in SIX_BAR}
    motion = {"speed": f"{SPEED!r} rad/s", "angle": "1 rad"}
    if swing:
        motion = {"angle": f"1 + speed*t + {swing!r}*sin(rate*t)"}
    return {
        "title": "Six-bar with joints between the ends of elastic links",
        "parameters": {
            name: {"value": f"{size!r}{units[name]}" if units[name] else size, "tunable": True}
            for name, size in SIX_BAR.items()
        }
        | {"speed": f"{SPEED!r} rad/s", "rate": "40 rad/s"},
        "points": points,
        "links": links,
        "masses": [
            {"point": "S", "mass": "0.1 kg"}, {"point": "C", "mass": "0.04 kg"},
            {"point": "P", "mass": "0.05 kg", **({"inertia": f"{DISC} kg*m^2"} if turned else {})},
        ],
        "torsion_springs": [
            {
                "link": s.a, "point": s.point, "stiffness": f"{s.stiffness!r} N*m", "angle": s.angle,
                "damping": f"{s.damping!r} N*m*s", **({"against": s.b} if s.b else {}),
            }
            for s in (TORSIONS if turned else ())
        ],
        "springs": [{"between": ["C", "S"], "stiffness": "200 N/m", "length": "0.3 m", "damping": "4 N*s/m"}],
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        "crank": {"link": "crank", **motion},
    }  # fmt: skip


#: Angular velocity [rad/s] of the crank of ``two_loops`` and ``six_bar``.
SPEED = 30.0


def two_loops(flywheel: float = 0.0) -> Linkage:
    """Two loops that share the joint B of three links, with rigid and elastic links, loads and a spring."""

    def places(t):
        A, C, F = polar(0.12, 1 + SPEED * t), (mpf("0.5"), mpf(0)), (mpf("0.9"), mpf("-0.1"))
        B = circles(A, C, "0.4", "0.35", 1)
        return ground(O=(0, 0), C=C, F=F) | {"A": A, "B": B, "E": circles(B, F, "0.6", "0.3", 1)}

    section = 2700 * 0.02 * 0.004
    more = 2700 * 0.02 * 0.004**3 / 12 * 0.6  # rotary inertia of the sections of a Timoshenko beam

    def elastic(name, a, b, length, **options):
        mass = section * length
        return Bar(name, a, b, mass, mass * length**2 / 12, elastic=True, **options)

    rod = elastic("rod", "B", "E", 0.6, axial=False)
    bars = (
        Bar("crank", "O", "A", 0.5, 0.5 * 0.12**2 / 12 + flywheel),
        elastic("coupler", "A", "B", 0.4, lumps=((0.3, 0.05),), forces=((0.3, (3.0, -5.0)),)),
        Bar("rocker", "C", "B", 0.3, 0.3 * 0.35**2 / 12),
        Bar(rod.name, "B", "E", rod.mass, rod.inertia + more, elastic=True, axial=False),
        elastic("follower", "F", "E", 0.3),
    )
    spring = Spring("A", "E", 200.0, 0.3, 4.0)
    return Linkage(places, ("O", "C", "F"), bars, "crank", {"E": 0.1}, {}, (spring,), gravity=(0.0, -9.81))


def two_loops_scene(crank: dict) -> dict:
    """The linkage of ``two_loops`` as a scene, drawn at time zero, with the type of its crank."""
    with mpmath.workdps(DIGITS):
        drawn = two_loops().places(mpf(0))
    points = {
        p: {"at": [f"{float(x)!r} m" for x in xy], **({"ground": True} if p in "OCF" else {})}
        for p, xy in drawn.items()
    }
    points["P"] = {"on": "coupler", "fraction": 0.3}
    section = {"width": "20 mm", "thickness": "4 mm"}

    def elastic(a, b, length, **options):
        return {
            "points": [a, b], "length": length, "density": "2700 kg/m^3", "section": section,
            "elastic": {"E": "70 GPa", **options},
        }  # fmt: skip

    return {
        "title": "Two loops",
        "parameters": {"stall": "2 N*m", "drag": "0.1 N*m*s"},
        "points": points,
        "links": {
            "crank": {"points": ["O", "A"], "length": "0.12 m", "mass": "0.5 kg"},
            "coupler": elastic("A", "B", "0.4 m", elements=2, damping={"ratio": 0.03}),
            "rocker": {"points": ["C", "B"], "length": "0.35 m", "mass": "0.3 kg"},
            "rod": elastic(
                "B", "E", "0.6 m", element="timoshenko", axial=False, shear={"poisson": 0.3}, elements=2,
                damping={"mass": "2 1/s", "stiffness": "1e-5 s"},
            ),
            "follower": elastic(
                "F", "E", "0.3 m", element="cubic", elements=3,
                reduction={"kind": "craig-bampton", "modes": 2},
            ),
        },
        "masses": [{"point": "E", "mass": "0.1 kg"}, {"point": "P", "mass": "0.05 kg"}],
        "forces": [{"point": "P", "force": ["3 N", "-5 N"]}],
        "springs": [{"between": ["A", "E"], "stiffness": "200 N/m", "length": "0.3 m", "damping": "4 N*s/m"}],
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        "crank": {"link": "crank", "speed": f"{SPEED!r} rad/s", "angle": "1 rad", **crank},
    }  # fmt: skip
