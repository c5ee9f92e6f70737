"""Results of a run, with samples in other angles of ball joints: their outputs in the table's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.closure.mobility import scaled_screws
from symgen.runtime.closure.redundancy import Mask, note, ranges_of, undetermined
from symgen.runtime.loop.frames import product, transforms
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.loop.near_singular import CLOSED, REPORTED
from symgen.runtime.result.recording import RunRecording, grouped, losses_of_rank, of_switches
from symgen.runtime.result.records import Variable
from symgen.runtime.result.turn import variables

if TYPE_CHECKING:
    from symgen.runtime.integrate.controller import Controller

#: Names of the axes of vectors.
AXES = ("x", "y", "z")

#: Sine of the angle from a pole below which rates of the table's own angles have no digits.
_AT_POLE = 1e-6
_SHOWN = 6


@dataclass(frozen=True, slots=True)
class SampleGroup:
    """Samples in the same angles: their numbers, the kernels and equations in these, states and solutions."""

    rows: Indices
    turned: bool
    kernels: LoopKernels
    times: Array
    states: Array
    solutions: Array


class LoopSamples:
    """Samples of a run.

    Parameters
    ----------
    solver
        Equations in double precision, as states are recorded, for all variables that a motion solves for.
    states
        A row each, q and u first and one number more than the run has, in the angles in use.
    turns
        The turns in front of the balls at each sample.
    table
        The variables at each sample in the angles of the table; empty without balls that have others.
    held
        Tunable parameters at each sample; by default those of the kernels.
    """

    def __init__(
        self,
        kernels: LoopKernels,
        solver: _loop.LoopEquations,
        times: Array,
        states: Array,
        turns: Array,
        table: Array,
        held: Array | None = None,
    ) -> None:
        self.kernels, self.times, self.states, self.turns, self.table = kernels, times, states, turns, table
        self._held = kernels.parameter_values[: len(kernels.description.tunable)] if held is None else held
        self._solver = solver

    @cached_property
    def parts(self) -> tuple[SampleGroup, ...]:
        """The samples by the angles they are recorded in."""
        parts, count = [], len(self.times)
        values = np.hstack([np.broadcast_to(self._held, (count, self._held.shape[-1])), self.turns])
        for parameters, rows in grouped(self.kernels.parameter_values, 0, values):
            self._solver.set_parameters(parameters)
            times, states = self.times[rows], self.states[rows]
            solutions = self._solver.solutions(times, states)
            turned = bool(self.turns[rows].any())
            parts.append(SampleGroup(rows, turned, self.kernels.at(parameters), times, states, solutions))
        return tuple(parts)

    def outputs(self) -> Array:
        """Return the kernel 'outputs' at every sample, angles of balls as in the table."""
        d = self.kernels.description
        n, info = d.coordinates, d.kernel("outputs")
        out = np.zeros((len(self.times), (info.out_size if info else 0) + 1))
        if info is None:
            return out
        for part in self.parts:
            work = np.zeros((len(part.rows), self.kernels.work_size + 1))
            work[:, : n + 6] = part.solutions[:, : n + 6]
            out[part.rows] = part.kernels.rows("outputs", part.times, part.states, work)
            if part.turned:
                self._rewrite(part, out)
        return out

    def _rewrite(self, part: SampleGroup, out: Array) -> None:
        """Write angles of balls, their rates, and wrenches in frames that spin idly, as in the table."""
        d, table = self.kernels.description, self.table[part.rows]
        u, a = self._moving(part, table)
        blind = self._blind(table)
        u[blind] = a[blind] = np.nan
        values, frames = {"": table, "rate": u, "acceleration": a}, self._frames(part, table)
        numbers = {d.variables[j].name: j for ball in d.balls for j in ball.angles if j >= 0}
        info = d.kernel("outputs")
        for block in info.blocks if info else ():
            name, _, word = block.name.partition(".")
            if name in numbers:
                out[part.rows, block.offset] = values[word][:, numbers[name]] if word in values else np.nan
            for at, turned in frames.items():
                if block.name.endswith((f".{at}.force", f".{at}.moment")):
                    entries = slice(block.offset, block.offset + 3)
                    out[part.rows, entries] = np.einsum("sij,sj->si", turned, out[part.rows, entries])

    def _moving(self, part: SampleGroup, table: Array) -> tuple[Array, Array]:
        """Return rates and accelerations in the table's angles: the motion across a ball is the same."""
        n = self.kernels.description.coordinates
        q, old_u, old_a = part.states[:, :n], part.states[:, n : 2 * n], part.solutions[:, :n]
        u, a = old_u.copy(), old_a.copy()
        old, new = _screws(part.kernels, part.times, q), _screws(self.kernels, part.times, table)
        motion = old * old_u[:, None]
        second = old * old_a[:, None] + _screw_rates(old, old_u) * old_u[:, None]
        for g in self._joined:
            inverse = np.linalg.pinv(new[:, :, g])
            u[:, g] = np.sum(inverse * np.sum(motion[:, :, g], axis=2)[:, None], axis=2)
            rest = second - _screw_rates(new, u) * u[:, None]
            a[:, g] = np.sum(inverse * np.sum(rest[:, :, g], axis=2)[:, None], axis=2)
        return u, a

    @cached_property
    def _joined(self) -> list[list[int]]:
        """Angles of every ball; those of one with a constant alpha together with those of the next."""
        groups: list[list[int]] = [[]]
        for ball in self.kernels.description.balls:
            groups[-1] += [j for j in ball.angles if j >= 0]
            if ball.angles[2] >= 0:
                groups.append([])
        return groups[:-1]

    def _blind(self, table: Array) -> NDArray[np.bool_]:
        """Return whether the rate of a variable has no digits in the table's own angles, shaped as these."""
        balls, blind = self.kernels.description.balls, np.zeros(table.shape, dtype=bool)
        for k, ball in enumerate(balls):
            numbers = ball.angles if ball.angles[2] >= 0 else (*ball.angles[:2], *balls[k + 1].angles)
            blind[:, numbers] |= (np.abs(np.cos(table[:, ball.angles[1]])) < _AT_POLE)[:, None]
        return blind

    def _frames(self, part: SampleGroup, table: Array) -> dict[str, Array]:
        """Return by joint how the frames of a link that spins idly stand, in those of the table's own angles.

        The wrench of the ball behind that link is given in its frame.
        """
        by_ball = {}
        for ball, turn in zip(self.kernels.description.balls, self.turns[part.rows[0]], strict=True):
            if turn and ball.angles[2] < 0:
                rows = np.zeros((2, len(table), 5))
                rows[..., (0, 2)] = [x[:, ball.angles[:2]] for x in (table, part.states)]
                in_table, used = transforms(rows)[..., :3, :3]
                ahead = product([np.array([0.0, 0.0, 0.0, turn, 0.0])])[:3, :3]
                by_ball[f"joint{ball.row + 2}"] = np.swapaxes(in_table, 1, 2) @ ahead @ used
        return by_ball

    def notes(self) -> Iterator[str]:
        """Say at which samples angles have a pole."""
        blind = self._blind(self.table) & np.any(self.turns, axis=1, keepdims=True)
        at = self.times[np.any(blind, axis=1)]
        if len(at):
            variables = self.kernels.description.variables
            names = ", ".join(variables[j].name for j in np.flatnonzero(np.any(blind, axis=0)))
            times = ", ".join(f"{t:.9g}" for t in at[:_SHOWN]) + (", ..." if len(at) > _SHOWN else "")
            yield (
                f"at the samples t = {times} s the angles of a ball joint have a pole, which is no "
                f"singularity of the loop: {names} are split there as before, and their rates and "
                "accelerations left open"
            )

    def undetermined(self) -> dict[str, Mask]:
        """Return which entries of the outputs redundant closure leaves undetermined, at all samples."""
        masks: dict[str, Mask] = {}
        for part in self.parts:
            for name, mask in undetermined(part.kernels, part.times, part.states).items():
                masks.setdefault(name, np.zeros((len(self.times), mask.shape[1]), dtype=bool))[part.rows] = (
                    mask
                )
        return masks


