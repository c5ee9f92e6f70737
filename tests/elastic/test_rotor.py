"""Beam elements in space and rotors: against exact arithmetic, series of the differential equations, closed forms."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq
from shared.blades import flapping
from shared.shipped import derived

import symgen
from symgen.errors import CapabilityError, ModelError, SceneError
from symgen.mechanics.elastic import spatial
from symgen.runtime.beams.elements import kernels
from symgen.runtime.beams.modal.structure import modes_at_rest
from symgen.runtime.rotor.model import _modes_of
from symgen.runtime.rotor.structure import structure
from symgen.scene.elastic.spatial_section import torsion_constant
from symgen.scene.loading import read_scene
from symgen.scene.resolve import resolve

LENGTH, MU, JY, JZ, EA, EIY, EIZ, GJ = (q.symbol for q in spatial.SECTION)


@pytest.fixture(scope="module")
def matrices():
    made = derived("spatial_beam")
    return {m.name: m.matrix for m in made.matrices}


def at(*names):
    return [spatial.DOFS.index(name) for name in names]


def test_kinetic_energy_is_that_of_fibres():
    """Taylor coefficients of the energy of a section that rotates by any angle, at 30 digits."""
    draw = np.random.default_rng(3).uniform(-1, 1, (2, 6))
    omega, place, x = ([mpmath.mpf(k) / 7 for k in (3, -5, 2)], [mpmath.mpf(k) / 3 for k in (2, 1, -4)], 0.25)
    mu, jy, jz = mpmath.mpf(2), mpmath.mpf(3) / 10, mpmath.mpf(7) / 10

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    def rotated(vector, by):
        angle = mpmath.sqrt(sum(c * c for c in by))
        if not angle:
            return vector
        axis = [c / angle for c in by]
        along = sum(a * c for a, c in zip(axis, vector, strict=True))
        turned = cross(axis, vector)
        return [
            c * mpmath.cos(angle) + t * mpmath.sin(angle) + a * along * (1 - mpmath.cos(angle))
            for c, t, a in zip(vector, turned, axis, strict=True)
        ]

    def energy(size):
        # Four points of mass mu/4 at (+-y, +-z) have the second moments of the section.
        found = mpmath.mpf(0)
        for sign in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            fibre = [mpmath.mpf(0), sign[0] * mpmath.sqrt(jz / mu), sign[1] * mpmath.sqrt(jy / mu)]

            def position(t, fibre=fibre):
                u, v, w, phi, v_x, w_x = (size * (mpmath.mpf(a) + t * mpmath.mpf(b)) for a, b in draw.T)
                at_fibre = rotated(fibre, [phi, -w_x, v_x])
                return [c + d + e for c, d, e in zip(place, (x + u, v, w), at_fibre, strict=True)]

            step = mpmath.mpf(10) ** -16
            rates = [(b - a) / (2 * step) for a, b in zip(position(-step), position(step), strict=True)]
            velocity = [a + b for a, b in zip(rates, cross(omega, position(0)), strict=True)]
            found += mu / 8 * sum(c * c for c in velocity)
        return found

    values = dict(zip([q.symbol for q in (*spatial.OMEGA, *spatial.PLACED)], [*omega, *place], strict=True))
    values |= {spatial._X: x, MU: mu, JY: jy, JZ: jz}
    size = sp.Symbol("size")
    fields = dict(zip((*spatial._FIELDS, *spatial._RATES), draw.ravel(), strict=True))
    form = sp.lambdify(
        size, spatial.kinetic_energy().xreplace({k: size * v for k, v in fields.items()}).subs(values)
    )
    with mpmath.workdps(50):
        h = mpmath.mpf(10) ** -12
        exact = [energy(k * h) for k in (-1, 0, 1)]
        first, second = (exact[2] - exact[0]) / 2, exact[2] - 2 * exact[1] + exact[0]
        ours = [form(k * h) for k in (-1, 0, 1)]
        assert abs(ours[1] / exact[1] - 1) < 1e-14
        assert abs((ours[2] - ours[0]) / 2 / first - 1) < 1e-12
        assert abs((ours[2] - 2 * ours[1] + ours[0]) / second - 1) < 1e-10


def test_static_limits_are_exact(matrices):
    """A clamped element under a force, a couple and a torque at its tip, in rational numbers."""
    numbers = {LENGTH: sp.Rational(3, 2), EA: 7, EIY: 5, EIZ: 11, GJ: sp.Rational(2, 3)}
    stiffness = matrices["stiffness"].subs(numbers)
    free = [
        k for k, name in enumerate(spatial.DOFS) if name not in ("u1", "v1", "v_x1", "w1", "w_x1", "phi1")
    ]
    flexibility = stiffness.extract(free, free).inv()
    u, v, v_x, w, w_x, phi = (free.index(k) for k in at("u2", "v2", "v_x2", "w2", "w_x2", "phi2"))
    length = numbers[LENGTH]
    assert flexibility[w, w] == length**3 / (3 * numbers[EIY])
    assert flexibility[v, v] == length**3 / (3 * numbers[EIZ])
    assert flexibility[w_x, w_x] == length / numbers[EIY]
    assert flexibility[v, v_x] == length**2 / (2 * numbers[EIZ])
    assert flexibility[u, u] == length / numbers[EA]
    assert flexibility[phi, phi] == length / numbers[GJ]


def test_rigid_motions_are_free_and_have_their_mass(matrices):
    moved = {
        "along": {"u1": 1, "u2": 1},
        "by_y": {"v1": 1, "v2": 1},
        "about_x": {"phi1": 1, "phi2": 1},
        "about_z": {"v2": LENGTH, "v_x1": 1, "v_x2": 1},
    }
    shapes = {k: sp.Matrix([s.get(name, 0) for name in spatial.DOFS]) for k, s in moved.items()}
    mass = {k: sp.expand((s.T * matrices["mass"] * s)[0]) for k, s in shapes.items()}
    for shape in shapes.values():
        assert sp.expand(matrices["stiffness"] * shape) == sp.zeros(20, 1)
    assert mass["along"] == mass["by_y"] == MU * LENGTH
    assert sp.expand(mass["about_x"] - (JY + JZ) * LENGTH) == 0
    assert sp.expand(mass["about_z"] - MU * LENGTH**3 / 3 - JZ * LENGTH) == 0


#: Flapping frequencies of a uniform blade clamped at its axis, over sqrt(EI/(mu L^4)), by the speed in that
#: unit: A. D. Wright et al., J. Appl. Mech. 49 (1982) 197, and D. H. Hodges, M. J. Rutkowski, AIAA J. 19 (1981) 1459.
PUBLISHED = {
    0: (3.5160, 22.0345, 61.6972),
    1: (3.6816, 22.1810, 61.8418),
    3: (4.7973, 23.3203, 62.9850),
    6: (7.3604, 26.8091, 66.6839),
    12: (13.1702, 37.6031, 79.6145),
}


def test_series_are_the_published_frequencies():
    for speed, frequencies in PUBLISHED.items():
        for frequency in frequencies:
            assert float(flapping(speed, 0, frequency)) == pytest.approx(frequency, abs=6e-5)


BLADE = """
symgen = 1
title = "Blade"

