"""A force on a point, its components fixed in space or along a link with which it rotates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import Load, Reading, expression
from symgen.loads.measure import LoadTerm, Vector
from symgen.loads.of_points import Position
from symgen.scene import table, units


class Force(table.Table):
    """A force on a point; may use the time t and the state."""

    point: table.Name
    force: table.Vector = Field(description="Along x and y; with a link along it and to its left.")
    link: table.Name | None = Field(
        None,
        description="The link with which it rotates; with its section at the point if the link is elastic.",
    )


@dataclass(frozen=True, slots=True)
class AppliedForce(Load):
    """A force [N] on a point; may depend on the time t and the state.

    Its components are fixed in space, or, where it has a ``link``, along the link and to its left.
    """

    noun, plural, schema, named = "force", "forces", Force, False

    point: str
    force: Vector = expression("polar")
    link: str = ""

    @classmethod
    def read(cls, read: Reading, table: Force, name: str, where: str) -> AppliedForce:
        point = read.known_point(table.point, f"{where}.point").name
        if table.link is not None:
            read.moving_link(table.link, f"{where}.link")
            if read.dimension != 2:
                raise SceneError(
                    "forces rotate with links in the plane, not in space",
                    where=f"{where}.link",
                    hint="Leave link out, or write all points with two coordinates.",
                )
        force = read.vector(table.force, units.FORCE, f"{where}.force", read.with_state())
        return cls(name, point, force, table.link or "")

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        yield LoadTerm(Position(self.point, self.link), force=self.force)
