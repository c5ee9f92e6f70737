"""Kernels of couples by the forces in joints, such as friction of bearings, and of efforts that keep motions.

Each couple is a factor c, which depends on the state, times the size f of a force that is linear in
accelerations, multipliers and couples. These are linear in the couples, so that by one factorisation, with a
solution without couples and one for each of them,

    f = |F + B f|,   force by force, where F are those without couples and B f those by the couples.

Only these sizes are iterated, by Newton's method, in the work memory behind the pivots.

Efforts u make the multipliers of prescribed motions zero. That of motion i is x_i . (f + B u, gamma), with
the solution x_i for one at its row: as many linear equations of u as there are motions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from itertools import accumulate, count, pairwise
from typing import TYPE_CHECKING

from symgen.lowering.expressions import (
    ONE,
    ZERO,
    Call,
    Constant,
    Negative,
    Node,
    Quotient,
    Reference,
    Sum,
    add,
    guarded_reciprocal,
    less,
    multiply,
    negative,
    reciprocal,
    rename,
)
from symgen.lowering.kernel import Block, IteratedKernel, Kernel
from symgen.lowering.sparse_ldlt import Factor, solve
from symgen.lowering.straight_line import Shared, StraightLine

if TYPE_CHECKING:
    from symgen.symbolic.system import SaddlePoint, System

#: Square of the part of its size that the rate of a drive must have, by the rates of the motions.
_MOVES = "1e-24"


class CoupleKernels:
    """The kernels between a factorisation and the accelerations with couples.

    Parameters
    ----------
    system
        The system.
    shared
        Its matrices, those of the couples among them.
    factors
        Factors of the equations of motion, as references to ``work``.
    place
        Number of entries of ``work`` before those of the iteration.
    """

    def __init__(
        self, system: System, shared: Shared, point: SaddlePoint, factors: Factor, place: int
    ) -> None:
        self.factors, self.place = factors, place
        self.labels = tuple(x.name for x in system.group("work").quantities)
        matrices = [shared.entries[name] for name in point.couples]
        self._law, self._directions, self._without, self._by = matrices
        self.couples, axes = system[point.couples[2]].matrix.shape
        self.unknowns = len(self.labels) - self.couples
        width = len(self.labels)
        known = {*self._without, *(place // width for place in self._by)}
        of_force = [[i for i in range(k * axes, (k + 1) * axes) if i in known] for k in range(self.couples)]
        self._components = [i for row in of_force for i in row]
        inside = {f"work[{i}]": f"out[{i}]" for i in range(len(self.labels))}
        self._inside = inside
        self._values = {name: rename(value, inside) for name, value in shared.values.items()}
        about = "sizes of the forces in joints by which the couples are: Newton's method"
        settled = IteratedKernel("settled", about, (), (), (), (), (), (), "newton", place, self.couples)
        places = count(settled.at("end"))

        def entries(rows: int, columns: int) -> list[list[int]]:
            return [[next(places) for _ in range(columns)] for _ in range(rows)]

        ends = [*accumulate(map(len, of_force), initial=0)]
        self._rows = [range(*pair) for pair in pairwise(ends)]
        self._forces = [row[0] for row in entries(len(self._components), 1)]
        self._slopes = entries(len(self._components), self.couples)
        self._behind = next(places)  # what follows is not iterated
        self.settled = replace(settled, numbers=self._behind)
        self._factors = [self._behind, *(next(places) for _ in range(self.couples - 1))]
        self._solutions = entries(self.couples, self.unknowns)
        self.sizes = {g.name: len(g.quantities) for g in system.groups}
        self.sizes |= {"work": place + next(places), "out": len(self.labels)}

    def kernels(
        self, factorise: Kernel, in_place: Kernel, rhs: Mapping[int, Node], unknowns: tuple[Block, ...]
    ) -> list[Kernel]:
        """Return the kernels in order, the last of them 'accelerations', which calls the others.

        ``factorise`` and ``in_place`` are the kernels of the solution, ``rhs`` its right-hand side.
        """
        about = "none: without couples by the forces in joints"
        none = StraightLine().kernel(
            "uncoupled", about, dict.fromkeys(range(len(self.labels)), ZERO), (), self.sizes
        )
        responses, newton, coupled = self._responses(), self._newton(), self._coupled()
        last = unknowns[-1].offset + unknowns[-1].shape[0]
        about = "couples by the forces in joints"
        block = Block("joint_couples", last, (self.couples, 1), "N*m", about, self.labels[last:])
        accelerations = StraightLine(self._values).kernel(
            "accelerations",
            f"accelerations and multipliers: [M J^T; J 0] [a; lambda] = [f; gamma], and {about}",
            {i: rename(rhs.get(i, ZERO), self._inside) for i in range(last)},
            (*unknowns, block),
            self.sizes,
        )
        settled = replace(self.settled, first=(newton,))
        then = (in_place, responses, settled, coupled)
        accelerations = replace(accelerations, first=(factorise, none), then=then)
        return [none, responses, newton, settled, coupled, accelerations]

    def _responses(self) -> Kernel:
        """Return the kernel of F and B, and of the solutions for forces of size one."""
        line = StraightLine(self._values)

        def entry(matrix: Mapping[int, Node], place: int) -> Node:
            return rename(matrix.get(place, ZERO), self._inside)

        work: dict[int, Node] = {}
        n, k = self.unknowns, self.couples
        factors = [line.name(entry(self._law, j), f"factor{j}") for j in range(k)]
        work |= zip(self._factors, factors, strict=True)
        forces = [line.name(entry(self._without, i), f"force{i}") for i in self._components]
        work |= zip(self._forces, forces, strict=True)
        slopes = [
            [line.name(entry(self._by, i * (n + k) + c), f"slope{i}_{c}") for c in range(n + k)]
            for i in self._components
        ]
        squares: list[Node] = []
        for j, factor in enumerate(factors):
            directions = (entry(self._directions, i * k + j) for i in range(n))  # zero for constraints
            sides = [line.name(multiply(d, factor), f"side{i}_{j}") for i, d in enumerate(directions)]
            solution = solve(line, self.factors, sides, f"_{j}")
            work |= zip(self._solutions[j], solution, strict=True)
            for i, row in enumerate(slopes):
                terms = [multiply(c, x) for c, x in zip(row, solution, strict=False)]
                by = line.name(add([*terms, multiply(row[n + j], factor)]), f"by{i}_{j}")
                work[self._slopes[i][j]] = by
                squares.append(multiply(by, by))
        for i, rows in enumerate(self._rows):
            work[i] = Call("sqrt", (add(multiply(forces[r], forces[r]) for r in rows),))
        work[self.settled.at("bound")], work[self.settled.at("missed")] = add(squares), ZERO
        about = "forces in joints without couples, by couples, and the solutions for a force of size one each"
        shifted = {self.place + i: e for i, e in work.items()}
        return line.kernel("responses", about, {}, (), self.sizes, shifted)

    def _newton(self) -> Kernel:
        """Return a step of Newton's method, in place in ``out``."""
        line, n, at = StraightLine(), self.couples, self.settled.at

        def read(place: int) -> Node:
            return Reference(f"out[{place}]")

        part, sizes = read(at("part")), [read(i) for i in range(n)]
        by = [[multiply(part, read(place)) for place in row] for row in self._slopes]
        by = [[line.name(x, f"b{i}_{j}") for j, x in enumerate(row)] for i, row in enumerate(by)]
        force = [
            line.name(add([read(place), *map(multiply, row, sizes)]), f"force{i}")
            for i, (place, row) in enumerate(zip(self._forces, by, strict=True))
        ]
        matrix, missed = [], []
        for i, rows in enumerate(self._rows):
            squared = line.name(add(multiply(force[r], force[r]) for r in rows), f"squared{i}")
            size = line.name(Call("sqrt", (squared,)), f"size{i}")
            inverse = line.name(guarded_reciprocal(size, size, ZERO), f"inverse{i}")
            along = [line.name(multiply(force[r], inverse), f"along{r}") for r in rows]
            slopes = (add(multiply(a, by[r][j]) for a, r in zip(along, rows, strict=True)) for j in range(n))
            matrix.append(
                [line.name(less(ONE if i == j else ZERO, [x]), f"m{i}_{j}") for j, x in enumerate(slopes)]
            )
            missed.append(line.name(less(size, [sizes[i]]), f"missed{i}"))
        pivots: list[Node] = []
        inverses: list[Node] = []
        for k in range(n):
            pivots.append(matrix[k][k])
            inverses.append(line.name(reciprocal(matrix[k][k]), f"r{k}"))
            for i in range(k + 1, n):
                lower = line.name(multiply(matrix[i][k], inverses[k]), f"l{i}_{k}")
                for j in range(k + 1, n):
                    value = less(matrix[i][j], [multiply(lower, matrix[k][j])])
                    matrix[i][j] = line.name(value, f"m{i}_{j}_{k}")
                missed[i] = line.name(less(missed[i], [multiply(lower, missed[k])]), f"missed{i}_{k}")
        step: dict[int, Node] = {}
        for k in reversed(range(n)):
            others = [multiply(matrix[k][j], step[j]) for j in range(k + 1, n)]
            step[k] = line.name(multiply(less(missed[k], others), inverses[k]), f"step{k}")
        found = [line.name(add([sizes[k], step[k]]), f"found{k}") for k in range(n)]
        results: dict[int, Node] = dict(enumerate(found))
        results[at("part")] = part
        results[at("change")] = add(Call("fabs", (step[k],)) for k in range(n))
        results[at("size")] = add(Call("fabs", (x,)) for x in found)
        results[at("determinant")] = reduce(multiply, pivots)
        about = "a step of Newton's method for the sizes of forces in joints, in place"
        return line.kernel("newton", about, results, (), {"out": self._behind})

    def _coupled(self) -> Kernel:
        """Return the kernel that adds what the couples change, and the couples."""
        line = StraightLine()

        def read(place: int) -> Node:
            return Reference(f"work[{self.place + place}]")

        sizes = [read(j) for j in range(self.couples)]
        results: dict[int, Node] = {}
        for i in range(self.unknowns):
            changes = (multiply(read(of[i]), size) for of, size in zip(self._solutions, sizes, strict=True))
            results[i] = add([Reference(f"out[{i}]"), *changes])
        results[0] = add([results[0], read(self.settled.at("missed"))])
        couples = (multiply(read(c), size) for c, size in zip(self._factors, sizes, strict=True))
        results |= enumerate(couples, self.unknowns)
        about = "accelerations, multipliers and couples by the sizes of forces in joints, in place"
        return line.kernel("coupled", about, results, (), self.sizes)


