"""Systems of the analyses other than the motion in time, by kind."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from symgen.errors import OptionsError, SceneError, check_known
from symgen.models.linearisation import (
    linearisation_system,
    sensitivity_system,
    tangent_system,
    variation_system,
    vibration_system,
)
from symgen.models.rods.linearised import kinematics_system, statics_system
from symgen.registry import load

if TYPE_CHECKING:
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage
    from symgen.symbolic.system import System


def _later(entry: str, **options: Any) -> Callable[[Any], System]:
    """Return a derivation that few need; it is imported when it is called."""

    def system(resolved: Any) -> System:
        return load(entry)(resolved, **options)

    return system


def _tangents(entry: str, *kernels: str) -> Callable[[Any], System]:
    """Return the derivation of the tangents of some kernels of a System, for derivatives by parameters."""

    def system(resolved: Any) -> System:
        from symgen.models.forward_mode import tangents_of

        return tangents_of(_later(entry)(resolved), kernels, ("q", "u", "p", "work"))

    return system


_ELASTIC_MOTION = "symgen.models.elastic.links:motion_system"
_ELASTIC_JOINTS = "symgen.models.elastic.joints:joints_system"
#: The System of each kind of analysis besides the motion in time.
ANALYSES: dict[str, Callable[[Linkage], System]] = {
    "kinematics": kinematics_system,
    "statics": statics_system,
    "tangent": tangent_system,
    "linearisation": linearisation_system,
    "sensitivity": sensitivity_system,
    "variation": variation_system,
    "vibration": vibration_system,
    "motion_tangents": _tangents(
        "symgen.models.rods.system:linkage_system", "points", "constraints", "velocity_constraints"
    ),
    "forces": _later("symgen.models.elastic.rigid_forces:rigid_forces_system"),
    "elastic_motion": _later(_ELASTIC_MOTION),
    "elastic_joints": _later(_ELASTIC_JOINTS),
    "shaking": _later("symgen.models.elastic.joints:shaking_system"),
    "elastic_motion_tangents": _tangents(_ELASTIC_MOTION, "constants", "links", "loads", "shaft"),
    "elastic_joints_tangents": _tangents(
        _ELASTIC_JOINTS, "joints", "constants", "energy", "driven", "drives"
    ),
}
#: The same of loops.
OF_LOOPS: dict[str, Callable[[Loop], System]] = {
    "loop_sensitivity": _later("symgen.models.loop.tangents:tangent_system"),
    "loop_linearisation": _later("symgen.models.loop.tangents:tangent_system", balanced=True),
    "loop_variation": _later("symgen.models.loop.tangents:variation_system"),
}


#: Analyses with slopes of loads that have none of couples by the forces in joints.
_BY_SLOPES = ("tangent", "variation", "vibration")


def elastic_systems(linkage: Linkage) -> dict[str, System]:
    """Return the Systems of what elastic links need, by their kind; none where every link is rigid."""
    if not linkage.elastic:
        return {}
    kinds = ("elastic_motion", "elastic_joints") if linkage.dimension == 2 else ("elastic_joints",)
    return {kind: analysis_system(linkage, kind) for kind in kinds}


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
    check_known(kind, known, "there is no analysis")
    if kind in _BY_SLOPES and any(load.of_joint for load in mechanism.loads):
        raise OptionsError(
            f"{mechanism.name}: friction of bearings follows from the forces in them, and implicit methods, "
            "derivatives along runs and those of frequencies do not have its slopes\n"
            "  Linear models and derivatives at a state do: give {at}."
        )
    try:
        return known[kind](mechanism)
    except SceneError as error:
        raise error.located(file=mechanism.file) from None
