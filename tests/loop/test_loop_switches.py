"""Switching points of loads on loops under forces: steps end on jumps and kinks, as those of linkages do.

The parallelogram without gravity has the constant inertia of its cranks and of its coupler's mass on the crank's
circle, so that its crank moves as one mass does: every trajectory has a closed form.
"""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.scene.loading import shipped_scene

CASE = (Path(__file__).parents[1] / "cases" / "free_par.toml").read_text()
INERTIA = 2 * (8e-4 + 1.0 * 0.05**2) + 3.0 * 0.1**2
RATE, OFFSET, START, MIDDLE = 5.0, 0.06, 0.5, 2.0
PARAMETERS = f"""
[parameters]
k = {{ value = "{INERTIA * RATE**2!r} N*m", tunable = true }}
f = "{INERTIA * RATE**2 * OFFSET!r} N*m"
q0 = "{MIDDLE} rad"
b = "0.4321 s"
force = "0.5 N"
w = "1e-4 s"
[loop]"""
DRY = "-k*(q - q0) - f*sign(q.rate)"


def build(tmp_path, drive="", load="", at=MIDDLE + START, rate="0", backend="numpy"):
    text = CASE.replace("[loop]", PARAMETERS, 1).replace('"120 deg"', f'"{at} rad"')
    text = (
        text.replace('angle = "deg"', 'angle = "rad"')
        .replace('"6 rad/s"', f'"{rate} rad/s"')
        .replace('"-9.81 m/s^2"', "0")
    )
    start = {"theta2": math.pi - at, "theta3": at, "theta4": math.pi - at}
    guess = ", ".join(f'{name} = "{value} rad"' for name, value in start.items())
    text = re.sub("start = .*", f"start = {{ {guess} }}", text)
    text += f'\n[loop.drives]\nq = "{drive}"\n' if drive else ""
    text += load
    (tmp_path / "scene.toml").write_text(text)
    return symgen.build(tmp_path / "scene.toml", backend=backend)


def dry_oscillation(t):
    """Return angle and rate at times: half swings about the offset on either side in turn (Coulomb friction)."""
    half = np.floor(t * RATE / math.pi)
    side = np.where(half % 2 == 0, 1.0, -1.0)
    amplitude, phase = START - OFFSET * (1 + 2 * half), t * RATE - half * math.pi
    return MIDDLE + side * (OFFSET + amplitude * np.cos(phase)), -side * amplitude * RATE * np.sin(phase)


@pytest.mark.parametrize(
    ("options", "tolerance"),
    [
        ({"rtol": 1e-11, "atol": 1e-12}, 1e-9),
        ({"method": "taylor", "rtol": 1e-11, "atol": 1e-12}, 1e-9),
        ({"method": "dopri5", "rtol": 1e-10}, 1e-8),
        ({"step": 2e-3}, 1e-8),
    ],
    ids=str,
)
def test_dry_friction_is_followed_through_reversals(options, tolerance, tmp_path):
    backend = "c" if options.get("method") == "taylor" else "numpy"
    run = build(tmp_path, DRY, backend=backend).simulate(1.4, samples=41, **options)
    angle, rate = dry_oscillation(run.time)
    assert run["q"].values == pytest.approx(angle, abs=tolerance)
    assert run["q.rate"].values == pytest.approx(rate, abs=10 * tolerance)
    (note,) = [note for note in run.notes if "switching" in note]
    assert "2 switching points" in note
    assert "sign(q.rate) in the drive of q" in note


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_a_drive_by_a_table_does_the_work_of_its_lines(method, tmp_path):
    """An effort by straight lines over the angle: its work is a sum of trapezoids."""
    build(tmp_path, drive=DRY, rate="3")
    file = tmp_path / "scene.toml"
    points = [(2.0, 0.01), (2.6, 0.05), (2.9, -0.04), (3.05, 0.02)]
    x, y = ([f"{p[i]} {unit}" for p in points] for i, unit in enumerate(("rad", "N*m")))
    text = file.read_text().replace(DRY, "law(q)")
    file.write_text(f"{text}\n[tables]\nlaw = {{ x = {x}, y = {y} }}\n")
    run = symgen.build(file).simulate(0.2, samples=3, method=method, rtol=1e-12, atol=1e-13)
    angle, grid = run["q"].values[-1], [MIDDLE + START, 2.6, 2.9, 3.05]
    ends = [*(a for a in grid if a < angle), angle]
    work = np.trapezoid(np.interp(ends, *zip(*points, strict=True)), ends)
    assert angle > 3.05
    assert INERTIA * (run["q.rate"].values[-1] ** 2 - 9) / 2 == pytest.approx(work, abs=1e-11)
    (note,) = [note for note in run.notes if "switching" in note]
    assert "3 switching points (law(q) in the drive of q)" in note


def test_a_load_on_a_link_has_switching_points(tmp_path):
    """A force along the ground at the coupler, F sign(t - b): its work in a closed form of the crank's angle."""
    load = '\n[[loop.loads]]\nlink = "l2"\nat = [0, 0, 0]\nforce = ["force*sign(t - b)", 0, 0]\nframe = "ground"\n'
    run = build(tmp_path, load=load, rate="3").simulate(1.0, samples=3, rtol=1e-11, atol=1e-12)
    middle = build(tmp_path, load=load, rate="3").simulate(0.4321, samples=3, rtol=1e-11, atol=1e-12)
    start, at, end = MIDDLE + START, middle["q"].values[-1], run["q"].values[-1]
    work = 0.1 * 0.5 * (math.cos(start) - math.cos(at) + math.cos(end) - math.cos(at))
    assert INERTIA * run["q.rate"].values[-1] ** 2 / 2 == pytest.approx(INERTIA * 9 / 2 + work, rel=1e-9)
    assert abs(work) > 1e-4
    assert any("1 switching point (sign(t" in note for note in run.notes)
    assert any("in [[loop.loads]] no. 1" in note for note in run.notes)


