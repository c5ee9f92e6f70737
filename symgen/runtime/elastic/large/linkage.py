"""A linkage whose elastic links are beam elements in large rotation: its equations, assembled.

The unknowns are the coordinates of the linkage's free points and, for every elastic link, positions and
rotations of its nodes; nodes at free points share their coordinates. Rigid links, guides, ends on the ground,
welds and the direction of a held crank are constraints with multipliers.
"""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime._beams import APPLIED, MOTION, Elements
from symgen.runtime.beams.elements import kernels
from symgen.runtime.beams.layout import entries_of
from symgen.runtime.elastic.large.attached import Posed, Section, direction_of, forces_along, lumps_of
from symgen.runtime.elastic.large.collocation import Moment, Pattern, Slopes, pairs_of
from symgen.runtime.elastic.large.links import BLOCK, undamped
from symgen.runtime.elastic.large.supports import Supports, divided, gravity_of, section_of
from symgen.runtime.elastic.motion import ElasticMotion

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Matrices that the kernel ``joints`` gives: M, C, K.
_SLOPES = ("mass_matrix", "damping", "stiffness")


class LargeLinkage:
    """The equations of a linkage with elastic links in large rotation: M a + ... + J^T lambda = f, Phi = 0.

    Parameters
    ----------
    motion
        The elastic motion of the linkage, whose kernels give its rigid parts.
    count
        Number of elements of each elastic link, between its ends.
    """

    def __init__(self, motion: ElasticMotion, count: int) -> None:
        _check(motion)
        d = motion.rigid.description
        self.name, self.motion, self._points = motion.rigid.name, motion, d.coordinates
        self._rigid, self._joints = motion.rigid.evaluator, motion._joints
        # Elements stretch, and welds hold their nodes: these constraints of the rigid motion are not theirs.
        elastic = {beam.info.link for beam in motion.beams} | set(motion.info.welds)
        self._names = [name for name in motion.constraints if name not in elastic]
        self._kept = [motion.constraints.index(name) for name in self._names]
        self._rows = np.array([d.constraints.index(name) for name in self._names], dtype=np.intp)
        gravity = gravity_of(motion)
        self.links, pins, self.unknowns = divided(motion, count, gravity)
        elements = np.concatenate([link.elements for link in self.links])
        properties = np.concatenate([link.properties for link in self.links])
        self._kernels = kernels(BLOCK).ADDRESSES
        self._elements = Elements(self.unknowns, elements, properties)
        damped = any(link.beam.properties.stiffness_damping for link in self.links)
        self._undamped = Elements(self.unknowns, elements, undamped(properties)) if damped else None
        self._lumps = lumps_of(motion, self.links, gravity)
        self._along = [(x, self._chord(x.link)) for x in forces_along(motion, self.links)]
        self._sections = {name: section_of(self.links, *name.split(".")) for name in motion.info.rotations}
        self._couples = [Posed(motion, self._acting(name)) for name in motion.info.rotations]
        crank = next((k for k in self.links if k.beam.info.link == motion.info.crank), None)
        self._motor: Posed | None = None
        if motion.info.mode == "motor" and crank:
            shaft = section_of(self.links, motion.info.crank, crank.beam.info.start)
            self._motor = Posed(motion, [shaft])
        of_joints = {b.name: b for b in self._joints.info("joints").blocks}
        place = {f"{p}_{axis}": 2 * k + i for k, p in enumerate(d.free) for i, axis in enumerate(d.axes)}
        place |= {f"{name}_theta": section.place for name, section in self._sections.items()}
        self._entries = {
            name: np.array(entries_of(of_joints, name, place), dtype=np.intp).reshape(-1, 2)
            for name in _SLOPES
        }
        y = motion._start[: self._points]
        found = self._rigid.blocks("constraints", 0.0, y, np.zeros_like(y)) if self._names else {}
        self._sizes = found["constraint_scale"][self._rows] if self._names else np.ones(0)
        held = crank and motion.info.mode == "held"
        self._shaft = int(crank.places[0, 2]) if crank and held else None
        self._supports = Supports(motion, self.links, pins, self._shaft, self._straight()[0])
        self.multipliers = len(self._rows) + len(self._supports.rows)
        self.scale = np.full(self.unknowns, max(link.beam.properties.length for link in self.links))
        for link in self.links:
            self.scale[link.places[:, 2]] = 1.0

    def _chord(self, number: int) -> Posed:
        """Return the calls of kernels with a link of undeformed length along the line between its ends."""
        beam = self.links[number].beam
        line = Section(beam.info.link, beam.info.start, beam.info.end, beam.properties.length)
        free = self.motion.rigid.description.free
        return Posed(self.motion, [line] if {line.start, line.end} & set(free) else [])

    def _acting(self, name: str) -> list[Section]:
        """Return the sections on whose rotations the couples on one of them depend, this one first."""
        among = (other for couple in self.motion.info.couples if name in couple for other in couple)
        return [self._sections[other] for other in dict.fromkeys((name, *among))]

    def start(self) -> Moment:
        """Return places and rates at t = 0: straight links that move as rigid ones."""
        q, v = self._straight()
        return Moment(0.0, q, v, np.zeros(self.unknowns), np.zeros(self.multipliers))

    def _straight(self) -> Array:
        """Return places and rates of straight links that move as rigid ones, (2, unknowns)."""
        y = np.asarray(self.motion._start)
        n = self._points
        q, u = y[:n], y[n:]
        found = np.zeros((2, self.unknowns))
        found[0, :n], found[1, :n] = q, u
        d = self.motion.rigid.description
        points = self._rigid.blocks("points", 0.0, q, u)
        moved = np.array([points["positions"], points["velocities"]])
        for link in self.links:
            info = link.beam.info
            first, last = (moved[:, list(d.points).index(p)] for p in (info.start, info.end))
            angle, rate = (float(x[0, 0]) for x in direction_of(*first[:, None], *last[:, None]))
            if self._shaft in link.places[:, 2]:
                angle = float(self.motion.angle_at(np.array(0.0)))
            for node, share in zip(link.places, link.nodes, strict=True):
                found[:, node[:2]] = (1 - share) * first + share * last
                found[:, node[2]] = angle, rate
        return found

    @property
    def loaded(self) -> bool:
        """Whether forces, couples or a motor act on elastic links, whose work is not accounted for."""
        return bool(self._along or self._couples or self._motor)

    def residual(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array:
        """Return M a + internal forces - f + J^T lambda, (times, unknowns), of states (times, unknowns)."""
        n = self._points
        found = self._elements.forces(self._kernels["residual"], q, v, a)
        parts = self._parts(t, q, v, a, multipliers)
        found[:, :n] -= parts["load"][:, :n]
        if len(self._rows):
            jacobian = parts["jacobian"][:, self._kept, :n]
            found[:, :n] += np.einsum("kij,ki->kj", jacobian, multipliers[:, : len(self._rows)])
        found += multipliers[:, len(self._rows) :] @ self._supports.rows
        if self._lumps:
            self._lumps.add(found, q, v, a)
        self._add_along(found, t, q, v)
        for k, (name, posed) in enumerate(zip(self._sections, self._couples, strict=True)):
            moved = posed(partial(self._ground, t), q, v)[:2]
            loads = self._joints.many_blocks("joints", t, *moved)["load"]
            found[:, self._sections[name].place] -= loads[:, n + k]
        if self._motor:
            place = self._motor.moves[0][0].place
            terms = self._shaft_terms(self._motor, t, q, v)
            found[:, place] += terms[:, 0] * a[:, place] - terms[:, 3]
        return found

    def _add_along(self, found: Array, t: Array, q: Array, v: Array) -> None:
        """Subtract the forces along links, whose kernels read links of undeformed length."""
        columns = [APPLIED.index(f"load_force_{axis}") for axis in "xy"]
        for along, posed in self._along:
            moved = posed(partial(self._ground, t), q, v)[:2]
            loads, links = (
                self.motion._motion.many_blocks(name, t, *moved)[name] for name in ("loads", "links")
            )
            force = loads.reshape(len(t), -1, len(APPLIED))[:, along.row, columns]
            along.add(found, q, links.reshape(len(t), -1, len(MOTION))[:, along.link, :2], force)

    def _shaft_terms(self, motor: Posed, t: Array, q: Array, v: Array) -> Array:
        """Return inertia, damping, stiffness and torque of a motor at its rotation, (times, 4)."""
        return self.motion._motion.many("shaft", t, *motor(partial(self._ground, t), q, v))

    def _ground(self, t: Array, point: str) -> Array:
        """Return the places of a point of the ground at times, (times, 2)."""
        y = np.broadcast_to(self.motion._start[: self._points], (len(t), self._points))
        number = self.motion.rigid.description.points.index(point)
        found: Array = self._rigid.many_blocks("points", t, y, np.zeros_like(y))["positions"][:, number]
        return found

    def rates(self, t: Array, q: Array, v: Array) -> Array:
        """Return the rates of the constraints, J v + Phi_t, (times, multipliers) [m/s, rad/s]."""
        n, found = self._points, np.zeros((len(t), self.multipliers))
        if len(self._rows):
            rows = self._rigid.many("velocity_constraints", t, q[:, :n], v[:, :n])
            found[:, : len(self._rows)] = rows[:, self._rows] / self._sizes
        found[:, len(self._rows) :] = v @ self._supports.rows.T - self._supports.values(t)[1]
        return found

    def errors(self, t: float, q: Array) -> Array:
        """Return the errors of the constraints Phi, (multipliers,) [m, rad]."""
        found, n = np.zeros(self.multipliers), self._points
        if len(self._rows):
            rows = self._rigid.blocks("constraints", t, q[:n], np.zeros(n))["constraints"]
            found[: len(self._rows)] = rows[self._rows] / self._sizes
        found[len(self._rows) :] = self._supports.rows @ q - self._supports.values(np.array([t]))[0][0]
        return found

    def slopes(self, t: float, q: Array, v: Array, a: Array, multipliers: Array) -> Slopes:
        """Return the slopes of the residual and of the constraints, over the entries of the matrix.

        Slopes of forces along links, and of couples by the lines between the ends of links, are left out.
        """
        states = q[None], v[None], a[None]
        tangents = self._elements.values(self._kernels["tangent"], 108, *states).reshape(-1, 3, 36)
        values = [[tangents[:, k].ravel()] for k in range(3)]
        time = np.array([t])
        parts = self._parts(time, *states, multipliers[None])
        extra = self._diagonal(time, *states[:2])
        for own, of, diagonal in zip(values, _SLOPES, extra, strict=True):
            own += [parts[name][0] if of == name else np.zeros(len(self._entries[name])) for name in _SLOPES]
            own.append(diagonal)
        jacobian = [self._supports.rows[np.nonzero(self._supports.rows)]]
        if len(self._rows):
            jacobian.insert(0, parts["jacobian"][0][self._kept, : self._points].ravel())
        return Slopes(*(np.concatenate(own) for own in (*values, jacobian)))

    @cached_property
    def pattern(self) -> Pattern:
        """The places of the entries of slopes."""
        pairs = [pairs_of(np.concatenate([link.elements for link in self.links]))]
        pairs += [self._entries[name].T for name in _SLOPES]
        pairs.append(np.stack([self._own, self._own]))
        rigid, (row, column) = len(self._rows), np.nonzero(self._supports.rows)
        bound = np.hstack([np.indices((rigid, self._points)).reshape(2, -1), np.stack([rigid + row, column])])
        return Pattern(np.concatenate(pairs, axis=1), bound, (self.unknowns, self.multipliers))

    def _diagonal(self, t: Array, q: Array, v: Array) -> list[Array]:
        """Return mass, damping and stiffness of masses on links and of the motor, at ``_own``."""
        found = [np.zeros(len(self._own)) for _ in _SLOPES]
        if self._lumps:
            found[0][: self._lumps.places.size] = self._lumps.diagonal.ravel()
        if self._motor:
            for own, term in zip(found, self._shaft_terms(self._motor, t, q, v)[0], strict=False):
                own[-1] = term
        return found

    @cached_property
    def _own(self) -> Indices:
        """Unknowns with entries of their own on the diagonal: masses on links, the shaft of a motor."""
        places = [self._lumps.places.ravel()] if self._lumps else []
        places += [np.array([self._motor.moves[0][0].place])] if self._motor else []
        return np.concatenate(places) if places else np.zeros(0, dtype=np.intp)

    def _parts(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> dict[str, Array]:
        """Return load, slopes and Jacobian of rigid links, particles and loads at states, by name."""
        n = self._points
        count = len(self.motion.rigid.description.constraints)
        work = np.zeros((len(t), n + count))
        work[:, :n] = a[:, :n]
        work[:, n + self._rows] = multipliers[:, : len(self._rows)] / self._sizes
        found = self._joints.many_blocks("joints", t, q[:, :n], v[:, :n], work)
        none = np.zeros((len(t), 0))
        return dict.fromkeys(_SLOPES, none) | found

    def dissipated(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return the power that the damping of links takes [W], (times,)."""
        if self._undamped is None:
            return np.zeros(len(t))
        forces = (of.forces(self._kernels["residual"], q, v, a) for of in (self._elements, self._undamped))
        found: Array = np.sum(np.subtract(*forces) * v, axis=1)
        return found

    def energies(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return kinetic, strain and potential energy [J] and the power of damping [W], (4, times)."""
        n = self._points
        found = np.sum(self._elements.values(self._kernels["energies"], 3, q, v, a), axis=1)
        if self._lumps:
            found += self._lumps.energies(q, v)
        if self._motor:
            inertia = self._shaft_terms(self._motor, t, q, v)[:, 0]
            found[:, 0] += inertia * v[:, self._motor.moves[0][0].place] ** 2 / 2
        kinetic, potential = self._joints.many("energy", t, q[:, :n], v[:, :n])[:, :2].T
        own, strain, of_weight = found.T
        return np.array([own + kinetic, strain, of_weight + potential, self.dissipated(t, q, v, a)])

    def torque(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array | None:
        """Return the torque of the shaft on the crank [N m], counter-clockwise, (times,); None if free."""
        if self._shaft is not None:
            return -multipliers[:, -1]
        if self._motor:
            return self._shaft_terms(self._motor, t, q, v)[:, 3]
        info, d, n = self.motion.info, self.motion.rigid.description, self._points
        drive = f"{info.crank}_drive"
        if drive not in self._names:
            return None
        row = self._names.index(drive)
        jacobian = self._parts(t, q, v, a, multipliers)["jacobian"]
        slopes = jacobian[:, self._kept[row], :n].reshape(len(t), -1, 2)
        shaft = next(p for p in d.links[info.crank][:2] if p not in d.free)
        arms = q[:, :n].reshape(len(t), -1, 2) - self._ground(t, shaft)[:, None]
        # The power of J^T lambda at the unit rate of the crank.
        power = np.sum(slopes[..., 1] * arms[..., 0] - slopes[..., 0] * arms[..., 1], axis=1)
        found: Array = -multipliers[:, row] * power
        return found


def _check(motion: ElasticMotion) -> None:
    """Refuse what elements in large rotation do not support."""
    name, info = motion.rigid.name, motion.info
    following = [p for beam in info.beams for p in motion.profiles(beam.link) if p.follows]
    refused = {
        "welds to rigid links": bool(info.body_welds),
        "forces that rotate with sections": bool(following),
        "couples on welds": any("." not in name for name in info.rotations),
        "loads by angles counted over revolutions": bool(motion.rigid.description.windings),
    }
    of_sections = info.welds or info.body_welds or info.rotations or any(p.is_point for p in following)
    hint = (
        "Run it by linear theory: model.simulate(), symgen simulate."
        if of_sections
        else "Run it in rods with springs between them: segments in place of elements."
    )
    for what, given in refused.items():
        if given:
            raise ModelError(f"{name}: elements in large rotation do not support {what}\n  {hint}")
