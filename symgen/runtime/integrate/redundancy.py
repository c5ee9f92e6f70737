"""Redundant constraints: distinguished from a dead centre, with reproducible multipliers."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symgen.errors import InitialStateError
from symgen.runtime import _core
from symgen.runtime._start import size_of_points
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.newton import corrected

#: Largest assembly error that a scene need not state, over the size of the linkage.
ASSEMBLED = 1e-8
#: Growth of the assembly error along a run.
_SLACK = 10.0
#: Poses nearby at which redundancy is tested.
_NEIGHBOURS = 3
#: Their distance from the start, over the size of the linkage, and in time over the end of the run.
_AWAY = 1e-2
#: Most iterations of Newton's method to a pose nearby.
_ITERATIONS = 50
#: Last change of an iteration, over the size of the linkage.
_CLOSE = 1e-12
#: Singular values below this part of the largest are lost, without an assembly error.
_NEGLIGIBLE = 3e-7
#: The same part over the assembly error, relative to the size of the linkage.
_MARGIN = 10.0
#: Constraints of larger pivots are independent without a look at singular values.
_SOUND = 1e-3
#: Least rank tolerance with redundant constraints, whose pivots are round-off.
_REDUNDANT = 1e-9
#: Factors of the rank tolerance that are tried.
_WIDER = (1.0, 10.0, 100.0, 1e3, 0.1, 1e-2, 1e-3)
#: The part of the linkage's size, and of the speeds within reach, by which a state may violate constraints.
CLOSED = 1e-6
#: A row with a smaller part in every self-stress has a multiplier that is unique.
_TAKES_PART = 1e-6


class Redundancy(NamedTuple):
    """The constraints that follow from previous ones in every pose, and a rank tolerance that shows them."""

    rows: tuple[int, ...]
    rank_tolerance: float


def redundant_constraints(evaluator: Evaluator, q: Array) -> Redundancy:
    """Return the constraints that follow from previous constraints in every pose.

    Singular values of the Jacobian, with rows of unit norm, give their number. The pivots of the equations of
    motion give the rows, at the first rank tolerance that finds this number of them.

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
    d = evaluator.description
    lost, sound = _pivots(evaluator, q, d.rank_tolerance)
    if not lost and sound > _SOUND:
        return Redundancy((), d.rank_tolerance)
    count = _dependent(evaluator, 0.0, q)
    if count == 0 and not lost:
        return Redundancy((), d.rank_tolerance)
    found = _separated(evaluator, q, count)
    lost = found.rows or lost or (len(d.constraints) - 1,)
    rank = f"{len(d.constraints)} constraints of rank {len(d.constraints) - max(count, 1)}"
    name, place = d.unknown(d.coordinates + lost[-1]), d.place(lost[-1])
    welds = [label for label in d.labels if label.startswith("the weld ")]
    stressed = set(not_unique(evaluator, 0.0, q, max(count, 1)))
    if driven := sorted(stressed.intersection((*d.drives, *motions_of(d)))):
        weld = f" Weld no links whose angle changes as they move: {', '.join(welds)}." if welds else ""
        of_drives = f"{d.labels[driven[0]]} is not independent of the others"
        if driven[1:]:
            same = (
                "prescribe the same motion" if stressed == {*driven} else "are not independent of each other"
            )
            of_drives = f"{', '.join(d.labels[row] for row in driven)} {same}"
        raise InitialStateError(
            f"the constraints are singular at the start: {rank}; {of_drives}\n"
            f"  Drive each freedom of the linkage once, and start away from its dead centres.{weld}",
            where=d.place(driven[-1]),
        )
    near = _neighbours(evaluator, q, [row for row in d.prescribed if row not in stressed])
    if near is None:
        raise InitialStateError(
            f"the constraints leave no freedom and are redundant: {rank}; {name} is not independent of the "
            "others\n  Remove a redundant link.",
            where=place,
        )
    if not count or any(_dependent(evaluator, t, other) < count for t, other in near):
        raise InitialStateError(
            f"the constraints are singular at the start: {rank} there, and of a higher one nearby; {name} is "
            "not independent of the others\n  Start away from the dead centre.",
            where=place,
        )
    if not found.rows:
        raise InitialStateError(
            f"{count} of {len(d.constraints)} constraints are redundant, and round-off hides which\n"
            "  Remove redundant links, or place the points of each body farther apart.",
            where=place,
        )
    return found


