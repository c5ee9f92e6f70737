"""Forces in a driven linkage of rigid links by elements: assembly over joints, and the solution.

Source: the thesis on kineto-elastodynamics, Chapter IV, for any planar linkage. Unknown are the force on
every link at each of its points, the forces of guides, normal to them, and the torques of drives. The
equations are three for each link (what its elements leave, see ``chain``) and two for each point that
is not ground, which carries its point mass and its loads.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import BlockInfo
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.forces.chain import Attachment, Distribution, ElementChain, even
from symgen.runtime.rods.poses import Poses

#: A singular value that is a smaller part of the largest is lost rank; as in the kinematics.
RANK = 1e-9


@dataclass(frozen=True, slots=True)
class Unknown:
    """One or two unknown forces: ``kind`` is force, guide, torque or gear, on a link at a point.

    The point of a torque of a drive or of gears is its name.
    """

    kind: str
    link: str
    point: str
    column: int

    @property
    def width(self) -> int:
        """Number of its components."""
        return 2 if self.kind == "force" else 1

    @property
    def is_torque(self) -> bool:
        """Whether it is a torque of a drive or of gears, with shares on several links."""
        return self.kind in ("torque", "gear")

    @property
    def labels(self) -> list[str]:
        """Names of its components in the kernel ``joint_forces``."""
        axes = "xy" if self.kind == "force" else "-"
        return [f"{self.kind} {self.link} {self.point} {axis}" for axis in axes]

    def describe(self) -> str:
        """Return the name of the unknown in messages."""
        of = {
            "force": f"the force on {self.link} at {self.point}",
            "guide": f"the force of the guide along {self.link} on {self.point}",
            "torque": f"the torque of the drive of {self.link}",
            "gear": f"the torque of {self.point} on {self.link}",
        }
        return of[self.kind]


class Assembly:
    """The equations of the forces at some poses: times, coordinates, velocities, accelerations."""

    def __init__(self, constraints: Constraints, loads: Evaluator, poses: Poses, elements: int) -> None:
        d, self._loads, self._poses = constraints.description, loads, poses
        self.description, self.elements = d, elements
        self._blocks: dict[str, Array] = {}
        self.names = [k for k in d.links if k in self._block("link_masses").columns]
        self.places = constraints.moving(poses)[0]
        self.accelerations = constraints.accelerating(poses)
        self.unknowns = self._unknowns()
        self.size = sum(u.width for u in self.unknowns)
        self.times = poses.times.tolist()

    def _block(self, name: str) -> BlockInfo:
        return self._loads.info(name).blocks[0]

    def _has(self, name: str) -> bool:
        return self._loads.has(name)

    def _labels(self, name: str) -> list[tuple[str, str]]:
        """Return the two names in each row name of a matrix; none when there is no such matrix."""
        rows = [row.split(" ") for row in self._block(name).rows] if self._has(name) else []
        return [(first, second) for first, second, *_ in rows]

    @property
    def _torques(self) -> list[Unknown]:
        return [u for u in self.unknowns if u.is_torque]

    def _values(self, name: str) -> Array:
        """Return a matrix of the loads at all poses, (poses, rows, columns)."""
        if name not in self._blocks:
            values = self._poses.many(self._loads, name)
            self._blocks[name] = values.reshape(-1, *self._block(name).shape)
        return self._blocks[name]

    def index(self, point: str) -> int:
        """Return the number of a point."""
        return self.description.points.index(point)

    def _unknowns(self) -> tuple[Unknown, ...]:
        labels = [("force", link, p) for link in self.names for p in self.points_of(link)]
        labels += [("guide", link, p) for link, p in self._labels("guides")]
        torques = self._block("torques").columns if self._has("torques") else ()
        labels += [(kind, link, name) for kind, link, name in (c.split(" ") for c in torques)]
        unknowns: list[Unknown] = []
        for kind, link, point in labels:
            column = unknowns[-1].column + unknowns[-1].width if unknowns else 0
            unknowns.append(Unknown(kind, link, point, column))
        return tuple(unknowns)

    def points_of(self, link: str) -> list[str]:
        """Return all points of a link."""
        return list(self.description.links[link])

    def distribution(self, link: str) -> Distribution | None:
        """Return the mass distribution of a link; None if it is unknown."""
        return self._distributions[link]

    @cached_property
    def _bodies(self) -> dict[str, tuple[float, float, float, float]]:
        masses = self._values("link_masses")[0]
        return {k: tuple(masses[:, i].tolist()) for i, k in enumerate(self._block("link_masses").columns)}

    @cached_property
    def _distributions(self) -> dict[str, Distribution | None]:
        distributions: dict[str, Distribution | None] = {}
        sections = self._block("sections").columns if self._has("sections") else ()
        of_sections = self._values("sections")[0] if sections else np.zeros((8, 0))
        for link in self.names:
            i, k = (self.index(p) for p in self.points_of(link)[:2])
            length = float(np.linalg.norm(self.places[0, k] - self.places[0, i]))
            if link in sections:
                c = of_sections[:, sections.index(link)]
                distributions[link] = Distribution(tuple(c[:3].tolist()), tuple(c[3:].tolist()))
            else:
                distributions[link] = even(self._bodies[link], length)
        return distributions

    def cuts(self, link: str) -> int:
        """Return into how many elements a link is cut: one where its mass is not known to be spread."""
        return self.elements if self.distribution(link) else 1

    @cached_property
    def chains(self) -> tuple[ElementChain, ...]:
        """Every link that moves, cut into elements."""
        gravity, chains = self._values("gravity")[0, :, 0], []
        for link in self.names:
            ends = [self.index(p) for p in self.points_of(link)[:2]]
            chains.append(
                ElementChain(
                    link, self.cuts(link), self.places[:, ends], self.accelerations[:, ends], gravity,
                    self._bodies[link], self.distribution(link), tuple(self._attached(link)), self.size,
                )
            )  # fmt: skip
        return tuple(chains)

    def _attached(self, link: str) -> list[Attachment]:
        """Return everything that acts on a link."""
        attached = []
        normals = self._values("guides") if self._has("guides") else None
        guides = [u for u in self.unknowns if u.kind == "guide"]
        for u in (u for u in self.unknowns if u.link == link and not u.is_torque):
            at, share = self._at(link, u.point)
            # The guide pushes the point along the normal, and the point pushes the link back.
            along = -normals[:, guides.index(u)] if normals is not None and u.kind == "guide" else None
            attached.append(Attachment(at, share, u.column, None, along, False))
        for i, (name, point) in enumerate(self._labels("torques")):
            for k, u in enumerate(self._torques):
                part = self._values("torques")[:, i, k, None]
                if name == link and np.any(part):
                    attached.append(Attachment(*self._at(link, point), u.column, None, part, True))
        for i, (name, point) in enumerate(self._labels("couples")):
            if name == link:
                attached.append(
                    Attachment(*self._at(link, point), -1, self._values("couples")[:, i], None, True)
                )
        return attached

    def _at(self, link: str, point: str) -> tuple[Array, Array]:
        """Return where a point is, and at which share of the length of a link."""
        ends, at = self.points_of(link)[:2], self.places[:, self.index(point)]
        if point in ends:
            return at, np.full(len(at), float(ends.index(point)))
        start, end = (self.places[:, self.index(p)] for p in ends)
        d = end - start
        return at, np.einsum("ki,ki->k", at - start, d) / np.einsum("ki,ki->k", d, d)

    @cached_property
    def _on_points(self) -> Array:
        """Loads on each point less mass times acceleration, (poses, points, 2) [N]."""
        masses = self._values("point_masses")[:, :, 0]
        free_fall = self._values("gravity")[:, None, :, 0]
        return self._values("point_loads") - masses[:, :, None] * (self.accelerations - free_fall)

    def _carried(self, point: str) -> Iterator[tuple[Unknown, Array]]:
        """Yield the unknowns that a point gives away, with their directions (poses, 2, components)."""
        guides = self._labels("guides")
        for u in self.unknowns:
            if u.point == point and u.kind == "force":
                yield u, np.broadcast_to(np.eye(2), (len(self._poses), 2, 2))
            elif u.point == point and u.kind == "guide":
                yield u, -self._values("guides")[:, guides.index((u.link, point)), :, None]

    @cached_property
    def scales(self) -> Array:
        """Factors that make the unknowns forces [N]: torques are over the length of the link."""
        lengths = {c.name: c.length for c in self.chains}
        scales = [np.full(u.width, lengths[u.link] if u.is_torque else 1.0) for u in self.unknowns]
        return np.concatenate(scales)

    @cached_property
    def equations(self) -> tuple[Array, Array]:
        """The matrix and the right-hand side over forces [N], (poses, rows, unknowns) and (poses, rows)."""
        left, right = [], []
        for chain in self.chains:
            section, constant = chain.end()
            size = np.array([1.0, 1.0, chain.length])
            left.append(section / size[:, None])
            right.append(-constant / size)
        for point in self.description.points:
            shares = list(self._carried(point))
            if point not in self.description.ground and shares:
                row = np.zeros((len(self._poses), 2, self.size))
                for u, along in shares:
                    row[:, :, u.column : u.column + u.width] += along
                left.append(row)
                right.append(self._on_points[:, self.index(point)])
        return np.concatenate(left, axis=1) * self.scales, np.concatenate(right, axis=1)

    def residual(self, x: Array) -> float:
        """Return the largest residual of the equations, over the largest force [1]."""
        left, right = self.equations
        forces = x / self.scales
        missed = np.abs(np.einsum("kij,kj->ki", left, forces) - right)
        size = float(np.max(np.abs(forces), initial=0.0))
        return float(np.max(missed)) / size if size else float(np.max(missed))

    def reactions(self, x: Array) -> dict[str, Array]:
        """Return the force of the ground on each ground point that bears something, (poses, 2) [N].

        What pushes a link between two ground points is borne by these, as by a beam on two supports.
        """
        reactions: dict[str, Array] = {}

        def add(point: str, force: Array) -> None:
            reactions[point] = reactions.get(point, np.zeros_like(force)) + force

        for point in self.description.ground:
            shares, on_point = list(self._carried(point)), self._on_points[:, self.index(point)]
            if shares or np.any(on_point):
                add(point, -on_point)
            for u, along in shares:
                of_unknown = x[:, u.column : u.column + u.width]
                add(point, of_unknown if u.kind == "force" else along[:, :, 0] * of_unknown)
        for i, (link, point) in enumerate(self._labels("guides")):
            if link not in self.names:
                u = next(u for u in self.unknowns if (u.kind, u.link, u.point) == ("guide", link, point))
                push = x[:, u.column, None] * self._values("guides")[:, i]
                share = self._at(link, point)[1][:, None]
                for end, part in zip(self.points_of(link)[:2], (1.0 - share, share), strict=True):
                    add(end, part * push)
        torques = [u.column for u in self._torques]
        for i, (link, _) in enumerate(self._labels("torques")):
            if link not in self.names:
                couple = np.einsum("kj,kj->k", x[:, torques], self._values("torques")[:, i])
                start, end = self.points_of(link)[:2]
                d = self.places[:, self.index(end)] - self.places[:, self.index(start)]
                push = (couple / np.einsum("ki,ki->k", d, d))[:, None] * np.stack([d[:, 1], -d[:, 0]], 1)
                add(end, push)
                add(start, -push)
        return reactions


@dataclass(frozen=True, slots=True)
class ForceSolution:
    """Unknowns at all poses, (poses, unknowns), and how well they are determined.

    ``rank`` of the equations at each pose, ``loose`` for each unknown how much of it forces that nothing
    balances leave open. ``worst`` is the pose nearest to a loss of rank (by the condition, or by the pivots
    of the constraint Jacobian where multipliers give the forces) and ``condition`` the ratio of the greatest
    to the least singular value there, of those that are not lost; ``residual`` is the largest error of the
    equations over the largest force.
    """

    x: Array
    rank: NDArray[np.int_]
    loose: Array
    worst: int
    condition: float
    residual: float


def solve(assembly: Assembly) -> ForceSolution:
    """Solve the equations at all poses; where some forces are open, those of least norm are taken."""
    left, right = assembly.equations
    u, s, vt = np.linalg.svd(left)
    k = s.shape[1]
    independent = s > RANK * s[:, :1]
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=independent)
    projected = np.einsum("kij,ki->kj", u[:, :, :k], right) * inverse
    x = np.einsum("kij,ki->kj", vt[:, :k], projected) * assembly.scales
    rank = np.count_nonzero(independent, axis=1)
    condition = s[:, 0] / np.min(np.where(independent, s, np.inf), axis=1)
    open_ = np.ones(vt.shape[:2])
    open_[:, :k] = ~independent
    loose = np.sqrt(np.einsum("kij,ki->kj", vt**2, open_))
    worst = int(np.argmax(condition))
    return ForceSolution(x, rank, loose, worst, float(condition[worst]), assembly.residual(x))
