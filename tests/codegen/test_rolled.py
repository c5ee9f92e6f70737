"""Kernels as loops over tables, and the sparse start of large linkages."""

import ctypes

import numpy as np
import pytest

import symgen
from symgen.codegen import rolled, tables
from symgen.codegen.emit import emit
from symgen.codegen.target import Target
from symgen.errors import InitialStateError
from symgen.lowering import straight_line
from symgen.lowering.expressions import Constant, Negative, Product, Quotient, Reference, Sum
from symgen.lowering.kernel import Assignment, Block, Kernel, Program, Store
from symgen.precision import FLOAT64
from symgen.runtime.integrate.redundancy import redundant_constraints
from symgen.runtime.rods import start
from symgen.toolchain.compiler import find_compiler


def runs(name, folder, monkeypatch):
    """Return accelerations at the start, redundant constraints and the motion of a scene."""
    monkeypatch.setenv("SYMGEN_CACHE", str(folder))
    model = symgen.build(name)
    motion = model.simulate(t_end=0.2)
    found = model.accelerations()
    return model, [found[p] for p in model.description.free], [motion[v] for v in motion.dataset.data_vars]


@pytest.mark.parametrize("name", ["two_four_bars", "parallelogram"])
def test_loops_give_the_bits_of_straight_line_code(name, tmp_path, monkeypatch):
    """Of a linkage that starts near lost rank, and of one with a redundant constraint, found by its pivot."""
    plain, *expected = runs(name, tmp_path / "plain", monkeypatch)
    monkeypatch.setattr(rolled, "STRAIGHT", 0)
    monkeypatch.setattr(rolled, "LEAST", 0)
    monkeypatch.setattr(straight_line, "ALL_ZEROS", 0)
    model, *found = runs(name, tmp_path / "rolled", monkeypatch)
    source = next((tmp_path / "rolled").rglob("*_rolled.c")).read_text()
    assert all(f"{name}_{k.name}(" in source for k in model.description.kernels)
    assert model.description.redundant == plain.description.redundant
    for kernel in plain.description.kernels:
        assert model.description.kernel(kernel.name).out_size == kernel.out_size
    for of_loops, straight in zip(found, expected, strict=True):
        for a, b in zip(of_loops, straight, strict=True):
            np.testing.assert_array_equal(np.asarray(a), np.asarray(b))


@pytest.mark.parametrize("straight", [1_000, 0])
def test_statements_that_repeat_are_a_loop_of_their_own(straight, tmp_path, monkeypatch):
    """Pivots d of a tridiagonal matrix, r = 1/d and the fading sum e = e/2 + r.

    A loop reads r and e of the repeat before, and d of the one before that; behind it are read the last e and
    every r.
    """
    n, half, one = 100, Constant("0.5"), Constant("1")
    named, stores = [], []
    for i in range(n):
        q, d, r = Reference(f"q[{i}]"), Reference(f"d{i}"), Reference(f"r{i}")
        off = Product((Reference(f"r{i - 1}"), Reference(f"u[{i}]"), Reference(f"u[{i}]")))
        faded = Product((half, Reference(f"e{i - 1}")))
        named += [
            Assignment(d.name, Sum((q, Negative(off))) if i else q),
            Assignment(r.name, Quotient(one, d)),
            Assignment(f"e{i}", Sum((faded, r)) if i else Product((half, r))),
        ]
        stores.append(Store("out", i, Sum((d, Reference(f"d{i - 2}"))) if i > 1 else d))
    stores.append(Store("out", n, Sum(tuple(Product((half, Reference(f"r{i}"))) for i in range(n)))))
    stores.append(Store("out", n + 1, Reference(f"e{n - 1}")))
    out = (Block("pivots", 0, (n + 2, 1), "1", "sums of pivots, and of their inverse"),)
    kernel = Kernel("pivots", "pivots", (("q", n), ("u", n)), tuple(named), tuple(stores), out)
    made = Program("tridiagonal", "", (), (kernel,), 0, "0", (), ())
    q, u = np.random.default_rng(1).uniform((3.0,), (4.0,), (2, n))
    pivots, expected = np.zeros(n), np.zeros(n + 2)
    for i in range(n):
        pivots[i] = q[i] - (1.0 / pivots[i - 1] * u[i] * u[i] if i else 0.0)
        expected[i] = pivots[i] + (pivots[i - 2] if i > 1 else 0.0)
        expected[n] = expected[n] + 0.5 * (1.0 / pivots[i])
        expected[n + 1] = 0.5 * expected[n + 1] + 1.0 / pivots[i] if i else 0.5 * (1.0 / pivots[i])
    monkeypatch.setattr(rolled, "STRAIGHT", 0)
    monkeypatch.setattr(rolled, "LEAST", 50)
    monkeypatch.setattr(tables, "STRAIGHT", straight)
    for source in emit(made, Target("c", FLOAT64, False), ""):
        (tmp_path / source.name).write_text(source.text)
    loops = tmp_path / "tridiagonal_rolled.c"
    text = loops.read_text()
    assert "double last" in text and "double k" in text
    assert ("out[x[0]]" in text) == (not straight)
    find_compiler().start([loops], tmp_path / "kernels.so").finish()
    found = np.full(n + 2, np.nan)
    to_c = [
        ctypes.c_void_p(a.ctypes.data if a is not None else None) for a in (None, q, u, None, None, found)
    ]
    ctypes.CDLL(str(tmp_path / "kernels.so")).tridiagonal_pivots(*to_c)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("name", ["two_four_bars", "parallelogram", "four_bar"])
