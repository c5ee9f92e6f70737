"""Beam elements in large rotation: their kernels, the elastica, and linkages against independent solutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp, solve_ivp
from scipy.special import ellipk
from shared.full import full
from shared.rods_with_springs import in_rods

import symgen
from symgen.errors import ModelError
from symgen.runtime.beams.elements import kernels
from symgen.runtime.beams.methods import gauss
from symgen.runtime.elastic.large.collocation import SystemRun, stacked
from symgen.runtime.elastic.large.linkage import LargeLinkage
from symgen.scene.loading import read_scene

RNG = np.random.default_rng(19)
#: Length, mass and rotary inertia per length, E A, E I, shear, damping, gravity.
SECTION = np.array([0.4, 1.3, 2e-3, 7e5, 40.0, 0.0, 0.0, 0.0, 0.0])


def call(kernel, q, rates=None, p=SECTION):
    return getattr(kernels("corotational_beam"), kernel)(q=np.asarray(q, float), u=rates, p=p)


def tangents(q, rates, p=SECTION):
    return call("tangent", q, rates, p).reshape(3, 6, 6)


def rotated(angle, x=(0.0, 0.0), length=SECTION[0]):
    return np.array([*x, angle, x[0] + length * math.cos(angle), x[1] + length * math.sin(angle), angle])


def test_small_displacements_are_those_of_the_cubic_element():
    coefficients = np.zeros(20)
    length, mass, rotary, axial, bending = SECTION[:5]
    coefficients[[0, 1, 9, 12]] = length, mass, axial, bending
    cubic, made = kernels("element_cubic"), tangents(rotated(0.0), np.zeros(12))
    inertia, stiffness = (
        getattr(cubic, name)(q=coefficients).reshape(6, 6) for name in ("mass", "stiffness")
    )
    np.testing.assert_allclose(made[2], stiffness, rtol=1e-12, atol=1e-12 * axial)
    inertia[np.ix_([0, 3], [0, 3])] = inertia[np.ix_([1, 4], [1, 4])]
    inertia[np.ix_([2, 5], [2, 5])] += rotary * length * np.array([[2, 1], [1, 2]]) / 6
    np.testing.assert_allclose(made[0], inertia, rtol=1e-12, atol=1e-14)


def test_shear_is_that_of_timoshenko():
    p = SECTION.copy()
    p[5] = 0.7
    length, bending = p[0], p[4]
    flexibility = np.linalg.inv(tangents(rotated(0.0), np.zeros(12), p)[2][3:, 3:])
    assert flexibility[1, 1] == pytest.approx(length**3 / (3 * bending) * (1 + p[5] / 4))
    assert flexibility[2, 2] == pytest.approx(length / bending)


def test_rigid_motions_have_their_energy_and_no_strain():
    angle, omega, velocity = 0.8, 3.0, np.array([1.0, -2.0])
    q = rotated(angle, (0.3, -0.2))
    arm = q[3:5] - q[:2]
    ends = [*velocity, omega, *(velocity + omega * np.array([-arm[1], arm[0]])), omega]
    kinetic, strain, *_ = call("energies", q, np.array([*ends, *np.zeros(6)]))
    length, mass, rotary = SECTION[:3]
    centre = velocity + omega * np.array([-arm[1], arm[0]]) / 2
    exact = mass * length * (centre @ centre / 2 + omega**2 * length**2 / 24) + rotary * length * omega**2 / 2
    assert kinetic == pytest.approx(exact, rel=1e-13)
    assert strain < 1e-20 * SECTION[3]


def test_energies_are_those_of_the_curve_between_the_nodes():
    """Kinetic energy and potential of Hermite's cubic, by quadrature; sections rotate linearly along it."""
    q, v, gravity = rotated(0.5) + 0.2 * RNG.standard_normal(6), RNG.standard_normal(6), np.array([1.0, -9.0])
    length, mass, rotary = SECTION[:3]
    nodes, weights = np.polynomial.legendre.leggauss(8)
    s, weights = (nodes[:, None] + 1) / 2, weights / 2
    by_ends = 2 * s**3 - 3 * s**2 + 1, 3 * s**2 - 2 * s**3
    by_tangents = length * (s**3 - 2 * s**2 + s), length * (s**3 - s**2)
    place, velocity = np.zeros((8, 2)), np.zeros((8, 2))
    for k, (end, tangent) in enumerate(zip(by_ends, by_tangents, strict=True)):
        (x, y, angle), (vx, vy, omega) = q[3 * k : 3 * k + 3], v[3 * k : 3 * k + 3]
        direction = np.array([math.cos(angle), math.sin(angle)])
        place += end * [x, y] + tangent * direction
        velocity += end * [vx, vy] + tangent * omega * np.array([-direction[1], direction[0]])
    turning = (1 - s[:, 0]) * v[2] + s[:, 0] * v[5]
    kinetic = length * weights @ (mass * np.sum(velocity**2, axis=1) + rotary * turning**2) / 2
    p = SECTION.copy()
    p[7:] = gravity
    found = call("energies", q, np.array([*v, *np.zeros(6)]), p)
    assert found[[0, 2]] == pytest.approx([kinetic, -mass * length * weights @ place @ gravity], rel=1e-12)


