"""Springs, torsion springs, actuators and motors against closed forms and independent integrations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.linkages import GRAVITY, at, ground
from shared.states import outputs_at_start

import symgen
from symgen.errors import ModelError, SceneError, SimulationError

SPACE = {"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}


def pendulum(angle=0.0, **more):
    """A rod of 1 m and 3 kg (moment about the pin: 1 kg m^2) at an angle from the x axis."""
    return {
        "points": {"O": ground(0.0, 0.0), "A": at(float(np.cos(angle)), float(np.sin(angle)))},
        "links": {"OA": {"points": ["O", "A"], "mass": "3 kg"}},
        **more,
    }


@pytest.mark.parametrize(
    "angle, free", [(0.3, "-0.5"), (2.9, "170 deg"), (-3.0, "170 deg"), (-1.0, "350 deg")]
)
def test_torsion_spring_to_the_ground(angle, free):
    """I theta'' = -k (theta - theta_0) - c theta', also where the angle passes 180 degrees."""
    slack = {"-0.5": -0.5, "170 deg": np.radians(170), "350 deg": np.radians(350)}[free]
    spring = {"link": "OA", "stiffness": "6 N*m", "angle": free, "damping": "0.4 N*m*s"}
    tables = pendulum(angle, torsion_springs=[spring], start={"rates": {"OA": "0.5 rad/s"}})
    tables["analysis"] = {"outputs": ["OA.angular_velocity", "energy", "O.reaction", "A.position"]}
    away = np.arctan2(np.sin(angle - slack), np.cos(angle - slack))
    exact = solve_ivp(
        lambda _, y: [y[1], -6 * y[0] - 0.4 * y[1]], (0, 3), [away, 0.5], rtol=1e-12, atol=1e-13
    )
    result = symgen.build(symgen.Scene(**tables)).simulate(3.0, rtol=1e-11)
    end = exact.y[0, -1] + slack
    assert result.final["A"]["position"] == pytest.approx([np.cos(end), np.sin(end)], abs=1e-9)
    assert result.variable("OA.angular_velocity").values[-1] == pytest.approx(exact.y[1, -1], abs=1e-9)
    assert result.variable("energy").values[0] == pytest.approx(3 * away**2 + 0.125, rel=1e-12)
    assert result.drift.energy < 1e-9


def test_torsion_spring_between_two_free_rods():
    """Two equal rods joined at a point: the joint angle obeys an equation of its own when started evenly."""
    tables = {
        "points": {"A": at(-1.0, 0.2), "B": at(0.0, 0.0), "C": at(1.0, 0.2)},
        "links": {"AB": {"points": ["A", "B"], "mass": "1 kg"}, "BC": {"points": ["B", "C"], "mass": "1 kg"}},
        "torsion_springs": [
            {"link": "BC", "against": "AB", "stiffness": "2 N*m", "angle": "1", "damping": "0.1 N*m*s"}
        ],
        "analysis": {"outputs": ["BC.angle", "AB.angle", "momentum", "angular_momentum", "energy"]},
    }
    result = symgen.build(symgen.Scene(**tables)).simulate(2.0, rtol=1e-11)
    length, half = np.hypot(1, 0.2), np.arctan2(0.2, 1.0)
    # By symmetry the rods turn by +phi and -phi about B, which moves up and down to keep the centre at rest.
    # T = 2 (I_c + m (l/2)^2 cos(phi)^2 ...)/2 phi'^2: each centre moves only along x, by (l/2) cos(phi).
    inertia = 1 * length**2 / 12

    def rhs(_, y):
        phi, w = y
        mass = 2 * (inertia + (length / 2) ** 2 * np.sin(phi) ** 2)
        slope = 2 * (length / 2) ** 2 * 2 * np.sin(phi) * np.cos(phi)
        return [w, (-2 * 2 * (2 * phi - 1) - 0.1 * 2 * 2 * w - slope * w**2 / 2) / mass]

    exact = solve_ivp(rhs, (0, 2), [half, 0], rtol=1e-12, atol=1e-13)
    joint = result.variable("BC.angle").values - result.variable("AB.angle").values
    assert joint[-1] == pytest.approx(2 * exact.y[0, -1], abs=1e-9)
    assert np.max(np.abs(result.variable("momentum").values)) < 1e-11
    assert np.max(np.abs(result.variable("angular_momentum").values)) < 1e-11
    assert result.drift.energy < 1e-10


