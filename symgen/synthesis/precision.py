"""Four-bars through precision points: function, motion and path generation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.mechanics.synthesis.points import cognate
from symgen.scene.units import LENGTH, NUMBER
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.search import Conditions, Search, conditions, search
from symgen.synthesis.tasks import DYAD, FunctionTask, MotionTask, PathTask, value, values

Array = NDArray[np.float64]
Equations = Callable[[Array], tuple[Array, Array]]

_FUNCTION = ("d_over_a", "d_over_c", "third", "crank_start", "rocker_start", "input", "output")
#: Links whose lengths or places differ by less, relative to the size of the task, are one link.
_ONE_LINK = 1e-6
#: Least and greatest size of random places, in that of the task.
_SPREAD = 0.3, 10.0


class Found(NamedTuple):
    """Four-bars and their prescribed poses: angles of crank and rocker, or poses of the coupler."""

    linkages: list[FourBar]
    poses: list[Array]
    search: Search


def function(task: FunctionTask) -> Found:
    """Return four-bars whose rocker follows the crank as prescribed; poses are the angles of both [rad].

    Raises
    ------
    SceneError
        When input and output differ in number, or there are too few for the unknowns.
    """
    x, y = values(task.input, NUMBER, "input"), values(task.output, NUMBER, "output")
    size = value(task.fixed_link, LENGTH, "fixed_link")
    if len(x) != len(y):
        raise SceneError(f"expected as many outputs as inputs, {len(x)}, got {len(y)}", where="output")
    if size <= 0:
        raise SceneError(f"expected a length above zero, got {size:g} m", where="fixed_link")
    starts = {n: getattr(task, n) for n in ("crank_start", "rocker_start")}
    given = {n: value(text, NUMBER, n) for n, text in starts.items() if text is not None}
    free = [i for i, name in enumerate(_FUNCTION[:5]) if name not in given]
    _enough(len(x), len(free), "pairs of input and output", "crank_start or rocker_start")
    full = np.zeros((len(x), len(_FUNCTION)))
    full[:, 3:] = np.column_stack([np.full(len(x), given.get(n, 0.0)) for n in starts] + [x, y])
    equations = _equations(conditions("synthesis_function", 1), full, _numbered(full, free))
    generator = np.random.default_rng(task.seed)
    random = (_ratios(generator)[free] for _ in range(task.starts))
    found = search(equations, random, fit=len(x) > len(free))
    linkages, poses = [], []
    for root in found.roots:
        full[:, free] = root
        first, second, third, crank, rocker = full[0, :5]
        if min(abs(first), abs(second)) < _ONE_LINK:
            continue  # a crank or rocker without end, against the fixed link
        a, c = 1 / first, 1 / second
        if not a * a + c * c + 1 - 2 * a * c * third > _ONE_LINK**2:
            continue
        # A negative length is a link that points the other way.
        angles = np.column_stack([crank + x + (np.pi if a < 0 else 0), rocker + y + (np.pi if c < 0 else 0)])
        a, c = abs(a), abs(c)
        joint_a = a * np.array([np.cos(angles[0, 0]), np.sin(angles[0, 0])])
        joint_b = np.array([1 + c * np.cos(angles[0, 1]), c * np.sin(angles[0, 1])])
        error = float(np.sqrt(np.mean(equations(root)[0] ** 2)))
        places = (np.zeros(2), joint_a, joint_b, np.array([1.0, 0.0]), (joint_a + joint_b) / 2)
        linkages.append(replace(FourBar(*places).scaled(size), error=error))
        poses.append(angles)
    return Found(*_distinct(linkages, poses, size, 1.0), found)


def _equations(rows: Conditions, full: Array, which: NDArray[np.intp]) -> Equations:
    """Return a condition at the rows of ``full``, where ``which`` is the unknown's number or -1 if known."""
    row, column = np.nonzero(which >= 0)
    number = which[row, column]
    size = number.max() + 1

    def equations(unknown: Array) -> tuple[Array, Array]:
        full[row, column] = unknown[number]
        residual, single = rows(full)
        slopes = np.zeros((len(full), size))
        slopes[row, number] = single[row, 0, column]
        return residual.ravel(), slopes

    return equations


