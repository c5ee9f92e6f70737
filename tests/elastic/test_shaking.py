"""Force and moment of elastic linkages on the ground, against joints there and rigid links.

The outputs follow from Newton's laws of the whole; joints on the ground are not among their terms.
"""

from __future__ import annotations

import numpy as np
import pytest

import symgen

INCH = 0.0254
SHAKING = ["shaking_force", "shaking_moment"]
LOADS = {
    "gravity": {"acceleration": ["1 m/s^2", "-9.81 m/s^2"]},
    "forces": [{"point": "B", "force": ["20 N", "-5 N"]}],
}
CASES = {
    "simulate": ("elastic_four_bar", {}, "simulate", {"samples": 12}),
    "quasi-static": ("elastic_four_bar", LOADS, "quasi_static", {"samples": 12}),
    "periodic": ("elastic_four_bar", LOADS, "periodic", {"samples": 12}),
    "large rotation": (
        *("elastic_four_bar", LOADS, "large_rotation"),
        {"samples": 6, "elements": 1, "revolutions": 0.1},
    ),
    "cantilever": ("rotating_cantilever", {}, "simulate", {"samples": 12}),
    "cantilever in large rotation": (
        *("rotating_cantilever", {}, "large_rotation"),
        {"samples": 6, "elements": 1, "revolutions": 0.1},
    ),
}
#: Crank, and the joints of links on the ground with their places [m].
GROUND = {
    "elastic_four_bar": ("crank", {"crank.M": (0.0, 0.0), "output.Q": (11 * INCH, 0.0)}),
    "rotating_cantilever": ("strip", {"strip.O": (0.0, 0.0)}),
}


@pytest.mark.parametrize("case", CASES)
def test_it_is_the_sum_of_the_reactions(case):
    scene, changes, call, arguments = CASES[case]
    crank, joints = GROUND[scene]
    outputs = [*SHAKING, f"{crank}.torque", *(f"{joint}.force" for joint in joints)]
    run = getattr(symgen.build(scene, set={**changes, "analysis.outputs": outputs}), call)(**arguments)
    forces = {joint: run.variable(f"{joint}.force").values for joint in joints}
    force = -sum(forces.values())
    moment = -run.variable(f"{crank}.torque").values
    for joint, (x, y) in joints.items():
        moment = moment - (x * forces[joint][:, 1] - y * forces[joint][:, 0])
    size = np.max(np.abs(force))
    assert np.max(np.abs(run.variable("shaking_force").values - force)) < 1e-10 * size
    assert np.max(np.abs(run.variable("shaking_moment").values - moment)) < 1e-10 * size
    assert [run.variable(name).unit for name in SHAKING] == ["N", "N*m"]


def test_of_stiff_links_it_is_that_of_rigid_ones():
    """A rigid crank, and a slider on a rail."""
    changes = {"links.rod.elastic.E": "210e15 Pa", "analysis.outputs": ["shaking_moment", "shaking_force.y"]}
    model = symgen.build("elastic_slider_crank", set=changes)
    elastic, rigid = model.quasi_static(samples=13), model.inverse_dynamics(samples=13)
    assert [*elastic] == ["shaking_moment", "shaking_force.y"]
    for name in elastic:
        expected = rigid.variable(name).values
        found = elastic.variable(name).values
        assert np.max(np.abs(expected)) > 1.0
        assert np.max(np.abs(found - expected)) < 1e-7 * np.max(np.abs(expected))


def test_in_space():
    """A massless crank: of the joints on the ground the axes take no moment but that of the drive."""
    changes = {f"links.{link}.elastic.elements": 1 for link in ("coupler", "rocker")}
    changes["analysis.outputs"] = [*SHAKING, "rocker.D.force", "coupler.B.force", "crank.torque"]
    run = symgen.build("spatial_four_bar", set=changes).simulate(0.002, samples=3)
    at_d, at_b = (run.variable(f"{joint}.force").values for joint in ("rocker.D", "coupler.B"))
    size = np.max(np.abs(at_b))
    assert np.max(np.abs(run.variable("shaking_force").values + at_d + at_b)) < 1e-10 * size
    moment = -run.variable("crank.torque").values - np.cross([0.22, 0.0, 0.0], at_d)[:, 2]
    assert np.max(np.abs(run.variable("shaking_moment").values[:, 2] - moment)) < 1e-8 * size
