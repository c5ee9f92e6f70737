"""Frequencies and quasi-static displacements of shipped scenes with elastic links, and their derivatives.

In 40 digits; nothing is of symgen. Links are Euler-Bernoulli beams of quintic deflection and linear stretch.
Energies of polynomials are exact sums; the structure is assembled from the closed form of its pose, its modes
follow from Rayleigh quotients, and derivatives are central differences of steps of 1e-16. Displacements are
those under the inertia of the rigid motion, with geometric stiffness by its axial forces.

``python tests/shared/elastic_exact.py`` writes them to ``tests/reference/elastic_slopes.json``.
"""

from __future__ import annotations

import json
from fractions import Fraction
from math import perm
from pathlib import Path

import mpmath as mp
import numpy as np

REFERENCE = Path(__file__).parents[1] / "reference" / "elastic_slopes.json"
MODES, STEP, DIGITS = 5, mp.mpf("1e-16"), 50

with mp.workdps(DIGITS):
    INCH, POUND = mp.mpf("0.0254"), mp.mpf("4.4482216152605")
    FOOT, SLUG = 12 * INCH, POUND / (12 * INCH)
    RPM, DEGREE = 2 * mp.pi / 60, mp.pi / 180
    #: Values of parameters in SI, and the time of the pose [s].
    STRIP = {
        "speed": 373 * RPM, "a": 7 * INCH, "b": 10 * INCH, "c": 12 * INCH, "frame": 11 * INCH, "width": INCH,
        "thickness": INCH / 8, "density": mp.mpf("5.292") * SLUG / FOOT**3, "E": mp.mpf("10.3e6") * POUND / INCH**2,
        "bearing": mp.mpf("0.0040803133") * SLUG,
    }  # fmt: skip
    SLOW = 95 * RPM
    CASES = {
        "thesis_four_bar": (STRIP, 0.01),
        "thesis_rig": (STRIP | {"speed": SLOW}, 0.04),
        "elastic_four_bar": (STRIP | {"speed": SLOW, "thickness": INCH * 3 / 8}, 0.05),
        "elastic_four_bar_free": (STRIP, 0.02),
        "elastic_four_bar_motor": (STRIP | {"speed": SLOW, "flywheel": SLUG * FOOT**2 / 2}, 0.06),
        "elastic_slider_crank": (
            {"speed": 1500 * RPM, "r": mp.mpf("0.05"), "l": mp.mpf("0.2"), "thickness": mp.mpf("0.004"),
             "width": mp.mpf("0.012"), "density": mp.mpf(7850), "E": mp.mpf("210e9"), "piston": mp.mpf("0.3")},
            0.003,
        ),
        "rotating_cantilever": (
            {"speed": 120 * RPM, "length": mp.mpf(1), "thickness": mp.mpf("0.005"), "width": mp.mpf("0.05"),
             "density": mp.mpf(7850), "E": mp.mpf("210e9")},
            0.1,
        ),
    }  # fmt: skip


def _shapes():
    """Coefficients by power of x of u and w by u, w, w', w'' at both ends of a unit length."""
    rows = [[Fraction(perm(p, d) * (end or p == d)) for p in range(6)] for end in (0, 1) for d in range(3)]
    inverse = mp.matrix([[mp.mpf(int(x)) for x in row] for row in rows]) ** -1
    hermite = [[mp.nint(inverse[i, j] * 2) / 2 for i in range(6)] for j in range(6)]
    none = [mp.mpf(0)] * 6
    along, back = [mp.mpf(x) for x in (0, 1, 0, 0, 0, 0)], [mp.mpf(x) for x in (1, -1, 0, 0, 0, 0)]
    return [back, *[none] * 3, along, *[none] * 3], [none, *hermite[:3], none, *hermite[3:]]


def _product(one, two, order, power=0):
    """Integral from 0 to 1 of the product of derivatives of two polynomials, and a power of x."""
    return mp.fsum(
        one[i] * two[j] * perm(i, order) * perm(j, order) / mp.mpf(i + j - 2 * order + 1 + power)
        for i in range(order, 6)
        for j in range(order, 6)
        if one[i] and two[j]
    )


with mp.workdps(DIGITS):
    _U, _W = _shapes()
    _MASS, _STRETCH, _BEND = (
        [[sum(_product(f[i], f[j], order) for f in of) for j in range(8)] for i in range(8)]
        for of, order in (((_U, _W), 0), ((_U,), 1), ((_W,), 2))
    )
    _TENSE = [[[_product(_W[i], _W[j], 1, n) for j in range(8)] for i in range(8)] for n in range(3)]
    _ONE = [mp.mpf(x) for x in (1, 0, 0, 0, 0, 0)]
    _ALONG, _ACROSS = ([[_product(f, _ONE, 0, n) for f in of] for n in range(2)] for of in (_U, _W))
