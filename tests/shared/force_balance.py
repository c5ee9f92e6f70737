"""Random linkages under every kind of load, and the balance of forces and moments of each link and each point.

The balance knows the scene in numbers, and of a run the places, velocities and accelerations of points, the
directions of links, and the recorded forces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation
from shared.random_mechanisms import Draft, sketch

import symgen

KINDS = ("chain", "tree", "loop", "bodies")
AXES = "xyz"


@dataclass
class Body:
    """A link: mass, place of the centre as drawn, and inertia about it."""

    points: list[str]
    mass: float
    centre: np.ndarray
    inertia: np.ndarray | float


@dataclass
class Sample:
    """The outputs of a run at one time, by name."""

    t: float
    values: dict[str, np.ndarray]

    def __call__(self, owner: str, word: str) -> np.ndarray:
        return self.values[f"{owner}.{word}"]


#: A force on a point, and a force at a place with a couple on a link, at a sample.
OnPoint = Callable[[Sample], np.ndarray]
OnLink = Callable[[Sample], tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass
class Loaded:
    """A linkage with loads: as the tables of a scene, and as numbers."""

    rng: np.random.Generator
    draft: Draft
    tables: dict
    bodies: dict[str, Body] = field(default_factory=dict)
    points: dict[str, float] = field(default_factory=dict)
    on_points: list[tuple[str, OnPoint]] = field(default_factory=list)
    on_links: list[tuple[str, OnLink]] = field(default_factory=list)
    guided: dict[str, str] = field(default_factory=dict)
    rails: list[str] = field(default_factory=list)
    driven: dict[str, np.ndarray | None] = field(default_factory=dict)
    on_ground: list[Callable[[Sample], np.ndarray]] = field(default_factory=list)
    gravity: np.ndarray = field(default_factory=lambda: np.zeros(2))

    @property
    def dimension(self) -> int:
        return self.draft.dimension

    @property
    def zero(self) -> np.ndarray:
        return np.zeros(1 if self.dimension == 2 else 3)

    def number(self, low: float, high: float) -> float:
        return self.draft.number(low, high)

    def vector(self, size: float) -> np.ndarray:
        return self.draft.vector(size)

    def pick(self, names):
        return self.draft.pick(list(names))

    def add(self, table: str, **entry) -> None:
        self.tables.setdefault(table, []).append(entry)

    def couple(self, link: str, torque: Callable[[Sample], np.ndarray], against: str | None) -> None:
        """A couple on a link, and its opposite on another one."""
        nowhere = np.zeros(self.dimension)
        self.on_links.append(
            (link, lambda s: (nowhere, s(self.bodies[link].points[0], "position"), torque(s)))
        )
        if against:
            self.couple(against, lambda s: -torque(s), None)


def across(v: np.ndarray) -> np.ndarray:
    """A vector in the plane turned left."""
    return np.array([-v[1], v[0]])


def moment(arm: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The moment of a force: one component in the plane."""
    if len(arm) == 2:
        return np.array([arm[0] * force[1] - arm[1] * force[0]])
    return np.cross(arm, force)


def texts(values, unit: str) -> list[str]:
    return [f"{x!r} {unit}" for x in np.asarray(values, dtype=float).tolist()]


