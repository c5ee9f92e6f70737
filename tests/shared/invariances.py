"""Results of a scene and of the same scene written differently: how far apart they are."""

from __future__ import annotations

import numpy as np
from shared.in_numpy import build
from shared.transformed import WORDS, Transformed, number_of

import symgen

#: Results of an analysis: output, with components last.
Results = dict[str, np.ndarray]


def differences(expected: Results, found: Results, by: Transformed) -> dict[str, float]:
    """Return the largest difference of each kind of output, over the largest value of that unit; of angles, in rad.

    Places and other lengths are apart, and so are plain numbers and strains.
    """
    sizes: dict[tuple[str, str], float] = {}
    apart: dict[str, float] = {}
    for name, values in expected.items():
        word = name.rpartition(".")[2]
        mapped, there = by.output(name, values), np.asarray(found[by.name(name)])
        error, is_angle = mapped - there, WORDS[word][1] == "direction"
        if is_angle:
            error = np.angle(np.exp(1j * error))
        apart[word] = max(apart.get(word, 0.0), float(np.max(np.abs(error), initial=0.0)))
        size = 1.0 if is_angle else float(np.max(np.abs(mapped), initial=0.0))
        sizes[_group(word)] = max(sizes.get(_group(word), 0.0), size)
    return {word: x / max(sizes[_group(word)], 1e-300) for word, x in apart.items()}


def _group(word: str) -> tuple[str, str]:
    unit, kind = WORDS[word]
    return unit, kind if kind in ("place", "number") else ""


def _of(result, names) -> Results:
    return {name: result[name].values for name in names}


def run(tables: dict, by: Transformed) -> Results:
    """A run by fixed steps, recorded at the end."""
    t_end = 0.05 * by.scales[2]
    result = build(symgen.Scene(**tables)).simulate(t_end, step=t_end / 20, samples=2)
    return _of(result, tables["analysis"]["outputs"])


def start(tables: dict, by: Transformed) -> Results:
    state = build(symgen.Scene(**tables)).initial_state()
    named = tables["points"]  # without hidden points of bodies in space
    places = {f"{p}.position": np.asarray(x) for p, x in state.positions.items() if p in named}
    return places | {f"{p}.velocity": np.asarray(x) for p, x in state.velocities.items() if p in named}


def equilibrium(tables: dict, by: Transformed) -> Results:
    """An equilibrium, its outputs and the frequencies of modes."""
    model = build(symgen.Scene(**tables))
    found = model.equilibrium()
    rates = sorted((abs(m.s) for m in model.modes(found)), key=float)
    return dict(found.outputs) | {"frequencies": np.array(rates)}


def driven(tables: dict, by: Transformed) -> Results:
    """Inverse dynamics, with reactions, over time."""
    stop = 0.3 * by.scales[2]
    model = build(symgen.Scene(**tables))
    moved = model.kinematics(0.0, stop, over="time", samples=5)
    forces = model.inverse_dynamics(0.0, stop, over="time", samples=5)
    results = {}
    for name in tables["analysis"]["outputs"]:
        for source in (moved, forces):
            if name in source:
                results[name] = source[name].values
    return results


def assemblies(tables: dict, by: Transformed) -> Results:
    """All assembly modes by rising distance from the first, which is that of the scene."""
    modes = build(symgen.Scene(**tables)).assemblies(at=0.0, over="time")
    names = [by.names.get(p, p) for p in by.order]
    poses = np.array([[m.positions[p] for p in names] for m in modes])
    apart = np.linalg.norm(poses - poses[0], axis=(1, 2))
    return {f"{p}.position": poses[np.argsort(apart), k] for k, p in enumerate(names)}


def sweep(tables: dict, by: Transformed) -> Results:
    """Many runs over one parameter, in lanes."""
    w = by.names.get("w", "w")
    value, _ = number_of(tables["parameters"][w])
    parameters = tables["parameters"] | {w: {"value": tables["parameters"][w], "tunable": True}}
    t_end = 0.1 * by.scales[2]
    model = symgen.build(symgen.Scene(**tables | {"parameters": parameters}))
    runs = model.simulate_many(
        parameters={w: value * np.array([0.8, 1.0, 1.3])}, t_end=t_end, step=t_end / 40, samples=2
    )
    return _of(runs, tables["analysis"]["outputs"])