def test_forces_are_those_of_the_energies():
    """Power of the residual is the rate of all energies and what damping dissipates; slopes are differences."""
    p = SECTION.copy()
    p[3:] = 3.0, 0.05, 0.3, 1e-3, 1.0, -9.0  # soft, so that the forces of inertia count
    q, v, a = rotated(0.5) + 0.05 * RNG.standard_normal(6), RNG.standard_normal(6), RNG.standard_normal(6)
    h = 1e-5

    def at(s):
        return q + s * v + s * s * a / 2, np.concatenate([v + s * a, a])

    def total(s):
        return np.sum(call("energies", *at(s), p)[:3])

    undamped = p.copy()
    undamped[6] = 0.0
    rates = np.concatenate([v, a])
    power = call("residual", q, rates, undamped) @ v
    assert power == pytest.approx((total(h) - total(-h)) / (2 * h), rel=1e-7)
    dissipated = call("residual", q, rates, p) @ v - power
    assert call("energies", q, rates, p)[3] == pytest.approx(dissipated, rel=1e-9) and dissipated > 0
    state = np.concatenate([a, v, q])
    for k, slope in enumerate(np.split(np.hstack(tangents(q, rates, p)), 18, axis=1)):

        def force(s, k=k):
            moved_to = state.copy()
            moved_to[k] += s
            b, u, x = np.split(moved_to, 3)
            return call("residual", x, np.concatenate([u, b]), p)

        found = (force(h) - force(-h)) / (2 * h)
        np.testing.assert_allclose(found, slope[:, 0], rtol=1e-5, atol=1e-6 * np.max(np.abs(slope)) + 1e-4)


def cantilever(count, length, axial, bending, loads):
    """Return the nodes (count + 1, 3) of a clamped cantilever under loads of its tip, in steps."""
    p = np.array([length / count, 1.0, 0.0, axial, bending, 0.0, 0.0, 0.0, 0.0])
    q = np.zeros((count + 1, 3))
    q[:, 0] = np.linspace(0.0, length, count + 1)
    at = [np.arange(3 * k, 3 * k + 6) for k in range(count)]
    for load in loads:
        for _ in range(60):
            force, stiffness = np.zeros(q.size), np.zeros((q.size, q.size))
            for own in at:
                force[own] += call("residual", q.ravel()[own], np.zeros(12), p)
                stiffness[np.ix_(own, own)] += tangents(q.ravel()[own], np.zeros(12), p)[2]
            force[-3:] -= load
            change = -np.linalg.solve(stiffness[3:, 3:], force[3:])
            q.ravel()[3:] += change
            if np.max(np.abs(change)) < 1e-10:
                break
        else:
            raise AssertionError("Newton's method did not converge")
    return q


def test_end_moment_rolls_a_cantilever_to_a_circle():
    length, bending = 2.0, 3.0
    moments = np.linspace(0.0, 2 * math.pi * bending / length, 9)[1:]
    q = cantilever(8, length, 1e4, bending, [(0.0, 0.0, m) for m in moments])
    assert q[-1, 2] == pytest.approx(2 * math.pi, abs=1e-10)
    np.testing.assert_allclose(q[-1, :2], 0.0, atol=1e-10)
    np.testing.assert_allclose(np.diff(q[:, 2]), math.pi / 4, atol=1e-10)


def test_cantilever_beyond_buckling():
    """The elastica by elliptic integrals: P L^2/EI = K(k)^2 for an angle 2 asin k of the tip."""
    angle = math.radians(80)
    k2 = math.sin(angle / 2) ** 2
    load = ellipk(k2) ** 2
    errors = []
    for count in (3, 6):
        path = [(-load * s, 1.0 - s, 0.0) for s in np.linspace(0.0, 1.0, 11)]
        errors.append(cantilever(count, 1.0, 1e6, 1.0, path)[-1, 2] / angle - 1)
    assert abs(errors[1]) < 1e-4
    assert abs(errors[0] / errors[1]) > 8  # fourth order, and the stretch by P/E A


