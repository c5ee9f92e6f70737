"""A scene as WebAssembly: its export, and a table of frames for a page."""

from __future__ import annotations

from symgen.codegen.emit import SourceFile, environment
from symgen.errors import ModelError
from symgen.export import files_of
from symgen.export.view import ATOL, RTOL, Exported
from symgen.toolchain.wasm import compile_wasm

#: The most steps from one frame to the next.
_STEPS = 100_000
#: Parts of the way from the parameters of the scene to those of the sliders.
_PARTS = 32


def wasm_of(x: Exported, frames: int) -> bytes:
    """Return the WebAssembly module that computes the frames of an exported scene.

    Raises
    ------
    ModelError
        For elastic links without outputs, with the reason.
    BuildError
        As for :func:`symgen.toolchain.wasm.compile_wasm`.
    """
    return compile_wasm(sources_of(x, frames))


def sources_of(x: Exported, frames: int) -> list[SourceFile]:
    """Return the files that are compiled.

    Raises
    ------
    ModelError
        For elastic links without outputs, with the reason.
    """
    if not x.outputs:
        raise ModelError(
            f"{x.name} has no live page: {x.specific.get('refused', 'it has no outputs')}\n"
            "  'symgen animate' draws its motion; --vary KEY=LOW:HIGH chooses other sliders."
        )
    template = environment().get_template("export/live.c.j2")
    text = template.render(x=x, frames=frames, rtol=RTOL, atol=ATOL, steps=_STEPS, parts=_PARTS)
    # The example and the check have functions main() of their own.
    sources = (f for f in files_of(x) if f.name not in ("main.c", "check.c"))
    return [*sources, SourceFile("live.c", text)]
