"""A mechanism in a pose: lines and points in space for ``report.drawing``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from symgen.joints import JOINTS
from symgen.report.page.drawing import DrawnLine, Node, Sketch
from symgen.runtime.loop.frames import product
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.result.result import Result
from symgen.scene.elastic.offsets import is_lug
from symgen.scene.loop.loop import Loop
from symgen.scene.rods.linkage import TIME, CarriedPoint, Linkage, RigidLink
from symgen.scene.rods.rotations import GearPair

Array = NDArray[np.float64]
#: Parts of an elastic link between the places where its deflection is drawn.
_PARTS = 16
#: Largest deflection drawn, over the size of the mechanism.
SEEN = 0.08
#: Magnification beyond which deflections are round-off.
_ROUND_OFF = 1e9
#: Drawn length of a joint axis relative to the size of the loop.
_AXIS = 0.09
#: The freedoms of a joint that has no axis.
_BALL = ("theta", "eta", "alpha")
#: A relative length that defines a direction but is invisible in the picture.
_LITTLE = 1e-3
#: Points of a drawn circle.
_CIRCLE = 49


def linkage_sketch(linkage: Linkage, places: dict[str, Array], result: Result | None) -> Sketch:
    """Return a linkage with its points in places [m], and their paths in a run, if there is one."""
    linkage = linkage.as_written
    hidden, fixed = {p.name for p in linkage.points if p.hidden}, _fixed(linkage)
    joints = [name for k in linkage.links for name in (k.start, k.end, *(p.name for p in k.carried))]
    joints += [name for body in linkage.bodies for name in (*body.base, *(p.name for p in body.carried))]
    nodes = tuple(
        Node(
            p.name,
            places[p.name],
            "hidden"
            if p.hidden
            else "ground"
            if p.name in fixed
            else "joint"
            if joints.count(p.name) != 1
            else "end",
        )
        for p in linkage.points
    )
    paths = [
        DrawnLine("path", "", variable.values)
        for p in linkage.points
        if p.name not in hidden and result is not None and f"{p.name}.position" in result
        for variable in [result.variable(f"{p.name}.position")]
    ]
    gravity = np.array([linkage.number(g) for g in linkage.gravity])
    return Sketch(nodes, (*paths, *_bars(linkage, places)), gravity, "m")


def _fixed(linkage: Linkage) -> set[str]:
    """Return the points of the ground that do not move."""
    ground = [p for p in linkage.points if p.ground and not p.hidden]
    return {p.name for p in ground if not any(TIME.symbol in c.free_symbols for c in p.motion)}


def _bars(linkage: Linkage, places: dict[str, Array]) -> Iterator[DrawnLine]:
    fixed = _fixed(linkage)
    elastic = {e.link for e in linkage.elastic}
    for k in linkage.links:
        ends = [places[k.start], places[k.end]]
        if {k.start, k.end} <= fixed:
            yield DrawnLine("rail", "", np.array(ends))
        elif k.carried and k.name not in elastic:
            yield DrawnLine("body", k.name, np.array([*ends, *(places[p.name] for p in k.carried)]))
        else:
            kind, name = ("elastic" if k.name in elastic else "rod"), ("" if is_lug(k) else k.name)
            yield DrawnLine(kind, name, np.array(ends))
    for body in linkage.bodies:
        yield DrawnLine(
            "body", body.name, np.array([places[p] for p in (*body.base, *(c.name for c in body.carried))])
        )
    for load in linkage.loads:
        for measure in load.measures(len(linkage.axes)):
            if len(measure.points) == 2:
                yield DrawnLine(load.drawn, "", np.array([places[name] for _, name in measure.points]))
    for pair in linkage.gears:
        yield from _pitch_circles(linkage, pair, places)
    for guide in linkage.guides:
        along = linkage.link(guide.along)
        d = places[along.end] - places[along.start]
        for point in guide.points:
            yield DrawnLine("slider", "", np.array([places[point], places[point] + _LITTLE * d]))


def _pitch_circles(linkage: Linkage, pair: GearPair, places: dict[str, Array]) -> Iterator[DrawnLine]:
    """Yield the circles on which gears roll; none for links without an axis on their carrier."""
    ground = {p.name for p in linkage.points if p.ground}
    held = {*_on(linkage.link(pair.carrier))} if pair.carrier else ground
    centres = [next((p for p in _on(linkage.link(k)) if p in held), None) for k in pair.links]
    if None in centres:
        return
    first, second = (places[p] for p in centres if p)
    angles = np.linspace(0.0, 2.0 * np.pi, _CIRCLE)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for centre, teeth in zip((first, second), pair.teeth, strict=True):
        radius = np.linalg.norm(second - first) * abs(teeth) / abs(sum(pair.teeth))
        yield DrawnLine(
            "axis", "", np.hstack([centre[:2] + radius * circle, np.zeros((_CIRCLE, 1))])[:, : len(centre)]
        )


def _on(link: RigidLink) -> tuple[str, ...]:
    return (*link.base, *(c.name for c in link.carried))


def stations_of(linkage: Linkage) -> list[dict[str, object]]:
    """Return tables of stations along the elastic links, at which their deflections are drawn."""
    return [
        {"name": f"{e.link}__{k}", "link": e.link, "at": k / _PARTS}
        for e in linkage.elastic
        for k in range(1, _PARTS)
    ]


def bent_outputs(linkage: Linkage) -> list[str]:
    """Return the outputs of a run of elastic links from which its deformed shape follows."""
    words = ("position", "displacement") if linkage.dimension == 2 else ("position",)
    points = [f"{p}.{word}" for p in _moving(linkage) for word in words]
    return points + [f"{station['name']}.deflection" for station in stations_of(linkage)]


def deflected(linkage: Linkage, result: Result) -> bool:
    """Return whether a result has the deflections of the elastic links."""
    return all(name in result for name in bent_outputs(linkage))


def magnification(linkage: Linkage, result: Result) -> float:
    """Return the magnification of deflections: 1, 2 or 5 times a power of ten, at least 1.

    The largest then has a part ``SEEN`` of the size of the mechanism or less.
    """
    displacements = {name: result.variable(name).values for name in bent_outputs(linkage)}
    ground = [
        [[linkage.number(x) for x in p.at]] for p in linkage.as_written.points if p.ground and not p.hidden
    ]
    places = np.vstack([*ground, *(x for name, x in displacements.items() if name.endswith(".position"))])
    others = [x for name, x in displacements.items() if not name.endswith(".position")]
    largest = max(float(np.max(np.abs(x), initial=0.0)) for x in others)
    exact = SEEN * float(np.max(np.ptp(places, axis=0))) / max(largest, 1e-300)
    if not 1.0 < exact < _ROUND_OFF:
        return 1.0
    power = 10.0 ** np.floor(np.log10(exact))
    return float(max(m * power for m in (1.0, 2.0, 5.0) if m * power <= exact * (1 + 1e-9)))


def bent_sketches(linkage: Linkage, start: Mapping[str, Array], result: Result) -> list[Sketch]:
    """Return a linkage at every sample of a run, with magnified deflections about its rigid motion.

    In space they are those from the lines between the ends of links. Points of the ground without a motion
    stay where they are at the ``start`` [m].
    """
    drawn = {name: result.variable(name).values for name in bent_outputs(linkage)}
    rigid = {name: np.tile(at, (result.count, 1)) for name, at in start.items()}
    rigid |= _rigid(linkage, drawn)
    for e in linkage.elastic if linkage.dimension == 2 else ():
        along = rigid[linkage.link(e.link).end] - rigid[linkage.link(e.link).start]
        left = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        for k in range(1, _PARTS):
            drawn[f"{e.link}__{k}.deflection"] = drawn[f"{e.link}__{k}.deflection"][:, None] * left
    times = magnification(linkage, result)
    return [
        bent_sketch(linkage, start, {name: x[k] for name, x in drawn.items()}, times)
        for k in range(result.count)
    ]


def _rigid(linkage: Linkage, drawn: Mapping[str, Array]) -> dict[str, Array]:
    """Return the places of moving points in the rigid motion [m]."""
    return {p: drawn[f"{p}.position"] - drawn.get(f"{p}.displacement", 0.0) for p in _moving(linkage)}


def _moving(linkage: Linkage) -> list[str]:
    """Return the points of which runs have positions: those that move and have coordinates.

    In the plane the ground of linkages with elastic links does not move.
    """
    others = {*_fixed(linkage), *_followed(linkage)}
    return [p.name for p in linkage.as_written.points if p.name not in others]


def _followed(linkage: Linkage) -> dict[str, tuple[RigidLink, CarriedPoint]]:
    """Return the points in the plane that their links carry without coordinates, with these links."""
    links = linkage.links if linkage.dimension == 2 else ()
    return {c.name: (k, c) for k in links for c in k.carried if not c.joined}


def bent_sketch(
    linkage: Linkage, start: Mapping[str, Array], drawn: Mapping[str, Array], times: float
) -> Sketch:
    """Return a linkage with deflections magnified so many times, in the pose of its ``bent_outputs``.

    Deflections are vectors [m]. Ground points stay where they are at the ``start`` [m]. All places are linear
    in the outputs.
    """
    rigid = {**start, **_rigid(linkage, drawn)}
    bent = {p: at + times * drawn.get(f"{p}.displacement", 0.0) for p, at in rigid.items()}
    shares = np.linspace(0.0, 1.0, _PARTS + 1)[:, None]
    curves, straight = {}, []
    for e in linkage.elastic:
        link = linkage.link(e.link)
        off = np.array([drawn[f"{e.link}__{k}.deflection"] for k in range(1, _PARTS)])
        curve = (1 - shares) * bent[link.start] + shares * bent[link.end]
        curves[e.link] = curve + times * np.pad(off, ((1, 1), (0, 0)))
        straight.append(DrawnLine("rail", "", np.array([rigid[link.start], rigid[link.end]])))
    followed = _followed(linkage)

    def place(point: str) -> Array:
        if point in followed:
            link, carried = followed.pop(point)
            along, across = linkage.number(carried.along), linkage.number(carried.across)
            if link.name in curves:
                bent[point] = np.array([np.interp(along, shares[:, 0], x) for x in curves[link.name].T])
            else:
                first, second = place(link.start), place(link.end)
                d = second - first
                bent[point] = first + along * d + across * np.array([-d[1], d[0]])
        return bent[point]

    for point in [*followed]:
        place(point)
    sketch = linkage_sketch(linkage, bent, None)
    lines = [replace(s, at=curves[s.name]) if s.kind == "elastic" else s for s in sketch.lines]
    return replace(sketch, lines=(*straight, *lines))


def drawn_of_loop(loop: Loop) -> list[str]:
    """Return the outputs from which a pose follows: of each joint, its place on both links, and its axis."""
    links = _links(loop)
    return [
        name
        for k in range(1, len(links))
        for name in (
            f"{links[k - 1]}.joint{k}.position",
            f"{links[k]}.joint{k}.position",
            f"{links[k]}.joint{k}.axis",
        )
    ]


def pose_of_loop(loop: Loop, model: LoopModel, t: float, q: Array) -> dict[str, Array]:
    """Return the outputs of :func:`drawn_of_loop` at a time [s] and joint variables, for any model."""
    table = model.kernels("rows", t, q, np.zeros_like(q))["rows"]
    frame, positions = np.eye(4), []
    for entries in table:
        foot, k = frame[:3, 3], frame[:3, 2]
        positions += [foot, foot + entries[1] * k, k]
        frame = frame @ product([entries])
    return dict(zip(drawn_of_loop(loop), positions, strict=True))


def loop_sketch(loop: Loop, drawn: Mapping[str, Array]) -> Sketch:
    """Return the links between their joint axes, in the first frame, from the outputs of a pose."""
    links, size, lines, nodes = _links(loop), loop.size, [], []
    last = len(loop.rows)
    spherical = all(row.a == 0 and row.S == 0 for row in loop.rows)
    for i, row in enumerate(loop.rows, 1):
        foot, head, k = (
            drawn[f"{links[j]}.joint{i}.{word}"]
            for j, word in ((i - 1, "position"), (i, "position"), (i, "axis"))
        )
        at, behind = head, drawn[f"{links[i]}.joint{i % last + 1}.position"]
        lines.append(DrawnLine("axis", "", np.array([foot, head])))
        varies = JOINTS[row.joint].varies
        if varies == ("S",):
            lines.append(DrawnLine("slider", "", np.array([foot, foot + _LITTLE * size * k])))
        if varies != _BALL:
            lines.append(DrawnLine("axis", "", np.array([head - _AXIS * size * k, head + _AXIS * size * k])))
        kind = "rail" if i == last else "rod"
        if spherical and i < last:  # its links have no length: plates between the ends of their axes
            next_k = drawn[f"{links[i + 1]}.joint{i + 1}.axis"]
            kind, head, behind = "body", head + _AXIS * size * k, behind + _AXIS * size * next_k
        ends = [head, behind, foot] if kind == "body" else [head, behind]
        lines.append(DrawnLine(kind, row.link, np.array(ends)))
        nodes.append(Node(f"{row.joint}{i}", at, "ground" if i in (1, last) else "joint"))
    gravity = np.array([loop.number(g) for g in loop.gravity])
    return Sketch(tuple(nodes), tuple(lines), gravity, "m")


def _links(loop: Loop) -> list[str]:
    """Return the links along the loop, from the ground to the ground."""
    links = [row.link for row in loop.rows]
    return [links[-1], *links]
