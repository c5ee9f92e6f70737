"""Loops with letters for their constants."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from symgen.scene.loop.loop import ENTRIES, JointVariable, Loop, LoopBody, LoopLoad, Row
from symgen.scene.loop.resolve import OF_LOOP
from symgen.scene.rods.letters import added, gravity_of, motion_of
from symgen.symbolic.constants import vanishes, with_pi
from symgen.symbolic.names import Letter, Letters
from symgen.symbolic.quantity import AXES

#: Letters of the fields that hold constants.
_OF_LOOP_BODY = {
    "mass": Letter("m", "kg", "mass of link {link}"),
    "centre": Letter("s", "m", "centre of mass of link {link} in its frame"),
}

#: Entries of an inertia matrix in the order of a scene.
_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def of_loop(loop: Loop) -> tuple[Loop, Letters]:
    """Return a loop in letters."""
    known = [x.name for v in loop.variables for x in (v.quantity, v.rate, v.acceleration)]
    known += [p.quantity.name for p in loop.parameters]
    known += [name for name in loop.written.constants if OF_LOOP.fullmatch(name)]
    constants = {n: replace(c, expression=with_pi(c.expression)) for n, c in loop.written.constants.items()}
    letters = Letters(known, (), loop.defaults, replace(loop.written, constants=constants))
    written = replace(
        loop,
        rows=tuple(_row(letters, i, row, loop) for i, row in enumerate(loop.rows, 1)),
        variables=tuple(_variable(letters, v) for v in loop.variables),
        bodies=tuple(_loop_body(letters, b, f"loop.links.{b.link}") for b in loop.bodies),
        gravity=gravity_of(letters, loop.gravity, tuple(AXES)),
        loads=tuple(_loop_load(letters, load, f"loop.loads.{i}") for i, load in enumerate(loop.loads)),
    )
    return replace(written, parameters=(*loop.parameters, *added(letters))), letters


def _row(letters: Letters, number: int, row: Row, loop: Loop) -> Row:
    variables = {v.quantity.symbol for v in loop.variables}
    values = {}
    for entry in ENTRIES:
        value = getattr(row, entry)
        moving = sp.Add(*(term for term in sp.Add.make_args(value) if term.free_symbols & variables))
        fixed, angle = value - moving, entry not in ("S", "a")
        if entry == "S":
            where = f"loop.rows.{number - 1}.pitch"
            for v in moving.free_symbols & variables:
                moving += (letters.form(where, pitch := moving.coeff(v)) - pitch) * v
        if angle and fixed.is_number and vanishes(sp.sin(2 * fixed)) and not vanishes(fixed):
            continue  # a right angle: its sine and cosine are zero and one
        unit = "rad" if angle else "m"
        if fixed != 0 or moving == 0:
            about = f"{entry} of joint {number}, between {loop.rows[number - 2].link} and {row.link}"
            where = f"loop.rows.{number - 1}.{entry}" if moving == 0 else ""
            fixed = letters.scalar(f"{entry}{number}", fixed, unit, about, where)
        values[entry] = moving + fixed
    return replace(row, **values)


def _variable(letters: Letters, variable: JointVariable) -> JointVariable:
    name, effort = variable.name, variable.effort
    if effort is not None:
        where = f"states.{name}.rate" if variable.is_state else f"loop.drives.{name}"
        variable = replace(variable, effort=letters.form(where, effort))
    if variable.role != "input":
        return variable
    units = (variable.quantity.unit, variable.rate.unit)
    motion = motion_of(letters, variable.motion, name, units, name, f"loop.inputs.{name}")
    return replace(variable, motion=motion)


def _loop_body(letters: Letters, body: LoopBody, where: str) -> LoopBody:
    constants = letters.record(body, _OF_LOOP_BODY, body.link, where, link=body.link)
    known: dict[tuple[int, int], sp.Expr] = {}
    for k, (i, j) in enumerate(_ENTRIES):
        name = f"I_{AXES[i]}{AXES[j]}_{body.link}"
        entry = f"{AXES[i]}{AXES[j]} entry"
        about = f"{entry} of the inertia matrix of link {body.link} about its centre of mass, in its frame"
        known[i, j] = known[j, i] = letters.scalar(
            name, body.inertia[i][j], "kg*m^2", about, f"{where}.inertia.{k}"
        )
    x, y, z = (tuple(known[i, j] for j in range(3)) for i in range(3))
    return replace(body, **constants, inertia=(x, y, z))


def _loop_load(letters: Letters, load: LoopLoad, where: str) -> LoopLoad:
    owner = load.name.replace(".", "_")
    return replace(
        load,
        at=letters.vector(f"r_{owner}", load.at, "m", f"point of {load.name}", where=f"{where}.at"),
        force=letters.vector(f"F_{owner}", load.force, "N", f"force of {load.name}", where=f"{where}.force"),
        torque=letters.vector(
            f"T_{owner}", load.torque, "N*m", f"couple of {load.name}", where=f"{where}.torque"
        ),
    )
