"""Synthesis of four-bars: golden lengths, linkages that the test draws itself, and refusals."""

from __future__ import annotations

import math
import re
import tomllib
from itertools import pairwise

import numpy as np
import pytest
from shared.commands import call

import symgen
from symgen.errors import SceneError, SimulationError
from symgen.report.page.study import render_study
from symgen.report.synthesis import synthesis_study
from symgen.synthesis.four_bar import FourBar

#: Case I of the method file: swing, rocker angle folded, least transmission angle [deg]; a, b, c for d = 1.
CASE_1 = {
    (60, 40, 40): (0.3571859916, 1.0, 0.7602187857),
    (40, 40, 30): (0.3320863582, 1.1898698474, 1.3340379318),
    (60, 30, 40): (0.4017509966, 0.9025693069, 0.8374075795),
    (80, 30, 30): (0.4983198885, 1.0, 0.8250018216),
    (90, 30, 25): (0.5436309458, 1.0448146325, 0.8316002987),
}
#: Case II: swing, crank angles extended and folded [deg].
CASE_2 = {
    (60, 30, 50): (0.3420201433, 1.1198820568, 0.7778619134),
    (60, 20, 45): (0.2816871441, 1.4023531425, 0.8191649566),
    (80, 25, 60): (0.4700407352, 1.2383936615, 0.9066494874),
    (60, 40, 40): (0.3711135995, 0.7660444431, 0.7422271990),
}
#: Lengths of the four-bar that tests draw, and its coupler's point from A in axes along AB.
A, B, C, D, POINT = 0.4, 1.1, 0.9, 1.0, (0.3, 0.5)


def drawn(crank, a=A, b=B, c=C):
    """Return rocker angle, coupler angle and coupler's point by the intersection of two circles."""
    joint = a * np.array([math.cos(crank), math.sin(crank)])
    along = np.array([D, 0.0]) - joint
    e = np.hypot(*along)
    x = (e * e + b * b - c * c) / (2 * e)
    end = joint + (x * along + math.sqrt(b * b - x * x) * np.array([-along[1], along[0]])) / e
    coupler = math.atan2(end[1] - joint[1], end[0] - joint[0])
    c, s = math.cos(coupler), math.sin(coupler)
    point = joint + np.array([c * POINT[0] - s * POINT[1], s * POINT[0] + c * POINT[1]])
    return math.atan2(end[1], end[0] - D), coupler, point


def in_metres(points):
    return [[f"{float(x)!r} m" for x in p] for p in points]


def lengths(found):
    return [tuple(d.linkage.lengths.values()) for d in found.designs]


def has(found, wanted):
    return any(np.allclose(x, wanted, rtol=1e-8) for x in lengths(found))


@pytest.mark.parametrize(("given", "wanted"), CASE_1.items())
def test_case_1(given, wanted):
    swing, rocker, least = given
    found = symgen.synthesise(
        {"kind": "limits", "fixed_link": "1 m", "swing": f"{swing} deg", "rocker_folded": f"{rocker} deg",
         "transmission_least": f"{least} deg"}
    )  # fmt: skip
    assert len(found.designs) == 1 and not found.designs[0].faults
    assert lengths(found)[0] == pytest.approx((*wanted, 1.0), rel=1e-9, abs=6e-11)
    assert found.designs[0].quantities["transmission_minimum"] == pytest.approx(math.radians(least), abs=1e-7)


@pytest.mark.parametrize(("given", "wanted"), CASE_2.items())
def test_case_2(given, wanted):
    swing, extended, folded = given
    found = symgen.synthesise(
        {"kind": "limits", "fixed_link": "1 m", "swing": f"{swing} deg", "crank_extended": f"{extended} deg",
         "crank_folded": f"{folded} deg"}
    )  # fmt: skip
    assert len(found.designs) == 1 and not found.designs[0].faults
    assert lengths(found)[0] == pytest.approx((*wanted, 1.0), rel=1e-9, abs=6e-11)


def test_the_linkage_of_the_thesis_in_its_own_unit():
    """Fixed link 11 in, crank 7, coupler 10, output 12: its limit angles in degrees, from the method file."""
    found = symgen.synthesise(
        {"kind": "limits", "fixed_link": "11 in", "swing": "81.0748 deg", "rocker_folded": "14.1411 deg",
         "crank_extended": "44.6649 deg"}
    )  # fmt: skip
    assert any(np.allclose(np.array(x) / 0.0254, (7, 10, 12, 11), rtol=1e-4) for x in lengths(found))


