"""Joints in other words: a universal joint as two hinges, a helical joint in a spatial loop, both with forces."""

from __future__ import annotations

import numpy as np
import pytest
from shared.loop_account import account, largest
from shared.loop_scenes import RSSR, deg, driven, m, rccc, rssr_start

EXACT = 1e-12
GRAVITY = (1.0, -2.0, -9.0)
LINKS = {
    "crank": {
        "mass": "2 kg",
        "centre": ["-0.4 m", "0.1 m", "0.05 m"],
        "inertia": [f"{x} kg*m^2" for x in (0.1, 0.3, 0.3)],
    },
    "coupler": {
        "mass": "3 kg",
        "centre": ["-2.4 m", "0.2 m", "-0.1 m"],
        "inertia": [f"{x} kg*m^2" for x in (1.5, 6.0, 7.0, 0.3, -0.2, 0.1)],
    },
    "rocker": {
        "mass": "1.5 kg",
        "centre": ["-1.2 m", "0 m", "0.3 m"],
        "inertia": [f"{x} kg*m^2" for x in (0.4, 1.1, 1.2)],
    },
}


def rusr(*, split):
    """Crank, universal joint, rod, ball, rocker; the universal joint also as two hinges with a massless cross.

    Z(theta) Y(eta) X(alpha) = Z(theta) X(-90 deg) Z(eta) X(90 deg + alpha).
    """
    start = rssr_start()
    rods = {"a": m(RSSR["a2"])}
    if split:
        middle = [
            ("R", "cross", {"theta": "?", "alpha": "-90 deg"}),
            ("R", "coupler", {"theta": "?", "alpha": "90 deg", **rods}),
        ]
        names = {"theta2": "theta2", "eta2": "theta3", "theta3": "theta4", "eta3": "eta4", "alpha3": "alpha4"}
        start = {names.get(k, "theta5"): v for k, v in start.items()}
    else:
        middle = [("U", "coupler", {"theta": "?", "eta": "?", **rods})]
    ground = {"theta": "?", "S": m(RSSR["S4"]), "alpha": deg(RSSR["alpha4"]), "a": m(RSSR["a4"])}
    rows = [
        ("R", "crank", {"theta": "theta1", "a": m(RSSR["a1"])}),
        *middle,
        ("S", "rocker", {"theta": "?", "eta": "?", "alpha": "?", "a": m(RSSR["a3"])}),
        ("R", "ground", ground),
    ]
    links = dict(LINKS)
    if split:
        links["cross"] = {"mass": "0 kg"}
    return driven(rows, start, links=links, gravity=GRAVITY)


@pytest.fixture(scope="module")
def universal():
    return account(rusr(split=False), samples=91)


@pytest.fixture(scope="module")
def hinges():
    return account(rusr(split=True), samples=91)


def test_universal_joint_obeys_the_laws_of_motion(universal):
    universal.everything_holds()


def test_two_hinges_obey_the_laws_of_motion(hinges):
    hinges.everything_holds()


def test_universal_joint_is_two_hinges(universal, hinges):
    same = {
        "theta2": "theta2",
        "eta2": "theta3",
        "theta3": "theta4",
        "eta3": "eta4",
        "alpha3": "alpha4",
        "theta4": "theta5",
    }
    for one, other in same.items():
        for suffix in ("", ".rate", ".acceleration"):
            a, b = universal.si(one + suffix), hinges.si(other + suffix)
            assert largest(a - b) <= EXACT * max(1.0, largest(a))
    drives = [x.si("theta1.drive") for x in (universal, hinges)]
    assert largest(drives[0] - drives[1]) <= EXACT * largest(drives[0])
    # joint 3 of the one is joint 4 of the other, and the wrench through the cross goes through both its hinges
    for rows in ((2, 3), (3, 4), (1, 1), (1, 2)):
        one, other = universal.on_links()[rows[0]], hinges.on_links()[rows[1]]
        for a, b in zip(one, other, strict=True):
            assert largest(a - b) <= EXACT * largest(*one, *other)


def test_universal_joint_turns_the_rod_as_hookes_does(universal):
    """The moment of a massless cross is along the normal of its two axes only."""
    force, moment = universal.on_links()[1]
    ((_, _, k, place),) = universal.motion.axes["theta2"]
    ((_, _, j, _),) = universal.motion.axes["eta2"]
    about = moment - np.cross(place.astype(float), force.astype(float))
    assert largest(np.sum(about * k, axis=-1)) <= EXACT * largest(about)
    assert largest(np.sum(about * j, axis=-1)) <= EXACT * largest(about)
    assert largest(about) > 1.0


def test_helical_joint_in_space():
    """A screw as input of the spatial four-bar: its motion is in test_loops_closed_forms, here its forces."""
    links = dict(zip(("input", "coupler", "output"), LINKS.values(), strict=True))
    screw = account(rccc(0.25, links=links, gravity=GRAVITY), samples=91)
    screw.everything_holds()
    assert screw.open_components() == 0
    assert screw.run.indeterminate == ()
    # turning it takes torque and, by its pitch, axial force
    force, moment = screw.on_links()[0]
    torque = moment[:, 2] + 0.25 * force[:, 2]
    drive = screw.si("theta1.drive")
    assert largest(torque - drive) <= EXACT * largest(drive)
    assert largest(moment[:, 2]) > 1.01 * largest(drive) or largest(force[:, 2]) > 1.0
