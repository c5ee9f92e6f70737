"""Couples and torsion springs on sections of elastic links: closed forms, an independent assembly, power."""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from shared.full import full
from shared.in_numpy import build

import symgen
from symgen.errors import SceneError

LENGTH, WIDTH, THICKNESS, E, RHO = 0.8, 0.02, 0.01, 210e9, 7850.0
BENDING, LINE = E * WIDTH * THICKNESS**3 / 12, RHO * WIDTH * THICKNESS


def beams(points, links, **more):
    return {
        "title": "Beams with couples",
        "points": points,
        "links": {
            name: {
                "points": ends, "density": f"{RHO} kg/m^3",
                "section": {"width": f"{WIDTH} m", "thickness": f"{THICKNESS} m"},
                "elastic": {"E": f"{E} Pa", "elements": 6},
            }
            for name, ends in links.items()
        },
        "crank": {"link": "beam", "speed": "0 rpm"},
    } | more  # fmt: skip


def cantilever(**more):
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "T": {"at": [f"{LENGTH} m", "0 m"]},
        "C": {"on": "beam", "fraction": 0.6},
    }
    return symgen.Scene(**beams(points, {"beam": ["O", "T"]}, **more))


@pytest.mark.parametrize("point, arm", [("T", LENGTH), ("C", 0.6 * LENGTH)])
def test_moment_on_a_cantilever(point, arm):
    """M over EI up to the section: deflection M a^2/2 there and a slope M a beyond."""
    couple = {"link": "beam", "point": point, "torque": "5 N*m"}
    found = build(cantilever(torques=[couple])).quasi_static(samples=2)
    expected = 5 * arm * (LENGTH - arm / 2) / BENDING
    assert found["T.displacement"].values[-1] == pytest.approx([0, expected], rel=1e-9, abs=1e-15)
    assert found["beam.torque"].values[-1] == pytest.approx(-5, rel=1e-9)


@pytest.mark.parametrize("point, arm", [("T", LENGTH), ("C", 0.6 * LENGTH)])
def test_a_couple_bends_a_cantilever_to_an_arc_in_equilibrium(point, arm):
    """By 1.2 rad, and straight beyond the section."""
    curvature = 1.2 / LENGTH
    couple = {"link": "beam", "point": point, "torque": f"{curvature * BENDING!r} N*m"}
    model = build(cantilever(torques=[couple]))
    turned, beyond = curvature * arm, LENGTH - arm
    exact = np.array([np.sin(turned), 1 - np.cos(turned)]) / curvature
    exact += beyond * np.array([np.cos(turned), np.sin(turned)])
    for elements in (3, 9):
        found = model.equilibrium(elements=elements)
        assert found.state.positions["T"] == pytest.approx(exact, abs=0.01 * LENGTH / elements**4)
        assert found.outputs["beam.torque"] == pytest.approx(-curvature * BENDING, rel=1e-9)


def test_a_couple_between_links_in_equilibrium():
    """A four-bar at rest with a couple so small that linear theory holds, between coupler and rocker."""
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": ["0.1 m", "0.4 m"]},
        "B": {"at": ["0.7 m", "0.5 m"]},
        "D": {"at": ["0.8 m", "0 m"], "ground": True},
    }
    links = {"beam": ["O", "A"], "coupler": ["A", "B"], "rocker": ["D", "B"]}
    couple = {"link": "coupler", "against": "rocker", "point": "B", "torque": "0.2 N*m"}
    model = build(symgen.Scene(**beams(points, links, torques=[couple])))
    rest, small = model.equilibrium(elements=4), model.quasi_static(samples=2)
    for point, drawn in (("A", [0.1, 0.4]), ("B", [0.7, 0.5])):
        expected = small[f"{point}.displacement"].values[-1]
        moved = rest.state.positions[point] - drawn
        assert moved == pytest.approx(expected, abs=0.02 * np.max(np.abs(expected)))


def test_an_abrupt_couple_stresses_the_first_sample_of_coarse_elements():
    """Large rotation takes strains from end moments with inertia, as the page on it says.

    A cubic clamped at O with a couple c on its tip has the accelerations w, th of [[156, -22 L], [-22 L, 4 L^2]]
    (w, th) = (0, c), and so the end moments 1.3 c and c of its inertia. The quadratic Legendre polynomial
    through them is -(1.3 + 1) c/4 in the middle. Fine elements are at rest there.
    """
    couple, half = {"link": "beam", "point": "T", "torque": "5 N*m"}, THICKNESS / 2
    model = build(cantilever(torques=[couple]))
    expected = {1: -2.3 / 4 * 5 * half / BENDING, 16: 0.0}
    for elements, strain in expected.items():
        found = model.large_rotation(elements=elements, t_end=1e-6, samples=2)
        size = 5 * half / BENDING
        assert found["beam.bending_strain"].values[0] == pytest.approx(strain, abs=2e-3 * size)
        assert abs(found["strain_energy"].values[0]) < 1e-20


