"""Shipped driven loops in 60 digits and their derivatives by parameters; nothing is of symgen.

Rotations and places are multiplied row by row, the loop is closed by Gauss and Newton on all twelve equations,
rates and momenta are differences in time of fourth order, and slopes are central differences. The drive
effort follows from the power of all links, joint forces from the balance of the links behind a joint and
from joints that transmit nothing along their freedoms. Only the initial pose is taken from symgen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import mpmath as mp
import numpy as np

DIGITS = 60
#: Steps in time [s] and of parameters, over their size.
LATER, STEP = mp.mpf("1e-12"), mp.mpf("1e-10")
#: Weights of the fourth-order first difference at -2 ... 2 steps.
WEIGHTS = (1, -8, 0, 8, -1)

Values = dict[str, mp.mpf]


@dataclass(frozen=True)
class Case:
    """A scene: parameters in SI, its table by parameters and variables, its inertia, and a time [s].

    ``table`` gives rows (joint, theta, S, eta, alpha, a), ``bodies`` mass, centre and inertia on the axes of a
    link, with six numbers xx yy zz xy xz yz. Of a rod with idle spin only zz counts.
    """

    values: Callable[[], Values]
    table: Callable
    bodies: Callable
    time: float
    gravity: tuple[str, str, str] = ("0", "0", "0")
    begin: str = "0"
    idle: tuple[int, ...] = ()
    #: Power of loads by parameters, and rates of variables; force on the first link by parameters.
    power: Callable = lambda v, rates: mp.mpf(0)
    pushed: Callable = lambda v: {}
    #: Recorded joint forces, by link and joint, and +1 where the link is the one behind the joint.
    forces: tuple[tuple[str, int, int], ...] = field(default=())
    #: Changes of the shipped scene, and units of the parameters that are not tunable there.
    units: dict[str, str] = field(default_factory=dict)


def times(one, two):
    return [[mp.fdot(row, column) for column in zip(*two, strict=True)] for row in one]


def turned(rows, vector):
    return [mp.fdot(row, vector) for row in rows]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(*vectors):
    return [mp.fsum(parts) for parts in zip(*vectors, strict=True)]


def scaled(factor, vector):
    return [factor * x for x in vector]


UNIT = [[mp.mpf(int(i == j)) for j in range(3)] for i in range(3)]


def frames(table):
    """Rotation and place of the frames before every row, and of the last."""
    turn, place = UNIT, [mp.mpf(0)] * 3
    found = [(turn, place)]
    for _, theta, shift, eta, alpha, a in table:
        (c, s), (d, e), (g, h) = ((mp.cos(x), mp.sin(x)) for x in (theta, eta, alpha))
        own = times(times([[c, -s, 0], [s, c, 0], [0, 0, 1]], [[d, 0, e], [0, 1, 0], [-e, 0, d]]),
                    [[1, 0, 0], [0, g, -h], [0, h, g]])  # fmt: skip
        step = [a * own[0][0], a * own[1][0], a * own[2][0] + shift]
        place = plus(place, turned(turn, step))
        turn = times(turn, own)
        found.append((turn, place))
    return found


class Motion:
    """The motion of a case, assembled from the guess of its pose at the time of the case."""

    def __init__(self, case: Case, values: Values, guess: dict[str, float]) -> None:
        self.case, self.own, self.t = case, values, mp.mpf(case.time)
        self.names = [name for name in guess if name != "theta1"]
        self.near = [mp.mpf(guess[name]) for name in self.names]
        n, h = len(self.names), mp.mpf("1e-30")
        for _ in range(4):  # the last slopes are kept
            at = self._open(values, self.t, self.near)
            slopes = mp.matrix(12, n)
            for j in range(n):
                moved = [x + h * (i == j) for i, x in enumerate(self.near)]
                for i, x in enumerate(self._open(values, self.t, moved)):
                    slopes[i, j] = (x - at[i]) / h
            self.inverse = mp.inverse(slopes.T * slopes) * slopes.T
            self.near = [*(mp.matrix(self.near) - self.inverse * mp.matrix(at))]

    def _variables(self, values, t, q):
        return {"theta1": mp.mpf(self.case.begin) * mp.pi / 180 + values["speed"] * t} | dict(
            zip(self.names, q, strict=True)
        )

    def _open(self, values, t, q):
        turn, place = frames(self.case.table(values, self._variables(values, t, q)))[-1]
        return [
            x - u for row, unit in zip(turn, UNIT, strict=True) for x, u in zip(row, unit, strict=True)
        ] + place

    def pose(self, values, t):
        q = mp.matrix(self.near)
        for _ in range(9):
            q -= self.inverse * mp.matrix(self._open(values, t, [*q]))
        left = max(abs(x) for x in self._open(values, t, [*q]))
        assert left < mp.mpf("1e-50"), f"the loop is open by {mp.nstr(left, 3)}"
        variables = self._variables(values, t, [*q])
        return variables, frames(self.case.table(values, variables))

    def outputs(self, values):
        """Values, rates and accelerations of variables, the effort of the drive and joint forces, by name."""
        steps = range(-4, 5)
        poses = {k: self.pose(values, self.t + k * LATER) for k in steps}
        bodies = self.case.bodies(values)

        def rate(of, k):
            parts = [
                scaled(w / (12 * LATER), of(k + d)) for d, w in zip(range(-2, 3), WEIGHTS, strict=True) if w
            ]
            return plus(*parts)

        def centre(i):
            return lambda k: plus(poses[k][1][i][1], turned(poses[k][1][i][0], bodies[i][1]))

        def spin(i, k):
            turn = poses[k][1][i][0]
            if i in self.case.idle:
                line = lambda k: [row[0] for row in poses[k][1][i][0]]  # noqa: E731
                return cross(line(k), rate(line, k))
            moved = [rate(lambda k, j=j: [row[j] for row in poses[k][1][i][0]], k) for j in range(3)]
            whole = times([[*x] for x in zip(*moved, strict=True)], [[*x] for x in zip(*turn, strict=True)])
            return [whole[2][1], whole[0][2], whole[1][0]]

        def momenta(i):
            def of(k):
                mass, _, (xx, yy, zz, xy, xz, yz) = bodies[i]
                turn, w = poses[k][1][i][0], spin(i, k)
                back = [[*x] for x in zip(*turn, strict=True)]
                own = scaled(zz, w)
                if i not in self.case.idle:
                    inertia = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
                    own = turned(turn, turned(inertia, turned(back, w)))
                p = scaled(mass, rate(centre(i), k))
                return p + plus(own, cross(centre(i)(k), p))

            return of

        variables = poses[0][0]
        moving = lambda k: [*poses[k][0].values()]  # noqa: E731
        rates = rate(moving, 0)
        second = rate(lambda k: rate(moving, k), 0)
        found = dict(variables)
        found |= {f"{name}.rate": x for name, x in zip(variables, rates, strict=True)}
        found |= {f"{name}.acceleration": x for name, x in zip(variables, second, strict=True)}
        gravity = [mp.mpf(x) for x in self.case.gravity]
        nets, power = {}, -self.case.power(values, dict(zip(variables, rates, strict=True)))
        for i, (mass, _, _) in bodies.items():
            net = rate(momenta(i), 0)
            loads = plus(scaled(mass, gravity), self.case.pushed(values).get(i, [mp.mpf(0)] * 3))
            at = centre(i)(0)
            force, moment = plus(net[:3], scaled(-1, loads)), plus(net[3:], scaled(-1, cross(at, loads)))
            nets[i] = force, moment
            w, v = spin(i, 0), rate(centre(i), 0)
            power += mp.fdot(force, v) + mp.fdot(plus(moment, scaled(-1, cross(at, force))), w)
        found["theta1.drive"] = power / values["speed"]
        return found | self._forces(values, poses[0], nets)

    def _forces(self, values, pose, nets):
        """Forces at joints: the last one's wrench is chosen so that no joint transmits along its freedoms."""
        if not self.case.forces:
            return {}
        variables, placed = pose
        table = self.case.table(values, variables)
        zero = [mp.mpf(0)] * 3

        def behind(joint):
            force, moment = zero, zero
            for i, net in nets.items():
                if i >= joint:
                    force, moment = plus(force, net[0]), plus(moment, net[1])
            return force, moment

        rows, right = [], []
        for joint, (kind, _, shift, *_) in enumerate(table[1:], 2):
            turn, place = placed[joint - 1]
            axis = [row[2] for row in turn]
            at = plus(place, scaled(shift, axis))
            known = behind(joint)
            directions = {"R": [axis], "C": [axis], "S": UNIT}[kind]
            conditions = [(cross(at, d), d) for d in directions]  # force and moment by which power is zero
            conditions += [(axis, zero)] if kind == "C" else []
            for by_force, by_moment in conditions:
                rows.append([*by_force, *by_moment])
                right.append(-mp.fdot(by_force, known[0]) - mp.fdot(by_moment, known[1]))
        matrix = mp.matrix(rows)
        last = mp.lu_solve(matrix.T * matrix, matrix.T * mp.matrix(right))
        found = {}
        for link, joint, sign in self.case.forces:
            back = [[*x] for x in zip(*placed[joint - 1][0], strict=True)]
            force = scaled(sign, turned(back, plus(behind(joint)[0], [*last][:3])))
            found |= {f"{link}.joint{joint}.force.{c}": x for c, x in zip("xyz", force, strict=True)}
        return found

    def slopes(self, names):
        """Outputs by name, and their derivatives by parameters (outputs, parameters)."""
        columns = []
        for name in names:
            h = STEP * abs(self.own[name])
            high, low = (self.outputs(self.own | {name: self.own[name] + e}) for e in (h, -h))
            columns.append([float((high[x] - low[x]) / (2 * h)) for x in high])
        return {name: float(x) for name, x in self.outputs(self.own).items()}, np.array(columns).T


