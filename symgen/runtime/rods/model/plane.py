"""A linkage in space whose runs are computed in the plane in which it stays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.runtime.arrays import Array
from symgen.runtime.model.arguments import LinkageDerivatives, LinkageMotion, LinkageRun, takes
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import Accelerations, AssemblyModes, State
from symgen.runtime.rods.model.rods import RodModel

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Linearisation, Sensitivity
    from symgen.runtime.result.equilibrium import Equilibrium, Modes
    from symgen.runtime.result.motion import Motion


@checked
class PlaneModel(RodModel):
    """Compiled equations of a linkage written in space, of its motion in a plane.

    Runs and accelerations are computed in the plane, since nothing drives the motion out of it. Analyses that
    depend on all degrees of freedom (poses, equilibria and their stability, modes) use the model
    ``in_space``, which is built at the first use.
    """

    def __init__(self, *args: Any, in_space: Callable[[], RodModel], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._space_model = in_space

    @property
    def _more(self) -> dict[str, Any]:
        return {"in_space": self._space_model}

    @cached_property
    def in_space(self) -> RodModel:
        """The model with all freedoms of the linkage, at the same parameters."""
        return self._space_model().with_parameters(**self.parameters)

    def _whole(self, state: State | None) -> State | None:
        """Return a state by the coordinates in space."""
        if state is None or len(state.q) == self.in_space.description.coordinates:
            return state
        return self.in_space.state(state.positions, state.velocities, state.t, self._states_of(state))

    def _in_plane(self, state: State | None) -> State | None:
        """Return a state by the coordinates in the plane."""
        if state is None or len(state.q) == self.description.coordinates:
            return state
        return self.state(state.positions, state.velocities, state.t, self._states_of(state))

    def _coordinates(self, y: State | ArrayLike, t: ArrayLike = 0.0) -> dict[str, Any]:
        if isinstance(y, State):
            return super()._coordinates(self._in_plane(y) or y)
        return super()._coordinates(y, t)

    def _accelerations(self, state: State | None = None) -> Accelerations:
        return super()._accelerations(self._in_plane(state))

    @takes(LinkageRun)
    def _simulate(self, request: LinkageRun) -> Result:
        return super()._simulate(replace(request, state=self._in_plane(request.state)))

    def _assemblies(self, at: float | None = None, over: str | None = None) -> AssemblyModes[State]:
        return self.in_space._assemblies(at, over)

    @takes(LinkageMotion)
    def _kinematics(self, request: LinkageMotion) -> Motion:
        return self.in_space._kinematics(replace(request, state=self._whole(request.state)))

    def _equilibrium(
        self, state: State | None = None, at: float | None = None, stable: bool = True
    ) -> Equilibrium:
        return self.in_space._equilibrium(self._whole(state), at, stable)

    def _linearise(  # type: ignore[override]  # the other options pass through
        self,
        at: State | Equilibrium | None = None,
        coordinates: Sequence[str] | None = None,
        **options: Any,
    ) -> Linearisation:
        at_equilibrium = at is not None and not isinstance(at, State)
        state = at if at is None or isinstance(at, State) else at.state
        if coordinates is None:
            linearisation = super()._linearise(self._in_plane(state), **options)
        else:
            linearisation = self.in_space._linearise(self._whole(state), coordinates=coordinates, **options)
        return replace(linearisation, at_equilibrium=at_equilibrium)

    @takes(LinkageDerivatives)
    def _sensitivity(self, request: LinkageDerivatives) -> Sensitivity:
        at = self._whole(request.at) if isinstance(request.at, State) else request.at
        return self.in_space._sensitivity(replace(request, at=at))

    def _mass_matrix(self, state: State | None = None, coordinates: Sequence[str] | None = None) -> Array:
        if coordinates is None:
            return super()._mass_matrix(self._in_plane(state))
        return self.in_space._mass_matrix(self._whole(state), coordinates)

    def _jacobian(self, state: State | None = None) -> Array:
        return super()._jacobian(self._in_plane(state))

    def _modes(self, at: Equilibrium | float | None = None) -> Modes:
        return self.in_space._modes(at)
