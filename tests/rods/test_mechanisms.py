"""Bodies, guides, drivers, torques and moving ground against independent derivations and closed forms."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.golden import reference
from shared.in_numpy import build
from shared.linkages import GRAVITY, G, at, ground

import symgen
from symgen.errors import SceneError


def test_prismatic_joint_against_the_reference():
    """A body slides along a rod: both its points are guided on the rod's line."""
    numbers = reference("rods_prismatic_planar")
    points = {
        f"P{i}": {"at": [f"{x} m" for x in place], "ground": i in numbers["fixed"]}
        for i, place in enumerate(numbers["pos"])
    }
    links = {}
    for k, rod in enumerate(numbers["rods"]):
        m, lc, io, length = (float(rod[key]) for key in ("m", "lc", "Io", "l"))
        links[f"L{k}"] = {
            "points": [f"P{rod['i']}", f"P{rod['j']}"],
            "mass": f"{m!r} kg",
            "centre": lc / length,
            "inertia": f"{io - m * lc**2!r} kg*m^2",
        }
    scene = symgen.Scene(
        points=points, links=links, gravity=GRAVITY, guides=[{"points": ["P2", "P3"], "along": "L0"}]
    )
    model = build(scene)
    state = model.state(
        {f"P{i}": [float(x) for x in v] for i, v in enumerate(numbers["pos"])},
        {f"P{i}": [float(x) for x in v] for i, v in enumerate(numbers["vel"])},
    )
    found = model.accelerations(state)
    expected = np.array(numbers["acc"], dtype=float)
    assert np.max(np.abs([found[f"P{i}"] for i in range(4)] - expected)) < 1e-12 * np.max(np.abs(expected))
    assert found.reactions["P0"] == pytest.approx(
        [float(x) for x in numbers["ground_reaction"]["0"]], rel=1e-12
    )


def test_compound_pendulum_with_its_centre_off_the_line():
    """Pinned at O: angle from the vertical obeys I_o theta'' = -m g s sin(theta)."""
    links = {
        "body": {
            "points": ["O", "A", "B"],
            "mass": "3 kg",
            "centre": ["0.2 m", "-0.3 m"],
            "inertia": "0.4 kg*m^2",
        }
    }
    scene = symgen.Scene(
        points={"O": ground(0.0, 0.0), "A": at(0.5, 0.1), "B": at(0.1, -0.7)},
        links=links,
        gravity=GRAVITY,
        analysis={"outputs": ["B.position", "B.velocity", "B.acceleration", "energy"]},
    )
    model = build(scene)
    s, about_pin = np.hypot(0.2, 0.3), 0.4 + 3 * (0.2**2 + 0.3**2)
    start = np.arctan2(0.2, 0.3)
    alpha = -3 * G * s * np.sin(start) / about_pin
    found = model.accelerations()
    assert found["B"] == pytest.approx([-alpha * -0.7, alpha * 0.1], rel=1e-12)
    motion = solve_ivp(
        lambda _, y: [y[1], -3 * G * s * np.sin(y[0]) / about_pin], (0, 1), [start, 0], rtol=1e-12, atol=1e-13
    )
    turned = motion.y[0, -1] - start
    c, w = np.cos(turned), np.sin(turned)
    result = model.simulate(1.0, rtol=1e-12)
    assert result.final["B"]["position"] == pytest.approx([0.1 * c + 0.7 * w, 0.1 * w - 0.7 * c], abs=1e-9)
    assert result.drift.energy < 1e-10


