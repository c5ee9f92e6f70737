"""Joint forces and deformed shape of elastic motions, against Newton's laws, rigid linkages and closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shared.elastic_scenes as bars
from shared.elastic_golden import FORCES
from shared.elastic_scenes import by_method

import symgen

#: SI units of the golden numbers.
LBF, LBF_FT, SLUG = 4.4482216152605, 4.4482216152605 * 0.3048, 14.593902937206364
ANGLES = np.radians(list(FORCES))


@pytest.mark.parametrize("changes", [{}, {"links.coupler.elastic.axial": False}])
def test_rigid_forces_as_published(changes):
    """Loads of the rigid motion alone: forces by elements of the method, of Newton and Euler."""
    model = symgen.build("thesis_four_bar", set={"bearing": "0 slug", **changes})
    found = model.quasi_static(at=ANGLES, geometric_stiffness=False)
    # The nodal force F acts as -F on an element at its first node, as +F at its second.
    for end, sign in (("crank.M", -1), ("crank.A", 1), ("coupler.A", -1), ("coupler.B", 1), ("output.B", -1)):
        expected = np.array([nodal(row)[end[-1]] for row in FORCES.values()]) * sign * LBF
        assert found.variable(f"{end}.force").values == pytest.approx(expected, rel=2e-7, abs=1e-7)
    torque = np.array([row[2][0] for row in FORCES.values()]) * LBF_FT
    assert found.variable("crank.torque").values == pytest.approx(torque, rel=2e-7)


def nodal(row):
    first, second, _ = row
    return {"M": first[:2], "A": first[2:], "B": second[:2], "Q": second[2:]}


def test_a_stiff_linkage_has_the_forces_of_a_rigid_one():
    """In the steady state they differ by what falls as the stiffness grows."""
    differences = []
    for modulus in ("10.3e10 psi", "10.3e11 psi"):
        model = symgen.build("thesis_four_bar", set={"E": modulus, "bearing": "0 slug"})
        found = model.periodic(at=ANGLES, steps=4096)
        forces = np.array([nodal(row)["B"] for row in FORCES.values()]) * LBF
        torque = np.array([row[2][0] for row in FORCES.values()]) * LBF_FT
        gaps = (
            found.variable("coupler.B.force").values - forces,
            found.variable("crank.torque").values - torque,
        )
        differences.append(
            [np.max(np.abs(gap)) for gap in gaps] / np.array([np.max(np.abs(forces)), torque[0]])
        )
    assert np.all(differences[0] < 5e-3)
    assert differences[1] == pytest.approx(differences[0] / 10, rel=0.05)


POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)
POINTS, WEIGHTS = (1 + POINTS) / 2, WEIGHTS / 2


@pytest.fixture(scope="module", params=["stretching", "of one length", "damped modes"])
def moving(request, tmp_path_factory):
    """Five neighbouring times of the transient at 95 rpm, and their distance [s]."""
    text = (Path(symgen.__file__).parent / "scenes" / "thesis_four_bar.toml").read_text()
    for link in ("crank", "coupler", "output"):
        for i, at in enumerate(POINTS.tolist()):
            text += f'\n[[stations]]\nlink = "{link}"\nat = {at!r}\nname = "{link}_{i}"\n'
    if request.param == "damped modes":
        text += "\n[modal_damping]\nratio = 0.1\n"
    file = tmp_path_factory.mktemp("scene") / "four_bar.toml"
    file.write_text(text)
    changes = {"speed": "95 rpm"}
    if request.param == "of one length":
        changes["links.coupler.elastic.axial"] = False
    step = 5e-6
    turned = 95 * np.pi / 30 * step
    model = symgen.build(str(file), set=changes)
    return model.simulate(method="gauss", at=np.radians(130) + turned * np.arange(-2, 3), steps=4096), step


def middle_rate(values, step):
    """Second derivative at the middle of five times, to the fourth order."""
    return (-values[0] + 16 * values[1] - 30 * values[2] + 16 * values[3] - values[4]) / (12 * step**2)


def test_what_two_links_feel_at_a_joint_moves_what_is_there(moving):
    found, step = moving
    for joint, links in (("A", ("crank", "coupler")), ("B", ("coupler", "output"))):
        sums = sum(found.variable(f"{link}.{joint}.force").values[2] for link in links)
        assert np.linalg.norm(found.variable(f"{links[0]}.{joint}.force").values[2]) > 0.1
        inertia = 0.0040803133 * SLUG * middle_rate(found.variable(f"{joint}.position").values, step)
        assert sums == pytest.approx(-inertia, rel=1e-4, abs=1e-4)


def test_forces_on_a_link_change_its_momentum(moving):
    """Newton's law for a whole link: its mass times its places, differentiated twice."""
    found, step = moving
    inch = 0.0254
    ground = {"M": np.zeros(2), "Q": np.array([11 * inch, 0.0])}
    mass = 5.292 * SLUG / 0.3048**3 * 0.125 * inch**2
    for link, ends, length in (("crank", "MA", 7), ("coupler", "AB", 10), ("output", "BQ", 12)):
        now = [found.variable(f"{p}.position").values if p in "AB" else ground[p] for p in ends]
        rigid = [
            x - found.variable(f"{p}.displacement").values if p in "AB" else x
            for p, x in zip(ends, now, strict=True)
        ]
        along = (rigid[1] - rigid[0]) / (length * inch)
        across = np.column_stack([-along[:, 1], along[:, 0]])
        centre = np.zeros((5, 2))
        for i, (at, weight) in enumerate(zip(POINTS, WEIGHTS, strict=True)):
            bent = found.variable(f"{link}_{i}.deflection").values[:, None] * across
            centre += weight * ((1 - at) * now[0] + at * now[1] + bent)
        expected = mass * length * inch * middle_rate(centre, step)
        sums = sum(found.variable(f"{link}.{p}.force").values[2] for p in ends)
        assert np.linalg.norm(expected) > 0.1
        assert sums == pytest.approx(expected, rel=1e-4, abs=1e-4)


