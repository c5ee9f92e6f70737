"""Methods that step the elastic motion with fixed steps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.integrate.integrators.method import Integrator

#: Weights of the accelerations at the start and at the end of a step.
Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class BeamMethod:
    """A fixed-step method for M S'' + C S' + K S = Q.

    ``collocated`` methods have stages ``c`` with the matrix ``a`` and weights ``b``. The others find the
    acceleration at the end of the step from the equation at a part ``at`` of the step h, where with S'' at
    both ends

        S''_at = inertia . (S''_0, S''_1),   S'_at = S'_0 + h rate . (S''_0, S''_1),
        S_at = S_0 + at h S'_0 + h^2 place . (S''_0, S''_1),

    and the step ends as Newmark's does with ``gamma`` and ``beta``. Gear's method, of ``past`` states, takes
    the stages for its first steps.
    """

    name: str
    order: int
    a: Array = field(default_factory=lambda: np.zeros((0, 0)))
    b: Array = field(default_factory=lambda: np.zeros(0))
    c: Array = field(default_factory=lambda: np.zeros(0))
    at: float = 1.0
    inertia: Pair = (0.0, 1.0)
    rate: Pair = (0.5, 0.5)
    place: Pair = (0.25, 0.25)
    gamma: float = 0.5
    beta: float = 0.25
    past: int = 0

    @property
    def collocated(self) -> bool:
        """Whether it has stages."""
        return len(self.c) > 0

    @property
    def arrays(self) -> dict[str, Array]:
        """Coefficients of the stages by their names in the core."""
        return {"a": self.a, "aa": self.a @ self.a, "b": self.b, "ba": self.b @ self.a, "c": self.c}


@cache
def integrator_of(method: BeamMethod) -> Integrator:
    """Return a method for the step loop: see ``core/beam_steps.c``."""
    ends = {name: getattr(method, name) for name in ("at", "gamma", "beta", "inertia", "rate", "place")}
    coefficients = {"stages": len(method.c), "past": method.past, **ends, **method.arrays}
    return Integrator(
        method.name, "fixed steps of elastic links", "beam_steps", method.order, 3, 0, coefficients
    )


def _generalized_alpha(radius: float) -> BeamMethod:
    """Return the method with a spectral radius at infinite frequency (Chung, Hulbert 1993, Eqs. 17 to 25)."""
    inertia, force = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    gamma, beta, at = 0.5 - inertia + force, (1 - inertia + force) ** 2 / 4, 1 - force
    return BeamMethod(
        "generalized-alpha",
        2,
        at=at,
        inertia=(inertia, 1 - inertia),
        rate=(at * (1 - gamma), at * gamma),
        place=(at * (0.5 - beta), at * beta),
        gamma=gamma,
        beta=beta,
    )


def _wilson(theta: float) -> BeamMethod:
    """Return Wilson's method: acceleration linear in time up to ``theta`` steps, where the equation is met.

    K. J. Bathe, E. L. Wilson, *Stability and accuracy analysis of direct integration methods*, Earthquake
    Engineering and Structural Dynamics 1 (1973): stable at any step for theta above 1.37. The load is taken
    where the equation is, not extrapolated.
    """
    return BeamMethod(
        "wilson-theta",
        2,
        at=theta,
        inertia=(1 - theta, theta),
        rate=(theta - theta**2 / 2, theta**2 / 2),
        place=(theta**2 / 2 - theta**3 / 6, theta**3 / 6),
        beta=1 / 6,
    )


def gauss(name: str, stages: int) -> BeamMethod:
    """Return collocation at the nodes of Gauss's quadrature: order twice the stages, stable at any step.

    Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.7: a and b integrate every
    polynomial of a degree below the number of stages, up to a node and over the step.
    """
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    c = (nodes + 1) / 2
    return BeamMethod(name, 2 * stages, _integrals(c), weights / 2, np.array(c))


def _radau(name: str, stages: int) -> BeamMethod:
    """Return collocation at the nodes of Radau's quadrature with the end of the step.

    E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, IV.5: of order 2 s - 1, and stiffly
    accurate, so that vibrations much faster than the steps decay in each of them.
    """
    last, before = ([0.0] * k + [1.0] for k in (stages, stages - 1))
    nodes = np.sort(np.polynomial.legendre.legroots(np.subtract(last, [*before, 0.0])).real)
    c = np.append((nodes[:-1] + 1) / 2, 1.0)
    a = _integrals(c)
    return BeamMethod(name, 2 * stages - 1, a, a[-1].copy(), c)


def _gear(order: int) -> BeamMethod:
    """Return Gear's method, backward differentiation of an order from 2 to 5.

    E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, V.1: beyond order 2 it is not stable at
    any step; vibrations without damping grow within a band of steps. Its first steps are of order 6.
    """
    return replace(gauss(f"bdf{order}", 3), order=order, past=order)


def _integrals(c: Array) -> Array:
    """Return the integrals up to each node of the polynomials that are one at one node and zero at others."""
    powers = np.arange(1, len(c) + 1)
    up_to = c[:, None] ** powers / powers
    return np.array(np.linalg.solve((c[:, None] ** (powers - 1)).T, up_to.T).T, float, order="C")


#: Of a high order, since a linkage vibrates much faster than its crank revolves.
GAUSS = gauss("gauss", 6)
#: Of shooting: fast vibrations, which steps do not resolve, have no part in the motion of slow ones.
RADAU = _radau("radau", 6)
#: Of elements in large rotation.
GAUSS8 = gauss("gauss8", 4)
_METHODS = (
    GAUSS,
    gauss("gauss4", 2),
    BeamMethod("newmark", 2),
    _generalized_alpha(0.9),
    _wilson(1.4),
    *map(_gear, range(2, 6)),
)
#: Methods by name.
BEAM_METHODS = {m.name: m for m in _METHODS}
