"""Terminal output of driven loops and of the motion of loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import Console

from symgen.report.analyses import print_modes_of_assembly
from symgen.report.extremes import Components, averages_of, means, print_work
from symgen.report.motion import print_recorded
from symgen.report.tables import print_notes, run_table, table
from symgen.runtime.result.result import Result, Variable
from symgen.runtime.result.state import AssemblyModes
from symgen.runtime.result.turn import Turn

#: Maximum number of input values listed individually; otherwise the range of every output.
_SHOWN = 6


def print_turn(turn: Turn, _: Any, console: Console) -> None:
    """Print every output at a few values of the input, or its minimum and maximum over many."""
    values, name, unit = turn.over[0], turn.coordinate.about, turn.shown_in[0]
    open_ = turn.undetermined
    determined = np.zeros(len(values), dtype=bool)

    def mark(component: str, pose: int) -> str:
        """Return the mark of a value that is undetermined because of redundant constraints."""
        return " *" if open_.get(component, determined)[pose] else ""

    outputs = Components(turn.shown, len(values), missing="pole")
    if len(values) <= _SHOWN:
        heads = [f"{name} = {x:.6g} {unit}" for x in values.tolist()]
        console.print(outputs.values(turn.title, heads, mark))
    else:
        span = f"{name} = {values[0]:.6g} to {values[-1]:.6g} {unit}"
        title = f"{turn.title}: {len(values)} poses, {span}"
        averages = averages_of(turn)
        console.print(outputs.extremes(title, values, unit, means=means(turn, averages), mark=mark))
        print_work(turn, averages, console)
    rows = (
        ("closure error", f"{turn.closure:.1e} (radians; lengths over the size of the loop)"),
        ("singular values of screws", f"smallest {turn.statistics['least_singular']:.2g} of the largest"),
    )
    console.print(table("The run", ("", ""), rows))
    if turn.indeterminate:
        console.print("* undetermined: a value of minimum norm")
    print_notes(turn.notes, console)


def print_motion_of_loop(result: Result, model: Any, console: Console) -> None:
    """Print final joint variables and states, the range of every output, and the errors of the run."""
    rows, states = list[tuple[Any, ...]](), model.description.states
    for name, v in result.final.items():
        unit, size = result.units.get(v["unit"], (v["unit"], 1.0))
        rows.append((name, unit, v["value"] / size, v["rate"] / size))
        if (state := name.removesuffix(".integral")) in states:  # the rate of its integral
            unit, size = result.units.get(states[state], (states[state], 1.0))
            rows[-1] = state, unit, v["rate"] / size, ""
    t = result.statistics["t"]
    console.print(
        table(f"{result.title}: at t = {t:g} s", ("variable", "unit", "value", "rate [unit/s]"), rows)
    )
    if result.variables:
        print_recorded(result, console)
    console.print(run_table(result))
    print_notes(result.notes, console)


def print_assemblies(modes: AssemblyModes[Mapping[str, float]], model: Any, console: Console) -> None:
    """Print the joint variables in every assembly mode."""
    variables = [
        Variable(v.name, v.unit, "", (), np.array([pose[v.name] for pose in modes]))
        for v in model.description.variables
        if v.role != "state"
    ]
    print_modes_of_assembly(variables, modes, model, console)