def rod(mass, length, more=0):
    """Mass, centre and inertia of a slender rod behind its far end."""
    inertia = mass * length**2 / 12
    return mass, [-length / 2, mp.mpf(0), mp.mpf(0)], (mp.mpf(0), inertia, inertia + more, *[mp.mpf(0)] * 3)


def _degrees(**angles):
    return {name: mp.mpf(x) * mp.pi / 180 for name, x in angles.items()}


def _rpm(x):
    return mp.mpf(x) * 2 * mp.pi / 60


def _numbers(**values):
    return {name: mp.mpf(x) for name, x in values.items()}


def _bennett():
    return _numbers(size="0.2", line="0.8") | _degrees(short=40, long=100) | {"speed": _rpm(60)}


def _bennett_table(v, q):
    b, c = v["size"] * mp.sin(v["short"]), v["size"] * mp.sin(v["long"])
    sides = (("short", b), ("long", c)) * 2
    return [("R", q[f"theta{i + 1}"], 0, 0, v[angle], a) for i, (angle, a) in enumerate(sides)]


def _bennett_bodies(v):
    b, c = v["size"] * mp.sin(v["short"]), v["size"] * mp.sin(v["long"])
    return {i: rod(v["line"] * x, x) for i, x in ((1, b), (2, c), (3, b))}


