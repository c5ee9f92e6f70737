"""Points at a fraction of a rod, forces on links, momentum: against the balance of each link by itself."""

from __future__ import annotations

import numpy as np
import pytest
from shared.in_numpy import build
from shared.linkages import GRAVITY, G, at, ground
from shared.rich_scenes import LINK_POINTS, rich_scene
from shared.states import outputs_at_start

import symgen
from symgen.errors import SceneError


def planar(d):
    """Return the vector turned left."""
    return np.array([-d[1], d[0]])


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


@pytest.fixture(scope="module")
def rich():
    tables = rich_scene()
    points = tables["points"]
    wanted = [f"{p}.{w}" for p in points for w in ("position", "velocity", "acceleration")]
    wanted += [f"{k}.{p}.force" for k, ps in LINK_POINTS.items() for p in ps]
    wanted += ["O.reaction", "E.reaction", "momentum", "angular_momentum", "energy", "kinetic_energy"]
    wanted += [f"{k}.{w}" for k in LINK_POINTS for w in ("angular_velocity", "angle")]
    model = build(symgen.Scene(**tables, analysis={"outputs": wanted}))
    return model, outputs_at_start(model)


def test_points_on_links_add_no_unknowns(rich):
    model, _ = rich
    assert set(model.description.free) == {"A", "B", "D", "F"}
    assert len(model.description.constraints) == 5


def test_points_on_links_stay_there(rich):
    _, out = rich
    for p, a, b, f in (("P", "O", "A", 0.4), ("Q", "A", "B", -1 / 3), ("H", "P", "D", 1.5)):
        for word in ("position", "velocity", "acceleration"):
            start, end = (out[f"{x}.{word}"] for x in (a, b))
            assert out[f"{p}.{word}"] == pytest.approx(start + f * (end - start), abs=1e-12)


def centres(out):
    """Return mass, moment of inertia, and position, velocity and acceleration of the centre, by link."""
    found = {}
    for k, i, j, m, f in (
        ("OA", "O", "A", 1.2, 0.35),
        ("BE", "B", "E", 0.7, 0.5),
        ("PD", "P", "D", 0.5, 0.5),
    ):
        found[k] = (m, f, i, j)
    found["QF"] = (0.9, 0.5, "Q", "F")
    result = {}
    for k, (m, f, i, j) in found.items():
        r, v, a = (
            out[f"{i}.{w}"] * (1 - f) + out[f"{j}.{w}"] * f for w in ("position", "velocity", "acceleration")
        )
        d = out[f"{j}.position"] - out[f"{i}.position"]
        result[k] = m, m * (d @ d) / 12, r, v, a, (i, j)
    drawn = np.array([1.3, 1.5]) - np.array([0.6, 0.8])
    base = np.array([2.1, 1.3]) - np.array([0.6, 0.8])
    x, y = drawn @ base / (base @ base), cross(base, drawn) / (base @ base)
    parts = []
    for w in ("position", "velocity", "acceleration"):
        d = out[f"B.{w}"] - out[f"A.{w}"]
        parts.append(out[f"A.{w}"] + x * d + y * planar(d))
    result["body"] = 2.0, 0.4, *parts, ("A", "B")
    return result


def motions(out, link):
    """Return angular velocity and acceleration of a link from the motion of its ends."""
    _, _, _, _, _, (i, j) = centres(out)[link]
    d, v, a = (out[f"{j}.{w}"] - out[f"{i}.{w}"] for w in ("position", "velocity", "acceleration"))
    return cross(d, v) / (d @ d), cross(d, a) / (d @ d)


