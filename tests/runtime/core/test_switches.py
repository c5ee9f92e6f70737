"""Switching points of loads: steps end on jumps and kinks, each step on one branch of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, SceneError, SimulationError

SCENE = (Path(__file__).parents[2] / "cases" / "sliding_mass.toml").read_text()
MASS, STIFFNESS, FRICTION, START = 2.0, 50.0, 3.0, 0.5
DRY = "-k*A.x - F*sign(A.vx)"


def build(tmp_path, force, speed="0 m/s", backend="numpy", **options):
    """Build the mass of 2 kg, at 0.5 m at the start, under a force along x."""
    text = SCENE.replace(DRY, force).replace("0 m/s", speed, 1)
    (tmp_path / "scene.toml").write_text(text)
    return symgen.build(tmp_path / "scene.toml", backend=backend, **options)


def dry_oscillation(t):
    """Return position and velocity at times: half swings about F/k and -F/k in turn (Coulomb friction)."""
    rate, shift = math.sqrt(STIFFNESS / MASS), FRICTION / STIFFNESS
    half = np.floor(t * rate / math.pi)
    side = np.where(half % 2 == 0, 1.0, -1.0)  # it moves towards -x first
    amplitude = START - shift * (1 + 2 * half)
    phase = t * rate - half * math.pi
    return side * (shift + amplitude * np.cos(phase)), -side * amplitude * rate * np.sin(phase)


def last(run, what="position"):
    return run.variable(f"A.{what}").values[-1, 0]


METHODS = [
    ({"rtol": 1e-11}, 1e-9),
    ({"method": "dopri5", "rtol": 1e-10}, 1e-8),
    ({"method": "radau5", "rtol": 1e-10}, 1e-8),
    ({"step": 2e-3}, 1e-9),
    ({"method": "rattle", "step": 5e-4}, 2e-6),
    ({"method": "rattle4", "step": 2e-3}, 1e-8),
    ({"method": "newmark", "step": 5e-4}, 2e-6),
    ({"stabilisation": "raw", "rtol": 1e-11}, 1e-9),
]


@pytest.mark.parametrize(("options", "tolerance"), METHODS, ids=str)
def test_dry_friction_is_followed_through_reversals(options, tolerance, tmp_path):
    run = build(tmp_path, DRY, backend="auto").simulate(2.0, samples=41, **options)
    x, v = dry_oscillation(run.time)
    assert run.variable("A.position").values[:, 0] == pytest.approx(x, abs=tolerance)
    assert run.variable("A.velocity").values[:, 0] == pytest.approx(v, abs=10 * tolerance)
    assert any(
        "3 switching points" in note and "sign(A.vx) in [[forces]] no. 1" in note for note in run.notes
    )


def test_fixed_steps_keep_their_order_over_jumps(tmp_path):
    """Errors of rk4 fall as the fourth power of the step: as without a jump, and not as the step."""
    model = build(tmp_path, DRY, backend="auto")
    errors = [
        abs(last(model.simulate(2.0, method="rk4", step=h)) - dry_oscillation(2.0)[0])
        for h in (0.02, 0.01, 0.005)
    ]
    assert 8 < errors[0] / errors[1] < 32
    assert 8 < errors[1] / errors[2] < 32


@pytest.mark.parametrize(
    "options", [{}, {"step": 1e-2}, {"method": "radau5"}, {"method": "rattle", "step": 1e-2}]
)
@pytest.mark.parametrize(
    "force",
    [
        "F*(sign(t - b) - sign(t - b - w))/2",
        "F*max(0, 1 - abs((t - b)/w))",
        "F*max(0, min((t - b)/w, 2 - (t - b)/w))",
        "F*((t - b)/abs(t - b) - (t - b - w)/abs(t - b - w))/2",
        "F*(abs(t - b + w) - 2*abs(t - b) + abs(t - b - w))/(2*w)",
    ],
)
def test_a_pulse_shorter_than_a_step_is_not_missed(force, options, tmp_path):
    """3 N for 1e-4 s, as a rectangle or a triangle, on 2 kg."""
    run = build(tmp_path, force).simulate(1.0, **options)
    assert last(run, "velocity") == pytest.approx(3e-4 / MASS, rel=1e-9)


def test_smooth_pulses_are_met_by_a_longest_step(tmp_path):
    run = build(tmp_path, "F*exp(-((t - b)/w)**2)", backend="auto").simulate(1.0, max_step=2e-4)
    assert last(run, "velocity") == pytest.approx(3e-4 * math.sqrt(math.pi) / MASS, rel=1e-6)
    assert run.statistics["steps"] >= 5000


def test_a_square_wave_switches_at_each_of_its_jumps(tmp_path):
    run = build(tmp_path, "F*sign(sin(t/(10*w)))").simulate(1.0)
    assert any("318 switching points" in note for note in run.notes)
    rest = 1.0 - 318 * math.pi / 1000  # 159 whole periods bring no speed
    assert last(run, "velocity") == pytest.approx(FRICTION / MASS * rest, rel=1e-8)


@pytest.mark.parametrize("precision", ["float32", "longdouble", "float128"])
def test_switching_points_in_other_types(precision, tmp_path):
    run = build(tmp_path, DRY, backend="auto", precision=precision).simulate(2.0)
    assert last(run) == pytest.approx(dry_oscillation(2.0)[0], abs=1e-3 if precision == "float32" else 1e-7)


@pytest.mark.parametrize(("speed", "expected"), [("-1 m/s", -1 / 7), ("1 m/s", 1 / 7), ("0 m/s", 0.0)])
def test_drag_has_a_kink_but_nothing_to_stick_to(speed, expected, tmp_path):
    """2 kg v' = -12 kg/m v|v| over 1 s: v = v0/(1 + 6 |v0| t); at rest it stays at rest."""
    text = SCENE.replace("[points]", 'c = "12 kg/m"\n[points]').replace(DRY, "-c*A.vx*abs(A.vx)")
    (tmp_path / "scene.toml").write_text(text.replace("0 m/s", speed, 1))
    run = symgen.build(tmp_path / "scene.toml", backend="numpy").simulate(1.0)
    assert last(run, "velocity") == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("options", [{}, {"step": 1e-2}, {"method": "radau5"}])
