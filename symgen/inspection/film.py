"""A scene as a moving picture: its run with the places of all that is drawn, and a sketch of each sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from symgen.inspection.view import drawn_scene
from symgen.pipeline.build import build_asked
from symgen.report.page.animation import Film
from symgen.runtime.result.result import Result
from symgen.scene.loading import SceneText


def film_of(text: SceneText, samples: int, **asked: Any) -> Film:
    """Run a scene and return its moving picture.

    Parameters
    ----------
    text
        The scene.
    samples
        Number of frames.
    asked
        Further arguments of the analysis that is carried out, such as ``t_end``.

    Raises
    ------
    SceneError, BuildError, CacheError, SimulationError
        As for building and running the scene.
    """
    drawn = drawn_scene(text)
    model = build_asked(drawn.text)
    result = drawn.view.moved(model, samples, **asked)
    sketches = drawn.view.sketches(drawn.resolved, model, result)
    return Film(_shown(result, drawn.plotted), sketches, drawn.view.film_caption)


def _shown(result: Result, names: Sequence[str]) -> Result:
    """Return a result of the named outputs alone."""
    return replace(result, variables=tuple(v for v in result.variables if v.name in names))
