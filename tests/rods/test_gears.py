"""Gears in the plane against one equation of motion of the gear train, and closed forms of its torques."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from shared.momentum import solved

import symgen
from symgen.errors import SceneError, SimulationError
from symgen.inspection.picture import linkage_sketch
from symgen.models.momentum.rows import momentum_system
from symgen.scene.resolve import resolve


def at(*place, **more):
    return {"at": [f"{c} m" for c in place], **more}


def wheel(points, mass, inertia):
    """A link with its centre of mass at its first point."""
    return {"points": points, "mass": f"{mass} kg", "centre": 0, "inertia": f"{inertia} kg*m^2"}


#: A pinion on the ground drives a wheel with an unbalanced weight at its rim.
TRAIN = {
    "symgen": 1,
    "parameters": {"w": "9 rad/s", "j": {"value": "0.05 kg*m^2", "tunable": True}},
    "points": {
        "A": at(0, 0, ground=True),
        "B": at(0.08, 0.06),
        "C": at(0.4, 0.1, ground=True),
        "D": at(0.4, 0.35),
    },
    "links": {"pinion": wheel(["A", "B"], 1, 0.004), "wheel": wheel(["C", "D"], 2, "j") | {"inertia": "j"}},
    "masses": [{"point": "D", "mass": "1.5 kg"}],
    "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
    "gears": [{"links": ["pinion", "wheel"], "teeth": [24, 54]}],
    "analysis": {"t_end": "2 s", "outputs": ["B.position", "D.position", "gears.0.torque"]},
}
RATIO, ARM, START = -24 / 54, 0.25, np.arctan2(0.06, 0.08)


def pulled(angle):
    """Torque of the weight at the rim on the wheel at an angle of the pinion from its drawing."""
    return -1.5 * 9.81 * ARM * np.cos(np.pi / 2 + RATIO * angle)


def swing(times, j=0.05, torque=1.2, drag=0.0, spring=0.0, start=0.0, spin=0.0):
    """Angle of the pinion from its drawing, its rate and acceleration, by one equation of motion."""
    whole = 0.004 + RATIO**2 * (j + 1.5 * ARM**2)

    def rate(_, y):
        return [y[1], (torque - drag * y[1] - spring * y[0] + RATIO * pulled(y[0])) / whole]

    y = solve_ivp(
        rate, (0, times[-1]), [start, spin], t_eval=times, rtol=1e-12, atol=1e-13, method="DOP853"
    ).y
    return y[0], y[1], np.array([rate(0, row)[1] for row in y.T])


@pytest.mark.parametrize("method", ["dop853", "radau5"])
def test_a_gear_train_moves_by_one_equation(method):
    scene = TRAIN | {"torques": [{"link": "pinion", "torque": "1.2 N*m"}]}
    run = symgen.build(symgen.Scene(**scene)).simulate(method=method, rtol=1e-11, samples=9)
    angle, _, acceleration = swing(np.asarray(run.time))
    assert np.max(np.abs(angle)) > 6 * np.pi  # over revolutions of both
    turned = START + angle
    expected = 0.1 * np.stack([np.cos(turned), np.sin(turned)], 1)
    assert np.asarray(run["B.position"]) == pytest.approx(expected, abs=2e-8)
    of_wheel = np.pi / 2 + RATIO * angle
    expected = np.array([0.4, 0.1]) + ARM * np.stack([np.cos(of_wheel), np.sin(of_wheel)], 1)
    assert np.asarray(run["D.position"]) == pytest.approx(expected, abs=2e-8)
    assert np.asarray(run["gears.0.torque"]) == pytest.approx(0.004 * acceleration - 1.2, rel=1e-6)


def test_forces_of_a_driven_gear_train_by_elements():
    """The drive at constant speed holds the weight through the ratio; the ground bears the weights."""
    scene = TRAIN | {"drivers": [{"link": "pinion", "angle": "w*t"}]}
    scene["points"] = TRAIN["points"] | {"B": at(0.1, 0)}
    found = symgen.build(symgen.Scene(**scene)).inverse_dynamics(samples=41)
    t = np.asarray(found.time)
    torque = -RATIO * pulled(9 * t)
    assert np.asarray(found["pinion.torque"]) == pytest.approx(torque, abs=1e-9)
    assert np.asarray(found["gears.0.torque"]) == pytest.approx(-torque, abs=1e-9)
    of_wheel, spin = np.pi / 2 + RATIO * 9 * t, RATIO * 9
    pull = 1.5 * ARM * spin**2 * np.stack([np.cos(of_wheel), np.sin(of_wheel)], 1)
    expected = np.array([0, 3.5 * 9.81]) - pull
    assert np.asarray(found["C.reaction"]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("teeth", [[24, 54], [97, 101], [1, 250]])
def test_driven_gears_keep_their_tooth_over_many_revolutions(teeth):
    scene = TRAIN | {
        "drivers": [{"link": "pinion", "angle": "w*t"}],
        "gears": [{"links": ["pinion", "wheel"], "teeth": teeth}],
        "analysis": {"t_end": "30 s", "outputs": ["D.position"]},
    }
    scene["points"] = TRAIN["points"] | {"B": at(0.1, 0)}
    model = symgen.build(symgen.Scene(**scene))
    for samples in (7, 400):
        found = model.kinematics(samples=samples)
        angle = np.pi / 2 - teeth[0] / teeth[1] * 9 * np.asarray(found.time)
        expected = np.array([0.4, 0.1]) + ARM * np.stack([np.cos(angle), np.sin(angle)], 1)
        assert np.asarray(found["D.position"]) == pytest.approx(expected, abs=1e-9)


def planetary(**more):
    """Sun, planet on a carrier, and a ring with internal teeth that is free to turn."""
    return {
        "symgen": 1,
        "parameters": {"w": "5 rad/s", "v": "2 rad/s"},
        "points": {
            "O": at(0, 0, ground=True), "S": at(0.1, 0), "P": at(0.15, 0), "Q": at(0.2, 0), "R": at(0.3, 0),
        },
        "links": {
            "sun": wheel(["O", "S"], 1, 0.01), "carrier": wheel(["O", "P"], 1, 0.02),
            "planet": wheel(["P", "Q"], 0.5, 0.003), "ring": wheel(["O", "R"], 3, 0.2),
        },
        "gears": [
            {"links": ["sun", "planet"], "teeth": [30, 18], "carrier": "carrier"},
            {"links": ["planet", "ring"], "teeth": [18, 66], "internal": True, "carrier": "carrier"},
        ],
        "analysis": {"t_end": "1 s"},
    } | more  # fmt: skip


def test_a_planetary_gear_obeys_willis():
    """(w_ring - w_c)/(w_sun - w_c) = -30/66; the planet turns by -30/18 of the sun about the carrier."""
    drivers = [{"link": "sun", "angle": "w*t"}, {"link": "carrier", "angle": "v*t"}]
    names = ["ring.angular_velocity", "planet.angular_velocity"]
    scene = planetary(drivers=drivers, analysis={"t_end": "7 s", "outputs": names})
    found = symgen.build(symgen.Scene(**scene)).simulate(samples=11)
    for name, ratio in zip(names, (-30 / 66, -30 / 18), strict=True):
        assert np.asarray(found[name]) == pytest.approx(2 + ratio * 3, rel=1e-10)


def test_a_planetary_gear_accelerates_by_the_inertia_of_two_freedoms():
    """T = sum I w^2/2 over the angles of sun and carrier: the inertia matrix is constant."""
    scene = planetary(torques=[{"link": "sun", "torque": "2 N*m"}, {"link": "ring", "torque": "-3 N*m"}])
    scene["analysis"] = {"t_end": "1 s", "outputs": ["sun.angular_velocity", "carrier.angular_velocity"]}
    run = symgen.build(symgen.Scene(**scene)).simulate(rtol=1e-11, samples=2)
    rows = {"sun": (1, 0), "carrier": (0, 1), "planet": (-30 / 18, 48 / 18), "ring": (-30 / 66, 96 / 66)}
    inertia = {"sun": 0.01, "carrier": 0.02 + 0.5 * 0.15**2, "planet": 0.003, "ring": 0.2}
    whole = sum(j * np.outer(rows[k], rows[k]) for k, j in inertia.items())
    rate = np.linalg.solve(whole, np.array(rows["sun"]) * 2 - np.array(rows["ring"]) * 3)
    ends = [float(run[f"{k}.angular_velocity"][-1]) for k in ("sun", "carrier")]
    assert ends == pytest.approx(rate, rel=1e-8)


def test_a_planetary_gear_with_its_ring_on_the_ground():
    """w_c/w_sun = 1/(1 + 66/30): one freedom; the forces at the ring's points are the couple that holds it."""
    tables = planetary(torques=[{"link": "sun", "torque": "2 N*m"}])
    tables["points"]["R"]["ground"] = True
    tables["links"]["ring"] = {"points": ["O", "R"]}
    names = ["sun.angular_velocity", "carrier.angular_velocity", "O.reaction", "R.reaction"]
    tables["analysis"] = {"t_end": "1 s", "outputs": names}
    run = symgen.build(symgen.Scene(**tables)).simulate(rtol=1e-11, samples=3)
    ratio = 30 / (30 + 66)
    planet = ratio * 48 / 18 - 30 / 18
    whole = 0.01 + ratio**2 * (0.02 + 0.5 * 0.15**2) + planet**2 * 0.003
    assert np.asarray(run["sun.angular_velocity"]) == pytest.approx(
        2 / whole * np.asarray(run.time), rel=1e-8
    )
    assert float(run["carrier.angular_velocity"][-1]) == pytest.approx(ratio * 2 / whole, rel=1e-8)
    # Angular momentum about O: of all links, by the torque on the sun and the couple on the ring.
    momentum = 0.01 + ratio * (0.02 + 0.5 * 0.15**2) + planet * 0.003
    held = momentum * 2 / whole - 2
    assert 0.3 * np.asarray(run["R.reaction"])[:, 1] == pytest.approx(held, rel=1e-8)
    # By elements, at a constant speed: the planet's weight at the end of the carrier.
    tables |= {"drivers": [{"link": "sun", "angle": "w*t"}], "torques": [], "gravity": TRAIN["gravity"]}
    forces = symgen.build(symgen.Scene(**tables)).inverse_dynamics(samples=5)
    moment = 0.5 * 9.81 * 0.15 * np.cos(ratio * 5 * np.asarray(forces.time))
    assert np.asarray(forces["sun.torque"]) == pytest.approx(ratio * moment, rel=1e-10)
    assert 0.3 * np.asarray(forces["R.reaction"])[:, 1] == pytest.approx((1 - ratio) * moment, rel=1e-10)


