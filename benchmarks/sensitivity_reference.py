"""Derivatives along runs of the shipped linkages with 40 digits, for ``sensitivity.py``.

The equations of motion [M J^T; J 0] [a; lambda] = [f; gamma] are the matrices that SymPy derives, evaluated
in decimal arithmetic of ``DIGITS`` digits without the lowering, and integrated by extrapolation of Gragg's
modified midpoint rule (Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*, II.9). Named
coordinates are held at the start, of ``length_ratios`` angles of its rods; Newton's method gives the others.
The pump ``cssp`` has Lagrange's equations, linkages with elastic links in space those of
``tests/shared/directors_exact.py``. A derivative is the difference of two runs with the same steps, of which
one starts at ``CHANGE`` times the size of a coordinate or parameter away.

As a program, it writes ``tests/reference/run_slopes.json``; names of scenes select the recomputed entries.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from decimal import Decimal, getcontext
from pathlib import Path
from typing import Any

import mpmath
import sympy as sp

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from shared import directors_exact
from shared import floating_crank as pump
from shared.exact_slopes import IN_SPACE, RUNS, Setting, setting
from sympy.printing.pycode import PythonCodePrinter

import symgen

#: Digits of the arithmetic; the change by which differences are taken; the error of a step; digits stored.
DIGITS, CHANGE, TOLERANCE, STORED = 110, Decimal("1e-46"), Decimal("1e-46"), 25
#: Smaller derivatives are rounding.
ZERO = Decimal("1e-40")
#: Columns of the extrapolation.
COLUMNS = 20
#: Steps of the pump between two times.
PUMP_STEPS = 8
Vector = list[Decimal]


def main() -> None:
    """Compute and write; each scene as soon as it is finished."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that are stored")
    named = parser.parse_args().scenes
    getcontext().prec = mpmath.mp.dps = DIGITS
    stored = json.loads(RUNS.read_text()) if RUNS.exists() else {}
    for name in named or sorted(stored):
        if name in IN_SPACE:
            stored[name] = in_space(name)
        else:
            stored[name] = of_pump() if name == "cssp" else derivatives(setting(name))
        RUNS.write_text(json.dumps(dict(sorted(stored.items())), indent=1) + "\n")


def derivatives(case: Setting) -> dict[str, Any]:
    """Return names of directions and the derivatives of all coordinates at the end of the run, as text."""
    equations = Equations(case)
    base, steps = equations.run(case.start, {}, None)
    columns = {}
    for name in case.directions:
        start, values = list(case.start), {}
        if name in case.held:
            i = case.held.index(name)
            change = CHANGE * Decimal(case.sizes[i])
            start[i] += change
        else:
            change = CHANGE * (abs(Decimal(case.model.parameters[name])) or 1)
            values[name] = Decimal(case.model.parameters[name]) + change
        moved, _ = equations.run(start, values, steps)
        slopes = [(a - b) / change for a, b in zip(moved, base, strict=True)]
        columns[name] = [f"{x:.{STORED}e}" if abs(x) > ZERO else "0" for x in slopes]
    return {"t_end": case.t_end, "held": case.held, "start": [str(x) for x in case.start], "by": columns}


def of_pump() -> dict[str, Any]:
    """Return the derivatives of the pump on a floating crank by Lagrange's equations, at times of its run."""
    symbols = (*pump.STATE, *pump.INPUTS, *pump.PARAMETERS)
    start = dict(zip(pump.STATE, (sp.pi / 4, sp.Rational(1, 100), 0, 0), strict=True))
    at = {
        x: pump.number(v) for x, v in (start | {pump.INPUTS[0]: 0, pump.INPUTS[1]: 2} | pump.VALUES).items()
    }
    place = sp.lambdify(symbols, pump.slider(), "mpmath", cse=True)
    change, times = mpmath.mpf(str(CHANGE)), (0.05, 0.12)

    def outputs(at: dict[Any, Any]) -> list[list[Any]]:
        held = [at[x] for x in (*pump.INPUTS, *pump.PARAMETERS)]

        def slope(_: Any, y: list[Any]) -> list[Any]:
            return [*y[2:], *mpmath.lu_solve(*pump.numbers(dict(zip(symbols, [*y, *held], strict=True))))]

        y, t, rows = [at[x] for x in pump.STATE], mpmath.mpf(0), []
        for end in times:
            h = (mpmath.mpf(end) - t) / PUMP_STEPS
            for _ in range(PUMP_STEPS):
                y, error = extrapolated(slope, t, y, h)
                assert error < mpmath.mpf("1e-40"), mpmath.nstr(error, 3)
            t = mpmath.mpf(end)
            rows.append([*y[:2], place(*y, *held), slope(t, y)[2]])
        return rows

    base = outputs(at)
    names = ["stall", "top", "pump", "k", "d", "rod", "F", "theta1", "S1", "theta1'", "S1'"]
    by = {}
    for name, x in zip(names, [*pump.PARAMETERS, pump.INPUTS[1], *pump.STATE], strict=True):
        moved = outputs(at | {x: at[x] + change})
        by[name] = [
            [mpmath.nstr((a - b) / change, STORED) for a, b in zip(new, old, strict=True)]
            for new, old in zip(moved, base, strict=True)
        ]
    return {"times": times, "values": [[mpmath.nstr(x, STORED) for x in row] for row in base], "by": by}


