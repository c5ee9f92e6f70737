"""``--of`` selects outputs, with one name in all commands; ``--no-means`` omits what takes further runs."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError, ResultError, SceneError
from symgen.runtime.result.findings import Findings

#: Commands whose results have outputs, by name.
OF = (
    *("run", "simulate", "kinematics", "inverse-dynamics", "equilibrium", "linearise", "sensitivity"),
    *("periodic", "quasi-static", "large-rotation", "sweep"),
)
#: Commands that draw outputs over a coordinate.
DRAWN = (
    *("run", "simulate", "kinematics", "inverse-dynamics"),
    *("periodic", "quasi-static", "large-rotation"),
)


def entry(*arguments):
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.stdout


def outputs(*arguments):
    return json.loads(entry(*arguments, "--json"))["outputs"]


def test_options_have_one_name():
    commands = typer.main.get_command(app).commands
    of = {name: {option for p in commands[name].params for option in p.opts} for name in commands}
    assert all("--of" in of[name] for name in OF)
    assert all({"--plot", "--plot-of"} <= of[name] for name in DRAWN)
    assert not [name for name in of if name not in OF if "--outputs" in of[name]]


def test_outputs_that_the_scene_does_not_list_are_recorded():
    """The power of a crank at constant speed is its torque times the speed."""
    speed = 2 * math.pi  # 60 rpm
    for command in ("simulate", "inverse-dynamics"):
        found = outputs(command, "crank_rocker", "--of", "crank.power,crank.torque", "--no-means")
        assert [*found] == ["crank.power", "crank.torque"]
        for end in ("minimum", "maximum"):
            power, torque = (found[f"crank.{word}"][end] for word in ("power", "torque"))
            assert power == pytest.approx(speed * torque, rel=1e-9)


def test_names_of_links_and_sections():
    """In a section in the middle: the link's forces at its ends, by the names of result and table."""
    found = outputs("inverse-dynamics", "crank_rocker", "--of", "rocker@0.5.moment,B.position.x,crank")
    assert [*found] == [
        *("rocker@0.5.moment", "B.position.x", "crank.torque"),
        *(f"crank.{point}.force.{axis}" for point in "OA" for axis in "xy"),
    ]
    table = entry("inverse-dynamics", "crank_rocker", "--of", "crank.torque", "--at", "0,60")
    assert "crank.torque" in table and "reaction" not in table
    assert [*outputs("kinematics", "slider_crank", "--of", "theta2,s1.rate")] == ["theta2", "s1.rate"]
    still = json.loads(entry("equilibrium", "four_bar", "--of", "crank.tension", "--json"))
    assert [*still["outputs"]] == ["crank.tension"]


@pytest.mark.parametrize(
    ("line", "error", "words"),
    [
        ("simulate four_bar --of B.positon", SceneError, r"there is no output 'B.positon'\n  Did you mean"),
        ("equilibrium four_bar --of rod.9", SceneError, "there is no output 'rod.9'"),
        ("inverse-dynamics crank_rocker --of crnk", ResultError, "the result has no output 'crnk'"),
        ("kinematics crank_rocker --of crnk", ModelError, "no point or moving link 'crnk'"),
    ],
)
def test_unknown_outputs_are_named(line, error, words):
    with pytest.raises(error, match=words):
        entry(*line.split())


def test_selected_results():
    run = symgen.build("four_bar").simulate(0.3, samples=4)
    part = run.selected(["B.position.y", "O", "B"])
    assert [v.name for v in part.variables] == ["B.position.y", "O.reaction", "B.position"]
    assert np.array_equal(part["B.position.y"].values, run["B.position"].values[:, 1])
    assert part.averages()["O.reaction.y"].mean == pytest.approx(run.averages()["O.reaction.y"].mean)
    assert part.events == run.events and part.drift == run.drift


@pytest.mark.parametrize("line", ["run four_bar", "kinematics crank_rocker", "inverse-dynamics slider_crank"])
def test_no_means(line, monkeypatch):
    """Averages repeat the analysis; without them neither tables nor JSON do."""
    table, whole = entry(*line.split()), outputs(*line.split())
    assert "RMS" in table and all("mean" in of for of in whole.values())
    calls = []
    monkeypatch.setattr(Findings, "averages", lambda *_: calls.append(1))
    monkeypatch.setattr("symgen.runtime.model.averages.integrals", lambda *_: calls.append(1))
    table, found = entry(*line.split(), "--no-means"), outputs(*line.split(), "--no-means")
    assert "RMS" not in table and not any("mean" in of for of in found.values())
    assert [*found] == [*whole] and not calls
