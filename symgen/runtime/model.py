"""A compiled model: what a user holds in hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import InitialStateError, ModelError, nearest
from symgen.runtime import _core
from symgen.runtime.causes import without_direction
from symgen.runtime.description import Description
from symgen.runtime.evaluate import Evaluator
from symgen.runtime.initial import not_positive, start
from symgen.runtime.library import Library
from symgen.runtime.result import Result
from symgen.runtime.simulate import equations_of, options, run, weakest_name
from symgen.runtime.state import Accelerations, State

Array = NDArray[np.float64]


class Model:
    """Compiled equations of one scene.

    Made by :func:`symgen.build`. Parameters that the scene declares tunable can be changed with
    :meth:`with_parameters` without compiling again.
    """

    def __init__(
        self,
        description: Description,
        library: Library,
        derive: Callable[[], Any],
        parameters: Mapping[str, float] | None = None,
    ) -> None:
        self.description, self._library, self._derive = description, library, derive
        self.parameters: dict[str, float] = {p.name: p.default for p in description.parameters}
        for name, value in (parameters or {}).items():
            if name not in self.parameters:
                raise ModelError(
                    f"{self.name} has no tunable parameter {name!r}. {nearest(name, self.parameters)}"
                )
            if not np.isfinite(value):
                raise ModelError(f"expected a finite value for {name}, got {value!r}")
            self.parameters[name] = float(value)
        self._evaluator = Evaluator(description, library, np.array(list(self.parameters.values())))
        self._start: tuple[Array, Array] | None = None
        self._equations: Any = None

    @property
    def name(self) -> str:
        """Short name of the scene."""
        return self.description.name

    @property
    def backend(self) -> str:
        """Where the kernels come from: ``c`` (compiled for the scene), ``shipped`` or ``numpy``."""
        return self._library.backend

    @property
    def equations(self) -> Any:
        """The derived SymPy matrices by name: ``model.equations["constraint_jacobian"]``."""
        if self._equations is None:
            self._equations = self._derive()
        return self._equations

    @property
    def operations(self) -> dict[str, dict[str, int]]:
        """Operations of each kernel by kind."""
        return {k.name: dict(k.operations) for k in self.description.kernels}

    def __repr__(self) -> str:
        d = self.description
        return (
            f"<Model {d.name!r}: {len(d.free)} moving points, {len(d.constraints)} constraints, "
            f"{self.backend} backend>"
        )

    def with_parameters(self, **values: float) -> Model:
        """Return the same model with other values of its tunable parameters, in SI units."""
        return Model(self.description, self._library, self._derive, {**self.parameters, **values})

    def initial_state(self) -> State:
        """Return the state in which a run starts.

        Raises
        ------
        InitialStateError
            When it cannot be assembled, is contradictory, or is singular.
        """
        if self._start is None:
            changed = any(self.parameters[p.name] != p.default for p in self.description.parameters)
            if changed or not self.description.start:
                self._start = start(self._evaluator)
            else:
                stored = np.array(self.description.start)
                self._start = stored[: len(stored) // 2], stored[len(stored) // 2 :]
            self._check(*self._start)
        return self._state(0.0, *self._start)

    def _check(self, q: Array, u: Array) -> None:
        d = self.description
        equations = equations_of(self._evaluator)
        status = equations.check(0.0, np.concatenate([q, u, [0.0, 0.0]]))
        if status == _core.DONE:
            line = without_direction(self._evaluator, 0.0, q, u)
            if line:
                raise InitialStateError(f"{line}\n  Draw its points apart.", where="springs")
            return
        weakest = equations.weakest
        if status == _core.NOT_FINITE or weakest < d.coordinates:
            raise not_positive(self._evaluator)
        zero = np.zeros(d.coordinates)
        jacobian = self._evaluator("constraint_jacobian", 0.0, q, zero).reshape(-1, d.coordinates)
        scale = self._evaluator.blocks("constraints", 0.0, q, zero)["constraint_scale"]
        rank = int(np.linalg.matrix_rank(jacobian / scale[:, None], tol=1e-9))
        name = weakest_name(weakest, d)
        raise InitialStateError(
            f"the constraints are singular at the start: {len(d.constraints)} constraints of rank {rank}; "
            f"{name} is not independent of the others\n"
            "  Remove a redundant link, or start away from the dead centre.",
            where=f"links.{d.constraints[weakest - d.coordinates]}",
        )

    def _state(self, t: float, q: Array, u: Array) -> State:
        parts = self._evaluator.blocks("points", t, q, u)
        named = [
            dict(zip(self.description.points, parts[k], strict=True)) for k in ("positions", "velocities")
        ]
        return State(t, q.copy(), u.copy(), *named)

    def state(
        self,
        positions: Mapping[str, ArrayLike],
        velocities: Mapping[str, ArrayLike] | None = None,
        t: float = 0.0,
    ) -> State:
        """Return a state from the positions [m] and velocities [m/s] of the moving points, by name.

        Points left out of ``velocities`` are at rest; ground points may be given and are ignored. The state
        is taken as it is: :meth:`simulate` projects it onto the constraints, :meth:`accelerations` does not.
        """
        return self._state(
            t, self._vector(positions, "positions"), self._vector(velocities or {}, "velocities", 0.0)
        )

    def _vector(self, values: Mapping[str, ArrayLike], what: str, default: float | None = None) -> Array:
        d = self.description
        for name in values:
            if name not in d.points:
                raise ModelError(f"{what}: there is no point {name!r}. {nearest(name, d.points)}")
        parts = []
        for point in d.free:
            if point not in values and default is None:
                raise ModelError(f"{what}: the point {point} is missing")
            component = np.asarray(values.get(point, np.full(len(d.axes), default)), dtype=float)
            if component.shape != (len(d.axes),) or not np.all(np.isfinite(component)):
                raise ModelError(
                    f"{what}: expected {len(d.axes)} finite numbers for {point}, got {values[point]!r}"
                )
            parts.append(component)
        return np.concatenate(parts)

    def accelerations(self, state: State | None = None) -> Accelerations:
        """Return accelerations by point, multipliers and ground reactions by name, at a state.

        Raises
        ------
        ModelError
            When the constraints have lost rank there, so that no finite answer exists.
        """
        d = self.description
        state = self.initial_state() if state is None else state
        n = d.coordinates
        solution = self._evaluator("accelerations", state.t, state.q, state.u)
        if not np.all(np.isfinite(solution)):
            line = without_direction(self._evaluator, state.t, state.q, state.u)
            raise ModelError(
                f"the equations of motion are singular at t = {state.t:g} s: no finite accelerations"
                f"{f'; {line}' if line else ''}"
            )
        work = np.append(solution, 0.0)
        of_points = self._evaluator.blocks("point_accelerations", state.t, state.q, state.u, work)
        points = dict(zip(d.points, of_points["point_accelerations"], strict=True))
        reactions = {}
        if self._evaluator.has("reactions"):
            found = self._evaluator.blocks("reactions", state.t, state.q, state.u, work)
            rows = found["reactions"].reshape(len(d.ground), len(d.axes))
            reactions = dict(zip(d.ground, rows, strict=True))
        return Accelerations(points, dict(zip(d.constraints, solution[n:].tolist(), strict=True)), reactions)

    def simulate(
        self,
        t_end: float | None = None,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        samples: int = 201,
        max_steps: int = 1_000_000_000,
        state: State | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Result:
        """Run the motion and return its result.

        Parameters
        ----------
        t_end
            End of the run [s]; the scene's own when absent.
        method
            An integrator's name; ``dop853`` when absent, ``rk4`` when only ``step`` is given.
        rtol, atol
            Tolerances of the local error for methods that adapt their step: relative (1e-9), absolute in m
            and m/s (rtol/1000).
        step
            The fixed step [s] for methods that have one.
        samples
            Number of equally spaced times at which the outputs are recorded.
        max_steps
            A run that needs more steps ends with an error.
        state
            Where to start; :meth:`initial_state` when absent.
        progress
            Called now and then with the part of the run that is done.

        Raises
        ------
        ModelError
            For options out of range.
        SimulationError
            When the run cannot go on; it carries the time and what was recorded.
        """
        end = self.description.t_end if t_end is None else float(t_end)
        chosen = options(end, method, rtol, atol, step, samples, max_steps)
        begin = self.initial_state() if state is None else state
        return run(self._evaluator, begin.t, begin.q, begin.u, chosen, progress)
