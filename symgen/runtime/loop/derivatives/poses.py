"""Exact derivatives of a driven loop's outputs by its parameters, at the pose of a time.

Closure, its rates and accelerations, and the balance of efforts determine variables, rates, accelerations
and closing wrench one after the other. Kernels give the tangent of each equation along a direction: along
that of a parameter and of the unknowns before, the screws S of dependent variables give dq by
S dq + tangent = 0, then du and da, and the slopes of efforts by the closing wrench give its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.closure.start import Closed
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of
from symgen.runtime.loop.ball_poles import ball_pole
from symgen.runtime.loop.driven import moving_at
from symgen.runtime.loop.kernels import LoopKernels

#: Relative sizes of singular values, and of residuals of equations, that count as none.
RANK, _LEFT = 1e-9, 1e-9


def sensitivity(
    loop: LoopKernels,
    tangents: LoopKernels,
    begin: Closed,
    times: Sequence[float],
    parameters: Sequence[str],
) -> list[Sensitivity]:
    """Return derivatives at each of some times [s]; the loop is followed from one to the next.

    Parameters
    ----------
    tangents
        The kernels of the analysis ``loop_sensitivity``.

    Raises
    ------
    ModelError
        For a parameter that opens redundant closure equations, and a force that they do not determine.
    SimulationError
        When the loop does not reach a time; when a derivative is not finite.
    """
    results, n = [], loop.description.coordinates
    for t in times:
        q, u, acceleration = moving_at(loop, begin, t)[: 3 * n].reshape(3, n)
        results.append(_Driven(loop, tangents, t, q, u, acceleration).derivatives(parameters))
        begin = Closed(t, q.copy(), begin.rank)
    return results


def check_poles(loop: LoopKernels, t: float, q: Array) -> None:
    """Raise ModelError where the angles of a ball joint have a pole."""
    if names := ball_pole(loop, t, q):
        raise ModelError(
            f"{loop.description.name} at {loop.value_at(t)}: the angles {', '.join(names)} of a ball joint "
            "have a pole there, a property of these angles and not of the loop\n"
            "  Take another pose, or turn the axes of the rows next to the ball (theta, alpha) so that its "
            "pole lies elsewhere."
        )


class LoopPose:
    """A pose in motion, and tangents at it."""

    def __init__(
        self, loop: LoopKernels, tangents: LoopKernels, t: float, q: Array, u: Array, acceleration: Array
    ) -> None:
        d, n = loop.description, loop.description.coordinates
        self.loop, self.tangents, self.t = loop, tangents, t
        self.q, self.u, self.acceleration = q, u, acceleration
        self.dependent, self.inputs = d.having("dependent"), loop.inputs
        self.known = [i for i, v in enumerate(d.variables) if not v.unknown]
        #: Places of rates, accelerations, closing wrench and parameters among the tangents.
        self.places = np.cumsum([n, n, n, 6])
        self.size = self.places[-1] + len(loop.parameter_values)
        self.wrench = np.zeros(6)
        #: Unit of efforts [N m]; the wrench has it too.
        self.effort = d.size
        lengths = np.array([1.0, 1.0, 1.0, d.size, d.size, d.size])
        screws = loop("motion", t, self.q, self.u)["screws"] / lengths[:, None]
        self.lengths, self.columns = lengths, loop.scale
        self.screws = (screws * self.columns)[:, self.dependent]
        values = np.linalg.svd(self.screws, compute_uv=False)
        if np.count_nonzero(values > RANK * values.max(initial=0.0)) < len(self.dependent):
            check_poles(loop, t, q)
            raise ModelError(
                f"{d.name} is at a singular position at {loop.value_at(t)}: its inputs and free "
                "variables do not determine how it moves"
            )

    def along(self, kernel: str, direction: Array) -> Array:
        """Return the tangents that a kernel gives along a direction, or along each of some, in rows."""
        name = "outputs" if kernel == "slopes" else kernel
        rows = np.atleast_2d(direction)
        work = np.zeros((len(rows), self.tangents.work_size + 1))
        work[:, : self.places[3] - self.places[1]] = np.concatenate([self.acceleration, self.wrench])
        work[:, self.places[3] - self.places[1] :][:, : self.size] = rows
        states = np.tile(np.concatenate([self.q, self.u, [0.0]]), (len(rows), 1))
        tangents = self.tangents.many(kernel, np.full(len(rows), self.t), states, work)[f"{name}_tangent"]
        return tangents.reshape(*np.shape(direction)[:-1], math.prod(tangents.shape[1:]))

    def called(self, kernel: str, direction: Array) -> dict[str, Array]:
        """Return all results of a kernel along a direction, by name."""
        work = np.concatenate([self.acceleration, self.wrench, direction])
        return self.tangents(kernel, self.t, self.q, self.u, work)

    def of_parameter(self, name: str) -> tuple[Array, float]:
        """Return the direction of a parameter alone, and a change of it that is not small."""
        d = self.loop.description
        place = [p.name for p in d.parameters].index(name)
        direction = np.zeros(self.size)
        direction[self.places[-1] + place] = 1.0
        value = abs(float(self.loop.parameter_values[place]))
        size = d.size if d.parameters[place].unit == "m" else max(1.0, value)
        return direction, size

    @cached_property
    def by_wrench(self) -> Array:
        """Slopes of the known efforts by the closing wrench (known, 6), all in units of moments."""
        slopes = self.along("efforts", self.wrenches)[:, self.known].T
        return np.asarray(slopes * self.columns[self.known, None])

    @property
    def wrenches(self) -> Array:
        """Directions of the components of the closing wrench, of the unit of efforts: (6, tangents)."""
        directions = np.zeros((6, self.size))
        units = self.lengths * (self.effort / self.loop.description.size)
        directions[:, self.places[2] : self.places[3]] = np.diag(units)
        return directions

    def carry(self, direction: Array, order: int, cause: str, change: float = 1.0) -> None:
        """Set the tangents of dependent variables (order 0), their rates (1) or accelerations (2).

        Closure that opens by less than ``_LEFT`` when the cause changes by ``change`` counts as closed.

        Raises
        ------
        ModelError
            When the direction opens redundant closure equations, with its cause.
        """
        n = len(self.q)
        kernel, first = ("closure", 0) if order == 0 else ("motion", 6 * order - 6)
        opened = self.along(kernel, direction)[first : first + 6] / self.lengths
        moved = np.linalg.lstsq(self.screws, -opened, rcond=RANK)[0]
        none = _LEFT * np.max(np.abs(opened), initial=1.0 / change)
        if np.max(np.abs(self.screws @ moved + opened)) > none:
            raise ModelError(
                f"a change of {cause} alone opens the redundant closure equations of "
                f"{self.loop.description.name}\n  Give parameters that keep the loop closed."
            )
        direction[order * n + np.array(self.dependent)] = moved * self.columns[self.dependent]

    @cached_property
    def outputs(self) -> dict[str, str]:
        """Unit of every scalar output by name."""
        units: dict[str, str] = {}
        for block in self.tangents.blocks("values"):
            parts = [f"{block.name}.{row}" for row in block.rows] if len(block.rows) > 1 else [block.name]
            units |= dict.fromkeys(parts, block.unit)
        return units

    @property
    def values(self) -> Array:
        """Values of all outputs."""
        values = self.called("values", np.zeros(self.size)).values() if self.outputs else ()
        return np.concatenate([x.ravel() for x in values]) if values else np.zeros(0)

    def check_determined(self, free: Array) -> None:
        """Raise ModelError for an output that changes along any of some directions (directions, tangents)."""
        if not len(free) or not self.outputs:
            return
        by, by_free = self.along("slopes", self.wrenches), self.along("slopes", free)
        changed = np.max(np.abs(by_free), axis=0) > _LEFT * np.max(np.abs(by), axis=0)
        for name in (name for name, moves in zip(self.outputs, changed, strict=True) if moves):
            raise ModelError(
                f"{name} is not determined: closure equations of {self.loop.description.name} are redundant"
            )


class _Driven(LoopPose):
    """A pose that inputs prescribe."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        if self.tangents.has("efforts"):
            left = self.called("efforts", np.zeros(self.size))["efforts_left"].ravel()
            self.wrench = self._balanced(left)

    def _balanced(self, left: Array) -> Array:
        """Return the closing wrench of minimum norm that changes the efforts by minus these."""
        scaled = left[self.known] * self.columns[self.known]
        return np.asarray(-self.lengths * np.linalg.lstsq(self.by_wrench, scaled, rcond=RANK)[0])

    def derivatives(self, parameters: Sequence[str]) -> Sensitivity:
        """Return the derivatives of all outputs by parameters."""
        if self.tangents.has("efforts"):
            self.check_determined(null_space(self.by_wrench) @ self.wrenches)
        slopes = self.along("slopes", np.array([self._direction(name) for name in parameters])).T
        d = self.loop.description
        return sensitivity_of(d, self.outputs, parameters, self.values, slopes, self.t)

    def _direction(self, parameter: str) -> Array:
        """Return the direction of variables, rates, accelerations and wrench by a parameter."""
        (direction, change), n = self.of_parameter(parameter), len(self.q)
        prescribed = self.along("prescribed", direction).reshape(-1, 3)
        for order in range(3):
            direction[order * n + np.array(self.inputs)] = prescribed[:, order]
            self.carry(direction, order, parameter, change)
        if self.tangents.has("efforts"):
            wrench = self._balanced(self.along("efforts", direction))
            direction[self.places[2] : self.places[3]] = wrench
        return direction


def null_space(matrix: Array) -> Array:
    """Return an orthonormal basis of the null space of a matrix, a row each."""
    _, values, right = np.linalg.svd(matrix)
    return right[np.count_nonzero(values > RANK * values.max(initial=0.0)) :]
