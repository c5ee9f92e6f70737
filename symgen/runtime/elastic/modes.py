"""Frequencies and shapes of the structure in a pose, at rest or moving, and its response to held loads."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _beams
from symgen.runtime._beams import MOTION
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.frames import frames
from symgen.runtime.beams.modal.structure import ROUND_OFF, modes_at_rest, stiffness_sizes
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.result.modes import ElasticModes, relative

#: Largest number of unknowns for which all modes are computed by a dense solver.
_DENSE = 60
#: Unknowns up to which frequencies are compared with those of halved elements: its time grows with the cube.
_REFINED = 400


def modes_with_errors(motion: ElasticMotion, t: float, moving: bool) -> ElasticModes:
    """Return the modes in the pose of a time, with frequencies of halved elements and without reduction.

    Raises
    ------
    SimulationError, ModelError
        As :func:`elastic_modes` and :func:`moving_modes`.
    """
    solve = moving_modes if moving else elastic_modes
    modes = exact = solve(motion, motion.equations(), t)
    whole = motion.unreduced()
    if whole is not None:
        exact = solve(whole, whole.equations(), t)
        lowest = exact.frequencies[: len(modes.frequencies)]
        modes = replace(modes, without_reduction=(lowest, len(exact.frequencies)))
    count = len(modes.frequencies)

    def of_elements() -> Array:
        finer = (whole or motion).refined
        try:
            fine = solve(finer, finer.equations(), t).frequencies
        except (SimulationError, ModelError):  # unstable with finer elements alone
            return np.zeros(0)
        return relative(exact.frequencies[:count], fine[:count])

    estimate = None if len(exact.frequencies) > _REFINED else of_elements
    elements = {beam.info.link: beam.info.elements for beam in (whole or motion).beams}
    return replace(modes, estimate=estimate, elements=elements)


def elastic_modes(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> ElasticModes:
    """Return the modes of the structure at rest in the pose of a time.

    Raises
    ------
    SimulationError
        When the linkage cannot be assembled there.
    ModelError
        When the structure is unstable at rest.
    """
    status, mass, damping, stiffness, _, basis = equations.matrices(t, _beams.AT_REST)
    motion.check(equations, status, t)
    sizes = stiffness_sizes(equations, stiffness, None if basis is None else basis[0])
    speeds, shapes, rigid = modes_at_rest(motion.rigid.name, mass, stiffness, sizes)
    return ElasticModes(
        motion.rigid.name,
        float(motion.angle_at(np.array(t))),
        speeds / (2 * math.pi),
        shapes if basis is None else basis[0] @ shapes,
        motion.layout.names,
        rigid=rigid,
        ratios=_ratios(damping, speeds, shapes),
    )


def _ratios(damping: Array, speeds: Array, shapes: Array) -> Array:
    """Return phi^T C phi / (2 w) of shapes phi of unit modal mass; zero where w is."""
    ratios = np.zeros_like(speeds)
    if not damping.any():
        return ratios
    damped = np.sum(shapes * (damping @ shapes), axis=0)
    return np.divide(damped, 2 * speeds, out=ratios, where=speeds > 0.0)


def lowest(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> float:
    """Return the lowest frequency [Hz] of the structure at rest in the pose of a time that strains it.

    Raises
    ------
    SimulationError, ModelError
        As :func:`elastic_modes`.
    """
    if motion.layout.unknowns <= _DENSE:
        modes = elastic_modes(motion, equations, t)
        return float(modes.frequencies[modes.rigid])
    return _lowest_of_many(motion, equations, t)


def _lowest_of_many(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> float:
    """Return the same by inverse iteration about a shift below all squared frequencies."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import eigsh

    status, rows, columns, (mass, _, stiffness) = equations.sparse(t, _beams.AT_REST)
    motion.check(equations, status, t)
    k, m = (coo_array((values, (rows, columns))).tocsc() for values in (stiffness, mass))
    k, m = (k + k.T) / 2, (m + m.T) / 2
    # Below zero, so that a free crank does not make the shifted matrix singular.
    shift = -(motion.speed**2)
    for count in range(3, m.shape[0]):
        squares, shapes = eigsh(k, count, m, shift, v0=np.ones(m.shape[0]))
        strained = np.sum(shapes * (k @ shapes), axis=0) > ROUND_OFF * np.sum(
            np.abs(shapes) * (abs(k) @ np.abs(shapes)), axis=0
        )
        if np.any(strained):
            return float(np.sqrt(np.min(squares[strained]))) / (2 * math.pi)
    raise ModelError(f"{motion.rigid.name}: no mode of the structure strains a link")


