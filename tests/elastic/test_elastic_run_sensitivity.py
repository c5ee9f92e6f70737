"""Derivatives of runs of elastic links by parameters, and gradients of results."""

from __future__ import annotations

import json

import mpmath as mp
import numpy as np
import pytest
from shared.elastic_exact import CASES
from shared.elastic_transient import REFERENCE, SCENE, TIME, tip
from shared.full import full, full_unless

import symgen
from symgen.errors import ModelError, ResultError

#: Parameters of the strip: key of a number, and unit.
STRIP = {
    "width": ("links.strip.section.width", "m"), "thickness": ("links.strip.section.thickness", "m"),
    "density": ("links.strip.density", "kg/m^3"), "E": ("links.strip.elastic.E", "Pa"),
}  # fmt: skip
#: All parameters, those compared in every run of the tests first.
PARAMETERS = (["speed"], ["length", *STRIP])


def tunable(scene, **placed):
    """A shipped scene with tunable parameters: the key of a number, or none, and the value."""
    changes = {}
    for name, (key, value) in placed.items():
        changes[f"parameters.{name}"] = {"value": value, "tunable": True}
        if key:
            changes[key] = name
    return symgen.build(scene, set=changes)


@pytest.mark.parametrize("names", full_unless(lambda names: "speed" in names, PARAMETERS))
def test_a_strip_on_a_shaft_against_its_matrix_exponential(names):
    """From rest, when the tip vibrates along and across the strip, in 40 digits."""
    stored, values = json.loads(REFERENCE.read_text())[SCENE], CASES[SCENE][0]
    placed = {name: (key, f"{float(values[name])!r} {unit}") for name, (key, unit) in STRIP.items()}
    model = tunable(SCENE, **({} if names == ["speed"] else {"length": ("", "1 m")} | placed))
    run = model.simulate(t_eval=[float(TIME)], t_end=float(TIME), steps=25_000)
    found = run.gradient(["tip.displacement"], names)
    assert found.derivatives.shape == (1, 2, len(names)) and found.parameters == (*names,)
    assert found.values[0] == pytest.approx([float(x) for x in stored["values"]], rel=1e-10)
    for j, name in enumerate(names):
        expected = np.array([float(x) for x in stored["by"][name]])
        natural = np.max(np.abs(found.values)) / float(values[name])
        allowed = 1e-9 * np.abs(expected) + (1e-9 if name == "width" else 1e-12) * natural  # of no effect
        assert np.all(np.abs(found.derivatives[0, :, j] - expected) <= allowed)


@pytest.mark.full
def test_the_stored_motion_is_reproduced():
    with mp.workdps(40):
        found = tip(CASES[SCENE][0], mp.mpf(TIME))
        stored = json.loads(REFERENCE.read_text())[SCENE]["values"]
        assert all(abs(x / mp.mpf(y) - 1) < mp.mpf("1e-20") for x, y in zip(found, stored, strict=True))


@pytest.mark.parametrize(
    "method", ["gauss", "newmark", full("generalized-alpha"), full("wilson-theta"), "bdf3"]
)
def test_a_slider_crank_against_differences_of_its_runs(method):
    """With a guide, and damped modes of the rod; steps are held, so that differences have one limit."""
    model = tunable(
        "elastic_slider_crank", l=("", "200 mm"), r=("", "50 mm"), piston=("masses.0.mass", "0.3 kg"),
        E=("links.rod.elastic.E", "210 GPa"), ratio=("links.rod.elastic.damping.ratio", "0.01"),
    )  # fmt: skip
    times = [0.004, 0.009]

    def run(model):
        return model.simulate(method=method, t_eval=times, t_end=0.009, steps=255)

    def ends(name, factor):
        found = run(model.with_parameters(**{name: model.parameters[name] * factor}))
        return np.column_stack([found["rod.stress"].values, found["P.displacement.x"].values])

    found = run(model).gradient(["rod.stress", "P.displacement.x"])
    assert found.values == pytest.approx(ends("E", 1.0), rel=1e-10)
    for j, name in enumerate(found.parameters):
        near, far = ((ends(name, 1 + h) - ends(name, 1 - h)) / (2 * h) for h in (1e-4, 2e-4))
        expected = (4 * near - far) / 3
        size = np.max(np.abs(expected), axis=0)
        scaled = found.derivatives[:, :, j] * model.parameters[name]
        assert np.all(np.abs(scaled - expected) <= 3e-8 * size)


