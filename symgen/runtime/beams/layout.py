"""Layout of the equations of an elastic motion: unknowns, superelements, constraints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from symgen.runtime._beams import BLOCKS, MATRICES, SPREAD, VECTORS
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.links import Beam, Piece
from symgen.runtime.kernels.description import BlockInfo, Description
from symgen.runtime.kernels.elastic_description import ElasticInfo


@dataclass(frozen=True, slots=True)
class BeamLayout:
    """Sizes and index arrays of :class:`symgen.runtime._beams.BeamEquations`; arrays end with a spare entry.

    Attributes
    ----------
    unknowns, constraints
        Numbers of unknowns and of constraints between them.
    names
        What each unknown is called: ``A.x``, ``coupler.theta@1``.
    of_links
        For each link the unknown of each of its own; -1 where it is held. Joints are on fixed axes.
    inner
        Number of unknowns before those of the joints, which come last where there are constraints.
    rows, columns, band
        Entries of the matrices that may not be zero, by rising row and column, and the largest distance from
        the diagonal of those between the first ``inner`` unknowns.
    damped
        Forces f of modes with damping f f^T of their own, (modes, forces): on the unknowns of all pieces, in
        the axes of links, then on those of the joints, in fixed axes. They begin at ``damped_at`` of
        ``constants``. They are kept ``apart`` from the matrices where they are few; else these are full.
    loads_at
        For link k its forces are those from ``loads_at[k]`` to ``loads_at[k + 1]``.
    packed
        Checked arrays of the core, by the numbers that the kernels of the rigid motion write.
    """

    unknowns: int
    constraints: int
    inner: int
    names: tuple[str, ...]
    of_links: tuple[Indices, ...]
    rows: Indices
    columns: Indices
    band: int
    sizes: Indices
    constants_at: Indices
    constants: Array
    link_of: Indices
    joints: Indices
    places: Indices
    places_at: Indices
    slots: Indices
    slots_at: Indices
    joint_places: Indices
    joint_at: Indices
    mass_slots: Indices
    damping_slots: Indices
    stiffness_slots: Indices
    loads_at: Indices
    shaft: int
    shaft_slot: int
    damped: Array
    apart: bool
    damped_at: int
    packed: dict[tuple[int, ...], Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of ``struct beam_counts`` of the core, by the names of its members."""
        return {
            "unknowns": self.unknowns,
            "constraints": self.constraints,
            "pieces": len(self.sizes),
            "coordinates": len(self.joint_places) - 1,
            "masses": len(self.mass_slots) - 1,
            "dampings": len(self.damping_slots) - 1,
            "stiffnesses": len(self.stiffness_slots) - 1,
            "shaft": self.shaft,
            "shaft_slot": self.shaft_slot,
            "damped": len(self.damped),
            "apart": int(self.apart),
            "damped_at": self.damped_at,
            "entries": len(self.rows),
            "band": self.band,
            "inner": self.inner,
            "constant_count": self.constants.size,
            "most_joints": self.joints.shape[1] // 2,
        }