@pytest.mark.parametrize("options", [{}, {"step": 1e-2}])
@pytest.mark.parametrize(
    ("drive", "impulse"),
    [
        ("f*(sign(t - b) - sign(t - b - w))/2", 1.0),
        ("f*max(0, 1 - abs((t - b)/w))", 1.0),
        ("f*exp(-((t - b)/w)**2)", math.sqrt(math.pi)),
    ],
)
def test_a_pulse_shorter_than_a_step_is_not_missed(drive, impulse, options, tmp_path):
    if "exp" in drive and options:
        pytest.skip("fixed steps end in the middle of a smooth pulse, and are as long as before on its sides")
    run = build(tmp_path, drive).simulate(1.0, **options)
    rate = INERTIA * RATE**2 * OFFSET * 1e-4 * impulse / INERTIA
    assert run["q.rate"].values[-1] == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("options", [{}, {"step": 1e-2}])
def test_friction_at_rest_is_refused_with_the_smooth_alternative(options, tmp_path):
    said = r"stays at the jump of sign\(q\.rate\) in the drive of q.*\n.*tanh\(q\.rate/w\).*1e-3 rad/s"
    with pytest.raises(SimulationError, match=said) as error:
        build(tmp_path, DRY).simulate(5.0, **options)
    assert error.value.time == pytest.approx(4 * math.pi / 5, abs=1e-4)
    assert error.value.partial.final["q"]["value"] == pytest.approx(MIDDLE + 0.02, abs=1e-4)
    assert "radau5" not in str(error.value)


def test_runs_with_switching_points_are_resumed_to_the_bit(tmp_path):
    model, file = build(tmp_path, DRY), tmp_path / "run.ckpt"
    whole = model.simulate(1.4, step=1e-3)
    with pytest.raises(SimulationError, match="max_steps"):
        model.simulate(1.4, step=1e-3, max_steps=900, checkpoint=file, checkpoint_every=1e-9)
    resumed = model.simulate(1.4, step=1e-3, resume=file)
    assert np.array_equal(whole["q"].values, resumed["q"].values)


def test_branches_are_no_parameters_that_users_change(tmp_path):
    model = build(tmp_path, DRY)
    with pytest.raises(ModelError, match="no tunable parameter 'switch_0'. Known: k"):
        model.with_parameters(switch_0=1.0)
    assert [p.name for p in model.description.tunable] == ["k"]


MOVED = "way*(1 + t/T)"


def moved(law, **values):
    """The shipped crank against a pump, its shaft moved along its axis."""
    written = tomllib.loads(shipped_scene("cssp"))
    numbers = {"way": "1 cm", "T": "0.05 s", "t1": "0.033 s", "k": {"value": 1.0, "tunable": True}}
    written["parameters"] |= numbers
    del written["loop"]["free"]["S1"], written["loop"]["drives"]["S1"]
    written["loop"]["inputs"] = {"S1": law}
    return symgen.build(symgen.Scene(**written)).with_parameters(**values)


@pytest.mark.parametrize(
    "options", [{"method": "taylor"}, {"method": "dop853"}, {"method": "rk4", "step": 1e-3}]
)
def test_steps_end_where_an_input_has_another_piece(options):
    """Against a run with each of the two pieces, the second from the end of the first."""
    later = f"{MOVED} + way*max(t - t1, 0*t1)**2/T**2"
    run = moved(later).simulate(0.1, samples=2, **options)
    fine = {"method": "dop853", "rtol": 1e-12, "atol": 1e-14, "samples": 2}
    first = moved(MOVED).simulate(0.033, **fine).final["theta1"]
    second = moved(f"{MOVED} + way*(t - t1)**2/T**2")
    begun = second.state({"theta1": first["value"]}, {"theta1": first["rate"]}, t=0.033)
    expected = second.simulate(0.1, state=begun, **fine).final
    for name in ("theta1", "S4"):
        assert run.final[name]["value"] == pytest.approx(expected[name]["value"], abs=3e-9)
        assert run.final[name]["rate"] == pytest.approx(expected[name]["rate"], abs=3e-7)
    assert run.notes[-1] == "steps end on 1 switching point (sign(t - 0.033) in the motion of S1)"


def test_an_input_whose_rate_jumps_by_a_tunable_parameter_ends_a_run():
    law = "way*(2 + (mod(t, T)*(T - mod(t, T))/T**2)**2 + (k - 1)*mod(t, T)*(T - mod(t, T))/T**2)"
    moved(law).simulate(0.1)
    moved(law, k=1.5).simulate(0.049)
    with pytest.raises(
        SimulationError, match=r"or its rate, jumps with mod\(t, 0.05\) in the motion of S1 at t = 0.05 s"
    ):
        moved(law, k=1.5).simulate(0.1)
    with pytest.raises(
        ModelError, match=r"not available for inputs in pieces: mod\(t, 0.05\) in the motion of S1"
    ):
        moved(law).sensitivity(["S4"], ["k"], t_end=0.02)
