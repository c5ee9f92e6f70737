"""Proof, for one linkage, that its momentum rows hold every mass and every load of the symmetric form."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import DerivationError
from symgen.mechanics.rods.momentum import moment
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.constants import rounded

if TYPE_CHECKING:
    from symgen.models.momentum.outboard import Outboard

_DIGITS, _AGREE = 40, sp.Float("1e-30")

Terms = dict[sp.Symbol, list[sp.Expr]]


def check_complete(form: Outboard) -> None:
    """Compare particles and loads with the mass matrix M and the forces f of the symmetric form.

    The virtual work of particles and loads on every coordinate must be that of M a - f. It is compared at one
    state without symmetry, to 30 digits.

    Raises
    ------
    DerivationError
        When they differ: the linkage has a mass or load that the momentum rows do not contain.
    """
    model = form.model
    coordinates = [q.symbol for q in model.coordinates]
    masses, forces = _masses(form), _forces(form)
    pairs = [
        (masses.get(pair, ZERO), model.mass_entries.get(pair, ZERO))
        for pair in product(coordinates, repeat=2)
    ]
    pairs += [(sp.Add(*forces.get(q, ())), model.force.get(q, ZERO)) for q in coordinates]
    values = _state(form)
    numbers = [tuple(rounded(sp.sympify(e).xreplace(values), _DIGITS) for e in pair) for pair in pairs]
    size = max((abs(b) for _, b in numbers), default=ZERO)
    if any(abs(a - b) > _AGREE * size for a, b in numbers):
        raise DerivationError(
            f"{form.linkage.name}: its momentum rows are not known: it has masses or loads beyond those of "
            "rods, planar bodies and point masses"
        )


def _masses(form: Outboard) -> dict[tuple[sp.Symbol, sp.Symbol], sp.Expr]:
    """Mass matrix of the particles by pairs of coordinates."""
    entries: dict[tuple[sp.Symbol, sp.Symbol], list[sp.Expr]] = {}
    for mass, shares, _ in form.masses(form.link, form.model.points):
        for (p, (x, y)), (r, (z, w)) in product(shares.items(), repeat=2):
            rows, columns = (form.model.symbols(form.model.q[k]) for k in (p, r))
            for i, k in product(range(len(rows)), repeat=2):
                turned = (k - i) * (y * z - x * w)
                value = mass * (x * z + y * w if i == k else turned)
                if value != 0:
                    entries.setdefault((rows[i], columns[k]), []).append(value)
    return {pair: sp.Add(*terms) for pair, terms in entries.items()}


def _forces(form: Outboard) -> Terms:
    """Virtual work of every load on each coordinate: of each body and each point by itself."""
    model = form.model
    terms: Terms = {}
    alone: list[tuple[list[str], list[str]]] = [([body], []) for body in form.link]
    for bodies, points in [*alone, *(([], [point]) for point in model.points)]:
        for push in form.pushes(bodies, points):
            for component, place in zip(push.force, push.place, strict=True):
                if push.unknown is None:
                    _work(terms, component, model.calculus.gradient(place))
    for name, link in form.link.items():
        for couple, unknown in form.couples([name]):
            if unknown is not None:
                continue
            if len(couple) == 1:
                _work(terms, couple[0], model.turning(name)[0])
                continue
            d = model.along[name]
            for component, along in zip(moment(couple, d), d, strict=True):
                _work(terms, component / link.length**2, model.calculus.gradient(along))
    return terms


def _work(terms: Terms, force: sp.Expr, gradient: dict[sp.Symbol, sp.Expr]) -> None:
    for q, slope in gradient.items():
        terms.setdefault(q, []).append(force * slope)


def _state(form: Outboard) -> dict[sp.Symbol, sp.Expr]:
    """Numbers for every symbol: parameters as in the scene, the rest without symmetry."""
    model = form.model
    values: dict[sp.Symbol, sp.Expr] = dict(form.linkage.defaults)
    motion = [x.symbol for group in (model.q, model.u) for p in model.points if p in group for x in group[p]]
    for i, symbol in enumerate(motion):
        values[symbol] = sp.Rational(53 * i % 97 + 11, 41)
    for symbol in sorted({s for e in model.force.values() for s in e.free_symbols}, key=str):
        values.setdefault(symbol, sp.Rational(7, 10))
    for definition in (*model.calculus.definitions, *form.definitions.values()):
        known = definition.expression.xreplace(values)
        values[definition.quantity.symbol] = rounded(known, _DIGITS)
    return values
