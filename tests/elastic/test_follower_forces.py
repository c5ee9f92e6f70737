"""Forces that rotate with sections of elastic links, or with rigid links: closed forms and published loads."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve
from shared.in_numpy import build

import symgen
from symgen.errors import SceneError, SimulationError

#: A cantilever of unit length, bending stiffness and mass per length.
COLUMN = {
    "title": "Column under a follower load",
    "parameters": {"P": {"value": "1 N", "tunable": True}},
    "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "tip": {"at": ["1 m", "0 m"]}},
    "links": {
        "beam": {
            "points": ["O", "tip"],
            "mass_per_length": "1 kg/m",
            "section": {"area": "1 m^2", "second_moment": "1e-6 m^4", "fibre": "0.01 m"},
            "elastic": {"E": "1e6 Pa", "elements": 6},
        }
    },
    "crank": {"link": "beam", "speed": "0 rad/s"},
    "analysis": {"t_end": "1 s"},
}
BECK = COLUMN | {"forces": [{"point": "tip", "force": ["-P", "0 N"], "link": "beam"}]}


def characteristic(load, frequency):
    """Beck's characteristic equation, with solutions w = sum of sin, cos, sinh, cosh and a free tip."""
    root = np.sqrt(load**2 / 4 + frequency**2)
    a, b = np.sqrt(root - load / 2), np.sqrt(root + load / 2)
    trigonometric = 2 * frequency**2 * np.cosh(a) * np.cos(b) + load * frequency * np.sinh(a) * np.sin(b)
    return load**2 + 2 * frequency**2 + trigonometric


def grows(model, load):
    """Whether a mode of the column grows under a load; round-off leaves 1e-11."""
    return model.with_parameters(P=load).modes(moving=True).growth.max() > 1e-4


def critical(model, low, high):
    return brentq(lambda load: 1.0 if grows(model, load) else -1.0, low, high, xtol=1e-7)


def test_column_of_beck():
    """M. Beck, ZAMP 3 (1952) 225: frequencies, and flutter at 20.05 EI/l^2 where the first two meet."""
    model = build(symgen.Scene(**BECK))
    found = 2 * np.pi * model.with_parameters(P=10.0).modes(moving=True).frequencies
    for k, (low, high) in enumerate(((4.0, 6.0), (17.0, 20.0))):
        assert found[k] == pytest.approx(brentq(lambda w: characteristic(10.0, w), low, high), rel=1e-6)

    def double(x):
        rate = (characteristic(x[0], x[1] + 1e-5) - characteristic(x[0], x[1] - 1e-5)) / 2e-5
        return characteristic(*x), rate

    load = fsolve(double, (20.0, 11.0), xtol=1e-12)[0]
    assert load == pytest.approx(20.05, abs=5e-3)
    assert critical(model, 19.0, 21.0) == pytest.approx(load, rel=1e-5)


def test_column_of_leipholz():
    """Tangential load of constant density: flutter at 40.05 EI/l^3 (H. Leipholz, Stability of Elastic Systems)."""
    load = {"link": "beam", "force": ["-P", "0 N/m"], "axes": "section"}
    parameters = {"P": {"value": "1 N/m", "tunable": True}}
    model = build(symgen.Scene(**COLUMN | {"parameters": parameters, "distributed_forces": [load]}))
    assert critical(model, 35.0, 45.0) == pytest.approx(40.05, abs=6e-3)


def test_a_force_that_keeps_its_direction_buckles_the_column():
    """Euler's load pi^2/4: without rotation of the force the lowest frequency vanishes there."""
    fixed = BECK | {"forces": [{"point": "tip", "force": ["-P", "0 N"]}]}
    model = build(symgen.Scene(**fixed))
    limit = np.pi**2 / 4
    assert not grows(model, limit - 1e-3)
    assert grows(model, limit + 1e-3)


