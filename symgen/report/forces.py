"""Terminal output of forces in rigid links."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from symgen.report.tables import table
from symgen.runtime.result.forces import Forces
from symgen.runtime.result.records import columns

#: Maximum number of poses for which every value is printed; otherwise the largest.
_FEW = 12


def print_forces(found: Forces, _: Any, console: Console) -> None:
    """Print forces at a few poses, or the largest of many and where they occur."""
    along, label = found.over
    if len(along) <= _FEW:
        rows = [(v.name, v.unit, *v.values) for v in columns(found.shown)]
        head: tuple[str, ...] = ("output", "unit", *(f"{x:.9g}" for x in along))
        title = f"{found.title}: forces over {label}"
    else:
        units = {v.name: found.units.get(v.unit, (v.unit, 1.0)) for v in found.variables}
        shown = dict(zip(found.coordinate.values.tolist(), along.tolist(), strict=True))
        greatest = ((name, *units[name], *most) for name, most in found.greatest.items())
        rows = [(name, unit, value / size, shown[at]) for name, unit, size, value, at in greatest]
        head, title = ("output", "unit", "largest", f"at {label}"), f"{found.title}: {len(along)} poses"
    console.print(table(title, head, rows, keys=2))
    for note in found.notes:
        console.print(f"note: {note}")
    console.print(
        f"{found.headline} at {found.statistics['worst_at']}; balance met within "
        f"{found.statistics['residual']:.1e} of the largest force"
    )
