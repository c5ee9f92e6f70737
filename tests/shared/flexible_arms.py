"""Flexible arms that a motor with a lag turns under a controller, in the plane and in space, and their references."""

from __future__ import annotations

import numpy as np
import sympy as sp
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


def one_element_matrices():
    """Return mass matrix and left side less inertia of (hub angle, x, y, tip angle) of the arm in one element.

    They are functions of these and their rates, from the energies in ``docs/method_elastic.md``.
    """
    q, v = sp.symbols("f x y g"), sp.symbols("f_t x_t y_t g_t")
    (f, x, y, g), rho = q, DENSITY * WIDTH * THICKNESS
    second = WIDTH * THICKNESS**3 / 12
    e, bend, stretch = sp.Symbol("e"), YOUNG * second, YOUNG * WIDTH * THICKNESS
    cubics = 3 * e**2 - 2 * e**3, LENGTH * (e - 2 * e**2 + e**3), LENGTH * (e**3 - e**2)
    curve = [
        cubics[0] * end + cubics[1] * first + cubics[2] * last
        for end, first, last in ((x, sp.cos(f), sp.cos(g)), (y, sp.sin(f), sp.sin(g)))
    ]
    moving = [sum(sp.diff(c, a) * b for a, b in zip(q, v, strict=True)) for c in curve]
    turning = (1 - e) * v[0] + e * v[3]
    line = rho / 2 * sum(c**2 for c in moving) + DENSITY * second / 2 * turning**2
    kinetic = sp.integrate(sp.expand(line), (e, 0, 1)) * LENGTH
    kinetic += HUB * v[0] ** 2 / 2 + TIP * (v[1] ** 2 + v[2] ** 2) / 2
    away = sp.atan2(y, x)
    one, two = f - away, g - away
    strain = sp.sqrt(x**2 + y**2) / LENGTH - 1 + (2 * one**2 - one * two + 2 * two**2) / 30
    potential = stretch * LENGTH / 2 * strain**2
    potential += bend / (2 * LENGTH) * ((two - one) ** 2 + 3 * (one + two) ** 2)
    mass = sp.hessian(kinetic, v)
    momentum = [sp.diff(kinetic, b) for b in v]
    left = [
        sum(sp.diff(p, a) * b for a, b in zip(q, v, strict=True)) - sp.diff(kinetic - potential, s)
        for p, s in zip(momentum, q, strict=True)
    ]
    return sp.lambdify((*q, *v), [mass, left], "numpy", cse=True)


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
