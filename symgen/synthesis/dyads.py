"""Linkages of two dyads whose coupler passes prescribed poses, or whose point passes prescribed points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.mechanics.synthesis.points import cognate
from symgen.scene.units import NUMBER
from symgen.synthesis import nine_points
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.search import (
    ONE_LINK,
    RootSearch,
    Solutions,
    conditions,
    distinct,
    enough,
    equations_at,
    numbered,
    same,
    search,
    size_of,
)
from symgen.synthesis.slider_crank import SliderCrank
from symgen.synthesis.spherical import SphericalFourBar
from symgen.synthesis.tasks import DYAD, SLIDE, SPHERICAL_DYAD, values

Array = NDArray[np.float64]

#: Least and greatest size of random places, in that of the task.
_SPREAD = 0.3, 10.0


@dataclass(frozen=True, slots=True)
class DyadKind:
    """A kind of dyad: its compiled condition, quantities, and random values of them for poses.

    ``scaled`` returns one of the equivalent rows of quantities of a dyad, and its error over that of the
    condition.
    """

    block: str
    names: tuple[str, ...]
    random: Callable[[np.random.Generator, Array], Array]
    scaled: Callable[[Array], tuple[Array, float]]


def motion(task: Any) -> Solutions:
    """Return linkages whose coupler passes the prescribed poses: places [m] and rotations [rad].

    Each of two different dyads meets the conditions by itself, if as many of its quantities are unknown as
    there are poses (Burmester's points for five).

    Raises
    ------
    SceneError
        When places and rotations differ in number, or there are too few for the unknowns.
    """
    task_poses, size = _poses(task)
    crank, other, linkage_of = _LINKAGES[task.linkage]
    prescribed = task.prescribed()
    on_sphere = task.linkage == "spherical"
    frame = _frame() if on_sphere and not any(prescribed) else np.eye(3)
    poses = task_poses.copy()
    if on_sphere:
        poses = (frame @ poses.reshape(-1, 3, 3) @ frame.T).reshape(poses.shape)
    poses[:, :2] /= size
    prescribed = [{n: x / (size if n in _LENGTHS else 1.0) for n, x in side.items()} for side in prescribed]
    generator = np.random.default_rng(task.seed)
    kinds, searches, dyads = (crank, other), [], []
    alike = crank is other and not any(prescribed)
    for kind, side in zip(kinds[: 1 if alike else 2], prescribed, strict=False):
        free = [i for i, name in enumerate(kind.names) if name not in side]
        enough(len(poses), len(free), "poses", ", ".join(kind.names))
        full = np.column_stack([np.zeros((len(poses), len(kind.names))), poses])
        full[:, [kind.names.index(n) for n in side]] = [*side.values()]
        equations = equations_at(conditions(kind.block, 1), full, numbered(full, free))
        random = (kind.random(generator, poses)[free] for _ in range(task.starts))
        roots = search(equations, random, fit=len(poses) > len(free))
        searches.append(roots)
        rows = []
        for root in roots.roots:
            residual, _ = equations(root)
            dyad, scale = kind.scaled(full[0, : len(kind.names)].copy())
            rows.append((dyad, float(np.sqrt(np.mean((residual * scale) ** 2)))))
        dyads.append(_one_of_each(rows))
    pairs = permutations(dyads[0], 2) if alike else ((p, q) for p in dyads[0] for q in dyads[1])
    linkages = []
    for one, two in pairs:
        linkage = linkage_of(one[0], two[0], poses[0], max(one[1], two[1]))
        if linkage is not None:
            linkages.append(linkage.rotated(frame.T) if on_sphere else linkage.scaled(size))
    total = RootSearch(
        tuple(root for s in searches for root in s.roots),
        sum(s.starts for s in searches),
        min(s.nearest for s in searches),
        sum(s.singular for s in searches),
        searches[0].incomplete,
    )
    return Solutions(linkages, [task_poses] * len(linkages), total)


def _poses(task: Any) -> tuple[Array, float]:
    """Return the poses of the coupler, places and angle or a rotation matrix; and the size of the points."""
    if task.linkage == "spherical":
        from scipy.spatial.transform import Rotation

        turns = np.array([values(r, NUMBER, f"rotations.{i}") for i, r in enumerate(task.rotations)])
        return Rotation.from_rotvec(turns).as_matrix().reshape(len(turns), 9), 1.0
    places, angles = task.places(), values(task.angles, NUMBER, "angles")
    if len(places) != len(angles):
        raise SceneError(
            f"expected as many angles as points, {len(places)}, got {len(angles)}", where="angles"
        )
    return np.column_stack([places, angles]), size_of(places)


def _frame() -> Array:
    """Return a rotation to axes in which no likely axis is a pole, where its azimuth is undetermined."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec([0.61, -0.37, 0.83]).as_matrix())


def _one_of_each(dyads: list[tuple[Array, float]]) -> list[tuple[Array, float]]:
    """Return dyads without repetitions, sorted by their last quantity."""
    unique: list[tuple[Array, float]] = []
    for dyad in sorted(dyads, key=lambda d: (d[1], d[0][-1])):
        if not any(same(dyad[0], other[0], 1.0) for other in unique):
            unique.append(dyad)
    return sorted(unique, key=lambda d: (d[0][-1], *d[0]))


def path(task: Any) -> Solutions:
    """Return linkages whose coupler's point passes the points; poses are these and the coupler's rotations.

    The coupler's rotation is zero at the first point, and unknown at the others. Nine points determine
    the ten quantities of a four-bar's dyads, eight the nine of a slider-crank; fewer, if some are
    prescribed; more are fitted. Through nine points four-bars are found by a homotopy, all of them unless
    paths are lost.

    Raises
    ------
    SceneError
        When there are too few points for the unknowns.
    """
    places = task.places()
    count, size = len(places), size_of(places)
    places = places / size
    *kinds, linkage_of = _LINKAGES[task.linkage]
    prescribed = [
        {n: x / (size if n in _LENGTHS else 1.0) for n, x in side.items()} for side in task.prescribed()
    ]
    fulls, whichs, first = [], [], 0
    unknowns: list[list[int]] = []
    for kind, side in zip(kinds, prescribed, strict=True):
        free = [i for i, name in enumerate(kind.names) if name not in side]
        full = np.column_stack([np.zeros((count, len(kind.names))), places, np.zeros(count)])
        full[:, [kind.names.index(n) for n in side]] = [*side.values()]
        which = np.full(full.shape, -1)
        which[:, free] = first + np.arange(len(free))
        first += len(free)
        fulls.append(full)
        whichs.append(which)
        unknowns.append(free)
    enough(2 * count, first + count - 1, "points, of two conditions each,", ", ".join(kinds[1].names))
    for which in whichs:
        which[1:, -1] = first + np.arange(count - 1)
    sides = [
        equations_at(conditions(kind.block, 1), full, which, first + count - 1)
        for kind, full, which in zip(kinds, fulls, whichs, strict=True)
    ]

    def equations(unknown: Array) -> tuple[Array, Array]:
        parts = [side(unknown) for side in sides]
        return np.concatenate([r for r, _ in parts]), np.concatenate([s for _, s in parts])

    exact = 2 * count == first + count - 1
    complete = exact and not any(prescribed) and task.linkage == "four-bar"
    lost = 0
    if complete:
        known, lost = nine_points.real_linkages(places)
        starts = iter(known)
    else:
        generator = np.random.default_rng(task.seed)
        starts = (_random(generator, places, kinds, unknowns) for _ in range(task.starts))
    roots = search(equations, starts, fit=not exact, followed=complete)
    if complete:
        total, missing = len(nine_points.start()[0]), lost + len(known) - len(roots.roots)
        incomplete = (
            f"{missing} of {total} solutions of the homotopy were lost near singular or infinite ones: "
            "there may be other linkages"
        )
        roots = replace(
            roots, starts=total, singular=roots.singular + lost, incomplete=incomplete if missing else ""
        )
    linkages, poses = [], []
    for root in roots.roots:
        residual, _ = equations(root)
        rows = [
            kind.scaled(full[0, : len(kind.names)].copy()) for kind, full in zip(kinds, fulls, strict=True)
        ]
        error = float(np.sqrt(np.mean((residual * np.repeat([scale for _, scale in rows], count)) ** 2)))
        linkage = linkage_of(rows[0][0], rows[1][0], np.array([*places[0], 0.0]), error)
        if linkage is not None:
            linkages.append(linkage.scaled(size))
            poses.append(np.column_stack([size * places, fulls[0][:, -1]]))
    if not any(prescribed) and task.linkage == "four-bar":
        if exact:
            _add_cognates(linkages, poses, size)
        linkages = [exchanged(k) if is_turned(k, size) else k for k in linkages]
    return Solutions(*distinct(linkages, poses, size, size), roots)


def _add_cognates(linkages: list[FourBar], poses: list[Array], size: float) -> None:
    for linkage, poses_of_linkage in [*zip(linkages, poses, strict=True)]:
        for other in (linkage, exchanged(linkage)):
            if np.linalg.norm(other.P - other.A) > ONE_LINK * size:
                linkages.append(_cognate(other))
                turned = crank_directions(other, poses_of_linkage)
                poses.append(np.column_stack([poses_of_linkage[:, :2], turned - turned[0]]))


def is_turned(linkage: FourBar, size: float) -> bool:
    """Return whether the crank is longer than the rocker or, if equal, pinned further right or above."""
    more = [linkage.lengths["crank"] - linkage.lengths["rocker"], *(linkage.O - linkage.C)]
    return next((x > 0.0 for x in more if abs(x) > ONE_LINK * size), False)


def exchanged(linkage: FourBar) -> FourBar:
    """Return the same linkage, with the crank as its rocker."""
    return FourBar(linkage.C, linkage.B, linkage.A, linkage.O, linkage.P, linkage.error)


def _cognate(linkage: FourBar) -> FourBar:
    places = cognate(*(complex(*getattr(linkage, name)) for name in "OABCP"))
    o, a, b, c, p = (np.array([z.real, z.imag]) for z in places)
    return FourBar(o, a, b, c, p, linkage.error)


def _random(
    generator: np.random.Generator, places: Array, kinds: list[DyadKind], unknowns: list[list[int]]
) -> Array:
    """Return the unknowns of a random linkage whose links have the mean lengths over random rotations."""
    angles = np.array([0.0, *generator.normal(0.0, 1.0, len(places) - 1)])
    poses = np.column_stack([places, angles])
    dyads = [kind.random(generator, poses)[free] for kind, free in zip(kinds, unknowns, strict=True)]
    return np.concatenate([*dyads, angles[1:]])


def _random_dyad(generator: np.random.Generator, poses: Array) -> Array:
    """Return a random dyad [m] whose length is the mean distance of its joints in the poses."""
    spreads = np.exp(generator.uniform(np.log(_SPREAD[0]), np.log(_SPREAD[1]), 2))
    places, angles = poses[:, :2], poses[:, 2]
    ground = places.mean(axis=0) + generator.normal(0.0, spreads[0], 2)
    joint = generator.normal(0.0, spreads[1], 2)
    ends = places + _turned(joint, angles)
    return np.array([*ground, *joint, np.linalg.norm(ends - ground, axis=1).mean()])


def _random_slide(generator: np.random.Generator, poses: Array) -> Array:
    """Return a random slider whose guide has the mean offset of its places in the poses."""
    direction = generator.uniform(0.0, np.pi)
    joint = generator.normal(0.0, np.exp(generator.uniform(*np.log(_SPREAD))), 2)
    ends = poses[:, :2] + _turned(joint, poses[:, 2])
    return np.array([direction, (ends @ [-np.sin(direction), np.cos(direction)]).mean(), *joint])


def _random_axes(generator: np.random.Generator, poses: Array) -> Array:
    """Return a random spherical dyad whose arc is the mean of those in the poses."""
    ground, joint = generator.normal(size=(2, 3))
    ground, joint = ground / np.linalg.norm(ground), joint / np.linalg.norm(joint)
    cosines = poses.reshape(-1, 3, 3) @ joint @ ground
    return np.array([*_angles(ground), *_angles(joint), np.arccos(np.clip(cosines.mean(), -1, 1))])


def _angles(axis: Array) -> tuple[float, float]:
    return float(np.arctan2(axis[1], axis[0])), float(np.arcsin(np.clip(axis[2], -1.0, 1.0)))


def _axis(azimuth: float, elevation: float) -> Array:
    level = np.cos(elevation)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])


