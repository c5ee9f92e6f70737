"""Inspection of derived equations: parts of matrices, every form, derivatives, states, the record, notebooks."""

from __future__ import annotations

import re
import shutil
import subprocess
from fractions import Fraction
from unicodedata import normalize

import mpmath
import numpy as np
import pytest
import sympy as sp
from shared.shipped import derived
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import SymgenError
from symgen.models.record import record
from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve
from symgen.scene.rods.letters import in_letters
from symgen.scene.units import parse_quantity
from symgen.symbolic.constants import PI
from symgen.symbolic.derivative import derivative
from symgen.symbolic.exact import Exact
from symgen.symbolic.notation import latex, latex_name, mathml, mathml_name, readable


def shown(*arguments):
    done = CliRunner().invoke(app, ["show", *map(str, arguments)])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


def numbers(text):
    """Return the rows of a matrix that was shown as numbers, by name."""
    lines = [line.split() for line in text.splitlines()[1:] if not line.startswith("columns")]
    rows = {}
    for name, *values in lines:
        rows[name] = rows.get(name, []) + [float(x) for x in values]
    return rows


# --- a part of a matrix ---------------------------------------------------------------------------------------


def test_one_entry_and_a_submatrix():
    whole = derived("four_bar")["constraint_jacobian"]
    part = whole.part(["coupler", "crank"], ["B_x", "2"])
    assert part.rows == ("coupler", "crank") and part.columns == ("B_x", "A_y")
    assert part.matrix[0, 0] == whole.matrix[1, 2] and part.matrix[1, 1] == whole.matrix[0, 1]
    entry = shown("four_bar", "constraint_jacobian", "--rows", "coupler", "--columns", "B_x")
    assert "\nd_coupler_x\n" in entry and "crank" not in entry
    mass = derived("four_bar")["mass_matrix"]
    assert mass.part(["A_x"], ["A_x"]).symmetric and not mass.part(["A_x"], ["B_x"]).symmetric
    with pytest.raises(SymgenError, match="no row 'copler'. Did you mean 'coupler'"):
        shown("four_bar", "constraint_jacobian", "--rows", "copler")
    with pytest.raises(SymgenError, match="numbered from 1 to 1"):
        shown("four_bar", "force", "--columns", "7")
    with pytest.raises(SymgenError, match="name it"):
        shown("four_bar", "--rows", "A_x")


def test_rows_of_several_matrices_are_those_of_the_matrices_that_have_them():
    text = shown("triple_pendulum", "momentum_rows", "--rows", "AB")
    assert "\nAB_moment: " in f"\n{text}" and "OA_moment" not in text and "O_momentum" not in text
    text = shown("triple_pendulum", "12", "--rows", "BC")
    assert text.startswith("BC_moment: ")
    with pytest.raises(SymgenError, match="matrix OA_moment has no row 'CD'"):
        shown("triple_pendulum", "12", "--rows", "CD")


# --- after the lowering ---------------------------------------------------------------------------------------


def test_shared_terms_give_what_was_derived():
    """The listing, read back as Python, gives the numbers of the original matrix."""
    system = derived("four_bar")
    text = shown("four_bar", "velocity_constraints", "--format", "shared")
    random = np.random.default_rng(1)
    values = {x.name: random.uniform(0.5, 2) for g in system.groups for x in g.quantities}
    scope, found = values | {c.quantity.name: float(c.expression) for c in system.constants}, []
    for line in text.replace("\n      ", " ").splitlines():
        given = re.fullmatch(r"  (\[.*\]|\w+) = (.*)", line)
        if given and given[1].startswith("["):
            found.append(eval(given[2], {}, scope))
        elif given:
            scope[given[1]] = eval(given[2], {}, scope)
    truth = Exact(system).matrix(
        "velocity_constraints", {g.name: [values[x.name] for x in g.quantities] for g in system.groups}
    )
    assert found == pytest.approx([float(x) for x in truth], rel=1e-11)
    assert "crank_dx = A_x" in text  # what the derivation names keeps its name


