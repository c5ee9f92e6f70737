"""Efforts of drives by d'Alembert's principle, from the places of particles as functions of the inputs.

Nothing of symgen is used. A place in the plane is a complex number, in space an array of three numbers; all numbers
have 60 digits, and derivatives are central differences of five points, with errors below 1e-25.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath as mp
import numpy as np

mp.mp.dps = 60
G = mp.mpf("9.81")
_STEP = mp.mpf(10) ** -9


def slopes(function: Callable[[Any], Any], x: Any) -> tuple[Any, Any]:
    """Return the first and the second derivative of a function of one number."""
    a, b, c, d, e = (function(x + k * _STEP) for k in (-2, -1, 0, 1, 2))
    return (a - 8 * b + 8 * d - e) / (12 * _STEP), (16 * (b + d) - 30 * c - a - e) / (12 * _STEP**2)


def efforts(
    places: Callable[[Sequence[Any]], Any],
    inputs: Callable[[Any], Sequence[Any]],
    masses: Sequence[Any],
    t: float,
    force: Callable[[Any, Any], Any],
) -> list[float]:
    """Return the forces [N] or torques [N m] of the drives of the inputs, at a time [s].

    ``places(q)`` are those of particles with ``masses`` [kg] at inputs q, and ``force(places, velocities)`` the
    forces on them [N].
    """
    time, q = mp.mpf(t), list(inputs(mp.mpf(t)))
    velocities, accelerations = slopes(lambda s: places(inputs(s)), time)
    m = np.array([mp.mpf(x) for x in masses])
    lacking = (accelerations.T * m).T - force(places(q), velocities)
    found = []
    for k, x in enumerate(q):
        moved = slopes(lambda y, k=k: places([*q[:k], y, *q[k + 1 :]]), x)[0]
        found.append(float(sum(mp.re(mp.conj(f) * d) for f, d in zip(lacking.flat, moved.flat, strict=True))))
    return found


def of_rods(*ends: tuple[Any, Any]) -> list[Any]:
    """Return the places of two particles for each uniform rod: half its mass each, at their radius of gyration."""
    return [(a + b) / 2 + s * (b - a) / mp.sqrt(12) for a, b in ends for s in (-1, 1)]


def of_body(a: Any, b: Any, drawn: Sequence[Any], mass: Any, inertia: Any) -> list[Any]:
    """Return two particles of half the mass of a planar body, which is drawn with a, b and its centre there."""
    first, second, centre = drawn
    middle = a + (b - a) * (centre - first) / (second - first)
    offset = mp.sqrt(mp.mpf(inertia) / mass) * (b - a) / abs(b - a)
    return [middle - offset, middle + offset]


def carried(a: Any, b: Any, drawn: Sequence[Any]) -> Any:
    """Return the place of a point of a planar body, which is drawn with a, b and this point there."""
    first, second, point = drawn
    return a + (b - a) * (point - first) / (second - first)


def meet(a: Any, b: Any, from_a: Any, from_b: Any, side: int) -> Any:
    """Return the point at these distances from a and b, to the left of the way from a to b for side 1."""
    d = b - a
    size = abs(d)
    along = (from_a**2 - from_b**2 + size**2) / (2 * size)
    return a + d / size * mp.mpc(along, side * mp.sqrt(from_a**2 - along**2))


def halves(*masses: str | float) -> list[Any]:
    """Return the masses of the particles of rods and bodies."""
    return [mp.mpf(m) / 2 for m in masses for _ in range(2)]


def rotation(x: Any, y: Any, z: Any) -> Any:
    """Return the matrix of rotations by these angles [rad], about the axes x, y and z in this order."""
    c, s = [mp.cos(a) for a in (x, y, z)], [mp.sin(a) for a in (x, y, z)]
    one = mp.mpf(1)
    first = np.array([[one, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    second = np.array([[c[1], 0, s[1]], [0, one, 0], [-s[1], 0, c[1]]])
    return np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, one]]) @ second @ first


def of_moments(mass: Any, inertia: Sequence[Any]) -> Any:
    """Return the places, about the centre, of six particles of a body with these moments about the axes."""
    total = sum(mp.mpf(i) for i in inertia)
    squares = [3 * (total / 2 - i) / mass for i in map(mp.mpf, inertia)]
    return np.array(
        [s * mp.sqrt(d) * row for d, row in zip(squares, np.eye(3, dtype=int), strict=True) for s in (-1, 1)]
    )
