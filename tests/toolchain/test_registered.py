"""Kinds that a program registers are in the key of the cache by their content, not by their name."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from dataclasses import dataclass, replace

import numpy as np
import pytest
import sympy as sp

import symgen
from symgen.elements import ELEMENTS
from symgen.elements.element import Element
from symgen.errors import SceneError
from symgen.joints import JOINTS
from symgen.joints.joint import Joint
from symgen.loads import LOADS
from symgen.loads.load import Load
from symgen.loads.measure import RATES, LoadTerm
from symgen.loads.of_points import Position
from symgen.methods import METHODS
from symgen.scene import units
from symgen.scene.resolve import resolved_linkage
from symgen.scene.table import Name, Table, Value
from symgen.toolchain.dependencies import needs
from symgen.toolchain.fingerprint import fingerprint


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


class DragTable(Table):
    """A point."""

    point: Name
    coefficient: Value


def drag(factor):
    """Return a kind of load, F = -factor c v: the text of its class is the same for all factors."""

    @dataclass(frozen=True, slots=True)
    class Drag(Load):
        noun, plural, schema = "drag", "drags", DragTable
        point: str
        coefficient: sp.Expr

        @classmethod
        def read(cls, read, table, name, where):
            value = read.value(table.coefficient, units.dimension(0, 1, -1), f"{where}.coefficient")
            return cls(name, read.known_point(table.point, f"{where}.point").name, value)

        def terms(self, dimension):
            force = tuple(-factor * self.coefficient * v for v in RATES[:dimension])
            yield LoadTerm(Position(self.point), force=force)

    return Drag


#: A point mass at the lower end of a massless rod of 1 m, which moves at 2 m/s.
SWINGING = """
symgen = 1
[points]
O = { at = ["0 m", "1 m"], ground = true }
A = { at = ["0 m", "0 m"] }
[links]
rod = { points = ["O", "A"], mass = "0 kg" }
[[masses]]
point = "A"
mass = "4 kg"
[start.velocities]
A = ["2 m/s", "0 m/s"]
[[drags]]
point = "A"
coefficient = "3 kg/s"
"""


def test_a_changed_load_changes_the_motion(monkeypatch):
    monkeypatch.setitem(LOADS, "drags", drag(1))
    scene = symgen.Scene(**tomllib.loads(SWINGING))
    for factor in (1, 5, 1):
        monkeypatch.setitem(LOADS, "drags", drag(factor))
        model = symgen.build(scene, backend="numpy")
        assert model.accelerations()["A"] == pytest.approx([-factor * 3 * 2 / 4, 2**2])


#: A crank of 0.2 m whose pin slides in a lever, 0.1 m above the crank's plane.
SHAPER = """
symgen = 1
[parameters]
speed = "60 rpm"
[loop]
inputs = { theta1 = "speed*t" }
rows = [
  { joint = "R", link = "crank", theta = "theta1", a = "0.2 m" },
  { joint = "T", link = "lever", theta = "?", a = "?", S = "0.1 m" },
  { joint = "R", link = "ground", theta = "?", a = "0.5 m", S = "-0.1 m" },
]
start = { theta2 = "0 deg", a2 = "-0.7 m", theta3 = "0 deg" }
"""


def test_a_changed_joint_changes_the_loop(monkeypatch):
    scene = symgen.Scene(**tomllib.loads(SHAPER))
    monkeypatch.setitem(JOINTS, "T", Joint("T", "slot", varies=("theta", "a")))
    found = symgen.build(scene, backend="numpy").inverse_dynamics(at=[0.4])["a2"].values[0]
    assert found == pytest.approx(-abs(0.5 + 0.2 * np.exp(0.4j)))
    monkeypatch.setitem(JOINTS, "T", Joint("T", "slot", varies=("theta", "a"), zero=("S",)))
    with pytest.raises(SceneError, match="S"):
        symgen.build(scene, backend="numpy")


#: A cantilever of two elements, which a shaft holds.
CANTILEVER = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true }
T = { at = ["1 m", "0 m"] }
[links.strip]
points = ["O", "T"]
density = "7850 kg/m^3"
section = { width = "30 mm", thickness = "10 mm" }
elastic = { E = "210 GPa", element = "own", elements = 1 }
[crank]
link = "strip"
speed = "0 rpm"
"""