def by_efforts(
    system: System,
    shared: Shared,
    point: SaddlePoint,
    factors: Factor,
    place: int,
    rhs: Mapping[int, Node],
    unknowns: tuple[Block, ...],
) -> Kernel:
    """Return 'accelerations' up to their solution: the right-hand side with efforts, and these behind it.

    ``factors`` are references to the first ``place`` entries of ``work``, ``rhs`` is the right-hand side
    without efforts. An equation of these counts in units of the size of the accelerations of x_i, and an
    effort in those of its column of B.
    """
    slopes, line = shared.entries[point.efforts], StraightLine(shared.values)
    efforts, rows = system[point.efforts].columns, system[point.jacobian].rows
    (n, m), k = (b.shape[0] for b in unknowns), len(efforts)
    pushes = [{place // k: e for place, e in slopes.items() if place % k == j} for j in range(k)]
    left: list[list[Node]] = []
    right: list[Node] = []
    for motion in point.motions:
        row = n + rows.index(motion)
        x = solve(line, factors, [ONE if i == row else ZERO for i in range(n + m)], f"_{motion}")
        squared = line.name(add(multiply(x[i], x[i]) for i in range(n)), f"squared_{motion}")
        size = line.name(Call("sqrt", (squared,)), f"size_{motion}")
        works = [add(multiply(x[i], e) for i, e in push.items()) for push in pushes]
        left.append([line.name(Quotient(of, size), f"by{j}_{motion}") for j, of in enumerate(works)])
        present = negative(add(multiply(x[i], e) for i, e in rhs.items()))
        right.append(line.name(Quotient(present, size), f"to_{motion}"))
    sizes = [line.name(add(multiply(e, e) for e in push.values()), f"of{j}") for j, push in enumerate(pushes)]
    u = _solved(line, left, right, sizes)
    sides: dict[int, Node] = {
        i: add((rhs.get(i, ZERO), *(multiply(push.get(i, ZERO), u[j]) for j, push in enumerate(pushes))))
        for i in range(n + m)
    }
    block = Block(point.efforts, n + m, (k, 1), "N, N*m", "efforts that keep prescribed motions", efforts)
    return line.kernel(
        "accelerations",
        "accelerations and multipliers: [M J^T; J 0] [a; lambda] = [f + B u; gamma], with the efforts u that "
        "make the multipliers of motions zero",
        sides | dict(enumerate(u, n + m)),
        (*unknowns, block),
        {g.name: len(g.quantities) for g in system.groups} | {"work": place},
    )


def _solved(
    line: StraightLine, rows: Sequence[Sequence[Node]], rhs: Sequence[Node], sizes: Sequence[Node]
) -> list[Node]:
    """Solve a few equations by modified Gram-Schmidt on the columns and the right-hand side.

    The solution is no number where the square of a column, less its part along those before it, is at most a
    part of that of its size, ``sizes``.
    """
    count = len(rows)
    columns = [[row[j] for row in rows] for j in range(count)]
    columns.append(list(rhs))
    along: dict[tuple[int, int], Node] = {}
    lengths, alarms = [], list[Node]()
    for j in range(count):
        squared = line.name(_dot(columns[j], columns[j]), f"column{j}")
        length = line.name(Call("sqrt", (squared,)), f"length{j}")
        enough = line.name(Sum((squared, Negative(multiply(Constant(_MOVES), sizes[j])))), f"enough{j}")
        alarm = line.name(Call("sqrt", (enough,)), f"alarm{j}")  # no number of less than zero
        alarms += [alarm, Negative(alarm)]
        lengths.append(length)
        unit = [line.name(Quotient(x, length), f"unit{i}_{j}") for i, x in enumerate(columns[j])]
        for k in range(j + 1, count + 1):
            along[j, k] = line.name(_dot(unit, columns[k]), f"along{j}_{k}")
            columns[k] = [
                line.name(add([x], [multiply(along[j, k], e)]), f"left{i}_{j}_{k}")
                for i, (x, e) in enumerate(zip(columns[k], unit, strict=True))
            ]
    found: dict[int, Node] = {}
    for j in reversed(range(count)):
        later = [multiply(along[j, k], found[k]) for k in range(j + 1, count)]
        found[j] = line.name(Quotient(add([along[j, count]], later), lengths[j]), f"found{j}")
    return [line.name(Sum((found[j], *alarms)), f"effort{j}") for j in range(count)]


def _dot(a: Sequence[Node], b: Sequence[Node]) -> Node:
    return add([multiply(x, y) for x, y in zip(a, b, strict=True)])
