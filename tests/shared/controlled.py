"""Mechanisms with inputs, as control engineers write them, with their minimal coordinates."""

from __future__ import annotations

import numpy as np
from shared.linkages import GRAVITY, G, at, circles, ground

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
    """Return maps from points to the cart's place and the pole's clockwise angle from the vertical, and back.

    The second map converts accelerations of the points to those of place and angle.
    """
    across, up = 0.5 * np.sin(theta), 0.5 * np.cos(theta)
    state = model.state(
        {"C": [x, 0.0], "P": [x + across, up]}, {"C": [v, 0.0], "P": [v + up * omega, -across * omega]}
    )

    def back(a):
        relative = a[2:] - a[:2]
        return np.array([a[0], (relative[0] * up - relative[1] * across) / 0.25])

    return np.concatenate([state.q, state.u]), back


#: Lengths of crank, coupler, rocker and base of a four-bar linkage [m].
FOUR_BAR = (0.3, 0.8, 0.6, 0.9)
#: Mass per length of its links [kg/m].
LINE = 2.0


def four_bar_with_torque():
    """A four-bar linkage under gravity, drawn at a crank angle of 1 rad, with a torque on its crank."""
    crank, coupler, rocker, base = FOUR_BAR
    a = np.array([crank * np.cos(1.0), crank * np.sin(1.0)])
    b = circles(a, [base, 0.0], coupler, rocker)
    return symgen.Scene(
        inputs={"T": {"value": "0.7 N*m", "about": "torque of the motor"}},
        points={"O": ground(0, 0), "A": at(*a), "B": at(*b), "C": ground(base, 0)},
        links={
            name: {"points": ends, "mass": f"{LINE * length!r} kg", "length": f"{length!r} m"}
            for name, ends, length in (
                ("crank", ["O", "A"], crank),
                ("coupler", ["A", "B"], coupler),
                ("rocker", ["C", "B"], rocker),
            )
        },
        gravity=GRAVITY,
        torques=[{"link": "crank", "torque": "T"}],
    )


#: A rod of 0.7 m and 0.9 kg from a ball joint, with a force on its tip.
SPATIAL_PENDULUM = symgen.Scene(
    inputs={"F": "0 N", "H": "0.2 N"},
    points={
        "O": {"at": [0, 0, 0], "ground": True},
        "P": {"at": ["0.2 m", "0.3 m", "-0.6 m"]},
    },
    links={"OP": {"points": ["O", "P"], "mass": "0.9 kg"}},
    gravity={"acceleration": [0, 0, f"{-G!r} m/s^2"]},
    forces=[{"point": "P", "force": ["F", "H", "0 N"]}],
)

#: A mass of 2 kg on a rail under a force, with an event at 0.25 m, and one at 4.5 m that ends runs.
PUSHED_MASS = symgen.Scene(
    inputs={"F": "0 N"},
    points={"A": ground(0, 0), "B": ground(1, 0), "P": at(0, 0)},
    links={"rail": {"points": ["A", "B"]}},
    masses=[{"point": "P", "mass": "2 kg"}],
    guides=[{"points": ["P"], "along": "rail"}],
    forces=[{"point": "P", "force": ["F", "0 N"]}],
    events=[
        {"name": "first", "of": "P.x", "value": "0.25 m"},
        {"name": "last", "of": "P.x", "value": "4.5 m", "ends_run": True},
    ],
    analysis={"outputs": ["P.position"], "t_end": "9 s"},
)
