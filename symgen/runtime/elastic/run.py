"""One run of an elastic motion by any method, with its notes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _beams
from symgen.runtime.arrays import Array
from symgen.runtime.beams.checks import (
    moments,
    of_crank,
    of_lengths,
    of_reductions,
    of_second_order,
    second_order,
    warnings,
)
from symgen.runtime.beams.energies import Energies, energies, of_angles, of_kinetic
from symgen.runtime.beams.forces import ElasticForces, RunMotion, accelerations_of, forces
from symgen.runtime.beams.methods import BEAM_METHODS, GAUSS
from symgen.runtime.beams.modal.structure import UnstableError
from symgen.runtime.beams.selection import note_of_omitted, selected
from symgen.runtime.elastic.checkpoint import stages_of
from symgen.runtime.elastic.jumps import jump_times
from symgen.runtime.elastic.large.shaking import in_linear_theory
from symgen.runtime.elastic.mesh import mesh_error, unknown
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import Once, Solution, coordinate_of, outputs, recovered
from symgen.runtime.elastic.static import held, initial
from symgen.runtime.elastic.steady.periodic import again, periodic
from symgen.runtime.elastic.steps import (
    Task,
    check_thesis,
    explicit,
    first_steps,
    recorded_times,
    step_counts,
    stepped,
)  # fmt: skip
from symgen.runtime.elastic.tolerance import adapted, of_steps, with_error
from symgen.runtime.integrate.checkpoint import CheckpointOptions
from symgen.runtime.integrate.pace import (
    OutOfTime,
    Pace,
    Progress,
    check_wall,
    is_spent,
    limited,
    out_of_time,
    wall_left,
)  # fmt: skip
from symgen.runtime.kernels.typed import build_settings
from symgen.runtime.result.elastic import SELECTED, ElasticResult, is_stable
from symgen.runtime.result.recording import of_switches
from symgen.runtime.result.records import Drift, LazyStatistics, Variable, of_model
from symgen.runtime.rods.following.jumps import check_rigid_motion

#: Error over its change by halved elements, where it falls with the square of their length: linear stretch.
HALVED = 4 / 3
#: Steps per revolution with which explicit runs are repeated, implicitly, on finer elements.
_EXPLICIT = 512
#: Largest displacement [m], rotation [rad] and rate of a motion that does not grow without bound.
_BOUND = 1e30
#: Distance of multipliers from one: round-off splits the double multiplier of a free crank by its root.
_UNIT = 1e-4


def run(
    motion: ElasticMotion, task: Task, progress: Progress | None, keeping: CheckpointOptions | None = None
) -> ElasticResult:
    """Return the result of a run.

    Raises
    ------
    ModelError
        For options out of range, a method that does not suit the linkage, or a rigid motion that the crank
        does not determine.
    SimulationError
        When the linkage cannot move, or the motion grows without bound.
    ResultError
        When a checkpoint cannot be written, or is of another run.
    """
    if keeping is not None and task.method in ("quasi-static", "periodic"):
        raise ModelError(
            f"there are no checkpoints of {task.method} motions: they are not found step by step in time"
        )
    times = recorded_times(motion, task)
    motion.check_determined()
    if motion.has_motor:
        motion = _with_motor(motion, task)
        times = recorded_times(motion, task)
    count, end = len(times), float(np.max(times))
    if task.method != "quasi-static":
        # Shooting steps over the whole revolution, whatever angles are selected.
        until = max(end, motion.period) if task.method == "periodic" and motion.speed else end
        check_rigid_motion(motion.rigid, 0.0, until)
        motion = motion.ending_on(jump_times(motion, until, first_steps(motion, task, 1)))
        times = np.concatenate([times, motion.jumps[:, 0]])
    equations = _equations(motion, task)
    if task.form == "thesis":
        check_thesis(motion)
    check_wall("preparing the elastic links")
    if motion.info.outputs is not None:
        selected(outputs_of_runs(motion, task), motion.rigid.description, partial(outputs_of_runs, motion))
    stages = stages_of(motion, equations, keeping, repr(task), times.tobytes().hex()) if keeping else None
    pace, passes = Pace(0.0, end), list[Solution]()
    try:
        if task.method == "quasi-static":
            states = held(motion, equations, times, pace)
        elif task.method == "periodic":
            states = periodic(motion, equations, task, times, pace, passes)
        else:
            begun = initial(motion, equations, task)
            if task.method in BEAM_METHODS:
                states = adapted(motion, equations, task, times, progress, stages, pace, passes, begun)
            else:
                passes.append(explicit(motion, equations, task, times, progress, stages, begun))
                states = with_error(motion, task, times, passes[0], begun)
    except OutOfTime as stop:
        raise _out_of_time(motion, task, times[:count], stop, passes, pace) from None
    if not all(np.all(np.abs(x) < _BOUND) for x in (states.displacements, states.rates) if x is not None):
        raise SimulationError(
            f"{motion.rigid.name}: the motion grows without bound: the step is too long for "
            f"{task.method}, or the motion is unstable\n"
            "  Take more steps, or check the Floquet multipliers (symgen periodic, model.periodic())."
        )
    spent = stages.spent if stages else 0.0
    result = _result(motion, task, times[:count], states, spent + pace.wall)
    result._estimate_later(partial(_mesh_error, motion, task, times, states, wall_left()))
    return result


def _mesh_error(
    motion: ElasticMotion, task: Task, times: Array, states: Solution, max_wall: float | None
) -> float | str:
    """Return the error of stresses by elements, over their peak, or why it is not known.

    The run is repeated with all elements halved, and its steps: errors in time are the same.
    """
    pace, method = Pace(0.0, float(np.max(times))), BEAM_METHODS.get(task.method, GAUSS)
    equations = _equations(motion, task)

    def repeated(one: ElasticMotion, of: _beams.BeamEquations) -> Array:
        if task.method == "quasi-static":
            return held(one, of, times, pace).displacements
        counts = step_counts(motion, times, _EXPLICIT) if states.counts is None else states.counts
        if task.method == "periodic":
            # The times may lie in the first part of the revolution.
            to_last = int(np.sum(counts))
            return again(one, of, times, counts, max(to_last, states.steps - to_last), pace)
        return stepped(one, of, method, times, counts, initial(one, of, task), pace=pace)[0]

    try:
        with limited(max_wall):
            coarse = repeated(motion, equations) if states.counts is None else states.displacements
            finer = motion.refined
            fine = repeated(finer, _equations(finer, task))
    except (OutOfTime, SimulationError, ModelError) as problem:
        return unknown(problem)
    if not np.all(np.isfinite(fine)):
        return "the motion with twice the elements grows without bound"
    links = motion.rigid_motion(equations, times)[1]
    return HALVED * mesh_error(outputs(motion, links, coarse), outputs(finer, links, fine))


def _out_of_time(
    motion: ElasticMotion,
    task: Task,
    times: Array,
    stop: OutOfTime,
    passes: list[Solution],
    pace: Pace,
) -> SimulationError:
    """Return the error of a run that took all of its wall time, with the best that it found."""
    states, reached = (passes[-1], np.arange(len(times))) if passes else (stop.states, stop.reached)
    recorded = reached < len(times)  # jumps of loads follow
    states, reached = states.at(np.flatnonzero(recorded)), reached[recorded]
    problem = f"{motion.rigid.name}: {out_of_time(stop.t, float(np.max(times)))}"
    if passes:
        problem += (
            f"\n  The result of {states.steps} steps is kept; the run with more steps, from which its error "
            "would follow, was not finished."
        )
    finite = len(reached) and bool(np.all(np.isfinite(states.displacements)))
    partial = _result(motion, task, times[reached], states, pace.wall) if finite else None
    return SimulationError(problem, time=stop.t, partial=partial)


def _equations(motion: ElasticMotion, task: Task) -> _beams.BeamEquations:
    """Return the equations of a run, at its start."""
    return motion.equations(task.form == "thesis", stepping=True)


def _with_motor(motion: ElasticMotion, task: Task) -> ElasticMotion:
    """Return the motion about that of the rigid linkage with its motor: steady, or from the start."""
    if task.method == "periodic":
        return motion.about(motion.machine.steady)
    if task.at is not None:
        return motion.about(motion.machine.revolutions(math.ceil(task.revolutions)))
    return motion.about(motion.machine.path(motion.period * task.revolutions))


def _result(
    motion: ElasticMotion,
    task: Task,
    times: Array,
    states: Solution,
    wall: float,
) -> ElasticResult:
    d, rigid = motion.rigid.description, motion.rigid
    attributes: dict[str, Any] = {"method": task.method, "form": task.form, "rtol": task.rtol}
    attributes |= {"t_end": float(np.max(times)), "geometric_stiffness": motion.stiffened}
    attributes |= {} if task.method in ("quasi-static", "periodic") else {"initial": task.initial}
    source = _Recorded(motion, task, states.at(np.arange(len(times))), times, wall, is_spent())
    return ElasticResult._later(
        source,
        **of_model(d, rigid.parameters, **attributes, **build_settings(rigid.evaluator.library, rigid.typed)),
        axes=d.axes,
        coordinate=coordinate_of(motion, times),
        drift=Drift(),
        final={},
        events=(),
        times=times if motion.speed else None,
    )


def outputs_of_runs(motion: ElasticMotion, task: Task | None = None) -> Iterator[Variable]:
    """Return the outputs of a run by linear theory, undeformed, before it; none of a free rigid motion."""
    if motion.undetermined:
        return iter(())
    still, task = np.zeros((1, motion.layout.unknowns)), task or Task(GAUSS.name, 2)
    states = Solution(still, None if task.method == "quasi-static" else still, 0)
    return _Recorded(motion, task, states, np.zeros(1), 0.0, True).outputs()


@dataclass
class _Recorded:
    """A run that has ended; its methods give fields of its result that take as long as many steps.

    Each pose is found from the one before: with equations of their own all parts are computed in the same
    order, whichever is read first.
    """

    motion: ElasticMotion
    task: Task
    states: Solution
    times: Array
    wall: float
    spent: bool

    @Once
    def equations(self) -> _beams.BeamEquations:
        """Return the equations at the start of the motion."""
        return _equations(self.motion, self.task)

    @Once
    def _moved(self) -> tuple[tuple[Array, Array, Array], RunMotion]:
        """Return the rigid motion, and the whole."""
        states = self.states
        rigid, links, loads = self.motion.rigid_motion(self.equations, self.times)
        moved = states.displacements, states.rates, self.task.form == "thesis"
        return rigid, RunMotion(self.times, rigid[0], links, loads, *moved)

    @Once
    def _shapes(self) -> list[Variable]:
        whole = self._moved[1]
        shapes = outputs(self.motion, whole.links, whole.displacements)
        return [*shapes, *recovered(self.motion, whole)]

    @Once
    def _acting(self) -> tuple[Array, ElasticForces]:
        """Return the accelerations and the forces."""
        whole = self._moved[1]
        accelerations = accelerations_of(self.equations, whole)
        return accelerations, forces(self.motion, self.equations, whole, accelerations)

    @Once
    def _balance(self) -> Energies | None:
        return energies(self.motion, *self._moved, *self._acting)

    @Once
    def _shares(self) -> dict[str, float]:
        _ = self._acting  # first
        return second_order(self.motion, self.equations, self._moved[1])

    def _mean_powers(self) -> list[float]:
        task, balance = self.task, self._balance
        steady = task.method == "periodic" and task.at is None and self.motion.info.mode == "held"
        return list((balance.mean_powers() if balance and steady else None) or ())

    def outputs(self) -> Iterator[Variable]:
        """Yield all outputs; those of one kind are computed when it comes to them."""
        yield from self._shapes
        yield from (*self._acting[1].variables, *in_linear_theory(self.motion, *self._moved, *self._acting))
        yield from self._balance.variables() if self._balance else ()

    def variables(self) -> tuple[Variable, ...]:
        """Return the outputs that the scene selects."""
        d = self.motion.rigid.description
        return selected(self.outputs(), d, partial(outputs_of_runs, self.motion))

    def statistics(self) -> Mapping[str, Any]:
        """Return counts, errors, shares of second order, powers, and multipliers."""
        motion, states = self.motion, self.states
        return LazyStatistics(
            {
                "unknowns": motion.layout.unknowns - motion.layout.constraints,
                "steps": states.steps,
                "error": lambda: states.errors()[0],
                "damping_ratios": lambda: list(motion.damping_ratios),
                "second_order": lambda: self._shares,
                "mean_powers_w": self._mean_powers,
                "power_balance": lambda: self._balance.balance if self._balance else None,
                "omitted_power": lambda: self._balance.omitted_share if self._balance else None,
                "wall_s": self.wall,
                "floquet": [[z.real, z.imag] for z in states.floquet],
                "floquet_error": lambda: states.errors()[1],
            }
        )

    def notes(self) -> tuple[str, ...]:
        """Return remarks on the run and on where linear theory does not hold."""
        motion, task, whole = self.motion, self.task, self._moved[1]
        d, names = motion.rigid.description, motion.info.outputs
        notes = [
            *([] if self.spent else _of_speed(motion)),
            *_of_motor(motion, task),
            *_of_stability(self.states),
            *of_steps(task, self.states),
            *d.remarks,
            *(note_of_omitted(self.variables(), d) if names else ()),
            *of_crank(motion, whole),
            *of_reductions(motion),
            *of_lengths(motion),
            *of_switches(d.switches, int(np.sum(motion.jumps[:, 1] > motion.jumps[:, 0]))),
            *warnings(motion, whole, moments(motion, self.times)),
            *of_second_order(self._shares),
            *of_angles(motion),
            *(of_kinetic(self._balance) if names is None or "kinetic_energy" in names else ()),
        ]
        if task.t_eval is not None:
            notes.append(f"{SELECTED} times of t_eval only")
        if task.at is not None and task.method != "quasi-static":
            notes.append(f"{SELECTED} selected crank angles only")
        if whole.thesis:
            notes.append("the thesis' form, which takes the turning of axes as constant: for comparison only")
        return tuple(notes)


def _of_speed(motion: ElasticMotion) -> list[str]:
    """Return the note on a crank faster than the lowest frequency of the structure, if wall time is left."""
    if not motion.speed or is_spent():
        return []
    try:
        crank, lowest = 1.0 / motion.period, motion.lowest_frequency
    except UnstableError:
        return ["the structure is unstable at rest in every pose: a spring pushes it away"]
    if crank < lowest:
        return []
    return [
        f"the crank turns at {crank:.4g} Hz, above the first critical speed: the lowest frequency of the "
        f"structure over a revolution is {lowest:.4g} Hz"
    ]


def _of_motor(motion: ElasticMotion, task: Task) -> list[str]:
    """Report the speed at which a motor settles."""
    if not motion.has_motor or task.method != "periodic":
        return []
    return [f"mean speed of the crank with its motor in the steady state: {60.0 / motion.period:.6g} rpm"]


def _of_stability(states: Solution) -> list[str]:
    if not states.floquet:
        return []
    stable = is_stable(abs(states.floquet[0]), states.errors()[1])
    if stable is None:
        return [
            "not known whether it is stable: the Floquet multipliers still change as steps are halved, by "
            "vibrations that these do not resolve; take more steps per revolution, or a reduction"
        ]
    nearest = min(abs(z - 1.0) for z in states.floquet)
    if stable and nearest < _UNIT:
        return [
            f"a Floquet multiplier is one within {nearest:.1g}: the steady state is not the only one, or in "
            "resonance; which is shown is left to round-off"
        ]
    if stable:
        return []
    return [
        f"unstable: the largest Floquet multiplier is {abs(states.floquet[0]):.6g}; a deviation from the "
        "steady state grows by that factor in each revolution"
    ]
