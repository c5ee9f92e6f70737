"""The committed kernels under ``generated/``: made, written and compared with what the derivation gives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from symgen.errors import GenerationError
from symgen.pipeline import derive

if TYPE_CHECKING:
    from symgen.codegen.emit import SourceFile


def shipped_sources() -> list[SourceFile]:
    """Generate everything that belongs under ``generated/``, in memory."""
    from symgen.codegen.emit import emit, equations_hash
    from symgen.codegen.loops import emit_loops, loops_hash
    from symgen.codegen.manifest import Shipped, manifest
    from symgen.codegen.target import Target
    from symgen.lowering.loop import lower_recursion
    from symgen.lowering.program import lower_system
    from symgen.models import BLOCKS, RECURSIONS, SHIPPED_SCENES

    systems = {name: make() for name, make in BLOCKS.items()}
    systems |= {name: derive(name) for name in SHIPPED_SCENES}
    models = {}
    for name, system in systems.items():
        program = lower_system(system)
        equations = equations_hash(program, Target())
        files = [f for language in ("c", "cython") for f in emit(program, Target(language), equations)]
        models[name] = Shipped(equations, files)
    for name, recursion in RECURSIONS.items():
        loops = lower_recursion(recursion())
        equations = loops_hash(loops)
        models[name] = Shipped(equations, emit_loops(loops, equations), optimisation=3)
    return [*(f for model in models.values() for f in model.files), manifest(models)]


def generated_folder() -> Path:
    """Return the folder of the committed kernels."""
    import symgen.generated

    return Path(str(symgen.generated.__file__)).resolve().parent


def generate() -> list[str]:
    """Write ``generated/`` anew in a checkout; return the names of the files that changed."""
    from symgen.atomic import write_text
    from symgen.codegen.manifest import write
    from symgen.scene.units import UNITS, answers

    folder = generated_folder()
    if not (folder.parent / "pyproject.toml").is_file():
        raise GenerationError(
            f"{folder} is not part of a checkout of symgen; only 'symgen generate --check' works"
        )
    touched = write(folder, shipped_sources())
    if UNITS.read_text(encoding="utf-8") != answers():
        write_text(UNITS, answers())
        touched.append(f"../symgen/scene/{UNITS.name}")
    return touched


def not_current() -> list[str]:
    """Return a difference for every generated file that is not what the derivation gives."""
    from symgen.codegen.manifest import differences
    from symgen.scene.units import UNITS, answers

    found = differences(generated_folder(), shipped_sources())
    if UNITS.read_text(encoding="utf-8") != answers():
        found.append(f"{UNITS} is not what Pint answers\n")
    return found
