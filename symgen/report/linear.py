"""Terminal output of linear state-space models and of derivatives by parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from symgen.report.tables import print_notes, table
from symgen.runtime.linearisation.record import Linearisation, Sensitivity
from symgen.runtime.model.compiled import degrees

#: Letters of the names of columns that fit a terminal; wider matrices have numbers instead.
_HEADINGS = 40
#: A smaller part of the largest pole is round-off.
_ROUNDING = 1e-7


def print_linearisation(linearisation: Linearisation, model: Any, console: Console) -> None:
    """Print the state, the matrices A, B, C, D and the poles."""
    rates = zip(linearisation.states, linearisation.x.tolist(), linearisation.rates.tolist(), strict=True)
    rows = [(name, linearisation.units[name], f"{x + 0.0:.9g}", rate) for name, x, rate in rates]
    rows += [
        (name, linearisation.units[name], f"{u + 0.0:.9g}", "")
        for name, u in zip(linearisation.inputs, linearisation.u, strict=True)
    ]
    title = f"{model.description.title}: linearised at {_state_of(linearisation, linearisation.t)}"
    console.print(table(title, ("state, input", "unit", "value", "rate"), rows, keys=2))
    for name, of, by in (
        ("A: d(dx)/dt by dx", linearisation.states, linearisation.states),
        ("B: d(dx)/dt by du", linearisation.states, linearisation.inputs),
        ("C: dy by dx", linearisation.outputs, linearisation.states),
        ("D: dy by du", linearisation.outputs, linearisation.inputs),
    ):
        if of and by:
            matrix = getattr(linearisation, name[0]).tolist()
            entries = [
                (i, row, *values) for i, (row, values) in enumerate(zip(of, matrix, strict=True), start=1)
            ]
            columns = by if sum(map(len, by)) <= _HEADINGS else tuple(str(j + 1) for j in range(len(by)))
            console.print(table(name, ("", "", *columns), entries, texts=(1,), keys=2))
    poles = [f"{s.real:.6g}{s.imag:+.6g}i" for s in _without_round_off(linearisation.poles).tolist()]
    console.print(f"poles [1/s]: {', '.join(poles)}")
    coordinates = sum(name.endswith("'") for name in linearisation.states)
    freedoms = linearisation.freedoms
    if freedoms < coordinates:
        if freedoms:
            text = "the poles include deviations that violate constraints. Poles of independent coordinates "
            text += "(--coordinates) are those of motions."
        else:
            text = (
                "drives and constraints prescribe the motion. The poles are those of deviations that violate "
            )
            text += "them, and do not show whether the motion is stable."
        console.print(f"{coordinates} coordinates, {degrees(freedoms)} of freedom: {text}")
    print_notes(linearisation.notes, console)


def _state_of(analysis: Linearisation | Sensitivity, t: float) -> str:
    if analysis.at_equilibrium:
        return "the equilibrium"
    return f"t = {t:g} s{' of the run' * bool(np.ndim(analysis.t))}"


def _without_round_off(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return poles with 0 for parts at rounding, whose root is the error of a double pole at 0."""
    least = _ROUNDING * np.abs(poles).max(initial=0.0)
    real, imag = (np.where(np.abs(part) > least, part, 0.0) for part in (poles.real, poles.imag))
    return np.asarray(real + 1j * imag)


def print_sensitivity(sensitivity: Sensitivity, model: Any, console: Console) -> None:
    """Print values of outputs and their derivatives by parameters, one table per time."""
    outputs, by, times = sensitivity.outputs, sensitivity.parameters, np.atleast_1d(sensitivity.t).tolist()
    values = sensitivity.values.reshape(-1, len(outputs))
    derivatives = sensitivity.derivatives.reshape(-1, len(outputs), len(by))
    columns = ("output", "unit", "value", *(f"by {name} [{sensitivity.units[name]}]" for name in by))
    for t, at_t, slopes in zip(times, values, derivatives.tolist(), strict=True):
        rows = [
            (name, sensitivity.units[name], f"{value + 0.0:.9g}", *row)
            for name, value, row in zip(outputs, at_t, slopes, strict=True)
        ]
        title = f"{model.description.title}: derivatives at {_state_of(sensitivity, t)}"
        console.print(table(title, columns, rows, keys=2))
    print_notes(sensitivity.notes, console)
