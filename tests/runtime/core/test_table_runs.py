"""Tables, profiles and remainders in loads and drives: against SciPy's interpolation and closed forms."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline, PchipInterpolator

import symgen
from symgen.errors import SimulationError

AT = [0, 30, 55, 90, 140, 200, 260, 300, 330]
FORCES = [1, 8, 5, 3, 2, 1, 1.5, 2, 4]
RATE, END = 2.0, 5.0
TURN = 2 * math.pi


def crank(force="gas(crank.angle)", kind="pchip", end=END, outputs=("crank.angle",), **tables):
    """A rod of 1 m and 1 kg about its end, with a force along x at its tip."""
    gas = {"x": [f"{x} deg" for x in AT], "y": [f"{y} N" for y in FORCES], "kind": kind, "period": "360 deg"}
    return symgen.Scene(
        tables={"gas": gas, **tables},
        parameters={"k": {"value": 1, "tunable": True}, "T": "0.4 s"},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={"crank": {"points": ["O", "A"], "mass": "1 kg"}},
        forces=[{"point": "A", "force": [force, "0 N"]}],
        start={"rates": {"crank": f"{RATE} rad/s"}},
        analysis={"t_end": f"{end} s", "outputs": list(outputs)},
    )


def interpolated(kind):
    """SciPy's function of the angle [rad], with a period of a revolution."""
    x, y = np.deg2rad([*AT, 360]), np.array([*FORCES, FORCES[0]])
    if kind == "linear":
        return lambda a: np.interp(a % TURN, x, y)
    if kind == "cubic":
        spline = CubicSpline(x, y, bc_type="periodic")
        return lambda a: spline(a % TURN)
    wide = np.concatenate([x[:-1] - TURN, x, x[1:] + TURN])
    pchip = PchipInterpolator(wide, np.concatenate([y[:-1], y, y[1:]]))
    return lambda a: pchip(a % TURN)


def balance(force, angle, rate):
    """The energy that is missing: I (rate^2 - RATE^2)/2 + the integral of the force times the sine."""
    ends = np.deg2rad([x + turn for turn in (-360, 0, 360) for x in AT])
    inner = [0.0, *sorted((e for e in ends if min(0, angle) < e < max(0, angle)), reverse=angle < 0), angle]
    parts = pairwise(inner)
    work = sum(quad(lambda a: force(a) * math.sin(a), a, b, epsabs=1e-14)[0] for a, b in parts)
    return (rate**2 - RATE**2) / 6 + work


@pytest.mark.parametrize("kind", ["linear", "pchip", "cubic"])
@pytest.mark.parametrize(
    ("options", "tolerance"),
    [
        ({"method": "dop853", "rtol": 1e-11}, 1e-10),
        ({"method": "taylor", "rtol": 1e-11}, 1e-10),
        ({"method": "rk4", "step": 5e-3}, 1e-8),
    ],
    ids=str,
)
def test_a_force_by_a_table_does_the_work_of_its_interpolation(kind, options, tolerance):
    backend = "c" if options["method"] == "taylor" else "numpy"
    model = symgen.build(crank(kind=kind, outputs=["crank.angle", "crank.angular_velocity"]), backend=backend)
    for end in (1.3, END):
        run = model.simulate(end, samples=2, **options)
        last = [float(run[name][-1]) for name in ("crank.angle", "crank.angular_velocity")]
        assert balance(interpolated(kind), *last) == pytest.approx(0, abs=tolerance)


def test_steps_end_on_every_point_however_long_they_are():
    """A force of 1e-9 N hardly matters, so that steps extend over many points."""
    run = symgen.build(crank("1e-9*gas(crank.angle)", end=31.5)).simulate(method="dop853", samples=2)
    angle = float(run["crank.angle"][-1])
    passed = sum(0 < math.radians(x) + TURN * turn < angle for turn in range(12) for x in AT)
    assert angle > 9 * TURN
    assert any(f"steps end on {passed} switching points (gas(" in note for note in run.notes)


