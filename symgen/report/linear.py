"""Terminal output of linear state-space models and of derivatives by parameters."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from symgen.report.tables import table
from symgen.runtime.linearisation.record import Linearisation, Sensitivity


def print_linearisation(found: Linearisation, model: Any, console: Console) -> None:
    """Print the state, the matrices A, B, C, D and the poles."""
    rates = zip(found.states, found.x.tolist(), found.rates.tolist(), strict=True)
    rows = [(name, found.units[name], f"{x:.9g}", f"{rate:.6g}") for name, x, rate in rates]
    rows += [(name, found.units[name], f"{u:.9g}", "") for name, u in zip(found.inputs, found.u, strict=True)]
    title = f"{model.description.title}: linearised at t = {found.t:g} s"
    console.print(table(title, ("state, input", "unit", "value", "rate"), rows))
    for name, of, by in (
        ("A: d(dx)/dt by dx", found.states, found.states),
        ("B: d(dx)/dt by du", found.states, found.inputs),
        ("C: dy by dx", found.outputs, found.states),
        ("D: dy by du", found.outputs, found.inputs),
    ):
        if of and by:
            matrix = getattr(found, name[0]).tolist()
            entries = [(row, *(f"{v:.6g}" for v in values)) for row, values in zip(of, matrix, strict=True)]
            console.print(table(name, ("", *by), entries))
    poles = [f"{s.real:.6g}{s.imag:+.6g}i" for s in found.poles.tolist()]
    console.print(f"poles [1/s]: {', '.join(poles)}", soft_wrap=True)


def print_sensitivity(found: Sensitivity, model: Any, console: Console) -> None:
    """Print values of outputs and their derivatives by parameters."""
    rows = [
        (name, found.units[name], f"{value:.9g}", *(f"{x:.6g}" for x in slopes))
        for name, value, slopes in zip(found.outputs, found.values, found.derivatives.tolist(), strict=True)
    ]
    by = [f"by {name} [{found.units[name]}]" for name in found.parameters]
    title = f"{model.description.title}: derivatives at t = {found.t:g} s"
    console.print(table(title, ("output", "unit", "value", *by), rows))
