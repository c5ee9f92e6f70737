"""What ``symgen show`` prints is read back: LaTeX and text of matrices of all methods; LaTeX compiles."""

from __future__ import annotations

import math
import random
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp
from scipy.interpolate import CubicSpline
from shared.commands import call
from shared.read_latex import from_text, matrix_from_latex

import symgen
from symgen.inspection.page import block_page
from symgen.pipeline.subject import Subject
from symgen.report.mathematics.equations import FORMATS, show
from symgen.report.mathematics.layout import WIDTH, columns, in_lines, wrapped
from symgen.report.mathematics.python import in_python
from symgen.report.mathematics.record import record_in_latex, record_in_text
from symgen.report.page.page import render
from symgen.report.page.views import matrix_view
from symgen.symbolic.notation import latex, latex_name, readable, text, text_name

#: Matrices with angles of two arguments.
ANGLES = ("assembly_residual", "assembly_jacobian")
#: Matrices of all methods: rods, their momentum rows and recursion; loops; elastic links, in the plane and space.
SHOWN = [
    ("rod", "mass_matrix"),
    ("rod_spatial", "constraint_jacobian"),
    ("four_bar", "mass_matrix"),
    ("four_bar", "force"),
    ("four_bar", "momentum_rows.crank_moment"),
    ("four_bar", "acceleration_rhs"),
    ("peaucellier", "constraint_jacobian"),
    ("peaucellier", "reactions"),
    ("peaucellier", "particle_masses"),
    ("chain", "inward.factors"),
    ("slider_crank", "row_3_transform"),
    ("slider_crank", "theta3_operator"),
    ("slider_crank", "closure_jacobian"),
    ("slider_crank", "screw_drift"),
    ("slider_crank", "rod_binor"),
    ("slider_crank", "inverse_efforts"),
    ("slider_crank", "crank_equilibrium"),
    ("slider_crank", "rod_momentum_forward"),
    ("loop_row", "transform"),
    ("four_bar_motion", "angles"),
    ("four_bar_motion", "acceleration_terms"),
    ("element_cubic", "mass"),
    ("element_beam8", "stiffness"),
    ("element_beam8", "weak_form"),
    ("element_beam8", "thesis_stiffness"),
    ("rigid_element", "nodal_matrix"),
    *(("elastic_slider_crank", name) for name in ("elastic_mass", "elastic_load", "condensation")),
    ("element_timoshenko", "geometric1"),
    ("thesis_four_bar", "elastic_joints.load"),
    ("thesis_four_bar", "velocity_constraints"),
    *((name, "assembly_residual") for name in ("crank_rocker", "far_origin", "elastic_slider_crank")),
    *((name, matrix) for name in ("spatial_four_bar", "thesis_rig") for matrix in ANGLES),
    ("direction", "slopes"),
]  # fmt: skip


@cache
def subject(name):
    return Subject(name, {})


def same(found, derived):
    """Compare two matrices at 30 digits, with random rational values of all symbols.

    Rationals of more than 15 digits are shown with 15: with these digits, they are compared.
    """
    derived = sp.ImmutableMatrix(derived).applyfunc(readable)
    derived = derived.xreplace({x: sp.Rational(sp.sstr(x)) for x in derived.atoms(sp.Float)})
    drawn = random.Random(7)
    values = {s: sp.Rational(drawn.randint(10, 99), 83) for s in sorted(derived.free_symbols, key=str)}
    for one, other in zip(found, derived, strict=True):
        a, b = (sp.N(e.xreplace(values), 40) for e in (one, other))
        assert abs(a - b) <= sp.Float(10, 40) ** -30 * max(abs(b), sp.Float(10) ** -20)


