"""Matrices of a finite element: the collected terms of Hamilton's principle with its shape functions.

Source: the kineto-elasto-dynamics thesis, Eqs. (7.24)-(7.28); for any element and section.
The integrands are polynomials, integrated exactly.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache

import sympy as sp
from sympy.polys.rings import PolyElement, ring

from symgen.elements.element import LENGTH, PLACE, Element, derivative, shape_functions
from symgen.mechanics.elastic import hamilton
from symgen.mechanics.elastic.hamilton import Term, derive
from symgen.mechanics.elastic.places import SHAPES
from symgen.mechanics.elastic.weights import CONSTANTS

ZERO = sp.Integer(0)
_RING, _XI, _L = ring("xi,L", sp.QQ)
_SYMBOLS = (PLACE.symbol, LENGTH.symbol)


@dataclass(frozen=True, slots=True)
class ElementSection:
    """Section properties of an element by powers of xi: coefficient times length to that power.

    ``axial``, ``bending`` and ``shear`` are stiffnesses; units as in
    :mod:`symgen.mechanics.elastic.hamilton`.
    """

    mass: tuple[sp.Expr, ...]
    rotary: tuple[sp.Expr, ...]
    axial: tuple[sp.Expr, ...]
    bending: tuple[sp.Expr, ...]
    shear: tuple[sp.Expr, ...]


@dataclass(frozen=True, slots=True)
class Before:
    """What lies before an element on its link, by the distance [m] of its first node from the first point.

    ``mass`` [kg], and its first ``moment`` [kg m] about the first point of the link.
    """

    distance: sp.Expr = ZERO
    mass: sp.Expr = ZERO
    moment: sp.Expr = ZERO


@dataclass(frozen=True, slots=True)
class BeamMatrices:
    """Constant matrices and load vectors of an element in link axes, x from the first point of the link.

    The constants of :data:`symgen.mechanics.elastic.weights.CONSTANTS`; the three of ``geometric`` are the
    factors of N0, ax and omega^2. ``centrifugal`` is the mass matrix without rotary inertia: the rotation of
    the link exerts no couple on a section at a small angle.
    """

    mass: sp.ImmutableMatrix
    gyroscopic: sp.ImmutableMatrix
    stiffness: sp.ImmutableMatrix
    geometric: tuple[sp.ImmutableMatrix, sp.ImmutableMatrix, sp.ImmutableMatrix]
    centrifugal: sp.ImmutableMatrix
    load_x: sp.ImmutableMatrix
    load_y: sp.ImmutableMatrix
    load_out: sp.ImmutableMatrix
    load_turn: sp.ImmutableMatrix

    @property
    def constants(self) -> dict[str, sp.ImmutableMatrix]:
        """Constants by name."""
        linear = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "geometric"}
        return linear | {f"geometric{k}": matrix for k, matrix in enumerate(self.geometric)}


def beam_matrices(element: Element, section: ElementSection, before: Before | None = None) -> BeamMatrices:
    """Substitute the shape functions of an element into the collected terms; see :class:`BeamMatrices`.

    The element is the first of its link unless it is known what lies ``before`` it.
    """
    derived, put = derive(), _Integrals(element, section, before or Before())
    matrices = {}
    for name, constant in CONSTANTS.items():
        if not constant.applied:
            integrate = put.load if constant.order is None else put.matrix
            matrices[name] = integrate(constant.terms(derived), constant.factor)
    geometric = tuple(matrices.pop(f"geometric{k}") for k in range(3))
    return BeamMatrices(geometric=geometric, **matrices)


def profile_constants(
    element: Element, distance: sp.Expr, even: sp.Expr, slope: sp.Expr, follows: bool
) -> dict[str, sp.ImmutableMatrix]:
    """Return the constants of a force per length even + slope x, x [m] from the first point of the link.

    ``distance`` [m] is that of the first node of the element. A force that ``follows`` turns with sections.
    """
    none = ElementSection((), (), (), (), ())
    put, derived = _Integrals(element, none, Before(distance)), derive()
    put.densities[hamilton.PROFILE.symbol] = [(even + slope * distance, _RING.one), (slope, _L * _XI)]
    put.densities[hamilton.PROFILE_BEFORE.symbol] = [
        (even * distance + slope * distance**2 / 2, _RING.one),
        (even + slope * distance, _L * _XI),
        (slope / 2, (_L * _XI) ** 2),
    ]
    return {
        name: put.sum(constant.densities(derived))
        for name, constant in CONSTANTS.items()
        if constant.applied and (follows or constant.part != "follower")
    }


def shape_rows(element: Element) -> dict[str, tuple[sp.Expr, ...]]:
    """Return displacements and strains at xi as rows over the element's unknowns, by name.

    u, w, slope w', rotation phi, axial strain u', curvature phi' (w'' without shear). Factored
    polynomials: near a node, where most of them vanish with their derivatives, powers of xi would cancel.
    """
    rows = _rows(element)
    return {name: tuple(_factored(p) for p in rows[field]) for name, field in SHAPES.items()}


def _factored(polynomial: PolyElement) -> sp.Expr:
    return _sum({power: sp.factor(e) for power, e in _by_power(polynomial, _SCALE).items()})


#: The rows of shape functions are kept times the length to this power, which leaves polynomials.
_SCALE = 2


@lru_cache(maxsize=8)
def _rows(element: Element) -> dict[str, tuple[PolyElement, ...]]:
    """Return the fields of Hamilton's principle over the element's unknowns, times L**_SCALE."""
    shape = shape_functions(element)
    scale, known = LENGTH.symbol**_SCALE, dict(zip(_SYMBOLS, _RING.symbols, strict=True))
    u, w, phi = (
        tuple(_RING.from_expr(sp.expand(e * scale).xreplace(known)) for e in row)
        for row in (shape.axial, shape.transverse, shape.rotation)
    )
    u_x, w_x, phi_x = (tuple(p.diff(_XI).exquo(_L) if p else p for p in row) for row in (u, w, phi))
    gamma = tuple(a - b for a, b in zip(w_x, phi, strict=True))
    return {"u": u, "w": w, "phi": phi, "u_x": u_x, "w_x": w_x, "phi_x": phi_x, "gamma": gamma}


def _by_power(polynomial: PolyElement, below: int) -> dict[int, sp.Expr]:
    """Return a polynomial over L**below by powers of L."""
    powers: dict[int, list[sp.Expr]] = {}
    for (i, j), coefficient in polynomial.terms():
        powers.setdefault(j - below, []).append(sp.QQ.to_sympy(coefficient) * PLACE.symbol**i)
    return {power: sp.Add(*terms) for power, terms in sorted(powers.items())}


class _Integrals:
    """Integrates densities times shape functions over one element."""

    def __init__(self, element: Element, section: ElementSection, before: Before) -> None:
        self.rows, self.size = _rows(element), len(element.dofs)
        d = before.distance
        mu, x = hamilton.MU.symbol, hamilton.X.symbol
        rotary = section.rotary if element.rotary else ()
        #: Each density as pairs of a coefficient and its polynomial.
        self.densities: dict[sp.Expr, list[tuple[sp.Expr, PolyElement]]] = {
            sp.Integer(1): [(sp.Integer(1), _RING.one)],
            mu: [(c, _XI**k) for k, c in enumerate(section.mass)],
            mu * x: [
                pair
                for k, c in enumerate(section.mass)
                for pair in ((c, _L * _XI ** (k + 1)), (c * d, _XI**k))
            ],
            hamilton.MASS_BEFORE.symbol: [
                (before.mass, _RING.one),
                *((c, _L * _XI ** (k + 1) / (k + 1)) for k, c in enumerate(section.mass)),
            ],
            hamilton.MOMENT_BEFORE.symbol: [
                (before.moment, _RING.one),
                *(
                    pair
                    for k, c in enumerate(section.mass)
                    for pair in (
                        (c, _L**2 * _XI ** (k + 2) / (k + 2)),
                        (c * d, _L * _XI ** (k + 1) / (k + 1)),
                    )
                ),
            ],
            hamilton.ROTARY.symbol: [(c, _XI**k) for k, c in enumerate(rotary)],
            hamilton.AXIAL.symbol: [(c, _XI**k) for k, c in enumerate(section.axial)],
            hamilton.BENDING.symbol: [(c, _XI**k) for k, c in enumerate(section.bending)],
            hamilton.SHEAR.symbol: [(c, _XI**k) for k, c in enumerate(section.shear)],
        }

    def matrix(self, terms: Iterable[Term], factor: sp.Expr | int = 1) -> sp.ImmutableMatrix:
        """Return factor times the sum of the integrals of density * test^T * trial."""
        entries = _Entries(2 * _SCALE)
        for term in terms:
            for i, a in enumerate(self.rows[term.test]):
                for j, b in enumerate(self.rows[term.trial]):
                    self._add(entries, (i, j), term.density * factor, a * b)
        return sp.ImmutableMatrix(self.size, self.size, lambda i, j: entries[i, j])

    def load(self, terms: Iterable[Term], factor: sp.Expr | int = 1) -> sp.ImmutableMatrix:
        """Return factor times the sum of the integrals of density * test^T."""
        entries = _Entries(_SCALE)
        for term in terms:
            for i, a in enumerate(self.rows[term.test]):
                self._add(entries, (i, 0), term.density * factor, a)
        return sp.ImmutableMatrix(self.size, 1, lambda i, j: entries[i, j])

    def sum(self, densities: Mapping[tuple[str, str], sp.Expr]) -> sp.ImmutableMatrix:
        """Return the sum of the integrals of densities by test and trial field; a vector without trial."""
        loads = not any(trial for _, trial in densities)
        entries = _Entries(_SCALE if loads else 2 * _SCALE)
        for (test, trial), density in densities.items():
            for i, a in enumerate(self.rows[test]):
                for j, b in enumerate(self.rows[trial] if trial else (_RING.one,)):
                    self._add(entries, (i, j), density, a * b)
        return sp.ImmutableMatrix(self.size, 1 if loads else self.size, lambda i, j: entries[i, j])

    def _add(self, entries: _Entries, at: tuple[int, int], density: sp.Expr, shapes: PolyElement) -> None:
        if shapes:
            number, kind = density.as_coeff_Mul()
            for coefficient, weight in (pair for pair in self.densities[kind] if pair[0] != 0):
                entries.add(at, coefficient, sp.QQ.from_sympy(number) * _over_element(shapes * weight))


class _Entries:
    """Entries of a matrix: for each coefficient of the section a polynomial, over a power of L."""

    def __init__(self, below: int) -> None:
        self._below = below
        self._polynomials: dict[tuple[int, int], dict[sp.Expr, PolyElement]] = {}

    def add(self, at: tuple[int, int], coefficient: sp.Expr, polynomial: PolyElement) -> None:
        entry = self._polynomials.setdefault(at, {})
        entry[coefficient] = entry.get(coefficient, _RING.zero) + polynomial

    def __getitem__(self, at: tuple[int, int]) -> sp.Expr:
        """Return an entry as a sum over powers of L, each with its coefficients of the section."""
        by_power: dict[int, list[sp.Expr]] = {}
        for coefficient, polynomial in self._polynomials.get(at, {}).items():
            for power, rest in _by_power(polynomial, self._below).items():
                by_power.setdefault(power, []).append(coefficient * rest)
        return _sum({power: sp.Add(*terms) for power, terms in sorted(by_power.items())})


def _sum(by_power: dict[int, sp.Expr]) -> sp.Expr:
    return sp.Add(*(LENGTH.symbol**power * e for power, e in by_power.items()))


def _over_element(polynomial: PolyElement, start: sp.Rational = ZERO) -> PolyElement:
    """Integrate by x over the element: by xi from ``start`` to 1, times L."""
    integral, first = _RING.zero, sp.QQ.from_sympy(start)
    for (i, j), coefficient in polynomial.terms():
        integral += _RING.term_new((0, j + 1), coefficient * (1 - first ** (i + 1)) / (i + 1))
    return integral


def stiffened(element: Element, start: sp.Rational) -> sp.ImmutableMatrix:
    """Return the geometric stiffness of a unit axial force from xi = ``start`` to the second node."""
    slopes = _rows(element)["w_x"]
    return _integrated(slopes, slopes, start)


def shape_products(element: Element) -> dict[str, tuple[sp.ImmutableMatrix, str, str, str]]:
    """Return integrals of products of shape functions by the thesis's letters: product, rows, and equation.

    For a constant mass per length m without rotary inertia, m (M + B) is the mass matrix and m (A - A^T) the
    gyroscopic one.
    """
    rows = _rows(element)
    products = {
        "A": (
            "u",
            "w",
            "u^T w",
            "rows u and w",
            "(B.3), (B.9)-(B.13); (B.14), corrected: row u2, column theta1; (B.15): its transpose",
        ),
        "B": ("u", "u", "u^T u", "row u", "(B.2), (B.9)-(B.13)"),
        "M": ("w", "w", "w^T w", "row w", "(B.5), (B.17)"),
    }
    return {n: (_integrated(rows[a], rows[b]), *texts) for n, (a, b, *texts) in products.items()}


def _integrated(
    first: Sequence[PolyElement], second: Sequence[PolyElement], start: sp.Rational = ZERO
) -> sp.ImmutableMatrix:
    """Return the integrals over x of products of two rows, from xi = ``start`` to the second node."""
    entries = _Entries(2 * _SCALE)
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            entries.add((i, j), sp.Integer(1), _over_element(a * b, start))
    return sp.ImmutableMatrix(len(first), len(second), lambda i, j: entries[i, j])


@dataclass(frozen=True, slots=True)
class StrainEnergy:
    """Curvature of an element over its unknowns, and its strain energy, step by step.

    Attributes
    ----------
    coefficients
        Those of the curvature by powers of x, Eqs. (D.4)-(D.8).
    products
        Coefficients of the squared curvature by powers of x, in letters for those, Eqs. (D.9)-(D.15).
    polynomial
        The squared curvature in letters for these, Eqs. (D.23), (D.24).
    axial, bending
        Strain energies [J], bending in the same letters: Eqs. (6.20), (6.21), and (6.29), (D.25)-(D.27).
    """

    coefficients: tuple[sp.Expr, ...]
    products: tuple[sp.Expr, ...]
    polynomial: sp.Expr
    axial: sp.Expr
    bending: sp.Expr


def strain_energy(element: Element, unknowns: Sequence[sp.Symbol]) -> StrainEnergy:
    """Return the steps to the strain energy of an element of a constant section without shear.

    Letters are ``a0`` and so on of the curvature, ``D0`` and so on of its square.
    """
    x, shape = hamilton.X.symbol, shape_functions(element)

    def field(row: tuple[sp.Expr, ...], order: int) -> sp.Expr:
        derived = sp.Add(*(derivative(e, order) * q for e, q in zip(row, unknowns, strict=True)))
        return sp.expand(derived.xreplace({PLACE.symbol: x / LENGTH.symbol}))

    def lettered(letter: str, count: int) -> sp.Poly:
        return sp.Poly.from_list([sp.Symbol(f"{letter}{k}", real=True) for k in reversed(range(count))], x)

    coefficients = sp.Poly(field(shape.transverse, 2), x).all_coeffs()[::-1]
    products = (lettered("a", len(coefficients)) ** 2).all_coeffs()[::-1]
    squared = lettered("D", len(products))
    length = (x, 0, LENGTH.symbol)
    return StrainEnergy(
        tuple(coefficients),
        tuple(products),
        squared.as_expr(),
        sp.factor(hamilton.AXIAL.symbol / 2 * sp.integrate(field(shape.axial, 1) ** 2, length)),
        hamilton.BENDING.symbol / 2 * sp.integrate(squared.as_expr(), length),
    )
