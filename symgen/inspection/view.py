"""What pages, explanations and drawings show of models of one method."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.methods import method_of
from symgen.report.page.drawing import Drawing, Sketch
from symgen.report.page.page import Fact, TableView
from symgen.runtime.result.records import Coordinate, Drift, Variable
from symgen.runtime.result.result import Result
from symgen.scene.loading import SceneText, check_scene
from symgen.scene.resolve import resolve
from symgen.symbolic.system import System


class View:
    """Explanations and pages of a method; the defaults suit any model that is simulated."""

    #: Name of the notes before the derivation on a page, ``templates/report/parts/NAME.html.j2``; none if "".
    kind = ""
    #: Integration methods in the measurement of speed, and the time [s] of one run that ends it.
    integrators: Sequence[str] = ("dop853", "dopri5", "rk4")
    longest = 0.05
    #: References besides those of the System.
    references: Sequence[str] = ()

    def structure(self, resolved: Any, system: System) -> Iterator[str]:
        """Yield the topology in words, and the operations saved by omitted terms."""
        yield system.title

    def solution(self, model: Any) -> Iterator[str]:
        """Yield how the equations besides those of the System are solved."""
        yield from ()

    def facts(self, resolved: Any, model: Any) -> tuple[Fact, ...]:
        """Return the type of the mechanism and its mobility."""
        return (Fact("mobility", "; ".join(model.mobility)),)

    def sketch(self, resolved: Any, model: Any, result: Result | None) -> Sketch:
        """Return the mechanism in its initial configuration, with the paths of its points in a run."""
        raise NotImplementedError

    #: Content of the animation.
    film_caption = ""

    def drawn_outputs(self, resolved: Any) -> Sequence[str]:
        """Return the outputs from which the pose at each sample follows.

        Raises
        ------
        ModelError
            For a method that has no animation.
        """
        raise ModelError(f"{resolved.name} has no animation: its method draws only a page (symgen report)")

    def plotted_outputs(self, resolved: Any) -> Sequence[str]:
        """Return the outputs that are plotted next to the picture if the scene lists none."""
        return self.drawn_outputs(resolved)

    def arrows(self, resolved: Any, plotted: Sequence[str]) -> Sequence[str]:
        """Return the outputs, besides those plotted, of forces that the picture shows as arrows."""
        return ()

    def film_text(self, resolved: Any, result: Result) -> str:
        """Return the caption of the animation of a result."""
        return self.film_caption + (_STOPS if stops(result) else "")

    def recorded(self, resolved: Any, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return the tables of a scene with those that its drawn outputs need."""
        return dict(data)

    def filmed(self, model: Any, samples: int, **options: Any) -> Result:
        """Return the run that the animation shows."""
        return self.moved(model, samples, **options)

    def moved(self, model: Any, samples: int, **options: Any) -> Result:
        """Return a run with the outputs that the animation draws."""
        return model.simulate(samples=samples, **options)

    def posed(self, model: Any, values: Sequence[float], over: str) -> Result:
        """Return the drawn outputs at values of the input, or at times [s] ``over`` the ``time``.

        Raises
        ------
        ModelError
            For values of the input of a motion under forces.
        """
        poses: Result
        if "kinematics" in model.capabilities:
            poses = model.kinematics(at=values, over=over)
            return poses
        if over != "time":
            raise ModelError(f"{model.name} moves under forces: its poses are drawn at times [s]")
        poses = model.simulate(max(values, default=0.0) or None, t_eval=sorted({*values}))
        return poses

    def repeated(self, model: Any, verb: str, arguments: Mapping[str, Any], result: Result) -> Result:
        """Return the drawn outputs at the samples of a result, by the same analysis once more."""
        return getattr(model, verb)(**arguments)

    def vibrating(
        self, resolved: Any, model: Any, number: int, angle: float | None, phases: NDArray[np.float64]
    ) -> tuple[list[Sketch], float, str]:
        """Return the mechanism over the phase [rad] of a mode, counted from 1; frequency [Hz] and caption.

        Raises
        ------
        ModelError
            For a mode that does not vibrate, and a number or an angle of the crank that there is not.
        """
        model.modes()  # raises the reason if there are none
        raise ModelError(f"modes of {resolved.name} have no picture")

    def unit(self, resolved: Any) -> tuple[str, float]:
        """Return the unit of length of drawings and its size [m]."""
        return resolved.units.get("length", ("m", 1.0))

    def sketch_at(self, resolved: Any, drawn: Mapping[str, NDArray[np.float64]]) -> Sketch:
        """Return the mechanism in the pose of its drawn outputs, in which all places are linear."""
        raise NotImplementedError

    def computed(
        self, resolved: Any, model: Any
    ) -> tuple[Callable[[Mapping[str, NDArray[np.float64]]], Sketch], str]:
        """Return the picture of a page that computes, in which all places are linear, and its caption."""
        return (lambda drawn: self.sketch_at(resolved, drawn)), self.film_caption

    def sketches(self, resolved: Any, model: Any, result: Result) -> list[Sketch]:
        """Return the mechanism at every sample of a result that has the drawn outputs."""
        positions = {name: result.variable(name).values for name in self.drawn_outputs(resolved)}
        return [
            self.sketch_at(resolved, {name: x[k] for name, x in positions.items()})
            for k in range(result.count)
        ]

    def caption(self, drawn: Drawing) -> str:
        """Return the caption of the drawing."""
        return "The mechanism in its initial configuration"

    def run(self, model: Any) -> Result:
        """Return the run that the page shows."""
        return model.simulate()

    def cost(self, model: Any, result: Result) -> tuple[TableView, str] | None:
        """Return the cost of the run with a caption; None where speed is measured against error."""
        return None

    def example(self, model: Any) -> list[str]:
        """Return lines of Python that run ``model``."""
        return [f"run = model.simulate({model.description.t_end:g})"]


