"""The step loop around any method: constraints kept or left, drift limited, stiffness seen."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.result.files import load_result

ADAPTIVE = ["dop853", "dopri5"]

STIFF = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["1 m", "0 m"] }
[links]
rod = { points = ["O", "A"], mass = "1 kg" }
[[torsion_springs]]
link = "rod"
stiffness = "1 N*m"
damping = "DAMPING N*m*s"
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
[analysis]
t_end = "0.5 s"
outputs = ["A.position"]
"""


@pytest.fixture(scope="module")
def four_bar():
    return symgen.build("four_bar")


@pytest.fixture(scope="module")
def near(four_bar):
    """Positions at the end by a tight run."""
    return four_bar.simulate(2.0, rtol=1e-12).final["B"]["position"]


# -- stabilisation -------------------------------------------------------------------------------------------


def test_raw_drifts_baumgarte_holds_back_projection_stays_at_round_off(four_bar, near):
    runs = {s: four_bar.simulate(2.0, method="rk4", step=5e-3, stabilisation=s) for s in _core.STABILISATIONS}
    drift = {s: r.drift.constraint for s, r in runs.items()}
    assert drift["projection"] < 1e-15
    assert drift["raw"] > 1e-9
    assert drift["baumgarte"] < 0.1 * drift["raw"]
    for name, result in runs.items():
        assert np.max(np.abs(np.subtract(result.final["B"]["position"], near))) < 1e-4, name


def test_raw_drift_falls_with_the_order_of_the_method(four_bar):
    a, b = (
        four_bar.simulate(1.0, method="rk4", step=h, stabilisation="raw").drift.constraint
        for h in (4e-3, 2e-3)
    )
    assert 3.5 < np.log2(a / b) < 5.5


def test_baumgarte_makes_the_constraint_a_damped_oscillator(four_bar):
    """Off the constraints, Phi'' + 2 r Phi' + r^2 Phi = 0 with Phi'' by differences along the motion."""
    rate, h = 20.0, 1e-3
    q, u = (four_bar.initial_state().q, four_bar.initial_state().u)
    equations = four_bar.evaluator.equations(stabilisation=rate)
    off = np.concatenate([q + 1e-4 * np.sin(np.arange(q.size)), u + 1e-3, [0.0]])
    found = equations.derivative(0.0, off)
    lengths = four_bar.evaluator.blocks

    def phi(t):
        y = off[:-1] + t * found
        return lengths("constraints", t, y[: q.size], y[q.size :])["constraints"]

    def rates(t):
        y = off[:-1] + t * found
        return four_bar.evaluator("velocity_constraints", t, y[: q.size], y[q.size :])

    second = (rates(h * 1e-3) - rates(-h * 1e-3)) / (2e-3 * h)
    expected = -2 * rate * rates(0.0) - rate**2 * phi(0.0)
    assert np.max(np.abs(second - expected)) < 1e-6 * np.max(np.abs(expected))


def test_how_it_was_kept_is_recorded(four_bar):
    provenance = four_bar.simulate(0.1, stabilisation="baumgarte").provenance
    assert (provenance["stabilisation"], provenance["stabilisation_rate"]) == ("baumgarte", 10.0)
    assert four_bar.simulate(0.1).provenance["stabilisation"] == "projection"


@pytest.mark.parametrize(
    "options, message",
    [
        ({"stabilisation": "projecton"}, "expected stabilisation to be one of .* Did you mean 'projection'"),
        ({"stabilisation_rate": 5.0}, "goes with stabilisation=baumgarte, not with projection"),
        ({"stabilisation": "baumgarte", "stabilisation_rate": 0.0}, "expected stabilisation_rate"),
        ({"max_drift": float("nan")}, "expected a finite number for max_drift"),
    ],
)
def test_wrong_options_are_refused(four_bar, options, message):
    with pytest.raises(ModelError, match=message):
        four_bar.simulate(0.1, **options)


# -- drift limited -------------------------------------------------------------------------------------------


def test_a_run_ends_where_a_constraint_strays_too_far(four_bar):
    free = four_bar.simulate(2.0, method="rk4", step=5e-3, stabilisation="raw").drift.constraint
    with pytest.raises(SimulationError, match="the length of link .* strayed by .* max_drift") as caught:
        four_bar.simulate(2.0, method="rk4", step=5e-3, stabilisation="raw", max_drift=free / 10)
    assert 0.0 < caught.value.time < 2.0
    partial = caught.value.partial
    assert free / 10 < partial.drift.constraint < free
    assert len(partial.time) > 1 and partial.time[-1] <= caught.value.time
    assert f"{caught.value.time:.9g}" in str(caught.value)


