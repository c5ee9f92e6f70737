"""Equilibrium of a linkage with elastic links in space with its input held, and small vibrations about it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.large.collocation import Moment
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.model.rods import RodModel
from symgen.runtime.result.modes import ElasticModes, relative
from symgen.runtime.structure import modes_at_rest

#: Corrections of an equilibrium at most, and the last one over the sizes of the unknowns.
_MOST, _CLOSE = 40, 1e-11
#: Times by which the input is moved to that of a pose.
_POSES = 64
#: Times the mass matrix, with largest entries as those of the stiffness: keeps links from spinning on balls.
_SHIFT = 1e-9


def equilibrium(linkage: LinkageInSpace, t: float) -> Moment:
    """Return places and multipliers at rest, in equilibrium with the loads at a time [s].

    Raises
    ------
    ModelError
        Where corrections do not converge, as for a linkage that its loads move.
    """
    moment = linkage.start()
    still = np.zeros(linkage.unknowns)
    end = linkage.rigid.description.t_end
    for time in np.linspace(0.0, t, 2 + int(_POSES * abs(t / end))):
        moment = at_rest(linkage, replace(moment, t=float(time), v=still, a=still))
    return moment


def at_rest(linkage: LinkageInSpace, moment: Moment) -> Moment:
    """Return a motion with the places and multipliers of equilibrium with its rates and second rates.

    Raises
    ------
    ModelError
        As :func:`equilibrium`.
    """
    t, q, multipliers, n = np.array([moment.t]), moment.q, moment.multipliers, linkage.unknowns
    v, a = moment.v[None], moment.a[None]
    for _ in range(_MOST):
        solve = held(linkage, replace(moment, q=q, multipliers=multipliers))
        residual = linkage.residual(t, q[None], v, a, multipliers[None])[0]
        change = solve(np.concatenate([residual, linkage.errors(moment.t, q)]))
        q, multipliers = q - change[:n], multipliers - change[n:]
        size = float(np.max(np.abs(change[:n]) / linkage.scale))
        if size <= _CLOSE:
            return replace(moment, q=q, multipliers=multipliers)
        if not np.isfinite(size):
            break
    raise ModelError(
        f"{linkage.name}: no equilibrium with the input held at t = {moment.t:g} s\n"
        "  Loads must not move a linkage whose input is held."
    )


def held(linkage: LinkageInSpace, at: Moment) -> Callable[[Array], Array]:
    """Return the change of places and multipliers at rest by a change of forces and errors of constraints."""
    slopes = linkage.slopes(at.t, at.q, at.v, at.a, at.multipliers)
    shift = _SHIFT * np.max(np.abs(slopes.stiffness)) / np.max(np.abs(slopes.mass))
    return linkage.pattern.factorised(slopes.stiffness + shift * slopes.mass + slopes.jacobian)


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
    from scipy.linalg import null_space

    at, n = equilibrium(linkage, t), linkage.unknowns
    slopes = linkage.slopes(t, at.q, at.v, at.a, at.multipliers)
    mass, damping, stiffness = (
        linkage.pattern.matrix(entries + slopes.jacobian).toarray()
        for entries in (slopes.mass, slopes.damping, slopes.stiffness)
    )
    basis = null_space(mass[n:, :n])
    reduced = (basis.T @ x[:n, :n] @ basis for x in (mass, damping, (stiffness + stiffness.T) / 2))
    sizes = np.sqrt(np.sum(np.abs(basis) * (np.abs(stiffness[:n, :n]) @ np.abs(basis)), axis=0))
    of_mass, of_damping, of_stiffness = reduced
    speeds, shapes, rigid = modes_at_rest(linkage.name, of_mass, of_stiffness, sizes)
    damped = np.sum(shapes * (of_damping @ shapes), axis=0)
    return ElasticModes(
        linkage.name,
        math.nan,
        speeds / (2 * math.pi),
        basis @ shapes,
        linkage.names,
        rigid=rigid,
        ratios=np.divide(damped, 2 * speeds, out=np.zeros_like(speeds), where=speeds > 0.0),
        t=t,
    )
