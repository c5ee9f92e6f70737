"""Exact derivatives along runs: their error on every shipped linkage, and their cost.

The derivatives of the places of all moving points after a short run, by tunable parameters and by initial
coordinates and rates, are compared with differences of runs in float128 with a tolerance of 1e-18.
Central differences at three steps are extrapolated to the sixth order. The error is the largest one over
the largest derivative of each direction. Coordinates are the places that the constraints determine least.

The cost is the ratio of processor times of calls of ``sensitivity`` and of ``simulate`` with equal options:
of a four-bar linkage, and of a loop of joints (the scene ``cssp``), with 10 parameters, all places
differentiated forward, and with 100 parameters, one place differentiated backward.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from harness import Case, Measurement, Required, arguments, measure, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.errors import CapabilityError, ModelError
from symgen.scene.loading import SHIPPED, read_scene

Array = NDArray[np.float64]

#: Duration of the runs that are compared, over that of the scene, and of those that are timed [s].
PART, LONG, LONG_LOOP = 0.05, 60.0, 20.0
#: The coordinate of the four-bar.
CRANK = ["crank.angle"]
#: Largest relative error, and largest costs in runs: forward and backward.
LARGEST, FORWARD, BACKWARD = 1e-9, 5.0, 10.0
#: Parameters that contradict redundant constraints: ``sensitivity`` refuses them by name.
CONTRADICTING = {"double_four_bar": ("excess",)}
#: Starts in doubles have too few digits for differences where lengths, masses or places differ that much.
#: Derivatives at these starts are compared in tests/runtime/test_sensitivity_scenes.py.
OMITTED = ("far_origin", "length_ratios", "mass_ratios")
#: Directions at most of each linkage.
DIRECTIONS = 8
#: Steps of the differences, over the size of what changes.
STEPS = np.array([1.0, 0.5, 0.25]) * 1e-3


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True, slack=True)
    errors = [] if options.short else list(_errors())
    return report_repeats(lambda: _measured(errors, options.slack), options)


def _measured(errors: list[dict[str, Any]], slack: float) -> Measurement:
    required = [Required(f"{row['linkage']}: relative error", row["error"], LARGEST, False) for row in errors]
    rows = [*errors]
    for of, build, end, count, limit, outputs, options in (
        ("four-bar", _four_bar, LONG, 10, FORWARD, ["A.position", "B.position"], {"coordinates": CRANK}),
        ("four-bar", _four_bar, LONG, 100, BACKWARD, ["B.position.x"], {"coordinates": CRANK}),
        ("loop", _pump, LONG_LOOP, 10, FORWARD, ["theta1", "S1", "S4"], {}),
        ("loop", _pump, LONG_LOOP, 100, BACKWARD, ["S4"], {}),
    ):
        ratio = _cost(build(count), end, outputs, options)
        name = f"{of}, {count} parameters, {'forward' if count == 10 else 'backward'}"
        rows.append({"linkage": name, "directions": count, "error": None, "runs": ratio})
        required.append(Required(f"{name}: cost in runs", ratio, limit * slack, False, True))
    return Measurement("Derivatives along runs", rows, required)


def _cost(model: symgen.Model, end: float, outputs: list[str], more: dict[str, Any]) -> float:
    options = {"t_end": end, "rtol": 1e-10}
    asked = {"parameters": [*model.parameters], **options, **more}
    timings = measure(
        {
            "run": Case(lambda: model.simulate(samples=2, **options), 1),
            "derivatives": Case(lambda: model.sensitivity(outputs, **asked), 1),
        },
        rounds=7,
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


def _errors() -> Any:
    for path in sorted(SHIPPED.glob("*.toml")):
        if path.stem in OMITTED:
            continue
        try:
            row = _error(path.stem)
        except (CapabilityError, ModelError) as error:
            print(f"{path.stem}: {str(error).splitlines()[0]}", file=sys.stderr)
            continue
        if row is not None:
            yield row


def _error(name: str) -> dict[str, Any] | None:
    """Return the row of a shipped linkage; None where there is nothing to differentiate by."""
    model = symgen.build(name)
    if not isinstance(model, symgen.RodModel):
        return None  # tests/loop and tests/elastic compare loops and elastic links
    data = dict(read_scene(SHIPPED / f"{name}.toml").data)
    positions = [f"{p}.position" for p in model.description.free]
    scene = symgen.Scene(**{**data, "analysis": {**data["analysis"], "outputs": positions}})
    model, exact = symgen.build(scene), symgen.build(scene, precision="float128")
    start = model.initial_state()
    coordinates, columns = _independent(model, start)
    points, axes = model.description.free, model.description.axes
    outputs = [f"{p}.position.{axis}" for p in points for axis in axes]
    parameters = {k: v for k, v in model.parameters.items() if k not in CONTRADICTING.get(name, ())}
    names = [*parameters, *coordinates, *(f"{c}'" for c in coordinates)]
    if not names:
        return None
    names = names[:: math.ceil(len(names) / DIRECTIONS)]
    end = PART * model.description.t_end
    options = {"coordinates": coordinates, "t_end": end, "rtol": 3e-14, "atol": 1e-16}
    found = model.sensitivity(outputs, names, **options).derivatives[0]
    z = np.concatenate([start.q[columns], start.u[columns]])
    drawn = np.array([*start.positions.values()])
    distances = np.linalg.norm(drawn[:, None] - drawn, axis=2)
    length = float(np.median(np.min(np.where(distances > 0, distances, np.inf), axis=1)))
    size = np.repeat([length, max(np.max(np.abs(start.u)), length)], len(columns))

    def places(values: dict[str, float], target: Array) -> Array:
        varied = exact.with_parameters(**values)
        begin = _start(varied, start, columns, target)
        result = varied.simulate(end, rtol=1e-18, atol=1e-21, samples=2, state=begin)
        return np.concatenate([result[f"{p}.position"].values[-1] for p in points])

    expected = []
    for parameter, value in parameters.items():
        if parameter not in names:
            continue
        h = abs(value) or 1.0
        expected.append(_slope(lambda x, of=parameter: places({of: x}, z), value, h))
    initial = names[len(expected) :]
    for i in range(len(z)):
        if [*coordinates, *(f"{c}'" for c in coordinates)][i] not in initial:
            continue
        unit = np.eye(len(z))[i]
        expected.append(_slope(lambda x, unit=unit, i=i: places({}, z + (x - z[i]) * unit), z[i], size[i]))
    reference = np.array(expected).T
    difference = np.max(np.abs(found - reference), axis=0)
    error = difference / np.maximum(np.max(np.abs(reference), axis=0), 1e-300)
    used = np.max(np.abs(reference), axis=0) > 1e-9
    return {"linkage": name, "directions": found.shape[1], "error": float(np.max(error[used])), "runs": None}


def _slope(of: Callable[[float], Array], at: float, size: float) -> Array:
    """Return the derivative of a function by central differences, extrapolated to the sixth order."""
    rows = []
    for h in STEPS * size:
        high, low = at + h, at - h
        rows.append((of(high) - of(low)) / (high - low))
    second = [(4 * rows[i + 1] - rows[i]) / 3 for i in (0, 1)]
    return (16 * second[1] - second[0]) / 15


def _independent(model: symgen.Model, start: symgen.State) -> tuple[list[str], list[int]]:
    """Return components of positions that determine the pose, and their places in ``State.q``."""
    names = [f"{p}.position.{axis}" for p in model.description.free for axis in model.description.axes]
    jacobian = model.jacobian(start)
    _, values, right = np.linalg.svd(jacobian) if len(jacobian) else (0, np.zeros(0), np.eye(len(names)))
    free = right[int(np.sum(values > 1e-9 * np.max(values, initial=0.0))) :].T
    columns: list[int] = []
    left = free.copy()
    for _ in range(free.shape[1]):
        column = int(np.argmax(np.linalg.norm(left, axis=1)))
        columns.append(column)
        direction = left[column] / np.linalg.norm(left[column])
        left = left - np.outer(left @ direction, direction)
    return [names[i] for i in columns], columns


def _start(model: symgen.Model, near: symgen.State, columns: list[int], target: Array) -> symgen.State:
    """Return the state on the constraints with these coordinates and rates, by Newton's method."""
    n, y = len(near.q), np.concatenate([near.q, near.u])
    points, axes = model.description.free, model.description.axes

    def state(y: Array) -> symgen.State:
        parts = (y[:n].reshape(-1, len(axes)), y[n:].reshape(-1, len(axes)))
        return model.state(*(dict(zip(points, part, strict=True)) for part in parts), near.t)

    for _ in range(8):
        y = np.asarray(model.rhs.project(near.t, y))
        jacobian = model.jacobian(state(y))
        _, values, right = np.linalg.svd(jacobian) if len(jacobian) else (0, np.zeros(0), np.eye(n))
        free = right[int(np.sum(values > 1e-9 * np.max(values, initial=0.0))) :].T
        unit = free @ np.linalg.inv(free[columns])
        k = len(columns)
        y[:n] += unit @ (target[:k] - y[:n][columns])
        y[n:] += unit @ (target[k:] - y[n:][columns])
    return state(np.asarray(model.rhs.project(near.t, y)))


if __name__ == "__main__":
    sys.exit(main())
