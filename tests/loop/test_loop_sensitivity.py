"""Derivatives of driven loops by parameters, against closed forms differentiated in 40 digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

import symgen
from symgen.errors import ModelError

INCH, POUND = mp.mpf("0.0254"), mp.mpf("4.4482216152605")
CRANK, ROD = 12 * INCH, 50 * INCH
ROD_MASS, SLIDER_MASS = (mp.mpf("0.28") / mp.mpf("386.4") * POUND / INCH * x for x in (50 * mp.pi, 27))
ROD_INERTIA = ROD_MASS * (3 * INCH**2 + ROD**2) / 12


def slider(angle, offset):
    """Place of the slider; with alpha4 = 270 deg and S1 = 0 the loop is in a plane, the crank from its normal."""
    return CRANK * mp.sin(angle) + mp.sqrt(ROD**2 - (CRANK * mp.cos(angle) + offset) ** 2)


def torque(angle, offset, speed):
    """Derivative of the kinetic energy by the angle at constant speed; the energy of the crank is constant."""

    def energy(x):
        def rate(f):
            return speed * mp.diff(f, x)

        along = rate(lambda y: (CRANK * mp.sin(y) + slider(y, offset)) / 2)
        across = rate(lambda y: (CRANK * mp.cos(y) - offset) / 2)
        turning = rate(lambda y: mp.asin((CRANK * mp.cos(y) + offset) / ROD))
        sliding = rate(lambda y: slider(y, offset))
        of_rod = ROD_MASS * (along**2 + across**2) + ROD_INERTIA * turning**2
        return (of_rod + SLIDER_MASS * sliding**2) / 2

    return mp.diff(energy, angle)


def test_positions_and_torque_of_a_slider_crank_have_exact_derivatives():
    t, offset, speed = mp.mpf(0.2), 10 * INCH, 50 * 2 * mp.pi / 60
    found = symgen.build("slider_crank", set={"a4": "10 in"}).sensitivity(
        ["S4", "theta1.drive"], ["a4", "rpm"], at=0.2
    )
    with mp.workdps(40):
        angle = speed * t
        values = [slider(angle, offset), torque(angle, offset, speed)]
        by_offset = [
            mp.diff(lambda e: slider(angle, e), offset),
            mp.diff(lambda e: torque(angle, e, speed), offset),
        ]
        by_speed = [
            mp.diff(lambda w: slider(w * t, offset), speed),
            mp.diff(lambda w: torque(w * t, offset, w), speed),
        ]
    assert found.values == pytest.approx(np.array(values, dtype=float), rel=1e-12)
    assert found.derivatives[:, 0] == pytest.approx(np.array(by_offset, dtype=float), rel=1e-11)
    assert found.derivatives[:, 1] == pytest.approx(np.array(by_speed, dtype=float), rel=1e-11)
    assert found["S4", "a4"] == found.derivatives[0, 0] and found.units["theta1.drive"] == "N*m"


def test_redundant_closure_determines_some_derivatives():
    """A planar loop has three redundant closure equations: they hold for its lengths, not for an offset."""
    model = symgen.build(
        "planar_4r",
        set={
            "parameters.coupler": {"value": "0.35 m", "tunable": True},
            "parameters.h": {"value": "0 m", "tunable": True},
            "parameters.modulus": {"value": "200 GPa", "tunable": True},
            "parameters.nominal": "200 GPa",
            "parameters.compliance": "1e-15 m/Pa",
            "loop.rows.0.S": "h + compliance*(modulus - nominal)",
        },
    )
    found = model.sensitivity(
        ["theta4", "rocker.joint3.force.x", "theta1.drive"], ["coupler", "speed"], at=0.1
    )

    def angle(coupler):
        """Direction of the rocker by the triangle that the diagonal forms with coupler and rocker."""
        crank = mp.mpf(2) * mp.pi / 10
        x, y = mp.mpf("0.4") - mp.cos(crank) / 10, -mp.sin(crank) / 10
        diagonal = mp.hypot(x, y)
        corner = mp.acos((diagonal**2 + mp.mpf("0.09") - coupler**2) / (mp.mpf("0.6") * diagonal))
        return mp.atan2(-y, -x) - corner

    with mp.workdps(40):
        by_coupler = float(mp.diff(angle, mp.mpf("0.35")))
    assert abs(found["theta4", "coupler"]) == pytest.approx(abs(by_coupler), rel=1e-12)
    assert found["theta4", "speed"] != 0.0
    with pytest.raises(ModelError, match="a change of h alone opens the redundant closure equations"):
        model.sensitivity(["theta4"], ["h"])
    with pytest.raises(ModelError, match="a change of modulus alone opens the redundant closure equations"):
        model.sensitivity(["theta4"], ["modulus"])
    with pytest.raises(ModelError, match=r"rocker.joint3.moment.x is not determined"):
        model.sensitivity(["rocker.joint3.moment"], ["speed"])
    with pytest.raises(ModelError, match="no tunable parameter 'w'"):
        model.sensitivity(["theta4"], ["w"])
    with pytest.raises(ModelError, match="there is no output 'thetaX'"):
        model.sensitivity(["thetaX"], ["speed"])
