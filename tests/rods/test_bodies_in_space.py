"""Rigid bodies in space on four points: against Newton and Euler, and integrations of Euler's equations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from shared.rich_scenes import (
    BODY,
    JOINTS,
    TORQUE,
    general,
    joined_bodies,
    moments,
    place,
    two_bodies,
    vector,
    written,
)
from shared.states import outputs_at_start

import symgen
from symgen.errors import SceneError

G = 9.81
GRAVITY = {"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}


def body_scene(points, named, mass, centre, inertia, **more):
    body = {
        "points": named,
        "mass": f"{mass!r} kg",
        "centre": vector(centre, "m"),
        "inertia": moments(inertia),
    }
    return {"points": points, "links": {"body": body, **more.pop("links", {})}, **more}


@pytest.mark.parametrize("count", [2, 3, 5])
def test_energy_and_momenta_are_those_of_a_rigid_body(count):
    """Any rigid motion: T = m v^2/2 + w I w/2, with few or many points of the user, coplanar ones too."""
    mass, centre, inertia = general(count)
    rng = np.random.default_rng(count)
    places = {f"P{i}": rng.uniform(-1, 1, 3) for i in range(count)}
    v, w = rng.standard_normal(3), rng.standard_normal(3)
    start = {
        "rates": {"body": vector(w, "rad/s")},
        "velocities": {"P0": vector(v + np.cross(w, places["P0"] - centre), "m/s")},
    }
    outputs = ["kinetic_energy", "momentum", "angular_momentum", "body.angular_velocity", "potential_energy"]
    tables = body_scene(
        {k: place(p) for k, p in places.items()},
        list(places),
        mass,
        centre,
        inertia,
        start=start,
        gravity=GRAVITY,
    )
    model = symgen.build(symgen.Scene(**tables, analysis={"outputs": outputs}))
    assert len(model.description.free) == 4
    assert len(model.description.constraints) == 6
    out = outputs_at_start(model)
    assert out["kinetic_energy"] == pytest.approx(mass * v @ v / 2 + w @ inertia @ w / 2, rel=1e-12)
    assert out["momentum"] == pytest.approx(mass * v, abs=1e-12)
    assert out["angular_momentum"] == pytest.approx(np.cross(centre, mass * v) + inertia @ w, abs=1e-12)
    assert out["body.angular_velocity"] == pytest.approx(w, abs=1e-12)
    assert out["potential_energy"] == pytest.approx(mass * G * centre[2], abs=1e-12)
    found = model.accelerations()
    alpha = np.linalg.solve(inertia, -np.cross(w, inertia @ w))
    for k, p in places.items():
        r = p - centre
        exact = [0, 0, -G] + np.cross(alpha, r) + np.cross(w, np.cross(w, r))
        assert found[k] == pytest.approx(exact, abs=1e-11)


def cross(a, b):
    """Return a x b, in a tenth of the time of ``numpy.cross``."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def euler(inertia, w, times, moment=None):
    """Integrate Euler's equations with a quaternion in body axes; return rotations and rates in space at times.

    ``moment``: that in space at a rotation; none when absent.
    """
    inverse = np.linalg.inv(inertia)

    def rhs(_, y):
        q, w = y[:4], y[4:]
        x, s = q[:3], q[3]
        torque = -cross(w, inertia @ w)
        if moment:
            turn = Rotation.from_quat(q / np.linalg.norm(q))
            torque += turn.inv().apply(moment(turn))
        return [*(0.5 * (s * w + cross(x, w))), -0.5 * (x @ w), *(inverse @ torque)]

    span, start = (0, times[-1]), [0, 0, 0, 1, *w]
    y = solve_ivp(rhs, span, start, method="DOP853", rtol=1e-13, atol=1e-14, t_eval=times).y.T
    turns = Rotation.from_quat(y[:, :4])
    return turns, turns.apply(y[:, 4:])