[parameters]
speed = { value = "0 rad/s", tunable = true }
radius = { value = "0 m", tunable = true }
thickness = "0.1 mm"
length = "1 m"

[points]
root = { at = ["radius", "0 m", "0 m"], ground = true }
tip = { at = ["radius + length", "0 m", "0 m"] }

[links.blade]
points = ["root", "tip"]
mass_per_length = "1 kg/m"
section = { width = "thickness", thickness = "thickness", width_along = [0, 1, 0] }
elastic = { E = "12e16 Pa", elements = 8, shear = { poisson = 0 } }

[[welds]]
point = "root"
links = ["blade"]

[rotor]
axis = [0, 0, 1]
speed = "speed"
"""


def built(folder, text):
    file = folder / "rotor.toml"
    file.write_text(text)
    return symgen.build(str(file))


@pytest.fixture(scope="module")
def blade(tmp_path_factory):
    return built(tmp_path_factory.mktemp("blade"), BLADE)


def kinds(found):
    """Return angular frequencies by the kind of most of their strain energy."""
    names = list(found.parts)
    most = np.argmax([found.parts[k] for k in names], axis=0)
    return {k: 2 * math.pi * found.frequencies[most == i] for i, k in enumerate(names)}


@pytest.mark.parametrize(("speed", "radius"), [(0, 0), (3, 0), (12, 0), (5, 1)])
def test_flap_and_lag_of_a_rotating_blade(blade, speed, radius):
    modes = blade.with_parameters(speed=speed, radius=radius).modes()
    found, rotary = kinds(modes), 1e-8 / 12
    errors = modes.errors_of_elements[modes.parts["bending_thickness"] > 0.5]
    assert np.all(errors[:3] < 3e-8)
    flap, lag = found["bending_thickness"], found["bending_width"]
    for k in range(3):
        exact = float(flapping(speed, radius, float(flap[k]), rotary))
        assert flap[k] == pytest.approx(exact, rel=5e-9 + 1.1 * errors[k])
        # Lagging loses the speed's square exactly, and a little by Coriolis forces of stretching.
        assert lag[k] ** 2 == pytest.approx(exact**2 - speed**2, rel=3e-7)
    if not radius and speed in PUBLISHED:
        assert flap[:3] == pytest.approx(PUBLISHED[speed], abs=6e-5)


def test_error_of_elements_is_as_stated(blade):
    found = blade.with_parameters(speed=3).modes()
    flap = np.flatnonzero(found.parts["bending_thickness"] > 0.5)
    exact = [float(flapping(3, 0, 2 * math.pi * found.frequencies[k], 1e-8 / 12)) for k in flap[3:6]]
    true = 2 * math.pi * found.frequencies[flap[3:6]] / exact - 1
    assert found.errors_of_elements[flap[3:6]] == pytest.approx(true, rel=0.1)


def test_torsion_of_a_rotating_blade():
    """(GJ + N k^2) phi'' ... = 0 with the moments of rotation, by power series in x at 30 digits."""
    p = np.array([1 / 10, 1.0, 2e-3, 3e-2, 1e6, 1.0, 1.0, 0.8])
    speed, radius, count = 4.0, 0.5, 10
    twisted = at("phi1", "phi_x1", "phi2", "phi_x2")
    mass, stiffness = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for k in range(count):
        place = radius + k / count
        tension = speed**2 * ((radius + 1) ** 2 - place**2) / 2
        motion = np.array([0, 0, speed, place, 0, 0, tension])
        m, s, g, c = (
            getattr(kernels("spatial_beam"), name)(q=p, u=motion).reshape(20, 20)[np.ix_(twisted, twisted)]
            for name in ("mass", "stiffness", "geometric", "centrifugal")
        )
        own = np.ix_(range(2 * k, 2 * k + 4), range(2 * k, 2 * k + 4))
        mass[own] += m
        stiffness[own] += s + g - c
    lowest = np.sqrt(np.min(np.linalg.eigvals(np.linalg.solve(mass[1:, 1:], stiffness[1:, 1:])).real))
    polar, racket, torsion = p[2] + p[3], p[3] - p[2], p[7]

    def twist_rate(frequency):
        terms = [mpmath.mpf(0), mpmath.mpf(1)] + [mpmath.mpf(0)] * 98
        # Rigidity r0 + r1 x + r2 x^2.
        r0 = torsion + polar * speed**2 * (radius + mpmath.mpf(1) / 2)
        r1, r2 = -polar * speed**2 * radius, -polar * mpmath.mpf(speed) ** 2 / 2
        lost = racket * speed**2 - polar * frequency**2
        for k in range(98):
            slope = r1 * (k + 1) * terms[k + 1] + (r2 * k * terms[k] if k else 0)
            terms[k + 2] = (lost * terms[k] / (k + 1) - slope) / (r0 * (k + 2))
        return sum(k * c for k, c in enumerate(terms))

    with mpmath.workdps(30):
        exact = float(mpmath.findroot(twist_rate, float(lowest)))
    assert lowest == pytest.approx(exact, rel=1e-9)


def test_hinged_blade(tmp_path):
    """A ball joint at e: rigid flapping and lagging by the moments of tension about the joint.

    Rotation takes the stiffness J Omega^2 from flapping, and the free spin, which keeps its momentum, adds twice
    that.
    """
    hinged = BLADE.replace('[[welds]]\npoint = "root"\nlinks = ["blade"]\n', "")
    hinged = hinged.replace("0.1 mm", "1 cm").replace("12e16 Pa", "12e8 Pa")
    made = built(tmp_path, hinged).with_parameters(speed=0.02, radius=0.2).modes()
    frequencies, rotary = 2 * math.pi * made.frequencies[:3], 1e-4 / 12
    assert frequencies[0] == pytest.approx(0, abs=1e-6)  # it spins about its line
    moments = np.array([0.2 / 2, 1 / 3 + 0.2 / 2 + rotary])
    assert frequencies[1:] == pytest.approx(0.02 * np.sqrt(moments / (1 / 3 + rotary)), rel=1e-6)


def ball_jointed(folder, elements):
    text = BLADE.replace('[[welds]]\npoint = "root"\nlinks = ["blade"]\n', "")
    text = text.replace("0.1 mm", "1 cm").replace("12e16 Pa", "12e8 Pa")
    return built(folder, text.replace("elements = 8", f"elements = {elements}"))


def test_rigid_modes_have_shapes(tmp_path):
    """At rest a blade on a ball joint has three rotations about it; each point moves as its distance from it."""
    found = ball_jointed(tmp_path, 8).modes()
    assert np.all(found.frequencies[:3] == 0) and found.frequencies[3] > 1 and not found.notes
    shapes = found.shapes[:, :3]
    assert np.max(np.abs(shapes), axis=0) == pytest.approx([1, 1, 1], abs=1e-12)
    assert np.linalg.matrix_rank(shapes, tol=1e-6) == 3
    rows = dict(zip(found.names, shapes, strict=True))
    for field, tip in (("v", "tip.y"), ("w", "tip.z")):
        for node in range(1, 8):
            assert rows[f"blade.{field}@{node}"] == pytest.approx(node / 8 * rows[tip], abs=1e-7)
    for part in found.parts.values():
        assert np.all(part[:3] == 0)


def test_low_speeds_are_accurate_or_noted(tmp_path):
    """Of a blade on a ball joint rotation alone gives stiffness, which at low speed is below round-off of bending."""
    blade, rotary = ball_jointed(tmp_path, 8), 1e-4 / 12
    exact = np.sqrt(np.array([0.2 / 2, 1 / 3 + 0.2 / 2 + rotary]) / (1 / 3 + rotary))
    noted = []
    for speed in (1e-6, 1e-4, 0.1):
        found = blade.with_parameters(speed=speed, radius=0.2).modes()
        wrong = np.abs(2 * math.pi * found.frequencies[1:3] / speed / exact - 1) > 1e-3
        noted.append(any("not accurate" in note for note in found.notes))
        assert noted[-1] or not np.any(wrong)
        assert np.all(np.isinf(found.errors_of_elements[1:3][wrong]))
        json.dumps(found.summary(), allow_nan=False)
    assert noted == [True, True, False]


def test_whirling_shaft_with_a_disc_of_no_inertia(tmp_path):
    """In its own axes a round shaft of frequency w0 has w0 - Omega and w0 + Omega; a mass at its tip lowers w0."""
    text = (
        BLADE.replace("axis = [0, 0, 1]", "axis = [1, 0, 0]") + '[[masses]]\npoint = "tip"\nmass = "0.3 kg"\n'
    )
    square = '{ width = "thickness", thickness = "thickness", width_along = [0, 1, 0] }'
    text = text.replace(square, '{ diameter = "0.2 mm" }').replace("12e16 Pa", "1e16 Pa")
    shaft, stiff = built(tmp_path, text), 1e16 * math.pi * 2e-4**4 / 64

    def clamped(z):
        return (
            1
            + math.cos(z) * math.cosh(z)
            + 0.3 * z * (math.cos(z) * math.sinh(z) - math.sin(z) * math.cosh(z))
        )

    natural = brentq(clamped, 1.0, 1.87, xtol=1e-14) ** 2 * math.sqrt(stiff)
    speed = 0.4 * natural
    found = 2 * math.pi * shaft.with_parameters(speed=speed).modes().frequencies[:2]
    assert found == pytest.approx([natural - speed, natural + speed], rel=1e-7)
    with pytest.raises(ModelError, match="above its first critical speed"):
        shaft.with_parameters(speed=1.1 * natural).modes()


def test_overhung_disc(tmp_path):
    """A disc at the tip of a light shaft: complex whirl of two unknowns, seen in the rotating axes.

    -w^2 [m, 0; 0, Id] + w Omega [0, 0; 0, Ip] + EI [12/L^3, -6/L^2; -6/L^2, 4/L] is singular at forward whirl w.
    """
    square = '{ width = "thickness", thickness = "thickness", width_along = [0, 1, 0] }'
    text = BLADE.replace("axis = [0, 0, 1]", "axis = [1, 0, 0]").replace(square, '{ diameter = "20 mm" }')
    text = (
        text.replace("12e16 Pa", "2e11 Pa")
        .replace('"1 kg/m"', '"1e-5 kg/m"')
        .replace("elements = 8", "elements = 1")
    )
    text += '[[masses]]\npoint = "tip"\nmass = "5 kg"\ninertia = ["0.6 kg*m^2", "0.4 kg*m^2", "0.4 kg*m^2"]\n'
    shaft, stiff = built(tmp_path, text), 2e11 * math.pi * 0.02**4 / 64
    natural = math.sqrt(3 * stiff / 5)
    for speed in (0.0, 0.3 * natural):
        stiffness = stiff * np.array([[12, -6], [-6, 4]])
        determinant = (
            np.polynomial.Polynomial([stiffness[0, 0], 0, -5])
            * np.polynomial.Polynomial([stiffness[1, 1], 0.6 * speed, -0.4])
            - stiffness[0, 1] ** 2
        )
        whirls = determinant.roots().real
        found = 2 * math.pi * shaft.with_parameters(speed=speed).modes().frequencies
        # The shaft twists and stretches too.
        for whirl in whirls:
            assert np.min(np.abs(found - abs(whirl - speed))) < 1e-5 * natural


BENT = """
symgen = 1
[points]
O = { at = ["0 m", "0 m", "0 m"], ground = true }
A = { at = ["0 m", "0.8 m", "0 m"] }
B = { at = ["0.3 m", "0.8 m", "0.4 m"] }
[links]
[links.first]
points = ["O", "A"]
density = "1000 kg/m^3"
section = { diameter = "20 mm" }
elastic = { E = "200 GPa", elements = 1, shear = { modulus = "70 GPa" } }
[links.second]
points = ["A", "B"]
density = "1000 kg/m^3"
section = { diameter = "20 mm" }
elastic = { E = "200 GPa", elements = 2, shear = { modulus = "70 GPa" } }
[[welds]]
point = "O"
links = ["first"]
[[welds]]
point = "A"
links = ["first", "second"]
[rotor]
axis = [0, 0, 1]
speed = "0 rpm"
"""


def test_bent_cantilever(tmp_path):
    """The tip under a force across both legs: bending of both, and torsion of the first by the arm of the second."""
    model = built(tmp_path, BENT)
    made = structure(model.description, model._numbers())
    across = np.array([0.8, 0, -0.6])  # across y and (0.6, 0, 0.8)
    force = np.zeros(len(made.names))
    force[[made.names.index(f"B.{a}") for a in "xyz"]] = across
    second = math.pi * 0.02**4 / 64
    first, arm, bending, torsion = 0.8, 0.5, 200e9 * second, 70e9 * 2 * second
    exact = (first**3 + arm**3) / (3 * bending) + arm**2 * first / torsion
    assert force @ np.linalg.solve(made.stiffness, force) == pytest.approx(exact, rel=1e-9)


def test_clamped_beam_between_ground_points(tmp_path):
    text = BLADE.replace('"0 m"] }', '"0 m"], ground = true }').replace(
        'links = ["blade"]\n', 'links = ["blade"]\n[[welds]]\npoint = "tip"\nlinks = ["blade"]\n'
    )
    wave = brentq(lambda z: math.cos(z) * math.cosh(z) - 1, 4.5, 5, xtol=1e-14)
    found = 2 * math.pi * built(tmp_path, text).modes().frequencies[:2]
    assert found == pytest.approx([wave**2, wave**2], rel=3e-8)


def test_torsion_constant_of_rectangles(tmp_path):
    """J/(a b^3) of Timoshenko and Goodier's table, by the stiffness against twist."""
    for ratio, factor in ((1, 0.1406), (2, 0.229), (10, 0.312)):
        text = BLADE.replace('width = "thickness"', f'width = "{ratio}*thickness"')
        model = built(tmp_path, text)
        row = model._numbers()["links"][0]
        assert row[-1] == pytest.approx(factor * ratio * 1e-16 * 6e16, rel=2e-3)


