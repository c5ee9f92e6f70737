"""Recorded outputs of a loop: pruned kernels, and clear errors for unknown names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from shared.loop_scenes import freed
from shared.loops import body, planar_4r, real, slider_crank, variable

import symgen
from symgen.errors import SceneError
from symgen.models.loop.system import loop_system
from symgen.runtime import _core
from symgen.scene.rods.run_parameters import Parameter
from symgen.symbolic.quantity import quantity


def kernels(system):
    return {e.kernel: e.matrices for e in system.exports}


def test_motions_alone_generate_no_dynamics():
    asked = ("S4", "S4.rate", "rod.velocity", "rod.angular_acceleration", "slider.position")
    system = loop_system(slider_crank(outputs=asked))
    assert set(kernels(system)) == {"inputs", "position", "motion", "rows", "outputs"}
    assert kernels(system)["outputs"] == asked
    assert "inverse_efforts" not in system and "rod_momentum" not in system


def test_energies_need_masses_but_no_forces():
    system = loop_system(slider_crank(outputs=["kinetic_energy", "rod.centre"]))
    assert "inverse" not in kernels(system) and "rod_momentum" in system


def test_forces_in_ground_axes_accelerate_the_rod():
    """Newton's law in the first frame, with the acceleration of the centre by central differences."""
    forces = ["rod.joint2.force_in_ground", "rod.joint3.force_in_ground"]
    model = symgen.build(
        "slider_crank", set={"analysis.outputs": [*forces, "rod.centre", "rod.joint2.force"]}
    )
    step, mid = 1e-4, 0.3
    run = model.inverse_dynamics(at=mid + step * np.arange(-2, 3), over="time")
    before, at, after = run["rod.centre"].values[[0, 2, 4]]
    acceleration = (before - 2 * at + after) / (2 * step) ** 2
    mass = 0.28 * np.pi * 50 / 386.4 * 175.12683525  # of a steel cylinder, from lbf s^2/in to kg
    total = sum(run[name].values[2] for name in forces)
    assert total == pytest.approx(mass * acceleration, abs=1e-5 * np.linalg.norm(total))
    own, turned = run["rod.joint2.force"].values[2], run[forces[0]].values[2]
    assert np.linalg.norm(own) == pytest.approx(np.linalg.norm(turned)) and np.ptp(own - turned) > 1.0


def test_by_default_everything_is_recorded():
    system = loop_system(slider_crank())
    found = kernels(system)["outputs"]
    assert found[:3] == ("theta1", "theta1.rate", "theta1.acceleration")
    assert [n for n in found if n.endswith(".drive")] == ["theta1.drive", "S1.drive"]
    forces = [n for n in found if n.endswith(".force")]
    assert forces == ["crank.joint1.force", "rod.joint2.force", "slider.joint3.force", "ground.joint4.force"]
    assert set(kernels(system)) >= {"inverse", "given", "energy"}
    assert kernels(system)["inverse"] == ("inverse_efforts",), "nothing is free"


def test_without_masses_and_loads_motions_are_recorded_by_default():
    bare = replace(slider_crank(), bodies=())
    system = loop_system(bare)
    assert set(kernels(system)) == {"inputs", "position", "motion", "rows", "outputs"}
    assert not [n for n in kernels(system)["outputs"] if "joint" in n or "drive" in n]


def test_a_link_without_mass_where_a_force_is_asked():
    crank, _, slider = slider_crank().bodies
    bare = replace(slider_crank(), bodies=(crank, slider), outputs=("S4", "crank.joint1.force"))
    with pytest.raises(SceneError) as caught:
        loop_system(bare)
    assert caught.value.where == "loop.links.rod.mass"
    for word in ("'rod'", "row 2", "'crank.joint1.force'", "0 kg"):
        assert word in str(caught.value)
    massless = body("rod", 1, 0)
    light = loop_system(replace(bare, bodies=(crank, massless, slider)))
    assert "link rod: it has no mass, so no inertia" in light.left_out
    assert list(light["rod_inertia_wrench"].matrix) == [0] * 6


def test_free_variables_need_masses():
    made = slider_crank()
    free = tuple(replace(v, role="free") if v.name == "theta1" else v for v in made.variables)
    with pytest.raises(
        SceneError, match="'crank', which row 1 ends on, has no mass, and the motion of the free"
    ):
        loop_system(replace(made, variables=free, bodies=made.bodies[1:], outputs=("S4",)))
    system = loop_system(replace(made, variables=free, outputs=("S4",)))
    assert {"inverse", "given", "energy"} <= set(kernels(system))
    assert kernels(system)["inverse"] == ("inverse_efforts", "mass_matrix")


@pytest.mark.parametrize(
    "name, hint",
    [
        ("theta5", "theta"),
        ("theta1.speed", "theta1.rate"),
        ("S4.force", "S4.drive"),
        ("crank.joint3.force", "crank.joint"),
        ("rod.joint2.torque", "rod.joint"),
        ("ground.position", "Did you mean"),
        ("work", "The nearest of"),
    ],
)
def test_unknown_outputs_are_refused_with_what_is_near(name, hint):
    with pytest.raises(SceneError) as caught:
        loop_system(slider_crank(outputs=["S4", name]))
    assert caught.value.where == "analysis.outputs.1"
    assert f"there is no output {name!r}" in str(caught.value) and hint in str(caught.value)


def test_an_output_is_asked_for_once():
    with pytest.raises(SceneError, match="'S4' is listed twice"):
        loop_system(slider_crank(outputs=["S4", "theta2", "S4"]))


