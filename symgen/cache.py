"""The user's cache of compiled scenes: keyed on content, written atomically, checked when read."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from symgen.errors import CacheError

_CHECKSUMS = "checksums.json"
#: How the names of folders in the making begin, and those of locks end: nothing else is cleared.
_BUILDING, _LOCK = ".symgen-", ".symgen-lock"


def cache_root() -> Path:
    """Return the cache folder: ``SYMGEN_CACHE``, else the platform's folder for caches."""
    chosen = os.environ.get("SYMGEN_CACHE")
    if chosen:
        return Path(chosen).absolute()
    import platformdirs

    return Path(platformdirs.user_cache_dir("symgen", appauthor=False))


@dataclass(frozen=True, slots=True)
class Entry:
    """A checked entry: a folder with the files that its checksums list."""

    folder: Path

    def read_text(self, name: str) -> str:
        """Return the text of one of its files."""
        return (self.folder / name).read_text(encoding="utf-8")


class Cache:
    """Folders named ``<scene>-<key>`` under one root.

    An entry is written under a temporary name and renamed when it is complete, so a reader sees all of it
    or nothing. Each file's SHA-256 is stored beside it; an entry that does not match is built again.
    """

    def __init__(self, root: Path | None = None) -> None:
        self.root = cache_root() if root is None else root

    def find(self, name: str) -> Entry | None:
        """Return the entry of this name when it is there and whole."""
        folder = self.root / name
        try:
            sums = json.loads((folder / _CHECKSUMS).read_bytes())
            whole = bool(sums) and all(_sha256(folder / file) == digest for file, digest in sums.items())
        except (OSError, ValueError, AttributeError, TypeError):
            return None
        return Entry(folder) if whole else None

    @contextmanager
    def locked(self, name: str) -> Iterator[None]:
        """Hold the lock of an entry, so that only one process builds it.

        The lock file is removed while it is held: a process that waited on it and one that makes a new one
        may then both build, which costs time but no correctness, since an entry appears by one rename.
        """
        from filelock import FileLock

        path = self.root / f"{name}{_LOCK}"
        with self._reporting():
            self.root.mkdir(parents=True, exist_ok=True)
            lock = FileLock(path)
            lock.acquire()
        try:
            yield
        finally:
            with suppress(OSError):
                path.unlink(missing_ok=True)
            lock.release()

    @contextmanager
    def building(self, name: str, naming: Callable[[Path], str] | None = None) -> Iterator[Path]:
        """Give an empty folder; when the block ends well it becomes the entry, otherwise it vanishes.

        ``naming`` gives the entry's name where that shows only when the folder is filled.
        """
        with self._reporting():
            self.root.mkdir(parents=True, exist_ok=True)
            folder = Path(tempfile.mkdtemp(prefix=f"{_BUILDING}{name}.", dir=self.root))
        try:
            yield folder
            with self._reporting():
                name = naming(folder) if naming else name
                sums = {p.name: _sha256(p) for p in sorted(folder.iterdir())}
                (folder / _CHECKSUMS).write_text(json.dumps(sums, indent=1), encoding="utf-8")
                self._put(folder, self.root / name)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _put(self, folder: Path, place: Path) -> None:
        if place.exists() and self.find(place.name) is None:
            shutil.rmtree(place)
        try:
            folder.replace(place)
        except OSError:
            if self.find(place.name) is None:
                raise

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self.error(error) from None

    def error(self, error: OSError) -> CacheError:
        """Return the error for a cache that cannot be written."""
        return CacheError(
            f"cannot write the cache folder {self.root}: {error.strerror or error}\n"
            "  Free space or mend its permissions, or point SYMGEN_CACHE to another folder."
        )

    def entries(self) -> list[tuple[str, int]]:
        """Return name and size in bytes of every entry."""
        if not self.root.is_dir():
            return []
        folders = sorted(
            p for p in self.root.iterdir() if (p / _CHECKSUMS).is_file() and not p.name.startswith(".")
        )
        return [(p.name, sum(f.stat().st_size for f in p.iterdir())) for p in folders]

    def clear(self) -> int:
        """Remove every entry, and what a killed build left behind; return how many entries there were."""
        entries = self.entries()
        with self._reporting():
            for name, _ in entries:
                shutil.rmtree(self.root / name)
            if self.root.is_dir():
                for path in self.root.iterdir():
                    if path.is_dir() and path.name.startswith(_BUILDING):
                        shutil.rmtree(path)
                    elif path.name.endswith(_LOCK):
                        path.unlink(missing_ok=True)
        return len(entries)


def key(*parts: str) -> str:
    """Return a name for this content: equal parts, equal key."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode("utf-8", "surrogatepass")
        digest.update(f"{len(data)}:".encode())
        digest.update(data)
    return digest.hexdigest()[:40]


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