def test_static_deflection_under_a_follower_force():
    """With k^2 = P/(E I), w = A sin kx + B cos kx - A k x - B, no moment and the shear force -P/10 at the tip."""
    load = {"point": "tip", "force": ["-P", "0.1*P"], "link": "beam"}
    model = build(symgen.Scene(**COLUMN | {"forces": [load]}))

    def deflection(load):
        k = np.sqrt(load)
        rows = [[-np.cos(k), np.sin(k)], [-np.sin(k), -np.cos(k)]]
        a, b = np.linalg.solve(rows, [-0.1 * load / k**3, 0.0])
        return a * np.sin(k) + b * np.cos(k) - a * k - b

    for load in (1.0, 6.0):  # above Euler's load, too
        at = model.with_parameters(P=load)
        found = at.quasi_static(samples=2)["tip.displacement"].values[-1, 1]
        assert found == pytest.approx(deflection(load), rel=1e-6)
        slope = at.sensitivity(["tip.displacement"], ["P"]).derivatives[1, 0]
        expected = (deflection(load + 1e-4) - deflection(load - 1e-4)) / 2e-4
        assert slope == pytest.approx(expected, rel=1e-5)


def test_divergence_where_a_quarter_of_the_load_follows():
    """With the part e that follows, the column diverges at cos k = -e/(1 - e)."""
    loads = [
        {"point": "tip", "force": ["-0.75*P", "0 N"]},
        {"point": "tip", "force": ["-0.25*P", "0.01*P"], "link": "beam"},
    ]
    model = build(symgen.Scene(**COLUMN | {"forces": loads}))
    limit = np.arccos(-1 / 3) ** 2
    assert (
        model.with_parameters(P=0.999 * limit).quasi_static(samples=2)["tip.displacement"].values[-1, 1] > 1
    )
    with pytest.raises(SimulationError, match=r"buckle at 0 s.* are 1\.5 times"):
        model.with_parameters(P=1.5 * limit).quasi_static(samples=2)


def test_a_force_that_rotates_with_a_rigid_link():
    """A thrust across a bar about its pivot, F l = I theta'', however far it turns."""
    scene = symgen.Scene(
        title="Thruster",
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.5 m", "0 m"]}},
        links={"bar": {"points": ["O", "A"], "mass": "3 kg"}},
        forces=[{"point": "A", "force": ["7 N", "2 N"], "link": "bar"}],
        analysis={"outputs": ["bar.angle", "O.reaction"]},
    )
    run = build(scene).simulate(1.0, rtol=1e-11)
    assert run["bar.angle"].values[-1] == pytest.approx(0.5 * 2.0 * 0.5 / (3 * 0.5**2 / 3), rel=1e-9)
    # The pull along the bar is carried by the pivot, with the centrifugal force of the bar.
    angle, rate = run["bar.angle"].values[-1], 4.0
    along = run["O.reaction"].values[-1] @ [np.cos(angle), np.sin(angle)]
    assert along == pytest.approx(-7.0 - 3 * 0.25 * rate**2, rel=1e-8)


def test_what_is_refused():
    elsewhere = BECK["points"] | {"X": {"at": ["0.5 m", "0.1 m"], "ground": True}}
    load = [{"point": "X", "force": ["1 N", "0 N"], "link": "beam"}]
    with pytest.raises(SceneError, match="no point of it"):
        build(symgen.Scene(**BECK | {"points": elsewhere, "forces": load}))