def test_screw_rates_only_where_a_load_is_to_be_found():
    assert "screw_rates" in kernels(loop_system(slider_crank(load_given=False)))["motion"]
    assert "screw_rates" not in kernels(loop_system(slider_crank()))["motion"]
    assert "screw_rates" not in kernels(loop_system(slider_crank(False, outputs=["S4"])))["motion"]


def test_nothing_is_divided():
    """No kernel divides, so no regular pose can make a denominator vanish; and none takes a root or an arc."""
    for make in (slider_crank, planar_4r):
        system = loop_system(make())
        expressions = [d.expression for d in system.definitions] + [
            e for m in system.matrices for e in m.matrix
        ]
        for e in expressions:
            assert {f.func for f in e.atoms(sp.Function)} <= {sp.sin, sp.cos}
            assert all(p.exp.is_Integer and p.exp > 0 for p in e.atoms(sp.Pow) if not p.is_number), e


def test_steps_of_the_derivation_can_be_inspected():
    system = loop_system(slider_crank(outputs=["S4.drive"]))
    for name in ("row_1_transform", "closure_defect", "screws", "joint_3_wrench"):
        assert name in system
    for link in ("crank", "rod", "slider"):
        for step in ("frame", "motion", "motion_rate", "momentum", "inertia_wrench"):
            assert system[f"{link}_{step}"].matrix.rows in (3, 6)


def renamed(name, other):
    """The slider-crank with a variable called otherwise."""
    made = slider_crank()
    symbols = {real(f"{name}{end}"): real(f"{other}{end}") for end in ("", "_rate", "_acceleration")}
    rows = tuple(
        replace(r, **{e: getattr(r, e).xreplace(symbols) for e in ("theta", "S", "eta", "alpha", "a")})
        for r in made.rows
    )
    row = next(v.row for v in made.variables if v.name == name)
    new = variable(other, row, "input", "rad")
    return replace(made, rows=rows, variables=tuple(new if v.name == name else v for v in made.variables))


@pytest.mark.parametrize("name", ["power", "screws", "rows", "rod_frame", "energy"])
def test_a_variable_is_not_called_like_something_derived(name):
    with pytest.raises(SceneError, match=f"'{name}' is reserved for") as caught:
        loop_system(renamed("theta1", name))
    assert caught.value.where == f"loop.inputs.{name}"


def test_intermediates_give_way_to_names_of_the_scene():
    """A parameter that is called like an intermediate changes nothing."""
    taken = {"sin_theta2": ("m", 1), "f_joint_x": ("m", 2), "i_theta2_x": ("m", 3)}
    made = slider_crank()
    more = tuple(Parameter(quantity(n, unit, n), sp.Integer(v)) for n, (unit, v) in taken.items())
    system = loop_system(replace(made, parameters=(*made.parameters, *more)))
    names = {d.quantity.name for d in system.definitions}
    assert {"sin_theta2_", "i_theta2_x_"} <= names and not names & set(taken)


@pytest.mark.parametrize("name", ["bennett", "rssr"])
def test_results_of_runs_are_computed_when_they_are_read(name, monkeypatch):
    """The first run finds the start; the next takes its steps alone, and other runs do not change its results."""
    model = symgen.build(symgen.Scene(**freed(name, 0.5, 3.0)))
    first = model.simulate(0.2, samples=5)
    expected = {v.name: v.values.copy() for v in first.variables}, first.final, first.notes
    called = []
    for of in ("evaluate", "call_many"):
        kernel = getattr(_core, of)
        monkeypatch.setattr(_core, of, lambda *x, kernel=kernel, of=of: called.append(of) or kernel(*x))
    run = model.simulate(0.2, samples=5)
    again = model.simulate(0.2, samples=5)
    assert not called and run.final == expected[1] and again.drift == first.drift and not called
    model.simulate(0.1, samples=3)
    assert run.notes == expected[2]
    assert bool(run.notes) == bool(run.statistics["undetermined"]) == (name == "bennett")
    for v in run.variables:
        np.testing.assert_array_equal(v.values, expected[0][v.name], v.name)
    assert called.count("call_many") >= 1


def test_powers_of_drives_are_those_of_their_laws_and_add_up():
    """A motor whose torque falls with its speed, a spring with a damper, and a pump."""
    moved = [f"{v}{w}" for v in ("theta1", "S1", "S4") for w in (".rate", ".power")]
    run = symgen.build("cssp", set={"analysis.outputs": ["S1", *moved, "power"]}).simulate(0.5)
    place, turned, slid, pumped = (run[n].values for n in ("S1", "theta1.rate", "S1.rate", "S4.rate"))
    top = 10 * np.pi
    assert run["theta1.power"].values == pytest.approx(12 * (1 - turned / top) * turned, abs=1e-10)
    assert run["S1.power"].values == pytest.approx(-(4000 * place + 30 * slid) * slid, abs=1e-10)
    assert run["S4.power"].values == pytest.approx(-40 * pumped**2, abs=1e-10)
    total = sum(run[f"{v}.power"].values for v in ("theta1", "S1", "S4"))
    assert total == pytest.approx(run["power"].values, abs=1e-10)


def test_the_power_of_the_drives_of_a_driven_loop_is_the_rate_of_its_energy():
    model = symgen.build("rssr", set={"analysis.outputs": ["theta1.power", "energy"]})
    step = 1e-4
    weights = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / step
    for middle in (0.01, 0.05, 0.13):
        run = model.inverse_dynamics(at=middle + step * np.arange(-4, 5), over="time")
        energy = run["energy"].values
        scale = np.ptp(energy) / step
        assert run["theta1.power"].values[4] == pytest.approx(weights @ energy, abs=1e-8 * scale)
