"""Many variants of a driven linkage, followed in SIMD lanes, with Python once for each block of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._kinematics import KinematicLanes
from symgen.runtime._many import Starts, over_variants
from symgen.runtime._start import StartLanes
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.integrate.redundancy import extent
from symgen.runtime.kernels.batch import fits_lanes, lanes_of
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.typed import Typed
from symgen.runtime.many.dataset import BLOCK, Keep, KeptSamples
from symgen.runtime.many.reductions import EXTREMES, of_extremes
from symgen.runtime.many.runs import is_stored, parameters_of_runs
from symgen.runtime.model.arguments import LinkageForces, LinkageMotion
from symgen.runtime.result.records import Variable, over_time
from symgen.runtime.rods.constraints import rotations_of
from symgen.runtime.rods.following.branch import TURN, nodes_of, turned
from symgen.runtime.rods.following.groups import Groups, groups_of
from symgen.runtime.rods.forces.analysis import driving, names_of_drives, of_drive, of_unknown
from symgen.runtime.rods.forces.assembly import Assembly, Unknown
from symgen.runtime.rods.large_start import LARGE
from symgen.runtime.rods.many.starts import start_of
from symgen.runtime.rods.poses import Poses
from symgen.runtime.rods.recorded_motion import CurvePositions, chosen_names, coordinate_of, of_names

if TYPE_CHECKING:
    from symgen.runtime.kernels.description import Description
    from symgen.runtime.kernels.library import Library
    from symgen.runtime.result.state import State

Kernels = tuple["Description", "Library"]
#: Number of starts from which kernels that assemble in lanes are compiled.
_MANY = 128
#: Most runs of one call without samples.
_REDUCED = 1024


@dataclass(frozen=True, slots=True)
class Driven:
    """Variants with ``parameters`` (runs, parameters), followed from their starts or from ``states``.

    Attributes
    ----------
    motion, forces
        Kernels that take vectors; ``forces`` if joint forces are requested.
    unknowns
        The joint forces, guide forces and torques that ``forces`` gives, each with its columns.
    chosen
        Points and links to record, if no forces are requested.
    drive
        Driven link whose direction is the coordinate; empty if the coordinate is the time.
    assembling
        Kernels of the equations of motion that take vectors, or None if starts are found singly.
    groups
        The constraint Jacobian in block triangular form.
    t, nodes, recorded
        Time of the starts, times to pass through, and the numbers of those that are recorded.
    """

    model: Any
    parameters: Array
    states: Array | None
    motion: Kernels
    forces: Kernels | None
    unknowns: Sequence[tuple[Unknown, list[int]]]
    chosen: Mapping[str, Sequence[str]]
    drive: str
    assembling: Library | None
    groups: Groups
    t: float
    nodes: Array
    recorded: Indices

    reason: ClassVar[str] = ""

    @property
    def grain(self) -> int:
        """Number of runs that fill all lanes."""
        return lanes_of(self.motion[1], self.motion[0].name)[0]

    def __call__(self, first: int, last: int, keep: Keep) -> list[KeptSamples | None]:
        """Carry out some runs; None stands for those that are to be carried out singly."""
        results: list[KeptSamples | None] = [None] * (last - first)
        if self.forces and not keep.within(self._of_forces(*self._nothing)):
            return results  # reactions and section forces take the balance of every element
        d, evaluator, rows = self.model.description, self.model.evaluator, self.parameters[first:last]
        start = start_of(evaluator)
        ahead = None
        if self.assembling:
            ahead = StartLanes(start[2], self.assembling, self.grain, rows.shape[1]).assembled(rows)
        regular, q, lengths = Starts(*start).poses(rows, ahead)
        if self.states is not None:
            q = self.states[first:last]
            variants = (Evaluator(d, evaluator.library, p) for p in rows)
            lengths = np.array([extent(v, pose) for v, pose in zip(variants, q, strict=True)])
        runs = np.flatnonzero(regular & ~is_stored(evaluator, rows, self.states))
        if self.reduces(keep) and len(runs):
            runs = self.by_extremes(rows, q, lengths, runs, keep, results, first)
        if not len(runs):
            return results
        states, joints, is_done = self._followed(rows[runs], q[runs], lengths[runs])
        is_done &= np.isfinite(joints).all(axis=(1, 2))
        moving = over_variants(evaluator, "points", rows[runs], self.nodes, states)
        shape = (len(runs), len(self.nodes), 2, len(d.points), len(d.axes))
        places, velocities = np.moveaxis(moving.reshape(shape), 2, 0)
        with np.errstate(all="ignore"):  # of runs that ended before
            is_done &= turned(d, self.nodes, places, velocities) <= TURN
        runs, which = runs[is_done], np.ix_(np.flatnonzero(is_done), self.recorded)
        if not len(runs):
            return results
        states, times = states[which], self.nodes[self.recorded]
        kinematics = self.model.analysis("kinematics")
        closed = over_variants(kinematics, "closure", rows[runs], times, states)
        m = len(d.constraints)
        missed = np.max(np.abs(closed[..., :m] / closed[..., m : 2 * m]), axis=(1, 2))
        if self.forces:
            variables = self._of_forces(rows[runs], states, joints[which])
        else:
            variables = self._of_motion(rows[runs], states, places[is_done], velocities[is_done])
        if keep.within(variables):
            variables = [v for v in variables if v.name == self.drive or keep.takes(v)]
        along, sampled = coordinate_of(times, variables, self.drive)
        of_time, drift = None if along.name == "time" else times, {"constraint": missed}
        if along.values.ndim == 2 and not np.any(along.values != along.values[0]):
            along = replace(along, values=along.values[0])
        if along.values.ndim == 1 or keep.names:
            early = [""] * len(runs)
            record = keep(sampled, along, of_time, drift, d.axes, first + runs, early=early)
            _placed(runs, [record] * len(runs), results)
            return results
        for i, run in enumerate(runs.tolist()):
            one = [v.of(v.values[[i]]) for v in sampled]
            angle = replace(along, values=along.values[i])
            results[run] = keep(one, angle, of_time, {"constraint": missed[[i]]}, d.axes, early=[""])
        return results

    def most(self, keep: Keep) -> int:
        """Return the number of runs of one call."""
        return _REDUCED if self.reduces(keep) else BLOCK

    def reduces(self, keep: Keep) -> bool:
        """Return whether forces are reduced to values that their extremes over the samples give."""
        axes, nothing = self.model.description.axes, np.zeros(3)
        forces = [of_unknown(u, axes, nothing) for u, _ in self.unknowns] if self.forces else []
        return keep.within(forces) and {*(keep.names or ("",))} <= {*EXTREMES} and self.nodes[0] >= self.t

    def by_extremes(
        self,
        parameter_rows: Array,
        q: Array,
        lengths: Array,
        runs: Indices,
        keep: Keep,
        results: list[KeptSamples | None],
        first: int,
    ) -> Indices:
        """Enter the reductions of some runs; return those whose links may turn far between nodes."""
        d, flags = self.model.description, np.zeros(len(self.nodes), dtype=np.uint8)
        flags[self.recorded] = True
        number = {name: 2 * i for i, name in enumerate(d.points)}
        ends = [[number[p] for p in points[:2]] for points in d.links.values()] if len(d.axes) == 2 else []
        extremes = [{k for name in keep.names for k in EXTREMES[name][vector]} for vector in (False, True)]
        wholes = {of_unknown(u, (), np.zeros(3)).name for u, _ in self.unknowns}
        extremes[1] |= extremes[0] if {*(keep.outputs or ())} - wholes else set()  # of components
        selections = [sum(1 << k for k in numbers) for numbers in extremes]
        rows, missed, is_done, steady = self._lanes().extremes(
            self.t,
            parameter_rows[runs],
            q[runs],
            lengths[runs],
            self.nodes,
            flags,
            np.array([c[0] for _, c in self.unknowns] + [self._width]),
            np.array([selections[len(c) > 1] for _, c in self.unknowns], dtype=np.uint8),
            np.array(ends, dtype=np.intp).reshape(-1, 2),
            TURN,
        )
        good = is_done & steady
        forces = [of_unknown(u, d.axes, rows[good][..., columns]) for u, columns in self.unknowns]
        along = self.nodes[self.recorded]
        if np.any(good):
            drift, numbers = {"constraint": missed[good]}, first + runs[good]
            early = [""] * len(numbers)
            record = keep(forces, over_time(along), None, drift, d.axes, numbers, of_extremes, early)
            _placed(runs[good], [record] * len(numbers), results)
        return runs[is_done & ~steady]

    def _lanes(self) -> KinematicLanes:
        return KinematicLanes(self.motion, self.grain, self.groups, self.forces)

    def _followed(
        self, parameter_rows: Array, q: Array, lengths: Array
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return states and joint forces at all nodes, and which runs reached all."""
        lanes = self._lanes()
        begin, parameter_rows, q = (
            int(np.searchsorted(self.nodes, self.t)),
            *map(np.ascontiguousarray, (parameter_rows, q)),
        )
        states, joints, reached = lanes.follow(self.t, parameter_rows, q, lengths, self.nodes[begin:])
        is_done = reached == len(self.nodes) - begin
        if begin:
            back = lanes.follow(self.t, parameter_rows, q, lengths, self.nodes[:begin][::-1].copy())
            states, joints = (
                np.hstack([a[:, ::-1], b]) for a, b in zip(back, (states, joints), strict=False)
            )
            is_done &= back[2] == begin
        return states, joints, is_done

    @property
    def _nothing(self) -> tuple[Array, Array, Array]:
        """No run."""
        count, n = len(self.recorded), self.model.description.coordinates
        return self.parameters[:0], np.zeros((0, count, 3, n)), np.zeros((0, count, self._width))

    @property
    def _width(self) -> int:
        info = self.forces[0].kernel("joint_forces") if self.forces else None
        return info.out_size if info else 0

    def _of_forces(self, parameter_rows: Array, states: Array, joints: Array) -> list[Variable]:
        """Return the outputs of all runs, values of shape (runs, samples, ...)."""
        loads, axes, variables = self.model.analysis("forces"), self.model.description.axes, []
        if loads.has("driven_angles"):
            angles = over_variants(loads, "driven_angles", parameter_rows, self.nodes[self.recorded], states)
            variables = [of_drive(name, angles[..., i]) for i, name in enumerate(names_of_drives(loads))]
        return variables + [of_unknown(u, axes, joints[..., columns]) for u, columns in self.unknowns]

    def _of_motion(
        self, parameter_rows: Array, states: Array, places: Array, velocities: Array
    ) -> list[Variable]:
        """Return the records of all runs, values of shape (runs, samples, ...)."""
        d, times, kinematics = (
            self.model.description,
            self.nodes[self.recorded],
            self.model.analysis("kinematics"),
        )
        second = over_variants(self.model.evaluator, "point_accelerations", parameter_rows, times, states)
        shape = (-1, len(d.points), len(d.axes))
        moving = [x.reshape(shape) for x in (places[:, self.recorded], velocities[:, self.recorded], second)]
        start = int(np.searchsorted(self.nodes, self.t))
        along, variables = CurvePositions(d, places, self.recorded, start), []
        info = kinematics.find("drives")
        if info:
            values = over_variants(kinematics, "drives", parameter_rows, times, states)
            variables = [
                Variable(b.name, b.unit, f"drive {b.name}", (), values[..., b.offset]) for b in info.blocks
            ]
        used_names, size = {v.name for v in variables}, (len(parameter_rows), len(times))

        def counted(link: str, angles: Array) -> Array:
            return along.counted(link, angles.reshape(size)).ravel()

        turning = {}
        if {*self.chosen} & {*d.links}:
            out = over_variants(kinematics, "rotations", parameter_rows, times, states)
            turning = rotations_of(kinematics, out.reshape(-1, out.shape[2]))
        stacked = [v for v in of_names(d, self.chosen, counted, turning, *moving) if v.name not in used_names]
        return variables + [replace(v, values=v.values.reshape(*size, *v.values.shape[1:])) for v in stacked]


