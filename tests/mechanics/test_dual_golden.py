"""The derived matrices of the generalized slider-crank, solved with NumPy, against its golden numbers.

Neither kernels nor the runtime take part: only the SymPy matrices, and linear equations.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from shared.loops import slider_crank

from symgen.models.loop.system import loop_system

GOLDEN = json.loads((Path(__file__).parent.parent / "reference" / "dual_slider_crank.json").read_text())
NAMES = {"th2": "theta2", "et2": "eta2", "th3": "theta3", "et3": "eta3", "al3": "alpha3", "S4": "S4"}
#: Wrenches of the golden file: output, sign.
WRENCHES = {
    "F1": ("crank.joint1.force", 1), "T1": ("crank.joint1.moment", 1), "F2": ("rod.joint2.force", -1),
    "F3": ("slider.joint3.force", 1), "F4": ("ground.joint4.force", -1), "T4": ("ground.joint4.moment", -1),
}  # fmt: skip
TOLERANCE = 1e-11


def function(system, name):
    """A matrix as a NumPy function of the argument arrays, shared subexpressions first."""
    shared = [(d.quantity.symbol, d.expression) for d in system.definitions]
    groups = [[x.symbol for x in g.quantities] for g in system.groups]
    return sp.lambdify(groups, sp.Matrix(system[name].matrix), "numpy", cse=lambda e: (shared, e))


@pytest.fixture(scope="module", params=["mode_L", "mode_T"])
def derived(request):
    """Slider load given, drive torque to be found; and the other way round."""
    system = loop_system(slider_crank(request.param == "mode_L", {"stroke": 0, "ratio": 1}))
    names = [
        "closure_defect",
        "closure_jacobian",
        "screws",
        "screw_drift",
        "inverse_efforts",
        "given_efforts",
    ]
    names += [name for name, _ in WRENCHES.values()]
    return request.param, {name: function(system, name) for name in names}


def compare(found, expected, what):
    for key, value in found.items():
        assert abs(value - expected[key]) <= TOLERANCE * max(1, abs(expected[key])), (what, key)


@pytest.mark.parametrize("scene", GOLDEN["scenes"], ids=lambda s: s["name"])
def test_golden_numbers_follow_from_the_matrices(derived, scene):
    mode, matrices = derived
    parameters = [scene["a4"], np.radians(scene["alpha4_deg"])]
    for position in scene["positions"]:
        kin = position["kin"]
        q = [np.radians(position["theta1_deg"]), kin["S1"]["pos"], *(kin[k]["pos"] for k in NAMES)]

        def at(name, u=(0,) * 8, work=(0,) * 14, q=q):
            return np.array(matrices[name]([0.0], q, u, parameters, work), dtype=float)

        assert np.abs(at("closure_defect")).max() < 1e-12
        screws = at("screws")
        assert np.abs(screws - at("closure_jacobian")).max() < 1e-12, "by the shorter way, on the closed loop"
        given = np.array([GOLDEN["parameters"]["theta1_dot"], 0.0])
        u = np.append(given, np.linalg.solve(screws[:, 2:], -screws[:, :2] @ given))
        compare({k: u[2 + i] for i, k in enumerate(NAMES)}, {k: kin[k]["vel"] for k in NAMES}, "rate")
        second = np.append([0, 0], np.linalg.solve(screws[:, 2:], -at("screw_drift", u).ravel()))
        compare({k: second[2 + i] for i, k in enumerate(NAMES)}, {k: kin[k]["acc"] for k in NAMES}, "second")

        work = np.append(second, np.zeros(6))
        asked = at("given_efforts", u, work).ravel() - at("inverse_efforts", u, work).ravel()
        unknown = (0, 1) if mode == "mode_L" else (1, 7)
        known = [j for j in range(8) if j not in unknown]
        paired = np.vstack([screws[3:], screws[:3]])
        work = np.append(second, np.linalg.solve(paired[:, known].T, asked[known]))
        for key, (name, sign) in WRENCHES.items():
            found = sign * at(name, u, work).ravel()
            compare(dict(zip((f"{key}{a}" for a in "ijk"), found, strict=True)), position[mode], name)
