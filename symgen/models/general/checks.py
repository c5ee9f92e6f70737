"""Checks of a System that states a motion, before anything follows from it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import sympy as sp

from symgen.errors import DerivationError, nearest
from symgen.symbolic.quantity import AXES
from symgen.symbolic.system import Definition, System

#: Matrices by which a System states a motion; outputs have other names.
STATED = ("mass_matrix", "force", "constraints", "potential_energy", "positions", "events", "ending_events")
_REQUIRED = STATED[:2]
#: Matrices that hold no rates, and those of one column.
_OF_POSE = ("mass_matrix", "constraints", "potential_energy", "positions")
_COLUMNS = ("constraints", "events", "ending_events")
#: Names of what follows from a motion: matrices, then kernels; and of what results have besides.
_FOLLOWING = (
    "kinetic_energy", "power", "energy", "drawn", "start_rates", "start_jacobian", "assembly_residual",
    "assembly_jacobian", "constraint_scale", "constraint_jacobian", "velocity_constraints",
    "acceleration_rhs", "velocities", "point_accelerations", "residual",
)  # fmt: skip
_KERNELS = (
    "accelerations", "factor", "solve", "setup", "limits", "energy", "points", "point_accelerations",
    "constraints", "velocity_constraints", "constraint_jacobian", "drawn", "mass_matrix", "start_velocity",
    "start_momentum", "metric", "assembly", "residual", "events", "run_end", "reactions", "line_lengths",
)  # fmt: skip
_OF_RESULTS = ("time", "axis", "run")
#: Digits in which expressions are compared with zero, and the number of points.
_DIGITS, _POINTS = 40, 4


def check(system: System) -> None:
    """Raise DerivationError for a System whose motion is not complete, or not one that symgen derives."""
    arrays = {g.name: g.quantities for g in system.groups}
    _check_shapes(system, len(arrays.get("q", ())), len(arrays.get("u", arrays.get("q", ()))))
    if len(arrays.get("t", ())) > 1:
        raise _fault(system, f"expected one quantity in the group t, the time, got {len(arrays['t'])}")
    _check_names(system, [x.name for name in ("q", "u") for x in arrays.get(name, ())])
    _check_values(system, [x.name for name in ("q", "u", "p") for x in arrays.get(name, ())])
    rates = {x.symbol for x in arrays.get("u", ())}
    for d in system.definitions:
        if d.expression.free_symbols & rates:
            rates.add(d.quantity.symbol)
    for name in _OF_POSE:
        held = sorted(map(str, system[name].matrix.free_symbols & rates)) if name in system else []
        if held:
            raise _fault(
                system,
                f"{name} depends on a rate, {held[0]}\n  Only force, events and outputs may: constraints "
                "on rates, and energies of rates beyond u . M u / 2, are not supported.",
            )
    mass = system["mass_matrix"].matrix
    for i in range(mass.rows):
        for j in range(i):
            if not vanishes(mass[i, j] - mass[j, i], system.definitions):
                raise _fault(
                    system,
                    f"expected a symmetric mass_matrix, got different entries ({j}, {i}) and ({i}, {j})",
                )


def _fault(system: System, problem: str) -> DerivationError:
    return DerivationError(f"{system.name}: {problem}")


def _check_shapes(system: System, n: int, rates: int) -> None:
    lacking = next((name for name in _REQUIRED if name not in system), None)
    if lacking is not None:
        raise _fault(
            system,
            f"values are those of a motion, which needs a matrix {lacking!r}\n"
            "  Add it, or leave values out: the kernels can then be called, and nothing is simulated.",
        )
    if not n or rates != n:
        raise _fault(system, f"expected groups q and u of equal length, got {n} and {rates}")
    shapes: dict[str, tuple[int, int]] = {"mass_matrix": (n, n), "force": (n, 1), "potential_energy": (1, 1)}
    shapes |= {name: (system[name].matrix.rows, 1) for name in _COLUMNS if name in system}
    for name, shape in shapes.items():
        if name in system and system[name].matrix.shape != shape:
            got = " x ".join(map(str, system[name].matrix.shape))
            raise _fault(system, f"expected {name} of {shape[0]} x {shape[1]}, got {got}")
    if "positions" in system:
        m = system["positions"]
        if not (m.rows and len(m.columns) > 1 and m.columns == tuple(AXES)[: len(m.columns)]):
            raise _fault(
                system,
                "expected positions with names of points as rows, and the columns x and y, or x, y and z; "
                f"got rows {list(m.rows)} and columns {list(m.columns)}",
            )


def _check_names(system: System, variables: Sequence[str]) -> None:
    matrices = [m.name for m in system.matrices if m.name not in STATED]
    reserved = (*_FOLLOWING, *_OF_RESULTS)
    for name in (*variables, *matrices):
        if name in reserved or (name in STATED and name in variables):
            raise _fault(system, f"{name!r} is the name of what follows from the motion; choose another")
    both = next((name for name in matrices if name in variables), None)
    if both is not None:
        raise _fault(system, f"{both!r} is a coordinate or rate and a matrix; rename the matrix")
    kernel = next((e.kernel for e in system.exports if e.kernel in _KERNELS), None)
    if kernel is not None:
        raise _fault(system, f"a kernel is called {kernel!r}, as one that follows from the motion; rename it")


def _check_values(system: System, known: Sequence[str]) -> None:
    if not isinstance(system.values, Mapping):
        raise _fault(system, f"expected values as a mapping from names to numbers, got {system.values!r}")
    for name, value in system.values.items():
        if name not in known:
            raise _fault(system, f"values: there is no {name!r}. {nearest(str(name), known)}")
        try:
            number = math.nan if isinstance(value, str | bytes) else float(value)
        except (TypeError, ValueError):
            number = math.nan
        if not math.isfinite(number):
            raise _fault(system, f"values: expected a finite number in SI units for {name}, got {value!r}")
    parameters = next((g.quantities for g in system.groups if g.name == "p"), ())
    missing = next((p.name for p in parameters if p.name not in system.values), None)
    if missing is not None:
        raise _fault(
            system,
            f"the parameter {missing} has no value\n  Give one in values, such as "
            f'values={{"{missing}": 1.0}}.',
        )


def vanishes(expression: sp.Expr, definitions: Sequence[Definition]) -> bool:
    """Return whether an expression is zero at several points, with unrelated values of its symbols."""
    return expression == 0 or all(
        abs(sp.Add(*terms)) <= sp.Float(10) ** (5 - _DIGITS) * sp.Add(*map(abs, terms))
        for terms in _sampled(expression, definitions)
    )


def _sampled(expression: sp.Expr, definitions: Sequence[Definition]) -> Iterator[list[sp.Expr]]:
    """Yield the terms of an expression at points of different signs."""
    names = [d.quantity.symbol for d in definitions]
    free = set[sp.Symbol]().union(expression.free_symbols, *(d.expression.free_symbols for d in definitions))
    symbols = sorted(free.difference(names), key=str)
    for point in range(_POINTS):
        values: dict[sp.Symbol, sp.Expr] = {}
        for i, s in enumerate(symbols, 2):
            sign = -1 if (i >> max(point - 1, 0)) % 2 and point else 1
            values[s] = sign * sp.Rational(sp.prime(i), 7 * i + point + 1)
        for d in definitions:
            values[d.quantity.symbol] = sp.N(d.expression.xreplace(values), _DIGITS)
        yield [sp.N(term.xreplace(values), _DIGITS) for term in sp.Add.make_args(expression)]