def motions_of(description: Description) -> list[int]:
    """Return the numbers of the constraints of [[motions]]."""
    return [i for i, label in enumerate(description.labels) if label.startswith("the motion of ")]


def overdriven(evaluator: Evaluator, q: Array) -> InitialStateError | None:
    """Return the error for more drives than freedoms, of a linkage that they keep from its assembly at q."""
    d = evaluator.description
    drives = (*d.drives, *motions_of(d))
    others = len(d.constraints) - len(drives)
    freedom = d.of_points - others + _dependent(evaluator, 0.0, q, drives)
    if freedom >= len(drives):
        return None
    free = f"{freedom} freedom{'s' * (freedom != 1)}"
    return InitialStateError(
        f"the linkage has {free} and {len(drives)} drives, which contradict each other: "
        f"{', '.join(d.labels[row] for row in drives)}\n  Remove a drive.",
        where=d.place(drives[freedom]),
    )


def _separated(evaluator: Evaluator, q: Array, count: int) -> Redundancy:
    """Return ``count`` rows of vanishing pivots without which the others are independent; none if unclear."""
    least = max(_REDUNDANT, evaluator.description.rank_tolerance)
    for factor in _WIDER if count else ():
        lost, _ = _pivots(evaluator, q, factor * least)
        if len(lost) == count and not _dependent(evaluator, 0.0, q, lost):
            return Redundancy(lost, factor * least)
    return Redundancy((), least)


def _pivots(evaluator: Evaluator, q: Array, tolerance: float) -> tuple[tuple[int, ...], float]:
    """Return the rows whose pivots vanish at a rank tolerance, and the least part left of any other pivot."""
    d = evaluator.description
    if tolerance != d.rank_tolerance:
        evaluator = Evaluator(
            replace(d, rank_tolerance=tolerance), evaluator.library, evaluator.parameter_values
        )
    equations = evaluator.equations(len(d.constraints))
    status = equations.check(0.0, np.concatenate([q, np.zeros(d.coordinates + 2)]))
    if status == _core.NOT_FINITE or (status == _core.SINGULAR and 0 <= equations.weakest < d.coordinates):
        raise not_positive(evaluator)
    return tuple(equations.lost_rows()), equations.soundness


def _dependent(evaluator: Evaluator, t: float, q: Array, dropped: tuple[int, ...] = ()) -> int:
    """Return how many constraints, without the dropped ones, depend on the others at a pose."""
    jacobian = np.delete(scaled_jacobian(evaluator, t, q)[0], dropped, axis=0)
    norms = np.linalg.norm(jacobian, axis=1, keepdims=True)
    least = _negligible(evaluator, q)
    values = np.linalg.svd(jacobian / np.where(norms > least, norms, 1.0), compute_uv=False)
    return len(jacobian) - int(np.sum(values > least * max(values, default=1.0)))


def _neighbours(evaluator: Evaluator, q: Array, driven: list[int]) -> list[tuple[float, Array]] | None:
    """Return times and poses near q that the constraints but the driven ones allow; None if nothing can move.

    Where these leave no freedom, moving ground may: then the poses are those of a few later times.
    """
    size = extent(evaluator, q)
    _, values, right = np.linalg.svd(np.delete(scaled_jacobian(evaluator, 0.0, q)[0], driven, axis=0))
    rank = int(np.sum(values > _negligible(evaluator, q) * max(values, default=1.0)))
    free = right[rank:]
    if not len(free):
        return _later(evaluator, q, size)
    neighbours = []
    for k in range(_NEIGHBOURS):
        direction = np.random.default_rng(k).standard_normal(len(free)) @ free
        start = q + _AWAY * size * direction / np.max(np.abs(direction))
        near = onto(evaluator, 0.0, start, size, driven)
        if near is not None:
            neighbours.append((0.0, near))
    return neighbours


