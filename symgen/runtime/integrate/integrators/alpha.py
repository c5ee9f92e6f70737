"""The generalized-alpha method and Newmark's, of order 2, implicit: for stiff systems with fixed steps.

J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993) 371; M. Arnold, O. Bruls, Multibody Syst. Dyn. 18
(2007) 185.
"""

from __future__ import annotations

from symgen.runtime.integrate.integrators.method import Integrator


def _method(name: str, about: str, inertia: float, force: float) -> Integrator:
    """Return the method that weighs the old accelerations of its own and of the motion like this."""
    gamma, beta = 0.5 - inertia + force, (1 - inertia + force) ** 2 / 4
    return Integrator(
        name=name,
        about=f"{about}, implicit, for stiff systems, fixed step",
        kind="alpha",
        order=2,
        dense_order=3,
        error_order=0,
        coefficients={"alpha_m": inertia, "alpha_f": force, "beta": beta, "gamma": gamma},
        needs_tangent=True,
    )


#: Spectral radius of the generalized-alpha method at infinite frequency: as for elastic links.
_RADIUS = 0.9

GENERALIZED_ALPHA = _method(
    "generalized-alpha",
    f"generalized-alpha of order 2, spectral radius {_RADIUS} at infinity",
    (2 * _RADIUS - 1) / (_RADIUS + 1),
    _RADIUS / (_RADIUS + 1),
)
NEWMARK = _method("newmark", "Newmark's constant average acceleration, order 2", 0.0, 0.0)
