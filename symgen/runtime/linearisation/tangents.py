"""The linearised motion of a mechanism at a state, by the implicit function theorem.

Constraints J dq + Phi_p dp = 0 leave free motions; the differential of the constraints' rates gives du, and
that of the equations of motion the accelerations and multipliers. Slopes of linkages are derived in
:mod:`symgen.models.linearisation`; loops of joints give theirs by tangents.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from symgen.errors import ModelError, OptionsError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.redundancy import CLOSED, extent, not_unique, violation
from symgen.runtime.kernels.evaluate import Evaluator, Kernels
from symgen.runtime.linearisation.slopes import StateSlopes, slopes_at
from symgen.runtime.result.state import State

#: Coordinates whose directions are closer to dependent than this do not determine the motion.
_DEPENDENT = 1e-9
#: Steps of iterative refinement of solutions of the equations of motion.
_REFINEMENTS = 2
#: Least singular value of a constraint Jacobian of full rank, over the largest.
_LOST = 1e-12
#: Values of constraints and their derivatives, over their size, that count as zero.
_NONE = 1e-9


class Tangents:
    """The linearised motion of a mechanism at one state; subclasses find ``solution`` and ``slopes``.

    Parameters
    ----------
    description
        The mechanism's.
    parameters
        The parameters by which the slopes are, in order.
    state
        The state.
    mass, jacobian
        M (n, n) and J (m, n).
    scale, columns
        Units of the constraints (m,) and of the coordinates (n,).
    redundant
        Number of constraints that follow from the others.

    Raises
    ------
    ModelError
        Where the constraints lose rank.
    """

    #: Which coordinates may be independent, for messages.
    CHOICE: ClassVar[str]
    #: Number of unknown couples by forces, whose equations are the last ones.
    couples = 0
    #: Kernels of the equations of motion, and which constraints are drives.
    model: Kernels
    driven: Sequence[int]
    #: Accelerations and multipliers, and the slopes.
    solution: Array
    slopes: StateSlopes

    def __init__(
        self,
        description: Any,
        parameters: Sequence[str],
        state: State,
        mass: Array,
        jacobian: Array,
        scale: Array,
        columns: Array,
        redundant: int,
    ) -> None:
        self.description, self.parameters, self.state = description, tuple(parameters), state
        self.mass, self.jacobian, self.scale = mass, jacobian, scale
        self.units_of_coordinates, self.redundant = columns, redundant
        self.m, self.n = jacobian.shape
        self.by_q, self.by_u = slice(self.n), slice(self.n, 2 * self.n)
        rank = self.m - redundant
        left, values, right = np.linalg.svd(jacobian / scale[:, None] * columns)
        if rank and not values[rank - 1] > _LOST * values[0]:
            raise ModelError(
                f"the constraints of {description.name} lose rank at this state, at t = {state.t:g} s: it is "
                "at a dead centre, where motions and forces have no derivatives\n"
                "  Choose a state away from it."
            )
        self._dependent = left[:, rank:]
        #: Least motions of unit constraint errors, and a basis of the motions without any.
        self.bound = columns[:, None] * ((right[:rank].T / values[:rank]) @ left[:, :rank].T)
        self.free = columns[:, None] * right[rank:].T

    @property
    def by_solution(self) -> slice:
        """The columns of slopes by accelerations and multipliers."""
        return slice(2 * self.n, 2 * self.n + len(self.solution))

    @property
    def moving(self) -> Array:
        """Rates of coordinates and velocities."""
        return np.concatenate([self.state.u, self.solution[: self.n]])

    def direct(self, slopes: Array, by: Sequence[str]) -> Array:
        """Return the columns of slopes by parameters; zeros by other quantities, which the state has."""
        known, first = self.parameters, self.by_solution.stop
        places = np.array([first + known.index(x) if x in known else -1 for x in by], dtype=np.intp)
        return np.where(places < 0, 0.0, slopes[:, places])

    def solved(self, right: Array) -> Array:
        """Return the changes of the solution for changes of the equations, the columns of ``right``.

        They are refined by residuals in long double: forces of masses of very different sizes cancel.
        """
        matrix = 0.0 - self.slopes.residual[:, self.by_solution].astype(np.longdouble)
        solution = self._solved(right.astype(float))
        for _ in range(_REFINEMENTS):
            left = right.astype(np.longdouble) - matrix @ solution
            solution = solution + self._solved(left.astype(float))
        return solution

    def _solved(self, right: Array) -> Array:
        force, gamma = right[: self.n], right[self.n :]
        a = self.bound @ (gamma / self.scale[:, None])
        reduced = self.free.T @ self.mass @ self.free
        a = a + self.free @ np.linalg.solve(reduced, self.free.T @ (force - self.mass @ a))
        return np.vstack([a, (self.bound.T @ (force - self.mass @ a)) / self.scale[:, None]])

    def check_kept(self, by: Sequence[str], slopes: Array, *changes: Array) -> None:
        """Raise ModelError for a parameter that redundant constraints, or their derivatives, do not permit.

        Their differentials, J dx + (known terms) = 0, have a solution where these are in the range of J.

        Parameters
        ----------
        by
            Names of the directions.
        slopes
            Of the constraints, or of their rates or accelerations, a row each.
        changes
            The known changes of coordinates, and of velocities, (n, directions) each.
        """
        if not self.redundant:
            return
        known = np.vstack([np.zeros((0, len(by))), *changes])
        scaled = slopes / self.scale[:, None]
        given, direct = scaled[:, : len(known)], self.direct(scaled, by)
        left = np.abs(self._dependent @ (self._dependent.T @ (given @ known + direct)))
        sizes = np.max(np.abs(given) @ np.abs(known) + np.abs(direct), axis=0, initial=0.0)
        unit = np.max(np.abs(scaled[:, self.by_q]) * self.units_of_coordinates, initial=0.0)
        allowed = _NONE * np.maximum(sizes, unit * self.least_openings(by))
        for column in map(int, np.flatnonzero(np.any(left > allowed, axis=0))):
            if by[column] in self.parameters:
                reason = self.contradicts(int(np.argmax(left[:, column])))
                raise self.refusal(f"a change of {by[column]} alone", reason)

    def refusal(self, what: str, reason: str) -> ModelError:
        """Return the error for a derivative of or by a quantity that redundant constraints fix.

        The reason counts at a state that meets these constraints.
        """
        if (gap := self.gap()) > _NONE:
            return ModelError(
                f"{self.description.name} meets its redundant constraints only to {gap:.1e} of its size at "
                f"t = {self.state.t:g} s: there are no exact derivatives for {what}\n"
                "  Runs permit a gap within analysis.assembly_tolerance; for derivatives give parameters and "
                "a state that meet these constraints exactly."
            )
        return ModelError(f"{what} {reason}")

    @property
    def motions(self) -> Array:
        """Motions that the constraints without drives permit: the free ones, and those by each drive."""
        return np.hstack([self.free, self.bound[:, self.driven]])

    def rates_along(self, motion: Array) -> Array:
        """Return the slopes of dPhi/dt, a row each, with the velocities of a motion."""
        raise NotImplementedError

    @property
    def size(self) -> float:
        """The size of the mechanism [m]."""
        return float(self.description.size)

    def gap(self) -> float:
        """Return the largest violation of the constraints, over the size of the mechanism."""
        raise NotImplementedError

    def least_openings(self, by: Sequence[str]) -> Array:
        """Return the openings of constraints, over their units, to which the part that counts as none refers.

        A mechanism that opens by its size, over a change of each parameter that is not small.
        """
        known = zip(self.description.parameters, self.model.parameter_values, strict=True)
        values = {p.name: self.size if p.unit == "m" else max(1.0, abs(x)) for p, x in known}
        return 1.0 / np.array([values.get(x, 1.0) for x in by])

    def contradicts(self, row: int) -> str:
        """Return the effect of a change that violates a redundant constraint, in words, with a remedy."""
        label = self.description.labels[row]
        return f"contradicts the redundant constraints: {label}\n  Give parameters that keep them redundant."

    def directions(self, coordinates: Sequence[str]) -> Array:
        """Return dz/dq on the free motions, (coordinates, freedoms), checked to be regular.

        Raises
        ------
        ModelError
            When the coordinates do not determine the motion.
        """
        freedoms, states = self.free.shape[1], len(self.description.integrals)
        if coordinates and not freedoms:
            raise ModelError(
                f"{self.description.name} has no degree of freedom at this state, so no independent "
                "coordinates: its drives and constraints determine the motion\n  Give no coordinates."
            )
        for name in coordinates:
            if name not in self.slopes.outputs:
                raise ModelError(
                    f"{name} is no coordinate, since it has several components\n"
                    f"  Choose some of {', '.join(self.slopes.scalars(name))}."
                )
        if len(coordinates) != freedoms:
            given, freedoms = (
                [x for x in coordinates if x not in self.description.integrals],
                freedoms - states,
            )
            got = f"{len(given)}: {', '.join(given)}" if given else "no {coordinates}"
            raise OptionsError(
                f"expected {freedoms} independent coordinate{'s' * (freedoms != 1)} of "
                f"{self.description.name}, one for each degree of freedom, got {got}\n  {self.CHOICE}"
            )
        rows = self.slopes.rows(coordinates)[:, self.by_q]
        on_free: Array = rows @ self.free
        sizes = np.linalg.norm(rows * self.units_of_coordinates, axis=1)
        constant = not np.all(sizes)
        if freedoms and (constant or np.linalg.svd(on_free / sizes[:, None])[1][-1] < _DEPENDENT):
            raise ModelError(
                f"the coordinates {', '.join(coordinates)} do not determine the motion of "
                f"{self.description.name} at this state: some combination of them is constant there\n"
                "  Choose other coordinates."
            )
        return on_free

    def mass_matrix(self, coordinates: Sequence[str]) -> Array:
        """Return the mass matrix of independent coordinates; errors as of :meth:`directions`."""
        unit = self.free @ np.linalg.inv(self.directions([*coordinates, *self.description.integrals]))
        unit = unit[:, : len(coordinates)]
        return unit.T @ self.mass @ unit

    def check_unique(self, outputs: Sequence[str]) -> None:
        """Raise ModelError for an output by forces that redundant constraints leave open."""

    def check_closed(self) -> None:
        """Raise ModelError for a state that violates the constraints."""


class LinkageTangents(Tangents):
    """The linearised motion of a linkage, or of a user-defined system.

    Parameters
    ----------
    model
        The kernels of the equations of motion.
    kernels
        Those of the analysis ``linearisation``, or ``sensitivity``.
    parameters
        The parameters that these kernels differentiate by, in order: the inputs, or all tunable ones.
    state
        The state.
    solution
        Its accelerations and multipliers.
    redundant
        Number of constraints that follow from the others.

    Raises
    ------
    ModelError
        Where the constraints lose rank.
    """

    model: Evaluator
    CHOICE = "Choose angles of links (plane), or components of positions such as A.position.x."

    def __init__(
        self,
        model: Evaluator,
        kernels: Evaluator,
        parameters: Sequence[str],
        state: State,
        solution: Array,
        redundant: int,
    ) -> None:
        self.model, d, n = model, model.description, model.description.coordinates
        self.kernels, self.driven = kernels, d.prescribed
        self.solution, self.couples = solution, len(model.couples)
        self.slopes = slopes_at(kernels, parameters, state, solution, model.couples)
        equations = 0.0 - self.slopes.residual[:, 2 * n : 2 * n + len(solution)]
        if model.couples and not np.all(np.isfinite(equations)):
            raise ModelError(
                f"{d.name} has no derivatives at t = {state.t:g} s: the force in one of the bearings with "
                "friction vanishes"
            )
        scale = np.zeros(0)
        if d.constraints:
            scale = model.blocks("constraints", state.t, state.q, state.u)["constraint_scale"]
        matrices = equations[:n, :n], equations[n : n + len(d.constraints), :n]
        super().__init__(d, parameters, state, *matrices, scale, np.ones(n), redundant)

    def _solved(self, right: Array) -> Array:
        if not self.model.couples:
            return super()._solved(right)
        return np.asarray(np.linalg.solve(-self.slopes.residual[:, self.by_solution], right), dtype=float)

    def rates_along(self, motion: Array) -> Array:
        """Return the slopes of dPhi/dt, a row each, with the velocities of a motion."""
        state = replace(self.state, u=motion)
        return slopes_at(self.kernels, self.parameters, state, self.solution, self.model.couples).rates

    @property
    def size(self) -> float:
        """The size of the linkage [m]."""
        return extent(self.model, self.state.q)

    def gap(self) -> float:
        """Return the largest violation of the constraints, over the size of the linkage."""
        return violation(self.model, self.state.t, self.state.q, self.state.u)[0] / self.size

    def least_openings(self, by: Sequence[str]) -> Array:
        """Return the openings [m] to which the part that counts as none refers."""
        return self.size * super().least_openings(by)

    def check_closed(self) -> None:
        """Raise ModelError for a state that violates the constraints."""
        if not self.m:
            return
        size = self.size
        error, rate = violation(self.model, self.state.t, self.state.q, self.state.u)
        # At rest, round-off of velocities is small compared with speeds that the forces cause within the
        # size.
        forces = self.jacobian.T @ self.solution[self.n : self.n + self.m]
        pushed = np.max(np.abs(self.solution[: self.n])) + np.max(np.abs(forces)) / np.max(np.abs(self.mass))
        speed = max(float(np.max(np.abs(self.state.u))), float(np.sqrt(size * pushed)))
        if error > CLOSED * size or rate > CLOSED * speed:
            raise ModelError(
                f"the state violates the constraints, by {error:.1e} m and {rate:.1e} m/s: "
                "independent coordinates do not describe it\n"
                "  model.rhs.project(t, y) brings a state y = (q, u) onto the constraints."
            )

    def check_unique(self, outputs: Sequence[str]) -> None:
        """Raise ModelError for an output by multipliers that redundant constraints leave open."""
        open_rows = not_unique(self.model, self.state.t, self.state.q, self.redundant)
        columns = [self.by_solution.start + self.n + i for i in open_rows]
        for name in outputs:
            if columns and np.any(self.slopes.outputs[name][columns]):
                raise ModelError(
                    f"{name} depends on forces of redundant constraints, which the motion does not "
                    f"determine: those of {', '.join(self.description.labels[i] for i in open_rows)}"
                )
