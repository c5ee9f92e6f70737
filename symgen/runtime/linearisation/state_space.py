"""State-space models from the slopes of the equations of motion, by implicit differentiation.

The slopes are derived in :mod:`symgen.models.linearisation`. Independent coordinates z(q) with rates z' = G u
determine the motion: J dq = 0 and G dq = dz give dq, the differential of the constraints' rates and of z'
gives du, and that of the equations of motion the accelerations and multipliers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from symgen.errors import ModelError, check_known
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.redundancy import CLOSED, extent, not_unique, violation
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.record import Linearisation
from symgen.runtime.result.state import State

#: Coordinates whose directions are closer to dependent than this do not determine the motion.
_DEPENDENT = 1e-9
#: Steps of iterative refinement of solutions of the equations of motion.
_REFINEMENTS = 2
#: The part of its largest singular value at which the constraint Jacobian has lost rank.
_LOST = 1e-12


@dataclass(frozen=True, slots=True)
class StateSlopes:
    """Slopes at one state by its coordinates, velocities, solution (a, lambda), and parameters.

    ``residual`` are those of f - M a - J^T lambda and gamma - J a, ``rates`` those of dPhi/dt,
    ``constraints`` those of Phi (in kernels of sensitivities), a row each; ``outputs`` and ``values`` are
    those of the outputs by name, and their values.
    """

    residual: Array
    rates: Array
    constraints: Array
    outputs: dict[str, Array]
    values: dict[str, float]
    units: dict[str, str]

    def rows(self, names: Sequence[str]) -> Array:
        """Return the slopes of scalar outputs, a row each."""
        return np.array([self.outputs[name] for name in names]).reshape(len(names), self.residual.shape[1])

    def scalars(self, name: str) -> list[str]:
        """Return the scalars of an output: itself, or its components."""
        marks = name[len(name.rstrip("'")) :]
        whole = name.removesuffix(marks)
        components = [f"{whole}.{axis}{marks}" for axis in "xyz"]
        return [name] if name in self.outputs else [x for x in components if x in self.outputs]


class Tangents:
    """The linearised motion of a linkage at one state.

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

    def __init__(
        self,
        model: Evaluator,
        kernels: Evaluator,
        parameters: Sequence[str],
        state: State,
        solution: Array,
        redundant: int,
    ) -> None:
        self.model, self.state, self.redundant = model, state, redundant
        d = self.description = model.description
        self.n, self.m = d.coordinates, len(d.constraints)
        self.slopes = _slopes(kernels, parameters, state, solution)
        self.parameters, self.solution = tuple(parameters), solution
        n, whole = self.n, self.n + self.m
        by = 2 * n + whole
        self.by_q, self.by_u = slice(n), slice(n, 2 * n)
        self.by_solution, self._first = slice(2 * n, by), by
        equations = 0.0 - self.slopes.residual[:, self.by_solution]
        self.mass, self.jacobian = equations[:n, :n], equations[n:, :n]
        self.scale = (
            model.blocks("constraints", state.t, state.q, state.u)["constraint_scale"]
            if self.m
            else np.zeros(0)
        )
        rank = self.m - redundant
        left, values, right = np.linalg.svd(self.jacobian / self.scale[:, None])
        if rank and not values[rank - 1] > _LOST * values[0]:
            raise ModelError(
                f"the constraints of {d.name} lose rank at this state, at t = {state.t:g} s: it is at a dead "
                "centre, where motions and forces have no derivatives\n  Choose a state away from it."
            )
        #: Minimum-norm motions of unit constraint errors, and a basis of the motions without any.
        self.bound = (right[:rank].T / values[:rank]) @ left[:, :rank].T
        self.free = right[rank:].T

    @property
    def moving(self) -> Array:
        """Rates of coordinates and velocities."""
        return np.concatenate([self.state.u, self.solution[: self.n]])

    def columns(self, parameters: Sequence[str]) -> list[int]:
        """Return the columns of slopes by parameters."""
        return [self._first + self.parameters.index(name) for name in parameters]

    def solved(self, right: Array) -> Array:
        """Return the solutions of [M J^T; J 0] w = b for the columns of ``right``.

        They are refined by residuals in long double: forces of masses of very different sizes cancel.
        """
        matrix = np.block([[self.mass, self.jacobian.T], [self.jacobian, np.zeros((self.m, self.m))]])
        solution = self._solved(right.astype(float))
        for _ in range(_REFINEMENTS):
            left = right.astype(np.longdouble) - matrix.astype(np.longdouble) @ solution
            solution = solution + self._solved(left.astype(float))
        return solution

    def _solved(self, right: Array) -> Array:
        force, gamma = right[: self.n], right[self.n :]
        a = self.bound @ (gamma / self.scale[:, None])
        reduced = self.free.T @ self.mass @ self.free
        a = a + self.free @ np.linalg.solve(reduced, self.free.T @ (force - self.mass @ a))
        return np.vstack([a, (self.bound.T @ (force - self.mass @ a)) / self.scale[:, None]])

    def directions(self, coordinates: Sequence[str]) -> Array:
        """Return dz/dq on the free motions, (coordinates, freedoms), checked to be regular.

        Raises
        ------
        ModelError
            When the coordinates do not determine the motion.
        """
        freedoms = self.free.shape[1]
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
            raise ModelError(
                f"expected {freedoms} independent coordinates of {self.description.name}, one for each "
                f"degree of freedom, got {len(coordinates)}: {', '.join(coordinates) or 'none'}\n"
                "  Choose angles of links (plane), or components of positions such as A.position.x."
            )
        rows = self.slopes.rows(coordinates)[:, self.by_q]
        on_free: Array = rows @ self.free
        sizes = np.linalg.norm(rows, axis=1)
        constant = not np.all(sizes)
        if freedoms and (constant or np.linalg.svd(on_free / sizes[:, None])[1][-1] < _DEPENDENT):
            raise ModelError(
                f"the coordinates {', '.join(coordinates)} do not determine the motion of "
                f"{self.description.name} at this state: some combination of them is constant there\n"
                "  Choose other coordinates."
            )
        return on_free

    def independent(self, coordinates: Sequence[str]) -> tuple[Array, Array]:
        """Return dq and du by (z, z'), each (n, 2 coordinates); errors as of :meth:`directions`.

        Raises
        ------
        ModelError
            When the state violates the constraints.
        """
        self.check_closed()
        inverse = np.linalg.inv(self.directions(coordinates))
        unit = self.free @ inverse
        places, rates = self.slopes.rows(coordinates), self.slopes.rows([f"{x}'" for x in coordinates])
        forced = self.bound @ (-self.slopes.rates[:, self.by_q] @ unit / self.scale[:, None])
        left = -rates[:, self.by_q] @ unit - places[:, self.by_q] @ forced
        turned = forced + unit @ left
        return np.hstack([unit, np.zeros_like(unit)]), np.hstack([turned, unit])

    def mass_matrix(self, coordinates: Sequence[str]) -> Array:
        """Return the mass matrix of independent coordinates; errors as of :meth:`directions`."""
        unit = self.free @ np.linalg.inv(self.directions(coordinates))
        return unit.T @ self.mass @ unit

    def check_closed(self) -> None:
        """Raise ModelError for a state that violates the constraints."""
        if not self.m:
            return
        size = extent(self.model, self.state.q)
        error, rate = violation(self.model, self.state.t, self.state.q, self.state.u)
        # At rest, round-off of velocities is small compared with speeds that the forces cause within the
        # size.
        forces = self.jacobian.T @ self.solution[self.n :]
        pushed = np.max(np.abs(self.solution[: self.n])) + np.max(np.abs(forces)) / np.max(np.abs(self.mass))
        speed = max(float(np.max(np.abs(self.state.u))), float(np.sqrt(size * pushed)))
        if error > CLOSED * size or rate > CLOSED * speed:
            raise ModelError(
                f"the state violates the constraints, by {error:.1e} m and {rate:.1e} m/s: "
                "independent coordinates do not describe it\n"
                "  model.rhs.project(t, y) brings a state y = (q, u) onto the constraints."
            )


