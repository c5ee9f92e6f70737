"""Couples by the forces in joints, and efforts that keep motions: unknowns of the equations of motion.

The force in a joint depends on accelerations and multipliers, which depend on the couple, such as friction of
bearings, all linearly but for the size of the force.

The row of a prescribed motion has no force of its own: its multiplier is zero, and efforts u, with forces B u
by the virtual work of their drives, stand in its place,

    M a + J^T lambda = f + B u,   J a = gamma,   lambda_i = 0 of every motion i.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import SceneError
from symgen.loads.measure import RATE, Vector
from symgen.models.rods.matrix import named
from symgen.symbolic.calculus import ZERO, partial
from symgen.symbolic.vectors import dot

if TYPE_CHECKING:
    from symgen.loads.load import JointLaw
    from symgen.models.rods.linkage import RodsModel
    from symgen.symbolic.system import NamedMatrix

#: Name of the matrix B of the forces by efforts.
EFFORTS = "effort_forces"


@dataclass(frozen=True, slots=True)
class CoupleByForce:
    """A couple by the force in a joint: ``factor`` [m] times the size of ``force`` [N]."""

    owner: str
    couple: sp.Symbol
    factor: sp.Expr
    force: Vector

    @property
    def size(self) -> sp.Expr:
        """The size of the force [N]."""
        return sp.sqrt(dot(self.force, self.force))


def couples_by_forces(model: RodsModel) -> list[CoupleByForce]:
    """Return the couples by the forces in joints.

    Raises
    ------
    SceneError
        Where the force in a joint does not follow from its two links, and for elastic links.
    """
    laws = [(f"{table}.{i}", x, x.of_joint) for table, i, x in model.linkage.placed_loads]
    couples = []
    for where, load, law in laws:
        if law:
            _check(model, law, where)
            factor = law.factor.xreplace({RATE: model.loads.turning(law.link, law.against)[1]})
            force = model.joint_forces.on(law.link, law.point)
            couples.append(CoupleByForce(load.name, model.loads.of_joints[load.name].symbol, factor, force))
    return couples


def joint_couples(model: RodsModel) -> list[NamedMatrix]:
    """Return the matrices of couples by the forces in joints; none without such loads.

    They are the factors, the applied forces by couples, the forces, and the slopes of these.
    """
    couples = couples_by_forces(model)
    if not couples:
        return []
    owners, unknowns = [x.owner for x in couples], [x.couple for x in couples]
    accelerations = [a for p in model.free for a in model.a[p]]
    work = [x.symbol for x in (*accelerations, *model.multipliers.values())] + unknowns
    components = [c for x in couples for c in x.force]
    slopes = [partial(c, x) for c in components for x in work]
    factors, q = [x.factor for x in couples], [x.name for x in model.coordinates]
    about = "applied forces by couples of 1 N m"
    directions = [partial(f, x) for f in model.applied for x in unknowns]
    return [
        named(model, "couple_factors", factors, "m", "couples over sizes of forces in joints", rows=owners),
        named(model, "couple_directions", directions, "1/m", about, rows=q, columns=owners),
        named(
            model, "forces_of_couples", components, "N", "forces in joints by which couples are",
            rows=owners, columns=model.axes,
        ),
        named(
            model, "slopes_of_forces", slopes, "SI", "slopes of these by accelerations, multipliers, couples",
            rows=[f"{owner}.{axis}" for owner in owners for axis in model.axes],
            columns=[x.name for x in work],
        ),
    ]  # fmt: skip


def _check(model: RodsModel, law: JointLaw, where: str) -> None:
    """Check that the force in a joint is determined."""
    if model.linkage.elastic:
        raise SceneError(
            "friction of bearings is that of linkages with rigid links",
            where=where,
            hint="Give a couple by the state: [[torques]].",
        )
    if model.joint_forces.bears_teeth(law.link, law.point):
        raise SceneError(
            f"the force in the bearing of {law.link} at {law.point} is not known: forces at axes of gears "
            "lack the pressure of the teeth, which depends on radii and pressure angle",
            where=where,
            hint="Give a couple by the state: [[torques]].",
        )
    _check_joint(model, law, where)


def _check_joint(model: RodsModel, law: JointLaw, where: str) -> None:
    """Check that the two links, and nothing else, meet at the point: what acts on a pin is not on either."""
    moving = [k for k in model.parts if k.name not in model.idle]  # a rail is part of the ground
    there = [k.name for k in moving if law.point in (*k.base, *(c.name for c in k.carried))]
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


def effort_forces(model: RodsModel) -> tuple[list[sp.Expr], list[NamedMatrix]]:
    """Return the applied forces without the efforts, and the matrix of the forces by each; none without.

    Raises
    ------
    SceneError
        For friction of bearings beside efforts.
    """
    efforts = model.loads.efforts
    if not efforts:
        return model.applied, []
    if model.loads.of_joints:
        raise SceneError(
            "friction of bearings and unknown efforts are not found together",
            where="bearings.0",
            hint="Give couples by the state: [[torques]].",
        )
    unknowns = [x.symbol for x in efforts.values()]
    absent: dict[sp.Basic, sp.Expr] = dict.fromkeys(unknowns, ZERO)
    names = [f"{table}.{i}" for table, i, load in model.linkage.placed_loads if load.is_sought]
    words = [term.on.effort for load, term in model.loads.terms if load.is_sought]
    slopes = [partial(f, u) for f in model.applied for u in unknowns]
    about = "forces by the efforts that keep prescribed motions"
    matrix = named(
        model, EFFORTS, slopes, "1, 1/m", about,
        rows=[x.name for x in model.coordinates],
        columns=[f"{name}.{word}" for name, word in zip(names, words, strict=True)],
    )  # fmt: skip
    return [f.xreplace(absent) for f in model.applied], [matrix]
