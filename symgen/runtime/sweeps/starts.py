"""Sweeps of runs that start in equilibria: where neighbouring runs do not start in the same."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.redundancy import extent
from symgen.runtime.many.runs import FAILURES
from symgen.runtime.result.records import converters
from symgen.runtime.sweeps.designs import Design, Grid

#: Most runs whose starts are compared, and most pairs that are named.
_MOST, _NAMED = 2000, 3
#: Distance of two starts over the size of the linkage, beyond which each is looked for from the other;
#: that of different equilibria.
_APART, _OTHER = 1e-2, 1e-4


def notes_on_starts(model: Any, analysis: str, design: Design, arguments: Any) -> Iterator[str]:
    """Yield which neighbours in a grid start in different equilibria, and how far apart.

    Of two neighbours that start far apart, each is led to an equilibrium from the start of the other: both
    then come to their own starts, unless these are different equilibria.
    """
    starts = getattr(model.description, "at_equilibrium", False) and analysis == "simulate"
    if not starts or arguments.get("state") is not None:
        return
    if not isinstance(design, Grid) or design.count > _MOST:
        return
    rows, found = design.values(0, design.count), list[tuple[int, int, float]]()
    models = [model.with_parameters(**dict(zip(design.names, row, strict=True))) for row in rows.tolist()]
    states = [_start(each) for each in models]
    numbers = np.arange(design.count).reshape(design.shape)
    for axis in range(len(design.shape)):
        for i, j in np.stack([np.delete(numbers, place, axis).ravel() for place in (-1, 0)], axis=1).tolist():
            a, b = states[i], states[j]
            if a is None or b is None:
                continue
            size, way = extent(models[i].evaluator, a.q), float(np.max(np.abs(a.q - b.q)))
            led = ((models[j], a, b), (models[i], b, a)) if way > _APART * size else ()
            if any(_misses(*each, _OTHER * size) for each in led):
                found.append((i, j, way))

    def named(i: int) -> str:
        units = {p.name: p.unit for p in model.description.tunable}
        values = (f"{name} = {x:.6g} {units[name]}" for name, x in zip(design.names, rows[i], strict=True))
        return ", ".join(values)

    unit, scale = converters(model.description.units).get("m", ("m", 1.0))
    for i, j, way in found[:_NAMED]:
        apart = f"{way / scale:.3g} {unit} apart"
        yield f"runs at {named(i)} and at {named(j)} start in different equilibria, {apart}"
    if len(found) > _NAMED:
        yield f"{len(found) - _NAMED} more pairs of neighbouring runs start in different equilibria"


def _start(model: Any) -> Any:
    try:
        return model.initial_state()
    except FAILURES:
        return None


def _misses(model: Any, begin: Any, end: Any, least: float) -> bool:
    """Return whether the equilibrium from one state is another than the one at the end."""
    try:
        reached: Array = model.equilibrium(state=begin).state.q
    except FAILURES:
        return True
    except ModelError:  # the acceleration of a ground point there has none
        return False
    return bool(np.max(np.abs(reached - end.q)) > least)
