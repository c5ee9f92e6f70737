"""A user's own derivation: a Python file that returns a System, through the same commands and cache."""

from __future__ import annotations

import importlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import DerivationError, ModelError, SceneError
from symgen.pipeline.user_system import load
from symgen.regeneration.sources import compare, generate
from symgen.report.mathematics.difference import difference_lines
from symgen.study.accuracy.accuracy import accuracy

MODEL = """
import sympy as sp
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Export, Group, NamedMatrix, System
from constants import POWER

q = [quantity("theta", "rad", "angle from the vertical")]
u = [quantity("omega", "rad/s", "its rate")]
m, l, g = p = [quantity(*x) for x in (("m", "kg", "mass"), ("l", "m", "length"), ("g", "m/s^2", "gravity"))]


def system() -> System:
    theta, omega = q[0].symbol, u[0].symbol
    inertia = m.symbol * l.symbol**POWER
    energy = inertia * omega**2 / 2 - m.symbol * g.symbol * l.symbol * sp.cos(theta)
    moment = -sp.diff(-m.symbol * g.symbol * l.symbol * sp.cos(theta), theta)
    return System(
        name="pendulum",
        title="Pendulum by hand",
        groups=(Group("q", "angle", (*q,)), Group("u", "rate", (*u,)), Group("p", "parameters", (*p,))),
        matrices=(
            NamedMatrix("inertia", sp.ImmutableMatrix([[inertia]]), "kg*m^2", "about the pivot"),
            NamedMatrix("moment", sp.ImmutableMatrix([[moment]]), "N*m", "of gravity about the pivot"),
            NamedMatrix("energy", sp.ImmutableMatrix([[energy]]), "J", "kinetic and potential"),
        ),
        exports=(Export("motion", "inertia and moment", ("inertia", "moment")), Export("energy", "it", ("energy",))),
    )
"""
RUNNER = CliRunner()


