"""Velocities at the start of large linkages: sparse, in time about proportional to the number of bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix


#: Number of coordinates above which dense matrices of the start take longer than sparse ones.
LARGE = 400
#: Compliance of the conditions, where masses and conditions are scaled to one.
_COMPLIANCE = 1e-8
#: Most corrections of the solution.
_CORRECTIONS = 30


def least_velocities(
    evaluator: Evaluator, q: Array, redundant: tuple[int, ...]
) -> tuple[Array, Array, Array, float] | None:
    """Return the velocities of least kinetic energy that satisfy the constraints and the prescribed start.

    With R the rows of both, r their right-hand sides and b the momentum by the velocity of the ground alone,
    M u + b + R^T multipliers = 0 and R u = r. Each velocity
    is scaled by the root of its mass and each row to unit norm, so that neither ratios of masses nor
    of lengths worsen the matrix. Rows may depend on each other, such as prescribed velocities that the
    constraints imply: therefore the conditions have a small compliance, and corrections remove its effect.

    Returns
    -------
    The velocities [m/s], the residuals of the constraints (without redundant ones) and of the prescribed
    velocities [m/s], and the largest right-hand side [m/s], as in ``Starter.velocities``. None if the mass
    matrix is not positive definite.
    """
    from scipy.sparse import block_array, csc_matrix, diags_array, eye_array, vstack
    from scipy.sparse.linalg import norm, splu

    still = np.zeros_like(q)

    def matrix(kernel: str, block: str) -> csc_matrix:
        return csc_matrix(evaluator.blocks(kernel, 0.0, q, still)[block].reshape(-1, len(q)))

    rows, right = [], []
    if evaluator.has("constraint_jacobian"):
        independent = np.setdiff1d(np.arange(len(evaluator.description.constraints)), redundant)
        scale = evaluator.blocks("constraints", 0.0, q, still)["constraint_scale"]
        drift = evaluator.blocks("velocity_constraints", 0.0, q, still)["velocity_constraints"]
        jacobian = matrix("constraint_jacobian", "constraint_jacobian")
        rows.append(jacobian.multiply(1 / scale[:, None]).tocsr()[independent])
        right.append(-(drift / scale)[independent])
    constraints = len(right[0]) if right else 0
    if evaluator.has("start_velocity"):
        rows.append(matrix("start_velocity", "start_jacobian"))
        right.append(evaluator.blocks("start_velocity", 0.0, q, still)["start_rates"])
    masses = matrix("mass_matrix", "mass_matrix")
    if not np.all(masses.diagonal() > 0.0):
        return None
    has_momentum = evaluator.has("start_momentum")
    momentum = evaluator("start_momentum", 0.0, q, still) if has_momentum else still
    root = diags_array(1 / np.sqrt(masses.diagonal()))
    masses = (root @ masses @ root).tocsc()
    if not _is_positive(masses):
        return None
    conditions, rates = vstack(rows, format="csc"), np.concatenate(right)
    scaled = conditions @ root
    sizes = norm(scaled, axis=1)
    weights = 1 / np.where(sizes > 0.0, sizes, 1.0)
    scaled = diags_array(weights) @ scaled
    compliance = -_COMPLIANCE * eye_array(len(rates))
    factors = splu(block_array([[masses, scaled.T], [scaled, compliance]], format="csc"))
    moved, multipliers, miss, u = np.zeros_like(q), np.zeros_like(rates), -rates, still
    least = np.inf
    for _ in range(_CORRECTIONS):
        unbalanced = root @ momentum + masses @ moved + scaled.T @ multipliers
        change = factors.solve(-np.concatenate([unbalanced, weights * miss]))
        moved, multipliers = moved + change[: len(q)], multipliers + change[len(q) :]
        left = conditions @ (root @ moved) - rates
        if not np.max(np.abs(left)) < least:
            break
        miss, u, least = left, root @ moved, np.max(np.abs(left))
    size = float(np.max(np.abs([*rates, *(u if has_momentum else ())]), initial=0.0))
    missed = np.abs(miss)
    return u, missed[:constraints], missed[constraints:], size


def _is_positive(matrix: csc_matrix) -> bool:
    """Return True where elimination on the diagonal of a symmetric matrix has pivots above zero only."""
    from scipy.sparse.linalg import splu

    try:
        factors = splu(matrix, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # exactly singular
        return False
    on_diagonal = np.array_equal(factors.perm_r, factors.perm_c)
    return on_diagonal and bool(np.all(factors.U.diagonal() > 0.0))