#: Parameters of the train under loads.
LOADED = {"j": "0.05 kg*m^2", "torque": "1.2 N*m", "drag": "0.02 N*m*s", "spring": "0.03 N*m"}


def loaded():
    """The train with a torque, a drag and a torsion spring on the pinion."""
    values = LOADED | {"m": "2 kg"}
    tunable = {name: {"value": value, "tunable": True} for name, value in values.items()}
    return TRAIN | {
        "parameters": tunable,
        "links": TRAIN["links"] | {"wheel": TRAIN["links"]["wheel"] | {"mass": "m"}},
        "torques": [{"link": "pinion", "torque": "torque - drag*pinion.rate"}],
        "torsion_springs": [{"link": "pinion", "stiffness": "spring", "angle": float(START)}],
    }


@pytest.mark.parametrize(
    ("options", "exact"),
    [({"rtol": 1e-12, "atol": 1e-13}, 1e-8), ({"method": "radau5", "rtol": 1e-12, "atol": 1e-13}, 1e-8)],
)
@pytest.mark.parametrize("outputs", [["B.position.y"], ["B.position.x", "B.position.y"]])
def test_derivatives_along_a_run_are_those_of_one_equation(outputs, options, exact):
    """One output by seven directions is taken back along explicit steps, two go forward."""
    by = [*LOADED, "pinion.angle", "pinion.angle'", "m"]
    model = symgen.build(symgen.Scene(**loaded()))
    how = {"coordinates": ["pinion.angle"], "t_end": 0.5} | options
    found = model.sensitivity(outputs, by, **how).derivatives[0]
    ends, values = np.array([0.0, 0.5]), np.array([0.05, 1.2, 0.02, 0.03, 0.0, 0.0])
    for j, h in enumerate([5e-5, 1e-3, 2e-5, 3e-5, 1e-3, 1e-3]):
        angles = np.array([swing(ends, *(values + s * h * np.eye(6)[j]))[0][-1] for s in (-2, -1, 0, 1, 2)])
        by_angle = 0.1 * np.array([-np.sin(START + angles[2]), np.cos(START + angles[2])])
        expected = by_angle * (np.array([1, -8, 0, 8, -1]) @ angles / (12 * h))
        assert found[:, j] == pytest.approx(expected[-len(outputs) :], rel=exact)
    assert found[:, -1] == pytest.approx(0.0, abs=1e-9)  # the mass of the wheel, at its axis


