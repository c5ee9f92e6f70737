"""Following a driven loop over values of its input."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array
from symgen.runtime.closure.assemblies import same_assembly
from symgen.runtime.closure.redundancy import component_names, note, ranges_of, undetermined
from symgen.runtime.closure.start import Closed
from symgen.runtime.kernels.loop_description import LoopDescription
from symgen.runtime.kernels.typed import build_settings
from symgen.runtime.loop.curve import walk
from symgen.runtime.loop.following import FollowedSamples, follow_over
from symgen.runtime.loop.kernels import LoopKernels, in_words
from symgen.runtime.loop.near_singular import of_blind, refine
from symgen.runtime.loop.obstacles import why_stopped
from symgen.runtime.loop.poles import OF_MOTION, PoleAt, beside_pole, poles
from symgen.runtime.result.records import Coordinate, Drift, Variable, of_model, over_time
from symgen.runtime.result.turn import Pole, Turn, variables

#: Least number of steps over a range.
PARTS = 36
#: Fractions between the scene's parameters and other values, at each of which the loop is closed.
STAGES = np.linspace(0.0, 1.0, 17)[1:]
#: Shortest range that is divided in this way [s].
LEAST_RANGE = 1e-12
#: Values beyond which following would take hours, and angles would lose their digits.
_FARTHEST = 1e6
#: Defect of closure above rounding.
_CLOSED = 1e-11
#: Components named in a note; the result lists all.
_SHOWN = 6


def follow(
    kernels: LoopKernels,
    begin: Closed,
    values: Array | None = None,
    times: Array | None = None,
    forces: bool = True,
) -> Turn:
    """Return the loop at values of its first input, or at times, followed from a closed pose on one branch.

    Without ``forces`` outputs of the motion alone are returned.

    Raises
    ------
    ModelError
        If the loop has no input, or has free variables as well.
    SimulationError
        When the loop cannot be followed to a value, naming it and the row that holds it; the error carries
        the samples reached.
    """
    d = kernels.description
    driven(d)
    over = "input" if times is None else "time"
    if times is not None:
        values = kernels.leads_at(times)[:, 0] if len(times) and np.all(np.isfinite(times)) else times
    if values is None or not len(values) or not np.all(np.isfinite(values)):
        raise ModelError(f"expected finite values of the {over}, at least one")
    if np.max(np.abs(values)) > _FARTHEST * kernels.lead_scale:
        raise ModelError(
            f"expected values of {kernels.lead.name} below {_FARTHEST:g} radians or sizes of the loop"
        )
    begun = time.perf_counter()
    times = kernels.times_of(values) if times is None else times
    equations = kernels.stepping(d.having("dependent"), begin.rank)
    order = np.argsort(times, kind="stable")
    ahead = times[order]
    first = int(np.searchsorted(ahead, begin.t))  # those before it are followed backwards
    rows = kernels.empty(len(times))
    failed, low, high = None, first, first
    for way in (slice(None, first), slice(first, None)):  # of two ends the earlier is reported
        targets = ahead[way] if way.start is not None else ahead[way][::-1].copy()
        if not len(targets):
            continue
        followed = tuple(a[way] for a in rows) if way.start is not None else kernels.empty(first)
        longest = max(abs(targets[-1] - begin.t), LEAST_RANGE) / PARTS
        q = np.append(begin.q, 0.0)  # in the end the last pose that was reached
        status, count, at = follow_over(kernels, equations, begin.t, q, targets, longest, *followed)
        if way.start is not None:
            high = first + count
        else:
            low = first - count
            for whole, part in zip(rows, followed, strict=True):
                whole[low:first] = part[:count][::-1]
        if status != _core.DONE and failed is None:
            failed = status, at, q[:-1], float(targets[min(count, len(targets) - 1)])
    indices = order[low:high]
    states, out, diagnosis = (a[low:high] for a in rows)
    if np.any(np.diff(indices) < 0):
        permutation = np.argsort(indices)
        indices, states, out, diagnosis = (
            indices[permutation],
            states[permutation],
            out[permutation],
            diagnosis[permutation],
        )
    if failed and not len(indices):
        raise SimulationError(why_stopped(kernels, equations, *failed), time=failed[1])
    turn = _recorded(
        kernels,
        begin,
        times[indices],
        states,
        out,
        diagnosis,
        values[indices],
        time.perf_counter() - begun,
        over,
        forces,
    )
    if failed:
        raise SimulationError(why_stopped(kernels, equations, *failed), time=failed[1], partial=turn)
    return turn


def follow_through(
    kernels: LoopKernels, begin: Closed, stop: float, samples: int, forces: bool = True
) -> Turn:
    """Return the loop at equal arc lengths from the closed pose, past turning points of its input.

    Turning points of the input, where rates have no bound, are omitted; the notes list them.

    Raises
    ------
    ModelError
        As :func:`follow`.
    SimulationError
        When the curve cannot be followed from its beginning.
    """
    d = kernels.description
    begun = time.perf_counter()
    times, poses, turning = walk(kernels, begin, kernels.time_of(stop), samples)
    equations = kernels.stepping(d.having("dependent"), begin.rank)
    count = len(times)
    rows = kernels.empty(count)
    selected = [
        i
        for i in range(count)
        if equations.follow(
            times[i], np.append(poses[i], 0.0), times[i : i + 1], 1.0, *(a[i : i + 1] for a in rows)
        )[0]
        == _core.DONE
    ]
    states, out, diagnosis = (a[selected] for a in rows)
    values = np.array([kernels.lead_at(t)[0] for t in times[selected]])
    wall = time.perf_counter() - begun
    turn = _recorded(kernels, begin, times[selected], states, out, diagnosis, values, wall, "input", forces)
    first = kernels.lead
    ends = ", ".join(kernels.value_at(t).partition(" = ")[2] for t in turning[:_SHOWN])
    if not turning:
        return turn
    more = ", ..." if len(turning) > _SHOWN else ""
    note = f"{first.name} reverses at {ends}{more}, where rates are unbounded"
    return replace(turn, notes=(note, *turn.notes))


def followed(kernels: LoopKernels, begin: Closed, value: float) -> Closed:
    """Return the closed pose at a value of the first input, followed from another one.

    Raises
    ------
    SimulationError
        When it cannot be followed there.
    """
    t, states = moving(kernels, begin, value)
    return Closed(t, states[: kernels.description.coordinates].copy(), begin.rank)


def moving(kernels: LoopKernels, begin: Closed, value: float) -> tuple[float, Array]:
    """Return time and state at a value of the first input; errors and state as of :func:`moving_at`."""
    t = kernels.time_of(value)
    return t, moving_at(kernels, begin, t)


def moving_at(kernels: LoopKernels, begin: Closed, t: float) -> Array:
    """Return the state at a time: variables, rates, accelerations, closing wrench.

    Raises
    ------
    SimulationError
        When it cannot be followed there.
    """
    d = kernels.description
    equations = kernels.equations(d.having("dependent"), begin.rank)
    rows, q = kernels.empty(1), np.append(begin.q, 0.0)
    longest = max(abs(t - begin.t), LEAST_RANGE) / PARTS
    status, _, at = follow_over(kernels, equations, begin.t, q, np.array([t]), longest, *rows)
    if status != _core.DONE:
        raise SimulationError(why_stopped(kernels, equations, status, at, q[:-1], t), time=at)
    return rows[0][0]


def driven(d: LoopDescription) -> None:
    """Check that inputs alone move the loop; raise ModelError otherwise."""
    if problem := not_driven(d):
        raise ModelError(f"{d.name} {problem}")


def not_driven(d: LoopDescription) -> str | None:
    """Return the reason why inputs alone do not move the loop, if any."""
    if free := [v.name for v in d.variables if v.role == "free"]:
        return (
            f"has free variables ({', '.join(free)}): its motion follows from forces\n"
            "  Run it in time ('symgen simulate SCENE', model.simulate()), or make them inputs."
        )
    return None if d.having("input") else "has no input: nothing moves. Give one under loop.inputs"


def _recorded(
    kernels: LoopKernels,
    begin: Closed,
    times: Array,
    states: Array,
    out: Array,
    diagnosis: Array,
    values: Array,
    wall: float,
    over: str,
    forces: bool,
) -> Turn:
    d = kernels.description
    equations = kernels.equations(d.having("dependent"), begin.rank)
    limits = tuple(refine(kernels, equations, begin, FollowedSamples(times, states, out, diagnosis)))
    reported: list[Pole] = []
    if forces:
        reported = [_pole(kernels, p) for p in poles(kernels, equations, times, states, diagnosis)]
    recorded = _known(kernels, equations, times, states, out, diagnosis, reported)
    blind = diagnosis[:, _loop.STATUS] == _loop.RATES_UNDETERMINED  # of those that have no limit
    ranges = {}
    if forces:
        masks = undetermined(kernels, times, states)
        for mask in masks.values():
            mask[blind] = False
        ranges = ranges_of(recorded, masks)
    else:
        info = d.kernel("outputs")
        moved = {b.name for b in info.blocks if b.unit in OF_MOTION} if info else set()
        recorded = tuple(v for v in recorded if v.name in moved)
    first = kernels.lead
    end = float(times[-1]) if len(times) else begin.t
    closure = float(np.max(diagnosis[:, _loop.CLOSURE], initial=0.0))
    rates = float(np.max(diagnosis[:, _loop.RATES], initial=0.0))
    coordinate = over_time(times)
    if over == "input":
        coordinate = Coordinate(first.name, first.unit, first.name, values)
    parameters = dict(zip((p.name for p in d.parameters), kernels.parameter_values.tolist(), strict=True))
    return Turn(
        **of_model(
            d,
            parameters,
            method="closure",
            t_end=end,
            **build_settings(kernels.library, kernels.typed),
        ),
        axes=("x", "y", "z"),
        coordinate=coordinate,
        variables=tuple(v for v in recorded if v.name != coordinate.name),
        drift=Drift(closure * d.size, rates),
        final=_final(d, states),
        statistics={
            "input": first.name,
            "t": end,
            "steps": len(times),
            "closure": closure,
            "least_singular": float(np.min(diagnosis[:, _loop.SOUNDNESS], initial=1.0)),
            "rank": begin.rank,
            "poles": [asdict(p) for p in reported],
            "undetermined": ranges,
            "wall_s": wall,
        },
        notes=(
            *_of_open(kernels, closure),
            *of_blind(kernels, times[blind]),
            *limits,
            *_notes(kernels, times, states, reported, ranges),
        ),
        times=times if over == "input" else None,
    )


def _final(d: LoopDescription, states: Array) -> dict[str, dict[str, Any]]:
    """Return value, rate and unit of every joint variable at the last sample; empty without samples."""
    if not len(states):
        return {}
    values, rates = states[-1, : 2 * d.coordinates].reshape(2, -1).tolist()
    return {
        v.name: {"value": value, "rate": rate, "unit": v.unit}
        for v, value, rate in zip(d.variables, values, rates, strict=True)
    }


def _known(
    kernels: LoopKernels,
    equations: _loop.LoopEquations,
    times: Array,
    states: Array,
    out: Array,
    diagnosis: Array,
    reported: Sequence[Pole],
) -> tuple[Variable, ...]:
    """Return the outputs, NaN at poles and where forces are undetermined."""
    d = kernels.description
    met = diagnosis[:, _loop.STATUS] == _loop.POLE
    for k in np.flatnonzero(met):
        out[k] = beside_pole(kernels, equations, float(times[k]), states[k, : d.coordinates], out[k])
    recorded = tuple(variables(d, out))
    blind = diagnosis[:, _loop.STATUS] == _loop.RATES_UNDETERMINED
    placed = {x.name for x in d.variables}
    for v in recorded:
        columns = v.values.reshape(len(times), -1)
        for i, name in enumerate(component_names(v)):
            if any(name in p.residues for p in reported):
                columns[met, i] = np.nan
        if v.name not in placed:
            v.values[blind] = np.nan
    return recorded


def _pole(kernels: LoopKernels, pole: PoleAt) -> Pole:
    """Return a pole by the value of the input, with its residues."""
    value, rate, _ = kernels.lead_at(pole.t)
    info = kernels.description.kernel("outputs")
    residues = {}
    for b in info.blocks if info else ():
        entries = np.atleast_1d(pole.residue[b.name]).ravel() * rate
        for c, x in zip(b.rows if len(entries) > 1 else ("",), entries.tolist(), strict=True):
            if x:
                residues[f"{b.name}.{c}" if c else b.name] = x
    largest = max(map(abs, residues.values()), default=0.0)
    return Pole(float(value), {k: x for k, x in residues.items() if abs(x) > 1e-12 * largest})


def _of_open(kernels: LoopKernels, closure: float) -> Iterator[str]:
    """Yield the defect of closure of a loop that closes only within its assembly tolerance."""
    d = kernels.description
    if closure > _CLOSED and d.assembly_tolerance:
        yield (
            f"the loop closes by least squares only, to {closure * d.size:.2g} m (rotations times its size, "
            f"{d.size:.4g} m), within the assembly tolerance of {d.assembly_tolerance:.2g} m"
        )


def _notes(
    kernels: LoopKernels,
    times: Array,
    states: Array,
    reported: list[Pole],
    ranges: Mapping[str, Sequence[Sequence[int]]],
) -> Iterator[str]:
    d = kernels.description
    n = d.coordinates
    first = kernels.lead
    for p in reported:
        drives = {name: x for name, x in p.residues.items() if name.endswith(".drive")} or p.residues
        names = ", ".join(f"{name} {x:.9g}" for name, x in list(drives.items())[:_SHOWN])
        yield (
            f"dead centre at {first.name} = {in_words(p.at, first.is_length, d)}: the given efforts "
            f"cannot hold the loop there, and {len(p.residues)} components have a pole, with the residue "
            f"(value times the distance of {first.name} from there, in SI) {names}"
            f"{' and others' if len(p.residues) > len(drives) else ''}"
        )
    yield from note(kernels, ranges, len(times))
    if len(times) > 1:
        inputs = states[:, kernels.inputs]
        gap = inputs[-1] - inputs[0]
        turned = np.where(kernels.periodic[kernels.inputs], (gap + np.pi) % (2 * np.pi) - np.pi, gap)
        whole = np.max(np.abs(turned)) < 1e-9 * max(1.0, d.size) and np.max(np.abs(gap)) > 1.0
        if whole and not same_assembly(kernels, float(times[0]), states[-1, :n], states[0, :n]):
            yield (
                "the inputs return to their values at the start, but the loop does not: after the revolution "
                "it is on another assembly branch"
            )
