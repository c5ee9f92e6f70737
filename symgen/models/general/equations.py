"""The motion of a user's System: M a + J^T lambda = f and Phi(q, t) = 0 in coordinates of any kind.

A System with ``values`` states a motion by the matrices ``mass_matrix`` and ``force``, and, if it has any, by
``constraints``, ``potential_energy``, ``positions`` of points, ``events`` and ``ending_events``. The Jacobian
and the rates of the constraints, the energies, the power, and the slopes of every analysis follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from symgen.errors import DerivationError, SceneError, nearest
from symgen.models.general.checks import STATED, check, vanishes
from symgen.models.rods.constraints import Constraint
from symgen.models.rods.drives import Drive
from symgen.models.rods.linkage import RodsModel
from symgen.models.rods.points import Vector
from symgen.scene.rods.linkage import TIME, Event, Linkage, StartConditions
from symgen.scene.rods.run_parameters import Parameter
from symgen.symbolic.calculus import ONE, ZERO, Calculus, per_second
from symgen.symbolic.quantity import Entries, Quantity, quantity
from symgen.symbolic.system import System

#: Error of the constraints at the start, in their own units.
_ASSEMBLED = 1e-8
#: Operations up to which the power is expanded.
_EXPANDED = 2000


@dataclass(frozen=True)
class GeneralSystem(Linkage):
    """A user's System as a mechanism without points and links of its own; ``stated`` is that System."""

    stated: System | None = None

    @property
    def method(self) -> str:
        """``general``."""
        return "general"


def general_system_of(system: System, file: str) -> GeneralSystem:
    """Return a System that states a motion as a mechanism.

    Raises
    ------
    DerivationError
        For a missing matrix, one of another shape, a parameter without a value, or a value of nothing.
    """
    check(system)
    values = system.values or {}
    parameters = next((g.quantities for g in system.groups if g.name == "p"), ())
    kernels = {e.kernel: e.matrices for e in system.exports}
    return GeneralSystem(
        name=system.name,
        file=file,
        title=system.title,
        units={},
        dimension=len(system["positions"].columns) if "positions" in system else 2,
        parameters=tuple(Parameter(p, sp.Float(float(values[p.name]))) for p in parameters),
        points=(),
        links=(),
        bodies=(),
        gravity=(),
        masses=(),
        loads=(),
        guides=(),
        drivers=(),
        hinges=(),
        start=StartConditions((), (), ()),
        t_end=ONE,
        assembly_tolerance=sp.Float(_ASSEMBLED),
        outputs=kernels.get("outputs"),
        events=tuple(
            Event(row, entry, m.unit, 0, name == "ending_events", m.description)
            for name in ("events", "ending_events")
            if name in system
            for m in (system[name],)
            for row, entry in zip(m.rows or map(str, range(m.matrix.rows)), m.matrix, strict=True)
        ),
        stated=system,
    )