def _numbered(full: Array, free: list[int]) -> NDArray[np.intp]:
    """Return the numbers of unknowns, in the columns ``free`` and the same in all rows; -1 elsewhere."""
    which = np.full(full.shape, -1)
    which[:, free] = np.arange(len(free))
    return which


def _ratios(generator: np.random.Generator) -> Array:
    """Return random ratios of a four-bar, and start angles."""
    a, b, c = np.exp(generator.uniform(np.log(0.2), np.log(3.0), 3)) * generator.choice([-1, 1], 3)
    ratios = [1 / a, 1 / c, (a * a - b * b + c * c + 1) / (2 * a * c)]
    return np.array([*ratios, *generator.uniform(-np.pi, np.pi, 2)])


def motion(task: MotionTask) -> Found:
    """Return four-bars whose coupler passes the prescribed poses: places [m] and rotations [rad].

    Each of two different dyads meets the conditions by itself: two to five poses determine it if as many of
    its five quantities are unknown (Burmester's points for five).

    Raises
    ------
    SceneError
        When places and rotations differ in number, or there are too few for the unknowns.
    """
    places, angles = task.places(), values(task.angles, NUMBER, "angles")
    if len(places) != len(angles):
        raise SceneError(
            f"expected as many angles as points, {len(places)}, got {len(angles)}", where="angles"
        )
    size = _size(places)
    places, given = places / size, _over(task.given(), size)
    free = [i for i, name in enumerate(DYAD) if name not in given]
    _enough(len(places), len(free), "points", ", ".join(DYAD))
    rows = conditions("synthesis_dyad", 1)
    generator = np.random.default_rng(task.seed)
    searches, dyads = [], []
    for side in (0, 1) if given else (0,):
        full = np.column_stack([np.zeros((len(places), 5)), places, angles])
        full[:, [DYAD.index(n) for n in given]] = [v[side] for v in given.values()]
        equations = _equations(rows, full, _numbered(full, free))
        random = (_dyad(generator, places, angles)[free] for _ in range(task.starts))
        found = search(equations, random, fit=len(places) > len(free))
        searches.append(found)
        dyads.append([_whole(equations, root, full) for root in found.roots])
    dyads = [_one_of_each(side) for side in dyads]
    pairs = permutations(dyads[0], 2) if len(dyads) == 1 else ((p, q) for p in dyads[0] for q in dyads[1])
    linkages = [
        _of_dyads(crank[0], rocker[0], places[0], angles[0], max(crank[1], rocker[1])).scaled(size)
        for crank, rocker in pairs
        if _apart(crank[0], rocker[0])
    ]
    poses = np.column_stack([size * places, angles])
    total = Search(
        tuple(root for s in searches for root in s.roots),
        sum(s.starts for s in searches),
        min(s.nearest for s in searches),
        sum(s.singular for s in searches),
    )
    return Found(linkages, [poses] * len(linkages), total)


def _whole(equations: Equations, root: Array, full: Array) -> tuple[Array, float]:
    residual, _ = equations(root)
    dyad = full[0, :5].copy()
    dyad[4] = abs(dyad[4])
    return dyad, float(np.sqrt(np.mean((residual / (2 * max(dyad[4], 1e-300))) ** 2)))


def _one_of_each(dyads: list[tuple[Array, float]]) -> list[tuple[Array, float]]:
    """Return dyads without repetitions (a length and its negative), sorted by their length."""
    kept: list[tuple[Array, float]] = []
    for dyad in sorted(dyads, key=lambda d: (d[1], d[0][4])):
        if dyad[0][4] > _ONE_LINK and not any(_same(dyad[0], other[0], 1.0) for other in kept):
            kept.append(dyad)
    return sorted(kept, key=lambda d: (d[0][4], *d[0]))


