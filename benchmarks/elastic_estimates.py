"""Error estimates of runs and of steady states of the shipped elastic scenes, against true errors.

Runs and steady states have tolerances from 1e-2 to 1e-8, runs also given steps; the same with damping
ratios of all modes of the structure. The true error is the difference of stresses from a run or steady
state with many more steps, over their peak, the largest of all stations and times. Errors below that of
round-off have no ratio. ``--short`` takes three tolerances and two numbers of steps.
"""

from __future__ import annotations

import copy
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from harness import Measurement, Required, arguments, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.scene.loading import read_scene

SCENES = (
    *("thesis_four_bar", "elastic_four_bar_free", "elastic_four_bar_motor"),
    *("elastic_slider_crank", "rotating_cantilever", "elastic_four_bar"),
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
#: Scenes whose estimates are measured with damping ratios of all modes too.
MODAL = ("thesis_four_bar", "elastic_slider_crank")


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
        rows.append(
            {
                "scene": f"{scene}{', modal damping' if modal else ''}",
                **found,
                "true error": true,
                "ratio": ratio,
            }
        )
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


def measured(short: bool) -> Measurement:
    """Measure once."""
    rows: list[dict[str, Any]] = []
    required = []
    for scene in SCENES:
        for modal in (False, True)[: 1 + (scene in MODAL)]:
            runs = estimates(scene, modal, short)
            rows += runs
            for call in ("run", "given steps", "steady state"):
                name = f"{runs[0]['scene']}, {call}"
                required += of_estimates(name, [r for r in runs if r["call"] == call])
    return Measurement("Error estimates of elastic runs", rows, required)


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True)
    return report_repeats(lambda: measured(options.short), options)


if __name__ == "__main__":
    sys.exit(main())
