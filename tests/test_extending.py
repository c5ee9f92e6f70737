"""New kinds, registered in a few lines of a test and nowhere else, run through everything that symgen does."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from dataclasses import dataclass, fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.elements import ELEMENTS
from symgen.elements.element import Element
from symgen.errors import ModelError, SceneError
from symgen.export import export_c
from symgen.inspection.explanation import explanation
from symgen.inspection.linkages import RodsView
from symgen.inspection.page import scene_page
from symgen.joints import JOINTS
from symgen.joints.joint import Joint
from symgen.loads import LOADS
from symgen.loads.load import Load
from symgen.loads.measure import RATES, VALUE, LoadTerm
from symgen.loads.of_points import Length, Position
from symgen.methods import METHODS
from symgen.models.momentum.rows import momentum_system
from symgen.pipeline.subject import Subject
from symgen.pipeline.user_model import supply_elements
from symgen.report.page.page import Fact, render
from symgen.runtime.beams import elements
from symgen.runtime.kernels import library
from symgen.scene import units
from symgen.scene.loading import read_scene
from symgen.scene.resolve import resolve, resolved_linkage
from symgen.scene.rods.linkage import Linkage
from symgen.scene.table import Name, Table, Value
from symgen.study.accuracy.accuracy import accuracy
from symgen.toolchain.kernels import tools_for

# --- loads ----------------------------------------------------------------------------------------------------


class DipoleTable(Table):
    """Two magnets in line."""

    between: list[Name]
    strength: Value


@dataclass(frozen=True, slots=True)
class Dipole(Load):
    """Two magnets that attract each other, V = -s/l^3."""

    noun, plural, schema = "dipole", "dipoles", DipoleTable
    start: str
    end: str
    strength: sp.Expr

    @classmethod
    def read(cls, read, table, name, where):
        start, end = (read.known_point(p, f"{where}.between").name for p in table.between)
        return cls(
            name, start, end, read.value(table.strength, units.dimension(5, 1, -2), f"{where}.strength")
        )

    def terms(self, dimension):
        yield LoadTerm(Length(self.name, self.start, self.end), energy=-self.strength / VALUE**3)


class DragTable(Table):
    """The drag of a ball."""

    point: Name
    coefficient: Value


@dataclass(frozen=True, slots=True)
class Drag(Load):
    """A drag that grows with the square of the speed, F = -c |v| v."""

    noun, plural, schema = "drag", "drags", DragTable
    point: str
    coefficient: sp.Expr

    @classmethod
    def read(cls, read, table, name, where):
        point = read.known_point(table.point, f"{where}.point").name
        return cls(
            name, point, read.not_negative(table.coefficient, units.MASS_PER_LENGTH, f"{where}.coefficient")
        )

    def terms(self, dimension):
        speed = sp.sqrt(sum(v**2 for v in RATES[:dimension]))
        yield LoadTerm(
            Position(self.point), force=tuple(-self.coefficient * speed * v for v in RATES[:dimension])
        )


class TieTable(Table):
    """Two points."""

    between: list[Name]


@dataclass(frozen=True, slots=True)
class Tie(Load):
    """Opposite forces on two points along the x axis, which elastic links know of neither point alone."""

    noun, plural, schema = "tie", "ties", TieTable
    start: str
    end: str

    @classmethod
    def read(cls, read, table, name, where):
        return cls(name, *table.between)

    def terms(self, dimension):
        yield LoadTerm(Position(self.start), force=(sp.Integer(1), *[sp.Integer(0)] * (dimension - 1)))
        yield LoadTerm(Position(self.end), force=(sp.Integer(-1), *[sp.Integer(0)] * (dimension - 1)))


@pytest.fixture(scope="module", autouse=True)
def registered(tmp_path_factory):
    """Register the kinds; what is compiled of them goes to a cache of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SYMGEN_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.setitem(LOADS, "dipoles", Dipole)
        patch.setitem(LOADS, "drags", Drag)
        patch.setitem(LOADS, "ties", Tie)
        yield


