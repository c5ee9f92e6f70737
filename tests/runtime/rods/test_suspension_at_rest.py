"""A wishbone suspension that starts in its equilibrium, against minimal equations with their own root."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from shared.linkages import GRAVITY, G, at, ground, rod

import symgen

CHASSIS, ARM, WHEEL, LENGTH = 250.0, 6.0, 30.0, 0.4
SUSPENSION = {"ks": 4.0e4, "cs": 2.5e3, "mb": CHASSIS, "h": 0.06}
KT, CT, TOP, STRUT, TYRE, BEGUN, RISE = 2.0e5, 300.0, (0.1, 0.5), 0.66, 0.35, 0.2, 0.12


def quarter_car():
    """A chassis on a rail, a wishbone with the wheel at its end, a strut, and a tyre above a moving road."""
    return symgen.Scene(
        name="quarter_car",
        parameters={
            "ks": {"value": "40 N/mm", "tunable": True},
            "cs": {"value": "2500 N*s/m", "tunable": True},
            "mb": {"value": "250 kg", "tunable": True},
            "h": {"value": "60 mm", "tunable": True},
            "begun": f"{BEGUN} s",
            "rise": f"{RISE} s",
        },
        points={
            "O": ground(0, 0),
            "E": ground(0, 2),
            "C": at(0, 0.4),
            "S": at(0, 0.9),
            "T": at(0.1, 0.9),
            "W": at(0.4, 0.35),
            "R": ground(0.4, 0, motion=["0 m", "h*profile.cycloidal((t - begun)/rise)"]),
        },
        links={
            "rail": {"points": ["O", "E"]},
            "chassis": {"points": ["C", "S", "T"], "mass": "0 kg"},
            "wishbone": rod("C", "W", ARM, length=f"{LENGTH} m"),
        },
        guides=[{"points": ["C", "S"], "along": "rail"}],
        masses=[
            {"point": "C", "mass": "0.9*mb"},
            {"point": "S", "mass": "0.1*mb"},
            {"point": "W", "mass": f"{WHEEL} kg"},
        ],
        springs=[
            {"between": ["T", "W"], "stiffness": "ks", "damping": "cs", "length": f"{STRUT} m"},
            {
                "between": ["R", "W"],
                "stiffness": f"{KT} N/m",
                "damping": f"{CT} N*s/m",
                "length": f"{TYRE} m",
            },
        ],
        gravity=GRAVITY,
        start={"equilibrium": True},
        analysis={
            "t_end": "0.6 s",
            "outputs": ["C.position", "W.position", "wishbone.angle", "C.acceleration"],
        },
    )


def bump(t, h):
    """Height and speed of the road: a cycloidal rise."""
    s = np.clip((t - BEGUN) / RISE, 0.0, 1.0)
    turn = 2 * np.pi * s
    return h * (s - np.sin(turn) / (2 * np.pi)), h * (1 - np.cos(turn)) / RISE


def accelerations(t, y, ks, cs, mb, h):
    """Lagrange's equations in the height of the chassis and the angle of the wishbone."""
    (z, a), (vz, va) = y[:2], y[2:]
    s, c = np.sin(a), np.cos(a)
    wheel, of_wheel = np.array([LENGTH * c, z + LENGTH * s]), np.array([[0, -LENGTH * s], [1, LENGTH * c]])
    top, of_top = np.array([TOP[0], z + TOP[1]]), np.array([[0, 0], [1, 0]])
    moved = np.array([vz, va])
    height, climb = bump(t, h)
    force = -G * np.array([mb + ARM + WHEEL, (ARM / 2 + WHEEL) * LENGTH * c])
    for other, of_other, speed, k, d, rest in (
        (top, of_top, of_top @ moved, ks, cs, STRUT),
        (np.array([LENGTH, height]), np.zeros((2, 2)), np.array([0, climb]), KT, CT, TYRE),
    ):
        apart = wheel - other
        length = np.linalg.norm(apart)
        rate = apart @ (of_wheel @ moved - speed) / length
        force -= (k * (length - rest) + d * rate) * (apart / length) @ (of_wheel - of_other)
    first = (ARM / 2 + WHEEL) * LENGTH
    mass = [[mb + ARM + WHEEL, first * c], [first * c, (ARM / 3 + WHEEL) * LENGTH**2]]
    return np.linalg.solve(mass, force + np.array([first * s * va**2, 0]))


