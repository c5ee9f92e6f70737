"""Means, root mean squares and work of outputs over time, against closed forms and the balance of energy."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ResultError
from symgen.runtime.model import averages as quadrature

G, MASS, ARM, SPEED = 9.81, 2.0, 0.5, 3.0


def arm(angle, gravity=0.0, outputs=("arm.torque", "arm.power", "B.position")):
    """A rod of 0.5 m without inertia about its hinge but a mass of 2 kg at its end."""
    return symgen.Scene(
        parameters={"w": f"{SPEED} rad/s", "d": "4 s"},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "B": {"at": ["0.5 m", "0 m"]}},
        links={"arm": {"points": ["O", "B"], "mass": "0 kg"}},
        masses=[{"point": "B", "mass": f"{MASS} kg"}],
        drivers=[{"link": "arm", "angle": angle}],
        gravity={"acceleration": ["0 m/s^2", f"{-gravity} m/s^2"]},
        analysis={"t_end": "1 s", "outputs": list(outputs)},
    )


def test_the_rule_is_exact_for_polynomials():
    for degree in range(23):
        exact = 2 / (degree + 1) if degree % 2 == 0 else 0.0
        assert quadrature.NODES**degree @ quadrature.KRONROD == pytest.approx(exact, abs=1e-15)
        if degree < 14:
            assert quadrature.NODES**degree @ quadrature.GAUSS == pytest.approx(exact, abs=1e-15)


@pytest.fixture(scope="module")
def swinging():
    return symgen.build(arm("0.4*sin(w*t)"))


@pytest.mark.parametrize("verb", ["simulate", "inverse_dynamics"])
@pytest.mark.parametrize("samples", [3, 50])
def test_a_harmonic_drive(swinging, verb, samples):
    """Torque -J a w^2 sin(w t) and power -J a^2 w^3 sin(2 w t)/2; over each half of a period of the power J a^2 w^2/2."""
    period = 2 * np.pi / SPEED
    span = {"simulate": (2 * period,), "inverse_dynamics": (0.0, 2 * period)}[verb]
    found = getattr(swinging, verb)(*span, samples=samples).averages()
    inertia = MASS * ARM**2
    torque, power = found["arm.torque"], found["arm.power"]
    assert torque.mean == pytest.approx(0.0, abs=1e-9)
    assert torque.rms == pytest.approx(inertia * 0.4 * SPEED**2 / math.sqrt(2), rel=1e-8)
    assert power.rms == pytest.approx(inertia * 0.4**2 * SPEED**3 / math.sqrt(8), rel=1e-8)
    assert power.positive_work == pytest.approx(2 * inertia * (0.4 * SPEED) ** 2, rel=1e-8)
    assert power.negative_work == pytest.approx(-power.positive_work, rel=1e-8)
    assert power.work == pytest.approx(0.0, abs=1e-8) and torque.work is None
    peak, most = inertia * 0.4 * SPEED**2, inertia * 0.4**2 * SPEED**3 / 2
    assert (torque.minimum, torque.maximum) == pytest.approx((-peak, peak), rel=1e-10)
    assert np.sin(SPEED * np.array([torque.minimum_at, torque.maximum_at])) == pytest.approx(
        [1, -1], abs=1e-10
    )
    assert (power.minimum, power.maximum) == pytest.approx((-most, most), rel=1e-10)
    assert np.sin(2 * SPEED * np.array([power.minimum_at, power.maximum_at])) == pytest.approx(
        [1, -1], abs=1e-10
    )
    along = found["B.position.x"]
    assert (along.minimum, along.maximum) == pytest.approx((ARM * math.cos(0.4), ARM), rel=1e-11)


def test_over_a_range_of_the_input_the_means_are_over_time():
    """At w = s + s t/2 a direction is held for a time in inverse proportion to its rate."""
    model = symgen.build(arm("w*t + w*t**2/d", G, ["arm.power", "arm.angular_velocity"]))
    run = model.inverse_dynamics(0.0, 3.0, over="input", samples=13)
    end = run.time[-1]
    assert SPEED * end + SPEED * end**2 / 4 == pytest.approx(3.0)
    assert run.averages()["arm.angular_velocity"].mean == pytest.approx(3.0 / end, rel=1e-9)


def test_lifting_a_weight_by_a_crank_at_constant_speed():
    """Torque m g l cos(angle): it puts in 2 m g l and takes out as much in every revolution."""
    run = symgen.build(arm("w*t", G)).inverse_dynamics(0.0, 2 * np.pi / SPEED, samples=5)
    found = run.averages()
    assert found["arm.torque"].rms == pytest.approx(MASS * G * ARM / math.sqrt(2), rel=1e-9)
    assert found["arm.power"].positive_work == pytest.approx(2 * MASS * G * ARM, rel=1e-8)
    assert found["B.position.x"].mean == pytest.approx(0.0, abs=1e-10)


PULSE = {
    "parameters": {"F": "12 N", "a": "0.3 s", "b": "0.301 s"},
    "points": {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "E": {"at": ["9 m", "0 m"], "ground": True},
        "A": {"at": ["0 m", "0 m"]},
        "B": {"at": ["1 m", "0 m"]},
    },
    "links": {"rail": {"points": ["O", "E"]}, "AB": {"points": ["A", "B"], "mass": "3 kg"}},
    "guides": [{"points": ["A", "B"], "along": "rail"}],
    "forces": [{"point": "A", "force": ["F*(sign(t - a) - sign(t - b))/2", "0 N"]}],
}


@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_a_pulse_of_a_thousandth_of_the_run(method):
    """The force is on a slider at rest: steps end on its jumps, and so do the panels."""
    words = ["forces.0.force", "forces.0.power", "energy", "power"]
    model = symgen.build(symgen.Scene(**PULSE, analysis={"t_end": "1 s", "outputs": words}))
    options = {"step": 0.01} if method == "rk4" else {}
    run = model.simulate(1.0, method=method, samples=2, **options)
    found = run.averages()
    assert found["forces.0.force.x"].mean == pytest.approx(12 * 1e-3, rel=1e-8)
    assert found["forces.0.force.x"].rms == pytest.approx(12 * math.sqrt(1e-3), rel=1e-8)
    assert (found["forces.0.force.x"].minimum, found["forces.0.force.x"].maximum) == (0.0, 12.0)
    assert 0.3 <= found["forces.0.force.x"].maximum_at <= 0.301
    energy = 3 * (12 * 1e-3 / 3) ** 2 / 2
    assert found["energy"].maximum == pytest.approx(energy, rel=1e-8)
    assert found["forces.0.power"].positive_work == pytest.approx(energy, rel=1e-8)
    assert found["energy"].mean == pytest.approx(energy * 0.699 + energy * 1e-3 / 3, rel=1e-8)


def test_the_work_of_all_powers_is_the_change_of_the_energy():
    words = ["energy", "power", "theta1.power"]
    run = symgen.build("cssp", set={"analysis.outputs": words}).simulate(0.7, samples=4)
    energy = run["energy"].values
    assert run.averages()["power"].work == pytest.approx(energy[-1] - energy[0], rel=1e-8)


def test_the_positive_work_of_the_drive_of_a_loop_is_the_sum_of_the_rises_of_its_energy():
    model = symgen.build("rssr", set={"analysis.outputs": ["theta1.power", "energy"]})
    found = model.inverse_dynamics(0.0, 2 * np.pi, samples=9).averages()["theta1.power"]
    energy = model.inverse_dynamics(0.0, 2 * np.pi, samples=20001)["energy"].values
    rises = np.diff(energy)
    assert found.positive_work == pytest.approx(rises[rises > 0].sum(), rel=1e-7)
    assert found.work == pytest.approx(0.0, abs=1e-9)


def test_the_means_are_over_the_recorded_time_and_do_not_depend_on_the_samples():
    model = symgen.build("four_bar")
    whole = model.simulate(1.0, samples=3).averages()
    assert model.simulate(1.0, samples=77).averages() == whole
    parts = [model.simulate(1.0, t_eval=[a, b]).averages() for a, b in ((0.0, 0.4), (0.4, 1.0))]
    for name, of in whole.items():
        split = [x[name] for x in parts]
        assert 0.4 * split[0].mean + 0.6 * split[1].mean == pytest.approx(of.mean, rel=1e-7, abs=1e-9)
        squares = 0.4 * split[0].rms ** 2 + 0.6 * split[1].rms ** 2
        assert math.sqrt(squares) == pytest.approx(of.rms, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize(("power", "known"), [(1.0, [False, False]), (0.25, [True, True])])
def test_an_integral_over_a_pole_has_no_value(power, known):
    """Integrals of |t - 0.3|^-1 and its square from 0 to 1 are infinite, those of |t - 0.3|^-1/4 are not."""

    def integrands(times):
        y = np.abs(times - 0.3) ** -power
        return np.stack([y, y**2, 0 * y, y])[None]

    sums, _ = quadrature.integrals(integrands, np.array([0.0, 1.0]), 1e-4, np.array(["N"]), np.zeros(1))
    assert np.isfinite(sums[0, :2]).tolist() == known
    for x, exponent in zip(sums[0, :2], (power, 2 * power), strict=True) if all(known) else ():
        rest = 1 - exponent
        assert x == pytest.approx((0.3**rest + 0.7**rest) / rest, rel=1e-4)


def test_an_output_of_round_off_alone_has_a_mean_of_zero_within_its_error():
    """The torque of an arm at constant speed is zero; the mean of the reaction is that of 9 N cos(w t)."""
    model = symgen.build(arm("w*t", outputs=("O.reaction.x", "arm.torque", "arm.power")))
    for result in (model.simulate(1.0), model.inverse_dynamics(samples=21)):
        found = result.averages()
        for name in ("arm.torque", "arm.power"):
            if name in found:
                assert abs(found[name].mean) <= found[name].error < 1e-14 and found[name].rms < 1e-14
        exact = -MASS * ARM * SPEED**2 * math.sin(SPEED) / SPEED
        assert abs(found["O.reaction.x"].mean - exact) <= 4 * found["O.reaction.x"].error + 1e-15
        assert 0 < found["O.reaction.x"].error < 1e-9


def test_rough_values_have_a_mean_with_an_honest_error():
    """Values between 0 and 1 without any smoothness: the mean is 1/2, within the error that is stated."""

    def integrands(times):
        y = np.modf(1e9 * times**2)[0]
        return np.stack([y, y**2, 0 * y, y])[None]

    sums, errors = quadrature.integrals(integrands, np.linspace(0, 1, 65), 1e-8, np.array(["N"]), np.zeros(1))
    assert abs(sums[0, 0] - 0.5) <= errors[0, 0] < 0.5
    assert abs(sums[0, 1] - 1 / 3) <= errors[0, 1]


def test_results_without_means_are_refused(tmp_path, swinging):
    run = swinging.simulate(0.5)
    loaded = symgen.load_result(run.save(tmp_path / "run.npz"))
    elastic = symgen.build("elastic_four_bar").simulate(steps=64, samples=5)
    for result in (loaded, elastic, swinging.inverse_dynamics(at=[0.1, 0.2], over="time")):
        with pytest.raises(ResultError, match="have means over time"):
            result.averages()
    with pytest.raises(ResultError, match="expected rtol between"):
        run.averages(rtol=0)


def test_tables_and_json_have_them():
    words = ["--set", 'analysis.outputs=["crank.torque", "crank.power"]']
    line = ["inverse-dynamics", "crank_rocker", *words, "--samples", "37"]
    found = json.loads(CliRunner().invoke(app, [*line, "--json"]).stdout)["outputs"]
    model = symgen.build("crank_rocker", set={"analysis.outputs": ["crank.torque", "crank.power"]})
    fine = model.inverse_dynamics(samples=5001)
    torque, power = (fine[name].values[:-1] for name in ("crank.torque", "crank.power"))
    assert found["crank.torque"]["rms"] == pytest.approx(np.sqrt(np.mean(torque**2)), rel=1e-9)
    assert found["crank.power"]["positive_work"] == pytest.approx(np.mean(np.maximum(power, 0)), rel=1e-5)
    assert "work" not in found["crank.torque"] and found["crank.power"]["work"] == pytest.approx(0, abs=1e-9)
    text = CliRunner().invoke(app, line, env={"COLUMNS": "160"}).stdout
    rows = {row.split()[0]: row.split() for row in text.splitlines() if row.strip()}
    assert rows["output"][-2:] == ["mean", "RMS"]
    assert float(rows["crank.torque"][-1]) == pytest.approx(found["crank.torque"]["rms"], rel=1e-5)
    assert "positive [J]" in text


@pytest.mark.parametrize("samples", [2, 3, 50])
def test_the_work_till_an_event_does_not_depend_on_the_samples(samples):
    """A force of 12 N on a slider of 3 kg from rest, till it has moved 0.5 m."""
    scene = PULSE | {
        "forces": [{"point": "A", "force": ["F", "0 N"]}],
        "events": [{"name": "there", "of": "A.x", "value": "a + d", "ends_run": True}],
        "parameters": {"F": "12 N", "a": "0.3 m", "d": "0.2 m"},
        "analysis": {"t_end": "1 s", "outputs": ["forces.0.power", "A.velocity"]},
    }
    found = symgen.build(symgen.Scene(**scene)).simulate(samples=samples).averages()
    assert found["forces.0.power"].work == pytest.approx(12 * 0.5, rel=1e-8)
    assert found["A.velocity.x"].mean == pytest.approx(math.sqrt(2 * 4 * 0.5) / 2, rel=1e-8)


def test_motions_without_means_say_why():
    run = symgen.build("triple_pendulum").simulate(300.0, samples=11)
    with pytest.raises(ResultError, match="at most 4000 steps have means"):
        run.averages()
    scene = {
        "symgen": 1,
        "parameters": {"w": "1 rad/s", "a": "0.5 s", "M": "500 N*m"},
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "P": {"at": ["1 m", "0 m"]}},
        "links": {"rod": {"points": ["O", "P"], "mass": "1 kg"}},
        "torques": [{"link": "rod", "torque": "M*(1 + sign(t - a))"}],
        "drivers": [{"link": "rod", "angle": "w*t"}],
        "analysis": {"t_end": "1 s", "outputs": ["rod.torque"]},
    }
    model = symgen.build(symgen.Scene(**scene))
    with pytest.raises(ResultError, match=r"of times from 0 on, got a range from -0.5 s"):
        model.inverse_dynamics(over="time", start=-0.5, stop=1.0).averages()


@pytest.mark.parametrize("verb", ["kinematics", "inverse_dynamics"])
def test_a_rise_by_a_profile_and_a_torque_that_jumps(verb):
    """Panels end where the rise begins and ends: means of t^n and its derivatives by hand, exact per panel."""
    begin, time, end = 0.123, 0.456, 1.0
    motion = f"profile.poly345((t - {begin}*T)/({time}*T))"
    names = ["arm.angular_velocity", "arm.angular_acceleration", "arm.torque"]
    data = {
        "parameters": {"T": "1 s", "M": "3 N*m"},
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "B": {"at": ["0.5 m", "0 m"]}},
        "links": {"arm": {"points": ["O", "B"], "mass": "0 kg"}},
        "masses": [{"point": "B", "mass": f"{MASS} kg"}],
        "torques": [{"link": "arm", "torque": "M*(1 + sign(t - 0.777*T))"}],
        "drivers": [{"link": "arm", "angle": motion}],
        "analysis": {"t_end": f"{end} s", "outputs": names},
    }
    found = getattr(symgen.build(symgen.Scene(**data)), verb)(over="time", samples=7).averages(1e-10)
    if verb == "kinematics":
        names = ["arm.rate", "arm.acceleration"]
    assert found[names[0]].mean == pytest.approx(1 / end, rel=1e-12)
    assert found[names[0]].rms ** 2 == pytest.approx(10 / 7 / time / end, rel=1e-12)
    assert found[names[1]].rms ** 2 == pytest.approx(120 / 7 / time**3 / end, rel=1e-12)
    if verb == "inverse_dynamics":  # the drive balances 6 N m behind 0.777 s, and inertia of no mean
        assert found[names[2]].mean == pytest.approx(-6 * (end - 0.777) / end, rel=1e-12)


def test_printed_extremes_do_not_depend_on_samples():
    """The slider of the Whitworth mechanism returns at 180 mm and 300 mm, and two samples see neither."""
    for samples in ("2", "40"):
        arguments = ["run", "whitworth", "--samples", samples]
        shown = CliRunner().invoke(app, arguments).stdout
        row = next(line.split() for line in shown.splitlines() if line.startswith("S.position.x"))
        assert "extremes of the motion" in shown and (row[3], row[5]) == ("180", "300")
        of = json.loads(CliRunner().invoke(app, [*arguments, "--json"]).stdout)["outputs"]["S.position.x"]
        assert (of["minimum"], of["maximum"]) == pytest.approx((0.18, 0.3), rel=1e-9)
        plain = CliRunner().invoke(app, [*arguments, "--no-means"]).stdout
        assert f"extremes of {samples} samples" in plain


def test_extremes_of_poses_are_those_of_the_poses():
    """A quarter of a revolution per pose passes both dead centres of the slider between poses."""
    arguments = ["kinematics", "whitworth", "--of", "S", "--samples", "5", "--json"]
    of = json.loads(CliRunner().invoke(app, arguments).stdout)["outputs"]["S.position.x"]
    poses = symgen.build("whitworth").kinematics(samples=5)["S.position"].values[:, 0]
    assert (of["minimum"], of["maximum"]) == pytest.approx((poses.min(), poses.max()), rel=1e-12)
    assert of["maximum"] < 0.2999


def test_means_through_losses_of_rank_are_those_of_the_pendulum():
    """Cranks in line with the coupler, whose centre is beside its middle: forces of two of them have poles there."""
    angle, model = float(np.arctan2(-0.8, 0.6)), symgen.build("double_four_bar")
    start = model.state({"AB.angle": angle}, {"AB.angle": 8.0})

    def rates(_, y):
        return [y[1], -9.81 * 3.5 / (2 / 3 + 0.34 + 2) * np.cos(y[0]), np.sin(y[0]), np.sin(y[0]) ** 2]

    followed = solve_ivp(rates, (0, 1), [angle, 8, 0, 0], "DOP853", rtol=1e-13, atol=1e-13, dense_output=True)
    run = model.simulate(1.0, state=start, samples=10_001, rtol=1e-10)  # many of them next to the poles
    assert np.max(np.abs(run["B.position"][:, 1] - np.sin(followed.sol(run.time)[0]))) < 1e-9
    found = run.averages()
    assert found["B.position.y"].mean == pytest.approx(followed.y[2, -1], abs=3e-9)
    assert found["B.position.y"].rms == pytest.approx(followed.y[3, -1] ** 0.5, abs=3e-9)
    assert found["B.position.y"].maximum == pytest.approx(1.0, abs=1e-9)
    assert np.isnan(found["AB.tension"].mean)
    assert np.isfinite(found["DC.tension"].mean)
