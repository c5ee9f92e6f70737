"""Forces at joints beside bushings, against the balance of each body: they do not depend on the stiffness."""

import numpy as np
import pytest

import symgen

K = {"value": "3000 N/m", "tunable": True}
MOUNTED_ARM = {
    "symgen": 1,
    "parameters": {"k": K},
    "points": {
        "C": {"at": ["0 m", "0 m"], "ground": True},
        "B": {"at": ["0.2 m", "0 m"]},
        "M1": {"at": ["0.2 m", "0 m"]},
        "M2": {"at": ["0.4 m", "0 m"]},
    },
    "links": {
        "b": {"points": ["C", "B"], "mass": "0.8 kg"},
        "blk": {"points": ["M1", "M2"], "mass": "1.2 kg"},
    },
    "gravity": {"acceleration": ["0 m/s^2", "-10 m/s^2"]},
    "bushings": [
        {
            "between": ["B", "M1"],
            "link": "blk",
            "against": "b",
            "stiffness": ["k", "k"],
            "angular_stiffness": "20 N*m/rad",
        }
    ],
    "drivers": [{"link": "b", "angle": "0.3"}],
    "analysis": {
        "outputs": ["C.reaction", "b.B.force", "b.C.force", "b.tension", "b.torque", "blk.M1.force"]
    },
}


@pytest.mark.parametrize("k", [3000.0, 300.0])
def test_an_arm_that_carries_a_mounted_block_in_the_plane(k):
    """The arm carries the weight of the block, 12 N, at the place of the mount."""
    state = symgen.build(symgen.Scene(**MOUNTED_ARM)).with_parameters(k=k).equilibrium()
    forces = {name: state.outputs[name] for name in MOUNTED_ARM["analysis"]["outputs"]}
    assert forces["b.B.force"] == pytest.approx([0.0, -12.0], abs=1e-8)
    assert forces["blk.M1.force"] == pytest.approx([0.0, 12.0], abs=1e-8)
    assert forces["b.C.force"] == pytest.approx([0.0, 20.0], abs=1e-8)
    assert forces["C.reaction"] == pytest.approx([0.0, 20.0], abs=1e-8)
    assert forces["b.tension"] == pytest.approx(-12.0 * np.sin(0.3) - 4.0 * np.sin(0.3), abs=1e-8)


def test_forces_between_two_driven_arms():
    """Force of the mount by its displacement; reactions by the momentum of each arm, of angle p."""
    data = {
        "symgen": 1,
        "points": {
            "C": {"at": ["0 m", "0 m"], "ground": True},
            "B": {"at": ["0.2 m", "0 m"]},
            "G": {"at": ["0.4 m", "0 m"], "ground": True},
            "M1": {"at": ["0.2 m", "0 m"]},
        },
        "links": {
            "b": {"points": ["C", "B"], "mass": "0.8 kg"},
            "c": {"points": ["G", "M1"], "mass": "1.2 kg"},
        },
        "parameters": {"s1": "1 s"},
        "bushings": [
            {"between": ["B", "M1"], "link": "c", "against": "b", "stiffness": ["3 kN/m", "2 kN/m"]}
        ],
        "drivers": [
            {"link": "b", "angle": "0.2*sin(t/s1)"},
            {"link": "c", "angle": "pi + 0.3*sin(t/s1)"},
        ],
        "analysis": {"outputs": ["C.reaction", "G.reaction", "b.B.force", "c.M1.force", "b.tension"]},
    }
    found = symgen.build(symgen.Scene(**data)).inverse_dynamics(at=[1.0], over="time")
    p, q = 0.2 * np.sin(1.0), np.pi + 0.3 * np.sin(1.0)
    e, n = np.array([np.cos(p), np.sin(p)]), np.array([-np.sin(p), np.cos(p)])
    f, m = np.array([np.cos(q), np.sin(q)]), np.array([-np.sin(q), np.cos(q)])
    line = np.array([0.4, 0.0]) + 0.2 * f - 0.2 * e
    push = 3000.0 * (line @ e) * e + 2000.0 * (line @ n) * n  # on b
    rate, slow = 0.2 * np.cos(1.0), 0.3 * np.cos(1.0)
    centre_b = 0.1 * (-0.2 * np.sin(1.0) * n - rate**2 * e)
    centre_c = 0.1 * (-0.3 * np.sin(1.0) * m - slow**2 * f)
    value = lambda name: found.final[name] if name in found.final else found[name].values[-1]  # noqa: E731
    assert value("b.B.force") == pytest.approx(push, abs=1e-9)
    assert value("c.M1.force") == pytest.approx(-push, abs=1e-9)
    assert value("C.reaction") == pytest.approx(0.8 * centre_b - push, abs=1e-9)
    assert value("G.reaction") == pytest.approx(1.2 * centre_c + push, abs=1e-9)


