"""Points between the ends of elastic links in space, and frames, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shared.in_numpy import build

import symgen
from symgen.errors import SceneError
from symgen.runtime.elastic.large.statics import equilibrium
from symgen.runtime.elastic.space.linkage import LinkageInSpace

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


def test_a_link_over_three_supports():
    """Continuous over two equal spans under its weight: reactions 3/8, 10/8 and 3/8 of w L.

    Rigid links would be overdetermined.
    """
    span = 2 * LENGTH
    scene = symgen.Scene(
        points={
            "A": at(0, 0, 0, **GROUND), "B": at(span, 0, 0), "C": on("beam", 0.5),
            "D": at(LENGTH, 0, -0.5, **GROUND), "E": at(span, 0, -0.5, **GROUND),
        },
        links={
            "beam": elastic(["A", "B"], elements=8),
            "post": {"points": ["D", "C"], "mass": "0 kg"},
            "other": {"points": ["E", "B"], "mass": "0 kg"},
        },
        joints=[{"point": "A", "links": ["beam"], "kind": "revolute", "axis": [0, 1, 0]}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
    )  # fmt: skip
    linkage, found, _ = displaced(scene, "B")
    q = found.q[None]
    forces = linkage.links[0].forces(q, 0 * q, 0 * q)
    load = DENSITY * WIDTH * THICKNESS * 9.81 * LENGTH
    for point, share in (("A", 3 / 8), ("C", 10 / 8), ("B", 3 / 8)):
        assert forces[point][0, 2] == pytest.approx(share * load, rel=1e-3)


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


@pytest.mark.parametrize(
    ("welded", "roots"), [("AB", (4.7300407449, 7.8532046241)), ("A", (3.9266023121, 7.0685827456))]
)
def test_frequencies_between_two_ground_points(welded, roots):
    """Clamped, and clamped and pinned, by Euler and Bernoulli; rotary inertia and elements take 2e-3."""
    scene = symgen.Scene(
        points={"A": at(0, 0, 0, **GROUND), "B": at(LENGTH, 0, 0, **GROUND), "C": on("beam", 0.4)},
        links={"beam": elastic(["A", "B"], elements=10)},
        welds=[{"point": p, "links": ["beam"]} for p in welded],
    )
    found = build(scene).modes().frequencies
    mu = DENSITY * WIDTH * THICKNESS
    exact = [
        (k / LENGTH) ** 2 * math.sqrt(stiffness / mu) / (2 * math.pi)
        for k in roots
        for stiffness in (EI_Y, EI_Z)
    ]
    # A pinned end spins about its line only with the whole link, which its other end holds.
    np.testing.assert_allclose(found[:3], np.sort(exact)[:3], rtol=3e-3)


def test_a_moved_ground_point_stretches_a_link():
    """EA e/L between two ground points, of which one moves along the link; half of it at the middle."""
    moved = 1e-4
    scene = symgen.Scene(
        parameters={"e": f"{moved} m", "T": "1 s"},
        points={
            "A": at(0, 0, 0, **GROUND),
            "B": at(LENGTH, 0, 0, **GROUND, motion=["e*t/T", "0 m", "0 m"]),
            "C": on("beam", 0.5),
        },
        links={"beam": elastic(["A", "B"])},
        welds=[{"point": "A", "links": ["beam"]}],
    )
    linkage = LinkageInSpace(build(scene).rigid)
    q = equilibrium(linkage, 1.0).q[None]
    force = linkage.links[0].forces(q, 0 * q, 0 * q)["B"][0, 0]
    strain = moved / LENGTH
    # Green's strain of the line between the nodes.
    assert force == pytest.approx(E * WIDTH * THICKNESS * strain * (1 + 1.5 * strain), rel=1e-6)
    middle = linkage.positions(np.ones(1), q)["C"][0]
    np.testing.assert_allclose(middle, [(LENGTH + moved) / 2, 0, 0], atol=1e-12)


def test_sway_of_a_portal_frame():
    """H h^3 (3 k + 2)/(12 EI (6 k + 1)), k = h/L of equal sections; columns stretch by less than 1e-3 of it."""
    height, span, load = 0.3, 0.4, 0.05
    points = {
        "A": at(0, 0, 0, **GROUND), "B": at(0, height, 0), "C": at(span, height, 0), "D": at(span, 0, 0, **GROUND),
    }  # fmt: skip
    members = {"left": ["A", "B"], "beam": ["B", "C"], "right": ["D", "C"]}
    scene = symgen.Scene(
        points=points,
        links={name: elastic(ends, density="1e-3 kg/m^3") for name, ends in members.items()},
        welds=[
            {"point": "A", "links": ["left"]}, {"point": "B", "links": ["left", "beam"]},
            {"point": "C", "links": ["beam", "right"]}, {"point": "D", "links": ["right"]},
        ],
        forces=[force("B", load / 2, 0, 0), force("C", load / 2, 0, 0)],
    )  # fmt: skip
    _, _, (left, right) = displaced(scene, "B", "C")
    k = height / span
    expected = load * height**3 * (3 * k + 2) / (12 * EI_Y * (6 * k + 1))
    assert left[0] == pytest.approx(expected, rel=1e-3)
    assert right[0] == pytest.approx(expected, rel=1e-3)


def test_a_rigid_offset_welded_to_the_tip():
    """A side load on a rigid arm across the tip of a cantilever bends and twists it."""
    arm, load = 0.05, 0.02
    scene = symgen.Scene(
        points={"A": at(0, 0, 0, **GROUND), "B": at(LENGTH, 0, 0), "P": at(LENGTH, arm, 0)},
        links={
            "beam": elastic(["A", "B"], density="1e-3 kg/m^3"),
            "lug": {"points": ["B", "P"], "mass": "1e-6 kg"},
        },
        welds=[{"point": "A", "links": ["beam"]}, {"point": "B", "links": ["beam", "lug"]}],
        forces=[force("P", 0, 0, load)],
    )
    linkage, _, (end,) = displaced(scene, "P")
    torsion = linkage.links[0].section[7]
    expected = load * (LENGTH**3 / (3 * EI_Z) + arm**2 * LENGTH / torsion)
    assert end[2] == pytest.approx(expected, rel=1e-5)


def with_tip(mass, inertia, **more):
    """Return a cantilever without mass that has a body at its tip, the centre of which is there."""
    points = {"A": at(0, 0, 0, **GROUND), "B": at(LENGTH, 0, 0)}
    points |= {"P": at(LENGTH, 0.02, 0), "Q": at(LENGTH, 0, 0.02)}
    centre = [f"{LENGTH} m", "0 m", "0 m"]
    body = {"points": ["B", "P", "Q"], "mass": f"{mass} kg", "centre": centre}
    body["inertia"] = [f"{inertia} kg*m^2"] * 3
    links = {"beam": elastic(["A", "B"], density="1e-2 kg/m^3"), "body": body}
    welds = [{"point": "A", "links": ["beam"]}, {"point": "B", "links": ["beam", "body"]}]
    return symgen.Scene(points=points, links=links, welds=welds, **more)


def test_tip_inertia_of_a_body():
    """K of a cantilever's end, EI/L^3 [12, -6 L; -6 L, 4 L^2], with M = diag(m, J), in both planes."""
    mass, inertia = 0.5, 2e-3
    found = build(with_tip(mass, inertia)).modes().frequencies
    exact = []
    for stiffness in (EI_Y, EI_Z):
        k = stiffness / LENGTH**3 * np.array([[12, -6 * LENGTH], [-6 * LENGTH, 4 * LENGTH**2]])
        exact += [*np.sqrt(np.linalg.eigvals(k / np.array([[mass], [inertia]])).real) / (2 * math.pi)]
    linkage = LinkageInSpace(build(with_tip(mass, inertia)).rigid)
    exact.append(math.sqrt(linkage.links[0].section[7] / LENGTH / inertia) / (2 * math.pi))
    np.testing.assert_allclose(found[:5], np.sort(exact), rtol=1e-4)


