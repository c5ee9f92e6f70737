"""Elastic links in space in elements: their nodes, at the points of links among others, and their kernels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from symgen.errors import check_joints
from symgen.runtime._constrained import Elements
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.elements import kernels, rows_at
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.elastic_description import BeamInfo

BLOCK = "director_beam"
#: Numbers that each of the kernels writes.
_WRITTEN = {"residual": 24, "tangent": 3 * 576, "energies": 4, "section": 14}
#: Column of the damping among those of sections.
DAMPING = 8
#: Column of Young's modulus.
_MODULUS = 14
#: First column of the direction of the width among them.
_WIDTH = 16


@dataclass(frozen=True, slots=True)
class LinkInSpace:
    """One elastic link in elements.

    Attributes
    ----------
    places
        Unknowns of its nodes, (nodes, 12).
    fractions
        Where the nodes are, as fractions of the length; with tangents if these have them.
    nodes
        Numbers of the nodes at its points.
    arguments
        Numbers that its elements read, (elements, numbers), or (1, numbers) of equal elements.
    section
        The row of the kernel ``constants``.
    """

    info: BeamInfo
    places: Indices
    fractions: Array
    nodes: Mapping[str, int]
    arguments: Array
    section: Array

    @property
    def elements(self) -> Indices:
        """Unknowns of each element, (elements, 24)."""
        return np.hstack([self.places[:-1], self.places[1:]])

    @property
    def between(self) -> Indices:
        """Unknowns of the nodes that are at no point, (nodes, 12)."""
        return np.delete(self.places, [*self.nodes.values()], axis=0)

    @property
    def length(self) -> Any:
        """Undeformed length [m]."""
        return self.section[0]

    @property
    def modulus(self) -> float:
        """Young's modulus [Pa]."""
        return float(self.section[_MODULUS].real)

    @property
    def width(self) -> Array:
        """Direction of the width at the start, (3,)."""
        return self.section[_WIDTH : _WIDTH + 3]

    def values(
        self, kernel: str, q: Array, v: Array, a: Array, of: slice = slice(None), fraction: Any = 0.0
    ) -> Array:
        """Return the output of a kernel at states (times, unknowns), (times, elements, numbers)."""
        at, width = self.elements[of], _WRITTEN[kernel]
        arguments = self.arguments if len(self.arguments) == 1 else self.arguments[of]
        properties = np.hstack([arguments, np.full((len(arguments), 1), fraction)])
        if np.iscomplexobj(q):
            rows = np.concatenate([x[:, at] for x in (q, v, a)], axis=2)
            groups = (
                [(slice(None), properties[0])]
                if len(arguments) == 1
                else [(slice(k, k + 1), p) for k, p in enumerate(properties)]
            )
            of_elements = [
                rows_at(BLOCK, kernel, rows[:, k].reshape(-1, 72), 24, p, width).reshape(len(q), -1, width)
                for k, p in groups
            ]
            return np.concatenate(of_elements, axis=1)
        elements = Elements(kernels(BLOCK).ADDRESSES, at, properties.real, damped=False)
        return elements.values(kernel, width, q, v, a)

    def resultants(self, q: Array, v: Array, a: Array, fraction: Any) -> Array:
        """Return the results of the kernel ``section`` at a fraction of the length, (times, 14)."""
        k = int(np.searchsorted(self.fractions.real[1:-1], np.real(fraction), side="right"))
        low, high = self.fractions[k : k + 2]
        return self.values("section", q, v, a, slice(k, k + 1), (fraction - low) / (high - low))[:, 0]

    def forces(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Return the force on the link at each of its points [N], (times, 3)."""
        of = self.values("residual", q, v, a)
        on_nodes = np.zeros((len(q), len(self.places), 3), of.dtype)
        on_nodes[:, :-1] += of[..., :3]
        on_nodes[:, 1:] += of[..., 12:15]
        return {point: on_nodes[:, node] for point, node in self.nodes.items()}


def links_in_space(
    d: Description, constants: Mapping[str, Array], divided: int, elements: int | None
) -> tuple[list[LinkInSpace], list[tuple[Indices, int]], int]:
    """Return the links in elements, ends on the ground with their points, and the number of all unknowns.

    The first unknowns are the coordinates of free points, which nodes there share. Parts of a link between
    two points have elements in proportion to their length, at least one.

    Raises
    ------
    SceneError
        For points between the ends of a link at or next to an end or each other.
    """
    links, pins, size = list[LinkInSpace](), list[tuple[Indices, int]](), d.coordinates
    prescribed = iter(constants["fractions"].ravel()) if "fractions" in constants else iter(())
    for info, row in zip(
        d.elastic.beams if d.elastic else (), np.atleast_2d(constants["sections"]), strict=True
    ):
        between = sorted(((name, next(prescribed)) for name, _ in info.between), key=lambda of: of[1].real)
        check_joints(info.link, (info.start, info.end), [(name, at.real) for name, at in between])
        at = {info.start: 0.0, **dict(between), info.end: 1.0}
        ends = np.array([*at.values()])
        counts = (
            np.maximum(1, np.rint(np.diff(ends.real) * (elements or info.elements)).astype(int)) * divided
        )
        shares = [np.linspace(0.0, 1.0, n, endpoint=False) for n in counts]
        parts = [a + (b - a) * x for a, b, x in zip(ends[:-1], ends[1:], shares, strict=True)]
        fractions = np.append(np.concatenate(parts), 1.0)
        nodes = dict(zip(at, [0, *np.cumsum(counts).tolist()], strict=True))
        places = np.zeros((len(fractions), 12), dtype=np.intp)
        of_node = {node: point for point, node in nodes.items()}
        for node, node_places in enumerate(places):
            point = of_node.get(node)
            if point is not None and point in d.free:
                first = 3 * d.free.index(point)
                node_places[:3] = range(first, first + 3)
            else:
                node_places[:3] = range(size, size + 3)
                size += 3
                if point is not None:
                    pins.append((node_places[:3], d.points.index(point)))
            node_places[3:] = range(size, size + 9)
            size += 9
        lengths = row[0] * np.diff(ends) / counts
        lengths = lengths if len(counts) == 1 else np.repeat(lengths, counts)
        arguments = np.hstack([lengths[:, None], np.tile(row[1:_WIDTH], (len(lengths), 1))])
        links.append(LinkInSpace(info, places, fractions, nodes, arguments, row))
    return links, pins, size
