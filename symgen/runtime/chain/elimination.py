"""Masses of a tree of rigid rods, and the solution of its equations from the leaves to the root."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.chain.inputs import aligned, apart, on_length, repeated, shaped, side_by_side

#: Cancellation beyond which a solution is refused.
_REFUSE = 1e14


@dataclass(frozen=True, slots=True)
class ChainMotion:
    """Accelerations and forces of a chain, or of many: then every array has one more axis in front.

    ``accelerations`` (points, axes) [m/s^2]; ``multipliers`` (rods) [N/m]; ``tensions`` (rods) [N]: the force
    that keeps a rod's length, positive in tension; ``reaction`` (axes) [N]: of the ground on a held base,
    else zero; ``cancellation`` (rods) [1]: the product of the diagonal of a rod's gathered mass matrix over
    its determinant, which tells the digits lost.
    """

    accelerations: Array
    multipliers: Array
    tensions: Array
    reaction: Array
    cancellation: Array


class Elimination:
    """Rods with their masses, and the elimination of their accelerations and multipliers.

    Subclasses set the attributes (see :class:`~symgen.runtime.chain.chain.Chain`) and call ``_gather``.
    """

    rods: int
    dimension: int
    lengths: Array
    masses: Array
    centres: Array
    inertias: Array
    point_masses: Array
    gravity: Array
    pinned: bool
    parents: Indices
    _parents: Indices | None
    _kernels: Any

    def _gather(self) -> None:
        n = self.rods
        rod = np.stack([self.masses, self.lengths, self.centres, self.inertias], axis=1)
        ends = aligned((n, 3))
        self._kernels.ends(n, np.ascontiguousarray(rod).reshape(-1), ends.reshape(-1))
        a11, self._coupling, a22 = (np.ascontiguousarray(column) for column in ends.T)
        self._mass, weight = self.point_masses.copy(), self.point_masses.copy()
        self._mass[1:] += a22
        weight[1:] += self._coupling + a22
        np.add.at(self._mass, self.parents, a11)
        np.add.at(weight, self.parents, a11 + self._coupling)
        self._weight = weight[:, None] * self.gravity
        leaves = np.setdiff1d(np.arange(1, n + 1), self.parents)
        bare = leaves[~(self._mass[leaves] > 0)]
        if len(bare):
            raise ModelError(
                f"the outer end of rod {bare[0] - 1} carries no mass, so nothing determines its motion: "
                "give the rod mass or inertia, or its end a point mass"
            )

    def _kinetic(self, v: Array) -> Array:
        coupled = np.einsum("...ki,...ki->...k", v[..., self.parents, :], v[..., 1:, :]) @ self._coupling
        return coupled + np.einsum("...pi,...pi->...p", v, v) @ self._mass / 2

    def _potential(self, p: Array) -> Array:
        return -np.einsum("...pi,pi->...", p, self._weight)

    def _solve(
        self, d: Array, gamma: Array, force: Array, start: Array, refinements: int, threads: int | None
    ) -> ChainMotion:
        """Return the motion of one chain or many; ``refinements`` below zero: as cancellation asks for."""
        n, k = self.rods, self._kernels
        if d.ndim > 2:
            return self._solve_many(d, gamma, force, start, refinements, threads)
        a, lam, reaction = np.empty((n + 1, self.dimension)), np.empty(n), np.empty(self.dimension)
        a[0] = start
        work = np.empty(k.work_size(n))
        right = (np.ascontiguousarray(x).reshape(-1) for x in (force, d, gamma))
        k.solve(
            n, self._parents, self.pinned, self._coupling, self._mass, *right,
            a.reshape(-1), lam, reaction, work, refinements,
        )  # fmt: skip
        loss = work[: n * k.FACTORS].reshape(n, k.FACTORS)[:, -1].copy()
        return ChainMotion(a, lam, lam * self.lengths, reaction, loss)

    def _solve_many(
        self, d: Array, gamma: Array, force: Array, start: Array, refinements: int, threads: int | None
    ) -> ChainMotion:
        n, k = self.rods, self._kernels
        batch, lanes = d.shape[:-2], k.LANES
        groups = -(-int(np.prod(batch)) // lanes)
        coupling, mass = (repeated(x, lanes) for x in (self._coupling, self._mass))
        a = aligned((groups, (n + 1) * self.dimension, lanes))
        a[:, : self.dimension] = side_by_side(start, 1, lanes)
        lam, reaction = aligned((groups, n, lanes)), aligned((groups, self.dimension, lanes))
        loss = np.empty((groups, n, lanes))
        inputs = [side_by_side(x, y, lanes).reshape(-1) for x, y in ((force, 2), (d, 2), (gamma, 1))]

        def some(first: int, last: int) -> None:
            work = aligned((k.work_size(n) * lanes,))
            for g in range(first, last):
                k.solve_lanes(
                    n, self._parents, self.pinned, coupling, mass, *inputs,
                    a.reshape(-1), lam.reshape(-1), reaction.reshape(-1), work, g, g + 1, True, refinements,
                )  # fmt: skip
                loss[g] = work[: n * k.FACTORS * lanes].reshape(n, k.FACTORS, lanes)[:, -1]

        workers = min(threads or os.cpu_count() or 1, groups)
        if workers <= 1:
            some(0, groups)
        else:
            edges = np.linspace(0, groups, workers + 1).astype(int).tolist()
            with ThreadPoolExecutor(workers) as pool:
                list(pool.map(some, edges[:-1], edges[1:]))
        multipliers = apart(lam, batch, (n,))
        return ChainMotion(
            apart(a, batch, (n + 1, self.dimension)), multipliers, multipliers * self.lengths,
            apart(reaction, batch, (self.dimension,)), apart(loss, batch, (n,)),
        )  # fmt: skip

    def _check(self, solved: ChainMotion) -> None:
        worst = np.abs(solved.cancellation).reshape(-1, self.rods)
        bad = ~(worst < _REFUSE)
        if bad.any():
            rod = int(np.argwhere(bad)[:, 1].max())  # a failure there spoils all inboard rods
            raise ModelError(
                f"the motion of the outer point of rod {rod} is not determined: it has no inertia in some "
                "direction. Give it mass, or the rod inertia"
            )
        if not np.isfinite(solved.accelerations).all():
            raise ModelError(
                "the accelerations are too large for floating-point numbers: check units and scales"
            )

    def _vectors(self, name: str, points: ArrayLike | None, other: str, vectors: ArrayLike | None) -> Array:
        if (points is None) == (vectors is None):
            raise ModelError(f"expected either {name} of the points or {other} of the rods")
        if vectors is not None:
            return shaped(other, vectors, (self.rods, self.dimension))
        p = self._points(name, points)
        along = p[..., 1:, :] - p[..., self.parents, :]
        if name == "positions":
            on_length(along, self.lengths)
        return along

    def _points(self, name: str, values: Any) -> Array:
        return shaped(name, values, (self.rods + 1, self.dimension))

    def _force(self, forces: ArrayLike | None, batch: tuple[int, ...]) -> Array:
        shape = (*batch, self.rods + 1, self.dimension)
        if forces is None:
            return np.broadcast_to(self._weight, shape)
        array = self._points("forces", forces)
        if array.shape[:-2] not in ((), batch):
            raise ModelError(f"forces have shape {array.shape}, expected {shape}")
        return np.broadcast_to(self._weight + array, shape)
