"""``[states]`` with elastic links in large rotation: motors and controllers of flexible arms.

The references are Lagrange's equations of one element, from its energies in ``docs/method_elastic.md``, the
characteristic equation of an Euler-Bernoulli beam on a hub, and the same scenes with rigid links.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.flexible_arms import (
    DENSITY,
    GOAL,
    HUB,
    KD,
    KI,
    KP,
    LAG,
    LENGTH,
    THICKNESS,
    THIN_LINK,
    TIP,
    WIDTH,
    YOUNG,
    arm,
    built,
    one_element_matrices,
    rigid,
    root_near,
    sized,
    spatial,
)
from shared.linkages import at, ground

import symgen
from symgen.errors import CapabilityError, ModelError, SimulationError
from symgen.export import export_c


@pytest.fixture(scope="module")
def driven():
    return built(arm())


# -- one element in large rotation: Lagrange's equations of the energies that the documentation states ---------------


#: Part of the torque by the height of the tip [N].
TILT = 9.0


def one_element():
    """Return rates of (hub angle, x, y, tip angle; their rates; m; z) of the arm in one element."""
    of = one_element_matrices()

    def rates(t, state):
        matrix, force = of(*state[:8])
        m, z = state[8:]
        force = -np.array(force, dtype=float)
        force[0] += m
        error = GOAL - state[0]
        commanded = KP * error + KI * z - KD * state[4] - TILT * state[2]
        return [*state[4:8], *np.linalg.solve(matrix, force), (commanded - m) / LAG, error]

    return rates


def test_an_arm_of_one_element_has_lagranges_equations():
    """Rates by the shaft, whose angle is that of the first section, and by the place of the bent tip."""
    tables = arm()
    tables["parameters"]["tilt"] = f"{TILT} N"
    tables["states"]["m"]["rate"] = tables["states"]["m"]["rate"].replace(" - m)", " - tilt*tip.y - m)")
    run = built(tables).large_rotation(t_end=0.12, samples=4, elements=1, rtol=1e-7)
    start = [0.0, LENGTH, 0.0, 0.0, *np.zeros(4), 0.5, 0.0]
    times = np.linspace(0.0, 0.12, 4)
    own = solve_ivp(one_element(), (0.0, 0.12), start, method="DOP853", rtol=1e-11, atol=1e-13, t_eval=times)
    assert np.max(np.abs(own.y[1])) == LENGTH and np.ptp(own.y[0]) > 0.2  # it turns far
    assert run["tip.position"].values == pytest.approx(own.y[1:3].T, abs=1e-8)
    assert run["m"].values == pytest.approx(own.y[8], abs=1e-7)
    assert run["z"].values == pytest.approx(own.y[9], abs=1e-9)
    commanded = KP * (GOAL - own.y[0]) + KI * own.y[9] - KD * own.y[4] - TILT * own.y[2]
    rates = (commanded - own.y[8]) / LAG
    assert run["m.rate"].values == pytest.approx(rates, abs=1e-5)
    assert run.statistics["power_balance"] < 1e-8


def test_simulate_is_the_run_in_large_rotation(driven):
    run = driven.simulate(0.1, samples=3)
    assert run.provenance["method"] == "large-rotation"
    assert run["m"].values == pytest.approx(driven.large_rotation(t_end=0.1, samples=3)["m"].values)


# -- small motions: an Euler-Bernoulli beam on a hub, whose motor has a lag ------------------------------------------


def test_eigenvalues_of_the_closed_loop_are_those_of_a_beam():
    """Decays of the controller and oscillations of the arm: the error falls with the fourth power of elements."""
    kp, kd = 0.8, 0.3
    states = {"m": {"start": "0 N*m", "rate": "(-kp*arm.angle - kd*arm.rate - m)/lag"}}
    parameters = {"kp": f"{kp} N*m", "kd": f"{kd} N*m*s", "lag": f"{LAG} s"}
    model = built(arm(states=states, parameters=parameters, links={"arm": THIN_LINK}, analysis={}))
    errors = []
    for elements in (4, 8, 16):
        found = np.array([m.s for m in model.modes(model.equilibrium(elements=elements))])[:4]
        exact = np.array([root_near(s, 0.0, HUB, kp, kd) for s in found])
        assert len({np.round(s, 3) for s in exact}) == len(exact)
        errors.append(np.max(np.abs(found / exact - 1)))
    assert errors[0] > 12 * errors[1] > 144 * errors[2] and errors[2] < 5e-6
    assert {"decay", "oscillation"} == {m.kind for m in model.modes()}


def test_eigenvalues_of_an_arm_on_a_rigid_hub_are_those_of_a_beam():
    """The hub is the crank, of half the inertia, with a flywheel of the other half; the arm is welded to it."""
    kp, kd, radius = 0.8, 0.3, 0.1
    half = f"{HUB / 2!r} kg*m^2"
    tables = arm(
        states={"m": {"start": "0 N*m", "rate": "(-kp*hub.angle - kd*hub.rate - m)/lag"}},
        parameters={"kp": f"{kp} N*m", "kd": f"{kd} N*m*s", "lag": f"{LAG} s"},
        points={"O": ground(0, 0), "H": at(radius, 0), "tip": at(radius + LENGTH, 0)},
        links={
            "hub": {"points": ["O", "H"], "mass": "1 kg", "centre": 0, "inertia": half},
            "arm": THIN_LINK | {"points": ["H", "tip"]},
        },
        welds=[{"point": "H", "links": ["hub", "arm"]}],
        crank=arm()["crank"] | {"link": "hub", "flywheel": half},
        analysis={},
    )
    model = built(tables)
    found = np.array([m.s for m in model.modes(model.equilibrium(elements=8))])[:5]
    exact = np.array([root_near(s, radius, HUB, kp, kd) for s in found])
    assert found == pytest.approx(exact, rel=5e-5) and len({np.round(s, 3) for s in exact}) == 5


# -- closed forms, the rigid limit, equilibria -----------------------------------------------------------------------


def test_a_filter_of_the_time_has_its_closed_form():
    w = 30.0
    link = {
        "points": ["O", "tip"],
        "density": f"{DENSITY} kg/m^3",
        "section": {"width": f"{WIDTH} m", "thickness": "5 mm"},
        "elastic": {"E": f"{YOUNG!r} Pa", "elements": 1},
    }
    scene = arm(
        links={"arm": link},
        parameters={"w": f"{w} rad/s", "lag": f"{LAG} s"},
        states={"f": {"start": 0.25, "rate": "(sin(w*t) - f)/lag"}},
        crank={"link": "arm", "speed": "120 rpm"},
        analysis={},
    )
    run = built(scene).large_rotation(t_end=0.2, samples=9, elements=1)
    t, part = np.linspace(0.0, 0.2, 9), 1 / (1 + (w * LAG) ** 2)
    exact = part * (np.sin(w * t) - w * LAG * np.cos(w * t)) + (0.25 + part * w * LAG) * np.exp(-t / LAG)
    assert run["f"].values == pytest.approx(exact, abs=1e-11)
    assert run["f.rate"].values == pytest.approx((np.sin(w * t) - exact) / LAG, abs=1e-9)
    assert run["f.rate"].attrs["units"] == "1/s"


@pytest.mark.parametrize("space", [False, True])
def test_stiff_arms_move_as_rigid_ones(space):
    """The difference falls with the stiffness."""
    thickness, tip = 0.02, "B.position" if space else "tip.position"

    def of(young):
        if space:
            return spatial(young, thickness, kp=8.0, kd=1.2, elements=1, shift="60 mm")
        return arm(young, links={"arm": sized(young, thickness)})

    exact = built(rigid(of(YOUNG), thickness)).simulate(0.05, samples=3, rtol=1e-10)
    apart = []
    for young in (YOUNG, 6 * YOUNG):
        run = built(of(young)).simulate(0.05, samples=3, rtol=1e-3)
        apart.append([np.max(np.abs(run[name].values - exact[name].values)) for name in (tip, "m")])
    apart = np.array(apart)
    assert np.ptp(exact[tip].values[:, 1]) > 1e-3
    assert np.all(apart[-1] < [1e-5, 2e-3]) and np.all(apart[0] > 4 * apart[1])


def test_an_integral_holds_the_hub_against_the_weight():
    """At rest the shaft has the angle of the target, and the motor balances the weight at the tip."""
    gravity = {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]}
    light = sized(YOUNG, THICKNESS) | {"density": "1 kg/m^3"}
    model = built(arm(gravity=gravity, links={"arm": light}, analysis={}))
    rest = model.equilibrium(elements=4)
    x, y = rest.outputs["tip.position"]
    weight, bend = TIP * 9.81, YOUNG * WIDTH * THICKNESS**3 / 12
    assert rest.stability == "stable"
    own = LENGTH * WIDTH * THICKNESS * 9.81  # of the arm, of 1 kg/m^3
    assert rest.outputs["m"] == pytest.approx(weight * x + own * x / 2, rel=1e-5)
    assert rest.outputs["z"] == pytest.approx(rest.outputs["m"] / KI, rel=1e-9)
    # A beam under a transverse force Q and a thrust N at its tip bends by (Q/N)(tan(k L)/k - L), k^2 = N/(E I).
    k = math.sqrt(weight * math.sin(GOAL) / bend)
    bent = (math.tan(k * LENGTH) / k - LENGTH) / math.tan(GOAL)
    across = -x * math.sin(GOAL) + y * math.cos(GOAL)
    assert across == pytest.approx(-bent, rel=2e-3) and bent > 5e-3
    assert rest.linearised.integrals == 2 and rest.freedoms == len(rest.linearised.mass) - 2


def test_a_couple_on_the_first_section_is_a_motor(driven):
    """The angle of an elastic crank in rates is that of its shaft, with a motor as for a free crank."""
    hub = [{"point": "tip", "mass": f"{TIP} kg"}, {"point": "O", "mass": "0 kg", "inertia": f"{HUB} kg*m^2"}]
    free = arm(
        crank={"link": "arm", "mode": "free", "speed": "0 rpm"},
        torques=[{"link": "arm", "point": "O", "torque": "m"}],
        masses=hub,
    )
    one, other = (m.large_rotation(t_end=0.05, samples=3, rtol=1e-6) for m in (driven, built(free)))
    for name in ("tip.position", "m", "z"):
        assert other[name].values == pytest.approx(one[name].values, abs=1e-8)


def test_displacements_are_from_the_rigid_linkage_with_the_same_states():
    tables = arm(analysis={"outputs": ["tip.displacement", "tip.position", "m"]})
    run = built(tables).simulate(0.1, samples=3)
    exact = built(rigid(arm(), THICKNESS)).simulate(0.1, samples=3)["tip.position"].values
    # The rigid link has no moment of inertia of its sections.
    apart = run["tip.position"].values - exact
    assert run["tip.displacement"].values == pytest.approx(apart, abs=1e-5) and np.max(np.abs(apart)) > 1e-3


# -- limits, kinks, derivatives, checkpoints, refusals ---------------------------------------------------------------


def test_a_limited_signal_against_the_rigid_arm():
    """Anti-windup: the integral stands while the motor is at its limit."""
    signal = f"kp*({GOAL} - arm.angle) + ki*z - kd*arm.rate"
    states = {
        "m": {"start": "0 N*m", "rate": f"(min(limit, max(-limit, {signal})) - m)/lag"},
        "z": {"start": "0 s", "rate": f"({GOAL} - arm.angle)*(1 - sign(abs({signal}) - limit))/2"},
    }
    parameters = arm()["parameters"] | {"limit": "3 N*m"}
    tables = arm(states=states, parameters=parameters)
    tables["links"] = {"arm": sized(5 * YOUNG, 0.008)}
    run = built(tables).simulate(0.3, samples=7, rtol=2e-3)
    exact = built(rigid(tables, 0.008)).simulate(0.3, samples=7, rtol=1e-9)
    for name, size in (("m", 3.0), ("z", 0.1), ("tip.position", 0.6)):
        assert run[name].values == pytest.approx(exact[name].values, abs=5e-3 * size)
    assert np.max(exact["m"].values) > 2.9 and exact["z"].values[-1] > 0.01


def test_a_run_resumes_with_the_same_bits(driven, tmp_path):
    file, options = tmp_path / "run.npz", {"t_end": 0.03, "samples": 3, "rtol": 1e-6}
    whole = driven.large_rotation(**options)
    with pytest.raises(SimulationError):
        driven.large_rotation(**options, max_wall=0.02, checkpoint=file, checkpoint_every=1e-9)
    again = driven.large_rotation(**options, resume=file)
    for name in ("m", "z", "tip.position"):
        assert np.array_equal(again[name].values, whole[name].values)


def test_what_linear_theory_lacks_is_refused(driven, tmp_path):
    refused = r"linear theory prescribes the rigid motion, to which \[states\] feed back\n  Compute"
    for name in ("periodic", "quasi_static", "speed_response", "sensitivity"):
        with pytest.raises(CapabilityError, match=refused):
            getattr(driven, name)
    with pytest.raises(CapabilityError, match=r"linearise: it has elastic links; model.modes"):
        driven.linearise()
    for call in (
        lambda: driven.simulate(0.1, method="newmark"),
        lambda: driven.modes(at=0.0),
        lambda: driven.modes(moving=True),
        lambda: export_c(symgen.Scene(**arm()), tmp_path / "c"),
    ):
        with pytest.raises(ModelError, match=refused):
            call()


def test_residual_and_slopes_have_the_states(driven):
    found = driven.matrices(1e-3, over="time", elements=1)
    names = found["large_stiffness"].rows
    assert {"m.integral", "z.integral"} <= {*names}
    row = names.index("m.integral")
    assert found["large_damping"].values[row, row] == pytest.approx(1 / LAG)
    assert np.all(found["large_stiffness"].values[:, row] == 0.0)
    assert found["large_mass"].values[row, row] == 1.0


def test_a_lag_far_below_the_steps_is_none():
    """Steps of a fast state need its own slope, and have the motion of the motor without a lag."""
    fast = arm(parameters=arm()["parameters"] | {"lag": "0.1 us"})
    torque = f"kp*({GOAL} - this.angle) + ki*z - kd*this.rate"
    states = {"z": {"start": "0 s", "rate": f"{GOAL} - arm.angle"}}
    direct = arm(states=states, crank=arm()["crank"] | {"torque": torque}, analysis={})
    one, other = (built(x).simulate(0.02, samples=3) for x in (fast, direct))
    assert one.statistics["steps"] < 5000 and np.max(np.abs(other["tip.position"].values[:, 1])) > 1e-4
    assert one["tip.position"].values == pytest.approx(other["tip.position"].values, abs=1e-6)
    assert one["m"].values[1:] == pytest.approx(other["arm.torque"].values[1:], abs=1e-2)