def test_the_least_torque_that_lifts_the_weight_is_found_by_exact_gradients():
    """It is that at which the one equation reaches the bound."""

    def height(torque):
        return 0.1 + ARM * np.sin(
            np.pi / 2 + RATIO * swing(np.array([0.0, 0.3]), torque=torque, drag=0.02)[0][-1]
        )

    tables = loaded()
    del tables["torsion_springs"], tables["parameters"]["spring"]
    model = symgen.build(symgen.Scene(**tables))
    run = {"t_end": 0.3, "rtol": 1e-10, "atol": 1e-12, "samples": 2}
    bound = (height(0.5) + height(2.0)) / 2
    found = model.optimise(
        {"torque": (0.5, 2.0)}, "torque", {"D.position.final.y": (None, bound)}, "simulate", **run
    )
    expected = brentq(lambda x: height(x) - bound, 0.5, 2.0)
    assert found.converged and found.gradients == "exact"
    assert found.parameters["torque"] == pytest.approx(expected, rel=1e-7)


def test_a_spring_holds_a_gear_train_in_equilibrium_and_swings_with_one_frequency():
    """V = k a^2/2 of the pinion and the weight on the wheel: one angle."""
    spring = {"link": "pinion", "stiffness": "30 N*m", "angle": float(START)}
    model = symgen.build(symgen.Scene(**TRAIN | {"torsion_springs": [spring]}))
    angle = 0.0
    for _ in range(50):
        angle = RATIO * pulled(angle) / 30
    found = model.equilibrium().state.positions["B"]
    assert found == pytest.approx(0.1 * np.array([np.cos(START + angle), np.sin(START + angle)]), rel=1e-9)
    h = 1e-5
    stiff = 30 - RATIO * (pulled(angle + h) - pulled(angle - h)) / (2 * h)
    whole = 0.004 + RATIO**2 * (0.05 + 1.5 * ARM**2)
    assert model.modes().frequencies == pytest.approx(np.sqrt(stiff / whole) / (2 * np.pi), rel=1e-8)


