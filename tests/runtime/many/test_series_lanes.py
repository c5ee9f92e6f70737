"""Power series in SIMD lanes: bits of single runs, closed forms, orders, and what leaves its lane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shared.full import full
from shared.pendulum import PENDULUM, exact
from shared.variants import crank_rocker_with_lengths

import symgen
from symgen.errors import ModelError
from symgen.runtime.integrate.integrators.taylor import of_order
from symgen.runtime.kernels.batch import lanes_of
from symgen.runtime.rods.many.compiled import compiled_runs
from symgen.toolchain import compiler


def in_lanes(model, columns=None, states=None, **options):
    """Runs in lanes with the options of a first single one."""
    one = {} if states is None else {"state": states[0]}
    values = {name: column[0] for name, column in (columns or {}).items()}
    first = (model.with_parameters(**values) if values else model).simulate(method="taylor", **one, **options)
    found = compiled_runs(model, first, columns or {}, states, {"method": "taylor", **options})
    assert found.grain in (2, 4, 8)
    return found


def same_bits(found, alone, at):
    """Every output of runs, and their drift, is that of single runs."""
    for i, result in zip(at, alone, strict=True):
        assert not found["error"].values[i] and result.variables
        for v in result.variables:
            assert np.array_equal(found[v.name].values[i], v.values), (i, v.name)
        assert found["energy_drift"].values[i] == result.drift.energy
        assert found["constraint_drift"].values[i] == result.drift.constraint


def swings(model, parts):
    start = model.initial_state()
    return [model.state(start.positions, {p: f * v for p, v in start.velocities.items()}) for f in parts]


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        ("four_bar", {"rtol": 1e-8, "t_end": 2.0, "samples": 2}),
        ("four_bar", {"rtol": 1e-12, "t_end": 0.4, "t_eval": [0.0, 0.013, 0.2, 0.2001, 0.33], "max_step": 0.05}),
        ("tumbling_body", {"t_end": 1.0, "samples": 41}),
        ("triple_pendulum", {"t_end": 0.5, "rtol": 1e-6, "atol": 1e-6}),
        full("andrews_squeezer", {"t_end": 0.01, "rtol": 1e-10, "samples": 7}),
        *(full(name, {"t_end": 0.3}) for name in ("car_axis", "length_ratios", "peaucellier_perturbed", "whip")),
    ],
)  # fmt: skip
def test_lanes_have_the_bits_of_single_runs(scene, options):
    """More runs than lanes, one from rest, each with steps of its own."""
    model = symgen.build(scene)
    states = swings(model, (1.0, 0.5, 1.5, 0.0, 0.2, 0.7, 1.1, 1.2, 1.3, 1.4, 0.9))
    compiled = in_lanes(model, states=states, **options)
    runs = compiled.runs()
    assert runs.carry_out(compiled.parameters, compiled.states)[0].all() and runs.alone == 0
    found = model.simulate_many(states=states, method="taylor", threads=2, **options)
    same_bits(
        found, [model.simulate(state=s, method="taylor", **options) for s in states], range(len(states))
    )


@pytest.mark.parametrize("flags", [(), ("-mavx2",)])
def test_lanes_of_any_width_have_the_same_bits(flags, monkeypatch):
    if not compiler.has_wide_vectors():
        pytest.skip("the processor has vectors of one width")
    monkeypatch.setitem(compiler.VECTORS, "native", flags)
    model = symgen.build("four_bar")
    states, options = swings(model, np.linspace(0.5, 1.5, 5)), {"t_end": 0.3, "samples": 4}
    assert in_lanes(model, states=states, **options).grain == {(): 2, ("-mavx2",): 4}[flags]
    found = model.simulate_many(states=states, method="taylor", **options)
    same_bits(found, [model.simulate(state=s, method="taylor", **options) for s in states], range(5))


def test_a_lane_that_fails_leaves_the_others(tmp_path):
    """One variant cannot be assembled, another meets a dead centre; the drive's work is integrated."""
    model = symgen.build(crank_rocker_with_lengths(tmp_path), backend="c")
    lengths, options = [0.35, 0.7, 0.2, 0.36, 0.34, 0.33, 0.37], {"t_end": 0.5, "samples": 14, "rtol": 1e-9}
    found = model.simulate_many({"b": lengths, "a": 0.12}, method="taylor", threads=1, **options)
    assert [bool(e) for e in found["error"].values] == [i in (1, 2) for i in range(7)]
    regular = (0, 3, 4, 5, 6)
    alone = [
        model.with_parameters(b=lengths[i], a=0.12).simulate(method="taylor", **options) for i in regular
    ]
    same_bits(found, alone, regular)
    compiled = in_lanes(model, {"b": np.array(lengths), "a": np.full(7, 0.12)}, **options)
    runs = compiled.runs()
    assert runs.carry_out(compiled.parameters)[0].tolist() == [i in regular for i in range(7)]
    assert runs.alone == 2


