"""A linkage in space whose elastic links are beam elements with directors: its equations, assembled.

The unknowns are the coordinates of the linkage's free points, the positions of the inner nodes of elastic
links, and three directors of every node. Lengths of rigid links, guides, ends on the ground and the products
of directors are constraints with multipliers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime import _core
from symgen.runtime.beams.data import BeamInfo
from symgen.runtime.beams.elements import kernels
from symgen.runtime.beams.layout import entries_of
from symgen.runtime.elastic.large.collocation import Moment, Pattern, Slopes, pairs_of
from symgen.runtime.model.rods import RodModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_BLOCK = "director_beam"
#: Numbers that the kernels read: places, rates with second rates, section; and what each writes.
_READ, _WRITTEN = (24, 48, 12), {"residual": 24, "tangent": 3 * 576, "energies": 3, "strains": 6}
#: Matrices that the kernel ``joints`` gives: M, C, K.
_SLOPES = ("mass_matrix", "damping", "stiffness")
#: Column of the damping among those of sections.
_DAMPING = 8
#: Products of directors that are constraints.
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, slots=True)
class LinkInSpace:
    """One elastic link: unknowns of its nodes (nodes, 12), numbers its elements read, and its section.

    ``section`` is the row of the kernel ``constants``.
    """

    info: BeamInfo
    places: Indices
    arguments: Array
    section: Array

    @property
    def elements(self) -> Indices:
        """Unknowns of each element, (elements, 24)."""
        return np.hstack([self.places[:-1], self.places[1:]])

    @property
    def length(self) -> float:
        """Undeformed length [m]."""
        return float(self.section[0])

    def call(self, kernel: str, q: Array, rates: Array | None = None, damped: bool = True) -> Array:
        """Return the output of a kernel for every element, (..., elements, numbers), at states before it."""
        rows = np.zeros((q.size // 24, 72))
        rows[:, :24] = q.reshape(-1, 24)
        if rates is not None:
            rows[:, 24:] = rates.reshape(-1, 48)
        out, none = np.empty((len(rows), _WRITTEN[kernel])), np.zeros((len(rows), 1))
        arguments = self.arguments.copy()
        arguments[_DAMPING] *= damped
        address, sizes = kernels(_BLOCK).ADDRESSES[kernel], (0, *_READ, 0, _WRITTEN[kernel])
        _core.call_many(address, sizes, none[:, 0], rows, 24, arguments, none, out)
        return out.reshape(*q.shape[:-1], -1)

    def section_forces(self, moment: Moment) -> tuple[Array, Array]:
        """Return axial force [N], bending moments about y and z and torque [N m] at nodes, (nodes, 4).

        The second result are the forces on both ends [N], (2, 3). The resultants at a node are those of the
        element before it, at the first node of the element behind.
        """
        at = self.elements
        q, rates = moment.q[at], np.hstack([moment.v[at], moment.a[at]])
        forces = self.call("residual", q, rates)
        ends = np.vstack([-forces[:1, :12], forces[:, 12:]]).reshape(-1, 4, 3)
        vectors = moment.q[self.places].reshape(-1, 4, 3)
        directors, force = vectors[:, 1:], ends[:, 0]
        couple = np.sum(np.cross(directors, ends[:, 1:]), axis=1)
        axial = np.sum(force * directors[:, 0], axis=1)
        about = np.einsum("nkc,nc->nk", directors, couple)
        both = np.stack([forces[0, :3], forces[-1, 12:15]])
        return np.column_stack([axial, about[:, 1], about[:, 2], about[:, 0]]), both


class LinkageInSpace:
    """The equations M a + ... + J^T lambda = f, Phi = 0 of a linkage with elastic links in space.

    Parameters
    ----------
    rigid
        The linkage with all links rigid.
    divided
        Times the number of elements of the scene.
    elements
        Number of elements of every link in its place, if given.
    """

    def __init__(self, rigid: RodModel, divided: int = 1, elements: int | None = None) -> None:
        d = rigid.description
        if d.elastic is None:
            raise ModelError(f"{rigid.name} has no elastic link")
        self.name, self.rigid, self._points = rigid.name, rigid, d.coordinates
        self._rigid, self._joints = rigid.evaluator, rigid.analysis("elastic_joints")
        start = rigid.initial_state()
        self._q, self._u = np.asarray(start.q, dtype=float), np.asarray(start.u, dtype=float)
        table = self._joints.blocks("constants", 0.0, self._q, self._u)["sections"]
        self.links: list[LinkInSpace] = []
        self._pins: list[tuple[Indices, int]] = []
        size = d.coordinates
        for info, row in zip(d.elastic.beams, np.atleast_2d(table), strict=True):
            count = (elements or info.elements) * divided
            places = np.zeros((count + 1, 12), dtype=np.intp)
            for node, own in enumerate(places):
                point = {0: info.start, count: info.end}.get(node)
                shared = point is not None and point in d.free
                if point is not None and shared:
                    first = 3 * d.free.index(point)
                    own[:3] = range(first, first + 3)
                else:
                    own[:3] = range(size, size + 3)
                    size += 3
                own[3:] = range(size, size + 9)
                size += 9
                if point is not None and not shared:
                    self._pins.append((own[:3], d.points.index(point)))
            arguments = np.concatenate([[row[0] / count], row[1:12]])
            self.links.append(LinkInSpace(info, places, arguments, row))
        self.unknowns = size
        of_joints = {b.name: b for b in self._joints.info("joints").blocks}
        place = {f"{p}_{axis}": 3 * k + i for k, p in enumerate(d.free) for i, axis in enumerate("xyz")}
        self._entries = {
            name: np.array(entries_of(of_joints, name, place), dtype=np.intp).reshape(-1, 2)
            for name in _SLOPES
        }
        names = of_joints["jacobian"].rows if "jacobian" in of_joints else ()
        self._rows = np.array([d.constraints.index(name) for name in names], dtype=np.intp)
        found = self._rigid.blocks("constraints", 0.0, self._q, self._u) if names else {}
        self._sizes = found["constraint_scale"][self._rows] if names else np.ones(0)
        #: Directors of all nodes, (nodes, 3, 3).
        self._directors = np.concatenate([k.places[:, 3:] for k in self.links]).reshape(-1, 3, 3)
        self.multipliers = len(names) + 3 * len(self._pins) + len(_PAIRS) * len(self._directors)
        self.scale = np.full(size, max(link.length for link in self.links))
        self.scale[self._directors.ravel()] = 1.0

    @property
    def conservative(self) -> bool:
        """Whether the drive and the damping of links alone do work that is no potential energy."""
        info = self.rigid.description.elastic
        return info is not None and info.shaft_alone

    def start(self) -> Moment:
        """Return places and rates at t = 0: straight links that move as rigid ones and do not spin."""
        d, n = self.rigid.description, self._points
        found = np.zeros((2, self.unknowns))
        found[0, :n], found[1, :n] = self._q, self._u
        points = self._rigid.blocks("points", 0.0, self._q, self._u)
        moved = np.array([points["positions"], points["velocities"]])
        for link in self.links:
            first, last = (moved[:, d.points.index(p)] for p in (link.info.start, link.info.end))
            apart = last - first
            length = float(np.linalg.norm(apart[0]))
            along = apart[0] / length
            turning = np.cross(along, apart[1]) / length
            width = link.section[12:15] - (link.section[12:15] @ along) * along
            if not np.linalg.norm(width) > 1e-6 * np.linalg.norm(link.section[12:15]):
                raise ModelError(
                    f"{self.name}: the width of {link.info.link} lies along the link: expected it across"
                )
            width = width / np.linalg.norm(width)
            directors = np.array([along, width, np.cross(along, width)])
            for node, share in zip(link.places, np.linspace(0.0, 1.0, len(link.places)), strict=True):
                found[:, node[:3]] = (1 - share) * first + share * last
                found[0, node[3:]] = directors.ravel()
                found[1, node[3:]] = np.cross(turning, directors).ravel()
        return Moment(0.0, found[0], found[1], np.zeros(self.unknowns), np.zeros(self.multipliers))

    def residual(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array:
        """Return M a + internal forces - f + J^T lambda, (times, unknowns), of states (times, unknowns)."""
        n, rigid = self._points, len(self._rows)
        found = np.zeros(q.shape)
        for link in self.links:
            at = link.elements
            forces = link.call("residual", q[:, at], np.concatenate([v[:, at], a[:, at]], axis=2))
            slots = self.unknowns * np.arange(len(t))[:, None] + at.ravel()
            found += np.bincount(slots.ravel(), forces.ravel(), q.size).reshape(q.shape)
        parts = self._parts(t, q, v, a, multipliers)
        found[:, :n] -= parts["load"]
        if rigid:
            found[:, :n] += np.einsum("kij,ki->kj", parts["jacobian"], multipliers[:, :rigid])
        for k, (places, _) in enumerate(self._pins):
            found[:, places] += multipliers[:, rigid + 3 * k : rigid + 3 * k + 3]
        held, vectors = self._held(multipliers), q[:, self._directors]
        for k, (i, j) in enumerate(_PAIRS):
            own = held[:, :, k, None]
            if i == j:
                found[:, self._directors[:, i]] += own * vectors[:, :, i]
            else:
                found[:, self._directors[:, i]] += own * vectors[:, :, j]
                found[:, self._directors[:, j]] += own * vectors[:, :, i]
        return found

    def _held(self, multipliers: Array) -> Array:
        """Return the multipliers of products of directors, (times, nodes, pairs)."""
        first = len(self._rows) + 3 * len(self._pins)
        return multipliers[:, first:].reshape(len(multipliers), -1, len(_PAIRS))

    def rates(self, t: Array, q: Array, v: Array) -> Array:
        """Return the rates of the constraints, J v + Phi_t, (times, multipliers)."""
        n, found = self._points, []
        if len(self._rows):
            rows = self._rigid.many("velocity_constraints", t, q[:, :n], v[:, :n])
            found.append(rows[:, self._rows] / self._sizes)
        if self._pins:
            given = self._ground(t)[1]
            found += [v[:, places] - given[:, point] for places, point in self._pins]
        of, rate = q[:, self._directors], v[:, self._directors]
        products = [
            np.sum(of[:, :, i] * rate[:, :, j] + (rate[:, :, i] * of[:, :, j] if i != j else 0.0), axis=2)
            for i, j in _PAIRS
        ]
        found.append(np.stack(products, axis=2).reshape(len(t), -1))
        return np.concatenate(found, axis=1)

    def errors(self, t: float, q: Array) -> Array:
        """Return the errors of the constraints Phi, (multipliers,): lengths [m] and products of directors."""
        n, found = self._points, []
        if len(self._rows):
            rows = self._rigid.blocks("constraints", t, q[:n], np.zeros(n))["constraints"]
            found.append(rows[self._rows] / self._sizes)
        if self._pins:
            given = self._ground(np.array([t]))[0][0]
            found += [q[places] - given[point] for places, point in self._pins]
        of = q[self._directors]
        products = [
            np.sum(of[:, i] * of[:, j], axis=1) if i != j else (np.sum(of[:, i] ** 2, axis=1) - 1) / 2
            for i, j in _PAIRS
        ]
        found.append(np.stack(products, axis=1).ravel())
        return np.concatenate(found)

    def _ground(self, t: Array) -> tuple[Array, Array]:
        """Return places and rates of all points, valid of those of the ground, (times, points, 3)."""
        y = np.broadcast_to(self._q, (len(t), self._points))
        points = self._rigid.many_blocks("points", t, y, np.zeros_like(y))
        return points["positions"], points["velocities"]

    def positions(self, found: Sequence[Moment]) -> dict[str, Array]:
        """Return the places of all points (times, 3) by name."""
        d, places = self.rigid.description, np.array([m.q for m in found])
        ground = self._ground(np.array([m.t for m in found]))[0]
        return {
            p: places[:, 3 * d.free.index(p) :][:, :3] if p in d.free else ground[:, k]
            for k, p in enumerate(d.points)
        }

    def slopes(self, t: float, q: Array, v: Array, a: Array, multipliers: Array) -> Slopes:
        """Return the slopes of the residual and of the constraints."""
        values: list[list[Array]] = [[], [], []]
        for link in self.links:
            at = link.elements
            tangents = link.call("tangent", q[at], np.hstack([v[at], a[at]])).reshape(-1, 3, 576)
            for own, tangent in zip(values, np.moveaxis(tangents, 1, 0), strict=True):
                own.append(tangent.ravel())
        states = (x[None] for x in (q, v, a, multipliers))
        parts = self._parts(np.array([t]), *states)
        held = np.repeat(self._held(multipliers[None])[0][:, :, None], 3, axis=2)
        apart = [held[:, k] for k, (i, j) in enumerate(_PAIRS) for _ in range(1 if i == j else 2)]
        by_products = np.concatenate(apart).ravel()
        for own, of in zip(values, _SLOPES, strict=True):
            own += [parts[name][0] if of == name else np.zeros(len(self._entries[name])) for name in _SLOPES]
            own.append(by_products if of == "stiffness" else np.zeros(by_products.size))
        mass, damping, stiffness = (np.concatenate(own) for own in values)
        return Slopes(mass, damping, stiffness, self._jacobian(parts, q))

    def _jacobian(self, parts: dict[str, Array], q: Array) -> Array:
        jacobian, row = np.zeros((self.multipliers, self.unknowns)), len(self._rows)
        if row:
            jacobian[:row, : self._points] = parts["jacobian"][0]
        for places, _ in self._pins:
            jacobian[range(row, row + 3), places] = 1.0
            row += 3
        of = q[self._directors]
        rows = row + np.arange(len(of) * len(_PAIRS)).reshape(len(of), -1)
        for k, (i, j) in enumerate(_PAIRS):
            jacobian[rows[:, k, None], self._directors[:, i]] = of[:, j]
            jacobian[rows[:, k, None], self._directors[:, j]] = of[:, i]
        return jacobian

    @cached_property
    def pattern(self) -> Pattern:
        """The places of the entries of slopes."""
        pairs = [pairs_of(link.elements) for link in self.links]
        pairs += [self._entries[name].T for name in _SLOPES]
        at = self._directors
        both = [(a, b) for i, j in _PAIRS for a, b in ([(i, i)] if i == j else [(i, j), (j, i)])]
        pairs.append(
            np.stack([np.concatenate([at[:, k] for k in side]).ravel() for side in zip(*both, strict=True)])
        )
        parts = {"jacobian": np.ones((1, len(self._rows), self._points))}
        bound = self._jacobian(parts, np.ones(self.unknowns)) != 0.0
        return Pattern(np.concatenate(pairs, axis=1), bound)

    def _parts(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> dict[str, Array]:
        """Return load, slopes and Jacobian of rigid links, particles and loads at states, by name."""
        n, rigid = self._points, len(self._rows)
        work = np.zeros((len(t), n + len(self.rigid.description.constraints)))
        work[:, :n] = a[:, :n]
        work[:, n + self._rows] = multipliers[:, :rigid] / self._sizes
        found = self._joints.many_blocks("joints", t, q[:, :n], v[:, :n], work)
        return dict.fromkeys(_SLOPES, np.zeros((len(t), 0))) | found

    def dissipated(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return the power that the damping of links takes [W], (times,)."""
        found = np.zeros(len(t))
        for link in self.links:
            if link.arguments[_DAMPING]:
                at = link.elements
                rates = np.concatenate([v[:, at], a[:, at]], axis=2)
                forces = (link.call("residual", q[:, at], rates, damped) for damped in (True, False))
                found += np.sum(np.subtract(*forces) * v[:, at], axis=(1, 2))
        return found

    def energies(self, moment: Moment) -> Array:
        """Return kinetic, strain and potential energy [J] and the power dissipated by links [W]."""
        q, v, n, found = moment.q, moment.v, self._points, np.zeros(3)
        for link in self.links:
            at = link.elements
            found += np.sum(link.call("energies", q[at], np.hstack([v[at], moment.a[at]])), axis=0)
        states = (x[None] for x in (q, v, moment.a))
        dissipated = float(self.dissipated(np.array([moment.t]), *states)[0])
        kinetic, potential = self._joints("energy", moment.t, q[:n], v[:n])[:2]
        return np.append(found + np.array([kinetic, 0.0, potential]), dissipated)
