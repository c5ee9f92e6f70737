"""Exported C in a control loop: parameters that change between runs, and ends before the present time."""

from __future__ import annotations

import math
import shutil
import subprocess

import pytest
from shared.linkages import at, ground

import symgen
from symgen.export import export_c

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")

#: 40 runs of 0.05 s, the last 20 with another value of the first parameter; then runs to the past.
LOOP = r"""
#include "scene.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(void)
{
    double t = scene_t_start, y[scene_n_states];
    memcpy(y, scene_start, sizeof y);
    struct scene *model = scene_make(malloc(scene_bytes()), NULL);
    for (int k = 0; k < 40; k++) {
        const double p[scene_n_parameters] = {k < 20 ? FIRST : SECOND};
        scene_set(model, p);
        const int status = scene_run(model, &t, 0.05*(k + 1), 1e-11, 1e-13, 100000, y);
        if (status)
            return puts(scene_message(status)), 1;
    }
    for (int i = 0; i < scene_n_states; i++)
        printf("%.17g ", y[i]);
    double before[scene_n_states];
    memcpy(before, y, sizeof y);
    const double past[] = {1.0, -1e30, NAN};
    for (int i = 0; i < 3; i++) {
        const int status = scene_run(model, &t, past[i], 1e-11, 1e-13, 100000, y);
        if (!status || !strstr(scene_message(status), "before its start"))
            return 2;
        if (scene_statistics(model).steps || t != 2.0 || memcmp(before, y, sizeof y))
            return 3;
    }
    const int status = scene_run(model, &t, t, 1e-11, 1e-13, 100000, y);
    free(model);
    return status;
}
"""


def sources(folder):
    return [str(f) for f in sorted(folder.rglob("*.c")) if f.name not in ("main.c", "check.c")]


def end(scene, folder, first, second, method="dop853"):
    """Return the state behind runs of 1 s with each value of the first parameter."""
    export_c(scene, folder, method=method)
    (folder / "own.c").write_text(LOOP.replace("FIRST", str(first)).replace("SECOND", str(second)))
    made = folder / "own"
    done = subprocess.run(
        ["gcc", "-O1", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined", "-o", made]
        + [*sources(folder), "-lm"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    done = subprocess.run([made], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, (done.returncode, done.stdout, done.stderr)
    return [float(x) for x in done.stdout.split()]


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_revolutions_are_counted_across_changes_of_an_input(method, tmp_path):
    """A rod on a torsion spring under a torque: an oscillator, two revolutions from its start and back."""
    scene = symgen.Scene(
        parameters={"k": "0.5 N*m"},
        inputs={"T": "0 N*m"},
        points={"O": ground(0, 0), "P": {"at": ["0.5 m", 0]}},
        links={"arm": {"points": ["O", "P"], "mass": "0.6 kg"}},
        torques=[{"link": "arm", "torque": "T"}],
        torsion_springs=[{"link": "arm", "stiffness": "k"}],
        gravity={"acceleration": [0, 0]},
        analysis={"t_end": "2 s"},
    )
    x, y = end(scene, tmp_path / "scene", 3, 2, method)[:2]
    rate = math.sqrt(0.5 / (0.6 * 0.5**2 / 3))
    angle, speed = 0.0, 0.0
    for torque in (3, 2):
        off = angle - torque / 0.5
        angle = torque / 0.5 + off * math.cos(rate) + speed / rate * math.sin(rate)
        speed = speed * math.cos(rate) - rate * off * math.sin(rate)
    assert (x, y) == pytest.approx((0.5 * math.cos(angle), 0.5 * math.sin(angle)), abs=1e-8)


def test_branches_are_those_of_the_new_parameters(tmp_path):
    """A force that pushes away from an edge, which a parameter moves behind the point."""
    scene = symgen.Scene(
        inputs={"edge": "0 m"},
        points={"O": ground(0, -9), "G": ground(1, -9), "A": at(0, 0)},
        links={"base": {"points": ["O", "G"]}},
        masses=[{"point": "A", "mass": "1 kg"}],
        parameters={"F": "1 N"},
        forces=[{"point": "A", "force": ["F*sign(A.x - edge)", 0]}],
        gravity={"acceleration": [0, 0]},
        analysis={"t_end": "2 s"},
    )
    found = end(scene, tmp_path / "scene", -1, 10)
    assert found[:4] == pytest.approx([1, 0, 0, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("name", "method"),
    [("vertical_rods", "taylor"), ("vertical_rods", "dop853"), ("screw_jack", "dop853")]
    + [("elastic_slider_crank", "dop853"), ("cssp", "dop853")],
)
def test_every_source_compiles_in_the_usual_dialects(name, method, tmp_path):
    """That of the compiler too, in which its headers declare more names."""
    export_c(name, tmp_path / name, method=method)
    files = [str(f) for f in sorted((tmp_path / name).rglob("*.c"))]
    for standard in ([], ["-std=c11"]):
        command = ["gcc", *standard, "-fsyntax-only", "-Wall", "-Wextra", *files]
        done = subprocess.run(command, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")


STEP = r"""
#include "elastic_slider_crank.h"
#include <stdlib.h>
#include <string.h>

int main(void)
{
    double t = elastic_slider_crank_t_start, y[elastic_slider_crank_n_states];
    memcpy(y, elastic_slider_crank_start, sizeof y);
    struct elastic_slider_crank *model = elastic_slider_crank_make(malloc(elastic_slider_crank_bytes()), NULL);
    const int status = elastic_slider_crank_step(model, &t, t - 1, 8, y);
    const int moved = memcmp(y, elastic_slider_crank_start, sizeof y) != 0 || t != elastic_slider_crank_t_start;
    const int still = elastic_slider_crank_step(model, &t, t, 8, y);
    free(model);
    return moved ? 3 : still ? 4 : !strstr(elastic_slider_crank_message(status), "before its start");
}
"""


def test_fixed_steps_to_an_earlier_time_have_a_status(tmp_path):
    folder = tmp_path / "out"
    export_c("elastic_slider_crank", folder)
    (folder / "own.c").write_text(STEP)
    made = folder / "own"
    subprocess.run(["gcc", "-O0", "-o", made, *sources(folder), "-lm"], check=True)
    assert subprocess.run([made]).returncode == 0
