"""Driven loops, and the motion of loops, on the terminal."""

from __future__ import annotations

import numpy as np
from rich.console import Console

from symgen.report.tables import run_table, table
from symgen.runtime.result import Result
from symgen.runtime.turn import Turn

#: Values of the input that are shown one by one; of more, the range of every output.
_SHOWN = 6


def print_turn(turn: Turn, console: Console) -> None:
    """Print every output at a few values of the input, or its least and greatest over many."""
    values, name, unit = turn.values_of_input, turn.input, turn.unit_of_input
    if unit == "rad":
        values, unit = np.degrees(values), "deg"
    columns = [
        (f"{v.name}.{c}" if c else v.name, v.unit, v.values.reshape(len(values), -1)[:, i])
        for v in turn.variables
        for i, c in enumerate(v.components or ("",))
    ]
    if len(values) <= _SHOWN:
        head = ("output", "unit", *(f"{name} = {x:.9g} {unit}" for x in values.tolist()))
        rows = [(n, u, *(_number(x) for x in column.tolist())) for n, u, column in columns]
        console.print(table(turn.title, head, rows))
    else:
        head = ("output", "unit", "least", f"at {name} [{unit}]", "greatest", f"at {name} [{unit}]")
        rows = []
        for n, u, column in columns:
            if np.all(np.isnan(column)):
                continue
            low, high = int(np.nanargmin(column)), int(np.nanargmax(column))
            ends = (column[low], values[low], column[high], values[high])
            rows.append((n, u, *(_number(float(x)) for x in ends)))
        span = f"{name} = {values[0]:.6g} to {values[-1]:.6g} {unit}"
        console.print(table(f"{turn.title}: {len(values)} poses, {span}", head, rows))
    console.print(
        f"closed within {turn.closure:.1e} (radians, and parts of its size); least singular value of its "
        f"screws {turn.statistics['least_singular']:.2g} of the largest"
    )
    for note in turn.notes:
        console.print(f"Note: {note}.", soft_wrap=True)


def print_motion_of_loop(result: Result, console: Console) -> None:
    """Print where the joint variables ended, and how well the run kept what it must keep."""
    rows = [(n, v["unit"], _number(v["value"]), _number(v["rate"])) for n, v in result.final.items()]
    t = result.statistics["t"]
    console.print(
        table(f"{result.title}: at t = {t:g} s", ("variable", "unit", "value", "rate [unit/s]"), rows)
    )
    console.print(run_table(result))
    for note in result.notes:
        console.print(f"Note: {note}.", soft_wrap=True)


def _number(value: float) -> str:
    return "pole" if np.isnan(value) else f"{value + 0.0:.9g}"  # no -0
