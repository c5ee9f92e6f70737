"""A method by its coefficients; the compiled step loop reads them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True, eq=False)
class Integrator:
    """A method of one of the core's kinds.

    Parameters
    ----------
    name, about
        How it is called, and one line on it.
    kind
        Name of its kind in the core, which is also that of its file there.
    order
        Order of the solution at the ends of steps.
    dense_order
        Order with which the local error of the interpolant falls, for states between them.
    error_order
        Order of the error estimate, which sets the exponent of the step control; 0 for a fixed step.
    coefficients
        Sizes and coefficients, by the names that ``core/KIND.c`` lists.
    needs_tangent
        Whether it needs the Jacobian of the accelerations: kernel ``tangent``.
    near
        The method of adaptive steps near a loss of rank of the constraints; None for this one.
    """

    name: str
    about: str
    kind: str
    order: int
    dense_order: int
    error_order: int
    coefficients: Mapping[str, ArrayLike]
    needs_tangent: bool = False
    near: Integrator | None = None

    @property
    def adaptive(self) -> bool:
        """Whether it estimates its own error."""
        return self.error_order > 0
