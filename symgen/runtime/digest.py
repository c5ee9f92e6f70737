"""Digest of arrays in files: of checkpoints, results and chunks of sweeps."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np


def digest(arrays: Mapping[str, Any], text: str = "") -> str:
    """Return the SHA-256 of arrays with names, types and shapes, and of a text: the same everywhere."""
    known = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        values = np.asarray(arrays[name])
        if values.dtype.kind in "OT":  # texts
            values = np.array([*map(str, values.flat)], dtype=str).reshape(values.shape)
        values = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
        known.update(repr((name, values.dtype.str, values.shape)).encode() + values.tobytes())
    return known.hexdigest()
