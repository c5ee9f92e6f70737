"""Description of a model for the runtime: from resolved scene and kernels, with a start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from symgen.errors import InitialStateError, ModelError, SceneError
from symgen.methods import method_of

if TYPE_CHECKING:
    from symgen.lowering.kernel import Program
    from symgen.models.general.equations import GeneralSystem
    from symgen.runtime.kernels.description import Description
    from symgen.runtime.kernels.elastic_description import ElasticInfo
    from symgen.runtime.kernels.library import Library
    from symgen.runtime.kernels.loop_description import LoopDescription
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage
    from symgen.symbolic.system import System


def describe(resolved: Linkage | Loop, program: Program, equations: str) -> Description | LoopDescription:
    """Return the description of a model, without its start."""
    return method_of(resolved).load("describe")(resolved, program, equations)


def with_start(
    system: System, description: Description | LoopDescription, library: Library
) -> Description | LoopDescription:
    """Compute the start of the scene; raise an error if there is none.

    ``system`` is the system from which the kernels in ``library`` were lowered; it checks the start.

    Raises
    ------
    SceneError
        When the scene cannot be assembled, or is contradictory.
    """
    described: Description | LoopDescription
    try:
        described = method_of(description).load("start")(system, description, library)
    except InitialStateError as error:
        problem, _, hint = str(error).partition("\n")
        raise SceneError(problem, where=error.where, file=description.file, hint=hint.strip()) from None
    return described


def with_state(system: System, description: Description, library: Library) -> Description:
    """Return the description of a linkage with its start; errors as of :func:`with_start`."""
    import numpy as np

    from symgen.runtime.kernels.evaluate import Evaluator
    from symgen.runtime.rods.assembly.stated import moved
    from symgen.runtime.rods.start import check_closed, start
    from symgen.symbolic.exact import Exact

    parameters = np.array([p.default for p in description.parameters])
    evaluator = Evaluator(description, library, parameters)
    if description.kinematic:
        from symgen.runtime.rods.model.kinematic import posed

        begun = posed(evaluator)
    else:
        begun = start(evaluator)
        # That constraints are redundant shows at the start only: then the factorisation must expect it.
        description = replace(description, rank_tolerance=begun.rank_tolerance)
    if evaluator.couples and begun.redundant and not evaluator.efforts:
        names = ", ".join(description.labels[i] for i in begun.redundant)
        raise SceneError(
            f"friction of bearings needs the forces in them, which redundant constraints leave open: {names}",
            where="bearings.0",
            hint="Leave out a constraint, or give couples by the state: [[torques]].",
        )
    if description.constraints:
        # Evaluated from the derived matrices, so that errors of the lowering show here.
        work = np.zeros(len(system.group("work").quantities))
        values = {"t": [0.0], "q": begun.q, "u": begun.u, "p": evaluator.parameter_values, "work": work}
        parts = Exact(system).matrices(("constraints", "constraint_scale"), values)
        check_closed(evaluator, begun.q, *(np.array([float(x) for x in part]) for part in parts))
    return replace(
        description,
        start=(*begun.q.tolist(), *begun.u.tolist()),
        redundant=begun.redundant,
        start_remarks=tuple(moved(evaluator, begun.q)),
    )


def with_pose(system: System, description: LoopDescription, library: Library) -> LoopDescription:
    """Return the description of a loop with its closed pose; errors as of :func:`with_start`."""
    import numpy as np

    from symgen.runtime.closure.first_closure_in_range import closed_later
    from symgen.runtime.closure.start import check_closed, close_near
    from symgen.runtime.loop.kernels import LoopKernels
    from symgen.symbolic.exact import Exact

    kernels = LoopKernels(description, library, [p.default for p in description.parameters])
    guess = np.array(description.start)
    try:
        t = kernels.time_of(description.span[0]) if description.span else 0.0
    except ModelError as error:
        raise InitialStateError(str(error), where="loop.inputs") from None
    by = [i for i in description.having("dependent") if description.variables[i].guessed]
    try:
        pose = close_near(kernels, t, guess, by)
    except InitialStateError as error:
        pose = closed_later(kernels, guess, by, error)
    still = {g.name: np.zeros(len(g.quantities)) for g in system.groups}
    values = still | {"t": [pose.t], "q": pose.q, "p": kernels.parameter_values}
    defect = Exact(system).matrix("closure_defect", values)  # as derived, without the lowering
    check_closed(kernels, pose, np.array([float(x) for x in defect]).reshape(3, 4))
    begin = kernels.lead_at(pose.t)[0] if description.span else 0.0
    return replace(description, start=tuple(pose.q.tolist()), rank=pose.rank, begin=begin)


def _common(resolved: Linkage | Loop, program: Program, equations: str) -> dict[str, Any]:
    """Return the fields common to the descriptions of all methods."""
    from symgen.pipeline.analysis import kernel_infos
    from symgen.runtime.kernels.description import ParameterInfo
    from symgen.scene.rods.linkage import number

    return {
        "name": program.name,
        "file": resolved.file,
        "title": program.title,
        "units": resolved.units,
        "equations": equations,
        "parameters": tuple(
            ParameterInfo(p.quantity.name, p.quantity.unit, p.quantity.description, number(p.default, {}))
            for p in resolved.parameters
        ),
        "kernels": kernel_infos(program.kernels),
        "series_rows": program.series[0].rows if program.series else 0,
        "series_watched": program.series[0].watched if program.series else 0,
        "references": program.references,
        "left_out": program.left_out,
    }


def of_loop(loop: Loop, program: Program, equations: str) -> LoopDescription:
    """Return the description of a loop, still without its start."""
    from symgen.runtime.kernels.loop_description import BallInfo, LoopDescription, VariableInfo

    return LoopDescription(
        **_common(loop, program, equations),
        joints=tuple(row.joint for row in loop.rows),
        links=tuple(row.link for row in loop.rows),
        variables=tuple(
            VariableInfo(
                name=f"{v.name}.integral" if v.is_state else v.name,
                unit=v.quantity.unit,
                row=v.row,
                role=v.role,
                unknown=v.effort is None,
                start=loop.number(v.start),
                start_rate=loop.number(v.start_rate),
                guessed=v.guessed,
            )
            for v in loop.variables
        ),
        span=tuple(loop.number(x) for x in loop.span or ()),
        lead=loop.lead,
        t_end=loop.number(loop.t_end),
        size=loop.size,
        assembly_tolerance=loop.number(loop.assembly_tolerance),
        start=tuple(loop.number(v.start) for v in loop.variables),
        rank=0,
        balls=tuple(BallInfo(b.row, b.angles) for b in loop.balls),
        switches=tuple(s.text for s in loop.switches),
        tables=sum(s.pieces for s in loop.switches),
        inputs=tuple(p.quantity.name for p in loop.parameters if p.input),
        states={v.name: v.rate.unit for v in loop.having("state")},
    )


def of_linkage(linkage: Linkage, program: Program, equations: str) -> Description:
    """Return the description of a linkage, still without its start."""
    from symgen.mechanics.rods.gear import turns
    from symgen.runtime.kernels.description import Description, EventInfo, PlaneInfo
    from symgen.scene.elastic.offsets import is_lug
    from symgen.scene.rods.events import revolves
    from symgen.scene.rods.windings import turning

    kernels = {k.name: k for k in program.kernels}
    lacking = program.series[0].lacking if program.series else ()
    slots = {name: slots for name, _, slots in program.groups}
    multipliers = [s for s in slots["work"] if s.name.endswith("_lambda")]
    integrals = {s.integral for s in linkage.states}
    return Description(
        **_common(linkage, program, equations),
        axes=linkage.axes,
        points=tuple(p.name for p in linkage.points),
        free=tuple(dict.fromkeys(s.name.rpartition("_")[0] for s in slots["q"] if s.name not in integrals)),
        ground=tuple(p.name for p in linkage.points if p.ground),
        links={k.name: [k.start, k.end, *(p.name for p in k.carried)] for k in linkage.links},
        constraints=tuple(s.name.removesuffix("_lambda") for s in multipliers),
        labels=tuple(s.description.removeprefix("multiplier of ") for s in multipliers),
        work_of_loads="energy" in kernels and any(b.name == "power" for b in kernels["energy"].blocks),
        inputs=tuple(p.quantity.name for p in linkage.parameters if p.input),
        first_pivot=program.pivots,
        start=(),
        redundant=(),
        t_end=linkage.number(linkage.t_end),
        assembly_tolerance=linkage.number(linkage.assembly_tolerance),
        rank_tolerance=float(program.rank_tolerance),
        plane=PlaneInfo(linkage.plane.across, linkage.number(linkage.plane.level)) if linkage.plane else None,
        kinematic=linkage.kinematic,
        selects=linkage.outputs is not None,
        remarks=linkage.remarks,
        elastic=elastic_info(linkage) if linkage.elastic and not linkage.kinematic else None,
        events=tuple(
            EventInfo(e.name, e.unit, e.direction, e.ends_run, e.about, revolves(e.gap), i in lacking)
            for i, e in enumerate(linkage.events)
            if not linkage.kinematic
        ),
        switches=tuple(s.text for s in linkage.switches),
        tables=sum(s.pieces for s in linkage.switches),
        pulses=tuple(k for k, s in enumerate(linkage.switches) if s.smooth),
        windings=len(linkage.windings),
        turns=turning(linkage),
        gears=tuple(turns(pair.links, pair.teeth, pair.carrier) for pair in linkage.gears),
        steady=_steady(linkage),
        prescribed=_prescribed(linkage, [s.name.removesuffix("_lambda") for s in multipliers]),
        lugs={
            k.name: k.start if linkage.point(k.start).hidden else ""
            for k in (linkage.links if linkage.elastic else ())
            if is_lug(k)
        },
        drawn=sum(not p.hidden for p in linkage.points),
        states={s.name: s.units[0] for s in linkage.states},
        scene_outputs=linkage.scene_outputs,
        at_equilibrium=linkage.start.equilibrium,
    )


def of_general(system: GeneralSystem, program: Program, equations: str) -> Description:
    """Return the description of a user-defined system that moves, still without its start."""
    d = of_linkage(system, program, equations)
    slots = {name: tuple(s.name for s in slots) for name, _, slots in program.groups}
    blocks = {b.name: b for k in program.kernels if k.name == "points" for b in k.blocks}
    stated = system.stated.values or {} if system.stated else {}
    given = tuple(name for name in slots["q"] if name in stated)
    points = blocks["positions"].rows
    return replace(d, free=slots["q"], rates=slots["u"], given=given, points=points, drawn=0, size=1.0)


def _steady(linkage: Linkage) -> tuple[str, ...]:
    """Return the ground points and the constraints of drives whose velocity does not depend on the time."""
    from symgen.scene.rods.linkage import TIME

    moved = {p.name: p.motion for p in linkage.points if p.ground}
    moved |= {d.row: (d.angle,) for d in linkage.drivers} | {m.name: (m.value,) for m in linkage.motions}
    return tuple(
        name
        for name, motion in moved.items()
        if not any(x.diff(TIME.symbol).has(TIME.symbol) for x in motion)
    )


def _prescribed(linkage: Linkage, rows: Sequence[str]) -> tuple[int, ...]:
    """Return the numbers of the constraints of drives, and of lengths that depend on the time."""
    from symgen.scene.rods.linkage import TIME

    names = {d.row for d in linkage.drivers} | {m.name for m in linkage.motions}
    names |= {k.name for k in linkage.links if TIME.symbol in k.length.free_symbols}
    return tuple(i for i, name in enumerate(rows) if name in names)


def _shaft_alone(linkage: Linkage) -> bool:
    """Return whether only the shaft of the crank and damping of links do work over a revolution."""
    terms = [term for load in linkage.loads for term in load.terms(linkage.dimension)]
    # The energy of an angle is known up to revolutions.
    worked = any(term.force or term.on.winds for term in terms)
    moved = any(p.ground and p.motion != p.at for p in linkage.points)
    return not (worked or moved or len(linkage.drivers) > 1)


def _work_on_links(linkage: Linkage) -> bool:
    """Return whether forces without potential act on elastic links and on an elastic or held crank alone."""
    from symgen.scene.elastic.joints import carries

    beams, crank = [linkage.link(b.link) for b in linkage.elastic], linkage.crank
    terms = (t for load in linkage.loads for t in load.terms(linkage.dimension) if t.force)
    elsewhere = any(not t.on.section and not any(carries(link, t) for link in beams) for t in terms)
    moved = any(p.ground and p.motion != p.at for p in linkage.points)
    motor = crank is not None and crank.mode == "motor" and all(b.name != crank.link for b in beams)
    return not (elsewhere or moved or motor or len(linkage.drivers) > 1)


def elastic_info(linkage: Linkage) -> ElasticInfo:
    """Return the elastic links of a linkage."""
    from symgen.elements import ELEMENTS
    from symgen.models.elastic.couples import couples, read_by, rotations, welded_to_bodies
    from symgen.models.elastic.links import loads_along, lumps
    from symgen.pipeline.user_model import definition_of
    from symgen.runtime.kernels.elastic_description import BeamInfo, ElasticInfo, JointInfo
    from symgen.scene.rods.linkage import CarriedPoint

    crank, along = linkage.crank, list(loads_along(linkage))
    states = tuple((s.units[1], s.about) for s in linkage.states)
    if linkage.dimension == 3:
        beams = tuple(
            BeamInfo(
                b.link,
                link.start,
                link.end,
                b.element,
                (),
                elements=b.elements,
                between=tuple((c.name, linkage.number(c.along)) for c in link.carried),
            )
            for b, link in ((b, linkage.link(b.link)) for b in linkage.elastic)
        )
        base = {x.name: x.base for x in linkage.links} | {x.name: x.base for x in linkage.bodies}
        base |= dict.fromkeys((b.link for b in linkage.elastic), ())
        joints = tuple(JointInfo(j.kind, j.point, j.links, base[j.links[-1]]) for j in linkage.joints)
        stations = tuple((s.name, s.link) for s in linkage.stations)
        return ElasticInfo(
            beams,
            "",
            "",
            stations,
            (),
            (),
            outputs=linkage.outputs,
            joints_in_space=joints,
            driven=tuple(d.link for d in linkage.drivers),
            states=states,
        )
    acting = list(couples(linkage))
    on_sections = [
        (name, point) for _, term, _ in acting for _, point in term.on.points for _, name in term.on.links
    ]
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
                definition=definition_of(b.element),
                welds=b.welds,
                couples=tuple(dict.fromkeys(point for name, point in on_sections if name == b.link)),
            )
            for b in linkage.elastic
        ),
        crank=crank.link if crank else "",
        mode=crank.mode if crank else "",
        stations=tuple((s.name, s.link) for s in linkage.stations),
        lumps=tuple(link for link, *_ in lumps(linkage)),
        loads=tuple(link for link, _ in along),
        joints=tuple(x.name if isinstance(x, CarriedPoint) else "" for _, x in along),
        outputs=linkage.outputs,
        shaft_alone=_shaft_alone(linkage),
        work_on_links=_work_on_links(linkage),
        states=states,
        prescribed=crank is not None and crank.prescribed,
        couples=tuple(names for *_, names in acting),
        reads=tuple(read_by(linkage, couple) for couple in acting),
        rotations=rotations(linkage),
        welds=tuple(weld.name for weld in linkage.welded_angles),
        body_welds=tuple(weld.name for weld in welded_to_bodies(linkage)),
        welded_bodies=tuple((weld.point, weld.other) for weld in welded_to_bodies(linkage)),
        damps_all=linkage.modal_damping is not None and linkage.modal_damping.all,
    )
