"""Cost of a step of elastic linkages with a guide, rigid or inextensible links, by elements per link.

Constraints bind the elastic motion of each linkage: the shipped slider-crank, its modal damping replaced by
one proportional to stiffness; and the shipped four-bar with a rigid coupler between inextensible links, with
a rigid crank and inextensible other links, and with all links inextensible. The time is processor time of one
step of the default method, Gauss collocation with 6 stages.
"""

from __future__ import annotations

import copy
import sys
from typing import Any

import numpy as np
from harness import Case, Measurement, Required, arguments, measure, report_repeats

import symgen
from symgen.runtime._beams import BeamSteps
from symgen.runtime.beams.methods import BEAM_METHODS
from symgen.scene.loading import read_scene

ELEMENTS, STEPS, ROUNDS, EXPONENT = (5, 10, 20, 50, 100, 200), 10, 5, 1.2
SHORT = {"axial": False}
#: Linkages: shipped scene, and what its links have under `elastic`; None is a rigid link.
LINKAGES: dict[str, tuple[str, dict[str, dict[str, Any] | None]]] = {
    "slider-crank": ("elastic_slider_crank", {"rod": {"damping": {"stiffness": "1e-6 s"}}}),
    "rigid coupler": ("elastic_four_bar", {"crank": SHORT, "coupler": None, "output": SHORT}),
    "rigid crank": ("elastic_four_bar", {"crank": None, "coupler": SHORT, "output": SHORT}),
    "inextensible links": ("elastic_four_bar", {"crank": SHORT, "coupler": SHORT, "output": SHORT}),
}


def linkage(name: str, elements: int) -> Any:
    """Return the model of a linkage with so many elements per elastic link."""
    scene, changes = LINKAGES[name]
    data = copy.deepcopy(dict(read_scene(scene).data))
    for link, options in changes.items():
        if options is None:
            del data["links"][link]["elastic"]
        else:
            data["links"][link]["elastic"] |= {**options, "elements": elements}
    return symgen.build(symgen.Scene(**data))


def step(name: str, elements: int) -> Case:
    """Return the case of a few steps from rest."""
    motion = linkage(name, elements)._motion(True)
    equations = motion.equations(stepping=True)
    stepper = BeamSteps(equations, BEAM_METHODS["gauss"], 1)
    rest = np.zeros((motion.layout.unknowns, 1))
    motion.check(equations, stepper.start(0.0, rest, rest), 0.0)
    h = motion.period / 100_000
    return Case(lambda: motion.check(equations, stepper.advance(0.0, STEPS * h, STEPS), 0.0), STEPS)


def measured() -> Measurement:
    """Measure once."""
    rows, required = [], []
    for name in LINKAGES:
        costs = {}
        for elements in ELEMENTS:
            costs[elements] = measure({"": step(name, elements)}, ROUNDS, 1)[""].processor
            rows.append({"linkage": name, "elements per link": elements, "step [ms]": costs[elements] * 1e3})
        exponent = float(np.polyfit(np.log(list(costs)), np.log(list(costs.values())), 1)[0])
        required.append(Required(f"exponent of a step, {name}", exponent, EXPONENT, False, timed=True))
    notes = [f"Best of {ROUNDS} rounds of {STEPS} steps; exponents by least squares of logarithms."]
    return Measurement("A step of constrained elastic linkages by elements per link", rows, required, notes)


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__)
    return report_repeats(measured, repeats=options.repeats, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
