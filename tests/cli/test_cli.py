"""The command line."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from shared.commands import call, runner
from shared.signals import ended_by

import symgen
from symgen.cli import app
from symgen.errors import SymgenError


def test_json_is_one_object_and_nothing_else():
    done = subprocess.run(
        [sys.executable, "-m", "symgen", "simulate", "peaucellier", "--t-end", "1.0", "--rtol", "1e-12"]
        + ["--atol", "1e-14", "--json"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    run = json.loads(done.stdout)
    assert run["scene"] == "peaucellier" and run["method"] == "taylor"
    assert run["final"]["C"]["position"] == pytest.approx([0.06, 0.0012604868770946], abs=1e-11)
    assert set(run["final"]) == set("OABCDE")
    assert run["drift"]["constraint"] < 1e-13
    assert run["drift"]["energy"] < 1e-12 * run["drift"]["energy_exchanged"]


_REDUCTION = 'reduction={kind="craig-bampton",modes=99}'


def test_errors_are_one_message_and_an_exit_code(entry):
    """The last of them in a process of its own too."""
    limit = ["--t-end", "20", "--max-wall", "1e-6"]
    for code, arguments, words in (
        (
            2,
            ["simulate", "peaucellier", "--method", "rk4", "--rtol", "1e-3"],
            "give --step instead of --rtol",
        ),
        (2, ["run", "peaucellier", "--t-end", "-1"], "expected --t-end"),
        (2, ["run", "peaucellier", "--t-end", "x"], "expected a number after --t-end, got 'x'"),
        (2, ["run", "peaucellier", "--set", "rho"], "KEY=VALUE"),
        (2, ["show", "peaucellier", "mass"], "Did you mean 'mass_matrix'"),
        (2, ["modes", "slider_crank"], "slider_crank does not support modes"),
        (3, ["run", "peaucelier"], "Did you mean 'peaucellier'"),
        (3, ["run", "peaucellier", "--set", "roh=1 kg/m"], "Did you mean 'rho'"),
        (3, ["run", "peaucellier", "--set", "rho=1 kg"], 'expected a mass per length such as "1 kg/m"'),
        (3, ["run", "slider_crank", "--set", "a4=300 in"], "cannot be assembled"),
        (
            3,
            ["run", "elastic_slider_crank", "--set", f"links.rod.elastic.{_REDUCTION}"],
            "modes: expected at most",
        ),
        (4, ["simulate", "triple_pendulum", *limit], "at t ="),
    ):
        found, out, said = entry(*arguments)
        assert (found, out) == (code, ""), arguments
        assert words in said and said.startswith("symgen: ") and "Traceback" not in said
    done = subprocess.run([sys.executable, "-m", "symgen", *arguments], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith("symgen: ") and "Traceback" not in done.stderr


def test_ctrl_c_ends_a_run_with_130_and_names_the_option_that_resumes(tmp_path):
    """Once its first checkpoint is written, so that the signal meets the step loop."""
    file = tmp_path / "kept"
    options = ["--step", "1e-5", "--t-end", "1e4", "--checkpoint", str(file), "--checkpoint-every", "0.01"]
    command = [sys.executable, "-m", "symgen", "simulate", "parallelogram", *options]
    words = f"symgen: the run is in {file}: --resume {file} continues it\nsymgen: interrupted\n"
    assert ended_by(signal.SIGINT, command, file) == (130, words)


def test_a_complete_run_is_kept_where_its_error_takes_too_long(entry, tmp_path):
    """Newmark's method needs 800,000 steps for the tolerance; the first run has 720, at every half degree."""
    file = tmp_path / "kept.npz"
    code, _, err = entry(
        "simulate", "thesis_four_bar", "--method", "newmark", "--max-wall", "1", "--out", file
    )
    assert code == 4 and f"the samples that are kept are in {file}" in err and "failure" not in err
    assert "steps is kept; the run with more steps" in err
    assert len(symgen.load_result(file).over[0]) == 361


