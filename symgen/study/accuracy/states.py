"""States for the comparison of kernels: along a run, random on and off the constraints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import mpmath
import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.symbolic.exact import Exact

if TYPE_CHECKING:
    from symgen.runtime.elastic.model import ElasticModel
    from symgen.runtime.kernels.evaluate import Evaluator
    from symgen.runtime.rods.model.rods import RodModel
    from symgen.symbolic.system import System

Array = NDArray[np.float64]
Random = np.random.Generator

#: Distances of random poses from one of the run, in sizes of the mechanism, tried until one closes.
_AWAY = (0.3, 0.1, 0.03, 0.01)
#: Most iterations of Newton's method to a closed state.
_ITERATIONS = 30
#: Singular values below this part of the largest count as zero.
_RANK = 1e-9
#: Last change of an iteration, over the size.
_ROUNDING = 1e-14
#: Velocities of random states, in sizes of the mechanism per second.
_SPEED = 1.0
#: Number of random states of a building block that are drawn for each that is needed.
_DRAWS = 50
#: Range of random parameters off the constraints, relative to their values.
_TUNED = (0.5, 2.0)


@dataclass(frozen=True, eq=False)
class At:
    """A state: the arrays of all arguments, and a label.

    ``kind`` is ``run``, ``closed`` (random, on the constraints) or ``open`` (random, off the constraints).
    """

    kind: str
    label: str
    arrays: dict[str, Array]

    @property
    def closed(self) -> bool:
        """Whether the state satisfies the constraints."""
        return self.kind != "open"


@dataclass(frozen=True, eq=False)
class States:
    """States with remarks."""

    all: tuple[At, ...]
    notes: tuple[str, ...] = ()


def of_block(system: System, count: int, seed: int) -> States:
    """Return random arguments of a building block, all between 0.5 and 2, at which its outputs are real.

    Raises
    ------
    ModelError
        If roots or logarithms of negative numbers leave too few of them.
    """
    random, exact = np.random.default_rng(seed), Exact(system)
    names = tuple(m for e in system.exports for m in e.matrices)
    drawn = (_between(system, random) for _ in range(_DRAWS * count))
    real = (x for x in drawn if all(mpmath.im(y) == 0 for m in exact.matrices(names, x) for y in m))
    states = tuple(At("open", f"random {i}", x) for i, x in enumerate(islice(real, count), 1))
    if len(states) < count:
        raise ModelError(
            f"{system.name} is real at {len(states)} of {_DRAWS * count} states with all arguments between"
            f" 0.5 and 2, and {count} are needed: state its equations without roots of negative numbers there"
        )
    return States(states)


def of_beams(model: ElasticModel, element: str, system: System, count: int, seed: int) -> States:
    """Return the arguments of elements of one kind in elastic links, at random stations."""
    random = np.random.default_rng(seed)
    segments = [
        (b.info.link, i, s) for b in model.beams for i, s in enumerate(b.segments, 1) if s.element == element
    ]
    states = []
    for k in range(max(count, len(segments))):
        link, i, segment = segments[k % len(segments)]
        arguments = np.array(segment.arguments)
        arrays = _between(system, random) | {"q": arguments, "u": random.uniform(0, 1, 1) * arguments[0]}
        states.append(At("open", f"element {i} of {link}", arrays))
    return States(tuple(states))


def _between(system: System, random: Random) -> dict[str, Array]:
    return {g.name: random.uniform(0.5, 2.0, len(g.quantities)) for g in system.groups}


def of_linkage(model: RodModel, count: int, seed: int, run: bool) -> States:
    """Return states of a linkage: ``count`` each along its run, on and off its constraints."""
    evaluator, notes = model.evaluator, list[str]()
    if evaluator.couples:
        raise ModelError(
            f"{model.name}: exact solutions are those of linear equations, without friction of bearings"
        )
    along = list(_along(model, count if run else 1, notes))
    random = np.random.default_rng(seed)
    size, n = _size(evaluator, along[0][1]), evaluator.description.coordinates
    states = [_solved(evaluator, "run", f"run, t = {t:.4g} s", t, q, u) for t, q, u in along]
    for i in range(count):
        t, q, _ = along[random.integers(len(along))]
        pose = next(
            (p for a in _AWAY if (p := _closed(evaluator, t, q + a * size * _normal(random, n))) is not None),
            q,
        )
        u = _consistent(evaluator, t, pose, _SPEED * size * _normal(random, n))
        states.append(_solved(evaluator, "closed", f"random {i + 1}", t, pose, u))
    parameters = evaluator.parameter_values
    for i in range(count):
        t, q, _ = along[random.integers(len(along))]
        arrays = {
            "t": np.array([t]),
            "q": q + _AWAY[1] * size * _normal(random, n),
            "u": _SPEED * size * _normal(random, n),
            "p": tuned(parameters, random),
            "work": size * _normal(random, n + len(evaluator.description.constraints)),
        }
        arrays["u"][:1] = random.uniform()  # in the kernel 'assembly': position along the path, 0 to 1
        states.append(At("open", f"open {i + 1}", arrays))
    return States(tuple(states), tuple(notes))


def tuned(parameters: Array, random: Random) -> Array:
    """Return random parameters around their values, or around one if they are zero."""
    return np.where(parameters == 0, 1.0, parameters) * random.uniform(*_TUNED, len(parameters))


def _normal(random: Random, size: int) -> Array:
    return random.standard_normal(size)


def _along(model: RodModel, count: int, notes: list[str]) -> Iterator[tuple[float, Array, Array]]:
    """Yield time, coordinates and velocities at equal steps of a run, including the start."""
    state = model.initial_state()
    yield state.t, state.q, state.u
    for t in np.linspace(0.0, model.description.t_end, count)[1:]:
        try:
            if model.description.rates:
                state = model.reached(float(t), state)
                yield state.t, state.q, state.u
                continue
            final = model.simulate(float(t), samples=2, state=state).final
        except SimulationError as error:
            notes.append(f"the run ends at t = {error.time:.4g} s: {str(error).partition(chr(10))[0]}")
            return
        moving = {p: final[p] for p in model.description.free}
        state = model.state(
            {p: m["position"] for p, m in moving.items()},
            {p: m["velocity"] for p, m in moving.items()},
            float(t),
        )
        yield state.t, state.q, state.u


def _size(evaluator: Evaluator, q: Array) -> float:
    """Return the extent of the linkage [m], independent of its position."""
    if evaluator.description.size:
        return evaluator.description.size
    places = evaluator.blocks("points", 0.0, q, np.zeros_like(q))["positions"]
    return float(np.max(np.ptp(np.atleast_2d(places), axis=0)))


def _solved(evaluator: Evaluator, kind: str, label: str, t: float, q: Array, u: Array) -> At:
    """Return a state with its accelerations and multipliers."""
    size = len(q) + len(evaluator.description.constraints)
    work = evaluator("accelerations", t, q, u)[:size]
    if not np.all(np.isfinite(work)):
        work = np.ones(size)
    p = evaluator.parameter_values
    return At(kind, label, {"t": np.array([t]), "q": q, "u": u, "p": p, "work": work})


def _closed(evaluator: Evaluator, t: float, q: Array) -> Array | None:
    """Return the nearest pose that satisfies the constraints; None if there is none."""
    if not evaluator.has("constraints"):
        return q
    zero, size = np.zeros_like(q), float(np.max(np.abs(q)))
    for _ in range(_ITERATIONS):
        values = evaluator.blocks("constraints", t, q, zero)
        scale = values["constraint_scale"]
        jacobian = _jacobian(evaluator, t, q) / scale[:, None]
        step = np.linalg.lstsq(jacobian, -values["constraints"] / scale, rcond=_RANK)[0]
        q = q + step
        if not np.all(np.isfinite(q)):
            return None
        if np.max(np.abs(step)) <= _ROUNDING * size:
            return q
    return None


def _consistent(evaluator: Evaluator, t: float, q: Array, u: Array) -> Array:
    """Return the nearest velocities that satisfy the constraints."""
    if not evaluator.has("velocity_constraints"):
        return u
    rate = evaluator("velocity_constraints", t, q, u)
    return u - np.linalg.lstsq(_jacobian(evaluator, t, q), rate, rcond=_RANK)[0]


def _jacobian(evaluator: Evaluator, t: float, q: Array) -> Array:
    return evaluator("constraint_jacobian", t, q, np.zeros_like(q)).reshape(-1, len(q))
