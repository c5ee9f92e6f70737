"""Properties that every element of the registry has, exactly: with symbols for length and section."""

from __future__ import annotations

from functools import cache

import pytest
import sympy as sp

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH, NODE_DOFS, PLACE, Element, derivative, shape_functions
from symgen.errors import DerivationError
from symgen.mechanics.elastic.beam_matrices import ElementSection, beam_matrices, shape_rows

L, xi = LENGTH.symbol, PLACE.symbol
x = xi * L
MASS, ROTARY, AXIAL, BENDING, SHEAR = (
    sp.symbols(f"{letter}_0:{n}", positive=True) for letter, n in zip("mjabs", (3, 5, 3, 5, 3), strict=True)
)
SECTION = ElementSection(MASS, ROTARY, AXIAL, BENDING, SHEAR)


@pytest.fixture(params=ELEMENTS)
def element(request) -> Element:
    return ELEMENTS[request.param]


@cache
def matrices(element):
    return beam_matrices(element, SECTION)


def along(coefficients, factor=1):
    """The integral over the element of a property times a function of xi."""
    density = sum(c * xi**k for k, c in enumerate(coefficients))
    return sp.expand(sp.integrate(sp.expand(density * factor), (xi, 0, 1)) * L)


def interpolation(element, u, w, phi):
    """The unknowns of the element that a displacement (u, w, phi) over xi has."""
    fields = {"u": sp.sympify(u), "w": sp.sympify(w), "phi": sp.sympify(phi)}
    fields["gamma"] = derivative(fields["w"]) - fields["phi"]
    return sp.Matrix([derivative(fields[d.field], d.order).subs(xi, at) for d, at in element.places()])


def zero(expression) -> bool:
    return all(sp.expand(e) == 0 for e in sp.Matrix([expression]))


#: Displacements without strain: along, across, and turned about the first node.
RIGID = {"along": (1, 0, 0), "across": (0, 1, 0), "turned": (0, x, 1)}


def rigid(element, name):
    return interpolation(element, *RIGID[name])


def test_an_element_goes_by_its_name(element):
    assert ELEMENTS[element.name] is element and element.about
    assert {"u", "w", "theta"} <= set(element.node_dofs) <= set(NODE_DOFS)
    assert len(element.dofs) == 2 * len(element.node_dofs) + len(element.inner_dofs)
    assert len(set(element.dofs)) == len(element.dofs)


def test_a_shape_function_is_one_at_its_own_unknown_and_zero_at_the_others(element):
    found = shape_functions(element)
    columns = [
        interpolation(element, *e) for e in zip(found.axial, found.transverse, found.rotation, strict=True)
    ]
    assert zero(sp.Matrix.hstack(*columns) - sp.eye(len(element.dofs)))


def test_without_shear_the_section_turns_with_the_slope(element):
    found = shape_functions(element)
    gap = [derivative(w) - phi for w, phi in zip(found.transverse, found.rotation, strict=True)]
    assert zero(sp.Matrix(gap)) == (element.rotation is None)
    slack = [k for k, d in enumerate(element.dofs) if d.startswith("gamma")]
    assert zero(sp.Matrix([g for k, g in enumerate(gap) if k not in slack])), "only where it shears"


@pytest.mark.parametrize("name", RIGID)
def test_a_rigid_displacement_is_interpolated_and_has_no_strain(element, name):
    found, values = shape_functions(element), rigid(element, name)
    for row, exact in zip((found.axial, found.transverse, found.rotation), RIGID[name], strict=True):
        assert zero(sp.Matrix([row]) * values - sp.Matrix([exact]))
    rows = shape_rows(element)
    assert zero(sp.Matrix([rows["axial_strain"], rows["curvature"]]) * values)
    assert zero(matrices(element).stiffness * values)


