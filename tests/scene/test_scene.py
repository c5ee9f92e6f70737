"""Scenes from files and from Python, overrides, and the JSON Schema."""

from __future__ import annotations

import json
import tomllib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shared.full import full_unless

import symgen
from symgen.errors import SceneError
from symgen.pipeline.systems import derive
from symgen.scene.faults import tables_in
from symgen.scene.loading import SHIPPED, SceneText, check_scene, override, read_scene, shipped_scene, text_of
from symgen.scene.resolve import resolve
from symgen.scene.schema import Scene

#: Links in the plane and in space, with drives, events and springs; loops; elastic links.
OF_EACH = (
    "four_bar",
    "peaucellier",
    "crank_rocker",
    "tumbling_body",
    "car_axis",
    "slider_crank",
    "cssp",
    "thesis_four_bar",
)


@pytest.mark.parametrize(
    ("name",), full_unless(OF_EACH.__contains__, [(n,) for n in symgen.shipped_scenes()])
)
def test_the_same_scene_from_python(name):
    data = tomllib.loads((SHIPPED / f"{name}.toml").read_text(encoding="utf-8"))
    made = symgen.Scene(**data)
    a, b = derive(name), derive(made)
    assert [m.matrix for m in a.matrices] == [m.matrix for m in b.matrices]
    assert made.name == "scene" and symgen.load_scene(name).name == name


def test_shipped_scenes_are_those_of_the_issue_list():
    assert {"peaucellier", "peaucellier_perturbed", "triple_pendulum", "four_bar"} <= set(
        symgen.shipped_scenes()
    )


def test_json_schema_describes_every_table():
    schema = Scene.model_json_schema()
    assert schema["additionalProperties"] is False
    assert schema["properties"]["symgen"]["const"] == 1
    for field in Scene.model_fields.values():
        assert all(table.__doc__ for table in tables_in(field.annotation))


def test_scene_errors_in_python_are_scene_errors():
    with pytest.raises(SceneError, match=r"\[points.A\] att: unknown key .att.\n  Did you mean .at."):
        symgen.Scene(points={"A": {"att": ["0 m", "0 m"]}}, links={})


def test_scenes_do_not_change():
    scene = symgen.load_scene("four_bar")
    with pytest.raises(Exception, match="frozen"):
        scene.title = "other"
    assert scene.called("again").name == "again" and scene.name == "four_bar"


def test_scenes_of_python_have_names(tmp_path):
    tables = symgen.load_scene("four_bar").model_dump(exclude_unset=True)
    scene = symgen.Scene(name="press", **tables)
    assert (scene.name, symgen.Scene(**tables).name) == ("press", "scene")
    assert "'press'" in repr(scene) and symgen.build(scene).name == "press"
    for wrong in ("my press", "2nd", "", "a" * 41, "press\n"):
        with pytest.raises(SceneError, match="expected a name of letters, digits"):
            symgen.Scene(name=wrong, **tables)
        with pytest.raises(SceneError, match="expected a name of letters, digits"):
            scene.called(wrong)
    file = tmp_path / "machine.toml"
    file.write_text('name = "press"\n' + shipped_scene("four_bar"))
    with pytest.raises(SceneError, match="the name of a scene is that of its file"):
        symgen.load_scene(file)


@pytest.mark.parametrize("reverse", [False, True])
def test_new_parameters(reverse):
    """Also where the scene has none, together with what uses them, in any order."""
    text = read_scene("vertical_rods")
    assert "parameters" not in text.data
    values = {
        "parameters.rho": {"value": "0.5 kg/m", "tunable": True},
        "links.upper.mass_per_length": "4*rho",
    }
    changes = dict(reversed(values.items())) if reverse else values
    model = symgen.build("vertical_rods", set=changes)
    assert [p.name for p in model.description.parameters] == ["rho"]
    same = symgen.build("vertical_rods", set={"links.upper.mass_per_length": "2 kg/m"})
    tensions = [float(m.simulate(0.1)["upper.tension"][-1]) for m in (model, same)]
    assert tensions[0] == pytest.approx(tensions[1], rel=1e-9)
    other = symgen.build("vertical_rods").simulate(0.1)
    assert tensions[0] != pytest.approx(float(other["upper.tension"][-1]), rel=1e-2)