def _later(evaluator: Evaluator, q: Array, size: float) -> list[tuple[float, Array]] | None:
    """Return times and poses in the first part of the run; None if the linkage stays where it is."""
    times = [_AWAY * evaluator.description.t_end * (k + 1) for k in range(_NEIGHBOURS)]
    poses = [(t, onto(evaluator, t, q, size, [])) for t in times]
    if all(pose is not None and np.max(np.abs(pose - q)) <= ASSEMBLED * size for _, pose in poses):
        return None
    return [(t, pose) for t, pose in poses if pose is not None]


def extent(evaluator: Evaluator, q: Array) -> float:
    """Return the size of the linkage [m]: twice the largest distance of its points from their mean."""
    if evaluator.description.size:
        return evaluator.description.size
    positions = evaluator.blocks("points", 0.0, q, np.zeros_like(q))["positions"]
    return float(size_of_points(positions[: evaluator.description.drawn]))


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


def _negligible(evaluator: Evaluator, q: Array) -> float:
    """Return the relative singular value below which rank is lost."""
    return max(_NEGLIGIBLE, _MARGIN * evaluator.description.assembly_tolerance / extent(evaluator, q))


def onto(evaluator: Evaluator, t: float, q: Array, size: float, but: list[int]) -> Array | None:
    """Bring coordinates onto the constraints but some, as well as these allow if they contradict."""
    least = _negligible(evaluator, q)

    def change(q: Array, _: Array) -> Array:
        jacobian, scale = scaled_jacobian(evaluator, t, q)
        error = evaluator.blocks("constraints", t, q, np.zeros_like(q))["constraints"] / scale
        rows, left = np.delete(jacobian, but, axis=0), np.delete(-error, but)
        return np.asarray(np.linalg.lstsq(rows, left, rcond=least)[0])

    return corrected(q, change, lambda _: size, _ITERATIONS, close=_CLOSE, far=1.0)


def scaled_jacobian(evaluator: Evaluator, t: float, q: Array) -> tuple[Array, Array]:
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
        d = evaluator.description
        in_plane = d.links.items() if len(d.axes) == 2 else ()
        bodies = {f"the length of link {name}" for name, points in in_plane if len(points) > 2}
        shape = "the shape of link "
        self._edges = [i for i, x in enumerate(d.labels) if x in bodies or x.startswith(shape)]

    def least_norm(self, solutions: Array) -> Array:
        """Return solutions (accelerations, multipliers, one number) with the constraint forces of least norm.

        These do not depend on how a constraint is written. Forces that keep the shape of a body are internal:
        they count among solutions with equal forces elsewhere only.
        """
        n = solutions.shape[1] - self.scale.shape[1] - 1
        forces = (solutions[:, n:-1] * self.scale)[..., None]
        outside = self.basis.copy()
        outside[:, self._edges] = 0.0
        left, values, right = np.linalg.svd(outside, full_matrices=False)
        turned = self.basis @ right.swapaxes(1, 2)  # each changes forces outside of bodies, or none
        inside = values <= _TAKES_PART
        parts = np.where(inside[..., None], turned.swapaxes(1, 2), left.swapaxes(1, 2)) @ forces
        changes = parts / np.where(inside, 1.0, values)[..., None]
        forces = forces - turned @ changes
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
        "a point carries no mass, or a link no moment of inertia\n"
        "  Give every link a positive mass and moment of inertia about its centre.",
        where="links",
    )