def state_space(
    tangents: Tangents,
    coordinates: Sequence[str],
    independent: bool,
    inputs: Mapping[str, float],
    outputs: Sequence[str],
) -> Linearisation:
    """Return the state-space model of these coordinates, of inputs with their values, and of outputs.

    Parameters
    ----------
    tangents
        The linearised motion, with kernels of ``derivatives(coordinates)`` and of the outputs.
    independent
        Whether the coordinates are independent; otherwise they are those of all moving points.

    Raises
    ------
    ModelError
        As :meth:`Tangents.independent`; for forces that redundant constraints leave open; for Cartesian
        coordinates of redundant constraints.
    """
    slopes, d, n = tangents.slopes, tangents.description, tangents.n
    if tangents.redundant and not independent:
        raise ModelError(
            f"the constraints of {d.name} are redundant, so that they contradict each other where Cartesian "
            "coordinates deviate one by one\n  Give independent coordinates."
        )
    dq, du = tangents.independent(coordinates) if independent else (np.eye(n, 2 * n), np.eye(n, 2 * n, n))
    moved = slopes.residual[:, tangents.by_q] @ dq + slopes.residual[:, tangents.by_u] @ du
    chosen = tangents.columns([*inputs])
    dw, driven = tangents.solved(moved), tangents.solved(slopes.residual[:, chosen])
    k = len(coordinates)

    def linear(names: Sequence[str]) -> tuple[Array, Array]:
        rows = slopes.rows(names)
        by = rows[:, tangents.by_solution]
        state = rows[:, tangents.by_q] @ dq + rows[:, tangents.by_u] @ du + by @ dw
        return state, by @ driven + rows[:, chosen]

    shown = [x for name in outputs for x in slopes.scalars(name)]
    check_unique(tangents, shown)
    second, by_inputs = linear([f"{name}''" for name in coordinates])
    c, direct = linear(shown)
    x, first, accelerations, y = (
        np.array([slopes.values[f"{name}{mark}"] for name in of])
        for of, mark in ((coordinates, ""), (coordinates, "'"), (coordinates, "''"), (shown, ""))
    )
    states = (*coordinates, *(f"{name}'" for name in coordinates))
    units = {name: slopes.units[name] for name in (*states, *shown)}
    return Linearisation(
        A=np.vstack([np.hstack([np.zeros((k, k)), np.eye(k)]), second]),
        B=np.vstack([np.zeros((k, len(inputs))), by_inputs]),
        C=c,
        D=direct,
        states=states,
        inputs=tuple(inputs),
        outputs=tuple(shown),
        units=units | {p.name: p.unit for p in d.tunable if p.name in inputs},
        t=tangents.state.t,
        x=np.concatenate([x, first]),
        u=np.array([*inputs.values()], dtype=float),
        y=y,
        rates=np.concatenate([first, accelerations]),
    )


