"""The JSON Schema that editors use says what symgen itself says."""

from __future__ import annotations

import re
import tomllib

import pytest

import symgen
from symgen.cli.common import changes
from symgen.errors import SceneError
from symgen.scene.faults import tables_in
from symgen.scene.loading import SHIPPED, SceneText, check_scene, override, read_scene
from symgen.scene.schema import Scene

SCHEMA = Scene.model_json_schema()
TYPES = {
    "object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float),
    "null": type(None),
}  # fmt: skip


def faults(value, schema, at="scene"):
    """Check a value by the words of JSON Schema that pydantic uses; no other word may appear."""
    known = {
        "$defs", "$ref", "additionalProperties", "anyOf", "const", "default", "description", "enum", "items",
        "maxItems", "maxLength", "minItems", "minProperties", "pattern", "patternProperties", "properties",
        "propertyNames", "required", "title", "type",
    }  # fmt: skip
    if schema is False:
        return [f"{at} may not be there"]
    assert set(schema) <= known, set(schema) - known
    if "$ref" in schema:
        return faults(value, SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]], at)
    found = []
    if "anyOf" in schema:
        each = [faults(value, option, at) for option in schema["anyOf"]]
        found += [] if [] in each else each[0]
    kind = schema.get("type")
    if kind and (not isinstance(value, TYPES[kind]) or (kind != "boolean" and isinstance(value, bool))):
        return [f"{at} is no {kind}"]
    if "const" in schema and value != schema["const"]:
        found.append(f"{at} is not {schema['const']}")
    if "enum" in schema and value not in schema["enum"]:
        found.append(f"{at} is none of {schema['enum']}")
    if isinstance(value, str):
        if not re.search(schema.get("pattern", ""), value) or len(value) > schema.get("maxLength", 1e9):
            found.append(f"{at} does not match")
    elif isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 1e9):
            found.append(f"{at} has {len(value)} items")
        for i, item in enumerate(value):
            found += faults(item, schema.get("items", {}), f"{at}.{i}")
    elif isinstance(value, dict):
        found += [f"{at} misses {k}" for k in schema.get("required", ()) if k not in value]
        if len(value) < schema.get("minProperties", 0):
            found.append(f"{at} is empty")
        for key, item in value.items():
            inner = schema.get("properties", {}).get(key)
            if inner is None:
                patterns = schema.get("patternProperties", {}).items()
                inner = next((s for p, s in patterns if re.search(p, key)), None)
            if inner is not None:
                found += faults(item, inner, f"{at}.{key}")
            elif "patternProperties" in schema or schema.get("additionalProperties") is False:
                found.append(f"{at}.{key} is unknown")
    return found


LOOP = {
    "rows": [
        {"joint": "R", "link": "shaft", "theta": "theta1", "a": "1 m"},
        {"joint": "R", "link": "ground", "theta": "?", "a": "-1 m"},
    ],
    "inputs": {"theta1": "t"},
    "drives": {"theta1": "?"},
    "links": {"shaft": {"mass": "1 kg", "inertia": ["1 kg*m^2", "1 kg*m^2", "1 kg*m^2"]}},
    "loads": [{"link": "shaft", "force": [0, 0, "1 N"]}],
}


def looped(**changes):
    return {"symgen": 1, "loop": {**LOOP, **changes}}


def tables(**changes):
    return {
        "symgen": 1,
        "parameters": {"rho": "1 kg/m", "m": {"value": "1 kg", "tunable": True, "about": "mass"}},
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", 0]}},
        "links": {"OA": {"points": ["O", "A"], "mass": "m", "centre": 0.5}},
        "start": {"rates": {"OA": "1 rad/s"}},
        **changes,
    }


@pytest.mark.parametrize("name", symgen.shipped_scenes())
def test_shipped_scenes_are_valid_for_editors(name):
    assert faults(tomllib.loads((SHIPPED / f"{name}.toml").read_text(encoding="utf-8")), SCHEMA) == []


GOOD = [
    {},
    {"parameters": {"a": 2}},
    {"forces": [{"point": "A", "force": ["1 N", "0 N"]}]},
    {"about": "two\nlines, µ and \U0001d11e"},
]