def _assembling(model: Any, count: int, states: Sequence[State] | None, lanes: int) -> Library | None:
    """Return kernels that assemble in lanes; None where few starts do not repay their compilation."""
    info = model.evaluator.find("assembly")
    rows = info.blocks[0].shape[0] if info else 0
    if states is not None or count < _MANY or not isinstance(model.number_type, Typed):
        return None
    if not model.number_type.is_plain or rows < model.description.coordinates:
        return None
    library = model.number_type.kernels(True)
    return library if lanes_of(library, model.description.name)[0] == lanes else None


def _placed(runs: Indices, parts: Sequence[KeptSamples | None], results: list[KeptSamples | None]) -> None:
    for run, one in zip(runs.tolist(), parts, strict=True):
        results[run] = one


def driven_runs(
    model: Any,
    with_forces: bool,
    columns: Mapping[str, Array],
    states: Sequence[State] | None,
    arguments: Mapping[str, Any],
) -> Driven | None:
    """Return the runs of kinematics, or of inverse dynamics; None where each is to be carried out singly."""
    d = model.description
    if d.kinematic or d.plane or d.events or d.held or d.redundant:
        return None
    if with_forces and len(d.axes) > 2:  # those of the equations of motion
        return None
    if d.rates or d.scene_outputs:  # outputs by expressions are not recorded in lanes
        return None
    if d.coordinates > LARGE or not fits_lanes(d):
        return None
    starts = {s.t for s in states} if states is not None else {0.0}
    if len(starts) > 1 or d.coordinates != len(d.constraints):
        return None
    if arguments.get("at") is not None or arguments.get("over") is not None:
        return None
    loads = model.analysis("forces") if with_forces else None
    in_turn = model.evaluator.has("line_lengths") or model.evaluator.couples
    if loads and (not loads.has("joint_forces") or in_turn):
        return None
    motion, forces = model.in_lanes("kinematics"), model.in_lanes("forces") if loads else None
    width = lanes_of(motion[1], motion[0].name)[0] if motion[1].backend == "c" else 1
    if width < 2:
        return None
    rows = parameters_of_runs(model.evaluator, columns, states)
    t, constraints = starts.pop(), model.constraints()
    options = {name: value for name, value in arguments.items() if value is not None}
    if d.kernel("run_end") and "stop" not in options:
        return None
    instants = (LinkageForces if loads else LinkageMotion)(**options).instants(d.t_end)
    times = instants.times(d.name, constraints.driving)
    nodes = nodes_of(t, min(instants.start, t), max(instants.stop, t), np.unique(times))
    unknowns: list[tuple[Unknown, list[int]]] = []
    if loads:
        order = {label: i for i, label in enumerate(loads.info("joint_forces").blocks[0].rows)}
        of_assembly = Assembly(
            constraints, loads, Poses(np.zeros(0), np.zeros((0, 3, constraints.n))), 1
        ).unknowns
        unknowns = [(u, [order[label] for label in u.labels]) for u in of_assembly]
    drives = driving(loads, times[:1]) if loads else {}
    return Driven(
        model,
        rows,
        None if states is None else np.array([s.q for s in states]),
        motion,
        forces,
        unknowns,
        chosen_names(constraints, arguments.get("of")),
        next(iter(drives), ""),
        _assembling(model, len(rows), states, width),
        groups_of(constraints.slopes, range(constraints.n), constraints.n),
        t,
        nodes,
        np.searchsorted(nodes, times),
    )
