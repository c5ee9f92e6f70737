"""The four-bar of the thesis in large rotation, assembled from the energies of its elements with NumPy alone.

Energies of ``docs/method_elastic.md``, elements in large rotation; forces by Lagrange's equation, with derivatives by
complex steps. Nothing of symgen is used. SI units.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss
from shared.thesis_assembly import (
    AREA,
    BEARING,
    COUPLER,
    CRANK,
    FT,
    LBF,
    MASS,
    OUTPUT,
    SECOND,
    SLUG,
    YOUNG,
)

LINKS = {
    "crank": (CRANK * FT, None, "A"),
    "coupler": (COUPLER * FT, "A", "B"),
    "output": (OUTPUT * FT, "B", None),
}
LINE, AXIAL, BENDING = MASS * SLUG / FT, YOUNG * AREA * LBF, YOUNG * SECOND * LBF * FT**2
ROTARY = 5.292 * SECOND * SLUG * FT
_STEP = 1e-30
POINTS, WEIGHTS = leggauss(4)


@dataclass(frozen=True)
class Assembly:
    """The linkage in ``count`` elements a link, over unknowns of these names."""

    names: tuple[str, ...]
    count: int

    def nodes(self, link):
        """Places of x, y, theta of the nodes of a link."""
        _, first, last = LINKS[link]
        ends = {0: first, self.count: last}
        for k in range(self.count + 1):
            point = ends.get(k)
            place = [f"{point}.{axis}" if point else f"{link}.{axis}@{k + 1}" for axis in "xy"]
            yield [self.names.index(name) for name in (*place, f"{link}.theta@{k + 1}")]

    @cached_property
    def elements(self):
        return [*self._elements()]

    def _elements(self):
        for link, (length, *_) in LINKS.items():
            nodes = list(self.nodes(link))
            yield from ((length / self.count, one + two) for one, two in pairwise(nodes))

    def kinetic(self, q, v):
        x, weights = (POINTS + 1) / 2, WEIGHTS / 2
        h1, h2, h3, h4 = 2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x, 3 * x**2 - 2 * x**3, x**3 - x**2
        total = 0.0
        for length, places in self.elements:
            (_, _, a1, _, _, a2), (u1, w1, b1, u2, w2, b2) = q[places], v[places]
            along = h1 * u1 + h3 * u2 - length * (h2 * np.sin(a1) * b1 + h4 * np.sin(a2) * b2)
            across = h1 * w1 + h3 * w2 + length * (h2 * np.cos(a1) * b1 + h4 * np.cos(a2) * b2)
            turns = (1 - x) * b1 + x * b2
            total += weights @ (LINE * (along**2 + across**2) + ROTARY * turns**2) * length / 2
        for point in "AB":
            x, y = (v[self.names.index(f"{point}.{axis}")] for axis in "xy")
            total += BEARING * SLUG * (x**2 + y**2) / 2
        return total

    def strain(self, q):
        total = 0.0
        for length, places in self.elements:
            x1, y1, a1, x2, y2, a2 = q[places]
            along, across = x2 - x1, y2 - y1
            apart = np.sqrt(along**2 + across**2)
            one, two = (np.arcsin((along * np.sin(a) - across * np.cos(a)) / apart) for a in (a1, a2))
            stretch = apart / length - 1 + (2 * one**2 - one * two + 2 * two**2) / 30
            total += AXIAL * length / 2 * stretch**2
            total += BENDING / (2 * length) * ((two - one) ** 2 + 3 * (one + two) ** 2)
        return total

    def momentum(self, q, v):
        """T by each rate, of which it is a quadratic form."""
        return np.array([(self.kinetic(q, v + e) - self.kinetic(q, v - e)) / 2 for e in np.eye(len(v))])

    def mass(self, q):
        return np.array([self.momentum(q, e) for e in np.eye(len(q))])

    def residual(self, q, v):
        """d/dt (dT/dv) - dT/dq + dV/dq at second rates of zero."""
        rate = np.imag(self.momentum(q + 1j * _STEP * v, v)) / _STEP
        moved = [q + 1j * _STEP * e for e in np.eye(len(q))]
        return rate + np.array([np.imag(self.strain(x) - self.kinetic(x, v)) / _STEP for x in moved])
