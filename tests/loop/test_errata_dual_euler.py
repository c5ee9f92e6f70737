"""docs/errata_dual_euler.md: every measured number of the page, and the statements about single equations."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from shared import errata_sizes as sizes
from shared import printed_slider_crank as printed
from shared.closed_slider_crank import (
    A1,
    A2,
    SPEED,
    Closed,
    Offsets,
    rotation_y,
    rotation_z,
)

PAGE = (Path(__file__).parents[2] / "docs" / "errata_dual_euler.md").read_text()


@pytest.fixture(scope="module")
def turns():
    return sizes.printed_turns()


def page_table(name):
    """Return the rows of a measured table of the page: keys, and the numbers as they are written."""
    found = re.search(rf"<!-- measured: {name}, (\d) keys -->\n((?:\|.*\n)+)", PAGE)
    assert found, f"the page has no table {name!r}"
    keys = int(found[1])
    rows = [[cell.strip() for cell in line.strip("|\n").split("|")] for line in found[2].splitlines()[2:]]
    return {tuple(row[:keys]): row[keys:] for row in rows}


def agree(name, measured):
    written = page_table(name)
    assert list(written) == list(measured)
    for key, cells in written.items():
        for cell, value in zip(cells, measured[key], strict=True):
            if cell == "-":
                assert np.isnan(value)
                continue
            digits = len(cell.partition(".")[2])
            assert float(cell) == pytest.approx(value, abs=0.51 * 10.0**-digits), (name, key, cell, value)


def test_displacements(turns):
    agree("displacement", sizes.displacement(turns))
    for a4 in (0, 30):  # in the plane it is exact
        turn = turns[Offsets(a4)]
        assert turn.complete and np.max(np.abs(turn.S4 - Closed(Offsets(a4), turn.theta).S4)) < 1e-11


def test_rates():
    agree("rates", sizes.rates())


def test_limits():
    agree("limits", sizes.limits())


def test_convergence_limits_of_the_printed_iteration(turns):
    for a4, last in sizes.LAST_GOOD.items():
        assert turns[Offsets(a4, 270, last)].complete
        assert not turns[Offsets(a4, 270, last + 0.25)].complete
    assert len(turns[Offsets(0, 270, 0.25)].unknowns) <= 15
    assert [turns[Offsets(20, alpha4, 0)].complete for alpha4 in (231, 232, 311, 312)] == [0, 1, 1, 0]


def test_convergence_limits_with_loose_settings():
    scenes = [
        Offsets(a4, 270, last + more) for a4, last in sizes.LAST_GOOD_LOOSE.items() for more in (0, 0.25)
    ]
    found = printed.turns(scenes, tolerance=1e-3, limit=20)
    assert [t.complete for t in found] == [True, False] * 4


def test_every_twist_of_the_slider_assembles():
    least = min(np.min(Closed(Offsets(20, a, 0), sizes.TURN).discriminant) for a in range(0, 360))
    assert least == pytest.approx(1476, abs=0.5)


def test_planar_forces():
    agree("forces", sizes.forces())


def test_planar_forces_are_right_with_both_repairs():
    worst = max(
        sizes.planar_forces(a4, degrees, signs=True, centres=True)[1]
        for a4 in (0, 10, 20, 30)
        for degrees in range(0, 360, 7)
    )
    assert worst < 1e-9


def test_mass_centres():
    agree("centres", sizes.centres())


def test_thrust_of_the_crank():
    agree("thrust", sizes.thrust())


def test_moments_of_the_crank_bearing():
    """T1i = -F1j S1 + a1 s1 F1k and T1j = F1i S1 - a1 c1 F1k: the inertia of the crank adds nothing."""
    for scene in ((30, 270, 9), (20, 232, 0)):
        offsets = Offsets(*scene)
        found = Closed(offsets, sizes.TURN).forces(load=0.0)
        (i, j, k), (ti, tj, _) = found["F1"].T, found["T1"].T
        c, s = np.cos(sizes.TURN), np.sin(sizes.TURN)
        assert ti == pytest.approx(-j * offsets.S1 + A1 * s * k, abs=1e-10)
        assert tj == pytest.approx(i * offsets.S1 - A1 * c * k, abs=1e-10)


def test_dead_centres():
    agree("dead_centres", sizes.dead_centres())


@pytest.mark.parametrize("scene", [(30, 270, 0), (20, 232, 0)])
def test_the_residue_is_that_of_the_forces(scene):
    of_scene = {k[3]: v[1] for k, v in sizes.dead_centres().items() if k[:3] == sizes.key(scene)}
    assert len(of_scene) == 2
    for degrees, residue in of_scene.items():
        off = 1e-4
        near = np.radians(float(degrees)) + np.array([-off, off])
        load = Closed(Offsets(*scene), near).forces(torque=100.0)["F4"][:, 2]
        assert (load[1] - load[0]) / 2 * off == pytest.approx(residue, rel=1e-3)


def test_forces_stay_finite_where_the_load_is_given():
    found = Closed(Offsets(30, 270, 9), np.radians(np.arange(0, 360, 0.01))).forces(load=0.0)
    assert max(np.max(np.abs(f)) for f in found.values()) < 1e3


def test_statements_that_are_right():
    for scene in sizes.STUDY:
        found = Closed(Offsets(*scene), sizes.TURN + 1e-3).forces(torque=100.0)
        assert found["F2"][:, 1] == pytest.approx(-100 / A1, abs=1e-8)


def test_closure_needs_k3_across_k4():
    """alpha3 = 90 deg is right exactly where the condition of the page holds."""
    offsets = Offsets(20, 250, 4)
    closed = Closed(offsets, sizes.TURN)
    theta2, eta2, _, _, alpha3 = closed.angles()
    beta = np.radians(offsets.alpha4) + np.pi / 2
    gap = np.sin(eta2) * np.sin(closed.theta + theta2) * np.cos(beta) - np.cos(eta2) * np.sin(beta)
    k3_k4 = np.cos(alpha3) * np.cos(closed.angles()[3])
    assert np.abs(gap) == pytest.approx(np.abs(k3_k4), abs=1e-13)
    assert np.max(np.abs(gap)) > 0.1


def test_eta2_is_constant_without_twist():
    rate = Closed(Offsets(30, 270, 9), sizes.TURN).angle_rates()[1]
    assert np.max(np.abs(rate)) < 1e-14
    theta2, eta2, theta3, *_ = Closed(Offsets(30, 270, 9), np.radians([119.3, 119.36])).angles()
    assert abs(printed.rates(theta2, eta2, theta3)[2][1]) > 20 * abs(
        printed.rates(theta2, eta2, theta3)[2][0]
    )


def test_corrected_angular_velocities_of_the_rod():
    """(35) and (36) as the page corrects them, against the turn of frame {3} from one angle to the next."""
    step = 1e-6
    for scene in ((30, 270, 9), (20, 232, 0), (0, 250, 3.5)):
        theta = sizes.TURN[::40]
        closed = Closed(Offsets(*scene), theta)
        _, eta2, theta3, eta3, _ = closed.angles()
        frames = []
        for at in (theta - step, theta, theta + step):
            t2, e2, *_ = Closed(Offsets(*scene), at).angles()
            frames.append(rotation_z(at + t2) @ rotation_y(e2))
        rate = (frames[2] - frames[0]) / (2 * step) * SPEED
        spin = np.swapaxes(frames[1], 1, 2) @ rate
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], -1)
        u2, v2, u3, v3, w3 = closed.angle_rates()
        forward = np.stack([-(SPEED + u2) * np.sin(eta2), v2, (SPEED + u2) * np.cos(eta2)], -1)
        c3, s3, ce3, se3 = np.cos(theta3), np.sin(theta3), np.cos(eta3), np.sin(eta3)
        backward = np.stack([v3 * s3, -v3 * c3, -u3], -1) - w3[:, None] * np.stack(
            [c3 * ce3, s3 * ce3, -se3], -1
        )
        assert forward == pytest.approx(omega, abs=1e-7)
        assert backward == pytest.approx(omega, abs=1e-7)


def test_quick_and_printed_form_of_the_newton_step_agree():
    generator = np.random.default_rng(7)
    for _ in range(5):
        offsets = Offsets(*generator.uniform([0, 230, 0], [30, 310, 9]))
        x, theta1 = generator.normal(size=5), generator.normal()
        M, real, dual = printed.operators(theta1, x, offsets)
        literal = printed.least_squares(M[None], real[None], dual[None])
        lengths = (offsets.a4, np.radians(offsets.alpha4), offsets.S1)
        quick, _ = printed.newton_step(theta1, x[None], *(np.array([v]) for v in lengths))
        assert quick == pytest.approx(literal, rel=1e-8, abs=1e-9)


def test_the_operator_of_eta_turns_about_the_turned_axis():
    """(9) is the skew matrix of Z(theta) j, not of j."""
    theta, x, y, z = sp.symbols("theta x y z")
    axis = sp.Matrix([-sp.sin(theta), sp.cos(theta), 0])
    operator = sp.Matrix([[0, 0, sp.cos(theta)], [0, 0, sp.sin(theta)], [-sp.cos(theta), -sp.sin(theta), 0]])
    assert operator * sp.Matrix([x, y, z]) == axis.cross(sp.Matrix([x, y, z]))


def test_39_follows_from_37_with_the_square_only():
    """Solve (37a), (37b), (37d) for theta2' at constant S1 and compare with (39), printed and corrected."""
    w, a1, a2, t2, e2, t3 = sp.symbols("w a1 a2 theta2 eta2 theta3")
    u, v, S = sp.symbols("u v S")  # rates of theta2, eta2, S4
    rows = [
        -(w + u) * sp.sin(e2) + v * sp.sin(t2) * sp.cos(e2),
        w * a1 * sp.sin(t2) * sp.cos(e2) + S * sp.sin(t3),
        w * (a1 * sp.cos(t2) + a2 * sp.cos(e2))
        + u * a2 * sp.cos(e2)
        + v * a2 * sp.sin(t2) * sp.sin(e2)
        - S * sp.cos(t3),
    ]
    found = sp.solve(rows, [u, v, S])[u]
    point = {w: 1.3, a1: 0.7, a2: 2.1, t2: 0.4, e2: 0.3, t3: 0.9}

    def theta2_rate(square):
        first = sp.sin(t2) * sp.cos(t3) * (sp.cos(e2) ** 2 if square else 1)
        return (-a1 * w * (first + sp.cos(t2) * sp.sin(t3) * sp.cos(e2)) - a2 * w * sp.sin(t3)) / (
            a2 * sp.sin(t3)
        )

    assert found.subs(point) == pytest.approx(theta2_rate(True).subs(point), rel=1e-12)
    assert abs(found.subs(point) - theta2_rate(False).subs(point)) > 1e-3


def test_69k_corrects_nothing():
    F2i, f1x, T, f, c, s, a1 = sp.symbols("F2i f1x T f c s a1")
    F1i = -(F2i + f1x) * c - (T + f) * s / a1
    F1j = -(F2i + f1x) * s + (T + f) * c / a1
    again = sp.expand(-F1i * c - F1j * s - f1x).subs(c**2, 1 - s**2)
    assert sp.expand(again - F2i) == 0


def test_the_printed_thrust_contradicts_itself():
    """(69a) with F1k = m1 S1'' and f1z = m1 S1'' gives -2 m1 S1''."""
    m1, acceleration = sp.symbols("m1 acceleration")
    assert -(m1 * acceleration + m1 * acceleration) == -2 * m1 * acceleration


def test_the_rod_length_is_kept():
    closed = Closed(Offsets(30, 270, 9), sizes.TURN)
    assert np.linalg.norm(closed.slider - closed.crank_pin, axis=-1) == pytest.approx(A2, abs=1e-12)
