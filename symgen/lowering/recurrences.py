"""The kernels of power series in time of a motion.

The kernel ``sides`` is called for the orders k = 0, 1, 2, ... of one step in turn. It returns coefficient k
of the right-hand side of [M J^T; J 0] [a; lambda] = [f; gamma], with those of a and lambda of order k still
zero. The matrix at the beginning of the step is that of all orders: ``solve`` gives coefficient k of a and
lambda, and by it coefficient k + 2 of q. Then ``along`` completes operands that contain a and lambda, and
returns coefficient k of further quantities: the power, and what a run watches. Coefficients of order k + 1
are from ``ahead``, before ``sides``, and from ``behind``, after the solution, where they depend on it.

Each order has a row of coefficients: those of q, those of lambda, and the operands of products and functions
(:mod:`symgen.lowering.coefficients`).

Of one freedom, velocities are multiples s of a motion of unit inertia along which s' is the power of loads.
Coefficient k of that motion is the solution; by it and that of s, which the one before of the power gives,
``speed`` returns coefficient k of the velocities. The first of what ``along`` returns is the power.

A length constraint is a polynomial of second degree in q: the second rate of its coefficient k + 2 takes half
the products of gamma - J a, and leaves no error of lower order in the constraint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from symgen.errors import DerivationError
from symgen.lowering.coefficients import ALIGNED, CoefficientWriter
from symgen.lowering.expressions import ZERO, Constant, Node, references
from symgen.lowering.kernel import Assignment, Block, SeriesKernel, Store
from symgen.lowering.series import (
    ACCELERATION,
    MULTIPLIER,
    SPEED,
    Argument,
    Linear,
    Terms,
    Times,
    Value,
    total,
    unit,
)

#: Name and meaning of a kernel, its statements and its results.
_Part = tuple[str, str, list[Assignment], list[Node]]

#: Statements from which on compilation takes more time than a run by power series saves.
MOST = 1000


@dataclass(frozen=True, slots=True)
class EquationsOfMotion:
    """Equations of motion [M J^T; J 0] [a; lambda] = [f; gamma] with constraints Phi.

    Parameters
    ----------
    values, rates
        Named terms, and what those are rates of that the derivation states as such.
    n, m
        Numbers of coordinates and of constraints.
    mass, jacobian
        Entries of M and J that are not zero.
    sides
        Entries of f, and behind them of gamma, with other terms of M a, J^T lambda and J a subtracted.
    constraints
        Entries of Phi.
    power
        The power of loads without potential, if it is integrated.
    watched, events
        Further quantities whose series are wanted, and the number of the first that may be without one.
    parameters
        Number of parameters.
    """

    values: Mapping[str, Node]
    rates: Mapping[str, Node]
    n: int
    m: int
    mass: Mapping[tuple[int, int], Node]
    jacobian: Mapping[tuple[int, int], Node]
    sides: Mapping[int, Node]
    constraints: Mapping[int, Node]
    power: Node | None
    watched: Sequence[Node]
    events: int
    parameters: int


def lower_series(e: EquationsOfMotion) -> list[SeriesKernel]:
    """Return the kernel ``sides``, and those of the others that have statements.

    An event has no series if one of its functions has no recurrence; for another watched quantity, none has.

    Raises
    ------
    DerivationError
        For a function without a recurrence, and more than ``MOST`` statements.
    """
    n, terms = e.n, Terms(e.values, e.rates, e.n)
    squares = {i: x for i, phi in e.constraints.items() if (x := _quadratic(terms, terms.of(phi)))}
    sums = {i: [terms.of(e.sides.get(i, ZERO))] for i in range(n + e.m) if i - n not in squares}

    def subtract(row: int, factor: Node, array: str, i: int) -> None:
        if row in sums:
            product = terms.times(terms.of(factor), unit(Argument(array, i)))
            sums[row].append(product.scaled(Constant("-1")))

    for (i, j), factor in e.mass.items():
        subtract(i, factor, ACCELERATION, j)
    for (i, j), factor in e.jacobian.items():
        subtract(j, factor, MULTIPLIER, i)
        subtract(n + i, factor, ACCELERATION, j)
    powers = [] if e.power is None else [terms.of(e.power)]
    watched, lacking = _watched(terms, e)
    totals = [total(x) for x in sums.values()]
    writer = CoefficientWriter(terms, n, e.m, [*totals, *powers, *watched])
    found = writer.two_ahead({n + i: x for i, x in squares.items()})
    found |= dict(zip(sums, writer.write(totals), strict=True))
    before = writer.solved()
    writer.complete_operands()
    along = writer.write([*powers, *watched])
    behind, ahead = writer.behind(), writer.ahead()  # with rows for all that the others read
    of = "coefficient of the power of loads without potential" if powers else "coefficient"
    of += (" and" if powers else "") + " of what a run watches" if watched else ""
    kernels = _kernels(
        e,
        writer,
        (len(watched), lacking),
        (
            ("ahead", "coefficients of coordinates and their functions, one order ahead", ahead, []),
            _sides("the equations of motion", before, [found[i] for i in range(n + e.m)]),
            ("behind", "coefficients that depend on those of the solution", behind, []),
            ("along", of, writer.statements, along),
        ),
    )
    if e.mass and sum(len(kernel.assignments) for kernel in kernels) > MOST:  # loops have few links
        raise DerivationError("the motion has too many terms for power series")
    return kernels


def lower_one_freedom(e: EquationsOfMotion) -> list[SeriesKernel]:
    """Return these kernels for a motion of one freedom, and ``speed``.

    ``e.sides`` vanish along the motion of unit inertia, which is in ``work``; the last is the power on it.

    Raises
    ------
    DerivationError
        For a function without a recurrence, and a power or watched quantity that depends on that motion.
    """
    *vanishing, power = (e.sides.get(i, ZERO) for i in range(e.n + e.m))
    terms = Terms(e.values, {}, 0)
    closed, force = [terms.of(x) for x in vanishing], terms.of(power)
    speed = unit(Argument(SPEED, 0))
    rates = [terms.times(unit(Argument(MULTIPLIER, i)), speed) for i in range(e.n)]
    watched, lacking = _watched(terms, e)
    others = [*([] if e.power is None else [terms.of(e.power)]), *watched]
    if any(terms.is_of_late(a) for x in others for a, _ in x.terms):
        raise DerivationError("the power of loads depends on accelerations")
    writer = CoefficientWriter(terms, e.n, e.n, [*closed, *rates, force, *others])
    found = writer.write(closed)
    before = writer.solved()
    velocities = writer.write(rates)
    of_speed, writer.statements = writer.statements, []
    along = writer.write([force, *others])
    writer.complete_operands()
    behind, ahead = writer.behind(), writer.ahead()
    return _kernels(
        e,
        writer,
        (len(watched), lacking),
        (
            ("ahead", "coefficients of sums of coordinates", ahead, []),
            _sides("closure and inertia of the motion of unit inertia", before, found),
            ("behind", "coefficients of the motion of unit inertia", behind, []),
            ("speed", "coefficients of the velocities, multiples of that motion", of_speed, velocities),
            (
                "along",
                "coefficient of the power on that motion, and of what a run watches",
                writer.statements,
                along,
            ),
        ),
    )


def _watched(terms: Terms, e: EquationsOfMotion) -> tuple[list[Linear], tuple[int, ...]]:
    """Return the watched quantities, and the numbers of those without a series."""
    known, count = terms.known(e.watched), len(e.watched)
    numbers = range(count if known.keys() >= {*range(e.events, count)} else 0)
    return [known.get(i, Linear()) for i in numbers], tuple(i for i in numbers if i not in known)


def _sides(of: str, statements: list[Assignment], out: list[Node]) -> _Part:
    return ("sides", f"coefficient of the right-hand side of {of}", statements, out)


def _quadratic(terms: Terms, x: Linear) -> Linear | None:
    """Return a sum as a polynomial of second degree in the coordinates alone; None if it is none."""
    parts = [Linear(x.constant)]
    for atom, c in x.terms:
        part: Linear | None = unit(atom)
        if isinstance(atom, Value) and not terms.is_early(atom):
            part = _quadratic(terms, terms.named[atom])
        elif not all(map(terms.is_early, terms.operands(atom) if isinstance(atom, Times) else [atom])):
            part = None
        if part is None:
            return None
        parts.append(part.scaled(c))
    return total(parts)


def _kernels(
    e: EquationsOfMotion,
    writer: CoefficientWriter,
    watched: tuple[int, tuple[int, ...]],
    parts: Sequence[_Part],
) -> list[SeriesKernel]:
    """Return the kernels that have statements or results."""
    rows = len(writer.placed) + len(parts[-1][-1])
    # of many, those at odd multiples of eight lie in different sets of a cache
    rows += (8 - rows) % 16 if rows > 256 else -rows % ALIGNED
    counts = (len(writer.pairs), len(writer.pairs_ahead), *watched)
    kernels = []
    for name, about, statements, out in parts:
        if not (statements or out):
            continue
        read = references([*(a.value for a in statements), *out])
        inputs = [("t", 2)] + ([("p", e.parameters)] if any(x.startswith("p[") for x in read) else [])
        stores = tuple(Store("out", i, x) for i, x in enumerate(out))
        blocks = (Block(name, 0, (len(out), 1), "1", about),)
        kernels.append(
            SeriesKernel(
                name, about, tuple(inputs), tuple(statements), stores, blocks, (), (), rows, e.n, *counts
            )
        )
    return kernels
