"""``symgen sweep`` and the table [sweep]: values with units, keys made tunable, tables, JSON, plots, stores."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError, ResultError, SceneError, SimulationError
from symgen.report.sweeps import plot, summary
from symgen.runtime.sweeps.designs import Normal, Uniform
from symgen.runtime.sweeps.sweep import Sweep
from symgen.scene.loading import read_scene
from symgen.scene.schema import Scene
from symgen.study.sweeps import of_file, of_options, tunable, varied

#: A pendulum that is driven around; the moment of gravity at the crank is mass*g*length/2*cos(angle).
SCENE = """
symgen = 1

[parameters]
length = "50 cm"
speed = "1 rad/s"

[points]
O = { at = ["0 m", "0 m"], ground = true }
P = { at = ["0.5 m", "0 m"] }

[links]
rod = { points = ["O", "P"], length = "length", mass = "2 kg" }

[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]

[[drivers]]
link = "rod"
angle = "speed*t"

[analysis]
t_end = "6.283185307179586 s"

[units]
length = "mm"
torque = "N*mm"

[sweep]
vary = { length = "20 cm:40 cm:3", "links.rod.mass" = ["1 kg", "3 kg"] }
outputs = ["rod.torque"]
samples = 5
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "driven.toml"
    path.write_text(SCENE, encoding="utf-8")
    return str(path)


def command(*arguments):
    done = CliRunner().invoke(app, ["sweep", *map(str, arguments)])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


def test_the_table_of_a_scene_is_carried_out(scene, tmp_path):
    out, picture = tmp_path / "runs.zarr", tmp_path / "map.png"
    shown = command(scene, "--out", out, "--plot", picture)
    runs = xarray.open_zarr(out, consolidated=False, chunks=None)
    grid = [(length, mass) for length in (0.2, 0.3, 0.4) for mass in (1.0, 3.0)]
    found = zip(runs["length"].values, runs["links_rod_mass"].values, strict=True)
    assert [*found] == [pytest.approx(pair) for pair in grid]
    expected = [mass * 9.81 * length / 2 for length, mass in grid]
    assert runs["rod.torque.peak"].values == pytest.approx(expected, rel=1e-12)
    assert (
        f"{3 * 9.81 * 400 / 2:g}" in shown
        and "N*mm" in shown
        and f"wrote {out}" in shown
        and picture.stat().st_size > 1000
    )
    extremes = summary(runs)["outputs"]["rod.torque.peak"]
    assert extremes["greatest"]["value"] == pytest.approx(max(expected))
    assert extremes["greatest"]["parameters"] == pytest.approx({"length": 0.4, "links_rod_mass": 3.0})
    assert extremes["least"]["value"] == pytest.approx(min(expected))


def test_runs_without_a_value_of_an_output_are_counted(tmp_path):
    """A hanging rod swings about a damped hinge only for c < m*sqrt(2/3*g*l^3): two of four runs do not."""
    mass, length, hertz = 1.5, 0.4, []
    scene, critical = tmp_path / "damped.toml", mass * math.sqrt(2 / 3 * 9.81 * length**3)
    scene.write_text(
        f"""
symgen = 1
points.O = {{ at = ["0 m", "0 m"], ground = true }}
points.P = {{ at = ["0 m", "-{length} m"] }}
links.rod = {{ points = ["O", "P"], mass = "{mass} kg" }}
torsion_springs = [{{ link = "rod", stiffness = "0 N*m", damping = "1 N*m*s" }}]
gravity.acceleration = ["0 m/s^2", "-9.81 m/s^2"]
"""
    )
    for share in (0.2, 0.6):
        hertz.append(math.sqrt((1 - share**2) * 1.5 * 9.81 / length) / math.tau)
    values = ",".join(f"{share * critical} N*m*s" for share in (0.6, 1.5, 0.2, 3.0))
    swept = [scene, "--vary", f"torsion_springs.0.damping={values}", "--analysis", "modes"]
    assert "2 of 4 runs have no frequency.1" in command(*swept)
    found = json.loads(command(*swept, "--json"))
    assert found["failed"] == 0 and found["outputs"]["frequency.1"]["without"] == 2
    extremes = [found["outputs"]["frequency.1"][key]["value"] for key in ("greatest", "least")]
    assert extremes == pytest.approx(hertz, rel=1e-9)


