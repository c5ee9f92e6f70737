"""The equation of an elastic link against Lagrange's equations in a frame at rest, in exact numbers."""

from __future__ import annotations

from dataclasses import astuple, replace
from functools import cache
from random import Random

import numpy as np
import pytest
import sympy as sp
from shared.shipped import derived
from symgen.generated import element_beam8

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH, PLACE, shape_functions
from symgen.mechanics.elastic import hamilton
from symgen.mechanics.elastic.beam_matrices import ElementSection, beam_matrices
from symgen.mechanics.elastic.turning_axes import (
    COSINE,
    SINE,
    Equation,
    global_equation,
    local_equation,
    thesis_equation,
)
from symgen.models.elastic.derivation import elastic_derivation_system
from symgen.symbolic.exact import Exact

x = sp.Symbol("x")
L = sp.Rational(3, 2)
omega, omega_rate, ax, ay, N0 = (q.symbol for q in hamilton.MOTION)
c, s = COSINE.symbol, SINE.symbol
#: Properties along the element as polynomials in x: mass, rotary, axial, bending, shear.
PROPERTIES = tuple(
    sum(sp.Rational(k, 7) * x**i for i, k in enumerate(row))
    for row in ((9, 2, 3), (1, 2, 1, 3, 1), (30, -4, 5), (20, 3, -2, 1, 2), (11, 2, 4))
)


def fractions(random, n):
    return [sp.Rational(random.randint(-20, 20), 7) for _ in range(n)]


@pytest.fixture(params=ELEMENTS)
def element(request):
    return ELEMENTS[request.param]


@cache
def matrices(element):
    """The matrices of the element with the properties above, and the length L."""
    scaled = [
        tuple(sp.Poly(p, x).coeff_monomial(x**k) * L**k for k in range(n))
        for p, n in zip(PROPERTIES, (3, 5, 3, 5, 3), strict=True)
    ]
    found = beam_matrices(element, ElementSection(*scaled))
    return replace(
        found,
        **{name: _at_length(getattr(found, name)) for name in found.__dataclass_fields__},
    )


def _at_length(value):
    if isinstance(value, tuple):
        return tuple(map(_at_length, value))
    return value.xreplace({LENGTH.symbol: L})


def numbers(equation: Equation, values) -> Equation:
    return Equation(*(m.xreplace(values) for m in astuple(equation)))


class Fields:
    """Displacements of the element over x and symbols of its unknowns, and d/dt of anything of them."""

    def __init__(self, element) -> None:
        n = len(element.dofs)
        self.s, self.s_t, self.s_tt = (sp.symbols(f"s{k}_:{n}") for k in range(3))
        shape = shape_functions(element)
        known = {PLACE.symbol: x / L, LENGTH.symbol: L}
        u, w, phi = (
            sum(f.xreplace(known) * a for f, a in zip(row, self.s, strict=True))
            for row in (shape.axial, shape.transverse, shape.rotation)
        )
        self.X0, self.X1, self.X2, self.Y0, self.Y1, self.Y2 = sp.symbols("X:3 Y:3")
        pairs = [*zip(self.s, self.s_t, strict=True), *zip(self.s_t, self.s_tt, strict=True)]
        pairs += [(self.X0, self.X1), (self.X1, self.X2), (self.Y0, self.Y1), (self.Y1, self.Y2)]
        self.rates = dict(pairs) | {c: -s * omega, s: c * omega, omega: omega_rate}
        self.u, self.w, self.phi = u, w, phi
        #: The point and the turn of its section, in the frame at rest.
        self.point = (self.X0 + c * (x + u) - s * w, self.Y0 + s * (x + u) + c * w)
        velocity = [self.rate(p) for p in self.point]
        mu, rotary = PROPERTIES[:2]
        spin = rotary * (omega + self.rate(phi)) ** 2 if element.rotary else 0
        self.kinetic = (mu * (velocity[0] ** 2 + velocity[1] ** 2) + spin) / 2

    def rate(self, e):
        return sum(sp.diff(e, symbol) * r for symbol, r in self.rates.items())

    def values(self, seed):
        """Exact numbers for everything; the direction is that of a 3-4-5 triangle."""
        random = Random(seed)
        names = [*self.s, *self.s_t, *self.s_tt, omega, omega_rate, N0]
        names += [self.X0, self.X1, self.X2, self.Y0, self.Y1, self.Y2]
        found = dict(zip(names, fractions(random, len(names)), strict=True))
        return found | {c: sp.Rational(3, 5), s: sp.Rational(4, 5)}