def test_many_runs_in_lanes_are_those_of_one_equation():
    scene = TRAIN | {"torques": [{"link": "pinion", "torque": "1.2 N*m"}]}
    values = np.array([0.03, 0.05, 0.08])
    many = symgen.build(symgen.Scene(**scene)).simulate_many(
        parameters={"j": values}, t_end=1.0, step=1e-3, samples=2
    )
    for j, places in zip(values.tolist(), np.asarray(many["B.position"]), strict=True):
        angle = START + swing(np.array([0.0, 1.0]), j)[0][-1]
        assert places[-1] == pytest.approx(0.1 * np.array([np.cos(angle), np.sin(angle)]), abs=1e-6)


@pytest.mark.parametrize("teeth", [[23, 101], [59, 191]])
def test_an_equilibrium_far_from_the_start_has_the_same_teeth_in_mesh(teeth):
    """Downhill in V = k a^2/2 + m g h of both weights, over the angle a of the pinion."""
    ratio = -teeth[0] / teeth[1]
    scene = TRAIN | {
        "torsion_springs": [{"link": "pinion", "stiffness": "1 N*m", "angle": float(START)}],
        "masses": [*TRAIN["masses"], {"point": "B", "mass": "2 kg"}],
        "gears": [{"links": ["pinion", "wheel"], "teeth": teeth}],
    }

    def slope(a):
        return a + 9.81 * (2 * 0.1 * np.cos(START + a) - 1.5 * ARM * ratio * np.sin(ratio * a))

    path = np.linspace(0, -np.pi, 400)
    below = int(np.argmax(slope(path) < 0))
    angle = START + brentq(slope, path[below - 1], path[below], xtol=1e-13)
    found = symgen.build(symgen.Scene(**scene)).equilibrium().state.positions["B"]
    assert found == pytest.approx(0.1 * np.array([np.cos(angle), np.sin(angle)]), abs=1e-8)