def random_linkage(seed: int, driven: bool = True) -> Loaded:
    """A random linkage, in the plane for even seeds and in space for odd ones; most are ``driven``."""
    rng = np.random.default_rng([3, seed])
    dimension = 2 + seed % 2
    kind = KINDS[int(rng.integers(4))]
    count = int(rng.integers(3, 6) if kind == "loop" else rng.integers(2, 5))
    draft = sketch(rng, dimension, count, kind, free=rng.random() < 0.2)
    made = Loaded(rng, draft, {"parameters": {"n": "1 N", "hz": "1 Hz", "m": "1 m", "s": "1 s"}})
    made.gravity = made.vector(10)
    made.tables["gravity"] = {"acceleration": texts(made.gravity, "m/s^2")}
    if rng.random() < 0.6:
        _slider(made)
    for name in list(draft.links):
        _body(made, name)
    if driven:
        _drive(made)
    places = {p: at for p, at in draft.at.items() if p not in draft.on}
    made.tables["points"] = {
        p: {"at": texts(at, "m"), "ground": p in draft.ground} for p, at in places.items()
    }
    made.tables["points"] |= {p: {"on": link, "fraction": z} for p, (link, z) in draft.on.items()}
    _moving_ground(made)
    for load in (_masses, _lines, _forces, _torques, _torsion_springs):
        load(made)
    if dimension == 2:
        _distributed(made)
    _start(made)
    made.tables["analysis"] = {"t_end": "0.1 s", "outputs": outputs(made)}
    return made


def _slider(made: Loaded) -> None:
    """Put a point on the line of a link, or of a new rail, and a rod with a free end on it."""
    draft = made.draft
    if made.rng.random() < 0.5:
        along = made.pick(draft.links)
    else:
        near = made.pick(draft.at)
        rail = [draft.place(near=near, ground=True)]
        rail.append(draft.place(near=rail[0], ground=True))
        along = "rail"
        draft.links[along] = rail
        made.rails.append(along)
    start, end = (draft.at[p] for p in draft.links[along][:2])
    slider = "S"
    draft.at[slider] = start + made.number(-0.5, 1.5) * (end - start)
    draft.link([slider, draft.place(near=slider)])
    made.add("guides", points=[slider], along=along)
    made.guided[slider] = along


def _body(made: Loaded, name: str) -> None:
    """Give a link its mass; some in space become bodies with a third point."""
    draft, links = made.draft, made.tables.setdefault("links", {})
    points = draft.links[name]
    if name in made.rails:
        links[name] = {"points": points}
        return
    mass, dimension = made.number(0.2, 3), made.dimension
    start, end = (draft.at[p] for p in points[:2])
    length = np.linalg.norm(end - start)
    if dimension == 3 and made.rng.random() < 0.5 and name not in made.guided.values():
        points.append(draft.place(near=points[0]))
    table: dict = {"points": points, "mass": f"{mass!r} kg"}
    if len(points) == 2:
        fraction = made.number(-0.2, 1.2)
        centre, inertia = (
            start + fraction * (end - start),
            round(mass * float(length) ** 2 * made.number(0.05, 0.3), 4),
        )
        table |= {"centre": fraction, "inertia": f"{inertia!r} kg*m^2"}
    else:
        centre = np.round(start + made.vector(0.5), 3)
        table["centre"] = texts(centre, "m")
        if dimension == 2:
            inertia = round(mass * made.number(0.05, 0.4), 4)
            table["inertia"] = f"{inertia!r} kg*m^2"
        else:
            turn = Rotation.random(random_state=int(made.rng.integers(1 << 30))).as_matrix()
            inertia = mass * turn @ np.diag([0.05, 0.08, 0.11]) @ turn.T
            inertia = (inertia + inertia.T) / 2
            six = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            table["inertia"] = texts(six, "kg*m^2")
    links[name] = table
    on = [p for p, (link, _) in draft.on.items() if link == name]
    made.bodies[name] = Body([*points, *on], mass, centre, inertia)


def _drive(made: Loaded) -> None:
    """Drive a rod from the ground at a rate that changes; in space about a revolute joint."""
    draft = made.draft
    rods = [
        (name, draft.links[name])
        for name in made.bodies
        if len(set(draft.links[name][:2]) & set(draft.ground)) == 1
        and (made.dimension == 2 or len(draft.links[name]) == 2)
    ]
    if not rods or made.rng.random() < 0.4:
        return
    name, points = made.pick(rods)
    d = draft.at[points[1]] - draft.at[points[0]]
    rate = made.number(-3, 3)
    motion = f"{rate!r}*hz*t + 0.2*sin(2*hz*t)"
    if made.dimension == 2:
        made.add("drivers", link=name, angle=f"{float(np.arctan2(d[1], d[0]))!r} + {motion}")
        made.driven[name] = None
        return
    axis = np.round(np.cross(d, made.vector(1) + [0, 0, 1e-3]), 3)
    ground = next(p for p in points if p in draft.ground)
    made.add("joints", point=ground, links=[name], kind="revolute", axis=axis.tolist())
    made.add("drivers", link=name, angle=motion)
    made.driven[name] = axis / np.linalg.norm(axis)


