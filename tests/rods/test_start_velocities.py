"""Velocities at the start: those of least kinetic energy, also where the ground moves."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shared.full import full
from shared.in_numpy import build

import symgen
from symgen.errors import SceneError
from symgen.runtime.rods.large_start import LARGE, least_velocities


def chain(count: int, dimension: int, rod: dict) -> dict:
    """Rods of 1 m in a row along x, whose ground point starts across them at 1 m/s."""
    zero = ["0 m"] * (dimension - 2)
    names = [f"P{i}" for i in range(count + 1)]
    points = {p: {"at": [f"{i} m", "0 m", *zero]} for i, p in enumerate(names)}
    points["P0"] |= {"ground": True, "motion": ["0 m", "v*t", *zero]}
    return {
        "parameters": {"v": {"value": "1 m/s", "tunable": True}},
        "points": points,
        "links": {f"rod{i}": {"points": names[i : i + 2]} | rod for i in range(count)},
        "gravity": {"acceleration": ["0 m/s^2"] * dimension},
        "analysis": {"outputs": ["kinetic_energy", "P1.velocity"]},
    }


def across(count: int) -> np.ndarray:
    """Velocities of the joints of uniform rods in a row, each (y_i^2 + y_i y_j + y_j^2) m/6 of kinetic energy, y_0 = 1."""
    matrix = 4 * np.eye(count) + np.eye(count, k=1) + np.eye(count, k=-1)
    matrix[-1, -1] = 2
    return np.linalg.solve(matrix, -np.eye(count)[0])


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("count", [1, 3])
def test_rods_on_a_moving_ground_point_start_with_the_least_energy(count, dimension):
    """One rod: its free end starts at minus half the velocity of the ground, with 1/8 J instead of 1/6 J."""
    model = build(symgen.Scene(**chain(count, dimension, {"mass": "1 kg"})))
    velocities = model.initial_state().velocities
    found = np.array([velocities[f"P{i + 1}"] for i in range(count)])
    np.testing.assert_allclose(found[:, 1], across(count), atol=1e-14)
    assert np.max(np.abs(np.delete(found, 1, axis=1))) < 1e-14
    assert across(1) == pytest.approx([-0.5], abs=1e-15)


@pytest.mark.parametrize("dimension", [2, 3])
def test_rates_at_the_start_are_those_on_the_moving_ground(dimension):
    """The velocity of the ground adds to those of the rods' ends, which turn at 0.5 rad/s and -0.2 rad/s."""
    rates = {"rod0": 0.5, "rod1": -0.2}
    start = {"rates": {k: f"{w} rad/s" if dimension == 2 else [0, 0, f"{w} rad/s"] for k, w in rates.items()}}
    model = symgen.build(symgen.Scene(**chain(2, dimension, {"mass": "1 kg"}), start=start))
    velocities = model.initial_state().velocities
    found = np.array([velocities["P1"], velocities["P2"]])
    np.testing.assert_allclose(found[:, 1], [1.5, 1.3], atol=1e-14)
    assert np.max(np.abs(np.delete(found, 1, axis=1))) < 1e-14
    speeds = np.array([-1.0, 0.0, 2.0])
    runs = model.simulate_many(parameters={"v": speeds}, t_end=0.01, samples=2)
    np.testing.assert_allclose(runs["P1.velocity"][:, 0, 1], speeds + 0.5, atol=1e-13)


def test_velocities_at_the_start_of_points_on_links_on_the_moving_ground():
    """Of the middle of a rod, one end of which moves at the velocity of the ground, 1 m/s."""
    data = chain(1, 2, {"mass": "1 kg"})
    data["points"]["M"] = {"on": "rod0", "fraction": 0.5}
    start = {"velocities": {"M": ["0 m/s", "2 m/s"]}}
    velocities = symgen.build(symgen.Scene(**data, start=start)).initial_state().velocities
    np.testing.assert_allclose(velocities["P1"], [0, 3], atol=1e-14)


