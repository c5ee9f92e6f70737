"""Small vibrations of a linkage with elastic links in space about its equilibrium with its input held."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.modal.structure import modes_at_rest
from symgen.runtime.elastic.large.collocation import MotionState
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.statics import equilibrium, unbalanced
from symgen.runtime.linearisation.eigenvalues import eigenvalues
from symgen.runtime.result.modes import ElasticModes, relative
from symgen.runtime.rods.model.rods import RodModel

#: Force that leads from an unstable shape, over the largest of the loads.
_PUSH = 1e-2
#: Work of loads on a motion, over the sum of sizes of its terms, that is round-off.
_WORK = 1e-9


def modes_in_space(rigid: RodModel, t: float) -> ElasticModes:
    """Return the modes about the equilibrium with the input held at a time [s], with errors of elements.

    Raises
    ------
    ModelError
        When there is no equilibrium, or it is unstable.
    """
    modes = modes_of(LinkageInSpace(rigid), t)

    def estimate() -> Array:
        finer = modes_of(LinkageInSpace(rigid, divided=2), t).frequencies[: len(modes.frequencies)]
        return relative(modes.frequencies[: len(finer)], finer)

    return replace(modes, estimate=estimate)


def modes_of(linkage: LinkageInSpace, t: float) -> ElasticModes:
    """Return the same of the equations of a linkage, without errors of elements."""
    of = linearised(linkage, equilibrium(linkage, t))
    speeds, shapes, rigid = modes_at_rest(linkage.name, of.mass, of.stiffness, of.sizes)
    damped = np.sum(shapes * (of.damping @ shapes), axis=0)
    return ElasticModes(
        linkage.name,
        math.nan,
        speeds / (2 * math.pi),
        of.basis @ shapes,
        linkage.names,
        rigid=rigid,
        ratios=np.divide(damped, 2 * speeds, out=np.zeros_like(speeds), where=speeds > 0.0),
        t=t,
    )


@dataclass(frozen=True, slots=True)
class AtRest:
    """M y'' + C y' + K y = 0 about an equilibrium, with changes B y of the unknowns, B the ``basis``.

    ``sizes`` are roots of the sums of sizes of the terms of the diagonal of K.
    """

    basis: Array
    mass: Array
    damping: Array
    stiffness: Array
    sizes: Array


def linearised(linkage: LinkageInSpace, at: MotionState) -> AtRest:
    """Return the equations about an equilibrium, on the changes that the constraints leave."""
    from scipy.linalg import null_space

    n, slopes = linkage.unknowns, linkage.slopes(at.t, at.q, at.v, at.a, at.multipliers)
    mass, damping, stiffness = (
        linkage.pattern.matrix(entries + slopes.jacobian).toarray()
        for entries in (slopes.mass, slopes.damping, slopes.stiffness)
    )
    # In lengths of the linkage: units of metres would mix stiff and soft motions of small linkages.
    rows = mass[n:, :n] * linkage.scale
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    basis = linkage.scale[:, None] * null_space(rows)
    symmetric = (stiffness + stiffness.T) / 2
    mass, damping, symmetric = (basis.T @ x[:n, :n] @ basis for x in (mass, damping, symmetric))
    sizes = np.sqrt(np.sum(np.abs(basis) * (np.abs(stiffness[:n, :n]) @ np.abs(basis)), axis=0))
    return AtRest(basis, mass, damping, symmetric, sizes)


def resting(linkage: LinkageInSpace, t: float, stable: bool) -> tuple[MotionState, AtRest]:
    """Return an equilibrium at a time [s] and the equations about it.

    Where loads bend the drawing to an unstable shape, a ``stable`` one is looked for with a force along its
    lowest mode in addition, a hundredth of the loads, which is removed in the end.

    Raises
    ------
    ModelError
        As :func:`equilibrium`.
    """
    from scipy.linalg import eigh

    at = equilibrium(linkage, t)
    of = linearised(linkage, at)
    if stable and np.any(eigenvalues(of.mass, of.stiffness, of.damping)[0].real > 0.0):
        loads = unbalanced(linkage, replace(at, q=linkage.start().q, multipliers=0 * at.multipliers))
        push = of.basis @ of.mass @ eigh(of.stiffness, of.mass)[1][:, 0]
        push *= _PUSH * np.max(np.abs(loads[linkage.translations])) / np.max(np.abs(push))
        at = equilibrium(linkage, t, push)
        of = linearised(linkage, at)
    return at, of


def moved_by_loads(linkage: LinkageInSpace) -> bool:
    """Return whether loads do work on motions of the undeformed linkage that do not strain it."""
    start, n = linkage.start(), linkage.unknowns
    start = replace(start, v=0 * start.v)
    of, loads = linearised(linkage, start), unbalanced(linkage, start)[:n]
    _, shapes, rigid = modes_at_rest(linkage.name, of.mass, of.stiffness, of.sizes)
    free = of.basis @ shapes[:, :rigid]
    return bool(np.any(np.abs(loads @ free) > _WORK * (np.abs(loads) @ np.abs(free))))
