"""Elastic links in space in large rotation: their element, a spatial slider-crank, independent solutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh, null_space
from shared.in_numpy import build

import symgen
from symgen.errors import ModelError, SceneError, SimulationError
from symgen.runtime.beams.elements import kernels
from symgen.runtime.elastic.large.statics import equilibrium
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.outputs import outputs

RNG = np.random.default_rng(19)
#: Length, mu, J_y, J_z, EA, EI_y, EI_z, GJ, damping, gravity, fibres and place.
SECTION = np.array([0.4, 1.3, 2e-3, 5e-3, 7e5, 40.0, 90.0, 25.0, 0.0, 0.0, 0.0, 0.0, *[0.0] * 5])
STILL = np.zeros(48)


def call(kernel, q, u=STILL, p=SECTION):
    return getattr(kernels("director_beam"), kernel)(q=np.asarray(q, float), u=u, p=p)


def rotation(vector):
    """Return the matrix of a rotation vector, by Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


TURNED = rotation(np.array([0.3, -0.8, 0.5]))


def straight(turned=TURNED):
    """Return the places of an undeformed element, whose directors are the columns of a rotation."""
    first = np.concatenate([np.zeros(3), turned.T.ravel()])
    second = first.copy()
    second[:3] = SECTION[0] * turned[:, 0]
    return np.concatenate([first, second])


def turning(q):
    """Return d q by displacements and rotations of both nodes, (24, 12)."""
    made = np.zeros((24, 12))
    for node in range(2):
        made[12 * node : 12 * node + 3, 6 * node : 6 * node + 3] = np.eye(3)
        for k in range(3, 12, 3):
            at = slice(12 * node + k, 12 * node + k + 3)
            made[at, 6 * node + 3 : 6 * node + 6] = np.cross(np.eye(3), q[at]).T
    return made


def test_small_displacements_are_those_of_the_linear_beam():
    q, (length, *_, axial, about_y, about_z, torsion) = straight(), SECTION[:8]
    basis = turning(q) @ np.kron(np.eye(4), TURNED)
    found = basis.T @ call("tangent", q).reshape(3, 24, 24)[2] @ basis
    expected = np.zeros((12, 12))
    for (u, theta), stiffness, sign in (((1, 5), about_z, 1), ((2, 4), about_y, -1)):
        own = [u, theta, u + 6, theta + 6]
        a, b = 6 * sign * length, length**2
        bending = [[12, a, -12, a], [a, 4 * b, -a, 2 * b], [-12, -a, 12, -a], [a, 2 * b, -a, 4 * b]]
        expected[np.ix_(own, own)] = np.array(bending) * stiffness / length**3
    for k, stiffness in ((0, axial), (3, torsion)):
        expected[np.ix_([k, k + 6], [k, k + 6])] = np.array([[1, -1], [-1, 1]]) * stiffness / length
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-9 * axial)


def test_rigid_motions_have_their_energy_and_no_strain():
    """A rod with rotary inertia: m v^2/2 + omega I omega/2, with I of the rod and of its sections."""
    q, omega, velocity = straight(), np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.2, -1.0])
    v = np.concatenate([*(np.cross(omega, x) for x in q.reshape(8, 3))])
    v.reshape(8, 3)[[0, 4]] += velocity
    kinetic, strain, *_ = call("energies", q, np.concatenate([v, np.zeros(24)]))
    length, mu, j_y, j_z = SECTION[:4]
    axes, centre = TURNED.T @ omega, velocity + np.cross(omega, q[12:15]) / 2
    inertias = length * np.array([j_y + j_z, j_y + mu * length**2 / 12, j_z + mu * length**2 / 12])
    # Fibres at y d2 + z d3 turn about y with the integral of z^2, J_y, and about z with J_z.
    assert kinetic == pytest.approx(mu * length * centre @ centre / 2 + inertias @ axes**2 / 2, rel=1e-12)
    assert strain < 1e-20 * SECTION[4]


@pytest.mark.parametrize("axis", [1, 2])
def test_a_bent_line_is_longer_by_the_mean_of_its_slopes(axis):
    """The nodes stay and turn: w'^2/2 of the cubic with these end slopes, in either plane."""
    q, slopes = straight(np.eye(3)), (2e-3, 1.5e-3)
    for node, slope in enumerate(slopes):
        q[12 * node + 3 : 12 * node + 12] = rotation(slope * np.eye(3)[axis]).T.ravel()
    points, weights = np.polynomial.legendre.leggauss(3)
    x = (1 + points) / 2
    inclined = slopes[0] * (1 - 4 * x + 3 * x**2) + slopes[1] * (3 * x**2 - 2 * x)
    slack = SECTION.copy()
    slack[4] = 0.0
    energy = call("energies", q)[1] - call("energies", q, STILL, slack)[1]
    strain = weights @ inclined**2 / 4
    assert energy == pytest.approx(SECTION[4] * SECTION[0] * strain**2 / 2, rel=1e-5)


