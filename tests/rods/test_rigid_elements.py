"""Forces in rigid links by elements: the method's golden numbers, Newton and Euler, power, and the rods' forces."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shared.elastic_golden as golden
import sympy as sp
from shared.elastic_reference import RIG
from shared.equations import found as numbered
from shared.in_numpy import build
from shared.linkages import GRAVITY, at, circles, ground, rod
from shared.shipped import derived
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import CapabilityError, ModelError, SimulationError
from symgen.mechanics.elastic.rigid_elements import angular_acceleration, inertia, nodal_matrix
from symgen.pipeline.subject import Subject
from symgen.runtime.result.forces import Forces

LBF, FT = 4.4482216152605, 0.3048
RPM = 373.0
DENSITY, BEARING = "0.00459375 slug/ft", "0.0040803133 slug"


def thesis(bearings=False, outputs=None):
    """The linkage of the method file: 7, 10, 12 and 11 in, 373 rpm, even slender links."""
    return symgen.Scene(
        parameters={"w": f"{RPM!r} rpm"},
        points={
            "M": ground(0, 0),
            "A": {"at": ["7 in", "0 in"]},
            "B": {"at": ["3.5 in", "9.37 in"]},
            "Q": {"at": ["11 in", "0 in"], "ground": True},
        },
        links={
            name: {"points": points, "length": f"{length} in", "mass_per_length": DENSITY}
            for name, points, length in (
                ("crank", ["M", "A"], 7),
                ("coupler", ["A", "B"], 10),
                ("output", ["B", "Q"], 12),
            )
        },
        masses=[{"point": p, "mass": BEARING} for p in "AB"] if bearings else [],
        drivers=[{"link": "crank", "angle": "w*t"}],
        analysis={"t_end": f"{60 / RPM!r} s", **({"outputs": outputs} if outputs else {})},
    )


@pytest.fixture(scope="module")
def four_bar():
    return build(thesis())


@pytest.mark.parametrize("elements", [1, 2, 3, 10])
def test_golden_forces(four_bar, elements):
    found = four_bar.inverse_dynamics(at=np.radians(list(golden.FORCES)), elements=elements)
    for i, (first, second, (torque, *moments)) in enumerate(golden.FORCES.values()):
        # The thesis' F pulls on what lies before a node, towards Q: at M it is minus the ground's force.
        ours = [
            -found.variable("M.reaction").values[i],
            found.variable("crank.A.force").values[i],
            found.variable("coupler.B.force").values[i],
            found.variable("Q.reaction").values[i],
        ]
        assert np.concatenate(ours) / LBF == pytest.approx([*first, *second], abs=1e-7)
        assert found.variable("crank.torque").values[i] / LBF / FT == pytest.approx(torque, abs=1e-7)
        middle = [found.variable(f"{k}@0.5.moment").values[i] for k in ("crank", "coupler", "output")]
        assert np.array(middle) / LBF / FT == pytest.approx(moments, abs=1e-7)
    # A crank without forces between its ends: its moment falls evenly from the torque to nothing.
    quarter = four_bar.inverse_dynamics(at=[0.0], elements=elements, sections=(0.25, 0.75))
    torque = quarter.variable("crank.torque").values
    for share in (0.25, 0.75):
        moment = quarter.variable(f"crank@{share}.moment").values
        assert moment == pytest.approx(torque * (1 - share), rel=1e-12)


def test_golden_torques_with_bearings():
    model = build(thesis(bearings=True))
    found = model.inverse_dynamics(at=np.radians(golden.DEGREES))
    torque = found.variable("crank.torque").values / LBF / FT
    assert torque == pytest.approx(golden.TORQUE, rel=1e-6)
    over = model.inverse_dynamics(samples=3601).variable("crank.torque").values / LBF / FT
    assert [over.max(), over.min()] == pytest.approx(golden.TORQUE_EXTREMES, abs=0.005)


def test_golden_peaks_over_the_turn(four_bar):
    found = four_bar.inverse_dynamics(samples=361)
    assert found.over[0] == pytest.approx(np.arange(361.0), abs=1e-9)
    named = {"M": "M.reaction", "A": "crank.A.force", "B": "coupler.B.force", "Q": "Q.reaction"}
    for joint, (value, angle) in golden.PEAK_FORCES.items():
        name = named[joint]
        assert found.greatest[name][0] / LBF == pytest.approx(value, abs=6e-4)
        assert np.degrees(found.greatest[name][1]) == pytest.approx(angle)
    # The method file has 61 for its own scaling of the equations.
    assert found.condition < 61


def test_equal_to_newton_and_euler_at_every_degree(four_bar):
    forces = replace(RIG, bearing=0.0).motion(np.radians(np.arange(361))).forces
    expected = np.hstack([*-forces["first"], forces["Q"], forces["torque"][:, None]])
    for elements in (1, 2, 3):
        found = four_bar.inverse_dynamics(samples=361, elements=elements)
        ours = np.hstack(
            [
                -found.variable("M.reaction").values,
                found.variable("crank.A.force").values,
                found.variable("coupler.B.force").values,
                found.variable("Q.reaction").values,
                found.variable("crank.torque").values[:, None] / FT,
            ]
        )
        assert np.abs(ours / LBF - expected).max() < 1e-12 * np.abs(expected).max()


def equal_to_rods(model, found, outputs, tolerance=1e-12):
    """Compare with a run of the equations of motion at the same times, relative to the largest force."""
    run = model.simulate(float(found.time[-1]), t_eval=found.time)
    size = max(np.abs(found.variable(name).values).max() for name in outputs)
    for name in outputs:
        away = np.abs(run.variable(name).values - found.variable(name).values)
        assert away.max() < tolerance * size, name


def _of(motion, point, word):
    return motion.variable(f"{point}.{word}").values


FOUR_BAR_OUTPUTS = [
    "M.reaction", "Q.reaction", "crank.M.force", "crank.A.force", "coupler.A.force", "coupler.B.force",
    "output.B.force", "output.Q.force", "crank.torque",
]  # fmt: skip


@pytest.mark.parametrize("elements", [1, 4])
def test_equal_to_the_rods_method(elements):
    model = build(thesis(bearings=True, outputs=FOUR_BAR_OUTPUTS))
    equal_to_rods(model, model.inverse_dynamics(samples=37, elements=elements), FOUR_BAR_OUTPUTS)


def balanced_power(model, found, tolerance=3e-8):
    """Torque times speed is the rate of the kinetic energy, where only the drive works."""
    times = found.time
    h = 1e-5 * (times[-1] - times[0])
    near = [model.kinematics(t - 2.5 * h, t + 2.5 * h, samples=6) for t in times[1:-1]]
    for i, motion in enumerate(near):
        energy = []
        for k in range(6):
            q = np.concatenate([_of(motion, p, "position")[k] for p in model.description.free])
            u = np.concatenate([_of(motion, p, "velocity")[k] for p in model.description.free])
            both = model.evaluator.blocks("energy", motion.time[k], q, u)
            energy.append(float(both["kinetic_energy"][0] + both["potential_energy"][0]))
        weights = np.array([-9, 125, -2250, 2250, -125, 9]) / 1920 / h
        drive = np.gradient(found.coordinate.values, times)[i + 1]
        link = found.coordinate.name.removesuffix(".angle")
        power = found.variable(f"{link}.torque").values[i + 1] * drive
        scale = max(abs(power), np.abs(energy).max() * abs(drive))
        assert abs(weights @ energy - power) < tolerance * scale


def test_power_of_the_torque():
    model = build(thesis(bearings=True))
    balanced_power(model, model.inverse_dynamics(samples=13))


SLIDER_OUTPUTS = ["O.reaction", "crank.A.force", "rod.B.force", "crank.torque"]


def slider_crank(**more):
    angle, r, l = 0.6, 0.05, 0.2
    a = r * np.array([np.cos(angle), np.sin(angle)])
    return symgen.Scene(
        parameters={"w": "300 rpm"},
        points={
            "O": ground(0, 0),
            "A": at(*a),
            "B": at(a[0] + np.sqrt(l**2 - a[1] ** 2), 0),
            "E": ground(0.4, 0),
        },
        links={"crank": rod("O", "A"), "rod": rod("A", "B", 0.5), "rail": {"points": ["O", "E"]}},
        masses=[{"point": "B", "mass": "0.8 kg"}],
        guides=[{"points": ["B"], "along": "rail"}],
        drivers=[{"link": "crank", "angle": f"{angle!r} + w*t"}],
        **{
            "gravity": GRAVITY,
            "analysis": {"t_end": "0.2 s", "outputs": SLIDER_OUTPUTS},
            **more,
        },
    )


def test_slider_crank():
    model = build(slider_crank())
    found = model.inverse_dynamics(samples=25, elements=3)
    equal_to_rods(model, found, SLIDER_OUTPUTS)
    balanced_power(model, found)
    # The rail holds the slider across; along it, nothing does: Newton's law of the slider and its load.
    push, on_rod = found.variable("rail.B.guide_force").values, found.variable("rod.B.force").values
    motion = model.kinematics(samples=25)
    a = _of(motion, "B", "acceleration")[:, 0]
    assert -on_rod[:, 0] == pytest.approx(0.8 * a, abs=1e-11 * np.abs(on_rod).max())
    assert push - on_rod[:, 1] - 0.8 * 9.81 == pytest.approx(np.zeros(25), abs=1e-11 * np.abs(on_rod).max())


def test_a_block_that_slides_on_a_moving_link():
    """Whitworth's quick return: the crank's pin slides along the lever, through its elements."""
    a = 0.1 * np.array([np.cos(0.4), np.sin(0.4)])
    lever = 0.4 * (a - [0.0, -0.25]) / np.linalg.norm(a - [0.0, -0.25])
    outputs = ["O.reaction", "C.reaction", "lever.C.force", "crank.A.force", "crank.torque"]
    scene = symgen.Scene(
        parameters={"w": "2 rad/s"},
        points={"O": ground(0, 0), "A": at(*a), "C": ground(0, -0.25), "D": at(lever[0], lever[1] - 0.25)},
        links={"crank": rod("O", "A"), "lever": rod("C", "D", 2.0)},
        guides=[{"points": ["A"], "along": "lever"}],
        drivers=[{"link": "crank", "angle": "0.4 + w*t"}],
        forces=[{"point": "D", "force": ["3 N", "1 N"]}],
        gravity=GRAVITY,
        analysis={"t_end": f"{float(np.pi)!r} s", "outputs": outputs},
    )
    model = build(scene)
    for elements in (1, 5):
        found = model.inverse_dynamics(samples=25, elements=elements, sections=(0.999999999,))
        equal_to_rods(model, found, outputs)
        # Just before its end the lever carries the force there and nothing else.
        tip = found.variable("lever@1.axial_force").values
        angle = model.kinematics(samples=25, of=["lever"]).variable("lever.angle").values
        assert tip == pytest.approx(3 * np.cos(angle) + np.sin(angle), abs=1e-6)
        moments = (
            [found.variable(f"lever@{i / 5:g}.moment").values for i in range(1, 5)] if elements == 5 else []
        )
        assert all(np.isfinite(m).all() for m in moments)


def six_bar(outputs):
    """Watt's linkage with a ternary coupler, under springs, couples and a force."""
    a = 0.1 * np.array([np.cos(0.7), np.sin(0.7)])
    b = circles(a, [0.4, 0.0], 0.35, 0.3)
    p = a + 0.5 * (b - a) + 0.4 * np.array([-(b - a)[1], (b - a)[0]])
    r = circles(p, [0.7, 0.1], 0.45, 0.4)
    return symgen.Scene(
        parameters={"w": "20 rad/s"},
        points={
            "O": ground(0, 0), "A": at(*a), "B": at(*b), "C": ground(0.4, 0),
            "P": at(*p), "R": at(*r), "S": ground(0.7, 0.1),
        },
        links={
            "crank": rod("O", "A"),
            "coupler": {"points": ["A", "B", "P"], "mass": "1.5 kg", "inertia": "0.02 kg*m^2",
                        "centre": [f"{float(c)!r} m" for c in (a + b + p) / 3]},
            "rocker": rod("C", "B"),
            "link": rod("P", "R"),
            "output": rod("S", "R", 2.0),
        },
        masses=[{"point": "R", "mass": "0.3 kg"}],
        springs=[{"between": ["P", "S"], "stiffness": "900 N/m", "length": "0.1 m", "damping": "5 N*s/m"}],
        torsion_springs=[{"link": "coupler", "against": "crank", "stiffness": "3 N*m/rad", "damping": "0.1 N*m*s"},
                         {"link": "rocker", "stiffness": "2 N*m/rad", "angle": "1 rad"}],
        torques=[{"link": "output", "torque": "7 N*m"}],
        forces=[{"point": "B", "force": ["20 N", "-30 N"]}],
        drivers=[{"link": "crank", "angle": "0.7 + w*t"}],
        gravity=GRAVITY,
        analysis={"t_end": "0.3 s", "outputs": outputs},
    )  # fmt: skip


