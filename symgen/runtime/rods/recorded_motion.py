"""Records of a kinematic analysis: points and links over the times that were reached."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from symgen.errors import ModelError, nearest
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.description import Description
from symgen.runtime.result.findings import SingularPose
from symgen.runtime.result.motion import Motion, Range
from symgen.runtime.result.recording import nearest_turn, of_points, shaped
from symgen.runtime.result.records import Coordinate, Drift, Variable, of_model, over_time
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.poses import Poses, continuous

#: Function that returns the continuous angles of a link at the samples [rad].
Counted = Callable[[str, Array], Array]


@dataclass(frozen=True, slots=True)
class CurvePositions:
    """Positions of all points along the followed curve, and the index of the pose next to each sample.

    Positions have the shape (..., poses, points, axes); ``start`` is the index of the pose at the start.
    """

    description: Description
    places: Array
    near: Indices
    start: int

    def counted(self, link: str, angles: Array) -> Array:
        """Return the angles of a link at the samples over its revolutions from the start [rad]."""
        points = self.description.points
        i, j = (points.index(p) for p in self.description.links[link][:2])
        lines = self.places[..., j, :] - self.places[..., i, :]
        whole = continuous(np.arctan2(lines[..., 1], lines[..., 0]), self.start)
        return nearest_turn(angles, whole[..., self.near])


@dataclass(frozen=True, slots=True)
class Followed:
    """What following gave: samples, singular poses, and ranges of time [s] that were not reached.

    ``path`` are poses along the curve, ``near`` the number of the one next to each sample, ``start`` that of
    the pose at which the motion starts.
    """

    samples: Poses
    near: Indices
    path: Poses
    start: int
    poses: list[SingularPose]
    unassemblable: list[Range]
    out_of_reach: list[Range]


#: Recorded quantities of a point, a link, and a corner.
_OF_POINT = ("position", "velocity", "acceleration")
_OF_LINK = ("angle", "rate", "acceleration")
_OF_CORNER = ("angle", "transmission_angle")


def chosen_names(constraints: Constraints, of: Sequence[str] | None) -> dict[str, tuple[str, ...]]:
    """Return the quantities to record of points, links and corners A.B.C; by default of all that move."""
    d = constraints.description
    internal = {*d.lugs, *d.lugs.values()}
    moving = [
        p
        for p in d.points
        if p not in internal
        if p not in d.ground or any(n.startswith(f"{p}.") for n in constraints.drives(0.0))
    ]
    links = {k: points for k, points in d.links.items() if k not in internal}
    turning = [k for k, points in links.items() if not set(points[:2]) <= set(d.ground)]
    requested = d.kernel("outputs")
    listed = requested and {b.name for b in requested.blocks} - {*d.scene_outputs}
    if of is None and (d.rates or (d.kinematic and listed)):
        return {}  # the outputs that the scene, or the user's system, selects
    plane = turning if len(d.axes) == 2 else []
    known = [*d.points, *plane, *d.scene_outputs]

    def recorded_of(name: str) -> tuple[str, ...]:
        corner = name.split(".")
        if name in d.scene_outputs:
            return (name,)
        if name in known:
            return _OF_POINT if name in d.points else _OF_LINK
        return _OF_CORNER if len(set(corner)) == len(corner) == 3 and set(corner) <= set(d.points) else ()

    by_owner: dict[str, tuple[str, ...]] = {}
    for name in [*moving, *plane, *d.scene_outputs] if of is None else of:
        whole, _, output = name.rpartition(".")
        if recorded_of(name):
            by_owner[name] = recorded_of(name)
        elif output in recorded_of(whole):
            by_owner[whole] = tuple(x for x in recorded_of(whole) if x in (*by_owner.get(whole, ()), output))
        else:
            raise ModelError(
                f"there is no point or moving link {name!r} to record. "
                f"{nearest(name, [x for x in known if x not in internal])}\n"
                "  A.B.C records the angles at B between A and C; coupler.angle one output of a link. "
                "inverse-dynamics has forces and torques."
            )
    return by_owner


def recorded(
    constraints: Constraints,
    samples: Poses,
    along: CurvePositions,
    followed: Followed,
    chosen: Mapping[str, Sequence[str]],
    stop: float,
    over: str,
    began: float,
) -> Motion:
    """Return samples, singular poses and ranges as a result over ``time``, or the first drive (``input``).

    ``began`` is the reading of ``perf_counter`` [s] when the analysis began.
    """
    d, evaluator = constraints.description, constraints.evaluator
    r, v = constraints.moving(samples)
    a = constraints.accelerating(samples)
    units = constraints.units()
    variables = [
        Variable(name, units[name], f"drive {name}", (), values)
        for name, values in constraints.driving(samples.times).items()
    ]
    used_names = {x.name for x in variables}
    if not chosen and (d.kinematic or d.rates):
        variables += [x for x in _requested(constraints, samples, along) if x.name not in used_names]
    if {*chosen} & {*d.scene_outputs}:
        outputs = shaped(evaluator.info("outputs"), samples.many(evaluator, "outputs"))
        variables += [x for x in outputs if x.name in d.scene_outputs and x.name in chosen]
    turning = constraints.turning(samples) if {*chosen} & {*d.links} else {}
    variables += [x for x in of_names(d, chosen, along.counted, turning, r, v, a) if x.name not in used_names]
    drive = next(iter(units), "") if over == "input" else ""
    method = "continuation"
    return Motion(**over_poses(constraints, samples, followed, variables, drive, method, stop, began))


def over_poses(
    constraints: Constraints,
    poses: Poses,
    followed: Followed,
    variables: Sequence[Variable],
    drive: str,
    method: str,
    stop: float,
    began: float,
    **statistics: Any,
) -> dict[str, Any]:
    """Return the fields of a result over poses: over the output ``drive``, or the time without one.

    ``stop`` is the end of the range [s], ``began`` the reading of ``perf_counter`` at the beginning [s].
    """
    d, evaluator = constraints.description, constraints.evaluator
    coordinate, others = coordinate_of(poses.times, variables, drive)
    used = evaluator.parameter_values.tolist()
    return {
        **of_model(d, used, method=method, t_end=stop, backend=evaluator.library.backend),
        "axes": d.axes,
        "coordinate": coordinate,
        "variables": tuple(others),
        "drift": Drift(*constraints.errors(poses)),
        "final": of_points(d, *(x[-1] for x in constraints.moving(poses[np.array([-1])]))),
        "statistics": {
            "t": float(poses.times[-1]),
            "steps": len(poses),
            **statistics,
            "singular_poses": [asdict(p) for p in followed.poses],
            "unassemblable": [list(r) for r in followed.unassemblable],
            "out_of_reach": [list(r) for r in followed.out_of_reach],
            "wall_s": perf_counter() - began,
        },
        "times": None if coordinate.name == "time" else poses.times,
    }


def coordinate_of(
    times: Array, variables: Sequence[Variable], drive: str
) -> tuple[Coordinate, list[Variable]]:
    """Return the output ``drive`` as the coordinate, or the time without one, and the other outputs.

    Of a component that is prescribed, its vector remains.
    """
    vectors = {name for v in variables for name in v.names[1:]}
    for v in variables:
        if v.name == drive:
            others = [x for x in variables if x is not v and x.name not in vectors]
            return Coordinate(drive, v.unit, drive, v.values), others
    return over_time(times), [x for x in variables if x.name not in vectors]


def _requested(constraints: Constraints, samples: Poses, along: CurvePositions) -> list[Variable]:
    """Return the outputs of the scene."""
    evaluator = constraints.evaluator
    rows = samples.many(evaluator, "outputs", samples.accelerations)
    variables = shaped(evaluator.info("outputs"), rows)
    angles = {f"{link}.angle": link for link in constraints.description.links}
    return [
        replace(x, values=along.counted(angles[x.name], x.values)) if x.name in angles else x
        for x in variables
    ]


def of_names(
    d: Description,
    chosen: Mapping[str, Sequence[str]],
    counted: Counted,
    turning: Mapping[str, tuple[Array, Array]],
    r: Array,
    v: Array,
    a: Array,
) -> Iterator[Variable]:
    """Yield the records of names, from the motion of all points, (samples, points, axes).

    ``turning`` are angular velocity and acceleration of links, (samples,) each.
    """
    for name, words in chosen.items():
        if name in d.scene_outputs:
            continue
        if name in d.points:
            variables = _of_point(d.points.index(name), name, d.axes, r, v, a)
        elif name in d.links:
            i, j = (d.points.index(p) for p in d.links[name][:2])
            line = r[:, j] - r[:, i]
            angle = counted(name, np.arctan2(line[:, 1], line[:, 0]))
            rows = zip(_OF_LINK, ("rad", "rad/s", "rad/s^2"), (angle, *turning[name]), strict=True)
            variables = [Variable(f"{name}.{w}", unit, f"{w} of {name}", (), x) for w, unit, x in rows]
        else:
            variables = _of_corner([d.points.index(p) for p in name.split(".")], name, r)
        yield from (x for x in variables if x.name.rpartition(".")[2] in words)


def _of_point(i: int, name: str, axes: tuple[str, ...], r: Array, v: Array, a: Array) -> list[Variable]:
    rows = zip(_OF_POINT, ("m", "m/s", "m/s^2"), (r, v, a), strict=True)
    return [Variable(f"{name}.{w}", unit, f"{w} of {name}", axes, x[:, i]) for w, unit, x in rows]


def _of_corner(points: list[int], name: str, r: Array) -> list[Variable]:
    """Return the angle at the second of three points, and the acute one between the two lines."""
    places = np.pad(r[:, points], ((0, 0), (0, 0), (0, 3 - r.shape[2])))
    a, b = places[:, 0] - places[:, 1], places[:, 2] - places[:, 1]
    area, along = np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1)
    texts = ("angle at {1} from {0} to {2}", "acute angle at {1} between the lines to {0} and {2}")
    rows = zip(_OF_CORNER, texts, (along, np.abs(along)), strict=True)
    return [
        Variable(f"{name}.{w}", "rad", text.format(*name.split(".")), (), np.arctan2(area, x))
        for w, text, x in rows
    ]
