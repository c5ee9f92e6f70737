"""User-defined systems: compiled kernels, which are called by name, or the equations of a motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import ModelError, check_known
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.arguments import real
from symgen.runtime.kernels.evaluate import as_taken, part
from symgen.runtime.kernels.system_description import SystemDescription
from symgen.runtime.model.arguments import LinkageDerivatives, takes
from symgen.runtime.model.model import Model
from symgen.runtime.model.rods import RodModel
from symgen.runtime.result.state import State

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Sensitivity


@checked
class SystemModel(Model):
    """Kernels of a System that a Python file returned."""

    description: SystemDescription
    MISSING: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("", "batch"),
        "it is a user-defined system without values, of which symgen knows the kernels only\n"
        "  model.evaluate(kernel, ...) calls them; values=... in its System makes it move.",
    )

    def __repr__(self) -> str:
        return f"<SystemModel {self.name!r}: {', '.join(self.operations)}, {self.backend} backend>"

    def with_parameters(self, /, **values: float) -> Self:
        """Return the same model; raise ModelError for any value: parameters are arguments of the kernels."""
        if values:
            raise ModelError(f"{self.name} has no tunable parameters: give the values of p to model.evaluate")
        return self

    def _evaluate(
        self,
        kernel: str,
        t: float = 0.0,
        q: ArrayLike = (),
        u: ArrayLike = (),
        p: ArrayLike = (),
        work: ArrayLike = (),
    ) -> dict[str, Array]:
        check_known(kernel, self.operations, f"{self.name} has no kernel")
        info = next(k for k in self.description.kernels if k.name == kernel)
        memory = np.zeros(max(info.work_size, self.description.size("work")) + 1)
        if np.size(work):
            memory[: self.description.size("work")] = self._array("work", work)[:-1]
        out = np.zeros(info.out_size + 1)
        parameters = as_taken(self._library, self._array("p", p)[:-1])
        arrays = self._array("q", q), self._array("u", u), parameters
        sizes, address = self.description.sizes_of(kernel), self._library.addresses[kernel]
        _core.call(address, sizes, np.array([float(t)]), *arrays, memory, out)
        return {b.name: part(out, b) for b in info.blocks}

    def _array(self, name: str, values: ArrayLike) -> Array:
        size = self.description.size(name)
        try:
            array = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            array = np.zeros((0, 0))
        if array.shape != (size,):
            info = self.description.arrays.get(name)
            names = f" ({', '.join(info.names)})" if info else ""
            raise ModelError(f"expected {size} numbers for {name}{names}, got the shape {np.shape(values)}")
        if not np.isfinite(array).all():
            raise ModelError(f"expected finite numbers for {name}, got {array.tolist()}")
        return np.append(array, 0.0)


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

        def numbers(values: Mapping[str, ArrayLike], default: Array) -> Array:
            given = default.copy()
            for name, value in values.items():
                given[names.index(name)] = real(value, f"{self.name}: {name}")
            if not np.isfinite(given).all():
                raise ModelError(f"{self.name}: expected finite coordinates and rates, got {given.tolist()}")
            return given

        q = numbers(positions, self._stored_start().q)
        return self._state(t, q, numbers(velocities or {}, np.zeros(len(names))))

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
        memory = np.zeros(max(self._evaluator.work_size, np.size(work)) + 1)
        memory[: np.size(work)] = work
        return self._evaluator.blocks(kernel, t, places, rates, memory)