def test_any_four_quantities_of_a_random_crank_rocker_lead_back_to_it():
    """Angles by the law of cosines, in the test; every choice of four that determines the linkage."""
    generator = np.random.default_rng(1)
    rule = lambda far, p, q: math.acos((p * p + q * q - far * far) / (2 * p * q))  # noqa: E731
    met = 0
    while met < 12:
        a, b, c, d = generator.uniform(0.2, 2.0, 4).tolist()
        if not (a < min(b, c, d) and 2 * (a + max(b, c, d)) < 0.98 * (a + b + c + d)):
            continue
        every = {
            "crank": a, "coupler": b, "rocker": c, "fixed_link": d,
            "crank_extended": rule(c, a + b, d), "rocker_extended": rule(a + b, c, d),
            "transmission_extended": rule(d, a + b, c), "crank_folded": rule(c, b - a, d),
            "rocker_folded": rule(b - a, c, d), "transmission_folded": rule(d, b - a, c),
            "transmission_least": rule(d - a, b, c), "transmission_greatest": rule(d + a, b, c),
        }  # fmt: skip
        every["swing"] = every["rocker_extended"] - every["rocker_folded"]
        forth = math.pi + every["crank_folded"] - every["crank_extended"]
        every["time_ratio"] = forth / (2 * math.pi - forth)
        names = generator.choice(list(every), 4, replace=False).tolist()
        units = {n: "m" if n in ("crank", "coupler", "rocker", "fixed_link") else "rad" for n in names}
        units |= {"time_ratio": ""}
        try:
            found = symgen.synthesise({"kind": "limits", **{n: f"{every[n]!r} {units[n]}" for n in names}})
        except SceneError as error:
            assert "at least one length" in str(error) or "depend on each other" in str(error), names
            continue
        assert has(found, (a, b, c, d)), names
        assert all(not design.faults for design in found.designs)
        met += 1


def test_asked_properties_that_no_linkage_has_are_named():
    """The rocker's angle in the extended position, 150 deg, leaves less than the 80 deg for the one at B."""
    with pytest.raises(
        SceneError, match="transmission_least < transmission_extended; rocker_extended - rocker_f"
    ):
        symgen.synthesise(
            {"kind": "limits", "fixed_link": "1 m", "swing": "60 deg", "rocker_folded": "90 deg",
             "transmission_least": "80 deg"}
        )  # fmt: skip


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ({"kind": "limit"}, "expected a kind of synthesis, got 'limit'\n  Did you mean 'limits'"),
        ({"kind": "limits", "swing": "60 deg"}, "expected 4 quantities"),
        (
            {"kind": "limits", "swing": "60 deg", "time_ratio": 1.1},
            "Add a length and, for example, transmission_least, which may be a range",
        ),
        ({"kind": "limits", "crank": "1 deg", "rocker": "1 m", "coupler": "1 m", "swing": "1 deg"}, "crank"),
        ({"kind": "limits", "crank": "-1 m", "rocker": "1 m", "coupler": "1 m", "swing": "1 deg"}, "1e-09 m or more, got -1 m"),
        ({"kind": "limits", "fixed_link": "1e200 m", "swing": "60 deg"}, "expected at most 1e\\+09 m, got 1e\\+200 m"),
        ({"kind": "function", "fixed_link": "1e-200 m", "input": [0, 1], "output": [0, 1]}, "1e-09 m or more, got 1e-200 m"),
        ({"kind": "limits", "crank": "1 m", "rocker": "1 m", "coupler": "1 m", "swing": "190 deg"}, "and 180 deg, got 190 deg"),
        (
            {"kind": "limits", "fixed_link": "1 m", "swing": "60 deg", "rocker_folded": "30 deg",
             "rocker_extended": "90 deg"},
            "depend on each other",
        ),
        ({"kind": "function", "input": ["1 deg", "2 deg"], "output": ["1 deg", "2 deg", "3 deg"]}, "as many outputs"),
        ({"kind": "function", "input": ["1 deg", "2 deg"], "output": ["1 deg", "2 deg"]}, "do not determine 5"),
        ({"kind": "path", "points": [["0 m", "0 m"], ["1 m", "0 m"]]}, "4 conditions do not determine 11"),
        ({"kind": "path", "points": [["0 m", "0 m"], ["0 m", "0 m"]], "length": ["1 m", "1 m"]}, "different places"),
        ({"kind": "motion", "points": [["0 m", "0 m"], ["1 m", "0 m"]], "angles": ["0 deg", "1 m"]}, "angles"),
        ({"kind": "motion", "points": [["0 m", "0 m"]], "angles": ["0 deg", "1 deg"]}, "at least 2"),
        ({"kind": "motion", "point": []}, "unknown key 'point'\n  Did you mean 'points'"),
    ],
)  # fmt: skip
def test_wrong_tasks_are_refused(task, message):
    with pytest.raises(SceneError, match=message):
        symgen.synthesise(task)


