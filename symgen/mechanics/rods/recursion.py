"""One rod of a chain eliminated in closed form: the O(N) solution of open chains and trees.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, sections 2.1 and 2.2 (end masses and length
constraint, Eqs. (3a) and (4b)); block elimination of their symmetric system, leaves to root.

A rod joins an inner point p and an outer point c, d = r_c - r_p. After the elimination of all rods outboard
of c, its own equations are, with the mass matrix S and the load b gathered at c,

    S a_c + a12 a_p + d lambda = b        motion of the outer point
    d . (a_c - a_p)            = gamma    length, differentiated twice
    a12 a_c - d lambda         = contribution of the rod to the rows of the inner point.

With t = adj(S) d, det = det S and pivot = d . t, the bordered matrix [S d; d^T 0] has the determinant -pivot,
and Schur elimination of a_c and lambda adds to the inner point, with e = a12 t + det d,

    S_p += -a12^2 adj(S)/det + e e^T/(det pivot)
    b_p += -a12 adj(S) b/det + e (t . b - det gamma)/(det pivot).

S starts from the constant mass of a point, and the contribution of a rod is bounded below by minus the a11 of
that rod: S stays positive definite, det and pivot positive, in any configuration. There is one division,
by det times pivot, and no choice of pivots. The outward pass is lambda = (t . b - det gamma - e . a_p)/pivot
and S a_c = b - a12 a_p - d lambda.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.errors import DerivationError
from symgen.mechanics.rods.particles import end_mass, kinetic_energy, length_constraint
from symgen.mechanics.sources import CHAIN
from symgen.symbolic.calculus import Calculus
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import AXES, Quantity, quantity
from symgen.symbolic.system import Definition, Group, NamedMatrix, System
from symgen.symbolic.vectors import dot

REFERENCE = (
    "H. A. Attia, Dynamic Analysis of a Chain of Rigid Rods, sections 2.1 and 2.2, "
    "with block elimination from the leaves to the root"
)


@dataclass(frozen=True, slots=True)
class Recursion:
    """Steps of an algorithm that loops over the rods of a chain, each a System.

    The groups of a step are its inputs at one rod or point, its matrices the outputs there; a matrix whose
    name begins with ``add_`` is added to the existing values.
    """

    name: str
    title: str
    dimension: int
    steps: tuple[System, ...]
    references: tuple[str, ...] = (REFERENCE,)

    def step(self, name: str) -> System:
        """Return the step called ``name``."""
        return next(s for s in self.steps if s.name == name)


def chain_recursion(dimension: int) -> Recursion:
    """Return the recursion over the rods of an open chain or tree, in the plane (2) or in space (3)."""
    axes = _Axes(dimension)
    return Recursion(
        name="chain" if dimension == 2 else "chain_spatial",
        title=f"Chain or tree of rigid rods {'in the plane' if dimension == 2 else 'in space'}",
        dimension=dimension,
        steps=(
            _ends(),
            _length(axes),
            _gather(axes),
            _inward(axes),
            _free(axes),
            _pinned(axes),
            _outward(axes),
            _unloaded(axes),
            _rest(axes),
        ),
    )


class _Axes:
    """Symbols of vectors and symmetric matrices, by the axes of the plane or of space."""

    def __init__(self, dimension: int) -> None:
        self.names = AXES[:dimension]
        self.pairs = [(i, j) for i in range(dimension) for j in range(i, dimension)]

    def vector(self, name: str, unit: str, meaning: str) -> tuple[Quantity, ...]:
        return tuple(quantity(f"{name}_{a}", unit, f"{a} component of {meaning}") for a in self.names)

    def symmetric(self, name: str, unit: str, meaning: str) -> tuple[Quantity, ...]:
        a = self.names
        return tuple(
            quantity(f"{name}_{a[i]}{a[j]}", unit, f"{a[i]}{a[j]} entry of {meaning}") for i, j in self.pairs
        )

    def matrix(self, entries: Sequence[Quantity]) -> sp.Matrix:
        known = {pair: x.symbol for pair, x in zip(self.pairs, entries, strict=True)}
        n = len(self.names)
        return sp.Matrix(n, n, lambda i, j: known[min(i, j), max(i, j)])

    def upper(self, matrix: sp.Matrix) -> list[sp.Expr]:
        return [matrix[i, j] for i, j in self.pairs]


_MASS = quantity("mass", "kg", "mass at a point: a22 of its rod, a11 of the rods it carries, point masses")
_A12 = quantity("a12", "kg", "mass that couples the ends of the rod")
_GAMMA = quantity("gamma", "m^2/s^2", "right side of the length row d . (a_c - a_p) = gamma")
_LAMBDA = quantity("lam", "N/m", "multiplier of the length: its force over the length, positive in tension")


def _here(axes: _Axes) -> tuple[tuple[Quantity, ...], tuple[Quantity, ...], Group]:
    mass = axes.symmetric("s", "kg", "the mass matrix gathered at the point")
    load = axes.vector("b", "N", "the load gathered at the point")
    return mass, load, Group("here", "mass matrix and load gathered at the point", (*mass, *load))


def _along(axes: _Axes) -> tuple[tuple[Quantity, ...], Group]:
    along = axes.vector("d", "m", "the vector from the inner to the outer point of the rod")
    return along, Group("along", "vector from the inner to the outer point", along)


_COUPLING = Group("coupling", "mass that couples the ends of the rod", (_A12,))


def _symbols(quantities: Sequence[Quantity]) -> tuple[sp.Symbol, ...]:
    return tuple(x.symbol for x in quantities)


def _ends() -> System:
    """Return the step from the properties of a rod to its end mass matrix, section 2.1."""
    properties = (
        quantity("m", "kg", "mass"),
        quantity("l", "m", "length"),
        quantity("l_c", "m", "centre of mass from the inner point along the rod"),
        quantity("I_c", "kg*m^2", "moment of inertia about the centre of mass, across the rod"),
    )
    ends = end_mass(*_symbols(properties))
    a11, a12, a22 = ends[:3]
    return _step(
        "ends",
        "end mass matrix [a11 a12; a12 a22] of a rod",
        (Group("rod", "properties of the rod", properties),),
        (_column("masses", [a11, a12, a22], "kg", "a11, a12 and a22"),),
    )


def _length(axes: _Axes) -> System:
    """Return the step of gamma: minus the velocity terms of Eq. (3a), differentiated twice."""
    along, _ = _along(axes)
    rate = axes.vector("w", "m/s", "the rate of d")
    calculus = Calculus(along, rate, sp.Symbol("t", real=True))
    phi = length_constraint(_symbols(along), sp.Symbol("l", real=True))
    return _step(
        "length",
        "right side gamma of the length row",
        (Group("rate", "velocity of the outer point less that of the inner", rate),),
        (_column("gamma", [-calculus.rate(calculus.rate(phi))], "m^2/s^2", _GAMMA.description),),
    )


def _gather(axes: _Axes) -> System:
    """Return the mass matrix and load of a point before any rod outboard of it is eliminated."""
    force = axes.vector("f", "N", "the force on the point")
    matrix = [_MASS.symbol if i == j else sp.Integer(0) for i, j in axes.pairs]
    return _step(
        "gather",
        "mass matrix and load of a point by itself",
        (Group("mass", _MASS.description, (_MASS,)), Group("force", "force on the point", force)),
        (
            _column(
                "here", [*matrix, *_symbols(force)], "kg, N", "mass matrix and load gathered at the point"
            ),
        ),
    )


def _inward(axes: _Axes) -> System:
    """Return the elimination of a rod and its outer point; see the head of this module."""
    along, along_group = _along(axes)
    mass, load, here = _here(axes)
    s, d, b = axes.matrix(mass), _symbols(along), _symbols(load)
    a12, gamma = _A12.symbol, _GAMMA.symbol
    names = Names()
    adjugate, det = _adjugate(axes, names, s)
    t = names.all(axes.vector("t", "kg*m", "adj(S) d"), list(adjugate * sp.Matrix(d)))
    pivot = names.scalar("pivot", dot(d, tuple(t)), "kg*m^2", "d . t")
    inverse = names.scalar("q", 1 / (det * pivot), "1", "the only division: 1/(det pivot)")
    e = names.all(
        axes.vector("e", "kg^2*m", "a12 t + det d"), [a12 * t[i] + det * d[i] for i in range(len(d))]
    )
    z = names.all(axes.vector("z", "N*kg", "adj(S) b"), list(adjugate * sp.Matrix(b)))
    h = names.scalar("h", dot(d, tuple(z)) - det * gamma, "N*kg*m", "t . b - det gamma")
    across = names.scalar("a12_pivot", a12 * pivot, "kg^2*m^2", "a12 pivot")
    square = names.scalar("a12_a12_pivot", a12 * across, "kg^3*m^2", "a12^2 pivot")
    one_over_det = names.scalar("one_over_det", pivot * inverse, "1", "1/det S")
    gathered = [inverse * (e[i] * e[j] - square * adjugate[i, j]) for i, j in axes.pairs]
    passed = [inverse * (e[i] * h - across * z[i]) for i in range(len(d))]
    diagonal = sp.Mul(*(s[i, i] for i in range(len(d))))
    factors = [
        *(one_over_det * x for x in axes.upper(adjugate)),
        *b,
        *e,
        h,
        det * inverse,
        one_over_det * diagonal,
    ]
    return _step(
        "inward",
        "elimination of a rod and its outer point, leaves to root",
        (along_group, _COUPLING, Group("gamma", _GAMMA.description, (_GAMMA,)), here),
        (
            _column("factors", factors, "1", "factors of the outward step; last the cancellation in det S"),
            _column(
                "add_inner", [*gathered, *passed], "kg, N", "mass matrix and load passed to the inner point"
            ),
        ),
        names.definitions,
    )


def _outward(axes: _Axes) -> System:
    """Return the solution of a rod's own equations for a known acceleration of its inner point."""
    along, along_group = _along(axes)
    flexibility = axes.symmetric("f", "1/kg", "the inverse of S")
    load = axes.vector("b", "N", "the load gathered at the outer point")
    e = axes.vector("e", "kg^2*m", "a12 t + det d")
    h = quantity("h", "N*kg*m", "t . b - det gamma")
    reciprocal = quantity("one_over_pivot", "1", "1/(d . t)")
    loss = quantity("loss", "1", "product of the diagonal of S over det S")
    inner = axes.vector("a", "m/s^2", "the acceleration of the inner point")
    names = Names()
    a_p, d = _symbols(inner), _symbols(along)
    lam = names.scalar(
        "lam", reciprocal.symbol * (h.symbol - dot(_symbols(e), a_p)), _LAMBDA.unit, _LAMBDA.description
    )
    y = names.all(
        axes.vector("y", "N", "b - a12 a_p - d lambda"),
        [x - _A12.symbol * a - lam * c for x, a, c in zip(_symbols(load), a_p, d, strict=True)],
    )
    motion = list(axes.matrix(flexibility) * sp.Matrix(y))
    return _step(
        "outward",
        "acceleration of the outer point and multiplier of a rod, root to leaves",
        (
            along_group,
            _COUPLING,
            Group("factors", "factors of inward", (*flexibility, *load, *e, h, reciprocal, loss)),
            Group("inner_motion", "acceleration of the inner point", inner),
        ),
        (
            _column("outer_motion", motion, "m/s^2", "acceleration of the outer point"),
            _column("multiplier", [lam], _LAMBDA.unit, _LAMBDA.description),
        ),
        names.definitions,
    )


