"""Quantities, systems and the chain rule through shared subexpressions."""

from __future__ import annotations

import pytest
import sympy as sp
from shared.shipped import derived

import symgen
from symgen.errors import DerivationError, ModelError
from symgen.models import BLOCKS
from symgen.symbolic.calculus import Calculus
from symgen.symbolic.constants import Replacement
from symgen.symbolic.quantity import Quantity, quantity, symbols_of
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System


def plain(expression, definitions):
    values = {}
    for d in definitions:
        values[d.quantity.symbol] = d.expression.xreplace(values)
    return expression.xreplace(values)


def test_chain_rule_equals_plain_differentiation():
    q = [quantity(f"q{i}", "m", "position") for i in range(2)]
    u = [quantity(f"u{i}", "m/s", "velocity") for i in range(2)]
    t = sp.Symbol("t", real=True)
    calculus = Calculus(q, u, t)
    (a, b), (va, vb) = ([x.symbol for x in group] for group in (q, u))
    d = calculus.define("d", a - 2 * b + sp.sin(t), "m", "difference")
    length = calculus.define("length", sp.sqrt(d**2 + a**2), "m", "length")
    f = length * d + a * b**2 + sp.cos(t) * d
    flat = plain(f, calculus.definitions)
    gradient = calculus.gradient(f)
    for s in (a, b):
        assert sp.simplify(plain(gradient[s], calculus.definitions) - sp.diff(flat, s)) == 0
    total = sp.diff(flat, a) * va + sp.diff(flat, b) * vb + sp.diff(flat, t)
    rate = calculus.rate(f)
    assert sp.simplify(plain(rate, calculus.definitions) - total) == 0
    second = sp.diff(total, a) * va + sp.diff(total, b) * vb + sp.diff(total, t)
    found = plain(calculus.rate(rate), calculus.definitions)
    point = {a: 0.3, b: -0.7, va: 1.1, vb: 0.4, t: 0.2}
    assert float(found.subs(point)) == pytest.approx(float(second.subs(point)), rel=1e-12)


def test_numbers_and_symbols_need_no_name():
    q = [quantity("q0", "m", "position")]
    calculus = Calculus(q, [quantity("u0", "m/s", "velocity")], sp.Symbol("t"))
    assert calculus.define("same", q[0].symbol, "m", "x") == q[0].symbol
    assert calculus.define("five", sp.Integer(5), "m", "x") == 5
    assert calculus.definitions == ()


@pytest.mark.parametrize("unit, description", [("", "position"), ("m", ""), ("  ", "position")])
def test_a_quantity_without_unit_or_description_is_refused(unit, description):
    with pytest.raises(DerivationError, match="has no (unit|description)"):
        Quantity(sp.Symbol("x"), unit, description)


@pytest.mark.parametrize("name", [*symgen.shipped_scenes(), *BLOCKS])
def test_every_symbol_and_matrix_has_unit_and_description(name):
    system = derived(name)
    quantities = list(system.quantities())
    assert len(quantities) >= 5
    for x in [*quantities, *system.matrices]:
        assert x.unit.strip()
        assert len(x.description.strip()) > 3


def system_with(matrix, *, extra=()):
    x = quantity("x", "m", "position")
    return System(
        name="test",
        title="test",
        groups=(Group("q", "coordinates", (x, *extra)),),
        matrices=(NamedMatrix("f", sp.ImmutableMatrix([[matrix]]), "m", "function"),),
        exports=(Export("f", "function", ("f",)),),
    )


def test_undeclared_and_doubled_symbols_are_refused():
    with pytest.raises(DerivationError, match="undeclared symbols: y"):
        system_with(sp.Symbol("y"))
    with pytest.raises(DerivationError, match="two quantities are called 'x'"):
        system_with(sp.Integer(1), extra=(quantity("x", "m", "again"),))


def test_a_missing_matrix_names_the_nearest():
    with pytest.raises(ModelError, match="constraint_jacobian"):
        derived("four_bar")["constraint_jacobien"]


def test_expanded_puts_every_shared_subexpression_back():
    system = derived("four_bar")
    shared = {d.quantity.symbol for d in system.definitions}
    assert system["constraint_jacobian"].matrix.free_symbols & shared
    for m in system.matrices:
        assert not system.expanded(m.name).free_symbols & shared


def test_jacobian_and_right_side_are_derivatives_of_the_constraints():
    """Plain SymPy differentiation of the expanded constraints, without the chain rule of symgen."""
    system = derived("peaucellier")
    q = [x.symbol for x in system.group("q").quantities]
    u = [x.symbol for x in system.group("u").quantities]
    phi = sp.Matrix(system.expanded("constraints"))
    jacobian = phi.jacobian(q)
    assert sp.simplify(jacobian - sp.Matrix(system.expanded("constraint_jacobian"))) == sp.zeros(7, 8)
    gamma = -(jacobian * sp.Matrix(u)).jacobian(q) * sp.Matrix(u)
    assert sp.expand(gamma - sp.Matrix(system.expanded("acceleration_rhs"))) == sp.zeros(7, 1)


def test_force_is_minus_the_gradient_of_the_potential():
    system = derived("peaucellier")
    q = [x.symbol for x in system.group("q").quantities]
    potential = system.expanded("potential_energy")[0]
    gradient = sp.Matrix([sp.diff(potential, s) for s in q])
    assert sp.simplify(gradient + sp.Matrix(system.expanded("force"))) == sp.zeros(8, 1)


def test_mass_matrix_is_the_hessian_of_the_kinetic_energy():
    system = derived("triple_pendulum")
    u = [x.symbol for x in system.group("u").quantities]
    energy = system.expanded("kinetic_energy")[0]
    assert sp.simplify(sp.hessian(energy, u) - sp.Matrix(system.expanded("mass_matrix"))) == sp.zeros(6)


def test_definition_is_frozen():
    d = Definition(quantity("x", "m", "position"), sp.Integer(1))
    with pytest.raises(AttributeError):
        d.expression = sp.Integer(2)


def test_symbols_and_replacements_of_shared_parts_are_those_of_sympy():
    x, y, z = sp.symbols("x y z", real=True)
    shared = sp.sin(x + y) * z
    expressions = [shared**2 + x, sp.Integral(shared, (x, 0, y)), sp.ImmutableMatrix([[0, shared]]), sp.S.One]
    assert symbols_of(expressions) == {x, y, z}
    assert symbols_of([sp.Integral(x * y, (x, 0, 1))]) == {y}
    values = {x: y - 1, y: sp.Integer(1), z: x}
    replaced = Replacement(values)
    assert [replaced(e) for e in (shared, shared**2 + x, z)] == [
        e.xreplace(values) for e in (shared, shared**2 + x, z)
    ]
