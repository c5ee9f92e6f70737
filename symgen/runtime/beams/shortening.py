"""Displacements of second degree of elastic links: links that bend or rotate are shorter, and joints move.

They keep all strains. The rigid motion works on them, which is the energy of the geometric stiffness, and
their inertia and weight need torque of the shaft.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.elements import integral
from symgen.runtime.beams.forces import RunMotion, States, local_motion, of_coordinates
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.motion import ElasticMotion

#: Steps of a difference of fourth order, its factors of the rate, and of the second rate.
_STENCIL = np.arange(-2.0, 3.0)
_FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
_SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
#: Step of the angle of the crank [rad].
_STEP = 0.01
#: Step in time, over that in which a pose is a good guess of the next: the error falls with its fourth power,
#: and was up to 3e-4 of the powers where links are rigid at 1/2.
_STRIDES = 1 / 32


@dataclass(frozen=True, slots=True)
class Shortening:
    """Displacements of second degree that keep all strains: links that bend or rotate are shorter.

    Attributes
    ----------
    bubbles
        Axial displacements of each link less those that are linear between its ends, integrated over its mass
        and over its moment about the first point [kg m, kg m^2], with two rates: (links, 2, 3, times).
    displacements
        Those of the coordinates of joints with their first and second rate, (3, times, coordinates) [m].
    by_angle
        Their slope by the angle of the crank in the rigid motion, (times, coordinates).
    unit
        Motion of the rigid linkage in which the crank rotates by one, (times, coordinates) [m].
    lifted
        Potential energy that they add, its rate, and its slope by the angle, (3, times) [J].
    shaft
        Terms of flywheel and motor on an elastic crank, (times, 4): the kernel ``shaft``. The rigid linkage
        has them as a particle and a force at the end of the crank, where shortening would work on them.
    """

    bubbles: Array
    displacements: Array
    by_angle: Array
    unit: Array
    lifted: Array
    shaft: Array

    def kinetic(self, motion: ElasticMotion, rigid: Sequence[Array]) -> tuple[Array, Array]:
        """Return the kinetic energy of the rigid motion with these rates [J], and its rate, (times,) each."""
        q, u, solutions = rigid
        _, first, second = self.displacements
        a = solutions[:, : u.shape[1]]
        rate = self._by_mass(motion, q, a, first) + self._by_mass(motion, q, u, second)
        return self._by_mass(motion, q, u, first), rate

    def torque(self, motion: ElasticMotion, rigid: Sequence[Array], times: Array) -> Array:
        """Return the torque of their inertia, weight and constraints [N m], (times,)."""
        q, u, solutions = rigid
        kernel = motion.rigid.evaluator.many_blocks("constraint_jacobian", times, q, u)
        bound = np.einsum("tij,ti->tj", kernel["constraint_jacobian"], solutions[:, u.shape[1] :])
        inertia = self._by_mass(motion, q, self.unit, self.displacements[2])
        work = np.sum(self.by_angle * bound, axis=1)
        work += self._of_shaft(motion, q, self.by_angle, solutions[:, : u.shape[1]])
        return inertia - work + self.lifted[2]

    def _by_mass(self, motion: ElasticMotion, q: Array, u: Array, v: Array) -> Array:
        """Return u^T M v of the rigid linkage without the flywheel, by kinetic energies, (times,)."""
        rigid, times = motion.rigid.evaluator, np.zeros(len(q))
        up, down = (rigid.many_blocks("energy", times, q, x)["kinetic_energy"][:, 0] for x in (u + v, u - v))
        _, u, v = self._of_crank(motion, q, u, v)
        return np.asarray((up - down) / 2 - self.shaft[:, 0] * np.sum(u * v, axis=1))

    def _of_shaft(self, motion: ElasticMotion, q: Array, u: Array, a: Array) -> Array:
        """Return the work on u of flywheel, at accelerations a, and motor in the rigid linkage, (times,)."""
        across, u, a = self._of_crank(motion, q, u, a)
        turned, faster = (np.sum(across * x, axis=1) for x in (u, a))
        inertia, _, _, load = self.shaft.T
        return np.asarray(inertia * np.sum(u * a, axis=1) - (load + inertia * faster) * turned)

    def _of_crank(self, motion: ElasticMotion, q: Array, *motions: Array) -> list[Array]:
        """Return the direction across the crank, and motions of its end over its length, (times, 2)."""
        vector, ((at, _), *_) = _along(motion, _of_rigid(motion, "positions", q, "points"), motion.info.crank)
        length = np.linalg.norm(vector, axis=1)[:, None]
        across = np.stack([-vector[:, 1], vector[:, 0]], axis=1)
        return [x / length for x in (across, *(y[:, at : at + 2] for y in motions))]


def shortening(
    motion: ElasticMotion, rigid: Sequence[Array], run: RunMotion, accelerations: Array, shaft: Array
) -> Shortening:
    """Return the displacements of second degree of a motion.

    The rigid motion works on them: this is the energy of the geometric stiffness, and it needs torque.
    """
    columns, n = of_coordinates(motion), motion.rigid.description.coordinates
    shorter, bubbles = _quadratic(motion, run, accelerations)
    q, u, a = rigid[0], rigid[1], rigid[2][:, :n]
    rates = np.zeros_like(run.displacements) if run.rates is None else run.rates
    s, v, b = (x[:, columns] for x in (run.displacements, rates, accelerations))
    unit = _displaced(motion, q, np.zeros_like(q), np.zeros_like(shorter[:, 0]), 1.0)

    def along(step: float, *rates: Array) -> Array:
        return np.tensordot([1.0, step, step**2 / 2], np.stack(rates), axes=1)

    step = motion.stride * _STRIDES if np.isfinite(motion.stride) else 1.0
    times = (step * _STENCIL).tolist()
    places = [along(t, q, u, a) for t in times]
    moved = np.stack(
        [
            _displaced(motion, place, along(t, s, v, b), along(t, *shorter.swapaxes(0, 1)))
            for t, place in zip(times, places, strict=True)
        ]
    )
    turned = [q + _STEP * k * unit for k in _STENCIL]
    at_angles = np.stack([_displaced(motion, place, s, shorter[:, 0]) for place in turned])
    second = moved[2]
    lifted = np.stack([_lifted(motion, *pair) for pair in zip(places, moved, strict=True)])
    by_angle = np.stack([_lifted(motion, place, second) for place in turned])
    return Shortening(
        bubbles,
        np.stack([second, np.tensordot(_FIRST / step, moved, 1), np.tensordot(_SECOND / step**2, moved, 1)]),
        np.tensordot(_FIRST / _STEP, at_angles, 1),
        unit,
        np.stack([lifted[2], _FIRST @ lifted / step, _FIRST @ by_angle / _STEP]),
        shaft,
    )


def _quadratic(motion: ElasticMotion, run: RunMotion, accelerations: Array) -> tuple[Array, Array]:
    """Return changes of length with their rates, (links and joints, 3, times), and the bubbles.

    Those of a joint between the ends of a link are its axial displacement from the line between the ends.
    """
    longer, between, bubbles = [], [], []
    for k, beam in enumerate(motion.beams):
        p = beam.properties
        moments = [
            integral((*(0.0,) * power, *p.mass), p.length) + sum(x.mass * x.at**power for x in beam.lumps)
            for power in range(3)
        ]
        states = local_motion(motion, run, accelerations, k)

        def shorter(name: str, *place: int, beam: Beam = beam, states: States = states) -> Array:
            """Return -s^T C s/2 with first and second rate, (3, times)."""
            shortened = np.zeros((3, len(run.times)))
            for piece in beam.pieces:
                s, v, a = (x[:, list(piece.at)] for x in states)
                matrix = getattr(piece, name)[place] if place else getattr(piece, name)
                by, rate = s @ matrix, v @ matrix
                forms = (by * s / 2, by * v, rate * v + by * a)
                shortened -= [np.sum(form, axis=1) for form in forms]
            return shortened

        whole = shorter("axial0")
        longer.append(whole)
        more = [(m - n / p.length) * whole for m, n in pairwise(moments)]
        more = [x - shorter(name) for x, name in zip(more, ("axial1", "axial2"), strict=True)]
        for i, (point, profile) in enumerate(
            zip(_joints_of(motion, k), motion.profiles(beam.info.link), strict=True)
        ):
            if point:
                off = whole * (1.0 - profile.at / p.length) - shorter("force_axial", i)
                between.append(off)
                more = [x - profile.mass * profile.at**power * off for power, x in enumerate(more)]
        bubbles.append(more)
    return np.array([*longer, *between]), np.array(bubbles)


def _joints_of(motion: ElasticMotion, k: int) -> list[str]:
    """Return the joint of each force along a link, empty for a load."""
    info = motion.info
    return [j for name, j in zip(info.loads, info.joints, strict=True) if name == info.beams[k].link]


def _displaced(motion: ElasticMotion, q: Array, s: Array, longer: Array, turned: float = 0.0) -> Array:
    """Return displacements (times, coordinates) that make links longer, and turn the crank.

    All other constraints hold to the second degree of the displacements S of linear theory. ``longer`` is
    (links and joints, times).
    """
    rigid, d = motion.rigid.evaluator, motion.rigid.description
    none = np.zeros(len(q))
    jacobian = _of_rigid(motion, "constraint_jacobian", q)
    points = _of_rigid(motion, "positions", q, "points")
    up, down = (
        rigid.many_blocks("velocity_constraints", none, q + sign * s, s)["velocity_constraints"]
        for sign in (1, -1)
    )
    sides = (down - up) / 4
    for beam, more in zip(motion.beams, longer, strict=False):
        if beam.info.link in d.constraints:  # others have both ends on the ground
            row = d.constraints.index(beam.info.link)
            vector, ((at, sign), *_) = _along(motion, points, beam.info.link)
            slope = sign * np.sum(jacobian[:, row, at : at + 2] * vector, axis=1)
            sides[:, row] = slope / np.linalg.norm(vector, axis=1) * more
    joints = [(beam.info.link, j) for k, beam in enumerate(motion.beams) for j in _joints_of(motion, k) if j]
    for (link, joint), more in zip(joints, longer[len(motion.beams) :], strict=True):
        vector, _ = _along(motion, points, link)
        for axis, part in zip(d.axes, vector.T, strict=True):
            row = d.constraints.index(f"{link}_{joint}_{axis}")
            sides[:, row] = part / np.linalg.norm(vector, axis=1) * more
    drive = d.constraints.index(f"{motion.info.crank}_drive")
    vector, places = _along(motion, points, motion.info.crank)
    jacobian[:, drive] = 0.0
    for at, sign in places:
        jacobian[:, drive, at : at + 2] = sign * np.column_stack([-vector[:, 1], vector[:, 0]])
    sides[:, drive] = turned * np.sum(vector**2, axis=1)
    if jacobian.shape[1] == jacobian.shape[2]:  # no redundant row, and the crank determines the motion
        return np.asarray(np.linalg.solve(jacobian, sides[:, :, None]), dtype=float)[:, :, 0]
    return np.einsum("tij,tj->ti", np.linalg.pinv(jacobian), sides)


def _along(motion: ElasticMotion, rows: Array, link: str) -> tuple[Array, list[tuple[int, int]]]:
    """Return the vector along a link, (times, 2) [m], and its slopes by coordinates: first of two, sign.

    ``rows`` are the positions of all points, (times, points, 2) [m].
    """
    d = motion.rigid.description
    start, end = (list(d.points).index(point) for point in d.links[link][:2])
    ends = zip(d.links[link][:2], (-1, 1), strict=True)
    places = [(2 * d.free.index(point), sign) for point, sign in ends if point in d.free]
    return rows[:, end] - rows[:, start], places


def _lifted(motion: ElasticMotion, q: Array, s: Array) -> Array:
    """Return the change of the potential energy by displacements [J], (times,)."""
    moved, still = (_of_rigid(motion, "potential_energy", x, "energy")[:, 0] for x in (q + s, q))
    return moved - still


def _of_rigid(motion: ElasticMotion, block: str, q: Array, kernel: str = "") -> Array:
    """Return a block, the same at all times, of a kernel of the rigid linkage in poses, (times, *shape)."""
    blocks = motion.rigid.evaluator.many_blocks(kernel or block, np.zeros(len(q)), q, np.zeros_like(q))
    return blocks[block]


def rows_work(
    motion: ElasticMotion, rigid: Sequence[Array], run: RunMotion, bound: Mapping[str, Array], unit: Array
) -> Array:
    """Return lambda^T J' S of the constraints of rigid links, J' by the angle of the crank [N m], (times,).

    ``bound`` is J^T lambda by constraint, (times, unknowns).
    """
    elastic = {f"{motion.info.crank}_drive", *(beam.info.link for beam in motion.beams)}
    names = [name for name in motion.constraints if name not in elastic]
    columns, work = of_coordinates(motion), np.zeros(len(run.times))
    if not names:
        return work
    joints = motion.rigid.analysis("elastic_joints")

    def rows(step: float) -> Array:
        q = rigid[0] + _STEP * step * unit
        jacobian = joints.many_blocks("joints", run.times, q, np.zeros_like(q), rigid[2])["jacobian"]
        return jacobian[:, [motion.constraints.index(name) for name in names], : len(columns)]

    at = np.stack([rows(k) for k in _STENCIL])
    slopes, now = np.tensordot(_FIRST / _STEP, at, 1), at[2]
    for i, name in enumerate(names):
        size = np.sum(bound[name][:, columns] * now[:, i], axis=1) / np.sum(now[:, i] ** 2, axis=1)
        work += size * np.sum(slopes[:, i] * run.displacements[:, columns], axis=1)
    return work