@pytest.mark.parametrize(
    "change",
    [
        *GOOD,
        {"parameters": {"a": {"tunable": True}}},
        {"parameters": {"a-b": "1 m"}},
        {"parameters": {"a": True}},
        {"symgen": 2},
        {"pionts": {}},
        {"links": {"OA": {"points": ["O"]}}},
        {"links": {"OA": {"points": ["O", "A"], "mas": "1 kg"}}},
        {"links": {"OA": {"points": ["O", "A"], "mass": [1]}}},
        {"points": {"O": {"at": ["0 m"]}}},
        {"points": {"O": {"at": ["0 m", True]}}},
        {"points": {"O": {"at": ["0 m", "0 m"], "ground": "yes"}}},
        {"forces": [{"point": "A"}]},
        {"forces": {"point": "A", "force": ["1 N", "0 N"]}},
        {"analysis": {"kind": "magic"}},
        {"analysis": {"outputs": "energy"}},
        {"start": {"rates": {"OA": [1]}}},
        {"title": "bell\a"},
    ],
    ids=str,
)
def test_the_schema_and_symgen_agree(change):
    data = tables(**change)
    try:
        check_scene(SceneText("x", "x.toml", data))
        accepted = True
    except SceneError as error:
        accepted = False
        assert error.file == "x.toml"
        assert error.where
    assert accepted == (faults(data, SCHEMA) == [])
    assert accepted == (change in GOOD)


GOOD_LOOPS = [
    {},
    {"range": ["0 deg", "90 deg"]},
    {"free": {"theta2": {"at": "1 deg"}}},
]


@pytest.mark.parametrize(
    "change",
    [
        *GOOD_LOOPS,
        {"rows": LOOP["rows"][:1]},
        {"rows": [{**LOOP["rows"][0], "thta": "1 deg"}, LOOP["rows"][1]]},
        {"rows": [{"link": "shaft"}, LOOP["rows"][1]]},
        {"units": {"length": "in"}},
        {"range": ["0 deg"]},
        {"free": {"theta2": {"rate": "1 rad/s"}}},
        {"links": {"shaft": {"inertia": LOOP["links"]["shaft"]["inertia"]}}},
        {"links": {"shaft": {"mass": "1 kg", "centre": ["1 m", "1 m"]}}},
        {"loads": [{"link": "shaft", "frame": "world"}]},
        {"drives": {"theta-1": "?"}},
    ],
    ids=str,
)
def test_the_schema_and_symgen_agree_on_loops(change):
    data = looped(**change)
    try:
        check_scene(SceneText("x", "x.toml", data))
        accepted = True
    except SceneError as error:
        accepted = False
        assert error.where.startswith("loop.")
    assert accepted == (faults(data, SCHEMA) == [])
    assert accepted == (change in GOOD_LOOPS)


@pytest.mark.parametrize(
    "change, where",
    [
        ({"points": {"O": {"at": [0, 0]}}}, "points"),
        ({"springs": []}, "springs"),
        ({"loop": None}, "points"),
    ],
)
def test_a_scene_is_of_points_and_links_or_of_a_loop(change, where):
    data = {k: v for k, v in {**looped(), **change}.items() if v is not None}
    assert faults(data, SCHEMA) != []
    with pytest.raises(SceneError, match="has points and links, or a loop") as caught:
        check_scene(SceneText("x", "x.toml", data))
    assert caught.value.where == where


@pytest.mark.parametrize(
    "change, where, known",
    [
        ({"rows": [{**LOOP["rows"][0], "thta": "1 deg"}, LOOP["rows"][1]]}, "loop.rows.0.thta", "theta"),
        ({"links": {"links": {"mas": "1 kg"}}}, "loop.links.links.mas", "mass"),
        ({"loads": [{"link": "shaft", "forse": [0, 0, 0]}]}, "loop.loads.0.forse", "force"),
        ({"free": {"theta2": {"att": 0}}}, "loop.free.theta2.att", "at"),
        ({"imputs": {}}, "loop.imputs", "inputs"),
    ],
)
def test_a_misspelled_key_inside_a_loop_names_the_nearest(change, where, known):
    with pytest.raises(SceneError, match=f"Did you mean '{known}'") as caught:
        symgen.Scene(**looped(**change))
    assert caught.value.where == where


