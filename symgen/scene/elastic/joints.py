"""Joints between the ends of elastic links, and welds: components that may be joined to an elastic link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import sympy as sp

from symgen.errors import SceneError, check_joints
from symgen.loads.measure import LoadTerm, Measure
from symgen.scene.elastic.links import ElasticLink
from symgen.scene.elastic.offsets import is_lug
from symgen.scene.elastic.schema import Weld
from symgen.scene.faults import JOINED
from symgen.scene.reading import Reader
from symgen.scene.rods.constraints import is_hinge
from symgen.scene.rods.linkage import CarriedPoint, Linkage, RigidLink, WeldedAngle


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
    constrained = {p for guide in linkage.guides for p in guide.points}
    for _, _, load in linkage.placed_loads:
        terms = load.terms(linkage.dimension)
        others = [t for t in terms if not any(carries(linkage.link(k), t) for k in elastic)]
        constrained |= {p for term in others for _, p in term.on.points}

    def joined(link: RigidLink, point: CarriedPoint) -> bool:
        others = any(point.name in named[name] for name in named if name != link.name)
        # In space every point of an elastic link is at a node.
        is_joint = others or point.name in constrained or linkage.dimension == 3
        return is_joint if link.name in elastic else point.name in bent

    links = []
    for link in linkage.links:
        carried = tuple(replace(c, joined=joined(link, c)) for c in link.carried)
        if link.name in elastic:
            _check_joints(linkage, link, elastic[link.name], [c for c in carried if c.joined])
        links.append(replace(link, carried=carried))
    bodies = tuple(
        replace(body, carried=tuple(replace(c, joined=c.name in bent) for c in body.carried))
        for body in linkage.bodies
    )
    return replace(linkage, links=tuple(links), bodies=bodies)


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


def with_welds(read: Reader, linkage: Linkage) -> Linkage:
    """Return the linkage with the angles that its welds keep.

    Raises
    ------
    SceneError
        For welds of links that do not meet there, and of several rigid links.
    """
    for i, joint in enumerate(read.scene.joints):
        if read.dimension == 3 and is_hinge(read.scene, joint):
            continue
        raise SceneError(
            "expected a joint of an elastic link, or a revolute joint of a rigid link with the ground, both "
            f"in space; got a {joint.kind} joint of {' and '.join(joint.links)} at {joint.point}",
            where=f"joints.{i}",
            hint=f"{JOINED} A universal joint of two bodies is a common point, and a massless rod that keeps "
            "the distance of a point of each.",
        )
    angles: list[WeldedAngle] = []
    for i, weld in enumerate(read.scene.welds):
        where = f"welds.{i}"
        _check_weld(read, linkage, weld, where)
        elastic = [name for name in weld.links if any(name == beam.link for beam in linkage.elastic)]
        rigid = [name for name in weld.links if name not in elastic]
        if linkage.point(weld.point).ground:
            pairs = [(name, "") for name in elastic]
        else:
            first, *others = (*rigid, *elastic)
            pairs = [(name, first) for name in others]
        angles += [_welded_angle(linkage, weld.point, *pair) for pair in pairs]
    return replace(linkage, welded_angles=tuple(angles))


def _check_weld(read: Reader, linkage: Linkage, weld: Weld, where: str) -> None:
    """Check that a weld holds links that meet at its point, one of them rigid at most."""
    elastic = {beam.link for beam in linkage.elastic}
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
        link = linkage.link(name)
        carried = [c.name for c in link.carried if c.joined or name not in elastic]
        read.known_joint(weld.point, name, (*link.base, *carried), f"{where}.point")
    rigid = [name for name in weld.links if name not in elastic]
    fixed = [name for name in rigid if all(linkage.point(p).ground for p in linkage.link(name).base)]
    if fixed or (rigid and ground):
        raise SceneError(
            f"{(fixed or rigid)[0]} is rigid, and {weld.point} is welded to the ground",
            where=f"{where}.links",
            hint="Weld elastic links alone at a ground point, and links that move elsewhere.",
        )
    if len(rigid) > 1 or len(rigid) == len(weld.links):
        raise SceneError(
            f"{' and '.join(rigid)} are rigid, and welds hold elastic links and one rigid link at most",
            where=f"{where}.links",
            hint="Write rigid links that are welded as one body, a link with more than two points.",
        )


def _welded_angle(linkage: Linkage, point: str, link: str, other: str) -> WeldedAngle:
    """Return the drawn angle between two links, or between a link and the x axis."""
    (ax, ay), (bx, by) = (_drawn(linkage, name) if name else (sp.S.One, sp.S.Zero) for name in (link, other))
    size = sp.sqrt((ax**2 + ay**2) * (bx**2 + by**2))
    cosine, sine = (ax * bx + ay * by) / size, (bx * ay - by * ax) / size
    label = f"the weld of {link} to {other or 'the ground'} at {point}"
    lugs = (k for k in linkage.links if k.name in (link, other) and is_lug(k))
    label = next((f"the rigid joint of {k.end}" for k in lugs), label)
    return WeldedAngle(f"{point}_weld_{link}", label, point, link, other, cosine, sine)


def _drawn(linkage: Linkage, name: str) -> tuple[sp.Expr, sp.Expr]:
    start, end = (linkage.point(p).at for p in linkage.link(name).base)
    return end[0] - start[0], end[1] - start[1]


def places_along(link: RigidLink, on: Measure) -> dict[str, sp.Expr]:
    """Return the points [m] of a link at which a force acts along it; a follower force may act at joints."""
    ends = {link.start: sp.S.Zero, link.end: link.length} if on.follows == link.name else {}
    carried = {c.name: c.along * link.length for c in link.carried if ends or not c.joined}
    return ends | carried


def carries(link: RigidLink, term: LoadTerm) -> bool:
    """Return whether a term is a force along an elastic link."""
    return any(term.on.along(link.name, link.length, places_along(link, term.on), term.total))
