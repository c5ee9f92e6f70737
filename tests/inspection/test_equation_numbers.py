"""Equations of the papers by number: the matrices that correspond to them."""

from __future__ import annotations

import json
import re

import pytest
import sympy as sp
from shared.commands import call, runner
from shared.equations import found

import symgen
from symgen.cli import app
from symgen.errors import ModelError, StaleBinaryError
from symgen.pipeline.citations import (
    LAST,
    NOT_DERIVED,
    PAPERS,
    STORED,
    as_equation,
    citing,
    command_of,
    elsewhere,
    settings,
)
from symgen.pipeline.subject import Subject
from symgen.runtime.beams import elements

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
        ("(41)", ["joint_rates"]),
        ("Rahman (47)", ["rod_binor"]),
        ("(56d)", ["slider_momentum_rate_forward"]),
        ("(63)", ["rod_equilibrium"]),
        ("63c", ["rod_equilibrium"]),
        ("62g", None),
        ("Rahman 47", ["rod_binor"]),
    ],
)
def test_of_the_slider_crank(crank, equation, names):
    """One with a letter that the paper does not have, such as (62g), is not its group."""
    if names is None:
        with pytest.raises(ModelError, match=re.escape(f"corresponds to the equation ({equation})")):
            found(crank, equation)
        return
    assert [m.name for m in found(crank, equation)] == names


def test_every_number_of_the_source(crank):
    systems = [system for _, system in crank.searched()]
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
    assert name in [m.name for m in found(Subject(model, {}), equation)]


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
        (binor,) = found(crank, f"{link}_binor")
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
        (operator,) = found(crank, number)
        assert operator.name == f"{variable}_row_operator"
        assert system.expanded(operator.name) == sp.Matrix.hstack(*parts)
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


ROWS = [
    ("slider_crank", "(37d)", {"closure_of_velocities": "vy"}),
    ("slider_crank", "(22)", {"closure_step_matrix": "p12, p13, p23", "closure_step_rhs": "p12, p13, p23"}),
    ("slider_crank", "28a", {"inputs": "s1"}),
    ("element_beam8", "(C.1)", {"end_conditions": "u(0) = q1"}),
    ("element_beam8", "(C.4)", {"mode_conditions": "phi1(L) = 0"}),
    (
        "element_beam8",
        "(C.15)",
        {
            "mode_conditions": "phi2(0) = 1, phi2'(0) = 0, phi2''(0) = 0, phi2(L) = 0, phi2'(L) = 0, "
            "phi2''(L) = 0"
        },
    ),
    ("rod_spatial", "(8b)", {"projected_momentum": "u_hat"}),
    ("vertical_rods", "10a", {"lower_moment": "u_bar_lower"}),
    ("vertical_rods", "13b", {"upper_moment": "u_hat_upper", "lower_moment": "u_hat_lower"}),
    ("rigid_element", "(4.3)", {"levers": "R_x, R_y"}),
    ("rigid_element", "(4.6)", {"inertia": "moment"}),
    ("rigid_element", "(4.9)", {"nodal_matrix": "moment", "inertia": "moment"}),
    ("synthesis_limits", "3.5", {"residual": "extended_angles F2 G2"}),
    ("element_beam8", "(5.8)", {"coefficients": "u1"}),
    ("element_beam8", "(5.14)", {"coefficients": "theta2"}),
    ("element_beam8", "(A.1)", {"kinetic_terms": "A.4, A.8 E, A.9 B, A.10 A, A.11 G, A.12 M"}),
    (
        "element_beam8",
        "(A.2)",
        {"kinetic_terms": "A.5, A.6, A.7, A.13 E, A.14 G, A.15 N, A.16 L, A.17 B, A.18 A, A.19 M"},
    ),
    ("element_beam8", "(A.8)", {"kinetic_terms": "A.8 E", "kinetic_integrals": "A.8 E"}),
    ("element_beam8", "(5.22)", {"displacements": "u_t"}),
    ("element_beam8", "(5.20)", {"shape": "u", "displacements": "u"}),
    ("element_beam8", "(D.4)", {"shape": "curvature"}),
    ("element_beam8", "(D.7)", {"curvature_coefficients": "a2"}),
    ("element_beam8", "(D.14)", {"squared_curvature_coefficients": "D5"}),
    ("element_beam8", "(D.19)", {"squared_curvature_of_unknowns": "D3"}),
    ("element_beam8", "(6.21)", {"potential_energy": "axial"}),
    ("element_beam8", "(6.29)", {"potential_energy": "bending"}),
    ("element_beam8", "(6.30)", {"potential_energy": "sum"}),
]