def test_two_loops_with_a_ternary_link_and_loads():
    outputs = [
        "crank.torque", "O.reaction", "C.reaction", "S.reaction", "crank.O.force", "coupler.A.force",
        "coupler.B.force", "coupler.P.force", "rocker.B.force", "link.P.force", "output.R.force",
    ]  # fmt: skip
    model = build(six_bar(outputs))
    for elements in (1, 3):
        found = model.inverse_dynamics(samples=25, elements=elements)
        equal_to_rods(model, found, outputs)
        assert any("coupler" in note and "no section forces of" in note for note in found.notes)
        assert "coupler@0.5.moment" not in found and "output@0.5.moment" in found
    # The couple of the spring acts on the rocker at its ground point: its other end has no moment.
    near = model.inverse_dynamics(samples=5, sections=(1e-9, 1 - 1e-9))
    angles = model.kinematics(samples=5, of=["rocker"]).variable("rocker.angle").values
    assert near.variable("rocker@1e-09.moment").values == pytest.approx(-2 * (angles - 1), rel=1e-6)
    assert near.variable("rocker@1.moment").values == pytest.approx(np.zeros(5), abs=1e-6)


def test_redundant_links_are_told_of():
    data = symgen.load_scene("double_four_bar").model_dump(exclude_unset=True)
    data["parameters"] = {"crank": "1 m", "excess": "0 m"}
    data["drivers"] = [{"link": "AB", "angle": "atan2(-0.8, 0.6) + 0.3*sin(2*t)"}]
    data["analysis"] = {"t_end": "1 s", "outputs": ["AB.torque", "AB.B.force"]}
    data["parameters"]["w"] = "1 rad/s"
    data["drivers"][0]["angle"] = "atan2(-0.8, 0.6) + 0.3*sin(2*w*t)"
    model = build(symgen.Scene(**data))
    assert len(model.redundant) == 1
    found = model.inverse_dynamics(samples=11)
    equal_to_rods(model, found, ["AB.torque"])
    (note,) = (n for n in found.notes if "least norm" in n)
    assert "the force on DC at C" in note and "the torque" not in note
    assert found.statistics["residual"] < 1e-13


