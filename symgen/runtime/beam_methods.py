"""Methods that step the elastic motion with fixed steps."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class BeamMethod:
    """A fixed-step method for M S'' + C S' + K S = Q.

    ``collocated`` methods have stages ``c`` with the matrix ``a`` and weights ``b``. The others take the
    equation at the part 1 - ``at_force`` of the step, and the acceleration at 1 - ``at_inertia``; ``gamma``
    and ``beta`` are Newmark's.
    """

    name: str
    about: str
    order: int
    a: Rows = ((0.0,),)
    b: tuple[float, ...] = (0.0,)
    c: tuple[float, ...] = (0.0,)
    collocated: bool = False
    at_force: float = 0.0
    at_inertia: float = 0.0
    gamma: float = 0.5
    beta: float = 0.25


def _generalized_alpha(radius: float) -> BeamMethod:
    """Return the method with a spectral radius at infinite frequency (Chung, Hulbert 1993, (17), (20), (25))."""
    inertia, force = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    return BeamMethod(
        "generalized-alpha",
        f"generalized-alpha, spectral radius {radius} at infinite frequency",
        2,
        at_force=force,
        at_inertia=inertia,
        gamma=0.5 - inertia + force,
        beta=(1 - inertia + force) ** 2 / 4,
    )


_R3, _R15 = sqrt(3.0), sqrt(15.0)

GAUSS_4 = BeamMethod(
    "gauss4",
    "Gauss collocation with two stages",
    4,
    ((1 / 4, 1 / 4 - _R3 / 6), (1 / 4 + _R3 / 6, 1 / 4)),
    (1 / 2, 1 / 2),
    (1 / 2 - _R3 / 6, 1 / 2 + _R3 / 6),
    collocated=True,
)
GAUSS_6 = BeamMethod(
    "gauss",
    "Gauss collocation with three stages",
    6,
    (
        (5 / 36, 2 / 9 - _R15 / 15, 5 / 36 - _R15 / 30),
        (5 / 36 + _R15 / 24, 2 / 9, 5 / 36 - _R15 / 24),
        (5 / 36 + _R15 / 30, 2 / 9 + _R15 / 15, 5 / 36),
    ),
    (5 / 18, 4 / 9, 5 / 18),
    (1 / 2 - _R15 / 10, 1 / 2, 1 / 2 + _R15 / 10),
    collocated=True,
)
NEWMARK = BeamMethod("newmark", "Newmark's method of constant average acceleration", 2)

#: Methods by name, one line each.
BEAM_METHODS = {m.name: m for m in (GAUSS_6, GAUSS_4, NEWMARK, _generalized_alpha(0.9))}
