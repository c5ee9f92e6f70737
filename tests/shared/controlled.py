"""Mechanisms with inputs, as control engineers write them, with their minimal coordinates."""

from __future__ import annotations

import numpy as np
from shared.linkages import GRAVITY, at, ground

import symgen

#: Masses of cart and pole [kg].
CART, POLE = 1.0, 0.2
CART_POLE = symgen.Scene(
    parameters={"c": {"value": "0.3 N*s/m", "tunable": True}},
    inputs={"F": {"value": "0 N", "about": "force on the cart"}, "T": "0 N*m"},
    points={"R0": ground(-1, 0), "R1": ground(1, 0), "C": at(0, 0), "P": at(0, 0.5)},
    links={"rail": {"points": ["R0", "R1"]}, "pole": {"points": ["C", "P"], "mass": f"{POLE} kg"}},
    masses=[{"point": "C", "mass": f"{CART} kg"}],
    guides=[{"points": ["C"], "along": "rail"}],
    gravity=GRAVITY,
    forces=[{"point": "C", "force": ["F - c*C.vx", "0 N"]}],
    torques=[{"link": "pole", "torque": "-T"}],
)


def cart_pole(model, x, theta, v, omega):
    """Return y of the cart's place and the pole's angle from the vertical, clockwise, and the way back.

    The way back takes accelerations of the points to those of place and angle.
    """
    across, up = 0.5 * np.sin(theta), 0.5 * np.cos(theta)
    state = model.state(
        {"C": [x, 0.0], "P": [x + across, up]}, {"C": [v, 0.0], "P": [v + up * omega, -across * omega]}
    )

    def back(a):
        relative = a[2:] - a[:2]
        return np.array([a[0], (relative[0] * up - relative[1] * across) / 0.25])

    return np.concatenate([state.q, state.u]), back
