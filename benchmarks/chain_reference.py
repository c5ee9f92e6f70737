"""Reference solution of the falling chains of ``work_precision.py`` with 30 digits, independent of symgen.

Lagrange's equations in the rods' absolute angles a_i, of uniform rods of 1 m and 1 kg. With the mass outboard
of rod i, C_ij = N - max(i, j) + 1/2 (i from 1; N - i + 1/3 on the diagonal) and G_i = N - i + 1/2,

    sum_j C_ij cos(a_i - a_j) a_j'' = -sum_j C_ij sin(a_i - a_j) a_j'^2 - g G_i cos(a_i),

solved by Cholesky's method and integrated by extrapolation of Gragg's modified midpoint rule, of order 20, in
steps that meet a tolerance (Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*, II.9).

As a program, it writes ``chain_reference.json``: the tips at the sample times, and their change between
successive tolerances.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Real = Any  # a number of mpmath

FILE = Path(__file__).with_suffix(".json")
SIZES, T_END, SAMPLES, GRAVITY, BEND = (3, 10), 2, 21, "9.81", "0.1"
DIGITS, COLUMNS, TOLERANCES = 30, 10, (1e-16, 1e-19)


def start_angles(n: int) -> list[float]:
    """Return the initial absolute angles [rad]: relative angles alternate between 0 and 0.1."""
    return [round(float(BEND) * ((i + 1) // 2), 12) for i in range(n)]


def tips(n: int) -> Array:
    """Return the stored positions [m] of the tip at the sample times, rounded to double."""
    stored = json.loads(FILE.read_text(encoding="utf-8"))["chains"][str(n)]
    return np.array([[float(x) for x in row] for row in stored["tips"]])


def uncertainty(n: int) -> float:
    """Return the change [m] of the stored positions between successive tolerances."""
    return float(json.loads(FILE.read_text(encoding="utf-8"))["chains"][str(n)]["moved"])


def solve(n: int, tolerance: float, samples: int = SAMPLES, columns: int = COLUMNS) -> list[list[Real]]:
    """Return the tips at the first sample times, for this local error, in the current mpmath precision."""
    rates = rates_of(n)
    bend = mpmath.mpf(BEND)
    y = [bend * ((i + 1) // 2) for i in range(n)] + [mpmath.mpf(0)] * n
    times = [mpmath.mpf(T_END) * k / (SAMPLES - 1) for k in range(samples)]
    return [_tip(state[:n]) for state in integrated(rates, y, times, tolerance, columns)]


def integrated(
    rates: Callable[[list[Real]], list[Real]],
    y: list[Real],
    times: Sequence[Real],
    tolerance: float,
    columns: int = COLUMNS,
) -> list[list[Real]]:
    """Return the states at these times, the first of which is that of ``y``, for this local error."""
    found, step = [y], (times[1] - times[0]) / 4
    for start, end in pairwise(times):
        left = end - start
        while left > 0:
            h = min(step, left)
            new, error = _extrapolated(rates, y, h, columns)
            step = h * min(2, max(0.2, 0.8 * (tolerance / max(error, 1e-40)) ** (1 / (2 * columns - 1))))
            if error <= tolerance:
                y, left = new, left - h
        found.append(y)
    return found


def _tip(angles: list[Real]) -> list[Real]:
    return [mpmath.fsum(map(mpmath.cos, angles)), mpmath.fsum(map(mpmath.sin, angles))]


def rates_of(
    n: int, of: Any = mpmath, number: Callable[[str], Real] = mpmath.mpf
) -> Callable[[list[Real]], list[Real]]:
    """Return the rates of angles and angular velocities of n rods as a function of these.

    ``of`` has the functions sin, cos and sqrt of a type of numbers, ``number`` reads one.
    """
    half, third, g = number("1") / 2, number("1") / 3, number(GRAVITY)
    mass = [[n - 1 - max(i, j) + (third if i == j else half) for j in range(n)] for i in range(n)]

    def rates(y: list[Real]) -> list[Real]:
        c, s = [of.cos(a) for a in y[:n]], [of.sin(a) for a in y[:n]]
        matrix = [
            [*(mass[i][j] * (c[i] * c[j] + s[i] * s[j]) for j in range(i)), mass[i][i]] for i in range(n)
        ]
        squares = [w * w for w in y[n:]]
        right = [
            -sum(mass[i][j] * (s[i] * c[j] - c[i] * s[j]) * squares[j] for j in range(n) if j != i)
            - g * (n - 1 - i + half) * c[i]
            for i in range(n)
        ]
        return y[n:] + cholesky(matrix, right, of.sqrt)

    return rates


def cholesky(a: list[list[Real]], b: list[Real], sqrt: Callable[[Real], Real]) -> list[Real]:
    """Solve a x = b in place for a symmetric positive definite a, given by its lower triangle."""
    n = len(b)
    for j in range(n):
        a[j][j] = sqrt(a[j][j] - sum(x * x for x in a[j][:j]))
        for i in range(j + 1, n):
            a[i][j] = (a[i][j] - sum(a[i][k] * a[j][k] for k in range(j))) / a[j][j]
        b[j] = (b[j] - sum(a[j][k] * b[k] for k in range(j))) / a[j][j]
    for j in reversed(range(n)):
        b[j] = (b[j] - sum(a[i][j] * b[i] for i in range(j + 1, n))) / a[j][j]
    return b


def _extrapolated(
    rates: Callable[[list[Real]], list[Real]], y: list[Real], h: Real, columns: int
) -> tuple[list[Real], float]:
    """Return one step of order 2 * columns, from midpoint rules with 2, 4, 6, ... substeps, and its error."""
    first = rates(y)
    table: list[list[Real]] = []
    for k in range(1, columns + 1):
        table.append(_midpoint(rates, y, first, h, 2 * k))
        for j in range(k - 2, -1, -1):
            shrink = mpmath.mpf(k) ** 2 / mpmath.mpf(j + 1) ** 2 - 1
            table[j] = [new + (new - old) / shrink for new, old in zip(table[j + 1], table[j], strict=True)]
    return table[0], float(max(abs(a - b) for a, b in zip(table[0], table[1], strict=True)))


def _midpoint(
    rates: Callable[[list[Real]], list[Real]], y: list[Real], first: list[Real], h: Real, count: int
) -> list[Real]:
    part = h / count
    before, now = y, [a + part * b for a, b in zip(y, first, strict=True)]
    for _ in range(count - 1):
        slope = rates(now)
        before, now = now, [a + 2 * part * b for a, b in zip(before, slope, strict=True)]
    return now


def main() -> int:
    """Compute and store."""
    argparse.ArgumentParser(description=__doc__.partition("\n")[0]).parse_args()
    stored: dict[str, Any] = {}
    for n in SIZES:
        with mpmath.workdps(DIGITS):
            coarse, fine = (solve(n, tolerance) for tolerance in TOLERANCES)
            moved = max(
                abs(x - y) for a, b in zip(coarse, fine, strict=True) for x, y in zip(a, b, strict=True)
            )
            stored[str(n)] = {
                "moved": mpmath.nstr(moved, 2),
                "tips": [[mpmath.nstr(x, 20) for x in row] for row in fine],
            }
            print(f"N = {n}: the tip moved by {mpmath.nstr(moved, 2)} m from one tolerance to the next")
    about = {
        "about": "Tips of uniform chains of N rods at equally spaced times, see chain_reference.py",
        "t_end": T_END,
        "chains": stored,
    }
    FILE.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
