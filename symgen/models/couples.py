"""Couples by the forces in joints, such as friction of bearings: unknowns of the equations of motion.

The force in a joint depends on accelerations and multipliers, which depend on the couple: the kernel
'accelerations' iterates, and judges its end by the largest couples that the forces allow.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import SceneError
from symgen.loads.measure import JOINT_FORCE, RATE
from symgen.models.rods.matrix import named
from symgen.symbolic.vectors import dot

if TYPE_CHECKING:
    from symgen.loads.load import JointLaw
    from symgen.models.rods.linkage import RodsModel
    from symgen.symbolic.system import NamedMatrix

#: Name of the matrix: of each couple its value by the other unknowns, and the square of its size.
COUPLES = "joint_couples"


def joint_couples(model: RodsModel) -> list[NamedMatrix]:
    """Return the matrix of couples by the forces in joints; none without such loads.

    Raises
    ------
    SceneError
        Where the force in a joint does not follow from its two links, and for elastic links.
    """
    laws = {(f"{table}.{i}", x): x.of_joint for table, i, x in model.linkage.placed_loads if x.of_joint}
    entries = [e for (where, load), law in laws.items() for e in _entries(model, load.name, law, where)]
    if not laws:
        return []
    about = "couples by the forces in joints, and squares of the sizes by which their iteration is judged"
    rows = [load.name for _, load in laws]
    return [named(model, COUPLES, entries, "N*m, N^2*m^2", about, rows=rows, columns=("couple", "size"))]


def _entries(model: RodsModel, owner: str, law: JointLaw, where: str) -> tuple[sp.Expr, sp.Expr]:
    """Return a couple and the square of its size.

    The size is the largest couple by the force in the joint and those along rods: the force may vanish, such
    as at the centre of mass of a balanced crank, and is then the rounding of these.
    """
    if model.linkage.elastic:
        raise SceneError(
            "friction of bearings is that of linkages with rigid links",
            where=where,
            hint="Give a couple by the state: [[torques]].",
        )
    _check_joint(model, law, where)
    force = model.joint_forces.on(law.link, law.point)
    squared = model.calculus.define(
        f"{owner}_force_squared", dot(force, force), "N^2", f"square of the force in the joint of {owner}"
    )
    rate = model.loads.turning(law.link, law.against)[1]
    along = [
        (model.multipliers[k.name].symbol * k.length) ** 2 for k in model.rods if k.name in model.multipliers
    ]
    couple = law.law.xreplace({JOINT_FORCE: sp.sqrt(squared), RATE: rate})
    return couple, law.arm**2 * sp.Add(squared, *along)


def _check_joint(model: RodsModel, law: JointLaw, where: str) -> None:
    """Check that the two links, and nothing else, meet at the point: what acts on a pin is not on either."""
    there = [k.name for k in model.parts if law.point in (*k.base, *(c.name for c in k.carried))]
    there += [""] * (law.point in model.ground)
    if sorted(there) != sorted({law.link, law.against}):
        names = ", ".join(k or "the ground" for k in there)
        raise SceneError(
            f"expected a point at which {law.link} and {law.against or 'the ground'} alone meet, at "
            f"{law.point} there are: {names or 'none'}",
            where=f"{where}.point",
            hint="Forces between more than two links on one pin are not determined: join them at points of "
            "their own. A slider is a link with two guided points and the pin between them.",
        )
    if law.against and (others := list(_others(model, law.point))):
        raise SceneError(
            f"expected {law.link} and {law.against} to bear on each other alone at {law.point}, there are "
            f"also: {', '.join(others)}",
            where=f"{where}.point",
            hint="Which of the links carries them is not determined: let them act at a point of their own on "
            f'that link, such as X = {{ on = "{law.link}", fraction = 0 }}.',
        )


def _others(model: RodsModel, point: str) -> Iterator[str]:
    """Yield the elements other than links that act at a point."""
    linkage = model.linkage
    yield from (f"masses.{i}" for i, mass in enumerate(linkage.masses) if mass.point == point)
    yield from (f"guide along {guide.along}" for guide in linkage.guides if point in guide.points)
    for table, i, load in linkage.placed_loads:
        if any(name == point for m in load.measures(linkage.dimension) for _, name in m.points):
            yield f"{table}.{i}"
