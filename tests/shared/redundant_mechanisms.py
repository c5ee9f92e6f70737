"""Random mechanisms with more constraints than their freedoms need, in the plane and in space.

Each is a table of points by name (ground ones marked), a table of links, and the further tables of a scene.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Tables = dict[str, Any]


def rotation(rng: np.random.Generator) -> np.ndarray:
    """Return a random rotation in space."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, [1, 0, 2]]


def metres(place: Any) -> list[str]:
    return [f"{float(x):.15g} m" for x in place]


def point(place: Any, ground: bool = False) -> dict[str, Any]:
    return {"at": metres(place), "ground": True} if ground else {"at": metres(place)}


def body(rng: np.random.Generator, points: list[str], places: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return a body with its centre among its points, and random moments of inertia."""
    centre = np.mean([places[p] for p in points], axis=0)
    dimension = len(centre)
    mass = rng.uniform(0.5, 3)
    if dimension == 2:
        moments: Any = f"{rng.uniform(0.05, 0.2):.6g} kg*m^2"
    else:
        spread = rng.uniform(0.02, 0.1, 3) * mass
        moments = [f"{spread[(i + 1) % 3] + spread[(i + 2) % 3]:.12g} kg*m^2" for i in range(3)]
    return {"points": points, "mass": f"{mass:.6g} kg", "centre": metres(centre), "inertia": moments}


def rod(rng: np.random.Generator, start: str, end: str) -> dict[str, Any]:
    return {"points": [start, end], "mass": f"{rng.uniform(0.2, 2):.6g} kg"}


def _placed(places: dict[str, np.ndarray], ground: set[str], rng: np.random.Generator) -> Tables:
    """Rotate and scale places, and write them as points."""
    size = 10 ** rng.uniform(-1, 1)
    dimension = len(next(iter(places.values())))
    if dimension == 3:
        turn = rotation(rng)
    else:
        a = rng.uniform(0, 2 * np.pi)
        turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    places |= {name: size * (turn @ place) for name, place in places.items()}
    return {name: point(place, name in ground) for name, place in places.items()}


def table_on_legs(rng: np.random.Generator, dimension: int) -> Tables:
    """A body on three or four parallel rods in the plane; a drive, and a rod in the body, in some."""
    legs = int(rng.integers(3, 5))
    lift = rng.uniform(0.3, 1, 2)
    feet = rng.uniform(-1, 1, (legs, 2)) + np.arange(legs)[:, None] * np.eye(2)[0]
    places = {f"F{k}": feet[k] for k in range(legs)} | {f"T{k}": feet[k] + lift for k in range(legs)}
    points = _placed(places, {f"F{k}" for k in range(legs)}, rng)
    links = {f"leg{k}": rod(rng, f"F{k}", f"T{k}") for k in range(legs)}
    links["table"] = body(rng, [f"T{k}" for k in range(legs)], places)
    tables: Tables = {}
    choice = rng.integers(3)
    if choice == 0:
        size = np.linalg.norm(places["T0"] - places["F0"])
        places["Z"] = places["F0"] + 2 * size * np.array([0.6, 0.8])
        points["Z"] = point(places["Z"], True)
        links["cylinder"] = {"points": ["Z", "T0"], "mass": "0 kg", "length": "n0*(1 + 0.02*sin(t/s))"}
        length = np.linalg.norm(places["T0"] - places["Z"])
        tables["parameters"] = {"n0": f"{length:.17g} m", "s": "1 s"}
    elif choice == 1:
        d = places["T0"] - places["F0"]
        tables["drivers"] = [{"link": "leg0", "angle": f"{np.arctan2(d[1], d[0]):.17g} + 0.1*sin(t/s)"}]
        tables["parameters"] = {"s": "1 s"}
    if rng.random() < 0.5:
        links["brace"] = rod(rng, "T0", f"T{legs - 1}")
    return {"points": points, "links": links, **tables}


def table_on_plates(rng: np.random.Generator, dimension: int) -> Tables:
    """A body in space on three parallel plates, each hinged to it and to the ground."""
    lift = np.array([0, *rng.uniform(0.5, 1, 2)])
    places: dict[str, np.ndarray] = {}
    for k in range(3):
        foot, wide = rng.uniform(-0.5, 0.5, 3) + [0, 1.5 * k, 0], rng.uniform(0.2, 0.6)
        for side, x in (("A", 0.0), ("B", wide)):
            places[f"{side}{k}"] = foot + [x, 0, 0]
            places[f"{side}{k}up"] = foot + [x, 0, 0] + lift
    points = _placed(places, {f"{side}{k}" for side in "AB" for k in range(3)}, rng)
    links = {f"plate{k}": body(rng, [f"A{k}", f"B{k}", f"A{k}up", f"B{k}up"], places) for k in range(3)}
    links["table"] = body(rng, [f"{side}{k}up" for side in "AB" for k in range(3)], places)
    return {"points": points, "links": links}


def loop_of_bodies(rng: np.random.Generator, dimension: int) -> Tables:
    """A closed loop of four bodies with parallel hinges: in space its constraints are redundant."""
    corners = [np.array([0.0, 0.0]), np.array([0.1, 1.0]), np.array([1.4, 1.3]), np.array([1.2, 0.0])]
    corners = [c + rng.uniform(-0.1, 0.1, 2) for c in corners]
    depth = rng.uniform(0.2, 0.6, 4)
    places: dict[str, np.ndarray] = {}
    for k, c in enumerate(corners):
        places[f"A{k}"], places[f"B{k}"] = np.array([*c, 0.0]), np.array([*c, depth[k]])
    ground = {"A0", "B0", "A3", "B3"}
    extra = rng.random() < 0.5
    if extra:
        places["C"] = np.array([*(0.4 * corners[1] + 0.6 * corners[2]), rng.uniform(-0.2, 0.2)])
    points = _placed(places, ground, rng)
    links = {}
    for k in range(3):
        of = [f"{side}{i}" for i in (k, k + 1) for side in "AB"] + (["C"] if extra and k == 1 else [])
        links[f"body{k}"] = body(rng, of, places)
    if extra:
        links["strut"] = rod(rng, "C", "B1")
    return {"points": points, "links": links}


def universal_joint(rng: np.random.Generator, dimension: int) -> Tables:
    """Two shafts in bearings whose lines meet, and the cross between them, turned at random."""
    bend, phase, arm = rng.uniform(0.1, 0.6), rng.uniform(0, np.pi), rng.uniform(0.2, 0.5)
    first, second = np.array([1.0, 0, 0]), np.array([np.cos(bend), np.sin(bend), 0])
    y = np.cos(phase) * np.array([0, 1.0, 0]) + np.sin(phase) * np.array([0, 0, 1.0])
    x = np.cross(second, y)
    x /= np.linalg.norm(x)
    places = {"G1": -2 * first, "G2": -first, "Y1": arm * y, "Y2": -arm * y}
    places |= {"X1": arm * x, "X2": -arm * x, "H1": second, "H2": rng.uniform(1.5, 2) * second}
    points = _placed(places, {"G1", "G2", "H1", "H2"}, rng)
    links = {
        "shaft_in": body(rng, ["G1", "G2", "Y1", "Y2"], places),
        "cross": body(rng, ["Y1", "Y2", "X1", "X2"], places),
        "shaft_out": body(rng, ["X1", "X2", "H1", "H2"], places),
    }
    return {"points": points, "links": links}


def braced_body(rng: np.random.Generator, dimension: int) -> Tables:
    """A body on a hinge or a pin with rods between its own points, and a pendulum at one of them."""
    names = [f"P{k}" for k in range(6)]
    places = {name: rng.uniform(-1, 1, dimension) for name in names}
    points = _placed(places, {"P0", "P1"} if dimension == 3 else {"P0"}, rng)
    links = {"body": body(rng, names, places)}
    for k in range(int(rng.integers(1, 4))):
        a, b = rng.choice(names[2:], 2, replace=False)
        if all({a, b} != set(link["points"]) for link in links.values()):
            links[f"rod{k}"] = rod(rng, str(a), str(b))
    places["E"] = places["P2"] + rng.uniform(0.2, 0.5, dimension)
    points["E"] = point(places["E"])
    links["pendulum"] = rod(rng, "P2", "E")
    return {"points": points, "links": links}


KINDS = (
    (table_on_legs, 2),
    (table_on_plates, 3),
    (loop_of_bodies, 3),
    (universal_joint, 3),
    (braced_body, 2),
    (braced_body, 3),
)


def mechanism(seed: int) -> Tables:
    """Return the mechanism of a number; the kinds take turns."""
    make, dimension = KINDS[seed % len(KINDS)]
    tables = make(np.random.default_rng(seed), dimension)
    down = [0.0] * (dimension - 1) + [-9.81]
    tables["gravity"] = {"acceleration": [f"{g} m/s^2" for g in down]}
    return tables


def shuffled(tables: Tables, seed: int) -> Tables:
    """Return the same mechanism with points, links and the points of links in another order."""
    rng = np.random.default_rng(seed)

    def mixed(table: dict[str, Any]) -> dict[str, Any]:
        names = list(table)
        return {names[i]: table[names[i]] for i in rng.permutation(len(names))}

    links = {}
    for name, link in mixed(tables["links"]).items():
        named = link["points"]
        driven = any(
            d["link"] == name for d in tables.get("drivers", ())
        )  # its angle is that of its direction
        order = range(len(named)) if driven else rng.permutation(len(named))
        links[name] = link | {"points": [named[i] for i in order]}
    return tables | {"points": mixed(tables["points"]), "links": links}
