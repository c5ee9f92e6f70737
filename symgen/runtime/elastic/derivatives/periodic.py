"""Exact derivatives of steady states of elastic links by parameters, at angles of the crank.

Over a revolution of period T all matrices of M S'' + C S' + K S + J^T mu = Q, J S = 0 repeat, and so does S.
Both are trigonometric polynomials through their values in equally spaced poses, of so many that their highest
terms vanish. Derivatives by the time are then matrices over the poses, in proportion to 1/T, and the steady
state and its differential at held angles of the crank solve one linear system: see :mod:`.balance`. The rigid
motion there changes as at a held time, and by its rates multiplied by the change of the time of the angle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.errors import ModelError
from symgen.runtime._beams import IN_MOTION
from symgen.runtime.arrays import Array, Dual
from symgen.runtime.elastic.derivatives.balance import Balance
from symgen.runtime.elastic.derivatives.course import highest
from symgen.runtime.elastic.derivatives.matrices import assembled
from symgen.runtime.elastic.derivatives.poses import Pose, check_smooth, derived
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import outputs as outputs_of
from symgen.runtime.kernels.evaluate import UNIT
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of

#: Poses of a revolution to begin with, an odd number, and the most unknowns of all poses together.
_FIRST, _MOST = 33, 6000
#: Growth of the number of poses until the rigid motion is resolved, then until S and dS are.
_MORE, _TWICE = 1.25, 1.5
#: Parts of its largest term below which the highest terms of a motion vanish: of the rigid one, of S and dS.
_RIGID, _ELASTIC = 1e-12, 1e-10
#: The number pi in long double.
_PI = "3.14159265358979323846"


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
        self.later = -(turned + np.multiply.outer(times, faster)) / motion.speed

    def along(self, j: int) -> list[tuple[Dual, Dual, dict[str, Dual]]]:
        """Return :meth:`Pose.of_motion` in all poses, with tangents along parameter j at held angles."""
        rows, loads, joined = zip(*(pose.of_motion(j) for pose in self.poses), strict=True)
        blocks = {name: self._at_angles(j, [of[name] for of in joined]) for name in joined[0]}
        each = ({name: of[k] for name, of in blocks.items()} for k in range(len(rows)))
        return [*zip(self._at_angles(j, rows), self._at_angles(j, loads), each, strict=True)]

    def _at_angles(self, j: int, at_times: Sequence[Dual]) -> Dual:
        """Return values in all poses with tangents at held angles, from those at held times."""
        values = np.array(at_times)
        rates = np.tensordot(self.rate, values.real, axes=1)
        shifted: Dual = values + 1j * UNIT * (self.later[:, j] * rates.T).T.astype(float)
        return shifted

    def between(self, times: Array) -> Array:
        """Return the matrix of values at other times by those in the poses, (times, poses)."""
        n = len(self.times)
        half = np.pi * (times[:, None] - self.times) / self.motion.period
        close = np.abs(np.sin(half)) < 1e-14
        return np.where(close, 1.0, np.sin(n * half) / (n * np.where(close, 1.0, np.sin(half))))

    def solved(self) -> list[tuple[Dual, Dual]]:
        """Return displacements (poses, unknowns) and weights of links, with tangents along each parameter."""
        states, balance = [], None
        for j, longer in enumerate(self.longer):
            along = self.along(j)
            matrices = [assembled(self.links[j], *of, IN_MOTION) for of in along]
            balance = balance or Balance(matrices, self.rate)
            self.sizes = balance.sizes
            duals = balance.state[0] + 1j * UNIT * balance.differential(matrices, longer)
            states.append((duals.astype(complex), np.array([of[0] for of in along])))
        return states
