"""Prescribed motions of quantities other than those of drives, which drives of unknown effort keep.

The row of such a motion has no force of its own: see ``effort_forces`` of ``symgen/models/couples.py``.
"""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from symgen.errors import SceneError
from symgen.models.rods.drives.drive import Drive
from symgen.models.rods.loads import Loads
from symgen.models.rods.points import Points
from symgen.scene.rods.rotations import PrescribedMotion
from symgen.symbolic.calculus import ONE


def motion_drives(model: Points) -> Iterator[Drive]:
    """Yield what motions prescribe; efforts belong to the loads that keep them."""
    for motion in model.linkage.motions:
        unit, about = "rad" if motion.links else "m", f"prescribed motion of {motion.text}"
        yield Drive(owner=motion.output, name=motion.output, value=motion.value, unit=unit, about=about)


def gap(loads: Loads, motion: PrescribedMotion) -> tuple[sp.Expr, sp.Expr]:
    """Return the quantity less its prescribed value [m or rad], and its size by a radian [m]."""
    (quantity,) = loads.with_state((motion.of,))
    return quantity - motion.value, loads.link_length(motion.links[0]) if motion.links else ONE


def motion_error(loads: Loads, motion: PrescribedMotion) -> sp.Expr:
    """Return the constraint of a motion [m]: of angles its sine, which revolutions do not change.

    Raises
    ------
    SceneError
        For a quantity of fixed points and links alone.
    """
    off, size = gap(loads, motion)
    if not loads.model.varies(off):
        raise SceneError(
            f"{motion.text} does not move: its points and links are fixed",
            where=f"motions.{motion.name.rpartition('_')[2]}.of",
            hint="Write a quantity that the drives move.",
        )
    return size * sp.sin(off) if motion.links else off
