"""Flexible arms that a motor with a lag turns under a controller, in the plane and in space, and their references."""

from __future__ import annotations

import numpy as np
from shared.linkages import at, ground

import symgen

DENSITY, YOUNG, GOAL = 7850.0, 210e9, 1.0
THIN = 5e-4
LENGTH, WIDTH, THICKNESS, TIP, HUB = 0.6, 0.03, 0.002, 0.1, 0.02
KP, KI, KD, LAG = 8.0, 6.0, 1.2, 0.02
OUTPUTS = ["tip.position", "m", "m.rate", "z", "arm.stress"]


def arm(young=YOUNG, **more):
    """Return tables of an arm whose hub, of inertia ``HUB``, a lagging motor turns under a PID controller."""
    error = f"{GOAL} - arm.angle"
    tables = {
        "parameters": {
            "kp": f"{KP} N*m",
            "ki": f"{KI} N*m/s",
            "kd": f"{KD} N*m*s",
            "lag": {"value": f"{LAG} s", "tunable": True},
        },
        "points": {"O": ground(0, 0), "tip": at(LENGTH, 0)},
        "links": {
            "arm": {
                "points": ["O", "tip"],
                "density": f"{DENSITY} kg/m^3",
                "section": {"width": f"{WIDTH} m", "thickness": f"{THICKNESS} m"},
                "elastic": {"E": f"{young!r} Pa", "elements": 1},
            }
        },
        "masses": [{"point": "tip", "mass": f"{TIP} kg"}],
        "states": {
            "m": {"start": "0.5 N*m", "rate": f"(kp*({error}) + ki*z - kd*arm.rate - m)/lag"},
            "z": {"start": "0 s", "rate": error},
        },
        "crank": {
            "link": "arm",
            "mode": "motor",
            "speed": "0 rpm",
            "torque": "m",
            "flywheel": f"{HUB} kg*m^2",
        },
        "analysis": {"outputs": OUTPUTS},
    }
    return tables | more


def built(tables):
    return symgen.build(symgen.Scene(**tables))


THIN_LINK = {
    "points": ["O", "tip"],
    "density": f"{DENSITY} kg/m^3",
    "section": {"width": f"{WIDTH} m", "thickness": f"{THIN} m"},
    "elastic": {"E": f"{YOUNG!r} Pa", "elements": 1},
}


def sized(young, thickness):
    section = {"width": f"{WIDTH} m", "thickness": f"{thickness} m"}
    return THIN_LINK | {"section": section, "elastic": {"E": f"{young!r} Pa", "elements": 1}}


def rigid(tables, thickness):
    """Return the same scene with a rigid arm, in the plane or in space."""
    line, rotary = DENSITY * WIDTH * thickness, DENSITY * WIDTH * thickness**3 / 12 * LENGTH
    mass, own = line * LENGTH, line * LENGTH**3 / 12
    rest = {k: v for k, v in tables.items() if k not in ("crank", "welds", "links")}
    if "hub" in tables["links"]:
        about = [f"{HUB} kg*m^2"] * 2 + [f"{HUB + rotary!r} kg*m^2"]
        hub = tables["links"]["hub"] | {"points": ["K", "A", "top", "B"], "inertia": about}
        return rest | {"links": {"hub": hub, "arm": {"points": ["A", "B"], "mass": f"{mass!r} kg"}}}
    link = {"points": ["O", "tip"], "mass": f"{mass!r} kg", "inertia": f"{own + HUB + rotary!r} kg*m^2"}
    outputs = [name for name in OUTPUTS if name != "arm.stress"]
    return rest | {
        "links": {"arm": link},
        "torques": [{"link": "arm", "torque": "m"}],
        "analysis": {"outputs": outputs},
    }


def spatial(young=YOUNG, thickness=THIN, kp=0.8, kd=0.3, elements=8, shift="0 m", **more):
    """Return tables of a hub about the z axis whose arm is elastic; A moves as the angle of the hub."""
    radius = 0.1
    tables = {
        "parameters": {
            "kp": f"{kp} N*m",
            "kd": f"{kd} N*m*s",
            "radius": f"{radius} m",
            "lag": {"value": f"{LAG} s", "tunable": True},
            "shift": shift,
        },
        "points": {
            "K": ground(0, 0, 0),
            "top": ground(0, 0, 0.1),
            "A": at(radius, 0, 0),
            "B": at(radius + LENGTH, 0, 0),
        },
        "links": {
            "hub": {
                "points": ["K", "A", "top"],
                "mass": "1 kg",
                "centre": ["0 m", "0 m", "0 m"],
                "inertia": [f"{HUB} kg*m^2"] * 3,
            },
            "arm": {
                "points": ["A", "B"],
                "density": f"{DENSITY} kg/m^3",
                "section": {"width": f"{WIDTH} m", "thickness": f"{thickness} m", "width_along": [0, 0, 1]},
                "elastic": {"E": f"{young!r} Pa", "elements": elements, "shear": {"poisson": 0.3}},
            },
        },
        "masses": [{"point": "B", "mass": f"{TIP} kg"}],
        "welds": [{"point": "A", "links": ["hub", "arm"]}],
        "states": {
            "m": {"start": "0 N*m", "rate": "(kp*(shift - A.y)/radius - kd*A.vy/radius - m)/lag"},
            "f": {"start": 0.25, "rate": "-f/lag", "about": "a filter without input"},
        },
        "torques": [{"link": "hub", "torque": ["0 N*m", "0 N*m", "m"]}],
        "analysis": {"t_end": "0.1 s", "outputs": ["m", "f", "f.rate", "A.position", "B.position"]},
    }
    return tables | more


def characteristic(s, radius, inertia, stiffness, rate):
    """Return the determinant of a beam from ``radius`` on, with a mass at its tip, over the size of its terms.

    The torque on the hub is -(stiffness + rate s) angle/(1 + lag s).
    """
    bend, line = YOUNG * WIDTH * THIN**3 / 12, DENSITY * WIDTH * THIN
    k = (-line * s**2 / bend + 0j) ** 0.25
    u = k * LENGTH
    c, n, ch, sh = np.cos(u), np.sin(u), np.cosh(u), np.sinh(u)
    # w = a cos kx + b sin kx + c cosh kx + d sinh kx; unknowns: these and the angle of the hub.
    rows = np.array(
        [
            [1, 0, 1, 0, -radius],
            [0, k, 0, k, -1],
            bend * np.array([-(k**2) * c, -(k**2) * n, k**2 * ch, k**2 * sh, 0]),
            [
                *(bend * k**3 * np.array([n, -c, sh, ch]) - TIP * s**2 * np.array([c, n, ch, sh])),
                0,
            ],
            [
                -bend * k**2,
                -bend * radius * -(k**3),
                bend * k**2,
                -bend * radius * k**3,
                -inertia * s**2 - (stiffness + rate * s) / (1 + LAG * s),
            ],
        ]
    )
    return np.linalg.det(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def root_near(s, *of):
    """Return the root of the characteristic equation near s, by secants."""
    before, now = s * (1 + 1e-6), s
    f_before, f_now = (characteristic(x, *of) for x in (before, now))
    for _ in range(60):
        if now == before or f_now == f_before:
            break
        before, f_before, now = now, f_now, now - f_now * (now - before) / (f_now - f_before)
        f_now = characteristic(now, *of)
    return now