def test_a_file_says_its_version_and_python_need_not():
    assert "symgen" in SCHEMA["required"]
    without = {k: v for k, v in tables().items() if k != "symgen"}
    assert symgen.Scene(**without).symgen == 1
    with pytest.raises(SceneError, match="there is no such key"):
        check_scene(SceneText("x", "x.toml", without))


TABLES = [(name, table) for name, f in Scene.model_fields.items() for table in [*tables_in(f.annotation)][:1]]


@pytest.mark.parametrize("name, table", TABLES)
def test_a_misspelled_key_names_the_nearest(name, table):
    key = max(table.model_fields, key=len)
    wrong = {key[:-1] + "X": "1"}
    many = Scene.model_fields[name].annotation
    value = [wrong] if "list" in str(many) else ({"A": wrong} if str(many).startswith("dict") else wrong)
    with pytest.raises(SceneError, match=f"unknown key '{key[:-1]}X'\n  Did you mean '{key}'") as caught:
        symgen.Scene(**tables(**{name: value}))
    assert caught.value.where.startswith(f"{name}.")


def test_a_point_called_like_a_python_type_keeps_its_place():
    with pytest.raises(SceneError) as caught:
        symgen.Scene(**tables(points={"int": {"at": ["0 m", [1]]}}))
    assert caught.value.where == "points.int.at.1"
    with pytest.raises(SceneError) as caught:
        symgen.Scene(**tables(start={"rates": {"str": True}}))
    assert caught.value.where == "start.rates.str"


def test_overrides_remove_keys_tables_and_entries():
    springs = [{"points": ["O", "A"], "stiffness": f"{k} N/m"} for k in range(4)]
    text = SceneText("x", "x.toml", tables(title="old", springs=springs))
    removed = {"springs.0": None, "springs.2": None, "springs.3.stiffness": "9 N/m", "points.A.ground": True}
    data = override(text, {**removed, "title": None, "rho": None}).data
    assert [spring["stiffness"] for spring in data["springs"]] == ["1 N/m", "9 N/m"]
    assert "title" not in data
    assert "rho" not in data["parameters"]
    assert "title" in text.data
    assert "springs" not in override(text, {"springs": None}).data
    assert "rho" not in override(text, {"parameters": {"rho": None}}).data["parameters"]
    assert "mass" not in override(read_scene("four_bar"), {"links.crank.mass": None}).data["links"]["crank"]


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("links.crank.masss", "Did you mean 'links.crank.mass'?"),
        ("links.crnk.mass", "Did you mean 'links.crank'?"),
        ("gravity.acceleration.2", "Did you mean 'gravity.acceleration.[01]'?"),
        ("springs.0", "Known|nearest|Did you mean"),
        ("nothing", "Known|nearest|Did you mean"),
    ],
)
def test_what_is_not_there_is_not_removed(key, hint):
    with pytest.raises(SceneError, match=f"there is no key '{key}' to remove\n.*({hint})"):
        override(read_scene("four_bar"), {key: None})
    with pytest.raises(SceneError, match="to remove"):
        override(read_scene("four_bar"), {"links.crank": None, "links.crank.mass": None})


@pytest.mark.parametrize(
    "removed", [changes(["masses=none"]), {"masses": None}, changes(["masses.1=none", "masses.0=none"])]
)
def test_a_scene_without_what_was_removed(removed):
    assert len(symgen.load_scene("elastic_four_bar").masses) == 2
    assert not symgen.load_scene("elastic_four_bar", set=removed).masses


def test_overrides_reach_into_lists():
    text = SceneText("x", "x.toml", tables(title="old"))
    assert override(text, {"points.A.at.1": "3 m"}).data["points"]["A"]["at"] == ["1 m", "3 m"]
    assert override(text, {"title": "new"}).data["title"] == "new"
    assert override(text, {"rho": "2 kg/m"}).data["parameters"]["rho"] == "2 kg/m"
    for key in ("points.A.at.2", "points.A.at.x", "points.A.at.-1", "titel", ""):
        with pytest.raises(SceneError, match="no parameter and no key"):
            override(text, {key: "1"})
