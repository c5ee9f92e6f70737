"""The elastic four-bar by plain NumPy: an independent reference for everything that symgen says of it.

Written from the equations alone, in ft, slug, s, lbf and rad. A link's local equation is
``M s'' - 2 w A s' + (K - w^2 M - al A + KG) s = Q`` in its own turning axes, per element, with the element's own
origin. What joins the links is ``s = R(t) S``: the directions of the links, or with links of constant length
also the linkage's velocity ratio. All that the change of unknowns does follows from R, R' and R''.
Every array has the crank angles as its first axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

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


def over(one, two):
    (n, dn, ddn), (d, dd, ddd) = one, two
    g = n / d
    dg = (dn - g * dd) / d
    return g, dg, (ddn - 2 * dg * dd - g * ddd) / d


def sine(angle):
    a, w, al = angle
    return np.sin(a), w * np.cos(a), al * np.cos(a) - w**2 * np.sin(a)


def cosine(angle):
    a, w, al = angle
    return np.cos(a), -w * np.sin(a), -al * np.sin(a) - w**2 * np.cos(a)


def minus(one, two=None):
    if two is None:
        return tuple(-x for x in one)
    return tuple(x - y for x, y in zip(one, two, strict=True))


def joined(total, R, local, constant):
    """Add to M, C, K, Q what mass s'' + damping s' + stiffness s = load gives with s = R S."""
    mass, damping, stiffness, load = local
    R0, R1, R2 = R if not constant else (R[0], 0 * R[0], 0 * R[0])
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
    """The linkage with elastic links about its rigid motion.

    ``crank`` is held, free or rigid; ``form`` exact, or thesis where everything that turns is differentiated as
    a constant (one element a link); ``axial`` whether links change their length; ``elements`` a link.
    """

    bar: FourBar = RIG
    crank: str = "held"
    geometric: bool = True
    form: str = "exact"
    axial: bool = True
    elements: int = 1

    @cached_property
    def unknowns(self) -> tuple[str, ...]:
        """Names: of joints, then of nodes of links; a node's u and w are in the axes of the link."""
        n, names = self.elements, []
        joints = ("A", "B") if self.crank != "rigid" else ("B",)
        if self.axial:
            names += [f"{j}.{axis}" for j in joints for axis in "xy"]
        elif self.crank != "rigid":
            names += ["p"]
        for link in LINKS[(self.crank == "rigid") :]:
            for node in range(n + 1):
                inner = 0 < node < n
                names += [f"{link}.u{node}"] if inner and self.axial else []
                names += [f"{link}.w{node}"] if inner else []
                held = link == "crank" and node == 0 and self.crank == "held"
                names += [] if held else [f"{link}.th{node}"]
                names += [f"{link}.k{node}"] if inner or (link == "crank" and node == 0) else []
        return tuple(names)

    def maps(self, motion: Motion):
        """Return for each node of each link how u, w, th, k follow from the unknowns, as series of matrices."""
        where = {name: i for i, name in enumerate(self.unknowns)}
        size, n, count = len(where), self.elements, len(motion.t1)
        one = (np.ones(count), np.zeros(count), np.zeros(count))
        th = [(motion.directions[k], motion.rates[k], motion.accelerations[k]) for k in range(3)]
        ratio = over(
            sine(minus(th[1], th[0])), sine(minus(th[1], th[2]))
        )  # of B's path to A's: -g, th3 turned
        ends = {0: ("M", "A"), 1: ("A", "B"), 2: ("B", "Q")}

        def joint(name, k):
            """Displacement of a joint along and across link k: pairs of unknown and series."""
            c, s = cosine(th[k]), sine(th[k])
            if self.axial and f"{name}.x" in where:
                x, y = where[f"{name}.x"], where[f"{name}.y"]
                return [(x, c), (y, s)], [(x, minus(s)), (y, c)]
            if not self.axial and "p" in where and name in "AB":
                # A moves across the crank, B across the output
                of = th[0] if name == "A" else th[2]
                much = one if name == "A" else ratio
                across = minus(th[k], of)
                return [(where["p"], times(much, sine(across)))], [(where["p"], times(much, cosine(across)))]
            return [], []

        result = np.zeros(
            (3, 3, n + 1, count, 4, size), motion.type
        )  # derivative, link, node, time, dof, unknown
        for k, link in enumerate(LINKS):
            for node in range(n + 1):
                inner = 0 < node < n
                if inner and link == "crank" and self.crank == "rigid":
                    continue
                if not inner:
                    u, w = joint(ends[k][node > 0], k)
                else:
                    u = [(where[f"{link}.u{node}"], one)] if self.axial else joint(ends[k][0], k)[0]
                    w = [(where[f"{link}.w{node}"], one)]
                entries = [(0, i, s) for i, s in u] + [(1, i, s) for i, s in w]
                entries += [
                    (r, where[x], one)
                    for r, x in ((2, f"{link}.th{node}"), (3, f"{link}.k{node}"))
                    if x in where
                ]
                for row, column, series in entries:
                    for order in range(3):
                        result[order, k, node, :, row, column] = series[order]
        return result

    def at(self, crank, rest: bool = False):
        """Return M, C, K, Q at crank angles; at rest without all that comes of the motion."""
        motion = self.bar.motion(crank)
        count, n, maps = len(motion.t1), self.elements, self.maps(motion)
        total = [0.0, 0.0, 0.0, 0.0]
        constant = rest or self.form == "thesis"
        for k in range(self.crank == "rigid", 3):
            for i in range(n):
                R = np.moveaxis(maps[:, k, [i, i + 1]], 1, 2).reshape(3, count, 8, -1)
                total = joined(total, R, self.element(motion, k, i, rest), constant)
        for k, acceleration in enumerate((motion.aA, motion.aB)):
            if k == 0 and self.crank == "rigid":
                continue
            heavy = np.broadcast_to(self.bar.bearing * np.eye(2), (count, 2, 2))
            local = heavy, 0 * heavy, 0 * heavy, -self.bar.bearing * acceleration
            total = joined(total, self.fixed(maps[:, k, n, :, :2], motion, k), local, constant)
        return total

    def element(self, motion: Motion, k: int, i: int, rest: bool):
        """Return the local mass, damping, stiffness and load of element i of link k."""
        bar, length = self.bar, motion.lengths[k] / self.elements
        element, start, e = Element(length), i * length, unit(motion.directions[k])
        rate, acceleration = motion.rates[k][:, None], motion.accelerations[k][:, None]
        origin_x = dot(motion.origins[k], e)[:, None]
        origin_y = dot(motion.origins[k], left(e))[:, None]
        x = element.points * length
        along = -(origin_x - rate**2 * start) + rate**2 * x
        across = -(origin_y + acceleration * start) - acceleration * x
        shape_u, shape_w, slope = element.rows(element.u), element.rows(element.w), element.rows(element.w, 1)
        load = bar.m * (element.over(shape_u, weight=along) + element.over(shape_w, weight=across))
        mass = np.broadcast_to(bar.m * element.mass, (len(motion.t1), 8, 8))
        turn, stiffness = bar.m * element.antisymmetric, element.stiffness(bar.EA, bar.EI)
        if rest:
            return mass, 0 * mass, stiffness, load
        rate, acceleration = rate[..., None], acceleration[..., None]
        stiffness = stiffness - rate**2 * mass - acceleration * turn
        if self.geometric:
            at = start + x
            pull = -dot(motion.forces["first"][k], e)[:, None]
            force = pull + bar.m * origin_x * at - bar.m * rate[..., 0] ** 2 * at**2 / 2
            stiffness = stiffness + element.over(slope, slope, force)
        return mass, -2 * rate * turn, stiffness, load

    def fixed(self, maps, motion: Motion, k: int):
        """Turn series of rows along and across link k into fixed axes."""
        th = (motion.directions[k], motion.rates[k], motion.accelerations[k])
        c, s = ([part[:, None] for part in series] for series in (cosine(th), sine(th)))
        u, w = maps[..., 0, :], maps[..., 1, :]
        x = minus(times(c, u), times(s, w))
        y = tuple(p + q for p, q in zip(times(s, u), times(c, w), strict=True))
        return np.stack([np.stack(x), np.stack(y)], axis=-2)

    def strain_rows(self, crank, at: float = 0.5):
        """Return rows whose product with S is bending strain and axial strain, each (links, times, unknowns)."""
        motion = self.bar.motion(crank)
        maps, n = self.maps(motion)[0], self.elements
        i = min(int(at * n), n - 1)
        bending, axial = [], []
        for k in range(3):
            element = Element(motion.lengths[k] / n)
            local = np.moveaxis(maps[k, [i, i + 1]], 0, 1).reshape(len(motion.t1), 8, -1)
            bending.append(self.bar.half * element.row(element.w, at * n - i, 2) @ local)
            axial.append(element.row(element.u, at * n - i, 1) @ local)
        return np.stack(bending), np.stack(axial)

    def frequencies(self, crank: float):
        """Natural frequencies [Hz] of the structure frozen in its pose, at rest."""
        from scipy.linalg import eigh

        M, _, K, _ = self.at(crank, rest=True)
        squares = eigh(K[0], M[0], eigvals_only=True)
        return np.sqrt(np.maximum(squares, 0.0)) / (2 * math.pi)

    def quasi_static(self, crank):
        """Bending and axial strain at mid-length of what balances the loads by stiffness alone, in 1e-6."""
        _, _, K, Q = self.at(crank, rest=True)
        S = np.linalg.solve(K, Q[..., None])[..., 0]
        return tuple(MICRO * np.einsum("ktn,tn->kt", rows, S) for rows in self.strain_rows(crank))

    def steps(self, count: int, stages: int = 4):
        """Propagators [[Phi, phi], [0, 1]] of (S, S', 1) over equal steps of one turn, by Gauss collocation."""
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

    def transient(self, count: int, stages: int = 4, start=None):
        """Strains in 1e-6 over one turn at count + 1 equal angles, by default from rest; and all y."""
        y = np.zeros((count + 1, 2 * len(self.unknowns) + 1))
        y[0, -1] = 1.0
        if start is not None:
            y[0, :-1] = start
        for i, step in enumerate(self.steps(count, stages)):
            y[i + 1] = step @ y[i]
        rows, _ = self.strain_rows(np.linspace(0, 2 * math.pi, count + 1))
        return MICRO * np.einsum("ktn,tn->kt", rows, y[:, : len(self.unknowns)]), y

    def turn(self, count: int, stages: int = 4):
        """Propagator over a whole turn."""
        whole = np.eye(2 * len(self.unknowns) + 1)
        for step in self.steps(count, stages):
            whole = step @ whole
        return whole

    def multipliers(self, count: int, stages: int = 4):
        """Floquet multipliers over one turn of the crank, the largest first."""
        found = np.linalg.eigvals(self.turn(count, stages)[:-1, :-1])
        return found[np.argsort(-abs(found))]

    def periodic(self, count: int, stages: int = 4):
        """Initial (S, S') of the motion that repeats every turn."""
        whole = self.turn(count, stages)
        return np.linalg.solve(np.eye(len(whole) - 1) - whole[:-1, :-1], whole[:-1, -1])


