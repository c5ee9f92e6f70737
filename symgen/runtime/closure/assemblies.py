"""The closures of a loop at one time: found from many starts, and ordered by their distance from a guess."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.closure.closed_form import closed_forms
from symgen.runtime.integrate.pace import check_wall
from symgen.runtime.loop.frames import ball_angles, standing
from symgen.runtime.loop.kernels import LoopKernels

#: Numbers of starts if some close and if none does, and of closures of a loop with a continuum of them.
_TRIES, _MORE_TRIES, _MOST = 120, 1000, 48
_SEED, _SAME = 20, 1e-6
#: Spread of starts around the guess [half turns, or sizes of the loop]; the others are spread evenly.
_AROUND = (0.03, 0.1, 0.3)
_WHOLE = 2 * np.pi
#: Revolutions of a screw that are tried at once.
_REVOLUTIONS = (-32, -8, -2, -1, 1, 2, 8, 32)
#: Starts without a nearer closure after which there is taken to be none, and those of one round.
_NEARER, _ROUND = 240, 48


@dataclass(slots=True)
class Search:
    """Result of a search for closures: one pose per assembly mode, and the pose of least defect."""

    closures: list[Array] = field(default_factory=list)
    closest: Array | None = None
    defect: float = np.inf


def search(kernels: LoopKernels, t: float, guess: Array, by: Sequence[int] = ()) -> Search:
    """Search for the closures at a time from many starts, the same every time; more where none closes.

    Parameters
    ----------
    by
        Numbers of the variables that the distance from the guess is measured by; the others decide where
        these do not. All dependent variables when absent.
    """
    close, near = Closing(kernels, t), _Near(kernels, guess, by)
    result, poses, last = Search(), np.zeros((0, len(standing(kernels, t, guess)))), 0
    for k, start in enumerate(_starts(kernels, t, near)):
        if result.closures and (k >= max(_TRIES, 2 * last) or len(result.closures) >= _MOST):
            break
        check_wall("searching for the closures of the loop")
        q = close(start)
        if close.defect < result.defect:
            result.closest, result.defect = close.reached, close.defect
        if q is None:
            continue
        pose = standing(kernels, t, q)
        if np.any(np.max(np.abs(poses - pose), axis=1, initial=0.0) < _SAME):
            continue
        q = _nearest(kernels, close, q, near)
        if q is not None:
            last = k
            poses = np.vstack([poses, pose])
            result.closures.append(q)
    if result.closures and np.any(kernels.pitches[close.solved]):
        result.closures.append(_unscrewed(kernels, close, min(result.closures, key=near.order), near))
    unique: list[Array] = []
    for q in sorted(result.closures, key=near.order):
        if not any(same_assembly(kernels, t, q, other) for other in unique):
            unique.append(q)
    result.closures = unique
    return result


class _Near:
    """Order of poses by their distance from a guess, and random poses around it and elsewhere."""

    def __init__(self, kernels: LoopKernels, guess: Array, by: Sequence[int]) -> None:
        d = kernels.description
        self.kernels, self.guess, self.solved = kernels, guess, d.having("dependent")
        self._places = np.array(self.solved, dtype=np.intp)
        self.by = list(by) or self.solved
        self.guided = np.isin(self.solved, self.by)
        lengths = kernels.lengths[self._places]
        self._unit = np.where(lengths, d.size, np.pi)
        table = kernels("rows", 0.0, guess, np.zeros_like(guess))["rows"]
        extent = max(d.size, float(np.sum(np.abs(table[:, [1, 4]]))))
        self._reach = {
            far: np.where(lengths, 2.0 * (extent if far else d.size), np.pi) for far in (False, True)
        }
        pitch = kernels.pitches[self._places]
        screws = pitch > 0.0
        # As far as the translation of a screw may have to reach, and around which turn.
        self._advance = np.where(screws, 2.0 * extent / np.where(screws, pitch, 1.0), 0.0)
        self._turned = np.where(screws, guess[self._places], 0.0)
        self._random = np.random.default_rng(_SEED)

    def order(self, q: Array) -> tuple[float, float]:
        """Return the distances from the guess by the relevant variables, and by all dependent variables."""
        near = [distance(self.kernels, q, self.guess, of) for of in (self.by, self.solved)]
        return round(near[0], 6), round(near[1], 6)

    def anywhere(self, far: bool) -> Array:
        """Return a random pose; ``far`` goes for lengths and screws."""
        reach = self._reach[far]
        drawn = self._random.uniform(-reach, reach) + self._turned
        if far:
            drawn += self._random.uniform(-self._advance, self._advance)
        q = self.guess.copy()
        q[self._places] = drawn
        return q

    def around(self, centre: Array, width: float, rest: Array) -> Array:
        """Return a random pose around another one, in half turns and sizes of the loop.

        The variables that do not count are those of ``rest``.
        """
        q = rest.copy()
        spread = width * self._unit * self._random.standard_normal(len(self._places))
        q[self._places] = np.where(self.guided, centre[self._places] + spread, q[self._places])
        return q


def _unscrewed(kernels: LoopKernels, close: Closing, q: Array, near: _Near) -> Array:
    """Return the nearest closure to the guess that is found from one closure on, by ever nearer starts.

    A loop with screws may close at hundreds of their revolutions, of which the first search finds some.
    """
    screws = [j for j in close.solved if kernels.pitches[j] > 0.0]
    tries = 0
    while tries < _NEARER:
        width, starts = near.order(q)[0], []
        for j, revolutions in product(screws, _REVOLUTIONS):
            starts.append(q.copy())
            starts[-1][j] += _WHOLE * revolutions
        for k in range(_ROUND):
            centre = near.guess if k % 2 else (q + near.guess) / 2
            starts.append(near.around(centre, width, q if k % 4 == 0 else near.anywhere(k % 4 > 1)))
        nearer = q
        for start in starts:
            other = close(start)
            other = None if other is None else _nearest(kernels, close, other, near)
            if other is not None and near.order(other) < near.order(nearer):
                nearer = other
        tries = tries + _ROUND if nearer is q else 0
        q = nearer
    return q


class Closing:
    """Closes a loop at one time from any start: near to a closure at any rank, then by Newton's method."""

    def __init__(self, kernels: LoopKernels, t: float) -> None:
        self.kernels, self.t = kernels, t
        self.solved = kernels.description.having("dependent")
        self._full = kernels.equations(self.solved, self.most)
        self._equations = {self.most: self._full}
        self.reached, self.defect = np.array([]), np.inf

    @property
    def most(self) -> int:
        """The largest rank that the screws of the dependent variables can have."""
        return min(len(self.solved), 6)

    def __call__(self, start: Array) -> Array | None:
        """Return the closure that a start leads to; None where it leads to none.

        ``reached`` and ``defect`` are the pose of least defect on the way, and that defect.
        """
        q = np.empty(len(start) + 1)
        q[:-1], q[-1] = start, 0.0
        status, rank = self._full.assemble(self.t, q)
        self.reached, self.defect = q[:-1].copy(), self._full.closure
        near = status == _core.DONE or self.defect <= self.kernels.tolerance
        return self.polished(q[:-1], rank) if near else None

    def polished(self, q: Array, rank: int) -> Array | None:
        """Return a pose closed to rounding at a rank of the screws, or as near as is tolerated."""
        if rank not in self._equations:
            self._equations[rank] = self.kernels.equations(self.solved, rank)
        whole = np.append(q, 0.0)
        return whole[:-1] if self._equations[rank].close(self.t, whole) == _core.DONE else None


