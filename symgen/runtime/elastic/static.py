"""The shape of elastic links under loads and axial forces of the rigid motion, without their own inertia."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.precision import FLOAT64
from symgen.runtime import _beams
from symgen.runtime.arrays import Array
from symgen.runtime.beams.modal.structure import stiffness_sizes
from symgen.runtime.elastic.modes import elastic_modes
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import Solution
from symgen.runtime.elastic.steps import Start, Task, turn
from symgen.runtime.integrate.pace import OutOfTime, Pace

#: Places along each link at which the largest displacement of a mode is searched.
_PLACES = 65
#: Poses of a quasi-static motion between two looks at the clock.
_HELD = 32
#: Largest number of unknowns for which the stiffness is solved as a full matrix.
_DENSE = 40
#: Corrections of a shape by the forces that it leaves unbalanced, summed link by link.
REFINED = 2
#: Least difference between a scaled stiffness and its transpose that is no round-off.
_UNSYMMETRIC = 1e-10
#: Imaginary part of an eigenvalue that counts as real, over its size.
_REAL = 1e-7
#: Time between poses, over a revolution, for the rates of a start.
_APART = 1e-4
#: Number of intervals of time, each shorter than the last, by which rates are differenced.
_SHORTER = 12
#: Change of the rates with the interval, over their size.
_SETTLED = 1e-5
#: Round-off of shapes, over their size.
_ROUND_OFF = 1e-13


def quasi_static(motion: ElasticMotion, equations: _beams.BeamEquations, times: Array) -> Array:
    """Return displacements (times, unknowns) of (K + K_N) S = Q, with the loads Q of the rigid motion.

    K_N is the geometric stiffness of the axial forces of the rigid motion; zero without geometric stiffness.
    Forces that follow sections make K unsymmetric.

    Raises
    ------
    ModelError
        When nothing holds the crank, so that the structure has a motion without stiffness.
    SimulationError
        When the axial forces of a pose are beyond the buckling load of the structure.
    """
    if motion.info.mode == "free":
        raise ModelError(
            f"{motion.rigid.name}: its crank is free, so that loads do not determine its static shape\n"
            '  Hold the crank: mode = "held" under [crank]. Runs may start undeformed.'
        )
    displacements = np.zeros((len(times), motion.layout.unknowns))
    for k in np.argsort(times, kind="stable").tolist():
        t = float(times[k])
        status, _, _, stiffness, load, basis = equations.matrices(t, _beams.QUASI_STATIC)
        motion.check(equations, status, t)
        whole = None if basis is None else basis[0]
        sizes = stiffness_sizes(equations, stiffness, whole)
        scaled = stiffness / (sizes[:, None] * sizes)
        solve = _factorised(scaled, sizes)
        if np.abs(scaled - scaled.T).max(initial=0.0) > _UNSYMMETRIC:
            solve = _unsymmetric(motion, equations, t, stiffness, sizes, solve is not None)
        if solve is None:
            raise _no_shape(motion, equations, t, stiffness, sizes)
        shape = solve(load)
        displacements[k] = shape if whole is None else whole @ shape
        for _ in range(REFINED):
            rest = equations.unbalanced(displacements[k])
            displacements[k] -= solve(rest) if whole is None else whole @ solve(rest @ whole)
    return displacements


def of_modes(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    times: Array,
    amplitudes: Sequence[float],
) -> Array:
    """Return sums of modes of the structure at rest in the poses of rising times, (times, unknowns).

    Amplitudes [m] are those of the first modes that strain the structure: the largest displacement of an
    elastic link from its rigid position. The component of this displacement that is larger, along the link or
    across it, is positive in the first pose.

    Raises
    ------
    ModelError
        For more amplitudes than modes, those longer than the links, and as :func:`elastic_modes`.
    """
    check_amplitudes(motion.rigid.name, amplitudes, max(beam.properties.length for beam in motion.beams))
    places = np.linspace(0.0, 1.0, _PLACES)
    tables = [beam.table(places.tolist()) for beam in motion.beams]
    displacements, first = np.zeros((len(times), motion.layout.unknowns)), dict[int, Array]()
    for k, t in enumerate(times.tolist()):
        modes = elastic_modes(motion, equations, t)
        count = modes.shapes.shape[1] - modes.rigid
        links = motion.rigid_motion(equations, np.array([t]))[1]
        check_modes(motion.rigid.name, amplitudes, count)
        for number, size in enumerate(amplitudes):
            shape = np.real(modes.shapes[:, modes.rigid + number])
            local = [motion.local_unknowns(j, links, shape[None])[0] for j in range(len(tables))]
            moved = np.array(
                [[table["u"] @ s, table["w"] @ s] for table, s in zip(tables, local, strict=True)]
            )
            moved = np.moveaxis(moved, 1, 2).reshape(-1, 2)
            largest = moved[np.argmax(np.linalg.norm(moved, axis=1))]
            sign = np.sign(largest[np.argmax(np.abs(largest))])
            if number in first:
                sign = np.sign(np.sum(first[number] * moved))
            scale = sign * size / np.linalg.norm(largest)
            first.setdefault(number, sign * moved)
            displacements[k] += scale * shape
    return displacements


def check_amplitudes(name: str, amplitudes: Sequence[float], longest: float) -> None:
    """Raise ModelError for amplitudes of initial modes beyond the length of the longest link [m]."""
    beyond = next((size for size in amplitudes if abs(size) > longest), None)
    if beyond is not None:
        raise ModelError(
            f"{name}: expected amplitudes of the initial modes far below the length of the links, "
            f"{longest:.3g} m, got {beyond:g} m"
        )


def check_modes(name: str, amplitudes: Sequence[float], count: int) -> None:
    """Raise ModelError for amplitudes of more modes than there are."""
    if len(amplitudes) > count:
        raise ModelError(
            f"{name}: expected amplitudes of at most {count} modes as the initial state, "
            f"got {len(amplitudes)}"
        )


def initial(motion: ElasticMotion, equations: _beams.BeamEquations, task: Task) -> Start:
    """Return the start of a motion in time with its rates: a shape that the rigid motion carries along.

    It is the quasi-static one, or a sum of modes; None if undeformed.

    The rates are differences of fourth order of the shapes in five poses, at intervals that are shortened
    until they no longer change the rates.

    Raises
    ------
    ModelError
        For loads that jump at the start, and as :func:`quasi_static`.
    SimulationError
        As :func:`quasi_static`.
    """
    if task.initial == "undeformed":
        return None
    parts_of_state: list[Array] = []
    for apart in turn(motion) * _APART / np.pi ** np.arange(_SHORTER):  # no multiples of a load's period
        times = apart * np.arange(5.0)
        if isinstance(task.initial, str):
            shapes = quasi_static(motion, equations, times)
        else:
            shapes = of_modes(motion, equations, times, task.initial)
        parts_of_state.append(np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) @ shapes / (12 * apart))
        size = float(np.max(np.abs(parts_of_state[-1])))
        round_off = _ROUND_OFF * float(np.max(np.abs(shapes))) / apart
        changes = [float(np.max(np.abs(a - parts_of_state[-1]))) for a in parts_of_state[-3:-1]]
        if len(changes) == 2 and max(changes) <= _SETTLED * size + round_off:
            return shapes[0][:, None].copy(), parts_of_state[-3][:, None]
    raise ModelError(
        f"{motion.rigid.name}: the loads jump at the start, so that the quasi-static shape has no rate\n"
        "  Start it undeformed."
    )


def _factorised(scaled: Array, sizes: Array) -> Callable[[Array], Array] | None:
    """Return the function load -> K^-1 load of K = ``scaled`` times the sizes of row and column.

    None where K is not positive definite. Pivots are compared with the round-off of their own unknown: see
    :func:`stiffness_sizes`.
    """
    # For small matrices the checks of scipy.linalg cost more than the solution, and so does a band.
    from scipy.linalg.lapack import dpbtrf, dpbtrs, dpotrf, dpotrs

    symmetric = (scaled + scaled.T) / 2
    if dense := len(sizes) <= _DENSE:
        factor, failed = dpotrf(symmetric, lower=True, overwrite_a=True)
    else:
        factor, failed = dpbtrf(_banded(symmetric), lower=True, overwrite_ab=True)
    pivots = factor.diagonal() if dense else factor[0]
    if failed or not pivots.min() ** 2 > len(sizes) * FLOAT64.epsilon:
        return None  # where numbers are not finite, too
    by = dpotrs if dense else dpbtrs
    return lambda load: by(factor, load / sizes, lower=True)[0] / sizes


def _unsymmetric(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    t: float,
    stiffness: Array,
    sizes: Array,
    positive: bool,
) -> Callable[[Array], Array] | None:
    """Return the function load -> K^-1 load of an unsymmetric K; None where the structure diverges.

    K_0 + p (K - K_0), with the stiffness K_0 at rest, is then singular for a p up to one. It is for none
    where the symmetric part of K is ``positive`` definite.
    """
    from scipy.linalg import lu_factor, lu_solve

    if not positive:
        status, _, _, resting, _, _ = equations.matrices(t, _beams.AT_REST)
        motion.check(equations, status, t)
        if not np.all(np.isfinite(stiffness)) or _factorised(resting / np.outer(sizes, sizes), sizes) is None:
            return None
        if _used(resting, stiffness) >= 1.0:
            return None
        motion.check(equations, equations.matrices(t, _beams.QUASI_STATIC)[0], t)
    factor = lu_factor(stiffness / (sizes[:, None] * sizes), check_finite=False)
    return lambda load: np.asarray(lu_solve(factor, load / sizes, check_finite=False) / sizes, dtype=float)


def _used(resting: Array, loaded: Array) -> float:
    """Return the largest 1/p with which K_0 + p (K - K_0) is singular, -inf if none is."""
    eigenvalues = np.linalg.eigvals(np.linalg.solve(resting, resting - loaded))
    real = np.abs(eigenvalues.imag) <= _REAL * np.abs(eigenvalues)
    return float(np.max(eigenvalues.real[real], initial=-math.inf))


def _no_shape(
    motion: ElasticMotion, equations: _beams.BeamEquations, t: float, loaded: Array, sizes: Array
) -> ModelError | SimulationError:
    """Return the error of a structure whose stiffness under axial forces is not positive definite."""
    status, _, _, stiffness, _, _ = equations.matrices(t, _beams.AT_REST)
    motion.check(equations, status, t)
    if _factorised(stiffness / np.outer(sizes, sizes), sizes) is None:
        return ModelError(
            f"{motion.rigid.name}: the structure can move without being strained, so that loads alone do "
            'not determine its shape\n  Hold the crank: mode = "held" under [crank].'
        )
    if not np.all(np.isfinite(loaded)):
        return SimulationError(
            f"{motion.rigid.name}: forces of the rigid motion exceed the range of numbers at t = {t:g} s\n"
            "  Take a lower speed or load.",
            time=t,
        )
    largest = _used(stiffness, loaded)
    at = f"crank angle {math.degrees(float(motion.angle_at(np.array(t)))):.6g} degrees"
    return SimulationError(
        f"{motion.rigid.name}: the links buckle at {at if motion.speed else f'{t:g} s'}: the axial forces of "
        f"the rigid motion are {largest:.4g} times those under which the straight links are unstable\n"
        "  Take a lower speed or load, stiffer links, or large rotation: symgen large-rotation.",
        time=t,
    )


def _banded(matrix: Array) -> Array:
    """Return the diagonals of a symmetric matrix from the main one down, for banded solvers."""
    rows, columns = np.nonzero(matrix)
    below = rows - columns
    bands = np.zeros((len(matrix), int(np.max(below, initial=0)) + 1)).T
    lower = below >= 0
    bands[below[lower], columns[lower]] = matrix[rows[lower], columns[lower]]
    return bands


def held(motion: ElasticMotion, equations: _beams.BeamEquations, times: Array, pace: Pace) -> Solution:
    """Return the quasi-static displacements at the times, in parts so that the wall time is watched."""
    parts = []
    for first in range(0, len(times), _HELD):
        parts.append(quasi_static(motion, equations, times[first : first + _HELD]))
        end = min(first + _HELD, len(times))
        if end < len(times) and pace.spent(float(times[end - 1])):
            reached = np.arange(end)
            raise OutOfTime(float(times[end - 1]), Solution(np.concatenate(parts), None, end), reached)
    return Solution(np.concatenate(parts), None, len(times))