def test_an_end_moment_by_a_body():
    """The tip of a cantilever under a moment is on a circle: (1 - cos k)/k and sin(k)/k of the length."""
    moment = 8.0
    scene = with_tip(0.5, 2e-3, torques=[{"link": "body", "torque": ["0 N*m", "0 N*m", f"{moment} N*m"]}])
    found = []
    for divided in (1, 2):
        linkage = LinkageInSpace(build(scene).rigid, divided=divided)
        q = equilibrium(linkage, 0.0).q[None]
        found.append(linkage.positions(np.zeros(1), q)["B"][0])
    bend = moment * LENGTH / EI_Y
    exact = LENGTH * np.array([math.sin(bend) / bend, (1 - math.cos(bend)) / bend, 0.0])
    errors = [np.max(np.abs(x - exact)) for x in found]
    assert errors[1] < 2e-4 * LENGTH
    assert errors[0] / errors[1] > 3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"torques": [{"link": "beam", "point": "B", "torque": ["0 N*m", "0 N*m", "1 N*m"]}]}, "beam is elastic"),
        ({"welds": [{"point": "B", "links": ["beam", "rod"]}, {"point": "D", "links": ["rod", "tail"]}]}, "welded twice"),
        ({"joints": [{"point": "K", "links": ["rod"], "kind": "revolute", "axis": [0, 0, 1]}],
          "welds": [{"point": "D", "links": ["rod", "tail"]}]}, "revolute joint with the ground and no drive"),
    ],
)  # fmt: skip
def test_refused(change, words):
    points = {"A": at(0, 0, 0, **GROUND), "B": at(0.2, 0, 0), "D": at(0.3, 0.1, 0), "E": at(0.4, 0.1, 0)}
    points["K"] = at(0.2, 0, 0, **GROUND)
    rod = {"points": ["K" if "joints" in change else "B", "D"], "mass": "0.1 kg"}
    links = {"beam": elastic(["A", "B"]), "rod": rod, "tail": elastic(["D", "E"])}
    with pytest.raises(SceneError, match=words):
        symgen.build(symgen.Scene(points=points, links=links, **change))


def test_points_at_the_same_place_are_refused():
    points = {
        "A": at(0, 0, 0, **GROUND),
        "B": at(LENGTH, 0, 0),
        "C": on("beam", 0.5),
        "D": on("beam", 0.5005),
    }
    with pytest.raises(SceneError, match="at the same place"):
        symgen.build(symgen.Scene(points=points, links={"beam": elastic(["A", "B"])}))
