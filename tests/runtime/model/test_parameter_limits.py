"""Tunable masses, inertias, stiffnesses and dampings of the wrong sign: refused wherever they are set."""

from __future__ import annotations

import numpy as np
import pytest
from shared.in_numpy import build
from shared.linkages import GRAVITY, at, four_bar, ground

import symgen
from symgen.errors import ModelError, RangeError, SceneError

#: Value and unit of each parameter, and the key of the scene that it is the value of.
VALUES = {
    "m": (2.0, "kg", "links.rod.mass"),
    "inertia": (0.1, "kg*m^2", "links.rod.inertia"),
    "density": (1.0, "kg/m", "links.arm.mass_per_length"),
    "tip": (0.5, "kg", "masses.0.mass"),
    "disc": (0.2, "kg*m^2", "masses.0.inertia"),
    "k": (3.0, "N/m", "springs.0.stiffness"),
    "c": (0.2, "N*s/m", "springs.0.damping"),
    "free": (0.4, "m", "springs.0.length"),
    "kt": (2.0, "N*m", "torsion_springs.0.stiffness"),
    "ct": (0.1, "N*m*s", "torsion_springs.0.damping"),
}
PENDULUM = {
    "parameters": {n: {"value": f"{v} {unit}", "tunable": True} for n, (v, unit, _) in VALUES.items()},
    "points": {"O": ground(0, 0), "P": at(1, 0), "Q": at(1.5, 0.2)},
    "links": {
        "rod": {"points": ["O", "P"], "mass": "2*m/3 + m/3", "inertia": "inertia"},
        "arm": {"points": ["P", "Q"], "mass_per_length": "density"},
    },
    "masses": [{"point": "P", "mass": "tip", "inertia": "disc", "link": "rod"}],
    "springs": [{"between": ["O", "Q"], "stiffness": "k", "length": "free", "damping": "c"}],
    "torsion_springs": [{"link": "rod", "stiffness": "kt", "damping": "ct"}],
    "gravity": GRAVITY,
    "analysis": {"outputs": ["P.position"]},
}


@pytest.fixture(scope="module")
def pendulum():
    return build(symgen.Scene(**PENDULUM))


@pytest.mark.parametrize("name", VALUES)
def test_a_model_refuses_what_the_scene_refuses(pendulum, name):
    value, unit, where = VALUES[name]
    with pytest.raises(SceneError, match="of at least zero") as refused:
        build(symgen.Scene(**PENDULUM), set={name: f"{-value} {unit}"})
    assert refused.value.where == where
    with pytest.raises(RangeError, match=f"{where}: expected a value of at least zero, got -{value:g} "):
        pendulum.with_parameters(**{name: -value})
    assert pendulum.with_parameters(**{name: 0.0}).parameters[name] == 0.0
    assert pendulum.with_parameters(**{name: 2 * value}).parameters[name] == 2 * value


def test_many_runs_report_it_of_the_run(pendulum):
    masses = np.array([2.0, -2.0, 1.0, -1e-9])
    runs = pendulum.simulate_many({"m": masses}, t_end=0.01, samples=2)
    assert [bool(e) for e in runs["error"].values] == [False, True, False, True]
    assert "links.rod.mass: expected a value of at least zero, got -1e-09 kg" in str(runs["error"].values[3])
    assert np.all(np.isnan(runs["P.position"].values[1]))
    alone = pendulum.with_parameters(m=1.0).simulate(0.01, samples=2)
    assert np.array_equal(runs["P.position"].values[2], alone["P.position"].values)
    with pytest.raises(RangeError, match=r"springs.0.damping: .* got -1 N\*s/m"):
        pendulum.simulate_many({"m": [2.0, 1.0], "c": -1.0}, t_end=0.01)
    for analysis in ("equilibrium", "modes"):
        errors = getattr(pendulum, f"{analysis}_many")({"k": [3.0, -3.0]})["error"].values
        assert [bool(e) for e in errors] == [False, True]