def test_past_half_a_turn_a_torsion_spring_pulls_the_other_way():
    """As documented: the energy is continuous there, the torque changes sign."""
    found = []
    for angle in (np.pi - 1e-3, np.pi + 1e-3):
        tables = pendulum(angle, torsion_springs=[{"link": "OA", "stiffness": "6 N*m"}])
        model = symgen.build(symgen.Scene(**tables | {"analysis": {"outputs": ["energy"]}}))
        turn = model.accelerations()["A"] @ [-np.sin(angle), np.cos(angle)]
        found.append((turn, outputs_at_start(model)["energy"]))
    assert found[0][0] == pytest.approx(-6 * (np.pi - 1e-3), rel=1e-12)
    assert found[1][0] == pytest.approx(6 * (np.pi - 1e-3), rel=1e-12)
    assert found[0][1] == pytest.approx(found[1][1], rel=1e-12)


def test_bending_in_space_is_regular_everywhere():
    """k (1 - cos bend) straightens two rods: torque k sin(bend), zero in line and folded."""
    for bend in (0.0, 0.7, np.pi / 2, np.pi - 1e-9):
        c, s = (round(float(f(bend)), 15) for f in (np.cos, np.sin))
        tables = {
            "points": {
                "O": {"at": ["0 m", "0 m", "0 m"], "ground": True},
                "A": {"at": ["1 m", "0 m", "0 m"]},
                "B": {"at": [f"{1 + 2 * c!r} m", "0 m", f"{2 * s!r} m"]},
            },
            "links": {
                "OA": {"points": ["O", "A"], "mass": "1 kg"},
                "AB": {"points": ["A", "B"], "mass": "1 kg"},
            },
            "torsion_springs": [{"link": "AB", "against": "OA", "stiffness": "5 N*m"}],
            "analysis": {"outputs": ["energy", "AB.A.force", "O.reaction", "momentum"]},
        }
        model = symgen.build(symgen.Scene(**tables))
        out = outputs_at_start(model)
        assert out["energy"] == pytest.approx(5 * (1 - c), abs=1e-11)
        found = model.accelerations()
        # Moment about the centre of AB: force at A, and -k sin(bend) about y from the spring.
        d, a = np.array([2 * c, 0, 2 * s]), found["B"] - found["A"]
        turning = np.cross(d, a) / 4
        moment = np.cross(-d / 2, out["AB.A.force"]) + [0, 5 * s, 0]
        assert moment == pytest.approx(1 * 4 / 12 * turning, abs=1e-10)
    assert model.simulate(2.0, rtol=1e-11).drift.energy < 1e-8


def test_a_motor_with_a_curve():
    """Torque m0 (1 - w/w0) on a flywheel: w = w0 (1 - exp(-m0 t/(I w0))), work in the balance."""
    tables = pendulum(
        parameters={"m0": {"value": "2 N*m", "tunable": True}, "w0": "30 rad/s"},
        torques=[{"link": "OA", "torque": "m0*(1 - this.rate/w0)"}],
        analysis={"outputs": ["OA.angular_velocity", "energy"]},
    )
    result = symgen.build(symgen.Scene(**tables)).simulate(5.0, rtol=1e-11)
    w = result.variable("OA.angular_velocity").values
    assert w == pytest.approx(30 * (1 - np.exp(-2 * result.time / 30)), abs=1e-8)
    assert result.drift.energy < 1e-9 * result.drift.energy_exchanged


