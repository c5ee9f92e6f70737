"""From a scene, a Python file or a building block to its derived System."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from symgen.calls import checked
from symgen.errors import SceneError
from symgen.methods import method_of
from symgen.pipeline.user_system import is_user_file, load
from symgen.scene.loading import SceneText, check_scene, text_of

if TYPE_CHECKING:
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage
    from symgen.scene.schema import Scene
    from symgen.symbolic.system import System


def system_of(resolved: Linkage | Loop) -> System:
    """Return the System of a resolved scene; raise SceneError for outputs that it does not have."""
    from symgen.scene.rods.letters import in_letters

    try:
        written, letters = in_letters(resolved)
        system: System = method_of(resolved).load("system")(written)
    except SceneError as error:
        raise error.located(file=resolved.file) from None
    return letters.kept(system)


def linkage_system_of(linkage: Linkage) -> System:
    """Return the System of a linkage: of its motion under forces, or of its kinematics alone."""
    if linkage.kinematic:
        from symgen.models.rods.driven import driven_system

        return driven_system(linkage)
    from symgen.models.rods.system import linkage_system

    return linkage_system(linkage)


@checked
def derive(scene: Scene | SceneText | str | os.PathLike[str]) -> System:
    """Return the derived equations of a scene, a building block, or a Python file that returns a System.

    ``symgen show`` without arguments lists the scenes and the building blocks.
    """
    from symgen.models import BLOCKS
    from symgen.scene.resolve import resolve

    if is_user_file(scene):
        return load(Path(str(scene))).system
    if isinstance(scene, str) and scene in BLOCKS:
        return BLOCKS[scene]()
    return system_of(resolve(check_scene(text_of(scene))))