def layout(
    description: Description,
    info: ElasticInfo,
    beams: Sequence[Beam],
    joints: Mapping[str, BlockInfo],
    damped: Array | None = None,
) -> BeamLayout:
    """Return the layout of the elastic motion of a linkage.

    Parameters
    ----------
    description, info
        The linkage.
    beams
        Its elastic links.
    joints
        Blocks of the kernel ``joints``.
    damped
        Forces of modes of the structure: see :class:`BeamLayout`. Those of the links' own modes follow.
    """
    labels = [*description.of_coordinates(), *(f"{name}_theta" for name in info.rotations)]
    coordinates, place = len(labels), {label: i for i, label in enumerate(labels)}
    free, axes = description.free, description.axes
    names, of_links, shaft = unknowns_of(free, axes, info, beams, description.integrals)
    block = joints.get("jacobian")
    constraints = block.shape[0] if block else 0
    n = len(names)
    pairs = _pairs(beams, of_links, joints, place, shaft)
    forces = _forces(beams, coordinates, damped)
    apart = 0 < 2 * len(forces) < n
    if len(forces) and not apart:
        pairs = np.indices((n, n)).reshape(2, -1).T
    # Constraints are between unknowns of the joints, which `unknowns_of` names first.
    first = coordinates if constraints else 0
    order = _by_least_band(n, pairs)
    if constraints:
        # Not reversed: displacements before slopes and curvatures, which keeps their round-off small.
        inner_order = first + _by_least_band(n - first, pairs - first)[::-1]
        order = np.concatenate([inner_order, np.arange(first)])
    inner = n - first
    new = np.empty(n + 1, dtype=np.intp)
    new[order], new[-1] = np.arange(n), -1
    pairs = np.unique(new[pairs], axis=0)
    slot = {(int(i), int(j)): k for k, (i, j) in enumerate(pairs)}
    renumbered = tuple(new[np.array(places, dtype=np.intp)] for places in of_links)
    shaft = int(new[shaft])
    entries = {
        name: _spare([slot[int(new[i]), int(new[j])] for i, j in entries_of(joints, name, place)])
        for name in ("mass_matrix", "damping", "stiffness")
    }
    of_pieces = _of_pieces(beams, renumbered, slot)
    return BeamLayout(
        unknowns=n,
        constraints=constraints,
        inner=inner,
        names=tuple(names[i] for i in order),
        of_links=renumbered,
        rows=np.ascontiguousarray(pairs[:, 0]),
        columns=np.ascontiguousarray(pairs[:, 1]),
        band=int(np.max(np.abs(np.diff(pairs[np.all(pairs < inner, axis=1)])), initial=0)),
        **of_pieces | {"constants": np.concatenate([of_pieces["constants"], np.ravel(forces), np.zeros(1)])},
        damped=forces,
        apart=apart,
        damped_at=len(of_pieces["constants"]),
        joint_places=_spare(new[:coordinates].tolist()),
        joint_at=np.array([joints[b].offset if b in joints else 0 for b in BLOCKS], dtype=np.intp),
        mass_slots=entries["mass_matrix"],
        damping_slots=entries["damping"],
        stiffness_slots=entries["stiffness"],
        loads_at=_starts([*(info.loads.count(b.info.link) for b in beams), 0]),
        shaft=shaft,
        shaft_slot=slot.get((shaft, shaft), -1),
    )


def _forces(beams: Sequence[Beam], coordinates: int, of_structure: Array | None) -> Array:
    """Return the forces of damped modes: of the structure, then of each link alone."""
    sizes = [sum(len(piece.at) for piece in beam.pieces) for beam in beams]
    rows = [] if of_structure is None else [of_structure]
    for k, beam in enumerate(beams):
        before, after = sum(sizes[:k]), sum(sizes[k + 1 :]) + coordinates
        rows.append(np.pad(beam.damped, ((0, 0), (before, after))))
    return np.vstack(rows)


def unknowns_of(
    free: Sequence[str],
    axes: Sequence[str],
    info: ElasticInfo,
    beams: Sequence[Beam],
    integrals: Sequence[str] = (),
) -> tuple[list[str], list[list[int]], int]:
    """Return the names of the unknowns, the indices of those of each link, and the index of the shaft.

    Unknowns of the joints come first, ``integrals`` of states among them. The index is -1 for a held unknown
    or shaft.
    """
    joint = {p: 2 * i for i, p in enumerate(free)}
    names = [*(f"{p}.{axis}" for p in free for axis in axes), *integrals]
    names += [f"{name}.theta" for name in info.rotations]
    of_links: list[list[int]] = []
    shaft = -1
    for beam in beams:
        fixed, turn = set(beam.fixed), -1
        if beam.info.link == info.crank:
            turn = beam.dofs.index("theta@1")
            if info.mode == "held":
                fixed.add(turn)
        joints = {
            dof: (point, axis)
            for pair, point in zip(beam.joints, beam.info.points, strict=True)
            for axis, dof in enumerate(pair)
        }
        welded, rotations = beam.info.welded, beam.info.rotations
        places = []
        for k, dof in enumerate(beam.dofs):
            if k in joints:
                point, axis = joints[k]
                places.append(joint[point] + axis if point in joint else -1)
            elif k in fixed or (dof in welded and welded[dof] not in joint):
                places.append(-1)
            else:
                name = f"{rotations[dof]}.theta" if dof in rotations else f"{beam.info.link}.{dof}"
                if name not in names:
                    names.append(name)
                places.append(names.index(name))
                if k == turn:
                    shaft = places[-1]
        of_links.append(places)
    return names, of_links, shaft


