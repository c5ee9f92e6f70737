"""Cost of a step of elastic linkages by elements per link.

The shipped four-bar has no constraints on its elastic motion. They bind that of most other linkages: the
shipped slider-crank, its modal damping replaced by one proportional to stiffness; and the four-bar with a
rigid coupler between inextensible links, with a rigid crank and inextensible other links, and with all
links inextensible. In others the coupler of the four-bar is joined to the middle of a longer output link,
or has an arm welded to it. The slider-crank is also in large rotation, by collocation with 4 stages.
Damping couples all unknowns of the others: the four-bar with a damping ratio of all modes of the
structure, and with one of its links. The time is processor time of one step of the default method, Gauss
collocation with 6 stages. Links of up to 10 elements with damping ratios have full matrices, which cost
less than the forces of 24 modes on each longer link: the exponent of this linkage is that from 20
elements on, and the one from 5 on is a note. ``--short`` takes up to 100 elements.
"""

from __future__ import annotations

import copy
import sys
from typing import Any

import numpy as np
from harness import Case, Measurement, Required, arguments, measure, report_repeats

import symgen
from symgen.runtime import _core
from symgen.runtime.beams.methods import GAUSS, GAUSS8, integrator_of
from symgen.runtime.elastic.large.collocation import SystemRun
from symgen.runtime.elastic.large.linkage import LargeLinkage
from symgen.scene.loading import read_scene

ELEMENTS, STEPS, ROUNDS, EXPONENT = (5, 10, 20, 50, 100, 200), 3, 4, 1.2
#: Elements per link from which costs are compared, where fewer have full matrices.
BANDED = {"damping ratios of links": 20}
SHORT = {"axial": False}
RATIO = {"damping": {"ratio": 0.01}}
#: Linkages: shipped scene, and what its links have under `elastic`; None is a rigid link.
LINKAGES: dict[str, tuple[str, dict[str, dict[str, Any] | None]]] = {
    "four-bar": ("thesis_four_bar", {}),
    "slider-crank": ("elastic_slider_crank", {"rod": {"damping": {"stiffness": "1e-6 s"}}}),
    "rigid coupler": ("thesis_four_bar", {"crank": SHORT, "coupler": None, "output": SHORT}),
    "rigid crank": ("thesis_four_bar", {"crank": None, "coupler": SHORT, "output": SHORT}),
    "inextensible links": ("thesis_four_bar", {"crank": SHORT, "coupler": SHORT, "output": SHORT}),
    "joint between ends": ("thesis_four_bar", {}),
    "weld": ("thesis_four_bar", {}),
    "large rotation": ("elastic_slider_crank", {"rod": {"damping": {"stiffness": "1e-6 s"}}}),
    "modal damping": ("thesis_four_bar", {}),
    "damping ratios of links": ("thesis_four_bar", dict.fromkeys(("crank", "coupler", "output"), RATIO)),
}


def linkage(name: str, elements: int) -> Any:
    """Return the model of a linkage with so many elements per elastic link."""
    scene, changes = LINKAGES[name]
    data = copy.deepcopy(dict(read_scene(scene).data))
    for link, options in changes.items():
        if options is None:
            del data["links"][link]["elastic"]
        else:
            data["links"][link]["elastic"] |= options
    for link in data["links"].values():
        if "elastic" in link:
            link["elastic"]["elements"] = elements
    if name == "joint between ends":
        data["points"] |= {
            "T": {"at": ["-4 in", "18.74 in"]},
            "B": {"on": "output", "fraction": 0.5},
        }
        data["links"]["output"] |= {"points": ["T", "Q"], "length": "2*c"}
    if name == "weld":
        data["points"]["D"] = {"at": ["3.5 in", "15 in"]}
        data["links"]["arm"] = copy.deepcopy(data["links"]["coupler"]) | {
            "points": ["B", "D"],
            "length": "6 in",
        }
        data["welds"] = [{"point": "B", "links": ["coupler", "arm"]}]
    if name == "modal damping":
        data["modal_damping"] = {"ratio": 0.01}
    return symgen.build(symgen.Scene(**data))


def step(name: str, elements: int) -> Case:
    """Return the case of a few steps from rest."""
    motion = linkage(name, elements).motion(True)
    h = motion.period / 100_000
    if name == "large rotation":
        system, end = LargeLinkage(motion, elements), STEPS * h
        return Case(lambda: SystemRun(system, GAUSS8, np.array([0.0, end]), STEPS).run().moments(), STEPS)
    equations = motion.equations(stepping=True)
    rest, end = np.zeros(equations.dim), motion.period
    run = _core.Run(
        equations, integrator_of(GAUSS), 0.0, rest, end, 0.0, 0.0, h, np.array([end]),
        stabilisation=_core.STABILISATIONS["raw"],
    )  # fmt: skip
    assert run.begin() == _core.MORE
    return Case(lambda: run.advance(STEPS), STEPS)


def exponent(costs: dict[int, float]) -> float:
    """Return the exponent of costs by numbers of elements."""
    return float(np.polyfit(np.log(list(costs)), np.log(list(costs.values())), 1)[0])


def measured(slack: float, short: bool) -> Measurement:
    """Measure once."""
    rows, required = [], []
    notes = [f"Best of {ROUNDS} rounds of {STEPS} steps; exponents by least squares of logarithms."]
    for name in LINKAGES:
        costs = {}
        for elements in ELEMENTS[:-1] if short else ELEMENTS:
            costs[elements] = measure({"": step(name, elements)}, ROUNDS, 1)[""].processor
        least = BANDED.get(name, ELEMENTS[0])
        found = exponent({elements: cost for elements, cost in costs.items() if elements >= least})
        title = f"exponent of a step, {name}" + (f", from {least} elements on" if name in BANDED else "")
        required.append(Required(title, found, EXPONENT * slack, False, timed=True))
        each = {f"{elements} elements [ms]": cost * 1e3 for elements, cost in costs.items()}
        rows.append({"linkage": name, **each, "exponent": found})
        if name in BANDED:
            notes.append(f"Exponent of a step, {name}, from {ELEMENTS[0]} on: {exponent(costs):.2f}.")
    return Measurement("Steps of elastic linkages by elements per link", rows, required, notes)


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True, slack=True)
    return report_repeats(lambda: measured(options.slack, options.short), options)


if __name__ == "__main__":
    sys.exit(main())
