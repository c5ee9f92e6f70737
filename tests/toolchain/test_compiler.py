"""C compilers that are slow, hang, or write no library."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

import symgen
from symgen.errors import BuildError, SlowBackendWarning
from symgen.toolchain import compiler


def fake_compiler(folder, monkeypatch, body, limit=0.5):
    """A compiler that prints a version, does what the body says, and else calls the real one; limit [s]."""
    script = folder / "slowcc"
    script.write_text(
        f'#!/bin/sh\n[ "$1" = --version ] && {{ echo "slow 1.0"; exit; }}\n{body}\nexec cc "$@"\n'
    )
    script.chmod(0o755)
    monkeypatch.setenv("CC", str(script))
    monkeypatch.setenv("SYMGEN_CACHE", str(folder / "cache"))
    monkeypatch.setattr(compiler, "LIMIT", limit)


def runs(pid):
    """Whether a process runs; one that ended and that nobody waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
def test_a_slow_compiler_is_killed_and_tried_again_without_optimisation(tmp_path, monkeypatch):
    """The driver waits for the compiler proper, as gcc does; both ignore termination."""
    child = tmp_path / "child"
    slow = f"trap '' TERM\ncase \"$*\" in *' -c '*-O0*) ;; *' -c '*) sleep 30 & echo $! > {child}; wait; exit;; esac"
    fake_compiler(tmp_path, monkeypatch, slow, 1.5)  # in which even a busy machine compiles at -O0
    began = time.monotonic()
    with pytest.warns(
        SlowBackendWarning, match=r"exceeded the limit of 1\.5 s with four_bar_(kernel|series)\.c.*-O0"
    ):
        model = symgen.build("four_bar", backend="c")
    assert time.monotonic() - began < 20.0
    assert not runs(child.read_text().strip())
    monkeypatch.delenv("CC")
    assert model.accelerations().as_dict() == symgen.build("four_bar").accelerations().as_dict()


@pytest.mark.parametrize("when", ["*' -c '*", "*-shared*"])
def test_the_limit_is_named_where_optimisation_is_not_what_takes_long(tmp_path, monkeypatch, when):
    fake_compiler(tmp_path, monkeypatch, f'case "$*" in {when}) sleep 30 & wait; exit;; esac')
    monkeypatch.setenv("SYMGEN_CFLAGS", "-std=c11 -O0")
    began = time.monotonic()
    with pytest.raises(BuildError, match=r"exceeded the limit of 0\.5 s and was killed: \S*slowcc"):
        symgen.build("four_bar", backend="c")
    assert time.monotonic() - began < 20.0
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_compiler_that_does_not_print_its_version_is_ended(tmp_path, monkeypatch):
    fake_compiler(tmp_path, monkeypatch, "")
    (tmp_path / "slowcc").write_text("#!/bin/sh\ntrap '' TERM\nsleep 30 & wait\n")
    monkeypatch.setattr(compiler, "VERSION_LIMIT", 0.5)
    began = time.monotonic()
    with pytest.raises(BuildError, match=r"exceeded the limit of 0\.5 s .*slowcc --version"):
        symgen.build("four_bar", backend="c")
    assert time.monotonic() - began < 20.0


@pytest.mark.parametrize(
    ("variable", "value", "words"),
    [
        ("CC", 'cc "', r"CC cannot be split into words: No closing quotation"),
        ("SYMGEN_CFLAGS", "-O1 '", r"SYMGEN_CFLAGS cannot be split into words: No closing quotation"),
        ("SYMGEN_CFLAGS", "-E", "wrote no library: .* -E -shared"),
        ("SYMGEN_CFLAGS", "-S", "wrote no library: .* -S -shared"),
        ("SYMGEN_CFLAGS", "-std=c11 --version", "wrote no library"),
        ("CC", "true", "wrote no library"),
    ],
)
def test_what_makes_no_library_is_named(tmp_path, monkeypatch, variable, value, words):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv(variable, value)
    with pytest.raises(BuildError, match=words):
        symgen.build("four_bar", backend="c")
