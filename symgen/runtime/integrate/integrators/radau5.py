"""Radau's method of order 5 with three implicit stages, adaptive: for stiff springs and dampers.

E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, second edition, section IV.8.
"""

from __future__ import annotations

from symgen.runtime.integrate.integrators.method import Integrator

# Bring the inverse of the method's matrix to block diagonal form, T^-1 A^-1 T; the first column is that of
# the real eigenvalue.
_T = (
    (0.09123239487089294279, -0.14125529502095420843, -0.03002919410514742449),
    (0.24171793270710701896, 0.20412935229379993199, 0.38294211275726193779),
    (0.96604818261509293619, 1.0, 0.0),
)
_T_INVERSE = (
    (4.3255798900631553510, 0.33919925181580986954, 0.54177053993587487119),
    (-4.1787185915519047273, -0.32768282076106238708, 0.47662355450055045196),
    (-0.50287263494578687595, 2.5719269498556054292, -0.59603920482822492497),
)

METHOD = Integrator(
    name="radau5",
    about="Radau IIA of order 5, implicit, for stiff systems, adaptive step",
    kind="radau",
    order=5,
    dense_order=4,
    error_order=3,
    coefficients={"t": _T, "t_inverse": _T_INVERSE},
    needs_tangent=True,
)