def test_a_run_with_errors_of_teeth_ends():
    scene = TRAIN | {
        "torques": [{"link": "pinion", "torque": "30 N*m"}],
        "gears": [{"links": ["pinion", "wheel"], "teeth": [997, 1009]}],
    }
    with pytest.raises(SimulationError, match="could not be brought back onto the constraints"):
        symgen.build(symgen.Scene(**scene)).simulate(method="rk4", step=0.05)


def test_a_motion_over_poses_that_teeth_are_too_fine_for_is_refused():
    scene = TRAIN | {
        "drivers": [{"link": "pinion", "angle": "w*t"}],
        "gears": [{"links": ["pinion", "wheel"], "teeth": [10007, 31415]}],
        "analysis": {"t_end": "30 s", "outputs": ["D.position"]},
    }
    scene["points"] = TRAIN["points"] | {"B": at(0.1, 0)}
    with pytest.raises(SimulationError, match="gears jump a tooth"):
        symgen.build(symgen.Scene(**scene)).kinematics(samples=7)


def test_a_belt_over_equal_wheels_turns_them_alike():
    """The torque acts on the inertia of both, whatever the carrier does."""
    scene = planetary(
        points={"O": at(0, 0, ground=True), "P": at(0.3, 0), "Q": at(0.5, 0.1)},
        links={"arm": wheel(["O", "P"], 1, 0.01), "platform": wheel(["P", "Q"], 1, 0.01)},
        drivers=[{"link": "arm", "angle": "v*t"}],
    )
    scene["points"] |= {"G": at(0, 0.2, ground=True), "H": at(0.1, 0.2)}
    scene["links"]["pulley"] = wheel(["G", "H"], 1, 0.01)
    scene["gears"] = [
        {"links": ["pulley", "platform"], "teeth": [20, 20], "internal": True, "carrier": "arm"}
    ]
    scene["torques"] = [{"link": "pulley", "torque": "3 N*m"}]
    names = ["pulley.angular_velocity", "platform.angular_velocity", "arm.angular_velocity"]
    scene["analysis"] = {"t_end": "1 s", "outputs": names}
    run = symgen.build(symgen.Scene(**scene)).simulate(samples=5)
    expected = 3 / 0.02 * np.asarray(run.time)
    assert np.asarray(run[names[0]]) == pytest.approx(expected, abs=1e-7)
    assert np.asarray(run[names[1]]) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("tables", [TRAIN, planetary()])
