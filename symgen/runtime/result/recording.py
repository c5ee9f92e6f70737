"""From a finished or broken run to its Result: outputs, drift and notes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.integrate.dead_points import dead_points
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.redundancy import CLOSED, SelfStress, extent, not_unique, slack, violation
from symgen.runtime.kernels.description import Description, KernelInfo
from symgen.runtime.kernels.evaluate import Evaluator, Kernels, part
from symgen.runtime.kernels.library import Library
from symgen.runtime.result.records import Coordinate, Drift, LocatedEvent, Variable, converters, over_time
from symgen.runtime.result.state import State

if TYPE_CHECKING:
    from symgen.runtime.integrate.controller import Controller

#: Largest number of passages whose times are reported; of more, only the number is.
_SHOWN = 6
#: Longest jump or kink of a load that a note shows as written; of others only the table.
_LONGEST = 80


@dataclass(slots=True)
class RunRecording:
    """A run that has ended, complete or not; its methods return the fields of its :class:`Result`.

    ``library`` has the kernels of the run, ``wall`` is its wall time [s].
    """

    kernels: Kernels
    equations: Any
    stepper: _core.Run
    chosen: Options
    wall: float
    library: Library

    def name(self) -> str:
        """Return the scene's name."""
        return self.kernels.description.name

    def title(self) -> str:
        """Return the scene's title."""
        return self.kernels.description.title

    def coordinate(self) -> Coordinate:
        """Return the recorded times."""
        return over_time(self.stepper.sampled)

    def times(self) -> None:
        """Return no further times: the coordinate is the time."""

    def units(self) -> dict[str, tuple[str, float]]:
        """Return the units of tables and plots."""
        return converters(self.kernels.description.units)

    def drift(self) -> Drift:
        """Return the drift of the run."""
        return drift_of(self.stepper)

    def statistics(self) -> dict[str, Any]:
        """Return counts, the last time and the wall time [s]."""
        return {**counts_of(self.stepper, self.equations), "wall_s": self.wall}

    def provenance(self) -> dict[str, Any]:
        """Return equations, method, options, build and parameters of the run."""
        d = self.kernels.description
        parameters = zip(d.tunable, self.kernels.parameter_values.tolist(), strict=False)
        return {
            "equations": d.equations,
            **options_of(self.chosen),
            "backend": self.library.backend,
            **self.library.provenance,
            "parameters": {p.name: value for p, value in parameters},
        }

    def events(self) -> tuple[LocatedEvent, ...]:
        """Return the located events of the scene."""
        return ()


