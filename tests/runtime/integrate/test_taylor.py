"""Power series in time: the recurrence of every function, digits of every number type, and failures."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.runtime.integrate.integrators import INTEGRATORS

#: Accelerations of a point at x with velocity v at time t, by the function whose recurrence they need.
ACCELERATIONS = {
    "quotient": "-5*x/(1 + x**2 + v**2/10)",
    "sqrt": "-3*x/sqrt(2 + x**2)",
    "power": "-x*(1 + x**2)**(3/10)",
    "exp": "exp(-t)/2 - x*exp(-x)",
    "log": "-log(2 + x)",
    "sin": "cos(3*t)*v - 4*sin(2*x)",
    "tan": "-tan(x/2)",
    "sinh": "-sinh(x) - cosh(v)/10",
    "tanh": "-3*x - tanh(2*v)",
    "asin": "-2*asin(x/4)",
    "acos": "acos(x/4) - 2",
    "atan": "-2*atan(x)",
    "atan2": "-2*atan2(x, 1 + v**2)",
    "square": "-x - x**2*v**2/3 - (x + v)**2/9",
}
FILE = """
import sympy as sp
from sympy import *

from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Group, NamedMatrix, System


def system():
    at, rate = quantity("x", "m", "position"), quantity("v", "m/s", "velocity")
    time, share = quantity("t", "s", "time"), quantity("share", "1", "part of the mass that depends on x")
    x, v, t, c = at.symbol, rate.symbol, time.symbol, share.symbol
    mass = 1 + c*x**2
    return System(
        name="point",
        title="A point",
        groups=(
            Group("t", "time", (time,)),
            Group("q", "position", (at,)),
            Group("u", "velocity", (rate,)),
            Group("p", "parameters", (share,), per_run=True),
        ),
        matrices=(
            NamedMatrix("mass_matrix", sp.ImmutableMatrix([[mass]]), "kg", "mass"),
            NamedMatrix("force", sp.ImmutableMatrix([mass*(FORCE)]), "N", "force"),
        ),
        exports=(),
        values={"share": 0.3, "x": 1.0, "v": 0.3},
    )
