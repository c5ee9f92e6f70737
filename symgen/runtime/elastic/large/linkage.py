"""A linkage whose elastic links are beam elements in large rotation: its equations, assembled.

The unknowns are the coordinates of the linkage's free points and, for every elastic link, positions and
rotations of its nodes; nodes at free points share their coordinates. Rigid links, guides, ends on the ground,
welds and the direction of a held crank are constraints with multipliers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from symgen.runtime._beams import APPLIED, MOTION
from symgen.runtime._constrained import Added, Elements, Part, Rigid, Ties
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.elements import kernels
from symgen.runtime.beams.layout import entries_of
from symgen.runtime.elastic.large.attached import LinkSection, Posed, bodies_on, direction_of, forces_along
from symgen.runtime.elastic.large.collocation import MotionState
from symgen.runtime.elastic.large.counted import Counted
from symgen.runtime.elastic.large.links import BLOCK
from symgen.runtime.elastic.large.states import StatesByShaft
from symgen.runtime.elastic.large.statics import RestingSystem
from symgen.runtime.elastic.large.supports import (
    Supports,
    divided,
    gravity_of,
    posed_by,
    posed_shaft,
    rotation_of,
    welds_to_bodies,
)
from symgen.runtime.elastic.motion import ElasticMotion

#: Matrices that the kernel ``joints`` gives: M, C, K.
_SLOPES = ("mass_matrix", "damping", "stiffness")
#: Difference of revolutions that is round-off.
_HALF = 1e-6
#: Change of unknowns, over their sizes, for slopes of forces on links.
_CHANGE = 1e-3
#: Unknowns by which slopes are differenced together.
_TOGETHER = 64


class LargeLinkage(RestingSystem):
    """The equations of a linkage with elastic links in large rotation: M a + ... + J^T lambda = f, Phi = 0.

    Parameters
    ----------
    motion
        The elastic motion of the linkage, whose kernels give its rigid parts.
    count
        Number of elements of each elastic link, between its ends.
    """

    shift = 1e-12

    def __init__(self, motion: ElasticMotion, count: int) -> None:
        d = motion.rigid.description
        self.motion, self.rigid, self._points = motion, motion.rigid, d.coordinates
        self._rigid, self._joints, self._loads = motion.rigid.evaluator, motion.joints, motion._motion
        # Elements stretch, and welds hold their nodes: these constraints of the rigid motion are not theirs.
        elastic = {beam.info.link for beam in motion.beams} | set(motion.info.welds)
        self._names = [name for name in motion.constraints if name not in elastic]
        self.links, pins, size = divided(motion, count, gravity_of(motion))
        self._bodies = bodies_on(motion, self.links, gravity_of(motion))
        along = forces_along(motion, self.links)
        self._along = [(x, self._chord(x.link), Counted(self._rigid)) for x in along]
        self._sections = {name: rotation_of(self.links, name) for name in motion.info.rotations}
        acted = {name for couple in motion.info.couples for name in couple}
        self._couples = [
            (k, self._sections[name], posed_by(motion, self._sections, name), Counted(self._rigid))
            for k, name in enumerate(motion.info.rotations)
            if name in acted
        ]
        crank = next((k for k in self.links if k.beam.info.link == motion.info.crank), None)
        self._motor = posed_shaft(motion, crank) if motion.info.mode == "motor" and crank else None
        self._by_shaft = StatesByShaft.of(motion, crank)
        self._counted, self._of_motor = Counted(self._rigid), Counted(self._rigid)
        of_joints = {b.name: b for b in self._joints.info("joints").blocks}
        place = {name: k for k, name in enumerate(d.of_coordinates())}
        place |= {f"{name}_theta": section.place for name, section in self._sections.items()}
        self._entries = [
            np.reshape(entries_of(of_joints, name, place), (-1, 2)).astype(np.intp) for name in _SLOPES
        ]
        (q, u), rows = np.split(motion._start, 2), [d.constraints.index(name) for name in self._names]
        blocks = self._rigid.blocks("constraints", 0.0, q, np.zeros_like(q)) if rows else {}
        self.rows, self.sizes = rows, blocks["constraint_scale"][rows] if rows else np.zeros(0)
        self._shaft = int(crank.places[0, 2]) if crank and motion.info.mode == "held" else None
        self._start = self._straight(size, q, u)
        self._supports = Supports(motion, self.links, pins, self._shaft, self._start[0])
        numbers = [motion.constraints.index(name) for name in self._names]
        self._elements = Elements(
            kernels(BLOCK).ADDRESSES,
            np.concatenate([link.elements for link in self.links]),
            np.concatenate([link.properties for link in self.links]),
            any(link.beam.properties.stiffness_damping for link in self.links),
        )
        self._rigid_parts = Rigid(self._rigid, self._joints, rows, numbers, self.sizes, self._entries)
        parts: list[Part] = [self._elements, *self._bodies, self._rigid_parts]
        supported, (row, column) = len(self._supports.rows), np.nonzero(self._supports.rows)
        # Known numbers behind the unknowns: values of supports, places of points for welds to rigid links.
        welds = welds_to_bodies(motion, self.links, self._start[0], len(rows), size + supported)
        parts += [welds] if welds else []
        welded = len(motion.info.welded_bodies)
        self._known = len(d.points) if welds else 0
        parts.append(
            Ties(
                len(rows) + welded + np.append(row, np.arange(supported)),
                np.append(column, size + np.arange(supported)),
                np.append(self._supports.rows[row, column], np.full(supported, -1.0)),
            )
        )
        if self.loaded or self._by_shaft:
            parts.append(Added(self._added, self._diagonal, self._diagonal_places(), lambda: self._power))
        scale = np.full(size, max(link.beam.properties.length for link in self.links))
        self._rotations = np.unique(np.concatenate([link.places[:, 2] for link in self.links]))
        self.states = np.arange(d.of_points, d.coordinates)
        scale[self._rotations] = scale[self.states] = 1.0
        self.translations = np.delete(np.arange(size), [*self._rotations, *self.states])
        multipliers, known = len(rows) + welded + supported, supported + 2 * self._known
        super().__init__(motion.rigid.name, parts, scale, multipliers, known)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns: ``A.x`` of a free point, ``crank.theta@1`` of the first node of a link."""
        d = self.motion.rigid.description
        found = dict(enumerate([*(f"{p}.{axis}" for p, axis in product(d.free, d.axes)), *d.integrals]))
        for link in self.links:
            for node, places in enumerate(link.places.tolist()):
                for place, axis in zip(places, ("x", "y", "theta"), strict=True):
                    found.setdefault(place, f"{link.beam.info.link}.{axis}@{node + 1}")
        return tuple(found[k] for k in range(self.unknowns))

    @property
    def constraints(self) -> tuple[str, ...]:
        """Names of the constraints: of the rigid motion, welds to rigid links, unknowns that are held."""
        names = self.names
        held = [[names[k] for k in np.argsort(-row, kind="stable") if row[k]] for row in self._supports.rows]
        welds = (f"{point} to {body}" for point, body in self.motion.info.welded_bodies)
        return *self._names, *welds, *(" - ".join(of) for of in held)

    def _chord(self, number: int) -> Posed:
        """Return the calls of kernels with a link of undeformed length along the line between its ends."""
        beam = self.links[number].beam
        line = LinkSection(beam.info.link, beam.info.start, beam.info.end, beam.properties.length)
        is_free = not {line.start, line.end}.isdisjoint(self.motion.rigid.description.free)
        return Posed(self.motion, [line] * is_free)

    def start(self) -> MotionState:
        """Return positions and rates at t = 0, of straight links with the velocities of rigid links."""
        q, v = self._start
        return MotionState(0.0, q, v, np.zeros(self.unknowns), np.zeros(self.multipliers))

    def _counts(self) -> Iterator[tuple[Counted, Posed | None]]:
        """Yield the angles in loads, each after the motion in which they are counted."""
        yield self._counted, None
        yield self._of_motor, self._motor
        yield from ((counted, posed) for _, posed, counted in self._along)
        yield from ((counted, posed) for _, _, posed, counted in self._couples)

    @property
    def follows(self) -> bool:
        """Whether loads count angles."""
        return bool(self._rigid.description.windings)

    def follow(self, t: float, q: Array, v: Array) -> None:
        """Move the references of angles in loads."""
        times, places, rates = np.array([t]), q[None], v[None]
        for counted, posed in self._counts():
            state = (
                posed(partial(self._ground, times), places, rates)[:2]
                if posed
                else (x[:, : self._points] for x in (places, rates))
            )
            if counted.follow(t, *state) and counted is self._counted:
                self.recall(t)

    def take_parameters(self, values: Array) -> None:
        """Take values of the tunable parameters, of which loads alone depend on those that change."""
        super().take_parameters(values)
        self._joints, self._loads = (kernels.with_tunable(values) for kernels in (self._joints, self._loads))
        self.recall(math.inf)

    def recall(self, t: float) -> None:
        """Take the references of angles in loads at a time of the run."""
        self._rigid_parts.take_parameters(self._counted.at(t, self._joints).parameters)

    def memory(self) -> dict[str, Array]:
        """Return the references of angles in loads, with their times."""
        if not self.follows:
            return {}
        return {str(k): counted.references for k, (counted, _) in enumerate(self._counts())}

    def restore(self, memory: Mapping[str, Array]) -> None:
        """Restore references of angles in loads; without any, count anew from within half a revolution."""
        for k, (counted, _) in enumerate(self._counts()):
            counted.restart()
            if memory:
                counted.references = memory[str(k)]
        self.recall(math.inf)

    def posed(self, t: float, q: Array, u: Array) -> MotionState:
        """Return straight links at rest in a pose of the rigid links at a time [s].

        ``q`` are its coordinates, ``u`` the rates, of which first-order states are those of the result.
        """
        places = self._straight(self.unknowns, q, np.zeros_like(q), t)[0]
        rotations, (none, rates) = self._rotations, np.zeros((2, self.unknowns))
        rates[self.states] = u[self.states]
        # Welded links turn alike from the start on, also by half a revolution.
        turned = (places[rotations] - self._start[0, rotations]) / math.tau
        places[rotations] -= math.tau * np.ceil(turned - 0.5 - _HALF)
        if self._shaft is not None:
            turned = (self.motion.angle_at(np.array(t)) - places[self._shaft]) / math.tau
            places[rotations] += math.tau * np.round(turned)
        return MotionState(t, places, rates, none, np.zeros(self.multipliers))

    def _straight(self, size: int, q: Array, u: Array, t: float = 0.0) -> Array:
        """Return positions and rates of straight links that are as rigid links at a time, (2, unknowns)."""
        n, places = self._points, np.zeros((2, size))
        places[0, :n], places[1, :n] = q, u
        d = self.motion.rigid.description
        points = self._rigid.blocks("points", t, q, u)
        moved = np.array([points["positions"], points["velocities"]])
        for link in self.links:
            info = link.beam.info
            first, last = (moved[:, list(d.points).index(p)] for p in (info.start, info.end))
            angle, rate = (float(x[0, 0]) for x in direction_of(*first[:, None], *last[:, None]))
            if self._shaft in link.places[:, 2]:
                angle = float(self.motion.angle_at(np.array(t)))
            for node, share in zip(link.places, link.nodes, strict=True):
                places[:, node[:2]] = (1 - share) * first + share * last
                places[:, node[2]] = angle, rate
        return places

    @property
    def loaded(self) -> bool:
        """Whether forces, couples or a motor act on elastic links: their potential energy is not known."""
        return bool(self._along or self._couples or self._motor)

    @property
    def accounted(self) -> bool:
        """Whether the work of everything but energies is that of the drive, damping and loads on links."""
        return self.motion.info.work_on_links

    def prescribed(self, t: Array) -> tuple[Array, Array]:
        """Return values of supports and places of the ground [m, rad], and rates, (times, numbers) each."""
        values = self._supports.values(t)
        if not self._known:
            return values
        places = self._supports.points(t)
        held, rates = (np.hstack(pair) for pair in zip(values, places, strict=True))
        return held, rates

    def _added(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return inertia of a motor less loads on links, (times, unknowns).

        ``_power`` is then the power of these loads.
        """
        n, forces = self._points, np.zeros(q.shape)
        self._add_along(forces, t, q, v)
        for k, section, posed, counted in self._couples:
            moved = posed(partial(self._ground, t), q, v)[:2]
            loads = counted.blocks(self._joints, "joints", t, *moved)["load"]
            forces[:, section.place] -= loads[:, n + k]
        if self._motor:
            place = self._motor.moves[0][0].place
            terms = self._shaft_terms(self._motor, t, q, v)
            forces[:, place] -= terms[:, 3]
        self._power = -np.sum(forces * v, axis=1)
        if self._motor:
            forces[:, place] += terms[:, 0] * a[:, place]
        if self._by_shaft:
            forces[:, self._by_shaft.places] -= self._by_shaft.rates(self._joints, self._counted, t, q, v)[0]
        return forces

    def _add_along(self, forces: Array, t: Array, q: Array, v: Array) -> None:
        """Subtract the forces along links, whose kernels read links of undeformed length."""
        columns = [APPLIED.index(f"load_force_{axis}") for axis in "xy"]
        for along, posed, counted in self._along:
            moved = posed(partial(self._ground, t), q, v)[:2]
            loads, links = (counted.blocks(self._loads, name, t, *moved)[name] for name in ("loads", "links"))
            force = loads.reshape(len(t), -1, len(APPLIED))[:, along.row, columns]
            along.add(forces, q, links.reshape(len(t), -1, len(MOTION))[:, along.link, :2], force)

    def _shaft_terms(self, motor: Posed, t: Array, q: Array, v: Array) -> Array:
        """Return inertia, damping, stiffness and torque of a motor at its rotation, (times, 4)."""
        moved = motor(partial(self._ground, t), q, v)
        return self._of_motor.many(self._loads, "shaft", t, *moved)

    def _ground(self, t: Array, point: str) -> Array:
        """Return the places of a point of the ground at times, (times, 2)."""
        y = np.broadcast_to(self.motion._start[: self._points], (len(t), self._points))
        number = self.motion.rigid.description.points.index(point)
        return self._rigid.many_blocks("points", t, y, np.zeros_like(y))["positions"][:, number]

    def _diagonal(self, t: Array, q: Array, v: Array) -> Array:
        """Return mass, damping and stiffness of a motor, and of states by its shaft, (3, places).

        Slopes of forces along links, and of couples by the lines between the ends of links, are omitted.
        """
        slopes = [np.zeros((0, 3))]
        if self._motor:
            slopes.append(self._shaft_terms(self._motor, t, q, v)[:, :3])
        if self._by_shaft:
            slopes.append(
                np.outer(self._by_shaft.rates(self._joints, self._counted, t, q, v)[1, 0], [0.0, -1.0, 0.0])
            )
        return np.concatenate(slopes).T

    def matrices(self, at: MotionState, rates: bool = True) -> tuple[Any, Any, Any]:
        """Return M, C and K with the Jacobian around each, with all slopes of forces on links.

        Slopes by places and rates are differences of the fourth order.
        """
        mass, damping, stiffness = super().matrices(at)
        if not (self.loaded or self._by_shaft):
            return mass, damping, stiffness
        damping = damping + self._differences(at, 1) if rates else damping
        return mass, damping, stiffness + self._differences(at, 0)

    def _differences(self, at: MotionState, by: int) -> Any:
        """Return slopes of forces on links by places (0) or rates (1) that are not among those of steps."""
        from scipy.sparse import csc_array

        n, size, places = self.unknowns, self.unknowns + self.multipliers, self._diagonal_places()
        t, q, v = np.array([at.t]), at.q[None], at.v[None]
        known, name = self._entries[2 - by], _SLOPES[2 - by]
        sections = np.array([section.place for section in self._sections.values()], dtype=np.intp)
        # Steps have those of motors, and of couples by the rotations of sections.
        joints = self._counted.blocks(self._joints, "joints", t, q[:, : self._points], v[:, : self._points])
        of_couples = np.isin(known[:, 0], sections)
        row, column = known[of_couples].T
        of_steps = joints[name].ravel()[of_couples] if len(known) else np.zeros(0)
        rows, columns = [places, row], [places, column]
        slopes = [-self._diagonal(t, q, v)[2 - by], -of_steps]
        shaft = self._by_shaft.shaft if self._by_shaft else places
        acting = [np.arange(self._points), sections, places, shaft]
        acting += [x.places.ravel() for x, _, _ in self._along]
        by_unknowns = np.unique(np.concatenate(acting)).astype(np.intp)
        for some in np.array_split(by_unknowns, 1 + len(by_unknowns) // _TOGETHER):
            count, change = len(some), _CHANGE * self.scale[some]
            changes = np.zeros((4, count, n))
            changes[:, np.arange(count), some] = np.outer([-2.0, -1.0, 1.0, 2.0], change)
            state = [np.broadcast_to(x, (4 * count, n)) for x in (at.q, at.v, at.a)]
            state[by] = state[by] + changes.reshape(-1, n)
            forces = self._added(np.full(4 * count, at.t), *state).reshape(changes.shape)
            by_some = (8 * (forces[2] - forces[1]) - (forces[3] - forces[0])).T / (12 * change)
            row, column = np.nonzero(by_some)
            rows.append(row)
            columns.append(some[column])
            slopes.append(by_some[row, column])
        entries = np.concatenate(slopes), (np.concatenate(rows), np.concatenate(columns))
        return csc_array(entries, shape=(size, size))

    def _diagonal_places(self) -> Indices:
        """Return the unknowns of the shaft of a motor and of states by it, with entries on the diagonal."""
        motor = [self._motor.moves[0][0].place] if self._motor else []
        return np.array([*motor, *(self._by_shaft.places if self._by_shaft else ())], dtype=np.intp)

    def energies(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return kinetic, strain and potential energy [J] and the power of damping [W], (4, times)."""
        n = self._points
        parts = self._elements, *self._bodies
        sums = sum(np.sum(part.values("energies", 4, q, v, a), axis=1) for part in parts)
        if self._motor:
            inertia = self._shaft_terms(self._motor, t, q, v)[:, 0]
            sums[:, 0] += inertia * v[:, self._motor.moves[0][0].place] ** 2 / 2
        kinetic, potential = self._counted.many(self._joints, "energy", t, q[:, :n], v[:, :n])[:, :2].T
        energy_of_motion, strain, of_weight, dissipated = sums.T
        return np.array([energy_of_motion + kinetic, strain, of_weight + potential, dissipated])

    def torque(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array | None:
        """Return the torque of the shaft on the crank [N m], counter-clockwise, (times,); None if free."""
        if self._shaft is not None:
            return -multipliers[:, -1]
        if self._motor:
            return self._shaft_terms(self._motor, t, q, v)[:, 3]
        info, d, n = self.motion.info, self.motion.rigid.description, self._points
        if f"{info.crank}_drive" not in self._names:
            return None
        row = self._names.index(f"{info.crank}_drive")
        drive = np.zeros_like(multipliers)
        drive[:, row] = multipliers[:, row]
        forces = (self.residual(t, q, v, a, m)[:, :n] for m in (drive, np.zeros_like(drive)))
        pulls = np.subtract(*forces).reshape(len(t), -1, 2)
        shaft = next(p for p in d.links[info.crank][:2] if p not in d.free)
        arms = q[:, :n].reshape(len(t), -1, 2) - self._ground(t, shaft)[:, None]
        # The power of J^T lambda at the unit rate of the crank.
        return -np.sum(pulls[..., 1] * arms[..., 0] - pulls[..., 0] * arms[..., 1], axis=1)
