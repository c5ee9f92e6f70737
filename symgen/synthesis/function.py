"""Linkages whose rocker or slider is a function of the crank's angle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.scene.units import LENGTH, NUMBER
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.search import (
    ONE_LINK,
    Solutions,
    conditions,
    distinct,
    enough,
    equations_at,
    numbered,
    search,
)
from symgen.synthesis.slider_crank import SliderCrank
from symgen.synthesis.spherical import SphericalFourBar
from symgen.synthesis.tasks import (
    SIZES,
    FunctionTask,
    SliderFunctionTask,
    SphericalFunctionTask,
    value,
    values,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Pairs of input and output, their starts where prescribed, and the size of the output."""

    x: Array
    y: Array
    prescribed: dict[str, float]
    starts: tuple[str, str]
    size: float


def _pairs(task: Any, starts: tuple[str, str], slides: bool = False) -> _Pairs:
    x, y = values(task.input, NUMBER, "input"), values(task.output, LENGTH if slides else NUMBER, "output")
    if len(x) != len(y):
        raise SceneError(f"expected as many outputs as inputs, {len(x)}, got {len(y)}", where="output")
    size = float(np.ptp(y)) if slides else 1.0
    if not size >= SIZES[0]:
        raise SceneError("expected different positions of the slider", where="output")
    texts = {n: getattr(task, n) for n in starts}
    dims = {starts[0]: NUMBER, starts[1]: LENGTH if slides else NUMBER}
    prescribed = {n: value(text, dims[n], n) for n, text in texts.items() if text is not None}
    if slides and starts[1] in prescribed:
        prescribed[starts[1]] /= size
    return _Pairs(x, y / size, prescribed, starts, size)


def _searched(
    pairs: _Pairs, block: str, names: tuple[str, ...], random: Any, task: Any
) -> tuple[Any, Any, Any]:
    """Return all rows of quantities (roots, pairs, quantities), the errors, and the search."""
    free = [i for i, name in enumerate(names) if name not in pairs.prescribed]
    enough(len(pairs.x), len(free), "pairs of input and output", " or ".join(pairs.starts))
    full = np.zeros((len(pairs.x), len(names) + 2))
    full[:, len(names) - 2 :] = np.column_stack(
        [*(np.full(len(pairs.x), pairs.prescribed.get(n, 0.0)) for n in pairs.starts), pairs.x, pairs.y]
    )
    equations = equations_at(conditions(block, 1), full, numbered(full, free))
    generator = np.random.default_rng(task.seed)
    roots = search(
        equations, (random(generator)[free] for _ in range(task.starts)), fit=len(pairs.x) > len(free)
    )
    rows, errors = [], []
    for root in roots.roots:
        errors.append(float(np.sqrt(np.mean(equations(root)[0] ** 2))))
        rows.append(full[0, : len(names)].copy())
    return rows, errors, roots


def four_bars(task: FunctionTask) -> Solutions:
    """Return four-bars whose rocker follows the crank as prescribed; poses are the angles of both [rad].

    Raises
    ------
    SceneError
        When input and output differ in number, or there are too few for the unknowns.
    """
    pairs = _pairs(task, ("crank_start", "rocker_start"))
    size = value(task.fixed_link, LENGTH, "fixed_link")
    if size < SIZES[0]:
        raise SceneError(f"expected a length of {SIZES[0]:g} m or more, got {size:g} m", where="fixed_link")
    names = ("d_over_a", "d_over_c", "third", *pairs.starts)
    rows, errors, roots = _searched(pairs, "synthesis_function", names, _ratios, task)
    linkages, poses = [], []
    for (first, second, third, crank, rocker), error in zip(rows, errors, strict=True):
        if min(abs(first), abs(second)) < ONE_LINK:
            continue  # a crank or rocker without end, against the fixed link
        a, c = 1 / first, 1 / second
        if not a * a + c * c + 1 - 2 * a * c * third > ONE_LINK**2:
            continue
        # A negative length is a link that points the other way.
        angles = np.column_stack(
            [crank + pairs.x + (np.pi if a < 0 else 0), rocker + pairs.y + (np.pi if c < 0 else 0)]
        )
        a, c = abs(a), abs(c)
        joint_a = a * np.array([np.cos(angles[0, 0]), np.sin(angles[0, 0])])
        joint_b = np.array([1 + c * np.cos(angles[0, 1]), c * np.sin(angles[0, 1])])
        places = (np.zeros(2), joint_a, joint_b, np.array([1.0, 0.0]), (joint_a + joint_b) / 2)
        linkages.append(replace(FourBar(*places).scaled(size), error=error))
        poses.append(angles)
    return Solutions(*distinct(linkages, poses, size, 1.0), roots)


