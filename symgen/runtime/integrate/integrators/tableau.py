"""An explicit Runge-Kutta method by its coefficients, as the compiled step loop reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ExplicitRungeKutta:
    """Coefficients of a method.

    Stage ``stages`` is the derivative at the end of the step, the stages behind it serve the interpolant
    only. ``dense[i, d]`` is the coefficient of theta^(d+1) in the weight of stage i.

    Parameters
    ----------
    name, about
        How it is called, and one line on it.
    order
        Order of the solution.
    error_order
        Order of the error estimate, which sets the exponent of the step control; 0 for a fixed step.
    stages
        Stages of the solution.
    a
        Shape (all_stages, all_stages), strictly lower triangular.
    b
        Weights of the solution, shape (stages,).
    c
        Nodes, shape (all_stages,).
    error
        Weights of the error estimates, shape (0, 1 or 2, stages), or with one more column for the
        derivative at the end of the step.
    dense
        Shape (all_stages, degree).
    edge
        Step times largest eigenvalue at the edge of stability, by which stiffness is seen; 0: it is not
        looked for.
    """

    name: str
    about: str
    order: int
    error_order: int
    stages: int
    a: Array
    b: Array
    c: Array
    error: Array
    dense: Array
    edge: float = 0.0

    @property
    def dense_order(self) -> int:
        """Order with which the local error of the interpolant falls."""
        return self.dense.shape[1] + 1

    @property
    def needs_tangent(self) -> bool:
        """Whether it needs the Jacobian of the accelerations."""
        return False

    @property
    def kind(self) -> str:
        """Which of the core's kinds of methods it is."""
        return "explicit"

    @property
    def same_as_last(self) -> bool:
        """Whether error estimates use the derivative at the end of the step, the first stage of the next."""
        return self.error.shape[1] > self.stages

    @property
    def coefficients(self) -> dict[str, Any]:
        """Sizes and coefficients, by the names that ``core/tableau.h`` lists."""
        own = {name: getattr(self, name) for name in ("stages", "all_stages", "same_as_last", "a", "b", "c")}
        error = np.pad(self.error, ((0, 0), (0, self.stages + 1 - self.error.shape[1])))
        sizes = {"degree": self.dense.shape[1], "estimates": len(self.error)}
        return {**own, **sizes, "error": error, "dense": self.dense, "edge": self.edge}

    @property
    def all_stages(self) -> int:
        """Stages of solution and interpolant."""
        return len(self.c)

    @property
    def adaptive(self) -> bool:
        """Whether it estimates its own error."""
        return self.error_order > 0


def lower_triangle(rows: Any) -> Array:
    """Return the square array of these rows below the diagonal, the first of them empty."""
    a = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        a[i, : len(row)] = row
    return a


def hermite(b: Array) -> Array:
    """Return the dense weights of the cubic through both ends of a step, for solution weights ``b``.

    With dy = h sum b_i k_i, f0 the first stage and f1 the derivative at the end:
    theta^2 (3 - 2 theta) dy + h theta (1 - theta)^2 f0 + h theta^2 (theta - 1) f1.
    """
    dense = np.zeros((len(b) + 1, 3))
    dense[:-1] += np.outer(b, [0.0, 3.0, -2.0])
    dense[0] += [1.0, -2.0, 1.0]
    dense[-1] += [0.0, -1.0, 1.0]
    return dense