# --- derivatives ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "matrix", "by"),
    [("peaucellier", "reactions", "rho"), ("slider_crank", "screw_drift", "theta2")],
)
def test_a_derivative_is_that_of_the_expanded_matrix(scene, matrix, by):
    """By the chain rule through the shared terms, and by differences of the original at 40 digits."""
    system = derived(scene)
    made = derivative(system, [system[matrix]], by)
    random = np.random.default_rng(2)
    at = {g.name: random.uniform(0.5, 2.0, len(g.quantities)).tolist() for g in system.groups}
    group = next(g for g in system.groups if by in [x.name for x in g.quantities])
    place = [x.name for x in group.quantities].index(by)

    def moved(step):
        values = {**at, group.name: [mpmath.mpf(x) for x in at[group.name]]}
        values[group.name][place] += step
        return Exact(system).matrix(matrix, values)

    with mpmath.workdps(40):
        step = mpmath.mpf("1e-12")
        slope = (moved(step) - moved(-step)) / (2 * step)
    own = Exact(made).matrix(f"{matrix}_by_{by}", at)
    assert max(map(abs, own)) > 1e-3
    assert max(abs(a - b) for a, b in zip(own, slope, strict=True)) < 1e-14


def test_a_derivative_by_what_there_is_not_is_refused():
    with pytest.raises(SymgenError, match="no argument 'length'"):
        shown("peaucellier", "mass_matrix", "--by", "length")
    assert "[kg/(kg/m)]" in shown("peaucellier", "mass_matrix", "--by", "rho")
    slope = " ".join(shown("elastic_slider_crank", "elastic_mass", "--by", "m_at_P").split())
    assert "[kg/kg; *m per angle, *m^2 per curvature]" in slope


def test_options_of_symbols_do_not_apply_to_numbers():
    axial = ("--set", "links.crank.elastic.axial=false")
    for name, options, option in (
        ("condensed_mass", ("--format", "latex"), "--format latex"),
        ("large_mass", ("--with", "g=1"), "--with"),
    ):
        with pytest.raises(
            SymgenError, match=f"^{name} is a matrix of numbers alone, shown without {option}$"
        ):
            shown("thesis_four_bar", name, *options, *axial)
    assert "condensed_mass" in shown("thesis_four_bar", *axial)
    assert "condensed_mass" not in shown("thesis_four_bar")


def test_comments_of_matrices_in_c_list_constants_once():
    lines = shown("four_bar", "mass_matrix", "--format", "c").splitlines()
    assert [line for line in lines if line.startswith(" * c:")] == [lines[1]]
    assert lines[1].startswith(" * c: l_crank = 1, ")


# --- numbers --------------------------------------------------------------------------------------------------


def test_numbers_at_a_time_of_the_motion():
    model = symgen.build("four_bar")
    run = model.simulate(0.3, samples=2)
    found = numbers(shown("four_bar", "positions", "--format", "numeric", "--at", "0.3 s"))
    assert found["B"] == pytest.approx(run.final["B"]["position"], abs=1e-10)
    with pytest.raises(SymgenError, match="expected a time"):
        shown("four_bar", "positions", "--format", "numeric", "--at", "3 m")


@pytest.mark.parametrize(("scene", "at"), [("planar_4r", ("--at", "50")), ("cssp", ())])
def test_numbers_of_a_loop_keep_it_closed(scene, at):
    defect = numbers(shown(scene, "closure_defect", "--format", "numeric", *at))
    assert max(abs(x) for row in defect.values() for x in row) < 1e-12


def test_numbers_of_a_loop_at_a_value_of_its_input():
    """Screws times accelerations, plus the drift due to the rates, add up to zero."""
    screws, drift = (
        numbers(shown("planar_4r", name, "--format", "numeric", "--at", "50"))
        for name in ("screws", "screw_drift")
    )
    model = symgen.build("planar_4r")
    turn = model.inverse_dynamics(at=[np.radians(50)])
    names = [v.name for v in model.description.variables]
    scale = {"rad": 1.0, "deg": np.pi / 180}[turn.variable(names[0]).unit]
    a = [turn.variable(f"{name}.acceleration").values[0] * scale for name in names]
    assert max(map(abs, a)) > 1
    assert max(abs(np.dot(screws[r], a) + drift[r][0]) for r in ("wx", "wy", "wz")) < 1e-9


