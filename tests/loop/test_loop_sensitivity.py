"""Derivatives of driven loops by parameters, against closed forms differentiated in 40 digits."""

from __future__ import annotations

import mpmath as mp
import pytest

import symgen
from symgen.errors import ModelError


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