def _moving_ground(made: Loaded) -> None:
    still = {p for name in made.rails for p in made.draft.links[name]}
    for point in made.draft.ground:
        if point not in still and made.rng.random() < 0.5:
            sizes = made.vector(0.3).tolist()
            motion = [f"{x!r}*m*sin({made.number(1, 4)!r}*hz*t)" for x in sizes]
            made.tables["points"][point]["motion"] = motion


def _masses(made: Loaded) -> None:
    for _ in range(2):
        point, mass = made.pick(made.draft.at), made.number(0.1, 2)
        entry: dict = {"point": point, "mass": f"{mass!r} kg"}
        links = [k for k, body in made.bodies.items() if point in body.points]
        if made.dimension == 2 and links and made.rng.random() < 0.6:
            link, inertia = made.pick(links), made.number(0.01, 0.2)
            entry |= {"inertia": f"{inertia!r} kg*m^2", "link": link}
            made.bodies[link].inertia += inertia
        made.add("masses", **entry)
        made.points[point] = made.points.get(point, 0.0) + mass


def _lines(made: Loaded) -> None:
    """A spring with a damper, a damper alone, a spring of zero length, and an actuator with feedback."""
    names = list(made.draft.at)
    for k in range(4):
        a, b = made.rng.choice(names, 2, replace=False).tolist()
        stiffness, slack, damping = made.number(5, 60), made.number(0.1, 1.5), made.number(0.5, 3)
        stiffness, damping = (0.0 if k == 1 else stiffness), (0.0 if k == 2 else damping)
        slack = 0.0 if k == 2 else slack
        if k < 3:
            entry = {
                "stiffness": f"{stiffness!r} N/m",
                "length": f"{slack!r} m",
                "damping": f"{damping!r} N*s/m",
            }
            made.add("springs", between=[a, b], **entry)
        else:
            stiffness, slack, damping = -stiffness, 0.0, 0.0
            force = f"{-stiffness!r}*n/m*this.length + {slack!r}*n - n*t*hz"
            made.add("actuators", between=[a, b], force=force)

        def push(s, a=a, b=b, k=k, stiffness=stiffness, slack=slack, damping=damping):
            d, v = (s(b, word) - s(a, word) for word in ("position", "velocity"))
            length = np.linalg.norm(d)
            size = -stiffness * (length - slack) - (s.t if k == 3 else 0.0)
            if damping:
                size -= damping * (d @ v) / length
            return size * d / length

        made.on_points.append((b, push))
        made.on_points.append((a, lambda s, push=push: -push(s)))


def _forces(made: Loaded) -> None:
    """Forces on fixed axes, with feedback, and in the plane forces that rotate with links."""
    for k in range(4):
        point, size = made.pick(made.draft.at), made.vector(20)
        probe = made.pick(made.draft.at)
        force = [f"{x!r}*n*cos(2*hz*t) - 0.7*n/m*{probe}.x" for x in size.tolist()]
        link = made.pick(made.bodies) if made.dimension == 2 and k % 2 else None
        if link and made.rng.random() < 0.7:
            point = made.pick(made.bodies[link].points)
        made.add("forces", point=point, force=force, **({"link": link} if link else {}))

        def on_point(s, size=size, probe=probe, link=link):
            components = size * np.cos(2 * s.t) - 0.7 * s(probe, "position")[0]
            if link is None:
                return components
            angle = s(link, "angle")
            e = np.array([np.cos(angle), np.sin(angle)])
            return components[0] * e + components[1] * across(e)

        made.on_points.append((point, on_point))


