"""Parameters of a resolved scene, and what runs hold during a step or move."""

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


@dataclass(frozen=True, slots=True)
class Switch:
    """A jump or a kink of a load where ``gap``, of the time t and the state, passes zero.

    ``branch`` is held by a run during a step; ``text`` is the jump as written, with its location. A
    ``smooth`` one is the middle of a pulse, where the load neither jumps nor has a kink.
    """

    gap: sp.Expr
    branch: Quantity
    text: str
    smooth: bool = False


@dataclass(frozen=True, slots=True)
class Winding:
    """An angle in a load: of a link beyond ``free`` [rad], from ``against`` or the x axis (empty).

    ``reference`` is the angle from which it is taken the nearer way round; runs move it along.
    """

    link: str
    against: str
    free: sp.Expr
    reference: Quantity
