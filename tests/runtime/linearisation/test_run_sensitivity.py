"""Derivatives along runs against closed forms of the motion that are differentiated at 40 digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from shared.in_numpy import build
from shared.linkages import GRAVITY, G, at, ground
from shared.slopes import slopes

import symgen
from symgen.errors import ModelError, SimulationError

ROD = {"m": (1.3, "kg"), "l": (0.6, "m")}


def rod(angle, torques=(), more=None, **fields):
    """A rod on a bearing, drawn at an angle, with torques that use tunable parameters."""
    values = {**ROD, **(more or {})}
    return symgen.Scene(
        parameters={
            name: {"value": f"{value!r} {unit}", "tunable": True} for name, (value, unit) in values.items()
        },
        torques=[{"link": "rod", "torque": torque} for torque in torques],
        links={"rod": {"points": ["O", "P"], "mass": "m", "length": "l"}},
        **{"points": {"O": ground(0, 0), "P": at(0.6 * np.cos(angle), 0.6 * np.sin(angle))}} | fields,
    )


def started(model, rate):
    """The start of the rod with a rate."""
    p = model.initial_state().positions["P"]
    return model.state({"P": p}, {"P": [-rate * p[1], rate * p[0]]})


def agrees(found, expected, rel=1e-9):
    expected = np.asarray(expected, dtype=float)
    assert found == pytest.approx(expected, rel=rel, abs=0.1 * rel * np.max(np.abs(expected)))


DAMPED = {"c": (0.08, "N*m*s"), "T": (0.3, "N*m")}


def damped(t):
    """Angle, place and reaction along the rod, and the integral of the rate, after a time, with c and T above."""

    def outputs(m, l, c, T, start, rate):
        inertia = m * l**2 / 3
        w = T / c + (rate - T / c) * mp.exp(-c * t / inertia)
        turned = T / c * t + (rate - T / c) * inertia / c * (1 - mp.exp(-c * t / inertia))
        f, a = start + turned, (T - c * w) / inertia
        ax = -m * l / 2 * (w**2 * mp.cos(f) + a * mp.sin(f))
        return [f, l * mp.cos(f), l * mp.sin(f), ax, turned]

    return outputs


@pytest.mark.parametrize(
    ("options", "rel"),
    [({"rtol": 1e-12}, 1e-9), ({"rtol": 1e-12, "method": "taylor"}, 1e-9), ({"step": 1e-3}, 1e-8)],
)
def test_a_driven_rotor_has_the_derivatives_of_its_closed_form(options, rel):
    model = symgen.build(rod(0.4, ["T - c*rod.rate"], DAMPED))
    names, times = ["rod.angle", "P.position", "O.reaction.x"], [0.7, 2.0]
    found = model.sensitivity(
        names,
        at=started(model, 2.0),
        coordinates=["rod.angle"],
        t_eval=times,
        integrals=["rod.angle'"],
        **options,
    )
    assert found.parameters == ("m", "l", "c", "T", "rod.angle", "rod.angle'")
    assert found.outputs[-1] == "integral of rod.angle'" and found.units[found.outputs[-1]] == "rad/s*s"
    values = [1.3, 0.6, 0.08, 0.3, 0.4, 2.0]
    for i, t in enumerate(times):
        expected = slopes(damped(t), values)
        scale = np.max(np.abs(expected), axis=1)[:, None]
        assert np.max(np.abs(found.derivatives[i] - expected) / scale) < rel
        agrees(found.values[i, 1:], [float(x) for x in damped(t)(*map(mp.mpf, values))][1:], rel)
    assert found["rod.angle", "T"] == pytest.approx(found.derivatives[:, 0, 3], rel=0)


def parallelogram(t):
    """Angle of the crank, end of the rocker and integral of the rate of a parallelogram under T - c rate.

    The coupler does not turn, so that all moves like one rotor with the coupler's mass at its rim.
    """

    def outputs(m1, m2, m3, a, c, T, start, rate):
        inertia = (m1 + m3) * a**2 / 3 + m2 * a**2
        turned = T / c * t + (rate - T / c) * inertia / c * (1 - mp.exp(-c * t / inertia))
        f = start + turned
        return [f, 1 + a * mp.cos(f), a * mp.sin(f), turned]

    return outputs


@pytest.mark.parametrize(
    ("options", "rel"),
    [
        ({"method": "radau5", "rtol": 1e-11, "atol": 1e-13}, 1e-9),
        ({"method": "newmark", "step": 1e-3}, 2e-5),
        ({"method": "generalized-alpha", "step": 1e-3}, 2e-5),
    ],
)
def test_implicit_steps_have_the_derivatives_of_the_closed_form(options, rel):
    """Within the error of the method, which of fixed steps falls with the square of the step."""
    model, times = symgen.build(rod(0.4, ["T - c*rod.rate"], DAMPED)), [0.3, 0.7]
    names, values = ["rod.angle", "P.position", "O.reaction.x"], [1.3, 0.6, 0.08, 0.3, 0.4, 2.0]

    def away(**how):
        found = model.sensitivity(
            names, at=started(model, 2.0), coordinates=["rod.angle"], t_eval=times, **how
        )
        rows = [slopes(damped(t), values)[:4] for t in times]
        sizes = [np.max(np.abs(row), axis=1)[:, None] for row in rows]
        return max(
            float(np.max(np.abs(of - row) / size))
            for of, row, size in zip(found.derivatives, rows, sizes, strict=True)
        )

    found = away(**options)
    assert found <= rel
    if "step" in options:
        assert away(**options | {"step": 2e-3}) == pytest.approx(4 * found, rel=0.2)


def test_an_end_that_depends_on_a_parameter_is_held():
    """With t_end = pi/w at the rate w the rod ends opposite its start: t drate + rate dt_end = 0."""
    more = {"w": (2.0, "rad/s")}
    scene = rod(0.4, (), more, start={"rates": {"rod": "w"}}, analysis={"t_end": "pi/w"})
    run = symgen.build(scene).simulate(rtol=1e-12)
    names = ["P.position.x", "P.position.y"]
    held = run.gradient(names, ["rod.angle'"], coordinates=["rod.angle"])
    end = 0.4 + np.pi
    assert held.t == pytest.approx(np.pi / 2)
    agrees(held.derivatives[0, :, 0], np.pi / 2 * 0.6 * np.array([-np.sin(end), np.cos(end)]))
    velocity = np.array(run.final["P"]["velocity"])
    assert held.derivatives[0, :, 0] + velocity * (-np.pi / 2.0**2) == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("method", ["dop853", "taylor"])
@pytest.mark.parametrize("many", [0, 30])
def test_a_closed_linkage_has_the_derivatives_of_its_closed_form(many, method):
    """Three lengths hold four coordinates; ``many`` further torques are taken back along the steps."""
    values = {"m1": (1.3, "kg"), "m2": (0.7, "kg"), "m3": (0.9, "kg"), "a": (0.6, "m"), **DAMPED}
    more = {f"T{i}": (0.001, "N*m") for i in range(many)}
    values["T"] = (0.3 - 0.001 * many, "N*m")
    end = 0.6 * np.cos(0.4), 0.6 * np.sin(0.4)
    scene = symgen.Scene(
        parameters={n: {"value": f"{v!r} {u}", "tunable": True} for n, (v, u) in {**values, **more}.items()},
        points={"O": ground(0, 0), "A": at(*end), "B": at(1 + end[0], end[1]), "C": ground(1, 0)},
        links={
            "crank": {"points": ["O", "A"], "mass": "m1", "length": "a"},
            "coupler": {"points": ["A", "B"], "mass": "m2"},
            "rocker": {"points": ["C", "B"], "mass": "m3", "length": "a"},
        },
        torques=[{"link": "crank", "torque": " + ".join(["T - c*crank.rate", *more])}],
    )
    model = symgen.build(scene)
    p = model.initial_state().positions
    velocity = [-2.0 * p["A"][1], 2.0 * p["A"][0]]
    found = model.sensitivity(
        ["crank.angle", "B.position"],
        at=model.state({"A": p["A"], "B": p["B"]}, {"A": velocity, "B": velocity}),
        coordinates=["crank.angle"],
        t_end=0.8,
        integrals=["crank.angle'"],
        rtol=1e-12,
        method=method,
    )
    slope = slopes(parallelogram(0.8), [1.3, 0.7, 0.9, 0.6, 0.08, 0.3, 0.4, 2.0])
    expected = np.hstack([slope[:, :6], np.repeat(slope[:, 5:6], many, axis=1), slope[:, 6:]])
    assert np.max(np.abs(found.derivatives[0] - expected) / np.max(np.abs(expected), axis=1)[:, None]) < 1e-8


def test_few_outputs_have_the_same_derivatives_by_many_parameters():
    """Derivatives by so many torques are taken back along the steps: the transposed equations."""
    many = {f"T{i}": (0.001 * (i + 1), "N*m") for i in range(28)} | {"c": (0.08, "N*m*s")}
    torques = ["-c*rod.rate", *(f"T{i}*{1 + i % 3}" for i in range(28))]
    model = build(rod(0.4, torques, many))
    whole = float(sum(0.001 * (i + 1) * (1 + i % 3) for i in range(28)))
    found = model.sensitivity(
        ["rod.angle", "P.position.y", "O.reaction.x"],
        at=started(model, 2.0),
        coordinates=["rod.angle"],
        t_end=0.9,
        integrals=["rod.angle'"],
        rtol=1e-12,
    )
    assert found.derivatives.shape == (1, 4, 33)
    by_whole = slopes(damped(0.9), [1.3, 0.6, 0.08, whole, 0.4, 2.0])
    for k, row in enumerate((0, 2, 3, 4)):
        m, l, c, T, start, rate = by_whole[row]
        agrees(found.derivatives[0, k], [m, l, *(T * (1 + i % 3) for i in range(28)), c, start, rate])
    turned = damped(0.9)(1.3, 0.6, 0.08, whole, 0.4, 2.0)[4]
    assert found.values[0, 3] == pytest.approx(float(turned), rel=1e-10)


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_a_pendulum_has_the_derivatives_of_its_elliptic_function(method):
    """sin(f/2) = k cd(w t, k), f the angle from the vertical and w^2 = 3 g/(2 l), released from rest."""

    def outputs(l, start):
        k = mp.sin((start + mp.pi / 2) / 2)
        found = k * mp.ellipfun("cd", mp.sqrt(3 * mp.mpf(G) / (2 * l)) * mp.mpf("1.5"), k=k)
        return [2 * mp.asin(found) - mp.pi / 2]

    model = symgen.build(rod(0.2, gravity=GRAVITY))
    how = {"t_end": 1.5, "rtol": 1e-12, "method": method}
    found = model.sensitivity(["rod.angle"], coordinates=["rod.angle"], **how)
    m, *rest, _ = found.derivatives[0, 0]
    agrees(rest, slopes(outputs, [0.6, 0.2])[0])
    assert abs(m) < 1e-9


@pytest.mark.parametrize("method", ["dop853", "dopri5", "taylor", "radau5"])
def test_motions_about_rest_are_resolved(method):
    """Of a rod that hangs at rest, with steps as long as the run: w^2 = 3 g/(2 l)."""
    scene = symgen.Scene(
        points={"O": ground(0, 0), "P": at(0, -0.6)},
        links={"rod": {"points": ["O", "P"], "mass": "1 kg"}},
        gravity=GRAVITY,
    )
    model, t, w = symgen.build(scene), 3.0, np.sqrt(1.5 * G / 0.6)
    how = {"coordinates": ["rod.angle"], "t_end": t, "rtol": 1e-12, "method": method}
    found = model.sensitivity(["rod.angle", "P.velocity.x"], ["rod.angle", "rod.angle'"], **how)
    turned = np.array([np.cos(w * t), np.sin(w * t) / w])
    rate = 0.6 * np.array([-w * np.sin(w * t), np.cos(w * t)])
    assert found.derivatives[0] == pytest.approx(np.array([turned, rate]), abs=1e-9)
    with pytest.raises(SimulationError, match="max_steps"):
        model.sensitivity(["rod.angle"], **how, max_steps=20)


def test_steps_are_not_halved_for_derivatives_that_chaos_leaves_undetermined():
    """Three rods after 8 s, when tolerances of 1e-6 leave no digit of states and derivatives."""
    angles = ["OA.angle", "AB.angle", "BC.angle"]
    how = {"coordinates": angles, "t_end": 8.0, "method": "radau5", "rtol": 1e-6, "max_steps": 10_000}
    found = symgen.build("triple_pendulum").sensitivity(["C.position.x"], **how)
    assert np.linalg.norm(found.derivatives) > 1e8


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_angles_in_loads_go_on_over_revolutions(method):
    """A torsion spring that is wound up by more than a revolution: a harmonic motion of the angle."""

    def outputs(m, l, k, start, rate):
        w, t = mp.sqrt(3 * k / m) / l, mp.mpf("1.3")
        return [start * mp.cos(w * t) + rate / w * mp.sin(w * t), -k * rate / w * mp.sin(w * t)]

    model = symgen.build(rod(0.0, ["-k*rod.angle"], {"k": (0.2, "N*m")}))
    how = {"t_end": 1.3, "rtol": 1e-12, "method": method}
    found = model.sensitivity(["rod.angle"], at=started(model, 12.0), coordinates=["rod.angle"], **how)
    values = [1.3, 0.6, 0.2, 0.0, 12.0]
    assert float(outputs(*map(mp.mpf, values))[0]) > 2 * np.pi
    agrees(found.derivatives[0, 0], slopes(outputs, values)[0])


def test_runs_that_have_no_derivatives_are_refused():
    model = build(rod(0.4, ["T - c*rod.rate"], DAMPED))
    for arguments, message in (
        ({"t_end": 1.0, "method": "rattle", "step": 1e-3}, "not available for rattle\n  Choose dop853"),
        (
            {"t_end": 1.0, "method": "radau5", "integrals": ["rod.angle"]},
            "an explicit method for integrals, got radau5",
        ),
        ({"t_end": 1.0, "coordinates": []}, "one for each degree of freedom, got no coordinates"),
        ({"rtol": 1e-9}, "rtol is for derivatives along a run"),
        ({"t_eval": [-0.1, 1.0]}, "increasing times from 0 s"),
        ({"t_eval": []}, "t_eval, at least one"),
        ({"t_eval": [[[0.1]], [[0.1]]]}, "t_eval"),
        ({"t_end": 1.0, "max_steps": 0}, "max_steps of at least 1"),
        ({"t_end": 1.0, "outputs": []}, "expected outputs or integrals"),
        ({"t_end": 1.0, "at": build("four_bar").initial_state()}, "a state of 2 coordinates for at"),
        ({"t_end": 1e-2, "integrals": ["rod.angle"] * 2}, "integral of rod.angle is given twice"),
        ({"t_end": 1e-2, "integrals": ["P.position", "P.position.x"]}, "integral of P.position.x is given"),
    ):
        with pytest.raises(ModelError, match=message):
            model.sensitivity(**{"outputs": ["rod.angle"], "coordinates": ["rod.angle"], **arguments})
    with pytest.raises(SimulationError, match="max_steps"):
        model.sensitivity(["rod.angle"], coordinates=["rod.angle"], t_end=1.0, step=1e-3, max_steps=10)
    jumps = build(rod(0.4, ["c*sign(t - b)"], {"c": (0.1, "N*m"), "b": (0.1, "s")}))
    with pytest.raises(ModelError, match="integrals are not available for loads that jump: sign"):
        jumps.sensitivity([], coordinates=["rod.angle"], t_end=0.2, integrals=["rod.angle"])
    with pytest.raises(ModelError, match="t_end"):
        build("elastic_four_bar").sensitivity(["frequencies"], t_end=1.0)


def test_integrals_that_are_not_finite_are_refused():
    """Of the angle between a rod and a length of zero."""
    model = build(rod(0.0, points={"O": ground(0, 0), "P": at(0.6, 0), "G": ground(0.6, 0)}))
    with pytest.raises(SimulationError, match="not finite"):
        model.sensitivity([], ["l"], coordinates=["rod.angle"], t_end=0.1, integrals=["O.P.G.angle"])


@pytest.mark.parametrize("how", [{}, {"method": "rk4", "step": 0.01}, {"method": "radau5"}])
def test_derivatives_at_the_start_are_among_those_of_the_times(how):
    """Of a swinging rod: l e and its rates, with theta'' = -3 g cos(theta)/(2 l)."""
    length, angle, rate, g = 0.5, -0.4, 1.3, 9.81
    model = symgen.build(
        symgen.Scene(
            parameters={"l": {"value": f"{length} m", "tunable": True}},
            points={"O": {"at": [0, 0], "ground": True}, "P": {"at": ["l", 0]}},
            links={"rod": {"points": ["O", "P"], "mass": "1 kg", "length": "l"}},
            gravity={"acceleration": [0, f"-{g} m/s^2"]},
            start={"angles": {"rod": f"{angle} rad"}, "rates": {"rod": f"{rate} rad/s"}},
        ),
        backend="numpy",
    )
    by, coordinates = ["l", "rod.angle", "rod.angle'"], ["rod.angle"]
    names = ["P.position", "P.acceleration"]
    found = model.sensitivity(names, by, coordinates=coordinates, t_eval=[0, 0.1], **how)
    e = np.array([np.cos(angle), np.sin(angle)])
    left = np.array([-e[1], e[0]])
    twist = -1.5 * g * e[0] / length
    place = np.column_stack([e, length * left, 0 * e])
    acceleration = np.column_stack(
        [
            -(rate**2) * e,
            -(rate**2) * length * left - twist * length * e + 1.5 * g * e[1] * left,
            -2 * rate * length * e,
        ]
    )
    assert found.derivatives[0] == pytest.approx(np.vstack([place, acceleration]), abs=1e-12)
    later = model.sensitivity(names, by, coordinates=coordinates, t_eval=[0.1], **how)
    assert np.array_equal(found.derivatives[1], np.reshape(later.derivatives, found.derivatives[1].shape))
