"""How a loop is closed for the first time: closed forms, assemblies, which one is taken."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import InitialStateError, SceneError
from symgen.runtime.closure.closed_form import closed_forms
from symgen.runtime.closure.start import check_closed

CASES = Path(__file__).parents[2] / "cases"

INCH = 0.0254


def defect(kernels, t, q):
    return np.abs(kernels("position", t, q, np.zeros_like(q))["closure_defect"]).max()


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, 4.0])
@pytest.mark.parametrize("name", ["slider_crank", "rssr"])
def test_closed_forms_close_the_loop(name, angle):
    model = symgen.build(name)
    if name == "slider_crank":
        model = model.with_parameters(a4=20 * INCH, alpha4=np.radians(232), S1=3.5 * INCH)
    kernels = model.kernels
    t = kernels.time_of(angle)
    found = closed_forms(kernels, t, model.closed_start().q)
    assert len(found) == 2
    assert max(defect(kernels, t, q) for q in found) < 1e-14


def test_loops_of_other_kinds_have_no_closed_form():
    model = symgen.build("rccc")
    assert closed_forms(model.kernels, 0.0, model.closed_start().q) == []


def test_no_closed_form_where_the_rod_does_not_reach():
    model = symgen.build("slider_crank").with_parameters(a4=30 * INCH, S1=27 * INCH)
    kernels = model.kernels.__class__(
        model.description, model.kernels.library, [30 * INCH, 4.712, 28 * INCH, 0, 5.0]
    )
    assert closed_forms(kernels, 0.0, np.array(model.description.start)) == []


@pytest.mark.parametrize(
    ("name", "count"),
    [("planar_4r", 2), ("cardan", 2), ("rssr", 2), ("rccc", 2), ("bennett", 1), ("slider_crank", 2)],
)
def test_every_pose_is_one_assembly(name, count):
    """However the angles of a ball are written."""
    model = symgen.build(name)
    found = model.assemblies()
    assert len(found) == count
    start = model.closed_start().q
    assert np.allclose(list(found[0].values()), start, atol=1e-9)


def test_the_guess_chooses_the_assembly():
    outer = symgen.build("slider_crank").inverse_dynamics(at=[0.0]).variable("S4").values
    inner = (
        symgen.build("slider_crank", set={"loop.start.S4": "-40 in"})
        .inverse_dynamics(at=[0.0])
        .variable("S4")
        .values
    )
    assert np.allclose(outer, -inner) and outer > 40 * 0.0254


def test_parameters_keep_the_assembly():
    """The scene's own branch is followed to other parameters."""
    model = symgen.build("slider_crank")
    other = model.with_parameters(a4=30 * INCH, alpha4=np.radians(310), S1=9 * INCH)
    assert other.inverse_dynamics(at=[0.0]).variable("S4").values > 0
    inner = symgen.build("slider_crank", set={"loop.start.S4": "-40 in"})
    assert inner.with_parameters(a4=30 * INCH).inverse_dynamics(at=[0.0]).variable("S4").values < 0


def test_a_start_that_is_open_is_refused():
    """The start of every scene is evaluated by the closure as derived: here by plain matrices, 1 urad off."""
    model = symgen.build("planar_4r")
    begin = model.closed_start()
    for off in (0.0, 1e-6):
        angles = np.cumsum(begin.q + [0.0, off, 0.0, 0.0])
        whole = np.zeros((3, 4))
        whole[:2, :2] = [
            [np.cos(angles[-1]) - 1, -np.sin(angles[-1])],
            [np.sin(angles[-1]), np.cos(angles[-1]) - 1],
        ]
        if off:
            with pytest.raises(InitialStateError, match="leaves the loop open by 1e-06"):
                check_closed(model.kernels, begin, whole)
        else:
            check_closed(model.kernels, begin, whole)


def test_a_freedom_too_many_is_told(tmp_path):
    scene = tmp_path / "five.toml"
    rows = "\n".join(f'{{ joint = "R", link = "{k}", theta = "{v}", a = "1 m" }},' for k, v in FIVE)
    scene.write_text(
        "symgen = 1\n[loop]\n"
        f'inputs = {{ theta1 = "t*w" }}\nrows = [\n{rows}\n]\n[parameters]\nw = "1 rad/s"\n'
    )
    with pytest.raises(SceneError, match="neither prescribed nor free"):
        symgen.build(scene)


FIVE = (("a", "theta1"), ("b", "?"), ("c", "?"), ("d", "?"), ("ground", "?"))


def test_guesses_are_set_without_a_start_table(tmp_path):
    """Parallelogram without a table of guesses: keys of it, or all of it, are set from outside."""
    scene = tmp_path / "bare.toml"
    lines = (CASES / "par4.toml").read_text().splitlines()
    scene.write_text("\n".join(x for x in lines if not x.startswith("start")))
    guesses = {"theta2": "170 deg", "theta3": "10 deg", "theta4": "170 deg"}  # coupler along -x at 10 deg
    one_by_one = [f"--set=loop.start.{name}={value}" for name, value in guesses.items()]
    table = ", ".join(f'{name} = "{value}"' for name, value in guesses.items())
    for options in (one_by_one, [f"--set=loop.start={{ {table} }}"]):
        done = CliRunner().invoke(app, ["run", str(scene), "--at", "45", "--json", *options])
        assert done.exit_code == 0, done.output
        values = json.loads(done.stdout)["outputs"]
        assert {n: values[n]["final"] for n in guesses} == pytest.approx(
            {"theta2": 0.75 * math.pi, "theta3": 0.25 * math.pi, "theta4": 0.75 * math.pi}
        )
