"""Tangents of the steps of a stored run, carried forward by all directions, or back from an output.

Compiled code evaluates the stages of each step again with the slopes of the equations of motion: see
``core/variations.h``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime._variations import LinkageVariations, Variations
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.integrators import dop853
from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.integrate.options import Options
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.jumps import Jump

#: Directions at which the transposed steps of one output cost as much as the tangents of all.
_DIRECTIONS = 6
#: Number of explicit steps of which the longest is examined, and parts from which on they are divided.
_EXAMINED, _COARSE = 16, 2


@dataclass(frozen=True, slots=True)
class StoredTrajectory:
    """The states between the steps of a run.

    Attributes
    ----------
    t, y
        Times [s] (steps + 1,) and states (steps + 1, 2n).
    references
        References of angles in loads and branches of loads that jump, steps + 1 rows.
    ends
        Number of steps till each requested time.
    switches
        Number of switching points; the last columns of ``references`` are their branches.
    event
        The event at which the run ends, by its place in the description.
    passages
        Times [s] at which the constraints lose rank.
    """

    t: Array
    y: Array
    references: Array
    ends: tuple[int, ...]
    switches: int = 0
    event: int | None = None
    passages: tuple[float, ...] = ()


class StepTangents(Protocol):
    """Gives the tangents of steps of a mechanism along directions."""

    #: Units of the integrands by name.
    integrands: Mapping[str, str]
    #: Number of further directions, the state, that an implicit method needs.
    states: int

    def along(self, by: Sequence[str]) -> Variations:
        """Return the tangents of steps by parameters, and by other names on which the start alone depends."""


class LinkageSteps:
    """The tangents of steps of a linkage.

    Parameters
    ----------
    evaluator
        The kernels of the equations of motion.
    kernels
        Those of the analysis ``variation``; its outputs are the integrands.
    redundant
        Number of constraints that follow from the others.
    method
        The integrator.

    Raises
    ------
    ModelError
        For a repeated integrand; for integrands with an implicit method.
    """

    def __init__(self, evaluator: Evaluator, kernels: Evaluator, redundant: int, method: Integrator) -> None:
        self._kernels, self._method = kernels, of_tangents(method)
        self._equations = evaluator.equations(redundant, work_of_loads=False)
        blocks = kernels.info("integrands").blocks if kernels.has("integrands") else ()
        names = [b.about for b in blocks]
        if repeated := next((name for name in names if names.count(name) > 1), None):
            raise ModelError(f"the integral of {repeated} is given twice\n  Name each integrand once.")
        self.integrands: Mapping[str, str] = {b.about: b.unit for b in blocks}
        self.states = 0 if self._method.kind == "explicit" else 2 * evaluator.description.coordinates
        if self.states and names:
            raise ModelError(f"expected an explicit method for integrals, got {method.name}")

    def along(self, by: Sequence[str]) -> Variations:
        """Return the tangents of steps by parameters, and by other names on which the start alone depends."""
        entries = _places(self._kernels, [*self.integrands], by)
        return LinkageVariations(self._equations, self._method, self._kernels, entries, len(by) + self.states)


def _places(kernels: Evaluator, integrands: Sequence[str], by: Sequence[str]) -> list[NDArray[np.int_]]:
    """Return row, column and place of the slopes of residual, Phi, dPhi/dt and integrands."""
    d = kernels.description
    bound = [f"{c}_lambda" for c in d.constraints]
    unknowns = [*d.of_coordinates("a"), *bound]
    known = [*d.of_coordinates(), *d.of_coordinates("v"), *unknowns]
    columns = [*known, *("" if name in known else name for name in by)]  # a start value may have that name
    rows = {"residual": unknowns, "constraints": bound, "rates": bound, "outputs": integrands}
    entries: dict[str, list[tuple[int, int, int]]] = {name: [] for name in rows}
    for kernel in ("stage", "closing", "integrand_slopes"):
        for block in kernels.info(kernel).blocks if kernels.has(kernel) else ():
            entries[block.name] += block.places(rows[block.name], columns, partly=True)
    return [np.array(each, dtype=np.int_).reshape(-1, 3) for each in entries.values()]


def _slices(path: StoredTrajectory, first: int, last: int) -> tuple[Array, Array, Array]:
    return path.t[first : last + 1], path.y[first : last + 1], path.references[first : last + 1]


def _check(status: int, count: int, t: Array) -> None:
    if status != _core.DONE:
        at = float(t[min(count, len(t) - 1)])
        cause = (
            "the constraints lose rank"
            if status == _core.SINGULAR
            else "a number that is not finite appeared"
        )
        raise SimulationError(f"no derivatives of the run from t = {at:.9g} s on: {cause}", time=at)


def of_tangents(method: Integrator) -> Integrator:
    """Return the method of the tangents of steps: for power series, an explicit one."""
    return dop853.METHOD if method.kind == "taylor" else method


def resolved(path: StoredTrajectory, steps: StepTangents, chosen: Options) -> StoredTrajectory:
    """Return a path whose steps the explicit tangents resolve: longer ones are divided into equal parts.

    Steps of power series are long. Steps of explicit methods follow the motion, and are too long for motions
    about it where it is at rest or uniform.

    Raises
    ------
    SimulationError
        For more parts than the steps that the run may take.
    """
    lengths = np.diff(path.t)
    if steps.states or not chosen.rtol or not len(lengths):
        return path
    series = chosen.method.kind == "taylor"
    every = 1 if series else _EXAMINED
    rows = np.pad(lengths, (0, -len(lengths) % every)).reshape(-1, every)
    examined = np.argmax(rows, axis=1) + every * np.arange(len(rows))
    found = np.zeros(len(path.t))
    found[examined] = 1.0
    one = steps.along([""])
    _check(*one.parts(path.t, path.y, path.references, chosen.rtol, chosen.atol, found), path.t)
    rates = np.divide(found[examined], lengths[examined], where=found[examined] > 0, out=0 * found[examined])
    parts = np.repeat(rates, every)[: len(lengths)] * lengths
    parts = np.ceil(np.where(parts < (1 if series else _COARSE), 1, parts))
    if np.sum(parts) > chosen.max_steps:
        at = float(path.t[np.argmax(parts)])
        raise SimulationError(
            f"derivatives of the run take {np.sum(parts):.3g} steps, more than max_steps = "
            f"{chosen.max_steps}: the motion near the run is fastest at t = {at:.9g} s",
            time=at,
        )
    if not np.any(parts > 1):
        return path
    known = np.concatenate([[0], np.cumsum(parts.astype(int))])
    y = np.zeros((known[-1] + 1, path.y.shape[1]))
    y[known] = path.y
    t = np.interp(np.arange(len(y)), known, path.t)
    references = np.repeat(path.references, [*np.diff(known), 1], axis=0)
    one.fill(t, y, references, np.isin(np.arange(len(y)), known).astype(np.int8))
    return replace(path, t=t, y=y, references=references, ends=tuple(known[[*path.ends]].tolist()))


def fewer(outputs: int, directions: int) -> bool:
    """Return whether transposed steps, one after the other for each output, cost less than all tangents."""
    return outputs * _DIRECTIONS < directions


def carried_forward(
    path: StoredTrajectory, along: Variations, first: Array, integrals: int = 0, jumps: Sequence[Jump] = ()
) -> tuple[list[tuple[Array, Array]], Array]:
    """Return derivatives of state and integrals by all directions, and the integrals, at all ends."""
    count = first.shape[1]
    moved, summed = np.zeros((len(first), along.columns)), np.zeros((integrals, along.columns))
    moved[:, :count] = first
    begin, tangents, sums = 0, [], []

    def go(begin: int, end: int) -> None:
        part = _slices(path, begin, end)
        _check(*along.forward(*part, moved, summed), part[0])

    for end in path.ends if count or integrals else ():
        for jump in [each for each in jumps if begin < each.step <= end]:
            if begin < jump.step:  # several may be at one step
                go(begin, jump.step)
                begin = jump.step
            moved[:, :count] += np.outer(jump.change, jump.by_state @ moved[:, :count] + jump.direct)
        go(begin, end)
        tangents.append((moved[:, :count].copy(), summed[:, :count].copy()))
        sums.append(along.sums)
        begin = end
    return tangents, np.reshape(sums, (len(path.ends), integrals))


def carried_back(
    path: StoredTrajectory,
    along: Variations,
    slopes: Sequence[tuple[Array, Array]],
    integrals: int,
    first: Array,
    jumps: Sequence[Jump] = (),
) -> list[Array]:
    """Return derivatives of outputs and integrals at all ends from transposed steps, each output by itself.

    ``slopes`` are those of outputs at each end by the state, and by the directions at a held state.
    """
    gradients = []
    for end, (by_state, direct) in zip(path.ends, slopes, strict=True):
        passed = [jump for jump in jumps if jump.step <= end]
        rows = []
        for seeds in _seeds(by_state, direct, integrals):
            (seed, weights, gradient), last = seeds, end
            for jump in (*reversed(passed), None):
                part = _slices(path, jump.step if jump else 0, last)
                _check(*along.backward(*part, seed, weights, gradient), part[0][::-1])
                if jump:
                    weight, last = seed @ jump.change, jump.step
                    seed[:] += weight * jump.by_state
                    gradient[:] += weight * jump.direct
            rows.append(gradient + seed @ first)
        gradients.append(np.array(rows))
    return gradients


def _seeds(by_state: Array, direct: Array, integrals: int) -> Iterator[tuple[Array, Array, Array]]:
    """Yield seed of the last state, weights of the integrals, and the gradient at a held state."""
    for row, gradient in zip(by_state, direct, strict=True):
        yield row.copy(), np.zeros(integrals), gradient.copy()
    for weights in np.eye(integrals):
        yield np.zeros(by_state.shape[1]), weights, np.zeros(direct.shape[1])