def test_torque_of_a_rigid_crank_by_its_power():
    """Power is the rate of the kinetic energy of the rigid linkage, in closed form."""
    model = symgen.build("elastic_slider_crank")
    omega, r, length, rho = 50 * np.pi, 0.05, 0.2, 7850.0
    rod, piston = rho * 0.012 * 0.004 * length, 0.3

    def energy(angle):
        s, c = np.sin(angle), np.cos(angle)
        root = np.sqrt(length**2 - (r * s) ** 2)
        va = r * omega * np.array([-s, c])
        vp = np.array([-r * omega * s - r**2 * s * c * omega / root, 0.0])
        return rod / 6 * (va @ va + va @ vp + vp @ vp) + piston / 2 * vp @ vp

    found = model.quasi_static(at=[0.7, 2.0, 4.4], geometric_stiffness=False)
    found = found.variable("crank.torque").values
    h = 1e-5
    expected = [(energy(a + h) - energy(a - h)) / (2 * h) for a in (0.7, 2.0, 4.4)]
    assert found == pytest.approx(expected, rel=1e-7)


def test_shape_of_a_cantilever_under_a_load(tmp_path):
    """Tip d = F L^3/3EI; the middle 5d/16, and the line to the tip is shortened by d^2/10L."""
    stiffness = bars.E * bars.INERTIA
    tip = 0.01
    load = f'[[forces]]\npoint = "tip"\nforce = ["0 N", "{3 * stiffness * tip} N"]'
    for elements in (1, 2):
        found = bars.cantilever(tmp_path, f", elements = {elements}", more=load).quasi_static(samples=2)
        assert found.variable("tip.position").values[0] == pytest.approx([1.0, tip], rel=1e-9)
        assert found.variable("bar.deflection").values[0] == pytest.approx((5 / 16 - 1 / 2) * tip, rel=1e-8)
        assert found.variable("bar.length_change").values[0] == pytest.approx(-(tip**2) / 10, rel=1e-8)
        assert found.variable("bar.O.force").values[0] == pytest.approx(
            [0.0, -3 * stiffness * tip], rel=1e-9, abs=1e-6
        )
        assert found.variable("bar.torque").values[0] == pytest.approx(-3 * stiffness * tip, rel=1e-9)


@pytest.mark.parametrize("method", ["quasi-static", "gauss"])
def test_the_clamp_takes_what_lies_along_the_bar(tmp_path, method):
    """q per length: q L and q L^2/2 at rest; in motion the tip, which nothing holds, feels no force."""
    load = '[[distributed_forces]]\nlink = "bar"\nforce = ["0 N/m", "30 N/m"]'
    model = bars.cantilever(tmp_path, ", elements = 2", more=load)
    found = by_method(model, method, samples=3, **({} if method == "quasi-static" else {"steps": 4096}))
    if method == "quasi-static":
        assert found.variable("bar.O.force").values[1] == pytest.approx([0.0, -30.0], abs=1e-9)
        assert found.variable("bar.torque").values[1] == pytest.approx(-15.0, rel=1e-9)
    assert np.max(np.abs(found.variable("bar.tip.force").values)) < 1e-6
