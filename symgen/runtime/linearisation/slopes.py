"""Slopes of the equations of motion and of outputs at one state, as dense rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.result.state import State


@dataclass(frozen=True, slots=True)
class StateSlopes:
    """Slopes at one state by its coordinates, velocities, solution (a, multipliers), and parameters.

    ``residual`` are those of the equations of motion, of linkages f - M a - J^T lambda and gamma - J a,
    ``rates`` those of dPhi/dt, ``constraints`` those of Phi (in kernels of sensitivities), a row each;
    ``outputs`` and ``values`` are those of the outputs by name, and their values.
    """

    residual: Array
    rates: Array
    constraints: Array
    outputs: dict[str, Array]
    values: dict[str, float]
    units: dict[str, str]

    def rows(self, names: Sequence[str]) -> Array:
        """Return the slopes of scalar outputs, a row each."""
        return np.array([self.outputs[name] for name in names]).reshape(len(names), self.residual.shape[1])

    def scalars(self, name: str) -> list[str]:
        """Return the scalars of an output: itself, or its components."""
        marks = name[len(name.rstrip("'")) :]
        whole = name.removesuffix(marks)
        components = [f"{whole}.{axis}{marks}" for axis in "xyz"]
        return [name] if name in self.outputs else [x for x in components if x in self.outputs]


def slopes_at(
    kernels: Evaluator, parameters: Sequence[str], state: State, solution: Array, couples: Sequence[str] = ()
) -> StateSlopes:
    """Return the slopes at a state as dense rows; ``couples`` are unknowns behind the multipliers."""
    d = kernels.description
    bound = [f"{c}_lambda" for c in d.constraints]
    unknowns = [*d.of_coordinates("a"), *bound, *couples]
    columns = [*d.of_coordinates(), *d.of_coordinates("v"), *unknowns, *parameters, "t"]
    work = np.zeros(kernels.work_size + len(solution) + 1)
    work[: len(solution)] = solution
    at = state.t, state.q, state.u, work
    infos = {b.name: b for b in kernels.info("values").blocks} if kernels.has("values") else {}
    values = {infos[k].about: float(v[0]) for k, v in kernels.blocks("values", *at).items()} if infos else {}
    rows = {"residual": unknowns, "rates": bound, "constraints": bound, "outputs": list(values)}
    matrices = {name: np.zeros((len(labels), len(columns))) for name, labels in rows.items()}
    entries = kernels("slopes", *at)
    for block in kernels.info("slopes").blocks:
        for row, column, place in block.places(rows[block.name], columns):
            matrices[block.name][row, column] = entries[place]
    outputs = dict(zip(values, matrices["outputs"], strict=True))
    units = {b.about: b.unit for b in infos.values()}
    return StateSlopes(
        matrices["residual"], matrices["rates"], matrices["constraints"], outputs, values, units
    )
