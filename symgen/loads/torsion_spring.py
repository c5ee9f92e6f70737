"""A torsion spring with a damper: V = k a^2/2 in the plane, V = k (1 - cos a) between rods in space."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp
from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import Load, Reading
from symgen.loads.measure import RATE, VALUE, LoadTerm
from symgen.loads.of_links import Angle, Bend
from symgen.loads.torque import check_couple
from symgen.scene import table, units
from symgen.symbolic.names import Letter


class TorsionSpring(table.Table):
    """A torsion spring, with damping if given, between two links, or a link and the ground (plane)."""

    link: table.Name
    against: table.Name | None = table.absent("The other link; the ground if absent.")
    stiffness: table.Value = Field(description="Torque per radian.")
    angle: table.Value = Field(0, description="Angle of the link from the other one at which it is slack.")
    damping: table.Value | None = None
    point: table.Name | None = table.absent("Of elastic links, the point at whose sections the spring acts.")


@dataclass(frozen=True, slots=True)
class AngularSpring(Load):
    """A torsion spring on a link against another one, or the ground where ``against`` is empty.

    Stiffness [N m/rad], free angle [rad], damping [N m s/rad].
    """

    letters: ClassVar[Mapping[str, Letter]] = {
        "stiffness": Letter("k", "N*m/rad", "stiffness of {load}"),
        "angle": Letter("phi", "rad", "free angle of {load}"),
        "damping": Letter("c", "N*m*s/rad", "damping of {load}"),
    }

    noun, plural, schema = "torsion spring", "torsion springs", TorsionSpring

    link: str
    against: str
    stiffness: sp.Expr
    angle: sp.Expr
    damping: sp.Expr
    section: str = ""

    @classmethod
    def read(cls, read: Reading, table: TorsionSpring, name: str, where: str) -> AngularSpring:
        section = check_couple(read, table.link, table.against, table.point, where)
        angle = read.value(table.angle, units.NUMBER, f"{where}.angle")
        damping = read.not_negative(table.damping or 0, units.ANGULAR_DAMPING, f"{where}.damping")
        pair = [k for k in (table.link, table.against) if k is not None]
        rods = len(pair) == 2 and not any(map(read.is_spatial_body, pair))
        if read.dimension == 3 and not rods:
            raise SceneError(
                "in space a torsion spring joins two rods, not a body or the ground",
                where=where,
                hint="Put it between two rods: link and against. Against the ground, write [[torques]].",
            )
        if read.dimension == 3 and (angle != 0 or damping != 0):
            raise SceneError(
                "in space a torsion spring bends two rods that are slack in line: it takes link, against and "
                "stiffness, and no angle or damping",
                where=where,
                hint="Its energy is stiffness*(1 - cos(angle between the rods)), regular at every angle.",
            )
        stiffness = read.not_negative(table.stiffness, units.TORQUE, f"{where}.stiffness")
        return cls(name, table.link, table.against or "", stiffness, angle, damping, section)

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        if dimension == 3:
            yield LoadTerm(Bend(self.link, self.against), energy=self.stiffness * (1 - VALUE))
        else:
            yield LoadTerm(
                Angle(self.link, self.against, self.angle, self.section),
                energy=self.stiffness * VALUE**2 / 2,
                force=(-self.damping * RATE,) if self.damping != 0 else (),
            )
