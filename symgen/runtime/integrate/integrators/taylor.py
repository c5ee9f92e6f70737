"""Power series in time: the order follows the tolerance and the number type.

Source: A. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99-117.
"""

from __future__ import annotations

from symgen.runtime.integrate.integrators import dop853
from symgen.runtime.integrate.integrators.method import Integrator


def of_order(order: int) -> Integrator:
    """Return power series of an order, of which rates have one less; 0: the order that a tolerance needs."""
    ends = order - 1 if order else 31
    return Integrator(
        name="taylor",
        about="power series of the order that the tolerance needs",
        kind="taylor",
        order=ends,
        dense_order=ends,
        error_order=ends - 1,
        coefficients={"order": order},
        near=dop853.METHOD,
    )


METHOD = of_order(0)
