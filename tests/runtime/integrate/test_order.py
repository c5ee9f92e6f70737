"""Every integrator in the registry against a known solution: order of the steps and of what lies between them."""

from __future__ import annotations

import numpy as np
import pytest
from shared.pendulum import PENDULUM, exact

import symgen
from symgen.runtime import _core
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.integrate.integrators.taylor import of_order

T_END = 1.0
#: Numbers of steps by order: errors fall from where the order shows to somewhat above rounding.
STEPS = {2: (128, 256, 512), 4: (64, 128, 512), 5: (24, 64, 192), 6: (16, 32, 64), 8: (8, 20, 48)}


@pytest.fixture(scope="module")
def model():
    return symgen.build(PENDULUM)


def method_of(name):
    """A method; power series of the order of the others, whose errors are above rounding."""
    return of_order(9) if name == "taylor" else INTEGRATORS[name]


def fixed(model, name, steps, times):
    """A run with so many equal steps, also of methods that would adapt them."""
    method, start = method_of(name), model.initial_state()
    tangent = model.analysis("tangent") if method.needs_tangent else None
    equations = model.evaluator.equations(tangent=tangent)
    y0 = np.concatenate([start.q, start.u, np.zeros(equations.extra)])
    run = _core.Run(equations, method, 0.0, y0, T_END, 0.0, 0.0, T_END / steps, times)
    status = run.begin()
    while status == _core.MORE:
        status = run.advance(10_000)
    assert status == _core.DONE
    return run


@pytest.mark.parametrize("name", INTEGRATORS)
def test_order_of_convergence(name, model):
    order = method_of(name).order
    truth = exact(T_END)
    errors = [np.max(np.abs(fixed(model, name, n, np.array([0.0])).state[:4] - truth)) for n in STEPS[order]]
    observed = -np.polyfit(np.log(STEPS[order]), np.log(errors), 1)[0]
    assert abs(observed - order) < 0.2, (errors, observed)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_order_between_steps(name, model):
    """A sample in the middle of the first step: the error of the interpolant falls with its own order."""
    method = method_of(name)
    errors = []
    for n in (12, 24):
        middle = 0.4 * T_END / n
        run = fixed(model, name, n, np.array([0.0, middle]))
        errors.append(np.max(np.abs(run.result[1, :4] - exact(middle))))
    observed = np.log2(errors[0] / errors[1])
    assert observed > method.dense_order - 0.35, (errors, observed)
