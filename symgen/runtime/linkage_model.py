"""What models of linkages of points and links share: states, poses, kinematics."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import ModelError
from symgen.runtime.compiled import Compiled
from symgen.runtime.description import Description
from symgen.runtime.evaluate import Evaluator
from symgen.runtime.initial import Start
from symgen.runtime.library import Library
from symgen.runtime.state import State, coordinates
from symgen.runtime.typed import Typed

if TYPE_CHECKING:
    from symgen.runtime.bonds import Bonds
    from symgen.runtime.motion import Motion

Array = NDArray[np.float64]
#: Gives the kernels of one kind of analysis, made when first asked for.
Analyses = Callable[[str, bool], tuple[Description, Library]]


class LinkageModel(Compiled):
    """Compiled kernels of a linkage at one set of parameters."""

    description: Description

    def __init__(
        self,
        description: Description,
        library: Library,
        derive: Callable[[], Any],
        parameters: Mapping[str, float] | None = None,
        analyses: Analyses | None = None,
        typed: Typed | None = None,
    ) -> None:
        super().__init__(description, library, derive, parameters, typed)
        self._analyses = analyses
        self._evaluator = Evaluator(description, library, np.array(list(self.parameters.values())))
        self._start: Start | None = None

    def __repr__(self) -> str:
        d = self.description
        return (
            f"<{type(self).__name__} {d.name!r}: {len(d.free)} moving points, "
            f"{len(d.constraints)} constraints, {self.backend} backend>"
        )

    #: Whether its inputs alone move it; a linkage's motion is followed in time.
    is_driven = False

    @abstractmethod
    def _found(self) -> Start:
        """Return the start."""

    def initial_state(self) -> State:
        """Return the state in which a run starts.

        Raises
        ------
        InitialStateError
            When it cannot be assembled, is contradictory, or is singular.
        """
        found = self._found()
        return self._state(0.0, found.q, found.u)

    def _state(self, t: float, q: Array, u: Array) -> State:
        if not np.isfinite(t):
            raise ModelError(f"expected a finite time of the state, got {t!r}")
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
        d = self.description
        q, u = coordinates(d, positions, "positions"), coordinates(d, velocities or {}, "velocities", 0.0)
        return self._state(t, q, u)

    @property
    def evaluator(self) -> Evaluator:
        """Its kernels as functions of arrays."""
        return self._evaluator

    def analysis(self, kind: str, stepping: bool = False) -> Evaluator:
        """Return the kernels of a kind of analysis; for ``stepping`` in the type of runs, else in doubles."""
        if self._analyses is None:
            raise ModelError(
                f"{self.name} was made without the kernels of {kind}: build it with symgen.build"
            )
        return Evaluator(*self._analyses(kind, stepping), self._evaluator.given)

    def _kinematics(self) -> Bonds:
        from symgen.runtime.bonds import Bonds

        return Bonds(self._evaluator, self.analysis("kinematics"))

    def assemblies(self, t: float = 0.0) -> tuple[State, ...]:
        """Return the ways in which the driven linkage goes together at a time, the drawn one (at 0 s) first.

        They are looked for from many starting poses, the same ones every time; velocities are zero.

        Raises
        ------
        ModelError
            When freedoms are not driven; it says how many.
        """
        from symgen.runtime.assemblies import assemblies
        from symgen.runtime.kinematics import driven

        q, bonds = self.initial_state().q, self._kinematics()
        if bonds.n > bonds.m:
            driven(bonds, q, t)
        found = assemblies(bonds, q, t)
        return tuple(self._state(t, pose, np.zeros_like(pose)) for pose in found)

    def kinematics(
        self,
        start: float = 0.0,
        stop: float | None = None,
        *,
        samples: int = 181,
        of: Sequence[str] | None = None,
        state: State | None = None,
        through: bool = False,
    ) -> Motion:
        """Follow the driven linkage over a range of time, without forces: see ``docs/analyses.md``.

        Parameters
        ----------
        start, stop
            The range [s], 0 to the scene's ``t_end`` when absent. The drives are functions of the time.
        samples
            Number of equally spaced times at which poses are recorded.
        of
            Points and links (plane) to record; all that move when absent.
        state
            The assembly to follow, one of :meth:`assemblies`; the scene's own when absent.
        through
            Go on through dead centres, on the other branch and back in time, until the range is left or the
            curve closes; otherwise a branch ends at its dead centre.

        Raises
        ------
        ModelError
            When freedoms are not driven (it says how many), or for a wrong range or name.
        SimulationError
            When no pose of the range can be reached, or a drive is not smooth.
        """
        from symgen.runtime.kinematics import Task, analyse

        begin = self.initial_state() if state is None else state
        end = self.description.t_end if stop is None else float(stop)
        asked = Task(float(start), end, samples, through)
        return analyse(self._kinematics(), begin.q, begin.t, asked, of)
