"""The notebook widget: what its page shows after a slider has moved, and its messages."""

from __future__ import annotations

import json
import re

import pytest

import symgen
from symgen.errors import ModelError
from symgen.runtime.sweeps.designs import Uniform

SCENE = """
symgen = 1
title = "Arm"

[parameters]
length = { value = "0.5 m", tunable = true }
speed = "60 rpm"

[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["length", "0 m"] }

[links]
arm = { points = ["O", "A"], length = "length", mass = "1 kg" }

[[drivers]]
link = "arm"
angle = "speed*t"

[analysis]
t_end = "1 s"
outputs = ["A.position"]
"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    file = tmp_path_factory.mktemp("widget") / "arm.toml"
    file.write_text(SCENE)
    return symgen.build(file)


def drawn(widget):
    """Return the data of the animation on the page of a widget."""
    return json.loads(re.search(r'type="application/json">(.*?)</script>', widget.page, re.S)[1])


def test_the_page_is_that_of_the_values(arm):
    """The tip of an arm makes a circle with its length as radius."""
    widget = arm.widget({"length": (0.1, 2.0)}, "kinematics")
    assert widget.sliders == [{"name": "length", "unit": "m", "low": 0.1, "high": 2.0}]
    assert drawn(widget)["high"][0] == pytest.approx(0.5, rel=1e-9)
    widget.values = {"length": 1.5}
    assert drawn(widget)["high"][0] == pytest.approx(1.5, rel=1e-9)
    assert widget.failure == ""


def test_a_run_that_fails_keeps_the_page(arm):
    widget = arm.widget({"length": Uniform(0.1, 2.0)}, "kinematics", frames=20)
    page = widget.page
    widget.values = {"length": -1.0}
    assert widget.page == page
    assert "length" in widget.failure
    widget.values = {"length": 0.2}
    assert widget.failure == "" and drawn(widget)["high"][0] == pytest.approx(0.2, rel=1e-9)


@pytest.mark.parametrize("interval", [(1.0, 0.5), (0.0, float("inf")), ("1", 2.0)])
def test_ranges_rise(arm, interval):
    with pytest.raises(ModelError, match="expected the range of length as a lower and a higher finite value"):
        arm.widget({"length": interval})


def test_names_are_those_of_tunable_parameters(arm):
    with pytest.raises(ModelError, match="has no tunable parameter 'lenght'. Did you mean 'length'"):
        arm.widget({"lenght": (0.1, 1.0)})
    with pytest.raises(ModelError, match="expected parameters to vary, got none"):
        arm.widget({})


def test_analyses_without_a_motion_are_refused(arm):
    with pytest.raises(ModelError, match="expected an analysis with a motion"):
        arm.widget({"length": (0.1, 1.0)}, "linearise")
