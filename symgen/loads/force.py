"""A force on a point, its components fixed in space."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from symgen.loads.load import Load, Reading, expression
from symgen.loads.measure import Term, Vector
from symgen.loads.of_points import Position
from symgen.scene import table, units


class Force(table.Table):
    """A force on a point, its components fixed in space; may use the time t and the state."""

    point: table.Name
    force: table.Vector


@dataclass(frozen=True, slots=True)
class AppliedForce(Load):
    """A force [N] on a point; may depend on the time t and the state."""

    noun, plural, schema, named = "force", "forces", Force, False

    point: str
    force: Vector = expression("polar")

    @classmethod
    def read(cls, read: Reading, table: Force, name: str, where: str) -> AppliedForce:
        point = read.known_point(table.point, f"{where}.point").name
        return cls(name, point, read.vector(table.force, units.FORCE, f"{where}.force", read.with_state()))

    def terms(self, dimension: int) -> Iterator[Term]:
        yield Term(Position(self.point), force=self.force)
