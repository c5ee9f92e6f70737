"""Equilibrium of elastic links in space in large displacements, against published shapes and closed forms."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from scipy.special import ellipe, ellipk
from shared.commands import call
from shared.in_numpy import build

import symgen
from symgen.errors import CapabilityError
from symgen.runtime.elastic.space.linkage import LinkageInSpace

#: Tip of a cantilever bent along 45 degrees of a circle of 100 m, section 1 m by 1 m, E = 10 MPa without
#: contraction, under a force across its plane: K. J. Bathe, S. Bolourchi, International Journal for Numerical
#: Methods in Engineering 14 (1979); J. C. Simo, L. Vu-Quoc, Computer Methods in Applied Mechanics and
#: Engineering 58 (1986); eight elements each.
BEND = {
    300.0: [(22.5, 59.2, 39.5), (22.33, 58.84, 40.08)],
    600.0: [(15.9, 47.2, 53.4), (15.79, 47.23, 53.37)],
}
#: Section of a column, and its bending stiffness.
COLUMN = {"width": "10 mm", "thickness": "4 mm", "width_along": [1, 0, 0]}
EI = 210e9 * 10e-3 * 4e-3**3 / 12


def at(*components, **more):
    return {"at": [f"{float(x)!r} m" for x in components], **more}


def link(first, last, section, modulus, poisson, elements):
    elastic = {"E": modulus, "elements": elements, "shear": {"poisson": poisson}}
    return {"points": [first, last], "density": "1 kg/m^3", "section": section, "elastic": elastic}


def bend(force, count=8):
    """A bend of so many straight links of one element."""
    angles = np.linspace(0.0, math.pi / 4, count + 1)
    points = {
        f"P{k}": at(100 * (1 - math.cos(x)), 100 * math.sin(x), 0, ground=k == 0)
        for k, x in enumerate(angles)
    }
    square = {"width": "1 m", "thickness": "1 m", "width_along": [0, 0, 1]}
    links = {f"b{k}": link(f"P{k}", f"P{k + 1}", square, "1e7 Pa", 0.0, 1) for k in range(count)}
    welds = [{"point": "P0", "links": ["b0"]}]
    welds += [{"point": f"P{k}", "links": [f"b{k - 1}", f"b{k}"]} for k in range(1, count)]
    return symgen.Scene(
        points=points,
        links=links,
        welds=welds,
        forces=[{"point": f"P{count}", "force": ["0 N", "0 N", f"{force} N"]}],
        analysis={"t_end": "1 s"},
    )


def column(force, elements=16):
    return symgen.Scene(
        points={"O": at(0, 0, 0, ground=True), "P": at(0, 0, 1)},
        links={"beam": link("O", "P", COLUMN, "210 GPa", 0.3, elements)},
        welds=[{"point": "O", "links": ["beam"]}],
        forces=[{"point": "P", "force": ["0 N", "0 N", f"-{force} N"]}],
        analysis={"t_end": "1 s"},
    )


@pytest.mark.parametrize("force", BEND)
def test_bend_of_45_degrees(force):
    found = build(bend(force)).equilibrium()
    for published in BEND[force]:
        np.testing.assert_allclose(found.state.positions["P8"], published, atol=1.1)
    assert found.stability == "stable"
    assert found.residual < 1e-8 * found.scale and found.scale == pytest.approx(force)
    np.testing.assert_allclose(found.outputs["b0.P0.force"], [0, 0, -force], atol=1e-6)


def test_moments_at_the_clamp_are_those_of_the_force_at_the_tip():
    """In fixed axes: the clamp turns about the width along z, and the force is along it."""
    found = build(bend(600.0)).equilibrium()
    x, y, _ = found.state.positions["P8"]
    along = np.array([math.sin(math.pi / 64), math.cos(math.pi / 64), 0.0])  # of the first straight link
    axes = np.array([along, [0.0, 0.0, 1.0], np.cross(along, [0.0, 0.0, 1.0])])
    expected = -axes @ np.cross([x, y, 0.0], [0.0, 0.0, 600.0])
    np.testing.assert_allclose(found.outputs["b0.P0.moment"], expected, atol=1e-6 * np.max(np.abs(expected)))


def test_a_quasi_static_start_far_from_the_drawing_stays_at_rest():
    model = build(bend(600.0, 4))
    run = model.simulate(1e-3, samples=3, initial="quasi-static")
    places = run["P4.position"].values
    assert places[0, 2] > 50.0
    assert np.max(np.abs(places - places[0])) < 1e-6
    np.testing.assert_allclose(places[0], model.equilibrium().state.positions["P4"], atol=1e-8)


def test_a_column_beyond_its_buckling_load():
    """Euler's elastica: K(m)^2 = P L^2/EI, tip at 2 E/K - 1 along the line and 2 sqrt(m)/K across."""
    errors, force = [], 40.0
    m = brentq(lambda m: ellipk(m) ** 2 - force / EI, 0.01, 0.99)
    exact = [0.0, 2 * math.sqrt(m) / ellipk(m), 2 * ellipe(m) / ellipk(m) - 1]
    for elements in (4, 8):
        model = build(column(force, elements))
        straight = model.equilibrium(stable=False)
        assert straight.stability == "unstable"
        assert abs(straight.state.positions["P"][1]) < 1e-6
        bent = model.equilibrium()
        assert bent.stability == "stable"
        errors.append(np.max(np.abs(np.abs(bent.state.positions["P"]) - exact)))
    assert errors[1] < 1.5e-3
    assert 3.5 < math.log2(errors[0] / errors[1]) < 4.5