def test_results_agree_in_all_number_types_and_backends():
    reference = float(symgen.build(crank(), precision="float128").simulate(rtol=1e-20)["crank.angle"][-1])
    for options, tolerance in (
        ({"precision": "float32"}, 1e-4),
        ({"precision": "longdouble"}, 1e-9),
        ({"backend": "numpy"}, 1e-9),
    ):
        found = float(symgen.build(crank(), **options).simulate(method="dop853")["crank.angle"][-1])
        assert found == pytest.approx(reference, abs=tolerance)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_derivatives_along_a_run_pass_the_points(kind, method):
    model = symgen.build(crank("k*gas(crank.angle)", kind=kind))
    options = {"coordinates": ["crank.angle"], "t_end": END, "method": method, "rtol": 1e-11}
    found = model.sensitivity(["crank.angle"], ["k"], **options).derivatives[0, 0]
    h = 1e-3
    values = [
        float(model.with_parameters(k=1 + i * h).simulate(method="taylor", rtol=1e-13)["crank.angle"][-1])
        for i in (-2, -1, 1, 2)
    ]
    assert found == pytest.approx(np.dot([1, -8, 8, -1], values) / (12 * h), rel=1e-8)


def test_many_runs_are_single_runs():
    model = symgen.build(crank("k*gas(crank.angle)"))
    many = model.simulate_many({"k": [0.5, 1.5]}, samples=2)
    for i, k in enumerate((0.5, 1.5)):
        one = model.with_parameters(k=k).simulate(samples=2)["crank.angle"][-1]
        assert float(many["crank.angle"][i, -1]) == float(one)


def test_without_a_period_the_ends_are_kept():
    """Equal forces at both ends of a free bar of 2 kg: its momentum is the integral of both."""
    law = {"x": ["0.1 s", "0.3 s"], "y": ["2 N", "6 N"]}
    scene = symgen.Scene(
        tables={"law": law},
        points={"A": {"at": ["0 m", "1 m"]}, "B": {"at": ["1 m", "1 m"]}},
        links={"bar": {"points": ["A", "B"], "mass": "2 kg"}},
        forces=[{"point": point, "force": ["law(t)", "0 N"]} for point in "AB"],
        analysis={"t_end": "0.5 s", "outputs": ["B.velocity"]},
    )
    run = symgen.build(scene).simulate(rtol=1e-12)
    assert float(run["B.velocity.x"][-1]) == pytest.approx(0.1 * 2 + 0.2 * 4 + 0.2 * 6, rel=1e-13)


def driven(angle, free=True, k=0.4, **tables):
    """A crank with a prescribed angle and, if ``free``, a rod that hangs at its end."""
    rods = {"crank": {"points": ["O", "A"], "mass": "1 kg"}, "rod": {"points": ["A", "B"], "mass": "0.5 kg"}}
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": ["0.04 m", "0 m"]},
        "B": {"at": ["0.14 m", "0 m"]},
    }
    count = 2 if free else 1
    outputs = ["crank.angle", "crank.angular_acceleration", "crank.torque", "rod.angle"]
    return symgen.Scene(
        tables=tables,
        parameters={"T": "0.4 s", "k": {"value": k, "tunable": True}},
        points=dict([*points.items()][: count + 1]),
        links=dict([*rods.items()][:count]),
        drivers=[{"link": "crank", "angle": angle}],
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        start={"rates": {"rod": "0 rad/s"}} if free else {},
        analysis={"t_end": "1.3 s", "outputs": outputs[: count + 2]},
    )


LAW = {
    "x": ["0 s", "0.2 s", "0.5 s", "0.7 s", "0.85 s"],
    "y": ["0 deg", "20 deg", "60 deg", "70 deg", "30 deg"],
    "kind": "cubic",
    "period": "1 s",
}


#: Drives by jumps with a continuous rate, T = 0.4 s, and their second derivatives before and behind the jump.
BY_JUMPS = {
    "max(t - T, 0*T)**2/T**2": (0.0, 12.5),
    "abs(t - T)*(t - T)/T**2": (-12.5, 12.5),
    "min(t - T, 0*T)**2/T**2": (12.5, 0.0),
}


