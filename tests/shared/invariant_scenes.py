"""Random scenes as dictionaries, for runs, statics and driven motion; see ``transformed``."""

from __future__ import annotations

import numpy as np
from shared.random_mechanisms import Draft, sketch
from shared.transformed import in_unit, texts

KINDS = ("chain", "tree", "loop", "bodies")


def drawing(rng: np.random.Generator, dimension: int, free: bool = False) -> tuple[Draft, dict]:
    """Return points and links with masses, planar bodies, bodies in space and points on links."""
    kind = KINDS[int(rng.integers(4))]
    draft = sketch(rng, dimension, int(rng.integers(2, 5)), kind, free)
    links = {name: _link(draft, name) for name in draft.links}
    points = {
        p: {"at": texts(at, "m"), "ground": p in draft.ground}
        for p, at in draft.at.items()
        if p not in draft.on
    }
    points |= {p: {"on": link, "fraction": z} for p, (link, z) in draft.on.items()}
    tables = {"points": points, "links": links, "gravity": {"acceleration": texts(draft.vector(10), "m/s^2")}}
    return draft, tables


def _link(draft: Draft, name: str) -> dict:
    points, rng = list(draft.links[name]), draft.rng
    mass = draft.number(0.3, 3)
    link = {"points": points, "mass": in_unit(mass, "kg")}
    carries = any(on == name for on, _ in draft.on.values())
    if draft.dimension == 3 and not carries and rng.random() < 0.4:
        if rng.random() < 0.5:
            points.append(draft.place(near=points[0]))
        link["centre"] = texts(draft.at[points[0]] + draft.vector(0.5), "m")
        root = rng.uniform(-0.2, 0.2, (3, 3))
        spread = mass * (root @ root.T + 0.01 * np.eye(3))
        full = np.trace(spread) * np.eye(3) - spread
        link["inertia"] = texts([*np.diag(full), full[0, 1], full[0, 2], full[1, 2]], "kg*m^2")
        return link
    length = float(np.linalg.norm(draft.at[points[1]] - draft.at[points[0]]))
    link["inertia"] = in_unit(mass * length**2 * rng.uniform(0.04, 0.2), "kg*m^2")
    if len(points) > 2:
        link["centre"] = texts(draft.at[points[0]] + draft.vector(0.5), "m")
    elif rng.random() < 0.5:
        link["centre"] = draft.number(0.2, 0.8)
    return link


def springs(draft: Draft, tables: dict, count: int) -> None:
    pairs = draft.apart()
    tables["springs"] = []
    for _ in range(min(count, len(pairs))):
        a, b = draft.pick(pairs)
        tables["springs"].append(
            {
                "between": [a, b],
                "stiffness": in_unit(draft.number(20, 200), "N/m"),
                "length": in_unit(draft.number(0.1, 1.5), "m"),
                "damping": in_unit(draft.number(0, 2), "N*s/m"),
            }
        )


def moving(rng: np.random.Generator, dimension: int) -> dict:
    """Return a scene that moves: moving ground, start rates, given lengths and angles, and loads."""
    free = rng.random() < 0.2
    draft, tables = drawing(rng, dimension, free)
    single = [k for k, link in tables["links"].items() if len(link["points"]) == 2 and "centre" not in link]
    parameters = {"w": in_unit(draft.number(1, 4), "rad/s")}
    tables["parameters"] = parameters
    if draft.ground and rng.random() < 0.6:
        point = draft.pick(draft.ground)
        speeds = [f"v{i}" for i in range(dimension)]
        parameters |= dict(zip(speeds, texts(draft.vector(1.5), "m/s"), strict=True))
        tables["points"][point]["motion"] = [f"{v}*sin(w*t)/w" for v in speeds]
    if draft.ground:
        for name in single:
            a, b = (draft.at[p] for p in draft.links[name])
            carried = any(p in draft.on for p in draft.links[name])
            if not carried and rng.random() < 0.3:
                tables["links"][name]["length"] = in_unit(
                    np.linalg.norm(b - a) * rng.uniform(0.96, 1.04), "m"
                )
    name = draft.pick(list(draft.links))
    chosen = rng.random()
    if chosen < 0.5:
        rate = draft.number(-3, 3) if dimension == 2 else draft.vector(2)
        tables["start"] = {
            "rates": {name: in_unit(rate, "rad/s") if dimension == 2 else texts(rate, "rad/s")}
        }
    elif dimension == 2 and chosen < 0.8 and draft.ground:
        first, second = (draft.at[p] for p in draft.links[name][:2])
        drawn = float(np.arctan2(*(second - first)[::-1]))
        tables["start"] = {"angles": {name: in_unit(drawn + draft.number(-0.3, 0.3), "rad")}}
    point = draft.pick([p for p in draft.at if p not in draft.ground])
    forces = [f"F{i}" for i in range(dimension)]
    parameters |= dict(zip(forces, texts(draft.vector(10), "N"), strict=True))
    tables["forces"] = [{"point": point, "force": [f"{f}*cos(w*t)" for f in forces]}]
    tables["masses"] = [{"point": point, "mass": in_unit(draft.number(0.1, 1), "kg")}]
    springs(draft, tables, 2)
    torque = draft.number(-5, 5) if dimension == 2 else draft.vector(3)
    torque = in_unit(torque, "N*m") if dimension == 2 else texts(torque, "N*m")
    tables["torques"] = [{"link": draft.pick(list(draft.links)), "torque": torque}]
    if dimension == 2:
        tables["torsion_springs"] = [_torsion_spring(draft)]
    outputs = ["kinetic_energy"]
    for p in tables["points"]:
        outputs += [f"{p}.position", f"{p}.velocity", f"{p}.acceleration"]
        if tables["points"][p].get("ground"):
            outputs.append(f"{p}.reaction")
    for name, link in tables["links"].items():
        outputs += [f"{name}.{p}.force" for p in link["points"]] + [f"{name}.angular_velocity"]
    tables["analysis"] = {"outputs": outputs}
    return tables


