"""Terminal output of forces in rigid links."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from rich.console import Console

from symgen.report.extremes import FEW, Components, averages_of, means, print_work, times
from symgen.report.tables import print_notes, table
from symgen.runtime.result.forces import Forces
from symgen.runtime.result.records import columns


def print_forces(forces: Forces, _: Any, console: Console) -> None:
    """Print forces at a few poses, or the least and greatest of many and where they occur."""
    along, label = forces.over
    if len(along) <= FEW:
        rows = [*times(forces), *((v.name, v.unit, *v.values) for v in columns(forces.shown))]
        head = ("output", "unit", *(f"{x:.9g}" for x in along))
        console.print(table(f"{forces.title}: forces over {label}", head, rows, keys=2))
    else:
        sizes = [
            replace(v, components=(), values=np.linalg.norm(v.values, axis=-1)) if v.components else v
            for v in forces.shown
        ]
        name, unit = label.removesuffix("]").split(" [")
        title = f"{forces.title}: {len(along)} poses over {name}, vectors by their magnitude"
        averages = averages_of(forces, magnitudes=True)
        by_name = means(forces, averages)
        console.print(Components(sizes, len(along)).extremes(title, along, unit, means=by_name))
        print_work(forces, averages, console)
    print_notes(forces.notes, console)
    console.print(f"{forces.headline} at {forces.statistics['worst_at']}; {forces.check}")
