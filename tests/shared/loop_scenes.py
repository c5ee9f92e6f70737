"""Loops for the tests as scenes in Python; each is built once per session."""

from __future__ import annotations

import math
import tomllib
from functools import lru_cache

import numpy as np

import symgen
from symgen.scene.loading import shipped_scene

RPM = {"rpm": "60 rpm"}


def scene(rows, *, gravity=None, outputs=None, parameters=None, units=None, **loop):
    """A scene of one loop; rows as (joint, link, entries)."""
    tables = [{"joint": joint, "link": link, **entries} for joint, link, entries in rows]
    made = {"units": units or {}, "parameters": parameters or {}, "loop": {"rows": tables, **loop}}
    if gravity is not None:
        made["gravity"] = {"acceleration": [f"{g} m/s^2" for g in gravity]}
    if outputs:
        made["analysis"] = {"outputs": outputs}
    return symgen.Scene(**made)


def driven(rows, start, low=0.0, high=360.0, **more):
    """The same with theta1 at constant rate; start in degrees and metres."""
    guess = {k: f"{v!r} m" if k[0] == "S" else f"{v!r} deg" for k, v in start.items()}
    return scene(
        rows,
        parameters=RPM,
        inputs={"theta1": "rpm*t"},
        range=[f"{low!r} deg", f"{high!r} deg"],
        start=guess,
        **more,
    )


def freed(name, at, rate, gravity=(0.0, 0.0, -9.81)):
    """A shipped driven loop with a free crank."""
    tables = tomllib.loads(shipped_scene(name))
    del tables["loop"]["inputs"]
    tables["loop"].pop("range", None)
    tables["parameters"].pop("speed", None)
    tables["loop"]["free"] = {"theta1": {"at": f"{at!r} rad", "rate": f"{rate!r} rad/s"}}
    tables["gravity"] = {"acceleration": [f"{float(g)!r} m/s^2" for g in gravity]}
    return tables | {"analysis": {"t_end": "1 s"}}


def m(x):
    return f"{float(x)!r} m"


def deg(x):
    return f"{float(x)!r} deg"


# --- crank-rocker: a1 crank, a2 coupler, a3 rocker, a4 ground ---------------------------------------------

PLANAR = (0.1, 0.4, 0.3, 0.35)


def planar_4r(lengths=PLANAR, **more):
    links = ("crank", "coupler", "rocker", "ground")
    rows = [
        ("R", link, {"theta": "theta1" if i == 0 else "?", "a": m(a)})
        for i, (link, a) in enumerate(zip(links, lengths, strict=True))
    ]
    # from the triangle of the start: crank along i, ground along -i
    a1, a2, a3, a4 = lengths
    base = a1 + a4
    apex = math.acos((base**2 + a2**2 - a3**2) / (2 * base * a2))
    b = (a1 + a2 * math.cos(math.pi - apex), a2 * math.sin(math.pi - apex))
    theta2 = math.pi - apex
    to_end = math.atan2(-b[1], -a4 - b[0])
    start = {
        "theta2": math.degrees(theta2),
        "theta3": math.degrees(to_end - theta2),
        "theta4": math.degrees(-to_end),
    }
    return driven(rows, start, **more)


BETA = 30.0


def cardan(**more):
    """Input shaft, cross, output shaft: a spherical 4R with three right angles; the shafts 30 deg apart."""
    links = ("input", "cross", "output", "ground")
    twists = (90.0, 90.0, 90.0, BETA)
    rows = [
        ("R", link, {"theta": "theta1" if i == 0 else "?", "alpha": deg(alpha)})
        for i, (link, alpha) in enumerate(zip(links, twists, strict=True))
    ]
    # theta1 = 90 deg, where tan theta1 tan theta4 = cos beta gives theta4 = 0 or 180 deg
    return driven(rows, CARDAN_START, 90.0, 450.0, **more)


#: Angles that close the cardan joint at theta1 = 90 deg.
CARDAN_START = {"theta2": 90.0 - BETA, "theta3": 90.0, "theta4": 0.0}

RSSR = {"a1": 1.0, "a2": 5.0, "a3": 3.0, "a4": 4.0, "S4": 1.5, "alpha4": 70.0}


