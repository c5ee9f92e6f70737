"""A linkage restricted to the motion prescribed by its drives: constraints and positions, no dynamics."""

from __future__ import annotations

from symgen.mechanics.sources import linkage_sources
from symgen.models.limits import limits_of
from symgen.models.rods import outputs
from symgen.models.rods.linearised import driven_motion
from symgen.models.rods.linkage import REFERENCE, RodsModel
from symgen.models.rods.start import assembly_exports
from symgen.models.rods.system import (
    constraints,
    definitions,
    events_kernel,
    groups,
    kinematic_exports,
    places,
    run_end,
    run_end_kernel,
    switches_of,
    windings_of,
)
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.system import Export, System

LEFT_OUT = "masses, loads, energies and forces: only kinematics is requested"


def driven_system(linkage: Linkage) -> System:
    """Return the System of a linkage that is restricted to kinematics.

    Raises
    ------
    SceneError
        For an output that the linkage does not have, or that needs forces, and for too many points.
    """
    model = RodsModel(linkage)
    model.check_size()
    requested = outputs.requested_outputs(model)
    start, start_kernels = assembly_exports(model)
    moved, following = driven_motion(model)
    limits, kernel_of_limits = limits_of(linkage)
    derived, end = [*constraints(model), *places(model)], run_end(model)
    events = [*switches_of(model), *windings_of(model)]
    # A requested driven angle is that of its drive, which counts revolutions.
    names = {m.name for m in (*derived, *moved)}
    exports = [
        *kinematic_exports(model),
        Export("outputs", "outputs of the scene", tuple(m.name for m in requested)),
        *start_kernels,
        *following,
        *events_kernel(events),
        *run_end_kernel(end),
        *kernel_of_limits,
    ]
    return System(
        name=model.linkage.name,
        title=model.linkage.title,
        groups=groups(model),
        matrices=(
            *derived,
            *(m for m in requested if m.name not in names),
            *start,
            *moved,
            *events,
            *end,
            *limits,
        ),
        exports=tuple(exports),
        definitions=definitions(model),
        references=(REFERENCE,),
        sources=linkage_sources(model.sliding),
        left_out=(LEFT_OUT,),
    )
