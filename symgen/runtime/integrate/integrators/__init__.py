"""The integrators, one file each; a new one is a file and a line in ``INTEGRATORS``."""

from __future__ import annotations

from symgen.errors import check_known
from symgen.runtime.integrate.integrators import alpha, dop853, dopri5, radau5, rattle, rk4, taylor
from symgen.runtime.integrate.integrators.method import Integrator

INTEGRATORS: dict[str, Integrator] = {
    "dop853": dop853.METHOD,
    "taylor": taylor.METHOD,
    "dopri5": dopri5.METHOD,
    "rk4": rk4.METHOD,
    "rattle": rattle.RATTLE,
    "rattle4": rattle.RATTLE4,
    "rattle6": rattle.RATTLE6,
    "rattle8": rattle.RATTLE8,
    "radau5": radau5.METHOD,
    "generalized-alpha": alpha.GENERALIZED_ALPHA,
    "newmark": alpha.NEWMARK,
}


def integrator(name: str) -> Integrator:
    """Return the integrator called ``name``; raise ModelError with the nearest name otherwise."""
    check_known(name, INTEGRATORS, "there is no integrator")
    return INTEGRATORS[name]
