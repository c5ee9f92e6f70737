"""User-defined systems that move, against SciPy's integration, closed forms and the same linkage as a scene."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from rich.console import Console
from scipy.integrate import solve_ivp

import symgen
from symgen.errors import CapabilityError, DerivationError, ModelError, SceneError, SymgenError
from symgen.models.general.equations import GeneralEquations, general_system_of
from symgen.models.general.system import general_system
from symgen.report.motion import print_result
from symgen.scene.rods.linkage import TIME
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System

SHARED = Path(__file__).parent.parent / "shared"
#: Parameters and start of ``double_pendulum.py``.
LENGTH, GRAVITY, START = 0.5, 9.81, (1.0, 0.0, 0.0, 0.5)
#: Those of ``crank_in_angles.py``.
CRANK, ROD, TURNING, MASS, SPEED, PUSH = 0.1, 0.3, 0.002, 2.0, 10.0, 3.0


@pytest.fixture(scope="module")
def pendulum():
    """The double pendulum in angles."""
    return symgen.build(SHARED / "double_pendulum.py")


@pytest.fixture(scope="module")
def crank():
    """The slider-crank in angles, driven."""
    return symgen.build(SHARED / "crank_in_angles.py")


def textbook(t, y, damping=0.0, mass=1.5):
    """Rates of the double pendulum with equal masses and rods, solved for the second rates by hand."""
    a, b, v, w = y
    d, of = a - b, 2 - np.cos(a - b) ** 2
    turning = damping * v / (mass * LENGTH**2)
    first = -2 * GRAVITY / LENGTH * np.sin(a) - np.sin(d) * w**2 - turning
    second = -GRAVITY / LENGTH * np.sin(b) + np.sin(d) * v**2
    return v, w, (first - np.cos(d) * second) / of, (2 * second - np.cos(d) * first) / of


def reference(t_end, start=START, **more):
    """Return the state of the pendulum at a time by SciPy."""
    run = solve_ivp(textbook, (0, t_end), start, "DOP853", rtol=1e-12, atol=1e-12, args=tuple(more.values()))
    return run.y[:, -1]


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"rtol": 1e-11, "atol": 1e-12}, 1e-9),
        ({"rtol": 1e-10, "atol": 1e-11, "method": "radau5"}, 1e-8),
        ({"step": 2e-4, "method": "rattle"}, 2e-6),
    ],
)
def test_motion_is_that_of_the_textbook(pendulum, options, error):
    run = pendulum.simulate(2.0, **options)
    found = [run[name].values[-1] for name in ("theta1", "theta2", "omega1", "omega2")]
    assert np.max(np.abs(found - reference(2.0))) < error
    assert run.drift.energy < 10 * error * run.drift.energy_exchanged
    height = -LENGTH * (np.cos(found[0]) + np.cos(found[1]))
    assert abs(run["height"].values[-1] - height) < 1e-14
    assert np.allclose(run.final["B"]["position"], run["B.position"].values[-1], atol=1e-14)


def test_motion_is_that_of_the_scene(pendulum):
    """The same pendulum by points and rods."""
    across, down = float(LENGTH * np.sin(1.0)), float(LENGTH * np.cos(1.0))
    scene = {
        "points": {
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": [f"{across!r} m", f"{-down!r} m"]},
            "B": {"at": [f"{across!r} m", f"{-down - LENGTH!r} m"]},
        },
        "links": {
            "upper": {"points": ["O", "A"], "mass": "0 kg", "length": f"{LENGTH} m"},
            "lower": {"points": ["A", "B"], "mass": "0 kg", "length": f"{LENGTH} m"},
        },
        "masses": [{"point": point, "mass": "1.5 kg"} for point in "AB"],
        "gravity": {"acceleration": ["0 m/s^2", f"{-GRAVITY} m/s^2"]},
        "start": {"rates": {"upper": "0 rad/s", "lower": "0.5 rad/s"}},
    }
    rods = symgen.build(symgen.Scene(**scene)).simulate(1.0, rtol=1e-11, atol=1e-12)
    angles = pendulum.simulate(1.0, rtol=1e-11, atol=1e-12)
    for point in "AB":
        for of in ("position", "velocity"):
            assert np.allclose(rods.final[point][of], angles.final[point][of], atol=2e-9), (point, of)


def test_damping_is_power(pendulum):
    run = pendulum.with_parameters(c=0.4).simulate(2.0, rtol=1e-11, atol=1e-12)
    found = [run[name].values[-1] for name in ("theta1", "theta2", "omega1", "omega2")]
    assert np.max(np.abs(found - reference(2.0, damping=0.4))) < 1e-9
    energies = run["energy"].values
    dissipated = 0.4 * np.trapezoid(run["omega1"].values ** 2, run.time)
    assert abs(energies[0] - energies[-1] - dissipated) < 1e-3 * dissipated
    assert run.drift.energy < 1e-8 * run.drift.energy_exchanged


def test_events_are_located(pendulum):
    passing = pendulum.simulate(2.0, rtol=1e-11, atol=1e-12).events
    assert [e.name for e in passing] == ["upright"] * len(passing) and len(passing) >= 2
    for event in passing:
        assert abs(reference(event.time)[1]) < 1e-8


def test_equilibrium_modes_and_linearisation(pendulum):
    rest = pendulum.equilibrium()
    assert rest.stability == "stable" and np.allclose(rest.state.q, 0, atol=1e-12)
    omegas = np.sqrt(GRAVITY / LENGTH * (2 + np.array([-1.0, 1.0]) * np.sqrt(2)))
    modes = pendulum.modes()
    assert np.allclose([m.omega for m in modes], omegas, rtol=1e-12)
    for mode, sign in zip(modes, (1, -1), strict=True):
        assert abs(mode.shape["theta2"] / mode.shape["theta1"] - sign * np.sqrt(2)) < 1e-12
    state = pendulum.state({"theta1": 0.3, "theta2": -0.4}, {"theta1": 1.0, "theta2": 2.0})
    y, h = np.array([0.3, -0.4, 1.0, 2.0]), 1e-6
    slopes = [
        (np.array(textbook(0, y + h * e)) - np.array(textbook(0, y - h * e))) / (2 * h) for e in np.eye(4)
    ]
    assert np.allclose(pendulum.linearise(at=state).A, np.transpose(slopes), atol=1e-7)


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_derivatives_of_a_run(pendulum, method):
    how = {"t_end": 1.0, "rtol": 1e-11, "atol": 1e-12, "method": method}
    found = pendulum.sensitivity(["height", "omega1"], ["g", "c"], **how)
    h, expected = 1e-5, np.zeros((2, 2))
    for column, name in enumerate(("g", "c")):
        ends = []
        for value in (-h, h):
            changed = pendulum.with_parameters(**{name: {"g": GRAVITY, "c": 0.0}[name] + value})
            run = changed.simulate(1.0, rtol=1e-12, atol=1e-13)
            ends.append(np.array([run["height"].values[-1], run["omega1"].values[-1]]))
        expected[:, column] = (ends[1] - ends[0]) / (2 * h)
    assert np.allclose(found.derivatives, expected, rtol=1e-6)


def closed(angle, rate):
    """Stroke, speed and acceleration of the slider, rod angle and its rate, at a constant rate of the crank."""
    phi = -np.arcsin(CRANK / ROD * np.sin(angle))
    turning = -CRANK * np.cos(angle) * rate / (ROD * np.cos(phi))
    second = (CRANK * np.sin(angle) * rate**2 + ROD * np.sin(phi) * turning**2) / (ROD * np.cos(phi))
    stroke = CRANK * np.cos(angle) + ROD * np.cos(phi)
    speed = -CRANK * np.sin(angle) * rate - ROD * np.sin(phi) * turning
    along = -CRANK * np.cos(angle) * rate**2 - ROD * np.cos(phi) * turning**2 - ROD * np.sin(phi) * second
    return stroke, speed, along, phi, turning, second


def test_start_meets_the_constraints(crank):
    state = crank.initial_state()
    stroke, speed, _, phi, turning, _ = closed(0.5, SPEED)
    assert np.allclose(state.q, [0.5, phi, stroke], atol=1e-14)
    assert np.allclose(state.u, [SPEED, turning, speed], atol=1e-13)


def test_driven_motion_and_multipliers(crank):
    motion, run = crank.kinematics(samples=7), crank.simulate(1.0, rtol=1e-11, atol=1e-12)
    for angle, stroke, speed in zip(
        0.5 + SPEED * motion.time, motion["s"].values, motion["s_v"].values, strict=True
    ):
        assert np.allclose([stroke, speed], closed(angle, SPEED)[:2], atol=1e-13)
    assert abs(run["s"].values[-1] - closed(10.5, SPEED)[0]) < 1e-13
    assert run.drift.energy < 1e-8 * run.drift.energy_exchanged
    # Virtual work of the inertia and of the push: the multiplier of the drive is minus its torque.
    _, speed, along, _, turning, second = closed(0.5, SPEED)
    torque = ((MASS * along - PUSH) * speed + TURNING * second * turning) / SPEED
    assert abs(-crank.accelerations().multipliers["drive"] - torque) < 1e-12 * abs(torque)


def rod_in_xy(folder, centre, values):
    """A pendulum of length 1 m about (centre, 0) in x and y, with these values of coordinates."""
    file = folder / f"rod_{len(list(folder.iterdir()))}.py"
    file.write_text(f"""
