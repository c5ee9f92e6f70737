"""Solvers from elsewhere on the same kernels."""

from __future__ import annotations

import itertools
import sys

import numpy as np
import pytest
from shared.linkages import G, at, four_bar, ground, rod

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.study import SOLVERS, reference


def damped():
    """A rod swings down from level, its end held back by a damper."""
    return symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0), "S": ground(2, 1)},
        links={"OA": rod("O", "A")},
        springs=[{"between": ["S", "A"], "stiffness": "9 N/m", "length": "1 m", "damping": "0.8 N*s/m"}],
        gravity={"acceleration": ["0 m/s^2", f"{-G!r} m/s^2"]},
        analysis={"t_end": "1 s", "outputs": ["A.position", "OA.tension"]},
    )


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_finds_the_same_motion(solver):
    """And the same account of the energy, the work of the damper in it."""
    if solver.startswith("cvode"):
        pytest.importorskip("sksundae")
    model = symgen.build(damped())
    own = model.simulate(rtol=1e-12, samples=21)
    other = reference(model, solver, rtol=1e-9, samples=21)
    assert other.provenance["method"] == solver
    for name in ("A.position", "OA.tension"):
        assert other[name].values == pytest.approx(own[name].values, abs=2e-5)
    assert 0 < other.drift.energy < 1e-5
    assert other.drift.energy_exchanged == pytest.approx(own.drift.energy_exchanged, rel=0.1)
    assert other.drift.constraint < 1e-6
    assert other.statistics["evaluations"] > 20


def test_a_tight_one_is_a_reference():
    """Two codes that share nothing but the kernels, on a closed linkage; the raw equations drift a little."""
    model = symgen.build("peaucellier")
    own = model.simulate(1.0, rtol=1e-12, samples=11)
    other = reference(model, t_end=1.0, rtol=1e-13, atol=1e-15, samples=11)
    assert np.abs(own["C.position"].values - other["C.position"].values).max() < 1e-11
    assert own.drift.constraint < 1e-15 < other.drift.constraint < 1e-11


def test_a_solver_of_the_users_own():
    """Euler's method, which anybody can write: its error falls with the step."""

    def euler(f, times, y, rtol, atol):
        states = [y]
        for t, after in itertools.pairwise(times):
            states.append(states[-1] + (after - t) * f(t, states[-1]))
        return np.array(states)

    model = symgen.build("triple_pendulum")
    exact = model.simulate(0.1, samples=2)["A.position"].values[-1]
    errors = [
        np.abs(reference(model, euler, t_end=0.1, samples=n + 1)["A.position"].values[-1] - exact).max()
        for n in (200, 400)
    ]
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)
    with pytest.raises(ModelError, match=r"returned states of shape \(2, 3\), expected \(11,"):
        reference(model, lambda *_: np.zeros((2, 3)), t_end=0.1, samples=11)


def test_the_result_is_saved_and_read_back(tmp_path):
    result = reference(symgen.build("triple_pendulum"), t_end=0.1, samples=3)
    back = symgen.load_result(result.save(tmp_path / "a.nc"))
    assert back.summary() == result.summary()


def test_without_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "sksundae", None)
    monkeypatch.setitem(sys.modules, "sksundae.cvode", None)
    with pytest.raises(ModelError, match=r"needs SUNDIALS\n  Install it: pip install 'symgen\[sundials\]'"):
        reference(symgen.build("triple_pendulum"), "cvode-BDF")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"solver": "scipy-dop853"}, "Did you mean 'scipy-DOP853'"),
        ({"rtol": 0.0}, "rtol above zero"),
        ({"atol": -1.0}, "atol above zero"),
        ({"t_end": 0.0}, "t_end after the start above zero"),
        ({"t_end": float("nan")}, "t_end"),
        ({"samples": 1}, "samples above zero"),
    ],
)
def test_wrong_options(options, words):
    with pytest.raises(ModelError, match=words):
        reference(symgen.build("triple_pendulum"), **options)


def test_a_solver_that_gives_up():
    """The crank is driven beyond the last position that can be assembled: the time is told."""
    model = symgen.build(four_bar(2.0, 1.5, 1.5, 2.5, 1.0))
    with pytest.raises(SimulationError, match="SciPy's DOP853 failed") as caught:
        reference(model, t_end=3.0, rtol=1e-4)
    assert 0 < caught.value.time < 3
    with pytest.raises(SimulationError, match="not finite"):
        reference(model, lambda f, t, y, *_: np.full((len(t), len(y)), np.nan), t_end=0.1)
