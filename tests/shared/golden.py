"""Reference numbers of tests/reference."""

from __future__ import annotations

import json
from pathlib import Path

REFERENCE = Path(__file__).parents[1] / "reference"


def reference(name: str) -> dict:
    """Return reference numbers: 30 digits, each scene agreeing with an independent model."""
    return json.loads((REFERENCE / f"{name}.json").read_text())
