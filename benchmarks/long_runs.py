"""Drift of energy and lengths over a million steps, for each method of constraint stabilisation.

A planar chain of uniform rods, with a total of 1 m and 1 kg, is released horizontally with alternating joint
angles of 0.1 rad; the four-bar linkage of the shipped scene keeps rotating. Steps are fixed. Energy errors
are relative to m g L/2 for the chain and to the exchanged energy for the four-bar; length errors are in
metres; both are maxima over all steps. The trend is the slope of the energy error over the recorded times,
times the duration, which excludes oscillations. Without projection, the equations of motion enforce only
second derivatives of lengths, plus Baumgarte's terms. Times are processor times, unaffected by other load.

``--plots FOLDER`` plots the drift over time; ``--short`` runs a tenth of the steps.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from harness import Required, report
from numpy.typing import NDArray

import symgen
from symgen.errors import SimulationError

Array = NDArray[np.float64]

STEPS, SAMPLES, G = 1_000_000, 2001, 9.81
#: Limits of the plotted errors: round-off and broken-down runs lie on the limits.
SHOWN = (1e-17, 1e2)


@dataclass(frozen=True)
class Way:
    """A stabilisation method: its name, and the options of a run as a function of the step."""

    name: str
    method: str = "rk4"
    options: Mapping[str, Any] = field(default_factory=dict)
    rate_by_step: bool = False

    def given(self, step: float) -> dict[str, Any]:
        """Return the options of ``model.simulate``."""
        more = dict(self.options)
        if self.rate_by_step:
            more["stabilisation_rate"] = 1 / step
        return {"method": self.method, "step": step, **more}


def _baumgarte(name: str, rate: float | None = None) -> Way:
    options: dict[str, Any] = {"stabilisation": "baumgarte"}
    if rate is not None:
        options["stabilisation_rate"] = rate
    return Way(name, options=options, rate_by_step=rate is None)


WAYS = (
    Way("raw RK4", options={"stabilisation": "raw"}),
    _baumgarte("RK4, Baumgarte 5/s", 5.0),
    _baumgarte("RK4, Baumgarte 50/s", 50.0),
    _baumgarte("RK4, Baumgarte 1/h"),
    Way("RK4, projection"),
    Way("RATTLE", "rattle"),
    Way("RATTLE, order 4", "rattle4"),
)
#: System and step [s]; rods.md of the derivation has the same table.
RUNS = (("chain of 2", 1e-3), ("chain of 3", 1e-3), ("chain of 3", 5e-3), ("four-bar", 1e-3))


@dataclass(frozen=True)
class Drift:
    """Energy error over its scale and length error [m] at the recorded times, with the maximum of each."""

    times: Array
    energy: Array
    length: Array
    worst_energy: float
    worst_length: float
    steps: int
    died: str
    seconds: float

    @property
    def trend(self) -> float:
        """The growth of the energy error over the run, from a linear fit."""
        if len(self.times) < 3:
            return math.nan
        return float(np.polyfit(self.times / self.times[-1], self.energy, 1)[0])


@cache
def system(name: str) -> tuple[Any, float]:
    """Return a model and the scale of its energy errors [J]; 0 for the exchanged energy."""
    if name == "four-bar":
        outputs = [*(f"{p}.position" for p in "OABC"), "energy"]
        return symgen.build("four_bar", set={"analysis.outputs": outputs}), 0.0
    count = int(name.rpartition(" ")[2])
    points: dict[str, Any] = {"P0": {"at": ["0 m", "0 m"], "ground": True}}
    place = np.zeros(2)
    for i in range(count):
        angle = 0.1 if i % 2 else 0.0
        place = place + np.array([math.cos(angle), math.sin(angle)]) / count
        points[f"P{i + 1}"] = {"at": [f"{x!r} m" for x in place.tolist()]}
    links = {
        f"L{i}": {"points": [f"P{i}", f"P{i + 1}"], "mass": f"{1 / count!r} kg", "length": f"{1 / count!r} m"}
        for i in range(count)
    }
    scene = symgen.Scene(
        points=points,
        links=links,
        gravity={"acceleration": ["0 m/s^2", f"{-G} m/s^2"]},
        analysis={"outputs": [*(f"{p}.position" for p in points), "energy"]},
    )
    return symgen.build(scene.called(f"chain_of_{count}")), G / 2


def drift(name: str, step: float, way: Way, steps: int) -> Drift:
    """Run and return the drift, up to the breakdown if there is one."""
    model, scale = system(name)
    begun = process_time()
    died = ""
    try:
        result = model.simulate(steps * step, samples=SAMPLES, **way.given(step))
    except SimulationError as error:
        if error.partial is None:
            raise
        result, died = error.partial, f"step {round(error.time / step)}"
    seconds = process_time() - begun
    found = result.drift
    scale = scale or found.energy_exchanged
    energy = result.variable("energy").values
    return Drift(
        result.time,
        (energy - energy[0]) / scale,
        _lengths(model, result),
        found.energy / scale,
        found.constraint,
        result.statistics["steps"],
        died,
        seconds,
    )


def _lengths(model: Any, result: Any) -> Array:
    """Return the largest error of a link's length at every recorded time [m]."""
    places = {v.name.partition(".")[0]: v.values for v in result.variables if v.name.endswith(".position")}
    lengths = [np.linalg.norm(places[b] - places[a], axis=1) for a, b in model.description.links.values()]
    return np.max([np.abs(length - length[0]) for length in lengths], axis=0)