def test_forces_on_every_link_balance_it(rich):
    """Newton and Euler for each link: nothing of the model's mass matrix or multipliers is used."""
    _, out = rich
    w = {k: motions(out, k)[0] for k in LINK_POINTS}
    angle = {k: out[f"{k}.angle"] for k in LINK_POINTS}
    relative = angle["PD"] - angle["OA"] - np.radians(20)
    wrapped = np.arctan2(np.sin(relative), np.cos(relative))
    spring = -2 * wrapped - 0.3 * (w["PD"] - w["OA"])
    motor = 0.8 * np.cos(angle["QF"] - angle["body"]) - 0.8 * (w["QF"] - w["body"])
    couples = {"PD": spring, "OA": -spring, "QF": motor, "body": -motor, "BE": 0.0}
    for k, (m, inertia, r, _, a, _) in centres(out).items():
        forces = {p: out[f"{k}.{p}.force"] for p in LINK_POINTS[k]}
        weight = np.array([0, -m * G])
        assert sum(forces.values()) + weight == pytest.approx(m * a, abs=1e-10)
        moment = sum(cross(out[f"{p}.position"] - r, f) for p, f in forces.items())
        assert moment + couples[k] == pytest.approx(inertia * motions(out, k)[1], abs=1e-10)
        assert out[f"{k}.angular_velocity"] == pytest.approx(w[k], abs=1e-12)


def test_forces_at_a_point_balance_its_loads(rich):
    """All forces on links at a joint add up to the loads there; free ends feel nothing."""
    _, out = rich
    assert out["PD.D.force"] == pytest.approx([0, 0], abs=1e-10)
    assert out["QF.F.force"] == pytest.approx([0, 0], abs=1e-10)
    assert out["OA.A.force"] + out["body.A.force"] == pytest.approx([0, 0], abs=1e-10)
    assert out["QF.Q.force"] + out["body.Q.force"] == pytest.approx([0, 0], abs=1e-10)
    d = out["H.position"]
    load = np.array([-0.7 * out["H.velocity"][0], -3 * out["F.position"][0]]) - 11 * d
    load += 0.3 * (np.array([0, -G]) - out["H.acceleration"])
    assert out["PD.H.force"] == pytest.approx(load, abs=1e-10)
    assert out["OA.O.force"] - 11 * d == pytest.approx(out["O.reaction"], abs=1e-10)
    e = out["E.position"] - out["C.position"]
    length = np.linalg.norm(e)
    rate = e @ (out["E.velocity"] - out["C.velocity"]) / length
    pull = (30 * (length - 1) + 2 * rate) * e / length
    assert out["BE.E.force"] + pull == pytest.approx(out["E.reaction"], abs=1e-10)
    c = out["C.position"] - out["P.position"]
    n = np.linalg.norm(c)
    push = 3 * (1 + n) - 0.7 * (c @ (out["C.velocity"] - out["P.velocity"])) / n
    on_c = pull + push * c / n + 0.4 * (np.array([0, -G]) - out["C.acceleration"])
    assert out["body.C.force"] == pytest.approx(on_c, abs=1e-10)


def test_momentum_and_energy_are_those_of_the_links(rich):
    _, out = rich
    linear = 0.3 * out["H.velocity"] + 0.4 * out["C.velocity"]
    about = 0.3 * cross(out["H.position"], out["H.velocity"]) + 0.4 * cross(
        out["C.position"], out["C.velocity"]
    )
    kinetic = 0.15 * out["H.velocity"] @ out["H.velocity"] + 0.2 * out["C.velocity"] @ out["C.velocity"]
    for k, (m, inertia, r, v, _, _) in centres(out).items():
        w, _ = motions(out, k)
        linear = linear + m * v
        about += m * cross(r, v) + inertia * w
        kinetic += m * (v @ v) / 2 + inertia * w**2 / 2
    assert out["momentum"] == pytest.approx(linear, abs=1e-12)
    assert out["angular_momentum"] == pytest.approx(about, abs=1e-12)
    assert out["kinetic_energy"] == pytest.approx(kinetic, abs=1e-12)


def test_the_energy_balance_closes(rich):
    model, _ = rich
    drift = model.simulate(2.0, rtol=1e-11).drift
    assert drift.energy < 1e-9 * drift.energy_exchanged
    assert drift.constraint < 1e-14


