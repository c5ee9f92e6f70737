"""Manifest of ``generated/``: writing, and comparison with the derived files."""

from __future__ import annotations

import difflib
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from symgen.atomic import write_text
from symgen.codegen.source import SourceFile

MANIFEST = "manifest.json"


@dataclass(frozen=True, slots=True)
class Shipped:
    """The files of one shipped model, the hash of its equations, and the optimisation level (-O1, -O3)."""

    equations: str
    files: Sequence[SourceFile]
    optimisation: int = 1


def manifest(models: Mapping[str, Shipped]) -> SourceFile:
    """Return the manifest of the models: equations hash, optimisation, and the hash of every file."""
    content = {
        "models": {
            name: {
                "equations": model.equations,
                "optimisation": model.optimisation,
                "sources": {f.name: hashlib.sha256(f.text.encode()).hexdigest() for f in model.files},
            }
            for name, model in sorted(models.items())
        }
    }
    return SourceFile(MANIFEST, json.dumps(content, indent=1, sort_keys=True) + "\n")


def listed(folder: Path) -> set[str]:
    """Return the files listed in the manifest of a folder; empty if it cannot be read."""
    try:
        models = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["models"]
        return {file for model in models.values() for file in model["sources"]}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return set()


def differences(folder: Path, files: Sequence[SourceFile]) -> list[str]:
    """Return a unified diff for every outdated file; empty if all are current."""
    texts = []
    for file in sorted(files, key=lambda f: f.name):
        path = folder / file.name
        there = path.read_bytes().decode("utf-8", "replace") if path.is_file() else ""
        if there != file.text:
            texts.append(
                "".join(
                    difflib.unified_diff(
                        there.splitlines(keepends=True),
                        file.text.splitlines(keepends=True),
                        f"generated/{file.name} (there)",
                        f"generated/{file.name} (derived)",
                        n=2,
                    )
                )
            )
    wanted = {f.name for f in files}
    texts += [f"generated/{name} is no longer generated\n" for name in sorted(listed(folder) - wanted)]
    return texts


def write(folder: Path, files: Sequence[SourceFile]) -> list[str]:
    """Write the files that differ and remove obsolete ones; return the names of both."""
    touched = []
    for name in sorted(listed(folder) - {f.name for f in files}):
        (folder / name).unlink(missing_ok=True)
        touched.append(name)
    for file in files:
        path = folder / file.name
        path.parent.mkdir(exist_ok=True)
        if not path.is_file() or path.read_bytes() != file.text.encode("utf-8"):
            write_text(path, file.text)
            touched.append(file.name)
    return touched
