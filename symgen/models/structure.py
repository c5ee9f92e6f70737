"""Topology of a linkage in words: the spanning tree, the loops that are cut, omitted components."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.errors import SceneError
from symgen.loads import LOADS
from symgen.models.rods.driven import LEFT_OUT
from symgen.models.rods.linkage import RodsModel
from symgen.scene.elastic.offsets import is_lug
from symgen.scene.rods.linkage import Linkage

#: Components of a linkage by their field: before the loads, and after them.
_MASSES = {
    "bodies": "bodies in space",
    "gravity": "gravity",
    "masses": "point masses",
}
_OTHERS = {
    "guides": "guides",
    "gears": "gears",
    "drivers": "drives",
    "motions": "prescribed motions",
    "elastic": "elastic links",
    "events": "events",
}


def structure(linkage: Linkage) -> Iterator[str]:
    """Yield the structure of a linkage line by line.

    Raises
    ------
    SceneError
        When a point carries no mass.
    """
    try:
        model = RodsModel(linkage)
        if not linkage.kinematic:
            model.check_masses()
    except SceneError as error:
        raise error.located(file=linkage.file) from None
    yield f"ground: {', '.join(model.ground) or 'none, the linkage floats'}"
    ends = {k.name: k.base for k in model.rods}
    bars = {row.link: row.label for row in model.constraints if row.link and row.link not in ends}
    yield "tree, from the ground outward:"
    joined = dict(_off_the_line(linkage))
    yield from (f"  {point} is rigidly joined to link {link}, off its line" for point, link in joined.items())
    for point in model.tree.points:
        rod = model.tree.carrier[point]
        if point in joined or (joined and linkage.point(point).hidden):
            continue
        if rod is None:
            yield f"  {point} is free to move: a part that no link ties to the ground starts here"
        elif rod in bars:
            yield f"  {point} after {bars[rod].removeprefix('the shape of ')}"
        else:
            near = next(e for e in ends[rod] if e != point)
            yield f"  {point} after link {rod} from {near}"
    carried = {point: part.name for point, (part, _) in model.carrier.items() if point not in joined}
    yield from (f"  {p} is carried by link {name}: no coordinates of its own" for p, name in carried.items())
    cuts = list(dict.fromkeys(_cut(model, rod, bars) for rod in model.tree.cuts))
    yield f"loops: {len(cuts)}, closed by these links" if cuts else "loops: none is closed by a link"
    yield from (f"  {cut}" for cut in cuts)
    labels = dict.fromkeys(row.label for row in model.constraints if not row.link)
    if labels:
        yield "further constraints:"
        yield from (f"  {label}" for label in labels)
    if model.idle:
        yield "omitted: " + ", ".join(f"link {name} lies between fixed points" for name in model.idle)
    if linkage.kinematic:
        yield f"omitted: {LEFT_OUT}"
    if linkage.plane:
        yield (
            f"omitted: motion across the plane {linkage.plane}, for all points, loads and starts lie in it; "
            "equilibria and modes have it"
        )
    elif linkage.leaves_plane:
        yield f"derived in space: {linkage.leaves_plane}"
    absent = [phrase for field, phrase in _MASSES.items() if not any(getattr(linkage, field))]
    given = {type(load) for load in linkage.loads}
    absent += [k.plural for k in LOADS.values() if k.acts and k not in given]
    absent += [phrase for field, phrase in _OTHERS.items() if not getattr(linkage, field)]
    if linkage.as_written.dimension == 2:
        absent.insert(0, "the third axis")
    if not any(x.offset for x in linkage.links) and linkage.links:
        absent.append("centres of mass off the lines of the links")
    yield f"omitted, since the scene has none: {', '.join(absent)}"


def _off_the_line(linkage: Linkage) -> Iterator[tuple[str, str]]:
    """Yield the points off the line of elastic links, and these links."""
    for lug in filter(is_lug, linkage.links if linkage.elastic else ()):
        elastic = (linkage.link(e.link) for e in linkage.elastic)
        link = next(k.name for k in elastic if lug.start in (*k.base, *(c.name for c in k.carried)))
        yield from ((point, link) for point in (lug.end, *(c.name for c in lug.carried)))


def _cut(model: RodsModel, rod: str, bars: dict[str, str]) -> str:
    """Return the name of a closing rod with its ends, or of a closing distance inside a body."""
    if rod in bars:
        return f"{bars[rod].removeprefix('the shape of ')}, cut between its points"
    link = model.linkage.link(rod)
    return f"link {rod}, cut between {link.start} and {link.end}"
