"""Starts of many variants of a linkage against closed forms: poses and velocities."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import at, ground
from shared.variants import crank_rocker_with_lengths, pins

import symgen
from symgen.errors import InitialStateError, ModelError, RangeError


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return symgen.build(crank_rocker_with_lengths(tmp_path_factory.mktemp("variants")), backend="c")


def test_variants_are_assembled_on_the_branch_of_the_drawing(model):
    lengths = np.random.default_rng(2).uniform([0.04, 0.3, 0.25], [0.14, 0.45, 0.35], (100, 3))
    for a, b, c in lengths:
        state = model.with_parameters(a=a, b=b, c=c).initial_state()
        start, there = pins(a, b, c, np.array(0.0))
        assert state.positions["A"] == pytest.approx(start, abs=1e-15)
        assert state.positions["B"] == pytest.approx(there, abs=1e-14)
        # at the angle 0 the crank moves A upwards; B moves about C so that b is constant
        rocker, coupler = there - [0.4, 0.0], there - start
        rate = 2 * np.pi * a * coupler[1] / (coupler @ [-rocker[1], rocker[0]])
        assert state.velocities["B"] == pytest.approx(rate * np.array([-rocker[1], rocker[0]]), abs=1e-12)


def test_a_variant_that_cannot_be_assembled_names_the_gap(model):
    with pytest.raises(InitialStateError, match="cannot be assembled") as caught:
        model.with_parameters(b=0.05, c=0.1).initial_state()
    assert caught.value.where.startswith("links.")
    with pytest.raises(RangeError, match="coupler.length: expected a value above zero, got -0.1 m"):
        model.with_parameters(b=-0.1)


def test_points_without_a_place_end_their_run_alone():
    """A ground point at the root of an area, and moved along the root of what is left of a time."""
    scene = symgen.Scene(
        parameters={"area": {"value": "4 m**2", "tunable": True}, "T": "1 s", "l": "0.1 m"},
        points={
            "O": ground(0, 0),
            "A": at(1, 0),
            "F": {"at": ["sqrt(area)", "1 m"], "ground": True, "motion": ["l*sqrt(1 - t/T) - l", "0 m"]},
        },
        links={"crank": {"points": ["O", "A"], "mass": "1 kg"}},
        springs=[{"between": ["A", "F"], "stiffness": "1 N/m", "length": "0.1 m"}],
    )
    model, areas = symgen.build(scene, backend="c"), np.array([1.0, -1.0, 4.0, 9.0])
    with pytest.raises(InitialStateError, match="finite position of F at the start, got") as caught:
        model.with_parameters(area=-1.0).initial_state()
    assert caught.value.where == "points.F"
    found = model.simulate_many({"area": areas}, samples=3, t_end=0.01)
    assert [bool(e) for e in found["error"].values] == [False, True, False, False]
    with pytest.raises(ModelError, match="has no length: the place of one of its points"):
        model.accelerations(model.state({"A": [1.0, 0.0]}, t=2.0))
