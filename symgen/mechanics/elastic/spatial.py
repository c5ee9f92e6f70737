"""A beam element in space whose axes rotate at a constant rate, by Hamilton's principle.

The beam lies along its x axis; y and z are principal axes of its section. Fields are the displacements u, v
and w of the centroid and the twist phi; the section rotates by the vector (phi, -w', v') and stays plane
(Euler-Bernoulli, Saint-Venant's torsion without warping). The axes rotate with the constant Omega about an
axis in space, and the first node lies at c from a point of that axis. Energies are of the second degree in
the fields: the velocity of every fibre includes its rotation to that degree.

With the generalised fields y = (u, v, w, phi, v', w') the kinetic energy per length is
y_t^T m y_t/2 + y_t^T g y + y^T c y/2 + b^T y + ..., and Lagrange's equation is

    m y_tt + (g - g^T) y_t + (k + n - c) y = b.

The axial force N of the undeformed beam acts on the slopes, and on the twist rate of fibres (the trapeze
effect). Terms of N that only add to E A and E I, smaller by N/EA, are dropped.

Sources: J. C. Houbolt, G. W. Brooks, NACA Report 1346 (1958); D. H. Hodges, E. H. Dowell, NASA TN D-7818
(1974). The element is derived here.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import sympy as sp

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH, PLACE, derivative, shape_functions
from symgen.symbolic.quantity import AXES, quantity

MU = quantity("mu", "kg/m", "mass per length")
JY = quantity("J_y", "kg*m", "rotary inertia per length about y: density times the integral of z^2")
JZ = quantity("J_z", "kg*m", "rotary inertia per length about z: density times the integral of y^2")
AXIAL = quantity("EA", "N", "axial stiffness")
BENDING_Y = quantity("EI_y", "N*m^2", "bending stiffness about y, for displacements w")
BENDING_Z = quantity("EI_z", "N*m^2", "bending stiffness about z, for displacements v")
TORSION = quantity("GJ", "N*m^2", "torsional stiffness")
SECTION = (LENGTH, MU, JY, JZ, AXIAL, BENDING_Y, BENDING_Z, TORSION)
OMEGA = tuple(quantity(f"Omega_{a}", "rad/s", f"{a} component of the rate of rotation") for a in AXES)
PLACED = tuple(quantity(f"c_{a}", "m", f"{a} component of the first node from the axis") for a in AXES)
N0 = quantity("N0", "N", "axial force at the first node, tension positive")
MOTION = (*OMEGA, *PLACED, N0)
MASS = quantity("m", "kg", "mass of a rigid body")
MOMENTS = tuple(quantity(f"I_{a}", "kg*m^2", f"moment of inertia of a rigid body about {a}") for a in AXES)
BODY = (MASS, *MOMENTS)

#: Unknowns of a node: fields and their derivatives by x.
NODE_DOFS = ("u", "u_x", "v", "v_x", "v_xx", "w", "w_x", "w_xx", "phi", "phi_x")
DOFS = tuple(f"{name}{node}" for node in "12" for name in NODE_DOFS)
#: The planar element whose transverse displacement has the unknowns and the shape of each field.
_LIKE = {"u": "cubic", "v": "beam8", "w": "beam8", "phi": "cubic"}

_FIELDS = sp.symbols("u v w phi v_x w_x", real=True)
_RATES = sp.symbols("u_t v_t w_t phi_t v_xt w_xt", real=True)
_X = sp.Symbol("x", real=True)


class _Shape(NamedTuple):
    """A shape function: L to a power times a polynomial in xi, its coefficients by rising power."""

    power: int
    coefficients: tuple[sp.Expr, ...]


_Rows = Mapping[str, list[_Shape | None]]


@dataclass(frozen=True, slots=True)
class SpatialBeam:
    """Matrices (20, 20) and load (20, 1) of an element over ``SECTION`` and ``MOTION``.

    mass s'' + gyroscopic s' + (stiffness + geometric - centrifugal) s = load, with s ordered as ``DOFS``.
    """

    mass: sp.ImmutableMatrix
    gyroscopic: sp.ImmutableMatrix
    centrifugal: sp.ImmutableMatrix
    stiffness: sp.ImmutableMatrix
    geometric: sp.ImmutableMatrix
    load: sp.ImmutableMatrix


def kinetic_energy() -> sp.Expr:
    """Return the kinetic energy per length at x, to the second degree in the fields and their rates."""
    u, v, w, phi, v_x, w_x = _FIELDS
    displaced = sp.Matrix([_X + u, v, w])
    # Centroid and principal axes: the integrals of y, z and y z over the section are zero.
    density = {(0, 0, 0): MU.symbol, (0, 2, 0): JZ.symbol, (0, 0, 2): JY.symbol}
    return _kinetic(displaced, sp.Matrix([phi, -w_x, v_x]), density, _FIELDS, _RATES)


def _kinetic(
    displaced: sp.Matrix,
    rotation: sp.Matrix,
    density: Mapping[tuple[int, int, int], sp.Expr],
    fields: Sequence[sp.Expr],
    rates: Sequence[sp.Expr],
) -> sp.Expr:
    """Return the kinetic energy of fibres about a place that is displaced from c, and rotate by a vector.

    ``density`` has the mass and its second moments by the powers of the coordinates of fibres.
    """
    fibres = sp.symbols("fibre_x:z", real=True)
    small = sp.Symbol("small", real=True)
    omega = sp.Matrix([q.symbol for q in OMEGA])
    fibre, centroid = sp.Matrix(fibres), sp.Matrix([q.symbol for q in PLACED]) + displaced
    once = rotation.cross(fibre)
    place = centroid + fibre + once + rotation.cross(once) / 2
    velocity = place.jacobian(sp.Matrix(fields)) * sp.Matrix(rates) + omega.cross(place)
    scaled = {f: small * f for f in (*fields, *rates)}
    energies = []
    for component in velocity:
        terms = sp.Poly(sp.expand(component.xreplace(scaled)), small, *fibres).terms()
        # Products of higher degree, and of other powers of fibres, are not formed.
        for (degree_a, *powers_a), a in terms:
            for (degree_b, *powers_b), b in terms:
                weight = density.get(tuple(map(operator.add, powers_a, powers_b)))
                if weight is not None and degree_a + degree_b <= 2:
                    energies.append(weight * a * b / 2)
    return sp.expand(sp.Add(*energies))


def axial_force() -> sp.Expr:
    """Return N at x from N' = mu times the axial acceleration of the undeformed beam."""
    omega = sp.Matrix([q.symbol for q in OMEGA])
    place = sp.Matrix([q.symbol for q in PLACED]) + sp.Matrix([_X, 0, 0])
    acceleration = omega.cross(omega.cross(place))[0]
    return N0.symbol + MU.symbol * sp.integrate(sp.expand(acceleration), (_X, 0, _X))


