"""The cache under concurrency, corruption, full disks and missing compilers."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from shared.full import full, full_unless

import symgen
from symgen.errors import BuildError, CacheError, ModelError, SlowBackendWarning
from symgen.toolchain.cache import Cache, key

RUN = "import symgen; m = symgen.build('four_bar'); print(m.backend, m.accelerations()['A'].tolist())"


def entries(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_the_logger_reports_a_build_and_no_later_call(cache, caplog):
    caplog.set_level("INFO", "symgen")
    symgen.build("four_bar")
    (line,) = caplog.messages
    assert line == "four_bar: deriving and compiling equations of motion; later calls use the cache"
    symgen.build("four_bar")
    assert caplog.messages == [line]


@pytest.mark.parametrize("count", [3, full(8)])
def test_processes_build_one_entry_at_once(cache, count):
    running = [
        subprocess.Popen(
            [sys.executable, "-c", RUN], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(count)
    ]
    answers = [process.communicate(timeout=300) for process in running]
    assert [p.returncode for p in running] == [0] * count, answers
    assert len({out for out, _ in answers}) == 1
    (entry,) = entries(cache)
    assert entry.startswith("four_bar-")


@pytest.mark.parametrize(
    ("file", "how"),
    full_unless(
        lambda file, how: file == "kernels.so" or how == "flipped",
        [
            (file, how)
            for file in ("kernels.so", "description.json", "checksums.json", "four_bar_kernel.c")
            for how in ("truncated", "flipped", "gone")
        ],
    ),
)
def test_a_broken_entry_is_built_again(cache, file, how):
    first = symgen.build("four_bar", backend="numpy" if file.endswith(".so") and os.name == "nt" else "auto")
    expected = first.accelerations().as_dict()
    (entry,) = cache.iterdir()
    path = entry / file
    content = path.read_bytes()
    # The library may be mapped by this process: break a new file, not the mapped one.
    path.unlink()
    if how == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif how == "flipped":
        middle = len(content) // 2
        path.write_bytes(content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :])
    assert Cache().find(entry.name) is None
    again = symgen.build("four_bar")
    assert again.accelerations().as_dict() == expected
    assert Cache().find(entry.name) is not None
    assert entries(cache) == [entry.name]


def test_second_build_takes_the_entry(cache):
    symgen.build("four_bar")
    (entry,) = cache.iterdir()
    before = entry.stat().st_mtime_ns, (entry / "kernels.so").stat().st_mtime_ns
    symgen.build("four_bar")
    assert (entry.stat().st_mtime_ns, (entry / "kernels.so").stat().st_mtime_ns) == before


def test_a_user_without_a_home_gets_a_named_error(cache, monkeypatch):
    def no_home(*_args, **_options):
        raise RuntimeError("could not determine the home directory")

    monkeypatch.delenv("SYMGEN_CACHE")
    monkeypatch.setattr("platformdirs.user_cache_dir", no_home)
    with pytest.raises(CacheError, match="this user has no home\n  Point SYMGEN_CACHE"):
        symgen.build("four_bar", backend="numpy")


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="there are no POSIX users here")
@pytest.mark.parametrize("umask", [0o002, 0o000])
def test_entries_are_found_whatever_the_umask_leaves_to_a_group(cache, monkeypatch, umask):
    monkeypatch.setattr("symgen.toolchain.ownership.is_private", lambda group, user: False)
    before = os.umask(umask)
    try:
        symgen.build("four_bar", backend="numpy")
    finally:
        os.umask(before)
    (name,) = entries(cache)
    assert Cache().find(name)


def test_key_holds_scene_flags_and_compiler(cache, monkeypatch, tmp_path):
    symgen.build("four_bar")
    symgen.build("four_bar", set={"links.crank.mass": "2 kg"})
    monkeypatch.setenv("SYMGEN_CFLAGS", "-std=c11 -O0")
    symgen.build("four_bar")
    other = tmp_path / "othercc"
    other.write_text('#!/bin/sh\n[ "$1" = --version ] && { echo "other 1.0"; exit; }\nexec cc "$@"\n')
    other.chmod(0o755)
    monkeypatch.setenv("CC", str(other))
    symgen.build("four_bar")
    assert len(entries(cache)) == 4


def test_flags_that_tune_to_the_cpu_put_the_cpu_into_the_key():
    from symgen.toolchain.compiler import Compiler

    plain, tuned = (
        Compiler(("cc",), "cc 1", flags).identity for flags in (("-O2",), ("-O2", "-march=native"))
    )
    assert len(tuned.split("\n")[-1]) > 10
    assert plain.split("\n")[-1] == ""


def test_key_tells_parts_apart():
    assert key("ab", "c") != key("a", "bc")
    assert key("a") == key("a")


def test_tunable_parameters_are_changed_without_a_new_entry(cache):
    light = symgen.build("peaucellier")
    heavy = symgen.build("peaucellier", set={"rho": "2 kg/m"})
    assert heavy.parameters == {"rho": 2.0}
    assert len(entries(cache)) == 1
    a, b = (m.accelerations() for m in (light, heavy))
    assert b.multipliers["BE"] == pytest.approx(2 * a.multipliers["BE"], rel=1e-12)


def test_a_cache_that_cannot_be_written_is_a_clear_error(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("SYMGEN_CACHE", str(blocked / "cache"))
    with pytest.raises(CacheError, match=r"cannot write the cache folder .*\n.*SYMGEN_CACHE"):
        symgen.build("four_bar")


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root writes everywhere")
def test_a_read_only_cache_is_a_clear_error(cache):
    cache.mkdir()
    cache.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        with pytest.raises(CacheError, match="cannot write the cache folder"):
            symgen.build("four_bar")
    finally:
        cache.chmod(stat.S_IRWXU)


@pytest.mark.parametrize("full_from", [0, 1, 2, 3])
def test_a_full_disk_is_a_clear_error_and_leaves_nothing(cache, monkeypatch, full_from):
    """The disk is full from the n-th file on that Python writes."""
    import errno

    written = []
    real = Path.write_text

    def write_text(self, *args, **kwargs):
        written.append(self)
        if len(written) > full_from:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(self, *args, **kwargs)

    monkeypatch.setattr(Path, "write_text", write_text)
    with pytest.raises(CacheError, match=r"No space left on device\n.*Free space"):
        symgen.build("four_bar")
    assert entries(cache) == []


def test_clearing_leaves_what_is_not_symgens(cache):
    """A folder that is no cache is named as one by mistake: nothing of it goes."""
    symgen.build("four_bar")
    (cache / ".ssh").mkdir()
    (cache / ".ssh" / "key").write_text("")
    (cache / "package.lock").write_text("")
    assert Cache().clear() == 1
    assert sorted(p.name for p in cache.iterdir()) == [".ssh", "package.lock"]
    assert (cache / ".ssh" / "key").is_file()


def test_a_read_only_cache_that_holds_the_scene_is_enough(cache):
    expected = symgen.build("four_bar").accelerations().as_dict()
    for path in [*cache.rglob("*"), cache]:
        path.chmod(path.stat().st_mode & ~0o222)
    try:
        assert symgen.build("four_bar").accelerations().as_dict() == expected
    finally:
        for path in [cache, *cache.rglob("*")]:
            path.chmod(path.stat().st_mode | 0o200)


def test_compiler_errors_show_the_compilers_own_text(cache, monkeypatch):
    monkeypatch.setenv("SYMGEN_CFLAGS", "-std=c11 -no-such-flag-at-all")
    with pytest.raises(BuildError, match=r"(?s)no-such-flag-at-all.*SYMGEN_CFLAGS"):
        symgen.build("four_bar")
    assert entries(cache) == []


def test_a_compiler_that_is_not_there_is_named(cache, monkeypatch):
    monkeypatch.setenv("CC", "/nowhere/cc")
    with pytest.raises(BuildError, match="/nowhere/cc"):
        symgen.build("four_bar")


def test_without_a_compiler_shipped_kernels_or_numpy_run_and_say_so(cache, monkeypatch):
    expected = symgen.build("peaucellier").accelerations().as_dict()
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("symgen.toolchain.compiler.find_spec", lambda _: None)
    with pytest.warns(SlowBackendWarning, match=r"came with symgen.*apt install gcc"):
        shipped = symgen.build("peaucellier")
    assert shipped.backend == "shipped"
    assert shipped.accelerations().as_dict() == expected
    with pytest.warns(SlowBackendWarning, match="NumPy backend is used, some hundred times slower"):
        slow = symgen.build("four_bar")
    assert slow.backend == "numpy"
    assert slow.simulate(0.1, rtol=1e-6).drift.constraint < 1e-14
    with pytest.raises(ModelError, match="needs a C compiler"):
        symgen.build("four_bar", backend="c")


def test_info_and_clear(cache):
    symgen.build("four_bar")
    (cache / ".symgen-killed.abc").mkdir()
    (cache / "killed.symgen-lock").write_text("")
    store = Cache()
    ((name, size),) = store.entries()
    assert name.startswith("four_bar-") and size > 1000
    assert store.clear() == 1
    assert entries(cache) == []
    assert Cache(cache / "none").clear() == 0
