"""Attia's own form of the equations of motion: momentum rows of a linkage, for inspection and proof.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, Eqs. (12) to (16). Runs use the symmetric
form of ``rods``; these rows are derived only for display. The two sides of a cut have one name, so
the cut's own rows are satisfied identically, and its force is an unknown. Where the user selects the cuts, a
cut link has a particle of its own, and the cut has rows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import sympy as sp

from symgen.errors import DerivationError, SceneError
from symgen.mechanics.rods.momentum import effective_lever, moment, particles, perpendicular, smallest_axis
from symgen.mechanics.rods.particles import Vector
from symgen.models.momentum.completeness import check_complete
from symgen.models.momentum.cuts import closed, cut_linkage
from symgen.models.momentum.outboard import Outboard
from symgen.models.rods.linkage import REFERENCE, RodsModel
from symgen.models.rods.matrix import named
from symgen.scene.rods.linkage import TIME, Linkage, RigidLink
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.quantity import Quantity
from symgen.symbolic.system import NO_SOURCE, Group, NamedMatrix, System
from symgen.symbolic.vectors import dot

Coefficients = dict[sp.Symbol, sp.Expr]


@dataclass(frozen=True, slots=True)
class MomentumRow:
    """One equation: the sum of coefficients times unknowns is ``rhs``; ``shown``: the difference in print."""

    name: str
    coefficients: Coefficients
    rhs: sp.Expr
    shown: sp.Expr | None = None


@dataclass(slots=True)
class MomentumRows:
    """Rows that belong together, with unit and meaning."""

    name: str
    unit: str
    description: str
    source: str
    rows: list[MomentumRow] = field(default_factory=list)


def momentum_system(linkage: Linkage, cuts: Sequence[str] = (), *, joined: bool = False) -> System:
    """Return the momentum rows of a linkage as a System.

    One matrix for each set of rows, linear in the unknowns x (accelerations, forces at cuts, multipliers of
    guides and drives, reactions) and zero along the motion; then ``matrix`` and ``rhs`` of all of them,
    A x = b.

    Parameters
    ----------
    linkage
        The linkage.
    cuts
        Joints ``LINK.POINT`` to cut, which have constraint rows and leave no loop; the reactions of the
        ground at other points are no unknowns then. If empty, a loop is cut where a point is reached twice.
    joined
        Place the particles of cut links at their joints: with the coordinates of the linkage only.

    Raises
    ------
    DerivationError
        When the linkage holds a mass or a load that these rows do not know.
    ModelError
        For joints that cannot be cut, or that leave a loop.
    """
    try:
        whole = RodsModel(linkage)
        if whole.loads.of_joints:
            raise DerivationError(f"{linkage.name} has no momentum rows: these have no friction of bearings")
        if linkage.motions:
            raise DerivationError(f"{linkage.name} has no momentum rows: these have no [[motions]]")
        whole.check_masses()
        opened, chosen = cut_linkage(whole, cuts)
        model = RodsModel(opened) if chosen else whole
        form = MomentumForm(model, chosen)
        check_complete(form)
    except SceneError as error:
        raise error.located(file=linkage.file) from None
    system = form.system()
    if not (joined and chosen):
        return system
    groups = {g.name: g for g in motion_groups(whole)}
    system = system.substituted(closed(model, chosen, whole))
    return replace(system, groups=tuple(groups.get(g.name, g) for g in system.groups))


class MomentumForm(Outboard):
    """The derivation; each method makes one kind of rows."""

    def moments(self, body: str) -> MomentumRows:
        """Eqs. (9), (12), in space (10), (13): moment of momentum of all outboard about the inner joint."""
        bodies, points = self.tree.outboard(body)
        joint = self.tree.inner[body]
        pivot = self.model.position(joint)
        of = f"{', '.join(bodies)} about {joint}"
        about = f"rate of the moment of momentum of {of}, less the moment G of the loads"
        source = _moment_source(body, joint, [self.link[b] for b in bodies], len(pivot) == 3)
        rows = MomentumRows(f"{body}_moment", "N*m", about, source)
        levers: dict[str, list[Vector]] = {}
        for mass, shares, place in self.masses(bodies, points):
            lever = _difference(place, pivot)
            for point, (along, across) in shares.items():
                effective = effective_lever(lever, along, across)
                levers.setdefault(point, []).append(tuple(mass * c for c in effective))
        weighted = {p: self._weighted_lever(body, p, terms) for p, terms in levers.items()}
        axes = self._axes(body)
        pushes, couples = [*self.pushes(bodies, points)], [*self.couples(bodies)]
        for axis_name, axis in axes.items():
            coefficients: Coefficients = {}
            for point, lever in weighted.items():
                by = _turned(lever, axis)
                _add(coefficients, zip(self.model.symbols(self.model.a[point]), by, strict=True))
            rhs = []
            for push in pushes:
                known = dot(axis, moment(_difference(push.place, pivot), push.force))
                rhs.append(known) if push.unknown is None else _add(coefficients, [(push.unknown, -known)])
            for couple, unknown in couples:
                known = dot(axis, couple)
                rhs.append(known) if unknown is None else _add(coefficients, [(unknown, -known)])
            rows.rows.append(MomentumRow(axis_name, coefficients, sp.Add(*rhs)))
        if len(pivot) == 2:
            (row,) = rows.rows
            by_loads = self.define(f"G_{body}", row.rhs, "N*m", f"moment of the loads on {of}")
            rows.rows = [replace(row, shown=_sum(row.coefficients) - by_loads)]
            return rows
        terms = [moment(lever, self.model.symbols(self.model.a[p])) for p, lever in weighted.items()]
        loads = [(moment(_difference(p.place, pivot), p.force), p.unknown) for p in pushes]
        acting = [tuple(c * (unknown or ONE) for c in load) for load, unknown in (*loads, *couples)]
        whole = []
        for i, letter in enumerate(self.model.axes):
            rate, sides = (sp.Add(*(t[i] for t in each)) for each in (terms, acting))
            about = f"{letter} rate of the moment of momentum of {of}"
            rate = self.define(f"{body}_moment_{letter}", rate, "N*m", about)
            about = f"{letter} component of the moment of the loads on {of}"
            whole.append(rate - self.define(f"G_{body}_{letter}", sides, "N*m", about))
        rows.rows = [replace(row, shown=dot(axes[row.name], tuple(whole))) for row in rows.rows]
        return rows

    def _weighted_lever(self, body: str, point: str, terms: list[Vector]) -> Vector:
        """Name the bracket of Eq. (12) that stands before the acceleration of a point."""
        about = f"sum of mass times lever before the acceleration of {point} in the row of {body}"
        return tuple(
            self.define(
                f"{body}_{point}_lever_{axis}", sp.Add(*(t[i] for t in terms)), "kg*m", f"{axis} {about}"
            )
            for i, axis in enumerate(self.model.axes)
        )

    def _axes(self, body: str) -> dict[str, Vector]:
        """Return the directions on which a moment is projected: out of the plane, or two across the body."""
        if len(self.model.axes) == 2:
            return {body: (ONE,)}
        d, length, names = self.model.along[body], self.link[body].length, self.model.axes

        def define(name: str, vector: Vector, unit: str, about: str) -> Vector:
            known: dict[sp.Expr, sp.Expr] = {}
            for a, c in zip(names, vector, strict=True):
                here = c.xreplace(known)
                known[c] = self.define(f"{name}_{body}_{a}", here, unit, f"{a} component of {about}")
            return tuple(known[c] for c in vector)

        axis = define("e", smallest_axis(d), "1", f"the axis nearest to lying across {body}")
        crossed, size = perpendicular(d, axis)
        size = self.define(f"rho_{body}", size, "m", f"size of the product of e and the vector along {body}")
        bar = define("u_bar", tuple(c / size for c in crossed), "1", f"a unit vector across {body}")
        hat = define("u_hat", tuple(c / length for c in moment(d, bar)), "1", f"the other one across {body}")
        return {f"u_bar_{body}": bar, f"u_hat_{body}": hat}

    def momentum(self, point: str) -> MomentumRows | None:
        """Eq. (15): linear momentum of all that is beyond a root, or a ground point with its reaction."""
        bodies, points = self.tree.beyond(point)
        ground = point in self.model.ground
        noun = f"{', '.join(bodies)} beyond {point}" if bodies else point
        about = f"rate of the linear momentum of {noun}, less the sum R of the loads"
        rows = MomentumRows(
            f"{point}_momentum",
            "N",
            about + (" and the reaction" if ground else ""),
            f"Attia (15){_AT_JOINTS}",
        )
        pushes = list(self.pushes(bodies, points))
        masses = list(self.masses(bodies, points))
        if ground and not (pushes or masses):
            return None
        for i, axis in enumerate(self.model.axes):
            coefficients: Coefficients = {}
            for mass, shares, _ in masses:
                for p, (along, across) in shares.items():
                    a = self.model.symbols(self.model.a[p])
                    _add(coefficients, [(a[i], mass * along)])
                    if across != 0:
                        _add(coefficients, [(a[1 - i], mass * across * (2 * i - 1))])
            rhs = [p.force[i] for p in pushes if p.unknown is None]
            _add(coefficients, [(p.unknown, -p.force[i]) for p in pushes if p.unknown is not None])
            if ground:
                coefficients[self.reactions[point][i].symbol] = -ONE
            row = MomentumRow(f"{point}_{axis}", coefficients, sp.Add(*rhs))
            meaning = f"{axis} component of the sum of the loads on {noun}"
            by_loads = self.define(f"R_{point}_{axis}", row.rhs, "N", meaning)
            rows.rows.append(replace(row, shown=_sum(coefficients) - by_loads))
        return rows

    @cached_property
    def reactions(self) -> dict[str, tuple[Quantity, ...]]:
        """Reaction at each ground point, but for rails, whose guides put forces on them that no row tells.

        With cuts of the user, the reactions at the ground points that stay joined decouple, and are left out.
        """
        model = self.model
        if self.cuts:
            return {}
        rails = {g.along for g in self.linkage.guides} & set(model.idle)
        ends = {p for name in rails for p in self.linkage.link(name).base}
        ends |= {p for p in model.points if model.is_fixed(p) and p not in model.ground}
        ends = {s for p in ends for s in model.supports(p)}
        return {
            p: self.unknown_force(f"{p}_reaction", f"reaction at {p}")
            for p in self.model.ground
            if p not in ends
        }

    def constraints(self) -> Iterator[MomentumRows]:
        """Eqs. (11), (14) for lengths, second rates of (16b) for guides and of the other constraints."""
        model = self.model
        guides = {row.constraint.name for row in model.guides}
        free = [(q.symbol, a.symbol) for p in model.free for q, a in zip(model.q[p], model.a[p], strict=True)]
        for c, row, rhs in zip(model.constraints, model.jacobian, model.acceleration_rhs, strict=True):
            last = c.name in self.tree.inner and len(self.tree.outboard(c.name)[0]) == 1
            length = "Attia (11), (14)" if last else "Attia (14)"
            source = length if c.link else "second rate of Attia (16b)" if c.name in guides else NO_SOURCE
            unit = {"m^2": "m^2/s^2", "m": "m/s^2"}[c.unit]
            coefficients = {a: row[q] for q, a in free if q in row}
            name = f"{c.name}_length" if c.link else c.name
            yield MomentumRows(
                name, unit, f"{c.label}, twice differentiated", source, [MomentumRow(name, coefficients, rhs)]
            )

    def closures(self) -> Iterator[MomentumRows]:
        """Yield the constraint of each cut of the user, twice differentiated."""
        model = self.model
        for cut in self.cuts:
            rows = MomentumRows(
                f"{cut.link}_{cut.point}_closure",
                "m/s^2",
                f"acceleration of {cut.link} where it is cut at {cut.point}, less that of {cut.point}",
                "Attia, section 3",
            )
            sides = zip(model.position(cut.own), model.position(cut.point), strict=True)
            for axis, (own, joint) in zip(model.axes, sides, strict=True):
                coefficients: Coefficients = {}
                for side, sign in ((own, 1), (joint, -1)):
                    slopes = model.calculus.gradient(side)
                    _add(coefficients, ((model.acceleration_of[q], sign * k) for q, k in slopes.items()))
                rows.rows.append(MomentumRow(f"{rows.name}_{axis}", coefficients, ZERO))
            yield rows

    # --- together -----------------------------------------------------------------------------------------

    def system(self) -> System:
        """Return all rows, and the square system they make."""
        model = self.model
        parts = [self.moments(body) for body in self.tree.inner]
        parts += [r for p in (*self.tree.roots, *self.reactions) if (r := self.momentum(p)) is not None]
        parts += [*self.constraints(), *self.closures()]
        rows = [row for part in parts for row in part.rows]
        appearing = {s for row in rows for s in row.coefficients}
        unknowns = [a for p in model.free for a in model.a[p]]
        unknowns += [x for force in self.cut_forces.values() for x in force]
        unknowns += [model.multipliers[c.name] for c in self.forced]
        unknowns += [x for force in self.reactions.values() for x in force if x.symbol in appearing]
        if len(rows) != len(unknowns):
            raise DerivationError(
                f"{self.linkage.name}: {len(rows)} momentum rows and constraints for {len(unknowns)} unknowns"
            )
        symbols, names = [x.symbol for x in unknowns], [row.name for row in rows]
        matrices = [self._shown(part) for part in parts]
        matrices += [
            named(
                model,
                "matrix",
                [row.coefficients.get(s, ZERO) for row in rows for s in symbols],
                "kg, kg*m, 1, m",
                "matrix A of all rows, A x = b",
                rows=names,
                columns=[x.name for x in unknowns],
            ),
            named(model, "rhs", self._rhs(rows), "N, N*m, m/s^2, m^2/s^2", "right-hand side b", rows=names),
        ]
        definitions = (*model.calculus.definitions, *self.definitions.values())
        return System(
            name=self.linkage.name,
            title=f"{self.linkage.title}: momentum rows",
            groups=tuple(
                replace(g, quantities=tuple(map(self._at_its_cut, g.quantities)))
                for g in (
                    *motion_groups(model),
                    Group("p", "tunable parameters", tuple(p.quantity for p in self.linkage.parameters)),
                    Group("x", "accelerations, forces at cuts, multipliers, reactions", tuple(unknowns)),
                )
            ),
            matrices=tuple(matrices),
            exports=(),
            definitions=tuple(replace(d, expression=d.expression.xreplace(model.held)) for d in definitions),
            references=(REFERENCE,),
            sources=(("*", "Attia (12)-(16)"),),
        )

    def _at_its_cut(self, x: Quantity) -> Quantity:
        """Return a quantity whose description names the link where it means the particle of a cut link."""
        for cut in self.cuts:
            if x.description.endswith(f" of {cut.own}"):
                about = f"{x.description.removesuffix(cut.own)}{cut.link} where it is cut at {cut.point}"
                return replace(x, description=about)
        return x

    def _shown(self, part: MomentumRows) -> NamedMatrix:
        entries = [_sum(row.coefficients) - row.rhs if row.shown is None else row.shown for row in part.rows]
        rows = [row.name for row in part.rows]
        shown = named(self.model, part.name, entries, part.unit, f"{part.description}; zero", rows=rows)
        return replace(shown, source=part.source, left=ZERO)

    def _rhs(self, rows: list[MomentumRow]) -> list[sp.Expr]:
        """Return the right-hand sides, minus the terms of the prescribed acceleration of the ground."""
        ground = [a.symbol for p in self.model.ground for a in self.model.a[p]]
        return [
            row.rhs - sp.Add(*(row.coefficients[a] * a for a in ground if a in row.coefficients))
            for row in rows
        ]


#: What (12), (13) and (15) leave to the reader, and the numbers of the paper assume.
_AT_JOINTS = ", the masses at a joint are those of both rods"


#: Masses of the particles of a uniform rod, over its mass.
_UNIFORM = [sp.Rational(1, 6), sp.Rational(2, 3), sp.Rational(1, 6)]


def _moment_source(body: str, joint: str, links: Sequence[RigidLink], in_space: bool) -> str:
    """Return the equations of the moments of a body; those of a last one are (9), (10) and (12), (13)."""
    carries = len(links) > 1
    k = "j" if carries else "N"
    remarks = f"; for rod {k} = {body}, particle 2{k}-1 = {joint}"
    of_mass = ([p.mass / x.mass for p in particles(x.mass, x.length, x.centre, x.inertia)] for x in links)
    if all(x.offset == 0 and x.mass != 0 for x in links) and all(m == _UNIFORM for m in of_mass):
        remarks += f"; uniform rod{'s' * carries}: m1 = m/6, m2 = 2 m/3, m3 = m/6"
    if not in_space:
        return f"Attia (12){_AT_JOINTS}{remarks}" if carries else f"Attia (9), (12){remarks}"
    numbers = ("13",) if carries else ("10", "13")
    whole, first, second = (", ".join(f"({n}{letter})" for n in numbers) for letter in ("", "a", "b"))
    remarks += "; u_bar, u_hat of section 2.2 for e in place of z, the axis along which the rod is shortest"
    remarks += f"; u_bar_{body} {first}; u_hat_{body} {second}"
    return f"Attia {whole}, corrected: couples across the rod{remarks}"


def motion_groups(model: RodsModel) -> tuple[Group, ...]:
    """Return the arguments of a motion."""
    return (
        Group("t", "time", (TIME,)),
        Group("q", "coordinates of the free points", tuple(model.coordinates)),
        Group("u", "velocities of the free points", tuple(u for p in model.free for u in model.u[p])),
    )


def _sum(coefficients: Coefficients) -> sp.Expr:
    return sp.Add(*(c * s for s, c in coefficients.items()))


def _difference(a: Vector, b: Vector) -> Vector:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def _turned(lever: Vector, axis: Vector) -> Vector:
    """Return h with h.a = axis.(lever x a) for every a."""
    return (-lever[1], lever[0]) if len(lever) == 2 else moment(axis, lever)


def _add(to: Coefficients, terms: Iterable[tuple[sp.Symbol, sp.Expr]]) -> None:
    for symbol, value in terms:
        if value != 0:
            to[symbol] = to.get(symbol, ZERO) + value