def test_numbers_of_given_symbols():
    symbols = [f"{name}=0.5" for name in ("theta", "S", "eta", "alpha", "a")]
    given = [word for text in symbols for word in ("--with", text)]
    found = numbers(shown("loop_row", "transform", "--format", "numeric", *given))
    assert found["x"][0] == pytest.approx(np.cos(0.5) ** 2, rel=1e-10)
    with pytest.raises(
        SymgenError, match="(?s)contains symbols without values: S, a.*'symgen inverse-dynamics'"
    ):
        shown("loop_row", "transform", "--format", "numeric", *given[:2], *given[4:8])
    moved = numbers(shown("four_bar", "positions", "--format", "numeric", "--with", "A_x=7"))
    assert moved["A"][0] == 7.0
    with pytest.raises(SymgenError, match="no argument 'A_z'. Did you mean"):
        shown("four_bar", "positions", "--format", "numeric", "--with", "A_z=7")
    with pytest.raises(SymgenError, match="NAME=VALUE"):
        shown("four_bar", "positions", "--format", "numeric", "--with", "A_x")
    assert "7" in shown("four_bar", "positions", "--with", "A_x=7")
    with pytest.raises(SymgenError, match="no symbol 'A_z'. Did you mean"):
        shown("four_bar", "positions", "--with", "A_z=7")


@pytest.mark.parametrize("right", ["pi/2", "90 deg"])
def test_given_values_are_exact(right):
    """(36), (52) and (57) as printed, with alpha3 = 90 deg at rest and the axes of eta corrected."""
    given = [
        "--with",
        f"alpha3={right}",
        *(x for r in ("rate", "acceleration") for x in ("--with", f"alpha3_{r}=0")),
    ]
    lines = normalize("NFD", shown("slider_crank", "36", *given[:4])).splitlines()
    inside = (found[1].strip() for line in lines if (found := re.search("[⎡⎢⎣](.*)[⎤⎥⎦]", line)))
    motion = [x for x in inside if x]
    rows = "η̇₃⋅sin(θ₃) -η̇₃⋅cos(θ₃) -θ̇₃ -Ṡ₄⋅sin(θ₃) Ṡ₄⋅cos(θ₃) 0"
    assert motion == normalize("NFD", rows).split()
    for number, form in (("52", "unicode"), ("57", "c"), ("57", "latex")):
        text = " ".join(shown("slider_crank", number, *given, "--format", form).split())
        text = re.sub(r"alpha3( %)? varies", "", text)
        assert not re.search(r"alpha_?[{]?3|α₃|\be-1\d", text)
    text = shown("slider_crank", "rod_motion_backward", "--format", "numeric", *given)
    assert "vz   0.0000000000e+00" in text


def test_given_values_have_the_unit_of_their_symbol():
    assert "127⋅sin(θ₁)" in shown("slider_crank", "row_1_transform", "--with", "a1=2 in", "--with", "s1=0")
    for wrong, message in {
        "a1=2 kg": r"expected a value of a1 \[m\] after --with, got 'a1=2 kg'",
        "a1=2 deg": r"expected a value of a1 \[m\] after --with, got 'a1=2 deg'",
        "a1=b": "expected --with NAME=VALUE, a finite number in SI units, or such as",
        "a1=nan": "expected --with NAME=VALUE",
        "a1=1/0": "expected --with NAME=VALUE",
    }.items():
        for more in ((), ("--format", "numeric")):
            with pytest.raises(SymgenError, match=message):
                shown("slider_crank", "row_1_transform", "--with", wrong, *more)


