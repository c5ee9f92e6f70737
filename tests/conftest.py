"""Shared fixtures: a cache of its own for the session, and the reference numbers."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

REFERENCE = Path(__file__).parent / "reference"


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keep tests away from the user's cache; processes that share the work share one, as those of a user do."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "cache"
    folder.mkdir(exist_ok=True)
    patch = pytest.MonkeyPatch()
    patch.setenv("SYMGEN_CACHE", str(folder))
    yield folder
    patch.undo()


def reference(name: str) -> dict:
    """Return reference numbers: 30 digits, each scene agreeing with an independent model."""
    return json.loads((REFERENCE / f"{name}.json").read_text())
