"""The compiled model as a user meets it: states, parameters, forces, springs, failing runs, results."""

from __future__ import annotations

import json
import operator
from typing import Any

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import (
    ModelError,
    RangeError,
    ResultError,
    SceneError,
    SimulationError,
)


def pendulum(**tables):
    scene = {
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        "links": {"OA": {"points": ["O", "A"], "mass": "2 kg"}},
    }
    return symgen.Scene(**{**scene, **tables})


GRAVITY = {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]}


def test_point_mass_and_rod():
    """a = -g m_total moment / I about the pin: rod m l^2/3, mass M l^2."""
    model = symgen.build(pendulum(gravity=GRAVITY, masses=[{"point": "A", "mass": "3 kg"}]))
    expected = -9.81 * (2 * 0.5 + 3 * 1) / (2 / 3 + 3)
    assert model.accelerations()["A"][1] == pytest.approx(expected, rel=1e-14)


def test_spring_without_mass_of_its_own():
    """A mass on a spring: free point on no rod, period 2 pi sqrt(m/k), energy kept."""
    scene = symgen.Scene(
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["1.5 m", "0 m"]},
            "B": {"at": ["9 m", "0 m"]},
            "C": {"at": ["9 m", "1 m"]},
        },
        links={"BC": {"points": ["B", "C"], "mass": "1 kg"}},
        masses=[{"point": "A", "mass": "4 kg"}],
        springs=[{"between": ["O", "A"], "stiffness": "100 N/m", "length": "1 m"}],
        analysis={"outputs": ["A.position", "energy"]},
    )
    model = symgen.build(scene)
    period = 2 * np.pi * np.sqrt(4 / 100)
    result = model.simulate(period, rtol=1e-12, atol=1e-13)
    assert result.final["A"]["position"][0] == pytest.approx(1.5, abs=1e-10)
    assert result.drift.energy < 1e-11
    half = model.simulate(period / 2, rtol=1e-12, atol=1e-13)
    assert half.final["A"]["position"][0] == pytest.approx(0.5, abs=1e-10)


def test_damper_takes_what_the_energy_loses():
    """With damping the energy itself falls, but energy less the work of the damper is kept."""
    springs = [{"between": ["G", "A"], "stiffness": "50 N/m", "length": "0.5 m", "damping": "3 N*s/m"}]
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": ["1 m", "0 m"]},
        "G": {"at": ["0 m", "-1 m"], "ground": True},
    }
    model = symgen.build(pendulum(points=points, springs=springs, gravity=GRAVITY))
    result = model.simulate(3.0, rtol=1e-11, atol=1e-13)
    energy = result["energy"].values
    assert energy[-1] < energy[0] - 1
    # A swings through G, where the spring turns about in an instant: how well a step meets that is luck.
    assert result.drift.energy < 1e-8


def test_force_that_depends_on_time():
    """A tangential force F sin(w t) on a pinned rod turns it as the integral says (small angles)."""
    forces = [{"point": "A", "force": ["0 N", "0.002*sin(2*pi*t/period)*unit"]}]
    parameters = {"period": "1 s", "unit": "1 N"}
    model = symgen.build(pendulum(forces=forces, parameters=parameters))
    result = model.simulate(1.0, rtol=1e-12, atol=1e-14)
    w = 2 * np.pi
    expected = 0.002 / (2 / 3) * (1 / w)
    assert result.final["A"]["position"][1] == pytest.approx(expected, rel=1e-5)
    assert result.drift.energy < 1e-12


def test_tunable_geometry_moves_the_start():
    points = {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["l", "0 m"]}}
    parameters = {"l": {"value": "1 m", "tunable": True, "about": "length"}}
    model = symgen.build(pendulum(points=points, parameters=parameters, gravity=GRAVITY))
    longer = model.with_parameters(l=2.5)
    assert longer.initial_state().positions["A"].tolist() == [2.5, 0.0]
    assert longer.accelerations()["A"][1] == pytest.approx(-1.5 * 9.81, rel=1e-14)
    assert model.initial_state().positions["A"].tolist() == [1.0, 0.0]


@pytest.mark.parametrize("height", [0.1, 1.4])
def test_ground_that_is_not_where_it_is_drawn_takes_the_linkage_along(height):
    """A rod of 1 m from a ground point that starts so high above where it is drawn."""
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True, "motion": ["0 m", "h*cos(w*t)"]},
        "A": {"at": ["0.6 m", "0.8 m"]},
    }
    parameters = {"h": {"value": f"{height} m", "tunable": True}, "w": "3 rad/s"}
    model = symgen.build(pendulum(points=points, parameters=parameters, gravity=GRAVITY))
    start = model.initial_state()
    reach = start.positions["A"] - start.positions["O"]
    assert start.positions["O"].tolist() == [0.0, height]
    assert np.hypot(*reach) == pytest.approx(1.0, rel=1e-14)
    assert reach[0] > 0
    assert model.simulate(0.2).drift.constraint < 1e-14


