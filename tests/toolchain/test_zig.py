"""The C compiler that is a Python package, where there is no other."""

import sys

import pytest

import symgen
from symgen.toolchain import compiler


@pytest.fixture
def no_other(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "/nowhere")


def test_zig_comes_last_and_only_where_it_is_installed(no_other, monkeypatch):
    monkeypatch.setattr(compiler, "version_of", lambda command, changed: "clang version 21")
    monkeypatch.setattr(compiler, "find_spec", lambda name: name == "ziglang")
    found = compiler.find_compiler()
    assert found is not None and found.command[:4] == (sys.executable, "-m", "ziglang", "cc")
    monkeypatch.setattr(compiler, "find_spec", lambda name: None)
    assert compiler.find_compiler() is None


def test_zig_gives_the_bits_of_the_other_compiler(monkeypatch, tmp_path):
    pytest.importorskip("ziglang")
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "a"))
    first = symgen.build("four_bar", backend="c").simulate(0.2)
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "b"))
    monkeypatch.setenv("PATH", "/nowhere")
    second = symgen.build("four_bar", backend="c").simulate(0.2)
    assert first["B.position"].values.tobytes() == second["B.position"].values.tobytes()