def test_state_in_forces_and_of_links():
    """Drag on the tip, and a torque by the angle of a link that is not its own."""
    tables = pendulum(
        0.2,
        parameters={"c": "0.5 N*s/m", "k": "3 N*m"},
        forces=[{"point": "A", "force": ["-c*A.vx", "-c*A.vy"]}],
        torques=[{"link": "OA", "torque": "-k*sin(OA.angle)"}],
        start={"rates": {"OA": "2 rad/s"}},
    )
    exact = solve_ivp(
        lambda _, y: [y[1], -3 * np.sin(y[0]) - 0.5 * y[1]], (0, 2), [0.2, 2], rtol=1e-12, atol=1e-13
    )
    result = symgen.build(symgen.Scene(**tables)).simulate(2.0, rtol=1e-11)
    end = exact.y[0, -1]
    assert result.final["A"]["position"] == pytest.approx([np.cos(end), np.sin(end)], abs=1e-9)
    assert result.drift.energy < 1e-9


@pytest.mark.parametrize("method", ["dop853", "dopri5", "radau5"])
def test_the_work_of_a_driven_linkage_meets_the_tolerance(method):
    """Drives prescribe the motion, so only work has an error, also where constraints nearly lose rank."""
    tables = {
        "parameters": {"Mf": "3 N*m", "w": "0.05 rad/s", "speed": "45 rpm"},
        "points": {
            "O": ground(0.0, 0.0),
            "C": ground(0.35, 0.0),
            "A": at(0.04, 0.0),
            "B": at(0.34, 0.06),
            "T": {"on": "rocker", "fraction": 7.5},
        },
        "links": {
            "crank": {"points": ["O", "A"], "mass": "0.1 kg"},
            "coupler": {"points": ["A", "B"], "mass": "0.25 kg", "length": "0.35 m"},
            "rocker": {"points": ["C", "B"], "mass": "0.15 kg", "length": "0.06 m"},
        },
        "masses": [{"point": "T", "mass": "0.3 kg"}],
        "gravity": GRAVITY,
        "torques": [{"link": "rocker", "torque": "-Mf*tanh(rocker.rate/w)"}],
        "drivers": [{"link": "crank", "angle": "speed*t"}],
    }
    model = symgen.build(symgen.Scene(**tables))
    for rtol in (1e-6, 1e-8, 1e-10):
        drift = model.simulate(2.6667, rtol=rtol, atol=rtol, method=method).drift
        assert drift.energy < 50 * rtol


def test_an_actuator_pushes_two_masses_apart():
    """Two equal masses in space on a line, F = p - c L': the distance by itself."""
    tables = {
        "parameters": {"p": "30 N", "c": "0.6 N*s/m", "k": "3 N/m^3"},
        "points": {
            "A": {"at": ["0 m", "0 m", "0 m"]},
            "B": {"at": ["1 m", "2 m", "2 m"]},
            "O": {"at": ["9 m", "0 m", "0 m"], "ground": True},
            "D": {"at": ["9 m", "1 m", "0 m"]},
        },
        "links": {"OD": {"points": ["O", "D"], "mass": "1 kg"}},
        "masses": [{"point": "A", "mass": "2 kg"}, {"point": "B", "mass": "2 kg"}],
        "actuators": [{"between": ["A", "B"], "force": "p - c*this.rate - k*this.length**3"}],
        "analysis": {"outputs": ["A.position", "B.position", "energy"]},
    }
    result = symgen.build(symgen.Scene(**tables)).simulate(3.0, rtol=1e-11)
    exact = solve_ivp(
        lambda _, y: [y[1], 30 - 0.6 * y[1] - 3 * y[0] ** 3], (0, 3), [3, 0], rtol=1e-12, atol=1e-13
    )
    a, b = (np.array(result.final[p]["position"]) for p in "AB")
    assert np.linalg.norm(b - a) == pytest.approx(exact.y[0, -1], abs=1e-9)
    assert np.cross(b - a, [1, 2, 2]) == pytest.approx([0, 0, 0], abs=1e-9)
    assert result.drift.energy < 1e-8


