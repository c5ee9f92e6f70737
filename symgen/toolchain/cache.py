"""The user's cache of compiled scenes: content-addressed, written atomically, verified when read."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from symgen.errors import CacheError, shown
from symgen.toolchain import ownership

_CHECKSUMS = "checksums.json"
#: Prefix of folders under construction and suffix of locks: ``clear`` removes nothing else.
_BUILDING, _LOCK = ".symgen-", ".symgen-lock"


def cache_root() -> Path:
    """Return the cache folder: ``SYMGEN_CACHE``, else the platform's default cache folder."""
    chosen = os.environ.get("SYMGEN_CACHE")
    if chosen:
        root = Path(chosen).absolute()
        try:
            root.exists()
        except OSError as error:  # such as a name of more than 255 characters
            raise CacheError(
                f"SYMGEN_CACHE is no folder: {error.strerror}: {shown(chosen)}\n"
                "  Point SYMGEN_CACHE to a folder of your own."
            ) from None
        return root
    import platformdirs

    try:
        return Path(platformdirs.user_cache_dir("symgen", appauthor=False))
    except RuntimeError:  # for example in a container
        raise CacheError(
            "expected a folder for the cache, but this user has no home\n"
            "  Point SYMGEN_CACHE to a folder of your own."
        ) from None


@dataclass(frozen=True, slots=True)
class CacheEntry:
    """A verified entry: a folder with the files that its checksums list."""

    folder: Path

    def read_text(self, name: str) -> str:
        """Return the text of one file of the entry."""
        return (self.folder / name).read_text(encoding="utf-8")


class Cache:
    """Folders named ``<scene>-<key>`` under one root.

    An entry is written under a temporary name and renamed when it is complete, so a reader sees either the
    whole entry or none. The SHA-256 of each file is stored with it; a mismatching entry is rebuilt.

    Entries contain code that is loaded and executed. The folder must therefore be writable by its owner only,
    and an entry is used only if the folder and all its files belong to the current user or to root.
    """

    def __init__(self, root: Path | None = None) -> None:
        self.root = cache_root() if root is None else root

    def find(self, name: str) -> CacheEntry | None:
        """Return the entry with this name if it exists and is intact."""
        folder = self.root / name
        try:
            if not self.is_private() or not all(map(ownership.belongs_to_user, (folder, *folder.iterdir()))):
                return None
            sums = json.loads((folder / _CHECKSUMS).read_bytes())
            whole = bool(sums) and all(_sha256(folder / file) == digest for file, digest in sums.items())
        except (OSError, ValueError, AttributeError, TypeError):
            return None
        return CacheEntry(folder) if whole else None

    def is_private(self) -> bool:
        """Return whether the folder exists and is writable by the current user or root only.

        Raises
        ------
        CacheError
            If other users own the folder or can write to it.
        """
        if not self.root.exists():
            return False
        fault = ownership.fault(self.root)
        if fault:
            raise CacheError(
                f"expected a cache folder that only you can write, got {self.root}: {fault}\n"
                "  symgen runs the compiled code that it finds there. Remove what others can write "
                f"('chmod go-w {self.root}'), or point SYMGEN_CACHE to a folder of your own."
            )
        return True

    def _make(self) -> None:
        if not self.root.exists():
            self.root.parent.mkdir(parents=True, exist_ok=True)
            self.root.mkdir(mode=0o700, exist_ok=True)
        self.is_private()

    def remove(self, entry: CacheEntry) -> None:
        """Remove an entry with unusable content."""
        with self._reporting():
            self._discard(entry.folder)

    def _discard(self, folder: Path) -> None:
        """Remove a folder; if some files belong to other users, move it out of the way instead."""
        aside = Path(tempfile.mkdtemp(prefix=_BUILDING, dir=self.root))
        with suppress(FileNotFoundError):  # another process was faster
            folder.replace(aside / folder.name)
        shutil.rmtree(aside, ignore_errors=True)

    @contextmanager
    def locked(self, name: str) -> Iterator[None]:
        """Hold the lock of an entry, so that only one process builds it.

        The lock file is removed while the lock is held. A process that waited for it and one that creates a
        new file may then both build. This costs time only: an entry appears by a single rename.
        """
        from filelock import FileLock

        path = self.root / f"{name}{_LOCK}"
        with self._reporting():
            self._make()
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
        """Provide an empty folder that becomes the entry if the block succeeds and is removed otherwise.

        ``naming`` returns the entry's name if it is known only after the folder has been filled.
        """
        with self._reporting():
            self._make()
            folder = Path(tempfile.mkdtemp(prefix=f"{_BUILDING}{name}.", dir=self.root))
        try:
            yield folder
            with self._reporting():
                name = naming(folder) if naming else name
                sums = {p.name: _sha256(p) for p in sorted(folder.iterdir())}
                (folder / _CHECKSUMS).write_text(json.dumps(sums, indent=1), encoding="utf-8")
                for file in (
                    folder.iterdir()
                ):  # a permissive umask may leave group permissions; ``find`` rejects them
                    file.chmod(file.stat().st_mode & ~(stat.S_IWGRP | stat.S_IWOTH))
                self._put(folder, self.root / name)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _put(self, folder: Path, place: Path) -> None:
        if place.exists() and self.find(place.name) is None:
            self._discard(place)
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
        """Return the error for a cache folder that cannot be written."""
        return CacheError(
            f"cannot write the cache folder {self.root}: {error.strerror or error}\n"
            "  Free space or correct its permissions, or point SYMGEN_CACHE to another folder."
        )

    def entries(self) -> list[tuple[str, int]]:
        """Return the name and size [bytes] of every entry."""
        if not self.root.is_dir():
            return []
        folders = sorted(
            p for p in self.root.iterdir() if (p / _CHECKSUMS).is_file() and not p.name.startswith(".")
        )
        return [(p.name, sum(f.stat().st_size for f in p.iterdir())) for p in folders]

    def clear(self) -> int:
        """Remove every entry and the remains of interrupted builds; return the number of entries."""
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
    """Return a hash of the content: equal parts give equal keys."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode("utf-8", "surrogatepass")
        digest.update(f"{len(data)}:".encode())
        digest.update(data)
    return digest.hexdigest()[:40]


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
