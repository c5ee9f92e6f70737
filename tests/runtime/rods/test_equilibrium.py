"""Static equilibria against closed forms and an independent minimisation."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.optimize import minimize, root
from shared.in_numpy import build
from shared.linkages import GRAVITY, G, at, chain, four_bar, ground, rod

import symgen
from symgen.errors import CapabilityError, ModelError, SimulationError


def test_a_pendulum_hangs_down_and_stands_only_if_drawn_so():
    model = build(chain([(0, 0), (0.6, 0.3)], [2.0]))
    found = model.equilibrium()
    length = np.hypot(0.6, 0.3)
    assert found.stability == "stable" and found.freedoms == 1
    assert found.state.positions["P1"] == pytest.approx([0, -length], abs=1e-14)
    assert found.reactions["P0"] == pytest.approx([0, 2 * G], abs=1e-13)
    # The multiplier times the length carries the half of the weight that is lumped on the end.
    assert found.multipliers["L0"] * length == pytest.approx(G, rel=1e-13)
    assert found.residual < 1e-14 * found.scale
    up = build(chain([(0, 0), (0, 1)], [2.0])).equilibrium()
    assert up.stability == "unstable" and up.state.positions["P1"] == pytest.approx([0, 1], abs=1e-15)
    near = build(chain([(0, 0), (0.1, 1)], [2.0]))
    assert near.equilibrium(stable=False).stability == "unstable"
    assert near.equilibrium().stability == "stable"


def test_a_spring_scale():
    """A mass on a vertical slider of two rods would hide it: here it hangs on a spring alone."""
    points = {"O": ground(0, 0), "A": at(0.1, -0.7), "B": at(0.1, -0.9)}
    scene = symgen.Scene(
        points=points,
        links={"rod": rod("A", "B", 1.5)},
        springs=[{"between": ["O", "A"], "stiffness": "80 N/m", "length": "0.5 m", "damping": "3 N*s/m"}],
        masses=[{"point": "B", "mass": "0.5 kg"}],
        gravity=GRAVITY,
    )
    found = build(scene).equilibrium()
    stretched = 0.5 + 2 * G / 80
    assert found.state.positions["A"] == pytest.approx([0, -stretched], abs=1e-12)
    assert found.state.positions["B"] == pytest.approx([0, -stretched - 0.2], abs=1e-12)
    assert found.reactions["O"] == pytest.approx([0, 2 * G], abs=1e-11)
    assert found.stability == "stable"


def test_a_catenary_of_rods_against_an_independent_minimisation():
    """Nine rods between two pins: angles that minimise the weight's potential, ends held by a Lagrangian."""
    count, span = 9, 1.4
    lengths = np.linspace(0.15, 0.25, count)
    masses = np.linspace(0.5, 2.0, count)
    x = np.linspace(0, span, count + 1)

    def closure(angles):
        return np.array([lengths @ np.cos(angles) - span, lengths @ np.sin(angles)])

    below = masses / 2 + np.append(
        np.cumsum(masses[::-1])[::-1][1:], 0
    )  # weight carried by each rod's far end

    def balance(unknown):
        angles, force = unknown[:count], unknown[count:]
        return np.append(
            lengths * (-force[0] * np.sin(angles) + (force[1] - G * below) * np.cos(angles)), closure(angles)
        )

    guess = minimize(
        lambda a: G * (below * lengths) @ np.sin(a),
        np.linspace(-1, 1, count),
        constraints={"type": "eq", "fun": closure},
        options={"maxiter": 500, "ftol": 1e-12},
    )
    start = np.append(
        guess.x,
        np.linalg.lstsq(
            np.array([-lengths * np.sin(guess.x), lengths * np.cos(guess.x)]).T,
            G * below * lengths * np.cos(guess.x),
            rcond=None,
        )[0],
    )
    exact = root(balance, start, tol=1e-14).x[:count]
    assert np.max(np.abs(balance(root(balance, start, tol=1e-14).x))) < 1e-12
    points = {
        f"P{i}": (ground if i in (0, count) else at)(
            x[i], -0.4 * np.sin(np.pi * i / count) * (1 + 0.3 * (i % 2))
        )
        for i in range(count + 1)
    }
    points[f"P{count}"] = ground(span, 0)
    links = {
        f"L{i}": rod(f"P{i}", f"P{i + 1}", masses[i].item(), length=f"{lengths[i].item()!r} m")
        for i in range(count)
    }
    found = build(symgen.Scene(points=points, links=links, gravity=GRAVITY)).equilibrium()
    places = np.array([found.state.positions[f"P{i}"] for i in range(count + 1)])
    expected = np.cumsum(np.array([lengths * np.cos(exact), lengths * np.sin(exact)]), axis=1).T
    assert places[1:] == pytest.approx(expected, abs=1e-10)
    assert found.stability == "stable" and found.freedoms == count - 2
    total = found.reactions["P0"] + found.reactions[f"P{count}"]
    assert total == pytest.approx([0, G * masses.sum()], abs=1e-11)


