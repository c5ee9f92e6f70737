"""Equations between whole vectors and matrices: with the named matrices inserted they are those of mechanics.

The thesis' (5.16), (5.17), (6.13), (7.7), (7.9), (7.23), (7.28), (E.25) and (E.29). Numbers are rational, so that sides are equal
exactly; those of a linkage have 30 digits.
"""

from __future__ import annotations

import math
import random
import re
from unicodedata import normalize

import numpy as np
import pytest
import sympy as sp
from shared.commands import call
from shared.thesis_assembly import BOUNDARY, FT, HELD, LBF, NUMBERS, SIZES, of_link, rigid_motion

from symgen.errors import ModelError
from symgen.inspection.state import state_of
from symgen.mechanics.elastic.letters import assembly_equations, condensed_equations
from symgen.pipeline.build import build_scene
from symgen.pipeline.subject import Subject
from symgen.report.mathematics.python import in_python
from symgen.report.page.views import symbols
from symgen.symbolic.notation import latex, mathml, text

X, TIME = sp.symbols("x tau", real=True)
BEAM = Subject("element_beam8", {})
INEXTENSIBLE = {f"links.{link}.elastic.axial": False for link in ("crank", "coupler", "output")}


def inserted(expression, values):
    """Evaluate an equation's side with numbers and matrices for its letters; a 1 x 1 matrix is its entry."""
    if expression.is_Symbol:
        return values[expression.name]
    if isinstance(expression, sp.transpose):
        return inserted(expression.args[0], values).T
    parts = [inserted(x, values) for x in expression.args]
    if expression.is_Add:
        return sum(parts[1:], parts[0])
    if expression.is_Mul:
        whole = sp.prod(x for x in parts if not isinstance(x, sp.MatrixBase))
        for part in parts:
            whole = whole * part if isinstance(part, sp.MatrixBase) else whole
        return whole[0] if isinstance(whole, sp.MatrixBase) and whole.shape == (1, 1) else whole
    if expression.func == sp.Function("diag"):
        return sp.diag(*parts)
    return expression.func(*parts) if parts else expression


def named(letter, system, divided_by):
    """Return the matrix that the command in the description of a letter shows, without the factor m of loads."""
    (name,) = re.findall(r"symgen show (?:element_beam8|SCENE) (\w+)", letter.description)
    return system(name) / (divided_by if "times m" in letter.description else 1)


