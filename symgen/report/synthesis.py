"""Terminal output of a synthesis."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console

from symgen.report.tables import table


def print_synthesis(found: Any, console: Console) -> None:
    """Print class, lengths and transmission angles of every four-bar, and the faults of their motion."""
    rows = []
    for i, design in enumerate(found.designs, start=1):
        angles = (design.quantities.get(f"transmission_{end}", math.nan) for end in ("minimum", "maximum"))
        rows.append(
            (
                i,
                design.linkage.grashof,
                *(f"{length:.6g}" for length in design.linkage.lengths.values()),
                *("-" if math.isnan(angle) else f"{math.degrees(angle):.2f}" for angle in angles),
                f"{design.linkage.error:.1e}",
            )
        )
    count = len(found.designs)
    good = sum(not design.faults for design in found.designs)
    title = f"{found.title or 'Synthesis'}: {count} four-bar{'s' * (count != 1)}, {good} without a fault"
    heads = ("", "class", "crank", "coupler", "rocker", "fixed", "mu min", "mu max", "error")
    console.print(table(title, heads, rows, texts=(1,), keys=2))
    console.print(
        "lengths in m; mu: transmission angle in deg over a revolution of the crank, - where it makes none"
    )
    for i, design in enumerate(found.designs, start=1):
        for fault in design.faults:
            console.print(f"{i}: {fault}")