@pytest.mark.parametrize(
    ("count", "given"),
    [(3, {"crank_start": 0, "rocker_start": 0}), (4, {"crank_start": 0}), (5, {}), (8, {})],
)
def test_function_generation(count, given):
    """Angles of a drawn four-bar: it is found, and every linkage found meets the loop's equation."""
    cranks = np.linspace(0.3, 2.4, count)
    rockers = np.array([drawn(x)[0] for x in cranks])
    found = symgen.synthesise(
        {"kind": "function", "input": cranks.tolist(), "output": rockers.tolist(), **given}
    )
    assert has(found, (A, B, C, D))
    for design in found.designs:
        if design.linkage.error > 1e-9 or design.faults:
            continue
        a, b, c, d = design.linkage.lengths.values()
        k = design.linkage
        turned = math.atan2(*(k.A - k.O)[::-1]) - cranks[0], math.atan2(*(k.B - k.C)[::-1]) - rockers[0]
        for x, y in zip(cranks + turned[0], rockers + turned[1], strict=True):
            gap = np.array([d + c * math.cos(y) - a * math.cos(x), c * math.sin(y) - a * math.sin(x)])
            assert np.hypot(*gap) == pytest.approx(b, rel=1e-9)


def test_motion_generation_of_five_poses():
    """Burmester's problem: the drawn linkage and its inversions are found, all of them rigid in the poses."""
    poses = [drawn(x) for x in (0.3, 0.9, 1.6, 2.4, 3.5)]
    places, angles = [p for _, _, p in poses], [float(t) for _, t, _ in poses]
    found = symgen.synthesise({"kind": "motion", "points": in_metres(places), "angles": angles})
    assert has(found, (A, B, C, D))
    best = found.designs[0]
    assert not best.faults
    for design in found.designs:
        k = design.linkage
        for ground, joint in ((k.O, k.A), (k.C, k.B)):
            arm = joint - k.P
            reach = []
            for place, angle in zip(places, angles, strict=True):
                c, s = math.cos(angle - angles[0]), math.sin(angle - angles[0])
                reach.append(np.hypot(*(place + [c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]] - ground)))
            assert np.ptp(reach) < 1e-9 * max(reach)


def test_motion_generation_with_given_pivots():
    poses = [drawn(x) for x in (0.3, 0.9, 1.6)]
    found = symgen.synthesise(
        {"kind": "motion", "points": in_metres(p for _, _, p in poses), "angles": [float(t) for _, t, _ in poses],
         "ground_x": ["0 m", "1 m"], "ground_y": ["0 m", "0 m"]}
    )  # fmt: skip
    assert lengths(found)[0] == pytest.approx((A, B, C, D), rel=1e-9) and not found.designs[0].faults
    page = render_study(synthesis_study(found), "task")
    assert page.count('<figure class="drawing">') == len(found.designs)
    assert not re.findall(r'<rect[^>]*fill="#fff', page)  # no white paper on a dark page
    assert all(f'<td class="n">{x:.6g}</td>' in page for x in (A, B, C, D))


@pytest.mark.parametrize(
    ("given", "cranks"),
    [
        ((0.7, 0.7, 0.8), (1.5, 0.6, -0.3)),  # the crank cannot point away from the rocker's ground point
        ((0.9, 1.6, 0.6), (2.4, 3.1, 3.9)),  # nor here towards it: its range holds the wrapped angle
    ],
)
@pytest.mark.parametrize("clockwise", [False, True])
def test_cranks_that_do_not_turn_pass_their_poses_either_way(given, cranks, clockwise):
    """A drawn triple-rocker is found without faults, whichever way its crank swings through the poses."""
    cranks = sorted(cranks, reverse=clockwise)
    rockers, angles, places = zip(*(drawn(x, *given) for x in cranks), strict=True)
    wrapped = [math.remainder(x, 2 * math.pi) for x in cranks]
    tasks = [
        {"kind": "motion", "points": in_metres(places), "angles": [*angles], "ground_x": ["0 m", "1 m"],
         "ground_y": ["0 m", "0 m"], "starts": 4},
        {"kind": "function", "input": wrapped, "output": [*rockers], "crank_start": 0, "rocker_start": 0, "starts": 20},
    ]  # fmt: skip
    for task in tasks:
        found = symgen.synthesise(task).designs
        own = [d for d in found if np.allclose([*d.linkage.lengths.values()], (*given, D), rtol=1e-8)]
        assert own and own[0].linkage.grashof == "triple-rocker" and not own[0].faults, task["kind"]


