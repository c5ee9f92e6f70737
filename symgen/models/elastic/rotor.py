"""System of a rotor: the numbers of its links, masses and axis over its tunable parameters."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.mechanics.elastic.spatial import BODY, SECTION
from symgen.mechanics.sources import NONE
from symgen.models.elastic.spatial import REFERENCES
from symgen.models.limits import limits_of
from symgen.scene.elastic.rotor import RotorScene
from symgen.symbolic.quantity import AXES
from symgen.symbolic.system import Export, Group, NamedMatrix, System

_LINK = (
    *(f"{end}_{axis}" for end in ("first", "second") for axis in AXES),
    *(f"width_{axis}" for axis in AXES),
    *(q.name for q in SECTION[1:]),
)


def rotor_system(rotor: RotorScene) -> System:
    """Return the System of a rotor, whose structure the runtime assembles from shipped elements."""

    def matrix(
        name: str, rows: Sequence[Sequence[sp.Expr]], about: str, labels: Sequence[str], of: Sequence[str]
    ) -> NamedMatrix:
        return NamedMatrix(name, sp.ImmutableMatrix(rows), "SI", about, tuple(labels), tuple(of))

    links = [(*rotor.places[k.start], *rotor.places[k.end], *k.width, *k.section) for k in rotor.links]
    matrices = [
        matrix(
            "links", links, "places, direction of the width, section", [k.link for k in rotor.links], _LINK
        ),
        matrix(
            "rotation",
            [(*rotor.axis, rotor.speed, *rotor.through)],
            "axis, speed and a point of the axis",
            ("rotor",),
            (*(f"axis_{a}" for a in AXES), "speed", *(f"through_{a}" for a in AXES)),
        ),
    ]
    if rotor.masses:
        rows = [(*rotor.places[k.point], k.mass, *k.inertia) for k in rotor.masses]
        labels = [k.point for k in rotor.masses]
        columns = (*AXES, *(q.name for q in BODY))
        matrices.append(matrix("masses", rows, "places of masses, and their inertia", labels, columns))
    limits, kernel_of_limits = limits_of(rotor)
    return System(
        rotor.name,
        rotor.title,
        (Group("p", "tunable parameters", tuple(p.quantity for p in rotor.parameters)),),
        (*limits, *matrices),
        (
            Export("rotor", "numbers of links, masses and axis", tuple(m.name for m in matrices)),
            *kernel_of_limits,
        ),
        references=REFERENCES,
        sources=NONE,
    )
