"""Atomic writing of a folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from symgen.atomic import write_folder
from symgen.errors import ResultError


def writable_folder(folder: str | os.PathLike[str]) -> Path:
    """Return the path of an output folder; raise ResultError early if it is not writable."""
    path = Path(folder)
    if path.exists() and not path.is_dir():
        raise ResultError(f"expected a folder for the studies, got the file {path}")
    parent = path if path.is_dir() else path.absolute().parent
    if not parent.is_dir():
        raise ResultError(f"cannot write the studies to {path}: there is no folder {parent}")
    if not os.access(parent, os.W_OK):
        raise ResultError(f"cannot write the studies to {path}: no permission to write in {parent}")
    return path


def write(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder: a new folder appears complete; in an existing one each file is replaced.

    Raises
    ------
    ResultError
        If the folder cannot be written; its contents are then unchanged.
    """
    try:
        write_folder(folder, files)
    except OSError as error:
        raise ResultError(f"cannot write the studies to {folder}: {error.strerror or error}") from None
