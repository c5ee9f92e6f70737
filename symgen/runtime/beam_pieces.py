"""Matrices of a link in its own axes: one piece per element, lumped masses in them, and all as one piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.beam_data import MATRICES, VECTORS, Lump, Piece, Properties
from symgen.runtime.beam_elements import Segment, integral, segment_at

Array = NDArray[np.float64]

#: Points of the Gauss rule for slopes squared: exact to degree 15, and they have 8 at most.
GAUSS = 8


def pieces(
    parts: Sequence[Segment], properties: Properties, lumps: Sequence[Lump], stiffening: bool
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
    for piece in found:
        at = np.array(piece.at)
        for name in MATRICES:
            fields[name][np.ix_(at, at)] += getattr(piece, name)
        for name in VECTORS:
            fields[name][at] += getattr(piece, name)
    return Piece(tuple(range(n)), **fields)


def transformed(piece: Piece, basis: Array) -> Piece:
    """Return a piece in the unknowns y of s = basis @ y, basis (n, k), constant in the link's axes."""
    fields: dict[str, Any] = {name: basis.T @ getattr(piece, name) @ basis for name in MATRICES}
    fields.update({name: basis.T @ getattr(piece, name) for name in VECTORS})
    return replace(piece, at=tuple(range(basis.shape[1])), **fields)
