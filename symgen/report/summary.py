"""Short text description of a model, printed without loading further modules."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from symgen.runtime.model.compiled import Compiled


def model_lines(model: Compiled) -> Iterator[str]:
    """Yield the kernels of a model with operation counts, its parameters, and omitted terms."""
    d = model.description
    yield f"{d.title}: {model.backend} backend, {d.extent}"
    width = max(len(name) for name in model.operations)
    for name, counts in model.operations.items():
        kinds = ", ".join(f"{n} {kind}" for kind, n in counts.items() if n and kind != "flops")
        yield f"  {name:{width}}  {counts['flops']:5} operations{f' ({kinds})' if kinds else ''}"
    for p in d.tunable:
        kind = "input" if p.name in getattr(d, "inputs", ()) else "tunable"
        yield f"  {kind}: {p.name} = {model.parameters[p.name]:g} {p.unit}, {p.about}"
    for omitted in d.left_out:
        yield f"  omitted: {omitted}"