def slider():
    """A slider at uniform speed passes a spring: only the work at the end of a step shows that it is too long."""
    return symgen.Scene(
        parameters={"L": "2 m", "v": "1 m/s", "k": {"value": "10 N/m", "tunable": True}},
        points={
            "O": {"at": ["-3 m", "0 m"], "ground": True},
            "R": {"at": ["3 m", "0 m"], "ground": True},
            "S": {"at": ["0 m", "0.1 m"], "ground": True},
            "A": {"at": ["-1 m", "0 m"]},
        },
        links={"rail": {"points": ["O", "R"]}, "ram": {"points": ["O", "A"], "length": "L + v*t"}},
        masses=[{"point": "A", "mass": "1 kg"}],
        guides=[{"points": ["A"], "along": "rail"}],
        springs=[{"between": ["S", "A"], "stiffness": "k", "length": "0.1 m", "damping": "1 N*s/m"}],
        analysis={"outputs": ["A.position", "ram.tension", "energy"]},
    )


def test_rejected_steps_are_repeated_in_their_lane():
    model = symgen.build(slider(), backend="c")
    values, options = np.array([1.0, 10.0, 1000.0, 30.0, 3.0]), {"t_end": 2.0, "samples": 5, "rtol": 1e-9}
    compiled = in_lanes(model, {"k": values}, **options)
    runs = compiled.runs()
    assert runs.carry_out(compiled.parameters)[0].all() and runs.alone == 0
    alone = [model.with_parameters(k=k).simulate(method="taylor", **options) for k in values.tolist()]
    assert min(r.statistics["rejected"] for r in alone) > 0
    assert len({(r.statistics["steps"], r.statistics["rejected"]) for r in alone}) > 1
    same_bits(model.simulate_many({"k": values}, method="taylor", **options), alone, range(5))


def released(model, angles):
    return [model.state({"A": [np.sin(x), -np.cos(x)]}) for x in angles]


def test_pendulums_are_those_of_elliptic_functions():
    """From rest, each by an angle of its own, at times between steps."""
    model, angles, times = symgen.build(PENDULUM), np.linspace(0.4, 2.6, 9), [0.1, 0.77, 1.5]
    found = model.simulate_many(
        states=released(model, angles), method="taylor", rtol=1e-12, t_end=1.5, t_eval=times
    )
    truth = [[exact(t, x)[:2] for t in times] for x in angles]
    assert np.max(np.abs(found["A.position"].values - truth)) < 1e-11


def test_order_of_convergence_in_lanes():
    """Fixed steps of series of order 9, whose rates have one order less, as in single runs."""
    model, angles = symgen.build(PENDULUM), np.array([1.5, 1.55, np.pi / 2, 1.6])
    states, counts, errors = released(model, angles), (8, 20, 48), []
    truth = np.array([exact(1.0, x) for x in angles])
    compiled = in_lanes(model, states=states, t_end=1.0, samples=2)
    assert [b.name for b in compiled.evaluator.find("outputs").blocks][:2] == ["A.position", "A.velocity"]
    for count in counts:
        chosen = replace(compiled.chosen, method=of_order(9), rtol=0.0, atol=0.0, step=1.0 / count)
        runs = replace(compiled, chosen=chosen).runs()
        regular, out, _, _ = runs.carry_out(compiled.parameters, compiled.states)
        assert regular.all() and runs.alone == 0
        errors.append(np.abs(out[:, -1, :4] - truth).max(axis=1))
    for of_one in np.transpose(errors):
        assert -np.polyfit(np.log(counts), np.log(of_one), 1)[0] == pytest.approx(8.0, abs=0.4)


def test_lanes_without_series_are_as_before():
    """Kernels of power series are compiled for lanes that need them only."""
    model = symgen.build("four_bar")
    plain, with_series = model.number_type.kernels(True), model.number_type.kernels(True, True)
    assert "series" not in plain.addresses and "series" in with_series.addresses
    assert lanes_of(plain, "four_bar") == lanes_of(with_series, "four_bar")