@pytest.mark.parametrize("count", [4, full(LARGE // 2 + 1)])
def test_starts_of_long_chains_on_a_moving_ground_point_have_the_least_energy(count):
    """By sparse matrices, which a start takes above a number of coordinates."""
    evaluator = build(symgen.Scene(**chain(count, 2, {"mass": "1 kg"}))).evaluator
    u = least_velocities(evaluator, np.array(evaluator.description.start[: 2 * count]), ())[0]
    np.testing.assert_allclose(u[1::2], across(count), atol=1e-10)


def test_many_starts_on_a_moving_ground_point_have_the_least_energy():
    model = symgen.build(symgen.Scene(**chain(1, 2, {"mass": "1 kg"})))
    speeds = np.linspace(-2, 3, 7)
    runs = model.simulate_many(parameters={"v": speeds}, t_end=0.01, samples=2)
    np.testing.assert_allclose(runs["P1.velocity"].values[:, 0, 1], -speeds / 2, atol=1e-14)


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_elastic_rod_on_a_moving_ground_point_starts_with_the_least_energy(dimension):
    """As a rigid one: m v^2/8, apart from the rotary inertia of its sections, (h/l)^2."""
    section = {"width": "20 mm", "thickness": "10 mm"}
    elastic = {"E": "210 GPa", "elements": 2}
    if dimension == 3:
        section |= {"width_along": [0, 0, 1]}
        elastic |= {"shear": {"poisson": 0.3}}
    scene = chain(1, dimension, {"density": "7800 kg/m^3", "section": section, "elastic": elastic})
    if dimension == 2:  # a wheel apart from it, since elastic links in the plane need a crank
        scene["points"] |= {"O": {"at": ["5 m", "5 m"], "ground": True}, "A": {"at": ["5 m", "6 m"]}}
        scene["links"]["wheel"] = {"points": ["O", "A"], "mass": "1 kg"}
        scene["crank"] = {"link": "wheel", "mode": "free", "speed": "0 rpm"}
    del scene["analysis"]
    run = build(symgen.Scene(**scene)).simulate(1e-4, samples=2)
    assert run["kinetic_energy"].values[0] == pytest.approx(7800 * 0.02 * 0.01 / 8, rel=1e-3)


def body(turn: np.ndarray, points: list[str]) -> tuple[symgen.Scene, np.ndarray]:
    """A body in space on a moving ground point P, turned; and its angular velocity of least energy."""
    velocity, inertia, mass = np.array([0.08, 0.085, 0.04]), np.diag([0.05, 0.08, 0.07]), 0.5
    drawn = {"P": [0.7, 0.2, -0.4], "Q": [1.2, 0.2, -0.1], "S": [1.0, 0.5, -0.2]}
    centre = np.array([1.0, 0.1, -0.35])

    def text(vector, unit):
        return [f"{float(x)!r} {unit}" for x in vector]

    turned = turn @ inertia @ turn.T
    moments = [*np.diag(turned), turned[0, 1], turned[0, 2], turned[1, 2]]
    places = {p: {"at": text(turn @ drawn[p], "m")} for p in points}
    places["P"] |= {"ground": True, "motion": ["vx*t", "vy*t", "vz*t"]}
    link = {"points": points, "mass": f"{mass} kg", "centre": text(turn @ centre, "m")}
    scene = symgen.Scene(
        parameters=dict(zip(("vx", "vy", "vz"), text(turn @ velocity, "m/s"), strict=True)),
        points=places,
        links={"body": link | {"inertia": text(moments, "kg*m^2")}},
        gravity={"acceleration": ["0 m/s^2"] * 3},
        analysis={"outputs": ["body.angular_velocity"]},
    )
    arm = centre - drawn["P"]
    about = inertia + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return scene, turn @ np.linalg.solve(about, mass * np.cross(velocity, arm))


@pytest.mark.parametrize("points", ["PQ", "QPS", "QSP"])
def test_a_body_in_space_starts_with_the_least_energy_however_it_is_drawn(points):
    """|v + w x r|^2 m/2 + w.J w/2 is least for (J + m (r^2 - r r)) w = m v x r; P is a base point or not."""
    for seed in range(2):
        turn = Rotation.random(random_state=seed).as_matrix() if seed else np.eye(3)
        scene, expected = body(turn, list(points))
        model = build(scene)
        found = model.simulate(1e-3, samples=2)["body.angular_velocity"].values[0]
        np.testing.assert_allclose(found, expected, atol=1e-13)


def pendulum(rate, **more):
    """A rod in space along (0.6, 0, -0.8), whose angular velocity at the start is prescribed."""
    return symgen.Scene(
        points={"O": {"at": [0, 0, 0], "ground": True}, "A": {"at": ["0.3 m", 0, "-0.4 m"]}},
        links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": [0, 0, "-9.81 m/s^2"]},
        start={"rates": {"OA": [f"{w} rad/s" for w in rate]}},
        **more,
    )


@pytest.mark.parametrize("rate", [(0, 0, 2), (1.8, 0, -2.4)])
def test_a_spin_about_the_line_of_a_rod_is_refused_with_the_rate_to_write(rate):
    """It was dropped: a rate along the rod alone gave a start at rest."""
    with pytest.raises(SceneError, match=r"rad/s of the rate are about the line of OA") as caught:
        build(pendulum(rate))
    assert caught.value.where == "start.rates.OA"
    written = json.loads(re.search(r"OA = (\[.*\])", str(caught.value))[1])
    along = np.array([0.6, 0, -0.8])
    rest = [float(x.removesuffix(" rad/s")) for x in written]
    np.testing.assert_allclose(rest, rate - (along @ rate) * along, atol=1e-15)
    found = build(pendulum(rest)).initial_state().velocities["A"]
    np.testing.assert_allclose(found, np.cross(rate, 0.5 * along), atol=1e-14)


def test_the_rate_of_a_rod_with_a_revolute_joint_is_about_its_axis():
    """There it moves on a cone, whose axis is not at right angles to the rod."""
    joints = [{"point": "O", "links": ["OA"], "kind": "revolute", "axis": [0, 0, 1]}]
    found = build(pendulum((0, 0, 2), joints=joints)).initial_state().velocities["A"]
    np.testing.assert_allclose(found, [0, 0.6, 0], atol=1e-14)
    with pytest.raises(SceneError, match=r"OA rate off its axis by 0.18 m/s"):
        build(pendulum((0.6, 0, 1.2), joints=joints))


def test_contradicting_velocities_name_the_constraint_and_the_remedy():
    scene = symgen.Scene(
        points={"O": {"at": [0, 0, 0], "ground": True}, "A": {"at": ["0.3 m", 0, "-0.4 m"]}},
        links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        start={"velocities": {"A": ["1 m/s", "1 m/s", "0 m/s"]}},
    )
    with pytest.raises(
        SceneError, match=r"(?s)A velocity [xz] by .* m/s, the length of link OA by .* rates of links"
    ):
        build(scene)
