"""Closures in closed form, where a ball-ball link and one more hinge or slide are all that is not prescribed.

In the frame, one of the balls A and B is fixed; the other moves on a line (prismatic) or a circle (revolute)
with the remaining variable v. The constant length of the rod gives a quadratic in v, or
a + b cos v + c sin v = 0; the angles of the balls follow from the direction of the rod and the remaining
rotation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.loop.frames import product
from symgen.runtime.loop.kernels import LoopKernels


@dataclass(frozen=True, slots=True)
class _Rod:
    """The rows of the two balls, and the number of the variable that moves one of them."""

    first: int
    other: int


def closed_forms(kernels: LoopKernels, t: float, guess: Array) -> list[Array]:
    """Return the closures (at most two) at a time in closed form; none for loops of other kinds.

    The one whose slide or hinge is nearest to the guess comes first. Held variables are taken from the guess.
    """
    rod = _rod(kernels)
    if rod is None:
        return []
    q = guess.copy()
    q[kernels.inputs] = kernels.prescribed(t)[:, 0]
    forms = []
    is_length = kernels.description.variables[rod.other].is_length

    def gap(value: float) -> float:
        away = value - float(guess[rod.other])
        return abs(away if is_length else math.remainder(away, 2 * math.pi))

    for value in sorted(_values(kernels, t, q, rod), key=gap):
        q[rod.other] = value
        forms.append(_with_angles(kernels, t, q.copy(), rod))
    return forms


def _rod(kernels: LoopKernels) -> _Rod | None:
    """Find two neighbouring balls, the second with all its angles, and one other dependent variable."""
    d = kernels.description
    solved = d.having("dependent")
    for k in range(len(d.joints) - 1):
        angles = [i for i in solved if d.variables[i].row in (k, k + 1)]
        others = [i for i in solved if i not in angles]
        names = [d.variables[i].name for i in angles]
        names_of_rod = [f"theta{k + 1}", f"eta{k + 1}", f"theta{k + 2}", f"eta{k + 2}", f"alpha{k + 2}"]
        plain = len(others) == 1 and d.joints[d.variables[others[0]].row] in "RP"
        if d.joints[k] == d.joints[k + 1] == "S" and names == names_of_rod and plain:
            return _Rod(k, others[0])
    return None


def _values(kernels: LoopKernels, t: float, q: Array, rod: _Rod) -> list[float]:
    """Return the values of the other variable at which the balls are a rod's length apart."""
    is_length = kernels.description.variables[rod.other].is_length
    size = kernels.description.size
    at = (0.0, size) if is_length else (0.0, math.pi / 2, math.pi)
    gaps: list[Array] = []
    length = 0.0
    for value in at:
        q[rod.other] = value
        table = kernels("rows", t, q, np.zeros_like(q))["rows"]
        length = float(table[rod.first, 4])
        gaps.append(_ball_b(table, rod.first) - product(table[: rod.first])[:3, 3])
    if is_length:
        start, along = gaps[0], (gaps[1] - gaps[0]) / size
        a, b = float(along @ along), float(start @ along)
        c = float(start @ start) - length**2
        if b * b < a * c or a == 0.0:
            return []
        root = math.sqrt(b * b - a * c)
        far = -(b + math.copysign(root, b)) / a
        return [far, c / (a * far)] if far else [0.0]
    centre = (gaps[0] + gaps[2]) / 2
    x, y = gaps[0] - centre, gaps[1] - centre
    a = float(centre @ centre + x @ x) - length**2
    b, c = 2 * float(centre @ x), 2 * float(centre @ y)
    reach = math.hypot(b, c)
    if abs(a) > reach or reach == 0.0:
        return []
    towards, half = math.atan2(c, b), math.acos(-a / reach)
    return [towards + half, towards - half]


def _with_angles(kernels: LoopKernels, t: float, q: Array, rod: _Rod) -> Array:
    """Return the pose with the angles of both balls put in."""
    d, k = kernels.description, rod.first
    number = {v.name: i for i, v in enumerate(d.variables)}
    table = kernels("rows", t, q, np.zeros_like(q))["rows"]
    before = product(table[:k])
    x, y, z = before[:3, :3].T @ (_ball_b(table, k) - before[:3, 3])
    # A negative length of the table points the other way along the rod.
    sign = math.copysign(1.0, table[k, 4])
    theta, eta = math.atan2(sign * y, sign * x), -math.atan2(sign * z, math.hypot(x, y))
    q[number[f"theta{k + 1}"]], q[number[f"eta{k + 1}"]] = theta, eta
    table[k, [0, 2]] = theta, eta
    left = np.linalg.solve(product(table[: k + 1])[:3, :3], product(table[k + 2 :])[:3, :3].T)
    q[number[f"theta{k + 2}"]] = math.atan2(left[1, 0], left[0, 0])
    q[number[f"eta{k + 2}"]] = -math.atan2(left[2, 0], math.hypot(left[0, 0], left[1, 0]))
    q[number[f"alpha{k + 2}"]] = math.atan2(left[2, 1], left[2, 2])
    return q


def _ball_b(table: Array, k: int) -> Array:
    """Return the place of the second ball in {1}, from the far end of the table."""
    behind = product(table[k + 2 :])
    beyond = np.array([-table[k + 1, 4], 0.0, 0.0]) - behind[:3, 3]
    return behind[:3, :3].T @ beyond
