"""A linear spring with a damper between two points: V = k (l - l_0)^2/2, and the force -c dl/dt."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp
from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import Load, Reading
from symgen.loads.measure import RATE, VALUE, LoadTerm
from symgen.loads.of_points import Length
from symgen.scene import table, units
from symgen.symbolic.names import Letter


class Spring(table.Table):
    """A linear spring, with damping if given, between two points."""

    between: list[table.Name] = Field(min_length=2, max_length=2)
    stiffness: table.Value
    length: table.Value = Field(description="Length at which it is slack.")
    damping: table.Value | None = None


@dataclass(frozen=True, slots=True)
class LinearSpring(Load):
    """A spring between two points: stiffness [N/m], slack length [m], damping [N s/m]."""

    letters: ClassVar[Mapping[str, Letter]] = {
        "stiffness": Letter("k", "N/m", "stiffness of {load}"),
        "length": Letter("l0", "m", "slack length of {load}"),
        "damping": Letter("c", "N*s/m", "damping of {load}"),
    }

    noun, plural, schema, drawn = "spring", "springs and dampers", Spring, "spring"

    start: str
    end: str
    stiffness: sp.Expr
    length: sp.Expr
    damping: sp.Expr

    @classmethod
    def read(cls, read: Reading, table: Spring, name: str, where: str) -> LinearSpring:
        start, end = (read.known_point(p, f"{where}.between") for p in table.between)
        length = read.not_negative(table.length, units.LENGTH, f"{where}.length")
        damping = read.not_negative(table.damping or 0, units.DAMPING, f"{where}.damping")
        directed = length != 0 or damping != 0
        if start.name == end.name or (start.at == end.at and directed and not read.drawing_is_a_guess):
            raise SceneError(
                "a spring needs two different points: at one place it has no direction",
                where=f"{where}.between",
            )
        stiffness = read.not_negative(table.stiffness, units.STIFFNESS, f"{where}.stiffness")
        return cls(name, start.name, end.name, stiffness, length, damping)

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        yield LoadTerm(
            Length(self.name, self.start, self.end, slack=self.length),
            energy=self.stiffness * VALUE**2 / 2,
            force=(-self.damping * RATE,) if self.damping != 0 else (),
        )
