"""At a pole itself, what has none there is the limit of both sides, and what is given stays what was given."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from shared.closed_slider_crank import Closed, Offsets
from shared.inches import in_inches

import symgen


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


@pytest.mark.parametrize("missed", [1e-9, 1e-6, 1e-3])
def test_arc_length_passes_poles_of_angles_that_it_misses_by_little(missed):
    """Two lengths in one plane: S4 = sqrt(50^2 - ((a4 - 12)^2 + 24 a4 (1 + cos q))), with the rod's 50 in."""
    a4 = 12.0 + missed
    model = symgen.build("slider_crank").with_parameters(alpha4=np.pi, a4=a4 * 0.0254)
    turn = in_inches(model.inverse_dynamics(through=True, samples=181))
    angles, places = (turn.variable(name).values for name in ("theta1", "S4"))
    # Equal distances include the turn of the ball's angles in one place, whose poses are omitted.
    assert len(angles) > 100 and angles[-1] == pytest.approx(2 * np.pi, abs=1e-12)
    exact = np.sqrt(2500.0 - (a4 - 12.0) ** 2 - 24.0 * a4 * (1 + np.cos(angles)))
    assert np.abs(places) == pytest.approx(exact, rel=1e-9)


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


@pytest.mark.parametrize("span", [["0 deg", "360 deg"], ["180 deg", "360 deg"]])
def test_a_pole_of_the_angles_of_a_ball_is_no_singularity_of_the_loop(span):
    """A slider along the axis of its crank: at 180 deg the rod is on that axis, where its two angles have a pole.

    The end of the crank is 24 in |cos(q/2)| from the slider's line: S = sqrt(50^2 - (24 cos(q/2))^2) in.
    """
    changed = {"alpha4": "180 deg", "a4": "12 in", "loop.range": span}
    model = symgen.build("slider_crank", set=changed)
    turn = in_inches(model.inverse_dynamics(samples=361 if span[0] == "0 deg" else 181))
    q = turn.variable("theta1").values
    crank = np.sqrt(2500.0 - (24.0 * np.cos(q / 2)) ** 2)
    slope = 72.0 * np.sin(q) * 2.0 / crank  # of the root by q
    rate = 50.0 * 2.0 * np.pi / 60.0
    assert turn.variable("S4").values == pytest.approx(crank, abs=1e-11)
    assert turn.variable("S4.rate").values == pytest.approx(slope * rate, abs=1e-6)
    (pole,) = np.flatnonzero(np.abs(q - np.pi) < 1e-9)
    slider = 0.28 * 27.0 / 386.4
    pull = turn.variable("slider.joint3.force").values
    for name in ("crank.joint1.force", "slider.joint3.force", "slider.joint4.moment", "theta1.drive"):
        values = turn.variable(name).values
        assert np.all(np.isfinite(values)), name
    acceleration = 144.0 * np.cos(np.pi) / 50.0 * rate**2
    assert turn.variable("S4.acceleration").values[pole] == pytest.approx(acceleration, rel=1e-8)
    assert np.linalg.norm(pull[pole]) >= slider * abs(acceleration) * (1 - 1e-8)
    assert any("pole, which is no singularity" in note for note in turn.notes)


def offset_slider(a4, angles):
    """The slider's way [in] and the crank's torque [lbf in], alpha4 = 180 deg: two balls in space and a thin rod.

    The crank's end turns about z, the slider moves along z at (-a4, 0). The torque times the speed is the rate of
    the kinetic energy; the spin of the rod about its own line is left out.
    """
    speed, per = 50.0 * 2.0 * np.pi / 60.0, 0.28 / 386.4
    rod, slider = per * np.pi * 50.0, per * 27.0
    across = rod * (3.0 + 50.0**2) / 12.0

    def kinetic(q):
        end = [12 * mp.cos(q), 12 * mp.sin(q), 0]
        rate = [-end[1] * speed, end[0] * speed, 0]
        height = mp.sqrt(2500 - (a4 + end[0]) ** 2 - end[1] ** 2)
        along = [-mp.mpf(a4) - end[0], -end[1], height]
        lift = (along[0] * rate[0] + along[1] * rate[1]) / height
        turn = [-rate[0], -rate[1], lift]
        middle = [r + x / 2 for r, x in zip(rate, turn, strict=True)]
        squares = [sum(x * x for x in v) for v in (middle, turn)]
        return (rod * squares[0] + across * squares[1] / 2500 + slider * lift**2) / 2

    way = [float(np.sqrt(2500.0 - (a4**2 + 144.0 + 24.0 * a4 * np.cos(q)))) for q in angles]
    with mp.workdps(40):
        torque = [float(mp.diff(kinetic, mp.mpf(q))) for q in angles]
    return np.array(way), np.array(torque)


@pytest.mark.parametrize("a4", [12.0000001, 12.001, 12.01, 12.1])
def test_a_pole_of_the_angles_of_a_ball_is_passed_at_any_distance(a4):
    angles = np.radians([160.0, 170.0, 175.0, 179.0, 179.99, 180.0, 180.01, 181.0, 185.0, 200.0])
    model = symgen.build("slider_crank", set={"alpha4": "180 deg", "a4": f"{a4!r} in"})
    turn = in_inches(model.inverse_dynamics(at=angles))
    way, torque = offset_slider(a4, angles)
    assert turn.closure < 1e-11
    assert turn.variable("S4").values == pytest.approx(way, abs=1e-10)
    assert turn.variable("theta1.drive").values == pytest.approx(torque, abs=2e-6)


def test_no_distance_from_a_pole_of_the_angles_of_a_ball_refuses_a_value():
    angles = np.radians([179.0, 180.0, 181.0])
    for a4 in [12.0, *(12.0 + np.logspace(-9.0, -1.0, 20)).tolist()]:
        model = symgen.build("slider_crank", set={"alpha4": "180 deg", "a4": f"{a4!r} in"})
        turn = in_inches(model.inverse_dynamics(at=angles))
        way, torque = offset_slider(a4, angles)
        assert turn.closure < 1e-11, a4
        assert turn.variable("S4").values == pytest.approx(way, abs=1e-10), a4
        assert turn.variable("theta1.drive").values == pytest.approx(torque, abs=2e-6), a4
