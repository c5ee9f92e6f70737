"""Matrices of a link in its own axes: one piece per element, lumped masses in them, and all as one piece."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from symgen.runtime._beams import MATRICES, SPREAD, VECTORS
from symgen.runtime.arrays import Array
from symgen.runtime.beams.data import Lump, Piece, Profile, Properties
from symgen.runtime.beams.elements import Segment, gauss, integral, point, segment_at

#: Points of the Gauss rule for slopes squared: exact to degree 15, and they have 8 at most.
GAUSS = 8


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
    superelements = []
    for part in parts:
        lumps_of_part = [lump for lump, owner in zip(lumps, owners, strict=True) if owner is part]
        before = [
            lump for lump, owner in zip(lumps, owners, strict=True) if owner.start.real < part.start.real
        ]  # of whole elements
        superelements.append(_piece(part, properties, lumps_of_part, before, rotary, stiffening))
        spread = [_spread(part, profile, segment_at(parts, profile.at)[0]) for profile in profiles]
        n = len(part.dofs)
        of_forces: dict[str, Any] = {
            name: np.reshape(
                [s[name] for s in spread], (len(profiles), *(n,) * (1 if name in SPREAD[:2] else 2))
            )
            for name in SPREAD
        }
        of_forces["force_axial"] = of_forces["force_axial"] * stiffening
        superelements[-1] = replace(superelements[-1], **of_forces)
    return tuple(superelements)


def _piece(
    part: Segment,
    properties: Properties,
    lumps: Sequence[Lump],
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
    fields.update(zip(VECTORS, loads, strict=True))
    for lump in lumps:
        shape, there = part.shape(lump.at - start), point(lump.at)
        for name in ("mass", "gyroscopic"):
            fields[name] = fields[name] + lump.mass * (shape.T @ there[name] @ shape)
        fields["centrifugal"] = fields["centrifugal"] + lump.mass * (shape.T @ there["mass"] @ shape)
        for name in VECTORS:
            fields[name] = fields[name] + lump.mass * (there[name] @ shape)
        fields["mass"] = fields["mass"] + lump.inertia * (shape.T @ there["rotary_mass"] @ shape)
        fields["load_turn"] = fields["load_turn"] + lump.inertia * (there["rotary_load_turn"] @ shape)
    axial = _stiffening(part, properties, lumps, before) if stiffening else np.zeros((3, n, n))
    fields.update(zip(("axial0", "axial1", "axial2"), axial, strict=True))
    fields.update({name: np.zeros((0, *(n,) * (1 if name in SPREAD[:2] else 2))) for name in SPREAD})
    return Piece(part.dofs, **fields)


def _stiffening(
    part: Segment, properties: Properties, lumps: Sequence[Lump], before: Sequence[Lump]
) -> Array:
    """Return the integrals of Nw' Nw'^T times 1, the mass before x and its moment, shape (3, n, n).

    What stands before the element acts on the whole of it; a lump on it from there to its second node.
    """
    slopes, inside, inside_moment = part.matrix("geometric", 3)
    mass = integral(properties.mass, part.start) + sum(lump.mass for lump in before)
    moment = integral((0.0, *properties.mass), part.start) + sum(lump.mass * lump.at for lump in before)
    stiffening = np.array(
        [slopes, mass * slopes + inside, moment * slopes + part.start * inside + inside_moment]
    )
    for lump in lumps:
        behind = stiffened(part, lump.at - part.start)
        stiffening[1] += lump.mass * behind
        stiffening[2] += lump.mass * lump.at * behind
    return stiffening


def _spread(part: Segment, profile: Profile, owner: Segment) -> dict[str, Array]:
    """Return the contributions of a force profile along the link to an element, by the names ``SPREAD``."""
    n = len(part.dofs)
    if profile.is_point:
        place = profile.at - part.start
        forces = _force(part, profile.at) if owner is part else {}
        behind = np.zeros((n, n))
        if owner.start.real <= part.start.real:
            behind = stiffened(part, place if owner is part else 0.0)
    else:
        places, weights = _gauss(part, 0.0)
        there = weights * (profile.even + profile.slope * places)
        each = [_force(part, place) for place in places.tolist()]
        forces = {name: np.tensordot(there, [one[name] for one in each], axes=1) for name in each[0]}
        behind = stiffened(part, 0.0, profile.before)
    none = {name: np.zeros(n) if name in SPREAD[:2] else np.zeros((n, n)) for name in SPREAD}
    if not profile.follows:
        forces = {name: forces[name] for name in SPREAD[:2] if name in forces}
    return none | forces | {"force_axial": behind}


def _force(part: Segment, x: float) -> dict[str, Array]:
    """Return the loads of unit forces along and across the link at x [m] from its first point, (n,).

    And the stiffness of forces that follow the section there, (n, n).
    """
    shape, there = part.shape(x - part.start), point(x)
    force = {name: there[name] @ shape for name in SPREAD[:2]}
    return force | {name: shape.T @ there[name] @ shape for name in ("follower_x", "follower_y")}


def _gauss(part: Segment, start: float) -> tuple[Array, Array]:
    """Return places [m] from the first point of the link, and weights, from ``start`` in an element on."""
    points, weights = gauss(GAUSS)
    half = (part.length - start) / 2
    return part.start + start + half * (1 + points), half * weights


def stiffened(part: Segment, start: float, force: Callable[[Array], Array] = np.ones_like) -> Array:
    """Return the geometric stiffness of an axial force from ``start`` [m] to the second node, (n, n).

    ``force`` is the axial force [N] at places [m] from the first point of the link; 1 N by default.
    """
    places, weights = _gauss(part, start)
    geometric = np.zeros((len(part.dofs), len(part.dofs)), part.arguments.dtype)
    for x, weight in zip(places.tolist(), (weights * force(places)).tolist(), strict=True):
        shape = part.shape(x - part.start)
        geometric += weight * (shape.T @ point(x)["geometric0"] @ shape)
    return geometric


def whole(superelements: Sequence[Piece], n: int) -> Piece:
    """Return all pieces as one over the n unknowns of their link."""
    count, kind = len(superelements[0].force_x), superelements[0].stiffness.dtype
    fields: dict[str, Array] = {name: np.zeros((n, n), kind) for name in MATRICES}
    fields.update({name: np.zeros(n, kind) for name in VECTORS})
    fields.update({name: np.zeros((count, n), kind) for name in SPREAD[:2]})
    fields.update({name: np.zeros((count, n, n), kind) for name in SPREAD[2:]})
    for piece in superelements:
        at = np.array(piece.at)
        for name in MATRICES:
            fields[name][np.ix_(at, at)] += getattr(piece, name)
        for name in VECTORS:
            fields[name][at] += getattr(piece, name)
        fields["force_x"][:, at] += piece.force_x
        fields["force_y"][:, at] += piece.force_y
        for name in SPREAD[2:]:
            fields[name][:, at[:, None], at] += getattr(piece, name)
    return Piece(tuple(range(n)), **fields)


def transformed(piece: Piece, basis: Array) -> Piece:
    """Return a piece in the unknowns y of s = basis @ y, basis (n, k), constant in the link's axes."""
    fields: dict[str, Any] = {name: basis.T @ getattr(piece, name) @ basis for name in MATRICES}
    fields.update({name: basis.T @ getattr(piece, name) for name in VECTORS})
    fields.update(force_x=piece.force_x @ basis, force_y=piece.force_y @ basis)
    fields.update({name: basis.T @ getattr(piece, name) @ basis for name in SPREAD[2:]})
    return replace(piece, at=tuple(range(basis.shape[1])), **fields)


def followed(piece: Piece, basis: Array, ends: Sequence[int]) -> Piece:
    """Return a piece in those unknowns y of s = basis @ y that move it, and in those of both ends.

    ``s`` are the unknowns of its link, and the basis is constant in the link's axes.
    """
    rows = basis[list(piece.at)]
    moved = np.any(rows != 0.0, axis=0)
    moved[list(ends)] = True
    at = np.flatnonzero(moved)
    return replace(transformed(piece, rows[:, at]), at=tuple(at.tolist()))
