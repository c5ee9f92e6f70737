"""Frequencies and shapes of the structure in a pose, at rest or moving, and its response to held loads."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime import _beams
from symgen.runtime.beam_frames import frames
from symgen.runtime.elastic_motion import ElasticMotion

Array = NDArray[np.float64]

#: Part of the largest eigenvalue below which one counts as zero.
_ZERO = 1e-12
#: Part of another frequency below which one belongs to a motion without strain.
_RIGID = 1e-5
#: Unknowns up to which all modes are found at once.
_DENSE = 60


@dataclass(frozen=True, slots=True, repr=False)
class ElasticModes:
    """Modes of the structure in one pose of its rigid links, by rising frequency.

    Attributes
    ----------
    frequencies
        [Hz].
    shapes
        (unknowns, modes) in the order of ``names``, on fixed axes: of unit modal mass, or complex with 1 as
        their largest component where the links move.
    growth
        Of each mode in motion [1/s], below zero where it decays; empty at rest.
    without_reduction
        Where links are reduced: the frequencies [Hz] without that, as many of the lowest, and the number of
        unknowns then. Empty and the same number where none is.
    """

    name: str
    angle: float
    frequencies: Array
    shapes: NDArray[Any]
    names: tuple[str, ...]
    growth: Array = field(default_factory=lambda: np.zeros(0))
    without_reduction: tuple[Array, int] | None = None

    def __repr__(self) -> str:
        found = ", ".join(f"{f:.6g}" for f in self.frequencies[:3].tolist())
        more = ", ..." if len(self.frequencies) > 3 else ""
        pose = f"{math.degrees(self.angle):.6g} degrees"
        return f"<ElasticModes {self.name!r} at {pose}: {found}{more} Hz, {len(self.frequencies)} modes>"

    @property
    def errors(self) -> Array:
        """Parts by which the reduction of links makes frequencies too high; empty where none is reduced.

        Frequencies of zero have none.
        """
        if self.without_reduction is None:
            return np.zeros(0)
        exact = self.without_reduction[0]
        found = self.frequencies[: len(exact)]
        return np.divide(found, exact, out=np.ones_like(exact), where=exact > 0.0) - 1.0

    def summary(self) -> dict[str, Any]:
        """Return them in plain numbers: what ``symgen modes --json`` prints."""
        found: dict[str, Any] = {
            "scene": self.name,
            "analysis": "modes",
            "angle_deg": math.degrees(self.angle),
            "unknowns": len(self.frequencies),
            "frequencies_hz": self.frequencies.tolist(),
        }
        if len(self.growth):
            found["growth_per_s"] = self.growth.tolist()
        if self.without_reduction is not None:
            found["unknowns_without_reduction"] = self.without_reduction[1]
            found["errors_of_reduction"] = self.errors.tolist()
        return found


def modes_with_errors(motion: ElasticMotion, t: float, moving: bool) -> ElasticModes:
    """Return the modes in the pose of a time, and where links are reduced those without that.

    Raises
    ------
    SimulationError, ModelError
        As :func:`elastic_modes` and :func:`moving_modes`.
    """
    solve = moving_modes if moving else elastic_modes
    found, whole = solve(motion, motion.equations(), t), motion.unreduced()
    if whole is None:
        return found
    exact = solve(whole, whole.equations(), t).frequencies
    return replace(found, without_reduction=(exact[: len(found.frequencies)], len(exact)))


def elastic_modes(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> ElasticModes:
    """Return the modes of the structure at rest in the pose of a time.

    Raises
    ------
    SimulationError
        When the linkage cannot be assembled there.
    ModelError
        When the structure is unstable at rest.
    """
    from scipy.linalg import eigh

    status, mass, _, stiffness, _, basis = equations.matrices(t, resting=True)
    motion.check(equations, status, t)
    squares, shapes = eigh((stiffness + stiffness.T) / 2, (mass + mass.T) / 2)
    least = -_ZERO * float(squares[-1])
    if squares[0] < least:
        raise ModelError(f"{motion.rigid.name} is unstable at rest in this pose: a spring pushes it away")
    frequencies = np.sqrt(np.where(squares <= -least, 0.0, squares)) / (2 * math.pi)
    whole = shapes if basis is None else basis[0] @ shapes
    return ElasticModes(
        motion.rigid.name, float(motion.angle_at(np.array(t))), frequencies, whole, motion.layout.names
    )


def lowest(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> float:
    """Return the lowest frequency [Hz] of the structure at rest in the pose of a time that strains it.

    Raises
    ------
    SimulationError, ModelError
        As :func:`elastic_modes`.
    """
    if motion.layout.unknowns <= _DENSE:
        found = elastic_modes(motion, equations, t).frequencies
    else:
        found = _lowest_few(motion, equations, t)
    return float(found[found > _RIGID * found[-1]][0])


def _lowest_few(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> Array:
    """Return the lowest frequencies of many, by inverse iteration about a shift below all of them."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import eigsh

    status, rows, columns, (mass, _, stiffness) = equations.sparse(t, resting=True)
    motion.check(equations, status, t)
    k, m = (coo_array((values, (rows, columns))).tocsc() for values in (stiffness, mass))
    # Below zero, so that a free crank does not make the shifted matrix singular.
    shift = -(motion.speed**2)
    squares = eigsh(
        (k + k.T) / 2,
        3,
        (m + m.T) / 2,
        shift,
        return_eigenvectors=False,
        v0=np.ones(m.shape[0]),
    )
    return np.sqrt(np.maximum(np.sort(squares), 0.0)) / (2 * math.pi)


