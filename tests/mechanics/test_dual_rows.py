"""Rows, screws and paths of a loop against the paper's own matrices and against each other."""

from __future__ import annotations

import math

import pytest
import sympy as sp
from shared.loops import planar_4r, slider_crank

from symgen.mechanics.loop.dual_paths import Paths
from symgen.mechanics.loop.dual_rows import (
    GROUND,
    JointMotion,
    derivative_operator,
    motions,
    onward,
    row_transform,
)
from symgen.models.loop.derivation import LoopDerivation
from symgen.symbolic.dual import Dual, DualMatrix, DualVector, Z, identity, operator
from symgen.symbolic.names import Names

theta, S, eta, alpha, a = ENTRIES = sp.symbols("theta S eta alpha a", real=True)
ZERO = sp.Integer(0)
c, s = sp.cos, sp.sin


def row(*entries, variables=ENTRIES):
    return motions(1, entries, variables)


def same(found, expected):
    return sp.simplify(sp.Matrix(found) - sp.Matrix(expected)).is_zero_matrix


def test_crank_is_equation_1():
    found = row_transform(row(theta, S, ZERO, ZERO, a))
    assert same(found.real, [[c(theta), -s(theta), 0], [s(theta), c(theta), 0], [0, 0, 1]])
    dual = [
        [-S * s(theta), -S * c(theta), a * s(theta)],
        [S * c(theta), -S * s(theta), -a * c(theta)],
        [0, a, 0],
    ]
    assert same(found.dual, dual)


def test_rod_is_equation_2():
    found = row_transform(row(theta, ZERO, eta, ZERO, a))
    real = [
        [c(theta) * c(eta), -s(theta), c(theta) * s(eta)],
        [s(theta) * c(eta), c(theta), s(theta) * s(eta)],
        [-s(eta), 0, c(eta)],
    ]
    dual = [
        [0, a * c(theta) * s(eta), a * s(theta)],
        [0, a * s(theta) * s(eta), -a * c(theta)],
        [0, a * c(eta), 0],
    ]
    assert same(found.real, real) and same(found.dual, dual)


def test_slider_is_equation_3_and_its_guide_equation_4():
    found = row_transform(row(theta, ZERO, eta, sp.pi / 2, ZERO))
    real = [
        [c(theta) * c(eta), c(theta) * s(eta), s(theta)],
        [s(theta) * c(eta), s(theta) * s(eta), -c(theta)],
        [-s(eta), c(eta), 0],
    ]
    assert same(found.real, real) and found.dual.is_zero_matrix
    guide = row_transform(row(ZERO, S, ZERO, alpha, a))
    dual = [
        [0, -S * c(alpha), S * s(alpha)],
        [S, -a * s(alpha), -a * c(alpha)],
        [0, a * c(alpha), -a * s(alpha)],
    ]
    assert same(guide.real, [[1, 0, 0], [0, c(alpha), -s(alpha)], [0, s(alpha), c(alpha)]])
    assert same(guide.dual, dual)


@pytest.fixture(scope="module")
def two_rows():
    """Two rows with every entry a variable, at some numbers."""
    symbols = sp.symbols("theta1 S1 eta1 alpha1 a1 theta2 S2 eta2 alpha2 a2", real=True)
    rows = [motions(i + 1, symbols[5 * i : 5 * i + 5], symbols) for i in range(2)]
    values = {x: sp.Rational(7 * i + 3, 11) for i, x in enumerate(symbols)}
    return symbols, rows, values


def evaluated(names, matrix, values):
    known = {k: sp.Float(v, 30) for k, v in values.items()}
    for definition in names.definitions:
        known[definition.quantity.symbol] = definition.expression.xreplace(known).evalf(30)
    return sp.Matrix(matrix).xreplace(known).evalf(30)


def small(matrix, tolerance=1e-25):
    return max(abs(x) for x in sp.Matrix(matrix)) < tolerance


def test_operators_are_the_screws(two_rows):
    """Eqs. (12)-(17): H = M Q M^T of every entry is the cross-product matrix of its screw."""
    symbols, rows, values = two_rows
    names = Names()
    paths = Paths(rows, symbols, names)
    before = identity()
    for m, screw in zip(paths.motions, paths.exact_screws, strict=True):
        h = derivative_operator(m, before)
        for found, expected in ((h.real, operator(screw).real), (h.dual, operator(screw).dual)):
            assert small(evaluated(names, found - expected, values)), m.name
        before = before @ m.matrix


def test_operators_are_the_derivatives_of_the_closure(two_rows):
    symbols, rows, values = two_rows
    b = row_transform(rows[0]) @ row_transform(rows[1])
    before = identity()
    for m, symbol in zip((m for r in rows for m in r), symbols, strict=True):
        h = derivative_operator(m, before) @ b
        for found, expected in ((h.real, b.real), (h.dual, b.dual)):
            assert small(evaluated(Names(), found - sp.diff(expected, symbol), values)), m.name
        before = before @ m.matrix


def test_operator_of_eta_has_the_turn_by_theta():
    """Eq. (9) as printed: Q = Z(theta) [j]x Z(theta)^T."""
    motion = JointMotion(1, "eta", eta)
    found = derivative_operator(motion, Z(Dual(theta)))
    printed = [[0, 0, c(theta)], [0, 0, s(theta)], [-c(theta), -s(theta), 0]]
    assert same(found.real, printed)