#: Power of the length in the scale of each degree of freedom.
_POWERS = (0, 0, 1, 2, 0, 0, 1, 2)


def element(length, mass, axial, bending):
    """Mass and stiffness of an element with mass per length, E A and E I."""
    scale = [length**k for k in _POWERS]
    m, k = mp.matrix(8, 8), mp.matrix(8, 8)
    for i in range(8):
        for j in range(8):
            both = scale[i] * scale[j]
            m[i, j] = mass * length * _MASS[i][j] * both
            k[i, j] = (axial / length * _STRETCH[i][j] + bending / length**3 * _BEND[i][j]) * both
    return m, k


def coriolis(length, mass):
    """Coriolis matrix of an element over twice the angular velocity of its axes: v rotated to (-w, u)."""
    scale = [length**k for k in _POWERS]
    found = mp.matrix(8, 8)
    for i in range(8):
        for j in range(8):
            turned = _product(_W[i], _U[j], 0) - _product(_U[i], _W[j], 0)
            found[i, j] = mass * length * turned * scale[i] * scale[j]
    return found


def inertia(length, number, mass, first, slope, force):
    """Geometric stiffness and load of element ``number``, by complex vectors on the axes of its link."""
    start = number * length
    at = first + start * slope
    pull = -mp.re(force) + mass * mp.re(first * start + slope * start**2 / 2)
    parts = pull, mass * length * mp.re(at), mass * length**2 / 2 * mp.re(slope)
    scale = [length**k for k in _POWERS]
    tension, load = mp.matrix(8, 8), mp.matrix(8, 1)
    for i in range(8):
        for n, x in enumerate((at, slope * length)):
            load[i] -= mass * length * scale[i] * (mp.re(x) * _ALONG[n][i] + mp.im(x) * _ACROSS[n][i])
        for j in range(8):
            tension[i, j] = (
                scale[i] * scale[j] / length * sum(p * _TENSE[n][i][j] for n, p in enumerate(parts))
            )
    return tension, load


class Structure:
    """Mass and stiffness by named unknowns; an unknown is given by name, or as factors of names."""

    def __init__(self):
        self.names, self.m, self.k, self.q = [], {}, {}, {}

    def add(self, matrix, to, places):
        """Add a matrix over unknowns, each a dictionary of factors by name."""
        for i, row in enumerate(places):
            for j, column in enumerate(places):
                for a, x in row.items():
                    for b, y in column.items():
                        to[a, b] = to.get((a, b), 0) + x * y * matrix[i, j]
        for place in places:
            self.names += [name for name in place if name not in self.names]

    def push(self, forces, places):
        """Add forces on unknowns."""
        for force, place in zip(forces, places, strict=True):
            for name, x in place.items():
                self.q[name] = self.q.get(name, 0) + x * force

    def link(self, name, start, end, direction, section, elements, first=(), last=(), moved=None):
        """Add a link: places of its ends on fixed axes, and which of theta and kappa of its ends are free.

        ``moved``: accelerations of its first point and per length, and the force on the first point.
        """
        length, width, thickness, density, modulus = section
        area = width * thickness
        parts = density * area, modulus * area, modulus * width * thickness**3 / 12
        m, k = element(length / elements, *parts)
        c, s = mp.cos(direction), mp.sin(direction)
        turned = [
            [_sum((c, x), (s, y)), _sum((-s, x), (c, y))] if ends else None
            for ends in (start, end)
            for x, y in [ends or ({}, {})]
        ]
        nodes = []
        for i in range(elements + 1):
            at = turned[0] if i == 0 else turned[1] if i == elements else None
            at = at or [{f"{name}.u{i}": 1}, {f"{name}.w{i}": 1}]
            free = first if i == 0 else last if i == elements else ("theta", "kappa")
            nodes.append(at + [{f"{name}.{x}{i}": 1} if x in free else {} for x in ("theta", "kappa")])
        for i in range(elements):
            here = nodes[i] + nodes[i + 1]
            self.add(m, self.m, here)
            self.add(k, self.k, here)
            if moved:
                tension, load = inertia(
                    length / elements, i, parts[0], *(x * mp.expj(-direction) for x in moved)
                )
                self.add(tension, self.k, here)
                self.push(load, here)

    def displacements(self, names):
        """Displacements under the forces."""
        _, k = self.matrices()
        found = mp.lu_solve(k, mp.matrix([self.q.get(name, mp.mpf(0)) for name in self.names]))
        return [found[self.names.index(name)] for name in names]

    def matrices(self):
        """Mass and stiffness."""
        n = len(self.names)
        made = mp.matrix(n, n), mp.matrix(n, n)
        for matrix, entries in zip(made, (self.m, self.k), strict=True):
            for (a, b), x in entries.items():
                matrix[self.names.index(a), self.names.index(b)] = x
        return made


