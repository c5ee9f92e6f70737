"""Driven linkages in SIMD lanes: bits of single ones, two circles, dead centres, and what they may not change."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from shared.full import full_unless
from shared.linkages import at, ground, stephenson
from shared.variants import crank_rocker_with_lengths, pins

import symgen
from symgen.runtime._kinematics import KinematicLanes
from symgen.runtime._many import Starts
from symgen.runtime._start import StartLanes
from symgen.runtime.kernels.batch import lanes_of
from symgen.runtime.many.dataset import Keep
from symgen.runtime.model.verbs import with_common_axis
from symgen.runtime.rods.following.branch import steps_of
from symgen.runtime.rods.following.groups import groups_of
from symgen.runtime.rods.many.compiled import compiled_runs
from symgen.runtime.rods.many.starts import start_of
from symgen.toolchain import compiler

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

TIMES = np.linspace(0.0, 1.0, 41)


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    return symgen.build(crank_rocker_with_lengths(tmp_path_factory.mktemp("lanes")), backend="c")


def lanes(model):
    constraints = model.constraints()
    motion = model.in_lanes("kinematics")
    width = lanes_of(motion[1], motion[0].name)[0]
    groups = groups_of(constraints.slopes, range(constraints.n), constraints.n)
    return width, KinematicLanes(motion, width, groups, model.in_lanes("forces"))


def singly(model, times):
    """Return states and joint forces of one linkage, as far as it gets, without lanes."""
    constraints, loads, q = model.constraints(), model.analysis("forces"), model.initial_state().q
    steps = steps_of(constraints, q, 0.0, loads)
    states = steps.follow(0.0, q, times)
    times = times[: len(states)]
    motion = np.hstack([states[:, 2], steps.multipliers(times, states)[0]])
    return states, loads.many("joint_forces", times, states[:, 0], states[:, 1], motion)


def dyad():
    return "crank_rocker"


@pytest.mark.parametrize(
    ("flags", "scene"),
    full_unless(
        lambda flags, scene: (flags, scene) in ((None, stephenson), ((), dyad)),
        product((None, (), ("-mavx2",)), (stephenson, dyad)),
    ),
)
def test_lanes_of_any_width_have_the_bits_of_a_single_linkage(scene, flags, monkeypatch):
    if flags is not None and not compiler.has_wide_vectors():
        pytest.skip("the processor has vectors of one width")
    if flags is not None:
        monkeypatch.setitem(compiler.VECTORS, "native", flags)
    model = symgen.build(scene())
    width, found = lanes(model)
    assert width == {None: width, (): 2, ("-mavx2",): 4}[flags]
    q = model.initial_state().q
    runs = width + 1
    states, forces, reached = found.follow(
        0.0,
        np.tile(model.evaluator.parameter_values, (runs, 1)),
        np.tile(q, (runs, 1)),
        np.full(runs, model.constraints().length(q)),
        TIMES,
    )
    alone, loads = singly(model, TIMES)
    for run in range(runs):
        assert reached[run] == len(alone) == len(TIMES)
        assert np.array_equal(states[run], alone) and np.array_equal(forces[run], loads)


def test_a_lane_at_a_dead_centre_ends_where_a_single_linkage_does_and_changes_no_other(tuned):
    """A crank of 0.3 m would carry A to 0.7 m from C, farther than coupler and rocker reach together."""
    lengths = [(0.1, 0.35, 0.3), (0.3, 0.3, 0.25), (0.12, 0.35, 0.3), (0.1, 0.36, 0.31), (0.3, 0.3, 0.22)]
    models = [tuned.with_parameters(a=a, b=b, c=c) for a, b, c in lengths]
    start = [m.initial_state().q for m in models]
    given = np.array([m.evaluator.parameter_values for m in models])
    sizes = np.array([m.constraints().length(q) for m, q in zip(models, start, strict=True)])
    states, _, reached = lanes(tuned)[1].follow(0.0, given, np.array(start), sizes, TIMES)
    for i, model in enumerate(models):
        alone, _ = singly(model, TIMES)
        assert reached[i] == len(alone)
        assert (len(alone) < len(TIMES)) == (i in (1, 4))
        assert np.array_equal(states[i, : len(alone)], alone)


def test_random_variants_with_and_without_dead_centres_are_those_of_single_runs(tuned):
    random = np.random.default_rng(17)
    a, b, c = random.uniform([[0.05], [0.25], [0.25]], [[0.2], [0.4], [0.4]], (3, 10))
    options = {"samples": 31, "of": ["A", "B", "rocker"]}
    found = tuned.kinematics_many({"a": a, "b": b, "c": c}, **options)
    turning = 0
    for i in range(10):
        one = tuned.with_parameters(a=a[i], b=b[i], c=c[i])
        if found["error"].values[i]:
            with pytest.raises(symgen.SymgenError):
                one.kinematics(**options)
            continue
        alone = with_common_axis(one, "kinematics")(**options)
        for v in alone.variables:
            values = found[v.name].values[i]
            assert np.array_equal(values[: len(v.values)], v.values), (i, v.name)
            assert np.all(np.isnan(values[len(v.values) :]))
        assert found["constraint_drift"].values[i] == alone.drift.constraint
        if alone.statistics["singular_poses"]:
            continue
        turning += 1
        _, place = pins(a[i], b[i], c[i], 2 * np.pi * found["time"].values)
        assert found["B.position"].values[i] == pytest.approx(place, abs=1e-13)
    assert turning == 8


def test_torque_in_lanes_does_no_work_over_a_revolution_and_has_the_bits_of_single_runs(tuned):
    """Weight and inertia alone load the linkage: the work of its drive over a revolution is zero."""
    couplers = np.linspace(0.33, 0.37, 9)
    found = tuned.inverse_dynamics_many(
        {"b": couplers}, samples=361, outputs=["crank.torque", "coupler.A.force"]
    )
    torque = found["crank.torque"].values
    assert np.max(np.abs(np.mean(torque[:, :-1], axis=1))) < 1e-12 * np.max(np.abs(torque))
    means = tuned.inverse_dynamics_many({"b": couplers}, samples=19, outputs=["crank.torque"], reduce="mean")
    assert np.max(np.abs(means["crank.torque.mean"].values)) < 1e-3 * np.max(np.abs(torque))
    for i in (0, 4, 8):
        alone = tuned.with_parameters(b=couplers[i]).inverse_dynamics(samples=361)
        for name in ("crank.torque", "coupler.A.force"):
            assert np.array_equal(found[name].values[i], alone[name].values), (i, name)
        assert found["crank.angle"].values == pytest.approx(alone.coordinate.values, abs=0)
        assert found["constraint_drift"].values[i] == alone.drift.constraint


@pytest.mark.parametrize("samples", [31, 4])
def test_extremes_in_lanes_are_the_reductions_of_single_runs(tuned, samples):
    """Of 31 samples most links turn little from one to the next; of 4, their rotations are looked at once more."""
    random = np.random.default_rng(17)
    a, b, c = random.uniform([[0.05], [0.25], [0.25]], [[0.2], [0.4], [0.4]], (3, 10))
    outputs, names = ["crank.torque", "coupler.A.force"], ["peak", "greatest", "least", "range", "final"]
    options = {"outputs": outputs, "samples": samples}
    columns = {"a": a, "b": b, "c": c}
    found = tuned.inverse_dynamics_many(columns, reduce=names, **options)
    for threads in (1, 2):
        assert found.identical(tuned.inverse_dynamics_many(columns, reduce=names, threads=threads, **options))
    magnitudes = {
        "crank.torque": np.abs,
        "coupler.A.force": lambda v: np.sqrt(v[:, 0] ** 2 + v[:, 1] ** 2),
    }
    for i in np.flatnonzero(found["error"].values == ""):
        one = tuned.with_parameters(a=a[i], b=b[i], c=c[i])
        alone = with_common_axis(one, "inverse_dynamics")(samples=samples)
        for name, magnitude in magnitudes.items():
            v = alone[name].values
            extremes = v.max(axis=0), v.min(axis=0), v.max(axis=0) - v.min(axis=0), v[-1]
            for reduction, value in zip(names, (magnitude(v).max(), *extremes), strict=True):
                assert np.array_equal(found[f"{name}.{reduction}"].values[i], value), (i, name, reduction)
        assert found["recorded"].values[i] == len(alone.time)
        assert found["constraint_drift"].values[i] == alone.drift.constraint
    assert sum(map(bool, found["error"].values)) < 5


def test_starts_in_lanes_are_those_of_single_assemblies(tuned):
    """Random lengths, of which some cannot be assembled; a flag stands for the bits of the start of the variant."""
    random = np.random.default_rng(3)
    lengths = random.uniform([0.05, 0.2, 0.2], [0.3, 0.5, 0.5], (21, 3))
    given = np.tile(tuned.evaluator.parameter_values, (21, 1))
    given[:, [[p.name for p in tuned.description.tunable].index(name) for name in "abc"]] = lengths
    library, start = tuned.number_type.kernels(True), start_of(tuned.evaluator)
    width = lanes_of(library, tuned.description.name)[0]
    q, found = StartLanes(start[2], library, width, given.shape[1]).assembled(given)
    regular, alone, sizes = Starts(*start).poses(given)
    assert 10 < found.sum() < 21 and np.array_equal(found.astype(bool), regular)
    assert np.array_equal(q[regular], alone[regular])
    again = Starts(*start_of(tuned.evaluator)).poses(given, (q, found))
    assert all(map(np.array_equal, again, (regular, alone, sizes)))
    with pytest.raises(ValueError, match="expected vectors of 2, 4 or 8 numbers, got 3"):
        StartLanes(start[2], library, 3, given.shape[1])
    with pytest.raises(ValueError, match="expected the kernels of an assembly"):
        StartLanes(start[2], tuned.in_lanes("forces")[1], width, given.shape[1])


def test_links_that_turn_far_between_nodes_leave_the_extremes(tuned):
    columns = {"b": np.linspace(0.341, 0.359, 4)}
    for samples, steady in ((31, True), (4, False)):
        first = tuned.with_parameters(b=0.341).inverse_dynamics(samples=samples)
        runs = compiled_runs(tuned, first, columns, None, {"samples": samples})
        _, q, lengths = Starts(*start_of(tuned.evaluator)).poses(runs.parameters)
        rows, kept = np.arange(4), [None] * 4
        left = runs.by_extremes(runs.parameters, q, lengths, rows, Keep(["crank.torque"], "peak"), kept, 0)
        assert left.tolist() == ([] if steady else rows.tolist())
        assert all((k is not None) == steady for k in kept)


def test_regular_variants_go_through_lanes_and_outputs_of_elements_do_not(tuned):
    columns = {"b": np.linspace(0.34, 0.36, 5)}
    for analysis, outputs, in_lanes in (
        ("kinematics", None, True),
        ("inverse_dynamics", ["crank.torque"], True),
        ("inverse_dynamics", ["O.reaction"], False),
    ):
        first = getattr(tuned.with_parameters(b=0.34), analysis)(samples=5)
        runs = compiled_runs(tuned, first, columns, None, {"samples": 5})
        kept = runs(0, 5, Keep(outputs, None))
        assert [k is not None for k in kept] == [in_lanes and b != 0.35 for b in columns["b"]]


def test_runs_from_states_before_and_behind_the_range_have_the_bits_of_single_ones(tuned):
    begin = tuned.kinematics(at=[0.3], over="time", of=["A", "B"])
    state = tuned.state({p: begin[f"{p}.position"].values[0] for p in ("A", "B")}, t=0.3)
    options = {"start": 0.1, "stop": 0.9, "samples": 17, "of": ["B", "coupler"]}
    found = tuned.kinematics_many(states=[state] * 3, **options)
    alone = tuned.kinematics(state=state, **options)
    for v in alone.variables:
        assert all(np.array_equal(values, v.values) for values in found[v.name].values), v.name


def test_shapes_and_widths_that_do_not_fit_are_refused(tuned):
    motion, q = tuned.in_lanes("kinematics"), np.zeros((1, 4))
    constraints = tuned.constraints()
    groups = groups_of(constraints.slopes, range(constraints.n), constraints.n)
    with pytest.raises(ValueError, match="expected vectors of 2, 4 or 8 numbers, got 3"):
        KinematicLanes(motion, 3, groups)
    with pytest.raises(ValueError, match="expected kernels of forces"):
        KinematicLanes(motion, 2, groups, motion)
    given = tuned.evaluator.parameter_values[None].copy()
    for rows in ((given[:, 1:], q, np.ones(1)), (given, q[:, 1:], np.ones(1)), (given, q, np.ones(2))):
        with pytest.raises(ValueError, match="rows of 3 parameters and of 4 coordinates"):
            lanes(tuned)[1].follow(0.0, *(np.ascontiguousarray(x) for x in rows), TIMES)


def test_a_load_that_is_not_a_number_ends_its_run_alone():
    """A torque k sqrt(1 - t/T) in still links: the root is real up to T."""
    scene = symgen.Scene(
        parameters={"k": "1 N*m", "T": {"value": "2 s", "tunable": True}, "w": "1 rad/s"},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"crank": {"points": ["O", "A"], "mass": "1 kg"}},
        drivers=[{"link": "crank", "angle": "w*t"}],
        torques=[{"link": "crank", "torque": "k*sqrt(1 - t/T)"}],
        analysis={"t_end": "1 s"},
    )
    model, ends = symgen.build(scene, backend="c"), np.array([3.0, 4.0, 0.5, 5.0])
    found = model.inverse_dynamics_many({"T": ends}, samples=9, outputs=["crank.torque"])
    assert [bool(e) for e in found["error"].values] == [False, False, True, False]
    assert "no finite forces" in found["error"].values[2]
    times, torques = (np.delete(found[name].values, 2, axis=0) for name in ("time", "crank.torque"))
    assert torques == pytest.approx(-np.sqrt(1 - times / np.delete(ends, 2)[:, None]), abs=1e-12)
    # Reduced in the lanes, too; also where only times that are not recorded have no number.
    for samples in (9, 2):
        reduced = model.inverse_dynamics_many(
            {"T": ends}, samples=samples, outputs=["crank.torque"], reduce=["peak", "final"]
        )
        assert [bool(e) for e in reduced["error"].values] == [False, False, True, False]
        assert np.isnan(reduced["crank.torque.peak"].values[2])
        assert np.delete(reduced["crank.torque.peak"].values, 2) == pytest.approx([1.0] * 3, abs=1e-12)