def derivatives(d: Description, coordinates: Sequence[str]) -> list[str]:
    """Return the outputs that coordinates need: themselves and their first two derivatives.

    Raises
    ------
    ModelError
        For a name that is not that of a quantity of a point or a link, or of a user's coordinate.
    """
    for name in coordinates:
        if d.rates:
            check_known(name, d.free, f"{d.name} has no coordinate")
            continue
        owner, dot, rest = name.partition(".")
        if not dot or owner not in (*d.points, *d.links) or rest in d.axes:
            links = f", or the angle of a link: {', '.join(d.links)}" if len(d.axes) == 2 else ""
            raise ModelError(
                f"expected independent coordinates of {d.name}, got {name!r}\n  A coordinate is a "
                f"component of the position of a point, such as "
                f"{owner if owner in d.points else d.points[-1]}.position.x: "
                f"{', '.join(d.points)}{links}."
            )
    return [f"{name}{mark}" for name in coordinates for mark in ("", "'", "''")]


def check_unique(tangents: Tangents, outputs: Sequence[str]) -> None:
    """Raise ModelError for an output by multipliers that redundant constraints leave open."""
    open_rows = not_unique(tangents.model, tangents.state.t, tangents.state.q, tangents.redundant)
    columns = [tangents.by_solution.start + tangents.n + i for i in open_rows]
    for name in outputs:
        if columns and np.any(tangents.slopes.outputs[name][columns]):
            raise ModelError(
                f"{name} depends on forces of redundant constraints, which the motion does not determine: "
                f"those of {', '.join(tangents.description.labels[i] for i in open_rows)}"
            )


def _slopes(kernels: Evaluator, parameters: Sequence[str], state: State, solution: Array) -> StateSlopes:
    """Return the slopes at a state as dense rows."""
    d = kernels.description
    bound = [f"{c}_lambda" for c in d.constraints]
    unknowns = [*d.of_coordinates("a"), *bound]
    columns = [*d.of_coordinates(), *d.of_coordinates("v"), *unknowns, *parameters, "t"]
    work = np.zeros(kernels.work_size + len(solution) + 1)
    work[: len(solution)] = solution
    at = state.t, state.q, state.u, work
    infos = {b.name: b for b in kernels.info("values").blocks} if kernels.has("values") else {}
    values = {infos[k].about: float(v[0]) for k, v in kernels.blocks("values", *at).items()} if infos else {}
    rows = {"residual": unknowns, "rates": bound, "constraints": bound, "outputs": list(values)}
    matrices = {name: np.zeros((len(labels), len(columns))) for name, labels in rows.items()}
    entries = kernels("slopes", *at)
    for block in kernels.info("slopes").blocks:
        for row, column, place in block.places(rows[block.name], columns):
            matrices[block.name][row, column] = entries[place]
    outputs = dict(zip(values, matrices["outputs"], strict=True))
    units = {b.about: b.unit for b in infos.values()}
    return StateSlopes(
        matrices["residual"], matrices["rates"], matrices["constraints"], outputs, values, units
    )
