"""What symgen does and says in the hard cases that are shipped as scenes; how well, is in ``study/test_stability``."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from shared.full import full
from shared.oracle import Oracle, relative_error
from shared.shipped import derived
from shared.stability_truths import compound_pendulum, peaucellier_arm

import symgen
from symgen.errors import SceneError, SimulationError
from symgen.runtime.integrate.options import options
from symgen.runtime.integrate.simulate import run
from symgen.scene.loading import read_scene

G = 9.81


def exact(name, state, model):
    """Accelerations and multipliers at a state, from the SymPy matrices at 30 digits."""
    values = {
        "t": np.array([state.t]),
        "q": state.q,
        "u": state.u,
        "p": np.array(list(model.parameters.values())),
        "work": np.zeros(0),
    }
    system = derived(name)
    values["work"] = np.zeros(len(system.group("work").quantities))
    return Oracle(system).solve(values)


def found(model, state):
    solution = model.accelerations(state)
    free = [solution[p] for p in model.description.free]
    return np.concatenate([*free, list(solution.multipliers.values())])


def test_exactly_vertical_rods_in_space():
    """At the vertical, where azimuth is undefined; and a run equal to the same one with its axes permuted."""
    model = symgen.build("vertical_rods")
    state = model.initial_state()
    assert relative_error(found(model, state), exact("vertical_rods", state, model)) < 1e-14
    data = read_scene("vertical_rods").data
    for table in (*data["points"].values(),):
        table["at"] = table["at"][2:] + table["at"][:2]
    data["gravity"]["acceleration"] = ["-9.81 m/s^2", "0 m/s^2", "0 m/s^2"]
    data["start"]["velocities"] = {k: v[2:] + v[:2] for k, v in data["start"]["velocities"].items()}
    turned = symgen.build(symgen.Scene(**data)).simulate(rtol=1e-12)
    result = model.simulate(rtol=1e-12)
    for point in ("A", "B"):
        other = turned[f"{point}.position"].values
        assert np.roll(other, -1, axis=1) == pytest.approx(result[f"{point}.position"].values, abs=1e-9)
    assert result.drift.constraint < 1e-15
    assert result.drift.relative_energy < 1e-11


def test_straight_chain_falls_as_the_exact_tridiagonal_system_says():
    n = 10
    mass = [[Fraction(0)] * n for _ in range(n)]
    weight = [Fraction(-1)] * (n - 1) + [Fraction(-1, 2)]
    for rod in range(n):
        for i, j, m in ((rod - 1, rod - 1, 3), (rod, rod, 3), (rod - 1, rod, 6), (rod, rod - 1, 6)):
            if i >= 0 and j >= 0:
                mass[i][j] += Fraction(1, m)
    fall = sp.Matrix(mass).LUsolve(sp.Matrix(weight))
    model = symgen.build("collinear_chain")
    solution = model.accelerations()
    for i in range(n):
        assert solution[f"P{i + 1}"][1] == pytest.approx(G * float(fall[i]), rel=1e-13)
        assert abs(solution[f"P{i + 1}"][0]) < 1e-12
    assert float(fall[0]) == pytest.approx(-(3 - 3**0.5), abs=1e-6)
    assert model.simulate(rtol=1e-11).drift.relative_energy < 1e-10


@pytest.mark.parametrize(
    ("options", "error"),
    [({"rtol": 1e-12}, 2e-9), ({"method": "taylor", "rtol": 1e-12}, 2e-9), ({"step": 1e-3}, 5e-6)],
)
@pytest.mark.parametrize("phase", range(4))
def test_parallelogram_stays_on_its_branch(phase, options, error):
    """Fourteen and more passages of the collinear state, where an anti-parallelogram branches off."""
    angle = np.arctan2(0.8, 0.6) + phase * np.pi / 2
    model = symgen.build("parallelogram")
    tip = np.array([np.cos(angle), np.sin(angle)])
    speed = 10 * np.array([-tip[1], tip[0]])
    begin = model.state({"B": tip, "C": tip + [3, 0]}, {"B": speed, "C": speed})
    result = model.simulate(state=begin, samples=51, **options)
    expected = compound_pendulum(result.time, angle, 10.0, 0.5 + 0.5 + 3, 1 / 3 + 1 / 3 + 3)
    place = np.stack([np.cos(expected), np.sin(expected)], axis=1)
    assert np.abs(result["B.position"].values - place).max() < error
    assert any("losses of rank" in note for note in result.notes)
    assert int(result.notes[-1].split()[1]) >= 14


@pytest.mark.parametrize(
    "options", [{}, {"rtol": 1e-12}, {"method": "taylor"}, {"step": 1e-3}, {"step": 1e-2}]
)
def test_a_sample_on_the_branching_point_is_moved(options):
    """Driven through the collinear state at a time that is to be recorded: forces are determined beside it only."""
    data = read_scene("parallelogram").data
    data |= {"parameters": {"rate": "1 rad/s"}, "start": {}}
    data["drivers"] = [{"link": "AB", "angle": "0.9 - rate*t"}]
    data["analysis"]["outputs"] = ["C.position", "AB.torque"]
    result = symgen.build(symgen.Scene(**data)).simulate(5.0, **options)
    place = np.stack([3 + np.cos(0.9 - result.time), np.sin(0.9 - result.time)], axis=1)
    assert result["C.position"].values == pytest.approx(place, abs=1e-11)
    weight = (0.5 + 0.5 + 3) * G * np.cos(0.9 - result.time)
    # Forces err by rounding over the cube of the angle from the collinear state, 7e-4 at the moved sample.
    assert result["AB.torque"].values == pytest.approx(weight, abs=5e-5)
    assert np.all(np.diff(result.time) > 0)
    assert 0 < abs(result.time[36] - 0.9) < 0.01
    assert "1 sample moved in time" in result.notes[-1]


def test_a_start_on_the_branching_point_is_refused():
    data = read_scene("parallelogram").data
    data["points"]["B"]["at"], data["points"]["C"]["at"] = ["1 m", "0 m"], ["4 m", "0 m"]
    with pytest.raises(SceneError, match=r"3 constraints of rank 2 there, and of a higher one nearby"):
        symgen.build(symgen.Scene(**data))


def test_peaucellier_through_its_limit():
    """B and D pass through each other, and the crank turns back: the smooth branch, known independently.

    Errors are of rounding over the distance of the nearest step from the limit: up to 2e-9 over tolerances from 1e-9
    to 1e-13, about half of them below 2e-11. The bounds are those of the stability suite.
    """
    model = symgen.build("peaucellier_limit")
    tolerances = 10 ** -np.arange(11.5, 12.55, 0.1)
    series, explicit = ([{"method": m, "rtol": x} for x in tolerances] for m in ("taylor", "dop853"))
    for runs, error in ((series, 2e-11), (explicit, 2e-11), ([{"step": 1e-4, "method": "rk4"}], 6e-11)):
        errors = []
        for given in runs:
            result = model.simulate(samples=81, **given)
            expected = peaucellier_arm(0.4)(result.time)
            apart = [result[f"{point}.position"].values - expected[:, i] for i, point in enumerate("ABCD")]
            errors.append(np.abs(apart).max())
            note = result.notes[0]
            assert "passed 1 loss of rank" in note
            assert float(note.split("t = ")[1].split(" s")[0]) == pytest.approx(0.169936759, abs=1e-8)
        assert np.median(errors) < error and max(errors) < 2e-9


@pytest.mark.parametrize("excess", [0.0, 1e-9, 1e-6])
def test_redundant_crank_with_an_assembly_error(excess):
    """The motion errs by the assembly error, no more; forces of redundant cranks are told as not unique."""
    model = symgen.build("double_four_bar").with_parameters(excess=excess)
    solution = model.accelerations()
    start = np.arctan2(-0.8, 0.6)
    # Cranks of 1 kg with inertia m l^2 / 12 (one: 0.09) about their middle, and a coupler of 2 kg.
    inertia = 2 * (1 / 12 + 1 / 4) + 0.09 + 1 / 4 + 2
    turn = -G * (0.5 * 3 + 2) * np.cos(start) / inertia
    assert solution["B"] == pytest.approx(turn * np.array([0.8, 0.6]), abs=1e-12 + 10 * excess)
    assert set(solution.not_unique) == {"AB", "DC", "GE"}
    result = model.simulate(rtol=1e-12, samples=31)
    expected = compound_pendulum(result.time, start, 0.0, 3.5, inertia)
    place = np.stack([np.cos(expected), np.sin(expected)], axis=1)
    assert np.abs(result["B.position"].values - place).max() < 1e-11 + 5 * excess
    assert "1 of 4 constraints redundant" in result.notes[0]
    assert all(np.all(np.isfinite(v.values)) for v in result.variables)


def test_least_norm_is_the_least():
    """Multipliers solve the same equations as any others, and no self-stress is left in them."""
    model = symgen.build("double_four_bar")
    state = model.initial_state()
    solution = model.accelerations(state)
    system = derived("double_four_bar")
    values = {"t": np.zeros(1), "q": state.q, "u": state.u, "p": np.zeros(1), "work": np.zeros(8)}
    mass, jacobian, force, scale = (
        np.array(Oracle(system).matrix(name, values).tolist(), dtype=float)
        for name in ("mass_matrix", "constraint_jacobian", "force", "constraint_scale")
    )
    acceleration = np.concatenate([solution[p] for p in model.description.free])
    needed = force[:, 0] - mass @ acceleration
    least = np.linalg.lstsq((jacobian / scale).T, needed, rcond=1e-10)[0]
    assert np.array(list(solution.multipliers.values())) * scale[:, 0] == pytest.approx(least, abs=1e-11)


def test_an_untold_assembly_error_is_refused():
    data = read_scene("double_four_bar").data
    del data["analysis"]["assembly_tolerance"]
    data["parameters"]["excess"]["value"] = "1e-6 m"
    with pytest.raises(SceneError, match=r"cannot be assembled(.|\n)*assembly_tolerance"):
        symgen.build(symgen.Scene(**data))
    data["analysis"]["assembly_tolerance"] = "1 mm"
    with pytest.raises(SceneError, match=r"too large for a linkage of"):
        symgen.build(symgen.Scene(**data))


@pytest.mark.parametrize("excess", [0.0, 1e-9, 1e-6])
def test_redundant_crank_through_its_collinear_states(excess):
    """Swung all the way round: the motion errs by the assembly error, magnified a little at every passage."""
    model = symgen.build("double_four_bar").with_parameters(excess=excess)
    begin = model.initial_state()
    pose = {k: begin.positions[k] for k in model.description.free}
    fast = 8 * np.array([-begin.positions["B"][1], begin.positions["B"][0]])
    result = model.simulate(state=model.state(pose, dict.fromkeys(pose, fast)), rtol=1e-12, samples=31)
    inertia = 2 * (1 / 12 + 1 / 4) + 0.09 + 1 / 4 + 2
    expected = compound_pendulum(result.time, np.arctan2(-0.8, 0.6), 8.0, 3.5, inertia)
    place = np.stack([np.cos(expected), np.sin(expected)], axis=1)
    assert np.abs(result["B.position"].values - place).max() < 1e-8 + 50 * excess
    assert result.notes[-1].startswith("passed 6 losses of rank")


def test_a_redundant_constraint_that_gets_independent_ends_the_run():
    """A four-bar taken for redundant, as if its contradiction had grown: the cause is named."""
    model = symgen.build("four_bar")
    begin = model.initial_state()
    chosen = options(1.0, None, None, None, None, 11, 1000)
    with pytest.raises(SimulationError, match="redundant at the start is no longer so"):
        run(model.evaluator, 0.0, np.concatenate([begin.q, begin.u]), (2,), chosen, None)


def test_a_redundant_link_that_changes_its_length_ends_the_run():
    """It agrees with the others at the start only: no motion meets it later."""
    data = read_scene("double_four_bar").data
    del data["analysis"]["assembly_tolerance"]
    data["parameters"] |= {"rate": "1 m/s"}
    data["links"]["GE"] = {"points": ["G", "E"], "mass": "0 kg", "length": "crank + rate*t"}
    data["analysis"]["outputs"] = ["B.position"]
    with pytest.raises(SimulationError, match="a redundant constraint contradicts the others by"):
        symgen.build(symgen.Scene(**data)).simulate(1.0)


@pytest.mark.parametrize(
    "options",
    [
        {"rtol": 1e-9},
        {"rtol": 1e-9, "method": "taylor"},
        *({"rtol": rtol, "method": "taylor"} for rtol in (1e-2, 1e-3, 1e-4, 1e-6)),
        {"rtol": 1e-2, "atol": 1e-2},
        {"step": 0.3},
        {"step": 1.0},
    ],
)
def test_every_passage_is_found_however_large_the_steps(options):
    data = read_scene("parallelogram").data
    data |= {"parameters": {"rate": "1 rad/s"}, "start": {}}
    data["drivers"] = [{"link": "AB", "angle": "0.9 - rate*t"}]
    data["analysis"]["outputs"] = ["C.position"]
    model = symgen.build(symgen.Scene(**data))
    notes = model.simulate(62.0, **options).notes
    assert notes[0].startswith("passed 20 losses of rank")
    # Pivots fall with the square of the time to a passage: rounding hides times of 1e-8, twice where it is on both sides.
    if options == {"rtol": 1e-9, "method": "taylor"}:
        times = re.findall(r"(?:at t =|,) (\d[\d.]*)", notes[0])
        assert np.array(times, float) == pytest.approx(0.9 + np.pi * np.arange(6), abs=5e-8)
    (note,) = model.simulate(0.901, samples=2).notes
    found = re.search(r"at t = ([\d.]+) s", note)
    assert found and abs(float(found[1]) - 0.9) < 2e-8


@pytest.mark.parametrize(
    ("angle", "rate", "end"), [(2.86, 1.14, 37.0), (0.28, 2.33, 41.5), (1.63, 2.87, 25.8)]
)
@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7])
def test_every_passage_is_found_from_any_start(angle, rate, end, rtol):
    """Passages are anywhere in the steps, which begin at other angles."""
    data = read_scene("parallelogram").data
    data |= {"parameters": {"rate": f"{rate} rad/s"}, "start": {}}
    data["drivers"] = [{"link": "AB", "angle": f"{angle} - rate*t"}]
    data["analysis"]["outputs"] = ["C.position"]
    count = int((rate * end - angle) // np.pi) + 1
    for method in ("taylor", "dop853"):
        notes = symgen.build(symgen.Scene(**data)).simulate(end, samples=2, method=method, rtol=rtol).notes
        assert any(note.startswith(f"passed {count} losses of rank") for note in notes)


@pytest.mark.parametrize(
    "drawn", [["0 m", "0 m", "-2 m"], full(["2 m", "0 m", "0 m"]), ["2 m", "0.3 m", "0.1 m"]]
)
def test_a_bead_stays_on_its_rod_whatever_the_attitude(drawn):
    """Guided along a rod that turns in space: three small oscillations at rest, known in closed form."""
    half = [f"{float(x.split()[0]) / 2} m" for x in drawn]
    scene = symgen.Scene(
        points={"O": {"at": ["0 m"] * 3, "ground": True}, "A": {"at": drawn}, "P": {"at": half}},
        links={"OA": {"points": ["O", "A"], "mass": "3 kg"}},
        masses=[{"point": "P", "mass": "1 kg"}],
        guides=[{"points": ["P"], "along": "OA"}],
        springs=[{"between": ["O", "P"], "stiffness": "40 N/m", "length": "1 m"}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
        analysis={"outputs": ["A.position", "P.position"], "motion": "space"},
    )
    model = symgen.build(scene)
    place = model.equilibrium().state.positions
    length, down = np.linalg.norm(place["A"]), -place["P"][2]
    swing = np.sqrt((3 * length / 2 + down) * G / (length**2 + down**2))
    rates = [mode.omega for mode in model.modes().modes]
    assert rates == pytest.approx([swing, swing, np.sqrt(40)], rel=1e-9)
    push = {"A": [0.02, 0.3, 0.0], "P": [0.02 * down / length, 0.3 * down / length, 0.3]}
    result = model.simulate(5.0, state=model.state({p: place[p] for p in "AP"}, push), rtol=1e-10)
    rods, beads = (result[f"{p}.position"].values for p in "AP")
    assert np.abs(np.cross(rods, beads)).max() < 1e-12
    assert result.notes == ()


@pytest.mark.parametrize("name", ["mass_ratios", "length_ratios"])
def test_spread_pivots_are_refined(name):
    """Accelerations along the run against 30 digits; tensions against the largest force in the chain."""
    model = symgen.build(name)
    assert "residual" in model.operations
    result = model.simulate(rtol=1e-10, samples=3)
    assert result.drift.relative_energy < 1e-9
    last = model.state(
        {p: result.final[p]["position"] for p in model.description.free},
        {p: result.final[p]["velocity"] for p in model.description.free},
    )
    system, n = derived(name), model.description.coordinates
    for state in (model.initial_state(), last):
        truth, solved = exact(name, state, model), found(model, state)
        assert relative_error(solved[:n], truth[:n]) < 1e-13
        values = {
            "t": np.zeros(1),
            "q": state.q,
            "u": state.u,
            "p": np.zeros(0),
            "work": np.zeros(len(solved)),
        }
        weight = max(abs(float(f)) for f in Oracle(system).matrix("force", values))
        lengths = [float(s) for s in Oracle(system).matrix("constraint_scale", values)]
        tension = max(abs(float(x - y)) * s for x, y, s in zip(solved[n:], truth[n:], lengths, strict=True))
        assert tension < 1e-15 * max(weight, *abs(solved[n:]))
    assert "residual" not in symgen.build("triple_pendulum").operations


def test_far_from_the_origin_ten_digits_are_left():
    near, far = symgen.build("four_bar"), symgen.build("far_origin")
    state = far.initial_state()
    assert relative_error(found(far, state), exact("far_origin", state, far)) < 1e-9
    assert far.accelerations()["A"] == pytest.approx(near.accelerations()["A"], rel=1e-9)
    moved = far.simulate(rtol=1e-9)["B.position"].values - 1e6
    assert moved == pytest.approx(near.simulate(rtol=1e-9)["B.position"].values, abs=1e-7)


@pytest.mark.parametrize("end", [1.0, 2.0, 2.5])
@pytest.mark.parametrize(("method", "rtol"), [("dopri5", 1e-9), ("dop853", 1e-9), ("dop853", 1e-12)])
def test_round_off_of_far_coordinates_does_not_shorten_steps(method, rtol, end):
    """The projection turns rates by the round-off of coordinates, in steps of any length."""
    near, far = symgen.build("four_bar"), symgen.build("far_origin")
    run = far.simulate(end, method=method, rtol=rtol)
    assert run.statistics["steps"] < 3000
    exact = near.simulate(end, method=method, rtol=rtol)["B.position"].values
    assert run["B.position"].values - 1e6 == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize("method", [{"rtol": 1e-9}, {"method": "rattle", "step": 1e-3}], ids=str)
@pytest.mark.parametrize("height", [0.9, 0.7])
def test_a_point_that_starts_at_the_origin(method, height):
    """Round-off goes with lengths and ground, not with the coordinates of the one point that moves."""
    scene = symgen.Scene(
        points={"O": {"at": ["0.3 m", f"{height} m"], "ground": True}, "A": {"at": ["0 m", "0 m"]}},
        links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        analysis={"t_end": "1 s", "outputs": ["A.position"]},
    )
    run = symgen.build(scene).simulate(1.0, **method)
    assert run.drift.constraint < 1e-15


def test_projection_goes_on_until_it_is_there():
    """Steps so long that the first guess is far off: on the constraints all the same."""
    run = symgen.build("triple_pendulum").simulate(2.0, method="rk4", step=0.1)
    assert run.drift.constraint < 1e-14
