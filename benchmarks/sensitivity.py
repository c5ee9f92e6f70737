"""Exact derivatives: their error on every shipped scene, and the cost of those along runs.

Derivatives are compared with references of 40 digits and more (``tests/shared/exact_slopes.py``). Of linkages
they are those of the positions of all moving points after a short run, by parameters and by initial
coordinates and rates: the places that the constraints determine least. The error is the largest one over the
largest derivative of each direction.

The cost is the ratio of processor times of calls of ``sensitivity`` and of ``simulate`` with equal options,
by dop853: of a four-bar linkage, and of a loop of joints (the scene ``cssp``), with 10 parameters, all places
differentiated forward, and with 100 parameters, one place differentiated backward.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from harness import Case, Measurement, Required, arguments, measure, report_repeats

import symgen
from symgen.scene.loading import SHIPPED, read_scene

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from shared.exact_slopes import SCENES

#: Durations of the runs that are timed [s].
LONG, LONG_LOOP = 60.0, 20.0
#: The coordinate of the four-bar.
CRANK = ["crank.angle"]
#: Largest relative error, and largest costs in runs: forward and backward.
LARGEST, FORWARD, BACKWARD = 1e-9, 5.0, 10.0


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True, slack=True)
    errors = (
        []
        if options.short
        else [
            {"scene": name, "derivatives of": of, "digits": digits, "error": error(), "runs": None}
            for name, (of, digits, error) in sorted(SCENES.items())
        ]
    )
    return report_repeats(lambda: _measured(errors, options.slack), options)


def _measured(errors: list[dict[str, Any]], slack: float) -> Measurement:
    required = [Required(f"{row['scene']}: relative error", row["error"], LARGEST, False) for row in errors]
    rows = [*errors]
    for of, build, end, count, limit, outputs, options in (
        ("four-bar", _four_bar, LONG, 10, FORWARD, ["A.position", "B.position"], {"coordinates": CRANK}),
        ("four-bar", _four_bar, LONG, 100, BACKWARD, ["B.position.x"], {"coordinates": CRANK}),
        ("loop", _pump, LONG_LOOP, 10, FORWARD, ["theta1", "S1", "S4"], {}),
        ("loop", _pump, LONG_LOOP, 100, BACKWARD, ["S4"], {}),
    ):
        ratio = _cost(build(count), end, outputs, options)
        name = f"{of}, {count} parameters, {'forward' if count == 10 else 'backward'}"
        rows.append({"scene": name, "derivatives of": "a run", "digits": None, "error": None, "runs": ratio})
        required.append(Required(f"{name}: cost in runs", ratio, limit * slack, False, True))
    return Measurement("Exact derivatives", rows, required)


def _cost(model: symgen.Model, end: float, outputs: list[str], more: dict[str, Any]) -> float:
    options = {"t_end": end, "rtol": 1e-10, "method": "dop853"}
    asked = {"parameters": [*model.parameters], **options, **more}
    timings = measure(
        {
            "run": Case(lambda: model.simulate(samples=2, **options), 1),
            "derivatives": Case(lambda: model.sensitivity(outputs, **asked), 1),
        },
        rounds=4,
        warm_up=1,
    )
    return timings["derivatives"].processor / timings["run"].processor


def _four_bar(count: int) -> symgen.Model:
    """Return a four-bar linkage with so many tunable parameters: sizes, masses, and springs at its joints."""
    parameters = {"a": "0.3 m", "b": "0.8 m", "c": "0.6 m", "d": "0.9 m", "g": "9.81 m/s^2", "s": "0.5 m"}
    parameters |= {"ma": "0.5 kg", "mb": "1.2 kg", "mc": "0.9 kg", "k": "40 N/m"}
    points: dict[str, Any] = {
        "O": {"at": [0, 0], "ground": True},
        "A": {"at": ["0.16 m", "0.25 m"]},
        "B": {"at": ["0.8 m", "0.6 m"]},
        "C": {"at": ["d", 0], "ground": True},
    }
    springs = [{"between": ["A", "C"], "stiffness": "k", "length": "s"}]
    for i in range((count - len(parameters)) // 2):
        parameters |= {f"k{i}": f"{1 + 0.1 * i:.1f} N/m", f"s{i}": f"{0.3 + 0.01 * i:.2f} m"}
        points[f"G{i}"] = {"at": [f"{0.1 * i:.1f} m", "1 m"], "ground": True}
        springs.append({"between": ["AB"[i % 2], f"G{i}"], "stiffness": f"k{i}", "length": f"s{i}"})
    links = {"crank": "OAa", "coupler": "ABb", "rocker": "CBc"}
    return symgen.build(
        symgen.Scene(
            parameters={name: {"value": value, "tunable": True} for name, value in parameters.items()},
            points=points,
            links={
                name: {"points": [start, end], "mass": f"m{size}", "length": size}
                for name, (start, end, size) in links.items()
            },
            springs=springs,
            gravity={"acceleration": [0, "-g"]},
        )
    )


def _pump(count: int) -> symgen.Model:
    """Return the loop ``cssp`` with so many tunable parameters: sizes, masses, and springs at its slider."""
    data = dict(read_scene(SHIPPED / "cssp.toml").data)
    parameters, loop = dict(data["parameters"]), dict(data["loop"])
    for name in ("rod", "offset", "m_crank", "m_rod", "m_slider"):
        parameters[name] = {"value": parameters[name], "tunable": True}
    more = (count - 10) // 2
    for i in range(more):
        parameters[f"k{i}"] = {"value": f"{1 + 0.1 * i:.1f} N/m", "tunable": True}
        parameters[f"s{i}"] = {"value": f"{0.3 + 0.01 * i:.2f} m", "tunable": True}
    springs = "".join(f" - k{i}*(S4 - s{i})" for i in range(more))
    loop["drives"] = loop["drives"] | {"S4": loop["drives"]["S4"] + springs}
    return symgen.build(symgen.Scene(**{**data, "parameters": parameters, "loop": loop}))


if __name__ == "__main__":
    sys.exit(main())
