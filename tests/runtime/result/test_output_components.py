"""Components of vectors as outputs of their own: in sweeps, optimisations, derivatives and scenes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import symgen
from symgen.errors import ModelError, ResultError, SceneError

REDUCED = ["peak", "greatest", "least", "range", "mean", "rms", "final"]
SPEED = {"parameters.speed": {"value": "60 rpm", "tunable": True}}
#: Scene and its changes, analysis, a varied parameter, a vector, and arguments of the analysis.
CASES = {
    "forces of rods, in lanes": (
        *("crank_rocker", SPEED, "inverse_dynamics", {"speed": np.linspace(5.0, 7.0, 9)}, "coupler.B.force"),
        {"samples": 37},
    ),
    "motion of rods, in lanes": (
        *("crank_rocker", SPEED, "kinematics", {"speed": np.linspace(5.0, 7.0, 9)}, "B.acceleration"),
        {"samples": 37, "of": ["B"]},
    ),
    "run of rods": (
        *("crank_rocker", SPEED, "simulate", {"speed": np.linspace(5.0, 7.0, 5)}, "B.position"),
        {"t_end": 0.1},
    ),
    "loop": (
        *("slider_crank", {}, "inverse_dynamics", {"a4": np.linspace(0.0, 0.5, 9)}, "crank.joint2.force"),
        {"samples": 19},
    ),
    "steady state of elastic links": (
        *("elastic_four_bar", {}, "periodic", {"speed": [9.0, 10.0]}, "B.displacement"),
        {"samples": 24},
    ),
    "shape of elastic links": (
        *("elastic_four_bar", {}, "quasi_static", {"speed": [9.0, 10.0]}, "A.displacement"),
        {"samples": 24},
    ),
    "elastic links in space": (
        *("spatial_four_bar", {"links.coupler.elastic.elements": 1, "links.rocker.elastic.elements": 1}),
        *("simulate", {"rate": [30.0, 31.0]}, "coupler.C.force"),
        {"t_end": 0.004},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_components_in_a_sweep_are_those_of_the_vector(case):
    scene, changes, analysis, vary, vector, arguments = CASES[case]
    model = symgen.build(scene, set=changes)
    whole = model.sweep(vary, analysis, outputs=[vector], reduce="history", **arguments)
    axes = whole["axis"].values.tolist()
    parts = [f"{vector}.{axis}" for axis in axes]
    runs = model.sweep(vary, analysis, outputs=parts, reduce=[*REDUCED, "history"], **arguments)
    reduced = model.sweep(vary, analysis, outputs=[*reversed(parts)], reduce=REDUCED, **arguments)
    scale = float(np.max(np.abs(whole[vector].values)))
    assert scale > 0.0
    for i, part in enumerate(parts):
        samples = whole[vector].values[..., i]
        assert_array_equal(runs[part].values, samples)
        assert runs[part].attrs["units"] == whole[vector].attrs["units"]
        for name, values in {
            "peak": np.max(np.abs(samples), axis=1),
            "greatest": np.max(samples, axis=1),
            "least": np.min(samples, axis=1),
            "range": np.ptp(samples, axis=1),
            "final": samples[:, -1],
        }.items():
            np.testing.assert_allclose(reduced[f"{part}.{name}"], values, atol=1e-11 * scale)
        for name in REDUCED:
            found = reduced[f"{part}.{name}"].values
            np.testing.assert_allclose(found, runs[f"{part}.{name}"], rtol=0.0, atol=1e-11 * scale)


def test_a_component_of_an_equilibrium():
    changes = {"parameters.m": {"value": "1 kg", "tunable": True}, "links.crank.mass": "m"}
    model = symgen.build("four_bar", set=changes)
    runs = model.sweep(
        {"m": [1.0, 2.0]}, "equilibrium", outputs=["O.reaction", "O.reaction.y", "B.position.x"]
    )
    assert_array_equal(runs["O.reaction.y"].values, runs["O.reaction"].values[:, 1])
    assert runs["O.reaction.y"].dims == ("run",)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("crank.joint2.force.w", "crank.joint2.force has no component 'w': it has x, y, z"),
        ("S4.x", "S4 has no component 'x': it is one number"),
        ("crank.joint2.forse.x", "Did you mean 'crank.joint2.force'"),
    ],
)
def test_what_is_no_component_is_refused_with_those_that_exist(name, message):
    model = symgen.build("slider_crank")
    with pytest.raises(ModelError, match=message):
        model.sweep({"a4": [0.0, 0.1]}, outputs=[name], samples=5)
    with pytest.raises(ModelError, match=message):
        model.sensitivity([name], ["a4"])
    with pytest.raises(SceneError, match=message):
        symgen.build("slider_crank", set={"analysis.outputs": [name]})
    with pytest.raises(ResultError, match=message):
        model.inverse_dynamics(samples=5)[name]


@pytest.mark.parametrize(
    ("scene", "vector", "changes", "samples"),
    [
        ("crank_rocker", "C.reaction", {}, "simulate"),
        ("elastic_four_bar", "B.displacement", {}, "quasi_static"),
        ("slider_crank", "slider.joint3.force", {}, "inverse_dynamics"),
        ("cardan", "input.joint2.moment", {}, "inverse_dynamics"),
    ],
)
def test_a_scene_records_components(scene, vector, changes, samples):
    whole = getattr(symgen.build(scene, set=changes | {"analysis.outputs": [vector]}), samples)(samples=5)
    axes = whole.variable(vector).components
    names = [f"{vector}.{axis}" for axis in axes]
    parts = getattr(symgen.build(scene, set=changes | {"analysis.outputs": names}), samples)(samples=5)
    assert [*parts] == names
    for i, name in enumerate(names):
        expected = whole.variable(vector).values[:, i]
        scale = np.max(np.abs(whole.variable(vector).values))
        np.testing.assert_allclose(parts.variable(name).values, expected, atol=1e-12 * scale)
        assert parts.variable(name).unit == whole.variable(vector).unit
        assert_array_equal(whole.variable(name).values, expected)


def test_an_optimisation_and_tolerances_take_a_component():
    model = symgen.build("slider_crank")
    arguments = {"samples": 7}
    by_vector = model.optimise({"a4": (0.0, 0.2)}, "crank.joint2.force.peak.x", iterations=1, **arguments)
    by_part = model.optimise({"a4": (0.0, 0.2)}, "crank.joint2.force.x.peak", iterations=1, **arguments)
    assert by_vector.objective == by_part.objective
    assert by_vector.parameters == by_part.parameters
    spread = model.tolerances(
        {"a4": symgen.Uniform(0.0, 0.1)}, method="worst-case", outputs=["crank.joint2.force.x"], **arguments
    )
    assert spread["output"].values.tolist() == ["crank.joint2.force.x.peak"]


def test_a_component_of_a_vector_of_which_one_is_recorded():
    """The vector itself is not there: the message names the component as an output."""
    changes = {**SPEED, "analysis.outputs": ["B.position.x", "crank.torque"]}
    model = symgen.build("crank_rocker", set=changes)
    bounds = {"B.position.range.x": (0.01, None)}
    with pytest.raises(ModelError, match=r"B\.position is not recorded, but B\.position\.x"):
        model.optimise({"speed": (5.0, 7.0)}, "crank.torque.rms", constraints=bounds, samples=19)
