"""Contents of the page on a scene, collected from its derivation, its kernels and its runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from symgen.codegen.emit import UnitView, equations_hash, unit_view
from symgen.codegen.target import Target
from symgen.inspection.measured import measure
from symgen.inspection.picture import sketch
from symgen.joints import JOINTS
from symgen.lowering.kernel import SETUP, Kernel, Program
from symgen.lowering.nodes import KINDS
from symgen.lowering.program import lower_system
from symgen.models.record import Step, record
from symgen.pipeline.build import build_scene, system_of
from symgen.report.page.drawing import Drawing, drawing
from symgen.report.page.page import Fact, KernelRow, Page, StepView, example_in_c
from symgen.report.page.views import elimination, matrix_view, shared_terms, symbols
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.kernels.description import LoopDescription
from symgen.scene.loading import SceneText, check_scene
from symgen.scene.loop.loop import Loop
from symgen.scene.resolve import resolve
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.system import System

#: Maximum number of matrices of one step and of shared terms on a page.
_MATRICES, _TERMS = 12, 60
_KINDS = {"add": "+ −", "mul": "×", "div": "÷", "neg": "sign", "call": "calls"}

#: Callback that receives the current activity as text.
Told = Callable[[str], None]


def scene_page(text: SceneText, *, speed: bool, told: Told) -> Page:
    """Derive, build, run and measure a scene, and return the contents of its page.

    Parameters
    ----------
    text
        The scene.
    speed
        Whether to measure speed against error, which takes some seconds.
    told
        Callback that receives the current activity.

    Raises
    ------
    SceneError, BuildError, CacheError
        As for building the scene.
    """
    checked = check_scene(text)
    told("building")
    model = build_scene(text)
    told("deriving")
    resolved = resolve(checked)
    system = system_of(resolved)
    derivation = record(resolved, system)
    systems = _distinct([system, *(step.system for step in derivation)])
    program = lower_system(system)
    equations = equations_hash(program, Target())
    unit = unit_view(program, Target(), equations)
    found = measure(model, text, speed=speed, told=told)
    told("drawing")
    drawn = drawing(sketch(resolved, model, found.result))
    structure = elimination(system, system.saddle_point) if system.saddle_point else None
    shared, more = shared_terms(systems, _TERMS)
    return Page(
        name=system.name,
        title=system.title,
        kind="loop" if isinstance(resolved, Loop) else "rods",
        about=checked.about.strip(),
        facts=(
            *_facts(resolved, model),
            Fact("operations", _operations(program)),
            *found.headline,
        ),
        drawing=drawn,
        drawing_caption=_caption(resolved, drawn),
        steps=tuple(map(_step, derivation)),
        structure=structure[0] if structure else None,
        structure_caption=_of_structure(structure) if structure else "",
        symbols=symbols(systems),
        shared=shared,
        shared_more=more,
        kernels=tuple(_kernel(k, unit) for k in program.kernels),
        kinds=tuple(_KINDS[k] for k in KINDS),
        in_c=example_in_c(unit, _main(program.kernels)),
        in_python=_in_python(system.name, model),
        run=found.facts,
        run_figure=found.figure,
        notes=found.notes,
        final=found.final,
        speed=found.speed,
        speed_figure=found.speed_figure,
        speed_caption=found.speed_caption,
        left_out=system.left_out,
        references=_references(system, resolved),
        equations=equations,
    )


def _distinct(systems: Sequence[System]) -> tuple[System, ...]:
    """Return the systems without those that have the same symbols as an earlier one."""
    found: list[System] = []
    for system in systems:
        if not any(s.groups == system.groups and s.definitions == system.definitions for s in found):
            found.append(system)
    return tuple(found)


def _step(step: Step) -> StepView:
    matrices = step.matrices
    return StepView(
        step.title,
        step.about,
        step.source,
        tuple(matrix_view(m) for m in matrices[:_MATRICES]),
        max(0, len(matrices) - _MATRICES),
    )


def _facts(resolved: Linkage | Loop, model: Any) -> tuple[Fact, ...]:
    """Return the type of the mechanism and its mobility."""
    return _of_loop(model) if isinstance(resolved, Loop) else _of_linkage(resolved, model)


def _of_loop(model: Any) -> tuple[Fact, ...]:
    d = model.description
    free = len(d.having("input", "free"))
    return (
        Fact("loop", "–".join(d.joints)),
        Fact("joints", ", ".join(f"{JOINTS[j].name} {j}" for j in dict.fromkeys(d.joints))),
        Fact("variables", f"{d.coordinates}, of which {len(d.having('dependent'))} dependent"),
        Fact("degrees of freedom", str(free)),
        Fact("rank of the screws", f"{d.rank} of 6"),
    )


def _of_linkage(linkage: Linkage, model: Any) -> tuple[Fact, ...]:
    d = model.description
    redundant = len(model.redundant)
    facts = [
        Fact("linkage", _where(linkage)),
        Fact("points and links", f"{len(d.points)} and {len(linkage.links) + len(linkage.bodies)}"),
        Fact("coordinates", str(d.coordinates)),
        Fact("constraints", f"{len(d.constraints)}" + (f", {redundant} redundant" if redundant else "")),
        Fact("degrees of freedom", str(d.coordinates - len(d.constraints) + redundant)),
    ]
    if isinstance(model, ElasticModel):
        facts.append(Fact("elastic links", ", ".join(b.info.link for b in model.beams)))
        facts.append(Fact("elastic unknowns", str(model.unknowns)))
    return tuple(facts)


def _where(linkage: Linkage) -> str:
    """Return the plane or space in which the linkage moves."""
    if linkage.plane:
        return f"in space, stays in the plane {linkage.plane}"
    return "in the plane" if linkage.dimension == 2 else "in space"


def _main(kernels: tuple[Kernel, ...]) -> str:
    """Return the most frequently evaluated kernel: the accelerations, or the motion of a loop."""
    names = [k.name for k in kernels if k.name != SETUP]
    return next(name for name in ("accelerations", "motion", *names) if name in names)


def _operations(program: Program) -> str:
    main = _main(program.kernels)
    once = f", {program.setup.counts.flops} once per run" if program.setup else ""
    return f"{program.kernel(main).counts.flops} for the {main}{once}"


def _caption(resolved: Linkage | Loop, drawn: Drawing) -> str:
    if isinstance(resolved, Loop):
        words = (
            "The loop at the beginning of its range; dashed lines are joint axes and translations along them"
        )
    else:
        words = "The mechanism in its initial configuration"
        kinds = {s.kind for s in drawn.shapes}
        words += "; blue links bend" if "elastic" in kinds else ""
        words += "; thin lines are paths during the run" if "path" in kinds else ""
    hidden = f" {drawn.unnamed} names are omitted for lack of room." if drawn.unnamed else ""
    return f"{words}.{hidden}"


def _of_structure(structure: tuple[Any, int]) -> str:
    pattern, factor = structure
    size = pattern.rows
    return (
        f"[M Jᵀ; J 0], {size} × {size}, in elimination order: {len(pattern.cells)} "
        f"nonzero entries, and {len(pattern.fill)} entries of fill-in (orange). The "
        f"factor L has {factor} entries, a dense one {size * (size + 1) // 2}."
    )


def _kernel(kernel: Kernel, unit: UnitView) -> KernelRow:
    view = next(k for k in unit.kernels if k.name == kernel.name)
    results = tuple(
        f"out[{b.first}{f'..{b.last}' if b.last > b.first else ''}]: {b.name}, {b.rows} × {b.columns} "
        f"[{b.unit}], {b.description}"
        for b in view.blocks
    )
    return KernelRow(
        kernel.name,
        kernel.description,
        kernel.counts.flops,
        tuple(getattr(kernel.counts, kind) for kind in KINDS),
        kernel.work_size,
        kernel.out_size,
        results,
        f"{view.prototype};".replace("SYMGEN_RESTRICT ", "restrict "),
    )


def _in_python(name: str, model: Any) -> str:
    lines = ["import symgen", "", f'model = symgen.build("{name}")']
    d = model.description
    if isinstance(d, LoopDescription):
        if model.is_driven:
            value = 0.5 * (d.span[0] + d.span[1])
            lines += [
                f"turn = model.inverse_dynamics(at=[{value:.6g}])  # at a value of the input, in SI units",
                "turn.summary()",
            ]
        else:
            lines += [f"run = model.simulate({d.t_end:g})", "run.drift"]
    elif isinstance(model, ElasticModel):
        lines += ["turn = model.simulate()", "turn.peaks"]
    else:
        lines += [
            "found = model.accelerations()  # at the start; found.multipliers, found.reactions",
            f'found["{d.free[0]}"]',
            f"run = model.simulate({d.t_end:g})",
        ]
    return "\n".join(lines)


def _references(system: System, resolved: Linkage | Loop) -> tuple[str, ...]:
    from symgen.mechanics.elastic.hamilton import THESIS

    elastic = isinstance(resolved, Linkage) and resolved.elastic
    return (*system.references, *((f"The {THESIS}",) if elastic else ()))