class Link:
    """A link with an element of random length and section in a random motion, in fixed axes, to order tau^2."""

    def __init__(self):
        draw = random.Random(3)
        self.number = lambda: sp.Rational(draw.randint(-40, 40) or 1, draw.randint(7, 19))
        self.length, self.mass, self.axial, self.bending = (abs(self.number()) for _ in range(4))
        self.spin, self.turning = self.number(), self.number()
        self.shape = BEAM.system.expanded("shape").subs({s: self.known(s) for s in self.symbols("shape")})
        self.states = [self.column(8) for _ in range(3)]
        self.varied = [self.column(8) for _ in range(2)]
        c, s, angle = sp.Rational(3, 5), sp.Rational(4, 5), self.spin * TIME + self.turning * TIME**2 / 2
        cos, sin = (
            a + k * b * angle - a * (self.spin * TIME) ** 2 / 2 for a, b, k in ((c, s, -1), (s, c, 1))
        )
        self.turn = sp.Matrix([[cos, -sin], [sin, cos]])
        first = self.column(2) * TIME + self.column(2) * TIME**2 / 2
        at = sum((x * TIME**k / sp.factorial(k) for k, x in enumerate(self.states)), sp.zeros(8, 1))
        self.functions = self.shape[:2, :]
        self.place = first + self.turn * (sp.Matrix([X, 0]) + self.functions * at)
        origin = self.turn.T * first.diff(TIME)  # components in axes of the link
        self.first = origin.subs(TIME, 0), origin.diff(TIME).subs(TIME, 0)

    def column(self, size):
        return sp.Matrix([self.number() for _ in range(size)])

    def symbols(self, name):
        return BEAM.system.expanded(name).free_symbols

    def known(self, symbol):
        """Of a constant section, and without gravity at the origin of the link."""
        given = {"L": self.length, "m0": self.mass, "a0": self.axial, "b0": self.bending, "x": X}
        given |= {"omega": self.spin, "omega_rate": self.turning}
        if symbol.name in ("ax", "ay"):
            (vx, vy), (rx, ry) = self.first
            return {"ax": rx - self.spin * vy, "ay": ry + self.spin * vx}[symbol.name]
        return given[symbol.name]

    def integral(self, expression):
        return sp.integrate(sp.expand(expression), (X, 0, self.length))

    def at_start(self, of):
        return of.subs(TIME, 0)

    def shown(self, name):
        """Return a named matrix of the building block with the numbers of the link."""
        system = BEAM.steps if name in BEAM.steps else BEAM.system
        matrix = system.expanded(name)
        return sp.Matrix(matrix.subs({s: self.known(s) for s in matrix.free_symbols}))

    def values(self, system):
        (vx, vy), (rx, ry) = self.first
        given = {
            "m": self.mass, "L": self.length, "theta_t": self.spin, "theta_tt": self.turning, "x1_t": vx,
            "y1_t": vy, "x1_tt": rx, "y1_tt": ry, "(S)": self.states[0], "(S_t)": self.states[1],
            "(S_tt)": self.states[2], "delta(S)": self.varied[0], "delta(S_t)": self.varied[1],
            "T": self.kinetic, "V": self.strain, "delta(T)": self.varied_kinetic, "delta(V)": self.varied_strain,
        }  # fmt: skip
        others = [x for x in system.arguments() if x.name not in given]
        return given | {x.name: named(x, self.shown, self.mass) for x in others}

    @property
    def velocity(self):
        return self.place.diff(TIME)

    @property
    def kinetic(self):
        v = self.at_start(self.velocity)
        return self.mass * self.integral(v.dot(v)) / 2

    def strains(self, state):
        return (self.functions[0, :] * state)[0].diff(X), (self.functions[1, :] * state)[0].diff(X, 2)

    @property
    def strain(self):
        axial, curvature = self.strains(self.states[0])
        return self.integral(self.axial * axial**2 + self.bending * curvature**2) / 2

    @property
    def varied_kinetic(self):
        """The momentum times the variation of the velocity in fixed axes."""
        turned = self.turn * self.functions
        change = turned.diff(TIME) * self.varied[0] + turned * self.varied[1]
        return self.mass * self.integral(self.at_start(self.velocity).dot(self.at_start(change)))

    @property
    def varied_strain(self):
        pairs = zip(self.strains(self.states[0]), self.strains(self.varied[0]), strict=True)
        return self.integral(
            sum(k * a * b for k, (a, b) in zip((self.axial, self.bending), pairs, strict=True))
        )

    @property
    def residual(self):
        """D'Alembert: the virtual work of inertia in fixed axes and of the strain, by unit of each unknown."""
        acceleration = self.at_start(self.place.diff(TIME, 2))
        moved = self.at_start(self.turn) * self.functions
        work = [self.mass * self.integral(acceleration.dot(moved[:, k])) for k in range(8)]
        own = self.strains(self.states[0])
        units = [self.strains(sp.eye(8)[:, k]) for k in range(8)]
        elastic = [self.integral(self.axial * own[0] * a + self.bending * own[1] * b) for a, b in units]
        return sp.Matrix([a + b for a, b in zip(work, elastic, strict=True)])


@pytest.fixture(scope="module")
def link():
    return Link()


def sides(m, values):
    return inserted(m.left, values), inserted(m.matrix[0], values)


def shown_by(*arguments):
    return normalize("NFC", call("show", *arguments))


def one(number, subject=BEAM):
    (m, system) = next((c.matrices[0], c.system) for c in subject.found(number) if c.matrices[0].in_letters)
    return m, system


def test_polynomial_coefficients_give_the_unknowns_and_follow_from_them(link):
    """(5.16), (5.17) with the shape functions as the polynomials, and (5.23) beside its inverse, to 30 digits."""
    length, x, system = sp.Float("1.7", 30), sp.Symbol("x", real=True), BEAM.steps
    known = {q.symbol: length for q in system.quantities() if q.name == "L"}
    matrix, inverse = (
        sp.Matrix(system[n].matrix.xreplace(known)) for n in ("coefficients", "inverse_coefficients")
    )
    assert max(map(abs, matrix * inverse - sp.eye(8))) < sp.Float("1e-26", 30)
    u, w = (sp.zeros(1, 8) for _ in "uw")
    for k, name in enumerate(system["coefficients"].columns):
        (u if name[0] == "B" else w)[k] = x ** int(name[1])
    shape = BEAM.system.expanded("shape")[:2, :].xreplace(
        known | {s: length for s in link.symbols("shape") if s.name == "L"}
    )
    for row, powers in zip(shape.tolist(), (u, w), strict=True):
        for entry, other in zip(row, powers * inverse, strict=True):
            difference = sp.Poly(entry - other, x).all_coeffs()
            assert max(map(abs, difference)) < sp.Float("1e-26", 30)
    values = {"(S)": link.states[0], "[C]": matrix, "(A)": inverse * link.states[0]}
    for number in ("5.16", "5.17"):
        left, right = sides(one(number)[0], values)
        assert max(map(abs, left - right)) < sp.Float("1e-25", 30)
    assert "A5 by theta2 is printed -3/L^5" in shown_by("element_beam8", "5.23")
    assert abs(inverse[7, 6] + 3 / length**4) < sp.Float("1e-26", 30)