def test_the_element_in_symbols():
    """Its kernel's matrix is that of the print, and its inertia that of a rotating rigid body."""
    x = sp.symbols("x:6", real=True)
    start, end, centre = x[:2], x[2:4], x[4:]
    R, S = ([p - q for p, q in zip(*pair, strict=True)] for pair in ((centre, start), (end, centre)))
    printed = sp.Matrix(
        [[-1, 0, 0, 1, 0, 0], [0, -1, 0, 0, 1, 0], [-R[1], R[0], 1, -S[1], S[0], -1]]
    )  # Eq. (4.10)
    assert sp.simplify(nodal_matrix(start, end, centre) - printed) == sp.zeros(3, 6)
    w, alpha, length, angle = sp.symbols("w alpha l angle", real=True)
    d = (length * sp.cos(angle), length * sp.sin(angle))
    relative = (-alpha * d[1] - w**2 * d[0], alpha * d[0] - w**2 * d[1])
    assert sp.simplify(angular_acceleration(d, relative) - alpha) == 0
    m, moment, ax, ay, gx, gy = sp.symbols("m I ax ay gx gy", real=True)
    assert inertia(m, moment, (ax, ay), alpha, (gx, gy)) == (m * (ax - gx), m * (ay - gy), moment * alpha)
    system = derived("rigid_element")
    names = {"nodal_matrix", "point_matrix", "levers", "motion", "inertia"}
    assert {m.name for m in system.matrices} == names
    assert [str(x) for x in system["nodal_matrix"].matrix.row(2)] == ["-R_y", "R_x", "1", "-S_y", "S_x", "-1"]
    (levers,) = numbered(Subject("rigid_element", {}), "4.4")
    middle = {"c_along": sp.Rational(1, 2), "c_across": 0}
    names = {str(s): s for s in levers.matrix.free_symbols}
    half = levers.matrix.subs({names[c]: value for c, value in middle.items()})
    printed = sp.sympify("[(k_x - i_x)/2, (k_y - i_y)/2]", locals=names)  # Eq. (4.4)
    assert [sp.expand(e) for e in half] == [sp.expand(e) for e in printed]
    (p,) = numbered(Subject("rigid_element", {}), "4.2")
    m, moment, g = (sp.Symbol(x, real=True) for x in ("m", "I_c", "g_y"))
    balance = sp.Matrix([m * p.matrix[0], m * p.matrix[1] + p.matrix[3], moment * p.matrix[2]])  # (4.7)-(4.9)
    inertial = system.expanded("inertia").subs(sp.Symbol("g_x", real=True), 0)
    assert g in p.matrix.free_symbols
    assert (balance - inertial).expand() == sp.zeros(3, 1)


