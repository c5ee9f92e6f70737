"""The equations of an elastic motion, assembled densely from the rigid motion of ``elastic_linkages``.

Taken from symgen are only the constant matrices of the links in their own axes and the names of the unknowns.
Axes of a link, s = B(t) S, and constraints, S = R(t) p, are differentiated twice by time and substituted in
M s'' + C s' + K s = Q.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import mpmath
import numpy as np
from mpmath import mp, mpf
from numpy.polynomial.legendre import leggauss
from shared.elastic_linkages import DIGITS, STEP, Bar, Instant, Linkage


@dataclass(frozen=True)
class Case:
    """A linkage and the type of its crank: ``held``, ``free``, or driven by torque(angle, rate)."""

    linkage: Linkage
    mode: str = "held"
    torque: Callable | None = None
    flywheel: float = 0.0

    @property
    def crank(self) -> Bar:
        return self.linkage.bar(self.linkage.crank)


def gradient(function, q):
    """Central differences by all coordinates, a row of mp numbers."""
    found = []
    for i in range(len(q)):
        up, down = list(q), list(q)
        up[i], down[i] = q[i] + STEP, q[i] - STEP
        found.append((function(up) - function(down)) / (2 * STEP))
    return found


class Joints:
    """Coordinates of all moving points, constraints, masses and forces that are not of elastic links."""

    def __init__(self, case: Case, instant: Instant | None = None) -> None:
        self.case, self.linkage, self.instant = case, case.linkage, instant
        self.points = [p for p in case.linkage.places(mpf(0)) if p not in case.linkage.ground]
        self.names = [f"{p}.{axis}" for p in self.points for axis in "xy"]
        self.place = {p: 2 * i for i, p in enumerate(self.points)}
        self.fixed = {p: xy for p, xy in case.linkage.places(mpf(0)).items() if p in case.linkage.ground}

    def xy(self, q, p):
        return (q[self.place[p]], q[self.place[p] + 1]) if p in self.place else self.fixed[p]

    def length(self, q, a, b):
        (ax, ay), (bx, by) = self.xy(q, a), self.xy(q, b)
        return mp.sqrt((bx - ax) ** 2 + (by - ay) ** 2)

    def gap(self, q, bar, s, p, k):
        """Distance of a joint from its place on a bar, along an axis [m]."""
        return self.xy(q, p)[k] - (1 - s) * self.xy(q, bar.a)[k] - s * self.xy(q, bar.b)[k]

    def angle(self, q, bar):
        (ax, ay), (bx, by) = self.xy(q, bar.a), self.xy(q, bar.b)
        return mp.atan2(by - ay, bx - ax)

    def constraints(self):
        """Name, function of q, and whether the elastic motion keeps it."""
        for b in self.linkage.bars:
            yield b.name, (lambda q, b=b: self.length(q, b.a, b.b)), not (b.elastic and b.axial)
            for s, p in b.joints:
                for k in range(2):
                    yield (
                        f"{b.name} {p} {k}",
                        (lambda q, b=b, s=s, p=p, k=k: self.gap(q, b, s, p, k)),
                        not b.elastic,
                    )
        for p, n in self.linkage.guided.items():
            yield p, (lambda q, p=p, n=n: sum(k * x for k, x in zip(n, self.xy(q, p), strict=True))), True
        crank = self.case.crank
        yield "drive", lambda q: self.angle(q, crank), self.case.mode == "held" and not crank.elastic

    def jacobian(self, q, all_of_them=False):
        return mp.matrix([gradient(f, q) for _, f, kept in self.constraints() if kept or all_of_them] or 1)

    def mass(self, elastic: bool):
        """Constant mass matrix of rigid bars and particles; with ``elastic`` of the elastic links too."""
        found = np.zeros((len(self.names), len(self.names)))

        def add(shares, mass):
            for p, a in shares.items():
                for other, b in shares.items():
                    if p in self.place and other in self.place:
                        for k in range(2):
                            found[self.place[p] + k, self.place[other] + k] += mass * a * b

        for b in self.linkage.bars:
            if elastic or not b.elastic:
                length = float(self.length(self.start, b.a, b.b))
                add({b.a: 0.5, b.b: 0.5}, b.mass)
                add({b.a: -1 / length, b.b: 1 / length}, b.inertia + b.disc)
                for s, lump in b.lumps:
                    add({b.a: 1 - s, b.b: s}, lump)
        for p, mass in self.linkage.particles.items():
            add({p: 1.0}, mass)
        return found

    @property
    def start(self):
        with mpmath.workdps(DIGITS):
            return [x for p in self.points for x in self.linkage.places(mpf(0))[p]]

    def force(self, q, u, elastic: bool):
        """Applied forces by place and rate; with ``elastic`` including those on elastic links."""
        found = [mpf(0)] * len(q)

        def add(p, f, share=1.0):
            if p in self.place:
                for k in range(2):
                    found[self.place[p] + k] += share * f[k]

        for b in self.linkage.bars:
            if elastic or not b.elastic:
                weights = [((0.5), b.mass), *b.lumps]
                loads = [(s, [m * g for g in self.linkage.gravity]) for s, m in weights] + list(b.forces)
                for s, f in loads:
                    add(b.a, f, 1 - s)
                    add(b.b, f, s)
        for p, mass in self.linkage.particles.items():
            add(p, [mass * g for g in self.linkage.gravity])
        for torsion in self.linkage.torsions if elastic else ():
            for name, sign in torsion.rotations():
                bar = self.linkage.bar(name)
                (ax, ay), (bx, by) = self.xy(q, bar.a), self.xy(q, bar.b)
                dx, dy = bx - ax, by - ay
                couple = sign * self.instant.torque(torsion) / (dx * dx + dy * dy)
                add(bar.b, (-dy * couple, dx * couple))
                add(bar.a, (dy * couple, -dx * couple))
        rates = list(u)
        for spring in self.linkage.springs:
            (ax, ay), (bx, by) = self.xy(q, spring.a), self.xy(q, spring.b)
            (vx, vy), (wx, wy) = self.rates(rates, spring.a), self.rates(rates, spring.b)
            length = mp.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
            e = (bx - ax) / length, (by - ay) / length
            pull = spring.stiffness * (length - spring.length)
            pull += spring.damping * (e[0] * (wx - vx) + e[1] * (wy - vy))
            add(spring.a, [pull * x for x in e])
            add(spring.b, [-pull * x for x in e])
        crank = self.case.crank
        if self.case.torque and not crank.elastic and not elastic:
            (ax, ay), (bx, by) = self.xy(q, crank.a), self.xy(q, crank.b)
            (vx, vy), (wx, wy) = self.rates(rates, crank.a), self.rates(rates, crank.b)
            dx, dy, squared = bx - ax, by - ay, (bx - ax) ** 2 + (by - ay) ** 2
            rate = (dx * (wy - vy) - dy * (wx - vx)) / squared
            couple = self.case.torque(mp.atan2(dy, dx), rate) / squared
            add(crank.b, (-dy * couple, dx * couple))
            add(crank.a, (dy * couple, -dx * couple))
        return found

    def rates(self, u, p):
        return (u[self.place[p]], u[self.place[p] + 1]) if p in self.place else (mpf(0), mpf(0))


def floats(matrix):
    return np.array(matrix.tolist(), dtype=float)


def local(beam):
    """The sum of a link's pieces, by the names of the matrices."""
    n = len(beam.dofs)
    found = {}
    for name in ("mass", "centrifugal", "gyroscopic", "stiffness", "damping"):
        found[name] = np.zeros((n, n))
        for piece in beam.pieces:
            found[name][np.ix_(piece.at, piece.at)] += getattr(piece, name)
    for name in ("load_x", "load_y", "load_out", "load_turn"):
        found[name] = np.zeros(n)
        for piece in beam.pieces:
            found[name][list(piece.at)] += getattr(piece, name)
    return found