@pytest.mark.parametrize(("model", "equation", "rows"), ROWS)
def test_equations_of_rows(model, equation, rows):
    matrices = found(Subject(model, {}), equation)
    assert {m.name: ", ".join(m.rows) for m in matrices} == rows
    for m in matrices:
        assert m.description.startswith(f"row{'s' * (', ' in rows[m.name])} {rows[m.name]}")


#: (69) as printed, but with forces on the link behind a joint, f the rate of the momentum, and the sign that
#: makes the second term of (69q) follow from (62b) and (62d).
PRINTED_69 = {
    "69a": ("F2_k", "F1_k - f1_zp"),
    "69b": ("F3_j", "-f2_yp - f2_zd/a2"),
    "69c": ("F3_k", "f2_yd/a2 - f2_zp"),
    "69d": ("T4_i", "-f3_xd"),
    "69e": ("T4_j", "-f3_yd"),
    "69f": ("T4_k", "-f3_zd"),
    "69g": ("F2_j", "-f1_yp - (f1_zd - T1_k)/a1"),
    "69h": ("F2_i", "(F2_j*a2*cos(theta2) + f2_zd)/(a2*sin(theta2))"),
    "69i": ("F1_i", "(F2_i + f1_xp)*cos(theta1) - (T1_k - f1_zd)*sin(theta1)/a1"),
    "69j": ("F1_j", "(F2_i + f1_xp)*sin(theta1) + (T1_k - f1_zd)*cos(theta1)/a1"),
    "69l": ("F3_i", "F2_i*cos(theta2)*cos(eta2) + F2_j*sin(theta2)*cos(eta2) - F2_k*sin(eta2) - f2_xp"),
    "69m": ("F4_k", "F3_i*sin(theta3) - F3_j*cos(theta3) - f3_zp"),
    "69n": ("F4_j", "F3_i*cos(theta3)*sin(eta3) + F3_j*sin(theta3)*sin(eta3) + F3_k*cos(eta3) - f3_yp"),
    "69o": ("F4_i", "F3_i*cos(theta3)*cos(eta3) + F3_j*sin(theta3)*cos(eta3) - F3_k*sin(eta3) - f3_xp"),
    "69p": ("T1_j", "F1_i*s1 + f1_xd*sin(theta1) - (F1_k*a1 - f1_yd)*cos(theta1)"),
    "69q": ("T1_i", "-F1_j*s1 + f1_xd*cos(theta1) + (F1_k*a1 - f1_yd)*sin(theta1)"),
}


@pytest.mark.parametrize("number", PRINTED_69)
def test_components_of_wrenches_are_the_printed_ones(crank, number):
    """At 90 degrees of alpha3, which the thesis holds fixed."""
    component, printed = PRINTED_69[number]
    (m,) = found(crank, number)
    assert (m.name, *m.rows) == ("joint_components", component)
    shown = m.matrix[0].subs(sp.Symbol("alpha3", real=True), sp.pi / 2)
    letters = {str(s): s for s in m.matrix.free_symbols}
    assert sp.expand(shown - sp.sympify(printed, locals=letters)) == 0


def test_a_remedy_that_is_an_identity_is_a_row_of_the_equilibrium(crank):
    (m,) = found(crank, "69k")
    assert (m.name, *m.rows) == ("crank_equilibrium", "fx")


def test_components_of_wrenches_are_those_of_the_slider_crank_alone():
    with pytest.raises(ModelError, match="nothing called"):
        Subject("rssr", {}).choose("joint_components")


@pytest.mark.parametrize(
    ("equation", "column", "values"),
    [
        ("(6.17)", "u1", "1 - x"),
        ("(6.23)", "w1", "1 - 10*x**3 + 15*x**4 - 6*x**5"),
        ("(6.24)", "theta1", "L*(x - 6*x**3 + 8*x**4 - 3*x**5)"),
        ("(C.18)", "kappa1", "L**2*(x**2 - 3*x**3 + 3*x**4 - x**5)/2"),
        ("(6.27)", "theta2", "L*(-4*x**3 + 7*x**4 - 3*x**5)"),
        ("(C.21)", "kappa2", "L**2*(x**3 - 2*x**4 + x**5)/2"),
    ],
)
def test_a_mode_function_is_one_entry(equation, column, values):
    (m,) = found(Subject("element_beam8", {}), equation)
    assert (m.name, m.columns, m.matrix.shape) == ("shape", (column,), (1, 1))
    length = sp.Symbol("L", real=True)
    names = {str(s): s for s in m.matrix.free_symbols}
    (place,) = (s for name, s in names.items() if name != "L")
    printed = sp.sympify(values, locals={"x": place, "L": names.get("L", length)})
    assert sp.expand(m.matrix[0] - printed) == 0


