"""A force along the line between two points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import sympy as sp
from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import UNKNOWN, Load, Reading, expression
from symgen.loads.measure import LoadTerm
from symgen.loads.of_points import Length
from symgen.scene import table, units


class Actuator(table.Table):
    """A force along the line between two points, which pushes them apart where it is positive."""

    between: list[table.Name] = Field(min_length=2, max_length=2)
    force: table.Value = Field(
        description="May use the time t, the state, and this.length and this.rate. "
        '"?" is the force that [[motions]] need.'
    )


@dataclass(frozen=True, slots=True)
class LineForce(Load):
    """A force [N] along the line between two points, which pushes them apart where it is positive."""

    noun, plural, schema = "actuator", "forces between points", Actuator

    start: str
    end: str
    force: sp.Expr = expression("scalar")

    @classmethod
    def read(cls, read: Reading, table: Actuator, name: str, where: str) -> LineForce:
        start, end = (read.known_point(p, f"{where}.between").name for p in table.between)
        if start == end:
            raise SceneError("an actuator needs two different points", where=f"{where}.between")
        if table.force == UNKNOWN:
            drive = cls(name, start, end, sp.S.Zero)
            return replace(drive, force=drive.effort)
        names = read.with_state(name, {"length": units.LENGTH, "rate": units.VELOCITY})
        return cls(name, start, end, read.value(table.force, units.FORCE, f"{where}.force", names))

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        yield LoadTerm(Length(self.name, self.start, self.end), force=(self.force,))
