"""Equilibria with damping, follower forces and strong dampers: stability and eigenvalues by closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from shared.in_numpy import build
from shared.linkages import GRAVITY, G, at, ground, rod

import symgen
from symgen.errors import ModelError


def pendulum(torque):
    """A uniform rod of 3 kg and 1 m that hangs from a pin, with a torque on it."""
    return build(
        symgen.Scene(
            parameters={"c": {"value": "0.2 N*m*s", "tunable": True}},
            points={"O": ground(0, 0), "P": at(0, -1)},
            links={"rod": {"points": ["O", "P"], "mass": "3 kg"}},
            torques=[{"link": "rod", "torque": torque}],
            gravity=GRAVITY,
        )
    )


def column(load, damping):
    """Ziegler's column: masses 2 m and m on two rods of 1 m, springs of 1 N m, a follower force at its end."""
    joint = {"stiffness": "1 N*m", "damping": "c"}
    return build(
        symgen.Scene(
            parameters={
                "F": {"value": f"{load!r} N", "tunable": True},
                "c": {"value": f"{damping!r} N*m*s", "tunable": True},
            },
            points={"O": ground(0, 0), "A": at(0, 1), "B": at(0, 2)},
            links={
                "a": {"points": ["O", "A"], "mass": "0 kg"},
                "b": {"points": ["A", "B"], "mass": "0 kg"},
            },
            masses=[{"point": "A", "mass": "2 kg"}, {"point": "B", "mass": "1 kg"}],
            torsion_springs=[
                {"link": "a", "angle": "90 deg", **joint},
                {"link": "b", "against": "a", **joint},
            ],
            forces=[{"point": "B", "link": "b", "force": ["-F", "0 N"]}],
        )
    )


def column_poles(load, damping):
    """Roots of det(M s^2 + C s + K) with a positive imaginary part, in the angles of the rods."""
    mass, spring = np.array([[3.0, 1.0], [1.0, 1.0]]), np.array([[2.0, -1.0], [-1.0, 1.0]])
    stiffness = spring + load * np.array([[-1.0, 1.0], [0.0, 0.0]])
    entry = [[[mass[i, j], damping * spring[i, j], stiffness[i, j]] for j in (0, 1)] for i in (0, 1)]
    det = np.polysub(np.polymul(entry[0][0], entry[1][1]), np.polymul(entry[0][1], entry[1][0]))
    roots = np.roots(det)
    return sorted((s for s in roots if s.imag > 0), key=abs)


def test_negative_damping_makes_an_equilibrium_unstable():
    """I s^2 - c s + m g l/2 = 0 with I = m l^2/3."""
    model = pendulum("c*this.rate")
    equilibrium = model.equilibrium()
    modes = model.modes(equilibrium)
    exact = 0.1 + 1j * np.sqrt(1.5 * G - 0.1**2)
    assert equilibrium.stability == "unstable" and not modes.stable
    assert [m.s for m in modes] == pytest.approx([exact], rel=1e-12)
    assert modes.frequencies == pytest.approx([exact.imag / (2 * np.pi)], rel=1e-12)
    swept = model.equilibrium_many({"c": [0.2, -0.2]})
    assert swept["stability"].values.tolist() == ["unstable", "stable"]


@pytest.mark.parametrize(
    ("load", "damping", "stability"),
    [
        (2.08, 0.0, "stable"),  # undamped: flutter from 7/2 - sqrt(2) = 2.0858 k/l on (Ziegler 1952)
        (2.10, 0.0, "unstable"),
        (1.45, 0.001, "stable"),  # little damping, equal at both joints: from 41/28 = 1.4643 k/l on
        (1.48, 0.001, "unstable"),
    ],
)
def test_zieglers_column_loses_stability_at_its_published_loads(load, damping, stability):
    model = column(load, damping)
    equilibrium = model.equilibrium()
    modes = model.modes(equilibrium)
    assert equilibrium.stability == stability and modes.stable == (stability == "stable")
    exact = column_poles(load, damping)
    assert sorted((m.s for m in modes), key=abs) == pytest.approx(exact, rel=1e-7)
    assert modes.frequencies == pytest.approx([s.imag / (2 * np.pi) for s in exact], rel=1e-7)


