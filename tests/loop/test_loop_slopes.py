"""Derivatives of shipped driven loops against vector equations in 60 digits."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from shared.full import full_unless
from shared.loop_slopes import CASES, DIGITS, Motion

import symgen
from symgen.errors import ModelError

#: The scene that is compared in every run of the tests.
QUICK = {"rssr"}


def tunable(scene, **more):
    """A shipped loop with all parameters of its case tunable."""
    changes = {f"parameters.{n}": {"value": x, "tunable": True} for n, x in CASES[scene].units.items()}
    return symgen.build(scene, set=changes | more)


@pytest.mark.parametrize("scene", full_unless(lambda scene: scene in QUICK, CASES))
def test_derivatives_of_shipped_loops_are_exact(scene):
    """Each within 1e-9, or 1e-12 of the largest output of its kind over the parameter."""
    case, model = CASES[scene], tunable(scene)
    variables = [v.name for v in model.description.variables]
    kinds = [
        *([f"{name}{suffix}" for name in variables] for suffix in ("", ".rate", ".acceleration")),
        ["theta1.drive"],
        *([f"{link}.joint{joint}.force"] for link, joint, _ in case.forces),
    ]
    parameters = [*model.parameters]
    found = model.sensitivity([name for kind in kinds for name in kind], parameters, at=case.time)
    pose = {name: found.values[found.outputs.index(name)] for name in variables}
    with mp.workdps(DIGITS):
        values, slopes = Motion(case, case.values(), pose).slopes(parameters)
    names = [*values]
    size = np.abs([model.parameters[name] for name in parameters])
    for kind in kinds:
        rows = [i for i, name in enumerate(found.outputs) if name in kind or name.rpartition(".")[0] in kind]
        exact = np.array([values[found.outputs[i]] for i in rows])
        largest = max(np.max(np.abs(exact)), 1e-9)  # the jack has no accelerations
        assert np.all(np.abs(found.values[rows] - exact) <= 1e-12 * largest)
        expected = slopes[[names.index(found.outputs[i]) for i in rows]]
        away = np.abs(found.derivatives[rows] - expected)
        assert np.all(away <= 1e-9 * np.abs(expected) + 1e-12 * largest / size)


def test_one_link_of_an_overconstrained_loop_alone_has_no_derivatives():
    """Bennett's linkage closes with lengths as the sines of twists: one of them alone opens it."""
    length = f"{0.2 * math.sin(math.radians(40.0))!r} m"
    model = tunable("bennett", **{"parameters.b": {"value": length, "tunable": True}})
    assert model.sensitivity(["theta2"], ["speed", "line"])["theta2", "line"] == 0.0
    for name in ("b", "short"):
        with pytest.raises(ModelError, match=f"a change of {name} alone opens the redundant closure"):
            model.sensitivity(["theta2"], [name])


def test_derivatives_at_several_times_are_those_at_each():
    model = symgen.build("rssr")
    found = model.sensitivity(["theta4", "theta1.drive"], t_eval=[0.1, 0.4, 0.05])
    assert found.derivatives.shape == (3, 2, len(model.parameters)) and found.values.shape == (3, 2)
    for k, t in enumerate(found.t):
        one = model.sensitivity(["theta4", "theta1.drive"], at=t)
        assert found.values[k] == pytest.approx(one.values, rel=1e-12)
        assert found.derivatives[k] == pytest.approx(one.derivatives, rel=1e-11)
    for wrong, message in ({"at": 0.1, "t_eval": [0.2]}, "not both"), ({"t_eval": []}, "expected times"):
        with pytest.raises(ModelError, match=message):
            model.sensitivity(["theta4"], **wrong)
