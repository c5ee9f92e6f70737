"""The page that computes: a mechanism's compiled code with sliders for its parameters."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.report.page.animation import ARROWS, CURVES, as_script, forces_of, lines_of, nodes_of
from symgen.report.page.drawing import Sketch, not_drawn, places_of, view_of_paper
from symgen.report.page.page import environment

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Slider:
    """A parameter by name or key, and the range of its slider; None for one without a slider.

    Values are in SI; they are shown in ``unit``, which has this ``size`` in SI.
    """

    name: str
    unit: str
    about: str
    value: float
    low: float | None
    high: float | None
    size: float = 1.0


@dataclass(frozen=True, slots=True)
class Live:
    """The content of a live page.

    Attributes
    ----------
    title, caption, label
        Texts; ``label`` is the variable along which the mechanism moves, with its unit.
    duration
        Time of the motion [s].
    code
        The WebAssembly module of ``templates/export/live.c.j2``.
    frames
        Number of frames that it computes.
    outputs
        Names of the numbers of a frame, in its order, with unit and its size in SI.
    plotted, arrows
        Which of them are plotted, and which are components of forces that are drawn only.
    drawn
        Indices of the outputs on which the picture depends linearly, by name.
    sketch
        The picture as a function of the values of these outputs.
    sliders
        All parameters, in the order of the code.
    """

    title: str
    caption: str
    label: str
    duration: float
    code: bytes
    frames: int
    outputs: Sequence[tuple[str, str, float]]
    plotted: Sequence[int]
    arrows: Sequence[int]
    drawn: Mapping[str, Sequence[int]]
    sketch: Callable[[Mapping[str, Array]], Sketch]
    sliders: Sequence[Slider]


def live(page: Live) -> str:
    """Return a self-contained HTML page that computes the motion for the values of its sliders."""
    none = {name: np.zeros(len(places)) for name, places in page.drawn.items()}
    first = page.sketch(none)
    constant = places_of(first)
    weights = []
    for name, places in page.drawn.items():
        for i, output in enumerate(places):
            one = np.zeros(len(places))
            one[i] = 1.0
            change = (places_of(page.sketch({**none, name: one})) - constant).ravel()
            weights += [[int(v), output, float(change[v])] for v in np.flatnonzero(change)]
    nodes = nodes_of(first)
    curves, arrows = (
        [dict(zip(("name", "unit", "size"), page.outputs[k], strict=True), output=k) for k in numbers]
        for numbers in (page.plotted, page.arrows)
    )
    forces = forces_of([*curves, *arrows], nodes)
    data = {
        "code": base64.b64encode(page.code).decode("ascii"),
        "frames": page.frames,
        "outputs": len(page.outputs),
        "constant": constant.ravel().tolist(),
        "weights": weights,
        "parameters": [asdict(s) for s in page.sliders],
        "film": {
            "title": page.title,
            "along": {"label": page.label},
            "duration": page.duration,
            "view": np.round(view_of_paper(first), 6).tolist(),
            "lines": lines_of(first),
            "nodes": nodes,
            "forces": forces,
            "curves": curves[:CURVES],
        },
    }
    left = max(0, len(page.plotted) - CURVES)
    caption = page.caption + (ARROWS if forces else "") + not_drawn(left)
    template = environment().get_template("live.html.j2")
    return template.render(title=page.title, caption=caption, data=as_script(data))