@pytest.mark.parametrize(
    ("width", "thickness"), [(1.0, 2.0), (2.0, 1.0), (1.0, 1.0), (1.0, 10.0), (30.0, 1.0)]
)
def test_torsion_constant_has_no_longer_side_of_its_own(width, thickness):
    """Against Prandtl's stress function as a double Fourier series over the rectangle."""
    a, b = sp.symbols("a b")
    found = float(torsion_constant(a, b).subs({a: width, b: thickness}))
    odd = np.arange(1.0, 801.0, 2.0)
    m, n = odd[:, None], odd[None, :]
    terms = 1 / (m**2 * n**2 * (m**2 / width**2 + n**2 / thickness**2))
    assert found == pytest.approx(256 / math.pi**6 * width * thickness * np.sum(terms), rel=1e-6)


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    text = BLADE.replace("12e16 Pa", "E").replace("poisson = 0", 'poisson = "nu"')
    given = {"thickness": "0.1 mm", "E": "12e16 Pa", "nu": "0", "tip": "1 kg"}
    lines = "".join(f'{k} = {{ value = "{v}", tunable = true }}\n' for k, v in given.items())
    text = text.replace('thickness = "0.1 mm"\n', lines) + '[[masses]]\npoint = "tip"\nmass = "tip"\n'
    return built(tmp_path_factory.mktemp("tuned"), text)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"E": 0.0}, r"links.blade.elastic.E: expected a value above zero, got 0"),
        ({"E": -1e9}, r"links.blade.elastic.E: expected a value above zero, got -1e\+09"),
        ({"thickness": 0.0}, "links.blade.section.width: expected a value above zero, got 0"),
        ({"thickness": -1e-3, "E": -1e9}, "expected a value above zero, got -"),
        ({"nu": -2.0}, "links.blade, GJ: expected a value above zero, got -"),
        ({"tip": -0.1}, "masses.0.mass: expected a value of at least zero, got -0.1"),
    ],
)
def test_parameters_that_are_not_physical(tuned, values, said):
    with pytest.raises(ModelError, match=said):
        tuned.with_parameters(**values).modes()


