"""Redundant constraints: their number and rows by singular values, in any order of the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from shared.full import full_unless
from shared.redundant_mechanisms import mechanism, shuffled

import symgen
from symgen.errors import SceneError

CASES = Path(__file__).parents[1] / "cases"
#: Random mechanisms by default, and with all tests.
FEW, ALL = 6, 300


def jacobian(model, state):
    """Return the Jacobian of the constraints by central differences, with rows of unit norm."""
    evaluator, still = model.evaluator, np.zeros_like(state.q)
    columns = []
    for k in range(len(state.q)):
        step = np.zeros_like(still)
        step[k] = 1e-5 * np.max(np.abs(state.q))
        errors = [
            evaluator.blocks("constraints", state.t, state.q + side * step, still)["constraints"]
            for side in (1, -1)
        ]
        columns.append((errors[0] - errors[1]) / (2 * step[k]))
    rows = np.array(columns).T
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def rank(rows):
    return int(np.sum(np.linalg.svd(rows, compute_uv=False) > 1e-6))


def in_scene(tables):
    words = ["energy", *(f"{p}.position" for p in sorted(tables["points"]))]
    return symgen.Scene(**tables, analysis={"t_end": "0.2 s", "outputs": words})


@pytest.mark.parametrize("seed", full_unless(lambda seed: seed < FEW, range(ALL)))
def test_rank_and_lost_rows_are_those_of_singular_values_in_every_order(seed):
    tables = mechanism(seed)
    ends = []
    for order in (0, 1):
        scene = in_scene(shuffled(tables, 7 * seed + order))
        model = symgen.build(scene, backend="numpy")
        d, state = model.description, model.initial_state()
        rows = jacobian(model, state)
        assert len(rows) - len(d.redundant) == rank(rows)
        assert rank(np.delete(rows, d.redundant, axis=0)) == len(rows) - len(d.redundant)
        result = model.simulate(samples=3, rtol=1e-11, atol=1e-13)
        places = {p: values["position"] for p, values in result.final.items() if p in d.free}
        rows = jacobian(model, model.state(places, t=0.2))
        assert len(rows) - len(d.redundant) == rank(rows)
        ends.append((d.freedom, result))
    (freedom, first), (other_freedom, second) = ends
    assert freedom == other_freedom
    size = max(np.max(np.abs(first[f"{p}.position"].values)) for p in tables["points"])
    for p in tables["points"]:
        apart = first[f"{p}.position"].values - second[f"{p}.position"].values
        assert np.max(np.abs(apart)) < 1e-8 * size
    assert first.drift.constraint < 1e-12 * size


@pytest.mark.parametrize(
    "seed", full_unless(lambda seed: seed in (4, 6), (*range(0, 60, 6), *range(4, 60, 6)))
)
def test_forces_in_the_plane_do_not_depend_on_the_order(seed):
    """Also with rods in bodies, whose own length is no constraint on others."""
    tables, found = mechanism(seed), []
    words = [f"{k}.{p}.force" for k, link in tables["links"].items() for p in link["points"]]
    for order in (0, 1):
        scene = symgen.Scene(**shuffled(tables, 7 * seed + order), analysis={"outputs": words})
        found.append(symgen.build(scene, backend="numpy").simulate(1e-3, step=1e-3, samples=2))
    first, second = (np.array([run[w].values[0] for w in words]) for run in found)
    assert np.max(np.abs(first - second)) < 1e-8 * np.max(np.abs(first))


def strut_suspension(order, **analysis):
    """Return the suspension, its upright's points in an order, with a slow jack."""
    scene = symgen.load_scene(CASES / "strut_suspension.toml", set={"parameters.T": "1e5 s"})
    tables = scene.model_dump(exclude_none=True)
    tables["links"]["upright"]["points"] = order.split()
    tables["analysis"] = {"outputs": ["jack.tension", "potential_energy", "W.position"], **analysis}
    return symgen.Scene(**tables)


@pytest.mark.parametrize("order", ["LB TO W N K K2", "K K2 LB TO W N", "N K2 W K TO LB"])
def test_a_rod_in_a_body_is_no_constraint_of_its_own(order):
    """The force of a slow jack is the slope of the potential energy by its length."""
    times = np.array([0.1, 0.1001, 0.1002]) * 1e5
    model = symgen.build(strut_suspension(order))
    assert model.redundant == ()
    result = model.simulate(2e4, t_eval=times, rtol=1e-10, atol=1e-12)
    length = 0.05 * np.sin(2 * np.pi * times / 1e5)
    slope = np.gradient(result["potential_energy"].values, length, edge_order=2)
    assert result["jack.tension"].values == pytest.approx(-slope, rel=1e-5)


