"""Derivatives of runs through jumps of loads and to events, against closed forms differentiated in 40 digits."""

from __future__ import annotations

from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.slopes import slopes

import symgen
from symgen.errors import ModelError
from symgen.scene.loading import read_scene

CASE = Path(__file__).parents[2] / "cases" / "sliding_mass.toml"
MASS = 2
VALUES = {"F": (3.0, "N"), "k": (50.0, "N/m"), "b": (0.3, "s"), "c": (4.0, "N*s/m"), "a": (0.2, "m")}


def swing(x, v, k, t, c=0, rest=0):
    """Place and velocity after a time on a spring with its rest at ``rest`` and a damper."""
    damping = mp.mpf(c) / (2 * MASS)
    rate = mp.sqrt(k / mp.mpf(MASS) - damping**2)
    y, u = x - rest, v + damping * (x - rest)
    co, si, decay = mp.cos(rate * t), mp.sin(rate * t), mp.exp(-damping * t)
    place = decay * (y * co + u / rate * si)
    return rest + place, decay * (u * co - y * rate * si) - damping * place


def friction(x, v, force, k, t):
    """Half swings about F/k and -F/k in turn, from rest at a positive place; v moves the first turning point."""
    phase = mp.atan2(v, mp.sqrt(k / mp.mpf(MASS)) * (x - force / k)) / mp.sqrt(k / mp.mpf(MASS))
    x = force / k + mp.sqrt((x - force / k) ** 2 + v**2 * MASS / k)
    t, side, half = t - phase, 1, mp.pi / mp.sqrt(k / mp.mpf(MASS))
    while t > half:
        x, t, side = -x + 2 * side * force / k, t - half, -side
    return swing(x, 0, k, t, rest=side * force / k)


def timed(x, v, force, k, b, t):
    """A constant force that begins at the time b."""
    return swing(*swing(x, v, k, b), k, t - b, rest=force / k)


def bumper(x, v, k, c, a, t):
    """Free motion to a spring and damper, which engage at the place a; it has not left them at the end."""
    return swing(a, v, k, t - (a - x) / v, c, rest=a)


CASES = {
    "dry friction": ("-k*A.x - F*sign(A.vx)", friction, ["F", "k"], (0.5, -0.4), [0.4, 1.3]),
    "a force from a time on": ("-k*A.x + F*(1 + sign(t - b))/2", timed, ["F", "k", "b"], (0.5, 0.1), [0.7]),
    "a bumper": (
        "-(k*(A.x - a) + c*A.vx)*(1 + sign(A.x - a))/2", bumper, ["k", "c", "a"], (0.5, -0.0), [0.3],
    ),
}  # fmt: skip


def built(force, x, v, **more):
    """The mass under a force along x, from a place and velocity."""
    data = {**read_scene(CASE).data, **more}
    data["parameters"] = {k: {"value": f"{q} {u}", "tunable": True} for k, (q, u) in VALUES.items()}
    data["forces"][0]["force"][0] = force
    data["points"]["A"]["at"][0] = f"{x} m"
    data["start"]["velocities"]["A"][0] = f"{v} m/s"
    return symgen.build(symgen.Scene(**data))


