"""Scenes and linkages whose runs cannot start in equilibrium: each error names the place and a remedy."""

from __future__ import annotations

import pytest
from shared.linkages import chain

import symgen
from symgen.errors import InitialStateError, SceneError


@pytest.mark.parametrize(
    ("more", "where", "words"),
    [
        ({"start": {"rates": {"L0": "1 rad/s"}, "equilibrium": True}}, "[start.rates] L0", "at rest"),
        (
            {"start": {"velocities": {"P1": ["0 m/s", "1 m/s"]}, "equilibrium": True}},
            "[start.velocities] P1",
            "at rest",
        ),
        ({"analysis": {"kind": "kinematics"}}, "[start] equilibrium", "no loads"),
    ],
)
def test_scenes_that_contradict_an_equilibrium(more, where, words):
    scene = chain([(0, 0), (1, 0)], **{"start": {"equilibrium": True}, **more})
    with pytest.raises(SceneError, match=words) as caught:
        symgen.build(scene)
    assert where in str(caught.value) and "\n  " in str(caught.value)


@pytest.mark.parametrize(
    ("name", "words"),
    [("elastic_four_bar", "quasi-static"), ("slider_crank", "a scene with a loop has no start")],
)
def test_mechanisms_that_do_not_start_in_one(name, words):
    with pytest.raises(SceneError, match=words):
        symgen.build(name, set={"start.equilibrium": True})


def test_a_chain_by_recursion_starts_as_drawn():
    with pytest.raises(SceneError, match=r"\[start\] equilibrium: a chain"):
        symgen.build_chain(chain([(0, 0), (1, 0)], start={"equilibrium": True}))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"fixed": ()}, "nothing holds the linkage"),
        ({"drivers": [{"link": "L0", "angle": "w*t"}]}, "the drive of L0|moves"),
        ({"drivers": [{"link": "L0", "angle": "0.1"}, {"link": "L1", "angle": "0.2"}]}, "hold every freedom"),
        ({"torques": [{"link": "L0", "torque": "big"}]}, "no equilibrium was found"),
    ],
)
def test_linkages_without_an_equilibrium_say_why(more, words):
    scene = chain(
        [(0, 0), (1, 0), (1.5, -0.5)],
        parameters={"w": "1 rad/s", "big": {"value": "100 N*m", "tunable": True}},
        start={"equilibrium": True},
        **more,
    )
    model = symgen.build(scene)
    with pytest.raises(InitialStateError, match=words) as caught:
        model.simulate(0.1)
    assert "start.equilibrium" in str(caught.value) and caught.value.where == "start.equilibrium"
    if "torques" in more:
        many = model.simulate_many({"big": [1.0, 100.0]}, t_end=0.1, samples=3)
        assert many["error"].values[0] == "" and "no equilibrium was found" in many["error"].values[1]
