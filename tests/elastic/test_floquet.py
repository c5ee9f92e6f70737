"""Floquet multipliers of columns against Hill's equation, and of a flutter much faster than the revolution."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from shared.full import full

import symgen

LENGTH, WIDTH, THICKNESS, E, DENSITY = 1.0, 0.02, 0.002, 210e9, 7850.0
STIFFNESS, MASS = E * WIDTH * THICKNESS**3 / 12, DENSITY * WIDTH * THICKNESS
EULER = math.pi**2 * STIFFNESS / LENGTH**2
#: Lowest frequency [rad/s] of the pinned column without load.
LOWEST = math.pi**2 * math.sqrt(STIFFNESS / MASS) / LENGTH**2
#: Errors of eight elements, and of the integration of Hill's equation.
EXACT = 1e-9


def column(elements=8, follower=False, **elastic):
    """A steel column in a guide, or clamped under a follower force; a crank beside it gives the period."""
    ground, parameters = (
        {"ground": True},
        {"speed": "24 rad/s", "mean": "1 N", "change": "1 N", "damping": "0.2 1/s"},
    )
    load = {"point": "B", "force": ["-mean - change*cos(speed*t)", "0 N"]}
    column = {
        "points": ["A", "B"],
        "density": f"{DENSITY} kg/m^3",
        "section": {"width": "20 mm", "thickness": "2 mm"},
        "elastic": {"E": "210 GPa", "elements": elements, "damping": {"mass": "damping"}, **elastic},
    }
    held = (
        {
            "welds": [{"point": "A", "links": ["column"]}],
            "forces": [{**load, "link": "column"}],
        }
        if follower
        else {"guides": [{"points": ["B"], "along": "rail"}], "forces": [load]}
    )
    return symgen.Scene(
        parameters={name: {"value": value, "tunable": True} for name, value in parameters.items()},
        points={
            "O": {"at": ["0 m", "-0.5 m"], **ground},
            "K": {"at": ["0.1 m", "-0.5 m"]},
            "A": {"at": ["0 m", "0 m"], **ground},
            "B": {"at": ["1 m", "0 m"]},
            "R": {"at": ["0.5 m", "0 m"], **ground},
            "S": {"at": ["2 m", "0 m"], **ground},
        },
        links={
            "crank": {"points": ["O", "K"], "mass": "0.1 kg"},
            "column": column,
            "rail": {"points": ["R", "S"]},
        },
        crank={"link": "crank", "speed": "speed"},
        **held,
    )


def largest(speed, mean, change, damping):
    """Largest multiplier of q'' + c q' + w^2 (1 - (mean + change cos speed t)/n^2) q = 0, w = n^2 w_1."""
    period, sizes = 2 * math.pi / speed, [math.exp(-damping * math.pi / speed)]
    for n in range(1, 7):

        def rates(t, y, n=n):
            load = (mean + change * math.cos(speed * t)) / n**2
            return [y[1], -damping * y[1] - (n**2 * LOWEST) ** 2 * (1 - load) * y[0]]

        columns = [
            solve_ivp(rates, (0, period), start, method="DOP853", rtol=1e-13, atol=1e-16).y[:, -1]
            for start in ([1.0, 0.0], [0.0, n**2 * LOWEST])
        ]
        transition = np.array([columns[0], columns[1] / (n**2 * LOWEST)]).T
        sizes.append(max(abs(np.linalg.eigvals(transition))))
    return max(sizes)


@pytest.fixture(scope="module")
def pinned():
    return symgen.build(column())


#: Speed over that of the lowest frequency, mean and change of the load over Euler's, and damping [1/s].
CHART = [
    (23.72 / LOWEST, 0.2, 0.35, 0.2),
    (1.8, 0.2, 0.35, 0.2),
    (1.0, 0.0, 0.8, 0.05),
    *(
        full(*point)
        for point in (
            (2.0, 0.0, 0.3, 0.2),
            (1.5, 0.0, 0.3, 0.2),
            (2.3, 0.0, 0.6, 0.5),
            (1.79, 0.2, 0.1, 0.2),
            (0.9, 0.2, 0.75, 0.3),
            (0.6, 0.3, 0.6, 0.1),
            (0.45, 0.1, 0.5, 1.0),
            (3.0, 0.5, 0.4, 0.02),
            (1.3, 0.3, 0.9, 2.0),
        )
    ),
]


@pytest.mark.parametrize(("speed", "mean", "change", "damping"), CHART)
def test_multipliers_of_a_column_are_those_of_hills_equation(pinned, speed, mean, change, damping):
    """With default settings, within the reported error: bending of any speed decays by exp(-c T/2)."""
    speed *= LOWEST
    values = {"speed": speed, "mean": mean * EULER, "change": change * EULER, "damping": damping}
    run = pinned.with_parameters(**values).periodic(samples=31)
    exact = largest(speed, mean, change, damping)
    error = run.statistics["floquet_error"]
    assert abs(abs(run.floquet[0]) - exact) <= error + EXACT
    assert error < 1e-3 * exact
    assert run.stable is bool(exact < 1)


def test_inextensible_columns_have_the_same_multipliers(pinned):
    values = {"speed": 23.72, "mean": 0.2 * EULER, "change": 0.35 * EULER, "damping": 0.2}
    rigid = symgen.build(column(axial=False)).with_parameters(**values).periodic(samples=2)
    axial = pinned.with_parameters(**values).periodic(samples=2)
    assert abs(axial.floquet[0]) == pytest.approx(abs(rigid.floquet[0]), abs=1e-10)


def flutter(load):
    """Growth rate [1/s] of a clamped column under a follower force, by its characteristic equation.

    M. Beck, Die Knicklast des einseitig eingespannten, tangential gedrueckten Stabes, ZAMP 3 (1952): with
    p = P L^2/EI, s the frequency over sqrt(EI/(m L^4)), a^2, b^2 = sqrt(p^2/4 + s^2) +- p/2,
    p^2 + 2 s^2 (1 + cos a cosh b) + p s sin a sinh b = 0.
    """

    def missed(x):
        s = complex(*x)
        middle = np.sqrt(load**2 / 4 + s * s)
        a, b = np.sqrt(middle + load / 2), np.sqrt(middle - load / 2)
        value = load**2 + 2 * s * s * (1 + np.cos(a) * np.cosh(b)) + load * s * np.sin(a) * np.sinh(b)
        return [value.real, value.imag]

    solved = root(missed, [11.0, -0.4])
    assert max(map(abs, missed(solved.x))) < 1e-9
    return -solved.x[1] * math.sqrt(STIFFNESS / MASS) / LENGTH**2


def test_a_flutter_that_steps_do_not_resolve_is_found():
    """Its frequency is 250 times that of the crank, far beyond a third of the steps per revolution."""
    load, model = 20.07, symgen.build(column(elements=6, follower=True))
    growth = flutter(load)
    speed = 11.0 * math.sqrt(STIFFNESS / MASS) / 250
    values = {"speed": speed, "mean": load * STIFFNESS, "change": 0.0, "damping": 0.0}
    run = model.with_parameters(**values).periodic(samples=31, steps=64)
    period = 2 * math.pi / speed
    assert growth > 0 and math.log(abs(run.floquet[0])) == pytest.approx(growth * period, rel=1e-2)
    assert run.stable is False
    below = model.with_parameters(**values | {"mean": 20.0 * STIFFNESS}).periodic(samples=31, steps=64)
    assert abs(below.floquet[0]) == pytest.approx(1.0, abs=1e-6)