def test_set_changes_tunable_and_folded_values():
    plain = json.loads(call("run", "peaucellier", "--json"))
    heavy = json.loads(call("run", "peaucellier", "--json", "--set", 'rho="2 kg/m"'))
    assert heavy["provenance"]["parameters"] == {"rho": 2.0}
    assert heavy["provenance"]["equations"] == plain["provenance"]["equations"]
    assert heavy["drift"]["energy_exchanged"] == pytest.approx(
        2 * plain["drift"]["energy_exchanged"], rel=1e-6
    )
    other = json.loads(call("run", "peaucellier", "--json", "--set", "links.OA.mass_per_length=3 kg/m"))
    assert other["provenance"]["equations"] != plain["provenance"]["equations"]


def test_set_takes_lists_as_they_stand_in_the_file(tmp_path, entry):
    file = tmp_path / "run.npz"
    wanted = 'analysis.outputs=["energy", "B.velocity"]'
    call("run", "four_bar", "--t-end", "0.1", "--set", wanted, "--out", file)
    assert list(symgen.load_result(file)) == ["energy", "B.velocity"]
    code, _, said = entry("run", "four_bar", "--set", "gravity.acceleration=[0, 1 m/s^2")
    assert code == 3 and "expected a list in square brackets, got '[0, 1 m/s^2'" in said


def test_animate_a_mode(tmp_path, entry):
    file = tmp_path / "mode.html"
    done = call("animate", "elastic_four_bar", "--mode", "1", "--at", "60", "--samples", "5", "--out", file)
    assert done == f"wrote {file}\n" and "Mode 1 of 10" in file.read_text()
    code, _, said = entry("animate", "four_bar", "--at", "60", "--out", file)
    assert code == 2 and said == "symgen: --at selects the pose of a mode: give --mode N\n"


def test_kinematics_at_a_few_angles_prints_every_value():
    """The tip of a crank of 10 cm, on a circle; over many angles, the extremes."""
    line = "kinematics", "crank_rocker", "--of", "A.position"
    lines = call(*line, "--at", "0:90:4").splitlines()
    assert lines[0].endswith("outputs over crank.angle [deg]") and lines[1].split()[2:] == [
        "0",
        "30",
        "60",
        "90",
    ]
    assert [float(x) for x in lines[3].split()[2:]] == pytest.approx([0.0, 1 / 12, 1 / 6, 0.25], rel=1e-5)
    found = [float(x) for x in lines[4].split()[2:]]
    assert found == pytest.approx([0.1, 0.1 * np.cos(np.pi / 6), 0.05, 0.0], abs=1e-6)
    assert "least" in call(*line, "--at", "0:90:13")


def test_an_analysis_is_animated(tmp_path, entry):
    file = tmp_path / "steady.html"
    said = call("periodic", "elastic_slider_crank", "--samples", "7", "--rtol", "1e-2", "--animate", file)
    assert said.endswith(f"wrote {file}\n")
    film = json.loads(re.search(r'id="data"[^>]*>(.*?)</script>', file.read_text())[1])
    assert len(film["frames"]) == 7 and film["along"]["values"][-1] == pytest.approx(360)
    said = call("inverse-dynamics", "elastic_four_bar", "--samples", "5", "--animate", file)
    assert "crank.torque" in said and said.endswith(f"wrote {file}\n")
    code, out, said = entry("kinematics", "crank_rocker", "--at", "30", "--animate", file)
    assert code != 0 and "B.position" in out and "expected at least 2 for an animation" in said
    code, _, said = entry("run", "four_bar", "--animate", tmp_path / "film.png")
    assert code == 2 and "for the animation" in said


def test_ten_modes_are_listed_and_the_others_counted():
    given = "modes", "rotating_cantilever", "--set", "links.strip.elastic.elements=5"
    found = json.loads(call(*given, "--json"))["frequencies_hz"]
    lines = call(*given).splitlines()
    assert [float(line.split()[1]) for line in lines if re.match(r"\d+ ", line)] == pytest.approx(
        found[:10], rel=1e-5
    )
    assert lines[-1].startswith(f"and {len(found) - 10} more modes up to {found[-1]:.6g} Hz")
    assert lines[-1].endswith(": --json lists all") and lines[-2] == "elements: strip 5"


