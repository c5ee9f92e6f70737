"""Redundant constraints: distinguished from a dead centre, with reproducible multipliers."""

from __future__ import annotations

import numpy as np

from symgen.errors import InitialStateError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator

#: The share of the linkage's size that an assembly error may have unstated, and how it may grow on the way.
ASSEMBLED, _SLACK = 1e-8, 10.0
_NEIGHBOURS, _AWAY, _NEWTON = 3, 1e-2, 50
#: The part of the linkage's size, and of the speeds within reach, by which a state may violate constraints.
CLOSED = 1e-6
#: A row with a smaller part in every self-stress has a multiplier that is unique.
_TAKES_PART = 1e-6


def redundant_constraints(evaluator: Evaluator, q: Array) -> tuple[int, ...]:
    """Return the indices of the constraints that follow from previous constraints in every pose.

    Parameters
    ----------
    evaluator
        The kernels.
    q
        Coordinates at the start [m].

    Raises
    ------
    InitialStateError
        When constraints are dependent at q alone, and not where the linkage can go from there: q is a dead
        centre or a branching point, where the motion is not determined. Also when a point carries no mass.
    """
    lost = _lost(evaluator, q)
    if not lost:
        return lost
    d = evaluator.description
    rank = f"{len(d.constraints)} constraints of rank {len(d.constraints) - len(lost)}"
    name, place = d.unknown(d.coordinates + lost[-1]), d.place(lost[-1])
    drives = d.drives
    welds = [label for label in d.labels if label.startswith("the weld ")]
    for row in set(drives) & set(not_unique(evaluator, 0.0, q, len(lost))):
        weld = f" Weld no links whose angle changes as they move: {', '.join(welds)}." if welds else ""
        raise InitialStateError(
            f"the constraints are singular at the start: {rank}; {d.labels[row]} is not independent of the "
            f"others\n  Drive each freedom of the linkage once, and start away from its dead centres.{weld}",
            where=d.place(row),
        )
    near = _neighbours(evaluator, q, drives)
    if near is None:
        raise InitialStateError(
            f"the constraints leave no freedom and are redundant: {rank}; {name} is not independent of the "
            "others\n  Remove a redundant link.",
            where=place,
        )
    if any(len(_lost(evaluator, other)) < len(lost) for other in near):
        raise InitialStateError(
            f"the constraints are singular at the start: {rank} there, and of a higher one nearby; {name} is "
            "not independent of the others\n  Start away from the dead centre.",
            where=place,
        )
    return lost


def _lost(evaluator: Evaluator, q: Array) -> tuple[int, ...]:
    equations = evaluator.equations()
    n = evaluator.description.coordinates
    status = equations.check(0.0, np.concatenate([q, np.zeros(n + 2)]))
    if status == _core.NOT_FINITE or (status == _core.SINGULAR and equations.weakest < n):
        raise not_positive(evaluator)
    return tuple(equations.lost_rows())


def _neighbours(evaluator: Evaluator, q: Array, drives: tuple[int, ...]) -> list[Array] | None:
    """Return configurations near q that all constraints but the drives allow; None when nothing can move."""
    jacobian = np.delete(_scaled_jacobian(evaluator, 0.0, q)[0], drives, axis=0)
    _, values, right = np.linalg.svd(jacobian)
    rank = int(np.sum(values > _rank(evaluator) * max(values[0], 1e-300)))
    free = right[rank:]
    if not len(free):
        return None
    size = extent(evaluator, q)
    neighbours = []
    for k in range(_NEIGHBOURS):
        direction = np.random.default_rng(k).standard_normal(len(free)) @ free
        near = _onto(evaluator, q + _AWAY * size * direction / np.max(np.abs(direction)), size, drives)
        if near is not None:
            neighbours.append(near)
    return neighbours


def extent(evaluator: Evaluator, q: Array) -> float:
    """Return the size of the linkage [m]: twice the largest distance of its points from their mean."""
    positions = evaluator.blocks("points", 0.0, q, np.zeros_like(q))["positions"]
    drawn = positions[: evaluator.description.drawn]
    return float(2 * np.max(np.linalg.norm(drawn - np.mean(drawn, axis=0), axis=1)))


def violation(evaluator: Evaluator, t: float, q: Array, u: Array) -> tuple[float, float]:
    """Return the largest violations of constraints [m] and of their rates [m/s] at a state."""
    blocks = evaluator.blocks("constraints", t, q, u)
    rates = evaluator.blocks("velocity_constraints", t, q, u)["velocity_constraints"]
    errors = [np.max(np.abs(x / blocks["constraint_scale"])) for x in (blocks["constraints"], rates)]
    return float(errors[0]), float(errors[1])