@pytest.mark.parametrize("seed", range(12))
def test_a_crank_stops_where_circles_about_its_end_and_the_rockers_ground_no_longer_meet(seed):
    a, b, c = np.random.default_rng(seed).uniform(0.3, 2.0, 3)

    def met(crank):
        e = abs(a * np.exp(1j * crank) - D)
        return (e < b + c) & (e > abs(b - c))

    directions = np.linspace(-np.pi, np.pi, 2001)
    start = float(np.random.default_rng(seed).choice(directions[met(directions)]))
    _, coupler, _ = drawn(start, a, b, c)
    joint = a * np.array([math.cos(start), math.sin(start)])
    end = joint + b * np.array([math.cos(coupler), math.sin(coupler)])
    linkage = FourBar([0.0, 0.0], joint, end, [D, 0.0], end)
    for way, stop in zip((-1, 1), linkage.swing, strict=True):
        turned = start + way * np.linspace(0.0, 2 * np.pi, 100_001)
        if met(turned).all():
            assert math.isinf(stop)
            continue
        assert way * (stop - turned[~met(turned)][0]) == pytest.approx(0.0, abs=1e-4)
        inside, outside = stop - way * 1e-3, stop + way * 1e-3
        angle = linkage.angles([start, inside])["coupler.angle"].values[-1]
        assert math.remainder(angle - drawn(inside, a, b, c)[1], 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
        with pytest.raises(SimulationError, match=re.escape(f"stops at {math.degrees(stop) % 360:.6g} deg")):
            linkage.angles([start, outside])


def test_a_path_and_the_faults_of_branch_and_order():
    """Through five points of a drawn path: faultless linkages pass them in order when the test runs them."""
    cranks = np.linspace(0.3, 5.6, 9)[:5]
    places = [drawn(x)[2] for x in cranks]
    task = {
        "kind": "path",
        "points": in_metres(places),
        "ground_x": ["0 m", "1 m"],
        "ground_y": ["0 m", "0 m"],
    }
    found = symgen.synthesise({**task, "starts": 80})
    assert has(found, (A, B, C, D))
    few = {**task, "starts": 8}
    assert lengths(symgen.synthesise(few)) == lengths(symgen.synthesise(few))  # the seed is the same
    seen = set()
    for design in found.designs:
        k = design.linkage
        if not k.turns:
            continue
        passed, branch = nearest_passes(k, places)
        in_order = is_in_order(passed)
        assert (not design.faults) == (in_order and branch), design.faults
        seen.add(not design.faults)
    assert seen == {True, False}


def nearest_passes(k, places):
    """Return the crank angles at which a linkage on the branch of its pose passes the places, and if it does."""
    a, b, c, _ = k.lengths.values()
    along = k.C - k.A
    side = np.sign(along[0] * (k.B - k.A)[1] - along[1] * (k.B - k.A)[0])
    frame = (k.B - k.A) / b
    u, v = (k.P - k.A) @ frame, (k.P - k.A) @ np.array([-frame[1], frame[0]])
    angles = np.linspace(0, 2 * np.pi, 40001)
    joint = k.O + a * np.column_stack([np.cos(angles), np.sin(angles)])
    to = k.C - joint
    e = np.hypot(*to.T)
    x = (e * e + b * b - c * c) / (2 * e)
    h = side * np.sqrt(np.maximum(b * b - x * x, 0))
    coupler = ((x[:, None] * to + h[:, None] * np.column_stack([-to[:, 1], to[:, 0]])) / e[:, None]) / b
    points = joint + u * coupler + v * np.column_stack([-coupler[:, 1], coupler[:, 0]])
    gaps = [np.hypot(*(points - p).T) for p in places]
    near = [int(np.argmin(g)) for g in gaps]
    size = max(k.lengths.values())
    return angles[near], all(g[i] < 2e-3 * size for g, i in zip(gaps, near, strict=True))


def is_in_order(angles):
    forward = sum((b - a) % (2 * math.pi) for a, b in pairwise(angles))
    backward = sum((a - b) % (2 * math.pi) for a, b in pairwise(angles))
    return min(forward, backward) < 2 * math.pi


def test_the_scene_of_a_design_runs_and_passes_the_point(tmp_path):
    places = [drawn(x)[2] for x in (0.3, 0.9, 1.6)]
    angles = [drawn(x)[1] for x in (0.3, 0.9, 1.6)]
    found = symgen.synthesise(
        {"kind": "motion", "points": in_metres(places), "angles": angles, "ground_x": ["0 m", "1 m"],
         "ground_y": ["0 m", "0 m"]}
    )  # fmt: skip
    file = tmp_path / "design.toml"
    file.write_text(found.designs[0].linkage.toml())
    assert tomllib.loads(file.read_text())["symgen"] == 1
    model = symgen.build(file)
    run = model.kinematics(at=[0.9, 1.6], over="input")
    assert np.allclose(run["P.position"].values, places[1:], atol=1e-12)
    joint = model.with_parameters(crank_length=1.1 * A, P_along=0, P_across=0).kinematics(
        at=[0.9], over="input"
    )
    assert np.hypot(*joint["P.position"].values[0]) == pytest.approx(1.1 * A, rel=1e-12)


@pytest.mark.parametrize("turn", ["120 rpm", "-120 rpm"])
def test_the_scene_of_a_design_turns_once_at_any_speed_without_coordinates_of_rounding(tmp_path, turn):
    """P is on the coupler, O at the origin and C on the x axis; one revolution takes half a second."""
    task = tmp_path / "task.toml"
    task.write_text(
        'symgen = 1\ntitle = "Drive of a wiper"\n[synthesis]\nkind = "limits"\nfixed_link = "1 m"\n'
        'swing = "60 deg"\nrocker_folded = "40 deg"\ntransmission_least = "40 deg"\n'
    )
    call("synthesise", task, "--out", tmp_path)
    file = tmp_path / "four_bar_1.toml"
    scene = tomllib.loads(file.read_text())
    assert scene["title"] == "Drive of a wiper: four-bar linkage, crank-rocker"
    assert scene["parameters"]["P_across"]["value"] == "0.0 m"
    assert scene["points"]["O"]["at"] == ["0.0 m", "0.0 m"]
    run = symgen.build(file, set={"speed": turn}).kinematics()
    angle = run["crank.angle"].values
    assert run["crank.angle"].time.values[-1] == pytest.approx(0.5, rel=1e-12)
    assert abs(angle[-1] - angle[0]) == pytest.approx(2 * math.pi, rel=1e-12)


@pytest.mark.parametrize("size", [1e-5, 1.0, 1e4])
def test_the_size_of_a_linkage_is_free(size):
    a, b, c = (size * x for x in CASE_2[60, 30, 50])
    found = symgen.synthesise(
        {"kind": "limits", "fixed_link": f"{size} m", "swing": "60 deg", "crank_extended": "30 deg", "crank_folded": "50 deg"}
    )  # fmt: skip
    assert lengths(found)[0] == pytest.approx((a, b, c, size), rel=1e-9) and not found.designs[0].faults
    poses = [drawn(x) for x in (0.3, 0.9, 1.6)]
    found = symgen.synthesise(
        {"kind": "motion", "points": in_metres(size * p for _, _, p in poses), "angles": [float(t) for _, t, _ in poses],
         "ground_x": ["0 m", f"{size} m"], "ground_y": ["0 m", "0 m"]}
    )  # fmt: skip
    assert lengths(found)[0] == pytest.approx([size * x for x in (A, B, C, D)], rel=1e-9)
    assert not found.designs[0].faults


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ({"kind": []}, "expected a kind of synthesis"),
        (  # cranks and rockers that turn alike: parallelograms of any proportions
            {"kind": "function", "input": [0, 0.3, 0.7, 1.1], "output": [0, 0.3, 0.7, 1.1], "crank_start": 0, "rocker_start": 0},
            "no four-bar was found",
        ),
        (  # a rotation of both about one point: the crank would have no end
            {"kind": "function", "input": [0, 0.5, 1], "output": [0, 0.5, 1], "crank_start": "10 deg", "rocker_start": "40 deg"},
            "no four-bar was found",
        ),
        (
            {"kind": "motion", "points": [["0 m", "0 m"], ["1 m", "0 m"]], "angles": [0, 1],
             "ground_x": ["0.5 m", "0.5 m"], "ground_y": ["1 m", "1 m"], "joint_x": ["0 m", "1 m"]},
            "no four-bar was found",
        ),
        (
            {"kind": "motion", "points": [["0 m", "0 m"], ["1 m", "0 m"]], "angles": [0, 1],
             "joint_x": ["0 m", "0 m"], "joint_y": ["1 m", "1 m"], "ground_x": ["0 m", "1 m"]},
            "no four-bar was found",
        ),
        (
            {"kind": "motion", "points": [["0 m", "0 m"], ["1 m", "0 m"]], "angles": [0, 1],
             **{n: ["1 m", "2 m"] for n in ("ground_x", "ground_y", "joint_x", "joint_y", "length")}},
            "expected at least one unknown, got all quantities prescribed",
        ),
        (
            {"kind": "motion", "points": [["0 m", "0 m"], ["1 m", "0 m"]], "angles": [0, 1], "length": ["-1 m", "1 m"]},
            "expected lengths above zero, got -1 m",
        ),
    ],
)  # fmt: skip
def test_degenerate_tasks_are_refused(task, message):
    with pytest.raises(SceneError, match=message):
        symgen.synthesise(task)


