"""Driven linkages followed in compiled steps: closed forms, the curve by arc length, revolutions, singular poses."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from shared.full import full_unless
from shared.linkages import at, circles, four_bar, ground, rod

import symgen
from symgen.runtime.rods import kinematics
from symgen.runtime.rods.following.branch import along_branch

#: Lengths of links that are tuned: crank, coupler, rocker, base.
LENGTHS = ("a", "b", "c", "d")


def tunable_four_bar():
    """A four-bar linkage of tunable lengths, its crank driven at 1 rad/s from the positive x axis."""
    sizes = dict(zip(LENGTHS, (0.1, 0.35, 0.3, 0.4), strict=True))
    return symgen.Scene(
        parameters={
            "w": "1 rad/s",
            **{k: {"value": f"{v} m", "tunable": True} for k, v in sizes.items()},
        },
        points={
            "O": ground(0, 0),
            "A": {"at": ["a", "0 m"]},
            "B": at(0.32, 0.27),
            "C": {"at": ["d", "0 m"], "ground": True},
        },
        links={
            "crank": rod("O", "A", length="a"),
            "coupler": rod("A", "B", length="b"),
            "rocker": rod("C", "B", length="c"),
        },
        drivers=[{"link": "crank", "angle": "w*t"}],
    )


@pytest.fixture(scope="module")
def tuned():
    return symgen.build(tunable_four_bar())


def lengths_of_crank_rockers(count):
    """Return lengths in metres of linkages whose crank makes full revolutions, by Grashof, none near a change point."""
    made, random = [], np.random.default_rng(5)
    while len(made) < count:
        a, b, c, d = random.uniform(0.05, 1.0, 4)
        shortest_and_longest = a + max(b, c, d)
        if a < min(b, c, d) and shortest_and_longest < 0.9 * (a + b + c + d - shortest_and_longest):
            made.append((a, b, c, d))
    return made


@pytest.fixture
def followed(monkeypatch):
    """Record for each analysis whether compiled steps did it."""
    found = []

    def spied(*given):
        branch = along_branch(*given)
        found.append(branch is not None)
        return branch

    monkeypatch.setattr(kinematics, "along_branch", spied)
    return found


@pytest.mark.parametrize("lengths", lengths_of_crank_rockers(40))
def test_crank_rockers_against_two_circles(tuned, followed, lengths):
    """Places by two circles; rates by the loop closure A e^(i th) + B e^(i ph) = D + C e^(i ps), differentiated."""
    a, b, c, d = lengths
    motion = tuned.with_parameters(**dict(zip(LENGTHS, lengths, strict=True))).kinematics(
        0.0, 7.0, samples=50
    )
    assert followed == [True]
    theta = motion.time
    tip, base = a * np.array([np.cos(theta), np.sin(theta)]).T, np.array([d, 0.0])
    place = motion["B.position"].values
    (x, y), (rx, ry) = base - tip[0], place[0] - tip[0]
    side = np.sign(x * ry - y * rx)
    assert place == pytest.approx(circles(tip, base, b, c, side), abs=1e-14)
    phi = np.arctan2(*(place - tip).T[::-1])
    psi = np.arctan2(*(place - base).T[::-1])
    across = np.sin(phi - psi)
    psi_rate = a * np.sin(phi - theta) / (c * across)
    phi_rate = a * np.sin(psi - theta) / (b * across)
    bend = a * np.cos(phi - theta) + b * phi_rate**2 - c * psi_rate**2 * np.cos(phi - psi)
    near = 1e-13 / np.min(np.abs(across)) ** 2
    assert motion["rocker.rate"].values == pytest.approx(psi_rate, abs=near * np.max(np.abs(psi_rate)))
    assert motion["coupler.rate"].values == pytest.approx(phi_rate, abs=near * np.max(np.abs(phi_rate)))
    second = -bend / (c * across)
    assert motion["rocker.acceleration"].values == pytest.approx(
        second, abs=10 * near * np.max(np.abs(second))
    )


@pytest.mark.parametrize("seed", full_unless(lambda seed: seed < 10, range(30)))
def test_it_is_the_curve_by_arc_length(tuned, followed, monkeypatch, seed):
    """Linkages of any lengths, turned as far as they go: dead centres end both ways of following in the same pose."""
    random = np.random.default_rng(seed)
    while True:
        a, b, c, d = random.uniform(0.1, 1.0, 4)
        if abs(b - c) * 1.02 < abs(d - a) < (b + c) / 1.02:
            break
    model = tuned.with_parameters(a=a, b=b, c=c, d=d)
    motion = model.kinematics(0.0, 2 * np.pi, samples=40)
    monkeypatch.setattr(kinematics, "along_branch", lambda *given: None)
    reference = model.kinematics(0.0, 2 * np.pi, samples=40)
    assert followed == [not reference.singular_poses]
    assert motion.time == pytest.approx(reference.time, abs=0) and len(motion.time) == 40
    assert len(motion.singular_poses) == len(reference.singular_poses)
    for name in ("B.position", "coupler.angle", "rocker.angle"):
        assert motion[name].values == pytest.approx(reference[name].values, abs=1e-11)
    fastest = np.max(np.abs(reference["rocker.rate"].values))
    assert motion["rocker.rate"].values == pytest.approx(reference["rocker.rate"].values, abs=1e-10 * fastest)


def test_revolutions_between_two_far_samples_are_counted(followed):
    """Twelve turns of the crank; the rocker swings and comes back."""
    motion = symgen.build(four_bar(0.001, 0.9, 0.8, 1.0, 0.3)).kinematics(0.0, 24 * np.pi, samples=2)
    assert followed == [True]
    assert np.diff(motion["crank.angle"].values) == pytest.approx([24 * np.pi], abs=1e-9)
    assert np.diff(motion["rocker.angle"].values) == pytest.approx([0.0], abs=1e-9)


def test_a_start_inside_the_range_is_followed_both_ways(followed):
    """From a pose at t = 2, to times before and after it."""
    model = symgen.build(four_bar(0.1, 0.35, 0.3, 0.4, 0.5))
    there = model.kinematics(at=[2.0], over="time").final
    state = model.state({p: there[p]["position"] for p in ("A", "B")}, t=2.0)
    motion = model.kinematics(0.0, 5.0, samples=11, state=state)
    assert followed[-1]
    tip = 0.1 * np.array([np.cos(0.5 + motion.time), np.sin(0.5 + motion.time)]).T
    assert motion["B.position"].values == pytest.approx(circles(tip, [0.4, 0.0], 0.35, 0.3), abs=1e-14)


def test_redundant_constraints_are_left_out_and_checked(followed):
    """A crank joined to the ground by two equal parallel couplers' rockers: one length follows from the others."""
    points = {
        "O": ground(0, 0), "A": at(0.0, 0.1), "B": at(0.4, 0.1), "C": ground(0.4, 0),
        "D": at(0.2, 0.1), "E": ground(0.2, 0),
    }  # fmt: skip
    scene = symgen.Scene(
        parameters={"w": "1 rad/s"},
        points=points,
        links={
            "crank": rod("O", "A"),
            "coupler": {
                "points": ["A", "B", "D"],
                "mass": "1 kg",
                "centre": ["0.2 m", "0.1 m"],
                "inertia": "0.1 kg*m^2",
            },
            "rocker": rod("C", "B"),
            "middle": rod("E", "D"),
        },
        drivers=[{"link": "crank", "angle": "pi/2 + w*t"}],
    )
    motion = symgen.build(scene).kinematics(0.0, 1.0, samples=11)
    assert followed == [True]
    turn = np.pi / 2 + motion.time
    circle = 0.1 * np.array([np.cos(turn), np.sin(turn)]).T
    assert motion["D.position"].values == pytest.approx(circle + [0.2, 0.0], abs=1e-14)
    assert motion["B.velocity"].values == pytest.approx(circle[:, ::-1] * [-1.0, 1.0], abs=1e-13)


