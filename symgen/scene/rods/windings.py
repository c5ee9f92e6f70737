"""Angles that are continuous over revolutions: in loads, from references that runs move, and in outputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count

import sympy as sp

from symgen.loads.of_links import Angle
from symgen.scene.rods.linkage import Linkage, state_of
from symgen.scene.rods.run_parameters import Parameter, Winding
from symgen.scene.rods.switches import loads_of
from symgen.symbolic.quantity import quantity

_ZERO = sp.Integer(0)


def with_windings(linkage: Linkage) -> Linkage:
    """Return a linkage with a reference for every angle in its loads and outputs, of torsion springs too.

    At 0, the value of the parameter that is added, an angle lies between -pi and pi. Those that it had are
    omitted first. Kinematics have no loads, and in space no link has one angle.
    """
    old = {w.reference for w in linkage.windings}
    constants = tuple(p for p in linkage.parameters if p.quantity not in old)
    linkage = replace(linkage, parameters=constants, windings=())
    if len(linkage.axes) == 3:
        return linkage
    used_names = {p.quantity.name for p in linkage.parameters}
    names = (name for name in map("turned_{}".format, count()) if name not in used_names)
    windings = tuple(
        Winding(
            link, against, free, quantity(name, "rad", f"reference of the angle of {link}, moved by runs")
        )
        for (link, against, free), name in zip(dict.fromkeys(_angles(linkage)), names, strict=False)
    )
    added = tuple(Parameter(w.reference, _ZERO) for w in windings)
    return replace(linkage, parameters=(*linkage.parameters, *added), windings=windings)


def turning(linkage: Linkage) -> tuple[str, ...]:
    """Return the links whose angles are recorded, and whose revolutions runs count."""
    if linkage.elastic or linkage.kinematic or len(linkage.shown_axes) == 3:
        return ()
    requested = (name.rpartition(".") for name in linkage.outputs or ())
    links = {k.name for k in linkage.links}
    return tuple(dict.fromkeys(link for link, _, word in requested if word == "angle" and link in links))


def _angles(linkage: Linkage) -> Iterator[tuple[str, str, sp.Expr]]:
    acting = [] if linkage.kinematic else [load for load in linkage.loads if load.acts]
    for measure in (m for load in acting for m in load.measures(len(linkage.axes))):
        if isinstance(measure, Angle):
            yield measure.link, measure.against, measure.free
    motor = [(linkage.crank.torque,)] if linkage.crank and not linkage.kinematic else []
    loads = () if linkage.kinematic else loads_of(linkage)
    stated = (load.expressions for load in linkage.loads if not load.acts)
    for expressions in (*(e for _, e, _ in loads), *motor, *stated):
        for symbol in (s for e in expressions for s in state_of(e)):
            owner, _, word = str(symbol.name).rpartition(".")
            if word == "angle":
                yield *linkage.turned_by(owner), _ZERO
