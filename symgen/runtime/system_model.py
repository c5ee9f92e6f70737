"""The compiled kernels of a user's own derivation: called by name, with arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import ModelError, nearest
from symgen.runtime import _core
from symgen.runtime.description import SystemDescription
from symgen.runtime.evaluate import as_taken, part
from symgen.runtime.library import Library

Array = NDArray[np.float64]


class SystemModel:
    """Kernels of a System that a Python file returned."""

    def __init__(self, description: SystemDescription, library: Library, derive: Callable[[], Any]) -> None:
        self.description, self._library, self._derive = description, library, derive
        self._equations: Any = None

    @property
    def name(self) -> str:
        """Name of the System."""
        return self.description.name

    @property
    def backend(self) -> str:
        """Where the kernels come from: ``c``, or ``numpy`` without a compiler."""
        return self._library.backend

    @property
    def equations(self) -> Any:
        """The derived SymPy matrices by name."""
        if self._equations is None:
            self._equations = self._derive().by_name()
        return self._equations

    @property
    def operations(self) -> dict[str, dict[str, int]]:
        """Operations of each kernel by kind."""
        return {k.name: dict(k.operations) for k in self.description.kernels}

    def evaluate(
        self,
        kernel: str,
        *,
        t: float = 0.0,
        q: ArrayLike = (),
        u: ArrayLike = (),
        p: ArrayLike = (),
        work: ArrayLike = (),
    ) -> dict[str, Array]:
        """Return the results of a kernel by name, shaped; a single column loses that axis.

        Parameters
        ----------
        kernel
            One of :attr:`operations`.
        t, q, u, p, work
            The argument arrays, in the units that the System declares. What depends on ``p`` alone is
            computed anew at every call, also where the System says that ``p`` is of a run.

        Raises
        ------
        ModelError
            When there is no such kernel, or for arrays of other sizes.
        """
        info = self.description.kernel(kernel)
        if info is None:
            raise ModelError(f"{self.name} has no kernel {kernel!r}. {nearest(kernel, self.operations)}")
        memory = np.zeros(max(info.work_size, self.description.size("work")) + 1)
        if np.size(work):
            memory[: self.description.size("work")] = self._array("work", work)[:-1]
        out = np.zeros(info.out_size + 1)
        parameters = as_taken(self._library, self._array("p", p)[:-1])
        given = self._array("q", q), self._array("u", u), parameters
        _core.call(self._library.addresses[kernel], np.array([float(t)]), *given, memory, out)
        return {b.name: part(out, b) for b in info.blocks}

    def _array(self, name: str, values: ArrayLike) -> Array:
        size = self.description.size(name)
        try:
            given = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            given = np.zeros((0, 0))
        if given.shape != (size,):
            info = self.description.arrays.get(name)
            names = f" ({', '.join(info.names)})" if info else ""
            raise ModelError(f"expected {size} numbers for {name}{names}, got the shape {np.shape(values)}")
        if not np.isfinite(given).all():
            raise ModelError(f"expected finite numbers for {name}, got {given.tolist()}")
        return np.append(given, 0.0)
