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
#: Most modules of symgen that a run from the cache loads: 97 today. Each takes about half a millisecond.
MODULES = 100


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


def loaded(command, environment):
    """Return the modules that a command has loaded at its end."""
    program = (
        "import sys; from symgen import cli\n"
        "sys.argv = ['symgen', *sys.argv[1:]]\n"
        "try: cli.main()\n"
        "except SystemExit as ended: assert not ended.code, ended.code\n"
        "print(*sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *command],
        check=True,
        env=environment,
        capture_output=True,
        text=True,
    )
    return set(done.stdout.splitlines()[-1].split())


def test_no_linkage_waits_for_what_it_does_not_need(tmp_path):
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}
    heavy = {"scipy", "matplotlib", "xarray", "pandas"}
    for command, other in (
        (["build", "peaucellier"], heavy),
        (["run", "peaucellier", "--json"], heavy | {"rich"}),
    ):
        assert not loaded(command, environment) & other


def test_a_run_from_the_cache_loads_its_own_analysis_alone(tmp_path):
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}
    subprocess.run([sys.executable, "-m", "symgen", "build", "four_bar"], check=True, env=environment)
    modules = {name for name in loaded(["run", "four_bar"], environment) if name.startswith("symgen.")}
    rooms = ("mechanics", "models", "lowering", "codegen", "scene.rods", "loads", "joints")
    runtime = (
        "elastic",
        "loop",
        "chain",
        "linearisation",
        "rods.equilibrium",
        "rods.constraints",
        "rods.stepper",
    )
    commands = ("inspection", "design", "optimising", "reporting", "bench")
    unused = [f"symgen.{room}" for room in rooms]
    unused += [f"symgen.runtime.{room}" for room in runtime] + [f"symgen.cli.{name}" for name in commands]
    assert not modules.intersection(unused)
    assert len(modules) <= MODULES


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