def test_letters_of_appendices_are_of_either_case():
    assert {as_equation(x) for x in ("d.7", "(d.7)", "D.7")} == {"(D.7)"}
    assert as_equation("thesis d.7") == "thesis (D.7)"
    assert as_equation("(D.7") == as_equation("D.7)") == as_equation("frame.x") == ""
    assert found(Subject("element_beam8", {}), "f.3") == found(Subject("element_beam8", {}), "(F.3)")


def test_rows_of_inextensible_links_are_the_printed_equations():
    """(E.40)-(E.42): cosine and sine of the angles of the links; other names of links have no numbers."""
    axial = {f"links.{link}.elastic.axial": False for link in ("crank", "coupler", "output")}
    four_bar = Subject("thesis_four_bar", axial)
    printed = {
        "E.40": ("crank", "crank_dx/a, crank_dy/a, 0, 0"),
        "E.41": ("coupler", "-coupler_dx/b, -coupler_dy/b, coupler_dx/b, coupler_dy/b"),
        "E.42": ("output", "0, 0, -output_dx/c, -output_dy/c"),
    }
    for number, (link, text) in printed.items():
        (m,) = found(four_bar, number)
        assert (m.name, m.rows, m.columns) == ("jacobian", (link,), ("A_x", "A_y", "B_x", "B_y"))
        names = {str(s): s for s in m.matrix.free_symbols}
        assert [*m.matrix] == [*sp.sympify(text, locals=names)]
    (m,) = found(Subject("thesis_four_bar", {"links.coupler.elastic.axial": False}), "E.41")
    assert (m.rows, m.source) == (
        ("coupler",),
        "thesis (E.30)-(E.42); coupler (E.31), (E.41): "
        "q3 cos(theta2) + q4 sin(theta2) = q7 cos(theta2) + q8 sin(theta2)",
    )
    assert "it is zero" in m.description
    for number, rows in {"E.43": "A.x A.y", "E.45": "A.y B.y", "E.46": "A.x A.y B.x B.y"}.items():
        (m,) = found(four_bar, number)
        assert (m.name, *m.rows) == ("condensation", *rows.split())
    assert [m.rows for m in found(four_bar, "E.44")] == [("A.y",)]  # by B.x, as (E.44) gives B.x by A.y
    assert found(Subject("elastic_slider_crank", {}), "E.47")[0].source == "thesis (E.21), (E.47)"
    (m,) = found(four_bar, "E.27")
    assert m.name == "reduced_mass" and "condensed_mass" in m.description
    letters, m = found(four_bar, "E.24")
    assert letters.name == "condensed_vibration" and m.name == "free_vibration"
    assert "condensed_stiffness is" in m.description
    (m,) = found(Subject("elastic_slider_crank", {"links.rod.elastic.axial": False}), "E.40")
    assert m.source == "thesis (E.30)-(E.42)"


def test_the_equation_of_a_link_is_that_of_its_axes():
    """(7.28): its matrices and load; the squares of Appendix A are the terms that cite them."""
    beam = Subject("element_beam8", {})
    equation, *matrices = found(beam, "7.28")
    assert equation.name == "equation_of_element"
    assert [m.name for m in matrices] == ["constant_mass", "constant_gyroscopic", "KD", "Q"]
    assert [m.name for m in found(beam, "F.5")] == ["KD", "thesis_local_stiffness"]
    assert found(beam, "5.6")[0].source.endswith("(C.7): steps to row u")
    names = {str(s): s for m in found(beam, "A.3") for s in m.matrix.free_symbols}
    squares = {"A.1": "mu*(v_x + u_t - omega*w)**2/2", "A.2": "mu*(v_y + omega*x + omega*u + w_t)**2/2"}
    for number, printed in squares.items():
        (terms,) = found(beam, number)
        assert sp.expand(sp.Add(*terms.matrix) - sp.sympify(printed, locals=names)) == 0


def test_a_group_of_equations_is_the_matrix_of_their_rows(crank):
    for number in ("8", "Attia (8)"):
        (m,) = found(Subject("rod_spatial", {}), number)
        assert (m.name, *m.rows) == ("projected_momentum", "u_bar", "u_hat")
    assert [m.name for m in found(crank, "28")] == ["inputs"]
    assert "joint_components" in [m.name for m in found(crank, "69")]