def over_element(density):
    """The integral of a polynomial; ``sp.integrate`` first asks at length whether it is zero."""
    return sp.Poly(sp.expand(density), x).integrate(x).eval(L)


GRAVITY = (sp.Rational(5, 3), sp.Rational(-29, 3))


def first_point(fields, values):
    """Acceleration of the first point less gravity, in the link's axes."""
    X, Y = (values[a] - g for a, g in zip((fields.X2, fields.Y2), GRAVITY, strict=True))
    return {ax: values[c] * X + values[s] * Y, ay: -values[s] * X + values[c] * Y}


@cache
def fields_of(element):
    return Fields(element)


def test_the_equation_is_that_of_lagrange_in_a_frame_at_rest(element):
    """Energies of the link as seen from rest, differentiated by the unknowns: no rotating axes anywhere."""
    fields = fields_of(element)
    values = fields.values(11)
    values |= first_point(fields, values)
    mu, _, axial, bending, shear = PROPERTIES
    before, moment = (sp.integrate(sp.expand(p), (x, 0, x)) for p in (mu, mu * x))
    force = values[N0] + values[ax] * before - values[omega] ** 2 * moment
    slope = sp.diff(fields.w, x)
    potential = (
        axial * sp.diff(fields.u, x) ** 2
        + bending * sp.diff(fields.phi, x) ** 2
        + shear * (slope - fields.phi) ** 2
        + force * slope**2
    ) / 2 - mu * sum(g * p for g, p in zip(GRAVITY, fields.point, strict=True))
    tau = sp.Symbol("tau")
    line = {y: values[y] + tau * r.xreplace(values) for y, r in fields.rates.items()}
    expected = []
    for a, a_t in zip(fields.s, fields.s_t, strict=True):
        momentum = sp.diff(fields.kinetic, a_t)
        moved = sp.diff(momentum.xreplace(line), tau).xreplace({tau: sp.Integer(0)})
        expected.append(over_element(moved - sp.diff(fields.kinetic - potential, a).xreplace(values)))
    equation = numbers(local_equation(matrices(element)), values)
    found = residual(equation, *([values[a] for a in row] for row in (fields.s, fields.s_t, fields.s_tt)))
    assert found == sp.Matrix(expected)


def residual(equation, at, rate, second):
    at, rate, second = map(sp.Matrix, (at, rate, second))
    return equation.mass * second + equation.damping * rate + equation.stiffness * at - equation.load


def test_the_kinetic_energy_of_the_field_is_that_of_the_matrices(element):
    """Eq. (6.13) with all properties along the link, energy of the rigid motion included."""
    fields, m = fields_of(element), matrices(element)
    values = fields.values(5)
    at, rate = (sp.Matrix([values[a] for a in row]) for row in (fields.s, fields.s_t))
    vx = values[c] * values[fields.X1] + values[s] * values[fields.Y1]
    vy = -values[s] * values[fields.X1] + values[c] * values[fields.Y1]
    w, mu = values[omega], PROPERTIES[0]
    spin = PROPERTIES[1] if element.rotary else 0
    rigid = over_element((mu * (vx**2 + (vy + w * x) ** 2) + spin * w**2) / 2)
    quadratic = rate.T * m.mass * rate / 2 + w * at.T * m.gyroscopic * rate
    quadratic += w**2 * at.T * m.centrifugal * at / 2
    linear = vx * (m.load_x.T * rate - w * m.load_y.T * at) + vy * (m.load_y.T * rate + w * m.load_x.T * at)
    linear += w**2 * m.load_out.T * at + w * m.load_turn.T * rate
    assert rigid + (quadratic + linear)[0] == over_element(fields.kinetic.xreplace(values))