@pytest.mark.parametrize("number", ["6.13", "7.7", "7.8", "7.9"])
def test_energies_and_their_variation_are_integrals_along_the_link(link, number):
    m, system = one(number)
    left, right = sides(m, link.values(system))
    assert left != 0 and sp.simplify(left - right) == 0


@pytest.mark.parametrize("number", ["7.23", "7.28"])
def test_the_equation_of_motion_of_an_element_is_that_of_virtual_work(link, number):
    m, system = one(number)
    left, right = sides(m, link.values(system))
    residual = left - right
    residual = residual.T if residual.rows == 1 else residual
    assert link.residual.norm() > 0 and (residual - link.residual).applyfunc(sp.simplify) == sp.zeros(8, 1)


def numbers(system, values):
    """Return a function from the names of matrices to their numbers."""
    known = {q.symbol: sp.Float(values[q.name], 30) for q in system.arguments() if q.name in values}
    known |= {c.quantity.symbol: sp.N(c.expression, 30) for c in system.constants}
    for d in system.definitions:
        known[d.quantity.symbol] = d.expression.xreplace(known)
    return lambda name: sp.Matrix(system[name].matrix.xreplace(known))


@pytest.fixture(scope="module", params=[("thesis_four_bar", INEXTENSIBLE), ("thesis_rig", {})])
def linkage(request):
    subject = Subject(*request.param)
    values = state_of(build_scene(subject.text), "60 deg").of(
        subject.assembled, {"omega_free": sp.Integer(170)}
    )
    return subject, numbers(subject.assembled, values)


def assert_equal(found, expected):
    size = max(map(abs, expected))
    assert size > 0 and max(map(abs, found - expected)) < size * sp.Float("1e-25")


def letters_of(system, shown):
    given = {"omega_free": sp.Float(170, 30)} | {
        x.name: sp.Matrix() for x in system.arguments() if "D_r" in x.name
    }
    if "[KT]" in {x.name for x in system.arguments()}:
        given["[KT]"] = shown("elastic_stiffness") + shown("elastic_motion_stiffness")
    of = [x for x in system.arguments() if not x.symbol.is_commutative and x.name not in given]
    return given | {x.name: named(x, shown, 1) for x in of}


def test_left_sides_of_reduced_matrices(linkage):
    subject, shown = linkage
    values = letters_of(subject.assembled, shown)
    checked = [m for m in subject.assembled.matrices if m.left is not None]
    for m in checked:
        assert_equal(inserted(m.left, values), shown(m.name))
    assert len(checked) == 5


def test_the_assembled_stiffness_is_that_of_the_elements():
    """(8.1) by links in fixed axes with (F.1) integrated independently, against elastic_stiffness by symgen."""
    theta = math.radians(60)
    system = assembly_equations()
    z = np.zeros((24, 20))
    z[np.arange(24), np.ravel(NUMBERS) - 1] = 1
    values = {"[Z]": sp.Matrix(z)}
    for k, of in enumerate(rigid_motion(theta)[:3], 1):
        values[f"[K{k}]"] = sp.Matrix(of_link(of)["elastic_stiffness"])
    m = system["stiffness_of_linkage"]
    total = np.array(inserted(m.matrix[0], values).tolist(), dtype=float)
    free = [k for k in range(20) if k + 1 not in (*BOUNDARY, HELD)]
    size = np.zeros(20)
    size[np.ravel(NUMBERS) - 1] = np.tile(SIZES, 6)
    own = build_scene(Subject("thesis_four_bar", {}).text).matrices(theta)["elastic_stiffness"].values
    scaled = own * np.outer(size, size)[np.ix_(free, free)]
    expected = total[np.ix_(free, free)] * LBF * FT
    assert m.left == sp.Symbol("[K]", commutative=False)
    assert np.max(np.abs(scaled - expected)) < 1e-12 * np.max(np.abs(expected))


def test_condensed_equations_are_those_of_the_reduced_matrices(linkage):
    """(E.25) and (E.26)-(E.29), by the matrices that R reduces."""
    subject, shown = linkage
    m, system = one("E.29", subject)
    draw, size = random.Random(5), shown("reduced_mass").rows
    values = letters_of(system, shown)
    p, rate, second = (sp.Matrix([draw.uniform(-1, 1) for _ in range(size)]) for _ in range(3))
    values |= {"(D_r)": p, "(D_r_t)": rate, "(D_r_tt)": second}
    left, right = sides(m, values)
    r = shown("condensation")
    whole = (
        shown("reduced_mass") * second + shown("reduced_gyroscopic") * rate + shown("reduced_stiffness") * p
    )
    assert_equal(left, whole + r.T * shown("elastic_motion_stiffness") * r * p)
    assert_equal(right, shown("reduced_load"))
    m, _ = one("E.25", subject)
    assert m.matrix[0] == 0
    assert_equal(inserted(m.left, values), shown("free_vibration") * p)


