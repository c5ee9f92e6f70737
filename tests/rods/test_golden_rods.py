"""Accelerations, multipliers, reactions and trajectories against 30-digit reference numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from shared.golden import reference

import symgen

PEAUCELLIER = (["O", "A", "B", "C", "D", "E"], ["OA", "AB", "BC", "CD", "DE", "BE", "AD"])
CASES = {
    "peaucellier_rest_horizontal": ("peaucellier", *PEAUCELLIER),
    "peaucellier_moving": ("peaucellier_perturbed", *PEAUCELLIER),
    "triple_pendulum_planar": ("triple_pendulum", ["O", "A", "B", "C"], ["OA", "AB", "BC"]),
    "four_bar_pinned_pinned": ("four_bar", ["O", "A", "B", "C"], ["crank", "coupler", "rocker"]),
}


def close(found, expected, tolerance):
    expected = np.array(expected, dtype=float)
    size = np.max(np.abs(expected))
    assert np.max(np.abs(np.asarray(found, dtype=float) - expected)) <= tolerance * size


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("case", CASES)
def test_accelerations_multipliers_and_reactions(case, backend):
    scene, points, links = CASES[case]
    numbers = reference(f"rods_{case}")
    model = symgen.build(scene, backend=backend)
    state = model.state(
        dict(zip(points, np.array(numbers["pos"], dtype=float), strict=True)),
        dict(zip(points, np.array(numbers["vel"], dtype=float), strict=True)),
    )
    found = model.accelerations(state)
    close([found[p] for p in points], numbers["acc"], 1e-12)
    close([found.multipliers[k] for k in links], numbers["lambda_rods"], 1e-12)
    for index, force in numbers["ground_reaction"].items():
        everything = [np.max(np.abs(np.array(f, dtype=float))) for f in numbers["ground_reaction"].values()]
        error = np.max(np.abs(found.reactions[points[int(index)]] - np.array(force, dtype=float)))
        assert error <= 1e-12 * max(everything)


@pytest.mark.parametrize("case", [c for c in CASES if c != "peaucellier_rest_horizontal"])
def test_start_is_assembled_where_the_reference_is(case):
    scene, points, _ = CASES[case]
    numbers = reference(f"rods_{case}")
    state = symgen.build(scene).initial_state()
    close([state.positions[p] for p in points], numbers["pos"], 1e-14)
    close([state.velocities[p] for p in points], numbers["vel"], 1e-13)


#: y of C and crank angle - pi from rest, by order-20 Gauss collocation at 36 digits.
FROM_REST = {
    0.05: (0.0332606450515975, 0.0006652742332682),
    0.25: (0.5278820426353883, 0.0108098363919401),
    0.5: (0.0157961534049672, 0.0003159296373164),
    0.75: (0.4739047293762668, 0.0096595581277512),
    1.0: (0.0630034948608378, 0.0012604868770946),
}


@pytest.fixture(scope="module")
def tight_run():
    return symgen.build("peaucellier").simulate(1.0, rtol=1e-12, atol=1e-14, samples=21)


def test_peaucellier_trajectory(tight_run):
    positions = tight_run["C.position"]
    for t, (_, y) in FROM_REST.items():
        x_c, y_c = positions.sel(time=t, method="nearest", tolerance=1e-12).values
        assert abs(x_c - 0.06) < 1e-14
        assert abs(y_c - y) < 1e-12
        x_a, y_a = tight_run["A.position"].sel(time=t, method="nearest", tolerance=1e-12).values
        angle = np.arctan2(y_a, x_a) % (2 * np.pi) - np.pi
        assert abs(angle - FROM_REST[t][0]) < 1e-11


def test_peaucellier_final_state_and_drift(tight_run):
    assert np.allclose(tight_run.final["C"]["position"], (0.06, 0.0012604868770946), rtol=0, atol=1e-11)
    assert tight_run.drift.constraint < 1e-13
    assert tight_run.drift.energy < 1e-12 * tight_run.drift.energy_exchanged
    # The extremes of the energies are those at the ends of steps, and short ones come near them.
    exchanged = symgen.build("peaucellier").simulate(1.0, step=1e-4).drift.energy_exchanged
    assert exchanged == pytest.approx(4.039793e-4, rel=1e-6)


def test_straight_horizontal_chain_released_from_rest():
    """First joint of a straight uniform chain: a_y/g = -3/2, -9/7, -33/26 for one, two, three rods."""
    for n, ratio in ((1, 3 / 2), (2, 9 / 7), (3, 33 / 26)):
        points = {f"P{i}": {"at": [f"{i} m", "0 m"], "ground": i == 0} for i in range(n + 1)}
        links = {f"L{i}": {"points": [f"P{i}", f"P{i + 1}"], "mass": "1 kg"} for i in range(n)}
        scene = symgen.Scene(points=points, links=links, gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]})
        found = symgen.build(scene).accelerations()
        assert found["P1"][1] == pytest.approx(-9.81 * ratio, rel=1e-13)
        assert abs(found["P1"][0]) < 1e-12


def test_spatial_double_pendulum():
    for case in ("rods_double_pendulum_spatial", "rods_double_pendulum_spatial_exactly_vertical"):
        numbers = reference(case)
        points = {
            f"P{i}": {"at": [f"{x} m" for x in at], "ground": i in numbers["fixed"]}
            for i, at in enumerate(numbers["pos"])
        }
        links = {}
        for k, rod in enumerate(numbers["rods"]):
            m, lc, io, length = (rod[key] for key in ("m", "lc", "Io", "l"))
            links[f"L{k}"] = {
                "points": [f"P{rod['i']}", f"P{rod['j']}"],
                "mass": f"{m} kg",
                "centre": f"{lc}/{length}",
                "inertia": f"{Fraction(io) - Fraction(m) * Fraction(lc) ** 2} * unit",
            }
        gravity = {"acceleration": [f"{g} m/s^2" for g in numbers["gravity"]]}
        scene = symgen.Scene(
            parameters={"unit": {"value": "1 kg*m^2"}},
            points=points,
            links=links,
            gravity=gravity,
            analysis={"motion": "space"},
        )
        model = symgen.build(scene)
        state = model.state(
            {f"P{i}": [float(x) for x in v] for i, v in enumerate(numbers["pos"])},
            {f"P{i}": [float(x) for x in v] for i, v in enumerate(numbers["vel"])},
        )
        found = model.accelerations(state)
        close([found[f"P{i}"] for i in range(len(points))], numbers["acc"], 1e-12)
        close([found.multipliers[k] for k in links], numbers["lambda_rods"], 1e-12)
