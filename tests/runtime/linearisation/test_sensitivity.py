"""Derivatives by parameters against closed forms and minimal equations that are differentiated at 40 digits."""

from __future__ import annotations

import json
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from shared.commands import call
from shared.controlled import CART_POLE, cart_pole
from shared.in_numpy import build
from shared.linkages import GRAVITY, G, at, circles, ground, rod
from shared.slopes import slopes

import symgen
from symgen.errors import ModelError, SimulationError

g = mp.mpf(G)


def driven_four_bar(drivers=({"link": "crank", "angle": "1 + w*t"},), **values):
    """A four-bar linkage with all its sizes tunable, the crank driven at w from 1 rad."""
    a = np.array([values["a"] * np.cos(1.0), values["a"] * np.sin(1.0)])
    b = circles(a, [values["d"], 0.0], values["b"], values["c"])
    units = {"w": "rad/s", "rho": "kg/m"}
    tunable = {k: {"value": f"{v!r} {units.get(k, 'm')}", "tunable": True} for k, v in values.items()}
    ends = {"crank": ("O", "A", "a"), "coupler": ("A", "B", "b"), "rocker": ("C", "B", "c")}
    return symgen.Scene(
        parameters=tunable,
        points={"O": ground(0, 0), "A": at(*a), "B": at(*b), "C": {"at": ["d", 0], "ground": True}},
        links={
            name: {"points": [start, end], "mass": f"rho*{size}", "length": size}
            for name, (start, end, size) in ends.items()
        },
        drivers=list(drivers),
        gravity=GRAVITY,
    )


def of_driven_four_bar(t):
    """Return place, velocity and acceleration of B, the rocker's angle and the drive's torque at a time."""

    def outputs(a, b, c, d, w, rho):
        def pose(f):
            ax, ay = a * mp.cos(f), a * mp.sin(f)
            dx, dy = d - ax, -ay
            distance = mp.sqrt(dx**2 + dy**2)
            along = (b**2 - c**2 + distance**2) / (2 * distance)
            across = mp.sqrt(b**2 - along**2)
            return (
                ax,
                ay,
                ax + (dx * along - dy * across) / distance,
                ay + (dy * along + dx * across) / distance,
            )

        def mass(f):
            vax, vay, vbx, vby = (mp.diff(lambda s, i=i: pose(s)[i], f) for i in range(4))
            coupler = vax**2 + vay**2 + vbx**2 + vby**2 + vax * vbx + vay * vby
            return rho * (a * (vax**2 + vay**2) + b * coupler + c * (vbx**2 + vby**2)) / 3

        def potential(f):
            _, ay, _, by = pose(f)
            return rho * g * (a * ay + b * (ay + by) + c * by) / 2

        f = 1 + w * mp.mpf(t)
        _, _, bx, by = pose(f)
        with mp.workdps(90):
            first = [w * mp.diff(lambda s, i=i: pose(s)[i], f) for i in (2, 3)]
            second = [w**2 * mp.diff(lambda s, i=i: pose(s)[i], f, 2) for i in (2, 3)]
            torque = mp.diff(mass, f) * w**2 / 2 + mp.diff(potential, f)
        return [bx, by, *first, *second, mp.atan2(by, bx - d), torque]

    return outputs


def test_a_driven_four_bar_has_the_derivatives_of_its_closed_form():
    values = {"a": 0.3, "b": 0.8, "c": 0.6, "d": 0.9, "w": 2.5, "rho": 1.7}
    model = build(driven_four_bar(**values))
    outputs = ["B.position", "B.velocity", "B.acceleration", "rocker.angle", "crank.torque"]
    found = model.sensitivity(outputs, at=0.3)
    assert found.parameters == tuple(values) and found.outputs[0] == "B.position.x"
    expected = slopes(of_driven_four_bar(0.3), values.values())
    assert found.derivatives == pytest.approx(expected, rel=1e-9, abs=1e-10 * np.max(np.abs(expected)))
    along = model.sensitivity(outputs, t_eval=[0.1, 0.3], rtol=1e-12)
    assert along.derivatives[1] == pytest.approx(expected, rel=1e-9, abs=1e-10 * np.max(np.abs(expected)))
    two = model.sensitivity(["crank.torque"], ["rho", "b"], at=0.3)
    assert two["crank.torque", "b"] == found["crank.torque", "b"] and two.units["rho"] == "kg/m"
    first, heading, row = repr(two).splitlines()
    assert first == "<Sensitivity at t = 0.3 s>" and heading.split() == [
        "by",
        "rho",
        "[kg/m]",
        "by",
        "b",
        "[m]",
    ]
    assert row.split() == ["crank.torque", "[N*m]", *(f"{x:.6g}" for x in two.derivatives[0])]
    # The torque is proportional to the masses.
    assert two["crank.torque", "rho"] == pytest.approx(two.values[0] / 1.7, rel=1e-11)
    at_start = model.sensitivity(["B.position"])
    assert at_start.derivatives == pytest.approx(slopes(of_driven_four_bar(0), values.values())[:2], rel=1e-9)


