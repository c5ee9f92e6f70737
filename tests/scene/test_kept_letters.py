"""Constants of a scene are letters wherever the scene has a value, or it is said why not."""

from __future__ import annotations

from copy import deepcopy
from fnmatch import fnmatchcase
from pathlib import Path

import mpmath
import numpy as np
import pytest

import symgen
from symgen.pipeline.assembled import assembled_of
from symgen.pipeline.systems import system_of
from symgen.scene.elastic.letters import elastic_in_letters
from symgen.scene.expressions import parse_any
from symgen.scene.loading import read_scene
from symgen.scene.resolve import resolve
from symgen.scene.rods.letters import in_letters
from symgen.scene.schema import Scene
from symgen.scene.units import is_quantity
from symgen.symbolic.exact import Exact

CASES = Path(__file__).parents[1] / "cases"
SCENES = ("car_axis", "double_four_bar", "tumbling_body", "cssp", "screw_jack", "crank_rocker")
#: Of tests/cases.
FURTHER = ("mutated_elastic", "mutated_rods", "strut_suspension", "event_wrap", "wiper", "gap")

_STARTS = "only the start needs it"
_DRAWN = "the equations hold lengths, which are letters of their own"
_SPACE = "the equations hold masses of base points, and tables of elements in numbers"
_MODES = "modes follow from it by numbers"
#: Values that are not kept, and why.
NOT_KEPT = {
    "start.*": _STARTS,
    "loop.start.*": _STARTS,
    "loop.free.*": _STARTS,
    "points.*.at.*": _DRAWN,
    "links.*.centre.*": _DRAWN,
    "links.*.inertia.*": _SPACE,
    "*.damping.ratio": _MODES,
    "modal_damping.ratio*": _MODES,
    "links.*.elastic.yield_stress": "only verdicts need it",
    "stations.*.at": "it selects an element",
    "joints.*": _SPACE,
    "links.*.section.width_along.*": _SPACE,
    "loop.range.*": "runs need it",
    "analysis.*": "runs need it",
    "sweep.*": "runs need it",
    "optimise.*": "runs need it",
}