def _of_pieces(
    beams: Sequence[Beam], of_links: Sequence[Indices], slot: Mapping[tuple[int, int], int]
) -> dict[str, Any]:
    """Return the entries of the layout for the pieces of all links, concatenated."""
    pieces = [(k, piece) for k, beam in enumerate(beams) for piece in beam.pieces]
    places = [of_links[k][list(piece.at)] for k, piece in pieces]
    slots = [np.array([slot.get((int(i), int(j)), -1) for i in p for j in p], dtype=np.intp) for p in places]
    constants = [np.concatenate([np.ravel(a) for a in _constants(piece)]) for _, piece in pieces]
    return {
        "sizes": np.array([len(p) for p in places], dtype=np.intp),
        "constants_at": _starts([len(c) for c in constants]),
        "constants": np.concatenate(constants),
        "link_of": np.array([k for k, _ in pieces], dtype=np.intp),
        "joints": _joints([(beams[k], piece.at) for k, piece in pieces]),
        "places": np.concatenate([*places, np.array([-1])]).astype(np.intp),
        "places_at": _starts([len(p) for p in places]),
        "slots": np.concatenate([*slots, np.array([-1])]).astype(np.intp),
        "slots_at": _starts([len(s) for s in slots]),
    }


def _pairs(
    beams: Sequence[Beam],
    of_links: Sequence[Sequence[int]],
    joints: Mapping[str, BlockInfo],
    place: Mapping[str, int],
    shaft: int,
) -> Indices:
    """Return all pairs of unknowns that an entry of a matrix may couple."""
    pairs = {(i, i) for places in of_links for i in places if i >= 0}
    for beam, places in zip(beams, of_links, strict=True):
        for piece in beam.pieces:
            there = [places[k] for k in piece.at if places[k] >= 0]
            pairs |= {(i, j) for i in there for j in there}
    for name in ("mass_matrix", "damping", "stiffness"):
        pairs |= {pair for i, j in entries_of(joints, name, place) for pair in ((i, j), (j, i))}
    if shaft >= 0:
        pairs.add((shaft, shaft))
    return np.array(sorted(pairs), dtype=np.intp).reshape(-1, 2)


def entries_of(joints: Mapping[str, BlockInfo], name: str, place: Mapping[str, int]) -> list[tuple[int, ...]]:
    """Return the places of the entries that the kernel ``joints`` gives of a matrix, by their labels."""
    rows = joints[name].rows if name in joints else ()
    return [tuple(place[label] for label in row.split()) for row in rows]


def _by_least_band(n: int, pairs: Indices) -> Indices:
    """Return the unknowns in an order that keeps the matrices' entries near the diagonal.

    Pairs with a negative index are omitted.
    """
    if n == 0:
        return np.zeros(0, dtype=np.intp)
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    among = pairs[np.all(pairs >= 0, axis=1)]
    graph = csr_array((np.ones(len(among)), (among[:, 0], among[:, 1])), shape=(n, n))
    return np.asarray(reverse_cuthill_mckee(graph, symmetric_mode=True), dtype=np.intp)


def _constants(piece: Piece) -> list[Array]:
    """Return the matrices and load vectors of a piece, in the order that the assembly reads them."""
    forces = zip(*(getattr(piece, name) for name in SPREAD), strict=True)
    matrices = (getattr(piece, name) for name in (*MATRICES, *VECTORS))
    return [*matrices, *(a for force in forces for a in force)]


def _joints(pieces: Sequence[tuple[Beam, Sequence[int]]]) -> Indices:
    """Return where displacements (u, w) of joints are in each piece, (pieces, 2 most); rows end with -1."""
    numbers = [[at.index(dof) for pair in beam.joints for dof in pair if dof in at] for beam, at in pieces]
    most = max(map(len, numbers), default=0)
    return np.array([[*row, *[-1] * (most - len(row))] for row in numbers], dtype=np.intp).reshape(-1, most)


def _starts(sizes: Sequence[int]) -> Indices:
    return np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.intp)


def _spare(indices: Sequence[int]) -> Indices:
    return np.array([*indices, -1], dtype=np.intp)