def test_a_sweep_of_failures_fails(scene, tmp_path):
    """Its table has the reasons; nothing is drawn."""
    table, picture = tmp_path / "runs.csv", tmp_path / "runs.png"
    with pytest.raises(SimulationError, match="all 2 runs failed, the first: driven: links.rod.mass"):
        command(scene, "--vary", "links.rod.mass=-2 kg,-1 kg", "--out", table, "--plot", picture)
    assert table.read_text().count("links.rod.mass: expected a value of at least zero") == 2
    assert not picture.exists()


def test_options_replace_the_table(scene):
    found = json.loads(command(scene, "--vary", "length=1 m,2 m", "--reduce", "least", "--json"))
    assert found["kind"] == "sweep" and found["runs"] == 2 and found["failed"] == 0
    extremes = found["outputs"]["rod.torque.least"]
    assert extremes["least"]["value"] == pytest.approx(-2 * 9.81, rel=1e-12)
    assert extremes["unit"] == "N*m"
    named = command(scene, "--vary", "length=1 m,2 m", "--analysis", "inverse-dynamics")
    assert "sweep of inverse dynamics, 2 runs" in named
    sampled = json.loads(command(scene, "--vary", "length=1 m:2 m", "--sobol", "4", "--seed", "1", "--json"))
    assert sampled["runs"] == 4


def test_a_list_of_parameters_is_read_from_a_file(scene, tmp_path):
    listed = tmp_path / "list.csv"
    listed.write_text("length [cm],links.rod.mass [g]\n10,500\n20,1000\n", encoding="utf-8")
    found = json.loads(command(scene, "--list", listed, "--json"))["outputs"]["rod.torque.peak"]
    assert found["least"]["value"] == pytest.approx(0.5 * 9.81 * 0.05, rel=1e-12)
    assert found["greatest"]["parameters"] == pytest.approx({"length": 0.2, "links_rod_mass": 1.0})
    for wrong, words in (
        ("length\n1,2\n", "row 2"),
        ("length\n", "no row"),
        ("length\nx\n", "numbers of length"),
    ):
        listed.write_text(wrong, encoding="utf-8")
        with pytest.raises(ModelError, match=words):
            of_file(listed)
    with pytest.raises(ModelError, match="cannot read the list"):
        of_file(tmp_path / "none.csv")


def test_values_are_read_in_their_units(scene):
    vary = {"length": "20 cm:40 cm", "links.rod.mass": "normal(2 kg, 100 g)"}
    model, found, _ = varied(scene, vary)
    assert found == {"length": Uniform(0.2, 0.4), "links_rod_mass": Normal(2.0, 0.1)}
    assert dict(model.parameters) == pytest.approx({"length": 0.5, "links_rod_mass": 2.0})
    text = read_scene(scene)
    text.data["links"]["rod"].pop("length")  # the drawn one
    drawn, names = tunable(text, ["links.rod.length"])
    assert names == {"links.rod.length": "links_rod_length"}
    assert drawn.data["parameters"]["links_rod_length"]["value"] == "0.5 m"


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ({"length": "1 kg:2 kg:3"}, "length"),
        ({"length": "1 m:2 m:x"}, "whole number of values"),
        ({"length": "1 m:2 m:3:4"}, "START:STOP:COUNT"),
        ({"links.rod.points": "1 m:2 m:3"}, "no parameter 'links.rod.points'"),
        ({"nothing": "1 m:2 m:3"}, "no parameter 'nothing'"),
        ({"length": "2 m:1 m"}, "from a lower to a higher"),
    ],
)
def test_wrong_values_are_refused(scene, vary, words):
    with pytest.raises((ModelError, SceneError), match=words):
        varied(scene, vary)


def test_the_end_of_a_run_follows_the_parameters(scene):
    """One revolution at every speed: a scene's end by a parameter that is varied, and that is tuned."""
    text = read_scene(scene)
    text = replace(text, data={**text.data, "analysis": {"t_end": "2*pi/speed"}})
    names, speeds = tunable(text, ["speed"]), np.array([0.5, 1.0, 4.0])
    model = symgen.build(Scene(**names[0].data))
    cosine = np.cos(np.pi / 2 * np.arange(5))
    wanted = {
        "inverse_dynamics": ("rod.torque", 9.81 * 0.5 * cosine),
        "simulate": ("P.position", 0.5 * cosine),
    }
    for analysis, (output, of_one) in wanted.items():
        runs = model.sweep({"speed": speeds}, analysis, outputs=[output], reduce="history", samples=5)
        assert runs["time"].values[:, -1] == pytest.approx(2 * math.pi / speeds, rel=1e-14)
        found = runs[output].isel(axis=0) if "axis" in runs[output].dims else runs[output]
        assert found.values == pytest.approx(np.tile(of_one, (3, 1)), abs=1e-8)
        runs = model.sweep({"speed": [1.0, 0.0, -1.0]}, analysis, outputs=[output], samples=5)
        of_still, of_back = runs["error"].values[1:]
        assert "t_end of the scene is inf s" in of_still
        assert "t_end of the scene is -6.28319 s" in of_back
    again = model.with_parameters(speed=4.0).with_parameters(**model.parameters)
    assert again.simulate(samples=2).time[-1] == model.simulate(samples=2).time[-1]