@dataclass(slots=True)
class Recording(RunRecording):
    """A run of a linkage; ``initial`` is the initial state if the caller gave it.

    ``controls`` are the inputs that a controller has set; None without one.
    """

    kernels: Evaluator
    redundant: tuple[int, ...]
    initial: State | None
    controls: Controller | None = None

    def axes(self) -> tuple[str, ...]:
        """Return the names of the axes."""
        return self.kernels.description.shown_axes

    def variables(self) -> tuple[Variable, ...]:
        """Return the scene's outputs at those times."""
        run, evaluator, lost = self.stepper, self.kernels, len(self.redundant)
        info = evaluator.find("outputs")
        if info is None or not run.recorded:
            return ()
        in_doubles = self.equations.core_type is _core.DOUBLE
        groups = [*wound(evaluator, run.references)] if evaluator.description.windings else []
        if self.controls is not None:
            rows = np.hstack([self.controls.held(run), run.references])
            groups = [*grouped(evaluator.parameter_values, 0, rows)]
        plain = len(groups) <= 1 and all(of is evaluator.parameter_values for of, _ in groups)
        if in_doubles and not info.work_size and plain:
            sizes = (*evaluator.description.sizes, info.work_size, info.out_size)
            out = run.called(evaluator.library.addresses["outputs"], sizes, evaluator.parameters)
            return self._continued(shaped(info, out))
        # States are recorded as doubles, and outputs follow from them.
        solver = self.equations if in_doubles else evaluator.equations(lost)
        if plain:
            return self._continued(outputs(evaluator, solver, run.sampled, run.result, lost))
        return self._continued(outputs_by_group(evaluator, solver, groups, run.sampled, run.result, lost))

    def _continued(self, variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
        links = self.kernels.description.turns
        return continued(variables, links, self.stepper.turns) if links else variables

    def final(self) -> dict[str, dict[str, list[float]]]:
        """Return the motion of all points at the end."""
        return motion(self.kernels, self.stepper.t, self.stepper.state)

    def notes(self) -> tuple[str, ...]:
        """Return the notes on the run: redundancy, losses of rank, stiffness, events."""
        return (
            *self.kernels.description.remarks,
            *([self.controls.note] if self.controls else []),
            *notes_on_start(self.kernels, self.initial, self.chosen.t_end, self.redundant),
            *_of_redundancy(self.kernels, self.stepper, self.redundant),
            *_of_passages(self.kernels, self.stepper),
            *dead_points(self.kernels, self.stepper.sampled, self.stepper.result),
            *_of_stiffness(self.stepper, self.chosen),
            *of_switches(self.kernels.description.switches, self.stepper.switchings),
            *notes_on_events(self.kernels, self.stepper),
        )

    def events(self) -> tuple[LocatedEvent, ...]:
        """Return the located events of the scene."""
        return located(self.kernels, self.stepper)


def located(evaluator: Evaluator, stepper: _core.Run) -> tuple[LocatedEvent, ...]:
    """Return the events that a run has located."""
    known = evaluator.description.events
    return tuple(
        LocatedEvent(known[i].name, t, rising, motion(evaluator, t, y)) for t, i, rising, y in stepper.events
    )


def notes_on_start(
    evaluator: Evaluator, start: State | None, t_end: float, redundant: tuple[int, ...]
) -> Iterator[str]:
    """Yield the notes on the start; on a given one that it has no revolutions, or violates constraints."""
    if start is None:
        yield from evaluator.description.start_remarks
    if start is not None and start.references is None and evaluator.description.windings:
        yield (
            "the given state has no revolutions: angles of loads and torsion springs count them anew, from "
            "within 180 degrees at the start; those of model.reached(t) have revolutions"
        )
    if start is None or not evaluator.description.constraints:
        return
    t, q, u = start.t, start.q, start.u
    size = extent(evaluator, q)
    allowed = max(CLOSED * size, slack(evaluator, q) if redundant else 0.0)
    error, rate = violation(evaluator, t, q, u)
    if error > allowed or rate > CLOSED * max(float(np.max(np.abs(u))), size / (t_end - t)):
        yield (
            f"the given state violates the constraints, by {error:.1e} m and {rate:.1e} m/s: the run starts "
            "from its projection onto them"
        )


def drift_of(stepper: _core.Run) -> Drift:
    """Return the drift of a run."""
    kinetic, potential = (
        stepper.kinetic_max - stepper.kinetic_min,
        stepper.potential_max - stepper.potential_min,
    )
    exchanged = max(kinetic, potential, 0.0)
    return Drift(stepper.position_drift, stepper.velocity_drift, stepper.energy_drift, exchanged)


def counts_of(stepper: _core.Run, equations: Any) -> dict[str, Any]:
    """Return the last time [s] of a run, and the numbers of its steps and evaluations."""
    return {
        "t": stepper.t,
        "steps": stepper.steps,
        "rejected": stepper.rejected,
        "evaluations": equations.evaluations,
        "factorisations": equations.factorisations,
    }


def options_of(chosen: Options) -> dict[str, Any]:
    """Return the options of a run by name."""
    return {
        "method": chosen.method.name,
        "rtol": chosen.rtol,
        "atol": chosen.atol,
        "step": chosen.step,
        "t_end": chosen.t_end,
        "stabilisation": chosen.stabilisation,
        **({"stabilisation_rate": chosen.rate} if chosen.rate else {}),
    }


def losses_of_rank(stepper: _core.Run, of: str, names: Iterable[str]) -> str:
    """Return the beginning of a note on losses of rank in a run; ``names`` are the lost unknowns."""
    times = ", ".join(f"{t:.9g}" for t, _, _ in stepper.passages[:_SHOWN])
    more = ", ..." if len(stepper.passages) > _SHOWN else ""
    losses = "1 loss" if len(stepper.passages) == 1 else f"{len(stepper.passages)} losses"
    lost = ", ".join(dict.fromkeys(names))
    where = f"of rank of the {of} ({lost}), at t = {times}{more} s"
    return f"passed {losses} {where}: the motion may branch there, and "


def motion(evaluator: Evaluator, t: float, y: Array) -> dict[str, dict[str, list[float]]]:
    """Return position [m] and velocity [m/s] of every point in a state (q, u, ...)."""
    d = evaluator.description
    n = d.coordinates
    blocks = evaluator.blocks("points", t, y[:n], y[n : 2 * n])
    return of_points(d, blocks["positions"], blocks["velocities"])


def of_points(d: Description, positions: Array, velocities: Array) -> dict[str, dict[str, list[float]]]:
    """Return position [m] and velocity [m/s] of every point from those of all, (points, axes)."""
    rows = zip(d.points, positions.tolist(), velocities.tolist(), strict=True)
    return {p: {"position": x, "velocity": v} for p, x, v in rows}


def outputs(
    evaluator: Evaluator, equations: _core.KernelEquations, times: Array, states: Array, redundant: int
) -> tuple[Variable, ...]:
    """Return the outputs that the scene selects, at times (samples,) and states (samples, (q, u, ...))."""
    info = evaluator.find("outputs")
    if info is None or not len(times):
        return ()
    return shaped(info, output_rows(evaluator, equations, times, states, redundant))


def output_rows(
    evaluator: Evaluator, equations: _core.KernelEquations, times: Array, states: Array, redundant: int
) -> Array:
    """Return the results of the kernel 'outputs' at times and states as for :func:`outputs`, a row each."""
    n, work = evaluator.description.coordinates, None
    if evaluator.info("outputs").work_size:
        work = equations.solutions(times, states if n else np.zeros((len(times), 1)))
    if work is not None and redundant:
        work = SelfStress(evaluator, times, states[:, :n], redundant).least_norm(work)
    if work is None or not n:
        return evaluator.many("outputs", times, states[:, :n], states[:, n : 2 * n], work)
    return evaluator.along("outputs", times, states, work)


def outputs_by_group(
    evaluator: Evaluator,
    equations: _core.KernelEquations,
    groups: Iterable[tuple[Array, Indices]],
    times: Array,
    states: Array,
    redundant: int,
) -> tuple[Variable, ...]:
    """Return :func:`outputs` for groups of rows with different parameters."""
    info = evaluator.find("outputs")
    if info is None or not len(times):
        return ()
    out = np.empty((len(times), info.out_size))
    for parameters, rows in groups:
        equations.set_parameters(parameters)
        at = evaluator.at(parameters)
        out[rows] = output_rows(at, equations, times[rows], states[rows], redundant)
    equations.set_parameters(evaluator.parameter_values)
    return shaped(info, out)


def continued(variables: tuple[Variable, ...], links: Sequence[str], turns: Array) -> tuple[Variable, ...]:
    """Return variables with the angles of links over the revolutions that runs counted, (..., links)."""
    counted = {f"{link}.angle": turned for link, turned in zip(links, np.moveaxis(turns, -1, 0), strict=True)}
    return tuple(
        replace(v, values=nearest_turn(v.values, counted[v.name])) if v.name in counted else v
        for v in variables
    )


def wound(evaluator: Evaluator, references: Array) -> Iterator[tuple[Array, Indices]]:
    """Yield parameters with the references of angles in loads, and the rows that have these references."""
    parameters, first = evaluator.parameter_values, evaluator.description.of_held.start
    if np.all(references == parameters[first : first + references.shape[1]]):
        yield parameters, np.arange(len(references))
        return
    yield from grouped(parameters, first, references)


def grouped(parameters: Array, first: int, values: Array) -> Iterator[tuple[Array, Indices]]:
    """Yield parameters with each distinct row of values, from index ``first`` on, and its occurrences."""
    kinds, alike = values[:1], [np.arange(len(values))]
    if not np.all(values == kinds):
        kinds, which, counts = np.unique(values, axis=0, return_inverse=True, return_counts=True)
        alike = np.split(np.argsort(which.ravel(), kind="stable"), np.cumsum(counts)[:-1])
    for row, places in zip(kinds, alike, strict=True):
        in_group = parameters.copy()
        in_group[first : first + len(row)] = row
        yield in_group, places


def nearest_turn(angles: Array, to: Array) -> Array:
    """Return angles [rad] shifted by whole revolutions to be nearest to other angles."""
    return angles + np.round((to - angles) / (2 * np.pi)) * (2 * np.pi)


def references_of(angles: Array) -> Array:
    """Return references of angles in loads [rad], multiples of a quarter: samples share few of them."""
    return np.asarray(np.round(angles / (np.pi / 2)) * (np.pi / 2))


def shaped(info: KernelInfo, out: Array) -> tuple[Variable, ...]:
    """Return rows of a kernel's results as named variables; single numbers lose the axis of components."""
    return tuple(
        [
            Variable(
                b.name, b.unit, b.about, b.rows, out[..., b.offset] if b.shape == (1, 1) else part(out, b)
            )
            for b in info.blocks
        ]
    )


def _of_redundancy(evaluator: Evaluator, stepper: _core.Run, redundant: tuple[int, ...]) -> Iterator[str]:
    """Yield the note on redundant constraints: their error, and the multipliers that are not unique."""
    if not redundant:
        return
    d = evaluator.description
    q, u = np.split(stepper.state[: 2 * d.coordinates], 2)
    blocks = evaluator.blocks("constraints", stepper.t, q, u)
    miss = float(np.max(np.abs(blocks["constraints"] / blocks["constraint_scale"])[list(redundant)]))
    rows = ", ".join(d.labels[i] for i in redundant)
    yield f"{len(redundant)} of {len(d.constraints)} constraints redundant ({rows}), missed by {miss:.1e} m"
    names = ", ".join(d.constraints[i] for i in not_unique(evaluator, stepper.t, q, len(redundant)))
    yield f"constraint forces are not unique in {names}: those of least norm are given, and reactions by them"


def _of_passages(evaluator: Evaluator, stepper: _core.Run) -> Iterator[str]:
    """Yield the note on configurations of the run in which constraints lose rank."""
    if stepper.passages:
        names = (evaluator.description.unknown(index) for _, _, index in stepper.passages)
        yield losses_of_rank(stepper, "constraints", names) + "went on smoothly"
    if stepper.moved:
        samples = "1 sample" if stepper.moved == 1 else f"{stepper.moved} samples"
        yield f"{samples} moved in time from where rank is lost and forces are not determined"


def _of_stiffness(stepper: _core.Run, chosen: Options) -> Iterator[str]:
    """Yield the note that recommends an implicit method."""
    if stepper.stiff:
        yield (
            f"the motion is stiff from t = {stepper.t_stiff:.6g} s on: stability, not accuracy, sets the "
            f"steps of {chosen.method.name}, and an implicit method would take longer ones"
        )


def of_switches(switches: tuple[str, ...], passed: int) -> Iterator[str]:
    """Yield the note on the switching points on which steps ended, with their number."""
    if passed:
        named = (s if len(s) <= _LONGEST else f"in {s.rpartition(' in ')[2]}" for s in switches)
        jumps = "; ".join([*dict.fromkeys(named)][:_SHOWN])
        points = "1 switching point" if passed == 1 else f"{passed} switching points"
        yield f"steps end on {points} ({jumps})"


def notes_on_events(evaluator: Evaluator, stepper: _core.Run) -> Iterator[str]:
    """Yield the notes on the event that ended the run, and on one without a value, which may be missed."""
    if stepper.ended_by >= 0:
        name = evaluator.description.events[stepper.ended_by].name
        yield f"the event {name!r} ended the run at t = {stepper.t:.9g} s"
    if stepper.blind >= 0:
        name = evaluator.description.events[stepper.blind].name
        yield (
            f"the event {name!r} has no finite value near t = {stepper.t_blind:.6g} s, where its expression "
            "is not defined: that it passes its value may have been missed"
        )