def test_the_intermediate_axis_flips():
    """A free body spun about its middle axis tumbles (Dzhanibekov): against Euler's equations."""
    inertia = np.diag([0.02, 0.05, 0.06])
    w = np.array([0.01, 6.0, 0.0])
    tip = np.array([0.2, 0.0, 0.3])
    tables = body_scene(
        {"C": place([0, 0, 0]), "T": place(tip)},
        ["C", "T"],
        1.5,
        [0, 0, 0],
        inertia,
        start={"rates": {"body": vector(w, "rad/s")}, "velocities": {"C": vector([0, 0, 0], "m/s")}},
        analysis={"outputs": ["energy", "angular_momentum", "body.angular_velocity", "T.position"]},
    )
    model = symgen.build(symgen.Scene(**tables))
    result = model.simulate(4.0, rtol=1e-12)
    turns, rates = euler(inertia, w, np.linspace(0.5, 4, 8))
    turn, rate = turns[-1], rates[-1]
    assert result.final["T"]["position"] == pytest.approx(turn.apply(tip), abs=1e-8)
    assert result.variable("body.angular_velocity").values[-1] == pytest.approx(rate, abs=1e-6)
    middle = result.variable("body.angular_velocity").values
    assert result.drift.energy < 1e-10
    momentum = result.variable("angular_momentum").values
    assert np.max(np.abs(momentum - inertia @ w)) < 1e-10
    assert result.final["C"]["position"] == pytest.approx([0, 0, 0], abs=1e-12)
    # It did flip on the way: in the body the rate about the middle axis changes its sign.
    flipped = turns.inv().apply(rates)[:, 1]
    assert min(flipped) < -5 < 5 < max(flipped)
    assert len(middle) == 201


def test_a_heavy_symmetric_top():
    """Pinned at O, spinning: angles against Euler's equations about the pin; O is a base point, no row added."""
    axis = np.array([np.sin(0.5), 0.0, np.cos(0.5)])
    mass, arm, across, along = 0.8, 0.3, 0.004, 0.006
    centre = arm * axis
    inertia = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    w = 60 * axis + np.array([0.3, -0.2, 0.1])
    tables = body_scene(
        {"O": place([0, 0, 0], ground=True), "C": place(centre)},
        ["O", "C"],
        mass,
        centre,
        inertia,
        gravity=GRAVITY,
        start={"rates": {"body": vector(w, "rad/s")}},
        analysis={"outputs": ["energy", "angular_momentum", "O.reaction", "body.O.force", "C.acceleration"]},
    )
    model = symgen.build(symgen.Scene(**tables))
    assert (len(model.description.free), len(model.description.constraints)) == (3, 6)
    about_pin = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    (turn,), (rate,) = euler(about_pin, w, [1.0], lambda turn: cross(turn.apply(centre), [0, 0, -mass * G]))
    result = model.simulate(1.0, rtol=1e-12)
    assert result.final["C"]["position"] == pytest.approx(turn.apply(centre), abs=1e-8)
    assert result.final["C"]["velocity"] == pytest.approx(np.cross(rate, turn.apply(centre)), abs=1e-7)
    # Nothing turns it about the vertical.
    vertical = result.variable("angular_momentum").values[:, 2]
    assert np.max(np.abs(vertical - vertical[0])) < 1e-9
    assert result.drift.energy < 1e-9
    reaction = mass * (result.variable("C.acceleration").values - [0, 0, -G])
    assert np.max(np.abs(result.variable("O.reaction").values - reaction)) < 1e-8
    assert np.max(np.abs(result.variable("body.O.force").values - reaction)) < 1e-8


