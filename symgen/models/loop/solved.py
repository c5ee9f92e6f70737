"""Motion and joint wrenches of a slider-crank one after another, each from a combination of equations.

Source: S. Rahman, *Dynamic Analysis of the Generalized Slider Crank* (1991). Rates and accelerations, Eqs.
(39)-(43) and (38a)-(42a), stand in the order in which the corrected closure determines them. Components of
wrenches are those of Eqs. (69a)-(69q), in their order but for (69k): a remedy for the division of (69h) in
the thesis, it is an identity with (69i) and (69j).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

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


def is_slider_crank(rows: Sequence[Row], balls: Sequence[bool]) -> bool:
    """Return whether rows are of the generalized slider-crank; ``balls`` tells which transmit no moment."""
    found = [{name for name in ("theta", "S", "eta", "alpha", "a") if getattr(r, name) != 0} for r in rows]
    return found == list(_ROWS) and list(balls[1:3]) == [True, True]


def solved_motion(
    rows: Sequence[Row],
    matrix: Mapping[str, Mapping[str, sp.Expr]],
    right: Mapping[str, sp.Expr],
    unknowns: Mapping[str, sp.Symbol],
    ordered: Callable[[sp.Expr], sp.Expr],
) -> dict[str, sp.Expr]:
    """Return the solution of the closure A x = V, of rates or of accelerations, by the names of variables.

    Each is given by those before it. Divisors vanish only where the slider cannot be driven, or the rod or
    the frame of the slider is parallel to the axis of the joint before it.

    Parameters
    ----------
    rows
        Rows of the generalized slider-crank.
    matrix, right
        Rows of A, by the names of variables, and V, in the frame of the rod.
    unknowns
        Symbols of x by the names of variables.
    ordered
        Order of the terms of a sum.
    """
    theta, eta = rows[2].theta, rows[2].eta
    s3, c3 = sp.sin(theta), sp.cos(theta)
    theta2, eta2, S4, alpha3 = rows[1].theta, rows[1].eta, rows[3].S, rows[2].alpha
    steps = (
        (S4, {"vx": ONE}),
        (theta2, {"vy": ONE}),
        (eta2, {"vz": -ONE}),
        (alpha3, {"wx": c3, "wy": s3}),
        (eta, {"wx": -s3, "wy": c3}),
        (theta, {"wz": ONE}),
    )
    solved = {}
    for variable, combined in steps:
        slopes = {
            name: sp.trigsimp(sp.Add(*(factor * matrix[row][name] for row, factor in combined.items())))
            for name in unknowns
        }
        divisor = slopes.pop(variable.name)
        side = sp.Add(*(factor * right[row] for row, factor in combined.items()))
        rest = sp.Add(*(slope * unknowns[name] for name, slope in slopes.items()))
        numerator = sp.expand(side - rest).subs(s3**2, 1 - c3**2)
        solved[variable.name] = ordered(numerator) / divisor
    return solved


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
        for s in letters.values():
            slope = sp.Add(*(factor * partial(link[row], s) for row, factor in combined.items()))
            if slope != 0:
                sums[s] = sp.trigsimp(slope)
        divisor = sums.pop(letters[name])
        solved[name] = sp.Add(*(-sp.cancel(c / divisor) * s for s, c in sums.items()))
    return solved
