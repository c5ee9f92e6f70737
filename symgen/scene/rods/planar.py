"""Which linkages in space stay in a coordinate plane: they are derived in it, with half the work.

A plane across a coordinate axis is kept where all points lie in it, nothing pushes or starts them across
it, and every link is a rod: then the accelerations across it vanish whatever the motion in it is. A load is
judged where the motion is, with the coordinate across the plane at its constant value and its rate zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import sympy as sp

from symgen.loads.load import Load
from symgen.scene.rods.linkage import (
    Linkage,
    Plane,
    StartConditions,
    Vector,
    state_of,
    state_symbol,
)
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.quantity import AXES

Values = dict[sp.Symbol, sp.Expr]


def in_its_plane(linkage: Linkage) -> Linkage:
    """Return a linkage in space as the planar one that it is.

    Where it leaves every coordinate plane, it is returned as it is, and says in ``leaves_plane`` by what.
    """
    if linkage.dimension == 2:
        return linkage
    whole = next(_turning_in_space(linkage), None)
    obstacles: list[str] = [whole] if whole else []
    for across in () if whole else (2, 1, 0):
        level = linkage.points[0].at[across]
        if level.free_symbols or any(p.at[across] != level for p in linkage.points):
            continue
        plane = Plane(across, level, linkage)
        values = _values_of_constants(linkage, plane)
        leaves = next(_leaving(linkage, plane, values), None)
        if leaves is None:
            return _projected(linkage, plane, values)
        obstacles.append(f"{leaves}, across the plane {plane}")
    return replace(linkage, leaves_plane="; ".join(obstacles) or "its points lie in no plane across an axis")


def _turning_in_space(linkage: Linkage) -> Iterator[str]:
    """Yield the components that have another meaning in the plane."""
    yield from (f"the body {body.name} turns about any axis" for body in linkage.bodies)
    yield from (f"{hinge.link} has a revolute joint with an axis in space" for hinge in linkage.hinges)


def _values_of_constants(linkage: Linkage, plane: Plane) -> Values:
    """Return the quantities of the motion across the plane in loads: the constant coordinate, and no rate."""
    axis = AXES[plane.across]
    return {
        state_symbol(f"{p.name}.{word}{axis}"): value
        for p in linkage.points
        for word, value in (("", plane.level), ("v", ZERO))
    }


def _leaving(linkage: Linkage, plane: Plane, values: Values) -> Iterator[str]:
    """Yield the loads, motions and rotations that take the linkage out of a plane."""
    axis = AXES[plane.across]
    if linkage.gravity[plane.across] != 0:
        yield f"gravity.acceleration has a component along {axis}"
    for point in linkage.points:
        if point.motion[plane.across] != plane.level:
            yield f"points.{point.name}.motion has a component along {axis}"
    for table, i, load in linkage.placed_loads:
        reasons = _of_load(load, plane, values)
        yield from (f"{table}.{i} {reason}" for reason in reasons)
    for name, rate in linkage.start.rates:
        if any(plane.within(rate)):
            yield f"start.rates.{name} has a component that is not along {axis}"
    for name, velocity in linkage.start.velocities:
        if velocity[plane.across] != 0:
            yield f"start.velocities.{name} has a component along {axis}"
    stated = {
        **{f"{table}.{i}": load.expressions for table, i, load in linkage.placed_loads},
        **{f"events.{i}": (event.gap,) for i, event in enumerate(linkage.events)},
        **{f"states.{state.name}": (state.rate,) for state in linkage.states},
        **{f"motions.{i}": (motion.of,) for i, motion in enumerate(linkage.motions)},
    }
    for where, expressions in stated.items():
        if any(_lost(e, values) for e in expressions):
            yield f"{where} has no value"


def _of_load(load: Load, plane: Plane, values: Values) -> Iterator[str]:
    """Yield reasons why a load leaves the plane, or acts differently in the plane and in space."""
    here = list(load.terms(3))
    within = list(load.in_plane(plane.across, lambda e: e.xreplace(values)).terms(2))
    alike = [a.on == b.on for a, b in zip(here, within, strict=False)]
    for term, other in zip(here, within, strict=False):
        force = tuple(c.xreplace(values) for c in term.total)
        if reason := term.on.leaves_plane(plane, force, other.total):
            yield reason
    if len(here) != len(within) or not all(alike):
        yield "acts otherwise in space"


def _lost(expression: sp.Expr, values: Values) -> bool:
    """Return whether an expression of the state has no value in a plane, such as 1/A.z at zero."""
    if not state_of(expression):
        return False
    value: sp.Expr = expression.xreplace(values)
    return bool(value.has(sp.nan, sp.zoo, sp.oo, -sp.oo, sp.I))


def _projected(linkage: Linkage, plane: Plane, values: Values) -> Linkage:
    """Return the linkage by its components in a plane."""

    def within(vector: Vector) -> Vector:
        return tuple(c.xreplace(values) for c in plane.within(vector))

    def turning(vector: Vector) -> Vector:
        return (vector[plane.across].xreplace(values),)

    start = linkage.start
    return replace(
        linkage,
        dimension=2,
        plane=plane,
        points=tuple(replace(p, at=within(p.at), motion=within(p.motion)) for p in linkage.points),
        gravity=within(linkage.gravity),
        loads=tuple(load.in_plane(plane.across, lambda e: e.xreplace(values)) for load in linkage.loads),
        events=tuple(replace(e, gap=e.gap.xreplace(values)) for e in linkage.events),
        states=tuple(replace(s, rate=s.rate.xreplace(values)) for s in linkage.states),
        motions=tuple(replace(m, of=m.of.xreplace(values)) for m in linkage.motions),
        start=StartConditions(
            start.angles,
            tuple((name, turning(rate)) for name, rate in start.rates),
            tuple((name, within(velocity)) for name, velocity in start.velocities),
        ),
    )