@pytest.mark.parametrize("scene", ["peaucellier", "slider_crank", "elastic_slider_crank"])
def test_parameters_are_changed_by_with_parameters_alone(scene):
    """Analyses read them at different times: a change in place reached some and not others."""
    model: Any = symgen.build(scene)
    name = next(iter(model.parameters))
    before = dict(model.parameters)
    for change in (
        lambda: operator.setitem(model.parameters, name, 2.0),
        lambda: operator.delitem(model.parameters, name),
        lambda: model.parameters.update({name: 2.0}),
        lambda: operator.ior(model.parameters, {name: 2.0}),
        model.parameters.clear,
    ):
        with pytest.raises(ModelError, match="with_parameters"):
            change()
    with pytest.raises(AttributeError):
        model.parameters = {name: 2.0}
    assert model.parameters == before
    assert model.with_parameters(**{name: 2.0}).parameters[name] == 2.0


def test_parameters_are_checked():
    model = symgen.build("peaucellier")
    with pytest.raises(
        ModelError, match="no tunable parameter 'roh'. Did you mean 'rho'.*\n.*tunable = true"
    ):
        model.with_parameters(roh=1.0)
    with pytest.raises(ModelError, match="finite number for rho"):
        model.with_parameters(rho=float("nan"))
    with pytest.raises(RangeError, match="mass_per_length: expected a value of at least zero, got -1 kg/m"):
        model.with_parameters(rho=-1.0)
    with pytest.raises(SceneError, match="a mass per length such as .*, got '2 kg', a mass$"):
        symgen.build("peaucellier", set={"rho": "2 kg"})


def test_the_remedy_for_a_parameter_that_is_not_tunable():
    model = symgen.build("four_bar", backend="numpy")
    for call in (
        lambda: model.with_parameters(rho=1.0),
        lambda: model.simulate_many({"rho": [1.0, 2.0]}),
        lambda: model.sensitivity(["A.position"], ["rho"]),
        lambda: model.sweep({"rho": [1.0, 2.0]}),
    ):
        with pytest.raises(ModelError, match=r"'rho'. No parameter of it is tunable.\n.*tunable = true"):
            call()


def test_states_are_checked():
    model = symgen.build("four_bar")
    with pytest.raises(ModelError, match="no point 'D'"):
        model.state({"D": [0, 0]})
    with pytest.raises(ModelError, match="the point B is missing"):
        model.state({"A": [0, 0]})
    with pytest.raises(ModelError, match=r"expected 2 finite numbers \[m\] for A"):
        model.state({"A": [0, 0, 0], "B": [1, 1]})


def test_a_state_off_the_constraints_is_projected():
    model = symgen.build("four_bar")
    state = model.initial_state()
    moved = {p: state.positions[p] + 1e-3 for p in ("A", "B")}
    result = model.simulate(0.1, state=model.state(moved, state.velocities))
    assert result.drift.constraint < 1e-14


def test_singular_start_is_named():
    """A pinned triangle of rods: rigid, and once more braced: redundant."""
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "E": {"at": ["1 m", "0 m"], "ground": True},
        "A": {"at": ["0.5 m", "1 m"]},
        "F": {"at": ["0.5 m", "0 m"], "ground": True},
    }
    links = {f"{g}A": {"points": [g, "A"], "mass": "1 kg"} for g in "OEF"}
    with pytest.raises(SceneError, match=r"3 constraints of rank 2"):
        symgen.build(symgen.Scene(points=points, links=links))


def test_a_drive_past_the_limit_ends_the_run_with_cause_and_partial_result():
    """The crank is driven past the angle at which coupler and rocker are stretched: no such position exists."""
    limit = np.arccos((1 + 4 - 1.4**2) / 4)
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": ["0.9553364891256060 m", "0.2955202066613396 m"]},
        "B": {"at": ["1.6 m", "0.5 m"]},
        "C": {"at": ["2 m", "0 m"], "ground": True},
    }
    links = {
        "OA": {"points": ["O", "A"], "mass": "1 kg"},
        "AB": {"points": ["A", "B"], "mass": "1 kg", "length": "0.8 m"},
        "BC": {"points": ["B", "C"], "mass": "1 kg", "length": "0.6 m"},
    }
    scene = symgen.Scene(
        parameters={"rate": "1 rad/s"},
        points=points,
        links=links,
        drivers=[{"link": "OA", "angle": "0.3 + rate*t"}],
        analysis={"outputs": ["A.position"]},
    )
    for options in ({}, {"step": 1e-4}):
        with pytest.raises(
            SimulationError, match=r"comes to a dead centre(.|\n)*symgen kinematics"
        ) as caught:
            symgen.build(scene).simulate(1.0, **options)
        assert caught.value.time == pytest.approx(limit - 0.3, abs=1e-3)
        partial = caught.value.partial
        assert partial.time[-1] <= caught.value.time
        assert np.all(np.isfinite(partial["A.position"].values))


