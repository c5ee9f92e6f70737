"""Every result has one coordinate with its unit, in Python and in files; unmeasured values are absent."""

import io
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import symgen
from symgen.errors import ResultError
from symgen.report.elastic import print_elastic_result, print_speed_response

RPM = math.pi / 30


@pytest.fixture(scope="module")
def results(speed_response):
    crank, elastic = symgen.build("crank_rocker"), symgen.build("thesis_four_bar")
    loop = symgen.build("slider_crank")
    return {
        "run": symgen.build("four_bar").simulate(0.1, samples=5),
        "free loop": symgen.build("cssp").simulate(0.05, samples=5),
        "loop": loop.inverse_dynamics(0.5, 1.5, samples=5),
        "loop at times": loop.inverse_dynamics(at=[0.1, 0.2], over="time"),
        "kinematics": crank.kinematics(samples=5),
        "kinematics at angles": crank.kinematics(at=[0.5, 1.0, 2.0]),
        "forces": crank.inverse_dynamics(at=[0.5, 1.0, 2.0]),
        "forces at times": crank.inverse_dynamics(at=[0.1, 0.2], over="time"),
        "elastic": elastic.quasi_static(samples=5),
        "speed_response": speed_response,
    }


COORDINATES = {
    "run": ("time", "s"),
    "free loop": ("time", "s"),
    "loop": ("theta1", "rad"),
    "loop at times": ("time", "s"),
    "kinematics": ("time", "s"),
    "kinematics at angles": ("crank.angle", "rad"),
    "forces": ("crank.angle", "rad"),
    "forces at times": ("time", "s"),
    "elastic": ("angle", "rad"),
    "speed_response": ("speed", "rad/s"),
}


@pytest.mark.parametrize("kind", COORDINATES)
def test_the_dimension_is_the_coordinate_with_its_unit(results, kind):
    result, (name, unit) = results[kind], COORDINATES[kind]
    assert (result.coordinate.name, result.coordinate.unit) == (name, unit)
    assert result[name].dims == (name,) and result[name].attrs["units"] == unit
    assert name in result and name not in [*result]
    for output in result:
        assert result[output].dims[0] == name and result[output].attrs["units"]
    assert set(result.dataset.dims) <= {name, "axis"}
    assert set(result.dataset.coords) <= {name, "axis", *(["time"] if kind != "speed_response" else [])}


@pytest.mark.parametrize("ending", [".nc", ".npz"])
@pytest.mark.parametrize("kind", COORDINATES)
def test_files_keep_the_coordinate(results, kind, ending, tmp_path):
    result = results[kind]
    result.save(tmp_path / f"result{ending}")
    again = symgen.load_result(tmp_path / f"result{ending}")
    assert type(again) is type(result) and [*again] == [*result]
    assert again.dataset.identical(result.dataset) and again.units == result.units
    assert again.drift.measured == result.drift.measured


def test_values_of_the_coordinates(results):
    """A crank of 50 rpm (slider_crank), 60 rpm (crank_rocker), and one at its scene's speed (elastic)."""
    loop = results["loop"]
    assert loop.coordinate.values == pytest.approx(np.linspace(0.5, 1.5, 5), abs=1e-14)
    assert loop.dataset["time"].values == pytest.approx(loop.coordinate.values / (50 * RPM), abs=1e-14)
    for kind in ("kinematics at angles", "forces"):
        rate = results["kinematics"].variable("crank.angle").values
        rate = np.ptp(rate) / np.ptp(results["kinematics"].time)
        turned = np.diff(results[kind].coordinate.values)
        assert turned == pytest.approx([0.5, 1.0], abs=1e-12)
        assert np.diff(results[kind].time) == pytest.approx(turned / rate, abs=1e-12)
    elastic = results["elastic"]
    speed = symgen.build("thesis_four_bar").crank_speed
    assert elastic.coordinate.values == pytest.approx(
        elastic.coordinate.values[0] + speed * elastic.time, abs=1e-12
    )
    assert results["speed_response"].coordinate.values == pytest.approx([200 * RPM, 300 * RPM], rel=1e-15)
    with pytest.raises(ResultError, match="over crank speed and has no times"):
        _ = results["speed_response"].time


def test_plots_are_labelled_in_degrees_and_rpm(results):
    values, label = results["elastic"].over
    assert label == "crank angle [deg]"
    assert values == pytest.approx(np.degrees(results["elastic"].coordinate.values))
    assert results["speed_response"].over[0] == pytest.approx([200.0, 300.0])
    assert results["speed_response"].over[1] == "crank speed [rpm]"
    assert results["loop"].over[1] == "theta1 [deg]" and results["run"].over[1] == "time [s]"


@pytest.mark.parametrize("kind", ["elastic", "speed_response"])
def test_a_drift_that_was_not_measured_is_nowhere(results, kind):
    result = results[kind]
    assert result.drift.measured == {} and math.isnan(result.drift.relative_energy)
    assert "drift" not in result.headline
    assert result.summary()["drift"] == {}
    assert not json.loads(result.meta())["drift"]
    console = Console(width=100, record=True, file=io.StringIO())
    (print_speed_response if kind == "speed_response" else print_elastic_result)(result, None, console)
    assert "drift" not in console.export_text()
    if kind == "elastic":
        assert not any("drift" in name for name, _ in result.facts)


