"""The folder of an export: written atomically, without overwriting other files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from symgen.atomic import write_folder
from symgen.codegen.emit import SourceFile
from symgen.errors import ResultError

#: File that lists the files of the export with their SHA-256.
LISTED = "export.json"


def place(folder: Path) -> dict[str, str]:
    """Return the files of the export in a folder with their hashes; empty if there is no folder.

    Raises
    ------
    ResultError
        If the path is not a folder, or the folder holds other files or a modified export.
    """
    if not folder.parent.is_dir():
        raise ResultError(f"cannot write the export to {folder}: there is no folder {folder.parent}")
    try:
        if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
            return {}
        there = _listed(folder)
    except OSError as error:
        raise ResultError(f"cannot write the export to {folder}: {error.strerror or error}") from None
    if not folder.is_dir():
        raise ResultError(f"expected a folder for the export, got the file {folder}")
    if there is None:
        raise ResultError(
            f"{folder} contains files other than an export of symgen\n"
            "  Give an empty folder or a new one, which is created."
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
    """Write the files, remove those of ``before`` that are obsolete; return the names written.

    On failure the folder is restored.

    Raises
    ------
    ResultError
        If the folder cannot be written, or a file of the export would overwrite another file.
    """
    texts = {f.name: f.text.encode("utf-8") for f in sorted(files, key=lambda f: f.name)}
    hashes = {name: hashlib.sha256(text).hexdigest() for name, text in texts.items()}
    listed = (json.dumps({"exported_by": "symgen", "files": hashes}, indent=1) + "\n").encode()
    foreign = [n for n in texts if n not in before and (folder / n).exists()]
    if foreign:
        raise ResultError(
            f"{folder / foreign[0]} exists and does not belong to the export\n  Export to another folder."
        )
    # The list is written last: until then it describes the previous export.
    write_folder(folder, {**texts, LISTED: listed}, "export", sorted(set(before) - set(texts)))
    return sorted([*texts, LISTED])


def _listed(folder: Path) -> dict[str, str] | None:
    """Return the files in the list of a folder with their hashes; None if there is no list."""
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
    """Return the hash of a file; empty if it does not exist."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
