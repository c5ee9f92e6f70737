"""The drive of a ground point along an axis."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.models.rods.drives.drive import Drive
from symgen.models.rods.points import Points
from symgen.scene.rods.linkage import TIME


def place_drives(model: Points) -> Iterator[Drive]:
    """Yield those of a linkage."""
    for point in model.ground:
        for axis, place in zip(model.axes, model.linkage.point(point).motion, strict=True):
            if TIME.symbol in place.free_symbols:
                about = f"driven {axis} of {point}"
                yield Drive(owner=point, name=f"{point}.{axis}", value=place, unit="m", about=about)