def test_a_spatial_tripod_of_springs():
    """Symmetric: the mass hangs under the middle; its depth solves one equation."""
    anchors = {
        k: (np.cos(a), np.sin(a), 0.0) for k, a in zip("PQR", (0, 2 * np.pi / 3, 4 * np.pi / 3), strict=True)
    }
    scene = symgen.Scene(
        points={
            **{k: ground(*v) for k, v in anchors.items()},
            "M": at(0.2, -0.1, -0.3),
            "N": at(0.2, -0.1, -0.8),
        },
        links={"rod": rod("M", "N", 1.2)},
        springs=[{"between": [k, "M"], "stiffness": "50 N/m", "length": "0.6 m"} for k in anchors],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"{-G!r} m/s^2"]},
    )
    found = build(scene).equilibrium()
    m, n = found.state.positions["M"], found.state.positions["N"]
    assert m[:2] == pytest.approx([0, 0], abs=1e-10) and n - m == pytest.approx([0, 0, -0.5], abs=1e-10)
    length = np.hypot(1, m[2])
    assert 3 * 50 * (length - 0.6) * -m[2] / length == pytest.approx(1.2 * G, rel=1e-11)


def test_a_lever_under_a_torque_without_potential():
    """A motor torque between ground and a pendulum: m g l/2 cos(theta) = torque."""
    scene = chain([(0, 0), (0, -1)], [2.0], torques=[{"link": "L0", "torque": "6 N*m"}])
    found = build(scene).equilibrium()
    assert found.state.positions["P1"][0] == pytest.approx(6 / G, abs=1e-13)
    assert found.stability == "stable"
    heavy = chain([(0, 0), (0, -1)], [2.0], torques=[{"link": "L0", "torque": "10 N*m"}])
    with pytest.raises(SimulationError, match=r"no equilibrium.*P1 by"):
        build(heavy).equilibrium()


def test_an_equilibrium_of_any_kind_is_found_where_a_stable_one_is():
    """Moment -a - sin(4 a)/2 of a light spring: its magnitude is least, 0.614, at a = pi/3, and zero at 0."""
    angle = 1.2
    model = build(
        symgen.Scene(
            points={"O": ground(0, 0), "P": at(np.cos(angle), np.sin(angle))},
            links={"rod": rod("O", "P", 2.0)},
            torsion_springs=[{"link": "rod", "stiffness": "1 N*m"}],
            parameters={"moment": "0.5 N*m"},
            torques=[{"link": "rod", "torque": "-moment*sin(4*rod.angle)"}],
        )
    )
    for stable in (True, False):
        found = model.equilibrium(stable=stable)
        assert found.state.positions["P"] == pytest.approx([1, 0], abs=1e-12)
        assert found.stability == "stable"


