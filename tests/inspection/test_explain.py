"""``symgen explain``: the tree, the cuts and the degrees of freedom, against what is known of the mechanisms."""

from __future__ import annotations

import ctypes
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shared.linkages import at, ground, rod
from shared.rich_scenes import BODY, place, rich_scene
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.models.structure import structure
from symgen.report.mathematics.saving import ON_REQUEST, RUN, STAGE, STEP, binding_times
from symgen.report.page.structure import elastic_lines
from symgen.runtime import _core
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.library import KERNEL
from symgen.scene.loading import read_scene
from symgen.scene.resolve import resolve


def said(*arguments):
    """The lines of an explanation, each whole; printed they are as wide as files."""
    done = CliRunner().invoke(app, ["explain", *arguments])
    assert done.exit_code == 0, done
    assert max(map(len, done.stdout.splitlines())) <= 100
    return re.sub(r"\n {4,}", " ", done.stdout)


def test_peaucellier_has_three_loops_and_one_degree_of_freedom():
    text = said("peaucellier")
    assert "ground: O, E" in text
    assert "A after link OA from O" in text
    assert "loops: 3, closed by these links" in text
    assert text.count(", cut between ") == 3
    code = "".join(
        p.read_text().partition("enum { ROWS")[0]  # the kernel of power series consists of loops
        for p in (Path(__file__).parents[2] / "generated").rglob("peaucellier_kernel*.c")
    )
    printed = re.findall(r"^    (?!const double inverse).*[\w\]] = (?!0\.0;).*;$", code, re.MULTILINE)
    assert f"code in C: {len(printed)} statements, straight-line" in text
    assert "8 coordinates, 7 constraints: 1 degree of freedom at the start" in text
    assert "redundant: none" in text


def counted(text, what):
    """The first number before some words."""
    return int(re.search(rf"(\d+) {what}", text)[1])


def test_what_a_four_bar_saves_and_how_it_is_solved():
    """The factor has one entry a pivot and one a nonzero below it, counted by hand on the drawn pattern."""
    text = said("four_bar")
    assert "omitted, since the scene has none: the third axis, bodies in space, point masses, springs" in text
    own, whole = map(int, re.search(r"four_bar: (\d+) operations; with any .* (\d+) \(", text).groups())
    assert own < whole
    model = symgen.build("four_bar")
    assert own == sum(x["flops"] for x in model.operations.values())
    rows = [line.split() for line in text.splitlines() if set(line.split()) <= set("#+.") and line.strip()]
    assert len(rows) == 7
    assert all(rows[i][j] == rows[j][i] for i in range(7) for j in range(7))
    below = sum(rows[i][j] != "." for i in range(7) for j in range(i))
    assert counted(text, "nonzero entries") + counted(text, "entries of fill-in") == 7 + 2 * below
    assert f"the factor has {7 + below}, a dense one would have 28" in text
    assert f"memory: {8 * 2 * model.description.coordinates} bytes of state" in text


def test_the_cheaper_order_is_used():
    text = said("andrews_squeezer")
    found = re.search(r"solution, minimum degree: (\d+); along the tree: over (\d+)", text)
    used, other = map(int, found.groups())
    assert used <= other


def test_offsets_cost_what_they_bring():
    """The slider-crank in the plane of its crank, and with an offset of its slider."""
    pattern = r"slider_crank: (\d+) operations; with general offsets (\d+)"
    plain, offset = (re.search(pattern, said("slider_crank", *given)) for given in ((), ("--set", "S1=9 in")))
    assert int(plain[1]) < int(plain[2])
    assert plain[2] == offset[2]


def test_links_that_keep_their_length_have_fewer_unknowns():
    data = read_scene("thesis_four_bar").data
    found = []
    for axial in (True, False):
        for link in data["links"].values():
            link["elastic"] = {**link["elastic"], "axial": axial}
        text = "\n".join([*(model := symgen.build(symgen.Scene(**data))).mobility, *elastic_lines(model)])
        assert ("inextensible" in text) != axial
        found.append([counted(text, "unknowns in all"), counted(text.replace("at most ", ""), "operations")])
    (free, cost), (fewer, less) = found
    assert fewer < free and less < cost


def test_a_chain_closes_no_loop():
    text = said("triple_pendulum")
    assert "loops: none" in text
    assert text.count(" after link ") == 3
    assert "3 degrees of freedom" in text


def test_points_constraints_and_what_is_left_out_are_named():
    tables = rich_scene()
    tables["links"]["rail"] = {"points": ["O", "E"]}
    tables["guides"] = [{"points": ["F"], "along": "rail"}]
    scene = symgen.Scene(**tables)
    lines = list(structure(resolve(scene)))
    assert "  P is carried by link OA: no coordinates of its own" in lines
    assert "  link body, cut between A and B" in lines
    assert "  D after link PD from P" in lines
    assert "  the guide of F along rail" in lines
    assert "omitted: link rail lies between fixed points" in lines


