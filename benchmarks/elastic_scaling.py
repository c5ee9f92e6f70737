"""Cost of a step of elastic linkages by elements per link, and error estimates against true errors.

Constraints bind the elastic motion of most linkages: the shipped slider-crank, its modal damping replaced by
one proportional to stiffness; and the shipped four-bar with a rigid coupler between inextensible links, with
a rigid crank and inextensible other links, and with all links inextensible. In others the coupler of the
four-bar is joined to the middle of a longer output link, or has an arm welded to it. The slider-crank is also
in large rotation, by collocation with 4 stages. Damping couples all unknowns of the others: the four-bar with
a damping ratio of all modes of the structure, and with one of its links. The time is processor time of one
step of the default method, Gauss collocation with 6 stages. Links of up to 10
elements with damping ratios have full matrices, which cost less than the forces of 24 modes on each longer
link: the exponent of this linkage is that from 20 elements on, and the one from 5 on is a note.

Error estimates are those of the shipped elastic scenes: of runs and of steady states at tolerances from 1e-2
to 1e-8, and of runs with given steps; and the same with damping ratios of all modes of the structure. The
true error is the difference of stresses from a run or steady state with many more steps, over their peak, the
largest of all stations and times. Errors below that of round-off have no ratio. ``--short`` takes
up to 100 elements, three tolerances and two numbers of steps.
"""

from __future__ import annotations

import copy
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from harness import Case, Measurement, Required, arguments, measure, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.runtime._beams import BeamSteps
from symgen.runtime.beams.methods import BEAM_METHODS, GAUSS8
from symgen.runtime.elastic.large.collocation import moved
from symgen.runtime.elastic.large.linkage import LargeLinkage
from symgen.runtime.integrate.pace import Pace
from symgen.scene.loading import read_scene