def _scaled_dyad(dyad: Array) -> tuple[Array, float]:
    """Return a dyad with a positive length."""
    dyad[4] = abs(dyad[4])
    return dyad, 1 / (2 * max(dyad[4], 1e-300))


def _scaled_slide(dyad: Array) -> tuple[Array, float]:
    """Return a slider whose guide has a direction in a half plane."""
    half = np.floor((dyad[0] + np.pi / 2) / np.pi)
    dyad[0] -= half * np.pi
    dyad[1] *= 1 - 2 * (half % 2)
    return dyad, 1.0


def _unscaled_axes(dyad: Array) -> tuple[Array, float]:
    """Return a spherical dyad with both axes in the upper half: an axis and its opposite are one."""
    axes = [_axis(*dyad[:2]), _axis(*dyad[2:4])]
    cosine = np.cos(dyad[4])
    for i, axis in enumerate(axes):
        if axis[2] < 0:
            axes[i], cosine = -axis, -cosine
    arc = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return np.array([*_angles(axes[0]), *_angles(axes[1]), arc]), 1 / max(np.sin(arc), ONE_LINK)


def _turned(joint: Array, angles: Array) -> Array:
    """Return the vector to a joint of the coupler (poses, 2) at its rotations."""
    cos, sin = np.cos(angles), np.sin(angles)
    return np.column_stack([cos * joint[0] - sin * joint[1], sin * joint[0] + cos * joint[1]])