def rows_of(found: Mapping[tuple[str, float, str], Drift]) -> Iterator[dict[str, Any]]:
    """Yield one row per run."""
    for (name, step, way), d in found.items():
        yield {
            "system": name,
            "h [s]": step,
            "method": way,
            "energy error": d.worst_energy,
            "trend": d.trend,
            "length error [m]": d.worst_length,
            "breaks down at": d.died or None,
            "us/step": 1e6 * d.seconds / max(d.steps, 1),
        }


def required(found: Mapping[tuple[str, float, str], Drift]) -> list[Required]:
    """Return the criteria of each method, following the table of the derivation."""

    def worst(what: str, name: str, *, way: str, step: float = 1e-3) -> float:
        return abs(float(getattr(found[name, step, way], what)))

    lines = []
    for name in ("chain of 2", "chain of 3", "four-bar"):
        for way in ("RK4, projection", "RATTLE"):
            lines.append(
                Required(f"length error, {name}, {way}", worst("worst_length", name, way=way), 1e-14, False)
            )
        raw = worst("worst_length", name, way="raw RK4") / worst(
            "worst_length", name, way="RK4, Baumgarte 50/s"
        )
        lines.append(
            Required(f"length error of raw RK4 over that of Baumgarte 50/s, {name}", raw, 100.0, True)
        )
    for name in ("chain of 2", "chain of 3"):
        swing = worst("worst_energy", name, way="RATTLE")
        lines.append(Required(f"energy error of RATTLE, {name}", swing, 2e-3, False))
        part = worst("trend", name, way="RATTLE") / swing
        lines.append(Required(f"trend over largest energy error, RATTLE, {name}", part, 0.1, False))
    return lines


def draw(found: Mapping[tuple[str, float, str], Drift], folder: Path) -> list[Path]:
    """Plot the drift of energy and lengths over time, one figure per system and step."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, step in dict.fromkeys((name, step) for name, step, _ in found):
        figure = Figure(figsize=(7.5, 6), layout="constrained")
        panels = figure.subplots(2, 1, sharex=True)
        curves = {way: d for (n, s, way), d in found.items() if (n, s) == (name, step)}
        colours = colormaps["viridis"](np.linspace(0, 0.92, len(curves)))
        for (way, d), colour in zip(curves.items(), colours, strict=True):
            for panel, values in zip(panels, (np.abs(d.energy), d.length), strict=True):
                panel.semilogy(
                    d.times[1:] / step, np.clip(values[1:], *SHOWN), color=colour, lw=0.8, label=way
                )
        for panel, label in zip(panels, ("energy error", "length error [m]"), strict=True):
            panel.set_ylabel(label)
            panel.grid(alpha=0.3)
        panels[1].set_xlabel(f"steps of {step:g} s")
        panels[0].set_title(name)
        figure.legend(
            *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False
        )
        files.append(folder / f"long_runs_{name.replace(' ', '_').replace('-', '_')}_{step:g}.png")
        figure.savefig(files[-1], dpi=110)
    return files


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument("--short", action="store_true", help="a tenth of the steps")
    parser.add_argument("--plots", type=Path, metavar="FOLDER", help="draw the drift over time")
    options = parser.parse_args(arguments)
    steps = STEPS // 10 if options.short else STEPS
    found = {(n, h, way.name): drift(n, h, way, steps) for n, h in RUNS for way in WAYS}
    files = draw(found, options.plots) if options.plots else []
    return report(
        f"Drift over {steps} steps",
        list(rows_of(found)),
        required(found),
        notes=[f"drawn: {file}" for file in files],
        as_json=options.json,
    )


if __name__ == "__main__":
    sys.exit(main())
