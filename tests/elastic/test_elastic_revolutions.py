"""Loads and motors of elastic links written with angles, over several revolutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shared.rods_with_springs import in_rods

import symgen
from symgen.errors import ModelError, SimulationError


def _elastic_drag_link(torque):
    """A drag-link with an elastic coupler, its crank held at 30 rad/s from the direction of A on."""
    return symgen.Scene(
        parameters={"w": "30 rad/s", "k": "0.2 N*m"},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "C": {"at": ["0.2 m", "0 m"], "ground": True},
            "A": {"at": ["-0.4 m", "0.3 m"]},
            "B": {"at": ["-0.1 m", "0.5 m"]},
        },
        links={
            "crank": {"points": ["O", "A"], "mass": "0.5 kg"},
            "coupler": {
                "points": ["A", "B"],
                "density": "7850 kg/m^3",
                "section": {"width": "20 mm", "thickness": "5 mm"},
                "elastic": {"E": "2.06e11 Pa", "elements": 1},
            },
            "follower": {"points": ["C", "B"], "mass": "0.8 kg"},
        },
        torques=[{"link": "follower", "torque": torque}],
        crank={"link": "crank", "speed": "w"},
    )


def test_angles_in_loads_count_revolutions():
    """The same torque written with the crank's angle, and with the time; and one that no revolution repeats."""
    run = {"method": "gauss", "revolutions": 2, "steps": 200, "samples": 41}
    start = math.atan2(0.3, -0.4)
    model = symgen.build(_elastic_drag_link("k*crank.angle"))
    by_angle = model.simulate(**run)
    by_time = symgen.build(_elastic_drag_link(f"k*({start!r} + w*t)")).simulate(**run)
    for name in ("coupler.stress", "crank.torque", "coupler.B.force"):
        expected = by_time[name].values
        assert by_angle[name].values == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))
    with pytest.raises(ModelError, match="no revolution repeats"):
        model.periodic()


def test_loads_that_repeat_are_found_for_runs_in_float32():
    """In that type no angle is the same one revolution later."""
    found, expected = (
        symgen.build("elastic_slider_crank", precision=p).periodic(at=[0.1, 2.0])["rod.stress"].values
        for p in ("float32", "float64")
    )
    assert found == pytest.approx(expected, rel=1e-4)
    with pytest.raises(ModelError, match="no revolution repeats"):
        symgen.build(_elastic_drag_link("k*crank.angle"), precision="float32").periodic()


def test_motor_torques_count_revolutions():
    """I theta'' = k (9 - theta) of a stiff crank with its flywheel, up to three revolutions."""
    scene: dict = {
        "parameters": {"w": "4 rad/s", "k": "2 N*m"},
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.3 m", "0 m"]}},
        "links": {
            "crank": {
                "points": ["O", "A"],
                "density": "7850 kg/m^3",
                "section": {"width": "20 mm", "thickness": "20 mm"},
                "elastic": {"E": "2.06e11 Pa", "elements": 1},
            }
        },
        "crank": {
            "link": "crank",
            "mode": "motor",
            "speed": "w",
            "torque": "k*(9 - this.angle)",
            "flywheel": "2 kg*m^2",
        },
    }
    model = symgen.build(symgen.Scene(**scene))
    rate = math.sqrt(2 / (2 + 7850 * 4e-4 * 0.3 * 0.3**2 / 3))
    result = model.simulate(revolutions=2, samples=81, steps=400)
    x, y = result["A.position"].values.T
    t = result.time
    expected = 9 - 9 * np.cos(rate * t) + 4 / rate * np.sin(rate * t)
    assert np.unwrap(np.arctan2(y, x)) == pytest.approx(expected, abs=1e-4)
    rods = in_rods(scene, 3).model.simulate(4.0, samples=9, rtol=1e-9)
    assert rods["crank_1.angle"].values == pytest.approx(9 - 9 * np.cos(rate * rods.time), abs=1e-2)
    with pytest.raises(SimulationError, match="does not settle"):
        model.periodic()