def test_an_equilibrium_moves_as_its_balance_demands():
    """A rod on a spring from its tip: m g l cos/2 + k (s - s0) ds = 0, by mass, stiffness and both lengths."""
    values = {"m": 1.3, "k": 150.0, "l": 0.6, "free": 0.5}
    units = {"m": "kg", "k": "N/m"}
    scene = symgen.Scene(
        parameters={k: {"value": f"{v!r} {units.get(k, 'm')}", "tunable": True} for k, v in values.items()},
        inputs={"T": "0.4 N*m"},
        points={"O": ground(0, 0), "P": at(0.6, 0), "Q": ground(0.5, 0.8)},
        links={"OP": {"points": ["O", "P"], "mass": "m", "length": "l"}},
        springs=[{"between": ["P", "Q"], "stiffness": "k", "length": "free"}],
        torques=[{"link": "OP", "torque": "T"}],
        gravity=GRAVITY,
    )
    model = build(scene)
    equilibrium = model.equilibrium()
    start = mp.mpf(float(np.arctan2(*equilibrium.state.positions["P"][::-1])))

    def outputs(m, k, length, free, torque):
        def balance(angle):
            px, py = length * mp.cos(angle), length * mp.sin(angle)
            s = mp.sqrt((px - 0.5) ** 2 + (py - mp.mpf(0.8)) ** 2)
            pull = k * (s - free) / s
            fx, fy = pull * (mp.mpf(0.5) - px), pull * (mp.mpf(0.8) - py)
            return px, py, fx, fy, px * fy - py * fx - m * g * px / 2 + torque

        angle = mp.findroot(lambda x: balance(x)[4], start)
        px, py, fx, fy, _ = balance(angle)
        return [angle, px, py, -fx, m * g - fy]

    found = model.sensitivity(["OP.angle", "P.position", "O.reaction"], at=equilibrium)
    assert found.parameters == (*values, "T")
    expected = slopes(outputs, [*values.values(), 0.4])
    assert found.derivatives == pytest.approx(expected, rel=1e-9, abs=1e-10)


def test_at_a_state_coordinates_and_their_rates_are_held():
    """The cart of a cart-pole brakes by c: with c v as its only part of F, by -v times the force's effect."""
    model = build(CART_POLE)
    y, _ = cart_pole(model, 0.3, 0.7, -0.4, 2.0)
    state = model.state({"C": y[:2], "P": y[2:4]}, {"C": y[4:6], "P": y[6:]})
    held = ["C.position.x", "pole.angle"]
    outputs = ["C.acceleration.x", "pole.angle''", "P.position", "P.velocity"]
    found = model.sensitivity(outputs, at=state, coordinates=held)
    direct = model.linearise(state, outputs=outputs, coordinates=held)
    mass = model.mass_matrix(state, coordinates=held)
    by_force = np.linalg.solve(mass, [1.0, 0.0])
    assert found.derivatives[:2] == pytest.approx(
        np.column_stack([0.4 * by_force, by_force, np.linalg.solve(mass, [0.0, -1.0])]), rel=1e-10
    )
    assert found.derivatives[:, 1:] == pytest.approx(direct.D, rel=1e-12, abs=1e-12)
    assert not np.any(np.abs(found.derivatives[2:]) > 1e-15)


def test_what_cannot_be_differentiated_is_named():
    model = build(CART_POLE)
    with pytest.raises(ModelError, match="no tunable parameter 'd'"):
        model.sensitivity(["energy"], ["d"], coordinates=["C.position.x", "pole.angle"])
    with pytest.raises(ModelError, match="expected 2 independent coordinates"):
        model.sensitivity(["energy"])
    with pytest.raises(ModelError, match=r"no tunable parameters(.|\n)*tunable = true"):
        build("andrews_squeezer").sensitivity(["energy"], coordinates=["K1.angle"])
    with pytest.raises(
        ModelError, match=r"neutral: no force determines C\.position\.x(.|\n)*equilibrium\.state"
    ):
        model.sensitivity(["energy"], at=model.equilibrium())
    with pytest.raises(ModelError, match=r"drives alone do not determine the motion(.|\n)*t_end"):
        model.sensitivity(["energy"], at=0.5)