def test_the_limit_is_not_reached_by_a_projected_run(four_bar):
    assert four_bar.simulate(2.0, max_drift=1e-12).drift.constraint < 1e-12


# -- step control --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ADAPTIVE)
def test_what_projection_takes_away_counts_as_error(name, four_bar, near):
    """A method that believes itself exact is held to the tolerance by its constraints alone."""
    method = INTEGRATORS[name]
    nothing = np.zeros_like(method.coefficients["error"])
    blind = dataclasses.replace(method, coefficients={**method.coefficients, "error": nothing})
    y0 = np.concatenate([four_bar.initial_state().q, four_bar.initial_state().u])
    misses = []
    for rtol in (1e-4, 1e-7, 1e-10):
        run = _core.Run(
            four_bar.evaluator.equations(), blind, 0.0, y0, 2.0, rtol, 1e-3 * rtol, 0.0, np.array([0.0])
        )
        status = run.begin()
        while status == _core.MORE:
            status = run.advance(1000)
        assert status == _core.DONE
        assert run.rejected > 0
        index = four_bar.description.free.index("B")
        misses.append(np.max(np.abs(run.state[2 * index : 2 * index + 2] - near)))
        assert misses[-1] < 1e3 * rtol
    assert misses == sorted(misses, reverse=True)


# -- stiffness -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "rtol"),
    [*((name, 1e-5) for name in ADAPTIVE), ("taylor", 1e-5), ("taylor", 1e-9), ("taylor", 1e-12)],
)
def test_stiffness_is_noted(name, rtol, tmp_path):
    notes = {}
    for damping in ("0.5", "2e4"):
        file = tmp_path / "damped.toml"
        file.write_text(STIFF.replace("DAMPING", damping))
        notes[damping] = symgen.build(str(file)).simulate(method=name, rtol=rtol).notes
    assert notes["0.5"] == ()
    assert any("the motion is stiff from t = " in note and name in note for note in notes["2e4"])


def test_power_series_of_tight_tolerances_are_not_called_stiff():
    """Their last terms are as small as roundings, also of far_origin; length_ratios and whip have fast parts."""
    ends = {"triple_pendulum": 15.0, "length_ratios": 0.5, "whip": 0.3, "car_axis": 3.0, "far_origin": 2.0}
    for scene, end in ends.items():
        result = symgen.build(scene).simulate(end, method="taylor", rtol=1e-12, samples=2)
        assert result.statistics["steps"] > 40
        assert not [note for note in result.notes if "stiff" in note], scene


# -- cost ----------------------------------------------------------------------------------------------------


def test_rank_is_not_watched_in_a_tree_which_cannot_lose_it():
    """One factorisation per step for the projection, one for series; loops are looked at in between as well."""
    for method, count in (("dop853", 1), ("taylor", 2)):
        options = {"samples": 2, "method": method}
        tree = symgen.build("triple_pendulum").simulate(1.0, **options).statistics
        assert tree["factorisations"] == count * (tree["steps"] + 1)
        loop = symgen.build("four_bar").simulate(1.0, **options).statistics
        assert loop["factorisations"] > (count + 1) * loop["steps"]


def test_a_result_holds_everything_when_asked_saved_or_pickled(four_bar, tmp_path):
    first, second, third = (four_bar.simulate(0.5, samples=5) for _ in range(3))
    pickled = pickle.loads(pickle.dumps(first))
    loaded = load_result(second.save(tmp_path / "run.npz"))
    four_bar.simulate(1.0)  # what results still have to make does not depend on later runs
    for other in (pickled, loaded):
        assert other.final == third.final
        assert [v.name for v in other.variables] == [v.name for v in third.variables]
        for a, b in zip(other.variables, third.variables, strict=True):
            assert a.values.tobytes() == b.values.tobytes()
    with pytest.raises(AttributeError, match="no attribute 'finale'"):
        _ = third.finale
    assert repr(four_bar.simulate(0.1, samples=2)) == "<Result 'four_bar': 2 samples, 8 outputs, taylor>"


