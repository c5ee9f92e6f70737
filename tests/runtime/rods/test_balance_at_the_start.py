"""What the static balance at the start is needed for, and what is no part of it."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import G, at, chain, ground

import symgen
from symgen.errors import InitialStateError, ModelError


def test_a_given_state_needs_no_equilibrium():
    """A constant torque beyond the weight: the rod turns for ever."""
    tables = {"torques": [{"link": "L0", "torque": "T"}], "parameters": {"T": "50 N*m"}}
    spun, plain = (
        symgen.build(chain([(0, 0), (0, -1)], start={"equilibrium": True} if rests else {}, **tables))
        for rests in (True, False)
    )
    with pytest.raises(InitialStateError, match="no equilibrium was found"):
        spun.simulate(0.5)
    given = [model.state({"P1": [0.6, -0.8]}, {"P1": [0.8, 0.6]}) for model in (spun, plain)]
    first, second = (m.simulate(0.5, state=y, samples=5) for m, y in zip((spun, plain), given, strict=True))
    assert np.array_equal(first["P1.position"], second["P1.position"])
    first, second = (m.accelerations(y).points["P1"] for m, y in zip((spun, plain), given, strict=True))
    assert np.array_equal(first, second)
    turned = 3 * (50.0 - G * 0.3)
    assert first == pytest.approx(turned * np.array([0.8, 0.6]) - [0.6, -0.8], rel=1e-12)
    steps = [m.stepper(state=y) for m, y in zip((spun, plain), given, strict=True)]
    for stepper in steps:
        stepper.step(0.1)
    assert np.array_equal(steps[0].state.q, steps[1].state.q)


def test_the_acceleration_of_the_ground_is_no_part_of_the_balance():
    """A uniform rod hangs from a point that starts to accelerate: upright, at its value at t = 0."""
    pushed = {"parameters": {"b": "10 cm", "w": "4 rad/s"}, "start": {"equilibrium": True}}
    pushed["points"] = {"P0": ground(0, 0, motion=["b*(1 - cos(w*t))", "0 m"]), "P1": at(0.3, -0.4)}
    model = symgen.build(
        symgen.Scene(**{**chain([(0, 0), (0.3, -0.4)]).model_dump(exclude_unset=True), **pushed})
    )
    assert model.initial_state().positions["P1"] == pytest.approx([0.0, -0.5], abs=1e-12)
    with pytest.raises(ModelError, match="the ground point P0 accelerates at t = 0 s"):
        model.equilibrium()