def _free(axes: _Axes) -> System:
    """Return the acceleration of a free base: S a = b with the gathered S and b."""
    mass, load, here = _here(axes)
    names = Names()
    adjugate, det = _adjugate(axes, names, axes.matrix(mass))
    inverse = names.scalar("q", 1 / det, "1", "1/det S")
    motion = [inverse * x for x in adjugate * sp.Matrix(_symbols(load))]
    return _step(
        "free",
        "acceleration of a free base",
        (here,),
        (_column("motion", motion, "m/s^2", "acceleration of the base"),),
        names.definitions,
    )


def _pinned(axes: _Axes) -> System:
    """Return the force that imposes the prescribed motion of the base: S a - b with the gathered S and b."""
    mass, load, here = _here(axes)
    base = axes.vector("a", "m/s^2", "the acceleration of the base")
    force = axes.matrix(mass) * sp.Matrix(_symbols(base)) - sp.Matrix(_symbols(load))
    return _step(
        "pinned",
        "force that the ground exerts on a held base",
        (here, Group("motion", "acceleration of the base", base)),
        (_column("reaction", list(force), "N", "force of the ground on the base"),),
    )


def _unloaded(axes: _Axes) -> System:
    """Return the force on a point minus its own mass times acceleration."""
    force = axes.vector("f", "N", "the force on the point")
    motion = axes.vector("a", "m/s^2", "the acceleration of the point")
    left = [f - _MASS.symbol * a for f, a in zip(_symbols(force), _symbols(motion), strict=True)]
    return _step(
        "unloaded",
        "force on a point less its mass times acceleration",
        (
            Group("mass", _MASS.description, (_MASS,)),
            Group("force", "force on the point", force),
            Group("motion", "acceleration of the point", motion),
        ),
        (_column("left", left, "N", "residual of the force"),),
    )