@pytest.mark.parametrize("spread", [False, True], ids=["at the tip", "along the beam"])
def test_small_motion_in_large_rotation_is_that_of_linear_theory(spread):
    """A column that a follower load presses and bends a little; energies and powers balance."""
    if spread:
        load = {"distributed_forces": [{"link": "beam", "force": ["-P", "1e-3*P"], "axes": "section"}]}
        unit = "5 N/m"
    else:
        load, unit = {"forces": [{"point": "tip", "force": ["-P", "1e-3*P"], "link": "beam"}]}, "5 N"
    section = {"area": "0.01 m^2", "second_moment": "1e-6 m^4", "fibre": "0.01 m"}
    beam = COLUMN["links"]["beam"] | {"section": section}
    beam["elastic"] = {"E": "1e6 Pa", "elements": 4, "axial": False}
    model = build(symgen.Scene(**COLUMN | load | {"links": {"beam": beam}, "parameters": {"P": unit}}))
    linear = model.simulate(t_end=0.5, samples=6)["tip.displacement"].values[:, 1]
    run = model.large_rotation(elements=3, t_end=0.5, samples=6, rtol=0.05)
    found = run["tip.displacement"].values[:, 1]
    assert np.max(np.abs(found - linear)) < 0.01 * np.max(np.abs(linear))
    assert run.drift.energy < 1e-6 * run.drift.energy_exchanged


@pytest.mark.parametrize("load", [2.0, 6.0])
def test_a_joint_where_a_follower_force_acts_leaves_the_modes(load):
    """A rod of no weight that hangs on the column adds a mode of zero frequency alone."""
    points = COLUMN["points"] | {"M": {"on": "beam", "fraction": 0.5}, "Q": {"at": ["0.5 m", "-0.1 m"]}}
    links = COLUMN["links"] | {"rod": {"points": ["M", "Q"], "mass": "1e-12 kg"}}
    forced = {"forces": [{"point": "M", "force": ["-P", "0 N"], "link": "beam"}]}
    alone = symgen.Scene(**COLUMN | forced | {"points": {k: p for k, p in points.items() if k != "Q"}})
    joined = symgen.Scene(**COLUMN | forced | {"points": points, "links": links})
    expected, found = (
        build(scene).with_parameters(P=load).modes(moving=True).frequencies for scene in (alone, joined)
    )
    assert found[1:4] == pytest.approx(expected[:3], rel=1e-6)
    assert abs(found[0]) < 1e-6


@pytest.mark.parametrize("point", ["A", "M", "B"])
@pytest.mark.parametrize("link", ["coupler", "crank"])
def test_forces_of_a_very_stiff_link_are_those_of_a_rigid_one(point, link):
    """With the load at any joint of the coupler, rotating with it or with the crank."""
    coupler = {"points": ["A", "B"], "mass_per_length": "1 kg/m"}
    section = {"area": "1e-3 m^2", "second_moment": "1e-6 m^4", "fibre": "0.01 m"}
    scene = {
        "parameters": {"w": "1 rad/s"},
        "points": {
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "C": {"at": ["1 m", "0 m"], "ground": True},
            "G": {"at": ["0 m", "-0.9 m"], "ground": True},
            "A": {"at": ["0.2 m", "0 m"]},
            "B": {"at": ["1.1 m", "0.6 m"]},
            "M": {"on": "coupler", "fraction": 0.4},
            "D": {"at": ["0.7 m", "-0.7 m"]},
        },
        "links": {
            "crank": {"points": ["O", "A"], "mass": "0.3 kg"},
            "coupler": coupler,
            "rocker": {"points": ["B", "C"], "mass": "0.5 kg"},
            "strut": {"points": ["M", "D"], "mass": "0.2 kg"},
            "leg": {"points": ["D", "G"], "mass": "0.2 kg"},
        },
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        "forces": [{"point": point, "force": ["7 N", "3 N"], "link": link}],
    }
    elastic = {"coupler": coupler | {"section": section, "elastic": {"E": "1e15 Pa", "elements": 2}}}
    bent = {"links": scene["links"] | elastic, "crank": {"link": "crank", "speed": "1 rad/s"}}
    found = build(symgen.Scene(**scene | bent)).quasi_static(samples=2)
    driven = {"drivers": [{"link": "crank", "angle": "w*t"}]}
    expected = build(symgen.Scene(**scene | driven)).inverse_dynamics(samples=2)
    for at in "AMB":
        name = f"coupler.{at}.force"
        assert found[name].values[0] == pytest.approx(expected[name].values[0], rel=1e-6)