def test_the_power_balance(element):
    """The rate of kinetic, strain and gravity energy is the power of what acts on the link from outside.

    That is the nodes' forces by their motion in the link's axes, and force and moment of momentum and gravity
    by the motion of the axes: balances of the whole link, in which the equation has no part.
    """
    fields = fields_of(element)
    values = fields.values(17)
    values |= first_point(fields, values)
    mu, rotary, axial, bending, shear = PROPERTIES
    turning = (omega + fields.rate(fields.phi)) * rotary if element.rotary else 0
    velocity, arm = (
        [fields.rate(p) for p in fields.point],
        (fields.point[0] - fields.X0, fields.point[1] - fields.Y0),
    )
    momentum = [mu * v for v in velocity]
    spin = arm[0] * momentum[1] - arm[1] * momentum[0] + turning
    weight = [mu * g for g in GRAVITY]
    strain = axial * sp.diff(fields.u, x) ** 2 + bending * sp.diff(fields.phi, x) ** 2
    strain += shear * (sp.diff(fields.w, x) - fields.phi) ** 2
    energy = fields.kinetic + strain / 2 - sum(f * p for f, p in zip(weight, fields.point, strict=True))

    tau = sp.Symbol("tau")
    line = {y: values[y] + tau * r.xreplace(values) for y, r in fields.rates.items()}
    line[omega_rate] = values[omega_rate]

    def rate(density):
        return over_element(sp.diff(density.xreplace(line), tau).xreplace({tau: sp.Integer(0)}))

    def now(density):
        return over_element(sp.sympify(density).xreplace(values))

    own = values[fields.X1], values[fields.Y1]
    force = [rate(p) - now(f) for p, f in zip(momentum, weight, strict=True)]
    moment = rate(spin) - now(arm[0] * weight[1] - arm[1] * weight[0])
    moment += own[0] * now(momentum[1]) - own[1] * now(momentum[0])
    slack = {N0: sp.Integer(0)}
    free = replace(matrices(element), geometric=(sp.zeros(len(element.dofs)),) * 3)
    nodes = residual(
        numbers(local_equation(free), values | slack),
        *([values[a] for a in row] for row in (fields.s, fields.s_t, fields.s_tt)),
    )
    power = (sp.Matrix([values[a] for a in fields.s_t]).T * nodes)[0]
    assert rate(energy) == own[0] * force[0] + own[1] * force[1] + values[omega] * moment + power


def test_the_axial_force_does_the_work_of_its_energy(element):
    """Under a constant axial force, geometric energy grows by the power of the geometric stiffness."""
    fields = fields_of(element)
    values = fields.values(19)
    slope = sp.diff(fields.w, x).xreplace(values)
    slope_rate = sp.diff(fields.rate(fields.w).xreplace({omega: 0}), x).xreplace(values)
    at, rate = (sp.Matrix([values[a] for a in row]) for row in (fields.s, fields.s_t))
    before, moment = (sp.integrate(sp.expand(p), (x, 0, x)) for p in (PROPERTIES[0], PROPERTIES[0] * x))
    for matrix, force in zip(matrices(element).geometric, (sp.Integer(1), before, moment), strict=True):
        assert (rate.T * matrix * at)[0] == over_element(force * slope * slope_rate)


def axes(element, values):
    """T, and its first and second rate, by d/dt of its entries."""
    turn = sp.eye(len(element.dofs))
    for node in "12":
        i, j = element.dofs.index(f"u{node}"), element.dofs.index(f"w{node}")
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
    fields = fields_of(element)
    first = turn.applyfunc(fields.rate)
    second = first.applyfunc(fields.rate)
    return tuple(m.xreplace(values) for m in (turn, first, second))


def test_the_equation_in_fixed_axes_is_the_local_one_with_turning_axes_put_in(element):
    fields = fields_of(element)
    values = fields.values(3)
    values |= first_point(fields, values)
    local = numbers(local_equation(matrices(element)), values)
    turn, turn_t, turn_tt = axes(element, values)
    S, S_t, S_tt = (sp.Matrix([values[a] for a in row]) for row in (fields.s, fields.s_t, fields.s_tt))
    own = (turn.T * S, turn.T * S_t + turn_t.T * S, turn.T * S_tt + 2 * turn_t.T * S_t + turn_tt.T * S)
    found = numbers(global_equation(element, local_equation(matrices(element))), values)
    assert residual(found, S, S_t, S_tt) == turn * residual(local, *own)


def uniform(element):
    """Displacements of a shift along each axis, in fixed axes."""
    return sp.Matrix([[int(d[0] == "u"), int(d[0] == "w")] for d in element.dofs])


