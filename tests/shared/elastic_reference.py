"""The elastic four-bar with a held crank by plain NumPy, independent of symgen.

Written from the equations alone, in ft, slug, s, lbf and rad. A link is one element, whose local equation is
``M s'' - 2 w A s' + (K - w^2 M - al A + KG) s = Q`` in its own turning axes. The links are joined by
``s = R(t) S`` with the directions of the links; R, R' and R'' give all terms of the change of unknowns.
Every array has the crank angles as its first axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import leggauss
from shared.elastic_rigid import FourBar, Motion, dot, left, unit

MICRO = 1e6
RIG = FourBar()
LINKS = ("crank", "coupler", "output")


class Element:
    """The eight degrees of freedom u, w, w', w'' at both ends: linear u, quintic w; all by Gauss quadrature."""

    def __init__(self, length: float):
        self.length = L = length
        powers = np.arange(6)
        at = {
            0: lambda d: np.array([math.perm(p, d) * (1.0 if p == d else 0.0) for p in powers]),
            1: lambda d: np.array([float(math.perm(p, d)) for p in powers]),
        }
        rows = np.array([at[end](d) for end in (0, 1) for d in (0, 1, 2)])
        scale = [1, L, L * L] * 2
        hermite = [Polynomial(c * s) for c, s in zip(np.linalg.inv(rows).T, scale, strict=True)]
        none = Polynomial([0.0])
        self.w = [none, *hermite[:3], none, *hermite[3:]]
        self.u = [Polynomial([1.0, -1.0]), none, none, none, Polynomial([0.0, 1.0]), none, none, none]
        points, weights = leggauss(8)
        self.points, self.weights = (points + 1) / 2, weights * L / 2

    def row(self, of, at, derivative: int = 0):
        """Return shape functions or a derivative by x at x = at * length, shape (..., 8)."""
        polynomials = [(p.deriv(derivative) if derivative else p) for p in of]
        return np.stack([p(np.asarray(at, dtype=float)) for p in polynomials], -1) / self.length**derivative

    def over(self, one, two=None, weight=None):
        """Integrate one row, or the product of two, over the element."""
        weights = self.weights if weight is None else self.weights * weight
        if two is None:
            return np.einsum("...k,ki->...i", weights, one)
        return np.einsum("...k,ki,kj->...ij", weights, one, two)

    def rows(self, of, derivative: int = 0):
        return self.row(of, self.points, derivative)

    @cached_property
    def antisymmetric(self):
        mixed = self.over(self.rows(self.u), self.rows(self.w))
        return mixed - mixed.T

    @cached_property
    def mass(self):
        u, w = self.rows(self.u), self.rows(self.w)
        return self.over(u, u) + self.over(w, w)

    def stiffness(self, EA: float, EI: float):
        stretch, bend = self.rows(self.u, 1), self.rows(self.w, 2)
        return EA * self.over(stretch, stretch) + EI * self.over(bend, bend)


def times(*factors):
    """Multiply truncated Taylor series (value, first, second derivative)."""
    value = factors[0]
    for other in factors[1:]:
        (a, da, dda), (b, db, ddb) = value, other
        value = (a * b, da * b + a * db, dda * b + 2 * da * db + a * ddb)
    return value


def sine(angle):
    a, w, al = angle
    return np.sin(a), w * np.cos(a), al * np.cos(a) - w**2 * np.sin(a)


def cosine(angle):
    a, w, al = angle
    return np.cos(a), -w * np.sin(a), -al * np.sin(a) - w**2 * np.cos(a)


def minus(one):
    return tuple(-x for x in one)


def joined(total, R, local):
    """Add to M, C, K, Q what mass s'' + damping s' + stiffness s = load gives with s = R S."""
    mass, damping, stiffness, load = local
    R0, R1, R2 = R
    across = np.swapaxes(R0, -1, -2)
    parts = (
        mass @ R0,
        2 * mass @ R1 + damping @ R0,
        mass @ R2 + damping @ R1 + stiffness @ R0,
        load[..., None],
    )
    M, C, K, Q = (across @ part for part in parts)
    return [a + b for a, b in zip(total, (M, C, K, Q[..., 0]), strict=True)]


