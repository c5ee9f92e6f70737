"""Plain-text structure of a model: matrix sizes, solution method and memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from symgen.report.page.views import MatrixPattern, elimination
from symgen.symbolic.system import System

if TYPE_CHECKING:
    from symgen.runtime.elastic.model import ElasticModel
    from symgen.runtime.kernels.description import Described

#: Maximum number of unknowns for which the pattern of the equations is drawn.
_DRAWN = 40
_BYTES = 8


def matrix_lines(system: System) -> Iterator[str]:
    """Yield the size of every matrix, its number of nonzero entries and its source."""
    yield "matrices, with the number of nonzero entries:"
    width = max(len(m.name) for m in system.matrices)
    for m in system.matrices:
        filled = sum(x != 0 for x in m.matrix)
        source = f"; {m.source}" if m.source else ""
        yield f"  {m.name:{width}}  {m.matrix.rows} x {m.matrix.cols}: {filled} of {len(m.matrix)}{source}"


def solver_lines(system: System) -> Iterator[str]:
    """Yield the factorisation of [M J^T; J 0]: elimination order, entries, fill-in and pattern."""
    point = system.saddle_point
    if point is None:
        return
    coordinates = system[point.mass].rows or tuple(map(str, range(system[point.mass].matrix.rows)))
    multipliers = system[point.jacobian].rows or tuple(map(str, range(system[point.jacobian].matrix.rows)))
    names = (*coordinates, *multipliers)
    pattern, factor = elimination(system, point)
    first = max(point.order[: len(coordinates)]) < len(coordinates) < len(names)
    method = (
        "all coordinates first, whose pivots are numbers"
        if first
        else "each multiplier after all coordinates of its row"
    )
    yield (
        f"equations of motion: [M J^T; J 0] of {pattern.rows} unknowns by L D L^T without pivoting, {method}:"
    )
    yield f"  {', '.join(names[k] for k in point.order)}"
    yield (
        f"  {len(pattern.cells)} nonzero entries and {len(pattern.fill)} entries of fill-in; the factor has "
        f"{factor}, a dense one would have {pattern.rows * (pattern.rows + 1) // 2}"
    )
    if point.costs:
        (chosen, cost), *others = point.costs
        than = "".join(f"; {name}: {'over ' if other > cost else ''}{other}" for name, other in others)
        yield f"  counted cost of a factorisation and a solution, {chosen}: {cost}{than}"
    if pattern.rows <= _DRAWN:
        yield from _drawn(pattern)


def _drawn(pattern: MatrixPattern) -> Iterator[str]:
    """Draw the nonzero entries (#) and the fill-in (+)."""
    signs = {**dict.fromkeys(pattern.fill, "+"), **dict.fromkeys(pattern.cells, "#")}
    for i in range(pattern.rows):
        yield "  " + " ".join(signs.get((i, j), ".") for j in range(pattern.columns))


def memory_lines(d: Described) -> Iterator[str]:
    """Yield the size in bytes of a float64 state and of the work memory of the largest kernel."""
    state = 2 * d.coordinates + int(getattr(d, "work_of_loads", False))
    yield f"memory: {state * _BYTES} bytes of state, {d.work_size * _BYTES} of work for the largest kernel"


def elastic_lines(model: ElasticModel) -> Iterator[str]:
    """Yield size and structure of the equations of elastic links, and the cost of solving a step."""
    layout = model.layout
    free, bound = layout.unknowns - layout.constraints, layout.constraints
    band = free - 1 if bound else layout.band
    storage = f"{len(layout.rows)} entries stored, bandwidth {band}"
    storage = f"full, for {bound} constraints are resolved" if bound else storage
    yield f"  its matrices: {free} x {free}, {storage}"
    yield f"  its state: {2 * free * _BYTES} bytes"
    yield f"  to solve for one stage of a step: at most {2 * free * band * (2 * band + 1)} operations"