def test_a_length_that_does_not_fit_is_the_only_one_named(tmp_path):
    """The other constraints of the linkage are met up to rounding."""
    file = tmp_path / "open.toml"
    file.write_text(
        'symgen = 1\n[points]\nO = { at = ["0 m", "0 m"], ground = true }\nA = { at = ["0 m", "1 m"] }\n'
        'B = { at = ["2 m", "2 m"] }\nC = { at = ["3 m", "0 m"], ground = true }\n[links]\n'
        'crank = { points = ["O", "A"], mass = "1 kg" }\nrocker = { points = ["B", "C"], mass = "1 kg" }\n'
        'coupler = { points = ["A", "B"], mass = "1 kg", length = "30 m" }\n'
    )
    with pytest.raises(SymgenError, match=r"it still misses the length of link coupler by [\d.]+ m\n"):
        call("simulate", file)


def test_titles_are_not_broken_at_the_width_of_their_tables():
    title = "Four-bar linkage swinging freely: stable equilibrium, 1 degree of freedom"
    assert title in call("equilibrium", "four_bar").splitlines()
    assert "Cantilever on a rotating shaft: the structure at rest" in call("modes", "rotating_cantilever")


def test_lists_and_schema(monkeypatch, tmp_path, made):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    assert all(name in call("scenes") for name in symgen.shipped_scenes())
    assert "accelerations" in call("build", "four_bar")
    assert "1 entries" in call("cache", "info")
    assert "removed 1 entries" in call("cache", "clear")
    schema = json.loads(call("schema"))
    assert {"points", "links", "drivers"} <= set(schema["properties"])
    assert call("--version").strip() == symgen.__version__
    # What --check derives, each model in a process of its own, is what this session has derived so.
    monkeypatch.setattr(
        "symgen.regeneration.generate.derive_all", lambda models, _: {name: made[name] for name in models}
    )
    assert "generated/ is current" in call("generate", "--check")


COMMANDS = [c.callback.__name__.replace("_", "-") for c in app.registered_commands]


@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_80_columns_and_has_an_example_that_parses(command):
    shown = call(command, "-h")
    lines = shown.splitlines()
    assert max(map(len, lines)) <= 80 and not any("…" in line for line in lines)
    (example,) = (x for x in re.findall(r"Example: (.*)", " ".join(shown.split())))
    words = shlex.split(example.split(" > ")[0])
    assert words[:2] == ["symgen", command]
    # Typer parses the arguments of a command before it prints the help of that command.
    assert call(*words[1:], "--help") == shown


def test_every_analysis_of_a_model_is_a_command_of_that_name():
    """Those that take states or arrays, or return models or matrices, are for Python alone."""
    from symgen.runtime.model.model import VERBS

    assert {v.replace("_", "-") for v in VERBS if not v.endswith("_many")} - set(COMMANDS) == {
        "accelerations", "batch", "evaluate", "jacobian", "mass-matrix",
        "matrices", "record", "stepper",
        "coordinates",
    }  # fmt: skip


