"""Profiles of motion: functions that rise from 0 to 1 while their variable does, and stay there.

Source: R. L. Norton, Cam Design and Manufacturing Handbook, 2nd edition (2009), chapters 3 and 4.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import sympy as sp

from symgen.symbolic.switch import Pieces

_F = Fraction
_ZERO, _ONE = _F(0), _F(1)


def _ramp(name: str, smooth: int) -> Pieces:
    """Return the variable itself from 0 to 1, kept at its ends; ``smooth`` is that of the profile."""
    rows = (_ZERO, _ZERO), (_ZERO, _ONE), (_ONE, _ZERO)
    return Pieces(f"profile_{name}", (_ZERO, _ONE), rows, smooth=smooth, form=f"profile.{name}({{}})")


def _polynomial(name: str, smooth: int, coefficients: dict[int, int]) -> Callable[[sp.Expr], sp.Expr]:
    def profile(x: sp.Expr) -> sp.Expr:
        u = _ramp(name, smooth).at(x)
        return sp.Add(*(c * u**k for k, c in coefficients.items()))

    return profile


def _cycloidal(x: sp.Expr) -> sp.Expr:
    u = _ramp("cycloidal", 2).at(x)
    return u - sp.sin(2 * sp.pi * u) / (2 * sp.pi)


def _modified_sine(x: sp.Expr) -> sp.Expr:
    knots = (_ZERO, _F(1, 8), _F(7, 8), _ONE)
    rows = (_ZERO, _ZERO), (_ZERO, _ONE), (_F(1, 8), _ONE), (_F(7, 8), _ONE), (_ONE, _ZERO)
    form = "profile.modified_sine({})"
    u = Pieces("profile_modified_sine", knots, rows, smooth=2, form=form).at(x)
    offset, size, rate, phase = (
        Pieces(
            f"profile_modified_sine_{name}",
            knots,
            tuple((_F(n),) for n in numbers),
            smooth=2,
            form=form,
        ).at(x)
        for name, numbers in (
            ("offset", (0, 0, 2, 4, 4)),
            ("size", (_F(1, 4), _F(1, 4), _F(9, 4), _F(1, 4), _F(1, 4))),
            ("rate", (4, 4, _F(4, 3), 4, 4)),
            ("phase", (0, 0, _F(1, 3), 0, 0)),
        )
    )
    return (offset + sp.pi * u - size * sp.sin(sp.pi * (rate * u + phase))) / (4 + sp.pi)


def _of_acceleration(name: str, smooth: int, *parts: tuple[Fraction, int]) -> Callable[[sp.Expr], sp.Expr]:
    """Return the profile with an acceleration, or for ``smooth`` 2 a rate of it, in proportion to numbers.

    ``parts`` are the ends of pieces, and the numbers up to there.
    """
    knots, parts_of, state = [_ZERO], list[tuple[Fraction, ...]](), [_ZERO] * (smooth + 1)
    for end, given in parts:
        h, begin = end - knots[-1], knots[-1]
        full = [*state, _F(given)]
        factorials = [_F(1), _F(1), _F(2), _F(6)]
        parts_of.append(tuple(x / factorials[k] for k, x in enumerate(full)))
        state = [
            sum((full[k + j] * h**j / factorials[j] for j in range(len(full) - k)), _ZERO)
            for k in range(smooth + 1)
        ]
        knots.append(begin + h)
    zero = [_ZERO] * (smooth + 1)
    scaled = [tuple(x / state[0] for x in row) for row in parts_of]
    rows = [(_ZERO, *zero), *scaled, (_ONE, *zero)]
    form = f"profile.{name}({{}})"
    return Pieces(f"profile_{name}", tuple(knots), tuple(rows), smooth=smooth, form=form).at


#: Profiles by name: of a plain number, with plain numbers.
PROFILES: dict[str, Callable[[sp.Expr], sp.Expr]] = {
    "trapezoid": _of_acceleration("trapezoid", 1, (_F(1, 3), 1), (_F(2, 3), 0), (_F(1), -1)),
    "s_curve": _of_acceleration(
        "s_curve", 2, (_F(1, 6), 1), (_F(1, 3), -1), (_F(2, 3), 0), (_F(5, 6), -1), (_F(1), 1)
    ),
    "cycloidal": _cycloidal,
    "modified_sine": _modified_sine,
    "poly345": _polynomial("poly345", 2, {3: 10, 4: -15, 5: 6}),
    "poly4567": _polynomial("poly4567", 3, {4: 35, 5: -84, 6: 70, 7: -20}),
}