def test_momentum_rows_give_the_accelerations_of_the_equations_of_motion(tables):
    scene = symgen.Scene(**tables | {"torques": [{"link": next(iter(tables["links"])), "torque": "1.2 N*m"}]})
    model, rows = symgen.build(scene), momentum_system(resolve(scene))
    state = model.reached(0.3)
    found, expected = solved(rows, model, state), model.accelerations(state)
    for point in model.description.free:
        of_rows = [found[f"{point}_a{axis}"] for axis in "xy"]
        assert of_rows == pytest.approx(expected.points[point], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("verb", ["simulate", "large_rotation", "modes", "gradient"])
def test_a_wheel_geared_to_the_rocker_of_an_elastic_linkage_is_inertia_of_the_rocker(verb):
    """I (n_rocker/n_wheel)^2; its weight is borne by the ground."""
    points = {
        "A": at(0, 0, ground=True), "B": at(0.05, 0), "C": at(0.25, 0.2), "D": at(0.3, 0, ground=True),
        "E": at(0.5, 0, ground=True), "F": at(0.55, 0),
    }  # fmt: skip
    steel = {"density": "7850 kg/m^3", "section": {"width": "10 mm", "thickness": "2 mm"}}
    links = {
        "crank": {"points": ["A", "B"], "mass": "0.1 kg"},
        "coupler": {"points": ["B", "C"], **steel, "elastic": {"E": "200 GPa", "elements": 3}},
    }
    tables = {
        "parameters": {"rest": "0.004 kg*m^2", "more": {"value": "0.0009 kg*m^2", "tunable": True}},
        "crank": {"link": "crank", "speed": "200 rpm"},
        "analysis": {"outputs": ["C.position", "coupler.C.force", "crank.torque"]},
    }
    geared = {"rocker": wheel(["D", "C"], 0.2, 0.004), "wheel": wheel(["E", "F"], 1, 0) | {"inertia": "more"}}
    alone = {"rocker": wheel(["D", "C"], 0.2, 0) | {"inertia": "rest + more*1.5**2"}}
    gears = [{"links": ["rocker", "wheel"], "teeth": [45, 30]}]
    without = {k: v for k, v in points.items() if k not in "EF"}
    models = [
        symgen.build(symgen.Scene(points=points, links=links | geared, gears=gears, **tables)),
        symgen.build(symgen.Scene(points=without, links=links | alone, **tables)),
    ]
    if verb == "gradient":  # of runs, and of frequencies in a pose
        outputs = ["C.displacement", "coupler.C.curvature"]
        found, expected = (m.simulate(samples=5).gradient(outputs, ["more"]).derivatives for m in models)
        assert found == pytest.approx(expected, rel=1e-8, abs=1e-9 * np.max(np.abs(expected)))
        found, expected = (m.sensitivity(["frequencies"], ["more"], at=0.0).derivatives for m in models)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.max(np.abs(expected)))
        return
    if verb == "modes":
        found, expected = (model.modes(0.0).frequencies for model in models)
        assert found == pytest.approx(expected, rel=1e-9)
        return
    options = {"samples": 5} | ({"t_end": 0.05, "elements": 3} if verb == "large_rotation" else {})
    runs = [getattr(model, verb)(**options) for model in models]
    for name in tables["analysis"]["outputs"]:
        found, expected = (np.asarray(run[name]) for run in runs)
        assert found == pytest.approx(expected, rel=1e-7, abs=1e-8 * np.max(np.abs(expected)))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"links": ["pinion", "pinion"]}, "expected different links"),
        ({"links": ["pinion", "ghost"]}, "there is no link called 'ghost'"),
        ({"teeth": [0, 3]}, "expected numbers of teeth of at least 1"),
        ({"carrier": "wheel"}, "expected different links"),
    ],
)
def test_faults_are_named(change, expected):
    with pytest.raises(SceneError) as failure:
        symgen.build(symgen.Scene(**TRAIN | {"gears": [TRAIN["gears"][0] | change]}))
    assert expected in str(failure.value) and "gears.0" in str(failure.value)


def test_pitch_circles_touch():
    """Sun and planet from outside, planet and ring from inside; internal circles are about one centre."""
    linkage = resolve(symgen.Scene(**planetary()))
    places = {p.name: np.array([float(c) for c in p.at]) for p in linkage.points}
    circles = [line.at for line in linkage_sketch(linkage, places, None).lines if line.kind == "axis"]
    radii = [0.15 * 30 / 48, 0.15 * 18 / 48, 0.15 * 18 / 48, 0.15 * 66 / 48]
    for circle, radius, centre in zip(circles, radii, "OPPO", strict=True):
        assert np.linalg.norm(circle - places[centre], axis=1) == pytest.approx(radius, rel=1e-12)
    assert radii[0] + radii[1] == pytest.approx(0.15) and radii[3] - radii[2] == pytest.approx(0.15)
