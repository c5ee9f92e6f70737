"""Matrices of a finite element: the collected terms of Hamilton's principle with its shape functions.

Source: the kineto-elasto-dynamics thesis, Eqs. (7.24)-(7.28); for any element and section.
The integrands are polynomials, integrated exactly.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import lru_cache

import sympy as sp
from sympy.polys.rings import PolyElement, ring

from symgen.elements.element import LENGTH, PLACE, Element, shape_functions
from symgen.mechanics.elastic import hamilton
from symgen.mechanics.elastic.hamilton import Term, derive
from symgen.mechanics.elastic.places import SHAPES
from symgen.mechanics.elastic.weights import CONSTANTS

_RING, _XI, _L = ring("xi,L", sp.QQ)
_SYMBOLS = (PLACE.symbol, LENGTH.symbol)


@dataclass(frozen=True, slots=True)
class Section:
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
class BeamMatrices:
    """Constant matrices and load vectors of an element in link axes, x from its first node.

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


def beam_matrices(element: Element, section: Section) -> BeamMatrices:
    """Substitute the shape functions of an element into the collected terms; see :class:`BeamMatrices`."""
    derived, put = derive(), _Integrals(element, section)
    matrices = {}
    for name, constant in CONSTANTS.items():
        if not constant.applied:
            integrate = put.load if constant.order is None else put.matrix
            matrices[name] = integrate(constant.terms(derived), constant.factor)
    geometric = tuple(matrices.pop(f"geometric{k}") for k in range(3))
    return BeamMatrices(geometric=geometric, **matrices)


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

    def __init__(self, element: Element, section: Section) -> None:
        self.rows, self.size = _rows(element), len(element.dofs)
        mu, x = hamilton.MU.symbol, hamilton.X.symbol
        rotary = section.rotary if element.rotary else ()
        #: Each density as pairs of a coefficient and its polynomial.
        self.densities: dict[sp.Expr, list[tuple[sp.Expr, PolyElement]]] = {
            sp.Integer(1): [(sp.Integer(1), _RING.one)],
            mu: [(c, _XI**k) for k, c in enumerate(section.mass)],
            mu * x: [(c, _L * _XI ** (k + 1)) for k, c in enumerate(section.mass)],
            hamilton.MASS_BEFORE.symbol: [
                (c, _L * _XI ** (k + 1) / (k + 1)) for k, c in enumerate(section.mass)
            ],
            hamilton.MOMENT_BEFORE.symbol: [
                (c, _L**2 * _XI ** (k + 2) / (k + 2)) for k, c in enumerate(section.mass)
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

    def _add(self, entries: _Entries, at: tuple[int, int], density: sp.Expr, shapes: PolyElement) -> None:
        if shapes:
            number, kind = density.as_coeff_Mul()
            for coefficient, weight in self.densities[kind]:
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


def _over_element(polynomial: PolyElement) -> PolyElement:
    """Integrate by x over the element: by xi from 0 to 1, times L."""
    integral = _RING.zero
    for (i, j), coefficient in polynomial.terms():
        integral += _RING.term_new((0, j + 1), coefficient / (i + 1))
    return integral
