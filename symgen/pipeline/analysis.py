"""Kernels of the analyses other than the motion in time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from symgen.scene.loading import SceneText
from symgen.toolchain.cache import key
from symgen.toolchain.kernels import BuildSettings

if TYPE_CHECKING:
    from symgen.lowering.kernel import Program
    from symgen.runtime.kernels.description import KernelInfo
    from symgen.runtime.kernels.library import Library
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage
    from symgen.symbolic.system import System


def kernels_of_analysis(
    text: SceneText,
    tools: BuildSettings,
    base: Any,
    kind: str,
    outputs: tuple[str, ...],
    resolved: Callable[[], Linkage | Loop],
    of: str = "",
    lanes: bool = False,
) -> tuple[Any, Library]:
    """Return the kernels of one kind of analysis, which are compiled on first use.

    ``outputs`` are those of the analysis. ``resolved`` returns the linkage or loop of the scene, or one
    derived from it, which ``of`` names. In ``lanes`` kernels take vectors.
    """
    target = tools.of_lanes if lanes else tools

    def system() -> System:
        from symgen.models.analyses import analysis_system

        return analysis_system(replace(resolved(), outputs=outputs), kind)

    def described(program: Program, equations: str) -> Any:
        kernels = kernel_infos(program.kernels)
        return replace(base, name=program.name, equations=equations, kernels=kernels)

    parts = of, kind, key(*outputs)[:12] if outputs else "", "lanes" if lanes else ""
    name = "-".join(part for part in parts if part)
    return target.cached(text, name, lambda folder: target.built(folder, system, described, lanes), base=base)


def kernel_infos(kernels: Iterable[Any]) -> tuple[KernelInfo, ...]:
    """Return name and sizes of each kernel of a program."""
    from symgen.runtime.kernels.description import BlockInfo, KernelInfo

    return tuple(
        KernelInfo(
            k.name,
            k.work_size,
            "u" in k.reads,
            k.out_size,
            {kind: getattr(k.counts, kind) for kind in ("add", "mul", "div", "neg", "call", "flops")},
            tuple(
                BlockInfo(b.name, b.offset, b.shape, b.unit, b.description, b.rows, b.columns)
                for b in k.blocks
            ),
        )
        for k in kernels
    )