STRIP = """
symgen = 1
title = "Strip"

[points]
O = { at = ["0 m", "0 m"], ground = true }
tip = { at = ["1 m", "0 m"] }
hook = { at = ["0.3 m", "0.7 m"], ground = true }

[links.strip]
points = ["O", "tip"]
mass_per_length = "2 kg/m"
section = { area = "1 mm^2", second_moment = "1 mm^4", fibre = "1 mm" }
elastic = { E = "1e12 Pa", element = "cubic" }

[crank]
link = "strip"
speed = "0 rpm"

[gravity]
acceleration = ["0 m/s^2", "-3 m/s^2"]
"""
#: Bending stiffness, weight per length [N/m], force at the tip [N]; stiffness and free length of a spring.
STIFF, WEIGHT, FORCE, SPRING, FREE = 1.0, np.array([0.0, -6.0]), np.array([1.0, -2.0]), 8.0, 0.4
PULLED = '[[forces]]\npoint = "tip"\nforce = ["1 N", "-2 N"]\n'
HELD = '[[springs]]\nbetween = ["hook", "tip"]\nstiffness = "8 N/m"\nlength = "0.4 m"\n'


def elastica(force, spring):
    """Return the tip (x, y) of an inextensible strip of length one, clamped, under its weight."""

    def at_tip(x, y):
        apart = np.array([0.3 - x, 0.7 - y])
        return force + spring * (1 - FREE / np.linalg.norm(apart)) * apart

    def rates(s, state):
        angle, moment, _, _, fx, fy = state
        zero = np.zeros_like(s)
        turning = fx * np.sin(angle) - fy * np.cos(angle)
        return np.array([moment / STIFF, turning, np.cos(angle), np.sin(angle), zero, zero - WEIGHT[1]])

    def ends(first, last):
        return np.array([first[0], first[2], first[3], last[1], *(last[4:] - at_tip(*last[2:4]))])

    s = np.linspace(0.0, 1.0, 41)
    guess = np.array([-s, 0 * s, s, -(s**2) / 2, 0 * s, 0 * s])
    found = solve_bvp(rates, ends, s, guess, tol=1e-9, max_nodes=20000)
    assert found.success
    return found.sol(1.0)[2:4]


def at_rest(linkage):
    """Return the places at rest, by Newton's method on the linkage."""
    q, multipliers = linkage.start().q, np.zeros(linkage.multipliers)
    still, time = np.zeros_like(q), np.zeros(1)
    for _ in range(80):
        forces = linkage.residual(time, q[None], still[None], still[None], multipliers[None])[0]
        slopes = linkage.slopes(0.0, q, still, still, multipliers)
        right = np.concatenate([forces, linkage.errors(0.0, q)])
        change = -linkage.pattern.factorised(slopes.stiffness + slopes.jacobian)(right)
        q, multipliers = q + np.clip(change[: len(q)], -0.3, 0.3), multipliers + change[len(q) :]
        if np.max(np.abs(change[: len(q)])) < 1e-9:
            return q
    raise AssertionError("Newton's method did not converge")


@pytest.mark.parametrize(
    ("loads", "force", "spring"),
    [
        ("", np.zeros(2), 0.0),
        (PULLED + HELD, FORCE, SPRING),
    ],
)
def test_loads_against_the_elastica(tmp_path, loads, force, spring):
    """Gravity, a force and a spring at the tip: the resting shape."""
    file = tmp_path / "strip.toml"
    file.write_text(STRIP + loads)
    motion, exact, errors = symgen.build(str(file)).motion(True), elastica(force, spring), []
    for count in (3, 6):
        linkage = LargeLinkage(motion, count)
        errors.append(np.linalg.norm(at_rest(linkage)[linkage.links[0].places[-1, :2]] - exact))
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] > 8  # fourth order


def built(tmp_path, added, base=STRIP):
    file = tmp_path / "scene.toml"
    file.write_text(base + added)
    return symgen.build(str(file))


def tip_at_rest(model, count):
    linkage = LargeLinkage(model.motion(True), count)
    return at_rest(linkage)[linkage.links[0].places[-1]]


WEIGHTLESS = STRIP.replace("-3 m/s^2", "0 m/s^2")


