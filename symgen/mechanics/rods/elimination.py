"""Operation count of eliminating the unknowns of a symmetric system in a given order."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

#: Cost of a variable pivot, in additions and multiplications: later operations wait for its division.
#: Measured on chains of one to ten rods: eliminating all coordinates first is slower from eight rods on.
_PIVOT = 45
#: Additions and multiplications of a solution per entry of the factor below its diagonal.
_SOLUTION = 4


def cost(order: Iterable[int], varies: Mapping[tuple[int, int], bool]) -> int:
    """Return the cost of one factorisation and one solution, in additions and multiplications.

    Constant entries are computed when the code is generated, and only their use counts.

    Parameters
    ----------
    order
        The elimination order of all unknowns.
    varies
        For every nonzero entry, either triangle or both, whether it changes from state to state.
    """
    rows: dict[int, dict[int, bool]] = {k: {} for k in order}
    for (i, j), changes in varies.items():
        rows[i][j] = rows[j][i] = changes
    total = 0
    for k in list(rows):
        row = rows.pop(k)
        pivot = row.pop(k, False)
        total += _PIVOT * pivot
        later = sorted(row)
        for n, i in enumerate(later):
            changes = row[i] or pivot
            total += _SOLUTION + changes
            for j in later[: n + 1]:
                product = changes or row[j]
                total += 2 * product
                rows[i][j] = rows[j][i] = rows[i].get(j, False) or product
            del rows[i][k]
    return total
