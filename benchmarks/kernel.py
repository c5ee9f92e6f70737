"""The generated acceleration kernel of the Peaucellier linkage against NumPy: speed and error.

Both solve [M J^T; J 0] [a; lambda] = [f; gamma] with 15 unknowns at the same states. The kernel is
straight-line C, timed in a compiled loop. NumPy scatters the Jacobian into a matrix that already contains the
constant part, using precomputed index arrays, and calls ``numpy.linalg.solve``: for one state per call, as in
a step loop in Python, and for all states in one call. Errors are measured against the 30-digit solution of
the same system by mpmath, from the derived matrices.

The states are the drawn pose with all coordinates displaced by up to 4 mm, and random velocities.
They violate the constraints and their rates, which does not matter here, but are regular: J has full rank,
and the largest condition number is printed.
"""

from __future__ import annotations

import sys
from typing import Any

import mpmath
import numpy as np
import sympy as sp
from harness import Case, Measurement, Required, arguments, measure, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.runtime import _core

Array = NDArray[np.float64]

SCENE = "peaucellier"
STATES, SEED = 64, 20
SHIFT, SPEED = 0.004, 0.3  # m, m/s
KERNEL_TIMES, NUMPY_TIMES = 200, 2
DIGITS, GUARD = 30, 15
MATRICES = ("mass_matrix", "constraint_jacobian", "force", "acceleration_rhs")


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__)
    model = symgen.build(SCENE)
    if model.backend == "numpy":
        print("this benchmark needs compiled kernels: install a C compiler", file=sys.stderr)
        return 1
    return report_repeats(lambda: measured(model), options)


def measured(model: symgen.Model) -> Measurement:
    """Measure once."""
    system, scene = symgen.derive(SCENE).in_numbers(), symgen.load_scene(SCENE)
    states = random_states(model)
    n = model.description.coordinates
    exact = Exact(system, list(model.parameters.values()))
    by_numpy = NumpyAssembly(exact, scene, model)

    address = model.library.addresses["accelerations"]
    sizes = model.description.sizes_of("accelerations")
    parameters = model.evaluator.parameters
    work = np.zeros(max(k.work_size for k in model.description.kernels) + 1)
    out = np.zeros((STATES, n + len(model.description.constraints)))
    one_by_one = np.zeros_like(out)

    def run_kernel() -> None:
        _core.call_repeatedly(address, sizes, KERNEL_TIMES, states, n, parameters, work, out)

    def run_numpy() -> None:
        for _ in range(NUMPY_TIMES):
            for i in range(STATES):
                one_by_one[i] = by_numpy.solve(states[i, :n], states[i, n : 2 * n])

    def run_batch() -> Array:
        return by_numpy.solve_all(states[:, :n], states[:, n : 2 * n])

    names = ("generated C", "NumPy, one state per call", "NumPy, all in one call")
    runs = (
        Case(run_kernel, KERNEL_TIMES * STATES),
        Case(run_numpy, NUMPY_TIMES * STATES),
        Case(run_batch, STATES),
    )
    timings = measure(dict(zip(names, runs, strict=True)))
    solutions = dict(zip(names, (out, one_by_one, run_batch()), strict=True))
    truth = [exact.solution(states[i, :n], states[i, n : 2 * n]) for i in range(STATES)]
    errors = {name: relative_error(found, truth, n) for name, found in solutions.items()}
    flops = model.operations["accelerations"]["flops"]
    fastest = timings[names[0]].median
    rows = [
        {
            "case": name,
            "time [s]": timings[name].median,
            "quartile 1 [s]": timings[name].lower,
            "quartile 3 [s]": timings[name].upper,
            "over C": timings[name].median / fastest,
            "relative error": errors[name],
            "operations": flops if name == names[0] else None,
        }
        for name in names
    ]
    required = [
        Required(
            "kernel faster than NumPy, one state per call",
            timings[names[1]].median / fastest,
            20,
            True,
            timed=True,
        ),
        Required("floating-point operations of the kernel", flops, 1000, False),
        Required("relative error of the kernel", errors[names[0]], 1e-12, False),
    ]
    notes = (
        f"{STATES} random states, regular (condition number up to {by_numpy.condition(states, n):.1e}), but "
        "not on the constraints; times are per state.",
        f"Errors are against {DIGITS} digits, over the largest acceleration or multiplier of a state.",
    )
    return Measurement(f"Accelerations of the {model.description.title}", rows, required, notes)


def random_states(model: symgen.Model) -> Array:
    """Return rows (q, u, 0) around the drawn pose [m, m/s]."""
    generator = np.random.default_rng(SEED)
    drawn = model.initial_state().q
    states = np.zeros((STATES, 2 * len(drawn) + 1))
    states[:, : len(drawn)] = drawn + generator.uniform(-SHIFT, SHIFT, (STATES, len(drawn)))
    states[:, len(drawn) : -1] = generator.uniform(-SPEED, SPEED, (STATES, len(drawn)))
    return states


