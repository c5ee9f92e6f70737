"""Whether two poses of a loop are on one assembly branch, by the sign of a determinant; alone and in lanes."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import symgen.runtime

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")

CORE = Path(symgen.runtime.__file__).parent / "core"
ROWS = 6
DRIVER = """
#include <string.h>

#include "loop_branch.h"
/* Screws come as columns, each component of all lanes. */
void on_one_branch(long rank, wide *followed, wide *columns, int *same) {
    wide scratch[ROWS * ROWS], kept[ROWS * ROWS];
    struct loop l = {.sizes = {.n = rank, .solved = rank, .rank = rank}, .followed = kept, .columns = followed};
    memcpy(scratch, followed, (size_t)(ROWS * rank) * sizeof(wide));
    qr_factorise(scratch, rank, &l.factor);
    keep_columns(&l, ~(mask){0});
    memcpy(scratch, columns, (size_t)(ROWS * rank) * sizeof(wide));
    qr_factorise(scratch, rank, &l.factor);
    l.columns = columns;
    const mask found = same_branch_of(&l);
    for (int lane = 0; lane < WIDTH; lane++)
        same[lane] = WIDTH == 1 ? any(found) : ((const long long *)&found)[lane] != 0;
}
"""


@pytest.fixture(scope="module")
def on_one_branch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop_branch")
    (folder / "driver.c").write_text(DRIVER)
    compiled = {}
    for width in (1, 2):
        made = folder / f"driver_{width}.so"
        options = ["-std=gnu11", "-O1", "-shared", "-fPIC", f"-DWIDTH={width}", f"-I{CORE}"]
        sources = [str(folder / "driver.c"), *([str(CORE / "linear.c")] if width == 1 else [])]
        subprocess.run(["cc", *options, *sources, "-o", str(made), "-lm"], check=True)
        compiled[width] = ctypes.CDLL(str(made)).on_one_branch

    def call(*products):
        """Return for each lane whether screws e_1, e_2, ... and others with these products are on one branch."""
        rank = len(products[0])
        followed, columns = np.zeros((2, rank, ROWS, len(products)))
        followed[range(rank), range(rank)] = 1.0
        columns[:, :rank] = np.transpose(products, (2, 1, 0))
        memory = [np.require(x, requirements="A") for x in (followed, columns)]
        same = np.zeros(len(products), dtype=np.intc)
        pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (*memory, same)]
        compiled[len(products)](rank, *pointers)
        return same.astype(bool).tolist()

    return call


@pytest.mark.parametrize("rank", range(1, ROWS + 1))
def test_the_sign_of_the_determinant_decides(on_one_branch, rank):
    """Numbers from a fixed seed; NumPy's determinant is the reference."""
    for product in np.random.default_rng(3).normal(size=(10, rank, rank)):
        assert on_one_branch(product) == [bool(np.linalg.det(product) > 0)]
        assert on_one_branch(product, -product) == [bool(np.linalg.det(x) > 0) for x in (product, -product)]


@pytest.mark.parametrize("rank", [3, ROWS])
@pytest.mark.parametrize("zeros", [[0], [0, 1], [1], [2], [0, 1, 2]])
def test_a_zero_determinant_has_no_sign(on_one_branch, rank, zeros):
    """Pivots that are exactly zero, the first of which ends an elimination; a lane beside is unaffected."""
    product = np.eye(rank)
    product[zeros, zeros] = 0.0
    assert on_one_branch(product) == [False]
    assert on_one_branch(product, product) == [False, False]
    assert on_one_branch(product, np.eye(rank)) == [False, True]
