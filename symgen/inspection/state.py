"""Values of all arguments of a model at its start, at a time, or at a value of its input."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from symgen.errors import ModelError, SceneError, check_known
from symgen.inspection.values import crank_or_time, of_input
from symgen.methods import method_of
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.elastic.space.model import SpatialModel
from symgen.runtime.loop.driven import moving
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.rods.model.rods import RodModel
from symgen.scene.units import NUMBER, TIME, parse_quantity
from symgen.symbolic.system import System

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ArgumentValues:
    """Argument values [SI] by group and index, and a label of the state."""

    label: str
    arrays: Mapping[str, Sequence[float]]

    def of(self, system: System, inputs: Mapping[str, sp.Expr]) -> dict[str, float | sp.Expr]:
        """Return the value of each argument of a system by name; ``inputs`` values take precedence.

        Raises
        ------
        ModelError
            If the system has no argument of a given name.
        """
        known = {x.name for x in system.symbols()}
        for name in inputs:
            check_known(name, known, f"{system.name} has no argument")
        values: dict[str, float | sp.Expr] = {
            x.name: float(value)
            for group in system.groups
            for x, value in zip(group.quantities, self.arrays.get(group.name, ()), strict=False)
        }
        return values | dict(inputs)


#: Values for a building block, which has no state.
NOWHERE = ArgumentValues("", {})


def state_of(model: Any, at: str | None) -> ArgumentValues:
    """Return the arguments of a model at a state.

    Parameters
    ----------
    model
        A model returned by :func:`symgen.build`.
    at
        Time [s], with or without unit; for a driven loop a value of its input, in degrees or in the scene's
        unit of length. None for the start.

    Raises
    ------
    ModelError, SimulationError
        If the text cannot be read or the state cannot be reached.
    """
    return method_of(model).load("state")(model, at)


def of_elastic(model: ElasticModel, at: str | None) -> ArgumentValues:
    """Return the arguments of the rigid motion of elastic links, at an angle of the crank or a time."""
    if at is None:
        return of_linkage(model.rigid, None)
    value, over, label = crank_or_time(at)
    t = value if over == "time" else model.motion(True).time_at(value)
    return replace(_reached(model.rigid, t), label=label)


def of_spatial(model: SpatialModel, at: str | None) -> ArgumentValues:
    """Return the arguments of the rigid motion of elastic links in space, at a time."""
    return of_linkage(model.rigid, at)


def of_linkage(model: RodModel, at: str | None) -> ArgumentValues:
    """Return the arguments of a linkage at a time, reached by a run."""
    return _reached(model, _seconds(at))


def _reached(model: RodModel, t: float) -> ArgumentValues:
    state = model.reached(t)
    accelerations = model.accelerations(state)
    work = [x for p in model.description.free for x in accelerations.points[p].tolist()]
    evaluator = model.counting(state).evaluator
    unknowns = evaluator("accelerations", state.t, state.q, state.u)
    couples = unknowns[len(unknowns) - len(evaluator.couples) :]
    arrays = {
        "t": [state.t],
        "q": state.q.tolist(),
        "u": state.u.tolist(),
        "p": evaluator.parameter_values.tolist(),
        "work": [*work, *accelerations.multipliers.values(), *couples.tolist()],
    }
    return ArgumentValues(f"at t = {t:g} s" if t > 0 else "at the start", arrays)


def _seconds(at: str | None) -> float:
    """Return a time given with or without unit; 0 if absent."""
    if at is None:
        return 0.0
    try:
        number, dimension = parse_quantity(at)
        t = float(number) if dimension in (TIME, NUMBER) else math.nan
    except SceneError:
        t = math.nan
    if not 0.0 <= t < math.inf:
        raise ModelError(f'expected a time of the motion after --at, such as "0.3 s", got {at!r}')
    return t


def of_loop(model: LoopModel, at: str | None) -> ArgumentValues:
    """Return the arguments of a loop at its start, or of a driven one at a value of its input."""
    d = model.description
    begin = model.closed_start()
    parameters = model.parameter_values
    if not model.is_driven:
        if at is not None:
            raise ModelError(f"{d.name} moves freely: its matrices are shown at its start, without --at")
        u = _rates(model, begin.t, begin.q)
        arrays = {"t": [begin.t], "q": begin.q.tolist(), "u": u.tolist(), "p": parameters}
        return ArgumentValues("at the start", arrays)
    value = float(model.kernels.lead_at(begin.t)[0])
    if at is not None:
        (value, *others), over = of_input(model, [at], "--at")
        if others or over == "time":
            raise ModelError(f"expected one value of the input after --at, got {at!r}")
    t, states = moving(model.kernels, begin, value)
    n = d.coordinates
    arrays = {
        "t": [t],
        "q": states[:n].tolist(),
        "u": states[n : 2 * n].tolist(),
        "p": parameters,
        "work": states[2 * n : 3 * n + 6].tolist(),
    }
    return ArgumentValues(f"at {model.kernels.value_at(t)}", arrays)


def _rates(model: LoopModel, t: float, q: Array) -> Array:
    """Return rates of all variables at the start of a free motion, consistent with loop closure."""
    d = model.description
    u = np.array([v.start_rate for v in d.variables])
    u[model.kernels.inputs] = model.kernels.prescribed(t)[:, 1]
    prescribed, solved = d.having("input", "free"), d.having("dependent")
    screws = model.kernels("motion", t, q, u)["screws"]
    u[solved] = np.linalg.lstsq(screws[:, solved], -screws[:, prescribed] @ u[prescribed], rcond=None)[0]
    return u