@pytest.mark.parametrize("name", [n for n, e in ELEMENTS.items() if "mid" not in e.inner_dofs])
def test_a_uniform_shift_needs_no_force_in_the_exact_form_only(name):
    """Nor does a shift at constant speed. The thesis' form has Coriolis and centrifugal forces there."""
    element = ELEMENTS[name]
    slack = replace(matrices(element), stiffness=sp.zeros(len(element.dofs)))
    values = {omega: sp.Rational(7, 3), omega_rate: sp.Rational(-5, 2), c: sp.Rational(3, 5)}
    values |= {s: sp.Rational(4, 5), ax: sp.Integer(3), ay: sp.Integer(-2), N0: sp.Integer(4)}
    local, shift = local_equation(slack), uniform(element)
    exact = numbers(global_equation(element, local), values)
    assert (exact.damping * shift).is_zero_matrix and (exact.stiffness * shift).is_zero_matrix
    thesis = numbers(thesis_equation(element, local), values)
    assert not (thesis.damping * shift).is_zero_matrix
    assert not (thesis.stiffness * shift).is_zero_matrix


def arguments(bending=1.0):
    """Length and section of a tapered element; with or without stiffness."""
    return np.array(
        [1.3, 2, 0.3, -0.2, *[0] * 5, *bending * np.array([9, 1, 2, 3, 0.5, 0.2, 0.1, 0.4]), 0, 0, 0]
    )


MOVING = {"omega": 3.1, "omega_rate": -7.0, "ax": 4.0, "ay": -2.5, "N0": 6.0}


@cache
def shown():
    return Exact(derived("element_beam8"))


def in_fixed_axes(name, q, angle, motion=MOVING):
    p = np.array([np.cos(angle), np.sin(angle), *motion.values()])
    found = np.array([float(x) for x in shown().matrix(name, {"q": q, "u": np.zeros(1), "p": p})])
    return found.reshape(8, -1) if found.size > 8 else found


def test_the_exact_form_has_no_inertia_force_in_a_uniform_shift():
    q, shift = arguments(0.0), np.array(uniform(ELEMENTS["beam8"]), dtype=float)
    size = np.abs(in_fixed_axes("global_mass", q, 0.7)).max() * MOVING["omega"] ** 2
    for name in ("global_damping", "global_stiffness"):
        assert np.abs(in_fixed_axes(name, q, 0.7) @ shift).max() < 1e-15 * size


def test_the_exact_form_by_the_generator_of_the_turn():
    """The same by matrices: with J = T^T dT/dtheta, as the method writes it."""
    q, angle, (w, w_t, a, b, force) = arguments(), 0.7, MOVING.values()
    M, A, K = (getattr(element_beam8, n)(q=q).reshape(8, 8) for n in ("mass", "gyroscopic", "stiffness"))
    G0, G1, G2 = element_beam8.geometric(q=q).reshape(3, 8, 8)
    loads = element_beam8.load(q=q).reshape(4, 8)
    T, J = np.eye(8), np.zeros((8, 8))
    for i in (0, 4):
        T[i : i + 2, i : i + 2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        J[i : i + 2, i : i + 2] = [[0, -1], [1, 0]]
    local = K - w**2 * M - w_t * A + force * G0 + a * G1 - w**2 * G2
    local += M @ (w_t * J.T + w**2 * J.T @ J.T) - 2 * w**2 * A @ J.T
    expected = {
        "global_mass": T @ M @ T.T,
        "global_damping": T @ (2 * w * M @ J.T - 2 * w * A) @ T.T,
        "global_stiffness": T @ local @ T.T,
        "global_load": T @ (np.array([-a, -b, w**2, -w_t]) @ loads),
    }
    for name, exact in expected.items():
        assert in_fixed_axes(name, q, angle) == pytest.approx(
            exact, rel=1e-13, abs=1e-14 * np.abs(exact).max()
        ), name


def test_turning_the_frame_turns_the_equation():
    q, by = arguments(), 1.1
    turn = np.eye(8)
    for i in (0, 4):
        turn[i : i + 2, i : i + 2] = [[np.cos(by), -np.sin(by)], [np.sin(by), np.cos(by)]]
    for name in ("global_mass", "global_damping", "global_stiffness"):
        before, after = (in_fixed_axes(name, q, angle) for angle in (0.4, 0.4 + by))
        assert after == pytest.approx(turn @ before @ turn.T, rel=1e-12, abs=1e-13 * np.abs(before).max())
    before, after = (in_fixed_axes("global_load", q, angle) for angle in (0.4, 0.4 + by))
    assert after == pytest.approx(turn @ before, rel=1e-12, abs=1e-13 * np.abs(before).max())


def test_the_terms_agree_as_one_energy_wants():
    """Momenta and forces come of one energy: centrifugal terms are the mass without rotary inertia."""
    found = hamilton.derive()
    mass = {(t.test, t.trial): t.density for t in found.of("inertia", 2, sp.Integer(1))}
    out = {(t.test, t.trial): -t.density for t in found.of("inertia", 0, omega**2)}
    assert mass == out | {("phi", "phi"): hamilton.ROTARY.symbol}
    coriolis, euler = (
        {(t.test, t.trial): t.density / k for t in found.of("inertia", order, m)}
        for order, m, k in ((1, omega, 2), (0, omega_rate, 1))
    )
    assert coriolis == euler
    # The components v_x and v_y of the velocity leave no trace: only the acceleration does.
    path = {q.symbol for q in hamilton.PATH}
    assert not any(t.density.free_symbols & path for t in found.terms)


def test_every_step_says_where_it_stands():
    steps = hamilton.derive().steps
    assert [step.name for step in steps][:3] == ["place", "velocity", "origin_acceleration"]
    assert all(step.source and step.about for step in steps)
    shown = elastic_derivation_system()
    assert [m.name for m in shown.matrices] == [step.name for step in steps]


def test_the_velocity_of_a_point_is_the_rate_of_its_position():
    """(6.2)-(6.10) against the derivative of a motion by time, at 30 digits."""
    t = sp.Symbol("t")
    moved = {"u": t**2 / 5, "w": t / 3 - t**3, "X_1": 2 * t - t**2, "Y_1": t**3 + 1}
    angle, at, x = 1 + t / 2 + t**2, {t: sp.Rational(2, 7)}, sp.Rational(3, 5)
    turn = sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])
    place = turn * sp.Matrix([x + moved["u"], moved["w"]]) + sp.Matrix([moved["X_1"], moved["Y_1"]])
    rates = {f"{name}_t": e.diff(t) for name, e in moved.items()}
    known = moved | rates | {"c": sp.cos(angle), "s": sp.sin(angle), "omega": angle.diff(t), "x": x}
    origin = turn.T * sp.Matrix([rates["X_1_t"], rates["Y_1_t"]])
    known |= {"v_x": origin[0], "v_y": origin[1]}
    shown = elastic_derivation_system(ELEMENTS["beam8"])
    for name, expected in {
        "position": place,
        "velocity_in_fixed_axes": place.diff(t),
        "rotated_velocity": turn.T * place.diff(t),
        "origin_velocity": origin,
        "velocity": turn.T * place.diff(t),
    }.items():
        matrix = sp.Matrix(shown[name].matrix)
        given = matrix.subs({symbol: known[symbol.name] for symbol in matrix.free_symbols})
        assert max(abs(e) for e in (given - expected).subs(at).evalf(30)) < 1e-28, name