def test_kernels_in_python_live_as_long_as_what_follows(followed):
    """The backend that is not compiled takes the same steps, and its kernels are kept by what calls them."""
    model = symgen.build(four_bar(0.1, 0.35, 0.3, 0.4, 0.5), backend="numpy")
    gc.collect()
    motion = model.kinematics(0.0, 6.0, samples=7)
    assert followed == [True]
    tip = 0.1 * np.array([np.cos(0.5 + motion.time), np.sin(0.5 + motion.time)]).T
    assert motion["B.position"].values == pytest.approx(circles(tip, [0.4, 0.0], 0.35, 0.3), abs=1e-14)


def test_values_of_a_drive_are_met_at_their_first_times(followed):
    """A swinging drive has each value twice; an angle beyond the range is met at the first equal one."""
    swinging = symgen.build(
        symgen.Scene(
            parameters={"w": "1 rad/s"},
            points={"O": ground(0, 0), "A": at(1, 0)},
            links={"OA": rod("O", "A")},
            drivers=[{"link": "OA", "angle": "sin(w*t)"}],
            analysis={"t_end": "6 s"},
        )
    )
    values = np.array([-0.9, 0.3, 0.0, 0.999, 0.3])
    motion = swinging.kinematics(at=values)
    first = np.where(values >= 0, np.arcsin(values), np.pi - np.arcsin(values))
    assert motion.time == pytest.approx(first, abs=1e-14 / 0.04)
    assert motion["A.position"].values[:, 1] == pytest.approx(np.sin(values), abs=1e-14)
    crank = symgen.build(four_bar(0.1, 0.35, 0.3, 0.4, 0.5))
    met = crank.kinematics(at=[0.6, 0.5 - 2 * np.pi])
    assert met.time == pytest.approx([0.1, 0.0], abs=1e-14)