#: A rod on O, with a magnet S near its tip A, in air.
PENDULUM = """
symgen = 1
title = "Rod and magnet"
[parameters]
s = { value = "0.4 N*m^4", tunable = true }
c = { value = "0.8 kg/m", tunable = true }
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.6 m", "-0.8 m"] }
S = { at = ["-0.4 m", "-1.3 m"], ground = true }
[links]
rod = { points = ["O", "A"], mass = "3 kg" }
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
[[dipoles]]
between = ["S", "A"]
strength = "s"
[[drags]]
point = "A"
coefficient = "c"
[analysis]
t_end = "1 s"
outputs = ["A.position", "A.velocity", "rod.O.force", "O.reaction", "energy"]
"""
M, G, S, C = 3.0, 9.81, 0.4, 0.8
MAGNET = np.array([-0.4, -1.3])
START = np.arctan2(-0.8, 0.6)
DRIVEN = PENDULUM.replace(
    "[analysis]", '[[drivers]]\nlink = "rod"\nangle = "-0.5 + t*w"\n[analysis]'
).replace("[points]", 'w = "1.5 rad/s"\n[points]')


def pull(place, magnet=MAGNET):
    """The force of the magnet, -grad V with V = -s/l^3."""
    d = np.asarray(place) - magnet
    return -3 * S * d / np.linalg.norm(d) ** 5


def force_at_tip(angle, rate):
    """Force of magnet and air on the tip of a rod of 1 m, at an angle."""
    tip = np.array([np.cos(angle), np.sin(angle)])
    speed = rate * np.array([-tip[1], tip[0]])
    return pull(tip) - C * np.linalg.norm(speed) * speed


def angular_acceleration(angle, rate):
    """Of the rod about O: M/3 a = moment of the weight and of the force at the tip."""
    force = force_at_tip(angle, rate)
    return 3 / M * (-M * G / 2 * np.cos(angle) + np.cos(angle) * force[1] - np.sin(angle) * force[0])


def written(folder, text, name="magnet"):
    path = folder / f"{name}.toml"
    path.write_text(text)
    return str(path)


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory):
    path = written(tmp_path_factory.mktemp("scenes"), PENDULUM)
    return SimpleNamespace(path=path, model=symgen.build(path))


def test_a_load_moves_the_linkage_and_its_energy_is_balanced(pendulum):
    run = pendulum.model.simulate(rtol=1e-10, atol=1e-10, samples=11)
    times = np.linspace(0, 1, 11)
    exact = solve_ivp(
        lambda t, y: [y[1], angular_acceleration(*y)],
        (0, 1),
        [START, 0.0],
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-12,
    )
    angles, rates = exact.y
    tips = np.column_stack([np.cos(angles), np.sin(angles)])
    assert run["A.position"].values == pytest.approx(tips, abs=1e-8)
    energy = M / 6 * rates**2 + M * G / 2 * tips[:, 1] - S / np.linalg.norm(tips - MAGNET, axis=1) ** 3
    assert run["energy"].values == pytest.approx(energy, abs=1e-8)
    assert energy[0] - energy[-1] > 1  # the air takes energy, and the balance holds it
    assert run.drift.energy < 1e-7


def newton(angle, rate, acceleration):
    """The force on the rod at O: M a_c = M g + force at the tip + force at O."""
    along = np.array([np.cos(angle), np.sin(angle)])
    left = np.array([-along[1], along[0]])
    return M / 2 * (acceleration * left - rate**2 * along) + [0, M * G] - force_at_tip(angle, rate)


def test_a_load_is_in_the_joint_forces_of_a_run(pendulum):
    run = pendulum.model.simulate(rtol=1e-10, atol=1e-10, samples=11)
    for tip, moving, *forces in zip(
        *(run[n].values for n in ("A.position", "A.velocity", "rod.O.force", "O.reaction")), strict=True
    ):
        angle, rate = np.arctan2(tip[1], tip[0]), tip[0] * moving[1] - tip[1] * moving[0]
        expected = newton(angle, rate, angular_acceleration(angle, rate))
        for force in forces:
            assert force == pytest.approx(expected, abs=1e-8)


