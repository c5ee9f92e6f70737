"""What pages and explanations show of linkages of points and links, with elastic links and without."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError, SymgenError
from symgen.inspection.picture import (
    SEEN,
    bent_outputs,
    bent_sketch,
    bent_sketches,
    deflected,
    linkage_sketch,
    magnification,
    stations_of,
)
from symgen.inspection.view import View, bare, vibration
from symgen.mechanics.elastic.hamilton import THESIS
from symgen.models.general_linkage import general
from symgen.models.structure import structure
from symgen.pipeline.systems import system_of
from symgen.report.mathematics.saving import saving_lines
from symgen.report.page.drawing import Drawing, Sketch
from symgen.report.page.page import Fact
from symgen.report.page.structure import elastic_lines
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.result.records import Coordinate
from symgen.runtime.result.result import Result
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.system import System

#: Error over the peak stress of the run on a page.
_ERROR = 1e-3
#: The same of the steady state that a page of quasi-static shapes mentions.
_STEADY = 1e-2
_POSITION = ".position"
#: Caption of runs without displacements from a rigid motion.
_STRAIGHT = "The motion of the ends of links, which are drawn straight. Thin lines are paths."
#: Beginning of the caption of a page that computes.
_QUASI_STATIC = (
    "One revolution in the quasi-static state: links bend under the loads and inertia of the rigid motion; "
    "vibrations are omitted."
)
Array = NDArray[np.float64]
#: Arguments of a range of prescribed values.
_OF_RANGE = ("start", "stop", "at", "over", "samples")


class RodsView(View):
    """A linkage of rods and bodies."""

    kind = "rods"

    def structure(self, resolved: Linkage, system: System) -> Iterator[str]:
        """Yield the topology, and the operations saved by numbers of the scene and by its plane."""
        yield from structure(resolved)
        noun = "any masses, lengths, centres, inertias and gravity"
        yield from saving_lines(system, system_of(general(resolved)), noun)
        if resolved.plane:
            yield from saving_lines(system, system_of(resolved.as_written), "motion across its plane")

    def facts(self, resolved: Linkage, model: Any) -> tuple[Fact, ...]:
        """Return plane or space, and the numbers of points, links, coordinates and constraints."""
        d = model.description
        redundant = len(model.redundant)
        return (
            Fact("linkage", _where(resolved)),
            Fact("points and links", f"{len(d.points)} and {len(resolved.links) + len(resolved.bodies)}"),
            Fact("coordinates", str(d.coordinates)),
            Fact("constraints", f"{len(d.constraints)}" + (f", {redundant} redundant" if redundant else "")),
            Fact("degrees of freedom", str(d.coordinates - len(d.constraints) + redundant)),
        )

    def sketch(self, resolved: Linkage, model: Any, result: Result | None) -> Sketch:
        """Return points and links, and the paths of points in a run."""
        return linkage_sketch(resolved, model.initial_state().positions, result)

    film_caption = "Thin lines are the paths of points."

    def drawn_outputs(self, resolved: Linkage) -> Sequence[str]:
        """Return the positions of all points."""
        return [f"{p.name}{_POSITION}" for p in resolved.as_written.points]

    def filmed(self, model: Any, samples: int, **options: Any) -> Result:
        """Return a run under forces, or the kinematics of a scene that has none or a dead centre."""
        if "simulate" in model.capabilities:
            try:
                return super().moved(model, samples, **options)
            except SimulationError:
                if "kinematics" not in model.capabilities:
                    raise
                return self.moved(model, samples, **options)
        stop = options.pop("t_end", None)
        return model.kinematics(stop=stop, samples=samples, **options)

    def moved(self, model: Any, samples: int, **options: Any) -> Result:
        """Return the kinematics of a driven linkage, up to a dead centre, or a run under forces."""
        if "kinematics" not in model.capabilities:
            return super().moved(model, samples, **options)
        stop, of = options.pop("t_end", None), model.description.points
        return model.kinematics(stop=stop, samples=samples, of=of, **options)

    def posed(self, model: Any, values: Sequence[float], over: str) -> Result:
        """Return the positions of points at directions of the driven link, or at times [s]."""
        if "kinematics" not in model.capabilities:
            return super().posed(model, values, over)
        return model.kinematics(at=values, over=over, of=model.description.points)

    def repeated(self, model: Any, verb: str, arguments: Mapping[str, Any], result: Result) -> Result:
        """Return the positions of points at the samples of a result."""
        if verb in ("simulate", "record"):
            return super().repeated(model, verb, arguments, result)
        same = {name: arguments[name] for name in ("state", "through") if name in arguments}
        if arguments.get("through"):  # which passes a time twice
            same |= {name: arguments[name] for name in _OF_RANGE if name in arguments}
        else:
            same |= {"at": result.time, "over": "time"}
        return model.kinematics(of=model.description.points, **same)

    def sketch_at(self, resolved: Linkage, drawn: Mapping[str, NDArray[np.float64]]) -> Sketch:
        """Return points and links."""
        return linkage_sketch(resolved, {name.removesuffix(_POSITION): x for name, x in drawn.items()}, None)

    def vibrating(
        self, resolved: Linkage, model: Any, number: int, angle: float | None, phases: Array
    ) -> tuple[list[Sketch], float, str]:
        """Return points and links about the equilibrium."""
        if angle is not None:
            raise ModelError(f"modes of {resolved.name} are about its equilibrium: leave the angle out")
        modes = model.modes()
        frequency, words = vibration(resolved.name, number, [m.frequency for m in modes])
        rest, mode = modes.equilibrium.state.positions, modes[number - 1]
        places, shape = np.array([*rest.values()]), np.array([mode.shape[p] for p in rest])
        moved = np.real(np.exp(1j * phases)[:, None, None] * shape)
        moved *= SEEN * float(np.max(np.ptp(places, axis=0))) / float(np.max(np.abs(moved)))
        sketches = [
            linkage_sketch(resolved, dict(zip(rest, places + off, strict=True)), None) for off in moved
        ]
        return sketches, frequency, words

    def caption(self, drawn: Drawing) -> str:
        """Return the caption of the drawing."""
        kinds = {s.kind for s in drawn.shapes}
        words = super().caption(drawn)
        words += "; blue links bend" if "elastic" in kinds else ""
        return words + ("; thin lines are paths during the run" if "path" in kinds else "")

    def example(self, model: Any) -> list[str]:
        """Return lines that evaluate accelerations and run."""
        return [
            "found = model.accelerations()  # at the start; found.multipliers, found.reactions",
            f'found["{model.description.free[0]}"]',
            *super().example(model),
        ]


class ElasticView(RodsView):
    """A linkage with elastic links."""

    integrators, longest = ("gauss", "newmark", "dop853"), 0.3
    references: Sequence[str] = (f"The {THESIS}",)

    def solution(self, model: ElasticModel) -> Iterator[str]:
        """Yield the structure of the equations of elastic links."""
        yield from elastic_lines(model)

    def facts(self, resolved: Linkage, model: ElasticModel) -> tuple[Fact, ...]:
        """Return those of the rigid motion, and the elastic links with their unknowns."""
        return (
            *super().facts(resolved, model),
            Fact("elastic links", ", ".join(b.info.link for b in model.beams)),
            Fact("elastic unknowns", str(model.unknowns)),
        )

    def sketch(self, resolved: Linkage, model: ElasticModel, result: Result | None) -> Sketch:
        """Return points and links of the rigid motion."""
        return super().sketch(resolved, model.rigid, result)

    film_caption = "The motion of the rigid links; blue links bend about it. Thin lines are paths."

    def film_text(self, resolved: Linkage, result: Result) -> str:
        """Return the caption, with the magnification of deflections if the result has them."""
        if not deflected(resolved, result):
            return _STRAIGHT if result.KIND == "elastic" else super().film_text(resolved, result)
        return _of_deflections(magnification(resolved, result))

    def drawn_outputs(self, resolved: Linkage) -> Sequence[str]:
        """Return positions and displacements of points, and deflections along elastic links."""
        return bent_outputs(resolved)

    def plotted_outputs(self, resolved: Linkage) -> Sequence[str]:
        """Return bending strains and stresses at the stations, and the torque of a crank that is held."""
        words = ("bending_strain", "stress")
        crank = resolved.crank
        torque = [f"{crank.link}.torque"] if crank and crank.mode == "held" else []
        return [*(f"{s.name}.{word}" for word in words for s in resolved.stations), *torque]

    def computed(
        self, resolved: Linkage, model: ElasticModel
    ) -> tuple[Callable[[Mapping[str, Array]], Sketch], str]:
        """Return the picture of the quasi-static shape, magnified as for the scene's own values."""
        start = model.rigid.initial_state().positions
        shape = model.quasi_static()
        times = magnification(resolved, shape)

        def drawn(shapes: Mapping[str, Array]) -> Sketch:
            # A deflection is followed by its components.
            moving = {name: x[1:] if name.endswith(".deflection") else x for name, x in shapes.items()}
            return bent_sketch(resolved, start, moving, times)

        return drawn, " ".join((_QUASI_STATIC, *_of_vibrations(model, shape), _of_deflections(times)))

    def recorded(self, resolved: Linkage, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return the tables of a scene with stations along its elastic links."""
        stations = data.get("stations") or [
            {"name": e.link, "link": e.link, "at": 0.5} for e in resolved.elastic
        ]
        return {**data, "stations": [*stations, *stations_of(resolved)]}

    def filmed(self, model: ElasticModel, samples: int, **options: Any) -> Result:
        """Return the run of the elastic links."""
        return model.simulate(samples=samples, **options)

    def sketches(self, resolved: Linkage, model: ElasticModel, result: Result) -> list[Sketch]:
        """Return the mechanism with magnified deflections; rigid at samples that have none."""
        if deflected(resolved, result):
            return bent_sketches(resolved, model.rigid.initial_state().positions, result)
        start, d = model.rigid.initial_state().positions, model.description
        at_rest = {p: np.tile(start[p], (result.count, 1)) for p in d.ground if p in d.steady}
        points = [p.name for p in resolved.as_written.points]
        positions = {
            p: at_rest[p] if p in at_rest else result.variable(f"{p}{_POSITION}").values for p in points
        }
        return [
            linkage_sketch(resolved, {p: x[k] for p, x in positions.items()}, None)
            for k in range(result.count)
        ]

    def moved(self, model: ElasticModel, samples: int, **options: Any) -> Result:
        """Return the motion of the rigid links."""
        points = model.description.points
        return model.kinematics(stop=options.pop("t_end", None), samples=samples, of=points, **options)

    def repeated(
        self, model: ElasticModel, verb: str, arguments: Mapping[str, Any], result: Result
    ) -> Result:
        """Return the run of the elastic links, or the rigid motion if no deflections are drawn."""
        if verb not in ("large_rotation", "inverse_dynamics"):
            return View.repeated(self, model, verb, arguments, result)
        return model.kinematics(at=result.time, over="time", of=model.description.points)

    def vibrating(
        self, resolved: Linkage, model: ElasticModel, number: int, angle: float | None, phases: Array
    ) -> tuple[list[Sketch], float, str]:
        """Return the links bent about the pose of the modes, at rest."""
        modes: Any = model.modes() if angle is None else model.modes(angle)
        frequency, words = vibration(resolved.name, number, modes.frequencies.tolist())
        start = model.rigid.initial_state().positions
        size = SEEN * float(np.max(np.ptp(np.array([*start.values()]), axis=0)))
        along = Coordinate("phase", "rad", "phase", phases)
        outputs = tuple(model.in_mode(modes, number - 1, phases, size))
        sketches = bent_sketches(resolved, start, bare(model.description, along, outputs))
        return sketches, frequency, f"{words} Grey: the rigid links."

    def run(self, model: ElasticModel) -> Result:
        """Return the motion at a tolerance that suits a page."""
        return model.simulate(rtol=_ERROR)

    def example(self, model: ElasticModel) -> list[str]:
        """Return lines that run and show peaks."""
        return ["turn = model.simulate()", "turn.peaks"]


class SpatialView(RodsView):
    """A linkage in space with elastic links in large rotation."""

    drawn_outputs = ElasticView.drawn_outputs
    recorded = ElasticView.recorded

    def film_text(self, resolved: Linkage, result: Result) -> str:
        """Return the caption, with the magnification of deflections."""
        return _of_deflections(magnification(resolved, result), "the lines between their ends")

    def plotted_outputs(self, resolved: Linkage) -> Sequence[str]:
        """Return the positions of all points."""
        return super().drawn_outputs(resolved)

    def sketches(self, resolved: Linkage, model: Any, result: Result) -> list[Sketch]:
        """Return the mechanism with magnified deflections."""
        return bent_sketches(resolved, model.initial_state().positions, result)


def _of_vibrations(model: ElasticModel, shape: Result) -> Iterator[str]:
    """Return the ratio of steady-state to quasi-static stresses as text, if there is one."""
    names = [v.name for v in shape.variables if v.name.endswith(".stress")]
    try:
        steady = model.periodic(rtol=_STEADY)
    except SymgenError:  # in resonance, or at rest
        return
    peaks = (max((r.peaks[name] for name in names), default=0.0) for r in (steady, shape))
    with_vibrations, without = peaks
    if without:
        yield (
            f"The steady state with vibrations has {with_vibrations / without:.2g} times the peak stress of "
            "the quasi-static one, at the scene's own values (symgen periodic)."
        )


def _of_deflections(times: float, about: str = "the rigid motion") -> str:
    """Return the caption of a picture with magnified deflections."""
    size = "drawn in their own size" if times == 1.0 else f"magnified {times:g} times"
    return (
        f"Deflections are {size}: blue links bend about {about}, in grey. Thin lines are the paths of points "
        "so drawn."
    )


def _where(linkage: Linkage) -> str:
    """Return the plane or space in which the linkage moves."""
    if linkage.plane:
        return f"in space, stays in the plane {linkage.plane}"
    return "in the plane" if linkage.dimension == 2 else "in space"