def test_angles_of_several_revolutions_are_met_in_their_own():
    """phi = b t^2/2: the rate there is sqrt(2 b phi)."""
    model = symgen.build(
        symgen.Scene(
            parameters={"b": "8 rad/s^2"},
            points={"O": ground(0, 0), "A": at(1, 0)},
            links={"OA": rod("O", "A")},
            drivers=[{"link": "OA", "angle": "b*t**2/2"}],
            analysis={"t_end": "3 s"},
        )
    )
    angles = np.array([5 * np.pi + 0.3, np.pi + 0.3, 2 * np.pi])
    assert model.kinematics(at=angles).time == pytest.approx(np.sqrt(angles / 4), abs=1e-14 / 0.04)


@pytest.mark.parametrize(
    ("lengths", "t"),
    [
        ((0.17, 0.332, 0.518, 0.857), 0.9655791066290017),
        ((0.395, 0.413, 0.293, 0.932), 0.6951003265555734),
        ((0.602, 0.427, 0.71, 0.939), 0.024847708427328384),
        ((0.079, 0.444, 0.132, 0.519), 0.9211218971570169),
    ],
)
def test_a_range_up_to_a_dead_centre_begins_with_the_pose_of_its_start(tuned, lengths, t):
    model = tuned.with_parameters(**dict(zip(LENGTHS, lengths, strict=True)))
    state = model.assemblies(at=t)[0]
    motion = model.kinematics(t, t + 3.0, samples=4, state=state)
    assert motion.time[0] == t and motion.dead_centres
    assert not any(low <= t < high for low, high in motion.out_of_reach)
    a, b, c, d = lengths
    tip, (x, y) = a * np.array([np.cos(t), np.sin(t)]), motion["B.position"].values[0]
    assert [np.hypot(x - tip[0], y - tip[1]), np.hypot(x - d, y)] == pytest.approx([b, c], abs=1e-14)


def test_samples_of_a_range_with_dead_centres_are_spread_over_what_is_reached(tuned):
    """As many as for a whole revolution, also of forces; runs in one call keep the samples of the whole range."""
    a, b, c, d = lengths = (0.3, 0.2, 0.25, 0.4)
    model = tuned.with_parameters(**dict(zip(LENGTHS, lengths, strict=True)))
    # coupler and rocker are in line, on both sides of the ground line
    end = np.arccos((a**2 + d**2 - (b + c) ** 2) / (2 * a * d))
    motion = model.kinematics(-6.0, 6.0, samples=40)
    assert [p.t for p in motion.dead_centres][:2] == pytest.approx([-end, end], abs=1e-12)
    assert motion.time == pytest.approx(np.linspace(-end, end, 42)[1:-1], abs=1e-12)
    forces = model.inverse_dynamics(-6.0, 6.0, samples=40)
    assert np.array_equal(forces.times, motion.time)
    several = model.kinematics_many({"a": [a, a]}, start=-6.0, stop=6.0, samples=241, of=["B"])
    inside = np.linspace(-6.0, 6.0, 241)
    assert several["time"].values == pytest.approx(inside[np.abs(inside) < end], abs=0)
    near = model.kinematics(0.0, end / 2, samples=5)
    assert near.time == pytest.approx(np.linspace(0.0, end / 2, 5), abs=0)
