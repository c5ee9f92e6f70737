"""The equations of motion of a user-defined system, in its own coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import ModelError, check_known
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.arguments import real
from symgen.runtime.model.arguments import LinkageDerivatives, takes
from symgen.runtime.result.state import State, in_order
from symgen.runtime.rods.model.rods import RodModel

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Sensitivity


@checked
class GeneralModel(RodModel):
    """Compiled equations of motion of a System that a Python file returned, with values.

    Its coordinates are those of the System. All analyses of linkages apply but those of points and links:
    inverse dynamics and assemblies.
    """

    MISSING: ClassVar[Mapping[str, str]] = {"": "it is a user-defined system, not one of points and links"}

    def __repr__(self) -> str:
        d = self.description
        names = ", ".join(d.free)
        return (
            f"<GeneralModel {self.name!r}: {names}; {len(d.constraints)} constraints, {self.backend} backend>"
        )

    def _refused(self, name: str) -> str | None:
        if name in ("inverse_dynamics", "assemblies"):
            return self.MISSING[""]
        return super()._refused(name)

    def state(
        self,
        positions: Mapping[str, ArrayLike],
        velocities: Mapping[str, ArrayLike] | None = None,
        t: float = 0.0,
        states: Mapping[str, float] | None = None,
    ) -> State:
        """Return a state from coordinates and their rates, both by the names of the coordinates.

        Coordinates that are not given are those of the start, rates that are not given are zero.

        Raises
        ------
        ModelError
            For a name that is not that of a coordinate, or a number that is not finite.
        """
        names = self.description.free
        for name in (*positions, *(velocities or {})):
            check_known(name, names, f"{self.name} has no coordinate")
        self._of_states(states or {})

        def numbers(values: Mapping[str, ArrayLike], default: Array) -> Array:
            given = default.copy()
            for name, value in values.items():
                given[names.index(name)] = real(value, f"{self.name}: {name}")
            if not np.isfinite(given).all():
                raise ModelError(f"{self.name}: expected finite coordinates and rates, got {given.tolist()}")
            return given

        q = numbers(positions, self._stored_start().q)
        return self._state(t, q, numbers(velocities or {}, np.zeros(len(names))))

    def _coordinates(self, y: State | ArrayLike, t: ArrayLike = 0.0) -> dict[str, Any]:
        return in_order(self.description.free, y, t)

    @takes(LinkageDerivatives)
    def _sensitivity(self, request: LinkageDerivatives) -> Sensitivity:
        d = self.description
        if not (request.coordinates or d.constraints):
            request = replace(request, coordinates=d.free)
        return super()._sensitivity(request)

    def _evaluate(
        self,
        kernel: str,
        t: float = 0.0,
        q: ArrayLike | None = None,
        u: ArrayLike | None = None,
        work: ArrayLike = (),
    ) -> dict[str, Array]:
        check_known(kernel, self.operations, f"{self.name} has no kernel")
        start = self._stored_start()
        places = np.asarray(start.q if q is None else q, dtype=float)
        rates = np.asarray(start.u if u is None else u, dtype=float)
        for name, x in (("q", places), ("u", rates)):
            if x.shape != start.q.shape:
                raise ModelError(f"expected {len(start.q)} numbers for {name}, got the shape {x.shape}")
        memory = np.zeros(max(self.evaluator.work_size, np.size(work)) + 1)
        memory[: np.size(work)] = work
        return self.evaluator.blocks(kernel, t, places, rates, memory)
