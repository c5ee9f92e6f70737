"""Closing a loop for the first time: from a guess, from many starts; what to say when it does not close."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.errors import InitialStateError
from symgen.runtime import _core
from symgen.runtime.loop_closed_form import closed_forms
from symgen.runtime.loop_frames import standing
from symgen.runtime.loop_kernels import LoopKernels

Array = NDArray[np.float64]

_SEED, _TRIES, _MORE_TRIES, _SAME, _RANK = 20, 120, 1000, 1e-6, 1e-8
_MOST = 6


@dataclass(frozen=True, slots=True)
class Closed:
    """A closed loop: the time [s], all variables [rad, m], and the rank of the dependent ones' screws."""

    t: float
    q: Array
    rank: int


def close_near(kernels: LoopKernels, t: float, guess: Array) -> Closed:
    """Close the loop at a time: in closed form where there is one, else from a guess, else from many starts.

    Of several closures the nearest to the guess is taken.

    Raises
    ------
    InitialStateError
        When no closure is found, or the joints leave more or fewer freedoms than the scene counts on.
    """
    starts = [*closed_forms(kernels, t, guess), guess]
    found = next((q for q in (_closed(kernels, t, start) for start in starts) if q is not None), None)
    if found is None:
        others = assemblies(kernels, t, guess)
        if not others:
            raise _open(kernels, t, guess)
        found = others[0]
    return counted(kernels, t, found)


def counted(kernels: LoopKernels, t: float, q: Array) -> Closed:
    """Check the count of freedoms at a closed pose.

    Raises
    ------
    InitialStateError
        When the dependent variables are not determined by closure, or cannot follow the inputs.
    """
    d = kernels.description
    solved = d.having("dependent")
    screws = scaled_screws(kernels, t, q)
    own = screws[:, solved]
    values = np.linalg.svd(own, compute_uv=False)
    rank = int(np.count_nonzero(values > _RANK * values.max(initial=1e-300)))
    where = kernels.value_at(t)
    if rank < len(solved):
        kernel = np.linalg.svd(own)[2][rank:]
        moving = [d.row(j) for k, j in enumerate(solved) if np.max(np.abs(kernel[:, k])) > 1e-6]
        raise InitialStateError(
            f"at {where} the screws of the {len(solved)} dependent variables have rank {rank}: "
            f"{len(solved) - rank} freedom{'s' if len(solved) - rank > 1 else ''} of the loop "
            f"{'are' if len(solved) - rank > 1 else 'is'} neither prescribed nor free\n"
            f"  These can move on their own: {'; '.join(moving)}. Make one an input, give it under free, or "
            "change the pose if it is a dead centre.",
            where="loop.rows",
        )
    for j in (*d.having("input"), *d.having("free")):
        left = screws[:, j] - own @ np.linalg.lstsq(own, screws[:, j], rcond=_RANK)[0]
        if np.linalg.norm(left) > 1e-7 * np.linalg.norm(screws[:, j]):
            raise InitialStateError(
                f"at {where} the loop cannot follow {d.row(j)}: the {len(solved)} dependent variables have "
                f"screws of rank {rank}, and its own is independent of them\n"
                "  The table has too few variables, or too many inputs. A ball has three angles, a constant "
                "one is allowed only in one of the two rows of a ball-ball link.",
                where="loop.rows",
            )
    return Closed(t, q, rank)