def _rest(axes: _Axes) -> System:
    """Return the residuals of a rod: its forces on both points, and the residual of its length row."""
    along, along_group = _along(axes)
    ends = {
        name: axes.vector(f"a_{name}", "m/s^2", f"the acceleration of the {name} point")
        for name in ("inner", "outer")
    }
    start, end = (_symbols(ends[name]) for name in ("inner", "outer"))
    d, lam = _symbols(along), _LAMBDA.symbol
    masses = end_mass(*sp.symbols("m l l_c I_c", positive=True))._replace(
        a11=sp.Integer(0), a12=_A12.symbol, a22=sp.Integer(0)
    )
    inertial = kinetic_energy(masses, start, end)
    rows = zip(d, start, end, strict=True)
    return _step(
        "rest",
        "residuals of the equations of a rod",
        (
            along_group,
            _COUPLING,
            Group("gamma", _GAMMA.description, (_GAMMA,)),
            Group("inner_motion", "acceleration of the inner point", ends["inner"]),
            Group("outer_motion", "acceleration of the outer point", ends["outer"]),
            Group("multiplier", _LAMBDA.description, (_LAMBDA,)),
        ),
        (
            _column("add_inner", [-sp.diff(inertial, a) + lam * x for a, x in zip(start, d, strict=True)],
                    "N", "taken from the load of the inner point"),
            _column("add_outer", [-sp.diff(inertial, a) - lam * x for a, x in zip(end, d, strict=True)],
                    "N", "taken from the load of the outer point"),
            _column("length_left", [_GAMMA.symbol - sp.Add(*(x * (b - a) for x, a, b in rows))],
                    "m^2/s^2", "residual of the length row"),
        ),
    )  # fmt: skip


