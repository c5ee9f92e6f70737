"""At a pole itself, what has none there is the limit of both sides, and what is given stays what was given."""

from __future__ import annotations

import numpy as np
import pytest
from shared.closed_slider_crank import Closed, Offsets
from shared.inches import in_inches

import symgen
from symgen.errors import SimulationError


@pytest.fixture(scope="module")
def driven():
    """The slider-crank of the source's study: torque given, load unknown; dead centres at 90 and 270 degrees."""
    given = {"S1": "3.5 in", "loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?"}
    return symgen.build("slider_crank", set=given)


@pytest.mark.parametrize("degrees", [90.0, 270.0])
def test_components_without_a_pole(driven, degrees):
    turn = in_inches(driven.inverse_dynamics(at=np.radians([degrees])))
    (pole,) = turn.poles
    assert turn.variable("theta1.drive").values == pytest.approx(100.0, rel=1e-10)
    # The limit by the closed form: the mean of what is left of components that are smooth there.
    near = Closed(Offsets(0, 270, 3.5), np.radians([degrees - 0.01, degrees + 0.01]))
    sides = near.forces(torque=100.0)
    for name, of in {
        "crank.joint1.force": "F1",
        "crank.joint1.moment": "T1",
        "crank.joint2.force": "F2",
        "slider.joint3.force": "F3",
        "slider.joint4.force": "F4",
    }.items():
        v = turn.variable(name)
        for i, axis in enumerate(v.components):
            value = v.values[0, i]
            assert np.isnan(value) == (f"{name}.{axis}" in pole.residues)
            if not np.isnan(value):
                assert value == pytest.approx(np.mean(sides[of][:, i]), abs=2e-6), (name, axis)
    assert turn.variable("S4").values == pytest.approx(Closed(Offsets(0, 270, 3.5), np.radians([degrees])).S4)


def test_a_turn_is_smooth_across_them(driven):
    turn = in_inches(driven.inverse_dynamics())
    values = turn.variable("crank.joint1.force").values[:, 0]
    assert np.max(np.abs(np.diff(values, 2))) < 0.02


def test_arc_length_next_to_a_pole_of_angles_is_refused():
    """It would be followed around the pole in a hundred thousand points."""
    model = symgen.build("slider_crank").with_parameters(alpha4=np.pi, a4=12.001 * 0.0254)
    with pytest.raises(
        SimulationError, match=r"passes close to a pole of the angles theta2, .* of a ball joint"
    ):
        model.inverse_dynamics(through=True)


#: A pound-force [N].
POUND = 0.45359237 * 9.80665


@pytest.mark.parametrize("a4", [12.0, 12.001])
def test_a_dead_centre_at_a_pole_of_angles_is_found_between_samples(a4):
    """The slider stands still at 180 deg, where the rod passes a pole of its ball, or misses it by little."""
    given = {"loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?", "alpha4": "180 deg", "a4": f"{a4} in"}
    model = symgen.build("slider_crank", set=given)
    turn = model.inverse_dynamics(at=np.radians([165.0, 172.0, 187.0, 195.0]))
    (pole,) = turn.poles
    # Near it the load is the torque over the slope of S = (50^2 - a4^2 - 144 - 24 a4 cos q)^(1/2).
    slope = -12.0 * a4 / np.sqrt(2500.0 - (a4 - 12.0) ** 2)
    assert pole.at == pytest.approx(np.pi, abs=1e-6)
    assert abs(pole.residues["S4.drive"]) == pytest.approx(100.0 / abs(slope) * POUND, rel=1e-8)
    assert all(name.endswith(".drive") or ".joint" in name for name in pole.residues)
