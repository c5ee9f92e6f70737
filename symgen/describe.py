"""What the runtime is told of a model: from resolved scene and kernels to a description with a start."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from symgen.errors import InitialStateError, ModelError, SceneError

if TYPE_CHECKING:
    from symgen.lowering.kernel import Program
    from symgen.runtime.description import Description, LoopDescription, ParameterInfo
    from symgen.runtime.elastic_description import ElasticInfo
    from symgen.runtime.library import Library
    from symgen.scene.linkage import Linkage, Parameter
    from symgen.scene.loop import Loop


def describe(resolved: Linkage | Loop, program: Program, equations: str) -> Description | LoopDescription:
    """Return the description of a model, still without its start."""
    from symgen.scene.loop import Loop

    if isinstance(resolved, Loop):
        return _of_loop(resolved, program, equations)
    return _of_linkage(resolved, program, equations)


def with_start(description: Description | LoopDescription, library: Library) -> Description | LoopDescription:
    """Find the start of the scene, which also tells whether there is one.

    Raises
    ------
    SceneError
        When the scene cannot be assembled, or is contradictory.
    """
    from symgen.runtime.description import LoopDescription

    try:
        if isinstance(description, LoopDescription):
            return _with_pose(description, library)
        return _with_state(description, library)
    except InitialStateError as error:
        problem, _, hint = str(error).partition("\n")
        raise SceneError(problem, where=error.where, file=description.file, hint=hint.strip()) from None


def _with_state(description: Description, library: Library) -> Description:
    import numpy as np

    from symgen.runtime.evaluate import Evaluator
    from symgen.runtime.initial import start

    evaluator = Evaluator(description, library, np.array([p.default for p in description.parameters]))
    if description.kinematic:
        from symgen.runtime.kinematic_model import posed

        found = posed(evaluator)
    else:
        found = start(evaluator)
    return replace(description, start=(*found.q.tolist(), *found.u.tolist()), redundant=found.redundant)


def _with_pose(description: LoopDescription, library: Library) -> LoopDescription:
    import numpy as np

    from symgen.runtime.loop_kernels import LoopKernels
    from symgen.runtime.loop_start import close_near

    kernels = LoopKernels(description, library, [p.default for p in description.parameters])
    try:
        t = kernels.time_of(description.span[0]) if description.span else 0.0
    except ModelError as error:
        raise InitialStateError(str(error), where="loop.inputs") from None
    found = close_near(kernels, t, np.array(description.start))
    return replace(description, start=tuple(found.q.tolist()), rank=found.rank)


def _parameters(parameters: tuple[Parameter, ...]) -> tuple[ParameterInfo, ...]:
    from symgen.runtime.description import ParameterInfo

    return tuple(
        ParameterInfo(p.quantity.name, p.quantity.unit, p.quantity.description, float(p.default))
        for p in parameters
    )


def _of_loop(loop: Loop, program: Program, equations: str) -> LoopDescription:
    from symgen.runtime.description import LoopDescription, VariableInfo, kernel_infos

    return LoopDescription(
        name=program.name,
        file=loop.file,
        title=program.title,
        equations=equations,
        parameters=_parameters(loop.parameters),
        kernels=kernel_infos(program.kernels),
        references=program.references,
        left_out=program.left_out,
        joints=tuple(row.joint for row in loop.rows),
        links=tuple(row.link for row in loop.rows),
        variables=tuple(
            VariableInfo(
                name=v.name,
                unit=v.quantity.unit,
                row=v.row,
                role=v.role,
                unknown=v.effort is None,
                start=loop.number(v.start),
                start_rate=loop.number(v.start_rate),
            )
            for v in loop.variables
        ),
        span=tuple(loop.number(x) for x in loop.span or ()),
        lead=loop.lead,
        t_end=loop.number(loop.t_end),
        size=loop.size,
        units={w: [getattr(loop, w).name, getattr(loop, w).size] for w in ("length", "force", "angle")},
        start=tuple(loop.number(v.start) for v in loop.variables),
        rank=0,
    )


def _of_linkage(linkage: Linkage, program: Program, equations: str) -> Description:
    from symgen.runtime.description import Description, EventInfo, PlaneInfo, kernel_infos

    kernels = {k.name: k for k in program.kernels}
    slots = {name: slots for name, _, slots in program.groups}
    multipliers = [s for s in slots["work"] if s.name.endswith("_lambda")]
    return Description(
        name=program.name,
        file=linkage.file,
        title=program.title,
        equations=equations,
        axes=linkage.axes,
        points=tuple(p.name for p in linkage.points),
        free=tuple(dict.fromkeys(s.name.rpartition("_")[0] for s in slots["q"])),
        ground=tuple(p.name for p in linkage.points if p.ground),
        links={k.name: [k.start, k.end, *(p.name for p in k.carried)] for k in linkage.links},
        constraints=tuple(s.name.removesuffix("_lambda") for s in multipliers),
        labels=tuple(s.description.removeprefix("multiplier of ") for s in multipliers),
        work_of_loads="energy" in kernels and any(b.name == "power" for b in kernels["energy"].blocks),
        parameters=_parameters(linkage.parameters),
        kernels=kernel_infos(program.kernels),
        first_pivot=program.pivots,
        start=(),
        redundant=(),
        t_end=float(linkage.t_end.xreplace(dict(linkage.defaults))),
        assembly_tolerance=float(linkage.assembly_tolerance.xreplace(dict(linkage.defaults))),
        rank_tolerance=float(program.rank_tolerance),
        references=program.references,
        left_out=program.left_out,
        plane=PlaneInfo(linkage.plane.across, float(linkage.plane.level)) if linkage.plane else None,
        kinematic=linkage.kinematic,
        elastic=_elastic(linkage) if linkage.elastic and not linkage.kinematic else None,
        events=tuple(
            EventInfo(e.name, e.unit, e.direction, e.ends_run, e.about)
            for e in linkage.events
            if not linkage.kinematic
        ),
    )


def _elastic(linkage: Linkage) -> ElasticInfo:
    from symgen.elements import ELEMENTS
    from symgen.models.elastic import loads_along, lumps
    from symgen.runtime.beam_data import BeamInfo
    from symgen.runtime.elastic_description import ElasticInfo

    crank = linkage.crank
    return ElasticInfo(
        beams=tuple(
            BeamInfo(
                link=b.link,
                start=linkage.link(b.link).start,
                end=linkage.link(b.link).end,
                element=b.element,
                node_dofs=ELEMENTS[b.element].node_dofs,
                inner_dofs=ELEMENTS[b.element].inner_dofs,
                elements=b.elements,
                axial=b.axial,
                geometric_stiffness=b.geometric_stiffness,
                reduction=b.reduction,
                modes=b.modes,
                clamped=crank is not None and crank.link == b.link,
            )
            for b in linkage.elastic
        ),
        crank=crank.link if crank else "",
        mode=crank.mode if crank else "",
        stations=tuple((s.name, s.link) for s in linkage.stations),
        lumps=tuple(link for link, _, _ in lumps(linkage)),
        loads=tuple(link for link, *_ in loads_along(linkage)),
    )