def test_wrong_options_are_refused(scene):
    for option in ("length", "=1", "length="):
        with pytest.raises(ModelError, match="expected --vary KEY="):
            of_options([option])
    for more, words in (
        (["--sobol", "4", "--random", "4"], "or --list alone"),
        (["--part", "2"], "expected --part I/N"),
        (["--vary", "length=1 m:2 m:3", "--list", "x.csv"], "or --list alone"),
    ):
        with pytest.raises(ModelError, match=words):
            command(scene, *more)
    with pytest.raises(ModelError, match="expected parameters to vary"):
        command("four_bar")


def test_plots_of_one_parameter_of_samples_and_of_failures():
    def runs(x, y, values):
        of = {"x": ("run", x, {"units": "m"}), "y": ("run", y)}
        data = {
            "F.peak": ("run", values, {"units": "N"}),
            "error": ("run", np.full(len(x), "", dtype=object)),
        }
        return xarray.Dataset(data, of, {"title": "title"})

    line = plot(runs([2.0, 1.0, 3.0], [0.0, 0.0, 0.0], [4.0, math.nan, 6.0])).axes[0]
    assert line.lines[0].get_xdata().tolist() == [1.0, 2.0, 3.0]
    assert line.get_xlabel() == "x [m]" and line.get_ylabel() == "F.peak [N]"
    early = runs([2.0, 1.0, 3.0], [0.0, 0.0, 0.0], [4.0, 5.0, 6.0]).assign(
        ended_early=("run", np.array(["", "dead centre", ""], dtype=object))
    )
    ring = plot(early).axes[0].lines[1]
    assert ring.get_xdata().tolist() == [1.0] and ring.get_ydata().tolist() == [5.0]
    cells = plot(runs([1.0, 1.0, 2.0, 2.0], [3.0, 4.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0])).axes[0]
    assert cells.collections[0].get_array().tolist() == [[5.0, 7.0], [6.0, 8.0]]
    at = cells.collections[0].get_coordinates()
    assert at[0, :, 0].tolist() == [0.5, 1.5, 2.5] and at[:, 0, 1].tolist() == [2.5, 3.5, 4.5]
    coarse = plot(runs([5.0, 5.0, 20.0, 20.0], [-8.0, -1.0, -8.0, -1.0], [5.0, 6.0, 7.0, 8.0])).axes[0]
    assert coarse.get_xlim() == (0.0, 27.5) and coarse.get_ylim() == (-11.5, 0.0)  # masses have one sign
    points = plot(runs([1.0, 1.5, 2.0], [3.0, 3.5, 4.0], [5.0, 6.0, 7.0])).axes[0]
    assert points.collections[0].get_offsets().tolist() == [[1.0, 3.0], [1.5, 3.5], [2.0, 4.0]]
    with pytest.raises(symgen.SymgenError, match="no output 'G.peak'"):
        plot(runs([1.0], [1.0], [1.0]), "G.peak")


def test_a_map_of_floquet_multipliers_shows_where_they_are_one():
    """Between multipliers of 0.5 and 2 at x = 1 and x = 3, linear interpolation gives one at x = 5/3."""
    of = {"x": ("run", [1.0, 1.0, 3.0, 3.0]), "y": ("run", [3.0, 4.0, 3.0, 4.0])}
    data = {"floquet": ("run", [0.5, 0.5, 2.0, 2.0]), "error": ("run", np.full(4, "", dtype=object))}
    panel, bar = plot(xarray.Dataset(data, of, {"title": "title"})).axes
    cells, contour = panel.collections
    assert contour.get_paths()[0].vertices[:, 0] == pytest.approx([5 / 3, 5 / 3])
    assert [float(cells.norm(x)) for x in (0.5, 1.0, 2.0)] == pytest.approx([0.0, 0.5, 1.0])
    assert bar.get_ylabel() == "largest Floquet multiplier"
    data["floquet"] = ("run", [0.5, 0.5, 0.7, math.nan])  # stable, or failed
    assert len(plot(xarray.Dataset(data, of, {"title": "title"})).axes[0].collections) == 1


