"""Welds, revolute and universal joints of elastic links in space, and modes, against independent solutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh
from shared.in_numpy import build

import symgen
from symgen.errors import ModelError, SceneError
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import SystemRun
from symgen.runtime.elastic.large.statics import equilibrium
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.model import outputs

SECTION = {"width": "8 mm", "thickness": "4 mm", "width_along": [0, 0, 1]}
WIDTH, THICKNESS, E = 8e-3, 4e-3, 210e9
#: Second moments of area; the width of a link along x is along z.
ABOUT_WIDTH, ABOUT_THICKNESS = WIDTH * THICKNESS**3 / 12, THICKNESS * WIDTH**3 / 12


def at(*place, **keys):
    return {"at": [f"{x} m" for x in place], **keys}


def elastic(points, density="7850 kg/m^3"):
    of = {"E": "210 GPa", "elements": 3, "shear": {"poisson": 0.3}}
    return {"points": points, "density": density, "section": SECTION, "elastic": of}


def test_welded_halves_are_a_cantilever():
    """Euler and Bernoulli's cantilever; rotary inertia and elements change frequencies by 1e-3."""
    points = {"A": at(0, 0, 0, ground=True), "B": at(0.2, 0.1, 0), "C": at(0.4, 0.2, 0)}
    links = {"first": elastic(["A", "B"]), "second": elastic(["C", "B"])}
    welds = [{"point": "A", "links": ["first"]}, {"point": "B", "links": ["first", "second"]}]
    found = build(symgen.Scene(points=points, links=links, welds=welds)).modes()
    assert found.rigid == 0
    length = math.hypot(0.4, 0.2)
    roots = np.array([1.8751040687, 4.6940911330, 7.8547574382])
    speed = math.sqrt(E / 7850)
    bending = [(roots / length) ** 2 * speed * h / math.sqrt(12) / (2 * math.pi) for h in (THICKNESS, WIDTH)]
    expected = np.sort(np.concatenate(bending))[:5]
    np.testing.assert_allclose(found.frequencies[:5], expected, rtol=2e-3)
    assert np.max(np.abs(found.errors_of_elements[:5])) < 2e-3


def test_three_links_are_welded_at_a_point():
    """Massless beams along x, y and z, clamped outside, with a mass where they meet.

    A displacement u and rotation phi of the weld take the force k u + c phi x s and the moment, by phi, r phi
    with s the sum of the directions; rotations without inertia are eliminated.
    """
    length, mass, radius = 0.3, 2.0, 3e-3
    bending, stretching = E * math.pi * radius**4 / 4, E * math.pi * radius**2
    points, links = {"O": at(0, 0, 0)}, {}
    for k, axis in enumerate("xyz"):
        points[axis] = at(*(length * (k == i) for i in range(3)), ground=True)
        links[f"along_{axis}"] = elastic(["O", axis], "1e-3 kg/m^3") | {
            "section": {"diameter": f"{2 * radius} m"}
        }
    welds = [{"point": axis, "links": [f"along_{axis}"]} for axis in "xyz"]
    scene = symgen.Scene(
        points=points,
        links=links,
        masses=[{"point": "O", "mass": f"{mass} kg"}],
        welds=[*welds, {"point": "O", "links": list(links)}],
    )
    found = symgen.build(scene).modes()
    k, c = stretching / length + 24 * bending / length**3, 6 * bending / length**2
    r = (8 * bending + bending / 1.3) / length  # G J = E I/(1 + nu)
    assert found.rigid == 0
    for stiffness, count in ((k, 1), (k - 3 * c**2 / r, 2)):
        frequency = math.sqrt(stiffness / mass) / (2 * math.pi)
        assert np.sum(np.abs(found.frequencies / frequency - 1) < 1e-5) == count


def test_a_body_is_welded_to_a_massless_beam():
    """Two coordinates in each plane: deflection and rotation of the end of the beam, by its stiffness."""
    mass, offset, inertias, length = 2.0, 0.05, (4e-3, 5e-3, 7e-3), 0.4
    points = {"A": at(0, 0, 0, ground=True), "P": at(length, 0, 0), "Q": at(length + 0.1, 0.02, 0.03)}
    body = {
        "points": ["P", "Q"],
        "mass": f"{mass} kg",
        "centre": [f"{length + offset} m", "0 m", "0 m"],
        "inertia": [f"{x} kg*m^2" for x in inertias],
    }
    links = {"beam": elastic(["A", "P"], "1e-3 kg/m^3"), "body": body}
    welds = [{"point": "A", "links": ["beam"]}, {"point": "P", "links": ["body", "beam"]}]
    found = build(symgen.Scene(points=points, links=links, welds=welds)).modes()
    expected = []
    for area, inertia in ((ABOUT_WIDTH, inertias[2]), (ABOUT_THICKNESS, inertias[1])):
        stiffness = np.array([[12, -6 * length], [-6 * length, 4 * length**2]]) * E * area / length**3
        inertial = np.array([[mass, mass * offset], [mass * offset, inertia + mass * offset**2]])
        expected += list(np.sqrt(eigh(stiffness, inertial, eigvals_only=True)) / (2 * math.pi))
    for frequency in expected:
        assert np.min(np.abs(found.frequencies / frequency - 1)) < 1e-4


