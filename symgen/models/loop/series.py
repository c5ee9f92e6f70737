"""Power series of a free motion of a loop: the equations that determine them."""

from __future__ import annotations

import sympy as sp

from symgen.models.loop.derivation import SCREW, LoopDerivation, named
from symgen.symbolic.system import NamedMatrix


def series_of_motion(model: LoopDerivation) -> NamedMatrix:
    """Return what determines power series of a free motion: of one freedom by the motion of unit inertia."""
    if [v.role for v in model.variables if v.role != "dependent"] == ["free"]:
        return named(
            "free_motion",
            sp.Matrix(model.free_motion),
            "1, rad/s^2, m/s^2, N*m",
            "accelerations from rest along one freedom, of unit inertia: 1 less the inertia, and those of "
            "closure, negative, where both paths meet, vanish; then the power of loads on them",
            ("inertia", *SCREW, "power"),
        )
    return named(
        "motion_residual",
        sp.Matrix(model.residual),
        "N*m, N, rad/s^2, m/s^2",
        "vanishes in a free motion: known less needed efforts, prescribed less actual accelerations of "
        "inputs, and accelerations of closure in the frame where both paths meet, negative",
        (*(v.name for v in model.variables), *SCREW),
    )
