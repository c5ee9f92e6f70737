"""All roots of a small system of equations, by least squares from many starts; conditions at points."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.runtime import _core
from symgen.runtime.kernels.library import shipped_module
from symgen.synthesis.tasks import SIZES

Array = NDArray[np.float64]
Equations = Callable[[Array], tuple[Array, Array]]

#: Two roots are the same where they differ by less, relative to their size.
_SAME = 1e-6
#: Reasons of MINPACK to end at a least square: its changes or those of the residual are small, or both.
_ENDED = (1, 2, 3, 4)
#: Evaluations of the equations from one start.
_EVALUATIONS = 300
#: Last change of a root by Newton's method, over its size.
_SETTLED = 1e-11
#: The same over rounding divided by the least singular value of the slopes.
_ROUNDED = 10.0
#: Largest last change of a root, over its size.
_LOOSE = 1e-7
#: Largest first change by which a start of Newton's method may miss its root, relative to its size.
_NEAR_ROOT = 1e-3
#: Corrections of Newton's method: it doubles the digits of a root that least squares have found to three.
_CORRECTIONS = 6
#: Rounding of a residual, over its slopes times its arguments.
_ROUNDING = 1e-10
#: Least product of slopes and arguments that counts.
_SMALLEST = 1e-6
#: Least singular value of the slopes at a root, relative to the largest.
_REGULAR = 1e-12
#: The same at a least square, which is not polished.
_DETERMINED = 1e-8


class Conditions:
    """Compiled conditions of one kind."""

    def __init__(self, name: str, count: int) -> None:
        self._address = shipped_module(name).ADDRESSES["conditions"]
        self._count = count

    def __call__(self, rows: Array) -> tuple[Array, Array]:
        """Return residual (rows, conditions) and slopes (rows, conditions, quantities)."""
        number, size = rows.shape
        out, none = np.empty((number, self._count * (1 + size))), np.empty((number, 1))
        sizes = (0, size, 0, 0, 0, out.shape[1])
        _core.call_many(self._address, sizes, none[:, 0], rows, size, none[0], none, out)
        return out[:, : self._count], out[:, self._count :].reshape(number, self._count, size)


@cache
def conditions(name: str, count: int) -> Conditions:
    """Return the compiled conditions of a shipped block, loaded once."""
    return Conditions(name, count)


@dataclass(frozen=True, slots=True)
class RootSearch:
    """Roots, and the least residual of the starts that led to none (infinite without such a start).

    ``singular`` counts roots that are not isolated: at them the conditions do not determine the unknowns.
    ``incomplete`` is the reason why there may be other roots, empty if there are none.
    """

    roots: tuple[Array, ...]
    starts: int
    nearest: float
    singular: int = 0
    incomplete: str = ""


def search(
    equations: Callable[[Array], tuple[Array, Array]],
    starts: Iterable[Array],
    fit: bool = False,
    followed: bool = False,
) -> RootSearch:
    """Return the distinct roots of residual(x) = 0, or, to ``fit``, the distinct least squares.

    Least squares by Levenberg and Marquardt; roots are polished by Newton's method until they change by
    rounding alone. Starts that were ``followed`` to regular roots may be ill-conditioned: the rounding of
    their equations, which keeps Newton's method from settling near singular roots, is permitted.
    """
    from scipy.optimize import leastsq

    roots: list[Array] = []
    last, slopes = np.empty(0), np.empty(0)

    def residual(x: Array) -> Array:
        nonlocal last, slopes
        last = x.copy()
        value, slopes = equations(x)
        return value

    def slopes_at(x: Array) -> Array:
        return slopes if np.array_equal(x, last) else equations(x)[1]

    nearest, count, singular = np.inf, 0, 0
    for start in starts:
        count += 1
        with np.errstate(all="ignore"):
            x, _, info, _, ended = leastsq(
                residual, start, Dfun=slopes_at, full_output=True,
                xtol=1e-12, ftol=1e-14, gtol=1e-14, maxfev=_EVALUATIONS,
            )  # fmt: skip
        size = max(1.0, float(np.abs(x).max()))
        if not np.isfinite(x).all():
            continue
        if fit:
            sizes = np.linalg.svd(equations(x)[1], compute_uv=False)
            settled, regular = ended in _ENDED, bool(sizes[-1] > _DETERMINED * sizes[0])
        else:
            polished, regular = _polished(equations, x, _LOOSE if followed else 0.0)
            settled = polished is not None
            x = x if polished is None else polished
        if not settled:
            nearest = min(nearest, float(np.linalg.norm(info["fvec"])))
            continue
        if not regular:
            singular += 1
            continue
        if all(np.abs(x - other).max() > _SAME * size for other in roots):
            roots.append(x)
    incomplete = f"{count} random starts find some linkages; more starts may find others"
    return RootSearch(tuple(roots), count, nearest, singular, incomplete)


def _polished(
    equations: Callable[[Array], tuple[Array, Array]], x: Array, loose: float
) -> tuple[Array | None, bool]:
    """Return the root next to x, None where Newton's method does not settle; and whether it is isolated.

    ``loose`` is the largest relative change that rounding of ill-conditioned equations may make.
    """
    for _ in range(_CORRECTIONS):
        residual, slopes = equations(x)
        if not (np.isfinite(residual).all() and np.isfinite(slopes).all()):
            return None, False
        left, sizes, right = np.linalg.svd(slopes, full_matrices=False)
        regular = bool(sizes[-1] > _REGULAR * sizes[0])
        inverse = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > _REGULAR * sizes[0])
        step = right.T @ (inverse * (left.T @ residual))
        size = max(1.0, float(np.abs(x).max()))
        if np.abs(step).max() > _NEAR_ROOT * size:
            return None, False
        x = x - step
        rounding = _ROUNDED * np.finfo(float).eps * sizes[0] / max(sizes[-1], _REGULAR * sizes[0])
        if np.abs(step).max() <= max(_SETTLED, min(rounding, loose)) * size:
            return (x, regular) if _vanishes(residual, slopes, x) else (None, False)
    return None, False


def _vanishes(residual: Array, slopes: Array, x: Array) -> bool:
    """Return whether a residual is the rounding of its arguments."""
    rounding = np.abs(slopes) @ np.maximum(np.abs(x), 1.0)
    return bool((np.abs(residual) <= _ROUNDING * np.maximum(rounding, _SMALLEST)).all())


#: Links whose lengths or places differ by less, relative to the size of the task, are one link.
ONE_LINK = 1e-6


class Solutions(NamedTuple):
    """Linkages and their prescribed poses: values of crank and rocker or slider, or poses of the coupler."""

    linkages: list[Any]
    poses: list[Array]
    search: RootSearch


def equations_at(rows: Conditions, full: Array, which: NDArray[np.intp], size: int = 0) -> Equations:
    """Return a condition at the rows of ``full``, where ``which`` is the unknown's number or -1 if known.

    ``size`` is the number of unknowns, that of those at the rows when absent.
    """
    row, column = np.nonzero(which >= 0)
    number = which[row, column]
    size = size or int(number.max()) + 1

    def equations(unknown: Array) -> tuple[Array, Array]:
        full[row, column] = unknown[number]
        residual, single = rows(full)
        slopes = np.zeros((len(full), size))
        slopes[row, number] = single[row, 0, column]
        return residual.ravel(), slopes

    return equations


def numbered(full: Array, free: list[int]) -> NDArray[np.intp]:
    """Return the numbers of unknowns, in the columns ``free`` and the same in all rows; -1 elsewhere."""
    which = np.full(full.shape, -1)
    which[:, free] = np.arange(len(free))
    return which


def same(one: Array, other: Array, size: float) -> bool:
    """Return whether coordinates agree, relative to their size."""
    return bool(np.abs(one - other).max() <= ONE_LINK * max(size, float(np.abs(one).max())))


def distinct(
    linkages: list[Any], poses: list[Array], size: float, unit: float
) -> tuple[list[Any], list[Array]]:
    """Return linkages without repetitions: those of least error, in its unit, and shortest links first."""
    unique: list[tuple[Any, Array]] = []
    order = sorted(
        zip(linkages, poses, strict=True), key=lambda x: (round(x[0].error / unit, 9), *x[0].lengths.values())
    )
    for linkage, unknowns in order:
        if not any(same(linkage.places, other.places, size) for other, _ in unique):
            unique.append((linkage, unknowns))
    return [k for k, _ in unique], [p for _, p in unique]


def enough(conditions: int, unknowns: int, noun: str, which: str) -> None:
    """Raise SceneError where nothing is unknown, or conditions do not determine the unknowns."""
    if not unknowns:
        raise SceneError(
            "expected at least one unknown, got all quantities prescribed",
            hint=f"Prescribe fewer of: {which}.",
        )
    if conditions < unknowns:
        raise SceneError(
            f"{conditions} conditions do not determine {unknowns} unknowns",
            hint=f"Give more {noun} or prescribe some of: {which}.",
        )


def size_of(places: Array) -> float:
    """Return the size of the points; raise SceneError if they are one."""
    size = float(np.linalg.norm(np.ptp(places, axis=0)))
    if not size >= SIZES[0]:
        raise SceneError(f"expected points at different places, got {size:g} m between them", where="points")
    return size
