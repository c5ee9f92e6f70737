"""The thesis' closed form of four-bars: its letters, and motions against the intersection of two circles."""

from __future__ import annotations

import random
import re
from functools import cache

import mpmath as mp
import pytest
import shared.elastic_golden as golden
import sympy as sp
from shared.commands import call
from shared.equations import found

import symgen
from symgen.errors import ModelError
from symgen.models import BLOCKS
from symgen.pipeline.subject import Subject

INPUTS = "a b c d theta1 theta1_rate theta1_acceleration branch"


@cache
def system():
    return BLOCKS["four_bar_motion"]()


@cache
def compiled(name):
    return sp.lambdify(
        [sp.Symbol(x, real=True) for x in INPUTS.split()], [*system().expanded(name)], "mpmath"
    )


#: Rows of (4.18)-(4.39) and (4.42)-(4.51), in their order.
PRINTED = {
    "K1": "d/a", "K2": "d/c", "K3": "(a**2 - b**2 + c**2 + d**2)/(2*a*c)",
    "K4": "d/b", "K5": "(c**2 - d**2 - a**2 - b**2)/(2*a*b)",
    "K6": "cos(theta1) - K1 - K2*cos(theta1) + K3", "K7": "-2*sin(theta1)",
    "K8": "K1 - (K2 + 1)*cos(theta1) + K3", "K9": "cos(theta1) - K1 + K4*cos(theta1) + K5",
    "K10": "K1 + (K4 - 1)*cos(theta1) + K5",
    "theta3": "2*atan((-K7 + branch*sqrt(K7**2 - 4*K6*K8))/(2*K6))",
    "theta2": "2*atan((-K7 + branch*sqrt(K7**2 - 4*K9*K10))/(2*K9))",
    "theta2_rate": "a*theta1_rate*sin(theta3 - theta1)/(b*sin(theta2 - theta3))",
    "theta3_rate": "a*theta1_rate*sin(theta2 - theta1)/(c*sin(theta2 - theta3))",
    "theta2_acceleration": "(H1*H2 - H3*H4)/(H3*H5 - H6*H2)",
    "theta3_acceleration": "(H1*H5 - H6*H4)/(H3*H5 - H6*H2)",
    "H1": "a*theta1_acceleration*sin(theta1) + a*theta1_rate**2*cos(theta1)"
          " + b*theta2_rate**2*cos(theta2) - c*theta3_rate**2*cos(theta3)",
    "H2": "c*cos(theta3)", "H3": "c*sin(theta3)",
    "H4": "a*theta1_acceleration*cos(theta1) - a*theta1_rate**2*sin(theta1)"
          " - b*theta2_rate**2*sin(theta2) + c*theta3_rate**2*sin(theta3)",
    "H5": "b*cos(theta2)", "H6": "b*sin(theta2)",
    "A_x": "a*cos(theta1)", "A_y": "a*sin(theta1)", "B_x": "Q_x + c*cos(theta3)", "B_y": "Q_y + c*sin(theta3)",
    "G1_x": "(M_x + A_x)/2", "G1_y": "(M_y + A_y)/2", "G2_x": "(A_x + B_x)/2", "G2_y": "(A_y + B_y)/2",
    "G3_x": "(B_x + Q_x)/2", "G3_y": "(B_y + Q_y)/2",
}  # fmt: skip


def test_every_number_is_a_row_of_the_thesis():
    numbers = [*range(18, 40), *range(42, 52)]
    names = {x.name: x.symbol for x in system().quantities()}
    block = Subject("four_bar_motion", {})
    for number, (row, text) in zip(numbers, PRINTED.items(), strict=True):
        (m,) = found(block, f"4.{number}")
        assert m.rows == (row,) and f"{row} (4.{number})" in m.source
        assert sp.simplify(m.matrix[0] - sp.sympify(text, names)) == 0, row
    ground = {x: names[x] for x in ("M_x", "M_y", "Q_x", "Q_y")}
    values = {d.quantity.symbol: d.expression for d in system().definitions}
    assert [values[x] for x in ground.values()] == [0, 0, names["d"], 0]
    (equation,) = found(block, "(4.17)")
    assert equation.name == "freudenstein" and equation.rows == ("output",)
    for number in ("4.40", "4.41"):
        assert [m.name for m in found(block, number)] == ["point_accelerations"]