def spatial_beam() -> SpatialBeam:
    """Substitute the shape functions into the energies of the beam."""
    energy, force = kinetic_energy(), axial_force()
    rows = _rows()
    mixed = sp.Matrix([[sp.diff(energy, a, b) for b in _FIELDS] for a in _RATES])
    stiff: Mapping[str, sp.Expr] = {
        "u_x": AXIAL.symbol,
        "v_xx": BENDING_Z.symbol,
        "w_xx": BENDING_Y.symbol,
        "phi_x": TORSION.symbol,
    }
    tensed = {"v_x": force, "w_x": force, "phi_x": force * (JY.symbol + JZ.symbol) / MU.symbol}
    still = dict.fromkeys((*_FIELDS, *_RATES), 0)
    return SpatialBeam(
        mass=_quadratic(rows, sp.hessian(energy, _RATES)),
        gyroscopic=_quadratic(rows, mixed - mixed.T),
        centrifugal=_quadratic(rows, sp.hessian(energy, _FIELDS)),
        stiffness=_diagonal(rows, stiff),
        geometric=_diagonal(rows, tensed),
        load=_loaded(rows, {f.name: sp.diff(energy, f).xreplace(still) for f in _FIELDS}),
    )


def body() -> tuple[sp.ImmutableMatrix, ...]:
    """Return mass, gyroscopic and centrifugal matrix and load of a rigid body at c, in the rotating axes.

    Over its displacement and its rotation, (6, 6) and (6, 1); its principal axes are those of the axes.
    """
    fields, rates = sp.symbols("body_0:6", real=True), sp.symbols("body_t_0:6", real=True)
    moments = [q.symbol for q in MOMENTS]
    # The integral of the square of each coordinate.
    squares = [sp.Add(*moments) / 2 - moment for moment in moments]
    powers = ((2, 0, 0), (0, 2, 0), (0, 0, 2))
    density = {(0, 0, 0): MASS.symbol, **dict(zip(powers, squares, strict=True))}
    energy = _kinetic(sp.Matrix(fields[:3]), sp.Matrix(fields[3:]), density, fields, rates)
    mixed = sp.Matrix([[sp.diff(energy, a, b) for b in fields] for a in rates])
    load = sp.Matrix([sp.diff(energy, x) for x in fields]).xreplace(dict.fromkeys((*fields, *rates), 0))
    square = sp.hessian(energy, rates), mixed - mixed.T, sp.hessian(energy, fields)
    return tuple(sp.ImmutableMatrix(m) for m in (*square, load))