@pytest.mark.parametrize(
    "more",
    [
        {"torques": [{"link": "beam", "point": "A", "torque": "0 N*m"}]},
        full({"torsion_springs": [{"link": "top", "point": "A", "stiffness": "0 N*m"}]}),
        {"torsion_springs": [{"link": "top", "against": "beam", "point": "A", "stiffness": "50 N*m"}]},
    ],
)
def test_couples_without_work_at_a_weld_with_a_mass_change_nothing(more):
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": ["0 m", "1 m"]},
        "B": {"at": ["1.5 m", "1 m"]},
        "Q": {"at": ["1.5 m", "0 m"], "ground": True},
    }
    links = {"beam": ["O", "A"], "top": ["A", "B"], "right": ["Q", "B"]}
    frame = {"welds": [{"point": "A", "links": ["beam", "top"]}], "masses": [{"point": "A", "mass": "1 kg"}]}
    plain, loaded = (
        build(symgen.Scene(**beams(points, links, **frame, **own))).modes().frequencies for own in ({}, more)
    )
    assert loaded == pytest.approx(plain, rel=1e-9)


@pytest.fixture(scope="module")
def sprung():
    return build(
        cantilever(
            parameters={"k": {"value": "1 N*m", "tunable": True}},
            torsion_springs=[{"link": "beam", "point": "O", "stiffness": "k"}],
            crank={"link": "beam", "speed": "0 rpm", "mode": "free"},
        )
    )


@pytest.mark.parametrize("stiffness", [1.0, 200.0, 1e5])
def test_cantilever_on_a_torsion_spring(sprung, stiffness):
    """k (1 + c ch) = (EI/L) b (s ch - c sh)."""
    model = sprung.with_parameters(k=stiffness)

    def left(b):
        c, s, ch, sh = mpmath.cos(b), mpmath.sin(b), mpmath.cosh(b), mpmath.sinh(b)
        return (stiffness * (1 + c * ch) - BENDING / LENGTH * b * (s * ch - c * sh)) / ch

    grid = np.linspace(0.02, 9, 60)
    values = [left(b) for b in grid]
    roots = [
        mpmath.findroot(left, pair, solver="anderson")
        for i, pair in enumerate(pairwise(grid))
        if values[i] * values[i + 1] < 0
    ]
    expected = [float(b) ** 2 * np.sqrt(BENDING / LINE) / LENGTH**2 / (2 * np.pi) for b in roots[:2]]
    assert model.modes().frequencies[:2] == pytest.approx(expected, rel=1e-6)


def test_sway_of_a_portal_with_springs_at_its_corners():
    """Slope-deflection: the springs are in series with the beam, whose ends rotate alike: 1/(1/k + L/(6 EI))."""
    height, span, stiffness, pull = 1.0, 1.5, 300.0, 40.0
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0 m", f"{height} m"]},
        "B": {"at": [f"{span} m", f"{height} m"]}, "Q": {"at": [f"{span} m", "0 m"], "ground": True},
    }  # fmt: skip
    springs = [
        {"link": k, "against": "top", "point": p, "stiffness": f"{stiffness} N*m", "angle": "pi/2"}
        for k, p in (("beam", "A"), ("right", "B"))
    ]
    links = {"beam": ["O", "A"], "top": ["A", "B"], "right": ["Q", "B"]}
    more = {
        "welds": [{"point": "Q", "links": ["right"]}],
        "forces": [{"point": "A", "force": [f"{pull} N", "0 N"]}],
    }
    scene = beams(points, links, torsion_springs=springs, **more)
    for link in scene["links"].values():
        link["elastic"]["axial"] = False
    found = build(symgen.Scene(**scene)).quasi_static(samples=2, geometric_stiffness=False)
    column, beam = BENDING / height, 1 / (1 / stiffness + span / (6 * BENDING))
    sway = pull * height**2 / (2 * (12 * column - 36 * column**2 / (4 * column + beam)))
    for p in "AB":
        assert found[f"{p}.displacement"].values[-1] == pytest.approx([sway, 0], rel=1e-9, abs=1e-15)


BAD = {
    "no point": ({"torques": [{"link": "beam", "torque": "1 N*m"}]}, "Name the point"),
    "elsewhere": (
        {
            "torques": [{"link": "beam", "point": "P", "torque": "1 N*m"}],
            "points": {
                **beams({}, {})["points"], "O": {"at": ["0 m", "0 m"], "ground": True}, "T": {"at": ["1 m", "0 m"]},
                "P": {"at": ["1 m", "1 m"], "ground": True},
            },
        },
        "no point of beam",
    ),
    "clamped": ({"torsion_springs": [{"link": "beam", "point": "O", "stiffness": "1 N*m"}]}, "is clamped there"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    changes, words = BAD[case]
    with pytest.raises(SceneError, match=words):
        build(
            cantilever(**changes)
            if "points" not in changes
            else symgen.Scene(**beams(changes["points"], {"beam": ["O", "T"]}, torques=changes["torques"]))
        )
