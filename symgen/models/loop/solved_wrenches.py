"""Components of the joint wrenches of a slider-crank, each from a combination of rows of the equilibrium.

Source: S. Rahman, *Dynamic Analysis of the Generalized Slider Crank* (1991), Eqs. (69a)-(69q), in their order
but for (69k): a remedy for the division of (69h) in the thesis, it is an identity with (69i) and (69j).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from symgen.scene.loop.loop import Row
from symgen.symbolic.calculus import ONE, partial

#: Entries of the rows of the generalized slider-crank that are not zero.
_ROWS = (
    {"theta", "S", "a"},
    {"theta", "eta", "a"},
    {"theta", "eta", "alpha"},
    {"S", "alpha", "a"},
)
#: Moments that ball joints do not transmit.
_OF_BALLS = "T2", "T3"


def is_slider_crank(rows: Sequence[Row], balls: Sequence[bool]) -> bool:
    """Return whether rows are of the generalized slider-crank; ``balls`` tells which transmit no moment."""
    found = [{name for name in ("theta", "S", "eta", "alpha", "a") if getattr(r, name) != 0} for r in rows]
    return found == list(_ROWS) and list(balls[1:3]) == [True, True]


def solved_wrenches(
    rows: Sequence[Row], links: Sequence[Mapping[str, sp.Expr]], letters: Mapping[str, sp.Symbol]
) -> dict[str, sp.Expr]:
    """Return the components by their letters, each by those before it and by inertia.

    Parameters
    ----------
    rows
        Rows of the generalized slider-crank.
    links
        Equilibrium of crank, rod and slider by the names of its rows; it vanishes.
    letters
        Symbols of the wrenches by the names of the paper, as F2_k, f1_zp.
    """
    crank, rod, slider = links
    a1, a2 = rows[0].a, rows[1].a
    s1, c1 = sp.sin(rows[0].theta), sp.cos(rows[0].theta)
    steps = (
        ("F2_k", crank, {"fz": ONE}),
        ("F3_j", rod, {"fy": a2, "mz": ONE}),
        ("F3_k", rod, {"fz": a2, "my": -ONE}),
        ("T4_i", slider, {"mx": ONE}),
        ("T4_j", slider, {"my": ONE}),
        ("T4_k", slider, {"mz": ONE}),
        ("F2_j", crank, {"fy": a1, "mz": ONE}),
        ("F2_i", rod, {"mz": ONE}),
        ("F1_i", crank, {"fx": a1 * c1, "mz": s1}),
        ("F1_j", crank, {"fx": a1 * s1, "mz": -c1}),
        ("F3_i", rod, {"fx": ONE}),
        ("F4_k", slider, {"fz": ONE}),
        ("F4_j", slider, {"fy": ONE}),
        ("F4_i", slider, {"fx": ONE}),
        ("T1_j", crank, {"mx": s1, "my": c1}),
        ("T1_i", crank, {"mx": c1, "my": -s1}),
    )
    solved = {}
    for name, link, combined in steps:
        sums = {}
        for letter, s in letters.items():
            slope = sp.Add(*(factor * partial(link[row], s) for row, factor in combined.items()))
            if slope != 0 and letter[:2] not in _OF_BALLS:
                sums[s] = sp.trigsimp(slope)
        divisor = sums.pop(letters[name])
        solved[name] = sp.Add(*(-sp.cancel(c / divisor) * s for s, c in sums.items()))
    return solved