def test_options_are_shown_in_groups():
    shown = call("simulate", "--help")
    places = [shown.index(f"─ {group} ─") for group in ("Run", "Elastic links", "Output", "Compilation")]
    assert places == sorted(places)
    assert places[0] < shown.index("--rtol") < places[1] < shown.index("--revolutions") < places[2]
    assert places[2] < shown.index("--json") < places[3] < shown.index("--precision")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "peaucellier", "--rtol", "1e-9"], "of their own: 'symgen simulate SCENE'"),
        (["run", "four_bar", "--samples", "1.5"], "expected a whole number after --samples, got '1.5'"),
        (["linearise", "crank_rocker", "--coordinates", "X"], "crank, coupler, rocker"),
        (["linearise", "crank_rocker", "--coordinates", "crank.angle"], "its poles show no stability"),
        (["forces", "crank_rocker"], "See 'symgen --help'"),
        (["simulate", "elastic_four_bar", "--method", "taylor"], "'taylor' is for rigid links"),
        (["inverse-dynamics", "four_bar"], "does not support inverse dynamics: it has more degrees"),
        (["sensitivity", "peaucellier", "--outputs", "D.position", "--at", "1 s"], "Give --t-end for derivatives"),
        (["simulate", "thesis_four_bar", "--method", "quasi-static"], "'symgen quasi-static thesis_four_bar'"),
        (["run", "four_bar", "--at", "30"], "--at does not apply to simulate of four_bar"),
        (["modes", "four_bar", "--at", "30"], "--at does not apply to modes of four_bar"),
        (["simulate", "cssp", "--revolutions", "2"], "--revolutions does not apply to simulate of cssp"),
        (["inverse-dynamics", "slider_crank", "--sections", "0.5"], "--sections does not apply"),
        (["inverse-dynamics", "crank_rocker", "--through"], "--through does not apply"),
        (["inverse-dynamics", "thesis_four_bar", "--through"], "--through does not apply"),
        (["kinematics", "slider_crank", "--state", "2"], "--state does not apply to kinematics of slider_crank"),
        (["kinematics", "crank_rocker", "--at", "30", "--samples", "3"], "give --at or --samples, not both"),
        (["kinematics", "crank_rocker", "--at", "30,0.2 s"], "give times or values of the input, not both"),
        (["kinematics", "crank_rocker", "--t-end", "1"], "The end of the range is --to"),
        (["kinematics", "crank_rocker", "--from", "x"], '"45 deg", or times such as "0.3" (seconds), got \'x\''),
        (["linearise", "four_bar", "--at", "0.3"], 'such as "0.3 s", got \'0.3\'\n  A time needs a unit'),
        (["assemblies", "crank_rocker", "--at", "30,60"], "expected one value after --at"),
        (["run", "slider_crank", "--at", "30", "--t-end", "1"], "give --at or --t-end, not both"),
        (["simulate", "four_bar", "--checkpoint-every", "3"], "give the file with --checkpoint"),
    ],
)  # fmt: skip
def test_options_that_do_not_apply_are_refused_by_name(entry, arguments, words):
    code, out, err = entry(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("symgen: ") and words in err


def test_run_selects_the_analysis_that_suits_the_scene():
    same = {
        ("run", "cssp", "--t-end", "0.2"): ("simulate", "cssp", "--t-end", "0.2"),
        ("run", "slider_crank", "--at", "45"): ("inverse-dynamics", "slider_crank", "--at", "45 deg"),
        ("run", "slider_crank", "--t-end", "0.1", "--samples", "5"): (
            "inverse-dynamics", "slider_crank", "--from", "0 s", "--to", "0.1 s", "--samples", "5",
        ),
        ("run", "elastic_slider_crank", "--at", "90"): ("simulate", "elastic_slider_crank", "--at", "90"),
    }  # fmt: skip
    for short, whole in same.items():
        first, second = (json.loads(call(*words, "--json")) for words in (short, whole))
        assert first["outputs"] == second["outputs"] and first["outputs"]
        assert first["drift"] == second["drift"] and first["provenance"] == second["provenance"]


def test_an_unstable_equilibrium_is_linearised_by_any(tmp_path):
    """A rod of length l on its pivot falls with s^2 = 3 g/(2 l)."""
    text = """symgen = 1
[points]
O = { at = [0, 0], ground = true }
P = { at = ["0.05 m", "0.5 m"] }
[links]
rod = { points = ["O", "P"], mass = "1 kg", length = "0.5 m" }
[gravity]
acceleration = [0, "-9.81 m/s^2"]
"""
    file = tmp_path / "upright.toml"
    file.write_text(text, "utf-8")
    falling = math.sqrt(3 * 9.81 / (2 * 0.5))
    (mode,) = json.loads(call("modes", str(file), "--any", "--json"))["modes"]
    assert mode["s"][0] == pytest.approx(falling, rel=1e-12)
    about = ["--at", "equilibrium", "--any", "--coordinates", "rod.angle", "--json"]
    assert json.loads(call("linearise", str(file), *about))["A"][1][0] == pytest.approx(falling**2, rel=1e-12)
    refused = runner.invoke(app, ["linearise", str(file), "--any"])
    assert refused.exit_code and "--any is for --at equilibrium" in str(refused.exception)


def test_derivatives_along_a_run_are_those_at_its_end(entry, tmp_path):
    """A rod without forces turns by its initial rate w: y(t) = l sin(a + w t)."""
    text = """symgen = 1
points.O = { at = [0, 0], ground = true }
points.P = { at = ["0.5 m", 0] }
links.rod = { points = ["O", "P"], mass = "m" }
parameters.m = { value = "1 kg", tunable = true }
"""
    file = tmp_path / "rod.toml"
    file.write_text(text, "utf-8")
    about = ["--outputs", "P.position.y", "--coordinates", "rod.angle", "--t-end", "0.7"]
    shown = call("sensitivity", str(file), *about).splitlines()
    assert shown[0].endswith(": derivatives at t = 0.7 s of the run")
    assert [float(x) for x in shown[-1].split()[-2:]] == pytest.approx([0.5, 0.35], rel=1e-6)
    of_run = ["--t-eval", "0.35,0.7", "--integrals", "P.position.y", "--method", "dopri5", "--rtol", "1e-8"]
    shown = call("sensitivity", str(file), *about[:-2], *of_run).splitlines()
    rows = [[float(x) for x in row.split()[-2:]] for row in shown if "P.position.y" in row]
    assert np.allclose(rows, [(0.5, 0.175), (0.175, 0.030625), (0.5, 0.35), (0.35, 0.1225)], rtol=1e-5)
    assert shown[0].endswith(": derivatives at t = 0.35 s of the run")
    _, _, err = entry("sensitivity", str(file), "--outputs", "P.position.y")
    assert "one for each degree of freedom, got no --coordinates" in err


def test_tables_at_an_equilibrium_are_headed_so():
    shown = call("linearise", "four_bar", "--coordinates", "crank.angle", "--at", "equilibrium").splitlines()
    assert shown[0] == "Four-bar linkage swinging freely: linearised at the equilibrium"
    shown = call(
        "sensitivity", "peaucellier", "--at", "equilibrium", "--outputs", "D.position.x"
    ).splitlines()
    assert shown[0].endswith(": derivatives at the equilibrium")
    shown = call("linearise", "four_bar", "--coordinates", "crank.angle").splitlines()
    assert shown[0].endswith(": linearised at t = 0 s")


def test_poles_of_coordinates_that_constraints_couple_are_named_as_such():
    """None belongs to a motion where drives prescribe all, as of a crank rocker."""

    def shown(*arguments):
        return " ".join(call("linearise", *arguments).split())

    assert "4 coordinates, 1 degree of freedom: the poles include" in shown("four_bar")
    assert "do not show whether the motion is stable" in shown("crank_rocker")
    assert "freedom" not in shown("four_bar", "--coordinates", "crank.angle")


def test_angles_of_loops_in_assembly_modes_are_within_half_a_revolution():
    """The two modes of the RSSR at its start mirror the rocker's angle."""
    rows = {row.split()[0]: row.split()[2:] for row in call("assemblies", "rssr").splitlines()[3:-1]}
    assert all(abs(float(x)) <= math.pi for angles in rows.values() for x in angles)
    assert float(rows["theta4"][0]) == pytest.approx(-float(rows["theta4"][1]), rel=1e-5)


@pytest.mark.parametrize(
    ("name", "hint"),
    [("press", "'symgen scenes' lists the shipped ones."), ("fourbar", "Did you mean 'four_bar'?")],
)
def test_unknown_scenes_have_the_nearest_name_if_one_is_near(name, hint, entry):
    assert entry("scenes", name)[2].splitlines()[1].strip() == hint


def test_assemblies_are_those_of_the_model():
    printed = json.loads(call("assemblies", "crank_rocker", "--at", "60", "--json"))
    found = printed["assemblies"]
    assert printed["complete"] is True and printed["incomplete"] == ""
    # Crank 0.1 m, coupler and rocker from the crank's end to the ground: one mode on either side of the
    # diagonal.
    crank = np.array([0.05, 0.05 * math.sqrt(3)])
    (first, second), ground = [np.array(pose["B"]) for pose in found], np.array(found[0]["C"])
    assert np.array(found[0]["A"]) == pytest.approx(crank)
    line = (ground - crank) / np.linalg.norm(ground - crank)
    mirrored = crank + 2 * line * ((first - crank) @ line) - (first - crank)
    assert second == pytest.approx(mirrored, abs=1e-9) and np.linalg.norm(first - second) > 0.1
    angles = json.loads(call("assemblies", "slider_crank", "--json"))["assemblies"]
    assert len(angles) == 2 and set(angles[0]) == {
        v.name for v in symgen.build("slider_crank").description.variables
    }
    shown = " ".join(call("assemblies", "slider_crank").split())
    assert "2 assembly modes" in shown and "There may be others: closures of loops of joints" in shown
    assert call("assemblies", "crank_rocker").splitlines()[-1] == "These are all."


def test_the_shell_completes_commands_and_scenes():
    def completed(words, index):
        environment = {"_SYMGEN_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(index)}
        done = subprocess.run(
            [sys.executable, "-c", "import sys; sys.argv[0] = 'symgen'; from symgen.cli import main; main()"],
            env={**os.environ, **environment}, capture_output=True, text=True,
        )  # fmt: skip
        return done.stdout.split()

    assert completed("symgen inv", 1) == ["inverse-dynamics"]
    assert completed("symgen simulate elastic_f", 2) == [
        name for name in symgen.shipped_scenes() if name.startswith("elastic_f")
    ]
    assert "--install-completion" in call("--help")


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["--method", "rk4"], "give it one, such as --step 1e-3"),
        (["--method", "rk4", "--step", "0.01", "--atol", "1e-9"], "give --step instead of --rtol and --atol"),
        (
            ["--method", "dop853", "--step", "0.01", "--rtol", "1e-6"],
            "fixed steps have no tolerance: give --step, or --rtol and --atol, not both",
        ),
        (["--step", "1e-3", "--rtol", "1e-6"], "symgen: fixed steps have no tolerance: give --step"),
        (["--step", "1e-3", "--max-step", "1"], "--max-step limits the steps"),
        (["--stabilisation-rate", "3"], "goes with --stabilisation baumgarte, not with projection"),
        (["--method", "dop583"], "Did you mean 'dop853'"),
        (["--rtol", "0"], "expected --rtol"),
        (["--rtol", "1e-20"], "tightest that float64 can meet"),
        (["--atol", "nan"], "expected a finite number for --atol"),
        (["--step", "-0.1"], "expected --step"),
        (["--t-end=-1"], "expected --t-end to be a finite number above zero, got -1.0"),
        (["--t-end", "nan"], "expected a finite number for --t-end, got nan"),
        (["--max-wall", "0"], "expected --max-wall to be a finite number above zero, got 0.0"),
        (
            ["--checkpoint", "x", "--checkpoint-every", "inf"],
            "expected a finite number for --checkpoint-every, got inf",
        ),
        (["--samples", "1"], "samples"),
        (["--backend", "fortran"], "no backend 'fortran'"),
        (["--set", "rho=nan kg/m"], "finite number"),
        (
            ["--set", "rho=-1 kg/m"],
            "[links.OA] mass_per_length: expected a mass per length of at least zero, got 'rho', which is -1 kg/m",
        ),
        (["--set", "links.OA.mass=1 kg"], "mass or mass_per_length, not both"),
        (["--set", "points.A.at.0=open('x')"], "calls 'open'"),
        (["--out", "run.txt"], "ending in .nc or .npz or .csv"),
        (["--out", "no/such/folder/run.nc"], "cannot write the result"),
        (["--plot", "no/such/folder/run.png"], "cannot write the plot"),
        (["--plot", "run.nothing"], "ending in .png or .svg or .pdf"),
    ],
    ids=lambda x: "=".join(x) if isinstance(x, list) else "",
)
def test_wrong_options(entry, arguments, words, tmp_path, monkeypatch):
    """One message, an exit code, and no file, whole or in part."""
    monkeypatch.chdir(tmp_path)
    code, out, err = entry("simulate", "peaucellier", "--json", *arguments)
    assert code == (3 if "--set" in arguments else 2)
    assert out == ""
    assert err.startswith("symgen: ") and err.count("symgen: ") == 1
    assert words in err
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_command_is_refused(entry):
    code, out, err = entry("nonsense")
    assert code == 2 and out == "" and "nonsense" in err


