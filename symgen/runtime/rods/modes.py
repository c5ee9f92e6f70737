"""Small oscillations about an equilibrium: frequencies, damping ratios and mode shapes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.result.equilibrium import Equilibrium, Mode, Modes


def analyse(evaluator: Evaluator, equilibrium: Equilibrium) -> Modes:
    """Return the small oscillations about an equilibrium.

    Raises
    ------
    ModelError
        When nothing can move.
    """
    lin = equilibrium.linearised
    if lin.freedoms == 0:
        raise ModelError(
            f"{evaluator.description.name}: constraints and drives hold every freedom: nothing oscillates"
        )
    values, motions = lin.eigenvalues()
    free: NDArray[Any] = lin.basis @ motions
    if np.isrealobj(free):
        free = _separated(values, free)
    results = [
        Mode(_kind(complex(s)), complex(s), _shape(evaluator, equilibrium, free[:, i]))
        for i, s in enumerate(values)
    ]
    return Modes(equilibrium, tuple(results))


def _kind(s: complex) -> str:
    if s == 0:
        return "neutral"
    if s.real > 0:
        return "unstable"
    return "oscillation" if s.imag else "decay"


def _separated(values: NDArray[Any], shapes: Array) -> Array:
    """Fix the shapes within each set of equal frequencies, where round-off would rotate them arbitrarily.

    Coordinate directions are projected onto the common space one after the other; independent ones are kept.
    The rotation is orthogonal, so modal masses remain one.
    """
    result = shapes.copy()
    squares = np.where(values.real > 0.0, -1.0, 1.0) * np.abs(values) ** 2
    close = 1e-9 * float(np.max(np.abs(squares)))
    groups = np.split(np.arange(len(squares)), np.flatnonzero(np.abs(np.diff(squares)) > close) + 1)
    for group in groups:
        space = shapes[:, group]
        size = float(np.max(np.linalg.norm(space, axis=1)))
        chosen: list[Array] = []
        for least in (0.1, 1e-6):
            for row in space / size:
                new = row - sum((row @ c) * c for c in chosen)
                if len(chosen) < len(group) and np.linalg.norm(new) > least:
                    chosen.append(new / np.linalg.norm(new))
        if len(chosen) == len(group) > 1:
            result[:, group] = space @ np.array(chosen).T
    return result


def _shape(evaluator: Evaluator, equilibrium: Equilibrium, motion: NDArray[Any]) -> dict[str, Array]:
    """Return the displacement of every point or user's coordinate, its largest component positive."""
    state, d = equilibrium.state, evaluator.description
    # Elastic links have unknowns behind the coordinates of points.
    motion = motion[: len(state.q)]
    parts = [np.ascontiguousarray(part) for part in (np.real(motion), np.imag(motion))]
    moved = [x if d.rates else evaluator.blocks("points", state.t, state.q, x)["velocities"] for x in parts]
    shape = moved[0] + 1j * moved[1] if np.iscomplexobj(motion) else moved[0]
    flat = shape.ravel()
    largest = flat[int(np.argmax(np.abs(flat) > (1 - 1e-6) * np.max(np.abs(flat))))]
    shape = shape * (np.conj(largest) / abs(largest)) if largest else shape
    if np.iscomplexobj(shape) and np.max(np.abs(shape.imag)) <= 1e-9 * np.max(np.abs(shape)):
        shape = shape.real
    return dict(zip(d.free if d.rates else d.points, shape, strict=True))
