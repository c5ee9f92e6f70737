"""Random trees, chains and loops of rods and planar bodies, as a scene for symgen and as a Mechanism."""

from __future__ import annotations

import numpy as np
from shared.minimal import Body, Mechanism, Minimal, Pose, Real, Spring, across

import symgen

#: Loops nearer to a dead centre than this condition number are not compared, but counted.
WORST_CONDITION = 100.0


class Draft:
    """A mechanism under construction, in exact decimals: the scene's text and the numbers agree."""

    def __init__(self, rng, dimension: int) -> None:
        self.rng, self.dimension = rng, dimension
        self.at: dict[str, np.ndarray] = {}
        self.ground: list[str] = []
        self.on: dict[str, tuple[str, float]] = {}
        self.links: dict[str, list[str]] = {}

    def number(self, low, high):
        return round(float(self.rng.uniform(low, high)), 3)

    def vector(self, size):
        return np.array([self.number(-size, size) for _ in range(self.dimension)])

    def place(self, near=None, ground=False) -> str:
        name = f"P{len(self.at)}"
        while True:
            step = self.vector(1.2)
            place = step if near is None else np.round(self.at[near] + step, 3)
            far = all(np.linalg.norm(place - other) > 0.35 for other in self.at.values())
            if far:
                break
        self.at[name] = place
        if ground:
            self.ground.append(name)
        return name

    def link(self, points) -> None:
        points = list(points)
        if self.rng.random() < 0.5:
            points[:2] = points[1::-1]
        self.links[f"L{len(self.links)}"] = points

    def place_on(self, link: str) -> str:
        """A further point on the line of a link, beyond its ends too; drawn to the digits of a double."""
        name, fraction = f"P{len(self.at)}", self.number(-0.4, 1.4)
        start, end = (self.at[p] for p in self.links[link][:2])
        self.at[name] = start + fraction * (end - start)
        self.on[name] = link, fraction
        return name

    def pick(self, names):
        return names[int(self.rng.integers(len(names)))]

    def apart(self) -> list[tuple[str, str]]:
        """Pairs of points that no link joins yet, at most one of them ground."""
        names = list(self.at)
        return [
            (a, b)
            for i, a in enumerate(names)
            for b in names[i + 1 :]
            if not {a, b} <= set(self.ground) and not any({a, b} <= set(v) for v in self.links.values())
        ]


