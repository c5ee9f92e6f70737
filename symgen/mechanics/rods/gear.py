"""Two gears whose axes a carrier holds: n_a (phi_a - phi_c) + n_b (phi_b - phi_c) keeps its drawn value.

The numbers of teeth n are whole, n_b negative for internal teeth. The sum is then known up to revolutions by
the directions of the links alone, and its change from the drawing is that of least magnitude: gears a tooth
apart mesh too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from symgen.mechanics.rods.particles import Vector


def turns(links: Sequence[str], teeth: Sequence[int], carrier: str) -> dict[str, int]:
    """Return the factor of the direction of each link in the sum, without that of the ground."""
    factors = dict(zip(links, teeth, strict=True))
    return factors | ({carrier: -sum(teeth)} if carrier else {})


def mesh_change(
    factors: Mapping[str, int], along: Mapping[str, Vector], drawn: Mapping[str, Vector]
) -> sp.Expr:
    """Return the change of the sum from the drawing [rad], by the vectors along the links [m]."""
    change = sp.Add(*(n * (_direction(along[k]) - _direction(drawn[k])) for k, n in factors.items()))
    return sp.atan2(sp.sin(change), sp.cos(change))


def mesh_error(change: sp.Expr) -> sp.Expr:
    """Return 2 tan(c/2)/cos(c/2)^2 of a change c: c where it is small, and infinite half a tooth off.

    Newton's method, with the slopes of c, leads back to a tooth from nearby alone, and fails for steps that
    are as wrong as that.
    """
    return 2 * sp.tan(change / 2) / sp.cos(change / 2) ** 2


def mesh_slopes(
    factors: Mapping[str, int], along: Mapping[str, Vector], lengths: Mapping[str, sp.Expr]
) -> dict[str, Vector]:
    """Return the slopes of the sum by the vectors along the links [1/m]: n (e_z x d)/l^2."""
    return {
        k: tuple(n * c / lengths[k] ** 2 for c in (-along[k][1], along[k][0]))
        for k, n in factors.items()
        if n
    }


def _direction(d: Vector) -> sp.Expr:
    return sp.atan2(d[1], d[0])
