"""The complete lowering of a System to a Program."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import sympy as sp

from symgen.errors import DerivationError
from symgen.lowering.binding_times import with_setup
from symgen.lowering.couples import CoupleKernels, by_efforts
from symgen.lowering.expressions import (
    ZERO,
    Call,
    Node,
    Reference,
    references,
    rename,
)
from symgen.lowering.kernel import RANK_TOLERANCE, SETUP, Block, Kernel, Program, SeriesKernel, Slot
from symgen.lowering.recurrences import EquationsOfMotion, lower_one_freedom, lower_series
from symgen.lowering.sparse_ldlt import Factor, factor, solve
from symgen.lowering.straight_line import Shared, StraightLine
from symgen.symbolic.switch import WHICH_PIECE, PieceFunction, PiecewisePolynomial, Sign
from symgen.symbolic.system import Export, NamedMatrix, SaddlePoint, System

#: Matrices of the kernel 'events': switching points, in rows named after their branches; rates of angles.
SWITCHES, RATES = "switches", "turn_rates"
#: The residual of one freedom: what vanishes along the motion of unit inertia, then the power on it.
FREE_MOTION = "free_motion"


def lower_system(system: System) -> Program:
    """Lower every export of a system, and the solution of its equations of motion, to kernels.

    Constants are replaced by their values.
    """
    point = system.saddle_point
    names = dict.fromkeys(name for export in system.exports for name in export.matrices)
    if point:
        names.update(dict.fromkeys((point.mass, point.jacobian, point.force, point.rhs)))
        names.update(dict.fromkeys((*point.couples, *filter(None, [point.efforts]))))
    if system.residual:
        names[system.residual] = None
    lowering = _Lowering(system, Shared(system, tuple(names)))
    kernels = lowering.solution(point) if point else []
    kernels += [lowering.export(export) for export in system.exports if export.matrices]
    groups = tuple(
        (g.name, g.description, tuple(Slot(x.name, x.unit, x.description) for x in g.quantities))
        for g in system.groups
    )
    parameters = system.group("p")
    series: list[Kernel] = []
    if (point and not point.couples and not point.efforts) or system.residual:
        with suppress(DerivationError):  # a function without a recurrence: there are no power series
            held = _held(system)
            series = (lowering if held is system else _Lowering(held, Shared(held, tuple(names)))).series()
    kernels = list(with_setup([*kernels, *series], parameters))
    kernels, series = kernels[: len(kernels) - len(series)], kernels[len(kernels) - len(series) :]
    behind = sum(k.out_size for k in kernels if k.name == SETUP)
    place = len(parameters.quantities) + behind if point and not point.independent else -1
    return Program(
        name=system.name,
        title=system.title,
        groups=groups,
        kernels=_with_tolerance(kernels, place),
        series=tuple(k for k in series if isinstance(k, SeriesKernel)),
        pivots=lowering.pivots,
        rank_tolerance=point.rank_tolerance if point else "0",
        tolerance_place=place,
        references=system.references,
        left_out=system.left_out,
    )


def _held(system: System) -> System:
    """Return a system whose loads have branches in place of jumps, as runs hold them: b b = 1.

    Of tables a branch is the piece.
    """
    names = {name for m in system.matrices if m.name == SWITCHES for name in m.rows}
    if not names:
        return system
    branches = {x.symbol for x in system.group("p").quantities if x.name in names}
    held: dict[sp.Basic, sp.Expr] = {b**2: sp.Integer(1) for b in branches}
    held |= {Sign(b - WHICH_PIECE) ** 2: sp.Integer(1) for b in branches}  # exactly: pieces are large numbers
    for of in (*(m.matrix for m in system.matrices), *(d.expression for d in system.definitions)):
        functions = of.atoms(PieceFunction, PiecewisePolynomial)
        for f in sorted(functions, key=lambda f: len(f.atoms(PiecewisePolynomial))):  # arguments first
            x, *branch = f.args
            if branch and branch[0] in branches:
                polynomial = isinstance(f, PiecewisePolynomial)
                held[f] = f.pieces.on_piece(x.xreplace(held), *branch, f.order) if polynomial else branch[0]
    return replace(
        system,
        matrices=tuple(replace(m, matrix=m.matrix.xreplace(held)) for m in system.matrices),
        definitions=tuple(
            replace(d, expression=d.expression.xreplace(held), rate_of=d.rate_of and d.rate_of.xreplace(held))
            for d in system.definitions
        ),
    )


def _with_tolerance(kernels: Sequence[Kernel], place: int) -> tuple[Kernel, ...]:
    """Return kernels that read the rank tolerance from ``p[place]``, behind all other entries.

    Calls alone read it: those of the guarded reciprocals, each an assignment of its own.
    """
    placed: dict[str, Kernel] = {}

    def read(kernel: Kernel) -> Kernel:
        if not kernel.counts.call:
            return kernel
        if kernel.name not in placed:
            first, then = (tuple(map(read, called)) for called in (kernel.first, kernel.then))
            placed[kernel.name] = replace(_placed(kernel, place), first=first, then=then)
        return placed[kernel.name]

    return tuple(map(read, kernels))


def _placed(kernel: Kernel, place: int) -> Kernel:
    if RANK_TOLERANCE not in references(a.value for a in kernel.assignments if isinstance(a.value, Call)):
        return kernel
    names = {RANK_TOLERANCE: f"p[{place}]"}
    return replace(
        kernel,
        inputs=tuple((array, place + 1 if array == "p" else size) for array, size in kernel.inputs),
        assignments=tuple(
            replace(a, value=rename(a.value, names)) if isinstance(a.value, Call) else a
            for a in kernel.assignments
        ),
    )


class _Lowering:
    def __init__(self, system: System, shared: Shared) -> None:
        self.system, self.shared, self.pivots = system, shared, 0
        self.sizes = {g.name: len(g.quantities) for g in system.groups}

    def export(self, export: Export) -> Kernel:
        blocks = _blocks([self.system[name] for name in export.matrices])
        results = {b.offset + i: e for b in blocks for i, e in self.shared.entries[b.name].items()}
        line = StraightLine(self.shared.values)
        return line.kernel(export.kernel, export.description, results, blocks, self.sizes)

    def solution(self, point: SaddlePoint) -> list[Kernel]:
        """Return 'factor', 'solve' (for repeated right-hand sides), and 'accelerations', which calls both."""
        n, m = self.system[point.mass].matrix.rows, self.system[point.jacobian].matrix.rows
        labels = tuple(x.name for x in self.system.group("work").quantities)
        entries = {divmod(ij, n): e for ij, e in self.shared.entries[point.mass].items() if ij % n <= ij // n}
        entries |= {(n + ij // n, ij % n): e for ij, e in self.shared.entries[point.jacobian].items()}
        rhs = self.shared.entries[point.force] | {n + i: e for i, e in self.shared.entries[point.rhs].items()}

        line = StraightLine(self.shared.values)
        named = {ij: line.name(value, f"k{ij[0]}_{ij[1]}") for ij, value in entries.items()}
        tolerance = None if point.independent else Reference(RANK_TOLERANCE)
        factors = factor(line, named, point.order, n, labels, tolerance)
        stored = _stored(factors)
        health = [e for k in range(n + m) for e in (factors.pivot[k], factors.sound[k])]
        description = "factors of [M J^T; J 0] into work, for 'solve'; behind them the pivots"
        kept = dict(enumerate([*stored, *health]))
        factorise = line.kernel("factor", description, {}, (), self.sizes, kept)

        line = StraightLine()
        places = {x.name: f"work[{i}]" for i, x in enumerate(stored)}
        regular = replace(
            factors,
            inverse={k: rename(x, places) for k, x in factors.inverse.items()},
            lower={ij: rename(x, places) for ij, x in factors.lower.items()},
        )
        in_place = line.kernel(
            "solve",
            "solution for the right-hand side in out, with the factors in work, in place",
            dict(enumerate(solve(line, regular, [Reference(f"out[{i}]") for i in range(n + m)]))),
            (
                Block(
                    "solution", 0, (n + m, 1), "1", "right-hand side before, solution after", labels[: n + m]
                ),
            ),
            {"work": len(stored), "out": n + m},
        )
        unknowns = (
            Block("accelerations", 0, (n, 1), "m/s^2", "accelerations of the moving points", labels[:n]),
            Block("multipliers", n, (m, 1), "N/m", "multipliers of the constraints", labels[n : n + m]),
        )
        self.pivots = len(stored)
        if point.efforts:
            accelerations = by_efforts(self.system, self.shared, point, regular, len(stored), rhs, unknowns)
            return [factorise, in_place, replace(accelerations, first=(factorise,), then=(in_place,))]
        accelerations = StraightLine(self.shared.values).kernel(
            "accelerations",
            "accelerations and multipliers: [M J^T; J 0] [a; lambda] = [f; gamma]",
            rhs,
            unknowns,
            self.sizes,
        )
        if point.couples:
            couples = CoupleKernels(self.system, self.shared, point, regular, len(kept))
            return [factorise, in_place, *couples.kernels(factorise, in_place, rhs, unknowns)]
        return [factorise, in_place, replace(accelerations, first=(factorise,), then=(in_place,))]

    def series(self) -> list[Kernel]:
        """Return the kernels of power series in time."""
        of, system, point = self.shared.entries, self.system, self.system.saddle_point
        mass: dict[tuple[int, int], Node] = {}
        jacobian = mass
        if point:
            n, m = system[point.mass].matrix.rows, system[point.jacobian].matrix.rows
            mass, jacobian = (
                {divmod(ij, n): e for ij, e in of[x].items()} for x in (point.mass, point.jacobian)
            )
            sides = of[point.force] | {n + i: e for i, e in of[point.rhs].items()}
        else:
            n, sides = len(system.group("q").quantities), of[system.residual]
            m = system[system.residual].matrix.rows - n
        of_runs = (x.matrices for x in system.exports if x.kernel == "events")
        watched = [system[name] for names in of_runs for name in names if name != RATES]
        equations = EquationsOfMotion(
            self.shared.values,
            self.shared.rates,
            n,
            m,
            mass,
            jacobian,
            sides,
            of.get("constraints", {}),
            of["power"].get(0, ZERO) if "power" in of else None,
            [of[x.name].get(i, ZERO) for x in watched for i in range(len(x.matrix))],
            sum(len(x.matrix) for x in watched if x.name.endswith("events")),
            len(system.group("p").quantities),
        )
        one_freedom = system.residual == FREE_MOTION
        return list(lower_one_freedom(equations) if one_freedom else lower_series(equations))


def _blocks(matrices: Sequence[NamedMatrix]) -> tuple[Block, ...]:
    blocks, offset = [], 0
    for m in matrices:
        blocks.append(Block(m.name, offset, m.matrix.shape, m.unit, m.description, m.rows, m.columns))
        offset += m.matrix.rows * m.matrix.cols
    return tuple(blocks)


def _stored(factors: Factor) -> list[Reference]:
    """Return the distinct values that 'solve' reads from 'factor'."""
    used = [*(factors.inverse[k] for k in factors.order), *factors.lower.values()]
    return [Reference(name) for name in references(used)]
