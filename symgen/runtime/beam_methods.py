"""Methods that step the elastic motion with fixed steps."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BeamMethod:
    """A fixed-step method for M S'' + C S' + K S = Q.

    ``collocated`` methods have stages ``c`` with the matrix ``a`` and weights ``b``. The others take the
    equation at the part 1 - ``at_force`` of the step, and the acceleration at 1 - ``at_inertia``; ``gamma``
    and ``beta`` are Newmark's, here those of constant average acceleration.
    """

    name: str
    order: int
    a: Array = field(default_factory=lambda: np.zeros((1, 1)))
    b: Array = field(default_factory=lambda: np.zeros(1))
    c: Array = field(default_factory=lambda: np.zeros(1))
    collocated: bool = False
    at_force: float = 0.0
    at_inertia: float = 0.0
    gamma: float = 0.5
    beta: float = 0.25


def _generalized_alpha(radius: float) -> BeamMethod:
    """Return the method with a spectral radius at infinite frequency (Chung, Hulbert 1993, Eqs. 17 to 25)."""
    inertia, force = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    return BeamMethod(
        "generalized-alpha",
        2,
        at_force=force,
        at_inertia=inertia,
        gamma=0.5 - inertia + force,
        beta=(1 - inertia + force) ** 2 / 4,
    )


def _gauss(name: str, stages: int) -> BeamMethod:
    """Return collocation at the nodes of Gauss's quadrature: order twice the stages, stable at any step.

    Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.7: a and b integrate every
    polynomial of a degree below the number of stages, up to a node and over the step.
    """
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    c, powers = (nodes + 1) / 2, np.arange(1, stages + 1)
    up_to = c[:, None] ** powers / powers
    a = np.linalg.solve((c[:, None] ** (powers - 1)).T, up_to.T).T
    return BeamMethod(
        name, 2 * stages, np.array(a, float, order="C"), weights / 2, np.array(c), collocated=True
    )


#: Of a high order, since what a linkage vibrates at is much faster than its turns.
GAUSS = _gauss("gauss", 6)
_METHODS = (
    GAUSS,
    _gauss("gauss4", 2),
    BeamMethod("newmark", 2),
    _generalized_alpha(0.9),
)
#: Methods by name.
BEAM_METHODS = {m.name: m for m in _METHODS}
