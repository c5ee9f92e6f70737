"""Rotations, curvatures, arc lengths and the angle of the shaft: closed forms, and the assembly of the thesis."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared import elastic_scenes as bars
from shared.thesis_assembly import BOUNDARY, HELD, SPEED, assembled

import symgen

#: Rotations and curvatures of the four-bar by the numbers of Fig. 20.
NODES = {
    "crank.M.rotation": 3, "crank.M.curvature": 4, "crank.A.rotation": 7, "crank.A.curvature": 8,
    "coupler.A.rotation": 9, "coupler.A.curvature": 10, "coupler.B.rotation": 13, "coupler.B.curvature": 14,
    "output.B.rotation": 15, "output.B.curvature": 16, "output.Q.rotation": 19, "output.Q.curvature": 20,
}  # fmt: skip


def nodes(displacements, free):
    return {
        name: displacements[free.index(k)] if k in free else 0.0 * displacements[0]
        for name, k in NODES.items()
    }


@pytest.mark.parametrize("angle", [60.0, 200.0])
def test_nodes_of_the_thesis_linkage(angle):
    found = symgen.build("thesis_four_bar").quasi_static(at=[np.radians(angle)])
    of = assembled(np.radians(angle))
    shape = np.linalg.solve(of["elastic_stiffness"] + of["elastic_geometric_stiffness"], of["elastic_load"])
    expected = nodes(shape, [k for k in range(1, 21) if k not in (*BOUNDARY, HELD)])
    for name, value in expected.items():
        assert found[name].values == pytest.approx(value, rel=1e-9, abs=1e-12), name
    assert found["crank.shaft_angle"].values == pytest.approx(np.radians(angle))
    assert found["crank.M.rotation"].attrs["units"] == "rad"
    assert found["crank.M.curvature"].attrs["units"] == "1/m"


def test_angle_of_a_free_shaft():
    """The rigid angle and the first unknown of the thesis, from its equations."""
    end = 4e-4
    free = [k for k in range(1, 21) if k not in BOUNDARY]

    def rates(t, state):
        of, (s, v) = assembled(SPEED * t, held=False), np.split(state, 2)
        stiffness = sum(of[f"elastic_{kind}stiffness"] for kind in ("", "geometric_", "motion_"))
        force = of["elastic_load"] - of["elastic_gyroscopic"] @ v - stiffness @ s
        return np.concatenate([v, np.linalg.solve(of["elastic_mass"], force)])

    states = solve_ivp(rates, (0.0, end), np.zeros(2 * len(free)), method="DOP853", rtol=1e-8, atol=1e-13).y
    model = symgen.build("elastic_four_bar_free")
    run = model.simulate(revolutions=end * SPEED / (2 * np.pi), samples=2, rtol=1e-8)
    expected = nodes(states[: len(free), -1], free)
    for name, value in expected.items():
        assert run[name].values[-1] == pytest.approx(value, rel=1e-6, abs=1e-12), name
    turned = run["crank.shaft_angle"].values - run.coordinate.values
    assert turned[-1] == pytest.approx(expected["crank.M.rotation"], rel=1e-6) and abs(turned[-1]) > 1e-5


@pytest.mark.parametrize("mode", ["free", "motor"])
def test_angle_of_the_shaft_of_a_rigid_crank(mode):
    """The direction of its end, to the first order."""
    changes = {"crank.mode": mode, "links.crank.elastic": None}
    model = symgen.build(
        "elastic_four_bar_motor" if mode == "motor" else "elastic_four_bar_free", set=changes
    )
    found = model.simulate(revolutions=0.02, samples=5)
    ahead = found["crank.shaft_angle"].values - found.coordinate.values
    along = found["A.position"].values - found["A.displacement"].values
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    expected = np.sum(across * found["A.displacement"].values, axis=1) / np.sum(along**2, axis=1)
    assert np.max(np.abs(ahead)) > 1e-6
    assert ahead == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    "elastic", [", elements = 1", ', elements = 2, element = "cubic"', ', elements = 2, element = "timoshenko", shear = { poisson = 0.3 }',
                ", elements = 3, axial = false", ', elements = 4, reduction = { kind = "craig-bampton", modes = 2 }']
)  # fmt: skip
def test_ends_of_a_cantilever(tmp_path, elastic):
    """Under F at the tip F L^2/2EI and F L/EI; its centre line keeps its length, its ends come closer."""
    stiffness, tip = bars.E * bars.INERTIA, 0.01
    force = 3 * stiffness * tip
    load = f'[[forces]]\npoint = "tip"\nforce = ["0 N", "{force} N"]'
    found = bars.cantilever(tmp_path, elastic, more=load).quasi_static(samples=2)
    value = {v.name: v.values[0] for v in found.variables}
    assert value["bar.tip.rotation"] == pytest.approx(1.5 * tip, rel=1e-8)
    assert value["bar.O.curvature"] == pytest.approx(3 * tip, rel=1e-8)
    assert value["bar.O.rotation"] == 0.0
    assert value["bar.tip.curvature"] == pytest.approx(0.0, abs=1e-9)
    assert value["bar.arc_length_change"] == pytest.approx(0.0, abs=1e-12)
    assert value["bar.length_change"] == pytest.approx(-(tip**2) / 10, rel=1e-3)


def test_arc_of_a_pulled_and_bent_cantilever(tmp_path):
    """F L/EA along it, whatever the bending; (8.10) of the deformed curve by quadrature."""
    pull, tip = 1e5, 0.01
    load = f'[[forces]]\npoint = "tip"\nforce = ["{pull} N", "{3 * bars.E * bars.INERTIA * tip} N"]'
    model = bars.cantilever(tmp_path, ", elements = 2, geometric_stiffness = false", more=load)
    found = model.quasi_static(samples=2)
    stretch = pull * bars.LENGTH / (bars.E * bars.AREA)
    arc = found["bar.arc_length_change"].values[0]
    assert arc == pytest.approx(stretch, rel=1e-9)
    # Along the line between its ends, whose length changes by length_change, it deflects by w.
    x = np.linspace(0.0, 1.0, 20001)
    slope = np.gradient(tip * x**2 * (3 - x) / 2 - tip * x, x, edge_order=2)
    chord = bars.LENGTH + found["bar.length_change"].values[0]
    exact = np.trapezoid(np.sqrt(chord**2 + (bars.LENGTH * slope) ** 2), x) - bars.LENGTH
    assert arc == pytest.approx(exact, rel=1e-4)


def test_a_link_that_turns_keeps_its_arc():
    """A free crank turns the links far: each arc changes by the axial strain of its element, no more."""
    found = symgen.build("elastic_four_bar_free").simulate(revolutions=0.05, samples=4, steps=400)
    for link, inches in (("crank", 7), ("coupler", 10), ("output", 12)):
        stretch = found[f"{link}.axial_strain"].values * inches * 0.0254
        assert found[f"{link}.arc_length_change"].values == pytest.approx(stretch, rel=1e-6, abs=1e-15)
