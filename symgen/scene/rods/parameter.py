"""Parameters of a resolved scene: tunable ones, signals, and the letters of constants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.symbolic.quantity import Quantity


@dataclass(frozen=True, slots=True)
class Parameter:
    """A tunable parameter: it stays an argument of the kernels. ``default`` is its value in the scene.

    ``input``: it is an external signal, which may change during a motion. ``fixed``: it is the letter of a
    constant, and ``default`` the value, over the others, that replaces it in the kernels.
    """

    quantity: Quantity
    default: sp.Expr
    input: bool = False
    fixed: bool = False


def defaults(parameters: Sequence[Parameter]) -> dict[sp.Symbol, sp.Expr]:
    """Return the value of every parameter in the scene."""
    tunable = {p.quantity.symbol: p.default for p in parameters if not p.fixed}
    return tunable | {p.quantity.symbol: p.default.xreplace(tunable) for p in parameters if p.fixed}
