"""Many runs in a call: equal to single runs and to closed forms, failures as entries, wrong calls refused."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from shared.full import full
from shared.variants import BASE, crank_rocker_with_lengths, pins

import symgen
from symgen.errors import CapabilityError, InitialStateError, ModelError, RangeError
from symgen.runtime.kernels import batch
from symgen.runtime.many import runs
from symgen.runtime.many.dataset import Keep
from symgen.runtime.rods import start
from symgen.runtime.rods.many import compiled, driven
from symgen.runtime.rods.many.compiled import compiled_runs
from symgen.scene.loading import SHIPPED, read_scene

LENGTHS = {"a": 0.1, "b": np.linspace(0.33, 0.37, 7), "c": np.linspace(0.31, 0.29, 7)}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return symgen.build(crank_rocker_with_lengths(tmp_path_factory.mktemp("variants")), backend="c")


def single(model, parameters, i):
    return model.with_parameters(**{n: np.broadcast_to(v, 7)[i] for n, v in parameters.items()})


def same_bits(dataset, results):
    """Every output of every run is that of its own result, to the bit."""
    assert len(results) == dataset.sizes["run"] and not any(dataset["error"].values)
    for i, result in enumerate(results):
        assert result.variables
        for v in result.variables:
            assert np.array_equal(dataset[v.name].values[i], v.values, equal_nan=True), (i, v.name)


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("analysis", ["simulate", "kinematics", "inverse_dynamics"])
def test_each_run_has_the_bits_of_a_single_one(model, analysis, threads):
    options = {"samples": 11} if analysis != "simulate" else {"samples": 11, "t_end": 0.2, "rtol": 1e-6}
    parts = []
    found = getattr(model, f"{analysis}_many")(LENGTHS, threads=threads, progress=parts.append, **options)
    same_bits(found, [getattr(single(model, LENGTHS, i), analysis)(**options) for i in range(7)])
    assert found["b"].values == pytest.approx(LENGTHS["b"]) and np.all(found["a"].values == 0.1)
    assert found["b"].attrs["units"] == "m" and found["error"].dims == ("run",)
    assert parts == sorted(parts) and parts[-1] == 1.0


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        ("four_bar", {"method": "rk4", "step": 1e-3, "t_end": 0.05}),
        ("andrews_squeezer", {"t_end": 0.01}),
        ("car_axis", {"t_end": 0.05, "stabilisation": "baumgarte"}),
        full("andrews_squeezer", {"t_end": 0.002, "step": 1e-4, "samples": 7}),
        ("tumbling_body", {"t_end": 0.05, "step": 1e-3, "t_eval": [0.0, 0.013, 0.05]}),
        ("tumbling_body", {"t_end": 0.05, "method": "rk4", "step": 1e-3, "samples": 101}),
        ("triple_pendulum", {"t_end": 0.1, "method": "dop853", "step": 1e-3}),  # samples between steps
        ("double_four_bar", {"t_end": 0.1, "step": 1e-3}),
        ("tumbling_body", {"t_eval": [0.01, 0.02, 0.05], "t_end": 0.06}),
        ("triple_pendulum", {"t_end": 0.1, "method": "rattle", "step": 1e-3}),
        ("peaucellier", {"t_end": 0.1}),  # redundant constraints: each run by itself
    ],
)
def test_states_of_all_kinds_give_the_bits_of_single_runs(scene, options):
    model = symgen.build(scene)
    start = model.initial_state()
    states = [
        model.state(start.positions, {p: f * v for p, v in start.velocities.items()}) for f in (1.0, 0.5, 1.5)
    ]
    found = model.simulate_many(states=states, threads=2, **options)
    same_bits(found, [model.simulate(state=state, **options) for state in states])


def test_fixed_steps_in_lanes_have_the_bits_of_single_runs(model):
    """One lane cannot be assembled, another meets a dead centre: neither changes its neighbours."""
    lengths = [0.35, 0.7, 0.2, 0.36, 0.34, 0.33, 0.37]
    options = {"step": 1 / 720, "t_end": 0.5, "samples": 14}
    found = model.simulate_many({"b": lengths, "a": 0.12}, threads=1, **options)
    assert [bool(e) for e in found["error"].values] == [i in (1, 2) for i in range(7)]
    assert "cannot be assembled" in found["error"].values[1]
    assert "brought back onto the constraints" in found["error"].values[2]
    for i in (0, 3, 4, 5, 6):
        alone = model.with_parameters(b=lengths[i], a=0.12).simulate(**options)
        for v in alone.variables:
            assert np.array_equal(found[v.name].values[i], v.values), (i, v.name)
        assert found["energy_drift"].values[i] == alone.drift.energy
        assert found["constraint_drift"].values[i] == alone.drift.constraint


def test_revolutions_are_counted_and_springs_start_at_their_variant(tmp_path):
    scene = tmp_path / "spring.toml"
    text = (
        (SHIPPED / "crank_rocker.toml")
        .read_text(encoding="utf-8")
        .replace("[points]", '[parameters.k]\nvalue = "200 N/m"\ntunable = true\n\n[points]')
    )
    text = text.replace("outputs = [", 'outputs = ["crank.angle", "crank.angular_velocity", ')
    text += '\n[[springs]]\nbetween = ["A", "C"]\nstiffness = "k"\nlength = "20 cm"\n'
    scene.write_text(text, encoding="utf-8")
    model = symgen.build(scene)
    stiffness = [100.0, 200.0, 300.0, 400.0]
    found = model.simulate_many({"k": stiffness}, t_end=2.5, samples=26, threads=1)
    same_bits(found, [model.with_parameters(k=k).simulate(2.5, samples=26) for k in stiffness])
    assert found["crank.angle"].values[:, -1] == pytest.approx(5 * np.pi)


def test_regular_runs_stay_in_compiled_code(model):
    columns = {"b": np.linspace(0.34, 0.36, 4)}
    first = model.with_parameters(b=0.34).simulate(samples=5)
    compiled = compiled_runs(model, first, columns, None, {"samples": 5})
    kept = compiled(0, 4, Keep(None, None))
    assert all(k is not None for k in kept) and compiled.grain == 1
    first = model.with_parameters(b=0.34).simulate(samples=5, step=1e-3)
    assert compiled_runs(model, first, columns, None, {"samples": 5, "step": 1e-3}).grain in (2, 4, 8)
    assert compiled_runs(model, first, columns, None, {"samples": 5, "max_wall": 1.0}) == "max_wall is given"


def test_long_runs_and_large_linkages_are_carried_out_singly(model, monkeypatch):
    """Fixed steps in lanes end with the run alone; large linkages have sparse starts, of other bits."""
    columns, given = {"b": np.linspace(0.34, 0.36, 4)}, {"samples": 5, "step": 1e-3, "t_end": 0.11}
    first = model.with_parameters(b=0.34).simulate(**given)
    assert compiled_runs(model, first, columns, None, given).grain
    with monkeypatch.context() as shorter:
        shorter.setattr(compiled, "MOST_STEPS", 100)
        assert compiled_runs(model, first, columns, None, given) == "a run has more than 100 steps"
    for module in (start, compiled, driven):
        monkeypatch.setattr(module, "LARGE", 0)
    for analysis in ("simulate", "kinematics"):
        options = {"samples": 5, "t_end": 0.1} if analysis == "simulate" else {"samples": 5}
        runs = [getattr(model.with_parameters(b=b), analysis)(**options) for b in columns["b"]]
        reason = "there are more than 0 coordinates" if analysis == "simulate" else ""
        assert compiled_runs(model, runs[0], columns, None, options) == reason
        same_bits(getattr(model, f"{analysis}_many")(columns, **options), runs)


def test_an_interrupt_waits_for_few_runs(model, monkeypatch):
    """For one in each thread if they are single, else for blocks of so many steps."""
    begun, result = [], runs.Runs.result

    def slow(self, i):
        begun.append(i)
        if i > 32:
            time.sleep(0.01)
        return result(self, i)

    def interrupt(fraction):
        if len(begun) > 32:
            raise KeyboardInterrupt

    columns, given = {"b": np.linspace(0.34, 0.36, 256)}, {"samples": 2, "step": 1e-3, "t_end": 0.005}
    first = model.with_parameters(b=0.34).simulate(**given)
    with monkeypatch.context() as shorter:
        shorter.setattr(compiled, "MOST_STEPS", 12)
        assert compiled_runs(model, first, columns, None, given).most(Keep(None, None)) == 2
    monkeypatch.setattr(runs.Runs, "result", slow)
    with pytest.raises(KeyboardInterrupt):
        model.simulate_many(columns, max_wall=60.0, threads=2, progress=interrupt, **given)
    assert 32 < len(begun) < 50


def test_large_programs_are_not_compiled_for_lanes(model, monkeypatch):
    """Their straight-line code for vectors takes a compiler longer than many runs."""
    columns, given = {"b": np.linspace(0.34, 0.36, 4)}, {"samples": 5, "step": 1e-3, "t_end": 0.02}
    first = model.with_parameters(b=0.34).simulate(**given)
    assert compiled_runs(model, first, columns, None, given).batched
    monkeypatch.setattr(batch, "MOST_IN_LANES", 100)
    assert not compiled_runs(model, first, columns, None, given).batched
    driven_first = model.with_parameters(b=0.34).kinematics(samples=5)
    assert compiled_runs(model, driven_first, columns, None, {"samples": 5}) == ""
    same_bits(
        model.simulate_many(columns, **given),
        [model.with_parameters(b=b).simulate(**given) for b in columns["b"]],
    )


def test_positions_are_those_of_two_circles(model):
    angles = np.linspace(0.0, 2 * np.pi, 25)
    found = model.kinematics_many(LENGTHS, at=angles[:-1], of=["B"])
    for i in range(7):
        _, there = pins(0.1, LENGTHS["b"][i], LENGTHS["c"][i], angles[:-1])
        assert found["B.position"].values[i] == pytest.approx(there, abs=1e-13)


def test_outputs_are_chosen_and_reduced(model):
    whole = model.simulate_many(LENGTHS, samples=31)
    least = model.simulate_many(LENGTHS, samples=31, outputs=["crank.torque", "B.position"], reduce=np.min)
    drifts = {"constraint_drift", "energy_drift"}
    assert set(least.data_vars) == {"error", "crank.torque", "B.position"} | drifts
    assert least["crank.torque"].dims == ("run",) and least["B.position"].dims == ("run", "axis")
    assert np.array_equal(least["B.position"], whole["B.position"].min("time"))
    assert np.array_equal(least["crank.torque"], whole["crank.torque"].min("time"))
    assert np.all(whole["constraint_drift"] < 1e-12) and np.all(whole["energy_drift"] < 1e-6)


def test_a_failed_run_is_an_entry_with_its_error(model):
    lengths = np.array([0.35, 0.7, 0.36])  # 0.7 m is longer than rocker and opening, 0.6 m
    found = model.simulate_many({"b": lengths}, samples=5)
    assert [bool(e) for e in found["error"].values] == [False, True, False]
    assert "cannot be assembled" in found["error"].values[1]
    assert np.all(np.isnan(found["B.position"].values[1])) and np.isnan(found["energy_drift"].values[1])
    alone = model.with_parameters(b=0.36).simulate(samples=5)["B.position"].values
    assert np.array_equal(found["B.position"].values[2], alone)
    with pytest.raises(InitialStateError, match="cannot be assembled"):
        model.simulate_many({"b": [0.7, 0.8]})


def test_samples_beyond_a_dead_centre_are_nan(model):
    """A crank of 0.2 m cannot pass the angle at which coupler and rocker are in line."""
    sizes = {"a": [0.1, 0.2], "b": 0.2, "c": [0.35, 0.25]}
    found = model.kinematics_many(sizes, samples=73, of=["B"])
    a, reach = 0.2, 0.2 + 0.25
    limit = np.arccos((a**2 + BASE**2 - reach**2) / (2 * a * BASE)) / (2 * np.pi)
    times = found["time"].values
    reached = np.isfinite(found["B.position"].values).all(axis=2)
    assert reached[0].all() and not any(found["error"].values)
    assert np.array_equal(reached[1], times < limit)


def test_coordinates_of_their_own_are_rows(tmp_path):
    """At variants of the speed the same times are other angles of the crank."""
    scene = tmp_path / "speeds.toml"
    text = (SHIPPED / "crank_rocker.toml").read_text(encoding="utf-8")
    scene.write_text(text.replace('"60 rpm"', '{ value = "60 rpm", tunable = true }'), encoding="utf-8")
    speeds = np.array([2.0, 4.0, 6.0]) * np.pi
    found = symgen.build(scene).inverse_dynamics_many({"speed": speeds}, samples=9)
    assert not any(found["error"].values) and found["crank.torque"].dims == ("run", "sample")
    angles = speeds[:, None] * np.linspace(0.0, 1.0, 9)
    assert found["crank.angle"].values == pytest.approx(angles)


def test_states_and_equilibria():
    bar = symgen.build("four_bar")
    states = [bar.simulate(t, samples=2).at(t) for t in (0.1, 0.2)]
    states = [
        bar.state(*({p: s.final[p][k] for p in ("A", "B")} for k in ("position", "velocity"))) for s in states
    ]
    same_bits(
        bar.simulate_many(states=states, t_end=0.1, samples=5),
        [bar.simulate(0.1, samples=5, state=state) for state in states],
    )
    found = bar.equilibrium_many(states=states)
    alone = bar.equilibrium(state=states[1])
    assert list(found["stability"].values) == ["stable", "stable"]
    assert np.array_equal(found["B.position"].values[1], alone.state.positions["B"])
    assert np.array_equal(found["O.reaction"].values[1], alone.reactions["O"])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "expected a list of values for a parameter, or of states"),
        ({"parameters": {"b": 0.35}}, "expected a list of values for a parameter, or of states"),
        ({"parameters": {"b": []}}, r"expected at least one run, got the shape \(0,\) of b"),
        ({"parameters": {"bb": [0.3]}}, "no tunable parameter 'bb'"),
        ({"parameters": {"b": [[0.3]]}}, r"one value of b per run, or one for all, got the shape \(1, 1\)"),
        ({"parameters": {"b": [0.3, 0.3], "c": [0.3]}}, r"2 values of c, as of b, got the shape \(1,\)"),
        ({"parameters": {"b": [0.35, np.nan]}}, "expected finite values of b, got nan for run 1"),
        ({"parameters": {"b": ["x"]}}, "numbers for parameters"),
        ({"states": 3}, "expected a list of states, one per run"),
        ({"states": [3]}, "expected a state of .* for run 0, got 3"),
        ({"parameters": {"b": [0.35]}, "threads": 0}, "expected one thread or more, got 0"),
        ({"parameters": {"b": [0.35]}, "outputs": ["B.positon"]}, "no output 'B.positon'.*B.position"),
        ({"parameters": {"b": [0.35]}, "resume": "x"}, "simulate_many does not accept resume"),
        ({"parameters": {"b": [0.35]}, "revolutions": 2.0}, "does not accept revolutions"),
        ({"parameters": {"b": [0.35]}, "rtol": -1.0}, "rtol"),
        (
            {"parameters": {"b": [0.35]}, "reduce": lambda x, axis: x},
            r"expected reduce to return the shape \(2,\)",
        ),
    ],
)
def test_wrong_calls_are_refused(model, given, message):
    with pytest.raises(ModelError, match=message):
        model.simulate_many(**given)


def test_a_state_of_another_linkage_is_refused():
    model = symgen.build("four_bar")
    state, other = model.initial_state(), symgen.build("triple_pendulum").initial_state()
    short = replace(state, u=state.u[:1])
    with pytest.raises(ModelError, match="expected 4 rates of four_bar for run 1, got 1"):
        model.simulate_many(states=[state, short])
    with pytest.raises(ModelError, match="expected 4 coordinates of four_bar for run 1, got 6"):
        model.simulate_many(states=[state, other])


def test_a_linkage_in_space_runs_in_its_plane():
    scene = symgen.Scene(
        points={
            "O": {"at": [0, 0, 0], "ground": True},
            "A": {"at": ["1 m", 0, 0]},
            "B": {"at": ["1.6 m", "-0.8 m", 0]},
        },
        links={
            "OA": {"points": ["O", "A"], "mass": "2 kg"},
            "AB": {"points": ["A", "B"], "mass": "1 kg"},
        },
        gravity={"acceleration": [0, "-9.81 m/s^2", 0]},
        analysis={"t_end": "0.3 s", "outputs": ["B.position", "energy"]},
    )
    model = symgen.build(scene)
    start = model.initial_state()
    states = [model.state(start.positions, {"A": [0, v, 0], "B": [0, v, 0]}) for v in (0.0, 1.0)]
    found = model.simulate_many(states=states, samples=5)
    assert found["B.position"].shape == (2, 5, 3)
    same_bits(found, [model.simulate(samples=5, state=state) for state in states])


def test_models_without_the_analysis_say_why():
    with pytest.raises(CapabilityError, match="four_bar does not support kinematics_many: .* 1 more drive"):
        symgen.build("four_bar").kinematics_many  # noqa: B018
    assert "kinematics_many" not in dir(symgen.build("four_bar"))


@pytest.mark.parametrize(("scene", "parameter"), [("loop", "rpm"), ("linkage", "w")])
@pytest.mark.parametrize("speeds", [[5.0, 0.0, 4.0], [0.0, 5.0, 4.0]])
def test_a_run_whose_input_does_not_come_to_its_values_is_an_entry(scene, parameter, speeds):
    if scene == "loop":
        model = symgen.build("slider_crank")
    else:
        data = dict(read_scene(SHIPPED / "crank_rocker.toml").data)
        data["parameters"] = {**data["parameters"], "w": {"value": "6 rad/s", "tunable": True}}
        model = symgen.build(symgen.Scene(**{**data, "drivers": [{"link": "crank", "angle": "w*t"}]}))
    for at in ({"at": [0.1, 3.0]}, {"start": 0.1, "stop": 3.0, "samples": 4, "over": "input"}):
        found = model.kinematics_many({parameter: speeds}, **at)
        errors = found["error"].values
        assert ["does not come to" in e for e in errors] == [speed == 0.0 for speed in speeds]
        moving = [i for i, speed in enumerate(speeds) if speed]
        times = found["time"].values
        for i in moving:
            assert times[i][0] * speeds[i] == pytest.approx(0.1) and times[i][-1] * speeds[
                i
            ] == pytest.approx(3.0)
    with pytest.raises(RangeError, match="does not come to"):
        model.kinematics_many({parameter: [0.0, 0.0]}, at=[0.1])