class GeneralEquations(RodsModel):
    """Derivation of the motion of a user's System; its coordinates take the place of those of points."""

    linkage: GeneralSystem

    def __init__(self, of: GeneralSystem) -> None:
        super().__init__(of)
        if of.stated is None:
            raise DerivationError(f"{of.name} states no motion")
        self.stated = of.stated
        arrays = {g.name: g.quantities for g in self.stated.groups}
        q = arrays["q"]
        u = arrays.get("u") or tuple(
            quantity(f"{x.name}_rate", per_second(x.unit), f"rate of {x.description}") for x in q
        )
        names = self.free = [x.name for x in q]
        self.q = dict(zip(names, ((x,) for x in q), strict=True))
        self.u = dict(zip(names, ((x,) for x in u), strict=True))
        self.a = {
            x.name: (quantity(f"{x.name}_a", per_second(y.unit), f"second rate of {x.description}"),)
            for x, y in zip(q, u, strict=True)
        }
        self.calculus = Calculus(q, u, TIME.symbol)
        self._letters: dict[sp.Symbol, sp.Expr] = {t.symbol: TIME.symbol for t in arrays.get("t", ())}
        for d in self.stated.definitions:
            self._letters[d.quantity.symbol] = self.calculus.define(
                d.quantity.name, self.own(d.expression), d.quantity.unit, d.quantity.description
            )

    def own(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression of the System with the names of this derivation."""
        return expression.xreplace(self._letters)

    def _entries(self, name: str) -> list[sp.Expr]:
        """Return the entries of a matrix of the System, row by row; none where it has no such matrix."""
        return [self.own(e) for e in self.stated[name].matrix] if name in self.stated else []

    @cached_property
    def start(self) -> dict[sp.Symbol, sp.Expr]:
        """Coordinates as stated for the start, at the time zero, and the named expressions of these."""
        stated = self.stated.values or {}
        known: dict[sp.Symbol, sp.Expr] = {TIME.symbol: ZERO}
        known |= {x.symbol: sp.Float(float(stated.get(x.name, 0.0))) for x in self.coordinates}
        for d in self.calculus.definitions:
            known[d.quantity.symbol] = d.expression.xreplace(known)
        return known

    @property
    def rates(self) -> list[Quantity]:
        """Rates of the coordinates."""
        return [x for name in self.free for x in self.u[name]]

    @cached_property
    def mass_entries(self) -> dict[tuple[sp.Symbol, sp.Symbol], sp.Expr]:
        """Mass matrix by pairs of coordinates, without zeros."""
        q = [x.symbol for x in self.coordinates]
        entries, n = self._entries("mass_matrix"), len(q)
        pairs = {(q[k // n], q[k % n]): entry for k, entry in enumerate(entries)}
        return {pair: entry for pair, entry in pairs.items() if entry != 0}

    @cached_property
    def kinetic_energy(self) -> sp.Expr:
        """Kinetic energy u . M u / 2 [J]."""
        rate_of = self._rate_of
        return sp.Add(*(m * rate_of[i] * rate_of[j] for (i, j), m in self.mass_entries.items())) / 2

    @property
    def potential_energy(self) -> sp.Expr:
        """The potential energy that the System states [J]."""
        return sp.Add(*self._entries("potential_energy"))

    @cached_property
    def force(self) -> dict[sp.Symbol, sp.Expr]:
        """Force on every coordinate."""
        entries = zip(self.coordinates, self._entries("force"), strict=True)
        return {x.symbol: force for x, force in entries if force != 0}

    def by_time(self, expression: sp.Expr) -> sp.Expr:
        """Return the partial derivative by the time, through the named expressions."""
        slopes = self.calculus.gradient(expression)
        moved = [slopes[q] * u for q, u in self._rate_of.items() if q in slopes]
        found = self.calculus.rate(expression) - sp.Add(*moved)
        return ZERO if vanishes(found, self.calculus.definitions) else found

    @cached_property
    def _rate_of(self) -> dict[sp.Symbol, sp.Symbol]:
        """Rate of every coordinate."""
        return {q.symbol: u.symbol for q, u in zip(self.coordinates, self.rates, strict=True)}

    @cached_property
    def power(self) -> sp.Expr:
        """Rate of kinetic and potential energy by the equations of motion [W]; zero without other work."""
        rate, rate_of = self.calculus.rate, self._rate_of
        slopes = self.calculus.gradient(self.potential_energy)
        terms = [(self.force.get(q, ZERO) + slopes.get(q, ZERO)) * u for q, u in rate_of.items()]
        terms += [rate(m) * rate_of[i] * rate_of[j] / 2 for (i, j), m in self.mass_entries.items()]
        terms.append(self.by_time(self.potential_energy))
        terms += [
            self.multipliers[c.name].symbol * by_time
            for c in self.constraints
            if (by_time := self.by_time(c.expression)) != 0
        ]
        total = sp.Add(*terms)
        if vanishes(total, self.calculus.definitions):
            return ZERO
        # Powers of inertia cancel term by term, to round-off only where they are computed.
        size = total.count_ops()
        shorter = sp.expand(total) if size < _EXPANDED else total
        return shorter if shorter.count_ops() < size else total

    @cached_property
    def constraints(self) -> list[Constraint]:
        """The rows of the constraints."""
        if "constraints" not in self.stated:
            return []
        m = self.stated["constraints"]
        names = m.rows or [f"constraint_{i}" for i in range(m.matrix.rows)]
        return [
            Constraint(name, f"the constraint {name}", entry, ONE, m.unit)
            for name, entry in zip(names, self._entries("constraints"), strict=True)
        ]

    @property
    def points(self) -> list[str]:
        """Names of the points of which the System states positions."""
        return list(self.stated["positions"].rows) if "positions" in self.stated else []

    def position(self, point: str) -> Vector:
        """Return the position of a point [m]."""
        width = len(self.axes)
        k = self.points.index(point) * width
        return tuple(self._entries("positions")[k : k + width])

    def acceleration(self, point: str) -> Vector:
        """Return the acceleration of a point [m/s^2]."""
        return tuple(self.second_rate(c) for c in self.position(point))

    @cached_property
    def drives(self) -> tuple[Drive, ...]:
        """The time, where a constraint depends on it."""
        driven = any(self.by_time(c.expression) != 0 for c in self.constraints)
        t = TIME
        time = Drive(owner="", name=t.name, value=t.symbol, unit=t.unit, about=t.description)
        return (time,) if driven else ()

    def own_output(self, name: str) -> Entries | None:
        """Return scalars, unit and description of an output of the System; None for points and energies.

        Raises
        ------
        SceneError
            When there is no such output.
        """
        for of, word in ((self.coordinates, "coordinate"), (self.rates, "rate")):
            for x in of:
                if x.name == name:
                    return [x.symbol], x.unit, x.description or word
        if name in self.stated and name not in STATED:
            m = self.stated[name]
            if len(m.matrix) == 1 or (m.matrix.cols == 1 and m.rows == tuple(self.axes)):
                return self._entries(name), m.unit, m.description
            rows = (
                f"its rows: {', '.join(f'{name}.{row}' for row in m.rows)}"
                if m.rows
                else "matrices of one entry"
            )
            raise SceneError(
                f"{name} is no output, since it has {len(m.matrix)} entries", hint=f"Record {rows}."
            )
        owner, _, word = name.rpartition(".")
        if owner in self.points and word in ("position", "velocity", "acceleration"):
            return None
        if owner in self.stated and word in self.stated[owner].rows and self.stated[owner].matrix.cols == 1:
            m = self.stated[owner]
            return [self._entries(owner)[m.rows.index(word)]], m.unit, f"{m.description}: {word}"
        if name in ("energy", "kinetic_energy", "potential_energy"):
            return None
        known = [x.name for x in (*self.coordinates, *self.rates)]
        known += [m.name for m in self.stated.matrices if m.name not in STATED]
        known += [f"{p}.{w}" for p in self.points for w in ("position", "velocity", "acceleration")]
        raise SceneError(f"there is no output {name!r}", hint=nearest(name, [*known, "energy"]))


def equations_of(linkage: Linkage) -> RodsModel:
    """Return the derivation of a linkage, or of a user's System."""
    return GeneralEquations(linkage) if isinstance(linkage, GeneralSystem) else RodsModel(linkage)
