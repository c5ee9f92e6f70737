"""Joints between the ends of elastic links, and welds: what a scene may join to a link that bends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from symgen.errors import SceneError, check_joints
from symgen.loads.measure import Term
from symgen.scene.elastic.links import ElasticLink
from symgen.scene.reading import Reader
from symgen.scene.rods.linkage import TIME, CarriedPoint, Linkage, RigidLink

_STIFF = "Give it elastic with a large E, or leave it out of the weld."


def with_joints(linkage: Linkage) -> Linkage:
    """Return the linkage with its joints between the ends of elastic links, or of these to rigid bodies.

    Such points have coordinates of their own: the joint moves with the deformed link.

    Raises
    ------
    SceneError
        For a joint at an end, or to a link that keeps its length.
    """
    elastic = {beam.link: beam for beam in linkage.elastic}
    if not elastic:
        return linkage
    named = {k.name: {*k.base, *(c.name for c in k.carried)} for k in linkage.links}
    bent = {p for name in elastic for p in named[name]}
    held = {p for guide in linkage.guides for p in guide.points}
    for _, _, load in linkage.placed_loads:
        terms = load.terms(linkage.dimension)
        others = [t for t in terms if not any(carries(linkage.link(k), t) for k in elastic)]
        held |= {p for term in others for _, p in term.on.points}

    def joined(link: RigidLink, point: CarriedPoint) -> bool:
        others = any(point.name in named[name] for name in named if name != link.name)
        return (others or point.name in held) if link.name in elastic else point.name in bent

    links = []
    for link in linkage.links:
        carried = tuple(replace(c, joined=joined(link, c)) for c in link.carried)
        if link.name in elastic:
            _check_joints(linkage, link, elastic[link.name], [c for c in carried if c.joined])
        links.append(replace(link, carried=carried))
    return replace(linkage, links=tuple(links))


def _check_joints(
    linkage: Linkage, link: RigidLink, beam: ElasticLink, joints: Sequence[CarriedPoint]
) -> None:
    for joint in joints:
        if not beam.axial:
            raise SceneError(
                f"{joint.name} joins a component to {link.name}, which keeps its length, between its ends",
                where=f"points.{joint.name}.fraction",
                hint=f"Leave axial = false out of links.{link.name}.elastic.",
            )
    check_joints(link.name, link.base, [(c.name, linkage.number(c.along)) for c in joints])


def check_welds(read: Reader, linkage: Linkage) -> None:
    """Check that welds hold elastic links at points of theirs, in a linkage whose rigid motion is at rest."""
    elastic = {beam.link: linkage.link(beam.link) for beam in linkage.elastic}
    for i, weld in enumerate(read.scene.welds):
        where = f"welds.{i}"
        ground = read.known_point(weld.point, f"{where}.point").ground
        if sum(other.point == weld.point for other in read.scene.welds) > 1:
            raise SceneError(f"{weld.point} has two welds", where=f"{where}.point", hint="Write them as one.")
        if len(weld.links) < (1 if ground else 2):
            raise SceneError(
                f"expected two links or more to be welded at {weld.point}, got {len(weld.links)}",
                where=f"{where}.links",
            )
        if len(set(weld.links)) < len(weld.links):
            raise SceneError(
                f"a link is named twice among those welded at {weld.point}: {', '.join(weld.links)}",
                where=f"{where}.links",
                hint="Name each link once.",
            )
        for name in weld.links:
            read.known_link(name, f"{where}.links")
            if name not in elastic:
                raise SceneError(
                    f"{name} is rigid, and welds hold elastic links", where=f"{where}.links", hint=_STIFF
                )
            link = elastic[name]
            if weld.point not in (*link.base, *(c.name for c in link.carried if c.joined)):
                raise SceneError(f"{weld.point} is no joint of {name}", where=f"{where}.point")
    crank = linkage.crank
    rates = [c for p in linkage.points if p.ground for c in p.motion]
    rates += [driver.angle for driver in linkage.drivers]
    moved = any(TIME.symbol in e.free_symbols for e in rates) or (crank is not None and crank.mode == "motor")
    if read.scene.welds and moved:
        raise SceneError(
            "welds hold links at the angles at which they are drawn, and the rigid motion changes these",
            where="welds",
            hint='Write mode = "held" and speed = "0 rpm" in [crank]: welds are for frames at rest.',
        )


def carries(link: RigidLink, term: Term) -> bool:
    """Return whether a term is a force along an elastic link."""
    places = {c.name: c.along * link.length for c in link.carried if not c.joined}
    return any(term.on.along(link.name, link.length, places, term.total))