def test_a_rod_hung_at_a_fraction_in_space():
    """A rod pinned at a third of its length swings like a compound pendulum; its pin is no joint of two."""
    tables = {
        "points": {
            "A": {"at": ["-1 m", "0 m", "0 m"]},
            "B": {"at": ["2 m", "0 m", "0 m"]},
            "O": {"at": ["0 m", "0 m", "1 m"], "ground": True},
            "P": {"on": "AB", "fraction": "1/3"},
        },
        "links": {
            "AB": {"points": ["A", "B"], "mass": "3 kg"},
            "OP": {"points": ["O", "P"], "mass": "0.5 kg"},
        },
        "gravity": {"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
        "start": {"rates": {"AB": ["0 rad/s", "0.4 rad/s", "1 rad/s"]}},
        "analysis": {
            "outputs": ["AB.P.force", "OP.P.force", "OP.O.force", "O.reaction", "AB.angular_velocity"]
        },
    }
    model = build(symgen.Scene(**tables))
    assert set(model.description.free) == {"A", "B"}
    out = outputs_at_start(model)
    assert out["AB.P.force"] == pytest.approx(-out["OP.P.force"], abs=1e-12)
    assert out["OP.O.force"] == pytest.approx(out["O.reaction"], abs=1e-12)
    assert out["AB.angular_velocity"] == pytest.approx([0, 0.4, 1], abs=1e-12)
    found = model.accelerations()
    centre = (found["A"] + found["B"]) / 2
    assert out["AB.P.force"] == pytest.approx(3 * (centre + [0, 0, 9.81]), abs=1e-11)
    assert model.simulate(1.0, rtol=1e-11).drift.energy < 1e-9


def bodies_in_a_loop(ground_point, **two):
    """Crank, coupler and rocker, the last two with further points; ``two`` is the rocker."""
    body = {"mass": "1 kg", "inertia": "0.2 kg*m^2"}
    points = {
        "O": ground(0.0, 0.0),
        "A": at(1.0, 0.0),
        "B": at(1.0, 1.0),
        "C": at(2.0, 0.6),
        "D": at(2.0, -0.5),
    }
    links = {
        "OA": {"points": ["O", "A"], "mass": "1 kg"},
        "one": {"points": ["A", "B", "C"], "centre": ["1.3 m", "0.5 m"], **body},
        "two": {"centre": ["2.2 m", "0 m"], **body, **two},
    }
    outputs = [f"{k}.{p}.force" for k, p in (("one", "A"), ("OA", "A"), ("one", "C"), ("two", "C"))]
    return {
        "points": points | ground_point,
        "links": links,
        "gravity": GRAVITY,
        "analysis": {"outputs": [*outputs, "O.reaction"]},
    }


def test_a_joint_with_rows_of_its_own_shows_its_force():
    """The ground point E is the third of its body: the force there is a multiplier, and the reaction."""
    tables = bodies_in_a_loop({"E": ground(3.0, 0.0)}, points=["C", "D", "E"])
    tables["analysis"]["outputs"] += ["two.E.force", "E.reaction"]
    model = build(symgen.Scene(**tables))
    assert set(model.description.free) == {"A", "B", "D"}
    assert model.description.constraints[-2:] == ("two_E_x", "two_E_y")
    out = outputs_at_start(model)
    assert out["two.E.force"] == pytest.approx(out["E.reaction"], abs=1e-12)
    assert out["one.C.force"] == pytest.approx(-out["two.C.force"], abs=1e-12)
    assert out["one.A.force"] == pytest.approx(-out["OA.A.force"], abs=1e-12)
    total = out["O.reaction"] + out["E.reaction"]
    momentum = build(symgen.Scene(**tables | {"analysis": {"outputs": ["momentum"]}}))
    rise = momentum.simulate(1e-4, samples=3, rtol=1e-13)["momentum"].values
    rate = (4 * rise[1] - rise[2] - 3 * rise[0]) / 1e-4
    assert total + [0, -3 * G] == pytest.approx(rate, abs=1e-5)


def test_two_bodies_with_two_joints_in_common_have_one_row_too_many():
    """Each would place a joint of the other: one is carried, the other is a joint with rows, one redundant."""
    model = build(symgen.Scene(**bodies_in_a_loop({}, points=["C", "D", "A"])))
    assert len(model.redundant) == 1
    assert len(model.accelerations().not_unique) > 1


def test_a_point_on_a_rail_is_fixed():
    tables = {
        "points": {
            "O": ground(0.0, 0.0),
            "E": ground(2.0, 0.0),
            "P": {"on": "rail", "fraction": 0.25},
            "A": at(0.5, -1.0),
        },
        "links": {"rail": {"points": ["O", "E"]}, "PA": {"points": ["P", "A"], "mass": "1 kg"}},
        "gravity": GRAVITY,
        "analysis": {"outputs": ["O.reaction", "E.reaction", "P.velocity"]},
    }
    out = outputs_at_start(build(symgen.Scene(**tables)))
    assert out["P.velocity"] == pytest.approx([0, 0], abs=1e-15)
    assert out["O.reaction"] == pytest.approx([0, 0.75 * G], abs=1e-12)
    assert out["E.reaction"] == pytest.approx([0, 0.25 * G], abs=1e-12)


def test_a_force_beyond_the_end_of_a_rod():
    """F at r_i + xi d with xi = 2 on a free rod: the centre feels F, and the lever is 1.5 l."""
    tables = {
        "points": {"A": at(0.0, 0.0), "B": at(2.0, 0.0), "P": {"on": "AB", "fraction": 2}},
        "links": {"AB": {"points": ["A", "B"], "mass": "3 kg"}},
        "forces": [{"point": "P", "force": ["0 N", "6 N"]}],
    }
    found = build(symgen.Scene(**tables)).accelerations()
    alpha = 6 * 3.0 / (3 * 4 / 12)
    assert found["A"] == pytest.approx([0, 2 - alpha], rel=1e-13)
    assert found["B"] == pytest.approx([0, 2 + alpha], rel=1e-13)


BAD = {
    "both": ({"at": ["1 m", "0 m"], "on": "OA", "fraction": 0.5}, "points.P", "either at"),
    "neither": ({}, "points.P", "either at"),
    "no fraction": ({"on": "OA"}, "points.P", "either at"),
    "unknown link": ({"on": "OAA", "fraction": 0.5}, "points.P.on", "'OA'"),
    "itself": ({"on": "AP", "fraction": 0.5}, "points.P", "placed by each other"),
    "ground": ({"on": "OA", "fraction": 0.5, "ground": True}, "points.P", "moves with the link"),
    "a length": ({"on": "OA", "fraction": "2 m"}, "points.P.fraction", "a plain number"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_points_on_links(case):
    point, where, words = BAD[case]
    tables = {
        "points": {"O": ground(0.0, 0.0), "A": at(1.0, 0.0), "P": point},
        "links": {"OA": {"points": ["O", "A"], "mass": "1 kg"}, "AP": {"points": ["A", "P"], "mass": "1 kg"}},
    }
    with pytest.raises(SceneError, match=words) as caught:
        build(symgen.Scene(**tables))
    assert caught.value.where == where


def test_forces_with_a_guide_on_a_moving_link_and_a_drive():
    """A driven crank slides with its end along a lever: each balances, the slider pushes across the lever."""
    tables = {
        "parameters": {"s": "1 s"},
        "points": {"O": ground(0.0, 0.0), "E": ground(0.0, -1.5), "A": at(0.6, 0.5), "B": at(0.9, 1.5)},
        "links": {
            "crank": {"points": ["O", "A"], "mass": "1.1 kg"},
            "lever": {"points": ["E", "B"], "mass": "2 kg"},
        },
        "guides": [{"points": ["A"], "along": "lever"}],
        "drivers": [{"link": "crank", "angle": "0.7 + 2*t/s + 0.8*(t/s)**2"}],
        "gravity": GRAVITY,
    }
    outputs = [
        "crank.O.force",
        "crank.A.force",
        "lever.E.force",
        "lever.B.force",
        "crank.torque",
        "E.reaction",
    ]
    outputs += [f"{p}.{w}" for p in "OEAB" for w in ("position", "acceleration")]
    out = outputs_at_start(build(symgen.Scene(**tables, analysis={"outputs": outputs})))
    on_lever = -out["crank.A.force"]
    along = out["B.position"] - out["E.position"]
    assert on_lever @ along == pytest.approx(0, abs=1e-10)
    assert np.linalg.norm(on_lever) > 1
    assert out["lever.B.force"] == pytest.approx([0, 0], abs=1e-10)
    assert out["lever.E.force"] == pytest.approx(out["E.reaction"], abs=1e-10)
    for mass, i, j, forces, couple in (
        (1.1, "O", "A", {"O": out["crank.O.force"], "A": out["crank.A.force"]}, out["crank.torque"]),
        (2.0, "E", "B", {"E": out["lever.E.force"], "A": on_lever}, 0.0),
    ):
        r, a = ((out[f"{i}.{w}"] + out[f"{j}.{w}"]) / 2 for w in ("position", "acceleration"))
        d, turn = (out[f"{j}.{w}"] - out[f"{i}.{w}"] for w in ("position", "acceleration"))
        assert sum(forces.values()) + [0, -mass * G] == pytest.approx(mass * a, abs=1e-10)
        moment = sum(cross(out[f"{p}.position"] - r, f) for p, f in forces.items())
        assert moment + couple == pytest.approx(mass * cross(d, turn) / 12, abs=1e-10)


def test_forces_with_a_guide_in_space():
    """A bead on a swinging rod: the rod feels the bead's inertia and weight, across itself only."""
    tables = {
        "points": {
            "O": {"at": ["0 m", "0 m", "0 m"], "ground": True},
            "B": {"at": ["0.6 m", "0.9 m", "-0.5 m"]},
            "P": {"at": ["0.3 m", "0.45 m", "-0.25 m"]},
        },
        "links": {"OB": {"points": ["O", "B"], "mass": "1.3 kg"}},
        "masses": [{"point": "P", "mass": "0.7 kg"}],
        "guides": [{"points": ["P"], "along": "OB"}],
        "gravity": {"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
        "start": {"rates": {"OB": ["1 rad/s", "1 rad/s", "3 rad/s"]}},
        "analysis": {
            "outputs": ["OB.O.force", "OB.B.force", "B.acceleration", "P.acceleration", "B.position"]
        },
    }
    out = outputs_at_start(build(symgen.Scene(**tables)))
    weight = np.array([0, 0, -G])
    on_rod = 0.7 * (weight - out["P.acceleration"])
    assert on_rod @ out["B.position"] == pytest.approx(0, abs=1e-10)
    assert out["OB.B.force"] == pytest.approx([0, 0, 0], abs=1e-10)
    total = out["OB.O.force"] + on_rod + 1.3 * weight
    assert total == pytest.approx(1.3 * out["B.acceleration"] / 2, abs=1e-10)


def test_bad_forces_on_links():
    tables = {
        "points": {"O": ground(0.0, 0.0), "E": ground(2.0, 0.0), "A": at(1.0, 1.0)},
        "links": {"OA": {"points": ["O", "A"], "mass": "1 kg"}, "rail": {"points": ["O", "E"]}},
    }
    for output, words in (("OA.E.force", "'OA.A.force'|'OA.O.force'"), ("rail.O.force", "not determined")):
        with pytest.raises(SceneError, match=words):
            build(symgen.Scene(**tables, analysis={"outputs": [output]}))


def test_every_name_the_derivation_gives_is_refused_for_a_tunable_parameter():
    """The names that a scene may not give are written in one place; here is what is really given."""
    from symgen.scene.names import check_names
    from symgen.symbolic.system import System

    tables = rich_scene()
    tables["drivers"] = [{"link": "BE", "angle": "1"}]
    tables["guides"] = [{"points": ["F"], "along": "BE"}]
    system: System = symgen.derive(symgen.Scene(**tables))
    letters = {c.quantity.name for c in system.constants}  # which avoid names that the scene has
    given = {x.name for x in system.quantities()} - {"t"} - letters
    assert {
        "A_x",
        "OA_dx",
        "spring_0_length",
        "actuator_0_dx",
        "BE_drive_lambda",
        "guide_0_F_lambda",
    } <= given
    for name in sorted(given):
        with pytest.raises(SceneError, match="is reserved for"):
            check_names(symgen.Scene(**tables | {"parameters": {name: {"value": 1, "tunable": True}}}))


OFFSET = """
symgen = 1
[parameters]
a = { value = "4 cm", tunable = true }
b = { value = "10 cm", tunable = true }
h = { value = "3 cm", tunable = true }
w = "60 rpm"
[points]
A = { at = ["0 cm", "0 cm"], ground = true }
D = { at = ["12 cm", "0 cm"], ground = true }
B = { at = ["2 cm", "4 cm"] }
C = { at = ["10 cm", "8 cm"] }
P = { on = "coupler", fraction = 0.4, offset = "h" }
[links]
crank = { points = ["A", "B"], length = "a", mass = "0.5 kg" }
coupler = { points = ["B", "C"], length = "b", mass = "0.5 kg" }
rocker = { points = ["D", "C"], length = "9 cm", mass = "0.5 kg" }
[[drivers]]
link = "crank"
angle = "w*t"
[[masses]]
point = "P"
mass = "2 kg"
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
[analysis]
t_end = "1 s"
outputs = ["P.position", "crank.torque"]
"""


def four_bar(time, a, b, h):
    """Return B, C and P of the four-bar at a time, which may be complex, by the triangle B, C, D."""
    crank = 2 * np.pi * time
    joint = np.array([a * np.cos(crank), a * np.sin(crank)])
    d = np.array([0.12, 0.0]) - joint
    squared = d @ d
    along = (squared + b**2 - 0.09**2) / (2 * squared)
    coupler = along * d + np.sqrt(b**2 / squared - along**2) * planar(d)
    return np.array([joint, joint + coupler, joint + 0.4 * coupler + h * planar(coupler) / b])


@pytest.mark.parametrize(("a", "b", "h"), [(0.04, 0.1, 0.03), (0.035, 0.11, -0.02)])
def test_points_off_the_line_keep_their_offset_when_lengths_change(a, b, h, tmp_path):
    file = tmp_path / "offset.toml"
    file.write_text(OFFSET)
    model = build(file).with_parameters(a=a, b=b, h=h)
    times = np.array([0.0, 0.15, 0.4, 0.77])
    places = model.kinematics(at=times, over="time")["P.position"].values
    torques = model.inverse_dynamics(at=times, over="time")["crank.torque"].values
    step = 1e-3

    def velocities(time):
        return four_bar(time + 1e-30j, a, b, h).imag / 1e-30

    for k, t in enumerate(times):
        assert places[k] == pytest.approx(four_bar(t, a, b, h)[2], abs=1e-14)
        v = velocities(t)
        before, last, following, after = (velocities(t + s * step) for s in (-2, -1, 1, 2))
        felt = (before - 8 * last + 8 * following - after) / (12 * step) + np.array([0, 9.81])
        ground = np.array([0, 9.81])
        power = 2.0 * felt[2] @ v[2]  # of the mass at P, and of rods between points 1 and 2
        for v1, v2, a1, a2 in (
            (0 * v[0], v[0], ground, felt[0]),
            (v[0], v[1], felt[0], felt[1]),
            (0 * v[1], v[1], ground, felt[1]),
        ):
            power += 0.5 * ((v1 @ a1 + v2 @ a2) / 3 + (v1 @ a2 + v2 @ a1) / 6)
        assert torques[k] == pytest.approx(power / (2 * np.pi), abs=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('["B", "C"], length', '["B", "C", "A"], length', r"links.coupler\] length.*offset"),
        ('length = "b"', 'length = "b + v*t"', r"points.P\] offset.*depends on the time"),
        ('on = "coupler", fraction = 0.4', 'at = ["1 cm", "1 cm"]', r"points\] P.*either at, or on and"),
        ('offset = "h"', 'offset = "h*h"', r"points.P\] offset.*length"),
    ],
)
def test_offsets_that_mean_nothing_are_refused(old, new, told, tmp_path):
    file = tmp_path / "offset.toml"
    file.write_text(OFFSET.replace(old, new).replace("[parameters]", '[parameters]\nv = "1 m/s"'))
    with pytest.raises(SceneError, match=f"(?s){told}"):
        build(file)


def test_lines_in_space_have_no_points_off_them(tmp_path):
    space = OFFSET.replace(' cm"]', ' cm", "0 cm"]').replace('-9.81 m/s^2"]', '-9.81 m/s^2", "0 m/s^2"]')
    file = tmp_path / "offset.toml"
    file.write_text(space)
    with pytest.raises(SceneError, match=r"(?s)points.P\] offset.*space has no left side"):
        build(file)