def _screws(kernels: LoopKernels, times: Array, q: Array) -> Array:
    """Return the screws of all variables, shape (poses, 6, variables), in rad and sizes of the loop."""
    work = np.zeros((len(times), kernels.work_size + 1))
    states = np.column_stack([q, np.zeros((len(q), q.shape[1] + 1))])
    screws = kernels.many("position", times, states, work)["closure_jacobian"].reshape(len(q), 6, -1)
    return np.asarray(screws / np.repeat([1.0, kernels.description.size], 3)[:, None])


def _screw_rates(screws: Array, u: Array) -> Array:
    """Return the rates of these screws: every axis moves with the variables before it, in their order."""
    moved = screws * u[:, None, :]
    (w, v), (a, b) = np.split(np.cumsum(moved, axis=2) - moved, 2, axis=1), np.split(screws, 2, axis=1)
    parts = np.cross(w, a, axis=1), np.cross(v, a, axis=1) + np.cross(w, b, axis=1)
    return np.concatenate(parts, axis=1)


@dataclass
class LoopRecording(RunRecording):
    """A run of a loop under forces."""

    kernels: LoopKernels
    equations: _loop.LoopEquations
    controls: Controller | None = None

    @cached_property
    def _samples(self) -> LoopSamples:
        run = self.stepper
        rows = np.append(run.result, np.zeros((len(run.sampled), 1)), axis=1)
        held = None if self.controls is None else self.controls.held(run)
        solver = self.kernels.equations(self.kernels.solved, self.equations.rank)
        return LoopSamples(self.kernels, solver, run.sampled, rows, run.references, run.turns, held)

    @cached_property
    def _variables(self) -> tuple[Variable, ...]:
        return tuple(variables(self.kernels.description, self._samples.outputs()))

    @cached_property
    def _undetermined(self) -> dict[str, list[list[int]]]:
        return ranges_of(self._variables, masks) if (masks := self._samples.undetermined()) else {}

    def axes(self) -> tuple[str, ...]:
        """Return the names of the axes."""
        return AXES

    def variables(self) -> tuple[Variable, ...]:
        """Return the scene's outputs at the recorded times."""
        return self._variables

    def final(self) -> dict[str, dict[str, Any]]:
        """Return value and rate of all variables at the end, in the angles of the record."""
        d, run = self.kernels.description, self.stepper
        state, last = run.state.tolist(), dict[str, float]()
        in_other_angles = run.recorded and run.sampled[-1] == run.t and np.any(run.references[-1])
        if in_other_angles:
            last = {x.name: float(x.values[-1]) for x in self._variables if not x.components}
        rows = zip(d.variables, state, state[d.coordinates :], strict=False)
        return {
            v.name: {
                "value": last.get(v.name, q),
                "rate": last.get(f"{v.name}.rate", u),
                "unit": v.unit,
            }
            for v, q, u in rows
        }

    def statistics(self) -> dict[str, Any]:
        """Return counts, components of forces that are undetermined, the last time and the wall time [s]."""
        return {**super().statistics(), "undetermined": self._undetermined}

    def notes(self) -> tuple[str, ...]:
        """Return the notes on the run: losses of rank, poles of angles, redundant closure, jumps of loads."""
        d, samples = self.kernels.description, self._samples
        return (
            *([self.controls.note] if self.controls else []),
            *_of_passages(self.stepper, samples),
            *samples.notes(),
            *note(self.kernels, self._undetermined, len(samples.times)),
            *of_switches(d.switches, self.stepper.switchings),
        )


