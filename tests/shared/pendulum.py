"""A uniform rod of 1 m on a pin, released at rest, and its motion by Jacobi's functions."""

from __future__ import annotations

import mpmath
import numpy as np

import symgen

G = 9.81
#: Released from horizontal.
PENDULUM = symgen.Scene(
    points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
    links={"rod": {"points": ["O", "A"], "mass": "2 kg"}},
    gravity={"acceleration": ["0 m/s^2", f"-{G} m/s^2"]},
)


def exact(t, start=np.pi / 2):
    """Position and velocity of the tip at a time after the release at an angle from hanging down.

    sin(phi/2) = k cd(w t, k^2), with the angle phi and k = sin(phi_0/2).
    """
    with mpmath.workdps(30):
        k, w = mpmath.sin(mpmath.mpf(start) / 2), mpmath.sqrt(mpmath.mpf(G) * 3 / 2)
        cd, sn, dn = (mpmath.ellipfun(f, w * mpmath.mpf(t), m=k**2) for f in ("cd", "sn", "dn"))
        phi = 2 * mpmath.asin(k * cd)
        rate = -2 * k * w * (1 - k**2) * sn / dn**2 / mpmath.cos(phi / 2)
        s, c = mpmath.sin(phi), mpmath.cos(phi)
        return np.array([float(x) for x in (s, -c, rate * c, rate * s)])
