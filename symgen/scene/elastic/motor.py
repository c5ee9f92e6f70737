"""A linkage with rigid links whose crank is turned by its motor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import sympy as sp

from symgen.loads.torque import AppliedTorque
from symgen.scene.rods.linkage import Linkage, StartConditions, Vector
from symgen.scene.rods.switches import with_switches
from symgen.scene.rods.windings import with_windings

#: Digits of coordinates: beyond those of a double, so that differences are exact.
_DIGITS = 40

Places = Mapping[str, Sequence[float]]


def with_motor(linkage: Linkage, places: Places) -> Linkage:
    """Return the linkage with all links rigid, its crank turned by its motor with the flywheel.

    ``places`` are where the points that have coordinates are in the rigid motion at t = 0 [m].
    """
    crank = linkage.crank
    if crank is None:
        return linkage
    turned = replace(
        linkage,
        points=tuple(replace(p, at=_at(places[p.name])) if p.name in places else p for p in linkage.points),
        loads=(*linkage.loads, AppliedTorque("motor__torque", crank.link, (crank.torque,))),
        drivers=tuple(d for d in linkage.drivers if d.link != crank.link),
        start=StartConditions((), (), ()),
        outputs=(),
        elastic=(),
        crank=None,
        stations=(),
    )
    return with_switches(with_windings(turned))


def _at(place: Sequence[float]) -> Vector:
    return tuple(sp.Float(float(c), _DIGITS) for c in place)
