"""Messages that state the remedy: what users write first, and what they are told to write instead."""

from __future__ import annotations

import numpy as np
import pytest
from shared.in_numpy import build
from shared.linkages import GRAVITY, at, ground

import symgen
from symgen.errors import CapabilityError, SceneError

POINTS = {"O": ground(0, 0), "P": at(1, 0)}
RAIL = {"A": ground(-1, 0), "B": ground(1, 0)}


def pendulum(**tables):
    links = {"rod": {"points": ["O", "P"], "mass": "1 kg"}}
    return symgen.Scene(**{"points": POINTS, "links": links, "gravity": GRAVITY} | tables)


@pytest.mark.parametrize(
    "name", ["rod.O.force", "rod.O.force.x", "O.reaction.y", "rod.tension", "P.acceleration.x"]
)
@pytest.mark.parametrize("table", ["forces", "torques"])
def test_forces_in_loads(name, table):
    loads = {
        "forces": [{"point": "P", "force": [f"mu*{name}", "0 N"]}],
        "torques": [{"link": "rod", "torque": f"mu*r*{name}"}],
    }
    scene = pendulum(parameters={"mu": "0.3", "r": "1 cm"}, **{table: loads[table]})
    with pytest.raises(SceneError, match=f"{name}.*velocities alone(.|\n)*a typical force as a parameter"):
        build(scene)


@pytest.mark.parametrize(
    "text",
    [
        "115 mm - 20 mm*sin(3*t/s)",
        "1 m + 2 m",
        "3 m*sin(t/(1 s))",
        "2 m*max(1, t)",
        "1 m -0.2 m",
        "1 m*(2 + 1)",
    ],
)
def test_units_in_expressions(text):
    rod = {"points": ["O", "P"], "mass": "0 kg", "length": text}
    with pytest.raises(SceneError, match="expressions contain no units(.|\n)*under .parameters.") as refused:
        build(pendulum(links={"rod": rod}))
    assert refused.value.where == "links.rod.length"


@pytest.mark.parametrize("output", ["springs.0.rate", "springs.0.length", "rod.power", "rod.kinetic_energy"])
def test_outputs_in_rates_of_states_and_in_loads(output):
    """Expressions name what they may use of the motion: the names of this scene."""
    spring = {"between": ["O", "P"], "stiffness": "1 N/m", "length": "1 m"}
    state = {"start": "0 m", "rate": f"2*{output}"}
    torque = {"link": "rod", "torque": f"2*{output}"}
    of_state, of_load = pendulum(states={"x": state}, springs=[spring]), pendulum(torques=[torque])
    for scene, where in ((of_state, "states.x.rate"), (of_load, "torques.0.torque")):
        with pytest.raises(SceneError, match=f"uses '{output}', an output") as refused:
            build(scene)
        assert refused.value.where == where
        assert "O.x, O.vx, rod.angle, " in refused.value.hint
    with pytest.raises(SceneError, match="may not use"):
        build(pendulum(parameters={"a": f"2*{output}"}))


@pytest.mark.parametrize("text", ["1 mm*foo", "3 N-m", "2 kg m"])
def test_a_mistyped_unit_is_no_expression(text):
    with pytest.raises(SceneError, match="is not a unit that symgen knows"):
        build(pendulum(masses=[{"point": "P", "mass": text}]))


@pytest.mark.parametrize("angle", ["min(1, w*t)", "max(1, w*t)", "abs(sin(w*t))"])
def test_jumps_in_drives(angle):
    scene = pendulum(parameters={"w": "1 rad/s"}, drivers=[{"link": "rod", "angle": angle}])
    with pytest.raises(SceneError, match=r"where the argument of .* passes zero\n  Write profile.poly345"):
        build(scene)


def test_loads_on_a_rail():
    links = {"rail": {"points": ["A", "B"]}, "rod": {"points": ["O", "P"], "mass": "1 kg"}}
    tables = {"points": RAIL | POINTS, "links": links}
    for load in (
        {"forces": [{"point": "A", "force": ["1 N", "0 N"], "link": "rail"}]},
        {"torques": [{"link": "rail", "torque": "1 N*m"}]},
        {"distributed_forces": [{"link": "rail", "force": ["1 N/m", "0 N/m"]}]},
    ):
        with pytest.raises(
            SceneError, match="between two ground points(.|\n)*on its ground points, without link"
        ):
            build(pendulum(**tables, **load))
    load = {"forces": [{"point": "A", "force": ["1 N", "2 N"]}], "analysis": {"outputs": ["A.reaction"]}}
    run = build(pendulum(**tables, **load)).simulate(0.01, samples=2)
    assert run["A.reaction"].values[0] == pytest.approx([-1.0, -2.0])


@pytest.mark.parametrize(
    "joint, words",
    [
        ({"kind": "prismatic", "axis": [1, 0]}, "got 'prismatic'(.|\n)*Sliders are ..guides"),
        ({"kind": "revolute"}, "key is missing(.|\n)*by a pin in the plane"),
        ({"kind": "universal", "axis": [1, 0, 0]}, "common point, and a massless rod"),
    ],
)
def test_joints_of_rigid_links(joint, words):
    """What a user of other programs writes first names the statement that exists."""
    links = {"rod": {"points": ["O", "P"], "mass": "1 kg"}, "arm": {"points": ["P", "Q"], "mass": "1 kg"}}
    points, table = POINTS | {"Q": at(2, 1)}, {"point": "P", "links": ["rod", "arm"], **joint}
    if len(joint.get("axis", ())) == 3:
        points = {name: {**p, "at": [*p["at"], "0 m"]} for name, p in points.items()}
    with pytest.raises(SceneError, match=words):
        build(symgen.Scene(points=points, links=links, joints=[table]))