def _rows() -> dict[str, list[_Shape | None]]:
    """Return the fields and their derivatives as rows over ``DOFS``, by name; None where one is zero."""
    rows: dict[str, list[_Shape | None]] = {}
    for field, like in _LIKE.items():
        element = ELEMENTS[like]
        first_node = [k for k, name in enumerate(NODE_DOFS) if name.partition("_")[0] == field]
        places = (*first_node, *(k + len(NODE_DOFS) for k in first_node))
        across = [k for k, name in enumerate(element.dofs) if not name.startswith("u")]
        shapes = [shape_functions(element).transverse[k] for k in across]
        for order in range(3):
            row: list[_Shape | None] = [None] * len(DOFS)
            for k, shape in zip(places, shapes, strict=True):
                row[k] = _shape(derivative(shape, order))
            rows[field + ("_" + "x" * order if order else "")] = row
    return rows


def _shape(expression: sp.Expr) -> _Shape:
    """Return a shape function, which is a power of L times a polynomial in xi."""
    power = next(p for p in range(-2, 3) if not sp.expand(expression / LENGTH.symbol**p).has(LENGTH.symbol))
    scaled = sp.Poly(sp.expand(expression / LENGTH.symbol**power), PLACE.symbol)
    return _Shape(power, tuple(reversed(scaled.all_coeffs())))


def _quadratic(rows: _Rows, form: sp.Matrix) -> sp.ImmutableMatrix:
    """Return the integral of y^T form y over the element, for y in the order of the fields."""
    pairs = [
        (a.name, form[i, j], b.name)
        for i, a in enumerate(_FIELDS)
        for j, b in enumerate(_FIELDS)
        if form[i, j] != 0
    ]
    return _assembled(rows, pairs)


def _diagonal(rows: _Rows, of: Mapping[str, sp.Expr]) -> sp.ImmutableMatrix:
    """Return the integral of the sum of factors times squares of strains."""
    return _assembled(rows, [(name, factor, name) for name, factor in of.items()])


def _assembled(rows: _Rows, pairs: Sequence[tuple[str, sp.Expr, str]]) -> sp.ImmutableMatrix:
    """Return the sum of the integrals of test^T factor trial, (20, 20)."""
    n = len(DOFS)
    matrix = sp.zeros(n, n)
    for test, factor, trial in pairs:
        of_x = _by_power(factor)
        for i, a in enumerate(rows[test]):
            for j, b in enumerate(rows[trial]):
                if a is not None and b is not None:
                    matrix[i, j] += _integral(of_x, a, b)
    return sp.ImmutableMatrix(matrix)


def _loaded(rows: _Rows, forces: Mapping[str, sp.Expr]) -> sp.ImmutableMatrix:
    """Return the sum of the integrals of test^T force, (20, 1)."""
    load = sp.zeros(len(DOFS), 1)
    for test, force in forces.items():
        for i, a in enumerate(rows[test]):
            if a is not None and force != 0:
                load[i] += _integral(_by_power(force), a, _Shape(0, (sp.Integer(1),)))
    return sp.ImmutableMatrix(load)


def _by_power(factor: sp.Expr) -> list[tuple[int, sp.Expr]]:
    return [(power, sp.factor_terms(c)) for (power,), c in sp.Poly(factor, _X).terms()]


def _integral(factor: Sequence[tuple[int, sp.Expr]], a: _Shape, b: _Shape) -> sp.Expr:
    """Return the integral of factor a b over the element, the factor by powers of x = L xi."""
    terms = []
    for power, coefficient in factor:
        number = sp.Add(
            *(
                p * q / (i + j + power + 1)
                for i, p in enumerate(a.coefficients)
                for j, q in enumerate(b.coefficients)
            )
        )
        terms.append(number * LENGTH.symbol ** (a.power + b.power + power + 1) * coefficient)
    return sp.Add(*terms)
