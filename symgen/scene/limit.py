"""Values of a scene whose sign is checked again at other values of its tunable parameters."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp


@dataclass(frozen=True, slots=True)
class Limit:
    """A value over tunable parameters that must be above zero, or at least zero unless ``strict``.

    ``where`` is its key in the scene, ``unit`` its unit.
    """

    where: str
    value: sp.Expr
    unit: str
    strict: bool