def test_sparse_velocities_are_those_of_the_dense_start(name):
    evaluator = symgen.build(name).evaluator
    starter = start.posed_starter(evaluator)
    redundant = redundant_constraints(evaluator, starter.q).rows
    expected, found = starter.velocities(redundant), start.least_velocities(evaluator, starter.q, redundant)
    assert expected is not None
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=1e-12 * expected[3])
    assert max(np.max(missed, initial=0.0) for missed in found[1:3]) <= 1e-13 * expected[3]
    assert found[3] == expected[3]


@pytest.mark.parametrize("mass", [1.0, 1e-6, 1e-9, 1e-12])
def test_sparse_velocities_have_the_least_energy(mass, monkeypatch):
    """Of a chain of which the rate of the first rod is given: the other rates balance their momentum.

    With equal masses of the other rods, both rates are those of least energy of these rods alone, for any mass.
    """
    places = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.5], [3.0, 0.0]])
    names = ["O", "A", "B", "C"]
    scene = symgen.Scene(
        points={n: {"at": [f"{x!r} m" for x in at.tolist()]} for n, at in zip(names, places, strict=True)}
        | {"O": {"at": ["0 m", "0 m"], "ground": True}},
        parameters={"x": {"value": "1 kg", "tunable": True}},
        links={a + b: {"points": [a, b], "mass": "x"} for a, b in ("AB", "BC")}
        | {"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        start={"rates": {"OA": "1 rad/s"}},
    )
    monkeypatch.setattr(start, "LARGE", 0)
    model = symgen.build(scene).with_parameters(x=mass)
    across = np.stack([-np.diff(places, axis=0)[:, 1], np.diff(places, axis=0)[:, 0]], axis=1)
    # Velocities of A, B, C by the three rates, and the energy of a uniform rod: (a.a + a.b + b.b) m / 6.
    a = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1]])[:, :, None] * across
    energy = sum(
        np.einsum("ik,jk->ij", x, x) + np.einsum("ik,jk->ij", y, y) + np.einsum("ik,jk->ij", x, y)
        for x, y in ((a[0], a[1]), (a[1], a[2]))
    )
    energy = energy + energy.T
    rates = np.append(1.0, np.linalg.solve(energy[1:, 1:], -energy[1:, 0]))
    expected = np.einsum("ijk,j->ik", a, rates)
    velocities = model.initial_state().velocities
    found = [velocities[name] for name in "ABC"]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_a_large_start_without_mass_is_refused(monkeypatch):
    scene = symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        parameters={"x": {"value": "1 kg", "tunable": True}},
        links={"a": {"points": ["O", "A"], "mass": "x"}},
        start={"rates": {"a": "1 rad/s"}},
    )
    monkeypatch.setattr(start, "LARGE", 0)
    with pytest.raises(InitialStateError, match="not positive definite with x = 0 kg"):
        symgen.build(scene).with_parameters(x=0.0).initial_state()
