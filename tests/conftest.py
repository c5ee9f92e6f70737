"""Shared fixtures: a cache of its own for the session, and the reference numbers."""

from __future__ import annotations

import functools
import gc
import math
import os
import sys
import warnings
from pathlib import Path

import pytest
import typer.main
from hypothesis import HealthCheck, settings

# Tests run side by side, and threads of linear algebra wait for each other by spinning: matrices of 30 rows took
# thirteen times the processor time. Set before anything imports NumPy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A tenth of the time of derivations: by default SymPy remembers the last 1000 results of each function.
os.environ.setdefault("SYMPY_CACHE_SIZE", "20000")

# Hundreds of processes are started that import symgen: without files of bytecode each compiles it again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# SymPy makes many objects that live long: looking for circles among them took a sixteenth of the time.
gc.set_threshold(1_000_000, 20, 100)

# Typer converts all commands of an app for each call of one, which takes as long as most of the calls.
# Set before a test imports typer.testing, which takes the function from here.
typer.main.get_command = functools.cache(typer.main.get_command)

# What CI finds it finds again; elsewhere every run looks at other examples.
# Machines of any load and speed run them, so examples are allowed to take long.
ANY_PACE = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("here", **ANY_PACE)
settings.register_profile("ci", derandomize=True, **ANY_PACE)
settings.load_profile("ci" if os.environ.get("CI") else "here")


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keep tests away from the user's cache; processes that share the work share one, as those of a user do."""
    base = tmp_path_factory.getbasetemp()
    shared = "PYTEST_XDIST_WORKER" in os.environ
    folder = (base.parent if shared else base) / "cache"
    folder.mkdir(exist_ok=True)
    if shared:
        from shared.shipped import FOLDER

        FOLDER.append(base.parent / "derived")
        FOLDER[0].mkdir(exist_ok=True)
    patch = pytest.MonkeyPatch()
    patch.setenv("SYMGEN_CACHE", str(folder))
    yield folder
    patch.undo()


@pytest.fixture(scope="session")
def made_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the cache of everything under generated/, one for all processes of a session."""
    base = tmp_path_factory.getbasetemp()
    return (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "generated"


@pytest.fixture(scope="session")
def made(made_in: Path) -> dict:
    """Return all that belongs under generated/, each model derived once in a process of its own."""
    from symgen.regeneration.generate import up_to_date
    from symgen.toolchain.cache import Cache

    store = Cache(made_in)
    with store.locked("all"):
        return up_to_date(store)[0]


@pytest.fixture(scope="session")
def speed_response():
    """Return steady states of an elastic linkage at two speeds, for tests of what results have in common."""
    import symgen

    speeds = [200 * math.pi / 30, 300 * math.pi / 30]
    return symgen.build("thesis_four_bar").speed_response(speeds, rtol=0.1, samples=5)


@pytest.fixture
def entry(monkeypatch, capfd):
    """Run the console script's entry in this process; return exit code, standard output and error."""
    from symgen import cli

    # The entry keeps the command alone that is named, which must last no longer than the call.
    commands, groups = cli.app.registered_commands, cli.app.registered_groups

    def called(*arguments):
        monkeypatch.setattr(cli.app, "registered_commands", commands)
        monkeypatch.setattr(cli.app, "registered_groups", groups)
        monkeypatch.setattr(sys, "argv", ["symgen", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        said = capfd.readouterr()
        return ended.value.code or 0, said.out, said.err

    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.setattr(sys.modules["__main__"], "__package__", None)  # Click names the command by it
    monkeypatch.setattr(cli.atexit, "register", lambda *_: None)
    yield called
    gc.enable()
