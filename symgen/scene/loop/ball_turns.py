"""Ball joints of motions under forces: a leading rotation of their angles, set by runs near their pole."""

from __future__ import annotations

from dataclasses import replace
from itertools import count

import sympy as sp

from symgen.scene.loop.loop import Ball, Loop, Row
from symgen.scene.rods.run_parameters import Parameter
from symgen.symbolic.quantity import quantity


def with_ball_turns(loop: Loop) -> Loop:
    """Return a loop with a leading rotation at every ball whose angles are separate variables.

    Loops that inputs alone move have no runs that set it.
    """
    if not loop.having("free"):
        return loop
    used_names = {p.quantity.name for p in loop.parameters}
    names = (name for name in map("ball_{}".format, count(1)) if name not in used_names)
    angles = [_angles(loop, row) for row in loop.rows]
    balls = []
    for k, numbers in enumerate(angles):
        last = angles[k + 1] if numbers and numbers[2] < 0 and k + 1 < len(angles) else numbers
        if not last or last[2] < 0:  # no ball takes over the idle spin
            continue
        turn = quantity(next(names), "rad", f"leading rotation of the ball of row {k + 1}, held by runs")
        balls.append(Ball(k, (numbers[0], numbers[1], numbers[2]), turn))
    rows = list(loop.rows)
    for ball in balls:
        rows[ball.row] = replace(rows[ball.row], ahead=ball.turn.symbol)
    added = tuple(Parameter(ball.turn, sp.S.Zero) for ball in balls)
    return replace(loop, rows=tuple(rows), parameters=(*loop.parameters, *added), balls=tuple(balls))


def _angles(loop: Loop, row: Row) -> tuple[int, ...]:
    """Return the numbers of the variables theta, eta, alpha of a ball, a constant alpha as -1; else none.

    Angles that a load or a drive depends on stay those of the table.
    """
    if row.joint != "S":
        return ()
    symbols = [v.quantity.symbol for v in loop.variables]
    moving = [j for j, v in enumerate(loop.variables) if v.role == "input"]
    numbers = [symbols.index(x) if x in symbols else -1 for x in (row.theta, row.eta, row.alpha)]
    entries = [x for r in loop.rows for x in (r.theta, r.S, r.eta, r.alpha, r.a)]
    loads = [v.effort for v in loop.variables if v.effort is not None]
    loads += [x for load in loop.loads for x in (*load.force, *load.torque)]
    variables = [loop.variables[j] for j in numbers if j >= 0]
    alone = all(
        sum(x.has(v.quantity.symbol) for x in entries) == 1
        and not v.effort
        and not any(x.has(v.quantity.symbol, v.rate.symbol) for x in loads)
        for v in variables
    )
    has_alpha = numbers[2] >= 0 or not row.alpha.has(*symbols)
    return (
        tuple(numbers)
        if min(numbers[:2]) >= 0 and has_alpha and alone and not set(numbers) & set(moving)
        else ()
    )
