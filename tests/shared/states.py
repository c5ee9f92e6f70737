"""States near the start of a scene, and the outputs there."""

from __future__ import annotations

import numpy as np


def values_of(model, system, rng):
    """Times are multiples of 1/1024, so that kernels have angles of cranks such as 60 rad/s*t without rounding."""
    state = model.initial_state()
    size = np.max(np.abs(state.q))
    return {
        "t": np.round(rng.uniform(0, 1, 1) * 1024) / 1024,
        "q": state.q + 0.05 * size * rng.standard_normal(state.q.size),
        "u": size * rng.standard_normal(state.u.size),
        "p": np.array(model.parameter_values),
        "work": rng.standard_normal(len(system.group("work").quantities)),
    }


def random_values(system, model, rng):
    """Arrays near the start of the scene, so that the constraint Jacobian keeps its rank."""
    state = model.initial_state()
    size = np.max(np.abs(state.q))
    return {
        "t": rng.uniform(0, 1, 1),
        "q": state.q + 0.05 * size * rng.standard_normal(state.q.size),
        "u": size * rng.standard_normal(state.u.size),
        "p": np.array(model.parameter_values) * rng.uniform(0.5, 2, len(model.parameter_values)),
        "work": rng.standard_normal(len(system.group("work").quantities)),
    }


def outputs_at_start(model):
    """Return every output of the scene at its start, by name."""
    return {v.name: v.values[0] for v in model.simulate(1e-3, samples=2).variables}
