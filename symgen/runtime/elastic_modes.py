"""Frequencies and shapes of the structure frozen in a pose, and its response to loads that are held."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime import _beams
from symgen.runtime.elastic_motion import ElasticMotion

Array = NDArray[np.float64]

#: Part of the largest eigenvalue below which one counts as zero.
_ZERO = 1e-12
#: Part of another frequency below which one belongs to a motion without strain.
_RIGID = 1e-5
#: Unknowns up to which all modes are found at once.
_DENSE = 60


@dataclass(frozen=True, slots=True)
class ElasticModes:
    """Modes of the structure at rest in one pose of its rigid links, by rising frequency.

    ``frequencies`` [Hz]; ``shapes`` (unknowns, modes) in the order of ``names``, of unit modal mass.
    """

    name: str
    angle: float
    frequencies: Array
    shapes: Array
    names: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return them in plain numbers: what ``symgen modes --json`` prints."""
        return {
            "scene": self.name,
            "analysis": "modes",
            "angle_deg": math.degrees(self.angle),
            "unknowns": len(self.frequencies),
            "frequencies_hz": self.frequencies.tolist(),
        }


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


def quasi_static(motion: ElasticMotion, equations: _beams.BeamEquations, times: Array) -> Array:
    """Return displacements (times, unknowns) under the loads of the rigid motion alone, K0 S = Q.

    Raises
    ------
    ModelError
        When nothing holds the crank, so that the structure has a motion without stiffness.
    """
    from scipy.linalg import cho_factor, cho_solve

    found = np.zeros((len(times), motion.layout.unknowns))
    for k, t in enumerate(times.tolist()):
        status, _, _, _, load, _ = equations.matrices(t)
        motion.check(equations, status, t)
        status, _, _, stiffness, _, basis = equations.matrices(t, resting=True)
        motion.check(equations, status, t)
        try:
            factor = cho_factor((stiffness + stiffness.T) / 2)
        except np.linalg.LinAlgError:
            factor = None
        if factor is None or np.min(np.abs(np.diag(factor[0]))) <= 1e-7 * np.max(np.abs(np.diag(factor[0]))):
            raise ModelError(
                f"{motion.rigid.name}: the structure can move without being strained, so that loads alone do "
                'not determine its shape\n  Hold the crank: mode = "held" under [crank].'
            )
        p = cho_solve(factor, load)
        found[k] = p if basis is None else basis[0] @ p
    return found
