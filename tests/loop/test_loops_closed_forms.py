"""Closed forms of the literature, which the one generic solver of loops has to meet over the whole range."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shared.crank_vectors import Crank
from shared.jets import Jet, Real, about_x, about_z, cos, sin, vector
from shared.loop_scenes import (
    BETA,
    PLANAR,
    RCCC,
    RCCC_5,
    RSSR,
    bennett,
    bennett_ratio,
    bricard_phi,
    planar_4r,
    rssr_rocker,
    turned,
)

import symgen
from symgen.errors import SymgenError

EXACT = 1e-12
SPEED = 2 * math.pi  # 60 rpm


def motion(run, name):
    """A variable with its rates, in SI."""
    return Jet(*(run.variable(name + suffix).values for suffix in ("", ".rate", ".acceleration")))


def vanishes(x, size=1.0, tolerance=EXACT):
    """Value, rate (over the crank's speed) and acceleration (over its square)."""
    for part, scale in zip(x.parts, (1.0, SPEED, SPEED**2), strict=True):
        assert np.max(np.abs(part)) <= tolerance * size * scale


def freudenstein(lengths, phi, psi):
    """Of crank and rocker angle, the rocker's pivot at (-a4, 0)."""
    a1, a2, a3, a4 = lengths
    k1, k2, k3 = a4 / a1, a4 / a3, (a1**2 - a2**2 + a3**2 + a4**2) / (2 * a1 * a3)
    return k3 - k1 * cos(psi) + k2 * cos(phi) - cos(phi - psi)


def test_planar_4r_is_freudensteins():
    a1, _, a3, _ = PLANAR
    run = turned("planar_4r")
    t = [motion(run, f"theta{i}") for i in range(1, 5)]
    phi, coupler = t[0], t[0] + t[1]
    psi = coupler + t[2] + math.pi
    vanishes(freudenstein(PLANAR, phi, psi), 3.0)
    whole = (t[0] + t[1] + t[2] + t[3]) / (2 * math.pi)
    vanishes(whole - float(np.round(whole.value[0])))
    # ratio of angular velocities
    ratio = a1 * sin(coupler - phi) / (a3 * sin(coupler - psi))
    assert np.max(np.abs(psi.rate / phi.rate - ratio.value)) <= EXACT
    assert np.ptp(phi.value) == pytest.approx(2 * math.pi, rel=1e-15)


@pytest.mark.parametrize(("low", "high", "turns"), [(-130.0, 150.0, True), (-138.0, 138.0, False)])
def test_through_where_the_input_turns_back(low, high, turns):
    """A crank that only rocks: on through its end, where coupler and rocker fold, to the other branch."""
    lengths = (0.3, 0.4, 0.2, 0.25)
    model = symgen.build(planar_4r(lengths))
    run = model.inverse_dynamics(math.radians(low), math.radians(high), samples=300, through=True)
    t = [Jet(run.variable(f"theta{i}").values) for i in range(1, 5)]
    phi, psi = t[0], t[0] + t[1] + t[2] + math.pi
    vanishes(freudenstein(lengths, phi, psi), 3.0)
    degrees = np.degrees(phi.value.astype(float))
    end = math.degrees(math.acos((0.2**2 - 0.3**2 - 0.25**2) / (2 * 0.3 * 0.25)))
    assert degrees[0] == pytest.approx(low, abs=1e-9)
    assert degrees[-1] == pytest.approx(low if turns else high, abs=1e-9)
    assert np.min(degrees) >= low - 1e-9
    if turns:
        assert end - 0.1 < np.max(degrees) < end
        assert abs(psi.value[0] - psi.value[-1]) > 0.1
        assert f"{end:.6f}" in run.notes[0]
    else:
        assert run.notes == ()


def test_both_closures_of_the_slider_quadratic():
    """S4 = -b +- sqrt(b^2 - q), the scene's own first; ball angles have two ways to say the same."""
    crank = Crank(a4=30.0)
    both = [
        float(crank.motion(Jet([math.pi / 4]), Jet([9.0]), branch=branch).S4.value[0]) * 0.0254
        for branch in (1, -1)
    ]
    model = symgen.build("slider_crank").with_parameters(a4=30 * 0.0254, S1=9 * 0.0254)
    found = [x["S4"] for x in model.assemblies(math.pi / 4)]
    assert found[0] == pytest.approx(both[0], abs=EXACT)
    errors = [min(abs(S4 - b) for b in both) for S4 in found]
    assert max(errors) <= EXACT
    assert {min(range(2), key=lambda k: abs(S4 - both[k])) for S4 in found} == {0, 1}


def test_cardan():
    run = turned("cardan")
    t1, t4 = motion(run, "theta1"), motion(run, "theta4")
    beta = math.radians(BETA)
    vanishes(sin(t1) * sin(t4) - cos(t1) * cos(t4) * math.cos(beta))
    ratio = -math.cos(beta) / (1 - math.sin(beta) ** 2 * np.cos(t1.value) ** 2)
    assert np.max(np.abs(t4.rate / t1.rate - ratio)) <= EXACT
    slope = -np.sin(2 * t1.value) * math.sin(beta) ** 2 / (1 - math.sin(beta) ** 2 * np.cos(t1.value) ** 2)
    assert np.max(np.abs(t4.second / t1.rate**2 - ratio * slope)) <= EXACT


def test_rssr_keeps_the_length_of_its_coupler():
    """Hartenberg and Denavit's displacement equation, in crank and rocker angle alone, and its rates."""
    run = turned("rssr")
    theta1, theta4 = motion(run, "theta1"), motion(run, "theta4")
    zero = Jet(np.zeros_like(theta1.value))
    ball = vector(-RSSR["a3"] * cos(theta4), RSSR["a3"] * sin(theta4), zero - RSSR["S4"])
    far = (about_x(zero - math.radians(RSSR["alpha4"])) @ ball[..., None])[..., 0]
    far = far - np.array([RSSR["a4"], 0, 0])
    rod = far - vector(RSSR["a1"] * cos(theta1), RSSR["a1"] * sin(theta1), zero)
    vanishes(rod.dot(rod) - RSSR["a2"] ** 2, RSSR["a2"] ** 2)
    turns = (theta4.value - [rssr_rocker(float(x)) for x in theta1.value]) / (2 * math.pi)
    assert np.max(np.abs(turns - np.round(turns))) <= EXACT


class Line:
    """A line by its direction and its moment about the origin."""

    def __init__(self, direction, moment):
        self.direction, self.moment = direction, moment

    def __matmul__(self, other):
        """Cosine of the angle between two lines, and its dual part: minus distance times sine."""
        dual = self.direction.dot(other.moment) + self.moment.dot(other.direction)
        return self.direction.dot(other.direction), dual


def axes_of(t, s, alpha, a):
    """The joint axes of a closed loop of four in {1}: two seen along the loop, two against it."""
    zero = Jet(np.zeros_like(t[0].value))

    def line(turn, place):
        direction = turn[..., :, 2]
        return Line(direction, place.cross(direction))

    def out(turn, place, i):
        turn, place = turn @ about_z(t[i]), place + turn[..., :, 2] * s[i][..., None]
        return turn @ about_x(zero + alpha[i]), place + turn[..., :, 0] * Real(a[i])

    def back(turn, place, i):
        turn, place = turn @ about_x(zero - alpha[i]), place - turn[..., :, 0] * Real(a[i])
        return turn @ about_z(-t[i]), place - turn[..., :, 2] * s[i][..., None]

    still = about_z(zero), vector(zero, zero, zero)
    second = out(*still, 0)
    fourth = back(*still, 3)
    third = back(*fourth, 2)
    return [line(*still), line(*second), line(*third), line(*fourth)]


@pytest.mark.parametrize("pitch", [None, 0.25])
def test_rccc_input_output_equation_and_its_dual_part(pitch):
    """Lines 2 and 3, each placed from the frame alone, keep their angle and their distance (transference)."""
    run = turned("rccc", pitch)
    t = [motion(run, f"theta{i}") for i in range(1, 5)]
    first = Jet(np.zeros_like(t[0].value)) if pitch is None else t[0] * pitch
    s = [first] + [motion(run, f"S{i}") for i in range(2, 5)]
    alpha = [math.radians(x) for x in RCCC["alpha"]]
    lines = axes_of(t, s, alpha, RCCC["a"])
    for i in range(4):
        cosine, moment = lines[i] @ lines[(i + 1) % 4]
        vanishes(cosine - math.cos(alpha[i]))
        vanishes(moment + RCCC["a"][i] * math.sin(alpha[i]), 10.0)
    # the spherical equation in the two angles of the frame's joints only
    s_, c_ = [math.sin(x) for x in alpha], [math.cos(x) for x in alpha]
    t1, t4 = t[0], t[3]
    equation = (
        s_[0] * sin(t1) * s_[2] * sin(t4)
        - s_[0] * s_[2] * c_[3] * cos(t1) * cos(t4)
        - s_[2] * s_[3] * c_[0] * cos(t4)
        - s_[0] * c_[2] * s_[3] * cos(t1)
        + c_[0] * c_[2] * c_[3]
        - c_[1]
    )
    vanishes(equation)


def test_rccc_at_five_degrees():
    run = turned("rccc", None)
    for name, value in RCCC_5.items():
        found = run.variable(name).values[0]
        expected = value if name[0] == "S" else math.radians(value)
        turns = 0 if name[0] == "S" else 2 * math.pi * round((found - expected) / (2 * math.pi))
        assert found - turns == pytest.approx(expected, abs=1e-6)


def test_bennett():
    run = turned("bennett")
    t = [motion(run, f"theta{i}") for i in range(1, 5)]
    # tan(t1/2) tan(t2/2) = ratio, free of poles
    half1, half2 = t[0] / 2, t[1] / 2
    vanishes(sin(half1) * sin(half2) - bennett_ratio() * cos(half1) * cos(half2))
    for one, other in ((0, 2), (1, 3)):
        whole = (t[one] + t[other]) / (2 * math.pi)
        vanishes(whole - float(np.round(whole.value[0])))


def test_bennett_off_its_condition_does_not_assemble():
    """Twists 40 and 100 deg, but a/sin(alpha) not the same: four screws of rank 4, and no closure nearby."""
    with pytest.raises(SymgenError) as error:
        symgen.build(bennett(1.05)).inverse_dynamics()
    text = str(error.value)
    assert "assembl" in text or "close" in text
    assert "\n" in text  # and what to do


@pytest.mark.parametrize(("alpha", "low", "high"), [(90.0, -110.0, 110.0), (60.0, 20.0, 150.0)])
def test_bricard(alpha, low, high):
    run = turned("bricard", alpha, low, high, samples=89)
    t = [motion(run, f"theta{i}") for i in range(1, 7)]
    twist = math.radians(alpha)
    c, s = math.cos(twist), math.sin(twist)
    theta, phi = t[0], t[1]
    vanishes(
        c**2
        + s**2 * (cos(theta) + cos(phi))
        + (1 + c**2) * cos(theta) * cos(phi)
        - 2 * c * sin(theta) * sin(phi)
    )
    for i in range(2, 6):
        vanishes(t[i] - t[i % 2])
    expected = [bricard_phi(twist, float(x)) for x in theta.value]
    assert np.max(np.abs(phi.value - expected)) <= EXACT


@pytest.mark.parametrize("name", ["planar_4r", "cardan", "rssr", "rccc", "bennett"])
def test_closed_everywhere(name):
    arguments = (None,) if name == "rccc" else ()
    assert turned(name, *arguments).closure <= 1e-13


@pytest.mark.parametrize(
    ("case", "rank"),
    [
        (("planar_4r",), 3),
        (("cardan",), 3),
        (("bennett",), 3),
        (("bricard", 90.0, -110.0, 110.0), 5),
        (("rssr",), 6),
        (("rccc", None), 6),
    ],
    ids=lambda c: c[0] if isinstance(c, tuple) else str(c),
)
def test_rank_of_the_screws(case, rank):
    """Of the dependent variables: as many as they are, so that one freedom is left to the input."""
    more = {"samples": 89} if case[0] == "bricard" else {}
    assert turned(*case, **more).statistics["rank"] == rank


def test_the_end_of_a_driven_loop_is_that_of_its_outputs():
    """``final`` has every variable of the loop, in SI, for an analysis at values of the input too."""
    model = symgen.build("slider_crank", set={"alpha4": "0 deg", "a4": "0 in", "S1": "0 in"})
    found = model.kinematics(at=[0.5, 1.0])
    assert set(found.final) == {v.name for v in model.description.variables}
    assert found.final["theta1"]["value"] == pytest.approx(1.0, abs=1e-14)
    assert found.final["S4"]["unit"] == "m"
    assert found.final["S4"]["value"] == found["S4"].values[-1]
    assert found.final["S4"]["rate"] == found["S4.rate"].values[-1]
