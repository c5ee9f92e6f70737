"""Loads of elastic links that jump: steps end on the jumps, against closed forms."""

from __future__ import annotations

import math
import tomllib
from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh
from shared.elastic_scenes import AREA, INERTIA, LENGTH, RHO, E, cantilever

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.runtime.elastic.jumps import jump_times
from symgen.runtime.integrate.pace import limited
from symgen.scene.loading import shipped_scene

#: Force [N], when it begins, and how long it lasts [s]: less than a step.
FORCE, BEGIN, LASTS = 100.0, 0.0123, 1e-5
RECTANGLE = "F*(sign(t - b) - sign(t - b - w))/2"
TRIANGLE = "F*max(0, 1 - abs((t - b)/w))"


def pushed(folder, force):
    """A bar clamped to a shaft at rest, one cubic element long, with this force across its tip for 50 ms."""
    return cantilever(
        folder,
        ', elements = 1, element = "cubic"',
        more=f"""
[parameters]
F = "{FORCE} N"
b = "{BEGIN} s"
w = "{LASTS} s"
[[forces]]
point = "tip"
force = ["0 N", "{force}"]
[analysis]
t_end = "0.05 s"
""",
    )


def deflection(times, moments, step):
    """Return how far the tip moves [m]: modes of Hermite's element, each driven by steps or ramps of the force."""
    a = LENGTH
    mass = RHO * AREA * a / 420 * np.array([[156, -22 * a], [-22 * a, 4 * a * a]])
    stiffness = E * INERTIA / a**3 * np.array([[12, -6 * a], [-6 * a, 4 * a * a]])
    squares, shapes = eigh(stiffness, mass)
    found = np.zeros(len(times))
    for begin, size in moments:
        since = np.maximum(times - begin, 0.0)
        for square, tip in zip(squares, shapes[0], strict=True):
            w = math.sqrt(square)
            grown = 1 - np.cos(w * since) if step else since - np.sin(w * since) / w
            found += tip**2 * size / square * grown
    return found


@pytest.mark.parametrize(
    ("options", "tolerance"),
    [
        ({}, 1e-8),
        ({"steps": 100}, 1e-8),
        ({"method": "gauss4", "steps": 1000}, 1e-6),
        ({"method": "newmark", "steps": 4000}, 2e-4),
        ({"method": "generalized-alpha", "steps": 4000}, 2e-4),
        ({"method": "rk4", "steps": 4000}, 1e-7),
        ({"method": "dop853", "rtol": 1e-9}, 1e-7),
    ],
    ids=str,
)
def test_pulses_shorter_than_a_step_are_not_missed(options, tolerance, tmp_path):
    run = pushed(tmp_path, RECTANGLE).simulate(samples=21, **options)
    expected = deflection(run.time, [(BEGIN, FORCE), (BEGIN + LASTS, -FORCE)], step=True)
    error = run["tip.displacement"].values[:, 1] - expected
    assert np.max(np.abs(error)) < tolerance * np.max(np.abs(expected))
    assert any("steps end on 2 switching points" in note for note in run.notes)


def test_steps_end_on_the_points_of_a_table(tmp_path):
    pushed(tmp_path, RECTANGLE)
    file = next(tmp_path.glob("*.toml"))
    at, size = [BEGIN, BEGIN + LASTS, BEGIN + 3 * LASTS], [0, FORCE, 0]
    points = f"x = {[f'{x!r} s' for x in at]}, y = {[f'{y!r} N' for y in size]}"
    text = file.read_text().replace(RECTANGLE, "law(t)")
    file.write_text(f"{text}\n[tables]\nlaw = {{ {points} }}\n")
    run = symgen.build(file).simulate(samples=21)
    up, down = FORCE / LASTS, -FORCE / (2 * LASTS)
    expected = deflection(run.time, [(at[0], up), (at[1], down - up), (at[2], -down)], step=False)
    error = run["tip.displacement"].values[:, 1] - expected
    assert np.max(np.abs(error)) < 1e-7 * np.max(np.abs(expected))
    assert any("steps end on 3 switching points (law(t)" in note for note in run.notes)


@pytest.mark.parametrize("precision", ["longdouble", "float128"])
def test_jumps_are_found_to_the_rounding_of_times_in_any_precision(precision, tmp_path):
    """Times are doubles: nothing smaller can be halved, however precise the motion is."""
    pushed(tmp_path, RECTANGLE)
    model = symgen.build(next(tmp_path.glob("*.toml")), precision=precision)
    motion = model.motion(True)
    with limited(5.0):
        found = jump_times(motion, 0.05, 2048)
    assert found.mean(axis=1) == pytest.approx([BEGIN, BEGIN + LASTS], rel=1e-13)
    assert np.max(np.diff(found)) < 1e-14


