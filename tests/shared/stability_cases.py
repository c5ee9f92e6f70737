"""Demanding test cases for all methods: difficulty, independent solution and acceptance criterion of each."""

from __future__ import annotations

from shared import stability_elastic, stability_loops, stability_rods
from shared.stability_case import Case

#: All test cases, in the order of the page.
CASES: tuple[Case, ...] = (*stability_rods.CASES, *stability_loops.CASES, *stability_elastic.CASES)
