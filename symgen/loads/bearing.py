"""Friction of a bearing: a couple against the rotation of two links, by the force in their joint (plane)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp
from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import JointLaw, Load, Reading
from symgen.loads.measure import RATE, LoadTerm
from symgen.loads.of_links import Angle
from symgen.loads.torque import check_couple
from symgen.scene import table, units
from symgen.symbolic.names import Letter


class Bearing(table.Table):
    """Friction of the bearing in which two links, or a link and the ground, rotate about a point (plane).

    The couple is coefficient * radius * F * w / sqrt(w**2 + transition**2) against the relative rate w, with
    the force F in the joint.
    """

    link: table.Name
    point: table.Name
    against: table.Name | None = table.absent("The other link; the ground if absent.")
    coefficient: table.Value
    radius: table.Value
    transition: table.Value = Field(
        description="Relative rate at which the couple is 71 % of the largest; at ten times the rate 99.5 %. "
        "Below it friction is viscous: nothing sticks."
    )


@dataclass(frozen=True, slots=True)
class BearingFriction(Load):
    """Friction of a bearing of a radius [m] between a link and another one, or the ground (empty)."""

    letters: ClassVar[Mapping[str, Letter]] = {
        "coefficient": Letter("mu", "1", "coefficient of friction of {load}"),
        "radius": Letter("r", "m", "radius of {load}"),
        "transition": Letter("omega", "rad/s", "transition rate of {load}"),
    }

    noun, plural, schema = "bearing", "bearings", Bearing

    link: str
    against: str
    point: str
    coefficient: sp.Expr
    radius: sp.Expr
    transition: sp.Expr

    @classmethod
    def read(cls, read: Reading, table: Bearing, name: str, where: str) -> BearingFriction:
        check_couple(read, table.link, table.against, None, where)
        if read.dimension == 3:
            raise SceneError(
                "friction of bearings is that of linkages in the plane",
                where=where,
                hint="In space give a couple by the state: [[torques]].",
            )
        point = read.known_point(table.point, f"{where}.point").name
        coefficient = read.not_negative(table.coefficient, units.NUMBER, f"{where}.coefficient")
        radius = read.not_negative(table.radius, units.LENGTH, f"{where}.radius")
        transition = read.not_negative(table.transition, units.ANGULAR_RATE, f"{where}.transition")
        if transition == 0:
            raise SceneError("expected a transition rate above zero", where=f"{where}.transition")
        return cls(name, table.link, table.against or "", point, coefficient, radius, transition)

    @property
    def of_joint(self) -> JointLaw:
        slip = RATE / sp.sqrt(RATE**2 + self.transition**2)
        return JointLaw(self.link, self.against, self.point, -self.coefficient * self.radius * slip)

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        yield LoadTerm(Angle(self.link, self.against), force=(self.couple,))