def test_matrices_that_are_not_finite_have_no_modes():
    for mass, stiffness in ((np.nan, 1.0), (1.0, np.nan)):
        with pytest.raises(ModelError, match="not finite"):
            modes_at_rest("frame", np.diag([1.0, mass]), np.diag([1.0, stiffness]), np.ones(2))


def test_stiffness_that_is_not_positive_has_its_causes(tmp_path, blade):
    """The free spin of a blade with its width along the axis has the stiffness (J_y - J_z) Omega^2 < 0."""
    made = structure(blade.description, blade._numbers())
    with pytest.raises(ModelError, match="frame at rest is not positive"):
        _modes_of("frame", replace(made, stiffness=-made.stiffness), 0.0)
    text = BLADE.replace('[[welds]]\npoint = "root"\nlinks = ["blade"]\n', "").replace("0.1 mm", "1 cm")
    text = text.replace("12e16 Pa", "12e8 Pa").replace('width = "thickness"', 'width = "4 * thickness"')
    built(tmp_path, text).with_parameters(speed=1.0).modes()  # the width is in the plane of rotation
    upright = built(tmp_path, text.replace("[0, 1, 0]", "[0, 0, 1]"))
    with pytest.raises(ModelError, match="(?s)not positive definite.*critical speed.*in that plane"):
        upright.with_parameters(speed=1.0).modes()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('width = "thickness"', 'width = ["thickness", "thickness"]', "uniform along its length.*one value"),
        (", width_along = [0, 1, 0]", "", "a rectangle with the direction of its width in space"),
        ("[0, 1, 0]", "[1, 0, 0]", "expected a direction across the link"),
        (", shear = { poisson = 0 }", "", "needs the shear modulus for its torsion"),
        ("axis = [0, 0, 1]", "axis = [0, 0, 0]", "expected a direction, got zero"),
        ("elements = 8", "elements = 8, axial = false", "a link of a rotor has no axial"),
        ('links = ["blade"]', 'links = ["hub"]', "there is no link called 'hub'"),
        ("[rotor]", "[gravity]\nacceleration = [0, 0, 1]\n[rotor]", "a scene with a rotor has no gravity"),
        ("elements = 8", "elements = 0", "from 1 to 100"),
        (
            "[rotor]",
            '[[masses]]\npoint = "tip"\nmass = "1 kg"\ninertia = ["3 kg*m^2", "1 kg*m^2", "1 kg*m^2"]\n[rotor]',
            "above the sum of the other",
        ),
    ],
)
def test_wrong_scenes(tmp_path, old, new, said):
    with pytest.raises(SceneError, match=said):
        built(tmp_path, BLADE.replace(old, new))


def test_planar_sections_have_no_direction():
    data = read_scene("rotating_cantilever").data
    data["links"]["strip"]["section"]["width_along"] = [0, 1, 0]
    with pytest.raises(SceneError, match="a section by its width has no width_along"):
        resolve(symgen.Scene(**data))


def test_other_analyses_are_refused(blade):
    assert blade.capabilities == ("modes", "modes_many")
    with pytest.raises(CapabilityError, match="it is a rotor"):
        blade.simulate()


def test_frequencies_over_the_speed(blade):
    """A sweep of the speed, as for a Campbell diagram: lagging and flapping of a blade of square section."""
    speeds = [3.0, 12.0]
    swept = blade.modes_many({"speed": speeds}, outputs=["frequency.1", "frequency.2"])
    lag, flap = (2 * math.pi * swept[f"frequency.{k}"].values for k in (1, 2))
    for k, speed in enumerate(speeds):
        exact = float(flapping(speed, 0, float(flap[k]), 1e-8 / 12))
        assert flap[k] == pytest.approx(exact, rel=5e-8)
        assert lag[k] ** 2 == pytest.approx(exact**2 - speed**2, rel=3e-7)
