"""Equation of an elastic link as a sum of constant matrices times weights from the rigid motion.

Hamilton's principle gives terms, each a density over the link times a product of rigid-motion quantities.
Terms with the same densities form one constant matrix; the product, with the factor between them, is its
weight. All terms come from :func:`symgen.mechanics.elastic.hamilton.derive`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from symgen.errors import DerivationError
from symgen.mechanics.elastic.hamilton import (
    APPLIED,
    AX,
    AY,
    N0,
    OMEGA,
    OMEGA_RATE,
    PX,
    PY,
    Derivation,
    Term,
    derive,
)

_ONE = sp.Integer(1)


@dataclass(frozen=True, slots=True)
class LinkConstant:
    """A constant matrix or load vector of a link: ``factor`` times the integrals of some collected terms.

    ``order`` is the order of the rate that it multiplies; None for a load.
    """

    part: str
    order: int | None
    motion: sp.Expr
    factor: sp.Rational

    @property
    def applied(self) -> bool:
        """Whether it belongs to a force along the link, by its profile, and not to the link itself."""
        return self.motion in {q.symbol for q in APPLIED}

    def terms(self, derived: Derivation) -> tuple[Term, ...]:
        """Return its terms of the left-hand side."""
        if self.order is None:
            return derived.loads(self.motion)
        return derived.of(self.part, self.order, self.motion)

    def densities(self, derived: Derivation) -> dict[tuple[str, str], sp.Expr]:
        """Return its densities by test and trial field.

        Profiles of forces, which a scene gives, are integrated as they are: no factor, nor sign, belongs to
        the constant.
        """
        terms = self.terms(derived)
        if self.applied:
            return {(t.test, t.trial): t.density.as_coeff_Mul()[1] for t in terms}
        return _densities(terms, self.factor)


def _constant(part: str, order: int | None, motion: sp.Expr, factor: sp.Rational | int = 1) -> LinkConstant:
    return LinkConstant(part, order, motion, sp.Rational(factor))


#: Constant matrices and load vectors of a link by name; the factors give their customary sizes.
CONSTANTS = {
    "mass": _constant("inertia", 2, _ONE),
    "gyroscopic": _constant("inertia", 1, OMEGA.symbol, sp.Rational(-1, 2)),
    "stiffness": _constant("elastic", 0, _ONE),
    "centrifugal": _constant("inertia", 0, OMEGA.symbol**2, -1),
    "geometric0": _constant("geometric", 0, N0.symbol),
    "geometric1": _constant("geometric", 0, AX.symbol),
    "geometric2": _constant("geometric", 0, OMEGA.symbol**2, -1),
    "geometric_force": _constant("geometric", 0, PX.symbol),
    "follower_x": _constant("follower", 0, PX.symbol),
    "follower_y": _constant("follower", 0, PY.symbol),
    "load_x": _constant("inertia", None, AX.symbol),
    "load_y": _constant("inertia", None, AY.symbol),
    "load_out": _constant("inertia", None, OMEGA.symbol**2, -1),
    "load_turn": _constant("inertia", None, OMEGA_RATE.symbol),
    "force_x": _constant("inertia", None, PX.symbol),
    "force_y": _constant("inertia", None, PY.symbol),
}
#: Names of the four parts of M s'' + C s' + K s = Q by the order of the rate.
INTO = {2: "mass", 1: "damping", 0: "stiffness", None: "load"}


@dataclass(frozen=True, slots=True)
class Weight:
    """Weight of a constant in one part of the equation.

    Attributes
    ----------
    into, constant
        Part of the equation, of ``INTO``, and name in ``CONSTANTS``, or ``damping``.
    value
        Expression of the rigid motion.
    inertial
        Whether it belongs to the inertia of the elastic motion itself, which a quasi-static motion omits.
    crossed
        For an equation in fixed axes: ``ends`` if it multiplies the end displacements (u, w) only,
        ``quarter`` if it multiplies them rotated back by a right angle, (w, -u).
    """

    into: str
    constant: str
    value: sp.Expr
    inertial: bool
    crossed: str = ""

    @property
    def applied(self) -> bool:
        """Whether it belongs to a force along the link."""
        return self.constant in CONSTANTS and CONSTANTS[self.constant].applied

    @property
    def name(self) -> str:
        """Name among all weights."""
        base = self.constant if self.constant.startswith(self.into) else f"{self.into}_{self.constant}"
        return f"{base}_{self.crossed}" if self.crossed else base


@lru_cache(maxsize=1)
def weights() -> tuple[Weight, ...]:
    """Return the equation of a link in its own axes, Eqs. (7.24)-(7.28), as weights of its constants.

    Raises
    ------
    DerivationError
        When a collected term belongs to no constant.
    """
    derived = derive()
    densities = {name: c.densities(derived) for name, c in CONSTANTS.items()}
    groups: dict[tuple[str, int | None, sp.Expr], list[Term]] = {}
    for term in derived.terms:
        groups.setdefault((term.part, term.order if term.trial else None, term.motion), []).append(term)
    weights = []
    for (part, order, motion), terms in groups.items():
        name, factor = multiple(part, order, _densities(terms), densities)
        sign = -1 if order is None else 1  # loads go to the right-hand side
        inertial = part == "inertia" and order is not None
        weights.append(Weight(INTO[order], name, sign * factor * motion, inertial))
    return tuple(weights)


def turning_ends() -> tuple[Weight, ...]:
    """Return the additional terms of the equation in fixed axes, in link axes; see :func:`substituted`.

    The damping matrix of a link enters its equation unchanged.
    """
    local = (*weights(), Weight("damping", "damping", _ONE, inertial=True))
    return tuple(
        Weight(into, w.constant, factor * w.value, True, crossed)
        for of, into, crossed, factor in substituted()
        for w in local
        if w.into == of
    )


def substituted() -> tuple[tuple[str, str, str, sp.Expr], ...]:
    """Return the positions of mass and damping after the substitution s = T^T S of the end displacements.

    Each entry has the source and target part of the equation, the form of the end displacements, and the
    factor: s' = T^T S' + (T^T)' S and s'' = T^T S'' + 2 (T^T)' S' + (T^T)'' S, by :func:`rates_of_turn`.
    """
    first, (ends, quarter) = rates_of_turn()
    return (
        ("mass", "damping", "quarter", 2 * first),
        ("mass", "stiffness", "quarter", quarter),
        ("mass", "stiffness", "ends", ends),
        ("damping", "stiffness", "quarter", first),
    )


@lru_cache(maxsize=1)
def rates_of_turn() -> tuple[sp.Expr, tuple[sp.Expr, sp.Expr]]:
    """Return the rates of T^T, from fixed axes to the link's: (T^T)' = a Q T^T, (T^T)'' = (b + c Q) T^T.

    Q rotates back by a right angle, (u, w) to (w, -u). Returned are a and (b, c).
    """
    t = sp.Symbol("t", real=True)
    theta = sp.Function("theta", real=True)(t)
    turn = sp.Matrix([[sp.cos(theta), sp.sin(theta)], [-sp.sin(theta), sp.cos(theta)]])
    known = {theta.diff(t, 2): OMEGA_RATE.symbol, theta.diff(t): OMEGA.symbol}
    first, second = (
        (turn.diff(t, k) * turn.T).applyfunc(lambda e: sp.trigsimp(sp.expand(e.subs(known)))) for k in (1, 2)
    )
    return first[0, 1], (second[0, 0], second[0, 1])


def _densities(terms: Iterable[Term], factor: sp.Expr = _ONE) -> dict[tuple[str, str], sp.Expr]:
    return {(t.test, t.trial): factor * t.density for t in terms}


def multiple(
    part: str,
    order: int | None,
    group: dict[tuple[str, str], sp.Expr],
    known: dict[str, dict[tuple[str, str], sp.Expr]],
) -> tuple[str, sp.Expr]:
    """Return the constant of which a group of terms is a multiple, and the factor."""
    for name, densities in known.items():
        if CONSTANTS[name].part == part and densities.keys() == group.keys():
            ratios = {group[at] / densities[at] for at in group}
            if len(ratios) == 1 and (factor := ratios.pop()).is_number:
                return name, factor
    raise DerivationError(
        f"no constant matrix of an elastic link holds the terms of {part} of order {order} with {group}"
    )
