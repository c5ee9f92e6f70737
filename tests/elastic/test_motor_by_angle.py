"""Motors whose torque rises with the angle of the crank, and springs that push the structure away."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen
from symgen.errors import ModelError

#: A stiff strip on a shaft with a flywheel, driven by a torque that rises with the angle from -pi/2 to pi/2.
STRIP = """
symgen = 1
[parameters]
speed = "240 rpm"
stall = "6 N*m"
ripple = "4 N*m"
[points]
O = { at = ["0 m", "0 m"], ground = true }
T = { at = ["0.3 m", "0 m"] }
[links.strip]
points = ["O", "T"]
density = "7850 kg/m^3"
section = { width = "30 mm", thickness = "10 mm" }
elastic = { E = "210 GPa", elements = 2, damping = { ratio = 0.02 } }
[crank]
link = "strip"
speed = "speed"
mode = "motor"
torque = "stall*(1 - this.rate/speed) + ripple*sin(this.angle)"
flywheel = "0.05 kg*m^2"
"""
SPEED, INERTIA = 8 * np.pi, 0.05 + 7850 * 0.03 * 0.01 * 0.3**3 / 3


def built(text=STRIP):
    return symgen.build(symgen.Scene(**tomllib.loads(text)))


def test_such_a_motor_turns_its_crank():
    run = built().simulate(t_end=0.2, samples=41)
    exact = solve_ivp(
        lambda t, y: [y[1], (6 * (1 - y[1] / SPEED) + 4 * np.sin(y[0])) / INERTIA],
        (0, 0.2),
        [0, SPEED],
        t_eval=np.linspace(0, 0.2, 41),
        rtol=1e-9,
        atol=1e-9,
    ).y[0]
    assert np.max(np.abs(exact - SPEED * run.times)) > 0.1  # the torque is felt
    x, y = run["T.position"].values.T
    assert np.unwrap(np.arctan2(y, x)) == pytest.approx(exact, abs=2e-3)


def test_its_torque_is_no_spring_of_the_structure():
    """At rest the crank is free; in motion the torque's slope is a stiffness, with a growing motion at first."""
    motor, even = built(), built(STRIP.replace(" + ripple*sin(this.angle)", ""))
    for angle in (0.0, 2.0):
        assert motor.modes(at=angle).frequencies == pytest.approx(even.modes(at=angle).frequencies, rel=1e-9)
    assert motor.lowest_frequency == pytest.approx(even.lowest_frequency, rel=1e-9)
    # the rigid motion phi of the crank: I s^2 + (stall/speed) s - ripple cos(angle) = 0
    drag = 6 / SPEED
    grows = (-drag + np.sqrt(drag**2 + 4 * INERTIA * 4)) / (2 * INERTIA)
    assert np.max(motor.modes(moving=True).growth) == pytest.approx(grows, rel=1e-3)


def test_a_spring_at_an_unstable_pose_does_not_stop_a_run():
    """A compressed spring past the tip pushes the structure away in one pose of the revolution."""

    spring = '[[springs]]\nbetween = ["T", "G"]\nstiffness = "1 N/mm"\nlength = "0.5 m"\n[crank]'
    lines = [line for line in STRIP.splitlines() if not line.startswith(("torque", "flywheel", "mode"))]
    text = "\n".join(lines).replace('"10 mm"', '"2 mm"').replace("[crank]", spring)
    text = text.replace(", damping = { ratio = 0.02 }", "")
    text = text.replace("\n[links.strip]", '\nG = { at = ["0.5 m", "0 m"], ground = true }\n[links.strip]')
    model = built(text)
    with pytest.raises(ModelError, match="unstable at rest in this pose"):
        model.modes()
    ends = np.linspace(0.0, 0.002, 3)
    seen = model.simulate(t_end=0.002, samples=3)["T.displacement"].values
    across = np.cos(SPEED * ends) * seen[:, 1] - np.sin(SPEED * ends) * seen[:, 0]
    assert across == pytest.approx(pushed_away(ends), rel=1e-2)


def pushed_away(times):
    """Deflection of the tip of the strip, thin, in its frame: Galerkin's method with polynomials x^2 to x^7."""
    rho, bending, length = 7850 * 0.03 * 0.002, 210e9 * 0.03 * 0.002**3 / 12, 0.3
    x, weights = np.polynomial.legendre.leggauss(12)
    x, weights = length * (x + 1) / 2, length * weights / 2
    powers = np.arange(2, 8)[:, None]
    w, slope, curvature = x**powers, powers * x ** (powers - 1), powers * (powers - 1) * x ** (powers - 2)
    mass, stiff = (rho * weights * w) @ w.T, (bending * weights * curvature) @ curvature.T
    stiff += (weights * rho * SPEED**2 / 2 * (length**2 - x**2) * slope) @ slope.T - SPEED**2 * mass
    tip, pull = length ** powers[:, 0], (weights * slope) @ slope.T

    def rates(t, y):
        a, v = np.split(y, 2)
        along = length - 0.5 * np.cos(SPEED * t), a @ tip + 0.5 * np.sin(SPEED * t)
        gap = np.hypot(*along)
        force = 1000 * (0.5 - gap) * np.array(along) / gap
        return np.concatenate([v, np.linalg.solve(mass, force[1] * tip - (stiff + force[0] * pull) @ a)])

    found = solve_ivp(
        rates, (0, times[-1]), np.zeros(12), t_eval=times, method="LSODA", rtol=1e-8, atol=1e-14
    )
    return tip @ found.y[:6]