def constant_shear(gamma):
    """Return the slope of the shear strain along the element."""
    return sp.diff(gamma, sp.Symbol("xi", real=True))


def no_shear(gamma):
    """Return the shear strain."""
    return gamma


def test_a_changed_element_changes_the_modes(monkeypatch):
    """The same name, of elements without and with rotary inertia, and with functions that differ."""
    scene = symgen.Scene(**tomllib.loads(CANTILEVER))
    plain = Element("own", "cubic deflection", ("u", "w", "theta"), 1, 3)
    models = []
    for element in (plain, replace(plain, rotary=True), plain):
        monkeypatch.setitem(ELEMENTS, "own", element)
        models.append(symgen.build(scene, backend="numpy"))
    first = [m.modes().frequencies[0] for m in models]
    assert first[0] == first[2] > first[1]


def test_functions_count_by_their_code():
    shear = replace(ELEMENTS["timoshenko"], vanishing=no_shear)
    assert fingerprint(shear) == fingerprint(replace(shear))
    assert fingerprint(shear) != fingerprint(replace(shear, vanishing=constant_shear))
    assert fingerprint(drag(1)) == fingerprint(drag(1)) != fingerprint(drag(2))


#: A module of a program: a class, the function that it calls, a constant of that function.
MODULE = """
from dataclasses import dataclass
import helpers
FACTOR = 2
def twice(x):
    return FACTOR*x
@dataclass
class Kind:
    table = {"b": 1, "a": {3, 1, 2}}
    def terms(self, x):
        return twice(helpers.half(x))
KINDS = [Kind, Kind()]
"""
HELPERS = """
def half(x):
    return x/2
"""


def of_module(folder, text, helpers):
    """Return the hash of a class in a process of its own."""
    folder.mkdir(exist_ok=True)
    (folder / "kind.py").write_text(text)
    (folder / "helpers.py").write_text(helpers)
    code = "import kind; from symgen.toolchain.fingerprint import fingerprint as f; print(f(kind.KINDS))"
    command = [sys.executable, "-B", "-c", code]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


def test_what_a_class_uses_counts_and_where_it_stands_does_not(tmp_path):
    first = of_module(tmp_path / "a", MODULE, HELPERS)
    assert of_module(tmp_path / "b", "# a comment\n" + MODULE, "\n" + HELPERS) == first
    changes = (
        (MODULE.replace("FACTOR = 2", "FACTOR = 3"), HELPERS),
        (MODULE.replace("FACTOR*x", "FACTOR+x"), HELPERS),
        (MODULE.replace("{3, 1, 2}", "{3, 1, 4}"), HELPERS),
        (MODULE, HELPERS.replace("x/2", "x/3")),
    )
    assert len({first, *(of_module(tmp_path / "c", *change) for change in changes)}) == 5


def resolved(mass):
    """Return how a method resolves a scene: as a linkage with another mass."""

    def resolve(scene):
        tables = scene.model_dump(exclude_unset=True)
        tables["masses"][0]["mass"] = mass
        return resolved_linkage(symgen.Scene(**tables))

    return resolve


def test_a_changed_method_changes_the_linkage(monkeypatch):
    scene = symgen.Scene(
        **tomllib.loads(
            SWINGING.replace("[[drags]]", "[[forces]]").replace(
                'coefficient = "3 kg/s"', 'force = ["6 N", "0 N"]'
            )
        )
    )
    row = replace(METHODS["rods"], resolve=f"{__name__}:chosen")
    monkeypatch.setitem(METHODS, "rods", row)
    for mass in (1, 3, 1):
        monkeypatch.setitem(globals(), "chosen", resolved(f"{mass} kg"))
        model = symgen.build(scene, backend="numpy")
        assert model.accelerations()["A"] == pytest.approx([6 / mass, 2**2])


def test_nothing_registered_leaves_the_keys_of_symgen():
    assert needs()["registered:kinds registered by the program"] == fingerprint([])
