"""``symgen optimise``: the shipped example, against the closed form at its result."""

from __future__ import annotations

import json
import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError, SceneError, SymgenError
from symgen.scene.loading import override, read_scene
from symgen.study.optima import written

EXAMPLE = str(Path(__file__).parents[2] / "docs" / "barrier.toml")


def test_the_example_is_carried_out():
    arguments = ["optimise", EXAMPLE, "--set", "optimise.samples=10"]
    found = json.loads(CliRunner().invoke(app, [*arguments, "--json"]).stdout)
    k, h = found["parameters"]["stiffness"], found["parameters"]["height"]
    angles = np.linspace(0.0, math.pi / 2, 10)
    length = np.sqrt(0.09 + h**2 - 0.6 * h * np.sin(angles))
    torque = (8 * 9.81 * 1.5 - k * (length - 0.2) / length * 0.3 * h) * np.cos(angles)
    assert found["kind"] == "optimum" and found["converged"] and found["gradients"] == "exact"
    assert found["objective"] == pytest.approx(np.max(np.abs(torque)), rel=1e-9)
    shown = CliRunner().invoke(app, [*arguments, "--set", 'optimise.objective="arm.torque.rms"']).stdout
    assert (
        " N*m" in shown
        and "least arm.torque.rms" in shown
        and "stiffness" in shown
        and "gradients: exact" in shown
    )


def test_a_scene_without_optimisation_is_refused():
    with pytest.raises(ModelError, match="no optimisation in this scene"):
        done = CliRunner().invoke(app, ["optimise", "four_bar"])
        raise done.exception


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ('["1 N", "2 N/m"]', r"barrier.toml: \[optimise.variables\] stiffness: expected a stiffness .*'1 N'"),
        ('["200 N/m", "100 N/m"]', r"upper bound of stiffness, in this order, got \[200.0, 100.0\]"),
    ],
)
def test_wrong_bounds_are_refused(bounds, words):
    done = CliRunner().invoke(app, ["optimise", EXAMPLE, "--set", f"optimise.variables.stiffness={bounds}"])
    assert isinstance(done.exception, SymgenError) and re.search(words, str(done.exception))


def test_the_page_has_the_result(tmp_path):
    page = tmp_path / "least.html"
    done = CliRunner().invoke(app, ["optimise", EXAMPLE, "--set", "optimise.samples=5", "--page", str(page)])
    text = page.read_text(encoding="utf-8")
    value = next(line.split()[2] for line in done.stdout.splitlines() if line.startswith("arm.torque.peak"))
    assert f"wrote {page}" in done.stdout.replace("\n", "")
    assert f'<td class="n">{value}</td><td class="n">N*m</td>' in text and "Barrier" in text
    assert text.count("<figure") == 4 and "<figcaption>Optimum</figcaption>" in text
    assert not re.search("NaN|nan", text)


def test_the_optimal_scene_is_written_with_the_comments_and_units_of_the_first(tmp_path):
    """Its peak torque is the objective, in a closed form at the values in the file."""
    source, best = tmp_path / "barrier.toml", tmp_path / "best.toml"
    text = Path(EXAMPLE).read_text(encoding="utf-8").replace("[links]", "# one link\n[links]")
    source.write_text(text.replace('"0.4 m"', '"400 mm"'), encoding="utf-8")
    arguments = ["optimise", str(source), "--set", "optimise.samples=10", "--write", str(best), "--json"]
    found = json.loads(CliRunner().invoke(app, arguments).stdout)
    best_text = best.read_text(encoding="utf-8")
    assert "# one link\n[links]" in best_text and "samples = 10" in best_text and best_text != text
    scene = tomllib.loads(best_text)
    values = {name: scene["parameters"][name]["value"].split() for name in ("stiffness", "height")}
    assert [unit for _, unit in values.values()] == ["N/m", "m"]
    k, h = (float(number) for number, _ in values.values())
    angles = np.linspace(0.0, math.pi / 2, 10)
    length = np.sqrt(0.09 + h**2 - 0.6 * h * np.sin(angles))
    torque = (8 * 9.81 * 1.5 - k * (length - 0.2) / length * 0.3 * h) * np.cos(angles)
    assert found["objective"] == pytest.approx(np.max(np.abs(torque)), rel=1e-12)
    assert found["start"]["height"] == 0.4 and found["history"][-1] == pytest.approx(found["objective"])


def test_bounds_of_outputs_have_units():
    """A bound in lbf*in is that in N*m; one in N, and one of no quantity, are refused."""
    limits = 'optimise.constraints={ "arm.torque.peak" = { greatest = "%s" } }'
    arguments = [
        "optimise",
        EXAMPLE,
        "--set",
        "optimise.samples=5",
        "--set",
        'optimise.objective="stiffness"',
    ]
    found = json.loads(
        CliRunner().invoke(app, [*arguments, "--set", limits % "88.5 lbf*in", "--json"]).stdout
    )
    assert found["constraints"]["arm.torque.peak"] == pytest.approx(88.5 * 0.0254 * 4.4482216152605, rel=1e-7)
    for text, words in (("10 N", r"expected a quantity in N\*m, got '10 N'"), ("much", "got 'much'")):
        with pytest.raises(SceneError, match=words):
            raise CliRunner().invoke(app, [*arguments, "--set", limits % text]).exception