def test_assembled_at_once(four_bar):
    """The elimination of the section forces gives what the assembled square system of the print gives."""
    n, theta, mu = 3, np.radians(60.0), 0.00459375
    found = four_bar.inverse_dynamics(at=[theta], elements=n)
    motion = four_bar.kinematics(samples=7)
    i = int(np.argmin(np.abs(motion.time - found.time[0])))
    ends = {"M": np.zeros(2), "Q": np.array([11 * 0.0254, 0.0])}
    r = {p: ends.get(p, _of(motion, p, "position")[i] if p in "AB" else None) for p in "MABQ"}
    acc = {p: _of(motion, p, "acceleration")[i] if p in "AB" else np.zeros(2) for p in "MABQ"}
    mu_si = mu * 14.593902937206365 / FT
    d_rows, e_rows = [], []
    for start, end in ("MA", "AB", "BQ"):
        length = np.linalg.norm(r[end] - r[start]) / n
        for k in range(n):
            i0, i1 = (r[start] + s / n * (r[end] - r[start]) for s in (k, k + 1))
            half = (i1 - i0) / 2
            d_rows.append(
                [[-1, 0, 0, 1, 0, 0], [0, -1, 0, 0, 1, 0], [-half[1], half[0], 1, -half[1], half[0], -1]]
            )
            centre = acc[start] + (k + 0.5) / n * (acc[end] - acc[start])
            relative = (acc[end] - acc[start]) / n
            turning = (2 * half[0] * relative[1] - 2 * half[1] * relative[0]) / length**2
            e_rows.append([*(mu_si * length * centre), mu_si * length**3 / 12 * turning])
    nodes = 3 * n + 1
    whole = np.zeros((9 * n, 3 * nodes))
    for k, d in enumerate(d_rows):  # [D] = [d][a], Eqs. (4.11) and (4.15): neighbours share a node
        whole[3 * k : 3 * k + 3, 3 * k : 3 * k + 6] += d
    pins = [3 * k + 2 for k in (n, 2 * n, 3 * n)]
    square = np.delete(whole, pins, axis=1)
    forces = np.insert(
        np.linalg.solve(square, np.concatenate(e_rows)), [p - j for j, p in enumerate(pins)], 0.0
    )
    forces = forces.reshape(nodes, 3)
    assert found.variable("M.reaction").values[0] == pytest.approx(-forces[0, :2], rel=1e-11)
    assert found.variable("crank.torque").values[0] == pytest.approx(forces[0, 2], rel=1e-11)
    for k, link in enumerate(("crank", "coupler", "output")):
        for j in range(1, n):
            moment = found.variable(f"{link}@{j / n:.6g}.moment").values[0]
            assert moment == pytest.approx(forces[k * n + j, 2], rel=1e-10)


