"""Jumps of derivatives along a run where loads take another branch, and slopes at the times of events."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.linearisation.tangents import Tangents

#: Time within which two switching points are one [s], and the relative difference of equal slopes of it.
_AT_ONCE, _SAME = 1e-9, 1e-6
#: Difference of jumps over the rates of the state that is rounding.
_EQUAL = 1e-9


@dataclass(frozen=True, slots=True)
class Jump:
    """The change of derivatives where a load takes its other branch: the saltation matrix.

    dy += (f_before - f_after) dt_s: the rates f of the state jump, at a time t_s that changes with state and
    parameters as g(t_s, y, p) = 0 demands (Leine and Nijmeijer, *Dynamics and Bifurcations of Non-Smooth
    Mechanical Systems*, section 7.3). ``change`` is the jump; ``by_state`` and ``direct`` give dt_s.
    """

    step: int
    change: Array
    by_state: Array
    direct: Array


def jumps_between(
    t: Array, references: Array, switches: int, tangents: Callable[[int, Array], Tangents], by: Sequence[str]
) -> list[Jump]:
    """Return the jumps of derivatives at switching points, in the order of the steps that end there.

    Parameters
    ----------
    t, references
        Times [s] of the steps from the start on, and references after each, a row each.
    switches
        Number of the last columns of these that are branches of loads.
    tangents
        Returns the linearised motion at the state after a step, with the references of a row.
    by
        Names of the directions.
    """
    places, crossings = np.arange(references.shape[1] - switches, references.shape[1]), list[Jump]()
    branches = references[:, places]
    changed = (np.flatnonzero(np.any(np.diff(branches, axis=0), axis=1)) + 1).tolist()
    while changed:
        first = last = changed.pop(0)
        held = branches[first] == branches[first - 1]
        # Switching points at one time end several steps, in the order of rounding.
        while changed and t[changed[0]] <= t[first] + _AT_ONCE:
            now = branches[changed[0]] == branches[last]
            if not np.all(held | now):
                break
            held &= now
            last = changed.pop(0)

        before = tangents(first, references[first - 1])

        def lost(gaps: Sequence[int]) -> Array:
            """Return what the rates of the state lose where some gaps pass zero."""
            row = references[first - 1].copy()  # noqa: B023  # called in this pass of the loop
            row[places[gaps]] = references[last, places[gaps]]  # noqa: B023
            return np.asarray(before.moving - tangents(first, row).moving)  # noqa: B023

        crossings += _at_once(last, before, lost, np.flatnonzero(~held).tolist(), by)
    return crossings


def _at_once(
    step: int,
    at: Tangents,
    lost: Callable[[Sequence[int]], Array],
    gaps: list[int],
    by: Sequence[str],
) -> Iterator[Jump]:
    """Yield the jumps of derivatives where gaps pass zero at one time.

    A gap that is not zero there changes sign with another one, such as that of a profile of the remainder
    ``mod`` with the remainder. Gaps whose times change alike pass together. Those whose times change
    differently pass in either order, and derivatives exist if the order makes no difference.

    Raises
    ------
    ModelError
        Where it does: motions beside are not linear.
    """
    names = [f"switch.{k}" for k in gaps]
    rates = np.array([_rate(at, gap) for gap in names])
    values = np.array([at.slopes.values[gap] for gap in names])
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.where(rates != 0.0, np.abs(values / rates), np.inf)
    there = [k for k, far in zip(gaps, away, strict=True) if far <= np.min(away) + _AT_ONCE]
    groups = list[tuple[list[int], tuple[Array, Array]]]()
    for k in there:
        time = passing(at, f"switch.{k}", by)
        like = next((g for g, other in groups if _alike(time, other)), None)
        if like is None:
            groups.append(([k], time))
        else:
            like.append(k)
    if len(groups) == 1:
        groups = [(gaps, groups[0][1])]
    else:
        _check_order(at, lost, [g for g, _ in groups], len(there) < len(gaps))
    for group, time in groups:
        change = lost(group)
        if np.any(change):
            yield Jump(step, change, *time)


def _alike(time: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    """Return whether the times of two switching points change alike."""
    a, b = np.concatenate(time), np.concatenate(other)
    return bool(np.allclose(a, b, rtol=_SAME, atol=_SAME * np.max(np.abs(b))))


def _check_order(
    at: Tangents,
    lost: Callable[[Sequence[int]], Array],
    groups: Sequence[Sequence[int]],
    others: bool,
) -> None:
    """Raise ModelError if rates, or times, depend on the order in which groups of gaps pass zero.

    ``others`` are gaps that change sign with some of these.
    """
    alone = [lost(group) for group in groups]
    size = _SAME * float(np.max(np.abs(alone))) + _EQUAL * float(np.max(np.abs(at.moving)))
    differs = others or any(
        np.max(np.abs(lost([k for i in some for k in groups[i]]) - sum(alone[i] for i in some))) > size
        for count in range(2, len(groups) + 1)
        for some in combinations(range(len(groups)), count)
    )
    for i, group in enumerate(groups):
        row = at.slopes.outputs[f"switch.{group[0]}"][: 2 * at.n]
        differs |= any(
            abs(row @ change) > _SAME * abs(_rate(at, f"switch.{group[0]}"))
            for j, change in enumerate(alone)
            if j != i
        )
    if differs:
        raise ModelError(
            f"loads switch at once, at {at.state.t:.6g} s, parameters move their times apart, and the motion "
            "depends on which is first: there are no derivatives\n"
            "  Change a parameter a little, or end before this time."
        )


def _rate(at: Tangents, gap: str) -> float:
    """Return the rate of a gap along the motion."""
    row = at.slopes.outputs[gap]
    return float(row[: 2 * at.n] @ at.moving + row[-1])


def passing(at: Tangents, gap: str, by: Sequence[str]) -> tuple[Array, Array]:
    """Return the derivatives of the time [s] at which a gap passes zero, by the state and by directions."""
    row, rate = at.slopes.outputs[gap], _rate(at, gap)
    return row[: 2 * at.n] / -rate, at.direct(row[None], by)[0] / -rate


def total_slopes(
    end: Tangents, outputs: Sequence[str], by: Sequence[str], event: str | None = None
) -> tuple[Array, Array]:
    """Return the slopes of outputs by the state (outputs, 2n), and by the directions at a held state.

    With the name of a gap, those at the time at which it passes zero, followed by the slopes of this time.
    """
    rows, residual = end.slopes.rows(outputs), end.slopes.residual
    by_multipliers = rows[:, end.by_solution]

    def total(columns: Callable[[Array], Array]) -> Array:
        return columns(rows) + by_multipliers @ end.solved(columns(residual))

    by_state, direct = total(lambda x: x[:, : 2 * end.n]), total(lambda x: end.direct(x, by))
    if event is None:
        return by_state, direct
    rate = by_state @ end.moving + total(lambda x: x[:, -1:])[:, 0]
    time = passing(end, event, by)
    return tuple(  # type: ignore[return-value]
        np.vstack([by + np.outer(rate, of_time), of_time])
        for by, of_time in zip((by_state, direct), time, strict=True)
    )
