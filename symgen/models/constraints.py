"""The constraint rows of a linkage: one function for each way in which points are bound."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy as sp

from symgen.mechanics.loads import vector_between
from symgen.mechanics.particles import Vector, cross, dot, length_constraint
from symgen.models.loads import product
from symgen.models.points import bar_name

if TYPE_CHECKING:
    from symgen.models.rods import RodsModel
    from symgen.scene.linkage import RigidLink

_ZERO, _ONE = sp.Integer(0), sp.Integer(1)


@dataclass(frozen=True, slots=True)
class Constraint:
    """One row Phi = 0.

    ``expression`` over ``scale`` is an error in metres; ``unit`` is the unit of the expression, ``label``
    what it is called in messages, and ``link`` the rod, or the bar of a body, whose length it is.
    """

    name: str
    label: str
    expression: sp.Expr
    scale: sp.Expr
    unit: str
    link: str = ""

    @property
    def multiplier_unit(self) -> str:
        """Unit of the Lagrange multiplier: force times length over the constraint's unit."""
        return {"m^2": "N/m", "m": "N"}[self.unit]


def constraints(model: RodsModel) -> list[Constraint]:
    """Return every constraint row: rod lengths first, in the order of the links."""
    return [*_lengths(model), *_shapes(model), *_shared_joints(model), *_guides(model), *_drivers(model)]


def _lengths(model: RodsModel) -> Iterator[Constraint]:
    """(d.d - l^2)/2, Eq. (3a) halved."""
    for rod in model.rods:
        expression = length_constraint(model.along[rod.name], rod.length)
        yield Constraint(rod.name, f"the length of link {rod.name}", expression, rod.length, "m^2", rod.name)


def _shapes(model: RodsModel) -> Iterator[Constraint]:
    """(d.d - l^2)/2 between the base points of a body in space."""
    for body in model.linkage.bodies:
        for bar in body.bars:
            start, end = (model.position(p) for p in (bar.start, bar.end))
            name, label = bar_name(body, bar.start, bar.end), f"the shape of link {body.name}"
            along = vector_between(model.calculus, name, start, end, model.axes)
            yield Constraint(name, label, length_constraint(along, bar.length), bar.length, "m^2", name)


def _shared_joints(model: RodsModel) -> Iterator[Constraint]:
    """r_p = (1 - z) r_i + z r_j where the point p of a link already has a place of its own."""
    free = {q.symbol for q in model.coordinates}
    for link, point in model.shared:
        carried = model.carried_position(link, point)
        for axis, own, other in zip(model.axes, model.position(point.name), carried, strict=True):
            name = f"{link.name}_{point.name}_{axis}"
            if not free & model.calculus.gradient(own - other).keys():
                continue  # ground on ground: the row binds nothing that can move
            yield Constraint(name, f"the joint {point.name} of link {link.name}", own - other, _ONE, "m")


def _guides(model: RodsModel) -> Iterator[Constraint]:
    return (row.constraint for row in guide_rows(model))


@dataclass(frozen=True, slots=True)
class GuideRow:
    """A row of a guide, with its derivatives by the vector along the link and by the guided point."""

    constraint: Constraint
    link: str
    point: str
    by_along: Vector
    by_point: Vector


def guide_rows(model: RodsModel) -> Iterator[GuideRow]:
    """(r_p - r_a) x d = 0, Eq. (16b): a point stays on the line of a link."""
    for guide in model.linkage.guides:
        link = model.linkage.link(guide.along)
        d = model.along[link.name]
        start = model.position(link.start)
        for point in guide.points:
            there = tuple(b - a for a, b in zip(start, model.position(point), strict=True))
            label = f"the guide of {point} along {link.name}"
            if len(d) == 2:
                row = Constraint(f"{guide.name}_{point}", label, cross(d, there), link.length, "m^2")
                yield GuideRow(row, link.name, point, (there[1], -there[0]), (-d[1], d[0]))
                continue
            if not _keeps_direction(model, link.start, link.end):
                for i, (row, by_along, by_point) in enumerate(_along_a_turning_rod(model, link, there), 1):
                    name = f"{guide.name}_{point}_{i}"
                    scale = sp.sqrt(dot(by_point, by_point))
                    bound = Constraint(name, label, row, scale, "m^2")
                    yield GuideRow(bound, link.name, point, by_along, by_point)
                continue
            for i in _kept_components(model, link.start, link.end):
                j, k = (i + 1) % 3, (i + 2) % 3
                name = f"{guide.name}_{point}_{model.axes[i]}"
                row = Constraint(name, label, d[j] * there[k] - d[k] * there[j], link.length, "m^2")
                by_d, by_r = [_ZERO] * 3, [_ZERO] * 3
                by_d[j], by_d[k], by_r[k], by_r[j] = there[k], -there[j], d[j], -d[k]
                yield GuideRow(row, link.name, point, tuple(by_d), tuple(by_r))


#: Directions of which the one most across a rod as it is drawn is kept: oblique to all axes, since a rod that
#: comes to point along it would let go of what it guides.
_OBLIQUE = tuple(
    tuple(sp.Rational(c, 25) for c in components)
    for components in ((9, 12, 20), (20, -9, 12), (-12, 20, 9), (12, 20, -9))
)


def _keeps_direction(model: RodsModel, start: str, end: str) -> bool:
    """Tell whether a link between ground points keeps its direction."""
    points = [model.linkage.point(p) for p in (start, end)]
    moved = [tuple(b - a for a, b in zip(p.at, p.motion, strict=True)) for p in points if p.ground]
    return len(moved) == 2 and moved[0] == moved[1]


def _along_a_turning_rod(
    model: RodsModel, link: RigidLink, there: Vector
) -> Iterator[tuple[sp.Expr, Vector, Vector]]:
    """Yield r x d = 0 across d in two directions that turn with d, and derivatives by d and by r.

    Two fixed components of the product would lose one whenever the rod comes across an axis; (d x c) . r and
    ((d x c) x d) . r / l with a constant c lose them only where d is along c.
    """
    d, r = model.along[link.name], there
    ends = (model.linkage.point(p).at for p in (link.start, link.end))
    drawn = [b - a for a, b in zip(*ends, strict=True)]
    c = min(_OBLIQUE, key=lambda x: abs(model.linkage.number(dot(tuple(drawn), x))))
    squared, dc, dr, cr = dot(d, d), dot(d, c), dot(d, r), dot(c, r)
    across = product(d, c)
    yield dot(across, r), product(c, r), across
    upright = tuple((squared * x - dc * y) / link.length for x, y in zip(c, d, strict=True))
    by_d = tuple((2 * cr * y - dc * z - dr * x) / link.length for x, y, z in zip(c, d, r, strict=True))
    yield dot(upright, r), by_d, upright


def _kept_components(model: RodsModel, start: str, end: str) -> list[int]:
    """Return the two components of a cross product that are independent where the link is drawn."""
    ends = (model.linkage.point(p).at for p in (start, end))
    drawn = [abs(model.linkage.number(b - a)) for a, b in zip(*ends, strict=True)]
    return [i for i in range(3) if i != drawn.index(max(drawn))]


def _drivers(model: RodsModel) -> Iterator[Constraint]:
    """n.d = 0 with n across the prescribed direction of the link."""
    for driver in model.linkage.drivers:
        across = (-sp.sin(driver.angle), sp.cos(driver.angle))
        along = model.along[driver.link]
        yield Constraint(
            f"{driver.link}_drive", f"the drive of link {driver.link}", dot(across, along), _ONE, "m"
        )
