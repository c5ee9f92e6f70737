"""Small scenes for the tests of analyses."""

from __future__ import annotations

import numpy as np

import symgen

G = 9.81
GRAVITY = {"acceleration": ["0 m/s^2", f"{-G!r} m/s^2"]}


def metres(values):
    return [f"{float(x)!r} m" for x in values]


def ground(*place, **more):
    return {"at": metres(place), "ground": True, **more}


def at(*place):
    return {"at": metres(place)}


def rod(a, b, mass=1.0, **more):
    return {"points": [a, b], "mass": f"{mass!r} kg", **more}


def circles(a, b, first, second, side=1.0):
    """Return where a circle about ``a`` meets one about ``b``, to the left of the way from a to b."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    d = b - a
    distance = np.hypot(d[..., 0], d[..., 1])
    along = (first**2 - second**2 + distance**2) / (2 * distance)
    across = side * np.sqrt(first**2 - along**2)
    left = np.stack([-d[..., 1], d[..., 0]], axis=-1)
    return a + (d * along[..., None] + left * across[..., None]) / distance[..., None]


def four_bar(crank, coupler, rocker, base, angle, side=1.0):
    """A four-bar linkage with its crank driven at 1 rad/s from ``angle``, drawn where it closes."""
    a = np.array([crank * np.cos(angle), crank * np.sin(angle)])
    b = circles(a, [base, 0.0], coupler, rocker, side)
    return symgen.Scene(
        parameters={"w": "1 rad/s"},
        points={"O": ground(0, 0), "A": at(*a), "B": at(*b), "C": ground(base, 0)},
        links={
            "crank": rod("O", "A", length=f"{crank!r} m"),
            "coupler": rod("A", "B", length=f"{coupler!r} m"),
            "rocker": rod("C", "B", length=f"{rocker!r} m"),
        },
        drivers=[{"link": "crank", "angle": f"{angle!r} + w*t"}],
    )


def chain(places, masses=None, fixed=(0,), **more):
    """Rods from point to point, P0, P1, ..., the points of ``fixed`` on the ground."""
    points = {f"P{i}": (ground if i in fixed else at)(*place) for i, place in enumerate(places)}
    masses = [1.0] * (len(places) - 1) if masses is None else masses
    links = {f"L{i}": rod(f"P{i}", f"P{i + 1}", m) for i, m in enumerate(masses)}
    return symgen.Scene(points=points, links=links, **{"gravity": GRAVITY, **more})


def stephenson(**analysis):
    """A crank FE, and a triad: the ternary link ABP on three links."""
    return symgen.Scene(
        parameters={"w": "1 rad/s"},
        points={
            "O": ground(0, 0), "C": ground(0.4, 0), "F": ground(0.9, 0.3),
            "A": at(0.02, 0.35), "B": at(0.42, 0.4), "P": at(0.25, 0.65), "E": at(0.93, 0.33),
        },
        links={
            "FE": rod("F", "E", 0.4), "PE": rod("P", "E", 2.0), "OA": rod("O", "A"), "CB": rod("C", "B", 0.7),
            "ternary": {"points": ["A", "B", "P"], "mass": "1.5 kg", "inertia": "0.02 kg*m^2",
                        "centre": ["0.2 m", "0.45 m"]},
        },
        springs=[{"between": ["P", "C"], "stiffness": "300 N/m", "length": "0.2 m", "damping": "4 N*s/m"}],
        drivers=[{"link": "FE", "angle": "pi/4 + w*t"}],
        gravity=GRAVITY,
        analysis={"t_end": "6 s", **analysis},
    )  # fmt: skip
