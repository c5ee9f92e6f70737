"""Compiled equations of motion of a linkage of points and links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import ModelError, check_known
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.causes import cause
from symgen.runtime.integrate.pace import limited
from symgen.runtime.integrate.redundancy import SelfStress
from symgen.runtime.integrate.simulate import run
from symgen.runtime.kernels.arguments import real
from symgen.runtime.model.arguments import LinkageDerivatives, LinkageForces, LinkageRun, Stepping, takes
from symgen.runtime.model.compiled import degrees
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import Accelerations, State, finite, reactions_at
from symgen.runtime.rods.model.linkage import LinkageModel
from symgen.runtime.rods.start import Start, start

if TYPE_CHECKING:
    from symgen.runtime._rhs import Rhs
    from symgen.runtime.linearisation.record import Linearisation, Sensitivity
    from symgen.runtime.linearisation.tangents import LinkageTangents
    from symgen.runtime.result.equilibrium import Equilibrium, Modes
    from symgen.runtime.result.forces import Forces
    from symgen.runtime.rods.stepper import LinkageStepper


@checked
class RodModel(LinkageModel):
    """Compiled equations of motion of a linkage of points and links.

    :func:`symgen.build` returns one. :meth:`~symgen.Model.with_parameters` changes tunable parameters without
    compilation.
    """

    MISSING: ClassVar[Mapping[str, str]] = {"": "it has no elastic links"}

    @property
    def mobility(self) -> tuple[str, ...]:
        """Degrees of freedom at the start, and redundant constraints, as one line of text each."""
        d, redundant = self.description, self.redundant
        freedom = degrees(d.of_points - len(d.constraints) + len(redundant))
        return (
            f"{d.extent}: {freedom} of freedom at the start",
            f"redundant: {', '.join(redundant) or 'none'}",
        )

    def _begun(self) -> Start:
        begun = start(self.evaluator)
        if begun.rank_tolerance != self.description.rank_tolerance:
            self.description = replace(self.description, rank_tolerance=begun.rank_tolerance)
            del self.evaluator
        return begun

    def _refused(self, name: str) -> str | None:
        d, known = self.description, super()._refused(name)
        if self.evaluator.efforts and known:
            return known
        if name in ("equilibrium", "modes") and self._never_rests:
            return self._never_rests
        if name == "modes" and not (d.freedom or d.plane):  # a plane linkage vibrates across its plane, too
            return "constraints and drives hold every freedom: nothing oscillates"
        return known

    @cached_property
    def _never_rests(self) -> str | None:
        """Reason why there is no equilibrium; None if there may be one."""
        from symgen.runtime.rods.equilibrium import never_rests

        return never_rests(self.evaluator)

    @property
    def redundant(self) -> tuple[str, ...]:
        """Labels of the constraints that follow from the others in every pose."""
        return tuple(self.description.labels[i] for i in self._assembled().redundant)

    def _solution(self, t: float, q: Array, u: Array, typed: bool = False) -> tuple[Array, tuple[int, ...]]:
        """Return accelerations and multipliers at a state, and the numbers of those that are not unique.

        Raises ModelError if the state is singular.

        ``typed`` selects the number type of the model, otherwise doubles.
        """
        redundant = self._assembled().redundant
        equations = self.evaluator.equations(len(redundant))
        row = np.concatenate([q, u, [0.0, 0.0]])
        status = equations.check(t, row)
        if known := cause(self.evaluator, t, q, u):
            raise ModelError(f"no finite accelerations at t = {t:g} s: {known.text}\n  {known.remedy}")
        if status != _core.DONE:
            name = "a redundant constraint is independent of the others there"
            if equations.lost == equations.redundant:
                name = f"{self.description.unknown(equations.weakest)} is not independent of the others"
            raise ModelError(
                f"the equations of motion are singular at t = {t:g} s, so accelerations are not "
                f"determined: {name}"
            )
        times = np.array([t])
        work = equations.solutions(times, row[None, :])
        if typed:
            work[0, :-1] = self._in_type(t, q, u, work[0, :-1])
        if not redundant:
            return work[0], ()
        stress = SelfStress(self.evaluator, times, q[None], len(redundant))
        return stress.least_norm(work)[0], stress.not_unique()

    def _accelerations(self, state: State | None = None) -> Accelerations:
        if (counting := self.counting(state)) is not self:
            return counting._accelerations(state)
        d, begin = self.description, self.initial_state() if state is None else state
        at = begin.t, begin.q, begin.u
        work, open_rows = self._solution(*at, typed=True)
        of_points = self.evaluator.blocks("point_accelerations", *at, work)
        points = dict(zip(d.points, of_points["point_accelerations"], strict=True))
        reactions = reactions_at(self.evaluator, *at, work)
        multipliers = dict(zip(d.constraints, work[d.coordinates :].tolist(), strict=False))
        return Accelerations(points, multipliers, reactions, tuple(d.constraints[i] for i in open_rows))

    @property
    def rhs(self) -> Rhs:
        """Right-hand side f(t, y, u) for other solvers: see ``docs/solvers.md``."""
        from symgen.runtime.model.rhs import right_hand_side

        return right_hand_side(self.initial_state(), self.evaluator, len(self.redundant))

    def _record(self, times: ArrayLike, states: ArrayLike, inputs: ArrayLike | None = None) -> Result:
        from symgen.runtime.model.rhs import recorded, rows

        t = rows("times", times, ())
        y = rows("states", states, (len(t), 2 * self.description.coordinates + self.description.windings))
        u = None if inputs is None else rows("inputs", inputs, (len(t), len(self.description.inputs)))
        return recorded(self.evaluator, len(self.redundant), t, y, u, method="external", backend=self.backend)

    def _tangents(
        self, at: State | Equilibrium | None, names: Sequence[str], kind: str = "linearisation"
    ) -> LinkageTangents:
        """Return the linearised motion at a state, with the derivatives of the outputs ``names``.

        At an equilibrium, velocities are zero and the multipliers balance the forces.
        """
        from symgen.runtime.linearisation.tangents import LinkageTangents

        if (counting := self.counting(at)) is not self:
            return counting._tangents(at, names, kind)
        d = self.description
        if at is None or isinstance(at, State):
            state = self.initial_state() if at is None else at
            solution = self._solution(state.t, state.q, state.u)[0][:-1]
        else:
            state, still = at.state, np.zeros(d.coordinates)
            if lacking := [name for name in d.constraints if name not in at.multipliers]:
                raise ModelError(
                    f"{self.name}: expected an equilibrium of this model, got one without the multiplier "
                    f"of constraint {lacking[0]}\n  Give one that equilibrium() of this model returned."
                )
            at_rest = [0.0 for _ in self.evaluator.couples]
            solution = np.concatenate([still, [at.multipliers[name] for name in d.constraints], at_rest])
        by = d.inputs if kind == "linearisation" else tuple(self.parameters)
        kernels = self.analysis(kind, outputs=tuple(names))
        return LinkageTangents(self.evaluator, kernels, by, state, solution, len(self.redundant))

    def _placed(
        self, values: Mapping[str, ArrayLike], rates: Mapping[str, ArrayLike], t: float
    ) -> tuple[Array, Array, Array]:
        from symgen.runtime.linearisation.state_space import derivatives
        from symgen.runtime.linearisation.tangents import LinkageTangents
        from symgen.runtime.rods.following.state_from_coordinates import placed

        d, begin = self.description, self.initial_state()
        places, speeds = (
            {name: real(x, f"{self.name}: {name}") for name, x in numbers.items()}
            for numbers in (values, rates)
        )
        for name in speeds:
            check_known(name, places, f"{self.name}: velocities: no position is given for the coordinate")
        kernels = self.analysis("linearisation", outputs=tuple(derivatives(d, (*places,))))
        unsolved = np.zeros(d.coordinates + len(d.constraints) + len(self.evaluator.couples))

        def at(when: float, q: Array, u: Array) -> LinkageTangents:
            state = self._state(when, q, u)
            return LinkageTangents(self.evaluator, kernels, d.inputs, state, unsolved, len(self.redundant))

        if t == begin.t:
            return placed(at, begin, places, speeds, t, lambda _: {}, ())
        driven = self.constraints()
        angular = [name for name, unit in driven.units().items() if unit == "rad"]
        return placed(at, begin, places, speeds, t, driven.drives, angular)

    def _mass_matrix(self, state: State | None = None, coordinates: Sequence[str] | None = None) -> Array:
        from symgen.runtime.linearisation.state_space import derivatives

        tangents = self._tangents(state, derivatives(self.description, coordinates or ()))
        return tangents.mass if coordinates is None else tangents.mass_matrix(coordinates)

    def _jacobian(self, state: State | None = None) -> Array:
        return self._tangents(state, ()).jacobian

    def _linearise(
        self,
        at: State | Equilibrium | float | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        coordinates: Sequence[str] | None = None,
    ) -> Linearisation:
        from symgen.runtime.linearisation.state_space import derivatives, state_space

        d = self.description
        chosen = d.inputs if inputs is None else tuple(inputs)
        for name in chosen:
            check_known(name, d.inputs, f"{self.name} has no input")
        if isinstance(at, float | int):
            at = self.reached(at)
        names = d.coordinate_outputs if coordinates is None else list(coordinates)
        requested = dict.fromkeys([*derivatives(d, names), *(outputs or ())])
        tangents = self._tangents(at, tuple(requested))
        shown = names if outputs is None else list(outputs)
        values = {name: self.parameters[name] for name in chosen}
        linearisation = state_space(tangents, names, coordinates is not None, values, shown)
        return replace(linearisation, at_equilibrium=at is not None and not isinstance(at, State))

    @takes(LinkageDerivatives)
    def _sensitivity(self, request: LinkageDerivatives) -> Sensitivity:
        from symgen.runtime.rods.model.derivatives import derivatives_by

        return derivatives_by(self, request)

    def reached(self, t: float, begin: State | None = None) -> State:
        """Return the state at a time of the motion that drives determine, or of a run, with its revolutions.

        Parameters
        ----------
        t
            Time [s]; later than that of ``begin``, unless drives alone determine the motion.
        begin
            State from which revolutions are counted; by default the initial one.

        Raises
        ------
        ModelError
            For a time before that of ``begin`` that a run would have to reach.
        SimulationError
            When the time is not reached.
        """
        begin, d = self.initial_state() if begin is None else begin, self.description
        if t == begin.t:
            return begin
        from symgen.runtime.rods.following import reached

        if not (d.freedom or d.states):
            return self._state(t, *reached.by_drives(self.constraints(), begin, t))
        if not t > begin.t:
            raise ModelError(f"expected a time t after {begin.t:g} s, that of the first state, got {t!r}")
        run = LinkageDerivatives(outputs=(), t_end=t).run()
        return self._state(
            t, *reached.by_run(self.counting(begin).evaluator, len(self.redundant), begin, *run)
        )

    def counting(self, at: State | Equilibrium | None) -> RodModel:
        """Return the model whose angles in loads count the revolutions of a state, by default the start."""
        at = self._stored_start().rest if at is None else at
        state = at if at is None or isinstance(at, State) else at.state
        return self if state is None or state.references is None else self._holding(state.references)

    def _holding(self, values: Array) -> RodModel:
        """Return the model with values of the parameters that runs set, references of angles first."""
        evaluator = self.evaluator.holding(values)
        if evaluator is self.evaluator:
            return self
        model = self.with_parameters()
        model._start, model.evaluator = self._assembled(), evaluator
        return model

    @takes(LinkageForces)
    def _inverse_dynamics(self, request: LinkageForces) -> Forces:
        from symgen.runtime.rods.forces.analysis import analyse
        from symgen.runtime.rods.forces.in_space import analyse as analyse_in_space

        begin = self.initial_state() if request.state is None else request.state
        if len(self.description.axes) > 2:
            return analyse_in_space(self.constraints(), begin, len(self.redundant), request)
        return analyse(self.constraints(), self.analysis("forces"), begin, len(self.redundant), request)

    def _equilibrium(
        self, state: State | None = None, at: float | None = None, stable: bool = True
    ) -> Equilibrium:
        from symgen.runtime.rods.equilibrium import at_rest, describe, find
        from symgen.runtime.rods.linear import Statics

        begin, constraints = self.initial_state() if state is None else state, self.constraints()
        when = begin.t if at is None else float(at)
        at_rest(constraints, begin.q, when, drives=True)
        if not (self.description.freedom or self.description.states):
            begin = self.reached(when, begin)
        statics = Statics(constraints, self.analysis("statics"), when, begin.references)
        return describe(statics, *find(statics, statics.pose(begin.q, begin.u), stable))

    def _modes(self, at: Equilibrium | float | None = None) -> Modes:
        from symgen.runtime.result.equilibrium import Equilibrium
        from symgen.runtime.rods.modes import analyse

        about = self.equilibrium() if at is None else at
        if not isinstance(about, Equilibrium):
            raise ModelError(f"expected an Equilibrium of {self.name} for at, got {at!r}")
        return analyse(self.evaluator, about)

    @takes(Stepping)
    def _stepper(self, request: Stepping) -> LinkageStepper:
        from symgen.runtime.rods.stepper import LinkageStepper

        return LinkageStepper(self, request.options(), request.state)

    @takes(LinkageRun)
    def _simulate(self, request: LinkageRun) -> Result:
        chosen = request.options(self.description.t_end, self._type, request.stabilisation_rate, self._series)
        with limited(request.max_wall):
            if request.controlled:
                from symgen.runtime.rods.stepper import controlled_run

                return controlled_run(self, request, chosen)
            tangent = self.analysis("tangent", stepping=True) if chosen.method.needs_tangent else None
            t, y = (0.0, self._stored_start().y) if request.state is None else finite(request.state)
            kernels, redundant = self.counting(request.state).evaluator, self._assembled().redundant
            recorded = (request.keeping(), tangent, request.t_eval, request.state)
            return run(kernels, t, y, redundant, chosen, request.progress, self.number_type, *recorded)