def test_friction_at_rest_is_refused_with_the_smooth_alternative(options, tmp_path):
    """The mass comes to rest where |x| < F/k = 0.06 m: after 4 half swings, at x = 0.02 m."""
    said = r"stays at the jump of sign\(A\.vx\) in \[\[forces\]\] no\. 1.*\n.*tanh\(A\.vx/w\)"
    with pytest.raises(SimulationError, match=said) as error:
        build(tmp_path, DRY).simulate(5.0, **options)
    assert error.value.time == pytest.approx(4 * math.pi / 5, abs=1e-4)
    assert error.value.partial.final["A"]["position"][0] == pytest.approx(0.02, abs=1e-4)
    with pytest.raises(SimulationError, match=r"stays at the jump .* at t = 0 s"):
        build(tmp_path, "-F*sign(A.vx)").simulate(1.0, **options)


def test_runs_with_switching_points_are_resumed_to_the_bit(tmp_path):
    model, file = build(tmp_path, DRY, backend="auto"), tmp_path / "run.ckpt"
    whole = model.simulate(2.0, step=1e-3)
    with pytest.raises(SimulationError, match="max_steps"):
        model.simulate(2.0, step=1e-3, max_steps=900, checkpoint=file, checkpoint_every=1e-9)
    resumed = model.simulate(2.0, step=1e-3, resume=file)
    assert np.array_equal(whole.variable("A.position").values, resumed.variable("A.position").values)


@pytest.mark.parametrize("motion", ["abs(v*t)", "min(v*t, l)", "l*sign(t - b)"])
def test_a_prescribed_motion_has_no_jumps(motion, tmp_path):
    text = SCENE.replace("[points]", 'v = "1 m/s"\nl = "1 m"\n[points]')
    text = text.replace("P = { at", f'P = {{ motion = ["{motion}", "0 m"], at')
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(SceneError, match="its value or rate jumps where the argument of"):
        symgen.build(tmp_path / "bad.toml", backend="numpy")


IN_SPACE = """
symgen = 1
title = "Pendulum with dry friction, written in space"
[parameters]
c = { value = "0.2 N", tunable = true }
[points]
O = { at = ["0 m", "0 m", "0 m"], ground = true }
A = { at = ["1 m", "0 m", "0 m"] }
[links]
OA = { points = ["O", "A"], mass = "3 kg" }
[gravity]
acceleration = ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]
[[forces]]
point = "A"
force = ["0 N", "0 N", "-c*sign(A.vz)"]
[analysis]
t_end = "1 s"
"""


def test_branches_are_no_parameters_that_users_change(tmp_path):
    """Neither by name, nor where the model in space is asked, whose loads have no branches."""
    (tmp_path / "scene.toml").write_text(IN_SPACE)
    model = symgen.build(tmp_path / "scene.toml", backend="numpy")
    with pytest.raises(ModelError, match="no tunable parameter 'switch_0'. Known: c"):
        model.with_parameters(switch_0=1.0)
    changed = model.with_parameters(c=0.1)
    assert len(changed.simulate().notes) == 1
    # A rod on a ball joint: a pendulum in two planes, sqrt(3 g / (2 l)).
    stable = changed.equilibrium(stable=True)
    assert changed.modes(stable).frequencies == pytest.approx([math.sqrt(1.5 * 9.81) / (2 * math.pi)] * 2)