def _torques(made: Loaded) -> None:
    names = list(made.bodies)
    for _ in range(2):
        link, against = made.pick(names), made.pick(names)
        against = None if against == link else against
        probe = made.pick(made.draft.at)
        size = made.vector(8)[: len(made.zero)] if made.dimension == 3 else made.vector(8)[:1]
        torque = [f"{x!r}*n*m + 0.3*n*s*{probe}.vy" for x in size.tolist()]
        entry = {"link": link, "torque": torque[0] if made.dimension == 2 else torque}
        made.add("torques", **entry, **({"against": against} if against else {}))
        made.couple(link, lambda s, size=size, probe=probe: size + 0.3 * s(probe, "velocity")[1], against)


def _torsion_springs(made: Loaded) -> None:
    draft = made.draft
    rods = [name for name, body in made.bodies.items() if made.dimension == 2 or len(draft.links[name]) == 2]
    for _ in range(2):
        if not rods:
            return
        link, against = made.pick(rods), made.pick(rods)
        against = None if against == link else against
        stiffness, damping = made.number(1, 9), made.number(0.1, 1)
        entry = {"link": link, "stiffness": f"{stiffness!r} N*m"} | ({"against": against} if against else {})
        if made.dimension == 3:
            if not against:
                continue
            made.add("torsion_springs", **entry)

            def straighten(s, link=link, against=against, stiffness=stiffness):
                d, e = (
                    s(draft.links[k][1], "position") - s(draft.links[k][0], "position")
                    for k in (link, against)
                )
                return stiffness * np.cross(d, e) / (np.linalg.norm(d) * np.linalg.norm(e))

            made.couple(link, straighten, against)
            continue
        free = round(_drawn_angle(draft, link) - (_drawn_angle(draft, against) if against else 0.0), 2)
        free = round((free + np.pi) % (2 * np.pi) - np.pi + made.number(-0.8, 0.8), 3)
        made.add("torsion_springs", **entry, angle=f"{free!r} rad", damping=f"{damping!r} N*m*s")

        def unwind(s, link=link, against=against, stiffness=stiffness, damping=damping, free=free):
            angle, rate = (
                s(link, w) - (s(against, w) if against else 0.0) for w in ("angle", "angular_velocity")
            )
            return np.array([-stiffness * ((angle - free + np.pi) % (2 * np.pi) - np.pi) - damping * rate])

        made.couple(link, unwind, against)
        if not against:
            made.on_ground.append(unwind)


def _drawn_angle(draft: Draft, link: str) -> float:
    first, second = (draft.at[p] for p in draft.links[link][:2])
    return float(np.arctan2(*(second - first)[::-1]))


def _distributed(made: Loaded) -> None:
    for axes in ("fixed", "link"):
        link = made.pick(made.bodies)
        first, second = made.vector(9), made.vector(9)
        ends = [[f"{x!r}*n/m*cos(hz*t)" for x in f.tolist()] for f in (first, second)]
        made.add("distributed_forces", link=link, force=ends[0], end=ends[1], axes=axes)

        def spread(s, link=link, first=first, second=second, axes=axes):
            a, b = (s(p, "position") for p in made.bodies[link].points[:2])
            e = (b - a) / np.linalg.norm(b - a)
            turn = np.column_stack([e, across(e)]) if axes == "link" else np.eye(2)
            f, g = (turn @ x * np.cos(s.t) * np.linalg.norm(b - a) for x in (first, second))
            # Simpson's rule is exact: the moment is quadratic along the link.
            couple = (4 * moment((b - a) / 2, (f + g) / 2) + moment(b - a, g)) / 6
            return (f + g) / 2, a, couple

        made.on_links.append((link, spread))