def assembly_tolerance(evaluator: Evaluator, q: Array) -> float:
    """Return the permitted error [m] of redundant constraints at the start."""
    return max(ASSEMBLED * extent(evaluator, q), evaluator.description.assembly_tolerance)


def slack(evaluator: Evaluator, q: Array) -> float:
    """Return the permitted error [m] of a redundant constraint in a run."""
    return _SLACK * assembly_tolerance(evaluator, q)


def _rank(evaluator: Evaluator) -> float:
    """Return the relative singular value below which rank is lost: the root of the tolerance of pivots."""
    return float(evaluator.description.rank_tolerance**0.5)


def _onto(evaluator: Evaluator, q: Array, size: float, drives: tuple[int, ...]) -> Array | None:
    """Bring coordinates onto the constraints but the drives, as well as these allow if they contradict."""
    for _ in range(_NEWTON):
        jacobian, scale = _scaled_jacobian(evaluator, 0.0, q)
        error = evaluator.blocks("constraints", 0.0, q, np.zeros_like(q))["constraints"] / scale
        without_drives = np.delete(jacobian, drives, axis=0), np.delete(-error, drives)
        step = np.linalg.lstsq(*without_drives, rcond=_rank(evaluator))[0]
        q = q + step
        if not np.max(np.abs(step)) <= size:
            return None
        if np.max(np.abs(step)) <= 1e-12 * size:
            return q
    return None


def _scaled_jacobian(evaluator: Evaluator, t: float, q: Array) -> tuple[Array, Array]:
    """Return the constraint Jacobian with every row over its scale [1], and the scales."""
    zero = np.zeros_like(q)
    scale = evaluator.blocks("constraints", t, q, zero)["constraint_scale"]
    jacobian = evaluator.blocks("constraint_jacobian", t, q, zero)["constraint_jacobian"]
    return jacobian.reshape(-1, len(q)) / scale[:, None], scale


class SelfStress:
    """Constraint forces of redundant constraints that do nothing, at many poses.

    Accelerations and J^T lambda are unique, single multipliers of redundant constraints are not.

    Attributes
    ----------
    basis
        Orthonormal constraint forces, (poses, constraints, redundant).
    scale
        Scale of every constraint, (poses, constraints); a force is a multiplier times its scale [N].
    """

    def __init__(self, evaluator: Evaluator, times: Array, q: Array, redundant: int) -> None:
        still = np.zeros_like(q)
        self.scale = evaluator.many_blocks("constraints", times, q, still)["constraint_scale"]
        slopes = evaluator.many_blocks("constraint_jacobian", times, q, still)["constraint_jacobian"]
        left = np.linalg.svd(slopes.reshape(*self.scale.shape, -1) / self.scale[..., None])[0]
        self.basis = left[..., self.scale.shape[1] - redundant :]

    def least_norm(self, solutions: Array) -> Array:
        """Return solutions (accelerations, multipliers, one number) with the constraint forces of least norm.

        These do not depend on how a constraint is written.
        """
        n = solutions.shape[1] - self.scale.shape[1] - 1
        forces = (solutions[:, n:-1] * self.scale)[..., None]
        forces = forces - self.basis @ (self.basis.swapaxes(1, 2) @ forces)
        return np.hstack([solutions[:, :n], forces[..., 0] / self.scale, solutions[:, -1:]])

    def not_unique(self, pose: int = 0) -> tuple[int, ...]:
        """Return the numbers of the constraints whose multipliers are not unique at a pose."""
        return tuple(np.flatnonzero(np.max(np.abs(self.basis[pose]), axis=1) > _TAKES_PART).tolist())


def not_unique(evaluator: Evaluator, t: float, q: Array, redundant: int) -> tuple[int, ...]:
    """Return the numbers of the constraints whose multipliers the redundant constraints leave open."""
    return SelfStress(evaluator, np.array([t]), q[None], redundant).not_unique() if redundant else ()


def not_positive(evaluator: Evaluator) -> InitialStateError:
    """Return the error for a mass matrix that is not positive definite."""
    values = ", ".join(
        f"{p.name} = {v:g} {p.unit}"
        for p, v in zip(evaluator.description.tunable, evaluator.parameter_values, strict=False)
    )
    return InitialStateError(
        f"the mass matrix is not positive definite{f' with {values}' if values else ''}: "
        "some point carries no mass, or a negative one\n"
        "  Give every link a positive mass and moment of inertia about its centre.",
        where="links",
    )
