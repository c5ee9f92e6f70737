"""Point masses, loads and first-order states of a scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import sympy as sp

from symgen.errors import SceneError
from symgen.loads import LOADS
from symgen.loads.load import Load
from symgen.scene import units
from symgen.scene.expressions import Names, parse_any
from symgen.scene.faults import at
from symgen.scene.reading import Reader, Values
from symgen.scene.rods.linkage import TIME, Linkage, PlacedMass, RigidLink
from symgen.scene.rods.rotations import Driver, Hinge
from symgen.scene.rods.run_parameters import FirstOrder
from symgen.scene.schema import PointMass
from symgen.scene.units import is_quantity
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.vectors import dot

#: Cosine of the angle of a rod with an axis that counts as a right one.
_RIGHT = 1e-9


def masses(read: Reader, links: Sequence[RigidLink]) -> Iterator[PlacedMass]:
    """Yield the masses at points, those with inertia with the link on which they rotate."""
    for i, mass in enumerate(read.scene.masses):
        where = f"masses.{i}"
        point = read.known_point(mass.point, f"{where}.point").name
        value = read.not_negative(mass.mass, units.MASS, f"{where}.mass")
        if mass.inertia is None:
            if mass.link is not None:
                raise SceneError(
                    "a mass without a moment of inertia rotates with no link", where=f"{where}.link"
                )
            yield PlacedMass(point, value)
            continue
        if read.dimension == 3:
            raise SceneError(
                "a mass at a point has a moment of inertia in the plane alone",
                where=f"{where}.inertia",
                hint="In space give the inertia to a body.",
            )
        inertia = read.not_negative(mass.inertia, units.INERTIA, f"{where}.inertia")
        yield PlacedMass(point, value, inertia, _turned(read, links, mass, where))


def with_inertias(links: Iterable[RigidLink], masses: Sequence[PlacedMass]) -> Iterator[RigidLink]:
    """Yield the links, with the moments of inertia of masses that rotate with them."""
    for link in links:
        inertias = [mass.inertia for mass in masses if mass.link == link.name]
        yield replace(link, inertia=sp.Add(link.inertia, *inertias)) if inertias else link


def loads(read: Reader) -> Iterator[Load]:
    """Yield the loads of all kinds, kind by kind; raise SceneError for outputs of elastic links."""
    if getattr(read.scene, "outputs", ()) and any(
        link.elastic is not None for link in read.scene.links.values()
    ):
        raise SceneError("outputs by expressions are for linkages with rigid links", where="outputs.0")
    for table, kind in LOADS.items():
        for i, written in enumerate(getattr(read.scene, table)):
            yield kind.read(read, written, kind.numbered(i), f"{table}.{i}")


def turned(loads: Sequence[Load]) -> Iterator[Driver]:
    """Yield the links on which torques of unknown size act, as drives of their angles."""
    yield from (Driver(x.turns, ZERO) for x in loads if x.turns)


def about_axes(read: Reader, loads: Sequence[Load], hinges: Sequence[Hinge]) -> Iterator[Load]:
    """Yield the loads, in space with torques of unknown size about the revolute joints of their links.

    Raises
    ------
    SceneError
        For such a torque on a link without revolute joint with the ground, or against another link.
    """
    axes = {hinge.link: hinge.axis for hinge in hinges if not hinge.against}
    for load in loads:
        link = load.turns
        if read.dimension == 2 or not link:
            yield load
            continue
        where = f"{load.plural}.{load.name.rpartition('_')[2]}"
        against = next(name for m in load.measures(3) for key, name in m.links if key == "against")
        if against or link not in axes:
            raise SceneError(
                f"in space an unknown torque acts about a revolute joint with the ground, not on {link}"
                + f" against {against}" * bool(against),
                where=f"{where}.{'against' if against else 'torque'}",
                hint=f'Write [[joints]] with point, links = ["{link}"], kind = "revolute" and axis, or '
                'force = "?" under [[actuators]].',
            )
        axis = axes[link]
        if not read.is_spatial_body(link):
            d, size = read.drawn(link), dot(axis, axis)
            if read.number(dot(d, axis)) ** 2 > _RIGHT**2 * read.number(dot(d, d) * size):
                raise SceneError(
                    f"an unknown torque acts on rods at right angles to its axis, not on {link}",
                    where=f"{where}.link",
                    hint="Make the link a body.",
                )
        yield load.about(axis)


def check_efforts(linkage: Linkage) -> None:
    """Check that there are as many unknown efforts as motions that they keep.

    Raises
    ------
    SceneError
        For another number of them, and where they act on elastic links.
    """
    sought = [f"{table}.{i}" for table, i, load in linkage.placed_loads if load.is_sought]
    if linkage.kinematic or len(sought) == len(linkage.motions):
        return
    where = sought[0] if len(sought) > len(linkage.motions) else "motions.0"
    raise SceneError(
        f"expected as many unknown efforts as motions, got {len(sought)} and {len(linkage.motions)}"
        + f" ({', '.join(sought)})" * bool(sought),
        where=where,
        hint='Write torque = "?" under [[torques]], or force = "?" under [[actuators]], for each of the '
        '[[motions]]; kind = "kinematics" under [analysis] needs none.',
    )


def states(read: Reader) -> Iterator[FirstOrder]:
    """Yield the states of the scene; none for kinematics, which has no loads either."""
    scene = read.scene
    for name in scene.states if scene.analysis.kind == "dynamics" else ():
        yield first_order(read, name, read.with_state())


def first_order(read: Values, name: str, names: Names) -> FirstOrder:
    """Return a first-order state; ``names`` are those of loads."""
    written, where = read.scene.states[name], f"states.{name}"
    with at(f"{where}.start"):
        dim = parse_any(written.start, read.names)[1]
    value = read.value(written.start, dim, f"{where}.start")
    rates = dim.times(units.TIME.power(Fraction(-1)))
    rate = read.value(written.rate, rates, f"{where}.rate", names)
    of_state = units.shown_unit(str(written.start)) if is_quantity(str(written.start)) else dim.unit
    all_units = of_state, rates.unit, dim.times(units.TIME).unit
    return FirstOrder(name, all_units, value, rate, written.about.strip() or f"state {name}")


def _turned(read: Reader, links: Sequence[RigidLink], mass: PointMass, where: str) -> str:
    """Return the link with which a mass with inertia rotates."""
    there = [k for k in links if mass.point in (*k.base, *(c.name for c in k.carried))]
    if mass.link is not None:
        read.moving_link(mass.link, f"{where}.link")
        there = [k for k in there if k.name == mass.link]
    elif len(there) > 1:
        welded = next((weld.links for weld in read.scene.welds if weld.point == mass.point), [])
        there = there[:1] if {k.name for k in there} == set(welded) else there
    if not there:
        where_not = f"the link {mass.link}" if mass.link else "any link"
        raise SceneError(f"{mass.point} is not on {where_not}", where=f"{where}.inertia")
    if len(there) > 1:
        names = ", ".join(k.name for k in there)
        raise SceneError(
            f"{mass.point} is on the links {names}: a mass with inertia rotates with one of them",
            where=f"{where}.inertia",
            hint=f'Write link = "{there[0].name}", or weld the links there.',
        )
    if TIME.symbol in there[0].length.free_symbols:
        raise SceneError(
            f"the length of {there[0].name} depends on the time, which is for a link without inertia",
            where=f"{where}.inertia",
        )
    return there[0].name
