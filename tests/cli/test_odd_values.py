"""Values at the ends of what files, folders and numbers can be: errors of symgen, never a traceback."""

from __future__ import annotations

import subprocess
import sys

import pytest

import symgen
from symgen.errors import CacheError, DerivationError, SimulationError
from symgen.pipeline.user_system import load
from symgen.toolchain.cache import cache_root


def test_a_cache_folder_with_a_name_that_no_file_system_has(monkeypatch, tmp_path):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / ("a" * 300)))
    with pytest.raises(CacheError, match="SYMGEN_CACHE is no folder: File name too long"):
        cache_root()


def test_a_user_file_that_raises_any_exception(tmp_path):
    for error in ("GeneratorExit", "SystemExit", "MemoryError"):
        (tmp_path / "own.py").write_text(f"raise {error}('no')\n")
        with pytest.raises(DerivationError, match=f"own.py, line 1: {error}"):
            load(tmp_path / "own.py")


def test_a_loop_at_a_time_beyond_its_drive():
    with pytest.raises(SimulationError, match=r"leaves its assembly at t = 1e\+304 s"):
        symgen.build("rssr").state(t=1e308)


def test_a_swing_of_almost_nothing(tmp_path):
    (tmp_path / "task.toml").write_text(
        'symgen = 1\ntitle = "t"\n[synthesis]\nkind = "limits"\nswing = "1e-300 deg"\n'
        'crank = "1 m"\nrocker = "2 m"\nfixed_link = "2 m"\n'
    )
    command = [sys.executable, "-m", "symgen", "synthesise", str(tmp_path / "task.toml")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 3 and "which contradict: swing > 0" in done.stderr
    assert "Traceback" not in done.stderr