BODY = {"mass": "1.2 kg", "inertia": ["0.01 kg*m^2"] * 3}
SPACE = {
    "symgen": 1,
    "points": {
        "C": {"at": ["0 m", "-0.1 m", "0 m"], "ground": True},
        "D": {"at": ["0 m", "0.1 m", "0 m"], "ground": True},
        "B": {"at": ["0.2 m", "0 m", "0 m"]},
        "M1": {"at": ["0.2 m", "0 m", "0 m"]},
        "M2": {"at": ["0.4 m", "0 m", "0 m"]},
        "M3": {"at": ["0.3 m", "0.1 m", "0 m"]},
    },
    "links": {
        "b": {"points": ["C", "D", "B"], "centre": ["0.1 m", "0 m", "0 m"], **BODY},
        "blk": {"points": ["M1", "M2", "M3"], "centre": ["0.3 m", "0 m", "0 m"], **BODY},
    },
    "bushings": [
        {
            "between": ["B", "M1"],
            "link": "blk",
            "against": "b",
            "stiffness": ["3 kN/m"] * 3,
            "angular_stiffness": ["20 N*m/rad", "30 N*m/rad", "50 N*m/rad"],
            "angular_damping": ["2 N*m*s/rad", "3 N*m*s/rad", "5 N*m*s/rad"],
        }
    ],
    "drivers": [{"link": "b", "angle": "0"}],
    "analysis": {
        "outputs": ["C.reaction", "D.reaction", "b.B.force", "blk.M1.force", "blk.M2.force", "blk.M3.force"]
    },
}


@pytest.mark.parametrize("g", [0.0, 10.0])
def test_a_mounted_block_in_space(g):
    """Only the weights act: on the block at the mount, and on the hinges of the arm."""
    gravity = {"gravity": {"acceleration": ["0 m/s^2", "0 m/s^2", f"{-g} m/s^2"]}}
    of = symgen.build(symgen.Scene(**SPACE | gravity)).equilibrium().outputs
    assert of["blk.M1.force"] == pytest.approx([0.0, 0.0, 1.2 * g], abs=1e-8)
    assert of["b.B.force"] == pytest.approx([0.0, 0.0, -1.2 * g], abs=1e-8)
    assert of["C.reaction"] == pytest.approx([0.0, 0.0, 1.2 * g], abs=1e-8)
    assert of["D.reaction"] == pytest.approx([0.0, 0.0, 1.2 * g], abs=1e-8)
    assert of["blk.M2.force"] == pytest.approx([0.0] * 3, abs=1e-8)


def test_a_block_that_spins_in_its_mount():
    """Dampers of the rotation are couples: the block, whose centre is on its axis, needs no force to spin."""
    scene = SPACE | {"start": {"rates": {"blk": ["2 rad/s", "0 rad/s", "0 rad/s"]}}}
    run = symgen.build(symgen.Scene(**scene)).simulate(0.01, samples=2)
    for name in ("blk.M1.force", "blk.M2.force", "blk.M3.force", "b.B.force"):
        assert np.asarray(run[name])[0] == pytest.approx([0.0] * 3, abs=1e-8), name
    hinge = 2.0 * 2.0 / 0.2  # the torque c w on the arm, over the distance of the points of its hinge [N]
    assert np.asarray(run["C.reaction"])[0] == pytest.approx([0.0, 0.0, hinge], abs=1e-8)
    assert np.asarray(run["D.reaction"])[0] == pytest.approx([0.0, 0.0, -hinge], abs=1e-8)