def path(task: PathTask) -> Found:
    """Return four-bars whose coupler's point passes the points; poses are these and the coupler's rotations.

    The coupler's rotation is zero at the first point, and unknown at the others. Nine points determine
    the ten quantities of both dyads; fewer, if some are prescribed; more are fitted.

    Raises
    ------
    SceneError
        When there are too few points for the unknowns.
    """
    places = task.places()
    count, size = len(places), _size(places)
    places, given = places / size, _over(task.given(), size)
    own = [i for i, name in enumerate(DYAD) if name not in given]
    _enough(2 * count, 2 * len(own) + count - 1, "points, of two conditions each,", ", ".join(DYAD))
    full = np.column_stack([np.zeros((2 * count, 5)), np.tile(places, (2, 1)), np.zeros(2 * count)])
    sides = (slice(0, count), slice(count, 2 * count))
    for side, part in enumerate(sides):
        full[part, [DYAD.index(n) for n in given]] = [v[side] for v in given.values()]
    k = len(own)
    which = np.full(full.shape, -1)
    for side, part in enumerate(sides):
        which[part, own] = side * k + np.arange(k)
        which[part, 7] = [-1, *range(2 * k, 2 * k + count - 1)]
    equations = _equations(conditions("synthesis_dyad", 1), full, which)
    generator = np.random.default_rng(task.seed)
    random = (_four_bar(generator, places, own) for _ in range(task.starts))
    exact = 2 * count == 2 * k + count - 1
    found = search(equations, random, fit=not exact)
    linkages, poses = [], []
    for root in found.roots:
        residual, _ = equations(root)
        dyads = [full[part.start, :5].copy() for part in sides]
        for dyad in dyads:
            dyad[4] = abs(dyad[4])
        if not _apart(*dyads):
            continue
        lengths = np.repeat([max(d[4], 1e-300) for d in dyads], count)
        error = float(np.sqrt(np.mean((residual / (2 * lengths)) ** 2)))
        linkages.append(_of_dyads(dyads[0], dyads[1], places[0], 0.0, error).scaled(size))
        poses.append(np.column_stack([size * places, full[:count, 7]]))
    if not given:
        if exact:
            for linkage, own_poses in [*zip(linkages, poses, strict=True)]:
                for other in (linkage, _exchanged(linkage)):
                    if np.linalg.norm(other.P - other.A) > _ONE_LINK * size:
                        linkages.append(_cognate(other))
                        turned = crank_directions(other, own_poses)
                        poses.append(np.column_stack([own_poses[:, :2], turned - turned[0]]))
        linkages = [_exchanged(k) if _is_turned(k, size) else k for k in linkages]
    return Found(*_distinct(linkages, poses, size, size), found)


def _is_turned(linkage: FourBar, size: float) -> bool:
    """Return whether the crank is longer than the rocker or, if equal, pinned further right or above."""
    more = [linkage.lengths["crank"] - linkage.lengths["rocker"], *(linkage.O - linkage.C)]
    return next((x > 0.0 for x in more if abs(x) > _ONE_LINK * size), False)


def _exchanged(linkage: FourBar) -> FourBar:
    """Return the same linkage, with the crank as its rocker."""
    return FourBar(linkage.C, linkage.B, linkage.A, linkage.O, linkage.P, linkage.error)


def _cognate(linkage: FourBar) -> FourBar:
    places = cognate(*(complex(*getattr(linkage, name)) for name in "OABCP"))
    o, a, b, c, p = (np.array([z.real, z.imag]) for z in places)
    return FourBar(o, a, b, c, p, linkage.error)


