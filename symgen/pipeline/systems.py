"""From a scene, a Python file or a building block to its derived System."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from symgen.calls import checked
from symgen.errors import DerivationError, ModelError, SceneError
from symgen.methods import method_of
from symgen.pipeline.user_system import equations_of, is_user_file
from symgen.scene.loading import SceneText, check_scene, text_of

if TYPE_CHECKING:
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage
    from symgen.scene.schema import Scene
    from symgen.symbolic.system import System


def system_of(resolved: Linkage | Loop) -> System:
    """Return the System of a resolved scene; raise SceneError for outputs that it does not have."""
    from symgen.scene.rods.letters import derived_in_letters

    try:
        system: System = derived_in_letters(resolved, method_of(resolved).load("system"))
    except SceneError as error:
        raise error.located(file=resolved.file) from None
    return system


def linkage_system_of(linkage: Linkage) -> System:
    """Return the System of a linkage: of its motion under forces, or of its kinematics alone."""
    if linkage.kinematic:
        from symgen.models.rods.driven import driven_system

        return driven_system(linkage)
    from symgen.models.rods.system import linkage_system

    return linkage_system(linkage)


def momentum_of(resolved: Linkage | Loop, cuts: Sequence[str] = (), *, joined: bool = False) -> System:
    """Return the momentum rows of a resolved scene with joints ``LINK.POINT`` cut.

    ``joined`` places the particles of cut links at their joints.
    """
    from symgen.scene.rods.letters import derived_in_letters

    method = method_of(resolved)
    if not method.momentum:
        raise DerivationError(f"{resolved.name} has no momentum rows: these are of points and links")
    if resolved.kinematic:
        raise DerivationError(
            f"{resolved.name} is a kinematic analysis, which has no momentum rows\n"
            "  Give --set analysis.kind=dynamics."
        )
    rows = method.load("momentum")
    system: System = derived_in_letters(resolved, lambda written: rows(written, cuts, joined=joined))
    return system


@checked
def derive(scene: Scene | SceneText | str | os.PathLike[str], *, cut: Sequence[str] = ()) -> System:
    """Return the derived equations of a scene, a building block, or a Python file that returns a System.

    ``symgen show`` without arguments lists the scenes and the building blocks.

    Parameters
    ----------
    scene
        A scene, or the name of a building block or of a Python file.
    cut
        Joints ``LINK.POINT`` of a linkage: its momentum rows are returned, with these joints cut.
    """
    from symgen.models import BLOCKS
    from symgen.scene.resolve import resolve

    if cut:
        if is_user_file(scene) or (isinstance(scene, str) and scene in BLOCKS):
            raise ModelError(f"{scene} is not a scene: it has no joints to cut, and no momentum rows")
        return momentum_of(resolve(check_scene(text_of(scene))), cut)
    if is_user_file(scene):
        return equations_of(Path(str(scene)))
    if isinstance(scene, str) and scene in BLOCKS:
        return BLOCKS[scene]()
    return system_of(resolve(check_scene(text_of(scene))))
