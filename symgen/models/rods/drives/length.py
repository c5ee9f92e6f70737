"""The drive of the length of a massless rod; its constraint is that of the length."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.models.rods.drives.drive import Drive
from symgen.models.rods.points import Points
from symgen.scene.rods.linkage import TIME


def length_drives(model: Points) -> Iterator[Drive]:
    """Yield those of a linkage."""
    for rod in (rod for rod in model.rods if TIME.symbol in rod.length.free_symbols):
        name = rod.name
        yield Drive(
            owner=name,
            name=f"{name}.length",
            value=rod.length,
            unit="m",
            about=f"driven length of {name}",
            effort=("force", "N", f"force of {name}, positive where it pushes its ends apart"),
            row=name,
            lever=rod.length,
            shown=("length", "length_rate"),
        )