@pytest.mark.parametrize(("name", "matrix"), SHOWN)
def test_what_is_shown_is_what_was_derived(name, matrix):
    chosen = subject(name).choose(matrix)
    (m,) = chosen.matrices
    named = {
        d.quantity.symbol: d.expression
        for d in chosen.system.definitions
        if isinstance(d.expression, (sp.sin, sp.cos)) and d.expression.args[0].is_Symbol
    }
    for left in m.lefts:
        assert latex(left) in show(chosen.system, [m], "latex")
    right = replace(m, left=None)
    read = matrix_from_latex(show(chosen.system, [right], "latex"), m, chosen.system)
    same(read, m.matrix.xreplace(named))  # sines and cosines stand in place
    same([from_text(text(e), chosen.system) for e in m.matrix], m.matrix)


@pytest.mark.parametrize("name", ["slider_crank", "bricard", "loop_row", "four_bar"])
def test_columns_of_matrices_have_names(name):
    """Axes and origin of a frame: i, j, k, p."""
    assert not [
        m.name for m in symgen.derive(name).matrices if m.matrix.cols > 1 and m.rows and not m.columns
    ]


def test_common_numbers_and_signs_of_sums_are_in_front():
    """As in print; sums of whole and broken numbers stay."""
    a, m1, m2, x, x0 = sp.symbols("a m1 m2 x x0")
    for expression, shown in (
        (a * (-m1 - m2) / 2, "-a⋅(m₁ + m₂)/2"),
        (-a * x * (-m1 - m2) / 2, "a⋅x⋅(m₁ + m₂)/2"),
        (a * (2 * x - 2 * x0) / 2, "a⋅(x - x₀)"),
        (-a * (x - x0), "-a⋅(x - x₀)"),
        (a * (m1 / 3 + m2 / 6), "a⋅(2⋅m₁ + m₂)/6"),
        (a * (m1 + m2 / 2), "a⋅(m₁ + m₂/2)"),
    ):
        assert text(expression) == shown and readable(expression).expand() == expression.expand()


def test_cases_in_text():
    x, y, z = sp.symbols("x y z", real=True)
    cases = sp.Piecewise((0, (abs(x) <= y) & ((x > z) | (y >= z))), (1, x < z), (2, True))
    shown = text(2 * cases)
    assert "(0 if " in shown and "1 if x < z, otherwise 2)" in shown
    assert "y ≥ |x|" in shown and " and (" in shown and " or " in shown and "Piecewise" not in shown
    lines = call("show", "vertical_rods", "momentum_rows.upper_moment")
    assert "e_upper_x = (1 if |d_upper_x| ≤ |d_upper_y| and |d_upper_x| ≤ |d_upper_z|, otherwise 0)" in lines
    assert "e_upper_z = -e_upper_x - e_upper_y + 1" in lines


def test_entries_and_blocks_hold_the_whole_matrix():
    """A list of entries, broken into lines, is read back; blocks have every column once, in order."""
    chosen = subject("slider_crank").choose("screw_drift")
    (m,) = chosen.matrices
    lines = [*in_lines(m, 60)]
    assert len(lines) > m.matrix.rows and lines[0].startswith(f"  {m.rows[0]}: ")
    entries = re.split(r"\n  (?=\S)", "\n".join(lines).removeprefix("  "))
    known = dict(entry.split(": ", 1) for entry in entries)
    found = [from_text(known.get(row, "0").replace("\n", " "), chosen.system) for row in m.rows]
    same(found, m.matrix)
    mass = subject("four_bar").system["mass_matrix"].part(["A_x", "B_x"], ["A_x", "B_x"])
    for symmetric, count in ((True, 3), (False, 4)):
        lines = in_lines(replace(mass, symmetric=symmetric), 20)
        assert sum(bool(re.match(r"  \w+, \w+:", line)) for line in lines) == count
    (wide,) = subject("slider_crank").choose("closure_jacobian").matrices
    heads = [line for line in in_lines(wide, 60) if re.match(r"columns:|    +\w", line)]
    assert len(heads) > 1
    assert ", ".join(heads).replace("columns: ", "").split(", ") == [*wide.columns]