def rssr(**more):
    rows = [
        ("R", "crank", {"theta": "theta1", "a": m(RSSR["a1"])}),
        ("S", "coupler", {"theta": "?", "eta": "?", "a": m(RSSR["a2"])}),
        ("S", "rocker", {"theta": "?", "eta": "?", "alpha": "?", "a": m(RSSR["a3"])}),
        ("R", "ground", {"theta": "?", "S": m(RSSR["S4"]), "alpha": deg(RSSR["alpha4"]), "a": m(RSSR["a4"])}),
    ]
    return driven(rows, rssr_start(), **more)


def rssr_rocker(theta1, sign=1):
    """Rocker angle theta4 by the ball's circle: exact for any crank angle [rad]."""
    frame, base = rssr_ground()
    gap = base - RSSR["a1"] * np.array([np.cos(theta1), np.sin(theta1), 0.0])
    x, y = frame[:, 0] @ gap, frame[:, 1] @ gap
    # |gap + frame (-a3 cos t, a3 sin t, 0)|^2 = a2^2
    lack = (RSSR["a2"] ** 2 - RSSR["a3"] ** 2 - gap @ gap) / (2 * RSSR["a3"])
    return np.arctan2(y, -x) + sign * np.arccos(lack / np.hypot(x, y))


def rssr_ground():
    """Axes of the rocker's joint in {1} as columns, at its angle zero, and its place."""
    alpha = math.radians(RSSR["alpha4"])
    c, s = math.cos(alpha), math.sin(alpha)
    frame = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    return frame, frame @ [0, 0, -RSSR["S4"]] - [RSSR["a4"], 0, 0]


def rssr_start():
    """All angles at theta1 = 0, from the balls and the rocker's frame."""
    theta4 = rssr_rocker(0.0)
    frame, base = rssr_ground()
    ball = base + frame @ (RSSR["a3"] * np.array([-np.cos(theta4), np.sin(theta4), 0]))
    u = (ball - [RSSR["a1"], 0, 0]) / RSSR["a2"]
    theta2, eta2 = np.arctan2(u[1], u[0]), -np.arcsin(u[2])
    c, s, ce, se = np.cos(theta2), np.sin(theta2), np.cos(eta2), np.sin(eta2)
    rod = np.array([[c * ce, -s, c * se], [s * ce, c, s * se], [-se, 0, ce]])
    c, s = np.cos(theta4), np.sin(theta4)
    r = rod.T @ frame @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    found = {
        "theta2": theta2,
        "eta2": eta2,
        "theta3": np.arctan2(r[1, 0], r[0, 0]),
        "eta3": -np.arcsin(r[2, 0]),
        "alpha3": np.arctan2(r[2, 1], r[2, 2]),
        "theta4": theta4,
    }
    return {k: float(np.degrees(v)) for k, v in found.items()}


RCCC = {"alpha": (30.0, 55.0, 45.0, 60.0), "a": (2.0, 4.0, 3.0, 5.0)}
RCCC_5 = {
    "theta2": 145.220527,
    "S2": -0.441324,
    "theta3": 45.784197,
    "S3": -2.680383,
    "theta4": 141.550748,
    "S4": -0.282099,
}


def rccc(pitch=None, **more):
    """The spatial four-bar; with a pitch its first joint is a screw (HCCC)."""
    first = {"theta": "theta1", "alpha": deg(RCCC["alpha"][0]), "a": m(RCCC["a"][0])}
    if pitch is not None:
        first["pitch"] = m(pitch)
    rows = [("R" if pitch is None else "H", "input", first)]
    for i, link in ((1, "coupler"), (2, "output"), (3, "ground")):
        entries = {"theta": "?", "S": "?", "alpha": deg(RCCC["alpha"][i]), "a": m(RCCC["a"][i])}
        rows.append(("C", link, entries))
    return driven(rows, RCCC_5, 5.0, 365.0, **more)


BENNETT = (40.0, 100.0)


def bennett(factor=1.0, **more):
    """Skew 4R with a/sin(alpha) the same all round; a factor on two lengths takes it off that condition."""
    alpha, beta = (math.radians(x) for x in BENNETT)
    lengths = (math.sin(alpha), factor * math.sin(beta)) * 2
    links = ("first", "second", "third", "ground")
    rows = [
        ("R", link, {"theta": "theta1" if i == 0 else "?", "alpha": deg(twist), "a": m(a)})
        for i, (link, twist, a) in enumerate(zip(links, BENNETT * 2, lengths, strict=True))
    ]
    theta2 = 2 * math.atan(bennett_ratio() / math.tan(math.radians(25)))
    start = {"theta2": math.degrees(theta2), "theta3": -50.0, "theta4": -math.degrees(theta2)}
    return driven(rows, start, 50.0, 410.0, **more)


