"""What benchmarks/work_precision.py compares, and against what."""

from __future__ import annotations

import math
import sys

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp


@pytest.fixture(scope="module")
def bench(load):
    return load("work_precision")


@pytest.fixture(scope="module")
def reference(load):
    return load("chain_reference")


@pytest.fixture(scope="module")
def peers(load):
    return load("chain_peers")


@pytest.mark.parametrize("n", [3, 10])
def test_stored_reference(reference, n):
    """Against SciPy on the same equations in doubles, and as started."""
    stored = reference.tips(n)
    assert reference.uncertainty(n) < 1e-15
    angles = np.array(reference.start_angles(n))
    assert (
        np.allclose(np.diff(angles, prepend=0.0), reference.start_angles(2) * (n // 2) + [0.0] * (n % 2))
        or n == 3
    )
    with mpmath.workdps(15):
        rates = reference.rates_of(n)
        found = solve_ivp(
            lambda t, y: np.array([float(x) for x in rates([mpmath.mpf(v) for v in y])]),
            (0.0, 0.5),
            np.concatenate([angles, np.zeros(n)]),
            "DOP853",
            rtol=1e-11,
            atol=1e-12,
            t_eval=np.linspace(0.0, 0.5, 6),
        )
    tips = np.stack([np.cos(found.y[:n]).sum(axis=0), np.sin(found.y[:n]).sum(axis=0)], axis=1)
    assert np.max(np.abs(tips - stored[:6])) < 1e-10


def test_reference_is_computed_as_stored(reference):
    with mpmath.workdps(20):
        found = reference.solve(3, 1e-10, samples=3, columns=6)
    assert np.allclose(np.array(found, dtype=float), reference.tips(3)[:3], rtol=0, atol=1e-9)


#: Largest errors of the tip [m] at rtol 1e-11, or with 1280 steps.
LARGEST = {
    "dop853": 2e-11, "dop853, fixed steps": 3e-13, "dopri5": 1e-10, "dopri5, fixed steps": 3e-9, "rk4": 3e-7,
    "rattle": 1e-3, "rattle4": 1e-7, "rattle6": 3e-10, "rattle8": 1e-12, "radau5": 3e-12, "generalized-alpha": 2e-3,
    "newmark": 2e-3, "taylor": 1e-12,
}  # fmt: skip


@pytest.mark.parametrize("n", [3, 10])
def test_symgen_against_the_reference(bench, reference, n):
    found = {
        attempt.series: bench.errors_of(attempt.tips(attempt.run()), reference.tips(n))[1]
        for sweep in bench.ours(n)
        for attempt in sweep
        if attempt.text in ("rtol 1e-11", "1280 steps")
    }
    assert found.keys() == LARGEST.keys()
    assert all(found[series] < most for series, most in LARGEST.items()), found
    assert found["rk4"] > 1e-10


def test_time_at_an_error(bench):
    front, time_at = bench.front, bench.time_at
    points = [(1e-2, 1.0), (1e-4, 2.0), (1e-6, 8.0), (1e-5, 9.0), (math.inf, 0.1), (math.nan, 0.1)]
    assert front(points) == [(1e-2, 1.0), (1e-4, 2.0), (1e-6, 8.0)]
    assert time_at(points, 1e-5) == pytest.approx(4.0)
    assert time_at(points, 1e-3) == pytest.approx(math.sqrt(2.0))
    assert time_at(points, 1e-1) == 1.0
    assert time_at(points, 1e-6) == pytest.approx(8.0)
    assert time_at(points, 1e-7) is None
    assert time_at([], 1e-7) is None


def test_errors_at_the_end_and_along(bench):
    truth = np.zeros((3, 2))
    assert bench.errors_of(np.array([[0, 0], [3, 4], [0, 1]]), truth) == (1.0, 5.0)
    assert bench.errors_of(np.array([[0, 2]]), truth) == (2.0, 2.0)


@pytest.mark.parametrize(
    ("name", "package", "tolerance"),
    [
        ("MuJoCo", "mujoco", 1e-3),
        ("Pinocchio + SciPy", "pinocchio", 1e-3),
        ("Pinocchio + CVODE", "sksundae", 1e-2),
        ("Exudyn", "exudyn", 1e-3),
    ],
)
def test_a_peer_is_given_the_same_chain(bench, reference, peers, name, package, tolerance):
    pytest.importorskip(package, reason="the extra 'peers' is not installed")
    for sweep in peers.PEERS[name][1](3):
        settings = list(sweep)
        if name.startswith("Pinocchio"):
            pytest.importorskip("pinocchio", reason="the extra 'peers' is not installed")
        attempt = next(a for a in settings if a.text in ("rtol 1e-05", "200 steps", "220 steps", "240 steps"))
        end, along = bench.errors_of(attempt.tips(attempt.run()), reference.tips(3))
        assert 0.0 < end <= along < tolerance


def test_a_missing_peer_is_told(bench, peers, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    missing = {}
    sweeps = list(bench.attempts(3, {"MuJoCo": peers.PEERS["MuJoCo"]}, missing))
    assert len(sweeps) == len(list(bench.ours(3)))
    assert "pip install mujoco" in missing["MuJoCo"]
    impostor = type(sys)("mujoco")
    monkeypatch.setitem(sys.modules, "mujoco", impostor)
    list(bench.attempts(3, {"MuJoCo": peers.PEERS["MuJoCo"]}, missing))
    assert "another package of the name" in missing["MuJoCo"]


def test_required_lines(bench, peers, monkeypatch):
    """Twelve times as fast as the fastest peer at all errors; then one error not reached at all."""
    monkeypatch.setattr(bench, "SIZES", (3,))

    def attempt(program, text):
        return 3, peers.Attempt(program, "m", text, None, None)

    errors, timings = {}, {}
    for program, scale in (("symgen", 1.0), ("A", 12.0), ("B", 30.0)):
        for k in range(3, 12):
            key = attempt(program, str(k))
            errors[key] = (10.0**-k, 10.0**-k)
            timings[key] = bench.Timing(*([scale * k] * 5))
    lines = bench.required(errors, timings)
    assert len(lines) == 2 * len(bench.ERRORS) and all(line.holds for line in lines)
    assert all(line.value == pytest.approx(12.0) and "than A" in line.name for line in lines)
    tight = {key: e for key, e in errors.items() if key[1].program != "symgen" or e[0] > 1e-9}
    assert [line.holds for line in bench.required(tight, timings)] == [True, True, True, False] * 2
    alone = {key: e for key, e in errors.items() if key[1].program == "symgen"}
    assert all(line.holds and "none of which" in line.name for line in bench.required(alone, timings))
    interrupted = {
        k: bench.Timing(*([50.0 * t.best] * 4), t.processor)
        for k, t in timings.items()
        if k[1].program == "A"
    }
    assert all(line.value == pytest.approx(12.0) for line in bench.required(errors, timings | interrupted))
    kept = bench.contenders({key: (e, timings[key].best) for key, e in errors.items()})
    assert kept == errors
    slow = attempt("symgen", "slow")
    tried = {key: (e, timings[key].best) for key, e in errors.items()} | {slow: ((1e-5, 1e-5), 50.0)}
    assert slow not in bench.contenders(tried)
    assert math.isclose(tried[slow][1], 50.0)