class Exact:
    """The derived matrices, evaluated and solved by mpmath.

    Parameters
    ----------
    system
        Result of ``symgen.derive``.
    parameters
        Values of the tunable parameters.
    """

    def __init__(self, system: Any, parameters: list[float]) -> None:
        symbols = [x.symbol for name in "qup" for x in system.group(name).quantities]
        self.matrices = {m: sp.lambdify(symbols, system.expanded(m), "mpmath") for m in MATRICES}
        self.parameters = parameters

    def evaluate(self, name: str, q: Array, u: Array) -> Any:
        """Return one matrix at a state, in the current precision of mpmath."""
        values = [mpmath.mpf(float(x)) for x in (*q, *u, *self.parameters)]
        return self.matrices[name](*values)

    def solution(self, q: Array, u: Array) -> Any:
        """Return accelerations and multipliers to 30 digits, with guard digits for the condition number."""
        with mpmath.workdps(DIGITS + GUARD):
            mass, jacobian, force, gamma = (self.evaluate(m, q, u) for m in MATRICES)
            n, m = mass.rows, jacobian.rows
            matrix, rhs = mpmath.zeros(n + m, n + m), mpmath.zeros(n + m, 1)
            matrix[:n, :n], matrix[n:, :n], matrix[:n, n:] = mass, jacobian, jacobian.T
            rhs[:n, 0], rhs[n:, 0] = force, gamma
            return mpmath.lu_solve(matrix, rhs)


class NumpyAssembly:
    """The same equations of motion in carefully written NumPy.

    Constant data are precomputed: the mass matrix and gravity at their indices, the incidence matrix from
    point coordinates to rod vectors, and the flat indices of both Jacobian blocks. A call multiplies,
    scatters and solves.
    """

    def __init__(self, exact: Exact, scene: symgen.Scene, model: symgen.Model) -> None:
        description, known = model.description, model.initial_state().positions
        self.free, dimension = len(description.free), len(description.axes)
        self.n, self.m = self.free * dimension, len(description.constraints)
        place = {p: i for i, p in enumerate((*description.free, *description.ground))}
        ends = [[place[p] for p in scene.links[rod].points] for rod in description.constraints]
        incidence = np.zeros((self.m, len(place)))
        for k, (start, end) in enumerate(ends):
            incidence[k, start], incidence[k, end] = -1.0, 1.0
        self.incidence = np.ascontiguousarray(incidence[:, : self.free])
        self.fixed = incidence[:, self.free :] @ np.array([known[p] for p in description.ground])
        entries = [
            (self.n + k, point * dimension + axis, k * dimension + axis, incidence[k, point])
            for k in range(self.m)
            for point in ends[k]
            if point < self.free
            for axis in range(dimension)
        ]
        row, column, source, sign = (np.array(x) for x in zip(*entries, strict=True))
        size = self.n + self.m
        self.places = np.concatenate([row * size + column, column * size + row])
        self.source, self.sign = np.tile(source, 2), np.tile(sign, 2)
        self.matrix, self.rhs = np.zeros((size, size)), np.zeros(size)
        zero = np.zeros(self.n)
        with mpmath.workdps(DIGITS):
            mass, force = (exact.evaluate(name, zero, zero) for name in ("mass_matrix", "force"))
        self.matrix[: self.n, : self.n] = np.array(mass.tolist(), dtype=float)
        self.rhs[: self.n] = np.array(force.tolist(), dtype=float)[:, 0]
        self.flat = self.matrix.reshape(-1)

    def solve(self, q: Array, u: Array) -> Array:
        """Return accelerations and multipliers at one state."""
        along = self.incidence @ q.reshape(self.free, -1) + self.fixed
        rate = self.incidence @ u.reshape(self.free, -1)
        self.flat[self.places] = self.sign * along.reshape(-1)[self.source]
        self.rhs[self.n :] = -(rate * rate).sum(axis=1)
        solution: Array = np.linalg.solve(self.matrix, self.rhs)
        return solution

    def solve_all(self, q: Array, u: Array) -> Array:
        """Return accelerations and multipliers at many states, one per row."""
        matrices, rhs = self.assemble_all(q, u)
        solutions: Array = np.linalg.solve(matrices, rhs[:, :, None])[:, :, 0]
        return solutions

    def assemble_all(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Return matrices and right-hand sides at many states."""
        count = len(q)
        along = self.incidence @ q.reshape(count, self.free, -1) + self.fixed
        rate = self.incidence @ u.reshape(count, self.free, -1)
        matrices, rhs = (np.repeat(x[None], count, axis=0) for x in (self.matrix, self.rhs))
        matrices.reshape(count, -1)[:, self.places] = self.sign * along.reshape(count, -1)[:, self.source]
        rhs[:, self.n :] = -(rate * rate).sum(axis=2)
        return matrices, rhs

    def condition(self, states: Array, n: int) -> float:
        """Return the largest condition number of the system over the states."""
        return float(np.max(np.linalg.cond(self.assemble_all(states[:, :n], states[:, n : 2 * n])[0])))


def relative_error(found: Array, truth: list[Any], n: int) -> float:
    """Return the largest error of accelerations and multipliers, relative to the largest of each."""
    worst = 0.0
    for row, exact in zip(found, truth, strict=True):
        for part in (slice(0, n), slice(n, len(row))):
            values = list(exact)[part]
            with mpmath.workdps(DIGITS):
                miss = max(abs(mpmath.mpf(float(x)) - v) for x, v in zip(row[part], values, strict=True))
                worst = max(worst, float(miss / max(map(abs, values))))
    return worst


if __name__ == "__main__":
    raise SystemExit(main())
