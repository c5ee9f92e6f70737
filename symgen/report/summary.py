"""A model in a few plain lines, without loading anything to print them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symgen.runtime.model import Model

#: A constraint row that the rows before it explain but for this share is redundant.
_REDUNDANT = 1e-9


def model_lines(model: Model) -> Iterator[str]:
    """Yield the kernels of a model with their cost, its parameters, and what was left out."""
    d = model.description
    yield f"{d.title}: {model.backend} backend, {d.coordinates} coordinates, {len(d.constraints)} constraints"
    width = max(len(name) for name in model.operations)
    for name, counts in model.operations.items():
        kinds = ", ".join(f"{n} {kind}" for kind, n in counts.items() if n and kind != "flops")
        yield f"  {name:{width}}  {counts['flops']:5} operations{f' ({kinds})' if kinds else ''}"
    for p in d.parameters:
        yield f"  tunable: {p.name} = {model.parameters[p.name]:g} {p.unit}, {p.about}"
    for what in d.left_out:
        yield f"  left out: {what}"


def freedom_lines(model: Model) -> Iterator[str]:
    """Yield the degrees of freedom at the start, and the constraints that others imply there."""
    d = model.description
    redundant: list[str] = []
    if d.constraints:
        state = model.initial_state()
        evaluate = model._evaluator
        rows = evaluate("constraint_jacobian", 0.0, state.q, state.u).reshape(len(d.constraints), -1)
        known: list[np.ndarray] = []
        for label, row in zip(d.labels, rows, strict=True):
            rest = row / np.linalg.norm(row)
            for unit in (*known, *known):  # twice: once leaves what rounding lost
                rest = rest - (rest @ unit) * unit
            size = float(np.linalg.norm(rest))
            if size > _REDUNDANT:
                known.append(rest / size)
            else:
                redundant.append(label)
    freedom = d.coordinates - len(d.constraints) + len(redundant)
    degrees = "1 degree" if freedom == 1 else f"{freedom} degrees"
    yield f"{d.coordinates} coordinates, {len(d.constraints)} constraints: {degrees} of freedom at the start"
    yield f"redundant at the start: {', '.join(redundant) or 'none'}"
