"""Floquet multipliers of vibrations that steps do not resolve, from matrices held in poses of a revolution.

Steps longer than a third of a period of a vibration damp it. A vibration a phi much faster than the crank,
with phi^T M phi = 1, satisfies

    d(a^2 w)/dt = -a^2 w phi^T D phi,    D = (C + C^T)/2 - M'

by the method of Wentzel, Kramers and Brillouin: where nothing is damped, M q'' + C q' + K q = 0 has a
Lagrangian q'^T M q'/2 + q'^T A q - q^T S q/2, so that C = M' + A - A^T and K = S + A'. Over a revolution, in
which M and w repeat, log |mu| is the mean real part of the eigenvalues of M z^2 + D z + K - (C' - C'^T)/4,
times the period. A jump of w changes a^2 w by at most the ratio of w.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.runtime import _beams
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.motion import ElasticMotion

Numbers = NDArray[np.complex128]

#: Poses of a revolution at which frequencies are taken.
_POSES = 16
#: Part of a period over which the rate of the mass matrix is taken.
_NEARBY = 1e-5
#: Steps that resolve one vibration.
_RESOLVING = 3.0
#: Vibrations per revolution from which they are fast.
_FAST = 20.0
#: How near to one the multiplier of the phase of a crank with a motor is, but for the elastic deflections.
_OPEN = 0.2
#: How near to one, over the largest, a multiplier leaves the steady state undetermined.
RESONANT = 1e-9
#: Largest exponent of a multiplier that is shown.
_MOST = 700.0


class SingularMass(Exception):
    """The mass matrix is not positive definite."""


@dataclass(frozen=True, slots=True)
class HeldModes:
    """Eigenvalues [1/s] of matrices held in poses, (poses, 2 n) by rising magnitude.

    ``shapes`` (n, n) and ``frequencies`` [1/s] are the modes at time zero of :func:`modes_of`; states are
    a, b with displacements shapes a/frequencies and rates shapes b. ``jumps`` is the sum of |log w_+/w_-|,
    (2 n,), over jumps of the loads.
    """

    period: float
    shapes: Array
    frequencies: Array
    values: Numbers
    jumps: Array

    def multipliers(
        self, transition: Array, per_turn: float, phase: float | None
    ) -> tuple[Numbers, float | None]:
        """Return the multipliers of a transition matrix, those of fast vibrations from held matrices.

        ``per_turn`` are its steps per revolution; an open ``phase`` is left out. Also the error of those of
        fast vibrations, as one of the largest; None where steps do not resolve a vibration that is not fast.
        """
        multipliers, vectors = np.linalg.eig(transition)
        counts = np.mean(np.abs(self.values), axis=0) * self.period / (2 * np.pi)
        unresolved = counts > per_turn / _RESOLVING
        fast = unresolved & (counts > _FAST)
        found = without(np.asarray(multipliers, dtype=complex), phase)
        if not np.any(fast):
            return found, None if np.any(unresolved) else 0.0
        # Energies: those of fast modes are the parts by which the vectors of fast vibrations are recognised.
        energies = np.sum(np.abs(vectors.reshape(2, len(self.shapes), -1)) ** 2, axis=0)
        energies = energies[np.argsort(self.frequencies, kind="stable")]
        parts = np.sum(energies[-((np.count_nonzero(fast) + 1) // 2) :], axis=0) / np.sum(energies, axis=0)
        slow = np.argsort(parts, kind="stable")[: np.count_nonzero(~fast)]
        means = [np.mean(self.values[::every, fast], axis=0) * self.period for every in (1, 2)]
        sizes, fewer = (np.exp(np.minimum(mean.real, _MOST)) for mean in means)
        phases = np.mean(np.abs(self.values[:, fast].imag), axis=0) * self.period
        phases[1::2] *= -1.0  # of each pair z, z*
        found = without(np.concatenate([multipliers[slow], sizes * np.exp(1j * phases)]), phase)
        if not np.array_equal(fast, unresolved):
            return found, None
        # The next term of the method, over the first, is of the size of 1/counts^2.
        growing = np.expm1(self.jumps[fast]) + np.abs(means[0].real) / counts[fast] ** 2
        above = sizes * (1 + growing) + np.abs(fewer - sizes)
        return found, max(0.0, float(np.max(above) - np.max(np.abs(found))))


def without(multipliers: Numbers, phase: float | None) -> Numbers:
    """Return multipliers without that of an open phase, if there is one."""
    return multipliers if phase is None else np.delete(multipliers, np.argmin(np.abs(multipliers - phase)))


def by_size(multipliers: Numbers) -> tuple[complex, ...]:
    """Return multipliers, the largest first."""
    return tuple(map(complex, multipliers[np.argsort(-np.abs(multipliers), kind="stable")]))


def open_phase_of(transition: Array) -> tuple[float, Array, Array] | None:
    """Return the real multiplier nearest to one, and its right and left vectors with the product one."""
    from scipy.linalg import eig

    values, left, right = eig(transition, left=True, right=True)
    real = np.flatnonzero(values.imag == 0.0)
    if not len(real):
        return None
    k = int(real[np.argmin(np.abs(values[real].real - 1.0))])
    r, x = np.array(right[:, k].real), np.array(left[:, k].real)
    if abs(values[k].real - 1.0) > _OPEN or abs(x @ r) < RESONANT:
        return None
    return float(values[k].real), r, x / (x @ r)


def held_modes(motion: ElasticMotion, thesis: bool) -> HeldModes | None:
    """Return the eigenvalues in poses of a revolution; None if the mass matrix is not positive definite.

    Raises
    ------
    SimulationError
        When the linkage cannot be assembled in a pose.
    """
    equations, period = motion.equations(thesis), motion.period
    mass, _, stiffness, _ = _matrices(motion, equations, 0.0)
    jumps = np.zeros(2 * len(mass))
    try:
        shapes, _, frequencies = modes_of(mass, stiffness, period)
        values = [_held(motion, equations, period * (k + 0.5) / _POSES) for k in range(_POSES)]
        for begin, end in motion.jumps:
            if 0.0 < begin < end <= period:
                before, after = (_held(motion, equations, t) for t in (begin, end))
                with np.errstate(divide="ignore", invalid="ignore"):
                    jumps += np.nan_to_num(np.abs(np.log(np.abs(after) / np.abs(before))))
    except SingularMass:
        return None
    return HeldModes(period, shapes, frequencies, np.array(values), jumps)


def _held(motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> Numbers:
    """Return the roots z of det(M z^2 + D z + K) by rising magnitude, without the gyroscopic forces."""
    near = _NEARBY * motion.period
    mass, damping, stiffness, basis = _matrices(motion, equations, t)
    sides = []  # with the same independent unknowns
    for side in (t - near, t + near):
        *others, _, basis_there = _matrices(motion, equations, side)
        if basis is None or basis_there is None or np.array_equal(basis[0] == 1.0, basis_there[0] == 1.0):
            sides.append((side, others))
    sides = [*sides, (t, [mass, damping])][:2]
    (first, at_first), (last, at_last) = sides[0], sides[-1]
    mass_rate, damping_rate = (
        (y - x) / (last - first or 1.0) for x, y in zip(at_first, at_last, strict=True)
    )
    damping = (damping + damping.T) / 2 - mass_rate
    stiffness = stiffness - (damping_rate - damping_rate.T) / 4
    shapes, left, scale = modes_of(mass, stiffness, motion.period)
    lower = np.hstack([-(left @ stiffness @ shapes) / scale, -(left @ damping @ shapes)])
    values = np.linalg.eigvals(np.vstack([np.hstack([np.zeros_like(mass), np.diag(scale)]), lower]))
    return np.asarray(values[np.argsort(np.abs(values), kind="stable")], dtype=complex)


def modes_of(mass: Array, stiffness: Array, period: float) -> tuple[Array, Array, Array]:
    """Return modes phi (n, n), the inverse of M phi, and their angular frequencies [1/s].

    These are at least one per period. In modes all entries are of the size of their own frequencies, and slow
    ones keep their digits.

    Raises
    ------
    SingularMass
        If the mass matrix is not positive definite.
    """
    from scipy.linalg import LinAlgError, eigh

    try:
        squares, shapes = eigh((stiffness + stiffness.T) / 2, (mass + mass.T) / 2)
    except LinAlgError:
        raise SingularMass from None
    frequencies = np.sqrt(np.maximum(np.abs(squares), (2 * np.pi / period) ** 2))
    return shapes, np.linalg.solve(shapes.T @ mass @ shapes, shapes.T), frequencies


def _matrices(
    motion: ElasticMotion, equations: _beams.BeamEquations, t: float
) -> tuple[Array, Array, Array, Array | None]:
    status, mass, damping, stiffness, _, basis = equations.matrices(t)
    motion.check(equations, status, t)
    return mass, damping, stiffness, basis
