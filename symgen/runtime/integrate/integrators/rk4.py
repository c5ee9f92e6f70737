"""The classical method of order 4 with a fixed step (Kutta 1901); cubic interpolant."""

from __future__ import annotations

import numpy as np

from symgen.runtime.integrate.integrators.tableau import explicit_runge_kutta, hermite, lower_triangle

_B = np.array([1, 2, 2, 1]) / 6

METHOD = explicit_runge_kutta(
    name="rk4",
    about="classical Runge-Kutta of order 4, fixed step",
    order=4,
    error_order=0,
    a=lower_triangle([[], [0.5], [0, 0.5], [0, 0, 1], list(_B)]),
    b=_B,
    c=np.array([0, 0.5, 0.5, 1, 1]),
    error=np.zeros((0, 4)),
    dense=hermite(_B),
)