@pytest.mark.parametrize("length", [0.105, 0.12, 0.153])
def test_dead_centres_have_one_wording_whether_a_pivot_vanishes_or_a_step(length):
    """Coupler and rocker, 20 and 30 cm, are in line at cos(a) = (l^2 + 0.4^2 - 0.5^2)/(2*0.4*l)."""
    sizes = {"links.crank.length": f"{length} m", "links.coupler.length": "20 cm"}
    with pytest.raises(SimulationError) as caught:
        symgen.build("crank_rocker", set=sizes).simulate(1.0)
    angle = np.arccos((length**2 + 0.4**2 - 0.5**2) / (0.8 * length))
    assert caught.value.time == pytest.approx(angle / (2 * np.pi), abs=1e-6)
    words = (
        "the linkage comes to a dead centre, beyond which its drives cannot take it; there the drive of link"
    )
    assert words in str(caught.value)


def test_steps_too_large_are_an_error_not_a_wrong_answer():
    with pytest.raises(SimulationError, match="at t ="):
        symgen.build("triple_pendulum").simulate(10.0, step=0.5)


def test_max_steps_ends_a_run():
    with pytest.raises(SimulationError, match="max_steps, at t = .* after 10 steps"):
        symgen.build("triple_pendulum").simulate(10.0, max_steps=10)


@pytest.mark.parametrize("scene", ["triple_pendulum", full("cssp")])
def test_a_run_that_would_take_more_than_max_steps_is_not_waited_for(scene):
    """Nothing is wrong with its tolerance: what is said is how long the steps are, and what is too few."""
    said = r"too short for the run to come to its end at t = .* at [0-9.e-]+ s a step .* max_steps = 200000\b"
    with pytest.raises(SimulationError, match=said) as error:
        symgen.build(scene).simulate(1e6, max_steps=200_000)
    assert "tolerance cannot be met" not in str(error.value)


def test_progress_is_reported():
    told = []
    symgen.build("triple_pendulum").simulate(5.0, step=1e-4, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0)


@pytest.fixture(scope="module")
def result():
    return symgen.build("four_bar").simulate(1.0, samples=11)


@pytest.mark.parametrize("ending", [".nc", ".npz"])
def test_results_come_back_as_they_were_saved(result, ending, tmp_path):
    file = result.save(tmp_path / f"run{ending}")
    again = symgen.load_result(file)
    assert [p.name for p in tmp_path.iterdir()] == [file.name]
    assert again.time.tobytes() == result.time.tobytes()
    for a, b in zip(again.variables, result.variables, strict=True):
        assert (a.name, a.unit, a.about, a.components) == (b.name, b.unit, b.about, b.components)
        assert np.array_equal(a.values, b.values)
    assert again.drift == result.drift
    assert json.dumps(again.summary()) == json.dumps(result.summary())
    assert again["A.position"].attrs["units"] == "m"


def test_labelled_arrays(result):
    position = result["A.position"]
    assert position.dims == ("time", "axis")
    assert position.sel(axis="x").size == 11
    assert result["energy"].dims == ("time",)
    assert result["crank.tension"].attrs["units"] == "N"
    with pytest.raises(ResultError, match="Did you mean 'A.position'"):
        result["A.positon"]


