"""A linkage in space whose runs are computed in the plane in which it stays."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

from symgen.runtime.model import Model
from symgen.runtime.result import Result
from symgen.runtime.state import Accelerations, State

if TYPE_CHECKING:
    from symgen.runtime.equilibrium import Equilibrium
    from symgen.runtime.forces import Forces
    from symgen.runtime.modes import Modes
    from symgen.runtime.motion import Motion


class ModelInItsPlane(Model):
    """Compiled equations of a linkage written in space, of its motion in a plane.

    Runs and accelerations are those in the plane: nothing drives the motion across it. What asks for freedoms
    rather than for a motion (poses, equilibria and their stability, modes) is answered by the model in
    ``in_space``, which knows those across the plane too and is made when it is first needed.
    """

    def __init__(self, *args: Any, in_space: Callable[[], Model], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._made_in_space = in_space

    def with_parameters(self, **values: float) -> Model:
        """Return the same model with other values of its tunable parameters, in SI units."""
        changed = {**self.parameters, **values}
        return ModelInItsPlane(
            self.description,
            self._library,
            self._derive,
            changed,
            self._analyses,
            self._typed,
            in_space=self._made_in_space,
        )

    @cached_property
    def in_space(self) -> Model:
        """The model with all freedoms of the linkage, at the same parameters."""
        return self._made_in_space().with_parameters(**self.parameters)

    def _whole(self, state: State | None) -> State | None:
        """Return a state by the coordinates in space."""
        if state is None or len(state.q) == self.in_space.description.coordinates:
            return state
        return self.in_space.state(state.positions, state.velocities, state.t)

    def _own(self, state: State | None) -> State | None:
        """Return a state by the coordinates in the plane."""
        if state is None or len(state.q) == self.description.coordinates:
            return state
        return self.state(state.positions, state.velocities, state.t)

    def accelerations(self, state: State | None = None) -> Accelerations:
        """Return accelerations, multipliers and reactions at a state: see :meth:`Model.accelerations`."""
        return super().accelerations(self._own(state))

    def simulate(self, t_end: float | None = None, *, state: State | None = None, **options: Any) -> Result:
        """Run the motion and return its result: see :meth:`Model.simulate`."""
        return super().simulate(t_end, state=self._own(state), **options)

    def assemblies(self, t: float = 0.0) -> tuple[State, ...]:
        """Return the ways in which the linkage goes together in space: see :meth:`Model.assemblies`."""
        return self.in_space.assemblies(t)

    def kinematics(self, *range_: Any, state: State | None = None, **options: Any) -> Motion:
        """Follow the driven linkage in space: see :meth:`Model.kinematics`."""
        return self.in_space.kinematics(*range_, state=self._whole(state), **options)

    def forces(self, *range_: Any, state: State | None = None, **options: Any) -> Forces:
        """Return joint forces of the linkage in space: see :meth:`Model.forces`."""
        return self.in_space.forces(*range_, state=self._whole(state), **options)

    def equilibrium(self, *, state: State | None = None, **options: Any) -> Equilibrium:
        """Return an equilibrium, stable in space where that is asked: see :meth:`Model.equilibrium`."""
        return self.in_space.equilibrium(state=self._whole(state), **options)

    def modes(self, about: Equilibrium | None = None) -> Modes:
        """Return frequencies and shapes, those across the plane too: see :meth:`Model.modes`."""
        return self.in_space.modes(about)