def test_corners_that_show_only_beside_another_are_found(tmp_path):
    run = pushed(tmp_path, TRIANGLE).simulate(samples=21)
    rate = FORCE / LASTS
    corners = [(BEGIN - LASTS, rate), (BEGIN, -2 * rate), (BEGIN + LASTS, rate)]
    expected = deflection(run.time, corners, step=False)
    error = run["tip.displacement"].values[:, 1] - expected
    assert np.max(np.abs(error)) < 1e-8 * np.max(np.abs(expected))


def test_fixed_steps_keep_their_order_over_jumps(tmp_path):
    """Errors of Newmark's method fall as the square of the step: as without a jump."""
    model, errors = pushed(tmp_path, "F*(1 + sign(t - b))/2"), []
    for steps in (2000, 4000, 8000):
        run = model.simulate(method="newmark", steps=steps, samples=21)
        expected = deflection(run.time, [(BEGIN, FORCE)], step=True)
        errors.append(np.max(np.abs(run["tip.displacement"].values[:, 1] - expected)))
    assert 3.5 < errors[0] / errors[1] < 4.5
    assert 3.5 < errors[1] / errors[2] < 4.5


def crank_with_motor(torque):
    """A stiff crank with a flywheel, turned from 4 rad/s on by a torque."""
    link = {
        "points": ["O", "A"],
        "density": "7850 kg/m^3",
        "section": {"width": "20 mm", "thickness": "20 mm"},
        "elastic": {"E": "2.06e11 Pa", "elements": 1},
    }
    turned = {"link": "crank", "mode": "motor", "speed": "w", "torque": torque, "flywheel": "2 kg*m^2"}
    return symgen.Scene(
        parameters={"w": "4 rad/s", "k": "2 N*m", "b": "0.4 s", "c": "1 N*m*s", "h": "1e-3 s"},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.3 m", "0 m"]}},
        links={"crank": link},
        crank=turned,
    )


def test_a_motor_that_is_reversed():
    """I theta'' = k, from 0.4 s on -k."""
    run = symgen.build(crank_with_motor("k*sign(b - t)")).simulate(revolutions=0.5, samples=21, steps=200)
    gained, t = 2 / (2 + 7850 * 4e-4 * 0.3 * 0.3**2 / 3), run.time
    after = np.maximum(t - 0.4, 0.0)
    expected = 4 * t + gained * (t**2 / 2 - after**2)
    x, y = run["A.position"].values.T
    assert np.unwrap(np.arctan2(y, x)) == pytest.approx(expected, abs=1e-5)
    assert any("1 switching point (sign(0.4 - t)" in note for note in run.notes)


def test_a_motor_whose_torque_jumps_twice_a_revolution_has_a_steady_speed():
    """I theta'' = k + c (w - theta') over half a revolution, with -k over the other; each turns by pi."""
    from scipy.optimize import fsolve

    inertia = 2 + 7850 * 4e-4 * 0.3 * 0.3**2 / 3
    slow = inertia / 1.0

    def halves(x):
        first, second, low, high = x
        rest = [4.0 + 2.0, 4.0 - 2.0]
        ends, turned = [], []
        for begin, speed, t in ((low, rest[0], first), (high, rest[1], second)):
            left = (begin - speed) * math.exp(-t / slow)
            ends.append(speed + left)
            turned.append(speed * t + (begin - speed - left) * slow)
        return [ends[0] - high, ends[1] - low, turned[0] - math.pi, turned[1] - math.pi]

    first, second, *_ = fsolve(halves, [0.8, 0.8, 3.5, 4.5], xtol=1e-13)
    scene = crank_with_motor("k*sign(sin(this.angle)) + c*(w - this.rate)")
    run = symgen.build(scene).periodic(samples=9, steps=32)
    said = next(note for note in run.notes if "mean speed" in note)
    assert float(said.split()[-2]) == pytest.approx(60 / (first + second), rel=1e-5)
    assert any("switching point" in note for note in run.notes)