def test_parallel_axes_of_a_prismatic_joint_are_two_guided_points_of_one_body():
    """(16a) is the difference of the rows (16b) of both; a single point has no such row."""
    (*_, (_, piston)) = [of for of in PAPERS["Attia"] if of[0] == "elastic_slider_crank"]
    (m,) = found(Subject("elastic_slider_crank", settings(piston)), "Attia 16a")
    assert (m.name, m.rows) == ("constraints", ("guide_0_P", "guide_0_S"))
    px, py, sx, sy, dx, dy = sp.symbols("P_x P_y S_x S_y rail_dx rail_dy", real=True)
    axis, other = sp.Matrix([dx, dy]), sp.Matrix([sx - px, sy - py])
    rows = m.matrix.subs({s: sp.Symbol(s.name, real=True) for s in m.matrix.free_symbols})
    assert sp.expand(rows[1] - rows[0] - sp.Matrix.hstack(axis, other).det()) == 0
    rows = found(Subject("elastic_slider_crank", {}), "Attia (16b)")
    assert [m.rows for m in rows] == [("guide_0_P",), ("guide_0_P",)]
    assert rows[1].source == "second rate of Attia (16b)"
    with pytest.raises(ModelError, match=re.escape("--set 'links.piston=")):
        found(Subject("elastic_slider_crank", {}), "16a")


def test_all_systems_and_other_models():
    beam = Subject("element_beam8", {})
    assert [m.name for m in found(beam, "(6.14)")] == ["strain_energy", "stiffness"]
    text = call("show", "element_beam8", "6.14")
    assert "strain_energy: " in text and "stiffness: " in text
    for model, equation, command in [
        ("rod", "F.1", 'thesis: symgen show element_beam8 "(F.1)"'),
        ("slider_crank", "Attia 7", 'Attia: symgen show rod "(7)"'),
        (
            "rod",
            "(E.40)",
            'thesis: symgen show thesis_four_bar "(E.40)" \\\n      --set links.crank.elastic.axial=false \\\n',
        ),
        ("rod", "8", 'Attia: symgen show rod_spatial "(8)"\n  Rahman: symgen show slider_crank "(8)"'),
        ("rod", "(2.1)", "symgen does not derive it: equations of other authors"),
        ("thesis_four_bar", "7.1", "symgen does not derive it: Hamilton's principle itself"),
    ]:
        with pytest.raises(ModelError, match=re.escape(command)):
            Subject(model, {}).found(equation)
    assert {*PAPERS} == {"Attia", "Rahman", "thesis"}


def test_other_models_are_found_where_kernels_are_of_older_equations(monkeypatch):
    def stale(block):
        raise StaleBinaryError(block)

    monkeypatch.setattr(elements, "shipped", stale)
    with pytest.raises(
        ModelError, match=re.escape('thesis: symgen show thesis_four_bar "(E.26)" \\\n      --set')
    ):
        Subject("rod", {}).found("E.26")


@pytest.mark.parametrize(("model", "options"), [of for of in PAPERS["thesis"] if of[0] == "thesis_four_bar"])
def test_stored_citations_are_those_of_the_matrices(model, options):
    """Those of assembled equations are stored without deriving these."""
    systems = [system for _, system in Subject(model, settings(options)).searched()]
    cited = {
        m.source for system in systems for m in system.matrices if re.search(r"thesis.*\(.*\d\)", m.source)
    }
    stored = json.loads(STORED.read_text())["thesis"]
    own = {source for source, *_ in stored[command_of(model, options)]}
    every = {source for commands in stored.values() for source, *_ in commands}
    # Rows of the condensing matrix follow in its source, and are not stored.
    assert all(any(source.startswith(x) for source in cited) for x in own)
    assert all(source.startswith(tuple(every)) for source in cited)
    assert any("(E.43)-(E.47)" in source for source in own) == bool(options)
    assert any("(E.27)" in source for source in own) == bool(options)


