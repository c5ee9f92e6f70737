"""One place of an elastic link as a building block: masses and forces there, and terms of second order."""

from __future__ import annotations

from symgen.elements.element import entry_unit
from symgen.mechanics.elastic.hamilton import THESIS
from symgen.mechanics.elastic.places import PLACE, SHAPES, STATE, at_a_place, second_order
from symgen.mechanics.sources import NONE
from symgen.symbolic.system import Export, Group, NamedMatrix, System

_ABOUT = "constants of a link by a unit mass, force, axial force and moment of inertia at x"


def elastic_place_system() -> System:
    """Return the System of one place of an elastic link, over the fields there."""
    rows = tuple(SHAPES)
    point = tuple(
        NamedMatrix(
            f"point_{name}",
            matrix,
            entry_unit("1"),
            f"of {name}",
            rows,
            rows if matrix.cols > 1 else (),
        )
        for name, matrix in at_a_place().items()
    )
    omitted = NamedMatrix(
        "second_order", second_order(), "N", "forces of second degree that linear theory omits", rows
    )
    return System(
        "elastic_place",
        "One place of an elastic link",
        (
            Group("q", "place", PLACE),
            Group("u", "axial stiffness, strain, slope and axial force at the place", STATE),
        ),
        (*point, omitted),
        (
            Export("point", _ABOUT, tuple(m.name for m in point)),
            Export("second_order", omitted.description, (omitted.name,)),
        ),
        references=(THESIS,),
        sources=NONE,
    )
