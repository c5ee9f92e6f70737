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

#: With at most so many times every value is printed, else the peaks.
_FEW = 6


def print_elastic_modes(poses: Sequence[ElasticModes], title: str, console: Console) -> None:
    """Print the frequencies of the structure in its poses, and what reductions make of them, in columns."""
    moving = any(len(p.growth) for p in poses)
    head, columns = ["mode"], []
    for p in poses:
        pose = f"{math.degrees(p.angle):.6g} deg"
        head.append(f"{pose} [Hz]")
        columns.append([f"{x:.6g}" for x in p.frequencies])
        if moving:
            head.append("growth [1/s]")
            columns.append([f"{x:.3g}" for x in p.growth])
        if p.without_reduction is not None:
            head.append(f"error of reducing {p.without_reduction[1]} unknowns")
            columns.append([f"{x:.1e}" for x in p.errors])
    count = max(len(c) for c in columns)
    rows = [(str(i + 1), *(c[i] if i < len(c) else "" for c in columns)) for i in range(count)]
    what = "as it moves" if moving else "at rest in its pose"
    console.print(table(f"{title}: the structure {what}", head, rows))


def print_sweep(result: Sweep, console: Console) -> None:
    """Print peaks and stability at every speed, and the critical speeds."""
    shown = [v for v in result.variables if v.name.endswith(".bending_strain")]
    head = ("speed [rpm]", *(f"{v.name} [{v.unit}]" for v in shown), "largest multiplier")
    multipliers = result.variable("floquet").values
    rows = [
        (
            f"{speed:.6g}",
            *(f"{v.values[k]:.5g}" for v in shown),
            f"{multipliers[k]:.6g}" if result.verdicts[k] is not None else "not resolved",
        )
        for k, speed in enumerate(result.speeds)
    ]
    console.print(table(f"{result.title}: {result.headline}", head, rows))
    console.print(f"first critical speed, that of the lowest frequency: {result.first_critical:.6g} rpm")
    for what, speeds in (("resonances", result.resonances), ("unstable", result.unstable)):
        console.print(f"{what} at: {', '.join(f'{s:.5g}' for s in speeds) or 'none'}")
    for note in result.notes:
        console.print(f"note: {note}")


def print_elastic_result(result: ElasticResult, console: Console) -> None:
    """Print the outputs at a few times, or the peak of many and where it is, and how good the run is."""
    rows: list[tuple[str, ...]] = []
    along, label = result.over
    few = len(along) <= _FEW
    head = (
        ("output", "unit", *(f"{x:.6g}" for x in along)) if few else ("output", "unit", "peak", f"at {label}")
    )
    over = f", over {label}" if few else ""
    for v in result.variables:
        columns = v.values.reshape(len(result.time), -1)
        for i, component in enumerate(v.components or ("",)):
            at = int(np.argmax(np.abs(columns[:, i])))
            name = f"{v.name}.{component}" if component else v.name
            peak = (f"{columns[at, i]:.6g}", f"{along[at]:.6g}")
            rows.append((name, v.unit, *([f"{x:.6g}" for x in columns[:, i]] if few else peak)))
    console.print(table(f"{result.title}: {result.headline}{over}", head, rows))
    if result.floquet:
        verdict = {
            True: "the steady state is stable",
            False: "the steady state is unstable",
            None: "not resolved",
        }
        console.print(f"largest Floquet multiplier {abs(result.floquet[0]):.6g}: {verdict[result.stable]}")
    for note in result.notes:
        console.print(f"note: {note}")
