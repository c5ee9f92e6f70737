"""Files and folders that are there whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from symgen.atomic import writable_folder, write_folder
from symgen.errors import ResultError


@pytest.mark.parametrize("there", [True, False])
def test_a_folder_is_as_it_was_where_files_cannot_be_written(there, tmp_path, monkeypatch):
    folder, whole = tmp_path / "out", Path.write_bytes
    if there:
        write_folder(folder, {"a": b"1", "core/b": b"1", "old": b"1"}, "files")

    def full(path, content):
        if path.name == "z":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return whole(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ResultError, match="cannot write the files .* No space left on device"):
        write_folder(folder, {"a": b"2", "core/b": b"2", "z": b"2"}, "files", removed=["old"])
    monkeypatch.undo()
    assert [p.name for p in tmp_path.iterdir()] == (["out"] if there else [])
    if there:
        kept = {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
        assert kept == {"a": b"1", "core/b": b"1", "old": b"1"}
        write_folder(folder, {"a": b"2"}, "files", removed=["old"])
        assert sorted(p.name for p in folder.rglob("*") if p.is_file()) == ["a", "b"]


def test_folders_that_cannot_be_written_are_refused_before_the_work(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    writable_folder(tmp_path / "new", "scenes")
    with pytest.raises(ResultError, match="expected a folder for the scenes, got the file"):
        writable_folder(tmp_path / "file", "scenes")
    with pytest.raises(ResultError, match="cannot write the scenes to .*: there is no folder"):
        writable_folder(tmp_path / "no" / "out", "scenes")