def test_swing_and_time_ratio_of_any_crank_rocker():
    """Case II: the crank turns by 180 deg and 50 - 30 deg one way, and by the rest the other way."""
    task = {"kind": "limits", "fixed_link": "1 m", "swing": "60 deg", "crank_extended": "30 deg",
            "crank_folded": "50 deg"}  # fmt: skip
    linkage = symgen.synthesise(task).designs[0].linkage
    run = linkage.angles([0.6, 1.1, 1.9])
    ground = {"ground_x": ["0 m", "1 m"], "ground_y": ["0 m", "0 m"]}
    points, angles = in_metres(run["P.position"].values), run["coupler.angle"].values.tolist()
    found = symgen.synthesise({"kind": "motion", "points": points, "angles": angles, **ground})
    again = next(d for d in found.designs if d.linkage.grashof == "crank-rocker")
    assert again.linkage.lengths == pytest.approx(linkage.lengths, rel=1e-9)
    assert again.quantities["swing"] == pytest.approx(math.radians(60), rel=1e-9)
    assert again.quantities["time_ratio"] == pytest.approx(200 / 160, rel=1e-9)


def test_a_file_that_is_not_there_and_a_scene_in_its_place(tmp_path):
    with pytest.raises(SceneError, match="there is no file called 'none.toml'"):
        symgen.synthesise("none.toml")
    file = tmp_path / "task.toml"
    file.write_text("symgen = 1\n[points]\n")
    with pytest.raises(SceneError, match=r"^task.toml: there is no synthesis in this file\n.*\[synthesis\]"):
        symgen.synthesise(file)
    file.write_text('symgen = 1\n[synthesis]\nkind = "limits"\n')
    with pytest.raises(SceneError, match="'symgen synthesise' reads files with this table"):
        symgen.build(file)


