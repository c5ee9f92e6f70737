"""Explicit Runge-Kutta methods by their coefficients, as the compiled step loop reads them.

The coefficients are fractions, exact or of 40 digits: each number type of the core rounds them once.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.integrate.integrators.method import Integrator

#: Fractions, and whole numbers.
Exact = NDArray[np.object_]


def explicit_runge_kutta(
    name: str,
    about: str,
    *,
    order: int,
    error_order: int,
    a: Exact,
    b: Exact,
    c: Exact,
    error: Exact,
    dense: Exact,
    edge: float = 0.0,
) -> Integrator:
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
    coefficients = {
        "stages": stages, "all_stages": len(c), "degree": degree, "estimates": len(error),
        "same_as_last": error.shape[1] > stages, "a": a, "b": b, "c": c, "dense": dense, "edge": edge,
        "error": np.pad(error, ((0, 0), (0, stages + 1 - error.shape[1]))),
    }  # fmt: skip
    return Integrator(name, about, "explicit", order, degree + 1, error_order, coefficients)


def exact(values: Sequence[Fraction | int | str]) -> Exact:
    """Return fractions from numbers and from text such as ``"3/40"`` or ``"0.25"``."""
    return np.array([Fraction(value) for value in values], dtype=object)


def lower_triangle(rows: Sequence[Exact]) -> Exact:
    """Return the square array of these rows below the diagonal, the first of them empty."""
    a = np.zeros((len(rows), len(rows)), dtype=object)
    for i, row in enumerate(rows):
        a[i, : len(row)] = row
    return a


def hermite(b: Exact) -> Exact:
    """Return the dense weights of the cubic through both ends of a step, for solution weights ``b``.

    With dy = h sum b_i k_i, f0 the first stage and f1 the derivative at the end:
    theta^2 (3 - 2 theta) dy + h theta (1 - theta)^2 f0 + h theta^2 (theta - 1) f1.
    """
    dense = np.zeros((len(b) + 1, 3), dtype=object)
    dense[:-1] += np.outer(b, [0, 3, -2])
    dense[0] += [1, -2, 1]
    dense[-1] += [0, -1, 1]
    return dense