def in_space(name: str) -> dict[str, Any]:
    """Return values and derivatives of steps of a linkage with elastic links in space, and of frequencies."""
    made = {}
    for what, digits, change, text in (
        ("run", directors_exact.DIGITS, directors_exact.CHANGE, lambda x: f"{x:.{STORED}e}"),
        ("frequencies", 80, "1e-25", lambda x: mpmath.nstr(x, STORED)),
    ):
        getcontext().prec = mpmath.mp.dps = digits
        build, values, *_ = directors_exact.cases()[name]

        def found(
            changed: dict[str, Any], of: Any = build, values: Any = values, what: str = what
        ) -> list[Any]:
            linkage = of(values | changed)
            if what == "frequencies":
                return directors_exact.frequencies(linkage)
            return directors_exact.recorded(directors_exact.run(linkage))

        base, by = found({}), {}
        for parameter, value in values.items():
            step = value * mpmath.mpf(change)
            number = directors_exact.decimal if what == "run" else mpmath.mpf
            moved = found({parameter: value + step})
            by[parameter] = [text((a - b) / number(step)) for a, b in zip(moved, base, strict=True)]
        made[what] = {"values": [text(x) for x in base], "by": by}
    return made


class Equations:
    """The equations of a linkage as functions of decimal numbers."""

    def __init__(self, case: Setting) -> None:
        self.case, system = case, symgen.derive(case.scene).in_numbers()
        point = system.saddle_point
        assert point is not None
        self.groups = {g.name: [x.symbol for x in g.quantities] for g in system.groups}
        self.n = len(self.groups["q"])
        self.redundant = set(case.model.description.redundant)
        self.order = [i for i in point.order if i - self.n not in self.redundant]
        closed = ("constraints", "constraint_jacobian", "velocity_constraints")
        self.closed = compiled(system, closed)
        self.moving = compiled(system, (point.mass, point.jacobian, point.force, point.rhs))

    def known(self, t: Decimal, q: Vector, u: Vector, values: dict[str, Decimal]) -> list[Decimal]:
        """Return the arguments of the compiled functions."""
        tunable = [*self.case.model.parameters.items()]
        p = [values.get(name, Decimal(value)) for name, value in tunable]
        p += [Decimal(0)] * (len(self.groups["p"]) - len(p))
        return [t, *q, *u, *p]

    def begin(self, start: Vector, values: dict[str, Decimal]) -> tuple[Vector, Vector]:
        """Return the state on the constraints with the coordinates and rates of the case."""
        case, zero = self.case, Decimal(0)
        q, u = ([Decimal(x) for x in part] for part in (case.near.q, case.near.u))
        rows = [i for i in range(len(case.model.description.constraints)) if i not in self.redundant]
        for _ in range(12):
            places, jacobian, rates = self.closed(self.known(zero, q, u, values))
            matrix = [{j: x for (a, j), x in jacobian.items() if a == i} for i in rows]
            slopes, held = self.held(q, u, start)
            matrix += slopes
            change = solved(matrix, [-places.get((i, 0), zero) for i in rows] + [x for x, _ in held])
            rate = solved(matrix, [-rates.get((i, 0), zero) for i in rows] + [x for _, x in held])
            q = [a + b for a, b in zip(q, change, strict=True)]
            u = [a + b for a, b in zip(u, rate, strict=True)]
        assert max(map(abs, change), default=zero) < Decimal(10) ** (20 - DIGITS), case.name
        return q, u

    def held(self, q: Vector, u: Vector, start: Vector) -> tuple[list[dict[int, Decimal]], list[Vector]]:
        """Return slopes of the coordinates that are held, and changes of them and their rates to the start.

        Those of angles are of the distance of the end of the link from the line through its first point.
        """
        case, half = self.case, len(start) // 2
        if case.columns:
            wanted = zip(case.columns, start[:half], start[half:], strict=True)
            return [{c: Decimal(1)} for c in case.columns], [[a - q[c], b - u[c]] for c, a, b in wanted]
        slopes, changes, free = [], [], case.model.description.free
        for name, angle, rate in zip(case.coordinates, start[:half], start[half:], strict=True):
            c, s = of_mp("cos", angle), of_mp("sin", angle)
            ends = case.scene.links[name.removesuffix(".angle")].points
            slope, length, off, turning = dict[int, Decimal](), Decimal(0), Decimal(0), Decimal(0)
            for point, sign in zip(ends, (-1, 1), strict=True):
                at = 2 * free.index(point) if point in free else None
                x, y = (
                    (Decimal(float(v)) for v in case.near.positions[point]) if at is None else q[at : at + 2]
                )
                off, length = off + sign * (c * y - s * x), length + sign * (c * x + s * y)
                if at is not None:
                    slope |= {at: -sign * s, at + 1: sign * c}
                    turning += sign * (c * u[at + 1] - s * u[at])
            slopes.append(slope)
            changes.append([-off, rate * length - turning])
        return slopes, changes

    def slope(self, t: Decimal, y: Vector, values: dict[str, Decimal]) -> Vector:
        """Return the rates of coordinates and velocities."""
        n, zero = self.n, Decimal(0)
        mass, jacobian, force, gamma = self.moving(self.known(t, y[:n], y[n:], values))
        matrix: list[dict[int, Decimal]] = [
            {} for _ in range(n + len(self.case.model.description.constraints))
        ]
        for (i, j), x in mass.items():
            matrix[i][j] = x
        for (i, j), x in jacobian.items():
            matrix[n + i][j] = matrix[j][n + i] = x
        right = [force.get((i, 0), zero) for i in range(n)] + [
            gamma.get((i, 0), zero) for i in range(len(matrix) - n)
        ]
        place = {i: k for k, i in enumerate(self.order)}
        rows = [{place[j]: x for j, x in matrix[i].items() if j in place} for i in self.order]
        found = solved(rows, [right[i] for i in self.order])
        return y[n:] + [found[place[i]] for i in range(n)]

    def run(
        self, start: Vector, values: dict[str, Decimal], steps: list[Decimal] | None
    ) -> tuple[Vector, list[Decimal]]:
        """Return the coordinates at the end, and the steps: those given, or such that meet the tolerance."""
        t, end, taken = Decimal(0), Decimal(self.case.t_end), []
        q, u = self.begin(start, values)
        y, h = q + u, end

        def slope(t: Decimal, y: Vector) -> Vector:
            return self.slope(t, y, values)

        while t < end:
            h = steps[len(taken)] if steps else min(h, end - t)
            new, error = extrapolated(slope, t, y, h)
            if steps or error < TOLERANCE:
                y, t = new, t + h
                taken.append(h)
                h *= 2
            else:
                h /= 2
        return y[: self.n], taken


