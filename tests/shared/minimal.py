"""An independent model of rods and planar bodies: minimal coordinates, Kane's equations, cut loops.

Nothing of symgen is used: no particles, no point masses at joints, no length constraints. A body has a centre of
mass, a moment of inertia about it and a direction e from its start to its end. Its speeds are the components s of
the rate e' = B s in an orthonormal basis B across e (one column in the plane: the angular velocity; two in space,
regular in every direction), and e'' = B s' - |s|^2 e. A point of a body is r + L e with a constant L, so every
velocity is linear in s and every acceleration linear in s' with a known rest. Loops are cut at a joint, and the two
sides held together by multipliers: the force at the cut. All numbers are extended doubles.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Real = np.longdouble
TURN = np.array([[0, -1], [1, 0]], dtype=Real)


@dataclass(frozen=True)
class Body:
    """A rod, or a planar body: its points as (along, across) in metres in its own frame, the start at (0, 0)."""

    name: str
    points: dict[str, tuple[Real, Real]]
    mass: Real
    centre: tuple[Real, Real]
    inertia: Real

    @property
    def ends(self) -> list[str]:
        return list(self.points)[:2]

    @property
    def length(self) -> Real:
        return self.points[self.ends[1]][0]


@dataclass(frozen=True)
class Spring:
    ends: tuple[str, str]
    stiffness: Real
    slack: Real
    damping: Real


@dataclass
class Mechanism:
    """What both models describe: everything in SI units; forces and torques as functions of the time."""

    dimension: int
    ground: dict[str, np.ndarray]
    bodies: list[Body]
    gravity: np.ndarray
    masses: dict[str, Real] = field(default_factory=dict)
    springs: list[Spring] = field(default_factory=list)
    forces: list[tuple] = field(default_factory=list)  # (point, t -> force)
    torques: list[tuple] = field(default_factory=list)  # (body, against or None, t -> components)


@dataclass(frozen=True)
class Pose:
    """Position and velocity of the free roots; direction and speeds of the bodies."""

    roots: dict[str, np.ndarray]
    root_rates: dict[str, np.ndarray]
    directions: dict[str, np.ndarray]
    speeds: dict[str, np.ndarray]


@dataclass(frozen=True)
class Solution:
    accelerations: dict[str, np.ndarray]
    tensions: dict[str, Real]
    reactions: dict[str, np.ndarray]


@dataclass(frozen=True)
class Vector:
    """A vector of the motion: its value, its derivative by the speeds, and its second rate at s' = 0."""

    value: np.ndarray
    slope: np.ndarray
    rest: np.ndarray

    def __add__(self, other: Vector) -> Vector:
        return Vector(self.value + other.value, self.slope + other.slope, self.rest + other.rest)

    def __sub__(self, other: Vector) -> Vector:
        return Vector(self.value - other.value, self.slope - other.slope, self.rest - other.rest)


def solve(matrix, rhs):
    """Gaussian elimination with partial pivoting and scaled rows, in extended precision."""
    a = np.column_stack([matrix, rhs]).astype(Real)
    n = len(matrix)
    a /= np.max(np.abs(a[:, :n]), axis=1, keepdims=True)
    for k in range(n):
        p = k + int(np.argmax(np.abs(a[k:, k])))
        a[[k, p]] = a[[p, k]]
        a[k + 1 :] -= np.outer(a[k + 1 :, k] / a[k, k], a[k])
    x = np.zeros((n, a.shape[1] - n), dtype=Real)
    for k in reversed(range(n)):
        x[k] = (a[k, n:] - a[k, k + 1 : n] @ x[k + 1 :]) / a[k, k]
    return x.reshape(rhs.shape)


