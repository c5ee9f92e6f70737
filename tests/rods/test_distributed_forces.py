"""Forces along links, distributed and at points: against closed forms, and against gravity, which is one."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from scipy.linalg import eigh

import symgen
from symgen.errors import SceneError

LENGTH, WIDTH, THICKNESS, E = 1.3, 0.03, 0.01, 210e9
BENDING = E * WIDTH * THICKNESS**3 / 12

#: A beam from A, which a crank at rest holds, to P, which a rail along the beam guides; 30 degrees steep.
BEAM = """
symgen = 1
[parameters]
q = { value = "0 N/m", tunable = true }
f = { value = "0 N", tunable = true }
steep = "30 deg"
c = "cos(steep)"
s = "sin(steep)"
l = "1.3 m"
[points]
O = { at = ["0 m", "-1 m"], ground = true }
A = { at = ["0 m", "0 m"] }
P = { at = ["c*l", "s*l"] }
R = { at = ["2*c*l", "2*s*l"], ground = true }
S = { at = ["3*c*l", "3*s*l"], ground = true }
X = { on = "beam", fraction = 0.3 }
[links]
rail = { points = ["R", "S"] }
crank = { points = ["O", "A"], mass = "1 kg" }
[links.beam]
points = ["A", "P"]
density = "7850 kg/m^3"
section = { width = "30 mm", thickness = "10 mm" }
elastic = { E = "210 GPa", elements = 10 }
[[guides]]
points = ["P"]
along = "rail"
[crank]
link = "crank"
speed = "0 rpm"
[[stations]]
link = "beam"
at = 0.5
name = "middle"
"""
UNIFORM = '[[distributed_forces]]\nlink = "beam"\nforce = ["0 N/m", "-q"]\naxes = "link"\n'
FIXED = '[[distributed_forces]]\nlink = "beam"\nforce = ["q*s", "-q*c"]\n'
RISING = '[[distributed_forces]]\nlink = "beam"\nforce = ["0 N/m", "0 N/m"]\nend = ["0 N/m", "-q"]\naxes = "link"\n'
POINT = '[[forces]]\npoint = "X"\nforce = ["f*s", "-f*c"]\n'
PRESSED = '[[distributed_forces]]\nlink = "beam"\nforce = ["-q", "0 N/m"]\naxes = "link"\n'
PUSHED = '[[forces]]\npoint = "X"\nforce = ["-f*c", "-f*s"]\n'


def built(text):
    return symgen.build(symgen.Scene(**tomllib.loads(text)).called("beam_under_load"))


def bent(model):
    """Return bending moment [N m] and deflection to the left [m] of the middle, loads at rest."""
    result = model.quasi_static(samples=2)
    moment = result["middle.bending_strain"][-1] * BENDING / (THICKNESS / 2)
    motion = model.motion(True)
    unknowns = motion.layout.names.index("beam.w@6")
    _, _, _, stiffness, load, basis = motion.equations().matrices(0.0)
    found = np.linalg.solve(stiffness, load)
    return moment, (found if basis is None else basis[0] @ found)[unknowns]


@pytest.mark.parametrize(
    "load, moment, deflection",
    [
        (UNIFORM, LENGTH**2 / 8, 5 * LENGTH**4 / 384),
        (FIXED, LENGTH**2 / 8, 5 * LENGTH**4 / 384),
        (RISING, LENGTH**2 / 16, 5 * LENGTH**4 / 768),
        (POINT, 0.3 * LENGTH / 2, 0.3 * LENGTH**3 * (3 - 4 * 0.3**2) / 48),
    ],
    ids=["uniform", "uniform on fixed axes", "rising", "force at 0.3 of the length"],
)
def test_simply_supported_beam(load, moment, deflection):
    """Moment and deflection of the middle per unit of load; these elements hold the polynomials exactly."""
    model = built(BEAM + load).with_parameters(q=2.0, f=2.0)
    found, sag = bent(model)
    assert found == pytest.approx(2 * moment, rel=1e-8)
    assert sag == pytest.approx(-2 * deflection / BENDING, rel=1e-8)


def ritz(before, terms=60):
    """Return the buckling factor of a beam with pinned ends, pressed by ``before(x/l)``, over E I/l^2."""
    points, weights = np.polynomial.legendre.leggauss(400)
    x, weights = (points + 1) / 2, weights / 2
    orders = np.pi * np.arange(1, terms + 1)
    slopes = orders[:, None] * np.cos(np.outer(orders, x))
    pressed = (slopes * weights * before(x)) @ slopes.T
    return 1 / eigh(pressed, np.diag(orders**4 / 2), eigvals_only=True)[-1]


@pytest.mark.parametrize(
    "load, name, before",
    [(PRESSED, "q", lambda x: 1 - x), (PUSHED, "f", lambda x: np.where(x < 0.3, 1.0, 0.0))],
    ids=["distributed", "force at 0.3 of the length"],
)
def test_axial_loads_along_a_beam_buckle_it(load, name, before):
    """The axial force on the elements is that of the loads behind them: 18.57 E I/l^2 where it is uniform."""
    model = built(BEAM + load)

    def stiffness(value):
        motion = model.with_parameters(**{name: value}).motion(True)
        found = motion.equations().matrices(0.0)[3]
        return (found + found.T) / 2

    free, loaded = stiffness(0.0), stiffness(1.0)
    critical = 1 / eigh(free - loaded, free, eigvals_only=True)[-1]
    expected = ritz(before) * BENDING / LENGTH**2
    critical *= LENGTH if name == "q" else 1.0
    if name == "q":
        assert ritz(before) == pytest.approx(18.5687, rel=1e-5)
    assert critical == pytest.approx(expected, rel=1e-4 if name == "q" else 2e-3)


FOUR_BAR = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.1 m", "0 m"] }
B = { at = ["0.3 m", "0.3 m"] }
Q = { at = ["0.4 m", "0 m"], ground = true }
[links.crank]
points = ["O", "A"]
mass = "0 kg"
[links.coupler]
points = ["A", "B"]
density = "7850 kg/m^3"
section = { width = "20 mm", thickness = "2 mm" }
elastic = { E = "210 GPa", elements = 2 }
[links.rocker]
points = ["B", "Q"]
density = "7850 kg/m^3"
section = { width = "20 mm", thickness = "2 mm" }
elastic = { E = "210 GPa", reduction = "REDUCTION" }
[crank]
link = "crank"
speed = "200 rpm"
"""
GRAVITY = '[gravity]\nacceleration = ["0 m/s^2", "-900 m/s^2"]\n'
SAME = "".join(
    f'[[distributed_forces]]\nlink = "{link}"\nforce = ["0 N/m", "{-7850 * 0.02 * 0.002 * 900!r} N/m"]\n'
    for link in ("coupler", "rocker")
)