def stiffening(beam, bar: Bar, pull, along, rate, e, joints):
    """The integral of N w' w'^T, with N from the balance of the part before x; ``joints`` are (fraction, force)."""
    length, m = beam.properties.length, bar.mass / beam.properties.length
    points, weights = leggauss(10)
    breaks = {beam.info.node(k) for k in range(beam.info.elements + 1)}
    breaks = sorted(breaks | {s for s, _ in (*bar.lumps, *bar.forces, *joints)})
    total = np.zeros((len(beam.dofs), len(beam.dofs)))
    for left, right in pairwise(breaks):
        fractions = (left + right) / 2 + points * (right - left) / 2
        x = fractions * length
        force = pull + m * (along * x - rate**2 * x**2 / 2)
        force += sum(mass * (along - rate**2 * s * length) for s, mass in bar.lumps if s <= left)
        force -= sum(e @ np.array(f) for s, f in (*bar.forces, *joints) if s <= left)
        slopes = beam.table(fractions)["slope"]
        total += np.einsum("k,ki,kj->ij", force * weights * (right - left) / 2 * length, slopes, slopes)
    return total


def places(case: Case, beam):
    """Global unknown of each unknown of a link: its name, a point with its axis, or None if it is held."""
    bar = case.linkage.bar(beam.info.link)
    nodes = [beam.info.node(k) for k in range(beam.info.elements + 1)]
    joints = {}
    for s, p in bar.points:
        node = int(np.argmin(np.abs(np.array(nodes) - s)))
        joints |= {f"{axis}@{node + 1}": (p, k) for k, axis in enumerate("uw")}
    at = {p: int(np.argmin(np.abs(np.array(nodes) - s))) for s, p in bar.points}
    turned = {(k, s.point) for s in case.linkage.torsions for k, _ in s.rotations()}
    acted = {f"theta@{at[p] + 1}": p for k, p in turned if k == bar.name}
    for i, dof in enumerate(beam.dofs):
        if dof in joints:
            yield joints[dof]
        elif dof in acted:
            yield f"{beam.info.link}.{acted[dof]}.theta"
        elif i in beam.fixed or (beam.info.link, dof, case.mode) == (case.linkage.crank, "theta@1", "held"):
            yield None
        else:
            yield f"{beam.info.link}.{dof}"