@pytest.mark.parametrize("name", ELEMENTS)
def test_the_transformation_turns_both_ends(name):
    """(E.4): components of a displacement u, w of an end, in the link's axes, to those in fixed axes."""
    element = ELEMENTS[name]
    matrix = elastic_derivation_system(element)["transformation"].matrix
    local = {dof: sp.Symbol(f"{dof}_local") for dof in element.dofs}
    turned = dict(zip(element.dofs, matrix * sp.Matrix([*local.values()]), strict=True))
    for dof in element.dofs:
        u, w = (local.get(f"{letter}{dof[-1]}") for letter in "uw")
        expected = {"u": lambda u=u, w=w: c * u - s * w, "w": lambda u=u, w=w: s * u + c * w}
        at_end = dof[:-1] in expected and dof[-1] in "12"
        assert turned[dof] == (expected[dof[:-1]]() if at_end else local[dof]), dof


def test_integrals_of_shape_functions():
    """(B.14), corrected, and for a constant section the mass matrix m (M + B), the gyroscopic m (A - A^T)."""
    steps, block = elastic_derivation_system(ELEMENTS["beam8"]), derived("element_beam8")
    a, b, m = (steps[name].matrix for name in "ABM")
    length = a.free_symbols.pop()
    row = [0, sp.Rational(5, 14), sp.Rational(13, 210), sp.Rational(1, 210)]
    row += [0, sp.Rational(1, 7), sp.Rational(-4, 105), sp.Rational(1, 280)]
    powers = [1, 1, 2, 3, 1, 1, 2, 3]
    assert list(a.row(0)) == [k * length**n for k, n in zip(row, powers, strict=True)]
    for name, product in (("constant_mass", m + b), ("constant_gyroscopic", a - a.T)):
        matrix = sp.Matrix(block.expanded(name))
        (mass,) = matrix.free_symbols - {length}
        assert sp.expand(matrix - mass * product) == sp.zeros(8), name
