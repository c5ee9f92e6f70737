"""A compiled linkage with elastic links in space, and its runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from symgen.calls import checked
from symgen.errors import ModelError, SimulationError
from symgen.runtime.elastic.control.run import controlled_run
from symgen.runtime.elastic.control.stepper import SystemStepper, stepper
from symgen.runtime.elastic.large.collocation import MotionState, stacked
from symgen.runtime.elastic.large.passes import LargeMotion, refined_run
from symgen.runtime.elastic.model import ModelOfRigid
from symgen.runtime.elastic.space.initial import initial
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.outputs import outputs
from symgen.runtime.integrate.options import end_of_scene, initial_state
from symgen.runtime.integrate.pace import limited
from symgen.runtime.kernels.arguments import real
from symgen.runtime.model.arguments import takes
from symgen.runtime.model.elastic_arguments import RunInSpace, SystemStepping
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.modes import ElasticModes
from symgen.runtime.result.records import Variable, over_time
from symgen.runtime.result.state import State

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Sensitivity
    from symgen.runtime.result.equilibrium import Equilibrium, Modes

#: What runs report as their form.
_FORM = "elements in space"
#: Steps of a run to start with.
_STEPS = 64
#: Axial strain from which on stress in proportion to strain is no model of a link.
_STRAIN = 0.1


@checked
class SpatialModel(ModelOfRigid):
    """A linkage in space with elastic links between ball joints.

    Made by :func:`symgen.build`.
    """

    MISSING: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("", "batch"),
        "its elastic links are in space, whose motion, equilibrium, modes and derivatives alone are computed",
    )

    def with_parameters(self, /, **values: float) -> Self:
        """Return the same model with other values of its tunable parameters, in SI units."""
        return type(self)(self.rigid.with_parameters(**values))

    def initial_state(self) -> State:
        """Return the start of the linkage with all links rigid."""
        return self.rigid.initial_state()

    def __repr__(self) -> str:
        links = ", ".join(b.link for b in self.rigid.description.elastic.beams)  # type: ignore[union-attr]
        return f"<SpatialModel {self.name!r}: {links} elastic>"

    def _refused(self, name: str) -> str | None:
        from symgen.runtime.rods.equilibrium import never_rests

        refused = super()._refused(name)
        return never_rests(self.rigid.evaluator) if name == "equilibrium" and not refused else refused

    def _equilibrium(self, at: float | None = None, stable: bool = True) -> Equilibrium:
        from symgen.runtime.elastic.large.statics import described, resting
        from symgen.runtime.rods.equilibrium import at_rest

        self._refuse_types("equilibria of elastic links in space are")
        t = 0.0 if at is None else real(at, "the time")
        at_rest(self.rigid.constraints(), self.rigid._stored_start().q, t)
        linkage = LinkageInSpace(self.rigid)
        moment, of = resting(linkage, t, stable)
        _, q, v, a, _ = stacked([moment])
        forces = [force for link in linkage.links for force in link.forces(q, v, a).values()]
        return described(linkage, moment, of, forces, self._outputs(linkage, [moment]), {})

    def _modes(self, at: Equilibrium | float | None = None) -> Modes | ElasticModes:
        from symgen.runtime.elastic.space.modes import modes_in_space
        from symgen.runtime.result.equilibrium import Equilibrium
        from symgen.runtime.rods.modes import analyse

        self._refuse_types("modes of elastic links in space are")
        if self.description.states and not isinstance(at, Equilibrium):
            at = self._equilibrium(at)
        if isinstance(at, Equilibrium):
            return analyse(self.rigid.evaluator, at)
        return modes_in_space(self.rigid, 0.0 if at is None else real(at, "the time of the pose"))

    def _sensitivity(
        self,
        outputs: Sequence[str],
        parameters: Sequence[str] | None = None,
        at: ElasticResult | float | None = None,
        coordinates: Sequence[str] = (),
    ) -> Sensitivity:
        from symgen.runtime.elastic.space.sensitivity import of_frequencies, of_run

        by = self._differentiated(parameters)
        if at is not None and not isinstance(at, float | int):
            provenance = getattr(at, "provenance", {})
            if provenance.get("form") != _FORM or provenance["parameters"] != dict(self.parameters):
                raise ModelError(f"{self.name}: expected a run of this model for at: model.simulate()")
            if not outputs:
                raise ModelError("expected outputs to differentiate, got none")
            if not at.statistics["steps"]:
                raise ModelError(f"{self.name}: expected a whole run for at, got one that max_wall ended")
            if provenance["initial"] != "undeformed":
                raise ModelError("derivatives of runs of elastic links are for those that start undeformed")
            steps = at.statistics["steps"] // (len(at.time) - 1)
            return of_run(self.rigid, outputs, by, coordinates, at.time, steps)
        if [*outputs] != ["frequencies"]:
            raise ModelError(
                f"{self.name}: expected frequencies in a pose, got {', '.join(outputs) or 'no outputs'}\n"
                "  Other outputs are those of a run: give at = model.simulate()."
            )
        if self.description.states:
            raise ModelError(
                f"{self.name}: frequencies of a scene with [states] have no derivatives\n"
                "  Outputs of a run have: give at = model.simulate()."
            )
        return of_frequencies(self.rigid, by, coordinates, 0.0 if at is None else real(at, "the time"))

    @takes(RunInSpace)
    def _simulate(self, request: RunInSpace) -> ElasticResult:
        self._refuse_types("runs of elastic links in space are")
        d, state = self.rigid.description, initial_state(request.initial)
        end = end_of_scene(d.t_end) if request.t_end is None else real(request.t_end, "t_end")
        if not end > 0.0:
            raise ModelError(f"expected t_end above zero, got {end!r}")
        with limited(request.max_wall):
            if request.controlled:
                return controlled_run(self, request, partial(self._large, state), end)
            try:
                return refined_run(self._large(state), request, end, _STEPS)
            except SimulationError as error:
                if error.partial is not None:
                    raise
                raise SimulationError(f"{error}{self._dead_centre(error.time)}", time=error.time) from None

    @takes(SystemStepping)
    def _stepper(self, request: SystemStepping) -> SystemStepper:
        return stepper(self, request, partial(self._large, "undeformed"))

    def _large(self, state: str | tuple[float, ...]) -> LargeMotion:
        linkage = LinkageInSpace(self.rigid)
        return LargeMotion(
            self.rigid,
            linkage,
            partial(LinkageInSpace, self.rigid, divided=2),
            self._outputs,
            over_time,
            max(link.modulus for link in linkage.links),
            _FORM,
            start=partial(initial, state=state),
            initial=state,
        )

    def _outputs(self, linkage: LinkageInSpace, moments: Sequence[MotionState]) -> list[Variable]:
        """Return the outputs, without places of points at rest unless the scene selects them.

        Raises
        ------
        SimulationError
            Where an axial strain is beyond linear elasticity.
        """
        d = self.rigid.description
        still = {f"{p}.position" for p in d.ground if p in d.steady}
        still -= {*((d.elastic and d.elastic.outputs) or ())}
        variables = [v for v in outputs(linkage, moments) if v.name not in still]
        for variable in (v for v in variables if v.name.endswith(".axial_strain")):
            beyond = np.flatnonzero(~(np.abs(variable.values) <= _STRAIN))
            if len(beyond):
                t, strain = moments[beyond[0]].t, variable.values[beyond[0]]
                raise SimulationError(
                    f"{self.name}: expected {variable.name} of at most {_STRAIN:g}, beyond which linear "
                    f"elasticity does not hold, got {strain:.3g} at t = {t:.6g} s",
                    time=t,
                )
        return variables

    def _dead_centre(self, t: float) -> str:
        """Return a line on the dead centre that the linkage with rigid links comes to before a time [s]."""
        if "kinematics" in self.rigid.capabilities:
            try:
                self.rigid.simulate(t, samples=2)
            except SimulationError as error:
                return (
                    f"\n  With rigid links it comes to a dead centre at t = {error.time:.6g} s, beyond which "
                    "its input cannot move it: change the lengths, or end the run before."
                )
        return ""
