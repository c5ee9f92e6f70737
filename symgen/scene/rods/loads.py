"""Point masses and loads of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.errors import SceneError
from symgen.loads import LOADS
from symgen.loads.load import Load
from symgen.scene import units
from symgen.scene.reading import Reader
from symgen.scene.rods.linkage import PlacedMass


def masses(read: Reader) -> Iterator[PlacedMass]:
    """Yield the point masses."""
    for i, mass in enumerate(read.scene.masses):
        point = read.known_point(mass.point, f"masses.{i}.point")
        if mass.inertia is not None:
            raise SceneError(
                "a point mass has no inertia but on a rotor",
                where=f"masses.{i}.inertia",
                hint="Give the inertia to a link.",
            )
        yield PlacedMass(point.name, read.not_negative(mass.mass, units.MASS, f"masses.{i}.mass"))


def loads(read: Reader) -> Iterator[Load]:
    """Yield the loads of all kinds, kind by kind."""
    for table, kind in LOADS.items():
        for i, written in enumerate(getattr(read.scene, table)):
            yield kind.read(read, written, kind.numbered(i), f"{table}.{i}")