def _torsion_spring(draft: Draft) -> dict:
    names = list(draft.links)
    link, against = draft.pick(names), draft.pick(names)
    angles = {k: np.arctan2(*(draft.at[p[1]] - draft.at[p[0]])[::-1]) for k, p in draft.links.items()}
    drawn = angles[link] - (angles[against] if against != link else 0.0)
    spring = {
        "link": link,
        "stiffness": in_unit(draft.number(2, 20), "N*m"),
        "angle": in_unit(drawn + draft.number(-1, 1), "rad"),
        "damping": in_unit(draft.number(0, 0.5), "N*m*s"),
    }
    return spring | ({"against": against} if against != link else {})


def resting(rng: np.random.Generator, dimension: int) -> dict:
    """Return a scene with an equilibrium: nothing moves, springs hold."""
    draft, tables = drawing(rng, dimension)
    springs(draft, tables, 3)
    point = draft.pick([p for p in draft.at if p not in draft.ground])
    tables["forces"] = [{"point": point, "force": texts(draft.vector(10), "N")}]
    if dimension == 2:
        tables["torsion_springs"] = [_torsion_spring(draft)]
    outputs = [f"{p}.position" for p in tables["points"]]
    outputs += [f"{p}.reaction" for p, t in tables["points"].items() if t.get("ground")]
    outputs += [f"{k}.{p}.force" for k, link in tables["links"].items() for p in link["points"]]
    tables["analysis"] = {"outputs": outputs}
    return tables


def _direction(draft: Draft, link: str) -> float:
    start, end = (draft.at[p] for p in draft.links[link][:2])
    return float(np.arctan2(*(end - start)[::-1]))


def driven(rng: np.random.Generator, dimension: int = 2) -> dict:
    """Return a driven crank with one to three dyads in the plane, and in half of them a rod driven against it."""
    draft = Draft(rng, 2)
    ground = draft.place(ground=True)
    tip = draft.place(near=ground)
    draft.links["L0"] = [ground, tip]
    for _ in range(int(rng.integers(1, 4))):
        moving = draft.pick([p for p in draft.at if p not in draft.ground])
        other = draft.place(near=moving, ground=True) if rng.random() < 0.6 else draft.pick(list(draft.at))
        if other == moving:
            other = draft.place(near=moving, ground=True)
        joint = draft.place(near=moving)
        for end in (moving, other):
            points = [joint, end] if rng.random() < 0.5 else [end, joint]
            draft.links[f"L{len(draft.links)}"] = points
            if rng.random() < 0.4:
                points.append(draft.place(near=joint))
    tools = ["tool"] if rng.random() < 0.5 else []
    for name in tools:
        draft.links[name] = [tip, draft.place(near=tip)]
    links = {name: _link(draft, name) for name in draft.links}
    points = {p: {"at": texts(at, "m"), "ground": p in draft.ground} for p, at in draft.at.items()}
    start = _direction(draft, "L0")
    tables = {
        "parameters": {"w": in_unit(draft.number(0.5, 1), "rad/s"), "start": in_unit(start, "rad")},
        "points": points,
        "links": links,
        "gravity": {"acceleration": texts(draft.vector(10), "m/s^2")},
        "drivers": [{"link": "L0", "angle": "start + w*t"}],
    }
    for name in tools:
        tables["parameters"]["bent"] = in_unit(_direction(draft, name) - start, "rad")
        tables["drivers"].append({"link": name, "against": "L0", "angle": "bent + 1.5*w*t"})
    springs(draft, tables, 2)
    tables["torsion_springs"] = [_torsion_spring(draft)]
    outputs = ["kinetic_energy", "L0.torque", *(f"{name}.torque" for name in tools)]
    for p, at in points.items():
        outputs += [f"{p}.position", f"{p}.velocity", f"{p}.acceleration"]
        outputs += [f"{p}.reaction"] if at["ground"] else []
    for name, link in links.items():
        outputs += [f"{name}.{p}.force" for p in link["points"]] + [f"{name}.angle"]
    tables["analysis"] = {"outputs": outputs}
    return tables


#: Rods between six points that no angle and no dyads place one after the other: each of A, C, E joins each of B, D, F.
ENTANGLED = ("TA", "GC", "HE", "AB", "BC", "CD", "DE", "EF", "FA", "AD", "BE", "CF")


def entangled(rng: np.random.Generator, dimension: int = 2) -> dict:
    """Return a driven crank O T with rods whose assembly modes are searched from many poses."""
    at = {p: rng.uniform(-1, 1, 2) for p in "OTGHABCDEF"}
    start = float(np.arctan2(*(at["T"] - at["O"])[::-1]))
    links = {rod: {"points": [*rod], "mass": "1.0 kg"} for rod in ("OT", *ENTANGLED)}
    return {
        "parameters": {"w": "1.0 rad/s", "start": in_unit(start, "rad")},
        "points": {p: {"at": texts(x, "m"), "ground": p in "OGH"} for p, x in at.items()},
        "links": links,
        "drivers": [{"link": "OT", "angle": "start + w*t"}],
    }
