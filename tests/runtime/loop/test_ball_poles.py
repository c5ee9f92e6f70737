"""Runs under forces past the poles of the angles of ball joints: the motion from the energy alone.

A crank, a rod and a slider parallel to the crank's axis: where the offset of the slider's line is the length of the
crank, the rod passes both poles, and where it is a little more, it misses them by little.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from shared.ball_poles import CASE, CRANK, ROD, SPEED, Straight
from shared.full import full

import symgen
import symgen.export
from symgen.errors import ModelError

both = pytest.mark.parametrize("method", ["dop853", "taylor"])


@pytest.fixture(scope="module")
def model():
    return symgen.build(CASE)


@both
@pytest.mark.parametrize("past", [1e-2, 1e-3, 1e-5, 1e-8, 0.0])
def test_a_run_passes_poles_of_balls(model, past, method):
    straight = Straight(CRANK + past)
    chosen = {"method": method, "rtol": 1e-11, "atol": 1e-12, "samples": 401}
    result = model.with_parameters(offset=CRANK + past).simulate(**chosen)
    angle = result["theta1"].values
    assert angle[-1] > 1.5 * np.pi
    assert straight.time(angle[-1]) == pytest.approx(1.0, abs=1e-10)
    np.testing.assert_allclose(result["theta1.rate"].values, straight.rate(angle), rtol=1e-9)
    np.testing.assert_allclose(result["S4"].values, straight.slider(angle)[0], rtol=1e-12)
    np.testing.assert_allclose(
        result["S4.acceleration"].values, straight.acceleration(angle), rtol=1e-7, atol=1e-7
    )
    assert past == 0.0 or not result.notes
    assert not [note for note in result.notes if "rank" in note]
    assert result.statistics["steps"] < 100


def test_a_sample_at_the_pole_itself(model):
    straight = Straight(CRANK)
    at = straight.time(np.pi)
    run = model.with_parameters(offset=CRANK).simulate(2 * at, rtol=1e-11, atol=1e-12, samples=3)
    assert run["theta1"].values[1] == pytest.approx(np.pi, abs=1e-10)
    assert run["S4.acceleration"].values[1] == pytest.approx(straight.acceleration(np.pi), rel=1e-8)
    assert run["S4.rate"].values[1] == pytest.approx(0.0, abs=1e-8)
    assert all(np.all(np.isfinite(v.values)) or v.name[-4:] in ("rate", "tion") for v in run.variables)
    open_ = {v.name for v in run.variables if not np.all(np.isfinite(v.values))}
    assert any("pole" in note for note in run.notes) == bool(open_)


@both
def test_the_angles_of_balls_go_straight_on_through_a_pole(model, method):
    """The rod's direction by its two angles, from the pin to the slider; no recorded angle jumps at the pole."""
    chosen = {"method": method, "rtol": 1e-11, "atol": 1e-12, "samples": 401}
    run = model.with_parameters(offset=CRANK).simulate(**chosen)
    angle, theta, eta = (run[name].values for name in ("theta1", "theta2", "eta2"))
    across, zero = angle + theta, np.zeros_like(angle)
    direction = np.array([np.cos(across) * np.cos(eta), np.sin(across) * np.cos(eta), -np.sin(eta)])
    pin = CRANK * np.array([np.cos(angle), np.sin(angle), zero])
    end = np.array([zero - CRANK, zero, Straight(CRANK).slider(angle)[0]])
    np.testing.assert_allclose(direction, (end - pin) / ROD, atol=1e-9)
    for name in ("theta2", "eta2", "theta3", "eta3", "alpha3"):
        assert np.max(np.abs(np.diff(run[name].values))) < 0.1, name


def test_a_constant_alpha_turns_the_frame_of_the_rod_alone(model, tmp_path):
    """By 30 deg about the line of the balls: the motion is the same, and so is the force in the turned frame."""
    text = CASE.read_text().replace('a = "1.25 m"', 'alpha = "30 deg", a = "1.25 m"')
    (tmp_path / "scene.toml").write_text(text)
    offset, chosen = CRANK + 1e-3, {"rtol": 1e-11, "atol": 1e-12, "samples": 201}
    plain = model.with_parameters(offset=offset).simulate(**chosen)
    run = symgen.build(tmp_path / "scene.toml").with_parameters(offset=offset).simulate(**chosen)
    assert Straight(offset).time(run["theta1"].values[-1]) == pytest.approx(1.0, abs=1e-10)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turned = plain["slider.joint3.force"].values @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    np.testing.assert_allclose(run["slider.joint3.force"].values, turned, atol=1e-6)


