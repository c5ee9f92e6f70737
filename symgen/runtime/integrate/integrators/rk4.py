"""The classical method of order 4 with a fixed step (Kutta 1901); cubic interpolant."""

from __future__ import annotations

import numpy as np

from symgen.runtime.integrate.integrators.tableau import exact, explicit_runge_kutta, hermite, lower_triangle

_B = exact(["1/6", "1/3", "1/3", "1/6"])

METHOD = explicit_runge_kutta(
    name="rk4",
    about="classical Runge-Kutta of order 4, fixed step",
    order=4,
    error_order=0,
    a=lower_triangle([exact([]), exact(["1/2"]), exact([0, "1/2"]), exact([0, 0, 1]), _B]),
    b=_B,
    c=exact([0, "1/2", "1/2", 1, 1]),
    error=np.zeros((0, 4), dtype=object),
    dense=hermite(_B),
)
