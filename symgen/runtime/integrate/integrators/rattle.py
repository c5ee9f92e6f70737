"""RATTLE and symmetric compositions of it: on the constraints, time reversible, without trend in energy.

H. C. Andersen, J. Comput. Phys. 52 (1983) 24. The parts of a step: order 4 M. Suzuki, Phys. Lett. A 146
(1990) 319; orders 6 and 8 W. Kahan, R.-C. Li, Math. Comput. 66 (1997) 1089, as in E. Hairer,
C. Lubich, G. Wanner, *Geometric Numerical Integration*, second edition, section V.3.2.
"""

from __future__ import annotations

from symgen.runtime.integrate.integrators.method import Method

_SUZUKI = 1 / (4 - 4 ** (1 / 3))


def _composed(order: int, dense_order: int, *side: float) -> Method:
    """Return the method whose parts are ``side``, the rest of the step, and ``side`` in reverse order."""
    parts = 2 * len(side) + 1
    composed = f"{parts} symmetric parts of it" if side else "time reversible"
    return Method(
        name=f"rattle{order if side else ''}",
        about=f"RATTLE of order {order}, {composed}, fixed step",
        kind="rattle",
        order=order,
        dense_order=dense_order,
        error_order=0,
        coefficients={"parts": parts, "side": side},
    )


RATTLE = _composed(2, 3)
RATTLE4 = _composed(4, 5, _SUZUKI, _SUZUKI)
RATTLE6 = _composed(
    6,
    5,
    0.39216144400731413928,
    0.33259913678935943860,
    -0.70624617255763935981,
    0.082213596293550800230,
)
RATTLE8 = _composed(
    8,
    5,
    0.13020248308889008088,
    0.56116298177510838456,
    -0.38947496264484728641,
    0.15884190655515560090,
    -0.39590389413323757734,
    0.18453964097831570709,
    0.25837438768632204729,
    0.29501172360931029887,
)