def test_overrides():
    text = read_scene("peaucellier")
    assert override(text, {"rho": "2 kg/m"}).data["parameters"]["rho"]["value"] == "2 kg/m"
    assert override(text, {"links.OA.mass": "1 kg"}).data["links"]["OA"]["mass"] == "1 kg"
    assert text.data["parameters"]["rho"]["value"] == "1 kg/m"
    for key in ("parameters.rho", "parameters.rho.value"):
        changed = override(text, {key: "2 kg/m"}).data["parameters"]["rho"]
        assert changed == text.data["parameters"]["rho"] | {"value": "2 kg/m"}
    for key in ("roh", "links.OX.mass", "title.x"):
        with pytest.raises(SceneError, match="no parameter and no key"):
            override(text, {key: "1"})
    with pytest.raises(SceneError, match=r"nothing uses the new parameter 'roh'\n  Did you mean 'rho'"):
        override(text, {"parameters.roh": "2 kg/m"})
    for key, meant in (("parameter.k", "parameters.k"), ("springs.stiffness", "springs.0.stiffness")):
        with pytest.raises(SceneError, match=f"Did you mean '{meant}'"):
            override(SceneText("a", "a.toml", {"springs": [{"stiffness": "k"}]}), {key: "1"})
    with pytest.raises(SceneError, match=r"Set analysis.t_end, or give --t-end to the analysis"):
        override(text, {"t_end": "1 s"})
    for scene in ("peaucellier", "rotating_cantilever"):  # the latter has no table [analysis]
        assert symgen.load_scene(scene, set={"analysis.t_end": "3 s"}).analysis.t_end == "3 s"


def test_a_table_of_parameters_keeps_those_that_it_does_not_name():
    """A law with parameters of its own, beside a tunable one, a constant and an input of the scene."""
    scene = symgen.Scene(
        parameters={"m": {"value": "2 kg", "tunable": True}, "g": "9.81 m/s^2"},
        inputs={"F": {"value": "0 N"}},
        points={"A": {"at": [0, 0], "ground": True}, "P": {"at": [0, "-1 m"]}},
        links={"rod": {"points": ["A", "P"], "mass": "m"}},
        gravity={"acceleration": [0, "-g"]},
        forces=[{"point": "P", "force": ["F", 0]}],
        analysis={"outputs": ["A.reaction"]},
    )
    law = {"parameters": {"k": "3 N/m", "m": "1 kg"}, "inputs": {"G": {"value": "1 N"}}}
    model = symgen.build(scene, set=law | {"forces.0.force": ["F - k*P.x", "G"]}, backend="numpy")
    assert dict(model.parameters) == {"m": 1.0, "F": 0.0, "G": 1.0}
    assert model.accelerations().reactions["A"] == pytest.approx([0.0, 9.81 - 1.0])
    bare, used = SceneText("a", "a.toml", {"title": "with c"}), [{"point": "P", "force": ["2*c", 0]}]
    assert override(bare, {"parameters.c": "1 N", "forces": used}).data["parameters"] == {"c": "1 N"}
    with pytest.raises(
        SceneError, match=r"a.toml: \[parameters\] c: nothing uses the new parameter 'c'\n  Write it"
    ):
        override(bare, {"parameters.c": "1 N"})
    with pytest.raises(SceneError, match=r"a.toml: \[inputs\] c: nothing uses the new input 'c'\n  Write it"):
        override(bare, {"inputs.c": "1 N"})
    replaced = {"value": "1 kg", "about": "mass"}
    assert override(text_of(scene), {"m": replaced}).data["parameters"]["m"] == replaced


LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 3),
    st.floats(),
    st.sampled_from(
        [
            "",
            "nan",
            "0 m",
            "-1 kg",
            "1e308 m",
            "rho",
            "rho*rho",
            "t",
            "2 cm",
            "open('x')",
            "A",
            "O",
            "\x00",
            "?",
            "theta1",
            "theta1*theta1",
            "30 deg",
            "speed*t",
            "R",
            "S",
            "P",
            "ground",
            "1e200*t",
        ]
    ),
    st.text(max_size=8),
    st.just([]),
    st.just({}),
)


def paths(data, at=()):
    if isinstance(data, dict):
        for key, value in data.items():
            yield (*at, key)
            yield from paths(value, (*at, key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield (*at, i)
            yield from paths(value, (*at, i))


@settings(max_examples=120, deadline=5000, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_a_mutated_scene_is_a_scene_or_a_scene_error(data):
    """Any value of a shipped scene replaced by nonsense, or removed: never another exception."""
    tables = json.loads(json.dumps(read_scene(data.draw(st.sampled_from(symgen.shipped_scenes()))).data))
    for _ in range(data.draw(st.integers(1, 2))):
        path = data.draw(st.sampled_from(sorted(paths(tables), key=str)))
        table = tables
        for part in path[:-1]:
            table = table[part]
        if data.draw(st.booleans()) and isinstance(table, dict):
            del table[path[-1]]
        else:
            table[path[-1]] = data.draw(LEAVES)
    try:
        found = resolve(check_scene(SceneText("mutated", "mutated.toml", tables)))
    except SceneError as error:
        assert str(error).startswith("mutated.toml: ")
        return
    assert found.rows if "loop" in tables else found.points


def test_a_list_of_tables_written_as_one_table_is_told_its_brackets():
    springs = {"between": ["O", "A"], "stiffness": "1 N/m", "length": "1 m"}
    with pytest.raises(SceneError, match=r"expected a list.*\n  .*double brackets: \[\[springs\]\]\."):
        symgen.Scene(springs=springs)


def test_a_table_that_a_scene_omits_is_set_as_a_whole():
    torques = [{"link": "crank", "torque": "M"}]
    changes = {"inputs.M": "0 N*m", "torques": torques}
    assert override(read_scene("four_bar"), changes).data["torques"] == torques
    with pytest.raises(SceneError, match="no parameter and no key 'torqes'"):
        override(read_scene("four_bar"), {"torqes": torques})


def test_the_next_number_appends_to_a_list_of_tables():
    driver, text = {"link": "rocker", "angle": "1"}, read_scene("crank_rocker")
    (first,) = text.data["drivers"]
    assert override(text, {"drivers.1": driver}).data["drivers"] == [first, driver]
    both = override(text, {"drivers.1": driver, "drivers.1.angle": "2", "forces.0": {"point": "B"}}).data
    assert both["drivers"] == [first, driver | {"angle": "2"}]
    assert both["forces"] == [{"point": "B"}]
    for key, following in (("drivers.2", "drivers.1"), ("forces.1", "forces.0")):
        with pytest.raises(SceneError, match=rf"no key '{key}' to set\n  The next entry is {following}="):
            override(text, {key: driver})
    with pytest.raises(SceneError, match="no key 'points.A.at.2'"):
        override(text, {"points.A.at.2": "1 m"})


def test_the_centre_of_a_rod_is_a_fraction_or_a_position():
    rod = {"points": ["O", "A"], "mass": "1 kg", "centre": "0.2 m"}
    points = {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}}
    expected = (
        r"centre: expected a fraction of the length, or a position as drawn, got '0.2 m', a length\n.*0.4"
    )
    with pytest.raises(SceneError, match=expected):
        symgen.build(symgen.Scene(points=points, links={"rod": rod}))