def test_a_hinge_by_two_shared_points():
    """Two ground points make a hinge without a redundant row: a compound pendulum about their line."""
    mass, centre, inertia = general(3)
    a, b = np.array([0.1, -0.4, 0.2]), np.array([0.3, 0.5, 0.1])
    axis = (b - a) / np.linalg.norm(b - a)
    tip = np.array([0.7, 0.2, -0.5])
    tables = body_scene(
        {"A": place(a, ground=True), "B": place(b, ground=True), "T": place(tip)},
        ["A", "B", "T"],
        mass,
        centre,
        inertia,
        gravity=GRAVITY,
        start={"rates": {"body": vector(1.5 * axis, "rad/s")}},
        torques=[{"link": "body", "torque": vector([0.3, 0.2, -0.1], "N*m")}],
        analysis={"outputs": ["body.angular_velocity", "energy"]},
    )
    model = symgen.build(symgen.Scene(**tables))
    assert (len(model.description.free), len(model.description.constraints)) == (2, 5)
    r = centre - a
    about = axis @ (inertia + mass * (r @ r * np.eye(3) - np.outer(r, r))) @ axis

    def rhs(_, y):
        arm = Rotation.from_rotvec(y[0] * axis).apply(r)
        return [y[1], axis @ (np.cross(arm, [0, 0, -mass * G]) + [0.3, 0.2, -0.1]) / about]

    end = solve_ivp(rhs, (0, 2), [0, 1.5], rtol=1e-12, atol=1e-13).y[:, -1]
    result = model.simulate(2.0, rtol=1e-12)
    exact = a + Rotation.from_rotvec(end[0] * axis).apply(tip - a)
    assert result.final["T"]["position"] == pytest.approx(exact, abs=1e-8)
    assert result.variable("body.angular_velocity").values[-1] == pytest.approx(end[1] * axis, abs=1e-8)


def test_a_body_joined_to_rods_and_to_another_body():
    """Each body balances by Newton and Euler: nothing of its mass matrix or multipliers is used."""
    scene, bodies = symgen.Scene(**joined_bodies()), two_bodies()
    model = symgen.build(scene)
    assert "M" not in model.description.free
    out, state, found = outputs_at_start(model), model.initial_state(), model.accelerations()
    for k, couple in (("one", -1.0), ("two", 1.0)):
        m, c, inertia = bodies[k]
        base = [p for p in (*JOINTS[k], *(f"{k}_base{i}" for i in (1, 2, 3))) if p in state.positions]
        r = np.array([state.positions[p] for p in base])
        a = np.array([found[p] for p in base])
        w = out[f"{k}.angular_velocity"]
        # Fit a = a_c + alpha x (r - c) + w x (w x (r - c)) to the points of the body.
        rest = a - np.cross(w, np.cross(w, r - c))
        rows = [np.hstack([np.eye(3), -skew(p - c)]) for p in r]
        fit, *_ = np.linalg.lstsq(np.vstack(rows), rest.ravel(), rcond=None)
        assert np.max(np.abs(np.vstack(rows) @ fit - rest.ravel())) < 1e-10
        of_centre, alpha = fit[:3], fit[3:]
        forces = {p: out[f"{k}.{p}.force"] for p in JOINTS[k]}
        assert sum(forces.values()) + [0, 0, -m * G] == pytest.approx(m * of_centre, abs=1e-9)
        moment = sum(np.cross(state.positions[p] - c, f) for p, f in forces.items())
        total = moment + couple * np.array(TORQUE)
        assert total == pytest.approx(inertia @ alpha + np.cross(w, inertia @ w), abs=1e-9)
    assert out["two.B.force"] == pytest.approx(-out["one.B.force"], abs=1e-10)
    assert out["OA.A.force"] == pytest.approx(-out["one.A.force"], abs=1e-10)
    assert out["ME.M.force"] == pytest.approx(-out["one.M.force"], abs=1e-10)
    apart = state.positions["D"] - state.positions["E"]
    load = 2 * apart - 2 * (state.positions["D"] - state.positions["O"])
    assert out["CD.D.force"] == pytest.approx(load, abs=1e-10)
    result = model.simulate(1.0, rtol=1e-11)
    assert result.drift.energy < 1e-8
    assert result.drift.constraint < 1e-14


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def test_a_hinge_between_two_bodies():
    """Two shared points: one distance is kept by the first body, the second adds five rows."""
    (m1, c1, i1), (m2, c2, i2) = general(4), general(5)
    points = {
        "P": place([0, 0, 0]),
        "Q": place([0, 0, 0.8]),
        "A": place([1, 0, 0]),
        "B": place([0.2, 1, 0.1]),
    }
    links = {"one": written(["P", "Q", "A"], m1, c1, i1), "two": written(["P", "Q", "B"], m2, c2, i2)}
    w = np.array([0.3, -0.5, 0.2])
    about = {"one": w + [0, 0, 2.0], "two": w + [0, 0, -1.0]}
    scene = symgen.Scene(
        points=points,
        links=links,
        start={"rates": {k: vector(v, "rad/s") for k, v in about.items()}},
        analysis={"outputs": ["energy", "momentum", "angular_momentum", "one.angular_velocity"]},
    )
    model = symgen.build(scene)
    assert model.description.coordinates - len(model.description.constraints) == 7
    result = model.simulate(3.0, rtol=1e-11)
    assert result.drift.energy < 1e-9
    for word in ("momentum", "angular_momentum"):
        values = result.variable(word).values
        assert np.max(np.abs(values - values[0])) < 1e-8
    assert result.variable("one.angular_velocity").values[0] == pytest.approx(about["one"], abs=1e-12)


