"""Banded systems with a dense border, compiled alone, against dense elimination by NumPy."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import symgen.runtime

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")

CORE = Path(symgen.runtime.__file__).parent / "core"
SHARED = """
#include "bands.h"
#include <stdlib.h>
int solved(long inner, long border, long band, const double *of, double *x) {
    const long n = inner + border;
    const struct band_store at = band_store(inner, band);
    struct bordered a = {inner, border, band};
    a.banded = malloc(sizeof(double) * at.size);
    a.right = malloc(sizeof(double) * (inner * border + 1));
    a.below = malloc(sizeof(double) * (inner * border + 1));
    a.corner = malloc(sizeof(double) * (border * border + 1));
    a.panel = malloc(sizeof(double) * (panel_size(border, band) + 1));
    a.pivots = malloc(sizeof(int) * (inner + 1));
    a.swaps = malloc(sizeof(ptrdiff_t) * (border + 1));
    clear_bordered(&a);
    for (long i = 0; i < n; i++)
        for (long j = 0; j < n; j++)
            if (i >= inner || j >= inner)
                set_in_border(&a, i, j, of[n * i + j]);
            else if (labs(i - j) <= band)
                a.banded[at.first + i + j * at.lead] = of[n * i + j];
    const int found = factor_bordered(&a);
    if (found)
        solve_bordered(&a, 1, x);
    free(a.banded), free(a.right), free(a.below), free(a.corner), free(a.panel), free(a.pivots), free(a.swaps);
    return found;
}
"""


@pytest.fixture(scope="module")
def solve(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bands")
    (folder / "shared.c").write_text(SHARED)
    files = [folder / "shared.c", CORE / "bands.c", CORE / "linear.c"]
    command = ["cc", "-std=gnu11", "-O1", "-shared", "-fPIC", f"-I{CORE}", *map(str, files), "-lm"]
    subprocess.run([*command, "-o", str(folder / "bands.so")], check=True)
    solved = ctypes.CDLL(str(folder / "bands.so")).solved

    def call(matrix, inner, band, side):
        numbers = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
        solved.argtypes = [ctypes.c_long] * 3 + [numbers] * 2
        x = side.copy()
        return x if solved(inner, len(side) - inner, band, np.ascontiguousarray(matrix), x) else None

    return call


def system(inner, border, band, rng, kind):
    n = inner + border
    matrix = rng.standard_normal((n, n))
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    banded = np.zeros((n, n), bool)
    banded[:inner, :inner] = True
    if kind == "weak diagonal":
        matrix[banded & (apart == 0)] *= 1e-6
    if kind == "strong last row":  # each pivot is taken from the end of the band
        matrix[banded & (np.arange(n)[:, None] - np.arange(n) == band)] *= 1e3
    matrix[banded & (apart > band)] = 0.0
    if kind == "gaps":
        matrix[banded & (apart > 0) & (rng.random((n, n)) < 0.5)] = 0.0
    return matrix


KINDS = ("full", "weak diagonal", "strong last row", "gaps")


# The banded part is solved alone: where it is ill-conditioned and the whole is not, a border loses digits.
@pytest.mark.parametrize(("kind", "border"), [*((kind, 0) for kind in KINDS), ("full", 3), ("gaps", 3)])
def test_solutions_are_those_of_dense_elimination(solve, kind, border):
    rng = np.random.default_rng(7)
    for inner in (1, 2, 3, 4, 5, 7, 8, 9, 16, 30, 61):
        for band in sorted({0, 1, 2, 3, 5, min(20, inner - 1)} & set(range(inner))):
            matrix = system(inner, border, band, rng, kind)
            side = rng.standard_normal(inner + border)
            x = solve(matrix, inner, band, side)
            left = np.max(np.abs(matrix @ x - side))
            assert left <= 1e-12 * np.max(np.abs(matrix)) * np.max(np.abs(x)), (inner, band)


def test_a_column_of_zeros_has_no_pivot(solve):
    matrix = system(9, 0, 2, np.random.default_rng(3), "full")
    matrix[:, 5] = 0.0
    assert solve(matrix, 9, 2, np.ones(9)) is None