def _joint(dyad: Array, pose: Array) -> Array:
    return np.asarray(pose[:2] + _turned(dyad[2:4], pose[2:3])[0])


def _four_bar(crank: Array, rocker: Array, pose: Array, error: float) -> FourBar | None:
    """Return the four-bar of two dyads, None where its links are not longer than the least."""
    grounds, joints = np.linalg.norm(crank[:2] - rocker[:2]), np.linalg.norm(crank[2:4] - rocker[2:4])
    if not min(crank[4], rocker[4], grounds, joints) > ONE_LINK:
        return None
    return FourBar(crank[:2], _joint(crank, pose), _joint(rocker, pose), rocker[:2], pose[:2], error=error)


def _slider_crank(crank: Array, slide: Array, pose: Array, error: float) -> SliderCrank | None:
    if not min(crank[4], np.linalg.norm(crank[2:4] - slide[2:4])) > ONE_LINK:
        return None
    places = crank[:2], _joint(crank, pose), _joint(slide, pose), pose[:2]
    return SliderCrank(*places, guide=float(slide[0]), error=error)


def _spherical(crank: Array, rocker: Array, pose: Array, error: float) -> SphericalFourBar | None:
    rotation = pose.reshape(3, 3)
    o, c = _axis(*crank[:2]), _axis(*rocker[:2])
    a, b = rotation @ _axis(*crank[2:4]), rotation @ _axis(*rocker[2:4])
    if not min(np.linalg.norm(np.cross(x, y)) for x, y in ((o, a), (a, b), (b, c), (c, o))) > ONE_LINK:
        return None
    return SphericalFourBar(o, a, b, c, error)


_REVOLUTE = DyadKind("synthesis_dyad", DYAD, _random_dyad, _scaled_dyad)
_SLIDE = DyadKind("synthesis_slide", SLIDE, _random_slide, _scaled_slide)
_AXES = DyadKind("synthesis_spherical_dyad", SPHERICAL_DYAD, _random_axes, _unscaled_axes)
#: Dyads of crank and rocker or slider, and the linkage of both.
_LINKAGES: dict[str, tuple[DyadKind, DyadKind, Callable[..., Any]]] = {
    "four-bar": (_REVOLUTE, _REVOLUTE, _four_bar),
    "slider-crank": (_REVOLUTE, _SLIDE, _slider_crank),
    "spherical": (_AXES, _AXES, _spherical),
}
_LENGTHS = frozenset(DYAD) | frozenset(SLIDE) - {"guide_angle"}


def crank_directions(linkage: Any, poses: Array) -> Array:
    """Return the directions of the crank [rad] in poses of the coupler: place [m] and rotation [rad]."""
    ends = poses[:, :2] + _turned(linkage.A - linkage.P, poses[:, 2] - poses[0, 2]) - linkage.O
    return np.asarray(np.arctan2(ends[:, 1], ends[:, 0]))