def _bricard():
    return _numbers(a="0.1", m="0.06") | _degrees(alpha=90) | {"speed": _rpm(30)}


def _cardan():
    return _numbers(load="0.05", J_in="0.002", J_cross="0.0002", J_out="0.004") | _degrees(beta=30) | {
        "speed": _rpm(600)
    }  # fmt: skip


def _cardan_table(v, q):
    angles = [mp.pi / 2] * 3 + [v["beta"]]
    return [("R", q[f"theta{i + 1}"], 0, 0, alpha, 0) for i, alpha in enumerate(angles)]


def _cardan_bodies(v):
    none = [mp.mpf(0)] * 3
    sizes = (("1.5", "J_in", 1), ("0.3", "J_cross", 2), ("2.5", "J_out", 1))
    return {
        i: (mp.mpf(m), none, (v[j], v[j], x * v[j], 0, 0, 0)) for i, (m, j, x) in enumerate(sizes, 1)
    }  # fmt: skip


def _rccc():
    lengths = _numbers(a1="0.02", a2="0.04", a3="0.03", a4="0.05")
    return lengths | _degrees(alpha1=30, alpha2=55, alpha3=45, alpha4=60) | {"speed": _rpm(60)}


def _rccc_table(v, q):
    return [
        ("RCCC"[i - 1], q[f"theta{i}"], q.get(f"S{i}", 0), 0, v[f"alpha{i}"], v[f"a{i}"]) for i in range(1, 5)
    ]


def _rccc_bodies(v):
    of = (
        ("0.04", "0", ("1e-5", "2e-5", "2e-5", "0", "0", "0")),
        ("0.08", "0", ("2e-5", "12e-5", "11e-5", "0", "1e-5", "0")),
        ("0.06", "0.01", ("3e-5", "7e-5", "6e-5", "0", "0", "0")),
    )
    return {
        i: (mp.mpf(m), [-v[f"a{i}"] / 2, mp.mpf(0), mp.mpf(z)], tuple(map(mp.mpf, j)))
        for i, (m, z, j) in enumerate(of, 1)
    }


def _rssr():
    sizes = _numbers(
        crank="0.1", rod="0.45", rocker="0.3", distance="0.35", rise="0.1", line="1.2", radius="0.008"
    )
    return sizes | _degrees(twist=60) | {"speed": _rpm(120)}