def test_sweeps_of_elastic_links_simulate_as_run_does():
    found = command("elastic_slider_crank", "--vary", "speed=900 rpm,1000 rpm", "--dry-run", "--json")
    assert json.loads(found)["analysis"] == "simulate"


def test_a_dry_run_counts_the_runs_and_writes_nothing(scene, tmp_path):
    out = tmp_path / "runs.csv"
    found = json.loads(command(scene, "--dry-run", "--json", "--out", out))
    assert (found["runs"], found["chunks"], found["analysis"]) == (6, 1, "inverse_dynamics")
    assert 0.0 < found["seconds"] < 60.0 and not out.exists()
    part = ["--dry-run", "--chunk", "4", "--part", "2/2"]
    assert "2 runs of inverse dynamics in 1 chunks: about" in command(scene, *part, "--out", "a.zarr")
    for wrong, words in (
        (["--out", "no/a.zarr"], "there is no folder"),
        (["--out", "a.zip"], ".zarr or .csv"),
    ):
        with pytest.raises(ResultError, match=words):
            command(scene, *part, *wrong)
    with pytest.raises(ModelError, match="a part from 1 to 2, got 3"):
        command(scene, "--dry-run", "--part", "3/2")


def test_the_page_has_extremes_and_a_plot_and_notes_are_of_what_is_there(scene, tmp_path):
    """The moment at the start is mass*g*length/2, greatest for the heaviest and longest."""
    page = tmp_path / "sweep.html"
    command(scene, "--page", page)
    text = page.read_text(encoding="utf-8")
    assert f"{3 * 9.81 * 400 / 2:.6g}" in text and "data:image/svg+xml" in text
    assert "length = 40 cm, links.rod.mass = 3 kg" in text and ">6</dd>" in text
    assert "Reductions of 5 samples per run" in text
    assert "reductions of" not in command(scene, "--reduce", "history")
    part = ["--chunk", 4, "--part", "2/2", "--out", tmp_path / "part.zarr"]
    assert "4 of 6 runs are missing" in command(scene, *part)
    assert "missing" not in command(scene, *part[:2], "--out", part[-1])
    with pytest.raises(ResultError, match=".html"):
        command(scene, "--page", tmp_path / "sweep.pdf")
    assert not (tmp_path / "sweep.pdf").exists()


def test_corners_are_recorded_by_of():
    """The transmission angle is least with the crank in line with the ground: rods of 30 cm on the coupler."""
    kinematics = ["--analysis", "kinematics", "--of", "A.B.C.transmission_angle"]
    line = ["crank_rocker", "--vary", "links.coupler.length=34 cm:36 cm:3", *kinematics, "--samples", 5]
    found = json.loads(command(*line, "--reduce", "least", "--json"))["outputs"]
    angle = found["A.B.C.transmission_angle.least"]
    assert angle["greatest"]["value"] == pytest.approx(math.acos(34 / (2 * 30)), rel=1e-12)
    assert angle["least"]["value"] == pytest.approx(math.acos(36 / (2 * 30)), rel=1e-12)
    assert [*found] == ["A.B.C.transmission_angle.least", "constraint_drift"]
    of_all = ["--analysis", "kinematics", "--of", "A.B.C,rocker,B.position.x", "--json"]
    names = {*json.loads(command(*line[:3], *of_all, "--samples", 5))["outputs"]}
    assert names == {
        *(f"A.B.C.{word}.peak" for word in ("angle", "transmission_angle")),
        *(f"rocker.{word}.peak" for word in ("angle", "rate", "acceleration")),
        *("B.position.x.peak", "constraint_drift"),
    }
    with pytest.raises(ModelError, match="the runs have no output 'A.B.C'"):
        command(*line[:3], "--of", "A.B.C", "--of", "crank.torque")