def test_a_dotted_key_means_what_the_file_would(tmp_path):
    by_key = json.loads(call("run", "four_bar", "--json", "--set", "links.crank.mass=3 kg"))
    text = (symgen.scene.loading.SHIPPED / "four_bar.toml").read_text()
    (tmp_path / "four_bar.toml").write_text(text.replace('mass = "1 kg"', 'mass = "3 kg"'))
    assert by_key["final"] == json.loads(call("run", tmp_path / "four_bar.toml", "--json"))["final"]
    assert by_key["final"] != json.loads(call("run", "four_bar", "--json"))["final"]


@pytest.mark.parametrize("command", [["cache", "info"], ["cache", "clear"], []])
def test_help_of_the_rest(command):
    assert "Usage" in call(*command, "--help")


def test_set_whole_numbers_and_choices():
    changed = ["--set", "links.coupler.elastic.elements=3", "--set", "links.output.elastic.axial=false"]
    said = " ".join(call("explain", "thesis_four_bar", *changed).split())
    assert "link coupler, 3 elements beam8" in said
    assert "link output, 1 element beam8, inextensible" in said


def test_help_lists_every_command_with_a_whole_sentence():
    shown = call("--help")
    assert "Exit codes: 0 success; 1 " in shown and max(map(len, shown.splitlines())) <= 80
    panels = shown.partition("─ Analyses ─")[2].partition("Exit codes")[0]
    rows = re.findall(r"│ ([\w-]*) +(.*?) *│", panels)
    sentences, names = [], [name for name, _ in rows if name]
    for name, text in rows:
        sentences.append(text) if name else sentences.append(f"{sentences.pop()} {text}")
    assert sorted(names) == sorted([*COMMANDS, "cache"])
    assert all(re.fullmatch(r"[A-Z][^.]*\.", text) for text in sentences), sentences