def test_a_rod_in_a_body_has_no_tension():
    with pytest.raises(SceneError, match="strut lies between points of one body") as caught:
        symgen.build(strut_suspension("LB TO W N K K2", outputs=["strut.tension"]))
    assert caught.value.where == "analysis.outputs.0"


def test_a_universal_joint_of_three_bodies():
    """The ratio of the speeds is cos b/(1 - (sin b cos a)^2), a from the plane of the shafts to the fork."""
    words = ["shaft_in.angular_velocity", "shaft_out.angular_velocity", "Y1.position", "H1.reaction"]
    model = symgen.build(CASES / "universal_joint.toml", backend="numpy", set={"analysis.outputs": words})
    result = model.simulate(samples=8, rtol=1e-11)
    bend = np.arctan2(90, 300)
    axis = np.array([np.cos(bend), np.sin(bend), 0])
    first = result["shaft_in.angular_velocity"].values[1:, 0]
    second = result["shaft_out.angular_velocity"].values[1:] @ axis
    fork = result["Y1.position"].values[1:]
    along = fork[:, 1] / np.linalg.norm(fork, axis=1)
    assert np.all(first > 0.9)
    assert second / first == pytest.approx(np.cos(bend) / (1 - (np.sin(bend) * along) ** 2), rel=1e-9)


def test_a_joint_on_which_nothing_depends_has_no_force_of_its_own():
    """X2 is where it is since X1 and the bearings are: its force is not determined."""
    with pytest.raises(SceneError, match="held without X2"):
        symgen.build(CASES / "universal_joint.toml", set={"analysis.outputs": ["shaft_out.X2.force"]})


def test_two_universal_joints_and_a_sliding_tube_start_from_every_pose():
    """The torque turns one shaft and the joint on it, whose tube turns in the other: its work is their energy."""
    model = symgen.build(CASES / "telescopic_shaft.toml")
    assert model.redundant == ()
    result = model.simulate(0.05, samples=401, rtol=1e-10)
    first, second = (result[f"shaft_{k}.angular_velocity"].values for k in ("in", "out"))
    work = cumulative_simpson(-9 * second[:, 0], x=result["time"].values, initial=0)
    assert work[-1] > 10
    assert result["energy"].values == pytest.approx(work, rel=1e-6, abs=1e-6)
    assert np.max(np.abs(first)) < 1e-9


def lift_table(**tables):
    """Return the table on parallel legs of length 0.5 m that a cylinder raises, or another drive."""
    scene = symgen.load_scene(CASES / "lift_table.toml").model_dump(exclude_none=True)
    return symgen.Scene(**{**scene, **tables})


def on_leg(length):
    """Return the place of P, at 0.5 m from A in the origin and at a length from Z, on the side of the drawing."""
    z = np.array([-0.2, 1.4])
    far = np.linalg.norm(z)
    along = (0.25 - length**2 + far**2) / (2 * far)
    axis = z / far
    across = np.array([axis[1], -axis[0]])
    return along * axis + np.sqrt(0.25 - along**2) * across


def test_a_cylinder_drives_a_redundant_linkage():
    result = symgen.build(lift_table()).simulate(samples=5, rtol=1e-11, atol=1e-13)
    for t, r in zip(result["time"].values, result["R.position"].values, strict=True):
        assert r == pytest.approx(on_leg(1.118033988749895 + 0.05 * np.sin(t)) + [2, 0], abs=1e-10)
    assert any("redundant" in note for note in result.notes)


def test_moving_ground_drives_a_redundant_linkage():
    """The upper end of a rod of constant length moves along it."""
    scene = symgen.load_scene(CASES / "lift_table.toml").model_dump(exclude_none=True)
    direction = np.array([0.5, -1.0]) / np.linalg.norm([0.5, -1.0])
    shift = [f"({x:.17g}) * h*sin(t/s)" for x in -direction]
    scene["points"]["Z"]["motion"] = shift
    scene["links"]["cyl"] = {"points": ["Z", "P"], "mass": "0 kg"}
    result = symgen.build(symgen.Scene(**scene)).simulate(samples=5, rtol=1e-11, atol=1e-13)
    for t, r in zip(result["time"].values, result["R.position"].values, strict=True):
        z = np.array([-0.2, 1.4]) - direction * 0.05 * np.sin(t)
        p = r - [2, 0]
        assert np.linalg.norm(p) == pytest.approx(0.5, abs=1e-12)
        assert np.linalg.norm(p - z) == pytest.approx(np.sqrt(1.25), abs=1e-10)
    assert np.ptp(result["R.position"].values[:, 1]) > 0.01


def test_a_redundant_linkage_at_rest_is_refused():
    with pytest.raises(SceneError, match="leave no freedom and are redundant"):
        symgen.build(lift_table(parameters={"n0": "1.118033988749895 m", "h": "0 m", "s": "1 s"}))