def test_mass_and_inertia_may_be_tunable():
    mass, centre, inertia = general(1)
    tables = body_scene(
        {"A": place([0, 0, 0], ground=True), "B": place([1, 0, 0])}, ["A", "B"], mass, centre, inertia
    )
    expected = symgen.build(symgen.Scene(**tables, gravity=GRAVITY)).accelerations()["B"]
    tables["parameters"] = {
        "m": {"value": "1 kg", "tunable": True},
        "i": {"value": "1 kg*m^2", "tunable": True},
    }
    tables["links"]["body"] |= {"mass": "m", "inertia": ["i", *moments(inertia)[1:]]}
    tables["parameters"]["i"]["value"] = moments(inertia)[0]
    model = symgen.build(symgen.Scene(**tables, gravity=GRAVITY))
    assert model.with_parameters(m=mass).accelerations()["B"] == pytest.approx(expected, rel=1e-11)


BAD = {
    "no inertia": ({"inertia": None}, "links.body", "needs mass, centre"),
    "no centre": ({"centre": None}, "links.body", "needs mass, centre"),
    "a fraction": ({"centre": 0.5}, "links.body", "needs mass, centre"),
    "four moments": ({"inertia": ["1 kg*m^2"] * 4}, "links.body.inertia", "three or six"),
    "flat": ({"inertia": ["1 kg*m^2", "1 kg*m^2", "2 kg*m^2"]}, "links.body.inertia", "no thickness"),
    "not real": ({"inertia": ["1 kg*m^2", "1 kg*m^2", "3 kg*m^2"]}, "links.body.inertia", "no real body"),
    "no mass": ({"mass": "0 kg"}, "links.body.mass", "above zero"),
    "a length": ({"length": "1 m"}, "links.body.length", "only a rod"),
    "a unit": ({"inertia": ["1 kg*m^2", "1 kg", "1 kg*m^2"]}, "links.body.inertia.1", "a moment of inertia"),
    "a point twice": ({"points": ["O", "A", "A"]}, "links.body.points", "once"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_bodies_in_space(case):
    change, where, words = BAD[case]
    body = {k: v for k, v in (BODY | change).items() if v is not None}
    points = {"O": place([0, 0, 0], ground=True), "A": place([1, 0, 0]), "B": place([0, 1, 0])}
    links = {"body": body, "AB": {"points": ["A", "B"], "mass": "1 kg"}}
    with pytest.raises(SceneError, match=words) as caught:
        symgen.build(symgen.Scene(points=points, links=links))
    assert caught.value.where == where


def test_a_guide_runs_along_a_rod():
    mass, centre, inertia = general(1)
    points = {"O": place([0, 0, 0], ground=True), "A": place([1, 0, 0]), "B": place([0, 1, 0])}
    tables = body_scene(points, ["O", "A"], mass, centre, inertia, masses=[{"point": "B", "mass": "1 kg"}])
    with pytest.raises(SceneError, match="a guide runs along a rod"):
        symgen.build(symgen.Scene(**tables, guides=[{"points": ["B"], "along": "body"}]))


def test_a_torsion_spring_in_space_takes_rods():
    tables = joined_bodies()
    tables["torsion_springs"] = [{"link": "one", "against": "OA", "stiffness": "1 N*m"}]
    with pytest.raises(SceneError, match="joins two rods") as caught:
        symgen.build(symgen.Scene(**tables))
    assert caught.value.where == "torsion_springs.0"