def test_the_equations_are_whole_in_every_format():
    """In text with the command of every letter; in LaTeX, in MathML of pages and notebooks, and in Python."""
    shown = shown_by("element_beam8", "7.28")
    assert "[MD]⋅(S̈) - 2⋅θ̇⋅[AD]⋅(Ṡ) + [KD]⋅(S) = (Q)" in shown
    for name in ("constant_mass", "constant_gyroscopic", "KD", "Q"):
        assert f"symgen show element_beam8 {name}" in shown
    m, _ = one("7.23")
    line = normalize("NFC", text(m.equation))
    assert line.startswith("(S̈)ᵀ⋅(m⋅[B] + m⋅[M]) + (Ṡ)ᵀ⋅(m⋅θ̇⋅[A] - m⋅θ̇⋅[A]ᵀ")
    assert line.endswith(" = -m⋅ẍ₁⋅(E)ᵀ - m⋅θ̇⋅ẋ₁⋅(G)ᵀ + m⋅θ̇⋅ẏ₁⋅(E)ᵀ - m⋅ÿ₁⋅(G)ᵀ + m⋅θ̇²⋅(N)ᵀ - m⋅θ̈⋅(L)ᵀ")
    assert latex(m.equation).startswith(
        r"\left(\ddot{S}\right)^{T} \left(m \left[B\right] + m \left[M\right]\right)"
    )
    assert latex(m.equation) in m._repr_latex_()
    assert mathml(m.equation).count("<mi>T</mi></msup>") == line.count("ᵀ") == 12
    scope = {}
    exec(in_python(m), scope)
    letters = {
        scope[re.sub(r"\W", "_", s.name).lstrip("_")]: s
        for s in m.equation.free_symbols
    }  # fmt: skip
    read = scope["motion_of_element"].xreplace(letters)
    assert sp.expand(read.lhs - m.left) == 0 and sp.expand(read.rhs - m.matrix[0]) == 0
    assert "motion_of_element" in shown_by("element_beam8", "derivation", "--format", "latex").replace(
        "\\", ""
    )


def test_scenes_lead_to_the_equations_without_settings():
    """A linkage with extensible links has no condensing matrix, but its record has the equation."""
    shown = shown_by("thesis_four_bar", "E.29")
    assert "= [T] ⋅(Q)" in shown and "symgen show SCENE elastic_mass" in shown
    assert "T = 1/2⋅m⋅(L⋅ẋ₁²" in shown_by("thesis_four_bar", "6.13")
    assert "[T]ᵀ⋅(Q) =" in shown_by("thesis_rig", "E.29")


@pytest.mark.parametrize(
    ("name", "letter"), [("Q", "(Q)"), ("KD", "[KD]"), ("constant_mass", "[MD]"), ("B", "[B]")]
)
def test_a_matrix_with_a_letter_of_its_own_has_it_on_the_left(name, letter):
    """A row of it has no left side."""
    assert f"\n{letter} =\n" in shown_by("element_beam8", name)
    assert rf"\right{letter[-1]} = \left[" in call(
        "show", "element_beam8", name, "--format", "latex"
    ).replace("\n", "")
    assert " =\n" not in shown_by("element_beam8", name, "--rows", "u1")


def test_a_fraction_stands_in_front_of_a_sum_in_brackets():
    s, t = (sp.Symbol(x, commutative=False) for x in ("(S)", "(T)"))
    half, m = sp.Rational(1, 2), sp.Symbol("m")
    for e, line in {
        half * m * s: "1/2⋅m⋅(S)",
        -half * s: "-1/2⋅(S)",
        sp.Mul(half, s + t, evaluate=False): "",
    }.items():
        assert text(e) == (line or "1/2⋅((S) + (T))")
    assert text(sp.Mul(-half, m, s + t)) == "-1/2⋅m⋅((S) + (T))"
    shown = shown_by("element_beam8", "kinetic_energy_of_element", "--by", "m")
    assert "\n1/2⋅(L⋅ẋ₁² + " in shown and "(Ṡ))\n" in shown


def test_pages_list_a_letter_of_each_system():
    """[M] is a matrix of an element, and that of the linkage in the condensed equations."""
    tables = symbols([*(step.system for step in BEAM.record), condensed_equations()])
    about = {x.about for table in tables.values() for x in table if x.name == "[M]"}
    assert {x.rpartition(" ")[2] for x in about} == {"M", "elastic_mass"}


@pytest.mark.parametrize("form", ["c", "shared", "numeric"])
def test_an_equation_in_letters_has_no_entries(form):
    with pytest.raises(ModelError, match="equation_of_element is an equation between vectors and matrices"):
        shown_by("element_beam8", "equation_of_element", "--format", form)