def test_derivatives_of_frequencies_number_growing_modes_as_modes_do():
    load, damping = 2.4, 0.3
    model = column(load, damping)
    equilibrium = model.equilibrium()
    modes = model.modes(equilibrium)
    assert [m.kind for m in modes] == ["unstable", "oscillation"]
    found = model.sensitivity(["frequencies"], ["F", "c"], at=equilibrium)
    assert found.values == pytest.approx(modes.frequencies, rel=1e-12)
    for column_of, step in enumerate(1e-5 * np.eye(2)):
        ends = [column_poles(load + x, damping + y) for x, y in (step, -step)]
        slope = (np.imag(ends[0]) - np.imag(ends[1])) / (2e-5 * 2 * np.pi)
        assert found.derivatives[:, column_of] == pytest.approx(slope, rel=1e-6, abs=1e-9)
    swept = model.modes_many({"F": [load]})
    assert [swept[f"frequency.{i}"].item() for i in (1, 2)] == pytest.approx(modes.frequencies)


@pytest.mark.parametrize("damping", [1e1, 1e4, 1e7, 1e10])
def test_strong_dampers_slow_a_motion_down_and_do_not_make_it_neutral(damping):
    """m s^2 + c s + k = 0: s = -2 k/(c + sqrt(c^2 - 4 k m)), without cancellation, and k/(m s)."""
    k, m = 3.0, 2.0
    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0), "E": ground(3, 0)},
        links={"rail": {"points": ["O", "E"]}},
        masses=[{"point": "A", "mass": f"{m!r} kg"}],
        springs=[
            {
                "between": ["O", "A"],
                "stiffness": f"{k!r} N/m",
                "length": "1 m",
                "damping": f"{damping!r} N*s/m",
            }
        ],
        guides=[{"points": ["A"], "along": "rail"}],
    )
    model = build(scene)
    equilibrium = model.equilibrium()
    modes = model.modes(equilibrium)
    slow = -2 * k / (damping + np.sqrt(damping**2 - 4 * k * m))
    assert equilibrium.stability == "stable"
    assert [mode.s for mode in modes] == pytest.approx([slow, k / (m * slow)], rel=1e-9)
    assert [mode.kind for mode in modes] == ["decay", "decay"]


def test_a_damped_motion_without_stiffness_is_neutral():
    model = build(
        symgen.Scene(
            parameters={"c": "1e5 N*m*s"},
            points={"O": ground(0, 0), "P": at(1, 0)},
            links={"rod": {"points": ["O", "P"], "mass": "3 kg"}},
            torques=[{"link": "rod", "torque": "-c*this.rate"}],
        )
    )
    equilibrium = model.equilibrium()
    assert equilibrium.stability == "neutral"
    assert [mode.s for mode in model.modes(equilibrium)] == pytest.approx([0, -1e5], rel=1e-9)


def test_a_force_without_damping_at_rest_leaves_that_of_others():
    """Two pendulums, one in a quadratic drag by the root of its squared speed, one with negative damping."""
    drag = "-d*P.v{}*sqrt(P.vx**2 + P.vy**2)"
    tables = {
        "points": {"O": ground(0, 0), "P": at(0, -1), "C": ground(1, 0), "Q": at(1, -1)},
        "links": {"first": rod("O", "P", 3.0), "second": rod("C", "Q", 3.0)},
        "forces": [{"point": "P", "force": [drag.format("x"), drag.format("y")]}],
        "gravity": GRAVITY,
    }
    for torque, stability in (("0.2 N*m*s", "unstable"), ("-0.2 N*m*s", "stable")):
        parameters = {"c": torque, "d": "0.3 N*s^2/m^2"}
        scene = symgen.Scene(
            **tables, parameters=parameters, torques=[{"link": "second", "torque": "c*this.rate"}]
        )
        model = build(scene)
        assert model.equilibrium().stability == stability
        with pytest.raises(ModelError, match="the damping of a force is not defined at rest"):
            model.modes()