def test_histories_are_drawn_as_curves_and_paths_as_an_atlas(tmp_path):
    page = tmp_path / "atlas.html"
    paths = ["--analysis", "kinematics", "--outputs", "B.position", "--reduce", "history", "--reduce", "peak"]
    command(
        "crank_rocker", "--vary", "links.coupler.length=34 cm:36 cm:3", "--samples", 9, *paths, "--page", page
    )
    assert page.read_text(encoding="utf-8").count("data:image/svg+xml") == 2
    model, vary, _ = varied("crank_rocker", of_options(["links.coupler.length=34 cm:36 cm:2"]))
    runs = model.sweep(vary, outputs=["crank.torque", "coupler.B.force"], reduce="history", samples=9)
    torque, force = plot(runs).axes
    assert len(torque.lines) == len(force.lines) == 2 and len(torque.get_legend().get_texts()) == 2
    assert torque.lines[1].get_ydata() == pytest.approx(runs["crank.torque"].values[1])
    assert force.lines[0].get_ydata() == pytest.approx(np.hypot(*runs["coupler.B.force"].values[0].T))
    paths = model.sweep(vary, "kinematics", outputs=["B.position"], reduce="history", samples=9)
    panes = plot(paths).axes
    assert [pane.lines[0].get_xdata()[0] for pane in panes] == pytest.approx(
        paths["B.position"].values[:, 0, 0]
    )
    assert [pane.get_title() for pane in panes] == ["0.34", "0.36"]
    both = model.sweep(vary, outputs=["crank.torque"], reduce=["history", "peak"], samples=9)
    with pytest.raises(ResultError, match="histories are plotted alone: omit crank.torque"):
        plot(both, "crank.torque", "crank.torque.peak")
    with pytest.raises(ResultError, match="no output 'crank.torqu'. Did you mean 'crank.torque'"):
        plot(runs, "crank.torqu")


def test_a_parameter_in_hertz_varies_in_hertz(tmp_path):
    """It is a frequency, of which expressions take 2*pi*f; revolutions per second would be 2*pi times it."""
    tables = (
        'symgen = 1\n[parameters]\nf = "2 Hz"\nk = "1 N*m"\n[points]\nO = { at = ["0 m", "0 m"], ground = true }\n'
        'A = { at = ["1 m", "0 m"] }\n[links]\nOA = { points = ["O", "A"], mass = "1 kg" }\n'
        '[[torques]]\nlink = "OA"\ntorque = "k*sin(2*pi*f*t)"\n'
    )
    file = tmp_path / "scene.toml"
    file.write_text(tables)
    assert varied(file, {"f": "5 Hz:10 Hz:2"})[1]["f"] == pytest.approx([5.0, 10.0])
    with pytest.raises(SceneError, match="expected a frequency such as '5 Hz'"):
        varied(file, {"f": "5 rev/s,6 rev/s"})


def test_parameters_are_shown_in_the_units_in_which_they_are_written(scene):
    """The scene shows lengths in mm; the option has them in cm, and rates in rpm. Drifts are last."""
    shown = command(
        scene, "--vary", "length=0:40 cm:3", "--vary", "speed=30 rpm,60 rpm", "--outputs", "rod.torque"
    )
    assert "length = 40 cm" in shown and "speed = 30 rpm" in shown.replace("\n", " ")
    assert "length: 0 to 40 cm, speed: 30 to 60 rpm" in shown
    assert shown.index("rod.torque.peak") < shown.index("constraint_drift")
    table = command(scene, "--vary", "links.rod.mass=1000 g:3000 g:2", "--outputs", "rod.torque")
    assert "links.rod.mass: 1000 to 3000 g" in table


def test_an_interrupt_leaves_the_runs_that_are_finished_in_the_table(scene, tmp_path, monkeypatch):
    """The third chunk is interrupted: the rows of the first two are those of the whole table."""
    whole, part, chunks = tmp_path / "whole.csv", tmp_path / "part.csv", []
    options = ["--vary", "length=20 cm:40 cm:7", "--outputs", "rod.torque", "--chunk", "2"]
    command(scene, *options, "--out", whole)
    arrays = Sweep.arrays

    def interrupted(*arguments):
        chunks.append(arguments)
        if len(chunks) == 3:
            raise KeyboardInterrupt
        return arrays(*arguments)

    monkeypatch.setattr(Sweep, "arrays", interrupted)
    stopped = CliRunner().invoke(app, ["sweep", scene, *options, "--out", str(part)])
    assert stopped.exit_code == 130 and "4 of 7 runs are in" in stopped.output
    assert part.read_text().splitlines() == whole.read_text().splitlines()[:5]