def _of_passages(stepper: _core.Run, samples: LoopSamples) -> Iterator[str]:
    """Say where the run passed change points, and which samples are so near that forces lose digits."""
    if not stepper.passages:
        return
    d = samples.kernels.description
    yield losses_of_rank(stepper, "screws", (d.variables[k].name for _, _, k in stepper.passages)) + (
        f"continued smoothly; rounding errors are magnified there (energy drift {stepper.energy_drift:.1e} J)"
    )
    solved = [*d.having("dependent"), *d.having("free")]
    sound = np.ones(len(samples.times))
    for part in samples.parts:
        for i, t, row in zip(part.rows, part.times, part.states, strict=True):
            values = np.linalg.svd(scaled_screws(part.kernels, t, row[: d.coordinates])[:, solved])[1]
            sound[i] = values[d.rank - 1] / values[0]
    errors = CLOSED / np.maximum(sound, 1e-100) ** 3
    if np.max(errors, initial=0.0) > REPORTED:
        near = ", ".join(f"{t:.9g}" for t in stepper.sampled[errors > REPORTED][:_SHOWN])
        yield (
            f"at the samples t = {near} s near such a loss of rank rounding limits accelerations and forces: "
            f"relative error up to {min(1.0, float(np.max(errors))):.0e}"
        )
