"""Sweeps in other processes: the same bytes, processes that are killed, executors that fail."""

from __future__ import annotations

import importlib.util
import os
import pickle
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from itertools import count, islice
from multiprocessing import active_children
from pathlib import Path

import pytest
from shared.full import full
from shared.variants import crank_rocker_with_lengths
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ArgumentError, CapabilityError, ModelError, SimulationError
from symgen.runtime.sweeps import executors
from symgen.runtime.sweeps.stores import Zarr, opened
from symgen.runtime.sweeps.sweep import Sweep

OF = {"a": [0.09, 0.1, 2.0, 0.11, 0.1, 0.105], "b": [0.34, 0.35, 0.35, 0.36, 0.35, 0.34]}  # 2 m is too long
WANTED = {"analysis": "inverse_dynamics", "sampling": "list", "outputs": ["crank.torque"], "samples": 21}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return symgen.build(crank_rocker_with_lengths(tmp_path_factory.mktemp("sweeps")), backend="c")


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def whole(model, tmp_path_factory):
    """The store of a sweep in one thread."""
    file = tmp_path_factory.mktemp("whole") / "one.zarr"
    runs = model.sweep(OF, file=file, chunk=1, threads=1, **WANTED)
    assert [bool(e) for e in runs["error"].values] == [False, False, True, False, False, False]
    return file


def test_threads_of_an_executor_write_the_same_bytes(model, whole, tmp_path):
    told = []
    with ThreadPoolExecutor(2) as pool:
        model.sweep(OF, file=tmp_path / "two.zarr", chunk=1, executor=pool, progress=told.append, **WANTED)
        held = model.sweep(OF, chunk=4, executor=pool, **WANTED)
    assert files(whole) == files(tmp_path / "two.zarr")
    assert told == pytest.approx([1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6, 1.0, 1.0])
    assert held["crank.torque.peak"].equals(opened(whole)["crank.torque.peak"].compute())


def test_a_task_has_the_parameters_of_its_own_runs(model, monkeypatch):
    class Measuring(Executor):
        def submit(self, task, *given):
            sizes.append(len(pickle.dumps(given)))
            done: Future = Future()
            done.set_exception(OSError("no worker is left"))
            return done

    sizes: list[int] = []
    for runs in (100, 100_000):
        of = {"a": [0.1] * runs, "b": [0.35] * runs}
        with pytest.raises(SimulationError, match="no worker is left"):
            model.sweep(of, executor=Measuring(), chunk=64, **WANTED)
    assert max(sizes) - min(sizes) < 64 * 2 * 8


def test_processes_write_the_same_bytes_and_are_replaced_when_killed(model, whole, tmp_path, monkeypatch):
    """One of two processes is killed when the first chunk has been written."""
    write, written = Zarr.write, []

    def killing(self, first, arrays):
        write(self, first, arrays)
        if not written:
            os.kill(active_children()[0].pid, signal.SIGKILL)
        written.append(first)

    monkeypatch.setattr(Zarr, "write", killing)
    model.sweep(OF, file=tmp_path / "killed.zarr", chunk=1, executor=2, **WANTED)
    assert sorted(written) == [0, 1, 2, 3, 4, 5]
    assert files(tmp_path / "killed.zarr") == files(whole)


def _ending(pipe, work):
    """Be killed while a result is written: its length is there, and the rest is not."""
    pipe.recv()
    os.write(pipe.fileno(), (2**20).to_bytes(4, "big") + b"begun")
    os.kill(os.getpid(), signal.SIGKILL)


def test_processes_that_always_end_and_executors_that_fail_are_named(model, monkeypatch):
    class Refusing(Executor):
        def submit(self, task, *arguments):
            raise OSError("no worker is left")

    monkeypatch.setattr(executors, "serve", _ending)
    with pytest.raises(SimulationError, match="3 times in a row, a process of the sweep ended"):
        model.sweep(OF, executor=1, **WANTED)
    with pytest.raises(SimulationError, match="executor of the sweep failed: OSError: no worker is left"):
        model.sweep(OF, executor=Refusing(), **WANTED)
    for wrong in (0, True, "tcp://here"):
        with pytest.raises(ModelError, match="expected an executor: a number of processes"):
            model.sweep(OF, executor=wrong, **WANTED)


def test_errors_of_a_chunk_end_the_sweep_and_workers_of_other_versions_are_refused(model, monkeypatch):
    def wrong(*_):
        raise ModelError("histories have equal lengths")

    with ThreadPoolExecutor(1) as pool:
        with monkeypatch.context() as patch, pytest.raises(ModelError, match="histories have equal lengths"):
            patch.setattr(Sweep, "arrays", wrong)
            model.sweep(OF, executor=pool, **WANTED)
        monkeypatch.setattr(executors, "packed", lambda *_: pickle.dumps(("0.0", "other", b"of a later one")))
        with pytest.raises(CapabilityError, match=r"from symgen 0\.0 differ"):
            model.sweep(OF, executor=pool, **WANTED)