class Drawn(NamedTuple):
    """A scene that records what its animation draws and plots, and the names of these outputs.

    ``text`` is the file of a user-defined system, ``resolved`` then its model. ``arrows`` are forces that are
    drawn and not plotted.
    """

    text: SceneText | str
    resolved: Any
    view: View
    places: Sequence[str]
    plotted: Sequence[str]
    arrows: Sequence[str]


def drawn_scene(text: SceneText) -> Drawn:
    """Return a scene with the outputs of its animation.

    Raises
    ------
    SceneError
        For an invalid scene.
    ModelError
        For a method that has no animation.
    """
    checked = check_scene(text)
    resolved = resolve(checked)
    view = view_of(resolved)
    places = view.drawn_outputs(resolved)
    plotted = checked.analysis.outputs or view.plotted_outputs(resolved)
    arrows = view.arrows(resolved, plotted)
    recorded = list(dict.fromkeys([*places, *arrows, *plotted]))
    analysis = {**text.data.get("analysis", {}), "outputs": recorded}
    text = SceneText(text.name, text.file, {**view.recorded(resolved, text.data), "analysis": analysis})
    return Drawn(text, resolved, view, places, plotted, arrows)


def drawn_system(model: Any) -> Drawn:
    """Return a user-defined system with the outputs of its animation; raise ModelError without points."""
    view = view_of(model)
    places = view.drawn_outputs(model)
    return Drawn(model.source.scene, model, view, places, view.plotted_outputs(model), ())


def view_of(subject: Any) -> View:
    """Return the view of the method of a resolved scene or a model."""
    return method_of(subject).load("view")()


#: Part of the caption of a motion that its drives cannot continue.
_STOPS = " The drive cannot pass a dead centre: the motion up to it is shown there and back."


def stops(result: Result) -> bool:
    """Return whether a motion ends before its range does, at a dead centre."""
    return any(result.statistics.get(ranges) for ranges in ("unassemblable", "out_of_reach"))


def bare(d: Any, along: Coordinate, variables: Sequence[Variable], hertz: float = 0.0) -> Result:
    """Return a result of a picture alone, over the phase of a vibration of a frequency [Hz]."""
    return Result(
        name=d.name,
        title=d.title,
        axes=d.axes,
        coordinate=along,
        variables=tuple(variables),
        drift=Drift(),
        final={},
        statistics={},
        provenance={},
        times=along.values / (2 * np.pi * hertz) if hertz else None,
    )


def vibration(name: str, number: int, frequencies: Sequence[float]) -> tuple[float, str]:
    """Return the frequency [Hz] of a mode, counted from 1, and the caption of its picture.

    Raises
    ------
    ModelError
        For a number that there is not, and a mode without frequency.
    """
    if not 1 <= number <= len(frequencies):
        raise ModelError(f"there is no mode {number}: {name} has {len(frequencies)}, counted from 1")
    frequency = frequencies[number - 1]
    if not frequency > 0.0:
        raise ModelError(f"mode {number} of {name} does not vibrate: it has no frequency")
    words = (
        f"Mode {number} of {len(frequencies)}, {frequency:.6g} Hz. Its amplitude is chosen for the picture."
    )
    return frequency, words