def test_lanes_of_driven_linkages_and_sweeps_report_it():
    scene = four_bar(0.1, 0.35, 0.3, 0.4, 0.5).model_dump(exclude_unset=True)
    scene["parameters"] |= {"m": {"value": "1 kg", "tunable": True}}
    link = next(name for name, table in scene["links"].items() if "mass" in table)
    scene["links"][link]["mass"] = "m"
    model = symgen.build(symgen.Scene(**scene))
    masses = np.linspace(-0.5, 2.0, 11)
    runs = model.inverse_dynamics_many({"m": masses}, samples=3)
    assert np.array_equal(runs["error"].values != "", masses < 0.0)
    force = next(name for name in runs.data_vars if str(name).endswith(".force"))
    assert np.array_equal(np.isnan(runs[force].values).any(axis=(1, 2)), masses < 0.0)
    swept = model.sweep({"m": masses}, "inverse_dynamics", outputs=[force], samples=3)
    assert np.array_equal(swept["error"].values != "", masses < 0.0)


def test_bounds_of_an_optimisation(pendulum):
    with pytest.raises(ModelError, match=r"the bound -1 of k is not permitted: .*springs.0.stiffness"):
        pendulum.optimise({"k": (-1.0, 4.0)}, "P.position.final.x", t_end=0.01)


def body(inertia):
    """A body in space on a ball joint, with tunable moments of inertia."""
    return symgen.Scene(
        parameters={k: {"value": f"{v} kg*m^2", "tunable": True} for k, v in inertia.items()},
        points={
            "O": {"at": ["0 m", "0 m", "0 m"], "ground": True},
            "A": {"at": ["1 m", "0 m", "0 m"]},
            "B": {"at": ["0 m", "1 m", "0 m"]},
        },
        links={
            "top": {
                "points": ["O", "A", "B"],
                "mass": "1 kg",
                "centre": ["0.3 m", "0.2 m", "0 m"],
                "inertia": list(inertia),
            }
        },
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
        analysis={"outputs": ["A.position"]},
    )


@pytest.mark.parametrize("values", [{"a": 0.65}, {"a": -0.1}, {"d": 0.21}, {"d": -0.21}, {"e": 0.3}])
def test_moments_of_inertia_are_those_of_a_real_body(values):
    """Second moments (0.15, 0.1, 0.2) kg m^2: the largest moment exceeds the sum, or a product is too large."""
    scene = body({"a": 0.3, "b": 0.35, "c": 0.25, "d": 0.0, "e": 0.0, "f": 0.0})
    with pytest.raises(SceneError, match="no real body"):
        build(scene, set={k: f"{v} kg*m^2" for k, v in values.items()})
    model = build(scene)
    with pytest.raises(
        RangeError, match=r"links\.top\.inertia, of a real body: expected a value of at least zero"
    ):
        model.with_parameters(**values)
    model.with_parameters(**{k: v / 4 if k != "a" else 0.25 for k, v in values.items()})


def test_a_loop_and_an_elastic_link():
    loop = symgen.build(
        "rssr", set={"parameters": {"M": {"value": "0.5 kg", "tunable": True}}, **_link_of_loop("M")}
    )
    with pytest.raises(RangeError, match="expected a value of at least zero, got -1 kg"):
        loop.with_parameters(M=-1.0)
    beam = {
        "points": ["O", "tip"],
        "mass_per_length": "1 kg/m",
        "section": {"area": "1 m^2", "second_moment": "1e-6 m^4", "fibre": "0.01 m"},
        "elastic": {"E": "E", "elements": 2, "damping": {"mass": "d"}},
    }
    cantilever = symgen.Scene(
        parameters={"E": {"value": "1e6 Pa", "tunable": True}, "d": {"value": "1 1/s", "tunable": True}},
        points={"O": ground(0, 0), "tip": at(1, 0)},
        links={"beam": beam},
        crank={"link": "beam", "speed": "0 rad/s"},
        analysis={"t_end": "1 s"},
    )
    model = build(cantilever)
    for values, said in (
        ({"E": 0.0}, "elastic.E: expected a value above zero"),
        ({"d": -1.0}, "damping.mass"),
    ):
        with pytest.raises(RangeError, match=f"links.beam.*{said}"):
            model.with_parameters(**values)


def _link_of_loop(mass):
    links = symgen.load_scene("rssr").model_dump(exclude_unset=True)["loop"]["links"]
    return {f"loop.links.{next(iter(links))}.mass": mass}
