"""What pages show of user-defined systems, and of rotors: models that are not run in time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from symgen.errors import ModelError
from symgen.inspection.view import View
from symgen.lowering.kernel import SETUP
from symgen.report.page.page import Fact


class SystemView(View):
    """Kernels with their arguments; there is no mechanism to draw and no motion to run."""

    def facts(self, resolved: Any, model: Any) -> tuple[Fact, ...]:
        """Return the arguments and the kernels."""
        return Fact("arguments", model.description.extent), Fact("kernels", ", ".join(_kernels(model)))

    def example(self, model: Any) -> list[str]:
        """Return a call of the first kernel."""
        arrays = [
            f"{name}={[1.0] * len(array.names)}"
            for name, array in model.description.arrays.items()
            if name != "t"
        ]
        return [f"model.evaluate({', '.join((repr(_kernels(model)[0]), *arrays))})".replace("'", '"')]


def _kernels(model: Any) -> list[str]:
    return [k.name for k in model.description.kernels if k.name != SETUP]


class BuildingBlockView(View):
    """Building blocks: their arguments and kernels."""

    def facts(self, resolved: Any, model: Any) -> tuple[Fact, ...]:
        """Return the arguments and the kernels of a System."""
        arguments = ", ".join(f"{len(g.quantities)} {g.name}" for g in model.groups)
        return Fact("arguments", arguments), Fact("kernels", ", ".join(e.kernel for e in model.exports))


class RotorView(View):
    """Elastic links in space that rotate as a whole; there is no motion to run."""

    def facts(self, resolved: Any, model: Any) -> tuple[Fact, ...]:
        """Return the links and the number of free points."""
        links = ", ".join(link.link for link in resolved.links)
        return Fact("elastic links in space", links), Fact("free points", str(len(resolved.free)))

    def drawn_outputs(self, resolved: Any) -> Sequence[str]:
        """Refuse animations."""
        raise ModelError(f"{resolved.name} is a rotor, which has modes alone: symgen modes {resolved.name}")
