"""Limit positions of spherical four-bars: angles of triangles by their half-angle formulas, limits by drawing."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from shared.commands import call
from shared.full import full

import symgen
from symgen.errors import SceneError
from symgen.mechanics.synthesis.limits import SPHERICAL_QUANTITIES
from symgen.synthesis.spherical import SphericalFourBar

NAMES = [name for name, _, _ in SPHERICAL_QUANTITIES]
TASK = {"kind": "limits", "linkage": "spherical"}
WIPER = {"fixed_link": "80 deg", "swing": "60 deg", "rocker_folded": "40 deg", "transmission_least": "40 deg"}


def corner(far, one, other):
    """Return the angle between two sides of a spherical triangle by the tangent of its half."""
    s = (far + one + other) / 2
    return 2 * math.atan(
        math.sqrt(math.sin(s - one) * math.sin(s - other) / (math.sin(s) * math.sin(s - far)))
    )


def quantities(a, b, c, d):
    out = {"crank": a, "coupler": b, "rocker": c, "fixed_link": d}
    for pose, side in (("extended", a + b), ("folded", b - a)):
        out[f"crank_{pose}"], out[f"rocker_{pose}"] = corner(c, side, d), corner(side, c, d)
        out[f"transmission_{pose}"] = corner(d, side, c)
    out["swing"] = out["rocker_extended"] - out["rocker_folded"]
    out["transmission_least"], out["transmission_greatest"] = corner(d - a, b, c), corner(d + a, b, c)
    forth = math.pi + out["crank_folded"] - out["crank_extended"]
    return out | {"time_ratio": forth / (2 * math.pi - forth)}


def opposites(arcs):
    """Yield the arcs of the same linkage with some axes replaced by their opposites."""
    for flips in itertools.product((False, True), repeat=4):
        yield [math.pi - x if flips[i] != flips[(i + 1) % 4] else x for i, x in enumerate(arcs)]


def drawn(arcs, cranks):
    """Return angles of the rocker (from OC continued) and at B by the intersection of cones about A and C."""
    a, b, c, d = arcs
    ground = np.array([math.sin(d), 0.0, math.cos(d)])
    out = []
    for crank in cranks:
        joint = np.array([math.sin(a) * math.cos(crank), math.sin(a) * math.sin(crank), math.cos(a)])
        g = joint @ ground
        x, y = np.linalg.solve([[1, g], [g, 1]], [math.cos(b), math.cos(c)])
        across = np.cross(joint, ground)
        end = x * joint + y * ground
        end = end + across / np.linalg.norm(across) * math.sqrt(1 - end @ end)
        sides = [np.cross(end, joint), np.cross(end, ground)]
        at_b = math.atan2(np.linalg.norm(np.cross(*sides)), sides[0] @ sides[1])
        out.append((math.atan2(end[1], end @ [math.cos(d), 0.0, -math.sin(d)]), at_b))
    return np.array(out).T


def found(**given):
    return symgen.synthesise({**TASK, **given}).designs


def random_arcs(generator):
    """Return arcs of a crank-rocker, the crank less than any other arc and its supplement."""
    while True:
        a, b, c, d = generator.uniform(0.1, 2.6, 4).tolist()
        others = b, c, d
        if (a < 0.98 * min(*others, *(math.pi - x for x in others)) and a + b + c + d < 6.2
                and 2 * (a + max(others)) < 0.98 * (a + b + c + d)):  # fmt: skip
            return a, b, c, d


@pytest.mark.parametrize("seed", [0, 1, *(full(n) for n in range(2, 24))])
def test_any_four_quantities_lead_back_to_the_linkage(seed):
    """Every linkage found has them, measured in a run of its loop, and by half-angle formulas of its arcs."""
    generator = np.random.default_rng(seed)
    arcs = random_arcs(generator)
    every = quantities(*arcs)
    while True:
        names = generator.choice(NAMES, 4, replace=False).tolist()
        try:
            designs = found(**{n: every[n] for n in names})
            break
        except SceneError as error:
            assert "depend on each other" in str(error), names
    ways = [*opposites(arcs)]
    assert any(np.allclose([*d.linkage.lengths.values()], way, rtol=1e-7) for d in designs for way in ways)
    for design in designs:
        assert not design.faults
        own = quantities(*design.linkage.lengths.values())
        for name in NAMES:
            assert design.quantities[name] == pytest.approx(own[name], rel=1e-7), name
        assert all(own[n] == pytest.approx(every[n], rel=1e-7) for n in names)


def test_limits_are_those_of_a_drawn_linkage():
    """Swing and transmission of a whole revolution, and the crank's angle where the rocker stops."""
    (design,) = found(**WIPER)
    cranks = np.linspace(0, 2 * math.pi, 3_601)
    rocker, at_b = drawn(design.linkage.lengths.values(), cranks)
    q = design.quantities
    assert np.ptp(rocker) == pytest.approx(math.radians(60), abs=2e-6)
    assert math.pi - rocker.max() == pytest.approx(math.radians(40), abs=2e-6)
    assert [at_b.min(), at_b.max()] == pytest.approx([math.radians(40), q["transmission_maximum"]], abs=2e-6)
    stops = cranks[np.argmin(rocker)], cranks[np.argmax(rocker)] - math.pi
    assert stops == pytest.approx((q["crank_extended"], q["crank_folded"]), abs=2e-3)
    assert q["swing"] == pytest.approx(math.radians(60), abs=1e-9)


