"""A force per length on a link in the plane, linear along it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, cast

import sympy as sp
from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import Load, Reading, expression
from symgen.loads.measure import LoadTerm, Vector
from symgen.loads.of_links import Span
from symgen.scene import table, units


class DistributedForce(table.Table):
    """A force per length on a link in the plane; may use the time t and the state."""

    link: table.Name
    force: table.Vector = Field(
        description="Per length, at the first point of the link; uniform without end."
    )
    end: table.Vector | None = Field(
        None, description="Per length, at its second point, linear between them."
    )
    axes: Literal["fixed", "link", "section"] = Field(
        "fixed",
        description="fixed: components along x and y; link: along the link and to its left; "
        "section: the same of each section of an elastic link.",
    )


@dataclass(frozen=True, slots=True)
class DistributedLoad(Load):
    """A force per length [N/m] on a link, linear between its values at the link's first two points.

    Its components are fixed in space, or, where ``turning``, along the link and to its left, with
    ``with_sections`` of each section of an elastic link. They may depend on the time t and the state.
    """

    noun, plural, schema, named = "distributed force", "distributed forces", DistributedForce, False
    keys: ClassVar[Mapping[str, str]] = {"start": "force"}

    link: str
    start: Vector = expression("polar")
    end: Vector = expression("polar")
    turning: bool = False
    with_sections: bool = False

    @classmethod
    def read(cls, read: Reading, table: DistributedForce, name: str, where: str) -> DistributedLoad:
        names = read.with_state()
        read.known_link(table.link, f"{where}.link")
        if read.dimension != 2:
            raise SceneError(
                "forces are distributed along links in the plane, not in space",
                where=where,
                hint='Write [[forces]] on points of the link: P = { on = "link", fraction = 0.5 }.',
            )
        read.moving_link(table.link, f"{where}.link")
        start = read.vector(table.force, units.STIFFNESS, f"{where}.force", names)
        end = start if table.end is None else read.vector(table.end, units.STIFFNESS, f"{where}.end", names)
        return cls(name, table.link, start, end, table.axes != "fixed", table.axes == "section")

    def with_written(self, change: Callable[[str, sp.Expr], sp.Expr], axes: Sequence[str]) -> Load:
        load = cast(DistributedLoad, Load.with_written(self, change, axes))
        return replace(load, end=load.start) if self.end == self.start and load.end == self.end else load

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        yield LoadTerm(Span(self.link, self.turning, self.with_sections), force=(*self.start, *self.end))
