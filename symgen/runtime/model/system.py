"""User-defined systems without values: compiled kernels, which are called by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import ModelError, check_known
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import as_taken, part
from symgen.runtime.kernels.system_description import SystemDescription
from symgen.runtime.model.model import Model

if TYPE_CHECKING:
    pass


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
        parameters = as_taken(self.library, self._array("p", p)[:-1])
        arrays = self._array("q", q), self._array("u", u), parameters
        sizes, address = self.description.sizes_of(kernel), self.library.addresses[kernel]
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