def moving_modes(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> ElasticModes:
    """Return the modes of (M z^2 + C z + K) y = 0 as the linkage moves at a time, its matrices held.

    Each joint is followed on the axes of the first elastic link that has it, so that they are exact for a
    link that turns at constant speed. Of several links they hold for modes much faster than the crank.

    Raises
    ------
    SimulationError
        When the linkage cannot be assembled there.
    """
    from scipy.linalg import eig, lu_factor, lu_solve

    status, mass, damping, stiffness, _, basis = equations.matrices(t)
    motion.check(equations, status, t)
    turned, rate, second = _axes(motion, equations, t, basis)
    stiffness = turned.T @ (stiffness @ turned + damping @ rate + mass @ second)
    damping = turned.T @ (damping @ turned + 2 * mass @ rate)
    factor = lu_factor(turned.T @ mass @ turned)
    stiffness, damping = lu_solve(factor, stiffness), lu_solve(factor, damping)
    n = len(stiffness)
    # Rates over the highest frequency, so that all entries are of one size.
    scale = math.sqrt(float(np.max(np.abs(stiffness)))) or 1.0
    values, vectors = eig(np.block([[np.zeros((n, n)), scale * np.eye(n)], [-stiffness / scale, -damping]]))
    kept = _one_of_each(values, n)
    shapes = turned @ vectors[:n, kept]
    whole = shapes if basis is None else basis[0] @ shapes
    whole = whole / whole[np.argmax(np.abs(whole), axis=0), np.arange(whole.shape[1])]
    angle = float(motion.angle_at(np.array(t)))
    frequencies = np.abs(values[kept].imag) / (2 * math.pi)
    return ElasticModes(motion.rigid.name, angle, frequencies, whole, motion.layout.names, values[kept].real)


def _axes(
    motion: ElasticMotion, equations: _beams.BeamEquations, t: float, basis: Array | None
) -> tuple[Array, Array, Array]:
    """Return P of p = P y with y on the axes of links, P' and P''.

    A joint that moves along one line only is followed along that, one that depends on others stays.
    """
    links = equations.motion.evaluate(t)[2].reshape(-1, 10)
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
    done: set[int] = set()
    for k, beam in enumerate(motion.beams):
        axes = frames(links[k : k + 1])
        c, s, w, turn = (float(v[0]) for v in (axes.cosine, axes.sine, axes.rate, axes.turn))
        rotation, quarter = np.array([[c, -s], [s, c]]), np.array([[0.0, -1.0], [1.0, 0.0]])
        for end in beam.ends:
            pair = [columns.get(int(i), -1) for i in motion.layout.of_links[k][list(end)]]
            if min(pair) < 0 or done.intersection(pair):
                continue
            done.update(pair)
            there = np.ix_(pair, pair)
            turned[there], rate[there] = rotation, w * rotation @ quarter
            second[there] = rotation @ (turn * quarter - w**2 * np.eye(2))
    if basis is not None:
        for point in motion.rigid.description.free:
            pair = [motion.layout.names.index(f"{point}.{axis}") for axis in "xy"]
            own = [(axis, columns[i]) for axis, i in enumerate(pair) if i in columns]
            if len(own) == 1 and np.all(np.delete(basis[0][pair], own[0][1], axis=1) == 0.0):
                axis, j = own[0]
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


def _one_of_each(values: NDArray[np.complex128], n: int) -> NDArray[np.intp]:
    """Return the places of n eigenvalues by rising frequency: one of each pair z, z*, the larger of reals."""
    still = np.flatnonzero(values.imag == 0.0)
    still = still[np.argsort(-values[still].real, kind="stable")][: len(still) // 2]
    moving = np.flatnonzero(values.imag > 0.0)
    moving = moving[np.argsort(values[moving].imag, kind="stable")]
    return np.concatenate([still, moving])[:n]


def quasi_static(motion: ElasticMotion, equations: _beams.BeamEquations, times: Array) -> Array:
    """Return displacements (times, unknowns) under the loads of the rigid motion alone, K0 S = Q.

    Raises
    ------
    ModelError
        When nothing holds the crank, so that the structure has a motion without stiffness.
    """
    from scipy.linalg import cho_solve_banded, cholesky_banded

    found = np.zeros((len(times), motion.layout.unknowns))
    for k, t in enumerate(times.tolist()):
        status, _, _, _, load, _ = equations.matrices(t)
        motion.check(equations, status, t)
        status, _, _, stiffness, _, basis = equations.matrices(t, resting=True)
        motion.check(equations, status, t)
        try:
            factor = cholesky_banded(_banded((stiffness + stiffness.T) / 2), lower=True)
        except np.linalg.LinAlgError:
            factor = None
        if factor is None or np.min(np.abs(factor[0])) <= 1e-7 * np.max(np.abs(factor[0])):
            raise ModelError(
                f"{motion.rigid.name}: the structure can move without being strained, so that loads alone do "
                'not determine its shape\n  Hold the crank: mode = "held" under [crank].'
            )
        p = cho_solve_banded((factor, True), load)
        found[k] = p if basis is None else basis[0] @ p
    return found


def _banded(matrix: Array) -> Array:
    """Return the diagonals of a symmetric matrix from the main one down, for banded solvers."""
    rows, columns = np.nonzero(matrix)
    made = np.zeros((int(np.max(rows - columns, initial=0)) + 1, len(matrix)))
    for k in range(len(made)):
        made[k, : len(matrix) - k] = np.diagonal(matrix, -k)
    return made