def rod(force, axial, about_y, about_z, torsion, length):
    """Return the tip of a clamped rod along x, width along y, by Kirchhoff's equations and shooting."""
    force, bending = np.asarray(force, float), np.array([torsion, about_y, about_z])

    def slopes(_, state):
        axes, couple = state[3:12].reshape(3, 3), state[12:]
        curvature = axes @ couple / bending
        line = (1 + axes[0] @ force / axial) * axes[0]
        turned = np.cross(curvature @ axes, axes)
        return np.concatenate([line, turned.ravel(), -np.cross(line, force)])

    def end(couple):
        start = np.concatenate([np.zeros(3), np.eye(3).ravel(), couple])
        return solve_ivp(slopes, (0.0, length), start, "DOP853", rtol=1e-11, atol=1e-11).y[:, -1]

    couple, whole = np.zeros(3), force
    for part in (0.25, 0.5, 0.75, 1.0):
        force = part * whole
        couple = fsolve(lambda c: end(c)[12:], couple, xtol=1e-12)
    return end(couple)[:3]


@pytest.mark.parametrize("section", [("0.2 m", "0.2 m"), ("0.3 m", "0.15 m"), ("0.5 m", "0.1 m")])
def test_bending_in_both_planes_with_twist_has_the_fourth_order(section):
    """A tip force across both axes, against Kirchhoff's rod: errors by halved elements."""
    flat = {"width": section[0], "thickness": section[1], "width_along": [0, 1, 0]}
    errors = []
    for elements in (4, 8):
        scene = symgen.Scene(
            points={"O": at(0, 0, 0, ground=True), "P": at(10, 0, 0)},
            links={"beam": link("O", "P", flat, "1e7 Pa", 0.3, elements)},
            welds=[{"point": "O", "links": ["beam"]}],
            forces=[{"point": "P", "force": ["-3 N", "12 N", "9 N"]}],
            analysis={"t_end": "1 s"},
        )
        model = build(scene)
        numbers = LinkageInSpace(model.rigid).links[0].section[4:8].real
        errors.append(
            np.max(np.abs(model.equilibrium().state.positions["P"] - rod([-3.0, 12.0, 9.0], *numbers, 10.0)))
        )
    assert errors[1] < 3e-3
    assert 3.4 < math.log2(errors[0] / errors[1]) < 5.0


def test_a_bent_cantilever():
    """The tip under a force across both legs: bending of both, and torsion of the first by the arm of the second."""
    round_, force, modulus = {"diameter": "20 mm"}, 1e-3, "200 GPa"
    legs = {
        "first": link("O", "A", round_, modulus, 0.3, 1),
        "second": link("A", "B", round_, modulus, 0.3, 2),
    }
    scene = symgen.Scene(
        points={"O": at(0, 0, 0, ground=True), "A": at(0, 0.8, 0), "B": at(0.3, 0.8, 0.4)},
        links=legs,
        welds=[{"point": "O", "links": ["first"]}, {"point": "A", "links": ["first", "second"]}],
        forces=[{"point": "B", "force": [f"{0.8 * force} N", 0, f"{-0.6 * force} N"]}],
    )
    moved = build(scene).equilibrium().state.positions["B"] - [0.3, 0.8, 0.4]
    bending, first, second = 200e9 * math.pi * 0.02**4 / 64, 0.8, 0.5
    torsion = bending / 1.3  # G 2 I
    exact = (first**3 + second**3) / (3 * bending) + second**2 * first / torsion
    assert moved @ [0.8, 0, -0.6] == pytest.approx(force * exact, rel=1e-7)


def test_a_column_below_it_is_straight_and_stable():
    found = build(column(0.99 * math.pi**2 * EI / 4)).equilibrium()
    assert found.stability == "stable" and abs(found.state.positions["P"][1]) < 1e-9


def test_a_drive_in_motion_has_no_equilibrium():
    with pytest.raises(CapabilityError, match="no equilibrium while a drive is in motion"):
        symgen.build("spatial_four_bar").equilibrium()


SCENE = """
symgen = 1
points = { O = { at = ["0 m", "0 m", "0 m"], ground = true }, P = { at = ["0 m", "0 m", "1 m"] } }
welds = [{ point = "O", links = ["beam"] }]
forces = [{ point = "P", force = ["0 N", "0 N", "-20 N"] }]

[links.beam]
points = ["O", "P"]
mass_per_length = "1 kg/m"
section = { width = "10 mm", thickness = "4 mm", width_along = [1, 0, 0] }
elastic = { E = "210 GPa", elements = 2, shear = { poisson = 0.3 } }
"""


def test_a_command_prints_it(tmp_path):
    file = tmp_path / "column.toml"
    file.write_text(SCENE)
    assert "stable equilibrium" in call("equilibrium", str(file))
    found = json.loads(call("equilibrium", str(file), "--json"))
    assert found["outputs"]["beam.O.force"]["value"] == pytest.approx([0.0, 0.0, 20.0], abs=1e-9)