def extrapolated(
    slope: Callable[[Decimal, Vector], Vector], t: Decimal, y: Vector, h: Decimal
) -> tuple[Vector, Decimal]:
    """Return a step of the extrapolated midpoint rule, and its error relative to the state."""
    first, row = slope(t, y), []
    for j in range(1, COLUMNS + 1):
        n = 2 * j
        d = h / n
        old, new = y, [a + d * b for a, b in zip(y, first, strict=True)]
        for k in range(1, n):
            rate = slope(t + k * d, new)
            old, new = new, [a + 2 * d * b for a, b in zip(old, rate, strict=True)]
        last, row = row, [new]
        for k, before in enumerate(last, 1):
            part, rest = (j - k) ** 2, j**2 - (j - k) ** 2
            row.append([a + (a - b) * part / rest for a, b in zip(row[-1], before, strict=True)])
    size = max(map(abs, y))
    return row[-1], max(abs(a - b) for a, b in zip(row[-1], row[-2], strict=True)) / size


def solved(matrix: list[dict[int, Decimal]], right: Vector) -> Vector:
    """Solve sparse equations by elimination: of the rows with large pivots, the shortest one is the next."""
    rows = [(dict(row), b) for row, b in zip(matrix, right, strict=True)]
    finished: list[tuple[int, dict[int, Decimal], Decimal]] = []
    for column in range(len(rows)):
        holding = [k for k, (row, _) in enumerate(rows) if row.get(column)]
        largest = max(abs(rows[k][0][column]) for k in holding)
        choice = [k for k in holding if abs(rows[k][0][column]) * 1000 >= largest]
        row, b = rows.pop(min(choice, key=lambda k: len(rows[k][0])))
        pivot = row.pop(column)
        row, b = {j: x / pivot for j, x in row.items()}, b / pivot
        finished.append((column, row, b))
        for k, (other, c) in enumerate(rows):
            if factor := other.pop(column, None):
                for j, x in row.items():
                    other[j] = other.get(j, 0) - factor * x
                rows[k] = (other, c - factor * b)
    found: dict[int, Decimal] = {}
    for column, row, b in reversed(finished):
        found[column] = b - sum(x * found[j] for j, x in row.items())
    return [found[j] for j in range(len(found))]


