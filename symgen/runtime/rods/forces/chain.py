"""One link cut into rigid elements, batched over poses: the equations of its section forces.

Source: the thesis on kineto-elastodynamics, Chapter IV. Elements share their nodes, so a section force (Fx,
Fy, M) is unknown to two of them. The assembled equations of a link are block-bidiagonal in its section
forces. Elimination from the first node leaves three equations of the forces at the joints: the section force
beyond the last node is zero. The section force beyond the first node, the other end of the link, is zero too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.elements import kernels
from symgen.runtime.kernels.evaluate import at_rows

#: How far from even a rod may be by rounding: of its mass, length and moment of inertia.
_ROUNDING = 1e-9


def of_element(kernel: str, q: Array, u: Array, p: tuple[float, ...], shape: tuple[int, ...]) -> Array:
    """Return the output of a kernel of a rigid element, (poses, *shape): q and u of shape (poses, 6)."""
    address = kernels("rigid_element").ADDRESSES[kernel]
    return at_rows(address, np.hstack([q, u]), 6, np.array(p), math.prod(shape)).reshape(len(q), *shape)


@dataclass(frozen=True, slots=True)
class Distribution:
    """Mass [kg/m] and rotary inertia [kg m] along a link, by power of x [m] from its first point."""

    mass: tuple[float, ...]
    rotary: tuple[float, ...]

    def between(self, low: float, high: float) -> tuple[float, float, float, float]:
        """Return mass, centre along and across over the length, and moment of inertia of a part."""

        def moment(coefficients: tuple[float, ...], power: int) -> float:
            return sum(
                c * (high ** (i + power + 1) - low ** (i + power + 1)) / (i + power + 1)
                for i, c in enumerate(coefficients)
            )

        mass, first, second = (moment(self.mass, power) for power in range(3))
        turning = moment(self.rotary, 0)
        if mass == 0.0:
            return 0.0, 0.5, 0.0, turning
        centre = first / mass
        return mass, (centre - low) / (high - low), 0.0, second - mass * centre**2 + turning


@dataclass(frozen=True)
class Attachment:
    """A force or couple on a link, at places of it.

    ``column`` is the number of its first unknown (-1 where it is known), ``values`` (poses, 2) or (poses, 1)
    the known force or couple; ``direction`` (poses, 2) for a force along a line with one unknown, or
    (poses, 1) for a couple that is a part of one; ``is_couple`` for a couple; ``at`` where it acts [m],
    ``share`` which part of the length that is, both for each pose.
    """

    at: Array
    share: Array
    column: int = -1
    values: Array | None = None
    direction: Array | None = None
    is_couple: bool = False


@dataclass(frozen=True)
class ElementChain:
    """One link of n elements at some poses: ``places`` and ``accelerations`` of its ends, (poses, 2, 2)."""

    name: str
    elements: int
    places: Array
    accelerations: Array
    gravity: Array
    body: tuple[float, float, float, float]
    distribution: Distribution | None
    attached: tuple[Attachment, ...]
    unknowns: int

    @cached_property
    def length(self) -> float:
        """Its largest length in any pose [m], by which moments are divided."""
        return float(np.max(np.linalg.norm(self.places[:, 1] - self.places[:, 0], axis=1)))

    def mass_of(self, low: float, high: float) -> tuple[float, float, float, float]:
        """Return the mass properties of a part of the link between two shares of its length."""
        if self.distribution is None:
            return self.body
        return self.distribution.between(low * self.length, high * self.length)

    def onward(self, low: float, high: float, section: Array, constant: Array) -> tuple[Array, Array]:
        """Return the section force at ``high`` from that at ``low``, by one element between them.

        A section force is ``section @ x + constant`` of the unknowns x: shapes (poses, 3, unknowns), (poses,
        3).
        """
        ends = [self._between(s) for s in (low, high)]
        nodes = np.hstack([e[0] for e in ends])
        moved = np.hstack([*(e[1] for e in ends), np.broadcast_to(self.gravity, (len(nodes), 2))])
        p = self.mass_of(low, high)
        q = np.hstack([nodes, nodes[:, :2]])
        d = of_element("nodal_matrix", q, moved, p, (3, 6))
        right = of_element("inertia", q, moved, p, (3,)) - np.einsum("kij,kj->ki", d[:, :, :3], constant)
        left = -d[:, :, :3] @ section
        for a in self.attached:
            inside = ((a.share >= low) & (a.share < high)) | ((high == 1.0) & (a.share >= 1.0))
            inside |= (low == 0.0) & (a.share < 0.0)
            if not np.any(inside):
                continue
            if a.is_couple:
                acting = np.zeros((len(nodes), 3, 1))
                acting[inside, 2, 0] = 1.0
            else:
                lever = of_element("point_matrix", np.hstack([nodes, a.at]), moved, p, (3, 2))
                acting = lever * inside[:, None, None]
            if a.direction is not None:
                acting = acting @ a.direction[:, :, None]
            if a.values is not None:
                right = right - np.einsum("kij,kj->ki", acting, a.values)
            else:
                left[:, :, a.column : a.column + acting.shape[2]] -= acting
        solved = np.linalg.solve(d[:, :, 3:], np.concatenate([left, right[:, :, None]], axis=2))
        return solved[:, :, :-1], solved[:, :, -1]

    def _between(self, share: float) -> tuple[Array, Array]:
        """Return place and acceleration at a share of the length."""
        both = (self.places, self.accelerations)
        first, second = ((1.0 - share) * x[:, 0] + share * x[:, 1] for x in both)
        return first, second

    def end(self) -> tuple[Array, Array]:
        """Return the section force beyond the last node, which vanishes, over the unknowns."""
        poses = len(self.places)
        section, constant = np.zeros((poses, 3, self.unknowns)), np.zeros((poses, 3))
        for i in range(self.elements):
            section, constant = self.onward(i / self.elements, (i + 1) / self.elements, section, constant)
        return section, constant

    def sections(self, x: Array, shares: tuple[float, ...]) -> Array:
        """Return the section forces (Fx, Fy, M) at shares of the length, (poses, shares, 3).

        The unknowns x are known. Within an element they follow from its node and the part of it before the
        section.
        """
        nodes = [i / self.elements for i in range(self.elements)]
        known = self.with_unknowns(x)
        sections, at_node = {}, np.zeros((len(x), 3))
        none = np.zeros((len(x), 3, 0))
        for low, high in zip(nodes, [*nodes[1:], 1.0], strict=True):
            for share in shares:
                if low < share < high:
                    sections[share] = known.onward(low, share, none, at_node)[1]
            sections[low] = at_node
            if high <= max(shares):
                at_node = known.onward(low, high, none, at_node)[1]
        return np.stack([sections[s] for s in shares], axis=1)

    def with_unknowns(self, x: Array) -> ElementChain:
        """Return the link with its unknown forces known."""
        attached = []
        for a in self.attached:
            width = 1 if a.is_couple or a.direction is not None else 2
            values = a.values if a.values is not None else x[:, a.column : a.column + width]
            attached.append(replace(a, column=-1, values=values))
        return replace(self, attached=tuple(attached), unknowns=0)


def even(body: tuple[float, float, float, float], length: float) -> Distribution | None:
    """Return the distribution of an even slender rod of these mass properties; None when it is none."""
    mass, along, across, moment = body
    slender = abs(moment - mass * length**2 / 12) <= _ROUNDING * mass * length**2
    if slender and abs(along - 0.5) <= _ROUNDING and abs(across) <= _ROUNDING:
        return Distribution((mass / length,), (0.0,))
    return Distribution((0.0,), (0.0,)) if mass == 0.0 and moment == 0.0 else None
