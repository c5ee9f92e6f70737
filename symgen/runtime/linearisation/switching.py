"""Switching points at a state, where derivatives of loads are not those of both sides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.slopes import slopes_at
from symgen.runtime.linearisation.tangents import LinkageTangents, Tangents

#: Distance to both sides over the size of the coordinates, and of the rates.
_BESIDE = 1e-9
#: A smaller jump of slopes over their size is round-off.
_BENT = 1e-6


def notes_on_switches(evaluator: Evaluator, t: float, q: Array, u: Array, free: Array) -> tuple[str, ...]:
    """Return a note for each switching point of a load on which a state is.

    A small motion along a column of ``free`` (n, freedoms), of the coordinates or of the rates, passes it.
    """
    d = evaluator.description
    if not d.switches or not free.size:
        return ()
    parameters = evaluator.parameter_values.copy()
    parameters[d.of_held.stop - d.tables : d.of_held.stop] = _core.WHICH_PIECE
    of = Evaluator(d, evaluator.library, parameters)
    moves = (free / np.max(np.abs(free), axis=0)).T
    steps = _BESIDE * np.vstack([moves, -moves])
    size = float(np.max(np.abs(q), initial=0.0)) or 1.0
    fast = max(float(np.max(np.abs(u), initial=0.0)), size)  # [1/s] of the size: at rest there is no other
    places = np.vstack([q + size * steps, np.tile(q, (len(steps), 1))])
    rates = np.vstack([np.tile(u, (len(steps), 1)), u + fast * steps])
    sides = of.many_blocks("events", np.full(len(places), t), places, rates)["switches"]
    sides = sides.reshape(len(places), -1)
    signs = len(d.switches) - d.tables
    sides[:, :signs] = np.where(sides[:, :signs] < 0.0, -1.0, 1.0)
    passed = np.any(sides != sides[0], axis=0)
    return tuple(
        f"the state is on the switching point of {text}: derivatives of the load are the mean of both sides, "
        "of a table those of one side, and a jump has none"
        for k, text in enumerate(d.switches)
        if passed[k] and k not in d.pulses
    )


def notes_of(tangents: Tangents, inputs: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the notes on switching points on which a state or an input of a linkage is; none of loops."""
    if not isinstance(tangents, LinkageTangents):
        return ()
    state = tangents.state
    return (
        *notes_on_switches(tangents.model, state.t, state.q, state.u, tangents.free),
        *(
            f"the input {name} is at a value where the slope of a load jumps: derivatives by it are the mean "
            "of both sides, of a table those of one side"
            for name in inputs
            if _bends(tangents, name)
        ),
    )


def _bends(tangents: LinkageTangents, name: str) -> bool:
    """Return whether slopes by an input jump at its value: near it as much as in ten times the interval."""
    kernels, state = tangents.kernels, tangents.state
    place = [p.name for p in tangents.description.tunable].index(name)
    column, slopes = tangents.by_solution.stop + tangents.parameters.index(name), []
    step = _BESIDE * (abs(kernels.parameter_values[place]) or 1.0)
    for times in (-10, -1, 1, 10):
        parameters = kernels.parameter_values.copy()
        parameters[place] += times * step
        of = Evaluator(kernels.description, kernels.library, parameters)
        at = slopes_at(of, tangents.parameters, state, tangents.solution, tangents.model.couples)
        slopes.append(at.residual[:, column])
    near, far = (np.abs(slopes[i] - slopes[3 - i]).max(initial=0.0) for i in (1, 0))
    return bool(near > 0.5 * far and near > _BENT * np.abs(slopes).max())
