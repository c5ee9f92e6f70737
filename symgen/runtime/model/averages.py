"""Means, root mean squares and work of outputs over time, by quadrature within a tolerance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ResultError, SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.pace import noted_ends
from symgen.runtime.model.verbs import accepted
from symgen.runtime.result.records import Variable, columns

Names = NDArray[np.str_]
#: Relative error of means and root mean squares, of the mean magnitude of the output.
RTOL = 1e-8
#: Positive nodes of the Gauss-Kronrod rule of 7 and 15 points, and the weights of both (QUADPACK, QK15).
_NODES = (
    *(0.991455371120812639206854697526329, 0.949107912342758524526189684047851),
    *(0.864864423359769072789712788640926, 0.741531185599394439863864773280788),
    *(0.586087235467691130294144691258410, 0.405845151377397166906606412076961),
    0.207784955007898467600689403773245,
)
_KRONROD = (
    *(0.022935322010529224963732008058970, 0.063092092629978553290700663189204),
    *(0.104790010322250183839876322541518, 0.140653259715525918745189590510238),
    *(0.169004726639267902826583426598550, 0.190350578064785409913256402421014),
    *(0.204432940075298892414161999234649, 0.209482141084727828012999174891714),
)
_GAUSS = (
    *(0.0, 0.129484966168869693270611432679082, 0.0, 0.279705391489276667901467771423780),
    *(0.0, 0.381830050505118944950369775488975, 0.0, 0.417959183673469387755102040816327),
)
NODES = np.array([*(-x for x in _NODES), 0.0, *reversed(_NODES)])
KRONROD, GAUSS = (np.array([*of, *reversed(of[:-1])]) for of in (_KRONROD, _GAUSS))
#: Panels of a prescribed motion at first, most panels of a pass, parts of a divided panel, and most passes.
_PANELS, _MOST_PANELS, _PARTS, _PASSES = 64, 4_000, 8, 12
#: Passes in which extremes are refined, and most peaks of an output next to its greatest.
_REFINED, _PEAKS = 4, 4
#: Values that differ by this part of the largest are alike: the extreme is at the first of them.
_ALIKE = 1e-14
#: Part of the largest output of the same unit below which errors are those of this part.
_FAINT = 1e-6
#: Units of outputs that are continuous where rank is lost; relative error of means of others, with poles.
_OF_MOTION, _UNSURE = ("m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "J"), 1e-4
#: Growth of the largest value by divided panels, over which values have no bound.
_GROWS = 4.0


@dataclass(frozen=True, slots=True)
class Average:
    """Mean, root mean square and extremes of an output over the time of a motion, in its unit in SI.

    ``minimum`` and ``maximum``, at ``minimum_at`` and ``maximum_at`` [s], are those of the motion: samples
    have no effect on them. Of a power, ``positive_work`` and ``negative_work`` are the integrals [J] over the
    times at which it is positive and negative, and ``work`` is their sum; None for other outputs. ``error``
    is that of the mean, as the quadrature estimates it: of an output that is round-off alone it is as large
    as the output. All are nan where the integral does not converge, as over a pole.
    """

    mean: float
    rms: float
    positive_work: float | None = None
    negative_work: float | None = None
    error: float = 0.0
    minimum: float = np.nan
    minimum_at: float = np.nan
    maximum: float = np.nan
    maximum_at: float = np.nan

    @property
    def work(self) -> float | None:
        """Integral of a power [J]."""
        if self.positive_work is None or self.negative_work is None:
            return None
        return self.positive_work + self.negative_work


def averages(result: Any, rtol: float = RTOL, *, magnitudes: bool = False) -> dict[str, Average]:
    """Return the averages of a result by component, or of the ``magnitudes`` of vectors.

    They are over the time from the first sample to the last, of a run that an event ends to this event.
    Their samples are those of a quadrature, for which the analysis is repeated: the panels end where steps
    end, and are divided until the error is within ``rtol`` of the mean magnitude.

    Raises
    ------
    ResultError
        For results that cannot be repeated at other times, or have no duration.
    """
    repeat, names = _repeated(result), [v.name for v in result.variables]
    first, last = float(np.min(result.time)), float(np.max(result.time))
    if result.origin and result.origin[1] == "simulate" and result.origin[2].get("t_eval") is None:
        last = max(last, float(result.statistics.get("t", last)))
    if last == first:
        raise ResultError("means need a range of time, got one sample")

    def components(of: Any) -> Sequence[Variable]:
        variables = [of.variable(name) for name in names]
        if magnitudes:
            sizes = (np.linalg.norm(v.values, axis=-1) if v.components else v.values for v in variables)
            variables = [replace(v, components=(), values=x) for v, x in zip(variables, sizes, strict=True)]
        return columns(variables)

    known = components(result)
    powers, units = np.array([[v.unit == "W"] for v in known]), np.array([v.unit for v in known])

    def values(times: Array) -> Array:
        found = repeat(times)
        rows = np.array([v.values for v in components(found)]).reshape(len(known), -1)
        if not np.array_equal(found.time, times):  # samples are moved in time next to losses of rank
            moved.append(True)
            for k in np.flatnonzero(np.isin(units, _OF_MOTION)):
                rows[k] = np.interp(times, found.time, rows[k])
        return rows

    nodes, moved = list[tuple[Array, Array]](), list[bool]()

    def integrands(times: Array) -> Array:
        y = values(times)
        nodes.append((times, y))
        return np.stack([y, y**2, np.where(powers, np.maximum(y, 0.0), 0.0), np.abs(y)], axis=1)

    duration = last - first
    exchanged = result.drift.measured.get("energy_exchanged", 0.0)
    scales = np.array([{"J": exchanged * duration, "W": exchanged}.get(v.unit, 0.0) for v in known])
    try:
        panels = _panels(result, first, last)
        sums, errors = integrals(integrands, panels, rtol, units, scales)
        try:
            nodes.append((panels, values(panels)))
        except SimulationError:  # a pose there may determine no forces; samples omit it
            nodes.append((result.time, np.array([v.values for v in known]).reshape(len(known), -1)))
        found = extremes(values, *(np.concatenate(x, axis=-1) for x in zip(*nodes, strict=True)))
    except SimulationError as error:
        raise ResultError(f"the motion has no mean over time: {error}") from error
    by_name = {}
    missed = np.maximum(errors[:, 0], np.finfo(float).eps * sums[:, 3]) / duration
    if moved:  # forces may have a pole there
        sums[errors[:, 0] > _UNSURE * sums[:, 3]] = np.nan
    found[~np.isfinite(sums[:, 0])] = np.nan
    rows = zip(known, sums.tolist(), missed.tolist(), found.tolist(), strict=True)
    for v, (whole, square, positive, _), by, ends in rows:
        up, down = (positive, whole - positive) if v.unit == "W" else (None, None)
        by_name[v.name] = Average(whole / duration, float(np.sqrt(square / duration)), up, down, by, *ends)
    return by_name


def extremes(values: Callable[[Array], Array], times: Array, known: Array) -> Array:
    """Return least value, its time [s], greatest value and its time of functions of the time, (outputs, 4).

    ``known`` (outputs, times) are values at times, dense enough to show every extreme. Next to the extremes
    the functions are evaluated again, at the vertices of parabolas through three values.
    """
    for passes in range(_REFINED + 1):
        order = np.argsort(times, kind="stable")
        order = order[np.diff(times[order], prepend=-np.inf) > 0]
        times, known = times[order], known[:, order]
        near = [_near_peaks(times, sign * row) for row in known for sign in (-1.0, 1.0)]
        new = np.sort(np.concatenate(near))
        place = np.minimum(np.searchsorted(times, new), len(times) - 1)
        new = new[(times[place] != new) & (np.diff(new, prepend=-np.inf) > 0)]
        if not len(new) or passes == _REFINED:
            break
        with suppress(SimulationError):  # as above
            times, known = np.append(times, new), np.append(known, values(new), axis=1)
    found = np.full((len(known), 4), np.nan)
    for k, row in enumerate(np.where(np.isfinite(known), known, np.nan)):
        if not np.all(np.isnan(row)):
            least, greatest, alike = np.nanmin(row), np.nanmax(row), _ALIKE * np.nanmax(np.abs(row))
            low, high = np.argmax(row <= least + alike), np.argmax(row >= greatest - alike)  # the first ones
            found[k] = least, times[low], greatest, times[high]
    return found


def _near_peaks(times: Array, values: Array) -> Array:
    """Return times [s] next to the greatest values, at which a smooth function may be greater than all."""
    y = np.where(np.isfinite(values), values, -np.inf)
    k = 1 + np.flatnonzero((y[1:-1] >= y[:-2]) & (y[1:-1] >= y[2:]) & np.isfinite(y[:-2] + y[2:]))
    before, after = times[k] - times[k - 1], times[k + 1] - times[k]
    down, up = (y[k] - y[k - 1]) / before, (y[k + 1] - y[k]) / after
    bend = (down - up) / (before + after)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend > 0, ((down * after + up * before) / (before + after)) / (2 * bend), 0.0)
    rise = np.maximum(down * before, -up * after)  # more than a smooth function rises between the three
    k, shift = (x[y[k] + rise >= np.max(y)] for x in (k, shift))
    k, shift = (x[np.argsort(-y[k], kind="stable")[:_PEAKS]] for x in (k, shift))
    vertex = np.clip(times[k] + shift, times[k - 1], times[k + 1])
    return np.concatenate([vertex, (times[k] + times[k - 1]) / 2, (times[k] + times[k + 1]) / 2])


def _repeated(result: Any) -> Callable[[Array], Any]:
    """Return the function that repeats an analysis at other times [s]."""
    origin: tuple[Any, str, dict[str, Any]] = result.origin or (None, "", {})
    model, verb, arguments = origin
    if model is not None and result.KIND != "elastic":
        known = accepted(model, verb)
        if verb == "simulate" and "t_eval" in known:
            return result.at
        among = {"at", "over"} <= known and arguments.get("at") is None and not arguments.get("through")
        if verb in ("kinematics", "inverse_dynamics") and among:
            range_of = ("start", "stop", "samples", "at", "over")
            same = {k: v for k, v in arguments.items() if k not in range_of}
            return lambda times: getattr(model, verb)(**same, at=times, over="time")
    raise ResultError(
        "only runs of rigid mechanisms, kinematics and inverse dynamics over a range, all of this process, "
        "have means over time"
    )


def _panels(result: Any, first: float, last: float) -> Array:
    """Return the ends of the first panels: those of the steps of a run, which end at switching points.

    Of a prescribed motion with switching points they are those of a run through it.
    """
    origin: tuple[Any, str, dict[str, Any]] = result.origin or (None, "", {})
    model, verb, arguments = origin
    same = {name: x for name, x in arguments.items() if name not in ("samples", "t_eval", "max_wall")}
    if model is None or verb != "simulate":
        if model is None or not getattr(model.description, "switches", ()):
            return np.linspace(first, last, _PANELS + 1)
        if first < 0.0:
            raise ResultError(
                "means of prescribed motions with switching points are those of times from 0 on, got a range "
                f"from {first:g} s"
            )
        same = {"t_end": last, **({"state": arguments["state"]} if arguments.get("state") else {})}
    with noted_ends() as ends:
        model.simulate(**same, t_eval=[last])
    inside = np.array(sorted({float(t) for t in ends if first < t < last}))  # np.unique imports numpy.ma
    if len(inside) > _MOST_PANELS:
        raise ResultError(f"runs of at most {_MOST_PANELS} steps have means, got {len(inside)} steps")
    return np.array([first, *inside, last])


def integrals(
    integrands: Callable[[Array], Array], ends: Array, rtol: float, units: Names, scales: Array
) -> tuple[Array, Array]:
    """Return the integrals (outputs, 4) of functions of the time, (outputs, 4, times), over panels; errors.

    The four are a value, its square, its positive part and its magnitude. Integrals that do not converge are
    nan where values grow as panels are divided, as at a pole. Where they do not, as round-off, the error is
    that of the mean of as many values. Integrals far below others of their unit, or below ``scales``
    (outputs,), are round-off.
    """
    panels, left = np.stack([ends[:-1], ends[1:]], axis=1), np.zeros((0, 2))
    alike = units[:, None] == units
    kept: list[Array] = []
    before, passes, first = np.array(np.inf), 0, np.array(np.inf)
    while True:
        sums, errors, peaks = _rules(integrands, panels)
        first = peaks if passes == 0 else first
        grows = ~(peaks <= _GROWS * first)
        if kept:
            sums, errors = (np.concatenate(pair) for pair in zip(kept, (sums, errors), strict=True))
        panels = np.concatenate([left, panels])
        whole, error = np.sum(sums, axis=0), np.sum(errors, axis=0)
        largest = np.where(alike[:, :, None] & np.isfinite(whole), whole, 0.0).max(axis=1, initial=0.0)
        size = np.maximum(whole[:, 3], _FAINT * np.maximum(largest[:, 3], scales))
        faint = np.maximum(largest[:, 1], scales**2 / (ends[-1] - ends[0]))
        square = np.maximum(whole[:, 1], _FAINT**2 * faint)
        allowed = rtol * np.stack([size, square, size, np.full_like(size, np.inf)], axis=1)
        large = (errors > allowed / (2 * len(panels))) & (error > allowed)
        # The error of a kink or a jump is that of one panel, and falls in the end. Round-off is in all.
        large &= (error < before / 2) | (_PARTS * np.sum(large, axis=0) < len(panels))
        divided = np.any(large, axis=(1, 2))
        passes += 1
        if not 0 < _PARTS * np.count_nonzero(divided) < _MOST_PANELS or passes == _PASSES:
            lost = ~(error <= allowed) & grows[:, None]
            return np.where(lost, np.nan, whole), np.where(lost, np.nan, error)
        before, kept, left = error, [sums[~divided], errors[~divided]], panels[~divided]
        edges = np.linspace(panels[divided, 0], panels[divided, 1], _PARTS + 1, axis=1)
        panels = np.stack([edges[:, :-1], edges[:, 1:]], axis=2).reshape(-1, 2)


def _rules(integrands: Callable[[Array], Array], panels: Array) -> tuple[Array, Array, Array]:
    """Return the integrals over panels (panels, outputs, 4) and their errors, as QUADPACK estimates them.

    The third are the largest magnitudes (outputs,).
    """
    half, middle = (panels[:, 1] - panels[:, 0]) / 2, (panels[:, 1] + panels[:, 0]) / 2
    order = np.argsort(middle)
    times = middle[order, None] + half[order, None] * NODES
    found = integrands(times.ravel())
    values = np.empty((len(panels), *found.shape[:2], len(NODES)))
    values[order] = np.moveaxis(found.reshape(*found.shape[:2], len(panels), len(NODES)), 2, 0)
    half = half[:, None, None]
    whole = half * (values @ KRONROD)
    apart = np.abs(whole - half * (values @ GAUSS))
    spread = half * (np.abs(values - (whole / (2 * half))[..., None]) @ KRONROD)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(spread > 0, np.minimum(1.0, (200 * apart / spread) ** 1.5), 0.0)
    errors = spread * ratio
    # The positive part has a kink, which both rules may miss alike, or beside their nodes: ends by a line.
    y, x = values[:, :, 0], np.concatenate([[-1.0], NODES, [1.0]])
    ends = (
        y[..., k] + (y[..., k] - y[..., n]) * (x[0] - x[1]) / (x[1] - x[2]) for k, n in ((0, 1), (-1, -2))
    )
    y = np.concatenate([next(ends)[..., None], y, next(ends)[..., None]], axis=-1)
    before, after = y[..., :-1], y[..., 1:]
    kinks = np.where(before * after < 0, (np.abs(before) + np.abs(after)) * np.diff(x) / 4, 0.0)
    errors[:, :, 2] = np.maximum(errors[:, :, 2], half[:, :, 0] * np.max(kinks, axis=-1))
    return whole, errors, np.max(found[:, 3], axis=-1)
