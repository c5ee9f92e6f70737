"""A bushing between two bodies: V = sum k_i d_i^2/2 of the offset, and a spring and damper of the rotation.

In space V = 2 sum k_i q_i^2 of the rotation, with q the vector part of its quaternion: k (1 - cos a) of an
angle a about one axis, regular at every angle.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import sympy as sp
from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import Load, Reading
from symgen.loads.measure import RATE, RATES, VALUE, VALUES, LoadTerm, Vector
from symgen.loads.of_links import Alignment, Angle, Twist
from symgen.loads.of_points import Offset
from symgen.scene import table, units
from symgen.scene.units import Dimension
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.names import Letter
from symgen.symbolic.vectors import cross_in_plane, dot


class Bushing(table.Table):
    """A bushing between two links, or a link and the ground, by components on axes fixed in ``against``."""

    between: list[table.Name] = Field(
        min_length=2, max_length=2, description="A point of against, or of the ground, and one of the link."
    )
    link: table.Name
    against: table.Name | None = table.absent(
        "The other link, with which the axes rotate; the ground if absent. In the plane the axes are along "
        "it and to its left, in space those of the drawing."
    )
    stiffness: table.Vector = Field(description="Force per offset between the points, on each axis.")
    damping: table.Vector | None = None
    angular_stiffness: table.Value | table.SpatialVector | None = table.absent(
        "Torque per radian: one number in the plane, one for each axis in space."
    )
    angular_damping: table.Value | table.SpatialVector | None = None
    angle: table.Value | None = table.absent(
        "In the plane, angle of the link from the other one at which it is slack; as drawn if absent."
    )


@dataclass(frozen=True, slots=True)
class ElasticBushing(Load):
    """A bushing from the point ``start`` of a link, or of the ground where ``against`` is empty, to ``end``.

    Stiffness [N/m] and damping [N s/m] by component, of rotation [N m/rad] and [N m s/rad].
    """

    letters: ClassVar[Mapping[str, Letter]] = {
        "stiffness": Letter("k", "N/m", "stiffness of {load}"),
        "damping": Letter("c", "N*s/m", "damping of {load}"),
        "angular_stiffness": Letter("kr", "N*m/rad", "angular stiffness of {load}"),
        "angular_damping": Letter("cr", "N*m*s/rad", "angular damping of {load}"),
        "angle": Letter("phi", "rad", "free angle of {load}"),
    }

    noun, plural, schema, drawn = "bushing", "bushings", Bushing, "spring"

    start: str
    end: str
    link: str
    against: str
    stiffness: Vector
    damping: Vector
    angular_stiffness: Vector
    angular_damping: Vector
    angle: sp.Expr
    section: str = ""

    @classmethod
    def read(cls, read: Reading, table: Bushing, name: str, where: str) -> ElasticBushing:
        start, end = (read.known_point(p, f"{where}.between") for p in table.between)
        against = table.against or ""
        if table.link == against:
            raise SceneError("a bushing of a link against itself does nothing", where=f"{where}.against")
        for key, link in (("link", table.link), ("against", against)):
            if link:
                read.moving_link(link, f"{where}.{key}")
        if against and read.is_elastic(against):
            raise SceneError(
                f"{against} is elastic, and the axes of a bushing rotate with a rigid link or the ground",
                where=f"{where}.against",
                hint="Exchange the links, or write [[springs]] of length 0 for equal stiffness on both axes.",
            )
        turned = table.angular_stiffness is not None or table.angular_damping is not None
        if against and turned and read.is_elastic(table.link) and read.dimension == 2:
            raise SceneError(
                f"expected no torque between the section of {table.link}, which is elastic, and {against}",
                where=f"{where}.{'angular_stiffness' if table.angular_stiffness else 'angular_damping'}",
                hint="Leave it out, or mount the link on the ground.",
            )
        if not against and not start.ground:
            raise SceneError(
                f"expected a ground point first, got {start.name}",
                where=f"{where}.between",
                hint="Name the link of the first point in against.",
            )
        for point, link in ((start.name, against), (end.name, table.link)):
            if link and point not in read.points_of(link):
                raise SceneError(
                    f"expected a point of {link}, got {point}",
                    where=f"{where}.between",
                    hint=f"Name one of {', '.join(read.points_of(link))}, or place {point} on {link}.",
                )
        if start.name == end.name:
            raise SceneError(
                "a bushing needs two points, one of each body: one point of both is a joint",
                where=f"{where}.between",
            )
        if read.dimension == 3:
            _check_axes(read, table, where)
        size, turns = read.dimension, 1 if read.dimension == 2 else 3
        stiffness = _components(read, table.stiffness, units.STIFFNESS, size, f"{where}.stiffness")
        damping = _components(read, table.damping, units.DAMPING, size, f"{where}.damping")
        of_rotation = _components(
            read, table.angular_stiffness, units.TORQUE, turns, f"{where}.angular_stiffness"
        )
        dragging = _components(
            read, table.angular_damping, units.ANGULAR_DAMPING, turns, f"{where}.angular_damping"
        )
        if table.angle is not None:
            angle = read.value(table.angle, units.NUMBER, f"{where}.angle")
        else:
            angle = _drawn_angle(read, table.link, against) if size == 2 else ZERO
        section = end.name if read.is_elastic(table.link) else ""
        ends = start.name, end.name, table.link, against
        return cls(name, *ends, stiffness, damping, of_rotation, dragging, angle, section)

    def off_sections(self) -> Load:
        return replace(self, angular_stiffness=(ZERO,), angular_damping=(ZERO,)) if self.section else self

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        offset = Offset(self.name, self.start, self.end, self.against)
        yield LoadTerm(offset, energy=_energy(self.stiffness), force=_dragged(self.damping))
        if not any((*self.angular_stiffness, *self.angular_damping)):
            return
        if dimension == 2:
            yield LoadTerm(
                Angle(self.link, self.against, self.angle, self.section),
                energy=self.angular_stiffness[0] * VALUE**2 / 2,
                force=(-self.angular_damping[0] * RATE,) if self.angular_damping[0] != 0 else (),
            )
            return
        # 1 - a_i.b_i = 2 (q_j^2 + q_k^2)
        half = sp.Add(*self.angular_stiffness) / 2
        turned = (1 - x for x in VALUES)
        energy = sp.Add(*((half - k) * x for k, x in zip(self.angular_stiffness, turned, strict=True)))
        if energy != 0:
            yield LoadTerm(Alignment(self.link, self.against), energy=energy)
        if any(self.angular_damping):
            yield LoadTerm(Twist(self.link, self.against), force=_dragged(self.angular_damping))


def _energy(stiffness: Vector) -> sp.Expr:
    return sp.Add(*(k * x**2 / 2 for k, x in zip(stiffness, VALUES, strict=False)))


def _dragged(damping: Vector) -> Vector:
    return tuple(-c * rate for c, rate in zip(damping, RATES, strict=False)) if any(damping) else ()


def _check_axes(read: Reading, table: Bushing, where: str) -> None:
    """Check that the links of a bushing in space have axes."""
    rotates = table.angular_stiffness is not None or table.angular_damping is not None
    for key, link in (("against", table.against), ("link", table.link if rotates else None)):
        if link is not None and not read.is_spatial_body(link):
            raise SceneError(
                f"{link} is a rod, which has no axes across it in space",
                where=f"{where}.{key}",
                hint="Make it a body with three points or more, centre and inertia.",
            )
    if table.angle is not None:
        raise SceneError("a bushing in space is slack as drawn: it takes no angle", where=f"{where}.angle")


def _components(
    read: Reading,
    written: str | int | float | list[str | int | float] | None,
    dim: Dimension,
    count: int,
    where: str,
) -> Vector:
    """Return as many components that are not negative; zeros where none are written."""
    if written is None:
        return (ZERO,) * count
    is_list = isinstance(written, list)
    texts = written if isinstance(written, list) else [written]
    if len(texts) != count or is_list == (count == 1):
        expected = "one number in the plane" if count == 1 else f"a list of {count} components"
        raise SceneError(f"expected {expected}, got {written!r}", where=where)
    places = [f"{where}.{i}" for i in range(count)] if is_list else [where]
    return tuple(read.not_negative(text, dim, at) for text, at in zip(texts, places, strict=True))


def _drawn_angle(read: Reading, link: str, against: str) -> sp.Expr:
    """Return the angle of a link from another one, or from the x axis, as drawn in the plane."""
    other, d = read.drawn(against) if against else (ONE, ZERO), read.drawn(link)
    return sp.atan2(cross_in_plane(other, d), dot(other, d))
