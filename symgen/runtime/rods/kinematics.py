"""Kinematic analysis: positions, velocities and accelerations over a range of the drives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from symgen.errors import ModelError, OptionsError, SimulationError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.integrate.causes import MORE_DRIVES
from symgen.runtime.model.instants import Instants
from symgen.runtime.result.findings import SingularPose
from symgen.runtime.result.motion import Motion, Range
from symgen.runtime.result.recording import nearest_turn, references_of
from symgen.runtime.result.records import converters
from symgen.runtime.result.state import State
from symgen.runtime.rods.assemblies import assemblies
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.following.branch import along_branch
from symgen.runtime.rods.following.continuation import LONGEST, Curve, CurvePoint
from symgen.runtime.rods.following.jumps import check_drives
from symgen.runtime.rods.following.singular import TURNING, monotone, singular_poses
from symgen.runtime.rods.meshing import slips
from symgen.runtime.rods.poses import Poses, angles_in_loads, counted
from symgen.runtime.rods.recorded_motion import CurvePositions, Followed, chosen_names, recorded

#: Largest number of steps along the curve of poses.
MOST_STEPS = 1_000_000
#: Times at which each gap of the range is searched for other assemblies.
_PROBES = 5
#: Singular values below this part of the largest count as zero.
_RANK_TOLERANCE = 1e-9


def driven(constraints: Constraints, q: Array, t: float) -> None:
    """Check that the drives determine the motion.

    Raises
    ------
    ModelError
        If there are fewer drives than degrees of freedom; it gives the number of missing ones.
    """
    values = np.linalg.svd(constraints.jacobian(q, t), compute_uv=False)
    rank = int(np.count_nonzero(values > _RANK_TOLERANCE * values.max(initial=0.0)))
    missing = constraints.n - rank
    names = list(constraints.drives(t))
    if (missing and constraints.n > constraints.m) or not names:
        if not missing:
            raise ModelError(
                f"{constraints.description.name} has no drive and no degree of freedom: it cannot move"
            )
        freedoms = missing + len(names)
        have = f"{_count(len(names), 'drive')} ({', '.join(names)})" if names else "no drive"
        raise ModelError(
            f"{constraints.description.name} has {_count(freedoms, 'degree')} of freedom and {have}: a "
            f"kinematic analysis needs {_count(missing, 'more drive')}\n"
            f"  {MORE_DRIVES}"
        )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def analyse(
    constraints: Constraints, begin: State, instants: Instants, through: bool, of: Sequence[str] | None
) -> Motion:
    """Follow the linkage from a state over a range, and return its motion.

    Raises
    ------
    ModelError, SimulationError
        As :func:`follow` does, for an unknown name, and when no time of the range is reached, or not a time
        that was given.
    """
    began, chosen, shown = (
        perf_counter(),
        chosen_names(constraints, of),
        converters(constraints.description.units),
    )
    if not 2 <= instants.samples <= 1_000_000:
        raise ModelError(f"expected between 2 and 1 million points, got {instants.samples}")
    if through and instants.at is not None:
        raise OptionsError("give {at} or {through}, not both: values are evaluated on one assembly branch")
    q, t = begin.q, begin.t
    driven(constraints, q, t)
    times = instants.times(constraints.description.name, constraints.driving)
    followed = follow(constraints, q, t, instants, times, through)
    if not len(followed.samples):
        where = "; ".join(p.describe(shown) for p in followed.poses)
        raise SimulationError(
            f"the linkage does not get from t = {t:g} s to the range {instants.start:g} s to "
            f"{instants.stop:g} s"
            f"{f': {where}' if where else ''}\n  Choose another range, or another assembly to start from."
        )
    samples, near = followed.samples, followed.near
    if constraints.description.scene_outputs:
        samples = with_references(constraints, followed, begin)
    if instants.at is not None:
        order = order_of(followed, times, shown)
        samples, near = samples[order], near[order]
    return recorded(
        constraints,
        samples,
        CurvePositions(constraints.description, constraints.moving(followed.path)[0], near, followed.start),
        followed,
        chosen,
        instants.stop,
        instants.over if instants.at is not None else "time",
        began,
    )


def order_of(followed: Followed, times: Array, shown: Mapping[str, tuple[str, float]]) -> Indices:
    """Return the samples at given times, in their order; raise SimulationError if one is missing."""
    places = {t: i for i, t in enumerate(followed.samples.times.tolist())}
    for t in times.tolist():
        if t not in places:
            where = "; ".join(p.describe(shown) for p in followed.poses)
            raise SimulationError(
                f"the linkage does not reach t = {t:.9g} s{f': {where}' if where else ''}", time=t
            )
    return np.array([places[t] for t in times.tolist()], dtype=np.intp)


def follow(
    constraints: Constraints, q: Array, t: float, instants: Instants, times: Array, through: bool = False
) -> Followed:
    """Follow the linkage from the pose q at the time t over a range, and sample it at times in it.

    With ``through`` the curve continues past turning points, otherwise it ends there. Instants may
    ``spread`` as many times over the part of the range that is reached.

    Raises
    ------
    ModelError
        For a range that is none, or missing drives.
    SimulationError
        When the curve cannot be followed, naming the time; where a prescribed motion or its rate jumps.
    """
    if not (
        math.isfinite(instants.start) and math.isfinite(instants.stop) and instants.start < instants.stop
    ):
        raise ModelError(
            f"expected a range of time with start before stop, got {instants.start:g} to {instants.stop:g} s"
        )
    driven(constraints, q, t)
    curve = Curve(constraints, constraints.length(q), _duration(constraints, q, t, instants))
    reach = MOST_STEPS * LONGEST * curve.duration
    if instants.stop - instants.start > reach:
        raise ModelError(
            f"expected a range of at most {reach:.3g} s, {MOST_STEPS} steps at the speed of the drives, got "
            f"{instants.start:g} to {instants.stop:g} s"
        )
    ends = min(instants.start, t), max(instants.stop, t)
    check_drives(constraints, q, *ends)
    sound = along_branch(constraints, q, t, *ends, np.unique(times))
    if sound is not None and not slips(constraints, sound.poses):
        samples = sound.poses[sound.requested]
        start = int(np.searchsorted(sound.poses.times, t))
        return Followed(samples, sound.requested, sound.poses, start, [], [], [])
    path, start = _path(curve, q, t, instants, through)
    poses = singular_poses(curve, path, instants.start, instants.stop)
    covered = [_span(curve, part) for part in monotone(path)]
    if instants.spread:
        times = _spread(covered, instants)
    rows: list[tuple[float, Array, Array, Array]] = []
    near: list[int] = []
    begin = 0
    for part in monotone(path):
        sampled = _sampled(curve, part, times, poses)
        rows += [row for row, _ in sampled]
        near += [begin + i for _, i in sampled]
        begin += len(part) - 1
    others, apart = _elsewhere(curve, q, instants, covered)
    poses += others
    passed = [(t, q, np.zeros_like(q), np.zeros_like(q)) for q, t in (curve.split(p.x) for p in path)]
    nearest = np.array(near, dtype=np.intp)
    gaps = _gaps([*covered, *apart], instants)
    along = _poses(passed, constraints.n)
    if slips(constraints, along):
        raise SimulationError(
            "gears jump a tooth from one pose to the next: their teeth are too many for its steps\n"
            "  Write numbers of teeth with a common factor, or smaller ones of about the same ratio."
        )
    return Followed(_poses(rows, constraints.n), nearest, along, start, poses, gaps, apart)


def with_references(constraints: Constraints, followed: Followed, begin: State) -> Poses:
    """Return the samples with the references of angles in loads, counted over revolutions from a state."""
    if not constraints.description.windings:
        return followed.samples
    evaluator, samples = constraints.evaluator, followed.samples
    whole = counted(evaluator, followed.path, followed.start, begin.references)[:, followed.near]
    references = references_of(nearest_turn(angles_in_loads(evaluator, samples), whole))
    return replace(samples, references=references.T)


def _poses(rows: Sequence[tuple[float, Array, Array, Array]], n: int) -> Poses:
    states = np.array([row[1:] for row in rows]).reshape(len(rows), 3, n)
    return Poses(np.array([row[0] for row in rows]), states)


def _duration(constraints: Constraints, q: Array, t: float, instants: Instants) -> float:
    """Return about the time in which the drives move by the linkage's size, at most about the range.

    Points of the linkage would do as well, but next to a dead centre they are as fast as one likes. A power
    of two divides times without rounding, so that the curve starts exactly at t.
    """
    whole = max(instants.stop, t) - min(instants.start, t)
    fastest = float(np.max(np.abs(constraints.drift(q, t)), initial=0.0))
    return 2.0 ** round(math.log2(min(whole, constraints.length(q) / fastest) if fastest > 0 else whole))


def _path(
    curve: Curve[Constraints], q: Array, t: float, instants: Instants, through: bool
) -> tuple[list[CurvePoint], int]:
    """Return the curve through the start, from low to high times unless it has turning points.

    The number is that of the start.
    """
    x = curve.at(curve.join(q, t))
    if x is None:
        raise SimulationError(f"the pose to start from does not meet the constraints at t = {t:g} s", time=t)
    ends = min(instants.start, t), max(instants.stop, t)
    forward = curve.walk(curve.point(x), ends, through, MOST_STEPS)
    if forward[-1] is forward[0] and len(forward) > 1:
        return forward, 0
    if forward[-1].speed > TURNING and forward[-1].x[-1] < ends[1] / curve.duration:
        raise _stuck(curve, forward[-1])
    if instants.start >= t:
        return forward, 0
    back = curve.walk(curve.point(x, np.append(np.zeros(len(q)), -1.0)), ends, through, MOST_STEPS)
    if back[-1].speed < -TURNING and back[-1].x[-1] > ends[0] / curve.duration:
        raise _stuck(curve, back[-1])
    turned = [CurvePoint(p.x, -p.tangent, p.soundness) for p in reversed(back[1:])]
    return turned + forward, len(turned)


def _stuck(curve: Curve[Constraints], last: CurvePoint) -> SimulationError:
    t = curve.split(last.x)[1]
    return SimulationError(
        f"the curve of poses cannot be followed beyond t = {t:.9g} s (least singular value "
        f"{last.soundness:.1e} of the largest there)\n  Look for a jump or a kink in a drive at this time.",
        time=t,
    )


def _rates(curve: Curve[Constraints], q: Array, t: float) -> tuple[Array, Array, float]:
    """Return velocities, accelerations and the soundness of dPhi/dq at a pose."""
    constraints = curve.constraints
    left, values, right = np.linalg.svd(constraints.jacobian(q, t), full_matrices=False)
    sound = float(values[-1] / values[0])
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=values > 1e-14 * values[0])

    def solve(rhs: Array) -> Array:
        return right.T @ (inverse * (left.T @ rhs))

    u = solve(-constraints.drift(q, t))
    return u, solve(constraints.gamma(q, u, t)), sound


def _sampled(
    curve: Curve[Constraints], part: list[CurvePoint], grid: Array, poses: list[SingularPose]
) -> list[tuple[tuple[float, Array, Array, Array], int]]:
    """Return the samples at the grid's times along one monotone piece, each with the point next to it."""
    times = np.array([p.x[-1] for p in part]) * curve.duration
    falling = times[-1] < times[0]
    low, high = min(times[0], times[-1]), max(times[0], times[-1])
    inside = grid[(grid >= low) & (grid <= high)]
    rows = []
    for t in inside[::-1] if falling else inside:
        i = int(np.searchsorted(-times if falling else times, -t if falling else t))
        i = min(max(i, 1), len(part) - 1)
        row = _near_crossing(curve, part, float(t), poses) or _sample(curve, part[i - 1], part[i], float(t))
        if row is not None:
            rows.append((row, i if abs(times[i] - t) < abs(times[i - 1] - t) else i - 1))
    return rows


