"""Small oscillations against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.special import jn_zeros
from shared.in_numpy import build
from shared.linkages import GRAVITY, G, at, chain, ground

import symgen
from symgen.errors import CapabilityError


def test_a_uniform_rod_on_a_pin():
    found = build(chain([(0, 0), (0.9, 0.1)], [2.0])).modes()
    length = np.hypot(0.9, 0.1)
    assert found.frequencies == pytest.approx([np.sqrt(1.5 * G / length) / (2 * np.pi)], rel=1e-12)
    (mode,) = found.modes
    # Unit modal mass: m l^2/3 theta^2 = 1, the tip moves by l theta.
    assert mode.shape["P1"] == pytest.approx([length * np.sqrt(3 / (2 * length**2)), 0], abs=1e-12)
    assert mode.damping_ratio == 0 and found.stable and mode.kind == "oscillation"


def test_double_pendulum_of_rods_against_its_mass_and_stiffness_in_angles():
    m1, m2, l1, l2 = 1.2, 0.7, 0.8, 1.1
    scene = chain([(0, 0), (0, -l1), (0.3, -l1 - np.sqrt(l2**2 - 0.09))], [m1, m2])
    found = build(scene).modes()
    mass = np.array([[m1 * l1**2 / 3 + m2 * l1**2, m2 * l1 * l2 / 2], [m2 * l1 * l2 / 2, m2 * l2**2 / 3]])
    stiffness = G * np.diag([m1 * l1 / 2 + m2 * l1, m2 * l2 / 2])
    squares, angles = eigh(stiffness, mass)
    assert found.frequencies == pytest.approx(np.sqrt(squares) / (2 * np.pi), rel=1e-12)
    for i, mode in enumerate(found.modes):
        moved = np.array([l1 * angles[0, i], l1 * angles[0, i] + l2 * angles[1, i]])
        moved *= np.sign(moved[np.argmax(np.abs(moved))])
        assert [mode.shape["P1"][0], mode.shape["P2"][0]] == pytest.approx(moved, rel=1e-10)


def test_a_mass_on_a_spring_in_the_plane():
    """Along: sqrt(k/m), damped; across: a pendulum of the stretched length."""
    k, c, m, slack = 100.0, 4.0, 2.0, 0.5
    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(0, -0.6), "E": ground(0, -3)},
        links={"rail": {"points": ["O", "E"]}},
        masses=[{"point": "A", "mass": f"{m!r} kg"}],
        springs=[
            {
                "between": ["O", "A"],
                "stiffness": f"{k!r} N/m",
                "length": f"{slack!r} m",
                "damping": f"{c!r} N*s/m",
            }
        ],
        gravity=GRAVITY,
    )
    found = build(scene).modes()
    stretched = slack + m * G / k
    across, along = sorted(found.modes, key=lambda mode: mode.natural)
    assert across.omega == pytest.approx(np.sqrt(G / stretched), rel=1e-12)
    assert across.damping_ratio == pytest.approx(0, abs=1e-13)
    zeta = c / (2 * np.sqrt(k * m))
    assert along.natural == pytest.approx(np.sqrt(k / m), rel=1e-12)
    assert along.damping_ratio == pytest.approx(zeta, rel=1e-12)
    assert along.omega == pytest.approx(np.sqrt(k / m * (1 - zeta**2)), rel=1e-12)
    assert found.stable


def test_an_overdamped_oscillator_decays_twice():
    k, c, m = 100.0, 40.0, 2.0
    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0), "E": ground(3, 0)},
        links={"rail": {"points": ["O", "E"]}},
        masses=[{"point": "A", "mass": "2 kg"}],
        springs=[{"between": ["O", "A"], "stiffness": "100 N/m", "length": "1 m", "damping": "40 N*s/m"}],
        guides=[{"points": ["A"], "along": "rail"}],
    )
    found = build(scene).modes()
    exact = [(-c + s * np.sqrt(c**2 - 4 * k * m)) / (2 * m) for s in (1, -1)]
    assert [mode.s for mode in found.modes] == pytest.approx(exact, rel=1e-12)
    assert [mode.kind for mode in found.modes] == ["decay", "decay"]
    assert [mode.omega for mode in found.modes] == [0, 0] and len(found.frequencies) == 0


def test_two_coupled_oscillators_with_unequal_dampers():
    """Non-proportional damping: roots of the characteristic polynomial, multiplied out by hand."""
    k1, k2, c1, c2, m1, m2 = 90.0, 40.0, 1.5, 6.0, 1.0, 2.0
    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0), "B": at(2, 0), "E": ground(4, 0)},
        links={"rail": {"points": ["O", "E"]}},
        masses=[{"point": "A", "mass": "1 kg"}, {"point": "B", "mass": "2 kg"}],
        springs=[
            {"between": ["O", "A"], "stiffness": "90 N/m", "length": "1 m", "damping": "1.5 N*s/m"},
            {"between": ["A", "B"], "stiffness": "40 N/m", "length": "1 m", "damping": "6 N*s/m"},
        ],
        guides=[{"points": ["A", "B"], "along": "rail"}],
    )
    found = build(scene).modes()
    one = np.polymul([m1, c1 + c2, k1 + k2], [m2, c2, k2])
    roots = np.roots(np.polysub(one, np.polymul([c2, k2], [c2, k2])))
    exact = sorted((s for s in roots if s.imag > 0), key=abs)
    assert [mode.s for mode in found.modes] == pytest.approx(exact, rel=1e-11)
    for mode in found.modes:
        s, shape = mode.s, mode.shape
        force = (k2 + c2 * s) * (shape["B"][0] - shape["A"][0])
        assert force == pytest.approx(-m2 * s**2 * shape["B"][0], rel=1e-10)


@pytest.mark.parametrize("count", [4, 16])
def test_a_hanging_chain_tends_to_the_bessel_function(count):
    places = [(0.0, -i / count) for i in range(count + 1)]
    found = build(chain(places, [1 / count] * count)).modes()
    exact = jn_zeros(0, 2) / 2 * np.sqrt(G) / (2 * np.pi)
    error = np.abs(found.frequencies[:2] / exact - 1)
    assert error[0] < 0.1 / count**2 * 4 and error[1] < 2 / count**2
    assert len(found) == count and np.all(np.diff(found.frequencies) > 0)


def test_the_chain_converges_with_the_square_of_its_links():
    exact = jn_zeros(0, 1)[0] / 2 * np.sqrt(G) / (2 * np.pi)
    errors = [
        build(chain([(0.0, -i / n) for i in range(n + 1)], [1 / n] * n)).modes().frequencies[0] / exact - 1
        for n in (4, 8, 16)
    ]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1) and errors[1] / errors[2] == pytest.approx(
        4, rel=0.1
    )


def test_unstable_and_neutral_motions_are_called_so():
    up = build(chain([(0, 0), (0, 1)], [2.0])).modes()
    assert (
        not up.stable and up[0].kind == "unstable" and up[0].s == pytest.approx(np.sqrt(1.5 * G), rel=1e-12)
    )
    free = build(chain([(0, 0), (1, 0)], [1.0], gravity=None)).modes()
    assert [m.kind for m in free.modes] == ["neutral"] and free[0].omega == 0


def test_a_spherical_pendulum_has_two_equal_modes_along_the_axes():
    scene = chain(
        [(0, 0, 0), (0, 0, -1)], [3.0], gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"{-G!r} m/s^2"]}
    )
    found = build(scene).modes()
    assert found.frequencies == pytest.approx([np.sqrt(1.5 * G) / (2 * np.pi)] * 2, rel=1e-12)
    assert found[0].shape["P1"] == pytest.approx([1, 0, 0], abs=1e-12)
    assert found[1].shape["P1"] == pytest.approx([0, 1, 0], abs=1e-12)


def test_four_bar_against_its_potential_over_the_crank_angle():
    """One freedom: omega^2 = V''/m_eff by central differences of closed forms."""
    from shared.linkages import circles

    found = build("four_bar").modes()
    place = found.equilibrium.state.positions["A"]
    theta0 = np.arctan2(place[1], place[0])

    def pose(theta):
        tip = np.array([np.cos(theta), np.sin(theta)])
        return tip, circles(tip, [2.0, 0.0], 1.8, 1.4)

    def potential(theta):
        a, b = pose(theta)
        return G * (a[1] / 2 + 1.8 * (a[1] + b[1]) / 2 + 1.4 * b[1] / 2)

    h = 1e-3
    v = [potential(theta0 + k * h) for k in (-2, -1, 0, 1, 2)]
    curvature = (-v[0] + 16 * v[1] - 30 * v[2] + 16 * v[3] - v[4]) / (12 * h**2)
    a, b = (
        (np.array(p) - np.array(q)) / (2 * h) for p, q in zip(pose(theta0 + h), pose(theta0 - h), strict=True)
    )
    # A uniform rod with end velocities p and q: m (p.p + p.q + q.q)/3 is twice its energy.
    inertia = (a @ a) / 3 + 1.8 * (a @ a + a @ b + b @ b) / 3 + 1.4 * (b @ b) / 3
    assert found[0].omega == pytest.approx(np.sqrt(curvature / inertia), rel=1e-6)


def test_a_run_oscillates_at_the_frequency_found():
    """Released a little off its equilibrium, the triple pendulum repeats the lowest mode."""
    model = build("triple_pendulum")
    modes = model.modes()
    about, shape = modes.equilibrium.state, modes[0].shape
    small = 1e-5
    moved = {p: about.positions[p] + small * shape[p] for p in model.description.free}
    period = 1 / modes[0].frequency
    run = model.simulate(period, state=model.state(moved), rtol=1e-12, samples=5)
    assert run["C.position"].values[-1] == pytest.approx(run["C.position"].values[0], abs=1e-4 * small)
    assert run["C.position"].values[2, 0] == pytest.approx(-run["C.position"].values[0, 0], rel=1e-4)


def test_nothing_oscillates_where_nothing_is_free():
    scene = chain([(0, 0), (1, 0)], [1.0], drivers=[{"link": "L0", "angle": "0"}])
    model = build(scene)
    assert not hasattr(model, "modes")
    with pytest.raises(CapabilityError, match="nothing oscillates"):
        model.modes()
