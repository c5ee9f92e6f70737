"""Energies and virtual work of a moving elastic link, to the second degree in its displacements.

The kinetic energy, the strain energy and the potential of gravity of
:func:`symgen.mechanics.elastic.hamilton.derive` are sorted by fields, rates and motion. Their terms have the
constant matrices and load vectors of the equation. So has the virtual work of inertia and gravity in a
translation along or across the link, and in a rotation about its first point, while the displacements keep
their components in the link's axes: each particle moves like its velocity (6.7) by v_x, v_y and omega.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from symgen.mechanics.elastic.hamilton import (
    APPLIED,
    AX,
    AY,
    FIELDS,
    GX,
    GY,
    MU,
    OMEGA,
    OMEGA_RATE,
    ORIGIN,
    PATH,
    ROTARY,
    VX,
    VY,
    Term,
    X,
    derive,
)
from symgen.mechanics.elastic.weights import CONSTANTS, multiple
from symgen.symbolic.calculus import partial
from symgen.symbolic.quantity import quantity

LIFT = quantity("g_0", "m^2/s^2", "gravity times the position of the first point")
#: Energies, with the part of the equation of motion that each belongs to.
ENERGIES = {"kinetic": "inertia", "strain": "elastic", "potential": "inertia"}
#: Forces [N] and moment [N m] of inertia and gravity, with the velocity that each works on.
WORK = {"force_x": VX, "force_y": VY, "moment": OMEGA}
_MOTION = (OMEGA, OMEGA_RATE, AX, AY, *PATH, LIFT)
#: Rates of the motion of a link in its rotating axes, in which gravity has rates too.
_RATES = {
    OMEGA.symbol: OMEGA_RATE.symbol,
    **ORIGIN,
    GX.symbol: OMEGA.symbol * GY.symbol,
    GY.symbol: -OMEGA.symbol * GX.symbol,
    LIFT.symbol: GX.symbol * VX.symbol + GY.symbol * VY.symbol,
}


@dataclass(frozen=True, slots=True)
class EnergyWeight:
    """Factor of a constant in an energy or a force: of s'^T C s', s'^T C s, s^T C s, C^T s' or C^T s.

    Attributes
    ----------
    energy, constant
        Name in ``ENERGIES`` or ``WORK``, and in ``CONSTANTS``.
    orders
        Orders of the rates that the constant multiplies, one or two.
    value
        Expression of the rigid motion.
    """

    energy: str
    constant: str
    orders: tuple[int, ...]
    value: sp.Expr

    @property
    def name(self) -> str:
        """Name among all weights."""
        plain = self.energy in ENERGIES and len(self.orders) == 2
        order = 0 if plain else self.orders[0]
        return f"{self.energy}_{('', 'rate_', 'second_rate_')[order]}{self.constant}"


def rate(value: sp.Expr) -> sp.Expr:
    """Return the rate of an expression of the motion of a link."""
    slopes = ((partial(value, s), r) for s, r in _RATES.items())
    return sp.Add(*(slope * r for slope, r in slopes if slope != 0))


@lru_cache(maxsize=1)
def energy_weights() -> tuple[EnergyWeight, ...]:
    """Return energies and forces of the elastic motion of a link, without those of its rigid motion."""
    densities = {name: c.densities(derive()) for name, c in CONSTANTS.items()}
    weights = []
    for energy, terms in _sorted().items():
        groups: dict[tuple[tuple[int, ...], sp.Expr], dict[tuple[str, str], sp.Expr]] = {}
        for (fields, orders, motion), density in terms.items():
            if fields:
                test, trial = (*fields, "")[:2]
                groups.setdefault((orders, motion), {})[test, trial] = density
        for (orders, motion), group in groups.items():
            constant, factor = multiple(ENERGIES.get(energy, "inertia"), None, group, densities)
            weights.append(EnergyWeight(energy, constant, orders, factor * motion))
    return tuple(weights)


def rigid_energies(
    mass: Sequence[sp.Expr],
    rotary: Sequence[sp.Expr],
    length: sp.Expr,
    lumps: Sequence[tuple[sp.Expr, sp.Expr, sp.Expr]],
) -> dict[str, sp.Expr]:
    """Return energies [J], forces [N] and moment [N m] of the rigid motion of a link by name.

    Parameters
    ----------
    mass, rotary
        Mass [kg/m] and rotary inertia [kg m] per length by powers of the distance from the first point [m].
    length
        Length of the link [m].
    lumps
        Distances from the first point [m], masses [kg] and moments of inertia [kg m^2] along it.
    """
    energies = {}
    for energy, factors in _rigid_factors().items():
        parts = []
        for k, power, factor in factors:
            coefficients = (mass, rotary)[k]
            whole = [c * length ** (power + j + 1) / (power + j + 1) for j, c in enumerate(coefficients)]
            whole += [distribution[k] * at**power for at, *distribution in lumps]
            parts.append(factor * sp.Add(*whole))
        energies[f"{energy}_rigid"] = sp.Add(*parts)
    return energies


@lru_cache(maxsize=1)
def _rigid_factors() -> dict[str, list[tuple[int, int, sp.Expr]]]:
    """Return, by energy, the factors of powers of the distance: of mass (0) and of rotary inertia (1)."""
    factors = {}
    for energy, terms in _sorted().items():
        total = sp.Add(*(motion * density for (fields, _, motion), density in terms.items() if not fields))
        if total != 0:
            polynomials = (sp.Poly(sp.expand(total).coeff(of.symbol), X.symbol) for of in (MU, ROTARY))
            by_power = [(k, p.terms()) for k, p in enumerate(polynomials)]
            factors[energy] = [(k, n, f) for k, terms in by_power for (n,), f in reversed(terms) if f != 0]
    return factors


@lru_cache(maxsize=1)
def _sorted() -> dict[str, dict[tuple[tuple[str, ...], tuple[int, ...], sp.Expr], sp.Expr]]:
    """Return densities of energies and forces by fields, the orders of their rates, and the motion.

    Fields with the most rates come first.
    """
    steps = {step.name: step.expressions for step in derive().steps}
    symbols = [q.symbol for q in FIELDS.values()]
    by_energy: dict[str, dict[tuple[tuple[str, ...], tuple[int, ...], sp.Expr], sp.Expr]] = {}
    potential = -steps["gravity_work"][0] - MU.symbol * LIFT.symbol
    expressions = (
        steps["kinetic_energy"][0],
        steps["strain_energy"][0],
        potential,
        *_forces(steps["velocity"]),
    )
    for energy, density in zip((*ENERGIES, *WORK), expressions, strict=True):
        terms = by_energy.setdefault(energy, {})
        for powers, factor in sp.Poly(density, *symbols, *(q.symbol for q in _MOTION)).terms():
            names = [name for name, p in zip(FIELDS, powers, strict=False) for _ in range(p)]
            moved = [(name.rstrip("_t"), name.count("t")) for name in names]
            moved.sort(key=lambda pair: -pair[1])
            by = zip(_MOTION, powers[len(symbols) :], strict=True)
            motion = sp.Mul(*(q.symbol**p for q, p in by))
            terms[tuple(name for name, _ in moved), tuple(order for _, order in moved), motion] = factor
    return by_energy


def _forces(velocity: Sequence[sp.Expr]) -> Iterator[sp.Expr]:
    """Yield densities of the forces and the moment of ``WORK``."""
    rows = {"u": velocity[0], "w": velocity[1], "phi": OMEGA.symbol}
    for q in WORK.values():
        moved = {test: sp.diff(place, q.symbol) for test, place in rows.items()}
        yield sp.Add(
            *(
                moved[t.test] * t.motion * t.density * _trial(t)
                for t in derive().terms
                if t.part == "inertia" and not t.motion.free_symbols & {q.symbol for q in APPLIED}
            )
        )


def _trial(term: Term) -> sp.Expr:
    """Return the field of a term with its rates; 1 of a load."""
    return (
        FIELDS[f"{term.trial}_{'t' * term.order}".removesuffix("_")].symbol if term.trial else sp.Integer(1)
    )