def test_held_drives_carry_their_load():
    """A crank held at an angle: reactions and the holding torque by moments."""
    angle = 0.5
    scene = chain(
        [(0, 0), (np.cos(angle), np.sin(angle))],
        [2.0],
        drivers=[{"link": "L0", "angle": f"{angle!r}"}],
        analysis={"outputs": ["L0.torque", "P0.reaction"]},
    )
    found = build(scene).equilibrium()
    assert found.freedoms == 0 and found.stability == "stable"
    assert found.outputs["L0.torque"].item() == pytest.approx(2 * G * np.cos(angle) / 2, rel=1e-13)
    assert found.outputs["P0.reaction"] == pytest.approx([0, 2 * G], abs=1e-12)


def test_a_body_that_nothing_turns_is_neutral():
    scene = chain([(0, 0), (1, 0)], [1.0], gravity=None)
    found = build(scene).equilibrium()
    assert found.stability == "neutral" and found.residual == 0.0


def test_four_bar_against_the_lowest_point_of_its_coupler_curve():
    """One freedom: scan the potential over the crank angle, then polish by golden section."""
    found = build("four_bar").equilibrium()
    a, b, c, d = 1.0, 1.8, 1.4, 2.0
    from shared.linkages import circles

    def potential(theta):
        tip = np.array([a * np.cos(theta), a * np.sin(theta)])
        end = circles(tip, [d, 0.0], b, c)
        return G * (1.0 * tip[1] / 2 + 1.8 * (tip[1] + end[1]) / 2 + 1.4 * end[1] / 2)

    theta = np.arctan2(*found.state.positions["A"][::-1])
    h = 1e-4
    values = [potential(theta + k * h) for k in (-2, -1, 0, 1, 2)]
    slope = (values[0] - 8 * values[1] + 8 * values[3] - values[4]) / (12 * h)
    assert abs(slope) < 1e-9 and values[1] > values[2] < values[3]
    assert found.state.positions["B"] == pytest.approx(
        circles(found.state.positions["A"], [d, 0.0], b, c), abs=1e-13
    )


def test_a_constant_torque_above_all_weights_is_named_as_a_cause():
    """A pendulum of 1 kg and 1 m resists 4.9 N m at most."""
    words = {"points": {"O": ground(0, 0), "A": at(0, -1)}, "links": {"rod": rod("O", "A", 1.0)}}
    motor = symgen.Scene(
        **words, gravity=GRAVITY, torques=[{"link": "rod", "torque": "T"}], parameters={"T": "9 N*m"}
    )
    with pytest.raises(SimulationError, match="There may be none: a constant torque or force") as caught:
        build(motor).equilibrium()
    force, torque = re.search(
        r"at A by (\S+) N, as by a torque of (\S+) N\*m on rod", str(caught.value)
    ).groups()
    assert float(torque) == pytest.approx(float(force), rel=1e-2)
    assert float(torque) > 0.99 * (9 - G / 2)


def test_what_has_no_equilibrium_says_so():
    with pytest.raises(CapabilityError, match="the drive of link crank moves at all times"):
        build("crank_rocker").equilibrium()
    falling = symgen.Scene(
        points={"A": at(0, 0), "B": at(1, 0)}, links={"rod": rod("A", "B")}, gravity=GRAVITY
    )
    with pytest.raises(SimulationError, match="nothing holds the linkage, which is still pushed at [AB] by"):
        build(falling).equilibrium()
    shaken = {"O": ground(0, 0, motion=["d*cos(w*t) - d", "0 m"]), "A": at(0, -1)}
    scene = symgen.Scene(
        parameters={"d": "0.1 m", "w": "2 rad/s"},
        points=shaken,
        links={"rod": rod("O", "A")},
        gravity=GRAVITY,
    )
    with pytest.raises(
        ModelError, match=r"the ground point O accelerates at t = 0 s\n  Omit points.O.motion"
    ):
        build(scene).equilibrium()
    drivers = [{"link": "L0", "angle": "0.3"}, {"link": "L1", "angle": "w*t"}]
    two = chain([(0, 0), (1, 0), (2, 0)], parameters={"w": "2 rad/s"}, drivers=drivers)
    with pytest.raises(CapabilityError, match="the drive of link L1 .*\n.* --set drivers.1.angle="):
        build(two).equilibrium()