def three_cranks(a="a", gx="gx", ex="2 m", rate="2 rad/s", **parameters):
    """Three parallel vertical cranks of lengths b, b and a, on ground points A, D and G."""
    values = {"a": "1 m", "b": "1 m", "gx": "2 m"} | parameters
    return build(
        symgen.Scene(
            parameters={k: {"value": v, "tunable": True} for k, v in values.items()},
            points={"A": ground(0, 0), "D": ground(1, 0), "G": {"at": [gx, 0], "ground": True}}
            | {"B": at(0, 1), "C": at(1, 1), "E": {"at": [ex, "1 m"]}},
            links={
                "AB": {"points": ["A", "B"], "mass": "1 kg", "length": "b"},
                "BE": {
                    "points": ["B", "C", "E"],
                    "mass": "1 kg",
                    "centre": ["1 m", "1 m"],
                    "inertia": "1 kg*m^2",
                },
                "DC": {"points": ["D", "C"], "mass": "1 kg", "length": "b"},
                "GE": {"points": ["G", "E"], "mass": "1 kg", "length": a},
            },
            start={"rates": {"AB": rate}},
            gravity=GRAVITY,
            analysis={"assembly_tolerance": "2e-6 m"},
        )
    )


@pytest.mark.parametrize("rate", ["2 rad/s", "0 rad/s"])
@pytest.mark.parametrize("along", [{}, {"t_eval": [0.1]}])
def test_a_parameter_that_contradicts_redundant_constraints_is_refused(rate, along):
    """Moving G keeps the constraints of vertical cranks to first order, but these cannot move then."""
    model = three_cranks(rate=rate)
    assert model.redundant
    for name in ("a", "gx"):
        with pytest.raises(
            ModelError, match=f"a change of {name} alone contradicts the redundant constraints"
        ):
            model.sensitivity(["energy"], [name], coordinates=["DC.angle"], **along)


def test_parameters_that_keep_constraints_redundant_have_derivatives():
    """Cranks of a common length b, and G moved with E: the coupler moves as on two cranks."""
    model = three_cranks(a="b", ex="gx")
    outputs = ["E.position", "E.velocity", "AB.angle''"]
    found = model.sensitivity(outputs, ["b", "gx"], coordinates=["AB.angle"])
    # At rest upright no force turns the cranks, of any length.
    expected = [[0, 1], [1, 0], [-2, 0], [0, 0], [0, 0]]
    assert found.derivatives == pytest.approx(np.array(expected, dtype=float), abs=1e-12)
    later = model.sensitivity(outputs[:1], ["gx"], coordinates=["AB.angle"], t_eval=[0.1])
    assert later.derivatives[0] == pytest.approx(np.array([[1.0], [0.0]]), abs=1e-11)


def test_redundant_constraints_that_the_ground_moves_have_derivatives():
    """A trammel with a crank to the middle of its rod: the ground takes its guides along, in a straight line."""
    moved = {"motion": ["a*sin(w*t)", "a*sin(w*t)/2"]}
    points = {"O": ground(0, 0, **moved), "X": ground(3, 0, **moved), "Y": ground(0, 3, **moved)}
    points |= {"A": at(1.2, 0), "B": at(0, 1.6), "M": {"on": "rod", "fraction": "1/2"}}
    links = {"along": {"points": ["O", "X"]}, "across": {"points": ["O", "Y"]}}
    links |= {"rod": rod("A", "B"), "crank": rod("O", "M")}

    def trammel(a):
        return build(
            symgen.Scene(
                parameters={"a": {"value": f"{a!r} m", "tunable": True}, "w": "2 rad/s"},
                points=points,
                links=links,
                guides=[{"points": ["A"], "along": "along"}, {"points": ["B"], "along": "across"}],
                start={"rates": {"rod": "0 rad/s"}},
                gravity=GRAVITY,
            )
        )

    def end(a):
        return trammel(a).simulate(0.3, samples=2, rtol=1e-11).variable("A.position").values[-1, 0]

    model = trammel(0.3)
    assert model.redundant
    outputs = ["B.position.x", "A.position.y", "A.position.x"]
    found = model.sensitivity(outputs, ["a"], coordinates=["rod.angle"], t_end=0.3, rtol=1e-11)
    expected = [np.sin(0.6), np.sin(0.6) / 2, (end(0.301) - end(0.299)) / 0.002]
    assert found.derivatives[-1, :, 0] == pytest.approx(expected, rel=1e-6)