def across(e):
    """An orthonormal basis across a direction: turned left in the plane, any two normals in space."""
    if len(e) == 2:
        return (TURN @ e)[:, None]
    k = int(np.argmin(np.abs(e)))
    i, j = (k + 1) % 3, (k + 2) % 3
    first = np.zeros(3, dtype=Real)
    first[i], first[j] = e[j], -e[i]
    first /= np.sqrt(first @ first)
    second = [e[1] * first[2] - e[2] * first[1], e[2] * first[0] - e[0] * first[2]]
    second.append(e[0] * first[1] - e[1] * first[0])
    return np.column_stack([first, second])


def about(e):
    """The axes about which the speeds turn a body: e x b for each b of the basis across e."""
    if len(e) == 2:
        return np.ones((1, 1), dtype=Real)
    first, second = across(e).T
    return np.array([second, -first])


class Minimal:
    """The equations of one mechanism: ``solve`` gives the motion at a pose."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = m = mechanism
        self.inner: dict[str, str] = {}
        self.carried: dict[str, list[str]] = {}
        self.cuts: list[tuple[Body, str]] = []
        self.roots: list[str] = []
        self.order: list[Body] = []
        seen = set(m.ground)
        waiting = list(m.ground)
        points = [p for b in m.bodies for p in b.points]
        while True:
            while waiting:
                point = waiting.pop(0)
                for body in m.bodies:
                    if point in body.points and body.name not in self.inner:
                        others = [p for p in body.points if p != point]
                        self.inner[body.name] = point
                        self.carried[body.name] = [p for p in others if p not in seen]
                        self.cuts += [(body, p) for p in others if p in seen]
                        self.order.append(body)
                        seen.update(others)
                        waiting += self.carried[body.name]
            rest = [p for p in points if p not in seen]
            if not rest:
                break
            self.roots.append(rest[0])
            seen.add(rest[0])
            waiting = [rest[0]]
        d = m.dimension
        self.at: dict[str, slice] = {}
        for i, root in enumerate(self.roots):
            self.at[root] = slice(i * d, i * d + d)
        first = len(self.roots) * d
        for i, body in enumerate(self.order):
            self.at[body.name] = slice(first + i * (d - 1), first + (i + 1) * (d - 1))
        self.size = first + len(self.order) * (d - 1)

    @property
    def freedoms(self) -> int:
        return self.size - len(self.cuts) * self.mechanism.dimension

    # --- motion -------------------------------------------------------------------------------------------

    def _arm(self, body: Body, place, pose: Pose) -> Vector:
        """From the start of a body to a place in its frame."""
        e, s = pose.directions[body.name], pose.speeds[body.name]
        along, left = place
        turn = along * np.eye(len(e), dtype=Real) + (left * TURN if len(e) == 2 else 0)
        slope = np.zeros((len(e), self.size), dtype=Real)
        slope[:, self.at[body.name]] = turn @ across(e)
        return Vector(turn @ e, slope, -(s @ s) * (turn @ e))

    def motion(self, pose: Pose):
        """Return all points by the tree, all centres of mass, and for each cut the point of the cut body."""
        m = self.mechanism
        d = m.dimension
        still = np.zeros((d, self.size), dtype=Real), np.zeros(d, dtype=Real)
        points = {p: Vector(place, *still) for p, place in m.ground.items()}
        for root in self.roots:
            slope = np.zeros((d, self.size), dtype=Real)
            slope[:, self.at[root]] = np.eye(d)
            points[root] = Vector(pose.roots[root], slope, still[1])
        centres, own = {}, {}
        for body in self.order:
            inner = self.inner[body.name]
            start = points[inner] - self._arm(body, body.points[inner], pose)
            centres[body.name] = start + self._arm(body, body.centre, pose)
            for p in body.points:
                there = start + self._arm(body, body.points[p], pose)
                if p in self.carried[body.name]:
                    points[p] = there
                elif p != inner:
                    own[body.name, p] = there
        return points, centres, own

    def speeds(self, pose: Pose) -> np.ndarray:
        parts = [pose.root_rates[r] for r in self.roots] + [pose.speeds[b.name] for b in self.order]
        return np.concatenate(parts)

    def gaps(self, points, own):
        """The cuts: gap, its derivative by the speeds, its second rate at s' = 0."""
        d = self.mechanism.dimension
        vectors = [own[b.name, p] - points[p] for b, p in self.cuts]
        if not vectors:
            return np.zeros(0, dtype=Real), np.zeros((0, self.size), dtype=Real), np.zeros(0, dtype=Real)
        assert d == len(vectors[0].value)
        return tuple(np.concatenate([getattr(v, k) for v in vectors]) for k in ("value", "slope", "rest"))

    # --- forces -------------------------------------------------------------------------------------------

    def point_forces(self, points, speeds, t):
        """Applied force on every point: forces, springs and dampers, the weight of point masses."""
        m = self.mechanism
        force = {p: np.zeros(m.dimension, dtype=Real) for p in points}
        for p, of_time in m.forces:
            force[p] = force[p] + of_time(t)
        for p, mass in m.masses.items():
            force[p] = force[p] + mass * m.gravity
        for spring in m.springs:
            a, b = (points[p] for p in spring.ends)
            along = b.value - a.value
            length = np.sqrt(along @ along)
            e = along / length
            rate = e @ ((b.slope - a.slope) @ speeds)
            pull = (spring.stiffness * (length - spring.slack) + spring.damping * rate) * e
            force[spring.ends[0]] = force[spring.ends[0]] + pull
            force[spring.ends[1]] = force[spring.ends[1]] - pull
        return force

    def mass_matrix(self, points, centres):
        m = self.mechanism
        matrix = np.zeros((self.size, self.size), dtype=Real)
        for body in self.order:
            slope, at = centres[body.name].slope, self.at[body.name]
            matrix += body.mass * slope.T @ slope
            matrix[at, at] += body.inertia * np.eye(m.dimension - 1, dtype=Real)
        for p, mass in m.masses.items():
            matrix += mass * points[p].slope.T @ points[p].slope
        return matrix

    def solve(self, pose: Pose, t) -> Solution:
        m = self.mechanism
        points, centres, own = self.motion(pose)
        force = self.point_forces(points, self.speeds(pose), t)
        matrix = self.mass_matrix(points, centres)
        rhs = np.zeros(self.size, dtype=Real)
        for body in self.order:
            c = centres[body.name]
            rhs += body.mass * c.slope.T @ (m.gravity - c.rest)
        for p, f in force.items():
            rhs += points[p].slope.T @ (f - m.masses.get(p, Real(0)) * points[p].rest)
        for name, against, of_time in m.torques:
            rhs[self.at[name]] += about(pose.directions[name]) @ of_time(t)
            if against:
                rhs[self.at[against]] -= about(pose.directions[against]) @ of_time(t)
        _, slope, rest = self.gaps(points, own)
        k = len(rest)
        whole = np.block([[matrix, slope.T], [slope, np.zeros((k, k), dtype=Real)]])
        x = solve(whole, np.concatenate([rhs, -rest]))
        rates, held = x[: self.size], x[self.size :].reshape(-1, m.dimension)
        a = {p: v.slope @ rates + v.rest for p, v in points.items()}
        a_centre = {b: v.slope @ rates + v.rest for b, v in centres.items()}
        return self._forces(pose, a, a_centre, force, held)

    def _forces(self, pose, a, a_centre, force, held) -> Solution:
        """Return the force through each joint, by Newton's law for all bodies beyond it."""
        m = self.mechanism
        at_cut = {(b.name, p): h for (b, p), h in zip(self.cuts, held, strict=True)}

        def load(point):
            total = force[point] - m.masses.get(point, Real(0)) * a[point]
            for (_, p), h in at_cut.items():
                if p == point:
                    total = total + h
            for body in self.order:
                if self.inner[body.name] == point:
                    total = total + body.mass * (m.gravity - a_centre[body.name])
                    total = total + sum((load(p) for p in self.carried[body.name]), start=0 * total)
                    total = total - sum(h for (b, _), h in at_cut.items() if b == body.name)
            return total

        tensions = {}
        for body in self.order:
            if len(body.points) == 2 and body.centre[1] == 0:
                inner = self.inner[body.name]
                outer = next(p for p in body.points if p != inner)
                cut = (body.name, outer) in at_cut
                joint = -at_cut[body.name, outer] if cut else load(outer)
                tensions[body.name] = self._tension(body, outer, joint, pose, a)
        return Solution(a, tensions, {g: -load(g) for g in m.ground})

    def _tension(self, body, outer, joint, pose, a):
        """Return the axial force at the outer end of a rod: joint force and weight less inertia force of that end.

        With a(z) = (1 - z) a_i + z a_j along the rod, the end j moves the integral of z a(z) dm, and carries
        the weight m z_c; the end i the rest.
        """
        z = body.centre[0] / body.length
        second = (body.inertia + body.mass * body.centre[0] ** 2) / body.length**2
        first = body.mass * z
        i, j = (a[p] for p in body.ends)
        e = pose.directions[body.name]
        if outer == body.ends[1]:
            return e @ (joint + first * self.mechanism.gravity - (first - second) * i - second * j)
        rest = body.mass - first
        here = body.mass - 2 * first + second
        return -e @ (joint + rest * self.mechanism.gravity - here * i - (first - second) * j)

    # --- states -------------------------------------------------------------------------------------------

    def pose(self, positions, velocities) -> Pose:
        """Read a pose off the positions and velocities of the points."""
        directions, speeds = {}, {}
        for body in self.order:
            start, end = body.ends
            along = positions[end] - positions[start]
            e = along / np.sqrt(along @ along)
            directions[body.name] = e
            speeds[body.name] = across(e).T @ (velocities[end] - velocities[start]) / body.length
        return Pose(
            {r: positions[r] for r in self.roots}, {r: velocities[r] for r in self.roots}, directions, speeds
        )

    def closed(self, pose: Pose) -> Pose | None:
        """Close the loops from a pose near by; None when that does not converge."""
        for _ in range(30):
            points, _, own = self.motion(pose)
            gap, slope, _ = self.gaps(points, own)
            if not len(gap) or np.max(np.abs(gap)) < 1e-18:
                return pose
            step = -slope.T @ solve(slope @ slope.T, gap)
            if not np.max(np.abs(step)) < 1:
                return None
            pose = self.moved(pose, step)
        return pose if np.max(np.abs(gap)) < 1e-17 else None

    def moved(self, pose: Pose, step) -> Pose:
        directions = {}
        for body in self.order:
            e = pose.directions[body.name]
            e = e + across(e) @ step[self.at[body.name]]
            directions[body.name] = e / np.sqrt(e @ e)
        roots = {r: pose.roots[r] + step[self.at[r]] for r in self.roots}
        return Pose(roots, pose.root_rates, directions, pose.speeds)

    def moving(self, pose: Pose, speeds) -> Pose:
        """Give a pose speeds: those nearest to ``speeds`` that keep the loops closed."""
        points, _, own = self.motion(pose)
        _, slope, _ = self.gaps(points, own)
        if len(slope):
            speeds = speeds - slope.T @ solve(slope @ slope.T, slope @ speeds)
        return Pose(
            pose.roots,
            {r: speeds[self.at[r]] for r in self.roots},
            pose.directions,
            {b.name: speeds[self.at[b.name]] for b in self.order},
        )

    def condition(self, pose: Pose) -> float:
        """Condition number of the cuts' rows in the metric of the mass matrix, each row of unit size."""
        if not self.cuts:
            return 1.0
        points, centres, own = self.motion(pose)
        root = np.linalg.cholesky(self.mass_matrix(points, centres).astype(float))
        rows = np.linalg.solve(root, self.gaps(points, own)[1].T.astype(float))
        return float(np.linalg.cond(rows / np.linalg.norm(rows, axis=0)))