def test_forces_of_a_rail_are_not_proposed():
    links = {"rail": {"points": ["A", "B"]}, "rod": {"points": ["O", "P"], "mass": "1 kg"}}
    scene = pendulum(points=RAIL | POINTS, links=links, analysis={"outputs": ["rail.P.force"]})
    with pytest.raises(SceneError, match="no output 'rail.P.force'") as refused:
        build(scene)
    assert "rail." not in refused.value.hint


def test_a_length_that_depends_on_the_time_is_of_a_massless_link():
    """A rod held by a cylinder that grows by 1 mm/s: the length of the cylinder is that of the scene."""
    points = POINTS | {"Q": ground(2, 1)}
    links = {
        "rod": {"points": ["O", "P"], "mass": "1 kg"},
        "cylinder": {"points": ["P", "Q"], "length": "l + v*t"},
    }
    outputs = {"outputs": ["P.position", "cylinder.tension"]}
    tables = {
        "parameters": {"v": "1 mm/s", "l": "1.5 m"},
        "points": points,
        "links": links,
        "analysis": outputs,
    }
    run = build(pendulum(**tables)).simulate(0.5, samples=2)
    x, y = run["P.position"].values[-1]
    assert (x - 2) ** 2 + (y - 1) ** 2 == pytest.approx(1.5005**2, rel=1e-12)


def test_joint_forces_in_space():
    place = lambda *x: {"at": [f"{c} m" for c in x]}  # noqa: E731
    scene = symgen.Scene(
        parameters={"w": "1 rad/s"},
        points={"O": place(0, 0, 0) | {"ground": True}, "A": place(1, 0, 0), "B": place(1, 1, 0.5)},
        links={
            "crank": {"points": ["O", "A"], "mass": "1 kg"},
            "rod": {"points": ["A", "B"], "mass": "1 kg"},
        },
        joints=[{"point": "O", "links": ["crank"], "kind": "revolute", "axis": [0, 0, 1]}],
        drivers=[{"link": "crank", "angle": "w*t"}],
    )
    with pytest.raises(CapabilityError, match="needs 2 more drives"):
        build(scene).inverse_dynamics(samples=3)
    tables = scene.model_dump(exclude_unset=True)
    del tables["points"]["B"], tables["links"]["rod"]
    with pytest.raises(CapabilityError, match="selects none\n  Write LINK.POINT.force"):
        build(symgen.Scene(**tables)).inverse_dynamics(samples=3)


def beam(**tables):
    """An elastic cantilever."""
    link = {
        "points": ["O", "P"],
        "mass_per_length": "1 kg/m",
        "section": {"area": "1 m^2", "second_moment": "1e-6 m^4", "fibre": "0.01 m"},
        "elastic": {"E": "1e6 Pa", "elements": 2},
    }
    return symgen.Scene(points=POINTS, links={"beam": link}, analysis={"t_end": "1 s"}, **tables)


def test_a_cantilever():
    with pytest.raises(SceneError, match='the ground clamps has speed = "0 rpm"'):
        build(beam(gravity=GRAVITY))
    clamped = beam(crank={"link": "beam", "speed": "0 rpm"}, gravity=GRAVITY)
    tip = build(clamped).quasi_static(samples=2)["P.displacement"].values[-1, 1]
    assert tip == pytest.approx(-9.81 / 8, rel=1e-9)


def test_a_couple_by_the_rotation_of_a_section_in_equilibrium():
    couple = [{"link": "beam", "point": "P", "torque": "c*(1 - 1e-9*this.angle)"}]
    crank = {"link": "beam", "speed": "0 rpm"}
    model = build(beam(crank=crank, torques=couple, parameters={"c": "0.1 N*m"}))
    found = model.equilibrium(elements=8).state.positions["P"]
    assert found == pytest.approx([np.sin(0.1) / 0.1, (1 - np.cos(0.1)) / 0.1], abs=1e-8), "an arc"
    assert model.quasi_static(samples=2)["P.displacement"].values[-1, 1] == pytest.approx(0.05, rel=1e-9)


@pytest.mark.parametrize("name", ["wiper_good.toml", "wiper_good", "wiper_gut.toml"])
def test_a_mistyped_file(tmp_path, monkeypatch, name):
    (tmp_path / "wiper_gud.toml").write_text("symgen = 1\n")
    monkeypatch.chdir(tmp_path)
    for folder in ("", "./", f"{tmp_path}/"):
        with pytest.raises(
            SceneError, match=r"Did you mean '.*wiper_gud\.toml'\? 'symgen scenes' lists"
        ) as refused:
            symgen.build(f"{folder}{name}")
        assert "four_bar" not in str(refused.value)
    with pytest.raises(SceneError, match="Did you mean 'four_bar'"):
        symgen.build("four_bra")


def test_a_quantity_of_the_whole_mechanism_has_no_prefix():
    with pytest.raises(SceneError, match="Did you mean 'shaking_force'"):
        build(pendulum(analysis={"outputs": ["mechanism.shaking_force"]}))