def _sum(*terms):
    found = {}
    for factor, place in terms:
        for name, x in place.items():
            found[name] = found.get(name, 0) + factor * x
    return found


NOWHERE = ({}, {})


def second(f, t):
    """Second derivative by the time."""
    h = mp.mpf(10) ** -12
    return (-f(t + 2 * h) + 16 * f(t + h) - 30 * f(t) + 16 * f(t - h) - f(t - 2 * h)) / (12 * h**2)


def cross(one, two):
    """The component of the product of two vectors out of the plane."""
    return mp.im(mp.conj(one) * two)


def turning(mass, from_start, first, slope):
    """Force and moment about the first point that give a uniform link its accelerations."""
    return mass * (first + slope / 2 * abs(from_start)), mass * cross(
        from_start, first / 2 + slope * abs(from_start) / 3
    )


def of_four_bar(v, mass, places, t):
    """Accelerations and forces of crank, coupler and output link, see ``link``, and accelerations of A and B."""
    (a, b), q = places(t), v["frame"]
    aa, bb = (second(lambda t, k=k: places(t)[k], t) for k in range(2))
    m = [mass * v[x] for x in "abc"]
    linear = [(mp.mpc(0), aa / v["a"]), (aa, (bb - aa) / v["b"]), (bb, -bb / v["c"])]
    by_crank, _ = turning(m[0], a, *linear[0])
    force, moment = turning(m[1], b - a, *linear[1])
    whole, about_b = turning(m[2], q - b, *linear[2])
    about_q = about_b + cross(b - q, whole)
    # Force x on the coupler at B: (b - a) x x = moment, and on the output -x less that of the bearing.
    left = about_q + cross(b - q, v["bearing"] * bb)
    rows = [[-mp.im(b - a), mp.re(b - a)], [mp.im(b - q), -mp.re(b - q)]]
    x = mp.mpc(*mp.lu_solve(mp.matrix(rows), mp.matrix([moment, left])))
    first = by_crank + force - x + v["bearing"] * aa, force - x, -x - v["bearing"] * bb
    return [(*pair, x) for pair, x in zip(linear, first, strict=True)], (aa, bb)


def structure(scene, v, t, moving=False):
    """The structure in its pose at a time, at rest or loaded by its rigid motion."""
    made = Structure()
    section = [v[x] for x in ("width", "thickness", "density", "E")]
    mass = v["density"] * v["width"] * v["thickness"]
    angle = v["speed"] * t
    if scene == "rotating_cantilever":
        tip = ({"x": 1}, {"y": 1})
        outward = -(v["speed"] ** 2) * mp.expj(angle)
        moved = (mp.mpc(0), outward, mass * v["length"] ** 2 / 2 * outward) if moving else None
        made.link("strip", NOWHERE, tip, angle, [v["length"], *section], 4, ("kappa",), ("theta",), moved)
        return made
    if scene == "elastic_slider_crank":

        def ends(t):
            a = v["r"] * mp.expj(v["speed"] * t)
            return a, mp.re(a) + mp.sqrt(v["l"] ** 2 - mp.im(a) ** 2)

        (a, p), (aa, pp) = ends(t), (second(lambda t, k=k: ends(t)[k], t) for k in range(2))
        force, moment = turning(mass * v["l"], p - a, aa, (pp - aa) / v["l"])
        pushed = -v["piston"] * mp.re(pp)
        pushed += 1j * (moment + mp.im(p - a) * pushed) / mp.re(p - a)
        moved = (aa, (pp - aa) / v["l"], force - pushed) if moving else None
        piston = ({"P": 1}, {})
        made.link("rod", NOWHERE, piston, mp.arg(p - a), [v["l"], *section], 2, ("theta",), ("theta",), moved)
        made.add(mp.matrix([[v["piston"]]]), made.m, [{"P": 1}])
        made.push([-v["piston"] * mp.re(pp)], [{"P": 1}])
        return made

    def places(t):
        a = v["a"] * mp.expj(v["speed"] * t)
        away = v["frame"] - a
        diagonal = abs(away)
        inside = mp.acos((v["b"] ** 2 + diagonal**2 - v["c"] ** 2) / (2 * v["b"] * diagonal))
        return a, a + v["b"] * mp.expj(mp.arg(away) + inside)

    joints = {p: ({f"{p}.x": 1}, {f"{p}.y": 1}) for p in "AB"}
    if scene == "thesis_rig":
        joints["A"] = NOWHERE  # on a rigid crank that is held
    # The shaft may bear a couple, so that the curvature there is free.
    held = scene in ("thesis_four_bar", "elastic_four_bar")
    shaft = ("kappa",) if held else ("theta", "kappa")
    a, b = places(t)
    q, moved = v["frame"], [None] * 3
    if moving:
        moved, accelerations = of_four_bar(v, mass, places, t)
        for joint, x in zip("AB", accelerations, strict=True):
            made.push([-v["bearing"] * mp.re(x), -v["bearing"] * mp.im(x)], joints[joint])
    one = ("theta",)
    if joints["A"] != NOWHERE:
        made.link("crank", NOWHERE, joints["A"], angle, [v["a"], *section], 1, shaft, one, moved[0])
    made.link("coupler", *joints.values(), mp.arg(b - a), [v["b"], *section], 1, one, one, moved[1])
    made.link("output", joints["B"], NOWHERE, mp.arg(q - b), [v["c"], *section], 1, one, one, moved[2])
    for place in (x for joint in joints.values() for x in joint):
        made.add(mp.matrix([[v["bearing"]]]), made.m, [place])
    if "flywheel" in v:
        made.add(mp.matrix([[v["flywheel"]]]), made.m, [{"crank.theta0": 1}])
    return made


