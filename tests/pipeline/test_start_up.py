"""Start-up: a cold build and a start from the cache, against what importing SymPy alone costs here."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from shared.timing import holds, seconds

import symgen

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
    heavy = {"scipy", "matplotlib", "xarray", "pandas"}
    for command, other in (
        (["build", "peaucellier"], heavy),
        (["run", "peaucellier", "--json"], heavy | {"rich"}),
    ):
        done = subprocess.run(
            [sys.executable, "-c", program, *command],
            check=True,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert not set(done.stdout.splitlines()[-1].split()) & other


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-c", "import symgen; print(symgen.__version__)"], symgen.__version__),
        (["-m", "symgen", "--version"], symgen.__version__),
    ],
)
def test_a_folder_named_symgen_is_not_taken_for_the_package(tmp_path, arguments, said):
    """As above a clone of that name: a folder without __init__.py is a namespace package."""
    (tmp_path / "symgen" / "symgen").mkdir(parents=True)
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert (done.stdout.strip(), done.stderr) == (said, "")
