"""Tunable parameters at which values of the scene have the wrong sign: the kernel ``limits``."""

from __future__ import annotations

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import Described
from symgen.runtime.kernels.evaluate import part
from symgen.runtime.kernels.library import Library


def refusals(description: Described, library: Library, rows: Array) -> dict[int, str]:
    """Return why parameters are refused, by the number of their row; ``rows`` are (sets, parameters)."""
    info = description.kernel("limits")
    if info is None:
        return {}
    sizes = description.sizes_of("limits")
    parameters = np.zeros((len(rows), sizes[3]))
    parameters[:, : rows.shape[1]] = rows
    out = np.zeros((len(rows), info.out_size + 1))
    _core.call_at(library.addresses["limits"], sizes, parameters, out)
    found: dict[int, str] = {}
    for block in info.blocks:
        values = part(out, block).reshape(len(rows), -1)
        strict = block.name == "above_zero"
        units = block.unit.split(", ") * (1 if "," in block.unit else len(block.rows))
        limit = "above zero" if strict else "of at least zero"
        permitted = values > 0.0 if strict else values >= 0.0
        for row, column in np.argwhere(~permitted).tolist():
            value = f"{values[row, column]:g} {units[column]}"
            reason = f"expected a value {limit}, got {value} at these parameters\n  Change the parameters."
            found.setdefault(row, f"{block.rows[column]}: {reason}")
    return found
