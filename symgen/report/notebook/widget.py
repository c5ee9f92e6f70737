"""A notebook widget: sliders of parameters, and picture and curves of the run with their values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from symgen.errors import ModelError, SymgenError, check_tunable
from symgen.report.page.animation import animation
from symgen.report.page.page import environment
from symgen.runtime.kernels.arguments import is_real
from symgen.runtime.sweeps.sweep import usual_analysis

if TYPE_CHECKING:
    from symgen.runtime.model.compiled import Compiled

#: Analyses whose results move.
_MOVING = ("simulate", "kinematics", "inverse_dynamics", "periodic", "quasi_static")


def widget(
    model: Compiled,
    vary: Mapping[str, Any],
    analysis: str | None,
    frames: int,
    arguments: Mapping[str, Any],
) -> Any:
    """Return the widget of a model; see ``Model.widget``."""
    try:
        import anywidget
        import traitlets
    except ModuleNotFoundError:
        raise ModelError(
            "widgets need anywidget, which is not installed\n  pip install 'symgen[notebook]' installs it."
        ) from None
    verb = (analysis or usual_analysis(model)).replace("-", "_")  # as commands are named
    if verb not in _MOVING:
        raise ModelError(f"expected an analysis with a motion, {', '.join(_MOVING)}, got {verb!r}")
    ranges = {name: _range(model, name, interval) for name, interval in vary.items()}
    if not ranges:
        raise ModelError(f"expected parameters to vary, got none\n  {model.name} has {_tunable(model)}.")

    def page_of(values: Mapping[str, float]) -> str:
        run = getattr(model.with_parameters(**values), verb)(**arguments)
        return animation(run.animate(frames=frames), framed=True)

    start = {name: model.parameters[name] for name in ranges}

    class ParameterWidget(anywidget.AnyWidget):
        """Sliders by ``values``; ``page`` is that of the last run, ``failure`` the message of one without."""

        _esm = environment().get_template("parts/widget.js.j2").render()
        sliders = traitlets.List([_slider(model, name, *interval) for name, interval in ranges.items()]).tag(
            sync=True
        )
        values = traitlets.Dict(start).tag(sync=True)
        page = traitlets.Unicode(page_of(start)).tag(sync=True)
        failure = traitlets.Unicode("").tag(sync=True)

        @traitlets.observe("values")
        def _rerun(self, change: Any) -> None:
            try:
                self.page, self.failure = page_of(change["new"]), ""
            except SymgenError as error:
                self.failure = str(error)

    return ParameterWidget()


def _range(model: Compiled, name: str, interval: Any) -> tuple[float, float]:
    check_tunable(name, model.parameters, model.name)
    low, high = getattr(interval, "bounds", interval)
    if not (is_real(low) and is_real(high) and math.isfinite(low) and math.isfinite(high) and low < high):
        raise ModelError(
            f"expected the range of {name} as a lower and a higher finite value in SI units, got {interval!r}"
        )
    return float(low), float(high)


def _slider(model: Compiled, name: str, low: float, high: float) -> dict[str, Any]:
    unit = next(p.unit for p in model.description.tunable if p.name == name)
    return {"name": name, "unit": unit, "low": low, "high": high}


def _tunable(model: Compiled) -> str:
    names = ", ".join(model.parameters)
    return f"the tunable parameters {names}" if names else "no tunable parameters"
