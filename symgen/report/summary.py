"""Short text description of a model, printed without loading further modules."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from symgen.runtime.kernels.description import LoopDescription, SystemDescription
from symgen.runtime.model.system import SystemModel

if TYPE_CHECKING:
    from symgen.runtime.elastic.model import ElasticModel
    from symgen.runtime.loop.model import LoopModel
    from symgen.runtime.model.kinematic import KinematicModel
    from symgen.runtime.model.rods import RodModel


def model_lines(model: RodModel | KinematicModel | LoopModel | ElasticModel | SystemModel) -> Iterator[str]:
    """Yield the kernels of a model with operation counts, its parameters, and omitted terms."""
    d = model.description
    if isinstance(d, SystemDescription):
        what = ", ".join(f"{name}[{len(array.names)}]" for name, array in d.arrays.items())
    elif isinstance(d, LoopDescription):
        what = f"{d.coordinates} coordinates, {' '.join(d.joints)} loop"
    else:
        what = f"{d.coordinates} coordinates, {len(d.constraints)} constraints"
    yield f"{d.title}: {model.backend} backend, {what}"
    width = max(len(name) for name in model.operations)
    for name, counts in model.operations.items():
        kinds = ", ".join(f"{n} {kind}" for kind, n in counts.items() if n and kind != "flops")
        yield f"  {name:{width}}  {counts['flops']:5} operations{f' ({kinds})' if kinds else ''}"
    if not isinstance(model, SystemModel):
        for p in d.tunable:
            yield f"  tunable: {p.name} = {model.parameters[p.name]:g} {p.unit}, {p.about}"
    for what in d.left_out:
        yield f"  left out: {what}"


def freedom_lines(model: Any) -> Iterator[str]:
    """Yield the degrees of freedom at the start, and the redundant constraints."""
    d = model.description
    if isinstance(d, LoopDescription):
        yield from _of_loop(d)
        return
    from symgen.runtime.model.kinematic import KinematicModel

    if isinstance(model, KinematicModel):
        yield f"{d.coordinates} coordinates, {len(d.constraints)} constraints: drives prescribe the motion"
        return
    redundant = model.redundant
    freedom = d.coordinates - len(d.constraints) + len(redundant)
    count = f"{d.coordinates} coordinates, {len(d.constraints)} constraints"
    yield f"{count}: {_degrees(freedom)} of freedom at the start"
    yield f"redundant: {', '.join(redundant) or 'none'}"
    if d.elastic:
        from symgen.runtime.elastic.model import ElasticModel

        if isinstance(model, ElasticModel):
            yield from _of_elastic(model)


def _of_elastic(model: ElasticModel) -> Iterator[str]:
    for beam in model.beams:
        info = beam.info
        count = "1 element" if info.elements == 1 else f"{info.elements} elements"
        kept = f", {info.reduction}" if info.reduction else ""
        length = "" if info.axial else ", inextensible"
        size = len(beam.dofs) - len(beam.fixed)
        yield f"elastic: link {info.link}, {count} {info.element}{kept}{length}: {size} unknowns of its own"
    yield f"elastic motion about it: {model.unknowns} unknowns in all"


def _of_loop(d: LoopDescription) -> Iterator[str]:
    inputs, free, dependent = (len(d.having(role)) for role in ("input", "free", "dependent"))
    yield (
        f"{d.coordinates} variables: {inputs} prescribed, {free} free, {dependent} dependent, whose screws "
        f"have rank {d.rank}: {_degrees(inputs + free)} of freedom"
    )
    yield f"redundant: {6 - d.rank} of 6 closure equations" if d.rank < 6 else "redundant: none"


def _degrees(count: int) -> str:
    return "1 degree" if count == 1 else f"{count} degrees"
