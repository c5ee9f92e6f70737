"""Files that are there whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from symgen.errors import ResultError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path; rename it to ``path`` when the block ends well, remove it otherwise."""
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text with LF line ends, whole or not at all; raise ResultError where it cannot be."""
    try:
        with replacing(path) as temporary:
            temporary.write_bytes(text.encode("utf-8"))
    except OSError as error:
        raise ResultError(f"cannot write {path}: {error.strerror or error}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def writable(file: str | os.PathLike[str], endings: Sequence[str], what: str) -> Path:
    """Return the path of a file to be written; raise ResultError when it cannot become one.

    To be called before long work whose outcome the file is to hold.
    """
    path = Path(file)
    if path.suffix.lower() not in endings:
        raise ResultError(
            f"expected a file ending in {' or '.join(endings)} for the {what}, got {path.name!r}"
        )
    if not path.parent.is_dir():
        raise ResultError(f"cannot write the {what} to {path}: there is no folder {path.parent}")
    return path