def test_the_heading_of_numbers_states_given_values():
    text = shown("slider_crank", "row_2_transform", "--format", "numeric", "--with", "theta2=.7")
    assert text.startswith("row_2_transform with theta2=.7, otherwise at theta1 = 0 deg [1, m]")
    assert numbers(text)["x"][0] == pytest.approx(np.cos(0.7), abs=0.3)
    block = shown(
        "rod",
        "mass_matrix",
        "--format",
        "numeric",
        *["--with", "m=1", "--with", "l=1", "--with", "l_c=0.5", "--with", "I_c=1"],
    )
    assert block.startswith("mass_matrix with m=1, l=1, ")


def test_letters_of_shared_vectors_are_explained_once():
    text = " ".join(shown("slider_crank", "19a").partition("where")[2].split())
    for letter, meaning, unit in (("i", "axis i", "1"), ("k", "axis k", "1"), ("p", "origin", "m")):
        line = f"{letter}_* {meaning} of the frame after motion *, in the first frame [{unit}]"
        assert text.count(line) == text.count(f" {letter}_*") == 1
    assert "_*" not in shown("four_bar", "mass_matrix")


def test_the_heading_of_rows_names_those_that_are_shown():
    assert shown("vertical_rods", "10a").startswith("lower_moment: row u_bar_lower: rate")
    assert shown("rigid_element", "4.3").startswith("levers: rows R_x, R_y: ")
    assert shown("rigid_element", "4.3", "--rows", "R_x").startswith("levers: row R_x: ")


@pytest.mark.parametrize(
    ("name", "matrix", "given", "row"),
    [
        ("rod", "particle_masses", "m=1 l=0 l_c=0.5 I_c=1", "start"),
        ("four_bar_motion", "angles", "a=1 b=1 c=1 d=9 branch=1 theta1=0.5", "theta2"),
        ("four_bar_motion", "angles", "a=1 b=1 c=1 d=3 branch=1 theta1=0", "theta3"),
    ],
)
def test_values_without_a_real_number_are_refused(name, matrix, given, row):
    values = [word for text in given.split() for word in ("--with", text)]
    with pytest.raises(SymgenError, match=f"{matrix} has no finite real value in row {row}: "):
        shown(name, matrix, "--format", "numeric", *values)


# --- the record -----------------------------------------------------------------------------------------------


def test_the_record_of_rods_goes_from_particles_to_rows():
    system = derived("four_bar")
    scene = resolve(load_scene("four_bar"))
    steps, linkage = record(scene, system), in_letters(scene)[0]
    assert [s.title for s in steps] == [
        "Coordinates",
        "Particles",
        "Energies",
        "Mass matrix and forces",
        "Constraints",
        "Momentum rows",
    ]
    assert all(s.source and s.about and s.matrices for s in steps)
    # Three particles have the mass, the first and the second moment of the rod.
    masses = steps[1].matrices[0]
    for name, (a, b, c) in zip(masses.rows, masses.matrix.tolist(), strict=True):
        k = linkage.link(name)
        assert sp.simplify(a + b + c - k.mass) == 0
        assert sp.simplify((b / 2 + c) * k.length - k.mass * k.centre) == 0
        assert sp.simplify((b / 4 + c) * k.length**2 - k.inertia - k.mass * k.centre**2) == 0


@pytest.mark.parametrize(
    ("model", "words"),
    [
        ("slider_crank", ("Rahman, Eqs. (1)-(4)", "Closure", "Screws", "Eqs. (62)-(64)", "crank_binor")),
        (
            "elastic_slider_crank",
            ("Attia", "(6.12); rotary inertia added", "Eqs. (7.24)-(7.27)", "weak_form"),
        ),
        ("rod", ("particle_masses", "Matrices of this system")),
    ],
)
def test_the_record_names_its_sources(model, words):
    text = shown(model, "derivation")
    for word in words:
        assert word in text
    with pytest.raises(SymgenError, match="unicode or latex"):
        shown(model, "derivation", "--format", "c")


# --- notation, LaTeX, notebooks -------------------------------------------------------------------------------


