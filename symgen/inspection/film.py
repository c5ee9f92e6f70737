"""A scene as pictures: a film of its motion, and a sheet with poses and paths of points."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, ResultError, SymgenError, check_known
from symgen.inspection.values import of_times
from symgen.inspection.view import Drawn, bare, drawn_scene, drawn_system, stops
from symgen.methods import load, method_of
from symgen.pipeline.build import build_selected
from symgen.report.page.animation import Film, traces_of
from symgen.report.page.drawing import Sketch
from symgen.report.page.movie import film_file, save
from symgen.report.page.sheet import Sheet
from symgen.runtime.kernels.arguments import count, reals
from symgen.runtime.result.records import Coordinate
from symgen.runtime.result.result import Result
from symgen.scene.loading import SceneText
from symgen.scene.units import LENGTH, describe, parse_quantity

#: Frames of an animation, and vertices of a path.
FRAMES = 241
#: Reads the values at which poses are drawn, for a model: numbers in SI and their variable.
Poses = Callable[[Any], tuple[Sequence[float], str]]


def film_of(text: SceneText | str, samples: int, **options: Any) -> Film:
    """Run a scene and return its animation.

    Parameters
    ----------
    text
        The scene, or the file of a user-defined system.
    samples
        Number of frames.
    options
        Further arguments of the analysis that is carried out, such as ``t_end``.

    Raises
    ------
    SceneError, BuildError, CacheError, SimulationError
        As for building and running the scene.
    """
    drawn = _drawn(text)
    model = _built(drawn)
    result = drawn.view.filmed(model, samples, **options)
    if stops(result):  # there and back
        result = _thinned(result, np.array([*range(result.count), *range(result.count - 2, 0, -1)]))
    sketches = drawn.view.sketches(drawn.resolved, model, result)
    words = drawn.view.film_text(drawn.resolved, result)
    return Film(_shown(result, drawn.plotted), sketches, words, _shown(result, drawn.arrows).shown)


def film_of_mode(text: SceneText | str, number: int, angle: float | None, samples: int) -> Film:
    """Return the animation of a mode of vibration over one period.

    Parameters
    ----------
    text
        The scene, or the file of a user-defined system.
    number
        Number of the mode, from 1.
    angle
        Direction of the crank that holds elastic links [rad]; that of the start when absent.
    samples
        Number of frames.

    Raises
    ------
    SceneError, BuildError, CacheError, ModelError
        As for building the scene and its modes, and for a mode that does not vibrate.
    """
    of = _drawn(text)
    model = _built(of)
    phases = np.linspace(0.0, 2 * np.pi, samples)
    sketches, hertz, words = of.view.vibrating(of.resolved, model, number, angle, phases)
    along = Coordinate("phase", "rad", "phase", phases)
    return Film(bare(model.description, along, (), hertz), sketches, words)


def animate(result: Result, file: str | os.PathLike[str] | None, frames: int) -> Film:
    """Return the animation of a result, written to a file if one is given; see ``Result.animate``."""
    if result.origin is None:
        raise ResultError(
            f"the result of {result.name} has no model: it was loaded, copied or taken from an error\n"
            "  Carry out its analysis again: model.simulate(...).animate()"
        )
    if result.count < 2:
        raise ResultError(
            f"the result of {result.name} has {result.count} sample: expected at least 2 for an animation"
        )
    if file is not None:
        film_file(file)
    if count(frames, "frames") < 2:
        raise ModelError(f"expected at least 2 frames, got {frames}")
    model, verb, arguments = result.origin
    of = _drawn(model.source.scene)
    built = _built(of, model.parameters, model.source.options[0])
    rows = np.arange(0, result.count, max(1, math.ceil((result.count - 1) / (frames - 1))))
    poses = _thinned(of.view.repeated(built, verb, arguments, result), rows)
    sketches = of.view.sketches(of.resolved, built, poses)
    words = of.view.film_text(of.resolved, poses)
    film = Film(_thinned(result, rows), sketches, words, _shown(poses, of.arrows).shown)
    if file is not None:
        save(film, Path(file))
    return film


def still(model: Any) -> tuple[Sheet, list[tuple[str, str]]]:
    """Return the drawing of a model at its start, and facts: its freedoms and its outputs.

    Raises
    ------
    SymgenError
        For a model without a scene or without a picture.
    """
    of = _drawn(model.source.scene)
    facts = [(fact.name, fact.value) for fact in of.view.facts(of.resolved, model)]
    sketch = of.view.sketch(of.resolved, model, None)
    sheet = Sheet(model.description.title, [sketch], {}, of.view.unit(of.resolved))
    return sheet, [*facts, ("outputs", ", ".join(of.plotted))]


def moving_html(result: Result) -> str:
    """Return the animation of a result for a page that has its curves; nothing if it has none."""
    try:
        return animate(result, None, FRAMES).framed(plots=False)
    except SymgenError:
        return ""


def _thinned(result: Result, rows: NDArray[np.intp]) -> Result:
    """Return a result at some of its samples."""
    return replace(
        result,
        coordinate=replace(result.coordinate, values=result.coordinate.values[rows]),
        variables=tuple(replace(v, values=v.values[rows]) for v in result.variables),
        times=None if result.times is None else result.times[rows],
    )


def _drawn(text: SceneText | str) -> Drawn:
    """Return a scene, or a user-defined system, with the outputs of its pictures."""
    return drawn_system(build_selected(text)) if isinstance(text, str) else drawn_scene(text)


def _built(of: Drawn, parameters: Mapping[str, float] | None = None, backend: str = "auto") -> Any:
    """Return the model of a scene with the outputs of its pictures."""
    model: Any = build_selected(of.text, backend=backend)
    return model.with_parameters(**parameters) if parameters else model


def _shown(result: Result, names: Sequence[str]) -> Result:
    """Return a result of the named outputs alone."""
    return replace(result, variables=tuple(v for v in result.variables if v.name in names))


def sheet_of(
    text: SceneText | str,
    poses: Poses | None = None,
    *,
    of: Sequence[str] | None = None,
    unit: str | None = None,
    parameters: Mapping[str, float] | None = None,
    samples: int = FRAMES,
    **options: Any,
) -> Sheet:
    """Return a drawing of a scene in poses, with paths of points over its motion.

    Parameters
    ----------
    text
        The scene, or the file of a user-defined system.
    poses
        Gives the values of the input, or times [s], for a model; the beginning of the motion when absent.
    of
        Points, or joints of a loop, whose paths are drawn; all that move when absent.
    unit
        Unit of length of the drawing; that of ``[units]`` of the scene, otherwise metres, when absent.
    parameters
        Values of tunable parameters [SI].
    samples
        Number of vertices of a path.
    options
        Further arguments of the analysis that is carried out, such as ``t_end``.

    Raises
    ------
    ModelError
        For a name that is no moving point, and a unit that is not one of length.
    SceneError, BuildError, CacheError, SimulationError
        As for building and running the scene.
    """
    size = _unit(unit) if unit else None
    scene = _drawn(text)
    model = _built(scene, parameters)

    def sketches(result: Result) -> list[Sketch]:
        return scene.view.sketches(scene.resolved, model, result)

    motion: list[Sketch] = []
    if poses is None or of is None or len(of):
        motion = sketches(scene.view.moved(model, samples, **options))
    drawn = motion[:1] if poses is None else sketches(scene.view.posed(model, *poses(model)))
    traces = traces_of(motion)
    for name in of or ():
        check_known(name, traces, f"{model.name} has no moving point")
    paths = traces if of is None else {name: traces[name] for name in of}
    return Sheet(model.description.title, drawn, paths, size or scene.view.unit(scene.resolved))


def _unit(text: str) -> tuple[str, float]:
    """Return a unit of length and its size [m]."""
    size, dimension = parse_quantity(f"1 {text}")
    if dimension != LENGTH:
        raise ModelError(
            f'expected a unit of length for the drawing, such as "mm", got {text!r}, {describe(dimension)}'
        )
    return text, float(size)


def poses_of(texts: Sequence[str], option: str) -> Poses:
    """Return a function that reads the values of poses on the command line, for a model."""

    def read(model: Any) -> tuple[Sequence[float], str]:
        if "kinematics" not in model.capabilities:
            return of_times(texts, option), "time"
        return load(method_of(model).commands["kinematics"].values)(model, texts, option)

    return read


def draw(
    model: Any,
    at: Any,
    over: str | None,
    of: Sequence[str] | None,
    unit: str | None,
    file: str | os.PathLike[str] | None,
) -> Sheet:
    """Return a drawing of a model and write it to a file, if one is given; see ``Model.draw``."""
    over = over or ("input" if "kinematics" in model.capabilities else "time")
    poses = None if at is None else (lambda _: (reals(at, "at").tolist(), over))
    sheet = sheet_of(model.source.scene, poses, of=of, unit=unit, parameters=model.parameters)
    if file is not None:
        sheet.save(file)
    return sheet