def test_small_arcs_are_a_planar_linkage():
    """Arcs differ from lengths by the order of their square."""
    size = 0.02
    given = {"swing": "60 deg", "rocker_folded": "40 deg", "transmission_least": "40 deg"}
    (plane,) = symgen.synthesise({"kind": "limits", "fixed_link": "1 m", **given}).designs
    (sphere,) = found(fixed_link=size, **given)
    lengths = [x * size for x in plane.linkage.lengths.values()]
    assert [*sphere.linkage.lengths.values()] == pytest.approx(lengths, rel=1e-3)
    assert sphere.quantities["time_ratio"] == pytest.approx(plane.quantities["time_ratio"], rel=1e-3)


def test_angles_alone_determine_the_arcs():
    arcs = np.radians([25.0, 70.0, 65.0, 80.0])
    every = quantities(*arcs)
    names = ("crank_extended", "rocker_extended", "transmission_extended", "transmission_least")
    designs = found(**{n: every[n] for n in names})
    assert any(np.allclose([*d.linkage.lengths.values()], arcs, rtol=1e-8) for d in designs)


def test_the_best_transmission_in_a_range():
    """Over a dense grid of rockers no linkage of the same swing and angle deviates less from 90 deg."""
    (design,) = found(**{**WIPER, "transmission_least": ["30 deg", "90 deg"], "starts": 30})
    ends = [design.quantities[f"transmission_{end}"] for end in ("minimum", "maximum")]
    d, folded, extended = np.radians([80.0, 40.0, 100.0])
    off = []
    for c in np.linspace(0.05, 3.0, 20_001):
        far, near = (
            math.acos(math.cos(c) * math.cos(d) + math.sin(c) * math.sin(d) * math.cos(x))
            for x in (extended, folded)
        )
        a, b = (far - near) / 2, (far + near) / 2
        if a < 0.999 * min(b, c, d, math.pi - c) and 2 * (a + max(b, c, d)) < 0.999 * (a + b + c + d):
            angles = corner(d - a, b, c), corner(d + a, b, c)
            off.append(max(abs(x - math.pi / 2) for x in angles))
    assert max(abs(x - math.pi / 2) for x in ends) == pytest.approx(min(off), abs=1e-4)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"crank": "100 deg", "coupler": "110 deg", "rocker": "95 deg", "fixed_link": "105 deg"}, "contradict: .*crank"),
        ({"crank": "30 deg", "coupler": "60 deg", "swing": "60 deg"}, "expected 4 quantities"),
        ({"crank": "3 m", "coupler": "60 deg", "swing": "60 deg", "rocker": "1 rad"}, "crank"),
        ({"crank": "0 deg", "coupler": "60 deg", "swing": "60 deg", "rocker": "1 rad"}, "between 0 and 180 deg"),
        ({"crank": "9 deg", "swing": "9 deg", "rocker_extended": "60 deg", "rocker_folded": "51 deg"}, "depend on each"),
        ({"crank": "50 deg", "coupler": "55 deg", "rocker": "60 deg", "fixed_link": "80 deg"}, "contradict"),
        ({"crank": "30 deg", "lenght": "55 deg"}, "lenght"),
    ],
)  # fmt: skip
def test_what_no_spherical_crank_rocker_has_is_refused(given, message):
    with pytest.raises(SceneError, match=message):
        found(**given)


