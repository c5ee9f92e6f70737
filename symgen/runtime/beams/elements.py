"""The finite elements along a link: arguments and results of the kernels ``element_NAME``.

Numbers of a link may be complex where derivatives are taken: imaginary parts are then tangents, so small that
their products vanish, and those of results follow from the kernels ``element_NAME_tangents``.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from math import comb
from typing import Any

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.data import Lump, Profile, Properties
from symgen.runtime.kernels.elastic_description import BeamInfo
from symgen.runtime.kernels.evaluate import at_rows
from symgen.runtime.kernels.library import shipped_module

#: Rows that the kernels ``shape`` give, in their order.
SHAPES = ("u", "w", "slope", "rotation", "axial_strain", "curvature")
#: Shortest element next to a load, as a part of the length: shorter ones are stiff and change nothing.
_SHORTEST = 0.01
#: Distance of places that are the same, as a part of the length.
SAME = 1e-9
#: The unknown of a node that is not continuous where a couple acts.
_CURVATURE = "kappa"
#: Results of the kernel ``point`` of ``elastic_place``.
AT_A_PLACE = (
    "mass", "gyroscopic", "geometric0", "load_x", "load_y", "load_out", "load_turn", "force_x", "force_y",
    "follower_x", "follower_y", "rotary_mass", "rotary_load_turn",
)  # fmt: skip


#: Kernels of elements that have no shipped module, by the name of their block, which names one definition.
SUPPLIED: dict[str, Any] = {}


def kernels(block: str) -> Any:
    """Return the compiled module of a building block, or its supplied substitute."""
    return SUPPLIED.get(block) or shipped(block)


@cache
def shipped(block: str) -> Any:
    """Return the shipped kernels of a block."""
    return shipped_module(block)


def _evaluated(block: str, name: str, q: Array, u: Array | None = None) -> Array:
    """Return the result of a kernel of a building block, with its tangent for complex arguments."""
    station = np.zeros(1) if u is None else u
    if not (np.iscomplexobj(q) or np.iscomplexobj(station)):
        return getattr(kernels(block), name)(q=q, u=u)
    arguments = {"q": np.real(q).copy(), "u": np.real(station).copy()}
    seeds = np.concatenate([np.imag(q), np.imag(station)])
    value, tangent = (
        getattr(kernels(module), kernel)(**arguments, **more)
        for module, kernel, more in (
            (block, name, {}),
            (f"{block}_tangents", f"{name}_tangent", {"work": seeds}),
        )
    )
    return value + 1j * tangent


def rows_at(block: str, kernel: str, rows: Array, n: int, parameters_of_rows: Array, width: int) -> Array:
    """Return the results of a kernel of a building block for every row, (rows, width).

    Rows hold q, n numbers, and u; ``parameters_of_rows`` are parameters of all rows.
    Results have tangents if rows have.
    """
    plain, parameters = np.ascontiguousarray(rows.real), np.ascontiguousarray(parameters_of_rows.real)
    values = at_rows(kernels(block).ADDRESSES[kernel], plain, n, parameters, width)
    if not np.iscomplexobj(rows):
        return values
    tangents = np.broadcast_to(parameters_of_rows.imag, (len(rows), len(parameters_of_rows)))
    seeds = np.ascontiguousarray(np.hstack([rows.imag, tangents]))
    of_tangents = kernels(f"{block}_tangents").ADDRESSES[f"{kernel}_tangent"]
    return values + 1j * at_rows(of_tangents, plain, n, parameters, width, seeds)


def shifted(polynomial: Sequence[float], by: float) -> list[float]:
    """Return the coefficients by power of p(x + by), for those of p(x)."""
    n = len(polynomial)
    return [sum(comb(k, j) * polynomial[k] * by ** (k - j) for k in range(j, n)) for j in range(n)]


def at(polynomial: Sequence[float], x: float) -> float:
    """Return the value of a polynomial."""
    return sum(c * x**k for k, c in enumerate(polynomial))


def integral(polynomial: Sequence[float], x: float) -> float:
    """Return the integral of a polynomial from 0 to x."""
    return sum(c * x ** (k + 1) / (k + 1) for k, c in enumerate(polynomial))


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Return points and weights of the Gauss rule from -1 to 1."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return points, weights


def point(x: float) -> dict[str, Array]:
    """Return the constants of a link by a unit mass, force, axial force and moment of inertia at x [m].

    By name, (6, 6) or (6,) over the rows ``SHAPES``: see :mod:`symgen.mechanics.elastic.places`.
    """
    n, values = len(SHAPES), _evaluated("elastic_place", "point", np.array([x]))
    squares = {"mass", "gyroscopic", "geometric0", "follower_x", "follower_y", "rotary_mass"}
    shapes = {name: (n, n) if name in squares else (n,) for name in AT_A_PLACE}
    parts = np.split(values, np.cumsum([math.prod(shape) for shape in shapes.values()])[:-1])
    return {name: part.reshape(shapes[name]) for name, part in zip(AT_A_PLACE, parts, strict=True)}


@dataclass(frozen=True, slots=True)
class Segment:
    """One element of a link.

    Attributes
    ----------
    element, block
        Its name, and that of its kernels.
    start, length
        Where it begins [m] from the first point of the link, and how long it is [m].
    dofs
        Its unknowns among all those of the link, (n,): the first node's, the second node's, the inner ones.
    arguments
        What its kernels read, (20,): length and the section from its own first node.
    """

    element: str
    block: str
    start: float
    length: float
    dofs: tuple[int, ...]
    arguments: Array

    def matrix(self, name: str, count: int = 1, *, rotary: bool = True) -> Array:
        """Return a result of its kernels, shape (count, n, n) or (n, n) for one."""
        n = len(self.dofs)
        arguments = self.arguments
        if not rotary:
            arguments = arguments.copy()
            arguments[4:9] = 0.0
        matrix = self._call(name, arguments)
        return matrix.reshape(n, n) if count == 1 else matrix.reshape(count, n, n)

    def loads(self) -> Array:
        """Return E, G, Nv and Lv, shape (4, n), x from the element's first node."""
        return self._call("load", self.arguments).reshape(4, len(self.dofs))

    def shape(self, x: float) -> Array:
        """Return the rows ``SHAPES`` at x [m] from its first node, shape (6, n)."""
        return self._call("shape", self.arguments, np.array([x])).reshape(len(SHAPES), len(self.dofs))

    def _call(self, name: str, arguments: Array, x: Array | None = None) -> Array:
        return _evaluated(self.block, name, arguments, x)


