"""Mechanisms of differentiation, by the files that solve for differentials of unknowns or carry them along."""

from __future__ import annotations

import ast
from pathlib import Path

import symgen

RUNTIME = Path(symgen.__file__).parent / "runtime"

STATE = "implicit functions: poses, motions, equilibria, frequencies, steady states, of all mechanisms"
STEPS = "tangents and transposes of compiled steps"
IN_SPACE = "tangents of steps of elastic links in space, in NumPy"
#: Files of Python that know tangents and solve equations, and their mechanism. Both may only become fewer.
IN_PYTHON = {
    "linearisation/tangents.py": STATE,
    "linearisation/sensitivity.py": STATE,
    "linearisation/vibration.py": STATE,
    "loop/derivatives/tangents.py": STATE,
    "elastic/derivatives/balance.py": STATE,
    "elastic/derivatives/poses.py": STATE,
    "elastic/space/sensitivity.py": STATE,
    "elastic/space/tangents.py": IN_SPACE,
}
#: Files that choose coordinates, or solve for places and rates, beside slopes or tangents.
OTHERS = {
    "linearisation/state_space.py",
    "rods/following/state_from_coordinates.py",
    "elastic/space/linkage.py",
}
#: Files of the core with tangents of steps, and what they work on: stored steps, or columns of a batch in the step loop.
IN_C = {
    "implicit_variations.c": "struct variations *",
    "loop_variations.c": "struct variations *",
    "rod_variations.c": "struct variations *",
    "variations.c": "struct variations *",
    "beam_tangents.c": "struct beam_tangents *",
}

#: Names of the package that tangents are made of, and functions that solve equations.
TANGENTS = {"UNIT", "Tangents", "LinkageTangents", "sensitivity_of", "Course"}
SOLVERS = {
    "factorised", "inv", "lstsq", "lu_factor", "lu_solve", "pinv", "qr", "solve", "solve_triangular", "splu", "spsolve",
    "svd",
}  # fmt: skip


def differentiates(path: Path) -> bool:
    """Return whether a file imports or defines a name of tangents, and calls a function that solves equations."""
    nodes = [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
    known = {a.name for n in nodes if isinstance(n, ast.ImportFrom) for a in n.names}
    known |= {n.name for n in nodes if isinstance(n, ast.ClassDef | ast.FunctionDef)}
    called = {ast.unparse(n.func).split(".")[-1] for n in nodes if isinstance(n, ast.Call)}
    return bool(known & TANGENTS and called & SOLVERS)


def test_files_of_python_that_solve_for_differentials_are_known():
    found = {str(p.relative_to(RUNTIME)) for p in RUNTIME.rglob("*.py") if differentiates(p)}
    assert found == {*IN_PYTHON} | OTHERS


def test_files_of_the_core_with_tangents_of_steps_are_known():
    texts = {p.name: p.read_text() for p in (RUNTIME / "core").glob("*.c")}
    assert {name: of for name, text in texts.items() for of in set(IN_C.values()) if of in text} == IN_C


def test_mechanisms_of_differentiation_become_fewer():
    assert len({STEPS, *IN_PYTHON.values()}) <= 3