def test_command_scene_and_chart(tmp_path):
    """The scene runs as a loop with the swing of the task; a chart has arcs over a quantity."""
    task = tmp_path / "wiper.toml"
    lines = [f'{k} = "{v}"' for k, v in {**TASK, **WIPER}.items()]
    task.write_text("\n".join(["symgen = 1", "[synthesis]", *lines]))
    text = call("synthesise", task, "--out", tmp_path / "out")
    assert "crank-rocker  23.67       80   121.3     80     60  1.232  40.00  100.00" in text
    run = symgen.build(tmp_path / "out" / "spherical_four_bar_1.toml").kinematics(samples=3601)
    assert np.ptp(run["theta4"].values) == pytest.approx(math.radians(60), abs=1e-5)
    chart = call("synthesise", task, "--vary", "swing=50deg:70deg:2", "--plot", tmp_path / "chart.png")
    assert "arcs in deg" in chart and (tmp_path / "chart.png").stat().st_size > 10_000


def case_1(d, swing, folded, least):
    """Return arcs of all crank-rockers of Case I by a scan over the rocker: its triangles give crank and coupler."""
    c = np.linspace(1e-3, math.pi - 1e-3, 100_001)
    far, near = (
        np.arccos(np.cos(c) * np.cos(d) + np.sin(c) * np.sin(d) * np.cos(x)) for x in (folded + swing, folded)
    )
    a, b = (far - near) / 2, (far + near) / 2
    others = np.array([b, c, np.full_like(c, d)])
    turns = (a > 0) & (a < others.min(axis=0)) & (a + others.max(axis=0) < math.pi)
    turns &= (2 * (a + others.max(axis=0)) < a + others.sum(axis=0)) & (a + others.sum(axis=0) < 2 * math.pi)
    with np.errstate(invalid="ignore"):
        off = np.arccos((np.cos(d - a) - np.cos(b) * np.cos(c)) / (np.sin(b) * np.sin(c))) - least
    at = np.flatnonzero(turns[:-1] & turns[1:] & (off[:-1] * off[1:] < 0))
    return [(a[i], b[i], c[i], d) for i in at]


@pytest.mark.parametrize("seed", [1, 6, *(full(n) for n in range(20, 40))])
def test_all_linkages_of_case_1_are_found(seed):
    """As many as a scan finds, but for those that differ by opposite axes alone."""
    generator, wanted = np.random.default_rng(seed), []
    while not wanted:
        d, swing, folded, least = generator.uniform([0.3, 0.2, 0.1, 0.2], [2.8, 1.6, 1.5, 1.5]).tolist()
        wanted = case_1(d, swing, folded, least)
    shapes = []
    for arcs in wanted:
        shape = np.array(min(opposites(arcs), key=sum))
        if all(np.abs(shape - other).max() > 1e-3 for other in shapes):
            shapes.append(shape)
    designs = found(fixed_link=d, swing=swing, rocker_folded=folded, transmission_least=least)
    assert len(designs) == len(shapes)
    for shape in shapes:
        assert min(np.abs(design.linkage.least_arcs - shape).max() for design in designs) < 1e-3


@pytest.mark.parametrize("seed", [0, 1, 2, *(full(n) for n in range(3, 12))])
def test_limits_of_linkages_with_opposite_axes(seed):
    """Directions of the crank at which the rocker stops, and their distance, for any representation of a linkage."""
    generator = np.random.default_rng(seed)
    arcs = random_arcs(generator)
    arcs = [*opposites(arcs)][generator.integers(16)]
    a, _, c, d = arcs
    at_start, _ = drawn(arcs, [0.3])
    o, ground = np.array([0.0, 0.0, 1.0]), np.array([math.sin(d), 0.0, math.cos(d)])
    joint = np.array([math.sin(a) * math.cos(0.3), math.sin(a) * math.sin(0.3), math.cos(a)])
    x, y = math.sin(c) * math.cos(at_start[0]), math.sin(c) * math.sin(at_start[0])
    end = [math.cos(d) * x + math.sin(d) * math.cos(c), y, math.cos(d) * math.cos(c) - math.sin(d) * x]
    linkage = SphericalFourBar(o, joint, end, ground)
    assert linkage.grashof == "crank-rocker"
    directions, moves, more = linkage.extremes
    dense = np.linspace(0, 2 * math.pi, 3_601)
    rocker, at_b = drawn(arcs, dense)
    rocker = np.unwrap(rocker)
    limits, angles = drawn(arcs, directions)
    assert moves == "swing"
    assert np.ptp(np.unwrap(limits)) == pytest.approx(np.ptp(rocker), abs=4e-6)
    assert [angles.min(), angles.max()] == pytest.approx([at_b.min(), at_b.max()], abs=4e-6)
    between = abs(dense[np.argmax(rocker)] - dense[np.argmin(rocker)])
    assert abs(more) == pytest.approx(abs(between - math.pi), abs=6e-3)
