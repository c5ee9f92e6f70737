"""All assembly modes of a linkage of small Assur groups: dyads by their two signs, triads by all roots.

At a given time the constraints are quadratic polynomials of the coordinates. In a group of one point,
differences of the constraints are linear: the point is on a line, and one quadratic equation leaves two
signs. In a larger group one point is moved around its circle, by an angle, in place of another constraint;
the others are again groups of one point. The product of that constraint over all signs is an analytic
function of the angle, real also where the groups do not close, and its roots are eigenvalues. For the
triad of a Stephenson linkage it is a sextic of the tangent of half the angle.

The coordinates are those of the two points of a link that are listed first. If a group has no solution by
them, others are taken: linear functions of them, in an order in which the constraints determine them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.polynomial import chebyshev

from symgen.runtime.arrays import Array
from symgen.runtime.rods.assembly.axes import determined
from symgen.runtime.rods.assembly.quadratics import (
    NONE,
    NotInGroups,
    Poses,
    QuadraticRows,
    Quadratics,
    quadratics,
)
from symgen.runtime.rods.following.groups import groups_of

#: Most poses for which a group of one point is solved.
_MOST_POSES = 1024
#: Most poses for which a larger group is solved.
_POSES_OF_LARGE = 64
#: Most unknowns of a group of one point.
_POINT_UNKNOWNS = 3
#: Most unknowns of a larger group.
_GROUP_UNKNOWNS = 12
#: Relative size of determinants and leading coefficients that counts as zero.
_DEGENERATE = 1e-10
#: Smallest singular value over the largest of a group whose drawn side counts.
_SIDE = 1e-9
#: Largest closure error of a pose, over the size, from which Newton's method closes it.
_OPEN = 1e-4
#: Arcs into which a circle is divided at first.
_ARCS = 16
#: Most arcs of a circle.
_MOST_ARCS = 128
#: Degree of the Chebyshev series on an arc.
_DEGREE = 20
#: Size of the last terms of a series that has converged, over its largest.
_LAST_TERMS = 1e-11
#: Half width of the shortest arc [rad].
_SHORTEST = 1e-3
#: Distance of two roots from a double root, over the half width of the arc.
_PAIR = 1e-3
_SINGULAR = "a group of one point is singular for this value of the drives"


@dataclass(frozen=True, slots=True)
class _Point:
    """A group whose quadratic terms are multiples of those of its first row; linear without ``bent``."""

    rows: list[int]
    columns: list[int]
    multiples: Array
    bent: bool

    def solved(self, of: Quadratics, x: Poses) -> tuple[list[Poses], Poses]:
        """Return the poses for each sign, and their divisor."""
        x = x.copy()
        x[..., self.columns] = 0
        values, slopes = of.values(self.rows, x), of.slopes(self.rows, self.columns, x)
        if not self.bent:
            return [_placed(x, self.columns, -_solved(slopes, values))], np.linalg.det(slopes)
        first, others = slopes[..., 0, :], slopes[..., 1:, :] - self.multiples[:, None] * slopes[..., :1, :]
        line = _across(others)
        squared = np.sum(line * line, axis=-1)
        if np.any(np.abs(squared) < _DEGENERATE**2):
            raise NotInGroups(_SINGULAR)
        left = np.concatenate(
            [values[..., 1:] - self.multiples * values[..., :1], np.zeros_like(values[..., :1])], axis=-1
        )
        base = -_solved(np.concatenate([others, line[..., None, :]], axis=-2), left)
        curvature = of.curvature[np.ix_([self.rows[0]], self.columns, self.columns)][0]
        a = np.einsum("...i,ij,...j->...", line, curvature, line) / 2
        b = np.sum((first + base @ curvature) * line, axis=-1) / 2
        c = values[..., 0] + np.sum((first + base @ curvature / 2) * base, axis=-1)
        if np.any(np.abs(a) < _DEGENERATE * np.abs(squared)):
            raise NotInGroups(_SINGULAR)
        root = b * b - a * c
        if not np.iscomplexobj(x):
            root = np.where((root < 0) & (root > -_OPEN * b * b - _OPEN * np.abs(a)), 0.0, root)
            root = np.where(root < 0, np.nan, root)
        ways = [(-b + s * np.sqrt(root)) / a for s in (1, -1)]
        return [_placed(x, self.columns, base + way[..., None] * line) for way in ways], squared


def _solved(matrix: Poses, right: Poses) -> Poses:
    if np.any(np.abs(np.linalg.det(matrix)) < _DEGENERATE**2):
        raise NotInGroups(_SINGULAR)
    return np.linalg.solve(matrix, right[..., None])[..., 0]


def _placed(x: Poses, columns: Sequence[int], values: Poses) -> Poses:
    placed = x.astype(np.result_type(x, values))
    placed[..., columns] = values
    return placed


def _across(rows: Poses) -> Poses:
    """Return the vector across k - 1 rows of k entries, by their minors: (..., k)."""
    k = rows.shape[-1]
    if k == 1:
        return np.ones_like(rows, shape=(*rows.shape[:-2], 1))
    minors = [np.linalg.det(np.delete(rows, i, axis=-1)) * (-1) ** i for i in range(k)]
    return np.stack(minors, axis=-1)


@dataclass(frozen=True, slots=True)
class _Circle:
    """A larger group: a point on the circle of a row, groups of one point, and a row that they must meet."""

    row: int
    columns: list[int]
    points: list[_Point]
    last: int

    def solved(self, of: Quadratics, x: Poses) -> list[Poses]:
        """Return the poses of one pose of the preceding groups."""
        x = x.copy()
        x[[*self.columns, *(c for p in self.points for c in p.columns)]] = 0
        bend = of.curvature[self.row, self.columns[0], self.columns[0]]
        centre = -of.slopes([self.row], self.columns, x)[0] / bend
        squared = centre @ centre - 2 * of.values([self.row], x)[0] / bend
        if not squared > 0:
            return []

        def around(angles: Array) -> Array:
            circle = squared**0.5 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
            return _placed(np.broadcast_to(x, (len(angles), len(x))), self.columns, centre + circle)

        solutions = []
        for angle in _roots(lambda angles: self._missed(of, around(angles))):
            for pose in _chosen(of, self.points, around(np.array([angle]))[0]):
                if abs(of.values([self.last], pose)[0]) < _OPEN:
                    solutions.append(pose)
        return solutions

    def _missed(self, of: Quadratics, poses: Poses) -> Array:
        """Return the product over all signs of the last row and of the divisors of the poses."""
        missed = np.ones(len(poses), dtype=complex)
        signs: list[tuple[Poses, Poses]] = [(poses.astype(complex), missed)]
        for point in self.points:
            solved = [(*point.solved(of, pose), divisor) for pose, divisor in signs]
            signs = [(way, divisor * squared) for ways, squared, divisor in solved for way in ways]
        for pose, divisor in signs:
            missed = missed * of.values([self.last], pose)[:, 0] * divisor
        return missed.real


def _roots(function: Callable[[Array], Array]) -> list[float]:
    """Return the angles at which an analytic function vanishes, pairs that nearly meet included.

    Its Chebyshev series on arcs, halved until the series end, have the roots as eigenvalues.
    """
    nodes = chebyshev.chebpts1(_DEGREE + 1)
    series = np.linalg.inv(chebyshev.chebvander(nodes, _DEGREE))
    half, centres, angles = np.pi / _ARCS, 2 * np.pi * (np.arange(_ARCS) + 0.5) / _ARCS, list[float]()
    while len(centres):
        values = function((centres[:, None] + half * nodes).ravel()).reshape(len(centres), -1)
        size = np.max(np.abs(values), axis=1)
        if len(centres) > _MOST_ARCS or not np.all(size > 0) or size.max() < NONE:
            raise NotInGroups("the last constraint of a group has no separate roots")
        terms = (values / size[:, None]) @ series.T
        ended = (np.abs(terms[:, -3:]).max(axis=1) < _LAST_TERMS) | (half < _SHORTEST)
        for centre, coefficients in zip(centres[ended], terms[ended], strict=True):
            roots = chebyshev.chebroots(coefficients)
            near = (np.abs(roots.imag) < _PAIR) & (np.abs(roots.real) < 1 + _PAIR)
            angles += (centre + half * roots.real[near]).tolist()
        centres, half = np.concatenate([centres[~ended] - half / 2, centres[~ended] + half / 2]), half / 2
    return angles


def modes_of_groups(constraints: QuadraticRows, near: Array, t: float) -> list[Array]:
    """Return coordinates of all poses that meet the constraints at a time, nearly to round-off.

    Raises
    ------
    NotInGroups
        For linkages that are not of groups solved here: those with redundant constraints, with constraints
        that are not quadratic, with groups larger than triads in general, or with very many poses.
    """
    of, size = quadratics(constraints, near, t)
    axes = _axes(of)
    of, poses = of.along(axes), [np.zeros(constraints.n)]
    for group in _groups(of, range(constraints.m), range(constraints.n)):
        solver = _solver(of, *group)
        if len(poses) > (_POSES_OF_LARGE if isinstance(solver, _Circle) else _MOST_POSES):
            raise NotInGroups(f"{len(poses)} poses of some groups are too many to continue from each")
        poses = [x for pose in poses for x in _ways(of, solver, pose)]
    return [near + size * x @ axes for x in poses]


def modes_by_drawing(conditions: QuadraticRows, drawn: Array, slopes: Array) -> Iterator[Array]:
    """Yield coordinates that meet the conditions at the start, the assembly mode of the drawing first.

    There each group is on its drawn side, the sign of the determinant of its Jacobian, as in a continuous
    motion from the drawing. Poses with fewer groups on their other side come first, and of these the nearer
    to the drawing.

    Parameters
    ----------
    conditions
        As many conditions as coordinates; the time is zero.
    drawn
        The drawn coordinates [m].
    slopes
        The derivatives of the conditions that the drawing meets, in the order of ``conditions``, (m, n).

    Raises
    ------
    NotInGroups
        For linkages that are not of groups solved here.
    """
    of, size = quadratics(conditions, drawn, 0.0)
    axes = _axes(of)
    of, slopes = of.along(axes), slopes @ axes.T
    poses = [(0, np.zeros(conditions.n))]
    for rows, columns in _groups(of, range(conditions.m), range(conditions.n)):
        solver, side = _solver(of, rows, columns), _side(slopes[np.ix_(rows, columns)])
        poses = [
            (others + (side * _side(of.slopes(rows, columns, way)) < 0), way)
            for others, pose in poses
            for way in _ways(of, solver, pose)
        ]
        poses.sort(key=lambda pose: (pose[0], round(float(np.linalg.norm(pose[1])), 6), pose[1].tolist()))
        del poses[_POSES_OF_LARGE:]
    yield from (drawn + size * x @ axes for _, x in poses)


def _side(matrix: Array) -> float:
    """Return the sign of a determinant, zero where rounding decides it."""
    parts = np.linalg.svd(matrix, compute_uv=False)
    return float(np.linalg.slogdet(matrix)[0]) if parts[-1] > _SIDE * parts[0] else 0.0


def _ways(of: Quadratics, group: _Point | _Circle, x: Array) -> list[Array]:
    solutions = group.solved(of, x)
    ways = solutions if isinstance(solutions, list) else solutions[0]
    return [way for way in ways if np.isfinite(way).all()]


def _chosen(of: Quadratics, points: Sequence[_Point], x: Array) -> Iterator[Array]:
    """Yield the poses by all signs of groups that close."""
    if not points:
        yield x
        return
    for way in _ways(of, points[0], x):
        yield from _chosen(of, points[1:], way)


def _axes(of: Quadratics) -> Array:
    """Return orthonormal axes of coordinates by which the groups are solved: those given, if they are."""
    n = len(of.slope)
    try:
        for group in _groups(of, range(n), range(n)):
            _solver(of, *group)
    except NotInGroups:
        axes = determined(of)
        if axes is None:
            raise
        return axes
    return np.eye(n)


def _groups(of: Quadratics, rows: Sequence[int], columns: Sequence[int]) -> list[tuple[list[int], list[int]]]:
    """Return the groups of some rows and as many columns, rows and columns of each."""
    having = of.having(rows, columns)
    places = [(row, i, 0) for row in rows for i, column in enumerate(columns) if column in having[row]]
    try:
        groups = groups_of(np.array(places, dtype=np.intp).reshape(-1, 3), rows, len(columns))
    except ValueError:
        raise NotInGroups("some constraints do not determine as many coordinates") from None
    return [
        (list(groups.rows[start:end]), [columns[i] for i in groups.columns[start:end]])
        for start, end in pairwise(groups.starts)
    ]


def _solver(of: Quadratics, rows: list[int], columns: list[int]) -> _Point | _Circle:
    """Return the solution of a group."""
    point = _point(of, rows, columns)
    if point is not None:
        return point
    if len(rows) > _GROUP_UNKNOWNS:
        raise NotInGroups(f"a group has {len(rows)} unknowns, more than {_GROUP_UNKNOWNS}")
    having, best = of.having(rows, columns), None
    for row, last in product(rows, rows):
        on = sorted(having[row])
        if row == last or not _round(of, row, on):
            continue
        try:
            rest = [r for r in rows if r not in (row, last)]
            parts = _groups(of, rest, [c for c in columns if c not in on])
        except NotInGroups:
            continue
        points = [_point(of, *part) for part in parts]
        known = [p for p in points if p is not None]
        if len(known) == len(points) and (best is None or _signs(known) < _signs(best.points)):
            best = _Circle(row, on, known, last)
    if best is None:
        raise NotInGroups(f"one angle does not break up a group of {len(rows)} unknowns into points")
    return best


def _signs(points: Sequence[_Point]) -> int:
    return sum(point.bent for point in points)


def _point(of: Quadratics, rows: list[int], columns: list[int]) -> _Point | None:
    """Return the group as one point, if its quadratic terms are multiples of those of one row."""
    if len(rows) > _POINT_UNKNOWNS:
        return None
    bends = {r: of.curvature[np.ix_([r], columns, columns)][0] for r in rows}
    first = max(rows, key=lambda r: float(np.abs(bends[r]).max()))
    others = [r for r in rows if r != first]
    squared = float(np.sum(bends[first] ** 2))
    if not squared:
        return _Point(rows, columns, np.zeros(0), False)
    multiples = np.array([np.sum(bends[r] * bends[first]) / squared for r in others])
    for r, multiple in zip(others, multiples, strict=True):
        if np.abs(bends[r] - multiple * bends[first]).max() > NONE * squared**0.5:
            return None
    return _Point([first, *others], columns, multiples, True)


def _round(of: Quadratics, row: int, columns: Sequence[int]) -> bool:
    """Return True if a row holds one point on a circle."""
    if len(columns) != 2:
        return False
    bends = of.curvature[np.ix_([row], columns, columns)][0]
    bend = bends[0, 0]
    return bool(bend != 0 and np.abs(bends - bend * np.eye(2)).max() <= NONE * abs(bend))
