"""Equilibria in large rotation by elements: the elastica, forces that follow sections, poses of free linkages."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk
from shared.in_numpy import build

import symgen
from symgen.errors import ModelError, SimulationError

LENGTH, E, WIDTH, THICKNESS, RHO = 1.0, 210e9, 0.05, 0.005, 7850.0
BENDING = E * WIDTH * THICKNESS**3 / 12
LINE = RHO * WIDTH * THICKNESS
STRIP = {
    "points": ["O", "tip"],
    "density": f"{RHO} kg/m^3",
    "section": {"width": f"{WIDTH} m", "thickness": f"{THICKNESS} m"},
    "elastic": {"E": f"{E} Pa"},
}
#: Tip of a cantilever under a dead load P across it, by P L^2/EI: down and along, over L (Mattiasson 1981).
ELASTICA = {1: (0.30172, 0.05643), 2: (0.49346, 0.16064), 5: (0.71379, 0.38763), 10: (0.81061, 0.55500)}


def strip(unit="N", **tables):
    """A steel strip, clamped on a shaft at rest, with a load P."""
    scene = {
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "tip": {"at": [f"{LENGTH} m", "0 m"]}},
        "links": {"strip": STRIP},
        "crank": {"link": "strip", "speed": "0 rpm"},
        "parameters": {"P": {"value": f"1 {unit}", "tunable": True}},
        "analysis": {"t_end": "1 s"},
    }
    return build(symgen.Scene(**scene | tables))


def test_elastica():
    """The table has five digits; the error of elements falls with the fourth power of their length."""
    model = strip(forces=[{"point": "tip", "force": ["0 N", "-P"]}])
    errors = {}
    for load, tip in ELASTICA.items():
        for count in (2, 6):
            found = model.with_parameters(P=load * BENDING).equilibrium(elements=count)
            x, y = found.state.positions["tip"]
            errors[count] = np.array([-y, 1 - x]) - tip
            assert found.stability == "stable"
            assert found.residual < 1e-8 * found.scale
            assert found.outputs["strip.torque"] == pytest.approx(load * BENDING * x, rel=1e-9)
        assert np.max(np.abs(errors[6])) < max(np.max(np.abs(errors[2])) / 50, 1e-5)


def tip_of(load, spread):
    """The tip of the elastica under a follower load across it: from its free end, whose axes the load has."""
    force = 0.0 if spread else load

    def along(s, state):
        _, _, angle, moment, fx, fy = state
        c, t = math.cos(angle), math.sin(angle)
        pull = (load * t, -load * c) if spread else (0.0, 0.0)  # per length, on the part behind
        return [c, t, moment / BENDING, fx * t - fy * c, -pull[0], -pull[1]]

    # From the tip inwards: s is counted from it, in its axes, and angles turn with s.
    found = solve_ivp(
        lambda s, y: [-x for x in along(s, y)],
        (0.0, LENGTH),
        [0.0, 0.0, 0.0, 0.0, 0.0, -force],
        rtol=1e-12,
        atol=1e-14,
    )
    x, y, angle, *_ = found.y[:, -1]
    # The root has direction 0 and lies in the origin.
    return np.array([-math.cos(angle) * x - math.sin(angle) * y, math.sin(angle) * x - math.cos(angle) * y])


@pytest.mark.parametrize("spread", [False, True], ids=["at the tip", "along the strip"])
def test_load_across_that_follows_its_section(spread):
    if spread:
        load = {"distributed_forces": [{"link": "strip", "force": ["0 N/m", "-P"], "axes": "section"}]}
        model, size = strip("N/m", **load), 12 * BENDING
    else:
        model = strip(forces=[{"point": "tip", "force": ["0 N", "-P"], "link": "strip"}])
        size = 4 * BENDING
    errors = []
    for count in (3, 9):
        found = model.with_parameters(P=size).equilibrium(elements=count)
        errors.append(np.max(np.abs(found.state.positions["tip"] - tip_of(size, spread))))
    stretched = size / (E * WIDTH * THICKNESS)  # the elastica does not stretch
    assert errors[1] < errors[0] / 60 + stretched


@pytest.mark.parametrize("part", [5.7, 8.6, 14.3])
def test_following_load_beyond_which_its_parts_have_no_equilibrium_nearby(part):
    """Parts of the residual of the straight strip push it aside from about 5.3 EI/L^2 on."""
    model = strip(forces=[{"point": "tip", "force": ["0 N", "-P"], "link": "strip"}])
    found = model.with_parameters(P=part * BENDING).equilibrium(elements=8)
    assert found.stability == "stable"
    assert found.state.positions["tip"] == pytest.approx(tip_of(part * BENDING, False), abs=2e-4)


@pytest.mark.parametrize(
    "tables, unit, limit",
    [
        ({"forces": [{"point": "tip", "force": ["-P", "0 N"], "link": "strip"}]}, "N", 20.0509),
        (
            {"distributed_forces": [{"link": "strip", "force": ["-P", "0 N/m"], "axes": "section"}]},
            "N/m",
            40.053,
        ),
    ],
    ids=["Beck", "Leipholz"],
)
def test_flutter_of_columns(tables, unit, limit):
    """M. Beck, ZAMP 3 (1952) 225, and H. Leipholz: the first two frequencies meet under the load."""
    model = strip(unit, **tables)

    def grows(load):
        at = model.with_parameters(P=load * BENDING)
        return 1.0 if at.equilibrium(elements=6, stable=False).stability == "unstable" else -1.0

    assert brentq(grows, 0.9 * limit, 1.1 * limit, xtol=1e-2) == pytest.approx(limit, rel=1e-3)


def test_buckled_column():
    """The elastica: the load of a tip that turned by a is (2 K(sin(a/2))/pi)^2 times Euler's."""
    model = strip(forces=[{"point": "tip", "force": ["-P", "0 N"]}])
    turned = 1.2
    load = ellipk(math.sin(turned / 2) ** 2) ** 2 * BENDING
    model = model.with_parameters(P=load)
    straight = model.equilibrium(elements=6, stable=False)
    assert straight.stability == "unstable"
    assert straight.state.positions["tip"] == pytest.approx([LENGTH, 0.0], abs=1e-3)
    bent = model.equilibrium(elements=6)
    assert bent.stability == "stable"
    # Deflection 2 sin(a/2)/k, with k^2 = P/(E I).
    assert abs(bent.state.positions["tip"][1]) == pytest.approx(
        2 * math.sin(turned / 2) * math.sqrt(BENDING / load), rel=1e-4
    )


