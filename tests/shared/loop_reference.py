"""A loop by 4x4 matrices and numerical differentiation in 40 digits: no screw, no bracket, no binor.

Of the derivation it uses only the end of the loop from which each link is reached.
"""

from __future__ import annotations

from functools import cache

import mpmath as mp
import sympy as sp

from symgen.scene.loop.loop import ENTRIES, Loop
from symgen.scene.rods.linkage import TIME

DIGITS = 40


def turn(axis: int, angle) -> mp.matrix:
    found = mp.eye(4)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    found[j, j] = found[k, k] = mp.cos(angle)
    found[k, j] = mp.sin(angle)
    found[j, k] = -found[k, j]
    return found


def shift(axis: int, length) -> mp.matrix:
    found = mp.eye(4)
    found[axis, 3] = length
    return found


def rotation(pose: mp.matrix) -> mp.matrix:
    return pose[:3, :3]


def inverse(pose: mp.matrix) -> mp.matrix:
    found = mp.eye(4)
    found[:3, :3] = rotation(pose).T
    found[:3, 3] = -(rotation(pose).T * pose[:3, 3])
    return found


def cross(a, b) -> mp.matrix:
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def vee(matrix: mp.matrix) -> mp.matrix:
    return (
        mp.matrix([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]) / 2
    )


def moved(pose: mp.matrix, wrench) -> tuple[mp.matrix, mp.matrix]:
    """Transform a wrench to the reference frame of a pose, about the origin of that frame."""
    force, moment = (rotation(pose) * x for x in wrench)
    return force, moment + cross(pose[:3, 3], force)


