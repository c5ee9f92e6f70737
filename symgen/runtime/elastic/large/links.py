"""Elastic links as beam elements in large rotation: their kernels, and strains and deflections along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from symgen.runtime._constrained import Elements
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.data import Properties
from symgen.runtime.beams.elements import at as value_at
from symgen.runtime.beams.elements import integral, kernels
from symgen.runtime.beams.links import Beam

BLOCK = "corotational_beam"
#: Numbers that each kernel writes.
_WRITTEN = {"residual": 6, "strains": 5}
#: Column of the damping in the properties of elements.
_DAMPING = 6
#: Relative difference of equal sections of two elements, by rounding.
_EQUAL = 1e-12


@dataclass(frozen=True, slots=True)
class LargeLink:
    """One elastic link in elements.

    ``nodes`` are fractions of its length, ``places`` their unknowns, (nodes, 3), and ``properties`` the
    arguments of the kernels for each element, (elements, 9). States are those of the linkage,
    (times, unknowns).
    """

    beam: Beam
    nodes: tuple[float, ...]
    places: Indices
    properties: Array

    @property
    def elements(self) -> Indices:
        """Unknowns of each element, (elements, 6)."""
        return np.hstack([self.places[:-1], self.places[1:]])

    def at(self, fraction: float) -> tuple[int, float]:
        """Return the element at a fraction of the length, and the fraction of the element."""
        nodes = np.array(self.nodes)
        k = min(max(int(np.searchsorted(nodes, fraction, side="right")) - 1, 0), len(nodes) - 2)
        return k, float((fraction - nodes[k]) / (nodes[k + 1] - nodes[k]))

    def end_forces(self, q: Array, v: Array, a: Array) -> Array:
        """Return forces [N] and moments [N m] on both ends of every element, (times, elements, 6)."""
        return values("residual", self.elements, self.properties, q, v, a)

    def _end_rotations(self, q: Array) -> Array:
        """Return the results of the kernel ``strains``, (times, elements, 5)."""
        still = np.zeros_like(q)
        return values("strains", self.elements, self.properties, q, still, still)

    def strains(self, q: Array, v: Array, a: Array, fraction: float) -> tuple[Array, Array]:
        """Return axial strain and curvature [1/m] at a fraction of the length, (times,).

        They follow from forces and moments at the ends of an element, which contain its inertia. The bending
        moment between them is that of the cubic deflection, corrected at the ends, and not at its two Gauss
        points, where it is as accurate as at the nodes; the axial force is linear.
        """
        k, x = self.at(fraction)
        one = replace(self, places=self.places[k : k + 2], properties=undamped(self.properties[k : k + 1]))
        force, (*_, first, second) = one.end_forces(q, v, a)[:, 0].T, one._end_rotations(q)[:, 0].T
        ends = (1 - x) * (-force[2] - first) + x * (force[5] - second)
        moment = (1 - x) * first + x * second + ends * (1 - 6 * x * (1 - x))
        start, end = one.elements[0, [2, 5]]
        axial = -(1 - x) * _along(q[:, start], *force[:2]) + x * _along(q[:, end], *force[3:5])
        place = fraction * self.beam.properties.length
        stiffnesses = self.beam.properties.axial, self.beam.properties.bending
        axial_stiffness, bending_stiffness = (value_at(x, place) for x in stiffnesses)
        return axial / axial_stiffness, moment / bending_stiffness

    def forces(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Return the force on the link at each of its ends [N], (times, 2)."""
        ends, info = self.end_forces(q, v, a), self.beam.info
        return {info.start: ends[:, 0, :2], info.end: ends[:, -1, 3:5]}

    def place(self, q: Array, fraction: float) -> Array:
        """Return the place of a section [m], (times, 2)."""
        k, x = self.at(fraction)
        first, second = (q[:, self.places[node, :2]].T for node in (k, k + 1))
        _, *rotations, _, _ = self._end_rotations(q)[:, k].T
        chord = second - first
        _, first_slope, _, second_slope = hermite(x)
        bow = first_slope * rotations[0] + second_slope * rotations[1]
        return (first + x * chord + bow * np.stack([-chord[1], chord[0]])).T

    def deflection(self, q: Array, fraction: float) -> Array:
        """Return the distance [m] of a place, to the left, from the line between the ends, (times,)."""
        start, end = (q[:, self.places[node, :2]].T for node in (0, -1))
        whole, place = end - start, self.place(q, fraction).T - start
        return (whole[0] * place[1] - whole[1] * place[0]) / np.linalg.norm(whole, axis=0)


def values(kernel: str, elements: Indices, properties: Array, q: Array, v: Array, a: Array) -> Array:
    """Return the results of a kernel for elements at states (times, unknowns), (times, elements, numbers)."""
    elements_of_link = Elements(kernels(BLOCK).ADDRESSES, elements, properties, damped=False)
    return elements_of_link.values(kernel, _WRITTEN[kernel], q, v, a)


def undamped(properties: Array) -> Array:
    """Return the properties of elements without damping."""
    copied = properties.copy()
    copied[:, _DAMPING] = 0.0
    return copied


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
    # Elements of the same section are the same to the last bit.
    rows_of_elements = np.array(rows)
    return np.where(
        np.abs(rows_of_elements - rows_of_elements[0]) <= _EQUAL * np.abs(rows_of_elements[0]),
        rows_of_elements[0],
        rows_of_elements,
    )


def hermite(x: float) -> tuple[float, float, float, float]:
    """Return Hermite's cubics at x of an element of length one: end and slope of the first, of the second."""
    return 2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x, 3 * x**2 - 2 * x**3, x**3 - x**2


def _along(angle: Array, x: Array, y: Array) -> Array:
    """Return the component of vectors along directions."""
    return np.cos(angle) * x + np.sin(angle) * y
