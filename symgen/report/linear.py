"""Terminal output of linear state-space models and of derivatives by parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from symgen.report.tables import table
from symgen.runtime.linearisation.record import Linearisation, Sensitivity

#: Letters of the names of columns that fit a terminal; wider matrices have numbers instead.
_HEADINGS = 40
#: A smaller part of the largest pole is round-off.
_ROUNDING = 1e-7


def print_linearisation(found: Linearisation, model: Any, console: Console) -> None:
    """Print the state, the matrices A, B, C, D and the poles."""
    rates = zip(found.states, found.x.tolist(), found.rates.tolist(), strict=True)
    rows = [(name, found.units[name], f"{x + 0.0:.9g}", rate) for name, x, rate in rates]
    rows += [
        (name, found.units[name], f"{u + 0.0:.9g}", "") for name, u in zip(found.inputs, found.u, strict=True)
    ]
    title = f"{model.description.title}: linearised at {_state_of(found)}"
    console.print(table(title, ("state, input", "unit", "value", "rate"), rows, keys=2))
    for name, of, by in (
        ("A: d(dx)/dt by dx", found.states, found.states),
        ("B: d(dx)/dt by du", found.states, found.inputs),
        ("C: dy by dx", found.outputs, found.states),
        ("D: dy by du", found.outputs, found.inputs),
    ):
        if of and by:
            matrix = getattr(found, name[0]).tolist()
            entries = [
                (i, row, *values) for i, (row, values) in enumerate(zip(of, matrix, strict=True), start=1)
            ]
            columns = by if sum(map(len, by)) <= _HEADINGS else tuple(str(j + 1) for j in range(len(by)))
            console.print(table(name, ("", "", *columns), entries, texts=(1,), keys=2))
    poles = [f"{s.real:.6g}{s.imag:+.6g}i" for s in _without_round_off(found.poles).tolist()]
    console.print(f"poles [1/s]: {', '.join(poles)}")


def _state_of(found: Linearisation | Sensitivity) -> str:
    return "the equilibrium" if found.at_equilibrium else f"t = {found.t:g} s"


def _without_round_off(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return poles with 0 for parts at rounding, whose root is the error of a double pole at 0."""
    least = _ROUNDING * np.abs(poles).max(initial=0.0)
    real, imag = (np.where(np.abs(part) > least, part, 0.0) for part in (poles.real, poles.imag))
    return np.asarray(real + 1j * imag)


def print_sensitivity(found: Sensitivity, model: Any, console: Console) -> None:
    """Print values of outputs and their derivatives by parameters."""
    rows = [
        (name, found.units[name], f"{value + 0.0:.9g}", *slopes)
        for name, value, slopes in zip(found.outputs, found.values, found.derivatives.tolist(), strict=True)
    ]
    by = [f"by {name} [{found.units[name]}]" for name in found.parameters]
    title = f"{model.description.title}: derivatives at {_state_of(found)}"
    console.print(table(title, ("output", "unit", "value", *by), rows, keys=2))
