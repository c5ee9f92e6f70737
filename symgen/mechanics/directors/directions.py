"""A constraint on two directions: the scalar product of a vector of each of two rigid sections or bodies.

A direction a is the sum of three vectors A_i with constant factors, such as the directors of a node; a
direction b that of four, such as directors, fixed axes, or points of a rigid body with factors whose sum is
zero. The constraint is a . b = value. Orthonormal directors, and welded, revolute and universal joints of
elastic links are such constraints.

Source: P. Betsch, P. Steinmann, Constrained dynamics of geometrically exact beams, Computational Mechanics 31
(2003).
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from symgen.symbolic.names import Names
from symgen.symbolic.quantity import AXES, Quantity, quantity

_COUNTS = {"a": 3, "b": 4}


def _vectors(prefix: str, unit: str, about: str) -> tuple[Quantity, ...]:
    return tuple(
        quantity(f"{prefix}{side}{k}_{axis}", unit, f"{about}{axis} of vector {k} of direction {side}")
        for side, count in _COUNTS.items()
        for k in range(1, count + 1)
        for axis in AXES
    )


VECTORS = _vectors("", "SI", "")
RATES = _vectors("v_", "SI/s", "rate of the ")
FACTORS = tuple(
    quantity(f"factor_{side}{k}", "SI", f"factor of vector {k} in direction {side}")
    for side, count in _COUNTS.items()
    for k in range(1, count + 1)
)
VALUE = quantity("value", "1", "prescribed scalar product")


@dataclass(frozen=True, slots=True)
class Direction:
    """The constraint: error and rate (2, 1), slopes by ``VECTORS`` (21, 1), and slopes of these (21, 21)."""

    error: sp.ImmutableMatrix
    slopes: sp.ImmutableMatrix
    curvature: sp.ImmutableMatrix


def direction(names: Names) -> Direction:
    """Return the constraint over ``VECTORS``, ``RATES``, ``FACTORS`` and ``VALUE``."""
    of, rates, factors = ([q.symbol for q in group] for group in (VECTORS, RATES, FACTORS))
    split = 3 * _COUNTS["a"]
    sums = [
        [sp.Add(*(f * x for f, x in zip(factors_of_link, group[axis::3], strict=True))) for axis in range(3)]
        for group, factors_of_link in ((of[:split], factors[:3]), (of[split:], factors[3:]))
    ]
    a, b = (
        names.vector(f"direction_{side}", e, "1", f"direction {side}")
        for side, e in zip(_COUNTS, sums, strict=True)
    )
    slopes = [f * x for side, other in ((factors[:3], b), (factors[3:], a)) for f in side for x in other]
    product = sp.Add(*(x * y for x, y in zip(a, b, strict=True)))
    rate = sp.Add(*(s * v for s, v in zip(slopes, rates, strict=True)))
    # Names hide the vectors from differentiation.
    expanded = [
        f * x for side, other in ((factors[:3], sums[1]), (factors[3:], sums[0])) for f in side for x in other
    ]
    return Direction(
        error=sp.ImmutableMatrix([product - VALUE.symbol, rate]),
        slopes=sp.ImmutableMatrix(slopes),
        curvature=sp.ImmutableMatrix([[sp.diff(s, x) for x in of] for s in expanded]),
    )