def test_a_ternary_link_equals_the_rods_it_is_made_of():
    """Three massive rods as a rigid triangle, and one body with their mass, centre and inertia."""
    corners = {"A": (0.0, -0.5), "B": (0.6, -0.7), "C": (0.2, -1.2)}
    points = {"O": ground(0.0, 0.0), **{k: at(*v) for k, v in corners.items()}, "T": at(0.4, -1.9)}
    arms = {
        "OA": {"points": ["O", "A"], "mass": "0.5 kg"},
        "CT": {"points": ["C", "T"], "mass": "0.8 kg"},
    }
    sides = {"AB": "1 kg", "BC": "1.4 kg", "CA": "0.7 kg"}
    rods = {k: {"points": list(k), "mass": m} for k, m in sides.items()}
    mass = {k: float(m.split()[0]) for k, m in sides.items()}
    ends = {k: [np.array(corners[c]) for c in k] for k in sides}
    total = sum(mass.values())
    centre = sum(mass[k] * (a + b) / 2 for k, (a, b) in ends.items()) / total
    inertia = sum(
        mass[k] * (np.sum((b - a) ** 2) / 12 + np.sum(((a + b) / 2 - centre) ** 2))
        for k, (a, b) in ends.items()
    )
    body = {
        "points": ["A", "B", "C"],
        "mass": f"{total!r} kg",
        "centre": [f"{x!r} m" for x in centre.tolist()],
        "inertia": f"{float(inertia)!r} kg*m^2",
    }
    a = build(symgen.Scene(points=points, links={**arms, **rods}, gravity=GRAVITY))
    b = build(symgen.Scene(points=points, links={**arms, "body": body}, gravity=GRAVITY))
    first, second = a.accelerations(), b.accelerations()
    for p in points:
        assert second[p] == pytest.approx(first[p], rel=1e-11, abs=1e-11)
    ends = [m.simulate(0.5, rtol=1e-12).final["T"]["position"] for m in (a, b)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


def test_a_body_shares_a_joint_that_has_a_place_already():
    """C is a third point of the body and a pin on the ground: two more rows, one pose only."""
    points = {"O": ground(0.0, 0.0), "A": at(0.0, 1.0), "B": at(1.0, 1.5), "C": ground(1.5, 0.5)}
    links = {
        "crank": {"points": ["O", "A"], "mass": "1 kg"},
        "body": {
            "points": ["A", "B", "C"],
            "mass": "1 kg",
            "centre": ["0.8 m", "1 m"],
            "inertia": "0.1 kg*m^2",
        },
    }
    model = build(symgen.Scene(points=points, links=links, gravity=GRAVITY))
    assert model.description.labels[-1] == "the joint C of link body"
    assert np.max(np.abs(model.accelerations()["A"])) < 1e-12


def slider_crank(angle="10*t*unit", **more):
    return {
        "parameters": {"unit": {"value": "1 rad/s"}},
        "points": {"O": ground(0.0, 0.0), "A": at(0.3, 0.0), "B": at(1.3, 0.0), "E": ground(3.0, 0.0)},
        "links": {
            "crank": {"points": ["O", "A"], "mass": "1 kg"},
            "rod": {"points": ["A", "B"], "mass": "2 kg"},
            "rail": {"points": ["O", "E"]},
        },
        "masses": [{"point": "B", "mass": "3 kg"}],
        "guides": [{"points": ["B"], "along": "rail"}],
        "drivers": [{"link": "crank", "angle": angle}],
        "analysis": {"outputs": ["B.position", "crank.torque", "energy", "B.velocity"]},
        **more,
    }


def test_driven_slider_crank():
    """Position, velocity and acceleration of the slider in closed form; torque from the power balance."""
    model = build(symgen.Scene(**slider_crank()))
    result = model.simulate(2 * np.pi / 10, rtol=1e-12, samples=101)
    r, k, w = 0.3, 1.0, 10.0
    angle = w * result.time
    s = np.sqrt(k**2 - (r * np.sin(angle)) ** 2)
    x = r * np.cos(angle) + s
    v = -w * r * np.sin(angle) * (1 + r * np.cos(angle) / s)
    assert np.max(np.abs(result["B.position"].values[:, 0] - x)) < 1e-12
    assert np.max(np.abs(result["B.velocity"].values[:, 0] - v)) < 1e-10
    assert np.max(np.abs(result["B.position"].values[:, 1])) < 1e-14
    assert result.drift.energy < 1e-8 * result.drift.energy_exchanged
    turned = -1 / w  # power = torque * w
    energy, torque = result["energy"].values, result["crank.torque"].values
    rate = np.gradient(energy, result.time, edge_order=2)
    assert np.max(np.abs(rate[2:-2] + torque[2:-2] / turned)) < 2e-2 * np.max(np.abs(rate))


def test_the_start_follows_the_driver():
    model = build(symgen.Scene(**slider_crank("0.7 + 3*sin(2*t*unit)")))
    state = model.initial_state()
    assert state.positions["A"] == pytest.approx([0.3 * np.cos(0.7), 0.3 * np.sin(0.7)], abs=1e-14)
    assert state.velocities["A"] == pytest.approx([-1.8 * np.sin(0.7), 1.8 * np.cos(0.7)], abs=1e-12)


def test_a_motor_torque_turns_the_crank_like_its_moment_of_inertia_says():
    points = {"O": ground(0.0, 0.0), "A": at(2.0, 0.0)}
    links = {"crank": {"points": ["O", "A"], "mass": "3 kg"}}
    torques = [{"link": "crank", "torque": "8 N*m"}]
    model = build(symgen.Scene(points=points, links=links, torques=torques))
    assert model.accelerations()["A"] == pytest.approx([0, 2 * 8 / (3 * 4 / 3)], rel=1e-13)
    assert model.simulate(1.0, rtol=1e-12).drift.energy < 1e-9


def test_a_torque_between_two_links_keeps_the_angular_momentum():
    """A free pair of rods with an inner motor: linear and angular momentum stay zero."""
    points = {"A": at(0.0, 0.0), "B": at(1.0, 0.2), "C": at(1.7, -0.4)}
    links = {"p": {"points": ["A", "B"], "mass": "1 kg"}, "q": {"points": ["B", "C"], "mass": "2 kg"}}
    scene = symgen.Scene(
        points=points, links=links, torques=[{"link": "q", "against": "p", "torque": "3 N*m"}]
    )
    found = build(scene).accelerations()
    a = {k: np.array(v) for k, v in found.points.items()}
    rates = [1 * (a["A"] + a["B"]) / 2 + 2 * (a["B"] + a["C"]) / 2]
    assert np.max(np.abs(rates)) < 1e-12


def test_moving_ground_shakes_a_pendulum():
    """Ground acceleration a turns gravity: a hanging rod starts as under gravity -a."""
    w, amplitude = 7.0, 0.05
    points = {
        "O": ground(0.0, 0.0, motion=["amplitude*cos(w*t)", "0 m"]),
        "A": at(amplitude, -1.0),
    }
    points["O"]["at"] = ["0 m", "0 m"]
    scene = symgen.Scene(
        parameters={"w": {"value": "7 rad/s"}, "amplitude": {"value": "5 cm"}},
        points=points,
        links={"rod": {"points": ["O", "A"], "mass": "2 kg", "length": "1 m"}},
        gravity=GRAVITY,
        analysis={"outputs": ["O.position", "A.position", "energy"]},
    )
    model = build(scene)
    found = model.accelerations()
    assert found["O"] == pytest.approx([-amplitude * w**2, 0], rel=1e-13)

    def rhs(t, y):
        base = -amplitude * w**2 * np.cos(w * t)
        return [y[1], -1.5 * (G * np.sin(y[0]) + base * np.cos(y[0]))]

    state = model.initial_state()
    rod, turn = (x["A"] - x["O"] for x in (state.positions, state.velocities))
    angle = np.arctan2(rod[0], -rod[1])
    start = [angle, turn[0] * np.cos(angle) + turn[1] * np.sin(angle)]
    motion = solve_ivp(rhs, (0, 2), start, rtol=1e-12, atol=1e-13)
    result = model.simulate(2.0, rtol=1e-12)
    a, o = (np.array(result.final[p]["position"]) for p in "AO")
    assert a - o == pytest.approx([np.sin(motion.y[0, -1]), -np.cos(motion.y[0, -1])], abs=1e-9)
    assert o == pytest.approx([amplitude * np.cos(2 * w), 0], abs=1e-14)
    assert result.drift.energy < 1e-9


def test_a_prescribed_length_pulls_a_mass():
    """A massless actuator between the ground and a mass on it: L'' - L w^2 along, angular momentum across."""
    points = {"O": ground(0.0, 0.0), "A": at(1.0, 0.0)}
    links = {"rope": {"points": ["O", "A"], "mass": "0 kg", "length": "1*unit + 0.2*unit*sin(3*t*rate)"}}
    scene = symgen.Scene(
        parameters={"unit": "1 m", "rate": "1 rad/s"},
        points=points,
        links=links,
        masses=[{"point": "A", "mass": "2 kg"}],
        start={"rates": {"rope": "1.5 rad/s"}},
        analysis={"outputs": ["A.position", "rope.tension", "energy"]},
    )
    result = build(scene).simulate(2.0, rtol=1e-12, samples=41)
    place = result["A.position"].values
    length = 1 + 0.2 * np.sin(3 * result.time)
    assert np.linalg.norm(place, axis=1) == pytest.approx(length, abs=1e-13)
    v = result.final["A"]["velocity"]
    assert place[-1][0] * v[1] - place[-1][1] * v[0] == pytest.approx(1.5, rel=1e-10)
    pull = result["rope.tension"].values
    expected = 2 * (1.5**2 / length**3 + 1.8 * np.sin(3 * result.time))
    assert pull == pytest.approx(expected, rel=1e-8)
    assert result.drift.energy < 1e-9


@pytest.mark.parametrize(
    "centre, inertia, negative",
    [
        (0.5, 0.9, "middle"),
        (0.2, 0.01, "end"),
        (0.8, 0.01, "start"),
        (3.0, 0.5, "middle"),
        (-1.0, 0.2, "middle"),
    ],
)
def test_particles_with_negative_masses(centre, inertia, negative):
    """The equivalent particles may have negative masses: two rods in a row against Lagrange's equations."""
    from symgen.mechanics.rods.particles import particle_masses

    masses = dict(zip(("start", "middle", "end"), particle_masses(1, 1, centre, inertia), strict=True))
    assert masses[negative] < 0
    rod = {"mass": "1 kg", "centre": centre, "inertia": f"{inertia} kg*m^2"}
    scene = symgen.Scene(
        points={"O": ground(0.0, 0.0), "A": at(0.6, -0.8), "B": at(1.4, -0.2)},
        links={"OA": {"points": ["O", "A"], **rod}, "AB": {"points": ["A", "B"], **rod}},
        gravity=GRAVITY,
        start={"rates": {"OA": "0.7 rad/s", "AB": "-1.1 rad/s"}},
    )
    model = build(scene)
    a, b = np.arctan2(-0.8, 0.6), np.arctan2(0.6, 0.8)
    wa, wb, c = 0.7, -1.1, centre
    coupling, turn = c * np.cos(a - b), c * np.sin(a - b)
    matrix = [[inertia + c**2 + 1, coupling], [coupling, inertia + c**2]]
    rhs = [-turn * wb**2 - G * (c + 1) * np.cos(a), turn * wa**2 - G * c * np.cos(b)]
    alpha, beta = np.linalg.solve(matrix, rhs)
    unit = lambda x: np.array([np.cos(x), np.sin(x)])  # noqa: E731
    left = lambda x: np.array([-np.sin(x), np.cos(x)])  # noqa: E731
    tip = alpha * left(a) - wa**2 * unit(a)
    found = model.accelerations()
    assert found["A"] == pytest.approx(tip, rel=1e-12, abs=1e-12)
    assert found["B"] == pytest.approx(tip + beta * left(b) - wb**2 * unit(b), rel=1e-12, abs=1e-12)
    assert model.simulate(1.0, rtol=1e-11).drift.energy < 1e-9


def test_a_massless_outer_end_is_refused():
    """A rod whose mass sits in its inner joint leaves nothing to move its outer end."""
    points = {"O": ground(0.0, 0.0), "A": at(1.0, 0.0), "B": at(2.0, 0.0)}
    rod = {"points": ["A", "B"], "mass": "1 kg", "centre": 0, "inertia": "0 kg*m^2"}
    with pytest.raises(SceneError, match="carries no mass: its acceleration is not determined") as caught:
        build(symgen.Scene(points=points, links={"OA": {"points": ["O", "A"], "mass": "1 kg"}, "AB": rod}))
    assert caught.value.where == "points.B"


@pytest.mark.parametrize("tunable", [False, True])
@pytest.mark.parametrize("along", ["0.2 m", "0.37 m"])
def test_a_body_that_a_single_mass_would_move_is_refused(along, tunable):
    """A strut of three points, one with mass: exact elimination divided by zero, round-off passed for mass."""
    points = {"O": ground(0.0, 0.0), "S": ground(1.0, 1.0), "A": at(1.0, 0.0)}
    points |= {"K": {"at": ["1 m", along]}, "U": at(1.0, 0.5)}
    strut = {"points": ["K", "U", "A"], "mass": "m", "centre": ["1 m", "0.3 m"], "inertia": "0 kg*m^2"}
    data = {
        "points": points,
        "parameters": {"m": {"value": "0 kg", "tunable": tunable}},
        "links": {"arm": {"points": ["O", "A"], "mass": "1 kg"}, "strut": strut},
        "guides": [{"points": ["S"], "along": "strut"}],
    }
    with pytest.raises(SceneError, match="strut has no moment of inertia, .* acceleration of U") as caught:
        build(symgen.Scene(**data))
    assert caught.value.where == "links.strut.inertia"
    held = symgen.Scene(**data, masses=[{"point": "U", "mass": "1 kg"}])
    assert build(held).simulate(0.1).drift.energy < 1e-9


def test_values_set_from_outside_pass_the_checks_of_the_scene():
    """A tunable stiffness, mass or length: the key where it is wrong is named, and the value."""
    scene = symgen.Scene(
        parameters={
            "k": {"value": "9 N/m", "tunable": True},
            "m": {"value": "1 kg", "tunable": True},
            "l": {"value": "1 m", "tunable": True},
        },
        points={"O": ground(0.0, 0.0), "G": ground(0.0, 1.0), "A": {"at": ["l", "0 m"]}},
        links={"OA": {"points": ["O", "A"], "mass": "m"}},
        springs=[{"between": ["G", "A"], "stiffness": "k", "length": "l/2"}],
    )
    assert build(scene, set={"k": "12 N/m"}).parameters["k"] == 12
    for key, value, where, words in (
        ("k", "-3 N/m", "springs.0.stiffness", "at least zero, got 'k', which is -3 N/m"),
        ("m", "-1 kg", "links.OA.mass", "at least zero, got 'm', which is -1 kg"),
        ("l", "0 m", "links.OA.points", "zero length"),
        ("l", "-1 m", "springs.0.length", "at least zero"),
        ("k", "3 N", "parameters.k", "expected a stiffness or a force per length"),
    ):
        with pytest.raises(SceneError, match=words) as caught:
            build(scene, set={key: value})
        assert caught.value.where == where


BAD = {
    "driven twice": ({"drivers": [{"link": "crank", "angle": "0"}] * 2}, "driven twice"),
    "driver unknown": ({"drivers": [{"link": "krank", "angle": "0"}]}, "Did you mean 'crank'"),
    "guide of an end": ({"guides": [{"points": ["A"], "along": "crank"}]}, "belongs to crank already"),
    "start against driver": ({"start": {"rates": {"crank": "1 rad/s"}}}, "driver of this link already"),
    "driven ground": ({"drivers": [{"link": "rail", "angle": "0"}]}, "cannot turn"),
    "over-driven": (
        {"drivers": [{"link": "crank", "angle": "t*unit"}, {"link": "rod", "angle": "t*unit"}]},
        "singular at the start|cannot be assembled|contradict",
    ),
    "no torque": (
        {"drivers": [], "analysis": {"outputs": ["crank.torque"]}},
        "Remove crank.torque from the outputs",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_drives_and_guides(case):
    change, message = BAD[case]
    with pytest.raises(SceneError, match=message):
        build(symgen.Scene(**slider_crank(**change)))


def test_bad_bodies():
    points = {"O": ground(0.0, 0.0), "A": at(1.0, 0.0), "B": at(0.5, 1.0)}
    body = {"points": ["O", "A", "B"], "mass": "1 kg", "centre": ["0.5 m", "0.2 m"]}
    with pytest.raises(SceneError, match="needs its moment of inertia"):
        build(symgen.Scene(points=points, links={"b": body}))
    with pytest.raises(SceneError, match="only a rod has a mass per length"):
        build(
            symgen.Scene(points=points, links={"b": {"points": ["O", "A", "B"], "mass_per_length": "1 kg/m"}})
        )
    two = {k: points[k] for k in "OA"}
    with pytest.raises(SceneError, match="for a massless link"):
        build(
            symgen.Scene(
                parameters={"v": "1 m/s", "l": "1 m"},
                points=two,
                links={"b": {"points": ["O", "A"], "mass": "1 kg", "length": "l + v*t"}},
            )
        )


def test_names_cannot_collide_in_silence():
    """Parameters called like the generator's own temporaries, links like its springs."""
    points = {"O": ground(0.0, 0.0), "A": at(1.0, 0.0), "G": ground(0.0, -1.0)}
    spring = {"between": ["G", "A"], "stiffness": "50 N/m", "length": "0.5 m"}

    def scene(parameter="mass", link="OA"):
        return symgen.Scene(
            parameters={parameter: {"value": "2 kg", "tunable": True}},
            points=points,
            links={link: {"points": ["O", "A"], "mass": parameter}},
            springs=[spring],
            gravity=GRAVITY,
            analysis={"outputs": ["A.position", "kinetic_energy", "energy"]},
        )

    expected = build(scene()).accelerations()["A"]
    for name in ("r4", "d2", "s0", "c0", "l2_0", "y1", "x1", "int", "M_PI", "k2_0"):
        assert build(scene(name)).accelerations()["A"].tolist() == expected.tolist()
    with pytest.raises(SceneError, match=r"\[parameters\] A_x: 'A_x' is "):
        build(scene("A_x"))
    with pytest.raises(SceneError, match=r"\[links\] spring_0: .*\n?.*[Cc]hoose another name"):
        build(scene(link="spring_0"))


def test_the_place_of_a_body_s_centre_does_not_depend_on_the_order_of_its_points():
    """A bar with a hole in its middle, its points listed along it: half its weight at the pivot is m g/4."""
    points = {"O": ground(0.0, 0.0), "M": at(0.3, 0.0), "E": at(1.0, 0.0)}
    bar = {"mass": "2 kg", "inertia": "0.166666666666667 kg*m^2"}
    gravity = {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]}
    outputs = ["O.reaction", "E.acceleration"]
    for listed in itertools.permutations("OME"):
        table = bar | {"points": list(listed)}
        scene = {"points": points, "gravity": gravity, "analysis": {"outputs": outputs}}
        for centre in ({}, {"centre": 0.5}):
            with pytest.raises(SceneError, match="position of its centre of mass") as refused:
                build(symgen.Scene(**scene, links={"bar": table | centre}))
            assert refused.value.where == "links.bar.centre"
        body = table | {"centre": ["0.5 m", "0 m"]}
        run = build(symgen.Scene(**scene, links={"bar": body})).simulate(samples=2)
        assert run["O.reaction"].values[0] == pytest.approx([0.0, 2 * 9.81 / 4], abs=1e-12)
        assert run["E.acceleration"].values[0] == pytest.approx([0.0, -1.5 * 9.81], abs=1e-12)


def test_a_massless_body_needs_no_centre():
    points = {"O": ground(0.0, 0.0), "M": at(0.3, 0.0), "E": at(1.0, 0.0)}
    scene = symgen.Scene(
        points=points,
        links={"bar": {"points": ["O", "M", "E"], "mass": "0 kg"}},
        masses=[{"point": "E", "mass": "1 kg"}],
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        analysis={"outputs": ["E.acceleration"]},
    )
    assert build(scene).simulate(samples=2)["E.acceleration"].values[0] == pytest.approx([0, -9.81])
