"""Velocities at the start of large linkages: sparse, in time about proportional to the number of bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.kernels.evaluate import Evaluator

Array = NDArray[np.float64]

#: Number of coordinates above which dense matrices of the start take longer than sparse ones.
LARGE = 400
#: Weight of the conditions over the masses, and the largest number of corrections.
_WEIGHT, _CORRECTIONS = 1e8, 30


def least_velocities(
    evaluator: Evaluator, q: Array, redundant: tuple[int, ...]
) -> tuple[Array, Array, Array, float]:
    """Return the velocities of least kinetic energy that meet the constraints and the prescribed start.

    The method of multipliers: with R the rows of both, r their right-hand sides and w a weight, the minimum
    of the kinetic energy + w |R u - r|^2 / 2 + multipliers . (R u - r) is corrected until R u - r vanishes.
    Rows may depend on each other, as prescribed velocities do that the constraints imply.

    Returns
    -------
    The velocities [m/s], by how much the constraints but the redundant ones and the prescribed velocities are
    missed [m/s], and the largest right-hand side [m/s]: those of ``Starter.velocities``.
    """
    from scipy.sparse import csc_matrix, vstack
    from scipy.sparse.linalg import splu

    still = np.zeros_like(q)

    def matrix(kernel: str, block: str) -> csc_matrix:
        return csc_matrix(evaluator.blocks(kernel, 0.0, q, still)[block].reshape(-1, len(q)))

    rows, right = [], []
    if evaluator.has("constraint_jacobian"):
        kept = np.setdiff1d(np.arange(len(evaluator.description.constraints)), redundant)
        scale = evaluator.blocks("constraints", 0.0, q, still)["constraint_scale"]
        drift = evaluator.blocks("velocity_constraints", 0.0, q, still)["velocity_constraints"]
        jacobian = matrix("constraint_jacobian", "constraint_jacobian")
        rows.append(jacobian.multiply(1 / scale[:, None]).tocsr()[kept])
        right.append(-(drift / scale)[kept])
    constraints = len(right[0]) if right else 0
    if evaluator.has("start_velocity"):
        rows.append(matrix("start_velocity", "start_jacobian"))
        right.append(evaluator.blocks("start_velocity", 0.0, q, still)["start_rates"])
    masses = matrix("mass_matrix", "mass_matrix")
    conditions, wanted = vstack(rows, format="csc"), np.concatenate(right)
    weight = _WEIGHT * float(np.max(masses.diagonal()))
    factors = splu((masses + weight * (conditions.T @ conditions)).tocsc())
    multipliers, miss, u = np.zeros_like(wanted), wanted, still
    for _ in range(_CORRECTIONS):
        moved = factors.solve(conditions.T @ (weight * wanted - multipliers))
        left = conditions @ moved - wanted
        if not np.max(np.abs(left)) < np.max(np.abs(miss)):
            break
        multipliers, miss, u = multipliers + weight * left, left, moved
    size = float(np.max(np.abs(wanted), initial=0.0))
    missed = np.abs(miss)
    return u, missed[:constraints], missed[constraints:], size
