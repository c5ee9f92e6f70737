"""Outputs by expressions: a four-bar by closed form, camber and toe of a wheel, and what is refused."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

import symgen
from symgen.errors import SceneError
from symgen.export import export_c

SPEED = 10.0
FOUR_BAR = {
    "points": {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": ["0.1 m", "0 m"]},
        "B": {"at": ["0.35 m", "0.2 m"]},
        "C": {"at": ["0.4 m", "0 m"], "ground": True},
    },
    "links": {
        "crank": {"points": ["O", "A"], "mass": "1 kg"},
        "coupler": {"points": ["A", "B"], "mass": "2 kg"},
        "rocker": {"points": ["B", "C"], "mass": "1 kg"},
    },
    "parameters": {"speed": f"{SPEED} rad/s", "k": {"value": "2", "tunable": True}},
    "drivers": [{"link": "crank", "angle": "speed*t"}],
    "tables": {
        "cam": {"x": ["0 deg", "180 deg", "360 deg"], "y": ["0 mm", "8 mm", "0 mm"], "period": "360 deg"}
    },
    "outputs": [
        {"name": "lean", "value": "atan2(B.x - A.x, B.y - A.y)", "unit": "deg"},
        {"name": "turns", "value": "k*crank.angle", "unit": "deg"},
        {"name": "above", "value": "abs(A.y)"},
        {"name": "lift", "value": "cam(crank.angle)"},
        {
            "name": "ratio",
            "value": "rocker.rate/crank.rate",
            "about": "rate of the rocker over that of the crank",
        },
    ],
    "analysis": {"t_end": "1.4 s"},
}


def built(**changes):
    return symgen.build(symgen.Scene(**{**FOUR_BAR, **changes}))


def closed_form(t, k=2.0):
    """Return the outputs by the closure of the loop."""
    angle = SPEED * t
    a = 0.1 * np.exp(1j * angle)
    coupler, rocker = abs(0.25 + 0.2j), abs(0.05 - 0.2j)
    to_pivot = 0.4 - a
    along = (coupler**2 - rocker**2 + abs(to_pivot) ** 2) / (2 * abs(to_pivot))
    unit = to_pivot / abs(to_pivot)
    b = a + unit * (along + 1j * np.sqrt(coupler**2 - along**2))
    arm, rod = b - 0.4, b - a
    # Velocities of B: that of A and the rotations of coupler and rocker.
    of_a, across = 1j * SPEED * a, (1j * arm, 1j * rod)
    rates = [
        np.linalg.solve([[x.real, -y.real], [x.imag, -y.imag]], [v.real, v.imag])[0]
        for x, y, v in zip(*across, of_a, strict=True)
    ]
    phase = np.mod(angle, 2 * np.pi)
    return {
        "lean": np.arctan2(rod.real, rod.imag),
        "turns": k * angle,
        "above": np.abs(a.imag),
        "lift": 0.008 * np.minimum(phase, 2 * np.pi - phase) / np.pi,
        "ratio": np.array(rates) / SPEED,
    }


def test_runs_and_kinematics_record_them():
    model = built()
    times = np.array([0.0, 0.17, 0.4, 0.93, 1.4])
    run, motion = model.simulate(t_eval=times, rtol=1e-12), model.kinematics(at=times, over="time")
    alone = symgen.build(symgen.Scene(**{**FOUR_BAR, "analysis": {"kind": "kinematics", "t_end": "1.4 s"}}))
    for found in (run, motion, alone.kinematics(at=times, over="time")):
        for name, expected in closed_form(times).items():
            assert found[name].values == pytest.approx(expected, abs=1e-9), name
    assert run["ratio"].attrs["long_name"] == "rate of the rocker over that of the crank"
    assert {name: run[name].attrs["units"] for name in ("lean", "above", "ratio")} == {
        "lean": "rad",
        "above": "m",
        "ratio": "1",
    }


def test_they_act_on_nothing():
    """Neither switching points nor steps differ from those of the scene without outputs."""
    run, without = built().simulate(), built(outputs=[]).simulate()
    assert run.statistics["steps"] == without.statistics["steps"] and not run.notes
    assert run["B.position"].values == pytest.approx(without["B.position"].values, abs=0.0)


def test_many_runs_have_those_of_single_runs():
    model, values = built(), np.array([0.5, 3.0])
    times = np.array([0.3, 1.2])
    many = model.kinematics_many({"k": values}, at=times, over="time")
    runs = model.simulate_many({"k": values}, t_eval=times, rtol=1e-12)
    for i, k in enumerate(values):
        expected = closed_form(times, k)
        for name in ("lean", "turns", "lift"):
            assert many[name].values[i] == pytest.approx(expected[name], abs=1e-9)
            assert runs[name].values[i] == pytest.approx(expected[name], abs=1e-9)


def test_free_linkages_have_derivatives_of_them():
    model = built(drivers=[], gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]})
    found = model.sensitivity(["turns"], t_end=0.4, coordinates=["crank.angle"], rtol=1e-12)
    step = 1e-4
    ends = [
        model.simulate(state=model.state({"crank.angle": x}, {"crank.angle": 0.0}), t_eval=[0.4], rtol=1e-12)[
            "turns"
        ].values[-1]
        for x in (step, -step)
    ]
    by = found.summary()["outputs"]["turns"]["by"]
    assert by["crank.angle"][0] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6)
    assert by["k"][0] == pytest.approx(found.summary()["outputs"]["turns"]["value"][0] / 2, rel=1e-12)


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_exported_c_has_them(tmp_path):
    export_c(symgen.Scene(**FOUR_BAR), tmp_path)
    commands = (
        ("cmake", "-S", ".", "-B", "build"),
        ("cmake", "--build", "build"),
        ("ctest", "--test-dir", "build"),
    )
    if shutil.which("cmake"):
        for command in commands:
            subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    headers = "".join(f.read_text("utf-8") for f in tmp_path.rglob("*.h"))
    assert all(output["name"] in headers for output in FOUR_BAR["outputs"])


def test_camber_and_toe_of_a_wheel_in_space():
    """The directions of an axle carried by a body that a driven arm turns about x: camber is the angle."""
    scene = {
        "points": {
            "P": {"at": ["0 m", "0 m", "0 m"], "ground": True},
            "Q": {"at": ["1 m", "0 m", "0 m"], "ground": True},
            "U": {"at": ["0.5 m", "0.3 m", "0 m"]},
            "V": {"at": ["0.5 m", "0.5 m", "0 m"]},
        },
        "links": {
            "arm": {
                "points": ["P", "Q", "U", "V"],
                "mass": "1 kg",
                "centre": ["0.5 m", "0.2 m", "0 m"],
                "inertia": ["0.1 kg*m^2", "0.1 kg*m^2", "0.1 kg*m^2"],
            }
        },
        "parameters": {"speed": "2 rad/s"},
        "drivers": [{"link": "arm", "angle": "speed*t"}],
        "outputs": [
            {"name": "camber", "value": "atan2(V.z - U.z, V.y - U.y)", "unit": "deg"},
            {"name": "toe", "value": "atan2(V.x - U.x, V.y - U.y)", "unit": "deg"},
        ],
        "analysis": {"t_end": "0.5 s"},
    }
    times = np.array([0.1, 0.35])
    motion = symgen.build(symgen.Scene(**scene)).kinematics(at=times, over="time")
    assert np.abs(motion["camber"].values) == pytest.approx(2 * times, abs=1e-12)
    assert motion["toe"].values == pytest.approx(0 * times, abs=1e-12)


@pytest.mark.parametrize(
    "output, problem",
    [
        ({"name": "lean", "value": "B.x", "unit": "deg"}, r"\[outputs.0\] unit: expected a unit like m"),
        ({"name": "energy", "value": "B.x"}, "'energy' of .*outputs.* has a meaning already"),
        ({"name": "A", "value": "B.x"}, "'A' is a point already"),
        ({"name": "k", "value": "B.x"}, "'k' is a parameter already"),
        ({"name": "mass_matrix", "value": "B.x"}, "'mass_matrix' is reserved"),
        ({"name": "sum", "value": "B.x + crank.rate"}, "value"),
        ({"name": "lost", "value": "D.x"}, "D.x"),
    ],
)
def test_what_is_refused(output, problem):
    with pytest.raises(SceneError, match=problem):
        built(outputs=[output])


def test_elastic_links_have_none():
    scene = {
        k: v for k, v in symgen.load_scene("elastic_four_bar").model_dump(exclude_none=True).items() if v
    }
    with pytest.raises(SceneError, match="outputs by expressions are for linkages with rigid links"):
        symgen.build(symgen.Scene(**{**scene, "outputs": [{"name": "high", "value": "A.y"}]}))