def _start(made: Loaded) -> None:
    """A velocity for a free end."""
    count: dict[str, int] = {}
    for body in made.bodies.values():
        for p in body.points:
            count[p] = count.get(p, 0) + 1
    loose = [
        p for p in made.draft.links[list(made.bodies)[-1]][:2] if count[p] == 1 and p not in made.draft.ground
    ]
    if not loose or list(made.bodies)[-1] in made.driven:
        return
    points = made.draft.links[list(made.bodies)[-1]][:2]
    other = points[1 - points.index(loose[0])]
    if other in made.draft.ground and made.dimension == 2 and "motion" not in made.tables["points"][other]:
        d = made.draft.at[loose[0]] - made.draft.at[other]
        made.tables["start"] = {"velocities": {loose[0]: texts(2.0 * across(d), "m/s")}}


def outputs(made: Loaded) -> list[str]:
    """The outputs that the balance needs."""
    names = [f"{p}.{word}" for p in made.draft.at for word in ("position", "velocity", "acceleration")]
    free = [p for p in made.draft.ground if not any(p in made.draft.links[rail] for rail in made.rails)]
    names += [f"{p}.reaction" for p in free if any(p in body.points for body in made.bodies.values())]
    for link, body in made.bodies.items():
        names += [f"{link}.{p}.force" for p in body.points]
        names.append(f"{link}.angular_velocity")
        names += [f"{link}.{word}" for word in ("angle", "angular_acceleration") if made.dimension == 2]
    return [*names, "shaking_force", "shaking_moment", *(f"{link}.torque" for link in made.driven)]


def samples(run: symgen.Result) -> Iterator[Sample]:
    """The recorded samples of a run."""
    values = {name: np.asarray(run[name]) for name in run.dataset.data_vars}
    for i, t in enumerate(run.time.tolist()):
        yield Sample(t, {name: v[i] for name, v in values.items()})


def missing(made: Loaded, s: Sample) -> Iterator[tuple[str, float]]:
    """What is missing to the balance of each link and each point at a sample, over the largest force there."""
    size = max(
        float(np.max(np.abs(v))) for name, v in s.values.items() if name.endswith((".force", ".reaction"))
    )
    forces = {link: [] for link in made.bodies}
    for link, body in made.bodies.items():
        forces[link] += [(s(f"{link}.{p}", "force"), s(p, "position"), made.zero) for p in body.points]
    for link, load in made.on_links:
        forces[link].append(load(s))
    for point in made.draft.at:
        rest = _of_point(made, s, point)
        along = made.guided.get(point)
        if along is not None:
            a, b = (s(p, "position") for p in made.draft.links[along][:2])
            yield f"{point} along {along}", abs(rest @ (b - a)) / (size * np.linalg.norm(b - a))
            if along in forces:
                forces[along].append((rest, s(point, "position"), made.zero))
        elif not any(point in made.draft.links[rail] for rail in made.rails):
            yield point, float(np.max(np.abs(rest))) / size
    for link, body in made.bodies.items():
        for noun, rest in zip(("force", "moment"), _of_link(made, s, link, body, forces[link]), strict=True):
            yield f"{noun} on {link}", float(np.max(np.abs(rest), initial=0.0)) / size


def shaken(made: Loaded, s: Sample) -> Iterator[tuple[str, float]]:
    """What is missing to Newton's laws of the whole: weights and loads less inertia are on the ground.

    Springs and actuators push both ends, the ground included. Torsion springs on the ground belong to it.
    """
    parts = [(load(s), s(point, "position"), made.zero) for point, load in made.on_points]
    for point, mass in made.points.items():
        weight = mass * (made.gravity - s(point, "acceleration"))
        parts.append((weight, s(point, "position"), made.zero))
    for link, body in made.bodies.items():
        centre, acceleration, spin = _motion(made, s, link, body)
        parts.append((body.mass * (made.gravity - acceleration), centre, -spin))
    for link, load in made.on_links:
        force, place, couple = load(s)
        body = made.bodies[link]
        if made.dimension == 3 and not isinstance(body.inertia, np.ndarray):  # its line takes no couple
            a, b = (s(p, "position") for p in body.points[:2])
            couple = couple - (couple @ (b - a)) * (b - a) / ((b - a) @ (b - a))
        parts.append((force, place, couple))
    parts += [(np.zeros(made.dimension), np.zeros(made.dimension), -load(s)) for load in made.on_ground]
    moments = [moment(place, force) + couple for force, place, couple in parts]
    for name, terms in (("force", [f for f, *_ in parts]), ("moment", moments)):
        size = max(float(np.max(np.abs(x))) for x in terms)
        yield name, float(np.max(np.abs(s.values[f"shaking_{name}"] - sum(terms)))) / size