def distance(kernels: LoopKernels, q: Array, other: Array, of: Sequence[int] | None = None) -> float:
    """Return the difference of two poses in all variables, or some of them.

    Lengths are measured by the size of the loop, angles in half turns, less whole revolutions; those of
    screws, which advance with every revolution, are measured whole.
    """
    gap = q - other
    gap = np.where(kernels.periodic, (gap + np.pi) % _WHOLE - np.pi, gap)
    gap = gap / np.where(kernels.lengths, kernels.description.size, np.pi)
    return float(np.linalg.norm(gap if of is None else gap[list(of)]))


def same_assembly(kernels: LoopKernels, t: float, q: Array, other: Array) -> bool:
    """Return True if all links coincide in two poses, up to whole revolutions of screws."""
    apart = np.max(np.abs(standing(kernels, t, q) - standing(kernels, t, other)), initial=0.0)
    return bool(apart < _SAME) or _advanced(kernels, q, other)


def _advanced(kernels: LoopKernels, q: Array, other: Array) -> bool:
    """Return True if two poses differ by whole revolutions of screws and in no other angle."""
    gap = np.where(kernels.lengths, 0.0, q - other)
    screws = ~kernels.lengths & ~kernels.periodic
    turned = np.abs((gap + np.pi) % _WHOLE - np.pi)
    return bool(np.any(np.abs(gap[screws]) > np.pi) and np.all(turned < _SAME))


def _starts(kernels: LoopKernels, t: float, near: _Near) -> Iterator[Array]:
    """Yield the guess, closures in closed form, and random poses: around the guess, near, and far.

    Around the guess are the variables by which the distance is measured; these starts are more where these
    are not all.
    """
    yield near.guess
    yield from closed_forms(kernels, t, near.guess)
    often = 4 if np.all(near.guided) else 2
    for k in range(_MORE_TRIES):
        q = near.anywhere(k % 2 == 1)
        yield near.around(near.guess, _AROUND[k // often % len(_AROUND)], q) if k % often == 0 else q


def _nearest(kernels: LoopKernels, close: Closing, q: Array, near: _Near) -> Array | None:
    """Return the same pose with the angles nearest to the guess, closed with these."""
    solved = np.isin(np.arange(len(q)), near.solved)
    whole = solved & kernels.periodic
    written = [
        a - np.where(whole, _WHOLE * np.round((a - near.guess) / _WHOLE), 0.0)
        for a in ball_angles(kernels, q)
    ]
    nearest = min(written, key=near.order)
    return q if np.array_equal(nearest, q) else close(nearest)