@dataclass(frozen=True)
class Elastic:
    """The linkage with elastic links about its rigid motion; ``geometric`` whether axial forces stiffen them."""

    bar: FourBar = RIG
    geometric: bool = True

    #: Of joints, then of ends of links: rotation th, and curvature k where it is not zero.
    unknowns: ClassVar[tuple[str, ...]] = (
        "A.x", "A.y", "B.x", "B.y", "crank.k0", "crank.th1", "coupler.th0", "coupler.th1", "output.th0", "output.th1",
    )  # fmt: skip

    def maps(self, motion: Motion):
        """Return for each end of each link how u, w, th, k follow from the unknowns, as series of matrices."""
        where = {name: i for i, name in enumerate(self.unknowns)}
        count = len(motion.t1)
        one = (np.ones(count), np.zeros(count), np.zeros(count))
        # derivative, link, end, time, dof, unknown
        result = np.zeros((3, 3, 2, count, 4, len(where)), motion.type)
        for k, (link, joints) in enumerate(zip(LINKS, ("MA", "AB", "BQ"), strict=True)):
            direction = motion.directions[k], motion.rates[k], motion.accelerations[k]
            c, s = cosine(direction), sine(direction)
            for end, joint in enumerate(joints):
                entries = [(2, f"{link}.th{end}", one), (3, f"{link}.k{end}", one)]
                entries += [(0, f"{joint}.x", c), (0, f"{joint}.y", s)]
                entries += [(1, f"{joint}.x", minus(s)), (1, f"{joint}.y", c)]
                for row, name, series in entries:
                    if name in where:
                        result[:, k, end, :, row, where[name]] = series
        return result

    def at(self, crank):
        """Return M, C, K, Q at crank angles."""
        motion = self.bar.motion(crank)
        count, maps = len(motion.t1), self.maps(motion)
        total = [0.0, 0.0, 0.0, 0.0]
        for k in range(3):
            R = np.moveaxis(maps[:, k], 1, 2).reshape(3, count, 8, -1)
            total = joined(total, R, self.element(motion, k))
        for k, acceleration in enumerate((motion.aA, motion.aB)):
            heavy = np.broadcast_to(self.bar.bearing * np.eye(2), (count, 2, 2))
            local = heavy, 0 * heavy, 0 * heavy, -self.bar.bearing * acceleration
            total = joined(total, self.fixed(maps[:, k, 1, :, :2], motion, k), local)
        return total

    def element(self, motion: Motion, k: int):
        """Return the local mass, damping, stiffness and load of link k."""
        bar, length = self.bar, motion.lengths[k]
        element, e = Element(length), unit(motion.directions[k])
        rate, acceleration = motion.rates[k][:, None], motion.accelerations[k][:, None]
        origin_x = dot(motion.origins[k], e)[:, None]
        origin_y = dot(motion.origins[k], left(e))[:, None]
        x = element.points * length
        along, across = rate**2 * x - origin_x, -origin_y - acceleration * x
        shape_u, shape_w, slope = element.rows(element.u), element.rows(element.w), element.rows(element.w, 1)
        load = bar.m * (element.over(shape_u, weight=along) + element.over(shape_w, weight=across))
        mass = np.broadcast_to(bar.m * element.mass, (len(motion.t1), 8, 8))
        turn, stiffness = bar.m * element.antisymmetric, element.stiffness(bar.EA, bar.EI)
        rate, acceleration = rate[..., None], acceleration[..., None]
        stiffness = stiffness - rate**2 * mass - acceleration * turn
        if self.geometric:
            pull = -dot(motion.forces["first"][k], e)[:, None]
            force = pull + bar.m * origin_x * x - bar.m * rate[..., 0] ** 2 * x**2 / 2
            stiffness = stiffness + element.over(slope, slope, force)
        return mass, -2 * rate * turn, stiffness, load

    def fixed(self, maps, motion: Motion, k: int):
        """Turn series of rows along and across link k into fixed axes."""
        th = (motion.directions[k], motion.rates[k], motion.accelerations[k])
        c, s = ([part[:, None] for part in series] for series in (cosine(th), sine(th)))
        u, w = maps[..., 0, :], maps[..., 1, :]
        x = tuple(p - q for p, q in zip(times(c, u), times(s, w), strict=True))
        y = tuple(p + q for p, q in zip(times(s, u), times(c, w), strict=True))
        return np.stack([np.stack(x), np.stack(y)], axis=-2)

    def strain_rows(self, crank):
        """Return rows whose product with S is bending and axial strain at mid-length (links, times, unknowns)."""
        motion = self.bar.motion(crank)
        maps = self.maps(motion)[0]
        bending, axial = [], []
        for k in range(3):
            element = Element(motion.lengths[k])
            local = np.moveaxis(maps[k], 0, 1).reshape(len(motion.t1), 8, -1)
            bending.append(self.bar.half * element.row(element.w, 0.5, 2) @ local)
            axial.append(element.row(element.u, 0.5, 1) @ local)
        return np.stack(bending), np.stack(axial)

    def steps(self, count: int, stages: int = 4):
        """Propagators [[Phi, phi], [0, 1]] of (S, S', 1) over equal steps of one revolution, by Gauss collocation."""
        points, weights, inner = gauss(stages)
        h, size = self.bar.period / count, 2 * len(self.unknowns) + 1
        result = np.empty((count, size, size))
        for first in range(0, count, 256):
            begun = np.arange(first, min(first + 256, count))
            angles = (begun[:, None] + points) * h * self.bar.speed
            A = self.first_order(angles.ravel()).reshape(len(begun), stages, size, size)
            matrix = np.eye(stages * size) - h * np.einsum("ij,njab->niajb", inner, A).reshape(
                len(begun), stages * size, stages * size
            )
            # stages Y = y + h (inner A) Y; then y1 = y + h sum w A Y
            Y = np.linalg.solve(matrix, np.tile(np.eye(size), (stages, 1))[None])
            Y = Y.reshape(len(begun), stages, size, size)
            result[begun] = np.eye(size) + h * np.einsum("i,niab,nibc->nac", weights, A, Y)
        return result

    def first_order(self, crank):
        """Return A of y' = A y with y = (S, S', 1)."""
        M, C, K, Q = self.at(crank)
        n = len(self.unknowns)
        solved = np.linalg.solve(M, np.concatenate([-K, -C, Q[..., None]], axis=-1))
        A = np.zeros((len(M), 2 * n + 1, 2 * n + 1))
        A[:, :n, n : 2 * n] = np.eye(n)
        A[:, n : 2 * n] = solved
        return A

    def transient(self, count: int, stages: int = 4):
        """Strains in 1e-6 over one revolution from rest at count + 1 equal angles; and all y."""
        y = np.zeros((count + 1, 2 * len(self.unknowns) + 1))
        y[0, -1] = 1.0
        for i, step in enumerate(self.steps(count, stages)):
            y[i + 1] = step @ y[i]
        rows, _ = self.strain_rows(np.linspace(0, 2 * math.pi, count + 1))
        return MICRO * np.einsum("ktn,tn->kt", rows, y[:, : len(self.unknowns)]), y

    def multiplier(self, count: int) -> float:
        """Magnitude of the largest Floquet multiplier over one revolution of the crank."""
        whole = np.eye(2 * len(self.unknowns) + 1)
        for step in self.steps(count):
            whole = step @ whole
        return np.abs(np.linalg.eigvals(whole[:-1, :-1])).max()


def gauss(stages: int):
    """Points, weights and inner weights of Gauss collocation on 0..1."""
    points, weights = leggauss(stages)
    points, weights = (points + 1) / 2, weights / 2
    powers = np.arange(stages)
    vander = points[:, None] ** powers
    integrals = points[:, None] ** (powers + 1) / (powers + 1)
    return points, weights, integrals @ np.linalg.inv(vander)