def test_a_couple_in_space_acts_across_a_rod():
    """On a free rod: alpha = tau_across/I; the part along the rod has nothing to act on."""
    tables = {
        "points": {"A": {"at": ["0 m", "0 m", "0 m"]}, "B": {"at": ["2 m", "0 m", "0 m"]}},
        "links": {"AB": {"points": ["A", "B"], "mass": "3 kg"}},
        "torques": [{"link": "AB", "torque": ["7 N*m", "2 N*m", "3 N*m"]}],
    }
    found = symgen.build(symgen.Scene(**tables)).accelerations()
    alpha = np.array([0, 2, 3]) / (3 * 4 / 12)
    assert found["B"] - found["A"] == pytest.approx(np.cross(alpha, [2, 0, 0]), rel=1e-13, abs=1e-13)


def slider(x, **spring):
    """A mass of 2 kg on a rail along x, the anchor M of a spring on the middle of it."""
    return {
        "points": {"O": ground(-5.0, 0.0), "E": ground(5.0, 0.0), "M": ground(0.0, 0.0), "A": at(x, 0.0)},
        "links": {"rail": {"points": ["O", "E"]}},
        "masses": [{"point": "A", "mass": "2 kg"}],
        "guides": [{"points": ["A"], "along": "rail"}],
        "springs": [{"between": ["M", "A"], "stiffness": "50 N/m", **spring}],
    }


@pytest.mark.parametrize("x", [1.0, 0.0])
def test_a_spring_of_no_length_passes_through_zero(x):
    """Zero slack length: a linear force, also where the points meet, and drawn there."""
    tables = slider(x, length="0 m") | {"start": {"velocities": {"A": ["0.3 m/s", "0 m/s"]}}}
    tables["analysis"] = {"outputs": ["A.position"]}
    result = symgen.build(symgen.Scene(**tables)).simulate(4.0, rtol=1e-11)
    exact = x * np.cos(5 * result.time) + 0.06 * np.sin(5 * result.time)
    assert result.variable("A.position").values[:, 0] == pytest.approx(exact, abs=1e-9)
    assert result.drift.energy < 1e-9


def test_a_spring_without_direction_is_named():
    for spring in ({"length": "0.4 m"}, {"length": "0 m", "damping": "1 N*s/m"}):
        with pytest.raises(SceneError, match="at one place it has no direction"):
            symgen.build(symgen.Scene(**slider(0.0, **spring)))
        model = symgen.build(symgen.Scene(**slider(1.0, **spring)))
        with pytest.raises(ModelError, match="the spring between M and A is 0 m long"):
            model.accelerations(model.state({"A": [0.0, 0.0]}, {"A": [1.0, 0.0]}))
    led = slider(0.0, length="0.4 m")  # with a length to assemble the drawing is a first guess
    led["points"]["B"] = at(0.0, -1.0)
    led["links"]["AB"] = {"points": ["A", "B"], "mass": "1 kg", "length": "1.1 m"}
    with pytest.raises(SceneError, match="the spring between M and A is .* m long.*\n.*apart") as caught:
        symgen.build(symgen.Scene(**led))
    assert caught.value.where == "springs"


def test_a_load_without_a_value_at_the_start_is_told_from_a_step_that_is_too_large():
    """Dry friction of a point at rest."""
    way = "sqrt(A.vx**2 + A.vy**2)"
    scene = symgen.Scene(
        parameters={"f": "1 N"},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity=GRAVITY,
        forces=[{"point": "A", "force": [f"-f*A.vx/{way}", f"-f*A.vy/{way}"]}],
    )
    with pytest.raises(SimulationError, match="no finite accelerations at the start") as error:
        symgen.build(scene).simulate(1.0)
    assert "step" not in str(error.value)