def test_what_lanes_do_not_have_is_carried_out_singly_or_refused():
    """Events are found in single runs; steps of a given length are those of other methods."""
    bar = {"points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}}}
    scene = symgen.Scene(
        **bar,
        links={"bar": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        events=[{"name": "down", "of": "A.position.x", "ends_run": True}],
    )
    model = symgen.build(scene)
    states, options = swings(model, (1.0, 1.0)), {"t_end": 1.0, "samples": 3, "method": "taylor"}
    found = model.simulate_many(states=states, **options)
    assert found.attrs["notes"] == "runs are not in SIMD lanes: the scene has events"
    alone = model.simulate(state=states[1], **options)
    assert all("down" in reason for reason in found["ended_early"].values)
    there = found["A.position"].values[1]
    assert np.array_equal(there[: len(alone["A.position"].values)], alone["A.position"].values)
    with pytest.raises(ModelError, match="taylor chooses its own step"):
        model.simulate_many(states=states, step=1e-2, **options)
    four_bar = symgen.build("four_bar")
    with pytest.raises(ModelError, match="goes with explicit methods"):
        four_bar.simulate_many(states=swings(four_bar, (1.0,)), stabilisation="baumgarte", **options)


@pytest.mark.parametrize(
    ("changes", "options", "reason"),
    [
        ({}, {"method": "taylor"}, None),
        ({}, {"method": "rk4", "step": 1e-2}, None),
        ({}, {"rtol": 1e-11}, "they are less than 64"),
        ({}, {}, "they are less than 64"),
        (
            {},
            {"rtol": 1e-6},
            "these are for taylor, and for dop853 and rk4 with fixed steps and projection",
        ),
        ({}, {"method": "radau5"}, "radau5 is implicit"),
        ({"outputs": ["bar.angle"]}, {"method": "taylor"}, "an angle of a link is recorded"),
        ({"spring": "2 N*m/rad"}, {"method": "taylor"}, "a torsion spring or a load follows an angle"),
        ({"force": "sign(A.vx)*push"}, {"method": "taylor"}, "a load has jumps"),
    ],
)
def test_datasets_note_why_runs_are_not_in_lanes(changes, options, reason):
    springs = (
        [{"link": "bar", "stiffness": changes["spring"], "angle": "0 rad"}] if "spring" in changes else []
    )
    forces = [{"point": "A", "force": [changes["force"], "0 N"]}] if "force" in changes else []
    model = symgen.build(
        symgen.Scene(
            parameters={"push": "1 N"},
            points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
            links={"bar": {"points": ["O", "A"], "mass": "1 kg"}},
            gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
            torsion_springs=springs,
            forces=forces,
            analysis={"outputs": changes.get("outputs", ["A.position"])},
        )
    )
    found = model.simulate_many(states=swings(model, (1.0, 1.0)), t_end=0.1, samples=2, **options)
    assert found.attrs.get("notes") == (reason and f"runs are not in SIMD lanes: {reason}")


def test_default_method_is_that_of_single_runs():
    """Also where the first run ended by dop853, as near a loss of rank."""
    model = symgen.build("four_bar")
    states, options = swings(model, (1.0, 0.5, 1.2)), {"t_end": 0.5, "samples": 3, "rtol": 1e-11}
    first = model.simulate(method="dop853", state=states[0], **options)
    for given, name in ((options, "taylor"), ({"method": "dop853", **options}, "dop853")):
        assert compiled_runs(model, first, {}, states, given).chosen.method.name == name
    found = model.simulate_many(states=states, **options)
    same_bits(found, [model.simulate(state=s, method="taylor", **options) for s in states], range(3))


def test_few_runs_by_default_take_no_lanes():
    """Their kernels take longer to compile than the runs take, unless they are those of the method given."""
    model = symgen.build("four_bar")
    states, options = swings(model, (1.0,)), {"t_end": 0.5, "samples": 3}
    first = model.simulate(state=states[0], **options)
    for count, more, lanes in ((63, {}, False), (64, {}, True), (2, {"method": "taylor"}, True)):
        runs = compiled_runs(model, first, {}, states * count, options | more)
        assert runs.chosen.method.name == "taylor" and (runs.batched is not None) == lanes