def names(info: BeamInfo) -> tuple[str, ...]:
    """Return all unknowns of a link, before any is omitted: node, inner unknowns, node, ...

    ``u@2`` is u of node 2, counted from 1 at the link's first point; ``mid@1.2`` is between nodes 1 and 2.
    Where the curvature jumps, ``kappa@2+`` is that behind node 2.
    """
    jumps = _jumps(info)
    labels = []
    for i in range(info.elements + 1):
        if i:
            labels += [f"{dof}@{i}.{i + 1}" for dof in info.inner_dofs]
        labels += [f"{dof}@{i + 1}" for dof in info.node_dofs]
        labels += [f"{_CURVATURE}@{i + 1}+"] if i in jumps else []
    return tuple(labels)


def _jumps(info: BeamInfo) -> set[int]:
    """Return the nodes with a curvature on each side."""
    return {info.nodes.index(x) for x in info.jumps} if _CURVATURE in info.node_dofs else set()


def segments(info: BeamInfo, properties: Properties) -> tuple[Segment, ...]:
    """Return the elements of a link."""
    per_node, inner, n = len(info.node_dofs), len(info.inner_dofs), info.elements
    parts, first, jumps = [], 0, _jumps(info)
    for i in range(n):
        # Both ends by the same product, so that the elements leave no gap.
        start, stop = (_place(info, properties.length, k) for k in (i, i + 1))
        section = (properties.mass, properties.rotary, properties.axial, properties.bending, properties.shear)
        moved = [c for polynomial in section for c in shifted(polynomial, start)]
        behind = first + per_node + (i in jumps)
        second = behind + inner
        node = [*range(first, first + per_node)]
        if i in jumps:
            node[info.node_dofs.index(_CURVATURE)] = behind - 1
        dofs = (*node, *range(second, second + per_node), *range(behind, second))
        first = second
        arguments = np.array([stop - start, *moved])
        parts.append(Segment(info.element, info.block, start, stop - start, dofs, arguments))
    return tuple(parts)


def meshed(info: BeamInfo, length: float, lumps: Sequence[Lump], profiles: Sequence[Profile]) -> BeamInfo:
    """Return a link with a node at every joint, mass and force, and elements as requested between these."""
    bounds = [0.0, *(fraction for _, fraction in info.between), 1.0]
    at = [lump.at for lump in lumps] + [profile.at for profile in profiles if profile.is_point]
    for place in sorted(at):
        if all(abs(place / length - bound) > _SHORTEST for bound in bounds):
            insort(bounds, place / length)
    if len(bounds) == 2:
        return replace(info, jumps=())
    welded = [fraction for point, fraction in info.between if info.bent_at(point)]
    turned = [*welded, *(lump.at / length for lump in lumps if lump.inertia)]
    jumps = tuple(x for x in bounds[1:-1] if any(abs(x - place) < SAME for place in turned))
    nodes = [0.0]
    for start, end in pairwise(bounds):
        count = max(1, math.ceil((end - start) * info.elements - 1e-9))
        nodes += [start + (end - start) * k / count for k in range(1, count)] + [end]
    return replace(info, elements=len(nodes) - 1, nodes=tuple(nodes), jumps=jumps)


def _place(info: BeamInfo, length: float, node: int) -> float:
    return length * info.nodes[node] if info.nodes else length * node / info.elements


def segment_at(parts: Sequence[Segment], x: float) -> tuple[Segment, ...]:
    """Return the element at x [m] from the first point of the link; both where two of them meet."""
    length = parts[-1].start + parts[-1].length
    close = 1e-12 * length.real
    return tuple(s for s in parts if s.start.real - close <= x.real <= (s.start + s.length).real + close)