def sketch(rng, dimension: int, count: int, kind: str, free: bool) -> Draft:
    """Points and links: a serial chain, a tree, a tree closed to loops, or a tree with joints all over its bodies."""
    draft = Draft(rng, dimension)
    first = draft.place(ground=not free)
    chords = 0 if kind != "loop" else int(rng.integers(1, 1 + max(1, count // 3)))
    tips = [first]
    for _ in range(count - chords):
        parent = tips[-1] if kind == "chain" else draft.pick(list(draft.at))
        points = [parent, draft.place(near=parent)]
        tips.append(points[1])
        if kind == "bodies" and dimension == 2 and rng.random() < 0.5:
            points.append(draft.place(near=parent))
            rng.shuffle(points)
        draft.link(points)
        if kind == "bodies" and rng.random() < 0.6:
            draft.place_on(list(draft.links)[-1])
    for _ in range(chords):
        pairs = draft.apart()
        if not pairs or (not free and rng.random() < 0.6):
            moving = draft.pick([p for p in draft.at if p not in draft.ground])
            draft.link([moving, draft.place(near=moving, ground=True)])
        else:
            draft.link(draft.pick(pairs))
    return draft


def exactly(values) -> np.ndarray:
    """Decimals as extended doubles."""
    return np.array([Real(repr(x)) for x in np.asarray(values).tolist()])


def in_unit(values, unit: str) -> list[str]:
    return [f"{x!r} {unit}" for x in np.asarray(values).tolist()]


def loaded(draft: Draft) -> tuple[Mechanism, symgen.Scene]:
    """Give a sketch its masses and loads, both as numbers and as tables of a scene."""
    words: dict = {"parameters": {"newton": "1 N", "hz": "1 Hz"}, "links": {}}
    placed = {p: at for p, at in draft.at.items() if p not in draft.on}
    words["points"] = {p: {"at": in_unit(at, "m"), "ground": p in draft.ground} for p, at in placed.items()}
    words["points"] |= {p: {"on": link, "fraction": z} for p, (link, z) in draft.on.items()}
    gravity = draft.vector(10)
    words["gravity"] = {"acceleration": in_unit(gravity, "m/s^2")}
    ground = {p: exactly(draft.at[p]) for p in draft.ground}
    mechanism = Mechanism(draft.dimension, ground, [], exactly(gravity))
    for name in draft.links:
        _add_body(draft, name, mechanism, words)
    _add_at_points(draft, mechanism, words)
    _add_springs(draft, mechanism, words)
    _add_torques(draft, mechanism, words)
    return mechanism, symgen.Scene(**words)


def _add_body(draft: Draft, name: str, mechanism: Mechanism, words: dict) -> None:
    points, number = draft.links[name], draft.number
    start = exactly(draft.at[points[0]])
    along = exactly(draft.at[points[1]]) - start
    length = np.sqrt(along @ along)
    e = along / length
    mass = number(0.2, 3)
    # From a tenth of a uniform rod's to five times it: with the centre, this makes any particle negative.
    inertia = max(1e-4, round(float(mass * length**2) * 10 ** number(-2.1, -0.4), 4))
    if len(points) == 2:
        centre = number(0.1, 0.9) if draft.rng.random() < 0.7 else number(-0.3, 1.3)
        place = (Real(repr(centre)) * length, Real(0))
    else:
        left = across(e)[:, 0]
        drawn = np.round(draft.at[points[0]] + draft.vector(0.5), 3)
        centre = in_unit(drawn, "m")
        place = ((exactly(drawn) - start) @ e, (exactly(drawn) - start) @ left)
    frame = {points[0]: (Real(0), Real(0)), points[1]: (length, Real(0))}
    for p in points[2:]:
        frame[p] = ((exactly(draft.at[p]) - start) @ e, (exactly(draft.at[p]) - start) @ left)
    for p, (link, fraction) in draft.on.items():
        if link == name:
            frame[p] = (Real(repr(fraction)) * length, Real(0))
    words["links"][name] = {
        "points": points,
        "mass": f"{mass!r} kg",
        "centre": centre,
        "inertia": f"{inertia!r} kg*m^2",
    }
    mechanism.bodies.append(Body(name, frame, Real(repr(mass)), place, Real(repr(inertia))))


def _add_at_points(draft: Draft, mechanism: Mechanism, words: dict) -> None:
    moving = [p for p in draft.at if p not in draft.ground]
    some = max(1, len(moving) // 3)
    words["masses"], words["forces"] = [], []
    for p in draft.rng.choice(moving, some, replace=False).tolist():
        mass = draft.number(0.1, 2)
        words["masses"].append({"point": p, "mass": f"{mass!r} kg"})
        mechanism.masses[p] = Real(repr(mass))
    for p in draft.rng.choice(moving, some, replace=False).tolist():
        size, rate = draft.vector(20), draft.number(1, 4)
        force = [f"{x!r}*newton*cos({rate!r}*hz*t)" for x in size.tolist()]
        words["forces"].append({"point": p, "force": force})
        exact, w = exactly(size), Real(repr(rate))
        mechanism.forces.append((p, lambda t, exact=exact, w=w: exact * np.cos(w * t)))


def _add_springs(draft: Draft, mechanism: Mechanism, words: dict) -> None:
    words["springs"] = []
    pairs = draft.apart()
    for k in range(min(2, len(pairs))):
        ends = draft.pick(pairs)
        values = [draft.number(5, 60), draft.number(0, 1.5), draft.number(0, 3) if k else 0.0]
        stiffness, slack, damping = values
        words["springs"].append(
            {
                "between": list(ends),
                "stiffness": f"{stiffness!r} N/m",
                "length": f"{slack!r} m",
                "damping": f"{damping!r} N*s/m",
            }
        )
        mechanism.springs.append(Spring(ends, *exactly(values)))


def _add_torques(draft: Draft, mechanism: Mechanism, words: dict) -> None:
    words["torques"] = []
    names = list(draft.links)
    for _ in range(min(2, len(names))):
        link, against = draft.pick(names), draft.pick(names)
        torque = draft.vector(8)[: 1 if draft.dimension == 2 else 3]
        components = in_unit(torque, "N*m")
        couple = {"link": link, "torque": components[0] if len(torque) == 1 else components}
        if against != link:
            couple["against"] = against
        words["torques"].append(couple)
        exact = exactly(torque)
        mechanism.torques.append((link, couple.get("against"), lambda t, exact=exact: exact))


def usable(model: Minimal, pose: Pose) -> bool:
    """Return whether no spring is near zero length, where its direction is undefined."""
    points, _, _ = model.motion(pose)
    gaps = [points[b].value - points[a].value for a, b in (s.ends for s in model.mechanism.springs)]
    return all(np.sqrt(g @ g) > 0.1 for g in gaps)


def draw(rng, dimension: int, count: int, kind: str, free: bool):
    """A random mechanism that can move, drawn in a well-conditioned pose; and the number of draws too near a dead centre."""
    refused = 0
    while True:
        draft = sketch(rng, dimension, count, kind, free)
        mechanism, scene = loaded(draft)
        model = Minimal(mechanism)
        if model.freedoms < 1:
            continue
        exact = {p: exactly(at) for p, at in draft.at.items()}
        drawn = model.pose(exact, {p: 0 * x for p, x in exact.items()})
        if model.condition(drawn) > WORST_CONDITION:
            refused += 1
            continue
        return scene, model, drawn, refused


def random_pose(rng, model: Minimal, drawn: Pose) -> tuple[Pose, int]:
    """Any pose of a tree, a pose near the drawn one of a closed linkage; moving; and the number of rejected draws."""
    refused, reach = 0, 0.5
    while True:
        turn = rng.standard_normal(model.size)
        if model.cuts:
            pose = model.closed(model.moved(drawn, (reach * turn).astype(Real)))
            reach *= 0.9
        else:
            pose = model.moved(drawn, (20 * turn).astype(Real))
        if pose is None or not usable(model, pose):
            continue
        if model.condition(pose) > WORST_CONDITION:
            refused += 1
            continue
        return model.moving(pose, (2 * rng.standard_normal(model.size)).astype(Real)), refused
