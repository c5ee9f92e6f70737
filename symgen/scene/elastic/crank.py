"""The crank of a linkage with elastic links: what turns it, and its part in the rigid motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.elastic.links import Crank
from symgen.scene.elastic.schema import CrankTable as Table
from symgen.scene.reading import Reader
from symgen.scene.rods.linkage import TIME, RigidLink, state_symbol
from symgen.scene.rods.rotations import Driver

_ZERO = sp.Integer(0)


def crank(read: Reader) -> Crank | None:
    """Return how the input turns; None where every link is rigid.

    Raises
    ------
    SceneError
        When there is none and a link is elastic, or the other way round, or when it cannot turn.
    """
    scene, table = read.scene, read.scene.crank
    elastic = [name for name, link in scene.links.items() if link.elastic is not None]
    if table is None:
        # In space drivers and moving ground points are the input.
        if elastic and read.dimension == 2:
            raise SceneError(
                f"the link {elastic[0]} is elastic, and the motion of the input is not prescribed",
                where="crank",
                hint='Write [crank] with link = "..." and speed = "300 rpm". For a cantilever or a frame, '
                'a link that the ground clamps has speed = "0 rpm"; a link that nothing drives also has '
                'mode = "free".',
            )
        return None
    if not elastic:
        raise SceneError(
            "no link is elastic, and [crank] prescribes the input motion of elastic links",
            where="crank",
            hint="Make a link elastic, or write [[drivers]] with link and angle.",
        )
    _check_link(read, table.link)
    torque, flywheel = _motor(read, table)
    angle = _angle(read, table)
    prescribed = TIME.symbol in angle.free_symbols
    speed = _ZERO if prescribed else _speed(read, table)
    return Crank(table.link, table.mode, angle, speed, torque, flywheel, prescribed)


def driver_of(crank: Crank) -> Driver:
    """Return the driver that turns it in the rigid motion."""
    return Driver(crank.link, crank.angle + crank.speed * TIME.symbol)


def with_flywheel(links: Iterable[RigidLink], crank: Crank | None) -> Iterator[RigidLink]:
    """Yield the links, the crank with its flywheel; the elements of an elastic one have it on the shaft."""
    for link in links:
        on = crank is not None and link.name == crank.link
        yield replace(link, inertia=link.inertia + crank.flywheel) if crank and on else link


def _check_link(read: Reader, name: str) -> None:
    """Check that a link can be the crank: it turns about its first point, and nothing else drives it."""
    read.turning_link(name, "crank.link")
    first, second = (read.known_point(p, "crank.link") for p in read.scene.links[name].points[:2])
    if not first.ground:
        swap = f'Swap them: links.{name} with points = ["{second.name}", "{first.name}"].'
        raise SceneError(
            f"the crank turns about its first point, and {first.name} of {name} is no ground point",
            where="crank.link",
            hint=swap if second.ground else "Name a link that has a point on the ground.",
        )
    for i, driver in enumerate(read.scene.drivers):
        if driver.link == name:
            raise SceneError(
                f"{name} is the crank, whose speed drives it already",
                where=f"drivers.{i}.link",
                hint="Leave this driver out.",
            )


def _angle(read: Reader, table: Table) -> sp.Expr:
    if table.angle is not None:
        angle = read.value(table.angle, units.NUMBER, "crank.angle", read.with_time)
        if TIME.symbol in angle.free_symbols:
            _check_prescribed(read, table, angle)
        return angle
    first, second = (read.points[p] for p in read.scene.links[table.link].points[:2])
    x, y = (b - a for a, b in zip(first.at, second.at, strict=True))
    return sp.atan2(y, x)


def _check_prescribed(read: Reader, table: Table, angle: sp.Expr) -> None:
    """Check an angle that is a function of the time."""
    read.moving(angle, units.NUMBER, "crank.angle")
    if table.speed is not None:
        raise SceneError(
            "the angle of the crank depends on the time t: it has no speed in addition",
            where="crank.speed",
            hint="Leave speed out, and add it times t to the angle.",
        )
    if table.mode != "held":
        raise SceneError(
            f"a crank that is {table.mode} has no prescribed angle",
            where="crank.angle",
            hint='Write mode = "held", or an angle without t.',
        )


def _speed(read: Reader, table: Table) -> sp.Expr:
    if table.speed is None:
        raise SceneError(
            "the crank needs its speed",
            where="crank.speed",
            hint='Write speed = "300 rpm", or an angle that uses the time t.',
        )
    return read.value(table.speed, units.ANGULAR_RATE, "crank.speed")


def _motor(read: Reader, table: Table) -> tuple[sp.Expr, sp.Expr]:
    """Return torque and flywheel of a motor; zero in the other modes, which have neither."""
    if table.mode != "motor":
        for key in ("torque", "flywheel"):
            if getattr(table, key) is not None:
                raise SceneError(
                    f"a crank that is {table.mode} has no {key}",
                    where=f"crank.{key}",
                    hint='Write mode = "motor", or leave it out.',
                )
        return _ZERO, _ZERO
    if table.torque is None:
        raise SceneError(
            "a motor needs its torque",
            where="crank.torque",
            hint='Write torque = "2 N*m", or an expression of t, this.angle, this.rate and [states].',
        )
    names = {**read.with_time, **read.states}
    for word, value, dim in (
        ("angle", "angle", units.NUMBER),
        ("rate", "angular_velocity", units.ANGULAR_RATE),
    ):
        for owner in ("this", table.link):
            names[f"{owner}.{word}"] = state_symbol(f"{table.link}.{value}"), dim
    torque = read.value(table.torque, units.TORQUE, "crank.torque", names)
    flywheel = read.not_negative(table.flywheel or 0, units.INERTIA, "crank.flywheel")
    return torque, flywheel
