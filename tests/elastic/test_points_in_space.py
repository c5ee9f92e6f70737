"""Points between the ends of elastic links in space, and frames, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shared.in_numpy import build

import symgen
from symgen.errors import SceneError
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.modes import equilibrium

SECTION = {"width": "8 mm", "thickness": "4 mm", "width_along": [0, 0, 1]}
WIDTH, THICKNESS, E, DENSITY = 8e-3, 4e-3, 210e9, 7850.0
LENGTH = 0.4
#: Bending stiffness in the plane of x and y, and along z, of a link along x.
EI_Y, EI_Z = E * WIDTH * THICKNESS**3 / 12, E * THICKNESS * WIDTH**3 / 12
GROUND = {"ground": True}


def at(*place, **keys):
    return {"at": [f"{x} m" for x in place], **keys}


def on(link, fraction):
    return {"on": link, "fraction": fraction}


def elastic(points, density="7850 kg/m^3", elements=4, **more):
    of = {"E": "210 GPa", "elements": elements, "shear": {"poisson": 0.3}}
    return {"points": points, "density": density, "section": SECTION | more, "elastic": of}


def force(point, *components):
    return {"point": point, "force": [f"{x} N" for x in components]}


def displaced(scene, *points):
    """Return the linkage, its static equilibrium, and the displacements of points from the start."""
    linkage = LinkageInSpace(build(scene).rigid)
    found, start = equilibrium(linkage, 0.0), linkage.start()
    places = (linkage.positions(np.zeros(1), x.q[None]) for x in (found, start))
    after, before = ({p: of[p][0] for p in points} for of in places)
    return linkage, found, [after[p] - before[p] for p in points]


def test_a_force_and_a_mass_at_a_point_of_a_cantilever():
    """P a^2 (3 x - a)/(6 EI) beyond the force at a, in both planes; the force on the link there is given."""
    a, up, across = 0.3, 0.02, -0.05
    scene = symgen.Scene(
        points={"A": at(0, 0, 0, **GROUND), "B": at(LENGTH, 0, 0), "C": on("beam", a)},
        links={"beam": elastic(["A", "B"], density="1e-3 kg/m^3")},
        welds=[{"point": "A", "links": ["beam"]}],
        forces=[force("C", 0, up, across)],
    )
    _, _, (end, middle) = displaced(scene, "B", "C")
    arm = a * LENGTH
    for k, (load, stiffness) in ((1, (up, EI_Y)), (2, (across, EI_Z))):
        sag = load * arm**2 / (6 * stiffness)
        assert end[k] == pytest.approx(sag * (3 * LENGTH - arm), rel=1e-6)
        assert middle[k] == pytest.approx(sag * 2 * arm, rel=1e-6)


def test_a_link_over_a_spring_at_its_middle():
    """Under its weight, pinned at its ends: 5 w L^4/(384 EI) - R L^3/(48 EI) = R/k of the spring."""
    span, rate = 2 * LENGTH, 2e3
    scene = symgen.Scene(
        points={
            "A": at(0, 0, 0, **GROUND), "B": at(span, 0, 0), "C": on("beam", 0.5),
            "D": at(LENGTH, 0, -0.5, **GROUND), "E": at(span, 0, -0.5, **GROUND),
        },
        links={"beam": elastic(["A", "B"], elements=8), "post": {"points": ["E", "B"], "mass": "0 kg"}},
        joints=[{"point": "A", "links": ["beam"], "kind": "revolute", "axis": [0, 1, 0]}],
        springs=[{"between": ["D", "C"], "stiffness": f"{rate} N/m", "length": "0.5 m"}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
    )  # fmt: skip
    linkage, found, (sunk,) = displaced(scene, "C")
    q = found.q[None]
    force = linkage.links[0].forces(q, 0 * q, 0 * q)["C"][0, 2]
    load = DENSITY * WIDTH * THICKNESS * 9.81
    expected = 5 * load * span**4 / 384 / (EI_Z / rate + span**3 / 48)
    assert force == pytest.approx(expected, rel=1e-4)
    assert sunk[2] == pytest.approx(-expected / rate, rel=1e-4)


def test_frequencies_with_a_mass_at_a_third():
    """A massless cantilever with a mass M at a: omega^2 = 3 EI/(M a^3) in both planes; slopes -3 f/(2 a)."""
    a, mass = 0.3 * LENGTH, 0.5
    scene = symgen.Scene(
        points={"A": at(0, 0, 0, **GROUND), "B": at(LENGTH, 0, 0), "C": on("beam", "share")},
        parameters={"share": {"value": 0.3, "tunable": True}},
        links={"beam": elastic(["A", "B"], density="1e-2 kg/m^3")},
        welds=[{"point": "A", "links": ["beam"]}],
        masses=[{"point": "C", "mass": f"{mass} kg"}],
    )
    model = build(scene)
    found = model.modes().frequencies[:2]
    expected = [math.sqrt(3 * stiffness / (mass * a**3)) / (2 * math.pi) for stiffness in (EI_Y, EI_Z)]
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    slopes = model.sensitivity(["frequencies"], ["share"], coordinates=["B.position.y", "B.position.z"])
    np.testing.assert_allclose(slopes.derivatives[:2, 0], -1.5 / 0.3 * np.array(expected), rtol=1e-4)


def test_a_branch_welded_to_the_middle_of_a_link():
    """A side load on a branch at the middle of a cantilever twists and bends it: unit loads."""
    arm, load = 0.1, 0.02
    points = {
        "A": at(0, 0, 0, **GROUND),
        "B": at(LENGTH, 0, 0),
        "C": on("beam", 0.5),
        "D": at(LENGTH / 2, arm, 0),
    }
    links = {
        "beam": elastic(["A", "B"], density="1e-3 kg/m^3"),
        "arm": elastic(["C", "D"], density="1e-3 kg/m^3"),
    }
    welds = [{"point": "A", "links": ["beam"]}, {"point": "C", "links": ["beam", "arm"]}]
    scene = symgen.Scene(points=points, links=links, welds=welds, forces=[force("D", 0, 0, load)])
    linkage, _, (end,) = displaced(scene, "D")
    half, torsion = LENGTH / 2, linkage.links[0].section[7]
    expected = load * (half**3 / (3 * EI_Z) + arm**3 / (3 * EI_Z) + arm**2 * half / torsion)
    assert end[2] == pytest.approx(expected, rel=1e-6)


def test_a_pantograph_of_continuous_links():
    """Two crossed links, joined at their middles: a pin-jointed run keeps its energy."""
    points = {
        "A": at(0, 0, 0, **GROUND), "B": at(0.2, 0.2, 0), "M": on("up", 0.5),
        "C": at(0, 0.2, 0, **GROUND | {"motion": ["0 m", "h*(cos(w*t) - 1)", "0 m"]}), "D": at(0.2, 0, 0),
    }  # fmt: skip
    links = {"up": elastic(["A", "B"]), "down": elastic(["C", "M"]), "rest": elastic(["M", "D"])}
    joints = [
        {"point": "A", "links": ["up"], "kind": "revolute", "axis": [0, 0, 1]},
        {"point": "M", "links": ["down", "up"], "kind": "revolute", "axis": [0, 0, 1]},
    ]
    scene = symgen.Scene(
        parameters={"h": "5 mm", "w": "40 rad/s"},
        points=points,
        links=links,
        joints=joints,
        welds=[{"point": "M", "links": ["down", "rest"]}],
        analysis={"t_end": "0.004 s"},
    )
    run = build(scene).simulate(samples=5, max_step=5e-5)
    assert run.drift.energy < 1e-5 * run.drift.energy_exchanged
    assert run.drift.constraint < 1e-10
    np.testing.assert_allclose(run["M.position"].values[:, 2], 0.0, atol=1e-12)


def test_a_link_at_a_further_point_of_a_body():
    """A body of five points swings about two ground points; a link hangs from the fifth."""
    points = {
        "A": at(0, 0, 0, **GROUND), "B": at(0, 0.1, 0, **GROUND), "C": at(0.1, 0, 0), "D": at(0, 0, 0.1),
        "S": at(0.1, 0.1, 0.05), "T": at(0.3, 0.1, 0.05),
    }  # fmt: skip
    body = {"points": ["A", "B", "C", "D", "S"], "mass": "0.5 kg", "centre": ["0.04 m", "0.05 m", "0.03 m"]}
    body["inertia"] = [f"{x} kg*m^2" for x in (1e-3, 1e-3, 1.2e-3)]
    scene = symgen.Scene(
        points=points,
        links={"body": body, "beam": elastic(["S", "T"])},
        welds=[{"point": "S", "links": ["beam", "body"]}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
        analysis={"t_end": "0.01 s"},
    )
    run = build(scene).simulate(samples=3, rtol=1e-2)
    assert run.drift.energy < 1e-4 * run.drift.energy_exchanged
    # As drawn, and so in every pose.
    c, d, s = (run[f"{p}.position"].values for p in "CDS")
    np.testing.assert_allclose(s, np.array([0.0, 0.1, 0.0]) + c + d / 2, atol=1e-9)
    assert np.max(np.abs(s - s[0])) > 1e-4


def test_points_at_the_same_place_are_refused():
    points = {
        "A": at(0, 0, 0, **GROUND),
        "B": at(LENGTH, 0, 0),
        "C": on("beam", 0.5),
        "D": on("beam", 0.5005),
    }
    with pytest.raises(SceneError, match="at the same place"):
        symgen.build(symgen.Scene(points=points, links={"beam": elastic(["A", "B"])}))
