"""Errors of compiled kernels, entry by entry, compared with the errors explained by their condition."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from symgen.study.accuracy.kernels import ComparedKernels
from symgen.study.accuracy.states import At
from symgen.symbolic.exact import DIGITS, number, solve

Array = NDArray[np.float64]

#: An entry smaller than this relative to the output is zero at 40 digits.
_ZERO = mpmath.mpf(10) ** (10 - DIGITS)
#: Errors up to this multiple of those explained by the condition are acceptable.
SOUND = 30.0
#: Equations of motion whose condition exceeds this over epsilon or the rank tolerance have no solution.
_SINGULAR = 0.01
#: The kernels that solve the equations of motion, and their outputs.
_SOLVERS = {"accelerations": ("accelerations", "multipliers"), "solve": ("solution",)}


@dataclass(frozen=True, slots=True)
class Worst:
    """An entry of an output, at the state with its largest error.

    Attributes
    ----------
    entry
        Row and column names of the entry.
    state
        Label of the state.
    found, exact
        Computed and reference values.
    ulps
        Error in units in the last place of the entry.
    relative
        Error relative to the entry.
    condition
        sum |x_j df/dx_j| / |f| over all inputs x_j of the kernel: amplification of relative input errors,
        independent of the code. For solutions, at least the condition of the equations.
    beyond
        Error relative to the effect of input rounding: relative / (epsilon condition), with a condition of
        at least one.
    """

    entry: str
    state: str
    found: float
    exact: float
    ulps: float
    relative: float
    condition: float
    beyond: float


@dataclass(frozen=True, slots=True)
class OutputAccuracy:
    """One output of one kernel.

    Attributes
    ----------
    kernel, output, unit
        The kernel, its output and the unit.
    entries
        Number of entries.
    worst
        Entry with the largest error in units in the last place; None if all are exactly zero.
    needless
        Entry with the largest error relative to the error explained by its condition.
    of_largest
        Largest error relative to the largest entry of the output at the same state.
    beyond_largest
        Largest error relative to the effect of input rounding on the most sensitive entry:
        error / (epsilon size), with the size the largest entry or sum |x_j df/dx_j|.
    of_zeros
        Largest computed value of an entry that is exactly zero, relative to the largest entry of the output.
    """

    kernel: str
    output: str
    unit: str
    entries: int
    worst: Worst | None
    needless: Worst | None
    of_largest: float
    beyond_largest: float
    of_zeros: float

    @property
    def beyond(self) -> float:
        """The largest error relative to the effect of input rounding."""
        return self.needless.beyond if self.needless else 0.0

    @property
    def verdict(self) -> str:
        """The cause of lost digits.

        ``problem``: the condition explains them. ``small entry``: it does not, but only entries that are
        small relative to others of the output are affected. ``code``: neither. Empty if almost no digits are
        lost.
        """
        if self.beyond > SOUND:
            return "code" if self.beyond_largest > SOUND else "small entry"
        return "problem" if self.worst and self.worst.ulps > SOUND else ""


@dataclass(frozen=True, eq=False)
class EntryAtState:
    """An entry of ``out`` at a state, and its condition."""

    kernel: str
    output: str
    at: At
    entry: int
    condition: float


class KernelErrors:
    """Accumulates the errors of kernels over states.

    ``condition`` is the largest condition of solvable equations of motion, with the state; ``unsolved`` are
    the states at which the equations are singular.
    """

    def __init__(self, part: ComparedKernels, epsilon: float, random: np.random.Generator) -> None:
        self.part, self.epsilon, self.random = part, epsilon, random
        self.condition: tuple[float, str] | None = None
        self.unsolved: list[str] = []
        self._outputs: dict[tuple[str, str], _Output] = {}

    def look(self, at: At) -> None:
        """Evaluate the errors at one state."""
        if self.part.solves(at):
            self._look_at_solutions(at)
        exports = self.part.exports_at(at)
        names = tuple(m for matrices in exports.values() for m in matrices)
        exact = dict(zip(names, self.part.exact.matrices(names, at.arrays), strict=True))
        for kernel, matrices in exports.items():
            result, tape = self.part.call(kernel, at.arrays), self.part.tapes[kernel]
            spread, first = tape.conditions(tape.values(at.arrays)), 0
            for name in matrices:
                truth = list(exact[name])
                places = range(first, first + len(truth))
                self._output(kernel, name).add(at, result, truth, [spread[i] for i in places], first)
                first += len(truth)

    def _look_at_solutions(self, at: At) -> None:
        whole, rhs = self.part.exact.whole(at.arrays)
        left_out = self._left_out
        equations = _Equations(whole, left_out)
        if equations.condition * max(self.epsilon, self._rank_tolerance) > _SINGULAR:
            self.unsolved.append(at.label)
            return
        if self.condition is None or equations.condition > self.condition[0]:
            self.condition = equations.condition, at.label
        n, random = self._coordinates, self.random.standard_normal(whole.rows)
        for kernel, right in (("accelerations", rhs), ("solve", mpmath.matrix(random.tolist()))):
            if kernel not in self.part.tapes:
                continue
            truth = list(solve(whole, right, left_out))
            spread = equations.spread([float(x) for x in truth], [float(x) for x in right])
            if kernel == "accelerations":
                tape = self.part.tapes[kernel]
                conditions = tape.conditions(tape.values(at.arrays))
                spread = [max(conditions[i], s) for i, s in enumerate(spread)]
            solution = self.part.call(kernel, at.arrays | {"rhs": random})
            parts = (0, n, whole.rows) if kernel == "accelerations" else (0, whole.rows)
            for name, a, b in zip(_SOLVERS[kernel], parts, parts[1:], strict=False):
                if b > a:
                    self._output(kernel, name).add(at, solution, truth[a:b], spread[a:b], a)

    @property
    def _coordinates(self) -> int:
        point = self.part.system.saddle_point
        return self.part.system[point.mass].matrix.rows if point else 0

    @property
    def _rank_tolerance(self) -> float:
        point = self.part.system.saddle_point
        return float(point.rank_tolerance) if point else 0.0

    @property
    def _left_out(self) -> list[int]:
        return [self._coordinates + i for i in self.part.redundant]

    def _output(self, kernel: str, name: str) -> _Output:
        if (kernel, name) not in self._outputs:
            self._outputs[kernel, name] = _Output(self.part, kernel, name, self.epsilon)
        return self._outputs[kernel, name]

    def _in_order(self) -> list[_Output]:
        order = list(self.part.tapes)
        return sorted(self._outputs.values(), key=lambda o: order.index(o.kernel))

    def outputs(self) -> list[OutputAccuracy]:
        """Return the errors of all outputs, in the order of the kernels."""
        return [o.result() for o in self._in_order()]

    def places(self) -> Iterator[EntryAtState]:
        """Yield the entries with the largest errors that can be analysed further."""
        for o in self._in_order():
            if o.kernel != "solve":  # 'accelerations' includes its operations
                yield from o.places()


class _Output:
    """The errors of one output."""

    def __init__(self, part: ComparedKernels, kernel: str, name: str, epsilon: float) -> None:
        self.kernel, self.name, self.epsilon, self.prefix = kernel, name, epsilon, part.prefix
        matrix = None if kernel in _SOLVERS else part.system[name]
        labels = [x.name for x in part.system.group("work").quantities]
        self.unit = matrix.unit if matrix else "m/s^2, N/m"
        self.rows = matrix.rows if matrix else tuple(labels)
        self.columns = matrix.columns if matrix else ()
        self.width = matrix.matrix.cols if matrix else 1
        self.count = 0
        self.of_largest = self.beyond_largest = self.of_zeros = 0.0
        #: Largest errors in ulps and relative to the condition: value, entry and state.
        self.worst: dict[str, tuple[Worst, EntryAtState]] = {}

    def add(self, at: At, computed: Array, truth: Sequence[Any], spread: Sequence[float], first: int) -> None:
        """Compare the entries from ``first`` on with the reference; ``spread`` is the effect of rounding."""
        self.count = len(truth)
        with mpmath.workdps(DIGITS):
            largest = float(max(map(abs, truth), default=mpmath.mpf(0)))
            size = max(largest, *spread)
            for i, (exact, moved) in enumerate(zip(truth, spread, strict=True)):
                value = number(computed[first + i])
                if value == exact:
                    continue
                error = float(abs(value - exact)) if mpmath.isfinite(value) else math.inf
                self.of_largest = max(self.of_largest, _over(error, largest))
                self.beyond_largest = max(self.beyond_largest, _over(error, self.epsilon * size))
                if abs(exact) <= _ZERO * size:
                    self.of_zeros = max(self.of_zeros, _over(error, largest))
                else:
                    self._keep(at, i, first, float(value), exact, error, moved)

    def _keep(self, at: At, i: int, first: int, value: float, exact: Any, error: float, moved: float) -> None:
        size = float(abs(exact))
        ulp = math.ldexp(self.epsilon, int(mpmath.frexp(exact)[1]) - 1)
        beyond = error / (self.epsilon * max(size, moved))
        for measure, measured in (("ulps", error / ulp), ("beyond", beyond)):
            if measure not in self.worst or measured > getattr(self.worst[measure][0], measure):
                worst = Worst(
                    self._label(i, first),
                    at.label,
                    value,
                    float(exact),
                    error / ulp,
                    error / size,
                    moved / size,
                    beyond,
                )
                self.worst[measure] = worst, EntryAtState(self.kernel, self.name, at, first + i, moved / size)

    def _label(self, i: int, first: int) -> str:
        """Return the row and column names of an entry; indices if it has none."""
        if self.kernel in _SOLVERS:
            return self.rows[first + i]
        row, column = divmod(i, self.width)
        words = [
            names[k] if names else str(k + 1)
            for names, k, many in (
                (self.rows, row, self.count > self.width),
                (self.columns, column, self.width > 1),
            )
            if many
        ]
        return ", ".join(words)

    def result(self) -> OutputAccuracy:
        """Return the error summary."""
        worst, needless = (self.worst[k][0] if k in self.worst else None for k in ("ulps", "beyond"))
        return OutputAccuracy(
            self.prefix + self.kernel,
            self.name,
            self.unit,
            self.count,
            worst,
            needless,
            self.of_largest,
            self.beyond_largest,
            self.of_zeros,
        )

    def places(self) -> list[EntryAtState]:
        """Return the entries with the largest errors."""
        return [place for _, place in self.worst.values()]


class _Equations:
    """Equilibrated equations of motion at one state, in double precision."""

    def __init__(self, whole: mpmath.matrix, left_out: Sequence[int]) -> None:
        self.size = whole.rows
        self.indices = [i for i in range(whole.rows) if i not in left_out]
        matrix = np.array([[float(whole[i, j]) for j in self.indices] for i in self.indices])
        scale = np.ones(len(matrix))
        for _ in range(4):
            scale /= np.sqrt(np.max(np.abs(matrix * np.outer(scale, scale)), axis=1))
        scaled = matrix * np.outer(scale, scale)
        self.condition = float(np.linalg.cond(scaled))
        self._sizes = np.abs(matrix)
        self._inverse = np.abs(np.linalg.inv(scaled)) * np.outer(scale, scale)

    def spread(self, solution: Sequence[float], rhs: Sequence[float]) -> list[float]:
        """Return |A^-1| (|A| |x| + |b|): effect of rounding of every entry on the solution, per epsilon."""
        x, b = (np.abs(np.array(v)[self.indices]) for v in (solution, rhs))
        spread = np.zeros(self.size)
        spread[self.indices] = self._inverse @ (self._sizes @ x + b)
        return spread.tolist()


def _over(a: float, b: float) -> float:
    return a / b if b else (math.inf if a else 0.0)
