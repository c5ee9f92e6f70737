"""Shipped scenes of benchmark libraries, against the values published with them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen

#: Test Set for IVP Solvers, problem `andrews`: angles [rad] at 0.03 s, and rates [rad/s]; PSIDE at 1e-14.
ANDREWS = {"beta": 15.81077119629904, "gamma": 0.04082224013073101}
ANDREWS |= {"delta": 0.5244099658805304, "epsilon": 1.048080741042263}
ANDREWS_RATES = {"K1": 1139.920302151208, "K3": 11.03291221937134}
#: Its second derivatives at the start [rad/s^2].
ANDREWS_START = {"beta": 14222.4439199541138705911625887, "theta": -10666.8329399655854029433719415}
#: The same, problem `caraxis`: positions [m] and velocities [m/s] at 3 s.
CAR_AXIS = {
    "L.position": (0.04934557842755629, 0.4969894602303324),
    "R.position": (1.041742524885400, 0.3739110272652214),
    "L.velocity": (-0.07705836840321485, 0.007446866596327776),
    "R.velocity": (0.01755681574942899, 0.7703410437794031),
}


def test_andrews_squeezer_ends_as_published():
    result = symgen.build("andrews_squeezer").simulate(rtol=1e-12, samples=2)
    beta, gamma, delta, epsilon = ANDREWS.values()
    ends = {
        "Q": 0.007 * np.array([np.cos(beta), np.sin(beta)]),
        "P": [-0.03635 + 0.035 * np.sin(gamma), 0.03273 - 0.035 * np.cos(gamma)],
        "E": [-0.06934 + 0.04 * np.cos(delta), -0.00227 + 0.04 * np.sin(delta)],
        "F": [-0.06934 + 0.04 * np.sin(epsilon), -0.00227 - 0.04 * np.cos(epsilon)],
    }
    for point, end in ends.items():
        assert result[f"{point}.position"].values[-1] == pytest.approx(end, abs=1e-10), point
    for link, rate in ANDREWS_RATES.items():
        assert result[f"{link}.angular_velocity"].values[-1] == pytest.approx(rate, rel=1e-7), link


def test_andrews_squeezer_starts_as_published():
    """At rest every point accelerates along its circle: by the crank's angle, and that of K2 from it."""
    model = symgen.build("andrews_squeezer")
    found, state = model.accelerations(), model.initial_state()
    q, p = state.positions["Q"], state.positions["P"]
    crank, coupler = ANDREWS_START["beta"], ANDREWS_START["beta"] + ANDREWS_START["theta"]
    assert found["Q"] == pytest.approx([-crank * q[1], crank * q[0]], rel=1e-11)
    along = p - q
    expected = np.array([-crank * q[1] - coupler * along[1], crank * q[0] + coupler * along[0]])
    assert found["P"] == pytest.approx(expected, abs=1e-9)


def test_car_axis_ends_as_published():
    result = symgen.build("car_axis").simulate(rtol=1e-12, samples=2)
    for name, end in CAR_AXIS.items():
        assert result[name].values[-1] == pytest.approx(end, abs=1e-10), name


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"rtol": 1e-12},
        {"method": "taylor", "rtol": 1e-12},
        {"method": "radau5", "rtol": 1e-8},
        {"step": 1e-3},
    ],
    ids=str,
)
def test_two_four_bars_stay_on_their_branch(options):
    """The benchmark asks for an energy error below 0.1 J in 10 s; all cranks turn alike, as one pendulum."""
    result = symgen.build("two_four_bars").simulate(**options)
    cranks, couplers, g = 3, 2, 9.81
    inertia, moment = cranks / 3 + couplers, (cranks / 2 + couplers) * g
    assert result.drift.energy < 1e-6
    start = (np.pi / 2, -1.0)
    turn = solve_ivp(
        lambda t, y: [y[1], -moment * np.cos(y[0]) / inertia],
        (0, 10),
        start,
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
        dense_output=True,
    ).sol(result.time)[0]
    exact = np.column_stack([np.cos(turn), np.sin(turn)])
    error = 1e-9 if options.get("rtol") == 1e-12 else 2e-6
    assert result["B0.position"].values == pytest.approx(exact, abs=error)
    assert result["B2.position"].values == pytest.approx(exact + [2, 0], abs=error)
