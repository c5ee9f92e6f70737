"""Explicit Runge-Kutta methods by their coefficients, as the compiled step loop reads them."""

from __future__ import annotations

from typing import Any

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.integrate.integrators.method import Method


def explicit_runge_kutta(
    name: str,
    about: str,
    *,
    order: int,
    error_order: int,
    a: Array,
    b: Array,
    c: Array,
    error: Array,
    dense: Array,
    edge: float = 0.0,
) -> Method:
    """Return a method by its coefficients, under the names that ``core/tableau.h`` lists.

    Stage ``len(b)`` is the derivative at the end of the step, the stages behind it serve the interpolant
    only. ``dense[i, d]`` is the coefficient of theta^(d+1) in the weight of stage i.

    Parameters
    ----------
    name, about, order, error_order
        As of :class:`.Method`.
    a
        Shape (all_stages, all_stages), strictly lower triangular.
    b
        Weights of the solution, shape (stages,).
    c
        Nodes, shape (all_stages,).
    error
        Weights of the error estimates, shape (0, 1 or 2, stages), or with one more column for the
        derivative at the end of the step, the first stage of the next.
    dense
        Shape (all_stages, degree).
    edge
        Step times largest eigenvalue at the edge of stability, by which stiffness is seen; 0: it is not
        looked for.
    """
    stages, degree = len(b), dense.shape[1]
    coefficients: dict[str, Any] = {
        "stages": stages, "all_stages": len(c), "degree": degree, "estimates": len(error),
        "same_as_last": error.shape[1] > stages, "a": a, "b": b, "c": c, "dense": dense, "edge": edge,
        "error": np.pad(error, ((0, 0), (0, stages + 1 - error.shape[1]))),
    }  # fmt: skip
    return Method(name, about, "explicit", order, degree + 1, error_order, coefficients)


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
