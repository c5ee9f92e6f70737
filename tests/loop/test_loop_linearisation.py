"""State-space models of free loops against the equation of a linkage of one freedom, in 40 digits."""

from __future__ import annotations

from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

import symgen
from symgen.errors import CapabilityError, ModelError

CRANK, COUPLER, ROCKER, BASE = map(mp.mpf, ("0.1", "0.35", "0.3", "0.4"))
DENSITY, GRAVITY = 1, mp.mpf("9.81")


def joints(angle):
    """Ends of the crank and of the coupler, B to the left of the way from A to C."""
    a = mp.mpc(CRANK * mp.cos(angle), CRANK * mp.sin(angle))
    across = BASE - a
    distance = mp.fabs(across)
    along = (COUPLER**2 - ROCKER**2 + distance**2) / (2 * distance)
    return a, a + mp.mpc(along, mp.sqrt(COUPLER**2 - along**2)) * across / distance


def acceleration(angle, rate, size=1):
    """From T = m(theta) theta'^2 / 2 and V(theta): theta'' = -(m' theta'^2 / 2 + V' / size) / m."""

    def mass(x):
        a, b = (mp.diff(lambda y: joints(y)[0], x), mp.diff(lambda y: joints(y)[1], x))
        squares = [mp.fabs(v) ** 2 for v in (a, b)]
        of_coupler = COUPLER * (squares[0] + squares[1] + (a * mp.conj(b)).real)
        return DENSITY * (CRANK * squares[0] + of_coupler + ROCKER * squares[1]) / 3

    def potential(x):
        a, b = joints(x)
        moments = CRANK * a.imag + COUPLER * (a.imag + b.imag) + ROCKER * b.imag
        return DENSITY * GRAVITY * moments / 2

    return -(mp.diff(mass, angle) * rate**2 / 2 + mp.diff(potential, angle) / size) / mass(angle)


@pytest.mark.parametrize(
    ("size", "unit", "density"), [("0.1", "5 mm", "1e9 kg/m"), ("100", "5 m", "1e-9 kg/m")]
)
def test_a_free_planar_loop_in_motion_has_the_state_space_model_of_one_freedom(size, unit, density):
    free = {"loop.inputs": {}, "loop.free": {"theta1": {"at": "40 deg", "rate": "2 rad/s"}}}
    scale = {"parameters.unit": unit, "parameters.density": density}
    found = symgen.build("planar_4r", set={**free, **scale, "analysis.t_end": "1 s"}).linearise(
        outputs=["theta1", "theta1.acceleration", "theta1"]
    )
    with mp.workdps(40):
        angle, rate, size = mp.pi * 2 / 9, mp.mpf(2), mp.mpf(size)
        second = float(acceleration(angle, rate, size))
        slopes = [
            float(mp.diff(lambda x: acceleration(x, rate, size), angle)),
            float(mp.diff(lambda w: acceleration(angle, w, size), rate)),
        ]
    assert found.states == ("theta1", "theta1'") and found.inputs == ()
    assert found.rates == pytest.approx([2.0, second], rel=1e-11)
    assert pytest.approx(np.array([[0.0, 1.0], slopes]), rel=1e-11) == found.A
    assert pytest.approx(np.array([[1.0, 0.0], slopes]), rel=1e-11) == found.C
    assert found.y[1] == pytest.approx(second, rel=1e-11)


def test_driven_loops_have_no_state():
    with pytest.raises(CapabilityError, match=r"no state is free to deviate(.|\n)*loop\.free"):
        symgen.build("planar_4r").linearise()


@pytest.mark.full
def test_a_pole_of_the_angles_of_a_ball_is_named():
    scene = Path(__file__).parents[1] / "cases" / "ball_poles.toml"
    pose = {"parameters.offset.value": "0.3 m", "loop.free.theta1.at": "180 deg"}
    with pytest.raises(ModelError, match="angles theta2, eta3 of a ball joint have a pole there"):
        symgen.build(scene, set=pose).linearise()


def test_a_loop_without_inputs_has_outputs_and_no_columns_of_inputs():
    """dS4 by the state has the rates of S4 along the coordinates: C xdot is the rate of S4."""
    found = symgen.build("cssp").linearise(0.3, outputs=["S4", "S4.rate"])
    assert found.D.shape == (2, 0) and found.B.shape == (4, 0)
    assert found.C[0] @ found.rates == pytest.approx(found.y[1], rel=1e-9)