def test_names_as_mathematics():
    assert latex_name("theta1_rate") == r"\dot{\theta}_{1}"
    assert latex_name("OA_lambda") == r"\lambda_{\mathrm{OA}}"
    assert latex_name("A_vx") == "v_{A,x}"
    assert (latex_name("ax"), latex_name("dot"), latex_name("box")) == (
        "a_{x}",
        r"\mathrm{dot}",
        r"\mathrm{box}",
    )
    assert "θ" in mathml_name("theta1") and "<mn>1</mn>" in mathml_name("theta1")
    x, y = sp.Symbol("A_vx", real=True), sp.Symbol("rho", real=True)
    assert latex(x**2 * y) == r"v_{A,x}^{2} \rho"
    assert "<msubsup>" in mathml(x**2) and "<mo>−</mo>" in mathml(-y) and "&lt;" in mathml(sp.Symbol("a<b"))


def test_long_numbers_are_readable():
    # 60 rpm is 2 pi rad/s, with pi as a rational of 63 digits.
    assert Fraction(PI) == parse_quantity("180 deg")[0]
    jacobian = ("crank_rocker", "constraint_jacobian", "--numeric")
    assert "-sin(2⋅π⋅t)    cos(2⋅π⋅t)" in shown(*jacobian)
    assert r"\sin{\left(2 \pi t \right)}" in shown(*jacobian, "--format", "latex")
    mass = derived("thesis_four_bar").in_numbers()["mass_matrix"].matrix[0, 0]
    assert len(str(mass.q)) > 15
    assert readable(mass) == sp.Float(mass, 15)
    assert str(readable(mass)) in shown("thesis_four_bar", "mass_matrix", "--numeric")
    assert readable(sp.Rational(1397, 5000)) == sp.Rational(1397, 5000)


@pytest.mark.parametrize("scene", ["peaucellier", "slider_crank", "tumbling_body"])
def test_different_names_are_written_differently(scene):
    names = [x.name for x in derived(scene).quantities()]
    assert len({latex_name(n) for n in names}) == len({mathml_name(n) for n in names}) == len(names)


@pytest.mark.skipif(
    shutil.which("pdflatex") is None, reason="needs pdflatex (apt install texlive-latex-base)"
)
def test_latex_compiles(tmp_path):
    (tmp_path / "record.tex").write_text(shown("four_bar", "derivation", "--format", "latex"))
    matrices = [shown("slider_crank", m, "--format", "latex") for m in ("screws", "row_3_transform")]
    body = "\n".join(matrices)
    head = (
        r"\documentclass{article}\usepackage[a3paper,landscape]{geometry}\usepackage{amsmath}\begin{document}"
    )
    (tmp_path / "matrices.tex").write_text(f"{head}\n{body}\n\\end{{document}}\n")
    for name in ("record", "matrices"):
        done = subprocess.run(
            ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", f"{name}.tex"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=120,
        )
        assert done.returncode == 0, done.stdout[-1500:]
        assert (tmp_path / f"{name}.pdf").stat().st_size > 10_000


def test_notebooks_show_what_they_are_given():
    system = derived("four_bar")
    assert system["mass_matrix"]._repr_latex_().startswith(r"$\displaystyle \left[\begin{matrix}")
    assert "<td>constraint_jacobian</td><td>3 × 4</td>" in system._repr_html_()
    equations = symgen.build("four_bar").equations
    assert "<td>constraint_jacobian</td><td>3 × 4</td>" in equations._repr_html_()
    assert r"v_{A,x}" in equations["kinetic_energy"]._repr_latex_()
    assert equations["mass_matrix"] == system["mass_matrix"].matrix
    model = symgen.build("four_bar")
    html = model._repr_html_()
    assert "accelerations" in html and str(model.operations["accelerations"]["flops"]) in html
    run = model.simulate(0.2, samples=5)
    html = run._repr_html_()
    assert "data:image/svg+xml;base64" in html and "constraint drift" in html
    turn = symgen.build("planar_4r").inverse_dynamics(samples=5)
    assert "closed within" in turn._repr_html_()
