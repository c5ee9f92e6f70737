"""Demanding test cases for all methods: difficulty, independent solution and acceptance criterion of each."""

from __future__ import annotations

from collections.abc import Sequence

from symgen.errors import check_known
from symgen.study.stability import elastic, loops, rods
from symgen.study.stability.case import Case, Found, Outcome, Trial, go_through, run_suite

#: All test cases, in the order of the page.
CASES: tuple[Case, ...] = (*rods.CASES, *loops.CASES, *elastic.CASES)

__all__ = ["CASES", "Case", "Found", "Outcome", "Trial", "chosen", "go_through", "run_suite"]


def chosen(names: Sequence[str]) -> tuple[Case, ...]:
    """Return the cases with these names, families or scenes; all cases if none is given.

    Raises
    ------
    ModelError
        For an unknown name, with the nearest known one.
    """
    known = {word for case in CASES for word in _words(case)}
    for name in names:
        check_known(name, known, "there is no hard case")
    return tuple(case for case in CASES if not names or set(names) & set(_words(case)))


def _words(case: Case) -> tuple[str, ...]:
    return case.name, case.family, case.name.split(",")[0].split(" ")[0]