def test_stresses_moments_and_places_of_a_cantilever():
    """A force at the tip, with tension: E I w'' = F sinh(k (L - x))/(k cosh(k L)), k^2 = N/(E I)."""
    length, (tension, *across), part = 0.4, (40.0, 0.3, 0.2), 0.25
    scene = symgen.Scene(
        points={"A": at(0, 0, 0, ground=True), "B": at(length, 0, 0)},
        links={"beam": elastic(["A", "B"], "1e-3 kg/m^3")},
        welds=[{"point": "A", "links": ["beam"]}],
        forces=[{"point": "B", "force": [f"{x} N" for x in (tension, *across)]}],
        stations=[
            {"link": "beam", "at": part, "name": "quarter"},
            {"link": "beam", "at": 1, "name": "tip"},
        ],
    )
    linkage = LinkageInSpace(symgen.build(scene).rigid, elements=8)
    found = {v.name: v.values[0] for v in outputs(linkage, [equilibrium(linkage, 0.0)])}
    areas = np.array([ABOUT_WIDTH, ABOUT_THICKNESS])
    k = np.sqrt(tension / (E * areas))

    def moments(x):
        return across * np.sinh(k * (length - x)) / (k * np.cosh(k * length))

    # Fibres at y and z are stretched at the side from which the beam bends.
    bent = moments(part * length) / areas
    # The axes of the section are its width, along z, and its thickness, along -y.
    for number, (width, thickness) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)), 1):
        fibre = np.array([-thickness * THICKNESS, width * WIDTH]) / 2
        expected = tension / (WIDTH * THICKNESS) - bent @ fibre
        assert found[f"quarter.stress_{number}"] == pytest.approx(expected, rel=2e-3)
    deflected = across / np.float64(tension) * (length - np.tanh(k * length) / k)
    twisting = across[1] * deflected[0] - across[0] * deflected[1]
    np.testing.assert_allclose(found["beam.A.moment"], [-twisting, *-moments(0.0)], rtol=5e-3)
    np.testing.assert_allclose(found["beam.B.moment"], np.zeros(3), atol=1e-9)
    np.testing.assert_allclose(found["beam.A.force"], [-tension, *-np.array(across)], rtol=1e-6)
    np.testing.assert_allclose(found["tip.position"][1:], deflected, rtol=1e-3)
    np.testing.assert_allclose(found["tip.position"], found["B.position"], atol=1e-15)


def test_cycles_are_counted_of_a_fibre_in_space():
    result = symgen.build("spatial_slider_crank").simulate(0.03, samples=61)
    stress = result["rod.stress_2"].values
    cycles = result.fatigue_cycles("rod.stress_2")
    assert float(cycles["range"][0]) == pytest.approx(np.ptp(stress))
    assert np.min(stress) < 0.0 < np.max(stress)
    fibres = np.array([np.abs(result[f"rod.stress_{k}"].values) for k in range(1, 5)])
    np.testing.assert_allclose(np.max(fibres, axis=0), result["rod.stress"].values, rtol=1e-12)


def test_revolute_joints_across_the_plane_are_planar():
    """The shipped four-bar with no error of its axes, against planar elements in large rotation."""
    model = build("spatial_four_bar").with_parameters(error=0.0)
    found = model.simulate(0.01, samples=5, max_step=1e-4)
    square = {"coupler": "12 mm", "rocker": "8 mm"}
    links = {
        name: {
            "points": ends,
            "density": "7850 kg/m^3",
            "section": {"width": square[name], "thickness": square[name]},
            "elastic": {"E": "207 GPa", "element": "rayleigh", "damping": {"stiffness": "1e-5 s"}},
        }
        for name, ends in (("coupler", ["B", "C"]), ("rocker", ["D", "C"]))
    }
    planar = symgen.Scene(
        parameters={"rate": "30 rad/s"},
        points={
            "A": at(0, 0, ground=True),
            "B": at(0, 0.06),
            "C": at(0.24, 0.14),
            "D": at(0.22, 0, ground=True),
        },
        links={"crank": {"points": ["A", "B"], "mass": "1 kg"}, **links},
        crank={"link": "crank", "angle": "pi/2 + rate*t"},
        analysis={"t_end": "0.01 s"},
    )
    other = build(planar).large_rotation(elements=4, samples=5, max_step=1e-4)
    for name in ("coupler.C.force", "rocker.D.force", "C.position"):
        # The rate of the crank at the very start is a difference there.
        own, same = found[name].values[1:], other[name].values[1:]
        assert np.max(np.abs(own[:, 2])) < 1e-9
        # Green's strain of the chord differs by half its square.
        np.testing.assert_allclose(own[:, :2], same, atol=1e-4 * np.max(np.abs(same)))


