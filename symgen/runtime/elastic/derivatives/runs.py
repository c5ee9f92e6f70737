"""Exact derivatives of runs of elastic links by parameters: the tangents of implicit steps.

The elastic motion obeys linear equations, M S'' + C S' + K S + J^T mu = Q and J S = 0, whose coefficients
follow from the rigid motion at each time: :mod:`.course`. A step solves one linear system for the
accelerations at its stages. Its differential has the same matrix, and the tangents of the equations at the
stages on the right. Steps are those of the run, and so are the unknowns that each step takes as independent:
its error depends on them. Steps with the same unknowns are taken together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.arrays import Array, Dual, Indices
from symgen.runtime.beams.methods import BEAM_METHODS, BeamMethod
from symgen.runtime.elastic.derivatives.course import Course, Reduced, bases, reduced
from symgen.runtime.elastic.derivatives.poses import check_smooth, derived
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import Counts
from symgen.runtime.elastic.outputs import outputs as outputs_of
from symgen.runtime.kernels.evaluate import UNIT
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of

#: Most steps that are taken together.
_CHUNK = 64


def sensitivity(
    motion: ElasticMotion,
    outputs: Sequence[str],
    parameters: Sequence[str],
    method: str,
    times: Array,
    counts: Counts,
) -> Sensitivity:
    """Return derivatives of outputs at times [s] of a run from the undeformed state.

    Parameters
    ----------
    method
        Name of a method of implicit steps.
    counts
        Number of steps to each time, in rising order, from the one before it.

    Raises
    ------
    ModelError
        For an unknown output; for a crank with a motor, loads that jump, damping ratios of modes of the
        structure, redundant constraints, and links reduced to modes; where the rigid motion is not smooth.
    SimulationError
        Where the linkage cannot be assembled; when a derivative is not finite.
    """
    check_smooth(motion, "runs", "a motor moves its crank" if motion.has_motor else "")
    order = np.argsort(times, kind="stable")
    course = Course(motion, tuple(parameters), float(times[order[-1]]))
    states = _stepped(_scheme(BEAM_METHODS[method]), course, times[order], counts)
    tangents = np.zeros((len(times), len(parameters), motion.layout.unknowns), complex)
    for k, displacements in zip(order.tolist(), states, strict=True):
        tangents[k] = displacements
    along = (outputs_of(links, course.rows(j, times), tangents[:, j]) for j, links in enumerate(course.links))
    units, values, slopes = derived(outputs, along, "of a run of elastic links")
    return sensitivity_of(motion.rigid.description, units, parameters, values, slopes, times)


@dataclass(frozen=True, slots=True)
class _Scheme:
    """Weights of a step of length h, for accelerations x at its stages and a at its start.

    At stage i, at the part c[i] of the step, where p and v are those at the start,

        p'' = inertia[i] x + inertia0 a,   p' = v + h (rate[i] x + rate0 a),
        p = p + c[i] h v + h^2 (place[i] x + place0 a);

    the step ends with p + h v + h^2 (end_place x + end_place0 a) and v + h (end_rate x + end_rate0 a).
    """

    c: Array
    inertia: Array
    rate: Array
    place: Array
    end_rate: Array
    end_place: Array
    inertia0: float = 0.0
    rate0: float = 0.0
    place0: float = 0.0
    end_rate0: float = 0.0
    end_place0: float = 0.0
    #: Whether the acceleration of the last stage begins the next step.
    keeps: bool = False


def _scheme(method: BeamMethod) -> _Scheme:
    if method.collocated:
        of = method.arrays
        return _Scheme(of["c"], np.eye(len(of["c"])), of["a"], of["aa"], of["b"], of["ba"])
    (i0, i1), (r0, r1), (p0, p1) = method.inertia, method.rate, method.place
    one, gamma, beta = np.ones((1, 1)), method.gamma, method.beta
    return _Scheme(
        np.array([method.at]), i1 * one, r1 * one, p1 * one, np.array([gamma]), np.array([beta]),
        i0, r0, p0, 1 - gamma, 0.5 - beta, True,
    )  # fmt: skip


def _times(matrices: NDArray[Any], vectors: NDArray[Any]) -> Array:
    return (matrices @ vectors[..., None])[..., 0]


class _State:
    """Independent unknowns with their rates, and accelerations where steps keep them, of each parameter.

    ``rows`` has (1 + parameters, 3, unknowns): values, then tangents.
    """

    def __init__(self, course: Course, count: int) -> None:
        self.course, self.full = course, np.zeros((1 + count, 3, course.motion.layout.unknowns))

    def choose(self, independent: Indices) -> None:
        """Take the independent unknowns from all."""
        self.independent = independent
        self.rows = self.full[:, :, independent]

    def expand(self, t: float) -> None:
        """Find all unknowns at a time."""
        if len(self.course.shapes) == 4:
            self.full = self.rows
            return
        at = self.course.between(np.array([t]))
        values, slopes = at @ self.course.values, at @ self.course.tangents
        p = self.rows
        full = np.zeros_like(self.full)
        for j, tangent in enumerate(slopes):
            bound = self.course.parted(values + 1j * UNIT * tangent)[4:]
            value, rate, second = (x[0] for x in bases(bound, self.independent))
            d = p[0] + 1j * UNIT * p[1 + j]
            of = [value @ d[0], value @ d[1] + rate @ d[0], value @ d[2] + 2 * rate @ d[1] + second @ d[0]]
            full[0] = np.real(of)
            full[1 + j] = np.imag(of) / UNIT
        self.full = full


def _stepped(scheme: _Scheme, course: Course, times: Array, counts: Counts) -> Iterator[Dual]:
    """Yield displacements with tangents along each parameter at the times, (parameters, unknowns)."""
    state = _State(course, len(course.parameters))
    state.choose(course.independent(np.zeros(1))[0])
    if scheme.keeps:
        state.rows[:, 2] = _first_accelerations(course, state)
    now = 0.0
    for t, count in zip(times.tolist(), counts.tolist(), strict=True):
        h = (t - now) / max(count, 1)  # none at the start
        begins = now + h * np.arange(count)
        after = course.independent(begins + h)
        changes = 1 + np.flatnonzero(np.any(np.diff([state.independent, *after[:-1]], axis=0), axis=1))
        bounds = np.unique([*range(0, count, _CHUNK), *changes, count])
        for first, last in pairwise(bounds.tolist()):
            _chunk(scheme, course, state, begins[first:last], h)
            state.expand(begins[last - 1] + h)
            state.choose(after[last - 1])
        now = t
        yield state.full[0, 0] + 1j * UNIT * state.full[1:, 0]


def _at(course: Course, times: Array, state: _State) -> tuple[Reduced, Iterator[Reduced]]:
    """Return the equations at times of any shape, and their tangents along each parameter."""
    between = course.between(times.ravel()).reshape(*times.shape, -1)
    values = between @ course.values
    matrices = reduced(course.parted(values), state.independent)

    def tangents() -> Iterator[Reduced]:
        for tangent in course.tangents:
            slopes = between @ tangent
            if matrices.basis is None:
                yield reduced(course.parted(slopes), state.independent)
                continue
            dual = reduced(course.parted(values + 1j * UNIT * slopes), state.independent)
            of = (x.imag / UNIT for x in (dual.mass, dual.damping, dual.stiffness, dual.load))
            mass, damping, stiffness, load = of
            yield Reduced(mass, damping, stiffness, load, None)

    return matrices, tangents()


def _first_accelerations(course: Course, state: _State) -> Array:
    """Return the accelerations that begin the first step, with their tangents: those of loads at rest."""
    values, tangents = _at(course, np.zeros(1), state)
    accelerations = [np.linalg.solve(values.mass[0], values.load[0])]
    for x in tangents:
        accelerations.append(np.linalg.solve(values.mass[0], x.load[0] - x.mass[0] @ accelerations[0]))
    return np.array(accelerations)


@dataclass(frozen=True, slots=True)
class _Weights:
    """Those of a scheme times powers of the step."""

    until: Array
    inertia: Array
    rate: Array
    place: Array
    end_rate: Array
    end_place: Array


def _system(weights: _Weights, at: Reduced) -> Array:
    """Return the matrices of the accelerations at all stages of steps, (steps, stages n, stages n)."""
    steps, k, n = at.load.shape
    pairs = (weights.inertia, at.mass), (weights.rate, at.damping), (weights.place, at.stiffness)
    system = np.zeros((steps, k, n, k, n))
    for by, matrix in pairs:
        system += by[:, None, :, None] * matrix[:, :, :, None, :]
    return system.reshape(steps, k * n, k * n)


def _ends(scheme: _Scheme, weights: _Weights, x: Array) -> list[Array]:
    """Return the parts of places, rates and accelerations at the ends of steps by x (steps, stages, ...)."""
    increments = [np.tensordot(x, by, axes=(1, 0)) for by in (weights.end_place, weights.end_rate)]
    return [*increments, x[:, -1]] if scheme.keeps else increments


def _chunk(scheme: _Scheme, course: Course, state: _State, begins: Array, h: float) -> None:
    """Take some steps of length h."""
    weights = _Weights(
        h * scheme.c, scheme.inertia, h * scheme.rate, h * h * scheme.place, h * scheme.end_rate,
        h * h * scheme.end_place,
    )  # fmt: skip
    at, tangents = _at(course, begins[:, None] + weights.until, state)
    steps, k, n = at.load.shape
    orders = 3 if scheme.keeps else 2
    size = orders * n
    # Accelerations at the stages by places, rates and accelerations at the start, and by loads.
    later = at.damping + weights.until[:, None, None] * at.stiffness
    effective = (
        scheme.inertia0 * at.mass + h * scheme.rate0 * at.damping + h * h * scheme.place0 * at.stiffness
    )
    columns = np.concatenate(
        [-at.stiffness, -later, *([-effective] if scheme.keeps else []), at.load[..., None]], -1
    )
    inverse = np.linalg.inv(_system(weights, at))
    by_start = (inverse @ columns.reshape(steps, k * n, -1)).reshape(steps, k, n, -1)
    maps = np.concatenate(_ends(scheme, weights, by_start), axis=1)
    maps[:, : 2 * n, : 2 * n] += np.kron([[1.0, h], [0.0, 1.0]], np.eye(n))
    if scheme.keeps:
        maps[:, :n, 2 * n : 3 * n] += h * h * scheme.end_place0 * np.eye(n)
        maps[:, n : 2 * n, 2 * n : 3 * n] += h * scheme.end_rate0 * np.eye(n)
    path = np.zeros((steps + 1, size))
    path[0] = state.rows[0, :orders].ravel()
    for i in range(steps):
        path[i + 1] = maps[i, :, :size] @ path[i] + maps[i, :, size]
    rows = np.zeros_like(state.rows)
    rows[0, :orders] = path[-1].reshape(-1, n)
    begun = path[:-1, None]
    x = _times(by_start[..., :size], begun) + by_start[..., size]
    p, v = begun[..., :n], begun[..., n : 2 * n]
    a = begun[..., 2 * n :] if scheme.keeps else np.zeros(n)
    places = p + weights.until[:, None] * v + weights.place @ x + h * h * scheme.place0 * a
    rates = v + weights.rate @ x + h * scheme.rate0 * a
    accelerations = weights.inertia @ x + scheme.inertia0 * a
    for j, of in enumerate(tangents, 1):
        left = of.load - _times(of.mass, accelerations) - _times(of.damping, rates)
        left = (left - _times(of.stiffness, places)).reshape(steps, k * n)
        offsets = np.concatenate(_ends(scheme, weights, _times(inverse, left).reshape(steps, k, n)), axis=1)
        moved = state.rows[j, :orders].ravel()
        for i in range(steps):
            moved = maps[i, :, :size] @ moved + offsets[i]
        rows[j, :orders] = moved.reshape(-1, n)
    state.rows = rows
