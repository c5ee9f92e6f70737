"""Start-up: a cold build and a start from the cache, against what importing SymPy alone costs here."""

from __future__ import annotations

import os
import subprocess
import sys

from shared.timing import holds, seconds

#: On a machine that imports SymPy in half a second: 2 s for a cold build, 0.7 s for a run from the cache.
COLD, WARM = 2.0 / 0.5, 0.7 / 0.5


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
