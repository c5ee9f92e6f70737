"""Assembled equations of the four-bar of the thesis, written from its equations with NumPy alone.

Closure (Chapter IV), forces of rigid links, element (F.1) by integrals of the shape functions of Chapter V, assembly
(8.1) by the numbers of Fig. 21, boundary vector of Fig. 22 with the held crank. Axes rotate, as in
``docs/method_elastic.md``: T has rates. Nothing of symgen is used. Units: ft, slug, lbf, converted at the end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import leggauss

FT, LBF = 0.3048, 4.4482216152605
SLUG = LBF / FT
CRANK, COUPLER, OUTPUT, FRAME = 7 / 12, 10 / 12, 12 / 12, 11 / 12
WIDTH, THICKNESS = 1 / 12, 0.125 / 12
AREA, SECOND = WIDTH * THICKNESS, WIDTH * THICKNESS**3 / 12
MASS, YOUNG, BEARING = 5.292 * AREA, 10.3e6 * 144, 0.0040803133
SPEED = 373 * 2 * np.pi / 60
#: Unknowns of the linkage by the numbers of Fig. 20, their kind, and unknowns of each element (Fig. 21).
NUMBERS = (
    (1, 2, 3, 4, 5, 6, 7, 8),
    (5, 6, 9, 10, 11, 12, 13, 14),
    (11, 12, 15, 16, 17, 18, 19, 20),
)
BOUNDARY = (1, 2, 8, 10, 14, 16, 17, 18, 20)
HELD = 3
QUARTER = np.kron(np.eye(2), np.pad([[0.0, -1.0], [1.0, 0.0]], (0, 2)))
#: Size of the unknowns u, w, theta, kappa of a node in SI.
SIZES = np.array([FT, FT, 1.0, 1 / FT])


@dataclass(frozen=True)
class Element:
    """Matrices of an element in link axes, with unit mass per length."""

    inertia: np.ndarray
    gyroscopic: np.ndarray
    stiffness: np.ndarray
    slopes: tuple[np.ndarray, ...]  # integrals of w' w'^T times 1, x, x^2
    loads: tuple[np.ndarray, ...]  # E, G, N, L


def shapes(length: float) -> tuple[list[Polynomial], list[Polynomial]]:
    """Return u and w by the unknowns: (5.4) to (5.10), from the values at both nodes."""
    powers, rows = np.arange(6), []
    for x in (0.0, length):
        for order in range(3):
            factor = np.prod([powers - j for j in range(order)], axis=0) * np.ones(6)
            rows.append(factor * x ** np.maximum(powers - order, 0))
    quintic = np.linalg.inv(np.array(rows)).T
    w = [Polynomial(c) for c in quintic]
    none = Polynomial([0.0])
    u = [Polynomial([1.0, -1 / length]), none, none, none, Polynomial([0.0, 1 / length]), none, none, none]
    return u, [none, *w[:3], none, *w[3:]]


def element(length: float) -> Element:
    u, w = shapes(length)
    points, weights = leggauss(12)
    x, weights = length * (points + 1) / 2, length * weights / 2

    def at(fields, order=0):
        return np.array([(f.deriv(order) if order else f)(x) for f in fields])

    def integral(a, b, of=1.0):
        return np.einsum("ik,jk,k->ij", a, b, weights * of)

    nu, nw, slope, curvature, stretch = at(u), at(w), at(w, 1), at(w, 2), at(u, 1)
    coupled = integral(nu, nw)
    return Element(
        integral(nu, nu) + integral(nw, nw),
        coupled - coupled.T,
        YOUNG * (AREA * integral(stretch, stretch) + SECOND * integral(curvature, curvature)),
        tuple(integral(slope, slope, x**k) for k in range(3)),
        (nu @ weights, nw @ weights, nu @ (weights * x), nw @ (weights * x)),
    )


@dataclass(frozen=True)
class Link:
    """Direction, rates and length of a link, acceleration of its first point, axial force there."""

    direction: float
    rate: float
    second: float
    length: float
    acceleration: np.ndarray
    force: float = 0.0


def rigid_motion(theta: float) -> tuple[Link, Link, Link, tuple[np.ndarray, np.ndarray]]:
    """Return the links at a crank angle [rad], the output link from B to Q, and the accelerations of A and B."""
    a, b, c, d = CRANK, COUPLER, OUTPUT, FRAME
    first = a * np.array([np.cos(theta), np.sin(theta)])
    gap = np.array([d, 0.0]) - first
    squared = gap @ gap
    along = (b**2 - c**2 + squared) / (2 * squared)
    across = np.sqrt(b**2 / squared - along**2)
    second = first + along * gap + across * np.array([-gap[1], gap[0]])
    two = np.arctan2(*(second - first)[::-1])
    three = np.arctan2(*(second - [d, 0.0])[::-1])
    w2 = a * SPEED * np.sin(three - theta) / (b * np.sin(two - three))
    w3 = a * SPEED * np.sin(two - theta) / (c * np.sin(two - three))
    h = (
        a * SPEED**2 * np.cos(theta) + b * w2**2 * np.cos(two) - c * w3**2 * np.cos(three),
        c * np.cos(three),
        c * np.sin(three),
        -a * SPEED**2 * np.sin(theta) - b * w2**2 * np.sin(two) + c * w3**2 * np.sin(three),
        b * np.cos(two),
        b * np.sin(two),
    )
    a2 = (h[0] * h[1] - h[2] * h[3]) / (h[2] * h[4] - h[5] * h[1])
    a3 = (h[0] * h[4] - h[5] * h[3]) / (h[2] * h[4] - h[5] * h[1])
    of_a = -(SPEED**2) * first
    of_b = c * (
        a3 * np.array([-np.sin(three), np.cos(three)]) - w3**2 * np.array([np.cos(three), np.sin(three)])
    )
    still = np.zeros(2)
    links = [
        Link(theta, SPEED, 0.0, a, still),
        Link(two, w2, a2, b, of_a),
        Link(three + np.pi, w3, a3, c, of_b),
    ]
    forces = first_forces(links, ((of_a, of_b)))
    return *(
        Link(k.direction, k.rate, k.second, k.length, k.acceleration, f)
        for k, f in zip(links, forces, strict=True)
    ), (of_a, of_b)


def first_forces(links: list[Link], accelerations) -> list[float]:
    """Return the axial force of each link at its first point, tension positive, from Newton and Euler."""
    # Unknown forces on the links at M A | A B | B Q, and the torque on the crank.
    rows, right = np.zeros((13, 13)), np.zeros(13)
    for k, link in enumerate(links):
        e = np.array([np.cos(link.direction), np.sin(link.direction)])
        n = np.array([-e[1], e[0]])
        mass, half = MASS * link.length, link.length / 2
        centre = link.acceleration + half * (link.second * n - link.rate**2 * e)
        for axis in range(2):
            rows[3 * k + axis, [4 * k + axis, 4 * k + 2 + axis]] = 1.0
            right[3 * k + axis] = mass * centre[axis]
        rows[3 * k + 2, 4 * k : 4 * k + 4] = np.array([half * e[1], -half * e[0], -half * e[1], half * e[0]])
        right[3 * k + 2] = mass * link.length**2 / 12 * link.second
    rows[2, 12] = 1.0
    for joint, (first, second) in enumerate(((2, 4), (6, 8))):
        for axis in range(2):
            rows[9 + 2 * joint + axis, [first + axis, second + axis]] = 1.0
            right[9 + 2 * joint + axis] = -BEARING * accelerations[joint][axis]
    found = np.linalg.solve(rows, right)
    return [
        -(np.cos(k.direction) * found[4 * i] + np.sin(k.direction) * found[4 * i + 1])
        for i, k in enumerate(links)
    ]


def of_link(link: Link) -> dict[str, np.ndarray]:
    """Return the matrices of a link on fixed axes, S = T s with T rotating: exact form."""
    e, c, s = element(link.length), np.cos(link.direction), np.sin(link.direction)
    turn = np.kron(np.eye(2), np.pad([[c, -s], [s, c]], (0, 2)))
    turn[[2, 3, 6, 7], [2, 3, 6, 7]] = 1.0
    inertia, gyroscopic, back = MASS * e.inertia, MASS * e.gyroscopic, QUARTER.T
    along, across = (
        c * link.acceleration[0] + s * link.acceleration[1],
        c * link.acceleration[1] - s * link.acceleration[0],
    )
    w, second = link.rate, link.second
    pull = link.force * e.slopes[0] + MASS * (along * e.slopes[1] - w**2 * e.slopes[2] / 2)
    moving = -(w**2) * inertia - second * gyroscopic
    moving = moving + inertia @ (second * back + w**2 * back @ back) - 2 * w**2 * gyroscopic @ back
    load = MASS * (-along * e.loads[0] - across * e.loads[1] + w**2 * e.loads[2] - second * e.loads[3])
    return {
        "elastic_mass": turn @ inertia @ turn.T,
        "elastic_gyroscopic": 2 * w * turn @ (inertia @ back - gyroscopic) @ turn.T,
        "elastic_stiffness": turn @ e.stiffness @ turn.T,
        "elastic_geometric_stiffness": turn @ pull @ turn.T,
        "elastic_motion_stiffness": turn @ moving @ turn.T,
        "elastic_load": turn @ load,
    }


def assembly() -> np.ndarray:
    """Return Z of (8.1), 24 x 20."""
    z = np.zeros((24, 20))
    z[np.arange(24), np.ravel(NUMBERS) - 1] = 1.0
    return z


def assembled(theta: float, held: bool = True) -> dict[str, np.ndarray]:
    """Return the matrices of the linkage about constant speed, in SI units; the crank is held or free."""
    *links, accelerations = rigid_motion(theta)
    parts, z = [of_link(link) for link in links], assembly()
    free = np.array([k for k in range(20) if k + 1 not in (*BOUNDARY, *[HELD] * held)])
    size = np.zeros(20)
    size[np.ravel(NUMBERS) - 1] = np.tile(SIZES, 6)
    found = {}
    for name in parts[0]:
        if name == "elastic_load":
            total = z.T @ np.concatenate([part[name] for part in parts])
            for at, acceleration in zip((4, 10), accelerations, strict=True):
                total[at : at + 2] -= BEARING * acceleration
            found[name] = (total * LBF * FT / size)[free]
            continue
        whole = np.zeros((24, 24))
        for k, part in enumerate(parts):
            whole[8 * k : 8 * k + 8, 8 * k : 8 * k + 8] = part[name]
        total = z.T @ whole @ z
        if name == "elastic_mass":
            total[[4, 5, 10, 11], [4, 5, 10, 11]] += BEARING
        found[name] = (total * LBF * FT / np.outer(size, size))[np.ix_(free, free)]
    return found