def test_axes_of_joints_meet_in_motion():
    """The axis of an inclined revolute joint has the same direction in both links, in all motion."""
    model = build("spatial_four_bar")
    linkage = LinkageInSpace(model.rigid)
    found = SystemRun(linkage, GAUSS8, np.linspace(0.0, 0.02, 5), 20).run().moments()
    axis = np.array([0.0, math.sin(math.radians(5)), math.cos(math.radians(5))])
    ends = [link.places[-1, 3:].reshape(3, 3) for link in linkage.links]
    first, second = (np.array([(found[0].q[end] @ axis) @ moment.q[end] for moment in found]) for end in ends)
    np.testing.assert_allclose(first, second, atol=1e-9)
    assert np.max(np.abs(first - axis)) > 1e-3


def test_a_universal_joint_prescribes_the_spin():
    """The arm of the cross stays across the fixed axis, and so does the spin at the start."""
    linkage = LinkageInSpace(build("spatial_slider_crank").rigid)
    found = SystemRun(linkage, GAUSS8, np.linspace(0.0, 0.05, 6), 40).run().moments()
    arm = linkage.links[0].places[-1, 9:]
    assert np.max(np.abs([moment.q[arm[2]] for moment in found])) < 1e-9
    assert abs(found[0].v[arm[2]]) < 1e-12
    # It rotates about the axis of the ball joint.
    assert np.ptp([moment.q[arm[0]] for moment in found]) > 0.1


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        ({"kind": "universal", "axis": [2, 1, 0]}, "across the link"),
        ({"kind": "revolute", "axis": [0, 0, 1], "links": ["beam", "rod"]}, "fixed in the other link"),
    ],
)
def test_directions_that_a_joint_does_not_have_are_refused(joint, words):
    points = {"A": at(0, 0, 0, ground=True), "B": at(0.2, 0.1, 0), "C": at(0.4, 0.3, 0)}
    links = {"beam": elastic(["A", "B"]), "rod": {"points": ["B", "C"], "mass": "1 kg"}}
    joints = [{"point": "B", "links": ["beam"], **joint}]
    model = build(symgen.Scene(points=points, links=links, joints=joints))
    with pytest.raises(ModelError, match=words):
        model.modes()


def test_a_driven_link_in_space_without_an_axis_is_refused():
    points = {"A": at(0, 0, 0, ground=True), "B": at(0.2, 0, 0), "C": at(0.4, 0.3, 0.1)}
    links = {"crank": {"points": ["A", "B"], "mass": "1 kg"}, "beam": elastic(["B", "C"])}
    with pytest.raises(SceneError, match="crank has no revolute joint with the ground") as refused:
        build(symgen.Scene(points=points, links=links, drivers=[{"link": "crank", "angle": "3"}]))
    assert 'kind = "revolute"' in refused.value.hint


@pytest.mark.parametrize("of", ["modes", "simulate"])
def test_joints_that_repeat_others_are_refused(of):
    points = {"A": at(0, 0, 0, ground=True), "B": at(0.2, 0.1, 0)}
    joints = [{"point": "A", "links": ["beam"], "kind": "revolute", "axis": [0, 0, 1]}]
    welds = [{"point": "A", "links": ["beam"]}]
    scene = symgen.Scene(points=points, links={"beam": elastic(["A", "B"])}, joints=joints, welds=welds)
    with pytest.raises(ModelError, match="the weld at A, the revolute at A\n"):
        getattr(build(scene), of)()


def test_a_pose_is_that_of_the_input_whichever_way_it_went_there():
    """The input depends on rate times time; the end of the scene, 2 pi/rate, is negative for one of them."""
    model = build("spatial_four_bar")
    backwards = model.with_parameters(rate=-model.parameters["rate"])
    np.testing.assert_allclose(
        backwards.modes(0.02).frequencies[:4], model.modes(-0.02).frequencies[:4], rtol=1e-7
    )