def gauss(stages: int):
    """Points, weights and inner weights of Gauss collocation on 0..1."""
    points, weights = leggauss(stages)
    points, weights = (points + 1) / 2, weights / 2
    powers = np.arange(stages)
    vander = points[:, None] ** powers
    integrals = points[:, None] ** (powers + 1) / (powers + 1)
    return points, weights, integrals @ np.linalg.inv(vander)


def stiff_limit(bar: FourBar, count: int = 4096):
    """Floquet multipliers of the rigid linkage with a crank that nothing holds: I d'' + I' w d' + I'' w^2 d/2 = 0."""
    angles = np.arange(512) * 2 * math.pi / 512
    series = np.fft.rfft(bar.motion(angles).inertia) / 512
    orders = np.arange(len(series))
    points, weights, inner = gauss(4)
    h = 2 * math.pi / count
    at = (np.arange(count)[:, None] + points) * h  # per unit of angle: I d'' + I' d' + I''/2 d = 0

    def inertia(derivative):
        factor = np.where(orders == 0, 1, 2) * series * (1j * orders) ** derivative
        return (np.exp(1j * at[..., None] * orders) @ factor).real

    A = np.zeros((*at.shape, 2, 2))
    A[..., 0, 1] = 1
    A[..., 1, 0] = -inertia(2) / (2 * inertia(0))
    A[..., 1, 1] = -inertia(1) / inertia(0)
    s = len(points)
    matrix = np.eye(2 * s) - h * np.einsum("ij,njab->niajb", inner, A).reshape(count, 2 * s, 2 * s)
    Y = np.linalg.solve(matrix, np.tile(np.eye(2), (s, 1))[None]).reshape(count, s, 2, 2)
    whole = np.eye(2)
    for step in np.eye(2) + h * np.einsum("i,niab,nibc->nac", weights, A, Y):
        whole = step @ whole
    found = np.linalg.eigvals(whole)
    return found[np.argsort(-abs(found))]