def test_redundant_constraints_with_a_gap_are_named():
    model = three_cranks(a="b + gap", ex="gx", gap="1e-6 m")
    with pytest.raises(
        ModelError, match="meets its redundant constraints only to .* for a change of b alone"
    ):
        model.sensitivity(["E.position"], ["b"], coordinates=["AB.angle"])


def test_frequencies_have_the_derivatives_of_their_closed_forms():
    """Two masses on springs along a rail: det(K - w^2 M) = 0; then a damped pendulum with a moving rest."""
    values = {"k": 120.0, "m": 1.5, "n": 0.7, "l": 0.4}
    units = {"k": "N/m", "m": "kg", "n": "kg", "l": "m"}
    tunable = {k: {"value": f"{v!r} {units[k]}", "tunable": True} for k, v in values.items()}
    scene = symgen.Scene(
        parameters=tunable,
        points={"A": ground(0, 0), "B": ground(3, 0), "P": at(1.1, 0), "Q": at(2.0, 0)},
        links={"rail": {"points": ["A", "B"]}},
        masses=[{"point": "P", "mass": "m"}, {"point": "Q", "mass": "n"}],
        guides=[{"points": ["P", "Q"], "along": "rail"}],
        springs=[
            {"between": ["A", "P"], "stiffness": "k", "length": "l"},
            {"between": ["P", "Q"], "stiffness": "2*k", "length": "l"},
            {"between": ["Q", "B"], "stiffness": "k", "length": "l"},
        ],
    )
    model = build(scene)
    equilibrium = model.equilibrium()

    def outputs(k, m, n, length):
        # det [[3k - x m, -2k], [-2k, 3k - x n]] = 0 for x = w^2
        half, product = 3 * k * (m + n) / (2 * m * n), 5 * k**2 / (m * n)
        root = mp.sqrt(half**2 - product)
        return [mp.sqrt(x) / (2 * mp.pi) for x in (half - root, half + root)]

    found = model.sensitivity(["frequencies"], at=equilibrium)
    assert found.outputs == ("frequency.1", "frequency.2") and found.units["frequency.1"] == "Hz"
    assert found.values == pytest.approx(model.modes(equilibrium).frequencies, rel=1e-12)
    assert found.derivatives == pytest.approx(slopes(outputs, values.values()), rel=1e-9, abs=1e-11)


def test_a_frequency_follows_the_pose_of_its_equilibrium():
    """A rod on a spring from its tip with damping: its rest, and with it stiffness and damping, move."""
    values = {"m": 1.3, "k": 150.0, "l": 0.6, "free": 0.5, "c": 4.0}
    units = {"m": "kg", "k": "N/m", "c": "N*s/m"}
    model = build(
        symgen.Scene(
            parameters={
                k: {"value": f"{v!r} {units.get(k, 'm')}", "tunable": True} for k, v in values.items()
            },
            points={"O": ground(0, 0), "P": at(0.6, 0), "Q": ground(0.5, 0.8)},
            links={"OP": {"points": ["O", "P"], "mass": "m", "length": "l"}},
            springs=[{"between": ["P", "Q"], "stiffness": "k", "length": "free", "damping": "c"}],
            gravity=GRAVITY,
        )
    )
    equilibrium = model.equilibrium()
    start = mp.mpf(float(np.arctan2(*equilibrium.state.positions["P"][::-1])))

    def outputs(m, k, length, free, c):
        def stretched(angle):
            return mp.sqrt((length * mp.cos(angle) - 0.5) ** 2 + (length * mp.sin(angle) - mp.mpf(0.8)) ** 2)

        def force(angle):
            with mp.workdps(90):
                slope = mp.diff(stretched, angle)
            return -k * (stretched(angle) - free) * slope - m * g * length * mp.cos(angle) / 2

        angle = mp.findroot(force, start)
        with mp.workdps(60):
            stiffness, damping = -mp.diff(force, angle), c * mp.diff(stretched, angle) ** 2
        inertia = m * length**2 / 3
        decay = damping / (2 * inertia)
        root = mp.sqrt(stiffness / inertia - decay**2)
        return [root / (2 * mp.pi), -decay, root]

    found = model.sensitivity(["OP.angle", "frequencies", "poles"], at=equilibrium)
    assert found.outputs == ("OP.angle", "frequency.1", "pole.1.real", "pole.1.imag")
    assert [found.units[x] for x in found.outputs[1:]] == ["Hz", "1/s", "rad/s"]
    assert found.derivatives[1:] == pytest.approx(slopes(outputs, values.values()), rel=1e-9)
    with pytest.raises(ModelError, match="frequencies belong to an equilibrium"):
        model.sensitivity(["frequencies"], coordinates=["OP.angle"])