def test_gravity_is_a_distributed_force():
    """A run under gravity and one under weight per length as a load agree, joint forces of the rest included."""
    text = FOUR_BAR.replace("REDUCTION", "guyan")
    runs = [built(text + load).simulate(method="gauss", steps=256, samples=9) for load in (GRAVITY, SAME)]
    free = built(text).simulate(method="gauss", steps=256, samples=9)
    for link in ("coupler", "rocker"):
        for what in ("bending_strain", "axial_strain"):
            a, b, unloaded = (r[f"{link}.{what}"] for r in (*runs, free))
            if (link, what) == ("rocker", "bending_strain"):
                # Loads between the ends of a reduced link do not bend it.
                assert max(np.max(np.abs(a)), np.max(np.abs(b))) < 1e-12
                continue
            assert np.max(np.abs(a - unloaded)) > 0.05 * np.max(np.abs(a))
            assert np.max(np.abs(a - b)) < 1e-9 * np.max(np.abs(a))


RIGID = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["1 m", "0 m"] }
B = { at = ["1 m", "-1 m"] }
[links]
upper = { points = ["O", "A"], mass = "2 kg" }
lower = { points = ["A", "B"], mass = "3 kg" }
[analysis]
t_end = "1 s"
outputs = ["A.position", "B.position", "upper.A.force", "O.reaction"]
"""


def test_rigid_links_under_a_distributed_force():
    weight = (
        '[[distributed_forces]]\nlink = "upper"\nforce = ["0 N/m", "-20 N/m"]\n'
        '[[distributed_forces]]\nlink = "lower"\nforce = ["0 N/m", "-30 N/m"]\n'
    )
    falling, loaded = (
        built(RIGID + load).simulate(rtol=1e-11, atol=1e-12)
        for load in ('[gravity]\nacceleration = ["0 m/s^2", "-10 m/s^2"]\n', weight)
    )
    for name in ("A.position", "B.position", "upper.A.force", "O.reaction"):
        assert np.allclose(loaded[name].values, falling[name].values, rtol=0, atol=1e-7)
    assert loaded.drift.energy < 1e-8 * 100


def test_load_that_rises_and_turns_with_the_link():
    """Across a pendulum, from 0 to 6 N/m: angular acceleration (6 l^2/3)/(m l^2/3), at every angle."""
    text = (
        'symgen = 1\n[points]\nO = { at = ["0 m", "0 m"], ground = true }\nA = { at = ["0 m", "2 m"] }\n'
        '[links]\nOA = { points = ["O", "A"], mass = "4 kg" }\n'
        '[[distributed_forces]]\nlink = "OA"\nforce = ["0 N/m", "0 N/m"]\nend = ["5 N/m", "6 N/m"]\naxes = "link"\n'
        '[analysis]\nt_end = "1 s"\noutputs = ["OA.angular_velocity"]\n'
    )
    result = built(text).simulate(rtol=1e-11, atol=1e-12)
    assert result["OA.angular_velocity"][-1] == pytest.approx((6 * 4 / 3) / (4 * 4 / 3), rel=1e-9)


@pytest.mark.parametrize(
    "load, words",
    [
        (UNIFORM.replace('"beam"', '"bean"'), ["[distributed_forces.0] link", "'bean'", "Did you mean 'beam'?"]),
        (UNIFORM.replace('"-q"', '"-5 N"'), ["[distributed_forces.0] force[1]", "a force per length", "a force"]),
        (UNIFORM.replace('"link"\n', '"global"\n'), ["[distributed_forces.0] axes", "'fixed', 'link' or 'section'"]),
        (UNIFORM.replace('"beam"', '"rail"'), ["[distributed_forces.0] link", "cannot turn"]),
    ],
    ids=["link", "unit", "axes", "rail"],
)  # fmt: skip
def test_bad_distributed_forces(load, words):
    with pytest.raises(SceneError) as caught:
        built(BEAM + load)
    for word in words:
        assert word in str(caught.value)


def test_none_in_space_and_none_by_elements():
    with pytest.raises(SceneError, match="in the plane, not in space"):
        built(
            'symgen = 1\n[points]\nO = { at = ["0 m", "0 m", "0 m"], ground = true }\nA = { at = ["1 m", "0 m", "0 m"] }\n'
            '[links]\nOA = { points = ["O", "A"], mass = "1 kg" }\n'
            '[[distributed_forces]]\nlink = "OA"\nforce = ["0 N/m", "0 N/m", "1 N/m"]\n'
        )
    driven = RIGID.partition("[analysis]")[0].replace("lower", "rail") + (
        '[parameters]\nw = "1 rad/s"\n[[drivers]]\nlink = "upper"\nangle = "w*t"\n'
        '[[distributed_forces]]\nlink = "upper"\nforce = ["0 N/m", "1 N/m"]\n'
    )
    driven = driven.replace('B = { at = ["1 m", "-1 m"] }', 'B = { at = ["2 m", "0 m"], ground = true }')
    driven = driven.replace('points = ["A", "B"], mass = "3 kg"', 'points = ["O", "B"]')
    with pytest.raises(SceneError, match="no distributed forces"):
        built(driven).inverse_dynamics()


def test_spring_at_the_end_of_an_elastic_link():
    """A cantilever on a shaft at rest, its tip on a spring: F/(3 E I/l^3 + k), and a pull on it."""
    text = (
        'symgen = 1\n[points]\nO = { at = ["0 m", "0 m"], ground = true }\nT = { at = ["1.3 m", "0 m"] }\n'
        'G = { at = ["1.3 m", "-0.5 m"], ground = true }\n[links.strip]\npoints = ["O", "T"]\n'
        'density = "7850 kg/m^3"\nsection = { width = "30 mm", thickness = "10 mm" }\n'
        'elastic = { E = "210 GPa" }\n[crank]\nlink = "strip"\nspeed = "0 rpm"\n'
        '[[springs]]\nbetween = ["T", "G"]\nstiffness = "500 N/m"\nlength = "0.5 m"\n'
        '[[forces]]\npoint = "T"\nforce = ["0 N", "-2 N"]\n'
    )
    tip = built(text).quasi_static(samples=2)["T.displacement"].values[-1, 1]
    assert tip == pytest.approx(-2 / (3 * BENDING / LENGTH**3 + 500), rel=1e-9)
