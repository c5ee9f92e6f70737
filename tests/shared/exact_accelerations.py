"""Accelerations of rods under gravity to 40 digits: all unknowns in one dense elimination, no kernels."""

from __future__ import annotations

from typing import Any

import mpmath

from symgen.runtime.result.state import State
from symgen.scene.rods.linkage import Linkage

_DIGITS = 40


def exact_accelerations(linkage: Linkage, state: State) -> dict[str, list[Any]]:
    """Return the accelerations of the free points of rods under gravity [m/s^2], to 40 digits.

    Kinetic energy from velocity of the centre and rotation: T = m |v_c|^2/2 + J |v_2 - v_1|^2/(2 l^2),
    with d . d'' = -|d'|^2 for d from end to end; all unknowns in one dense elimination.
    """
    axes = linkage.dimension
    free = [p.name for p in linkage.points if not p.ground]
    with mpmath.workdps(_DIGITS):
        n, m = len(free) * axes, len(linkage.links)
        matrix, right = mpmath.zeros(n + m), mpmath.zeros(n + m, 1)
        gravity = [_exact(g) for g in linkage.gravity]
        for row, k in enumerate(linkage.links, n):
            mass, length, centre, inertia = (_exact(x) for x in (k.mass, k.length, k.centre, k.inertia))
            shares = {k.start: 1 - centre / length, k.end: centre / length}
            turn = {k.start: -1, k.end: 1}
            d, w = (
                [mpmath.mpf(a) - mpmath.mpf(b) for a, b in zip(of[k.end], of[k.start], strict=True)]
                for of in (state.positions, state.velocities)
            )
            right[row] = -mpmath.fdot(w, w)
            for a in set(shares) & set(free):
                for i in range(axes):
                    at = free.index(a) * axes + i
                    right[at] += mass * shares[a] * gravity[i]
                    matrix[at, row] = matrix[row, at] = turn[a] * d[i]
                    for b in set(shares) & set(free):
                        share = mass * shares[a] * shares[b] + inertia * turn[a] * turn[b] / length**2
                        matrix[at, free.index(b) * axes + i] += share
        solved = mpmath.lu_solve(matrix, right)
        return {p: [solved[i * axes + j] for j in range(axes)] for i, p in enumerate(free)}


def _exact(expression: Any) -> Any:
    return mpmath.mpmathify(expression.evalf(_DIGITS + 5))