def test_a_number_in_the_place_of_a_model_names_the_commands():
    for words, command in {
        ("4.16",): 'thesis: symgen show thesis_four_bar "(4.16)"',
        ("Attia", "7"): 'Attia: symgen show rod "(7)"',
        ("8",): 'Attia: symgen show rod_spatial "(8)"\n  Rahman: symgen show slider_crank "(8)"',
        ("8.1",): 'thesis: symgen show thesis_four_bar "(8.1)"',
        ("8.2",): "thesis: symgen modes elastic_four_bar_free --at 0",
        ("E.29",): 'thesis: symgen show thesis_four_bar "(E.29)"',
        ("8.10",): "thesis: symgen quasi-static thesis_four_bar --at 60",
        ("four_bar", "8.10"): "thesis: symgen quasi-static thesis_four_bar --at 60",
    }.items():
        done = runner.invoke(app, ["show", *words])
        assert done.exit_code != 0 and command in done.output + str(done.exception or "")


@pytest.mark.parametrize("number", ["E.48", "A.20", "G.5", "Attia 17", "70", "0", "thesis 47"])
def test_a_number_beyond_those_of_the_papers_is_said_to_be_none(number):
    """Of the copies at hand: (E.47), (A.19), no appendix G, Attia (16), Rahman (69); chapters of the thesis."""
    with pytest.raises(ModelError, match="The papers have no equation of this number"):
        Subject("element_beam8", {}).found(number)


@pytest.mark.parametrize("paper", LAST)
def test_every_number_has_a_command_or_a_reason(paper):
    for chapter, last in LAST[paper].items():
        for n in range(1, last + 1):
            text = elsewhere(f"{paper} ({chapter}{'.' * bool(chapter)}{n})")
            stated = [reason for source, reason in NOT_DERIVED.items() if paper in source and reason in text]
            assert ("symgen " + ("does not derive it" if stated else "")) in text, (chapter, n)
            assert bool(stated) == (chapter == "2" or (chapter == "7" and n < 7)), (chapter, n)
            assert not stated or ": symgen " not in text


def test_signs_that_only_the_print_of_integrals_lacks():
    """(A.1) and (A.3) have -2 theta' u' w and -2 theta' x1' w; (A.10), (A.11) are printed with a plus."""
    beam = Subject("element_beam8", {})
    for number in ("A.10", "A.11"):
        for m in found(beam, number):
            assert "A.10-A.11 are printed with a plus" in m.source
        (m,) = (m for m in found(beam, number) if m.name == "kinetic_terms")
        assert m.matrix[0].as_coeff_Mul()[0] == -1
    assert all("plus" not in m.source for n in ("A.9", "A.12") for m in found(beam, n))


def test_the_short_form_of_the_balance_of_an_element_is_found():
    names = [m.name for m in found(Subject("rigid_element", {}), "(4.10a)")]
    assert names == ["nodal_matrix", "inertia"]


def test_corrected_stands_where_the_equation_has_an_erratum():
    beam = Subject("element_beam8", {})
    marked = {
        "5.23": True,
        "5.20": False,
        "6.17": True,
        "6.18": False,
        "6.28": True,
        "D.19": True,
        "D.18": False,
    }
    for number, is_corrected in marked.items():
        (m, *_) = found(beam, number)
        assert ("corrected" in m.source) == is_corrected, (number, m.source)
    limits = Subject("synthesis_limits", {})
    assert "corrected" in found(limits, "3.5")[0].source
    (matrix,) = found(beam, "B.14")
    assert "(B.14), corrected" in matrix.source and "u2" in matrix.rows
    linkage = Subject("thesis_four_bar", {})
    assert all("(8.7), corrected" in m.source for m in found(linkage, "8.7"))
    assert not any("corrected" in m.source for m in found(linkage, "8.4"))
    assert not any("corrected" in m.source for n in ("3.12", "3.15", "3.17") for m in found(limits, n))
    (m,) = found(beam, "A.1")
    assert m.source.endswith("A.4, A.8-A.12 add up to (A.1)")


def test_the_coupler_by_both_limit_positions_is_the_printed_one():
    """G5, (3.15)."""
    (m,) = found(Subject("synthesis_limits", {}), "3.15")
    names = {str(s): s for s in m.matrix.free_symbols}
    printed = (
        "coupler - rocker/2*(sin(rocker_extended)/sin(crank_extended) + sin(rocker_folded)/sin(crank_folded))"
    )
    assert sp.expand(m.matrix[0] - sp.sympify(printed, locals=names)) == 0


KINETIC = {
    "A.4": "L*v_x**2",
    "A.6": "L**2*v_y*omega",
    "A.7": "L**3*omega**2/3",
    "A.8": "2*v_x*L*(u1_t + u2_t)/2",
    "A.9": "L*(u1_t**2 + u1_t*u2_t + u2_t**2)/3",
    "A.15": "2*omega**2*L**2*(u1 + 2*u2)/6",
    "A.16": "2*omega*(L**2*w1_t/7 + 4*L**3*theta1_t/105 + L**4*kappa1_t/280 + 5*L**2*w2_t/14"
    " - 13*L**3*theta2_t/210 + L**4*kappa2_t/210)",
}