def assemblies(kernels: LoopKernels, t: float, guess: Array) -> list[Array]:
    """Return the closures at a time, each pose once, nearest to the guess first.

    They are found in closed form where there is one, and from many starts, the same every time: more
    where none closes. Angles are given within half a turn of the guess.
    """
    d = kernels.description
    solved = d.having("dependent")
    lengths = np.array([v.is_length for v in d.variables])
    random = np.random.default_rng(_SEED)
    equations = kernels.equations(solved, min(len(solved), _MOST))
    spread = np.where(lengths, 2.0 * d.size, np.pi)[solved]
    starts = [guess, *closed_forms(kernels, t, guess)]
    found: list[Array] = []
    poses: list[Array] = []
    for k in range(_MORE_TRIES):
        if k >= _TRIES and found:
            break
        q = np.append(starts[k] if k < len(starts) else guess, 0.0)
        if k >= len(starts):
            q[solved] = random.uniform(-spread, spread)
        if equations.close(t, q) != _core.DONE:
            continue
        pose = standing(kernels, t, q[:-1])
        if not any(np.max(np.abs(pose - other)) < _SAME for other in poses):
            poses.append(pose)
            turns = np.where(lengths, 0.0, np.round((q[:-1] - guess) / (2 * np.pi)))
            turns[[i for i in range(len(turns)) if i not in solved]] = 0.0
            found.append(q[:-1] - 2 * np.pi * turns)
    return sorted(found, key=lambda q: round(distance(kernels, q, guess), 6))


def distance(kernels: LoopKernels, q: Array, other: Array) -> float:
    """Return by how much two poses differ: lengths by the size of the loop, angles less whole turns."""
    lengths = np.array([v.is_length for v in kernels.description.variables])
    gap = q - other
    turned = (gap + np.pi) % (2 * np.pi) - np.pi
    return float(np.linalg.norm(np.where(lengths, gap / kernels.description.size, turned)))


def scaled_screws(kernels: LoopKernels, t: float, q: Array) -> Array:
    """Return the screws of all variables, shape (6, n), made dimensionless by the size of the loop."""
    d = kernels.description
    screws: Array = kernels("position", t, q, np.zeros_like(q))["closure_jacobian"].copy()
    screws[3:] /= d.size
    scaled: Array = screws * np.array([d.size if v.is_length else 1.0 for v in d.variables])
    return scaled


def _closed(kernels: LoopKernels, t: float, guess: Array) -> Array | None:
    solved = kernels.description.having("dependent")
    equations = kernels.equations(solved, min(len(solved), _MOST))
    q = np.append(guess, 0.0)
    return q[:-1] if equations.close(t, q) == _core.DONE else None


def _open(kernels: LoopKernels, t: float, guess: Array) -> InitialStateError:
    """Say how far the loop stays open, and whether its count can be right."""
    d = kernels.description
    solved = d.having("dependent")
    equations = kernels.equations(solved, min(len(solved), _MOST))
    random, best, nearest = np.random.default_rng(_SEED), np.inf, guess
    for k in range(40):
        q = np.append(guess, 0.0)
        if k:
            spread = np.array([2 * d.size if v.is_length else np.pi for v in d.variables])[solved]
            q[solved] = random.uniform(-spread, spread)
        equations.close(t, q)
        defect = equations.closed_screws(t, q)[1]
        if defect < best:
            best, nearest = defect, q[:-1].copy()
    screws = scaled_screws(kernels, t, nearest)[:, solved]
    values = np.linalg.svd(screws, compute_uv=False)
    rank = int(np.count_nonzero(values > 1e-3 * values.max(initial=1e-300)))
    weakest = d.row(solved[int(np.argmax(np.abs(np.linalg.svd(screws)[2][-1])))])
    rows = " ".join(d.joints)
    return InitialStateError(
        f"the loop {rows} cannot be assembled at {kernels.value_at(t)}: the best of many starts leaves it "
        f"open by {best:.2g} (rotation in radians, displacement over {d.size:.4g} m), where the screws of "
        f"its {len(solved)} dependent variables have rank {rank} and {weakest} holds the loop least\n"
        f"  {'Change a length or an angle of the table' if len(solved) >= _MOST else _TOO_FEW}, or the value "
        "of the input.",
        where="loop.rows",
    )


_TOO_FEW = (
    "Fewer than 6 dependent variables close a loop only where lengths and twists meet a condition of their "
    "own: check the table"
)
