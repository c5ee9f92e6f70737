"""Matrices of a link in its own axes: one piece per element, lumped masses in them, and all as one piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.beams.data import MATRICES, VECTORS, Lump, Piece, Profile, Properties
from symgen.runtime.beams.elements import Segment, integral, segment_at

Array = NDArray[np.float64]

#: Points of the Gauss rule for slopes squared: exact to degree 15, and they have 8 at most.
GAUSS = 8
#: Fields of a piece with a row for every force along the link.
SPREAD = ("force_x", "force_y", "force_axial")


def pieces(
    parts: Sequence[Segment],
    properties: Properties,
    lumps: Sequence[Lump],
    profiles: Sequence[Profile],
    stiffening: bool,
) -> tuple[Piece, ...]:
    """Return one piece per element of a link, before reduction and damping.

    A lump where two elements meet counts to the first of them.
    """
    owners = [segment_at(parts, lump.at)[0] for lump in lumps]
    rotary = any(properties.rotary)
    found = []
    for part in parts:
        own = [lump for lump, owner in zip(lumps, owners, strict=True) if owner is part]
        before = [
            lump for lump, owner in zip(lumps, owners, strict=True) if owner.start < part.start
        ]  # of whole elements
        found.append(_piece(part, properties, own, before, rotary, stiffening))
        spread = [_spread(part, profile, segment_at(parts, profile.at)[0]) for profile in profiles]
        shape = (len(profiles), len(part.dofs))
        x, y = (np.reshape([s[i] for s in spread], shape) for i in range(2))
        axial = np.reshape([s[2] * stiffening for s in spread], (*shape, shape[1]))
        found[-1] = replace(found[-1], force_x=x, force_y=y, force_axial=axial)
    return tuple(found)


def _piece(
    part: Segment,
    properties: Properties,
    own: Sequence[Lump],
    before: Sequence[Lump],
    rotary: bool,
    stiffening: bool,
) -> Piece:
    n, start = len(part.dofs), part.start
    fields: dict[str, Any] = {
        "mass": part.matrix("mass"),
        "gyroscopic": part.matrix("gyroscopic"),
        "stiffness": part.matrix("stiffness"),
        "damping": np.zeros((n, n)),
    }
    fields["centrifugal"] = part.matrix("mass", rotary=False) if rotary else fields["mass"].copy()
    loads = part.loads()
    loads[2:] += start * loads[:2]
    for lump in own:
        u, w = part.shape(lump.at - start)[:2]
        translation = lump.mass * (np.outer(u, u) + np.outer(w, w))
        fields["mass"] = fields["mass"] + translation
        fields["centrifugal"] = fields["centrifugal"] + translation
        fields["gyroscopic"] = fields["gyroscopic"] + lump.mass * (np.outer(u, w) - np.outer(w, u))
        loads += lump.mass * np.array([u, w, lump.at * u, lump.at * w])
    fields.update(zip(VECTORS, loads, strict=True))
    axial = _stiffening(part, properties, own, before) if stiffening else np.zeros((3, n, n))
    fields.update(zip(("axial0", "axial1", "axial2"), axial, strict=True))
    fields.update(zip(SPREAD, (np.zeros((0, n)), np.zeros((0, n)), np.zeros((0, n, n))), strict=True))
    return Piece(part.dofs, **fields)


def _stiffening(part: Segment, properties: Properties, own: Sequence[Lump], before: Sequence[Lump]) -> Array:
    """Return the integrals of Nw' Nw'^T times 1, the mass before x and its moment, shape (3, n, n).

    What stands before the element acts on the whole of it; a lump on it from there to its second node.
    """
    slopes, inside, inside_moment = part.matrix("geometric", 3)
    mass = integral(properties.mass, part.start) + sum(lump.mass for lump in before)
    moment = integral((0.0, *properties.mass), part.start) + sum(lump.mass * lump.at for lump in before)
    found = np.array([slopes, mass * slopes + inside, moment * slopes + part.start * inside + inside_moment])
    for lump in own:
        behind = slopes_squared(part, lump.at - part.start)
        found[1] += lump.mass * behind
        found[2] += lump.mass * lump.at * behind
    return found


def _spread(part: Segment, profile: Profile, owner: Segment) -> tuple[Array, Array, Array]:
    """Return the integrals of p Nu, of p Nw, and of Nw' Nw'^T times that of p before x, over one element."""
    if profile.is_point:
        place = profile.at - part.start
        u, w = part.shape(place)[:2] if owner is part else np.zeros((2, len(part.dofs)))
        behind = np.zeros((len(part.dofs), len(part.dofs)))
        if owner.start <= part.start:
            behind = slopes_squared(part, place if owner is part else 0.0)
        return u, w, behind
    points, weights = np.polynomial.legendre.leggauss(GAUSS)
    local, weights = part.length * (1 + points) / 2, part.length * weights / 2
    shapes, x = np.array([part.shape(p) for p in local]), part.start + local
    there = weights * (profile.even + profile.slope * x)
    before = weights * profile.before(x)
    slopes = shapes[:, 2]
    return there @ shapes[:, 0], there @ shapes[:, 1], (slopes * before[:, None]).T @ slopes


def slopes_squared(part: Segment, start: float) -> Array:
    """Return the integral of Nw' Nw'^T from ``start`` [m] to the second node of an element, (n, n)."""
    points, weights = np.polynomial.legendre.leggauss(GAUSS)
    half = (part.length - start) / 2
    rows = np.array([part.shape(start + half * (1 + p))[2] for p in points])
    result: Array = (rows * (half * weights)[:, None]).T @ rows
    return result


def whole(found: Sequence[Piece], n: int) -> Piece:
    """Return all pieces as one over the n unknowns of their link."""
    fields: dict[str, Array] = {name: np.zeros((n, n)) for name in MATRICES}
    fields.update({name: np.zeros(n) for name in VECTORS})
    count = len(found[0].force_x)
    fields.update(
        zip(SPREAD, (np.zeros((count, n)), np.zeros((count, n)), np.zeros((count, n, n))), strict=True)
    )
    for piece in found:
        at = np.array(piece.at)
        for name in MATRICES:
            fields[name][np.ix_(at, at)] += getattr(piece, name)
        for name in VECTORS:
            fields[name][at] += getattr(piece, name)
        fields["force_x"][:, at] += piece.force_x
        fields["force_y"][:, at] += piece.force_y
        fields["force_axial"][:, at[:, None], at] += piece.force_axial
    return Piece(tuple(range(n)), **fields)


def transformed(piece: Piece, basis: Array) -> Piece:
    """Return a piece in the unknowns y of s = basis @ y, basis (n, k), constant in the link's axes."""
    fields: dict[str, Any] = {name: basis.T @ getattr(piece, name) @ basis for name in MATRICES}
    fields.update({name: basis.T @ getattr(piece, name) for name in VECTORS})
    fields.update(force_x=piece.force_x @ basis, force_y=piece.force_y @ basis)
    fields["force_axial"] = basis.T @ piece.force_axial @ basis
    return replace(piece, at=tuple(range(basis.shape[1])), **fields)