def _of_point(made: Loaded, s: Sample, point: str) -> np.ndarray:
    """Loads on a point less the forces that it gives to links: without a guide zero."""
    rest = made.points.get(point, 0.0) * (made.gravity - s(point, "acceleration"))
    rest = rest + s.values.get(f"{point}.reaction", 0.0)
    for p, load in made.on_points:
        if p == point:
            rest = rest + load(s)
    for link, body in made.bodies.items():
        if point in body.points:
            rest = rest - s(f"{link}.{point}", "force")
    return rest


def _of_link(made: Loaded, s: Sample, link: str, body: Body, forces) -> tuple[np.ndarray, np.ndarray]:
    """Newton's and Euler's equations of a link about its centre of mass."""
    centre, acceleration, spin = _motion(made, s, link, body)
    force = body.mass * (made.gravity - acceleration) + sum(f for f, _, _ in forces)
    couple = sum(moment(at - centre, f) + torque for f, at, torque in forces) - spin
    if made.dimension == 2:
        torque = s(link, "torque") if link in made.driven else 0.0
        return force, couple + torque
    if len(body.points) > 2 and isinstance(body.inertia, np.ndarray):
        return force, couple
    # A rod has no inertia about its line, and the bearing of a driven one leaves the moment about its axis.
    a, b = (s(p, "position") for p in body.points[:2])
    e = (b - a) / np.linalg.norm(b - a)
    couple = couple - (couple @ e) * e
    if link not in made.driven:
        return force, couple
    axis = made.driven[link]
    return force, np.array([couple @ axis + s(link, "torque")])


def _motion(made: Loaded, s: Sample, link: str, body: Body) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place and acceleration of the centre of mass, and the rate of the angular momentum about it."""
    drawn = np.array([made.draft.at[p] for p in body.points])
    places, accelerations = (np.array([s(p, w) for p in body.points]) for w in ("position", "acceleration"))
    arm, rate = body.centre - drawn[0], s(link, "angular_velocity")
    if made.dimension == 2:
        turn = float(s(link, "angle")) - float(np.arctan2(*(drawn[1] - drawn[0])[::-1]))
        arm = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ arm
        twist = s(link, "angular_acceleration")
        return (
            places[0] + arm,
            accelerations[0] + twist * across(arm) - rate**2 * arm,
            np.array([body.inertia * twist]),
        )
    if not isinstance(body.inertia, np.ndarray):
        d = drawn[1] - drawn[0]
        share = arm @ d / (d @ d)
        d, dd = (x[1] - x[0] for x in (places, accelerations))
        spin = body.inertia * np.cross(d, dd) / (d @ d)
        return places[0] + share * d, accelerations[0] + share * dd, spin
    turn = Rotation.align_vectors(places[1:3] - places[0], drawn[1:3] - drawn[0])[0].as_matrix()
    arm = turn @ arm
    arms = places[1:3] - places[0]
    rates = accelerations[1:3] - accelerations[0] - np.cross(rate, np.cross(rate, arms))
    crossed = np.vstack([-np.cross(np.eye(3), r).T for r in arms])
    twist = np.linalg.lstsq(-crossed, rates.ravel(), rcond=None)[0]
    inertia = turn @ body.inertia @ turn.T
    acceleration = accelerations[0] + np.cross(twist, arm) + np.cross(rate, np.cross(rate, arm))
    return places[0] + arm, acceleration, inertia @ twist + np.cross(rate, inertia @ rate)
