"""States of linkages by independent coordinates, against closed forms."""

import math

import numpy as np
import pytest
from shared.in_numpy import build

import symgen
from symgen.errors import ModelError

A, B, C, D = 0.2, 0.5, 0.4, 0.55  # crank, coupler, rocker, ground [m]


def four_bar(**more):
    crank = {"points": ["O", "A"], "length": f"{A} m", "mass": "1 kg"}
    return {
        "points": {
            "O": {"at": [0, 0], "ground": True},
            "A": {"at": ["0.1 m", "0.17 m"]},
            "B": {"at": ["0.5 m", "0.4 m"]},
            "C": {"at": [f"{D} m", 0], "ground": True},
        },
        "links": {
            "crank": crank,
            "coupler": {"points": ["A", "B"], "length": f"{B} m", "mass": "1 kg"},
            "rocker": {"points": ["C", "B"], "length": f"{C} m", "mass": "1 kg"},
        },
    } | more


def rocker(angle):
    """Angle of the rocker by that of the crank: Freudenstein's equation, as a half-angle quadratic."""
    x, y = A * math.cos(angle) - D, A * math.sin(angle)  # from C to A; |C e - (x, y)| = B
    k = (C * C + x * x + y * y - B * B) / (2 * C)
    return math.atan2(y, x) - math.acos(k / math.hypot(x, y))


@pytest.fixture(scope="module")
def linkage():
    return symgen.build(symgen.Scene(**four_bar()))


@pytest.mark.parametrize("angle", [-2.9, -0.4, 1.0, 3.0, 9.0])
def test_a_four_bar_is_placed_at_an_angle_of_its_crank(linkage, angle):
    rate, h = 3.0, 1e-5
    state = linkage.state({"crank.angle": angle}, {"crank.angle": rate})
    at, slope = rocker(angle), (rocker(angle + h) - rocker(angle - h)) / (2 * h)
    tip = np.array([D + C * math.cos(at), C * math.sin(at)])
    assert state.positions["A"] == pytest.approx([A * math.cos(angle), A * math.sin(angle)], abs=1e-14)
    assert state.positions["B"] == pytest.approx(tip, abs=1e-13)
    across = C * np.array([-math.sin(at), math.cos(at)])
    assert state.velocities["B"] == pytest.approx(rate * slope * across, rel=1e-7, abs=1e-9)


def test_a_cart_pole_is_placed_by_a_length_and_an_angle():
    model = symgen.build(
        symgen.Scene(
            points={
                "L": {"at": ["-1 m", 0], "ground": True},
                "R": {"at": ["1 m", 0], "ground": True},
                "C": {"at": [0, 0]},
                "P": {"at": [0, "0.5 m"]},
            },
            links={"rail": {"points": ["L", "R"]}, "pole": {"points": ["C", "P"], "mass": "0.2 kg"}},
            masses=[{"point": "C", "mass": "1 kg"}],
            guides=[{"points": ["C"], "along": "rail"}],
        )
    )
    state = model.state({"pole.angle": 0.3, "C.position.x": 0.4}, {"pole.angle": 2.0})
    assert state.positions["C"] == pytest.approx([0.4, 0], abs=1e-15)
    assert state.positions["P"] == pytest.approx([0.4 + 0.5 * math.cos(0.3), 0.5 * math.sin(0.3)], abs=1e-15)
    assert state.velocities["C"] == pytest.approx([0, 0], abs=1e-15)
    assert state.velocities["P"] == pytest.approx([-math.sin(0.3), math.cos(0.3)], abs=1e-14)