def _sample(
    curve: Curve[Constraints], a: CurvePoint, b: CurvePoint, t: float
) -> tuple[float, Array, Array, Array] | None:
    point = curve.at_time(a, b, t)
    if point is None:
        return None
    q = curve.split(point.x)[0]
    u, acceleration, sound = _rates(curve, q, t)
    return (t, q, u, acceleration) if sound > _RANK_TOLERANCE else None


def _near_crossing(
    curve: Curve[Constraints], part: list[CurvePoint], t: float, poses: list[SingularPose]
) -> tuple[float, Array, Array, Array] | None:
    """Return the limit along the smooth branch where a bifurcation makes the rates undetermined.

    It is the value at t of the polynomial through eight neighbours, four on either side of the bifurcation.
    """
    width = 0.02 * curve.duration
    for pose in poses:
        if pose.kind != "bifurcation" or abs(pose.t - t) > 1e-3 * width:
            continue
        nodes = pose.t + width * np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
        times = np.array([p.x[-1] for p in part]) * curve.duration
        order = np.argsort(times)
        if times[order[0]] > nodes[0] or times[order[-1]] < nodes[-1]:
            # The range ends at the crossing: take the neighbours from one side only.
            side = 1.0 if times[order[0]] > nodes[0] else -1.0
            nodes = pose.t + side * width * np.arange(1.0, 9.0)
            if times[order[0]] > nodes.min() or times[order[-1]] < nodes.max():
                return None
        rows = []
        for node in nodes:
            i = int(np.clip(np.searchsorted(times[order], node), 1, len(part) - 1))
            k = sorted((order[i - 1], order[i]))
            row = _sample(curve, part[k[0]], part[k[1]], float(node))
            if row is None:
                return None
            rows.append(np.concatenate(row[1:]))
        weights = [
            math.prod((t - other) / (node - other) for other in nodes if other != node) for node in nodes
        ]
        q, u, acceleration = np.split(np.array(weights) @ np.array(rows), 3)
        return t, q, u, acceleration
    return None


