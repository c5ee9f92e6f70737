"""Driven linkages of the benchmarks: one revolution of the crank in a second."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import symgen

Array = NDArray[np.float64]

#: Lengths of Jansen's leg [m], by his letters.
JANSEN = {
    "a": 0.38, "b": 0.415, "c": 0.393, "d": 0.401, "e": 0.558, "f": 0.394, "g": 0.367, "h": 0.657, "i": 0.49,
    "j": 0.5, "k": 0.619, "l": 0.078, "m": 0.15,
}  # fmt: skip


def meeting(a: Array, b: Array, first: float, second: float, side: float = 1.0) -> Array:
    """Return where a circle about a meets one about b, left of the way from a to b (side -1: right)."""
    d = np.subtract(b, a)
    far = float(np.hypot(*d))
    along = (first**2 - second**2 + far**2) / (2 * far)
    across = side * np.sqrt(first**2 - along**2)
    place: Array = a + (d * along + np.array([-d[1], d[0]]) * across) / far
    return place


def linkage(
    free: dict[str, Any], ground: dict[str, Any], links: str, crank: str = "OA", turned: str = "w*t"
) -> symgen.Scene:
    """Return a kinematic scene of rods between points of one letter each, driven from where it is drawn."""
    start, end = ({**ground, **free}[name] for name in crank)
    angle = float(np.arctan2(end[1] - start[1], end[0] - start[0]))
    return symgen.Scene(
        parameters={"w": "1 rev/s"},
        points={
            **{name: {"at": _metres(place), "ground": True} for name, place in ground.items()},
            **{name: {"at": _metres(place)} for name, place in free.items()},
        },
        links={pair: {"points": list(pair)} for pair in links.split()},
        drivers=[{"link": crank, "angle": f"{angle!r} + {turned}"}],
        analysis={"kind": "kinematics", "t_end": "1 s"},
    )


def _metres(place: Any) -> list[str]:
    return [f"{float(x)!r} m" for x in place]


def jansen() -> symgen.Scene:
    """Return Jansen's leg: a crank and five dyads."""
    n = JANSEN
    o, p = np.zeros(2), np.array([-n["a"], -n["l"]])
    a = np.array([n["m"], 0.0])
    b, d = meeting(p, a, n["b"], n["j"]), meeting(p, a, n["c"], n["k"], -1.0)
    c = meeting(p, b, n["d"], n["e"])
    e = meeting(d, c, n["g"], n["f"])
    f = meeting(d, e, n["i"], n["h"])
    return linkage(
        {"A": a, "B": b, "C": c, "D": d, "E": e, "F": f}, {"O": o, "P": p},
        "OA AB PB BC PC AD PD CE DE EF DF",
    )  # fmt: skip


def peaucellier() -> symgen.Scene:
    """Return Peaucellier's inversor, its crank driven to and fro."""
    o, m = np.array([-0.2, 0.0]), np.zeros(2)
    a = np.array([0.2 * np.cos(0.3), 0.2 * np.sin(0.3)])
    b, c = meeting(o, a, 0.6, 0.25), meeting(o, a, 0.6, 0.25, -1.0)
    d = meeting(b, c, 0.25, 0.25, 1.0)
    return linkage({"A": a, "B": b, "C": c, "D": d}, {"O": o, "M": m}, "MA OB OC AB AC BD CD",
                   crank="MA", turned="0.4*sin(w*t)")  # fmt: skip


def watt() -> symgen.Scene:
    """Return a six-bar linkage of Watt: a four-bar linkage, and a dyad on its coupler and its rocker."""
    a = np.array([0.1, 0.0])
    b = meeting(a, np.array([0.4, 0.0]), 0.35, 0.3)
    p, r = meeting(a, b, 0.3, 0.25), meeting(np.array([0.4, 0.0]), b, 0.35, 0.2, -1.0)
    s = meeting(p, r, 0.4, 0.35)
    return linkage({"A": a, "B": b, "P": p, "R": r, "S": s}, {"O": (0, 0), "C": (0.4, 0)},
                   "OA AB CB AP BP CR BR PS RS")  # fmt: skip


def stephenson() -> symgen.Scene:
    """Return a six-bar linkage of Stephenson, driven where a triad is left: three links on a ternary one."""
    places = {"O": (0.0, 0.0), "C": (0.4, 0.0), "F": (0.9, 0.3)}
    a, b, p = np.array([0.02, 0.35]), np.array([0.42, 0.4]), np.array([0.25, 0.65])
    e = np.array([0.93, 0.33])
    return linkage({"A": a, "B": b, "P": p, "E": e}, places, "OA CB AB AP BP PE FE", crank="FE")


def spatial() -> symgen.Scene:
    """Return a crank-rocker in space with two ball joints (RSSR), the tip of its crank on a circle."""
    return symgen.Scene(
        parameters={"w": "1 rev/s", "r": "0.1 m"},
        points={
            "A": {"at": ["0.1 m", "0 m", "0 m"], "ground": True,
                  "motion": ["r*(cos(w*t) - 1)", "r*sin(w*t)", "0 m"]},
            "B": {"at": ["0.35 m", "0.05 m", "0.3 m"]},
            "C": {"at": ["0.4 m", "0.1 m", "0 m"], "ground": True},
            "D": {"at": ["0.45 m", "0.3 m", "0.05 m"], "ground": True},
        },
        links={pair: {"points": list(pair)} for pair in ("AB", "CB", "DB")},
        analysis={"kind": "kinematics", "t_end": "1 s"},
    )  # fmt: skip


LINKAGES = {
    "Peaucellier": peaucellier, "Jansen's leg": jansen, "Watt": watt, "Stephenson, a triad": stephenson,
    "RSSR in space": spatial,
}  # fmt: skip