def _adjugate(axes: _Axes, names: Names, s: sp.Matrix) -> tuple[sp.Matrix, sp.Expr]:
    """Name the adjugate and the determinant of a symmetric matrix."""
    plain = s.adjugate()
    if sp.expand((s * plain)[0, 0] - s.det()) != 0:
        raise DerivationError("the adjugate does not belong to the determinant")
    unit = f"kg^{s.rows - 1}"
    named = names.all(axes.symmetric("adj", unit, "adj(S)"), axes.upper(plain))
    known = dict(zip(axes.pairs, named, strict=True))
    adjugate = sp.Matrix(s.rows, s.rows, lambda i, j: known[min(i, j), max(i, j)])
    det = names.scalar("det", dot(tuple(s[0, :]), tuple(adjugate[:, 0])), f"kg^{s.rows}", "det S")
    return adjugate, det


def _step(
    name: str,
    title: str,
    groups: tuple[Group, ...],
    matrices: tuple[NamedMatrix, ...],
    definitions: tuple[Definition, ...] = (),
) -> System:
    return System(name, title, groups, matrices, (), definitions, references=(REFERENCE,), sources=CHAIN)


def _column(name: str, entries: Sequence[sp.Expr], unit: str, description: str) -> NamedMatrix:
    return NamedMatrix(name, sp.ImmutableMatrix(len(entries), 1, list(entries)), unit, description)
