"""heyoka's power series for the systems of ``taylor.py``: minimal equations, and those of symgen's record.

heyoka (F. Biscani, D. Izzo) compiles explicit equations y' = f(y). A chain has two such forms: in its
angles, and in the coordinates of its joints from the SymPy record, [M J^T; J 0] [a; lambda] = [f; gamma],
solved by elimination from the tip to the root. The latter is of order N, but nothing keeps its lengths.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from chain_reference import rates_of, start_angles
from numpy.typing import NDArray

import symgen

Array = NDArray[np.float64]

#: Above this number of intermediate variables heyoka compiles loops instead of straight code, which would
#: take minutes.
STRAIGHT = 700


def module() -> Any:
    """Import heyoka."""
    return importlib.import_module("heyoka")


def number(text: str) -> Any:
    """Return a decimal as an expression of heyoka."""
    return module().expression(float(text))


@dataclass(frozen=True)
class Program:
    """Explicit equations y' = rates(y) in heyoka for one initial state, an integrator for each tolerance.

    ``place`` returns the position of the compared point [m] for a state; ``in_angles``: whether it has angles
    and their rates, not coordinates and velocities.
    """

    name: str
    rates: Callable[[list[Any]], list[Any]]
    start: Array
    place: Callable[[Array], Sequence[float]]
    in_angles: bool = False

    def integrator(self, tolerance: float) -> Any:
        """Return an integrator, compiled for the tolerance."""
        heyoka = module()
        names = [f"y{i}" for i in range(len(self.start))]
        variables = list(heyoka.make_vars(*names))
        given = [(v, x + number("0")) for v, x in zip(variables, self.rates(variables), strict=True)]
        size = len(heyoka.taylor_adaptive(given, self.start, tol=1.0, compact_mode=True).decomposition)
        return heyoka.taylor_adaptive(given, self.start, tol=tolerance, compact_mode=size > STRAIGHT)

    def run(self, integrator: Any, t_end: float) -> Array:
        """Return the state at the end, from the start."""
        integrator.time = 0.0
        integrator.state[:] = self.start
        integrator.propagate_until(t_end)
        found: Array = integrator.state
        return found

    def sampled(self, integrator: Any, times: Array) -> Array:
        """Return the states at times (times, variables), the first of which is the start."""
        integrator.time = 0.0
        integrator.state[:] = self.start
        found: Array = integrator.propagate_grid(times)[-1]
        return found


def from_record(scene: symgen.Scene) -> Program:
    """Return a chain at rest in the coordinates of its joints, from the SymPy record of its scene."""
    heyoka, record = module(), symgen.derive(scene).in_numbers()
    q, u = (record.group(name).quantities for name in "qu")
    n, m = len(q), len(record["constraints"].matrix)
    terms = {x.symbol: heyoka.expression(f"y{i}") for i, x in enumerate((*q, *u))}
    for shared in record.definitions:
        terms[shared.quantity.symbol] = heyoka.from_sympy(shared.expression.evalf(), terms)
    size = n // m  # coordinates of a joint
    order = [k for link in reversed(range(m)) for k in (*range(size * link, size * link + size), n + link)]

    def entries(matrix: str) -> dict[tuple[int, int], Any]:
        found = record[matrix].matrix.todok()
        return {at: heyoka.from_sympy(x.evalf(), terms) for at, x in found.items()}

    jacobian = entries("constraint_jacobian")
    matrix = entries("mass_matrix") | {(n + i, j): x for (i, j), x in jacobian.items()}
    matrix |= {(j, n + i): x for (i, j), x in jacobian.items()}
    right = {i: x for (i, _), x in entries("force").items()}
    right |= {n + i: x for (i, _), x in entries("acceleration_rhs").items()}

    def rates(y: list[Any]) -> list[Any]:
        return [*y[n:], *eliminated(dict(matrix), dict(right), order)[:n]]

    state = symgen.build(scene).initial_state()
    return Program("SymPy record", rates, np.concatenate([state.q, state.u]), lambda y: y[n - size : n])


def chains(n: int) -> list[Program]:
    """Return the falling chain of ``work_precision.py`` in both forms."""
    from work_precision import scene

    start = np.concatenate([start_angles(n), np.zeros(n)])

    def place(y: Array) -> list[float]:
        return [float(np.sum(f(y[:n]))) for f in (np.cos, np.sin)]

    rates = rates_of(n, module(), number)
    return [Program("minimal equations", rates, start, place, in_angles=True), from_record(scene(n))]


def eliminated(matrix: dict[tuple[int, int], Any], right: dict[int, Any], order: Sequence[int]) -> list[Any]:
    """Solve a symmetric sparse system by elimination without pivoting, in this order."""
    for step, k in enumerate(order):
        rest = [i for i in order[step + 1 :] if (i, k) in matrix]
        for i in rest:
            factor = matrix[i, k] / matrix[k, k]
            for j in rest:
                change = factor * matrix[k, j]
                matrix[i, j] = matrix[i, j] - change if (i, j) in matrix else -change
            if k in right:
                right[i] = right[i] - factor * right[k] if i in right else -factor * right[k]
    found: dict[int, Any] = {}
    for step in reversed(range(len(order))):
        k = order[step]
        known = [matrix[k, j] * found[j] for j in order[step + 1 :] if (k, j) in matrix]
        value = right.get(k, number("0"))
        found[k] = (value - sum(known) if known else value) / matrix[k, k]
    return [found[k] for k in sorted(found)]
