"""Lengths, rates, efforts and powers of drives, springs and actuators: the balance of energy and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.errors import SceneError

STEP = 1e-3
#: Differences of eighth order.
CENTRAL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / STEP
INNER = slice(4, -4)
WORK = ["energy", "potential_energy", "power"]

PLANE = {
    "parameters": {
        **{"w": "3 rad/s", "dx": "0.05 m", "c0": "0.45 m", "dc": "0.05 m"},
        **{"f": "20 N", "c": "3 N*s/m", "m": "0.5 N*m"},
    },
    "points": {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "S": {"at": ["0.4 m", "-0.3 m"], "ground": True},
        "G": {"at": ["1.5 m", "0.2 m"], "ground": True, "motion": ["dx*sin(w*t)", "0 m"]},
        "A": {"at": ["0.9 m", "0.3 m"]},
        "M": {"on": "boom", "fraction": 0.5},
        "B": {"at": ["1.2 m", "-0.4 m"]},
    },
    "links": {
        "boom": {"points": ["O", "A"], "mass": "3 kg"},
        "cylinder": {"points": ["S", "M"], "length": "c0 + dc*sin(w*t)"},
        "arm": {"points": ["A", "B"], "mass": "1 kg"},
    },
    "springs": [
        {"between": ["B", "S"], "stiffness": "400 N/m", "length": "0.5 m", "damping": "12 N*s/m"},
        {"between": ["B", "G"], "stiffness": "30 N/m", "length": "0 m"},
    ],
    "actuators": [{"between": ["M", "B"], "force": "f*sin(5*w*t) - c*this.rate"}],
    "torsion_springs": [
        {"link": "arm", "against": "boom", "stiffness": "2 N*m", "angle": "20 deg", "damping": "0.3 N*m*s"}
    ],
    "forces": [{"point": "B", "force": ["-c*B.vx", "f"]}],
    "torques": [{"link": "arm", "torque": "m*cos(w*t)"}],
    "distributed_forces": [
        {"link": "arm", "force": ["3 N/m", "-2 N/m"], "end": ["1 N/m", "5 N/m"], "axes": "link"}
    ],
    "bushings": [
        {
            **{"between": ["S", "A"], "link": "boom", "stiffness": ["70 N/m", "30 N/m"]},
            **{
                "damping": ["4 N*s/m", "1 N*s/m"],
                "angular_stiffness": "1 N*m",
                "angular_damping": "0.1 N*m*s",
            },
        }
    ],
}
SPACE = {
    "parameters": {"w": "3 rad/s", "f": "20 N", "c": "3 N*s/m", "m": "0.5 N*m"},
    "points": {
        "O": {"at": ["0 m", "0 m", "0 m"], "ground": True},
        "S": {"at": ["0.4 m", "-0.3 m", "0.5 m"], "ground": True},
        "A": {"at": ["0.4 m", "0.3 m", "0 m"]},
        "B": {"at": ["0.9 m", "-0.1 m", "0.2 m"]},
    },
    "links": {
        "crank": {"points": ["O", "A"], "mass": "3 kg"},
        "arm": {"points": ["A", "B"], "mass": "1 kg"},
    },
    "joints": [{"point": "O", "links": ["crank"], "kind": "revolute", "axis": [0, 1, 3]}],
    "drivers": [{"link": "crank", "angle": "w*t + 0.3*sin(w*t)"}],
    "springs": [{"between": ["S", "B"], "stiffness": "400 N/m", "length": "0.5 m", "damping": "12 N*s/m"}],
    "actuators": [{"between": ["O", "B"], "force": "f*sin(5*w*t) - c*this.rate"}],
    "torsion_springs": [{"link": "arm", "against": "crank", "stiffness": "2 N*m"}],
    "forces": [{"point": "B", "force": ["-c*B.vx", "f", "f*cos(w*t)"]}],
    "torques": [{"link": "arm", "torque": ["m", "0 N*m", "m*cos(w*t)"]}],
}
GRAVITY = {"plane": ["0.5 m/s^2", "-9.81 m/s^2"], "space": ["0.5 m/s^2", "1 m/s^2", "-9.81 m/s^2"]}
#: Owners of powers that are not the rates of an energy, of which those that dissipate, and of those that are.
PLANE_WORKS = ("cylinder", "G", "actuators.0", "forces.0", "torques.0", "distributed_forces.0")
PLANE_STORES = ("springs.0", "springs.1", "torsion_springs.0", "bushings.0")
CASES = {
    "plane": (PLANE, PLANE_WORKS, PLANE_STORES, ("springs.0", "torsion_springs.0", "bushings.0")),
    "space": (
        *(SPACE, ("crank", "actuators.0", "forces.0", "torques.0")),
        *(("springs.0", "torsion_springs.0"), ("springs.0",)),
    ),
}


def rate(values):
    """Return derivatives by time, without the first and last four."""
    return np.apply_along_axis(lambda y: np.convolve(y, CENTRAL[::-1], mode="valid"), 0, values)


@pytest.fixture(scope="module", params=CASES)
def case(request):
    tables, works, stores, dissipates = CASES[request.param]
    words = [
        *WORK,
        *(f"{x}.power" for x in (*works, *stores)),
        *(f"{x}.dissipated_power" for x in dissipates),
    ]
    for owner in ("springs.0", "actuators.0", *(["springs.1"] if request.param == "plane" else [])):
        words += [f"{owner}.{word}" for word in ("length", "rate", "force")]
    if request.param == "plane":
        words += [f"torsion_springs.0.{word}" for word in ("angle", "rate", "torque")]
        words += [f"cylinder.{word}" for word in ("length", "length_rate", "force", "tension")]
        words += ["bushings.0.force", "bushings.0.torque", "boom.angle", "boom.angular_velocity"]
        words += ["A.position", "A.velocity", "M.position", "M.velocity", "G.reaction", "G.velocity"]
    else:
        words += ["crank.torque", "A.position", "A.velocity"]
    words += ["B.position", "B.velocity"]
    scene = symgen.Scene(
        **tables,
        gravity={"acceleration": GRAVITY[request.param]},
        analysis={"t_end": "0.5 s", "outputs": words},
    )
    model = symgen.build(scene)
    times = np.arange(501) * STEP
    run = model.simulate(0.5, rtol=1e-12, method="dop853", t_eval=times)
    return request.param, lambda name: run[name].values, works, stores, dissipates


def test_powers_add_up_to_the_rate_of_the_energy(case):
    _, of, works, stores, dissipates = case
    scale = np.max(np.abs(of("power")))
    powers = sum(of(f"{x}.power") for x in works) - sum(of(f"{x}.dissipated_power") for x in dissipates)
    assert powers == pytest.approx(of("power"), abs=1e-13 * scale)
    assert rate(of("energy")) == pytest.approx(of("power")[INNER], abs=1e-9 * scale)
    assert all(np.all(of(f"{x}.dissipated_power") >= 0) for x in dissipates)
    assert all(np.ptp(of(f"{x}.power")) > 1e-3 for x in (*works, *stores))


def test_lengths_rates_and_forces_follow_from_the_points(case):
    kind, of, *_ = case
    held = {"plane": {"S": (0.4, -0.3), "O": (0.0, 0.0)}, "space": {"S": (0.4, -0.3, 0.5), "O": (0, 0, 0)}}[
        kind
    ]
    line, moving = of("B.position") - held["S"], of("B.velocity")
    length = np.linalg.norm(line, axis=1)
    rates = np.sum(line * moving, axis=1) / length
    assert of("springs.0.length") == pytest.approx(length, abs=1e-14)
    assert of("springs.0.rate") == pytest.approx(rates, abs=1e-13)
    force = -400 * (length - 0.5) - 12 * rates  # pushes apart
    assert of("springs.0.force") == pytest.approx(force, abs=1e-11)
    assert of("springs.0.power") == pytest.approx(force * rates, abs=1e-10)
    assert of("springs.0.dissipated_power") == pytest.approx(12 * rates**2, abs=1e-11)
    push = of("actuators.0.force")
    assert of("actuators.0.power") == pytest.approx(push * of("actuators.0.rate"), abs=1e-12)
    assert of("actuators.0.rate")[INNER] == pytest.approx(rate(of("actuators.0.length")), abs=1e-8)
    assert push == pytest.approx(
        20 * np.sin(15 * np.arange(501) * STEP) - 3 * of("actuators.0.rate"), abs=1e-12
    )


def test_a_driven_cylinder_pushes_its_ends_apart(case):
    kind, of, *_ = case
    if kind == "space":
        t = np.arange(501) * STEP
        assert of("crank.power") == pytest.approx(of("crank.torque") * (3 + 0.9 * np.cos(3 * t)), abs=1e-11)
        return
    t = np.arange(501) * STEP
    assert of("cylinder.length") == pytest.approx(0.45 + 0.05 * np.sin(3 * t), abs=1e-15)
    assert of("cylinder.length_rate") == pytest.approx(0.15 * np.cos(3 * t), abs=1e-15)
    assert of("cylinder.force") == pytest.approx(-of("cylinder.tension"), abs=0)
    assert of("cylinder.power") == pytest.approx(of("cylinder.force") * of("cylinder.length_rate"), abs=1e-12)
    powers = np.sum(of("G.reaction") * of("G.velocity"), axis=1)
    assert of("G.power") == pytest.approx(powers, abs=1e-12)
    assert of("G.power") == pytest.approx(
        -30
        * (of("B.position") - np.stack([1.5 + 0.05 * np.sin(3 * t), 0.2 + 0 * t], 1))[:, 0]
        * 0.15
        * np.cos(3 * t),
        abs=1e-11,
    )


def test_torsion_springs_and_bushings_have_the_torques_of_their_angles(case):
    kind, of, *_ = case
    if kind == "space":
        return
    (a, b), m = (of("A.position"), of("B.position")), of("boom.angle")
    arm = np.unwrap(np.arctan2(*(b - a).T[::-1])) - m
    assert of("torsion_springs.0.angle") == pytest.approx(arm, abs=1e-12)
    assert of("torsion_springs.0.rate")[INNER] == pytest.approx(rate(arm), abs=1e-9)
    torque = -2 * (arm - np.radians(20)) - 0.3 * of("torsion_springs.0.rate")
    assert of("torsion_springs.0.torque") == pytest.approx(torque, abs=1e-12)
    offset, moving = a - (0.4, -0.3), of("A.velocity")
    force = -np.array([70, 30]) * offset - np.array([4, 1]) * moving
    assert of("bushings.0.force") == pytest.approx(force, abs=1e-11)
    drawn = np.arctan2(0.3, 0.9)
    torque = -(m - drawn) - 0.1 * of("boom.angular_velocity")
    assert of("bushings.0.torque") == pytest.approx(torque, abs=1e-12)
    powers = np.sum(force * moving, axis=1) + torque * of("boom.angular_velocity")
    assert of("bushings.0.power") == pytest.approx(powers, abs=1e-11)


def test_a_spring_without_length_may_be_short():
    """Its length and force are outputs where its points coincide; its rate has no value there."""
    tables = {
        "points": {
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["0 m", "0 m"]},
            "B": {"at": ["1 m", "0 m"]},
        },
        "links": {"AB": {"points": ["A", "B"], "mass": "0 kg"}},
        "masses": [{"point": "A", "mass": "1 kg"}, {"point": "B", "mass": "1 kg"}],
        "springs": [{"between": ["O", "A"], "stiffness": "8 N/m", "length": "0 m"}],
        "start": {"velocities": {"A": ["1 m/s", "0 m/s"], "B": ["1 m/s", "0 m/s"]}},
    }
    words = [f"springs.0.{word}" for word in ("length", "force", "power")]
    run = symgen.build(symgen.Scene(**tables, analysis={"t_end": "1 s", "outputs": words})).simulate(
        rtol=1e-12
    )
    sine, cosine = np.sin(2 * run.time), np.cos(2 * run.time)
    assert run["springs.0.length"].values == pytest.approx(sine / 2, abs=1e-11)
    assert run["springs.0.force"].values == pytest.approx(-4 * sine, abs=1e-10)
    assert run["springs.0.power"].values == pytest.approx(-4 * sine * cosine, abs=1e-10)


@pytest.mark.parametrize("kind", CASES)
def test_the_shaking_moment_about_a_point_is_the_rate_of_moments_of_momentum(kind):
    """Two masses on rods without mass: sums over the accelerations of their recorded positions."""
    size = 2 if kind == "plane" else 3
    tables = {
        "parameters": {"w": "3 rad/s"},
        "points": {
            "O": {"at": ["0.1 m", "0.2 m", "0.3 m"][:size], "ground": True},
            "A": {"at": ["0.5 m", "0.5 m", "0.3 m"][:size]},
            "B": {"at": ["0.9 m", "0.1 m", "0.6 m"][:size]},
            "S": {"at": ["1.4 m", "0.3 m", "-0.2 m"][:size], "ground": True},
        },
        "links": {"OA": {"points": ["O", "A"], "mass": "0 kg"}, "AB": {"points": ["A", "B"], "mass": "0 kg"}},
        "masses": [{"point": "A", "mass": "2 kg"}, {"point": "B", "mass": "3 kg"}],
        "springs": [{"between": ["S", "B"], "stiffness": "90 N/m", "length": "0.2 m", "damping": "2 N*s/m"}],
        "gravity": {"acceleration": GRAVITY[kind]},
    }
    if kind == "plane":
        tables["drivers"] = [{"link": "OA", "angle": "0.643501108793284 + w*t"}]
    words = [
        "A.position",
        "B.position",
        "shaking_force",
        "shaking_moment",
        "S.shaking_moment",
        "O.shaking_moment",
    ]
    model = symgen.build(symgen.Scene(**tables, analysis={"t_end": "0.5 s", "outputs": words}))
    run = model.simulate(0.5, rtol=1e-12, method="dop853", t_eval=np.arange(501) * STEP)
    gravity = np.array([float(g.split()[0]) for g in GRAVITY[kind]])
    padding = [(0, 0), (0, 3 - size)]
    pushes = {}
    for point, mass in (("A", 2.0), ("B", 3.0)):
        places = run[f"{point}.position"].values
        second = rate(rate(places))
        pushes[point] = np.pad(places[8:-8], padding), np.pad(mass * (gravity - second), padding)
    force = sum(push for _, push in pushes.values())
    inner = slice(8, -8)
    assert run["shaking_force"].values[inner] == pytest.approx(force[:, :size], abs=1e-5)
    drawn = {"": (0, 0, 0), "S.": (1.4, 0.3, -0.2), "O.": (0.1, 0.2, 0.3)}
    for owner, place in drawn.items():
        about = np.pad(np.array(place[:size], dtype=float), (0, 3 - size))
        moment = sum(np.cross(there - about, push) for there, push in pushes.values())
        found = run[f"{owner}shaking_moment"].values[inner]
        assert found == pytest.approx(moment[:, 2] if kind == "plane" else moment, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("boom.power", "no driver and no driven length, so no power"),
        ("arm.length", "no driven length, so no length"),
        ("O.power", "O has no motion"),
        ("springs.1.dissipated_power", "there is no output"),
        ("boom.rate", "Record LINK.angular_velocity"),
        ("springs.0.lenght", "Did you mean 'springs.0.length'"),
    ],
)
def test_what_has_no_such_output_is_named(name, text):
    with pytest.raises(SceneError, match=text):
        symgen.build(symgen.Scene(**PLANE, analysis={"outputs": [name]}))


def test_they_have_derivatives_and_run_in_lanes():
    """Derivatives against central differences of runs; many runs against single ones."""
    words = [*("springs.0.power", "springs.0.dissipated_power", "springs.0.force", "cylinder.power", "power")]
    words += ["actuators.0.power", "bushings.0.torque", "O.shaking_moment"]
    tables = {**PLANE, "parameters": {**PLANE["parameters"], "k": {"value": "400 N/m", "tunable": True}}}
    tables["springs"] = [{**PLANE["springs"][0], "stiffness": "k"}, PLANE["springs"][1]]
    model = symgen.build(symgen.Scene(**tables, analysis={"t_end": "0.2 s", "outputs": words}))
    values = [399.9, 400.0, 400.1]
    runs = [model.with_parameters(k=k).simulate(rtol=1e-12, samples=2) for k in values]
    slopes = runs[1].gradient(words, ["k"], coordinates=["arm.angle"])
    many = model.simulate_many({"k": values}, samples=2, rtol=1e-12)
    for word in words:
        before, at, after = (run[word].values[-1] for run in runs)
        found = np.asarray(slopes[word, "k"]).item()
        assert found == pytest.approx((after - before) / 0.2, rel=1e-4, abs=1e-9)
        assert many[word].values[:, -1] == pytest.approx([before, at, after], rel=1e-8)
