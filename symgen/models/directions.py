"""A constraint on the directions of two sections or bodies as a building block."""

from __future__ import annotations

from symgen.mechanics.directors import directions
from symgen.mechanics.sources import NONE
from symgen.symbolic.names import Names
from symgen.symbolic.system import Export, Group, NamedMatrix, System


def direction_system() -> System:
    """Return the System of a constraint on the directions of two sections or bodies."""
    names = Names()
    quantities = directions.direction(names)
    vectors = tuple(x.name for x in directions.VECTORS)
    slopes, curved = "slopes by the vectors", "slopes of the slopes"
    return System(
        "direction",
        "Constraint on the directions of two sections",
        (
            Group("q", "vectors of both directions", directions.VECTORS),
            Group(
                "u", "their rates, factors, value", (*directions.RATES, *directions.FACTORS, directions.VALUE)
            ),
        ),
        (
            NamedMatrix("error", quantities.error, "1; 1/s", "error and rate", ("error", "rate")),
            NamedMatrix("slopes", quantities.slopes, "SI", slopes, vectors),
            NamedMatrix("curvature", quantities.curvature, "SI", curved, vectors, vectors),
        ),
        (
            Export("row", "error, rate and slopes of the constraint", ("error", "slopes")),
            Export("curvature", curved, ("curvature",)),
        ),
        names.definitions,
        references=("P. Betsch, P. Steinmann, Computational Mechanics 31 (2003) 49-59",),
        sources=NONE,
    )
