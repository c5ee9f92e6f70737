"""Start-up: a cold build and a start from the cache, against what importing SymPy alone costs here."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

#: On a machine that imports SymPy in half a second: 2 s for a cold build, 1 s for a run from the cache.
COLD, WARM = 2.0 / 0.5, 1.0 / 0.5


def seconds(arguments, environment, before=lambda: None):
    """Best whole-process time of a few runs: the machine's own noise only ever adds."""
    best = float("inf")
    for _ in range(4):
        before()
        begun = time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)
        best = min(best, time.perf_counter() - begun)
    return best


@pytest.fixture(scope="module")
def sympy_seconds():
    return max(0.5, seconds(["-c", "import sympy"], dict(os.environ)))


def test_cold_build(tmp_path, sympy_seconds):
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}

    def clear():
        subprocess.run([sys.executable, "-m", "symgen", "cache", "clear"], check=True, env=environment)

    assert seconds(["-m", "symgen", "build", "peaucellier"], environment, clear) <= COLD * sympy_seconds


def test_run_from_the_cache(tmp_path, sympy_seconds):
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}
    run = ["-m", "symgen", "run", "peaucellier", "--json"]
    subprocess.run([sys.executable, *run], check=True, env=environment, stdout=subprocess.DEVNULL)
    assert seconds(run, environment) <= WARM * sympy_seconds