@pytest.mark.parametrize(
    "name",
    [
        *("rod", "four_bar", "slider_crank", "thesis_four_bar"),
        *(
            pytest.param(name, marks=pytest.mark.full)
            for name in ("peaucellier", "element_cubic", "direction")
        ),
    ],
)
def test_no_line_is_wider_than_asked_for(name):
    """At 100 columns, and in a narrow terminal, in every format; the derivation as well."""
    widest = {}
    for width in (WIDTH, 72):
        lines = record_in_text(subject(name).record, width).splitlines()
        if width == WIDTH:  # a name in LaTeX may be longer than a narrow line
            lines += record_in_latex("title", subject(name).record, width).splitlines()
        for _, part in subject(name).parts:
            for k, m in enumerate(part.matrices[:: 1 + len(part.matrices) // 12]):
                if len(str(m.matrix)) > 6000:
                    continue
                forms = ("unicode", "latex", "shared", "c") if k % 4 == 0 and width == WIDTH else FORMATS[:1]
                for form in forms:
                    lines += show(part, [m], form, width=width).splitlines()
        widest[width] = max(lines, key=columns)
    assert {width: columns(line) <= width for width, line in widest.items()} == {WIDTH: True, 72: True}, (
        widest
    )


def test_products_without_blanks_are_broken():
    for product in ("0.5" + "*c1" * 60, "measure" + "*measure1**2" * 12):
        lines = wrapped(product, 60)
        assert len(lines) > 1 and max(map(columns, lines)) <= 60
        assert "".join(line.strip() for line in lines) == product
        assert not any(line.startswith("    *") for line in lines), "a power stays whole"


def test_titles_of_lists_are_within_the_terminal():
    assert max(map(columns, call("show", "element_beam8").splitlines())) <= WIDTH


def test_no_line_loses_anything():
    line = "  a = " + " + ".join(f"b{k}⋅(c{k} - d)/e" for k in range(40)) + " + " + "⋅".join("f" * 70)
    lines = wrapped(line, 50)
    assert all(columns(x) <= 50 for x in lines) and len(lines) > 5
    assert "".join("".join(lines).split()) == "".join(line.split())


@pytest.mark.parametrize("name", ["peaucellier", "slider_crank", "tumbling_body", "element_cubic", "chain"])
def test_names_in_text_are_distinct_and_printable(name):
    """One notation in matrices and shared terms: Greek letters, digits below, dots; nothing spelled out."""
    names = [x.name for x in subject(name).system.quantities()]
    assert len({text_name(n) for n in names}) == len(names)
    assert text_name("cos_theta1") == "cos_θ1" and text_name("theta1_rate") == "θ̇₁"
    assert text_name("OA_lambda") == "λ_OA" and text_name("spring_rate") == "spring_rate"
    shown = record_in_text(subject(name).record)
    assert not re.search("[ₐₑₒₓₕₖₗₘₚₛₜᵢᵣᵤᵥᵦᵧᵨᵩᵪ]", shown)


@pytest.mark.parametrize("name", ["slider_crank", "cssp"])
def test_no_square_of_a_cosine_with_that_of_its_sine(name):
    """The operators of screws are free of the sum, which is one."""
    system = subject(name).system
    value = {d.quantity.symbol: d.expression for d in system.definitions}
    for m in system.matrices:
        for total in set[sp.Expr]().union(*(e.atoms(sp.Add) for e in m.matrix)):
            squares = [
                (b.func, b.args[0])
                for f in total.atoms(sp.Pow)
                if f.exp == 2 and isinstance(b := value.get(f.base, f.base), sp.sin | sp.cos)
            ]
            pairs = [x for kind, x in squares if kind is sp.cos and (sp.sin, x) in squares]
            assert not pairs or m.name in ("kinetic_energy",), m.name


def test_the_copied_python_is_the_matrix():
    """Of the buttons of a report page: it runs with SymPy alone."""
    for name, matrix in SHOWN[:12]:
        (m,) = subject(name).choose(matrix).matrices
        scope = {}
        exec(in_python(m), scope)
        assert scope[re.sub(r"\W", "_", m.name)] == sp.Matrix(m.matrix)


TABLES = """
symgen = 1
[parameters]
T = { value = "1 s", tunable = true }
N = "1 N"
S = "1 s"
[tables]
gas = { x = ["0 s", "0.3 s", "1 s"], y = ["1 N", "4 N", "2 N"], kind = "cubic", period = "2 s" }
law = { x = ["0.1 s", "0.7 s", "1.5 s"], y = ["2 N", "-1 N", "5 N"], kind = "linear" }
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["1 m", "0 m"] }
[links]
bar = { points = ["O", "A"], mass = "1 kg" }
[[forces]]
point = "A"
force = ["gas(t/T*S)", "law(t) + N*profile.cycloidal(mod(t, S)/T) - N*sign(t - S)"]
"""


def test_copied_tables_are_those_of_scipy(tmp_path):
    (tmp_path / "scene.toml").write_text(TABLES)
    scope = {}
    exec(in_python(symgen.derive(tmp_path / "scene.toml")["force"]), scope)
    x, y = scope["force"]
    spline = CubicSpline([0, 0.3, 1, 2], [1, 4, 2, 1], bc_type="periodic")
    for at in (-2.65, 0.05, 0.45, 0.95, 1.45, 1.95, 6.31):
        values = {s: {"t": at, "T": 1}.get(s.name, 0) for s in (x + y).free_symbols}
        law, u = np.interp(at, [0.1, 0.7, 1.5], [2, -1, 5]), at % 1
        cycloid = u - math.sin(2 * math.pi * u) / (2 * math.pi)
        expected = [float(spline(at % 2)), law + cycloid - math.copysign(1, at - 1)]
        assert [float(e.subs(values)) for e in (x, y)] == pytest.approx(expected, rel=1e-13)


def test_a_page_has_buttons_that_copy():
    view = matrix_view(subject("rod").system["constraint_jacobian"])
    assert view.python.startswith("from sympy import *\n")
    (tex,) = displays(view.latex)
    assert r"r_{\mathrm{31},x}" in tex
    page = render(block_page("rod", progress=lambda _: None))
    shown, beyond = 16, len(subject("rod").system.matrices) - 16  # coefficients and right side of (5a)
    assert page.count("data-copy=") >= 2 * shown and f"{beyond} more" in page
    assert "navigator.clipboard" in page and 'data-copy="from sympy import *\n' in page


def displays(shown):
    """Return the displayed equations in LaTeX, as KaTeX takes them."""
    for match in re.finditer(r"\\\[(.*?)\\\]|(\\begin\{align\*\}.*?\\end\{align\*\})", shown, re.DOTALL):
        yield match[1] or match[2]


def compiled(tex):
    """Compile LaTeX by KaTeX, which raises an error for unknown commands, braces, double subscripts, ..."""
    katex = pytest.importorskip("pykatex", reason="KaTeX: wheels of pykatex are for Linux on x86-64 alone")
    return katex.renderToString(tex, displayMode=True, throwOnError=True, strict="error", output="mathml")


@pytest.mark.parametrize("name", [*dict.fromkeys(name for name, _ in SHOWN)])
def test_latex_compiles_by_katex(name):
    """Matrices of every kind, the derivations of each method, and every symbol."""
    system = subject(name).system
    for matrix in (matrix for own, matrix in SHOWN if own == name):
        chosen = subject(name).choose(matrix)
        shown = [*displays(show(chosen.system, chosen.matrices, "latex"))]
        assert shown and all("math" in compiled(tex) for tex in shown)
    if name in ("four_bar", "slider_crank", "thesis_four_bar"):
        for tex in displays(record_in_latex(system.title, subject(name).record)):
            compiled(tex)
    compiled(" + ".join(latex_name(x.name) for x in system.quantities()))


def test_katex_refuses_what_is_wrong():
    katex = pytest.importorskip("pykatex")
    for wrong in (r"\nothing", r"\frac{1}", "x_{1}_{2}", r"\left( x"):
        with pytest.raises(katex.ParseError):
            compiled(wrong)
