"""Loops with letters for their constants."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import sympy as sp

from symgen.scene.loop.loop import ENTRIES, Loop, LoopBody, LoopLoad, Row, Variable
from symgen.scene.rods.letters import added, gravity_of, motion_of
from symgen.symbolic.constants import vanishes
from symgen.symbolic.names import Letter, Letters
from symgen.symbolic.quantity import AXES

#: Letters of the fields that hold constants.
_OF_LOOP_BODY = {
    "mass": Letter("m", "kg", "mass"),
    "centre": Letter("s", "m", "centre of mass"),
}


def of_loop(loop: Loop) -> tuple[Loop, Letters]:
    """Return a loop in letters."""
    known = [x.name for v in loop.variables for x in (v.quantity, v.rate, v.acceleration)]
    letters = Letters([*known, *(p.quantity.name for p in loop.parameters)], (), loop.defaults)
    written = replace(
        loop,
        rows=tuple(_row(letters, i, row, loop) for i, row in enumerate(loop.rows, 1)),
        variables=tuple(_input(letters, v) if v.role == "input" else v for v in loop.variables),
        bodies=tuple(_loop_body(letters, b) for b in loop.bodies),
        gravity=gravity_of(letters, loop.gravity, tuple(AXES)),
        loads=tuple(_loop_load(letters, load) for load in loop.loads),
    )
    return replace(written, parameters=(*loop.parameters, *added(letters))), letters


def _row(letters: Letters, number: int, row: Row, loop: Loop) -> Row:
    variables = {v.quantity.symbol for v in loop.variables}
    values = {}
    for entry in ENTRIES:
        value = getattr(row, entry)
        moving = sp.Add(*(term for term in sp.Add.make_args(value) if term.free_symbols & variables))
        fixed, angle = value - moving, entry not in ("S", "a")
        if angle and fixed.is_number and vanishes(sp.sin(2 * fixed)) and not vanishes(fixed):
            continue  # a right angle: its sine and cosine are zero and one
        unit = "rad" if angle else "m"
        if fixed != 0 or moving == 0:
            fixed = letters.scalar(f"{entry}{number}", fixed, unit, f"{entry} of row {number}")
        values[entry] = moving + fixed
    return replace(row, **values)


def _input(letters: Letters, variable: Variable) -> Variable:
    units = (variable.quantity.unit, variable.rate.unit)
    return replace(variable, motion=motion_of(letters, variable.motion, variable.name, units, variable.name))


def _loop_body(letters: Letters, body: LoopBody) -> LoopBody:
    constants = letters.record(body, _OF_LOOP_BODY, body.link, f"link {body.link}")
    known: dict[tuple[int, int], sp.Expr] = {}
    for i, j in _upper():
        name = f"I_{AXES[i]}{AXES[j]}_{body.link}"
        about = f"{AXES[i]}{AXES[j]} entry of the inertia matrix of link {body.link} about its centre of mass"
        known[i, j] = known[j, i] = letters.scalar(name, body.inertia[i][j], "kg*m^2", about)
    x, y, z = (tuple(known[i, j] for j in range(3)) for i in range(3))
    return replace(body, **constants, inertia=(x, y, z))


def _upper() -> Iterator[tuple[int, int]]:
    return ((i, j) for i in range(3) for j in range(i, 3))


def _loop_load(letters: Letters, load: LoopLoad) -> LoopLoad:
    owner = load.name.replace(".", "_")
    return replace(
        load,
        at=letters.vector(f"r_{owner}", load.at, "m", f"point of {load.name}"),
        force=letters.vector(f"F_{owner}", load.force, "N", f"force of {load.name}"),
        torque=letters.vector(f"T_{owner}", load.torque, "N*m", f"couple of {load.name}"),
    )