def test_a_toggle_is_named():
    """A rocker driven into the pose in which coupler and crank lie in line, where it cannot continue."""
    a, b, c, d = 0.1, 0.35, 0.3, 0.4
    psi = np.pi - np.arccos((c**2 + d**2 - (a + b) ** 2) / (2 * c * d))  # |OB| = a + b
    start = circles([d + c * np.cos(psi + 0.4), c * np.sin(psi + 0.4)], [0.0, 0.0], b, a)
    scene = symgen.Scene(
        parameters={"w": "1 rad/s"},
        points={
            "O": ground(0, 0), "A": at(*start), "C": ground(d, 0),
            "B": at(d + c * np.cos(psi + 0.4), c * np.sin(psi + 0.4)),
        },
        links={"crank": rod("O", "A"), "coupler": rod("A", "B"), "rocker": rod("C", "B")},
        drivers=[{"link": "rocker", "angle": f"{float(psi + 0.4)!r} - w*t"}],
        analysis={"t_end": "0.6 s"},
    )  # fmt: skip
    model = build(scene)
    with pytest.raises(SimulationError) as error:
        model.inverse_dynamics(at=[psi])
    text = str(error.value)
    assert "dead centre" in text and "crank and coupler in line" in text
    assert "13 unknown components have rank 12" in text and "the force on crank at O" in text
    assert f"rocker.angle = {np.degrees(psi):.6g}" in text
    found = model.inverse_dynamics(samples=61)
    assert found.time[-1] < 0.4 + 1e-9 and found.condition > 30
    assert any("rank 12" in note for note in found.notes) and len(found.singular_poses) == 1
    assert np.isfinite(found.variable("rocker.torque").values).all()


