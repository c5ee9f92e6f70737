"""Contents of the page on a scene, collected from its derivation, its kernels and its runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from symgen.codegen.emit import equations_hash, unit_view
from symgen.codegen.target import Target
from symgen.codegen.views import UnitView
from symgen.inspection.film import moving_html
from symgen.inspection.measured import measure
from symgen.inspection.systems import BuildingBlockView
from symgen.inspection.view import View, view_of
from symgen.lowering.expressions import KINDS
from symgen.lowering.kernel import SETUP, Kernel, Program
from symgen.lowering.program import lower_system
from symgen.models.record import of_system
from symgen.pipeline.build import build, build_scene
from symgen.pipeline.subject import Subject
from symgen.pipeline.user_system import equations_of
from symgen.report.page.drawing import Drawing, drawing
from symgen.report.page.page import Fact, KernelRow, Measured, Page, StepView, example_in_c
from symgen.report.page.views import elimination, matrix_view, shared_terms, symbols
from symgen.scene.loading import SceneText, check_scene
from symgen.symbolic.system import Step, System

#: Most matrices of one step on a page.
_MATRICES = 16
#: Most shared terms on a page.
_TERMS = 60
_KINDS = {"add": "+ −", "mul": "×", "div": "÷", "neg": "sign", "call": "calls"}

#: Callback that receives the current activity as text.
Status = Callable[[str], None]


def scene_page(text: SceneText, *, speed: bool, progress: Status) -> Page:
    """Derive, build, run and measure a scene, and return the contents of its page.

    Parameters
    ----------
    text
        The scene.
    speed
        Whether to measure speed against error, which takes some seconds.
    progress
        Callback that receives the current activity.

    Raises
    ------
    SceneError, BuildError, CacheError
        As for building the scene.
    """
    checked = check_scene(text)
    progress("building")
    model = build_scene(text)
    progress("deriving")
    subject = Subject.of(text)
    resolved, system = subject.resolved, subject.system
    view = view_of(resolved)
    measured = measure(model, text if speed else None, progress=progress)
    progress("drawing")
    drawn = drawing(view.sketch(resolved, model, measured.result))
    shown = (checked.about.strip(), view.facts(resolved, model), measured, drawn)
    named = text.name if text.shipped else text.file or text.name
    code = _in_python(f'symgen.build("{named}")', view.example(model))
    return _page(view, code, system, subject.record, *shown)


def system_page(file: Path, *, progress: Status) -> Page:
    """Derive and build a user-defined system, and return the contents of its page.

    Raises
    ------
    DerivationError, BuildError, CacheError
        As for building the system.
    """
    progress("building")
    model = build(file)
    progress("deriving")
    system, view = equations_of(file), view_of(model)
    steps = (of_system(system),)
    code = _in_python(f'symgen.build("{file.name}")', view.example(model))
    measured, drawn = Measured(None), None
    if "simulate" in model.capabilities:
        measured = measure(model, None, progress=progress)
        drawn = (
            drawing(view.sketch(model, model, measured.result))
            if getattr(model.description, "points", ())
            else None
        )
    return _page(view, code, system, steps, "", view.facts(None, model), measured, drawn)


def block_page(name: str, *, progress: Status) -> Page:
    """Derive a building block, and return the contents of its page."""
    progress("deriving")
    subject = Subject(name, {})
    view, system = BuildingBlockView(), subject.system
    code = _in_python(f'symgen.derive("{name}")', [f'model["{system.matrices[0].name}"]'])
    return _page(view, code, system, subject.record, "", view.facts(None, system), Measured(None), None)


def _in_python(source: str, lines: Sequence[str]) -> str:
    return "\n".join(["import symgen", "", f"model = {source}", *lines])


def _page(
    view: View,
    in_python: str,
    system: System,
    derivation: Sequence[Step],
    about: str,
    facts: Sequence[Fact],
    measured: Measured,
    drawn: Drawing | None,
) -> Page:
    """Return the contents of a page."""
    systems = _distinct([system, *(step.system for step in derivation)])
    program = lower_system(system)
    equations = equations_hash(program, Target())
    unit = unit_view(program, Target(), equations)
    structure = elimination(system, system.saddle_point) if system.saddle_point else None
    shared, more = shared_terms(systems, _TERMS)
    return Page(
        name=system.name,
        title=system.title,
        kind=view.kind,
        about=about,
        facts=(*facts, Fact("operations", _operations(program)), *measured.headline),
        drawing=drawn,
        drawing_caption=_caption(view, drawn) if drawn else "",
        moving=moving_html(measured.result) if measured.result else "",
        steps=tuple(map(_step, derivation)),
        structure=structure[0] if structure else None,
        structure_caption=_of_structure(structure) if structure else "",
        symbols=symbols(systems),
        shared=shared,
        shared_more=more,
        kernels=tuple(_kernel(k, unit) for k in program.kernels),
        kinds=tuple(_KINDS[k] for k in KINDS),
        in_c=example_in_c(unit, _main(program.kernels)),
        in_python=in_python,
        measured=measured,
        left_out=system.left_out,
        references=(*system.references, *view.references),
        equations=equations,
    )


def _distinct(systems: Sequence[System]) -> tuple[System, ...]:
    """Return the systems without those that have the same symbols as an earlier one."""
    unique: list[System] = []
    for system in systems:
        if not any(s.groups == system.groups and s.definitions == system.definitions for s in unique):
            unique.append(system)
    return tuple(unique)


def _step(step: Step) -> StepView:
    matrices = step.matrices
    return StepView(
        step.title,
        step.about,
        step.source,
        tuple(matrix_view(m) for m in matrices[:_MATRICES]),
        max(0, len(matrices) - _MATRICES),
    )


def _main(kernels: tuple[Kernel, ...]) -> str:
    """Return the most frequently evaluated kernel: the accelerations, or the motion of a loop."""
    names = [k.name for k in kernels if k.name != SETUP]
    return next(name for name in ("accelerations", "motion", *names) if name in names)


def _operations(program: Program) -> str:
    main = _main(program.kernels)
    once = f", {program.setup.counts.flops} once per run" if program.setup else ""
    return f"{program.kernel(main).counts.flops} for the {main}{once}"


def _caption(view: View, drawn: Drawing) -> str:
    hidden = f" {drawn.unnamed} names are omitted for lack of room." if drawn.unnamed else ""
    return f"{view.caption(drawn)}.{hidden}"


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
