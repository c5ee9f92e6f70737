"""RATTLE and symmetric compositions of it: on the constraints, time reversible, without trend in energy.

H. C. Andersen, J. Comput. Phys. 52 (1983) 24. The parts of a step: order 4 M. Suzuki, Phys. Lett. A 146
(1990) 319; orders 6 and 8 W. Kahan, R.-C. Li, Math. Comput. 66 (1997) 1089, as in E. Hairer,
C. Lubich, G. Wanner, *Geometric Numerical Integration*, second edition, section V.3.2, corrected from 20 to
40 digits by the least change that satisfies the order conditions.
"""

from __future__ import annotations

from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.integrate.integrators.tableau import exact

#: 1 / (4 - 4^(1/3)).
_SUZUKI = "0.4144907717943757371423540628607614957118"


def _composed(order: int, dense_order: int, *side: str) -> Integrator:
    """Return the method whose parts are ``side``, the rest of the step, and ``side`` in reverse order."""
    parts = 2 * len(side) + 1
    composed = f"{parts} symmetric parts of it" if side else "time reversible"
    return Integrator(
        name=f"rattle{order if side else ''}",
        about=f"RATTLE of order {order}, {composed}, fixed step",
        kind="rattle",
        order=order,
        dense_order=dense_order,
        error_order=0,
        coefficients={"parts": parts, "side": exact(side)},
    )


RATTLE = _composed(2, 3)
RATTLE4 = _composed(4, 5, _SUZUKI, _SUZUKI)
RATTLE6 = _composed(
    6,
    5,
    "0.3921614440073141392792505551811823209708",
    "0.3325991367893594385997486403202742095993",
    "-0.7062461725576393598099648194747637217192",
    "0.08221359629355080023149044744882811354343",
)
RATTLE8 = _composed(
    8,
    5,
    "0.1302024830888900808788176322625490977883",
    "0.5611629817751083845619644077015862652440",
    "-0.3894749626448472864080785986459409475276",
    "0.1588419065551556008962107456303837671541",
    "-0.3959038941332375773362315390221907467942",
    "0.1845396409783157070918325413885665990888",
    "0.2583743876863220472939791098604313430313",
    "0.2950117236093102988709662404919739157966",
)
