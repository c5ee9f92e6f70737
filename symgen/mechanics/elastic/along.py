"""Constants of an element with the masses and forces that are at places of its link."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from symgen.elements.element import PLACE, Element
from symgen.mechanics.elastic.beam_matrices import shape_rows, stiffened
from symgen.mechanics.elastic.hamilton import X
from symgen.mechanics.elastic.places import AT_A_PLACE, ROTATING, SHAPES, at_a_place

Constants = dict[str, sp.ImmutableMatrix]


@dataclass(frozen=True, slots=True)
class PlaceOnElement:
    """A place of a link on one of its elements: xi of the element, and distance [m] from the first point."""

    xi: sp.Rational
    distance: sp.Expr


def with_lump(
    element: Element, constants: Constants, place: PlaceOnElement, mass: sp.Expr, inertia: sp.Expr
) -> Constants:
    """Return constants with a mass and a moment of inertia at a place of the element.

    The mass is carried by the axial force from its place to the second node.
    """
    shape, there = _shape(element, place), _at(place)
    found = dict(constants)
    for name in ("mass", "gyroscopic", "load_x", "load_y", "load_out", "load_turn"):
        found[name] += mass * _over(shape, there[name])
    found["centrifugal"] += mass * _over(shape, there["mass"])
    for name in ROTATING:
        found[name] += inertia * _over(shape, there[f"rotary_{name}"])
    behind = stiffened(element, place.xi)
    found["geometric1"] += mass * behind
    found["geometric2"] += mass * place.distance * behind
    return found


def of_force(element: Element, place: PlaceOnElement, follows: bool) -> Constants:
    """Return the constants of a unit force at a place of the element; see ``APPLIED``."""
    shape, there = _shape(element, place), _at(place)
    names = [
        name for name in AT_A_PLACE if name.startswith("force") or (follows and name.startswith("follower"))
    ]
    return {name: _over(shape, there[name]) for name in names} | {
        "geometric_force": stiffened(element, place.xi)
    }


def fibre_strain(element: Element, place: PlaceOnElement, fibre: sp.Expr) -> sp.ImmutableMatrix:
    """Return the strain of a fibre at a place of the element by its unknowns, a row: h phi' + u', Eq. (8.7).

    ``fibre`` is the distance h [m] from the neutral axis, not the depth as in the thesis. The stress is the
    strain times Young's modulus.
    """
    rows = dict(zip(SHAPES, _shape(element, place).tolist(), strict=True))
    pairs = zip(rows["curvature"], rows["axial_strain"], strict=True)
    return sp.ImmutableMatrix([[fibre * curvature + stretch for curvature, stretch in pairs]])


def _shape(element: Element, place: PlaceOnElement) -> sp.ImmutableMatrix:
    rows = shape_rows(element)
    return sp.ImmutableMatrix([[e.subs(PLACE.symbol, place.xi) for e in row] for row in rows.values()])


def _at(place: PlaceOnElement) -> Constants:
    return {name: term.xreplace({X.symbol: place.distance}) for name, term in at_a_place().items()}


def _over(shape: sp.ImmutableMatrix, term: sp.ImmutableMatrix) -> sp.ImmutableMatrix:
    return shape.T * term * shape if term.cols > 1 else shape.T * term
