"""Killed runs that are resumed, and runs of two processes: the same to the bit."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from shared.full import full
from shared.signals import ended_by

import symgen
from symgen.errors import ResultError

KILLED_RUNS = Path(__file__).parents[2] / "shared" / "killed_runs.py"
PROGRAM = [sys.executable, "-m", "symgen"]
RUN = ["simulate", "parallelogram", "--step", "5e-5", "--json"]
LONG = [*RUN, "--t-end", "20"]


def said(command, **more):
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, **more)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("times", [1, full(20)])
@pytest.mark.parametrize(
    ("scene", "steps"), [("parallelogram", 20000), full("cssp", 20000), ("elastic_slider_crank", 3000)]
)
def test_killed_at_a_random_moment_and_resumed(scene, steps, times, tmp_path):
    code, out, err = said([sys.executable, str(KILLED_RUNS), scene, str(tmp_path), str(times)])
    assert code == 0, err
    found = json.loads(out)
    assert found["same"] == times
    assert set(found["steps"]) == {steps}


#: Texts in files of results that contain the wall time.
WITH_WALL_TIME = "symgen", "symgen_digest"


def without_wall_time(text):
    summary = json.loads(text)
    del summary["statistics"]["wall_s"]
    return summary


def test_on_the_command_line(tmp_path, entry):
    """Killed, resumed, and the same as a run that nothing happened to."""
    file, saved = tmp_path / "kept", tmp_path / "resumed.npz"
    command = [*PROGRAM, *LONG, "--checkpoint", str(file), "--checkpoint-every", "0.01"]
    assert ended_by(signal.SIGKILL, command, file) == (-signal.SIGKILL, "")
    code, out, err = entry(*LONG, "--resume", file, "--out", saved)
    assert code == 0, err
    code, whole, _ = entry(*LONG, "--out", tmp_path / "whole.npz")
    assert without_wall_time(out) == without_wall_time(whole)
    with np.load(saved) as a, np.load(tmp_path / "whole.npz") as b:
        assert all(a[name].tobytes() == b[name].tobytes() for name in a.files if name not in WITH_WALL_TIME)
    code, out, err = entry(*RUN, "--t-end", "21", "--resume", file)
    assert (code, out) == (2, "")
    assert err.startswith("symgen: ") and "is the checkpoint of another run, stopped at t = " in err
    assert err.count("symgen: ") == 1


@pytest.mark.parametrize("scene", ["four_bar", "elastic_slider_crank"])
def test_an_interrupted_run_leaves_its_state(scene, tmp_path):
    """Also before the first checkpoint is due; the resumed run has the bits of a whole one."""
    model, file, parts = symgen.build(scene), tmp_path / "kept", []
    options = {"step": 1e-4} if scene == "four_bar" else {"steps": 2000}

    def interrupt(part):
        parts.append(part)
        if part > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="--resume .*kept continues it"):
        model.simulate(**options, checkpoint=file, checkpoint_every=1e9, progress=interrupt)
    found = model.simulate(**options, resume=file, progress=parts.append)
    whole = model.simulate(**options)
    assert parts[-1] == 1.0 and found.statistics["steps"] == whole.statistics["steps"]
    assert [v.values.tobytes() for v in found.variables] == [v.values.tobytes() for v in whole.variables]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["parallelogram", "--checkpoint-every", "1"], "give the file with --checkpoint"),
        (["parallelogram", "--resume", "none"], "there is no checkpoint none"),
        (["parallelogram", "--checkpoint", "none/file"], "there is no folder none"),
        (["parallelogram", "--checkpoint", "file", "--checkpoint-every", "-1"], "number of seconds"),
        (["bennett", "--checkpoint", "file"], "bennett does not support simulate: it has no free variable"),
        (["cssp", "--checkpoint-every", "1"], "give the file with --checkpoint"),
        (["cssp", "--resume", "none"], "there is no checkpoint none"),
        (["cssp", "--stabilisation-rate", "5"], "--stabilisation-rate does not apply to simulate of cssp"),
        (["thesis_four_bar", "--resume", "none"], "there is no checkpoint none"),
        (
            ["thesis_four_bar", "--max-drift", "1"],
            "--max-drift does not apply to simulate of thesis_four_bar",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(options, words, tmp_path):
    from typer.testing import CliRunner

    from symgen.cli import app

    before = Path.cwd()
    os.chdir(tmp_path)
    try:
        done = CliRunner().invoke(app, ["simulate", *options])
    finally:
        os.chdir(before)
    assert isinstance(done.exception, symgen.SymgenError)
    assert words in str(done.exception)
    assert list(tmp_path.iterdir()) == []


@contextmanager
def files_of_at_most(size):
    """Make the disk full, as far as this process can see."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_is_told_and_the_last_checkpoint_stays(tmp_path):
    """No half of a new one is left either."""
    model, file = symgen.build("parallelogram"), tmp_path / "kept"
    options = {"t_end": 2.0, "step": 1e-4, "checkpoint_every": 0.0}
    whole = model.simulate(**options, checkpoint=file)
    kept = file.read_bytes()
    with files_of_at_most(4096), pytest.raises(ResultError, match=f"cannot write the checkpoint to {file}"):
        model.simulate(**options, checkpoint=file)
    assert [p.name for p in tmp_path.iterdir()] == ["kept"]
    assert file.read_bytes() == kept
    del options["checkpoint_every"]
    again = model.simulate(**options, resume=file)
    assert all(
        a.values.tobytes() == b.values.tobytes()
        for a, b in zip(again.variables, whole.variables, strict=True)
    )


def test_two_processes_give_the_same_bits(tmp_path, monkeypatch, entry):
    """This one and another: each derives, compiles and runs by itself, with its own order of Python's sets."""
    arrays = []
    for own in (True, False):
        file = tmp_path / f"run{own}.npz"
        command = ["run", "double_four_bar", "--json", "--out", str(file)]
        monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / f"cache{own}"))
        monkeypatch.setenv("PYTHONHASHSEED", "1")
        code, out, err = said([*PROGRAM, *command]) if own else entry(*command)
        assert code == 0, err
        with np.load(file) as saved:
            arrays.append(
                {n: saved[n].tobytes() for n in saved.files if n not in WITH_WALL_TIME}
                | without_wall_time(out)
            )
    assert arrays[0] == arrays[1]
