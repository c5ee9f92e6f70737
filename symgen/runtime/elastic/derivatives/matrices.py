"""Matrices of all unknowns of an elastic motion in one pose, from numbers that may have tangents.

Links, weights of their constants and forces of joints are complex where they have tangents: see
:mod:`.poses`. The sums are those of the compiled assembly, ``runtime/core/beams.c``, in long double: on
fixed axes round-off of the axial stiffness counts as stiffness in bending, which may be a millionth of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from symgen.runtime._beams import APPLIED, AT_REST, IN_MOTION
from symgen.runtime.arrays import Dual
from symgen.runtime.beams.data import STIFFNESS_OF_FORCES, Piece
from symgen.runtime.beams.frames import Frames, frames
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.motion import ElasticMotion

#: Number of rigid motions of a link in the plane.
_RIGID = 3


@dataclass(frozen=True, slots=True)
class Assembled:
    """M S'' + C S' + K S + J^T mu = Q and J S = 0 of all unknowns of the structure."""

    mass: Dual
    damping: Dual
    stiffness: Dual
    load: Dual
    bound: Dual

    def narrowed(self) -> Assembled:
        """Return the same in doubles."""
        return Assembled(*(getattr(self, f.name).astype(complex) for f in fields(self)))


def assembled(
    motion: ElasticMotion, rows: Dual, loads: Dual, joined: Mapping[str, Dual], analysis: int
) -> Assembled:
    """Return the matrices in a pose.

    Parameters
    ----------
    motion
        The motion with its links, each in one piece.
    rows, loads
        Weights of the links (links, columns) and of the forces along them (forces, columns).
    joined
        Blocks of the kernel of joints.
    analysis
        ``AT_REST``, ``QUASI_STATIC`` or ``IN_MOTION`` of :mod:`symgen.runtime._beams`.
    """
    layout = motion.layout
    n = layout.unknowns
    mass, damping, stiffness = (np.zeros((n + 1, n + 1), np.clongdouble) for _ in range(3))
    load = np.zeros(n + 1, np.clongdouble)
    for k, link in enumerate(motion.beams):
        (superelement,), axes = link.pieces, frames(rows[k][None])
        places = layout.of_links[k]
        damped, stiff = superelement.damping.astype(complex), superelement.stiffness.astype(complex)
        forces = np.zeros(len(link.dofs), complex)
        if analysis != AT_REST:
            forces = axes.load(
                superelement.load_x, superelement.load_y, superelement.load_out, superelement.load_turn
            )[0]
            stiff += (
                axes.stiffness_geometric0 * superelement.axial0
                + axes.stiffness_geometric1 * superelement.axial1
            )
            stiff += axes.stiffness_geometric2 * superelement.axial2
            along = [i for i, name in enumerate(motion.info.loads) if name == link.info.link]
            for i, row in enumerate(loads[along]):
                f = dict(zip(APPLIED, row, strict=True))
                forces = (
                    forces
                    + f["load_force_x"] * superelement.force_x[i]
                    + f["load_force_y"] * superelement.force_y[i]
                )
                for weight, of_force in STIFFNESS_OF_FORCES.items():
                    stiff += f[weight] * getattr(superelement, of_force)[i]
        if analysis == IN_MOTION:
            of_rates, of_places = _turning(superelement, axes, link.joints)
            damped, stiff = damped + of_rates, stiff + of_places
        turned = np.array([superelement.mass, damped, stiff], np.clongdouble)
        forces, local = forces.astype(np.clongdouble), np.array(axes.local(*np.eye(2)))
        for end in map(list, link.joints):  # the other unknowns stay on the axes of the link
            turned[:, end] = local.T @ turned[:, end]
            turned[..., end] = turned[..., end] @ local
            forces[end] = local.T @ forces[end]
        for to, matrix in zip((mass, damping, stiffness), turned, strict=True):
            np.add.at(to, np.ix_(places, places), matrix)
        np.add.at(load, places, forces)
    for to, name, slots in (
        (mass, "mass_matrix", layout.mass_slots),
        (damping, "damping", layout.damping_slots),
        (stiffness, "stiffness", layout.stiffness_slots),
    ):
        if name in joined:
            np.add.at(to, (layout.rows[slots[:-1]], layout.columns[slots[:-1]]), joined[name].ravel())
    np.add.at(load, layout.joint_places[:-1], joined["load"].ravel())
    bound = np.zeros((layout.constraints, n + 1), np.clongdouble)
    if layout.constraints:
        bound[:, layout.joint_places[:-1]] = joined["jacobian"].reshape(layout.constraints, -1)
    return Assembled(mass[:n, :n], damping[:n, :n], stiffness[:n, :n], load[:n], bound[:, :n])


def _turning(superelement: Piece, axes: Frames, joints: tuple[tuple[int, int], ...]) -> tuple[Dual, Dual]:
    """Return the damping and stiffness of a link by the rotation of its axes, on these axes."""
    n = len(superelement.mass)
    ends, quarter = np.zeros((n, n)), np.zeros((n, n))
    for u, w in joints:  # (u, w) are rotated back by a right angle, to (w, -u)
        ends[u, u] = ends[w, w] = quarter[u, w] = 1.0
        quarter[w, u] = -1.0
    of_rates = (
        axes.damping_gyroscopic * superelement.gyroscopic
        + axes.damping_mass_quarter * superelement.mass @ quarter
    )
    of_places = (
        axes.stiffness_centrifugal * superelement.centrifugal
        + axes.stiffness_gyroscopic * superelement.gyroscopic
    )
    of_places = of_places + axes.stiffness_mass_ends * superelement.mass @ ends
    of_places = of_places + axes.stiffness_mass_quarter * superelement.mass @ quarter
    of_places = of_places + axes.stiffness_gyroscopic_quarter * superelement.gyroscopic @ quarter
    return of_rates, of_places + axes.stiffness_damping_quarter * superelement.damping @ quarter


def damped(link: Beam, ratio: complex) -> Beam:
    """Return a link, in one piece, all of whose elastic modes with free ends have a damping ratio.

    With M = L L^T and A = L^-1 K L^-T its damping matrix, sum of (2 ratio / w^3) K phi phi^T K over the modes
    phi, is 2 ratio L sqrt(A) L^T. In the eigenvectors of A, d sqrt(A) has the entries of dA over the sums of
    two angular frequencies.
    """
    (superelement,) = link.pieces
    at = np.ix_(*[[j for j in range(len(link.dofs)) if j not in link.fixed]] * 2)
    lower = np.linalg.cholesky(superelement.mass[at].real)
    inverse = np.linalg.inv(lower)
    # dL is L times the lower part of L^-1 dM L^-T, with half of its diagonal.
    change = inverse @ superelement.mass[at].imag @ inverse.T
    half = np.tril(change) - np.diag(np.diagonal(change)) / 2
    stiff = inverse @ superelement.stiffness[at] @ inverse.T
    stiff = stiff - 1j * (half @ stiff.real + stiff.real @ half.T)
    squares, vectors = np.linalg.eigh(stiff.real)
    speeds = np.sqrt(np.where(np.arange(len(squares)) < _RIGID, 0.0, squares))
    sums = np.add.outer(speeds, speeds)
    rates = vectors.T @ stiff.imag @ vectors / np.where(sums > 0.0, sums, np.inf)
    root = vectors @ (np.diag(speeds) + 1j * rates) @ vectors.T
    root = root + 1j * (half @ root.real + root.real @ half.T)
    damping = superelement.damping.astype(complex)
    damping[at] += 2 * ratio * lower @ root @ lower.T
    return replace(link, pieces=(replace(superelement, damping=damping),))
