"""Dormand and Prince's method of order 5 with an error estimate of order 4 and interpolant of order 4.

Coefficients: J. R. Dormand, P. J. Prince, *A family of embedded Runge-Kutta formulae*, J. Comput. Appl.
Math. 6 (1980); interpolant: L. F. Shampine, *Some practical Runge-Kutta formulas*, Math. Comput. 46 (1986).
"""

from __future__ import annotations

import numpy as np

from symgen.runtime.integrate.integrators.tableau import exact, explicit_runge_kutta, lower_triangle

_B = exact(["35/384", 0, "500/1113", "125/192", "-2187/6784", "11/84"])
_A = [
    exact([]),
    exact(["1/5"]),
    exact(["3/40", "9/40"]),
    exact(["44/45", "-56/15", "32/9"]),
    exact(["19372/6561", "-25360/2187", "64448/6561", "-212/729"]),
    exact(["9017/3168", "-355/33", "46732/5247", "49/176", "-5103/18656"]),
    _B,
]
_ERROR = exact(["-71/57600", 0, "71/16695", "-71/1920", "17253/339200", "-22/525", "1/40"])
_DENSE = [
    exact([1, "-8048581381/2820520608", "8663915743/2820520608", "-12715105075/11282082432"]),
    exact([0, 0, 0, 0]),
    exact([0, "131558114200/32700410799", "-68118460800/10900136933", "87487479700/32700410799"]),
    exact([0, "-1754552775/470086768", "14199869525/1410260304", "-10690763975/1880347072"]),
    exact([0, "127303824393/49829197408", "-318862633887/49829197408", "701980252875/199316789632"]),
    exact([0, "-282668133/205662961", "2019193451/616988883", "-1453857185/822651844"]),
    exact([0, "40617522/29380423", "-110615467/29380423", "69997945/29380423"]),
]

METHOD = explicit_runge_kutta(
    name="dopri5",
    about="Dormand-Prince of order 5(4), adaptive step",
    order=5,
    error_order=4,
    a=lower_triangle(_A),
    b=_B,
    c=exact([0, "1/5", "3/10", "4/5", "8/9", 1, 1]),
    error=np.array([_ERROR]),
    dense=np.array(_DENSE),
    edge=3.25,
)