def test_python_command_and_other_models():
    assert symgen.derive("four_bar_motion")["ratios"] == system()["ratios"]
    text = call("show", "four_bar_motion", "4.28")
    assert "4⋅K₆⋅K₈" in text and "K₁₀" not in text
    last = call("show", "four_bar_motion", "4.51")
    letters = [line.split()[0] for line in last[last.index("where") :].splitlines()[1:]]
    assert "Q_y = 0" in last and letters == ["B_y"] and "(4.45)" in last
    with pytest.raises(ModelError, match=re.escape('thesis: symgen show four_bar_motion "(4.31)"')):
        Subject("rod", {}).found("4.31")


def circles(lengths, branch):
    """Return the joint B and the angles of coupler and output link by the crank's, from circles about A and Q."""
    a, b, c, d = lengths

    def at(crank):
        joint = a * mp.expj(crank)
        way = d - joint
        along = (b**2 - c**2 + abs(way) ** 2) / (2 * abs(way))
        end = joint + way / abs(way) * mp.mpc(along, -branch * mp.sqrt(b**2 - along**2))
        return end, mp.arg(end - joint), mp.arg(end - d)

    return at


#: Least and largest lengths of crank, coupler, output link and ground in hundredths, and a crank angle [deg].
LINKAGES = {
    "crank-rocker": (((20, 40), (80, 90), (80, 99), (70, 90)), (-180, 180)),
    "drag link": (((80, 90), (70, 90), (80, 99), (20, 40)), (-180, 180)),
    "rocker-crank": (((80, 90), (80, 90), (20, 40), (80, 99)), (50, 70)),
    "triple-rocker": (((61, 69), (50, 59), (61, 69), (100, 110)), (-60, 60)),
}


@pytest.mark.parametrize("branch", [-1, 1])
@pytest.mark.parametrize("linkage", LINKAGES)
@pytest.mark.parametrize("seed", range(2))
def test_motion_is_that_of_intersecting_circles(linkage, branch, seed):
    drawn = random.Random(seed)
    ranges, turned = LINKAGES[linkage]
    with mp.workdps(50):
        lengths = [mp.mpf(drawn.randint(*x)) / 97 for x in ranges]
        shortest, *between, longest = sorted(lengths)
        assert (shortest + longest < sum(between)) == (linkage != "triple-rocker")
        crank = mp.radians(drawn.uniform(*turned))
        rate, second = (mp.mpf(drawn.randint(-99, 99)) / 31 for _ in range(2))
        given = (*lengths, crank, rate, second, branch)
        at = circles(lengths, branch)
        assert mp.im(at(crank)[1]) == 0

        def same(name, expected):
            pairs = zip(compiled(name)(*given), expected, strict=True)
            assert max(abs(x - y) / (1 + abs(y)) for x, y in pairs) < 1e-30, name

        def places(time):
            angle = crank + rate * time + second * time**2 / 2
            joint, end = lengths[0] * mp.expj(angle), at(angle)[0]
            points = (joint, end, joint / 2, (joint + end) / 2, (end + lengths[-1]) / 2)
            return [part for x in points for part in (mp.re(x), mp.im(x))]

        def rates(n):
            """Return the n-th rates of the angles, by the chain rule through the angle of the crank."""
            slopes = [[mp.diff(lambda x, k=k: at(x)[k], crank, i) for i in (1, 2)] for k in (1, 2)]
            return [x * rate if n == 1 else x * second + y * rate**2 for x, y in slopes]

        same("angles", at(crank)[1:])
        same("angular_velocities", rates(1))
        same("angular_accelerations", rates(2))
        same("closure", [0, 0])
        same("freudenstein", [0, 0])
        same("joints", places(0)[:4])
        same("centres", places(0)[4:])
        same("point_accelerations", [mp.diff(lambda x, i=i: places(x)[i], 0, 2) for i in range(10)])


def test_numbers_are_those_of_the_thesis():
    """Golden angles [deg], rates and accelerations at 373 rpm, and the printed places of A and B at 16 degrees."""
    inches = [mp.mpf(x) for x in (7, 10, 12, 11)]
    rate = 2 * mp.pi * 373 / 60
    for at, expected in zip(golden.DEGREES, golden.KINEMATICS, strict=True):
        given = (*inches, mp.radians(at), rate, 0, -1)
        motion = [*map(mp.degrees, compiled("angles")(*given)), *compiled("angular_velocities")(*given)]
        motion += compiled("angular_accelerations")(*given)
        assert [float(x) for x in motion] == pytest.approx(expected, rel=1e-8), at
    feet = [x / 12 * 10000 for x in inches]
    assert [float(x) for x in compiled("joints")(*feet, mp.radians(16), 0, 0, -1)] == pytest.approx(
        [5607.360, 1607.880, 7156.710, 9795.920], abs=5e-3
    )