@pytest.mark.parametrize(("law", "t", "angle"), [("k*(t - T)**3", 0.3, 0.0), ("a*tanh(t/b)", 0.4, 1.0)])
def test_drives_rest_at_any_time_that_their_law_has(law, t, angle):
    """A crank rests at one instant, or for good long after the end of the run: then its rod hangs down."""
    scene = symgen.Scene(
        parameters={"T": "0.3 s", "k": "1 rad/s**3", "a": "1 rad", "b": "0.015 s"},
        points={"O": ground(0, 0), "A": at(0.1, 0), "B": at(0.3, 0.1)},
        links={"crank": rod("O", "A"), "bar": rod("A", "B")},
        drivers=[{"link": "crank", "angle": law}],
        gravity=GRAVITY,
        analysis={"t_end": "0.2 s"},
    )
    model = build(scene)
    with pytest.raises(ModelError, match="the drive of link crank moves at t = 0.1 s"):
        model.equilibrium(at=0.1)
    found = model.equilibrium(at=t)
    assert found.stability == "stable"
    end = [0.1 * np.cos(angle), 0.1 * np.sin(angle) - np.hypot(0.2, 0.1)]
    assert found.state.positions["B"] == pytest.approx(end, abs=1e-12)


def test_tunable_parameters_move_it_without_compiling_again():
    scene = symgen.Scene(
        parameters={"m": {"value": "2 kg", "tunable": True}},
        points={"O": ground(0, 0), "A": at(0, -1)},
        links={"rod": {"points": ["O", "A"], "mass": "m"}},
        torques=[{"link": "rod", "torque": "6 N*m"}],
        gravity=GRAVITY,
    )
    model = build(scene)
    for mass in (2.0, 3.0):
        found = model.with_parameters(m=mass).equilibrium()
        assert found.state.positions["A"][0] == pytest.approx(12 / (mass * G), abs=1e-13)


def test_kinds_of_analysis_leave_the_equations_of_motion_alone():
    model = build(four_bar(0.5, 0.4, 0.45, 0.6, 0.3))
    before = model.operations
    model.kinematics(0, 0.1, samples=2)
    assert model.operations == before and "stiffness" not in before


def test_peaucellier_against_the_bottom_of_its_potential_well():
    """The minimum found with the crank angle as the only coordinate: 0.308868448299 rad off the symmetric pose."""
    found = build("peaucellier").equilibrium()
    a = found.state.positions["A"]
    assert np.pi - abs(np.arctan2(a[1], a[0])) == pytest.approx(0.308868448299, abs=1e-12)
    assert found.outputs["energy"].item() == pytest.approx(-4.039793e-4, abs=5e-11)
    assert found.stability == "stable"
    assert found.reactions["O"] + found.reactions["E"] == pytest.approx(
        [0, G * 1.0 * total_length()], abs=1e-12
    )


def total_length():
    return 0.02 + 4 * np.hypot(0.04, 0.04) + 2 * 0.04


def test_the_pose_to_start_from_is_assembled_first():
    model = build("four_bar")
    rough = {p: model.initial_state().positions[p] + [0.02, -0.01] for p in "AB"}
    found = model.equilibrium(state=model.state(rough))
    assert found.state.positions["B"] == pytest.approx(model.equilibrium().state.positions["B"], abs=1e-12)
    with pytest.raises(SimulationError, match="cannot be assembled|no equilibrium"):
        model.equilibrium(state=model.state({"A": [0, 0], "B": [2, 0]}))
