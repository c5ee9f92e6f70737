"""A linkage of rods as a System: point coordinates, Lagrange multipliers, only what the scene asks for.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, sections 2.1 to 2.3, in the symmetric
form [M J^T; J 0] [a; lambda] = [f; gamma] with the middle particle of each rod eliminated.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import sympy as sp

from symgen.errors import SceneError
from symgen.mechanics import loads
from symgen.mechanics.particles import Vector, dot, end_mass, length_constraint
from symgen.mechanics.topology import Tree, elimination_order, spanning_tree
from symgen.models import outputs
from symgen.models.start import start_exports
from symgen.scene.linkage import TIME, Linkage, Rod
from symgen.symbolic.calculus import ZERO, Calculus
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Export, Group, NamedMatrix, SaddlePoint, System

REFERENCE = "H. A. Attia, Dynamic Analysis of a Chain of Rigid Rods, sections 2.1 to 2.3"


def linkage_system(linkage: Linkage) -> System:
    """Return the System of a linkage.

    Raises
    ------
    SceneError
        When an output is asked for that the linkage does not have.
    """
    try:
        return RodsModel(linkage).system()
    except SceneError as error:
        raise error.located(file=linkage.file) from None


class RodsModel:
    """The derivation, step by step; each property is one step and what outputs are made from.

    All points, ground included, have coordinates while deriving, so that the reaction at a ground point is
    simply the residual of its row; the ground's known motion is put in at the end.
    """

    def __init__(self, linkage: Linkage) -> None:
        self.linkage = linkage
        self.axes = loads.AXES[: linkage.dimension]
        self.moving = [p.name for p in linkage.points if not p.ground]
        self.ground = [p.name for p in linkage.points if p.ground]
        names = [*self.moving, *self.ground]
        self.q = self._per_point(names, "_", "m", "position")
        self.u = self._per_point(names, "_v", "m/s", "velocity")
        self.a = self._per_point(names, "_a", "m/s^2", "acceleration")
        self.calculus = Calculus(
            [x for p in names for x in self.q[p]], [x for p in names for x in self.u[p]], TIME.symbol
        )
        ends = {r.name: (r.start, r.end) for r in linkage.rods}
        fixed = set(self.ground)
        self.rods = [r for r in linkage.rods if not {r.start, r.end} <= fixed]
        self.idle = [r.name for r in linkage.rods if {r.start, r.end} <= fixed]
        self.multiplier = {
            r.name: quantity(
                f"{r.name}_lambda", "N/m", f"multiplier of the length of {r.name}; times length: tension"
            )
            for r in self.rods
        }
        self.tree: Tree = spanning_tree(self.ground, self.moving, {r.name: ends[r.name] for r in self.rods})

    def _per_point(
        self, names: Sequence[str], infix: str, unit: str, what: str
    ) -> dict[str, tuple[Quantity, ...]]:
        return {
            p: tuple(quantity(f"{p}{infix}{axis}", unit, f"{axis} {what} of {p}") for axis in self.axes)
            for p in names
        }

    @staticmethod
    def symbols(quantities: Sequence[Quantity]) -> Vector:
        """Return the bare symbols."""
        return tuple(x.symbol for x in quantities)

    @cached_property
    def held(self) -> dict[sp.Symbol, sp.Expr]:
        """Known motion of the ground points: where they are drawn, at rest."""
        known: dict[sp.Symbol, sp.Expr] = {}
        for name in self.ground:
            known.update(zip(self.symbols(self.q[name]), self.linkage.point(name).at, strict=True))
            known.update((s, ZERO) for s in self.symbols(self.u[name] + self.a[name]))
        return known

    @cached_property
    def along(self) -> dict[str, Vector]:
        """Vector along each rod, from its start to its end [m]."""
        return {
            r.name: loads.vector_between(
                self.calculus, r.name, self.symbols(self.q[r.start]), self.symbols(self.q[r.end])
            )
            for r in self.rods
        }

    @cached_property
    def masses(self) -> dict[tuple[str, str], sp.Expr]:
        """Mass matrix by pairs of points [kg], equal for each axis; pairs without coupling left out.

        It is the Hessian of the kinetic energy by the velocities: the sum of the rods' end masses.
        """
        entries: dict[tuple[str, str], sp.Expr] = {}
        parts = [((m.point, m.point), m.mass) for m in self.linkage.masses]
        for r in self.rods:
            ends = end_mass(r.mass, r.length, r.centre, r.inertia)
            parts += [
                ((r.start, r.start), ends.a11),
                ((r.start, r.end), ends.a12),
                ((r.end, r.start), ends.a12),
                ((r.end, r.end), ends.a22),
            ]
        for pair, mass in parts:
            entries[pair] = entries.get(pair, ZERO) + mass
        return entries

    @cached_property
    def kinetic_energy(self) -> sp.Expr:
        """Half u^T M u over the moving points [J]."""
        terms = []
        for (a, b), mass in self.masses.items():
            if a in self.moving and b in self.moving and self.moving.index(a) <= self.moving.index(b):
                product = dot(self.symbols(self.u[a]), self.symbols(self.u[b]))
                terms.append(mass * product / (2 if a == b else 1))
        return sp.Add(*terms)

    @cached_property
    def spring_lengths(self) -> dict[str, sp.Expr]:
        """Present length of each spring [m]."""
        lengths = {}
        for spring in self.linkage.springs:
            ends = (self.symbols(self.q[p]) for p in (spring.start, spring.end))
            lengths[spring.name] = loads.distance(
                self.calculus, spring.name, loads.vector_between(self.calculus, spring.name, *ends)
            )
        return lengths

    @cached_property
    def potential_energy(self) -> sp.Expr:
        """Potential of gravity and springs [J]."""
        terms = []
        weights: dict[str, sp.Expr] = {}
        for rod in self.rods:
            share = rod.mass * rod.centre / rod.length
            for point, mass in ((rod.start, rod.mass - share), (rod.end, share)):
                weights[point] = weights.get(point, ZERO) + mass
        for mass in self.linkage.masses:
            weights[mass.point] = weights.get(mass.point, ZERO) + mass.mass
        for point, weight in weights.items():
            terms.append(loads.weight_potential(weight, self.linkage.gravity, self.symbols(self.q[point])))
        for spring in self.linkage.springs:
            terms.append(
                loads.spring_potential(spring.stiffness, spring.length, self.spring_lengths[spring.name])
            )
        return sp.Add(*terms)

    @cached_property
    def force(self) -> dict[sp.Symbol, sp.Expr]:
        """Generalized force on every coordinate [N]: minus the gradient of the potential, plus the rest."""
        parts: dict[sp.Symbol, list[sp.Expr]] = {}
        for q, slope in self.calculus.gradient(self.potential_energy).items():
            parts.setdefault(q, []).append(-slope)
        for load in self.linkage.forces:
            for q, component in zip(self.symbols(self.q[load.point]), load.force, strict=True):
                parts.setdefault(q, []).append(component)
        for spring in self.linkage.springs:
            if spring.damping != 0:
                length = self.spring_lengths[spring.name]
                pull = -spring.damping * self.calculus.rate(length)
                for q, slope in self.calculus.gradient(length).items():
                    parts.setdefault(q, []).append(pull * slope)
        return {q: sp.Add(*terms) for q, terms in parts.items()}

    @cached_property
    def power(self) -> sp.Expr:
        """Power of the loads that have no potential [W]."""
        terms = [dot(load.force, self.symbols(self.u[load.point])) for load in self.linkage.forces]
        for spring in self.linkage.springs:
            terms.append(-spring.damping * self.calculus.rate(self.spring_lengths[spring.name]) ** 2)
        return sp.Add(*terms)

    @cached_property
    def constraints(self) -> list[sp.Expr]:
        """Length constraint of every rod, Eq. (3a) halved [m^2]."""
        return [length_constraint(self.along[r.name], r.length) for r in self.rods]

    @cached_property
    def jacobian(self) -> list[dict[sp.Symbol, sp.Expr]]:
        """Rows of the constraint Jacobian by coordinate [m]; zero entries left out."""
        return [self.calculus.gradient(phi) for phi in self.constraints]

    def residual(self, point: str) -> Vector:
        """Return the residual M a + J^T lambda - f of a point's rows [N]: the force its pin must supply."""
        result = []
        for axis, q in enumerate(self.q[point]):
            terms = [
                self.masses.get((point, other), ZERO) * self.a[other][axis].symbol
                for other in (*self.moving, *self.ground)
            ]
            terms += [
                row.get(q.symbol, ZERO) * self.multiplier[r.name].symbol
                for r, row in zip(self.rods, self.jacobian, strict=True)
            ]
            result.append(sp.Add(*terms) - self.force.get(q.symbol, ZERO))
        return tuple(result)

    def matrix(
        self,
        name: str,
        entries: Sequence[sp.Expr],
        unit: str,
        description: str,
        *,
        rows: Sequence[str] = (),
        columns: Sequence[str] = (),
        symmetric: bool = False,
    ) -> NamedMatrix:
        """Return a NamedMatrix with the ground's motion put in; ``entries`` row by row."""
        width = max(1, len(columns))
        filled = sp.ImmutableMatrix(len(entries) // width, width, [e.xreplace(self.held) for e in entries])
        return NamedMatrix(name, filled, unit, description, tuple(rows), tuple(columns), symmetric)

    def system(self) -> System:
        """Put the steps together."""
        q = [x for p in self.moving for x in self.q[p]]
        u = [x for p in self.moving for x in self.u[p]]
        solution = [x for p in self.moving for x in self.a[p]] + [self.multiplier[r.name] for r in self.rods]
        equations = self._equations([x.symbol for x in q])
        asked = outputs.asked(self)
        start, exports = start_exports(self)
        points = [*self._kinematics(), *self._reactions()]
        exports = [
            *self._exports(),
            Export("outputs", "what the scene asks to record", tuple(m.name for m in asked)),
            *exports,
        ]
        definitions = tuple(
            type(d)(d.quantity, d.expression.xreplace(self.held)) for d in self.calculus.definitions
        )
        return System(
            name=self.linkage.name,
            title=self.linkage.title,
            groups=(
                Group("t", "time", (TIME,)),
                Group("q", "coordinates of the moving points", tuple(q)),
                Group("u", "velocities of the moving points", tuple(u)),
                Group("p", "tunable parameters", tuple(p.quantity for p in self.linkage.parameters)),
                Group(
                    "work",
                    "accelerations and multipliers, as the kernel 'accelerations' wrote them",
                    tuple(solution),
                ),
            ),
            matrices=(*equations, *points, *asked, *start),
            exports=tuple(exports),
            definitions=definitions,
            saddle_point=SaddlePoint(
                "mass_matrix", "constraint_jacobian", "force", "acceleration_rhs", self._order(len(q))
            ),
            references=(REFERENCE,),
            left_out=tuple(
                f"link {name}: both ends are ground, so it neither moves nor loads anything"
                for name in self.idle
            ),
        )

    def _order(self, coordinates: int) -> tuple[int, ...]:
        d = len(self.axes)
        at = {p: range(i * d, i * d + d) for i, p in enumerate(self.moving)}
        multipliers = {r.name: coordinates + i for i, r in enumerate(self.rods)}
        return elimination_order(self.tree, at, multipliers, coordinates + len(self.rods))

    def _equations(self, q: list[sp.Symbol]) -> list[NamedMatrix]:
        names, rods = [s.name for s in q], [r.name for r in self.rods]
        rate = self.calculus.rate
        energies = [
            self.matrix("kinetic_energy", [self.kinetic_energy], "J", "kinetic energy"),
            self.matrix("potential_energy", [self.potential_energy], "J", "potential of gravity and springs"),
        ]
        if self.power != 0:
            energies.append(self.matrix("power", [self.power], "W", "power of the loads without potential"))
        return [
            self.matrix(
                "mass_matrix",
                [
                    self.masses.get((a, b), ZERO) if i == k else ZERO
                    for a in self.moving
                    for i in range(len(self.axes))
                    for b in self.moving
                    for k in range(len(self.axes))
                ],
                "kg",
                "mass matrix of the moving points, M",
                rows=names,
                columns=names,
                symmetric=True,
            ),
            self.matrix("force", [self.force.get(s, ZERO) for s in q], "N", "applied forces, f", rows=names),
            self.matrix("constraints", self.constraints, "m^2", "rod lengths (d.d - l^2)/2, Phi", rows=rods),
            self.matrix(
                "constraint_scale",
                [r.length for r in self.rods],
                "m",
                "rod lengths; a constraint over its scale is the error of a length",
                rows=rods,
            ),
            self.matrix(
                "constraint_jacobian",
                [row.get(s, ZERO) for row in self.jacobian for s in q],
                "m",
                "constraint Jacobian, J",
                rows=rods,
                columns=names,
            ),
            self.matrix(
                "velocity_constraints",
                [rate(c) for c in self.constraints],
                "m^2/s",
                "rate of Phi, J u",
                rows=rods,
            ),
            self.matrix(
                "acceleration_rhs",
                [-rate(rate(c)) for c in self.constraints],
                "m^2/s^2",
                "right-hand side gamma of J a = gamma",
                rows=rods,
            ),
            *energies,
        ]

    def _kinematics(self) -> list[NamedMatrix]:
        points = [p.name for p in self.linkage.points]
        return [
            self.matrix(
                name,
                [s for p in points for s in self.symbols(source[p])],
                unit,
                f"{name} of all points",
                rows=points,
                columns=self.axes,
            )
            for name, source, unit in (("positions", self.q, "m"), ("velocities", self.u, "m/s"))
        ]

    def _reactions(self) -> list[NamedMatrix]:
        if not self.ground:
            return []
        entries = [component for p in self.ground for component in self.residual(p)]
        return [
            self.matrix(
                "reactions",
                entries,
                "N",
                "force of the ground on the linkage at each ground point",
                rows=self.ground,
                columns=self.axes,
            )
        ]

    def _exports(self) -> list[Export]:
        energies = ("kinetic_energy", "potential_energy") + (("power",) if self.power != 0 else ())
        exports = [
            Export("energy", "kinetic and potential energy", energies),
            Export("points", "position and velocity of all points", ("positions", "velocities")),
        ]
        if self.rods:
            exports += [
                Export("constraints", "constraints and their scale", ("constraints", "constraint_scale")),
                Export("velocity_constraints", "rate of the constraints", ("velocity_constraints",)),
                Export("constraint_jacobian", "constraint Jacobian", ("constraint_jacobian",)),
            ]
        if self.ground:
            exports.append(Export("reactions", "reactions at the ground points", ("reactions",)))
        return exports

    def rod(self, name: str) -> Rod | None:
        """Return the moving rod of this name, if there is one."""
        return next((r for r in self.rods if r.name == name), None)
