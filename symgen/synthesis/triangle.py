"""Triangles of limit positions, from their sides."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import sympy as sp

from symgen.mechanics.synthesis.limits import cosine_opposite


@cache
def _cosine() -> Callable[[float, float, float], float]:
    sides = sp.symbols("far one other", positive=True)
    made: Callable[[float, float, float], float] = sp.lambdify(sides, cosine_opposite(*sides), "math")
    return made


def angle(far: float, one: float, other: float) -> float:
    """Return the angle [rad] between two sides, opposite to the far one; nan where they do not close."""
    cosine = _cosine()(far, one, other)
    return math.acos(cosine) if abs(cosine) <= 1 else math.nan