def slider_cranks(task: SliderFunctionTask) -> Solutions:
    """Return slider-cranks whose slider follows the crank as prescribed; poses are angle and position.

    The guide has the direction of x; a mirror image about it has other signs of input and offset.

    Raises
    ------
    SceneError
        When input and output differ in number, or there are too few for the unknowns.
    """
    pairs = _pairs(task, ("crank_start", "slider_start"), slides=True)
    names = ("crank", "coupler", "offset", *pairs.starts)
    rows, errors, roots = _searched(pairs, "synthesis_slider_function", names, _slider_lengths, task)
    linkages, poses = [], []
    for (r, l, e, crank, slider), error in zip(rows, errors, strict=True):
        if min(abs(r), abs(l)) < ONE_LINK:
            continue
        angles, way = crank + pairs.x + (np.pi if r < 0 else 0), slider + pairs.y
        joint = abs(r) * np.array([np.cos(angles[0]), np.sin(angles[0])])
        end = np.array([way[0], e])
        linkage = SliderCrank(np.zeros(2), joint, end, (joint + end) / 2, 0.0, error / (2 * abs(l)))
        linkages.append(linkage.scaled(pairs.size))
        poses.append(np.column_stack([angles, pairs.size * way]))
    return Solutions(*distinct(linkages, poses, pairs.size, pairs.size), roots)


def spherical_four_bars(task: SphericalFunctionTask) -> Solutions:
    """Return spherical four-bars whose rocker follows the crank as prescribed; poses are both angles [rad].

    Raises
    ------
    SceneError
        When input and output differ in number, or there are too few for the unknowns.
    """
    pairs = _pairs(task, ("crank_start", "rocker_start"))
    names = ("cos_d", "sin_d_over_tan_c", "sin_d_over_tan_a", "last", *pairs.starts)
    rows, errors, roots = _searched(pairs, "synthesis_spherical_function", names, _spherical_ratios, task)
    linkages, poses = [], []
    for (cos_d, over_c, over_a, last, crank, rocker), error in zip(rows, errors, strict=True):
        if not abs(cos_d) < 1 - ONE_LINK**2:
            continue
        d = np.arccos(cos_d)
        a, c = np.arctan2(np.sin(d), over_a), np.arctan2(np.sin(d), over_c)
        cos_b = np.cos(a) * np.cos(c) * cos_d - last * np.sin(a) * np.sin(c)
        if not abs(cos_b) < 1 - ONE_LINK**2:
            continue  # axes that never have this distance, or of a coupler without length
        # An axis and its opposite are one: of both, that less than a quarter of a circle away.
        turns = np.zeros(2)
        if a > np.pi / 2 and "crank_start" not in pairs.prescribed:
            a, turns[0] = np.pi - a, np.pi
        if c > np.pi / 2 and "rocker_start" not in pairs.prescribed:
            c, turns[1] = np.pi - c, np.pi
        angles = np.column_stack([crank + pairs.x, rocker + pairs.y]) + turns
        linkages.append(_on_sphere(a, c, d, angles[0], error))
        poses.append(angles)
    return Solutions(*distinct(linkages, poses, 1.0, 1.0), roots)


def _on_sphere(a: float, c: float, d: float, angles: Array, error: float) -> SphericalFourBar:
    """Return the linkage with O on z, and C towards x."""
    at_a = np.array([np.sin(a) * np.cos(angles[0]), np.sin(a) * np.sin(angles[0]), np.cos(a)])
    x, y, z = np.sin(c) * np.cos(angles[1]), np.sin(c) * np.sin(angles[1]), np.cos(c)
    at_b = np.array([np.cos(d) * x + np.sin(d) * z, y, np.cos(d) * z - np.sin(d) * x])
    ground = np.array([np.sin(d), 0.0, np.cos(d)])
    return SphericalFourBar(np.array([0.0, 0.0, 1.0]), at_a, at_b, ground, error)


def _ratios(generator: np.random.Generator) -> Array:
    """Return random ratios of a four-bar, and start angles."""
    a, b, c = np.exp(generator.uniform(np.log(0.2), np.log(3.0), 3)) * generator.choice([-1, 1], 3)
    ratios = [1 / a, 1 / c, (a * a - b * b + c * c + 1) / (2 * a * c)]
    return np.array([*ratios, *generator.uniform(-np.pi, np.pi, 2)])


def _slider_lengths(generator: np.random.Generator) -> Array:
    """Return random lengths of a slider-crank, in the range of its slider, and starts."""
    lengths = np.exp(generator.uniform(np.log(0.2), np.log(5.0), 2))
    offset, slider = generator.normal(0.0, 1.0, 2)
    return np.array([*lengths, offset, generator.uniform(-np.pi, np.pi), slider])


def _spherical_ratios(generator: np.random.Generator) -> Array:
    """Return random ratios of a spherical four-bar, and start angles."""
    a, b, c, d = generator.uniform(0.1, 3.0, 4)
    last = (np.cos(a) * np.cos(c) * np.cos(d) - np.cos(b)) / (np.sin(a) * np.sin(c))
    ratios = [np.cos(d), np.sin(d) / np.tan(c), np.sin(d) / np.tan(a), last]
    return np.array([*ratios, *generator.uniform(-np.pi, np.pi, 2)])
