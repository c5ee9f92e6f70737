"""Initial states of linkages with elastic links in space: undeformed, quasi-static, or deflected by modes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.modal.structure import modes_at_rest
from symgen.runtime.elastic.large.collocation import MotionState
from symgen.runtime.elastic.large.statics import (
    at_rest,
    equilibrium,
    linearised,
    moved_by_loads,
    unbalanced,
)
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.modes import modes_of
from symgen.runtime.elastic.static import check_amplitudes, check_modes
from symgen.runtime.newton import corrected

#: Poses from the start on by whose differences equilibria and shapes have rates.
_POSES = 9
#: Interval of the poses over the duration of the scene, number of intervals from it on that are tried, each
#: the one before over pi (no two are multiples of a load's period), and the change of the rates, over their
#: size, that they may settle to.
_APART, _SHORTER, _SETTLED = 1e-2, 8, 1e-5
#: Rates, over the size of an unknown and the interval, that are round-off of the equilibria.
_ROUNDED = 1e-9
#: Fractions of an element at which the largest displacement of a mode is looked for.
_PLACES = np.linspace(0.0, 1.0, 17)
#: Part of frequencies and displacements by which those that count as alike differ.
_ALIKE = 1e-6
#: Change of unknowns from the drawing to the equilibrium, over their size, beyond which a start about one is
#: not one at the other.
_FAR = 0.1
#: Corrections at most that put a deflected shape on the constraints, and their size over that of unknowns.
_MOST, _CLOSE = 20, 1e-13


def initial(linkage: LinkageInSpace, state: str | Sequence[float]) -> MotionState:
    """Return the motion at the start: ``undeformed``, ``quasi-static``, or deflected by modes [m].

    Raises
    ------
    ModelError
        Without an equilibrium; with first-order states; for motions or loads that jump at the start; for more
        amplitudes than modes, and those that are not far below the length of the links.
    """
    if state == "undeformed":
        return linkage.start()
    if len(linkage.states):
        raise ModelError(
            f"{linkage.name}: expected an undeformed start for a scene with [states], which bend links as "
            f"they change, got initial = {state!r}\n  Leave initial out."
        )
    if isinstance(state, str):
        return quasi_static(linkage)
    return deflected(linkage, state)


def quasi_static(linkage: LinkageInSpace) -> MotionState:
    """Return the shape under loads and inertia at the start, and its rates: the motion without vibrations.

    The equilibria with the input held at successive times have rates and second rates. Their inertia and
    damping bend the shapes at these times further, to the first order; the rates are those of these shapes.
    """
    start = equilibrium(linkage, 0.0)
    if linkage.rigid.description.freedom and moved_by_loads(linkage):  # else links bend, by any angle
        _check_near(linkage, start, "a quasi-static start, which is")
    before: MotionState | None = None
    usual = _APART * linkage.rigid.description.t_end
    longest = max(usual, _time_of_vibrations(linkage, start))
    tries = _SHORTER + math.ceil(math.log(longest / usual, math.pi))
    for apart in (longest / np.pi ** np.arange(tries)).tolist():
        try:
            moment = _slow(linkage, start, apart)
        except ModelError:
            continue
        if before is not None:
            size = float(np.max(np.abs(moment.v / linkage.scale)))
            change = float(np.max(np.abs(moment.v - before.v) / linkage.scale))
            if change <= _SETTLED * size + _ROUNDED / apart:
                return before
        before = moment
    raise ModelError(
        f"{linkage.name}: the quasi-static shape has no rate: loads move the linkage with its input held, "
        "or a motion or load jumps at the start\n  Start it undeformed."
    )


def _time_of_vibrations(linkage: LinkageInSpace, rest: MotionState) -> float:
    """Return the inverse of the lowest angular frequency w about an equilibrium [s]; 0 where there is none.

    Second rates of equilibria bend shapes, which have rates in turn: intervals h divide round-off by h^3 w^2.
    """
    of = linearised(linkage, rest)
    try:
        frequencies, _, rigid = modes_at_rest(linkage.name, of.mass, of.stiffness, of.sizes)
    except ModelError:  # unstable, or without mass
        return 0.0
    return float(1 / frequencies[rigid]) if rigid < len(frequencies) else 0.0


def _slow(linkage: LinkageInSpace, start: MotionState, apart: float) -> MotionState:
    """Return the quasi-static shape with its rates, by poses at an interval [s]."""
    times = apart * np.arange(_POSES)
    held = [start]
    for t in times[1:].tolist():
        now = replace(held[-1], t=t)
        same = np.array_equal(unbalanced(linkage, now), unbalanced(linkage, held[-1]))
        held.append(now if same else at_rest(linkage, now))
    places = np.array([x.q - start.q for x in held])  # exactly zero where nothing moves
    rates, second = (_differences(times, order) @ places for order in (1, 2))
    shapes = [at_rest(linkage, replace(x, v=v, a=a)) for x, v, a in zip(held, rates, second, strict=True)]
    v = _differences(times, 1)[0] @ np.array([x.q - shapes[0].q for x in shapes])
    still, none = np.zeros(linkage.unknowns), np.zeros(linkage.multipliers)
    return linkage.with_rates(MotionState(0.0, shapes[0].q, v, still, none))


def _differences(times: NDArray[Any], order: int) -> Array:
    """Return the matrix (times, times) from values at times to derivatives of their polynomial there."""
    span = times[-1]
    powers = np.vander(times / span, increasing=True)
    slopes = np.zeros_like(powers)
    for k in range(order, len(times)):
        slopes[:, k] = np.prod(np.arange(k - order + 1, k + 1)) * powers[:, k - order]
    return slopes @ np.linalg.inv(powers) / span**order


def deflected(linkage: LinkageInSpace, amplitudes: Sequence[float]) -> MotionState:
    """Return the undeformed start deflected by modes, with its rates.

    Amplitudes [m] are the largest displacements of elastic links in the first modes that strain the linkage,
    about its equilibrium with the input held; see :func:`_oriented` for their signs.
    """
    check_amplitudes(linkage.name, amplitudes, max(float(link.length.real) for link in linkage.links))
    modes, moment = modes_of(linkage, 0.0), linkage.start()
    _check_near(linkage, equilibrium(linkage, 0.0), "initial modes, which are")
    shapes = modes.shapes[:, modes.rigid :].T
    check_modes(linkage.name, amplitudes, len(shapes))
    q = moment.q
    oriented = _oriented(linkage, modes.frequencies[modes.rigid :], shapes)
    for size, (shape, largest) in zip(amplitudes, oriented, strict=False):
        q = q + size / largest * shape
    still = np.zeros(linkage.unknowns)
    slopes = linkage.slopes(moment.t, moment.q, moment.v, moment.a, moment.multipliers)
    solve = linkage.pattern.factorised(slopes.mass + slopes.jacobian)

    def change(q: Array, _: Array) -> Array:
        return np.asarray(-solve(np.append(still, linkage.errors(moment.t, q)))[: linkage.unknowns])

    found = corrected(q, change, lambda _: linkage.scale, _MOST, close=_CLOSE)
    if found is not None:
        return linkage.with_rates(replace(moment, q=found))
    raise ModelError(
        f"{linkage.name}: the constraints do not hold with initial modes of these amplitudes\n"
        "  Give smaller amplitudes."
    )


def _check_near(linkage: LinkageInSpace, rest: MotionState, noun: str) -> None:
    """Refuse an equilibrium far from the drawing: the linkage hangs elsewhere."""
    apart = float(np.max(np.abs(rest.q - linkage.start().q) / linkage.scale))
    if apart > _FAR:
        raise ModelError(
            f"{linkage.name}: expected an equilibrium near the drawing for {noun} about "
            f"it, got one in which unknowns differ by {apart:.2g} of their size\n"
            "  Draw the linkage near its equilibrium with the input held, or start it undeformed."
        )


def _oriented(linkage: LinkageInSpace, frequencies: Array, shapes: Array) -> Iterator[tuple[Array, float]]:
    """Yield shapes of modes (modes, unknowns) with signs, and their largest displacements [m].

    The largest component of the largest displacement is positive; of several alike, the first one. Sums of
    modes with one frequency are modes too: the first one has all of this component. So the state does not
    depend on round-off or on the number of elements.
    """
    from scipy.linalg import null_space

    # Places are linear in the unknowns.
    still, links = np.zeros_like(shapes), linkage.links
    places = [
        np.stack([k.values("section", shapes, still, still, fraction=x)[..., -3:] for x in _PLACES], axis=2)
        for k in links
    ]
    displaced = np.concatenate([x.reshape(len(shapes), -1, 3) for x in places], axis=1)
    apart = np.flatnonzero(np.diff(frequencies) > _ALIKE * frequencies[1:]) + 1
    for of_one, displaced_in in zip(np.split(shapes, apart), np.split(displaced, apart), strict=True):
        modes, moved = of_one, displaced_in
        while len(modes):
            sizes = np.linalg.norm(moved, axis=0)
            place = _first_largest(np.linalg.norm(sizes, axis=1))
            by_mode = moved[:, place, _first_largest(sizes[place])]
            weights = by_mode / np.linalg.norm(by_mode)
            yield weights @ modes, float(np.max(np.linalg.norm(np.tensordot(weights, moved, 1), axis=1)))
            others = null_space(weights[None]).T
            modes, moved = others @ modes, np.tensordot(others, moved, 1)


def _first_largest(sizes: Array) -> int:
    """Return the number of the first size that is the largest, or like it."""
    return int(np.flatnonzero(sizes >= (1 - _ALIKE) * np.max(sizes))[0])