@cache
def four_bar(torque):
    """A four-bar with an elastic coupler, its crank at 30 rad/s from 2.498 rad on, and a torque on its follower."""
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "C": {"at": ["0.2 m", "0 m"], "ground": True},
        "A": {"at": ["-0.4 m", "0.3 m"]},
        "B": {"at": ["-0.1 m", "0.5 m"]},
    }
    coupler = {
        "points": ["A", "B"],
        "density": "7850 kg/m^3",
        "section": {"width": "20 mm", "thickness": "5 mm"},
        "elastic": {"E": "2.06e11 Pa", "elements": 1},
    }
    links = {
        "crank": {"points": ["O", "A"], "mass": "0.5 kg"},
        "coupler": coupler,
        "follower": {"points": ["C", "B"], "mass": "0.8 kg"},
    }
    scene = symgen.Scene(
        parameters={"w": "30 rad/s", "k": "0.2 N*m"},
        points=points,
        links=links,
        torques=[{"link": "follower", "torque": torque}],
        crank={"link": "crank", "speed": "w"},
    )
    return symgen.build(scene)


#: A torque that acts while the crank is within 0.8 degrees of the direction of 1 rad.
WINDOW = "k*(1 + sign(cos(crank.angle - 1) - cos(0.8*pi/180)))"


def times_of_window(revolutions):
    """Return when the torque begins and ends, the crank turning evenly."""
    ahead = np.array([1 - math.radians(0.8), 1 + math.radians(0.8)]) - math.atan2(0.3, -0.4) + 2 * math.pi
    return (ahead + 2 * math.pi * np.arange(revolutions)[:, None]).ravel() / 30


def test_short_windows_of_every_revolution_are_found():
    from symgen.runtime.elastic.jumps import jump_times

    motion = four_bar(WINDOW).motion(True)
    found = jump_times(motion, 10 * motion.period, 1)
    assert found.mean(axis=1) == pytest.approx(times_of_window(10), abs=1e-9)
    assert np.array_equal(motion.ending_on(found).refined.jumps, found)


def test_jumps_after_the_last_angle_asked_of_a_steady_state():
    model = four_bar(WINDOW)
    at = np.array([2.6, 2.7])
    few, whole = model.periodic(at=at, steps=64), model.periodic(at=[*at, 0.9, 2.49], steps=64)
    assert any("2 switching points" in note for note in few.notes)
    expected = whole["coupler.stress"].values[:2]
    assert few["coupler.stress"].values == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("options", [{"steps": 10**12}, {"max_step": 1e-13}])
@pytest.mark.parametrize("method", ["gauss", "rk4", "dop853"])
def test_too_many_steps_are_refused_before_jumps_are_looked_for(method, options, tmp_path):
    with pytest.raises(ModelError, match="expected"):
        pushed(tmp_path, RECTANGLE).simulate(method=method, **options)


def test_explicit_runs_with_jumps_resume_to_the_bit(tmp_path, monkeypatch):
    """From a checkpoint before the force, and from one behind both of its jumps."""
    from symgen.runtime.integrate import checkpoint

    model, file = pushed(tmp_path, RECTANGLE), tmp_path / "kept"
    options = {"method": "dop853", "rtol": 1e-5, "samples": 9}
    whole, store = model.simulate(**options), checkpoint.store
    for stop in (0.2 * BEGIN, BEGIN + 2 * LASTS):

        def stopping(path, mark, t, *content, stop=stop):
            store(path, mark, t, *content)
            if t > stop:
                raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(checkpoint, "store", stopping)
            patch.setattr("symgen.runtime.integrate.pace.LOOK", 0.0)
            with pytest.raises(KeyboardInterrupt):
                model.simulate(**options, checkpoint=file, checkpoint_every=0)
        resumed = model.simulate(**options, resume=file)
        for before, after in zip(whole.variables, resumed.variables, strict=True):
            assert np.array_equal(before.values, after.values)
        assert resumed.statistics["steps"] == whole.statistics["steps"]


def test_steps_to_a_time_limit_are_counted_in_the_order_in_which_they_are_taken():
    from symgen.runtime.beams.methods import GAUSS
    from symgen.runtime.elastic.steps import stepped
    from symgen.runtime.integrate.pace import OutOfTime, Pace

    class Short(Pace):
        def chunk(self):
            return 1

        def spent(self, t, why=""):
            return t > 0.025

    motion = four_bar(WINDOW).motion(True)
    times, counts = np.array([0.01, 0.04, 0.02, 0.03]), np.array([1, 2, 4, 8])
    with pytest.raises(OutOfTime) as stop:
        stepped(motion, motion.equations(), GAUSS, times, counts, pace=Short(0.0, 0.04))
    assert stop.value.reached.tolist() == [0, 2]
    assert stop.value.states.steps == 1 + 2 + 3


