"""Notes on a scene for readers of its results: omissions that may be intended or not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import combinations

from symgen.scene.rods.linkage import TIME, Linkage, RigidLink, SpatialBody
from symgen.scene.schema import Scene
from symgen.scene.units import is_quantity
from symgen.symbolic.quantity import parted

_HERTZ = re.compile(r"\b[kM]?(Hz|hertz)\b")
_NAME = re.compile(r"[^\W\d]\w*")


def remarks(scene: Scene, linkage: Linkage) -> tuple[str, ...]:
    """Return the remarks on a linkage, which the results of its runs repeat as notes."""
    loads = _of_loads(scene, linkage)
    return (*_of_loose_parts(linkage), *_of_hertz(scene), *loads, *_of_reactions(linkage))


def _of_loose_parts(linkage: Linkage) -> Iterator[str]:
    """Yield the parts that nothing joins to the rest; a scene that is one floating part has none."""
    groups = _joined(linkage)
    for group in groups if len(groups) > 1 else ():
        links = [k.name for k in _parts(linkage) if k.base[0] in group]
        if any(linkage.point(p).ground for p in group):
            continue
        subject = f"link {links[0]} is" if len(links) == 1 else f"links {', '.join(links)} are"
        if not links:
            subject = f"the point mass at {', '.join(sorted(group))} is"
        yield f"{subject} joined to nothing else in the scene: no point, guide or spring is shared"


def _parts(linkage: Linkage) -> list[RigidLink | SpatialBody]:
    return [*linkage.links, *linkage.bodies]


def _points(part: RigidLink | SpatialBody) -> set[str]:
    return {*part.base, *(p.name for p in part.carried)}


def _joined(linkage: Linkage) -> list[set[str]]:
    """Return the points in groups that links, guides and springs join; the ground is one of them."""
    of_link = {k.name: _points(k) for k in _parts(linkage)}
    sets = [set(points) for points in of_link.values()]
    sets += [{*guide.points, *of_link[guide.along]} for guide in linkage.guides]
    sets += [set[str]().union(*(of_link[k] for k in (*g.links, g.carrier) if k)) for g in linkage.gears]
    sets += [set[str]().union(*(of_link[k] for k in d.links)) for d in linkage.drivers]
    ground = {p.name for p in linkage.points if p.ground}
    sets += [ground, *({m.point} for m in linkage.masses)]
    for measure in (m for load in linkage.loads for m in load.measures(len(linkage.axes)) if m.joins):
        links = [of_link[name] if name else ground for _, name in measure.links]
        sets.append({p for _, p in measure.points}.union(*links) if all(links) else set())
    group_of: dict[str, set[str]] = {}
    for points in sets:
        parts = [points, *(group_of[p] for p in points if p in group_of)]
        largest = max(parts, key=len)
        for part in parts:
            if part is largest and part is not points:
                continue
            largest |= part
            group_of.update(dict.fromkeys(part, largest))
    return list({id(group): group for group in group_of.values()}.values())


def _of_hertz(scene: Scene) -> Iterator[str]:
    """Yield the angular velocities that are written in Hz and are no multiple of pi."""
    frequencies = {name for name, p in scene.parameters.items() if _HERTZ.search(str(p.value))}
    quantities: list[tuple[str, object]] = [
        (f"drivers.{k}.angle", driver.angle) for k, driver in enumerate(scene.drivers)
    ]
    quantities += [(f"motions.{k}.value", motion.value) for k, motion in enumerate(scene.motions)]
    quantities += [("crank.speed", scene.crank.speed)] if scene.crank else []
    quantities += [(f"start.rates.{name}", rate) for name, rate in scene.start.rates.items()]
    for where, text in quantities:
        names = _words(scene, str(text))
        if "pi" not in names and (names & frequencies or _HERTZ.search(str(text))):
            yield (
                f"{where} has an angular velocity in Hz, which is 1/s: 60 Hz are 60 rad/s; revolutions per "
                "second are written rev/s, or 2*pi*f"
            )


def _words(scene: Scene, text: str) -> set[str]:
    """Return the names in a text, and in the parameters that it uses."""
    words, new = set[str](), {*_NAME.findall(text)}
    while new:
        words |= new
        values = (str(scene.parameters[name].value) for name in new if name in scene.parameters)
        new = {word for value in values if not is_quantity(value) for word in _NAME.findall(value)} - words
    return words


def _of_loads(scene: Scene, linkage: Linkage) -> Iterator[str]:
    """Yield that nothing loads the linkage, unless gravity is written as zero or the motion is prescribed."""
    prescribed = (
        *(k.length for k in linkage.links),
        *(d.angle for d in linkage.drivers),
        *(m.value for m in linkage.motions),
        *(c for p in linkage.points if p.ground for c in p.motion),
    )
    moved = any(TIME.symbol in e.free_symbols for e in prescribed)
    crank = linkage.crank
    turned = crank is not None and (crank.speed != 0 or crank.torque != 0)
    driven = moved or turned or linkage.kinematic
    loaded = any(load.acts for load in linkage.loads)
    if scene.gravity is None and not loaded and not driven:
        yield (
            "the scene has no gravity and no load; a gravity whose acceleration is written as zero says that "
            "none is meant"
        )


def _of_reactions(linkage: Linkage) -> Iterator[str]:
    """Yield the reactions that statics does not determine."""
    ground = {p.name for p in linkage.points if p.ground}
    for body in linkage.bodies:
        grounded = [p for p in body.base if p in ground and not linkage.point(p).hidden]
        if len(grounded) > 1:
            shares = "equal parts" if len(grounded) == 2 else "those of least norm"
            yield (
                f"body {body.name} is held at the ground points {' and '.join(grounded)}: of the reactions "
                f"along the line between them only the sum is determined; {shares} are reported"
            )
    for link in linkage.links:
        if link.mass != 0 and ground.issuperset(link.base):
            yield (
                f"link {link.name} lies between the ground points {link.start} and {link.end}: of the "
                "reactions along it only the sum is determined; parts by the lever rule are given"
            )
    requested = {parted(name)[0] for name in linkage.outputs or ()}
    for a, b in combinations(_parts(linkage) if linkage.dimension == 3 else (), 2):
        shared = sorted(_points(a) & _points(b))
        forces = (f"{part.name}.{p}.force" for part in (a, b) for p in shared)
        if len(shared) > 1 and not ground.issuperset(shared) and any(f in requested for f in forces):
            yield (
                f"links {a.name} and {b.name} share the points {' and '.join(shared)}: of the forces along "
                "the line between them only the sum is determined; those of least norm are reported"
            )
