"""Exact derivatives of a driven loop's outputs by its parameters, at the pose of a time.

Closure, its rates and accelerations, and the balance of efforts determine variables, rates, accelerations
and closing wrench one after the other. Kernels give the tangent of each equation along a direction: along
that of a parameter and of the unknowns before, the screws S of dependent variables give dq by
S dq + tangent = 0, then du and da, and the slopes of efforts by the closing wrench give its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.closure.start import Closed
from symgen.runtime.linearisation.record import Sensitivity
from symgen.runtime.linearisation.sensitivity import finite
from symgen.runtime.loop.driven import moving_at
from symgen.runtime.loop.kernels import LoopKernels

Array = NDArray[np.float64]

#: Relative sizes of singular values, and of residuals of equations, that count as none.
_RANK, _LEFT = 1e-9, 1e-9


def sensitivity(
    loop: LoopKernels, tangents: LoopKernels, begin: Closed, at: float | None, parameters: Sequence[str]
) -> Sensitivity:
    """Return derivatives at a time [s], at the start when absent.

    Parameters
    ----------
    tangents
        The kernels of the analysis ``loop_sensitivity``.

    Raises
    ------
    ModelError
        For a parameter that opens redundant closure equations, and a force that they do not determine.
    SimulationError
        When the loop does not reach that time; when a derivative is not finite.
    """
    t = begin.t if at is None else at
    return _Pose(loop, tangents, t, moving_at(loop, begin, t)).derivatives(tuple(parameters))


class _Pose:
    """A pose in motion, and tangents at it."""

    def __init__(self, loop: LoopKernels, tangents: LoopKernels, t: float, row: Array) -> None:
        d, n = loop.description, loop.description.coordinates
        self.loop, self.tangents, self.t = loop, tangents, t
        self.q, self.u, self.acceleration = row[:n], row[n : 2 * n], row[2 * n : 3 * n]
        self.dependent, self.inputs = d.having("dependent"), loop.inputs
        self.known = [i for i, v in enumerate(d.variables) if not v.unknown]
        #: Places of rates, accelerations, closing wrench and parameters among the tangents.
        self.places = np.cumsum([n, n, n, 6])
        self.size = self.places[-1] + len(loop.given)
        self.wrench = np.zeros(6)
        lengths = np.array([1.0, 1.0, 1.0, d.size, d.size, d.size])
        screws = loop("motion", t, self.q, self.u)["screws"] / lengths[:, None]
        columns = np.array([d.size if v.is_length else 1.0 for v in d.variables])
        self.lengths, self.columns = lengths, columns
        self.screws = (screws * columns)[:, self.dependent]
        values = np.linalg.svd(self.screws, compute_uv=False)
        if np.count_nonzero(values > _RANK * values.max(initial=0.0)) < len(self.dependent):
            raise ModelError(
                f"{d.name} is at a singular position at {loop.value_at(t)}: parameters do not determine "
                "how it moves"
            )
        self._balance()

    def along(self, kernel: str, direction: Array) -> Array:
        """Return the tangents that a kernel gives along a direction."""
        name = "outputs" if kernel == "slopes" else kernel
        return self._called(kernel, direction)[f"{name}_tangent"].ravel()

    def _called(self, kernel: str, direction: Array) -> dict[str, Array]:
        work = np.concatenate([self.acceleration, self.wrench, direction])
        return self.tangents(kernel, self.t, self.q, self.u, work)

    def _balance(self) -> None:
        """Find the closing wrench."""
        if self.tangents.has("efforts"):
            left = self._called("efforts", np.zeros(self.size))["efforts_left"].ravel()
            self.wrench = self._balanced(left)

    @cached_property
    def _by_wrench(self) -> Array:
        """Slopes of the known efforts by the closing wrench (known, 6), all in units of moments."""
        slopes = np.array([self.along("efforts", x) for x in self._wrenches])[:, self.known].T
        return np.asarray(slopes * self.columns[self.known, None])

    @property
    def _wrenches(self) -> Array:
        """Directions of the components of the closing wrench, moments times the size: (6, tangents)."""
        directions = np.zeros((6, self.size))
        directions[:, self.places[2] : self.places[3]] = np.diag(self.lengths)
        return directions

    def _balanced(self, left: Array) -> Array:
        """Return the closing wrench of minimum norm that changes the efforts by minus these."""
        scaled = left[self.known] * self.columns[self.known]
        return np.asarray(-self.lengths * np.linalg.lstsq(self._by_wrench, scaled, rcond=_RANK)[0])

    def derivatives(self, parameters: tuple[str, ...]) -> Sensitivity:
        """Return the derivatives of all outputs by parameters."""
        d, units = self.loop.description, dict[str, str]()
        for block in self.tangents.blocks("values"):
            several = len(block.rows) > 1
            units |= {
                f"{block.name}.{row}" if several else block.name: block.unit for row in block.rows or ("",)
            }
        names = [*units]
        self._check_determined(names)
        slopes = np.array([self.along("slopes", self._direction(name)) for name in parameters]).T
        values = np.concatenate([x.ravel() for x in self._called("values", np.zeros(self.size)).values()])
        by = {p.name: p.unit for p in d.tunable}
        return finite(
            Sensitivity(
                derivatives=slopes,
                outputs=tuple(names),
                parameters=parameters,
                values=values,
                units=units | {name: by[name] for name in parameters},
                t=self.t,
            )
        )

    def _direction(self, parameter: str) -> Array:
        """Return the direction of variables, rates, accelerations and wrench by a parameter."""
        d, n = self.loop.description, len(self.q)
        direction = np.zeros(self.size)
        direction[self.places[-1] + [p.name for p in d.parameters].index(parameter)] = 1.0
        prescribed = self.along("prescribed", direction).reshape(-1, 3)
        for order, (kernel, rows) in enumerate(
            (("closure", slice(0, 6)), ("motion", slice(0, 6)), ("motion", slice(6, 12)))
        ):
            direction[order * n + np.array(self.inputs)] = prescribed[:, order]
            opened = self.along(kernel, direction)[rows] / self.lengths
            moved = np.linalg.lstsq(self.screws, -opened, rcond=_RANK)[0]
            if np.max(np.abs(self.screws @ moved + opened)) > _LEFT * np.max(np.abs(opened), initial=1.0):
                raise ModelError(
                    f"a change of {parameter} alone opens the redundant closure equations of {d.name}\n"
                    "  Give parameters that keep the loop closed."
                )
            direction[order * n + np.array(self.dependent)] = moved * self.columns[self.dependent]
        if self.tangents.has("efforts"):
            wrench = self._balanced(self.along("efforts", direction))
            direction[self.places[2] : self.places[3]] = wrench
        return direction

    def _check_determined(self, names: Sequence[str]) -> None:
        """Raise ModelError for an output that a wrench in balance with all efforts changes."""
        if not self.tangents.has("efforts"):
            return
        _, values, right = np.linalg.svd(self._by_wrench)
        free = right[np.count_nonzero(values > _RANK * values.max(initial=0.0)) :]
        by = np.array([self.along("slopes", x) for x in self._wrenches])
        changed = np.max(np.abs(free @ by), axis=0, initial=0.0) > _LEFT * np.max(np.abs(by), axis=0)
        for name in (name for name, moves in zip(names, changed, strict=True) if moves):
            raise ModelError(
                f"{name} is not determined: closure equations of {self.loop.description.name} are redundant"
            )
