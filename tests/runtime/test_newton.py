"""Newton's method: the one function of Python against closed forms, and the places that have loops of their own."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import symgen
from symgen.runtime.newton import corrected

RUNTIME = Path(symgen.__file__).parent / "runtime"


def one(_):
    return 1.0


def test_a_residual_is_brought_to_its_rounding():
    """The root of two by corrections from 1.5: errors are squared four times, and a fifth shows the rounding."""
    found = corrected(
        np.array([1.5]), lambda x, left: -left / (2 * x), one, 5, residual=lambda x: x**2 - 2, falls=0.5
    )
    assert found == pytest.approx([np.sqrt(2.0)], rel=2e-16)
    too_few = corrected(np.array([1.5]), lambda x, left: -left / (2 * x), one, 2, residual=lambda x: x**2 - 2)
    assert too_few is None


def test_a_residual_that_stays_at_its_rounding_is_accepted():
    """Round-off of large terms that cancel is far above the spacing of the size."""
    noise = iter([1e-3, 1e-8, 4e-15, 3e-15, 5e-15])
    x = corrected(np.zeros(2), lambda x, left: 0 * x, one, 20, residual=lambda x: np.full(2, next(noise)))
    assert x is not None and next(noise) == 5e-15  # ended with the first that did not fall


@pytest.mark.parametrize(("tolerated", "converges"), [(1e-6, True), (1e-12, False)])
def test_a_slow_root_is_tolerated_up_to_a_limit(tolerated, converges):
    """At a double root every correction halves the error: after ten the residual is 2^-20."""
    found = corrected(
        np.array([1.0]), lambda x, left: -x / 2, one, 10, residual=lambda x: x**2, tolerated=tolerated
    )
    assert (found is not None) is converges


def test_corrections_end_where_they_vanish_or_diverge():
    """Corrections with a slope of twice the true one halve the error of x = 3 each."""
    places = []

    def change(x, left):
        assert not left.size
        places.append(float(x[0]))
        return (3.0 - x) / 2

    found = corrected(np.array([1.0]), change, lambda _: np.array([2.0]), 60, close=2.0**-20)
    assert found == pytest.approx([3.0], abs=2.0**-19) and len(places) == 20
    assert corrected(np.array([1.0]), change, one, 60, far=0.5, close=1e-9) is None
    assert corrected(np.array([1.0]), change, one, 5, close=1e-9) is None


def test_corrections_that_no_longer_halve_end_where_they_are_rounding():
    steps = iter([1.0, 1e-4, 0.9e-4, 1e-9, 0.9e-9, 0.8e-9])
    found = corrected(np.zeros(1), lambda x, left: np.array([next(steps)]), one, 9, rounded=1e-8)
    assert found == pytest.approx([1.0 + 1.9e-4 + 1.9e-9], abs=1e-15) and next(steps) == 0.8e-9


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_do_not_converge(value):
    bad = np.array([value])
    assert corrected(np.zeros(1), lambda x, left: bad, one, 5, close=1.0, far=1e300) is None
    assert corrected(np.zeros(1), lambda x, left: bad, one, 5, residual=lambda x: bad) is None


def test_a_correction_may_not_exist():
    assert corrected(np.zeros(1), lambda x, left: None, one, 5, close=1.0) is None
    assert corrected(np.zeros(1), lambda x, left: None, one, 5, residual=lambda x: x + 1.0) is None


#: Loops that correct unknowns until a nonlinear residual vanishes, by file and function.
IN_PYTHON = {("newton.py", "corrected")}
IN_C = {("newton.h", "newton_solve")}
#: Searches for the least error, which need not vanish, by least squares with damping that they adapt.
DAMPED = {("rods/search.py", "_least_squares"), ("assemble.c", "loop_assemble")}
#: Loops of the same form that refine the solution of linear equations, or step along a damped motion.
OTHERS = {
    ("rods/large_start.py", "least_velocities"),
    ("elastic/large/statics.py", "_settled"),
    ("rods/equilibrium.py", "_settled"),
}
#: Functions that solve linear equations, or give a correction.
SOLVERS = {"change", "factorised", "held", "inv", "lstsq", "pinv", "solve", "_solve", "splu"}


def corrections(function: ast.FunctionDef) -> bool:
    """Return whether a loop of a function solves equations, adds to what it solves for, and may end early."""
    for loop in (n for n in ast.walk(function) if isinstance(n, ast.For | ast.While)):
        inside = list(ast.walk(loop))
        called = {ast.unparse(c.func).split(".")[-1] for c in inside if isinstance(c, ast.Call)}
        ends = isinstance(loop, ast.While) or any(isinstance(n, ast.Break | ast.Return) for n in inside)
        if ends and called & SOLVERS and any(is_update(n) for n in inside):
            return True
    return False


def is_update(node: ast.AST) -> bool:
    """Return whether a statement adds to a variable or a field of it, or subtracts."""
    if isinstance(node, ast.AugAssign):
        return isinstance(node.op, ast.Add | ast.Sub)
    if not isinstance(node, ast.Assign):
        return False
    targets = {n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name)}
    sums = [
        b for b in ast.walk(node.value) if isinstance(b, ast.BinOp) and isinstance(b.op, ast.Add | ast.Sub)
    ]
    return any(isinstance(n, ast.Name) and n.id in targets for b in sums for n in ast.walk(b.left))


def test_python_has_one_loop_of_corrections_but_for_known_ones():
    found = {
        (str(path.relative_to(RUNTIME)), function.name)
        for path in RUNTIME.rglob("*.py")
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(function, ast.FunctionDef) and corrections(function)
    }
    assert found - DAMPED == IN_PYTHON | OTHERS


#: What bounds loops of the core: numbers of corrections; sizes of arrays and numbers of other attempts.
BOUNDS = {"STEPS", "w->most"}
OTHER_BOUNDS = {
    "ATTEMPTS", "BESIDE", "BLOCK", "HALVINGS", "HOPELESS", "IDLE", "MOTION", "NARROWINGS", "PASSES", "PLACES_BESIDE", "RATE_PROJECTIONS",
    "REFINEMENTS", "ROWS", "SHIFTS", "STAGES", "STEP_PROBES", "TOGETHER", "WIDTH",
}  # fmt: skip


def functions_of(text: str) -> list[tuple[str, str]]:
    """Return names and bodies of the functions of a C file."""
    starts = [
        m.start() for m in re.finditer(r"^(?:[A-Za-z]\w*[\s*]+)+\w+\([^;{]*?\)\s*\{$", text, re.MULTILINE)
    ]
    found = []
    for start in starts:
        head, body = (
            text[start : text.index("{", start)],
            text[text.index("{", start) : text.index("\n}", start)],
        )
        found.append((re.findall(r"(\w+)\(", head)[0], body))
    return found


def test_loops_of_corrections_in_the_core_are_known():
    """A loop that a number of attempts bounds corrects or does not; the table has all functions that do."""
    found, bounds = set(), set()
    for path in sorted(p for s in ("c", "h") for p in (RUNTIME / "core").glob(f"*.{s}")):
        for name, body in functions_of(path.read_text(encoding="utf-8")):
            loops = re.findall(r"\b(?:for|while) \((.*)\) ?\{?$", body, re.MULTILINE)
            here = {b for loop in loops for b in re.findall(r"[<?:] ?\(?([A-Z][A-Z_]+|\w+->most)\b", loop)}
            bounds |= here
            if here & BOUNDS:
                found.add((path.name, name))
    assert len(bounds) > 10 and bounds <= BOUNDS | OTHER_BOUNDS, bounds - BOUNDS - OTHER_BOUNDS
    assert found - DAMPED == IN_C


def test_newtons_method_is_stated_once_for_each_language():
    assert len(IN_PYTHON) + len(IN_C) <= 2 and len(DAMPED) <= 2