def test_inertia_of_rigid_displacements(element):
    """Mass, first and second moment, and with them the loads of the rigid motion."""
    m = matrices(element)
    right, up, turned = (rigid(element, k) for k in RIGID)
    mass, moment, second = (along(MASS, x**k) for k in range(3))
    spin = along(ROTARY) if element.rotary else 0
    assert zero(right.T * m.mass * right - sp.Matrix([mass]))
    assert zero(up.T * m.mass * up - sp.Matrix([mass]))
    assert zero(up.T * m.mass * turned - sp.Matrix([moment]))
    assert zero(turned.T * m.mass * turned - sp.Matrix([second + spin]))
    assert zero(right.T * m.mass * up) and zero(right.T * m.mass * turned)
    assert zero(m.mass * right - m.load_x) and zero(m.mass * up - m.load_y)
    assert zero(m.mass * turned - m.load_turn)
    assert zero(m.gyroscopic * up - m.load_x) and zero(m.gyroscopic * right + m.load_y)
    assert zero(m.gyroscopic * turned - m.load_out)


def test_a_link_that_stands_turned_by_a_small_angle_feels_no_centrifugal_couple(element):
    """About its first node, which rests: the couple on the turned link, lever arms as they are then."""
    m = matrices(element)
    turned = rigid(element, "turned")
    # turned by 1, its points move by (-w, x) per angle: u = -x times that of the first turn
    moved = interpolation(element, -x, 0, 0)
    assert zero(turned.T * m.centrifugal * turned + moved.T * m.load_out)


def test_symmetry(element):
    m = matrices(element)
    for found in (m.mass, m.stiffness, m.centrifugal, *m.geometric):
        assert zero(found - found.T) and not found.is_zero_matrix
    assert zero(m.gyroscopic + m.gyroscopic.T)
    assert zero(m.mass.xreplace(dict.fromkeys(ROTARY, sp.Integer(0))) - m.centrifugal)
    assert zero(m.mass - m.centrifugal) == (not element.rotary)


#: Displacements of one constant strain, and the stiffness that it meets.
PATCHES = {
    "stretched": ((x, 0, 0), AXIAL, "axial_strain"),
    "bent": ((0, x**2 / 2, x), BENDING, "curvature"),
}


@pytest.mark.parametrize("name", PATCHES)
def test_a_constant_strain_is_exact_however_the_section_varies(element, name):
    fields, stiffness, row = PATCHES[name]
    values, rows = interpolation(element, *fields), shape_rows(element)
    shape = shape_functions(element)
    for field, exact in zip((shape.axial, shape.transverse, shape.rotation), fields, strict=True):
        assert zero(sp.Matrix([field]) * values - sp.Matrix([exact]))
    assert zero(sp.Matrix([rows["slope"]]) * values - sp.Matrix([rows["rotation"]]) * values)
    assert zero(sp.Matrix([rows[row]]) * values - sp.Matrix([1]))
    assert zero(values.T * matrices(element).stiffness * values - sp.Matrix([along(stiffness)]))


def test_geometric_stiffness_is_the_work_of_the_axial_force_on_the_shortening(element):
    """For a link turned rigidly, w' = 1: tension, and what the mass before each place pulls."""
    turned, m = rigid(element, "turned"), matrices(element)
    before = [sum(c * xi ** (k + 1) * L / (k + 1) for k, c in enumerate(MASS))]
    moment = [sum(c * xi ** (k + 2) * L**2 / (k + 2) for k, c in enumerate(MASS))]
    for found, exact in zip(
        m.geometric, (along([1]), along([1], before[0]), along([1], moment[0])), strict=True
    ):
        assert zero(turned.T * found * turned - sp.Matrix([exact]))


def test_conditions_that_do_not_fit_are_refused():
    bad = Element("bad", "one coefficient too many", ("u", "w", "theta"), axial=1, transverse=4)
    with pytest.raises(DerivationError, match="bad: 6 conditions for 7 coefficients"):
        shape_functions(bad)
    twice = Element("twice", "linear in u, twice w", ("u", "w", "w"), axial=1, transverse=3)
    with pytest.raises(DerivationError, match="twice: its conditions do not determine"):
        shape_functions(twice)


def test_a_constant_shear_strain_is_exact_however_the_section_varies():
    element = ELEMENTS["timoshenko"]
    values = interpolation(element, 0, x, 0)
    assert zero(sp.Matrix([shape_rows(element)["rotation"]]) * values)
    assert zero(values.T * matrices(element).stiffness * values - sp.Matrix([along(SHEAR)]))
