"""Common base of models of linkages of points and links: states, poses, kinematics."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import ModelError, check_known
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.causes import MORE_DRIVES
from symgen.runtime.integrate.pace import uncounted
from symgen.runtime.kernels.arguments import real
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.library import Library
from symgen.runtime.model.arguments import LinkageMotion, takes
from symgen.runtime.model.model import Model
from symgen.runtime.result.state import AssemblyModes, State, by_name, coordinates, parts_of, state_at
from symgen.runtime.rods.assembly.stated import moved
from symgen.runtime.rods.start import Start

if TYPE_CHECKING:
    from symgen.runtime.many.dataset import CompiledRuns
    from symgen.runtime.many.runs import Runs
    from symgen.runtime.result.motion import Motion
    from symgen.runtime.rods.constraints import Constraints


@checked
class LinkageModel(Model):
    """Compiled kernels of a linkage at one set of parameters."""

    description: Description

    _start: Start | None = None

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        if self.description.kernel("run_end"):
            rest, parameters = np.zeros(self.description.coordinates), np.array(self.parameter_values)
            evaluator = Evaluator(self.description, self.library, parameters)
            (end,) = evaluator.blocks("run_end", 0.0, rest, rest)["t_end"]
            self.description = replace(self.description, t_end=float(end))

    @cached_property
    def _of_analyses(self) -> dict[tuple[str, bool, tuple[str, ...]], Evaluator]:
        return {}

    @cached_property
    def evaluator(self) -> Evaluator:
        """Its kernels as functions of arrays."""
        return Evaluator(self.description, self.library, np.array(self.parameter_values))

    def __repr__(self) -> str:
        d = self.description
        return (
            f"<{type(self).__name__} {d.name!r}: {len(d.free)} moving points, "
            f"{len(d.constraints)} constraints, {self.backend} backend>"
        )

    #: Whether inputs alone move the mechanism; the motion of a linkage is followed in time.
    is_driven = False

    @property
    def _probed(self) -> bool:  # type: ignore[override]
        d = self.description
        return any(e.probed for e in d.events) or (bool(d.switches) and not d.series_watched)

    @abstractmethod
    def _begun(self) -> Start:
        """Find the start at the parameters of the model."""

    def _assembled(self) -> Start:
        """Return the start: the stored one, unless a parameter has changed. It may not rest yet."""
        if self._start is None:
            d = self.description
            if self.is_changed or not d.start:
                self._start = self._begun()
                notes = tuple(moved(self.evaluator, self._start.q))
                if notes != d.start_remarks:
                    self._note(notes)
            else:
                q, u = np.split(np.array(d.start), 2)
                self._start = Start(q, u, d.redundant, d.rank_tolerance)
        return self._start

    def _stored_start(self) -> Start:
        """Return the start, or the equilibrium near it if the scene requests one."""
        begun = self._assembled()
        if self.description.at_equilibrium and begun.rest is None:
            from symgen.runtime.rods.equilibrium import remarks, resting

            begun = resting(self, begun)
            self._note(remarks(begun.rest))
            self._start = begun
        return begun

    def _note(self, notes: Iterable[str]) -> None:
        """Replace the remarks on the start; runs in other threads keep their kernels."""
        self.description = replace(self.description, start_remarks=tuple(notes))
        self.evaluator = Evaluator(self.description, self.library, self.evaluator.parameter_values)

    def initial_state(self) -> State:
        """Return the state in which a run starts.

        Raises
        ------
        InitialStateError
            When the state cannot be assembled, is contradictory, or is singular; when no equilibrium is
            found where the scene requests one.
        """
        start = self._stored_start()
        if start.rest:
            return start.rest.state
        return self._state(0.0, start.q, start.u, np.zeros(self.description.windings))

    def _state(self, t: float, q: Array, u: Array, references: Array | None = None) -> State:
        if not np.isfinite(t):
            raise ModelError(f"expected a finite time of the state, got {t!r}")
        return state_at(self.evaluator, t, q, u, references)

    def state(
        self,
        positions: Mapping[str, ArrayLike],
        velocities: Mapping[str, ArrayLike] | None = None,
        t: float = 0.0,
        states: Mapping[str, float] | None = None,
    ) -> State:
        """Return a state from the positions [m] and velocities [m/s] of the moving points, by name.

        Points without an entry in ``velocities`` are at rest; ground points are ignored. The state is not
        changed: :meth:`Model.simulate` projects it onto the constraints, :meth:`Model.accelerations` does
        not.

        Instead of points, both may name independent coordinates as in :meth:`Model.linearise`, such as
        ``crank.angle`` [rad]: the linkage is moved there from its start, on its assembly branch, by less than
        half a revolution of each angle. Where loads count revolutions, angles beyond are refused.
        ``states`` are first-order states by name; omitted ones are those of the start.

        Raises
        ------
        ModelError
            For missing or unknown names, numbers that are not finite, and coordinates that do not determine
            the pose or cannot be reached.
        """
        d, references = self.description, None
        given, rates = self._of_states(states or {}), velocities or {}
        if any("." in name for name in positions):
            integrals = dict.fromkeys(d.integrals, 0.0)
            q, u, references = self._placed({**positions, **integrals}, rates, t)
        else:
            q = np.append(coordinates(d, positions, "positions", "m"), np.zeros(len(given)))
            u = np.append(coordinates(d, rates, "velocities", "m/s", 0.0), given)
        u[d.of_points :] = given
        return self._state(t, q, u, references)

    def _states_of(self, state: State) -> dict[str, float]:
        """Return the first-order states of a state, in the plane or in space."""
        names = self.description.states
        return dict(zip(names, state.u[max(0, len(state.u) - len(names)) :].tolist(), strict=False))

    def _of_states(self, values: Mapping[str, float]) -> Array:
        """Return the first-order states in order: those given, and the others of the start."""
        d = self.description
        for name in values:
            check_known(name, d.states, f"{self.name} has no state")
        first = np.zeros(len(d.states))
        if not set(d.states) <= set(values):
            first = self._stored_start().u[d.of_points :]
        pairs = zip(d.states, first, strict=True)
        return np.array([real(values.get(name, x), f"{self.name}: {name}") for name, x in pairs])

    def _placed(
        self, values: Mapping[str, ArrayLike], rates: Mapping[str, ArrayLike], t: float
    ) -> tuple[Array, Array, Array]:
        """Return coordinates, velocities and references of angles in loads at given coordinates."""
        raise ModelError(
            f"{self.name} has no independent coordinates: expected points, got {', '.join(values)}"
        )

    def _coordinates(self, y: State | ArrayLike, t: ArrayLike = 0.0) -> dict[str, Any]:
        q, u, times = parts_of(y, t, self.description.coordinates, self.description.windings)
        rows = self.evaluator.many_blocks("points", times, np.atleast_2d(q), np.atleast_2d(u))
        d = self.description
        return by_name(
            d, rows["positions"], rows["velocities"], np.atleast_2d(u)[:, d.of_points :], q.ndim == 1
        )

    def analysis(self, kind: str, stepping: bool = False, outputs: tuple[str, ...] = ()) -> Evaluator:
        """Return the kernels of a kind of analysis.

        ``stepping`` selects the number type of runs, else doubles; ``outputs`` are those of the analysis.
        """
        key = kind, stepping, outputs
        if key not in self._of_analyses:
            self._of_analyses[key] = Evaluator(*self._kernels_of(*key), self.evaluator.parameter_values)
        return self._of_analyses[key]

    def in_lanes(self, kind: str) -> tuple[Description, Library]:
        """Return the kernels of a kind of analysis that take vectors, in doubles; see :meth:`analysis`."""
        return self._kernels_of(kind, False, (), True)

    def _kernels_of(
        self, kind: str, stepping: bool, outputs: tuple[str, ...], lanes: bool = False
    ) -> tuple[Description, Library]:
        if self._analyses is None:
            raise ModelError(
                f"{self.name} was created without the kernels of {kind}: build it with symgen.build"
            )
        if not kind.isidentifier():  # it becomes part of the name of a folder
            raise ModelError(f"there is no analysis {kind!r}")
        with uncounted():
            return self._analyses(kind, stepping, outputs, lanes)

    def constraints(self) -> Constraints:
        """Return the constraints and drives, with the kernels by which they are followed."""
        from symgen.runtime.rods.constraints import Constraints

        return Constraints(self.evaluator, self.analysis("kinematics"))

    def _refused(self, name: str) -> str | None:
        if name in ("equilibrium", "linearise", "modes", "sensitivity") and self.evaluator.efforts:
            return (
                "its motions are kept by unknown efforts, whose slopes are not derived\n"
                '  Give torques and forces in place of "?", and leave out [[motions]].'
            )
        driven = name in ("kinematics", "inverse_dynamics", "assemblies")
        if driven and self.description.states:
            return (
                "drives do not determine its [states]\n"
                '  Run it, or write kind = "kinematics" under [analysis], which omits loads and states.'
            )
        if driven and (missing := self.description.freedom) > 0:
            return (
                f"it has more degrees of freedom than drives and needs {missing} more "
                f"drive{'s' if missing > 1 else ''}\n  {MORE_DRIVES}"
            )
        if name == "inverse_dynamics" and self.description.plane:
            return (
                "it is written in space and derived in the plane in which it moves\n"
                "  Write its points with two coordinates, or run it."
            )
        if name == "inverse_dynamics" and len(self.description.axes) > 2 and not self.description.selects:
            return (
                "in space it computes the outputs that the scene selects, and this one selects none\n"
                "  Write LINK.POINT.force, POINT.reaction, LINK.torque and others under [analysis] outputs, "
                "or after --of."
            )
        return super()._refused(name)

    def _assemblies(self, at: float | None = None, over: str | None = None) -> AssemblyModes[State]:
        from symgen.runtime.model.instants import instants
        from symgen.runtime.rods.assemblies import assemblies

        t, q, constraints = 0.0, self.initial_state().q, self.constraints()
        if at is not None:
            requested = instants(None, None, at, over or "input", 2, self.description.t_end)
            t = float(requested.times(self.name, constraints.driving)[0])
        poses, incomplete = assemblies(constraints, q, t)
        return AssemblyModes((self._state(t, pose, np.zeros_like(pose)) for pose in poses), incomplete)

    @takes(LinkageMotion)
    def _kinematics(self, request: LinkageMotion) -> Motion:
        from symgen.runtime.rods.kinematics import analyse

        begin = self.initial_state() if request.state is None else request.state
        poses = request.instants(self.description.t_end)
        return analyse(self.constraints(), begin, poses, request.through, request.of)

    def _compiled_runs(self, runs: Runs, first: Any) -> CompiledRuns | str:
        from symgen.runtime.rods.many.compiled import compiled_runs

        return compiled_runs(self, first, runs.columns, runs.states, runs.arguments)

    def _driven_runs(self, runs: Runs) -> CompiledRuns | None:
        from symgen.runtime.rods.many.driven import driven_runs

        forces = runs.analysis == "inverse_dynamics"
        return driven_runs(self, forces, runs.columns, runs.states, runs.arguments)