import sympy as sp
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Group, NamedMatrix, System

x, y, length = quantity("x", "m", "across"), quantity("y", "m", "up"), quantity("l", "m", "length")


def system():
    rod = (x.symbol - sp.Rational("{centre}")) ** 2 + y.symbol**2 - length.symbol**2
    return System(
        name="rod",
        title="A rod in x and y",
        groups=(Group("q", "place", (x, y)), Group("p", "parameters", (length,))),
        matrices=(
            NamedMatrix("mass_matrix", sp.eye(2).as_immutable(), "kg", "masses"),
            NamedMatrix("force", sp.ImmutableMatrix([0, -9.81]), "N", "weight"),
            NamedMatrix("constraints", sp.ImmutableMatrix([rod]), "m^2", "rod", ("rod",)),
        ),
        exports=(),
        values={{"l": 1.0, **{values!r}}},
    )
""")
    return symgen.build(file)


def test_given_coordinates_are_held_at_the_start(tmp_path):
    model = rod_in_xy(tmp_path, "1/10", {"y": -0.6})
    assert np.allclose(model.initial_state().q, [0.1 - 0.8, -0.6], atol=1e-14)
    assert not model.simulate(0.1).notes
    longer = model.with_parameters(l=0.75)
    assert np.allclose(longer.initial_state().q, [0.1 - 0.45, -0.6], atol=1e-14)
    runs = model.simulate_many({"l": [1.0, 0.75]}, t_end=0.01)
    assert np.allclose(runs["x"].values[:, 0], [-0.7, -0.35], atol=1e-14)


def test_values_that_contradict_constraints_move_with_a_note(tmp_path, crank):
    model = rod_in_xy(tmp_path, "0", {"x": 0.3, "y": -0.4})
    assert np.allclose(model.initial_state().q, [0.6, -0.8], atol=1e-14)
    (note,) = model.simulate(0.1).notes
    assert note.endswith("the nearest pose: x from 0.3 to 0.6 m, y from -0.4 to -0.8 m")
    assert not model.with_parameters(l=0.5).simulate(0.1).notes
    (note,) = rod_in_xy(tmp_path, "0", {"y": -0.6}).simulate(0.1).notes
    assert note.endswith("y from -0.6 to -1 m, since x cannot follow from zero: give a value")
    (note,) = crank.simulate(0.1).notes
    assert "theta" not in note and "phi from -0.1 to -0.160" in note and "s from 0.4 to 0.38" in note
    with pytest.raises(SceneError, match="still misses the constraint rod by 1\n"):
        rod_in_xy(tmp_path, "0", {})


def test_solutions_are_refined_where_inertias_differ(tmp_path):
    """With a rod of a millionth of the other inertias, whose pivot is eliminated first."""
    file = tmp_path / "light_rod.py"
    file.write_text((SHARED / "crank_in_angles.py").read_text().replace('"I": 0.002', '"I": 1e-9'))
    model = symgen.build(file)
    assert "residual" in model.operations
    found, (*_, along, _, _, second) = model.accelerations(), closed(0.5, SPEED)
    forces = MASS * along - PUSH
    assert abs(found.multipliers["x"] - forces) < 1e-12 * abs(forces)
    drive = (forces * closed(0.5, SPEED)[1] + 1e-9 * second * closed(0.5, SPEED)[4]) / SPEED
    assert abs(-found.multipliers["drive"] - drive) < 1e-12 * abs(drive)


def test_lanes_and_sweeps(crank):
    runs = crank.sweep(
        {"push": [0.0, 3.0], "l": [0.3, 0.4]}, analysis="simulate", t_end=0.3, reduce=["final"]
    )
    for push, length, stroke in zip(
        runs["push"].values, runs["l"].values, runs["s.final"].values, strict=True
    ):
        one = crank.with_parameters(push=push, l=length).simulate(0.3)
        assert abs(stroke - one["s"].values[-1]) < 1e-10


def test_kernels_agree_with_the_matrices_at_40_digits():
    from symgen.study.accuracy.accuracy import accuracy

    for name in ("double_pendulum", "crank_in_angles"):
        found = accuracy(SHARED / f"{name}.py", states=2)
        assert {"accelerations", "constraints"} & {o.kernel for o in found.outputs}
        assert all(o.of_largest < 1e-12 or o.beyond_largest < 4 for o in found.outputs), found.worst


def test_pictures(pendulum, tmp_path):
    pendulum.simulate(1.0).animate(tmp_path / "moving.html")
    assert "Double pendulum" in (tmp_path / "moving.html").read_text()
    assert "path" in pendulum.draw(at=[0.0, 0.5], over="time").svg()


def test_without_points_there_is_no_picture(crank):
    with pytest.raises(ModelError, match="Add a matrix 'positions'"):
        crank.simulate(0.1).animate()


X, V = quantity("x", "m", "place"), quantity("v", "m/s", "speed")
K = quantity("k", "N/m", "stiffness")


def oscillator(**changes):
    """A System with one coordinate."""
    entries = {"mass_matrix": [[2]], "force": [[-K.symbol * X.symbol]]} | changes.pop("matrices", {})
    exports = changes.pop("exports", ())
    made = System(
        name="oscillator",
        title="Oscillator",
        groups=(Group("q", "place", (X,)), Group("u", "speed", (V,)), Group("p", "parameters", (K,))),
        matrices=tuple(
            NamedMatrix(name, sp.ImmutableMatrix(rows), "SI", name) for name, rows in entries.items() if rows
        ),
        exports=exports,
        values={"k": 8.0, "x": 0.1},
    )
    return replace(made, **changes)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"values": {"x": 1.0}}, "the parameter k has no value"),
        ({"values": {"k": 1.0, "y": 1.0}}, "there is no 'y'"),
        ({"values": {"k": "8 N/m"}}, "expected a finite number in SI units for k, got '8 N/m'"),
        ({"values": {"k": float("nan")}}, "expected a finite number in SI units for k"),
        ({"values": [8.0]}, "expected values as a mapping"),
        ({"matrices": {"force": None}}, "needs a matrix 'force'"),
        ({"matrices": {"mass_matrix": [[1, 0], [0, 1]]}}, "mass_matrix of 1 x 1, got 2 x 2"),
        ({"matrices": {"mass_matrix": [[2 + V.symbol]]}}, "mass_matrix depends on a rate, v"),
        ({"matrices": {"events": [[1, 2]]}}, "events of 1 x 1, got 1 x 2"),
        ({"matrices": {"positions": [[1, 2]]}}, "the columns x and y"),
        ({"matrices": {"x": [[1]]}}, "'x' is a coordinate or rate and a matrix"),
        ({"matrices": {"power": [[1]]}}, "'power' is the name of what follows"),
        (
            {"matrices": {"own": [[1]]}, "exports": (Export("residual", "own", ("own",)),)},
            "a kernel is called 'residual'",
        ),
    ],
)
def test_incomplete_systems_are_refused(changes, problem):
    with pytest.raises(DerivationError, match=problem):
        general_system_of(oscillator(**changes), "own.py")


def pair(entries, force, **more):
    """A System with two coordinates, y0 and y1, their rates and the time."""
    y, v = ([quantity(f"{name}{i}", "m", f"{name} {i}") for i in range(2)] for name in "yv")
    symbols = {x.name: x.symbol for x in (*y, *v, TIME)}
    matrices = {"mass_matrix": entries, "force": force} | more.pop("matrices", {})
    return System(
        name="pair",
        title="Pair",
        groups=(Group("t", "time", (TIME,)), Group("q", "places", tuple(y)), Group("u", "rates", tuple(v))),
        matrices=tuple(
            NamedMatrix(name, sp.ImmutableMatrix(sp.sympify(rows, symbols)), "SI", name)
            for name, rows in matrices.items()
        ),
        exports=(),
        values={"y0": 0.1},
        **more,
    )


@pytest.mark.parametrize(
    ("mass", "problem"),
    [
        ("[[2, 1], [0, 2]]", r"symmetric mass_matrix, got different entries \(0, 1\) and \(1, 0\)"),
        ("[[1, 1], [1, 1]]", "positive definite mass_matrix"),
        ("[[1, 0], [0, 0]]", "y1 has the mass 0"),
    ],
)
def test_mass_matrices_are_symmetric_and_positive(mass, problem):
    with pytest.raises(DerivationError, match=problem):
        general_system(general_system_of(pair(mass, "[0, 0]"), "own.py"))


def test_time_counts_through_names():
    """A moving constraint and a potential in time, each by a named expression: power and drive."""
    turn = quantity("turn", "m", "moved place")
    named = (Definition(turn, sp.sin(3 * TIME.symbol)),)
    system = pair(
        "[[1, 0], [0, 1]]",
        "[0, 0]",
        definitions=named,
        matrices={"constraints": sp.Matrix([sp.Symbol("y0", real=True) - turn.symbol])},
    )
    model = GeneralEquations(general_system_of(system, "own.py"))
    (drive,) = model.drives
    assert drive.name == "t"
    rate = model.by_time(model.constraints[0].expression)
    known = {d.quantity.symbol: d.expression for d in model.calculus.definitions}
    assert sp.simplify(rate.subs(known).subs(known) + 3 * sp.cos(3 * TIME.symbol)) == 0
    assert model.power.has(model.multipliers["constraint_0"].symbol)


def test_one_sided_damping_has_power():
    """A power that vanishes for rates of one sign is none that vanishes."""
    system = pair("[[1, 0], [0, 1]]", "[-(v0 - Abs(v0)), 0]")
    assert GeneralEquations(general_system_of(system, "own.py")).power != 0


def test_rows_of_vectors_are_outputs(tmp_path):
    file = tmp_path / "vectors.py"
    text = (SHARED / "double_pendulum.py").read_text()
    file.write_text(
        text.replace('("height",)', '("height", "turns")').replace(
            'NamedMatrix("events"',
            'NamedMatrix("turns", sp.ImmutableMatrix([2 * a, b]), "rad", "angles", ("double", "b")),\n'
            '            NamedMatrix("events"',
        )
    )
    run = symgen.build(file).simulate(0.2)
    assert np.allclose(run["turns.double"].values, 2 * run["theta1"].values, atol=1e-14)
    assert np.allclose(run["turns.b"].values, run["theta2"].values, atol=1e-14)


def test_a_changed_file_is_not_taken_for_that_of_a_model(tmp_path):
    """Neither for analyses that are derived later, nor under the name of the equations before."""
    file = tmp_path / "changing.py"
    text = (SHARED / "double_pendulum.py").read_text().replace('"double_pendulum"', '"changing"')
    file.write_text(text)
    omega = symgen.build(file).modes()[0].omega
    file.write_text(text.replace("turning = m", "turning = 2 * m").replace("2 * m * l**2", "3 * m * l**2"))
    symgen.build(file).simulate(0.1)
    file.write_text(text)
    model = symgen.build(file)  # from the cache: the file is not run
    file.write_text(text + "# another\n")
    with pytest.raises(ModelError, match="has changed since the model was built"):
        model.linearise()
    file.write_text(text)
    assert np.min(np.abs(symgen.build(file).linearise(at=symgen.build(file).equilibrium()).poles.imag)) == (
        pytest.approx(omega, rel=1e-12)
    )


def test_parameters_have_units(pendulum):
    file = SHARED / "double_pendulum.py"
    model = symgen.build(file, set={"c": "0.4", "l": "60 cm", "g": 1.6})
    assert (model.parameters["c"], model.parameters["l"], model.parameters["g"]) == (0.4, 0.6, 1.6)
    with pytest.raises(SceneError, match="expected m, got '2 kg'"):
        symgen.build(file, set={"l": "2 kg"})


def test_many_driven_runs_and_starts_that_cannot_be_met(crank, capsys):
    runs = crank.sweep({"l": [0.3, 0.4]}, analysis="kinematics", samples=3, outputs=["s"], reduce=["final"])
    assert np.allclose(runs["s.final"].values[0], closed(10.5, SPEED)[0], atol=1e-12)
    with pytest.raises(SymgenError, match="cannot be assembled"):
        crank.with_parameters(l=0.05, r=0.4).initial_state()
    print_result(crank.simulate(0.1), crank, Console(width=100))
    assert "crank rate" not in capsys.readouterr().err


def test_a_system_without_values_has_kernels_alone(tmp_path):
    file = tmp_path / "own.py"
    text = (SHARED / "double_pendulum.py").read_text()
    file.write_text(text[: text.index("        values=")] + "    )\n")
    with pytest.raises(CapabilityError, match="without values"):
        symgen.build(file).simulate(1.0)


def test_the_example_of_the_documentation_runs(tmp_path):
    text = (SHARED.parent.parent / "docs" / "regeneration.md").read_text()
    file = tmp_path / "pendulum.py"
    file.write_text(text[text.index('"""A pendulum that runs."""') :].partition("```")[0])
    run = symgen.build(file, set={"l": "0.6 m"}).simulate(2.0, rtol=1e-11, atol=1e-12)
    exact = solve_ivp(
        lambda t, y: (y[1], -GRAVITY / 0.6 * np.sin(y[0])), (0, 2), (1, 0), "DOP853", rtol=1e-12, atol=1e-12
    )
    assert abs(run["theta"].values[-1] - exact.y[0, -1]) < 1e-9
    assert run.final["O"]["position"] == [0.0, 0.0]


def test_names_of_coordinates_are_checked(pendulum):
    with pytest.raises(ModelError, match="has no coordinate 'theta'"):
        pendulum.state({"theta": 1.0})
    with pytest.raises(ModelError, match="has no coordinate 'height'"):
        pendulum.linearise(coordinates=["height", "theta1"])
    with pytest.raises(CapabilityError, match="user-defined system"):
        pendulum.inverse_dynamics()