class _Printer(PythonCodePrinter):
    """Prints expressions of decimal numbers."""

    def _print_Rational(self, e: Any) -> str:
        return f"(D({e.p})/D({e.q}))"

    def _print_Pow(self, e: Any, rational: bool = False) -> str:
        base, power = self._print(e.base), e.exp
        if not (2 * power).is_Integer:
            raise NotImplementedError(str(e))
        whole, root = divmod(abs(2 * power), 2)
        text = "*".join([f"({base})"] * int(whole) + [f"D({base}).sqrt()"] * int(root))
        return f"(1/({text}))" if power < 0 else f"({text})"

    def _print_Function(self, e: Any) -> str:
        return f"of_mp({e.func.__name__!r}, {', '.join(map(self._print, e.args))})"

    _print_sin = _print_cos = _print_atan = _print_atan2 = _print_tan = _print_asin = _print_acos = (
        _print_Function
    )
    _print_exp = _print_log = _print_Function

    def _print_Pi(self, e: Any) -> str:
        return "of_mp('pi')"


def of_mp(name: str, *arguments: Decimal) -> Decimal:
    """Return what a function of mpmath gives, or one of its constants, as a decimal number."""
    of = getattr(mpmath, name)
    value = of(*(mpmath.mpf(str(x)) for x in arguments)) if arguments else +of
    return Decimal(mpmath.nstr(value, DIGITS + 5, min_fixed=0, max_fixed=0))


def compiled(
    system: Any, names: tuple[str, ...]
) -> Callable[[list[Decimal]], list[dict[tuple[int, int], Decimal]]]:
    """Return a function of all arguments that returns the entries of matrices that are not zero."""
    matrices = [system[name].matrix for name in names]
    symbols = [
        x.symbol
        for g in ("t", "q", "u", "p")
        for group in system.groups
        if group.name == g
        for x in group.quantities
    ]
    needed = set().union(*(m.free_symbols for m in matrices))
    parts = []
    for d in reversed(system.definitions):
        if d.quantity.symbol in needed:
            needed |= d.expression.free_symbols
            parts.append((d.quantity.symbol, d.expression))
    entries = [[*m.todok().items()] for m in matrices]
    shared, whole = sp.cse(
        [e for _, e in parts[::-1]] + [e for found in entries for _, e in found], order="none"
    )
    shared_names = {s: f"c{i}" for i, (s, _) in enumerate(shared)}
    shown = {s: sp.Symbol(f"x{i}") for i, s in enumerate(symbols)}
    shown |= {s: sp.Symbol(name) for s, name in shared_names.items()}
    shown |= {s: sp.Symbol(f"d{i}") for i, (s, _) in enumerate(parts[::-1])}
    printer = _Printer({"fully_qualified_modules": False})

    def text(e: Any) -> str:
        return str(printer.doprint(e.xreplace(shown)))

    # Definitions and shared terms use each other, so both are in the order of their dependencies.
    lines = [(shown[s], e) for s, e in shared]
    lines += [(shown[s], e) for (s, _), e in zip(parts[::-1], whole[: len(parts)], strict=True)]
    body, known = [], {shown[s] for s in symbols}
    while lines:
        ready = [(s, e) for s, e in lines if {shown.get(x, x) for x in e.free_symbols} <= known]
        assert ready, "circular definitions"
        body += [f" {s} = {text(e)}" for s, e in ready]
        known |= {s for s, _ in ready}
        lines = [line for line in lines if line[0] not in known]
    values, k = [], len(parts)
    for found in entries:
        values.append(
            "{" + ", ".join(f"{place}: {text(whole[k + i])}" for i, (place, _) in enumerate(found)) + "}"
        )
        k += len(found)
    unpack = ", ".join(str(shown[s]) for s in symbols)
    code = f"def of(x):\n ({unpack},) = x\n" + "\n".join(body) + f"\n return [{', '.join(values)}]"
    space: dict[str, Any] = {"D": Decimal, "of_mp": of_mp}
    exec(code, space)
    return space["of"]  # type: ignore[no-any-return]


if __name__ == "__main__":
    main()