def test_modes_about_a_loaded_shape():
    """A compressed column: characteristic equation of a clamped beam under a dead axial load."""
    model = strip(forces=[{"point": "tip", "force": ["-P", "0 N"]}]).with_parameters(P=1.5 * BENDING)
    rest = model.equilibrium(elements=16)
    found = model.modes(rest).frequencies[:2] * 2 * np.pi * math.sqrt(LINE * LENGTH**4 / BENDING)

    def characteristic(w, p=1.5):
        root = math.sqrt(p * p / 4 + w * w)
        a, b = math.sqrt(root - p / 2), math.sqrt(root + p / 2)
        rows = np.array(
            [
                [1.0, 0.0, 1.0, 0.0],
                [0.0, a, 0.0, b],
                [a * a * np.cosh(a), a * a * np.sinh(a), -b * b * np.cos(b), -b * b * np.sin(b)],
                [
                    a * (a * a + p) * np.sinh(a),
                    a * (a * a + p) * np.cosh(a),
                    b * (b * b - p) * np.sin(b),
                    -b * (b * b - p) * np.cos(b),
                ],
            ]
        )
        return np.linalg.det(rows)

    expected = [brentq(characteristic, *range_) for range_ in ((0.5, 3.4), (15.0, 22.1))]
    assert found == pytest.approx(expected, rel=1e-3)


def test_free_strip_hangs():
    """A strip on a pin, drawn across gravity: it hangs, and swings as a chain with little stiffness."""
    scene = {
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "tip": {"at": [f"{LENGTH} m", "0 m"]}},
        "links": {"strip": STRIP},
        "crank": {"link": "strip", "mode": "free", "speed": "0 rpm"},
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
    }
    rest = (model := build(symgen.Scene(**scene))).equilibrium(elements=4)
    stretched = RHO * 9.81 * LENGTH**2 / (2 * E)
    assert rest.state.positions["tip"] == pytest.approx([0.0, -LENGTH - stretched], abs=1e-9)
    assert rest.stability == "stable"
    assert rest.outputs["strip.O.force"] == pytest.approx([0.0, 9.81 * LINE * LENGTH], abs=1e-6)
    swings = model.modes(rest).frequencies[0]
    assert swings == pytest.approx(math.sqrt(1.5 * 9.81 / LENGTH) / (2 * np.pi), rel=1e-3)


def test_slopes_of_all_loads():
    """The compliance at the tip about a bent shape, K^-1 of the modes, is what small forces do.

    Under forces that follow sections, lie along the link, depend on its direction, and a couple.
    """
    newton = {"value": "0 N", "tunable": True}
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "tip": {"at": [f"{LENGTH} m", "0 m"]},
        "C": {"on": "strip", "fraction": 0.4},
    }
    model = strip(
        points=points,
        parameters={"X": newton, "Y": newton, "f": "20 N", "q": "8 N/m", "c": "4 N*m", "s": "3 N*m"},
        forces=[
            {"point": "tip", "force": ["X", "Y"]},
            {"point": "tip", "force": ["f", "-1.5*f"], "link": "strip"},
            {"point": "C", "force": ["f*strip.angle", "-f"]},
        ],
        distributed_forces=[
            {"link": "strip", "force": ["q", "-q"], "end": ["0 N/m", "q"], "axes": "section"},
            {"link": "strip", "force": ["0 N/m", "q"], "axes": "link"},
        ],
        torques=[{"link": "strip", "point": "tip", "torque": "-c - s*this.angle"}],
    )
    about = model.equilibrium(elements=3).linearised
    assert np.max(np.abs(about.stiffness - about.stiffness.T)) > 1.0
    tip = about.basis[:2]
    compliance = tip @ np.linalg.solve(about.stiffness, tip.T)
    for k, name in enumerate("XY"):
        low, high = (
            model.with_parameters(**{name: force}).equilibrium(elements=3).state.positions["tip"]
            for force in (-0.01, 0.01)
        )
        assert (high - low) / 0.02 == pytest.approx(compliance[:, k], rel=1e-5, abs=1e-9)


def test_what_is_refused():
    model = strip(forces=[{"point": "tip", "force": ["0 N", "-P"]}])
    with pytest.raises(ModelError, match="from 1 to 1000 elements"):
        model.equilibrium(elements=0)
    with pytest.raises(ModelError, match="expected an Equilibrium|leave moving out"):
        model.modes(model.equilibrium(elements=1), moving=True)
    free = {"link": "strip", "mode": "motor", "speed": "0 rpm", "torque": "5 N*m"}
    with pytest.raises((ModelError, SimulationError), match="no equilibrium"):
        strip(crank=free).equilibrium()