def test_frames_are_the_products_of_dual_matrices(two_rows):
    _, rows, values = two_rows
    names, frame, product = Names(), GROUND, identity()
    for m in (m for r in rows for m in r):
        frame, product = onward(frame, m, names, m.name), product @ m.matrix
    for found, expected in ((frame.dual.real, product.real), (frame.dual.dual, product.dual)):
        assert small(evaluated(names, found - expected, values))
    there_and_back = frame.dual @ frame.inverse.dual
    assert small(evaluated(names, there_and_back.real - sp.eye(3), values))
    assert small(evaluated(names, there_and_back.dual, values))
    for m in reversed([m for r in rows for m in r]):
        frame = onward(frame, m, names, f"{m.name}_back", back=True)
    assert small(evaluated(names, frame.turn - sp.eye(3), values))
    assert small(evaluated(names, frame.origin, values))


def closed_slider_crank() -> dict[str, sp.Expr]:
    """A closed position of the spatial slider-crank, by the slider's quadratic (section 1 of the method)."""
    a1, a2, a4, angle = (sp.Integer(12), sp.Integer(50), sp.Integer(20), sp.Rational(25, 6))
    theta1, s1 = sp.Rational(4, 5), sp.Rational(7, 2)
    ca, sa = sp.cos(angle).evalf(40), sp.sin(angle).evalf(40)
    b = a1 * sp.sin(theta1) * sa + s1 * ca
    q = (a4 + a1 * sp.cos(theta1)) ** 2 + (a1 * sp.sin(theta1)) ** 2 + s1**2 - a2**2
    slide = (-b + sp.sqrt(b**2 - q)).evalf(40)
    p2 = sp.Matrix([a1 * sp.cos(theta1), a1 * sp.sin(theta1), s1]).evalf(40)
    p3 = -sp.Matrix([a4, slide * sa, slide * ca])
    u = (p3 - p2) / a2
    turned, eta2 = sp.atan2(u[1], u[0]), -sp.asin(u[2])
    first = sp.rot_ccw_axis3(turned) * sp.rot_ccw_axis2(eta2)
    last = sp.Matrix([[1, 0, 0], [0, ca, sa], [0, -sa, ca]])
    r = (first.T * last).evalf(40)
    return {
        "theta1": theta1, "S1": s1, "theta2": turned - theta1, "eta2": eta2, "S4": slide,
        "theta3": sp.atan2(r[1, 0], r[0, 0]), "eta3": -sp.asin(r[2, 0]), "alpha3": sp.atan2(r[2, 1], r[2, 2]),
        "a4": a4, "alpha4": angle,
    }  # fmt: skip


def test_both_paths_agree_where_the_loop_is_closed():
    """Screws, velocities and accelerations by the mixed way and all from the first frame."""
    model = LoopDerivation(slider_crank(fixed={"stroke": sp.Rational(7, 2), "ratio": 1}))
    other = Paths(model.rows, model.rates, Names())
    other.__dict__["meet"] = len(other.motions)  # all outward
    values = {sp.Symbol(k, real=True): v.evalf(40) for k, v in closed_slider_crank().items()}

    def column(paths, part, values=values):
        return evaluated(paths.names, part, values)

    n = len(model.variables)
    jacobian = column(model.paths, model.paths.columns(model.paths.exact_screws, n))
    both = [column(p, p.columns(p.screws, n)) for p in (model.paths, other)]
    assert small(both[0] - jacobian) and small(both[1] - jacobian)
    given = sp.Matrix([sp.Rational(3, 2), sp.Rational(-1, 3)])
    rates = [*given, *(jacobian[:, 2:].LUsolve(-jacobian[:, :2] * given))]
    values |= {x: v for x, v in zip(model.rates, rates, strict=True)}
    drift = [
        column(p, p.columns(p.screw_rates(), n) * sp.Matrix(model.rates), values)
        for p in (model.paths, other)
    ]
    assert small(drift[0] - drift[1], 1e-22)
    second = [*given, *(jacobian[:, 2:].LUsolve(-drift[0] - jacobian[:, :2] * given))]
    values |= {x: v for x, v in zip(model.second, second, strict=True)}
    nothing = DualVector((ZERO,) * 3, (ZERO,) * 3)
    for end in model.paths.ends[:-1]:
        moved = [column(p, p.velocities[end].column, values) for p in (model.paths, other)]
        assert small(moved[0] - moved[1], 1e-22)
        rates_of = [
            column(p, p.accelerations(model.second, nothing, "x_")[end].column, values)
            for p in (model.paths, other)
        ]
        assert small(rates_of[0] - rates_of[1], 1e-20)
    # Where the loop is open they differ, so the comparison above can fail.
    values[sp.Symbol("theta3", real=True)] += sp.Rational(1, 10)
    both = [column(p, p.columns(p.screws, n), values) for p in (model.paths, other)]
    assert not small(both[0] - both[1], 1e-3)


def test_ways_meet_in_the_middle():
    model = LoopDerivation(planar_4r())
    meet = model.paths.motions[model.paths.meet]
    assert (meet.row, meet.entry) == (3, "theta")
    assert model.paths.ends == [2, 4, 6, 8]


def test_operator_is_a_dual_matrix():
    assert isinstance(derivative_operator(JointMotion(1, "S", S), identity()), DualMatrix)
    assert math.isclose(float(JointMotion(1, "S", 2 * S, ((0, sp.Integer(2)),)).rate([sp.Float(3)])), 6)