def axes(case: Case, beam, names, instant: Instant):
    """B of s = B S, with two rates."""
    e, rate, second, _ = instant.axes(case.linkage.bar(beam.info.link))
    c, s = e
    turn = np.array([[c, s], [-s, c]])
    by_angle = np.array([[-s, c], [-c, -s]])
    series = turn, rate * by_angle, second * by_angle - rate**2 * turn
    found = np.zeros((3, len(beam.dofs), len(names)))
    for i, place in enumerate(places(case, beam)):
        if isinstance(place, tuple):
            point, k = place
            if f"{point}.x" in names:
                at = [names.index(f"{point}.{axis}") for axis in "xy"]
                for order in range(3):
                    found[order, i, at] = series[order][k]
        elif place:
            found[0, i, names.index(place)] = 1.0
    return found


def put_in(basis, mass, damping, stiffness, load):
    """Transform an equation in x to y, x = basis y."""
    zero, first, second = basis
    return (
        zero.T @ mass @ zero,
        zero.T @ (2 * mass @ first + damping @ zero),
        zero.T @ (mass @ second + damping @ first + stiffness @ zero),
        zero.T @ load,
    )


def constant(basis):
    return np.array([basis[0], 0 * basis[0], 0 * basis[0]])


def equations(case: Case, beams, names, t: float, *, thesis=False, rest=False, independent=None):
    """Mass, damping, stiffness, load of the remaining unknowns, and R with two rates (None without constraints)."""
    instant, n = case.linkage.at(t), len(names)
    joints = Joints(case, instant)
    if rest:
        for table in (instant.rate, instant.second):
            table.update({p: (mpf(0), mpf(0)) for p in table})
    total = [np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)]
    for beam in beams:
        basis = axes(case, beam, names, instant)
        found = put_in(constant(basis) if thesis else basis, *of_link(case, beam, instant, rest))
        total = [a + b for a, b in zip(total, found, strict=True)]
        if beam.info.link == case.linkage.crank and case.mode != "held":
            _shaft(case, instant, total, names.index(f"{beam.info.link}.theta@1"))
    for torsion in case.linkage.torsions:
        row = np.zeros(n)
        for name, sign in torsion.rotations():
            row[names.index(f"{name}.{torsion.point}.theta")] += sign
        total[1] = total[1] + torsion.damping * np.outer(row, row)
        total[2] = total[2] + torsion.stiffness * np.outer(row, row)
        total[3] = total[3] + instant.torque(torsion) * row
    mine = [names.index(name) for name in joints.names]
    with mpmath.workdps(DIGITS):
        for whole, own in zip(total, of_joints(joints, instant, rest), strict=True):
            whole[np.ix_(*[mine] * own.ndim)] += own
        if not any(kept for *_, kept in joints.constraints()):
            return (*total, None)
        basis = allowed(joints, t, mine, n, independent)
    used = constant(basis) if thesis or rest else basis
    return (*put_in(used, *total), basis)


