"""Runs of a chain: RK4 on rod vectors, lengths and their rates projected after every step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from symgen.errors import ModelError, SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.chain.elimination import Elimination
from symgen.runtime.integrate.pace import is_spent, out_of_time

Forces = ArrayLike | Callable[[float, Array, Array], ArrayLike]

_ROUND_OFF = 4e-16
_PROJECTIONS = 8
#: Steps of a run at most: each is a sample that is kept, unless ``every`` says otherwise.
_STEPS = 1e9


@dataclass(frozen=True, slots=True)
class ChainRun:
    """Samples of a run: ``times`` [s], ``positions`` [m] and ``velocities`` [m/s] of the points over time."""

    times: Array
    positions: Array
    velocities: Array
    energy: Array
    length_drift: float


class _State:
    """Base position and velocity, and vector and rate of every rod."""

    def __init__(self, base: Array, speed: Array, along: Array, rate: Array) -> None:
        self.parts = (base, speed, along, rate)

    def moved(self, by: float, change: tuple[Array, ...]) -> _State:
        return _State(*(x + by * y for x, y in zip(self.parts, change, strict=True)))


def run(
    chain: Elimination,
    t_end: float,
    step: float,
    positions: ArrayLike,
    velocities: ArrayLike | None,
    forces: Forces | None,
    every: int,
) -> ChainRun:
    """Step a chain; arguments as of :meth:`symgen.runtime.chain.chain.Chain.simulate`."""
    for name, value in (("t_end", t_end), ("step", step)):
        if not (np.isfinite(value) and value > 0):
            raise ModelError(f"{name} is {value}, expected a time in seconds, more than zero")
    if every < 1:
        raise ModelError(f"every is {every}, expected one step or more")
    p = chain._points("positions", positions)
    v = np.zeros_like(p) if velocities is None else chain._points("velocities", velocities)
    if p.shape != v.shape:
        raise ModelError(f"positions and velocities differ in shape: {p.shape} and {v.shape}")
    along = chain._vectors("positions", p, "along", None)
    if chain.pinned and np.any(v[..., 0, :]):
        raise ModelError(f"velocities: the base is pinned, expected zero there, got {v[..., 0, :]!r:.80}")
    state = _State(p[..., 0, :], v[..., 0, :], along, chain._vectors("velocities", v, "rates", None))
    drift = _project(chain, state, 0.0)
    if t_end / step > _STEPS:
        raise ModelError(f"expected at most {_STEPS:g} steps, got t_end = {t_end:g} s and step = {step:g} s")
    steps = max(1, round(t_end / step))
    h = t_end / steps
    samples = [(0.0, *_points(chain, state))]
    for i in range(steps):
        t = i * h
        k1 = _rates(chain, t, state, forces)
        k2 = _rates(chain, t + h / 2, state.moved(h / 2, k1), forces)
        k3 = _rates(chain, t + h / 2, state.moved(h / 2, k2), forces)
        k4 = _rates(chain, t + h, state.moved(h, k3), forces)
        mean = tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
        state = state.moved(h, mean)
        drift = max(drift, _project(chain, state, t + h))
        if (i + 1) % every == 0 or i + 1 == steps:
            samples.append(((i + 1) * h, *_points(chain, state)))
        if i + 1 < steps and is_spent():
            partial = _result(chain, samples, drift)
            raise SimulationError(out_of_time(t + h, t_end), time=t + h, partial=partial)
    return _result(chain, samples, drift)


def _result(chain: Elimination, samples: list[tuple[float, Array, Array]], drift: float) -> ChainRun:
    times, places, speeds = (np.array(x) for x in zip(*samples, strict=True))
    energy = chain._kinetic(speeds) + chain._potential(places)
    return ChainRun(times, places, speeds, energy, drift)


def _rates(chain: Elimination, t: float, state: _State, forces: Forces | None) -> tuple[Array, ...]:
    base, speed, along, rate = state.parts
    applied = forces(t, *_points(chain, state)) if callable(forces) else forces
    force = chain._force(applied, along.shape[:-2])
    gamma = -np.einsum("...i,...i->...", rate, rate)
    with np.errstate(all="ignore"):
        accelerations = chain._refined(along, gamma, force, np.zeros_like(base), None, None)
    a = accelerations.accelerations
    if not np.isfinite(a).all():
        raise SimulationError(f"the motion blew up at t = {t:.9g} s: take a smaller step", time=t)
    return speed, a[..., 0, :], rate, a[..., 1:, :] - a[..., chain.parents, :]


def _project(chain: Elimination, state: _State, t: float) -> float:
    """Bring lengths and their rates back, in place; return the largest relative error of a length left."""
    base, speed, along, rate = state.parts
    none = np.zeros((*along.shape[:-2], chain.rods + 1, chain.dimension))
    zeros = np.zeros_like(base)
    squares = chain.lengths**2
    previous = np.inf
    for _ in range(_PROJECTIONS):
        miss = (np.einsum("...i,...i->...", along, along) - squares) / 2
        worst = float(np.max(np.abs(miss) / squares, initial=0.0))
        if worst <= _ROUND_OFF or not worst < previous / 2:
            break
        previous = worst
        move = chain._solve(along, -miss, none, zeros)[0]
        base += move[..., 0, :]
        along += move[..., 1:, :] - move[..., chain.parents, :]
    if not worst <= 1e-12:
        raise SimulationError(
            f"the lengths cannot be brought back at t = {t:.9g} s: take a smaller step", time=t
        )
    slip = np.einsum("...i,...i->...", along, rate)
    move = chain._solve(along, -slip, none, zeros)[0]
    speed += move[..., 0, :]
    rate += move[..., 1:, :] - move[..., chain.parents, :]
    return worst


def _points(chain: Elimination, state: _State) -> tuple[Array, Array]:
    """Return positions and velocities of the points."""
    base, speed, along, rate = state.parts
    return _outward(chain, base, along), _outward(chain, speed, rate)


def _outward(chain: Elimination, base: Array, vectors: Array) -> Array:
    if chain._parents is None:
        first = base[..., None, :]
        return np.concatenate([first, first + np.cumsum(vectors, axis=-2)], axis=-2)
    sums = np.empty((*vectors.shape[:-2], chain.rods + 1, chain.dimension))
    sums[..., 0, :] = base
    for k, inner in enumerate(chain.parents):
        sums[..., k + 1, :] = sums[..., inner, :] + vectors[..., k, :]
    return sums