def bennett_ratio():
    alpha, beta = (math.radians(x) for x in BENNETT)
    return math.sin((beta + alpha) / 2) / math.sin((beta - alpha) / 2)


def bricard(alpha, low, high, **more):
    """Threefold symmetric 6R; theta of joints 1, 3, 5 and phi of joints 2, 4, 6."""
    links = ("b1", "b2", "b3", "b4", "b5", "ground")
    rows = [
        ("R", link, {"theta": "theta1" if i == 0 else "?", "alpha": deg(alpha * (-1) ** i), "a": "1 m"})
        for i, link in enumerate(links)
    ]
    phi = math.degrees(bricard_phi(math.radians(alpha), math.radians(low)))
    start = {f"theta{i + 1}": low if i % 2 == 0 else phi for i in range(1, 6)}
    return driven(rows, start, low, high, **more)


def bricard_phi(alpha, theta):
    """The larger phi of cos^2 a + sin^2 a (cos t + cos p) + (1 + cos^2 a) cos t cos p - 2 cos a sin t sin p = 0."""
    c, s = math.cos(alpha), math.sin(alpha)
    x = s**2 + (1 + c**2) * math.cos(theta)
    y = -2 * c * math.sin(theta)
    return math.atan2(y, x) + math.acos(-(c**2 + s**2 * math.cos(theta)) / math.hypot(x, y))


@lru_cache
def turned(name, *arguments, samples=361):
    """The result of one of these scenes over its whole range, built once."""
    return symgen.build(globals()[name](*arguments)).inverse_dynamics(samples=samples)


# --- the slider-crank of crank_vectors, in inches and pounds ------------------------------------------------


def crank_scene(crank, *, S1="0 in", spin=None, guess=None, **loop):
    """Rows and links of a ``crank_vectors.Crank``; the rest of the loop table as given.

    With ``spin`` (a name) the rod's spin about its balls is a variable of that name, else it is idle.
    """
    mass = [f"{float(x)!r} lbf*s^2/in" for x in crank.masses]
    rods = {"theta": "?", "eta": "?", "a": inch(crank.a2)} | ({"alpha": spin} if spin else {})
    rows = [
        ("R" if S1.endswith(" in") else "C", "crank", {"theta": "theta1", "S": S1, "a": inch(crank.a1)}),
        ("S", "rod", rods),
        ("S", "slider", {"theta": "?", "eta": "?", "alpha": "?"}),
        ("P", "ground", {"S": "?", "alpha": f"{float(crank.alpha4)!r}", "a": inch(crank.a4)}),
    ]
    links = {
        "crank": {
            "mass": mass[0],
            "centre": [inch(-crank.a1 / 2), "0 in", "0 in"],
            "inertia": moments(crank.inertia_of_crank()),
        },
        "rod": {
            "mass": mass[1],
            "centre": [inch(x) for x in (crank.rod_centre or (-crank.a2 / 2, 0, 0))],
            "inertia": moments(crank.inertia_of_rod()),
        },
        "slider": {"mass": mass[2]},
    }
    options = {key: loop.pop(key) for key in ("gravity", "outputs", "parameters") if key in loop}
    units = {"length": "in", "force": "lbf", "angle": "rad"}
    return scene(rows, units=units, links=links, start=guess or {}, **loop, **options)


def inch(x):
    return f"{float(x)!r} in"


def moments(matrix):
    """The keys xx, yy, zz, xy, xz, yz of an inertia matrix."""
    i = np.asarray(matrix, dtype=float)
    six = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return [f"{x!r} lbf*s^2*in" for x in map(float, six)]


def guess_of(motion):
    """First guesses of the dependent variables, from a motion of ``crank_vectors`` at one angle."""
    made = {}
    for name, variable in motion.variables().items():
        if name not in ("theta1", "S1"):
            made[name] = inch(variable.value[0]) if name[0] == "S" else f"{float(variable.value[0])!r}"
    return made
