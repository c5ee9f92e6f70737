"""Forces in a driven linkage of rigid links over its motion: from the task to a result."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.causes import cause
from symgen.runtime.integrate.dead_points import dead_points
from symgen.runtime.kernels.arguments import count, reals
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.model.arguments import LinkageForces
from symgen.runtime.model.instants import Instants
from symgen.runtime.result.findings import SingularPose
from symgen.runtime.result.forces import Forces
from symgen.runtime.result.recording import outputs_by_group
from symgen.runtime.result.records import Variable, converters
from symgen.runtime.result.state import State
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.forces.assembly import Assembly, ForceSolution, Unknown, solve
from symgen.runtime.rods.forces.efforts import efforts
from symgen.runtime.rods.forces.multipliers import by_multipliers
from symgen.runtime.rods.kinematics import driven, follow, with_references
from symgen.runtime.rods.poses import Poses
from symgen.runtime.rods.recorded_motion import CurvePositions, Followed, over_poses

#: Most elements of a link.
_MOST_ELEMENTS = 1000
#: Most samples of a range.
_MOST_SAMPLES = 100_000
#: A smaller part of an unknown in the forces that nothing balances is rounding.
_OPEN = 1e-6


@dataclass(frozen=True, slots=True)
class _Linkage:
    """The linkage and its kernels, and how many of its constraints follow from others."""

    constraints: Constraints
    loads: Evaluator
    redundant: int

    def drives(self, t: float) -> dict[str, float]:
        """Return the direction of every driven link [rad] at a time, by the name of its output."""
        return {name: float(values[0]) for name, values in self.driving(np.array([t])).items()}

    def driving(self, times: Array) -> dict[str, Array]:
        """Return the same at many times; with motions that efforts keep, of every drive [rad or m]."""
        if self.constraints.evaluator.efforts:
            return self.constraints.driving(times)
        return driving(self.loads, times)

    def at(self, t: float) -> str:
        """Return a time in words, with the directions of the driven links."""
        units = self.constraints.units()
        parts = [
            f"{name} = {v:.9g} m" if units[name] == "m" else f"{name} = {math.degrees(v):.9g} deg"
            for name, v in self.drives(t).items()
        ]
        return ", ".join([*parts, f"t = {t:.9g} s"])


def driving(loads: Evaluator, times: Array) -> dict[str, Array]:
    """Return the direction of every driven link [rad] at many times, by the name of its output."""
    if not loads.has("driven_angles"):
        return {}
    still = np.zeros((len(times), loads.description.coordinates))
    values = loads.many("driven_angles", times, still, still)
    return dict(zip(names_of_drives(loads), values.T, strict=True))


def names_of_drives(loads: Evaluator) -> tuple[str, ...]:
    """Return the names of the outputs that are the angles of drives, against the ground or another link."""
    return loads.info("driven_angles").blocks[0].rows


def analyse(
    constraints: Constraints, loads: Evaluator, begin: State, redundant: int, request: LinkageForces
) -> Forces:
    """Return the forces over a motion that starts from a state.

    ``redundant`` is how many constraints follow from the others wherever the linkage goes.

    Raises
    ------
    ModelError
        For a request out of range, or drives that do not determine the motion.
    SimulationError
        If a requested pose cannot be reached, or does not determine the forces: it names direction, rank and
        the undetermined forces.
    """
    began, d = perf_counter(), constraints.description
    linkage, request, over = (
        _Linkage(constraints, loads, redundant),
        _checked(request),
        request.instants(d.t_end),
    )
    driven(constraints, begin.q, begin.t)
    times = over.times(d.name, linkage.driving)
    followed = follow(constraints, begin.q, begin.t, over, times)
    followed = replace(followed, samples=with_references(constraints, followed, begin))
    if over.spread:
        times = np.sort(followed.samples.times)
    poses = sampled(constraints, followed, times, over.at is not None, linkage.at, partial(_at_pose, linkage))
    if constraints.evaluator.couples:
        poses = _with_couples(linkage, poses)
    assembly = Assembly(constraints, loads, poses, request.elements)
    solution = by_multipliers(constraints, loads, poses, assembly) or solve(assembly)
    unknown = np.flatnonzero(~np.isfinite(solution.x).all(axis=1))
    if len(unknown):
        t = float(poses.times[unknown[0]])
        raise SimulationError(f"no finite forces at {linkage.at(t)}: a load there is not a number", time=t)
    lost = np.flatnonzero(solution.rank < assembly.size - redundant)
    dead = dead_points(constraints.evaluator, poses.times, poses.q)
    notes = [*dead, *_notes(linkage, assembly, solution, followed)]
    if len(lost):
        causes = [_undetermined(linkage, assembly, solution, i) for i in lost.tolist()]
        if over.at is not None or len(lost) == len(poses):
            raise SimulationError(causes[0], time=float(poses.times[lost[0]]))
        notes += causes
        poses = poses[np.setdiff1d(np.arange(len(poses)), lost)]
        assembly = Assembly(constraints, loads, poses, request.elements)
        solution = solve(assembly)
    return _recorded(linkage, assembly, solution, poses, followed, request, over, notes, began)


def _with_couples(linkage: _Linkage, poses: Poses) -> Poses:
    """Return poses with couples by the forces in joints, or efforts, by the equations of motion."""
    unknowns = solutions(linkage.constraints, linkage.redundant, poses)
    for i in np.flatnonzero(~np.isfinite(unknowns).all(axis=1)).tolist():
        t = float(poses.times[i])
        reason = why(linkage.constraints, poses, t)
        raise SimulationError(f"no finite forces at {linkage.at(t)}: {reason}", time=t)
    return replace(poses, unknowns=unknowns)


def solutions(constraints: Constraints, redundant: int, poses: Poses) -> Array:
    """Return accelerations, multipliers and couples by the equations of motion, (poses, unknowns)."""
    evaluator = constraints.evaluator
    equations = evaluator.equations(redundant)
    rows = np.zeros((len(poses), equations.dim))
    rows[:, : 2 * constraints.n] = poses.states[:, :2].reshape(len(poses), -1)
    found = np.empty((len(poses), constraints.n + constraints.m + len(evaluator.couples)))
    for of, numbers in poses.wound(evaluator):
        equations.set_parameters(of.parameter_values)
        found[numbers] = equations.solutions(poses.times[numbers], rows[numbers])[:, : found.shape[1]]
    return found


def _checked(request: LinkageForces) -> LinkageForces:
    elements = count(request.elements, "the number of elements")
    if not 1 <= elements <= _MOST_ELEMENTS:
        raise ModelError(f"expected between 1 and {_MOST_ELEMENTS} elements of a link, got {elements}")
    if not 2 <= request.samples <= _MOST_SAMPLES:
        raise ModelError(f"expected between 2 and {_MOST_SAMPLES} samples, got {request.samples}")
    sections = reals(request.sections, "the sections, parts of the length of a link").tolist()
    for share in sections:
        if not 0.0 < share < 1.0:
            raise ModelError(
                f"expected sections between the ends of a link, at parts of its length between 0 and 1, got "
                f"{share:g}\n  At its ends there are the joint forces, LINK.POINT.force."
            )
    cuts = [i / elements for i in range(1, elements)]
    every = tuple(sorted({*cuts, *sections}))
    return replace(request, elements=elements, sections=every)


def sampled(
    constraints: Constraints,
    followed: Followed,
    times: Array,
    every: bool,
    at: Callable[[float], str],
    described: Callable[[SingularPose], str],
) -> Poses:
    """Return the samples in the order of the requested times; raise SimulationError if one is missing.

    ``at`` and ``described`` return a time and a singular pose in words.
    """
    order = np.argsort(followed.samples.times, kind="stable")
    reached = followed.samples.times[order]
    place = np.minimum(np.searchsorted(reached, times), max(len(reached) - 1, 0))
    there = reached[place] == times if len(reached) else np.zeros(len(times), dtype=bool)
    missing = times[~there].tolist()
    if missing and (every or not len(reached)):
        singular = [described(p) for p in followed.poses]
        raise SimulationError(
            "\n  ".join(
                [
                    f"no pose that determines forces was reached at {at(missing[0])}",
                    *filter(None, singular),
                ]
            ),
            time=missing[0],
        )
    poses = followed.samples[order[place[there]]]
    if constraints.evaluator.has("line_lengths"):
        for t, q, u in zip(poses.times.tolist(), poses.q, poses.u, strict=True):
            if known := cause(constraints.evaluator, t, q, u):
                raise SimulationError(f"no finite forces at {at(t)}: {known.text}\n  {known.remedy}", time=t)
    return poses


def _at_pose(linkage: _Linkage, pose: SingularPose) -> str:
    """Return the message for a singular pose: its kind, and the forces that it leaves undetermined."""
    d = linkage.constraints.description
    if linkage.constraints.evaluator.efforts:
        return pose.describe(converters(d.units))
    q = np.concatenate([np.array(pose.positions[p]) for p in d.free])
    state = np.stack([q, np.zeros_like(q), np.zeros_like(q)])
    one = Poses(np.array([pose.t]), state[None])
    assembly = Assembly(linkage.constraints, linkage.loads, one, 1)
    return f"{pose.describe(converters(d.units))}; {_undetermined(linkage, assembly, solve(assembly), 0)}"


def _undetermined(linkage: _Linkage, assembly: Assembly, solution: ForceSolution, i: int) -> str:
    """Return the message that names the undetermined forces at a pose, and the rank of the equations."""
    names = ", ".join(u.describe() for u in _open(assembly, solution.loose[i]))
    return (
        f"forces are not determined at {linkage.at(assembly.times[i])}: the equations of {assembly.size} "
        f"unknown components have rank {solution.rank[i]}; open: {names}"
    )


def _open(assembly: Assembly, loose: Array) -> list[Unknown]:
    """Return the undetermined unknowns, the most undetermined first."""
    size = {u: float(np.max(loose[u.column : u.column + u.width])) for u in assembly.unknowns}
    return [u for u in sorted(size, key=lambda u: -size[u]) if size[u] > _OPEN]


def _notes(
    linkage: _Linkage, assembly: Assembly, solution: ForceSolution, followed: Followed
) -> Iterator[str]:
    whole = np.flatnonzero(solution.rank >= assembly.size - linkage.redundant)
    if linkage.redundant and len(whole):
        loose = _open(assembly, np.max(solution.loose[whole], axis=0))
        links = sorted({u.link for u in loose if u.link and assembly.distribution(u.link) is not None})
        follow = f"; section forces of {' and '.join(links)} follow from them" if links else ""
        yield (
            "balance alone does not determine these, and those of least norm are given: "
            f"{', '.join(u.describe() for u in loose)}{follow}"
        )
    if linkage.constraints.description.switches:
        yield "loads switch: forces may jump between two poses, and extremes are those of the poses"
    undivided = [k for k in assembly.names if assembly.distribution(k) is None]
    if undivided:
        yield (
            f"no section forces of {', '.join(undivided)}: centre and inertia are not those of an even rod "
            "(half the length, mass*length^2/12), and do not determine the distribution of mass along it; a "
            "section of the link would"
        )
    for pose in followed.poses:
        yield _at_pose(linkage, pose)
    for low, high in followed.unassemblable:
        yield f"no assembly was found from t = {low:.9g} s to {high:.9g} s"
    for low, high in followed.out_of_reach:
        yield f"from t = {low:.9g} s to {high:.9g} s it can be assembled, but not driven there"


def _variables(
    linkage: _Linkage, assembly: Assembly, solution: ForceSolution, request: LinkageForces
) -> Iterator[Variable]:
    axes, x = assembly.description.axes, solution.x
    for name, values in linkage.driving(np.array(assembly.times)).items():
        yield replace(of_drive(name, values), unit=linkage.constraints.units()[name])
    known = [of_unknown(u, axes, x[:, u.column : u.column + u.width]) for u in assembly.unknowns]
    yield from (v for v, u in zip(known, assembly.unknowns, strict=True) if u.kind == "torque")
    for point, force in assembly.reactions(x).items():
        yield Variable(
            f"{point}.reaction", "N", f"force of the ground on the linkage at {point}", axes, force
        )
    yield from (v for v, u in zip(known, assembly.unknowns, strict=True) if u.kind != "torque")
    for chain in assembly.chains:
        if chain.distribution is None or not request.sections:
            continue
        d = chain.places[:, 1] - chain.places[:, 0]
        along = d / np.linalg.norm(d, axis=1)[:, None]
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        forces = chain.sections(x, tuple(request.sections))
        for i, share in enumerate(request.sections):
            where = f"{chain.name}@{share:.6g}"
            for word, unit, about, values in (
                (
                    "axial_force",
                    "N",
                    "axial force, tension positive",
                    np.sum(forces[:, i, :2] * along, axis=1),
                ),
                (
                    "shear_force",
                    "N",
                    "shear force, to the left on the part before",
                    np.sum(forces[:, i, :2] * across, axis=1),
                ),
                ("moment", "N*m", "bending moment, stretching the left side", forces[:, i, 2]),
            ):
                yield Variable(
                    f"{where}.{word}", unit, f"{about}, of {chain.name} at {share:.6g} of it", (), values
                )


def selected(
    constraints: Constraints, redundant: int, poses: Poses, followed: Followed
) -> Iterator[Variable]:
    """Yield the outputs that the scene selects, by the equations of motion at the poses."""
    evaluator, d = constraints.evaluator, constraints.description
    if not d.selects or not evaluator.find("outputs"):
        return
    equations = evaluator.equations(redundant)
    rows = np.zeros((len(poses), equations.dim))
    rows[:, : 2 * constraints.n] = poses.states[:, :2].reshape(len(poses), -1)
    groups = ((of.parameter_values, numbers) for of, numbers in poses.wound(evaluator))
    order = np.argsort(followed.samples.times)
    place = order[np.searchsorted(followed.samples.times, poses.times, sorter=order)]
    along = CurvePositions(d, constraints.moving(followed.path)[0], followed.near[place], followed.start)
    for v in outputs_by_group(evaluator, equations, groups, poses.times, rows, redundant):
        link, _, word = v.name.rpartition(".")
        yield replace(v, values=along.counted(link, v.values)) if word == "angle" and link in d.links else v


def why(constraints: Constraints, poses: Poses, t: float) -> str:
    """Return why a pose, that at a time, has no finite forces, with the remedy if it is known."""
    i = int(np.flatnonzero(poses.times == t)[0])
    known = cause(constraints.evaluator, t, poses.q[i], poses.u[i])
    return f"{known.text}\n  {known.remedy}" if known else "a load there is not a number"


def of_drive(name: str, values: Array) -> Variable:
    """Return the direction of a driven link over the poses."""
    return Variable(name, "rad", f"drive {name}", (), values)


def of_unknown(u: Unknown, axes: tuple[str, ...], values: Array) -> Variable:
    """Return a force, guide force or torque over the poses, (..., components)."""
    if u.kind == "torque":
        about = f"torque of the drive on {u.link}, counter-clockwise"
        return Variable(f"{u.link}.torque", "N*m", about, (), values[..., 0])
    if u.kind == "gear":
        return Variable(f"{u.point}.torque", "N*m", f"torque of {u.point} on {u.link}", (), values[..., 0])
    if u.kind == "force":
        about = f"force on {u.link} at {u.point} from joined components"
        return Variable(f"{u.link}.{u.point}.force", "N", about, axes, values)
    about = f"force of the guide along {u.link} on {u.point}, to the left of {u.link}"
    return Variable(f"{u.link}.{u.point}.guide_force", "N", about, (), values[..., 0])


def _recorded(
    linkage: _Linkage,
    assembly: Assembly,
    solution: ForceSolution,
    poses: Poses,
    followed: Followed,
    request: LinkageForces,
    over: Instants,
    notes: Sequence[str],
    began: float,
) -> Forces:
    constraints = linkage.constraints
    drive = next(iter(linkage.drives(0.0)), "") if over.over == "input" else ""
    forces = [*efforts(constraints, poses), *_variables(linkage, assembly, solution, request)]
    known = {v.name for v in forces}
    chosen = selected(constraints, linkage.redundant, poses, followed)
    forces += (v for v in chosen if v.name not in known)
    fields = over_poses(
        constraints, poses, followed, forces, drive, "elements", over.stop, began,
        elements=request.elements,
        unknowns=assembly.size,
        condition=solution.condition,
        worst_at=linkage.at(assembly.times[solution.worst]),
        residual=solution.residual,
    )  # fmt: skip
    return Forces(**fields, notes=tuple(notes))