class Reference:
    """One loop on the parabola q + u s + a s^2/2 through a state, by the time s from it."""

    def __init__(self, loop: Loop, values: dict, meet: int, ends: list[int]) -> None:
        self.loop, self.values = loop, values
        self.from_front = [end <= meet for end in ends]
        groups = {
            "t": [TIME.symbol],
            "q": [v.quantity.symbol for v in loop.variables],
            "u": [v.rate.symbol for v in loop.variables],
            "p": [p.quantity.symbol for p in loop.parameters],
        }
        self.symbols = [s for g in groups.values() for s in g]
        self.arguments = [mp.mpf(float(x)) for g in groups for x in values[g]]
        count = len(loop.variables)
        self.q, self.u, self.a = ([mp.mpf(float(x)) for x in values[g][:count]] for g in ("q", "u", "work"))
        self.table = sp.lambdify(
            groups["q"],
            [[getattr(r, e).xreplace(self.parameters()) for e in ENTRIES] for r in loop.rows],
            "mpmath",
        )

    def parameters(self) -> dict:
        pairs = zip(self.loop.parameters, self.values["p"], strict=True)
        return {p.quantity.symbol: sp.Float(float(x), DIGITS + 5) for p, x in pairs}

    @cache  # noqa: B019
    def number(self, expression) -> mp.mpf:
        return mp.mpmathify(sp.lambdify(self.symbols, expression, "mpmath")(*self.arguments))

    def vector(self, components) -> mp.matrix:
        return mp.matrix([self.number(c) for c in components])

    def at(self, s) -> list:
        return [q + u * s + a * s * s / 2 for q, u, a in zip(self.q, self.u, self.a, strict=True)]

    def rows_at(self, q) -> list[mp.matrix]:
        return [
            turn(2, theta) * shift(2, S) * turn(1, eta) * turn(0, alpha) * shift(0, a)
            for theta, S, eta, alpha, a in self.table(*q)
        ]

    @cache  # noqa: B019
    def rows(self, s=0) -> list[mp.matrix]:
        return self.rows_at(self.at(s))

    @cache  # noqa: B019
    def pose(self, link: int, s=0) -> mp.matrix:
        """Pose of link 1, 2, ..., reached from the same end as in the derivation."""
        rows, found = self.rows(s), mp.eye(4)
        for row in rows[:link] if self.from_front[link - 1] else rows[link:]:
            found = found * row
        return found if self.from_front[link - 1] else inverse(found)

    @staticmethod
    def rate(function, order=1):
        """A derivative at the state, entry by entry of a matrix."""
        function = cache(function)
        size = function(mp.mpf(0))
        return mp.matrix(
            size.rows, size.cols,
        ) + mp.matrix([[mp.diff(lambda s, i=i, j=j: function(s)[i, j], 0, order, h=mp.mpf(10) ** -10)
                        for j in range(size.cols)] for i in range(size.rows)])  # fmt: skip

    def angular_velocity(self, link: int, s=0) -> mp.matrix:
        """Angular velocity of the body: that of its frame without idle spin."""
        h = mp.mpf(10) ** -12
        turned = (rotation(self.pose(link, s + h)) - rotation(self.pose(link, s - h))) / (2 * h)
        w = vee(turned * rotation(self.pose(link, s)).T)
        body = self.loop.body(link - 1)
        if body is not None and body.idle:
            u = self.pose(link, s)[:3, 0]
            w = w - u * (u.T * w)[0]
        return w

    def spin(self, link: int, s=0) -> mp.matrix:
        body = self.loop.body(link - 1)
        turned = rotation(self.pose(link, s))
        inertia = mp.matrix([[self.number(x) for x in row] for row in body.inertia])
        return turned * inertia * turned.T * self.angular_velocity(link, s)

    def centre(self, link: int, s=0) -> mp.matrix:
        pose = self.pose(link, s)
        return pose[:3, 3] + rotation(pose) * self.vector(self.loop.body(link - 1).centre)

    @cache  # noqa: B019
    def net(self, link: int) -> tuple[mp.matrix, mp.matrix]:
        """Inertia wrench less gravity and loads, in the frame of the link about its origin."""
        mass = self.number(self.loop.body(link - 1).mass)
        pose, centre = self.pose(link), self.centre(link)
        force = mass * (self.rate(lambda s: self.centre(link, s), 2) - self.vector(self.loop.gravity))
        moment = self.rate(lambda s: self.spin(link, s)) + cross(centre, force)
        for load in self.loop.loads:
            if load.row == link - 1:
                given, couple = self.vector(load.force), self.vector(load.torque)
                if not load.in_ground:
                    given, couple = rotation(pose) * given, rotation(pose) * couple
                point = pose[:3, 3] + rotation(pose) * self.vector(load.at)
                force, moment = force - given, moment - couple - cross(point, given)
        return moved(inverse(pose), (force, moment))

    def joint_wrench(self, joint: int, closing=None) -> tuple[mp.matrix, mp.matrix]:
        """Joint wrench of the preceding on the following link, in the frame before the joint, about its origin."""
        rows, zero = self.rows(), mp.zeros(3, 1)
        whole, found = mp.eye(4), (zero, zero)
        for link in range(joint, len(rows)):
            whole = whole * rows[link - 1]
            found = tuple(a + b for a, b in zip(found, moved(whole, self.net(link)), strict=True))
        if closing is not None:
            found = tuple(a + b for a, b in zip(found, moved(whole * rows[-1], closing), strict=True))
        return found

    def efforts(self, closing=None) -> list[mp.mpf]:
        """Power of the joint wrenches at a unit rate of each variable, by the motion of its row."""
        rows, h = self.rows(), mp.mpf(10) ** -12
        wrenches = [self.joint_wrench(k, closing) for k in range(1, len(rows) + 1)]
        found = []
        for number in range(len(self.q)):
            total = mp.mpf(0)
            there = [[q + (d if j == number else 0) for j, q in enumerate(self.q)] for d in (h, -h)]
            moves = zip(*map(self.rows_at, there), strict=True)
            for row, (force, moment), (ahead, back) in zip(rows, wrenches, moves, strict=True):
                moving = (ahead - back) / (2 * h) * inverse(row)
                total += (force.T * moving[:3, 3])[0] + (moment.T * vee(moving[:3, :3]))[0]
            found.append(total)
        return found