def of_link(case: Case, beam, instant: Instant, rest: bool):
    """Mass, damping, stiffness and load of an elastic link in its own axes."""
    m, bar = local(beam), case.linkage.bar(beam.info.link)
    e, rate, second, _ = instant.axes(bar)
    across = np.array([-e[1], e[0]])
    felt, first = (instant.felt(bar.a), instant.forces[bar.name, bar.a]) if not rest else np.zeros((2, 2))
    along, lateral, pull = e @ felt, across @ felt, -e @ first
    stiffness = m["stiffness"] - rate**2 * m["centrifugal"] - second * m["gyroscopic"]
    if not rest and beam.info.geometric_stiffness:
        joints = [(s, instant.forces[bar.name, p]) for s, p in bar.joints]
        stiffness = stiffness + stiffening(beam, bar, pull, along, rate, e, joints)
    load = rate**2 * m["load_out"] - along * m["load_x"] - lateral * m["load_y"] - second * m["load_turn"]
    for s, f in bar.forces:
        rows = beam.rows(s)
        load = load + (e @ np.array(f)) * rows.u + (across @ np.array(f)) * rows.w
    return m["mass"], m["damping"] - 2 * rate * m["gyroscopic"], stiffness, load


def _shaft(case: Case, instant: Instant, total, at: int) -> None:
    """Add flywheel and motor on the shaft of an elastic crank."""
    mass, damping, stiffness, load = total
    mass[at, at] += case.flywheel
    if case.torque:
        e, rate, *_ = instant.axes(case.crank)
        angle = mp.atan2(e[1], e[0]), mpf(rate)
        load[at] += float(case.torque(*angle))
        stiffness[at, at] -= float(mpmath.diff(case.torque, angle, (1, 0)))
        damping[at, at] -= float(mpmath.diff(case.torque, angle, (0, 1)))


def of_joints(joints: Joints, instant: Instant, rest: bool):
    """The same for rigid bars and particles, by the displacements of the joints."""
    q, u, a = (
        [x for p in joints.points for x in table[p]] for table in (instant.now, instant.rate, instant.second)
    )

    def entry(i, where):
        return lambda x: joints.force(*((x, u) if where == "q" else (q, x)), False)[i]

    by_place, by_rate = (
        floats(mp.matrix([gradient(entry(i, where), at) for i in range(len(q))]))
        for where, at in (("q", q), ("u", u))
    )
    mass, multipliers = joints.mass(False), _multipliers(joints, q, u, a)
    geometric = np.zeros(mass.shape)
    # The axial force of an elastic link is part of its geometric stiffness.
    elastic = {b.name for b in joints.linkage.bars if b.elastic}
    for name, f, kept in joints.constraints():
        if kept and not rest and name not in elastic:
            geometric += multipliers[name] * floats(mp.matrix(_hessian(f, q)))
    load = np.array([float(x) for x in joints.force(q, u, False)]) - mass @ np.array([float(x) for x in a])
    return mass, -by_rate, geometric - by_place, load


def allowed(joints: Joints, t: float, mine, n: int, independent):
    """R of S = R p with two rates, p the unknowns ``independent``."""
    moments = [
        [x for p in joints.points for x in joints.linkage.places(mpf(t) + k * STEP)[p]] for k in (-1, 0, 1)
    ]
    dependent = [j for j, i in enumerate(mine) if i not in independent]
    others = [j for j, i in enumerate(mine) if i in independent]
    before, now, after = (_followers(joints.jacobian(q), dependent, others) for q in moments)
    found = np.zeros((3, n, len(independent)))
    found[0][independent, np.arange(len(independent))] = 1.0
    block = np.ix_([mine[j] for j in dependent], [independent.index(mine[j]) for j in others])
    found[0][block] = floats(now)
    found[1][block] = floats((after - before) / (2 * STEP))
    found[2][block] = floats((after - 2 * now + before) / STEP**2)
    return found


def _followers(jacobian, dependent, others):
    """Displacements of the dependent coordinates by the others: -J_d^-1 J_o."""

    def columns(of):
        return mp.matrix([[jacobian[i, j] for j in of] for i in range(jacobian.rows)])

    return -(columns(dependent) ** -1) * columns(others)


def _hessian(function, q):
    return [gradient(lambda x, i=i: gradient(function, x)[i], q) for i in range(len(q))]


def _multipliers(joints: Joints, q, u, a):
    """Of all constraints of the rigid linkage, elastic links with their mass: J^T lambda = f - M a."""
    force = np.array([float(x) for x in joints.force(q, u, True)])
    jacobian = floats(joints.jacobian(q, all_of_them=True))
    found = np.linalg.solve(jacobian.T, force - joints.mass(True) @ np.array([float(x) for x in a]))
    return dict(zip([name for name, *_ in joints.constraints()], found, strict=True))
