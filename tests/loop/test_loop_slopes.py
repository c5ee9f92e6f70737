"""Derivatives of overconstrained loops, and at several times; tests/runtime has those of all shipped scenes."""

from __future__ import annotations

import math

import pytest
from shared.exact_slopes import tunable_loop as tunable
from shared.in_numpy import build

from symgen.errors import ModelError


def test_one_link_of_an_overconstrained_loop_alone_has_no_derivatives():
    """Bennett's linkage closes with lengths as the sines of twists: one of them alone opens it."""
    length = f"{0.2 * math.sin(math.radians(40.0))!r} m"
    model = tunable("bennett", **{"parameters.b": {"value": length, "tunable": True}})
    assert model.sensitivity(["theta2"], ["speed", "line"])["theta2", "line"] == 0.0
    for name in ("b", "short"):
        with pytest.raises(ModelError, match=f"a change of {name} alone opens the redundant closure"):
            model.sensitivity(["theta2"], [name])


def test_derivatives_at_several_times_are_those_at_each():
    model = build("rssr")
    found = model.sensitivity(["theta4", "theta1.drive"], t_eval=[0.1, 0.4, 0.05])
    assert found.derivatives.shape == (3, 2, len(model.parameters)) and found.values.shape == (3, 2)
    for k, t in enumerate(found.t):
        one = model.sensitivity(["theta4", "theta1.drive"], at=t)
        assert found.values[k] == pytest.approx(one.values, rel=1e-12)
        assert found.derivatives[k] == pytest.approx(one.derivatives, rel=1e-11)
    for wrong, message in ({"at": 0.1, "t_eval": [0.2]}, "not both"), ({"t_eval": []}, "expected times"):
        with pytest.raises(ModelError, match=message):
            model.sensitivity(["theta4"], **wrong)
