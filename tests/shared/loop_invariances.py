"""Results of loops and of the same loops written differently: how far apart they are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from shared.in_numpy import build
from shared.loop_written import REACH, Change, Loop

import symgen

Results = dict[str, np.ndarray]


def inverse(loop: Loop, sense: float = 1.0) -> Results:
    """Motion and forces in three poses, in one or the other sense of the motion."""
    times = np.array([0.0, 0.4, 0.8]) * REACH * loop.scales[2]
    model = build(symgen.Scene(**loop.tables()))
    pace = loop.parameters["pace"]
    model = model.with_parameters(**{pace: sense * model.parameters[pace]})
    result = model.inverse_dynamics(at=sense * times, over="time")
    return {name: result[name].values for name in result}


def forward(loop: Loop) -> Results:
    """A run from the pose in which it was drawn, without the errors of fourth order in its steps.

    They are not those of the loop written differently: steps end on the closure by corrections of least size in
    its frames.
    """
    t_end = 0.05 * loop.scales[2]
    model = build(symgen.Scene(**loop.tables()))
    runs = [model.simulate(t_end=t_end, step=t_end / n, samples=3) for n in (20, 40)]
    return {name: (16.0 * runs[1][name].values - runs[0][name].values) / 15.0 for name in runs[0]}


def assemblies(loop: Loop) -> Results:
    """All closures found, by rising distance from the first."""
    model = build(symgen.Scene(**loop.tables()))
    poses = model.assemblies(at=loop.pose[loop.lead] * (1.0 if loop.lead[1] != "S" else loop.scales[0]))
    return {name: np.array([pose[name] for pose in poses]) for name in loop.variables}


def many(loop: Loop) -> Results:
    """Inverse dynamics of three variants in lanes."""
    tables = loop.tables()
    model = symgen.build(symgen.Scene(**tables))
    pace = loop.parameters["pace"]
    values = model.parameters[pace] * np.array([0.8, 1.0, 1.2])
    times = np.array([0.0, 0.6]) * REACH * loop.scales[2]
    runs = model.inverse_dynamics_many(parameters={pace: values}, at=times, over="time")
    beside = ("error", "constraint_drift")  # messages, and round-off
    return {str(name): runs[name].values for name in runs.data_vars if name not in beside}


def differences(expected: Results, found: Results, by: Change) -> dict[str, float]:
    """Return the largest difference of each kind of output, over the largest value of that kind."""
    sizes: dict[str, float] = {}
    apart: dict[str, float] = {}
    for name, values, kind in _mapped(expected, by):
        error = values - found[name]
        if kind == "turn":
            error = np.angle(np.exp(1j * error))
        apart[kind] = max(apart.get(kind, 0.0), float(np.max(np.abs(error), initial=0.0)))
        sizes[kind] = max(sizes.get(kind, 0.0), float(np.max(np.abs(values), initial=0.0)))
    return {kind: x / max(sizes[kind], 1.0 if kind == "turn" else 1e-300) for kind, x in apart.items()}


def _mapped(expected: Results, by: Change) -> Iterator[tuple[str, np.ndarray, str]]:
    for name, values in expected.items():
        made = by.expected(name, values)
        if made is not None:
            yield made