def at_rest(**x):
    found = root(lambda q: accelerations(0.0, [*q, 0, 0], **x), [0.4, -0.1], tol=1e-14)
    return found.x


def minimal(times, **changed):
    """Heights of chassis and wheel at times, in runs from the own root."""
    x = {**SUSPENSION, **changed}
    begin = [*at_rest(**x), 0.0, 0.0]

    def rates(t, y):
        return [*y[2:], *accelerations(t, y, **x)]

    y, rows = np.array(begin), []
    for first, last in ((0.0, BEGUN), (BEGUN, BEGUN + RISE), (BEGUN + RISE, 1.0)):
        inside = times[(times > first) & (times <= last)]
        run = solve_ivp(
            rates, (first, last), y, "DOP853", rtol=1e-13, atol=1e-14, t_eval=np.unique([*inside, last])
        )
        rows.append(run.y.T[: len(inside)])
        y = run.y[:, -1]
    rows = np.concatenate(rows)
    return np.column_stack([rows[:, 0], rows[:, 0] + LENGTH * np.sin(rows[:, 1])])


@pytest.fixture(scope="module")
def car():
    return symgen.build(quarter_car())


def test_a_suspension_rests_until_the_bump(car):
    z, a = at_rest(**SUSPENSION)
    begin = car.initial_state()
    assert begin.positions["C"] == pytest.approx([0, z], abs=1e-12)
    assert begin.positions["W"] == pytest.approx([LENGTH * np.cos(a), z + LENGTH * np.sin(a)], abs=1e-12)
    assert max(np.max(np.abs(x)) for x in car.accelerations().points.values()) < 1e-10
    times = np.linspace(0.0, 0.6, 61)[1:]
    run = car.simulate(t_eval=times, rtol=1e-12)
    still = run.time <= BEGUN
    for name in ("C.position", "W.position"):
        assert np.max(np.abs(run[name].values[still] - begin.positions[name[0]])) < 1e-13
    assert np.max(np.abs(run["C.acceleration"].values[still])) < 1e-10
    expected = minimal(times)
    assert np.ptp(expected[:, 0]) > 0.05
    assert run["C.position"].values[:, 1] == pytest.approx(expected[:, 0], abs=1e-10)
    assert run["W.position"].values[:, 1] == pytest.approx(expected[:, 1], abs=1e-10)


def test_derivatives_of_a_suspension_against_runs_from_its_own_root(car):
    times, names = np.array([0.1, 0.3, 0.45, 0.6]), [*SUSPENSION]
    found = car.sensitivity(["C.position.y", "W.position.y"], names, t_eval=times, rtol=1e-12).derivatives
    backward = car.sensitivity(["W.position.y"], names, t_end=0.6, rtol=1e-12).derivatives
    for i, name in enumerate(names):
        x = SUSPENSION[name]
        expected = _slope(lambda s, name=name, x=x: minimal(times, **{name: x * (1 + s)}), 1e-3) / x
        assert found[:, :, i] == pytest.approx(expected, rel=1e-8, abs=1e-9 / x)
        assert backward[..., 0, i].item() == pytest.approx(expected[-1, 1], rel=1e-8, abs=1e-9 / x)


def _slope(f, h):
    """Derivative at zero by central differences at three step sizes, extrapolated."""
    one, two, four = (((f(s) - f(-s)) / (2 * s)) for s in (h, 2 * h, 4 * h))
    return (64 * one - 20 * two + four) / 45


def test_the_start_does_not_depend_on_the_order_of_entries(car):
    scene = quarter_car().model_dump(exclude_unset=True)
    turned = {k: dict(reversed(v.items())) if k in ("points", "links") else v for k, v in scene.items()}
    turned["springs"] = turned["springs"][::-1]
    other = symgen.build(symgen.Scene(name="quarter_car", **turned)).initial_state().positions
    for name, place in car.initial_state().positions.items():
        assert other[name] == pytest.approx(place, abs=1e-13)
