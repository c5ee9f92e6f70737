"""Singular poses on the curve of a driven linkage: dead centres and bifurcations."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.result.findings import SingularPose
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.following.continuation import Curve, CurvePoint

#: Component of the tangent along t that counts as zero.
TURNING = 1e-9


def monotone(path: list[CurvePoint]) -> list[list[CurvePoint]]:
    """Part the curve at its dead centres into pieces along which t grows or falls."""
    parts, begin = [], 0
    for i in range(1, len(path) - 1):
        before, after = path[i].x[-1] - path[i - 1].x[-1], path[i + 1].x[-1] - path[i].x[-1]
        if before * after < 0:
            parts.append(path[begin : i + 1])
            begin = i
    parts.append(path[begin:])
    return [p for p in parts if len(p) > 1]


def singular_poses(
    curve: Curve[Constraints], path: list[CurvePoint], low: float, high: float
) -> list[SingularPose]:
    """Return the dead centres and bifurcations between two times [s], in the order of the motion."""
    ends = [part[-1] for part in monotone(path)[:-1]]
    ends += [p for p in (path[0], path[-1]) if abs(p.speed) <= TURNING]
    poses = [(p, "dead centre") for p in ends] + [(p, "bifurcation") for p in curve.crossings(path)]
    unique: list[tuple[CurvePoint, str]] = []
    order = {id(p): i for i, p in enumerate(path)}
    for p, kind in poses:
        if any(p is other or np.linalg.norm(p.x - other.x) < 1e-6 for other, _ in unique):
            continue
        slack = 1e-7 * curve.duration
        if low - slack <= p.x[-1] * curve.duration <= high + slack:
            unique.append((p, kind))

    def along(item: tuple[CurvePoint, str]) -> int:
        point = item[0]
        return order.get(id(point), int(np.argmin([np.linalg.norm(point.x - p.x) for p in path])))

    return [_pose(curve, p, kind, path) for p, kind in sorted(unique, key=along)]


def _pose(curve: Curve[Constraints], p: CurvePoint, kind: str, path: list[CurvePoint]) -> SingularPose:
    q, t = curve.split(p.x)
    constraints = curve.constraints
    places = dict(zip(constraints.description.points, constraints.places(q, t), strict=True))
    others = [
        dict(zip(constraints.description.points, constraints.places(*curve.split(o.x)), strict=True))
        for o in path[:: max(1, len(path) // 8)]
    ]
    pairs = []
    d = constraints.description
    for a, b in combinations([k for k, points in d.links.items() if not set(points) <= set(d.ground)], 2):
        always = all(_in_line(constraints, a, b, other, 1e-3) for other in others)
        if _in_line(constraints, a, b, places, 1e-6) and not always:
            pairs.append((a, b))
    positions = {name: r.tolist() for name, r in places.items()}
    return SingularPose(kind, t, constraints.drives(t), positions, tuple(pairs), constraints.units())


def _in_line(constraints: Constraints, a: str, b: str, places: dict[str, Array], tolerance: float) -> bool:
    links = constraints.description.links
    for joint in set(links[a]) & set(links[b]):
        for p in set(links[a]) - {joint}:
            for s in set(links[b]) - {joint}:
                d, e = places[p] - places[joint], places[s] - places[joint]
                size = np.linalg.norm(d) * np.linalg.norm(e)
                across = math.sqrt(max(float((d @ d) * (e @ e) - (d @ e) ** 2), 0.0))
                planar = abs(d[0] * e[1] - d[1] * e[0]) if len(d) == 2 else across
                if planar <= tolerance * size:
                    return True
    return False