def test_a_load_is_in_equilibria(pendulum):
    tip = pendulum.model.equilibrium().state.positions["A"]
    angle = brentq(lambda a: angular_acceleration(a, 0), -2.1, -1.4, xtol=1e-14)
    assert np.arctan2(tip[1], tip[0]) == pytest.approx(angle, abs=1e-9)
    # v abs(v), of which 0/0 is a part
    with pytest.raises(ModelError, match="the damping of a force is not defined at rest"):
        pendulum.model.modes()


def test_a_load_is_in_inverse_dynamics():
    model = symgen.build(symgen.Scene(**tomllib.loads(DRIVEN)))
    times = [0.1, 0.5, 0.9]
    found = model.inverse_dynamics(at=[-0.5 + 1.5 * t for t in times])
    for i, t in enumerate(times):
        angle = -0.5 + 1.5 * t
        tip = np.array([np.cos(angle), np.sin(angle)])
        force = force_at_tip(angle, 1.5)
        assert found["O.reaction"].values[i] == pytest.approx(newton(angle, 1.5, 0.0), abs=1e-9)
        torque = M * G / 2 * tip[0] - (tip[0] * force[1] - tip[1] * force[0])
        assert found["rod.torque"].values[i] == pytest.approx(torque, abs=1e-9)


def test_a_load_is_in_momentum_rows():
    """Of the rod about O: M/3 a on the left, the moments on the right, at a state of its own."""
    system = momentum_system(resolve(symgen.Scene(**tomllib.loads(PENDULUM))))
    angle, rate = 0.4, 1.7
    a = angular_acceleration(angle, rate)
    tip, left = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    vector = (
        dict(zip("xy", tip, strict=True)),
        dict(zip("xy", rate * left, strict=True)),
        a * left - rate**2 * tip,
    )
    values = {"s": S, "c": C, "A_ax": vector[2][0], "A_ay": vector[2][1]}
    values |= {f"A_{k}": v for k, v in vector[0].items()} | {f"A_v{k}": v for k, v in vector[1].items()}
    put = {sp.Symbol(name, real=True): sp.Float(value, 30) for name, value in values.items()}
    for definition in system.definitions:
        put[definition.quantity.symbol] = definition.expression.xreplace(put)
    (row,) = (m.matrix for m in system.matrices if m.name == "rod_moment")
    assert abs(float(row[0].xreplace(put))) < 1e-12
    assert abs(float(row[0].xreplace({**put, sp.Symbol("A_ay", real=True): sp.Float(0)}))) > 1


def test_a_load_is_carried_by_elastic_links_or_refused():
    """A cantilever on a shaft at rest, a magnet 0.5 m below its tip: f/(3 E I/l^3 + dF/dl)."""
    strip = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true }