def test_damping_is_that_of_the_linear_beam_where_nothing_is_strained():
    q, v, damped = straight(), np.concatenate([RNG.standard_normal(24), np.zeros(24)]), SECTION.copy()
    damped[8] = 1e-3
    stiffness = call("tangent", q).reshape(3, 24, 24)[2]
    found = call("residual", q, v, damped) - call("residual", q, v)
    np.testing.assert_allclose(found, 1e-3 * stiffness @ v[:24], rtol=1e-9, atol=1e-12 * SECTION[4])


def test_damping_takes_the_power_of_its_forces():
    q, u = straight() + 0.05 * RNG.standard_normal(24), RNG.standard_normal(48)
    damped = SECTION.copy()
    damped[8] = 1e-3
    forces = call("residual", q, u, damped) - call("residual", q, u)
    assert call("energies", q, u, damped)[3] == pytest.approx(forces @ u[:24], rel=1e-12)
    assert call("energies", q, u)[3] == 0.0


def test_weight_is_that_of_hermites_cubic():
    q, p, (length, mu) = straight() + 0.1 * RNG.standard_normal(24), SECTION.copy(), SECTION[:2]
    p[9:12] = gravity = np.array([1.0, 2.0, -9.0])
    points, weights = np.polynomial.legendre.leggauss(2)
    x = (1 + points) / 2
    shapes = [
        1 - 3 * x**2 + 2 * x**3,
        length * x * (1 - x) ** 2,
        3 * x**2 - 2 * x**3,
        length * x**2 * (x - 1),
    ]
    line = np.einsum("ki,kj->ij", shapes, q.reshape(8, 3)[[0, 1, 4, 5]])
    expected = -mu * length * weights / 2 @ line @ gravity
    assert call("energies", q, STILL, p)[2] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("at", [0.3, 0.5])
def test_moments_within_an_element_are_those_of_a_uniform_load(at):
    """A cantilever of one element under its weight q has the moment q (L - x)^2/2, here in both planes."""
    section = {"width": "8 mm", "thickness": "4 mm", "width_along": [0, 0, 1]}
    elastic = {"E": "210 GPa", "elements": 1, "shear": {"poisson": 0.3}}
    beam = {"points": ["O", "A"], "density": "7850 kg/m^3", "section": section, "elastic": elastic}
    scene = symgen.Scene(
        points={
            "O": {"at": ["0 m", "0 m", "0 m"], "ground": True},
            "A": {"at": ["0.3 m", "0 m", "0 m"]},
        },
        links={"beam": beam},
        welds=[{"point": "O", "links": ["beam"]}],
        gravity={"acceleration": ["0 m/s^2", "0.3 m/s^2", "-0.5 m/s^2"]},
        stations=[{"link": "beam", "at": at, "name": "here"}],
    )
    linkage = LinkageInSpace(build(scene).rigid)
    found = {v.name: v.values[0] for v in outputs(linkage, [equilibrium(linkage, 0.0)])}
    moment = 7850 * 8e-3 * 4e-3 * (0.3 * (1 - at)) ** 2 / 2
    # The width, y of the section, is along z; its thickness, z of the section, along -y.
    assert found["here.moment_z"] == pytest.approx(-0.5 * moment, rel=1e-5)
    assert found["here.moment_y"] == pytest.approx(0.3 * moment, rel=1e-5)


