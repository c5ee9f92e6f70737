"""Every integrator in the registry: order, dense output, repeatability, and SciPy as a second opinion."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen
from symgen.errors import ModelError
from symgen.runtime.integrate.integrators import INTEGRATORS

FIXED = [name for name, m in INTEGRATORS.items() if not m.adaptive]
ADAPTIVE = [name for name, m in INTEGRATORS.items() if m.adaptive]
PAGE = Path(__file__).parents[3] / "docs" / "integrators.md"
EXPLICIT = [name for name, m in INTEGRATORS.items() if m.kind == "explicit"]


@pytest.fixture(scope="module")
def model():
    return symgen.build("triple_pendulum")


@pytest.fixture(scope="module")
def exact(model):
    """End of the run at t = 0.5 s by SciPy on the same accelerations, without projection."""
    state = model.initial_state()
    n = state.q.size

    def rhs(t, y):
        found = model.accelerations(type(state)(t, y[:n], y[n:], {}, {}))
        return np.concatenate([y[n:], *(found[p] for p in model.description.free)])

    solution = solve_ivp(
        rhs, (0, 0.5), np.concatenate([state.q, state.u]), method="DOP853", rtol=1e-13, atol=1e-14
    )
    return solution.y[:n, -1]


def end(model, result):
    return np.concatenate([result.final[p]["position"] for p in model.description.free])


@pytest.mark.parametrize("name", INTEGRATORS)
def test_every_integrator_says_what_it_is(name):
    m = INTEGRATORS[name]
    assert m.name == name and m.about and m.order > m.error_order
    assert m.adaptive == (m.error_order > 0)


@pytest.mark.parametrize("name", EXPLICIT)
def test_tableau_is_consistent(name):
    m = SimpleNamespace(**INTEGRATORS[name].coefficients)
    for array in ("a", "b", "c", "error", "dense"):
        setattr(m, array, np.asarray(getattr(m, array), dtype=float))
    assert m.a.shape == (m.all_stages, m.all_stages)
    assert np.allclose(np.triu(m.a), 0)
    assert np.allclose(m.a.sum(axis=1), m.c, atol=1e-14)
    assert m.b.sum() == pytest.approx(1, abs=1e-14)
    assert m.b @ m.c[: m.stages] == pytest.approx(1 / 2, abs=1e-14)
    assert np.allclose(m.error.sum(axis=1), 0, atol=1e-13)
    at_end = m.dense.sum(axis=1)
    assert np.allclose(at_end[: m.stages], m.b, atol=1e-13)
    assert np.allclose(at_end[m.stages :], 0, atol=1e-12)


@pytest.mark.parametrize("name", ADAPTIVE)
def test_error_follows_the_tolerance(name, model, exact):
    errors = []
    for rtol in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
        result = model.simulate(0.5, method=name, rtol=rtol, atol=1e-3 * rtol)
        errors.append(np.max(np.abs(end(model, result) - exact)))
        assert errors[-1] < 1e3 * rtol
    rounding = 1e-13
    assert np.maximum(errors, rounding).tolist() == sorted(np.maximum(errors, rounding), reverse=True)
    assert errors[-1] < 1e-11


@pytest.mark.parametrize("name", INTEGRATORS)
def test_dense_output_lies_on_the_motion(name, model):
    """Samples inside long steps, against a run whose steps end near every sample."""
    loose = {"step": 1 / 64} if name in FIXED else {"rtol": 1e-6}
    tight = {"step": 1 / 4096} if name in FIXED else {"rtol": 1e-12}
    a, b = (model.simulate(0.5, method=name, samples=101, **o)["C.position"].values for o in (loose, tight))
    assert np.max(np.abs(a - b)) < (5e-4 if name in FIXED else 2e-5)
    lengths = [
        np.linalg.norm(x - y, axis=1)
        for r in [model.simulate(0.5, method=name, samples=101, **loose)]
        for x, y in [(r["A.position"].values, r["B.position"].values)]
    ]
    assert np.max(np.abs(lengths[0] - 0.5)) < 1e-14


@pytest.mark.parametrize("name", INTEGRATORS)
def test_two_runs_are_the_same_to_the_bit(name, model):
    options = {"step": 1e-3} if name in FIXED else {"rtol": 1e-9}
    a, b = (model.simulate(1.0, method=name, **options) for _ in range(2))
    for x, y in zip(a.variables, b.variables, strict=True):
        assert x.values.tobytes() == y.values.tobytes()


@pytest.mark.parametrize("name", INTEGRATORS)
def test_drift_stays_at_round_off_on_the_constraints(name):
    options = {"step": 1e-3} if name in FIXED else {"rtol": 1e-8}
    drift = symgen.build("peaucellier").simulate(5.0, method=name, **options).drift
    assert drift.constraint < 1e-16
    assert drift.velocity < 1e-15


def test_rk4_energy_drift_falls_with_the_fourth_power_at_least():
    model = symgen.build("peaucellier")
    a, b = (model.simulate(1.0, method="rk4", step=h).drift.energy for h in (4e-3, 2e-3))
    assert a / b > 2**3.5


@pytest.mark.parametrize(
    "options, message",
    [
        ({"method": "rk5"}, "no integrator 'rk5'. Did you mean 'rk4'"),
        ({"method": "rk4"}, "rk4 has a fixed step: give it one"),
        ({"method": "rk4", "step": 1e-3, "rtol": 1e-6}, "give step instead of rtol"),
        (
            {"method": "dop853", "step": 1e-3, "rtol": 1e-6},
            "fixed steps have no tolerance: give step, or rtol",
        ),
        ({"step": 1e-3, "rtol": 1e-10}, "^fixed steps have no tolerance"),
        ({"t_end": -1.0}, "expected t_end to be a finite number above zero, got -1.0"),
        ({"t_end": float("nan")}, "expected a finite number for t_end"),
        ({"rtol": 0.0}, "expected rtol"),
        ({"rtol": 1e-17}, "tightest that float64 can meet"),
        ({"samples": 1}, "between 2 and 10 million samples"),
        ({"step": 1e-14}, "too small against t_end"),
        ({"max_steps": 0}, "max_steps of at least 1"),
    ],
)
def test_options_out_of_range_are_refused(model, options, message):
    with pytest.raises(ModelError, match=message):
        model.simulate(**{"t_end": 1.0, **options})


def test_fixed_steps_are_by_default_those_of_dop853_which_has_smaller_errors_per_evaluation():
    model = symgen.build("four_bar")
    truth = model.simulate(1.0, rtol=1e-13, samples=2)
    run = model.simulate(1.0, step=1 / 60, samples=2)
    assert run.provenance["method"] == "dop853" and run.statistics["steps"] == 60
    errors = [
        np.max(np.abs(x["B.position"].values[-1] - truth["B.position"].values[-1]))
        for x in (run, model.simulate(1.0, method="rk4", step=1 / 180, samples=2))
    ]
    assert errors[0] < 1e-3 * errors[1]


@pytest.mark.parametrize("name", ADAPTIVE)
def test_adaptive_methods_take_fixed_steps_where_the_documentation_says_so(model, name):
    """The order of a series and the iterations of implicit stages follow the tolerance."""
    (listed,) = re.findall(
        r"Adaptive methods take `rtol` and `atol`; (.*?) also take fixed\s", PAGE.read_text()
    )
    if f"`{name}`" in listed:
        assert model.simulate(0.01, method=name, step=1e-3).statistics["steps"] == 10
    else:
        with pytest.raises(ModelError, match=f"{name} chooses its own step"):
            model.simulate(0.01, method=name, step=1e-3)
