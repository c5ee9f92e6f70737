"""The integrators, one file each; a new one is a file and a line in ``INTEGRATORS``."""

from __future__ import annotations

from symgen.errors import ModelError, nearest
from symgen.runtime.integrators import dop853, dopri5, rk4
from symgen.runtime.integrators.tableau import ExplicitRungeKutta

INTEGRATORS: dict[str, ExplicitRungeKutta] = {
    "dop853": dop853.METHOD,
    "dopri5": dopri5.METHOD,
    "rk4": rk4.METHOD,
}


def integrator(name: str) -> ExplicitRungeKutta:
    """Return the integrator called ``name``; raise ModelError with the nearest name otherwise."""
    if name not in INTEGRATORS:
        raise ModelError(f"there is no integrator {name!r}. {nearest(name, INTEGRATORS)}")
    return INTEGRATORS[name]
