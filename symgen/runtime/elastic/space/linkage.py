"""A linkage in space whose elastic links are beam elements with directors: its equations, assembled.

The unknowns are the coordinates of the linkage's free points, the positions of the inner nodes of elastic
links, and three directors of every node. Lengths of rigid links, guides, ends on the ground, products of
directors and joints that restrict rotations are constraints with multipliers.

Along a direction of the parameters, the start and prescribed motions have tangents, as imaginary parts, and
so have outputs of a motion whose places have them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from symgen.errors import ModelError
from symgen.runtime._constrained import Elements, Rigid, Ties
from symgen.runtime.arrays import Array
from symgen.runtime.beams.elements import kernels, rows_at
from symgen.runtime.beams.layout import entries_of
from symgen.runtime.elastic.large.collocation import MotionState
from symgen.runtime.elastic.large.statics import RestingSystem
from symgen.runtime.elastic.space.directions import DirectionRow, directions, orthonormal
from symgen.runtime.elastic.space.joints import FixedVectors, check_independent, length_of, rows_of
from symgen.runtime.elastic.space.links import BLOCK, DAMPING, links_in_space
from symgen.runtime.kernels.elastic_description import JointInfo
from symgen.runtime.kernels.evaluate import UNIT, Duals
from symgen.runtime.rods.model.rods import RodModel

#: Matrices that the kernel ``joints`` gives: M, C, K.
_SLOPES = ("mass_matrix", "damping", "stiffness")
#: Numbers of three axes.
AXES = 9


@dataclass(frozen=True, slots=True)
class ParameterDirection:
    """A direction: tangents of the parameters, and of coordinates and rates at the start."""

    parameters: Array
    q: Array
    u: Array


class LinkageInSpace(RestingSystem):
    """The equations M a + ... + J^T lambda = f, Phi = 0 of a linkage with elastic links in space.

    Parameters
    ----------
    rigid
        The linkage with all links rigid.
    divided
        Times the number of elements of the scene.
    elements
        Number of elements of every link in its place, if given.
    along
        The direction of tangents, if any.
    """

    #: Keeps links from spinning on balls.
    shift = 1e-9

    def __init__(
        self,
        rigid: RodModel,
        divided: int = 1,
        elements: int | None = None,
        along: ParameterDirection | None = None,
    ) -> None:
        d = rigid.description
        if d.elastic is None:
            raise ModelError(f"{rigid.name} has no elastic link")
        self.rigid, self._points = rigid, d.coordinates
        evaluators = rigid.evaluator, rigid.analysis("elastic_joints")
        start = rigid.initial_state()
        self._q, self._u = np.asarray(start.q, dtype=float), np.asarray(start.u, dtype=float)
        self.of_rigid, self.of_joints = map(Duals, evaluators)
        if along is not None:
            self._q, self._u = self._q + 1j * UNIT * along.q, self._u + 1j * UNIT * along.u
            self.of_rigid, self.of_joints = (
                Duals(of, rigid.analysis(kind), along.parameters)
                for of, kind in zip(evaluators, ("motion_tangents", "elastic_joints_tangents"), strict=True)
            )
        constants = self._at_start(self.of_joints, "constants")
        #: Names of stations, names of their links, and fractions of these.
        self.stations = [
            (*of, at) for of, at in zip(d.elastic.stations, constants["stations"].ravel(), strict=True)
        ]
        self.links, pins, size = links_in_space(d, constants, divided, elements)
        of_joints = {b.name: b for b in evaluators[1].info("joints").blocks}
        place = {name: k for k, name in enumerate(d.of_coordinates())}
        entries = [entries_of(of_joints, name, place) for name in _SLOPES]
        names = of_joints["jacobian"].rows if "jacobian" in of_joints else ()
        rows = [d.constraints.index(name) for name in names]
        blocks = self._at_start(self.of_rigid, "constraints") if rows else {}
        # Any constant scale will do, so that it has no tangents.
        sizes = blocks["constraint_scale"][rows].real if rows else np.zeros(0)
        #: Directors of all nodes, (nodes, 3, 3).
        directors = np.concatenate([k.places[:, 3:] for k in self.links]).reshape(-1, 3, 3)
        #: Unknowns that are positions.
        self.states = np.arange(d.of_points, d.coordinates)
        self.translations = np.delete(np.arange(size), [*directors.ravel(), *self.states])
        scale = np.ones(size)
        scale[self.translations] = max(link.length.real for link in self.links)
        # Numbers behind the unknowns: places of all points, and fixed axes.
        self.straight = self._undeformed(size)
        on_directions = [*orthonormal(directors), *self._joined()]
        pinned, first = 3 * len(pins), len(rows) + 3 * len(pins)
        at = np.array([places for places, _ in pins], dtype=np.intp).ravel()
        ground = np.array([size + 3 * point + np.arange(3) for _, point in pins], dtype=np.intp).ravel()
        ties = Ties(
            np.tile(len(rows) + np.arange(pinned), 2),
            np.concatenate([at, ground]),
            np.repeat([1.0, -1.0], pinned),
        )
        beams = [
            Elements(kernels(BLOCK).ADDRESSES, k.elements, k.arguments.real, bool(k.section[DAMPING]))
            for k in self.links
        ]
        self._rigid_parts = Rigid(*evaluators, rows, range(len(rows)), sizes, entries)
        parts = [*beams, self._rigid_parts, ties, directions(on_directions, size, first)]
        known = 3 * len(d.points) + AXES * (1 + len(d.elastic.driven))
        super().__init__(rigid.name, parts, scale, first + len(on_directions), known)
        self.rows, self.sizes, self.pins = rows, sizes, pins
        #: Unknowns of the entries of mass and stiffness of rigid components, (entries, 2) each.
        self.entries = {name: np.reshape(of, (-1, 2)) for name, of in zip(_SLOPES, entries, strict=True)}
        #: Of constraints on directions, places of vectors (rows, 21), factors and value (rows, 8).
        self.vectors = np.array([row.places.ravel() for row in on_directions])
        self._factors = np.array([[*row.factors, row.value] for row in on_directions])
        #: Descriptions of the constraints.
        self.labels = [d.labels[row] for row in rows]
        self.labels += [f"the end of a link at {d.points[point]}" for _, point in pins for _ in d.axes]
        self.labels += [row.label for row in on_directions]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns: coordinates of points, positions and directors of nodes."""
        d = self.rigid.description
        labels = [""] * self.unknowns
        for link in self.links:
            for node, unknowns in enumerate(link.places):
                for k, place in enumerate(unknowns):
                    labels[place] = (
                        f"{link.info.link}@{node + 1}.{('', 'd1_', 'd2_', 'd3_')[k // 3]}{'xyz'[k % 3]}"
                    )
        labels[: self._points] = [*(f"{p}.{axis}" for p in d.free for axis in d.axes), *d.integrals]
        return tuple(labels)

    def take_parameters(self, values: Array) -> None:
        """Take values of the tunable parameters, of which loads alone depend on those that change."""
        super().take_parameters(values)
        joints = self.of_joints.values.with_tunable(values)
        self.of_joints = Duals(joints)
        self._rigid_parts.take_parameters(joints.parameters)

    @property
    def has_drives(self) -> bool:
        """Whether drives rotate rigid links."""
        info = self.rigid.description.elastic
        return info is not None and bool(info.driven)

    def start(self) -> MotionState:
        """Return places and rates at t = 0: straight links that move as rigid ones.

        They spin about their lines as joints that restrict rotations prescribe.

        Raises
        ------
        ModelError
            Where joints repeat or contradict other constraints.
        """
        (q, v), n = self.straight.real, self.unknowns
        none = np.zeros(n), np.zeros(self.multipliers)
        slopes = self.slopes(0.0, q, v, *none)
        # Constraints of nodes without a point are those of their directors alone.
        ends = np.delete(np.arange(n), np.concatenate([link.between.ravel() for link in self.links]))
        jacobian = self.pattern.matrix(slopes.jacobian)[n:, ends].toarray()
        check_independent(self.name, jacobian, self.labels)
        return self.with_rates(MotionState(0.0, q, v, *none))

    def with_rates(self, at: MotionState) -> MotionState:
        """Return a motion with its rates projected on the constraints, in the metric of the mass matrix."""
        slopes, n = self.slopes(at.t, at.q, at.v, at.a, at.multipliers), self.unknowns
        over = np.append(np.zeros(n), self.rates(np.array([at.t]), at.q[None], at.v[None])[0])
        return replace(at, v=at.v - self.pattern.factorised(slopes.mass + slopes.jacobian)(over)[:n])

    def _undeformed(self, size: int) -> Array:
        """Return places and rates at t = 0 of straight links that do not spin, (2, unknowns)."""
        d, n, name = self.rigid.description, self._points, self.rigid.name
        vectors = np.zeros((2, size), self._q.dtype)
        vectors[0, :n], vectors[1, :n] = self._q, self._u
        points = self._at_start(self.of_rigid, "points")
        moved = np.array([points["positions"], points["velocities"]])
        for link in self.links:
            first, last = (moved[:, d.points.index(p)] for p in (link.info.start, link.info.end))
            apart = last - first
            length = length_of(apart[0])
            along = apart[0] / length
            turning = np.cross(along, apart[1]) / length
            width = link.width - (link.width @ along) * along
            if not np.linalg.norm(width) > 1e-6 * np.linalg.norm(link.width):
                raise ModelError(
                    f"{name}: the width of {link.info.link} lies along the link: expected it across"
                )
            width = width / length_of(width)
            directors = np.array([along, width, np.cross(along, width)])
            for node, share in zip(link.places, link.fractions, strict=True):
                vectors[:, node[:3]] = (1 - share) * first + share * last
                vectors[0, node[3:]] = directors.ravel()
                vectors[1, node[3:]] = np.cross(turning, directors).ravel()
        return vectors

    def _joined(self) -> Iterator[DirectionRow]:
        """Yield the constraints of joints that restrict rotations."""
        info = self.rigid.description.elastic
        if info is None or not info.joints_in_space:
            return
        axes = self._at_start(self.of_joints, "constants")["axes"].reshape(-1, 3)
        for joint, axis in zip(info.joints_in_space, axes, strict=True):
            first, second = (self._frame(link, joint) for link in (*joint.links, "")[:2])
            about = f"{self.rigid.name}: the {joint.kind} at {joint.point}"
            for row in rows_of(joint.kind, about, axis, first, second):
                yield replace(row, label=f"the {joint.kind} at {joint.point}")

    def _frame(self, name: str, joint: JointInfo) -> FixedVectors:
        """Return the vectors fixed in a link of a joint; in the ground without a name."""
        d, size = self.rigid.description, self.straight.shape[1]
        start = np.concatenate([self.straight[0], self.prescribed_with_tangents(np.zeros(1))[0][0]])
        for link in self.links:
            if link.info.link == name:
                places = link.places[link.nodes[joint.point], 3:].reshape(3, 3)
                return FixedVectors(places, start[places])
        turned = ("", *d.elastic.driven) if d.elastic else ("",)
        if name in turned:
            places = size + 3 * len(d.points) + AXES * turned.index(name) + np.arange(AXES).reshape(3, 3)
            return FixedVectors(places, start[places])
        first = [3 * d.free.index(p) if p in d.free else size + 3 * d.points.index(p) for p in joint.base]
        places = np.array(first)[:, None] + np.arange(3)
        return FixedVectors(places, start[places], between=True)

    def prescribed(self, t: Array) -> tuple[Array, Array]:
        """Return places and rates of points, valid of those of the ground, and of axes, (times, numbers).

        The axes are those of the ground, and those fixed in each driven link.
        """
        places, rates = self.prescribed_with_tangents(t)
        return np.ascontiguousarray(places.real), np.ascontiguousarray(rates.real)

    def prescribed_with_tangents(self, t: Array) -> tuple[Array, Array]:
        """Return the same with their tangents."""
        places, rates = (x.reshape(len(t), -1) for x in self._ground(t))
        axes = np.broadcast_to(np.eye(3).ravel(), (len(t), AXES))
        turned, turning = self._driven(t)
        return np.hstack([places, axes, turned]), np.hstack([rates, np.zeros_like(axes), turning])

    def _driven(self, t: Array) -> tuple[Array, Array]:
        """Return the axes fixed in driven links and their rates, (times, numbers)."""
        if not self.has_drives:
            return np.zeros((len(t), 0)), np.zeros((len(t), 0))
        y = np.broadcast_to(self._q, (len(t), self._points))
        blocks = self.of_joints("driven", t, y, np.zeros_like(y))
        shape = len(t), -1, AXES
        axes, slopes = (blocks[name].reshape(shape) for name in ("driven_axes", "driven_slopes"))
        rates = slopes * blocks["drive_speeds"].reshape(len(t), -1, 1)
        return axes.reshape(len(t), -1), rates.reshape(len(t), -1)

    def _ground(self, t: Array) -> tuple[Array, Array]:
        """Return places and rates of all points, valid of those of the ground, (times, points, 3)."""
        y = np.broadcast_to(self._q, (len(t), self._points))
        points = self.of_rigid("points", t, y, np.zeros_like(y))
        return points["positions"], points["velocities"]

    def positions(self, t: Array, q: Array) -> dict[str, Array]:
        """Return the places of all points (times, 3) by name."""
        coordinates = q[:, : self._points]
        places = self.of_rigid("points", t, coordinates, np.zeros_like(coordinates))["positions"]
        return {p: places[:, k] for k, p in enumerate(self.rigid.description.points)}

    def energies(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return kinetic, strain and potential energy [J] and the power of damping [W], (4, times)."""
        n = self._points
        sums: Array = sum(np.sum(link.values("energies", q, v, a), axis=1) for link in self.links).T
        rigid = self.of_joints("energy", t, q[:, :n], v[:, :n])
        for k, name in ((0, "kinetic_energy"), (2, "potential_energy")):
            sums[k] += rigid[name].reshape(len(t))
        return sums

    def directed(self, q: Array, v: Array, kernel: str = "row", width: int = 23) -> Array:
        """Return error, rate and slopes of constraints on directions, (times, rows, 23), or another kernel's.

        ``q`` and ``v`` are those of the unknowns, followed by prescribed numbers.
        """
        factors = self._factors if np.iscomplexobj(q) else self._factors.real
        factors = np.broadcast_to(factors, (len(q), *factors.shape))
        states = np.concatenate([q[:, self.vectors], v[:, self.vectors], factors], axis=2).reshape(-1, 50)
        return rows_at("direction", kernel, states, 21, np.zeros(1), width).reshape(len(q), -1, width)

    def jacobian_rate(self, moment: MotionState) -> Array:
        """Return the rate of the constraint Jacobian, (multipliers, unknowns)."""
        n, rigid, points, t = self.unknowns, len(self.rows), self._points, np.array([moment.t])
        rates = self.prescribed(t)[1]
        rate = np.zeros((self.multipliers, n + rates.shape[1]))
        if rigid:
            joints = self.of_joints("joints", t, moment.q[None, :points], moment.v[None, :points])
            rate[:rigid, :points] = joints["jacobian_rate"][0]
        # Slopes of products are linear in the vectors.
        v = np.hstack([moment.v[None], rates])
        first = rigid + 3 * len(self.pins)
        row = first + np.arange(len(self.vectors))[:, None]
        np.add.at(rate, (row, self.vectors), self.directed(v, np.zeros_like(v))[0, :, 2:])
        return rate[:, :n]

    def _at_start(self, kernels: Duals, kernel: str) -> dict[str, Array]:
        """Return the results of a kernel at the start with rigid links, by name."""
        blocks = kernels(kernel, np.zeros(1), self._q[None], self._u[None])
        return {name: values[0] for name, values in blocks.items()}
