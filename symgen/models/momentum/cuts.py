"""Joints of a linkage that the user cuts: there a link has a particle of its own, and a constraint joins it.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, section 2.3, Fig. 3, and section 3, Fig. 4b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import sympy as sp

from symgen.errors import ModelError, check_known
from symgen.mechanics.rods.momentum import OpenTree, on_loop
from symgen.models.rods.linkage import RodsModel
from symgen.scene.rods.linkage import Linkage, RigidLink


class Cut(NamedTuple):
    """A link cut from a point; ``own`` is the name of its particle there."""

    link: str
    point: str
    own: str

    @property
    def name(self) -> str:
        """The joint as the user writes it."""
        return f"{self.link}.{self.point}"


def cut_linkage(whole: RodsModel, joints: Sequence[str]) -> tuple[Linkage, tuple[Cut, ...]]:
    """Return a linkage with joints ``LINK.POINT`` cut, and the cuts.

    Raises
    ------
    ModelError
        For a joint that does not exist or is on no loop, and for a point without links.
    """
    linkage, names, cuts = whole.linkage, whole.points, list[Cut]()
    if linkage.bodies:  # their momentum rows are refused
        return linkage, ()
    bodies = {k.name: (*k.base, *(c.name for c in k.carried)) for k in whole.rods}
    ground = [p for p in names if whole.is_fixed(p)]
    for joint in joints:
        link, dot, point = (x.strip() for x in joint.partition("."))
        if not dot:
            raise ModelError(f"expected LINK.POINT for a cut, such as {_example(bodies)}, got {joint!r}")
        check_known(link, bodies, f"cut {joint}: {linkage.name} has no moving link")
        check_known(point, bodies[link], f"cut {joint}: link {link} has no point")
        if any((c.link, c.point) == (link, point) for c in cuts):
            raise ModelError(f"cut {joint} is given twice")
        if not on_loop(ground, bodies, link, point):
            raise ModelError(
                f"cut {joint}: this joint is on no loop: the cut would only separate {link}\n"
                "  symgen explain lists the loops; leave this cut out."
            )
        own = f"{link}_{point}"
        while own in names:
            own += "_"
        names.append(own)
        cuts.append(Cut(link, point, own))
    for point in dict.fromkeys(c.point for c in cuts):
        there = [name for name, points in bodies.items() if point in points]
        if point not in ground and len(there) == sum(c.point == point for c in cuts):
            raise ModelError(
                f"all links are cut from {point}: {', '.join(f'{name}.{point}' for name in there)}\n"
                "  Leave one of these cuts out."
            )
    return _opened(linkage, cuts), tuple(cuts)


def check_open(tree: OpenTree, cuts: Sequence[Cut]) -> None:
    """Raise ModelError where cuts leave a loop."""
    if cuts and tree.cuts:
        body, point = tree.cuts[0]
        given = ",".join([*(c.name for c in cuts), f"{body}.{point}"])
        raise ModelError(
            f"the cuts leave {len(tree.cuts)} {'loop' if len(tree.cuts) == 1 else 'loops'}\n"
            f"  Cut one more joint, such as {body}.{point}: --cut {given}"
        )


def closed(cut: RodsModel, cuts: Sequence[Cut], whole: RodsModel) -> dict[sp.Symbol, sp.Expr]:
    """Return coordinates and velocities of the cut linkage by those of the whole one."""
    values: dict[sp.Symbol, sp.Expr] = {}
    for definition in whole.calculus.definitions:
        values[definition.quantity.symbol] = definition.expression.xreplace(values)
    joint = {c.own: c.point for c in cuts}
    known: dict[sp.Symbol, sp.Expr] = {}
    for point in cut.free:
        place = joint.get(point, point)
        if place != point or point not in whole.free:
            for group, vector in ((cut.q, whole.position(place)), (cut.u, whole.velocity(place))):
                expressions = (c.xreplace(values).xreplace(whole.held) for c in vector)
                known.update(zip(cut.symbols(group[point]), expressions, strict=True))
    return known


def _opened(linkage: Linkage, cuts: Sequence[Cut]) -> Linkage:
    """Return the linkage with points added for the particles of cut links."""

    def opened(link: RigidLink) -> RigidLink:
        own = {c.point: c.own for c in cuts if c.link == link.name}
        carried = tuple(
            replace(c, name=own[c.name], joined=False) if c.name in own else c for c in link.carried
        )
        start, end = (own.get(p, p) for p in link.base)
        return replace(link, start=start, end=end, carried=carried)

    added = []
    for cut in cuts:
        drawn = linkage.point(cut.point)
        added.append(replace(drawn, name=cut.own, ground=False, motion=drawn.at))
    links = tuple(opened(link) for link in linkage.links)
    return replace(linkage, points=(*linkage.points, *added), links=links)


def _example(bodies: dict[str, tuple[str, ...]]) -> str:
    return next((f"{link}.{points[-1]}" for link, points in bodies.items()), "rocker.B")