T = { at = ["1.3 m", "0 m"] }
X = { on = "strip", fraction = 0.5 }
G = { at = ["1.3 m", "-0.5 m"], ground = true }
[links.strip]
points = ["O", "T"]
density = "7850 kg/m^3"
section = { width = "30 mm", thickness = "10 mm" }
elastic = { E = "210 GPa" }
[crank]
link = "strip"
speed = "SPEED"
"""
    magnet = '[[dipoles]]\nbetween = ["T", "G"]\nstrength = "0.1 N*m^4"\n'

    def tip(text, speed="0 rpm"):
        model = symgen.build(symgen.Scene(**tomllib.loads(strip.replace("SPEED", speed) + text)))
        return model.quasi_static(samples=3)["T.displacement"].values[-1]

    stiffness = 3 * 210e9 * 0.03 * 0.01**3 / 12 / 1.3**3
    assert tip(magnet)[1] == pytest.approx(-3 * 0.1 / 0.5**4 / (stiffness - 12 * 0.1 / 0.5**5), rel=1e-9)
    speed = "sqrt(X.vx**2 + X.vy**2)"
    air = f'[[forces]]\npoint = "X"\nforce = ["-c*{speed}*X.vx", "-c*{speed}*X.vy"]\n[parameters]\nc = "0.8 kg/m"\n'
    drag = '[[drags]]\npoint = "X"\ncoefficient = "0.8 kg/m"\n'
    assert tip(drag, "120 rpm") == pytest.approx(tip(air, "120 rpm"), rel=1e-12)
    assert np.linalg.norm(tip(drag, "120 rpm") - tip("", "120 rpm")) > 1e-4
    # At the middle of the cantilever: stiffness 3 E I/a^3 there, and the tip moves 5/2 times as far.
    middle = 3 * 0.1 / 0.5**4 / (8 * stiffness - 12 * 0.1 / 0.5**5)
    below = magnet.replace('"T"', '"X"').replace('"G"', '"H"')
    below += '[points.H]\nat = ["0.65 m", "-0.5 m"]\nground = true\n'
    assert tip(below)[1] == pytest.approx(-2.5 * middle, rel=1e-9)
    with pytest.raises(SceneError, match=r"ties. 0: a tie acts on an elastic link and elsewhere"):
        tip('[[ties]]\nbetween = ["T", "X"]\n')


def in_space(text, level="0.2 m"):
    """The same scene with a third coordinate."""
    return re.sub(r'(at = \["[^"]*", "[^"]*")\]', rf'\1, "{level}"]', text).replace(
        '"-9.81 m/s^2"]', '"-9.81 m/s^2", "0 m/s^2"]'
    )


def test_a_load_keeps_a_linkage_in_its_plane_or_not(pendulum):
    lifted = symgen.Scene(**tomllib.loads(in_space(PENDULUM)))
    assert str(resolve(lifted).plane) == "z = 0.2 m"
    end = symgen.build(lifted).simulate(rtol=1e-10, atol=1e-10, samples=3)["A.position"].values[-1]
    flat = pendulum.model.simulate(rtol=1e-10, atol=1e-10, samples=3)["A.position"].values[-1]
    assert end == pytest.approx([*flat, 0.2], abs=1e-12)
    off = tomllib.loads(in_space(PENDULUM))
    off["points"]["S"]["at"][2] = "0.5 m"
    linkage = resolve(symgen.Scene(**off))
    assert linkage.plane is None
    model = symgen.build(symgen.Scene(**off))
    state = model.initial_state()
    place, magnet = np.array([0.6, -0.8, 0.2]), np.array([*MAGNET, 0.5])
    force = pull(place, magnet) + [0, -M * G / 2, 0]
    along = (place - [0, 0, 0.2]) / 1.0
    # the point of a rod that pivots at its other end carries M/3, and only what is across the rod moves it
    expected = (force - along * (force @ along)) * 3 / M
    assert model.accelerations(state)["A"] == pytest.approx(expected, rel=1e-9)


def test_a_load_is_in_explanations_pages_and_names(pendulum):
    lines = "\n".join(explanation(pendulum.path, {}))
    assert "dipoles" not in lines and "springs and dampers" in lines  # what the scene has none of
    page = render(scene_page(read_scene(pendulum.path), speed=False, progress=lambda _: None))
    assert 'class="actuator"' in page and "dipole_0_length" in page
    done = CliRunner().invoke(app, ["explain", pendulum.path])
    assert done.exit_code == 0, done.output
    with pytest.raises(SceneError, match="dipole_1"):
        resolve(
            symgen.Scene(**tomllib.loads(PENDULUM.replace("rod = {", "dipole_1 = {").split("[analysis]")[0]))
        )


def checked_export(path, folder):
    """Export a scene, compile its check and run it: the bits are those of Python."""
    export_c(path, folder)
    if shutil.which("gcc") is None:
        return
    sources = [f"{folder.name}.c", *sorted(p.name for p in folder.glob("*_kernel*.c"))]
    sources += [str(p) for p in sorted(folder.glob("core/*.c"))]
    command = ["gcc", "-std=c11", "-ffp-contract=off", "-o", "check", "check.c", *sources, "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run(["./check", "--bits"], cwd=folder, capture_output=True, text=True)
    assert "all the same to the last bit" in done.stdout, done.stdout + done.stderr


def test_a_load_is_in_exports(pendulum, tmp_path):
    checked_export(pendulum.path, tmp_path / "magnet")


def test_without_the_registry_a_scene_has_no_such_table():
    with pytest.MonkeyPatch.context() as patch:
        patch.delitem(LOADS, "drags")
        with pytest.raises(SceneError, match="unknown key 'drags'"):
            symgen.Scene(**tomllib.loads(PENDULUM))


# --- joints ---------------------------------------------------------------------------------------------------

#: A pin in a slot: it turns about k, and slides along the i of the link behind it.
SLOT = Joint("T", "slot", varies=("theta", "a"))

#: A crank of 0.2 m whose pin slides in a lever, which turns about a point 0.5 m beside the crank's.
SHAPER = """
symgen = 1
title = "Quick return by a slotted lever"
[parameters]
speed = "60 rpm"
[loop]
inputs = { theta1 = "speed*t" }
rows = [
  { joint = "R", link = "crank", theta = "theta1", a = "0.2 m" },
  { joint = "T", link = "lever", theta = "?", a = "?" },
  { joint = "R", link = "ground", theta = "?", a = "0.5 m" },
]
start = { theta2 = "0 deg", a2 = "-0.7 m", theta3 = "0 deg" }
[loop.links.crank]
mass = "0 kg"
[loop.links.lever]
mass = "2 kg"
inertia = [0, "0.3 kg*m^2", "0.3 kg*m^2"]
[gravity]
acceleration = [0, "-9.81 m/s^2", 0]
"""


@pytest.fixture(scope="module")
def shaper(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(JOINTS, "T", SLOT)
        path = written(tmp_path_factory.mktemp("loops"), SHAPER, "shaper")
        yield SimpleNamespace(path=path, model=symgen.build(path))


def lever(angle, rate):
    """Direction of the lever by the angle of the crank at a constant rate, with its first and second rate."""
    z = 0.5 + 0.2 * np.exp(1j * angle)
    first = 0.2j * rate * np.exp(1j * angle) / z
    second = -0.2 * rate**2 * np.exp(1j * angle) / z
    return np.unwrap(np.angle(z)), np.abs(z), first.imag, (second - first**2).imag


def test_a_joint_closes_a_loop_and_bears_its_forces(shaper):
    turn = shaper.model.inverse_dynamics(samples=25)
    crank, rate = turn["theta1"].values, 2 * np.pi
    direction, reach, turning, turned = lever(crank, rate)
    assert turn["theta2"].values == pytest.approx(direction - crank, abs=1e-10)
    assert turn["a2"].values == pytest.approx(-reach, abs=1e-10)
    assert turn["theta2.rate"].values == pytest.approx(turning - rate, abs=1e-9)
    # the crank has no mass, and the lever turns about its centre: power of the crank = rate of I w^2/2
    assert turn["theta1.drive"].values == pytest.approx(0.3 * turning * turned / rate, abs=1e-9)
    pivot = turn["ground.joint3.force"].values
    assert np.max(np.abs(pivot)) > 1


def test_a_joint_keeps_the_energy_of_a_free_loop():
    """The lever turns about its centre of mass, so that all energy is I w^2/2, and w stays."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(JOINTS, "T", SLOT)
        free = SHAPER.replace(
            'inputs = { theta1 = "speed*t" }', 'free = { theta1 = { at = 0.3, rate = "2 rad/s" } }'
        )
        run = symgen.build(symgen.Scene(**tomllib.loads(free))).simulate(
            0.5, rtol=1e-10, atol=1e-10, samples=6
        )
    crank, rate = run["theta1"].values, run["theta1.rate"].values
    _, _, turning, _ = lever(crank, rate)
    assert turning == pytest.approx(turning[0], rel=1e-8)
    assert np.ptp(rate) > 0.1
    assert run.drift.energy < 1e-8


