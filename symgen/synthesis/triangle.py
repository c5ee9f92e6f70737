"""Triangles of limit positions, from their sides."""

from __future__ import annotations

import math


def angle(far: float, one: float, other: float) -> float:
    """Return the angle [rad] between two sides, opposite to the far one; nan where they do not close."""
    cosine = (one * one + other * other - far * far) / (2 * one * other)
    return math.acos(cosine) if abs(cosine) <= 1 else math.nan