def test_loads_by_the_angles_of_a_ball_take_those_of_the_table(tmp_path):
    """A torque by an angle of a ball, next to its pole: energy by the work of that torque over the crank's angle."""
    text = CASE.read_text().replace("[parameters]", '[parameters]\nc = "-2 N*m"')
    (tmp_path / "scene.toml").write_text(
        text.replace("[loop.links]", '[loop.drives]\ntheta1 = "c*eta2"\n\n[loop.links]')
    )
    straight = Straight(0.31)
    run = symgen.build(tmp_path / "scene.toml").simulate(0.5, rtol=1e-11, atol=1e-12, samples=11)

    def elevation(angle):
        return -np.arcsin(straight.slider(angle)[0] / ROD)

    angles, rates = run["theta1"].values, run["theta1.rate"].values
    assert angles[-1] > 1.2 * np.pi  # past 180 deg, where the ball is next to its pole
    np.testing.assert_allclose(run["eta2"].values, elevation(angles), rtol=1e-9)
    work = [quad(lambda x: -2.0 * elevation(x), np.pi / 2, end, epsabs=1e-12)[0] for end in angles]
    np.testing.assert_allclose(straight.mass(angles) * rates**2 / 2, straight.energy + work, rtol=1e-9)


@both
def test_a_load_jumps_near_a_pole(tmp_path, method):
    """A torque that changes its sign while the ball is next to its pole: energy by its work on both sides."""
    text = CASE.read_text().replace("[parameters]", '[parameters]\nc = "4 N*m"\nb = "0.2 s"')
    (tmp_path / "scene.toml").write_text(
        text.replace("[loop.links]", '[loop.drives]\ntheta1 = "c*sign(b - t)"\n\n[loop.links]')
    )
    model, straight = symgen.build(tmp_path / "scene.toml"), Straight(0.301)
    assert model.description.balls
    run = model.with_parameters(offset=0.301).simulate(0.4, method=method, rtol=1e-11, atol=1e-12, samples=3)
    angles, rates = run["theta1"].values, run["theta1.rate"].values
    assert abs(angles[1] - np.pi) < 0.3
    work = 4.0 * np.array([0.0, angles[1] - angles[0], 2 * angles[1] - angles[0] - angles[2]])
    np.testing.assert_allclose(straight.mass(angles) * rates**2 / 2, straight.energy + work, rtol=1e-9)
    assert any("1 switching point" in note for note in run.notes)


@pytest.mark.parametrize("past", [0.0, 1e-9, full(1e-5)])
def test_a_run_starts_at_a_pole(past, tmp_path):
    """At 180 deg the rod is along the crank's axis: both balls are at poles, one by the choice of the other."""
    text = CASE.read_text().replace("0.31 m", f"{CRANK + past!r} m").replace('"90 deg"', '"180 deg"')
    guess = 'theta2 = "125 deg", theta3 = "-125 deg", alpha3 = "90 deg", S4 = "1.2 m"'
    (tmp_path / "scene.toml").write_text(text.replace(guess, 'S4 = "1.2 m"'))
    model, straight = symgen.build(tmp_path / "scene.toml"), Straight(CRANK + past)
    run = model.simulate(0.5, rtol=1e-11, atol=1e-12, samples=11)
    angles = run["theta1"].values
    assert angles[0] == pytest.approx(np.pi) and angles[-1] > 1.7 * np.pi
    rates = SPEED * np.sqrt(straight.mass(np.pi) / straight.mass(angles))
    np.testing.assert_allclose(run["theta1.rate"].values, rates, rtol=1e-9)
    np.testing.assert_allclose(run["S4"].values, straight.slider(angles)[0], rtol=1e-12)
    straight.energy = straight.mass(np.pi) * SPEED**2 / 2
    np.testing.assert_allclose(
        run["S4.acceleration"].values, straight.acceleration(angles), rtol=1e-7, atol=1e-7
    )
    assert abs(run["eta2"].values[0]) == pytest.approx(np.pi / 2, abs=1e-2)
    with pytest.raises(ModelError, match=r"starts at a pole of the angles .* of a ball joint"):
        symgen.export.export_c(tmp_path / "scene.toml", tmp_path / "c")