def test_a_run_prints_the_outputs_that_were_asked_for():
    """Extremes are those of the motion, which many samples come near."""
    printed = call("run", "peaucellier")
    ended = symgen.build("peaucellier").simulate(samples=20001)
    for axis, values in zip("xy", ended.variable("E.reaction").values.T, strict=True):
        row = next(line for line in printed.splitlines() if f"E.reaction.{axis}" in line)
        end, least, at_least, greatest, at_greatest = (float(x) for x in row.split()[2:])
        near = pytest.approx([values[-1], values.min(), values.max()], rel=3e-6, abs=1e-12)
        assert [end, least, greatest] == near
        there = np.interp([ended.time[-1], at_least, at_greatest], ended.time, values)
        assert there == pytest.approx([end, least, greatest], rel=1e-5, abs=1e-12)


def test_a_scene_file_named_without_its_ending(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text("symgen = 1\n")
    done = runner.invoke(app, ["run", "mine"])
    assert "Did you mean 'mine.toml'?" in str(done.exception)


def test_tables_hold_no_minus_zero():
    from symgen.report.tables import cell_text

    assert cell_text(-0.0) == "0" and cell_text(-1e-300) == "-1e-300"
    rates = call("run", "slider_crank", "--at", "45")
    assert not re.search(r" -0 ", rates)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, a device that is always full")
@pytest.mark.parametrize("arguments, unbuffered", [("scenes", ""), ("schema", "1"), ("--help", "")])
def test_output_that_does_not_fit_is_one_clear_line(arguments, unbuffered):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "symgen", arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        )
    assert done.returncode == 1
    assert done.stderr == "symgen: cannot write the output: No space left on device\n"


def test_a_number_of_sums_below_zero_is_refused(entry):
    code, out, err = entry("accuracy", "rod", "--top", "-3")
    assert (code, out) == (2, "")
    assert err == "symgen: expected a number of sums from 0 on for top, got -3\n"