def _four_bar(generator: np.random.Generator, places: Array, own: list[int]) -> Array:
    """Return the unknowns of a random linkage whose links have the mean lengths over random rotations."""
    angles = np.array([0.0, *generator.normal(0.0, 1.0, len(places) - 1)])
    dyads = [_dyad(generator, places, angles)[own] for _ in range(2)]
    return np.concatenate([*dyads, angles[1:]])


def _dyad(generator: np.random.Generator, places: Array, angles: Array) -> Array:
    """Return a random dyad [m] whose length is the mean distance of its joints in the poses."""
    spreads = np.exp(generator.uniform(np.log(_SPREAD[0]), np.log(_SPREAD[1]), 2))
    ground = places.mean(axis=0) + generator.normal(0.0, spreads[0], 2)
    joint = generator.normal(0.0, spreads[1], 2)
    ends = places + _turned(joint, angles)
    return np.array([*ground, *joint, np.linalg.norm(ends - ground, axis=1).mean()])


def _turned(joint: Array, angles: Array) -> Array:
    """Return the vector to a joint of the coupler (poses, 2) at its rotations."""
    cos, sin = np.cos(angles), np.sin(angles)
    return np.column_stack([cos * joint[0] - sin * joint[1], sin * joint[0] + cos * joint[1]])


def _of_dyads(crank: Array, rocker: Array, place: Array, angle: float, error: float) -> FourBar:
    joints = [place + _turned(dyad[2:4], np.array([angle]))[0] for dyad in (crank, rocker)]
    return FourBar(crank[:2], joints[0], joints[1], rocker[:2], place, error=error)


def _apart(one: Array, other: Array) -> bool:
    """Return whether two dyads make a four-bar, of links longer than the least."""
    grounds, joints = np.linalg.norm(one[:2] - other[:2]), np.linalg.norm(one[2:4] - other[2:4])
    return bool(min(one[4], other[4], grounds, joints) > _ONE_LINK)


def _same(one: Array, other: Array, size: float) -> bool:
    return bool(np.abs(one - other).max() <= _ONE_LINK * max(size, float(np.abs(one).max())))


def _distinct(
    linkages: list[FourBar], poses: list[Array], size: float, unit: float
) -> tuple[list[FourBar], list[Array]]:
    """Return linkages without repetitions: those of least error, in its unit, and shortest links first."""
    kept: list[tuple[FourBar, Array]] = []
    order = sorted(
        zip(linkages, poses, strict=True), key=lambda x: (round(x[0].error / unit, 9), *x[0].lengths.values())
    )
    for linkage, own in order:
        places = np.concatenate([linkage.O, linkage.A, linkage.B, linkage.C])
        others = (np.concatenate([k.O, k.A, k.B, k.C]) for k, _ in kept)
        if not any(_same(places, other, size) for other in others):
            kept.append((linkage, own))
    return [k for k, _ in kept], [p for _, p in kept]


def _size(places: Array) -> float:
    """Return the size of the points; raise SceneError if they are one."""
    size = float(np.linalg.norm(np.ptp(places, axis=0)))
    if not size > 0:
        raise SceneError("expected points at different places", where="points")
    return size


def _over(given: dict[str, tuple[float, float]], size: float) -> dict[str, tuple[float, float]]:
    return {name: (one / size, other / size) for name, (one, other) in given.items()}


def _enough(conditions: int, unknowns: int, what: str, which: str) -> None:
    if not unknowns:
        raise SceneError("nothing is left to be found", hint=f"Prescribe fewer of: {which}.")
    if conditions < unknowns:
        raise SceneError(
            f"{conditions} conditions do not determine {unknowns} unknowns",
            hint=f"Give more {what} or prescribe some of: {which}.",
        )


def crank_directions(linkage: FourBar, poses: Array) -> Array:
    """Return the directions of the crank [rad] in poses of the coupler: place [m] and rotation [rad]."""
    ends = poses[:, :2] + _turned(linkage.A - linkage.P, poses[:, 2] - poses[0, 2]) - linkage.O
    return np.asarray(np.arctan2(ends[:, 1], ends[:, 0]))