def test_a_body_in_space_is_one_link():
    points = {"O": place([0, 0, 0], ground=True), "A": place([1, 0, 0]), "B": place([0, 1, 0])}
    scene = symgen.Scene(
        points=points, links={"body": BODY | {"inertia": ["1 kg*m^2", "1.1 kg*m^2", "1.2 kg*m^2"]}}
    )
    lines = list(structure(resolve(scene)))
    assert "  A after link body" in lines
    assert "loops: none is closed by a link" in lines
    assert any("3 degrees of freedom" in line for line in symgen.build(scene).mobility)


def test_a_floating_part_is_named():
    tables = {
        "points": {"A": {"at": ["0 m", "0 m"]}, "B": {"at": ["1 m", "0 m"]}},
        "links": {"AB": {"points": ["A", "B"], "mass": "1 kg"}},
    }
    lines = list(structure(resolve(symgen.Scene(**tables))))
    assert lines[0] == "ground: none, the linkage floats"
    assert "A is free to move" in lines[2]


@pytest.mark.parametrize("scene", ["no_such_scene"])
def test_explain_of_nothing(scene):
    done = CliRunner().invoke(app, ["explain", scene])
    assert done.exit_code != 0


def counting(library, calls):
    """The same kernels, each counted when it is called."""

    def counted(name, address):
        function = KERNEL(address)

        def kernel(*arguments):
            calls[name] = calls.get(name, 0) + 1
            function(*arguments)

        return KERNEL(kernel)

    owner = {name: counted(name, address) for name, address in library.addresses.items()}
    addresses = {name: ctypes.cast(f, ctypes.c_void_p).value for name, f in owner.items()}
    return replace(library, addresses=addresses, owner=(library.owner, owner))


def damped():
    """A linkage with tunable numbers and a damper, the work of which is integrated along."""
    return symgen.Scene(
        parameters={"k": {"value": "90 N/m", "tunable": True}, "c": {"value": "3 N*s/m", "tunable": True}},
        points={"O": ground(0, 0), "A": at(0.4, 0.7), "B": at(1.1, 0.9), "C": ground(1.6, 0.1)},
        links={"crank": rod("O", "A"), "coupler": rod("A", "B"), "rocker": rod("B", "C")},
        springs=[{"between": ["A", "C"], "stiffness": "k/2", "length": "0.4 m", "damping": "2*c"}],
    )


@pytest.mark.parametrize("scene", [damped(), "double_four_bar"], ids=["damped", "double_four_bar"])
def test_kernels_are_called_when_it_says(scene):
    calls, steps, stages = {}, 25, 4
    model = symgen.build(scene)
    when = binding_times(symgen.derive(scene), model.operations)
    counted = Evaluator(
        model.description, counting(model.evaluator.library, calls), [*model.parameters.values()]
    )
    equations = counted.equations(len(model.redundant))
    start = [*model.description.start, *([0.0] * equations.extra)]
    assert calls.pop("setup") == 1 and when["setup"] == RUN and not calls
    run = _core.Run(
        equations, INTEGRATORS["rk4"], 0.0, np.array(start), 0.25, 0.0, 0.0, 0.25 / steps, np.array([0.25])
    )
    assert run.begin() == _core.MORE
    calls.clear()
    assert run.advance(steps + 1) == _core.DONE and run.steps == steps
    inside = ("factor", "solve")  # 'accelerations' has its own copies
    for name, time in when.items():
        if time == STAGE:
            assert stages * steps <= calls[name] <= (stages + 2) * steps, name
        elif time == STEP:
            most = 8 if name not in inside else 16  # of the projection
            assert steps <= calls[name] <= most * steps, name
        else:
            assert name not in calls
    assert {STAGE, STEP, ON_REQUEST, RUN} == {*when.values()}


def test_each_kernel_has_a_time():
    text = said("peaucellier")
    assert re.search(r"^  setup +17; +\d+  once per run$", text, re.M)
    assert re.search(r"^  accelerations +766; +\d+  each stage$", text, re.M)
    assert re.search(r"^  constraints +52; +\d+  each step$", text, re.M)
    assert re.search(r"^  outputs +72; +\d+  on request$", text, re.M)
    assert re.search(r"^  position +\d+; +\d+  each pose$", said("slider_crank"), re.M)
    assert "once per run" in said("four_bar")  # of the general model
    total = sum(map(int, re.findall(r"^  \w+ +(\d+); +\d+  (?!once per run)", text, re.M)))
    assert f"peaucellier: {total} operations" in text


def test_building_blocks_have_other_commands():
    done = CliRunner().invoke(app, ["explain", "element_beam8"])
    assert "building block" in str(done.exception)
    assert "symgen show element_beam8" in done.exception.hint and "symgen report" in done.exception.hint
