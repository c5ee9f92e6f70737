"""A q' = V of the rates of a loop: against the source's print, checked numbers and the screws."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from shared.crank_vectors import Crank
from shared.golden import reference
from shared.jets import Jet, Real

import symgen
from symgen.pipeline.subject import Subject

FOUND = ("theta2", "eta2", "theta3", "eta3", "alpha3", "S4")
GIVEN = ("theta1", "s1")
INCH = sp.Rational(254, 10000)
A1, A2 = 12 * INCH, 50 * INCH
SIZE = float(A2)
LENGTHS = {name: float(INCH) for name in ("S4", "s1")}
NUMBERS = reference("dual_slider_crank")
SHORT = dict(zip(("th2", "et2", "th3", "et3", "al3", "S4"), FOUND, strict=True))


@pytest.fixture(scope="module")
def system():
    return symgen.derive("slider_crank")


@pytest.fixture(scope="module")
def functions(system):
    """Matrices of the shipped scene as functions of named values."""

    def function(name):
        matrix = sp.Matrix(system.expanded(name))
        symbols = sorted(matrix.free_symbols, key=str)
        compiled = sp.lambdify(symbols, matrix, "numpy")
        return lambda values: np.array(compiled(*(values[str(s)] for s in symbols)), dtype=float)

    return {name: function(name) for name in ("closure_matrix", "closure_rhs", "screws", "rod_frame")}


def test_the_print(system):
    """Equation (38), rows in the source's order.

    Corrected: the axes of eta2 and eta3 (errata of (30), (31)), and s(eta2) in row 6 of V, as in (37f).
    """
    named = {str(s): s for m in system.matrices for s in m.matrix.free_symbols}
    theta2, eta2, theta3 = (named[n] for n in ("theta2", "eta2", "theta3"))
    a1, a2 = named.get("a1", A1), named.get("a2", A2)
    w, v = named["theta1_rate"], named["s1_rate"]
    s, c = sp.sin, sp.cos
    order = [0, 3, 1, 4, 2, 5]
    a = sp.Matrix(system.expanded("closure_matrix"))[order, :].subs(named["alpha3"], sp.pi / 2)
    columns = {
        "theta2": [-s(eta2), 0, 0, a2 * c(eta2), c(eta2), 0],
        "theta3": [0, 0, 0, 0, 1, 0],
        "eta2": [0, 0, 1, 0, 0, -a2],
        "eta3": [-s(theta3), 0, c(theta3), 0, 0, 0],
        "S4": [0, s(theta3), 0, -c(theta3), 0, 0],
    }
    assert system["closure_matrix"].columns == FOUND
    for name, column in columns.items():
        assert sp.simplify(a[:, FOUND.index(name)] - sp.Matrix(column)) == sp.zeros(6, 1), name
    right = [
        w * s(eta2),
        -w * a1 * s(theta2) * c(eta2) + v * s(eta2),
        0,
        -w * (a1 * c(theta2) + a2 * c(eta2)),
        -w * c(eta2),
        -w * a1 * s(theta2) * s(eta2) - v * c(eta2),
    ]
    found = sp.Matrix(system.expanded("closure_rhs"))[order, :]
    assert sp.simplify(found - sp.Matrix(right)) == sp.zeros(6, 1)


def test_checked_rates_solve_it(functions):
    """Positions and rates of every scene of the checked numbers, S1 constant and oscillating."""
    for scene in NUMBERS["scenes"]:
        for at in scene["positions"]:
            kin = at["kin"]
            values = {name: float(kin[short]["pos"]) * LENGTHS.get(name, 1) for short, name in SHORT.items()}
            rates = np.array(
                [float(kin[short]["vel"]) * LENGTHS.get(name, 1) for short, name in SHORT.items()]
            )
            values |= {"a1": float(A1), "a2": float(A2), "theta1_rate": 50 * 2 * np.pi / 60}
            values["s1_rate"] = float(kin["S1"]["vel"]) * float(INCH)
            left, right = functions["closure_matrix"](values) @ rates, functions["closure_rhs"](values)
            size = max(SIZE, *np.abs(right.ravel()))
            assert np.max(np.abs(left - right.ravel())) < 1e-13 * size, (scene["name"], at["theta1_deg"])


@pytest.mark.parametrize(
    ("name", "part", "word"),
    [("joint_rates", "vel", "_rate"), ("joint_accelerations", "acc", "_acceleration")],
)
def test_checked_rates_and_accelerations_are_the_solved_ones(name, part, word):
    """(39)-(43) and (38a)-(42a), corrected: each by the checked values of those before it."""
    (chosen,) = Subject("slider_crank", {}).found(name)
    (m,), endings = chosen.matrices, {"pos": "", "vel": "_rate", "acc": "_acceleration"}
    letters = sorted(m.matrix.free_symbols, key=str)
    solved = sp.lambdify(letters, [*m.matrix], "numpy")
    for scene in NUMBERS["scenes"]:
        for at in scene["positions"]:
            values = {"a1": float(A1), "a2": float(A2), "theta1_acceleration": 0.0}
            values["theta1_rate"] = 50 * 2 * np.pi / 60
            for short, variable in (SHORT | {"S1": "s1"}).items():
                size = LENGTHS.get(variable, 1)
                values |= {f"{variable}{x}": float(at["kin"][short][k]) * size for k, x in endings.items()}
            found = solved(*(values[str(s)] for s in letters))
            expected = [values[f"{variable}{word}"] for variable in m.rows]
            assert found == pytest.approx(expected, rel=1e-11, abs=1e-11), (scene["name"], at["theta1_deg"])


def test_random_states_against_the_screws(functions):
    """At 20 random states: A and V hold for the rates, and are the screws, moved by the frame of the rod."""
    rng = np.random.default_rng(38)
    for _ in range(20):
        a4, alpha4 = rng.uniform(0, 20), np.radians(rng.uniform(240, 300))
        theta1, S1 = (
            Jet(np.array([rng.uniform(low, high)], dtype=Real), Real(rng.uniform(-3, 3)))
            for low, high in ((0, 2 * np.pi), (-4, 4))
        )
        motion = Crank(a4=Real(a4), alpha4=Real(alpha4)).motion(theta1, S1)
        jets = {name: getattr(motion, name) for name in FOUND} | {"theta1": theta1, "s1": S1}
        values = {"a1": float(A1), "a2": float(A2), "a4": a4 * float(INCH), "alpha4": alpha4}
        values |= {name: float(x.value[0]) * LENGTHS.get(name, 1) for name, x in jets.items()}
        rates = {name: float(np.ravel(x.rate)[0]) * LENGTHS.get(name, 1) for name, x in jets.items()}

        def closing(rates, values=values):
            values = values | {f"{name}_rate": rates[name] for name in GIVEN}
            a, v = functions["closure_matrix"](values), functions["closure_rhs"](values)
            return a @ [rates[name] for name in FOUND] - v.ravel()

        assert np.max(np.abs(closing(rates))) < 1e-12 * SIZE

        some = dict(zip((*GIVEN, *FOUND), rng.uniform(-2, 2, 8), strict=True))
        in_first = functions["screws"](values) @ list(some.values())
        frame = functions["rod_frame"](values)
        turn, origin = frame[:, :3], frame[:, 3]
        moved = closing(some)
        omega = turn @ moved[:3]
        expected = np.concatenate([omega, turn @ moved[3:] + np.cross(origin, omega)])
        assert np.max(np.abs(in_first - expected)) < 1e-12 * np.max(np.abs(in_first))
