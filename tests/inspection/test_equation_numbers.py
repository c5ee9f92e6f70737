"""Equations of the papers by number: the matrices that correspond to them."""

from __future__ import annotations

import pytest
import sympy as sp
from shared.commands import call

import symgen
from symgen.errors import ModelError
from symgen.pipeline.citations import citing
from symgen.pipeline.subject import Subject

DUAL = ("x", "y", "z", "dual_x", "dual_y", "dual_z")


@pytest.fixture(scope="module")
def crank() -> Subject:
    return Subject("slider_crank", {})


@pytest.mark.parametrize(
    ("equation", "names"),
    [
        ("(1)", ["row_1_transform"]),
        ("(3b)", ["eta3_operator"]),
        ("(24)", ["closure_step_matrix"]),
        ("(28a)", ["inputs"]),
        ("(38)", ["closure_matrix", "closure_rhs"]),
        ("(41)", ["closure_matrix"]),
        ("Rahman (47)", ["rod_binor"]),
        ("(56d)", ["slider_inertia_wrench"]),
        ("(63)", ["rod_equilibrium"]),
        ("(63c)", ["rod_equilibrium"]),
    ],
)
def test_of_the_slider_crank(crank, equation, names):
    assert [m.name for m in crank.choose(equation).matrices] == names


def test_every_number_of_the_source_but_those_of_the_method_of_solution(crank):
    """(26) names the unknowns."""
    systems = [system for _, system in crank._searched()]
    missing = [n for n in range(1, 70) if not any(citing(f"({n})", system.matrices)[0] for system in systems)]
    assert missing == [26]


@pytest.mark.parametrize(
    ("model", "equation", "name"),
    [
        ("rod", "(7)", "angular_momentum"),
        ("element_beam8", "(F.3)", "constant_gyroscopic"),
        ("triple_pendulum", "Attia (12)", "OA_moment"),
    ],
)
def test_of_other_models(model, equation, name):
    assert name in [m.name for m in Subject(model, {}).choose(equation).matrices]


def test_in_python_and_on_the_command_line():
    equations = symgen.build("slider_crank").equations
    assert sp.Matrix(equations["(47)"]) == sp.Matrix(equations["rod_binor"])
    assert "rod_binor: inertia binor of rod" in call("show", "slider_crank", "(47)")
    with pytest.raises(ModelError, match=r"no matrix of slider_crank corresponds to the equation \(70\)"):
        _ = equations["(70)"]


def test_rows_and_columns_of_binors_and_transforms_have_names(crank):
    """A binor times the dual velocity is the dual momentum."""
    system = crank.system
    for link in ("crank", "rod", "slider"):
        binor = system[f"{link}_binor"]
        assert binor.columns == system[f"{link}_motion"].rows
        assert binor.rows == system[f"{link}_momentum"].rows
    assert system["row_2_transform"].columns == system["eta3_operator"].columns == DUAL