def test_a_sweep_that_fails_here_cancels_what_it_submitted(model):
    class First(Executor):
        """Carries out its first task only."""

        def __init__(self):
            self.made = []

        def submit(self, task, *given):
            self.made.append(Future())
            if len(self.made) == 1:
                self.made[0].set_result(task(*given))
            return self.made[-1]

    def tell(_):
        raise ValueError("no more")

    executor = First()
    with pytest.raises(ValueError, match="no more") as kept:
        model.sweep(OF, executor=executor, chunk=1, progress=tell, **WANTED)
    assert kept.traceback and len(executor.made) > 1
    assert all(future.cancelled() for future in executor.made[1:])


def test_errors_of_arguments_come_back_from_processes():
    error = ArgumentError("samples", before="expected ", after=" of at least 2", call="simulate")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.named("n")) == (str(error), "expected n of at least 2")


def test_processes_end_with_the_one_that_started_them(tmp_path):
    """The process that sweeps is killed: those that it started end by themselves."""
    program = tmp_path / "sweeping.py"
    program.write_text(
        "import symgen\n"
        "from multiprocessing import active_children\n"
        "if __name__ == '__main__':\n"
        "    def tell(_): print(*(p.pid for p in active_children()), flush=True)\n"
        "    of = {'S1': [0.001 * i for i in range(400)]}\n"
        "    symgen.build('slider_crank').sweep(of, chunk=1, executor=1, progress=tell, samples=9)\n"
    )
    with subprocess.Popen([sys.executable, program], stdout=subprocess.PIPE, text=True) as process:
        started = [int(pid) for pid in process.stdout.readline().split()]
        process.kill()
    assert started
    until = time.monotonic() + 30.0
    while any(map(_is_there, started)):
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.full
@pytest.mark.parametrize("victim", ["sweep", "worker"])
def test_sweeps_killed_at_random_times_end_with_the_same_bytes(victim, tmp_path):
    """The process that sweeps is killed and started again, or one of its two workers is killed, ten times."""
    program, chances, kills = tmp_path / "sweeping.py", random.Random(1), 0
    program.write_text(
        "import sys, symgen\n"
        "from multiprocessing import active_children\n"
        "if __name__ == '__main__':\n"
        "    def tell(_): print(*(p.pid for p in active_children()), flush=True)\n"
        "    of, to = {'S1': [1e-6 * i for i in range(3200)]}, {'file': sys.argv[1], 'executor': 2}\n"
        "    symgen.build('slider_crank').sweep(of, chunk=64, progress=tell, samples=361, **to)\n"
    )
    for store in ("whole.zarr", "killed.zarr"):
        ended = False
        while not ended:
            with subprocess.Popen(
                [sys.executable, program, tmp_path / store], stdout=subprocess.PIPE, text=True
            ) as process:
                while store == "killed.zarr" and kills < 10:
                    lines = list(islice(process.stdout, chances.randint(1, 6)))
                    time.sleep(chances.uniform(0.0, 0.05))
                    if not lines or process.poll() is not None:
                        break
                    kills += 1
                    if victim == "sweep":
                        process.kill()
                        break
                    with suppress(ProcessLookupError):
                        os.kill(int(chances.choice(lines[-1].split())), signal.SIGKILL)
                process.communicate()
            ended = process.returncode == 0
            assert ended or process.returncode == -signal.SIGKILL
    whole, killed = files(tmp_path / "whole.zarr"), files(tmp_path / "killed.zarr")
    assert kills >= 5
    assert whole == {name: content for name, content in killed.items() if not name.endswith(".partial")}


def _is_there(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="Dask is not installed")
@pytest.mark.parametrize("kills", [1, full(10)])
def test_a_dask_cluster_writes_the_same_bytes_and_outlives_killed_workers(kills, model, whole, tmp_path):
    """A worker is killed in each of some sweeps: before its first chunk, or after a random number of chunks."""
    import dask
    from distributed import Client, LocalCluster

    chances = random.Random(1)
    with LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        for number in range(kills):
            client.wait_for_workers(2)
            workers = client.run(os.getpid, on_error="ignore")  # but one just killed
            victim = chances.choice(sorted(workers.values()))
            after, reports = chances.randrange(5) if number else 0, count(1)

            def killing(_, victim=victim, after=after, reports=reports):
                if next(reports) == after:
                    os.kill(victim, signal.SIGKILL)

            if not after:
                os.kill(victim, signal.SIGKILL)
            file = tmp_path / f"dask_{number}.zarr"
            model.sweep(OF, file=file, chunk=1, executor=client, progress=killing, **WANTED)
            assert files(whole) == files(file)
        done = CliRunner().invoke(app, ["sweep", "slider_crank", "--vary", "S1=0 in:9 in:4", "--outputs",
            "theta1.drive", "--dask", cluster.scheduler_address, "--out", str(tmp_path / "cli.zarr")])  # fmt: skip
        assert done.exit_code == 0, done.exception
    assert (tmp_path / "cli.zarr").is_dir()
    quick = dask.config.set({"distributed.comm.timeouts.connect": "0.2s"})
    with quick, pytest.raises(ModelError, match="there is no Dask scheduler at"):
        executors.dask_client("tcp://127.0.0.1:1")