@pytest.mark.parametrize(
    ("scene", "method"),
    [("four_bar", "radau5"), ("triple_pendulum", "dopri5"), ("tumbling_body", "dop853"), ("cssp", "dop853")],
)
def test_the_tightest_tolerance_is_met(scene, method):
    """Rounding comes back after every projection, however short the step: it is no reason for a shorter one."""
    model = symgen.build(scene)
    run = model.simulate(1.0, method=method, rtol=2.3e-14, samples=2)
    other = model.simulate(1.0, rtol=1e-12, samples=2)
    for variable in other.variables:
        size = max(1.0, float(np.max(np.abs(variable.values))))
        assert run[variable.name].values == pytest.approx(variable.values, abs=1e-9 * size), variable.name


# -- nodes ---------------------------------------------------------------------------------------------------


def run_of(model, name, t0, y0, t_end, step, times, **more):
    """Return the recorded states and the number of steps of a run."""
    tolerance = 1e-9 if INTEGRATORS[name].adaptive else 0.0
    run = _core.Run(
        model.evaluator.equations(),
        INTEGRATORS[name],
        t0,
        y0,
        t_end,
        tolerance,
        tolerance,
        step,
        times,
        **more,
    )
    assert run.begin() == _core.MORE
    assert run.advance(1000) == _core.DONE
    return run.result, run.steps


@pytest.mark.parametrize("name", ["rk4", "dop853", "rattle"])
def test_steps_end_at_nodes_and_a_gap_keeps_the_state(four_bar, name):
    """The same as two runs: one to the gap, and one behind it from the same state."""
    start = four_bar.initial_state()
    y0 = np.concatenate([start.q, start.u])
    times = np.array([0.0, 0.1, 0.15, 0.2, 0.25])
    nodes, counts = np.array([0.0, 0.06, 0.1, 0.2, 0.25]), np.array([0, -1, -1, 0, -1])
    found, steps = run_of(four_bar, name, 0.0, y0, 0.25, 0.02, times, nodes=nodes, counts=counts)
    first, to_gap = run_of(four_bar, name, 0.0, y0, 0.1, 0.02, times[:2])
    last, behind = run_of(four_bar, name, 0.2, first[-1], 0.25, 0.02, times[-2:])
    assert np.array_equal(found[1], found[2]) and np.array_equal(found[1], found[3])
    close = 1e-12 if name != "dop853" else 1e-8  # a node inside divides a step
    assert found[1] == pytest.approx(first[-1], abs=close)
    assert found[4] == pytest.approx(last[-1], abs=close)
    assert steps >= to_gap + behind


def test_counted_steps_are_equal_between_nodes(four_bar):
    start = four_bar.initial_state()
    y0, times = np.concatenate([start.q, start.u]), np.array([0.1, 0.16])
    nodes, counts = np.array([0.0, 0.1, 0.16]), np.array([0, 4, 3])
    found, steps = run_of(four_bar, "rk4", 0.0, y0, 0.16, 0.0, times, nodes=nodes, counts=counts)
    first, _ = run_of(four_bar, "rk4", 0.0, y0, 0.1, 0.1 / 4, times[:1])
    last, _ = run_of(four_bar, "rk4", 0.1, first[0], 0.16, 0.06 / 3, times[1:])
    assert steps == 4 + 3
    assert found == pytest.approx(np.vstack([first, last]), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("nodes", "counts"),
    [
        ([0.0, 1.0], [0]),
        ([0.0], [0]),
        ([0.0, 0.5, 0.5, 1.0], [0, 1, 1, 1]),
        ([0.0, 1.0], [0, -2]),
        ([0.1, 1.0], [0, 3]),
        ([0.0, 0.9], [0, 3]),
        ([0.0, 1.0], [1, 3]),
        ([0.0, 0.5, 1.0], [0, 3, 0]),
        ([0.0, np.nan, 1.0], [0, 3, 1]),
    ],
)
def test_nodes_that_do_not_lead_to_the_end_are_refused(four_bar, nodes, counts):
    start = four_bar.initial_state()
    y0, equations = np.concatenate([start.q, start.u]), four_bar.evaluator.equations()
    with pytest.raises(ValueError, match="expected .*nodes"):
        _core.Run(
            equations, INTEGRATORS["rk4"], 0.0, y0, 1.0, 0.0, 0.0, 0.1, np.array([1.0]), nodes=np.array(nodes),
            counts=counts,
        )  # fmt: skip
