"""Bodies in space that a drive rotates about an axis in the ground: torques and reactions."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from shared.redundant_mechanisms import metres, point

import symgen
from symgen.errors import SceneError

CASES = Path(__file__).parents[1] / "cases"
GRAVITY = np.array([0.3, -0.4, -9.81])
MASS, CENTRE = 2.5, np.array([0.4, 0.3, 0.1])
INERTIA = np.array([[0.06, 0.01, -0.005], [0.01, 0.09, 0.008], [-0.005, 0.008, 0.07]])
T = sp.Symbol("t")
START, AXIS = np.array([0.1, -0.2, 0.05]), np.array([0.48, 0.6, 0.64])


def hinged(by, order):
    """Return a body that turns by 0.4 sin(3 t) about an axis, written as a joint or by two ground points."""
    second = START + 0.7 * AXIS
    points = {"P": point(START, True), "K": point([0.9, 0.1, 0.3]), "L": point([0.2, 0.8, -0.1])}
    names = ["P", "K", "L"]
    if by != "joint":
        points["Q"] = point(second, True)
        names.insert(1, "Q")
    xx, yy, zz, xy, xz, yz = (
        f"{INERTIA[i, k]} kg*m^2" for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    )
    body = {"mass": f"{MASS} kg", "centre": metres(CENTRE), "inertia": [xx, yy, zz, xy, xz, yz]}
    tables = {
        "points": points,
        "links": {"body": {"points": [names[i] for i in order if i < len(names)], **body}},
        "parameters": {"w": "3 1/s"},
        "drivers": [{"link": "body", "angle": "0.4*sin(w*t)"}],
        "gravity": {"acceleration": [f"{g} m/s^2" for g in GRAVITY]},
    }
    if by != "points":
        tables["joints"] = [
            {"point": "P", "links": ["body"], "kind": "revolute", "axis": (2 * AXIS).tolist()}
        ]
    return tables


def turned(angle):
    """Return the rotation about the axis."""
    x, y, z = AXIS
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (0, 3, 2, 1), (2, 0, 3, 1)])
@pytest.mark.parametrize("by", ["joint", "points", "both"])
def test_torque_and_reactions_of_a_hinged_body_are_those_of_newton_and_euler(by, order):
    tables = hinged(by, order)
    words = ["body.torque", "body.angle", "body.angular_velocity", "K.position", "P.reaction", "body.P.force"]
    words += ["Q.reaction"] if by != "joint" else []
    scene = symgen.Scene(**tables, analysis={"t_end": "1 s", "outputs": words})
    model = symgen.build(scene, backend="numpy")
    assert model.redundant == ()
    result = model.simulate(samples=6, rtol=1e-10)
    arm = CENTRE - START
    for i, t in enumerate(result["time"].values):
        angle, rate, rise = 0.4 * np.sin(3 * t), 1.2 * np.cos(3 * t), -3.6 * np.sin(3 * t)
        turn = turned(angle)
        r = turn @ arm
        acceleration = rise * np.cross(AXIS, r) + rate**2 * np.cross(AXIS, np.cross(AXIS, r))
        force = MASS * (acceleration - GRAVITY)
        inertia = AXIS @ INERTIA @ AXIS
        torque = inertia * rise + AXIS @ np.cross(r, force)
        at = {word: result[word].values[i] for word in words}
        assert at["body.angle"] == pytest.approx(angle, abs=1e-12)
        assert at["body.angular_velocity"] == pytest.approx(rate * AXIS, abs=1e-9)
        assert at["K.position"] == pytest.approx(START + turn @ ([0.9, 0.1, 0.3] - START), abs=1e-12)
        assert at["body.torque"] == pytest.approx(torque, abs=1e-8)
        ground = at["P.reaction"] + (at["Q.reaction"] if by != "joint" else 0)
        assert ground == pytest.approx(force, abs=1e-8)
        assert at["body.P.force"] == pytest.approx(at["P.reaction"], abs=1e-8)
    assert list(model.accelerations().reactions) == [p for p in tables["points"] if p in "PQ"]


def test_a_cylinder_in_space_gives_the_torque_about_the_hinge():
    """Its stroke keeps the angle 0.4 sin(3 t), at which the body is driven above."""
    tables, foot, tip = hinged("points", (0, 1, 2, 3)), np.array([0.2, 0.9, 0.7]), np.array([0.9, 0.1, 0.3])
    arm = tip - START
    along, level = (AXIS @ arm) * AXIS, START - foot
    fixed, cosine, sine = (
        arm @ arm + level @ level + 2 * level @ along,
        2 * level @ (arm - along),
        2 * level @ np.cross(AXIS, arm),
    )
    tables["points"]["N"] = point(foot, True)
    tables["parameters"] |= {"m": "1 m"}
    bend = "(0.4*sin(w*t))"
    text = f"m*sqrt({fixed} + ({cosine})*cos{bend} + ({sine})*sin{bend})"
    tables["links"]["cylinder"] = {"points": ["N", "K"], "length": text}
    del tables["drivers"]
    analysis = {"t_end": "1 s", "outputs": ["cylinder.tension"]}
    pushed = symgen.build(symgen.Scene(**tables, analysis=analysis), backend="numpy").simulate(
        samples=6, rtol=1e-10
    )
    for t, tension in zip(pushed["time"].values, pushed["cylinder.tension"].values, strict=True):
        angle, rate, rise = 0.4 * np.sin(3 * t), 1.2 * np.cos(3 * t), -3.6 * np.sin(3 * t)
        r = turned(angle) @ (CENTRE - START)
        acceleration = rise * np.cross(AXIS, r) + rate**2 * np.cross(AXIS, np.cross(AXIS, r))
        torque = AXIS @ INERTIA @ AXIS * rise + AXIS @ np.cross(r, MASS * (acceleration - GRAVITY))
        end = turned(angle) @ arm
        stroke = np.cross(AXIS, end) @ (end + level) / np.linalg.norm(end + level)
        assert tension == pytest.approx(-torque / stroke, abs=1e-7)


def test_the_axis_moves_with_its_ground_point():
    tables = hinged("joint", (0, 1, 2))
    tables["points"]["P"]["motion"] = ["0 m", "h*sin(w*t)", "0 m"]
    tables["parameters"]["h"] = "0.1 m"
    scene = symgen.Scene(**tables, analysis={"t_end": "1 s", "outputs": ["K.position"]})
    result = symgen.build(scene, backend="numpy").simulate(samples=4, rtol=1e-10)
    for t, k in zip(result["time"].values, result["K.position"].values, strict=True):
        there = START + turned(0.4 * np.sin(3 * t)) @ ([0.9, 0.1, 0.3] - START)
        assert k == pytest.approx(there + [0, 0.1 * np.sin(3 * t), 0], abs=1e-11)


def test_a_parallel_robot_driven_at_its_arms():
    """The rods keep their lengths, the plate its direction; the drives supply the rate of the energy."""
    scene = symgen.load_scene(CASES / "delta_robot.toml")
    ends = [[np.array(place_of(scene.points[f"H{k}{side}"].at)) for side in "ab"] for k in range(3)]
    axes = [(b - a) / np.linalg.norm(b - a) for a, b in ends]
    model = symgen.build(scene)
    result = model.simulate(samples=201, rtol=1e-10, atol=1e-12)
    times = result["time"].values
    power = sum(
        result[f"arm{k}.torque"].values * (result[f"arm{k}.angular_velocity"].values @ axis)
        for k, axis in enumerate(axes)
    )
    rate = np.gradient(result["energy"].values, times, edge_order=2)
    assert np.max(np.abs(power - rate)[5:-5]) < 2e-3 * np.max(np.abs(rate))
    turns = (
        0.2 * np.sin(2 * np.pi * times),
        0.15 * (np.sin(2 * np.pi * times + 1) - np.sin(1)),
        0.1 * (1 - np.cos(4 * np.pi * times)),
    )
    for k, angle in enumerate(turns):
        assert result[f"arm{k}.angle"].values == pytest.approx(angle, abs=1e-9)
    assert result["plate.angular_velocity"].values == pytest.approx(0, abs=1e-7)


def three_cylinders(drive):
    """Return the scene of three cranks in line on a shaft, driven itself or by a massless rod in one plane."""
    tables = symgen.load_scene(CASES / "three_cylinders.toml").model_dump(exclude_none=True)
    if drive == "shaft":
        del tables["points"]["D0"], tables["links"]["turn"], tables["joints"]
        tables["drivers"] = [{"link": "shaft", "angle": "speed*t"}]
        tables["analysis"]["outputs"] = ["F0.reaction", "F1.reaction", "shaft.torque"]
    return symgen.Scene(**tables)


def one_cylinder(k):
    """Return the crank pin force on the crank, and the torque, of one of the cylinders in its plane."""
    tables = symgen.load_scene(CASES / "three_cylinders.toml").model_dump(exclude_none=True)
    place = {p: tables["points"][f"{p}{k}"]["at"][:2] for p in "OAQR"}
    scene = symgen.Scene(
        parameters=tables["parameters"],
        points={p: {"at": at, "ground": p in "OR"} for p, at in place.items()},
        links={
            "crank": {"points": ["O", "A"], "mass": "0 kg"},
            "rod": {"points": ["A", "Q"], "mass": "0.5 kg", "centre": 0.3},
            "rail": {"points": ["O", "R"]},
        },
        guides=[{"points": ["Q"], "along": "rail"}],
        masses=[{"point": "Q", "mass": "0.6 kg"}],
        drivers=[{"link": "crank", "angle": f"{np.arctan2(*place_of(place['A'])[::-1])} + speed*t"}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2"]},
        analysis={"t_end": "0.025 s", "outputs": ["crank.A.force", "crank.torque"]},
    )
    result = symgen.build(scene, backend="numpy").simulate(samples=6, rtol=1e-11)
    return result["crank.A.force"].values, result["crank.torque"].values


def place_of(texts):
    return [float(text.split()[0]) for text in texts]


@pytest.mark.parametrize("drive", ["shaft", "rod"])
def test_bearings_of_a_shaft_share_the_pin_forces_by_the_lever_rule(drive):
    """The rod that drives a crank pin loads the bearings too; neither has a tension that forces need not."""
    result = symgen.build(three_cylinders(drive), backend="numpy").simulate(samples=6, rtol=1e-11)
    pins = [one_cylinder(k) for k in range(3)]
    torque = sum(t for _, t in pins)
    first = -sum(force * (0.26 - 0.1 * k) / 0.32 for k, (force, _) in enumerate(pins))
    second = -sum(force * (0.06 + 0.1 * k) / 0.32 for k, (force, _) in enumerate(pins))
    f0, f1 = result["F0.reaction"].values[:, :2], result["F1.reaction"].values[:, :2]
    if drive == "shaft":
        moment = result["shaft.torque"].values
    else:
        moment, pushed = result["turn.torque"].values, result["D0.reaction"].values[:, :2]
        a0 = result["A0.position"].values[:, :2]
        across = np.stack([-a0[:, 1], a0[:, 0]], axis=1) / np.sum(a0**2, axis=1)[:, None]
        assert pushed == pytest.approx(across * moment[:, None], abs=1e-6)
        first, second = first - 0.26 / 0.32 * pushed, second - 0.06 / 0.32 * pushed
    assert moment == pytest.approx(torque, abs=1e-7)
    assert f0 == pytest.approx(first, abs=1e-5)
    assert f1 == pytest.approx(second, abs=1e-5)
    if drive == "shaft":
        assert f0[-1, 0] == pytest.approx(-436.8, abs=0.1)


BAD = {
    "no joint": ({"joints": []}, {}, "drivers.0.link", "no revolute joint with the ground"),
    "off the axis": ({}, {"ground": True}, "joints.0.axis", "not on the axis"),
    "no axis": ({"axis": [0, 0, 0]}, {}, "joints.0.axis", "expected a direction"),
    "no ground": ({"point": "L"}, {}, "joints.0.point", "expected a ground point of body"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_hinges_of_bodies(case):
    change, of_point, where, words = BAD[case]
    tables = hinged("joint", (0, 1, 2))
    tables["points"]["K"] |= of_point
    if "joints" in change:
        tables["joints"] = change["joints"]
    else:
        tables["joints"][0] |= change
    with pytest.raises(SceneError, match=words) as caught:
        symgen.build(symgen.Scene(**tables))
    assert caught.value.where == where


MOTIONS = (0.4 * sp.sin(3 * T), sp.Rational(5, 2) * T)
#: Axis of the first body, through two points; the points that both bodies share; masses, centres, inertias.
GROUNDED = (START, START + 0.7 * AXIS)
SHARED = (np.array([0.6, 0.5, 0.4]), np.array([0.8, 0.3, 0.9]))
CENTRES = (CENTRE, np.array([1.0, 0.7, 0.6]))
TIP = np.array([1.3, 0.6, 0.5])


def pair(**more):
    """Two bodies in space: the first turns about an axis in the ground, the second about one in the first."""
    inertia = [f"{INERTIA[i, k]} kg*m^2" for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    points = {"P": point(GROUNDED[0], True), "Q": point(GROUNDED[1], True)}
    points |= {"K": point(SHARED[0]), "L": point(SHARED[1]), "M": point(TIP)}
    names = ("first", "second")
    bodies = {
        name: {"mass": f"{MASS} kg", "centre": metres(c), "inertia": inertia}
        for name, c in zip(names, CENTRES, strict=True)
    }
    links = {"first": {"points": ["P", "Q", "K", "L"]}, "second": {"points": ["K", "M", "L"]}}
    return {
        "points": points,
        "links": {name: links[name] | bodies[name] for name in names},
        "parameters": {"w": "1 1/s"},
        "drivers": [
            {"link": "first", "angle": "0.4*sin(3*w*t)"},
            {"link": "second", "against": "first", "angle": "2.5*w*t"},
        ],
        "gravity": {"acceleration": [f"{g} m/s^2" for g in GRAVITY]},
        "analysis": {
            "t_end": "4 s",
            "outputs": [
                *("first.torque", "second.torque", "second.relative_angle", "M.position", "P.reaction"),
                *(
                    "Q.reaction",
                    "second.K.force",
                    "second.L.force",
                    "second.M.force",
                    "first.K.force",
                    "energy",
                ),
            ],
        },
    } | more


@lru_cache
def newton_euler():
    """Return torques about both axes, the force on the second body and its tip, as a function of the time."""

    def rotation(axis, angle):
        x, y, z = (sp.Float(c, 30) for c in axis / np.linalg.norm(axis))
        cross = sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return sp.eye(3) + sp.sin(angle) * cross + (1 - sp.cos(angle)) * cross * cross

    turns = [rotation(AXIS, MOTIONS[0])]
    turns.append(turns[0] * rotation(SHARED[1] - SHARED[0], MOTIONS[1]))
    start, joint = sp.Matrix(START), turns[0] * sp.Matrix(SHARED[0] - START) + sp.Matrix(START)
    places = [
        start + turns[0] * sp.Matrix(CENTRES[0] - START),
        joint + turns[1] * sp.Matrix(CENTRES[1] - SHARED[0]),
    ]
    forces, moments = [], []
    for turn, place in zip(turns, places, strict=True):
        spin = turn.diff(T) * turn.T
        rate = sp.Matrix([spin[2, 1], spin[0, 2], spin[1, 0]])
        forces.append(MASS * (place.diff(T, 2) - sp.Matrix(GRAVITY)))
        moments.append((turn * sp.Matrix(INERTIA) * turn.T * rate).diff(T))
    at_joint = moments[1] + (places[1] - joint).cross(forces[1])
    whole = sum(
        (m + (r - start).cross(f) for m, r, f in zip(moments, places, forces, strict=True)), sp.zeros(3, 1)
    )
    axis = turns[0] * sp.Matrix((SHARED[1] - SHARED[0]) / np.linalg.norm(SHARED[1] - SHARED[0]))
    tip = joint + turns[1] * sp.Matrix(TIP - SHARED[0])
    torques = sp.Matrix([whole.dot(sp.Matrix(AXIS)), at_joint.dot(axis)])
    return sp.lambdify(T, [torques, forces[1], forces[0] + forces[1], tip], cse=True)


def test_a_body_driven_against_another_one_obeys_newton_and_euler():
    """Over more than a turn of the second body; its forces at the shared points add up, and the rest is zero."""
    model = symgen.build(symgen.Scene(**pair()), backend="numpy")
    assert model.redundant == ()
    result = model.simulate(samples=9, rtol=1e-11)
    for i, t in enumerate(result["time"].values):
        torques, force, whole, tip = (np.ravel(x) for x in newton_euler()(t))
        at = {v.name: v.values[i] for v in result.variables}
        assert at["second.relative_angle"] == pytest.approx(2.5 * t, abs=1e-12)
        assert at["M.position"] == pytest.approx(tip, abs=1e-9)
        assert [at["first.torque"], at["second.torque"]] == pytest.approx(torques, abs=1e-7)
        assert at["second.K.force"] + at["second.L.force"] == pytest.approx(force, abs=1e-7)
        assert at["second.M.force"] == pytest.approx(0, abs=1e-7)
        assert at["P.reaction"] + at["Q.reaction"] == pytest.approx(whole, abs=1e-7)


@pytest.mark.parametrize(
    ("against", "words"),
    [("rod", "share two points"), ("second", "another link"), ("third", "no point in common")],
)
def test_bodies_are_driven_about_two_shared_points_alone(against, words):
    scene = pair()
    scene["points"] |= {f"N{i}": point([2, i, i * i]) for i in range(3)}
    third = scene["links"]["second"] | {"points": ["N0", "N1", "N2"]}
    scene["links"] |= {"rod": {"points": ["K", "L"], "mass": "1 kg"}, "third": third}
    scene["drivers"][1]["against"] = against
    with pytest.raises(SceneError, match=words):
        symgen.build(symgen.Scene(**scene))


def test_assembly_modes_of_driven_links_in_space_turn_as_prescribed():
    """The first mode is the drawn pose: of bodies, and of a rod that is drawn against the x axis."""
    robot = symgen.build(symgen.load_scene(CASES / "delta_robot.toml"), backend="numpy")
    rod = {
        "points": {"O": point([0, 0, 0], True), "A": point([-1, 0.2, 0])},
        "links": {"rod": {"points": ["O", "A"], "mass": "1 kg"}},
        "joints": [{"point": "O", "links": ["rod"], "kind": "revolute", "axis": [0, 0, 1]}],
        "parameters": {"w": "1 1/s"},
        "drivers": [{"link": "rod", "angle": "w*t"}],
        "gravity": {"acceleration": [f"{g} m/s^2" for g in GRAVITY]},
    }
    for model, count in ((robot, 2), (symgen.build(symgen.Scene(**rod), backend="numpy"), 1)):
        modes = model.assemblies()
        assert len(modes) == count
        assert modes[0].q == pytest.approx(model.initial_state().q, abs=1e-9)
