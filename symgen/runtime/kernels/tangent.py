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
    rows = [name for block in solution.blocks for name in block.rows]
    columns = [*description.of_coordinates(), *description.of_coordinates("v")]
    entries = [entry for block in info.blocks for entry in block.places(rows, columns)]
    return np.array(sorted(entries, key=lambda entry: (entry[1], entry[0])), dtype=np.int_)