def _rssr_table(v, q):
    return [
        ("R", q["theta1"], 0, 0, 0, v["crank"]),
        ("S", q["theta2"], 0, q["eta2"], 0, v["rod"]),
        ("S", q["theta3"], 0, q["eta3"], q["alpha3"], v["rocker"]),
        ("R", q["theta4"], v["rise"], 0, v["twist"], -v["distance"]),
    ]


def _rssr_bodies(v):
    mass = v["line"] * v["rod"]
    return {
        1: rod(v["line"] * v["crank"], v["crank"]),
        2: rod(mass, v["rod"], mass * v["radius"] ** 2 / 4),
        3: rod(v["line"] * v["rocker"], v["rocker"]),
    }


def _screw_jack():
    return _numbers(lead="0.006", weight="4000") | {"speed": _rpm(90)}


def _screw_jack_table(v, q):
    lift = -v["lead"] / (2 * mp.pi) * q["theta2"]
    return [("R", q["theta1"], 0, 0, 0, 0), ("H", q["theta2"], lift, 0, 0, 0), ("P", 0, q["S3"], 0, 0, 0)]


def _screw_jack_bodies(v):
    none = [mp.mpf(0)] * 3
    return {
        1: (mp.mpf(2), none, tuple(map(mp.mpf, ("0.01", "0.01", "0.0004", "0", "0", "0")))),
        2: (mp.mpf(1), none, tuple(map(mp.mpf, ("0.001", "0.001", "0.001", "0", "0", "0")))),
    }


def _planar_4r():
    return _numbers(unit="0.05", density="1") | {"speed": _rpm(60)}


def _planar_4r_lengths(v):
    return [x * v["unit"] for x in (2, 7, 6, -8)]


CASES = {
    "bennett": Case(
        _bennett, _bennett_table, _bennett_bodies, 0.2,
        units={"size": "0.2 m", "line": "0.8 kg/m", "short": "40 deg", "long": "100 deg"},
    ),
    "bricard": Case(
        _bricard,
        lambda v, q: [
            ("R", q[f"theta{i}"], 0, 0, v["alpha"] * (-1) ** (i + 1), v["a"]) for i in range(1, 7)
        ],
        lambda v: {i: rod(v["m"], v["a"]) for i in range(1, 6)}, 0.4, begin="-100",
        units={"a": "0.1 m", "m": "0.06 kg", "alpha": "90 deg"},
    ),
    "cardan": Case(
        _cardan, _cardan_table, _cardan_bodies, 0.013,
        power=lambda v, rates: -v["load"] * rates["theta4"] ** 2,
        units={"J_in": "0.002 kg*m^2", "J_cross": "0.0002 kg*m^2", "J_out": "0.004 kg*m^2"},
    ),
    "planar_4r": Case(
        _planar_4r,
        lambda v, q: [
            ("R", q[f"theta{i}"], 0, 0, 0, x) for i, x in enumerate(_planar_4r_lengths(v), 1)
        ],
        lambda v: {i: rod(v["density"] * x, x) for i, x in enumerate(_planar_4r_lengths(v)[:3], 1)}, 0.13,
        gravity=("0", "-9.81", "0"), units={"unit": "5 cm", "density": "1 kg/m"},
    ),
    "rccc": Case(
        _rccc, _rccc_table, _rccc_bodies, 0.13, gravity=("0", "-9.81", "0"),
        forces=(("input", 2, -1), ("output", 3, 1)),
        units={f"a{i}": f"{x} m" for i, x in enumerate(("0.02", "0.04", "0.03", "0.05"), 1)}
        | {f"alpha{i}": f"{x} deg" for i, x in enumerate((30, 55, 45, 60), 1)},
    ),
    "rssr": Case(
        _rssr, _rssr_table, _rssr_bodies, 0.13, gravity=("0", "0", "-9.81"), idle=(2,),
        forces=(("rod", 2, 1), ("rocker", 3, 1), ("rocker", 4, -1)),
        units={"crank": "0.1 m", "rod": "0.45 m", "rocker": "0.3 m", "distance": "0.35 m", "rise": "0.1 m",
               "line": "1.2 kg/m", "radius": "0.008 m"},
    ),
    "screw_jack": Case(
        _screw_jack, _screw_jack_table, _screw_jack_bodies, 0.3, gravity=("0", "0", "-9.81"),
        pushed=lambda v: {2: [mp.mpf(0), mp.mpf(0), -v["weight"]]},
    ),
}  # fmt: skip
