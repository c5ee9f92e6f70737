"""Implicit methods: stiff springs and dampers in few steps, redundant constraints, lost rank, steps too long."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import GRAVITY, at, ground, rod

import symgen
from symgen.errors import SimulationError
from symgen.runtime.integrate.integrators import INTEGRATORS

IMPLICIT = [name for name, m in INTEGRATORS.items() if m.needs_tangent]
FIXED = [name for name in IMPLICIT if not INTEGRATORS[name].adaptive]


def stiff():
    """A pendulum whose bob hangs on a spring of 1e9 N/m with a strong damper: 5 kHz against 0.5 Hz."""
    return symgen.Scene(
        points={"O": ground(0, 0), "A": at(1.0, 0.0), "B": at(1.5, 0.0)},
        links={"arm": rod("O", "A")},
        masses=[{"point": "B", "mass": "1 kg"}],
        gravity=GRAVITY,
        springs=[{"between": ["A", "B"], "stiffness": "1e9 N/m", "length": "0.5 m", "damping": "3e4 N*s/m"}],
    )


@pytest.fixture(scope="module")
def bob():
    return symgen.build(stiff())


def places(model, run):
    return np.concatenate([run.final[p]["position"] for p in model.description.free])


def test_few_steps_where_explicit_methods_need_many(bob):
    explicit = bob.simulate(0.5, method="dop853", rtol=1e-6)
    implicit = bob.simulate(0.5, method="radau5", rtol=1e-6)
    assert places(bob, implicit) == pytest.approx(places(bob, explicit), abs=1e-7)
    assert implicit.statistics["steps"] < 0.2 * explicit.statistics["steps"]
    assert implicit.statistics["evaluations"] < 0.2 * explicit.statistics["evaluations"]
    assert implicit.drift.constraint < 1e-15


@pytest.mark.parametrize("name", FIXED)
def test_fixed_steps_beyond_explicit_stability(name, bob):
    truth = places(bob, bob.simulate(0.5, method="radau5", rtol=1e-7))
    errors = [
        np.max(np.abs(places(bob, bob.simulate(0.5, method=name, step=h)) - truth)) for h in (5e-3, 1e-3)
    ]
    assert errors[1] < 5e-5
    assert np.log(errors[0] / errors[1]) / np.log(5) == pytest.approx(2, abs=0.2)
    with pytest.raises(SimulationError):
        bob.simulate(0.5, method="rk4", step=1e-3)


@pytest.mark.parametrize("name", FIXED)
def test_a_step_too_long_is_told(name):
    with pytest.raises(SimulationError, match=f"implicit equations of a step of {name} could not be solved"):
        symgen.build("triple_pendulum").simulate(20.0, method=name, step=2.0)


@pytest.mark.parametrize("name", IMPLICIT)
def test_agrees_with_an_explicit_method(name):
    """Over every word that forces know: dampers, couples, moving ground."""
    from shared.rich_scenes import loaded

    model = symgen.build(loaded())
    options = {"rtol": 1e-9} if INTEGRATORS[name].adaptive else {"step": 2e-4}
    truth = model.simulate(0.5, rtol=1e-12)
    run = model.simulate(0.5, method=name, **options)
    near = 1e-8 if INTEGRATORS[name].adaptive else 1e-5
    assert places(model, run) == pytest.approx(places(model, truth), abs=near)
    assert run.drift.energy < 1e4 * near


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10])
def test_radau_follows_its_tolerance(rtol):
    model = symgen.build("peaucellier")
    truth = places(model, model.simulate(0.5, rtol=1e-13))
    error = np.max(np.abs(places(model, model.simulate(0.5, method="radau5", rtol=rtol)) - truth))
    assert error < 10 * rtol


@pytest.mark.parametrize("name", IMPLICIT)
@pytest.mark.parametrize("scene", ["double_four_bar", "parallelogram"])
def test_redundant_constraints_and_lost_rank(name, scene):
    model = symgen.build(scene)
    options = {"rtol": 1e-5} if INTEGRATORS[name].adaptive else {"step": 5e-4}
    truth = model.simulate(2.0, rtol=1e-11)
    run = model.simulate(2.0, method=name, **options)
    assert places(model, run) == pytest.approx(places(model, truth), abs=1e-4)
    assert run.drift.constraint < 1e-13
