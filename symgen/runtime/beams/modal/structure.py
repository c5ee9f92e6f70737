"""The assembled structure of elastic links at rest: its modes, and damping by their ratios."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.errors import ModelError, SceneError
from symgen.runtime import _beams
from symgen.runtime._beams import MOTION
from symgen.runtime.arrays import Array
from symgen.runtime.beams.frames import frames
from symgen.runtime.beams.layout import BeamLayout
from symgen.runtime.beams.links import Beam
from symgen.runtime.beams.modal.damping import modal_forces, shared

#: Strain energy of a shape over the sum of its terms' sizes, up to which it is round-off of a rigid motion. A
#: slender bar of a thousand elements keeps 1e-12.
ROUND_OFF = 1e-14
#: Force of a spring at a joint over the largest on a link, up to which it is round-off.
_SPRING = 1e-9


class UnstableError(ModelError):
    """The structure is unstable at rest: it has no lowest frequency, and no modes to damp."""


def stiffness_sizes(equations: _beams.BeamEquations, stiffness: Array, basis: Array | None) -> Array:
    """Return the roots of the sums of sizes of the terms of the diagonal of B^T K B, (columns of B,).

    Large terms may cancel where a constraint forbids a link to stretch. Without B those of K, ``stiffness``.
    """
    if basis is None:
        sizes = np.sqrt(np.abs(stiffness.diagonal()))
    else:
        rows, columns, entries = equations.full_stiffness()
        terms, parts = np.zeros((len(basis), len(basis))), np.abs(basis)
        terms[rows, columns] = np.abs(entries)
        sizes = np.sqrt(np.sum(parts * (terms @ parts), axis=0))
    sizes[~(sizes > 0.0)] = 1.0
    return sizes


def modes_at_rest(name: str, mass: Array, stiffness: Array, sizes: Array) -> tuple[Array, Array, int]:
    """Return angular frequencies [rad/s] by rising size, shapes of unit modal mass, and how many are rigid.

    Frequencies are singular values of G L^-T with K = G^T G and M = L L^T, so that round-off is a part of the
    largest frequency and not of its square.

    Raises
    ------
    UnstableError
        When the structure is unstable at rest.
    ModelError
        When something moves without mass, or a number of the matrices is not finite.
    """
    from scipy.linalg.lapack import dtrtrs  # for small matrices the checks of scipy.linalg cost more

    scaled = stiffness / np.outer(sizes, sizes)
    for kind, matrix in (("mass", mass), ("stiffness", scaled)):
        if not np.isfinite(matrix).all():
            raise ModelError(f"{name}: the {kind} matrix has a number that is not finite at these parameters")
    factor = _factor(name, (scaled + scaled.T) / 2) * sizes
    try:
        root = np.linalg.cholesky((mass + mass.T) / 2)
    except np.linalg.LinAlgError:
        raise ModelError(f"{name} has no modes: a part of the structure has no mass") from None
    _, speeds, vectors = np.linalg.svd(dtrtrs(root, factor.T, lower=True)[0].T)
    rigid = len(mass) - len(factor)
    shapes = dtrtrs(root, vectors[::-1].T, lower=True, trans=True)[0]
    return np.concatenate([np.zeros(rigid), speeds[::-1]]), shapes, rigid


def _factor(name: str, scaled: Array) -> Array:
    """Return G of K = G^T G, with as many rows as K has rank, in unknowns whose round-off is of one size.

    Raises
    ------
    UnstableError
        When K has a negative eigenvalue.
    """
    from scipy.linalg.lapack import dpstrf, dtrtrs

    n = len(scaled)
    upper, order, rank, _ = dpstrf(scaled, tol=n * np.finfo(float).eps)
    order = order - 1
    upper = np.triu(upper)[:rank]
    if rank < n:
        null = np.eye(n)[:, rank:]
        if rank:
            null[:rank] = -dtrtrs(upper[:, :rank], upper[:, rank:])[0]
        ordered = scaled[order][:, order]
        noise = np.sum(np.abs(null) * (np.abs(ordered) @ np.abs(null)), axis=0)
        if np.any(np.sum(null * (ordered @ null), axis=0) < -ROUND_OFF * n * noise):
            raise UnstableError(f"{name} is unstable at rest in this pose: a spring pushes it away")
    factor: Array = np.empty((rank, n))
    factor[:, order] = upper
    return factor


def forces_of_modes(
    name: str,
    equations: _beams.BeamEquations,
    layout: BeamLayout,
    beams: Sequence[Beam],
    ratios: Array,
    every: bool,
) -> tuple[Array, float]:
    """Return forces f of modes of the structure, whose damping is the sum of f f^T; see :class:`BeamLayout`.

    They are those of :func:`.modal_forces`, and the second result is the factor [s] of the stiffness of links
    that damps all modes, by :func:`.shared` where one ratio damps every mode and no joint has a spring. On
    each superelement, in the axes of its link, they are in balance: the damping opposes rates of strain, and
    no rigid motion in any pose.

    Parameters
    ----------
    equations
        The structure without this damping, in the pose of the crank's start.
    ratios, every
        Damping ratios of the first modes that strain the structure, or one for every mode.

    Raises
    ------
    SceneError
        When there are fewer modes than ratios.
    ModelError
        As :func:`modes_at_rest`.
    """
    from scipy.sparse import csr_array

    _, mass, _, stiffness, _, basis = equations.matrices(0.0, _beams.AT_REST)
    shown = np.eye(len(mass)) if basis is None else basis[0]
    speeds, shapes, rigid = modes_at_rest(name, mass, stiffness, stiffness_sizes(equations, stiffness, shown))
    count = len(speeds) - rigid
    ratios = np.repeat(ratios, count) if every else ratios
    if len(ratios) > count:
        raise SceneError(
            f"expected at most {count} ratios, one for each mode that strains a link, got {len(ratios)}",
            where="modal_damping.ratio",
            hint="Give fewer, or give links more elements.",
        )
    chosen = slice(rigid, rigid + len(ratios))
    speeds, shapes = speeds[chosen], shown @ shapes[:, chosen]
    rows, columns, entries = equations.full_stiffness()
    left = csr_array((entries, (rows, columns)), shape=(len(shapes), len(shapes))) @ shapes
    links = equations.motion.evaluate(0.0)[2].reshape(-1, len(MOTION))
    padded = np.vstack([shapes, np.zeros((1, shapes.shape[1]))])
    forces_of_pieces = []
    for beam, places, motion in zip(beams, layout.of_links, links, strict=True):
        axes, displacements = frames(motion), padded[places]
        for u, w in beam.joints:
            displacements[u], displacements[w] = axes.local(displacements[u].copy(), displacements[w].copy())
        for piece in beam.pieces:
            force = piece.stiffness @ displacements[list(piece.at)]
            forces_of_pieces.append(force)
            there = np.zeros_like(displacements)
            there[list(piece.at)] = force
            for u, w in beam.joints:
                there[u], there[w] = axes.fixed(there[u].copy(), there[w].copy())
            held = places < 0
            np.subtract.at(left, places[~held], there[~held])
    joints, forces, factor = layout.joint_places[:-1], np.vstack(forces_of_pieces), 0.0
    of_joints = np.where(joints[:, None] >= 0, left[joints], 0.0)
    if np.max(np.abs(of_joints), initial=0.0) <= _SPRING * np.max(np.abs(forces), initial=0.0):
        of_joints[:] = 0.0
        if every:
            ratios, factor = shared(float(ratios[0]), speeds)
    whole = np.vstack([forces, of_joints])[:, : len(ratios)]
    return modal_forces(whole, speeds[: len(ratios)], ratios).T, factor


def forces_on_links(layout: BeamLayout, beams: Sequence[Beam]) -> list[Array]:
    """Return the forces of the damped modes on the unknowns of each link, in its axes, (modes, n) each."""
    forces, start = [], 0
    for beam in beams:
        of_link = np.zeros((len(layout.damped), len(beam.dofs)))
        for piece in beam.pieces:
            stop = start + len(piece.at)
            of_link[:, list(piece.at)] += layout.damped[:, start:stop]
            start = stop
        forces.append(of_link)
    return forces
