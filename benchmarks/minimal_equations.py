"""Equations of motion in as few coordinates as freedoms, in any number type: of mpmath, or of heyoka.

They share nothing with symgen: Lagrange's equations in angles. A linkage with one freedom is placed by its
crank angle, dyad by dyad, with first and second derivatives by that angle; with the inertia
W = sum m c'.c' + I s'^2 of centres c and rotations s of the bodies, and the power Q of the loads by the
angle, W a'' = Q - (sum m c'.c'' + I s' s'') a'^2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from chain_reference import cholesky

Real = Any  # a number of mpmath, or an expression of heyoka
Rates = Callable[[list[Real]], list[Real]]


@dataclass(frozen=True)
class Jet:
    """A number with its first and second derivatives by the crank angle."""

    value: Real
    first: Real = 0
    second: Real = 0

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __sub__(self, other: Jet) -> Jet:
        return Jet(self.value - other.value, self.first - other.first, self.second - other.second)

    def __mul__(self, other: Jet) -> Jet:
        a, b = self, other
        second = a.second * b.value + 2 * a.first * b.first + a.value * b.second
        return Jet(a.value * b.value, a.first * b.value + a.value * b.first, second)

    def __truediv__(self, other: Jet) -> Jet:
        value = self.value / other.value
        first = (self.first - value * other.first) / other.value
        second = (self.second - 2 * first * other.first - value * other.second) / other.value
        return Jet(value, first, second)

    def root(self, sqrt: Callable[[Real], Real]) -> Jet:
        """Return the square root."""
        value = sqrt(self.value)
        first = self.first / (2 * value)
        return Jet(value, first, (self.second / 2 - first * first) / value)


Place = tuple[Jet, Jet]


@dataclass(frozen=True)
class Dyad:
    """A point at distances from two others, left of the way from the first to the second."""

    point: str
    first: str
    second: str
    lengths: tuple[str, str]


@dataclass(frozen=True)
class Fixed:
    """A point of a body with a line from ``first`` to ``second``: distances along it and to its left."""

    point: str
    first: str
    second: str
    length: str
    along: str
    left: str


@dataclass(frozen=True)
class Body:
    """Mass, moment of inertia about the centre, and the centre along a line of a length and to its left.

    A uniform rod has its centre in the middle, and no inertia here: a twelfth of m l^2.
    """

    first: str
    second: str
    length: str
    mass: str
    inertia: str | None = None
    along: str | None = None
    left: str = "0"


@dataclass(frozen=True)
class Linkage:
    """A planar linkage with one freedom, in SI, with numbers as decimals.

    ``crank`` has the centre, the end and the length of the crank, whose angle is the coordinate; ``start``
    its angle and rate; ``spring`` two points, stiffness and free length; ``torque`` that on the crank.
    """

    ground: Mapping[str, tuple[str, str]]
    crank: tuple[str, str, str]
    placed: Sequence[Dyad | Fixed]
    bodies: Sequence[Body]
    start: tuple[str, str]
    gravity: str = "9.81"
    spring: tuple[str, str, str, str] | None = None
    torque: str = "0"

    def places(self, angle: Real, of: Any, number: Callable[[str], Real]) -> dict[str, Place]:
        """Return all points for a crank angle; ``of`` has sin, cos and sqrt, ``number`` reads a decimal."""
        at = {p: (Jet(number(x)), Jet(number(y))) for p, (x, y) in self.ground.items()}
        centre, end, length = self.crank
        c, s = number(length) * of.cos(angle), number(length) * of.sin(angle)
        x, y = at[centre]
        at[end] = x + Jet(c, -s, -c), y + Jet(s, c, -s)
        for point in self.placed:
            a, b = at[point.first], at[point.second]
            d = b[0] - a[0], b[1] - a[1]
            if isinstance(point, Fixed):
                along, left = (Jet(number(x) / number(point.length)) for x in (point.along, point.left))
            else:
                square = d[0] * d[0] + d[1] * d[1]
                first, second = (number(x) ** 2 for x in point.lengths)
                along = (square + Jet(first - second)) / (square + square)
                left = (Jet(first) / square - along * along).root(of.sqrt)
            at[point.point] = a[0] + along * d[0] - left * d[1], a[1] + along * d[1] + left * d[0]
        return at

    def rates_of(self, of: Any, number: Callable[[str], Real]) -> Rates:
        """Return the rates of the crank angle and its rate as a function of these."""

        def rates(y: list[Real]) -> list[Real]:
            at = self.places(y[0], of, number)
            inertia, change, load = [], [], [number(self.torque)]
            for body in self.bodies:
                (ax, ay), (bx, by) = at[body.first], at[body.second]
                length, mass = number(body.length), number(body.mass)
                along = number(body.along) / length if body.along else number("0.5")
                left = number(body.left) / length
                moment = number(body.inertia) / length**2 if body.inertia else mass / 12
                dx, dy = bx - ax, by - ay
                x = ax + Jet(along) * dx - Jet(left) * dy
                height = ay + Jet(along) * dy + Jet(left) * dx
                for part, weight in ((x, mass), (height, mass), (dx, moment), (dy, moment)):
                    inertia.append(weight * part.first * part.first)
                    change.append(weight * part.first * part.second)
                if self.gravity != "0":
                    load.append(-mass * number(self.gravity) * height.first)
            if self.spring:
                first, second, stiffness, free = self.spring
                (ax, ay), (bx, by) = at[first], at[second]
                far = ((bx - ax) * (bx - ax) + (by - ay) * (by - ay)).root(of.sqrt)
                load.append(-number(stiffness) * (far.value - number(free)) * far.first)
            return [y[1], (sum(load) - sum(change) * y[1] * y[1]) / sum(inertia)]

        return rates


#: The shipped scenes as linkages of bodies; lengths in metres.
FOUR_BAR = Linkage(
    ground={"O": ("0", "0"), "C": ("2", "0")},
    crank=("O", "A", "1"),
    placed=[Dyad("B", "A", "C", ("1.8", "1.4"))],
    bodies=[Body("O", "A", "1", "1"), Body("A", "B", "1.8", "1.8"), Body("B", "C", "1.4", "1.4")],
    start=("1.1", "2.5"),
)
_ARM, _SIDE = (
    "0.04",
    "0.05656854249492380195206754896838792314278687501507792292706718951962929913848428815540",
)
PEAUCELLIER = Linkage(
    ground={"O": ("0", "0"), "E": ("0.02", "0")},
    crank=("O", "A", "0.02"),
    placed=[Dyad("B", "A", "E", (_SIDE, _ARM)), Dyad("D", "E", "A", (_ARM, _SIDE)),
            Dyad("C", "B", "D", (_SIDE, _SIDE))],
    bodies=[Body("O", "A", "0.02", "0.02"), Body("B", "E", _ARM, _ARM), Body("D", "E", _ARM, _ARM),
            *(Body(a, b, _SIDE, _SIDE) for a, b in ("AB", "BC", "CD", "AD"))],
    start=("3.14159265358979323846264338327950288419716939937510582097494459", "0"),
)  # fmt: skip
ANDREWS = Linkage(
    ground={"O": ("0", "0"), "A": ("-0.06934", "-0.00227"), "B": ("-0.03635", "0.03273"),
            "C": ("0.014", "0.072")},
    crank=("O", "Q", "0.007"),
    placed=[Dyad("P", "Q", "B", ("0.028", "0.035")), Fixed("D", "B", "P", "0.035", "0.018", "0.02"),
            Dyad("E", "A", "P", ("0.04", "0.02")), Dyad("F", "P", "A", ("0.02", "0.04"))],
    bodies=[
        Body("O", "Q", "0.007", "0.04325", "2.194e-6", "0.00092"),
        Body("Q", "P", "0.028", "0.00365", "4.41e-7", "0.0115"),
        Body("B", "P", "0.035", "0.02373", "5.255e-6", "0.01874", "0.01043"),
        Body("P", "E", "0.02", "0.00706", "5.667e-7", "0.01421"),
        Body("A", "E", "0.04", "0.0705", "1.169e-5", "0.02308", "0.00916"),
        Body("P", "F", "0.02", "0.00706", "5.667e-7", "0.01421"),
        Body("A", "F", "0.04", "0.05498", "1.912e-5", "0.01228", "-0.00449"),
    ],
    start=("-0.0617138900142764496358948458001", "0"),
    gravity="0",
    spring=("C", "D", "4530", "0.07785"),
    torque="0.033",
)  # fmt: skip

#: Unit vectors of two rods of 1 m and 1 kg in space at the start, at rest; and from where springs pull the
#: ends, with stiffness [N/m] and free length [m].
DIRECTIONS = (("0.28", "0.96", "0"), ("-0.36", "0.48", "0.8"))
SPRINGS = ((("1", "0.5", "0.4"), "20", "0.5"), (("-1", "1", "-0.6"), "30", "0.8"))


def directions(y: Sequence[Real], of: Any) -> list[list[list[Real]]]:
    """Return, for each rod with angles a, b: its direction e and the derivatives e_a, e_b, e_aa, e_ab, e_bb.

    The axis of the angles is that of x: e = (sin b, cos b cos a, cos b sin a).
    """
    found = []
    for a, b in (y[0:2], y[2:4]):
        ca, sa, cb, sb = of.cos(a), of.sin(a), of.cos(b), of.sin(b)
        e, along = [sb, cb * ca, cb * sa], [cb, -sb * ca, -sb * sa]
        first, mixed = [0, -e[2], e[1]], [0, -along[2], along[1]]
        found.append([e, first, along, [0, -e[1], -e[2]], mixed, [-x for x in e]])
    return found


def _dot(a: Sequence[Real], b: Sequence[Real]) -> Real:
    return sum(x * y for x, y in zip(a, b, strict=True))


def pendulum_in_space(of: Any, number: Callable[[str], Real]) -> Rates:
    """Return the rates of the angles a, b of two rods in space on springs, and of their rates."""
    inertia = [[number("4") / 3, number("0.5")], [number("0.5"), number("1") / 3]]
    weight = [number("1.5"), number("0.5")]

    def rates(y: list[Real]) -> list[Real]:
        rods = directions(y, of)
        tips = [rods[0][0], [a + b for a, b in zip(rods[0][0], rods[1][0], strict=True)]]
        pulls = []
        for tip, (anchor, stiffness, free) in zip(tips, SPRINGS, strict=True):
            d = [x - number(f) for x, f in zip(tip, anchor, strict=True)]
            part = number(stiffness) * (number(free) / of.sqrt(_dot(d, d)) - number("1"))
            pulls.append([part * x for x in d])
        forces = [[a + b for a, b in zip(*pulls, strict=True)], pulls[1]]
        for force, w in zip(forces, weight, strict=True):
            force[2] = force[2] - number("9.81") * w
        bent = []
        for rod, (va, vb) in zip(rods, (y[4:6], y[6:8]), strict=True):
            factors = (va * va, 2 * va * vb, vb * vb)
            terms = zip(*(rod[k] for k in (3, 4, 5)), strict=True)
            bent.append([_dot(factors, t) for t in terms])
        tangents = [(i, rods[i][k]) for i in range(2) for k in (1, 2)]
        matrix = [
            [inertia[i][j] * _dot(a, b) for j, b in tangents[: row + 1]]
            for row, (i, a) in enumerate(tangents)
        ]
        right = [
            _dot(a, forces[i]) - sum(inertia[i][j] * _dot(a, bent[j]) for j in range(2)) for i, a in tangents
        ]
        return [*y[4:], *cholesky(matrix, right, of.sqrt)]

    return rates


#: The free RSSR linkage of ``taylor.py``: lengths; distance, rise, cosine and sine of the twist of the axes.
RSSR = {"crank": "0.1", "rod": "0.45", "rocker": "0.3", "distance": "0.35", "rise": "0.1",
        "cos": "0.5", "sin": "0.86602540378443864676372317075293618347140262690519031402790"}  # fmt: skip
#: Mass per length [kg/m], and radius of the rod.
LINE, RADIUS = "1.2", "0.008"


def rssr_tips(of: Any, number: Callable[[str], Any]) -> Callable[[Real], list[list[Jet]]]:
    """Return the balls of crank and rocker, each from its axis, and the rod from one to the other.

    They are a function of the crank angle. The axis of the crank is that of z. The ball of the rocker, of
    angle b, is at p - r cos(b) x + r sin(b) y' with y' and p in the plane across x; its distance from that
    of the crank gives cos(b) and sin(b).
    """
    r1, l, r, c, s = (number(RSSR[name]) for name in ("crank", "rod", "rocker", "cos", "sin"))
    p = [Jet(number(RSSR["distance"])), Jet(-number(RSSR["rise"]) * s), Jet(-number(RSSR["rise"]) * c)]
    zero = number("0")

    def tips(angle: Real) -> list[list[Jet]]:
        cos, sin = r1 * of.cos(angle), r1 * of.sin(angle)
        near = [Jet(cos, -sin, -cos), Jet(sin, cos, -sin), Jet(zero)]
        gap = [a - b for a, b in zip(p, near, strict=True)]
        # |gap|^2 + r^2 - l^2 = 2 r (gap_x cos b - gap_y' sin b)
        along, across = gap[0], Jet(-s) * gap[2] + Jet(c) * gap[1]
        square = gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]
        lack = (square + Jet(r * r - l * l)) / Jet(2 * r)
        size = along * along + across * across
        root = (size - lack * lack).root(of.sqrt)
        x, z = (along * lack + across * root) / size, (along * root - across * lack) / size
        arm = [Jet(-r) * x, Jet(r * c) * z, Jet(-r * s) * z]
        return [near, arm, [a + b for a, b in zip(gap, arm, strict=True)]]

    return tips


def rssr(of: Any, number: Callable[[str], Any]) -> Rates:
    """Return the rates of the crank angle of a crank-rocker between skew axes and of its rate, under gravity.

    The rod does not spin about its line.
    """
    tips, l = rssr_tips(of, number), number(RSSR["rod"])
    masses = [number(LINE) * number(RSSR[name]) for name in ("crank", "rod", "rocker")]
    moment = masses[1] * (3 * number(RADIUS) ** 2 + l * l) / (12 * l * l)

    def rates(y: list[Real]) -> list[Real]:
        near, arm, rod = tips(y[0])
        middle = [a + Jet(number("0.5")) * b for a, b in zip(near, rod, strict=True)]
        weights = ((near, masses[0] / 3), (arm, masses[2] / 3), (middle, masses[1]), (rod, moment))
        parts = [(x, w) for xs, w in weights for x in xs]
        inertia = sum(w * x.first * x.first for x, w in parts)
        change = sum(w * x.first * x.second for x, w in parts)
        load = -number("9.81") * (masses[1] * middle[2].first + masses[2] * arm[2].first / 2)
        return [y[1], (load - change * y[1] * y[1]) / inertia]

    return rates