def test_bad_result_files_are_named(result, tmp_path):
    with pytest.raises(ResultError, match=r"ending in .nc or .npz or .csv for the result, got 'run.txt'"):
        result.save(tmp_path / "run.txt")
    with pytest.raises(ResultError, match="cannot write the result.*no folder"):
        result.save(tmp_path / "no" / "run.nc")
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"not a result")
    with pytest.raises(ResultError, match=r"broken.npz is not a result of symgen.* not a zip file"):
        symgen.load_result(broken)
    for name in ("missing.nc", "missing.npz"):
        with pytest.raises(ResultError, match=f"^cannot read .*{name}: No such file or directory$"):
            symgen.load_result(tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == ["broken.npz"]


def test_plot(result, tmp_path):
    figure = result.plot("A", "energy", file=tmp_path / "run.png")
    assert len(figure.axes) == 2
    assert (tmp_path / "run.png").stat().st_size > 10_000
    with pytest.raises(ResultError, match="holds no 'Z'"):
        result.plot("Z")
    assert result.plot("time").axes[0].get_ylabel() == "time\n[s]"
    of_points, energy = result.plot(["A", "energy"]).axes
    assert len(of_points.get_legend().get_texts()) == len(of_points.lines) > 1
    assert [text.get_text() for text in energy.get_legend().get_texts()] == ["energy"]
    low, high = energy.get_ylim()  # drift is not magnified
    assert np.ptp(result["energy"].values) < 1e-6 * result.drift.energy_exchanged < 1e-5 * (high - low)


@pytest.mark.parametrize("scene", ["crank_rocker", "slider_crank"])
def test_a_plot_without_selected_outputs_has_few_curves_that_vary_and_efforts_first(scene):
    result = symgen.build(scene).inverse_dynamics(samples=19)
    panels = result.plot().axes
    units = [panel.get_ylabel().partition("\n")[2] for panel in panels]
    assert units[0] in ("[N*m]", "[lbf*in]") and {"[N]", "[lbf]"} & {*units[1:3]}
    curves = {line.get_label(): line.get_ydata() for panel in panels for line in panel.lines}
    assert max(len(panel.lines) for panel in panels) <= 8
    assert all(np.ptp(values) > 1e-6 for values in curves.values())
    if scene == "slider_crank":  # whose input rotates at a constant rate
        assert "theta1.drive" in curves and "theta1.rate" not in curves and "eta2" not in curves
    else:  # equal forces at both ends of a joint are one curve, of their magnitude
        size = np.hypot(*result["coupler.A.force"].values.T)
        assert (
            curves["|crank.A.force|"] == pytest.approx(size, rel=1e-12) and "|coupler.A.force|" not in curves
        )


def test_a_plot_over_an_output_with_curves_of_another_result(result):
    slow = symgen.build("four_bar").simulate(0.5, samples=7)
    panel, _ = result.plot("A.position.x", "energy", over="A.position.y", compare={"slow": slow}).axes
    here, there = panel.lines
    for line, of in ((here, result), (there, slow)):
        x, y = line.get_data()
        assert x.tolist() == of["A.position.y"].values.tolist()
        assert y.tolist() == of["A.position.x"].values.tolist()
    assert there.get_label() == "A.position.x, slow" and there.get_linestyle() == "--"
    assert there.get_color() != here.get_color()
    assert [text.get_text() for text in panel.get_legend().get_texts()] == [
        "A.position.x",
        "A.position.x, slow",
    ]
    with pytest.raises(ResultError, match="choose of A.position.x, A.position.y"):
        result.plot(over="A.position")
    (axes,) = result.plot(xy="A", compare={"slow": slow}).axes
    assert axes.lines[2].get_xdata().tolist() == slow["A.position.x"].values.tolist()


def test_the_path_of_a_point_has_equal_axes(result):
    (axes,) = result.plot(xy="A").axes
    x, y = axes.lines[0].get_data()
    assert np.hypot(x, y) == pytest.approx(1.0, abs=1e-9)  # the crank is 1 m long
    assert axes.get_aspect() == 1.0 and axes.get_xlabel() == "A.position.x [m]"
    with pytest.raises(ResultError, match="components x and y for xy, got 'energy'"):
        result.plot(xy="energy")


def test_outputs_equal_what_the_model_says_at_the_state(result):
    model = symgen.build("four_bar")
    found = model.accelerations()
    assert result["O.reaction"].values[0] == pytest.approx(found.reactions["O"], rel=1e-12)
    assert result["crank.tension"].values[0] == pytest.approx(found.multipliers["crank"] * 1.0, rel=1e-12)


def test_equations_of_a_model():
    model = symgen.build("four_bar")
    assert model.equations["mass_matrix"].shape == (4, 4)
    with pytest.raises(ModelError, match="Did you mean 'mass_matrix'"):
        model.equations["mass_matrx"]
    assert "x" in model.equations["constraints"]._repr_latex_()
    assert "four_bar" in repr(model)


@pytest.mark.parametrize(
    "shown, words",
    [
        (lambda: symgen.load_scene("four_bar"), "<Scene 'four_bar': Four-bar linkage"),
        (lambda: symgen.build("four_bar").accelerations(), "<Accelerations of O, A, B, C"),
        (lambda: symgen.build("crank_rocker").assemblies(), "<AssemblyModes: 2, complete>"),
        (lambda: symgen.build("crank_rocker").assemblies()[0], "<State at t = 0 s"),
    ],
)
def test_records_are_shown_in_one_line(shown, words):
    text = repr(shown())
    assert text.startswith(words) and len(text) < 100 and "\n" not in text


def test_statistics_of_elastic_links_are_json():
    statistics = symgen.build("elastic_four_bar").simulate(revolutions=0.01).statistics
    plain = json.loads(json.dumps(statistics))
    assert plain == dict(statistics) == statistics and isinstance(plain["error"], float)
    assert statistics.get("error") == plain["error"] and statistics.get("none") is None
