"""The equations of motion of a linkage as dy/dt = f(t, y), for solvers from elsewhere."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from symgen.runtime._rhs import Rhs
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.result.state import State
from symgen.runtime.rods.redundancy import slack

_VECTOR = ctypes.POINTER(ctypes.c_double)
_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_double, _VECTOR, _VECTOR, ctypes.c_void_p)


def right_hand_side(begin: State, evaluator: Evaluator, redundant: int, work_of_loads: bool = False) -> Rhs:
    """Return ``f`` with dy/dt = f(t, y, u) of y = (q, u): coordinates [m] and velocities [m/s] in order.

    It takes any array of 2n numbers and returns a new one, in one compiled call:
    ``solve_ivp(model.rhs, (0, 1), model.rhs.start)``. ``f(t, y, u)`` takes values u of the scene's inputs,
    in SI units and in the order of ``inputs``; without u they are those of ``model.parameters``.

    ``start`` is the state in which the scene starts, ``project(t, y)`` returns a state brought onto the
    constraints by the least change, and ``energy(t, y)`` is kinetic plus potential energy [J]. The
    accelerations keep the constraints' second rates only, so what a solver errs makes a state drift off the
    constraints: project it now and then.

    ``low_level`` is the same as a ``scipy.LowLevelCallable``, for solvers that call from C: see
    :func:`low_level`. Its inputs are those of the last call from Python. Where no finite accelerations exist,
    both give numbers that are not finite.

    Each ``model.rhs`` has scratch memory of its own. Threads of Python may share one, since a call holds
    Python's lock; threads that call the compiled function without that lock must have one each.

    With ``work_of_loads`` a last unknown is the work of the loads without potential [J], where there are any.

    Raises
    ------
    InitialStateError
        When the start cannot be assembled.
    """
    equations = evaluator.equations(redundant, slack(evaluator, begin.q), work_of_loads=work_of_loads)
    d = evaluator.description
    start = np.concatenate([begin.q, begin.u, np.zeros(equations.extra)])
    return Rhs(equations, start, d.inputs, len(d.tunable) - len(d.inputs))


def low_level(function: int, equations: int, owner: Rhs) -> Any:
    """Return a compiled right-hand side as a ``scipy.LowLevelCallable``.

    Its signature is ``void (double, double *, double *, void *)``: the time [s], y, where dy/dt goes, and
    ``user_data``, which holds parameters and scratch memory. It takes no lock and allocates nothing.
    """
    from scipy import LowLevelCallable

    compiled = _SIGNATURE(function)
    compiled.owner = owner  # type: ignore[attr-defined]  # what user_data points into lives as long
    return LowLevelCallable(compiled, ctypes.c_void_p(equations))
