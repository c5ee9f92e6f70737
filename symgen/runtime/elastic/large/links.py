"""Elastic links as beam elements in large rotation: their kernels, and strains and deflections along them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.beams.data import Properties
from symgen.runtime.beams.elements import at as value_at
from symgen.runtime.beams.elements import integral, kernels
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.large.collocation import Moment
from symgen.runtime.kernels.evaluate import at_rows

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_BLOCK = "corotational_beam"
#: Numbers that each kernel writes.
_WRITTEN = {"residual": 6, "tangent": 108, "energies": 3, "strains": 5}
#: Column of the damping in the properties of elements.
_DAMPING = 6
#: Relative difference of equal sections of two elements, by rounding.
_EQUAL = 1e-12


@dataclass(frozen=True, slots=True)
class LargeLink:
    """One elastic link in elements.

    ``nodes`` are fractions of its length, ``places`` their unknowns, (nodes, 3), and ``properties`` the
    arguments of the kernels for each element, (elements, 9).
    """

    beam: Beam
    nodes: tuple[float, ...]
    places: Indices
    properties: Array
    #: Whether all elements are the same, and are computed in one call.
    uniform: bool = field(init=False)
    #: Unknowns of each element, (elements, 6).
    elements: Indices = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "uniform", not np.any(self.properties != self.properties[0]))
        object.__setattr__(self, "elements", np.hstack([self.places[:-1], self.places[1:]]))

    @property
    def undamped(self) -> LargeLink:
        """The link without damping."""
        properties = self.properties.copy()
        properties[:, _DAMPING] = 0.0
        return replace(self, properties=properties)

    def call(self, kernel: str, q: Array, rates: Array | None = None) -> Array:
        """Return the output of a kernel for every element, (..., elements, numbers), at states before it."""
        shape, count = q.shape[:-1], len(self.properties)
        rows = np.zeros((q.size // 6, 18))
        rows[:, :6] = q.reshape(-1, 6)
        if rates is not None:
            rows[:, 6:] = rates.reshape(-1, 12)
        address, width = kernels(_BLOCK).ADDRESSES[kernel], _WRITTEN[kernel]
        if self.uniform:
            return at_rows(address, rows, 6, self.properties[0], width).reshape(*shape, -1)
        out = np.empty((len(rows), width))
        for k, own in enumerate(self.properties):
            out[k::count] = at_rows(address, np.ascontiguousarray(rows[k::count]), 6, own, width)
        return out.reshape(*shape, -1)

    def at(self, fraction: float) -> tuple[int, float]:
        """Return the element at a fraction of the length, and the fraction of the element."""
        nodes = np.array(self.nodes)
        k = min(max(int(np.searchsorted(nodes, fraction, side="right")) - 1, 0), len(nodes) - 2)
        return k, float((fraction - nodes[k]) / (nodes[k + 1] - nodes[k]))

    def end_forces(self, moment: Moment) -> Array:
        """Return forces [N] and moments [N m] on both ends of every element, (elements, 6)."""
        at = self.elements
        return self.call("residual", moment.q[at], np.hstack([moment.v[at], moment.a[at]]))

    def strains(self, moment: Moment, fraction: float) -> tuple[float, float]:
        """Return axial strain and curvature [1/m] at a fraction of the length, from the forces there.

        Forces and moments at the ends of an element contain its inertia. The bending moment between them is
        that of the cubic deflection, corrected at the ends, and not at its two Gauss points, where it is as
        accurate as at the nodes; the axial force is linear.
        """
        k, x = self.at(fraction)
        one, p = (
            replace(self, places=self.places[k : k + 2], properties=self.properties[k : k + 1]),
            self.beam.properties,
        )
        (force,), q = one.undamped.end_forces(moment), moment.q[one.elements]
        *_, first, second = one.call("strains", q)[0]
        ends = (1 - x) * (-force[2] - first) + x * (force[5] - second)
        moment_there = (1 - x) * first + x * second + ends * (1 - 6 * x * (1 - x))
        axial = -force[:2] @ _axis(q[0, 2]), force[3:5] @ _axis(q[0, 5])
        along, place = (1 - x) * axial[0] + x * axial[1], fraction * p.length
        return float(along / value_at(p.axial, place)), float(moment_there / value_at(p.bending, place))

    def deflection(self, q: Array, fraction: float) -> float:
        """Return the distance [m] of a place, to the left, from the line between the ends."""
        k, x = self.at(fraction)
        first, second = q[self.places[k, :2]], q[self.places[k + 1, :2]]
        _, *rotations, _, _ = self.call("strains", q[self.elements])[k]
        chord = second - first
        _, first_slope, _, second_slope = hermite(x)
        bow = first_slope * rotations[0] + second_slope * rotations[1]
        place = first + x * chord + bow * np.array([-chord[1], chord[0]])
        start, end = q[self.places[0, :2]], q[self.places[-1, :2]]
        return float(cross(end - start, place - start) / np.linalg.norm(end - start))


def element_properties(properties: Properties, nodes: Sequence[float], gravity: Array) -> Array:
    """Return length, section, damping and gravity of every element, (elements, 9)."""
    rows: list[list[float]] = []
    p = properties
    for a, b in pairwise(x * p.length for x in nodes):
        length, middle = b - a, (a + b) / 2
        mass, rotary = ((integral(c, b) - integral(c, a)) / length for c in (p.mass, p.rotary))
        bending, shear = value_at(p.bending, middle), value_at(p.shear, middle)
        flexible = 12 * bending / (shear * length**2) if shear else 0.0
        axial = value_at(p.axial, middle)
        rows.append([length, mass, rotary, axial, bending, flexible, p.stiffness_damping, *gravity])
    # Elements of the same section are the same to the last bit, and are computed in one call.
    found = np.array(rows)
    return np.where(np.abs(found - found[0]) <= _EQUAL * np.abs(found[0]), found[0], found)


def hermite(x: float) -> tuple[float, float, float, float]:
    """Return Hermite's cubics at x of an element of length one: end and slope of the first, of the second."""
    return 2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x, 3 * x**2 - 2 * x**3, x**3 - x**2


def _axis(angle: float) -> Array:
    return np.array([math.cos(angle), math.sin(angle)])


def cross(a: Array, b: Array) -> float:
    """Return the component of a x b across the plane."""
    return float(a[0] * b[1] - a[1] * b[0])