"""
_MATH = {name: getattr(math, name) for name in dir(math)}


@pytest.mark.parametrize("name", ACCELERATIONS)
def test_recurrence_of_every_function(name, tmp_path):
    """Against a run by another program; the mass depends on the position, and drops out of the motion."""
    text = ACCELERATIONS[name]
    (tmp_path / "point.py").write_text(FILE.replace("FORCE", text))
    model = symgen.build(tmp_path / "point.py")
    times = np.linspace(0.0, 2.0, 5)
    run = model.simulate(2.0, t_eval=times, method="taylor", rtol=1e-13, atol=1e-15)
    other = solve_ivp(
        lambda t, y: (y[1], eval(text, {**_MATH, "t": t, "x": y[0], "v": y[1]})),
        (0.0, 2.0),
        (1.0, 0.3),
        method="DOP853",
        t_eval=times,
        rtol=3e-14,
        atol=1e-15,
    )
    assert np.ptp(other.y[0]) > 0.1
    assert run["x"].values == pytest.approx(other.y[0], abs=3e-12)
    assert run.statistics["steps"] < 60


#: Two uniform rods of 1 m and 1 kg, released from horizontal, and the end of the second after 10 s with
#: g = 9.81 m/s^2: from the equations in two angles, by extrapolation
#: with 40 digits.
RODS = symgen.Scene(
    points={
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": ["1 m", "0 m"]},
        "B": {"at": ["2 m", "0 m"]},
    },
    links={
        "OA": {"points": ["O", "A"], "mass": "1 kg"},
        "AB": {"points": ["A", "B"], "mass": "1 kg"},
    },
    gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
)
END = ("-1.6558674241800307260606411471592", "-0.52844548102495235268187639135808")


def with_load(torque, rate):
    """Return a rod that hangs on a joint with a torque."""
    return symgen.build(
        symgen.Scene(
            points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
            links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
            gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
            parameters={"w": rate, "r": "10 rad/s", "M": "0.5 N*m"},
            torques=[{"link": "OA", "torque": torque}],
        )
    )


def test_steep_friction_whose_argument_is_in_the_thousands():
    """tanh of 5000 is one, though sinh and cosh of it exceed all numbers."""
    model = with_load("-M*tanh((OA.rate + r)/w)", "2 mrad/s")
    run = model.simulate(0.5, samples=2, method="taylor", rtol=1e-12)
    other = model.simulate(0.5, samples=2, method="dop853", rtol=1e-12)
    assert run.final["A"]["position"] == pytest.approx(other.final["A"]["position"], abs=1e-11)


def test_a_function_that_exceeds_all_numbers_is_named():
    with pytest.raises(SimulationError, match="power series of the motion is not finite at the start") as e:
        with_load("-M/cosh((OA.rate + r)/w)", "2 mrad/s").simulate(0.5, method="taylor")
    assert "such as cosh, exceeds all numbers: try dop853" in str(e.value)


def test_error_of_two_rods_after_ten_seconds():
    exact = [float(x) for x in END]
    run = symgen.build(RODS).simulate(10.0, samples=2, method="taylor", rtol=3e-14, atol=3e-16)
    assert run["B.position"].values[-1] == pytest.approx(exact, abs=1e-10)


def test_digits_of_quadruple_precision():
    exact = [float(x) for x in END]
    model = symgen.build(RODS, precision="float128")
    run = model.simulate(10.0, samples=2, method="taylor", rtol=1e-24, atol=1e-26)
    assert run["B.position"].values[-1] == pytest.approx(exact, abs=4e-16)
    assert run.statistics["steps"] < 400


@pytest.mark.parametrize(
    "name", ["peaucellier", "andrews_squeezer", "car_axis", "tumbling_body", "whip", "crank_rocker"]
)
def test_scenes_agree_with_runge_kutta(name):
    """Guides, drives, moving ground, springs, dampers, bodies, the energy balance: within the tolerances."""
    model = symgen.build(name)
    end = min(model.description.t_end, 0.3)
    a, b = (model.simulate(end, samples=5, method=m, rtol=1e-12) for m in ("taylor", "dop853"))
    for point in a.final:
        for kind, value in a.final[point].items():
            assert value == pytest.approx(b.final[point][kind], rel=1e-9, abs=1e-9)
    assert a.drift.energy < 1e-9 * max(b.drift.energy_exchanged, 1.0)
    assert a.statistics["steps"] < 0.5 * b.statistics["steps"]


def test_what_has_no_power_series_says_so():
    triple = symgen.build("triple_pendulum")
    with pytest.raises(ModelError, match="power series are for compiled linkages"):
        symgen.build("triple_pendulum", backend="numpy").simulate(0.1, method="taylor")
    with pytest.raises(ModelError, match="goes with explicit methods"):
        triple.simulate(0.1, method="taylor", stabilisation="baumgarte")
    with pytest.raises(
        ModelError, match=r"chooses its own step: give rtol and atol, also with a largest max_step"
    ):
        triple.simulate(0.1, method="taylor", step=0.01)


def test_steps_have_the_length_of_max_step_where_they_meet_the_tolerance():
    model = symgen.build("four_bar")
    steps = [model.simulate(1.0, method="taylor", max_step=h).statistics["steps"] for h in (0.01, 0.02, 0.1)]
    assert steps[:2] == [100, 50] and steps[2] > 10


def test_method_has_the_order_that_a_tolerance_needs():
    """Steps hardly grow in number from one tolerance to a thousandth of it: the order grows."""
    model = symgen.build(RODS)
    steps = [model.simulate(2.0, method="taylor", rtol=r).statistics["steps"] for r in (1e-6, 1e-9, 1e-12)]
    assert steps[2] < 1.4 * steps[0]
    assert INTEGRATORS["taylor"].coefficients == {"order": 0}


def test_events_and_revolutions_of_a_fast_rotor_are_counted():
    """A balanced bar at 50 rad/s with a weak spring: its steps would be longer than a revolution."""
    bar = {"points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}}}
    scene = symgen.Scene(
        **bar,
        links={"bar": {"points": ["O", "A"], "mass": "1 kg"}},
        springs=[{"between": ["O", "A"], "stiffness": "1 N/m", "length": "1 m"}],
        start={"rates": {"bar": "50 rad/s"}},
        events=[{"name": "up", "of": "A.position.x", "direction": "falling"}],
        analysis={"outputs": ["bar.angle", "A.position"]},
    )
    run = symgen.build(scene).simulate(2.0, samples=3, method="taylor", rtol=1e-10)
    assert run["bar.angle"].values == pytest.approx([0.0, 50.0, 100.0], abs=1e-7)
    assert len(run.events) == 16


def test_counted_revolutions_take_no_further_steps():
    """Two rods whose rates change sign, against steps in which no rod turns by a tenth of a revolution."""
    names = ["A.position", "B.position", "OA.angle", "AB.angle"]
    models = [
        symgen.build(
            symgen.Scene(
                points=RODS.points,
                links=RODS.links,
                gravity=RODS.gravity,
                start={"rates": {"OA": "25 rad/s", "AB": "-20 rad/s"}},
                analysis={"outputs": outputs},
            )
        )
        for outputs in (names, names[:2])
    ]
    run, without = (m.simulate(2.0, samples=7, method="taylor", rtol=1e-12) for m in models)
    assert run.statistics["steps"] == without.statistics["steps"]
    finely = models[0].simulate(2.0, samples=7, method="dop853", rtol=1e-12, max_step=2e-3)
    for name in names[2:]:
        assert np.ptp(run[name].values) > 20
        assert run[name].values == pytest.approx(finely[name].values, abs=1e-6)


#: Motions whose last coefficients vanish, underflow or overflow, or do not show the error of a step.
ODD = {"cubed time": ("-t*x", 0.0, 8.0), "slow": ("-x*10**-12", 0.0, 1e7), "fast": ("-x*10**8", 1.0, 0.01)}


@pytest.mark.parametrize("name", ODD)
def test_last_terms_that_do_not_show_the_error(name, tmp_path):
    text, rate, end = ODD[name]
    (tmp_path / "point.py").write_text(FILE.replace("FORCE", text).replace('"v": 0.3', f'"v": {rate}'))
    model = symgen.build(tmp_path / "point.py")
    a, b = (model.simulate(end, samples=2, method=m, rtol=1e-11)["x"].values for m in ("taylor", "dop853"))
    assert abs(b[-1]) < 10
    assert a[-1] == pytest.approx(b[-1], abs=1e-7)


def test_what_a_recurrence_does_not_have_is_refused(tmp_path):
    """Branches of abs are those of switching points in scenes, which user-defined systems do not have."""
    for text in ("-x*Abs(x)", "-x*sqrt(x**2)", "-x*2**x"):
        (tmp_path / "point.py").write_text(FILE.replace("FORCE", text))
        model = symgen.build(tmp_path / "point.py")
        assert len(model.simulate(0.1, samples=3)["x"].values) == 3
        with pytest.raises(ModelError, match=r"power series.* without abs \(such as of sqrt\(x\*\*2\)\)"):
            model.simulate(0.1, method="taylor")


def test_loads_without_power_and_loose_tolerances():
    """A force on a fixed point does no work, and a tolerance of 100 takes the lowest order."""
    scene = symgen.Scene(
        parameters={"F": "1 N"},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={"bar": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        forces=[{"point": "O", "force": ["F", "0 N"]}],
    )
    model = symgen.build(scene)
    ends = [model.simulate(1.0, method=m, rtol=1e-11)["A.position"].values[-1] for m in ("taylor", "dop853")]
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    assert np.all(np.isfinite(model.simulate(0.1, method="taylor", rtol=100.0)["A.position"].values))


def test_energy_balance_of_work_that_the_motion_does_not_show():
    """A slider at uniform speed passes a spring and a damper: all that changes is their work."""
    scene = symgen.Scene(
        parameters={"L": "2 m", "v": "1 m/s"},
        points={
            "O": {"at": ["-3 m", "0 m"], "ground": True},
            "R": {"at": ["3 m", "0 m"], "ground": True},
            "S": {"at": ["0 m", "0.1 m"], "ground": True},
            "A": {"at": ["-1 m", "0 m"]},
        },
        links={"rail": {"points": ["O", "R"]}, "ram": {"points": ["O", "A"], "length": "L + v*t"}},
        masses=[{"point": "A", "mass": "1 kg"}],
        guides=[{"points": ["A"], "along": "rail"}],
        springs=[
            {"between": ["S", "A"], "stiffness": "10 N/m", "length": "0.1 m", "damping": "1 N*s/m"},
        ],
    )
    found = symgen.build(scene).simulate(2.0, samples=3, method="taylor", rtol=1e-11)
    assert found.drift.energy < 1e-8