def test_real_poles_have_the_derivatives_of_their_closed_forms():
    """A damped inverted pendulum: s^2 + b s - 3 g/(2 l) = 0 with b = 3 c/(m l^2) has a growing root."""
    values = {"l": 0.6, "m": 0.3, "c": 0.5}
    units = {"l": "m", "m": "kg", "c": "N*m*s"}
    model = build(
        symgen.Scene(
            parameters={k: {"value": f"{v!r} {units[k]}", "tunable": True} for k, v in values.items()},
            points={"O": ground(0, 0), "P": at(0, 0.6)},
            links={"OP": {"points": ["O", "P"], "mass": "m", "length": "l"}},
            torques=[{"link": "OP", "torque": "-c*OP.rate"}],
            gravity=GRAVITY,
        )
    )
    equilibrium = model.equilibrium(stable=False)

    def outputs(length, m, c):
        half = 3 * c / (2 * m * length**2)
        root = mp.sqrt(half**2 + 3 * g / (2 * length))
        return [root - half, -root - half]

    found = model.sensitivity(["poles"], at=equilibrium)
    assert found.outputs == ("pole.1.real", "pole.2.real")
    assert found.values == pytest.approx([float(x) for x in outputs(*values.values())], rel=1e-12)
    assert found.derivatives == pytest.approx(slopes(outputs, values.values()), rel=1e-9)
    with pytest.raises(ModelError, match=r"no mode of .* oscillates(.|\n)*Give poles"):
        model.sensitivity(["frequencies"], at=equilibrium)
    with pytest.raises(ModelError, match=r"no output 'damping_ratio'\n.*modes\(\)"):
        model.sensitivity(["damping_ratio"], at=equilibrium)


def test_the_command_prints_what_python_returns():
    """Reactions to weights alone are proportional to the mass per length."""
    arguments = ["sensitivity", "peaucellier", "--at", "equilibrium", "--outputs", "O.reaction"]
    printed = json.loads(call(*arguments, "--json"))
    model = build("peaucellier")
    found = model.sensitivity(["O.reaction"], at=model.equilibrium())
    assert printed["parameters"] == {"rho": "kg/m"}
    for name, entry in printed["outputs"].items():
        assert entry["unit"] == "N" and entry["value"] == found.values[found.outputs.index(name)]
        assert entry["by"] == {"rho": found[name, "rho"]}
        assert entry["by"]["rho"] == pytest.approx(entry["value"] / 1.0, rel=1e-9, abs=1e-9)
    assert "by rho [kg/m]" in call(*arguments)


def test_a_torque_by_a_length_that_is_drawn_as_a_root():
    """The crank is sqrt(r^2) long: the gravity torque of an even crank at rest is m g r cos(theta) / 2."""
    scene = symgen.Scene(
        parameters={"r": {"value": "0.3 m", "tunable": True}, "w": "0 rad/s"},
        points={"O": ground(0, 0), "A": {"at": ["r", "0 m"]}},
        links={"crank": {"points": ["O", "A"], "mass": "2 kg"}},
        drivers=[{"link": "crank", "angle": "w*t"}],
        gravity=GRAVITY,
    )
    found = build(scene).sensitivity(["crank.torque"], ["r"], at=0.0)
    assert found.values == pytest.approx([2 * G * 0.3 / 2], rel=1e-12)
    assert found.derivatives == pytest.approx(np.array([[2 * G / 2]]), rel=1e-11)


def test_a_dead_centre_has_no_derivatives():
    model = build(driven_four_bar((), a=0.3, b=0.8, c=0.6, d=0.9, w=2.5, rho=1.7))
    in_line = model.state({"A": [0.3, 0.0], "B": [1.1, 0.0]})
    with pytest.raises(ModelError, match="lose rank at this state, at t = 0 s: it is at a dead centre"):
        model.sensitivity(["B.position"], at=replace(model.equilibrium(), state=in_line))


def test_a_derivative_that_is_not_finite_is_named():
    """The slope of a root at zero."""
    values = {"s": "1 N*m", "T": "0 N*m"}
    model = build(
        symgen.Scene(
            parameters={k: {"value": v, "tunable": True} for k, v in values.items()},
            points={"O": ground(0, 0), "P": at(1, 0)},
            links={"rod": {"points": ["O", "P"], "mass": "1 kg"}},
            torques=[{"link": "rod", "torque": "s*sqrt(T/s)"}],
        )
    )
    with pytest.raises(
        SimulationError, match=r"derivative of P\.acceleration\.. by T is not finite at t = 0 s"
    ):
        model.sensitivity(["P.acceleration"], ["T"], coordinates=["rod.angle"])
