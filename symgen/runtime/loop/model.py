"""A compiled closed loop of a link-joint table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.calls import checked
from symgen.errors import InitialStateError, ModelError
from symgen.runtime import _core
from symgen.runtime.closure.assemblies import assemblies
from symgen.runtime.closure.later import closed_later
from symgen.runtime.closure.start import Closed, close_near, counted
from symgen.runtime.integrate.pace import limited
from symgen.runtime.kernels.arguments import reals
from symgen.runtime.kernels.description import LoopDescription
from symgen.runtime.loop.driven import STAGES, driven, follow, follow_through, followed
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.model.arguments import Poses, Run, takes
from symgen.runtime.model.compiled import degrees
from symgen.runtime.model.model import Model
from symgen.runtime.result.state import AssemblyModes
from symgen.runtime.result.turn import Turn

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Linearisation, Sensitivity
    from symgen.runtime.result.result import Result

Array = NDArray[np.float64]


@checked
class LoopModel(Model):
    """Compiled equations of one closed loop of links, given as a link-joint table.

    Made by :func:`symgen.build`. Parameters that the scene declares tunable can be changed with
    :meth:`with_parameters` without compiling again.
    """

    description: LoopDescription
    MISSING: ClassVar[Mapping[str, str]] = {
        "": "it is a link-joint table, and this analysis is for linkages of points and links"
    }

    _start: Closed | None = None

    @cached_property
    def kernels(self) -> LoopKernels:
        """Its kernels as functions of arrays."""
        return LoopKernels(self.description, self._library, self.given, self._typed)

    def __repr__(self) -> str:
        d = self.description
        return (
            f"<LoopModel {d.name!r}: {' '.join(d.joints)}, {d.coordinates} variables, {self.backend} backend>"
        )

    @property
    def is_driven(self) -> bool:
        """Whether its inputs alone move it; otherwise its motion follows from forces."""
        return not self.description.having("free")

    @property
    def mobility(self) -> tuple[str, ...]:
        """Degrees of freedom and redundant closure equations, a line of text each."""
        d = self.description
        inputs, free, dependent = (len(d.having(role)) for role in ("input", "free", "dependent"))
        return (
            f"{d.coordinates} variables: {inputs} prescribed, {free} free, {dependent} dependent, "
            f"whose screws have rank {d.rank}: {degrees(inputs + free)} of freedom",
            f"redundant: {6 - d.rank} of 6 closure equations" if d.rank < 6 else "redundant: none",
        )

    def closed_start(self) -> Closed:
        """Return the closed pose from which the loop is followed, found once."""
        if self._start is None:
            d = self.description
            t = self.kernels.time_of(d.begin) if d.span else 0.0  # free motion starts at t = 0
            q = np.array(d.start)
            if self.is_changed:
                try:
                    self._start = self._kept_closed() or close_near(self.kernels, t, q)
                except InitialStateError as error:
                    self._start = closed_later(self.kernels, q, (), error)
            else:
                self._start = Closed(t, q, d.rank)
        return self._start

    def _kept_closed(self) -> Closed | None:
        """Follow the closure from the scene's own parameters to these; None where that does not lead here."""
        d, kernels = self.description, self.kernels
        q, t = np.append(d.start, 0.0), 0.0
        own, asked = np.array([p.default for p in d.parameters]), np.array(self.given)
        scale = np.array([d.size if v.is_length else 1.0 for v in d.variables])
        equations = kernels.equations(d.having("dependent"), d.rank)
        for part in STAGES:
            stage = kernels.at((1 - part) * own + part * asked)
            try:
                t = stage.time_of(d.begin) if d.span else 0.0
            except ModelError:
                return None
            if d.balls:  # their angles are read from the table
                equations = stage.equations(d.having("dependent"), d.rank)
            equations.set_parameters(stage.given)
            before = q.copy()
            if equations.close(t, q) != _core.DONE:
                return None
            if np.max(np.abs(q - before)[:-1] / scale) > 1.0:
                return None
        return counted(self.kernels, t, q[:-1])

    def _refused(self, name: str) -> str | None:
        d = self.description
        free = [v.name for v in d.variables if v.role == "free"]
        if name == "simulate" and not free:
            return (
                "it has no free variable: its inputs move it\n"
                "  Evaluate it over its range ('symgen inverse-dynamics SCENE', model.inverse_dynamics()), "
                "or give a variable under loop.free."
            )
        if name == "linearise" and not free:
            return (
                "its inputs prescribe its motion, so that no state is free to deviate\n"
                "  Move a variable from loop.inputs to loop.free to let forces move it."
            )
        if name == "sensitivity" and (free or not d.having("input")):
            return "it moves freely: derivatives are those of loops whose inputs prescribe the motion"
        if name in ("kinematics", "inverse_dynamics") and free:
            return (
                f"it has free variables ({', '.join(free)}): its motion follows from forces\n"
                "  Run it in time ('symgen simulate SCENE', model.simulate()), or make them inputs."
            )
        if name in ("kinematics", "inverse_dynamics") and not d.having("input"):
            return "it has no input: nothing moves. Give one under loop.inputs"
        return super()._refused(name)

    @takes(Poses)
    def _kinematics(self, asked: Poses) -> Turn:
        return self._evaluated(asked, forces=False)

    @takes(Poses)
    def _inverse_dynamics(self, asked: Poses) -> Turn:
        return self._evaluated(asked, forces=True)

    def _evaluated(self, asked: Poses, forces: bool) -> Turn:
        at, over, start, stop = asked.at, asked.over, asked.start, asked.stop
        if over not in (None, "input", "time"):
            raise ModelError(f"expected over to be 'input' or 'time', got {over!r}")
        in_time = over == "time"
        if at is not None:
            if asked.through or not (start is stop is asked.samples is None):
                raise ModelError("give values at which to evaluate the loop, or a range of them, not both")
            values = reals(at, "times" if in_time else "values of the input")
        else:
            ends = (0.0, self.description.t_end) if in_time else self.description.span
            low, high = ends[0] if start is None else start, ends[1] if stop is None else stop
            number = 361 if asked.samples is None else asked.samples
            if not 2 <= number <= 10_000_000:
                raise ModelError(f"expected between 2 and 10 million samples, got {number}")
            if not low < high:
                unit = " s" if in_time else ""
                raise ModelError(f"expected a range with start before stop, got {low:g} to {high:g}{unit}")
            if asked.through:
                if in_time:
                    raise ModelError("through is for a range of the input, not of the time")
                begin = followed(self.kernels, self.closed_start(), low)
                return follow_through(self.kernels, begin, high, number, forces)
            values = np.linspace(low, high, number)
        given = {"times": values} if in_time else {"values": values}
        return follow(self.kernels, self.closed_start(), forces=forces, **given)

    def _assemblies(
        self, at: float | None = None, over: str | None = None
    ) -> AssemblyModes[dict[str, float]]:
        begin = self.closed_start()
        t = begin.t
        if at is not None:
            driven(self.description)
            t = at if over == "time" else self.kernels.time_of(at)
        names = [v.name for v in self.description.variables]
        found = assemblies(self.kernels, t, begin.q)
        poses = (dict(zip(names, q.tolist(), strict=True)) for q in found)
        return AssemblyModes(poses, "closures of loops of joints are searched from many starts")

    def _sensitivity(
        self,
        outputs: Sequence[str],
        parameters: Sequence[str] | None = None,
        at: float | None = None,
        t_eval: ArrayLike | None = None,
    ) -> Sensitivity:
        from symgen.runtime.linearisation.loops import sensitivity
        from symgen.runtime.linearisation.record import at_times

        by = self._differentiated(parameters)
        if not outputs:
            raise ModelError("expected outputs to differentiate, got none")
        kernels = self._tangents("loop_sensitivity", outputs)
        begin = self.closed_start()

        def found(times: Sequence[float]) -> list[Sensitivity]:
            return sensitivity(self.kernels, kernels, begin, times, by)

        return at_times(found, at, t_eval, begin.t)

    def _linearise(self, outputs: Sequence[str] | None = None) -> Linearisation:
        from symgen.runtime.linearisation.free_loops import free_state_space

        d = self.description
        shown = [d.variables[i].name for i in d.having("free")] if outputs is None else outputs
        kernels = self._tangents("loop_linearisation", shown)
        return free_state_space(self.kernels, kernels, self.closed_start())

    def _tangents(self, kind: str, outputs: Sequence[str]) -> LoopKernels:
        """Return the kernels of an analysis by tangents, of each output once."""
        if self._analyses is None:
            raise ModelError(f"{self.name} was made without its scene: build it with symgen.build")
        return LoopKernels(*self._analyses(kind, tuple(dict.fromkeys(outputs))), self.given)

    @takes(Run)
    def _simulate(self, asked: Run) -> Result:
        from symgen.runtime.loop.motion import run

        chosen = asked.options(self.description.t_end, self._type)
        if chosen.stabilisation == "baumgarte":
            raise ModelError("baumgarte is for linkages of points and links: loops take projection, or raw")
        if chosen.method.kind != "explicit":
            raise ModelError(
                f"{chosen.method.name} is for linkages of points and links, not for loops of joints"
            )
        kept_in = asked.keeping()
        with limited(asked.max_wall):
            return run(self.kernels, self.closed_start(), chosen, asked.progress, kept_in, asked.t_eval)