@pytest.fixture
def model(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    (tmp_path / "constants.py").write_text("POWER = 2\n")
    file = tmp_path / "my_pendulum.py"
    file.write_text(MODEL)
    return file


def run(*words):
    done = RUNNER.invoke(app, [str(w) for w in words])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.output


@pytest.mark.parametrize("backend", ["auto", "numpy"])
def test_kernels_are_called_with_arrays(model, backend):
    made = symgen.build(model, backend=backend)
    found = made.evaluate("motion", q=[0.3], u=[0.0], p=[2.0, 0.5, 9.81])
    assert found["inertia"].tolist() == [0.5]
    assert found["moment"] == pytest.approx(-2.0 * 9.81 * 0.5 * np.sin(0.3), rel=1e-15)
    assert set(made.operations) == {"motion", "energy"}
    assert str(made.equations["moment"][0, 0]) == "-g*l*m*sin(theta)"


@pytest.mark.parametrize("backend", ["auto", "numpy"])
def test_parameters_of_a_run_have_a_set_up(model, backend):
    """The caller hands over the parameters alone, and the numbers are the same."""
    arguments = {"q": [0.3], "u": [0.7], "p": [2.0, 0.5, 9.81]}
    plain = symgen.build(model, backend=backend)
    before = {kernel: plain.evaluate(kernel, **arguments) for kernel in ("motion", "energy")}
    model.write_text(MODEL.replace("(*p,))", "(*p,), per_run=True)"))
    made = symgen.build(model, backend=backend)
    assert set(made.operations) == {"setup", "motion", "energy"}
    assert made.operations["energy"]["flops"] < plain.operations["energy"]["flops"]
    for kernel, results in before.items():
        found = made.evaluate(kernel, **arguments)
        assert {name: pytest.approx(x, rel=1e-15) for name, x in results.items()} == found
    assert accuracy(model, states=3).worst.beyond < 2
    with pytest.raises(ModelError, match="expected 3 numbers for p"):
        made.evaluate("motion", q=[0.0], u=[0.0], p=[1.0] * (3 + made.description.derived))


def test_wrong_arrays_are_refused(model):
    made = symgen.build(model)
    with pytest.raises(ModelError, match=r"expected 3 numbers for p \(m, l, g\), got the shape \(2,\)"):
        made.evaluate("motion", q=[0.0], u=[0.0], p=[1.0, 2.0])
    with pytest.raises(ModelError, match="no kernel 'motio'. Did you mean 'motion'"):
        made.evaluate("motio")
    with pytest.raises(ModelError, match="no values to set"):
        symgen.build(model, set={"m": "1 kg"})
    with pytest.raises(ModelError, match="float64"):
        symgen.build(model, precision="float32")


def test_the_same_accuracy_report(model):
    found = accuracy(model, states=5)
    assert {o.output for o in found.outputs} == {"inertia", "moment", "energy"}
    assert found.worst.beyond < 2


def test_a_saddle_point_is_solved(model):
    model.write_text("from symgen import derive\n\n\ndef system():\n    return derive('four_bar')\n")
    scene = symgen.build("four_bar")
    start, truth = scene.initial_state(), scene.accelerations()
    found = symgen.build(model).evaluate("accelerations", q=start.q, u=start.u)
    assert found["accelerations"].tolist() == [*truth["A"], *truth["B"]]
    assert found["multipliers"].tolist() == list(truth.multipliers.values())
    report = accuracy(model, states=2)
    assert {"accelerations", "multipliers"} <= {o.output for o in report.outputs}


def test_a_change_within_the_second_is_read(model, monkeypatch):
    """Bytecode is looked up by seconds and sizes of files, which such a change keeps."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    constants = model.parent / "constants.py"
    for file in (model, constants):
        os.utime(file, (1e9, 1e9))
    generate(model)
    for file, before, after in ((model, "omega**2 / 2", "omega**2 / 3"), (constants, "2", "3")):
        file.write_text(file.read_text().replace(before, after))
        os.utime(file, (1e9, 1e9))
    assert {m.name for m in generate(model).change.matrices} == {"inertia", "energy"}
    energy = symgen.build(model).equations["energy"][0, 0]
    assert str(energy) == "-g*l*m*cos(theta) + l**3*m*omega**2/3"


def test_generate_says_what_changed_since(model):
    assert generate(model).change is None
    again = generate(model)
    assert not again.because and not again.change
    model.write_text(MODEL.replace("omega**2 / 2", "omega**2 / 3"))
    found = generate(model)
    assert found.because == (f"file:{model}",)
    assert [(m.name, m.kind) for m in found.change.matrices] == [("energy", "changed")]
    (model.parent / "constants.py").write_text("POWER = 3\n")
    found = generate(model)
    assert found.because == (f"file:{model.parent / 'constants.py'}",), "what it imports counts too"
    assert {m.name for m in found.change.matrices} == {"inertia", "energy"}
    assert symgen.build(model).evaluate("motion", q=[0.0], u=[0.0], p=[1.0, 2.0, 9.81])["inertia"] == 8.0
    model.write_text(MODEL)
    (model.parent / "constants.py").write_text("POWER = 2\n")
    back = generate(model)
    assert {m.name for m in back.change.matrices} == {"inertia", "energy"}, "since the last, not the first"


def test_a_neighbour_that_was_imported_before_counts_too(model, monkeypatch):
    """As in a notebook: it is read as it is now, and what the user imported stays as it is."""
    monkeypatch.syspath_prepend(str(model.parent))
    constants = importlib.import_module("constants")
    at = {"q": [0.0], "u": [0.0], "p": [1.0, 2.0, 9.81]}
    try:
        assert symgen.build(model).evaluate("motion", **at)["inertia"] == 4.0
        (model.parent / "constants.py").write_text("POWER = 3  # now\n")
        assert symgen.build(model).evaluate("motion", **at)["inertia"] == 8.0
        assert sys.modules["constants"] is constants and constants.POWER == 2
    finally:
        del sys.modules["constants"]


def test_commands(model):
    assert "generated for the first time" in run("generate", model)
    assert "nothing changed" in run("generate", model)
    assert "q[1], u[1], p[3]" in run("build", model)
    assert "about the pivot" in run("show", model)
    assert "out[0] = p[0]*p[1]*p[1];" in run("show", model, "inertia", "--format", "c")
    other = model.with_name("other.py")
    other.write_text(
        MODEL.replace("g.symbol * l.symbol * sp.cos(theta), theta", "g.symbol * sp.cos(theta), theta")
    )
    said = run("diff", model, other)
    assert "moment (1 x 1): 1 changed" in said
    assert "    - -g*l*m*sin(theta)\n    + -g*m*sin(theta)\n" in said
    found = json.loads(run("diff", model, other, "--json"))
    assert [m["name"] for m in found["matrices"]] == ["moment"]


def test_the_example_of_the_page(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "regeneration.md").read_text()
    example, _ = (text for text in re.findall(r"```python\n(.*?)```", page, re.S) if "def system" in text)
    file = tmp_path / "my_model.py"
    file.write_text(example)
    found = symgen.build(file).evaluate("motion", q=[0.3], p=[1.0, 0.5, 9.81])
    assert found["moment"] == pytest.approx(-9.81 * 0.5 * np.sin(0.3), rel=1e-15)


def test_what_needs_a_scene_says_so(model):
    for command in ("run", "explain", "modes", "kinematics", "speed-response"):
        more = ["--speeds", "60:120:2"] if command == "speed-response" else []
        with pytest.raises(SceneError, match="expected a scene, got the Python file"):
            run(command, model, *more)


@pytest.mark.parametrize(
    "text, message",
    [
        ("def system(:\n", r"my_pendulum\.py, line 1: this is not Python"),
        ("x = 1\n", r"has no function 'system'"),
        ("def system():\n    return 3\n", r"system\(\) returned int, not a System"),
        (
            "def system():\n    return 1 / 0\n",
            r"my_pendulum\.py, line 2: ZeroDivisionError: division by zero",
        ),
        ("raise SystemExit(3)\n", r"my_pendulum\.py, line 1: SystemExit: 3"),
        (MODEL.replace('name="pendulum"', 'name="my pendulum"'), r"a system is called 'my pendulum'"),
        (MODEL.replace('Group("p"', 'Group("k"'), r"an argument group 'k'; kernels have t, q, u, p, work"),
        (MODEL.replace("(*p,)", "(m, l)"), r"my_pendulum\.py: .*holds undeclared symbols: g"),
        (MODEL[: MODEL.index("exports=(")] + "exports=())\n", "exports no kernel"),
        *(
            (
                MODEL.replace(f'"{text}"', f'"{text}\\u202e"'),
                rf"without control characters, got '{text}.u202e'",
            )
            for text in ("Pendulum by hand", "length", "rad/s", "about the pivot", "inertia and moment")
        ),
        (MODEL.replace('"Pendulum by hand"', "3"), "expected a text without control characters, got 3"),
    ],
)
def test_a_faulty_file_is_one_clear_error(model, text, message):
    model.write_text(text)
    with pytest.raises(DerivationError, match=message):
        symgen.build(model)
    cache = Path(os.environ["SYMGEN_CACHE"])
    assert not list(cache.glob("my_pendulum*")), "nothing is left in the cache"


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(DerivationError, match="there is no file"):
        load(tmp_path / "nothing.py")


def test_from_a_shell(model):
    """No traceback, exit code 3, and the file's own folder is where it imports from."""
    model.write_text("import nothing_of_that_name\n")
    done = subprocess.run(
        [sys.executable, "-m", "symgen", "generate", model],
        capture_output=True,
        text=True,
        cwd=model.parent.parent,
    )
    assert done.returncode == 3
    assert done.stderr.startswith(f"symgen: {model}, line 1: ModuleNotFoundError: No module named")
    assert "Traceback" not in done.stderr


def test_a_file_with_a_null_byte(model):
    model.write_bytes(model.read_bytes() + b"\0")
    with pytest.raises(DerivationError) as refused:
        load(model)
    assert str(refused.value).startswith(f"{model}") and "this is not Python: " in str(refused.value)
    assert "None" not in str(refused.value) and "null bytes" in str(refused.value)


def test_what_another_environment_holds_is_no_file_of_the_user(model, tmp_path, monkeypatch):
    packages = tmp_path / "usr" / "lib" / "dist-packages"
    packages.mkdir(parents=True)
    (packages / "installed_elsewhere.py").write_text("POWER = 2\n")
    monkeypatch.syspath_prepend(packages)
    model.write_text("import installed_elsewhere\n" + model.read_text())
    try:
        needs = load(model).needs
        assert "installed_elsewhere" in sys.modules  # it is not loaded again and again
        assert not any("installed_elsewhere" in name for name in needs)
        assert any("constants.py" in name for name in needs) and "constants" not in sys.modules
    finally:
        sys.modules.pop("installed_elsewhere", None)


def test_two_versions_of_a_scene():
    old, new, found = compare("crank_rocker", "crank_rocker", {"links.crank.mass_per_length": "3 kg/m"})
    assert old.name == new.name == "crank_rocker"
    assert not found.matrices  # the equations, of which only a constant changed
    assert [(c.place, c.before, c.after) for c in found.constants if c.place == "m_crank"] == [
        ("m_crank", "1/10", "3/10")
    ]
    with pytest.raises(ModelError, match="'set' applies to scenes only"):
        compare("rod", "rod", {"m": "1 kg"})


def test_other_values_of_arguments_are_told_and_are_no_change_in_the_mathematics():
    _, _, found = compare("slider_crank", "slider_crank", {"S1": "9 in"})
    assert not found
    assert list(difference_lines(found))[2:] == ["  changed [S1]", "    - 0 m", "    + 0.2286 m"]


def test_blocks_are_compared_too():
    _, _, found = compare("rod", "rod_spatial")
    assert {m.name for m in found.matrices if m.shapes[0] != m.shapes[1]} == {
        "particle_momentum",
        "particle_moment",
        "middle_position",
        "middle_velocity",
        "middle_acceleration",
        "linear_momentum",
        "angular_momentum",
        "projected_momentum",  # in space only
        "mass_matrix",
        "constraint_jacobian",
    }
    kinds = {m.name: {c.place: c.kind for c in m.changes} for m in found.matrices}
    assert kinds["particle_moment"] == kinds["angular_momentum"] == {"x": "added", "y": "added"}
    assert found.operations["kinetic_energy"] == (36, 47)