ELEMENTS, STEPS, ROUNDS, EXPONENT = (5, 10, 20, 50, 100, 200), 3, 4, 1.2
SCENES = (
    *("thesis_four_bar", "elastic_four_bar_free", "elastic_four_bar_motor"),
    *("elastic_slider_crank", "rotating_cantilever", "elastic_four_bar"),
)
#: Elements per link from which costs are compared, where fewer have full matrices.
BANDED = {"damping ratios of links": 20}
COLUMNS = (
    *("linkage", "elements per link", "step [ms]"),
    *("call", "rtol", "steps", "estimate", "true error", "ratio"),
)
SAMPLES = 361
#: Tolerances of estimated errors; those of a short measurement.
TOLERANCES, SHORT_TOLERANCES = tuple(10.0**-k for k in range(2, 9)), (1e-2, 1e-5, 1e-8)
#: Steps per revolution of runs with given steps; steps between recorded times of references.
GIVEN, SHORT_GIVEN, FINE, FINE_STEADY = (400, 720, 1100, 1500, 2200, 3600), (720, 2200), 80, 12
#: Round-off of stresses of steady states of undamped linkages; that of a slow one, whose 15,000 steps differ
#: by as much from references of 4,320 and of 30,240.
ROUND_OFF, SLOW = 1e-10, {"elastic_four_bar": 4e-10}
#: The least and the largest part of an error estimate that the true error may be.
OVER, AT_MOST = 3.0, 30.0
SHORT = {"axial": False}
RATIO = {"damping": {"ratio": 0.01}}
#: Scenes whose estimates are measured with damping ratios of all modes too.
MODAL = ("thesis_four_bar", "elastic_slider_crank")
#: Linkages: shipped scene, and what its links have under `elastic`; None is a rigid link.
LINKAGES: dict[str, tuple[str, dict[str, dict[str, Any] | None]]] = {
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
    motion = linkage(name, elements)._motion(True)
    h = motion.period / 100_000
    if name == "large rotation":
        system, end = LargeLinkage(motion, elements), STEPS * h
        return Case(lambda: moved(system, GAUSS8, np.array([0.0, end]), STEPS, Pace(0.0, end)), STEPS)
    equations = motion.equations(stepping=True)
    stepper = BeamSteps(equations, BEAM_METHODS["gauss"], 1)
    rest = np.zeros((motion.layout.unknowns, 1))
    motion.check(equations, stepper.start(0.0, rest, rest), 0.0)
    return Case(lambda: motion.check(equations, stepper.advance(0.0, STEPS * h, STEPS), 0.0), STEPS)


def row(linkage: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return a row of the table."""
    return {**dict.fromkeys(COLUMNS), "linkage": linkage, **values}


def stresses(result: Any) -> dict[str, NDArray[np.float64]]:
    """Return the stresses of a result by their names."""
    return {v.name: v.values for v in result.variables if v.name.endswith(".stress")}


def error(found: Any, exact: Any) -> float:
    """Return the largest error of the stresses of a result over their peaks."""
    pairs = [(stresses(found)[name], values) for name, values in stresses(exact).items()]
    return max(float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for a, b in pairs if np.any(b))


def modally_damped(scene: str) -> Any:
    """Return the model of a scene with a damping ratio of all modes of the structure, and none of links."""
    data = copy.deepcopy(dict(read_scene(scene).data))
    for link in data["links"].values():
        link.get("elastic", {}).pop("damping", None)
    return symgen.build(symgen.Scene(**data, modal_damping={"ratio": 0.01}))


def estimates(scene: str, modal: bool, short: bool) -> list[dict[str, Any]]:
    """Return call, tolerance, steps, error estimate and true error of runs of a scene."""
    model = modally_damped(scene) if modal else symgen.build(scene)
    exact = model.simulate(steps=(SAMPLES - 1) * FINE, samples=SAMPLES)
    steady = model.periodic(steps=(SAMPLES - 1) * FINE_STEADY, samples=SAMPLES)
    tolerances, given = (SHORT_TOLERANCES, SHORT_GIVEN) if short else (TOLERANCES, GIVEN)
    calls = [
        *(("run", rtol, model.simulate, exact, {"rtol": rtol}) for rtol in tolerances),
        *(("given steps", None, model.simulate, exact, {"steps": steps}) for steps in given),
        *(("steady state", rtol, model.periodic, steady, {"rtol": rtol}) for rtol in tolerances),
    ]
    rows = []
    for call, rtol, verb, reference, options in calls:
        run = verb(**options, samples=SAMPLES)
        true, estimate = error(run, reference), run.statistics["error"]
        found = {"call": call, "rtol": rtol, "steps": run.statistics["steps"], "estimate": estimate}
        ratio = estimate / true if true > SLOW.get(scene, ROUND_OFF) else None
        rows.append(row(scene, {**found, "true error": true, "ratio": ratio}))
    return rows


def of_estimates(name: str, runs: Sequence[dict[str, Any]]) -> list[Required]:
    """Return the required lines on the error estimates of runs."""
    required = []
    if within := [run["estimate"] / run["rtol"] for run in runs if run["rtol"]]:
        required.append(Required(f"estimates within rtol, {name}", max(within), 1.0, False))
    if ratios := [run["ratio"] for run in runs if run["ratio"]]:  # none where true errors are round-off
        required += [
            Required(f"least estimate over true error, {name}", min(ratios), OVER, True),
            Required(f"largest estimate over true error, {name}", max(ratios), AT_MOST, False),
        ]
    return required


def exponent(costs: dict[int, float]) -> float:
    """Return the exponent of costs by numbers of elements."""
    return float(np.polyfit(np.log(list(costs)), np.log(list(costs.values())), 1)[0])


def measured(slack: float, short: bool) -> Measurement:
    """Measure once."""
    rows: list[dict[str, Any]] = []
    required = []
    notes = [f"Best of {ROUNDS} rounds of {STEPS} steps; exponents by least squares of logarithms."]
    for name in LINKAGES:
        costs = {}
        for elements in ELEMENTS[:-1] if short else ELEMENTS:
            costs[elements] = measure({"": step(name, elements)}, ROUNDS, 1)[""].processor
            rows.append(row(name, {"elements per link": elements, "step [ms]": costs[elements] * 1e3}))
        least = BANDED.get(name, ELEMENTS[0])
        compared = {elements: cost for elements, cost in costs.items() if elements >= least}
        title = f"exponent of a step, {name}" + (f", from {least} elements on" if name in BANDED else "")
        required.append(Required(title, exponent(compared), EXPONENT * slack, False, timed=True))
        if name in BANDED:
            notes.append(f"Exponent of a step, {name}, from {ELEMENTS[0]} on: {exponent(costs):.2f}.")
    for scene in SCENES:
        for modal in (False, True)[: 1 + (scene in MODAL)]:
            runs = estimates(scene, modal, short)
            rows += runs
            for call in ("run", "given steps", "steady state"):
                name = f"{scene}{', modal damping' if modal else ''}, {call}"
                required += of_estimates(name, [r for r in runs if r["call"] == call])
    return Measurement(
        "Steps of elastic linkages by elements per link, and their error estimates", rows, required, notes
    )


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True, slack=True)
    return report_repeats(lambda: measured(options.slack, options.short), options)


if __name__ == "__main__":
    sys.exit(main())
