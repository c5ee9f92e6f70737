"""Elastic links on the terminal: modes in poses, and what a run found."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from rich.console import Console

from symgen.report.tables import table
from symgen.runtime.elastic_modes import ElasticModes
from symgen.runtime.elastic_result import ElasticResult
from symgen.runtime.sweep import Sweep


def print_elastic_modes(poses: Sequence[ElasticModes], title: str, console: Console) -> None:
    """Print the frequencies of the structure at rest, a column for each pose."""
    head = ("mode", *(f"{math.degrees(p.angle):.6g} deg [Hz]" for p in poses))
    count = max(len(p.frequencies) for p in poses)
    rows = [(str(i + 1), *(f"{p.frequencies[i]:.6g}" for p in poses)) for i in range(count)]
    console.print(table(f"{title}: the structure at rest in its pose", head, rows))


def print_sweep(result: Sweep, console: Console) -> None:
    """Print peaks and stability at every speed, and the critical speeds."""
    shown = [v for v in result.variables if v.name.endswith(".bending_strain")]
    head = ("speed [rpm]", *(f"{v.name} [{v.unit}]" for v in shown), "largest multiplier")
    multipliers = result.variable("floquet").values
    rows = [
        (f"{speed:.6g}", *(f"{v.values[k]:.5g}" for v in shown), f"{multipliers[k]:.6g}")
        for k, speed in enumerate(result.speeds)
    ]
    console.print(table(f"{result.title}: {result.headline}", head, rows))
    console.print(f"first critical speed: {result.first_critical:.6g} rpm")
    for what, speeds in (("resonances", result.resonances), ("unstable", result.unstable)):
        console.print(f"{what} at: {', '.join(f'{s:.5g}' for s in speeds) or 'none'}")
    for note in result.notes:
        console.print(f"note: {note}")


def print_elastic_result(result: ElasticResult, console: Console) -> None:
    """Print the peak of every output and where it is, and how good the run is."""
    rows = []
    for v in result.variables:
        columns = v.values.reshape(len(result.time), -1)
        for i, component in enumerate(v.components or ("",)):
            at = int(np.argmax(np.abs(columns[:, i])))
            name = f"{v.name}.{component}" if component else v.name
            rows.append((name, v.unit, f"{columns[at, i]:.6g}", f"{result.angles[at]:.6g}"))
    head = ("output", "unit", "peak", "at crank angle [deg]")
    console.print(table(f"{result.title}: {result.headline}", head, rows))
    if result.floquet:
        largest = abs(result.floquet[0])
        verdict = "unstable" if largest > 1 + 1e-6 else "stable"
        console.print(f"largest Floquet multiplier {largest:.6g}: the steady state is {verdict}")
    for note in result.notes:
        console.print(f"note: {note}")
