"""Files and folders that are there whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from symgen.errors import OutputError, ResultError


@contextmanager
def replacing(path: Path, noun: str = "") -> Iterator[Path]:
    """Give a temporary path; rename it to ``path`` when the block ends well, remove it otherwise.

    ``noun`` names the content in the message of an OutputError, which replaces errors of the system.
    """
    with _reported(path, noun):
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(path)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


@contextmanager
def _reported(path: Path, noun: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError.of(f"the {noun} to {path}" if noun else path, error) from None


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text with LF line ends, whole or not at all; raise OutputError where it cannot be."""
    with replacing(path) as temporary:
        temporary.write_bytes(text.encode("utf-8"))


def write_folder(folder: Path, files: Mapping[str, bytes], content: str, removed: Iterable[str] = ()) -> None:
    """Write files by their names in a folder; after a failure the folder is unchanged.

    A new folder appears complete. In an existing folder, files named in ``removed`` are deleted, each new
    file replaces its predecessor, in the order of ``files``, and other files remain. ``content`` names the
    files in messages.

    Raises
    ------
    OutputError
        When it cannot be written.
    """
    with _reported(folder, content):
        _write_folder(folder, files, removed)


def _write_folder(folder: Path, files: Mapping[str, bytes], removed: Iterable[str]) -> None:
    there = folder.is_dir()
    home = folder if there else folder.absolute().parent
    temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=home))
    try:
        for name, content in files.items():
            (temporary / name).parent.mkdir(exist_ok=True)
            (temporary / name).write_bytes(content)
        if not there:
            temporary.chmod(0o777 & ~_umask())
            temporary.replace(folder)
            return
        for name in removed:
            (folder / name).unlink(missing_ok=True)
        for name in files:
            (folder / name).parent.mkdir(exist_ok=True)
            (temporary / name).replace(folder / name)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def writable(file: str | os.PathLike[str], endings: Sequence[str], noun: str) -> Path:
    """Return the path of a file to be written; raise ResultError when it cannot become one.

    To be called before long work whose outcome the file is to hold.
    """
    path = Path(file)
    if path.suffix.lower() not in endings:
        raise ResultError(
            f"expected a file ending in {' or '.join(endings)} for the {noun}, got {path.name or str(path)!r}"
        )
    if not path.parent.is_dir():
        raise ResultError(f"cannot write the {noun} to {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise ResultError(f"cannot write the {noun} to {path}: it is a folder")
    if not os.access(path.parent, os.W_OK):
        raise ResultError(f"cannot write the {noun} to {path}: no permission to write in {path.parent}")
    return path


def writable_folder(folder: Path, content: str) -> None:
    """Raise ResultError when files cannot be written into a folder, which is there or can be created."""
    if folder.exists() and not folder.is_dir():
        raise ResultError(f"expected a folder for the {content}, got the file {folder}")
    parent = folder if folder.is_dir() else folder.absolute().parent
    if not parent.is_dir():
        raise ResultError(f"cannot write the {content} to {folder}: there is no folder {parent}")
    if not os.access(parent, os.W_OK):
        raise ResultError(f"cannot write the {content} to {folder}: no permission to write in {parent}")