def test_time_moves_the_drives_of_a_state():
    # A double pendulum whose first link is driven by 0.5 + 2 t.
    model = symgen.build(
        symgen.Scene(
            points={
                "O": {"at": [0, 0], "ground": True},
                "A": {"at": ["0.8 m", "0.5 m"]},
                "P": {"at": ["0.8 m", "-0.2 m"]},
            },
            links={
                "arm": {"points": ["O", "A"], "length": "1 m", "mass": "1 kg"},
                "bob": {"points": ["A", "P"], "length": "0.5 m", "mass": "1 kg"},
            },
            parameters={"w": "2 rad/s"},
            drivers=[{"link": "arm", "angle": "0.5 + w*t"}],
        )
    )
    state = model.state({"bob.angle": -1.0}, {"bob.angle": 4.0}, t=0.25)
    e, n = np.array([math.cos(1.0), math.sin(1.0)]), np.array([-math.sin(1.0), math.cos(1.0)])
    f, g = np.array([math.cos(1.0), -math.sin(1.0)]), np.array([math.sin(1.0), math.cos(1.0)])
    assert state.t == 0.25
    assert state.positions["P"] == pytest.approx(e + 0.5 * f, abs=1e-14)
    assert state.velocities["P"] == pytest.approx(2 * n + 0.5 * 4.0 * g, abs=1e-13)


def test_drives_are_followed_over_revolutions():
    # The second freedom of a five-bar stays, and the driven crank turns: the coupler point keeps its side.
    start = math.atan2(0.1, 0.2)
    model = build(
        symgen.Scene(
            points={
                "O": {"at": [0, 0], "ground": True},
                "A": {"at": ["0.2 m", "0.1 m"]},
                "B": {"at": ["0.5 m", "0.6 m"]},
                "D": {"at": ["0.9 m", "0.2 m"]},
                "C": {"at": ["0.8 m", 0], "ground": True},
            },
            links={
                name: {"points": list(ends), "mass": "1 kg"}
                for name, ends in {"crank": "OA", "left": "AB", "right": "DB", "lever": "CD"}.items()
            },
            parameters={"w": "2 rad/s"},
            drivers=[{"link": "crank", "angle": "atan2(0.1, 0.2) + w*t"}],
        )
    )
    angle, length = math.atan2(0.2, 0.1), math.hypot(0.2, 0.1)
    for t in (0.9, 1.6, 2.9, 7.0):
        p = model.state({"lever.angle": angle}, t=t).positions
        turned = start + 2 * t
        assert p["A"] == pytest.approx([length * math.cos(turned), length * math.sin(turned)], abs=1e-13)
        (x, y), (u, v) = p["D"] - p["A"], p["B"] - p["A"]
        assert x * v - y * u > 0


def test_the_rate_of_an_angle_is_given_on_a_moving_pivot():
    # A rod on a pivot at d sin(w t): its tip moves with the pivot, and across the rod by the given rate.
    model = build(
        symgen.Scene(
            points={
                "O": {"at": [0, 0], "ground": True, "motion": ["d*sin(w*t)", 0]},
                "P": {"at": ["0.6 m", "-0.8 m"]},
            },
            links={"rod": {"points": ["O", "P"], "mass": "1 kg"}},
            parameters={"d": "0.1 m", "w": "3 rad/s"},
        )
    )
    state = model.state({"rod.angle": 0.3}, {"rod.angle": 2.0}, t=0.2)
    along, across = np.array([math.cos(0.3), math.sin(0.3)]), np.array([-math.sin(0.3), math.cos(0.3)])
    assert state.positions["P"] == pytest.approx([0.1 * math.sin(0.6), 0] + along, abs=1e-14)
    assert state.velocities["P"] == pytest.approx([0.3 * math.cos(0.6), 0] + 2.0 * across, abs=1e-14)


@pytest.mark.parametrize(
    ("positions", "rates", "text"),
    [
        ({"rocker.angle": 0.0}, {}, "cannot be led from its start to rocker.angle = 0 .*stops near"),
        ({"crank.angle": 1.0, "rocker.angle": 1.0}, {}, "expected 1 independent coordinate "),
        ({"crank.angel": 1.0}, {}, "crank.angle"),
        ({"crank.angle": math.nan}, {}, "expected a finite number"),
        ({"crank.angle": 1.0}, {"rocker.angle": 1.0}, "no position is given"),
        ({"A.position": 1.0}, {}, "A.position.x"),
        ({"O.position.x": 0.0}, {}, "O.position.x do not determine the motion"),
    ],
)
def test_places_that_are_not_reached_or_not_given_are_refused(linkage, positions, rates, text):
    with pytest.raises(ModelError, match=text):
        linkage.state(positions, rates)
