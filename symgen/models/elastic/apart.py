"""Parameters of a linkage that are called like quantities of elastic links, kept apart from these."""

from __future__ import annotations

from collections.abc import Callable, Container

import sympy as sp

from symgen.scene.rods.linkage import Linkage

Renaming = Callable[[sp.Expr], sp.Expr]


def apart(linkage: Linkage, own: Container[sp.Symbol]) -> tuple[Renaming, Renaming]:
    """Return a function that renames parameters that are among symbols of links, and the one back."""
    shared = [p.quantity.symbol for p in linkage.parameters if p.quantity.symbol in own]
    away = {s: sp.Symbol(f"{s.name} of the scene", **s.assumptions0) for s in shared}
    back = {other: s for s, other in away.items()}
    return lambda e: sp.sympify(e).xreplace(away), lambda e: sp.sympify(e).xreplace(back)
