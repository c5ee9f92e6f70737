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
        ("(3b)", ["eta3_row_operator"]),
        ("(24)", ["closure_step_matrix"]),
        ("(28a)", ["inputs"]),
        ("(38)", ["closure_matrix", "closure_rhs"]),
        ("(41)", ["closure_matrix", "closure_rhs"]),
        ("Rahman (47)", ["rod_binor"]),
        ("(56d)", ["slider_inertia_wrench"]),
        ("(63)", ["rod_equilibrium"]),
        ("(63c)", ["rod_equilibrium"]),
    ],
)
def test_of_the_slider_crank(crank, equation, names):
    assert [m.name for m in crank.choose(equation).matrices] == names


def test_every_number_of_the_source(crank):
    systems = [system for _, system in crank._searched()]
    missing = [n for n in range(1, 70) if not any(citing(f"({n})", system.matrices)[0] for system in systems)]
    assert not missing


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


def test_operators_of_rows_are_the_printed_ones(crank):
    """Q of dT/dq = Q T, Eqs. (2a) to (4a), and against the slopes of the transforms of the rows."""
    system = crank.system

    def turn(angle):
        c, s = sp.cos(angle), sp.sin(angle)
        return sp.Matrix([[0, 0, c], [0, 0, s], [-c, -s, 0]])

    about_k, zero = sp.Matrix([[0, -1, 0], [1, 0, 0], [0, 0, 0]]), sp.zeros(3)
    theta2, theta3 = (sp.Symbol(name, real=True) for name in ("theta2", "theta3"))
    printed = {
        "(2a)": ("theta2", about_k, zero),
        "(2b)": ("eta2", turn(theta2), zero),
        "(3a)": ("theta3", about_k, zero),
        "(3b)": ("eta3", turn(theta3), zero),
        "(4a)": ("S4", zero, about_k),
    }
    for number, (variable, *parts) in printed.items():
        (found,) = crank.choose(number).matrices
        assert found.name == f"{variable}_row_operator"
        assert system.expanded(found.name) == sp.Matrix.hstack(*parts)
    for row, variables in (
        ("1", ["theta1", "s1"]),
        ("2", ["theta2"]),
        ("3", ["eta3", "alpha3"]),
        ("4", ["S4"]),
    ):
        transform = system.expanded(f"row_{row}_transform")
        for variable in variables:
            operator = system.expanded(f"{variable}_row_operator")
            (q,) = [x for x in transform.free_symbols if x.name == variable]
            real, dual = transform[:, :3], transform[:, 3:]
            by, by_dual = operator[:, :3], operator[:, 3:]
            product = sp.Matrix.hstack(by * real, by * dual + by_dual * real)
            assert (transform.diff(q) - product).applyfunc(sp.simplify) == sp.zeros(3, 6)
