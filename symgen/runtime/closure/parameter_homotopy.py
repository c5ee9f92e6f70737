"""A loop moved from its start to other values of its variables."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from symgen.errors import ModelError, SimulationError, nearest
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.closure.start import Closed
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.loop.motion import rates_at

#: Longest step of a variable: angles [rad], lengths over the size of the loop.
_STEP = 0.05
#: Change of a variable in a step that is a jump, in the same units.
_JUMP = 0.5
#: Most steps.
_MOST = 10_000


def state_at(
    kernels: LoopKernels,
    begin: Closed,
    values: Mapping[str, float] | None,
    rates: Mapping[str, float] | None,
    states: Mapping[str, float] | None,
    t: float,
) -> tuple[float, Array, Array]:
    """Return time, variables and rates of a closed state: see :meth:`LoopModel.state`."""
    d = kernels.description
    names = [v.name for v in d.variables]
    values, rates, states = values or {}, rates or {}, states or {}
    for requested, roles in ((values, ("free", "dependent")), (rates, ("free",)), (states, ())):
        allowed = [names[i] for i in d.having(*roles)] if roles else [*d.states]
        noun = f"{' or '.join(roles)} variable" if roles else "state"
        for name, value in requested.items():
            if name not in allowed:
                known = nearest(name, allowed) if allowed else "The scene has none."
                raise ModelError(f"there is no {noun} {name!r}. {known}")
            if not np.isfinite(value):
                raise ModelError(f"expected a finite number for {name}, got {value!r}")
    if not np.isfinite(t):
        raise ModelError(f"expected a finite time of the state, got {t!r}")
    target, prescribed = begin.q.copy(), np.zeros(d.coordinates)
    for i, name in zip(d.having("state"), d.states, strict=True):
        prescribed[i] = states.get(name, d.variables[i].start_rate)
    for into, requested in ((target, values), (prescribed, rates)):
        for name, value in requested.items():
            into[names.index(name)] = value
    at_once = any(names.index(name) in d.having("dependent") for name in values)
    closed = moved_to(kernels, begin, target, t, at_once)
    return t, closed.q, rates_at(kernels, closed, prescribed)


def moved_to(kernels: LoopKernels, begin: Closed, target: Array, t: float, at_once: bool = False) -> Closed:
    """Return the loop closed at values of its free variables and a time.

    Parameters
    ----------
    target
        All variables; those of inputs do not matter, and dependent ones are guesses ``at_once``.
    at_once
        Close the loop there, instead of following it from its start.

    Raises
    ------
    SimulationError
        When it does not close, or leaves its assembly on the way.
    """
    d = kernels.description
    scale = kernels.scale
    equations = kernels.equations(d.having("dependent"), begin.rank)
    free = d.having("free")
    steps = 1
    if not at_once:
        inputs = kernels.prescribed(t)[:, 0] - kernels.prescribed(begin.t)[:, 0]
        ways = np.abs(
            np.concatenate([(target - begin.q)[free] / scale[free], inputs / scale[kernels.inputs]])
        )
        steps = max(1, math.ceil(min(_MOST, float(np.max(ways)) / _STEP)))
    q = np.append(target if at_once else begin.q, 0.0)
    for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
        now, before = begin.t + part * (t - begin.t), q.copy()
        q[free] = (1.0 - part) * begin.q[free] + part * target[free]
        failed = equations.close(now, q) != _core.DONE
        if failed or (not at_once and np.max(np.abs(q - before)[:-1] / scale) > _JUMP):
            values = ", ".join(f"{d.variables[i].name} = {q[i]:.6g} {d.variables[i].unit}" for i in free)
            values = values or f"t = {now:g} s"
            reason = "does not close" if failed else "leaves its assembly"
            raise SimulationError(
                f"{d.name} {reason} at {values}"
                + ("" if at_once else ", on the way from its start")
                + "\n  Give other values, or those of its dependent variables as guesses as well.",
                time=now,
            )
    return Closed(t, q[:-1].copy(), begin.rank)
