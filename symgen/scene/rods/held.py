"""Quantities of loads that runs hold during a step: branches at jumps, references of angles."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from symgen.symbolic.quantity import Quantity


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