def test_forces_are_those_of_the_energies_and_slopes_are_differences():
    q = straight() + 0.05 * RNG.standard_normal(24)
    u, p, h = RNG.standard_normal(48), SECTION.copy(), 1e-6
    p[9:12] = 1.0, 2.0, -9.0

    def potential(x):
        return np.sum(call("energies", x, STILL, p)[1:3])

    slopes = [(potential(q + h * e) - potential(q - h * e)) / (2 * h) for e in np.eye(24)]
    np.testing.assert_allclose(call("residual", q, STILL, p), slopes, rtol=1e-6, atol=1e-4)
    p[8] = 1e-2
    tangents, largest = call("tangent", q, u, p).reshape(3, 24, 24), SECTION[4] / SECTION[0]
    for k, e in enumerate(np.eye(72)):
        dq, du = h * e[:24], h * e[24:]
        change = call("residual", q + dq, u + du, p) - call("residual", q - dq, u - du, p)
        of = tangents[(2, 1, 0)[k // 24], :, k % 24]
        np.testing.assert_allclose(change / (2 * h), of, rtol=1e-5, atol=1e-6 * largest)


SCENE = """
symgen = 1
title = "Slider-crank in space"

[parameters]
rate = {{ value = "20 rad/s", tunable = true }}
r = "50 mm"

[points]
A = {{ at = ["0 m", "50 mm", "0 m"], ground = true, motion = {motion} }}
P = {{ at = ["300 mm", "0 m", "0 m"] }}
O = {{ at = ["0 m", "0 m", "0 m"], ground = true }}
R = {{ at = ["500 mm", "0 m", "0 m"], ground = true }}

[links]
rail = {{ points = ["O", "R"] }}

[links.rod]
points = ["A", "P"]
density = "7850 kg/m^3"
section = {section}
elastic = {{ E = "210 GPa", elements = 4, shear = {{ poisson = 0.3 }} }}

[[masses]]
point = "P"
mass = "0.3 kg"

[[guides]]
points = ["P"]
along = "rail"

[analysis]
t_end = "0.05 s"
"""
#: The crank pin circles about the rail, or in a plane through it.
AROUND = '["0 m", "r*cos(rate*t) - r", "r*sin(rate*t)"]'
WITHIN = '["r*sin(rate*t)", "r*cos(rate*t) - r", "0 m"]'
FLAT = '{ width = "8 mm", thickness = "4 mm", width_along = [0, 0, 1] }'


def built(tmp_path, motion=AROUND, section=FLAT, replaced=("", "")):
    file = tmp_path / "space.toml"
    file.write_text(SCENE.format(motion=motion, section=section).replace(*replaced))
    return symgen.build(str(file))


def test_a_plane_motion_is_that_of_planar_elements(tmp_path):
    """The crank pin moves in a plane, as on a rigid crank: strains and forces of the planar element."""
    found = built(tmp_path, WITHIN).simulate(0.004, samples=9, max_step=2e-5)
    planar = {
        "title": "plane",
        "parameters": {"rate": "20 rad/s"},
        "points": {
            "C": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["0 m", "50 mm"]},
            "P": {"at": ["300 mm", "0 m"]},
            "R": {"at": ["500 mm", "0 m"], "ground": True},
        },
        "links": {
            "rail": {"points": ["C", "R"]},
            "crank": {"points": ["C", "A"], "mass": "1 kg"},
            "rod": {
                "points": ["A", "P"],
                "density": "7850 kg/m^3",
                "section": {"width": "8 mm", "thickness": "4 mm"},
                "elastic": {"E": "210 GPa", "element": "rayleigh"},
            },
        },
        "masses": [{"point": "P", "mass": "0.3 kg"}],
        "guides": [{"points": ["P"], "along": "rail"}],
        "crank": {"link": "crank", "angle": "pi/2 - rate*t"},
        "analysis": {"t_end": "0.004 s"},
    }
    other = symgen.build(symgen.Scene(**planar)).large_rotation(elements=4, samples=9, max_step=2e-5)
    pairs = [(found["rod.bending_strain_y"].values, other["rod.bending_strain"].values)]
    pairs += [(found[f"rod.{p}.force"].values[:, :2], other[f"rod.{p}.force"].values) for p in "AP"]
    pairs.append((found["P.position"].values[:, 0], other["P.position"].values[:, 0]))
    for k, (own, same) in enumerate(pairs):
        difference = min(np.max(np.abs(own - s * same)) for s in (1, -1))
        assert difference < 1e-4 * np.max(np.abs(same)), k
    assert np.max(np.abs(found["rod.bending_strain_z"].values)) < 1e-9


def test_energy_and_constraints_of_a_motion_in_space(tmp_path):
    """The energy changes by the work of the crank pin; the rod bends in both planes."""
    result = built(tmp_path).simulate(0.02, samples=21)
    assert result.drift.energy < 1e-4 * result.drift.energy_exchanged
    assert result.drift.constraint < 1e-10
    assert result.statistics["error"] < 1e-2
    for plane in "yz":
        assert np.max(np.abs(result[f"rod.bending_strain_{plane}"].values)) > 1e-6


def test_frequencies_of_a_pinned_rod_in_both_planes(tmp_path):
    """Rayleigh's beam: omega^2 = k^4 EI/(mu + J k^2), k = n pi/L; rotary inertia is of the second order."""
    errors = []
    for divided in (2, 4):
        linkage = LinkageInSpace(built(tmp_path).rigid, divided=divided)
        link, now = linkage.links[0], linkage.start()
        still, none = np.zeros_like(now.q), np.zeros(linkage.multipliers)
        mass, stiffness = np.zeros((2, linkage.unknowns, linkage.unknowns))
        rows = link.values("tangent", now.q[None], still[None], still[None])[0]
        for at, row in zip(link.elements, rows, strict=True):
            own = np.ix_(at, at)
            mass[own] += row[:576].reshape(24, 24)
            stiffness[own] += row[1152:].reshape(24, 24)
        n, slopes = linkage.unknowns, linkage.slopes(0.0, now.q, still, still, none)
        jacobian = linkage.pattern.matrix(slopes.jacobian).toarray()[n:, :n]
        held = np.zeros((3, linkage.unknowns))
        held[range(3), link.places[-1, :3]] = 1.0
        basis = null_space(np.vstack([jacobian, held]))
        squares = eigh(basis.T @ stiffness @ basis, basis.T @ mass @ basis, eigvals_only=True)
        length, mu, j_y, j_z, _, about_y, about_z = link.section[:7]
        k = np.pi / length * np.array([1, 2])
        exact = np.concatenate([k**4 * ei / (mu + j * k**2) for ei, j in ((about_y, j_y), (about_z, j_z))])
        # One rigid motion, the spin of the rod.
        bending = squares[1:5]
        errors.append(np.max(np.abs(bending / np.sort(exact) - 1)))
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 7


def test_round_rods_need_no_direction_and_parameters_are_tunable(tmp_path):
    model = built(tmp_path, section='{ diameter = "6 mm" }')
    slow, fast = (model.with_parameters(rate=x).simulate(0.004, samples=5) for x in (10.0, 20.0))
    stress = [np.max(r["rod.stress"].values) for r in (slow, fast)]
    assert 2 < stress[1] / stress[0] < 6


def test_max_wall_ends_a_run_between_samples():
    model = symgen.build("spatial_slider_crank")
    with pytest.raises(SimulationError, match="max_wall = 0.2 s") as ended:
        model.simulate(5.0, samples=2, max_step=1e-5, max_wall=0.2)
    assert 0.0 < ended.value.time < 5.0 and ended.value.partial.count == 1


def test_a_rod_shorter_than_its_crank_comes_to_a_dead_centre(tmp_path):
    """The pin leaves the reach r of the slider where r sin(rate t) is the length of the rod."""
    file = tmp_path / "space.toml"
    longer = SCENE.replace('r = "50 mm"', 'r = "200 mm"').replace('"50 mm", "0 m"]', '"0 m", "0 m"]')
    motion = '["r*cos(rate*t)", "r*sin(rate*t)/sqrt(2)", "r*sin(rate*t)/sqrt(2)"]'
    longer = longer.replace('A = {{ at = ["0 m"', 'A = {{ at = ["0.2 m"')
    file.write_text(longer.format(motion=motion.replace('(rate*t)"', '(rate*t) - r"', 1), section=FLAT))
    with pytest.raises(SimulationError, match=f"dead centre at t = {math.asin(0.5) / 20:.6g} s"):
        symgen.build(str(file)).simulate(samples=31)


@pytest.mark.parametrize(
    ("replaced", "error", "words"),
    [
        (("elements = 4", "elements = 0"), SceneError, "from 1 to 200"),
        (("elements = 4", "axial = false"), SceneError, "in space has no axial"),
        (("elements = 4", "damping = { ratio = 0.1 }"), SceneError, "in proportion to its stiffness"),
        (("[[guides]]", '[[welds]]\npoint = "P"\nlinks = ["rail"]\n[[guides]]'), SceneError, "no joint of"),
        (
            ("[[guides]]", '[[welds]]\npoint = "R"\nlinks = ["rail"]\n[[guides]]'),
            SceneError,
            "an elastic link",
        ),
        (("[[guides]]", '[crank]\nlink = "rod"\nspeed = "1 rpm"\n[[guides]]'), SceneError, "crank"),
        ((", shear = { poisson = 0.3 }", ""), SceneError, "shear modulus"),
        (("width_along = [0, 0, 1]", "width_along = [6, -1, 0]"), SceneError, "direction across the link"),
    ],
)
def test_refused(tmp_path, replaced, error, words):
    with pytest.raises(error, match=words):
        built(tmp_path, replaced=replaced)


def test_analyses_it_does_not_support_are_named(tmp_path):
    model = built(tmp_path)
    assert not hasattr(model, "periodic")
    for wrong in ({"rtol": 0.0}, {"samples": 1}, {"max_step": -1.0}, {"t_end": 0.0}):
        with pytest.raises(ModelError):
            model.simulate(**wrong)
