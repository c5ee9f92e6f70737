"""A scene as a page that computes: its outputs with the places of all that is drawn, as WebAssembly."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SceneError
from symgen.export import exported
from symgen.export.live import wasm_of
from symgen.inspection.view import drawn_scene
from symgen.pipeline.build import build_selected
from symgen.report.page.live import Live, Slider
from symgen.runtime.kernels.description import ParameterInfo
from symgen.runtime.result.records import converters, shown_in
from symgen.runtime.sweeps.designs import Uniform
from symgen.scene.loading import SceneText, override
from symgen.scene.units import parse_quantity
from symgen.study.sweeps import tunable, values_of

#: A slider without a range of its own goes from the value times the first to the value times the second.
_RANGE = (0.5, 1.5)
#: Starts differ by less over their size where a parameter leaves them as they are.
_SAME = 1e-9


def live_of(text: SceneText, vary: Mapping[str, str], frames: int) -> Live:
    """Return the content of the live page of a scene.

    Parameters
    ----------
    text
        The scene.
    vary
        Ranges ``LOW:HIGH`` of sliders by parameter or key. If empty, all tunable parameters have sliders; in
        a scene without these, the lengths of links, or their masses if no drive moves them.
    frames
        Number of frames of the motion.

    Raises
    ------
    ModelError
        For values that are no range, and elastic links whose shape C does not compute.
    SceneError, BuildError, CacheError, SimulationError
        As for building the scene, and where Zig is missing.
    """
    if frames < 2:
        raise ModelError(f"expected at least 2 frames of a page, got {frames}")
    keys = list(vary) or ([] if _has_tunable(text) else [*_usual(text)])
    text, names = tunable(text, keys)
    if vary:
        text = _with_constants(text, names.values())
    ranges = values_of(text, names, vary)
    wrong = next((name for name, interval in ranges.items() if not isinstance(interval, Uniform)), None)
    if wrong:
        raise ModelError(
            f"expected the range of the slider of {wrong}, got other values\n"
            "  Write --vary KEY=LOW:HIGH, with units."
        )
    recorded, resolved, view, places, plotted, arrows = drawn_scene(text)
    text = cast("SceneText", recorded)
    model = build_selected(text, backend="c")
    code = exported(text)
    entries = [slot.name.partition(" ")[0] for slot in code.outputs]
    d = model.description
    sliders = [_slider(p, ranges.get(p.name), p in d.tunable and not vary) for p in d.parameters]
    if all(slider.low is None for slider in sliders):
        raise ModelError(f"no value of {text.name} has a slider\n  Give one a range: --vary KEY=LOW:HIGH.")
    if "kinematics" not in model.capabilities:
        _check_start(model, sliders)
    keys_by_name, units = {name: key for key, name in names.items()}, converters(d.units)
    outputs = ((slot.name.replace(" ", "."), slot.unit) for slot in code.outputs)
    shown = [(name, *shown_in(name, unit, units)) for name, unit in outputs]
    module = wasm_of(code, frames)
    sketch, caption = view.computed(resolved, model)
    return Live(
        title=d.title,
        caption=caption + _left_out(plotted, entries),
        label="time [s]",
        duration=float(code.t_end) - float(code.t_start),
        code=module,
        frames=frames,
        outputs=shown,
        plotted=[k for k, name in enumerate(entries) if name in plotted],
        arrows=[k for k, name in enumerate(entries) if name in arrows],
        drawn={place: [k for k, name in enumerate(entries) if name == place] for place in places},
        sketch=sketch,
        sliders=[_shown(s, keys_by_name, units, text) for s in sliders],
    )


def _with_constants(text: SceneText, sliders: Collection[str]) -> SceneText:
    """Return a scene; if it has elastic links, whose sections C fixes, only sliders stay tunable."""
    elastic = any("elastic" in link for link in text.data.get("links", {}).values() if isinstance(link, dict))
    table = text.data.get("parameters", {})
    others = [name for name, x in table.items() if isinstance(x, dict) and name not in sliders and elastic]
    return override(text, {f"parameters.{name}.tunable": False for name in others})


def _left_out(requested: Sequence[str], known: Sequence[str]) -> str:
    """Return the sentence on outputs of the scene that C does not compute."""
    left = [name for name in requested if name not in known]
    return f" Not computed on this page: {', '.join(left)}." if left else ""


def _shown(
    slider: Slider, keys: Mapping[str, str], units: Mapping[str, tuple[str, float]], text: SceneText
) -> Slider:
    """Return a slider with the key of the scene, in the unit of ``[units]`` or that in the scene's value."""
    in_si = slider.unit, 1.0
    chosen = units.get(slider.unit, in_si)
    unit, size = chosen if chosen != in_si else _written(text, slider.name) or in_si
    return replace(slider, name=keys.get(slider.name, slider.name), unit=unit, size=size)


def _written(text: SceneText, name: str) -> tuple[str, float] | None:
    """Return the unit in which a scene writes a parameter, and its size in SI; None for an expression."""
    table = text.data.get("parameters", {}).get(name)
    value = table.get("value") if isinstance(table, dict) else table
    match = re.fullmatch(r"[-+\d.eE/]+\s+(.+)", value) if isinstance(value, str) else None
    try:
        return (match[1], float(parse_quantity(f"1 {match[1]}")[0])) if match else None
    except SceneError:  # such as 2 * a
        return None


def _has_tunable(text: SceneText) -> bool:
    parameters = text.data.get("parameters", {}).values()
    return any(isinstance(table, dict) and table.get("tunable") for table in parameters)


def _usual(text: SceneText) -> Iterator[str]:
    """Yield the lengths of links, or their masses where forces move them."""
    keys = ("length",) if "drivers" in text.data else ("mass", "mass_per_length")
    for name, link in text.data.get("links", {}).items():
        yield from (f"links.{name}.{key}" for key in keys if isinstance(link, dict) and key in link)


def _check_start(model: Any, sliders: Sequence[Slider]) -> None:
    """Check that sliders do not change the start of a motion under forces, which pages do not assemble.

    Raises
    ------
    ModelError
        With the slider that moves the start.
    """

    def start(of: Any) -> NDArray[np.float64]:
        if not hasattr(of, "initial_state"):
            return np.asarray(of.closed_start().q, dtype=float)
        state = of.initial_state()
        return np.concatenate([state.q, state.u])

    problem = start(model)
    for slider in sliders:
        for value in (slider.low, slider.high):
            if value is None:
                continue
            moved = np.abs(start(model.with_parameters(**{slider.name: value})) - problem)
            if np.max(moved, initial=0.0) > _SAME * np.max(np.abs(problem), initial=1.0):
                remedy = "masses or loads; lengths where a link is driven"
                if getattr(model.description, "at_equilibrium", False):
                    remedy = "other parameters, or leave out start.equilibrium"
                raise ModelError(
                    f"{slider.name} moves the start of {model.name}, which a live page of a motion under "
                    f"forces does not compute\n  Choose {remedy}."
                )


def _slider(p: ParameterInfo, interval: Any, chosen: bool) -> Slider:
    low: float | None = None
    high: float | None = None
    if isinstance(interval, Uniform):
        low, high = interval.low, interval.high
    elif chosen and p.default and math.isfinite(p.default):
        low, high = sorted(part * p.default for part in _RANGE)
    return Slider(p.name, p.unit, p.about, p.default, low, high)
