"""``symgen explain``: the tree, the cuts and the degrees of freedom, against what is known of the mechanisms."""

from __future__ import annotations

import pytest
from test_bodies_in_space import BODY, place
from test_points_on_links import rich_scene
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.pipeline import structure
from symgen.report.summary import freedom_lines


def said(*arguments):
    done = CliRunner().invoke(app, ["explain", *arguments])
    assert done.exit_code == 0, done
    return done.stdout


def test_peaucellier_has_three_loops_and_one_degree_of_freedom():
    text = said("peaucellier")
    assert "ground: O, E" in text
    assert "A after link OA from O" in text
    assert "loops: 3 links close them" in text
    assert text.count(", cut between ") == 3
    assert "8 coordinates, 7 constraints: 1 degree of freedom at the start" in text
    assert "redundant at the start: none" in text


def test_a_chain_closes_no_loop():
    text = said("triple_pendulum")
    assert "loops: none" in text
    assert text.count(" after link ") == 3
    assert "3 degrees of freedom" in text


def test_points_bonds_and_what_is_left_out_are_named():
    tables = rich_scene()
    tables["links"]["rail"] = {"points": ["O", "E"]}
    tables["guides"] = [{"points": ["F"], "along": "rail"}]
    scene = symgen.Scene(**tables)
    lines = list(structure(scene))
    assert "  P is carried by link OA: no coordinates of its own" in lines
    assert "  link body, cut between A and B" in lines
    assert "  D after link PD from P" in lines
    assert "  the guide of F along rail" in lines
    assert lines[-1] == "left out: link rail lies between fixed points"


def test_a_body_in_space_is_one_link():
    points = {"O": place([0, 0, 0], ground=True), "A": place([1, 0, 0]), "B": place([0, 1, 0])}
    scene = symgen.Scene(
        points=points, links={"body": BODY | {"inertia": ["1 kg*m^2", "1.1 kg*m^2", "1.2 kg*m^2"]}}
    )
    lines = list(structure(scene))
    assert "  A after link body" in lines
    assert "loops: none is closed by a link" in lines
    assert any("3 degrees of freedom" in line for line in freedom_lines(symgen.build(scene)))


def test_a_floating_part_is_named():
    tables = {
        "points": {"A": {"at": ["0 m", "0 m"]}, "B": {"at": ["1 m", "0 m"]}},
        "links": {"AB": {"points": ["A", "B"], "mass": "1 kg"}},
    }
    lines = list(structure(symgen.Scene(**tables)))
    assert lines[0] == "ground: none, the linkage floats"
    assert "A is free to move" in lines[2]


@pytest.mark.parametrize("scene", ["no_such_scene"])
def test_explain_of_nothing(scene):
    done = CliRunner().invoke(app, ["explain", scene])
    assert done.exit_code != 0
