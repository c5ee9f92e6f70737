"""Static equilibrium: forces and constraint forces in balance, at rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from symgen.errors import InitialStateError, ModelError, SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.switching import notes_on_switches
from symgen.runtime.result.equilibrium import Equilibrium, Linearised
from symgen.runtime.result.state import reactions_at, state_at
from symgen.runtime.rods.assemblies import polished
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.linear import Statics
from symgen.runtime.rods.start import Start

#: Most steps to an equilibrium.
_STEPS = 500
#: Distance from the start, over the size, beyond which there is none.
_AWAY = 1e4
#: Length of the first step over the shortest time of the motion, and of the others over the time before.
_FIRST, _GROWTH = 0.05, 0.2
#: Most steps: each is longer by a fifth.
_LONGER = 250
#: Change of a step over the size of the state that ends them.
_SETTLED = 1e-10
#: First words of notes on the equilibrium in which runs start.
_AT_START = "the equilibrium at the start"


def _in_motion(d: Description, name: str, when: str) -> str:
    """Return that there is no equilibrium, since a ground point or a drive moves; ``when`` has a verb."""
    if name in d.ground:
        label, remedy = f"the ground point {name}", f"Omit points.{name}.motion"
    else:
        row = d.constraints.index(name)
        label, remedy = d.labels[row], f"Give {d.place(row)}.length a constant value"
        if row in d.drives:
            keys = f'{d.place(row)}.angle="30 deg"'
            if d.place(row) == "crank":
                prescribed = d.elastic and d.elastic.prescribed
                keys = ('crank.angle="30 deg" --set ' if prescribed else "") + 'crank.speed="0 rpm"'
            remedy = f"Give the drive a constant value, such as --set {keys}"
    return (
        f"there is no equilibrium while a drive is in motion: {label} {when}\n"
        f"  {remedy}, or compute kinematics or the motion."
    )


def never_rests(evaluator: Evaluator, left_out: str = "") -> str | None:
    """Return why a linkage has no equilibrium: a drive or ground point moves at constant velocity.

    None where all others may rest at some time. ``left_out`` is a link whose drive does not count.
    """
    d = evaluator.description
    q, rest = np.array(d.start[: d.coordinates]), np.zeros(d.coordinates)
    rates = evaluator.blocks("points", 0.0, q, rest)["velocities"]
    moving = [p for p in d.ground if p in d.steady and np.any(rates[d.points.index(p)])]
    if d.constraints:
        drift = np.ravel(evaluator.blocks("velocity_constraints", 0.0, q, rest)["velocity_constraints"])
        rows = zip(d.constraints, drift, strict=True)
        moving += [name for name, x in rows if x and name in d.steady and name != f"{left_out}_drive"]
    return _in_motion(d, moving[0], "moves at all times") if moving else None


def resting(model: Any, begun: Start) -> Start:
    """Return the start in the equilibrium that is reached from another one, with drives and loads at t = 0.

    Drives may accelerate there.

    Raises
    ------
    InitialStateError
        When there is none, or none is found.
    """
    d, reason = model.description, model._refused("equilibrium")
    if not (reason or d.freedom or d.states):
        reason = "nothing is free to find an equilibrium: constraints and drives hold every freedom"
    try:
        if reason:
            raise ModelError(reason)
        constraints = model.constraints()
        at_rest(constraints, begun.q, 0.0, drives=True, ground=True)
        statics = Statics(constraints, model.analysis("statics"), 0.0, None)
        rest = describe(statics, *find(statics, statics.pose(begun.q, begun.u), True))
    except (ModelError, SimulationError) as error:
        raise InitialStateError(
            f"start.equilibrium: {error}\n  Without this key, runs start as drawn.",
            where="start.equilibrium",
        ) from None
    return replace(begun, q=rest.state.q, u=rest.state.u, rest=rest)


def remarks(rest: Equilibrium | None) -> Iterator[str]:
    """Yield the notes on the equilibrium in which runs start."""
    yield from (f"{_AT_START}: {note}" for note in (rest.notes if rest else ()))
    if rest and rest.stability == "unstable":
        yield f"{_AT_START} is unstable: rounding alone leads away from it"


def at_rest(
    constraints: Constraints, q: Array, t: float, *, drives: bool = False, ground: bool = False
) -> None:
    """Check that no drive and no ground point is in motion at the time t.

    ``drives`` and ``ground`` may accelerate. A pose of balance is that of their values; accelerations of
    drives are no part of its forces, but those of ground points are part of its reactions.

    Raises
    ------
    ModelError
        Naming what moves.
    """
    d, rest = constraints.description, np.zeros(constraints.n)
    moving: dict[str, bool] = {}  # or accelerating
    for name, rate, second in zip(
        d.constraints, constraints.drift(q, t), constraints.gamma(q, rest, t), strict=True
    ):
        if rate != 0.0 or (second != 0.0 and not drives):
            moving[name] = rate != 0.0
    rates = constraints.evaluator.blocks("points", t, q, rest)["velocities"]
    work = np.zeros(constraints.evaluator.work_size + constraints.n + constraints.m + 1)
    second = constraints.evaluator.blocks("point_accelerations", t, q, rest, work)["point_accelerations"]
    for i, name in enumerate(d.points):
        if name in d.ground and (np.any(rates[i]) or (np.any(second[i]) and not ground)):
            moving = {name: bool(np.any(rates[i])), **moving}
    for name, moves in moving.items():
        raise ModelError(_in_motion(d, name, f"{'moves' if moves else 'accelerates'} at t = {t:g} s"))


def find(statics: Statics, q: Array, stable: bool) -> tuple[Array, Linearised]:
    """Return the pose of an equilibrium and the equations linearised there.

    With ``stable`` the linkage is led downhill, by steps within a trust region that use the full second
    derivative, the constraint forces' part included; the measure of a step is the work that the forces do
    along it, so forces without potential are allowed. Steps are measured in a metric that depends neither on
    the axes nor on the points that carry a body. Otherwise Newton's method with damping leads to an
    equilibrium of any kind near the start; where the unbalanced force has a least value other than zero on
    its path, the linkage is led downhill as well. A start that is in equilibrium already is handed back.
    With first-order states it is a rest near the motion from the start.

    Raises
    ------
    SimulationError
        When none is found; it names the points with unbalanced forces, and these forces.
    """
    if statics.constraints.description.states:
        return _search(statics, _settled(statics, q), False)
    if not stable:
        references = statics.references
        try:
            return _search(statics, q, stable)
        except (ModelError, SimulationError):
            statics.hold(references)
    return _search(statics, q, True)


def _settled(statics: Statics, pose: Array) -> Array:
    """Return a pose near the rest to which controllers and motors lead from rest at a pose.

    Steps are short at first, so that signals leave their limits as in the motion, and end as those of
    Newton's method (pseudo-transient continuation: C. T. Kelley and D. E. Keyes, SIAM J. Numer. Anal. 35,
    1998). ``pose`` and the result have the states in the place of their integrals.
    """
    rates, time, cut = statics.rates(pose), 0.0, 1.0
    for _ in range(_LONGER):
        at = statics.at(pose, in_motion=True)
        # Rates on the motions that the constraints leave at this pose.
        rates = at.basis @ (at.basis.T @ statics.root @ (statics.root.T @ rates))
        inverse = np.linalg.inv(at.mass)
        quickest = np.linalg.norm(inverse @ at.damping) + np.sqrt(np.linalg.norm(inverse @ at.stiffness))
        step = cut * (_GROWTH * time + _FIRST / max(quickest, 1e-100))
        whole = statics.matrix("stiffness", pose, at.multipliers)
        force = at.basis.T @ (statics.force(pose, rates) - step * whole @ rates)
        matrix = at.mass / step + at.damping + step * at.stiffness
        new = rates + at.basis @ np.linalg.lstsq(matrix, force, rcond=None)[0]
        there = polished(statics.constraints, statics.pose(pose + step * new, new), statics.t, statics.root)
        if there is None or not np.isfinite(there).all() or statics.revolves(pose, there):
            cut /= 4
            continue
        change = np.max(np.abs(there - pose), initial=0.0)
        statics.count(there)
        pose, rates, time, cut = there, new, time + step, min(1.0, 2 * cut)
        if change <= _SETTLED * np.max(np.abs(pose), initial=0.0) and step * quickest > 1.0:
            break
    return pose


def _search(statics: Statics, q: Array, stable: bool) -> tuple[Array, Linearised]:
    """Return what one of the two methods of :func:`find` leads to, or raise its errors."""
    constraints = statics.constraints
    length = constraints.length(q)
    here = polished(constraints, q, statics.t, statics.root)
    if here is None:
        raise SimulationError(
            f"the pose to start from cannot be assembled at t = {statics.t:g} s\n  Start from another pose."
        )
    statics.count(here)
    radius, best, idle = 0.1 * length, statics.at(here), 0
    for _ in range(_STEPS):
        slope = -best.basis.T @ statics.force(here)
        left = float(np.max(np.abs(slope), initial=0.0))
        if left <= best.noise or (idle >= 3 and left <= _balanced(best)):
            return here, best
        step = _step(best, slope, radius, stable)
        there = polished(constraints, here + best.basis @ step, statics.t, statics.root)
        if there is None or statics.measured(there - here) > 4 * radius or statics.revolves(here, there):
            radius /= 4
            idle += radius < 1e-14 * length
            if radius < 1e-15 * length:
                break
            continue
        new = statics.at(there)
        fallen = float(0.5 * (statics.force(here) + statics.force(there)) @ (there - here))
        promised = -float(slope @ step + 0.5 * step @ best.stiffness @ step)
        gain = float(np.linalg.norm(slope) - np.linalg.norm(new.basis.T @ statics.force(there)))
        small = np.linalg.norm(step) < 1e-4 * length
        good = gain > 0 if small or not stable else fallen > 0.05 * promised
        idle = 0 if good and gain > 0.1 * np.linalg.norm(slope) else idle + 1
        if good:
            full = np.linalg.norm(step) > 0.8 * radius
            wide = (fallen > 0.5 * promised) if stable else gain > 0
            radius = 2 * radius if full and wide else radius
            statics.count(there)
            here, best = there, new
        else:
            radius = 0.25 * float(np.linalg.norm(step))
        if statics.measured(here - q) > _AWAY * length or radius < 1e-15 * length:
            break
    left = float(np.max(np.abs(best.basis.T @ statics.force(here)), initial=0.0))
    if left <= _balanced(best):
        return here, best
    raise _none(statics, here, best, statics.measured(here - q) > _AWAY * length)


def _balanced(linearised: Linearised) -> float:
    """Return the residual that is accepted where steps no longer reduce it [N]."""
    return max(100 * linearised.noise, 1e-10 * linearised.scale)


def _step(at: Linearised, slope: Array, radius: float, stable: bool) -> Array:
    """Return the step of a trust region: downhill, or towards the nearest root of the slope.

    No step follows a slope that is round-off: where stiffness vanishes as well, it would go anywhere.
    """
    stiffness = at.stiffness
    if not stable:
        step = np.asarray(-np.linalg.lstsq(stiffness, slope, rcond=1e-12)[0], dtype=float)
        size = float(np.linalg.norm(step))
        if size <= radius:
            return step
        values, vectors = np.linalg.eigh(stiffness.T @ stiffness)
        slope = stiffness.T @ slope
    else:
        values, vectors = np.linalg.eigh((stiffness + stiffness.T) / 2)
        along = vectors.T @ slope
        slope = vectors @ np.where(np.abs(along) <= at.noise, 0.0, along)
        if values[0] > 1e-12 * values[-1]:
            step = np.asarray(-np.linalg.solve(stiffness, slope), dtype=float)
            if np.linalg.norm(step) <= radius:
                return step
    along = vectors.T @ slope
    floor = 1e-14 * float(np.max(np.abs(values))) + 1e-10 * float(np.linalg.norm(slope)) / radius
    low, high = (
        max(0.0, -float(values[0])) + floor,
        float(np.linalg.norm(slope)) / radius + abs(float(values[0])),
    )
    high = max(high, 2 * low)

    def of(shift: float) -> Array:
        return -along / (values + shift)

    if np.linalg.norm(of(low)) > radius:
        for _ in range(200):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if np.linalg.norm(of(middle)) > radius else (low, middle)
            if high - low <= 1e-3 * high:
                break
        return vectors @ of(high)
    reached = of(low)
    if values[0] < 0:  # downhill to both sides: leave by the lowest direction as far as the region goes
        size = float(np.sqrt(max(radius**2 - float(reached @ reached), 0.0)))
        sign = 1.0 if along[0] <= 0 else -1.0
        reached = reached + sign * size * np.eye(len(values))[0]
    return vectors @ reached


def _torque(statics: Statics, q: Array, best: Linearised) -> str:
    """Return the unbalanced force as a torque on a link of the ground, if planar and of one freedom."""
    d = statics.constraints.description
    if best.freedoms != 1 or len(d.axes) != 2 or d.rates:
        return ""
    motion = best.basis[:, 0]
    points = statics.evaluator.blocks("points", statics.t, q, motion)
    torques = []
    for link, (first, second, *_) in d.links.items():
        ends = [d.points.index(first), d.points.index(second)]
        (along,), (moved,) = (np.diff(points[name][ends], axis=0) for name in ("positions", "velocities"))
        rate = (along[0] * moved[1] - along[1] * moved[0]) / (along @ along)
        if {first, second}.intersection(d.ground) and rate:
            torques.append((abs(float(best.unbalanced @ motion) / rate), link))
    return ", as by a torque of {:.3g} N*m on {}".format(*min(torques)) if torques else ""


def _none(statics: Statics, q: Array, best: Linearised, far: bool) -> SimulationError:
    d = statics.constraints.description
    pushed = np.linalg.norm(best.unbalanced[: d.of_points].reshape(len(d.free), -1), axis=1)
    order = [int(i) for i in np.argsort(-pushed, kind="stable")[:3] if pushed[i] > 0]
    points = ", ".join(f"{d.free[i]} by {pushed[i]:.3g}{'' if d.rates else ' N'}" for i in order)
    rates = dict(zip(d.states, best.unbalanced[d.of_points :].tolist(), strict=True))
    changing = ", ".join(f"{name} at {rate:.3g} per s" for name, rate in rates.items() if rate)
    if changing and not points:
        return SimulationError(
            f"no equilibrium was found from this start: no force is left, but states change, {changing}\n"
            "  Start from another pose. There may be none: an integral rests only where its rate is zero."
        )
    if far:
        return SimulationError(
            "there is no equilibrium within reach: nothing holds the linkage, which is still pushed at "
            f"{points}\n  Hold it: ground a point, or add a spring or a drive."
        )
    return SimulationError(
        f"no equilibrium was found from this start: still pushed at {points}"
        f"{f'; states change, {changing}' if changing else ''}{_torque(statics, q, best)}\n"
        "  Start from another pose. There may be none: a constant torque or force, such as that of a motor, "
        "can exceed all that weights and springs balance."
    )


def describe(statics: Statics, q: Array, linearised: Linearised) -> Equilibrium:
    """Return the equilibrium with its reactions and the outputs that the scene selects."""
    constraints, t = statics.constraints, statics.t
    d, evaluator, rest = constraints.description, statics.evaluator, statics.rates(q)
    if d.states:
        linearised, q = statics.at(q, in_motion=True), q * (np.arange(len(q)) < d.of_points)
    work = np.zeros(evaluator.work_size + constraints.n + constraints.m + 1)
    work[constraints.n : constraints.n + constraints.m] = linearised.multipliers
    info = d.kernel("outputs")
    outputs = evaluator.blocks("outputs", t, q, rest, work) if info else {}
    return Equilibrium(
        state=state_at(evaluator, t, q, rest, statics.references),
        stability=linearised.stability(),
        freedoms=linearised.freedoms,
        residual=float(np.max(np.abs(linearised.unbalanced), initial=0.0)),
        scale=linearised.scale,
        multipliers=dict(zip(d.constraints, linearised.multipliers.tolist(), strict=True)),
        reactions=reactions_at(evaluator, t, q, rest, work),
        outputs=outputs,
        units={b.name: b.unit for b in info.blocks} if info else {},
        linearised=linearised,
        notes=notes_on_switches(evaluator, t, q, rest, linearised.basis),
    )