def test_a_function_that_is_missed_by_far_is_a_fault():
    """The rocker would jump to and fro, which it cannot while the crank turns by a third of a revolution."""
    jumps = [0.5 * (i % 2) for i in range(9)]
    found = symgen.synthesise({"kind": "function", "input": [0.2 * i for i in range(9)], "output": jumps})
    for design in found.designs:
        assert design.faults and design.linkage.error > 1e-3
    assert any("are missed by up to" in fault for d in found.designs for fault in d.faults)


def test_a_crank_that_vanishes_in_the_best_transmission_is_a_fault():
    """Centric crank-rockers transmit with less than 90 deg - swing/2, which they tend to as the crank vanishes."""
    task = {"kind": "limits", "fixed_link": "220 mm", "swing": "95 deg", "time_ratio": 1, "starts": 20}
    found = symgen.synthesise({**task, "transmission_least": ["30 deg", "80 deg"]})
    (design,) = found.designs
    assert design.quantities["transmission_minimum"] == pytest.approx(math.radians(90.0 - 95.0 / 2), abs=1e-3)
    assert "the crank has" in design.faults[0] and "prescribe a length" in design.faults[0]
    assert repr(found) == "<Synthesis of four-bars, limits: 1 designs, 0 without a fault>"
    (design,) = symgen.synthesise({**task, "rocker": "70 mm"}).designs
    assert not design.faults
    assert design.linkage.lengths["crank"] == pytest.approx(0.07 * math.sin(math.radians(95.0 / 2)))
