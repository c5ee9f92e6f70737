"""A dq = V of Newton's step of the closure: against the source's print and numeric derivatives of the closure."""

from __future__ import annotations

from functools import reduce

import numpy as np
import pytest
import sympy as sp
from shared.golden import reference

import symgen

ABOVE = ((0, 1), (0, 2), (1, 2))
FOUND = ("theta2", "eta2", "theta3", "eta3", "alpha3", "S4")
INCH = 0.0254
A1, A2 = 12 * INCH, 50 * INCH
LOOPS = ("slider_crank", "planar_4r", "cardan", "rssr", "rccc", "bennett", "bricard", "screw_jack", "cssp")
STEP = 1e-30

Pair = tuple[np.ndarray, np.ndarray]


def product(*factors: Pair) -> Pair:
    """Dual matrices R + eps D."""
    return reduce(lambda a, b: (a[0] @ b[0], a[0] @ b[1] + a[1] @ b[0]), factors)


def turn(axis: int, angle: complex, along: complex = 0.0) -> Pair:
    """The dual rotations of section 2.4 about i, j or k."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    c, s = np.cos(angle), np.sin(angle)
    real, dual = np.zeros((2, 3, 3), dtype=complex)
    real[axis, axis] = 1.0
    real[[j, j, k, k], [j, k, j, k]] = c, -s, s, c
    dual[[j, j, k, k], [j, k, j, k]] = -along * s, -along * c, along * c, -along * s
    return real, dual


def rows_of(q: dict[str, complex]) -> list[Pair]:
    """The transforms (1) to (4), with alpha3 variable."""
    return [
        product(turn(2, q["theta1"], q["s1"]), turn(0, 0.0, A1)),
        product(turn(2, q["theta2"]), turn(1, q["eta2"]), turn(0, 0.0, A2)),
        product(turn(2, q["theta3"]), turn(1, q["eta3"]), turn(0, q["alpha3"])),
        product(turn(2, 0.0, q["S4"]), turn(0, q["alpha4"], q["a4"])),
    ]


def transposed(b: Pair) -> Pair:
    return b[0].T, b[1].T


def above(matrix: Pair) -> np.ndarray:
    return np.array([part[i, k] for part in matrix for i, k in ABOVE])


def operators(closure, q: dict[str, float], names) -> np.ndarray:
    """Entries above the diagonal of H = dB/dq B^T, by complex steps."""
    b = closure(q)
    columns = []
    for name in names:
        moved = closure({**q, name: q[name] + 1j * STEP})
        slope = tuple(part.imag / STEP for part in moved)
        h = product(slope, transposed(tuple(part.real for part in b)))
        assert all(np.max(np.abs(part + part.T)) < 1e-12 for part in h)
        columns.append(above(h))
    return np.array(columns).T


def functions(scene: str, names):
    """Expanded matrices of a scene as functions of named values; other symbols have their numbers."""
    system = symgen.derive(scene).in_numbers()
    known = {p.name: p for g in system.groups for p in g.quantities}
    result = {}
    for name in names:
        matrix = sp.Matrix(system.expanded(name))
        symbols = sorted(matrix.free_symbols, key=str)
        assert {str(s) for s in symbols} <= {*known}
        compiled = sp.lambdify(symbols, matrix, "numpy")
        result[name] = lambda q, f=compiled, s=symbols: np.array(f(*(q[str(x)] for x in s)), dtype=complex)
    return system, result


@pytest.fixture(scope="module")
def of_crank():
    return functions("slider_crank", ("closure_step_matrix", "closure_step_rhs"))[1]


def state(rng) -> dict[str, float]:
    q = {
        name: rng.uniform(-3, 3)
        for name in ("theta1", "theta2", "eta2", "theta3", "eta3", "alpha3", "alpha4")
    }
    return q | {name: rng.uniform(-1, 1) for name in ("s1", "S4", "a4")}


def test_the_print(of_crank):
    """(24) with the operators (8) to (10), (12) to (16), and (25) without diagonal entries, at random states.

    Corrected: the skew part of B^T (errata of (22), (25)); alpha3 has a column.
    """
    rng = np.random.default_rng(19)
    for _ in range(10):
        q = state(rng) | {"alpha3": np.pi / 2}
        c2, s2, c3, s3 = (f(q[x]) for x in ("theta2", "theta3") for f in (np.cos, np.sin))
        zero = np.zeros((3, 3))
        of_theta = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]]), zero
        of_eta2, of_eta3 = (
            (np.array([[0, 0, c], [0, 0, s], [-c, -s, 0]]), zero) for c, s in ((c2, s2), (c3, s3))
        )
        of_S = zero, of_theta[0]
        m1, l2, l3, m4 = rows_of(q)
        before = (m1, m1, product(m1, l2), product(m1, l2), product(m1, l2, l3))
        middle = (of_theta, of_eta2, of_theta, of_eta3, of_S)
        printed = [above(product(m, x, transposed(m))) for m, x in zip(before, middle, strict=True)]
        found = of_crank["closure_step_matrix"](q)
        assert np.max(np.abs(found[:, [0, 1, 2, 3, 5]] - np.array(printed).T)) < 1e-14
        b = product(m1, l2, l3, m4)
        right = [(part[k, i] - part[i, k]) / 2 for part in b for i, k in ABOVE]
        assert np.max(np.abs(of_crank["closure_step_rhs"](q).ravel() - right)) < 1e-14


def test_steps_lead_to_the_checked_positions(of_crank):
    """Quadratically, in space, where the printed V of (25) has another limit or none."""
    rng = np.random.default_rng(24)
    numbers = reference("dual_slider_crank")
    short = dict(zip(("th2", "et2", "th3", "et3", "al3", "S4"), FOUND, strict=True))
    lengths = {"S4": INCH}
    count = 0
    for scene in numbers["scenes"]:
        for at in scene["positions"][:2]:
            exact = {n: float(at["kin"][x]["pos"]) * lengths.get(n, 1.0) for x, n in short.items()}
            fixed = {
                "theta1": np.radians(float(at["theta1_deg"])),
                "s1": float(at["kin"]["S1"]["pos"]) * INCH,
            }
            fixed |= {"a4": float(scene["a4"]) * INCH, "alpha4": np.radians(float(scene["alpha4_deg"]))}
            q = {name: x + rng.uniform(-1e-2, 1e-2) for name, x in exact.items()}
            misses = []
            for _ in range(5):
                a, v = (of_crank[f"closure_step_{x}"](q | fixed).real for x in ("matrix", "rhs"))
                q = dict(zip(FOUND, np.array([*q.values()]) + np.linalg.solve(a, v.ravel()), strict=True))
                misses.append(max(abs(q[n] - exact[n]) for n in FOUND))
            assert misses[-1] < 1e-12, (scene["name"], misses)
            assert misses[1] < 20 * misses[0] ** 2 + 1e-13, (scene["name"], misses)
            count += 1
    assert count > 10


@pytest.mark.parametrize("scene", LOOPS)
def test_derivatives_of_the_closure_of_every_loop(scene):
    system = symgen.derive(scene)
    count = sum(m.name.startswith("row_") for m in system.matrices)
    rows = [f"row_{i}_transform" for i in range(1, count + 1)]
    system, of = functions(scene, (*rows, "closure_step_matrix", "closure_step_rhs"))
    names = system["closure_step_matrix"].columns
    rng = np.random.default_rng(len(scene))
    symbols = {q.name: rng.uniform(-1, 1) for g in system.groups for q in g.quantities}

    def closure(q):
        return product(*((m[:, :3], m[:, 3:]) for m in (of[row](q) for row in rows)))

    expected = operators(closure, symbols, names)
    assert np.max(np.abs(of["closure_step_matrix"](symbols) - expected)) < 1e-12
    b = closure(symbols)
    right = np.array([(part[k, i] - part[i, k]) / 2 for part in b for i, k in ABOVE])
    assert np.max(np.abs(of["closure_step_rhs"](symbols).ravel() - right)) < 1e-12