@pytest.mark.parametrize("base", [STRIP, full(WEIGHTLESS)])
def test_force_along_a_strip_is_that_of_its_weight(tmp_path, base):
    """A constant force per length bends it as gravity does: the elastica with both."""
    forced = '[[distributed_forces]]\nlink = "strip"\nforce = ["0 N/m", "-6 N/m"]\n'
    weight = "-6 m/s^2" if base is STRIP else "-3 m/s^2"
    expected = tip_at_rest(
        built(tmp_path, "", base.replace("-3 m/s^2", weight).replace('"0 m/s^2"]', f'"{weight}"]')), 4
    )
    assert tip_at_rest(built(tmp_path, forced, base), 4) == pytest.approx(expected, abs=1e-10)


def test_end_moment_rolls_a_strip_to_an_arc(tmp_path):
    """M = EI theta at the tip."""
    moment = '[[torques]]\nlink = "strip"\npoint = "tip"\ntorque = "1.5 N*m"\n'
    x, y, theta = tip_at_rest(built(tmp_path, moment, WEIGHTLESS), 4)
    assert theta == pytest.approx(1.5, abs=1e-8)
    assert [x, y] == pytest.approx([np.sin(1.5) / 1.5, (1 - np.cos(1.5)) / 1.5], abs=2e-5)


def test_follower_force_needs_its_work(tmp_path):
    """A uniform load across the line between the ends stays across it: forces at the clamp balance it."""
    load = '[[distributed_forces]]\nlink = "strip"\nforce = ["0 N/m", "-2 N/m"]\naxes = "link"\n'
    linkage = LargeLinkage(built(tmp_path, load, WEIGHTLESS).motion(True), 6)
    q = at_rest(linkage)
    still, none = np.zeros((1, len(q))), np.zeros((1, linkage.multipliers))
    forces = linkage.residual(np.zeros(1), q[None], still, still, none)[0]
    link = linkage.links[0]
    held, chord = forces[link.places[0, :2]], q[link.places[-1, :2]] - q[link.places[0, :2]]
    across = np.array([-chord[1], chord[0]]) / np.linalg.norm(chord)
    np.testing.assert_allclose(held, 2.0 * across, atol=1e-7)
    assert abs(chord[1]) > 0.15


def test_weld_and_clamp_of_a_frame(tmp_path):
    """An L of two strips, clamped and welded, under a small force F at its end: 4 F/3 there, by beam theory."""
    force = 1e-3
    added = (
        '[links.arm]\npoints = ["tip", "end"]\nmass_per_length = "2 kg/m"\n'
        'section = { area = "1 mm^2", second_moment = "1 mm^4", fibre = "1 mm" }\n'
        'elastic = { E = "1e12 Pa", element = "cubic" }\n'
        '[points.end]\nat = ["1 m", "1 m"]\n'
        '[[welds]]\npoint = "tip"\nlinks = ["strip", "arm"]\n'
        f'[[forces]]\npoint = "end"\nforce = ["{force} N", "0 N"]\n'
    )
    linkage = LargeLinkage(built(tmp_path, added, WEIGHTLESS).motion(True), 2)
    q = at_rest(linkage)
    (_, corner), (_, end) = (link.places[[0, -1]] for link in linkage.links)
    assert q[corner] == pytest.approx([1.0, -force / 2, -force], abs=1e-6)
    assert q[end[:2]] == pytest.approx([1.0 + 4 * force / 3, 1.0 - force / 2], abs=force / 500)


def ends(linkage, times, stages, steps):
    return SystemRun(linkage, gauss("", stages), times, steps).run().moments()


@pytest.mark.parametrize(("stages", "counts"), [(2, (10, 20)), (4, (4, 8))])
def test_order_of_steps_with_constraints(stages, counts):
    """Places, rates and multipliers of a driven crank and a guide converge with twice the number of stages."""
    motion = symgen.build("elastic_slider_crank", set={"speed": "300 rpm"}).motion(True)
    linkage = LargeLinkage(motion, 1)
    times = np.linspace(0.0, 0.01 * motion.period, 3)
    exact = ends(linkage, times, 4, 40)[-1]
    found = [ends(linkage, times, stages, n)[-1] for n in counts]
    for name in ("v", "multipliers"):
        errors = [np.max(np.abs(getattr(m, name) - getattr(exact, name))) for m in found]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * stages, abs=1.0)
    assert np.max(np.abs(linkage.errors(times[-1], found[-1].q))) < 1e-14
    assert np.max(np.abs(linkage.rates(times[-1:], found[-1].q[None], found[-1].v[None]))) < 1e-12


