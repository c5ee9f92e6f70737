"""What every compiled model has, linkage or loop: its name, its kernels, its equations, its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from symgen.errors import ModelError, nearest
from symgen.runtime.arguments import real
from symgen.runtime.description import Described
from symgen.runtime.library import Library


class Compiled:
    """Kernels of one scene with values of its tunable parameters."""

    description: Described

    def __init__(
        self,
        description: Described,
        library: Library,
        derive: Callable[[], Any],
        parameters: Mapping[str, float] | None,
    ) -> None:
        self.description, self._library, self._derive = description, library, derive
        self.parameters: dict[str, float] = {p.name: p.default for p in description.parameters}
        for name, value in (parameters or {}).items():
            if name not in self.parameters:
                raise ModelError(
                    f"{description.name} has no tunable parameter {name!r}. {nearest(name, self.parameters)}"
                )
            self.parameters[name] = real(value, f"{name}, in SI units")
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
        """The derived SymPy matrices by name: ``model.equations["mass_matrix"]``."""
        if self._equations is None:
            self._equations = self._derive()
        return self._equations

    @property
    def operations(self) -> dict[str, dict[str, int]]:
        """Operations of each kernel by kind."""
        return {k.name: dict(k.operations) for k in self.description.kernels}

    @property
    def is_changed(self) -> bool:
        """Whether a parameter has another value than in the scene."""
        return any(self.parameters[p.name] != p.default for p in self.description.parameters)
