"""A model in a few plain lines, without loading anything to print them."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.runtime.model import Model


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
    d, redundant = model.description, model.redundant
    freedom = d.coordinates - len(d.constraints) + len(redundant)
    degrees = "1 degree" if freedom == 1 else f"{freedom} degrees"
    yield f"{d.coordinates} coordinates, {len(d.constraints)} constraints: {degrees} of freedom at the start"
    yield f"redundant: {', '.join(redundant) or 'none'}"
