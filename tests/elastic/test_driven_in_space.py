"""Rigid links in space that drives rotate about revolute joints with the ground."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shared.in_numpy import build

import symgen
from symgen.errors import SceneError
from symgen.runtime.elastic.large.statics import equilibrium
from symgen.runtime.elastic.space.drives import drives
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.scene.loading import read_scene

SECTION = {"width": "8 mm", "thickness": "4 mm", "width_along": [0, 0, 1]}
WIDTH, THICKNESS, E, DENSITY, G = 8e-3, 4e-3, 210e9, 7850.0, 9.81


def at(*place, **keys):
    return {"at": [f"{x} m" for x in place], **keys}


def elastic(points, **more):
    of = {"E": "210 GPa", "elements": 3, "shear": {"poisson": 0.3}, **more}
    return {"points": points, "density": "7850 kg/m^3", "section": SECTION, "elastic": of}


def crank(axis, angle, point="K"):
    """Return the tables of a driven crank."""
    joint = {"point": point, "links": ["crank"], "kind": "revolute", "axis": axis}
    parameters = {"parameters": {"w": "1 rad/s"}} if "w" in angle else {}
    return {"joints": [joint], "drivers": [{"link": "crank", "angle": angle}], **parameters}


@pytest.mark.parametrize("points", [["K", "A"], ["A", "K"]])
def test_torque_of_a_rod_on_a_cone(points):
    """(m/3 + M) rho^2 phi'' less the moment of the weights about the axis; the rod is inclined to it."""
    a, place, mass, tip = np.array([1.0, 2.0, 2.0]) / 3, np.array([0.1, 0.3, -0.2]), 0.7, 0.4
    scene = symgen.Scene(
        points={"K": at(0, 0, 0, ground=True), "A": at(*place)},
        links={"crank": {"points": points, "mass": f"{mass} kg"}},
        masses=[{"point": "A", "mass": f"{tip} kg"}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"{-G} m/s^2"]},
        analysis={"t_end": "0.5 s", "outputs": ["A.position", "crank.torque", "crank.angle", "energy"]},
        **crank([1, 2, 2], "1.5 + 3*sin(4*w*t)"),
    )
    run = build(scene).simulate(samples=7, rtol=1e-10)
    t = run.time
    angle, second = 1.5 + 3 * np.sin(4 * t), -48 * np.sin(4 * t)
    along = (a @ place) * a
    across = place - along
    there = along + np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(a, across))
    np.testing.assert_allclose(run["A.position"].values, there, atol=1e-12)
    np.testing.assert_allclose(run["crank.angle"].values, angle, rtol=1e-14)  # beyond pi too
    inertia = (mass / 3 + tip) * across @ across
    weight = (mass / 2 + tip) * np.array([0.0, 0.0, -G])
    expected = inertia * second - np.cross(there, weight) @ a
    np.testing.assert_allclose(run["crank.torque"].values, expected, rtol=1e-9, atol=1e-9)


def test_a_rod_swings_about_an_inclined_axis():
    """omega^2 = 3 g cos(b)/(2 L), with the axis inclined by b to the horizontal, and the rod across it."""
    tables = crank([4, 0, 3], "w*t") | {"drivers": []}
    points = {"K": at(0, 0, 0, ground=True), "A": at(0.3, 0, -0.4)}
    links = {"crank": {"points": ["K", "A"], "mass": "0.2 kg"}}
    gravity = {"acceleration": ["0 m/s^2", "0 m/s^2", f"{-G} m/s^2"]}
    found = build(symgen.Scene(points=points, links=links, gravity=gravity, **tables)).modes()
    expected = math.sqrt(1.5 * G * 0.8 / 0.5) / (2 * math.pi)
    np.testing.assert_allclose(found.frequencies, [expected], rtol=1e-9)


def test_a_driven_crank_is_a_prescribed_crank_pin():
    """Runs with the motion of the pin agree; the torque is the moment of its force."""
    tables = {k: v for k, v in read_scene("spatial_slider_crank").data.items() if k != "drivers"}
    motion = ["r*sin(rate*t)/sqrt(2)", "r*cos(rate*t) - r", "r*sin(rate*t)/sqrt(2)"]
    pin = tables["points"]["A"] | {"ground": True, "motion": motion}
    tables["points"] = tables["points"] | {"A": pin}
    tables["joints"] = [joint for joint in tables["joints"] if joint["point"] != "K"]
    asked = {"t_end": 0.02, "samples": 41, "max_step": 5e-5}
    run = symgen.build("spatial_slider_crank").simulate(**asked)
    other = symgen.build(symgen.Scene(**tables)).simulate(**asked)
    for name in ("rod.stress", "rod.A.force", "rod.deflection", "P.position"):
        size = np.max(np.abs(other[name].values))
        np.testing.assert_allclose(run[name].values, other[name].values, atol=1e-6 * size)
    moments = np.cross(run["A.position"].values, -run["rod.A.force"].values)
    expected = -moments @ np.array([1.0, 0.0, -1.0]) / math.sqrt(2)
    np.testing.assert_allclose(run["crank.torque"].values, expected, atol=1e-8 * np.max(np.abs(expected)))
    np.testing.assert_allclose(run["crank.power"].values, 60.0 * run["crank.torque"].values, rtol=1e-12)


def test_an_elastic_link_welded_to_a_driven_hub_rotates_with_it():
    """A cantilever under its weight, rotated by a right angle: w L^4/(8 E I) of the other plane.

    The drive holds the moment of the weight about its axis.
    """
    scene = symgen.Scene(
        points={"K": at(0, 0, 0, ground=True), "A": at(0, 0.05, 0), "T": at(0.4, 0.05, 0)},
        links={"crank": {"points": ["K", "A"], "mass": "0.2 kg"}, "beam": elastic(["A", "T"])},
        welds=[{"point": "A", "links": ["beam", "crank"]}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"{-G} m/s^2"]},
        analysis={"t_end": "1 s"},
        **crank([1, 0, 0], "pi/2*w*t"),
    )
    linkage = LinkageInSpace(build(scene).rigid)
    weight, length = DENSITY * WIDTH * THICKNESS * G, 0.4
    for t, (b, h) in ((0.0, (THICKNESS, WIDTH)), (1.0, (WIDTH, THICKNESS))):
        found = equilibrium(linkage, t)
        hub, tip = (linkage.positions(np.array([t]), found.q[None])[p][0] for p in "AT")
        sag = weight * length**4 / (8 * E * b * h**3 / 12)
        assert hub[2] - tip[2] == pytest.approx(sag, rel=1e-3)
        torque = drives(linkage, [found])[0].values[0]
        lever = 0.05 * math.cos(math.pi / 2 * t)
        assert torque == pytest.approx((weight * length + 0.1 * G) * lever, rel=1e-6, abs=1e-9)


def test_the_drive_of_a_rotating_beam_gives_its_power():
    """The work of the torque is the kinetic and strain energy of a beam welded to a hub."""
    scene = symgen.Scene(
        points={"K": at(0, 0, 0, ground=True), "A": at(0.05, 0, 0.02), "T": at(0.3, 0.1, 0)},
        links={"crank": {"points": ["K", "A"], "mass": "0.2 kg"}, "beam": elastic(["A", "T"])},
        welds=[{"point": "A", "links": ["beam", "crank"]}],
        analysis={"t_end": "0.02 s"},
        **crank([0, 1, 2], "2*(1 - cos(60*w*t))"),
    )
    run = build(scene).simulate(samples=401, max_step=5e-5)
    energy = run["kinetic_energy"].values + run["strain_energy"].values
    t, power = run.time, run["crank.power"].values
    # Simpson's rule, as the samples are equally spaced; the first has no second rates.
    work = np.sum((t[2] - t[0]) / 6 * (power[2:-2:2] + 4 * power[3:-1:2] + power[4::2]))
    assert energy[-1] - energy[2] == pytest.approx(work, rel=1e-5)
    assert run.drift.energy < 1e-6 * run.drift.energy_exchanged


@pytest.mark.parametrize(
    ("output", "words"),
    [
        ("rod.angle", "only a link that is driven against the ground has an angle, got rod.angle"),
        ("crank.speed_ratio", "got a linkage in space"),
        ("rod.angular_acceleration", "only in the plane, got rod.angular_acceleration"),
    ],
)
def test_outputs_by_angles_that_space_does_not_have(output, words):
    scene = symgen.Scene(
        points={"K": at(0, 0, 0, ground=True), "A": at(0, 0.1, 0), "B": at(0.2, 0.2, 0.1)},
        links={
            "crank": {"points": ["K", "A"], "mass": "1 kg"},
            "rod": {"points": ["A", "B"], "mass": "1 kg"},
        },
        analysis={"outputs": [output]},
        **crank([1, 0, 0], "w*t"),
    )
    with pytest.raises(SceneError, match=words):
        build(scene)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"joints": []}, "crank has no revolute joint with the ground"),
        ({"joints": [{"axis": [0, 0, 0]}]}, "axis across crank"),
        ({"joints": [{"axis": [0, 1, 0]}]}, "axis across crank"),
        ({"joints": [{"point": "A"}]}, "expected a ground point of crank"),
        ({"joints": [{}, {}]}, "two revolute joints"),
    ],
)
def test_refused(change, words):
    tables = crank([1, 0, 0], "w*t")
    tables["joints"] = [tables["joints"][0] | other for other in change["joints"]]
    points = {"K": at(0, 0, 0, ground=True), "A": at(0, 0.05, 0)}
    scene = symgen.Scene(points=points, links={"crank": {"points": ["K", "A"], "mass": "1 kg"}}, **tables)
    with pytest.raises(SceneError, match=words):
        symgen.build(scene)
