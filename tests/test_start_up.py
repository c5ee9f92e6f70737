"""Start-up: a cold build and a start from the cache, against what importing SymPy alone costs here."""

from __future__ import annotations

import os
import subprocess
import sys
import time

#: On a machine that imports SymPy in half a second: 2 s for a cold build, 0.7 s for a run from the cache.
COLD, WARM = 2.0 / 0.5, 0.7 / 0.5
#: Rounds at most: other work on the machine only ever adds to a time, so the best of each counts.
ROUNDS = 8


def seconds(arguments, environment):
    begun = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)
    return time.perf_counter() - begun


def holds(arguments, environment, bound, before=lambda: None):
    """Time a command and the import of SymPy in turn, until the bound holds or the rounds are over."""
    command = imported = float("inf")
    for _ in range(ROUNDS):
        imported = min(imported, seconds(["-c", "import sympy"], environment))
        before()
        command = min(command, seconds(arguments, environment))
        if command <= bound * max(0.5, imported):
            return True
    return False


def test_cold_build(tmp_path):
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}

    def clear():
        seconds(["-m", "symgen", "cache", "clear"], environment)

    assert holds(["-m", "symgen", "build", "peaucellier"], environment, COLD, clear)


def test_run_from_the_cache(tmp_path):
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}
    run = ["-m", "symgen", "run", "peaucellier", "--json"]
    seconds(run, environment)
    assert holds(run, environment, WARM)


def test_no_linkage_waits_for_what_it_does_not_need(tmp_path):
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}
    program = (
        "import sys; from symgen.cli import app\n"
        "app(sys.argv[1:], standalone_mode=False)\n"
        "print(*sorted(m for m in sys.modules if '.' not in m))"
    )
    for command in (["build", "peaucellier"], ["run", "peaucellier", "--json"]):
        done = subprocess.run(
            [sys.executable, "-c", program, *command],
            check=True,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert not set(done.stdout.splitlines()[-1].split()) & {"scipy", "matplotlib", "xarray", "pandas"}