def test_a_run_that_fails_within_reach_of_a_place_without_direction_names_it():
    from symgen.runtime.integrate.causes import cause

    model = symgen.build(symgen.Scene(**slider(1.0, length="0.4 m")))
    q, u = np.array([0.125, 0.0]), np.array([-1.0, 0.0])
    assert cause(model.evaluator, 0.0, q, u) is None
    assert "between M and A is 0.125 m long" in cause(model.evaluator, 0.0, q, u, reach=0.2).text


BAD = {
    "link and itself": ({"torsion_springs": [{"link": "OA", "against": "OA", "stiffness": "1 N*m"}]}, "torsion_springs.0.against", "itself"),
    "stiffness of a spring": ({"torsion_springs": [{"link": "OA", "stiffness": "1 N/m"}]}, "torsion_springs.0.stiffness", "a torque"),
    "negative": ({"torsion_springs": [{"link": "OA", "stiffness": "-1 N*m"}]}, "torsion_springs.0.stiffness", "at least zero"),
    "negative damping": (
        {"torsion_springs": [{"link": "OA", "stiffness": "1 N*m", "damping": "-1 N*m*s"}]}, "torsion_springs.0.damping", "at least zero",
    ),
    "one point": ({"actuators": [{"between": ["O", "O"], "force": "1 N"}]}, "actuators.0.between", "two different"),
    "no force": ({"actuators": [{"between": ["O", "A"], "force": "1 m"}]}, "actuators.0.force", "a force"),
    "unknown state": ({"actuators": [{"between": ["O", "A"], "force": "k*A.q/l"}]}, "actuators.0.force", "'A.x'|'A.y'"),
    "component of an output": ({"forces": [{"point": "A", "force": ["-k*A.position.x/l", "0 N"]}]}, "forces.0.force.0", "mean 'A.x'"),
    "rate of an output": ({"torques": [{"link": "OA", "torque": "-k*l*OA.angular_velocity"}]}, "torques.0.torque", "mean 'OA.rate'"),
    "state of another": ({"forces": [{"point": "A", "force": ["k*this.length/l", "0 N"]}]}, "forces.0.force.0", "this.length"),
    "rate for angle": ({"torques": [{"link": "OA", "torque": "k*l*sin(this.rate)"}]}, "torques.0.torque", "an angular velocity"),
    "space in plane": ({"torques": [{"link": "OA", "torque": ["1 N*m", "0 N*m"]}]}, "torques.0.torque", "one torque"),
    "state in a mass": ({"masses": [{"point": "A", "mass": "A.x"}]}, "masses.0.mass", "may not use A.x"),
    "state in a drive": ({"drivers": [{"link": "OA", "angle": "OA.angle"}]}, "drivers.0.angle", "may not use OA.angle"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_loads(case):
    change, where, words = BAD[case]
    tables = pendulum(parameters={"k": "1 N", "l": "1 m"}, gravity=GRAVITY, **change)
    with pytest.raises(SceneError, match=words) as caught:
        symgen.build(symgen.Scene(**tables))
    assert caught.value.where == where


@pytest.mark.parametrize(
    "spring", [{}, {"against": "OA", "angle": 0.2}, {"against": "OA", "damping": "1 N*m*s"}], ids=str
)
def test_bad_bending_in_space(spring):
    points = {
        "O": {"at": ["0 m", "0 m", "0 m"], "ground": True},
        "A": {"at": ["1 m", "0 m", "0 m"]},
        "B": {"at": ["1 m", "1 m", "0 m"]},
    }
    links = {"OA": {"points": ["O", "A"], "mass": "1 kg"}, "AB": {"points": ["A", "B"], "mass": "1 kg"}}
    springs = [{"link": "AB", "stiffness": "1 N*m", **spring}]
    with pytest.raises(SceneError, match="in space a torsion spring"):
        symgen.build(symgen.Scene(points=points, links=links, gravity=SPACE, torsion_springs=springs))


def test_loads_are_outputs():
    """A limited controller by its law, a force along a link by its angle, a push by the distance."""
    law = "max(-limit, min(limit, u - k*OA.angle - d*this.rate))"
    scene = symgen.Scene(
        **pendulum(0.6, gravity=GRAVITY),
        inputs={"u": "1 N*m"},
        parameters={"limit": "8 N*m", "k": "20 N*m", "d": "3 N*m*s", "push": "5 N/m"},
        torques=[{"link": "OA", "torque": law}],
        forces=[{"point": "A", "force": [0, "3 N"]}, {"point": "A", "force": ["1 N", "2 N"], "link": "OA"}],
        actuators=[{"between": ["O", "A"], "force": "push*this.length"}],
        analysis={
            "t_end": "1 s",
            "outputs": [
                *("OA.angle", "OA.angular_velocity", "torques.0.torque"),
                *("forces.0.force", "forces.1.force", "actuators.0.force"),
            ],
        },
    )
    model = symgen.build(scene)
    run = model.simulate()
    angle, rate = run["OA.angle"].values, run["OA.angular_velocity"].values
    torque = np.clip(1 - 20 * angle - 3 * rate, -8, 8)
    assert torque.min() == -8 and np.any(np.abs(torque) < 8)  # at the limit, and within it
    assert run["torques.0.torque"].values == pytest.approx(torque, abs=1e-13)
    assert run.variable("torques.0.torque").unit == "N*m"
    assert np.all(run["forces.0.force"].values == [0, 3])
    cos, sin = np.cos(angle), np.sin(angle)
    along = np.stack([cos - 2 * sin, sin + 2 * cos], axis=1)
    assert run["forces.1.force"].values == pytest.approx(along, abs=1e-14)
    assert run["actuators.0.force"].values == pytest.approx(5, abs=1e-14)
    hanging = model.state({"A": [0, -1]})
    outputs = model.linearise(hanging, outputs=["torques.0.torque"], coordinates=["OA.angle"])
    assert np.all(outputs.C == 0) and np.all(outputs.D == 0)  # 1 + 10 pi is beyond the limit
    level = model.linearise(
        model.state({"A": [1, 0]}), outputs=["torques.0.torque"], coordinates=["OA.angle"]
    )
    assert np.allclose(level.C, [[-20, -3]]) and np.allclose(level.D, [[1]])


@pytest.mark.parametrize("across", [0.0, 0.5])
def test_loads_in_space_are_outputs(across):
    """On the axes of the scene, also where the linkage stays in a plane."""
    model = symgen.build(
        symgen.Scene(
            points={"O": ground(0, 0, 0), "A": at(1, 0, 0)},
            links={"OA": {"points": ["O", "A"], "mass": "3 kg"}},
            forces=[{"point": "A", "force": ["1 N", "2 N", f"{across} N"]}],
            torques=[{"link": "OA", "torque": [0, 0, "4 N*m"]}],
            analysis={"t_end": "0.1 s", "outputs": ["forces.0.force", "torques.0.torque"]},
        )
    )
    assert bool(model.description.plane) == (across == 0)
    run = model.simulate(samples=2)
    assert np.all(run["forces.0.force"].values == [1, 2, across])
    assert np.all(run["torques.0.torque"].values == [0, 0, 4])


def test_an_output_of_a_load_that_there_is_not():
    scene = pendulum(torques=[{"link": "OA", "torque": "u"}], inputs={"u": "1 N*m"})
    for name, hint in (
        ("OA.torque", "are outputs by their number from 0, such as torques.0.torque"),
        ("torque.0.torque", "Did you mean 'torques.0.torque'"),
        ("u", "It acts in torques.0.torque"),
    ):
        with pytest.raises(SceneError, match=hint):
            symgen.build(symgen.Scene(**scene, analysis={"outputs": [name]}))
