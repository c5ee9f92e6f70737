"""Checkpoints with altered numbers and a new digest: an error or a wrong run, never a crash of Python."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import ResultError, SimulationError
from symgen.runtime.digest import digest

#: Resumes runs from altered checkpoints: arguments are the scene, options of the run, a folder, and the trials.
PROGRAM = """
import json, sys
import numpy as np
import symgen
from symgen.errors import SymgenError
from symgen.runtime.digest import digest

scene, options, folder, first, last = sys.argv[1], json.loads(sys.argv[2]), sys.argv[3], *map(int, sys.argv[4:])
model = symgen.build(scene)
path = f"{folder}/run.ckpt"
names = options.pop("verb", "simulate")
try:
    getattr(model, names)(**options, checkpoint=path, checkpoint_every=0.0)
except SymgenError:
    pass
with np.load(path) as archive:
    header = json.loads(str(archive["header"]))
    arrays = {k: archive[k] for k in archive.files if k != "header"}
ended = dict.fromkeys(("completed", "refused"), 0)
for trial in range(first, last):
    rng = np.random.default_rng(trial)
    altered = {k: v.copy() for k, v in arrays.items()}
    name = rng.choice([k for k in altered if altered[k].size])
    raw = altered[name].reshape(-1).view(np.uint8)
    words = raw[: len(raw) // 8 * 8].view(np.int64)
    kind = trial % 4
    if kind == 0 or not len(words):
        at = rng.integers(0, len(raw), rng.integers(1, 64))
        raw[at] = rng.integers(0, 256, len(at))
    elif kind == 1:  # every word that may be an index, that is, every small one
        small = np.flatnonzero(abs(words) < 1000)
        words[small] = rng.integers(-1000, 100_000, len(small))
    elif kind == 2:
        at = rng.integers(0, len(words), rng.integers(1, 200))
        words[at] = rng.integers(-(2**62), 2**62, len(at))
    else:
        altered[name] = altered[name][: rng.integers(0, len(altered[name]) + 1)] if altered[name].ndim else altered[name]
    np.savez(path + ".npz", header=np.array(json.dumps(header | {"digest": digest(altered)})), **altered)
    try:
        getattr(model, names)(**options, resume=path + ".npz", max_wall=0.5)
        ended["completed"] += 1
    except SymgenError:
        ended["refused"] += 1
print(json.dumps(ended))
"""

RUNS = [
    ("triple_pendulum", {"method": "radau5", "rtol": 1e-6}),
    full("triple_pendulum", {"method": "generalized-alpha", "step": 1e-3}),
    full("peaucellier", {"method": "rattle4", "step": 1e-3}),
    full("parallelogram", {"method": "dop853", "t_end": 2.0}),
    full("cssp", {"t_end": 0.5}),
    full("elastic_four_bar", {"rtol": 1e-2}),
    full("elastic_slider_crank", {"verb": "large_rotation", "rtol": 1e-1, "samples": 5, "t_end": 0.01}),
]


@pytest.mark.parametrize("trials", [16, full(300)])
@pytest.mark.parametrize(("scene", "options"), RUNS)
def test_altered_checkpoints_do_not_crash(scene, options, trials, tmp_path):
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM, scene, json.dumps(options), str(tmp_path), "0"]
    done = subprocess.run([*command, str(trials)], capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr[-2000:]
    ended = json.loads(done.stdout)
    assert sum(ended.values()) == trials and ended["refused"] > 0


def test_a_state_without_slopes_ends_the_run(tmp_path):
    """The matrices of radau5 were evaluated again and again there, whatever the limit of wall time."""
    command = [
        sys.executable,
        "-W",
        "ignore",
        "-c",
        PROGRAM,
        RUNS[0][0],
        json.dumps(RUNS[0][1]),
        str(tmp_path),
    ]
    done = subprocess.run([*command, "106", "107"], capture_output=True, text=True, timeout=120)
    assert json.loads(done.stdout) == {"completed": 0, "refused": 1}, done.stderr


def altered(path: Path, **changes) -> Path:
    """Write a checkpoint with other arrays and a new digest."""
    with np.load(path) as archive:
        header = json.loads(str(archive["header"]))
        arrays = {k: archive[k] for k in archive.files if k != "header"} | changes
    header["digest"] = digest(arrays)
    np.savez(path.with_suffix(".npz"), header=np.array(json.dumps(header)), **arrays)
    return path.with_suffix(".npz")


@pytest.mark.parametrize("changed", [np.nan, np.inf, -0.1, 3.0, 0.4])
def test_times_of_samples_are_checked(changed, tmp_path):
    """Their bytes are among those of the run. A last sample at 0.4 s would follow that at 0.5 s."""
    model, path, times = symgen.build("triple_pendulum"), tmp_path / "run.ckpt", np.linspace(0.0, 0.6, 7)
    options = {"t_end": 0.6, "samples": 7, "step": 1e-2, "method": "rk4"}
    with pytest.raises(SimulationError, match="max_wall"):
        model.simulate(**options, checkpoint=path, max_wall=1e-9)
    with np.load(path) as archive:
        run = archive["run"].view(float).copy()
    (at,) = (k for k in range(len(run)) if np.array_equal(run[k : k + 7], times))
    model.simulate(**options, resume=altered(path, run=run.view(np.uint8)))
    run[at + 6] = changed
    with pytest.raises(ResultError, match="is an incomplete checkpoint: expected the saved counts and times"):
        model.simulate(**options, resume=altered(path, run=run.view(np.uint8)))


@pytest.mark.parametrize(
    "changes",
    [
        {"passages": np.array([[0.1, 0.5, 99.0]])},
        {"passages": np.array([[0.1, 0.5, np.nan]])},
        {"events": np.array([[0.1, 0.0, 1.0]]), "event_states": np.zeros((1, 3))},
        {"run": np.zeros(100, np.uint8)},
        {"equations": np.zeros(100, np.uint8)},
    ],
)
def test_arrays_of_other_sizes_are_named(changes, tmp_path):
    model, path = symgen.build("triple_pendulum"), tmp_path / "run.ckpt"
    model.simulate(method="radau5", rtol=1e-6, checkpoint=path, checkpoint_every=0.0)
    with pytest.raises(ResultError, match="is an incomplete checkpoint: expected"):
        model.simulate(method="radau5", rtol=1e-6, resume=altered(path, **changes))
