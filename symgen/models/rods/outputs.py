"""Outputs of a linkage: ``owner.word`` or a bare word; one line each in the tables below."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import SceneError, nearest
from symgen.models.rods.joint_forces import guide_force, guided
from symgen.models.rods.matrix import named
from symgen.scene.rods.linkage import TIME
from symgen.scene.rods.rotations import GearPair
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.quantity import Entries, parted, resolved
from symgen.symbolic.system import NamedMatrix
from symgen.symbolic.vectors import cross, cross_in_plane, dot

if TYPE_CHECKING:
    from symgen.mechanics.rods.particles import Vector
    from symgen.models.rods.linkage import RodsModel


_WITHOUT_TEETH = ", without the pressure of gear teeth"


def _reaction(model: RodsModel, name: str) -> Entries:
    if name not in model.ground:
        raise SceneError(
            f"{name} is not a ground point, so it has no reaction", hint=f"Ground: {', '.join(model.ground)}."
        )
    about = f"force of the ground on the linkage at {name}"
    geared = any(model.joint_forces.bears_teeth(part.name, name) for part in model.parts)
    return model.shown(model.reaction(name)), "N", about + _WITHOUT_TEETH * geared


def _tension(model: RodsModel, name: str) -> Entries:
    rod = model.rod(name)
    if rod is None:
        reason = "lies between two ground points" if name in model.idle else "is a body in space"
        raise SceneError(f"{name} {reason}: its tension is not determined")
    if name in model.implied:
        raise SceneError(f"{name} lies between points of one body: its tension is not determined")
    return [model.tension(rod)], "N", f"force of the length constraint of {name}, tension positive"


def _sum(model: RodsModel, at_points: Sequence[tuple[str, Vector]]) -> list[sp.Expr]:
    """Return the sum of vectors at points, by the axes of the scene."""
    return [sp.Add(*c) for c in zip(*(model.shown(v) for _, v in at_points), strict=True)]


def _moment(
    model: RodsModel, at_points: Sequence[tuple[str, Vector]], about: Vector | None = None
) -> list[sp.Expr]:
    """Return the sum of the moments of vectors at points about a place, otherwise the origin."""
    pairs = [(model.shown_position(point), model.shown(v)) for point, v in at_points]
    if about:
        pairs = [(tuple(a - b for a, b in zip(r, about, strict=True)), v) for r, v in pairs]
    if len(model.shown_axes) == 2:
        return [sp.Add(*(cross_in_plane(r, v) for r, v in pairs))]
    return [sp.Add(*c) for c in zip(*(cross(r, v) for r, v in pairs), strict=True)]


def _angle(model: RodsModel, name: str) -> Entries:
    if len(model.shown_axes) == 3:
        known = model.outputs_of_drives.get(name, {})
        if "angle" not in known:
            raise SceneError(
                f"in space only a link that is driven against the ground has an angle, got {name}.angle",
                hint=f"Record {name}.angular_velocity, {name}.relative_angle of a drive between links, "
                "or the angle A.B.C between the lines of three points.",
            )
        return known["angle"]
    d = model.along[name]
    return [sp.atan2(d[1], d[0])], "rad", f"direction of {name}"


def _angular_velocity(model: RodsModel, name: str) -> Entries:
    if len(model.axes) == 2:
        rate = model.turning(name)[1]
        turning = model.shown((ZERO, ZERO), rate) if model.linkage.plane else [rate]
        return turning, "rad/s", f"angular velocity of {name}"
    return model.angular_velocity(name), "rad/s", f"angular velocity of {name}"


def _angular_acceleration(model: RodsModel, name: str) -> Entries:
    if len(model.axes) == 3:
        raise SceneError(
            f"a link has an angular acceleration only in the plane, got {name}.angular_acceleration",
            hint=f"Record {name}.angular_velocity.",
        )
    rate = model.turning_acceleration(name)
    turning = model.shown((ZERO, ZERO), rate) if model.linkage.plane else [rate]
    return turning, "rad/s^2", f"angular acceleration of {name}"


def _speed_ratio(model: RodsModel, name: str) -> Entries:
    """Return the rate of a link over that of the drive, which must be constant and so cannot vanish."""
    drives = model.angle_drives
    if len(drives) != 1 or len(model.axes) != 2:
        got = "a linkage in space" if len(model.axes) != 2 else f"{len(drives)} driven links"
        raise SceneError(
            f"a speed ratio needs a planar linkage with one driven link, got {got}",
            hint="Record angular_velocity.",
        )
    driven, link = drives[0].rate, drives[0].owner
    if driven == 0 or TIME.symbol in driven.free_symbols:
        raise SceneError(
            f"a speed ratio needs a drive at constant speed, got the angle {drives[0].value}",
            hint=f'Write angle = "speed*t" for {link}: the ratio does not depend on the speed.',
        )
    rate, _, _ = _angular_velocity(model, name)
    drive = " against ".join(drives[0].driver.links)
    return [rate[0] / driven], "1", f"angular velocity of {name} over that of {drive}"


def _across_and_along(model: RodsModel, first: str, vertex: str, second: str) -> tuple[sp.Expr, sp.Expr]:
    """Return |a x b| and a.b of the lines from a vertex to two other points."""
    a, b = (
        tuple(x - y for x, y in zip(model.shown_position(p), model.shown_position(vertex), strict=True))
        for p in (first, second)
    )
    area = abs(cross_in_plane(a, b)) if len(a) == 2 else sp.sqrt(sp.Add(*(x**2 for x in cross(a, b))))
    return area, dot(a, b)


def _angle_at(model: RodsModel, *corner: str) -> Entries:
    first, vertex, second = corner
    about = f"angle at {vertex} from {first} to {second}"
    return [sp.atan2(*_across_and_along(model, *corner))], "rad", about


def _transmission_angle(model: RodsModel, *corner: str) -> Entries:
    across, along = _across_and_along(model, *corner)
    about = "acute angle at {1} between the lines to {0} and {2}".format(*corner)
    return [sp.atan2(across, abs(along))], "rad", about


def _force(model: RodsModel, link: str, point: str) -> Entries:
    force, about = model.joint_forces.on(link, point), f"force on {link} at {point} from joined components"
    return model.shown(force), "N", about + _WITHOUT_TEETH * model.joint_forces.bears_teeth(link, point)


def _of_drive(word: str, model: RodsModel, name: str) -> Entries:
    known = model.outputs_of_drives.get(name, {})
    if word not in known:
        lacking, hint = OF_DRIVES[word]
        raise SceneError(f"{name} {lacking}", hint=hint.format(name=name))
    return known[word]


def _power_of_ground(model: RodsModel, name: str) -> Entries:
    _reaction(model, name)
    velocity = tuple(map(model.in_place, model.velocity(name)))
    if not any(velocity):
        raise SceneError(f"{name} has no motion, so its reaction has no power")
    return [dot(model.reaction(name), velocity)], "W", f"power of the motion of {name}"


def _moment_about(model: RodsModel, name: str) -> Entries:
    about = f"moment of the linkage on the ground about {name}"
    return _moment(model, model.on_ground, model.shown_position(name)), "N*m", about


def mesh_torque(model: RodsModel, pair: GearPair) -> sp.Expr:
    """Return the torque of gears on the first link [N m], counter-clockwise."""
    return -model.multipliers[pair.name].symbol * model.linkage.link(pair.links[0]).length


def _of_gears(model: RodsModel) -> dict[str, Callable[[], Entries]]:
    """Return the torques of gears, each to be derived."""

    def torque(number: int, pair: GearPair) -> Entries:
        return [mesh_torque(model, pair)], "N*m", f"torque of gears {number} on {pair.links[0]}"

    return {f"gears.{i}.torque": partial(torque, i, x) for i, x in enumerate(model.linkage.gears)}


#: Outputs of a point, of a link, of a point of a link, and of the whole linkage, by word.
OF_POINTS: dict[str, Callable[[RodsModel, str], Entries]] = {
    "position": lambda model, name: (model.shown_position(name), "m", f"position of {name}"),
    "velocity": lambda model, name: (model.shown(model.velocity(name)), "m/s", f"velocity of {name}"),
    "acceleration": lambda model, name: (
        model.shown(model.acceleration(name)),
        "m/s^2",
        f"acceleration of {name}",
    ),
    "reaction": _reaction,
    "power": _power_of_ground,
    "shaking_moment": _moment_about,
}
#: Outputs of points of linkages without elastic links.
OF_RIGID_POINTS = ("power", "shaking_moment")
OF_LINKS: dict[str, Callable[[RodsModel, str], Entries]] = {
    "tension": _tension,
    "torque": partial(_of_drive, "torque"),
    "angle": _angle,
    "relative_angle": partial(_of_drive, "relative_angle"),
    "angular_velocity": _angular_velocity,
    "angular_acceleration": _angular_acceleration,
    "speed_ratio": _speed_ratio,
}
_OF_LENGTHS = (
    "Those of loads are outputs by their number from 0, such as springs.0.length and actuators.0.power; "
    "LINK.tension is the force of any rod."
)
#: Outputs of a link that is driven: what to say of one that lacks it, and what to do.
OF_DRIVES = {
    "torque": (
        "has no driver, so no drive torque",
        "Remove {name}.torque from the outputs, as --set analysis.outputs=none does with all; applied "
        "torques are outputs by their number from 0, such as torques.0.torque.",
    ),
    "relative_angle": (
        "is driven against no other link: it has no relative angle",
        "Record {name}.angle, or the angle A.B.C between the lines of three points.",
    ),
    "power": ("has no driver and no driven length, so no power", _OF_LENGTHS),
    **{
        word: (f"has no driven length, so no {word}", _OF_LENGTHS)
        for word in ("force", "length", "length_rate")
    },
}
#: Outputs of a corner: a point between two others.
OF_CORNERS: dict[str, Callable[..., Entries]] = {
    "angle": _angle_at,
    "transmission_angle": _transmission_angle,
}
#: Words of the field that are no outputs, and what to record in their place.
_SPECTRUM = (
    "Those of an equilibrium are in modes(); derivatives of 'frequencies' and 'poles' in sensitivity() at it."
)
ELSEWHERE = {
    **dict.fromkeys(("frequencies", "poles", "damping_ratio", "damping_ratios"), _SPECTRUM),
    "rate": "Record LINK.angular_velocity.",
    "mechanical_advantage": "Record LINK.speed_ratio: the mechanical advantage is its reciprocal, which is "
    "unbounded at the limit positions of the link.",
    "swing": "Record LINK.angle: the swing is its range, which tables of results and sweeps (--reduce range) "
    "show.",
}
OF_THE_WHOLE: dict[str, Callable[[RodsModel], Entries]] = {
    "energy": lambda model: (
        [model.kinetic_energy + model.potential_energy],
        "J",
        "kinetic plus potential energy",
    ),
    "kinetic_energy": lambda model: ([model.kinetic_energy], "J", "kinetic energy"),
    "potential_energy": lambda model: (
        [model.potential_energy],
        "J",
        "potential of gravity and springs",
    ),
    "power": lambda model: (
        [model.power],
        "W",
        "power of the loads without potential, of drives and of the moving ground",
    ),
    "momentum": lambda model: (_sum(model, model.momenta), "kg*m/s", "linear momentum"),
    "angular_momentum": lambda model: (
        _moment(model, model.momenta),
        "kg*m^2/s",
        "angular momentum about the origin",
    ),
    "shaking_force": lambda model: (
        _sum(model, model.on_ground),
        "N",
        "force of the linkage on the ground",
    ),
    "shaking_moment": lambda model: (
        _moment(model, model.on_ground),
        "N*m",
        "moment of the linkage on the ground about the origin",
    ),
}
#: Outputs of elastic links, which their runs recover.
OF_ELASTIC = (
    *("bending_strain", "axial_strain", "stress", "deflection", "displacement", "length_change"),
    *("arc_length_change", "rotation", "curvature", "shaft_angle"),
    *("strain_energy", "dissipated_power", "shaft_power", "omitted_power"),
    *("greatest_stress", "greatest_stress_at"),
)
#: The same in space, where some are outputs of rigid links too.
OF_ELASTIC_IN_SPACE = (
    *("axial_strain", "bending_strain_y", "bending_strain_z", "torque", "moment_y", "moment_z"),
    *("stress", "stress_1", "stress_2", "stress_3", "stress_4", "deflection", "position"),
    *("force", "moment", "length_change", "power", "kinetic_energy", "strain_energy", "potential_energy"),
    *("dissipated_power", "input_power"),
)
#: Outputs that need no masses and no forces.
KINEMATIC = (
    *("position", "velocity", "acceleration", "angle", "angular_velocity", "angular_acceleration"),
    *("transmission_angle", "speed_ratio", "relative_angle", "length", "length_rate", "rate"),
)
#: Outputs of a point of a link.
OF_JOINTS: dict[str, Callable[[RodsModel, str, str], Entries]] = {"force": _force, "guide_force": guide_force}


def requested_outputs(model: RodsModel) -> list[NamedMatrix]:
    """Return one matrix for each requested output; positions, velocities and energy by default."""
    names = model.linkage.outputs
    if names is None:
        names = (
            *(
                f"{p}.{word}"
                for p in model.points
                if p not in model.ground and not model.linkage.point(p).hidden
                for word in ("position", "velocity")
            ),
            *(() if model.linkage.kinematic else ("energy",)),
            *model.linkage.scene_outputs,
        )
    matrices = []
    for i, name in enumerate(names):
        word = parted(name)[0].rpartition(".")[2]
        try:
            if name in names[:i]:
                raise SceneError(f"{name!r} is listed twice")
            if model.linkage.elastic and word in OF_ELASTIC:
                continue
            scalars, unit, description = entries(model, name)
        except SceneError as error:
            if model.linkage.method == "spatial" and name not in names[:i]:
                if word in OF_ELASTIC_IN_SPACE:
                    continue  # which runs select, or refuse
                hint = ELSEWHERE.get(word) or nearest(word, OF_ELASTIC_IN_SPACE)
                error = SceneError(error.problem, hint=hint)
            raise error.located(where=f"analysis.outputs.{i}") from None
        rows = model.shown_axes if len(scalars) > 1 else ()
        matrices.append(named(model, name, scalars, unit, description, rows=rows))
    return matrices


def entries(model: RodsModel, name: str) -> Entries:
    """Return the scalars of an output or a component, the unit and the description, or raise SceneError."""
    return resolved(name, model.shown_axes, lambda whole: _entries(model, whole))


def _entries(model: RodsModel, name: str) -> Entries:
    own = model.own_output(name)
    if own is not None:
        return own
    if name in model.loads.outputs and "." not in name:
        if name in OF_THE_WHOLE:
            raise SceneError(f"{name!r} of [[outputs]] has a meaning already", hint="Choose another name.")
        return model.loads.outputs[name]()
    owner, _, word = name.rpartition(".")
    rigid = not model.linkage.elastic  # loads and drives of others follow the deformed links
    of_loads = {**model.loads.outputs, **_of_gears(model)} if rigid else {}
    if word in ELSEWHERE and name not in of_loads:
        raise SceneError(f"there is no output {name!r}", hint=ELSEWHERE[word])
    if model.linkage.kinematic and word not in KINEMATIC:
        raise SceneError(
            f"{name!r} is no output of kinematics: those are {', '.join(KINEMATIC)}",
            hint='For forces and energies write kind = "dynamics" under [analysis].',
        )
    if not owner:
        if word in OF_THE_WHOLE and (rigid or word != "power"):
            return OF_THE_WHOLE[word](model)
        owners = [f"{p}.{word}" for p in model.points if word in OF_POINTS]
        owners += [f"{k.name}.{word}" for k in model.parts if word in OF_LINKS]
        owners += ["A.B.C." + word] if word in OF_CORNERS else []
        acting = [
            f
            for f, derived in of_loads.items()
            if f.endswith((".force", ".torque"))
            if any(str(s) == word for e in derived()[0] for s in e.free_symbols)
        ]
        called = [k.name for k in model.parts]
        words = OF_POINTS if word in model.points else OF_LINKS if word in called else ()
        hint = nearest(name, [*OF_THE_WHOLE, *(f"{word}.{w}" for w in words)])
        if owners:
            hint = f"It belongs to a point or link: {', '.join(owners)}."
        elif acting:
            hint = f"It acts in {', '.join(acting)}, which can be recorded."
        raise SceneError(f"there is no output {name!r}", hint=hint)
    if name in of_loads:
        return of_loads[name]()
    if word in OF_POINTS and owner in model.points and (rigid or word not in OF_RIGID_POINTS):
        return OF_POINTS[word](model, owner)
    links = {k.name: [*k.base, *(c.name for c in k.carried)] for k in model.parts}
    if word in OF_LINKS and owner in links:
        return OF_LINKS[word](model, owner)
    if owner in links and rigid and (word in OF_DRIVES or word in model.outputs_of_drives.get(owner, ())):
        return _of_drive(word, model, owner)
    corner = owner.split(".")
    if word in OF_CORNERS and len(set(corner)) == len(corner) == 3 and set(corner) <= set(model.points):
        return OF_CORNERS[word](model, *corner)
    link, _, point = owner.partition(".")
    joints = {"force": links, "guide_force": guided(model) if rigid else {}}
    if point in joints.get(word, {}).get(link, ()):
        return OF_JOINTS[word](model, link, point)
    known = [*OF_THE_WHOLE, *(f"{p}.{w}" for p in model.points for w in OF_POINTS)]
    known += [f"{k}.{w}" for k in links for w in OF_LINKS]
    known += [f"{k}.{p}.force" for k, points in links.items() if k not in model.idle for p in points]
    known += [f"{k}.{p}.guide_force" for k, points in joints["guide_force"].items() for p in points]
    known += [*of_loads, *(f"{k}.{w}" for k, words in model.outputs_of_drives.items() for w in words)]
    raise SceneError(f"there is no output {name!r}", hint=nearest(name, known))