def test_a_joint_is_in_explanations_pages_and_exports(shaper, tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(JOINTS, "T", SLOT)
        assert "T, slot, from crank to lever" in "\n".join(explanation(shaper.path, {}))
        page = render(scene_page(read_scene(shaper.path), speed=False, progress=lambda _: None))
        assert "slot T" in page
        checked_export(shaper.path, tmp_path / "shaper")


# --- elements -------------------------------------------------------------------------------------------------

#: Cubic deflection and quadratic stretch.
STRETCH = Element("stretch7", "cubic deflection, quadratic stretch", ("u", "w", "theta"), 2, 3, ("mid",))

#: A strip that a shaft holds level, in gravity.
CANTILEVER = """
symgen = 1
title = "Cantilever"
[points]
O = { at = ["0 m", "0 m"], ground = true }
T = { at = ["1.3 m", "0 m"] }
[links.strip]
points = ["O", "T"]
density = "7850 kg/m^3"
section = { width = "30 mm", thickness = "10 mm" }
elastic = { E = "210 GPa", element = "stretch7", elements = 8 }
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
[crank]
link = "strip"
speed = "0 rpm"
[analysis]
t_end = "0.2 s"
"""
L, EI, RHO_A = 1.3, 210e9 * 0.03 * 0.01**3 / 12, 7850 * 0.03 * 0.01


@pytest.fixture(scope="module")
def cantilever(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(ELEMENTS, "stretch7", STRETCH)
        patch.setattr(elements, "SUPPLIED", {})
        path = written(tmp_path_factory.mktemp("strips"), CANTILEVER, "cantilever")
        yield SimpleNamespace(path=path, model=symgen.build(path))


def waves(count):
    """Return z = k l of the modes of a clamped beam with a free end: cos z cosh z = -1."""
    return [brentq(lambda z: np.cos(z) + 1 / np.cosh(z), i * np.pi, (i + 1) * np.pi) for i in range(count)]


def test_an_element_bends_and_vibrates(cantilever):
    sag = cantilever.model.quasi_static(samples=3)["T.displacement"].values[-1]
    assert sag == pytest.approx([0, -RHO_A * 9.81 * L**4 / (8 * EI)], rel=1e-9, abs=1e-12)
    z = np.array(waves(3))
    exact = z**2 / L**2 * np.sqrt(EI / RHO_A) / (2 * np.pi)
    expected = exact * (1 + (z / 8) ** 4 / 1440)  # Rayleigh's quotient of the error of cubic deflections
    assert cantilever.model.modes().frequencies[:3] == pytest.approx(expected, rel=5e-5)


def test_an_element_conserves_energy_when_it_is_released(cantilever):
    """Modes phi of unit modal mass, each w = (g rho A int phi)/omega^2 (1 - cos omega t), without loss."""
    run = cantilever.model.simulate(0.2, rtol=1e-6, samples=41)
    tip = np.zeros(41)
    for z in waves(5):
        omega = z**2 / L**2 * np.sqrt(EI / RHO_A)
        s = (np.cosh(z) + np.cos(z)) / (np.sinh(z) + np.sin(z))
        mean = 2 * s / z  # of phi = cosh kx - cos kx - s (sinh kx - sin kx), whose square has mean 1
        end = np.cosh(z) - np.cos(z) - s * (np.sinh(z) - np.sin(z))
        tip -= 9.81 * mean * end / omega**2 * (1 - np.cos(omega * np.linspace(0, 0.2, 41)))
    assert run["T.displacement"].values[:, 1] == pytest.approx(tip, abs=2e-3 * np.max(np.abs(tip)))


def test_an_element_is_in_inverse_dynamics(cantilever):
    """The torque of the shaft at constant speed is that of the weight, of a rigid strip."""
    turning = symgen.Scene(**tomllib.loads(CANTILEVER.replace("0 rpm", "30 rpm").split("[analysis]")[0]))
    angles = [0.3, 1.1, 2.0]
    found = symgen.build(turning).inverse_dynamics(at=angles)["strip.torque"].values
    assert found == pytest.approx(RHO_A * L * 9.81 * L / 2 * np.cos(angles), rel=1e-9)


def test_an_element_is_in_explanations_pages_and_exports(cantilever, tmp_path):
    assert "8 elements stretch7" in "\n".join(explanation(cantilever.path, {}))
    page = render(scene_page(read_scene(cantilever.path), speed=False, progress=lambda _: None))
    assert "elastic unknowns" in page
    checked_export(cantilever.path, tmp_path / "cantilever")


def test_an_element_is_in_assembled_equations(cantilever, monkeypatch):
    monkeypatch.setattr(elements, "SUPPLIED", {})
    system = Subject(str(cantilever.path), {}).assembled
    mass = system["strip.mass"].part(["mid@1.2"], ["mid@1.2"]).matrix[0]
    length, per_length = (sp.Symbol(f"{x}_strip", real=True) for x in ("l", "mu"))
    assert mass == per_length * length / 8 * sp.Rational(8, 15)  # of (4 x/l (1 - x/l))^2


def test_an_element_of_symgen_is_compiled_where_its_module_is_missing(monkeypatch):
    shipped, q = elements.kernels("element_beam8"), np.linspace(1.0, 2.0, 20)
    expected = [shipped.mass(q=q, u=np.zeros(1)), shipped.geometric(q=q, u=np.zeros(1))]

    monkeypatch.setattr(library, "is_compiled", lambda block: False)
    monkeypatch.setattr(elements, "SUPPLIED", {})
    beam = SimpleNamespace(block="element_beam8", element="beam8")
    supply_elements([beam], tools_for("auto", "float64", None, "off", "none"))
    found = elements.kernels("element_beam8")
    assert found.mass(q=q) == pytest.approx(expected[0], rel=1e-13)
    assert found.geometric(q=q) == pytest.approx(expected[1], rel=1e-13)


def test_an_unknown_element_is_refused(cantilever):
    with pytest.raises(SceneError, match="stretch7"):
        resolve(symgen.Scene(**tomllib.loads(CANTILEVER.replace("stretch7", "stretch8"))))


# --- methods --------------------------------------------------------------------------------------------------


class PendulumTable(Table):
    """A point mass on a massless rod, which hangs from the origin at an angle from the x axis."""

    length: Value
    mass: Value
    angle: Value


class Pendulum(Linkage):
    """The linkage of such a scene."""

    __slots__ = ()
    method = "pendulum"


def resolved_pendulum(scene):
    """Return the linkage that the table of a pendulum stands for."""
    tables, own = scene.model_dump(exclude={"pendulum"}, exclude_unset=True), scene.pendulum
    place = [f"length*{f}(angle)" for f in ("cos", "sin")]
    tables["parameters"] = {"length": own.length, "angle": own.angle, **tables.get("parameters", {})}
    tables["points"] = {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": place}}
    tables["links"] = {"rod": {"points": ["O", "A"], "mass": "0 kg"}}
    tables["masses"] = [{"point": "A", "mass": own.mass}]
    linkage = resolved_linkage(symgen.Scene(**tables).called(scene.name, scene.file))
    return Pendulum(**{f.name: getattr(linkage, f.name) for f in fields(linkage)})


class PendulumView(RodsView):
    """What its page shows."""

    def facts(self, resolved, model):
        return (Fact("swings on", resolved.link("rod").name), *super().facts(resolved, model))


PENDULUM_METHOD = replace(
    METHODS["rods"],
    name="pendulum",
    claims=("pendulum",),
    schema=f"{__name__}:PendulumTable",
    resolve=f"{__name__}:resolved_pendulum",
    view=f"{__name__}:PendulumView",
)

SWING = """
symgen = 1
title = "Pendulum"
[pendulum]
length = "0.7 m"
mass = "2 kg"
angle = "-0.4 rad"
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
[analysis]
t_end = "1 s"
outputs = ["A.position", "O.reaction", "energy"]
"""


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(METHODS, "pendulum", PENDULUM_METHOD)
        path = written(tmp_path_factory.mktemp("swings"), SWING, "swing")
        yield SimpleNamespace(path=path, model=symgen.build(path))


def test_a_method_runs_and_conserves_energy(swing):
    run = swing.model.simulate(rtol=1e-10, atol=1e-10, samples=11)
    times = np.linspace(0, 1, 11)
    exact = solve_ivp(
        lambda t, y: [y[1], -9.81 / 0.7 * np.cos(y[0])],
        (0, 1),
        [-0.4, 0],
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-12,
    )
    along = np.column_stack([np.cos(exact.y[0]), np.sin(exact.y[0])])
    assert run["A.position"].values == pytest.approx(0.7 * along, abs=1e-8)
    radial = 2 * (0.7 * exact.y[1] ** 2 - 9.81 * along[:, 1])
    assert run["O.reaction"].values == pytest.approx(-radial[:, None] * along, abs=1e-6)
    assert run["energy"].values == pytest.approx(2 * 9.81 * 0.7 * np.sin(-0.4), abs=1e-8)
    assert run.drift.energy < 1e-8


def test_a_method_has_equilibria_and_inverse_dynamics(swing):
    assert swing.model.equilibrium().state.positions["A"] == pytest.approx([0, -0.7], abs=1e-8)
    driven = SWING.replace("[analysis]", '[[drivers]]\nlink = "rod"\nangle = "-0.4 + t*w"\n[analysis]')
    driven = driven.replace("[pendulum]", '[parameters]\nw = "1.5 rad/s"\n[pendulum]')
    angles = np.array([-0.3, 0.2, 0.8])
    found = symgen.build(symgen.Scene(**tomllib.loads(driven))).inverse_dynamics(at=angles)
    assert found["rod.torque"].values == pytest.approx(2 * 9.81 * 0.7 * np.cos(angles), abs=1e-9)


def test_a_method_is_in_explanations_pages_and_exports(swing, tmp_path):
    assert "1 degree of freedom" in "\n".join(explanation(swing.path, {}))
    page = render(scene_page(read_scene(swing.path), speed=False, progress=lambda _: None))
    assert "swings on" in page
    checked_export(swing.path, tmp_path / "swing")


def test_without_its_row_a_scene_has_no_such_table(swing):
    with pytest.MonkeyPatch.context() as patch:
        patch.delitem(METHODS, "pendulum")
        with pytest.raises(SceneError, match="unknown key 'pendulum'"):
            symgen.Scene(**tomllib.loads(SWING))


def test_the_schema_for_editors_has_tables_that_methods_add(swing):
    schema = symgen.Scene.model_json_schema()
    assert "pendulum" in schema["properties"] and {"required": ["pendulum"]} in schema["anyOf"]
    with pytest.MonkeyPatch.context() as patch:
        patch.delitem(METHODS, "pendulum")
        assert '"pendulum": {' not in CliRunner().invoke(app, ["schema"]).output
    assert '"pendulum": {' in CliRunner().invoke(app, ["schema"]).output


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"claims": ("masses",)}, "the method 'pendulum' adds the table 'masses' to scenes, which have"),
        ({"claims": ("springs",)}, "the method 'pendulum' adds the table 'springs'"),
        ({"claims": ()}, "the method 'pendulum' has a schema and claims no table"),
    ],
)
def test_a_method_cannot_replace_a_table(changes, message):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(METHODS, "pendulum", replace(PENDULUM_METHOD, **changes))
        with pytest.raises(ModelError, match=message):
            symgen.Scene(**tomllib.loads(SWING))


def test_a_load_cannot_replace_a_table():
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(LOADS, "masses", Drag)
        with pytest.raises(ModelError, match="the load kind 'drag' adds the table 'masses'"):
            symgen.Scene(**tomllib.loads(PENDULUM))
    symgen.Scene(**tomllib.loads(PENDULUM))


def test_two_methods_cannot_add_one_table():
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(METHODS, "pendulum", PENDULUM_METHOD)
        patch.setitem(METHODS, "other", replace(PENDULUM_METHOD, name="other"))
        with pytest.raises(ModelError, match="the method 'other' adds the table 'pendulum'"):
            symgen.Scene(**tomllib.loads(SWING))


def test_the_kernels_of_an_element_are_compared_with_exact_arithmetic(cantilever):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(ELEMENTS, "stretch7", STRETCH)
        found = accuracy(cantilever.path, states=2)
    own = [o for o in found.outputs if o.kernel.startswith("element_stretch7.")]
    assert own and all(o.verdict != "code" for o in own)