BARS = {
    "points": {"O": {"at": [0, 0], "ground": True}, "P": {"at": ["0.3 m", 0]}, "Q": {"at": ["0.9 m", "0.1 m"]}},
    "links": {
        "bar": {"points": ["O", "P"], "mass_per_length": "2 kg/m"},
        "rod": {"points": ["P", "Q"], "density": "7800 kg/m^3", "section": {"diameter": ["2 cm", "1.5 cm"]}},
    },
}  # fmt: skip
#: Tables of which no scene above has all keys with values that are no expressions.
LOADED = BARS | {
    "points": BARS["points"] | {"S": {"on": "rod", "fraction": 0.3, "offset": "2 cm"}},
    "actuators": [{"between": ["O", "Q"], "force": "3 N"}],
    "distributed_forces": [{"link": "rod", "force": ["1 N/m", "2 N/m"], "end": ["3 N/m", "4 N/m"]}],
    "torques": [{"link": "rod", "torque": "2 N*m"}],
    "torsion_springs": [{"link": "bar", "stiffness": "2 N*m", "angle": "20 deg", "damping": "0.1 N*m*s"}],
    "bushings": [
        {"between": ["O", "S"], "link": "rod", "stiffness": ["3 N/m", "4 N/m"], "damping": ["1 N*s/m", "2 N*s/m"],
         "angular_stiffness": "2 N*m", "angular_damping": "1 N*m*s", "angle": "20 deg"},
    ],
    "bearings": [
        {"link": "rod", "against": "bar", "point": "P", "coefficient": 0.2, "radius": "2 cm", "transition": "3 rad/s"}
    ],
    "masses": [{"point": "S", "mass": "1 kg", "inertia": "0.1 kg*m^2"}],
    "drivers": [{"link": "bar", "angle": "30 deg"}],
    "outputs": [{"name": "high", "value": "2 m"}],
}  # fmt: skip
_FIBRE = {"area": "3 cm^2", "second_moment": "200 mm^4", "fibre": "4 mm"}
_SHEAR = {"poisson": 0.3, "factor": 0.8}
_FOUND = {"E": "70 GPa", "elements": 1, "element": "timoshenko"}
ELASTIC = BARS | {
    "links": {
        "bar": {"points": ["O", "P"], "mass_per_length": "2 kg/m", "section": _FIBRE,
                "elastic": _FOUND | {"shear": _SHEAR, "damping": {"mass": "2 1/s", "stiffness": "1e-5 s"}}},
        "rod": {"points": ["P", "Q"], "mass": "1 kg", "section": {"width": "1 cm", "thickness": "8 mm"},
                "elastic": _FOUND | {"shear": {"modulus": "26 GPa"}}},
    },
    "crank": {"link": "bar", "mode": "motor", "angle": "10 deg", "speed": "2 rad/s", "torque": "2 N*m", "flywheel": "2 kg*m^2"},
    "stations": [{"link": "rod", "at": 0.5, "fibre": "3 mm"}],
    "forces": [{"point": "Q", "force": ["3 N", "1 N"]}],
}  # fmt: skip
_ANY = {"mass": "2 kg", "centre": ["1 cm", "2 cm", "3 cm"], "inertia": ["1 kg*m^2", "2 kg*m^2", "2 kg*m^2"]}
_ROUND = {"mass": "2 kg", "centre": ["1 cm", 0, 0], "inertia": ["1 kg*m^2", "j", "j"]}
LOOP = {
    "parameters": {"speed": "2 rad/s", "j": "2 kg*m^2"},
    "loop": {
        "inputs": {"theta1": "speed*t"},
        "rows": [
            {"joint": "R", "link": "crank", "theta": "theta1", "S": "1 cm", "eta": "5 deg", "a": "10 cm"},
            {"joint": "S", "link": "rod", "theta": "?", "eta": "?", "a": "45 cm"},
            {"joint": "S", "link": "rocker", "theta": "?", "eta": "?", "alpha": "?", "a": "30 cm"},
            {"joint": "H", "link": "ground", "theta": "?", "pitch": "1 mm", "alpha": "60 deg", "a": "-35 cm"},
        ],
        "links": {"crank": _ANY, "rod": _ROUND, "rocker": _ANY},
        "loads": [
            {"link": "crank", "at": ["1 cm", "2 cm", "3 cm"], "force": ["1 N", "2 N", "3 N"],
             "torque": ["1 N*m", "2 N*m", "3 N*m"]},
        ],
        "drives": {"theta1": "?"},
    },
}  # fmt: skip
MOUNTED = {
    "points": {"G": {"at": [0, 0, 0], "ground": True}, "M": {"at": [0, 0, 0]}, "P": {"at": ["3 cm", 0, "2 cm"]}},
    "links": {"engine": {"points": ["M", "P"], **_ANY}},
    "bushings": [
        {"between": ["G", "M"], "link": "engine", "stiffness": ["1 N/m", "2 N/m", "3 N/m"],
         "angular_stiffness": ["1 N*m", "2 N*m", "4 N*m"], "angular_damping": ["1 N*m*s", "2 N*m*s", "3 N*m*s"]},
    ],
}  # fmt: skip
MOVED = BARS | {"motions": [{"of": "Q.x", "value": "80 cm"}], "torques": [{"link": "bar", "torque": "?"}]}
WRITTEN = {"bars": LOADED, "moved": MOVED, "elastic": ELASTIC, "loop": LOOP, "mounted": MOUNTED}


def leaves(data, path=()):
    """Yield the quantities of a scene with their places."""
    if isinstance(data, dict | list):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from leaves(value, (*path, key))
    elif not isinstance(data, bool) and is_quantity(str(data)) and path[-1] not in ("elements", "modes"):
        yield path, data


def written(data, path):
    """Return the constants of the equations of a scene where the value at a place is one."""
    data, name = deepcopy(data), "zeta9"
    table = data
    for key in path[:-1]:
        table = table[key]
    data.setdefault("parameters", {})[name] = table[path[-1]]
    table[path[-1]] = name
    scene = resolve(symgen.Scene(**data))
    found = [in_letters(scene)[1]]
    if getattr(scene, "elastic", ()) and scene.dimension == 2:
        found.append(elastic_in_letters(scene)[1])
    return name in {c.quantity.name for letters in found for c in letters.constants}


def stated(where, data):
    """Return whether a value is one that is not kept: those above, and nodes of elastic links."""
    if where.startswith("points.") and where.endswith(".fraction"):
        return "elastic" in data["links"][data["points"][where.split(".")[1]]["on"]]
    return any(fnmatchcase(where, pattern) for pattern in NOT_KEPT)


