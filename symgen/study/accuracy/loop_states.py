"""States of a closed loop for the comparison of kernels: along its run, random closed, random open."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symgen.errors import InitialStateError, SimulationError
from symgen.runtime.closure.start import Closed, close_near
from symgen.runtime.loop.driven import followed
from symgen.study.accuracy.states import At, States, tuned

if TYPE_CHECKING:
    from symgen.runtime.loop.kernels import LoopKernels
    from symgen.runtime.loop.model import LoopModel

Array = NDArray[np.float64]
Random = np.random.Generator

#: Range of joint variables [rad] and of all other values in open states.
_OPEN = 1.5
_RANK = 1e-8
_TRIES = 4


def of_loop(model: LoopModel, count: int, seed: int, run: bool) -> States:
    """Return states of a loop: ``count`` along its range or run, random closed, and random open each."""
    kernels, notes, random = model.kernels, list[str](), np.random.default_rng(seed)
    along = list((_turned if model.is_driven else _moved)(model, count if run else 1, notes))
    states = [_moving(kernels, random, "run", *at) for at in along]
    for i in range(count):
        pose, u = _elsewhere(kernels, along, random)
        states.append(_moving(kernels, random, "closed", f"random {i + 1}", pose.t, pose.q, u))
    n, parameters = kernels.description.coordinates, kernels.parameter_values
    for i in range(count):
        arrays = {name: random.uniform(-_OPEN, _OPEN, k) for name, k in (("t", 1), ("q", n), ("u", n))}
        arrays |= {"p": tuned(parameters, random), "work": random.uniform(-_OPEN, _OPEN, n + 6)}
        states.append(At("open", f"open {i + 1}", arrays))
    return States(tuple(states), tuple(notes))


def _turned(model: LoopModel, count: int, notes: list[str]) -> Iterator[tuple[str, float, Array, Array]]:
    """Yield the closed loop over the range of its first input."""
    kernels, at = model.kernels, model.closed_start()
    still = np.zeros(kernels.description.coordinates)
    low, high = model.description.span
    for value in np.linspace(low, high, count):
        try:
            at = followed(kernels, at, float(value))
        except SimulationError as error:
            notes.append(f"the range is left early: {str(error).partition(chr(10))[0]}")
            return
        yield f"run, {kernels.value_at(at.t)}", at.t, at.q, still


def _moved(model: LoopModel, count: int, notes: list[str]) -> Iterator[tuple[str, float, Array, Array]]:
    """Yield the loop at equally spaced times of its motion."""
    kernels, at = model.kernels, model.closed_start()
    d = kernels.description
    yield "run, t = 0 s", at.t, at.q, np.array([v.start_rate for v in d.variables])
    for t in np.linspace(0.0, d.t_end, count)[1:]:
        try:
            final = model.simulate(float(t), samples=2).final
        except SimulationError as error:
            notes.append(f"the run ends at t = {error.time:.4g} s: {str(error).partition(chr(10))[0]}")
            return
        q, u = (np.array([final[v.name][entry] for v in d.variables]) for entry in ("value", "rate"))
        pose = _closed(kernels, float(t), q)
        yield f"run, t = {t:.4g} s", float(t), q if pose is None else pose, u


def _closed(kernels: LoopKernels, t: float, q: Array) -> Array | None:
    try:
        return close_near(kernels, t, q).q
    except InitialStateError:
        return None


def _elsewhere(
    kernels: LoopKernels, along: list[tuple[str, float, Array, Array]], random: Random
) -> tuple[Closed, Array]:
    """Return another closed pose at the time of a given one, with random rates of the free variables."""
    d = kernels.description
    free, n = d.having("free", "dependent"), d.coordinates
    _, t, q, _ = along[random.integers(len(along))]
    for k in range(_TRIES):
        guess = q.copy()
        size = np.array([d.size if v.is_length else 1.0 for v in d.variables])
        guess[free] += (random.standard_normal(n) * size)[free] / 2**k
        pose = _closed(kernels, t, guess)
        if pose is not None:
            q = pose
            break
    return Closed(t, q, d.rank), random.standard_normal(n)


def _moving(kernels: LoopKernels, random: Random, kind: str, label: str, t: float, q: Array, u: Array) -> At:
    """Return a closed pose with consistent rates and accelerations, and a random closing wrench."""
    d = kernels.description
    n, solved, inputs, u = d.coordinates, d.having("dependent"), d.having("input", "free"), u.copy()
    prescribed = kernels.prescribed(t)
    u[kernels.inputs] = prescribed[:, 1]
    zero = np.zeros(n)
    screws = kernels("motion", t, q, zero)["screws"]
    u[solved] = _following(screws, solved, screws[:, inputs] @ u[inputs])
    moving = kernels("motion", t, q, u)
    a = random.standard_normal(n)
    a[kernels.inputs] = prescribed[:, 2]
    a[solved] = _following(screws, solved, screws[:, inputs] @ a[inputs] + moving["screw_drift"])
    work = np.concatenate([a, random.standard_normal(6)])
    return At(kind, label, {"t": np.array([t]), "q": q, "u": u, "p": kernels.parameter_values, "work": work})


def _following(screws: Array, solved: list[int], rates: Array) -> Array:
    return np.asarray(np.linalg.lstsq(screws[:, solved], -rates, rcond=_RANK)[0], dtype=np.float64)