def squares(matrices, near):
    """Eigenvalues of K - x M from shapes near theirs, by Rayleigh quotients."""
    m, k = matrices
    found = []
    for shape in near:
        x = mp.matrix(shape)
        value = (x.T * k * x)[0] / (x.T * m * x)[0]
        for _ in range(2):
            try:
                x = mp.lu_solve(k - value * m, m * x)
            except ZeroDivisionError:
                break
            x /= mp.norm(x)
            value = (x.T * k * x)[0] / (x.T * m * x)[0]
        found.append(value)
    return found


def slopes(scene, names=None):
    """Frequencies [Hz] with strain, and their derivatives by parameters: lists by name."""
    from scipy.linalg import eigh

    values, t = CASES[scene]
    with mp.workdps(DIGITS):
        t = mp.mpf(t)
        middle = structure(scene, values, t).matrices()
        m, k = (np.array(x.tolist(), dtype=float) for x in middle)
        d = 1 / np.sqrt(np.diag(k))
        numbers, shapes = eigh(k * np.outer(d, d), m * np.outer(d, d))
        strained = numbers > 1e-9 * numbers[-1]
        near = (shapes * d[:, None]).T[strained][:MODES].tolist()
        at = squares(middle, near)
        found = {}
        for name in names or values:
            h = STEP * values[name]
            high, low = (
                squares(structure(scene, values | {name: values[name] + e}, t).matrices(), near)
                for e in (h, -h)
            )
            slopes = [(x - y) / (2 * h) for x, y in zip(high, low, strict=True)]
            found[name] = [y / (8 * mp.pi**2 * _hertz(x)) for x, y in zip(at, slopes, strict=True)]
        return [_hertz(x) for x in at], found


#: Unknowns of quasi-static displacements by their names in symgen, where the crank is held.
_OF_FOUR_BAR = {f"{p}.displacement.{axis}": f"{p}.{axis}" for p in "AB" for axis in "xy"}
OF_JOINTS = {
    "thesis_four_bar": _OF_FOUR_BAR,
    "elastic_four_bar": _OF_FOUR_BAR,
    "elastic_slider_crank": {"P.displacement.x": "P"},
    "rotating_cantilever": {"tip.displacement.x": "x", "tip.displacement.y": "y"},
}


def deflections(scene, names=None):
    """Quasi-static displacements [m] of joints, and their derivatives by parameters: lists by name."""
    values, t = CASES[scene]
    with mp.workdps(DIGITS + 30):
        t = mp.mpf(t)

        def at(v):
            return structure(scene, v, t, moving=True).displacements([*OF_JOINTS[scene].values()])

        found = {}
        for name in names or values:
            h = STEP * values[name]
            high, low = (at(values | {name: values[name] + e}) for e in (h, -h))
            found[name] = [(x - y) / (2 * h) for x, y in zip(high, low, strict=True)]
        return at(values), found


def _hertz(square):
    return mp.sqrt(square) / (2 * mp.pi)


def main():
    """Write the references."""

    def text(row):
        return [mp.nstr(x, 25) if abs(x) > 1e-25 else "0" for x in row]

    made = {
        what: {
            scene: {"values": text(values), "by": {name: text(row) for name, row in by.items()}}
            for scene in scenes
            for values, by in [of(scene)]
        }
        for what, scenes, of in (
            ("frequencies", CASES, slopes),
            ("displacements", OF_JOINTS, deflections),
        )
    }
    REFERENCE.write_text(json.dumps(made, indent=1) + "\n")


if __name__ == "__main__":
    main()
