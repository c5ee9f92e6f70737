"""When Newton's method of the compiled core ends, by errors of steps that are given; alone and in lanes."""

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
#include "newton.h"
struct steps { const double *errors; int *halved; };
static wide given(void *of, struct newton *w) {
    const struct steps *s = of;
    wide error;
    s->halved[w->count] = w->halved;
    for (int lane = 0; lane < WIDTH; lane++)
        ((double *)&error)[lane] = s->errors[WIDTH * w->count + lane];
    return error;
}
/* Return the number of steps; write for each lane whether it is solved. */
int steps_to_end(int most, const double *policy, int alternate, int halvings, const double *errors, int *halved,
                 int *solved) {
    struct newton w = {.most = most, .close = all(policy[0]), .rounded = all(policy[1]), .left = policy[2],
                       .grows = policy[3], .tolerated = policy[4], .alternate = alternate, .halvings = halvings};
    const mask every = ~(mask){0};
    mask found = newton_solve(&w, every, given, &(struct steps){errors, halved});
    for (int lane = 0; lane < WIDTH; lane++)
        solved[lane] = WIDTH == 1 ? any(found) : ((const long long *)&found)[lane] != 0;
    return w.count;
}
"""


@pytest.fixture(scope="module")
def ends(tmp_path_factory):
    folder = tmp_path_factory.mktemp("newton")
    (folder / "shared.c").write_text(SHARED)
    compiled = {}
    for width in (1, 2):
        made = folder / f"newton_{width}.so"
        options = ["-std=gnu11", "-O1", "-shared", "-fPIC", f"-DWIDTH={width}", f"-I{CORE}"]
        subprocess.run(["cc", *options, str(folder / "shared.c"), "-o", str(made), "-lm"], check=True)
        compiled[width] = ctypes.CDLL(str(made)).steps_to_end

    def call(*lanes, alternate=False, halvings=0, **policy):
        """Return whether each lane is solved, and how often the correction of every step was halved."""
        errors = np.ascontiguousarray(np.array(lanes, dtype=float).T)
        values = [policy.get(name, 0.0) for name in ("close", "rounded", "left")]
        numbers = np.array([*values, policy.get("grows", np.inf), policy.get("tolerated", 0.0)])
        halved, solved = np.zeros(len(errors), dtype=np.intc), np.zeros(len(lanes), dtype=np.intc)
        pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (numbers, errors, halved, solved)]
        steps = compiled[len(lanes)](
            len(errors), pointers[0], int(alternate), halvings, pointers[1], pointers[2], pointers[3]
        )
        return solved.astype(bool).tolist(), halved[:steps].tolist()

    return call


def test_an_error_is_close_or_rounding(ends):
    assert ends([1e-3, 1e-8, 1e-16, 9.0], close=1e-15) == ([True], [0, 0, 0])
    assert ends([1e-3, 4e-15, 3e-15, 9.0], close=1e-15, rounded=1e-12) == ([True], [0, 0, 0])
    assert ends([1e-3, 1e-4, 1e-5], close=1e-15, rounded=1e-12) == ([False], [0, 0, 0])


def test_the_rate_of_convergence_predicts_the_next_error(ends):
    """Errors of 1e-2 and 1e-4 have the rate 1/100: those that follow add up to 1.01e-6."""
    assert ends([1e-2, 1e-4, 9.0], left=1.1e-6) == ([True], [0, 0])
    assert ends([1e-2, 1e-4, 9.0], left=0.9e-6) == ([False], [0, 0, 0])


def test_growing_errors_diverge_unless_they_alternate(ends):
    assert ends([1.0, 0.4, 0.3, 0.0], grows=0.5) == ([False], [0, 0, 0])
    assert ends([1.0, 0.1, 0.9, 0.0], grows=1.0) == ([False], [0, 0, 0])
    assert ends([1.0, 0.1, 0.9, 0.0], grows=1.0, alternate=True) == ([True], [0, 0, 0, 0])
    assert ends([1.0, 0.1, 0.9, 0.0], grows=1.0, tolerated=0.95) == ([True], [0, 0, 0, 0])


def test_corrections_are_halved(ends):
    """Errors of halved corrections are compared with the one before them; after two halvings the last one stands."""
    assert ends([1.0, 3.0, 2.0, 0.9, 0.0], grows=1.0, halvings=3) == ([True], [0, 0, 1, 2, 0])
    assert ends([1.0, 3.0, 2.0, 1.5, 0.0], grows=1.0, halvings=2) == ([True], [0, 0, 1, 2, 0])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_steps_end_where_an_error_is_not_finite(ends, value):
    assert ends([1.0, value, 0.0], close=1.0 / 2, halvings=4) == ([False], [0, 0])
    assert ends([1.0, value, 0.0], rounded=np.inf) == ([False], [0, 0]), "whatever error counts as rounding"


def test_lanes_end_alone(ends):
    assert ends([1.0, 0.0, 1.0, 2.0], [1.0, 0.4, 0.1, 0.0], grows=1.0) == ([True, True], [0] * 4)
    assert ends([1.0, 2.0, 0.0], [1.0, 0.4, 0.0], grows=1.0) == ([False, True], [0] * 3)