def test_units_of_bounds_are_checked_before_the_optimisation(monkeypatch):
    """Also those of a front; a bound of a variable itself, too."""
    calls = []
    for verb in ("optimise", "pareto"):
        monkeypatch.setattr(symgen.Model, verb, lambda self, **_: calls.append(self))
    for objective in ('"stiffness"', '["arm.torque.peak", "stiffness"]'):
        for name, text in (
            ("arm.torque.peak", "10 N"),
            ("arm.torque.rms", "3 microstrain"),
            ("height", "2 N"),
        ):
            limits = f'optimise.constraints={{ "{name}" = {{ greatest = "{text}" }} }}'
            changes = [
                "--set",
                limits,
                "--set",
                f"optimise.objective={objective}",
                "--set",
                "optimise.samples=5",
            ]
            with pytest.raises(SceneError, match=rf"expected a quantity in .*, got '{text}'"):
                raise CliRunner().invoke(app, ["optimise", EXAMPLE, *changes]).exception
    assert not calls


def test_a_front_has_no_scene(tmp_path):
    arguments = [
        "--set",
        'optimise.objective=["arm.torque.peak", "stiffness"]',
        "--write",
        str(tmp_path / "a.toml"),
    ]
    with pytest.raises(ModelError, match="omit --write"):
        raise CliRunner().invoke(app, ["optimise", EXAMPLE, *arguments]).exception


def test_a_scene_with_a_file_of_points_is_written_beside_it(tmp_path):
    """In another folder it would name another file, or none."""
    text = Path(EXAMPLE).read_text(encoding="utf-8")
    table = '[tables.g]\nfile = "g.csv"\nx = "t [s]"\ny = "f [N]"\n\n[[forces]]\npoint = "P"\nforce = ["0 N", "-g(t)"]\n\n'
    source, other = tmp_path / "barrier.toml", tmp_path / "other"
    source.write_text(text.replace("[analysis]", table + "[analysis]"), encoding="utf-8")
    (tmp_path / "g.csv").write_text("t [s],f [N]\n0,0\n3,1\n", encoding="utf-8")
    other.mkdir()
    arguments = ["optimise", str(source), "--set", "optimise.samples=5", "--write"]
    with pytest.raises(SceneError, match="with the file of tables.g as it is there"):
        raise CliRunner().invoke(app, [*arguments, str(other / "best.toml")]).exception
    done = CliRunner().invoke(app, [*arguments, str(tmp_path / "best.toml")])
    assert done.exit_code == 0 and 'file = "g.csv"' in (tmp_path / "best.toml").read_text(encoding="utf-8")


def test_tables_that_others_separate_stay_where_they_are(tmp_path):
    """Lists of tables in several places, with comments between: the lines of the changed values differ alone."""
    text = """symgen = 1
about = '''
[2026-11-30] As in
[fig-1], _1_.'''

# The arm, and what pulls it.
[points]
O = { at = [0, 0], ground = true }
P = { at = ["1 m", 0] }

[parameters.k]      # of both springs
value = "3 N/m"
tunable = true

[[springs]]         # first
between = ["O", "P"]
stiffness = "k"
length = "0.5 m"    # slack

[links.arm]
points = ["O", "P"]
mass = "1 kg"

[[forces]]
point = "P"
force = ["1 N", "2 N"]

  [[ springs ]]     # second
between = ["O", "P"]
stiffness = "2*k"   # twice
length = "0.25 m"

[parameters.h]
value = "2 m"       # height

[[springs]]
between = [
  "O",              # two points
  "P",
]
stiffness = "1 N/m"
length = "h"

[[forces]]          # again, as the springs are
point = "P"
force = ["1 N", "3 N"]
"""
    source = tmp_path / "arm.toml"
    source.write_text(text, encoding="utf-8")
    read = read_scene(source)
    assert written(source, read) == text
    changes = {
        "k": "4 N/m",
        "h": "3 m",
        "springs.1.stiffness": "k",
        "springs.2.length": "7 m",
        "springs.0.length": "8 m",
    }
    expected = text.replace('"3 N/m"', '"4 N/m"').replace('"2 m" ', '"3 m" ').replace('"2*k"', '"k"')
    expected = expected.replace('length = "h"', 'length = "7 m"').replace('"0.5 m"', '"8 m"')
    assert written(source, override(read, changes)) == expected
    more = written(source, override(read, {"springs.3": read.data["springs"][0]}))
    assert tomllib.loads(more)["springs"] == [*read.data["springs"], read.data["springs"][0]]
