"""A compiled closed loop of a link-joint table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import CapabilityError, InitialStateError, ModelError, OptionsError, check_known
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.closure.assemblies import search
from symgen.runtime.closure.first_closure_in_range import closed_later
from symgen.runtime.closure.parameter_homotopy import state_at
from symgen.runtime.closure.start import Closed, close_near, counted
from symgen.runtime.integrate.pace import limited
from symgen.runtime.kernels.arguments import real, reals
from symgen.runtime.kernels.loop_description import LoopDescription
from symgen.runtime.loop import motion
from symgen.runtime.loop.driven import STAGES, driven, follow, follow_through, followed, moving_at, not_driven
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.model.arguments import Derivatives, PosesArguments, RunArguments, Stepping, takes
from symgen.runtime.model.compiled import degrees
from symgen.runtime.model.model import Model
from symgen.runtime.result.state import AssemblyModes, State, in_order
from symgen.runtime.result.turn import Turn

if TYPE_CHECKING:
    from symgen.runtime._rhs import Rhs
    from symgen.runtime.kernels.library import Library
    from symgen.runtime.linearisation.record import Linearisation, Sensitivity
    from symgen.runtime.loop.derivatives.tangents import LoopTangents
    from symgen.runtime.loop.many.driven import DrivenLoops
    from symgen.runtime.many.runs import Runs
    from symgen.runtime.result.result import Result

#: Samples of a range, with some 0.7 GB of results.
_MOST_SAMPLES = 1_000_000


@checked
class LoopModel(Model):
    """Compiled equations of one closed loop of links, given as a link-joint table.

    Made by :func:`symgen.build`. Parameters that the scene declares tunable can be changed with
    ``with_parameters`` without compiling again.
    """

    description: LoopDescription
    MISSING: ClassVar[Mapping[str, str]] = {
        "": "it is a link-joint table, and this analysis is for linkages of points and links"
    }

    _start: Closed | None = None
    _motion: motion.LoopStart | None = None

    @cached_property
    def kernels(self) -> LoopKernels:
        """Its kernels as functions of arrays."""
        return LoopKernels(self.description, self.library, self.parameter_values, self.number_type)

    def __repr__(self) -> str:
        d, n = self.description, self.description.coordinates - len(self.description.states)
        return f"<LoopModel {d.name!r}: {' '.join(d.joints)}, {n} variables, {self.backend} backend>"

    @property
    def is_driven(self) -> bool:
        """Whether its inputs alone move it; otherwise its motion follows from forces."""
        return not self.description.having("free")

    @property
    def mobility(self) -> tuple[str, ...]:
        """Degrees of freedom and redundant closure equations, a line of text each."""
        d = self.description
        inputs, free, dependent = (len(d.having(role)) for role in ("input", "free", "dependent"))
        states = f", first-order states: {len(d.states)}" if d.states else ""
        return (
            f"{d.coordinates - len(d.states)} variables: {inputs} prescribed, {free} free, {dependent} "
            f"dependent, whose screws have rank {d.rank}: {degrees(inputs + free)} of freedom{states}",
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
                    self._start = self._followed_start() or close_near(self.kernels, t, q)
                except InitialStateError as error:
                    self._start = closed_later(self.kernels, q, (), error)
            else:
                self._start = Closed(t, q, d.rank)
        return self._start

    def _followed_start(self) -> Closed | None:
        """Follow the closure from the scene's own parameters to these; None where that does not lead here."""
        d, kernels = self.description, self.kernels
        q, t = np.append(d.start, 0.0), 0.0
        defaults, requested = np.array([p.default for p in d.parameters]), np.array(self.parameter_values)
        scale = kernels.scale
        equations = kernels.equations(d.having("dependent"), d.rank)
        for part in STAGES:
            stage = kernels.at((1 - part) * defaults + part * requested)
            try:
                t = stage.time_of(d.begin) if d.span else 0.0
            except ModelError:
                return None
            if d.balls:  # their angles are read from the table
                equations = stage.equations(d.having("dependent"), d.rank)
            equations.set_parameters(stage.parameter_values)
            before = q.copy()
            if equations.close(t, q) != _core.DONE:
                return None
            if np.max(np.abs(q - before)[:-1] / scale) > 1.0:
                return None
        return counted(self.kernels, t, q[:-1])

    def _refused(self, name: str) -> str | None:
        d = self.description
        free = d.having("free")
        if name in ("simulate", "stepper") and not free:
            return (
                "it has no free variable: its inputs move it\n"
                "  Evaluate it over its range ('symgen inverse-dynamics SCENE', model.inverse_dynamics()), "
                "or give a variable under loop.free."
            )
        if name in ("linearise", "mass_matrix") and not free:
            return (
                "its inputs prescribe its motion, so that no state is free to deviate\n"
                "  Move a variable from loop.inputs to loop.free to let forces move it."
            )
        if name in ("kinematics", "inverse_dynamics") and (problem := not_driven(d)):
            return f"it {problem}"
        return super()._refused(name)

    @takes(PosesArguments)
    def _kinematics(self, request: PosesArguments) -> Turn:
        return self._evaluated(request, forces=False)

    @takes(PosesArguments)
    def _inverse_dynamics(self, request: PosesArguments) -> Turn:
        return self._evaluated(request, forces=True)

    def _evaluated(self, request: PosesArguments, forces: bool) -> Turn:
        at, over, start, stop = request.at, request.over, request.start, request.stop
        if over not in (None, "input", "time"):
            raise ModelError(f"expected over to be 'input' or 'time', got {over!r}")
        in_time = over == "time"
        if at is not None:
            if request.through or not (start is stop is request.samples is None):
                raise ModelError("give values at which to evaluate the loop, or a range of them, not both")
            values = reals(at, "times" if in_time else "values of the input")
            if len(values) > _MOST_SAMPLES:
                raise ModelError(f"expected at most 1 million values, got {len(values)}")
        else:
            ends = (0.0, self.description.t_end) if in_time else self.description.span
            low, high = ends[0] if start is None else start, ends[1] if stop is None else stop
            number = 361 if request.samples is None else request.samples
            if not 2 <= number <= _MOST_SAMPLES:
                raise ModelError(f"expected between 2 and 1 million samples, got {number}")
            if not low < high:
                unit = " s" if in_time else ""
                raise ModelError(f"expected a range with start before stop, got {low:g} to {high:g}{unit}")
            if request.through:
                if in_time:
                    raise ModelError("through is for a range of the input, not of the time")
                begin = followed(self.kernels, self.closed_start(), low)
                return follow_through(self.kernels, begin, high, number, forces)
            values = np.linspace(low, high, number)
        coordinate = {"times": values} if in_time else {"values": values}
        return follow(self.kernels, self.closed_start(), forces=forces, **coordinate)

    def _assemblies(
        self, at: float | None = None, over: str | None = None
    ) -> AssemblyModes[dict[str, float]]:
        begin = self.closed_start()
        t = begin.t
        if at is not None:
            driven(self.description)
            t = at if over == "time" else self.kernels.time_of(at)
        joints = [v.name for v in self.description.variables if v.role != "state"]
        closures = np.reshape(search(self.kernels, t, begin.q).closures, (-1, len(begin.q)))
        turning = self.kernels.periodic.copy()
        turning[list(self.kernels.inputs)] = False  # these are as written
        half = np.ceil(np.where(turning, closures, 0.0) / (2 * np.pi) - 0.5)  # angles in (-pi, pi]
        poses = (dict(zip(joints, q, strict=False)) for q in (closures - 2 * np.pi * half).tolist())
        return AssemblyModes(poses, "closures of loops of joints are searched from many starts")

    @takes(Derivatives)
    def _sensitivity(self, request: Derivatives) -> Sensitivity:
        from symgen.runtime.linearisation.record import at_times
        from symgen.runtime.linearisation.sensitivity import at_pose

        at, outputs = request.at, tuple(dict.fromkeys(request.outputs))
        if not outputs:
            raise ModelError("expected outputs to differentiate, got none")
        if not self.is_driven:
            return self._along_run(request, outputs)
        if isinstance(at, State) or request.t_end is not None or request.of_run:
            raise ModelError(
                f"the inputs of {self.name} prescribe its motion, so that there is no run: give a time for "
                "at, or times for t_eval"
            )
        by = self._differentiated(request.parameters)
        tangents = self._tangents("loop_sensitivity", outputs)
        first = self.closed_start()

        def derivatives(times: Sequence[float]) -> list[Sensitivity]:
            begin, results = first, []
            for t in times:
                q, u = moving_at(self.kernels, begin, t)[: 2 * len(begin.q)].reshape(2, -1)
                results.append(at_pose(tangents(self._as_state(t, q, u)), outputs, by, ()))
                begin = Closed(t, q.copy(), begin.rank)
            return results

        t = None if at is None else real(at, "the time of derivatives")
        return at_times(derivatives, t, request.t_eval, first.t)

    def _along_run(self, request: Derivatives, outputs: tuple[str, ...]) -> Sensitivity:
        """Return derivatives along a run under forces; without an end those at the state."""
        from symgen.runtime.linearisation.runs import at_run, of_run
        from symgen.runtime.linearisation.sensitivity import at_pose
        from symgen.runtime.linearisation.steps import resolved
        from symgen.runtime.loop.derivatives.runs import LoopSteps, follow

        rank = self.closed_start().rank
        if request.at is not None and not isinstance(request.at, State):
            raise OptionsError(f"{self.name} moves freely: give {{t_end}} or {{t_eval}} for derivatives")
        start = self.initial_state() if request.at is None else request.at
        free = self._free_names
        by = self._differentiated(request.parameters, [*free, *(f"{name}'" for name in free)])
        free = [*free, *self.description.integrals]
        tangents = self._tangents("loop_linearisation", outputs)
        at_start = tangents(start)
        if not request.along:
            return at_pose(at_start, outputs, by, free)
        times, chosen = request.run()
        steps = LoopSteps(self.kernels, self._kernels_of("loop_variation", (), True), rank, chosen.method)
        return of_run(
            chosen, lambda of: resolved(follow(self.kernels, rank, start, of, times), steps, of),
            lambda path: at_run(path, lambda s, _: tangents(s), steps, outputs, by, free))  # fmt: skip

    @property
    def _free_names(self) -> list[str]:
        return [self.description.variables[i].name for i in self.description.having("free")]

    def state(
        self,
        values: Mapping[str, float] | None = None,
        rates: Mapping[str, float] | None = None,
        t: float = 0.0,
        *,
        states: Mapping[str, float] | None = None,
    ) -> State:
        """Return a closed state from values [rad, m] and rates of joint variables, and first-order states.

        Omitted free variables and states keep their values at the start, variables with zero rate. The loop
        is followed from its start to the given values, so that it stays on its assembly branch. If dependent
        variables are given, the loop is closed near their values, and near those of the others at the start.

        Raises
        ------
        ModelError
            For an unknown name, a rate of a variable that is not free, and values that are not finite.
        SimulationError
            When the loop does not close at these values, or cannot be followed to them.
        """
        return self._as_state(*state_at(self.kernels, self.closed_start(), values, rates, states, t))

    def initial_state(self) -> State:
        """Return the state in which the loop starts; raise InitialStateError when it cannot be assembled."""
        begin = self.closed_start()
        return self._as_state(begin.t, begin.q, motion.rates_at_start(self.kernels, begin))

    def _as_state(self, t: float, q: Array, u: Array) -> State:
        names = [v.name for v in self.description.variables]
        values, rates = (dict(zip(names, map(np.asarray, x), strict=True)) for x in (q, u))
        return State(t, q.copy(), u.copy(), values, rates)

    def _coordinates(self, y: State | ArrayLike, t: ArrayLike = 0.0) -> dict[str, Any]:
        d = self.description
        found = in_order([v.name for v in d.variables], y, t).items()
        return {name.removesuffix(".integral'"): x for name, x in found if name not in d.integrals}

    @property
    def rhs(self) -> Rhs:
        """Right-hand side f(t, y, u) of y = (joint variables, rates): see ``docs/solvers.md``."""
        from symgen.runtime._rhs import Rhs

        if (reason := self._refused("linearise")) is not None:
            raise CapabilityError(f"{self.name} does not support rhs: {reason}")
        d, begin = self.description, self.closed_start()
        equations = self.kernels.equations(d.dynamic, begin.rank, work_of_loads=False)
        begin_at = len(d.tunable) - len(d.inputs)
        return Rhs(equations, self.initial_state(), lambda x: np.concatenate([x.q, x.u]), d.inputs, begin_at)

    def _jacobian(self, state: State | None = None) -> Array:
        at = self.initial_state() if state is None else state
        return self.kernels("position", at.t, at.q, at.u)["closure_jacobian"]

    def _mass_matrix(self, state: State | None = None, coordinates: Sequence[str] | None = None) -> Array:
        names = self._free_names if coordinates is None else list(coordinates)
        return self._linearised(state, (), names).mass_matrix(names)

    def _linearise(
        self,
        at: State | float | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        coordinates: Sequence[str] | None = None,
    ) -> Linearisation:
        from symgen.runtime.linearisation.state_space import state_space

        d = self.description
        chosen = d.inputs if inputs is None else tuple(inputs)
        for name in chosen:
            check_known(name, d.inputs, f"{self.name} has no input")
        names = self._free_names if coordinates is None else list(coordinates)
        shown = tuple(dict.fromkeys(names if outputs is None else outputs))
        values = {name: self.parameters[name] for name in chosen}
        return state_space(self._linearised(at, shown, names), names, True, values, shown)

    def _linearised(
        self, at: State | float | None, outputs: Sequence[str], coordinates: Sequence[str]
    ) -> LoopTangents:
        """Return the tangents at a state, at a time of the run from the start [s], or at the start."""
        d = self.description
        known = [d.variables[i].name for i in d.having("free", "dependent")]
        for name in coordinates:
            check_known(name, known, f"{self.name}: there is no joint variable that is not prescribed")
        if isinstance(at, State):
            state = at
        elif at is None or at == 0.0:
            state = self.initial_state()
        else:
            reached = self.simulate(at, samples=2).final
            q, u = (np.array([reached[v.name][x] for v in d.variables]) for x in ("value", "rate"))
            state = self._as_state(at, q, u)
        return self._tangents("loop_linearisation", outputs)(state)

    def _tangents(self, kind: str, outputs: Sequence[str]) -> Callable[[State], LoopTangents]:
        """Return the linearised motion at states, by the kernels of an analysis, of each output once."""
        from symgen.runtime.loop.derivatives.tangents import LoopTangents

        kernels = LoopKernels(*self._kernels_of(kind, tuple(outputs)), self.parameter_values)
        return lambda state: LoopTangents(self.kernels, kernels, state)

    def _kernels_of(
        self, kind: str, outputs: tuple[str, ...], lanes: bool = False
    ) -> tuple[LoopDescription, Library]:
        """Return the kernels of an analysis; in ``lanes`` compiled ones take vectors."""
        if self._analyses is None:
            raise ModelError(f"{self.name} was created without its scene: build it with symgen.build")
        return self._analyses(kind, outputs, lanes)

    @property
    def _probed(self) -> bool:  # type: ignore[override]
        return bool(self.description.switches) and not self.description.series_watched

    @takes(RunArguments)
    def _simulate(self, request: RunArguments) -> Result:
        chosen = motion.of_loops(request.options(self.description.t_end, self._type, series=self._series))
        if chosen.stabilisation == "baumgarte":
            raise ModelError("baumgarte is for linkages of points and links: loops take projection, or raw")
        with limited(request.max_wall):
            if request.controlled:
                return motion.controlled_run(self, request, chosen)
            start, keeping = self._begun(request.state), request.keeping()
            return motion.run(self.kernels, start, chosen, request.progress, keeping, request.t_eval)

    def _begun(self, state: State | None) -> motion.LoopStart:
        """Return the start of a motion; that of the scene is found once."""
        from symgen.runtime.loop.derivatives.tangents import check_closed

        begin = self.closed_start()
        if state is not None:
            check_closed(self.kernels, state)
            return motion.start_at(self.kernels, Closed(state.t, state.q.copy(), begin.rank), state.u)
        if self._motion is None:
            rates = np.array([v.start_rate for v in self.description.variables])
            self._motion = motion.start_at(self.kernels, begin, rates)
        return self._motion

    @takes(Stepping)
    def _stepper(self, request: Stepping) -> motion.LoopStepper:
        return motion.LoopStepper(self, motion.of_loops(request.options()), request.state)

    def _compiled_runs(self, runs: Runs, first: Any) -> DrivenLoops | str:
        from symgen.runtime.loop.many.driven import driven_loops

        if first.KIND == Turn.KIND:
            return driven_loops(self, first, runs.columns) or ""
        return "loops of joints under forces have none" if runs.analysis == "simulate" else ""