@pytest.mark.parametrize("method", ["taylor", "dop853", "rk4"])
@pytest.mark.parametrize("drive", BY_JUMPS)
def test_a_drive_may_have_jumps_with_a_continuous_rate(drive, method):
    """The torque of a crank about its axis, of moment of inertia 1/3: with weight 1/2 at its angle."""
    scene = symgen.Scene(
        parameters={"T": "0.4 s"},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={"crank": {"points": ["O", "A"], "mass": "1 kg"}},
        drivers=[{"link": "crank", "angle": drive}],
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        analysis={"outputs": ["crank.angle", "crank.angular_acceleration", "crank.torque"]},
    )
    times = np.array([0.0, 0.15, 0.37, 0.43, 0.8])
    model = symgen.build(scene, backend="c" if method == "taylor" else "numpy")
    step = {"step": 0.03} if method == "rk4" else {}
    run = model.simulate(0.8, t_eval=times, method=method, **step)
    acceleration = np.where(times < 0.4, *BY_JUMPS[drive])
    angle = acceleration * (times - 0.4) ** 2 / 2
    assert run["crank.angle"].values == pytest.approx(angle, abs=1e-12)
    assert run["crank.angular_acceleration"].values == pytest.approx(acceleration, abs=1e-9)
    torque = acceleration / 3 + 9.81 / 2 * np.cos(angle)
    assert run["crank.torque"].values == pytest.approx(torque, abs=1e-9)
    assert any("steps end on 1 switching point" in note for note in run.notes)
    poses, times = model.inverse_dynamics(0.0, 0.8, samples=8), np.linspace(0, 0.8, 8)
    acceleration = np.where(times < 0.4, *BY_JUMPS[drive])
    torque = acceleration / 3 + 9.81 / 2 * np.cos(acceleration * (times - 0.4) ** 2 / 2)
    assert poses["crank.torque"].values == pytest.approx(torque, abs=1e-9)


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_drive_by_a_spline_moves_a_rod_as_lagranges_equation_does(method):
    """The rod about A: (l/3) p'' = -(a_y + g) cos(p)/2 + a_x sin(p)/2."""
    spline = CubicSpline(
        [0, 0.2, 0.5, 0.7, 0.85, 1.0], np.deg2rad([0, 20, 60, 70, 30, 0]), bc_type="periodic"
    )

    def rates(t, y):
        angle, w, e = (float(spline(t % 1, k)) for k in range(3))
        x = -0.04 * (math.sin(angle) * e + math.cos(angle) * w * w)
        v = 0.04 * (math.cos(angle) * e - math.sin(angle) * w * w)
        return [y[1], 15 * (x * math.sin(y[0]) - (v + 9.81) * math.cos(y[0]))]

    y, knots = [0.0, 0.0], [0, 0.2, 0.5, 0.7, 0.85, 1.0, 1.2, 1.3]
    for a, b in pairwise(knots):
        span = a + 1e-15, b - 1e-15
        y = solve_ivp(rates, span, y, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    run = symgen.build(driven("law(t)", law=LAW)).simulate(method=method, rtol=1e-12, samples=2)
    assert float(run["rod.angle"][-1]) == pytest.approx(y[0], abs=1e-10)
    assert float(run["crank.angle"][-1]) == pytest.approx(float(spline(0.3)), abs=1e-13)


#: Greatest velocity and acceleration, over 1/T and 1/T^2, in closed form.
PEAKS = {
    "trapezoid": (1.5, 4.5),
    "s_curve": (1.5, 9.0),
    "cycloidal": (2.0, TURN),
    "modified_sine": (4 * math.pi / (4 + math.pi), 4 * math.pi**2 / (4 + math.pi)),
    "poly345": (1.875, 10 / math.sqrt(3)),
    "poly4567": (2.1875, 7.513189),
}


@pytest.mark.parametrize("name", PEAKS)
def test_profiles_rise_from_0_to_1_with_known_peaks(name):
    scene = driven(f"profile.{name}(t/T)")
    times = np.linspace(0, 1.2, 1801)
    found = symgen.build(scene).simulate(t_eval=times)
    angle, acceleration = found["crank.angle"].values, found["crank.angular_acceleration"].values
    rate = np.gradient(angle, times)
    assert angle[times >= 0.4] == pytest.approx(1.0, abs=1e-14)
    assert angle[300] == pytest.approx(0.5, abs=1e-14)
    assert np.max(rate) * 0.4 == pytest.approx(PEAKS[name][0], rel=1e-4)
    assert np.max(np.abs(acceleration)) * 0.16 == pytest.approx(PEAKS[name][1], rel=1e-4)


def cam(u):
    """The profile of fifth degree, kept at its ends."""
    x = np.clip(u, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x * x)


@pytest.mark.parametrize(
    "options", [{"method": "taylor"}, {"method": "dop853"}, {"method": "rk4", "step": 0.01}], ids=str
)
def test_a_tunable_duration_moves_knots_till_parts_do_not_end_as_they_begin(options):
    """A rise and a return in a part of 0.4 s each: from a part of 1/2 on, the drive would jump at 0.4 s."""
    law = "profile.poly345(mod(t, T)/(k*T)) - profile.poly345((mod(t, T) - T/2)/(k*T))"
    for free in (False, True):
        model = symgen.build(
            driven(law, free=free), backend="c" if options["method"] == "taylor" else "numpy"
        )
        times = np.array([0.07, 0.19, 0.27, 0.398, 0.41, 0.77, 1.19, 1.3])
        for k in (0.25, 0.4975, 0.5):
            run = model.with_parameters(k=k).simulate(t_eval=times, **options)
            expected = cam(times % 0.4 / (0.4 * k)) - cam((times % 0.4 - 0.2) / (0.4 * k))
            assert run["crank.angle"].values == pytest.approx(expected, abs=1e-9)
        for k in (0.51, 0.75):
            with pytest.raises(
                SimulationError, match=r"jumps with mod\(t, 0.4\) in the drive of crank at t = 0.4 s"
            ):
                model.with_parameters(k=k).simulate(t_eval=times, **options)


@pytest.mark.parametrize("options", [{"method": "dop853"}, {"method": "rk4", "step": 0.01}], ids=str)
def test_a_rate_that_jumps_by_a_tunable_parameter_ends_a_run(options):
    """A parabola in every period, (1/4 - k) of it, and its square: the rate is zero at the ends for k = 1 alone."""
    law = "((mod(t, T)*(T - mod(t, T))/T**2)**2 + (k - 1)*mod(t, T)*(T - mod(t, T))/T**2)"
    model = symgen.build(driven(law, k=1), backend="numpy")
    found = model.simulate(t_eval=[0.1, 0.5], **options)["crank.angle"].values
    assert found == pytest.approx((3 / 16) ** 2, abs=1e-9)
    with pytest.raises(SimulationError, match="or its rate, jumps with mod"):
        model.with_parameters(k=1.5).simulate(0.5, **options)


@pytest.mark.parametrize("kind", ["dynamics", "kinematics"])
@pytest.mark.parametrize(
    ("law", "held", "jumps", "at"),
    [
        ("((mod(t, T)*(T - mod(t, T))/T**2)**2 + (k - 1)*mod(t, T)*(T - mod(t, T))/T**2)", 1, 1.5, 0.4),
        ("profile.poly345(mod(t, T)/(k*T)) - profile.poly345((mod(t, T) - T/2)/(k*T))", 0.5, 0.51, 0.4),
    ],
    ids=["rate", "value"],
)
def test_prescribed_motions_over_a_range_have_no_jumps(kind, law, held, jumps, at):
    """Kinematics and inverse dynamics end as runs do; before the jump they are closed forms of the drive."""
    scene = driven(law, free=False, k=held).model_dump(exclude_unset=True)
    outputs = ["crank.angle"] if kind == "kinematics" else scene["analysis"]["outputs"]
    model = symgen.build(
        symgen.Scene(**{**scene, "analysis": {"t_end": "1.3 s", "kind": kind, "outputs": outputs}})
    )
    verbs = [model.kinematics] + ([model.inverse_dynamics] if kind == "dynamics" else [])
    for verb in verbs:
        verb()
        changed = getattr(model.with_parameters(k=jumps), verb.__name__)
        changed(stop=0.99 * at)
        with pytest.raises(SimulationError, match=rf"or its rate, jumps with mod\(t, 0.4\).* at t = {at} s"):
            changed()
        with pytest.raises(SimulationError, match="or its rate, jumps"):
            changed(at=[0.2, 0.6], over="time")


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_runs_start_on_the_piece_of_their_start(method):
    """Behind the rise of a profile the force is constant, whatever the rounding of the distance from its end."""
    points = {"A": ["0.5 m", "0 m"], "O": ["0 m", "0 m"], "X": ["1 m", "0 m"]}
    model = symgen.build(
        symgen.Scene(
            parameters={"c": {"value": "0.1 s", "tunable": True}, "k": "0.1 s", "T": "0.4 s", "F": "1 N"},
            points={name: {"at": at, "ground": name != "A"} for name, at in points.items()},
            links={"rail": {"points": ["O", "X"]}},
            masses=[{"point": "A", "mass": "1 kg"}],
            guides=[{"points": ["A"], "along": "rail"}],
            forces=[{"point": "A", "force": ["F*profile.poly345(mod(t + c, T)/k)", "0 N"]}],
            analysis={"outputs": ["A.velocity"]},
        )
    )
    for c in np.linspace(0.101, 0.39, 50).tolist():
        run = model.with_parameters(c=c).simulate(1e-3, method=method, samples=2)
        assert run["A.velocity"].values[-1, 0] == pytest.approx(1e-3, rel=1e-12), c


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_cam_with_dwells_repeats(method):
    """Rise, dwell, return and dwell in every period, where mod and both profiles switch together."""
    law = "profile.poly345(mod(t, T)/(0.3*T)) - profile.poly345((mod(t, T) - 0.5*T)/(0.4*T))"
    run = symgen.build(driven(law)).simulate(method=method, t_eval=[0.06, 0.17, 0.28, 0.39, 0.46, 0.97, 1.08])
    assert run["crank.angle"].values == pytest.approx([0.5, 1, 0.5, 0, 0.5, 1, 0.5], abs=1e-9)
    assert any("switching points" in note for note in run.notes)


def test_the_torque_of_a_v_twin_is_that_of_its_energy():
    """Against the kinetic energy of pistons and uniform rods, and the work of the spline."""
    tables = symgen.load_scene("v_twin").tables["gas"]
    x = np.deg2rad([float(v.split()[0]) for v in tables.x] + [720])
    y = np.array([float(v.split()[0]) for v in tables.y] + [float(tables.y[0].split()[0])]) * 1e5
    gas = CubicSpline(x, y, bc_type="periodic")
    throw, rod, area, w, half = 0.048, 0.170, 62e-4, 100 * math.pi, math.pi / 8
    run = symgen.build("v_twin").simulate(rtol=1e-12, samples=41)
    torque = np.zeros(41)
    for axis, fires in ((math.pi / 2 + half, 0.0), (math.pi / 2 - half, TURN)):
        f = run["crank.angle"].values - axis
        s, c = throw * np.sin(f), throw * np.cos(f)
        d = np.sqrt(rod**2 - s * s)
        # place of the piston on its axis, its first two derivatives by the crank's angle
        p1 = -s - s * c / d
        p2 = -c - (c * c - s * s) / d - (s * c) ** 2 / d**3
        # rod of 0.6 kg: m/6 (vA^2 + vA vB + vB^2); along the axis vA = -s, and its square is constant
        kinetic = 0.45 * p1 * p2 + 0.1 * (-c * p1 - s * p2 + 2 * p1 * p2)
        torque += w * w * kinetic + area * gas((f - fires) % (2 * TURN)) * p1
    assert run["crank.torque"].values == pytest.approx(torque, abs=1e-9 * np.max(np.abs(torque)))
    assert any("50 switching points" in note for note in run.notes)


def turned(*torques, end, tables=None, method="dop853", **parameters):
    """Return the angular momentum [N m s], over 1 kg m^2, of a free crank after these torques by the time."""
    scene = symgen.Scene(
        tables=tables or {},
        parameters={"N": "1 N*m", "S": "1 s", "P": "0.7 s", **parameters},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={"c": {"points": ["O", "A"], "mass": "3 kg"}},
        torques=[{"link": "c", "torque": torque} for torque in torques],
        analysis={"t_end": f"{end} s", "outputs": ["c.angular_velocity"]},
    )
    return float(symgen.build(scene).simulate(samples=2, method=method)["c.angular_velocity"][-1])


def of_points(x, y, **more):
    return {"law": {"x": [f"{float(a)!r} s" for a in x], "y": [f"{float(b)!r} N*m" for b in y], **more}}


METHODS = ["dop853", "taylor"]


@pytest.mark.parametrize("method", METHODS)
def test_points_nearer_than_steps_are_all_passed(method):
    """Ten periods of twenty points each: every period has the mean of its values."""
    y = np.sin(2 * np.pi * np.arange(20) / 20) + 1
    tables = of_points(np.arange(20) * 1e-3, 10 * y, period="20 ms")
    assert turned("law(t)", end=0.2, tables=tables, method=method) == pytest.approx(2.0, rel=1e-12)
    assert turned("law(t)", end=0.027, tables=tables, method=method) == pytest.approx(
        0.2 + np.trapezoid(10 * y[:8]) * 1e-3, rel=1e-12
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shift", [240, 260, 600])
def test_many_periods_before_the_start_change_nothing(shift, method):
    y = np.sin(2 * np.pi * np.arange(40) / 40) + 1
    tables = of_points(np.arange(40) * 1e-8, 10 * y, period="0.4 us")
    found = turned("law(t + shift)", end=2e-5, tables=tables, method=method, shift=f"{shift} s")
    assert found == pytest.approx(2e-4, rel=1e-5)  # the rounding of the time is 6e-14 s


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("apart", [1e-3, 1e-6, 1e-9, 1e-12])
def test_two_points_close_together_are_a_jump(apart, method):
    tables = of_points([0, 0.5, 0.5 + apart, 1], [0, 0, 1, 1])
    found = turned("law(t)", end=1, tables=tables, method=method)
    assert found == pytest.approx(0.5 - apart / 2, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("torque", "expected"),
    [
        ("N*sign(mod(t, P) - P/2)", -0.1),
        ("N*abs(mod(t, P) - P/2)/S", 2 * 0.35**2 + 0.35**2 / 2 + 0.25**2 / 2),
        ("N*max(mod(t, P) - P/2, 0*S)/S", 0.35**2 + 0.25**2 / 2),
        ("N*mod(t, P)/S", 0.7**2 + 0.6**2 / 2),
    ],
)
def test_waves_by_remainders(torque, expected, method):
    assert turned(torque, end=2, method=method) == pytest.approx(expected, rel=1e-9)


def test_a_table_may_have_the_name_of_a_profile():
    table = {"x": ["0 s", "1 s"], "y": ["0 N*m", "2 N*m"]}
    found = turned("trapezoid(t)", "N*profile.trapezoid(t/S)", end=1, tables={"trapezoid": table})
    assert found == pytest.approx(1.5, rel=1e-9)


@pytest.mark.parametrize("options", [{"method": "dop853"}, {"method": "rk4", "step": 0.01}], ids=str)
def test_an_input_that_changes_as_a_drive_jumps_does_not_hide_the_jump(options):
    """The drive jumps at 0.4 s, at which the controller is called."""
    law = "profile.poly345(mod(t, T)/(k*T)) - profile.poly345((mod(t, T) - T/2)/(k*T))"
    data = driven(law).model_dump(exclude_unset=True)
    data["inputs"] = {"U": 0}
    data["parameters"]["M"] = "0.01 N*m"
    data["torques"] = [{"link": "rod", "torque": "M*U"}]
    model = symgen.build(symgen.Scene(**data)).with_parameters(k=0.75)
    with pytest.raises(
        SimulationError, match="^the prescribed motion, .* jumps with .* drive of crank at t = 0.4 s"
    ):
        model.simulate(controller=lambda t, view: {"U": math.sin(9 * t)}, sample=0.1, **options)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("period", "shift"), [(1.1, 0.028), (0.7, 0.05), (0.9, 0.3)])
def test_a_table_of_a_remainder_ends_where_the_remainder_begins_again(period, shift, method):
    """The argument falls from the last point to the first one, where both have a switching point."""
    x, y = np.array([0, 0.3, 0.5, 1.1]) * period / 1.1, np.array([1.0, 3.0, -2.0, 1.0])
    given = {"shift": f"{-shift} s", "P": f"{period} s"}
    found = turned("law(mod(t + shift, P))", end=2.0, tables=of_points(x, y), method=method, **given)
    areas = np.append(0, np.cumsum(np.diff(x) * (y[1:] + y[:-1]) / 2))

    def area(t):
        """The integral of the line through the points from 0 to t, over whole periods and a part of one."""
        whole, part = divmod(t, period)
        k = min(int(np.searchsorted(x, part, side="right")) - 1, len(x) - 2)
        here = y[k] + (y[k + 1] - y[k]) * (part - x[k]) / (x[k + 1] - x[k])
        return whole * areas[-1] + areas[k] + (part - x[k]) * (y[k] + here) / 2

    assert found == pytest.approx(area(2.0 - shift) - area(-shift), rel=1e-9)
    wave = turned("N*sign(mod(t + shift, P))", end=2.0, method=method, **given)
    assert wave == pytest.approx(2.0, rel=1e-9)
