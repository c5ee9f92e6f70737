"""Exports in C: compiled without a warning by GCC and Clang, they give the bits that Python gives."""

from __future__ import annotations

import contextlib
import json
import re
import shlex
import shutil
import subprocess

import numpy as np
import pytest
from shared.ball_poles import CASE, CRANK, Straight
from shared.full import full, full_unless
from shared.linkages import at, ground
from shared.servo_loop import servo
from shared.shipped import ELASTIC, LINKAGES, OF_ALL_TYPES
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.cli.common import changes
from symgen.errors import CapabilityError, ModelError, ResultError, SceneError
from symgen.export import export_c
from symgen.scene.loading import scene_path

STRICT = ("-std=c11", "-Wall", "-Wextra", "-Werror", "-O0", "-ffp-contract=off")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
#: One of each kind, small: rods, a driven loop, elastic links with constraints.
SCENES = ("vertical_rods", "screw_jack", "elastic_slider_crank")


def needs(compiler):
    return pytest.mark.skipif(shutil.which(compiler) is None, reason=f"{compiler} is not installed")


def compiled(folder, name, compiler, program, *flags):
    own = [
        f"{name}.c",
        *sorted(p.name for p in folder.glob("*_kernel*.c")),
        *(f"core/{p.name}" for p in sorted(folder.glob("core/*.c"))),
    ]
    made = folder.with_name(f"{name}-{compiler}-{program}")
    done = subprocess.run(
        [compiler, *STRICT, *flags, "-o", str(made), f"{program}.c", *own, "-lm"],
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return made


def run(*command):
    return run_in(None, *command)


def states(said):
    return [float(x) for x in re.findall(r"^y\[\d+\] = (\S+)$", said, re.M)]


def run_in(folder, *command):
    done = subprocess.run([str(c) for c in command], cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("exports")
    for name in SCENES:
        export_c(name, root / name)
    return {name: root / name for name in SCENES}


@pytest.mark.parametrize(
    ("name", "compiler"),
    full_unless(
        lambda *case: case in zip(SCENES, ("gcc", "clang", "gcc"), strict=True),
        [(name, compiler) for name in OF_ALL_TYPES for compiler in ("gcc", "clang")],
    ),
)
def test_the_same_bits(name, compiler, folders, tmp_path):
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    folder = folders.get(name, tmp_path / name)
    if name not in folders:
        export_c(name, folder)
    program = compiled(folder, name, compiler, "check")
    assert "all the same to the last bit" in run(program, "--bits")
    if name == "elastic_slider_crank":  # whose shapes LAPACK solves in the library
        said = run(program)
        assert re.search(r"^outputs +\d+ numbers", said, re.M) and ", 0 by too much" in said


RODS = [name for name in LINKAGES if name not in ELASTIC]


@needs("gcc")
@pytest.mark.parametrize("name", full_unless(lambda name: name == "car_axis", RODS))
def test_power_series_in_c(name, tmp_path):
    """The bits of the library, and the end that it finds by another method."""
    export_c(name, tmp_path / name, method="taylor")
    assert "all the same to the last bit" in run(compiled(tmp_path / name, name, "gcc", "check"), "--bits")
    if name == "car_axis":
        ends = states(run(compiled(tmp_path / name, name, "gcc", "main", *SANITIZED)))
        model = symgen.build(name)
        for method, close in (("taylor", 1e-12), ("dop853", 1e-7)):
            final = model.simulate(method=method, rtol=1e-9, atol=1e-12).final
            expected = [
                x for what in ("position", "velocity") for p in model.description.free for x in final[p][what]
            ]
            assert ends[: len(expected)] == pytest.approx(expected, abs=close)


@needs("gcc")
@pytest.mark.parametrize(("method", "ends"), [("taylor", True), ("dop853", False)])
def test_an_event_within_a_step_ends_a_run_in_c(method, ends, tmp_path):
    """A point thrown to 1 m in 0.5 s is above the event for 3e-4 s, between the probes of other methods."""
    scene = symgen.Scene(
        points={"O": ground(0, -9), "G": ground(1, -9), "A": at(0, 0)},
        links={"base": {"points": ["O", "G"]}},
        masses=[{"point": "A", "mass": "1 kg"}],
        gravity={"acceleration": ["0 m/s^2", "-8 m/s^2"]},
        start={"velocities": {"A": ["1 m/s", "4 m/s"]}},
        events=[{"name": "high", "of": "A.y", "value": "0.9999999 m", "ends_run": True}],
        analysis={"t_end": "1 s"},
    )
    export_c(scene, tmp_path / "scene", method=method)
    said = run(compiled(tmp_path / "scene", "scene", "gcc", "main"))
    assert said.startswith("an event of the scene ended the run") == ends
    t = 0.5 - np.sqrt(1e-7) / 2 if ends else 1.0
    assert float(re.search("t = ([0-9.e-]+) s", said)[1]) == pytest.approx(t, abs=1e-9)
    assert states(said)[:2] == pytest.approx([t, 4 * t * (1 - t)], abs=1e-9)


@needs("gcc")
def test_recurrences_of_all_inverse_functions_compile_without_warnings(tmp_path):
    """Of atan2 by a torsion spring; not every recurrence reads all of its arguments."""
    scene = symgen.Scene(
        parameters={"d": "2 m", "F": "1 N"},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"bar": {"points": ["O", "A"], "mass": "1 kg"}},
        torsion_springs=[{"link": "bar", "stiffness": "3 N*m"}],
        forces=[{"point": "A", "force": ["F*log(2 + A.x/d)", "F*(atan(A.y/d) + asin(A.x/d) - tan(A.y/d))"]}],
        analysis={"t_end": "1 s"},
    )
    export_c(scene, tmp_path / "scene", method="taylor")
    said = run(compiled(tmp_path / "scene", "scene", "gcc", "check"), "--bits")
    assert "all the same to the last bit" in said


@pytest.mark.parametrize("name", ["screw_jack", "elastic_slider_crank"])
def test_what_has_no_power_series_says_so(name, tmp_path):
    done = CliRunner().invoke(app, ["export", name, "--out", str(tmp_path / "out"), "--method", "taylor"])
    assert isinstance(done.exception, CapabilityError)
    assert f"{name} has no export with taylor" in str(done.exception)
    assert not (tmp_path / "out").exists()


@needs("cmake")
@pytest.mark.full
def test_cmake_builds_and_tests_an_export(tmp_path):
    export_c("vertical_rods", tmp_path / "vertical_rods")
    for step in ("cmake -S . -B build", "cmake --build build", "ctest --test-dir build"):
        said = run_in(tmp_path / "vertical_rods", *step.split())
    assert "100% tests passed" in said


@needs("gcc")
def test_a_wrong_number_is_found(folders, tmp_path):
    copy = tmp_path / "vertical_rods"
    shutil.copytree(folders["vertical_rods"], copy)
    text = (copy / "vertical_rods.c").read_text()
    wrong = re.sub(r"(vertical_rods_start\[\] = \{[^}]*?0\.)", r"\g<1>001", text, count=1)
    assert text != wrong
    (copy / "vertical_rods.c").write_text(wrong)
    done = subprocess.run(
        [str(compiled(copy, "vertical_rods", "gcc", "check"))], capture_output=True, text=True
    )
    assert done.returncode == 1
    assert "by too much" in done.stdout


@needs("gcc")
def test_the_example_ends_where_python_ends(folders):
    said = run(compiled(folders["vertical_rods"], "vertical_rods", "gcc", "main"))
    found = states(said)
    final = symgen.build("vertical_rods").simulate(method="dop853").final
    free = symgen.build("vertical_rods").description.free
    expected = [x for what in ("position", "velocity") for p in free for x in final[p][what]]
    assert found[: len(expected)] == expected


@needs("gcc")
def test_a_driven_loop_ends_where_python_ends(folders):
    said = run(compiled(folders["screw_jack"], "screw_jack", "gcc", "main"))
    last = [float(x) for x in said.splitlines()[-1].partition(":")[2].split()]
    model = symgen.build("screw_jack")
    turn = model.inverse_dynamics(samples=13)
    names = [v.name for v in model.description.variables]
    assert len(names) == 3
    assert last == pytest.approx([float(turn[n].values[-1]) * in_si(model, turn[n]) for n in names], rel=1e-8)


@needs("gcc")
@pytest.mark.parametrize("past", [0.0, full(1e-5)])
def test_a_free_loop_runs_past_the_poles_of_its_balls(tmp_path, past):
    """In C: through the poles at 180 deg, and past them by little; against the library and the energy alone."""
    offset = CRANK + past
    export_c(CASE, tmp_path / "ball_poles", set={"offset": f"{offset!r} m"})
    said = run(compiled(tmp_path / "ball_poles", "ball_poles", "gcc", "main"))
    assert said.startswith("done: t = 1 s")
    shown = dict(re.findall(r"^(\S+) = (\S+) \S+$", said, re.M))
    state = states(said)
    angle, rate = state[0], float(shown["theta1.rate"])
    straight = Straight(offset)
    assert angle > 1.5 * np.pi
    assert straight.time(angle) == pytest.approx(1.0, abs=1e-8)
    assert rate == pytest.approx(straight.rate(angle), rel=1e-8)
    assert float(shown["S4"]) == pytest.approx(straight.slider(angle)[0], rel=1e-8)
    assert float(shown["S4.acceleration"]) == pytest.approx(straight.acceleration(angle), rel=1e-6)
    last = symgen.build(CASE).with_parameters(offset=offset).simulate(rtol=1e-9, atol=1e-12)
    names = ("theta1", "theta2", "eta2", "theta3", "eta3", "alpha3", "S4")
    assert state[:7] == pytest.approx([float(last[n].values[-1]) for n in names], rel=1e-8)
    assert "all the same to the last bit" in run(
        compiled(tmp_path / "ball_poles", "ball_poles", "gcc", "check"), "--bits"
    )


@needs("gcc")
def test_outputs_of_a_loop_whose_state_switches_are_those_of_python(tmp_path):
    """Behind a run the law switches by the state again: a held branch of min and max rounds otherwise."""
    export_c(servo(), tmp_path / "servo")
    program = compiled(tmp_path / "servo", "servo", "gcc", "check")
    assert "all the same to the last bit" in run(program, "--bits")


def in_si(model, values):
    return dict(model.description.units.values()).get(values.attrs["units"], 1.0)


@needs("gcc")
def test_two_exports_go_into_one_program(folders, tmp_path):
    """Everything that a linker sees carries the name of the scene."""
    name = "elastic_slider_crank"
    sources = [folders[name] / f"{name}.c", *sorted(folders[name].glob("core/*.c"))]
    run_in(tmp_path, "gcc", "-std=c11", "-c", *sources)
    said = run_in(tmp_path, "nm", "-g", "--defined-only", *sorted(tmp_path.glob("*.o")))
    seen = [line.split()[2] for line in said.splitlines() if len(line.split()) == 3]
    assert f"{name}_run" in seen
    assert all(symbol.startswith(f"{name}_") for symbol in seen), seen


BOTH = """
#include "left.h"
#include "right.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
int main(void)
{
    void *memory[2] = { malloc(left_bytes()), malloc(right_bytes()) };
    struct left *left = left_make(memory[0], NULL);
    struct right *right = right_make(memory[1], NULL);
    double t[2] = { left_t_start, right_t_start }, y[left_n_states], z[right_n_states];
    memcpy(y, left_start, sizeof y);
    memcpy(z, right_start, sizeof z);
    for (int part = 1; part <= 2; part++)
        if (left_run(left, &t[0], part*0.25, 1e-11, 1e-13, 1000000, y)
            || right_run(right, &t[1], part*0.25, 1e-11, 1e-13, 1000000, z))
            return 1;
    for (int i = 0; i < left_n_states; i++)
        printf("%.17g ", y[i]);
    puts("");
    for (int i = 0; i < right_n_states; i++)
        printf("%.17g ", z[i]);
    free(memory[0]);
    free(memory[1]);
    return 0;
}
"""


@needs("gcc")
def test_two_exports_of_one_scene_run_in_one_program(tmp_path):
    """Under two names, with different values; both end where runs in Python end."""
    values = {"left": {}, "right": {"gravity.acceleration": ["0 m/s^2", "0 m/s^2", "-1.6 m/s^2"]}}
    for name, changed in values.items():
        export_c("vertical_rods", tmp_path / name, set=changed, name=name)
        again = re.search("`symgen export (.*) --out", (tmp_path / name / "README.md").read_text())[1]
        assert again.startswith("vertical_rods") and again.endswith(f" --name {name}")
    (tmp_path / "both.c").write_text(BOTH)
    sources = [
        file
        for name in values
        for file in (tmp_path / name).rglob("*.c")
        if file.name not in ("main.c", "check.c")
    ]
    folders_ = [f"-I{tmp_path / name}" for name in values]
    made = tmp_path / "both"
    run("gcc", *STRICT, *folders_, "-o", made, tmp_path / "both.c", *sources, "-lm")
    ends = [[float(x) for x in line.split()] for line in run(made).splitlines()]
    assert ends[0] != pytest.approx(ends[1], rel=1e-2)
    for end, changed in zip(ends, values.values(), strict=True):
        model = symgen.build("vertical_rods", set=changed)
        final = model.simulate(0.5, rtol=1e-11, atol=1e-13).final
        free = model.description.free
        expected = [x for what in ("position", "velocity") for p in free for x in final[p][what]]
        assert end[: len(expected)] == pytest.approx(expected, abs=1e-8)


def test_names_of_exports(tmp_path):
    done = CliRunner().invoke(app, ["export", "four_bar", "--out", str(tmp_path / "a"), "--name", "arm"])
    assert done.exit_code == 0 and (tmp_path / "a" / "arm.h").is_file()
    assert not [*(tmp_path / "a").rglob("*four_bar*")]
    for name, error, words in (
        ("my arm", SceneError, "expected a name of letters, digits and underscores"),
        ("double", ModelError, "a scene called 'double' cannot be exported"),
    ):
        with pytest.raises(error, match=words):
            export_c("four_bar", tmp_path / "b", name=name)
        assert not (tmp_path / "b").exists()
    file = tmp_path / "mine.py"
    file.write_text("raise RuntimeError")
    with pytest.raises(ModelError, match="is that of its System"):
        export_c(file, tmp_path / "b", name="arm")


@needs("gcc")
def test_sanitizers_have_nothing_to_say(folders):
    run(compiled(folders["vertical_rods"], "vertical_rods", "gcc", "main", *SANITIZED))


def test_parameters_may_be_changed_in_c(tmp_path):
    export_c("peaucellier", tmp_path / "peaucellier", set={"rho": "3 kg/m"})
    header = (tmp_path / "peaucellier" / "peaucellier.h").read_text()
    assert "parameters[0]  rho  [kg/m]  mass per length of the rods" in header
    assert "peaucellier_defaults[] = {3.0}" in (tmp_path / "peaucellier" / "peaucellier.c").read_text()


#: Derivative with other parameters; then a kernel called by itself, as its header says.
OWN = r"""
#include "double_four_bar.h"
#include "double_four_bar_kernel.h"
#include <stdio.h>
#include <stdlib.h>

int main(void)
{
    const double excess = 0.01;
    double dy[double_four_bar_n_states], p[PARAMETERS] = {excess}, out[2];
    struct double_four_bar *model = double_four_bar_make(malloc(double_four_bar_bytes()), &excess);
    double_four_bar_derivative(model, 0, double_four_bar_start, dy);
    for (int i = 0; i < double_four_bar_n_states; i++)
        printf("%.17g\n", dy[i]);
    double_four_bar_setup(NULL, NULL, NULL, p, NULL, p + 1);
    const double t = 0, *q = double_four_bar_start;
    double_four_bar_energy(&t, q, q + double_four_bar_n_coordinates, p, NULL, out);
    printf("%.17g\n%.17g\n", out[0], out[1]);
    free(model);
    return 0;
}
"""


@needs("gcc")
def test_what_depends_on_parameters_alone_is_computed_in_c(tmp_path):
    folder, name = tmp_path / "double_four_bar", "double_four_bar"
    export_c(name, folder)
    assert "`double_four_bar_setup`" in (folder / "README.md").read_text()
    size = re.search(r"^ \*   p\[(\d+)\]:", (folder / f"{name}_kernel.h").read_text(), re.M)[1]
    (folder / "own.c").write_text(OWN.replace("PARAMETERS", size))
    found = [float(x) for x in run(compiled(folder, name, "gcc", "own", *SANITIZED)).split()]
    start = symgen.build(name).description.start
    evaluator = symgen.build(name).with_parameters(excess=0.01).evaluator
    n = len(start) // 2
    redundant = len(symgen.build(name).description.redundant)
    dy = evaluator.equations(redundant).derivative(0.0, np.array([*start, 0.0]))
    energies = evaluator("energy", 0.0, np.array(start[:n]), np.array(start[n:]))
    assert found == [*dy.tolist(), *energies[:2].tolist()]


def test_the_readme_has_every_source_and_a_command_that_exports_the_scene_again(folders, tmp_path):
    """Kernels of power series, which only runs by them call, are left out of the others."""
    for name, folder in folders.items():
        named = {*folder.glob("*_kernel*.c"), *(folder / n for n in ("main.c", "check.c", f"{name}.c"))}
        assert {*folder.glob("*.c")} == named
        assert "_series(" not in (folder / f"{name}_kernel.h").read_text()
        assert f"symgen export {name} --out FOLDER" in (folder / "README.md").read_text()
    changed = {
        "rho": "2 kg/m",
        "analysis.outputs": ["A.position", "energy"],
        "gravity": {"acceleration": [0, "-1 m/s^2"]},
    }
    export_c("peaucellier", tmp_path / "changed", set=changed)
    text = (tmp_path / "changed" / "README.md").read_text()
    again = shlex.split(re.search("`symgen export (.*) --out FOLDER`", text)[1])
    assert again[::2] == ["peaucellier", *again[2::2]] and again[1::2] == ["--set"] * 3
    assert changes(again[2::2]) == changed
    file = tmp_path / "two rods.toml"
    shutil.copy(scene_path("vertical_rods"), file)
    export_c(file, tmp_path / "first", method="taylor")
    text = (tmp_path / "first" / "README.md").read_text()
    command = shlex.split(re.search("`symgen (export .*) --out FOLDER`", text)[1])
    with contextlib.chdir(tmp_path):
        done = CliRunner().invoke(app, [*command, "--out", "second"])
    assert done.exit_code == 0, done.exception
    assert (tmp_path / "second" / "README.md").read_text() == text


def test_a_second_export_replaces_the_first_and_nothing_else(tmp_path):
    folder = tmp_path / "out"
    first = export_c("screw_jack", folder)
    (folder / "mine.txt").write_text("kept")
    texts = {n: (folder / n).read_bytes() for n in first}
    assert export_c("screw_jack", folder) == first
    assert {n: (folder / n).read_bytes() for n in first} == texts
    export_c("vertical_rods", folder)
    assert not (folder / "screw_jack.c").exists()
    assert (folder / "vertical_rods.c").exists()
    assert (folder / "mine.txt").read_text() == "kept"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("what", ["something else", "a file", "a changed export", "no parent"])
def test_nothing_else_is_written_over(what, tmp_path):
    folder = tmp_path / "out"
    if what == "something else":
        folder.mkdir()
        (folder / "thesis.tex").write_text("years of work")
        words = "contains files other than an export"
    elif what == "a file":
        folder.write_text("years of work")
        words = "expected a folder for the export, got the file"
    elif what == "a changed export":
        export_c("vertical_rods", folder)
        (folder / "main.c").write_text("my own")
        words = "main.c was changed since it was exported"
    else:
        folder, words = tmp_path / "nowhere" / "out", "there is no folder"
    before = sorted((p, p.read_bytes() if p.is_file() else b"") for p in tmp_path.rglob("*"))
    done = CliRunner().invoke(app, ["export", "vertical_rods", "--out", str(folder)])
    assert isinstance(done.exception, ResultError)
    assert words in str(done.exception)
    assert sorted((p, p.read_bytes() if p.is_file() else b"") for p in tmp_path.rglob("*")) == before


def test_the_list_cannot_name_files_elsewhere(tmp_path):
    folder, victim = tmp_path / "out", tmp_path / "victim"
    folder.mkdir()
    victim.write_text("mine")
    (folder / "export.json").write_text(json.dumps({"exported_by": "symgen", "files": {"../victim": ""}}))
    with pytest.raises(ResultError, match="other than an export"):
        export_c("vertical_rods", folder)
    assert victim.read_text() == "mine"


def test_no_folder_is_left_by_a_bad_scene(tmp_path):
    (tmp_path / "bad.toml").write_text("symgen = 1\n")
    done = CliRunner().invoke(app, ["export", str(tmp_path / "bad.toml"), "--out", str(tmp_path / "out")])
    assert done.exit_code != 0
    assert not (tmp_path / "out").exists()


def test_every_number_of_a_state_is_told(folders):
    for name in SCENES:
        header = (folders[name] / f"{name}.h").read_text()
        count = int(re.search(r"_n_states = (\d+)", header)[1])
        told = re.findall(r"^ \*     y\[(\d+)\]  \S+  \[\S.*\]  \S", header, re.M)
        assert np.array_equal(np.array(told, dtype=int), np.arange(count)), name


def test_words_of_a_scene_stay_words(tmp_path):
    """A description cannot end the comment around it."""
    wicked = "*/ int injected(void) { return 1; } /*"
    scene = symgen.Scene(
        parameters={"rho": {"value": "1 kg", "tunable": True, "about": wicked}},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={"OA": {"points": ["O", "A"], "mass": "rho"}},
        analysis={"t_end": "1 s", "outputs": ["A.position"]},
    )
    export_c(scene, tmp_path / "out")
    for file in (tmp_path / "out").rglob("*.[ch]"):
        code = re.sub(r"/\*.*?\*/", "", file.read_text(), flags=re.DOTALL)
        assert "injected" not in code, file


@pytest.mark.parametrize(
    "name", ["main", "double", "math", "class", "unix", "state", "loop", "motion", "real_fabs"]
)
def test_names_that_c_has_are_refused(tmp_path, name):
    file = tmp_path / f"{name}.toml"
    file.write_text(scene_path("four_bar").read_text())
    with pytest.raises(ModelError, match=f"a scene called '{name}' cannot be exported"):
        export_c(file, tmp_path / "out")
    assert not (tmp_path / "out").exists()
