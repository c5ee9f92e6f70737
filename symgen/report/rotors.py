"""Terminal output for rotors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rich.console import Console

from symgen.report.tables import MODES, print_notes, table
from symgen.runtime.result.modes import RotorModes


def print_modes_of_rotor(poses: Sequence[RotorModes], model: Any, console: Console) -> None:
    """Print the frequencies, the parts of their strain energy by kind, and the error of the elements."""
    for modes in poses:
        head = ["mode", "[Hz]", *(kind.replace("_", " by ") for kind in modes.parts)]
        if len(modes.errors_of_elements):
            head.append("error of elements")
        rows = []
        for k, frequency in enumerate(modes.frequencies[:MODES]):
            row = [str(k + 1), f"{frequency:.6g}", *(f"{x[k]:.2f}" for x in modes.parts.values())]
            if len(modes.errors_of_elements):
                error = modes.errors_of_elements[k]
                row.append(f"{error:.1e}" if math.isfinite(error) else "round-off")
            rows.append(tuple(row))
        speed = f"{modes.speed * 30 / math.pi:.6g} rpm"
        title = f"{model.description.title}: modes at {speed}, with the parts of their strain energy"
        console.print(table(title, head, rows))
        more = len(modes.frequencies) - MODES
        if more > 0:
            console.print(f"and {more} more modes: --json lists all")
        print_notes(modes.notes, console)
