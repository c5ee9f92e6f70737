"""The closures of a loop at one time: found from many starts, and ordered by their distance from a guess."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.closure.closed_form import closed_forms
from symgen.runtime.integrate.pace import check_wall
from symgen.runtime.loop.frames import ball_angles, standing
from symgen.runtime.loop.kernels import LoopKernels

#: Least number of starts, if some close.
_TRIES = 120
#: Number of starts, if none closes.
_MORE_TRIES = 1000
#: Most closures of a loop with a continuum of them.
_MOST_CLOSURES = 48
#: Seed of random starts.
_SEED = 20
#: Largest difference of the places of links in two closures that count as one.
_SAME = 1e-6
#: Spread of starts around the guess [half turns, or sizes of the loop]; the others are spread evenly.
_AROUND = (0.03, 0.1, 0.3)
_WHOLE = 2 * np.pi
#: Revolutions of a screw that are tried at once.
_REVOLUTIONS = (-32, -8, -2, -1, 1, 2, 8, 32)
#: Starts without a nearer closure after which the search for one ends.
_NEARER = 240
#: Starts of one round of this search.
_ROUND = 48


@dataclass(slots=True)
class ClosureSearch:
    """Result of a search for closures: one pose per assembly mode, and the pose of least defect."""

    closures: list[Array] = field(default_factory=list)
    closest: Array | None = None
    defect: float = np.inf


def search(kernels: LoopKernels, t: float, guess: Array, by: Sequence[int] = ()) -> ClosureSearch:
    """Search for the closures at a time from many starts, the same every time; more where none closes.

    Parameters
    ----------
    by
        Numbers of the variables that the distance from the guess is measured by; the others decide where
        these do not. All dependent variables when absent.
    """
    close, near = Closing(kernels, t), _Near(kernels, guess, by)
    result, found, met, limit = ClosureSearch(), _Found(close, near), list[tuple[int, Array]](), _TRIES
    for k, start in enumerate(_starts(kernels, t, near)):
        if k == limit:
            found.add(met)
            met.clear()
            limit = max(_TRIES, 2 * found.last) if found.closures else k + _TRIES
            if found.closures and (k >= limit or len(found.closures) >= _MOST_CLOSURES):
                break
        check_wall("searching for the closures of the loop")
        q = close(start)
        if close.defect < result.defect:
            result.closest, result.defect = close.reached, close.defect
        if q is not None:
            met.append((k, q))
    found.add(met)
    if found.closures and np.any(kernels.pitches[close.solved]):
        orders = near.orders(np.array(found.closures))
        found.closures.append(_unscrewed(kernels, close, found.closures[_first(orders)], near))
    result.closures = _distinct(kernels, t, found.closures, near)
    return result


def _distinct(kernels: LoopKernels, t: float, closures: Sequence[Array], near: _Near) -> list[Array]:
    """Return closures in the order of their distance from the guess, each assembly once."""
    if not closures:
        return []
    poses = np.array(closures)
    poses = poses[np.lexsort(near.orders(poses).T[::-1])]
    links = standing(kernels, np.full(len(poses), t), poses)
    unique: list[int] = []
    for i, q in enumerate(poses):
        if not any(_coincide(links[i], links[j]) or _advanced(kernels, q, poses[j]) for j in unique):
            unique.append(i)
    return [*poses[unique]]


class _Found:
    """Closures that differ in the places of links, with the angles nearest to the guess.

    ``last`` is the number of the start that led to the last of them.
    """

    def __init__(self, close: Closing, near: _Near) -> None:
        self.closures: list[Array] = []
        self.last = 0
        self._close, self._near, self._links = close, near, list[Array]()

    def add(self, met: Sequence[tuple[int, Array]]) -> None:
        """Add the new ones among closures, each given with the number of its start."""
        if not met:
            return
        poses = np.array([q for _, q in met])
        links = standing(self._near.kernels, np.full(len(met), self._close.t), poses)
        left = np.arange(len(met))
        for known in self._links:
            left = left[~_coincide(links[left], known)]
        while len(left) and len(self.closures) < _MOST_CLOSURES:
            new, others = list[int](), left
            while len(others) and len(self.closures) + len(new) < _MOST_CLOSURES:
                new.append(int(others[0]))
                others = others[1:][~_coincide(links[others[1:]], links[others[0]])]
            left = np.setdiff1d(left, new)
            for k, q in zip(new, _nearest(self._close, poses[new], self._near), strict=True):
                if q is not None:
                    self.last = max(self.last, met[k][0])
                    self.closures.append(q)
                    self._links.append(links[k])
                    left = left[~_coincide(links[left], links[k])]


class _Near:
    """Order of poses by their distance from a guess, and random poses around it and elsewhere."""

    def __init__(self, kernels: LoopKernels, guess: Array, by: Sequence[int]) -> None:
        d = kernels.description
        self.kernels, self.guess, self.solved = kernels, guess, d.having("dependent")
        self._places = np.array(self.solved, dtype=np.intp)
        self.by = list(by) or self.solved
        self.guided = np.isin(self.solved, self.by)
        self.whole = kernels.periodic & np.isin(np.arange(len(guess)), self.solved)
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

    def orders(self, poses: Array) -> Array:
        """Return distances from the guess, (poses, 2): by the relevant variables, by all dependent ones."""
        gaps = distances(self.kernels, poses, self.guess)
        of = [np.linalg.norm(gaps[:, of], axis=1) for of in (self.by, self.solved)]
        return np.round(np.column_stack(of), 6)

    def order(self, q: Array) -> tuple[float, float]:
        """Return the same for one pose."""
        by, all_solved = self.orders(q[None])[0].tolist()
        return by, all_solved

    def anywhere(self, far: bool) -> Array:
        """Return a random pose; ``far`` goes for lengths and screws."""
        drawn = self._within(self._reach[far]) + self._turned
        if far:
            drawn += self._within(self._advance)
        q = self.guess.copy()
        q[self._places] = drawn
        return q

    def _within(self, reach: Array) -> Array:
        """Return random numbers between ``-reach`` and ``reach``."""
        return 2.0 * reach * self._random.random(len(reach)) - reach

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
        order, starts = near.order(q), []
        for j, revolutions in product(screws, _REVOLUTIONS):
            starts.append(q.copy())
            starts[-1][j] += _WHOLE * revolutions
        for k in range(_ROUND):
            centre = near.guess if k % 2 else (q + near.guess) / 2
            starts.append(near.around(centre, order[0], q if k % 4 == 0 else near.anywhere(k % 4 > 1)))
        closed = [other for other in map(close, starts) if other is not None]
        others = _nearest(close, np.array(closed), near) if closed else []
        known = np.array([q, *(other for other in others if other is not None)])
        nearest = known[_first(near.orders(known))]
        tries = 0 if near.order(nearest) < order else tries + _ROUND
        q = q if tries else nearest
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
        q = start.copy()
        status, rank = self._full.assemble(self.t, q)
        self.reached, self.defect = q, self._full.closure
        near = status == _core.DONE or self.defect <= self.kernels.tolerance
        return self._polished(q.copy(), rank) if near else None

    def _polished(self, q: Array, rank: int) -> Array | None:
        """Return a pose closed to rounding at a rank of the screws, or as near as is tolerated."""
        if rank not in self._equations:
            self._equations[rank] = self.kernels.equations(self.solved, rank)
        return q if self._equations[rank].close(self.t, q) == _core.DONE else None


def distances(kernels: LoopKernels, poses: Array, other: Array) -> Array:
    """Return the differences of poses, shape (poses, variables), from another one.

    Lengths are measured by the size of the loop, angles in half turns, less whole revolutions; those of
    screws, which advance with every revolution, are measured whole.
    """
    gaps = poses - other
    gaps = np.where(kernels.periodic, (gaps + np.pi) % _WHOLE - np.pi, gaps)
    differences: Array = gaps / np.where(kernels.lengths, kernels.description.size, np.pi)
    return differences


def _first(orders: Array) -> Any:
    """Return the number of the first of the nearest poses from their orders, shape (poses, ..., 2)."""
    return np.lexsort((orders[..., 1], orders[..., 0]), axis=0)[0]


def same_assembly(kernels: LoopKernels, t: float, q: Array, other: Array) -> bool:
    """Return True if all links coincide in two poses, up to whole revolutions of screws."""
    one, two = standing(kernels, np.full(2, t), np.array([q, other]))
    return bool(_coincide(one, two)) or _advanced(kernels, q, other)


def _coincide(links: Array, other: Array) -> NDArray[np.bool_]:
    """Return whether links are in the same places in poses, each given by :func:`standing`."""
    apart: Array = np.max(np.abs(links - other), axis=-1, initial=0.0)
    return apart < _SAME


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


def _nearest(close: Closing, poses: Array, near: _Near) -> list[Array | None]:
    """Return the same poses with the angles nearest to the guess, closed with these; None for open ones."""
    written = np.array(ball_angles(near.kernels, poses))
    written -= np.where(near.whole, _WHOLE * np.round((written - near.guess) / _WHOLE), 0.0)
    first = _first(np.array([near.orders(choice) for choice in written]))
    nearest = written[first, np.arange(len(poses))]
    same = np.all(nearest == poses, axis=1).tolist()
    return [q if x else close(a) for q, a, x in zip(poses, nearest, same, strict=True)]
