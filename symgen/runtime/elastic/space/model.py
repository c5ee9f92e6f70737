"""A compiled linkage with elastic links in space, and its runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.errors import ModelError, SimulationError
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import Moment, moved, stacked
from symgen.runtime.elastic.large.passes import RTOL, Pass, refine
from symgen.runtime.elastic.mesh import mesh_error
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.outputs import outputs
from symgen.runtime.integrate.options import end_of_scene
from symgen.runtime.integrate.pace import OutOfTime, Pace, limited, out_of_time, wall_left
from symgen.runtime.kernels.arguments import count as whole
from symgen.runtime.kernels.arguments import real
from symgen.runtime.kernels.typed import made_with
from symgen.runtime.model.model import Model
from symgen.runtime.model.rods import RodModel
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.modes import ElasticModes
from symgen.runtime.result.records import Drift, Variable, of_model, over_time
from symgen.runtime.result.state import State

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Sensitivity

Array = NDArray[np.float64]

#: What runs report as their form.
_FORM = "elements in space"
#: Steps of a run to start with.
_STEPS = 64
#: Axial strain from which on stress in proportion to strain is no model of a link.
_STRAIN = 0.1


@checked
class SpatialModel(Model):
    """A linkage in space with elastic links between ball joints.

    Made by :func:`symgen.build`.
    """

    MISSING: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("", "batch"),
        "its elastic links are in space, whose motion, modes and derivatives alone are computed",
    )

    def __init__(self, rigid: RodModel) -> None:
        parts = rigid.description, rigid._library, rigid._derive, rigid.parameters
        super().__init__(*parts, typed=rigid._typed)
        self.rigid = rigid

    @property
    def source(self) -> Any:
        """Scene and options of the build."""
        return replace(self.rigid.source, rigid=False)

    def with_parameters(self, /, **values: float) -> Self:
        """Return the same model with other values of its tunable parameters, in SI units."""
        return type(self)(self.rigid.with_parameters(**values))

    @property
    def redundant(self) -> tuple[str, ...]:
        """Constraints of the rigid motion that others imply."""
        return self.rigid.redundant

    @property
    def mobility(self) -> tuple[str, ...]:
        """That of the rigid motion, a line of text each."""
        return self.rigid.mobility

    def initial_state(self) -> State:
        """Return the start of the linkage with all links rigid."""
        return self.rigid.initial_state()

    def __repr__(self) -> str:
        links = ", ".join(b.link for b in self.rigid.description.elastic.beams)  # type: ignore[union-attr]
        return f"<SpatialModel {self.name!r}: {links} elastic>"

    def _modes(self, at: float | None = None) -> ElasticModes:
        from symgen.runtime.elastic.space.modes import modes_in_space

        self._refuse_types("modes of elastic links in space are")
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
            made = getattr(at, "provenance", {})
            if made.get("form") != _FORM or made["parameters"] != dict(self.parameters):
                raise ModelError(f"{self.name}: expected a run of this model for at: model.simulate()")
            if not outputs:
                raise ModelError("expected outputs to differentiate, got none")
            if not at.statistics["steps"]:
                raise ModelError(f"{self.name}: expected a whole run for at, got one that max_wall ended")
            steps = at.statistics["steps"] // (len(at.time) - 1)
            return of_run(self.rigid, outputs, by, coordinates, at.time, steps)
        if [*outputs] != ["frequencies"]:
            raise ModelError(
                f"{self.name}: expected frequencies in a pose, got {', '.join(outputs) or 'no outputs'}\n"
                "  Other outputs are those of a run: give at = model.simulate()."
            )
        return of_frequencies(self.rigid, by, coordinates, 0.0 if at is None else real(at, "the time"))

    def _simulate(
        self,
        t_end: float | None = None,
        *,
        rtol: float | None = None,
        samples: int | None = None,
        max_step: float | None = None,
        max_wall: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> ElasticResult:
        self._refuse_types("runs of elastic links in space are")
        rtol = real(RTOL if rtol is None else rtol, "rtol")
        if not 0.0 < rtol < 1.0:
            raise ModelError(f"expected rtol above zero and below 1, got {rtol!r}")
        samples = whole(361 if samples is None else samples, "samples")
        if samples < 2:
            raise ModelError(f"expected 2 samples or more, got {samples}")
        end = end_of_scene(self.rigid.description.t_end) if t_end is None else real(t_end, "t_end")
        least = float(_STEPS)
        if max_step is not None:
            if not real(max_step, "max_step") > 0.0:
                raise ModelError(f"expected max_step above zero, got {max_step!r}")
            least = max(least, end / max_step)
        if not end > 0.0:
            raise ModelError(f"expected t_end above zero, got {end!r}")
        times, linkage, passes = np.linspace(0.0, end, samples), LinkageInSpace(self.rigid), list[Pass]()
        pace = Pace(0.0, end)
        with limited(max_wall):
            try:
                refine(
                    passes, linkage, partial(self._checked, linkage), partial(_drift, linkage),
                    times, least, rtol, pace, progress,
                )  # fmt: skip
            except SimulationError as error:
                raise SimulationError(f"{error}{self._dead_centre(error.time)}", time=error.time) from None
            except OutOfTime as stop:
                if not passes:
                    variables = outputs(linkage, stop.found)
                    drift = _drift(linkage, stop.found)
                    passes.append(Pass(variables, 0, 0, math.inf, drift))
                    times = times[stop.reached]
                partial_result = self._result(linkage, times, passes[-1], rtol, pace.wall)
                problem = f"{self.name}: {out_of_time(stop.t, end)}"
                raise SimulationError(problem, time=stop.t, partial=partial_result) from None
            made = self._result(linkage, times, passes[-1], rtol, pace.wall)
            made._estimate_later(partial(self._by_elements, times, passes[-1], wall_left()))
        return made

    def _checked(self, linkage: LinkageInSpace, found: Sequence[Moment]) -> list[Variable]:
        """Return the outputs; raise SimulationError where an axial strain is beyond linear elasticity."""
        made = outputs(linkage, found)
        for variable in (v for v in made if v.name.endswith(".axial_strain")):
            beyond = np.flatnonzero(~(np.abs(variable.values) <= _STRAIN))
            if len(beyond):
                t, strain = found[beyond[0]].t, variable.values[beyond[0]]
                raise SimulationError(
                    f"{self.name}: expected {variable.name} of at most {_STRAIN:g}, beyond which linear "
                    f"elasticity does not hold, got {strain:.3g} at t = {t:.6g} s",
                    time=t,
                )
        return made

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

    def _by_elements(self, times: Array, coarse: Pass, max_wall: float | None) -> float | None:
        """Return the change of stresses in twice as many elements, over their peak; None if not known."""
        finer = LinkageInSpace(self.rigid, divided=2)
        with limited(max_wall):
            try:
                found, _ = moved(finer, GAUSS8, times, coarse.steps, Pace(0.0, float(times[-1])))
            except (OutOfTime, SimulationError):
                return None
        return mesh_error(coarse.variables, outputs(finer, found))

    def _result(
        self, linkage: LinkageInSpace, times: Array, one: Pass, rtol: float, wall: float
    ) -> ElasticResult:
        d = self.rigid.description
        wanted = None if d.elastic is None else d.elastic.outputs
        still = {f"{p}.position" for p in d.ground if p in d.steady}
        variables = [v for v in one.variables if wanted is not None or v.name not in still]
        if wanted is not None:
            known = {v.name: v for v in variables}
            missing = [name for name in wanted if name not in known]
            if missing:
                raise ModelError(
                    f"{self.name}: a run of elastic links in space has no output {missing[0]}\n"
                    f"  It has {', '.join(known)}."
                )
            variables = [known[name] for name in wanted]
        notes = list(d.remarks)
        if one.error > rtol:
            notes.append(
                f"the error by time steps does not reach rtol = {rtol:g}: links vibrate too fast for the "
                "steps; give a shorter run, damping, or shorter steps by max_step"
            )
        return ElasticResult(
            **of_model(
                d,
                self.rigid.parameters,
                method="large-rotation",
                form=_FORM,
                rtol=rtol,
                t_end=float(times[-1]),
                **made_with(self.rigid.evaluator.library, self.rigid.typed),
            ),
            axes=d.axes,
            coordinate=over_time(times),
            variables=tuple(variables),
            drift=one.drift,
            final={},
            statistics={
                "unknowns": linkage.unknowns - linkage.multipliers,
                "steps": one.steps * (len(times) - 1),
                "corrections": one.corrections,
                "error": one.error if math.isfinite(one.error) else None,
                "wall_s": wall,
                "floquet": [],
                "floquet_error": None,
            },
            notes=tuple(notes),
            times=None,
        )


def _drift(linkage: LinkageInSpace, found: Sequence[Moment]) -> Drift:
    """Return the largest errors of the constraints, and of the energy where no load does other work."""
    t, q, v, a, _ = stacked(found)
    errors, rates = linkage.core.rows(t, q, v, *linkage.prescribed(t))
    kinetic, strain, potential, _ = linkage.energies(t, q, v, a)
    balance = kinetic + strain + potential - [m.work for m in found]
    return Drift(
        float(np.max(np.abs(errors))),
        float(np.max(np.abs(rates))),
        float(np.max(np.abs(balance - balance[0]))) if linkage.conservative else math.nan,
        float(max(np.ptp(kinetic), np.ptp(strain + potential))),
    )