@pytest.mark.parametrize("method", ["dop853", "taylor", "radau5"])
@pytest.mark.parametrize("name", CASES)
def test_derivatives_pass_jumps_of_loads(name, method):
    force, motion, parameters, (x, v), times = CASES[name]
    if name == "a bumper":
        x, v = 0.1, 0.9
    model = built(force, x, v)
    by = ["A.position.x", "A.position.x'", *parameters]
    options = {
        "coordinates": ["A.position.x"],
        "t_eval": times,
        "method": method,
        "rtol": 1e-12,
        "atol": 1e-14,
    }
    found = model.sensitivity(["A.position.x", "A.velocity.x"], [*by, by[2]], **options)  # one of them twice
    given = [x, v, *(VALUES[p][0] for p in parameters)]
    for k, t in enumerate(times):
        expected = slopes(lambda *args, t=t: [*motion(*args, mp.mpf(t))], given)
        assert np.array_equal(found.derivatives[k][:, -1], found.derivatives[k][:, 2])
        with mp.workdps(30):
            values = [float(y) for y in motion(*map(mp.mpf, given), mp.mpf(t))]
        assert found.values[k] == pytest.approx(values, rel=1e-9)
        assert np.max(np.abs(found.derivatives[k][:, :-1] - expected)) <= 1e-11 * np.max(np.abs(expected))
        if method == "dop853":  # one output by seven directions: backwards
            every = [*by[:2], *VALUES]
            one = model.sensitivity(["A.position.x"], every, **{**options, "t_eval": [t]})
            exact = dict.fromkeys(every, 0.0) | dict(zip(by, expected[0], strict=True))
            assert one.derivatives[0, 0] == pytest.approx([*exact.values()], rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("method", ["dop853", "taylor", "radau5"])
def test_an_event_that_ends_the_run_moves_with_the_parameters(method):
    """A force that grows with the time on a spring; the run ends at the place a."""

    def motion(x, v, force, k, b, t):
        steady = force / (k * b)
        y, u = swing(x, v - steady, k, t)
        return [y + steady * t, u + steady]

    def outputs(x, v, force, k, b, a):
        t = mp.findroot(lambda t: motion(x, v, force, k, b, t)[0] - a, mp.mpf("0.2"))
        return [*motion(x, v, force, k, b, t), (-k * a + force * t / b) / MASS, t]

    event = {"name": "there", "of": "A.x", "value": "a", "ends_run": True}
    model = built("-k*A.x + F*t/b", 0.5, -0.1, events=[event])
    by, given = ["A.position.x", "A.position.x'", "F", "k", "b", "a"], [0.5, -0.1, 3.0, 50.0, 0.3, 0.2]
    names = ["A.position.x", "A.velocity.x", "A.acceleration.x"]
    options = {"coordinates": ["A.position.x"], "method": method, "rtol": 1e-12, "atol": 1e-14}
    found = model.sensitivity(names, by, t_eval=[0.05, 1.0], **options)
    assert found.outputs == (*names, "time") and found.units["time"] == "s"
    expected = slopes(outputs, given)
    assert np.max(np.abs(found.derivatives[1] - expected) / (np.abs(expected) + 1e-3)) <= 1e-11
    with mp.workdps(30):
        assert found.values[1] == pytest.approx([float(y) for y in outputs(*map(mp.mpf, given))], rel=1e-9)
    before = slopes(lambda *args: [*motion(*args[:5], mp.mpf(0.05))], given)
    assert found.derivatives[0, :2] == pytest.approx(before, abs=1e-11)
    assert not np.any(found.derivatives[0, 3]) and found.t.tolist() == [0.05, found.values[1, 3]]
    if method != "radau5":
        back = model.sensitivity(["A.velocity.x"], [*by, "c"] + by[:1], t_end=1.0, **options)
        assert back.derivatives[0, 0, :6] == pytest.approx(expected[1], rel=1e-11)
        asked = {key: x for key, x in options.items() if key != "coordinates"}
        for span in ({"t_end": 1.0}, {"t_eval": [0.0, 0.05, 1.0]}, {}):
            run = model.simulate(**span, **asked)
            own = run.gradient(["A.velocity.x"], by, coordinates=["A.position.x"])
            assert own.outputs == ("A.velocity.x", "time")
            assert own.derivatives[0, 0] == pytest.approx(expected[1], rel=1e-11)
        with pytest.raises(
            ModelError, match="integrals are not available for an event that ends the run: there"
        ):
            model.sensitivity([], by, t_end=1.0, integrals=["A.position.x"], **options)


def test_a_profile_of_a_remainder_wraps_at_one_switching_point():
    """The force falls from F to 0 where the angle wraps: remainder and profile switch at once.

    Derivatives of the angle by F are differences of the minimal equation, carried on from boundary to boundary.
    """
    scene = symgen.Scene(
        symgen=1,
        parameters={"F": {"value": "1 N", "tunable": True}},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0 m", "-1 m"]}},
        links={"rod": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        start={"rates": {"rod": "3 rad/s"}},
        analysis={"outputs": ["rod.angle"]},
        forces=[{"point": "A", "force": ["F*profile.poly345(mod(rod.angle + pi/2 + 0.05, 0.3)/0.2)", "0 N"]}],
    )

    def angle(force, end=0.3):
        t, y, n = 0.0, [0.0, 3.0], 0
        while t < end:
            start, moving = 0.3 * (n // 2) - 0.05, n % 2 == 0

            def rate(_, y, start=start, moving=moving):
                s = (y[0] - start) / 0.2 if moving else 1.0
                push = force * (10 * s**3 - 15 * s**4 + 6 * s**5)
                return [y[1], 3 * (push * np.cos(y[0]) - 9.81 / 2 * np.sin(y[0]))]

            def boundary(_, y, at=start + (0.2 if moving else 0.3)):
                return y[0] - at

            boundary.terminal = True
            run = solve_ivp(rate, (t, end), y, events=boundary, rtol=1e-12, atol=1e-13, method="DOP853")
            t, y, n = run.t[-1], run.y[:, -1], n + 1
        assert n > 3
        return y[0]

    h = 1e-3
    expected = (8 * (angle(1 + h) - angle(1 - h)) - (angle(1 + 2 * h) - angle(1 - 2 * h))) / (12 * h)
    run = symgen.build(scene).simulate(0.3, samples=2, rtol=1e-11, atol=1e-13)
    assert np.asarray(run["rod.angle"])[-1] + np.pi / 2 == pytest.approx(angle(1.0), abs=1e-9)
    found = run.gradient(["rod.angle"], ["F"], coordinates=["rod.angle"]).derivatives
    assert np.ravel(found)[-1] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("method", ["dop853", "taylor", "radau5"])
def test_derivatives_at_the_time_of_a_jump_do_not_change_those_behind_it(method):
    """A force from t = b = 0.3 s on, with derivatives requested at this time, too."""
    model = built("-k*A.x + F*(1 + sign(t - b))/2", 0.5, 0.1)
    options = {"coordinates": ["A.position.x"], "method": method, "rtol": 1e-12, "atol": 1e-14}
    found = model.sensitivity(["A.position.x", "A.velocity.x"], ["F", "k", "b"], t_eval=[0.3, 0.7], **options)
    given = [0.5, 0.1, 3.0, 50.0, 0.3]
    expected = slopes(lambda *args: [*timed(*args, mp.mpf("0.7"))], given)[:, 2:]
    assert np.max(np.abs(found.derivatives[1] - expected)) <= 1e-11 * np.max(np.abs(expected))


@pytest.mark.parametrize("method", ["dop853", "taylor", "radau5"])
@pytest.mark.parametrize("both", [False, True])
def test_two_loads_that_switch_at_one_place(method, both, monkeypatch):
    """F1 sign(x - a) + F2 sign(x - c) at a = c, and the same with a quadratic force between a and x."""
    monkeypatch.setitem(VALUES, "c", (0.2, "m"))
    force = "F*sign(A.x - a) + 2*F*sign(A.x - c)"
    model = built("k*max(0*a, A.x - a)*max(0*a, A.x - c)/a" if both else force, 0.1, 2.0)

    def motion(a, c):
        x, v, t, end = mp.mpf("0.1"), mp.mpf(2), mp.mpf(0), mp.mpf("0.2")
        for place, rate in zip((*sorted((a, c)), None), (-9, -3 if a < c else 3, 9), strict=True):
            f = mp.mpf(rate) / MASS
            h = end - t if place is None else (-v + mp.sqrt(v**2 + 2 * f * (place - x))) / f
            x, v, t = x + v * h + f * h**2 / 2, v + f * h, t + h
        return [x, v]

    def pushed(a, c):
        """By power series from the later place on."""
        x0, v0 = max(a, c), mp.mpf(2)
        t0 = (x0 - mp.mpf("0.1")) / v0
        go = mp.odefun(lambda _, y: [y[1], 50 * (y[0] - a) * (y[0] - c) / a / MASS], t0, [x0, v0])
        return list(go(mp.mpf("0.2")))

    expected = slopes(pushed if both else motion, [0.2, 0.2])
    options = {"coordinates": ["A.position.x"], "method": method, "rtol": 1e-12, "atol": 1e-14, "t_end": 0.2}
    found = model.sensitivity(["A.position.x", "A.velocity.x"], ["a", "c"], **options).derivatives[0]
    assert np.max(np.abs(found - expected)) <= 1e-10 * np.max(np.abs(expected))
    back = model.sensitivity(["A.position.x"], ["a", "c", "A.position.x", *VALUES], **options).derivatives
    assert back[0, 0, :2] == pytest.approx(expected[0], rel=1e-10)


@pytest.mark.parametrize("method", ["dop853", "taylor", "radau5"])
@pytest.mark.parametrize(
    "force", ["F*sign(A.x - a)*sign(A.x - c)", "F*(1 + sign(A.x - a))*(1 + sign(A.x - c))"]
)
def test_loads_that_multiply_at_one_switching_point_have_no_derivatives(method, force, monkeypatch):
    """The product differs between a and c, on whichever side c is: the motion by c has a corner."""
    monkeypatch.setitem(VALUES, "c", (0.2, "m"))
    model = built(force, 0.1, 2.0)
    options = {"coordinates": ["A.position.x"], "method": method, "t_end": 0.2}
    ends = [
        model.with_parameters(c=c).simulate(0.2, samples=2)["A.velocity"].values[-1, 0]
        for c in (0.19, 0.2, 0.21)
    ]
    one_sided = (ends[1] - ends[0]) / 0.01, (ends[2] - ends[1]) / 0.01
    assert abs(one_sided[0] - one_sided[1]) > 2
    with pytest.raises(ModelError, match="the motion depends on which is first: there are no derivatives"):
        model.sensitivity(["A.position.x"], ["c"], **options)
    apart = model.sensitivity(["A.velocity.x"], ["F"], **options).derivatives[0, 0, 0]
    h = 1e-4
    ends = [
        model.with_parameters(F=3 + x).simulate(0.2, samples=2)["A.velocity"].values[-1, 0] for x in (-h, h)
    ]
    assert apart == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=1e-6)
