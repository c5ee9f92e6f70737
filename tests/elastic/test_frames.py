"""Frames of elastic links at rest and beams between ground points, welded and pinned.

They are compared with closed forms, an independent assembly, and elements in large rotation.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

import symgen
from symgen.errors import SceneError

E, RHO, WIDTH = 210e9, 7850.0, 0.02
#: Members by name: points and thickness [m]. Two of them join the middle of a column to the beam.
MEMBERS = {
    "left": ("O", "A", 0.02),
    "beam": ("A", "B", 0.03),
    "right": ("Q", "B", 0.015),
    "lower": ("C", "F", 0.01),
    "upper": ("F", "D", 0.008),
}
PLACES = {"O": (0.0, 0.0), "A": (0.1, 1.0), "B": (1.5, 1.2), "Q": (1.4, 0.0), "F": (0.5, 0.6)}
WELDS = {
    "A": ["left", "beam"],
    "B": ["right", "beam"],
    "C": ["left", "lower"],
    "F": ["lower", "upper"],
    "Q": ["right"],
}
BETWEEN = {"C": ("left", 0.5), "D": ("beam", 0.25)}
FORCE = (100.0, -40.0)


def scene(welds, elements=4, members=MEMBERS, places=PLACES, **options):
    drawn = {
        p: {"at": [f"{x!r} m" for x in xy], **({"ground": True} if p in "OQ" else {})}
        for p, xy in places.items()
    }
    between = {p: {"on": on, "fraction": at} for p, (on, at) in BETWEEN.items() if "lower" in members}
    return {
        "title": "Frame",
        "points": drawn | between,
        "links": {
            name: {
                "points": [a, b], "density": "7850 kg/m^3",
                "section": {"width": "20 mm", "thickness": f"{thickness!r} m"},
                "elastic": {"E": "210 GPa", "element": "cubic", "elements": elements, **options},
            }
            for name, (a, b, thickness) in members.items()
        },
        "forces": [{"point": "B", "force": [f"{f!r} N" for f in FORCE]}],
        "welds": [{"point": p, "links": links} for p, links in welds.items()],
        "crank": {"link": "left", "speed": "0 rpm"},
    }  # fmt: skip


def assembled(welds, count=4):
    """Stiffness and mass of the same frame by Euler-Bernoulli elements on fixed axes; names of the unknowns."""
    places = dict(PLACES)
    for p, (on, at) in BETWEEN.items():
        a, b = (np.array(PLACES[q]) for q in MEMBERS[on][:2])
        places[p] = tuple(a + at * (b - a))
    names: dict[str, int] = {}
    parts = []
    for name, (a, b, thickness) in MEMBERS.items():
        start, end = np.array(places[a]), np.array(places[b])
        length = np.linalg.norm(end - start)
        (c, s), h = (end - start) / length, length / count
        area, second = WIDTH * thickness, WIDTH * thickness**3 / 12
        bent = E * second / h**3 * np.array(
            [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
             [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]])  # fmt: skip
        heavy = RHO * area * h / 420 * np.array(
            [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
             [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]])  # fmt: skip
        stiffness, mass = np.zeros((2, 6, 6))
        across, along = np.ix_([1, 2, 4, 5], [1, 2, 4, 5]), np.ix_([0, 3], [0, 3])
        stiffness[across], mass[across] = bent, heavy
        stiffness[along] = E * area / h * np.array([[1, -1], [-1, 1]])
        mass[along] = RHO * area * h / 6 * np.array([[2, 1], [1, 2]])
        turn = np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
        joints = {0: a, count: b} | {round(at * count): p for p, (on, at) in BETWEEN.items() if on == name}
        nodes = []
        for node in range(count + 1):
            p = joints.get(node, f"{name}{node}")
            welded = name in welds.get(p, ())
            held = p in "OQ"
            turned = f"{p}.r" if welded else f"{name}{node}.r"
            if (held and welded) or (name, node) == ("left", 0):
                turned = ""
            nodes.append(["" if held else f"{p}.x", "" if held else f"{p}.y", turned])
        parts += [
            (nodes[k] + nodes[k + 1], turn.T @ stiffness @ turn, turn.T @ mass @ turn) for k in range(count)
        ]
    for own, *_ in parts:
        for dof in own:
            if dof:
                names.setdefault(dof, len(names))
    found = np.zeros((2, len(names), len(names)))
    for own, *matrices in parts:
        used = [k for k, dof in enumerate(own) if dof]
        there = np.ix_(*[[names[own[k]] for k in used]] * 2)
        for total, matrix in zip(found, matrices, strict=True):
            total[there] += matrix[np.ix_(used, used)]
    return *found, names


@pytest.mark.parametrize("welds", [WELDS, {}], ids=["welded", "pinned"])
def test_frequencies_and_deflections(welds):
    model = symgen.build(symgen.Scene(**scene(welds)))
    stiffness, mass, names = assembled(welds)
    expected = np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)
    assert len(model.modes().frequencies) == len(expected)
    assert np.abs(model.modes().frequencies / expected - 1).max() < 1e-9
    load = np.zeros(len(names))
    load[[names["B.x"], names["B.y"]]] = FORCE
    bent = np.linalg.solve(stiffness, load)
    result = model.quasi_static(samples=2, geometric_stiffness=False)
    for p in "ABCDF":
        own = bent[[names[f"{p}.x"], names[f"{p}.y"]]]
        assert np.abs(result[f"{p}.displacement"].values[-1] - own).max() < 1e-9 * np.abs(bent).max()


def test_sway_of_a_clamped_portal():
    """Slope-deflection: columns c = EI/h and beam b = EI/L sway by F h^2/(24 c) / (1 - 3 c/(4 c + 6 b))."""
    members = {name: MEMBERS[name] for name in ("left", "beam")} | {"right": ("Q", "B", 0.02)}
    places = {"O": (0.0, 0.0), "A": (0.0, 1.0), "B": (1.5, 1.0), "Q": (1.5, 0.0)}
    welds = {p: WELDS[p] for p in "ABQ"}
    model = symgen.build(symgen.Scene(**scene(welds, 1, members, places, axial=False)))
    c, b = E * WIDTH * 0.02**3 / 12, E * WIDTH * 0.03**3 / 12 / 1.5
    sway = FORCE[0] / (2 * (12 * c - 36 * c**2 / (4 * c + 6 * b)))
    found = model.quasi_static(samples=2, geometric_stiffness=False)
    assert found["A.displacement"].values[-1] == pytest.approx([sway, 0.0], rel=1e-9, abs=1e-15)
    turned = 6 * c * sway / (4 * c + 6 * b)
    assert found["right.Q.couple"].values[-1] == pytest.approx(6 * c * sway - 2 * c * turned, rel=1e-9)
    assert found["beam.B.couple"].values[-1] == pytest.approx(-6 * b * turned, rel=1e-9)


BAD = {
    "one link": ({"welds": [{"point": "A", "links": ["left"]}]}, "two links or more"),
    "twice": ({"welds": [{"point": "Q", "links": ["right"]}] * 2}, "Q has two welds"),
    "elsewhere": (
        {"welds": [{"point": "A", "links": ["left", "right"]}]},
        "A is no joint of right, whose joints are Q, B\n  Name",
    ),
    "rigid truss": (
        {"crank": {"link": "left", "speed": "1 rpm"}},
        "Weld no links whose angle changes as they move: the weld of ",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_welds(case):
    changes, words = BAD[case]
    with pytest.raises(SceneError, match=words):
        symgen.build(symgen.Scene(**scene(WELDS) | changes))


def test_rigid_links_are_not_welded_to_the_ground():
    data = scene(WELDS)
    del data["links"]["right"]["elastic"]
    with pytest.raises(SceneError, match="right is rigid, and Q is welded to the ground"):
        symgen.build(symgen.Scene(**data))
    del data["links"]["beam"]["elastic"]
    data["welds"] = [{"point": "B", "links": WELDS["B"]}]
    with pytest.raises(SceneError, match="right and beam are rigid"):
        symgen.build(symgen.Scene(**data))


LENGTH, THICKNESS = 0.7, 0.01
BENDING, LINE = E * WIDTH * THICKNESS**3 / 12, RHO * WIDTH * THICKNESS
CLAMPED = [{"point": p, "links": ["beam"]} for p in "QG"]


def on_two_supports(points=(), links=(), **tables):
    """Return the model of a beam between ground points; nothing joins it to the rigid crank but ``links``."""
    section = {"width": f"{WIDTH} m", "thickness": f"{THICKNESS} m"}
    bar = {"density": "7850 kg/m^3", "section": section}
    bent = bar | {"elastic": {"E": "210 GPa", "elements": 3}}
    places = {"O": (0, -0.5), "Q": (0, 0), "G": (LENGTH, 0), "A": (0.1, -0.4)}
    drawn = {p: {"at": [f"{x} m" for x in xy], "ground": p != "A"} for p, xy in places.items()}
    scene = symgen.Scene(
        points=drawn | dict(points),
        links={"crank": bar | {"points": ["O", "A"]}, "beam": bent | {"points": ["Q", "G"]}}
        | {name: bent | {"points": ends} for name, ends in dict(links).items()},
        crank={"link": "crank", "speed": "1 rpm"},
        **tables,
    )
    return symgen.build(scene)


@pytest.mark.parametrize(("welds", "root"), [([], np.pi), (CLAMPED, 4.730040744862704)])
def test_frequencies_of_a_beam_between_ground_points(welds, root):
    model = on_two_supports(welds=welds)
    expected = root**2 * np.sqrt(BENDING / LINE) / (2 * np.pi * LENGTH**2)
    assert model.modes().frequencies[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("welds", "factor"), [([], 5), (CLAMPED, 1)])
def test_a_beam_between_ground_points_under_its_weight(welds, factor):
    """q L^4/(384 EI), five times as much between hinges, and couples of q L^2/12 at clamps."""
    weight = LINE * 9.81
    gravity = {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]}
    found = on_two_supports(welds=welds, gravity=gravity).quasi_static(samples=2)
    sag = factor * weight * LENGTH**4 / (384 * BENDING)
    assert found["beam.deflection"].values[-1] == pytest.approx(-sag, rel=1e-9)
    assert found["beam.Q.force"].values[-1] == pytest.approx([0.0, weight * LENGTH / 2], rel=1e-9, abs=1e-9)
    assert not np.any(found["beam.length_change"].values)
    # Half the integral of w'^2.
    longer = (1 / 60480 if welds else 17 / 40320) * (weight / BENDING) ** 2 * LENGTH**7
    assert found["beam.arc_length_change"].values[-1] == pytest.approx(longer, rel=1e-9)
    if welds:
        assert found["beam.Q.couple"].values[-1] == pytest.approx(weight * LENGTH**2 / 12, rel=1e-9)


def test_supports_share_an_axial_force_by_the_stiffness_of_the_parts():
    place = {"X": {"on": "beam", "fraction": 0.3}}
    found = on_two_supports(place, forces=[{"point": "X", "force": ["1000 N", "0 N"]}]).quasi_static(
        samples=2
    )
    for point, share in (("Q", 0.7), ("G", 0.3)):
        assert found[f"beam.{point}.force"].values[-1] == pytest.approx([-1000 * share, 0.0], abs=1e-6)


def test_a_rocker_on_a_beam_between_ground_points_in_large_rotation():
    points = {"B": {"at": ["0.6 m", "-0.2 m"]}, "X": {"on": "beam", "fraction": 0.5}}
    model = on_two_supports(points, {"coupler": ["A", "B"], "rocker": ["X", "B"]})
    options = {"revolutions": 1 / 60 / model.modes().frequencies[0], "samples": 21}
    linear, large = model.simulate(**options), model.large_rotation(**options, elements=4, rtol=1e-3)
    expected = linear["X.displacement"].values
    assert np.max(np.abs(expected[:, 1])) > 1e-8
    assert large["X.displacement"].values == pytest.approx(expected, abs=1e-2 * np.max(np.abs(expected)))
    assert linear.statistics["power_balance"] < 1e-6
