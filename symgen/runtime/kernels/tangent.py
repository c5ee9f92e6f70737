"""Where the values of the kernel ``tangent`` belong in the Jacobian of the equations of motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.kernels.description import Description


def places(description: Description, tangent: Description) -> NDArray[np.int_]:
    """Return row, column and place in ``out`` of each value, column by column, shape (values, 3).

    Rows are those of the accelerations and multipliers, columns those of the coordinates and their rates.

    Parameters
    ----------
    description
        Of the equations of motion.
    tangent
        Of the analysis ``tangent``.
    """
    info, solution = tangent.kernel("tangent"), description.kernel("accelerations")
    if info is None or solution is None:
        return np.zeros((0, 3), dtype=np.int_)
    rows = {name: i for i, name in enumerate(name for block in solution.blocks for name in block.rows)}
    state = [f"{p}_{what}{axis}" for what in ("", "v") for p in description.free for axis in description.axes]
    columns = {name: i for i, name in enumerate(state)}
    found = []
    for block in info.blocks:
        for k, label in enumerate(block.rows):
            row, column = label.split()
            found.append((columns[column], rows[row], block.offset + k))
    return np.array([(row, column, place) for column, row, place in sorted(found)], dtype=np.int_)
