"""Welds of elastic links in motion: against links without a weld, a blade's series, and closed forms."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from shared.blades import flapping
from shared.in_numpy import build

import symgen

SECTION = {"density": "7850 kg/m^3", "section": {"width": "20 mm", "thickness": "4 mm"}}


def bent(modulus="210 GPa", **more):
    return SECTION | {"elastic": {"E": modulus, "element": "cubic", "elements": 2, **more}}


def rocker(split):
    """A crank-rocker with the coupler joined to the middle of an elastic rocker, whole or of two links."""
    halves = {"lower": {"points": ["C", "B"], **bent()}, "upper": {"points": ["B", "T"], **bent()}}
    whole = {"rocker": {"points": ["C", "T"], **bent(elements=4)}}
    place = {"at": ["0.235 m", "0.16 m"]} if split else {"on": "rocker", "fraction": 0.5}
    return symgen.Scene(
        title="Crank-rocker",
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "C": {"at": ["0.25 m", "0 m"], "ground": True},
            "A": {"at": ["0.06 m", "0 m"]},
            "T": {"at": ["0.22 m", "0.32 m"]},
            "B": place,
        },
        links={
            "crank": {"points": ["O", "A"], "mass": "0.2 kg"},
            "coupler": {"points": ["A", "B"], "mass": "0.3 kg"},
            **(halves if split else whole),
        },
        masses=[{"point": "T", "mass": "0.3 kg"}],
        welds=[{"point": "B", "links": ["lower", "upper"]}] if split else [],
        crank={"link": "crank", "speed": "100 rpm"},
    )


def test_two_welded_links_move_as_the_whole_one():
    options = {"steps": 200, "samples": 21, "revolutions": 0.5}
    welded, whole = (symgen.build(rocker(split)).simulate(**options) for split in (True, False))
    for output in ("T.displacement", "B.displacement", "crank.torque", "strain_energy"):
        expected = whole[output].values
        assert np.abs(welded[output].values - expected).max() < 2e-8 * np.abs(expected).max(), output
    couples = (welded[f"{link}.B.couple"].values for link in ("lower", "upper"))
    assert np.abs(sum(couples)).max() < 1e-6 * np.abs(welded["upper.B.couple"].values).max()


BLADE = {
    "title": "Blade on a rigid hub",
    "parameters": {
        "radius": {"value": "0.5 m", "tunable": True},
        "speed": {"value": "3 rad/s", "tunable": True},
        "length": "1 m",
    },
    "points": {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "root": {"at": ["radius", "0 m"]},
        "tip": {"at": ["radius + length", "0 m"]},
    },
    "links": {
        "hub": {"points": ["O", "root"], "mass": "1 kg"},
        "blade": {
            "points": ["root", "tip"],
            "mass_per_length": "1 kg/m",
            "section": {"area": "1 m^2", "second_moment": "1e-8 m^4", "fibre": "1e-4 m"},
            "elastic": {"E": "1e8 Pa", "elements": 6},
        },
    },
    "welds": [{"point": "root", "links": ["hub", "blade"]}],
    "crank": {"link": "hub", "speed": "speed"},
}


def test_lagging_of_a_blade_on_a_rigid_hub():
    """In the plane of rotation the squares of the frequencies are those of flapping less that of the speed."""
    model = build(symgen.Scene(**BLADE))
    for radius, speed in ((0.5, 3.0), (1.0, 6.0)):
        modes = model.with_parameters(radius=radius, speed=speed).modes(moving=True)
        for near, found in zip((4.0 + speed, 22.0 + speed), modes.frequencies, strict=False):
            expected = mpmath.sqrt(flapping(speed, radius, near) ** 2 - speed**2) / (2 * math.pi)
            assert found == pytest.approx(float(expected), rel=2e-6)


def arm(modulus):
    """A four-bar whose rocker is elastic, with a tip mass on a bracket welded to the coupler."""
    body = {"points": ["A", "B"], **(bent(modulus) if modulus else SECTION)}
    return symgen.Scene(
        title="Four-bar with a bracket",
        parameters={"E_body": {"value": "2.1e14 Pa", "tunable": True}},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "Q": {"at": ["0.4 m", "0 m"], "ground": True},
            "A": {"at": ["0.1 m", "0 m"]},
            "B": {"at": ["0.3 m", "0.3 m"]},
            "D": {"at": ["0.45 m", "0.4 m"]},
        },
        links={
            "crank": {"points": ["O", "A"], "mass": "0.2 kg"},
            "coupler": body,
            "rocker": {"points": ["Q", "B"], **bent()},
            "bracket": {"points": ["B", "D"], **bent()},
        },
        masses=[{"point": "D", "mass": "0.3 kg"}],
        welds=[{"point": "B", "links": ["coupler", "bracket"]}],
        crank={"link": "crank", "speed": "200 rpm"},
    )


def test_a_rigid_link_is_the_limit_of_stiff_ones():
    model = symgen.build(arm(""))
    rigid, stiff, errors = model.quasi_static(samples=9), symgen.build(arm("E_body")), []
    for modulus in (2.1e14, 2.1e15):
        found = stiff.with_parameters(E_body=modulus).quasi_static(samples=9)
        apart = np.abs(found["D.displacement"].values - rigid["D.displacement"].values)
        errors.append(apart.max() / np.abs(rigid["D.displacement"].values).max())
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.01)
    # Errors of second order in the deflections: 1.6e-9, and 3.6e-8 with rocker and bracket ten times as soft.
    assert model.simulate(rtol=1e-3, samples=61).statistics["power_balance"] < 1e-8


def test_an_open_frame_at_rest():
    """A clamped column c with a beam b welded on top: the tip sinks by P b^2 (b/3 + c)/(EI)."""
    modulus, second, force, c, b = 210e9, 20e-3 * 4e-3**3 / 12, 3.0, 0.8, 0.5
    frame = symgen.Scene(
        title="Open frame",
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["0 m", f"{c!r} m"]},
            "B": {"at": [f"{b!r} m", f"{c!r} m"]},
        },
        links={"column": {"points": ["O", "A"], **bent()}, "beam": {"points": ["A", "B"], **bent()}},
        forces=[{"point": "B", "force": ["0 N", f"{-force!r} N"]}],
        welds=[{"point": "A", "links": ["column", "beam"]}],
        crank={"link": "column", "speed": "0 rpm"},
    )
    found = build(frame).quasi_static(samples=2, geometric_stiffness=False)
    sunk = force * b**2 * (b / 3 + c) / (modulus * second) + force * c / (modulus * 20e-3 * 4e-3)
    assert found["B.displacement"].values[-1][1] == pytest.approx(-sunk, rel=1e-9)
    assert found["B.displacement"].values[-1][0] == pytest.approx(force * b * c**2 / (2 * modulus * second))
    assert found["column.A.couple"].values[-1] == pytest.approx(-force * b)


@pytest.mark.parametrize("welds", [["portal", "arm"], ["arm", "portal"]])
def test_an_arm_on_a_portal_at_rest(welds):
    """The hinges of the portal hold it, and a weld the arm: it sinks as against links in one piece, in any order."""
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "C": {"at": ["0.6 m", "0 m"], "ground": True},
        "A": {"at": ["0 m", "0.4 m"]},
        "D": {"at": ["0.9 m", "0.4 m"]},
    }
    posts = {"left": {"points": ["O", "A"], **bent()}, "right": {"points": ["B", "C"], **bent()}}
    options = {
        "forces": [{"point": "D", "force": ["0 N", "-2 N"]}],
        "crank": {"link": "left", "speed": "0 rpm"},
    }
    at = {"portal": ["left", "beam"], "arm": ["beam", "right", "arm"]}
    split = symgen.Scene(
        title="Portal with an arm",
        points=points | {"B": {"at": ["0.6 m", "0.4 m"]}},
        links=posts | {"beam": {"points": ["A", "B"], **bent()}, "arm": {"points": ["B", "D"], **bent()}},
        welds=[{"point": "A" if name == "portal" else "B", "links": at[name]} for name in welds],
        **options,
    )
    whole = symgen.Scene(
        title="Portal with a long beam",
        points=points | {"B": {"on": "beam", "fraction": 2 / 3}},
        links=posts | {"beam": {"points": ["A", "D"], **bent(elements=6)}},
        welds=[{"point": "A", "links": ["left", "beam"]}, {"point": "B", "links": ["right", "beam"]}],
        **options,
    )
    found, expected = (
        build(scene).quasi_static(samples=2, geometric_stiffness=False)["D.displacement"].values[-1]
        for scene in (split, whole)
    )
    assert found == pytest.approx(expected, rel=1e-7)