def test_jumps_at_angles_beyond_a_revolution():
    """A jump at 8 rad of the crank, and at the time at which it comes there."""
    runs = []
    for gap in ("crank.angle - 8", f"t - {8 - math.atan2(0.3, -0.4)!r}/w"):
        model = four_bar(f"k*sign({gap})")
        runs.append(model.simulate(revolutions=2, steps=200, samples=41))
    for name in ("coupler.stress", "crank.torque"):
        by_angle, by_time = (run[name].values for run in runs)
        assert by_angle == pytest.approx(by_time, abs=1e-9 * np.max(np.abs(by_time)))
    assert all(any("1 switching point " in note for note in run.notes) for run in runs)


@pytest.mark.parametrize(
    ("force", "area"),
    [("F*exp(-((t - b)/w)**2)", math.sqrt(math.pi)), ("F/(1 + ((t - b)/w)**2)**2", math.pi / 2)],
)
def test_smooth_pulses_shorter_than_a_step_are_not_missed(force, area, tmp_path):
    """The tip moves as after an impulse, but for terms of the second order of its length."""
    model = pushed(tmp_path, force)
    run = model.simulate(t_eval=[0.02, 0.03, 0.05], rtol=1e-6)
    impulse = FORCE * LASTS * area
    expected = deflection(run.time, [(BEGIN - 1e-9, impulse / 2e-9), (BEGIN + 1e-9, -impulse / 2e-9)], True)
    error = run["tip.displacement"].values[:, 1] - expected
    assert np.max(np.abs(error)) < 1e-3 * np.max(np.abs(expected))


def test_pulses_in_the_torque_of_a_motor():
    """I theta'' = k exp(-((t - b)/h)^2) with h = 1 ms: the speed rises by k h sqrt(pi)/I."""
    model = symgen.build(crank_with_motor("k*exp(-((t - b)/h)**2)"))
    run = model.simulate(revolutions=0.5, samples=21, steps=200)
    gained = 2 * 1e-3 * math.sqrt(math.pi) / (2 + 7850 * 4e-4 * 0.3 * 0.3**2 / 3)
    x, y = run["A.position"].values.T
    expected = 4 * run.time + gained * np.maximum(run.time - 0.4, 0.0)
    assert np.unwrap(np.arctan2(y, x)) == pytest.approx(expected, abs=2e-6)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("method", ["gauss", "newmark"])
def test_recorded_times_may_be_as_near_as_numbers_are(method, precision, tmp_path):
    """Times between which no step is possible have the same state, also the last."""
    pushed(tmp_path, RECTANGLE)
    model = symgen.build(next(tmp_path.glob("*.toml")), precision=precision)
    tolerance = {"float32": 1e-3, "float64": 1e-9}[precision]
    asked = {"method": method, "steps": 1000}
    near = [0.0, 5e-324, 0.02, np.nextafter(0.02, 1.0), 0.03, np.nextafter(0.03, 1.0)]
    found = model.simulate(t_eval=near, **asked)["tip.displacement"].values[:, 1]
    expected = model.simulate(t_eval=[0.0, 0.02, 0.03], **asked)["tip.displacement"].values[:, 1]
    assert found == pytest.approx(np.repeat(expected, 2), abs=tolerance * np.max(np.abs(expected)))
    adapted = model.simulate(t_eval=near, method=method, rtol=0.1)["tip.displacement"].values[:, 1]
    assert np.all(np.isfinite(adapted)) and np.array_equal(adapted[::2], adapted[1::2])


@pytest.mark.parametrize(
    ("verb", "options"),
    [
        ("simulate", {"t_end": 0.05, "samples": 3, "method": "gauss", "steps": 40}),
        ("large_rotation", {"t_end": 0.05, "samples": 3, "rtol": 1e-2, "elements": 1}),
        ("kinematics", {"stop": 0.1, "over": "time"}),
    ],
)
def test_a_crank_whose_rate_jumps_by_a_tunable_parameter_ends_a_run(verb, options):
    """With k = 1 the rate is zero where the law begins again."""
    written = tomllib.loads(shipped_scene("elastic_slider_crank"))
    written["parameters"] |= {"T": "0.04 s", "k": {"value": 1.0, "tunable": True}}
    law = "1.5*((mod(t, T)*(T - mod(t, T))/T**2)**2 + (k - 1)*mod(t, T)*(T - mod(t, T))/T**2)"
    written["crank"] = {"link": "crank", "angle": law}
    model = symgen.build(symgen.Scene(**written))
    getattr(model, verb)(**options)
    with pytest.raises(SimulationError, match=r"its rate, jumps with mod\(t, 0.04\) .* at t = 0.04 s"):
        getattr(model.with_parameters(k=1.5), verb)(**options)