def test_kinetic_and_strain_energy_of_a_free_crank_are_kept():
    """Also over steps that do not resolve the axial vibrations."""
    motion = symgen.build("elastic_four_bar_free", set={"speed": "95 rpm"}).motion(True)
    linkage = LargeLinkage(motion, 2)
    times = np.linspace(0.0, 0.2 * motion.period, 11)
    found = linkage.energies(*stacked(ends(linkage, times, 4, 8))[:4])
    total = np.sum(found[:3], axis=0)
    assert np.max(np.abs(total - total[0])) < 5e-5 * np.ptp(found[0])


def test_abrupt_start_against_rods():
    """Undamped: 24 rods give these peak strains in the first quarter revolution, sampled 91 times."""
    model = symgen.build("thesis_four_bar", set={"speed": "95 rpm"})
    result = model.large_rotation(elements=4, revolutions=0.25, samples=91)
    for link, peak in (("crank", 1463.9e-6), ("coupler", 226.9e-6), ("output", 381.5e-6)):
        strain = result[f"{link}.bending_strain"].values
        assert np.max(np.abs(strain)) == pytest.approx(peak, rel=1e-2)
    assert result.statistics["error"] < 2e-2
    assert result.drift.energy < 1e-5 * result.drift.energy_exchanged
    assert result.statistics["power_balance"] < 1e-5  # 2e-6


def test_motor_on_an_elastic_crank_against_rods():
    scene = read_scene("elastic_four_bar_motor").data
    found = symgen.build(symgen.Scene(**scene)).large_rotation(elements=2, revolutions=0.1, samples=13)
    rods = in_rods(scene, 10).simulate(found.time[-1], 13)
    for point in "AB":
        own, other = (r[f"{point}.position"].values for r in (found, rods))
        moved = found[f"{point}.displacement"].values
        # Ten rods vibrate about one per cent too slowly, which is 0.003 of the displacement over this time.
        assert np.max(np.abs(own - other)) < 6e-3 * np.ptp(moved)


@pytest.mark.parametrize(
    ("scene", "options", "said"),
    [
        ("elastic_four_bar", {"segments": 4}, "no argument 'segments'"),
        ("elastic_four_bar", {"elements": 0}, "from 1 to 1000 elements"),
        ("elastic_four_bar", {"elements": 2, "rtol": 0.0}, "rtol above zero"),
    ],
)
def test_wrong_options(scene, options, said):
    with pytest.raises(ModelError, match=said):
        symgen.build(scene).large_rotation(**options)


def test_mass_with_inertia_between_the_ends(tmp_path):
    """A disc in the middle of a heavy spinning strip: kinetic energy of a rigid rotation, and its weight."""
    added = (
        '[points.X]\non = "strip"\nfraction = 0.5\n'
        '[[masses]]\npoint = "X"\nmass = "3 kg"\ninertia = "0.2 kg*m^2"\n'
    )
    base = STRIP.replace("0 rpm", "2 rad/s")
    linkages = (LargeLinkage(built(tmp_path, more, base).motion(True), 3) for more in (added, ""))
    with_disc, without = (x.energies(*stacked([x.start()])[:4])[:, 0] for x in linkages)
    more = with_disc - without
    assert more[0] == pytest.approx((3 * 0.5**2 + 0.2) * 2**2 / 2)
    assert more[2] == pytest.approx(0.0, abs=1e-12)
    hung = tip_at_rest(built(tmp_path, added), 4)[1], tip_at_rest(built(tmp_path, ""), 4)[1]
    assert hung[0] < hung[1] - 0.02


