"""Caches and entries that other users own, can write or can replace."""

from __future__ import annotations

import os
import shutil

import pytest

import symgen
from symgen.errors import CacheError
from symgen.toolchain.cache import Cache


@pytest.fixture
def another_user(monkeypatch):
    """Gives files to another user; where only root could, this process takes itself for another user instead."""
    if not hasattr(os, "geteuid"):
        pytest.skip("there are no POSIX users here")

    def give(path):
        if os.geteuid() == 0:
            os.chown(path, 65534, 65534)
        else:
            monkeypatch.setattr(os, "geteuid", lambda: 4321)

    return give


@pytest.mark.parametrize("file", [".", "kernels.so", "description.json"])
def test_an_entry_of_another_user_is_not_loaded(cache, another_user, file):
    symgen.build("four_bar", backend="c")
    (entry,) = cache.iterdir()
    assert Cache().find(entry.name)
    if os.geteuid():  # the folder is own, the entry is not
        pytest.skip("only root can give a file away")
    another_user(entry / file)
    assert Cache().find(entry.name) is None
    symgen.build("four_bar", backend="c")
    assert Cache().find(entry.name), "it is replaced by an own one"
    assert (entry / file).stat().st_uid == os.geteuid()


def test_a_link_to_an_entry_elsewhere_is_not_loaded(cache, tmp_path):
    symgen.build("four_bar", backend="c")
    (entry,) = cache.iterdir()
    shutil.move(entry, tmp_path / "elsewhere")
    entry.symlink_to(tmp_path / "elsewhere")
    assert Cache().find(entry.name) is None


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="there are no POSIX users here")
@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o775])
def test_a_cache_that_others_can_write_is_refused(cache, monkeypatch, mode):
    """Whether it is new or holds the scene already; a group with others in it is others."""
    symgen.build("four_bar", backend="c")
    assert cache.stat().st_mode & 0o777 == 0o700
    monkeypatch.setattr("symgen.toolchain.ownership.is_private", lambda group, user: False)
    cache.chmod(mode)
    for scene in ("four_bar", "triple_pendulum"):
        with pytest.raises(CacheError, match=r"only you can write, got .*\n.*chmod go-w .*SYMGEN_CACHE"):
            symgen.build(scene, backend="c")
    assert len([*cache.iterdir()]) == 1
    cache.chmod(0o755)
    symgen.build("four_bar", backend="c")


def test_a_cache_of_another_user_is_refused(cache, another_user):
    symgen.build("four_bar", backend="c")
    another_user(cache)
    with pytest.raises(CacheError, match=r"it belongs to user \d+, with mode 0700"):
        symgen.build("four_bar", backend="c")


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="there are no POSIX users here")
def test_a_cache_that_others_can_replace_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "open" / "cache"))
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    with pytest.raises(CacheError, match="everybody can replace it, as .*open has mode 0777"):
        symgen.build("four_bar", backend="c")
    (tmp_path / "open").chmod(0o1777)
    symgen.build("four_bar", backend="c")
