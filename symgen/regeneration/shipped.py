"""Committed kernels under ``generated/``: sources and contents of each model in memory."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from symgen.codegen.manifest import Shipped, manifest
from symgen.codegen.source import SourceFile
from symgen.models import BLOCKS, RECURSIONS, SHIPPED_BLOCKS, SHIPPED_SCENES
from symgen.toolchain import dependencies as graph

if TYPE_CHECKING:
    from symgen.symbolic.record import Record
    from symgen.symbolic.system import System

#: The generated items that are not models, and their files: Pint's conversion factors for the units of most
#: scenes, the order of the numbers that elastic kernels write, and what models of the papers cite.
UNITS, COLUMNS, CITATIONS = "units", "columns", "citations"
_PACKAGE = Path(__file__).resolve().parent.parent
TABLES = {
    UNITS: _PACKAGE / "scene" / "units.json",
    COLUMNS: _PACKAGE / "runtime" / "core" / "elastic_columns.h",
    CITATIONS: _PACKAGE / "pipeline" / "citations.json",
}


@dataclass(frozen=True, slots=True)
class Derived:
    """One derived model with the dependencies of its files."""

    shipped: Shipped
    needs: graph.Needs


def names() -> tuple[str, ...]:
    """Return the names of all models with committed kernels, longest derivation first."""
    return (*SHIPPED_SCENES, *SHIPPED_BLOCKS, *RECURSIONS)


def record_name(model: str) -> str:
    """Return the name of the file with a model's recorded mathematics.

    Tangents have none: their equations are those of another model, differentiated.
    """
    return "" if model.endswith("_tangents") else f"{_folder(model)}/{model}_equations.json"


def _folder(model: str) -> str:
    return SHIPPED_BLOCKS.get(model) or ("chains" if model in RECURSIONS else "scenes")


def make(name: str) -> Derived:
    """Derive one model, evaluate the units with Pint, or list columns or citations, and write the files."""
    if name == UNITS:
        from symgen.scene.units import answers

        units = SourceFile(TABLES[UNITS].name, answers())
        depends = {**graph.needs(), **graph.of_package("version", "pint")}
        del depends["symgen.scene:units.json"]  # the output itself
        return Derived(Shipped("", (units,)), depends)
    if name == COLUMNS:
        from symgen.models.elastic.columns import header

        return Derived(Shipped("", (SourceFile(TABLES[COLUMNS].name, header()),)), graph.needs())
    if name == CITATIONS:
        from symgen.pipeline.citations import PAPERS
        from symgen.pipeline.subject import citations_of_papers

        shown = {model for models in PAPERS.values() for model, _ in models}
        depends = {}
        for model in sorted(shown - BLOCKS.keys()):
            depends.update(graph.of_package("symgen", f"scenes/{model}.toml"))
        file = SourceFile(TABLES[CITATIONS].name, citations_of_papers())
        return Derived(Shipped("", (file,)), graph.needs(depends))
    if name in RECURSIONS:
        return Derived(_of_recursion(name), graph.needs())
    scene = graph.of_package("symgen", f"scenes/{name}.toml") if name in SHIPPED_SCENES else {}
    return Derived(_of_system(name), graph.needs(scene))


def _of_system(name: str) -> Shipped:
    from symgen.codegen.emit import emit, equations_hash
    from symgen.codegen.target import Target
    from symgen.lowering.program import lower_system
    from symgen.symbolic.record import record

    system = BLOCKS[name]() if name in BLOCKS else _of_scene(name)
    program = lower_system(system)
    equations = equations_hash(program, Target())
    files = [f for language in ("c", "cython") for f in emit(program, Target(language), equations)]
    costs = {k.name: k.counts.flops for k in program.kernels}
    mathematics = record(name, system.title, {"": system}, costs) if record_name(name) else None
    return Shipped(equations, _placed(name, files, mathematics))


def _of_scene(name: str) -> System:
    from symgen.pipeline.systems import derive  # not needed for building blocks

    return derive(name)


def _of_recursion(name: str) -> Shipped:
    from symgen.codegen.chain_kernels import emit_loops, loops_hash
    from symgen.lowering.recursion import lower_recursion
    from symgen.symbolic.record import record

    recursion = RECURSIONS[name]()
    loops = lower_recursion(recursion)
    equations = loops_hash(loops)
    steps = {f"{step.name}.": step for step in recursion.steps}
    costs = {step.kernel.name: step.counts.flops for step in loops.steps}
    files = emit_loops(loops, equations)
    mathematics = record(name, recursion.title, steps, costs)
    return Shipped(equations, _placed(name, files, mathematics), optimisation=3)


def _placed(model: str, files: Iterable[SourceFile], mathematics: Record | None) -> tuple[SourceFile, ...]:
    """Return the files of a model in its folder, and its record if it has one."""
    placed = tuple(replace(f, name=f"{_folder(model)}/{f.name}") for f in files)
    return (*placed, SourceFile(record_name(model), mathematics.to_json())) if mathematics else placed


def sources(models: dict[str, Shipped]) -> list[SourceFile]:
    """Return the files of these models, and the manifest that lists them."""
    return [*(f for model in models.values() for f in model.files), manifest(models)]


def generated_folder() -> Path:
    """Return the folder of the committed kernels."""
    import symgen.generated

    return Path(str(symgen.generated.__file__)).resolve().parent