def test_kernels_at_nodes_by_quadrature_and_differences():
    """Shares of a force, its power, also of one that follows, the motion of the far end, the direction of a line, and a heavy body."""
    address, p = kernels("corotational_node"), np.array([0.7, 1.0, -9.0, 0.2, 1.5, -0.4, 2.0, 0.3])
    q, v, a = RNG.standard_normal((3, 6))
    work = np.array([0.6, 0.25, math.cos(0.4), math.sin(0.4), 3.0, -5.0])

    def at(kernel, q=q, v=v):
        return getattr(address, kernel)(q=q, u=np.concatenate([v, a]), p=p, work=work.copy())

    def rate(kernel, part, h=1e-6):
        (after, before) = (at(kernel, q + s * v + s * s * a / 2, v + s * a)[part] for s in (h, -h))
        return (after - before) / (2 * h)

    nodes, weights = np.polynomial.legendre.leggauss(8)
    s, factor = (nodes + 1) / 2, p[0] * weights / 2 * (1.5 - 0.4 * (0.2 + p[0] * (nodes + 1) / 2))
    shapes = [2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s, 3 * s**2 - 2 * s**3, s**3 - s**2]
    assert at("shares") == pytest.approx(
        [k * factor @ n for k, n in zip((1, p[0], 1, p[0]), shapes, strict=True)]
    )
    turned = np.exp(0.4j) * (3.0 - 5.0j)
    reached = work[0] * complex(*v[:2]) + work[1] * 1j * v[2] * np.exp(1j * q[2])
    assert at("force") @ v[:3] == pytest.approx((turned.conjugate() * reached).real)
    ends = [complex(*q[:2]), p[0] * np.exp(1j * q[2]), complex(*q[3:5]), p[0] * np.exp(1j * q[5])]
    moving = [complex(*v[:2]), 1j * v[2] * ends[1], complex(*v[3:5]), 1j * v[5] * ends[3]]
    slopes = [6 * s**2 - 6 * s, 3 * s**2 - 4 * s + 1, 6 * s - 6 * s**2, 3 * s**2 - 2 * s]
    tangent, passed = (
        sum(z * n for z, n in zip(*of, strict=True)) for of in ((ends, slopes), (moving, shapes))
    )
    power = factor @ ((3.0 - 5.0j) * tangent / p[0] * passed.conjugate()).real
    assert at("follower") @ v == pytest.approx(power)
    assert complex(*at("far_end")[:2]) == pytest.approx(complex(*q[:2]) + p[0] * np.exp(1j * q[2]))
    assert rate("far_end", slice(0, 4)) == pytest.approx(at("far_end")[2:], rel=1e-7)
    assert at("chord")[0] == pytest.approx(math.atan2(q[4] - q[1], q[3] - q[0]))
    assert rate("chord", 0) == pytest.approx(at("chord")[1], rel=1e-7)
    weight = 2.0 * np.array([a[0] - 1.0, a[1] + 9.0, 0.15 * a[2]])
    assert at("residual") == pytest.approx([*weight, 0.0, 0.0, 0.0])
    mass, *others = at("tangent").reshape(3, 6, 6)
    assert not np.any(others) and mass == pytest.approx(np.diag([2.0, 2.0, 0.3, 0.0, 0.0, 0.0]))
    kinetic = v[0] ** 2 + v[1] ** 2 + 0.15 * v[2] ** 2
    assert at("energies") == pytest.approx([kinetic, 0.0, -2.0 * (q[0] - 9.0 * q[1]), 0.0])


HANGING = """
symgen = 1
title = "Rod that hangs from a crank"

[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.1 m", "0 m"] }
B = { at = ["0.1 m", "-0.5 m"] }

[links.crank]
points = ["O", "A"]
mass = "1 kg"

[links.rod]
points = ["A", "B"]
mass_per_length = "1.6 kg/m"
section = { width = "2 cm", thickness = "1 cm" }
elastic = { E = "210 GPa" }

[crank]
link = "crank"
speed = "60 rpm"

[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
"""


def test_free_coordinates_of_an_open_chain(tmp_path):
    """A stiff rod swings as a rigid one: theta'' = 3/(2 L) n (g - a) with the acceleration a of its pivot."""
    model = built(tmp_path, "", HANGING)
    linkage = LargeLinkage(model.motion(True), 2)
    result = model.large_rotation(elements=2, revolutions=0.25, samples=11, rtol=0.1)
    speed, length = 2 * math.pi, 0.5

    def rates(t, state):
        c, s = math.cos(speed * t), math.sin(speed * t)
        felt = 0.1 * speed**2 * np.array([c, s]) - [0.0, 9.81]
        across = np.array([-math.sin(state[0]), math.cos(state[0])])
        return [state[1], 3 / (2 * length) * across @ felt]

    start = linkage.start()
    place = linkage.links[0].places[0, 2]
    exact = solve_ivp(
        rates, (0, result.times[-1]), [start.q[place], start.v[place]], t_eval=result.times, rtol=1e-9
    )
    pivot = 0.1 * np.array([np.cos(speed * result.times), np.sin(speed * result.times)])
    tip = pivot + length * np.array([np.cos(exact.y[0]), np.sin(exact.y[0])])
    assert np.ptp(exact.y[0]) > 0.2
    assert result["B.position"].values == pytest.approx(tip.T, abs=1e-4)
