"""A compiled linkage with elastic links."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import ModelError, OptionsError, check_known, nearest
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import BEAM_METHODS
from symgen.runtime.elastic.path import PRESCRIBED
from symgen.runtime.integrate.checkpoint import CheckpointOptions
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.integrate.options import initial_state, sample_count
from symgen.runtime.integrate.pace import Progress, limited, uncounted
from symgen.runtime.kernels.arguments import real, reals
from symgen.runtime.kernels.description import Description
from symgen.runtime.model.arguments import takes
from symgen.runtime.model.elastic_arguments import (
    ElasticArguments,
    ElasticRun,
    ElasticStepping,
    LargeRotation,
    Periodic,
    QuasiStatic,
)
from symgen.runtime.model.model import Model

if TYPE_CHECKING:
    from symgen.runtime.beams.layout import BeamLayout
    from symgen.runtime.beams.links import Beam
    from symgen.runtime.elastic.control.stepper import SystemStepper
    from symgen.runtime.elastic.motion import ElasticMotion
    from symgen.runtime.linearisation.record import Sensitivity
    from symgen.runtime.result.elastic import ElasticResult
    from symgen.runtime.result.equilibrium import Equilibrium, Modes
    from symgen.runtime.result.modes import AssembledMatrices, ElasticModes
    from symgen.runtime.result.records import Variable
    from symgen.runtime.result.speed_response import SpeedResponse
    from symgen.runtime.rods.model.rods import RodModel

#: Integration methods of elastic motions.
METHODS = (*BEAM_METHODS, "dop853", "rk4")
FORMS = ("exact", "thesis")
#: Error over the peak stress, if none is given.
_RTOL = 1e-4
#: Elements of a link in large rotation, where none are given.
_ELEMENTS = 4


#: Analyses by linear theory alone.
_LINEAR = ("periodic", "quasi_static", "speed_response", "sensitivity")


#: Returns the linkage with rigid links, its crank turned by its motor.
WithMotor = Callable[[], "RodModel"]


class ModelOfRigid(Model):
    """A linkage with elastic links, about ``rigid``, the linkage that it is with all links rigid."""

    def __init__(self, rigid: RodModel) -> None:
        parts = rigid.description, rigid.library, rigid._derive, rigid.parameters
        super().__init__(*parts, typed=rigid.number_type)
        self.rigid = rigid

    @property
    def source(self) -> Any:
        """Scene and options of the build."""
        return replace(self.rigid.source, rigid=False)

    @property
    def redundant(self) -> tuple[str, ...]:
        """Constraints of the rigid motion that others imply."""
        return self.rigid.redundant

    @property
    def mobility(self) -> tuple[str, ...]:
        """Freedoms of the rigid motion, as one line of text each."""
        return self.rigid.mobility


@checked
class ElasticModel(ModelOfRigid):
    """A planar linkage some of whose links bend, moving about the motion it would have if all were rigid.

    Made by :func:`symgen.build`. ``rigid`` is that linkage, its crank driven: a :class:`RodModel`.
    """

    description: Description
    MISSING: ClassVar[Mapping[str, str]] = {
        "": "it has elastic links; model.rigid, the rigid linkage, has this analysis",
        "linearise": "it has elastic links; model.modes(model.equilibrium()) has the eigenvalues at rest",
    }

    def __init__(self, rigid: RodModel, with_motor: WithMotor | None = None) -> None:
        super().__init__(rigid)
        self._with_motor = with_motor
        #: The motion about the rigid one, with or without geometric stiffness.
        self.motion = cache(self._new_motion)

    def _new_motion(self, geometric_stiffness: bool) -> ElasticMotion:
        from symgen.runtime.elastic.mesh import MeshedMotion  # it loads SciPy

        return MeshedMotion(self.rigid, geometric_stiffness, self._turned_by_motor)

    def _turned_by_motor(self) -> RodModel:
        """Return the rigid linkage with its motor in place of the drive of the crank."""
        self._refuse_types("motions of a crank with a motor are")
        if self._with_motor is None:
            raise ModelError(f"{self.name} was created without its scene: build it with symgen.build")
        with uncounted():
            return self._with_motor().with_parameters(**self.parameters)

    def __repr__(self) -> str:
        motion = self.motion(True)
        links = ", ".join(b.info.link for b in motion.beams)
        return f"<ElasticModel {self.name!r}: {links} elastic, {self.unknowns} unknowns>"

    #: An elastic motion is found in time.
    is_driven = False

    @property
    def beams(self) -> tuple[Beam, ...]:
        """The elastic links, with their constant matrices."""
        return self.motion(True).beams

    @property
    def unknowns(self) -> int:
        """Number of unknowns of the elastic motion, those that constraints leave."""
        return self.layout.unknowns - self.layout.constraints - len(self.description.states)

    @property
    def layout(self) -> BeamLayout:
        """Index arrays of the matrices of the elastic motion."""
        return self.motion(True).layout

    @property
    def crank_speed(self) -> float:
        """Angular velocity of the crank [rad/s], at the start if it has a motor or is free."""
        return self.motion(True).speed

    @property
    def lowest_frequency(self) -> float:
        """The lowest frequency [Hz] of the structure at rest, over the poses of a revolution."""
        return self.motion(True).lowest_frequency

    @property
    def mobility(self) -> tuple[str, ...]:
        """Freedoms of the rigid motion, and unknowns of every elastic link, as one line of text each."""
        lines = [*self.rigid.mobility]
        for beam in self.beams:
            info = beam.info
            count = "1 element" if info.elements == 1 else f"{info.elements} elements"
            reduction = f", {info.reduction}" if info.reduction else ""
            length = "" if info.axial else ", inextensible"
            size = len(beam.dofs) - len(beam.fixed)
            line = f"{count} {info.element}{reduction}{length}: {size} unknowns of its own"
            lines.append(f"elastic: link {info.link}, {line}")
        return *lines, f"elastic motion about it: {self.unknowns} unknowns in all"

    def with_parameters(self, /, **values: float) -> Self:
        """Return the same model with other values of its tunable parameters, in SI units."""
        return type(self)(self.rigid.with_parameters(**values), self._with_motor)

    def _carrier(self, name: str) -> Model:
        return self.rigid if name in ("kinematics", "inverse_dynamics", "assemblies") else self

    def _refused(self, name: str) -> str | None:
        carrier = self._carrier(name)
        if carrier is not self:
            return carrier._refused(name)
        if name == "equilibrium" and self._never_rests:
            return self._never_rests
        if name in _LINEAR and self.description.states:
            return PRESCRIBED
        return super()._refused(name)

    @cached_property
    def _never_rests(self) -> str | None:
        """Why there is no equilibrium; None where there may be one. Nothing holds a crank with a motor."""
        from symgen.runtime.rods.equilibrium import never_rests

        info = self.description.elastic
        return never_rests(self.rigid.evaluator, info.crank if info and info.mode != "held" else "")

    def _modes(self, at: Equilibrium | float | None = None, moving: bool = False) -> Modes | ElasticModes:
        from symgen.runtime.elastic.modes import modes_with_errors
        from symgen.runtime.result.equilibrium import Equilibrium
        from symgen.runtime.rods.modes import analyse

        if isinstance(at, Equilibrium):
            if moving:
                raise ModelError("modes about an equilibrium are at rest: leave moving out")
            return analyse(self.rigid.evaluator, at)
        if self.description.states:
            if moving or at is not None:
                raise ModelError(f"{self.name}: {PRESCRIBED}")
            return analyse(self.rigid.evaluator, self._equilibrium())
        motion = self.motion(True)
        angle = motion.angle if at is None else real(at, "the direction of the crank")
        return modes_with_errors(motion, motion.time_at(angle), moving)

    def _matrices(
        self, at: float | None = None, over: str | None = None, elements: int | None = None
    ) -> AssembledMatrices:
        from symgen.runtime.elastic.matrices import assembled_at

        over = over or "input"
        check_known(over, ("input", "time"), "matrices have no variable")
        motion = self.motion(True)
        if at is not None and over == "time":
            t = real(at, "the time")
        else:
            t = motion.time_at(motion.angle if at is None else real(at, "the angle of the crank"))
        if elements is None and not (motion.undetermined or self.description.states):
            return assembled_at(motion, t)
        from symgen.runtime.elastic.large.matrices import large_matrices

        self._refuse_types("matrices in large rotation are")
        return large_matrices(motion, self._elements if elements is None else elements, t)

    def in_mode(self, modes: ElasticModes, number: int, phases: Array, largest: float) -> list[Variable]:
        """Return the outputs of a mode, counted from 0, over its phase [rad], at most ``largest`` [m] off."""
        from symgen.runtime.elastic.outputs import in_mode

        return in_mode(self.motion(True), modes, number, phases, largest)

    def _sensitivity(
        self,
        outputs: Sequence[str],
        parameters: Sequence[str] | None = None,
        at: ElasticResult | float | None = None,
        t_eval: ArrayLike | None = None,
    ) -> Sensitivity:
        from symgen.runtime.elastic.derivatives.poses import sensitivity
        from symgen.runtime.elastic.derivatives.results import of_result
        from symgen.runtime.linearisation.record import at_times

        by = self._differentiated(parameters)
        if at is not None and not isinstance(at, float | int):
            return of_result(self, METHODS, outputs, by, at, t_eval)

        def derivatives(times: Sequence[float]) -> list[Sensitivity]:
            return [sensitivity(self.motion(True), outputs, by, t) for t in times]

        t = None if at is None else real(at, "the time of derivatives")
        return at_times(derivatives, t, t_eval, 0.0)

    @takes(ElasticRun)
    def _simulate(self, request: ElasticRun) -> ElasticResult:
        method, t_end, revolutions = request.method, request.t_end, request.revolutions
        if method not in METHODS:
            verbs = {"quasi-static": "quasi_static", "periodic": "periodic", "exact": "large_rotation"}
            hint = nearest(method, METHODS)
            if method in INTEGRATORS:
                raise ModelError(
                    f"the method {method!r} is for rigid links, and {self.name} has elastic ones\n"
                    f"  Their methods are {', '.join(METHODS)}."
                )
            if method in verbs:
                command = verbs[method].replace("_", "-")
                hint = f"It is model.{verbs[method]}(), on the command line 'symgen {command} {self.name}'."
            raise ModelError(f"there is no method {method!r} of integration. {hint}")
        initial = initial_state(request.initial)
        if request.controlled:
            from symgen.runtime.elastic.large.run import controlled_links

            return controlled_links(self, request, self._elements)
        states = self.description.states
        if (states or self.motion(True).undetermined) and (large := request.in_large_rotation):
            return self._large_rotation(large)
        if t_end is not None:
            if revolutions is not None:
                raise OptionsError("give {t_end} or {revolutions}, not both")
            if not t_end > 0.0:
                raise ModelError(f"expected t_end above zero, got {t_end!r}")
            period = self.motion(request.geometric_stiffness).period
            revolutions = t_end / period if math.isfinite(period) else None
        if request.at is not None and request.t_eval is not None:
            raise OptionsError("give {at} or {t_eval}, not both")
        times = None if request.t_eval is None else tuple(reals(request.t_eval, "t_eval").tolist())
        return self._run(
            request,
            method,
            request.keeping(),
            revolutions=1.0 if revolutions is None else revolutions,
            steps=request.steps,
            rtol=_RTOL if request.rtol is None else request.rtol,
            samples=sample_count(request.samples, request.t_eval, 361),
            max_step=request.max_step,
            t_end=t_end,
            t_eval=times,
            initial=initial,
        )

    @takes(ElasticStepping)
    def _stepper(self, request: ElasticStepping) -> SystemStepper:
        from symgen.runtime.elastic.large.run import stepper_of_links

        return stepper_of_links(self, request, self._elements)

    @takes(Periodic)
    def _periodic(self, request: Periodic) -> ElasticResult:
        rtol = _RTOL if request.rtol is None else request.rtol
        options: dict[str, Any] = {"steps": request.steps, "rtol": rtol, "max_step": request.max_step}
        return self._run(request, "periodic", samples=request.samples, **options)

    @takes(QuasiStatic)
    def _quasi_static(self, request: QuasiStatic) -> ElasticResult:
        return self._run(request, "quasi-static", samples=request.samples, revolutions=request.revolutions)

    def _run(
        self, request: ElasticArguments, method: str, keeping: CheckpointOptions | None = None, **options: Any
    ) -> ElasticResult:
        from symgen.runtime.elastic.run import Task, run

        self._refuse_types("runs of elastic links are", but="types of C")
        check_known(request.form, FORMS, "there is no form")
        angles = None if request.at is None else tuple(np.ravel(np.asarray(request.at, dtype=float)).tolist())
        task = Task(method, at=angles, form=request.form, **options)
        with limited(request.max_wall):
            return run(self.motion(request.geometric_stiffness), task, request.progress, keeping)

    def _speed_response(
        self,
        speeds: Sequence[float],
        rtol: float = 1e-4,
        samples: int = 361,
        max_wall: float | None = None,
        progress: Progress | None = None,
    ) -> SpeedResponse:
        from symgen.runtime.elastic.steady.periodic import speed_response

        self._refuse_types("speed responses are")
        with limited(max_wall):
            return speed_response(self, speeds, rtol, samples, progress)

    def _equilibrium(
        self, elements: int | None = None, at: float | None = None, stable: bool = True
    ) -> Equilibrium:
        from symgen.runtime.elastic.large.run import equilibrium

        self._refuse_types("equilibria of elastic links are")
        t = 0.0 if at is None else real(at, "the time")
        held = self.description.elastic and self.description.elastic.mode == "held"
        rigid = self.rigid if held else self._turned_by_motor()
        count = self._elements if elements is None else elements
        return equilibrium(self.motion(True), rigid, count, t, stable)

    @property
    def _elements(self) -> int:
        """Elements of each link in large rotation if none are given: 4, or the most of the scene."""
        info = self.description.elastic
        return max(_ELEMENTS, *(b.elements for b in info.beams)) if info else _ELEMENTS

    @takes(LargeRotation)
    def _large_rotation(self, request: LargeRotation) -> ElasticResult:
        from symgen.runtime.elastic.large.run import large_run

        self._refuse_types("runs in large rotation are")
        elements = self._elements if request.elements is None else request.elements
        with limited(request.max_wall):
            return large_run(self.motion(True), request, elements)
