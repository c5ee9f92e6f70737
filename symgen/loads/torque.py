"""A couple on a link, and its reaction on another one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import sympy as sp
from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import UNKNOWN, Load, Reading, expression
from symgen.loads.measure import LoadTerm, Vector
from symgen.loads.of_links import DriveRotation, LinkRotation
from symgen.scene import table, units


class Torque(table.Table):
    """A couple on a link, and its reaction on another link if named."""

    link: table.Name
    torque: table.Value | table.Vector = Field(
        description="In the plane counter-clockwise, in space three components. May use the time t, the "
        "state and, in the plane, this.angle and this.rate of the link relative to the other one. "
        '"?" is the torque that [[motions]] need: that of a drive, which stands on the other link or on the '
        "ground, in space about the revolute joint of the link with the ground."
    )
    against: table.Name | None = None
    point: table.Name | None = table.absent("On an elastic link, the point at whose section the couple acts.")


@dataclass(frozen=True, slots=True)
class AppliedTorque(Load):
    """A couple [N m] on a link, and its reaction on the link ``against`` if there is one.

    One component in the plane, three in space.
    """

    noun, plural, schema = "torque", "torques", Torque

    link: str
    torque: Vector = expression("axial")
    against: str = ""
    section: str = ""

    @classmethod
    def read(cls, read: Reading, table: Torque, name: str, where: str) -> AppliedTorque:
        section = check_couple(read, table.link, table.against, table.point, where)
        if table.torque == UNKNOWN:
            sought = cls(name, table.link, (), table.against or "", section)
            return replace(sought, torque=(sought.effort,))
        if read.dimension == 3:
            if not isinstance(table.torque, list):
                raise SceneError(
                    "expected the three components of a torque in space", where=f"{where}.torque"
                )
            torque = read.vector(table.torque, units.TORQUE, f"{where}.torque", read.with_state())
        elif isinstance(table.torque, list):
            raise SceneError("expected one torque, counter-clockwise, in the plane", where=f"{where}.torque")
        else:
            names = read.with_state(name, {"angle": units.NUMBER, "rate": units.ANGULAR_RATE})
            torque = (read.value(table.torque, units.TORQUE, f"{where}.torque", names),)
        return cls(name, table.link, torque, table.against or "", section)

    @property
    def turns(self) -> str:
        return self.link if self.is_sought else ""

    def about(self, axis: Vector) -> AppliedTorque:
        size = sp.sqrt(sp.Add(*(c**2 for c in axis)))
        return replace(self, torque=tuple(self.torque[0] * c / size for c in axis))

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        on = DriveRotation if self.is_sought else LinkRotation
        yield LoadTerm(on(self.link, self.against, self.section), force=self.torque)


def check_couple(read: Reading, link: str, against: str | None, point: str | None, where: str) -> str:
    """Check that a couple acts on a link that can turn, against another one; return the point of the section.

    It is empty for rigid links.
    """
    read.moving_link(link, f"{where}.link")
    if against is not None:
        read.moving_link(against, f"{where}.against")
        if against == link:
            raise SceneError("a torque of a link against itself does nothing", where=f"{where}.against")
    return read.known_point(point, f"{where}.point").name if point is not None else ""
