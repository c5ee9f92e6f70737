"""LU in the envelope of real and complex matrices, compiled alone, against dense elimination by NumPy."""

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
#include "envelope.h"
int solved(ptrdiff_t n, const ptrdiff_t *first, const ptrdiff_t *at, double *a, double *ai, double *x, double *y) {
    const struct envelope e = {n, first, at};
    const int regular = envelope_factor(&e, a, ai);
    if (regular)
        envelope_solve(&e, a, ai, x, y);
    return regular;
}
"""


@pytest.fixture(scope="module")
def solve(tmp_path_factory):
    folder = tmp_path_factory.mktemp("envelope")
    (folder / "shared.c").write_text(SHARED)
    files = [folder / "shared.c", CORE / "envelope.c"]
    command = ["cc", "-std=gnu11", "-O1", "-shared", "-fPIC", f"-I{CORE}", *map(str, files), "-lm"]
    subprocess.run([*command, "-o", str(folder / "envelope.so")], check=True)
    solved = ctypes.CDLL(str(folder / "envelope.so")).solved

    def call(matrix, first, side):
        """Solve a matrix whose rows and columns have their first entries at the places ``first``."""
        n = len(side)
        at = np.concatenate([[0], np.cumsum(np.arange(n) - first)]).astype(np.intp)
        entries = np.concatenate(
            [
                *(matrix[i, first[i] : i] for i in range(n)),
                *(matrix[first[i] : i, i] for i in range(n)),
                np.diag(matrix),
            ]
        )
        parts = [np.ascontiguousarray(part) for x in (entries, side) for part in (np.real(x), np.imag(x))]
        parts = [part.copy() for part in parts]
        passed = [part.ctypes.data_as(ctypes.c_void_p) for part in parts]
        if not np.iscomplexobj(matrix):
            passed[1] = passed[3] = None
        places = [np.asarray(x, dtype=np.intp).ctypes.data_as(ctypes.c_void_p) for x in (first, at)]
        regular = solved(ctypes.c_ssize_t(n), *places, *passed)
        return parts[2] + 1j * parts[3] if regular else None

    return call


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize(("n", "width"), [(1, 0), (2, 1), (9, 3), (40, 40), (67, 13), (130, 29)])
def test_random_envelopes(solve, n, width, kind):
    """Rows begin at random places within a width; the diagonal is large enough to eliminate without pivoting."""
    draw = np.random.default_rng(n + width)
    for _ in range(3):
        first = np.array([draw.integers(max(0, i - width), i + 1) for i in range(n)])
        matrix = draw.normal(size=(n, n)) + (1j * draw.normal(size=(n, n)) if kind is complex else 0.0)
        rows, columns = np.indices((n, n))
        matrix[(columns < first[rows]) | (rows < first[columns])] = 0.0
        matrix += np.diag((2.0 + width) * np.exp((1j if kind is complex else 0.0) * draw.uniform(0, 6, n)))
        side = draw.normal(size=n) + (1j * draw.normal(size=n) if kind is complex else 0.0)
        expected = np.linalg.solve(matrix, side)
        bound = 1e-14 * np.linalg.cond(matrix) * np.max(np.abs(expected))
        np.testing.assert_allclose(solve(matrix, first, side), expected, rtol=0, atol=bound)


@pytest.mark.parametrize("kind", [float, complex])
def test_a_vanishing_pivot_is_reported(solve, kind):
    matrix = np.array([[1.0, 2.0], [2.0, 4.0]], dtype=kind) * (1 + 1j if kind is complex else 1)
    assert solve(matrix, np.zeros(2, dtype=int), np.ones(2)) is None