def test_a_drift_that_was_measured_is_given(results):
    assert set(results["run"].drift.measured) == {"constraint", "velocity", "energy", "energy_exchanged"}
    for kind in ("kinematics", "forces", "loop"):
        assert set(results[kind].drift.measured) == {"constraint", "velocity"}
        assert results[kind].drift.constraint < 1e-12


def test_loops_are_in_si_and_shown_in_the_units_of_the_scene(tmp_path):
    """A crank of 12 in and a rod of 50 in without offsets: S4 is 50 in where the crank stands along it."""
    model = symgen.build("slider_crank").with_parameters(a4=0.0, alpha4=1.5 * math.pi, S1=0.0)
    turn = model.inverse_dynamics(at=[0.0, math.pi / 2])
    expected = np.array([math.sqrt(50**2 - 12**2), 62.0])
    assert turn.variable("S4").unit == "m" and turn["S4"].attrs["units"] == "m"
    assert turn.variable("S4").values == pytest.approx(0.0254 * expected, rel=1e-12)
    (shown,) = (v for v in turn.shown if v.name == "S4")
    assert shown.unit == "in" and shown.values == pytest.approx(expected, rel=1e-12)
    assert turn.variable("theta1.drive").unit == "N*m" and turn.variable("theta2.rate").unit == "rad/s"
    turn.save(tmp_path / "turn.npz")
    again = symgen.load_result(tmp_path / "turn.npz")
    assert [v.unit for v in again.shown] == [v.unit for v in turn.shown]
    assert [axis.get_ylabel() for axis in turn.plot("S4.rate").axes] == ["rate\n[in/s]"]


def test_the_free_coordinates_of_a_loop_end_in_si():
    """Units of cm and degrees in the scene: at the start the crank is at 120 deg with 6 rad/s."""
    start = symgen.build(Path(__file__).parents[2] / "cases" / "free_par.toml").simulate(1e-9, samples=2)
    assert start.final["q"]["unit"] == "rad"
    assert start.final["q"]["value"] == pytest.approx(math.radians(120), abs=1e-8)
    assert start.final["q"]["rate"] == pytest.approx(6.0, abs=1e-6)


def documented():
    """Keys of the table of the JSON in docs/results.md."""
    page = (Path(__file__).parents[3] / "docs" / "results.md").read_text()
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|", page.partition("## JSON")[2], re.M)
    return {key for row in rows for key in re.findall(r"`(\w+)`", row)}


KINDS = {
    "run": "run",
    "free loop": "run",
    "loop": "loop",
    "loop at times": "loop",
    "kinematics": "kinematics",
    "kinematics at angles": "kinematics",
    "forces": "forces",
    "forces at times": "forces",
    "elastic": "elastic",
    "speed_response": "speed_response",
}


@pytest.mark.parametrize("kind", COORDINATES)
def test_the_summary_has_the_documented_keys_and_no_samples(results, kind):
    result = results[kind]
    text = json.dumps(result.summary(), allow_nan=False)
    summary = json.loads(text)
    assert set(summary) == documented() and summary["kind"] == KINDS[kind]
    along = result.coordinate.values
    assert summary["coordinate"]["first"] == along[0] and summary["coordinate"]["last"] == along[-1]
    for v in result.variables:
        for i, component in enumerate(v.components or ("",)):
            found = summary["outputs"][f"{v.name}.{component}" if component else v.name]
            values = v.values.reshape(len(along), -1)[:, i]
            assert found["unit"] == v.unit and found["final"] == values[-1]
            for least, extreme in (("minimum", values.min()), ("maximum", values.max())):
                assert found[least] == extreme
                assert extreme in values[along == found[f"{least}_at"]]
    assert len(text) < 25_000


def test_the_summary_of_poles_has_no_number_in_their_place():
    """The torque is given: at 90 deg no load on the slider balances it."""
    changed = {"loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?"}
    turn = symgen.build("slider_crank", set=changed).inverse_dynamics(at=[math.pi / 2])
    load = json.loads(json.dumps(turn.summary(), allow_nan=False))["outputs"]["S4.drive"]
    assert load["unit"] == "N" and {load[k] for k in load if k != "unit"} == {None}


@pytest.mark.parametrize("scene", ["four_bar", "slider_crank", "elastic_slider_crank", "tumbling_body"])
def test_components_have_the_names_of_tables_and_files(scene, tmp_path):
    model = symgen.build(scene)
    run = model.simulate(samples=3) if hasattr(model, "simulate") else model.inverse_dynamics(samples=3)
    run.save(tmp_path / "run.csv")
    head, *lines = (tmp_path / "run.csv").read_text().splitlines()
    names = [column.rpartition(" [")[0] for column in head.split(",")]
    table = np.array([[float(x) for x in line.split(",")] for line in lines])
    outputs = run.summary()["outputs"]
    assert any(name not in [v.name for v in run.variables] for name in outputs)  # some are components
    for name, entry in outputs.items():
        assert name in run
        assert run[name].values.tolist() == table[:, names.index(name)].tolist()
        assert run[name].attrs["units"] == entry["unit"] and run[name].name == name

    with pytest.raises(ResultError, match="holds no 'A.position.w'"):
        run["A.position.w"]
