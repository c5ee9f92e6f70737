"""Exact derivatives of steady states of elastic links by parameters, at angles of the crank.

Over a revolution of period T all matrices of M S'' + C S' + K S + J^T mu = Q, J S = 0 repeat, and so does S.
Both are trigonometric polynomials through their values in equally spaced poses, of so many that their highest
terms vanish. Derivatives by the time are then matrices over the poses, in proportion to 1/T, and the steady
state solves one linear system. Its differential at held angles of the crank has the same matrix:

    M dS'' + C dS' + K dS + J^T dmu = dQ - dM S'' - dC S' - dK S - dJ^T mu + (dT/T) (2 M S'' + C S')

where dM and the others are tangents along a parameter at held angles: the rigid motion changes as at a held
time, and by its rates multiplied by the change of the time at which the crank comes to the angle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime._beams import IN_MOTION
from symgen.runtime.arrays import Array, Dual
from symgen.runtime.elastic.derivatives.course import highest
from symgen.runtime.elastic.derivatives.matrices import Assembled, assembled
from symgen.runtime.elastic.derivatives.poses import Pose, check_smooth, derived
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import outputs as outputs_of
from symgen.runtime.kernels.evaluate import UNIT
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of

#: Numbers in long double.
Wide = NDArray[Any]

#: Poses of a revolution to begin with, an odd number, and the most unknowns of all poses together.
_FIRST, _MOST = 33, 6000
#: Growth of the number of poses until the rigid motion is resolved, then until S and dS are.
_MORE, _TWICE = 1.25, 1.5
#: Parts of its largest term below which the highest terms of a motion vanish: of the rigid one, of S and dS.
_RIGID, _ELASTIC = 1e-12, 1e-10
#: Part of the largest rate of a quantity above which it changes with the time itself, not by the pose alone.
_EXPLICIT = 1e-9
#: Solutions with one factorisation, and the number pi in long double.
_REFINED, _PI = 3, "3.14159265358979323846"


def sensitivity(
    motion: ElasticMotion, outputs: Sequence[str], parameters: Sequence[str], times: Array
) -> Sensitivity:
    """Return derivatives of outputs of the steady state at times [s] of a revolution, at held crank angles.

    Raises
    ------
    ModelError
        For an unknown output; where the crank is free or has a motor, loads jump, or modes of the structure
        have damping ratios; for links reduced to modes; where the motion needs too many poses.
    SimulationError
        Where the linkage cannot be assembled; when a derivative is not finite.
    """
    steady = motion.info.mode == "held" and motion.speed
    check_smooth(motion, "steady state", "" if steady else "its crank is not held at a constant speed")
    orbit, solved = _resolved(motion, tuple(parameters))
    between = orbit.between(times)
    along = (
        outputs_of(links, np.tensordot(between, rows, axes=1), between @ displacements)
        for links, (displacements, rows) in zip(orbit.links, solved, strict=True)
    )
    units, values, slopes = derived(outputs, along, "of a steady state")
    return sensitivity_of(motion.rigid.description, units, parameters, values, slopes, times)


def _last_terms(values: Array, least: float = 0.0) -> float:
    """Return :func:`highest` of the terms of periodic values (poses, ...)."""
    return highest(np.abs(np.fft.rfft(values, axis=0)) / len(values), least)


def _resolved(motion: ElasticMotion, parameters: tuple[str, ...]) -> tuple[_Orbit, list[tuple[Dual, Dual]]]:
    """Return enough poses, and displacements and weights of links in them for each parameter.

    Raises
    ------
    ModelError
        When too many poses are needed.
    """
    equations, size = motion.equations(), motion.layout.unknowns + motion.layout.constraints
    count, most = _FIRST, (_MOST // size - 1) | 1

    def grown(by: float) -> int:
        if count >= most:
            raise ModelError(
                f"{motion.rigid.name}: derivatives of its steady state need more than {count} poses of a "
                f"revolution with {size} unknowns each, expected at most {_MOST} in all\n"
                "  Take fewer elements or another speed."
            )
        return min(int(count * by) | 1, most)

    while True:
        times = motion.period * np.arange(count) / count
        if _last_terms(motion.rigid_motion(equations, times)[1]) > _RIGID:
            count = grown(_MORE)
            continue
        orbit = _Orbit(motion, parameters, times)
        solved = orbit.solved()
        left = _last_terms(solved[0][0].real * orbit.sizes)
        for name, (s, _) in zip(parameters, solved, strict=True):
            natural = np.max(np.abs(s.real * orbit.sizes)) / max(abs(motion.rigid.parameters[name]), 1e-300)
            left = max(left, _last_terms(s.imag / UNIT * orbit.sizes, natural))
        if left <= _ELASTIC:
            return orbit, solved
        count = grown(_TWICE)


@dataclass(frozen=True, slots=True)
class _Tangents:
    """Weights of links, of forces along them, and blocks of joints in a pose, with tangents."""

    rows: Dual
    loads: Dual
    joined: dict[str, Dual]


def _stacked(of: Sequence[_Tangents]) -> list[Dual]:
    """Return each quantity of all poses, (poses, ...)."""
    names = [*of[0].joined]
    blocks = [np.array([x.joined[name] for x in of]) for name in names]
    return [np.array([x.rows for x in of]), np.array([x.loads for x in of]), *blocks]


class _Orbit:
    """Poses of a revolution at equal intervals, an odd number, with their differentials."""

    def __init__(self, motion: ElasticMotion, parameters: tuple[str, ...], times: Array) -> None:
        self.motion, self.times, self.count = motion, times, len(parameters)
        equations = motion.equations()
        self.poses = [Pose(motion, parameters, t, equations) for t in times.tolist()]
        #: Links with tangents along each parameter.
        self.links = [self.poses[0].linkage(j) for j in range(self.count)]
        cranks = [self.poses[0].duals("elastic_motion", "constants", j)["crank"] for j in range(self.count)]
        turned, faster = np.array(cranks).reshape(self.count, 2).T.imag / UNIT
        #: Change of the period over it, by each parameter.
        self.longer = -faster / motion.speed
        n = len(times)
        apart = np.arange(n, dtype=np.longdouble)[:, None] - np.arange(n)
        turn = np.longdouble(_PI) / n * apart
        with np.errstate(divide="ignore"):
            rate = np.longdouble(_PI) / motion.period * (-1.0) ** apart / np.sin(turn)
        #: First derivative by the time of trigonometric polynomials from their values.
        self.rate = np.where(np.eye(n, dtype=bool), np.longdouble(0.0), rate)
        #: Square roots of the stiffness of each unknown.
        self.sizes = np.ones(motion.layout.unknowns)
        rates = self.rate @ np.array([pose.work for pose in self.poses])
        self.later = -(turned + np.multiply.outer(times, faster)) / motion.speed
        for pose, late, of_work in zip(self.poses, self.later, rates.astype(float), strict=True):
            pose.add_time(late, of_work)
        self.explicit = self._explicit()

    def _explicit(self) -> list[Array]:
        """Return the rates of all blocks of the rigid motion by the time itself, by poses."""
        accelerations = []
        for values in _stacked(self.tangents(self.count)):
            rates = np.tensordot(self.rate, values.real, axes=1)
            left = rates - values.imag / UNIT
            size, gap = (np.max(np.abs(x), axis=0, initial=0.0) for x in (rates, left))
            least = _EXPLICIT * np.max(size, initial=0.0)
            accelerations.append(
                np.where(gap <= _EXPLICIT * np.maximum(size, least), 0.0, left).astype(float)
            )
        return accelerations

    def along(self, j: int) -> list[_Tangents]:
        """Return the rigid motion in all poses with tangents along parameter j at held crank angles."""
        of = self.tangents(j)
        names = [*of[0].joined]
        shifted = [
            values + 1j * UNIT * self.later[:, j].reshape(-1, *[1] * (values.ndim - 1)) * rates
            for values, rates in zip(_stacked(of), self.explicit, strict=True)
        ]
        return [
            _Tangents(rows, loads, dict(zip(names, blocks, strict=True)))
            for rows, loads, *blocks in zip(*shifted, strict=True)
        ]

    def between(self, times: Array) -> Array:
        """Return the matrix of values at other times by those in the poses, (times, poses)."""
        n = len(self.times)
        half = np.pi * (times[:, None] - self.times) / self.motion.period
        close = np.abs(np.sin(half)) < 1e-14
        return np.where(close, 1.0, np.sin(n * half) / (n * np.where(close, 1.0, np.sin(half))))

    def tangents(self, j: int) -> list[_Tangents]:
        """Return the rigid motion in all poses with tangents along parameter j."""
        return [_Tangents(*pose.of_motion(j)) for pose in self.poses]

    def solved(self) -> list[tuple[Dual, Dual]]:
        """Return displacements (poses, unknowns) and weights of links, with tangents along each parameter."""
        states, solve, state = [], None, (np.zeros(0), np.zeros(0))
        for j in range(self.count):
            along = self.along(j)
            matrices = [assembled(self.links[j], x.rows, x.loads, x.joined, IN_MOTION) for x in along]
            if solve is None:
                solve = self._solver(matrices)
                still = np.zeros((len(matrices), len(matrices[0].bound)))
                state = solve(np.array([x.load.real for x in matrices]), still)
            places, mu = state
            rates = self.rate @ places
            second = self.rate @ rates
            load, opened = [], []
            for k, x in enumerate(matrices):
                force = x.load.imag - x.mass.imag @ second[k] - x.damping.imag @ rates[k]
                force = force - x.stiffness.imag @ places[k] - x.bound.imag.T @ mu[k]
                longer = 2 * x.mass.real @ second[k] + x.damping.real @ rates[k]
                load.append(force / UNIT + self.longer[j] * longer)
                opened.append(-x.bound.imag @ places[k] / UNIT)
            moved = solve(np.array(load), np.array(opened))[0]
            duals = (places + 1j * UNIT * moved).astype(complex)
            states.append((duals, np.array([x.rows for x in along])))
        return states

    def _solver(self, assembled_matrices: Sequence[Assembled]) -> Callable[[Wide, Wide], tuple[Wide, Wide]]:
        """Return the solution for forces (poses, unknowns) and for constraints (poses, constraints).

        It is refined with residuals in long double.
        """
        from scipy.linalg import lu_factor, lu_solve

        mass, damping, stiffness, bound = (
            np.array([getattr(x, name).real for x in assembled_matrices])
            for name in ("mass", "damping", "stiffness", "bound")
        )
        count, n, m = len(assembled_matrices), stiffness.shape[1], bound.shape[1]
        sizes = np.sqrt(np.max(np.abs(np.diagonal(stiffness, axis1=1, axis2=2)), axis=0)).astype(float)
        self.sizes = sizes = np.where(sizes > 0.0, sizes, 1.0)
        weights = np.max(np.abs(bound / sizes), axis=2, initial=0.0)
        scaled = bound / sizes / weights[:, :, None]
        system = np.zeros((count, n + m, count, n + m))
        rate = self.rate.astype(float)
        second = (self.rate @ self.rate).astype(float)
        both = np.outer(sizes, sizes)
        for k in range(count):
            of_rates = np.multiply.outer((damping[k] / both).astype(float), rate[k])
            of_rates += np.multiply.outer((mass[k] / both).astype(float), second[k])
            system[k, :n, :, :n] = of_rates.transpose(0, 2, 1)
            system[k, :n, k, :n] += stiffness[k] / both
            system[k, :n, k, n:], system[k, n:, k, :n] = scaled[k].T, scaled[k]
        factors = lu_factor(system.reshape(count * (n + m), -1), overwrite_a=True)

        def times(matrices: Wide, rows: Wide) -> Wide:
            return np.einsum("kij,kj->ki", matrices, rows)

        def solve(forces: Wide, opened: Wide) -> tuple[Wide, Wide]:
            s, mu = np.zeros((count, n), np.longdouble), np.zeros((count, m), np.longdouble)
            for _ in range(_REFINED):
                rates = self.rate @ s
                left = forces - times(mass, self.rate @ rates) - times(damping, rates) - times(stiffness, s)
                left = left - times(bound.transpose(0, 2, 1), mu)
                right = np.hstack([left / sizes, (opened - times(bound, s)) / weights])
                x = lu_solve(factors, right.astype(float).ravel()).reshape(count, n + m)
                s, mu = s + x[:, :n] / sizes, mu + x[:, n:] / weights
            return s, mu

        return solve
