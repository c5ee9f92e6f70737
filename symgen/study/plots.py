"""Plots of a study: one output over the input, with a curve per case and a panel per component."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.result.turn import Turn
from symgen.study.cases import Case

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

#: Fraction of the range around a pole that is ignored when scaling a panel.
_NEAR = 1 / 36
#: Width of a plot, height of a panel, and height of the header and footer [in].
_WIDTH, _PANEL, _ABOVE, _BELOW = 7.5, 1.9, 0.55, 0.8
#: Number of cases per row of the legend, and height of a further row [in].
_COLUMNS, _LINE = 4, 0.2


def shown_input(turn: Turn) -> tuple[Array, str, float]:
    """Return the input values in the unit of plots (angles in degrees), the unit, and its size in SI."""
    return turn.over[0], *turn.shown_in


def components(turn: Turn, name: str) -> Iterator[tuple[str, str, Array]]:
    """Yield name, unit and values of every component of an output, in the units of plots."""
    turn.variable(name)
    v = next(v for v in turn.shown if v.name == name)
    for i, c in enumerate(v.components or ("",)):
        yield f"{name}.{c}" if c else name, v.unit, v.values.reshape(turn.count, -1)[:, i]


def draw(name: str, title: str, cases: Sequence[Case]) -> bytes:
    """Return the plot of an output as PNG; equal values give identical bytes.

    Curves are interrupted at their poles, which dotted lines of the same colour mark. Panels are scaled to
    the values away from the poles.
    """
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    drawn = [(case.label, case.turn) for case in cases if case.turn]
    panels = [(n, unit) for n, unit, _ in components(drawn[0][1], name)]
    below = _BELOW + _LINE * ((len(drawn) - 1) // _COLUMNS)
    height = _ABOVE + below + _PANEL * len(panels)
    figure = Figure(figsize=(_WIDTH, height))
    figure.subplots_adjust(0.11, below / height, 0.975, 1 - _ABOVE / height, hspace=0.1)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    colours = colormaps["viridis"](np.linspace(0.0, 0.88, max(2, len(drawn))))
    counted: list[list[Array]] = [[] for _ in panels]
    for (label, turn), colour in zip(drawn, colours, strict=False):
        x, unit, size = shown_input(turn)
        for panel, kept, (n, _, values) in zip(axes, counted, components(turn, name), strict=True):
            poles = [p.at / size for p in turn.poles if n in p.residues]
            panel.plot(*_broken(x, values, poles), color=colour, linewidth=1.2, label=label)
            for pole in poles:
                panel.axvline(pole, color=colour, linewidth=0.8, linestyle=":")
            off = [np.abs(x - pole) > _NEAR * (x[-1] - x[0]) for pole in poles]
            kept.append(values[np.all([np.isfinite(values), *off], axis=0)])
        axes[-1].set_xlabel(f"{turn.input} [{unit}]")
        _ticks(axes[-1], x, unit)
    for panel, kept, (n, unit) in zip(axes, counted, panels, strict=True):
        _limit(panel, np.concatenate(kept))
        panel.set_ylabel(f"{n.removeprefix(name).lstrip('.') or name} [{unit}]")
        panel.grid(alpha=0.3)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=_COLUMNS, frameon=False, fontsize="small")
    figure.suptitle(f"{name}\n{title}", fontsize="medium", y=1 - 0.1 / height, va="top")
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100, metadata={"Software": None}, pil_kwargs={"optimize": True})
    return stream.getvalue()


def _broken(x: Array, values: Array, poles: Sequence[float]) -> tuple[Array, Array]:
    """Return a curve with a gap at each pole."""
    places = np.searchsorted(x, poles)
    return np.insert(x, places, poles), np.insert(values, places, np.nan)


def _limit(panel: Axes, values: Array) -> None:
    """Set the vertical range of a panel; round-off is shown as zero."""
    low, high = (float(np.min(values)), float(np.max(values))) if len(values) else (0.0, 0.0)
    margin = 0.06 * (high - low) if high - low > 1e-9 * max(1.0, abs(low), abs(high)) else 0.5
    panel.set_ylim(low - margin, high + margin)


def _ticks(panel: Axes, x: Array, unit: str) -> None:
    panel.set_xlim(x[0], x[-1])
    if unit == "deg" and abs(x[-1] - x[0] - 360) < 1e-6:
        panel.set_xticks(np.linspace(x[0], x[-1], 9))