@pytest.mark.parametrize("number", KINETIC)
def test_kinetic_integrals_are_those_of_the_print(number):
    """With B, E, N and L of Appendix B."""
    m = next(x for x in found(Subject("element_beam8", {}), number) if x.name == "kinetic_integrals")
    names = {str(s): s for s in m.matrix.free_symbols}
    assert sp.expand(m.matrix[0] - sp.sympify(KINETIC[number], locals=names)) == 0


def test_kinetic_integrals_are_forms_of_the_matrices():
    """A.9 to A.19 by S^T of the matrix times S, with rates and constants of the print."""
    beam = Subject("element_beam8", {})
    rows = dict(
        zip(beam.steps["kinetic_integrals"].rows, beam.steps["kinetic_integrals"].matrix, strict=True)
    )
    names = ["u1", "w1", "theta1", "kappa1", "u2", "w2", "theta2", "kappa2"]
    s, rates = (sp.Matrix([sp.Symbol(n + end, real=True) for n in names]) for end in ("", "_t"))
    omega, a, b, m = sp.Symbol("omega", real=True), *(beam.steps[x].matrix for x in "ABM")
    for row, form in {
        "A.9 B": rates.T * b * rates,
        "A.10 A": -2 * omega * rates.T * a * s,
        "A.12 M": omega**2 * s.T * m * s,
        "A.17 B": omega**2 * s.T * b * s,
        "A.18 A": 2 * omega * s.T * a * rates,
        "A.19 M": rates.T * m * rates,
    }.items():
        assert sp.expand(rows[row] - form[0]) == 0, row


def test_mode_functions_meet_their_conditions():
    """Appendix C: one for the own unknown at its end, zero for the others; with the printed functions."""
    steps = Subject("element_beam8", {}).steps
    conditions, ends = steps["mode_conditions"], steps["end_conditions"]
    assert len(conditions.rows) == 2 * 2 + 6 * 6
    for row, value, unit in zip(conditions.rows, conditions.matrix, conditions.unit.split(", "), strict=True):
        stated = re.fullmatch(r"phi([1-8])('*)\(([0L])\) = ([01])", row)
        assert stated and value == int(stated[4]), row
        power = (0, 0, 1, 2)[(int(stated[1]) - 1) % 4] - len(stated[2])
        assert unit == {-2: "1/m^2", -1: "1/m", 0: "1", 1: "m", 2: "m^2"}[power], row
    assert [str(x) for x in ends.matrix] == ["u1", "w1", "theta1", "kappa1", "u2", "w2", "theta2", "kappa2"]
    assert ends.rows == tuple(
        f"{name}({end}) = q{k + n}"
        for k, end in ((1, "0"), (5, "L"))
        for n, name in enumerate(("u", "w", "w'", "w''"))
    )
    (shape,) = Subject("element_beam8", {}).choose("shape").matrices
    system = Subject("element_beam8", {}).system
    entries, (x, length) = system.expanded("shape"), (sp.Symbol(n, real=True) for n in "xL")
    w = entries.row(shape.rows.index("w"))
    for k, end in ((0, 0), (4, length)):
        for order in range(3):
            assert (w.diff(x, order) if order else w).subs(x, end).applyfunc(sp.simplify) == sp.eye(8).row(
                k + 1 + order
            )


def test_the_load_in_fixed_axes_is_that_of_the_print():
    """(F.8): AC - BS, AS + BC, D, E, FC - GS, FS + GC, H, I in the entries of (F.7)."""
    beam = Subject("element_beam8", {})
    assert [m.name for m in found(beam, "F.8")] == ["QT", "thesis_load"]
    q, c, s = beam.system["Q"].matrix, *(sp.Symbol(x, real=True) for x in "cs")
    a, b, d, e, f, g, h, i = q
    printed = sp.Matrix([a * c - b * s, a * s + b * c, d, e, f * c - g * s, f * s + g * c, h, i])
    assert sp.expand(beam.steps.expanded("QT") - printed) == sp.zeros(8, 1)
    assert beam.system["thesis_load"].matrix == beam.system["global_load"].matrix
    assert beam.system["thesis_mass"].matrix == beam.system["global_mass"].matrix