def tables(name):
    """Return a scene as data, and the places of its values that are kept."""
    if name in WRITTEN:
        data = WRITTEN[name]
    else:
        data = read_scene(str(CASES / f"{name}.toml") if name in FURTHER else name).data
    apart = ("symgen", "title", "about", "units", "parameters", "inputs")
    places = leaves({key: table for key, table in data.items() if key not in apart})
    kept = [path for path, value in places if parse_any(value, {})[0] != 0]
    return data, {where: path for path in kept if not stated(where := ".".join(map(str, path)), data)}


@pytest.mark.parametrize("name", [*SCENES, *FURTHER, *WRITTEN])
def test_a_constant_is_a_letter_where_it_is_written(name):
    data, places = tables(name)
    assert not [where for where, path in places.items() if not written(data, path)]


def keys(schema, known, path=(), inside=()):
    """Yield the places of values in the schema; names and numbers are asterisks."""
    if not isinstance(schema, dict):
        return
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        if name in inside:
            return
        schema, inside = known[name] | {k: v for k, v in schema.items() if k != "$ref"}, (*inside, name)
    choices = schema.get("anyOf", [])
    if {"string", "integer", "number"} <= {choice.get("type") for choice in choices}:
        yield ".".join(path)
    for choice in choices:
        yield from keys(choice, known, path, inside)
    for key, table in schema.get("properties", {}).items():
        yield from keys(table, known, (*path, key), inside)
    for others in ("additionalProperties", "items"):
        yield from keys(schema.get(others), known, (*path, "*"), inside)


def test_every_value_of_the_schema_is_among_them():
    schema = Scene.model_json_schema()
    found = {where for name in (*SCENES, *FURTHER, *WRITTEN) for where in tables(name)[1]}
    # Read as other entries of rows, and as forces in space.
    others = ("loop.rows.*.theta", "torques.*.torque.*", "parameters.*", "inputs.*")
    missing = {
        key
        for key in keys(schema, schema["$defs"])
        if not any(fnmatchcase(where, key) for where in found)
        and not any(fnmatchcase(key, pattern) for pattern in (*NOT_KEPT, *others))
    }
    assert not missing


def all_constants(name):
    """Return a scene with every value that is kept as a constant of its own."""
    data, places = tables(name)
    data = deepcopy(data)
    for number, path in enumerate(places.values()):
        table = data
        for key in path[:-1]:
            table = table[key]
        data.setdefault("parameters", {})[f"zeta{number}"] = table[path[-1]]
        table[path[-1]] = f"zeta{number}"
    return data


@pytest.mark.parametrize("name", ["bars", "elastic", "loop", "event_wrap"])
def test_equations_over_constants_are_those_in_numbers(name):
    scenes = [resolve(symgen.Scene(**data)) for data in (all_constants(name), tables(name)[0])]
    derived = [assembled_of(s) if name == "elastic" else system_of(s) for s in scenes]
    assert len(derived[0].constants) > 4
    generator = np.random.default_rng(3)
    values = {g.name: generator.uniform(0.5, 1.5, len(g.quantities)) for g in derived[1].groups}
    names = [m.name for m in derived[1].matrices]
    found = zip(*(Exact(system).matrices(names, values) for system in derived), strict=True)
    for matrix, (a, b) in zip(names, found, strict=True):
        size = max((abs(x) for x in b), default=0)
        assert all(abs(x - y) <= mpmath.mpf(10) ** -30 * size for x, y in zip(a, b, strict=True)), matrix


def test_stresses_and_stiffness_have_one_modulus():
    """The letters of the section are defined by the constants of the scene: none has a value of its own."""
    shown = {
        x: {
            d.quantity.name: str(d.expression)
            for d in assembled_of(resolve(symgen.Scene(**x_data))).definitions
        }
        for x, x_data in (
            ("E", with_bar(E="modulus")),
            ("width", with_bar(width="width")),
        )
    }
    assert shown["E"]["EI_rod"] == "I2_rod*modulus" and shown["E"]["EA_rod"] == "A_rod*modulus"
    assert shown["width"]["EI_rod"] == "E_rod*width/23437500"


def with_bar(**written):
    data = deepcopy(ELASTIC)
    table = data["links"]["rod"]
    for key, name in written.items():
        where = table["elastic"] if key == "E" else table["section"]
        data.setdefault("parameters", {})[name] = where[key]
        where[key] = name
    return data
