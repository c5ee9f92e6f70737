"""What pages show of user-defined systems and building blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.inspection.view import View
from symgen.lowering.kernel import SETUP
from symgen.report.page.drawing import DrawnLine, Node, Sketch
from symgen.report.page.page import Fact
from symgen.runtime.result.result import Result

_POSITION = ".position"


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


class GeneralView(View):
    """User-defined systems that move: their points, joined by lines in the order of the positions."""

    film_caption = "Points of the system, joined in the order in which it states them."

    def drawn_outputs(self, resolved: Any) -> Sequence[str]:
        """Return the positions of all points; ``resolved`` is the model."""
        points = resolved.description.points
        if not points:
            raise ModelError(
                f"{resolved.name} has nothing to draw\n  Add a matrix 'positions' to its System: a row for "
                "each point, and the columns x and y, or x, y and z."
            )
        return [f"{point}{_POSITION}" for point in points]

    def plotted_outputs(self, resolved: Any) -> Sequence[str]:
        """Return the coordinates."""
        return list(resolved.description.free)

    def sketch(self, resolved: Any, model: Any, result: Result | None) -> Sketch:
        """Return the points at the start."""
        positions = model.initial_state().positions
        return self.sketch_at(model, {f"{name}{_POSITION}": x for name, x in positions.items()})

    def sketch_at(self, resolved: Any, drawn: Mapping[str, NDArray[np.float64]]) -> Sketch:
        """Return the points and the lines between them."""
        places = {name.removesuffix(_POSITION): np.asarray(x) for name, x in drawn.items()}
        nodes = tuple(Node(name, x, "joint") for name, x in places.items())
        lines = tuple(DrawnLine("rod", "", np.array(pair)) for pair in pairwise(places.values()))
        return Sketch(nodes, lines, np.zeros(len(resolved.description.axes)), "m")

    def unit(self, resolved: Any) -> tuple[str, float]:
        """Return the metre."""
        return "m", 1.0

    def example(self, model: Any) -> list[str]:
        """Return lines of Python that run ``model``."""
        return ["run = model.simulate(t_end=1.0)", f'run["{model.description.free[0]}"].values']


class BuildingBlockView(View):
    """Building blocks: their arguments and kernels."""

    def facts(self, resolved: Any, model: Any) -> tuple[Fact, ...]:
        """Return the arguments and the kernels of a System."""
        arguments = ", ".join(f"{len(g.quantities)} {g.name}" for g in model.groups)
        return Fact("arguments", arguments), Fact("kernels", ", ".join(e.kernel for e in model.exports))
