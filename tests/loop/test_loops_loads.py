"""The slider-crank under loads of every kind, driven in other ways, under Newton's and Euler's laws; and by command."""

from __future__ import annotations

import copy
import json
import math

import numpy as np
import pytest
from shared.golden import reference
from shared.inches import INCH, POUND
from shared.loop_account import account, largest
from typer.testing import CliRunner

import symgen
from symgen.cli import app


def data(**more):
    """The shipped scene with offsets, gravity, and parameters to write loads with."""
    made = copy.deepcopy(symgen.load_scene("slider_crank").model_dump(exclude_unset=True))
    made["parameters"] |= {
        "b": "-2 lbf*s/in",
        "f": "3 lbf",
        "k": "2 lbf*in",
        "w": "1 rad/s",
        "x": "-10 in",
        "h": "1 in",
        "quicker": "3 rad/s^2",
        "v": "10 in/s",
        "middle": "50 in",
    }
    for name, value in {"a4": "20 in", "alpha4": "240 deg", "S1": "3 in"}.items():
        made["parameters"][name] = {"value": value, "tunable": True}
    made["gravity"] = {"acceleration": ["g/3", "-g", "g/2"]}
    made["loop"].update(more)
    return made


LOADS = [
    {"link": "rod", "force": ["f*sin(theta1)", "2*f", 0], "at": ["x", 0, 0], "frame": "ground"},
    {
        "link": "crank",
        "force": ["f", "2*f", "-f*cos(w*t)"],
        "at": ["x", "h", "2*h"],
        "torque": ["k", "k*sin(w*t)", "2*k"],
    },
    {
        "link": "slider",
        "force": ["f", "2*f", "-f"],
        "at": ["x", "h", "2*h"],
        "torque": ["k", "k*sin(theta2)", "2*k"],
        "frame": "ground",
    },
]


@pytest.mark.parametrize(
    "drives",
    [{"theta1": "?", "S4": "b*S4.rate + f*cos(theta1)"}, {"theta1": "k*sin(theta2)", "S4": "?"}],
    ids=["load given", "torque given"],
)
def test_loads_in_both_frames_and_drives_by_the_state(drives):
    j = account(symgen.Scene(**data(loads=LOADS, drives=drives)), {"ratio": 2.0}, samples=121)
    j.everything_holds()
    q = {name: j.motion.moving[name].value for name in ("theta1", "theta2")}
    rate = j.motion.moving["S4"].rate
    inch, pound = 0.0254, 4.4482216152605
    if drives["S4"] == "?":
        expected, found = 2 * pound * inch * np.sin(q["theta2"]), j.si("theta1.drive")
    else:
        expected, found = pound * (-2 * rate / inch + 3 * np.cos(q["theta1"])), j.si("S4.drive")
    # what is given is met as well as the forces allow, which are large near dead centres
    assert largest(found - expected) <= 1e-12 * largest(*(x for w in j.on_links() for x in w))
    assert largest(expected) > 0.1


def test_crank_that_speeds_up():
    scene = data(inputs={"theta1": "quicker*t**2/2 + w*t", "s1": "S1*(still + sin(ratio*theta1))"})
    j = account(symgen.Scene(**scene), {"ratio": 1.0}, samples=121)
    j.everything_holds()
    theta1 = j.motion.moving["theta1"]
    # rate^2 = 1 + 2 * 3 * angle
    assert largest(theta1.rate**2 - 1 - 6 * theta1.value) <= 1e-12 * 40
    assert largest(theta1.second - 3) == 0.0


def test_slider_that_drives_the_crank():
    """S4 prescribed, the crank's angle follows; between its dead centres, which for a4 = 0 are 38 and 62 in."""
    scene = data(inputs={"S4": "v*t + middle"}, drives={"S4": "?"}, range=["40 in", "61 in"])
    rows = scene["loop"]["rows"]
    rows[0] = {"joint": "R", "link": "crank", "theta": "?", "a": "a1"}
    rows[3]["S"] = "S4"
    scene["loop"]["start"] = {
        "theta1": "30 deg",
        "theta2": "80 deg",
        "theta3": "-110 deg",
        "alpha3": "90 deg",
    }
    for name, value in {"a4": "0 in", "alpha4": "270 deg"}.items():
        scene["parameters"][name] = {"value": value, "tunable": True}
    j = account(symgen.Scene(**scene), samples=121)
    j.everything_holds()
    angle, S4 = j.motion.moving["theta1"].value, j.motion.moving["S4"].value / 0.0254
    # 50^2 = 12^2 + S4^2 - 2 12 S4 sin(theta1)
    assert largest(12**2 + S4**2 - 24 * S4 * np.sin(angle) - 50**2) <= 1e-9


@pytest.mark.parametrize("mode", ["mode_L", "mode_T"])
def test_golden_values_by_command(mode):
    numbers = next(s for s in reference("dual_slider_crank")["scenes"] if s["name"] == "a4_S1")
    degrees = [p["theta1_deg"] for p in numbers["positions"]]
    command = ["run", "slider_crank", "--set", "a4=30 in", "--set", "S1=9 in"]
    if mode == "mode_T":
        command += ["--set", "loop.drives.theta1=100 lbf*in", "--set", "loop.drives.S4=?"]
    for angle, expected in zip(degrees, numbers["positions"], strict=True):
        done = CliRunner().invoke(app, [*command, "--at", str(angle), "--json"])
        assert done.exit_code == 0, done.output
        answer = json.loads(done.stdout)
        assert answer["scene"] == "slider_crank"
        along, outputs = answer["coordinate"], answer["outputs"]
        assert along["name"] == "theta1" and along["last"] == pytest.approx(math.radians(angle), rel=1e-15)
        units = {name: outputs[name]["unit"] for name in ("S4", "crank.joint1.force.x", "theta1.drive")}
        assert units == {"S4": "m", "crank.joint1.force.x": "N", "theta1.drive": "N*m"}
        found = {name: output["final"] for name, output in outputs.items()}
        pairs = [
            (found["S4.acceleration"] / INCH, expected["kin"]["S4"]["acc"]),
            (found["theta3.rate"], expected["kin"]["th3"]["vel"]),
            *(
                (found[f"crank.joint1.force.{c}"] / POUND, expected[mode][f"F1{k}"])
                for c, k in zip("xyz", "ijk", strict=True)
            ),
            (found["slider.joint4.force.z"] / POUND, expected[mode]["F4k"]),
            (found["theta1.drive"] / (POUND * INCH), expected[mode]["T1k"]),
        ]
        for value, truth in pairs:
            assert abs(value - truth) <= 1e-9 * max(1.0, abs(truth))
