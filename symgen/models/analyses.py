"""Systems of the analyses other than the motion in time, by kind."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from symgen.errors import ModelError, SceneError, nearest
from symgen.models.linearisation import (
    linearisation_system,
    sensitivity_system,
    variation_system,
    vibration_system,
)
from symgen.models.rods.linearised import kinematics_system, statics_system
from symgen.models.tangent import tangent_system

if TYPE_CHECKING:
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage
    from symgen.symbolic.system import System


def _elastic(name: str) -> Callable[[Linkage], System]:
    def system(linkage: Linkage) -> System:
        from symgen.models.elastic import links as elastic

        made: System = getattr(elastic, name)(linkage)
        return made

    return system


def _forces(linkage: Linkage) -> System:
    from symgen.models.elastic.rigid_forces import rigid_forces_system  # no run needs it

    return rigid_forces_system(linkage)


def _of_loop(loop: Loop) -> System:
    from symgen.models.loop.tangents import tangent_system as tangents  # no linkage needs it

    return tangents(loop)


#: The System of each kind of analysis besides the motion in time.
ANALYSES: dict[str, Callable[[Linkage], System]] = {
    "kinematics": kinematics_system,
    "statics": statics_system,
    "tangent": tangent_system,
    "linearisation": linearisation_system,
    "sensitivity": sensitivity_system,
    "variation": variation_system,
    "vibration": vibration_system,
    "forces": _forces,
    "elastic_motion": _elastic("motion_system"),
    "elastic_joints": _elastic("joints_system"),
}
#: The same of loops.
OF_LOOPS: dict[str, Callable[[Loop], System]] = {"loop_sensitivity": _of_loop}


def elastic_systems(linkage: Linkage) -> dict[str, System]:
    """Return the Systems of what elastic links need, by their kind; none where every link is rigid."""
    if not linkage.elastic:
        return {}
    return {kind: analysis_system(linkage, kind) for kind in ("elastic_motion", "elastic_joints")}


def analysis_system(mechanism: Any, kind: str) -> System:
    """Return the System of one kind of analysis of a linkage or loop; see ``ANALYSES`` and ``OF_LOOPS``.

    Raises
    ------
    ModelError
        When there is no analysis of this kind.
    SceneError
        As for the equations of motion of the same mechanism.
    """
    known: dict[str, Callable[[Any], System]] = {**ANALYSES, **OF_LOOPS}
    if kind not in known:
        raise ModelError(f"there is no analysis {kind!r}. {nearest(kind, known)}")
    try:
        return known[kind](mechanism)
    except SceneError as error:
        raise error.located(file=mechanism.file) from None
