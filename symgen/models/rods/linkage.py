"""A linkage of rods and planar bodies in point coordinates: the derivation, step by step.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, sections 2.1 to 2.3, in the symmetric
form [M J^T; J 0] [a; lambda] = [f; gamma] with the middle particle of each rod eliminated.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property

import sympy as sp

from symgen.errors import SceneError
from symgen.loads.measure import Gradient
from symgen.mechanics.rods.particles import Vector, end_mass
from symgen.models.rods.constraints import ConstrainedPoints
from symgen.models.rods.drives import Drive
from symgen.models.rods.joint_forces import JointForces
from symgen.scene.rods.linkage import TIME, RigidLink
from symgen.symbolic.calculus import ONE, ZERO, chained, partial
from symgen.symbolic.constants import vanishes
from symgen.symbolic.quantity import Entries, Quantity
from symgen.symbolic.vectors import cross, cross_in_plane, dot

REFERENCE = "H. A. Attia, Dynamic Analysis of a Chain of Rigid Rods, sections 2.1 to 2.3"


#: Largest number of coordinates: matrices have the square of it as entries, of 8 bytes and more.
_COORDINATES = 10_000
#: Pivots of the mass matrix below this part of its diagonal are zero.
_ROUND_OFF = 1e-13


class RodsModel(ConstrainedPoints):
    """Derivation of a linkage: each property is one step, and an input of outputs."""

    def check_size(self) -> None:
        """Raise SceneError where the matrices would take several gigabytes."""
        coordinates = len(self.free) * self.linkage.dimension
        if coordinates > _COORDINATES:
            raise SceneError(
                f"points have {coordinates} coordinates; equations are derived for at most {_COORDINATES}",
                where="points",
                hint="symgen.build_chain(scene) runs open chains and trees of any number of rods.",
            )

    def check_masses(self) -> None:
        """Raise SceneError where a point carries no mass."""
        for point in self.moving:
            mass = self.mass_entries.get((self.q[point][0].symbol,) * 2, ZERO)
            mass = mass.xreplace(self.linkage.constants)
            if mass.is_number and vanishes(mass):
                raise SceneError(
                    f"{point} carries no mass: its acceleration is not determined",
                    where=f"points.{point}",
                    hint=f'Join a link with mass there, or write [[masses]] with point = "{point}".',
                )
        still, lost = [], None
        with suppress(SceneError):  # of numbers beyond the range, which are named later
            still = [k for k in self.rods if not self.linkage.number(k.inertia)]
            lost = self._without_inertia() if still else None
        if lost:
            link = next((k for k in still if lost in k.base), still[0]).name
            raise SceneError(
                f"{link} has no moment of inertia, and the masses that it joins do not replace it: the "
                f"acceleration of {lost} is not determined",
                where=f"links.{link}.inertia",
                hint='Give it mass and inertia, of its real size or small, such as "10 g" and "1e-5 kg*m^2", '
                "or join links with mass at two of its points.",
            )

    def _without_inertia(self) -> str | None:
        """Return a point whose pivot vanishes in the mass matrix at the scene's parameters, or None."""
        owners = {x.symbol: p for p in self.moving for x in self.q[p]}
        rows: dict[sp.Symbol, dict[sp.Symbol, float]] = {x: {} for x in owners}
        for (x, y), mass in self.mass_entries.items():
            if x in owners and y in owners:
                rows[x][y] = self.linkage.number(mass)
        whole = {x: row[x] for x, row in rows.items()}
        for x, row in rows.items():
            pivot = row.pop(x)
            if pivot <= _ROUND_OFF * whole[x]:
                return owners[x]
            for y, left in row.items():
                del rows[y][x]
                for z, right in row.items():
                    rows[y][z] = rows[y].get(z, 0.0) - left * right / pivot
        return None

    @cached_property
    def inertias(self) -> dict[tuple[str, str, str], sp.Expr]:
        """Masses of the kinetic energy: by two points, and ``dot`` or ``cross`` of their velocities [kg]."""
        sums: dict[tuple[str, str, str], list[sp.Expr]] = {}

        def add(a: str, b: str, kind: str, mass: sp.Expr) -> None:
            if mass != 0:
                sums.setdefault((a, b, kind), []).append(mass)

        for k in self.massive:
            parts = [end_mass(k.mass, k.length, k.centre, k.inertia, k.offset)]
            for point, mass in self.joint_masses(k):
                add(point.name, point.name, "dot", mass)
                at = (k.length, point.along * k.length, ZERO, point.across * k.length)
                parts.append(end_mass(-mass, *at))
            add(k.start, k.start, "dot", sp.Add(*(x.a11 for x in parts)))
            add(k.start, k.end, "dot", sp.Add(*(x.a12 for x in parts)))
            add(k.end, k.end, "dot", sp.Add(*(x.a22 for x in parts)))
            add(k.start, k.end, "cross", -sp.Add(*(x.cross for x in parts)))
        for body in self.linkage.bodies:
            for i, a in enumerate(body.base):
                for j, b in enumerate(body.base[i:], i):
                    add(a, b, "dot", body.masses[i][j])
        for m in self.linkage.masses:
            add(m.point, m.point, "dot", m.mass)
        return {between: sp.Add(*masses) for between, masses in sums.items()}

    @cached_property
    def mass_entries(self) -> dict[tuple[sp.Symbol, sp.Symbol], sp.Expr]:
        """Mass matrix by pairs of coordinates [kg]: the Hessian of the kinetic energy, without zeros."""
        entries: dict[tuple[sp.Symbol, sp.Symbol], list[sp.Expr]] = {}
        for (a, b, kind), mass in self.inertias.items():
            rows, columns = ([self.calculus.gradient(c) for c in self.position(p)] for p in (a, b))
            products = (
                [(r, c, mass) for r, c in zip(rows, columns, strict=True)]
                if kind == "dot"
                else [(rows[0], columns[1], mass), (rows[1], columns[0], -mass)]
            )
            for left, right, weight in products:
                for x, slope_x in left.items():
                    for y, slope_y in right.items():
                        value = sp.Mul(weight, slope_x, slope_y)
                        entries.setdefault((x, y), []).append(value)
                        if a != b:
                            entries.setdefault((y, x), []).append(value)
        for state in self.linkage.states:  # of mass 1, without kinetic energy
            (x,) = self.symbols(self.q[state.name])
            entries[x, x] = [ONE]
        return {pair: sp.Add(*values) for pair, values in entries.items()}

    @cached_property
    def mass_rows(self) -> dict[sp.Symbol, Gradient]:
        """Rows of the mass matrix by coordinate, ground included [kg]; nonzero entries only."""
        rows: dict[sp.Symbol, Gradient] = {}
        for (a, b), mass in self.mass_entries.items():
            rows.setdefault(a, {})[b] = mass
        return rows

    @cached_property
    def kinetic_energy(self) -> sp.Expr:
        """Kinetic energy [J]."""
        terms = []
        for (a, b, kind), mass in self.inertias.items():
            product = (dot if kind == "dot" else cross_in_plane)(self.velocity(a), self.velocity(b))
            terms.append(sp.Mul(sp.S.Half if a == b else ONE, mass, product))
        return sp.Add(*terms)

    @cached_property
    def momenta(self) -> list[tuple[str, Vector]]:
        """Derivative of the kinetic energy by the velocity of each point that carries mass [kg m/s]."""
        terms: dict[str, list[Vector]] = {}
        for (a, b, kind), mass in self.inertias.items():
            va, vb = self.velocity(a), self.velocity(b)
            pairs = [(a, vb)] if a == b else [(a, vb), (b, va)]
            if kind == "cross":
                pairs = [(a, (vb[1], -vb[0])), (b, (-va[1], va[0]))]
            for point, velocity in pairs:
                terms.setdefault(point, []).append(tuple(mass * c for c in velocity))
        return [(p, tuple(sp.Add(*c) for c in zip(*each, strict=True))) for p, each in terms.items()]

    def angular_velocity(self, link: str) -> Vector:
        """Return the angular velocity of a link in space [rad/s]: for a rod d x d'/l^2, without spin."""
        body = self.linkage.body(link)
        rate = self.calculus.rate
        if body is None:
            d, squared = self.along[link], self.linkage.link(link).length ** 2
            return tuple(c / squared for c in cross(d, tuple(rate(c) for c in d)))
        pairs = zip(self.loads.reciprocal(body), self.loads.edges(body), strict=True)
        turns = [cross(partner, tuple(rate(c) for c in edge)) for partner, edge in pairs]
        return tuple(sp.Add(*c) / 2 for c in zip(*turns, strict=True))

    @cached_property
    def joint_forces(self) -> JointForces:
        """Forces on the links at their points."""
        return JointForces(self)

    @property
    def potential_energy(self) -> sp.Expr:
        """Potential of gravity and springs [J]."""
        return sp.Add(self.loads.potential, *self.loads.wound)

    @cached_property
    def force(self) -> Gradient:
        """Force on every coordinate [N]: minus the gradient of the potential, plus the other loads."""
        parts = [(-ONE, self.calculus.gradient(self.loads.potential))]
        parts += [(force, slopes) for force, slopes, _ in (*self.loads.others, *self.loads.conservative)]
        integrals = (self.q[s.name][0].symbol for s in self.linkage.states)
        return chained(parts) | dict(zip(integrals, self.state_rates, strict=True))

    @cached_property
    def state_rates(self) -> Vector:
        """Rates of the first-order states."""
        return self.loads.with_state([s.rate for s in self.linkage.states])

    @cached_property
    def power(self) -> sp.Expr:
        """Power of the loads without potential, of drives and of the moving ground [W]."""
        terms = [force * rate for force, _, rate in self.loads.others]
        terms += [
            self.multipliers[row.name].symbol * partial(row.expression, TIME.symbol)
            for row in self.constraints
            if TIME.symbol in row.expression.free_symbols
        ]
        for point in self.ground:
            velocity = [self.held[s] for s in self.symbols(self.u[point])]
            terms.append(dot(tuple(velocity), self.residual(point)) if any(velocity) else ZERO)
        return sp.Add(*terms)

    def effort(self, drive: Drive) -> sp.Expr:
        """Return the torque [N m] or force [N] of a drive with a constraint on the linkage."""
        return -(self._row_force(drive.row) * drive.lever)

    @cached_property
    def outputs_of_drives(self) -> dict[str, dict[str, Entries]]:
        """Outputs of drives by link and word; of a link with two drives the power is that of both."""
        known: dict[str, dict[str, Entries]] = {}
        for drive in (drive for drive in self.drives if drive.row):
            outputs, others = drive.outputs(self.effort(drive)), known.setdefault(drive.owner, {})
            if "power" in others:
                (first,), (second,) = others["power"][0], outputs["power"][0]
                outputs["power"] = [first + second], "W", f"power of the drives of {drive.owner}"
            others.update(outputs)
        return known

    def tension(self, rod: RigidLink) -> sp.Expr:
        """Return the force of the length constraint of a rod, tension positive [N]."""
        return self._row_force(rod.name) * rod.length

    def _row_force(self, name: str) -> sp.Expr:
        """Return the multiplier of a row; of a rod with what bodies on two of its points leave to it."""
        rod, multiplier = self.rod(name), self.multipliers[name].symbol
        return multiplier + self.joint_forces.tension(rod) if rod else multiplier

    @cached_property
    def jacobian(self) -> list[Gradient]:
        """Rows of the constraint Jacobian by coordinate, ground included; nonzero entries only."""
        return [
            c.motion.gradient if c.motion else self.calculus.gradient(c.expression) for c in self.constraints
        ]

    @cached_property
    def constraint_rates(self) -> list[sp.Expr]:
        """Rates of the constraint rows."""
        return [c.motion.rate if c.motion else self.calculus.rate(c.expression) for c in self.constraints]

    @cached_property
    def acceleration_rhs(self) -> list[sp.Expr]:
        """Right-hand side gamma of J a = gamma: minus the velocity and ground terms of the second rate."""
        second = [
            c.motion.second_rate if c.motion else self.calculus.rate(rate)
            for c, rate in zip(self.constraints, self.constraint_rates, strict=True)
        ]
        ground = [
            (q, a)
            for p in self.ground
            for q, a in zip(self.q[p], self.a[p], strict=True)
            if self.held[a.symbol] != 0
        ]
        of_ground = (
            [sp.Mul(-ONE, row[q.symbol], a.symbol) for q, a in ground if q.symbol in row]
            for row in self.jacobian
        )
        return [
            -acceleration if not of else sp.Add(-acceleration, *of)
            for acceleration, of in zip(second, of_ground, strict=True)
        ]

    @cached_property
    def applied(self) -> list[sp.Expr]:
        """Force on the free coordinates, minus the force for the acceleration of the ground [N]."""
        driven = self._of_ground(self.a)
        return [self.force.get(x.symbol, ZERO) - f for x, f in zip(self.coordinates, driven, strict=True)]

    @cached_property
    def start_momentum(self) -> list[sp.Expr]:
        """Momentum on the free coordinates by the velocity of the ground alone [kg m/s]."""
        return self._of_ground(self.u)

    def _of_ground(self, rates: Mapping[str, tuple[Quantity, ...]]) -> list[sp.Expr]:
        """Return the rows of the mass matrix of the free coordinates times ``rates`` of the ground."""
        driven = {
            q.symbol: value
            for p in self.ground
            for q, x in zip(self.q[p], rates[p], strict=True)
            if (value := self.held[x.symbol]) != 0
        }
        return [
            sp.Add(*(m * driven[q] for q, m in self.mass_rows.get(x.symbol, {}).items() if q in driven))
            for x in self.coordinates
        ]

    @cached_property
    def balance(self) -> list[sp.Expr]:
        """Applied forces minus mass times acceleration, f - M a [N], which the constraints balance."""
        q = [x.symbol for x in self.coordinates]
        free = set(q)
        return [
            f
            - sp.Add(
                *(m * self.acceleration_of[r] for r, m in self.mass_rows.get(s, {}).items() if r in free)
            )
            for s, f in zip(q, self.applied, strict=True)
        ]

    def residual(self, point: str) -> Vector:
        """Return M a + J^T lambda - f at a point's rows [N]: the reaction of its pin."""
        result = []
        for coordinate in self.symbols(self.q[point]):
            balanced = sp.Add(self._inertia(coordinate), *self.constraint_forces(coordinate))
            result.append(balanced - self.force.get(coordinate, ZERO))
        return tuple(result)

    @cached_property
    def on_ground(self) -> list[tuple[str, Vector]]:
        """Weight and loads from outside less mass times acceleration, at each point with coordinates [N].

        By Newton's laws of the whole linkage, springs and drives on the ground included, the sums of these
        forces and of their moments are the force and the moment that it exerts on the ground.
        """
        outside = chained(self.loads.from_outside)
        return [
            (point, tuple(outside.get(q, ZERO) - self._inertia(q) for q in self.symbols(coordinates)))
            for point, coordinates in self.q.items()
            if point not in self.free[len(self.moving) :]
        ]

    def _inertia(self, coordinate: sp.Symbol) -> sp.Expr:
        """Return mass times acceleration on a coordinate, ground included [N]."""
        masses = self.mass_rows.get(coordinate, {})
        return sp.Add(*(sp.Mul(m, self.acceleration_of[q]) for q, m in masses.items()))

    def second_rate(self, expression: sp.Expr) -> sp.Expr:
        """Return the second time derivative, accelerations included."""
        rate, slopes = self.calculus.rate, self.calculus.gradient(expression)
        return sp.Add(rate(rate(expression)), *(v * self.acceleration_of[q] for q, v in slopes.items()))

    def constraint_forces(self, coordinate: sp.Symbol) -> list[sp.Expr]:
        """Return the terms of J^T lambda on a coordinate [N]."""
        return [sp.Mul(slope, multiplier.symbol) for slope, multiplier in self._columns.get(coordinate, ())]

    @cached_property
    def _columns(self) -> dict[sp.Symbol, list[tuple[sp.Expr, Quantity]]]:
        """Columns of the constraint Jacobian, ground included: entries with the multipliers of their rows."""
        columns: dict[sp.Symbol, list[tuple[sp.Expr, Quantity]]] = {}
        for c, row in zip(self.constraints, self.jacobian, strict=True):
            for q, slope in row.items():
                columns.setdefault(q, []).append((slope, self.multipliers[c.name]))
        return columns

    def reaction(self, point: str) -> Vector:
        """Return the force of the ground at a ground point [N].

        For a body held at two ground points the parts along their line are equal: the minimum norm.
        """
        evened = self.joint_forces.by_ground(point) if self.linkage.bodies else (ZERO,) * len(self.axes)
        return tuple(sp.Add(*c) for c in zip(self.residual(point), evened, strict=True))

    def own_output(self, name: str) -> Entries | None:
        """Return scalars, unit and description of an output of no point or link; None for others."""
        for state, rate in zip(self.linkage.states, self.state_rates, strict=True):
            (integral,), (value,), (slope,) = (of[state.name] for of in (self.q, self.u, self.a))
            known = {state.name: value, f"{state.name}.integral": integral}
            if name in known:
                return [known[name].symbol], known[name].unit, known[name].description
            if name == f"{state.name}.rate":
                return [rate], slope.unit, slope.description
        return None

    def rod(self, name: str) -> RigidLink | None:
        """Return the moving link of this name, if there is one."""
        return next((k for k in self.rods if k.name == name), None)
