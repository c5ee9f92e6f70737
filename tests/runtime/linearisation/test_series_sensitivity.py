"""Derivatives along power series, against differences of runs in quadruple precision."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import GRAVITY, at, ground

import symgen

#: Parameters of two rods that hang from a moving point, on a spring with a damper and under a varying force.
VALUES = {
    "l": (0.5, "m"), "m": (1.2, "kg"), "k": (90.0, "N/m"), "c": (1.5, "N*s/m"), "r": (0.05, "m"),
    "w": (7.0, "rad/s"), "F": (2.0, "N"),
}  # fmt: skip
START = {"first": (-0.4, "rad"), "second": (0.3, "rad")}
ANGLES = ["OA.angle", "AB.angle"]
BY = [*VALUES, *ANGLES]
OUTPUTS = ["B.position.x", "B.position.y", "A.velocity.x", "B.acceleration.y"]
#: Weights of differences over 1, 2 and 3 steps to each side: of order 6.
WEIGHTS = 3 / 4, -3 / 20, 1 / 60
END = 0.5


def hanging(precision="float64"):
    """The rods; their angles at the start are parameters, too."""
    values = VALUES | START
    a = 0.5 * np.array([np.cos(START["first"][0]), np.sin(START["first"][0])])
    b = a + 0.7 * np.array([np.cos(START["second"][0]), np.sin(START["second"][0])])
    scene = symgen.Scene(
        parameters={
            name: {"value": f"{value!r} {unit}", "tunable": True} for name, (value, unit) in values.items()
        },
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True, "motion": ["r*(1 - cos(w*t))", "0 m"]},
            "W": ground(1.2, 0.6),
            "A": at(*a),
            "B": at(*b),
        },
        links={
            "OA": {"points": ["O", "A"], "mass": "m", "length": "l"},
            "AB": {"points": ["A", "B"], "mass": "0.8 kg", "length": "0.7 m"},
        },
        gravity=GRAVITY,
        springs=[{"between": ["W", "B"], "stiffness": "k", "length": "0.4 m", "damping": "c"}],
        forces=[{"point": "A", "force": ["F*cos(2*w*t)", "0 N"]}],
        start={"angles": {"OA": "first", "AB": "second"}, "rates": {"OA": "1 rad/s", "AB": "0 rad/s"}},
        analysis={"outputs": ["A.velocity", "B.position", "B.acceleration"]},
    )
    return symgen.build(scene, precision=precision)


def test_derivatives_are_those_of_runs_in_quadruple_precision():
    model, exact = hanging(), hanging("float128")
    how = {"coordinates": ANGLES, "t_end": END, "rtol": 1e-13, "atol": 1e-15, "method": "taylor"}
    found = model.sensitivity(OUTPUTS, BY, **how)
    other = model.sensitivity(OUTPUTS, BY, **{**how, "method": "dop853"})
    assert found.derivatives == pytest.approx(other.derivatives, rel=1e-9, abs=1e-9)

    def ends(name, value):
        run = exact.with_parameters(**{name: value}).simulate(
            END, samples=2, rtol=1e-20, atol=1e-22, method="taylor"
        )
        return np.array([run[output].values[-1] for output in OUTPUTS])

    for column, (name, (x, _)) in enumerate((VALUES | START).items()):
        h = 0.004 * abs(x)
        total = sum(
            c * (ends(name, x + i * h) - ends(name, x - i * h)) for i, c in enumerate(WEIGHTS, start=1)
        )
        assert found.derivatives[0, :, column] == pytest.approx(total / h, rel=1e-9, abs=1e-9)


def test_backward_derivatives_are_those_forward():
    """One output by nine directions is taken back along the steps, four are carried forward."""
    model = hanging()
    how = {"coordinates": ANGLES, "t_end": END, "rtol": 1e-10, "method": "taylor"}
    forward = model.sensitivity(OUTPUTS, BY, **how).derivatives
    for i, name in enumerate(OUTPUTS):
        back = model.sensitivity([name], BY, **how).derivatives
        assert back[:, 0] == pytest.approx(forward[:, i], rel=1e-12, abs=1e-12)
