"""Elastic links as superelements: constant matrices in the link's axes, rows of displacement and strain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.data import Lump, Piece, Profile, Properties, StationRows
from symgen.runtime.beams.elements import SAME, SHAPES, Segment, names, segment_at, segments
from symgen.runtime.beams.elements import at as value_at
from symgen.runtime.beams.modal.damping import modal, rayleigh
from symgen.runtime.beams.pieces import followed, pieces, transformed, whole
from symgen.runtime.beams.reduction import of_one_length, reduced
from symgen.runtime.kernels.elastic_description import BeamInfo

__all__ = ["Beam", "BeamInfo", "Lump", "Piece", "Profile", "Properties", "StationRows", "beam"]


#: Intervals of an element between whose ends stresses are compared.
_PER_ELEMENT = 16
#: Most such intervals of a link.
_PER_LINK = 1024
#: Tables of rows that a link keeps.
_TABLES = 32


@dataclass(frozen=True, slots=True)
class Beam:
    """An elastic link, ready to be assembled.

    Attributes
    ----------
    info, properties, lumps
        Its options, properties and lumped masses.
    dofs
        Names of its unknowns: ``w@1`` of the first node, ``w@n`` of the last of n, ``mid@1.2`` inside an
        element, ``mode@1`` of a reduction.
    joints
        Places of (u, w) of the nodes at its joints, the first and the last node included.
    fixed
        Unknowns that are zero: curvatures where no couple acts.
    pieces
        Its matrices: one piece per element, or one in all where a reduction or a damping ratio couples them.
    damped
        Forces f of its modes with damping f f^T that is not in the pieces, on the unknowns of all pieces.
    segments
        The elements.
    expansion
        Unknowns of the elements from ``dofs``, (all, n); None where they are the same.
    """

    info: BeamInfo
    properties: Properties
    lumps: tuple[Lump, ...]
    dofs: tuple[str, ...]
    joints: tuple[tuple[int, int], ...]
    fixed: tuple[int, ...]
    pieces: tuple[Piece, ...]
    damped: Array
    segments: tuple[Segment, ...]
    expansion: Array | None
    _tables: dict[tuple[float, ...], Mapping[str, Array]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def rows(self, at: float) -> StationRows:
        """Return the rows that recover displacement and strain at a fraction of the length, 0 to 1.

        Where two elements meet they are the mean of both: their strains may differ.

        Raises
        ------
        ModelError
            When the fraction is not between 0 and 1.
        """
        return StationRows(*(rows[0] for rows in self.table((at,)).values()))

    def table(self, fractions: Sequence[float]) -> Mapping[str, Array]:
        """Return the rows at many fractions, (fractions, n) each, by the names of ``StationRows``.

        Those of the last requests are kept: each run asks for the same.
        """
        key = tuple(fractions)
        table = self._tables.get(key)
        if table is None:
            if len(self._tables) >= _TABLES:
                self._tables.clear()
            table = self._tables[key] = self._table(key)
        return table

    def _table(self, fractions: Sequence[float]) -> Mapping[str, Array]:
        places = []
        for fraction in fractions:
            if not 0.0 <= fraction.real <= 1.0:
                raise ModelError(
                    f"a station of link {self.info.link!r} is a fraction of its length from 0 to 1, "
                    f"got {fraction!r}"
                )
            x = fraction * self.properties.length
            places.append((x, segment_at(self.segments, x)))
        return self._rows_at(places)

    def _rows_at(self, places: Sequence[tuple[float, Sequence[Segment]]]) -> Mapping[str, Array]:
        """Return the rows at places x [m], each the mean of the elements given there."""
        size = len(self.dofs) if self.expansion is None else len(self.expansion)
        rows = np.zeros((len(SHAPES), len(places), size), self.pieces[0].stiffness.dtype)
        for k, (x, parts) in enumerate(places):
            for part in parts:
                local = min(max(x - part.start, 0.0, key=_real), part.length, key=_real)
                rows[:, k, list(part.dofs)] += part.shape(local) / len(parts)
        if self.expansion is not None:
            rows = rows @ self.expansion
        rows.flags.writeable = False
        return dict(zip(SHAPES, rows, strict=True))

    def fibres(self, fractions: Array) -> Array:
        """Return distances [m] of the outer fibre from the neutral axis at fractions of the length."""
        p = self.properties
        return np.abs([value_at(p.fibre, x) for x in (fractions * p.length).tolist()])

    def greatest_stress(self, local: Array) -> tuple[Array, Array]:
        """Return the greatest stress [Pa] of both outer fibres over the length, and where it is, (times,).

        It is tension or compression; its place is a fraction of the length. Where two elements meet it is the
        larger of both. ``local`` are the unknowns of the link in its axes, (times, n).
        """
        p, count = self.properties, max(1, min(_PER_ELEMENT, _PER_LINK // len(self.segments)))
        within = [
            (x, (part,))
            for part in self.segments
            for x in np.linspace(part.start, part.start + part.length, count + 1).tolist()
        ]
        # Without fractions, every element extends from its first node to its second.
        table = self._tables.get(())
        if table is None:
            table = self._tables[()] = self._rows_at(within)
        places = np.array([x for x, _ in within]) / p.length
        fibre = self.fibres(places)
        bending, axial = (np.abs(local @ table[name].T) for name in ("curvature", "axial_strain"))
        stress = p.modulus * (axial + fibre * bending)
        return np.max(stress, axis=1), places[np.argmax(stress, axis=1)]


def beam(
    info: BeamInfo,
    properties: Properties,
    lumps: Sequence[Lump] = (),
    profiles: Sequence[Profile] = (),
) -> Beam:
    """Return an elastic link.

    Parameters
    ----------
    info, properties
        Choices and numbers.
    lumps
        Masses fixed to the link between its ends; those of its end points belong to the points. One at an
        end is part of the link: the axial force N0 is the one before it.
    profiles
        Where the forces along it act.

    Raises
    ------
    ModelError
        When a number makes no sense, or a reduction or damping cannot be had, naming the link.
    """
    _check(info, properties, lumps)
    parts = segments(info, properties)
    dofs = names(info)
    superelements = pieces(parts, properties, lumps, profiles, info.geometric_stiffness)
    expansion = None
    if not info.axial:
        total = whole(superelements, len(dofs))
        dofs, expansion = of_one_length(info, dofs, parts, total.stiffness)
        ends = [k for pair in _joints(info, dofs) for k in pair]
        superelements = tuple(followed(piece, expansion, ends) for piece in superelements)
    if info.reduction:
        total = whole(superelements, len(dofs))
        dofs, basis = reduced(info, dofs, _fixed(info, properties, lumps, dofs), total)
        expansion = basis if expansion is None else expansion @ basis
        superelements = (transformed(total, basis),)
    fixed = _fixed(info, properties, lumps, dofs)
    superelements, forces = _damped(info, properties, dofs, fixed, superelements)
    joints = _joints(info, dofs)
    return Beam(info, properties, tuple(lumps), dofs, joints, fixed, superelements, forces, parts, expansion)


def _real(x: complex) -> float:
    return x.real


def _joints(info: BeamInfo, dofs: Sequence[str]) -> tuple[tuple[int, int], ...]:
    """Return the places of (u, w) of the nodes at joints."""
    return tuple((dofs.index(f"u@{i + 1}"), dofs.index(f"w@{i + 1}")) for i in info.joint_nodes)


def _damped(
    info: BeamInfo,
    properties: Properties,
    dofs: Sequence[str],
    fixed: Sequence[int],
    superelements: tuple[Piece, ...],
) -> tuple[tuple[Piece, ...], Array]:
    """Return the pieces with their damping, and the forces of modes that are damped apart from them."""
    damped = tuple(replace(piece, damping=rayleigh(piece, properties)) for piece in superelements)
    if properties.ratio:
        return modal(info, fixed, damped, len(dofs), properties.ratio)
    return damped, np.zeros((0, sum(len(piece.at) for piece in damped)))


def _fixed(
    info: BeamInfo, properties: Properties, lumps: Sequence[Lump], dofs: Sequence[str]
) -> tuple[int, ...]:
    """Return the curvatures that are zero because the moment is, at ends that have bending stiffness."""
    turned = [(lump.at / properties.length).real for lump in lumps if lump.inertia]
    ends = (
        (0, 0.0, info.clamped or info.bent_at(info.start) or any(x < SAME for x in turned)),
        (info.elements, properties.length, info.bent_at(info.end) or any(x > 1 - SAME for x in turned)),
    )
    largest = max(abs(value_at(properties.bending, properties.length * k / 8)) for k in range(9))
    return tuple(
        dofs.index(f"kappa@{node + 1}")
        for node, x, bent in ends
        if not bent and f"kappa@{node + 1}" in dofs and value_at(properties.bending, x).real > 1e-9 * largest
    )


def _check(info: BeamInfo, properties: Properties, lumps: Sequence[Lump]) -> None:
    where = f"elastic link {info.link!r}"
    if info.elements < 1:
        raise ModelError(f"{where} needs one element or more, got {info.elements}")
    if not 0.0 < properties.length.real < float("inf"):
        raise ModelError(f"{where} needs a length above zero, got {properties.length!r} m")
    for lump in lumps:
        if not 0.0 <= lump.at.real <= properties.length.real:
            raise ModelError(
                f"a lumped mass of {where} lies at {lump.at!r} m, expected 0 to its length "
                f"{properties.length!r} m"
            )
        for noun, value, unit in (("mass", lump.mass, "kg"), ("moment of inertia", lump.inertia, "kg m^2")):
            if not 0.0 <= value.real < float("inf"):
                raise ModelError(f"a lumped {noun} of {where} is zero or more, got {value!r} {unit}")