def test_a_bifurcation_is_left_out():
    data = symgen.load_scene("parallelogram").model_dump(exclude_unset=True)
    data["parameters"] = {"w": "1 rad/s"}
    data["drivers"] = [{"link": "AB", "angle": "atan2(0.8, 0.6) + w*t"}]
    data["analysis"] = {"t_end": "3 s"}
    del data["start"]
    model = build(symgen.Scene(**data))
    with pytest.raises(SimulationError, match="rank 12; open: .*the force on"):
        model.inverse_dynamics(at=[np.pi])
    found = model.inverse_dynamics(samples=31)
    assert found.singular_poses[0].kind == "bifurcation"
    assert np.isfinite(found.variable("AB.torque").values).all()


def test_bad_requests(four_bar):
    for arguments, words in (
        ({"elements": 0}, "between 1 and 1000 elements"),
        ({"elements": 2.5}, "whole number"),
        ({"sections": (1.0,)}, "between the ends of a link"),
        ({"samples": 1}, "samples"),
        ({"start": 1.0, "stop": 0.5}, "start before stop"),
        ({"at": [np.nan]}, "finite numbers"),
        (
            {
                "at": [],
            },
            "at least one value",
        ),
        ({"at": [3.0], "stop": 0.01}, "does not come to"),
    ):
        with pytest.raises(ModelError, match=words):
            four_bar.inverse_dynamics(**arguments)


def test_command_line(tmp_path, four_bar):
    runner = CliRunner()
    file, plot = tmp_path / "forces.nc", tmp_path / "forces.png"
    done = runner.invoke(
        app, ["inverse-dynamics", "crank_rocker", "--at", "30,0.5 rad", "--json", "--out", str(file)]
    )
    assert done.exit_code == 0
    data = json.loads(done.stdout)
    along, torque = data["coordinate"], data["outputs"]["crank.torque"]
    assert along["name"] == "crank.angle" and along["unit"] == "rad"
    assert [along["first"], along["last"]] == pytest.approx([np.radians(30.0), 0.5])
    assert data["kind"] == "forces" and torque["unit"] == "N*m"
    stored = symgen.load_result(file)
    assert isinstance(stored, Forces)
    values = stored.variable("crank.torque").values
    assert [values[-1], values.min(), values.max()] == [torque[x] for x in ("final", "minimum", "maximum")]
    done = runner.invoke(
        app, ["inverse-dynamics", "crank_rocker", "--samples", "5", "--elements", "2", "--plot", str(plot)]
    )
    assert done.exit_code == 0 and plot.stat().st_size > 1000
    assert "crank@0.5.moment" in done.stdout and "; condition " in done.stdout
    with pytest.raises(CapabilityError, match="needs 6 more drives"):
        runner.invoke(app, ["inverse-dynamics", "tumbling_body"], catch_exceptions=False)


def test_a_linkage_without_a_drive_is_told_to_have_one():
    with pytest.raises(CapabilityError, match="1 more drive"):
        build("four_bar").inverse_dynamics(at=[0.0])
