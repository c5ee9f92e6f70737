"""The folder of an export: written whole, and never over something else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from symgen.atomic import write_folder
from symgen.codegen.emit import SourceFile
from symgen.errors import ResultError

#: Lists the files of an export with their SHA-256.
LISTED = "export.json"


def place(folder: Path) -> dict[str, str]:
    """Return the files of the export that a folder holds, with their hashes; none where there is nothing.

    Raises
    ------
    ResultError
        When the folder is none, holds something that is not an export, or an export that was changed.
    """
    if not folder.parent.is_dir():
        raise ResultError(f"cannot write the export to {folder}: there is no folder {folder.parent}")
    try:
        if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
            return {}
        there = _listed(folder)
    except OSError as error:
        raise _failed(folder, error) from None
    if there is None:
        raise ResultError(
            f"{folder} holds something that is not an export of symgen\n"
            "  Give a folder that is empty or not there yet; it is made."
        )
    changed = [name for name, digest in there.items() if _hash(folder / name) not in (digest, "")]
    if changed:
        raise ResultError(
            f"{folder / changed[0]} was changed since it was exported"
            f"{f' (and {len(changed) - 1} more)' if len(changed) > 1 else ''}\n"
            "  Export to another folder, or remove it."
        )
    return there


def write(folder: Path, files: Sequence[SourceFile], before: Mapping[str, str]) -> list[str]:
    """Write the files, remove those of ``before`` that are no longer among them; return the names written.

    When that fails the folder is as it was.

    Raises
    ------
    ResultError
        When the folder cannot be written, or holds a file of its own by the name of one of the export.
    """
    texts = {f.name: f.text.encode("utf-8") for f in sorted(files, key=lambda f: f.name)}
    hashes = {name: hashlib.sha256(text).hexdigest() for name, text in texts.items()}
    listed = (json.dumps({"exported_by": "symgen", "files": hashes}, indent=1) + "\n").encode()
    foreign = [n for n in texts if n not in before and (folder / n).exists()]
    if foreign:
        raise ResultError(
            f"{folder / foreign[0]} is there and not of the export\n  Export to another folder."
        )
    try:
        # The list comes last: until then it is that of what was there.
        write_folder(folder, {**texts, LISTED: listed}, sorted(set(before) - set(texts)))
    except OSError as error:
        raise _failed(folder, error) from None
    return sorted([*texts, LISTED])


def _listed(folder: Path) -> dict[str, str] | None:
    """Return the files that the list in a folder names; None where there is no such list."""
    try:
        data = json.loads((folder / LISTED).read_text(encoding="utf-8"))
        files = data["files"] if data.get("exported_by") == "symgen" else None
    except (FileNotFoundError, NotADirectoryError, ValueError, KeyError, TypeError, AttributeError):
        return None
    if not isinstance(files, dict):
        return None
    inside = all(".." not in Path(n).parts and not Path(n).is_absolute() for n in files)
    return {str(n): str(h) for n, h in files.items()} if inside else None


def _hash(path: Path) -> str:
    """Return the hash of a file, nothing where it is gone."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def _failed(folder: Path, error: OSError) -> ResultError:
    return ResultError(f"cannot write the export to {folder}: {error.strerror or error}")