def _elsewhere(
    curve: Curve[Constraints], q: Array, instants: Instants, covered: list[Range]
) -> tuple[list[SingularPose], list[Range]]:
    """Look for assemblies in the times not covered; return their dead centres and ranges."""
    poses: list[SingularPose] = []
    apart: list[Range] = []
    for low, high in _gaps(covered, instants):
        for t in low + (high - low) * (np.arange(_PROBES) + 0.5) / _PROBES:
            if any(a <= t <= b for a, b in apart) or not np.isfinite(curve.constraints.residual(q, t)).all():
                continue
            others, _ = assemblies(curve.constraints, q, float(t), tries=8)
            if not others:
                continue
            start = curve.at(curve.join(others[0], float(t)))
            if start is None:
                continue
            ways = [np.append(np.zeros(len(q)), s) for s in (1.0, -1.0)]
            ends = [
                curve.walk(curve.point(start, w), (instants.start, instants.stop), False, MOST_STEPS)
                for w in ways
            ]
            path = [CurvePoint(p.x, -p.tangent, p.soundness) for p in reversed(ends[1][1:])] + ends[0]
            poses += singular_poses(curve, path, instants.start, instants.stop)
            times = [p.x[-1] * curve.duration for p in path]
            apart.append((float(max(min(times), instants.start)), float(min(max(times), instants.stop))))
    return poses, apart


def _span(curve: Curve[Constraints], part: list[CurvePoint]) -> Range:
    ends = sorted(float(p.x[-1] * curve.duration) for p in (part[0], part[-1]))
    return ends[0], ends[1]


def _spread(covered: list[Range], instants: Instants) -> Array:
    """Return equally spaced times in the reached part of a range, without dead centres at its ends."""
    start = max(min(low for low, _ in covered), instants.start)
    stop = max(min(max(high for _, high in covered), instants.stop), start)
    before, after = int(start > instants.start), int(stop < instants.stop)
    return np.linspace(start, stop, instants.samples + before + after)[before : instants.samples + before]


def _gaps(covered: list[Range], instants: Instants) -> list[Range]:
    gaps, at = [], instants.start
    for low, high in sorted(covered):
        if low > at:
            gaps.append((float(at), float(min(low, instants.stop))))
        at = max(at, high)
    if at < instants.stop:
        gaps.append((float(at), instants.stop))
    return gaps