def moving_modes(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> ElasticModes:
    """Return the modes of (M z^2 + C z + K) y = 0 as the linkage moves at a time, its matrices held.

    Each joint is followed on the axes of the first elastic link that has it, so that they are exact for a
    link that turns at constant speed. Of several links they hold for modes much faster than the crank.

    Raises
    ------
    SimulationError
        When the linkage cannot be assembled there.
    """
    from scipy.linalg import eig

    status, mass, damping, stiffness, _, basis = equations.matrices(t)
    motion.check(equations, status, t)
    status, _, _, resting, _, _ = equations.matrices(t, _beams.AT_REST)
    motion.check(equations, status, t)
    turned, rate, second = _axes(motion, equations, t, basis)
    # In the modes at rest all entries are of the size of their own frequencies, and small ones are not lost.
    speeds, modes, rigid = modes_at_rest(
        motion.rigid.name,
        turned.T @ mass @ turned,
        turned.T @ resting @ turned,
        stiffness_sizes(equations, resting, turned if basis is None else basis[0] @ turned),
    )
    added = turned.T @ ((stiffness - resting) @ turned + damping @ rate + mass @ second)
    damping = modes.T @ (turned.T @ (damping @ turned + 2 * mass @ rate)) @ modes
    stiffness = modes.T @ added @ modes + np.diag(speeds**2)
    n = len(stiffness)
    scale = np.where(speeds > 0.0, speeds, speeds[min(rigid, n - 1)] or 1.0)
    values, vectors = eig(np.block([[np.zeros((n, n)), np.diag(scale)], [-stiffness / scale, -damping]]))
    selected = _one_of_each(values, n)
    shapes = turned @ modes @ (vectors[:n, selected] / scale[:, None])
    whole = shapes if basis is None else basis[0] @ shapes
    whole = whole / whole[np.argmax(np.abs(whole), axis=0), np.arange(whole.shape[1])]
    angle = float(motion.angle_at(np.array(t)))
    frequencies = np.abs(values[selected].imag) / (2 * math.pi)
    return ElasticModes(
        motion.rigid.name, angle, frequencies, whole, motion.layout.names, values[selected].real
    )


def _axes(
    motion: ElasticMotion, equations: _beams.BeamEquations, t: float, basis: Array | None
) -> tuple[Array, Array, Array]:
    """Return P of p = P y with y on the axes of links, P' and P''.

    A joint that moves along one line only is followed along that, one that depends on others stays.
    """
    links = equations.motion.evaluate(t)[2].reshape(-1, len(MOTION))
    columns: dict[int, int] = {}
    if basis is None:
        columns = {i: i for i in range(motion.layout.unknowns)}
    else:  # the free unknowns are those that R copies
        for i, row in enumerate(basis[0]):
            at = np.flatnonzero(row)
            if len(at) == 1 and row[at[0]] == 1.0 and int(at[0]) not in columns.values():
                columns[i] = int(at[0])
    n = motion.layout.unknowns if basis is None else basis.shape[2]
    turned, rate, second = np.eye(n), np.zeros((n, n)), np.zeros((n, n))
    rotated: set[int] = set()
    for k, beam in enumerate(motion.beams):
        axes = frames(links[k])
        rotation = np.array(axes.fixed(*np.eye(2)))
        quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
        by_rate, by_turn = axes.stiffness_damping_quarter, axes.stiffness_mass_quarter
        for end in beam.joints:
            pair = [columns.get(int(i), -1) for i in motion.layout.of_links[k][list(end)]]
            if min(pair) < 0 or rotated.intersection(pair):
                continue
            rotated.update(pair)
            there = np.ix_(pair, pair)
            turned[there], rate[there] = rotation, by_rate * rotation @ quarter
            second[there] = rotation @ (by_turn * quarter + axes.stiffness_mass_ends * np.eye(2))
    if basis is not None:
        for point in motion.rigid.description.free:
            pair = [motion.layout.names.index(f"{point}.{axis}") for axis in "xy"]
            in_columns = [(axis, columns[i]) for axis, i in enumerate(pair) if i in columns]
            if len(in_columns) == 1 and np.all(np.delete(basis[0][pair], in_columns[0][1], axis=1) == 0.0):
                axis, j = in_columns[0]
                turned[j, j], rate[j, j], second[j, j] = _along(*basis[:, pair, j])[:, axis]
    return turned, rate, second


def _along(r: Array, rate: Array, second: Array) -> Array:
    """Return the unit vector d along a vector in the plane, d' and d'', shape (3, 2)."""
    square, cross = r @ r, r[0] * rate[1] - r[1] * rate[0]
    w = cross / square
    turn = (r[0] * second[1] - r[1] * second[0]) / square - 2 * (r @ rate) * cross / square**2
    d = r / np.sqrt(square)
    left = np.array([-d[1], d[0]])
    return np.array([d, w * left, turn * left - w**2 * d])


def _one_of_each(values: NDArray[np.complex128], n: int) -> Indices:
    """Return the places of n eigenvalues by rising frequency: one of each pair z, z*, the larger of reals."""
    still = np.flatnonzero(values.imag == 0.0)
    still = still[np.argsort(-values[still].real, kind="stable")][: len(still) // 2]
    moving = np.flatnonzero(values.imag > 0.0)
    moving = moving[np.argsort(values[moving].imag, kind="stable")]
    return np.concatenate([still, moving])[:n]