@pytest.mark.parametrize("method", ["gauss", full("newmark")])
def test_a_four_bar_whose_joint_moves_along_another_axis(method):
    """Steps take the unknown of B along the rigid output link's normal as independent: its x, later its y.

    The steps do not resolve the vibration, so that their errors, which depend on this choice, are as large as it.
    """
    bar = {"density": "2700 kg/m^3", "section": {"width": "25 mm", "thickness": "9 mm"}}
    points = {"M": ("0 m", "0 m"), "A": ("178 mm", "0 m"), "B": ("89 mm", "238 mm"), "Q": ("280 mm", "0 m")}
    model = symgen.build(
        symgen.Scene(
            parameters={"E": {"value": "70 GPa", "tunable": True}},
            points={name: {"at": list(at), "ground": name in "MQ"} for name, at in points.items()},
            links={
                "crank": {"points": ["M", "A"], **bar},
                "coupler": {"points": ["A", "B"], **bar, "elastic": {"E": "E", "elements": 1}},
                "output": {"points": ["B", "Q"], **bar},
            },
            crank={"link": "crank", "speed": "95 rpm"},
        )
    )

    def run(model):
        return model.simulate(method=method, t_eval=[0.3], t_end=0.3, steps=240)

    def end(factor):
        found = run(model.with_parameters(E=model.parameters["E"] * factor))
        return np.array([found["coupler.stress"].values[0], found["B.displacement.x"].values[0]])

    found = run(model).gradient(["coupler.stress", "B.displacement.x"])
    assert found.values[0] == pytest.approx(end(1.0), rel=1e-9, abs=0)
    near, far = ((end(1 + h) - end(1 - h)) / (2 * h) for h in (1e-5, 2e-5))
    scaled = found.derivatives[0, :, 0] * model.parameters["E"]
    assert scaled == pytest.approx((4 * near - far) / 3, rel=1e-6, abs=0)


def test_runs_without_derivatives_are_refused_by_name():
    strip = symgen.build("rotating_cantilever")
    start = strip.simulate(t_eval=[0.0], steps=64).gradient(["tip.displacement"])
    assert not start.derivatives.any()  # it starts undeformed
    short = {"t_end": 0.01, "steps": 64, "samples": 2}
    with pytest.raises(ModelError, match="expected an implicit method .* got rk4\n  Choose gauss"):
        strip.simulate(method="rk4", t_end=1e-4, samples=2).gradient(["tip.displacement"])
    bent = strip.simulate(initial="quasi-static", **short)
    for run in (bent, bent.at([0.005])):
        with pytest.raises(ModelError, match="those that start undeformed"):
            strip.sensitivity(["tip.displacement"], at=run)
    with pytest.raises(ModelError, match="no derivatives of 'frequencies' of a run of elastic links"):
        strip.simulate(**short).gradient(["frequencies"])
    with pytest.raises(
        ModelError, match="expected parameters of rotating_cantilever to differentiate by, got none"
    ):
        strip.simulate(**short).gradient(["tip.displacement"], [])
    motor = symgen.build("elastic_four_bar_motor")
    with pytest.raises(ModelError, match="a motor moves its crank"):
        motor.simulate(**short).gradient(["B.displacement"])


def test_gradients_of_results_are_the_sensitivities_of_their_analyses(tmp_path):
    bar = symgen.build("peaucellier")
    name, more = next(iter(bar.parameters)), {"coordinates": ["C.position.y"]}
    run = bar.simulate(0.2, rtol=1e-9)
    expected = bar.sensitivity(["B.position"], [name], t_end=0.2, rtol=1e-9, **more)
    assert np.array_equal(run.gradient(["B.position"], [name], **more).derivatives, expected.derivatives)
    driven = symgen.build("slider_crank")
    turn = driven.kinematics(at=[0.1, 0.4])
    expected = driven.sensitivity(["S4"], at=float(turn.time[-1]))
    assert np.array_equal(turn.gradient(["S4"]).derivatives, expected.derivatives)
    strip = symgen.build("rotating_cantilever")
    static = strip.quasi_static(at=[0.0, 1.0])
    expected = strip.sensitivity(["tip.displacement"], t_eval=static.time)
    assert np.array_equal(static.gradient(["tip.displacement"]).derivatives, expected.derivatives)
    once = static.gradient(["tip.displacement", "tip.displacement.x"])
    assert once.outputs == expected.outputs and np.array_equal(once.derivatives, expected.derivatives)
    run.save(tmp_path / "run.nc")
    with pytest.raises(ResultError, match="was loaded or copied has no gradient"):
        symgen.load_result(tmp_path / "run.nc").gradient(["B.position"])
    with pytest.raises(ResultError, match="stabilisation 'raw' have no gradient"):
        bar.simulate(0.01, stabilisation="raw").gradient(["B.position"])
